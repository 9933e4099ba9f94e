/* The first pieces of a fit: cells of the quadtree (octree) that the Morton order spells, from
 * coarse to fine, the first on each branch in which all but a few points lie in a band.
 *
 * Cells are runs of the sorted points, and the next cell follows from the codes at its border:
 * there is no stack and no tree. A wall that falls into cells with too few points each is found
 * in one of two later rounds, in which the points that no piece claims are listed again in cells
 * shifted by a third (Chan 1998: two points that are near each other share a small cell of one
 * of three such trees). A cell is fitted three times, the last twice to the points in the band
 * alone, so that clutter does not turn it. */
#include "src/core/build.h"

#include <string.h>

#include "src/core/polyline_work.h"

/* The cell of the i-th listed point at a level: 0 is all, POLYLINE_LEVELS the smallest. */
static uint64_t cell_of(const cairn_polyline *x, int32_t i, int32_t level)
{
    return x->key[x->order[i]] >> (x->params.dim * (POLYLINE_LEVELS - level));
}

/* Stage 1: finds the end of the cell that starts at `first`, and sums its points. */
static int sum_cell(cairn_polyline *x, cairn_budget *budget)
{
    cairn_real local[3];

    for (; x->last < x->count && cell_of(x, x->last, x->level) == cell_of(x, x->first, x->level);
         x->last++) {
        if (!polyline_pay_four(x, budget, x->last - x->first, x->count - x->first, 9))
            return 0;
        cairn_polyline_local(&x->made, x->params.dim, x->point[x->order[x->last]], local);
        cairn_polyline_sum(&x->sum, local, 1);
    }
    return 1;
}

/* Stages 2, 3 and 4: fits the line to the last sums, then sums the points in the band about it. */
static int fit_band(cairn_polyline *x, cairn_budget *budget)
{
    cairn_real local[3];

    if (x->other == x->first) {
        if (!polyline_pay(x, budget, x->params.dim == 2 ? 32 : 64))
            return 0;
        x->least = POLYLINE_CLAIM * x->sigma;
        if (x->stage == 2) /* far points may have turned the first line */
            x->least += cairn_sqrt(cairn_polyline_residual(&x->sum) / x->sum.n);
        cairn_polyline_fit(&x->made, &x->sum, x->params.dim);
        memset(&x->sum, 0, sizeof x->sum);
        x->made.low = CAIRN_REAL_MAX;
        x->made.high = -CAIRN_REAL_MAX;
    }
    for (; x->other < x->last; x->other++) {
        if (x->other > x->first &&
            !polyline_pay_four(x, budget, x->other - x->first, x->last - x->first, 8))
            return 0;
        cairn_polyline_local(&x->made, x->params.dim, x->point[x->order[x->other]], local);
        if (local[1] * local[1] + local[2] * local[2] > x->least * x->least)
            continue;
        cairn_polyline_sum(&x->sum, local, 1);
        x->made.low = cairn_min(x->made.low, local[0]);
        x->made.high = cairn_max(x->made.high, local[0]);
    }
    x->other = x->first;
    return 1;
}

/* 1 when the line of the band may stand for the cell. Fewer points outside than make a segment:
 * none is passed over. */
static int is_line(const cairn_polyline *x)
{
    int32_t count = x->last - x->first, inside = cairn_real_to_int(x->sum.n);

    return x->stage == 5 && count - inside < x->params.min_points && 4 * (count - inside) <= count;
}

static void next_cell(cairn_polyline *x)
{
    x->at = x->last;
    x->level = 0;
    while (x->at < x->count && cell_of(x, x->at, x->level) == cell_of(x, x->at - 1, x->level))
        x->level++;
    x->stage = 0;
}

int cairn_polyline_initial(cairn_polyline *x, cairn_budget *budget)
{
    if (x->at < x->base)
        x->at = x->base;
    while (x->at < x->count) {
        cairn_real side = x->cell * (cairn_real)(INT32_C(1) << (POLYLINE_LEVELS - x->level));

        if (x->stage == 0) {
            memset(&x->made, 0, sizeof x->made);
            memset(&x->sum, 0, sizeof x->sum);
            for (int j = 0; j < 3; j++) {
                x->made.mid[j] = x->point[x->order[x->at]][j];
                x->made.axis[j][j] = 1;
            }
            x->first = x->last = x->other = x->at;
            x->stage = 1;
        }
        if (x->stage == 1) {
            if (!sum_cell(x, budget))
                return 0;
            if (x->last - x->first < x->params.min_points || side < 2 * POLYLINE_CLAIM * x->sigma) {
                next_cell(x);
                continue;
            }
            x->stage = 2;
        }
        while (x->stage < 5 &&
               (x->other > x->first || x->sum.n >= (cairn_real)x->params.min_points)) {
            if (!fit_band(x, budget))
                return 0;
            x->stage++;
        }
        if (is_line(x)) {
            if (!polyline_pay(x, budget, 8))
                return 0;
            x->made.reach_low = x->made.reach_high = x->params.gap;
            x->made.count = cairn_real_to_int(x->sum.n);
            cairn_polyline_keep(x, x->pieces, &x->piece_count, &x->made);
        } else if (x->level < POLYLINE_LEVELS) {
            x->level++;
            x->stage = 0;
            continue;
        }
        next_cell(x);
    }
    return 1;
}
