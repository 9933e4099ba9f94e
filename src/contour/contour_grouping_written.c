/* Contour grouping as Adluru 2008, chapter 2, has it: a particle filter in the space of symmetric
 * points.
 *
 * Method:
 * 1. The symmetric point of every pair of segments whose discs have radii of the model
 *    (cairn_symmetric_point_set), in a hash by pair.
 * 2. The first particles: points of segments about the end points of strong chains, in both senses
 *    of the walk and of the model's path, drawn by quality (2.10) and likelihood (2.13).
 * 3. The walk (contour_grouping_written_walk.c): prior proposal, prior boosting, residual
 *    resampling when N_eff < N / 2.
 * 4. After each step the best walk of every mode is kept (contour_grouping_written_mode.c). The
 *    walk ends when the greatest posterior is below that of `stop` a step, or no particle can go
 *    on.
 *
 * Source: Adluru 2008, chapter 2; choices: contour_grouping.h. */
#include "src/core/build.h"

#include <string.h>

#include "src/contour/contour_grouping_written.h"

/* States in histories for every particle: paths that particles share are stored once. */
enum { BLOCKS_A_PARTICLE = 24, FOLLOWERS = 8 };
/* px: the side of a cell of the grid of ends. */
#define CELL 8
enum { STARTS_A_POINT = 4, UNITS_A_START = 6, UNITS_A_KEEP = 4, OBJECTS_A_UNIT = 8 };

cairn_grouping_params cairn_grouping_as_written(void)
{
    cairn_grouping_params params = cairn_grouping_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    params.stop = CAIRN_REAL(0.5);
    return params;
}

static int32_t slots_of(int32_t points)
{
    int32_t slots = 16;

    while (slots < 2 * points)
        slots *= 2;
    return slots;
}

static cairn_symmetric_point_params point_params(const cairn_grouping_params *p)
{
    cairn_symmetric_point_params params = cairn_symmetric_point_as_written();

    params.max_segments = p->max_tokens;
    params.max_points = p->max_points;
    return params;
}

static cairn_particle_filter_params filter_params(const cairn_grouping_params *p)
{
    cairn_particle_filter_params f = cairn_particle_filter_default();

    f.particles = f.max_particles = p->particles;
    f.proposal = CAIRN_PROPOSAL_PRIOR;
    f.max_followers = FOLLOWERS;
    f.max_candidates = p->particles * WRITTEN_PAIRS;
    f.past = 0;
    f.max_blocks = BLOCKS_A_PARTICLE * p->particles + p->max_steps;
    f.state_bytes = (int32_t)sizeof(grouping_written_state);
    return f;
}

/* ---- Memory ---- */

static void carve_parts(cairn_pool *pool, const cairn_grouping_params *p, cairn_grouping *grouping,
                        struct grouping_written *w)
{
    cairn_symmetric_point_params points = point_params(p);
    cairn_point_grid_params ends = {2 * p->max_tokens, CELL};
    cairn_particle_filter_params filter = filter_params(p);
    cairn_particle_model model = cairn_grouping_written_model(grouping);
    cairn_status status;

    if (pool->base == NULL) {
        cairn_pool_count(pool, cairn_symmetric_point_memory(&points));
        cairn_pool_count(pool, cairn_point_grid_memory(&ends));
        cairn_pool_count(pool, cairn_particle_filter_memory(&filter));
        return;
    }
    status = cairn_symmetric_point_create(&w->set, pool, &points);
    if (status == CAIRN_OK)
        status = cairn_point_grid_create(&w->ends, pool, &ends);
    if (status == CAIRN_OK)
        status = cairn_particle_filter_create(&grouping->filter, pool, &filter, &model);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
}

