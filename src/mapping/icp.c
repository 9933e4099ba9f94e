/* Iterative closest points.
 *
 * Motions are taken about the query's centroid, with the rotation multiplied by the query's radius, so that all three
 * components are metres and comparable. In these coordinates a pair of mapped query point p and target point m with normal
 * n has the residual e = n (p - m) and the row J = (n_x, n_y, n R'(q - c) / r).
 *
 * One iteration: every query point is paired and its terms are added to the sums at once, no pairs are kept. Then the
 * eigenvectors of the point-to-line information sum(w J J^T) are found. Those with little information are taken out of the
 * normal equations (Zhang, Kaess and Singh 2016): the prior decides there, or the pose stays. Weights are Cauchy's,
 * 1 / (1 + (e / (2.385 sigma))^2), with sigma from the last iteration's residuals. A step is cut to the length of the
 * gate, as pairs reach no farther.
 *
 * Covariance: that of an M-estimator (Huber 1981, section 7.6) with the weighted information in place of the plain one,
 * sum(psi^2)/(n - 3) * (sum(w)/n) / (sum(psi')/n)^2 * (sum(w J J^T))^-1, psi(e) = w e.
 *
 * Limits: nearest neighbours are found anew in each iteration. Flat basins of a few gate lengths; a global search is
 * another room's. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/icp.h"
#include "cairn/neighbours.h"
#include "cairn/small_matrix.h"

enum { MAX_TARGET = 1 << 24, UNITS_PAIR = 2, UNITS_SEARCH = 8, UNITS_SOLVE = 12 };

/* Cauchy weights of this scale lose 5 % of the information of normal residuals; the weighted mean square of these is 1 /
 * 1.26 of their variance. */
static const cairn_real CAUCHY = CAIRN_REAL(2.385);
static const cairn_real CAUCHY_VARIANCE = CAIRN_REAL(1.26);
/* Least information in any direction: a standard deviation of 100 m. */
static const cairn_real LEAST_INFORMATION = CAIRN_REAL(1e-4);

/* Sums over the pairs of one iteration. */
struct sums {
    cairn_sym3 lines;                       /* point-to-line information */
    cairn_sym3 normal;                      /* of the mode's normal equations */
    cairn_real gradient[3];                 /* of the mode */
    cairn_real weight, squares;             /* of residuals across the line: w, w e^2 */
    cairn_real psi_squares, slopes;         /* (w e)^2, d(w e)/de */
    cairn_real point_weight, point_squares; /* of distances: w, w d^2 */
    cairn_real distance;
    int32_t pairs;
};

struct cairn_icp {
    cairn_point_grid *grid;
    cairn_vec2 *directions; /* [max_target] of the target points */
    cairn_icp_params params;
    cairn_real least_cosine; /* of the direction gate */
    const cairn_oriented_point *query;
    int32_t query_count;
    int32_t running;
    int32_t next; /* query point to pair; == query_count: the iteration is to be solved */
    int32_t debt; /* units of items done that are not yet paid for */
    int32_t has_prior;
    cairn_icp_prior prior;
    cairn_vec2 centroid;
    cairn_transform target_query; /* of result.target_query */
    cairn_real sigma, point_sigma;
    cairn_real gate; /* of this iteration */
    struct sums sums;
    cairn_icp_result result;
};

cairn_icp_params cairn_icp_default(void)
{
    cairn_icp_params params = {4096,
                               40,
                               10,
                               CAIRN_ICP_POINT_TO_LINE,
                               CAIRN_REAL(0.2),
                               CAIRN_REAL(0.5),
                               CAIRN_REAL(0.1),
                               3,
                               CAIRN_PI / 3,
                               CAIRN_REAL(0.01),
                               CAIRN_REAL(1e-4),
                               CAIRN_REAL(1e-4),
                               CAIRN_REAL(0.01)};
    return params;
}

static int is_positive(cairn_real x)
{
    return x > 0 && x <= CAIRN_REAL_MAX;
}

