/* Detection of the instances of a model among the edges of an image.
 *
 * Method:
 * 1. Grouping runs for the model, and for its mirror image on request, in successive bands of
 *    sizes.
 * 2. Its objects, including those of low evidence, are candidates. Each is refined: the model's
 *    outline is deformed to the edges (contour_search_fit.c), and the segments along it are the
 *    contour (contour_search_complete.c).
 * 3. A linear score decides which are reported: the evidence of the rigid and the deformed outline
 *    per object size of outline length, the shape quality of the deformed outline
 *    (contour_search_shape.c), and the matched share.
 * 4. Each sample of the model's skeleton takes its sides from the deformed outline. Where both are
 *    matched the disc is that of their symmetric point.
 * 5. Non-maximum suppression keeps the best of overlapping objects. */
#include "src/base/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/shape_model_file.h"
#include "cairn/symmetric_point.h"
#include "src/host/detection/contour_search_fit.h"

/* Non-maximum suppression radius, share of the object's size. */
#define NMS_RADIUS_SHARE 0.3
/* Greatest distance of a contour segment from an outline sample, share of the size, but at least
 * MIN_DISTANCE_PX; and least cosine of the angle between them. */
#define MAX_DISTANCE_SHARE 0.04
#define MIN_DISTANCE_PX    3
#define MIN_COSINE         0.7
#define MIN_TOKENS         64
/* Weight of the rigid outline's evidence; that of the deformed outline has weight 1. */
#define RIGID_EVIDENCE_WEIGHT 2
/* Weights of edge proximity, tangent deviation, squared deformation (contour_search_shape.c) and
 * matched share. In clutter evidence alone accepts distorted shapes. */
#define PROXIMITY_WEIGHT     20
#define TANGENT_WEIGHT       100
#define DEFORMATION_WEIGHT   4500
#define MATCHED_SHARE_WEIGHT 60
/* Offset: the sum of these terms for an object whose evidence alone is at the threshold. */
#define SCORE_OFFSET 58
/* Greatest ratio of sizes within one band, because a search keeps only the best size at one
 * position. */
#define BAND_FACTOR 2.2
/* Least evidence and score of a reported object; least evidence and greatest number of
 * candidates. */
#define MIN_EVIDENCE           34
#define MIN_SCORE              CAIRN_REAL(0.3)
#define MIN_CANDIDATE_EVIDENCE 2
enum { MAX_CANDIDATES = 12 };

/* Work units between callbacks. */
enum { UNITS_PER_CALLBACK = 2000 };

typedef struct contour_searcher {
    cairn_contour_search_result *result;
    const cairn_contour_search_tokens *tokens;
    const cairn_contour_search_params *params;
    contour_search_field *field;
    contour_search_fit fit;
    int32_t *scratch; /* [tokens->count] scratch for the current object */
} contour_searcher;

cairn_contour_search_params cairn_contour_search_default(int32_t width, int32_t height)
{
    cairn_real diagonal = (cairn_real)hypot((double)width, (double)height);
    cairn_contour_search_params params = {
        .grouping = cairn_contour_grouping_default(),
        .min_evidence = MIN_EVIDENCE,
        .min_score = MIN_SCORE,
        .min_size = cairn_max(24, diagonal / 10),
        .max_size = cairn_max(24, diagonal),
        .min_turn = -15 * (CAIRN_PI / 180),
        .max_turn = 15 * (CAIRN_PI / 180),
        .mirror = 1,
    };

    /* A low threshold for the rigid outline: deformation may raise the evidence. */
    params.grouping.min_evidence = MIN_CANDIDATE_EVIDENCE;
    params.grouping.min_score = 0;
    params.grouping.max_objects = MAX_CANDIDATES;
    return params;
}

void cairn_contour_search_result_free(cairn_contour_search_result *result)
{
    free(result->objects);
    free(result->segments);
    free(result->discs);
    free(result->outline);
    free(result->trace[0]);
    free(result->trace[1]);
    free(result->mode_counts[0]);
    free(result->mode_counts[1]);
    memset(result, 0, sizeof *result);
}

/* ---- Discs ---- */

cairn_vec2 cairn_contour_search_transform_vector(const cairn_contour_grouping_object *object,
                                                 cairn_vec2 model_vector)
{
    cairn_real c = object->size * (cairn_real)cos((double)object->turn),
               s = object->size * (cairn_real)sin((double)object->turn);
    cairn_vec2 p = {c * model_vector.x - s * model_vector.y,
                    s * model_vector.x + c * model_vector.y};

    return p;
}

