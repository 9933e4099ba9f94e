/* Joint optimization of all poses by a pose graph with links from point-to-line registration.
 *
 * Method: 1. A point p of the later scan on a segment with normal n of the first scan has the
 * residual e = n (P p - a), with the relative pose P. A small motion d in the frame of the later
 * scan changes it to e + (n', p x n') d (the Jacobian), with n' = n in that frame.
 * 2. One Gauss-Newton step per pair, with Cauchy weights and the given relative pose as a prior,
 *    gives the measured pose P d. Its normal equations are the information matrix of the link, in
 *    the frame of the later scan.
 * 3. The pose graph of all links is solved; steps 1 to 3 are repeated, then the covariances are
 *    computed.
 *
 * Limits: errors of points count as independent, so that covariances hold for well-fitted segments;
 * a wrong correspondence within the gate is not rejected. */
#include "src/base/build.h"

#include <string.h>

#include "firmware/joint.h"

enum { POINT_TILE = 16, SEGMENTS_PER_STEP = 8 };

/* Minimum cosine of the angle between the directions of two segments on one wall. */
#define MIN_WALL_COSINE CAIRN_REAL(0.95)

joint_params joint_default(void)
{
    joint_params params = {.max_scans = 64,
                           .max_links = 256,
                           .max_fill = 512,
                           .min_points = 10,
                           .rounds = 3,
                           .gate = CAIRN_REAL(0.1),
                           .sigma = CAIRN_REAL(0.02),
                           .spread = CAIRN_REAL(0.1),
                           .spread_angle = CAIRN_REAL(0.05)};
    return params;
}

static cairn_pose_graph_params graph_params(const joint_params *params)
{
    cairn_pose_graph_params graph = cairn_pose_graph_default();

    graph.max_poses = params->max_scans;
    graph.max_links = params->max_links;
    graph.max_fill = params->max_fill;
    graph.start = CAIRN_POSE_GRAPH_GIVEN;
    graph.kernel = CAIRN_POSE_GRAPH_CAUCHY;
    return graph;
}

static void carve(joint *optimizer, cairn_pool *pool, const joint_params *params)
{
    optimizer->poses = cairn_pool_take(pool, (size_t)params->max_scans, sizeof *optimizer->poses);
    optimizer->covariances =
        cairn_pool_take(pool, (size_t)params->max_scans, sizeof *optimizer->covariances);
}

size_t joint_memory(const joint_params *params)
{
    cairn_pose_graph_params graph = graph_params(params);
    cairn_pool counting;
    joint layout;

    if (params->max_scans < 1 || params->max_links < params->max_scans)
        return 0;
    cairn_pool_init_counting(&counting);
    carve(&layout, &counting, params);
    cairn_pool_count(&counting, cairn_pose_graph_memory(&graph, NULL));
    return cairn_pool_counted(&counting);
}

cairn_status joint_create(joint *optimizer, cairn_pool *pool, const joint_params *params)
{
    cairn_pose_graph_params graph = graph_params(params);
    size_t need = joint_memory(params);

    if (need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_capacity(pool, need))
        return CAIRN_NO_MEMORY;
    memset(optimizer, 0, sizeof *optimizer);
    optimizer->params = *params;
    carve(optimizer, pool, params);
    memset(optimizer->covariances, 0, (size_t)params->max_scans * sizeof *optimizer->covariances);
    return cairn_pose_graph_create(&optimizer->graph, pool, &graph, NULL);
}

/* ---- Pairs of scans ---- */

static const cairn_scan_set_scan *first_scan(const joint *optimizer)
{
    return &optimizer->set->scans[optimizer->first];
}

static const cairn_scan_set_scan *later_scan(const joint *optimizer)
{
    return &optimizer->set->scans[optimizer->first + optimizer->index_gap];
}

static int is_fixed(const joint *optimizer, int32_t scan)
{
    return optimizer->fixed != NULL && optimizer->fixed[scan];
}

/* Returns 1 when both scans of the current pair are fixed. */
static int is_fixed_pair(const joint *optimizer)
{
    return is_fixed(optimizer, optimizer->first) &&
           is_fixed(optimizer, optimizer->first + optimizer->index_gap);
}

static void begin_pair(joint *optimizer)
{
    optimizer->first_second =
        cairn_pose_between(optimizer->poses[optimizer->first],
                           optimizer->poses[optimizer->first + optimizer->index_gap]);
    optimizer->transform = cairn_transform_of(optimizer->first_second);
    optimizer->segment = later_scan(optimizer)->first_segment;
    optimizer->other = first_scan(optimizer)->first_segment;
    optimizer->points = 0;
    optimizer->information = cairn_sym3_zero();
    optimizer->information.xx = optimizer->information.yy =
        1 / (optimizer->params.spread * optimizer->params.spread);
    optimizer->information.zz =
        1 / (optimizer->params.spread_angle * optimizer->params.spread_angle);
    memset(optimizer->gradient, 0, sizeof optimizer->gradient);
}

