/* Contour grouping as in Adluru 2008, chapter 2: a particle filter in the space of symmetric points
 * (SP space).
 *
 * Method:
 * 1. The symmetric point of every pair of segments whose disc has a radius within the model's range
 *    (cairn_symmetric_point_set) is stored in a hash table by pair.
 * 2. Initial particles: symmetric points near the end points of strong chains, in both directions
 *    of travel and of the model's path, sampled by quality (2.10) times likelihood (2.13).
 * 3. Filter steps (contour_grouping_written_filter.c): prior proposal, prior boosting, residual
 *    resampling when N_eff < N / 2.
 * 4. After each step the best trajectory of every mode is recorded
 *    (contour_grouping_written_mode.c). The filter ends when the greatest posterior per step is
 *    below stop_likelihood, or no particle has a successor.
 *
 * Source: Adluru 2008, chapter 2; choices: contour_grouping.h. */
#include "src/base/build.h"

#include <string.h>

#include "src/outlines/contour_grouping_written.h"

/* Capacity of history states per particle (shared trajectories are stored once); greatest number of
 * followers. */
enum { BLOCKS_PER_PARTICLE = 24, MAX_FOLLOWERS = 16 };
/* Greatest angle between an edge normal and the line between both edgels, degrees. */
#define MAX_CHORD_ANGLE_DEG 75
/* Side of a cell of the grid of ends, px. */
#define END_GRID_CELL_PX 8
enum { STARTS_PER_POINT = 4, UNITS_PER_START = 6, UNITS_PER_RECORD = 4, OBJECTS_PER_UNIT = 8 };

cairn_contour_grouping_params cairn_contour_grouping_as_written(void)
{
    cairn_contour_grouping_params params = cairn_contour_grouping_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    params.stop_likelihood = CAIRN_REAL(0.5);
    return params;
}

static int32_t slot_count_of(int32_t points)
{
    int32_t slots = 16;

    while (slots < 2 * points)
        slots *= 2;
    return slots;
}

static cairn_symmetric_point_params
symmetric_point_params(const cairn_contour_grouping_params *params)
{
    cairn_symmetric_point_params settings = cairn_symmetric_point_as_written();

    settings.max_segments = params->max_tokens;
    settings.max_angle = MAX_CHORD_ANGLE_DEG * (CAIRN_PI / 180);
    settings.max_points = params->max_points;
    return settings;
}

static cairn_particle_filter_params filter_params(const cairn_contour_grouping_params *params)
{
    cairn_particle_filter_params settings = cairn_particle_filter_default();

    settings.particles = settings.max_particles = params->particles;
    settings.proposal = CAIRN_PARTICLE_FILTER_PROPOSAL_BOOSTED;
    settings.max_followers = MAX_FOLLOWERS;
    settings.max_candidates = params->particles * CONTOUR_GROUPING_WRITTEN_CANDIDATES_PER_PARTICLE;
    settings.max_history = 0;
    settings.max_blocks = BLOCKS_PER_PARTICLE * params->particles + params->max_steps;
    settings.state_bytes = (int32_t)sizeof(contour_grouping_written_state);
    return settings;
}

/* ---- Memory ---- */

static void create_members(cairn_pool *pool, const cairn_contour_grouping_params *params,
                           cairn_contour_grouping *grouping,
                           struct contour_grouping_written *written)
{
    cairn_symmetric_point_params points = symmetric_point_params(params);
    cairn_point_grid_params ends = {.max_points = 2 * params->max_tokens,
                                    .cell_size = END_GRID_CELL_PX};
    cairn_particle_filter_params filter = filter_params(params);
    cairn_particle_filter_model model = cairn_contour_grouping_written_model(grouping);
    cairn_status status;

    if (pool->base == NULL) {
        cairn_pool_count(pool, cairn_symmetric_point_memory(&points));
        cairn_pool_count(pool, cairn_point_grid_memory(&ends));
        cairn_pool_count(pool, cairn_point_grid_memory(&ends));
        cairn_pool_count(pool, cairn_particle_filter_memory(&filter));
        return;
    }
    status = cairn_symmetric_point_create(&written->set, pool, &points);
    if (status == CAIRN_OK)
        status = cairn_point_grid_create(&written->ends, pool, &ends);
    if (status == CAIRN_OK)
        status = cairn_point_grid_create(&written->chain_ends, pool, &ends);
    if (status == CAIRN_OK)
        status = cairn_particle_filter_create(&grouping->filter, pool, &filter, &model);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
}

