/* icp: iterative closest points of oriented points against a local map, point to point or point to
 * line.
 *
 * The target is a set of oriented points that the caller adds scan by scan; the query is one
 * array of oriented points and a start pose. Each iteration pairs every query point with the
 * nearest target point within a distance gate whose direction agrees, and takes one Gauss-Newton
 * step on the robustly weighted distances (Besl and McKay 1992; Chen and Medioni 1992).
 * Directions of motion that the pairs do not tell (along a corridor, around a round room) are
 * found, named, and left to the prior or left alone. */
#ifndef CAIRN_ICP_H
#define CAIRN_ICP_H

#include "cairn/pool.h"
#include "cairn/rigid_motion.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_icp cairn_icp;

typedef int32_t cairn_icp_mode;
enum {
    CAIRN_ICP_POINT_TO_POINT = 0,
    /* distance along the normal of the target point: points may slide along their line */
    CAIRN_ICP_POINT_TO_LINE = 1
};

typedef struct cairn_icp_params {
    /* points, 1 ... 2^24; memory grows by 2 points and 2 to 3 int32_t for each */
    int32_t max_target;
    /* >= 1 */
    int32_t max_iterations;
    /* >= 4; with fewer the alignment ends */
    int32_t min_pairs;
    cairn_icp_mode mode;
    /* side of the search cells, m; about half the gate is fastest */
    cairn_real cell;
    /* largest distance of a pair in the first iteration, m */
    cairn_real gate_start;
    /* ... and at the end, m, <= gate_start: the gate shrinks in between */
    cairn_real gate_end;
    /* gate = this times the mean distance of the last pairs, never growing */
    cairn_real gate_factor;
    /* largest angle between the oriented directions of a pair, rad, (0, pi] */
    cairn_real direction_gate;
    /* least standard deviation of a point across its line that is believed, m */
    cairn_real sigma;
    /* converged when a step moves less than this, m, ... */
    cairn_real converged_distance;
    /* ... and turns less than this, rad */
    cairn_real converged_angle;
    /* a direction is not observable when its information is less than this share of the best
     * one's, in [0, 1) */
    cairn_real weak_ratio;
    /* 1: an iteration after which fewer points have a pair, and those pairs are farther apart,
     * is taken back and ends the alignment (Adluru 2008, section 6.6) */
    int32_t roll_back;
} cairn_icp_params;

/* Point to line; 4096 points; 40 iterations; 10 pairs; gate 0.5 -> 0.1 m at 3 mean distances; 60
 * degrees; sigma 0.01 m; converged below 1e-4 m and 1e-4 rad; weak below 0.01; no roll-back. */
cairn_icp_params cairn_icp_default(void);

typedef int32_t cairn_icp_verdict;
enum {
    /* or nothing begun */
    CAIRN_ICP_RUNNING = 0,
    CAIRN_ICP_CONVERGED = 1,
    CAIRN_ICP_OUT_OF_ITERATIONS = 2,
    /* the pose is that of the last iteration that had enough */
    CAIRN_ICP_TOO_FEW_PAIRS = 3,
    /* no prior, and the pose did not move in the weak directions; see `weak` */
    CAIRN_ICP_UNOBSERVABLE = 4,
    /* the pose is that before the last iteration; the covariance has its pairs */
    CAIRN_ICP_ROLLED_BACK = 5
};

