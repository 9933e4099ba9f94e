/* Check of a scanner's set-up against its scans and the odometry.
 *
 * Method:
 * 1. stamps, repeated scans, median of the ranges;
 * 2. unit of the ranges: the one with which the motions of matched scans agree with the odometry;
 * 3. rounds: pairs of scans are matched; scans that turn against the odometry are upside down;
 *    what bends walls (scanner_check_walls.c) corrects the angle step and the sweep; until nothing
 *    changes;
 * 4. mounting and scale of the odometry, from the matches (scanner_check_motion.c).
 * Each fault is corrected before the next one is estimated, so that several are found at once.
 *
 * Limits: without odometry only unit, angle step, sweep and stamps are checked. */
#include "src/base/build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/base/interruption.h"
#include "src/host/maps/scanner_check_work.h"

/* A deviation is said from this many standard deviations on. */
static const double SIGNIFICANCE_SIGMAS = 4;

/* Smaller deviations do not matter: share of the angle step, s, m, rad, share of the odometry. */
static const double STEP_MATTERS = 0.004;
static const double SWEEP_MATTERS_S = 0.02;
static const double SENSOR_MATTERS_M = 0.08;
static const double SENSOR_MATTERS_RAD = 0.035;
static const double ODOMETRY_MATTERS = 0.1;
/* Shares of the scans. */
static const double STAMPS_MATTER = 0.01;
static const double REPEATED_MATTER = 0.05;
enum { LEAST_REPEATED = 3 };

/* Estimates of a larger standard deviation are not known: shares, s, m, rad. */
static const double STEP_KNOWN = 0.01;
static const double SWEEP_KNOWN_S = 0.03;
/* m: with a larger offset of the ranges walls are bent by something else than step or sweep. */
static const double OFFSET_KNOWN_M = 0.04;
static const double SENSOR_KNOWN_M = 0.1;
static const double SENSOR_KNOWN_RAD = 0.05;
static const double ODOMETRY_KNOWN = 0.05;
enum { LEAST_TURNS = 5, LEAST_WALLS = 30, LEAST_PAIRS = 10 };

/* m, rad: an odometry that moves less than this does not move. */
static const double MOVES_M = 0.5;
static const double MOVES_RAD = 0.5;
/* m, rad: a scan after a greater motion must differ from the one before. */
static const double MOVED_M = 0.02;
static const double MOVED_RAD = 0.01;

/* Medians of ranges in m, in buildings and around them. */
static const double SHORTEST_MEDIAN_M = 0.15;
static const double LONGEST_MEDIAN_M = 60;
static const double USUAL_MEDIAN_M = 3;
/* Factors of units: m, mm, cm, dm, feet, and ranges that were divided once too often. */
static const double UNIT_FACTORS[] = {1, 0.001, 0.01, 0.1, 0.3048, 10, 100, 1000};
enum { UNIT_COUNT = sizeof UNIT_FACTORS / sizeof *UNIT_FACTORS };
/* The unit is wrong when motions of scans and odometry differ by more than the first factor;
 * another one is right when they differ by less than the second. */
static const double UNIT_WRONG = 1.5;
static const double UNIT_RIGHT = 1.2;

/* Ranges whose upper quartile is not above this many times the lower one are all alike. */
static const double MIN_QUARTILE_RATIO = 1.02;

/* A turn ratio of scans that turn against the odometry is below the negative of this. */
static const double FLIPPED_TURN = 0.3;
/* Turn ratios beyond this factor may come of the angle step. */
static const double STEP_TURN = 1.12;
/* A step is better when the walls have this many times the hits. */
static const double BETTER_WALLS = 1.1;
/* Changes in a round: share of the step and s, in the least and in standard deviations. */
static const double STEP_CHANGE = 0.001;
static const double SWEEP_CHANGE_S = 0.003;
static const double CHANGE_SIGMAS = 2;

/* ---- What the log says itself ---- */

/* 1 when all ranges are the same, and some are returns. */
static int32_t is_same_scan(const cairn_carmen_log_record *a, const cairn_carmen_log_record *b)
{
    int32_t returns = 0;

    for (int32_t i = 0; i < b->count; i++)
        returns += b->range[i] > 0 && isfinite(b->range[i]);
    return returns > 0 && a->count == b->count &&
           memcmp(a->range, b->range, (size_t)a->count * sizeof *a->range) == 0;
}

