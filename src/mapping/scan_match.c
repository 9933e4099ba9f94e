/* Scan matching.
 *
 * Method. Search: all pairs of points of like direction vote for a position, heading by heading
 * (scan_match_vote.c). The peaks, those of neighbouring headings as one, are refined in stages
 * (scan_match_fit.c): few points and wide gates first, at the end every beam. After each stage the
 * poses are scored by what they explain and what speaks against them, poses that have met are
 * joined, and the worse ones are left behind (scan_match_rank.c). The verdict is a measured rule
 * over the scores of the last ones.
 *
 * Layout: the target's points in the order in which they came; sorted by cell (scan_match_index.c);
 * their positions sorted by direction and strips of their box (scan_match_spots.c). Both are made
 * at the first match after the target changed. Of beams, the least range by bearing is kept
 * (scan_match_free.c).
 *
 * The number of operations is bounded: by the points of query and target that vote, by the number
 * of headings, and by fixed numbers of candidates, iterations and points of each stage.
 *
 * Limits: positions farther than 256 cells of two spacings apart are not searched. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/scan_match_shape.h"

enum { POINTS_MOST = 1 << 20, VIEWS_MOST = 4096, HYPOTHESES_MOST = 64, CANDIDATES_MOST = 1024 };

enum { WRITTEN_READINGS = 1604 }; /* of a scan in the thesis: 4 x 401 */

/* m: cells as small as that can still be counted */
static const cairn_real LEAST_SPACING = CAIRN_REAL(1e-3);

cairn_scan_match_params cairn_scan_match_default(void)
{
    cairn_scan_match_params params = {CAIRN_SCAN_MATCH_CORRELATIVE,
                                      2048,
                                      4096,
                                      16,
                                      1024,
                                      8,
                                      128,
                                      MATCH_CELLS_MOST,
                                      1,
                                      CAIRN_REAL(0.1),
                                      CAIRN_REAL(0.01),
                                      CAIRN_REAL(0.001)};
    return params;
}

cairn_scan_match_params cairn_scan_match_as_written(void)
{
    cairn_scan_match_params params = cairn_scan_match_default();

    params.mode = CAIRN_SCAN_MATCH_AS_WRITTEN;
    params.max_target = 3 * WRITTEN_READINGS;
    params.max_query = WRITTEN_READINGS;
    params.max_dense = params.max_views = 0;
    params.max_hypotheses = params.max_candidates = 1;
    return params;
}

static int is_positive(cairn_real v)
{
    return v > 0 && v <= CAIRN_SCAN_EXTENT;
}

static int is_within(int32_t n, int32_t least, int32_t most)
{
    return n >= least && n <= most;
}

static int params_are_good(const cairn_scan_match_params *p)
{
    return p != NULL &&
           is_within(p->mode, CAIRN_SCAN_MATCH_CORRELATIVE, CAIRN_SCAN_MATCH_AS_WRITTEN_LINES) &&
           is_within(p->max_target, 1, POINTS_MOST) && is_within(p->max_dense, 0, POINTS_MOST) &&
           is_within(p->max_views, 0, VIEWS_MOST) && is_within(p->max_query, 1, POINTS_MOST) &&
           is_within(p->max_hypotheses, 1, HYPOTHESES_MOST) &&
           is_within(p->max_candidates, 1, CANDIDATES_MOST) &&
           is_within(p->max_cells, MATCH_CELLS_LEAST, MATCH_CELLS_MOST) &&
           is_within(p->once, 0, 1) && is_positive(p->spacing) && p->spacing >= LEAST_SPACING &&
           is_positive(p->sigma) && p->weak_ratio >= 0 && p->weak_ratio < 1;
}

static cairn_sequence_params sequence_params(const cairn_scan_match_params *p)
{
    cairn_sequence_params params = {CAIRN_SEQUENCE_COMMON, p->max_query, p->max_target, 0};

    return params;
}

