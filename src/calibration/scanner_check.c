/* scanner_check: check of a scanner's set-up against its scans and the odometry.
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

#include <string.h>

#include "src/base/object.h"
#include "src/base/step.h"
#include "src/calibration/scanner_check_work.h"

enum {
    MAX_BEAMS = 100000,
    MAX_POINTS = 1 << 20,
    MAX_PAIRS = 1 << 16,
    MAX_WALLS = 1024,
    /* hypotheses and candidates of a match */
    MAX_HYPOTHESES = 4,
    MAX_CANDIDATES = 24
};

/* A deviation is said from this many standard deviations on. */
static const cairn_real SIGNIFICANCE_SIGMAS = 4;
/* Two estimates agree within this many standard deviations of their difference. */
static const cairn_real AGREEMENT_SIGMAS = 3;

/* Smaller deviations do not matter: share of the angle step, s, m, rad, share of the odometry. */
static const cairn_real STEP_MATTERS = CAIRN_REAL(0.004);
/* Walls of right logs are bent as by wrong steps of up to 0.9 % (docs/lab/logs.md). */
static const cairn_real STEP_SMALL = CAIRN_REAL(0.01);
static const cairn_real SWEEP_MATTERS_S = CAIRN_REAL(0.02);
static const cairn_real SENSOR_MATTERS_M = CAIRN_REAL(0.08);
static const cairn_real SENSOR_MATTERS_RAD = CAIRN_REAL(0.035);
static const cairn_real ODOMETRY_MATTERS = CAIRN_REAL(0.1);
/* Shares of the scans. */
static const cairn_real STAMPS_MATTER = CAIRN_REAL(0.01);
static const cairn_real REPEATED_MATTER = CAIRN_REAL(0.05);
enum { LEAST_REPEATED = 3 };

/* Estimates of a larger standard deviation are not known: shares, s, m, rad. */
static const cairn_real STEP_KNOWN = CAIRN_REAL(0.01);
static const cairn_real SWEEP_KNOWN_S = CAIRN_REAL(0.03);
/* m: with a larger offset of the ranges walls are bent by something else than step or sweep. */
static const cairn_real OFFSET_KNOWN_M = CAIRN_REAL(0.04);
static const cairn_real SENSOR_KNOWN_M = CAIRN_REAL(0.1);
static const cairn_real SENSOR_KNOWN_RAD = CAIRN_REAL(0.05);
static const cairn_real ODOMETRY_KNOWN = CAIRN_REAL(0.05);
enum { LEAST_TURNS = 5, LEAST_WALLS = 30, LEAST_PAIRS = 10 };

/* A turn ratio of scans that turn against the odometry is below the negative of this. */
static const cairn_real FLIPPED_TURN = CAIRN_REAL(0.3);
/* Turn ratios beyond this factor may come of the angle step. */
static const cairn_real STEP_TURN = CAIRN_REAL(1.12);
/* A step is better when the walls have this many times the hits. */
static const cairn_real BETTER_WALLS = CAIRN_REAL(1.1);
/* Changes in a round: share of the step and s, in the least and in standard deviations. */
static const cairn_real STEP_CHANGE = CAIRN_REAL(0.001);
static const cairn_real SWEEP_CHANGE_S = CAIRN_REAL(0.003);
static const cairn_real CHANGE_SIGMAS = 2;

/* ---- The object ---- */

#define INTEGER(field, ...) CAIRN_INTEGER(cairn_scanner_check_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_beams, 1024, 1, MAX_BEAMS),    INTEGER(max_points, 4096, 1, MAX_POINTS),
    INTEGER(max_segments, 512, 1, MAX_POINTS), INTEGER(max_pairs, 300, 2, MAX_PAIRS),
    INTEGER(max_walls, 16, 1, MAX_WALLS),
};
extern const cairn_parameters cairn_scanner_check_parameters;
const cairn_parameters cairn_scanner_check_parameters =
    CAIRN_PARAMETERS("scanner_check", cairn_scanner_check_params, rows);

cairn_scanner_check_params cairn_scanner_check_default(void)
{
    cairn_scanner_check_params params;

    cairn_parameters_preset(&cairn_scanner_check_parameters, &params);
    return params;
}

