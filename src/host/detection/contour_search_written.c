/* The search in the mode as written: one run of contour_grouping at one size. The segments of its
 * trajectories are the contours, and their symmetric points the skeletons. No outline is fitted or
 * deformed. */
#include "src/base/build.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/detection/contour_search_work.h"

/* Capacity for symmetric points per segment, and in all; least token capacity. */
enum { POINTS_PER_SEGMENT = 640, MAX_POINTS = 1 << 21, MIN_TOKENS = 64 };
/* Greatest number of segments of a search. */
enum { MAX_TOKENS = 1 << 20 };
/* Work units between observations. A filter step costs more than 50 units, also that of a single
 * particle, so that two steps never fall between two observations. */
enum { UNITS_PER_CALLBACK = 25 };

cairn_contour_search_params cairn_contour_search_as_written(int32_t width, int32_t height)
{
    cairn_contour_search_params params = cairn_contour_search_default(width, height);

    params.grouping = cairn_contour_grouping_as_written();
    params.min_evidence = params.min_score = 0;
    params.min_turn = params.max_turn = 0;
    params.mirror = 0;
    return params;
}

const char *cairn_contour_search_end_text(int32_t end)
{
    static const char *const text[] = {"no start", "posterior", "no follower", "steps",
                                       "histories"};

    return end >= 0 && end < (int32_t)(sizeof text / sizeof *text) ? text[end] : "";
}

/* State of a run. */
typedef struct written_run {
    cairn_contour_search_result *result;
    const cairn_contour_search_params *params;
    cairn_contour_grouping *grouping;
    /* [params->grouping.particles] */
    cairn_contour_grouping_particle *particles;
    /* [max_steps] */
    cairn_contour_grouping_disc *discs;
    /* [params->grouping.particles] px, start points of the clusters of particles */
    cairn_vec2 *start_points;
    /* last observed filter step */
    int32_t last_step;
} written_run;

/* Number of clusters of particles by the symmetric point that their trajectories started at. */
static int32_t count_modes(const written_run *search, int32_t count)
{
    int32_t modes = 0;

    for (int32_t i = 0; i < count; i++) {
        cairn_contour_grouping_disc first;
        int32_t k = 0;

        (void)cairn_contour_grouping_history(search->grouping, i, &first, 1);
        while (k < modes && (search->start_points[k].x != first.centre.x ||
                             search->start_points[k].y != first.centre.y))
            k++;
        if (k == modes)
            search->start_points[modes++] = first.centre;
    }
    return modes;
}

static void observe(written_run *search)
{
    int32_t steps, best = 0,
                   count = cairn_contour_grouping_particles(search->grouping, NULL, 0, &steps);

    if (steps == search->last_step || steps > search->params->grouping.max_steps)
        return;
    search->last_step = steps;
    (void)cairn_contour_grouping_particles(search->grouping, search->particles, count, NULL);
    search->result->mode_counts[0][steps - 1] = count_modes(search, count);
    if (search->params->on_step != NULL)
        search->params->on_step(search->params->context, search->particles, count, 0);
    for (int32_t i = 1; i < count; i++)
        best = search->particles[i].log_weight > search->particles[best].log_weight ? i : best;
    if (search->params->on_walk != NULL)
        search->params->on_walk(search->params->context, search->discs,
                                cairn_contour_grouping_history(search->grouping, best,
                                                               search->discs,
                                                               search->params->grouping.max_steps));
}

