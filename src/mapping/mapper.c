/* Scan by scan: predict, fit, match, keep.
 *
 * Method. Where a scan is, is in mapper_front.c. Points are evenly spaced along the surfaces, not one a beam: near
 * walls would otherwise outvote all others, and their small systematic errors turn the map.
 *
 * The local map is made of the last key scans and of the nearest ones among those of the last while: what is older is joined
 * by loops (mapper_loop.c, mapper_graph.c), which spread the error over the path, while a match would put all of it into one
 * link.
 *
 * Layout: key scans in a scan_set with a pose each; the local map in the icp object, made anew when a key scan was added or
 * moved, or the robot has left the place for which it was made.
 *
 * Limits: key scans are never forgotten. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/mapper_work.h"

enum { KEY_REST = 2 }; /* scans after a key scan that are none for want of support */

cairn_mapper_params cairn_mapper_default(void)
{
    cairn_mapper_params params;

    memset(&params, 0, sizeof params);
    params.scan = cairn_scan_default();
    params.scan.max_points = 1024;
    params.icp = cairn_icp_default();
    params.icp.weak_ratio = CAIRN_REAL(0.03);
    params.field = cairn_force_field_default();
    params.field.sigma_start = CAIRN_REAL(0.04);
    params.field.sigma_end = CAIRN_REAL(0.02);
    params.field.dt_start = CAIRN_REAL(0.01);
    params.field.dt_end = CAIRN_REAL(0.005);
    params.field.roi = 0;
    params.field.max_steps = 10;
    params.loop.max_loops = 4096;
    params.loop.max_fill = 32768;
    params.loop.units = 8000;
    params.loop.keys = 9;
    params.loop.gap = 25;
    params.loop.agree = 3;
    params.loop.radius = 3;
    params.loop.window = 4;
    params.loop.window_near = CAIRN_REAL(0.6);
    params.loop.evidence = 2;
    params.loop.contradiction = CAIRN_REAL(0.1);
    params.loop.sigma = CAIRN_REAL(0.01);
    params.loop.sigma_turn = CAIRN_REAL(0.004);
    params.loop.outlier = 50;
    params.max_keys = 1024;
    params.max_key_segments = 32768;
    params.max_key_points = 131072;
    params.local_keys = 15;
    params.local_recent = 3;
    params.local_span = 25;
    params.local_radius = 4;
    params.key_distance = CAIRN_REAL(0.5);
    params.key_turn = CAIRN_REAL(0.5);
    params.key_support = CAIRN_REAL(0.6);
    params.window = 8;
    params.window_free = 3;
    params.odometry_distance = CAIRN_REAL(0.3);
    params.odometry_turn = CAIRN_REAL(0.3);
    params.odometry_distance_min = CAIRN_REAL(0.03);
    params.odometry_turn_min = CAIRN_REAL(0.02);
    params.motion_distance = CAIRN_REAL(0.3);
    params.motion_turn = CAIRN_REAL(0.3);
    params.motion_distance_min = CAIRN_REAL(0.03);
    params.motion_turn_min = CAIRN_REAL(0.02);
    params.min_support = CAIRN_REAL(0.3);
    params.search = 1;
    return params;
}

/* The rooms' params with the capacities that the mapper needs. */
static cairn_icp_params icp_params(const cairn_mapper_params *params)
{
    cairn_icp_params icp = params->icp;

    icp.max_target = params->local_keys * params->scan.max_points;
    return icp;
}

static cairn_force_field_params field_params(const cairn_mapper_params *params)
{
    cairn_force_field_params field = params->field;

    field.max_scans = params->window;
    field.max_segments = params->window * params->scan.max_segments;
    field.max_points = params->window * params->scan.max_points;
    return field;
}

static cairn_scan_set_params key_params(const cairn_mapper_params *params)
{
    cairn_scan_set_params keys = {params->max_keys, params->max_key_segments, params->max_key_points, 0};

    return keys;
}

/* Of scan_match against so many key scans. */
static cairn_scan_match_params match_params(const cairn_mapper_params *params, int32_t keys)
{
    cairn_scan_match_params match = cairn_scan_match_default();

    match.max_target = keys * params->scan.max_points;
    if (match.max_target > 1 << 20)
        match.max_target = 1 << 20; /* what scan_match takes at most */
    match.max_dense = 0;
    match.max_views = keys;
    match.max_query = params->scan.max_points;
    match.spacing = params->scan.spacing;
    return match;
}

