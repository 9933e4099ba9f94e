/* Merging: two pieces become one when a single line does nearly as well for the points of both.
 *
 * The sums of squares of both together follow from those of each and their means, in the frame of the longer one, where
 * what matters is small. The test is the same as that for cuts, at half the price, so that no pair is cut and joined by
 * turns. A pass over all pairs is repeated until it joins none. */
#include "src/core/build.h"

#include <string.h>

#include "src/core/polyline_work.h"

static int boxes_meet(const piece *a, const piece *b, cairn_real by)
{
    for (int j = 0; j < 3; j++)
        if (a->box_min[j] > b->box_max[j] + by || b->box_min[j] > a->box_max[j] + by)
            return 0;
    return 1;
}

/* Own points of `light` added to those of `heavy`, as sums in the frame of heavy. */
static sums sums_of_both(const piece *heavy, const piece *light, const cairn_real along[3], const cairn_real mean[3])
{
    cairn_real n1 = (cairn_real)heavy->count, n2 = (cairn_real)light->count;
    cairn_real across = cairn_max(1 - along[0] * along[0], 0);
    sums both = {0, {0, 0, 0}, {0, 0, 0, 0, 0, 0}};

    cairn_polyline_sum(&both, heavy->own, n1);
    cairn_polyline_sum(&both, mean, n2);
    both.vv.xx += heavy->tt + light->tt * along[0] * along[0];
    both.vv.xy += light->tt * along[0] * along[1];
    both.vv.xz += light->tt * along[0] * along[2];
    both.vv.yy += heavy->sse + light->sse + light->tt * across;
    return both;
}

/* Joins b to a when one line does for both; b is then left empty. */
static int join(cairn_polyline *x, piece *a, piece *b)
{
    const cairn_polyline_params *p = &x->params;
    const piece *heavy = b->tt > a->tt ? b : a, *light = heavy == a ? b : a;
    piece both = *heavy;
    cairn_real along[3] = {0, 0, 0}, mean[3], end[2][3], local[2][3], world[3], gap, n, reach, saved;
    int32_t near, far;
    sums m;

    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            along[i] += heavy->axis[i][j] * light->axis[0][j];
    if (cairn_abs(along[0]) < x->merge_cosine)
        return 0;
    for (int which = 0; which < 2; which++) {
        cairn_polyline_end(light, which, end[which]);
        piece_local(heavy, x->params.dim, end[which], local[which]);
        if (local[which][1] * local[which][1] + local[which][2] * local[which][2] >
            p->merge_distance * p->merge_distance)
            return 0;
    }
    near = local[1][0] < local[0][0]; /* the end of light that is lower on heavy */
    far = !near;
    if (local[near][0] + local[far][0] > heavy->low + heavy->high) {
        gap = local[near][0] - heavy->high;
        reach = cairn_min(heavy->reach_high, near == 0 ? light->reach_low : light->reach_high);
    } else {
        gap = heavy->low - local[far][0];
        reach = cairn_min(heavy->reach_low, far == 0 ? light->reach_low : light->reach_high);
    }
    if (gap > reach)
        return 0;
    for (int i = 0; i < 3; i++)
        world[i] = light->mid[i] + light->own[0] * light->axis[0][i] + light->own[1] * light->axis[1][i] +
                   light->own[2] * light->axis[2][i];
    piece_local(heavy, x->params.dim, world, mean);
    m = sums_of_both(heavy, light, along, mean);
    n = m.n;
    saved = cairn_polyline_residual(&m) - heavy->sse - light->sse;
    if (saved > cairn_polyline_worth(x, n, heavy->sse + light->sse) / 2)
        return 0;
    if (local[near][0] < heavy->low) {
        both.low = local[near][0];
        both.reach_low = near == 0 ? light->reach_low : light->reach_high;
    }
    if (local[far][0] > heavy->high) {
        both.high = local[far][0];
        both.reach_high = far == 0 ? light->reach_low : light->reach_high;
    }
    cairn_polyline_fit_own(&both, &m, p->dim);
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
                piece *a = &x->next[x->at], *b = &x->next[x->other];
                int meet;

                if (!pay(x, budget, 2))
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
