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
/* particles whose posteriors are compared */
enum { PARTICLES_PER_UNIT = 8 };

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
    settings.proposal = contour_grouping_written_is(params, CAIRN_CONTOUR_GROUPING_WRITTEN_LETTER)
                            ? CAIRN_PARTICLE_FILTER_PROPOSAL_PRIOR
                            : CAIRN_PARTICLE_FILTER_PROPOSAL_BOOSTED;
    settings.max_followers = MAX_FOLLOWERS;
    settings.max_candidates = params->particles * CONTOUR_GROUPING_WRITTEN_CANDIDATES_PER_PARTICLE;
    settings.max_history = 0;
    settings.max_blocks = BLOCKS_PER_PARTICLE * params->particles + params->max_steps;
    settings.state_bytes = (int32_t)sizeof(contour_grouping_written_state);
    return settings;
}

/* ---- Memory ---- */

void cairn_contour_grouping_take_written(cairn_contour_grouping *grouping, cairn_pool *pool,
                                         const cairn_contour_grouping_params *params)
{
    cairn_symmetric_point_params points = symmetric_point_params(params);
    cairn_point_grid_params ends = {.max_points = 2 * params->max_tokens,
                                    .cell_size = END_GRID_CELL_PX};
    cairn_particle_filter_params filter = filter_params(params);
    cairn_particle_filter_model model = cairn_contour_grouping_written_model(grouping);
    size_t steps = (size_t)params->max_steps, objects = (size_t)params->max_objects;
    struct contour_grouping_written *written = cairn_object_take(pool, sizeof *written);

    CAIRN_TAKE(written, pool, pair_slots, slot_count_of(params->max_points));
    CAIRN_TAKE(written, pool, segment_stamp, params->max_tokens);
    CAIRN_TAKE(written, pool, trajectories, objects * steps);
    CAIRN_TAKE(written, pool, history, steps);
    CAIRN_TAKE(written, pool, side[0].vertex, 4 * steps);
    CAIRN_TAKE(written, pool, polygon, 4 * steps);
    CAIRN_TAKE(grouping, pool, trace, steps);
    CAIRN_TAKE(written, pool, trajectory_slot, objects);
    CAIRN_TAKE(grouping, pool, segments, 2 * objects * steps);
    CAIRN_TAKE(grouping, pool, objects, objects);
    CAIRN_TAKE(grouping, pool, along, objects * (size_t)params->max_outline);
    CAIRN_TAKE_OBJECT(written, pool, set, symmetric_point, &points);
    CAIRN_TAKE_OBJECT(written, pool, ends, point_grid, &ends);
    CAIRN_TAKE_OBJECT(written, pool, chain_ends, point_grid, &ends);
    CAIRN_TAKE_BY(grouping, cairn_particle_filter_create(CAIRN_FIELD(grouping, filter), pool,
                                                         &filter, &model));
    if (written != NULL) {
        memset(written->segment_stamp, 0,
               (size_t)params->max_tokens * sizeof *written->segment_stamp);
        written->slot_count = slot_count_of(params->max_points);
        written->side[1].vertex = written->side[0].vertex + 2 * steps;
        grouping->written = written;
    }
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
    written->end_reason = written->start_count = written->sampled_count = 0;
    written->mass_sum = written->passed_mass = 0;
    written->dropped_candidates = 0;
}

/* Begins the search of the symmetric points. */
static cairn_status begin_points(cairn_contour_grouping *grouping)
{
    struct contour_grouping_written *written = grouping->written;
    cairn_status status = cairn_symmetric_point_set_radii(written->set, written->points.min_radius,
                                                          written->points.max_radius);

    if (status == CAIRN_OK)
        status = cairn_symmetric_point_begin(written->set, grouping->input.segments,
                                             grouping->input.count);
    return status;
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
           cairn_log(cairn_symmetric_point_quality(point, grouping->params.symmetry_sigma));
}

