/* Detection of objects of a class by their outlines.
 *
 * Method:
 * 1. Candidates by template matching over a scale pyramid (a probabilistic oriented chamfer
 *    distance): a score map for each size and variant of the model (mirrored or not, five aspect
 *    ratios). It holds the mean log-likelihood ratio of the outline's samples
 *    (object_detect_field.c) at every position of the origin, a correlation by sums of shifted
 *    levels. The peaks of all maps after non-maximum suppression are the candidates
 *    (object_detect_candidates.c).
 * 2. Refinement: the outline is deformed to the edges around each candidate (contour_search_fit.c).
 * 3. Score: a linear combination of the log-likelihood ratios before and after deformation, the
 *    shape quality (contour_search_shape.c), and the log-likelihood ratio of contour grouping at
 *    the same position (object_detect_group.c). Boxes are those of the deformed outlines.
 * 4. Non-maximum suppression of overlapping detections.
 *
 * PARTS: the candidates are configurations of parts (object_detect_parts.c) and keep their scores;
 * deformation gives the box only. As written nothing is deformed (object_detect_written.c).
 *
 * Source: this project's, except PARTS; of Adluru 2008, section 5, only the two stages, coarse then
 * fine. */
#include "src/base/build.h"

#include <string.h>

#include "src/detection/object_detect_object.h"

/* Evidence of a deformed outline is per piece of this length, share of the size
 * (contour_search_fit.c). */
static const cairn_real PIECE_LENGTH = CAIRN_REAL(0.08);
/* Score weights: evidence before deformation, and log of the size over the image's diagonal;
 * evidence after deformation has weight 1. A piece of a small outline is a few pixels, where edges
 * of background clutter are more likely. */
enum { RIGID_EVIDENCE_WEIGHT = 2, SIZE_WEIGHT = 1 };
/* Score weights: edge proximity, tangent deviation and deformation (contour_search_shape.c). */
enum { PROXIMITY_WEIGHT = 12, TANGENT_WEIGHT = 32, DEFORMATION_WEIGHT = 16 };
/* Score offset: the typical score without an object, so that most images without one have no
 * detection above 0 (docs/lab/detect.md). */
static const cairn_real SCORE_OFFSET = CAIRN_REAL(10.7);
/* Score weight of the squared log ratio of the box's aspect ratio to the model's. */
enum { ASPECT_WEIGHT = 1 };
/* Score weights with `occluded`: rigid proximity, grouped evidence and size only, because
 * deformation would snap occluded samples to the occluder's edges. Scores keep the same zero. */
enum { OCCLUDED_PROXIMITY_WEIGHT = 20, OCCLUDED_SIZE_WEIGHT = 2, OCCLUDED_SCORE_OFFSET = 8 };
static const cairn_real OCCLUDED_GROUPING_WEIGHT = CAIRN_REAL(0.5);
/* Non-maximum suppression also removes a detection when more of the smaller box than this lies in
 * the other: parts of an object resemble small objects. */
static const float MAX_CONTAINED_SHARE = 0.8F;
/* A segment matches an outline sample within this distance, share of the size, but at least
 * MIN_DISTANCE_PX; and within this cosine of the angle. */
static const cairn_real MAX_DISTANCE_SHARE = CAIRN_REAL(0.04), MIN_COSINE = CAIRN_REAL(0.7);
enum { MIN_DISTANCE_PX = 3 };

/* Phases: those from FIELD to APPEARANCE for each candidate. */
enum {
    PHASE_IDLE,
    PHASE_VARIANTS,
    PHASE_PARTS,
    PHASE_PEAKS,
    PHASE_SORT_PEAKS,
    PHASE_SUPPRESS_PEAKS,
    PHASE_GROUP,
    PHASE_REFINE,
    PHASE_FIELD,
    PHASE_FIT,
    PHASE_MEASURE,
    PHASE_AGREE,
    PHASE_COLLECT,
    PHASE_SEGMENTS,
    PHASE_OUTLINE,
    PHASE_SCORE,
    PHASE_APPEARANCE,
    PHASE_WRITTEN,
    PHASE_SORT,
    PHASE_SUPPRESS,
    PHASE_WRITTEN_OUTLINES,
    PHASE_DONE
};
/* Outline samples of the variants, segments, pairs of boxes looked at in a unit. */
enum { SAMPLES_PER_UNIT = 2, LINES_PER_UNIT = 6, BOXES_PER_UNIT = 4 };

