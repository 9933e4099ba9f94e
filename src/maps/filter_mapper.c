/* Parameters and memory of the particle-filter mapper, and its processing scan by scan.
 *
 * Method.
 *
 * 1. A front-end mapper turns scans into keyframes and motions between them: scan matching gives a
 *    better odometry (Haehnel et al. 2003).
 * 2. Every keyframe is a step of the particle filter. The proposal of a particle is in
 *    filter_mapper_propose.c.
 * 3. The paths of particles that have closed a loop are corrected (filter_mapper_correct.c).
 * 4. The result is the particle of the largest likelihood along its own path.
 *
 * Layout: a particle's map consists of keyframes only. The points of a keyframe are stored once, in
 * the front-end mapper. A particle adds one pose per keyframe to the filter's tree of histories, in
 * which particles share common ancestors. So resampling copies nothing, a keyframe costs at most
 * one node per particle, and the pool is sized in advance. Occupancy grids, even with shared tiles,
 * would need an unknown amount of memory for their differences and would be rewritten for every
 * candidate.
 *
 * Limits: the errors of motions count as independent and Gaussian. A step is linear in the length
 * of the path. A loop that no particle closes stays open.
 *
 * Source: Murphy 1999; Grisetti, Stachniss and Burgard 2007 (improved proposals); Haehnel, Burgard,
 * Fox and Thrun 2003; the filter is that of Adluru 2008, sections 2.3 and 9.2.2, the shape prior its
 * section 6.6. */
#include "src/base/build.h"

#include <string.h>

#include "src/base/step.h"
#include "src/maps/filter_mapper_work.h"

enum { MAX_PARTICLES = 4096, MAX_NODES = 1 << 28, MAX_LOCAL_POINTS = 1 << 20 };

#define INTEGER(field, is, from, to) CAIRN_INTEGER(cairn_filter_mapper_params, field, is, from, to)

#define NUMBER(field, is, from, to)                                                                \
    CAIRN_NUMBER(cairn_filter_mapper_params, field, CAIRN_REAL(is), CAIRN_REAL(from),              \
                 CAIRN_REAL(to))

/* Default, lowest and highest value. The limits of lengths and angles keep the squares, and the
 * determinants of covariances, within the range of float. */
static const cairn_parameter rows[] = {
    INTEGER(particles, 30, 1, MAX_PARTICLES),
    INTEGER(candidates, 6, FILTER_MAPPER_MAX_MODES, CAIRN_FILTER_MAPPER_MAX_CANDIDATES),
    INTEGER(scored_points, 60, 1, INT32_MAX),
    INTEGER(local_keyframes, 10, 1, CAIRN_FILTER_MAPPER_MAX_LOCAL_KEYFRAMES),
    INTEGER(max_local_points, 2048, 1, MAX_LOCAL_POINTS),
    INTEGER(recent_keyframes, 25, 1, INT32_MAX),
    NUMBER(local_radius, 4.0, 1e-3, 1000.0),
    NUMBER(motion_distance, 0.02, 0.0, 10.0),
    NUMBER(motion_turn, 0.02, 0.0, 10.0),
    NUMBER(motion_distance_min, 0.01, 1e-4, 100.0),
    NUMBER(motion_turn_min, 0.004, 1e-5, 3.0),
    NUMBER(match_sigma, 0.0025, 1e-4, 100.0),
    NUMBER(match_sigma_theta, 0.001, 1e-5, 3.0),
    NUMBER(min_overlap, 0.3, 0.0, 1.0),
    NUMBER(sigma, 0.07, 1e-3, 100.0),
    NUMBER(max_point_cost, 3.0, 1e-3, 1000.0),
    NUMBER(independent_points, 8.0, 1e-3, 1e6),
    INTEGER(shape_prior, 0, 0, 1),
};
const cairn_parameters cairn_filter_mapper_parameters =
    CAIRN_PARAMETERS("filter_mapper", cairn_filter_mapper_params, rows);

cairn_filter_mapper_params cairn_filter_mapper_default(void)
{
    cairn_filter_mapper_params params;

    cairn_parameters_preset(&cairn_filter_mapper_parameters, &params);
    params.front = cairn_mapper_default();
    params.seed = 1;
    return params;
}

