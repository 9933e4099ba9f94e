/* pose_graph_robust: pose graph optimization with rejection of outlier links.
 *
 * 1. Least squares of all links.
 * 2. Chi-squared test: chi2 must not exceed its mean by more than max_deviations standard
 *    deviations, with 3 links - 3 poses degrees of freedom. If it passes, the solution is final.
 * 3. Otherwise robust estimation with the Geman-McClure kernel from the initial poses.
 * 4. Links whose chi2 there exceeds max_chi2 of the graph are outliers and are excluded. Least
 *    squares of the inliers gives the solution.
 *
 *     begin(graph) -> step(budget) until CAIRN_OK -> read(), the readers of the graph
 *
 * Memory: the initial poses. The graph is the caller's. */
#ifndef CAIRN_POSE_GRAPH_ROBUST_H
#define CAIRN_POSE_GRAPH_ROBUST_H

#include "cairn/pose_graph.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Robust optimizer of a pose graph. */
typedef struct cairn_pose_graph_robust cairn_pose_graph_robust;

/* Parameters; defaults in brackets. */
typedef struct cairn_pose_graph_robust_params {
    /* 1 ... 2^22 (1000): largest number of poses of a graph */
    int32_t max_poses;
    /* standard deviations, > 0 (6): threshold of the chi-squared test; CAIRN_REAL_MAX: no link is
     * rejected */
    cairn_real max_deviations;
    /* standard deviations, > 0, <= 1e6 (3): width of the robust kernel */
    cairn_real kernel_width;
} cairn_pose_graph_robust_params;

/* Result of an optimization. */
typedef struct cairn_pose_graph_robust_result {
    /* 1: least squares failed the chi-squared test, and the robust kernel was used */
    int32_t is_robust;
    /* number of rejected links */
    int32_t outliers;
    /* chi2 of all links at the initial poses */
    cairn_real chi2_initial;
} cairn_pose_graph_robust_result;

/* Returns the default parameters. */
cairn_pose_graph_robust_params cairn_pose_graph_robust_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_pose_graph_robust_check(
    const cairn_pose_graph_robust_params *params, cairn_object_fault *fault);

/* Returns the bytes that create() takes from the pool; 0 for invalid params. */
size_t cairn_pose_graph_robust_memory(const cairn_pose_graph_robust_params *params);

/* Creates an optimizer in the pool. CAIRN_BAD_ARGUMENT: NULL or invalid params. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status
cairn_pose_graph_robust_create(cairn_pose_graph_robust **robust, cairn_pool *pool,
                               const cairn_pose_graph_robust_params *params);

/* Starts to optimize a graph from its current poses; links that are excluded are included again. An
 * optimization in progress is dropped. The graph must stay valid and unchanged until step() returns
 * CAIRN_OK. CAIRN_BAD_ARGUMENT: NULL, or a solution of the graph is running. CAIRN_EMPTY: no poses.
 * CAIRN_FULL: more than max_poses. Constant time.
 *
 * graph: a graph of which no solution is running */
CAIRN_CHECKED cairn_status cairn_pose_graph_robust_begin(cairn_pose_graph_robust *robust,
                                                         cairn_pose_graph *graph);

/* Continues. CAIRN_OK: nothing left to do; rejected links are excluded from the graph, and its
 * state is that of the last least squares. If the inliers do not connect the graph, its verdict is
 * CAIRN_POSE_GRAPH_DISCONNECTED, and the poses are those of the robust kernel. CAIRN_MORE: the
 * budget is used up. CAIRN_FULL: as cairn_pose_graph_step(); the next step continues once
 * cairn_pose_graph_extend() has taken place. CAIRN_BAD_ARGUMENT: NULL. Other statuses of
 * cairn_pose_graph_solve() and cairn_pose_graph_step(). Cost: that of the solutions, up to three,
 * and a unit for 8 poses or links of each of up to seven passes. */
CAIRN_CHECKED cairn_status cairn_pose_graph_robust_step(cairn_pose_graph_robust *robust,
                                                        cairn_budget *budget);

/* Returns the result of the last optimization that has ended. */
cairn_pose_graph_robust_result cairn_pose_graph_robust_read(const cairn_pose_graph_robust *robust);

#ifdef __cplusplus
}
#endif

#endif
