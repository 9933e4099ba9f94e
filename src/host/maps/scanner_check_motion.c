/* Motions of matched scans against the odometry: turns, distances, and the mounting.
 *
 * Method (hand-eye calibration in the plane): with the sensor at l, theta on the robot, the motion
 * (t, phi) of the odometry is seen by the sensor as a translation A t + (R(phi) - I) q, where A
 * turns by -theta and scales by the ratio of distances, and q = R(-theta) l. That is linear in A
 * (two unknowns) and q. Weights are those of the matches' covariances, of an error of the odometry
 * in proportion to its motion, and robust against wrong matches. */
#include "src/base/build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/maps/scanner_check_work.h"

enum { REWEIGHT_ROUNDS = 20 };

/* rad: smaller turns say little of a ratio of turns. */
static const double TURN_RAD = 0.08;
/* Standard deviations of a match are about this many times those of independent points. */
static const double MATCH_FACTOR = 3;
/* m, rad: least standard deviation of a match. */
static const double MATCH_SIGMA_M = 0.01;
static const double MATCH_SIGMA_RAD = 0.004;
/* Standard deviation of the odometry, as a share of its distance and turn, and m per rad. */
static const double ODOMETRY_DISTANCE = 0.04;
static const double ODOMETRY_TURN = 0.04;
static const double ODOMETRY_M_PER_RAD = 0.02;
/* Scale of the Cauchy weight, in standard deviations. */
static const double CAUCHY_SCALE = 1.5;
/* The first weights are those of this many times the scale, so that wrong matches do not decide. */
static const double FIRST_SCALE = 8;

static double square(double x)
{
    return x * x;
}

static double cauchy(double squares, double scale)
{
    return 1 / (1 + squares / square(scale));
}

/* Scale of the weights in a round: shrinks to CAUCHY_SCALE. */
static double scale_of(int round)
{
    return CAUCHY_SCALE * fmax(1, FIRST_SCALE * pow(0.7, round));
}

/* ---- Turns ---- */

static int compare_doubles(const void *a, const void *b)
{
    double first = *(const double *)a, second = *(const double *)b;

    return (first > second) - (first < second);
}

/* Median of the ratios of turns, where the robust solution begins. */
static double median_ratio(const scanner_check_work *work, int32_t *turns)
{
    double ratio[CAIRN_SCANNER_CHECK_PAIRS];
    int32_t count = 0;

    for (int32_t i = 0; i < work->pairs; i++) {
        const scanner_check_pair *pair = &work->pair[i];

        if (pair->is_matched && fabs((double)pair->odometry.theta) >= TURN_RAD)
            ratio[count++] = (double)pair->match.theta / (double)pair->odometry.theta;
    }
    *turns = count;
    if (count == 0)
        return 0;
    qsort(ratio, (size_t)count, sizeof *ratio, compare_doubles);
    return ratio[count / 2];
}

static void turn_term(const scanner_check_pair *pair, double ratio, int round,
                      scanner_check_term *term)
{
    double by_odometry = (double)pair->odometry.theta, by_match = (double)pair->match.theta;
    double variance = square(MATCH_FACTOR) * pair->covariance[8] + square(MATCH_SIGMA_RAD) +
                      square(ODOMETRY_TURN * by_odometry);

    memset(term, 0, sizeof *term);
    term->block = pair->block;
    term->a[0][0] = square(by_odometry) / variance;
    term->b[0] = by_odometry * by_match / variance;
    term->weight = cauchy(square(by_match - ratio * by_odometry) / variance, scale_of(round));
}

cairn_scanner_check_value cairn_scanner_check_turn(scanner_check_work *work, int32_t *turns)
{
    const double none[1] = {0};
    cairn_scanner_check_value value = {0, 0, 0};
    scanner_check_term term[CAIRN_SCANNER_CHECK_PAIRS];
    scanner_check_solution solution;

    value.value = median_ratio(work, turns);
    for (int round = 0; round<REWEIGHT_ROUNDS && * turns> 0; round++) {
        int32_t count = 0;

        for (int32_t i = 0; i < work->pairs; i++)
            if (work->pair[i].is_matched && fabs((double)work->pair[i].odometry.theta) >= TURN_RAD)
                turn_term(&work->pair[i], value.value, round, &term[count++]);
        if (!cairn_scanner_check_solve(term, count, 1, none, none, &solution))
            return (cairn_scanner_check_value){0, 0, 0};
        value.value = solution.x[0];
        value.sigma = solution.sigma[0];
        value.is_known = 1;
    }
    return value;
}

/* ---- Mounting ---- */

/* Unknowns: A is the matrix (COSINE, -SINE; SINE, COSINE). */
enum { COSINE, SINE, LEVER_X, LEVER_Y, UNKNOWNS };

/* m: standard deviation of what is expected of the lever: 0. */
static const double LEVER_SIGMA_M = 3;

