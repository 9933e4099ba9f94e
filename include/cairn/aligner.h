/* aligner: joint alignment of many scans with little overlap, from poor initial poses.
 *
 *     add_scan ... -> begin -> step until CAIRN_OK -> read, pose_of
 *
 * Method:
 * 1. Pairwise registration: each candidate pair of scans proposes hypotheses of its relative pose.
 * 2. Agglomerative clustering: clusters of scans are merged, the most certain hypothesis first.
 * 3. Relocalization: a scan that fits badly is searched for again against all other scans.
 * 4. Joint least squares over all poses and all walls that scans share, with marginal covariances
 *    after the best common motion.
 * 5. Scans with a weakly observable direction are translated along it until they match other scans.
 * 6. Groups of scans are translated along the directions of the walls where the evidence of all their
 *    pairs with others gains, by minimum cuts.
 *
 * The log-likelihood ratio of a relative pose gains from points that lie on an oriented surface of
 * the other scan. It loses, far more sharply, from free-space violations: points where the other
 * scan measured free space.
 *
 * The order of the scans has no effect, beyond ties. The result does not depend on the budgets. */
#ifndef CAIRN_ALIGNER_H
#define CAIRN_ALIGNER_H

#include "cairn/block_solver.h"
#include "cairn/object.h"
#include "cairn/scan.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Parameters; defaults in brackets. */
typedef struct cairn_aligner_params {
    /* 1 ... 2^16 (64): number of scans */
    int32_t max_scans;
    /* 1 ... 2^24 (1024): segments of all scans together */
    int32_t max_segments;
    /* 0 ... 2^24 (256): short segments of all scans together: surfaces too short for a direction of
     * their own; those beyond the limit are left out */
    int32_t max_short_segments;
    /* 1 ... 2^24 (4096): points of all scans together */
    int32_t max_points;
    /* 1 ... 2^24 (1536): hypotheses of relative poses; beyond the limit the best ones are kept. Groups
     * are translated when there are at most as many pairs of overlapping scans */
    int32_t max_hypotheses;
    /* 1 ... 2^24 (2048): blocks of the Cholesky factor, as in cairn_block_solver_params */
    int32_t max_fill;
    /* 64 ... 2^24 (25600): cells of the search raster of a relocalization; fewer cells are
     * coarser */
    int32_t max_cells;
    /* m, > 0 (0.6): bound of the error in x and in y of an initial pose, approximately */
    cairn_real max_initial_error;
    /* rad, > 0, <= pi (35 degrees): bound of the error of an initial heading */
    cairn_real max_initial_angle_error;
    /* m, > 0, <= 1e6 (30): longer ranges are not used */
    cairn_real max_range;
    /* m, > 0 (0.01): standard deviation of a range */
    cairn_real range_sigma;
    /* nats, >= 0 (1.5): penalty of a point in space that another scan measured free; 0: none */
    cairn_real free_space_penalty;
    /* 0 or 1 (1): 1: surfaces have a free side; 0: directions are those of lines, modulo half a
     * turn */
    int32_t oriented;
    /* >= 0 (2): rounds of relocalization of badly fitting scans */
    int32_t max_relocalizations;
    /* >= 0 (10): Gauss-Newton iterations of each joint solution; 0: no walls, no covariances */
    int32_t max_iterations;
    /* nats, > 0 (1): clusters are merged only above this log-likelihood ratio, competing hypotheses
     * taken into account */
    cairn_real min_log_likelihood_ratio;
    /* m, > 0 (0.05): a position is observable when its standard deviation (x and y) is below */
    cairn_real observable_sigma;
    /* rad, > 0 (1 degree): a heading is observable when its standard deviation is below */
    cairn_real observable_sigma_theta;
} cairn_aligner_params;

/* State of an alignment, and the reason why it ended. */
typedef int32_t cairn_aligner_verdict;
enum {
    /* running, or nothing was begun */
    CAIRN_ALIGNER_RUNNING = 0,
    /* one connected component; the joint solution converged */
    CAIRN_ALIGNER_CONVERGED = 1,
    /* the joint solution did not converge within max_iterations */
    CAIRN_ALIGNER_OUT_OF_ITERATIONS = 2,
    /* several components without a link between them, or nothing to align: see components */
    CAIRN_ALIGNER_DISCONNECTED = 3,
    /* the joint solution needs more than max_fill blocks: poses without covariances */
    CAIRN_ALIGNER_FILL_EXCEEDED = 4
};

/* Bits of the observable directions of a pose. */
enum {
    /* x of the map frame */
    CAIRN_ALIGNER_X = 1,
    /* y of the map frame */
    CAIRN_ALIGNER_Y = 2,
    /* heading */
    CAIRN_ALIGNER_THETA = 4
};

