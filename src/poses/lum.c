/* lum: Lu and Milios, a linearized pose graph of closest-point links.
 *
 * Method: a small motion xi = (t, phi) of a scan about the map's centre c moves its point p to
 * first order by M xi, with M = [1 0 -y; 0 1 x] at (x, y) = p - c. The pairs (a_k, b_k) of the
 * scans i and j lie at m_k = (a_k + b_k) / 2 and have the differences z_k = a_k - b_k. They measure
 * the difference of the motions of both scans: D = -(M^T M)^-1 M^T Z, covariance C = s^2 (M^T
 * M)^-1, s^2 = |Z + M D|^2 / (2 n - 3) W = sum (xi_i - xi_j - D)^T C^-1 (xi_i - xi_j - D) is
 * minimised by the solution of the normal equations G xi = B. G has the C^-1 of the links, B the
 * C^-1 D = -M^T Z / s^2. D itself is needed for s^2 alone.
 *
 * 1. Optional sequential registration (lum_register.c); not part of Lu and Milios.
 * 2. Links: closest points of every pair of scans whose circles meet.
 * 3. Per iteration: closest points of each link, normal equations, sparse Cholesky, update.
 *
 * Layout: the points of each scan are in hash buckets of their grid cells, in the scan's own frame,
 * so that they never move: heads[2 first ... ] of a scan whose points begin at `first`, two buckets
 * a point.
 * Limits: closest points need not be true correspondences. A link whose wrong pairs agree by chance
 * has full weight. From errors of more than a few degrees the solution often converges to a local
 * minimum. Evenly spaced points lock into each other at half their spacing.
 * Source: Lu and Milios, Globally consistent range scan alignment for environment mapping, 1997;
 * Adluru 2008, chapter 10. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/disjoint_sets.h"
#include "src/poses/lum_work.h"

enum { MAX_SCANS = 1 << 16, MAX_POINTS = 1 << 24, MAX_LINKS = 1 << 24, MAX_FILL = 1 << 26 };

/* m: lower bound of a pair's standard deviation, as written: exact pairs have none. */
static const cairn_real MIN_SIGMA_M = CAIRN_REAL(0.0001);

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_lum_params, field, __VA_ARGS__)
#define NUMBER(field, ...)   CAIRN_NUMBER(cairn_lum_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_lum_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_scans, 64, 1, MAX_SCANS),
    INTEGER(max_points, 8192, 1, MAX_POINTS),
    INTEGER(max_links, 2016, 1, MAX_LINKS),
    INTEGER(max_fill, 2016, 0, MAX_FILL),
    INTEGER(min_pairs, 5, 2, INT32_MAX),
    INTEGER(max_iterations, 500, 1, INT32_MAX),
    INTEGER(rebuild_interval, 0, 0, INT32_MAX),
    POSITIVE(max_pair_distance, CAIRN_REAL(0.2), 0, CAIRN_MAX_MAGNITUDE),
    POSITIVE(direction_gate, CAIRN_PI / 3, 0, CAIRN_PI),
    POSITIVE(min_sigma, CAIRN_REAL(0.02), 0, CAIRN_MAX_MAGNITUDE),
    POSITIVE(converged_distance, CAIRN_REAL(0.0001), 0, CAIRN_MAX_MAGNITUDE),
    INTEGER(sequential_registration, 0, 0, 1),
    INTEGER(mode, CAIRN_MODE_DEFAULT, CAIRN_MODE_DEFAULT, CAIRN_MODE_AS_WRITTEN),
    POSITIVE(registration_gate, CAIRN_REAL(0.7), 0, CAIRN_MAX_MAGNITUDE),
    NUMBER(registration_angle, CAIRN_PI / 18, 0, CAIRN_PI),
    NUMBER(registration_spacing, CAIRN_REAL(0.08), 0, CAIRN_MAX_MAGNITUDE),
};
const cairn_parameters cairn_lum_parameters = CAIRN_PARAMETERS("lum", cairn_lum_params, rows);

cairn_lum_params cairn_lum_default(void)
{
    cairn_lum_params params;

    cairn_parameters_preset(&cairn_lum_parameters, &params);
    return params;
}

/* Returns the params with those that the mode fixes. */
static cairn_lum_params apply_mode(const cairn_lum_params *params)
{
    cairn_lum_params p = *params;

    if (p.mode == CAIRN_MODE_AS_WRITTEN) {
        p.rebuild_interval = 0;
        p.direction_gate = CAIRN_PI;
        p.min_sigma = MIN_SIGMA_M;
        p.sequential_registration = 0;
    }
    return p;
}