cairn_status cairn_scanner_check_check(const cairn_scanner_check_params *params,
                                       cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_scanner_check_parameters, params, fault);
}

static cairn_scan_params scan_params(const cairn_scanner_check_params *params)
{
    cairn_scan_params scan = cairn_scan_default();

    scan.max_beams = params->max_beams;
    scan.max_points = params->max_points;
    scan.max_segments = params->max_segments;
    return scan;
}

static cairn_scan_match_params match_params(const cairn_scanner_check_params *params)
{
    cairn_scan_match_params match = cairn_scan_match_default();

    match.max_target = match.max_query = params->max_points;
    match.max_dense = params->max_beams;
    match.max_views = 1;
    match.max_hypotheses = MAX_HYPOTHESES;
    match.max_candidates = MAX_CANDIDATES;
    match.max_cells = cairn_scan_match_cells(SCANNER_CHECK_WINDOW_M, match.spacing);
    return match;
}

/* The object, its arrays and its scan and match; NULL from a counting pool. */
static cairn_scanner_check *build(cairn_pool *pool, const cairn_scanner_check_params *params)
{
    cairn_scan_params scan = scan_params(params);
    cairn_scan_match_params match = match_params(params);
    cairn_scanner_check *check = cairn_object_take(pool, sizeof *check);

    CAIRN_TAKE(check, pool, range, params->max_beams);
    CAIRN_TAKE(check, pool, angle, params->max_beams);
    CAIRN_TAKE(check, pool, dense, params->max_beams);
    CAIRN_TAKE(check, pool, pairs, params->max_pairs);
    CAIRN_TAKE(check, pool, ratio, params->max_pairs);
    CAIRN_TAKE(check, pool, walls, 2 * params->max_pairs * params->max_walls);
    CAIRN_TAKE_OBJECT(check, pool, scan, scan, &scan);
    CAIRN_TAKE_OBJECT(check, pool, match, scan_match, &match);
    if (check != NULL)
        check->params = *params;
    return check;
}

CAIRN_OBJECT(scanner_check, scanner_check, build);

/* ---- Begin ---- */

static cairn_status check_scan(const cairn_scanner_check *check,
                               const cairn_scanner_check_scan *scan, int32_t index,
                               int32_t has_odometry, cairn_fault *fault)
{
    const cairn_scan_input *input = &scan->input;

    if (input->range == NULL || input->count < 1)
        return cairn_refuse(fault, index, "a scan without ranges, expected one beam or more",
                            CAIRN_BAD_ARGUMENT);
    if (input->count > check->params.max_beams)
        return cairn_refuse(fault, index, "more beams than max_beams", CAIRN_FULL);
    if (input->stamp_ns > CAIRN_SCAN_MAX_STAMP_NS || input->stamp_ns < -CAIRN_SCAN_MAX_STAMP_NS)
        return cairn_refuse(fault, index, "a stamp beyond CAIRN_SCAN_MAX_STAMP_NS",
                            CAIRN_BAD_ARGUMENT);
    if (!cairn_pose_is_finite(input->base_sensor) ||
        (has_odometry && !cairn_pose_is_finite(scan->robot)))
        return cairn_refuse(fault, index, "a pose is not finite", CAIRN_NOT_FINITE);
    return CAIRN_OK;
}

static void restart_steps(cairn_scanner_check *check)
{
    memset(&check->at, 0, sizeof check->at);
    check->units_charged = 0;
}

cairn_status cairn_scanner_check_begin(cairn_scanner_check *check,
                                       const cairn_scanner_check_scan *scans, int32_t count,
                                       int32_t has_odometry, cairn_fault *fault)
{
    if (check == NULL || count < 0 || (scans == NULL && count > 0))
        return cairn_refuse(fault, -1, "no object or no scans", CAIRN_BAD_ARGUMENT);
    if (count == 0)
        return cairn_refuse(fault, -1, "no scans, expected one or more", CAIRN_EMPTY);
    for (int32_t i = 0; i < count; i++) {
        cairn_status status = check_scan(check, &scans[i], i, has_odometry, fault);

        if (status != CAIRN_OK)
            return status;
    }
    restart_steps(check);
    check->drive.scans = scans;
    check->drive.count = count;
    check->drive.has_poses = has_odometry;
    check->is_running = 1;
    memset(&check->found, 0, sizeof check->found);
    memset(&check->result, 0, sizeof check->result);
    memset(&check->measure, 0, sizeof check->measure);
    return CAIRN_OK;
}

