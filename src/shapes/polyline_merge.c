/* Merging of collinear components.
 *
 * Method: two components are merged when a single line fits the points of both nearly as well
 * (model selection). The moments of both together follow from those of each and their means, in the
 * frame of the longer one, where the residuals are small numbers. A split must reduce the sum of
 * squares by half as much again as the limit of merging, so no pair is split and merged
 * alternately. Passes over all pairs are repeated until none is merged. */
#include "src/base/build.h"

#include <string.h>

#include "src/shapes/polyline_work.h"

/* 1 when the bounding boxes of two components overlap within a margin, in m. */
static int boxes_overlap(const polyline_component *a, const polyline_component *b,
                         cairn_real margin)
{
    for (int j = 0; j < 3; j++)
        if (a->box_min[j] > b->box_max[j] + margin || b->box_min[j] > a->box_max[j] + margin)
            return 0;
    return 1;
}

/* Moments of the own points of both components in the frame of `heavy`. along, mean: direction and
 * mean of `light` in that frame. */
static polyline_sums sums_of_both(const polyline_component *heavy, const polyline_component *light,
                                  const cairn_real along[3], const cairn_real mean[3])
{
    cairn_real n1 = (cairn_real)heavy->count, n2 = (cairn_real)light->count;
    cairn_real across = cairn_max(1 - along[0] * along[0], 0);
    polyline_sums both = {0, {0, 0, 0}, {0, 0, 0, 0, 0, 0}};

    cairn_polyline_add_point(&both, heavy->own_mean, n1);
    cairn_polyline_add_point(&both, mean, n2);
    both.vv.xx += heavy->tt + light->tt * along[0] * along[0];
    both.vv.xy += light->tt * along[0] * along[1];
    both.vv.xz += light->tt * along[0] * along[2];
    both.vv.yy += heavy->sse + light->sse + light->tt * across;
    return both;
}

/* Ends of a component in the frame of another one, in ascending order there, in m. */
typedef struct component_ends {
    cairn_real lower[3], upper[3];
    /* Reaches beyond these ends. */
    cairn_real reach_lower, reach_upper;
    /* Square of the larger distance of both ends from the line of the other component, in m^2. */
    cairn_real across;
} component_ends;

/* Ends of `light` in the frame of `heavy`. */
static component_ends ends_in(const cairn_polyline *polyline, const polyline_component *heavy,
                              const polyline_component *light)
{
    component_ends ends = {{0, 0, 0}, {0, 0, 0}, light->reach_low, light->reach_high, 0};
    cairn_real low[3], high[3], local[2][3];

    cairn_polyline_point_at(light, light->low, low);
    cairn_polyline_point_at(light, light->high, high);
    cairn_polyline_to_local(heavy, polyline->params.dim, low, local[0]);
    cairn_polyline_to_local(heavy, polyline->params.dim, high, local[1]);
    if (local[1][0] < local[0][0]) {
        ends.reach_lower = light->reach_high;
        ends.reach_upper = light->reach_low;
    }
    for (int j = 0; j < 3; j++) {
        ends.lower[j] = local[local[1][0] < local[0][0]][j];
        ends.upper[j] = local[!(local[1][0] < local[0][0])][j];
    }
    ends.across = cairn_max(local[0][1] * local[0][1] + local[0][2] * local[0][2],
                            local[1][1] * local[1][1] + local[1][2] * local[1][2]);
    return ends;
}

/* 1 when the gap between two components, if any, is within the reaches of both. */
static int is_gap_bridged(const polyline_component *heavy, const component_ends *ends)
{
    if (ends->lower[0] > heavy->high)
        return ends->lower[0] - heavy->high <= cairn_min(heavy->reach_high, ends->reach_lower);
    if (ends->upper[0] < heavy->low)
        return heavy->low - ends->upper[0] <= cairn_min(heavy->reach_low, ends->reach_upper);
    return 1;
}

/* Merges b into a when one line fits both. Returns 1 with b empty, else 0. */
static int merge_pair(cairn_polyline *polyline, polyline_component *a, polyline_component *b)
{
    const polyline_component *heavy = b->tt > a->tt ? b : a, *light = heavy == a ? b : a;
    polyline_component both = *heavy;
    cairn_real along[3] = {0, 0, 0}, mean[3], world[3], increase;
    int within;
    polyline_sums sums;
    component_ends ends;

    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            along[i] += heavy->axis[i][j] * light->axis[0][j];
    if (cairn_abs(along[0]) < polyline->merge_cosine)
        return 0;
    ends = ends_in(polyline, heavy, light);
    if (ends.across > polyline->params.merge_distance * polyline->params.merge_distance ||
        !is_gap_bridged(heavy, &ends))
        return 0;
    for (int i = 0; i < 3; i++)
        world[i] = light->mid[i] + light->own_mean[0] * light->axis[0][i] +
                   light->own_mean[1] * light->axis[1][i] + light->own_mean[2] * light->axis[2][i];
    cairn_polyline_to_local(heavy, polyline->params.dim, world, mean);
    sums = sums_of_both(heavy, light, along, mean);
    increase = cairn_polyline_residual(&sums) - heavy->sse - light->sse;
    /* Components within each other's noise have divided the points by side, so their sums of
     * squares are not meaningful. */
    within = ends.lower[0] > heavy->low && ends.upper[0] < heavy->high &&
             ends.across < polyline->width_last * polyline->width_last;
    if (!within &&
        increase > cairn_polyline_split_penalty(polyline, sums.weight, heavy->sse + light->sse))
        return 0;
    if (ends.lower[0] < heavy->low) {
        both.low = ends.lower[0];
        both.reach_low = ends.reach_lower;
    }
    if (ends.upper[0] > heavy->high) {
        both.high = ends.upper[0];
        both.reach_high = ends.reach_upper;
    }
    cairn_polyline_fit_own(&both, &sums, polyline->params.dim);
    cairn_polyline_box(&both);
    *a = both;
    b->count = 0;
    return 1;
}

/* 1 when one line may fit both components of the current pair. */
static int is_close_pair(const cairn_polyline *polyline)
{
    const polyline_component *a = &polyline->next[polyline->cursor],
                             *b = &polyline->next[polyline->other];

    return b->count > 0 && boxes_overlap(a, b, polyline->params.merge_distance);
}

/* Merges the current pair when one line fits both. */
static void try_pair(cairn_polyline *polyline)
{
    if (merge_pair(polyline, &polyline->next[polyline->cursor], &polyline->next[polyline->other])) {
        polyline->measure.merges++;
        polyline->has_changed = polyline->has_merged = 1;
    }
}

/* Passes over all pairs, until one merges none. */
int cairn_polyline_merge(cairn_polyline *polyline, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(polyline->phase_resume);
    do {
        polyline->has_merged = 0;
        for (polyline->cursor = 0; polyline->cursor < polyline->next_count; polyline->cursor++)
            for (polyline->other = polyline->cursor + 1;
                 polyline->next[polyline->cursor].count > 0 &&
                 polyline->other < polyline->next_count;
                 polyline->other++) {
                CAIRN_STEP_CHARGE_EIGHTHS(polyline, phase_resume, budget, 2);
                if (!is_close_pair(polyline))
                    continue;
                CAIRN_STEP_CHARGE_EIGHTHS(polyline, phase_resume, budget, 24);
                try_pair(polyline);
            }
    } while (polyline->has_merged);
    CAIRN_STEP_END(polyline->phase_resume);
}