static int params_are_good(const cairn_icp_params *params)
{
    return params != NULL && params->max_target >= 1 && params->max_target <= MAX_TARGET &&
           params->max_iterations >= 1 && params->min_pairs >= 4 &&
           (params->mode == CAIRN_ICP_POINT_TO_POINT || params->mode == CAIRN_ICP_POINT_TO_LINE) &&
           is_positive(params->gate_start) && is_positive(params->gate_end) && params->gate_end <= params->gate_start &&
           is_positive(params->gate_factor) && is_positive(params->direction_gate) &&
           params->direction_gate <= CAIRN_PI && is_positive(params->sigma) &&
           is_positive(params->converged_distance) && is_positive(params->converged_angle) && params->weak_ratio >= 0 &&
           params->weak_ratio < 1;
}

static cairn_icp *carve(cairn_pool *pool, const cairn_icp_params *params)
{
    cairn_icp *icp = cairn_pool_take(pool, 1, sizeof *icp);
    cairn_vec2 *directions = cairn_pool_take(pool, (size_t)params->max_target, sizeof *directions);

    if (icp != NULL)
        icp->directions = directions;
    return icp;
}

static cairn_point_grid_params grid_params(const cairn_icp_params *params)
{
    cairn_point_grid_params grid = {params->max_target, params->cell};
    return grid;
}

size_t cairn_icp_memory(const cairn_icp_params *params)
{
    cairn_point_grid_params grid;
    cairn_pool counting;
    size_t grid_bytes;

    if (!params_are_good(params))
        return 0;
    grid = grid_params(params);
    grid_bytes = cairn_point_grid_memory(&grid);
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return grid_bytes == 0 || counting.used >= SIZE_MAX - grid_bytes ? 0 : counting.used + grid_bytes;
}

