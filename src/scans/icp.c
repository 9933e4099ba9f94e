/* icp: iterative closest points with a robust kernel and a degeneracy analysis.
 *
 * Method: motions are taken about the query's centroid, with the rotation multiplied by the query's
 * radius, so that all three components are metres and comparable. In these coordinates a pair of
 * mapped query point p = R q + t and target point m with normal n has the residual e = n . (p - m)
 * and the Jacobian J = (n_x, n_y, n . R' (q - c) / r), where R' = dR/dtheta, c is the query's
 * centroid and r its radius.
 * 1. Data association: every query point is paired with its nearest target point, and its terms are
 *    added to the normal equations at once; no pairs are stored.
 * 2. Degeneracy analysis: eigenvectors of the point-to-line information sum(w J J^T). Those of
 *    small eigenvalue, its numerical null-space, are projected out of the normal equations
 *    (solution remapping, Zhang, Kaess and Singh 2016). The prior decides there, or the pose stays.
 * 3. Robust Gauss-Newton step and covariance: see registration.
 *
 * Limits: local convergence only; the start must lie within about a gate of the true pose. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/icp.h"
#include "cairn/neighbours.h"
#include "cairn/registration.h"
#include "src/base/object.h"
#include "src/base/step.h"

enum { MAX_TARGET = 1 << 24, UNITS_PER_PAIR = 5, VISITS_PER_UNIT = 6, UNITS_PER_SOLVE = 12 };

/* Sums of one iteration beside those of the registration. */
struct sums {
    cairn_registration_points points;      /* in mode POINT_TO_POINT */
    cairn_real distance;                   /* sum over all pairs */
    cairn_sym3 parts[CAIRN_ICP_MAX_PARTS]; /* point-to-line information by target part */
};

/* State of an iteration at the pose that it started from. */
struct iteration {
    cairn_rigid_motion motion;
    cairn_real mean_distance;
    int32_t pairs;
};

struct cairn_icp {
    /* Resume point, and units charged for the operation that waits. */
    int32_t resume, units_charged;
    /* Query point that is paired, and target points and cells that its search has visited. */
    int32_t cursor, visits;
    /* 1: step() has work left. */
    int32_t running;
    int32_t query_count;
    const cairn_oriented_point *query;
    cairn_point_grid *grid;
    cairn_vec2 *directions; /* [max_target] directions of the target points */
    int32_t part_count;
    int32_t part_end[CAIRN_ICP_MAX_PARTS];
    cairn_real least_cosine; /* cosine of the direction gate */
    int32_t has_prior;
    cairn_rigid_motion_pose_prior prior;
    cairn_registration fit; /* of the query, about its centroid */
    cairn_real point_sigma;
    cairn_icp_params params;
    struct sums sums;
    struct iteration previous; /* last iteration, at the pose that it started from */
    cairn_icp_result result;
};

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_icp_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_icp_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_target, 4096, 1, MAX_TARGET),
    INTEGER(max_iterations, 40, 1, INT32_MAX),
    INTEGER(min_pairs, 10, 4, INT32_MAX),
    INTEGER(mode, CAIRN_ICP_POINT_TO_LINE, CAIRN_ICP_POINT_TO_POINT, CAIRN_ICP_POINT_TO_LINE),
    /* Of a finite reciprocal. */
    POSITIVE(cell_size, CAIRN_REAL(0.2), 1 / CAIRN_REAL_MAX, CAIRN_REAL_MAX),
    POSITIVE(gate_start, CAIRN_REAL(0.5), 0, CAIRN_REAL_MAX),
    POSITIVE(gate_end, CAIRN_REAL(0.1), 0, CAIRN_REAL_MAX),
    POSITIVE(gate_factor, 3, 0, CAIRN_REAL_MAX),
    POSITIVE(direction_gate, CAIRN_PI / 3, 0, CAIRN_PI),
    POSITIVE(min_sigma, CAIRN_REAL(0.01), 0, CAIRN_REAL_MAX),
    POSITIVE(converged_distance, CAIRN_REAL(1e-4), 0, CAIRN_REAL_MAX),
    POSITIVE(converged_angle, CAIRN_REAL(1e-4), 0, CAIRN_REAL_MAX),
    CAIRN_NUMBER_BELOW(cairn_icp_params, weak_ratio, CAIRN_REAL(0.01), 0, 1),
    INTEGER(roll_back, 0, 0, 1),
};
extern const cairn_parameters cairn_icp_parameters;
const cairn_parameters cairn_icp_parameters = CAIRN_PARAMETERS("icp", cairn_icp_params, rows);

