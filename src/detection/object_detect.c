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

#include "cairn/detection_curve.h"
#include "src/base/step.h"
#include "src/containers/ranked_list.h"
#include "src/detection/object_detect_object.h"

/* Score weight of the log of the size over the image's diagonal. A piece of a small outline is a few
 * pixels, where edges of background clutter are more likely. */
enum { SIZE_WEIGHT = 1 };
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
static const cairn_real MAX_CONTAINED_SHARE = CAIRN_REAL(0.8);
/* Outline samples of the variants, pairs of boxes looked at in a unit. */
enum { SAMPLES_PER_UNIT = 2, BOXES_PER_UNIT = 4 };

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
static cairn_real contained_share(const cairn_object_detection *a, const cairn_object_detection *b)
{
    cairn_real w = cairn_min(a->right, b->right) - cairn_max(a->left, b->left),
               h = cairn_min(a->bottom, b->bottom) - cairn_max(a->top, b->top),
               smaller = cairn_min((a->right - a->left) * (a->bottom - a->top),
                                   (b->right - b->left) * (b->bottom - b->top));

    return w > 0 && h > 0 ? w * h / smaller : 0;
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

/* Starts to refine the candidate. */
static void begin_candidate(cairn_object_detector *detector)
{
    const object_detect_peak *peak = &detector->peaks[detector->candidate.index];
    cairn_contour_grouping_object object;

    memset(&object, 0, sizeof object);
    object.origin.x = (cairn_real)peak->x;
    object.origin.y = (cairn_real)peak->y;
    object.size = (cairn_real)peak->size;
    object.turn = (cairn_real)peak->turn;
    detector->candidate.model = *detector->model;
    detector->candidate.model.outline = detector->variants[peak->variant].outline;
    cairn_contour_search_refinement_begin(&detector->refinement, &detector->field->tokens,
                                          &detector->candidate.model, &object);
}

/* Sets the detection's outline and box to the fitted outline. */
static void set_outline(cairn_object_detector *detector, cairn_object_detection *detection)
{
    cairn_object_detections *found = &detector->result;
    const contour_search_fit *fit = &detector->refinement.fit;

    detection->first_outline = found->outline_count;
    detection->outline_count = detector->model->outline_count;
    detection->left = detection->top = CAIRN_REAL_MAX;
    detection->right = detection->bottom = -CAIRN_REAL_MAX;
    for (int32_t i = 0; i < detection->outline_count; i++) {
        cairn_contour_search_place *sample = &found->outline[detection->first_outline + i];
        cairn_vec2 position = fit->outline[i].position;

        sample->point = fit->outline[i];
        sample->outline_index = fit->outline_index[i];
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
    contour_search_fitted_outline fitted = {detector->refinement.fit.outline,
                                            detection->outline_count, detection->origin,
                                            detection->size};

    return fitted;
}

/* The fit is complete: makes the detection, and starts to measure its shape. Objects are upright: a
 * rotation counts as tangent deviation. */
static void begin_measure(cairn_object_detector *detector)
{
    const object_detect_peak *peak = &detector->peaks[detector->candidate.index];
    cairn_object_detection *detection = cairn_object_detect_current(detector);
    const contour_search_fit *fit = &detector->refinement.fit;
    contour_search_fitted_outline fitted;
    contour_search_reference reference = {.rotation = {1, 0}};

    memset(detection, 0, sizeof *detection);
    detection->rigid_evidence = (cairn_real)peak->rigid;
    detection->deformed_evidence = fit->evidence / fit->length * CONTOUR_SEARCH_PIECE_LENGTH;
    detection->origin = fit->object.origin;
    detection->size = fit->object.size;
    detection->mirrored = detector->variants[peak->variant].mirrored;
    set_outline(detector, detection);
    fitted = fitted_outline(detector, detection);
    reference.outline = model_outline(detector, detection);
    cairn_contour_search_measure_begin(&detector->refinement.measure, &detector->field->tokens,
                                       &fitted, fit->outline_index, &reference);
}

static void begin_agreement(cairn_object_detector *detector)
{
    cairn_object_detection *detection = cairn_object_detect_current(detector);
    contour_search_fitted_outline fitted = fitted_outline(detector, detection);

    detection->edge_proximity = detector->refinement.measure.shape.edge_proximity;
    detection->tangent_deviation = detector->refinement.measure.shape.tangent_deviation;
    detection->deformation = detector->refinement.measure.shape.deformation;
    cairn_object_detect_agree_begin(&detector->agreement, &fitted,
                                    model_outline(detector, detection),
                                    detector->refinement.measure.proximity);
}

/* The rigid proximity is complete: with `occluded` the outline is placed by its transform. Starts to
 * collect the segments. */
static void begin_collection(cairn_object_detector *detector)
{
    cairn_object_detection *detection = cairn_object_detect_current(detector);
    contour_search_fitted_outline fitted;

    detection->rigid_proximity = detector->agreement.best;
    if (detector->params.occluded && detection->rigid_proximity > 0) {
        cairn_object_detect_place_outline(&detector->agreement.map,
                                          model_outline(detector, detection),
                                          &detector->refinement.fit, detection);
        set_outline(detector, detection);
    }
    detector->result.outline_count += detection->outline_count;
    fitted = fitted_outline(detector, detection);
    cairn_contour_search_collect_begin(&detector->refinement.collector, &detector->field->tokens,
                                       &fitted, NULL);
    detection->first_segment = detector->result.segment_count;
    detector->candidate.segment_length = 0;
}

/* Copies a collected segment. */
static void copy_segment(cairn_object_detector *detector, int32_t index)
{
    int32_t segment = detector->refinement.collector.order[index].segment;

    detector->result.segments[cairn_object_detect_current(detector)->first_segment + index] =
        segment;
    detector->candidate.segment_length +=
        cairn_segment_length(detector->field->tokens.lines[segment]);
}

/* All segments are copied. */
static void end_collection(cairn_object_detector *detector)
{
    cairn_object_detection *detection = cairn_object_detect_current(detector);

    detection->segment_count = detector->refinement.collector.count;
    detector->result.segment_count += detection->segment_count;
    detection->outline_coverage =
        detector->candidate.segment_length / (detector->refinement.fit.length * detection->size);
}

/* Matches an outline sample to the segments. */
static void match_sample(cairn_object_detector *detector, int32_t index)
{
    const cairn_object_detection *detection = cairn_object_detect_current(detector);
    cairn_contour_search_place *sample =
        &detector->result.outline[detection->first_outline + index];

    sample->segment = cairn_contour_search_segment_at(
        detector->field->tokens.lines, detector->result.segments + detection->first_segment,
        detection->segment_count, detection->size, sample->point);
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
    return detection->deformed_evidence +
           CONTOUR_SEARCH_RIGID_EVIDENCE_WEIGHT * detection->rigid_evidence +
           detector->params.verify * detection->grouped_evidence +
           PROXIMITY_WEIGHT * detection->edge_proximity -
           TANGENT_WEIGHT * detection->tangent_deviation -
           DEFORMATION_WEIGHT * detection->deformation +
           (SIZE_WEIGHT * size - ASPECT_WEIGHT * cairn_log(aspect) * cairn_log(aspect) -
            SCORE_OFFSET);
}

static void score_candidate(cairn_object_detector *detector)
{
    int32_t hypothesis = detector->peaks[detector->candidate.index].hypothesis;
    cairn_object_detection *detection = cairn_object_detect_current(detector);

    detection->grouped_evidence = cairn_object_detect_grouped_evidence(&detector->group, detection);
    detection->score = score_of(detector, detection);
    if (hypothesis >= 0)
        cairn_object_detect_set_part_scores(&detector->parts.list[hypothesis], detection);
}

/* ---- Non-maximum suppression ---- */

/* Compares detections: descending score, then order of their making. */
static int32_t compare_detections(const void *first, const void *second)
{
    const cairn_object_detection *a = first, *b = second;

    if (a->score != b->score)
        return a->score < b->score ? 1 : -1;
    return a->first_outline != b->first_outline ? a->first_outline - b->first_outline
                                                : a->first_part - b->first_part;
}

/* 1 when two detections overlap too much; context: the params. */
static int overlap_too_much(const void *context, const void *first, const void *second)
{
    const cairn_object_detect_params *params = context;
    const cairn_object_detection *a = first, *b = second;
    const cairn_real box_a[4] = {a->left, a->top, a->right, a->bottom},
                     box_b[4] = {b->left, b->top, b->right, b->bottom};

    return cairn_detection_curve_overlap(box_a, box_b) > params->overlap ||
           (!cairn_object_detect_is_as_written(params) &&
            contained_share(a, b) > MAX_CONTAINED_SHARE);
}

/* Keeps a detection unless it overlaps a better one that was kept. */
static void keep_if_separate(cairn_object_detector *detector, int32_t index)
{
    const ranked_list kept = {.entries = detector->result.found,
                              .count = &detector->kept,
                              .entry_bytes = sizeof *detector->result.found,
                              .is_near = overlap_too_much,
                              .context = &detector->params};

    ranked_list_keep(&kept, index);
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
    if (field->status != CAIRN_OK)
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
            detector->is_pending = detector->is_complete = 0;
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
    detector->count = detector->group.count = 0;
    detector->status = CAIRN_OK;
    detector->is_pending = 1;
    detector->is_complete = 0;
    detector->units_charged = 0;
    detector->resume = detector->mode_resume = detector->phase_resume = detector->item_resume =
        detector->appearance_resume = 0;
    return CAIRN_OK;
}

/* The parts of the hypotheses are those of the result. */
static void set_parts(cairn_object_detector *detector)
{
    detector->result.parts = detector->parts.parts;
    detector->result.part_count = detector->parts.part_count;
    detector->result.bundle_count = detector->parts.bundles;
}

/* Units of an operation on the samples of a number of outlines. */
static int32_t units_of_outlines(const cairn_object_detector *detector, int32_t count)
{
    return count * detector->model->outline_count / SAMPLES_PER_UNIT;
}

/* Refines and scores a candidate: Method 2 and 3. */
static int refine_candidate(cairn_object_detector *detector, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(detector->item_resume);
    begin_candidate(detector);
    CAIRN_STEP_UNTIL(detector->item_resume,
                     cairn_contour_search_refinement_step(&detector->refinement, budget));
    begin_measure(detector);
    CAIRN_STEP_UNTIL(detector->item_resume,
                     cairn_contour_search_measure_step(&detector->refinement.measure, budget));
    begin_agreement(detector);
    CAIRN_STEP_UNTIL(detector->item_resume,
                     cairn_object_detect_agree_step(&detector->agreement, budget));
    begin_collection(detector);
    CAIRN_STEP_UNTIL(detector->item_resume,
                     cairn_contour_search_collect_step(&detector->refinement.collector, budget));
    for (detector->cursor = 0; detector->cursor < detector->refinement.collector.count;
         detector->cursor++) {
        CAIRN_STEP_CHARGE_UNIT(detector, item_resume, budget);
        copy_segment(detector, detector->cursor);
    }
    end_collection(detector);
    for (detector->cursor = 0; detector->cursor < detector->model->outline_count;
         detector->cursor++) {
        CAIRN_STEP_CHARGE(detector, item_resume, budget,
                          1 + detector->refinement.collector.count / CONTOUR_SEARCH_LINES_PER_UNIT);
        match_sample(detector, detector->cursor);
    }
    CAIRN_STEP_CHARGE(detector, item_resume, budget, 1 + detector->group.count / BOXES_PER_UNIT);
    score_candidate(detector);
    CAIRN_STEP_RUN(detector, item_resume, budget, cairn_object_detect_keep_step);
    CAIRN_STEP_END(detector->item_resume);
}

/* Candidates and their detections in the default mode: Method 1 to 3. */
static int make_detections(cairn_object_detector *detector, cairn_budget *budget)
{
    object_detect_candidate *candidate = &detector->candidate;
    int is_by_parts = detector->params.method == CAIRN_OBJECT_DETECT_PARTS;

    CAIRN_STEP_BEGIN(detector->mode_resume);
    CAIRN_STEP_CHARGE(detector, mode_resume, budget,
                      units_of_outlines(detector, 2 * OBJECT_DETECT_ASPECTS));
    cairn_object_detect_report_stage(detector, CAIRN_OBJECT_DETECT_VOTES);
    cairn_object_detect_variants_add(detector);
    if (is_by_parts) {
        CAIRN_STEP_RUN(detector, mode_resume, budget, cairn_object_detect_parts_step);
        set_parts(detector);
        CAIRN_STEP_CHARGE(detector, mode_resume, budget,
                          1 + detector->parts.count / BOXES_PER_UNIT);
        cairn_object_detect_peaks_of_parts(detector);
    } else {
        CAIRN_STEP_RUN(detector, mode_resume, budget, cairn_object_detect_peaks_step);
    }
    cairn_object_detect_sort_peaks(detector);
    CAIRN_STEP_UNTIL(detector->mode_resume, cairn_detection_sort_step(&detector->sort, budget));
    CAIRN_STEP_RUN(detector, mode_resume, budget, cairn_object_detect_suppress_step);
    if (cairn_object_detect_needs_grouping(&detector->params)) {
        cairn_object_detect_group_begin(detector);
        CAIRN_STEP_RUN(detector, mode_resume, budget, cairn_object_detect_group_step);
    }
    CAIRN_STEP_CHARGE(detector, mode_resume, budget,
                      1 + units_of_outlines(detector, 1) + detector->group.count / BOXES_PER_UNIT);
    add_grouped_candidates(detector);
    cairn_object_detect_report_stage(detector, is_by_parts ? CAIRN_OBJECT_DETECT_BOXES
                                                           : CAIRN_OBJECT_DETECT_SCORES);
    for (candidate->index = 0; candidate->index < detector->count; candidate->index++)
        CAIRN_STEP_RUN(detector, mode_resume, budget, refine_candidate);
    cairn_object_detect_report_stage(detector, CAIRN_OBJECT_DETECT_BOXES);
    CAIRN_STEP_END(detector->mode_resume);
}

/* The detections as written. */
static int make_detections_written(cairn_object_detector *detector, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(detector->mode_resume);
    CAIRN_STEP_RUN(detector, mode_resume, budget, cairn_object_detect_parts_step);
    set_parts(detector);
    cairn_object_detect_report_stage(detector, CAIRN_OBJECT_DETECT_BOXES);
    CAIRN_STEP_RUN(detector, mode_resume, budget, cairn_object_detect_written_step);
    CAIRN_STEP_END(detector->mode_resume);
}

/* The detection: see Method in the head of this file. */
static int detect(cairn_object_detector *detector, cairn_budget *budget)
{
    cairn_object_detections *found = &detector->result;
    int is_written = cairn_object_detect_is_as_written(&detector->params);

    CAIRN_STEP_BEGIN(detector->resume);
    CAIRN_STEP_UNTIL(detector->resume, is_written ? make_detections_written(detector, budget)
                                                  : make_detections(detector, budget));
    cairn_detection_sort_begin(&detector->sort, found->found, found->count, sizeof *found->found,
                               compare_detections);
    CAIRN_STEP_UNTIL(detector->resume, cairn_detection_sort_step(&detector->sort, budget));
    detector->kept = 0;
    for (detector->cursor = 0; detector->cursor < found->count; detector->cursor++) {
        CAIRN_STEP_CHARGE(detector, resume, budget, 1 + detector->kept / BOXES_PER_UNIT);
        keep_if_separate(detector, detector->cursor);
    }
    found->count = detector->kept;
    if (is_written)
        CAIRN_STEP_RUN(detector, resume, budget, cairn_object_detect_written_outlines_step);
    CAIRN_STEP_END(detector->resume);
}

cairn_status cairn_object_detect_step(cairn_object_detector *detector, cairn_budget *budget)
{
    int is_done;

    if (detector == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!detector->is_pending)
        return CAIRN_OK;
    is_done = detect(detector, budget);
    if (!is_done && detector->status >= CAIRN_OK)
        return CAIRN_MORE;
    detector->is_pending = 0;
    detector->is_complete = is_done;
    return detector->status;
}

cairn_object_detections cairn_object_detect_read(const cairn_object_detector *detector)
{
    cairn_object_detections none;

    memset(&none, 0, sizeof none);
    return detector->is_complete ? detector->result : none;
}