cairn_lum_params cairn_lum_as_written(void)
{
    cairn_lum_params params = cairn_lum_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    return apply_mode(&params);
}

/* ---- Creation ---- */

cairn_status cairn_lum_check(const cairn_lum_params *params, cairn_object_fault *fault)
{
    cairn_lum_params used;
    cairn_icp_params icp;
    cairn_status status;

    if (params == NULL)
        return cairn_parameters_check(&cairn_lum_parameters, NULL, fault);
    used = apply_mode(params);
    icp = cairn_lum_register_icp(&used);
    status = cairn_parameters_check(&cairn_lum_parameters, &used, fault);
    if (status == CAIRN_OK)
        status = cairn_parameters_require(used.registration_gate >= used.max_pair_distance, "lum",
                                          "registration_gate: at least max_pair_distance", fault);
    if (status == CAIRN_OK && used.sequential_registration)
        status = cairn_icp_check(&icp, fault);
    return status;
}

/* The object, its arrays, its solver and the ICP of the registration; NULL from a counting pool. */
static cairn_lum *build(cairn_pool *pool, const cairn_lum_params *params)
{
    size_t scans = (size_t)params->max_scans, points = (size_t)params->max_points;
    cairn_lum_params used = apply_mode(params);
    cairn_block_solver_params solver = {
        .max_poses = params->max_scans,
        .max_links = params->max_links,
        .max_fill = params->max_fill,
    };
    cairn_icp_params icp = cairn_lum_register_icp(&used);
    cairn_lum *lum = cairn_object_take(pool, sizeof *lum);

    CAIRN_TAKE(lum, pool, scans, scans);
    CAIRN_TAKE(lum, pool, root, scans);
    CAIRN_TAKE(lum, pool, points, points);
    CAIRN_TAKE(lum, pool, directions, points);
    CAIRN_TAKE(lum, pool, heads, 2 * points);
    CAIRN_TAKE(lum, pool, next, points);
    CAIRN_TAKE(lum, pool, links, params->max_links);
    CAIRN_TAKE(lum, pool, right, scans);
    if (used.sequential_registration) {
        CAIRN_TAKE(lum, pool, registration.points, points);
        CAIRN_TAKE(lum, pool, registration.first, scans + 1);
        CAIRN_TAKE(lum, pool, registration.initial, scans);
        CAIRN_TAKE(lum, pool, registration.placed, scans);
        CAIRN_TAKE(lum, pool, registration.is_placed, scans);
    }
    CAIRN_TAKE_OBJECT(lum, pool, solver, block_solver, &solver);
    if (used.sequential_registration)
        CAIRN_TAKE_OBJECT(lum, pool, registration.icp, icp, &icp);
    if (lum != NULL) {
        lum->params = used;
        /* As written: any direction; below -1, so that rounding of two opposite directions excludes
         * no pair. */
        lum->least_cosine =
            params->mode == CAIRN_MODE_AS_WRITTEN ? -2 : cairn_cos(params->direction_gate);
    }
    return lum;
}

CAIRN_OBJECT(lum, lum, build);

void cairn_lum_clear(cairn_lum *lum)
{
    memset(&lum->state, 0, sizeof lum->state);
    lum->point_count = 0;
    lum->is_running = 0;
    lum->resume = lum->phase_resume = lum->pair_resume = 0;
    lum->units_charged = 0;
}

/* ---- Scans and their buckets ---- */

cairn_status cairn_lum_add_scan(cairn_lum *lum, const cairn_oriented_point *points, int32_t count,
                                cairn_pose map_scan, cairn_fault *fault)
{
    struct lum_scan *scan;
    cairn_status status;

    if (lum == NULL || count < 0 || (points == NULL && count > 0))
        return cairn_refuse(fault, -1, "no object or no points", CAIRN_BAD_ARGUMENT);
    if (lum->is_running)
        return cairn_refuse(fault, -1, "an alignment is running", CAIRN_BAD_ARGUMENT);
    status = cairn_pose_check(map_scan, CAIRN_MAX_MAGNITUDE, fault);
    if (status != CAIRN_OK)
        return status;
    if (lum->state.scans == lum->params.max_scans)
        return cairn_refuse(fault, -1, "more scans than max_scans", CAIRN_FULL);
    if (count > lum->params.max_points - lum->point_count)
        return cairn_refuse(fault, -1, "more points than max_points", CAIRN_FULL);
    status = cairn_oriented_points_check(points, count, CAIRN_MAX_MAGNITUDE, fault);
    if (status != CAIRN_OK)
        return status;
    scan = &lum->scans[lum->state.scans];
    scan->first = lum->point_count;
    scan->pose = map_scan;
    scan->radius = 0;
    for (int32_t k = 0; k < count; k++) {
        lum->directions[lum->point_count] = points[k].direction;
        lum->points[lum->point_count++] = points[k].position;
        scan->radius = cairn_max(scan->radius, cairn_vec2_norm(points[k].position));
    }
    scan->end = lum->point_count;
    cairn_lum_fill_buckets(lum, scan);
    disjoint_sets_add(lum->root, lum->state.scans++);
    if (lum->params.sequential_registration)
        cairn_lum_register_add(lum, points, count);
    return CAIRN_OK;
}

