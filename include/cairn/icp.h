/* icp: iterative closest points (ICP) of oriented points against a local map, point to point or
 * point to line.
 *
 * The target is a set of oriented points that the caller adds scan by scan. The query is one array
 * of oriented points with a start pose. Each iteration associates every query point with the
 * nearest target point within a distance gate and a direction gate, and takes one Gauss-Newton step
 * on the robustly weighted residuals (Besl and McKay 1992; Chen and Medioni 1992). Unobservable
 * directions (degeneracy: along a corridor, rotation in a round room) are found from the
 * eigenvalues of the information matrix. They are constrained by the prior, or left at the start
 * pose without one.
 *
 *     add_target(points) for each scan -> begin(query, start) -> step(budget) until CAIRN_OK ->
 *     read(), begin() ... ; clear_target() before another target
 *
 * Limits: converges to the nearest minimum only, so the start must lie within about gate_start of
 * the true pose (with the defaults about 0.3 m and 15 degrees). From farther away it can end as
 * CONVERGED at a wrong pose: check overlap and sigma, or use scan_match. */
#ifndef CAIRN_ICP_H
#define CAIRN_ICP_H

#include "cairn/object.h"
#include "cairn/pool.h"
#include "cairn/rigid_motion.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ICP alignment of a query against a target. */
typedef struct cairn_icp cairn_icp;

/* Distance of a pair that is minimized. */
typedef int32_t cairn_icp_mode;
enum {
    /* distance of the two points */
    CAIRN_ICP_POINT_TO_POINT = 0,
    /* residual along the normal of the target point: translation along the line is free */
    CAIRN_ICP_POINT_TO_LINE = 1
};

/* Parameters; defaults in brackets. */
typedef struct cairn_icp_params {
    /* 1 ... 2^24 (4096): capacity for target points; memory per point: 2 points and 2 to 3
     * int32_t */
    int32_t max_target;
    /* >= 1 (40): greatest number of iterations of an alignment */
    int32_t max_iterations;
    /* >= 4 (10): least number of inlier pairs; the alignment ends below it */
    int32_t min_pairs;
    /* any (CAIRN_ICP_POINT_TO_LINE): distance that is minimized */
    cairn_icp_mode mode;
    /* m, > 1/CAIRN_REAL_MAX (0.2): side of the search grid's cells; about half the gate is fastest */
    cairn_real cell_size;
    /* m, > 0 (0.5): distance gate of the first iteration */
    cairn_real gate_start;
    /* m, > 0, <= gate_start (0.1): least distance gate; the gate shrinks in between */
    cairn_real gate_end;
    /* > 0 (3): gate = gate_factor times the mean distance of the last pairs, never growing */
    cairn_real gate_factor;
    /* rad, > 0, <= pi (60 degrees): greatest angle between the oriented directions of a pair */
    cairn_real direction_gate;
    /* m, > 0 (0.01): lower bound of the estimated standard deviation of a point across its line */
    cairn_real min_sigma;
    /* m, > 0 (1e-4): converged when a step translates less, and rotates less than
     * converged_angle */
    cairn_real converged_distance;
    /* rad, > 0 (1e-4): rotation of a step below which the alignment has converged */
    cairn_real converged_angle;
    /* >= 0, < 1 (0.01): a direction is unobservable when its information is below this share of the
     * best direction's */
    cairn_real weak_ratio;
    /* 0 or 1 (0): 1: an iteration that lowers the overlap and raises the mean distance is undone
     * and ends the alignment (Adluru 2008, section 6.4) */
    int32_t roll_back;
} cairn_icp_params;

/* Returns the default parameters. */
cairn_icp_params cairn_icp_default(void);

/* How an alignment has ended. */
typedef int32_t cairn_icp_verdict;
enum {
    /* running, or nothing was begun */
    CAIRN_ICP_RUNNING = 0,
    /* a step was shorter than converged_distance and converged_angle */
    CAIRN_ICP_CONVERGED = 1,
    /* max_iterations were done without convergence */
    CAIRN_ICP_OUT_OF_ITERATIONS = 2,
    /* the pose is that of the last iteration with enough pairs */
    CAIRN_ICP_TOO_FEW_PAIRS = 3,
    /* without a prior, in place of the two above: the pose did not move in the unobservable
     * directions, see weak_direction. With a prior read observable_dof instead. */
    CAIRN_ICP_UNOBSERVABLE = 4,
    /* the pose is that before the last iteration; the covariance is of the last iteration's
     * pairs */
    CAIRN_ICP_ROLLED_BACK = 5
};