struct contour_grouping_written *
cairn_contour_grouping_written_carve(cairn_pool *pool, const cairn_contour_grouping_params *params,
                                     cairn_contour_grouping *grouping)
{
    struct contour_grouping_written *written = cairn_pool_take_one(pool, sizeof *written);
    int32_t *pair_slots =
        cairn_pool_take(pool, (size_t)slot_count_of(params->max_points), sizeof *pair_slots);
    int32_t *segment_stamp =
        cairn_pool_take(pool, (size_t)params->max_tokens, sizeof *segment_stamp);
    cairn_contour_grouping_disc *trajectories = cairn_pool_take(
        pool, (size_t)params->max_objects * (size_t)params->max_steps, sizeof *trajectories);
    const contour_grouping_written_state **history = cairn_pool_take(
        pool, (size_t)params->max_steps, sizeof(const contour_grouping_written_state *));
    cairn_vec2 *side = cairn_pool_take(pool, 4 * (size_t)params->max_steps, sizeof *side);
    cairn_vec2 *polygon = cairn_pool_take(pool, 4 * (size_t)params->max_steps, sizeof *polygon);
    cairn_contour_grouping_trace *trace =
        cairn_pool_take(pool, (size_t)params->max_steps, sizeof *trace);
    int32_t *trajectory_slot =
        cairn_pool_take(pool, (size_t)params->max_objects, sizeof *trajectory_slot);
    int32_t *segments = cairn_pool_take(
        pool, 2 * (size_t)params->max_objects * (size_t)params->max_steps, sizeof *segments);
    cairn_contour_grouping_object *objects =
        cairn_pool_take(pool, (size_t)params->max_objects, sizeof *objects);
    int32_t *along = cairn_pool_take(
        pool, (size_t)params->max_objects * (size_t)params->max_outline, sizeof *along);

    if (written != NULL) {
        memset(written, 0, sizeof *written);
        memset(segment_stamp, 0, (size_t)params->max_tokens * sizeof *segment_stamp);
        written->pair_slots = pair_slots;
        written->slot_count = slot_count_of(params->max_points);
        written->segment_stamp = segment_stamp;
        written->trajectories = trajectories;
        written->trajectory_slot = trajectory_slot;
        written->history = history;
        written->side[0].vertex = side;
        written->side[1].vertex = side + 2 * params->max_steps;
        written->polygon = polygon;
        grouping->trace = trace;
        grouping->segments = segments;
        grouping->objects = objects;
        grouping->along = along;
    }
    create_members(pool, params, grouping, written);
    return written;
}

/* ---- Beginning ---- */

cairn_status cairn_contour_grouping_written_check(const cairn_contour_grouping *grouping,
                                                  const cairn_contour_grouping_input *in)
{
    if (!cairn_is_finite(in->look_ahead))
        return CAIRN_NOT_FINITE;
    if (!(in->look_ahead > 0) || in->end_count < 0 || (in->ends == NULL && in->end_count > 0))
        return CAIRN_BAD_ARGUMENT;
    return in->count > grouping->params.max_tokens ||
                   in->end_count > 2 * grouping->params.max_tokens
               ? CAIRN_FULL
               : CAIRN_OK;
}

/* Computes the mean radius of the path, and the range of radii widened by R_sigma on both sides. */
static void read_model(struct contour_grouping_written *written, const cairn_shape_model *model,
                       cairn_real slack)
{
    const cairn_shape_model_sample *samples = &model->samples[model->paths[0].first];
    cairn_real min_radius = CAIRN_REAL_MAX, max_radius = 0, sum = 0;
    int32_t count = model->paths[0].count;

    for (int32_t k = 0; k < count; k++) {
        min_radius = cairn_min(min_radius, samples[k].radius);
        max_radius = cairn_max(max_radius, samples[k].radius);
        sum += samples[k].radius;
    }
    written->mean_radius = sum / (cairn_real)count;
    written->points.min_radius =
        written->size * cairn_max(min_radius - slack * written->mean_radius, 0);
    written->points.max_radius = written->size * (max_radius + slack * written->mean_radius);
}

