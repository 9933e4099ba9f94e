/* The bend of straight walls: what makes them straight.
 *
 * Method: the hits of a wall, a fitted segment, deviate by e from their regression line. A wrong
 * angle step moves each across its ray in proportion to its bearing; an offset of the ranges moves
 * it along the ray; a motion during the scan that is not corrected moves it by the velocity times
 * its share of the sweep. Each gives a column; the two unknowns of the line are eliminated, and the
 * walls of all scans are solved together, with robust weights. Step and offset differ, as the bend
 * by the step grows with the distance of the wall; step and sweep differ, as the bend by the sweep
 * changes its sign with the turn. */
#include "src/base/build.h"

#include <math.h>
#include <string.h>

#include "src/host/maps/scanner_check_work.h"

enum { LEAST_HITS = 10, REWEIGHT_ROUNDS = 8 };

/* m: shorter segments are no walls. */
static const double LEAST_LENGTH_M = 0.8;
/* m: hits this near to an end of a segment may be those of the next wall. */
static const double END_M = 0.1;
/* m: hits farther from the segment are not its own. */
static const double GATE_M = 0.06;
/* Cosine of the angle of incidence: at grazing beams ranges are wrong. */
static const double LEAST_COSINE = 0.3;
/* m: least standard deviation of a wall, as none is plane to less. */
static const double LEAST_SIGMA_M = 0.008;
/* Scale of the Cauchy weight of a wall, in standard deviations. */
static const double CAUCHY_SCALE = 2;
/* m, rad/s, s: standard deviations of what is expected of offset, and of step and sweep. */
static const double OFFSET_SIGMA_M = 0.02;
static const double SWEEP_SIGMA_S = 1;
static const double STEP_SIGMA = 1;

/* Sums of the regression of the deviation and of the columns: products of 1, x, e and columns. */
enum { ONE, ALONG, FIRST_COLUMN, DEVIATION = FIRST_COLUMN + WALL_UNKNOWNS, COLUMNS };

typedef struct wall_sums {
    double product[COLUMNS][COLUMNS];
    int32_t hits;
} wall_sums;

static void add_hit(wall_sums *sums, const double column[COLUMNS])
{
    for (int i = 0; i < COLUMNS; i++)
        for (int k = 0; k <= i; k++)
            sums->product[i][k] += column[i] * column[k];
    sums->hits++;
}

/* Eliminates a column, so that the others are orthogonal to it. 0: it is dependent. */
static int eliminate(wall_sums *sums, int pivot)
{
    double square = sums->product[pivot][pivot];

    if (!(square > 0))
        return 0;
    for (int i = pivot + 1; i < COLUMNS; i++)
        for (int k = pivot + 1; k <= i; k++)
            sums->product[i][k] -= sums->product[i][pivot] * sums->product[k][pivot] / square;
    return 1;
}

/* Makes the term of a wall of its sums. 0: too few hits. */
static int make_term(wall_sums *sums, int32_t block, scanner_check_term *term)
{
    double variance;

    memset(term, 0, sizeof *term);
    if (sums->hits < LEAST_HITS || !eliminate(sums, ONE) || !eliminate(sums, ALONG))
        return 0;
    variance = sums->product[DEVIATION][DEVIATION] / (sums->hits - 2);
    variance = fmax(variance, LEAST_SIGMA_M * LEAST_SIGMA_M);
    for (int i = 0; i < WALL_UNKNOWNS; i++) {
        for (int k = 0; k < WALL_UNKNOWNS; k++)
            term->a[i][k] =
                sums->product[FIRST_COLUMN + (i > k ? i : k)][FIRST_COLUMN + (i > k ? k : i)] /
                variance;
        term->b[i] = -sums->product[DEVIATION][FIRST_COLUMN + i] / variance;
    }
    term->weight = 1;
    term->block = block;
    return 1;
}

/* Fills in the columns of a hit; their values are those where its ray meets the segment's line, as
 * the error of its range must not enter them. 0: it is not on the segment. */