/* ---- Phases: each returns 1 when done and 0 when the budget is used up ---- */

/* 1 when both scans have points, and their circles meet. */
static int circles_meet(const cairn_lum *lum, int32_t first, int32_t second)
{
    const struct lum_scan *a = &lum->scans[first], *b = &lum->scans[second];
    cairn_real dx = a->pose.x - b->pose.x, dy = a->pose.y - b->pose.y;
    cairn_real reach = a->radius + b->radius + lum->params.max_pair_distance;

    return a->end > a->first && b->end > b->first && dx * dx + dy * dy <= reach * reach;
}

/* Runs the current phase of the solver to its end. */
static int run_solver(cairn_lum *lum, cairn_budget *budget)
{
    lum->solver_status = cairn_block_solver_step(lum->solver, budget);
    return lum->solver_status != CAIRN_MORE;
}

/* The same; the alignment ends when the links do not determine all poses. */
static int run_to_solution(cairn_lum *lum, cairn_budget *budget)
{
    if (!run_solver(lum, budget))
        return 0;
    if (lum->solver_status != CAIRN_OK ||
        cairn_block_solver_read(lum->solver).state == CAIRN_BLOCK_SOLVER_NOT_POSITIVE)
        lum->state.verdict = CAIRN_LUM_SINGULAR;
    return 1;
}

/* 1 when the alignment continues. */
static int continues(const cairn_lum *lum)
{
    return lum->state.verdict == CAIRN_LUM_RUNNING && lum->outcome == CAIRN_OK;
}

/* Components of the links, and the sparsity structure. */
static void begin_structure(cairn_lum *lum)
{
    cairn_must_be_ok(cairn_block_solver_begin(lum->solver, lum->state.scans));
    disjoint_sets_reset(lum->root, lum->state.scans);
    for (int32_t k = 0; k < lum->state.links; k++) {
        (void)disjoint_sets_unite(lum->root, lum->links[k].first, lum->links[k].second);
        cairn_must_be_ok(
            cairn_block_solver_add_link(lum->solver, lum->links[k].first, lum->links[k].second));
    }
    lum->state.components = 0;
    for (int32_t i = 0; i < lum->state.scans; i++) {
        lum->root[i] = disjoint_sets_root(lum->root, i);
        lum->state.components += lum->root[i] == i;
    }
    cairn_must_be_ok(cairn_block_solver_analyze(lum->solver));
}

/* Makes the current pair of scans a link when it has enough pairs of points. */
static void insert_link(cairn_lum *lum)
{
    struct lum_link link = {lum->first, lum->second};

    if (lum->sums.pairs <= lum->params.min_pairs)
        return;
    if (lum->state.links == lum->params.max_links)
        lum->outcome = CAIRN_FULL;
    else
        lum->links[lum->state.links++] = link;
}

/* Closest points of two scans. */
static int associate(cairn_lum *lum, cairn_budget *budget, int32_t first, int32_t second)
{
    CAIRN_STEP_BEGIN(lum->pair_resume);
    cairn_lum_begin_pairs(lum, first, second);
    while (lum->point < lum->scans[second].end) {
        CAIRN_STEP_CHARGE(lum, pair_resume, budget, LUM_UNITS_PER_POINT);
        cairn_lum_add_pair(lum);
    }
    CAIRN_STEP_CHARGE(lum, pair_resume, budget, LUM_UNITS_PER_LINK);
    CAIRN_STEP_END(lum->pair_resume);
}