/* Returns 1 when a point lies within L of an end of a strong chain. */
static int is_start_point(const cairn_contour_grouping *grouping,
                          const cairn_symmetric_point *point)
{
    cairn_point_grid_cursor search = cairn_point_grid_begin(
        grouping->written->chain_ends, point->centre, grouping->input.look_ahead);

    return cairn_point_grid_next(grouping->written->chain_ends, &search) >= 0;
}

/* Symmetric point of the start state at `cursor`. */
static const cairn_symmetric_point *start_point(const cairn_contour_grouping *grouping)
{
    return &cairn_symmetric_point_list(grouping->written->set,
                                       NULL)[grouping->written->cursor / STARTS_PER_POINT];
}

static int32_t start_count(const cairn_contour_grouping *grouping)
{
    int32_t points;

    (void)cairn_symmetric_point_list(grouping->written->set, &points);
    return STARTS_PER_POINT * points;
}

/* Cost of a start state in units. */
static int32_t start_cost(const cairn_contour_grouping *grouping)
{
    return is_start_point(grouping, start_point(grouping))
               ? UNITS_PER_START + cairn_contour_grouping_written_likelihood_units(grouping)
               : 1;
}

/* Adds the mass of the start state at `cursor`, if it has one. */
static void add_start(cairn_contour_grouping *grouping)
{
    struct contour_grouping_written *written = grouping->written;
    contour_grouping_written_state state;

    if (!is_start_point(grouping, start_point(grouping)))
        return;
    written->mass_sum += cairn_exp(
        make_start(grouping, start_point(grouping), written->cursor % STARTS_PER_POINT, &state));
    written->start_count++;
}

/* Begins the systematic sampling, at even steps of the cumulative sum of the masses. */
static cairn_status begin_sampling(cairn_contour_grouping *grouping)
{
    struct contour_grouping_written *written = grouping->written;

    written->passed_mass = -cairn_random_unit(&written->random) * written->mass_sum /
                           (cairn_real)grouping->params.particles;
    return cairn_particle_filter_clear(grouping->filter, grouping->params.seed);
}

/* Samples the start state at `cursor`: as many particles as there are steps within its mass. */
static cairn_status sample_start(cairn_contour_grouping *grouping)
{
    struct contour_grouping_written *written = grouping->written;
    cairn_real particles = (cairn_real)grouping->params.particles;
    contour_grouping_written_state state;
    cairn_status status = CAIRN_OK;

    if (!is_start_point(grouping, start_point(grouping)))
        return CAIRN_OK;
    written->passed_mass += cairn_exp(
        make_start(grouping, start_point(grouping), written->cursor % STARTS_PER_POINT, &state));
    while (status == CAIRN_OK && written->sampled_count < grouping->params.particles &&
           written->passed_mass >
               written->mass_sum * (cairn_real)written->sampled_count / particles) {
        status = cairn_particle_filter_start(grouping->filter, &state, 0);
        written->sampled_count += status == CAIRN_OK;
    }
    return status;
}

/* Sums the masses of all start states; then samples as many particles. */
static int make_particles(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    struct contour_grouping_written *written = grouping->written;

    CAIRN_STEP_BEGIN(grouping->phase_resume);
    for (written->cursor = 0; written->cursor < start_count(grouping); written->cursor++) {
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, start_cost(grouping));
        add_start(grouping);
    }
    grouping->status = begin_sampling(grouping);
    CAIRN_STEP_UNTIL(grouping->phase_resume, grouping->status == CAIRN_OK);
    for (written->cursor = 0; written->cursor < start_count(grouping) &&
                              written->sampled_count < grouping->params.particles;
         written->cursor++) {
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget, start_cost(grouping));
        grouping->status = sample_start(grouping);
        CAIRN_STEP_UNTIL(grouping->phase_resume, grouping->status == CAIRN_OK);
    }
    grouping->found.generated_count = written->start_count;
    grouping->has_particles = written->sampled_count > 0;
    CAIRN_STEP_END(grouping->phase_resume);
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
    cairn_contour_grouping_trace *trace = &grouping->trace[grouping->found.step_count];

    if (t.depleted)
        return 0;
    grouping->found.step_count++;
    trace->n_eff = t.n_eff;
    trace->log_likelihood =
        greatest_posterior(grouping) / (cairn_real)(grouping->found.step_count + 1) +
        grouping->written->log_stop;
    trace->followers = t.followers;
    trace->resampled = t.resampled;
    trace->particles = t.particles;
    return 1;
}

