/* Merging: two pieces become one when a single line does nearly as well for the points of both.
 *
 * The sums of squares of both together follow from those of each and their means, in the frame
 * of the longer one, where what matters is small. A cut must save half as much again as would
 * forbid joining, so that no pair is cut and joined by turns. A pass over all pairs is repeated
 * until it joins none. */
#include "src/core/build.h"

#include <string.h>

#include "src/core/polyline_work.h"

static int boxes_meet(const polyline_piece *a, const polyline_piece *b, cairn_real by)
{
    for (int j = 0; j < 3; j++)
        if (a->box_min[j] > b->box_max[j] + by || b->box_min[j] > a->box_max[j] + by)
            return 0;
    return 1;
}

/* Own points of `light` added to those of `heavy`, as sums in the frame of heavy. */
static polyline_sums sums_of_both(const polyline_piece *heavy, const polyline_piece *light,
                                  const cairn_real along[3], const cairn_real mean[3])
{
    cairn_real n1 = (cairn_real)heavy->count, n2 = (cairn_real)light->count;
    cairn_real across = cairn_max(1 - along[0] * along[0], 0);
    polyline_sums both = {0, {0, 0, 0}, {0, 0, 0, 0, 0, 0}};

    cairn_polyline_sum(&both, heavy->own, n1);
    cairn_polyline_sum(&both, mean, n2);
    both.vv.xx += heavy->tt + light->tt * along[0] * along[0];
    both.vv.xy += light->tt * along[0] * along[1];
    both.vv.xz += light->tt * along[0] * along[2];
    both.vv.yy += heavy->sse + light->sse + light->tt * across;
    return both;
}

/* Ends of a piece in the frame of another, the lower one there first, and how far beyond them it
 * reaches. */
typedef struct ends {
    cairn_real lower[3], upper[3];
    cairn_real reach_lower, reach_upper;
    cairn_real across; /* square of the larger distance from the other's line */
} ends;

static ends ends_in(const cairn_polyline *x, const polyline_piece *heavy,
                    const polyline_piece *light)
{
    ends e = {{0, 0, 0}, {0, 0, 0}, light->reach_low, light->reach_high, 0};
    cairn_real low[3], high[3], local[2][3];

    cairn_polyline_place(light, light->low, low);
    cairn_polyline_place(light, light->high, high);
    cairn_polyline_local(heavy, x->params.dim, low, local[0]);
    cairn_polyline_local(heavy, x->params.dim, high, local[1]);
    if (local[1][0] < local[0][0]) {
        e.reach_lower = light->reach_high;
        e.reach_upper = light->reach_low;
    }
    for (int j = 0; j < 3; j++) {
        e.lower[j] = local[local[1][0] < local[0][0]][j];
        e.upper[j] = local[!(local[1][0] < local[0][0])][j];
    }
    e.across = cairn_max(local[0][1] * local[0][1] + local[0][2] * local[0][2],
                         local[1][1] * local[1][1] + local[1][2] * local[1][2]);
    return e;
}

/* 1 when the hole between two pieces, if there is one, is no longer than both reach. */
static int adjoin(const polyline_piece *heavy, const ends *e)
{
    if (e->lower[0] > heavy->high)
        return e->lower[0] - heavy->high <= cairn_min(heavy->reach_high, e->reach_lower);
    if (e->upper[0] < heavy->low)
        return heavy->low - e->upper[0] <= cairn_min(heavy->reach_low, e->reach_upper);
    return 1;
}

/* Joins b to a when one line does for both; b is then left empty. */
static int join(cairn_polyline *x, polyline_piece *a, polyline_piece *b)
{
    const polyline_piece *heavy = b->tt > a->tt ? b : a, *light = heavy == a ? b : a;
    polyline_piece both = *heavy;
    cairn_real along[3] = {0, 0, 0}, mean[3], world[3], saved;
    int within;
    polyline_sums m;
    ends e;

    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            along[i] += heavy->axis[i][j] * light->axis[0][j];
    if (cairn_abs(along[0]) < x->merge_cosine)
        return 0;
    e = ends_in(x, heavy, light);
    if (e.across > x->params.merge_distance * x->params.merge_distance || !adjoin(heavy, &e))
        return 0;
    for (int i = 0; i < 3; i++)
        world[i] = light->mid[i] + light->own[0] * light->axis[0][i] +
                   light->own[1] * light->axis[1][i] + light->own[2] * light->axis[2][i];
    cairn_polyline_local(heavy, x->params.dim, world, mean);
    m = sums_of_both(heavy, light, along, mean);
    saved = cairn_polyline_residual(&m) - heavy->sse - light->sse;
    /* Of two pieces that lie in each other's noise, each has taken the points on its side: their
     * sums say nothing. */
    within =
        e.lower[0] > heavy->low && e.upper[0] < heavy->high && e.across < x->s_last * x->s_last;
    if (!within && saved > cairn_polyline_worth(x, m.n, heavy->sse + light->sse))
        return 0;
    if (e.lower[0] < heavy->low) {
        both.low = e.lower[0];
        both.reach_low = e.reach_lower;
    }
    if (e.upper[0] > heavy->high) {
        both.high = e.upper[0];
        both.reach_high = e.reach_upper;
    }
    cairn_polyline_fit_own(&both, &m, x->params.dim);
    cairn_polyline_box(&both);
    *a = both;
    b->count = 0;
    return 1;
}

/* `at` and `other` are the pair at hand, stage 1: this pass joined a pair. */
int cairn_polyline_merge(cairn_polyline *x, cairn_budget *budget)
{
    do {
        if (x->at == 0 && x->other == 0)
            x->stage = 0;
        for (; x->at < x->next_count; x->at++, x->other = 0) {
            if (x->other <= x->at)
                x->other = x->at + 1;
            for (; x->next[x->at].count > 0 && x->other < x->next_count; x->other++) {
                polyline_piece *a = &x->next[x->at], *b = &x->next[x->other];
                int meet;

                if (!polyline_pay(x, budget, 2))
                    return 0;
                meet = b->count > 0 && boxes_meet(a, b, x->params.merge_distance);
                if (meet)
                    x->part += 24;
                if (meet && join(x, a, b)) {
                    x->measure.merges++;
                    x->changed = 1;
                    x->stage = 1;
                }
            }
        }
        x->at = x->other = 0;
    } while (x->stage != 0);
    return 1;
}