/* Appends an object's segments and discs. */
static void append_object(written_run *search, const cairn_contour_grouping_result *found,
                          int32_t index)
{
    cairn_contour_search_result *result = search->result;
    cairn_contour_search_object *object = &result->objects[result->object_count++];

    memset(object, 0, sizeof *object);
    object->found = found->objects[index];
    object->found.first = result->segment_count;
    object->found.first_outline = 0;
    object->first_disc = result->disc_count;
    object->disc_count = cairn_contour_grouping_skeleton(search->grouping, index, search->discs,
                                                         search->params->grouping.max_steps);
    for (int32_t i = 0; i < object->found.count; i++)
        result->segments[result->segment_count++] =
            found->segments[found->objects[index].first + i];
    for (int32_t i = 0; i < object->disc_count; i++) {
        const cairn_contour_grouping_disc *step = &search->discs[i];
        cairn_contour_search_disc disc = {.centre = step->centre,
                                          .radius = step->radius,
                                          .side = {step->segment[0], step->segment[1]},
                                          .sample = step->sample};

        result->discs[result->disc_count++] = disc;
    }
}

static cairn_status copy_result(written_run *search)
{
    cairn_contour_grouping_result found = cairn_contour_grouping_read(search->grouping);
    size_t max_objects = (size_t)search->params->grouping.max_objects,
           steps = (size_t)search->params->grouping.max_steps;
    cairn_contour_search_result *result = search->result;

    result->objects = malloc(max_objects * sizeof *result->objects);
    result->segments = malloc(2 * max_objects * steps * sizeof *result->segments);
    result->discs = malloc(max_objects * steps * sizeof *result->discs);
    result->trace[0] = malloc(steps * sizeof *result->trace[0]);
    if (result->objects == NULL || result->segments == NULL || result->discs == NULL ||
        result->trace[0] == NULL)
        return CAIRN_NO_MEMORY;
    if (found.steps > 0)
        memcpy(result->trace[0], found.trace, (size_t)found.steps * sizeof *found.trace);
    result->steps[0] = found.steps;
    result->hypothesis_counts[0] = found.hypothesis_count;
    result->best_score = found.best_score;
    result->best_evidence = found.best_evidence;
    result->mode = CAIRN_MODE_AS_WRITTEN;
    result->point_count = found.point_count;
    result->points_dropped = found.points_dropped;
    result->candidates_dropped = found.candidates_dropped;
    result->end_reason = found.end_reason;
    for (int32_t i = 0; i < found.object_count; i++)
        append_object(search, &found, i);
    return CAIRN_OK;
}

static cairn_status run(written_run *search, cairn_pool *pool,
                        const cairn_contour_grouping_params *params,
                        const cairn_contour_grouping_input *input)
{
    cairn_status status = cairn_contour_grouping_create(&search->grouping, pool, params);

    if (status == CAIRN_OK)
        status = cairn_contour_grouping_begin(search->grouping, input);
    if (status != CAIRN_OK)
        return status;
    do {
        cairn_budget budget = {UNITS_PER_CALLBACK};

        status = cairn_contour_grouping_step(search->grouping, &budget);
        if (status >= 0)
            observe(search);
    } while (status == CAIRN_MORE);
    return status == CAIRN_OK ? copy_result(search) : status;
}

/* Description of the first argument out of range; NULL: none. */
static const char *bad_argument(const cairn_contour_grouping_params *grouping,
                                const cairn_contour_grouping_input *input)
{
    cairn_fault fault = {-1, NULL};

    if (input->width < 1 || input->height < 1 || input->width > CAIRN_CONTOUR_SEARCH_MAX_SIDE ||
        input->height > CAIRN_CONTOUR_SEARCH_MAX_SIDE)
        return "the image's sides, expected 1 to 8192 pixels";
    if (cairn_shape_model_check(input->model, &fault) != CAIRN_OK)
        return fault.message;
    if (!(input->min_size > 0) || !(input->max_size >= input->min_size))
        return "the sizes, expected 0 < min_size <= max_size";
    if (cairn_contour_grouping_memory(grouping) == 0)
        return "the params of the grouping, expected the ranges of contour_grouping.h";
    return NULL;
}

