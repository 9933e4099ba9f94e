/* Private state of the scanner_check module: pairs of scans, walls, and least squares with
 * uncertainty. */
#ifndef CAIRN_CALIBRATION_SCANNER_CHECK_WORK_H
#define CAIRN_CALIBRATION_SCANNER_CHECK_WORK_H

#include "cairn/scan_correction.h"
#include "cairn/scan_match.h"
#include "cairn/scanner_check.h"
#include "src/containers/heap.h"

enum {
    /* parts of the drive that the jackknife leaves out in turn */
    SCANNER_CHECK_BLOCKS = 20,
    /* most unknowns of a least-squares problem, and elements of the lower triangle of its matrix */
    SCANNER_CHECK_UNKNOWNS = 4,
    SCANNER_CHECK_ELEMENTS = SCANNER_CHECK_UNKNOWNS * (SCANNER_CHECK_UNKNOWNS + 1) / 2,
    /* unknowns of the bend of walls, and elements */
    SCANNER_CHECK_WALL_UNKNOWNS = 3,
    SCANNER_CHECK_WALL_ELEMENTS =
        SCANNER_CHECK_WALL_UNKNOWNS * (SCANNER_CHECK_WALL_UNKNOWNS + 1) / 2,
    /* most rounds of corrections by the bend of walls */
    SCANNER_CHECK_ROUNDS = 8,
    /* bins of a pass over the ranges that finds a quartile */
    SCANNER_CHECK_BINS = 256,
    /* columns of a wall: 1, place along it, unknowns, deviation */
    SCANNER_CHECK_COLUMNS = 2 + SCANNER_CHECK_WALL_UNKNOWNS + 1
};

/* m, rad: half sizes of the search for a match about no motion. */
#define SCANNER_CHECK_WINDOW_M   CAIRN_REAL(1.2)
#define SCANNER_CHECK_WINDOW_RAD CAIRN_REAL(0.9)

/* ---- Least squares ---- */

/* Normal equations of a few unknowns: row-wise lower triangle, and right side. */
typedef struct scanner_check_equations {
    cairn_real a[SCANNER_CHECK_ELEMENTS], b[SCANNER_CHECK_UNKNOWNS];
} scanner_check_equations;

/* Sums of weighted equations: of all terms and of those of each block of the jackknife. */
typedef struct scanner_check_sums {
    scanner_check_equations all, block[SCANNER_CHECK_BLOCKS];
    int32_t unknowns;                   /* 1 ... SCANNER_CHECK_UNKNOWNS */
    uint8_t uses[SCANNER_CHECK_BLOCKS]; /* 1: the block has terms */
} scanner_check_sums;

/* Solution with its jackknife standard deviations. */
typedef struct scanner_check_solution {
    cairn_real x[SCANNER_CHECK_UNKNOWNS], sigma[SCANNER_CHECK_UNKNOWNS];
    cairn_real without[SCANNER_CHECK_BLOCKS][SCANNER_CHECK_UNKNOWNS]; /* without each block */
} scanner_check_solution;

/* Clears the sums but for a prior.
 *
 * unknowns: 1 ... SCANNER_CHECK_UNKNOWNS
 * prior: [unknowns] information of each unknown about `expected` */
void cairn_scanner_check_clear(scanner_check_sums *sums, int32_t unknowns, const cairn_real *prior,
                               const cairn_real *expected);

/* Adds a term: normal equations of a few observations that share an error.
 *
 * a: row-wise lower triangle */
void cairn_scanner_check_add(scanner_check_sums *sums, int32_t block, cairn_real weight,
                             const cairn_real *a, const cairn_real *b);

/* Solves the sums. 0: there are fewer than two blocks, or the system is singular. */
int cairn_scanner_check_solve(const scanner_check_sums *sums, scanner_check_solution *solution);