/* Works on a step of the filter. 1: it is complete, or end_reason says why there is none. */
static int step_filter(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    struct contour_grouping_written *written = grouping->written;

    grouping->status = cairn_particle_filter_step(grouping->filter, budget);
    if (grouping->status == CAIRN_FULL) {
        grouping->status = CAIRN_OK;
        written->end_reason = CAIRN_CONTOUR_GROUPING_HISTORIES;
    } else if (grouping->status == CAIRN_OK && !record_step(grouping)) {
        written->end_reason = CAIRN_CONTOUR_GROUPING_NO_FOLLOWER;
    }
    return grouping->status == CAIRN_OK;
}

/* Termination reason after a step (CAIRN_CONTOUR_GROUPING_...); 0: the filter continues. */
static int32_t end_reason(const cairn_contour_grouping *grouping)
{
    if (greatest_posterior(grouping) < 0)
        return CAIRN_CONTOUR_GROUPING_POSTERIOR;
    return grouping->found.step_count + 1 >= grouping->params.max_steps
               ? CAIRN_CONTOUR_GROUPING_STEPS
               : 0;
}

/* Cost of recording a particle in units. */
static int32_t record_cost(const cairn_contour_grouping *grouping)
{
    return UNITS_PER_RECORD +
           grouping->found.step_count * (1 + grouping->found.object_count / OBJECTS_PER_UNIT);
}

/* Filter steps; after each of them the best trajectories are recorded. */
static int run_filter(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    struct contour_grouping_written *written = grouping->written;

    CAIRN_STEP_BEGIN(grouping->phase_resume);
    while (written->sampled_count > 0 && written->end_reason == 0) {
        grouping->status = cairn_particle_filter_begin(grouping->filter);
        CAIRN_STEP_UNTIL(grouping->phase_resume, grouping->status == CAIRN_OK);
        CAIRN_STEP_CHARGE(grouping, phase_resume, budget,
                          1 + 2 * grouping->params.particles / PARTICLES_PER_UNIT);
        CAIRN_STEP_RUN(grouping, phase_resume, budget, step_filter);
        if (written->end_reason != 0)
            break;
        for (written->cursor = 0; written->cursor < cairn_particle_filter_count(grouping->filter);
             written->cursor++) {
            CAIRN_STEP_CHARGE(grouping, phase_resume, budget, record_cost(grouping));
            cairn_contour_grouping_written_record(grouping, written->cursor);
        }
        written->end_reason = end_reason(grouping);
    }
    CAIRN_STEP_END(grouping->phase_resume);
}

int cairn_contour_grouping_search_written(cairn_contour_grouping *grouping, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(grouping->resume);
    grouping->status = begin_points(grouping);
    CAIRN_STEP_UNTIL(grouping->resume, grouping->status == CAIRN_OK);
    CAIRN_STEP_UNTIL(grouping->resume, (grouping->status = cairn_symmetric_point_step(
                                            grouping->written->set, budget)) == CAIRN_OK);
    CAIRN_STEP_RUN(grouping, resume, budget, cairn_contour_grouping_written_index);
    CAIRN_STEP_RUN(grouping, resume, budget, make_particles);
    CAIRN_STEP_RUN(grouping, resume, budget, run_filter);
    CAIRN_STEP_RUN(grouping, resume, budget, cairn_contour_grouping_written_finish);
    CAIRN_STEP_END(grouping->resume);
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