cairn_status cairn_icp_create(cairn_icp **icp, cairn_pool *pool, const cairn_icp_params *params)
{
    size_t need = cairn_icp_memory(params);
    cairn_point_grid_params grid;
    cairn_vec2 *directions;
    cairn_icp *made;

    if (icp == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve(pool, params);
    directions = made->directions;
    memset(made, 0, sizeof *made);
    made->directions = directions;
    made->params = *params;
    made->least_cosine = cairn_cos(params->direction_gate);
    grid = grid_params(params);
    *icp = made;
    return cairn_point_grid_create(&made->grid, pool, &grid);
}

void cairn_icp_clear_target(cairn_icp *icp)
{
    cairn_point_grid_clear(icp->grid);
    icp->running = 0;
}

static cairn_status refuse(cairn_fault *fault, int32_t index, const char *what, cairn_status status)
{
    if (fault != NULL) {
        fault->index = index;
        fault->what = what;
    }
    return status;
}

static cairn_status check_points(const cairn_oriented_point *points, int32_t count, cairn_fault *fault)
{
    for (int32_t i = 0; i < count; i++) {
        cairn_real norm = cairn_vec2_norm_squared(points[i].direction);

        if (!cairn_is_finite(points[i].position.x) || !cairn_is_finite(points[i].position.y) || norm != norm)
            return refuse(fault, i, "a coordinate is not finite", CAIRN_NOT_FINITE);
        if (!(norm > CAIRN_REAL(0.98) && norm < CAIRN_REAL(1.02)))
            return refuse(fault, i, "a direction is not of length 1", CAIRN_BAD_ARGUMENT);
    }
    return CAIRN_OK;
}

cairn_status cairn_icp_add_target(cairn_icp *icp, const cairn_oriented_point *points, int32_t count,
                                  cairn_pose target_points, cairn_fault *fault)
{
    cairn_transform transform;
    cairn_status status;

    if (icp == NULL || count < 0 || (points == NULL && count > 0))
        return refuse(fault, -1, "no object or no points", CAIRN_BAD_ARGUMENT);
    if (icp->running)
        return refuse(fault, -1, "an alignment is running", CAIRN_BAD_ARGUMENT);
    if (!cairn_pose_is_finite(target_points))
        return refuse(fault, -1, "the pose is not finite", CAIRN_NOT_FINITE);
    if (count > icp->params.max_target - cairn_point_grid_count(icp->grid))
        return refuse(fault, -1, "more target points than max_target", CAIRN_FULL);
    status = check_points(points, count, fault);
    if (status != CAIRN_OK)
        return status;
    transform = cairn_transform_of(target_points);
    for (int32_t i = 0; i < count; i++) {
        cairn_vec2 p = cairn_transform_point(transform, points[i].position);

        if (!cairn_is_finite(p.x) || !cairn_is_finite(p.y))
            return refuse(fault, i, "a coordinate overflows", CAIRN_NOT_FINITE);
    }
    for (int32_t i = 0; i < count; i++) {
        int32_t index = cairn_point_grid_count(icp->grid);

        status = cairn_point_grid_insert(icp->grid, cairn_transform_point(transform, points[i].position));
        CAIRN_ASSERT(status == CAIRN_OK);
        icp->directions[index] = cairn_transform_direction(transform, points[i].direction);
    }
    return status;
}

int32_t cairn_icp_target_count(const cairn_icp *icp)
{
    return cairn_point_grid_count(icp->grid);
}

static cairn_status check_prior(const cairn_icp_prior *prior, cairn_fault *fault)
{
    if (prior == NULL)
        return CAIRN_OK;
    if (!cairn_pose_is_finite(prior->target_query))
        return refuse(fault, -1, "the prior's pose is not finite", CAIRN_NOT_FINITE);
    if (!is_positive(prior->sigma_x) || !is_positive(prior->sigma_y) || !is_positive(prior->sigma_theta))
        return refuse(fault, -1, "the prior's sigmas must be positive", CAIRN_BAD_ARGUMENT);
    return CAIRN_OK;
}

/* Centroid and radius of the query. */
static void measure_query(cairn_icp *icp)
{
    cairn_real count = (cairn_real)icp->query_count, squares = 0;
    cairn_vec2 sum = {0, 0};

    for (int32_t i = 0; i < icp->query_count; i++)
        sum = cairn_vec2_add(sum, icp->query[i].position);
    icp->centroid = cairn_vec2_scale(sum, 1 / count);
    for (int32_t i = 0; i < icp->query_count; i++)
        squares += cairn_vec2_norm_squared(cairn_vec2_sub(icp->query[i].position, icp->centroid));
    icp->result.radius = cairn_max(cairn_sqrt(squares / count), icp->params.sigma);
}

cairn_status cairn_icp_begin(cairn_icp *icp, const cairn_oriented_point *query, int32_t count, cairn_pose start,
                             const cairn_icp_prior *prior, cairn_fault *fault)
{
    cairn_status status;

    if (icp == NULL || count < 0 || (query == NULL && count > 0))
        return refuse(fault, -1, "no object or no query", CAIRN_BAD_ARGUMENT);
    if (count == 0 || cairn_point_grid_count(icp->grid) == 0)
        return refuse(fault, -1, "no query points or no target points", CAIRN_EMPTY);
    if (!cairn_pose_is_finite(start))
        return refuse(fault, -1, "the start pose is not finite", CAIRN_NOT_FINITE);
    status = check_prior(prior, fault);
    if (status == CAIRN_OK)
        status = check_points(query, count, fault);
    if (status != CAIRN_OK)
        return status;
    icp->query = query;
    icp->query_count = count;
    icp->running = 1;
    icp->next = 0;
    icp->debt = 0;
    icp->has_prior = prior != NULL;
    if (prior != NULL)
        icp->prior = *prior;
    icp->gate = icp->sigma = icp->point_sigma = icp->params.gate_start;
    memset(&icp->sums, 0, sizeof icp->sums);
    memset(&icp->result, 0, sizeof icp->result);
    icp->result.target_query = start;
    icp->target_query = cairn_transform_of(start);
    measure_query(icp);
    return CAIRN_OK;
}

/* ---- Pairs ---- */

static int agrees(const cairn_icp *icp, int32_t target, cairn_vec2 direction)
{
    return cairn_vec2_dot(icp->directions[target], direction) >= icp->least_cosine;
}

/* Nearest target point within the gate that points the same way; -1: none. */
static int32_t find_pair(cairn_icp *icp, cairn_vec2 p, cairn_vec2 direction)
{
    cairn_real nearest = 0;
    int32_t best = cairn_point_grid_nearest(icp->grid, p, icp->gate, NULL), i;
    cairn_point_grid_cursor cursor;

    if (best < 0 || agrees(icp, best, direction))
        return best;
    icp->debt += UNITS_SEARCH;
    best = -1;
    cursor = cairn_point_grid_begin(icp->grid, p, icp->gate);
    while ((i = cairn_point_grid_next(icp->grid, &cursor)) >= 0) {
        cairn_real d = cairn_vec2_norm_squared(cairn_vec2_sub(cairn_point_grid_point(icp->grid, i), p));

        if (agrees(icp, i, direction) && (best < 0 || d < nearest || (d == nearest && i < best))) {
            nearest = d;
            best = i;
        }
    }
    return best;
}

static cairn_real cauchy_weight(cairn_real squared, cairn_real sigma)
{
    cairn_real scale = CAUCHY * sigma;

    return 1 / (1 + squared / (scale * scale));
}

/* J of a residual along `axis` for a query point whose offset from the centroid, turned, is `arm`. */
static void jacobian(const cairn_icp *icp, cairn_vec2 axis, cairn_vec2 arm, cairn_real row[3])
{
    row[0] = axis.x;
    row[1] = axis.y;
    row[2] = cairn_vec2_dot(axis, cairn_vec2_left(arm)) / icp->result.radius;
}

static void add_gradient(cairn_real gradient[3], const cairn_real row[3], cairn_real by)
{
    for (int k = 0; k < 3; k++)
        gradient[k] += by * row[k];
}

static void add_point_terms(cairn_icp *icp, cairn_vec2 difference, cairn_vec2 arm, cairn_real squared)
{
    static const cairn_vec2 axes[2] = {{1, 0}, {0, 1}};
    struct sums *sums = &icp->sums;
    cairn_real weight = cauchy_weight(squared, icp->point_sigma), row[3];

    for (int k = 0; k < 2; k++) {
        jacobian(icp, axes[k], arm, row);
        cairn_sym3_add_outer(&sums->normal, row, weight);
        add_gradient(sums->gradient, row, weight * cairn_vec2_dot(axes[k], difference));
    }
    sums->point_weight += weight;
    sums->point_squares += weight * squared;
}

static void add_query_point(cairn_icp *icp, const cairn_oriented_point *q)
{
    struct sums *sums = &icp->sums;
    cairn_vec2 p = cairn_transform_point(icp->target_query, q->position);
    int32_t target = find_pair(icp, p, cairn_transform_direction(icp->target_query, q->direction));
    cairn_vec2 arm, difference, normal;
    cairn_real error, squared, weight, row[3];

    if (target < 0)
        return;
    arm = cairn_transform_direction(icp->target_query, cairn_vec2_sub(q->position, icp->centroid));
    difference = cairn_vec2_sub(p, cairn_point_grid_point(icp->grid, target));
    normal = cairn_vec2_left(icp->directions[target]);
    error = cairn_vec2_dot(normal, difference);
    weight = cauchy_weight(error * error, icp->sigma);
    jacobian(icp, normal, arm, row);
    cairn_sym3_add_outer(&sums->lines, row, weight);
    sums->weight += weight;
    sums->squares += weight * error * error;
    sums->psi_squares += weight * weight * error * error;
    /* psi = w e, 1 - (e / scale)^2 = 2 - 1 / w */
    sums->slopes += weight * weight * (2 - 1 / weight);
    squared = cairn_vec2_norm_squared(difference);
    sums->distance += cairn_sqrt(squared);
    sums->pairs++;
    if (icp->params.mode == CAIRN_ICP_POINT_TO_LINE)
        add_gradient(sums->gradient, row, weight * error);
    else
        add_point_terms(icp, difference, arm, squared);
}

/* ---- Solving ---- */

/* Unit eigenvectors of the point-to-line information, the least observable first. */
struct basis {
    cairn_real vectors[3][3];
};

/* Coordinates of a row in the basis of the eigenvectors. */
static void to_basis(const struct basis *basis, const cairn_real row[3], cairn_real out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = basis->vectors[i][0] * row[0] + basis->vectors[i][1] * row[1] + basis->vectors[i][2] * row[2];
}

/* m in the basis of the eigenvectors. */
static cairn_sym3 sym3_to_basis(const struct basis *basis, cairn_sym3 m)
{
    cairn_real columns[3][3], products[3];
    cairn_sym3 out;

    for (int i = 0; i < 3; i++) {
        products[0] = m.xx * basis->vectors[i][0] + m.xy * basis->vectors[i][1] + m.xz * basis->vectors[i][2];
        products[1] = m.xy * basis->vectors[i][0] + m.yy * basis->vectors[i][1] + m.yz * basis->vectors[i][2];
        products[2] = m.xz * basis->vectors[i][0] + m.yz * basis->vectors[i][1] + m.zz * basis->vectors[i][2];
        to_basis(basis, products, columns[i]);
    }
    out.xx = columns[0][0];
    out.xy = columns[1][0];
    out.xz = columns[2][0];
    out.yy = columns[1][1];
    out.yz = columns[2][1];
    out.zz = columns[2][2];
    return out;
}

/* Takes the first `weak` directions of the basis out of the information. */
static void drop_weak(cairn_sym3 *m, int32_t weak)
{
    if (weak > 0)
        m->xx = m->xy = m->xz = 0;
    if (weak > 1)
        m->yy = m->yz = 0;
}

/* The query's origin relative to the centroid moves with the rotation by this, per radian. */
static cairn_vec2 origin_arm(const cairn_icp *icp)
{
    return cairn_vec2_left(cairn_transform_direction(icp->target_query, icp->centroid));
}

/* Adds the prior's three residuals, in the basis, to the normal equations. */
static void add_prior(const cairn_icp *icp, const struct basis *basis, cairn_sym3 *information, cairn_real gradient[3])
{
    const cairn_icp_prior *prior = &icp->prior;
    cairn_transform mean = cairn_transform_of(prior->target_query);
    cairn_vec2 x_axis = {mean.cosine, mean.sine}, arm = origin_arm(icp);
    cairn_vec2 off = {icp->result.target_query.x - mean.x, icp->result.target_query.y - mean.y};
    cairn_vec2 axes[2] = {x_axis, cairn_vec2_left(x_axis)};
    cairn_real sigmas[3] = {prior->sigma_x, prior->sigma_y, prior->sigma_theta};

    for (int k = 0; k < 3; k++) {
        cairn_real weight = 1 / (sigmas[k] * sigmas[k]), error, row[3] = {0, 0, 0}, turned[3];

        if (k < 2) {
            error = cairn_vec2_dot(axes[k], off);
            row[0] = axes[k].x;
            row[1] = axes[k].y;
            row[2] = -cairn_vec2_dot(axes[k], arm) / icp->result.radius;
        } else {
            error = cairn_wrap_angle(icp->result.target_query.theta - prior->target_query.theta);
            row[2] = 1 / icp->result.radius;
        }
        to_basis(basis, row, turned);
        cairn_sym3_add_outer(information, turned, weight);
        add_gradient(gradient, turned, weight * error);
    }
}

/* Covariance of the pose from the information in the basis. */
static void write_covariance(cairn_icp *icp, const struct basis *basis, cairn_sym3 information)
{
    cairn_real values[3], inner[3][3], radius = icp->result.radius;
    cairn_vec2 arm = origin_arm(icp);

    cairn_sym3_eigen(information, values, inner);
    memset(icp->result.covariance, 0, sizeof icp->result.covariance);
    for (int i = 0; i < 3; i++) {
        cairn_real variance = 1 / cairn_max(values[i], LEAST_INFORMATION), motion[3], pose[3];

        for (int k = 0; k < 3; k++)
            motion[k] = inner[i][0] * basis->vectors[0][k] + inner[i][1] * basis->vectors[1][k] +
                        inner[i][2] * basis->vectors[2][k];
        pose[2] = motion[2] / radius;
        pose[0] = motion[0] - arm.x * pose[2];
        pose[1] = motion[1] - arm.y * pose[2];
        for (int k = 0; k < 9; k++)
            icp->result.covariance[k] += variance * pose[k / 3] * pose[k % 3];
    }
}

/* Moves the pose by a motion about the centroid. */
static void move(cairn_icp *icp, const cairn_real step[3])
{
    cairn_vec2 before = cairn_transform_direction(icp->target_query, icp->centroid), after;
    cairn_pose pose = icp->result.target_query;

    pose.theta = cairn_wrap_angle(pose.theta + step[2] / icp->result.radius);
    icp->target_query = cairn_transform_of(pose);
    after = cairn_transform_direction(icp->target_query, icp->centroid);
    pose.x += before.x + step[0] - after.x;
    pose.y += before.y + step[1] - after.y;
    icp->target_query.x = pose.x;
    icp->target_query.y = pose.y;
    icp->result.target_query = pose;
}

/* The variance factor of the covariance, see the head of this file. */
static cairn_real information_scale(const cairn_icp *icp)
{
    const struct sums *sums = &icp->sums;
    cairn_real n = (cairn_real)sums->pairs, slope = cairn_max(sums->slopes / n, CAIRN_REAL(0.1));
    cairn_real scale = sums->psi_squares / (n - 3) * (sums->weight / n) / (slope * slope);

    return 1 / cairn_max(scale, icp->params.sigma * icp->params.sigma);
}

static cairn_sym3 scaled(cairn_sym3 m, cairn_real by)
{
    cairn_sym3 out = {m.xx * by, m.xy * by, m.xz * by, m.yy * by, m.yz * by, m.zz * by};
    return out;
}

/* Solves for the step in the basis and turns it back; 0 when the equations are singular. */
static int solve_step(const cairn_icp *icp, const struct basis *basis, int32_t weak, cairn_real step[3])
{
    int to_line = icp->params.mode == CAIRN_ICP_POINT_TO_LINE;
    cairn_real sigma = to_line ? icp->sigma : icp->point_sigma, by = 1 / (sigma * sigma);
    cairn_sym3 normal = sym3_to_basis(basis, scaled(to_line ? icp->sums.lines : icp->sums.normal, by));
    cairn_real gradient[3], turned[3], length;

    to_basis(basis, icp->sums.gradient, gradient);
    for (int i = 0; i < 3; i++)
        gradient[i] = i < weak ? 0 : -by * gradient[i];
    drop_weak(&normal, weak);
    if (icp->has_prior) {
        cairn_real against[3] = {0, 0, 0};

        add_prior(icp, basis, &normal, against);
        for (int i = 0; i < 3; i++)
            gradient[i] -= against[i];
    } else {
        if (weak > 0)
            normal.xx = normal.zz;
        if (weak > 1)
            normal.yy = normal.zz;
    }
    if (!cairn_sym3_solve(normal, gradient, turned))
        return 0;
    length = cairn_sqrt(turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2]);
    for (int k = 0; k < 3; k++) {
        step[k] =
            turned[0] * basis->vectors[0][k] + turned[1] * basis->vectors[1][k] + turned[2] * basis->vectors[2][k];
        if (length > icp->gate)
            step[k] *= icp->gate / length;
    }
    return 1;
}