/* Estimate and diagnostics after the last complete iteration. */
typedef struct cairn_icp_result {
    cairn_pose target_query; /* pose of the query's frame in the target's */
    /* Covariance, row-major over (x, y, theta) in m and rad, of target_query in the target's frame;
     * zero while running. The inverse of the sum of the prior's information and the point-to-line
     * information of the observable directions, scaled by the variance of the residuals. A
     * direction without information gets a standard deviation of 100 m, about the query's centroid
     * and with rotations times radius. Valid for independent errors of the points; points resampled
     * from one fitted segment share its error, so that true errors are larger. */
    cairn_real covariance[9];
    /* mean distance of the pairs, m */
    cairn_real mean_distance;
    /* robust standard deviation of the residuals across the line, m, >= params.min_sigma */
    cairn_real sigma;
    /* distance gate of the last iteration, m */
    cairn_real gate;
    /* share of the query points that have a pair, 0 ... 1 */
    cairn_real overlap;
    /* Least observable direction, about the query's centroid: unit vector over (x, y, theta times
     * radius) in the target's frame, sign free. weak_ratio is its information as a share of the
     * best observable direction's. */
    cairn_real weak_direction[3];
    /* information of weak_direction as a share of that of the best direction, 0 ... 1 */
    cairn_real weak_ratio;
    cairn_real radius; /* m: root mean square distance of the query points from their centroid */
    int32_t observable_dof; /* observable degrees of freedom, 0 ... 3 */
    /* inlier pairs of the last iteration */
    int32_t pairs;
    /* complete iterations */
    int32_t iterations;
    /* running, or how the alignment has ended */
    cairn_icp_verdict verdict;
} cairn_icp_result;

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_icp_check(const cairn_icp_params *params,
                                           cairn_object_fault *fault);

/* Returns the bytes that create() takes; 0 for params that create() would refuse. */
size_t cairn_icp_memory(const cairn_icp_params *params);

/* Creates the object in memory of the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_icp_create(cairn_icp **icp, cairn_pool *pool,
                                            const cairn_icp_params *params);

/* Removes the target points and ends a running alignment. Cost: linear in max_target. */
void cairn_icp_clear_target(cairn_icp *icp);

/* Adds points[0 ... count-1], mapped by target_points, to the target; they are copied.
 * CAIRN_BAD_ARGUMENT: count < 0, NULL with count > 0, a direction whose length is not 1 within 1 %,
 * or an alignment is running. CAIRN_NOT_FINITE. CAIRN_FULL: more than max_target in all. *fault,
 * when not NULL, gives the index of the point. Cost: a linear pass over the points.
 *
 * points: [count] in a frame of their own; directions of length 1
 * target_points: pose of that frame in the target's */
CAIRN_CHECKED cairn_status cairn_icp_add_target(cairn_icp *icp, const cairn_oriented_point *points,
                                                int32_t count, cairn_pose target_points,
                                                cairn_fault *fault);

/* Returns the number of target points. */
int32_t cairn_icp_target_count(const cairn_icp *icp);

/* Starts to align query[0 ... count-1], which must not change until step() returns CAIRN_OK. A
 * running alignment is cancelled. prior: Gaussian prior of the pose; NULL: none. CAIRN_EMPTY: no
 * query or no target points. CAIRN_BAD_ARGUMENT: count < 0, NULL query, directions as in
 * add_target(), sigmas that are not > 0. CAIRN_NOT_FINITE. Cost: a linear pass over the query.
 *
 * start: initial pose of the query's frame in the target's
 * query: [count] in a frame of its own; directions of length 1 */
CAIRN_CHECKED cairn_status cairn_icp_begin(cairn_icp *icp, const cairn_oriented_point *query,
                                           int32_t count, cairn_pose start,
                                           const cairn_rigid_motion_pose_prior *prior,
                                           cairn_fault *fault);

/* Sets the least information ratio of an observable direction (params.weak_ratio) for the next
 * alignments. CAIRN_BAD_ARGUMENT: not in [0, 1), or an alignment is running.
 *
 * weak_ratio: >= 0, < 1 */
CAIRN_CHECKED cairn_status cairn_icp_set_weak_ratio(cairn_icp *icp, cairn_real weak_ratio);

/* Continues the alignment. CAIRN_OK: it has ended; the verdict is valid. CAIRN_MORE: the budget is
 * used up. Cost: 5 units per query point, one more for every 6 target points and cells visited by
 * its nearest-neighbour search, and 12 at the end of an iteration. */
CAIRN_CHECKED cairn_status cairn_icp_step(cairn_icp *icp, cairn_budget *budget);

/* Returns the state after the last complete iteration. */
cairn_icp_result cairn_icp_read(const cairn_icp *icp);

/* Information per target part. A part is the set of points of one add_target() call. Parts beyond
 * CAIRN_ICP_MAX_PARTS are counted with the last one. */
#define CAIRN_ICP_MAX_PARTS 64

/* Information of the pairs with each target part. */
typedef struct cairn_icp_parts {
    /* motion of the query at the linearization point of the information */
    cairn_rigid_motion motion;
    /* number of target parts, at most CAIRN_ICP_MAX_PARTS */
    int32_t count;
    /* point-to-line information of the pairs with each part, last complete iteration */
    cairn_sym3 information[CAIRN_ICP_MAX_PARTS];
} cairn_icp_parts;

/* Writes the information per target part; all zero while an alignment has no complete iteration
 * with enough pairs. Cost: linear in the parts.
 *
 * parts: set to the information of each part */
void cairn_icp_read_parts(const cairn_icp *icp, cairn_icp_parts *parts);

#ifdef __cplusplus
}
#endif

#endif