cairn_real cairn_contour_search_point_distance(cairn_segment line, cairn_vec2 p)
{
    cairn_vec2 along = cairn_vec2_sub(line.b, line.a), to = cairn_vec2_sub(p, line.a);
    cairn_real share =
        cairn_vec2_dot(along, to) / cairn_max(cairn_vec2_norm_squared(along), CAIRN_REAL(1e-6));

    share = cairn_max(0, cairn_min(share, 1));
    return cairn_vec2_norm(cairn_vec2_sub(to, cairn_vec2_scale(along, share)));
}

/* The object's segment nearest to a point and its direction; -1: none. */
static int32_t segment_at(const contour_searcher *searcher,
                          const cairn_contour_grouping_object *object, cairn_oriented_point point)
{
    cairn_real nearest = cairn_max(MIN_DISTANCE_PX, (cairn_real)MAX_DISTANCE_SHARE * object->size);
    int32_t found = -1;

    for (int32_t i = 0; i < object->count; i++) {
        int32_t index = searcher->result->segments[object->first + i];
        cairn_segment line = searcher->tokens->lines[index];
        cairn_real distance = cairn_contour_search_point_distance(line, point.position);

        if (distance < nearest &&
            cairn_abs(cairn_vec2_dot(cairn_vec2_unit(cairn_vec2_sub(line.b, line.a)),
                                     point.direction)) >= (cairn_real)MIN_COSINE) {
            nearest = distance;
            found = index;
        }
    }
    return found;
}

/* Index of the model's outline sample nearest to a point of the model. */
static int32_t nearest_sample(const cairn_shape_model *model, cairn_vec2 point)
{
    cairn_real smallest = CAIRN_REAL_MAX;
    int32_t nearest = 0;

    for (int32_t i = 0; i < model->outline_count; i++) {
        cairn_real squared =
            cairn_vec2_norm_squared(cairn_vec2_sub(model->outline[i].position, point));

        if (squared < smallest) {
            smallest = squared;
            nearest = i;
        }
    }
    return nearest;
}

/* Disc of a model sample: from the sides of the deformed outline, or the symmetric point of the
 * segments on both sides. */
static cairn_contour_search_disc disc_of(const contour_searcher *searcher,
                                         const cairn_contour_search_object *object,
                                         const cairn_shape_model *model, int32_t index)
{
    const cairn_contour_search_place *outline = &searcher->result->outline[object->first_outline];
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
        cairn_symmetric_point_of_segments(&params, searcher->tokens->lines[disc.side[0]],
                                          searcher->tokens->lines[disc.side[1]], &sp) &&
        cairn_vec2_norm(cairn_vec2_sub(sp.centre, disc.centre)) <=
            (cairn_real)MAX_DISTANCE_SHARE * object->found.size) {
        disc.centre = sp.centre;
        disc.radius = sp.radius;
    }
    return disc;
}

/* ---- Objects ---- */

/* Grows an array by `count` items; 0: out of memory. */
static int reserve(void **array, int32_t length, int32_t count, size_t size)
{
    void *grown = realloc(*array, ((size_t)length + (size_t)count + 1) * size);

    if (grown != NULL)
        *array = grown;
    return grown != NULL;
}

static int reserve_object(cairn_contour_search_result *result, int32_t segments,
                          const cairn_shape_model *model)
{
    void *array[] = {result->objects, result->segments, result->outline, result->discs};
    int ok =
        reserve(&array[0], result->object_count, 1, sizeof *result->objects) &&
        reserve(&array[1], result->segment_count, segments, sizeof *result->segments) &&
        reserve(&array[2], result->outline_count, model->outline_count, sizeof *result->outline) &&
        reserve(&array[3], result->disc_count, model->sample_count, sizeof *result->discs);

    result->objects = array[0];
    result->segments = array[1];
    result->outline = array[2];
    result->discs = array[3];
    return ok;
}

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

static cairn_contour_search_shape shape_of(const contour_searcher *searcher,
                                           const contour_search_fitted_outline *fitted,
                                           cairn_real turn, const cairn_shape_model *model)
{
    const contour_search_reference reference = {
        model->outline, {(cairn_real)cos((double)turn), (cairn_real)sin((double)turn)}};

    return cairn_contour_search_shape_of(searcher->tokens, fitted, searcher->fit.outline_index,
                                         &reference, searcher->scratch, NULL);
}

static cairn_real evidence_of(const cairn_contour_search_object *object)
{
    const cairn_contour_search_shape *shape = &object->shape;

    return object->deformed_evidence + RIGID_EVIDENCE_WEIGHT * object->rigid_evidence +
           PROXIMITY_WEIGHT * shape->edge_proximity - TANGENT_WEIGHT * shape->tangent_deviation -
           DEFORMATION_WEIGHT * shape->deformation * shape->deformation +
           MATCHED_SHARE_WEIGHT * object->found.score - SCORE_OFFSET;
}