cairn_filter_mapper_params cairn_filter_mapper_default_for(int32_t max_keyframes, int32_t max_beams,
                                                           int32_t particles)
{
    cairn_filter_mapper_params params = cairn_filter_mapper_default();

    params.front = cairn_mapper_default_for(max_keyframes, max_beams);
    params.particles = particles;
    return params;
}

/* ---- Parameters of the modules ---- */

static cairn_mapper_params front_params(const cairn_filter_mapper_params *params)
{
    cairn_mapper_params front = params->front;

    front.window = 0;
    front.loop.max_loops = 0;
    return front;
}

static cairn_icp_params icp_params(const cairn_filter_mapper_params *params)
{
    cairn_icp_params icp = params->front.icp;

    icp.max_target = params->max_local_points;
    return icp;
}

static cairn_scan_match_params shape_params(const cairn_filter_mapper_params *params)
{
    cairn_scan_match_params shape = cairn_scan_match_default();

    shape.mode = CAIRN_SCAN_MATCH_SHAPE;
    shape.max_target = shape.max_query = params->front.scan.max_points;
    shape.max_dense = shape.max_views = 0;
    shape.max_hypotheses = 1;
    shape.spacing = params->front.scan.spacing;
    return shape;
}

static cairn_point_grid_params grid_params(const cairn_filter_mapper_params *params)
{
    cairn_point_grid_params grid = {
        .max_points = params->max_local_points,
        .cell_size = 2 * params->sigma,
    };

    return grid;
}

/* Returns the filter's params: one follower per particle, nodes for all particles in all steps. */
static cairn_particle_filter_params filter_params(const cairn_filter_mapper_params *params)
{
    cairn_particle_filter_params filter = cairn_particle_filter_default();

    filter.particles = filter.max_particles = params->particles;
    filter.max_followers = 1;
    filter.max_candidates = params->particles * params->candidates;
    filter.max_blocks = params->particles * params->front.max_keyframes;
    filter.state_bytes = (int32_t)sizeof(filter_mapper_path_state);
    filter.adaptive_followers = 0;
    return filter;
}

cairn_status cairn_filter_mapper_check(const cairn_filter_mapper_params *params,
                                       cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_filter_mapper_parameters, params, fault);
    cairn_mapper_params front;
    cairn_icp_params icp;
    cairn_point_grid_params grid;
    cairn_particle_filter_params filter;
    cairn_scan_match_params shape;

    if (status == CAIRN_OK)
        status = cairn_parameters_require(
            params->front.max_keyframes <= MAX_NODES / params->particles, "filter_mapper",
            "front.max_keyframes: at most 2^28 / particles", fault);
    if (status != CAIRN_OK)
        return status;
    front = front_params(params);
    icp = icp_params(params);
    grid = grid_params(params);
    filter = filter_params(params);
    status = cairn_mapper_check(&front, fault);
    if (status == CAIRN_OK)
        status = cairn_icp_check(&icp, fault);
    if (status == CAIRN_OK && params->shape_prior) {
        shape = shape_params(params);
        status = cairn_scan_match_check(&shape, fault);
    }
    if (status == CAIRN_OK)
        status = cairn_point_grid_check(&grid, fault);
    if (status == CAIRN_OK)
        status = cairn_particle_filter_check(&filter, fault);
    return status;
}

/* ---- Memory ---- */