/* ---- The model ---- */

/* Returns 1 when the box of the outline has a width and a height. */
static int has_area(const cairn_shape_model *model)
{
    cairn_box box = cairn_box_empty();

    for (int32_t i = 0; i < model->outline_count; i++)
        box = cairn_box_extend(box, model->outline[i].position);
    return box.max.x > box.min.x && box.max.y > box.min.y;
}

static cairn_status check_model(const cairn_object_detect_params *params,
                                const cairn_shape_model *model, cairn_fault *fault)
{
    cairn_status status = cairn_shape_model_check(model, fault);

    if (status == CAIRN_OK && model->outline_count < 3)
        status = cairn_refuse(fault, -1, "a model of fewer than 3 samples, expected an outline",
                              CAIRN_BAD_ARGUMENT);
    if (status == CAIRN_OK && !has_area(model))
        status = cairn_refuse(
            fault, -1, "an outline along one straight line, expected one with a width and a height",
            CAIRN_BAD_ARGUMENT);
    if (status == CAIRN_OK && !cairn_object_detect_variants_are_inside_margin(model))
        status = cairn_refuse(
            fault, -1,
            "the outline extends farther from its origin than half its size, expected it within",
            CAIRN_BAD_ARGUMENT);
    if (status == CAIRN_OK &&
        (model->outline_count > params->max_outline || model->sample_count > params->max_samples))
        status = cairn_refuse(fault, -1, "a model beyond max_outline or max_samples", CAIRN_FULL);
    return status;
}

/* ---- Candidates ---- */

/* Share of the smaller of two boxes that lies in the other. */
static float contained_share(const cairn_object_detection *a, const cairn_object_detection *b)
{
    cairn_real w = cairn_min(a->right, b->right) - cairn_max(a->left, b->left),
               h = cairn_min(a->bottom, b->bottom) - cairn_max(a->top, b->top),
               smaller = cairn_min((a->right - a->left) * (a->bottom - a->top),
                                   (b->right - b->left) * (b->bottom - b->top));

    return w > 0 && h > 0 ? (float)(w * h / smaller) : 0;
}

/* With `occluded` grouped objects become additional candidates, at most `candidates`. They bypass
 * the non-maximum suppression of candidates, but not that of detections. */
static void add_grouped_candidates(cairn_object_detector *detector)
{
    const cairn_object_detect_params *params = &detector->params;

    for (int32_t i = 0; params->occluded && i < detector->group.count && i < params->candidates;
         i++) {
        const object_detect_grouping *grouped = &detector->group.list[i];
        object_detect_peak *peak = &detector->peaks[detector->count++];

        peak->score = peak->rigid = 0;
        peak->x = (float)grouped->found.origin.x;
        peak->y = (float)grouped->found.origin.y;
        peak->size = (float)grouped->found.size;
        peak->turn = (float)grouped->found.turn;
        peak->variant = grouped->mirrored ? OBJECT_DETECT_ASPECTS : 0;
        peak->hypothesis = -1;
    }
}

/* ---- Refinement ---- */

/* The detection of the current candidate, behind those that were kept. */
static cairn_object_detection *current_detection(cairn_object_detector *detector)
{
    return &detector->result.found[detector->result.count];
}

/* Starts to refine the next candidate. */
static void begin_candidate(cairn_object_detector *detector)
{
    const object_detect_peak *peak = &detector->peaks[detector->item];
    cairn_contour_grouping_object object;

    memset(&object, 0, sizeof object);
    object.origin.x = (cairn_real)peak->x;
    object.origin.y = (cairn_real)peak->y;
    object.size = (cairn_real)peak->size;
    object.turn = (cairn_real)peak->turn;
    detector->variant_model = *detector->model;
    detector->variant_model.outline = detector->variants[peak->variant].outline;
    detector->fit.object = object;
    cairn_contour_search_field_begin(&detector->window, &detector->field->tokens, object.origin,
                                     object.size);
}