static cairn_pose_graph_params graph_params(const cairn_mapper_params *params)
{
    cairn_pose_graph_params graph = cairn_pose_graph_default();

    graph.max_poses = params->max_keys;
    graph.max_links = params->max_keys + params->loop.max_loops;
    graph.max_fill = params->loop.max_fill;
    graph.start = CAIRN_POSE_GRAPH_GIVEN;
    graph.kernel = CAIRN_POSE_GRAPH_HUBER;
    graph.max_iterations = 12;
    graph.converged = CAIRN_REAL(1e-4);
    return graph;
}

static int loop_is_valid(const cairn_mapper_params *params)
{
    const cairn_mapper_loop_params *p = &params->loop;

    if (p->max_loops == 0)
        return 1;
    return p->max_loops > 0 && p->max_loops <= 1 << 22 && p->max_fill >= 0 && p->max_fill <= 1 << 26 && p->units >= 1 &&
           p->keys >= 1 && p->keys <= 64 && p->gap >= 1 && p->agree >= 1 && p->agree <= 8 && p->radius > 0 &&
           p->window > 0 && p->window_near > 0 && p->evidence == p->evidence && p->contradiction >= 0 &&
           p->contradiction <= 1 && p->sigma > 0 && p->sigma_turn > 0 && p->outlier > 0;
}

static int is_valid(const cairn_mapper_params *p)
{
    if (p == NULL || p->max_keys < 1 || p->max_keys > 1 << 20)
        return 0;
    if (p->local_keys < 1 || p->local_keys > CAIRN_MAPPER_LOCAL_MOST || p->local_recent < 1 ||
        p->local_recent > p->local_keys)
        return 0;
    if (!loop_is_valid(p) || p->local_span < 0 || (p->local_span > 0 && p->local_span < p->local_recent))
        return 0;
    if (p->scan.max_points < 1 || p->scan.max_points > 1 << 17 || p->scan.max_segments < 1 ||
        p->scan.max_segments > 1 << 17)
        return 0;
    if (p->window != 0 && (p->window < 2 || p->window > 64 || p->window_free < 1 || p->window_free >= p->window))
        return 0;
    return p->local_radius > 0 && p->key_distance > 0 && p->key_turn > 0 && p->key_support >= 0 &&
           p->key_support <= 1 && p->odometry_distance >= 0 && p->odometry_turn >= 0 && p->odometry_distance_min > 0 &&
           p->odometry_turn_min > 0 && p->motion_distance >= 0 && p->motion_turn >= 0 && p->motion_distance_min > 0 &&
           p->motion_turn_min > 0 && p->min_support >= 0 && p->min_support <= 1 && (p->search == 0 || p->search == 1);
}

/* Counts the objects that the mapper creates. */
static void count_parts(cairn_pool *counting, const cairn_mapper_params *params)
{
    cairn_icp_params icp = icp_params(params);
    cairn_force_field_params field = field_params(params);
    cairn_scan_set_params keys = key_params(params);

    cairn_pool_count(counting, cairn_scan_memory(&params->scan));
    cairn_pool_count(counting, cairn_icp_memory(&icp));
    cairn_pool_count(counting, cairn_scan_set_memory(&keys));
    if (params->window)
        cairn_pool_count(counting, cairn_force_field_memory(&field));
    if (params->search) {
        cairn_scan_match_params match = match_params(params, params->local_keys);

        cairn_pool_count(counting, cairn_scan_match_memory(&match));
    }
    if (params->loop.max_loops > 0) {
        cairn_scan_match_params match = match_params(params, params->loop.keys);
        cairn_pose_graph_params graph = graph_params(params);

        cairn_pool_count(counting, cairn_scan_match_memory(&match));
        cairn_pool_count(counting, cairn_pose_graph_memory(&graph, NULL));
    }
}