void cairn_contour_grouping_written_begin(cairn_contour_grouping *grouping)
{
    struct contour_grouping_written *written = grouping->written;

    written->points = symmetric_point_params(&grouping->params);
    written->size = cairn_sqrt(grouping->input.min_size * grouping->input.max_size);
    read_model(written, grouping->input.model, grouping->params.radius_sigma);
    written->log_stop = cairn_log(grouping->params.stop_likelihood);
    written->stamp = 0;
    written->random = cairn_random_seed(grouping->params.seed, 1);
    written->has_segments = written->is_sampling = written->end_reason = written->start_count =
        written->sampled_count = written->is_recording = 0;
    written->mass_sum = written->passed_mass = 0;
    written->dropped_candidates = 0;
}

/* ---- Points ---- */

cairn_status cairn_contour_grouping_written_points(cairn_contour_grouping *grouping,
                                                   cairn_budget *budget)
{
    struct contour_grouping_written *written = grouping->written;

    if (!written->has_segments) {
        cairn_status status = cairn_symmetric_point_set_radii(
            written->set, written->points.min_radius, written->points.max_radius);

        if (status == CAIRN_OK)
            status = cairn_symmetric_point_begin(written->set, grouping->input.segments,
                                                 grouping->input.count);
        if (status != CAIRN_OK)
            return status;
        written->has_segments = 1;
    }
    return cairn_symmetric_point_step(written->set, budget);
}

static int32_t pair_slot(const struct contour_grouping_written *written, int32_t first,
                         int32_t second)
{
    uint32_t h =
        ((uint32_t)first * UINT32_C(2654435761)) ^ ((uint32_t)second * UINT32_C(2246822519));

    return (int32_t)((h ^ (h >> 15)) & (uint32_t)(written->slot_count - 1));
}

const cairn_symmetric_point *
cairn_contour_grouping_written_point(const cairn_contour_grouping *grouping, int32_t first,
                                     int32_t second)
{
    const struct contour_grouping_written *written = grouping->written;
    const cairn_symmetric_point *points = cairn_symmetric_point_list(written->set, NULL);
    int32_t low = first < second ? first : second, high = first < second ? second : first,
            at = pair_slot(written, low, high);

    for (; written->pair_slots[at] >= 0; at = (at + 1) & (written->slot_count - 1)) {
        const cairn_symmetric_point *point = &points[written->pair_slots[at]];

        if (point->first == low && point->second == high)
            return point;
    }
    return NULL;
}

/* Empties a grid. */
static cairn_status clear_grid(cairn_contour_grouping *grouping, cairn_point_grid *grid,
                               cairn_budget *budget)
{
    while (cairn_point_grid_count(grid) > 0) {
        if (!cairn_budget_charge(budget, &grouping->units_charged, 1))
            return CAIRN_MORE;
        cairn_point_grid_remove_last(grid);
    }
    return CAIRN_OK;
}

/* Fills the hash table and both grids of ends. `cursor` and `second_cursor` count all items. */
cairn_status cairn_contour_grouping_written_index(cairn_contour_grouping *grouping,
                                                  cairn_budget *budget)
{
    struct contour_grouping_written *written = grouping->written;
    int32_t count, slots = written->slot_count, ends = 2 * grouping->input.count;
    const cairn_symmetric_point *points = cairn_symmetric_point_list(written->set, &count);

    for (; grouping->cursor < slots; grouping->cursor++) {
        if (!cairn_budget_charge(budget, &grouping->units_charged, 1))
            return CAIRN_MORE;
        written->pair_slots[grouping->cursor] = -1;
    }
    for (; grouping->cursor < slots + count; grouping->cursor++) {
        const cairn_symmetric_point *point = &points[grouping->cursor - slots];
        int32_t at = pair_slot(written, point->first, point->second);

        if (!cairn_budget_charge(budget, &grouping->units_charged, 2))
            return CAIRN_MORE;
        while (written->pair_slots[at] >= 0)
            at = (at + 1) & (written->slot_count - 1);
        written->pair_slots[at] = grouping->cursor - slots;
    }
    if (grouping->second_cursor == 0) {
        cairn_status status = clear_grid(grouping, written->ends, budget);

        if (status == CAIRN_OK)
            status = clear_grid(grouping, written->chain_ends, budget);
        if (status != CAIRN_OK)
            return status;
    }
    for (; grouping->second_cursor < ends; grouping->second_cursor++) {
        const cairn_segment *s = &grouping->input.segments[grouping->second_cursor / 2];
        cairn_status status;

        if (!cairn_budget_charge(budget, &grouping->units_charged, 1))
            return CAIRN_MORE;
        written->segment_stamp[grouping->second_cursor / 2] = 0;
        status = cairn_point_grid_insert(written->ends, grouping->second_cursor % 2 ? s->b : s->a);
        if (status != CAIRN_OK)
            return status;
    }
    for (; grouping->second_cursor < ends + grouping->input.end_count; grouping->second_cursor++) {
        cairn_status status;

        if (!cairn_budget_charge(budget, &grouping->units_charged, 1))
            return CAIRN_MORE;
        status = cairn_point_grid_insert(written->chain_ends,
                                         grouping->input.ends[grouping->second_cursor - ends]);
        if (status != CAIRN_OK)
            return status;
    }
    return CAIRN_OK;
}