/* The object and its arrays; NULL from a counting pool. */
static cairn_filter_mapper *build(cairn_pool *pool, const cairn_filter_mapper_params *params)
{
    cairn_mapper_params front = front_params(params);
    cairn_icp_params icp = icp_params(params);
    cairn_point_grid_params grid = grid_params(params);
    cairn_particle_filter_params filter = filter_params(params);
    cairn_scan_match_params shape = shape_params(params);
    cairn_filter_mapper *mapper = cairn_object_take(pool, sizeof *mapper);
    cairn_particle_filter_model model = cairn_filter_mapper_model(mapper);

    CAIRN_TAKE(mapper, pool, points, params->front.scan.max_points);
    CAIRN_TAKE(mapper, pool, proposal.map.direction, params->max_local_points);
    if (mapper != NULL) {
        mapper->params = *params;
        mapper->random = cairn_random_seed(params->seed, 1);
    }
    CAIRN_TAKE_OBJECT(mapper, pool, front, mapper, &front);
    CAIRN_TAKE_OBJECT(mapper, pool, icp, icp, &icp);
    CAIRN_TAKE_OBJECT(mapper, pool, proposal.map.points, point_grid, &grid);
    if (params->shape_prior)
        CAIRN_TAKE_OBJECT(mapper, pool, shape, scan_match, &shape);
    CAIRN_TAKE_BY(mapper,
                  cairn_particle_filter_create(CAIRN_FIELD(mapper, filter), pool, &filter, &model));
    if (mapper != NULL)
        cairn_must_be_ok(cairn_particle_filter_clear(mapper->filter, params->seed));
    return mapper;
}

CAIRN_OBJECT(filter_mapper, filter_mapper, build);

/* ---- Scan by scan ---- */

cairn_status cairn_filter_mapper_add(cairn_filter_mapper *mapper, const cairn_scan_input *input,
                                     const cairn_pose *odometry, cairn_fault *fault)
{
    cairn_status status;

    if (mapper == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (mapper->is_pending)
        return cairn_refuse(fault, -1, "the previous scan is still being processed: step first",
                            CAIRN_BUSY);
    status = cairn_mapper_add(mapper->front, input, odometry, fault);
    mapper->is_pending = status == CAIRN_MORE;
    mapper->resume = 0;
    return status;
}

cairn_status cairn_filter_mapper_map(cairn_filter_mapper *mapper, const cairn_scan_input *input,
                                     const cairn_pose *odometry, cairn_fault *fault)
{
    cairn_status status = cairn_filter_mapper_add(mapper, input, odometry, fault);

    while (status == CAIRN_MORE) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        status = cairn_filter_mapper_step(mapper, &budget);
    }
    return status;
}

/* Adds the first keyframe, at which all paths begin. */
static cairn_status start_paths(cairn_filter_mapper *mapper)
{
    filter_mapper_path_state first = {
        .map_keyframe = cairn_mapper_keyframe_pose(mapper->front, 0),
        .drift = cairn_sym3_zero(),
        .log_weight = 0,
        .keyframe = 0,
        .revisited = -1,
    };
    cairn_status status = CAIRN_OK;

    for (int32_t i = 0; i < mapper->params.particles && status == CAIRN_OK; i++)
        status = cairn_particle_filter_start(mapper->filter, &first, 0);
    mapper->keyframe_count = 1;
    return status;
}

/* Sets the motion to the current keyframe and its covariance: that of the front-end match, and the
 * noise of the motion. */
static void find_motion(cairn_filter_mapper *mapper, const cairn_mapper_result *result)
{
    const cairn_filter_mapper_params *p = &mapper->params;
    cairn_pose motion = cairn_pose_between(
        cairn_mapper_keyframe_pose(mapper->front, result->keyframe - 1), result->map_scan);
    cairn_real way = cairn_sqrt(motion.x * motion.x + motion.y * motion.y),
               turn = cairn_abs(motion.theta);
    cairn_real sigma_distance = p->motion_distance_min + p->motion_distance * way,
               sigma_theta = p->motion_turn_min + p->motion_turn * turn;

    if (result->verdict != CAIRN_MAPPER_MATCHED) {
        sigma_distance += p->front.motion_distance_min + p->front.motion_distance * way;
        sigma_theta += p->front.motion_turn_min + p->front.motion_turn * turn;
    }
    mapper->motion = motion;
    mapper->motion_covariance =
        cairn_sym3_rotate_by(cairn_sym3_of_full(result->covariance), -result->map_scan.theta);
    mapper->motion_covariance.xx += sigma_distance * sigma_distance;
    mapper->motion_covariance.yy += sigma_distance * sigma_distance;
    mapper->motion_covariance.zz += sigma_theta * sigma_theta;
}

