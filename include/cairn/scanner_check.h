/* scanner_check: finds what is set wrongly of the scanner of a drive: unit of the ranges,
 * upside-down mounting, angle step, duration of a scan, mounting pose; scale of the odometry; stamps
 * and scans that repeat.
 *
 *     begin(drive) -> step(budget) until CAIRN_OK -> read() -> has(fault)
 *
 * The scans of the whole drive are needed at once, as pairs of them are matched again after each
 * correction. Without odometry only unit, angle step, duration, stamps are checked. */
#ifndef CAIRN_SCANNER_CHECK_H
#define CAIRN_SCANNER_CHECK_H

#include "cairn/object.h"
#include "cairn/pool.h"
#include "cairn/scan.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Check of a scanner. */
typedef struct cairn_scanner_check cairn_scanner_check;

/* Parameters; defaults in brackets. */
typedef struct cairn_scanner_check_params {
    /* 1 ... 100,000 (1024): beams of a scan */
    int32_t max_beams;
    /* 1 ... 2^20 (4096): evenly spaced points of a scan */
    int32_t max_points;
    /* 1 ... 2^20 (512): segments of a scan */
    int32_t max_segments;
    /* 2 ... 65536 (300): pairs of scans that are matched, spread over the drive */
    int32_t max_pairs;
    /* 1 ... 1024 (16): straight walls of a scan that are measured */
    int32_t max_walls;
} cairn_scanner_check_params;

/* Returns the default parameters. */
cairn_scanner_check_params cairn_scanner_check_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_scanner_check_check(const cairn_scanner_check_params *params,
                                                     cairn_object_fault *fault);

/* Returns the bytes that create() takes; 0 for params that create() would refuse. */
size_t cairn_scanner_check_memory(const cairn_scanner_check_params *params);

/* Creates the object in memory of the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_scanner_check_create(cairn_scanner_check **check, cairn_pool *pool,
                                                      const cairn_scanner_check_params *params);

/* A scan of the drive. */
typedef struct cairn_scanner_check_scan {
    /* The scan as logged; `motion` is not read. The mounting is that of the first scan. */
    cairn_scan_input input;
    /* pose of the robot by the odometry; not read without odometry */
    cairn_pose robot;
} cairn_scanner_check_scan;

/* Takes the scans of a drive, which must not change until step() returns CAIRN_OK; a running check
 * is cancelled. A scan that cairn_scan_begin() would refuse otherwise is left out of the matches.
 * CAIRN_BAD_ARGUMENT: NULL, a scan without ranges or below one beam, a stamp beyond
 * CAIRN_SCAN_MAX_STAMP_NS. CAIRN_EMPTY: no scan. CAIRN_FULL: a scan of more than max_beams.
 * CAIRN_NOT_FINITE: a pose. *fault gives the index of the scan. Cost: linear in the scans.
 *
 * scans: [count] scans in the order of the drive
 * has_odometry: 0: the robot's poses say nothing */
CAIRN_CHECKED cairn_status cairn_scanner_check_begin(cairn_scanner_check *check,
                                                     const cairn_scanner_check_scan *scans,
                                                     int32_t count, int32_t has_odometry,
                                                     cairn_fault *fault);

/* Continues. CAIRN_OK: the result is there. CAIRN_MORE: the budget is used up. CAIRN_BAD_ARGUMENT:
 * NULL. All pairs are matched at most 20 times. The most expensive item is linear in the beams of
 * a scan. The result does not depend on the budgets. */
CAIRN_CHECKED cairn_status cairn_scanner_check_step(cairn_scanner_check *check,
                                                    cairn_budget *budget);

/* An estimate. */
typedef struct cairn_scanner_check_value {
    /* the estimate, and its standard deviation by the jackknife over 20 parts of the drive */
    cairn_real value, sigma;
    /* 0: the scans do not determine it; value and sigma are 0 */
    int32_t is_known;
} cairn_scanner_check_value;

/* What was found. Estimates are of the whole drive, after correction of the faults before them in
 * this order. */