/* Sets the detection's outline and box to the fitted outline. */
static void set_outline(cairn_object_detector *detector, cairn_object_detection *detection)
{
    cairn_object_detections *found = &detector->result;

    detection->first_outline = found->outline_count;
    detection->outline_count = detector->model->outline_count;
    detection->left = detection->top = CAIRN_REAL_MAX;
    detection->right = detection->bottom = -CAIRN_REAL_MAX;
    for (int32_t i = 0; i < detection->outline_count; i++) {
        cairn_contour_search_place *sample = &found->outline[detection->first_outline + i];
        cairn_vec2 position = detector->fit.outline[i].position;

        sample->point = detector->fit.outline[i];
        sample->outline_index = detector->fit.outline_index[i];
        detection->left = cairn_min(detection->left, position.x);
        detection->right = cairn_max(detection->right, position.x);
        detection->top = cairn_min(detection->top, position.y);
        detection->bottom = cairn_max(detection->bottom, position.y);
    }
}

/* The model outline, mirrored if the detection is. */
static const cairn_oriented_point *model_outline(const cairn_object_detector *detector,
                                                 const cairn_object_detection *detection)
{
    return detector->variants[detection->mirrored ? OBJECT_DETECT_ASPECTS : 0].outline;
}

static contour_search_fitted_outline fitted_outline(const cairn_object_detector *detector,
                                                    const cairn_object_detection *detection)
{
    contour_search_fitted_outline fitted = {detector->fit.outline, detection->outline_count,
                                            detection->origin, detection->size};

    return fitted;
}

/* The fit is complete: makes the detection, and starts to measure its shape. Objects are upright: a
 * rotation counts as tangent deviation. */
static void begin_measure(cairn_object_detector *detector)
{
    const object_detect_peak *peak = &detector->peaks[detector->item];
    cairn_object_detection *detection = current_detection(detector);
    contour_search_fitted_outline fitted;
    contour_search_reference reference = {.rotation = {1, 0}};

    memset(detection, 0, sizeof *detection);
    detection->rigid_evidence = (cairn_real)peak->rigid;
    detection->deformed_evidence = detector->fit.evidence / detector->fit.length * PIECE_LENGTH;
    detection->origin = detector->fit.object.origin;
    detection->size = detector->fit.object.size;
    detection->mirrored = detector->variants[peak->variant].mirrored;
    set_outline(detector, detection);
    fitted = fitted_outline(detector, detection);
    reference.outline = model_outline(detector, detection);
    cairn_contour_search_measure_begin(&detector->measure, &detector->field->tokens, &fitted,
                                       detector->fit.outline_index, &reference);
}

static void begin_agreement(cairn_object_detector *detector)
{
    cairn_object_detection *detection = current_detection(detector);
    contour_search_fitted_outline fitted = fitted_outline(detector, detection);

    detection->edge_proximity = detector->measure.shape.edge_proximity;
    detection->tangent_deviation = detector->measure.shape.tangent_deviation;
    detection->deformation = detector->measure.shape.deformation;
    cairn_object_detect_agree_begin(&detector->agreement, &fitted,
                                    model_outline(detector, detection),
                                    detector->measure.proximity);
}

/* The rigid proximity is complete: with `occluded` the outline is placed by its transform. Starts to
 * collect the segments. */
static void begin_collection(cairn_object_detector *detector)
{
    cairn_object_detection *detection = current_detection(detector);
    contour_search_fitted_outline fitted;

    detection->rigid_proximity = detector->agreement.best;
    if (detector->params.occluded && detection->rigid_proximity > 0) {
        cairn_object_detect_place_outline(&detector->agreement.map,
                                          model_outline(detector, detection), &detector->fit,
                                          detection);
        set_outline(detector, detection);
    }
    detector->result.outline_count += detection->outline_count;
    fitted = fitted_outline(detector, detection);
    cairn_contour_search_collect_begin(&detector->collector, &detector->field->tokens, &fitted,
                                       NULL);
    detection->first_segment = detector->result.segment_count;
    detector->segment_length = 0;
}

