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

#include <string.h>

#include "cairn/registration.h"
#include "src/base/step.h"
#include "src/calibration/scanner_check_work.h"

enum { LEAST_HITS = 10, REWEIGHT_ROUNDS = 8 };
enum {
    BEAMS_PER_CHARGE = 16,
    UNITS_PER_CHARGE = 12,
    UNITS_PER_SEGMENT = 1,
    UNITS_PER_WALL = 4,
    UNITS_PER_SOLUTION = 80
};

/* m: shorter segments are no walls. */
static const cairn_real LEAST_LENGTH_M = CAIRN_REAL(0.8);
/* m: hits this near to an end of a segment may be those of the next wall. */
static const cairn_real END_M = CAIRN_REAL(0.1);
/* m: hits farther from the segment are not its own. */
static const cairn_real GATE_M = CAIRN_REAL(0.06);
/* Cosine of the angle of incidence: at grazing beams ranges are wrong. */
static const cairn_real LEAST_COSINE = CAIRN_REAL(0.3);
/* m: least standard deviation of a wall, as none is plane to less. */
static const cairn_real LEAST_SIGMA_M = CAIRN_REAL(0.008);
/* Scale of the Cauchy weight of a wall, in standard deviations. */
static const cairn_real CAUCHY_SCALE = 2;
/* m, s, share: standard deviations of what is expected of offset, sweep and step. */
static const cairn_real OFFSET_SIGMA_M = CAIRN_REAL(0.02);
static const cairn_real SWEEP_SIGMA_S = 1;
static const cairn_real STEP_SIGMA = 1;

/* Columns of the regression. */
enum {
    ONE,
    ALONG,
    FIRST_COLUMN,
    DEVIATION = FIRST_COLUMN + SCANNER_CHECK_WALL_UNKNOWNS,
    COLUMNS = SCANNER_CHECK_COLUMNS
};

/* ---- Sums of a wall ---- */

static void add_hit(scanner_check_wall_sums *sums, const cairn_real column[COLUMNS])
{
    for (int i = 0; i < COLUMNS; i++)
        for (int k = 0; k <= i; k++)
            sums->product[i][k] += column[i] * column[k];
    sums->hits++;
}

/* Eliminates a column, so that the others are orthogonal to it. 0: it is dependent. */
static int eliminate(scanner_check_wall_sums *sums, int pivot)
{
    cairn_real square = sums->product[pivot][pivot];

    if (!(square > 0))
        return 0;
    for (int i = pivot + 1; i < COLUMNS; i++)
        for (int k = pivot + 1; k <= i; k++)
            sums->product[i][k] -= sums->product[i][pivot] * sums->product[k][pivot] / square;
    return 1;
}

/* Makes the equations of a wall of its sums. 0: too few hits. */
static int make_wall(scanner_check_wall_sums *sums, int32_t block, scanner_check_wall *wall)
{
    cairn_real variance;
    int32_t elements = 0;

    if (sums->hits < LEAST_HITS || !eliminate(sums, ONE) || !eliminate(sums, ALONG))
        return 0;
    variance = sums->product[DEVIATION][DEVIATION] / (cairn_real)(sums->hits - 2);
    variance = cairn_max(variance, LEAST_SIGMA_M * LEAST_SIGMA_M);
    for (int i = 0; i < SCANNER_CHECK_WALL_UNKNOWNS; i++) {
        for (int k = 0; k <= i; k++)
            wall->a[elements++] = sums->product[FIRST_COLUMN + i][FIRST_COLUMN + k] / variance;
        wall->b[i] = -sums->product[DEVIATION][FIRST_COLUMN + i] / variance;
    }
    wall->block = block;
    return 1;
}

/* ---- Hits ---- */

/* A segment as a line with a normal to the free side. */
typedef struct wall_line {
    cairn_vec2 start, direction, normal;
    cairn_real length;
} wall_line;

static wall_line line_of(const cairn_segment *segment)
{
    wall_line line;

    line.start = segment->a;
    line.direction = cairn_vec2_unit(cairn_vec2_sub(segment->b, segment->a));
    line.normal = cairn_vec2_left_perp(line.direction);
    line.length = cairn_vec2_norm(cairn_vec2_sub(segment->b, segment->a));
    return line;
}

/* Fills in the columns of a hit; their values are those where its ray meets the segment's line, as
 * the error of its range must not enter them. 0: it is not on the segment.
 *
 * index: of the beam
 * bearing: from the middle of the field of view, rad */
static int columns_of(const cairn_scan_view *view, int32_t index, cairn_real bearing,
                      const wall_line *line, cairn_twist velocity, cairn_real column[COLUMNS])
{
    const cairn_scan_beam *beam = &view->beams[index];
    cairn_vec2 unit, met, moved;
    cairn_real cosine, along, across, range;

    if (beam->kind != CAIRN_SCAN_BEAM_HIT)
        return 0;
    unit = cairn_vec2_unit(cairn_vec2_sub(beam->to, beam->from));
    cosine = -cairn_vec2_dot(unit, line->normal);
    if (cosine < LEAST_COSINE)
        return 0;
    across = cairn_vec2_dot(cairn_vec2_sub(beam->to, line->start), line->normal);
    range = cairn_vec2_dot(cairn_vec2_sub(beam->from, line->start), line->normal) / cosine;
    met = cairn_vec2_add(beam->from, cairn_vec2_scale(unit, range));
    along = cairn_vec2_dot(cairn_vec2_sub(met, line->start), line->direction);
    if (along < END_M || along > line->length - END_M || cairn_abs(across) > GATE_M)
        return 0;
    moved = cairn_vec2_add(velocity.linear,
                           cairn_vec2_scale(cairn_vec2_left_perp(met), velocity.angular));
    column[ONE] = 1;
    column[ALONG] = along - CAIRN_REAL(0.5) * line->length;
    column[FIRST_COLUMN + WALL_STEP] =
        bearing * range * cairn_vec2_dot(cairn_vec2_left_perp(unit), line->normal);
    column[FIRST_COLUMN + WALL_OFFSET] = -cosine;
    column[FIRST_COLUMN + WALL_SWEEP] = (cairn_real)index * cairn_vec2_dot(moved, line->normal) /
                                        (cairn_real)(view->beam_count - 1);
    column[DEVIATION] = across;
    return 1;
}

