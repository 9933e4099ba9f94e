/* Parameters of the mapper and of the modules that it uses, their validation, and memory.
 *
 * Layout: one-time buffers (current scan, local map, search, window of the force field) grow with
 * the capacities of scan and local map. Keyframes, links and the factor of the graph grow with
 * max_keyframes, max_loops and max_fill. One scan_match object serves both relocalization and loop
 * closure. */
#include "src/base/build.h"

#include <string.h>

#include "src/maps/mapper_work.h"

enum {
    MAX_KEYFRAMES = 1 << 20,
    MAX_CAPACITY = 1 << 24,
    MAX_LOOPS = 1 << 22,
    MAX_FILL = 1 << 26,
    MAX_WINDOW = 64,
    MAX_SCAN_ITEMS = 1 << 17
};

#define WITH_LOOPS  CAIRN_WHEN(cairn_mapper_params, loop.max_loops)
#define WITH_WINDOW CAIRN_WHEN(cairn_mapper_params, window)
#define WITH_SEARCH CAIRN_WHEN(cairn_mapper_params, search)

#define INTEGER(field, is, from, to) CAIRN_INTEGER(cairn_mapper_params, field, is, from, to)
#define INTEGER_IF(field, in_use, is, from, to)                                                    \
    CAIRN_INTEGER_IF(cairn_mapper_params, field, in_use, is, from, to)
#define NUMBER(field, is, to) CAIRN_NUMBER(cairn_mapper_params, field, CAIRN_REAL(is), 0, to)
#define POSITIVE(field, is)                                                                        \
    CAIRN_NUMBER_ABOVE(cairn_mapper_params, field, CAIRN_REAL(is), 0, CAIRN_REAL_MAX)
#define LOOP_POSITIVE(field, is)                                                                   \
    CAIRN_NUMBER_ROW(cairn_mapper_params, field, WITH_LOOPS, CAIRN_PARAMETER_NUMBER_ABOVE,         \
                     CAIRN_REAL(is), 0, CAIRN_REAL_MAX)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(loop.max_loops, 4096, 0, MAX_LOOPS),
    INTEGER_IF(loop.max_fill, WITH_LOOPS, 32768, 0, MAX_FILL),
    INTEGER_IF(loop.units_per_scan, WITH_LOOPS, 8000, 1, INT32_MAX),
    INTEGER_IF(loop.target_keyframes, WITH_LOOPS, 9, 1, 64),
    INTEGER_IF(loop.min_keyframe_gap, WITH_LOOPS, 25, 1, INT32_MAX),
    INTEGER_IF(loop.min_consistent, WITH_LOOPS, 3, 1, 8),
    LOOP_POSITIVE(loop.candidate_radius, 3.0),
    LOOP_POSITIVE(loop.search_radius, 4.0),
    LOOP_POSITIVE(loop.local_search_radius, 0.6),
    CAIRN_NUMBER_ROW(cairn_mapper_params, loop.min_log_odds, WITH_LOOPS, CAIRN_PARAMETER_NUMBER, 2,
                     -CAIRN_REAL_MAX, CAIRN_REAL_MAX),
    CAIRN_NUMBER_ROW(cairn_mapper_params, loop.max_free_space_violation, WITH_LOOPS,
                     CAIRN_PARAMETER_NUMBER, CAIRN_REAL(0.1), 0, 1),
    LOOP_POSITIVE(loop.sigma, 0.01),
    LOOP_POSITIVE(loop.sigma_theta, 0.004),
    LOOP_POSITIVE(loop.max_chi2, 50.0),
    INTEGER(max_keyframes, 1024, 1, MAX_KEYFRAMES),
    INTEGER(max_keyframe_segments, 32768, 1, MAX_CAPACITY),
    INTEGER(max_keyframe_points, 131072, 1, MAX_CAPACITY),
    INTEGER(cull_keyframes, 0, 0, 1),
    INTEGER(max_local_points, 4096, 1, 1 << 20),
    INTEGER(local_keyframes, 15, 1, CAIRN_MAPPER_MAX_LOCAL_KEYFRAMES),
    INTEGER(local_recent, 3, 1, CAIRN_MAPPER_MAX_LOCAL_KEYFRAMES),
    INTEGER(local_span, 25, 0, INT32_MAX),
    POSITIVE(local_radius, 4.0),
    POSITIVE(keyframe_distance, 0.5),
    POSITIVE(keyframe_angle, 0.5),
    NUMBER(keyframe_min_overlap, 0.6, 1),
    INTEGER(window, 8, 0, MAX_WINDOW),
    INTEGER_IF(window_free, WITH_WINDOW, 3, 1, MAX_WINDOW - 1),
    INTEGER_IF(window_units, WITH_WINDOW, 32000, 1, INT32_MAX),
    NUMBER(odometry_distance, 0.3, CAIRN_REAL_MAX),
    NUMBER(odometry_turn, 0.3, CAIRN_REAL_MAX),
    POSITIVE(odometry_distance_min, 0.01),
    POSITIVE(odometry_turn_min, 0.005),
    NUMBER(odometry_sigma, 0.0, 10),
    NUMBER(motion_distance, 0.3, CAIRN_REAL_MAX),
    NUMBER(motion_turn, 0.3, CAIRN_REAL_MAX),
    POSITIVE(motion_distance_min, 0.03),
    POSITIVE(motion_turn_min, 0.02),
    NUMBER(min_overlap, 0.3, 1),
    INTEGER(search, 1, 0, 1),
    INTEGER_IF(search_units, WITH_SEARCH, 200000, 1, INT32_MAX),
};
const cairn_parameters cairn_mapper_parameters =
    CAIRN_PARAMETERS("mapper", cairn_mapper_params, rows);

