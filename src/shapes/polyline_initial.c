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

/* Cell of the i-th listed point at a level; level 0 is the whole extent, POLYLINE_MORTON_BITS the
 * smallest cells. */
static uint64_t cell_of(const cairn_polyline *polyline, int32_t i, int32_t level)
{
    return polyline->morton[polyline->order[i]] >>
           (polyline->params.dim * (POLYLINE_MORTON_BITS - level));
}

/* Stage 1: finds the end (last) of the cell that starts at `first`, and sums its points. */
static int sum_cell(cairn_polyline *polyline, cairn_budget *budget)
{
    cairn_real local[3];

    for (; polyline->last < polyline->point_count &&
           cell_of(polyline, polyline->last, polyline->level) ==
               cell_of(polyline, polyline->first, polyline->level);
         polyline->last++) {
        if (!polyline_charge_four(polyline, budget, polyline->last - polyline->first,
                                  polyline->point_count - polyline->first, 9))
            return 0;
        cairn_polyline_to_local(&polyline->made_component, polyline->params.dim,
                                polyline->points[polyline->order[polyline->last]], local);
        cairn_polyline_add_point(&polyline->sums, local, 1);
    }
    return 1;
}

/* Stages 2, 3 and 4: fits the line to the last moments, then sums the points in the band around the
 * line. other: point. */
static int fit_band(cairn_polyline *polyline, cairn_budget *budget)
{
    cairn_real local[3];

    if (polyline->other == polyline->first) {
        if (!polyline_charge(polyline, budget, polyline->params.dim == 2 ? 32 : 64))
            return 0;
        polyline->limit = POLYLINE_GATE * polyline->sigma;
        if (polyline->stage == 2) /* outliers may have rotated the first line */
            polyline->limit +=
                cairn_sqrt(cairn_polyline_residual(&polyline->sums) / polyline->sums.weight);
        cairn_polyline_fit(&polyline->made_component, &polyline->sums, polyline->params.dim);
        memset(&polyline->sums, 0, sizeof polyline->sums);
        polyline->made_component.low = CAIRN_REAL_MAX;
        polyline->made_component.high = -CAIRN_REAL_MAX;
    }
    for (; polyline->other < polyline->last; polyline->other++) {
        if (polyline->other > polyline->first &&
            !polyline_charge_four(polyline, budget, polyline->other - polyline->first,
                                  polyline->last - polyline->first, 8))
            return 0;
        cairn_polyline_to_local(&polyline->made_component, polyline->params.dim,
                                polyline->points[polyline->order[polyline->other]], local);
        if (local[1] * local[1] + local[2] * local[2] > polyline->limit * polyline->limit)
            continue;
        cairn_polyline_add_point(&polyline->sums, local, 1);
        polyline->made_component.low = cairn_min(polyline->made_component.low, local[0]);
        polyline->made_component.high = cairn_max(polyline->made_component.high, local[0]);
    }
    polyline->other = polyline->first;
    return 1;
}

/* 1 when the line becomes a component: fewer points outside the band than min_points, so no segment
 * is missed, and at most a quarter of the points. */
static int is_line(const cairn_polyline *polyline)
{
    int32_t count = polyline->last - polyline->first,
            inside = cairn_real_to_int(polyline->sums.weight);

    return polyline->stage == 5 && count - inside < polyline->params.min_points &&
           4 * (count - inside) <= count;
}

/* Starts the next cell, at the coarsest level that begins there. */
static void next_cell(cairn_polyline *polyline)
{
    polyline->cursor = polyline->last;
    polyline->level = 0;
    while (polyline->cursor < polyline->point_count &&
           cell_of(polyline, polyline->cursor, polyline->level) ==
               cell_of(polyline, polyline->cursor - 1, polyline->level))
        polyline->level++;
    polyline->stage = 0;
}

/* Phase INITIAL. cursor: first point of the cell, level: its level. */
int cairn_polyline_initial(cairn_polyline *polyline, cairn_budget *budget)
{
    if (polyline->cursor < polyline->list_start)
        polyline->cursor = polyline->list_start;
    while (polyline->cursor < polyline->point_count) {
        cairn_real side = polyline->cell_size *
                          (cairn_real)(INT32_C(1) << (POLYLINE_MORTON_BITS - polyline->level));

        if (polyline->stage == 0) {
            memset(&polyline->made_component, 0, sizeof polyline->made_component);
            memset(&polyline->sums, 0, sizeof polyline->sums);
            for (int j = 0; j < 3; j++) {
                polyline->made_component.mid[j] =
                    polyline->points[polyline->order[polyline->cursor]][j];
                polyline->made_component.axis[j][j] = 1;
            }
            polyline->first = polyline->last = polyline->other = polyline->cursor;
            polyline->stage = 1;
        }
        if (polyline->stage == 1) {
            if (!sum_cell(polyline, budget))
                return 0;
            if (polyline->last - polyline->first < polyline->params.min_points ||
                side < 2 * POLYLINE_GATE * polyline->sigma) {
                next_cell(polyline);
                continue;
            }
            polyline->stage = 2;
        }
        while (polyline->stage < 5 &&
               (polyline->other > polyline->first ||
                polyline->sums.weight >= (cairn_real)polyline->params.min_points)) {
            if (!fit_band(polyline, budget))
                return 0;
            polyline->stage++;
        }
        if (is_line(polyline)) {
            if (!polyline_charge(polyline, budget, 8))
                return 0;
            polyline->made_component.reach_low = polyline->made_component.reach_high =
                polyline->params.gap;
            polyline->made_component.count = cairn_real_to_int(polyline->sums.weight);
            cairn_polyline_insert(polyline, polyline->components, &polyline->component_count,
                                  &polyline->made_component);
        } else if (polyline->level < POLYLINE_MORTON_BITS) {
            polyline->level++;
            polyline->stage = 0;
            continue;
        }
        next_cell(polyline);
    }
    return 1;
}
