/* Detection of the instances of a model among the edges of an image.
 *
 * Method:
 * 1. Grouping runs for the model, and for its mirror image on request, in successive bands of
 *    sizes.
 * 2. Its objects, including those of low evidence, are candidates. Each is refined: the model's
 *    outline is deformed to the edges (contour_search_field.c, contour_search_fit.c), and the
 *    segments along it are the contour (contour_search_complete.c).
 * 3. A linear score decides which are reported: the evidence of the rigid and the deformed outline
 *    per object size of outline length, the shape quality of the deformed outline
 *    (contour_search_shape.c), and the matched share.
 * 4. Each sample of the model's skeleton takes its sides from the deformed outline. Where both are
 *    matched the disc is that of their symmetric point.
 * 5. Non-maximum suppression keeps the best of overlapping objects.
 *
 * Limits: a call exceeds its budget by at most one item, the segments of one chain near the
 * object. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/symmetric_point.h"
#include "src/base/step.h"
#include "src/containers/ranked_list.h"
#include "src/detection/contour_search_object.h"

/* Non-maximum suppression radius, share of the object's size. */
static const cairn_real NMS_RADIUS_SHARE = CAIRN_REAL(0.3);
/* Greatest distance of a contour segment from an outline sample, share of the size, but at least
 * MIN_DISTANCE_PX; and least cosine of the angle between them. */
static const cairn_real MAX_DISTANCE_SHARE = CAIRN_REAL(0.04), MIN_COSINE = CAIRN_REAL(0.7);
enum { MIN_DISTANCE_PX = 3 };
/* Weights of edge proximity, tangent deviation, squared deformation (contour_search_shape.c) and
 * matched share. In clutter evidence alone accepts distorted shapes. */
enum {
    PROXIMITY_WEIGHT = 20,
    TANGENT_WEIGHT = 100,
    DEFORMATION_WEIGHT = 4500,
    MATCHED_SHARE_WEIGHT = 60
};
/* Offset: the sum of these terms for an object whose evidence alone is at the threshold. */
enum { SCORE_OFFSET = 58 };
/* Mean length of segments where the tokens have none, px. */
static const cairn_real DEFAULT_LENGTH_PX = 5;
/* Work units between two observations of the filter. */
enum { UNITS_BETWEEN_OBSERVATIONS = 2000 };
/* Outline samples looked at, steps of a filter trace appended, and better objects that an object is
 * compared with, in a unit. */
enum { SAMPLES_PER_UNIT = 16, TRACED_PER_UNIT = 16, OBJECTS_PER_UNIT = 8 };

/* ---- Segments along the outline ---- */

int32_t cairn_contour_search_segment_at(const cairn_segment *lines, const int32_t *list,
                                        int32_t count, cairn_real size, cairn_oriented_point point)
{
    cairn_real nearest = cairn_max(MIN_DISTANCE_PX, MAX_DISTANCE_SHARE * size);
    int32_t found = -1;

    for (int32_t i = 0; i < count; i++) {
        cairn_segment line = lines[list[i]];
        cairn_real distance = cairn_contour_search_point_distance(line, point.position);

        if (distance < nearest &&
            cairn_abs(cairn_vec2_dot(cairn_vec2_unit(cairn_vec2_sub(line.b, line.a)),
                                     point.direction)) >= MIN_COSINE) {
            nearest = distance;
            found = list[i];
        }
    }
    return found;
}

/* ---- The grouping ---- */

/* The model that is searched: the given one or its mirror image. */
static const cairn_shape_model *current_model(const cairn_contour_search *search)
{
    return search->is_mirrored ? &search->mirrored : search->model;
}

static cairn_contour_grouping_input input_of(const cairn_contour_search *search)
{
    const cairn_contour_search_params *params = &search->params;
    const cairn_contour_search_tokens *tokens = &search->tokens;
    cairn_contour_grouping_input input = {
        .segments = tokens->lines,
        .count = tokens->count,
        .width = tokens->width,
        .height = tokens->height,
        .model = current_model(search),
        .min_size = params->min_size,
        .max_size = params->max_size,
        .min_turn = params->min_turn,
        .max_turn = params->max_turn,
        .mean_length = tokens->mean_length > 0 ? tokens->mean_length : DEFAULT_LENGTH_PX};

    if (search->bands > 1) {
        input.min_size = cairn_contour_search_band_bound(params->min_size, params->max_size,
                                                         search->bands, search->band);
        input.max_size = cairn_contour_search_band_bound(params->min_size, params->max_size,
                                                         search->bands, search->band + 1);
    }
    return input;
}