cairn_icp_params cairn_icp_default(void)
{
    cairn_icp_params params;

    cairn_parameters_preset(&cairn_icp_parameters, &params);
    return params;
}

cairn_status cairn_icp_check(const cairn_icp_params *params, cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_icp_parameters, params, fault);

    if (status == CAIRN_OK)
        status = cairn_parameters_require(params->gate_end <= params->gate_start, "icp",
                                          "gate_end: at most gate_start", fault);
    return status;
}

/* The object, its array and its grid; NULL from a counting pool. */
static cairn_icp *build(cairn_pool *pool, const cairn_icp_params *params)
{
    cairn_point_grid_params grid = {
        .max_points = params->max_target,
        .cell_size = params->cell_size,
    };
    cairn_icp *icp = cairn_object_take(pool, sizeof *icp);

    CAIRN_TAKE(icp, pool, directions, params->max_target);
    CAIRN_TAKE_OBJECT(icp, pool, grid, point_grid, &grid);
    if (icp != NULL) {
        icp->params = *params;
        icp->least_cosine = cairn_cos(params->direction_gate);
    }
    return icp;
}

CAIRN_OBJECT(icp, icp, build);

void cairn_icp_clear_target(cairn_icp *icp)
{
    cairn_point_grid_clear(icp->grid);
    icp->part_count = 0;
    icp->running = 0;
}

cairn_status cairn_icp_add_target(cairn_icp *icp, const cairn_oriented_point *points, int32_t count,
                                  cairn_pose target_points, cairn_fault *fault)
{
    cairn_transform transform;
    cairn_status status;

    if (icp == NULL || count < 0 || (points == NULL && count > 0))
        return cairn_refuse(fault, -1, "no object or no points", CAIRN_BAD_ARGUMENT);
    if (icp->running)
        return cairn_refuse(fault, -1, "an alignment is running", CAIRN_BAD_ARGUMENT);
    if (!cairn_pose_is_finite(target_points))
        return cairn_refuse(fault, -1, "the pose is not finite", CAIRN_NOT_FINITE);
    if (count > icp->params.max_target - cairn_point_grid_count(icp->grid))
        return cairn_refuse(fault, -1, "more target points than max_target", CAIRN_FULL);
    status = cairn_oriented_points_check(points, count, CAIRN_REAL_MAX, fault);
    if (status != CAIRN_OK)
        return status;
    transform = cairn_transform_of(target_points);
    for (int32_t i = 0; i < count; i++) {
        cairn_vec2 p = cairn_transform_point(transform, points[i].position);

        if (!cairn_vec2_is_finite(p))
            return cairn_refuse(fault, i, "a coordinate overflows", CAIRN_NOT_FINITE);
    }
    for (int32_t i = 0; i < count; i++) {
        int32_t index = cairn_point_grid_count(icp->grid);

        status = cairn_point_grid_insert(icp->grid,
                                         cairn_transform_point(transform, points[i].position));
        CAIRN_ASSERT(status == CAIRN_OK);
        icp->directions[index] = cairn_transform_direction(transform, points[i].direction);
    }
    if (icp->part_count < CAIRN_ICP_MAX_PARTS)
        icp->part_count++;
    icp->part_end[icp->part_count - 1] = cairn_point_grid_count(icp->grid);
    return status;
}

int32_t cairn_icp_target_count(const cairn_icp *icp)
{
    return cairn_point_grid_count(icp->grid);
}

static int is_positive_finite(cairn_real x)
{
    return x > 0 && x <= CAIRN_REAL_MAX;
}