/* Copies the collected segments. */
static cairn_status step_segments(cairn_object_detector *detector, cairn_budget *budget)
{
    const contour_search_collector *collector = &detector->collector;
    cairn_object_detection *detection = current_detection(detector);

    for (; detector->cursor < collector->count; detector->cursor++) {
        int32_t segment = collector->order[detector->cursor].segment;

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        detector->result.segments[detection->first_segment + detector->cursor] = segment;
        detector->segment_length += cairn_segment_length(detector->field->tokens.lines[segment]);
    }
    detection->segment_count = collector->count;
    detector->result.segment_count += collector->count;
    detection->outline_coverage =
        detector->segment_length / (detector->fit.length * detection->size);
    return CAIRN_OK;
}

/* The segment nearest to an outline sample and nearly parallel to it; -1: none. */
static int32_t segment_at(const cairn_object_detector *detector,
                          const cairn_object_detection *detection, cairn_oriented_point point)
{
    const int32_t *list = detector->result.segments + detection->first_segment;
    cairn_real nearest = cairn_max(MIN_DISTANCE_PX, MAX_DISTANCE_SHARE * detection->size);
    int32_t found = -1;

    for (int32_t i = 0; i < detection->segment_count; i++) {
        cairn_segment line = detector->field->tokens.lines[list[i]];
        cairn_real distance = cairn_contour_search_point_distance(line, point.position);
        cairn_vec2 along = cairn_vec2_unit(cairn_vec2_sub(line.b, line.a));

        if (distance < nearest && cairn_abs(cairn_vec2_dot(along, point.direction)) >= MIN_COSINE) {
            nearest = distance;
            found = list[i];
        }
    }
    return found;
}

/* Matches the outline's samples to the segments. */
static cairn_status step_outline(cairn_object_detector *detector, cairn_budget *budget)
{
    const cairn_object_detection *detection = current_detection(detector);

    for (; detector->cursor < detection->outline_count; detector->cursor++) {
        cairn_contour_search_place *sample =
            &detector->result.outline[detection->first_outline + detector->cursor];

        if (!cairn_budget_charge(budget, &detector->units_charged,
                                 1 + detection->segment_count / LINES_PER_UNIT))
            return CAIRN_MORE;
        sample->segment = segment_at(detector, detection, sample->point);
    }
    return CAIRN_OK;
}

/* ---- Score ---- */

static cairn_real score_of(const cairn_object_detector *detector,
                           const cairn_object_detection *detection)
{
    const float *plain = detector->variants[0].box;
    const cairn_contour_search_tokens *tokens = &detector->field->tokens;
    const cairn_vec2 sides = {(cairn_real)tokens->width, (cairn_real)tokens->height};
    cairn_real size = cairn_log(detection->size / cairn_vec2_norm(sides));
    cairn_real aspect = (detection->right - detection->left) * (cairn_real)(plain[3] - plain[1]) /
                        ((detection->bottom - detection->top) * (cairn_real)(plain[2] - plain[0]));

    if (detector->params.occluded)
        return OCCLUDED_PROXIMITY_WEIGHT * detection->rigid_proximity +
               OCCLUDED_GROUPING_WEIGHT * detection->grouped_evidence +
               (OCCLUDED_SIZE_WEIGHT * size - OCCLUDED_SCORE_OFFSET);
    return detection->deformed_evidence + RIGID_EVIDENCE_WEIGHT * detection->rigid_evidence +
           detector->params.verify * detection->grouped_evidence +
           PROXIMITY_WEIGHT * detection->edge_proximity -
           TANGENT_WEIGHT * detection->tangent_deviation -
           DEFORMATION_WEIGHT * detection->deformation +
           (SIZE_WEIGHT * size - ASPECT_WEIGHT * cairn_log(aspect) * cairn_log(aspect) -
            SCORE_OFFSET);
}

/* Copies the scores of a hypothesis by parts. */
static void set_part_scores(const object_detect_hypothesis *hypothesis,
                            cairn_object_detection *detection)
{
    detection->score = hypothesis->score;
    detection->shape_distance = hypothesis->distance;
    detection->configuration_score = hypothesis->agreement;
    detection->first_part = hypothesis->first_part;
    detection->part_count = hypothesis->part_count;
}