struct grouping_written *cairn_grouping_written_carve(cairn_pool *pool,
                                                      const cairn_grouping_params *p,
                                                      cairn_grouping *grouping)
{
    struct grouping_written *w = cairn_pool_take_one(pool, sizeof *w);
    int32_t *slot = cairn_pool_take(pool, (size_t)slots_of(p->max_points), sizeof *slot);
    uint8_t *is_start = cairn_pool_take(pool, (size_t)p->max_tokens, 1);
    int32_t *stamp = cairn_pool_take(pool, (size_t)p->max_tokens, sizeof *stamp);
    cairn_grouping_disc *walk =
        cairn_pool_take(pool, (size_t)p->max_objects * (size_t)p->max_steps, sizeof *walk);
    const grouping_written_state **past =
        cairn_pool_take(pool, (size_t)p->max_steps, sizeof(const grouping_written_state *));
    cairn_vec2 *side = cairn_pool_take(pool, 4 * (size_t)p->max_steps, sizeof *side);
    cairn_vec2 *polygon = cairn_pool_take(pool, 4 * (size_t)p->max_steps, sizeof *polygon);
    cairn_grouping_trace *trace = cairn_pool_take(pool, (size_t)p->max_steps, sizeof *trace);
    int32_t *place = cairn_pool_take(pool, (size_t)p->max_objects, sizeof *place);
    int32_t *segments =
        cairn_pool_take(pool, 2 * (size_t)p->max_objects * (size_t)p->max_steps, sizeof *segments);
    cairn_grouped_object *objects = cairn_pool_take(pool, (size_t)p->max_objects, sizeof *objects);
    int32_t *along =
        cairn_pool_take(pool, (size_t)p->max_objects * (size_t)p->max_outline, sizeof *along);

    if (w != NULL) {
        memset(w, 0, sizeof *w);
        memset(stamp, 0, (size_t)p->max_tokens * sizeof *stamp);
        w->slot = slot;
        w->slots = slots_of(p->max_points);
        w->is_start = is_start;
        w->stamp = stamp;
        w->walk = walk;
        w->place = place;
        w->past = past;
        w->side[0].vertex = side;
        w->side[1].vertex = side + 2 * p->max_steps;
        w->polygon = polygon;
        grouping->trace = trace;
        grouping->segments = segments;
        grouping->objects = objects;
        grouping->along = along;
    }
    carve_parts(pool, p, grouping, w);
    return w;
}

/* ---- Beginning ---- */

cairn_status cairn_grouping_written_check(const cairn_grouping *grouping,
                                          const cairn_grouping_input *in)
{
    if (!cairn_is_finite(in->look_ahead))
        return CAIRN_NOT_FINITE;
    if (!(in->look_ahead > 0) || in->end_count < 0 || (in->ends == NULL && in->end_count > 0))
        return CAIRN_BAD_ARGUMENT;
    return in->count > grouping->params.max_tokens ? CAIRN_FULL : CAIRN_OK;
}

/* The mean radius of the path, and the range of radii with R_sigma of it more on both sides. */
static void read_model(struct grouping_written *w, const cairn_shape_model *m, cairn_real slack)
{
    const cairn_shape_sample *samples = &m->samples[m->paths[0].first];
    cairn_real least = CAIRN_REAL_MAX, most = 0, sum = 0;
    int32_t count = m->paths[0].count;

    for (int32_t k = 0; k < count; k++) {
        least = cairn_min(least, samples[k].radius);
        most = cairn_max(most, samples[k].radius);
        sum += samples[k].radius;
    }
    w->mean_radius = sum / (cairn_real)count;
    w->points.min_radius = w->size * cairn_max(least - slack * w->mean_radius, 0);
    w->points.max_radius = w->size * (most + slack * w->mean_radius);
}

void cairn_grouping_written_begin(cairn_grouping *grouping)
{
    struct grouping_written *w = grouping->written;

    w->points = point_params(&grouping->params);
    w->size = cairn_sqrt(grouping->input.min_size * grouping->input.max_size);
    read_model(w, grouping->input.model, grouping->params.radius_sigma);
    w->log_stop = cairn_log(grouping->params.stop);
    w->look = 0;
    w->random = cairn_random_seed(grouping->params.seed, 1);
    w->is_set = w->is_drawing = w->end = w->seeds = w->draws = w->is_keeping = 0;
    w->sum = w->drawn = 0;
}

