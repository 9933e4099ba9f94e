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

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/shape_model_file.h"
#include "src/host/detection/contour_search_fit.h"
#include "src/host/detection/object_detect_candidates.h"

/* Evidence of a deformed outline is per piece of this length, share of the size
 * (contour_search_fit.c). */
#define PIECE_LENGTH 0.08
/* Score weights: evidence before deformation, and log of the size over the image's diagonal;
 * evidence after deformation has weight 1. A piece of a small outline is a few pixels, where edges
 * of background clutter are more likely. */
#define RIGID_EVIDENCE_WEIGHT 2
#define SIZE_WEIGHT           1
/* Score weights: edge proximity, tangent deviation and deformation (contour_search_shape.c). */
#define PROXIMITY_WEIGHT   12
#define TANGENT_WEIGHT     32
#define DEFORMATION_WEIGHT 16
/* Score offset: the typical score without an object, so that most images without one have no
 * detection above 0 (docs/lab/detect.md). */
#define SCORE_OFFSET 10.7
/* Score weight of the squared log ratio of the box's aspect ratio to the model's. */
#define ASPECT_WEIGHT 1
/* Score weights with `occluded`: rigid proximity, grouped evidence and size only, because
 * deformation would snap occluded samples to the occluder's edges. Scores keep the same zero. */
#define OCCLUDED_PROXIMITY_WEIGHT 20
#define OCCLUDED_GROUPING_WEIGHT  CAIRN_REAL(0.5)
#define OCCLUDED_SIZE_WEIGHT      2
#define OCCLUDED_SCORE_OFFSET     8
/* Non-maximum suppression also removes a detection when more of the smaller box than this lies in
 * the other: parts of an object resemble small objects. */
#define MAX_CONTAINED_SHARE 0.8F
/* A segment matches an outline sample within this distance, share of the size, but at least
 * MIN_DISTANCE_PX; and within this cosine of the angle. */
#define MAX_DISTANCE_SHARE 0.04
#define MIN_DISTANCE_PX    3
#define MIN_COSINE         0.7

cairn_object_detect_params cairn_object_detect_default(int32_t width, int32_t height)
{
    cairn_real diagonal = (cairn_real)hypot((double)width, (double)height);
    cairn_object_detect_params params = {
        .min_size = cairn_max(24, diagonal / 10),
        .max_size = cairn_max(24, diagonal),
        .mirror = 1,
        .candidates = 30,
        .overlap = CAIRN_REAL(0.2),
        .min_score = 0,
        .method = CAIRN_OBJECT_DETECT_EVIDENCE,
        .bundles = CAIRN_OBJECT_DETECT_BUNDLES,
        .cuts = NULL,
        .cut_count = 0,
        .matches = 2,
        .nearest = 20,
        .modes_only = 0,
        .appearance = NULL,
        .appearance_weight = 8,
        .on_stage = NULL,
        .on_stage_context = NULL,
        .occluded = 0,
        .verify = CAIRN_REAL(0.08),
        .mode = CAIRN_MODE_DEFAULT,
        .appearance_nearest = 0,
    };

    return params;
}

