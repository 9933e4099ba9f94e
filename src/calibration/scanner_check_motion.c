/* Motions of matched scans against the odometry: turns, distances, and the mounting.
 *
 * Method (hand-eye calibration in the plane): with the sensor at l, theta on the robot, the motion
 * (t, phi) of the odometry is seen by the sensor as a translation A t + (R(phi) - I) q, where A
 * turns by -theta and scales by the ratio of distances, and q = R(-theta) l. That is linear in A
 * (two unknowns) and q. Weights are those of the matches' covariances, of an error of the odometry
 * in proportion to its motion, and robust against wrong matches. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/registration.h"
#include "src/base/step.h"
#include "src/calibration/scanner_check_work.h"
#include "src/containers/heap.h"

enum { REWEIGHT_ROUNDS = 20 };
enum { UNITS_PER_PAIR = 1, UNITS_PER_ENTRY = 1, UNITS_PER_SOLUTION = 120, UNITS_PER_RESULT = 20 };

/* rad: smaller turns say little of a ratio of turns. */
static const cairn_real TURN_RAD = CAIRN_REAL(0.08);
/* Standard deviations of a match are about this many times those of independent points. */
static const cairn_real MATCH_FACTOR = 3;
/* m, rad: least standard deviation of a match. */
static const cairn_real MATCH_SIGMA_M = CAIRN_REAL(0.01);
static const cairn_real MATCH_SIGMA_RAD = CAIRN_REAL(0.004);
/* Standard deviation of the odometry, as a share of its distance and turn, and m per rad. */
static const cairn_real ODOMETRY_DISTANCE = CAIRN_REAL(0.04);
static const cairn_real ODOMETRY_TURN = CAIRN_REAL(0.04);
static const cairn_real ODOMETRY_M_PER_RAD = CAIRN_REAL(0.02);
/* Scale of the Cauchy weight, in standard deviations. */
static const cairn_real CAUCHY_SCALE = CAIRN_REAL(1.5);
/* The first weights are those of this many times the scale, so that wrong matches do not decide; it
 * shrinks by a factor from round to round, to CAUCHY_SCALE. */
static const cairn_real FIRST_SCALE = 8;
static const cairn_real SCALE_FACTOR = CAIRN_REAL(0.7);

static cairn_real square(cairn_real x)
{
    return x * x;
}

static cairn_real weight_of(const cairn_scanner_check *check, cairn_real squared)
{
    return cairn_registration_cauchy(squared, CAUCHY_SCALE * cairn_max(1, check->fit.scale));
}

/* ---- Turns ---- */

static int has_turn(const scanner_check_pair *pair)
{
    return pair->is_matched && cairn_abs(pair->odometry.theta) >= TURN_RAD;
}

static int is_greater(const void *context, int32_t a, int32_t b)
{
    const cairn_scanner_check *check = context;

    return check->ratio[a] > check->ratio[b];
}

static void exchange(void *context, int32_t a, int32_t b)
{
    cairn_scanner_check *check = context;
    cairn_real kept = check->ratio[a];

    check->ratio[a] = check->ratio[b];
    check->ratio[b] = kept;
}

/* Lists the ratios of turns. */
static void list_ratios(cairn_scanner_check *check)
{
    check->found.turns = 0;
    for (int32_t i = 0; i < check->pair_count; i++)
        if (has_turn(&check->pairs[i]))
            check->ratio[check->found.turns++] =
                check->pairs[i].match.theta / check->pairs[i].odometry.theta;
    check->fit.sorting = heap_sorting_of(check->found.turns);
}

static void clear_turn_sums(cairn_scanner_check *check)
{
    const cairn_real none[1] = {0};

    cairn_scanner_check_clear(&check->fit.sums, 1, none, none);
}

static void add_turn(cairn_scanner_check *check, const scanner_check_pair *pair)
{
    cairn_real by_odometry = pair->odometry.theta, by_match = pair->match.theta,
               variance = square(MATCH_FACTOR) * pair->covariance[8] + square(MATCH_SIGMA_RAD) +
                          square(ODOMETRY_TURN * by_odometry),
               a = square(by_odometry) / variance, b = by_odometry * by_match / variance;

    cairn_scanner_check_add(
        &check->fit.sums, pair->block,
        weight_of(check, square(by_match - check->fit.turn.value * by_odometry) / variance), &a,
        &b);
}