cairn_mapper_params cairn_mapper_default(void)
{
    cairn_mapper_params params;

    cairn_parameters_preset(&cairn_mapper_parameters, &params);
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

/* 1 when culling is off or possible. It needs the graph, which joins the neighbours of a culled
 * keyframe. The most recent keyframes are in use and are never culled. */
static int can_cull(const cairn_mapper_params *params)
{
    return !params->cull_keyframes ||
           (has_loops(params) && params->local_span > 0 &&
            params->max_keyframes > cairn_mapper_protected_count(params) + 1);
}

static int is_scan_count(int32_t count)
{
    return count >= 1 && count <= MAX_SCAN_ITEMS;
}

/* Rules between parameters. */
static cairn_status check_rules(const cairn_mapper_params *params, cairn_object_fault *fault)
{
    const struct {
        int holds;
        const char *rule;
    } rules[] = {
        {params->local_recent <= params->local_keyframes, "local_recent: at most local_keyframes"},
        {params->local_span == 0 || params->local_span >= params->local_recent,
         "local_span: 0, or at least local_recent"},
        {is_scan_count(params->scan.max_points) && is_scan_count(params->scan.max_segments),
         "scan.max_points, scan.max_segments: 1 ... 2^17"},
        {params->window == 0 || (params->window >= 2 && params->window_free < params->window),
         "window: 0, or at least 2 and above window_free"},
        /* The first scan must fit: all others are stored relative to it. */
        {params->max_keyframe_points >= params->scan.max_points,
         "max_keyframe_points: at least scan.max_points"},
        {params->max_keyframe_segments >= params->scan.max_segments,
         "max_keyframe_segments: at least scan.max_segments"},
        {can_cull(params), "cull_keyframes: with loop closure, local_span above 0, and enough "
                           "keyframes that may be culled"},
    };
    cairn_status status = CAIRN_OK;

    for (size_t i = 0; i < sizeof rules / sizeof *rules && status == CAIRN_OK; i++)
        status = cairn_parameters_require(rules[i].holds, "mapper", rules[i].rule, fault);
    return status;
}

/* Parameters of the nested objects. */
static cairn_status check_objects(const cairn_mapper_params *params, cairn_object_fault *fault)
{
    cairn_icp_params icp = icp_params(params);
    cairn_force_field_params field = field_params(params);
    cairn_scan_match_params match = match_params(params);
    cairn_pose_graph_params graph = graph_params(params);
    cairn_status status = cairn_scan_check(&params->scan, fault);

    if (status == CAIRN_OK)
        status = cairn_icp_check(&icp, fault);
    if (status == CAIRN_OK && params->window)
        status = cairn_force_field_check(&field, fault);
    if (status == CAIRN_OK && has_match(params))
        status = cairn_scan_match_check(&match, fault);
    if (status == CAIRN_OK && has_loops(params))
        status = cairn_pose_graph_check(&graph, fault);
    return status;
}

cairn_status cairn_mapper_check(const cairn_mapper_params *params, cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_mapper_parameters, params, fault);

    if (status == CAIRN_OK)
        status = check_rules(params, fault);
    if (status == CAIRN_OK)
        status = check_objects(params, fault);
    return status;
}