/* Returns the jackknife standard deviation of a quantity with a value without each block. */
cairn_real cairn_scanner_check_jackknife(const scanner_check_sums *sums,
                                         const cairn_real without[SCANNER_CHECK_BLOCKS]);

/* ---- Pairs of scans, walls ---- */

typedef struct scanner_check_pair {
    int32_t first, second; /* indices of the scans */
    int32_t block;
    int32_t is_matched;
    cairn_pose odometry; /* of the robot from first to second; identity without odometry */
    cairn_pose match;    /* of the sensor from first to second */
    cairn_real covariance[9];
    cairn_real seconds; /* between the two */
} scanner_check_pair;

/* Normal equations of the bend of a wall. */
typedef struct scanner_check_wall {
    cairn_real a[SCANNER_CHECK_WALL_ELEMENTS], b[SCANNER_CHECK_WALL_UNKNOWNS];
    int32_t block;
} scanner_check_wall;

/* Sums of the regression of a wall's hits: products of the columns, lower triangle. */
typedef struct scanner_check_wall_sums {
    cairn_real product[SCANNER_CHECK_COLUMNS][SCANNER_CHECK_COLUMNS];
    int32_t hits;
} scanner_check_wall_sums;

/* ---- The object ---- */

/* The drive that is checked. */
typedef struct scanner_check_drive {
    const cairn_scanner_check_scan *scans; /* [count] */
    int32_t count;
    /* 1: the robot's poses are odometry; 1: they move */
    int32_t has_poses, has_odometry;
    cairn_real quartile[3]; /* of the ranges */
} scanner_check_drive;

/* Resume points of the check and of the steps that it runs. */
typedef struct scanner_check_resume {
    uint16_t all, survey, pairs, unit, distance, rounds, bends, match, pair, scan, walls, turn,
        mounting, bend;
} scanner_check_resume;

/* Survey of the drive: rank, number and place of the quartile that is sought, and its leading bits;
 * path of the odometry, m and rad. */
typedef struct scanner_check_survey {
    int64_t bins[SCANNER_CHECK_BINS], returns, rank;
    cairn_real odometry_length, odometry_turn;
    uint32_t prefix;
    int32_t part, shift;
} scanner_check_survey;

/* Choice of pairs. */
typedef struct scanner_check_choice {
    /* 1: some distance or turn apart, 0: neighbours */
    int32_t by_odometry;
    /* pass 0 counts, pass 1 lists; all pairs, and those of this pass so far */
    int32_t pass, total, counted;
    /* second scan of the pair */
    int32_t second;
} scanner_check_choice;

/* Search for the unit of the ranges. */
typedef struct scanner_check_unit {
    /* candidate; 1: others than 1 are tried */
    int32_t candidate, tries_others;
    cairn_real best, error;
} scanner_check_unit;

/* Rounds of corrections. */
typedef struct scanner_check_rounds {
    int32_t round;
    /* angle step before another one is tried, and the hits of walls with it */
    cairn_real step_before;
    int64_t hits_before;
} scanner_check_rounds;

/* Pair and scan in work. */
typedef struct scanner_check_matching {
    int32_t pair;
    /* 1: the scan can be used; 1: the target is there */
    int32_t is_prepared, has_target;
    cairn_scan_view view;
    cairn_scan_match_part part;
    cairn_twist velocity; /* of the sensor */
    cairn_status status;  /* of the object that is stepped */
} scanner_check_matching;

/* Wall in work. */
typedef struct scanner_check_wall_fit {
    /* its segment, and the end of the scan's walls */
    int32_t segment, limit;
    int32_t beam;
    scanner_check_wall_sums sums;
} scanner_check_wall_fit;

/* Robust least squares, and what was solved for. */
typedef struct scanner_check_fit {
    int32_t round;     /* of weights */
    int32_t is_solved; /* 1: `solution` is one */
    cairn_real scale;  /* of the weights */
    scanner_check_sums sums;
    scanner_check_solution solution;
    heap_sorting sorting; /* of the ratios of turns */
    /* turns per turn of the odometry; motion and mounting */
    cairn_scanner_check_value turn, distance, x, y, theta;
} scanner_check_fit;