/* Estimate of a scan's pose. A component lies where its initial poses put it, in the mean. */
typedef struct cairn_aligner_pose {
    /* pose of the scan in the map, m and rad */
    cairn_pose map_scan;
    /* marginal covariance, row-major over (x, y, theta) in m and rad, in the map frame: of the error
     * after the best common motion of the scans that are observable after it; outside component 0
     * that of the initial pose */
    cairn_real covariance[9];
    /* the same, of the error relative to the anchor; outside component 0 that of the initial pose */
    cairn_real anchor_covariance[9];
    /* nats: log-likelihood ratio of the pose given all other scans, violations subtracted */
    cairn_real support;
    /* CAIRN_ALIGNER_X | ..., each bit by its own standard deviation */
    int32_t observable;
    /* 1: in component 0, support at least 2 nats, heading observable, and 2.24 standard deviations
     * of the position (x and y) below observable_sigma: 97.5 % of its errors along a line */
    int32_t placed;
    /* 1: in component 0, support at least 2 nats, position and heading observable relative to the
     * anchor: rigid with it, though the map may consist of groups that are not rigid with each
     * other, and no scan be placed */
    int32_t anchored;
    /* connected component; 0: the largest */
    int32_t component;
} cairn_aligner_pose;

/* Result of an alignment: its verdict, and counts of the work done. */
typedef struct cairn_aligner_result {
    /* how the alignment has ended */
    cairn_aligner_verdict verdict;
    /* connected components, of scans with at least one segment */
    int32_t components;
    /* scans in component 0 */
    int32_t largest_size;
    /* placed scans */
    int32_t placed;
    /* anchored scans */
    int32_t anchored;
    /* scan with the most information, which the joint system fixes; -1: none, no covariances */
    int32_t anchor;
    /* hypotheses of relative poses that were stored */
    int32_t hypotheses;
    /* hypotheses that exceeded max_hypotheses */
    int32_t dropped;
    /* merges of two clusters */
    int32_t merges;
    /* scans that were relocalized, or placed only after the merges */
    int32_t relocalized;
    /* Gauss-Newton iterations of the last joint solution */
    int32_t iterations;
    /* walls that two or more scans share */
    int32_t walls;
    /* blocks of the Cholesky factor, the maximum */
    int32_t fill;
    /* m: standard deviation of x and of y of the initial poses, as estimated */
    cairn_real initial_sigma;
    /* rad: standard deviation of the initial headings, as estimated */
    cairn_real initial_sigma_theta;
    /* work units of all steps */
    int64_t units;
    /* work units of the most expensive operation, but for those of the solver */
    int32_t worst_step;
} cairn_aligner_result;

/* Joint alignment of scans from poor initial poses. */
typedef struct cairn_aligner cairn_aligner;

/* Returns the default parameters. */
cairn_aligner_params cairn_aligner_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_aligner_check(const cairn_aligner_params *params,
                                               cairn_object_fault *fault);

/* Returns the bytes that create() takes; 0 for params that create() would refuse. */
size_t cairn_aligner_memory(const cairn_aligner_params *params);

/* Creates the object in memory of the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_aligner_create(cairn_aligner **aligner, cairn_pool *pool,
                                                const cairn_aligner_params *params);

/* Adds a scan with the initial pose map_scan. The needed data are copied; the scan's index is the
 * number of scans before it. A scan without segments keeps its initial pose. Ends a running
 * alignment.
 *
 * CAIRN_BAD_ARGUMENT: NULL, a view that cairn_scan_view_check() refuses, a pose beyond 1e6 m.
 * CAIRN_NOT_FINITE. CAIRN_FULL: more scans, segments or points than params allow. *fault, when not
 * NULL, names the field and the index. Cost: beams times segments of the scan.
 *
 * view: scan with its segments, points and beams */
CAIRN_CHECKED cairn_status cairn_aligner_add_scan(cairn_aligner *aligner,
                                                  const cairn_scan_view *view, cairn_pose map_scan,
                                                  cairn_fault *fault);

/* Sets the initial pose of a scan. Ends a running alignment. CAIRN_BAD_ARGUMENT: NULL, no such
 * scan, a pose beyond 1e6 m. CAIRN_NOT_FINITE. Linear in the scans the first time after an
 * alignment, then constant time. */
CAIRN_CHECKED cairn_status cairn_aligner_set_initial_pose(cairn_aligner *aligner, int32_t scan,
                                                          cairn_pose map_scan);

/* Removes all scans. Constant time. */
void cairn_aligner_clear(cairn_aligner *aligner);

/* Starts an alignment from the initial poses. CAIRN_BAD_ARGUMENT: NULL. CAIRN_EMPTY: no scans.
 * Linear in the scans. */