static cairn_status check_prior(const cairn_rigid_motion_pose_prior *prior, cairn_fault *fault)
{
    if (prior == NULL)
        return CAIRN_OK;
    if (!cairn_pose_is_finite(prior->mean))
        return cairn_refuse(fault, -1, "the prior's pose is not finite", CAIRN_NOT_FINITE);
    if (!is_positive_finite(prior->sigma_x) || !is_positive_finite(prior->sigma_y) ||
        !is_positive_finite(prior->sigma_theta))
        return cairn_refuse(fault, -1, "the prior's sigmas must be positive", CAIRN_BAD_ARGUMENT);
    return CAIRN_OK;
}

/* Returns the query's motion at its start pose: about its centroid, with its root mean square
 * distance as radius. */
static cairn_rigid_motion measure_query(const cairn_icp *icp, cairn_pose start)
{
    cairn_real count = (cairn_real)icp->query_count, squares = 0;
    cairn_vec2 centroid = {0, 0};

    for (int32_t i = 0; i < icp->query_count; i++)
        centroid = cairn_vec2_add(centroid, cairn_vec2_scale(icp->query[i].position, 1 / count));
    for (int32_t i = 0; i < icp->query_count; i++)
        squares += cairn_vec2_norm_squared(cairn_vec2_sub(icp->query[i].position, centroid));
    return cairn_rigid_motion_at(start, centroid,
                                 cairn_max(cairn_sqrt(squares / count), icp->params.min_sigma));
}

cairn_status cairn_icp_begin(cairn_icp *icp, const cairn_oriented_point *query, int32_t count,
                             cairn_pose start, const cairn_rigid_motion_pose_prior *prior,
                             cairn_fault *fault)
{
    cairn_status status;

    if (icp == NULL || count < 0 || (query == NULL && count > 0))
        return cairn_refuse(fault, -1, "no object or no query", CAIRN_BAD_ARGUMENT);
    if (count == 0 || cairn_point_grid_count(icp->grid) == 0)
        return cairn_refuse(fault, -1, "no query points or no target points", CAIRN_EMPTY);
    if (!cairn_pose_is_finite(start))
        return cairn_refuse(fault, -1, "the start pose is not finite", CAIRN_NOT_FINITE);
    status = check_prior(prior, fault);
    if (status == CAIRN_OK)
        status = cairn_oriented_points_check(query, count, CAIRN_REAL_MAX, fault);
    if (status != CAIRN_OK)
        return status;
    icp->query = query;
    icp->query_count = count;
    icp->running = 1;
    icp->resume = icp->units_charged = 0;
    icp->has_prior = prior != NULL;
    if (prior != NULL)
        icp->prior = *prior;
    icp->fit = (cairn_registration){
        .motion = measure_query(icp, start),
        .gate = icp->params.gate_start,
        .sigma = icp->params.gate_start,
        .min_sigma = icp->params.min_sigma,
    };
    icp->point_sigma = icp->params.gate_start;
    memset(&icp->result, 0, sizeof icp->result);
    icp->result.target_query = start;
    icp->result.radius = icp->fit.motion.radius;
    return CAIRN_OK;
}

cairn_status cairn_icp_set_weak_ratio(cairn_icp *icp, cairn_real weak_ratio)
{
    if (icp == NULL || icp->running || !(weak_ratio >= 0 && weak_ratio < 1))
        return CAIRN_BAD_ARGUMENT;
    icp->params.weak_ratio = weak_ratio;
    return CAIRN_OK;
}

/* ---- Data association ---- */

/* Returns the nearest target point within the distance gate and the direction gate; -1: none. */
static int32_t find_pair(cairn_icp *icp, cairn_vec2 p, cairn_vec2 direction)
{
    const cairn_point_grid_facing facing = {icp->directions, direction, icp->least_cosine};

    return cairn_point_grid_nearest_facing(icp->grid, p, icp->fit.gate, &facing, &icp->visits);
}

/* Returns the target part of a point, by binary search. */
static int32_t part_of(const cairn_icp *icp, int32_t point)
{
    int32_t first = 0, last = icp->part_count - 1;

    while (first < last) {
        int32_t middle = (first + last) / 2;

        if (point < icp->part_end[middle])
            last = middle;
        else
            first = middle + 1;
    }
    return first;
}

