/* Lu and Milios.
 *
 * Method: a small motion (t, phi) of a scan about the map's centre c moves its point p by t + phi
 * (p - c) turned left, to first order M (t, phi) with M = [1 0 -y; 0 1 x]. Pairs (a_k, b_k) of the
 * scans i and j at m_k = (a_k + b_k) / 2 with z_k = a_k - b_k then ask for the difference of their
 * motions
 *
 *     D = -(M^T M)^-1 M^T Z,  covariance C = s^2 (M^T M)^-1,  s^2 = |Z + M D|^2 / (2 n - 3)
 *
 * and W = sum (xi_i - xi_j - D)^T C^-1 (xi_i - xi_j - D) is least for the solution of G xi = B,
 * where G has the C^-1 of links and B the C^-1 D = -M^T Z / s^2: D itself is needed for s^2 alone.
 *
 * Registration (lum_register.c) is no part of Lu and Milios: it brings the scans near enough for
 * the links to be right.
 *
 * Layout: the points of each scan lie in buckets by the hash of their search cells, in the scan's
 * own frame, so that they never move: heads[2 first ... ] of a scan whose points begin at `first`,
 * two buckets a point.
 *
 * Limits: nearest points need not be the same places, and a link whose wrong pairs agree by chance
 * is believed: from errors of more than a few degrees the scans often come to rest in a wrong
 * place. Points that are spaced evenly lock into each other at half their spacing.
 *
 * Source: Lu and Milios, Globally consistent range scan alignment for environment mapping, 1997;
 * Adluru 2008, chapter 10. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/lum_work.h"

enum { MAX_SCANS = 1 << 16, MAX_POINTS = 1 << 24, MAX_LINKS = 1 << 24 };

static const cairn_real FARTHEST = CAIRN_REAL(1e6);

/* m: standard deviation of a pair of points below which one is not believed to be, as written:
 * pairs that fit exactly have none. */
static const cairn_real LEAST_SIGMA = CAIRN_REAL(0.0001);

cairn_lum_params cairn_lum_default(void)
{
    cairn_lum_params params = {
        .max_scans = 64,
        .max_points = 8192,
        .max_links = 2016,
        .max_fill = 2016,
        .min_pairs = 5,
        .max_iterations = 500,
        .rebuild = 0,
        .distance = CAIRN_REAL(0.2),
        .direction_gate = CAIRN_PI / 3,
        .sigma = CAIRN_REAL(0.02),
        .converged = CAIRN_REAL(0.0001),
        .registers = 0,
        .mode = CAIRN_MODE_DEFAULT,
        .register_gate = CAIRN_REAL(0.7),
        .register_turn = CAIRN_PI / 18,
        .register_spacing = CAIRN_REAL(0.08),
    };
    return params;
}

/* The params with what the mode leaves no choice of. */
static cairn_lum_params in_mode(const cairn_lum_params *params)
{
    cairn_lum_params p = *params;

    if (p.mode == CAIRN_MODE_AS_WRITTEN) {
        p.rebuild = 0;
        p.direction_gate = CAIRN_PI;
        p.sigma = LEAST_SIGMA;
        p.registers = 0;
    }
    return p;
}

cairn_lum_params cairn_lum_as_written(void)
{
    cairn_lum_params params = cairn_lum_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    return in_mode(&params);
}

/* ---- Creation ---- */

static int is_length(cairn_real x)
{
    return x > 0 && x <= FARTHEST;
}

static int params_are_good(const cairn_lum_params *p)
{
    return p->max_scans >= 1 && p->max_scans <= MAX_SCANS && p->max_points >= 1 &&
           p->max_points <= MAX_POINTS && p->max_links >= 1 && p->max_links <= MAX_LINKS &&
           p->min_pairs >= 2 && p->max_iterations >= 1 && p->rebuild >= 0 &&
           is_length(p->distance) && p->direction_gate > 0 && p->direction_gate <= CAIRN_PI &&
           is_length(p->sigma) && is_length(p->converged) &&
           (p->registers == 0 || p->registers == 1) &&
           (p->mode == CAIRN_MODE_DEFAULT || p->mode == CAIRN_MODE_AS_WRITTEN) &&
           p->register_gate >= p->distance && is_length(p->register_gate) &&
           p->register_turn >= 0 && p->register_turn <= CAIRN_PI && p->register_spacing >= 0 &&
           p->register_spacing <= FARTHEST;
}