/* Deforms the model to the edges around an object of the grouping, and collects the segments along
 * it. Objects below the thresholds are not added. Returns 0 when out of memory. */
static int add_object(contour_searcher *searcher, const cairn_contour_grouping_result *found,
                      int32_t index, const cairn_shape_model *model, int32_t mirrored)
{
    cairn_contour_search_result *result = searcher->result;
    cairn_contour_search_object object = {.found = found->objects[index],
                                          .mirrored = mirrored,
                                          .first_disc = result->disc_count,
                                          .disc_count = model->sample_count,
                                          .first_outline = result->outline_count,
                                          .outline_count = model->outline_count};
    contour_search_fitted_outline fitted = {searcher->fit.outline, model->outline_count, {0, 0}, 0};
    contour_search_gaps gaps;

    cairn_contour_search_field_fill(searcher->field, searcher->tokens, &object.found);
    if (!cairn_contour_search_fit_run(&searcher->fit, searcher->field, model, &object.found))
        return 0;
    if (!reserve_object(result, searcher->tokens->count, model))
        return 0;
    object.found.first = result->segment_count;
    object.found.first_outline = 0;
    fitted.origin = object.found.origin;
    fitted.size = object.found.size;
    gaps = gaps_of(&searcher->fit, model);
    if (!cairn_contour_search_collect_with_gaps(searcher->tokens, &fitted, &gaps,
                                                &result->segments[object.found.first],
                                                &object.found.count))
        return 0;
    object.rigid_evidence = found->objects[index].evidence / searcher->fit.length;
    object.deformed_evidence = searcher->fit.evidence / searcher->fit.length;
    object.shape = shape_of(searcher, &fitted, object.found.turn, model);
    for (int32_t i = 0; i < model->outline_count; i++) {
        result->outline[object.first_outline + i].point = searcher->fit.outline[i];
        result->outline[object.first_outline + i].segment =
            segment_at(searcher, &object.found, searcher->fit.outline[i]);
        result->outline[object.first_outline + i].outline_index = searcher->fit.outline_index[i];
    }
    for (int32_t k = 0; k < model->sample_count; k++)
        result->discs[object.first_disc + k] = disc_of(searcher, &object, model, k);
    count_matched(result, &object, model);
    object.found.evidence = evidence_of(&object);
    result->best_score = cairn_max(result->best_score, object.found.score);
    result->best_evidence = cairn_max(result->best_evidence, object.found.evidence);
    if (object.found.evidence < searcher->params->min_evidence ||
        object.found.score < searcher->params->min_score)
        return 1;
    result->segment_count += object.found.count;
    result->outline_count += model->outline_count;
    result->disc_count += model->sample_count;
    result->objects[result->object_count++] = object;
    return 1;
}

static int compare_objects(const void *a, const void *b)
{
    const cairn_contour_search_object *x = a, *y = b;

    if (x->found.evidence != y->found.evidence)
        return x->found.evidence < y->found.evidence ? 1 : -1;
    return x->mirrored != y->mirrored ? x->mirrored - y->mirrored : x->first_disc - y->first_disc;
}