/* Starts a step of the filter when the scan is a keyframe. Returns 1 when there is a step. */
static int begin_filter(cairn_filter_mapper *mapper)
{
    cairn_mapper_result result = cairn_mapper_read(mapper->front);

    if (!result.is_keyframe)
        return 0;
    if (result.keyframe == 0) {
        mapper->status = start_paths(mapper);
        return 0;
    }
    find_motion(mapper, &result);
    mapper->shape_count = 0;
    mapper->status = cairn_particle_filter_begin(mapper->filter);
    return mapper->status == CAIRN_OK;
}

/* The scan: a motion by the front-end mapper, and a step of the filter at a keyframe. Returns 1 when
 * it is processed, or `status` is an error. */
static int process(cairn_filter_mapper *mapper, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(mapper->resume);
    CAIRN_STEP_UNTIL(mapper->resume,
                     (mapper->status = cairn_mapper_step(mapper->front, budget)) != CAIRN_MORE);
    if (mapper->status == CAIRN_OK && begin_filter(mapper)) {
        CAIRN_STEP_UNTIL(mapper->resume, (mapper->status = cairn_particle_filter_step(
                                              mapper->filter, budget)) != CAIRN_MORE);
        /* A candidate of the motion is possible at every keyframe. */
        CAIRN_ASSERT(mapper->status == CAIRN_OK &&
                     !cairn_particle_filter_read(mapper->filter).depleted);
        mapper->keyframe_count++;
        mapper->correction.resume = 0;
        CAIRN_STEP_RUN(mapper, resume, budget, cairn_filter_mapper_correct);
    }
    CAIRN_STEP_END(mapper->resume);
}

cairn_status cairn_filter_mapper_step(cairn_filter_mapper *mapper, cairn_budget *budget)
{
    int32_t before;

    if (mapper == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!mapper->is_pending)
        return CAIRN_OK;
    before = budget->left;
    mapper->is_pending = !process(mapper, budget);
    mapper->units += (int64_t)before - budget->left;
    return mapper->is_pending ? CAIRN_MORE : mapper->status;
}

/* ---- Readers ---- */

const cairn_mapper *cairn_filter_mapper_front(const cairn_filter_mapper *mapper)
{
    return mapper->front;
}

int32_t cairn_filter_mapper_count(const cairn_filter_mapper *mapper)
{
    return cairn_particle_filter_count(mapper->filter);
}

int32_t cairn_filter_mapper_best(const cairn_filter_mapper *mapper)
{
    int32_t count = cairn_particle_filter_count(mapper->filter), best = -1;
    cairn_real most = 0;

    for (int32_t i = 0; i < count; i++) {
        cairn_real value = cairn_particle_filter_particle(mapper->filter, i).log_likelihood;

        if (best < 0 || value > most) {
            best = i;
            most = value;
        }
    }
    return best;
}

cairn_pose cairn_filter_mapper_last(const cairn_filter_mapper *mapper, int32_t particle)
{
    const filter_mapper_path_state *state =
        cairn_particle_filter_particle(mapper->filter, particle).state;

    return state == NULL ? cairn_pose_identity() : state->map_keyframe;
}

int32_t cairn_filter_mapper_path(const cairn_filter_mapper *mapper, int32_t particle,
                                 cairn_pose *poses, int32_t capacity)
{
    const filter_mapper_path_state *state =
        cairn_particle_filter_particle(mapper->filter, particle).state;
    int32_t count = 0;

    for (; state != NULL; state = cairn_particle_filter_state_before(state)) {
        if (state->keyframe >= capacity)
            continue;
        poses[state->keyframe] = state->map_keyframe;
        count++;
    }
    return count;
}

cairn_filter_mapper_state cairn_filter_mapper_measure(const cairn_filter_mapper *mapper)
{
    cairn_particle_filter_trace trace = cairn_particle_filter_read(mapper->filter);
    cairn_filter_mapper_state state;

    memset(&state, 0, sizeof state);
    state.keyframes = mapper->keyframe_count;
    state.resamplings = trace.resamplings;
    state.n_eff = trace.n_eff;
    state.revisit_matches = mapper->revisit_matches;
    state.shape_matches = mapper->shape_matches;
    state.shape_starts = mapper->shape_starts;
    state.nodes = trace.blocks;
    state.nodes_peak = trace.blocks_peak;
    state.units = mapper->units;
    return state;
}
