/* Parameters of the mapper and of the modules that it uses, their validation, and memory.
 *
 * Layout: one-time buffers (current scan, local map, search, window of the force field) grow with
 * the capacities of scan and local map. Keyframes, links and the factor of the graph grow with
 * max_keyframes, max_loops and max_fill. One scan_match object serves both relocalization and loop
 * closure. */
#include "src/base/build.h"

#include <string.h>

#include "src/maps/mapper_work.h"

enum { MAX_KEYFRAMES = 1 << 20, MAX_CAPACITY = 1 << 24, MAX_LOOPS = 1 << 22, MAX_FILL = 1 << 26 };

cairn_mapper_params cairn_mapper_default(void)
{
    cairn_mapper_params params;

    memset(&params, 0, sizeof params);
    params.scan = cairn_scan_default();
    params.scan.max_points = 1024;
    params.icp = cairn_icp_default();
    params.icp.weak_ratio = CAIRN_REAL(0.03);
    params.icp.max_iterations = 25;
    params.field = cairn_force_field_default();
    params.field.sigma_start = CAIRN_REAL(0.04);
    params.field.sigma_end = CAIRN_REAL(0.02);
    params.field.dt_start = CAIRN_REAL(0.01);
    params.field.dt_end = CAIRN_REAL(0.005);
    params.field.roi = CAIRN_FORCE_FIELD_ROI_NONE;
    params.field.max_steps = 10;
    params.loop.max_loops = 4096;
    params.loop.max_fill = 32768;
    params.loop.units_per_scan = 8000;
    params.loop.target_keyframes = 9;
    params.loop.min_keyframe_gap = 25;
    params.loop.min_consistent = 3;
    params.loop.candidate_radius = 3;
    params.loop.search_radius = 4;
    params.loop.local_search_radius = CAIRN_REAL(0.6);
    params.loop.min_log_odds = 2;
    params.loop.max_free_space_violation = CAIRN_REAL(0.1);
    params.loop.sigma = CAIRN_REAL(0.01);
    params.loop.sigma_theta = CAIRN_REAL(0.004);
    params.loop.max_chi2 = 50;
    params.max_keyframes = 1024;
    params.max_keyframe_segments = 32768;
    params.max_keyframe_points = 131072;
    params.max_local_points = 4096;
    params.local_keyframes = 15;
    params.local_recent = 3;
    params.local_span = 25;
    params.local_radius = 4;
    params.keyframe_distance = CAIRN_REAL(0.5);
    params.keyframe_angle = CAIRN_REAL(0.5);
    params.keyframe_min_overlap = CAIRN_REAL(0.6);
    params.window = 8;
    params.window_free = 3;
    params.window_units = 32000;
    params.odometry_distance = CAIRN_REAL(0.3);
    params.odometry_turn = CAIRN_REAL(0.3);
    params.odometry_distance_min = CAIRN_REAL(0.01);
    params.odometry_turn_min = CAIRN_REAL(0.005);
    params.motion_distance = CAIRN_REAL(0.3);
    params.motion_turn = CAIRN_REAL(0.3);
    params.motion_distance_min = CAIRN_REAL(0.03);
    params.motion_turn_min = CAIRN_REAL(0.02);
    params.min_overlap = CAIRN_REAL(0.3);
    params.search = 1;
    params.search_units = 155000;
    return params;
}

static int32_t in_proportion(int32_t count, int32_t each, int32_t rest, int32_t most)
{
    int64_t all = (int64_t)count * each + rest;

    return all < most ? (int32_t)all : most;
}

cairn_mapper_params cairn_mapper_default_for(int32_t max_keyframes, int32_t max_beams)
{
    cairn_mapper_params params = cairn_mapper_default();

    params.scan.max_beams = max_beams;
    params.max_keyframes = max_keyframes;
    params.max_keyframe_points =
        in_proportion(max_keyframes, 160, params.scan.max_points, MAX_CAPACITY);
    params.max_keyframe_segments =
        in_proportion(max_keyframes, 40, params.scan.max_segments, MAX_CAPACITY);
    params.loop.max_loops = in_proportion(max_keyframes, 4, 0, MAX_LOOPS);
    params.loop.max_fill = in_proportion(max_keyframes, 40, 0, MAX_FILL);
    return params;
}