/* Ends the alignment: the covariance from the sums of the last iteration and the prior. */
static void stop(cairn_icp *icp, cairn_icp_verdict verdict, const struct basis *basis, int32_t weak)
{
    cairn_sym3 information = cairn_sym3_zero();
    cairn_real ignored[3] = {0, 0, 0};

    if (verdict != CAIRN_ICP_TOO_FEW_PAIRS) {
        information = scaled(sym3_to_basis(basis, icp->sums.lines), information_scale(icp));
        drop_weak(&information, weak);
    }
    if (icp->has_prior)
        add_prior(icp, basis, &information, ignored);
    write_covariance(icp, basis, information);
    icp->result.verdict = verdict;
    icp->running = 0;
}

static void end_iteration(cairn_icp *icp)
{
    static const struct basis axes = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    const cairn_icp_params *params = &icp->params;
    const struct sums *sums = &icp->sums;
    cairn_icp_result *result = &icp->result;
    struct basis basis;
    cairn_real values[3], step[3], gate, moved, sigma = icp->sigma;
    int32_t weak = 0, converged;

    result->iterations++;
    result->pairs = sums->pairs;
    result->overlap = (cairn_real)sums->pairs / (cairn_real)icp->query_count;
    result->gate = icp->gate;
    if (sums->pairs < params->min_pairs) {
        result->observable = 0;
        stop(icp, CAIRN_ICP_TOO_FEW_PAIRS, &axes, 3);
        return;
    }
    result->mean_distance = sums->distance / (cairn_real)sums->pairs;
    icp->sigma = cairn_max(params->sigma, cairn_sqrt(CAUCHY_VARIANCE * sums->squares / sums->weight));
    if (params->mode == CAIRN_ICP_POINT_TO_POINT)
        icp->point_sigma =
            cairn_max(params->sigma, cairn_sqrt(CAUCHY_VARIANCE * sums->point_squares / (2 * sums->point_weight)));
    result->sigma = icp->sigma;

    cairn_sym3_eigen(sums->lines, values, basis.vectors);
    while (weak < 2 && values[weak] < params->weak_ratio * values[2])
        weak++;
    result->observable = 3 - weak;
    result->weak_ratio = cairn_max(values[0], 0) / values[2];
    memcpy(result->weak, basis.vectors[0], sizeof result->weak);
    if (!solve_step(icp, &basis, weak, step)) {
        stop(icp, CAIRN_ICP_UNOBSERVABLE, &basis, weak);
        return;
    }
    move(icp, step);
    moved = cairn_sqrt(step[0] * step[0] + step[1] * step[1]);
    gate = cairn_min(icp->gate, cairn_max(params->gate_end, params->gate_factor * result->mean_distance));
    converged = moved < params->converged_distance && cairn_abs(step[2]) < params->converged_angle * result->radius &&
                gate > CAIRN_REAL(0.99) * icp->gate && icp->sigma > CAIRN_REAL(0.9) * sigma;
    if (converged || result->iterations == params->max_iterations) {
        cairn_icp_verdict verdict = converged ? CAIRN_ICP_CONVERGED : CAIRN_ICP_OUT_OF_ITERATIONS;

        stop(icp, weak > 0 && !icp->has_prior ? CAIRN_ICP_UNOBSERVABLE : verdict, &basis, weak);
        return;
    }
    icp->gate = gate;
    icp->next = 0;
    memset(&icp->sums, 0, sizeof icp->sums);
}

cairn_status cairn_icp_step(cairn_icp *icp, cairn_budget *budget)
{
    while (icp->running || icp->debt > 0) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        if (icp->debt > 0) {
            int32_t paid = icp->debt < budget->left ? icp->debt : budget->left;

            icp->debt -= paid;
            budget->left -= paid;
        } else if (icp->next < icp->query_count) {
            icp->debt = UNITS_PAIR;
            add_query_point(icp, &icp->query[icp->next]);
            icp->next++;
        } else {
            icp->debt = UNITS_SOLVE;
            end_iteration(icp);
        }
    }
    return CAIRN_OK;
}

cairn_icp_result cairn_icp_read(const cairn_icp *icp)
{
    return icp->result;
}