static cairn_status begin_round(joint *optimizer)
{
    cairn_status status = CAIRN_OK;

    cairn_pose_graph_clear(optimizer->graph);
    for (int32_t i = 0; i < optimizer->count && status == CAIRN_OK; i++) {
        status = cairn_pose_graph_add_pose(optimizer->graph, optimizer->poses[i]);
        if (status == CAIRN_OK && is_fixed(optimizer, i))
            status = cairn_pose_graph_fix(optimizer->graph, i, 1);
    }
    optimizer->first = 0;
    optimizer->index_gap = 1;
    optimizer->phase = JOINT_LINKS;
    if (optimizer->count > 1)
        begin_pair(optimizer);
    return status;
}

cairn_status joint_begin(joint *optimizer, const cairn_scan_set *set, const cairn_pose *map_scan,
                         const uint8_t *fixed, int32_t count)
{
    if (count < 1)
        return CAIRN_EMPTY;
    if (count > optimizer->params.max_scans)
        return CAIRN_FULL;
    memcpy(optimizer->poses, map_scan, (size_t)count * sizeof *map_scan);
    memset(optimizer->covariances, 0, (size_t)count * sizeof *optimizer->covariances);
    optimizer->set = set;
    optimizer->fixed = fixed;
    optimizer->count = count;
    optimizer->round = 0;
    optimizer->pending_units = 0;
    return begin_round(optimizer);
}

/* A wall of the first scan: a segment as a line with normal and length, m. */
typedef struct wall {
    cairn_vec2 start, along, normal;
    cairn_real length;
} wall;

static wall wall_of(const cairn_scan_set_segment *segment)
{
    wall w = {segment->segment.a,
              cairn_vec2_unit(cairn_vec2_sub(segment->segment.b, segment->segment.a)),
              {0, 0},
              0};

    w.normal = cairn_vec2_left_perp(w.along);
    w.length = cairn_vec2_dot(w.along, cairn_vec2_sub(segment->segment.b, segment->segment.a));
    return w;
}

/* Returns 1 when points of the segment may lie on the other segment: similar direction, and within
 * the gate. */
static int may_share(const joint *optimizer, const cairn_scan_set_segment *segment,
                     const cairn_scan_set_segment *other)
{
    cairn_vec2 direction = cairn_transform_direction(optimizer->transform, segment->direction);
    cairn_vec2 a, b, normal = cairn_vec2_left_perp(other->direction);
    cairn_real of_a, of_b;

    if (cairn_vec2_dot(direction, other->direction) < MIN_WALL_COSINE)
        return 0;
    a = cairn_vec2_sub(cairn_transform_point(optimizer->transform, segment->segment.a),
                       other->segment.a);
    b = cairn_vec2_sub(cairn_transform_point(optimizer->transform, segment->segment.b),
                       other->segment.a);
    of_a = cairn_vec2_dot(normal, a);
    of_b = cairn_vec2_dot(normal, b);
    return cairn_min(of_a, of_b) <= optimizer->params.gate &&
           cairn_max(of_a, of_b) >= -optimizer->params.gate;
}

static void add_point(joint *optimizer, const wall *w, cairn_vec2 p)
{
    cairn_vec2 from_start =
                   cairn_vec2_sub(cairn_transform_point(optimizer->transform, p), w->start),
               n;
    cairn_real along = cairn_vec2_dot(w->along, from_start),
               error = cairn_vec2_dot(w->normal, from_start);
    cairn_real sigma = optimizer->params.sigma, width = 3 * sigma, row[3], weight;

    if (!(along >= 0 && along <= w->length && cairn_abs(error) <= optimizer->params.gate))
        return;
    n = cairn_transform_inverse_direction(optimizer->transform, w->normal);
    row[0] = n.x;
    row[1] = n.y;
    row[2] = cairn_vec2_cross(p, n);
    weight = 1 / (sigma * sigma * (1 + error * error / (width * width)));
    cairn_sym3_add_outer(&optimizer->information, row, weight);
    for (int32_t k = 0; k < 3; k++)
        optimizer->gradient[k] += weight * error * row[k];
    optimizer->points++;
}

/* Compares SEGMENTS_PER_STEP segments of the first scan with the current segment of the later scan.
 * Adds the points of the later segment to the normal equations at the first match. Returns the work
 * units. */
static int32_t compare_segments(joint *optimizer)
{
    const cairn_scan_set_segment *segment = &optimizer->set->segments[optimizer->segment];
    int32_t count = segment->end_point - segment->first_point,
            end = first_scan(optimizer)->end_segment, shared = -1;

    for (int32_t i = 0; i < SEGMENTS_PER_STEP && optimizer->other < end && shared < 0;
         i++, optimizer->other++)
        if (may_share(optimizer, segment, &optimizer->set->segments[optimizer->other]))
            shared = optimizer->other;
    if (shared >= 0) {
        wall w = wall_of(&optimizer->set->segments[shared]);
        cairn_vec2 points[POINT_TILE];

        for (int32_t from = 0; from < count; from += POINT_TILE) {
            int32_t some = count - from < POINT_TILE ? count - from : POINT_TILE;

            cairn_scan_set_read(optimizer->set, optimizer->segment, from, some, points);
            for (int32_t i = 0; i < some; i++)
                add_point(optimizer, &w, points[i]);
        }
    }
    if (optimizer->other == end) {
        optimizer->segment++;
        optimizer->other = first_scan(optimizer)->first_segment;
    }
    return 2 + (shared >= 0 ? 2 + count / 2 : 0);
}