int32_t cairn_mapper_protected_count(const cairn_mapper_params *params)
{
    int32_t kept = params->local_span > params->window ? params->local_span : params->window;
    int32_t of_loops =
        params->loop.min_keyframe_gap + (params->window > 0 ? params->window_free : 0);

    return kept > of_loops ? kept : of_loops;
}

int32_t cairn_mapper_local_points(const cairn_mapper_params *params, int32_t count)
{
    int64_t most = (int64_t)count * params->scan.max_points;
    int32_t capacity = params->max_local_points;

    if (capacity < params->scan.max_points)
        capacity = params->scan.max_points;
    return most < capacity ? (int32_t)most : capacity;
}

/* Returns the modules' params with the capacities that the mapper needs. */
static cairn_icp_params icp_params(const cairn_mapper_params *params)
{
    cairn_icp_params icp = params->icp;

    icp.max_target = cairn_mapper_local_points(params, params->local_keyframes);
    return icp;
}

static cairn_force_field_params field_params(const cairn_mapper_params *params)
{
    cairn_force_field_params field = params->field;

    field.max_scans = params->window;
    field.max_segments = params->window * params->scan.max_segments;
    field.max_points = cairn_mapper_local_points(params, params->window);
    return field;
}

static cairn_scan_set_params keyframe_params(const cairn_mapper_params *params)
{
    cairn_scan_set_params keyframes = {
        .max_scans = params->max_keyframes,
        .max_segments = params->max_keyframe_segments,
        .max_points = params->max_keyframe_points,
        .spacing = 0,
    };

    return keyframes;
}

static int32_t has_loops(const cairn_mapper_params *params)
{
    return params->loop.max_loops > 0;
}

static int32_t has_match(const cairn_mapper_params *params)
{
    return params->search || has_loops(params);
}

/* Returns the params of the match object for relocalization and loop closure. */
static cairn_scan_match_params match_params(const cairn_mapper_params *params)
{
    cairn_scan_match_params match = cairn_scan_match_default();
    int32_t keyframes = params->search ? MAPPER_SEARCH_KEYFRAMES : 1;
    cairn_real half = MAPPER_WIDE_SEARCH_M;

    if (has_loops(params) && params->loop.target_keyframes > keyframes)
        keyframes = params->loop.target_keyframes;
    if (has_loops(params))
        half = cairn_max(half, params->loop.search_radius);
    match.max_target = cairn_mapper_local_points(params, keyframes);
    match.max_dense = 0;
    match.max_candidates = MAPPER_SEARCH_CANDIDATES;
    match.max_views = keyframes;
    match.max_query = params->scan.max_points;
    match.spacing = params->scan.spacing;
    match.max_cells = cairn_scan_match_cells(half, match.spacing);
    return match;
}

static cairn_pose_graph_params graph_params(const cairn_mapper_params *params)
{
    cairn_pose_graph_params graph = cairn_pose_graph_default();

    graph.max_poses = params->max_keyframes;
    graph.max_links = params->max_keyframes + params->loop.max_loops;
    graph.max_fill = params->loop.max_fill;
    graph.start = CAIRN_POSE_GRAPH_GIVEN;
    graph.kernel = CAIRN_POSE_GRAPH_HUBER;
    graph.max_iterations = 12;
    graph.converged_decrease = CAIRN_REAL(1e-4);
    return graph;
}

static int loop_is_valid(const cairn_mapper_params *params)
{
    const cairn_mapper_loop_params *p = &params->loop;

    if (p->max_loops == 0)
        return 1;
    return p->max_loops > 0 && p->max_loops <= MAX_LOOPS && p->max_fill >= 0 &&
           p->max_fill <= MAX_FILL && p->units_per_scan >= 1 && p->target_keyframes >= 1 &&
           p->target_keyframes <= 64 && p->min_keyframe_gap >= 1 && p->min_consistent >= 1 &&
           p->min_consistent <= 8 && p->candidate_radius > 0 && p->search_radius > 0 &&
           p->local_search_radius > 0 && p->min_log_odds == p->min_log_odds &&
           p->max_free_space_violation >= 0 && p->max_free_space_violation <= 1 && p->sigma > 0 &&
           p->sigma_theta > 0 && p->max_chi2 > 0;
}