/* What only matching by shape needs, but for its sequence; NULL from a counting pool. */
static match_shape *carve_shape(cairn_pool *pool, const cairn_scan_match_params *p)
{
    match_shape *shape = cairn_pool_take(pool, 1, sizeof *shape);
    match_shape made;

    memset(&made, 0, sizeof made);
    made.target = cairn_pool_take(pool, (size_t)p->max_target, sizeof *made.target);
    made.query = cairn_pool_take(pool, (size_t)p->max_query, sizeof *made.query);
    made.part_of = cairn_pool_take(pool, (size_t)p->max_target, sizeof *made.part_of);
    made.turned = cairn_pool_take(pool, (size_t)p->max_query, sizeof *made.turned);
    made.pairs = cairn_pool_take(pool, (size_t)p->max_query, sizeof *made.pairs);
    made.segments = cairn_pool_take(pool, (size_t)p->max_query + 1, sizeof *made.segments);
    if (shape != NULL)
        *shape = made;
    return shape;
}

/* The object with its arrays; NULL from a counting pool. */
static cairn_scan_match *carve(cairn_pool *pool, const cairn_scan_match_params *p)
{
    size_t cells = p->mode == CAIRN_SCAN_MATCH_CORRELATIVE ? (size_t)p->max_cells : 0;
    cairn_scan_match *x = cairn_pool_take_one(pool, sizeof *x);
    cairn_scan_match made;

    memset(&made, 0, sizeof made);
    made.params = *p;
    made.target = cairn_pool_take(pool, (size_t)p->max_target, sizeof *made.target);
    made.dense = cairn_pool_take(pool, (size_t)p->max_dense, sizeof *made.dense);
    made.dense_index.points =
        cairn_pool_take(pool, (size_t)p->max_dense, sizeof *made.dense_index.points);
    made.dense_index.start = cairn_pool_take(pool, cairn_match_index_cells(p->max_dense) + 1,
                                             sizeof *made.dense_index.start);
    made.views = cairn_pool_take(pool, (size_t)p->max_views, sizeof *made.views);
    made.query_profile = cairn_pool_take_one(pool, sizeof *made.query_profile);
    made.index.points = cairn_pool_take(pool, (size_t)p->max_target, sizeof *made.index.points);
    made.index.start =
        cairn_pool_take(pool, cairn_match_index_cells(p->max_target) + 1, sizeof *made.index.start);
    made.by_direction =
        cairn_pool_take(pool, cells > 0 ? (size_t)p->max_target : 0, sizeof *made.by_direction);
    made.query_turn = cairn_pool_take(pool, cells > 0 ? MATCH_VOTERS : 0, sizeof *made.query_turn);
    made.votes.cell = cairn_pool_take(pool, cells, sizeof *made.votes.cell);
    made.votes.touched = cairn_pool_take(pool, cells, sizeof *made.votes.touched);
    made.candidates = cairn_pool_take(pool, (size_t)p->max_candidates, sizeof *made.candidates);
    made.hypotheses = cairn_pool_take(pool, (size_t)p->max_candidates, sizeof *made.hypotheses);
    if (p->mode != CAIRN_SCAN_MATCH_CORRELATIVE)
        made.shape = carve_shape(pool, p);
    if (x != NULL)
        *x = made;
    return x;
}