/* ---- Rounds ---- */

/* Corrects the sense of the bearings. 1: it was wrong. */
static int correct_flip(cairn_scanner_check *check)
{
    const cairn_scanner_check_value *turn = &check->fit.turn;

    if (check->found.turns < LEAST_TURNS || turn->value > -FLIPPED_TURN ||
        -turn->value < SIGNIFICANCE_SIGMAS * turn->sigma)
        return 0;
    check->correction.flips = 1;
    return 1;
}

/* Sets the angle step that the turns of the odometry would have. 0: they are about right. */
static int set_step_of_turns(cairn_scanner_check *check)
{
    cairn_real turn = check->fit.turn.value;

    if (!check->drive.has_odometry || check->found.turns < LEAST_TURNS || !(turn > 0) ||
        cairn_scanner_check_factor(turn) < STEP_TURN)
        return 0;
    check->rounds.step_before = check->correction.angle_step;
    check->rounds.hits_before = check->wall_hits;
    check->correction.angle_step = check->rounds.step_before / turn;
    return 1;
}

static int is_straighter(const cairn_scanner_check *check)
{
    return (cairn_real)check->wall_hits > BETTER_WALLS * (cairn_real)check->rounds.hits_before;
}

static int is_change(cairn_real change, cairn_real sigma, cairn_real least)
{
    return cairn_abs(change) > least && cairn_abs(change) > CHANGE_SIGMAS * sigma;
}

/* Takes what the bend of walls says: the sweep, or, when it is right, the angle step. 1: something
 * changed. */
static int correct_bend(cairn_scanner_check *check)
{
    const scanner_check_solution *bend = &check->fit.solution;
    cairn_scan_correction *c = &check->correction;
    cairn_scanner_check_value *step = &check->found.step, *sweep = &check->found.sweep_found;
    cairn_real sense = c->sweep < 0 ? -1 : 1;
    int is_plausible = cairn_abs(bend->x[WALL_OFFSET]) < OFFSET_KNOWN_M;

    step->sigma = bend->sigma[WALL_STEP];
    step->is_known = is_plausible && step->sigma < STEP_KNOWN;
    sweep->sigma = bend->sigma[WALL_SWEEP];
    sweep->is_known = is_plausible && sweep->sigma < SWEEP_KNOWN_S && sweep->sigma > 0;
    step->value = c->angle_step * (1 + bend->x[WALL_STEP]);
    sweep->value = c->sweep + sense * bend->x[WALL_SWEEP];
    if (sweep->is_known && is_change(bend->x[WALL_SWEEP], sweep->sigma, SWEEP_CHANGE_S))
        c->sweep = sweep->value;
    else if (step->is_known && is_change(bend->x[WALL_STEP], step->sigma, STEP_CHANGE))
        c->angle_step = step->value;
    else
        return 0;
    return 1;
}

/* Corrects by the bend of walls until nothing changes. */
static int straighten(cairn_scanner_check *check, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(check->at.bends);
    for (check->rounds.round = 0; check->rounds.round < SCANNER_CHECK_ROUNDS;
         check->rounds.round++) {
        check->found.step.is_known = check->found.sweep_found.is_known = 0;
        if (check->wall_count < LEAST_WALLS)
            break;
        CAIRN_STEP_RUN(check, at.bends, budget, cairn_scanner_check_bend);
        if (!check->fit.is_solved || !correct_bend(check))
            break;
        CAIRN_STEP_RUN(check, at.bends, budget, cairn_scanner_check_match);
    }
    CAIRN_STEP_END(check->at.bends);
}

/* Matches and corrects. The angle step that the turns of the odometry would have is kept when walls
 * are straighter with it. */
