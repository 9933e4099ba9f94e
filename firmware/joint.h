/* joint: the last word on all poses at once, with covariances: what a robot asks for when its scans
 * are aligned.
 *
 * Every two scans that share walls are linked by their relative pose, as the points of the one
 * lie on the segments of the other, with its information; a pose graph meets all links in the
 * least squares sense and tells how sure each pose is. Two scans that came one after the other
 * are linked in any case, by the poses that they were given and `spread`. */
#ifndef CAIRN_FIRMWARE_JOINT_H
#define CAIRN_FIRMWARE_JOINT_H

#include "cairn/pose_graph.h"
#include "cairn/scan_set.h"

typedef struct joint_params {
    int32_t max_scans;
    /* >= max_scans; pairs of scans that came later apart are left out beyond */
    int32_t max_links;
    /* of the solver, see cairn/block_solver.h */
    int32_t max_fill;
    /* of a link (10) */
    int32_t min_points;
    /* points are looked at anew from the poses of the round before (3) */
    int32_t rounds;
    /* m from a point to its wall at most (0.1) */
    cairn_real gate;
    /* m, of a point across its wall (0.02) */
    cairn_real sigma;
    /* m, how far two poses are believed to lie right beside each other (0.1) ... */
    cairn_real spread;
    /* rad (0.05) */
    cairn_real spread_angle;
} joint_params;

/* In brackets above; capacities 64, 256 and 512. */
joint_params joint_default(void);

typedef int32_t joint_phase;
enum { JOINT_IDLE, JOINT_LINKS, JOINT_SOLVE, JOINT_MARGINALS };

/* Open for reading; the members below `count` belong to joint.c. */
typedef struct joint {
    joint_params params;
    cairn_pose_graph *graph;
    cairn_pose *poses; /* [count]: of the last round */
    cairn_real(
        /* [count]: row-major over (x, y, theta) in the map; the first pose is held. Zero at
         * first */
        *covariances)[9];
    int32_t count;
    const cairn_scan_set *set;
    /* [count] or NULL */
    const uint8_t *held;
    joint_phase phase;
    int32_t round;
    /* the pair of scans at hand: `first` and the one that came `apart` later */
    int32_t first, apart;
    /* of the later scan; of the first one, the next to be compared with it */
    int32_t segment, other;
    /* of the pair that lie on walls */
    int32_t points;
    cairn_pose first_second;
    /* of that */
    cairn_transform transform;
    /* of the pair so far, over a small motion in the frame of the later scan */
    cairn_sym3 information;
    cairn_real gradient[3];
    /* units that were used but not yet paid */
    int32_t debt;
} joint;

/* Bytes that joint_create() takes from a pool; 0 for params that it would refuse. */
size_t joint_memory(const joint_params *params);

/* All memory from the pool. CAIRN_NO_MEMORY. CAIRN_BAD_ARGUMENT: capacities. */
CAIRN_CHECKED cairn_status joint_create(joint *x, cairn_pool *pool, const joint_params *params);

/* Begins anew with the scans 0 ... count-1 of a set, which must stay as it is until step()
 * returns CAIRN_OK, at these poses. held: [count], which must stay, too, not 0: such scans stay
 * where they are, and two of them are not compared; NULL: the first is held. CAIRN_FULL: more
 * than max_scans. CAIRN_EMPTY: none. */
CAIRN_CHECKED cairn_status joint_begin(joint *x, const cairn_scan_set *set,
                                       const cairn_pose *map_scan, const uint8_t *held,
                                       int32_t count);

/* CAIRN_OK: nothing left to do. CAIRN_MORE. CAIRN_FULL: max_links or max_fill are too small.
 * Other negative ones as those of the graph. Costs per pair of scans two units for eight pairs
 * of segments, and one for two points near a wall. */
CAIRN_CHECKED cairn_status joint_step(joint *x, cairn_budget *budget);

#endif