/* Adds the hits of the next beams to the sums of the wall in work. */
static void add_hits(cairn_scanner_check *check)
{
    const cairn_scan_view *view = &check->matching.view;
    const wall_line line = line_of(&view->segments[check->wall.segment]);
    const cairn_real middle = CAIRN_REAL(0.5) * ((cairn_real)check->angle[0] +
                                                 (cairn_real)check->angle[view->beam_count - 1]);
    int32_t end = check->wall.beam + BEAMS_PER_CHARGE;
    cairn_real column[COLUMNS];

    end = end < view->beam_count ? end : view->beam_count;
    for (int32_t i = check->wall.beam; i < end; i++)
        if (columns_of(view, i, (cairn_real)check->angle[i] - middle, &line,
                       check->matching.velocity, column))
            add_hit(&check->wall.sums, column);
}

/* ---- Walls ---- */

static int is_wall(const cairn_segment *segment)
{
    return cairn_vec2_norm(cairn_vec2_sub(segment->b, segment->a)) >= LEAST_LENGTH_M;
}

/* Takes the wall in work when it has enough hits. */
static void take_wall(cairn_scanner_check *check)
{
    if (!make_wall(&check->wall.sums, check->pairs[check->matching.pair].block,
                   &check->walls[check->wall_count]))
        return;
    check->wall_hits += check->wall.sums.hits;
    check->wall_count++;
}

int cairn_scanner_check_add_walls(cairn_scanner_check *check, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(check->at.walls);
    check->wall.limit = check->wall_count + check->params.max_walls;
    for (check->wall.segment = 0; check->wall.segment < check->matching.view.segment_count &&
                                  check->wall_count < check->wall.limit;
         check->wall.segment++) {
        CAIRN_STEP_CHARGE(check, at.walls, budget, UNITS_PER_SEGMENT);
        if (!is_wall(&check->matching.view.segments[check->wall.segment]))
            continue;
        memset(&check->wall.sums, 0, sizeof check->wall.sums);
        for (check->wall.beam = 0; check->wall.beam < check->matching.view.beam_count;
             check->wall.beam += BEAMS_PER_CHARGE) {
            CAIRN_STEP_CHARGE(check, at.walls, budget, UNITS_PER_CHARGE);
            add_hits(check);
        }
        CAIRN_STEP_CHARGE(check, at.walls, budget, UNITS_PER_WALL);
        take_wall(check);
    }
    CAIRN_STEP_END(check->at.walls);
}

/* ---- Solution ---- */

/* Returns the robust weight of a wall from its deviation in the direction of the angle step, after
 * the solution x. */
static cairn_real weight_of(const scanner_check_wall *wall, const cairn_real *x)
{
    /* row of the step in the lower triangle */
    const cairn_real row[SCANNER_CHECK_WALL_UNKNOWNS] = {wall->a[0], wall->a[1], wall->a[3]};
    cairn_real left = wall->b[WALL_STEP], z;

    for (int k = 0; k < SCANNER_CHECK_WALL_UNKNOWNS; k++)
        left -= row[k] * x[k];
    z = row[WALL_STEP] > 0 ? left / cairn_sqrt(row[WALL_STEP]) / CAUCHY_SCALE : 0;
    return cairn_registration_cauchy(z * z, 1);
}

static void clear_sums(cairn_scanner_check *check)
{
    const cairn_real expected[SCANNER_CHECK_WALL_UNKNOWNS] = {0, 0, 0},
                     prior[SCANNER_CHECK_WALL_UNKNOWNS] = {
                         [WALL_STEP] = 1 / (STEP_SIGMA * STEP_SIGMA),
                         [WALL_OFFSET] = 1 / (OFFSET_SIGMA_M * OFFSET_SIGMA_M),
                         [WALL_SWEEP] = 1 / (SWEEP_SIGMA_S * SWEEP_SIGMA_S)};

    cairn_scanner_check_clear(&check->fit.sums, SCANNER_CHECK_WALL_UNKNOWNS, prior, expected);
}

/* Adds a wall to the sums; in the first round all count alike. */
static void add_wall(cairn_scanner_check *check, const scanner_check_wall *wall)
{
    cairn_scanner_check_add(&check->fit.sums, wall->block,
                            check->fit.round == 0 ? 1 : weight_of(wall, check->fit.solution.x),
                            wall->a, wall->b);
}

int cairn_scanner_check_bend(cairn_scanner_check *check, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(check->at.bend);
    for (check->fit.round = 0; check->fit.round < REWEIGHT_ROUNDS; check->fit.round++) {
        clear_sums(check);
        for (check->cursor = 0; check->cursor < check->wall_count; check->cursor++) {
            CAIRN_STEP_CHARGE_UNIT(check, at.bend, budget);
            add_wall(check, &check->walls[check->cursor]);
        }
        CAIRN_STEP_CHARGE(check, at.bend, budget, UNITS_PER_SOLUTION);
        check->fit.is_solved = cairn_scanner_check_solve(&check->fit.sums, &check->fit.solution);
        if (!check->fit.is_solved)
            break;
    }
    CAIRN_STEP_END(check->at.bend);
}