/* The cluster of a particle, by model position. */
static int32_t mode_of(cairn_contour_search *search, int32_t particle, int32_t mode_count)
{
    const cairn_contour_grouping_particle *p = &search->particles[particle];
    int32_t k = 0;

    while (k < mode_count) {
        const cairn_contour_grouping_particle *q = &search->particles[search->mode[k]];

        if (cairn_vec2_norm(cairn_vec2_sub(p->origin, q->origin)) <=
            NMS_RADIUS_SHARE * cairn_max(p->size, q->size))
            return k;
        k++;
    }
    search->mode[k] = particle;
    return k;
}

static const contour_search_observer observer_of_filter = {
    .units_between = UNITS_BETWEEN_OBSERVATIONS, .mode_of = mode_of};

/* Starts the grouping in the current band. */
static cairn_status begin_band(cairn_contour_search *search)
{
    cairn_contour_grouping_input input = input_of(search);

    cairn_contour_search_begin_observed(search, &observer_of_filter);
    return cairn_contour_grouping_begin(search->grouping, &input);
}

/* Appends the filter trace to those of earlier bands. */
static void append_trace(cairn_contour_search *search)
{
    cairn_contour_grouping_result found = cairn_contour_grouping_read(search->grouping);
    cairn_contour_search_result *result = &search->result;
    int32_t is_mirrored = search->is_mirrored;

    if (found.steps > 0)
        memcpy(&result->trace[is_mirrored][result->steps[is_mirrored]], found.trace,
               (size_t)found.steps * sizeof *found.trace);
    result->steps[is_mirrored] += found.steps;
    result->hypothesis_counts[is_mirrored] += found.hypothesis_count;
}

/* ---- Discs ---- */

/* Index of the model's outline sample nearest to a point of the model. */
static int32_t nearest_sample(const cairn_shape_model *model, cairn_vec2 point)
{
    cairn_real distance;

    return cairn_contour_search_nearest_sample(model->outline, model->outline_count, point,
                                               &distance);
}

/* Disc of a model sample: from the sides of the deformed outline, or the symmetric point of the
 * segments on both sides. */
static cairn_contour_search_disc disc_of(const cairn_contour_search *search,
                                         const cairn_contour_search_object *object,
                                         const cairn_shape_model *model, int32_t index)
{
    const cairn_contour_search_place *outline = &search->result.outline[object->first_outline];
    const cairn_shape_model_sample *sample = &model->samples[index];
    cairn_symmetric_point_params params = cairn_symmetric_point_default();
    cairn_contour_search_disc disc = {.side = {-1, -1}, .sample = index};
    cairn_vec2 side[2];
    cairn_symmetric_point sp;

    for (int32_t k = 0; k < 2; k++) {
        const cairn_contour_search_place *sample_place =
            &outline[nearest_sample(model, sample->contact[k].position)];

        disc.side[k] = sample_place->segment;
        side[k] = sample_place->point.position;
    }
    disc.centre = cairn_vec2_scale(cairn_vec2_add(side[0], side[1]), CAIRN_REAL(0.5));
    disc.radius = cairn_max(1, cairn_vec2_norm(cairn_vec2_sub(side[1], side[0])) / 2);
    params.max_radius = 2 * disc.radius;
    params.min_radius = disc.radius / 2;
    if (disc.side[0] >= 0 && disc.side[1] >= 0 && disc.side[0] != disc.side[1] &&
        cairn_symmetric_point_of_segments(&params, search->tokens.lines[disc.side[0]],
                                          search->tokens.lines[disc.side[1]], &sp) &&
        cairn_vec2_norm(cairn_vec2_sub(sp.centre, disc.centre)) <=
            MAX_DISTANCE_SHARE * object->found.size) {
        disc.centre = sp.centre;
        disc.radius = sp.radius;
    }
    return disc;
}

/* ---- Candidates ---- */

/* Computes the matched share of the outline, and the number of matched skeleton samples. */
static void count_matched(const cairn_contour_search_result *result,
                          cairn_contour_search_object *object, const cairn_shape_model *model)
{
    int32_t matched = 0;

    for (int32_t i = 0; i < model->outline_count; i++)
        matched += result->outline[object->first_outline + i].segment >= 0;
    object->found.score = (cairn_real)matched / (cairn_real)model->outline_count;
    object->found.matched_samples = 0;
    for (int32_t k = 0; k < model->sample_count; k++)
        object->found.matched_samples += result->discs[object->first_disc + k].side[0] >= 0 ||
                                         result->discs[object->first_disc + k].side[1] >= 0;
}