typedef struct cairn_icp_result {
    cairn_pose target_query; /* the query's frame in the target's */
    /* Row-major over (x, y, theta) of target_query, in the target's frame; zero while running.
     * The inverse of the point-to-line information of the observable directions, scaled by the
     * residuals' variance, plus that of the prior. What nothing is known of gets 100 m, about
     * the query's centroid and with rotations times `radius`. Right when the errors of the
     * points are independent; points resampled from a fitted segment share its error, and true
     * errors are larger. */
    cairn_real covariance[9];
    /* of the pairs, m */
    cairn_real mean_distance;
    /* robust standard deviation of the pairs across the line, m, >= params.sigma */
    cairn_real sigma;
    /* distance gate of the last iteration, m */
    cairn_real gate;
    /* share of query points that have a pair */
    cairn_real overlap;
    /* The least observable motion about the query's centroid: unit vector over (x, y, theta
     * times `radius`) in the target's frame, sign free, and its information as a share of the
     * best observable motion's. */
    cairn_real weak[3];
    cairn_real weak_ratio;
    cairn_real radius;  /* of the query points about their centroid, root mean square, m */
    int32_t observable; /* how many of three independent motions the pairs tell: 3 is good */
    int32_t pairs;
    int32_t iterations;
    cairn_icp_verdict verdict;
} cairn_icp_result;

/* 0 for params that create() would refuse. */
size_t cairn_icp_memory(const cairn_icp_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_icp_create(cairn_icp **icp, cairn_pool *pool,
                                            const cairn_icp_params *params);

/* Forgets the target and ends an alignment that is running. Cost: linear in max_target. */
void cairn_icp_clear_target(cairn_icp *icp);

/* Adds points[0 ... count-1], mapped by target_points, to the target; they are copied.
 * CAIRN_BAD_ARGUMENT: count < 0, NULL with count > 0, a direction whose length is not 1 within 1
 * %, or an alignment is running. CAIRN_NOT_FINITE. CAIRN_FULL: more than max_target in all.
 * *fault, when not NULL, tells the point. Cost: a linear pass over the points. */
CAIRN_CHECKED cairn_status cairn_icp_add_target(cairn_icp *icp, const cairn_oriented_point *points,
                                                int32_t count, cairn_pose target_points,
                                                cairn_fault *fault);

int32_t cairn_icp_target_count(const cairn_icp *icp);

/* Starts to align query[0 ... count-1], which must stay until step() returns CAIRN_OK; an
 * alignment that is running is dropped. prior: NULL when nothing is known. CAIRN_EMPTY: no query
 * or no target points. CAIRN_BAD_ARGUMENT: count < 0, NULL query, directions as in add_target(),
 * sigmas that are not > 0. CAIRN_NOT_FINITE. Cost: a linear pass over the query. */
CAIRN_CHECKED cairn_status cairn_icp_begin(cairn_icp *icp, const cairn_oriented_point *query,
                                           int32_t count, cairn_pose start,
                                           const cairn_pose_prior *prior, cairn_fault *fault);

/* weak_ratio of the alignments that begin from now on. CAIRN_BAD_ARGUMENT: not in [0, 1), or an
 * alignment is running. */
CAIRN_CHECKED cairn_status cairn_icp_set_weak_ratio(cairn_icp *icp, cairn_real weak_ratio);

/* CAIRN_OK: nothing left to do, the verdict stands. CAIRN_MORE: go on. Costs 5 units for a query
 * point, one more for every 6 target points and cells that the search for its partner looks at,
 * and 12 at the end of an iteration. */
CAIRN_CHECKED cairn_status cairn_icp_step(cairn_icp *icp, cairn_budget *budget);

/* State after the last whole iteration. */
cairn_icp_result cairn_icp_read(const cairn_icp *icp);

/* Which part of the target tells what. A part is what one add_target() added; those beyond
 * CAIRN_ICP_PARTS are one with the last. */
#define CAIRN_ICP_PARTS 64

typedef struct cairn_icp_parts {
    /* of the query as it was aligned: what the information is about */
    cairn_rigid_motion motion;
    int32_t count;
    /* point-to-line, of the pairs with each part in the last whole iteration */
    cairn_sym3 information[CAIRN_ICP_PARTS];
} cairn_icp_parts;

/* All zero while an alignment has no whole iteration with enough pairs. Cost: linear in the
 * parts. */
void cairn_icp_read_parts(const cairn_icp *icp, cairn_icp_parts *parts);

#ifdef __cplusplus
}
#endif

#endif
