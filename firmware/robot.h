/* robot: the library in the loop of a robot, apart from any machine: inputs, ticks with a budget,
 * results.
 *
 * Scans are offered one after another, and every tick does one bounded step of one of: take in a
 * scan (add), its line fit (fit), the alignment of all scans that have come (pair), the joint
 * solution of all poses once they are aligned (solve), drawing the scans into the grid at their
 * best poses so far (grid). What happens is a function of the offers and the budgets of the
 * ticks, so that a recording of them (recorder.h) can be played back to the same bits. */
#ifndef CAIRN_FIRMWARE_ROBOT_H
#define CAIRN_FIRMWARE_ROBOT_H

#include "cairn/force_field.h"
#include "cairn/occupancy_grid.h"
#include "cairn/scan.h"
#include "firmware/hash.h"
#include "firmware/joint.h"

/* Most scans of a robot. */
enum { ROBOT_SCANS = 64 };

/* A sweep as the scanner gives it, with the pose that the robot believes in. */
typedef struct robot_sweep {
    const float *range; /* [count] m */
    int32_t count;
    float angle_min, angle_step; /* rad */
    cairn_pose pose;
} robot_sweep;

typedef struct robot_params {
    float range_max;   /* m */
    float range_sigma; /* m */
    cairn_scan_params scan;
    cairn_force_field_params field; /* at most ROBOT_SCANS scans */
    cairn_occupancy_grid_params grid;
    joint_params joint; /* of as many scans as the field */
} robot_params;

/* What a tick did. */
typedef int32_t robot_work;
enum { ROBOT_ADD, ROBOT_FIT, ROBOT_PAIR, ROBOT_SOLVE, ROBOT_GRID, ROBOT_IDLE, ROBOT_WORKS };

/* Open for reading; the members below `grid` belong to robot.c. */
typedef struct robot {
    robot_params params;
    cairn_pool pool;
    cairn_scan *scan;
    cairn_force_field *field;
    cairn_occupancy_grid *grid;
    joint joint;
    robot_sweep sweep[ROBOT_SCANS]; /* [offered] */
    int32_t offered, taken;
    int32_t fitting;  /* the last one taken is not yet in the field */
    int32_t aligned;  /* the field has nothing left to do */
    int32_t solving;  /* the joint solution is under way */
    int32_t solved;   /* ... and has ended for all scans in the field */
    int32_t finished; /* no more scans will come */
    int32_t drawn;    /* scans of the drawing under way that are in the grid */
    int32_t beam;     /* next beam of the scan that is being drawn */
    int32_t last;     /* the drawing under way began when all was solved, ... */
    int32_t done;     /* ... and has ended */
    uint32_t ticks;
} robot;

/* All objects in the memory. Statuses of the objects' _create(), CAIRN_BAD_ARGUMENT: more than
 * ROBOT_SCANS scans. */
CAIRN_CHECKED cairn_status robot_create(robot *r, void *memory, size_t bytes,
                                        const robot_params *params);

/* Offers the next sweep, whose ranges must stay; it is taken in by a tick to come. CAIRN_MORE:
 * the one before has not been taken in yet, or its line fit is under way; nothing was done.
 * CAIRN_FULL. */
CAIRN_CHECKED cairn_status robot_offer(robot *r, const robot_sweep *sweep);

/* No more sweeps will come. */
void robot_finish(robot *r);

/* One step. CAIRN_OK: all is solved and drawn and no sweep will come. CAIRN_MORE: go on.
 * Negative: what the step said. */
CAIRN_CHECKED cairn_status robot_tick(robot *r, cairn_budget *budget, robot_work *work);

/* The best pose so far of a scan, 0 <= scan < cairn_force_field_pose_count(r->field): that of
 * the joint solution when there is one of all scans, else the field's. */
cairn_pose robot_pose(const robot *r, int32_t scan);

/* The hash so far, at first HASH_START, with the raw bytes of all poses and covariances, the
 * potential and all cells of the grid. */
uint32_t robot_hash(const robot *r, uint32_t hash);

#endif
