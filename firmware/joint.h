/* joint: joint optimization of all poses of a robot by a pose graph, with covariances, after its
 * scans are aligned.
 *
 * Every two scans that share walls are linked by a relative pose from point-to-line registration,
 * with its information matrix. The pose graph is solved in the least squares sense and gives the
 * covariance of each pose. Consecutive scans are always linked, with the given relative pose as a
 * prior of standard deviation `spread`. */
#ifndef CAIRN_FIRMWARE_JOINT_H
#define CAIRN_FIRMWARE_JOINT_H

#include "cairn/pose_graph.h"
#include "cairn/scan_set.h"

typedef struct joint_params {
    int32_t max_scans;
    /* >= max_scans; when the links are full, pairs with a large index gap are skipped */
    int32_t max_links;
    /* fill blocks of the sparse solver, see cairn/block_solver.h */
    int32_t max_fill;
    /* minimum number of point correspondences of a link (10) */
    int32_t min_points;
    /* rounds of data association: correspondences are recomputed at the new poses (3) */
    int32_t rounds;
    /* m, correspondence gate: maximum distance of a point from its wall (0.1) */
    cairn_real gate;
    /* m, standard deviation of a point normal to its wall (0.02) */
    cairn_real sigma;
    /* m, standard deviation of the prior on the relative position of consecutive scans (0.1) */
    cairn_real spread;
    /* rad, standard deviation of the prior on the relative heading (0.05) */
    cairn_real spread_angle;
} joint_params;

/* Returns the default params: the values in brackets above; capacities 64, 256 and 512. */
joint_params joint_default(void);

typedef int32_t joint_phase;
enum { JOINT_IDLE, JOINT_LINKS, JOINT_SOLVE, JOINT_MARGINALS };

/* Open for reading; the members below `count` belong to joint.c. */
typedef struct joint {
    joint_params params;
    cairn_pose_graph *graph;
    cairn_pose *poses; /* [count] poses of the last round */
    /* [count] row-major over (x, y, theta) in the map; the first pose is fixed. Zero at the
     * start */
    cairn_real (*covariances)[9];
    int32_t count;
    const cairn_scan_set *set;
    /* [count] 1: the pose is fixed; or NULL */
    const uint8_t *fixed;
    joint_phase phase;
    int32_t round;
    /* the current pair of scans: first and first + index_gap */
    int32_t first, index_gap;
    /* current segment of the later scan; next segment of the first scan to be compared with it */
    int32_t segment, other;
    /* correspondences of the current pair */
    int32_t points;
    cairn_pose first_second;
    /* transform of first_second */
    cairn_transform transform;
    /* normal equations of the current pair, over a small motion in the frame of the later scan */
    cairn_sym3 information;
    cairn_real gradient[3];
    /* work units used but not yet charged to a budget */
    int32_t pending_units;
} joint;

/* Returns the bytes that joint_create() takes from a pool; 0 for invalid params. */
size_t joint_memory(const joint_params *params);

/* Creates the object in the pool. CAIRN_NO_MEMORY. CAIRN_BAD_ARGUMENT: capacities. */
CAIRN_CHECKED cairn_status joint_create(joint *optimizer, cairn_pool *pool,
                                        const joint_params *params);

/* Starts an optimization of the scans 0 ... count-1 of a set at the given poses. The set must not
 * change until step() returns CAIRN_OK. fixed: [count], valid as long; not 0: the pose is fixed,
 * and two fixed scans are not compared; NULL: the first pose is fixed. CAIRN_FULL: more than
 * max_scans. CAIRN_EMPTY: none. */
CAIRN_CHECKED cairn_status joint_begin(joint *optimizer, const cairn_scan_set *set,
                                       const cairn_pose *map_scan, const uint8_t *fixed,
                                       int32_t count);

/* Performs one bounded step. CAIRN_OK: done. CAIRN_MORE: call again. CAIRN_FULL: max_links or
 * max_fill is too small. Other negative statuses: those of the pose graph. Costs per pair of scans
 * two units for eight pairs of segments, and one for two points near a wall. */
CAIRN_CHECKED cairn_status joint_step(joint *optimizer, cairn_budget *budget);

#endif
