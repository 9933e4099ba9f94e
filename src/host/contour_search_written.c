/* The search in the mode as written: one run of contour_grouping at one size; the segments of
 * its walks are the contours, and their symmetric points the skeletons. No outline is fitted or
 * bent. */
#include "src/core/build.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/contour_search_work.h"

/* Symmetric points for every segment, and the most of all. */
enum { POINTS_A_SEGMENT = 160, POINTS_MOST = 1 << 18, LEAST_TOKENS = 64 };
/* Segments that a search takes at most. */
enum { TOKENS_MOST = 1 << 20 };
/* Units between two looks at the walk, and at most for each of N particles: a step costs more
 * than 50 for each particle, and fewer than N / 2 are resampled, so that no two steps are made
 * between two looks. */
enum { LOOK_EVERY = 2000, LOOK_UNITS_A_PARTICLE = 25 };

cairn_contour_search_params cairn_contour_search_as_written(int32_t width, int32_t height)
{
    cairn_contour_search_params params = cairn_contour_search_default(width, height);

    params.grouping = cairn_grouping_as_written();
    params.min_evidence = params.min_score = 0;
    params.min_turn = params.max_turn = 0;
    params.mirror = 0;
    return params;
}

const char *cairn_contour_end_text(int32_t end)
{
    static const char *const text[] = {"no start", "posterior", "no follower", "steps",
                                       "histories"};

    return end >= 0 && end < (int32_t)(sizeof text / sizeof *text) ? text[end] : "";
}

/* What a run writes to. */
typedef struct written_run {
    cairn_contour_result *result;
    const cairn_contour_search_params *params;
    cairn_grouping *grouping;
    /* [params->grouping.particles] */
    cairn_grouping_particle *particles;
    /* [max_steps] */
    cairn_grouping_disc *discs;
    /* [params->grouping.particles] of the groups of particles */
    cairn_vec2 *starts;
    /* steps */
    int32_t seen;
} written_run;

/* Groups of particles whose walks began at the same symmetric point. */
static int32_t count_modes(const written_run *r, int32_t count)
{
    int32_t modes = 0;

    for (int32_t i = 0; i < count; i++) {
        cairn_grouping_disc first;
        int32_t k = 0;

        (void)cairn_grouping_history(r->grouping, i, &first, 1);
        while (k < modes && (r->starts[k].x != first.centre.x || r->starts[k].y != first.centre.y))
            k++;
        if (k == modes)
            r->starts[modes++] = first.centre;
    }
    return modes;
}

static void look(written_run *r)
{
    int32_t steps, best = 0, count = cairn_grouping_particles(r->grouping, NULL, 0, &steps);

    if (steps == r->seen || steps > r->params->grouping.max_steps)
        return;
    r->seen = steps;
    (void)cairn_grouping_particles(r->grouping, r->particles, count, NULL);
    r->result->modes[0][steps - 1] = count_modes(r, count);
    if (r->params->on_step != NULL)
        r->params->on_step(r->params->context, r->particles, count, 0);
    for (int32_t i = 1; i < count; i++)
        best = r->particles[i].log_weight > r->particles[best].log_weight ? i : best;
    if (r->params->on_walk != NULL)
        r->params->on_walk(
            r->params->context, r->discs,
            cairn_grouping_history(r->grouping, best, r->discs, r->params->grouping.max_steps));
}

/* One object's segments and discs. */
static void take_object(written_run *r, const cairn_grouping_result *found, int32_t index)
{
    cairn_contour_result *out = r->result;
    cairn_contour_object *o = &out->objects[out->object_count++];

    memset(o, 0, sizeof *o);
    o->found = found->objects[index];
    o->found.first = out->segment_count;
    o->found.along = 0;
    o->first_disc = out->disc_count;
    o->disc_count =
        cairn_grouping_skeleton(r->grouping, index, r->discs, r->params->grouping.max_steps);
    for (int32_t i = 0; i < o->found.count; i++)
        out->segments[out->segment_count++] = found->segments[found->objects[index].first + i];
    for (int32_t i = 0; i < o->disc_count; i++) {
        const cairn_grouping_disc *d = &r->discs[i];
        cairn_contour_disc disc = {d->centre, d->radius, {d->segment[0], d->segment[1]}, d->sample};

        out->discs[out->disc_count++] = disc;
    }
}

static cairn_status take_result(written_run *r)
{
    cairn_grouping_result found = cairn_grouping_read(r->grouping);
    size_t most = (size_t)r->params->grouping.max_objects,
           steps = (size_t)r->params->grouping.max_steps;
    cairn_contour_result *out = r->result;

    out->objects = malloc(most * sizeof *out->objects);
    out->segments = malloc(2 * most * steps * sizeof *out->segments);
    out->discs = malloc(most * steps * sizeof *out->discs);
    out->trace[0] = malloc(steps * sizeof *out->trace[0]);
    if (out->objects == NULL || out->segments == NULL || out->discs == NULL ||
        out->trace[0] == NULL)
        return CAIRN_NO_MEMORY;
    if (found.steps > 0)
        memcpy(out->trace[0], found.trace, (size_t)found.steps * sizeof *found.trace);
    out->steps[0] = found.steps;
    out->starts[0] = found.starts;
    out->best = found.best;
    out->best_evidence = found.best_evidence;
    out->mode = CAIRN_MODE_AS_WRITTEN;
    out->points = found.points;
    out->points_dropped = found.points_dropped;
    out->end = found.end;
    for (int32_t i = 0; i < found.object_count; i++)
        take_object(r, &found, i);
    return CAIRN_OK;
}