static int32_t has_moved(cairn_pose motion, double distance, double turn)
{
    return hypot((double)motion.x, (double)motion.y) > distance ||
           fabs((double)motion.theta) > turn;
}

/* Counts stamps and repeated scans. */
static void count_scans(cairn_scanner_check *check, const cairn_scan_log *log)
{
    for (int32_t i = 1; i < log->scans.count; i++) {
        const cairn_carmen_log_record *b = &log->scans.record[i], *a = b - 1;
        cairn_pose motion = cairn_pose_between(a->robot, b->robot);

        check->backward += b->stamp_ns < a->stamp_ns;
        check->constant += b->stamp_ns == a->stamp_ns;
        if (has_moved(motion, MOVED_M, MOVED_RAD)) {
            check->moved++;
            check->repeated += is_same_scan(a, b);
        }
    }
}

static int32_t odometry_moves(const cairn_scan_log *log)
{
    const cairn_carmen_log_summary *info = &log->scans.info;

    return log->has_odometry &&
           (info->odometry_length > MOVES_M || info->odometry_turn > MOVES_RAD);
}

static void describe(cairn_scanner_check *check, const cairn_scan_log *log)
{
    const cairn_scan_input *first = &log->scans.record[0].scan;

    check->scans = log->scans.count;
    check->has_odometry = odometry_moves(log);
    check->angle_step = fabs(cairn_scan_mean_step(first));
    check->sweep = (double)first->time_step * (first->count - 1);
    check->base_sensor = first->base_sensor;
    count_scans(check, log);
}

/* ---- Unit of the ranges ---- */

static void set_unit(scanner_check_work *work, double median, double unit)
{
    work->correction.range_scale = unit;
    work->correction.range_max = cairn_scan_correction_limit(
        (double)work->log->scans.record[0].scan.range_max, median, unit);
}

/* Returns by what factor the motions of the scans exceed those of the odometry; 0: not known. */
static double distance_ratio(scanner_check_work *work)
{
    cairn_scanner_check check;

    memset(&check, 0, sizeof check);
    cairn_scanner_check_match(work);
    cairn_scanner_check_mounting(work, &check);
    return check.distance.is_known && check.distance.sigma < 0.2 * check.distance.value
               ? check.distance.value
               : 0;
}

static int is_usual(double median)
{
    return median >= SHORTEST_MEDIAN_M && median <= LONGEST_MEDIAN_M;
}

/* Returns the unit whose median is the most usual. */
static double unit_by_median(double median)
{
    double best = 1;

    for (int i = 0; i < UNIT_COUNT; i++)
        if (fabs(log(UNIT_FACTORS[i] * median / USUAL_MEDIAN_M)) <
            fabs(log(best * median / USUAL_MEDIAN_M)))
            best = UNIT_FACTORS[i];
    return best;
}

/* Finds the unit with which scans and odometry agree; when none does, that of the most usual ranges
 * where those of the log are impossible in m.
 *
 * quartile: of the ranges; all alike: what the scanner reports without a return */
static double find_unit(scanner_check_work *work, const double quartile[3])
{
    double median = quartile[1], ratio = 0, best = 1, least = UNIT_RIGHT;

    set_unit(work, median, 1);
    if (!(quartile[2] > MIN_QUARTILE_RATIO * quartile[0]))
        return 1;
    if (is_usual(median)) {
        ratio = work->has_odometry ? distance_ratio(work) : 0;
        if (ratio == 0 || fabs(log(ratio)) < log(UNIT_WRONG))
            return 1;
    } else {
        best = unit_by_median(median);
    }
    for (int i = 1; i < UNIT_COUNT && work->has_odometry; i++) {
        if (!is_usual(UNIT_FACTORS[i] * median))
            continue;
        set_unit(work, median, UNIT_FACTORS[i]);
        ratio = distance_ratio(work);
        if (ratio > 0 && exp(fabs(log(ratio))) < least) {
            least = exp(fabs(log(ratio)));
            best = UNIT_FACTORS[i];
        }
    }
    return best;
}

/* ---- Rounds ---- */

/* Corrects the sense of the bearings. 1: it was wrong. */
static int correct_flip(scanner_check_work *work, const cairn_scanner_check *check,
                        cairn_scanner_check_value turn)
{
    if (work->correction.flips || check->turns < LEAST_TURNS || turn.value > -FLIPPED_TURN ||
        -turn.value < SIGNIFICANCE_SIGMAS * turn.sigma)
        return 0;
    work->correction.flips = 1;
    return 1;
}