/* Takes the solution of a round. */
static void take_turn(cairn_scanner_check *check)
{
    check->fit.is_solved = cairn_scanner_check_solve(&check->fit.sums, &check->fit.solution);
    check->fit.turn.value = check->fit.is_solved ? check->fit.solution.x[0] : 0;
    check->fit.turn.sigma = check->fit.is_solved ? check->fit.solution.sigma[0] : 0;
    check->fit.turn.is_known = check->fit.is_solved;
}

/* The robust solution begins at the median of the ratios. */
int cairn_scanner_check_measure_turn(cairn_scanner_check *check, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(check->at.turn);
    CAIRN_STEP_CHARGE(check, at.turn, budget, UNITS_PER_PAIR * check->pair_count);
    list_ratios(check);
    CAIRN_STEP_UNTIL(check->at.turn,
                     heap_sort_step(&check->fit.sorting, budget, &check->units_charged,
                                    UNITS_PER_ENTRY, check, is_greater, exchange));
    memset(&check->fit.turn, 0, sizeof check->fit.turn);
    if (check->found.turns > 0)
        check->fit.turn.value = check->ratio[check->found.turns / 2];
    check->fit.scale = FIRST_SCALE;
    for (check->fit.round = 0; check->fit.round < REWEIGHT_ROUNDS && check->found.turns > 0;
         check->fit.round++) {
        clear_turn_sums(check);
        for (check->cursor = 0; check->cursor < check->pair_count; check->cursor++) {
            CAIRN_STEP_CHARGE(check, at.turn, budget, UNITS_PER_PAIR);
            if (has_turn(&check->pairs[check->cursor]))
                add_turn(check, &check->pairs[check->cursor]);
        }
        CAIRN_STEP_CHARGE(check, at.turn, budget, UNITS_PER_SOLUTION);
        take_turn(check);
        if (!check->fit.is_solved)
            break;
        check->fit.scale *= SCALE_FACTOR;
    }
    CAIRN_STEP_END(check->at.turn);
}

/* ---- Mounting ---- */

/* Unknowns: A is the matrix (COSINE, -SINE; SINE, COSINE). */
enum { COSINE, SINE, LEVER_X, LEVER_Y, UNKNOWNS };

/* m: standard deviation of what is expected of the lever: 0. */
static const cairn_real LEVER_SIGMA_M = 3;

/* Rows of the two equations of a pair. */
static void rows_of(const scanner_check_pair *pair, cairn_real row[2][UNKNOWNS])
{
    cairn_real x = pair->odometry.x, y = pair->odometry.y, s, c;

    cairn_sincos(pair->match.theta, &s, &c);
    row[0][COSINE] = x;
    row[0][SINE] = -y;
    row[0][LEVER_X] = c - 1;
    row[0][LEVER_Y] = -s;
    row[1][COSINE] = y;
    row[1][SINE] = x;
    row[1][LEVER_X] = s;
    row[1][LEVER_Y] = c - 1;
}

/* Information of a pair: the inverse of the covariance of its translation. */
static void information_of(const scanner_check_pair *pair, cairn_real w[2][2])
{
    cairn_real distance = cairn_scanner_check_distance(pair->odometry),
               added = square(MATCH_SIGMA_M) + square(ODOMETRY_DISTANCE * distance) +
                       square(ODOMETRY_M_PER_RAD * pair->odometry.theta),
               factor = square(MATCH_FACTOR), xx = factor * pair->covariance[0] + added,
               xy = factor * pair->covariance[1], yy = factor * pair->covariance[4] + added,
               determinant = xx * yy - xy * xy;

    w[0][0] = yy / determinant;
    w[1][1] = xx / determinant;
    w[0][1] = w[1][0] = -xy / determinant;
}

/* Adds the two equations of a pair, weighted by their squares; in the first round, where nothing is
 * known yet, all pairs count alike. */