/* Sorts objects by descending evidence and removes those too close to better ones. */
static void suppress_non_maxima(cairn_contour_search_result *result)
{
    int32_t kept = 0;

    if (result->object_count > 1)
        qsort(result->objects, (size_t)result->object_count, sizeof *result->objects,
              compare_objects);
    for (int32_t i = 0; i < result->object_count; i++) {
        const cairn_contour_grouping_object *object = &result->objects[i].found;
        int32_t is_separate = 1;

        for (int32_t k = 0; k < kept && is_separate; k++) {
            const cairn_contour_grouping_object *better = &result->objects[k].found;
            cairn_real radius =
                (cairn_real)NMS_RADIUS_SHARE * cairn_max(object->size, better->size);

            is_separate = cairn_vec2_norm(cairn_vec2_sub(object->origin, better->origin)) > radius;
        }
        if (is_separate)
            result->objects[kept++] = result->objects[i];
    }
    result->object_count = kept;
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

/* ---- The search ---- */

/* Number of clusters of particles by model position. */
static int32_t count_modes(const cairn_contour_grouping_particle *particles, int32_t count,
                           int32_t *mode)
{
    int32_t modes = 0;

    for (int32_t i = 0; i < count; i++) {
        const cairn_contour_grouping_particle *p = &particles[i];
        int32_t k = 0;

        while (k < modes) {
            const cairn_contour_grouping_particle *q = &particles[mode[k]];

            if (cairn_vec2_norm(cairn_vec2_sub(p->origin, q->origin)) <=
                (cairn_real)NMS_RADIUS_SHARE * cairn_max(p->size, q->size))
                break;
            k++;
        }
        if (k == modes)
            mode[modes++] = i;
    }
    return modes;
}

/* Buffers for observing the filter. */
typedef struct filter_observer {
    cairn_contour_grouping_particle *particles; /* [capacity] */
    int32_t *mode;                              /* [capacity] */
    int32_t capacity, last_step;                /* particles; last observed step */
} filter_observer;

static void observe(const contour_searcher *searcher, const cairn_contour_grouping *grouping,
                    int32_t mirrored, int32_t most_steps, filter_observer *observer)
{
    int32_t steps, count = cairn_contour_grouping_particles(grouping, NULL, 0, &steps);

    if (steps == observer->last_step || steps > most_steps)
        return;
    observer->last_step = steps;
    (void)cairn_contour_grouping_particles(grouping, observer->particles, observer->capacity, NULL);
    count = count < observer->capacity ? count : observer->capacity;
    searcher->result->mode_counts[mirrored][searcher->result->steps[mirrored] + steps - 1] =
        count_modes(observer->particles, count, observer->mode);
    if (searcher->params->on_step != NULL)
        searcher->params->on_step(searcher->params->context, observer->particles, count, mirrored);
}

static cairn_status run_grouping(const contour_searcher *searcher, cairn_contour_grouping *grouping,
                                 int32_t mirrored, int32_t samples, int32_t particles)
{
    filter_observer observer = {malloc((size_t)particles * sizeof *observer.particles),
                                malloc((size_t)particles * sizeof *observer.mode), particles, 0};
    void *modes = searcher->result->mode_counts[mirrored];
    cairn_status status =
        observer.particles != NULL && observer.mode != NULL &&
                reserve(&modes, searcher->result->steps[mirrored], samples, sizeof(int32_t))
            ? CAIRN_MORE
            : CAIRN_NO_MEMORY;

    searcher->result->mode_counts[mirrored] = modes;
    if (status == CAIRN_MORE)
        memset(&searcher->result->mode_counts[mirrored][searcher->result->steps[mirrored]], 0,
               (size_t)samples * sizeof(int32_t));
    while (status == CAIRN_MORE) {
        cairn_budget budget = {UNITS_PER_CALLBACK};

        status = cairn_contour_grouping_step(grouping, &budget);
        if (status >= 0)
            observe(searcher, grouping, mirrored, samples, &observer);
    }
    free(observer.particles);
    free(observer.mode);
    return status;
}

/* Appends the filter trace to those of earlier bands, and adds the objects. */
static int append_result(contour_searcher *searcher, const cairn_contour_grouping *grouping,
                         const cairn_shape_model *model, int32_t mirrored)
{
    cairn_contour_grouping_result found = cairn_contour_grouping_read(grouping);
    cairn_contour_search_result *result = searcher->result;
    void *trace = result->trace[mirrored];

    if (!reserve(&trace, result->steps[mirrored], found.steps, sizeof *found.trace))
        return 0;
    result->trace[mirrored] = trace;
    if (found.steps > 0)
        memcpy(&result->trace[mirrored][result->steps[mirrored]], found.trace,
               (size_t)found.steps * sizeof *found.trace);
    result->steps[mirrored] += found.steps;
    result->hypothesis_counts[mirrored] += found.hypothesis_count;
    for (int32_t i = 0; i < found.object_count; i++)
        if (!add_object(searcher, &found, i, model, mirrored))
            return 0;
    return 1;
}

/* Searches the model in successive bands of sizes. */
static cairn_status search_bands(contour_searcher *searcher, const cairn_shape_model *model,
                                 int32_t mirrored, cairn_pool *pool,
                                 const cairn_contour_grouping_params *params)
{
    const cairn_contour_search_params *p = searcher->params;
    cairn_contour_grouping_input input = {
        .segments = searcher->tokens->lines,
        .count = searcher->tokens->count,
        .width = searcher->tokens->width,
        .height = searcher->tokens->height,
        .model = model,
        .min_size = p->min_size,
        .max_size = p->max_size,
        .min_turn = p->min_turn,
        .max_turn = p->max_turn,
        .mean_length = searcher->tokens->mean_length > 0 ? searcher->tokens->mean_length : 5};
    double range =
        p->min_size > 0 && p->max_size > p->min_size ? log((double)(p->max_size / p->min_size)) : 0;
    int32_t bands = 1 + (int32_t)(range / log(BAND_FACTOR));
    cairn_contour_grouping *grouping;
    cairn_status status = cairn_contour_grouping_create(&grouping, pool, params);

    for (int32_t k = 0; k < bands && status == CAIRN_OK; k++) {
        if (bands > 1) {
            input.min_size = p->min_size * (cairn_real)exp(range * k / bands);
            input.max_size = p->min_size * (cairn_real)exp(range * (k + 1) / bands);
        }
        status = cairn_contour_grouping_begin(grouping, &input);
        if (status == CAIRN_OK)
            status =
                run_grouping(searcher, grouping, mirrored, model->sample_count, params->particles);
        if (status == CAIRN_OK && !append_result(searcher, grouping, model, mirrored))
            status = CAIRN_NO_MEMORY;
    }
    return status;
}

/* Number of tokens of all segments, clamped. */
static int32_t count_tokens(const cairn_contour_search_tokens *tokens, cairn_real token)
{
    double count = 0;

    for (int32_t i = 0; i < tokens->count; i++)
        count += ceil((double)cairn_segment_length(tokens->lines[i]) / (double)token);
    return count < MIN_TOKENS                        ? MIN_TOKENS
           : count > CAIRN_CONTOUR_SEARCH_MAX_TOKENS ? CAIRN_CONTOUR_SEARCH_MAX_TOKENS
                                                     : (int32_t)count;
}

static cairn_status search_both(contour_searcher *searcher, const cairn_shape_model *model,
                                cairn_pool *pool, const cairn_contour_grouping_params *params)
{
    cairn_shape_model_file mirrored;
    cairn_mark mark;
    cairn_status status = cairn_pool_mark(pool, &mark);

    if (status == CAIRN_OK)
        status = search_bands(searcher, model, 0, pool, params);
    if (status != CAIRN_OK || !searcher->params->mirror)
        return status;
    status = cairn_pool_release(pool, mark);
    if (status == CAIRN_OK)
        status = cairn_shape_model_file_copy(&mirrored, model);
    if (status != CAIRN_OK)
        return status;
    cairn_shape_model_file_mirror(&mirrored);
    status = search_bands(searcher, &mirrored.model, 1, pool, params);
    cairn_shape_model_file_free(&mirrored);
    return status;
}

cairn_status cairn_contour_search_run(cairn_contour_search_result *result,
                                      const cairn_contour_search_tokens *tokens,
                                      const cairn_shape_model *model,
                                      const cairn_contour_search_params *params, const char *path,
                                      cairn_file_error *error)
{
    contour_searcher searcher = {.result = result, .tokens = tokens, .params = params};
    cairn_contour_grouping_params grouping = params->grouping;
    cairn_status status;
    cairn_pool pool;
    void *memory;

    if (grouping.mode == CAIRN_MODE_AS_WRITTEN)
        return cairn_contour_search_written(result, tokens, model, params, path, error);
    memset(result, 0, sizeof *result);
    grouping.max_width = tokens->width;
    grouping.max_height = tokens->height;
    grouping.max_tokens =
        grouping.token_length > 0 ? count_tokens(tokens, grouping.token_length) : 1;
    grouping.max_samples = model->sample_count;
    grouping.max_outline = model->outline_count;
    result->pool_bytes = cairn_contour_grouping_memory(&grouping) + CAIRN_ALIGN;
    memory = malloc(result->pool_bytes);
    searcher.field = cairn_contour_search_field_new();
    searcher.scratch = malloc(((size_t)tokens->count + 1) * sizeof *searcher.scratch);
    if (memory == NULL || searcher.field == NULL || searcher.scratch == NULL ||
        !cairn_contour_search_fit_new(&searcher.fit, model->outline_count)) {
        free(memory);
        free(searcher.scratch);
        cairn_contour_search_field_free(searcher.field);
        return cairn_file_error_system(error, path, "search", ENOMEM);
    }
    status = cairn_pool_init(&pool, memory, result->pool_bytes);
    if (status == CAIRN_OK)
        status = search_both(&searcher, model, &pool, &grouping);
    free(memory);
    free(searcher.scratch);
    cairn_contour_search_field_free(searcher.field);
    cairn_contour_search_fit_free(&searcher.fit);
    if (status != CAIRN_OK) {
        cairn_contour_search_result_free(result);
        return cairn_file_error_set(error, status, path, 0,
                                    "%s, expected a model, sizes above 0 and rotations in range",
                                    cairn_status_text(status));
    }
    suppress_non_maxima(result);
    return CAIRN_OK;
}