/* Tries the angle step that the turns of the odometry would have; keeps it when walls are
 * straighter. */
static void try_step_of_turns(scanner_check_work *work, const cairn_scanner_check *check,
                              cairn_scanner_check_value turn)
{
    double before = work->correction.angle_step;
    int64_t hits = work->wall_hits;

    if (check->turns < LEAST_TURNS || !(turn.value > 0) || fabs(log(turn.value)) < log(STEP_TURN))
        return;
    work->correction.angle_step = before / turn.value;
    cairn_scanner_check_match(work);
    if ((double)work->wall_hits > BETTER_WALLS * (double)hits)
        return;
    work->correction.angle_step = before;
    cairn_scanner_check_match(work);
}

static int is_change(double change, double sigma, double least)
{
    return fabs(change) > least && fabs(change) > CHANGE_SIGMAS * sigma;
}

/* Corrects the sweep by the bend of walls, or, when it is right, the angle step. 1: something
 * changed. */
static int correct_bend(scanner_check_work *work, cairn_scanner_check *check)
{
    cairn_scan_correction *c = &work->correction;
    double sense = c->sweep < 0 ? -1 : 1;
    scanner_check_solution bend;
    int is_plausible;

    check->step.is_known = check->sweep_found.is_known = 0;
    if (work->walls < LEAST_WALLS || !cairn_scanner_check_bend(work, &bend))
        return 0;
    is_plausible = fabs(bend.x[WALL_OFFSET]) < OFFSET_KNOWN_M;
    check->step.sigma = bend.sigma[WALL_STEP];
    check->step.is_known = is_plausible && check->step.sigma < STEP_KNOWN;
    check->sweep_found.sigma = bend.sigma[WALL_SWEEP];
    check->sweep_found.is_known =
        is_plausible && check->sweep_found.sigma < SWEEP_KNOWN_S && check->sweep_found.sigma > 0;
    check->step.value = c->angle_step * (1 + bend.x[WALL_STEP]);
    check->sweep_found.value = c->sweep + sense * bend.x[WALL_SWEEP];
    if (check->sweep_found.is_known &&
        is_change(bend.x[WALL_SWEEP], bend.sigma[WALL_SWEEP], SWEEP_CHANGE_S))
        c->sweep = check->sweep_found.value;
    else if (check->step.is_known &&
             is_change(bend.x[WALL_STEP], bend.sigma[WALL_STEP], STEP_CHANGE))
        c->angle_step = check->step.value;
    else
        return 0;
    return 1;
}

/* Matches and corrects until nothing changes. */
static void correct_in_rounds(scanner_check_work *work, cairn_scanner_check *check)
{
    cairn_scanner_check_match(work);
    check->turn = cairn_scanner_check_turn(work, &check->turns);
    if (correct_flip(work, check, check->turn)) {
        cairn_scanner_check_match(work);
        check->turn_scale = cairn_scanner_check_turn(work, &check->turns);
    } else {
        check->turn_scale = check->turn;
    }
    if (work->has_odometry)
        try_step_of_turns(work, check, check->turn_scale);
    for (int round = 0; round < CAIRN_SCANNER_CHECK_ROUNDS && correct_bend(work, check); round++)
        cairn_scanner_check_match(work);
    check->turn_scale = cairn_scanner_check_turn(work, &check->turns);
}

/* ---- The check ---- */

/* Chooses pairs by the odometry; neighbours, whose walls can be measured at least, where scans are
 * too far apart. */
static int32_t choose_pairs(scanner_check_work *work)
{
    int32_t pairs = 0;

    if (work->has_odometry)
        pairs = cairn_scanner_check_choose(work->log, 1, work->pair);
    return pairs >= LEAST_PAIRS ? pairs : cairn_scanner_check_choose(work->log, 0, work->pair);
}

static void limit_known(cairn_scanner_check_value *value, double sigma)
{
    value->is_known &= value->sigma <= sigma;
    if (!value->is_known)
        value->value = value->sigma = 0;
}