/* ---- Initial particles ---- */

/* Creates one of the four start states of a point: direction of travel times direction of the
 * model's path. Returns the log of its mass. */
static cairn_real make_start(const cairn_contour_grouping *grouping,
                             const cairn_symmetric_point *point, int32_t which,
                             contour_grouping_written_state *state)
{
    const cairn_segment *lines = grouping->input.segments;
    cairn_vec2 forward = cairn_vec2_left_perp(cairn_vec2_sub(point->contact[1], point->contact[0]));
    cairn_real likelihood;
    int32_t is_reversed_travel = which & 1;

    memset(state, 0, sizeof *state);
    if (is_reversed_travel)
        forward = cairn_vec2_scale(forward, -1);
    state->centre = state->start = point->centre;
    state->radius = point->radius;
    state->deviation = point->deviation;
    state->is_reversed = which >> 1;
    /* Forward is to the left (with y down: to the right) of the chord from the first to the second
     * contact point. */
    state->segment[0] = is_reversed_travel ? point->first : point->second;
    state->segment[1] = is_reversed_travel ? point->second : point->first;
    for (int32_t side = 0; side < 2; side++) {
        const cairn_segment *line = &lines[state->segment[side]];

        state->end[side] = 2 * state->segment[side] +
                           (cairn_vec2_dot(forward, cairn_vec2_sub(line->b, line->a)) > 0);
    }
    likelihood = cairn_contour_grouping_written_likelihood(grouping, state, &state->sample);
    state->log_posterior = likelihood - grouping->written->log_stop;
    return likelihood +
           (grouping->params.use_skeleton
                ? cairn_log(cairn_symmetric_point_quality(point, grouping->params.symmetry_sigma))
                : 0);
}

/* Returns 1 when a point lies within L of an end of a strong chain. */
static int is_start_point(const cairn_contour_grouping *grouping,
                          const cairn_symmetric_point *point)
{
    cairn_point_grid_cursor search = cairn_point_grid_begin(
        grouping->written->chain_ends, point->centre, grouping->input.look_ahead);

    return cairn_point_grid_next(grouping->written->chain_ends, &search) >= 0;
}

/* Sums the masses of all start states; then systematic sampling of as many particles, at even steps
 * of the cumulative sum. */
cairn_status cairn_contour_grouping_written_start(cairn_contour_grouping *grouping,
                                                  cairn_budget *budget)
{
    struct contour_grouping_written *written = grouping->written;
    const cairn_symmetric_point *points;
    int32_t count;
    cairn_status status;

    points = cairn_symmetric_point_list(written->set, &count);
    for (; grouping->cursor < STARTS_PER_POINT * count; grouping->cursor++) {
        const cairn_symmetric_point *point = &points[grouping->cursor / STARTS_PER_POINT];
        contour_grouping_written_state state;

        if (!cairn_budget_charge(budget, &grouping->units_charged,
                                 is_start_point(grouping, point)
                                     ? UNITS_PER_START +
                                           cairn_contour_grouping_written_likelihood_units(grouping)
                                     : 1))
            return CAIRN_MORE;
        if (!is_start_point(grouping, point))
            continue;
        written->mass_sum +=
            cairn_exp(make_start(grouping, point, grouping->cursor % STARTS_PER_POINT, &state));
        written->start_count++;
    }
    if (!written->is_sampling) {
        written->is_sampling = 1;
        written->passed_mass = -cairn_random_unit(&written->random) * written->mass_sum /
                               (cairn_real)grouping->params.particles;
        status = cairn_particle_filter_clear(grouping->filter, grouping->params.seed);
        if (status != CAIRN_OK)
            return status;
    }
    for (; grouping->second_cursor < STARTS_PER_POINT * count &&
           written->sampled_count < grouping->params.particles;
         grouping->second_cursor++) {
        const cairn_symmetric_point *point = &points[grouping->second_cursor / STARTS_PER_POINT];
        contour_grouping_written_state state;

        if (!cairn_budget_charge(budget, &grouping->units_charged,
                                 is_start_point(grouping, point)
                                     ? UNITS_PER_START +
                                           cairn_contour_grouping_written_likelihood_units(grouping)
                                     : 1))
            return CAIRN_MORE;
        if (!is_start_point(grouping, point))
            continue;
        written->passed_mass += cairn_exp(
            make_start(grouping, point, grouping->second_cursor % STARTS_PER_POINT, &state));
        while (written->sampled_count < grouping->params.particles &&
               written->passed_mass > written->mass_sum * (cairn_real)written->sampled_count /
                                          (cairn_real)grouping->params.particles) {
            status = cairn_particle_filter_start(grouping->filter, &state, 0);
            if (status != CAIRN_OK)
                return status;
            written->sampled_count++;
        }
    }
    grouping->generated_count = written->start_count;
    grouping->has_particles = written->sampled_count > 0;
    return written->sampled_count > 0 ? cairn_particle_filter_begin(grouping->filter) : CAIRN_OK;
}