/* Scores the candidate; with appearance starts to score its box. */
static cairn_status step_score(cairn_object_detector *detector, cairn_budget *budget)
{
    const object_detect_peak *peak = &detector->peaks[detector->item];
    cairn_object_detection *detection = current_detection(detector);
    const cairn_real box[4] = {detection->left, detection->top, detection->right,
                               detection->bottom};

    if (!cairn_budget_charge(budget, &detector->units_charged,
                             1 + detector->group.count / BOXES_PER_UNIT))
        return CAIRN_MORE;
    detection->grouped_evidence = cairn_object_detect_grouped_evidence(&detector->group, detection);
    detection->score = score_of(detector, detection);
    if (peak->hypothesis >= 0)
        set_part_scores(&detector->parts.list[peak->hypothesis], detection);
    return detector->params.appearance != NULL
               ? cairn_appearance_begin_box(detector->params.appearance, box)
               : CAIRN_OK;
}

/* Adds the appearance term of the box (Adluru 2008, eq. 5.1, with 1 - probability as the distance
 * of appearance), and keeps the candidate whose score before it is high enough. */
static cairn_status step_appearance(cairn_object_detector *detector, cairn_budget *budget)
{
    cairn_object_detection *detection = current_detection(detector);
    int32_t is_kept = detection->score >= detector->params.min_score;

    if (detector->params.appearance != NULL) {
        cairn_status status = cairn_appearance_step(detector->params.appearance, budget);

        if (status != CAIRN_OK)
            return status;
        detection->appearance = cairn_appearance_read(detector->params.appearance).probability;
        detection->score -= detector->params.appearance_weight * (1 - detection->appearance);
    }
    detector->result.count += is_kept;
    detector->item++;
    return CAIRN_OK;
}

/* ---- Non-maximum suppression ---- */

int32_t cairn_object_detect_compare(const void *first, const void *second)
{
    const cairn_object_detection *a = first, *b = second;

    if (a->score != b->score)
        return a->score < b->score ? 1 : -1;
    return a->first_outline != b->first_outline ? a->first_outline - b->first_outline
                                                : a->first_part - b->first_part;
}

static int is_separate(const cairn_object_detector *detector, const cairn_object_detection *a,
                       const cairn_object_detection *b)
{
    const float first[4] = {(float)a->left, (float)a->top, (float)a->right, (float)a->bottom},
                second[4] = {(float)b->left, (float)b->top, (float)b->right, (float)b->bottom};

    return cairn_object_detect_overlap(first, second) <= (float)detector->params.overlap &&
           (cairn_object_detect_is_as_written(&detector->params) ||
            contained_share(a, b) <= MAX_CONTAINED_SHARE);
}

static cairn_status step_suppress(cairn_object_detector *detector, cairn_budget *budget)
{
    cairn_object_detections *found = &detector->result;

    for (; detector->cursor < found->count; detector->cursor++) {
        const cairn_object_detection *detection = &found->found[detector->cursor];
        int separate = 1;

        if (!cairn_budget_charge(budget, &detector->units_charged,
                                 1 + detector->kept / BOXES_PER_UNIT))
            return CAIRN_MORE;
        for (int32_t k = 0; k < detector->kept && separate; k++)
            separate = is_separate(detector, detection, &found->found[k]);
        if (separate)
            found->found[detector->kept++] = *detection;
    }
    found->count = detector->kept;
    return CAIRN_OK;
}

/* ---- The steps ---- */