void cairn_object_detections_free(cairn_object_detections *detections)
{
    free(detections->found);
    free(detections->segments);
    free(detections->outline);
    free(detections->parts);
    memset(detections, 0, sizeof *detections);
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

/* Groups contours; with `occluded` grouped objects become additional candidates, at most
 * `candidates`. They bypass the non-maximum suppression of candidates, but not that of detections.
 * MAX_PEAKS leaves capacity for them. */
static cairn_status group_contours(object_detector *detector)
{
    const cairn_object_detect_params *params = &detector->field->params;
    cairn_status status =
        params->occluded || params->verify > 0
            ? cairn_object_detect_group(&detector->groupings, detector->field, detector->model)
            : CAIRN_OK;

    for (int32_t i = 0; status == CAIRN_OK && params->occluded && i < detector->groupings.count &&
                        i < params->candidates;
         i++) {
        const object_detect_grouping *grouped = &detector->groupings.list[i];
        object_detect_peak *peak = &detector->peaks[detector->count++];

        peak->score = peak->rigid = 0;
        peak->x = (float)grouped->found.origin.x;
        peak->y = (float)grouped->found.origin.y;
        peak->size = (float)grouped->found.size;
        peak->turn = (float)grouped->found.turn;
        peak->variant = grouped->mirrored ? OBJECT_DETECT_ASPECTS : 0;
        peak->hypothesis = -1;
    }
    return status;
}

/* ---- Detections ---- */

static void append_outline(const object_detector *detector, cairn_object_detections *found,
                           cairn_object_detection *detection)
{
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
    found->outline_count += detection->outline_count;
}

/* The segment nearest to an outline sample and nearly parallel to it; -1: none. */
static int32_t segment_at(const object_detector *detector, const int32_t *list, int32_t count,
                          cairn_oriented_point point, cairn_real size)
{
    cairn_real nearest = cairn_max(MIN_DISTANCE_PX, (cairn_real)MAX_DISTANCE_SHARE * size);
    int32_t found = -1;

    for (int32_t i = 0; i < count; i++) {
        cairn_segment line = detector->field->tokens->lines[list[i]];
        cairn_real distance = cairn_contour_search_point_distance(line, point.position);
        cairn_vec2 along = cairn_vec2_unit(cairn_vec2_sub(line.b, line.a));

        if (distance < nearest &&
            cairn_abs(cairn_vec2_dot(along, point.direction)) >= (cairn_real)MIN_COSINE) {
            nearest = distance;
            found = list[i];
        }
    }
    return found;
}

/* Appends the segments along the deformed outline, and matches its samples to them. Returns 0 when
 * out of memory. */
static int append_segments(const object_detector *detector, cairn_object_detections *found,
                           cairn_object_detection *detection)
{
    const cairn_contour_search_tokens *tokens = detector->field->tokens;
    contour_search_fitted_outline fitted = {detector->fit.outline, detector->model->outline_count,
                                            detection->origin, detection->size};
    int32_t *list = realloc(
        found->segments, ((size_t)found->segment_count + (size_t)tokens->count + 1) * sizeof *list);
    cairn_real length = 0;

    if (list == NULL)
        return 0;
    found->segments = list;
    detection->first_segment = found->segment_count;
    list += found->segment_count;
    if (!cairn_contour_search_collect_segments(tokens, &fitted, list, &detection->segment_count))
        return 0;
    found->segment_count += detection->segment_count;
    for (int32_t i = 0; i < detection->segment_count; i++)
        length += cairn_segment_length(tokens->lines[list[i]]);
    detection->outline_coverage = length / (detector->fit.length * detection->size);
    for (int32_t i = 0; i < detection->outline_count; i++) {
        cairn_contour_search_place *sample = &found->outline[detection->first_outline + i];

        sample->segment =
            segment_at(detector, list, detection->segment_count, sample->point, detection->size);
    }
    return 1;
}

/* The model outline, mirrored if the detection is. */
static const cairn_oriented_point *model_outline(const object_detector *detector,
                                                 const cairn_object_detection *detection)
{
    return detector->variants[detection->mirrored ? OBJECT_DETECT_ASPECTS : 0].outline;
}

/* Computes the shape quality. Objects are upright: a rotation counts as tangent deviation. map: see
 * cairn_object_detect_rigid_proximity(). */
static void measure_shape(const object_detector *detector, cairn_object_detection *detection,
                          object_detect_similarity *map)
{
    const contour_search_fitted_outline fitted = {detector->fit.outline, detection->outline_count,
                                                  detection->origin, detection->size};
    const contour_search_reference reference = {model_outline(detector, detection), {1, 0}};
    cairn_contour_search_shape shape = cairn_contour_search_shape_of(
        detector->field->tokens, &fitted, detector->fit.outline_index, &reference,
        detector->segment_scratch, detector->sample_scratch);

    detection->edge_proximity = shape.edge_proximity;
    detection->tangent_deviation = shape.tangent_deviation;
    detection->deformation = shape.deformation;
    detection->rigid_proximity = cairn_object_detect_rigid_proximity(
        &fitted, reference.outline, detector->sample_scratch,
        detector->sample_scratch + detection->outline_count, map);
}

static cairn_real score_of(const object_detector *detector, const cairn_object_detection *detection)
{
    const object_detect_variant *plain = &detector->variants[0];
    double diagonal =
        hypot((double)detector->field->tokens->width, (double)detector->field->tokens->height);
    double aspect =
        (double)(detection->right - detection->left) * (double)(plain->bottom - plain->top) /
        ((double)(detection->bottom - detection->top) * (double)(plain->right - plain->left));

    if (detector->field->params.occluded)
        return OCCLUDED_PROXIMITY_WEIGHT * detection->rigid_proximity +
               OCCLUDED_GROUPING_WEIGHT * detection->grouped_evidence +
               (cairn_real)(OCCLUDED_SIZE_WEIGHT * log((double)detection->size / diagonal) -
                            OCCLUDED_SCORE_OFFSET);
    return detection->deformed_evidence + RIGID_EVIDENCE_WEIGHT * detection->rigid_evidence +
           detector->field->params.verify * detection->grouped_evidence +
           PROXIMITY_WEIGHT * detection->edge_proximity -
           TANGENT_WEIGHT * detection->tangent_deviation -
           DEFORMATION_WEIGHT * detection->deformation +
           (cairn_real)(SIZE_WEIGHT * log((double)detection->size / diagonal) -
                        ASPECT_WEIGHT * log(aspect) * log(aspect) - SCORE_OFFSET);
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

/* Adds the appearance term of the box (Adluru 2008, eq. 5.1, with 1 - probability as the distance
 * of appearance). */
static void add_appearance(const object_detector *detector, cairn_object_detection *detection)
{
    const cairn_real box[4] = {detection->left, detection->top, detection->right,
                               detection->bottom};

    detection->appearance = cairn_object_detect_appearance_of(detector->field, box).probability;
    detection->score -= detector->field->params.appearance_weight * (1 - detection->appearance);
}

/* Refines a candidate: deforms the outline to the edges, collects segments, computes the score.
 * Returns 0 when out of memory. */
static int refine_candidate(object_detector *detector, const object_detect_peak *peak,
                            cairn_object_detections *found)
{
    cairn_object_detection *detection = &found->found[found->count];
    const object_detect_variant *variant = &detector->variants[peak->variant];
    object_detect_similarity map;
    cairn_shape_model model = *detector->model;
    cairn_contour_grouping_object object;

    memset(&object, 0, sizeof object);
    object.origin.x = (cairn_real)peak->x;
    object.origin.y = (cairn_real)peak->y;
    object.size = (cairn_real)peak->size;
    object.turn = (cairn_real)peak->turn;
    model.outline = variant->outline;
    cairn_contour_search_field_fill(detector->window, detector->field->tokens, &object);
    if (!cairn_contour_search_fit_run(&detector->fit, detector->window, &model, &object))
        return 0;
    memset(detection, 0, sizeof *detection);
    detection->rigid_evidence = (cairn_real)peak->rigid;
    detection->deformed_evidence =
        detector->fit.evidence / detector->fit.length * (cairn_real)PIECE_LENGTH;
    detection->origin = object.origin;
    detection->size = object.size;
    detection->mirrored = variant->mirrored;
    append_outline(detector, found, detection);
    measure_shape(detector, detection, &map);
    if (detector->field->params.occluded && detection->rigid_proximity > 0) {
        cairn_object_detect_place_outline(&map, model_outline(detector, detection), &detector->fit,
                                          detection);
        found->outline_count -= detection->outline_count;
        append_outline(detector, found, detection);
    }
    if (!append_segments(detector, found, detection))
        return 0;
    detection->grouped_evidence =
        cairn_object_detect_grouped_evidence(&detector->groupings, detection);
    detection->score = score_of(detector, detection);
    if (peak->hypothesis >= 0)
        set_part_scores(&detector->hypotheses.list[peak->hypothesis], detection);
    found->count += detection->score >= detector->field->params.min_score;
    if (detector->field->params.appearance != NULL)
        add_appearance(detector, detection);
    return 1;
}

static int compare_detections(const void *a, const void *b)
{
    const cairn_object_detection *x = a, *y = b;

    if (x->score != y->score)
        return x->score < y->score ? 1 : -1;
    return x->first_outline != y->first_outline ? x->first_outline - y->first_outline
                                                : x->first_part - y->first_part;
}

static void suppress_non_maxima(const object_detector *detector, cairn_object_detections *found)
{
    int32_t kept = 0;

    if (found->count > 1)
        qsort(found->found, (size_t)found->count, sizeof *found->found, compare_detections);
    for (int32_t i = 0; i < found->count; i++) {
        const cairn_object_detection *detection = &found->found[i];
        int32_t is_separate = 1;

        for (int32_t k = 0; k < kept && is_separate; k++) {
            const cairn_object_detection *b = &found->found[k];

            is_separate =
                cairn_object_detect_overlap(
                    (float)detection->left, (float)detection->top, (float)detection->right,
                    (float)detection->bottom, (float)b->left, (float)b->top, (float)b->right,
                    (float)b->bottom) <= (float)detector->field->params.overlap &&
                (cairn_object_detect_is_as_written(detector->field) ||
                 contained_share(detection, b) <= MAX_CONTAINED_SHARE);
        }
        if (is_separate)
            found->found[kept++] = *detection;
    }
    found->count = kept;
}

static void move_parts(object_detector *detector, cairn_object_detections *found)
{
    found->parts = detector->hypotheses.parts;
    found->part_count = detector->hypotheses.part_count;
    found->bundle_count = detector->hypotheses.bundles;
    found->has_appearance = detector->field->params.appearance != NULL;
    detector->hypotheses.parts = NULL;
}

/* As written: every hypothesis is a detection; non-maximum suppression keeps the best. */
static cairn_status detect_as_written(object_detector *detector, cairn_object_detections *found)
{
    cairn_status status =
        cairn_object_detect_parts(&detector->hypotheses, detector->field, detector->model);

    if (status != CAIRN_OK)
        return status;
    move_parts(detector, found);
    cairn_object_detect_report_stage(detector->field, CAIRN_OBJECT_DETECT_BOXES);
    status = cairn_object_detect_written_add(found, &detector->hypotheses, detector->field);
    if (status != CAIRN_OK)
        return status;
    suppress_non_maxima(detector, found);
    return cairn_object_detect_written_outlines(found, detector->field, detector->model);
}

static cairn_status detect(object_detector *detector, cairn_object_detections *found)
{
    cairn_status status = CAIRN_OK;

    detector->window = cairn_contour_search_field_new();
    detector->segment_scratch =
        malloc(((size_t)detector->field->tokens->count + 1) * sizeof *detector->segment_scratch);
    detector->sample_scratch =
        malloc(2 * (size_t)detector->model->outline_count * sizeof *detector->sample_scratch);
    if (detector->window == NULL || detector->segment_scratch == NULL ||
        detector->sample_scratch == NULL ||
        !cairn_contour_search_fit_new(&detector->fit, detector->model->outline_count) ||
        !cairn_object_detect_variants_add(detector))
        return CAIRN_NO_MEMORY;
    cairn_object_detect_report_stage(detector->field, CAIRN_OBJECT_DETECT_VOTES);
    if (detector->field->params.method == CAIRN_OBJECT_DETECT_PARTS)
        status = cairn_object_detect_candidates_of_parts(detector);
    else if (!cairn_object_detect_candidates_find(detector))
        status = CAIRN_NO_MEMORY;
    else
        status = group_contours(detector);
    if (status != CAIRN_OK)
        return status;
    move_parts(detector, found);
    found->found = malloc(((size_t)detector->count + 1) * sizeof *found->found);
    found->outline = malloc(((size_t)detector->count + 1) * (size_t)detector->model->outline_count *
                            sizeof *found->outline);
    if (found->found == NULL || found->outline == NULL)
        return CAIRN_NO_MEMORY;
    cairn_object_detect_report_stage(detector->field,
                                     detector->field->params.method == CAIRN_OBJECT_DETECT_PARTS
                                         ? CAIRN_OBJECT_DETECT_BOXES
                                         : CAIRN_OBJECT_DETECT_SCORES);
    for (int32_t i = 0; i < detector->count; i++)
        if (!refine_candidate(detector, &detector->peaks[i], found))
            return CAIRN_NO_MEMORY;
    cairn_object_detect_report_stage(detector->field, CAIRN_OBJECT_DETECT_BOXES);
    suppress_non_maxima(detector, found);
    return CAIRN_OK;
}

/* Returns 1 when the box of the outline has a width and a height. */
static int has_area(const cairn_shape_model *model)
{
    cairn_box box = cairn_box_empty();

    for (int32_t i = 0; i < model->outline_count; i++)
        box = cairn_box_extend(box, model->outline[i].position);
    return box.max.x > box.min.x && box.max.y > box.min.y;
}

static cairn_status check_model(const cairn_shape_model *model, cairn_fault *fault)
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
    return status;
}

cairn_status cairn_object_detect(cairn_object_detections *detections,
                                 const cairn_object_detect_field *field,
                                 const cairn_shape_model *model, const char *path,
                                 cairn_file_error *error)
{
    object_detector detector = {.field = field, .model = model};
    cairn_fault fault = {0, NULL};
    cairn_status status = check_model(model, &fault);

    memset(detections, 0, sizeof *detections);
    if (status != CAIRN_OK)
        return cairn_file_error_set(error, status, path, 0, "%s", fault.message);
    status = cairn_object_detect_is_as_written(field) ? detect_as_written(&detector, detections)
                                                      : detect(&detector, detections);
    cairn_object_detect_parts_free(&detector.hypotheses);
    cairn_object_detect_group_free(&detector.groupings);
    free(detector.outlines);
    free(detector.peaks);
    free(detector.segment_scratch);
    free(detector.sample_scratch);
    cairn_contour_search_field_free(detector.window);
    cairn_contour_search_fit_free(&detector.fit);
    if (status == CAIRN_OK)
        return CAIRN_OK;
    cairn_object_detections_free(detections);
    if (status != CAIRN_NO_MEMORY && field->params.cuts != NULL)
        return cairn_file_error_set(error, status, path, 0,
                                    "%s, expected manually chosen fragments of its first outline",
                                    cairn_status_text(status));
    if (status != CAIRN_NO_MEMORY)
        return cairn_file_error_set(error, status, path, 0,
                                    "%s, expected an outline with length of 3 to 4096 samples",
                                    cairn_status_text(status));
    return cairn_file_error_system(error, path, "detect", ENOMEM);
}