/* ---- Points ---- */

cairn_status cairn_grouping_written_points(cairn_grouping *grouping, cairn_budget *budget)
{
    struct grouping_written *w = grouping->written;

    if (!w->is_set) {
        cairn_status status =
            cairn_symmetric_point_set_radii(w->set, w->points.min_radius, w->points.max_radius);

        if (status == CAIRN_OK)
            status = cairn_symmetric_point_begin(w->set, grouping->input.segments,
                                                 grouping->input.count);
        if (status != CAIRN_OK)
            return status;
        w->is_set = 1;
    }
    return cairn_symmetric_point_step(w->set, budget);
}

static int32_t slot_of(const struct grouping_written *w, int32_t first, int32_t second)
{
    uint32_t h =
        ((uint32_t)first * UINT32_C(2654435761)) ^ ((uint32_t)second * UINT32_C(2246822519));

    return (int32_t)((h ^ (h >> 15)) & (uint32_t)(w->slots - 1));
}

const cairn_symmetric_point *cairn_grouping_written_point(const cairn_grouping *grouping,
                                                          int32_t first, int32_t second)
{
    const struct grouping_written *w = grouping->written;
    const cairn_symmetric_point *points = cairn_symmetric_point_list(w->set, NULL);
    int32_t low = first < second ? first : second, high = first < second ? second : first,
            at = slot_of(w, low, high);

    for (; w->slot[at] >= 0; at = (at + 1) & (w->slots - 1)) {
        const cairn_symmetric_point *p = &points[w->slot[at]];

        if (p->first == low && p->second == high)
            return p;
    }
    return NULL;
}

/* Fills the hash and the grid of ends; marks the segments about the ends of strong chains.
 * `cursor` counts all items. */
cairn_status cairn_grouping_written_index(cairn_grouping *grouping, cairn_budget *budget)
{
    struct grouping_written *w = grouping->written;
    int32_t count, slots = w->slots, ends = 2 * grouping->input.count;
    const cairn_symmetric_point *points = cairn_symmetric_point_list(w->set, &count);

    for (; grouping->cursor < slots; grouping->cursor++) {
        if (!cairn_budget_pay(budget, &grouping->charged_units, 1))
            return CAIRN_MORE;
        w->slot[grouping->cursor] = -1;
    }
    for (; grouping->cursor < slots + count; grouping->cursor++) {
        const cairn_symmetric_point *p = &points[grouping->cursor - slots];
        int32_t at = slot_of(w, p->first, p->second);

        if (!cairn_budget_pay(budget, &grouping->charged_units, 2))
            return CAIRN_MORE;
        while (w->slot[at] >= 0)
            at = (at + 1) & (w->slots - 1);
        w->slot[at] = grouping->cursor - slots;
    }
    while (grouping->second_cursor == 0 && cairn_point_grid_count(w->ends) > 0) {
        if (!cairn_budget_pay(budget, &grouping->charged_units, 1))
            return CAIRN_MORE;
        cairn_point_grid_remove_last(w->ends);
    }
    for (; grouping->second_cursor < ends; grouping->second_cursor++) {
        const cairn_segment *s = &grouping->input.segments[grouping->second_cursor / 2];
        cairn_status status;

        if (!cairn_budget_pay(budget, &grouping->charged_units, 1))
            return CAIRN_MORE;
        w->is_start[grouping->second_cursor / 2] = 0;
        w->stamp[grouping->second_cursor / 2] = 0;
        status = cairn_point_grid_insert(w->ends, grouping->second_cursor % 2 ? s->b : s->a);
        if (status != CAIRN_OK)
            return status;
    }
    for (; grouping->second_cursor < ends + grouping->input.end_count; grouping->second_cursor++) {
        cairn_point_grid_cursor near =
            cairn_point_grid_begin(w->ends, grouping->input.ends[grouping->second_cursor - ends],
                                   grouping->input.look_ahead);

        if (!cairn_budget_pay(budget, &grouping->charged_units, UNITS_A_START))
            return CAIRN_MORE;
        if (!cairn_is_finite(near.centre.x) || !cairn_is_finite(near.centre.y))
            return CAIRN_NOT_FINITE;
        for (int32_t e = cairn_point_grid_next(w->ends, &near); e >= 0;
             e = cairn_point_grid_next(w->ends, &near))
            w->is_start[e / 2] = 1;
    }
    return CAIRN_OK;
}