/* Culling needs the graph, which joins the neighbours of a culled keyframe. The most recent
 * keyframes are in use and are never culled. */
static int culling_is_valid(const cairn_mapper_params *params)
{
    if (params->cull_keyframes == 0)
        return 1;
    return params->cull_keyframes == 1 && has_loops(params) && params->local_span > 0 &&
           params->max_keyframes > cairn_mapper_protected_count(params) + 1;
}

static int is_valid(const cairn_mapper_params *params)
{
    if (params == NULL || params->max_keyframes < 1 || params->max_keyframes > MAX_KEYFRAMES)
        return 0;
    if (params->local_keyframes < 1 || params->local_keyframes > CAIRN_MAPPER_MAX_LOCAL_KEYFRAMES ||
        params->local_recent < 1 || params->local_recent > params->local_keyframes)
        return 0;
    if (!loop_is_valid(params) || params->local_span < 0 ||
        (params->local_span > 0 && params->local_span < params->local_recent))
        return 0;
    if (params->scan.max_points < 1 || params->scan.max_points > 1 << 17 ||
        params->scan.max_segments < 1 || params->scan.max_segments > 1 << 17)
        return 0;
    if (params->window != 0 &&
        (params->window < 2 || params->window > 64 || params->window_free < 1 ||
         params->window_free >= params->window || params->window_units < 1))
        return 0;
    if (params->max_local_points < 1 || params->max_local_points > 1 << 20)
        return 0;
    /* The first scan must fit: all others are stored relative to it. */
    if (params->max_keyframe_points < params->scan.max_points ||
        params->max_keyframe_segments < params->scan.max_segments)
        return 0;
    return culling_is_valid(params) && params->local_radius > 0 && params->keyframe_distance > 0 &&
           params->keyframe_angle > 0 && params->keyframe_min_overlap >= 0 &&
           params->keyframe_min_overlap <= 1 && params->odometry_distance >= 0 &&
           params->odometry_turn >= 0 && params->odometry_distance_min > 0 &&
           params->odometry_turn_min > 0 && params->motion_distance >= 0 &&
           params->motion_turn >= 0 && params->motion_distance_min > 0 &&
           params->motion_turn_min > 0 && params->min_overlap >= 0 && params->min_overlap <= 1 &&
           (params->search == 0 || (params->search == 1 && params->search_units >= 1));
}

/* Counts the memory of the objects that the mapper creates. */
static void count_modules(cairn_pool *counting, const cairn_mapper_params *params)
{
    cairn_icp_params icp = icp_params(params);
    cairn_force_field_params field = field_params(params);
    cairn_scan_set_params keyframes = keyframe_params(params);

    cairn_pool_count(counting, cairn_scan_memory(&params->scan));
    cairn_pool_count(counting, cairn_icp_memory(&icp));
    cairn_pool_count(counting, cairn_scan_set_memory(&keyframes));
    if (params->window)
        cairn_pool_count(counting, cairn_force_field_memory(&field));
    if (has_match(params)) {
        cairn_scan_match_params match = match_params(params);

        cairn_pool_count(counting, cairn_scan_match_memory(&match));
    }
    if (has_loops(params)) {
        cairn_pose_graph_params graph = graph_params(params);

        cairn_pool_count(counting, cairn_pose_graph_memory(&graph, NULL));
    }
}

/* Takes the arrays of loop closure from the pool; loop NULL: the pool only counts. */
static void take_loop_memory(mapper_loop *loop, cairn_pool *pool, const cairn_mapper_params *params)
{
    size_t keyframes = (size_t)params->max_keyframes,
           scored_keyframes = params->cull_keyframes ? keyframes : 0;
    mapper_link *links =
        cairn_pool_take(pool, keyframes + (size_t)params->loop.max_loops, sizeof *links);
    int32_t *first_link = cairn_pool_take(pool, keyframes, sizeof *first_link);
    mapper_constraint *constraints = cairn_pool_take(pool, keyframes, sizeof *constraints);
    cairn_real *variance = cairn_pool_take(pool, keyframes, sizeof *variance);
    cairn_real *heading_variance = cairn_pool_take(pool, keyframes, sizeof *heading_variance);
    int32_t *heap = cairn_pool_take(pool, keyframes, sizeof *heap);
    int32_t *heap_position = cairn_pool_take(pool, keyframes, sizeof *heap_position);
    cairn_oriented_point *points =
        cairn_pool_take(pool, (size_t)params->scan.max_points, sizeof *points);
    cairn_scan_beam *beams = cairn_pool_take(pool, MAPPER_BEARINGS, sizeof *beams);
    cairn_real *score = cairn_pool_take(pool, scored_keyframes, sizeof *score);
    cairn_real *reach = cairn_pool_take(pool, scored_keyframes, sizeof *reach);

    if (loop == NULL)
        return;
    loop->redundancy.score = score;
    loop->redundancy.neighbour_radius2 = reach;
    loop->links = links;
    loop->first_link = first_link;
    loop->constraints = constraints;
    loop->variance = variance;
    loop->heading_variance = heading_variance;
    loop->heap = heap;
    loop->heap_position = heap_position;
    loop->query_points = points;
    loop->query_beams = beams;
}