static int correct_in_rounds(cairn_scanner_check *check, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(check->at.rounds);
    CAIRN_STEP_RUN(check, at.rounds, budget, cairn_scanner_check_match);
    CAIRN_STEP_RUN(check, at.rounds, budget, cairn_scanner_check_measure_turn);
    check->found.turn = check->fit.turn;
    if (correct_flip(check)) {
        CAIRN_STEP_RUN(check, at.rounds, budget, cairn_scanner_check_match);
        CAIRN_STEP_RUN(check, at.rounds, budget, cairn_scanner_check_measure_turn);
    }
    if (set_step_of_turns(check)) {
        CAIRN_STEP_RUN(check, at.rounds, budget, cairn_scanner_check_match);
        if (!is_straighter(check)) {
            check->correction.angle_step = check->rounds.step_before;
            CAIRN_STEP_RUN(check, at.rounds, budget, cairn_scanner_check_match);
        }
    }
    CAIRN_STEP_RUN(check, at.rounds, budget, straighten);
    CAIRN_STEP_RUN(check, at.rounds, budget, cairn_scanner_check_measure_turn);
    check->found.turn_scale = check->fit.turn;
    CAIRN_STEP_END(check->at.rounds);
}

/* ---- The check ---- */

/* What the scans say of the sweep and the step is taken as logged at first. */
static void begin_corrections(cairn_scanner_check *check)
{
    check->correction = cairn_scan_correction_none();
    check->correction.angle_step = check->found.angle_step;
    check->correction.sweep = check->found.sweep;
    check->pair_count = 0;
}

static int32_t count_matched(const cairn_scanner_check *check)
{
    int32_t matched = 0;

    for (int32_t i = 0; i < check->pair_count; i++)
        matched += check->pairs[i].is_matched;
    return matched;
}

static void limit_known(cairn_scanner_check_value *value, int32_t may_be, cairn_real sigma)
{
    value->is_known = value->is_known && may_be && value->sigma <= sigma;
    if (!value->is_known)
        value->value = value->sigma = 0;
}

/* Takes the estimates; those that are too uncertain are not known. */
static void commit_result(cairn_scanner_check *check)
{
    cairn_scanner_check_result *found = &check->found;
    int32_t has_turns = check->drive.has_odometry && found->turns >= LEAST_TURNS,
            has_pairs = check->drive.has_odometry && found->pairs >= LEAST_PAIRS;

    found->walls = check->wall_count;
    found->range_scale = check->correction.range_scale;
    found->flips = check->correction.flips;
    found->step.value =
        found->angle_step > 0 ? check->correction.angle_step / found->angle_step : 1;
    found->sweep_found.value = check->correction.sweep;
    found->distance = check->fit.distance;
    found->x = check->fit.x;
    found->y = check->fit.y;
    found->theta = check->fit.theta;
    limit_known(&found->step, 1, STEP_KNOWN);
    limit_known(&found->sweep_found, 1, SWEEP_KNOWN_S);
    limit_known(&found->turn, has_turns, ODOMETRY_KNOWN);
    limit_known(&found->turn_scale, has_turns, ODOMETRY_KNOWN);
    limit_known(&found->distance, has_pairs, ODOMETRY_KNOWN);
    limit_known(&found->x, has_pairs, SENSOR_KNOWN_M);
    limit_known(&found->y, has_pairs, SENSOR_KNOWN_M);
    limit_known(&found->theta, has_pairs, SENSOR_KNOWN_RAD);
    check->result = *found;
    check->is_running = 0;
}

/* Pairs are chosen by the odometry; neighbours, whose walls can be measured at least, where scans
 * are too far apart. */
static int run(cairn_scanner_check *check, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(check->at.all);
    CAIRN_STEP_RUN(check, at.all, budget, cairn_scanner_check_survey);
    begin_corrections(check);
    check->choice.by_odometry = check->drive.has_odometry;
    CAIRN_STEP_RUN(check, at.all, budget, cairn_scanner_check_choose);
    if (check->choice.by_odometry && check->pair_count < LEAST_PAIRS) {
        check->choice.by_odometry = 0;
        CAIRN_STEP_RUN(check, at.all, budget, cairn_scanner_check_choose);
    }
    CAIRN_STEP_RUN(check, at.all, budget, cairn_scanner_check_find_unit);
    CAIRN_STEP_RUN(check, at.all, budget, correct_in_rounds);
    CAIRN_STEP_RUN(check, at.all, budget, cairn_scanner_check_mounting);
    check->found.pairs = count_matched(check);
    commit_result(check);
    CAIRN_STEP_END(check->at.all);
}