struct cairn_scanner_check {
    cairn_scan *scan;
    cairn_scan_match *match;
    float *range, *angle;        /* [max_beams] of the scan in work */
    cairn_oriented_point *dense; /* [max_beams] */
    scanner_check_pair *pairs;   /* [max_pairs] */
    cairn_real *ratio;           /* [max_pairs] turns of matches per turn of the odometry */
    scanner_check_wall *walls;   /* [2 max_pairs max_walls] */

    /* 1: step() has work left */
    int32_t is_running;
    /* Units charged for the operation that waits. */
    int32_t units_charged;
    scanner_check_resume at;
    cairn_scanner_check_result result;
    cairn_scanner_check_measure measure;

    /* Of the running check: what was found, the correction so far, pairs, walls and their hits. */
    scanner_check_drive drive;
    cairn_scanner_check_result found;
    cairn_scan_correction correction;
    int32_t pair_count, wall_count;
    int64_t wall_hits;

    /* Of its phases: scan, pair or wall of the loop, and a struct of each phase. The survey ends
     * before the first fit. */
    int32_t cursor;
    union {
        scanner_check_survey survey;
        scanner_check_fit fit;
    };
    scanner_check_choice choice;
    scanner_check_unit unit;
    scanner_check_rounds rounds;
    scanner_check_matching matching;
    scanner_check_wall_fit wall;
    cairn_scanner_check_params params;
};

/* ---- The drive ---- */

/* Returns the motion of the robot between two scans by the odometry; the identity without one. */
cairn_pose cairn_scanner_check_motion(const cairn_scanner_check *check, int32_t from, int32_t to);

/* Returns the length of a motion, m. */
cairn_real cairn_scanner_check_distance(cairn_pose motion);

/* Returns the time between two scans, s. */
cairn_real cairn_scanner_check_seconds(const cairn_scanner_check *check, int32_t from, int32_t to);

/* Returns by what factor, >= 1, a ratio > 0 differs from 1. */
cairn_real cairn_scanner_check_factor(cairn_real ratio);

/* ---- Steps; each returns 0 while it has work left, 1 at its end ---- */

/* Counts stamps and repeated scans; finds the quartiles of the ranges, and whether the odometry
 * moves. */
int cairn_scanner_check_survey(cairn_scanner_check *check, cairn_budget *budget);

/* Lists pairs over the whole drive, in its order: by_odometry. */
int cairn_scanner_check_choose(cairn_scanner_check *check, cairn_budget *budget);

/* Finds the unit of the ranges, and corrects it. */
int cairn_scanner_check_find_unit(cairn_scanner_check *check, cairn_budget *budget);

/* Matches all pairs with the correction found so far, and measures the walls of their scans. */
int cairn_scanner_check_match(cairn_scanner_check *check, cairn_budget *budget);

/* Adds the walls of the scan in work, of the pair in work, at the velocity of the sensor. */
int cairn_scanner_check_add_walls(cairn_scanner_check *check, cairn_budget *budget);

/* Unknowns of the bend of walls. */
enum { WALL_STEP, WALL_OFFSET, WALL_SWEEP };

/* Solves for what makes walls straight: relative change of the angle step, offset of the ranges, m,
 * change of the sweep, s. fit.is_solved 0: not observable. */
int cairn_scanner_check_bend(cairn_scanner_check *check, cairn_budget *budget);

/* Turns of the matches per turn of the odometry, in fit.turn. */
int cairn_scanner_check_measure_turn(cairn_scanner_check *check, cairn_budget *budget);

/* Motion of matches against the odometry: distance ratio and mounting. */
int cairn_scanner_check_mounting(cairn_scanner_check *check, cairn_budget *budget);

#endif