/* The arrays of loop closure. */
static void take_loop(mapper_loop *loop, cairn_pool *pool, const cairn_mapper_params *params)
{
    size_t keyframes = (size_t)params->max_keyframes,
           scored_keyframes = params->cull_keyframes ? keyframes : 0;

    CAIRN_TAKE(loop, pool, links, keyframes + (size_t)params->loop.max_loops);
    CAIRN_TAKE(loop, pool, first_link, keyframes);
    CAIRN_TAKE(loop, pool, constraints, keyframes);
    CAIRN_TAKE(loop, pool, returns.variance, keyframes);
    CAIRN_TAKE(loop, pool, returns.anisotropy, keyframes);
    CAIRN_TAKE(loop, pool, returns.heading_variance, keyframes);
    CAIRN_TAKE(loop, pool, returns.heap, keyframes);
    CAIRN_TAKE(loop, pool, returns.heap_position, keyframes);
    CAIRN_TAKE(loop, pool, returns.query_points, params->scan.max_points);
    CAIRN_TAKE(loop, pool, redundancy.score, scored_keyframes);
    CAIRN_TAKE(loop, pool, redundancy.neighbour_radius2, scored_keyframes);
}

/* The nested objects. */
static void take_objects(cairn_mapper *mapper, cairn_pool *pool, const cairn_mapper_params *params)
{
    cairn_icp_params icp = icp_params(params);
    cairn_force_field_params field = field_params(params);
    cairn_scan_set_params keyframes = keyframe_params(params);
    cairn_scan_match_params match = match_params(params);
    cairn_pose_graph_params graph = graph_params(params);

    CAIRN_TAKE_OBJECT(mapper, pool, scan, scan, &params->scan);
    CAIRN_TAKE_OBJECT(mapper, pool, icp, icp, &icp);
    CAIRN_TAKE_OBJECT(mapper, pool, keyframes, scan_set, &keyframes);
    if (params->window)
        CAIRN_TAKE_OBJECT(mapper, pool, field, force_field, &field);
    if (has_match(params))
        CAIRN_TAKE_OBJECT(mapper, pool, search, scan_match, &match);
    if (has_loops(params))
        CAIRN_TAKE_BY(mapper,
                      cairn_pose_graph_create(CAIRN_FIELD(mapper, loop.graph), pool, &graph, NULL));
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_mapper *build(cairn_pool *pool, const cairn_mapper_params *params)
{
    size_t keyframes = (size_t)params->max_keyframes,
           bins = has_match(params) ? CAIRN_VISIBILITY_BINS : 0;
    cairn_mapper *mapper = cairn_object_take(pool, sizeof *mapper);

    CAIRN_TAKE(mapper, pool, slot, keyframes);
    CAIRN_TAKE(mapper, pool, keyframe_pose, keyframes);
    CAIRN_TAKE(mapper, pool, points, params->scan.max_points);
    CAIRN_TAKE(mapper, pool, ranges.ends, params->scan.max_beams);
    CAIRN_TAKE(mapper, pool, segments, params->scan.max_segments);
    CAIRN_TAKE(mapper, pool, first_point, params->scan.max_segments + 1);
    CAIRN_TAKE(mapper, pool, visibility, keyframes * bins);
    if (has_loops(params))
        take_loop(mapper != NULL ? &mapper->loop : NULL, pool, params);
    take_objects(mapper, pool, params);
    if (mapper != NULL) {
        mapper->params = *params;
        mapper->odometry.health = mapper->odometry.noise_scale = 1;
        cairn_mapper_begin_odometry(mapper);
        mapper->target.is_stale = 1;
        if (!has_match(params))
            mapper->visibility = NULL;
    }
    return mapper;
}

CAIRN_OBJECT(mapper, mapper, build);