cairn_status cairn_object_detect_begin(cairn_object_detector *detector,
                                       cairn_object_detect_field *field,
                                       const cairn_shape_model *model, cairn_fault *fault)
{
    cairn_status status;

    if (detector == NULL || field == NULL || model == NULL)
        return cairn_refuse(fault, -1, "no detector, field or model, expected all of them",
                            CAIRN_BAD_ARGUMENT);
    if (!field->is_complete)
        return cairn_refuse(fault, -1, "a field without an image, expected a complete one",
                            CAIRN_EMPTY);
    if (field->params.method != detector->params.method ||
        field->params.min_size != detector->params.min_size ||
        field->params.max_size != detector->params.max_size ||
        field->tokens.width > detector->params.max_width ||
        field->tokens.height > detector->params.max_height ||
        field->tokens.count > detector->params.max_segments ||
        field->chains.count > detector->params.max_chains)
        return cairn_refuse(fault, -1, "a field of other params, expected those of the detector",
                            CAIRN_BAD_ARGUMENT);
    status = check_model(&detector->params, model, fault);
    if (status != CAIRN_OK)
        return status;
    detector->field = field;
    detector->model = model;
    if (detector->params.method == CAIRN_OBJECT_DETECT_PARTS) {
        status = cairn_object_detect_parts_begin(detector);
        if (status != CAIRN_OK) {
            detector->phase = PHASE_IDLE;
            return cairn_refuse(fault, -1,
                                "no fragments of the first outline, expected an outline with "
                                "length, or valid cuts",
                                status);
        }
    }
    detector->result.count = detector->result.segment_count = 0;
    detector->result.outline_count = detector->result.part_count = 0;
    detector->result.bundle_count = 0;
    detector->result.parts = NULL;
    detector->result.has_appearance = detector->params.appearance != NULL;
    detector->count = detector->kept = detector->cursor = detector->item = 0;
    detector->level = detector->variant = detector->sample = detector->row = 0;
    detector->group.count = 0;
    detector->units_charged = 0;
    detector->phase = PHASE_VARIANTS;
    return CAIRN_OK;
}

static cairn_status step_variants(cairn_object_detector *detector, cairn_budget *budget)
{
    if (cairn_object_detect_is_as_written(&detector->params))
        return CAIRN_OK;
    if (!cairn_budget_charge(budget, &detector->units_charged,
                             2 * OBJECT_DETECT_ASPECTS * detector->model->outline_count /
                                 SAMPLES_PER_UNIT))
        return CAIRN_MORE;
    cairn_object_detect_report_stage(detector, CAIRN_OBJECT_DETECT_VOTES);
    cairn_object_detect_variants_add(detector);
    return CAIRN_OK;
}

/* Items whose cost is linear in the samples of the outline. */
static cairn_status charge_samples(cairn_object_detector *detector, cairn_budget *budget)
{
    return cairn_budget_charge(budget, &detector->units_charged,
                               1 + detector->model->outline_count / SAMPLES_PER_UNIT)
               ? CAIRN_OK
               : CAIRN_MORE;
}

static cairn_status step_phase(cairn_object_detector *detector, cairn_budget *budget)
{
    switch (detector->phase) {
    case PHASE_VARIANTS:
        return step_variants(detector, budget);
    case PHASE_PARTS:
        return cairn_object_detect_parts_step(detector, budget);
    case PHASE_PEAKS:
        return cairn_object_detect_peaks_step(detector, budget);
    case PHASE_SORT_PEAKS:
    case PHASE_SORT:
        return cairn_detection_sort_step(&detector->sort, budget);
    case PHASE_SUPPRESS_PEAKS:
        return cairn_object_detect_suppress_step(detector, budget);
    case PHASE_GROUP:
        return cairn_object_detect_group_step(detector, budget);
    case PHASE_REFINE:
        return charge_samples(detector, budget);
    case PHASE_FIELD:
        return cairn_contour_search_field_step(&detector->window, budget);
    case PHASE_FIT:
        return cairn_contour_search_fit_step(&detector->fit, budget);
    case PHASE_MEASURE:
        return cairn_contour_search_measure_step(&detector->measure, budget);
    case PHASE_AGREE:
        return cairn_object_detect_agree_step(&detector->agreement, budget);
    case PHASE_COLLECT:
        return cairn_contour_search_collect_step(&detector->collector, budget);
    case PHASE_SEGMENTS:
        return step_segments(detector, budget);
    case PHASE_OUTLINE:
        return step_outline(detector, budget);
    case PHASE_SCORE:
        return step_score(detector, budget);
    case PHASE_APPEARANCE:
        return step_appearance(detector, budget);
    case PHASE_WRITTEN:
        return cairn_object_detect_written_step(detector, budget);
    case PHASE_SUPPRESS:
        return step_suppress(detector, budget);
    default:
        return cairn_object_detect_written_outlines_step(detector, budget);
    }
}

/* The parts of the hypotheses are those of the result. */
static void set_parts(cairn_object_detector *detector)
{
    detector->result.parts = detector->parts.parts;
    detector->result.part_count = detector->parts.part_count;
    detector->result.bundle_count = detector->parts.bundles;
}