static cairn_block_solver_params solver_params(const cairn_lum_params *params)
{
    cairn_block_solver_params solver = {params->max_scans, params->max_links, params->max_fill};
    return solver;
}

/* Sets the pointers of *l, which is then to be copied to the first piece that was taken. */
static cairn_lum *carve(cairn_lum *l, cairn_pool *pool, const cairn_lum_params *params)
{
    size_t scans = (size_t)params->max_scans, points = (size_t)params->max_points;
    cairn_lum *made = cairn_pool_take(pool, 1, sizeof *made);

    l->scans = cairn_pool_take(pool, scans, sizeof *l->scans);
    l->root = cairn_pool_take(pool, scans, sizeof *l->root);
    l->points = cairn_pool_take(pool, points, sizeof *l->points);
    l->directions = cairn_pool_take(pool, points, sizeof *l->directions);
    l->heads = cairn_pool_take(pool, 2 * points, sizeof *l->heads);
    l->next = cairn_pool_take(pool, points, sizeof *l->next);
    l->links = cairn_pool_take(pool, (size_t)params->max_links, sizeof *l->links);
    l->right = cairn_pool_take(pool, scans, sizeof *l->right);
    if (params->registers)
        cairn_lum_register_carve(&l->registers, pool, params);
    return made;
}

size_t cairn_lum_memory(const cairn_lum_params *params)
{
    cairn_block_solver_params inner;
    cairn_icp_params icp;
    cairn_pool counting;
    cairn_lum_params used;
    cairn_lum layout;
    size_t bytes, more = 0;

    if (params == NULL)
        return 0;
    used = in_mode(params);
    if (!params_are_good(&used))
        return 0;
    inner = solver_params(&used);
    bytes = cairn_block_solver_memory(&inner);
    if (used.registers) {
        icp = cairn_lum_register_icp(&used);
        more = cairn_icp_memory(&icp);
    }
    cairn_pool_init_counting(&counting);
    (void)carve(&layout, &counting, &used);
    if (bytes == 0 || (used.registers && more == 0) || more > SIZE_MAX - bytes ||
        counting.used >= SIZE_MAX - bytes - more)
        return 0;
    return counting.used + bytes + more;
}