static void add_query_point(cairn_icp *icp, const cairn_oriented_point *point)
{
    struct sums *sums = &icp->sums;
    cairn_transform target_query = icp->fit.motion.transform;
    cairn_vec2 p = cairn_transform_point(target_query, point->position);
    int32_t target = find_pair(icp, p, cairn_transform_direction(target_query, point->direction));
    cairn_vec2 difference, normal;
    cairn_real squared, weight, row[3];

    if (target < 0)
        return;
    difference = cairn_vec2_sub(p, cairn_point_grid_point(icp->grid, target));
    normal = cairn_vec2_left_perp(icp->directions[target]);
    weight = cairn_registration_add_pair(&icp->fit, point->position, normal,
                                         cairn_vec2_dot(normal, difference), row);
    cairn_sym3_add_outer(&sums->parts[part_of(icp, target)], row, weight);
    squared = cairn_vec2_norm_squared(difference);
    sums->distance += cairn_sqrt(squared);
    if (icp->params.mode == CAIRN_ICP_POINT_TO_POINT)
        cairn_registration_add_points(&sums->points, &icp->fit.motion, point->position, difference,
                                      cairn_registration_weight(squared, icp->point_sigma));
}

/* ---- Normal equations ---- */

static const cairn_rigid_motion_pose_prior *prior_of(const cairn_icp *icp)
{
    return icp->has_prior ? &icp->prior : NULL;
}

/* Ends the alignment and writes the covariance. basis NULL: too few pairs, so that the covariance
 * is that of the prior. */
static void finish_alignment(cairn_icp *icp, cairn_icp_verdict verdict,
                             const cairn_rigid_motion_basis *basis)
{
    cairn_registration_covariance(&icp->fit, basis, icp->fit.sums.equations.information,
                                  prior_of(icp), icp->result.covariance);
    icp->result.verdict = verdict;
}

/* Updates the robust scales from this iteration's residuals. */
static void update_sigmas(cairn_icp *icp)
{
    const cairn_registration_points *points = &icp->sums.points;

    cairn_registration_update_sigma(&icp->fit);
    if (icp->params.mode == CAIRN_ICP_POINT_TO_POINT)
        icp->point_sigma =
            cairn_registration_sigma(points->squares, 2 * points->weight, icp->params.min_sigma);
}

/* Moves the query by the Gauss-Newton step; returns 0 when no direction is observable and there is
 * no prior. */
static int move_query(cairn_icp *icp, const cairn_rigid_motion_basis *basis, cairn_real step[3])
{
    int to_line = icp->params.mode == CAIRN_ICP_POINT_TO_LINE;
    cairn_real sigma = to_line ? icp->fit.sigma : icp->point_sigma;

    return cairn_registration_move(&icp->fit, basis,
                                   to_line ? &icp->fit.sums.equations : &icp->sums.points.equations,
                                   sigma * sigma, prior_of(icp), step);
}

/* Returns 1 and restores the pose before the last step when that step lowered the overlap and
 * raised the mean distance. */
static int rolls_back(cairn_icp *icp)
{
    const struct iteration before = icp->previous;
    cairn_icp_result *result = &icp->result;

    icp->previous.motion = icp->fit.motion;
    icp->previous.mean_distance = result->mean_distance;
    icp->previous.pairs = result->pairs;
    if (!icp->params.roll_back || result->iterations == 1 || result->pairs >= before.pairs ||
        result->mean_distance <= before.mean_distance)
        return 0;
    icp->fit.motion = before.motion;
    result->target_query = before.motion.map_body;
    result->mean_distance = before.mean_distance;
    result->pairs = before.pairs;
    result->overlap = (cairn_real)before.pairs / (cairn_real)icp->query_count;
    return 1;
}

