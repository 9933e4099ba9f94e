/* Method: a point p of the later scan on a segment with normal n of the first one has the error e =
 * n (P p - a), with the relative pose P. A small motion d in the frame of the later scan turns it
 * into e + (n', p x n') d, n' being n in that frame. One Gauss-Newton step for each pair, with
 * robust weights (Cauchy) and the given relative pose as a prior, gives the measured pose P d, and
 * its normal equations are the information that a pose graph wants: both in the frame of the later
 * scan.
 *
 * Limits: errors of points count as independent, so that covariances are those of good segments;
 * a wall taken for another within the gate is not found out here. */
#include "src/core/build.h"

#include <string.h>

#include "firmware/joint.h"

enum { TILE = 16, COMPARED = 8 };

/* Cosine of the largest angle between the directions of two segments on one wall. */
#define SAME_WALL CAIRN_REAL(0.95)

joint_params joint_default(void)
{
    joint_params params = {
        64, 256, 512, 10, 3, CAIRN_REAL(0.1), CAIRN_REAL(0.02), CAIRN_REAL(0.1), CAIRN_REAL(0.05),
    };
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

static void carve(joint *x, cairn_pool *pool, const joint_params *params)
{
    x->poses = cairn_pool_take(pool, (size_t)params->max_scans, sizeof *x->poses);
    x->covariances = cairn_pool_take(pool, (size_t)params->max_scans, sizeof *x->covariances);
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

cairn_status joint_create(joint *x, cairn_pool *pool, const joint_params *params)
{
    cairn_pose_graph_params graph = graph_params(params);
    size_t need = joint_memory(params);

    if (need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    memset(x, 0, sizeof *x);
    x->params = *params;
    carve(x, pool, params);
    memset(x->covariances, 0, (size_t)params->max_scans * sizeof *x->covariances);
    return cairn_pose_graph_create(&x->graph, pool, &graph, NULL);
}

/* ---- Pairs of scans ---- */

static const cairn_scan_set_scan *first_scan(const joint *x)
{
    return &x->set->scans[x->first];
}

static const cairn_scan_set_scan *later_scan(const joint *x)
{
    return &x->set->scans[x->first + x->apart];
}

static int is_held(const joint *x, int32_t scan)
{
    return x->held != NULL && x->held[scan];
}

/* 1 when neither scan of the pair at hand can move. */
static int stands(const joint *x)
{
    return is_held(x, x->first) && is_held(x, x->first + x->apart);
}

static void begin_pair(joint *x)
{
    x->first_second = cairn_pose_between(x->poses[x->first], x->poses[x->first + x->apart]);
    x->transform = cairn_transform_of(x->first_second);
    x->segment = later_scan(x)->first_segment;
    x->other = first_scan(x)->first_segment;
    x->points = 0;
    x->information = cairn_sym3_zero();
    x->information.xx = x->information.yy = 1 / (x->params.spread * x->params.spread);
    x->information.zz = 1 / (x->params.spread_angle * x->params.spread_angle);
    memset(x->gradient, 0, sizeof x->gradient);
}

static cairn_status begin_round(joint *x)
{
    cairn_status status = CAIRN_OK;

    cairn_pose_graph_clear(x->graph);
    for (int32_t i = 0; i < x->count && status == CAIRN_OK; i++) {
        status = cairn_pose_graph_add_pose(x->graph, x->poses[i]);
        if (status == CAIRN_OK && is_held(x, i))
            status = cairn_pose_graph_fix(x->graph, i, 1);
    }
    x->first = 0;
    x->apart = 1;
    x->phase = JOINT_LINKS;
    if (x->count > 1)
        begin_pair(x);
    return status;
}

cairn_status joint_begin(joint *x, const cairn_scan_set *set, const cairn_pose *map_scan,
                         const uint8_t *held, int32_t count)
{
    if (count < 1)
        return CAIRN_EMPTY;
    if (count > x->params.max_scans)
        return CAIRN_FULL;
    memcpy(x->poses, map_scan, (size_t)count * sizeof *map_scan);
    memset(x->covariances, 0, (size_t)count * sizeof *x->covariances);
    x->set = set;
    x->held = held;
    x->count = count;
    x->round = 0;
    x->debt = 0;
    return begin_round(x);
}

/* A wall of the first scan. */
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

    w.normal = cairn_vec2_left(w.along);
    w.length = cairn_vec2_dot(w.along, cairn_vec2_sub(segment->segment.b, segment->segment.a));
    return w;
}

/* 1 when some points of the segment may lie on the other one. */
static int may_share(const joint *x, const cairn_scan_set_segment *segment,
                     const cairn_scan_set_segment *other)
{
    cairn_vec2 direction = cairn_transform_direction(x->transform, segment->direction);
    cairn_vec2 a, b, normal = cairn_vec2_left(other->direction);
    cairn_real of_a, of_b;

    if (cairn_vec2_dot(direction, other->direction) < SAME_WALL)
        return 0;
    a = cairn_vec2_sub(cairn_transform_point(x->transform, segment->segment.a), other->segment.a);
    b = cairn_vec2_sub(cairn_transform_point(x->transform, segment->segment.b), other->segment.a);
    of_a = cairn_vec2_dot(normal, a);
    of_b = cairn_vec2_dot(normal, b);
    return cairn_min(of_a, of_b) <= x->params.gate && cairn_max(of_a, of_b) >= -x->params.gate;
}

static void add_point(joint *x, const wall *w, cairn_vec2 p)
{
    cairn_vec2 from_start = cairn_vec2_sub(cairn_transform_point(x->transform, p), w->start), n;
    cairn_real along = cairn_vec2_dot(w->along, from_start),
               error = cairn_vec2_dot(w->normal, from_start);
    cairn_real sigma = x->params.sigma, width = 3 * sigma, row[3], weight;

    if (!(along >= 0 && along <= w->length && cairn_abs(error) <= x->params.gate))
        return;
    n.x = x->transform.cosine * w->normal.x + x->transform.sine * w->normal.y;
    n.y = x->transform.cosine * w->normal.y - x->transform.sine * w->normal.x;
    row[0] = n.x;
    row[1] = n.y;
    row[2] = cairn_vec2_cross(p, n);
    weight = 1 / (sigma * sigma * (1 + error * error / (width * width)));
    cairn_sym3_add_outer(&x->information, row, weight);
    for (int32_t k = 0; k < 3; k++)
        x->gradient[k] += weight * error * row[k];
    x->points++;
}

/* Compares a few segments of the first scan with one of the later scan; adds the points of the
 * first that may share a wall with it. Returns the units. */
static int32_t look(joint *x)
{
    const cairn_scan_set_segment *segment = &x->set->segments[x->segment];
    int32_t count = segment->end_point - segment->first_point, end = first_scan(x)->end_segment,
            shared = -1;

    for (int32_t i = 0; i < COMPARED && x->other < end && shared < 0; i++, x->other++)
        if (may_share(x, segment, &x->set->segments[x->other]))
            shared = x->other;
    if (shared >= 0) {
        wall w = wall_of(&x->set->segments[shared]);
        cairn_vec2 points[TILE];

        for (int32_t from = 0; from < count; from += TILE) {
            int32_t some = count - from < TILE ? count - from : TILE;

            cairn_scan_set_read(x->set, x->segment, from, some, points);
            for (int32_t i = 0; i < some; i++)
                add_point(x, &w, points[i]);
        }
    }
    if (x->other == end) {
        x->segment++;
        x->other = first_scan(x)->first_segment;
    }
    return 2 + (shared >= 0 ? 2 + count / 2 : 0);
}

/* The link of the pair at hand, when it has one. */
static cairn_status add_link(joint *x)
{
    cairn_real step[3];
    cairn_pose measured;
    cairn_status status;

    if ((x->points < x->params.min_points && x->apart > 1) ||
        !cairn_sym3_solve(x->information, x->gradient, step))
        return CAIRN_OK;
    measured.x = -step[0];
    measured.y = -step[1];
    measured.theta = -step[2];
    status =
        cairn_pose_graph_add_link(x->graph, x->first, x->first + x->apart,
                                  cairn_pose_compose(x->first_second, measured), x->information);
    return status == CAIRN_FULL && x->apart > 1 ? CAIRN_OK : status;
}

/* One item of the search for links. */
static cairn_status find_links(joint *x)
{
    cairn_status status = CAIRN_OK;

    if (x->apart >= x->count) {
        x->debt = 1 + (x->count + cairn_pose_graph_read(x->graph).links) / 2;
        x->phase = JOINT_SOLVE;
        return cairn_pose_graph_solve(x->graph);
    }
    if (!stands(x) && x->segment < later_scan(x)->end_segment &&
        first_scan(x)->first_segment < first_scan(x)->end_segment) {
        x->debt = look(x);
        return CAIRN_OK;
    }
    x->debt = stands(x) ? 2 : 8;
    if (!stands(x))
        status = add_link(x);
    if (++x->first + x->apart >= x->count) {
        x->first = 0;
        x->apart++;
    }
    if (x->apart < x->count)
        begin_pair(x);
    return status;
}

/* ---- The graph ---- */

/* The solution has ended. */
static cairn_status take_poses(joint *x)
{
    cairn_pose_graph_verdict verdict = cairn_pose_graph_read(x->graph).verdict;

    if (verdict != CAIRN_POSE_GRAPH_CONVERGED && verdict != CAIRN_POSE_GRAPH_OUT_OF_ITERATIONS) {
        x->phase = JOINT_IDLE;
        return CAIRN_OK;
    }
    for (int32_t i = 0; i < x->count; i++)
        x->poses[i] = cairn_pose_graph_pose(x->graph, i);
    if (++x->round < x->params.rounds)
        return begin_round(x);
    x->phase = JOINT_MARGINALS;
    return cairn_pose_graph_marginals(x->graph);
}

static cairn_status take_covariances(joint *x)
{
    cairn_status status = CAIRN_OK;

    for (int32_t i = 0; i < x->count && status == CAIRN_OK; i++)
        status = cairn_pose_graph_covariance(x->graph, i, i, x->covariances[i]);
    x->phase = JOINT_IDLE;
    return status;
}

static cairn_status solve(joint *x, cairn_budget *budget)
{
    cairn_status status = cairn_pose_graph_step(x->graph, budget);

    if (status != CAIRN_OK)
        return status;
    x->debt = 1 + x->count;
    return x->phase == JOINT_SOLVE ? take_poses(x) : take_covariances(x);
}

cairn_status joint_step(joint *x, cairn_budget *budget)
{
    while (x->debt > 0 || x->phase != JOINT_IDLE) {
        cairn_status status = CAIRN_OK;

        if (budget->left <= 0)
            return CAIRN_MORE;
        if (x->debt > 0) {
            int32_t paid = x->debt < budget->left ? x->debt : budget->left;

            x->debt -= paid;
            budget->left -= paid;
        } else if (x->phase == JOINT_LINKS) {
            status = find_links(x);
        } else {
            status = solve(x, budget);
        }
        if (status != CAIRN_OK)
            return status;
    }
    return CAIRN_OK;
}