/* What only loops need; loop NULL: from a counting pool. */
static void carve_loop(mapper_loop *loop, cairn_pool *pool, const cairn_mapper_params *params)
{
    size_t keys = (size_t)params->max_keys;
    mapper_link *links = cairn_pool_take(pool, keys + (size_t)params->loop.max_loops, sizeof *links);
    int32_t *first_link = cairn_pool_take(pool, keys, sizeof *first_link);
    cairn_sym3 *covariance = cairn_pool_take(pool, keys, sizeof *covariance);
    cairn_real *variance = cairn_pool_take(pool, keys, sizeof *variance);
    cairn_real *turn_variance = cairn_pool_take(pool, keys, sizeof *turn_variance);
    int32_t *heap = cairn_pool_take(pool, keys, sizeof *heap);
    int32_t *heap_at = cairn_pool_take(pool, keys, sizeof *heap_at);
    cairn_oriented_point *points = cairn_pool_take(pool, (size_t)params->scan.max_points, sizeof *points);
    cairn_beam *beams = cairn_pool_take(pool, MAPPER_BEARINGS, sizeof *beams);

    if (loop == NULL)
        return;
    loop->links = links;
    loop->first_link = first_link;
    loop->covariance = covariance;
    loop->variance = variance;
    loop->turn_variance = turn_variance;
    loop->heap = heap;
    loop->heap_at = heap_at;
    loop->query_points = points;
    loop->query_beams = beams;
}

static cairn_mapper *carve(cairn_pool *pool, const cairn_mapper_params *params)
{
    cairn_mapper *mapper = cairn_pool_take_one(pool, sizeof *mapper);
    cairn_pose *key_pose = cairn_pool_take(pool, (size_t)params->max_keys, sizeof *key_pose);
    cairn_oriented_point *oriented = cairn_pool_take(pool, (size_t)params->scan.max_points, sizeof *oriented);
    cairn_segment *segments = cairn_pool_take(pool, (size_t)params->scan.max_segments, sizeof *segments);
    int32_t *first_point = cairn_pool_take(pool, (size_t)params->scan.max_segments + 1, sizeof *first_point);
    int32_t has_sight = params->search || params->loop.max_loops > 0;
    uint16_t *sight = cairn_pool_take(pool, has_sight ? (size_t)params->max_keys * MAPPER_BEARINGS : 0, sizeof *sight);
    cairn_beam *beams = cairn_pool_take(pool, has_sight ? MAPPER_BEARINGS : 0, sizeof *beams);

    if (mapper != NULL) {
        memset(mapper, 0, sizeof *mapper);
        mapper->key_pose = key_pose;
        mapper->oriented = oriented;
        mapper->segments = segments;
        mapper->first_point = first_point;
        mapper->sight = has_sight ? sight : NULL;
        mapper->beams = beams;
        mapper->trust = 1;
    }
    if (params->loop.max_loops > 0)
        carve_loop(mapper != NULL ? &mapper->loop : NULL, pool, params);
    return mapper;
}