static int columns_of(const cairn_scan_view *view, int32_t beam, double bearing,
                      const cairn_segment *segment, cairn_twist velocity, double column[COLUMNS])
{
    const cairn_scan_beam *b = &view->beams[beam];
    cairn_vec2 direction = cairn_vec2_unit(cairn_vec2_sub(segment->b, segment->a)),
               normal = cairn_vec2_left_perp(direction),
               unit = cairn_vec2_unit(cairn_vec2_sub(b->to, b->from)), met, moved;
    double length = (double)cairn_vec2_norm(cairn_vec2_sub(segment->b, segment->a)),
           cosine = -(double)cairn_vec2_dot(unit, normal), along, across, range;

    if (b->kind != CAIRN_SCAN_BEAM_HIT || cosine < LEAST_COSINE)
        return 0;
    across = (double)cairn_vec2_dot(cairn_vec2_sub(b->to, segment->a), normal);
    range = (double)cairn_vec2_dot(cairn_vec2_sub(b->from, segment->a), normal) / cosine;
    met = cairn_vec2_add(b->from, cairn_vec2_scale(unit, (cairn_real)range));
    along = (double)cairn_vec2_dot(cairn_vec2_sub(met, segment->a), direction);
    if (along < END_M || along > length - END_M || fabs(across) > GATE_M)
        return 0;
    moved = cairn_vec2_add(velocity.linear,
                           cairn_vec2_scale(cairn_vec2_left_perp(met), velocity.angular));
    column[ONE] = 1;
    column[ALONG] = along - 0.5 * length;
    column[FIRST_COLUMN + WALL_STEP] =
        bearing * range * (double)cairn_vec2_dot(cairn_vec2_left_perp(unit), normal);
    column[FIRST_COLUMN + WALL_OFFSET] = -cosine;
    column[FIRST_COLUMN + WALL_SWEEP] =
        beam * (double)cairn_vec2_dot(moved, normal) / (view->beam_count - 1);
    column[DEVIATION] = across;
    return 1;
}

/* Measures one segment. 0: no wall. */
static int measure_wall(scanner_check_work *work, const cairn_scan_view *view,
                        const cairn_segment *segment, int32_t block, cairn_twist velocity,
                        scanner_check_term *term)
{
    double middle = 0.5 * ((double)work->angle[0] + (double)work->angle[view->beam_count - 1]);
    double column[COLUMNS];
    wall_sums sums;

    memset(&sums, 0, sizeof sums);
    for (int32_t i = 0; i < view->beam_count; i++)
        if (columns_of(view, i, (double)work->angle[i] - middle, segment, velocity, column))
            add_hit(&sums, column);
    if (!make_term(&sums, block, term))
        return 0;
    work->wall_hits += sums.hits;
    return 1;
}

void cairn_scanner_check_add_walls(scanner_check_work *work, const cairn_scan_view *view,
                                   int32_t block, cairn_twist velocity)
{
    int32_t limit = work->walls + SCANNER_CHECK_WALLS;

    for (int32_t i = 0; i < view->segment_count && work->walls < limit; i++) {
        const cairn_segment *segment = &view->segments[i];
        double length = (double)cairn_vec2_norm(cairn_vec2_sub(segment->b, segment->a));

        if (length >= LEAST_LENGTH_M)
            work->walls +=
                measure_wall(work, view, segment, block, velocity, &work->wall[work->walls]);
    }
}

/* Sets the robust weight of each wall from its deviation, in the direction of the angle step. */
static void reweight(scanner_check_work *work, const double *x)
{
    for (int32_t i = 0; i < work->walls; i++) {
        scanner_check_term *wall = &work->wall[i];
        double left = wall->b[WALL_STEP], z;

        for (int k = 0; k < WALL_UNKNOWNS; k++)
            left -= wall->a[WALL_STEP][k] * x[k];
        z = wall->a[WALL_STEP][WALL_STEP] > 0
                ? left / sqrt(wall->a[WALL_STEP][WALL_STEP]) / CAUCHY_SCALE
                : 0;
        wall->weight = 1 / (1 + z * z);
    }
}

int cairn_scanner_check_bend(scanner_check_work *work, scanner_check_solution *solution)
{
    const double expected[WALL_UNKNOWNS] = {0, 0, 0},
                 prior[WALL_UNKNOWNS] = {1 / (STEP_SIGMA * STEP_SIGMA),
                                         1 / (OFFSET_SIGMA_M * OFFSET_SIGMA_M),
                                         1 / (SWEEP_SIGMA_S * SWEEP_SIGMA_S)};

    for (int32_t i = 0; i < work->walls; i++)
        work->wall[i].weight = 1;
    for (int round = 0; round < REWEIGHT_ROUNDS; round++) {
        if (!cairn_scanner_check_solve(work->wall, work->walls, WALL_UNKNOWNS, prior, expected,
                                       solution))
            return 0;
        reweight(work, solution->x);
    }
    return 1;
}