/* ---- Filter ---- */

static cairn_real greatest_posterior(const cairn_contour_grouping *grouping)
{
    cairn_real greatest = -CAIRN_REAL_MAX;

    for (int32_t i = 0; i < cairn_particle_filter_count(grouping->filter); i++) {
        const contour_grouping_written_state *s =
            cairn_particle_filter_particle(grouping->filter, i).state;

        greatest = cairn_max(greatest, s->log_posterior);
    }
    return greatest;
}

/* Records the diagnostics of a filter step. Returns 0 when no particle has a successor; the
 * particles are then unchanged. */
static int record_step(cairn_contour_grouping *grouping)
{
    cairn_particle_filter_trace t = cairn_particle_filter_read(grouping->filter);
    cairn_contour_grouping_trace *trace = &grouping->trace[grouping->step_count];

    if (t.depleted)
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

/* Termination reason after a step (CAIRN_CONTOUR_GROUPING_...); 0: the filter continues. */
static int32_t end_reason(const cairn_contour_grouping *grouping)
{
    if (greatest_posterior(grouping) < 0)
        return CAIRN_CONTOUR_GROUPING_POSTERIOR;
    return grouping->step_count + 1 >= grouping->params.max_steps ? CAIRN_CONTOUR_GROUPING_STEPS
                                                                  : 0;
}

cairn_status cairn_contour_grouping_written_run_filter(cairn_contour_grouping *grouping,
                                                       cairn_budget *budget)
{
    struct contour_grouping_written *written = grouping->written;

    while (written->sampled_count > 0) {
        cairn_status status;

        if (!written->is_recording) {
            status = cairn_particle_filter_step(grouping->filter, budget);
            if (status == CAIRN_FULL)
                written->end_reason = CAIRN_CONTOUR_GROUPING_HISTORIES;
            else if (status == CAIRN_OK && !record_step(grouping))
                written->end_reason = CAIRN_CONTOUR_GROUPING_NO_FOLLOWER;
            if (written->end_reason != 0)
                return CAIRN_OK;
            if (status != CAIRN_OK)
                return status;
            written->is_recording = 1;
            grouping->cursor = 0;
        }
        for (; grouping->cursor < cairn_particle_filter_count(grouping->filter);
             grouping->cursor++) {
            int32_t units = UNITS_PER_RECORD +
                            grouping->step_count * (1 + grouping->object_count / OBJECTS_PER_UNIT);

            if (!cairn_budget_charge(budget, &grouping->units_charged, units))
                return CAIRN_MORE;
            cairn_contour_grouping_written_record(grouping, grouping->cursor);
        }
        written->is_recording = 0;
        written->end_reason = end_reason(grouping);
        if (written->end_reason != 0)
            return CAIRN_OK;
        status = cairn_particle_filter_begin(grouping->filter);
        if (status != CAIRN_OK)
            return status;
    }
    return CAIRN_OK;
}

void cairn_contour_grouping_written_read(const cairn_contour_grouping *grouping,
                                         cairn_contour_grouping_result *result)
{
    const struct contour_grouping_written *written = grouping->written;

    (void)cairn_symmetric_point_list(written->set, &result->point_count);
    result->points_dropped = cairn_symmetric_point_dropped(written->set);
    result->candidates_dropped = written->dropped_candidates;
    result->token_count = grouping->input.count;
    result->end_reason = written->end_reason;
}