/* Positions on the deformed outline of the gaps in the model's drawing. */
static contour_search_gaps gaps_of(const contour_search_fit *fit, const cairn_shape_model *model)
{
    contour_search_gaps gaps = {.count = model->gap_count};

    for (int32_t i = 0; i < gaps.count; i++)
        gaps.at[i] = fit->outline[nearest_sample(model, model->gaps[i])].position;
    return gaps;
}

static cairn_real evidence_of(const cairn_contour_search_object *object)
{
    const cairn_contour_search_shape *shape = &object->shape;

    return object->deformed_evidence +
           CONTOUR_SEARCH_RIGID_EVIDENCE_WEIGHT * object->rigid_evidence +
           PROXIMITY_WEIGHT * shape->edge_proximity - TANGENT_WEIGHT * shape->tangent_deviation -
           DEFORMATION_WEIGHT * shape->deformation * shape->deformation +
           MATCHED_SHARE_WEIGHT * object->found.score - SCORE_OFFSET;
}

/* Starts to refine the candidate. */
static void begin_candidate(cairn_contour_search *search)
{
    cairn_contour_grouping_result found = cairn_contour_grouping_read(search->grouping);

    search->rigid_evidence = found.objects[search->candidate].evidence;
    search->object.found = found.objects[search->candidate];
    cairn_contour_search_refinement_begin(&search->refinement, &search->tokens,
                                          current_model(search), &search->object.found);
}

/* The fit is complete: starts to collect the segments, and to measure the shape. */
static void begin_collection(cairn_contour_search *search)
{
    const cairn_contour_search_result *result = &search->result;
    const cairn_shape_model *model = current_model(search);
    contour_search_refinement *refinement = &search->refinement;
    const contour_search_fit *fit = &refinement->fit;
    cairn_contour_search_object object = {.found = fit->object,
                                          .mirrored = search->is_mirrored,
                                          .first_disc = result->disc_count,
                                          .disc_count = model->sample_count,
                                          .first_outline = result->outline_count,
                                          .outline_count = model->outline_count};
    contour_search_fitted_outline fitted = {fit->outline, model->outline_count, object.found.origin,
                                            object.found.size};
    contour_search_gaps gaps = gaps_of(fit, model);
    contour_search_reference reference = {.outline = model->outline};

    object.found.first = result->segment_count;
    object.found.first_outline = 0;
    object.rigid_evidence = search->rigid_evidence / fit->length;
    object.deformed_evidence = fit->evidence / fit->length;
    search->object = object;
    cairn_sincos(object.found.turn, &reference.rotation.y, &reference.rotation.x);
    cairn_contour_search_collect_begin(&refinement->collector, &search->tokens, &fitted, &gaps);
    cairn_contour_search_measure_begin(&refinement->measure, &search->tokens, &fitted,
                                       fit->outline_index, &reference);
}

/* Copies a collected segment behind those of the objects that were kept. */
static void copy_segment(cairn_contour_search *search, int32_t index)
{
    search->result.segments[search->object.found.first + index] =
        search->refinement.collector.order[index].segment;
}

/* Copies an outline sample, with its segment. */
static void copy_sample(cairn_contour_search *search, int32_t index)
{
    const cairn_contour_grouping_object *object = &search->object.found;
    cairn_contour_search_place *place =
        &search->result.outline[search->object.first_outline + index];

    place->point = search->refinement.fit.outline[index];
    place->segment = cairn_contour_search_segment_at(search->tokens.lines,
                                                     &search->result.segments[object->first],
                                                     object->count, object->size, place->point);
    place->outline_index = search->refinement.fit.outline_index[index];
}

/* Scores the candidate, and keeps it unless it is below the thresholds. */
static void score_candidate(cairn_contour_search *search)
{
    cairn_contour_search_result *result = &search->result;
    cairn_contour_search_object *object = &search->object;

    object->shape = search->refinement.measure.shape;
    count_matched(result, object, current_model(search));
    object->found.evidence = evidence_of(object);
    result->best_score = cairn_max(result->best_score, object->found.score);
    result->best_evidence = cairn_max(result->best_evidence, object->found.evidence);
    if (object->found.evidence < search->params.min_evidence ||
        object->found.score < search->params.min_score)
        return;
    result->segment_count += object->found.count;
    result->outline_count += object->outline_count;
    result->disc_count += object->disc_count;
    result->objects[result->object_count++] = *object;
}