typedef struct cairn_scanner_check_result {
    /* scans of the drive */
    int32_t scans;
    /* pairs of scans that were matched */
    int32_t pairs;
    /* pairs with a turn */
    int32_t turns;
    /* straight walls that were measured */
    int32_t walls;
    /* 0: there is no odometry, or it never moves */
    int32_t has_odometry;
    /* scans after a motion by the odometry */
    int32_t moved;
    /* of these: with the same ranges as the scan before */
    int32_t repeated;
    /* scans stamped earlier than the one before */
    int32_t backward;
    /* scans with the stamp of the one before */
    int32_t constant;
    /* median of the ranges that are returns, as logged; 0: there is none */
    cairn_real median_range;
    /* rad, > 0: mean angle from beam to beam of the first scan, as logged; 0: one beam */
    cairn_real angle_step;
    /* s: from the first beam to the last, as logged; 0: unknown */
    cairn_real sweep;
    /* mounting pose of the sensor on the robot, as logged */
    cairn_pose base_sensor;
    /* factor that makes the ranges metres; 1: none is needed */
    cairn_real range_scale;
    /* turns of the scans per turn of the odometry, as logged */
    cairn_scanner_check_value turn;
    /* 1: scans turn against the odometry */
    int32_t flips;
    /* true angle step per logged one, from the bend of walls */
    cairn_scanner_check_value step;
    /* the same from overlapping scans of the mapped drive, by angle_step.h: an input of has(), not
     * known unless the caller sets it */
    cairn_scanner_check_value overlap_step;
    /* s: duration of a scan, from the bend of walls; < 0: the last beam is measured first */
    cairn_scanner_check_value sweep_found;
    /* motions of the scans per motion of the odometry */
    cairn_scanner_check_value distance;
    /* turns, likewise, after correction of the step */
    cairn_scanner_check_value turn_scale;
    /* m, m, rad: the sensor on the robot */
    cairn_scanner_check_value x, y, theta;
} cairn_scanner_check_result;

/* Returns the result of the last check; all 0 until step() returns CAIRN_OK. */
cairn_scanner_check_result cairn_scanner_check_read(const cairn_scanner_check *check);

/* Cost of the last check. */
typedef struct cairn_scanner_check_measure {
    /* work units charged */
    int64_t units;
    /* how often all pairs were matched */
    int32_t rounds;
} cairn_scanner_check_measure;

/* Returns the cost of the last check. */
cairn_scanner_check_measure cairn_scanner_check_measured(const cairn_scanner_check *check);

/* What may be wrong of a drive. */
typedef int32_t cairn_scanner_check_fault;
enum {
    /* unit of the ranges */
    CAIRN_SCANNER_CHECK_RANGES = 0,
    /* scanner upside down, or bearings of the wrong sense */
    CAIRN_SCANNER_CHECK_FLIP = 1,
    /* angle step, field of view */
    CAIRN_SCANNER_CHECK_STEP = 2,
    /* duration of a scan */
    CAIRN_SCANNER_CHECK_SWEEP = 3,
    /* mounting pose */
    CAIRN_SCANNER_CHECK_SENSOR = 4,
    /* the odometry's distances */
    CAIRN_SCANNER_CHECK_DISTANCE = 5,
    /* the odometry's turns */
    CAIRN_SCANNER_CHECK_TURN = 6,
    /* stamps go backward, or stand still */
    CAIRN_SCANNER_CHECK_STAMPS = 7,
    /* the same scan again and again */
    CAIRN_SCANNER_CHECK_REPEATED = 8,
    /* number of faults */
    CAIRN_SCANNER_CHECK_FAULTS = 9
};

/* Returns 1 when the bend of walls gives a step that differs significantly, by less than 1 %: walls
 * that are not plane and ranges that depend on the angle of incidence bend them as much. has() then
 * needs overlap_step. 0 also for NULL.
 *
 * result: of a check */
int32_t cairn_scanner_check_needs_overlap(const cairn_scanner_check_result *result);

/* Returns 1 when the check has found the fault: clearly significant, and large enough to matter; 0
 * also for a fault that there is not. An angle step that differs by less than 1 % is one only when
 * overlap_step differs by more than four standard deviations, too, and agrees with it within three.
 *
 * result: of a check
 * kind: one of the faults above */
int32_t cairn_scanner_check_has(const cairn_scanner_check_result *result,
                                cairn_scanner_check_fault kind);

#ifdef __cplusplus
}
#endif

#endif
