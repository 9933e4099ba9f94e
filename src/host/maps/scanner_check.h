/* scanner_check: finds what is set wrongly of the scanner of a log: unit of the ranges, upside-down
 * mounting, angle step, duration of a scan, mounting pose; scale of the odometry. Internal to the
 * host library and its programs. */
#ifndef CAIRN_HOST_SCANNER_CHECK_H
#define CAIRN_HOST_SCANNER_CHECK_H

#include "cairn/scan_log.h"

/* An estimate. */
typedef struct cairn_scanner_check_value {
    double value;
    double sigma;     /* standard deviation */
    int32_t is_known; /* 0: the log does not determine it; value and sigma are 0 */
} cairn_scanner_check_value;

/* What was found. Estimates are of the whole log, after correction of the faults before them in
 * this order. */
typedef struct cairn_scanner_check {
    int32_t scans, pairs;           /* scans; pairs of scans that were matched */
    int32_t turns, walls;           /* pairs with a turn; straight walls that were measured */
    int32_t has_odometry;           /* 0: none, or it never moves */
    int32_t moved;                  /* scans after a motion by the odometry */
    int32_t repeated;               /* of these: with the same ranges as the scan before */
    int32_t backward;               /* scans stamped earlier than the one before */
    int32_t constant;               /* scans with the stamp of the one before */
    double median_range;            /* m, of the returns, as logged */
    double angle_step;              /* rad, mean, as logged, > 0 */
    double sweep;                   /* s, as logged; 0: unknown */
    cairn_pose base_sensor;         /* as logged */
    double range_scale;             /* factor that makes the ranges metres; 1: none is needed */
    cairn_scanner_check_value turn; /* turns of the scans per turn of the odometry, as logged */
    int32_t flips;                  /* 1: scans turn against the odometry */
    cairn_scanner_check_value step; /* true angle step per logged one, from the bend of walls */
    cairn_scanner_check_value sweep_found; /* s */
    cairn_scanner_check_value distance;    /* motions of the scans per motion of the odometry */
    cairn_scanner_check_value turn_scale;  /* turns, likewise, after correction of the step */
    cairn_scanner_check_value x, y, theta; /* m, m, rad: the sensor on the robot */
} cairn_scanner_check;

/* A fault of a log. */
typedef enum cairn_scanner_check_fault {
    CAIRN_SCANNER_CHECK_RANGES,   /* unit of the ranges */
    CAIRN_SCANNER_CHECK_FLIP,     /* scanner upside down, or bearings of the wrong sense */
    CAIRN_SCANNER_CHECK_STEP,     /* angle step, field of view */
    CAIRN_SCANNER_CHECK_SWEEP,    /* duration of a scan */
    CAIRN_SCANNER_CHECK_SENSOR,   /* mounting pose */
    CAIRN_SCANNER_CHECK_DISTANCE, /* the odometry's distances */
    CAIRN_SCANNER_CHECK_TURN,     /* the odometry's turns */
    CAIRN_SCANNER_CHECK_STAMPS,   /* stamps go backward, or stand still */
    CAIRN_SCANNER_CHECK_REPEATED, /* the same scan again and again */
    CAIRN_SCANNER_CHECK_FAULTS
} cairn_scanner_check_fault;

/* Checks a log. CAIRN_NO_MEMORY. Deterministic; its time is bounded: at most
 * CAIRN_SCANNER_CHECK_PAIRS pairs of scans are matched, in at most CAIRN_SCANNER_CHECK_ROUNDS rounds.
 *
 * check: set to what was found */
CAIRN_CHECKED cairn_status cairn_scanner_check_run(cairn_scanner_check *check,
                                                   const cairn_scan_log *log);

enum { CAIRN_SCANNER_CHECK_PAIRS = 300, CAIRN_SCANNER_CHECK_ROUNDS = 8 };

/* Returns 1 when the check has found the fault: clearly significant, and large enough to matter. */
int32_t cairn_scanner_check_has(const cairn_scanner_check *check, cairn_scanner_check_fault fault);

#endif