size_t cairn_mapper_memory(const cairn_mapper_params *params)
{
    cairn_pool counting;

    if (!is_valid(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    count_parts(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_mapper_create(cairn_mapper **mapper, cairn_pool *pool, const cairn_mapper_params *params)
{
    size_t need = cairn_mapper_memory(params);
    cairn_icp_params icp;
    cairn_force_field_params field;
    cairn_scan_set_params keys;
    cairn_mapper *made;
    cairn_status status;

    if (mapper == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    icp = icp_params(params);
    field = field_params(params);
    keys = key_params(params);
    made = carve(pool, params);
    made->params = *params;
    status = cairn_scan_create(&made->scan, pool, &params->scan);
    if (status == CAIRN_OK)
        status = cairn_icp_create(&made->icp, pool, &icp);
    if (status == CAIRN_OK)
        status = cairn_scan_set_create(&made->keys, pool, &keys);
    if (status == CAIRN_OK && params->window)
        status = cairn_force_field_create(&made->field, pool, &field);
    CAIRN_ASSERT(status == CAIRN_OK);
    if (status == CAIRN_OK && params->search) {
        cairn_scan_match_params match = match_params(params, params->local_keys);

        status = cairn_scan_match_create(&made->search, pool, &match);
    }
    if (status == CAIRN_OK && params->loop.max_loops > 0) {
        cairn_scan_match_params match = match_params(params, params->loop.keys);
        cairn_pose_graph_params graph = graph_params(params);

        status = cairn_scan_match_create(&made->loop.match, pool, &match);
        if (status == CAIRN_OK)
            status = cairn_pose_graph_create(&made->loop.graph, pool, &graph, NULL);
    }
    made->target_stale = 1;
    *mapper = made;
    return status;
}

/* ---- Input ---- */

/* Where the scan before is now. */
static cairn_pose last_pose(const cairn_mapper *mapper)
{
    if (mapper->state.scans == 0)
        return cairn_pose_identity();
    return cairn_pose_compose(mapper->key_pose[mapper->result.key], mapper->result.key_scan);
}

cairn_status cairn_mapper_add(cairn_mapper *mapper, const cairn_scan_input *input, const cairn_pose *odometry,
                              cairn_fault *fault)
{
    cairn_pose last, by_odometry = cairn_pose_identity();
    cairn_status status;

    if (mapper == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (mapper->phase != IDLE)
        return CAIRN_MORE;
    if (mapper->full)
        return CAIRN_FULL;
    if (odometry != NULL && !cairn_pose_is_finite(*odometry))
        return CAIRN_NOT_FINITE;
    status = cairn_scan_begin(mapper->scan, input, fault);
    if (status != CAIRN_OK)
        return status;

    last = last_pose(mapper);
    mapper->has_odometry = odometry != NULL && (mapper->had_odometry || mapper->state.scans == 0);
    if (odometry != NULL)
        mapper->odometry = *odometry;
    if (mapper->state.scans == 0 && odometry != NULL)
        last = *odometry; /* the map's frame is that of the odometry */
    if (mapper->has_odometry && mapper->state.scans > 0)
        by_odometry = cairn_pose_between(mapper->last_odometry, mapper->odometry);
    cairn_mapper_predict(mapper, last, by_odometry);
    mapper->had_odometry = odometry != NULL;
    if (odometry != NULL)
        mapper->last_odometry = *odometry;
    mapper->phase = FIT;
    mapper->cursor = 0;
    return CAIRN_OK;
}

/* ---- The match ---- */

/* The scan is fitted: what comes next for its pose. */
static cairn_status begin_pose(cairn_mapper *mapper)
{
    if (cairn_scan_read(mapper->scan).point_count == 0 || mapper->keys->point_count == 0) {
        mapper->phase = KEEP;
        return CAIRN_OK;
    }
    if (cairn_mapper_needs_local(mapper)) {
        mapper->phase = SELECT;
        cairn_mapper_begin_local(mapper);
        return CAIRN_OK;
    }
    return cairn_mapper_begin_match(mapper);
}

/* ---- The result ---- */

/* 1 when the scan shows what the local map does not: it moved on, or most of it has no partners. */
static int is_key_scan(const cairn_mapper *mapper, cairn_pose map_scan)
{
    cairn_pose key_scan;

    if (mapper->keys->scan_count == 0)
        return 1;
    if (mapper->result.support < mapper->params.key_support && mapper->since_key >= KEY_REST)
        return 1;
    key_scan = cairn_pose_between(mapper->key_pose[mapper->keys->scan_count - 1], map_scan);
    return key_scan.x * key_scan.x + key_scan.y * key_scan.y >
               mapper->params.key_distance * mapper->params.key_distance ||
           cairn_abs(key_scan.theta) > mapper->params.key_turn;
}

/* Covariance of the scan's pose seen from the key scan before, in the scan's own frame. */
static cairn_sym3 link_covariance(const cairn_mapper *mapper)
{
    const cairn_mapper_params *p = &mapper->params;
    cairn_pose prediction = mapper->motion;
    cairn_real way = cairn_sqrt(prediction.x * prediction.x + prediction.y * prediction.y), unmatched[9] = {0};

    if (mapper->has_match)
        return cairn_mapper_own_covariance(mapper, mapper->match.covariance, mapper->match.target_query.theta);
    unmatched[0] = unmatched[4] = p->motion_distance_min + p->motion_distance * way;
    unmatched[8] = p->motion_turn_min + p->motion_turn * cairn_abs(prediction.theta);
    for (int k = 0; k < 9; k += 4)
        unmatched[k] *= unmatched[k];
    return cairn_mapper_own_covariance(mapper, unmatched, 0);
}

/* Fills the result and keeps the scan when it is a key scan. CAIRN_FULL: no room to keep it. */
static cairn_status keep(cairn_mapper *mapper)
{
    cairn_scan_view view = cairn_scan_read(mapper->scan);
    cairn_mapper_result *result = &mapper->result;
    cairn_pose last = last_pose(mapper);
    cairn_status status = CAIRN_OK;
    int32_t first = mapper->keys->scan_count == 0;

    if (mapper->state.scans == 0)
        last = mapper->predicted;
    cairn_mapper_learn(mapper);
    result->map_scan = mapper->has_match ? mapper->match.target_query : mapper->predicted;
    result->support = mapper->has_match ? mapper->match.overlap : 0;
    memset(result->covariance, 0, sizeof result->covariance);
    if (mapper->has_match)
        memcpy(result->covariance, mapper->match.covariance, sizeof result->covariance);
    if (mapper->has_match)
        result->verdict = CAIRN_MAPPER_MATCHED;
    else if (view.point_count == 0)
        result->verdict = CAIRN_MAPPER_BLIND;
    else
        result->verdict = first ? CAIRN_MAPPER_FIRST : CAIRN_MAPPER_PREDICTED;
    mapper->state.predicted += result->verdict == CAIRN_MAPPER_PREDICTED || result->verdict == CAIRN_MAPPER_BLIND;

    /* The first scan of all is a key scan even when it shows nothing: something must carry the scans that hang on it. */
    result->is_key = (first || view.point_count > 0) && is_key_scan(mapper, result->map_scan);
    if (result->is_key) {
        status = cairn_scan_set_add(mapper->keys, &view, NULL, NULL);
        if (status == CAIRN_OK) {
            int32_t key = mapper->keys->scan_count - 1;

            mapper->key_pose[key] = result->map_scan;
            mapper->target_stale = 1;
            if (mapper->sight != NULL)
                cairn_mapper_keep_sight(mapper, key, &view);
            if (mapper->loop.graph != NULL)
                mapper->loop.covariance[key] = link_covariance(mapper);
        } else {
            result->is_key = 0;
            mapper->full = 1;
        }
    }
    result->key = mapper->keys->scan_count - 1;
    result->key_scan = cairn_pose_between(mapper->key_pose[result->key], result->map_scan);
    mapper->last_motion = cairn_mapper_next_motion(mapper, cairn_pose_between(last, result->map_scan));
    mapper->since_key = result->is_key ? 0 : mapper->since_key + 1;
    mapper->state.scans++;
    mapper->state.keys = mapper->keys->scan_count;
    return status;
}

/* ---- Steps ---- */

/* The scan has its pose: loops and graph get their share, or what a search has left of it. */
static void begin_share(cairn_mapper *mapper)
{
    mapper->loop.quota = mapper->params.loop.units - mapper->spent;
    mapper->phase = mapper->loop.graph != NULL && mapper->loop.quota > 0 ? LOOP : IDLE;
}

/* Goes on with loops and graph until there is nothing to do, or the scan's share of units is used up. */
static cairn_status take_share(cairn_mapper *mapper, cairn_budget *budget)
{
    int32_t most = budget->left < mapper->loop.quota ? budget->left : mapper->loop.quota;
    cairn_budget share = {most};
    cairn_status status = cairn_mapper_loop_step(mapper, &share);

    budget->left -= most - share.left;
    mapper->loop.quota -= most - share.left;
    if (status == CAIRN_OK || (status == CAIRN_MORE && mapper->loop.quota <= 0))
        mapper->phase = IDLE;
    return status == CAIRN_MORE ? CAIRN_OK : status;
}

/* One item of the phase at hand. CAIRN_OK: the phase may have changed; CAIRN_MORE: the budget ended within a part. */
static cairn_status advance(cairn_mapper *mapper, cairn_budget *budget)
{
    cairn_status status = CAIRN_OK;
    int32_t before;

    switch (mapper->phase) {
    case FIT:
        status = cairn_scan_step(mapper->scan, budget);
        if (status == CAIRN_OK)
            status = begin_pose(mapper);
        break;
    case SELECT:
        budget->left--;
        if (cairn_mapper_select_local(mapper)) {
            cairn_icp_clear_target(mapper->icp);
            budget->left -= 1 + mapper->params.local_keys * mapper->params.scan.max_points / 64;
            mapper->phase = TARGET;
            mapper->cursor = 0;
        }
        break;
    case TARGET:
        status = cairn_mapper_add_local(mapper, budget);
        if (status == CAIRN_OK && mapper->cursor == mapper->local_count) {
            mapper->target_stale = 0;
            mapper->target_pose = mapper->predicted;
            mapper->search_count = 0;
            mapper->phase = KEEP;
            if (cairn_icp_target_count(mapper->icp) > 0)
                status = cairn_mapper_begin_match(mapper);
        }
        break;
    case MATCH:
    case MATCH_OTHER:
    case MATCH_FOUND:
        status = cairn_icp_step(mapper->icp, budget);
        if (status == CAIRN_OK)
            status = cairn_mapper_end_match(mapper);
        break;
    case SEARCH_TARGET:
        status = cairn_mapper_search_target(mapper, budget);
        break;
    case SEARCH:
        before = budget->left;
        status = cairn_scan_match_step(mapper->search, budget);
        mapper->spent += before - budget->left;
        if (status == CAIRN_OK)
            status = cairn_mapper_end_search(mapper);
        break;
    case KEEP:
        budget->left -= 4 + cairn_scan_read(mapper->scan).point_count / 4;
        status = keep(mapper);
        begin_share(mapper);
        if (status != CAIRN_OK)
            mapper->phase = IDLE;
        if (status == CAIRN_OK && mapper->result.is_key && mapper->params.window && mapper->keys->scan_count > 1) {
            cairn_force_field_clear(mapper->field);
            mapper->phase = WINDOW;
            mapper->cursor = 0;
        }
        break;
    case WINDOW:
        status = cairn_mapper_add_window(mapper, budget);
        if (status == CAIRN_OK && mapper->cursor == cairn_mapper_window_count(mapper))
            mapper->phase = FIELD;
        break;
    case LOOP:
        status = take_share(mapper, budget);
        break;
    default:
        status = cairn_force_field_step(mapper->field, budget);
        if (status == CAIRN_OK) {
            cairn_mapper_read_window(mapper);
            begin_share(mapper);
        }
        break;
    }
    return status;
}

cairn_status cairn_mapper_step(cairn_mapper *mapper, cairn_budget *budget)
{
    cairn_status status = CAIRN_OK;
    int32_t before;

    if (mapper == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    before = budget->left;
    while (status == CAIRN_OK && mapper->phase != IDLE) {
        if (budget->left <= 0) {
            status = CAIRN_MORE;
            break;
        }
        status = advance(mapper, budget);
    }
    mapper->state.units += (int64_t)before - budget->left;
    return status;
}

cairn_status cairn_mapper_settle(cairn_mapper *mapper, cairn_budget *budget)
{
    cairn_status status;
    int32_t before;

    if (mapper == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    status = cairn_mapper_step(mapper, budget);
    if (status != CAIRN_OK || mapper->loop.graph == NULL)
        return status;
    before = budget->left;
    mapper->loop.closing = 1;
    status = cairn_mapper_loop_step(mapper, budget);
    if (status != CAIRN_MORE)
        mapper->loop.closing = 0;
    mapper->state.units += (int64_t)before - budget->left;
    return status;
}

/* ---- Readers ---- */

cairn_mapper_result cairn_mapper_read(const cairn_mapper *mapper)
{
    return mapper->result;
}

cairn_scan_view cairn_mapper_view(const cairn_mapper *mapper)
{
    return cairn_scan_read(mapper->scan);
}

cairn_pose cairn_mapper_key_pose(const cairn_mapper *mapper, int32_t key)
{
    return mapper->key_pose[key];
}

const cairn_scan_set *cairn_mapper_keys(const cairn_mapper *mapper)
{
    return mapper->keys;
}

cairn_pose cairn_mapper_map_odom(const cairn_mapper *mapper)
{
    if (!mapper->had_odometry)
        return cairn_pose_identity();
    return cairn_pose_compose(last_pose(mapper), cairn_pose_inverse(mapper->last_odometry));
}

cairn_mapper_loop cairn_mapper_loop_at(const cairn_mapper *mapper, int32_t index)
{
    return mapper->loop.events[index % MAPPER_LOOP_EVENTS];
}

cairn_mapper_state cairn_mapper_measure(const cairn_mapper *mapper)
{
    return mapper->state;
}