static cairn_mapper *take_memory(cairn_pool *pool, const cairn_mapper_params *params)
{
    cairn_mapper *mapper = cairn_pool_take_one(pool, sizeof *mapper);
    int32_t *slot = cairn_pool_take(pool, (size_t)params->max_keyframes, sizeof *slot);
    cairn_pose *key_pose = cairn_pool_take(pool, (size_t)params->max_keyframes, sizeof *key_pose);
    cairn_oriented_point *oriented =
        cairn_pool_take(pool, (size_t)params->scan.max_points, sizeof *oriented);
    cairn_segment *segments =
        cairn_pool_take(pool, (size_t)params->scan.max_segments, sizeof *segments);
    int32_t *first_point =
        cairn_pool_take(pool, (size_t)params->scan.max_segments + 1, sizeof *first_point);
    size_t bearings = has_match(params) ? MAPPER_BEARINGS : 0;
    uint16_t *visibility =
        cairn_pool_take(pool, (size_t)params->max_keyframes * bearings, sizeof *visibility);
    cairn_scan_beam *beams = cairn_pool_take(pool, bearings, sizeof *beams);

    if (mapper != NULL) {
        memset(mapper, 0, sizeof *mapper);
        mapper->slot = slot;
        mapper->keyframe_pose = key_pose;
        mapper->points = oriented;
        mapper->segments = segments;
        mapper->first_point = first_point;
        mapper->visibility = has_match(params) ? visibility : NULL;
        mapper->beams = beams;
        mapper->odometry_health = mapper->odometry_noise_scale = 1;
    }
    if (has_loops(params))
        take_loop_memory(mapper != NULL ? &mapper->loop : NULL, pool, params);
    return mapper;
}

size_t cairn_mapper_memory(const cairn_mapper_params *params)
{
    cairn_pool counting;

    if (!is_valid(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)take_memory(&counting, params);
    count_modules(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_mapper_create(cairn_mapper **mapper, cairn_pool *pool,
                                 const cairn_mapper_params *params)
{
    size_t need = cairn_mapper_memory(params);
    cairn_icp_params icp;
    cairn_force_field_params field;
    cairn_scan_set_params keyframes;
    cairn_mapper *made;
    cairn_status status;

    if (mapper == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_capacity(pool, need))
        return CAIRN_NO_MEMORY;
    icp = icp_params(params);
    field = field_params(params);
    keyframes = keyframe_params(params);
    made = take_memory(pool, params);
    made->params = *params;
    status = cairn_scan_create(&made->scan, pool, &params->scan);
    if (status == CAIRN_OK)
        status = cairn_icp_create(&made->icp, pool, &icp);
    if (status == CAIRN_OK)
        status = cairn_scan_set_create(&made->keyframes, pool, &keyframes);
    if (status == CAIRN_OK && params->window)
        status = cairn_force_field_create(&made->field, pool, &field);
    CAIRN_ASSERT(status == CAIRN_OK);
    if (status == CAIRN_OK && has_match(params)) {
        cairn_scan_match_params match = match_params(params);

        status = cairn_scan_match_create(&made->search, pool, &match);
    }
    if (status == CAIRN_OK && has_loops(params)) {
        cairn_pose_graph_params graph = graph_params(params);

        status = cairn_pose_graph_create(&made->loop.graph, pool, &graph, NULL);
    }
    made->target_stale = 1;
    *mapper = made;
    return status;
}