/* Search for links: closest points of every pair of scans whose circles meet. */
static int find_links(cairn_lum *lum, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(lum->phase_resume);
    lum->state.links = 0;
    for (lum->first = 0; continues(lum) && lum->first < lum->state.scans; lum->first++)
        for (lum->second = lum->first + 1; continues(lum) && lum->second < lum->state.scans;
             lum->second++) {
            CAIRN_STEP_CHARGE_EVERY(lum, phase_resume, budget, LUM_CIRCLES_PER_UNIT,
                                    lum->second - lum->first - 1);
            if (!circles_meet(lum, lum->first, lum->second))
                continue;
            CAIRN_STEP_UNTIL(lum->phase_resume, associate(lum, budget, lum->first, lum->second));
            insert_link(lum);
        }
    if (continues(lum)) {
        CAIRN_STEP_CHARGE(lum, phase_resume, budget,
                          1 + (lum->state.scans + lum->state.links) / LUM_LISTED_PER_UNIT);
        begin_structure(lum);
        CAIRN_STEP_RUN(lum, phase_resume, budget, run_solver);
        if (lum->solver_status != CAIRN_OK)
            lum->outcome = CAIRN_FULL;
    }
    CAIRN_STEP_END(lum->phase_resume);
}

/* Starts the sums of an iteration. */
static void begin_measure(cairn_lum *lum)
{
    lum->pairs = 0;
    lum->chi2 = lum->max_motion = 0;
    memset(lum->right, 0, (size_t)lum->state.scans * sizeof *lum->right);
}

/* Adds the normal equations of a link; without them the poses are not determined. */
static void measure_link(cairn_lum *lum, int32_t index)
{
    if (cairn_lum_add_link(lum, index) != CAIRN_OK)
        lum->state.verdict = CAIRN_LUM_SINGULAR;
}

/* All links have been measured: fixed scans get the identity, and the factorization starts. */
static void begin_factor(cairn_lum *lum)
{
    const cairn_sym3 one = {1, 0, 0, 1, 0, 1};

    for (int32_t i = 0; i < lum->state.scans; i++)
        if (lum->root[i] == i) {
            cairn_must_be_ok(cairn_block_solver_add_pose_block(lum->solver, i, one));
            memset(lum->right[i], 0, sizeof lum->right[i]);
        }
    cairn_must_be_ok(cairn_block_solver_factor(lum->solver));
}

/* Starts to solve the normal equations with their factor. */
static void begin_solution(cairn_lum *lum)
{
    cairn_must_be_ok(cairn_block_solver_solve(lum->solver, lum->right[0]));
}

static void move_scan(cairn_lum *lum, int32_t index)
{
    cairn_pose *pose = &lum->scans[index].pose;
    cairn_vec2 step;
    cairn_real x[3];

    cairn_must_be_ok(cairn_block_solver_solution(lum->solver, index, x));
    if (lum->root[index] == index)
        return;
    step.x = x[0] - x[2] * (pose->y - lum->motion.centre.y);
    step.y = x[1] + x[2] * (pose->x - lum->motion.centre.x);
    lum->max_motion = cairn_max(lum->max_motion, cairn_vec2_norm(step) + cairn_abs(x[2]));
    pose->x += step.x;
    pose->y += step.y;
    pose->theta = cairn_wrap_angle(pose->theta + x[2]);
}

static void end_iteration(cairn_lum *lum)
{
    lum->state.iterations++;
    lum->state.pairs = lum->pairs;
    lum->state.chi2 = lum->chi2;
    lum->state.max_motion = lum->max_motion;
    if (lum->max_motion <= lum->params.converged_distance)
        lum->state.verdict = CAIRN_LUM_CONVERGED;
    else if (lum->state.iterations >= lum->params.max_iterations)
        lum->state.verdict = CAIRN_LUM_OUT_OF_ITERATIONS;
}

/* Iteration: closest points of each link, normal equations, sparse Cholesky, update. */
static int iterate(cairn_lum *lum, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(lum->phase_resume);
    begin_measure(lum);
    for (lum->index = 0; continues(lum) && lum->index < lum->state.links; lum->index++) {
        CAIRN_STEP_UNTIL(lum->phase_resume, associate(lum, budget, lum->links[lum->index].first,
                                                      lum->links[lum->index].second));
        measure_link(lum, lum->index);
    }
    if (continues(lum)) {
        CAIRN_STEP_CHARGE(lum, phase_resume, budget, 1 + lum->state.scans / LUM_LISTED_PER_UNIT);
        begin_factor(lum);
        CAIRN_STEP_RUN(lum, phase_resume, budget, run_to_solution);
    }
    if (continues(lum)) {
        CAIRN_STEP_CHARGE(lum, phase_resume, budget, 1 + lum->state.scans / LUM_LISTED_PER_UNIT);
        begin_solution(lum);
        CAIRN_STEP_RUN(lum, phase_resume, budget, run_to_solution);
    }
    if (continues(lum)) {
        for (lum->index = 0; lum->index < lum->state.scans; lum->index++) {
            CAIRN_STEP_CHARGE(lum, phase_resume, budget, LUM_UNITS_PER_SCAN);
            move_scan(lum, lum->index);
        }
        CAIRN_STEP_CHARGE(lum, phase_resume, budget, LUM_UNITS_PER_COMMIT);
        end_iteration(lum);
    }
    CAIRN_STEP_END(lum->phase_resume);
}