static void end_iteration(cairn_icp *icp)
{
    const cairn_icp_params *params = &icp->params;
    cairn_icp_result *result = &icp->result;
    cairn_rigid_motion_basis basis;
    cairn_real step[3], gate, moved, sigma = icp->fit.sigma;
    int32_t converged;

    result->iterations++;
    result->pairs = icp->fit.sums.pairs;
    result->overlap = (cairn_real)result->pairs / (cairn_real)icp->query_count;
    result->gate = icp->fit.gate;
    if (result->pairs < params->min_pairs) {
        result->observable_dof = 0;
        finish_alignment(icp, CAIRN_ICP_TOO_FEW_PAIRS, NULL);
        return;
    }
    result->mean_distance = icp->sums.distance / (cairn_real)result->pairs;
    update_sigmas(icp);
    result->sigma = icp->fit.sigma;
    basis = cairn_rigid_motion_basis_of(icp->fit.sums.equations.information, params->weak_ratio);
    result->observable_dof = 3 - basis.unobservable;
    result->weak_ratio = basis.inverse_condition;
    memcpy(result->weak_direction, basis.vectors[0], sizeof result->weak_direction);
    if (rolls_back(icp)) {
        finish_alignment(icp, CAIRN_ICP_ROLLED_BACK, &basis);
        return;
    }
    if (!move_query(icp, &basis, step)) {
        finish_alignment(icp, CAIRN_ICP_UNOBSERVABLE, &basis);
        return;
    }
    result->target_query = icp->fit.motion.map_body;
    moved = cairn_sqrt(step[0] * step[0] + step[1] * step[1]);
    gate = cairn_min(icp->fit.gate,
                     cairn_max(params->gate_end, params->gate_factor * result->mean_distance));
    converged = moved < params->converged_distance &&
                cairn_abs(step[2]) < params->converged_angle * icp->fit.motion.radius &&
                gate > CAIRN_REAL(0.99) * icp->fit.gate && icp->fit.sigma > CAIRN_REAL(0.9) * sigma;
    if (converged || result->iterations == params->max_iterations) {
        cairn_icp_verdict verdict = converged ? CAIRN_ICP_CONVERGED : CAIRN_ICP_OUT_OF_ITERATIONS;

        finish_alignment(
            icp, basis.unobservable > 0 && !icp->has_prior ? CAIRN_ICP_UNOBSERVABLE : verdict,
            &basis);
        return;
    }
    icp->fit.gate = gate;
}

/* The iterations: see Method in the head of this file. */
static int align(cairn_icp *icp, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(icp->resume);
    do {
        memset(&icp->fit.sums, 0, sizeof icp->fit.sums);
        memset(&icp->sums, 0, sizeof icp->sums);
        for (icp->cursor = 0; icp->cursor < icp->query_count; icp->cursor++) {
            CAIRN_STEP_CHARGE(icp, resume, budget, UNITS_PER_PAIR);
            add_query_point(icp, &icp->query[icp->cursor]);
            /* What the search has visited is known only behind it. */
            CAIRN_STEP_CHARGE(icp, resume, budget, icp->visits / VISITS_PER_UNIT);
        }
        CAIRN_STEP_CHARGE(icp, resume, budget, UNITS_PER_SOLVE);
        end_iteration(icp);
    } while (icp->result.verdict == CAIRN_ICP_RUNNING);
    CAIRN_STEP_END(icp->resume);
}

cairn_status cairn_icp_step(cairn_icp *icp, cairn_budget *budget)
{
    if (icp->running && !align(icp, budget))
        return CAIRN_MORE;
    icp->running = 0;
    return CAIRN_OK;
}

cairn_icp_result cairn_icp_read(const cairn_icp *icp)
{
    return icp->result;
}

void cairn_icp_read_parts(const cairn_icp *icp, cairn_icp_parts *parts)
{
    int32_t has_sums = !icp->running && icp->result.pairs >= icp->params.min_pairs;
    cairn_real factor = has_sums ? cairn_registration_information_scale(&icp->fit) : 0;

    memset(parts, 0, sizeof *parts);
    parts->motion = icp->fit.motion;
    parts->count = icp->part_count;
    for (int32_t i = 0; i < parts->count; i++)
        parts->information[i] = cairn_sym3_scale(icp->sums.parts[i], factor);
}