size_t cairn_scan_match_memory(const cairn_scan_match_params *params)
{
    cairn_pool counting;

    if (!params_are_good(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    if (params->mode != CAIRN_SCAN_MATCH_CORRELATIVE) {
        cairn_sequence_params sequence = sequence_params(params);

        cairn_pool_count(&counting, cairn_sequence_memory(&sequence));
    }
    return cairn_pool_counted(&counting);
}

cairn_status cairn_scan_match_create(cairn_scan_match **match, cairn_pool *pool,
                                     const cairn_scan_match_params *params)
{
    size_t need = cairn_scan_match_memory(params);
    cairn_sequence_params sequence;
    cairn_scan_match *made;

    if (match == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve(pool, params);
    if (made->shape == NULL)
        memset(made->votes.cell, 0, (size_t)params->max_cells * sizeof *made->votes.cell);
    cairn_scan_match_clear_target(made);
    *match = made;
    if (made->shape == NULL)
        return CAIRN_OK;
    sequence = sequence_params(params);
    return cairn_sequence_create(&made->shape->sequence, pool, &sequence);
}

cairn_scan_match_part cairn_scan_match_part_of(const cairn_scan_view *view)
{
    cairn_scan_match_part part = {view->points,      NULL, view->beams,
                                  view->point_count, 0,    view->beam_count};

    return part;
}

static void stop(cairn_scan_match *x)
{
    for (int32_t i = 0; i < x->votes.touched_count; i++)
        x->votes.cell[x->votes.touched[i]] = 0;
    x->votes.touched_count = 0;
    x->phase = MATCH_IDLE;
    x->owed = 0;
    memset(&x->result, 0, sizeof x->result);
}

void cairn_scan_match_clear_target(cairn_scan_match *x)
{
    stop(x);
    x->target_count = x->dense_count = x->view_count = x->part_count = 0;
    x->lacks_dense = 0;
    x->is_indexed = 0;
    if (x->shape != NULL)
        x->shape->overlap_gate = 0;
    x->target_low.x = x->target_low.y = CAIRN_SCAN_EXTENT;
    x->target_high.x = x->target_high.y = -CAIRN_SCAN_EXTENT;
    x->target_sum.x = x->target_sum.y = 0;
}

/* ---- What comes in ---- */

static int is_near(cairn_vec2 p)
{
    return cairn_abs(p.x) <= CAIRN_SCAN_EXTENT && cairn_abs(p.y) <= CAIRN_SCAN_EXTENT;
}

static cairn_status check_points(const cairn_oriented_point *points, int32_t count,
                                 cairn_fault *fault)
{
    for (int32_t i = 0; i < count; i++) {
        cairn_real norm = cairn_vec2_norm_squared(points[i].direction);

        if (!is_near(points[i].position) || norm != norm)
            return cairn_refuse(fault, i, "a point is not finite or too far away",
                                CAIRN_NOT_FINITE);
        if (!(norm > CAIRN_REAL(0.98) && norm < CAIRN_REAL(1.02)))
            return cairn_refuse(fault, i, "a direction is not of length 1", CAIRN_BAD_ARGUMENT);
    }
    return CAIRN_OK;
}

static int is_array(const void *array, int32_t count)
{
    return count >= 0 && (array != NULL || count == 0);
}

static cairn_status check_part(const cairn_scan_match_part *part, cairn_pose pose,
                               cairn_fault *fault)
{
    cairn_status status;

    if (!is_array(part->points, part->count) || !is_array(part->dense, part->dense_count) ||
        !is_array(part->beams, part->beam_count))
        return cairn_refuse(fault, -1, "a negative count, or no array", CAIRN_BAD_ARGUMENT);
    if (!cairn_pose_is_finite(pose) || cairn_abs(pose.x) > CAIRN_SCAN_EXTENT ||
        cairn_abs(pose.y) > CAIRN_SCAN_EXTENT)
        return cairn_refuse(fault, -1, "the pose is not finite or too far away", CAIRN_NOT_FINITE);
    status = check_points(part->points, part->count, fault);
    if (status == CAIRN_OK)
        status = check_points(part->dense, part->dense_count, fault);
    for (int32_t i = 0; i < part->beam_count && status == CAIRN_OK; i++)
        if (!is_near(part->beams[i].from) || !is_near(part->beams[i].to))
            status = cairn_refuse(fault, i, "a beam is not finite or too long", CAIRN_NOT_FINITE);
    return status;
}

/* The free space of a part; 0 when none of its beams says anything. */
static int32_t make_profile(match_profile *profile, const cairn_scan_match_part *part,
                            cairn_transform transform)
{
    int32_t known = 0;

    for (int32_t i = 0; i < part->beam_count; i++) {
        const cairn_beam *beam = &part->beams[i];

        if (beam->kind == CAIRN_BEAM_UNKNOWN)
            continue;
        if (!known)
            cairn_match_profile_clear(profile, cairn_transform_point(transform, beam->from));
        known = 1;
        cairn_match_profile_add(profile, cairn_transform_point(transform, beam->to));
    }
    return known;
}

cairn_status cairn_scan_match_add_target(cairn_scan_match *x, const cairn_scan_match_part *part,
                                         cairn_pose target_part, cairn_fault *fault)
{
    cairn_transform transform;
    cairn_status status;

    if (x == NULL || part == NULL)
        return cairn_refuse(fault, -1, "no object or no part", CAIRN_BAD_ARGUMENT);
    if (x->phase != MATCH_IDLE && x->phase != MATCH_DONE)
        return cairn_refuse(fault, -1, "a match is running", CAIRN_BAD_ARGUMENT);
    status = check_part(part, target_part, fault);
    if (status != CAIRN_OK)
        return status;
    if (part->count > x->params.max_target - x->target_count)
        return cairn_refuse(fault, -1, "more target points than max_target", CAIRN_FULL);
    if (x->params.max_dense > 0 && part->dense_count > x->params.max_dense - x->dense_count)
        return cairn_refuse(fault, -1, "more dense target points than max_dense", CAIRN_FULL);
    if (part->beam_count > 0 && x->params.max_views > 0 && x->view_count == x->params.max_views)
        return cairn_refuse(fault, -1, "more parts with beams than max_views", CAIRN_FULL);
    transform = cairn_transform_of(target_part);
    for (int32_t i = 0; i < part->count; i++) {
        cairn_oriented_point *p = &x->target[x->target_count];

        if (x->shape != NULL)
            x->shape->part_of[x->target_count] = x->part_count;
        x->target_count++;
        p->position = cairn_transform_point(transform, part->points[i].position);
        p->direction = cairn_transform_direction(transform, part->points[i].direction);
        x->target_low.x = cairn_min(x->target_low.x, p->position.x);
        x->target_low.y = cairn_min(x->target_low.y, p->position.y);
        x->target_high.x = cairn_max(x->target_high.x, p->position.x);
        x->target_high.y = cairn_max(x->target_high.y, p->position.y);
        x->target_sum = cairn_vec2_add(x->target_sum, p->position);
    }
    for (int32_t i = 0; i < part->dense_count && x->params.max_dense > 0; i++) {
        cairn_oriented_point *p = &x->dense[x->dense_count++];

        p->position = cairn_transform_point(transform, part->dense[i].position);
        p->direction = cairn_transform_direction(transform, part->dense[i].direction);
    }
    if (x->params.max_views > 0)
        x->view_count += make_profile(&x->views[x->view_count], part, transform);
    if (part->dense_count == 0 && part->count > 0)
        x->lacks_dense = 1;
    x->part_count++;
    x->is_indexed = 0;
    return CAIRN_OK;
}

/* Centroid, size and reach of the query. */
static void measure_query(cairn_scan_match *x)
{
    const cairn_scan_match_part *q = &x->query;
    cairn_real n = (cairn_real)q->count, squares = 0;

    x->centroid.x = x->centroid.y = 0;
    x->query_reach = 0;
    for (int32_t i = 0; i < q->count; i++) {
        x->centroid = cairn_vec2_add(x->centroid, cairn_vec2_scale(q->points[i].position, 1 / n));
        x->query_reach = cairn_max(x->query_reach, cairn_vec2_norm(q->points[i].position));
    }
    for (int32_t i = 0; i < q->count; i++)
        squares += cairn_vec2_norm_squared(cairn_vec2_sub(q->points[i].position, x->centroid));
    x->radius = cairn_max(cairn_sqrt(squares / cairn_max(n, 1)), x->params.spacing);
}

/* The window as a prior: uniform in it, so that what the scans do not tell stays at the start. */
static void take_window(cairn_scan_match *x, cairn_pose start,
                        const cairn_scan_match_window *window)
{
    const cairn_real share = CAIRN_REAL(0.577), least = CAIRN_REAL(0.1) * x->params.spacing;

    x->has_window = window != NULL;
    if (window == NULL)
        return;
    x->window = *window;
    x->start = start;
    x->prior.mean = start;
    x->prior.sigma_x = x->prior.sigma_y =
        cairn_max(share * cairn_min(window->distance, CAIRN_SCAN_EXTENT), least);
    x->prior.sigma_theta = cairn_max(share * cairn_min(window->angle, CAIRN_PI), CAIRN_REAL(0.01));
}

/* Checks a query and makes it the one at work; MATCH_DONE when there is nothing to match. */
static cairn_status take_query(cairn_scan_match *x, const cairn_scan_match_part *query,
                               cairn_pose start, cairn_fault *fault)
{
    cairn_status status = check_part(query, start, fault);

    if (status != CAIRN_OK)
        return status;
    if (query->count > x->params.max_query)
        return cairn_refuse(fault, -1, "more query points than max_query", CAIRN_FULL);
    stop(x);
    memset(&x->measure, 0, sizeof x->measure);
    x->query = *query;
    x->query_sees =
        make_profile(x->query_profile, query, cairn_transform_of(cairn_pose_identity()));
    x->candidate_count = x->hypothesis_count = 0;
    x->at = x->other = x->stage = 0;
    if (query->count == 0 || x->target_count == 0) {
        x->result.hypotheses = x->hypotheses;
        x->result.verdict = CAIRN_SCAN_MATCH_NONE;
        x->phase = MATCH_DONE;
    }
    return CAIRN_OK;
}

cairn_status cairn_scan_match_begin(cairn_scan_match *x, const cairn_scan_match_part *query,
                                    cairn_pose start, const cairn_scan_match_window *window,
                                    cairn_fault *fault)
{
    cairn_status status;

    if (x == NULL || query == NULL)
        return cairn_refuse(fault, -1, "no object or no query", CAIRN_BAD_ARGUMENT);
    if (window != NULL && !(window->distance >= 0 && window->angle >= 0))
        return cairn_refuse(fault, -1, "a window is negative or not a number", CAIRN_BAD_ARGUMENT);
    if (window == NULL)
        start = cairn_pose_identity();
    status = take_query(x, query, start, fault);
    if (status != CAIRN_OK)
        return status;
    if (x->phase == MATCH_DONE)
        return CAIRN_OK;
    measure_query(x);
    take_window(x, start, window);
    cairn_match_start(x);
    return CAIRN_OK;
}

cairn_status cairn_scan_match_begin_icp(cairn_scan_match *x, const cairn_scan_match_part *query,
                                        cairn_pose start, cairn_fault *fault)
{
    cairn_status status;

    if (x == NULL || query == NULL)
        return cairn_refuse(fault, -1, "no object or no query", CAIRN_BAD_ARGUMENT);
    if (!cairn_match_is_as_written(x) || !cairn_match_has_icp(x))
        return cairn_refuse(fault, -1, "the mode has no ICP of its own", CAIRN_BAD_ARGUMENT);
    status = take_query(x, query, start, fault);
    if (status != CAIRN_OK)
        return status;
    if (x->phase == MATCH_DONE)
        return CAIRN_OK;
    measure_query(x);
    take_window(x, start, NULL);
    cairn_match_start_icp(x, start);
    return CAIRN_OK;
}

cairn_scan_match_result cairn_scan_match_read(const cairn_scan_match *x)
{
    cairn_scan_match_result running = {NULL, 0, CAIRN_SCAN_MATCH_RUNNING};

    return x->phase == MATCH_DONE && x->owed < MATCH_PART ? x->result : running;
}

cairn_scan_match_measure cairn_scan_match_measured(const cairn_scan_match *x)
{
    return x->measure;
}