/* Refines and scores a candidate of the grouping. */
static int refine_candidate(cairn_contour_search *search, cairn_budget *budget)
{
    const cairn_shape_model *model = current_model(search);
    cairn_contour_search_object *object = &search->object;

    CAIRN_STEP_BEGIN(search->candidate_resume);
    begin_candidate(search);
    CAIRN_STEP_UNTIL(search->candidate_resume,
                     cairn_contour_search_refinement_step(&search->refinement, budget));
    begin_collection(search);
    CAIRN_STEP_UNTIL(search->candidate_resume,
                     cairn_contour_search_collect_step(&search->refinement.collector, budget));
    CAIRN_STEP_UNTIL(search->candidate_resume,
                     cairn_contour_search_measure_step(&search->refinement.measure, budget));
    object->found.count = search->refinement.collector.count;
    for (search->cursor = 0; search->cursor < object->found.count; search->cursor++) {
        CAIRN_STEP_CHARGE_EVERY(search, candidate_resume, budget, CONTOUR_SEARCH_LINES_PER_UNIT,
                                search->cursor);
        copy_segment(search, search->cursor);
    }
    for (search->cursor = 0; search->cursor < object->outline_count; search->cursor++) {
        CAIRN_STEP_CHARGE(search, candidate_resume, budget,
                          1 + object->found.count / CONTOUR_SEARCH_LINES_PER_UNIT);
        copy_sample(search, search->cursor);
    }
    for (search->cursor = 0; search->cursor < object->disc_count; search->cursor++) {
        CAIRN_STEP_CHARGE(search, candidate_resume, budget,
                          4 + 2 * model->outline_count / SAMPLES_PER_UNIT);
        search->result.discs[object->first_disc + search->cursor] =
            disc_of(search, object, model, search->cursor);
    }
    CAIRN_STEP_CHARGE(search, candidate_resume, budget,
                      1 + (object->outline_count + object->disc_count) / SAMPLES_PER_UNIT);
    score_candidate(search);
    CAIRN_STEP_END(search->candidate_resume);
}

/* ---- Non-maximum suppression ---- */

static int32_t compare_objects(const void *first, const void *second)
{
    const cairn_contour_search_object *a = first, *b = second;

    if (a->found.evidence != b->found.evidence)
        return a->found.evidence < b->found.evidence ? 1 : -1;
    return a->mirrored != b->mirrored ? a->mirrored - b->mirrored : a->first_disc - b->first_disc;
}

/* 1 when two objects are too close to each other. */
static int are_close(const void *context, const void *first, const void *second)
{
    const cairn_contour_search_object *a = first, *b = second;

    (void)context;
    return cairn_vec2_norm(cairn_vec2_sub(a->found.origin, b->found.origin)) <=
           NMS_RADIUS_SHARE * cairn_max(a->found.size, b->found.size);
}

/* Keeps an object unless it is too close to a better one that was kept. */
static void keep_if_separate(cairn_contour_search *search, int32_t index)
{
    const ranked_list kept = {.entries = search->result.objects,
                              .count = &search->kept,
                              .entry_bytes = sizeof *search->result.objects,
                              .is_near = are_close};

    ranked_list_keep(&kept, index);
}

int cairn_contour_search_completed(const cairn_contour_search_result *result,
                                   const cairn_contour_search_object *object, int32_t from,
                                   int32_t *first, int32_t *count)
{
    const cairn_contour_search_place *outline = &result->outline[object->first_outline];
    int32_t i = from;

    while (i < object->outline_count && outline[i].segment >= 0)
        i++;
    *first = i;
    while (i < object->outline_count && outline[i].segment < 0 &&
           outline[i].outline_index == outline[*first].outline_index)
        i++;
    *count = i - *first;
    return *count > 0;
}

/* ---- The steps ---- */

static void clear_result(cairn_contour_search *search)
{
    cairn_contour_search_result *result = &search->result;

    for (int32_t k = 0; k < 2; k++)
        result->steps[k] = result->hypothesis_counts[k] = 0;
    for (int32_t k = 0; k < 2; k++)
        if (result->mode_counts[k] != NULL)
            memset(result->mode_counts[k], 0,
                   cairn_contour_search_step_capacity(&search->params) *
                       sizeof *result->mode_counts[k]);
    result->object_count = result->segment_count = result->disc_count = result->outline_count = 0;
    result->best_score = result->best_evidence = 0;
    result->mode = search->params.grouping.mode >= CAIRN_MODE_AS_WRITTEN ? CAIRN_MODE_AS_WRITTEN
                                                                         : CAIRN_MODE_DEFAULT;
    result->point_count = result->points_dropped = result->candidates_dropped = 0;
    result->end_reason = 0;
}