/* ---- First particles ---- */

/* One of the four walks that may start at a point: its sense, and that of the model's path; the
 * log of its mass. */
static cairn_real start_at(const cairn_grouping *grouping, const cairn_symmetric_point *p,
                           int32_t which, grouping_written_state *s)
{
    const cairn_segment *lines = grouping->input.segments;
    cairn_vec2 ahead = cairn_vec2_left(cairn_vec2_sub(p->touch[1], p->touch[0]));
    cairn_real likelihood;
    int32_t back = which & 1;

    memset(s, 0, sizeof *s);
    if (back)
        ahead = cairn_vec2_scale(ahead, -1);
    s->centre = s->start = p->centre;
    s->radius = p->radius;
    s->deviation = p->deviation;
    s->way = which >> 1;
    /* Ahead is to the left, with y down to the right, of the way from the first to the second. */
    s->segment[0] = back ? p->first : p->second;
    s->segment[1] = back ? p->second : p->first;
    for (int32_t side = 0; side < 2; side++) {
        const cairn_segment *line = &lines[s->segment[side]];

        s->end[side] =
            2 * s->segment[side] + (cairn_vec2_dot(ahead, cairn_vec2_sub(line->b, line->a)) > 0);
    }
    likelihood = cairn_grouping_written_likelihood(grouping, s, &s->sample);
    s->log_posterior = likelihood - grouping->written->log_stop;
    return likelihood +
           (grouping->params.use_skeleton
                ? cairn_log(cairn_symmetric_point_quality(p, grouping->params.symmetry))
                : 0);
}

static int is_seed(const struct grouping_written *w, const cairn_symmetric_point *p)
{
    return w->is_start[p->first] || w->is_start[p->second];
}

/* Adds up the masses of all starts; then draws as many as there are particles, at even steps of
 * the sum. */
cairn_status cairn_grouping_written_seed(cairn_grouping *grouping, cairn_budget *budget)
{
    struct grouping_written *w = grouping->written;
    const cairn_symmetric_point *points;
    int32_t count;
    cairn_status status;

    points = cairn_symmetric_point_list(w->set, &count);
    for (; grouping->cursor < STARTS_A_POINT * count; grouping->cursor++) {
        const cairn_symmetric_point *p = &points[grouping->cursor / STARTS_A_POINT];
        grouping_written_state s;

        if (!cairn_budget_pay(budget, &grouping->charged_units,
                              is_seed(w, p) ? UNITS_A_START +
                                                  cairn_grouping_written_likelihood_units(grouping)
                                            : 1))
            return CAIRN_MORE;
        if (!is_seed(w, p))
            continue;
        w->sum += cairn_exp(start_at(grouping, p, grouping->cursor % STARTS_A_POINT, &s));
        w->seeds++;
    }
    if (!w->is_drawing) {
        w->is_drawing = 1;
        w->drawn = -cairn_random_unit(&w->random) * w->sum / (cairn_real)grouping->params.particles;
        status = cairn_particle_filter_clear(grouping->filter, grouping->params.seed);
        if (status != CAIRN_OK)
            return status;
    }
    for (;
         grouping->second_cursor < STARTS_A_POINT * count && w->draws < grouping->params.particles;
         grouping->second_cursor++) {
        const cairn_symmetric_point *p = &points[grouping->second_cursor / STARTS_A_POINT];
        grouping_written_state s;

        if (!cairn_budget_pay(budget, &grouping->charged_units,
                              is_seed(w, p) ? UNITS_A_START +
                                                  cairn_grouping_written_likelihood_units(grouping)
                                            : 1))
            return CAIRN_MORE;
        if (!is_seed(w, p))
            continue;
        w->drawn += cairn_exp(start_at(grouping, p, grouping->second_cursor % STARTS_A_POINT, &s));
        while (w->draws < grouping->params.particles &&
               w->drawn > w->sum * (cairn_real)w->draws / (cairn_real)grouping->params.particles) {
            status = cairn_particle_filter_start(grouping->filter, &s, 0);
            if (status != CAIRN_OK)
                return status;
            w->draws++;
        }
    }
    grouping->generated_count = w->seeds;
    grouping->has_particles = w->draws > 0;
    return w->draws > 0 ? cairn_particle_filter_begin(grouping->filter) : CAIRN_OK;
}