/* Adds the link of the current pair, when it has enough correspondences or is consecutive. */
static cairn_status add_link(joint *optimizer)
{
    cairn_real step[3];
    cairn_pose measured;
    cairn_status status;

    if ((optimizer->points < optimizer->params.min_points && optimizer->index_gap > 1) ||
        !cairn_sym3_solve(optimizer->information, optimizer->gradient, step))
        return CAIRN_OK;
    measured.x = -step[0];
    measured.y = -step[1];
    measured.theta = -step[2];
    status = cairn_pose_graph_add_link(
        optimizer->graph, optimizer->first, optimizer->first + optimizer->index_gap,
        cairn_pose_compose(optimizer->first_second, measured), optimizer->information);
    return status == CAIRN_FULL && optimizer->index_gap > 1 ? CAIRN_OK : status;
}

/* Performs one work item of the search for links. */
static cairn_status find_links(joint *optimizer)
{
    cairn_status status = CAIRN_OK;

    if (optimizer->index_gap >= optimizer->count) {
        optimizer->pending_units =
            1 + (optimizer->count + cairn_pose_graph_read(optimizer->graph).links) / 2;
        optimizer->phase = JOINT_SOLVE;
        return cairn_pose_graph_solve(optimizer->graph);
    }
    if (!is_fixed_pair(optimizer) && optimizer->segment < later_scan(optimizer)->end_segment &&
        first_scan(optimizer)->first_segment < first_scan(optimizer)->end_segment) {
        optimizer->pending_units = compare_segments(optimizer);
        return CAIRN_OK;
    }
    optimizer->pending_units = is_fixed_pair(optimizer) ? 2 : 8;
    if (!is_fixed_pair(optimizer))
        status = add_link(optimizer);
    if (++optimizer->first + optimizer->index_gap >= optimizer->count) {
        optimizer->first = 0;
        optimizer->index_gap++;
    }
    if (optimizer->index_gap < optimizer->count)
        begin_pair(optimizer);
    return status;
}

/* ---- The graph ---- */

/* Copies the poses after the solution of the graph; starts the next round or the covariances. */
static cairn_status take_poses(joint *optimizer)
{
    cairn_pose_graph_verdict verdict = cairn_pose_graph_read(optimizer->graph).verdict;

    if (verdict != CAIRN_POSE_GRAPH_CONVERGED && verdict != CAIRN_POSE_GRAPH_OUT_OF_ITERATIONS) {
        optimizer->phase = JOINT_IDLE;
        return CAIRN_OK;
    }
    for (int32_t i = 0; i < optimizer->count; i++)
        optimizer->poses[i] = cairn_pose_graph_pose(optimizer->graph, i);
    if (++optimizer->round < optimizer->params.rounds)
        return begin_round(optimizer);
    optimizer->phase = JOINT_MARGINALS;
    return cairn_pose_graph_marginals(optimizer->graph);
}

static cairn_status take_covariances(joint *optimizer)
{
    cairn_status status = CAIRN_OK;

    for (int32_t i = 0; i < optimizer->count && status == CAIRN_OK; i++)
        status = cairn_pose_graph_covariance(optimizer->graph, i, i, optimizer->covariances[i]);
    optimizer->phase = JOINT_IDLE;
    return status;
}

static cairn_status solve(joint *optimizer, cairn_budget *budget)
{
    cairn_status status = cairn_pose_graph_step(optimizer->graph, budget);

    if (status != CAIRN_OK)
        return status;
    optimizer->pending_units = 1 + optimizer->count;
    return optimizer->phase == JOINT_SOLVE ? take_poses(optimizer) : take_covariances(optimizer);
}

cairn_status joint_step(joint *optimizer, cairn_budget *budget)
{
    while (optimizer->pending_units > 0 || optimizer->phase != JOINT_IDLE) {
        cairn_status status = CAIRN_OK;

        if (budget->left <= 0)
            return CAIRN_MORE;
        if (optimizer->pending_units > 0) {
            int32_t charged =
                optimizer->pending_units < budget->left ? optimizer->pending_units : budget->left;

            optimizer->pending_units -= charged;
            budget->left -= charged;
        } else if (optimizer->phase == JOINT_LINKS) {
            status = find_links(optimizer);
        } else {
            status = solve(optimizer, budget);
        }
        if (status != CAIRN_OK)
            return status;
    }
    return CAIRN_OK;
}