/* Rows of the two equations of a pair. */
static void rows_of(const scanner_check_pair *pair, double row[2][UNKNOWNS])
{
    double x = (double)pair->odometry.x, y = (double)pair->odometry.y,
           c = cos((double)pair->match.theta), s = sin((double)pair->match.theta);
    const double rows[2][UNKNOWNS] = {{x, -y, c - 1, -s}, {y, x, s, c - 1}};

    memcpy(row, rows, sizeof rows);
}

/* Information of a pair: the inverse of the covariance of its translation. */
static void information_of(const scanner_check_pair *pair, double w[2][2])
{
    double distance = hypot((double)pair->odometry.x, (double)pair->odometry.y),
           added = square(MATCH_SIGMA_M) + square(ODOMETRY_DISTANCE * distance) +
                   square(ODOMETRY_M_PER_RAD * (double)pair->odometry.theta),
           factor = square(MATCH_FACTOR), xx = factor * pair->covariance[0] + added,
           xy = factor * pair->covariance[1], yy = factor * pair->covariance[4] + added,
           determinant = xx * yy - xy * xy;

    w[0][0] = yy / determinant;
    w[1][1] = xx / determinant;
    w[0][1] = w[1][0] = -xy / determinant;
}

static void mounting_term(const scanner_check_pair *pair, const double *x, int round,
                          scanner_check_term *term)
{
    double row[2][UNKNOWNS], w[2][2], squares = 0;
    double seen[2] = {(double)pair->match.x, (double)pair->match.y}, left[2];

    rows_of(pair, row);
    information_of(pair, w);
    memset(term, 0, sizeof *term);
    term->block = pair->block;
    for (int i = 0; i < 2; i++) {
        left[i] = seen[i];
        for (int k = 0; k < UNKNOWNS; k++)
            left[i] -= row[i][k] * x[k];
    }
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 2; k++) {
            squares += left[i] * w[i][k] * left[k];
            for (int m = 0; m < UNKNOWNS; m++) {
                term->b[m] += row[i][m] * w[i][k] * seen[k];
                for (int n = 0; n < UNKNOWNS; n++)
                    term->a[m][n] += row[i][m] * w[i][k] * row[k][n];
            }
        }
    term->weight = cauchy(squares, scale_of(round));
}

/* What is reported of the unknowns. */
enum { DISTANCE, THETA, X, Y, QUANTITIES };

static void quantities_of(const double *x, double quantity[QUANTITIES])
{
    double theta = atan2(-x[SINE], x[COSINE]), c = cos(theta), s = sin(theta);

    quantity[DISTANCE] = hypot(x[COSINE], x[SINE]);
    quantity[THETA] = theta;
    quantity[X] = c * x[LEVER_X] - s * x[LEVER_Y];
    quantity[Y] = s * x[LEVER_X] + c * x[LEVER_Y];
}

static double turned_near(double angle, double near)
{
    return near + remainder(angle - near, 2 * 3.14159265358979323846);
}

/* Converts the solution, with the standard deviations of the converted quantities. */
static void convert(const scanner_check_solution *solution, cairn_scanner_check *check)
{
    cairn_scanner_check_value *value[QUANTITIES] = {&check->distance, &check->theta, &check->x,
                                                    &check->y};
    double quantity[QUANTITIES], without[QUANTITIES][SCANNER_CHECK_BLOCKS];

    quantities_of(solution->x, quantity);
    for (int i = 0; i < SCANNER_CHECK_BLOCKS; i++) {
        double part[QUANTITIES];

        quantities_of(solution->without[i], part);
        part[THETA] = turned_near(part[THETA], quantity[THETA]);
        for (int k = 0; k < QUANTITIES; k++)
            without[k][i] = part[k];
    }
    for (int k = 0; k < QUANTITIES; k++) {
        value[k]->value = quantity[k];
        value[k]->sigma = cairn_scanner_check_jackknife(solution, without[k]);
        value[k]->is_known = 1;
    }
}

void cairn_scanner_check_mounting(scanner_check_work *work, cairn_scanner_check *check)
{
    const double expected[UNKNOWNS] = {1, 0, 0, 0},
                 prior[UNKNOWNS] = {0, 0, 1 / (LEVER_SIGMA_M * LEVER_SIGMA_M),
                                    1 / (LEVER_SIGMA_M * LEVER_SIGMA_M)};
    scanner_check_term term[CAIRN_SCANNER_CHECK_PAIRS];
    scanner_check_solution solution;

    memset(&solution, 0, sizeof solution);
    for (int round = 0; round < REWEIGHT_ROUNDS; round++) {
        int32_t count = 0;

        for (int32_t i = 0; i < work->pairs; i++) {
            if (!work->pair[i].is_matched)
                continue;
            mounting_term(&work->pair[i], solution.x, round, &term[count]);
            /* nothing is known yet: all pairs count alike */
            if (round == 0)
                term[count].weight = 1;
            count++;
        }
        if (!cairn_scanner_check_solve(term, count, UNKNOWNS, prior, expected, &solution))
            return;
    }
    convert(&solution, check);
}