/* Starts to sort the detections. */
static void begin_sort(cairn_object_detector *detector)
{
    if (!cairn_object_detect_is_as_written(&detector->params))
        cairn_object_detect_report_stage(detector, CAIRN_OBJECT_DETECT_BOXES);
    detector->kept = 0;
    cairn_detection_sort_begin(&detector->sort, detector->result.found, detector->result.count,
                               sizeof *detector->result.found, cairn_object_detect_compare);
}

/* The phase after the candidates are known: grouping, or refinement. */
static int32_t phase_after_peaks(cairn_object_detector *detector)
{
    detector->item = 0;
    if (cairn_object_detect_needs_grouping(&detector->params)) {
        cairn_object_detect_group_begin(detector);
        return PHASE_GROUP;
    }
    return PHASE_REFINE;
}

/* The phase after a hypothesis search by parts. */
static int32_t phase_after_parts(cairn_object_detector *detector)
{
    set_parts(detector);
    if (cairn_object_detect_is_as_written(&detector->params)) {
        cairn_object_detect_report_stage(detector, CAIRN_OBJECT_DETECT_BOXES);
        return PHASE_WRITTEN;
    }
    cairn_object_detect_peaks_of_parts(detector);
    cairn_object_detect_sort_peaks(detector);
    return PHASE_SORT_PEAKS;
}

/* The phase of the next candidate; after the last one the sort. */
static int32_t next_candidate(cairn_object_detector *detector)
{
    if (detector->item < detector->count) {
        begin_candidate(detector);
        return PHASE_FIELD;
    }
    begin_sort(detector);
    return PHASE_SORT;
}

/* Prepares the phase that follows a completed one, and returns it. */
static int32_t next_phase(cairn_object_detector *detector)
{
    switch (detector->phase) {
    case PHASE_VARIANTS:
        return detector->params.method == CAIRN_OBJECT_DETECT_PARTS ? PHASE_PARTS : PHASE_PEAKS;
    case PHASE_PARTS:
        return phase_after_parts(detector);
    case PHASE_PEAKS:
        cairn_object_detect_sort_peaks(detector);
        return PHASE_SORT_PEAKS;
    case PHASE_SUPPRESS_PEAKS:
        return phase_after_peaks(detector);
    case PHASE_GROUP:
        add_grouped_candidates(detector);
        return PHASE_REFINE;
    case PHASE_REFINE:
        cairn_object_detect_report_stage(detector,
                                         detector->params.method == CAIRN_OBJECT_DETECT_PARTS
                                             ? CAIRN_OBJECT_DETECT_BOXES
                                             : CAIRN_OBJECT_DETECT_SCORES);
        return next_candidate(detector);
    case PHASE_FIELD:
        cairn_contour_search_fit_begin(&detector->fit, &detector->window, &detector->variant_model,
                                       &detector->fit.object);
        return PHASE_FIT;
    case PHASE_FIT:
        begin_measure(detector);
        return PHASE_MEASURE;
    case PHASE_MEASURE:
        begin_agreement(detector);
        return PHASE_AGREE;
    case PHASE_AGREE:
        begin_collection(detector);
        return PHASE_COLLECT;
    case PHASE_APPEARANCE:
        return next_candidate(detector);
    case PHASE_WRITTEN:
        begin_sort(detector);
        return PHASE_SORT;
    case PHASE_SUPPRESS:
        return cairn_object_detect_is_as_written(&detector->params) ? PHASE_WRITTEN_OUTLINES
                                                                    : PHASE_DONE;
    default:
        return detector->phase + 1;
    }
}

cairn_status cairn_object_detect_step(cairn_object_detector *detector, cairn_budget *budget)
{
    if (detector == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (detector->phase != PHASE_IDLE && detector->phase != PHASE_DONE) {
        cairn_status status = step_phase(detector, budget);

        if (status < 0)
            detector->phase = PHASE_IDLE;
        if (status != CAIRN_OK)
            return status;
        detector->cursor = 0;
        detector->phase = next_phase(detector);
    }
    return CAIRN_OK;
}

cairn_object_detections cairn_object_detect_read(const cairn_object_detector *detector)
{
    cairn_object_detections none;

    memset(&none, 0, sizeof none);
    return detector->phase == PHASE_DONE ? detector->result : none;
}