static void add_mounting(cairn_scanner_check *check, const scanner_check_pair *pair)
{
    cairn_real row[2][UNKNOWNS], w[2][2], squares = 0;
    cairn_real seen[2] = {pair->match.x, pair->match.y}, left[2];
    cairn_real a[SCANNER_CHECK_ELEMENTS] = {0}, b[UNKNOWNS] = {0};

    rows_of(pair, row);
    information_of(pair, w);
    for (int i = 0; i < 2; i++) {
        left[i] = seen[i];
        for (int k = 0; k < UNKNOWNS; k++)
            left[i] -= row[i][k] * check->fit.solution.x[k];
    }
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 2; k++) {
            int element = 0;

            squares += left[i] * w[i][k] * left[k];
            for (int m = 0; m < UNKNOWNS; m++) {
                b[m] += row[i][m] * w[i][k] * seen[k];
                for (int n = 0; n <= m; n++)
                    a[element++] += row[i][m] * w[i][k] * row[k][n];
            }
        }
    cairn_scanner_check_add(&check->fit.sums, pair->block,
                            check->fit.round == 0 ? 1 : weight_of(check, squares), a, b);
}

static void clear_mounting_sums(cairn_scanner_check *check)
{
    const cairn_real expected[UNKNOWNS] = {[COSINE] = 1},
                     lever = 1 / (LEVER_SIGMA_M * LEVER_SIGMA_M),
                     prior[UNKNOWNS] = {[LEVER_X] = lever, [LEVER_Y] = lever};

    cairn_scanner_check_clear(&check->fit.sums, UNKNOWNS, prior, expected);
}

/* What is reported of the unknowns. */
enum { DISTANCE, THETA, X, Y, QUANTITIES };

static void quantities_of(const cairn_real *x, cairn_real quantity[QUANTITIES])
{
    cairn_real theta = cairn_atan2(-x[SINE], x[COSINE]), s, c;

    cairn_sincos(theta, &s, &c);
    quantity[DISTANCE] = cairn_vec2_norm((cairn_vec2){x[COSINE], x[SINE]});
    quantity[THETA] = theta;
    quantity[X] = c * x[LEVER_X] - s * x[LEVER_Y];
    quantity[Y] = s * x[LEVER_X] + c * x[LEVER_Y];
}

/* Converts the solution, with the standard deviations of the converted quantities. */
static void convert(cairn_scanner_check *check)
{
    cairn_scanner_check_value *value[QUANTITIES] = {&check->fit.distance, &check->fit.theta,
                                                    &check->fit.x, &check->fit.y};
    cairn_real quantity[QUANTITIES], without[QUANTITIES][SCANNER_CHECK_BLOCKS];

    quantities_of(check->fit.solution.x, quantity);
    for (int i = 0; i < SCANNER_CHECK_BLOCKS; i++) {
        cairn_real part[QUANTITIES];

        quantities_of(check->fit.solution.without[i], part);
        part[THETA] = quantity[THETA] + cairn_wrap_angle(part[THETA] - quantity[THETA]);
        for (int k = 0; k < QUANTITIES; k++)
            without[k][i] = part[k];
    }
    for (int k = 0; k < QUANTITIES; k++) {
        value[k]->value = quantity[k];
        value[k]->sigma = cairn_scanner_check_jackknife(&check->fit.sums, without[k]);
        value[k]->is_known = 1;
    }
}

/* Begins without a solution. */
static void begin_mounting(cairn_scanner_check *check)
{
    const cairn_scanner_check_value unknown = {.is_known = 0};

    memset(&check->fit.solution, 0, sizeof check->fit.solution);
    check->fit.distance = check->fit.x = check->fit.y = check->fit.theta = unknown;
    check->fit.scale = FIRST_SCALE;
}

int cairn_scanner_check_mounting(cairn_scanner_check *check, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(check->at.mounting);
    begin_mounting(check);
    for (check->fit.round = 0; check->fit.round < REWEIGHT_ROUNDS; check->fit.round++) {
        clear_mounting_sums(check);
        for (check->cursor = 0; check->cursor < check->pair_count; check->cursor++) {
            CAIRN_STEP_CHARGE(check, at.mounting, budget, UNITS_PER_PAIR);
            if (check->pairs[check->cursor].is_matched)
                add_mounting(check, &check->pairs[check->cursor]);
        }
        CAIRN_STEP_CHARGE(check, at.mounting, budget, UNITS_PER_SOLUTION);
        check->fit.is_solved = cairn_scanner_check_solve(&check->fit.sums, &check->fit.solution);
        if (!check->fit.is_solved)
            break;
        check->fit.scale *= SCALE_FACTOR;
    }
    CAIRN_STEP_CHARGE(check, at.mounting, budget, UNITS_PER_RESULT);
    if (check->fit.is_solved)
        convert(check);
    CAIRN_STEP_END(check->at.mounting);
}