CAIRN_CHECKED cairn_status cairn_aligner_begin(cairn_aligner *aligner);

/* Starts an alignment from the result of the last one (warm start). Anchored scans keep
 * their relative poses. The others are relocalized about map_scan[i], a pose in the map frame of that
 * result, which becomes their initial pose. The heading search covers 0.4 of that of begin(), as
 * another method, which aligns walls in parallel, has moved these scans. The result stays unless a
 * scan is relocalized; then the joint solution runs again.
 *
 * CAIRN_EMPTY: no alignment has ended since scans were added or one was begun. CAIRN_BAD_ARGUMENT:
 * NULL, a pose beyond 1e6 m. CAIRN_NOT_FINITE. Linear in the scans. The steps cost the
 * relocalization alone unless one succeeds.
 *
 * map_scan: [scans] poses, not read of anchored scans */
CAIRN_CHECKED cairn_status cairn_aligner_begin_warm(cairn_aligner *aligner,
                                                    const cairn_pose *map_scan);

/* Continues the alignment. CAIRN_MORE: the budget is used up. CAIRN_OK: the alignment has ended. An
 * operation is charged before it is done, in several calls if the budget is used up in between. At
 * most it is the comparison of 8 points with a scan, about 2400 votes in the raster, all points of
 * a scan drawn into it, or one pass over the raster, the scans, the segments or the walls, or over
 * a 32nd of the hypotheses. A scan is compared with at most 48 others, the nearest by the initial
 * poses. Total cost: about linear in the scans at equal density, plus one test of the initial poses
 * per pair of scans. */
CAIRN_CHECKED cairn_status cairn_aligner_step(cairn_aligner *aligner, cairn_budget *budget);

/* Continues like step(), but also returns CAIRN_OK at each commit point, so that a caller can
 * display the progress. Commit points: a merge or relaxation of clusters, the end of a
 * relocalization, an iteration of the joint solution. */
CAIRN_CHECKED cairn_status cairn_aligner_iterate(cairn_aligner *aligner, cairn_budget *budget);

/* Returns 1 while step() has work left. */
int32_t cairn_aligner_running(const cairn_aligner *aligner);

/* Returns the pose of a scan at the last commit point; identity, and *part = -1, for a scan that
 * does not exist. Not meaningful between commit points. *part, when not NULL: label of the scan's
 * cluster, 0 ... scan_count - 1; a label may be used again for another cluster. Linear in the
 * cluster.
 *
 * scan: index of the scan */
cairn_pose cairn_aligner_current_pose(const cairn_aligner *aligner, int32_t scan, int32_t *part);

/* ---- The result: the initial poses until step() returns CAIRN_OK ---- */

/* Returns the number of scans. */
int32_t cairn_aligner_scan_count(const cairn_aligner *aligner);

/* Returns 1 when two scans constrain each other along the direction `along`: the last joint
 * solution has both on one wall; the first scan, at the pose second_first, lies on this wall within
 * 0.03 m; and the wall crosses `along` at 30 degrees or more. along: unit vector in the frame of
 * the first scan. Returns 0 for scans that do not exist and while an alignment is running. *units,
 * when not NULL: the cost, at most the product of the two scans' segments.
 *
 * first, second: indices of the scans */
int32_t cairn_aligner_share_wall(const cairn_aligner *aligner, int32_t first, int32_t second,
                                 cairn_pose second_first, cairn_vec2 along, int32_t *units);

/* Returns 1 when two scans are a candidate pair: near enough by their initial poses to be compared.
 * Cost: a quarter of a unit.
 *
 * first, second: indices of the scans */
int32_t cairn_aligner_is_candidate_pair(const cairn_aligner *aligner, int32_t first,
                                        int32_t second);

/* Returns the log-likelihood, in nats, <= 0, of the free-space violations of a relative pose of two
 * scans: surfaces of one scan where the other measured free space or another surface. 0 for scans
 * that do not exist or cannot overlap in this pose. *units, when not NULL: the cost, one per point
 * of both scans.
 *
 * first, second: indices of the scans */
cairn_real cairn_aligner_free_space_violation(const cairn_aligner *aligner, int32_t first,
                                              int32_t second, cairn_pose second_first,
                                              int32_t *units);

/* Returns the result; its verdict is RUNNING until step() returns CAIRN_OK. */
cairn_aligner_result cairn_aligner_read(const cairn_aligner *aligner);

/* Returns the estimate of a scan's pose; all zero for a scan that does not exist.
 *
 * scan: index of the scan */
cairn_aligner_pose cairn_aligner_pose_of(const cairn_aligner *aligner, int32_t scan);

#ifdef __cplusplus
}
#endif

#endif