cairn_status cairn_scanner_check_step(cairn_scanner_check *check, cairn_budget *budget)
{
    int32_t before;

    if (check == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!check->is_running)
        return CAIRN_OK;
    before = budget->left;
    if (before <= 0)
        return CAIRN_MORE;
    (void)run(check, budget);
    check->measure.units += before - budget->left;
    return check->is_running ? CAIRN_MORE : CAIRN_OK;
}

cairn_scanner_check_result cairn_scanner_check_read(const cairn_scanner_check *check)
{
    return check->result;
}

cairn_scanner_check_measure cairn_scanner_check_measured(const cairn_scanner_check *check)
{
    return check->measure;
}

/* ---- Faults ---- */

static int differs(cairn_scanner_check_value value, cairn_real from, cairn_real least)
{
    cairn_real difference = cairn_abs(value.value - from);

    return value.is_known && difference > least && difference > SIGNIFICANCE_SIGMAS * value.sigma;
}

static int has_other_mounting(const cairn_scanner_check_result *result)
{
    cairn_scanner_check_value turned = result->theta;

    turned.value = cairn_wrap_angle(turned.value - result->base_sensor.theta);
    return differs(result->x, result->base_sensor.x, SENSOR_MATTERS_M) ||
           differs(result->y, result->base_sensor.y, SENSOR_MATTERS_M) ||
           differs(turned, 0, SENSOR_MATTERS_RAD);
}

int32_t cairn_scanner_check_needs_overlap(const cairn_scanner_check_result *result)
{
    return result != NULL && differs(result->step, 1, STEP_MATTERS) &&
           cairn_abs(result->step.value - 1) < STEP_SMALL;
}

/* Whether overlapping scans deny the logged step, and agree with the one of walls. */
static int is_confirmed(const cairn_scanner_check_result *result)
{
    cairn_scanner_check_value overlap = result->overlap_step, step = result->step;
    cairn_real variance = overlap.sigma * overlap.sigma + step.sigma * step.sigma;

    return differs(overlap, 1, 0) &&
           cairn_abs(overlap.value - step.value) <= AGREEMENT_SIGMAS * cairn_sqrt(variance);
}

int32_t cairn_scanner_check_has(const cairn_scanner_check_result *result,
                                cairn_scanner_check_fault kind)
{
    switch (kind) {
    case CAIRN_SCANNER_CHECK_RANGES:
        return result->range_scale != 1;
    case CAIRN_SCANNER_CHECK_FLIP:
        return result->flips;
    case CAIRN_SCANNER_CHECK_STEP:
        return differs(result->step, 1, STEP_MATTERS) &&
               (!cairn_scanner_check_needs_overlap(result) || is_confirmed(result));
    case CAIRN_SCANNER_CHECK_SWEEP:
        return differs(result->sweep_found, result->sweep, SWEEP_MATTERS_S);
    case CAIRN_SCANNER_CHECK_SENSOR:
        return has_other_mounting(result);
    case CAIRN_SCANNER_CHECK_DISTANCE:
        return differs(result->distance, 1, ODOMETRY_MATTERS);
    case CAIRN_SCANNER_CHECK_TURN:
        return differs(result->turn_scale, 1, ODOMETRY_MATTERS);
    case CAIRN_SCANNER_CHECK_STAMPS:
        return (cairn_real)result->backward + (cairn_real)result->constant >
               STAMPS_MATTER * (cairn_real)result->scans;
    case CAIRN_SCANNER_CHECK_REPEATED:
        return result->repeated >= LEAST_REPEATED &&
               (cairn_real)result->repeated > REPEATED_MATTER * (cairn_real)result->moved;
    default:
        return 0;
    }
}