cairn_status cairn_contour_search_begin(cairn_contour_search *search,
                                        const cairn_contour_search_tokens *tokens,
                                        const cairn_shape_model *model, cairn_fault *fault)
{
    cairn_contour_search before;
    cairn_status status;
    int32_t is_written;

    if (search == NULL || model == NULL)
        return cairn_refuse(fault, -1, "no search or no model, expected both", CAIRN_BAD_ARGUMENT);
    status = cairn_contour_search_tokens_check(tokens, search->params.max_segments, fault);
    if (status == CAIRN_OK)
        status = cairn_shape_model_check(model, fault);
    if (status != CAIRN_OK)
        return status;
    before = *search;
    is_written = search->params.grouping.mode >= CAIRN_MODE_AS_WRITTEN;
    search->tokens = *tokens;
    search->model = model;
    search->is_mirrored = 0;
    search->band = 0;
    search->bands = is_written ? 1
                               : cairn_contour_search_band_count(search->params.min_size,
                                                                 search->params.max_size);
    status = is_written ? cairn_contour_search_written_begin(search) : begin_band(search);
    if (status != CAIRN_OK) {
        *search = before;
        return cairn_refuse(fault, -1,
                            "an image or a model beyond the capacities, or a range of sizes or "
                            "rotations, expected those of contour_grouping.h",
                            status);
    }
    clear_result(search);
    search->status = CAIRN_OK;
    search->resume = search->candidate_resume = search->units_charged = 0;
    search->is_pending = 1;
    search->is_complete = 0;
    return CAIRN_OK;
}

/* 1 unless this is the last band of the last image. */
static int has_next_band(const cairn_contour_search *search)
{
    return search->band + 1 < search->bands || (search->params.mirror && !search->is_mirrored);
}

/* Starts the grouping in the next band, after the last one in the first band for the mirror image;
 * sets search->status. */
static void begin_next_band(cairn_contour_search *search)
{
    search->band++;
    if (search->band == search->bands) {
        cairn_shape_model_mirror(search->model, search->mirrored_samples, search->mirrored_outline,
                                 &search->mirrored);
        search->is_mirrored = 1;
        search->band = 0;
    }
    search->status = begin_band(search);
}

/* The search in the default mode: see Method in the head of this file. */
static int find_objects(cairn_contour_search *search, cairn_budget *budget)
{
    cairn_contour_search_result *result = &search->result;

    CAIRN_STEP_BEGIN(search->resume);
    for (;;) {
        CAIRN_STEP_UNTIL(search->resume, search->status == CAIRN_OK);
        CAIRN_STEP_UNTIL(search->resume,
                         cairn_contour_search_step_observed(search, budget, &observer_of_filter,
                                                            current_model(search)->sample_count));
        CAIRN_STEP_CHARGE(search, resume, budget,
                          1 + cairn_contour_grouping_read(search->grouping).steps /
                                  TRACED_PER_UNIT);
        append_trace(search);
        for (search->candidate = 0;
             search->candidate < cairn_contour_grouping_read(search->grouping).object_count;
             search->candidate++)
            CAIRN_STEP_RUN(search, resume, budget, refine_candidate);
        if (!has_next_band(search))
            break;
        CAIRN_STEP_CHARGE(search, resume, budget, contour_search_band_units(search->model));
        begin_next_band(search);
    }
    cairn_detection_sort_begin(&search->sort, result->objects, result->object_count,
                               sizeof *result->objects, compare_objects);
    CAIRN_STEP_UNTIL(search->resume, cairn_detection_sort_step(&search->sort, budget));
    search->kept = 0;
    for (search->cursor = 0; search->cursor < result->object_count; search->cursor++) {
        CAIRN_STEP_CHARGE(search, resume, budget, 1 + search->kept / OBJECTS_PER_UNIT);
        keep_if_separate(search, search->cursor);
    }
    result->object_count = search->kept;
    CAIRN_STEP_END(search->resume);
}

cairn_status cairn_contour_search_step(cairn_contour_search *search, cairn_budget *budget)
{
    int is_done;

    if (search == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!search->is_pending)
        return CAIRN_OK;
    is_done = search->params.grouping.mode >= CAIRN_MODE_AS_WRITTEN
                  ? cairn_contour_search_written_step(search, budget)
                  : find_objects(search, budget);
    if (!is_done && search->status >= CAIRN_OK)
        return CAIRN_MORE;
    search->is_pending = 0;
    search->is_complete = is_done;
    return search->status;
}

cairn_contour_search_result cairn_contour_search_read(const cairn_contour_search *search)
{
    cairn_contour_search_result none;

    memset(&none, 0, sizeof none);
    return search->is_complete ? search->result : none;
}
