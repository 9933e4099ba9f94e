/* robot: the library in the main loop of a robot, independent of the machine: inputs, ticks with a
 * budget, results.
 *
 * Scans are offered one after another. Every tick performs one bounded step of: taking a scan
 * (add), its line fit (fit), the alignment of all scans (pair), the joint optimization of all
 * aligned poses (solve), or drawing the scans into the grid at their current poses (grid). The
 * state is a function of the offers and the budgets of the ticks alone, so that a recording
 * (recorder.h) replays bit by bit. */
#ifndef CAIRN_FIRMWARE_ROBOT_H
#define CAIRN_FIRMWARE_ROBOT_H

#include "cairn/force_field.h"
#include "cairn/occupancy_grid.h"
#include "cairn/scan.h"
#include "firmware/hash.h"
#include "firmware/joint.h"

/* Maximum number of scans of a robot. */
enum { ROBOT_SCANS = 64 };

/* A sweep of the scanner with the robot's pose estimate (odometry). */
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
    joint_params joint; /* capacity of scans equal to that of the field */
} robot_params;

/* Kind of work of a tick. */
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
    int32_t fitting;  /* 1: the last scan taken is not yet in the field */
    int32_t aligned;  /* 1: the field has converged */
    int32_t solving;  /* 1: the joint optimization is running */
    int32_t solved;   /* 1: the joint optimization is complete for all scans in the field */
    int32_t finished; /* 1: no more scans will arrive */
    int32_t drawn;    /* scans of the current drawing that are in the grid */
    int32_t beam;     /* next beam of the scan that is being drawn */
    int32_t last;     /* 1: the current drawing started after the last optimization */
    int32_t done;     /* 1: that drawing is complete */
    uint32_t ticks;
} robot;

/* Creates all objects in the memory. Statuses of the objects' _create(), CAIRN_BAD_ARGUMENT: more
 * than ROBOT_SCANS scans. */
CAIRN_CHECKED cairn_status robot_create(robot *r, void *memory, size_t bytes,
                                        const robot_params *params);

/* Offers the next sweep, whose ranges must stay valid; a later tick takes it. CAIRN_MORE: the
 * previous sweep has not been taken yet, or its line fit is running; nothing was done.
 * CAIRN_FULL. */
CAIRN_CHECKED cairn_status robot_offer(robot *r, const robot_sweep *sweep);

/* Declares that no more sweeps will arrive. */
void robot_finish(robot *r);

/* Performs one step. CAIRN_OK: all poses are optimized, all scans drawn, no sweep will arrive.
 * CAIRN_MORE: call again. Negative: status of the step. */
CAIRN_CHECKED cairn_status robot_tick(robot *r, cairn_budget *budget, robot_work *work);

/* Returns the current pose of a scan, 0 <= scan < cairn_force_field_pose_count(r->field): that of
 * the joint optimization when it covers all scans, else that of the field. */
cairn_pose robot_pose(const robot *r, int32_t scan);

/* Returns the hash, initially HASH_START, updated with the raw bytes of all poses and covariances,
 * the potential and all cells of the grid. */
uint32_t robot_hash(const robot *r, uint32_t hash);

#endif