static cairn_status run(written_run *r, cairn_pool *pool, const cairn_grouping_params *params,
                        const cairn_grouping_input *input)
{
    int32_t units;
    cairn_status status = cairn_grouping_create(&r->grouping, pool, params);

    if (status == CAIRN_OK)
        status = cairn_grouping_begin(r->grouping, input);
    if (status != CAIRN_OK)
        return status;
    units = LOOK_UNITS_A_PARTICLE * params->particles;
    units = units < LOOK_EVERY ? units : LOOK_EVERY;
    do {
        cairn_budget budget = {units};

        status = cairn_grouping_step(r->grouping, &budget);
        if (status >= 0)
            look(r);
    } while (status == CAIRN_MORE);
    return status == CAIRN_OK ? take_result(r) : status;
}

/* What a search was refused for: the first argument that is out of its range; NULL: none is. */
static const char *bad_argument(const cairn_grouping_params *grouping,
                                const cairn_grouping_input *input)
{
    cairn_fault fault = {-1, NULL};

    if (input->width < 1 || input->height < 1 || input->width > CAIRN_CONTOUR_SIDE_MOST ||
        input->height > CAIRN_CONTOUR_SIDE_MOST)
        return "the image's sides, expected 1 to 8192 pixels";
    if (cairn_shape_model_check(input->model, &fault) != CAIRN_OK)
        return fault.what;
    if (!(input->min_size > 0) || !(input->max_size >= input->min_size))
        return "the sizes, expected 0 < min_size <= max_size";
    if (cairn_grouping_memory(grouping) == 0)
        return "the params of the grouping, expected the ranges of contour_grouping.h";
    return NULL;
}

static cairn_status refuse(cairn_status status, const cairn_grouping_params *grouping,
                           const cairn_grouping_input *input, const char *path,
                           cairn_file_error *error)
{
    const char *what = cairn_status_text(status);

    if (status == CAIRN_NO_MEMORY)
        return cairn_file_error_system(error, path, "search", ENOMEM);
    if (status == CAIRN_FULL)
        return cairn_file_error_set(error, status, path, 0, "%d segments, expected at most %d",
                                    (int)input->count, TOKENS_MOST);
    if (status == CAIRN_NOT_FINITE)
        what = cairn_is_finite(input->max_size)
                   ? "a segment or an end of a chain is not finite, expected finite places"
                   : "max_size is not finite, expected a finite one";
    else if (status == CAIRN_BAD_ARGUMENT && bad_argument(grouping, input) != NULL)
        what = bad_argument(grouping, input);
    return cairn_file_error_set(error, status, path, 0, "%s", what);
}

cairn_status cairn_contour_search_written(cairn_contour_result *result,
                                          const cairn_contour_tokens *tokens,
                                          const cairn_shape_model *model,
                                          const cairn_contour_search_params *params,
                                          const char *path, cairn_file_error *error)
{
    cairn_grouping_params grouping = params->grouping;
    cairn_grouping_input input = {.segments = tokens->lines,
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
    written_run r = {.result = result, .params = params};
    int64_t points = (int64_t)tokens->count * POINTS_A_SEGMENT;
    cairn_status status;
    cairn_pool pool;
    void *memory;

    memset(result, 0, sizeof *result);
    grouping.max_width = tokens->width;
    grouping.max_height = tokens->height;
    grouping.max_tokens = tokens->count < LEAST_TOKENS ? LEAST_TOKENS : tokens->count;
    grouping.max_samples = model->sample_count;
    grouping.max_outline = model->outline_count > 0 ? model->outline_count : 1;
    grouping.max_points = points < 1 ? 1 : points > POINTS_MOST ? POINTS_MOST : (int32_t)points;
    result->pool_bytes = cairn_grouping_memory(&grouping) + CAIRN_ALIGN;
    memory = malloc(result->pool_bytes);
    r.particles =
        malloc((size_t)(grouping.particles > 0 ? grouping.particles : 1) * sizeof *r.particles);
    r.discs = malloc((size_t)(grouping.max_steps > 0 ? grouping.max_steps : 1) * sizeof *r.discs);
    r.starts = malloc((size_t)(grouping.particles > 0 ? grouping.particles : 1) * sizeof *r.starts);
    result->modes[0] =
        calloc((size_t)(grouping.max_steps > 0 ? grouping.max_steps : 1), sizeof *result->modes[0]);
    status = memory != NULL && r.particles != NULL && r.discs != NULL && r.starts != NULL &&
                     result->modes[0] != NULL
                 ? CAIRN_OK
                 : CAIRN_NO_MEMORY;
    if (status == CAIRN_OK && tokens->count > TOKENS_MOST)
        status = CAIRN_FULL;
    if (status == CAIRN_OK)
        status = cairn_pool_init(&pool, memory, result->pool_bytes);
    if (status == CAIRN_OK)
        status = run(&r, &pool, &grouping, &input);
    free(memory);
    free(r.particles);
    free(r.discs);
    free(r.starts);
    if (status == CAIRN_OK)
        return CAIRN_OK;
    cairn_contour_result_free(result);
    return refuse(status, &grouping, &input, path, error);
}