/* Writes the estimates; those that are too uncertain are not known. */
static void finish(scanner_check_work *work, cairn_scanner_check *check)
{
    int32_t matched = 0;

    for (int32_t i = 0; i < work->pairs; i++)
        matched += work->pair[i].is_matched;
    check->pairs = matched;
    check->walls = work->walls;
    check->range_scale = work->correction.range_scale;
    check->flips = work->correction.flips;
    check->step.value = check->angle_step > 0 ? work->correction.angle_step / check->angle_step : 1;
    check->sweep_found.value = work->correction.sweep;
    if (work->has_odometry && matched >= LEAST_PAIRS)
        cairn_scanner_check_mounting(work, check);
    check->turn.is_known &= work->has_odometry && check->turns >= LEAST_TURNS;
    check->turn_scale.is_known &= work->has_odometry && check->turns >= LEAST_TURNS;
    limit_known(&check->step, STEP_KNOWN);
    limit_known(&check->sweep_found, SWEEP_KNOWN_S);
    limit_known(&check->turn, ODOMETRY_KNOWN);
    limit_known(&check->turn_scale, ODOMETRY_KNOWN);
    limit_known(&check->distance, ODOMETRY_KNOWN);
    limit_known(&check->x, SENSOR_KNOWN_M);
    limit_known(&check->y, SENSOR_KNOWN_M);
    limit_known(&check->theta, SENSOR_KNOWN_RAD);
}

cairn_status cairn_scanner_check_run(cairn_scanner_check *check, const cairn_scan_log *log)
{
    scanner_check_work *work = calloc(1, sizeof *work);
    double quartile[3];
    cairn_status status;

    memset(check, 0, sizeof *check);
    check->range_scale = 1;
    status = work != NULL ? cairn_scan_log_quartiles(log, quartile) : CAIRN_NO_MEMORY;
    if (status == CAIRN_OK) {
        check->median_range = quartile[1];
        describe(check, log);
        work->log = log;
        work->has_odometry = check->has_odometry;
        work->correction = cairn_scan_correction_none();
        work->correction.angle_step = check->angle_step;
        work->correction.sweep = check->sweep;
        status = cairn_scanner_check_open(work, log);
    }
    if (status == CAIRN_OK) {
        work->pairs = choose_pairs(work);
        set_unit(work, quartile[1], find_unit(work, quartile));
        correct_in_rounds(work, check);
        finish(work, check);
        if (cairn_interruption_is_requested())
            status = CAIRN_MORE;
    }
    if (work != NULL)
        cairn_scanner_check_close(work);
    free(work);
    return status;
}

/* ---- Faults ---- */

static int differs(cairn_scanner_check_value value, double from, double least)
{
    double difference = fabs(value.value - from);

    return value.is_known && difference > least && difference > SIGNIFICANCE_SIGMAS * value.sigma;
}

static int has_other_mounting(const cairn_scanner_check *check)
{
    cairn_scanner_check_value turned = check->theta;

    turned.value =
        remainder(turned.value - (double)check->base_sensor.theta, 2 * 3.14159265358979323846);
    return differs(check->x, (double)check->base_sensor.x, SENSOR_MATTERS_M) ||
           differs(check->y, (double)check->base_sensor.y, SENSOR_MATTERS_M) ||
           differs(turned, 0, SENSOR_MATTERS_RAD);
}

int32_t cairn_scanner_check_has(const cairn_scanner_check *check, cairn_scanner_check_fault fault)
{
    switch (fault) {
    case CAIRN_SCANNER_CHECK_RANGES:
        return check->range_scale != 1;
    case CAIRN_SCANNER_CHECK_FLIP:
        return check->flips;
    case CAIRN_SCANNER_CHECK_STEP:
        return differs(check->step, 1, STEP_MATTERS);
    case CAIRN_SCANNER_CHECK_SWEEP:
        return differs(check->sweep_found, check->sweep, SWEEP_MATTERS_S);
    case CAIRN_SCANNER_CHECK_SENSOR:
        return has_other_mounting(check);
    case CAIRN_SCANNER_CHECK_DISTANCE:
        return differs(check->distance, 1, ODOMETRY_MATTERS);
    case CAIRN_SCANNER_CHECK_TURN:
        return differs(check->turn_scale, 1, ODOMETRY_MATTERS);
    case CAIRN_SCANNER_CHECK_STAMPS:
        return check->backward + check->constant > STAMPS_MATTER * check->scans;
    case CAIRN_SCANNER_CHECK_REPEATED:
        return check->repeated >= LEAST_REPEATED &&
               check->repeated > REPEATED_MATTER * check->moved;
    default:
        return 0;
    }
}
