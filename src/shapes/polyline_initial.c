/* Initial components of a fit, by a coarse-to-fine search in the quadtree (octree) of the Morton
 * order.
 *
 * Method:
 * 1. Cells are runs of the sorted points. The next cell follows from the codes at the border of the
 *    last one, so neither a stack nor a tree is needed. On each branch the first cell whose points,
 *    except a few, lie in a band becomes a component.
 * 2. A cell is fitted three times, the last two times to the points in the band only, so clutter
 *    does not rotate the line.
 * 3. A wall whose cells have too few points each is found in one of two later rounds. These search
 *    the outliers in cells shifted by a third. Two points that are close to each other share a
 *    small cell of one of three such trees (Chan 1998).
 *
 * Source: Chan 1998 (shifted quadtrees). */
#include "src/base/build.h"

#include <string.h>

#include "src/shapes/polyline_work.h"

/* Fits of a cell. */
#define FITS_PER_CELL 3

/* Cell of the i-th listed point at a level; level 0 is the whole extent, POLYLINE_MORTON_BITS the
 * smallest cells. */
static uint64_t cell_of(const cairn_polyline *polyline, int32_t i, int32_t level)
{
    return polyline->morton[polyline->order[i]] >>
           (polyline->params.dim * (POLYLINE_MORTON_BITS - level));
}

/* Starts the cell at the current point and level, without points. */
static void start_cell(cairn_polyline *polyline)
{
    memset(&polyline->made_component, 0, sizeof polyline->made_component);
    memset(&polyline->sums, 0, sizeof polyline->sums);
    for (int j = 0; j < 3; j++) {
        polyline->made_component.mid[j] = polyline->points[polyline->order[polyline->first]][j];
        polyline->made_component.axis[j][j] = 1;
    }
    polyline->last = polyline->first;
}

/* 1 when the next point is in the cell, too. */
static int cell_continues(const cairn_polyline *polyline)
{
    return polyline->last < polyline->point_count &&
           cell_of(polyline, polyline->last, polyline->level) ==
               cell_of(polyline, polyline->first, polyline->level);
}

/* 1 when the cell has the points of a segment, and is wider than its band. */
static int may_hold_line(const cairn_polyline *polyline)
{
    cairn_real side =
        polyline->cell_size * (cairn_real)(INT32_C(1) << (POLYLINE_MORTON_BITS - polyline->level));

    return polyline->last - polyline->first >= polyline->params.min_points &&
           !(side < 2 * POLYLINE_GATE * polyline->sigma);
}

/* Adds a point of the cell to the moments. */
static void add_point(cairn_polyline *polyline, int32_t i)
{
    cairn_real local[3];

    cairn_polyline_to_local(&polyline->made_component, polyline->params.dim,
                            polyline->points[polyline->order[i]], local);
    cairn_polyline_add_point(&polyline->sums, local, 1);
}

/* Fits the line to the moments, and starts those of the points in the band around it. The first
 * band is wider, since outliers may have rotated its line. */
static void fit_line(cairn_polyline *polyline)
{
    polyline->limit = POLYLINE_GATE * polyline->sigma;
    if (polyline->pass == 0)
        polyline->limit +=
            cairn_sqrt(cairn_polyline_residual(&polyline->sums) / polyline->sums.weight);
    cairn_polyline_fit(&polyline->made_component, &polyline->sums, polyline->params.dim);
    memset(&polyline->sums, 0, sizeof polyline->sums);
    polyline->made_component.low = CAIRN_REAL_MAX;
    polyline->made_component.high = -CAIRN_REAL_MAX;
}

/* Adds a point of the cell, if it lies in the band, to the moments and to the extent. */
static void add_point_in_band(cairn_polyline *polyline, int32_t i)
{
    cairn_real local[3];

    cairn_polyline_to_local(&polyline->made_component, polyline->params.dim,
                            polyline->points[polyline->order[i]], local);
    if (local[1] * local[1] + local[2] * local[2] > polyline->limit * polyline->limit)
        return;
    cairn_polyline_add_point(&polyline->sums, local, 1);
    polyline->made_component.low = cairn_min(polyline->made_component.low, local[0]);
    polyline->made_component.high = cairn_max(polyline->made_component.high, local[0]);
}

/* 1 when the line becomes a component: fewer points outside the band than min_points, so no segment
 * is missed, and at most a quarter of the points. */
static int is_line(const cairn_polyline *polyline)
{
    int32_t count = polyline->last - polyline->first,
            inside = cairn_real_to_int(polyline->sums.weight);

    return polyline->pass == FITS_PER_CELL && count - inside < polyline->params.min_points &&
           4 * (count - inside) <= count;
}

/* The line becomes a component. */
static void insert_line(cairn_polyline *polyline)
{
    polyline->made_component.reach_low = polyline->made_component.reach_high = polyline->params.gap;
    polyline->made_component.count = cairn_real_to_int(polyline->sums.weight);
    cairn_polyline_insert(polyline, polyline->components, &polyline->component_count,
                          &polyline->made_component);
}

/* Continues behind the cell, at the coarsest level that begins there. */
static void leave_cell(cairn_polyline *polyline)
{
    polyline->first = polyline->last;
    polyline->level = 0;
    while (polyline->first < polyline->point_count &&
           cell_of(polyline, polyline->first, polyline->level) ==
               cell_of(polyline, polyline->first - 1, polyline->level))
        polyline->level++;
}

int cairn_polyline_initial(cairn_polyline *polyline, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(polyline->phase_resume);
    polyline->level = 0;
    polyline->first = polyline->list_start;
    while (polyline->first < polyline->point_count) {
        for (start_cell(polyline); cell_continues(polyline); polyline->last++) {
            CAIRN_STEP_CHARGE_EIGHTHS_EVERY(polyline, phase_resume, budget, POLYLINE_GROUP,
                                            polyline->last - polyline->first,
                                            polyline->point_count - polyline->first, 9);
            add_point(polyline, polyline->last);
        }
        if (!may_hold_line(polyline)) {
            leave_cell(polyline);
            continue;
        }
        for (polyline->pass = 0; polyline->pass < FITS_PER_CELL &&
                                 polyline->sums.weight >= (cairn_real)polyline->params.min_points;
             polyline->pass++) {
            /* The fit, and the first four points. */
            CAIRN_STEP_CHARGE_EIGHTHS(polyline, phase_resume, budget,
                                      polyline->params.dim == 2 ? 32 : 64);
            fit_line(polyline);
            for (polyline->cursor = polyline->first; polyline->cursor < polyline->last;
                 polyline->cursor++) {
                if (polyline->cursor > polyline->first) {
                    CAIRN_STEP_CHARGE_EIGHTHS_EVERY(polyline, phase_resume, budget, POLYLINE_GROUP,
                                                    polyline->cursor - polyline->first,
                                                    polyline->last - polyline->first, 8);
                }
                add_point_in_band(polyline, polyline->cursor);
            }
        }
        if (is_line(polyline)) {
            CAIRN_STEP_CHARGE_EIGHTHS(
                polyline, phase_resume, budget,
                8 + polyline_search_eighths(polyline, polyline->component_count, 1));
            insert_line(polyline);
            leave_cell(polyline);
        } else if (polyline->level < POLYLINE_MORTON_BITS) {
            polyline->level++;
        } else {
            leave_cell(polyline);
        }
    }
    CAIRN_STEP_END(polyline->phase_resume);
}