static cairn_status refuse(cairn_status status, const cairn_contour_grouping_params *grouping,
                           const cairn_contour_grouping_input *input, const char *path,
                           cairn_file_error *error)
{
    const char *what = cairn_status_text(status);

    if (status == CAIRN_NO_MEMORY)
        return cairn_file_error_system(error, path, "search", ENOMEM);
    if (status == CAIRN_FULL)
        return cairn_file_error_set(error, status, path, 0, "%d segments, expected at most %d",
                                    (int)input->count, MAX_TOKENS);
    if (status == CAIRN_NOT_FINITE)
        what = cairn_is_finite(input->max_size)
                   ? "a segment or an end of a chain is not finite, expected finite positions"
                   : "max_size is not finite, expected a finite one";
    else if (status == CAIRN_BAD_ARGUMENT && bad_argument(grouping, input) != NULL)
        what = bad_argument(grouping, input);
    return cairn_file_error_set(error, status, path, 0, "%s", what);
}

cairn_status cairn_contour_search_written(cairn_contour_search_result *result,
                                          const cairn_contour_search_tokens *tokens,
                                          const cairn_shape_model *model,
                                          const cairn_contour_search_params *params,
                                          const char *path, cairn_file_error *error)
{
    cairn_contour_grouping_params grouping = params->grouping;
    cairn_contour_grouping_input input = {.segments = tokens->lines,
                                          .count = tokens->count,
                                          .width = tokens->width,
                                          .height = tokens->height,
                                          .model = model,
                                          .min_size = params->min_size,
                                          .max_size = params->max_size,
                                          .mean_length = cairn_max(tokens->mean_length, 1),
                                          .look_ahead = cairn_max(tokens->look_ahead, 1),
                                          .ends = tokens->ends,
                                          .end_count = tokens->end_count};
    written_run search = {.result = result, .params = params};
    int64_t points = (int64_t)tokens->count * POINTS_PER_SEGMENT;
    cairn_status status;
    cairn_pool pool;
    void *memory;

    memset(result, 0, sizeof *result);
    grouping.max_width = tokens->width;
    grouping.max_height = tokens->height;
    grouping.max_tokens = tokens->count < MIN_TOKENS ? MIN_TOKENS : tokens->count;
    /* Two chain ends per segment at most; a chain whose pixels give no edgel has ends, too. */
    if (grouping.max_tokens < tokens->end_count / 2)
        grouping.max_tokens = tokens->end_count / 2;
    grouping.max_samples = model->sample_count;
    grouping.max_outline = model->outline_count > 0 ? model->outline_count : 1;
    grouping.max_points = points < 1 ? 1 : points > MAX_POINTS ? MAX_POINTS : (int32_t)points;
    result->pool_bytes = cairn_contour_grouping_memory(&grouping) + CAIRN_ALIGN;
    memory = malloc(result->pool_bytes);
    search.particles = malloc((size_t)(grouping.particles > 0 ? grouping.particles : 1) *
                              sizeof *search.particles);
    search.discs =
        malloc((size_t)(grouping.max_steps > 0 ? grouping.max_steps : 1) * sizeof *search.discs);
    search.start_points = malloc((size_t)(grouping.particles > 0 ? grouping.particles : 1) *
                                 sizeof *search.start_points);
    result->mode_counts[0] = calloc((size_t)(grouping.max_steps > 0 ? grouping.max_steps : 1),
                                    sizeof *result->mode_counts[0]);
    status = memory != NULL && search.particles != NULL && search.discs != NULL &&
                     search.start_points != NULL && result->mode_counts[0] != NULL
                 ? CAIRN_OK
                 : CAIRN_NO_MEMORY;
    if (status == CAIRN_OK && tokens->count > MAX_TOKENS)
        status = CAIRN_FULL;
    if (status == CAIRN_OK)
        status = cairn_pool_init(&pool, memory, result->pool_bytes);
    if (status == CAIRN_OK)
        status = run(&search, &pool, &grouping, &input);
    free(memory);
    free(search.particles);
    free(search.discs);
    free(search.start_points);
    if (status == CAIRN_OK)
        return CAIRN_OK;
    cairn_contour_search_result_free(result);
    return refuse(status, &grouping, &input, path, error);
}
