/* Shared by the parts of scanner_check: pairs of scans, walls, and least squares with uncertainty. */
#ifndef CAIRN_HOST_SCANNER_CHECK_WORK_H
#define CAIRN_HOST_SCANNER_CHECK_WORK_H

#include "cairn/scan_match.h"
#include "src/host/logs/scan_correction.h"
#include "src/host/maps/scanner_check.h"

enum {
    /* parts of the log that the jackknife leaves out in turn */
    SCANNER_CHECK_BLOCKS = 20,
    /* most unknowns of a least-squares problem */
    SCANNER_CHECK_UNKNOWNS = 4,
    /* longest walls of a scan that are measured */
    SCANNER_CHECK_WALLS = 16
};

/* ---- Least squares ---- */

/* One term of a sum of weighted squares: normal equations of a few observations that share an
 * error. */
typedef struct scanner_check_term {
    double a[SCANNER_CHECK_UNKNOWNS][SCANNER_CHECK_UNKNOWNS], b[SCANNER_CHECK_UNKNOWNS];
    double weight; /* robust weight */
    int32_t block; /* of the jackknife */
} scanner_check_term;

/* Solution with its jackknife standard deviations. */
typedef struct scanner_check_solution {
    double x[SCANNER_CHECK_UNKNOWNS], sigma[SCANNER_CHECK_UNKNOWNS];
    double without[SCANNER_CHECK_BLOCKS][SCANNER_CHECK_UNKNOWNS]; /* solution without each block */
    int32_t blocks[SCANNER_CHECK_BLOCKS];                         /* 1: the block has terms */
} scanner_check_solution;

/* Solves the sum of the terms and a prior. 0: there are fewer than two blocks, or the system is
 * singular.
 *
 * unknowns: 1 ... SCANNER_CHECK_UNKNOWNS
 * prior: [unknowns] information of each unknown about `expected` */
int cairn_scanner_check_solve(const scanner_check_term *terms, int32_t count, int32_t unknowns,
                              const double *prior, const double *expected,
                              scanner_check_solution *solution);

/* Returns the jackknife standard deviation of a quantity with a value without each block. */
double cairn_scanner_check_jackknife(const scanner_check_solution *solution,
                                     const double without[SCANNER_CHECK_BLOCKS]);

/* ---- Pairs of scans ---- */

typedef struct scanner_check_pair {
    int32_t first, second; /* indices of the scans */
    int32_t block;
    int32_t is_matched;
    cairn_pose odometry; /* of the robot from first to second; identity without odometry */
    cairn_pose match;    /* of the sensor from first to second */
    double covariance[9];
    double seconds; /* between the two */
} scanner_check_pair;

/* Lists pairs over the whole log, at most CAIRN_SCANNER_CHECK_PAIRS, in the order of the log.
 * Returns their number.
 *
 * by_odometry: 1: scans some distance or turn apart; 0: neighbours */
int32_t cairn_scanner_check_choose(const cairn_scan_log *log, int32_t by_odometry,
                                   scanner_check_pair pair[CAIRN_SCANNER_CHECK_PAIRS]);

/* ---- The check ---- */

/* The state of a check. */
typedef struct scanner_check_work {
    const cairn_scan_log *log;
    int32_t has_odometry;
    cairn_scan_correction correction; /* found so far */
    cairn_scan *scan;
    cairn_scan_match *match;
    float *range, *angle; /* [most beams] of the scan in work */
    cairn_oriented_point *dense;
    void *memory; /* of the pool */
    scanner_check_pair pair[CAIRN_SCANNER_CHECK_PAIRS];
    int32_t pairs;
    scanner_check_term wall[2 * CAIRN_SCANNER_CHECK_PAIRS * SCANNER_CHECK_WALLS];
    int32_t walls;
    int64_t wall_hits; /* of all walls */
} scanner_check_work;

/* Makes the objects. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_scanner_check_open(scanner_check_work *work,
                                                    const cairn_scan_log *log);
void cairn_scanner_check_close(scanner_check_work *work);

/* Matches all pairs with the correction found so far, and measures the walls of their scans. */
void cairn_scanner_check_match(scanner_check_work *work);

/* Adds the walls of a scan.
 *
 * velocity: of the sensor in its own frame, m/s, rad/s; 0 when not known */
void cairn_scanner_check_add_walls(scanner_check_work *work, const cairn_scan_view *view,
                                   int32_t block, cairn_twist velocity);

/* Unknowns of the bend of walls. */
enum { WALL_STEP, WALL_OFFSET, WALL_SWEEP, WALL_UNKNOWNS };

/* Solves for what makes walls straight: relative change of the angle step, offset of the ranges, m,
 * change of the sweep, s. 0: not observable. */
int cairn_scanner_check_bend(scanner_check_work *work, scanner_check_solution *solution);

/* Turns of the matches per turn of the odometry. `turns`: pairs with a turn. */
cairn_scanner_check_value cairn_scanner_check_turn(scanner_check_work *work, int32_t *turns);

/* Motion of matches against the odometry: distance ratio and mounting. */
void cairn_scanner_check_mounting(scanner_check_work *work, cairn_scanner_check *check);

#endif