/* ---- The alignment ---- */

/* 1 when links are searched for before the next iteration. */
static int is_search_due(const cairn_lum *lum)
{
    return lum->state.iterations == 0 ||
           (lum->params.rebuild_interval > 0 &&
            lum->state.iterations % lum->params.rebuild_interval == 0);
}

/* Returns the units of setting the normal equations of the last iteration to 0. */
static int32_t clearing_units(const cairn_lum *lum)
{
    return 1 +
           (lum->state.scans + cairn_block_solver_read(lum->solver).fill) / LUM_CLEARED_PER_UNIT;
}

/* Place of return of the alignment at a commit point, at which iterate() returns. */
#define RETURN_COMMITTED(lum)                                                                      \
    do {                                                                                           \
        (lum)->is_committed = 1;                                                                   \
        CAIRN_STEP_UNTIL((lum)->resume, !(lum)->is_committed);                                     \
    } while (0)

/* The alignment: see Method in the head of this file. */
static int align(cairn_lum *lum, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(lum->resume);
    if (lum->params.sequential_registration) {
        CAIRN_STEP_RUN(lum, resume, budget, cairn_lum_register_scans);
        RETURN_COMMITTED(lum);
    }
    while (continues(lum)) {
        if (is_search_due(lum)) {
            CAIRN_STEP_RUN(lum, resume, budget, find_links);
        } else {
            CAIRN_STEP_CHARGE(lum, resume, budget, clearing_units(lum));
            cairn_must_be_ok(cairn_block_solver_clear(lum->solver));
        }
        if (continues(lum))
            CAIRN_STEP_RUN(lum, resume, budget, iterate);
        if (continues(lum))
            RETURN_COMMITTED(lum);
    }
    CAIRN_STEP_END(lum->resume);
}

cairn_status cairn_lum_begin(cairn_lum *lum)
{
    cairn_vec2 centre;

    if (lum == NULL || lum->is_running)
        return CAIRN_BAD_ARGUMENT;
    if (lum->state.scans == 0)
        return CAIRN_EMPTY;
    lum->state.verdict = CAIRN_LUM_RUNNING;
    lum->state.iterations = 0;
    lum->state.links = 0;
    lum->state.registered_scans = 0;
    centre.x = lum->scans[0].pose.x;
    centre.y = lum->scans[0].pose.y;
    lum->motion = cairn_rigid_motion_at(cairn_pose_identity(), centre, 1);
    if (lum->params.sequential_registration)
        cairn_lum_register_begin(lum);
    lum->outcome = CAIRN_OK;
    lum->is_running = 1;
    return CAIRN_OK;
}

cairn_status cairn_lum_iterate(cairn_lum *lum, cairn_budget *budget)
{
    if (!lum->is_running)
        return CAIRN_OK;
    if (budget->left <= 0)
        return CAIRN_MORE;
    lum->is_committed = 0;
    if (!align(lum, budget))
        return lum->is_committed ? CAIRN_OK : CAIRN_MORE;
    lum->is_running = 0;
    return lum->outcome;
}

cairn_status cairn_lum_step(cairn_lum *lum, cairn_budget *budget)
{
    cairn_status status;

    do
        status = cairn_lum_iterate(lum, budget);
    while (status == CAIRN_OK && lum->is_running);
    return status;
}

cairn_lum_state cairn_lum_read(const cairn_lum *lum)
{
    return lum->state;
}

static int has_scan(const cairn_lum *lum, int32_t scan)
{
    return scan >= 0 && scan < lum->state.scans;
}

cairn_pose cairn_lum_pose(const cairn_lum *lum, int32_t scan)
{
    return has_scan(lum, scan) ? lum->scans[scan].pose : cairn_pose_identity();
}

int32_t cairn_lum_is_connected(const cairn_lum *lum, int32_t scan)
{
    return has_scan(lum, scan) && lum->root[scan] == 0;
}