cairn_status cairn_lum_create(cairn_lum **lum, cairn_pool *pool, const cairn_lum_params *params)
{
    size_t need = cairn_lum_memory(params);
    cairn_block_solver_params inner;
    cairn_icp_params icp;
    cairn_lum layout, *made;
    cairn_status status;

    if (lum == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    memset(&layout, 0, sizeof layout);
    layout.params = in_mode(params);
    made = carve(&layout, pool, &layout.params);
    /* As written any: no rounding of two opposite directions may exclude a pair. */
    layout.least_cosine =
        params->mode == CAIRN_MODE_AS_WRITTEN ? -2 : cairn_cos(params->direction_gate);
    inner = solver_params(&layout.params);
    status = cairn_block_solver_create(&layout.solver, pool, &inner);
    if (status == CAIRN_OK && layout.params.registers) {
        icp = cairn_lum_register_icp(&layout.params);
        status = cairn_icp_create(&layout.registers.icp, pool, &icp);
    }
    CAIRN_ASSERT(status == CAIRN_OK);
    *made = layout;
    *lum = made;
    return status;
}

void cairn_lum_clear(cairn_lum *lum)
{
    memset(&lum->state, 0, sizeof lum->state);
    lum->point_count = 0;
    lum->stage = LUM_IDLE;
    lum->debt = 0;
    lum->outcome = CAIRN_OK;
}

/* ---- Scans and their buckets ---- */

static int is_running(const cairn_lum *l)
{
    return l->stage != LUM_IDLE || l->debt > 0 || l->outcome != CAIRN_OK;
}

static cairn_status check_points(const cairn_oriented_point *points, int32_t count,
                                 cairn_fault *fault)
{
    for (int32_t k = 0; k < count; k++) {
        cairn_vec2 p = points[k].position;
        cairn_real norm = cairn_vec2_norm_squared(points[k].direction);

        if (!cairn_is_finite(p.x) || !cairn_is_finite(p.y))
            return cairn_refuse(fault, k, "a coordinate is not finite", CAIRN_NOT_FINITE);
        if (cairn_abs(p.x) > FARTHEST || cairn_abs(p.y) > FARTHEST)
            return cairn_refuse(fault, k, "a coordinate beyond 1e6 m", CAIRN_BAD_ARGUMENT);
        if (norm != norm)
            return cairn_refuse(fault, k, "a direction is not finite", CAIRN_NOT_FINITE);
        if (!(norm > CAIRN_REAL(0.98) && norm < CAIRN_REAL(1.02)))
            return cairn_refuse(fault, k, "a direction is not of length 1", CAIRN_BAD_ARGUMENT);
    }
    return CAIRN_OK;
}

cairn_status cairn_lum_add_scan(cairn_lum *lum, const cairn_oriented_point *points, int32_t count,
                                cairn_pose map_scan, cairn_fault *fault)
{
    struct lum_scan *scan;
    cairn_status status;

    if (lum == NULL || count < 0 || (points == NULL && count > 0))
        return cairn_refuse(fault, -1, "no object or no points", CAIRN_BAD_ARGUMENT);
    if (is_running(lum))
        return cairn_refuse(fault, -1, "an alignment is running", CAIRN_BAD_ARGUMENT);
    if (!cairn_pose_is_finite(map_scan))
        return cairn_refuse(fault, -1, "the pose is not finite", CAIRN_NOT_FINITE);
    if (cairn_abs(map_scan.x) > FARTHEST || cairn_abs(map_scan.y) > FARTHEST)
        return cairn_refuse(fault, -1, "the pose is beyond 1e6 m", CAIRN_BAD_ARGUMENT);
    if (lum->state.scans == lum->params.max_scans)
        return cairn_refuse(fault, -1, "more scans than max_scans", CAIRN_FULL);
    if (count > lum->params.max_points - lum->point_count)
        return cairn_refuse(fault, -1, "more points than max_points", CAIRN_FULL);
    status = check_points(points, count, fault);
    if (status != CAIRN_OK)
        return status;
    scan = &lum->scans[lum->state.scans];
    scan->first = lum->point_count;
    scan->pose = map_scan;
    scan->reach = 0;
    for (int32_t k = 0; k < count; k++) {
        lum->directions[lum->point_count] = points[k].direction;
        lum->points[lum->point_count++] = points[k].position;
        scan->reach = cairn_max(scan->reach, cairn_vec2_norm(points[k].position));
    }
    scan->end = lum->point_count;
    cairn_lum_fill_buckets(lum, scan);
    lum->root[lum->state.scans] = lum->state.scans;
    lum->state.scans++;
    if (lum->params.registers)
        cairn_lum_register_add(lum, points, count);
    return CAIRN_OK;
}

/* ---- Stages ---- */

static void end(cairn_lum *l, cairn_lum_verdict verdict, cairn_status outcome)
{
    l->stage = LUM_IDLE;
    l->state.verdict = verdict;
    l->outcome = outcome;
    l->committed = 1;
}

static int32_t root_of(int32_t *root, int32_t scan)
{
    while (root[scan] != scan) {
        root[scan] = root[root[scan]];
        scan = root[scan];
    }
    return scan;
}

/* The next two scans whose points may be near each other, from (first, second) on; 0: none. */
static int next_pair(cairn_lum *l)
{
    for (; l->first < l->state.scans; l->first++, l->second = l->first + 1)
        for (; l->second < l->state.scans; l->second++) {
            const struct lum_scan *a = &l->scans[l->first], *b = &l->scans[l->second];
            cairn_real dx = a->pose.x - b->pose.x, dy = a->pose.y - b->pose.y;
            cairn_real reach = a->reach + b->reach + l->params.distance;

            if (a->end > a->first && b->end > b->first && dx * dx + dy * dy <= reach * reach)
                return 1;
        }
    return 0;
}

static void begin_search(cairn_lum *l)
{
    l->state.links = 0;
    l->first = 0;
    l->second = 1;
    l->stage = LUM_SEARCH;
    if (next_pair(l))
        cairn_lum_begin_pairs(l, l->first, l->second);
}

static void begin_structure(cairn_lum *l)
{
    cairn_status status = cairn_block_solver_begin(l->solver, l->state.scans);

    for (int32_t i = 0; i < l->state.scans; i++)
        l->root[i] = i;
    for (int32_t k = 0; k < l->state.links && status == CAIRN_OK; k++) {
        int32_t a = root_of(l->root, l->links[k].first), b = root_of(l->root, l->links[k].second);

        l->root[a > b ? a : b] = a > b ? b : a;
        status = cairn_block_solver_add_link(l->solver, l->links[k].first, l->links[k].second);
    }
    l->state.pieces = 0;
    for (int32_t i = 0; i < l->state.scans; i++) {
        l->root[i] = root_of(l->root, i);
        l->state.pieces += l->root[i] == i;
    }
    if (status == CAIRN_OK)
        status = cairn_block_solver_analyze(l->solver);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    l->stage = LUM_ANALYZE;
}

/* A pair of scans has been looked through. */
static void end_search_pair(cairn_lum *l)
{
    if (l->sums.pairs > l->params.min_pairs) {
        if (l->state.links == l->params.max_links) {
            end(l, CAIRN_LUM_RUNNING, CAIRN_FULL);
            return;
        }
        l->links[l->state.links].first = l->first;
        l->links[l->state.links++].second = l->second;
    }
    l->second++;
    if (next_pair(l))
        cairn_lum_begin_pairs(l, l->first, l->second);
}

static void begin_measure(cairn_lum *l)
{
    l->at = 0;
    l->pairs = 0;
    l->error = 0;
    memset(l->right, 0, (size_t)l->state.scans * sizeof *l->right);
    l->stage = LUM_MEASURE;
    if (l->state.links > 0)
        cairn_lum_begin_pairs(l, l->links[0].first, l->links[0].second);
}

/* Every link has been measured: what stays gets the identity. */
static void begin_factor(cairn_lum *l)
{
    const cairn_sym3 one = {1, 0, 0, 1, 0, 1};
    cairn_status status = CAIRN_OK;

    for (int32_t i = 0; i < l->state.scans && status == CAIRN_OK; i++)
        if (l->root[i] == i) {
            status = cairn_block_solver_add_pose_block(l->solver, i, one);
            memset(l->right[i], 0, sizeof l->right[i]);
        }
    if (status == CAIRN_OK)
        status = cairn_block_solver_factor(l->solver);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    l->stage = LUM_FACTOR;
}

static void begin_move(cairn_lum *l)
{
    l->at = 0;
    l->motion = 0;
    l->stage = LUM_MOVE;
}

static void move_scan(cairn_lum *l, int32_t index)
{
    cairn_pose *pose = &l->scans[index].pose;
    cairn_vec2 step;
    cairn_real x[3];
    cairn_status status = cairn_block_solver_solution(l->solver, index, x);

    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    if (l->root[index] == index)
        return;
    step.x = x[0] - x[2] * (pose->y - l->centre.y);
    step.y = x[1] + x[2] * (pose->x - l->centre.x);
    l->motion = cairn_max(l->motion, cairn_vec2_norm(step) + cairn_abs(x[2]));
    pose->x += step.x;
    pose->y += step.y;
    pose->theta = cairn_wrap_angle(pose->theta + x[2]);
}

static void end_iteration(cairn_lum *l)
{
    l->state.iterations++;
    l->state.pairs = l->pairs;
    l->state.error = l->error;
    l->state.motion = l->motion;
    l->committed = 1;
    if (l->motion <= l->params.converged)
        end(l, CAIRN_LUM_CONVERGED, CAIRN_OK);
    else if (l->state.iterations >= l->params.max_iterations)
        end(l, CAIRN_LUM_OUT_OF_ITERATIONS, CAIRN_OK);
    else if (l->params.rebuild > 0 && l->state.iterations % l->params.rebuild == 0)
        begin_search(l);
    else if (cairn_block_solver_clear(l->solver) == CAIRN_OK)
        begin_measure(l);
}

/* The solver has ended a part. */
static void end_part(cairn_lum *l, cairn_status status)
{
    if (status != CAIRN_OK && l->stage == LUM_ANALYZE) {
        end(l, CAIRN_LUM_RUNNING, CAIRN_FULL);
    } else if (l->stage == LUM_ANALYZE) {
        begin_measure(l);
    } else if (status != CAIRN_OK ||
               cairn_block_solver_read(l->solver).state == CAIRN_BLOCK_SOLVER_NOT_POSITIVE) {
        end(l, CAIRN_LUM_SINGULAR, CAIRN_OK);
    } else if (l->stage == LUM_FACTOR) {
        status = cairn_block_solver_solve(l->solver, l->right[0]);
        CAIRN_ASSERT(status == CAIRN_OK);
        l->stage = LUM_SOLVE;
    } else {
        begin_move(l);
    }
}

/* One item of a stage that is not the solver's; returns its units. */
static int32_t do_item(cairn_lum *l)
{
    int more = l->point < l->scans[l->second < l->state.scans ? l->second : 0].end;
    int32_t units;

    if (l->stage == LUM_REGISTER) {
        if (cairn_lum_register_next(l, &units)) {
            l->committed = 1;
            begin_search(l);
        }
        return units;
    }
    if (l->stage == LUM_SEARCH) {
        if (l->first >= l->state.scans) {
            begin_structure(l);
            return 1 + l->state.links / LUM_UNITS_LINK;
        }
        if (more) {
            cairn_lum_add_pair(l);
            return LUM_UNITS_POINT;
        }
        end_search_pair(l);
        return LUM_UNITS_LINK;
    }
    if (l->stage == LUM_MEASURE) {
        if (l->at == l->state.links) {
            begin_factor(l);
            return 1 + l->state.scans / LUM_UNITS_LINK;
        }
        if (more) {
            cairn_lum_add_pair(l);
            return LUM_UNITS_POINT;
        }
        if (cairn_lum_add_link(l, l->at++) != CAIRN_OK)
            end(l, CAIRN_LUM_SINGULAR, CAIRN_OK);
        else if (l->at < l->state.links)
            cairn_lum_begin_pairs(l, l->links[l->at].first, l->links[l->at].second);
        return LUM_UNITS_LINK;
    }
    if (l->at < l->state.scans)
        move_scan(l, l->at++);
    else
        end_iteration(l);
    return 1;
}

cairn_status cairn_lum_begin(cairn_lum *lum)
{
    if (lum == NULL || is_running(lum))
        return CAIRN_BAD_ARGUMENT;
    if (lum->state.scans == 0)
        return CAIRN_EMPTY;
    lum->state.verdict = CAIRN_LUM_RUNNING;
    lum->state.iterations = 0;
    lum->centre.x = lum->scans[0].pose.x;
    lum->centre.y = lum->scans[0].pose.y;
    lum->state.registered = 0;
    if (lum->params.registers) {
        cairn_lum_register_begin(lum);
        lum->stage = LUM_REGISTER;
    } else {
        begin_search(lum);
    }
    return CAIRN_OK;
}

static int is_solvers(int32_t stage)
{
    return stage == LUM_ANALYZE || stage == LUM_FACTOR || stage == LUM_SOLVE;
}

cairn_status cairn_lum_iterate(cairn_lum *lum, cairn_budget *budget)
{
    cairn_status outcome;

    lum->committed = 0;
    while (lum->debt > 0 || (lum->stage != LUM_IDLE && !lum->committed)) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        if (lum->debt > 0) {
            int32_t paid = lum->debt < budget->left ? lum->debt : budget->left;

            lum->debt -= paid;
            budget->left -= paid;
        } else if (is_solvers(lum->stage)) {
            cairn_status status = cairn_block_solver_step(lum->solver, budget);

            if (status == CAIRN_MORE)
                return CAIRN_MORE;
            end_part(lum, status);
        } else if (lum->stage == LUM_REGISTER && lum->registers.matching) {
            if (cairn_icp_step(lum->registers.icp, budget) == CAIRN_MORE)
                return CAIRN_MORE;
            cairn_lum_register_matched(lum);
        } else {
            lum->debt = do_item(lum);
        }
    }
    outcome = lum->outcome;
    lum->outcome = CAIRN_OK;
    return outcome;
}

cairn_status cairn_lum_step(cairn_lum *lum, cairn_budget *budget)
{
    cairn_status status;

    do
        status = cairn_lum_iterate(lum, budget);
    while (status == CAIRN_OK && lum->stage != LUM_IDLE);
    return status;
}

cairn_lum_state cairn_lum_read(const cairn_lum *lum)
{
    return lum->state;
}

cairn_pose cairn_lum_pose(const cairn_lum *lum, int32_t scan)
{
    return lum->scans[scan].pose;
}

int32_t cairn_lum_is_joined(const cairn_lum *lum, int32_t scan)
{
    return lum->root[scan] == 0;
}