/* ---- The walk ---- */

static cairn_real greatest_posterior(const cairn_grouping *grouping)
{
    cairn_real most = -CAIRN_REAL_MAX;

    for (int32_t i = 0; i < cairn_particle_filter_count(grouping->filter); i++) {
        const grouping_written_state *s = cairn_particle_filter_particle(grouping->filter, i).state;

        most = cairn_max(most, s->log_posterior);
    }
    return most;
}

/* Takes down a step of the filter. 0: no particle could go on, and they are as they were. */
static int take_step(cairn_grouping *grouping)
{
    cairn_particle_trace t = cairn_particle_filter_read(grouping->filter);
    cairn_grouping_trace *trace = &grouping->trace[grouping->step_count];

    if (t.extinct)
        return 0;
    grouping->step_count++;
    trace->n_eff = t.n_eff;
    trace->log_likelihood = greatest_posterior(grouping) / (cairn_real)(grouping->step_count + 1) +
                            grouping->written->log_stop;
    trace->followers = t.followers;
    trace->resampled = t.resampled;
    trace->particles = t.particles;
    return 1;
}

/* After a step: CAIRN_GROUPING_..., why it was the last one; 0: it was not. */
static int32_t why_last(const cairn_grouping *grouping)
{
    if (greatest_posterior(grouping) < 0)
        return CAIRN_GROUPING_POSTERIOR;
    return grouping->step_count + 1 >= grouping->params.max_steps ? CAIRN_GROUPING_STEPS : 0;
}

cairn_status cairn_grouping_written_run_filter(cairn_grouping *grouping, cairn_budget *budget)
{
    struct grouping_written *w = grouping->written;

    while (w->draws > 0) {
        cairn_status status;

        if (!w->is_keeping) {
            status = cairn_particle_filter_step(grouping->filter, budget);
            if (status == CAIRN_FULL)
                w->end = CAIRN_GROUPING_HISTORIES;
            else if (status == CAIRN_OK && !take_step(grouping))
                w->end = CAIRN_GROUPING_NO_FOLLOWER;
            if (w->end != 0)
                return CAIRN_OK;
            if (status != CAIRN_OK)
                return status;
            w->is_keeping = 1;
            grouping->cursor = 0;
        }
        for (; grouping->cursor < cairn_particle_filter_count(grouping->filter);
             grouping->cursor++) {
            int32_t units =
                UNITS_A_KEEP + grouping->step_count * (1 + grouping->object_count / OBJECTS_A_UNIT);

            if (!cairn_budget_pay(budget, &grouping->charged_units, units))
                return CAIRN_MORE;
            cairn_grouping_written_record(grouping, grouping->cursor);
        }
        w->is_keeping = 0;
        w->end = why_last(grouping);
        if (w->end != 0)
            return CAIRN_OK;
        status = cairn_particle_filter_begin(grouping->filter);
        if (status != CAIRN_OK)
            return status;
    }
    return CAIRN_OK;
}

void cairn_grouping_written_read(const cairn_grouping *grouping, cairn_grouping_result *r)
{
    const struct grouping_written *w = grouping->written;

    (void)cairn_symmetric_point_list(w->set, &r->points);
    r->points_dropped = cairn_symmetric_point_dropped(w->set);
    r->token_count = grouping->input.count;
    r->end = w->end;
}
