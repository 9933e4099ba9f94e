/* Support of the components: extent, splits at gaps and bends, and removal of components with too
 * few points.
 *
 * Method: the points are sorted by component and position. A run without a gap is summed. Then
 * every split of the run into two is tested by the sum of squared residuals of two lines. The
 * moments right of a split are those of the run minus those left of the split. */
#include "src/base/build.h"

#include <string.h>

#include "src/shapes/polyline_work.h"

/* Reduction of the sum of squares that a split needs, relative to the limit of merging. */
#define SPLIT_FACTOR CAIRN_REAL(1.5)
/* Eighths of a unit: a point that may end a run, POLYLINE_GROUP points of a sum, a split that is
 * tested, and one or two components that are made. */
enum { EIGHTHS_PER_END = 9, EIGHTHS_PER_GROUP = 8, EIGHTHS_PER_SPLIT = 21, EIGHTHS_TO_EMIT = 52 };

/* Position of the i-th sorted point along its component, in m. */
static cairn_real position_of(const cairn_polyline *polyline, int32_t i)
{
    return polyline->position[polyline->order[i]];
}

/* Largest allowed gap, in m, next to points of a spacing. */
static cairn_real reach_of(const cairn_polyline *polyline, cairn_real spacing)
{
    return cairn_min(cairn_max(polyline->params.gap, polyline->params.gap_factor * spacing),
                     polyline->params.gap_max);
}

/* Longer one of the up to two distances between the points from ... from + 2 * way within [first,
 * last), in m; -1 when there is none. */
static cairn_real spacing(const cairn_polyline *polyline, int32_t from, int32_t way, int32_t first,
                          int32_t last)
{
    cairn_real longest = -1;

    for (int32_t i = 1; i <= 2 && from + i * way >= first && from + i * way < last; i++)
        longest = cairn_max(longest, cairn_abs(position_of(polyline, from + i * way) -
                                               position_of(polyline, from + (i - 1) * way)));
    return longest;
}

/* 1 when there is a gap between points i and i + 1 of a run of points first ... last - 1: the
 * distance exceeds the reach by the spacing of the points on either side. */
static int is_gap(const cairn_polyline *polyline, int32_t i, int32_t first, int32_t last)
{
    cairn_real distance = position_of(polyline, i + 1) - position_of(polyline, i),
               reach = polyline->params.gap_max, side;

    if (distance <= polyline->params.gap)
        return 0;
    side = spacing(polyline, i, -1, first, last);
    if (side >= 0)
        reach = cairn_min(reach, reach_of(polyline, side));
    side = spacing(polyline, i + 1, 1, first, last);
    if (side >= 0)
        reach = cairn_min(reach, reach_of(polyline, side));
    return distance > reach;
}

/* Component of the i-th sorted point, -1: outlier or past the end. */
static int32_t component_at(const cairn_polyline *polyline, int32_t i)
{
    return i < polyline->point_count ? polyline->component_of[polyline->order[i]] : -1;
}

/* Makes the points first ... last - 1 of a component, with their moments, a component of the next
 * iteration. is_split: 1 when they are one side of a split. */
static void emit_component(cairn_polyline *polyline, int32_t component, int32_t first, int32_t last,
                           const polyline_sums *sums, int is_split)
{
    const polyline_component *parent = &polyline->components[component];

    polyline->made_component = *parent;
    polyline->made_component.low = position_of(polyline, first);
    polyline->made_component.high = position_of(polyline, last - 1);
    polyline->made_component.reach_low =
        reach_of(polyline, spacing(polyline, first, 1, first, last));
    polyline->made_component.reach_high =
        reach_of(polyline, spacing(polyline, last - 1, -1, first, last));
    if (is_split) {
        cairn_polyline_fit_own(&polyline->made_component, sums, polyline->params.dim);
    } else {
        /* The line of the M-step is kept; the own points give the mean and the sums of squares. */
        for (int j = 0; j < 3; j++)
            polyline->made_component.own_mean[j] = sums->v[j] / sums->weight;
        polyline->made_component.tt =
            sums->vv.xx - sums->v[0] * polyline->made_component.own_mean[0];
        polyline->made_component.sse =
            cairn_max(sums->vv.yy - sums->v[1] * polyline->made_component.own_mean[1] +
                          sums->vv.zz - sums->v[2] * polyline->made_component.own_mean[2],
                      0);
        polyline->made_component.count = last - first;
        polyline->max_end_motion =
            cairn_max(polyline->max_end_motion,
                      cairn_max(cairn_abs(polyline->made_component.low - parent->low),
                                cairn_abs(polyline->made_component.high - parent->high)));
    }
    if (is_split || polyline->next_component == component + 1) {
        polyline->measure.splits++;
        polyline->has_changed = 1;
    }
    polyline->next_component = component + 1;
    cairn_polyline_insert(polyline, polyline->next, &polyline->next_count,
                          &polyline->made_component);
}

/* Moments of the points right of a split: all minus left. */
static polyline_sums sums_right_of(const polyline_sums *all, const polyline_sums *left)
{
    polyline_sums rest = *all;

    rest.weight -= left->weight;
    for (int j = 0; j < 3; j++)
        rest.v[j] -= left->v[j];
    rest.vv.xx -= left->vv.xx;
    rest.vv.xy -= left->vv.xy;
    rest.vv.xz -= left->vv.xz;
    rest.vv.yy -= left->vv.yy;
    rest.vv.yz -= left->vv.yz;
    rest.vv.zz -= left->vv.zz;
    return rest;
}

/* Tests the split between point `cursor` and the next one. */
static void try_split(cairn_polyline *polyline)
{
    const cairn_polyline_params *params = &polyline->params;
    int32_t i = polyline->cursor;
    polyline_sums rest;
    cairn_real sse;

    if (i + 1 - polyline->first < params->min_points ||
        polyline->last - i - 1 < params->min_points ||
        position_of(polyline, i) - position_of(polyline, polyline->first) < params->min_length ||
        position_of(polyline, polyline->last - 1) - position_of(polyline, i + 1) <
            params->min_length)
        return;
    rest = sums_right_of(&polyline->sums, &polyline->left_sums);
    sse = cairn_polyline_residual(&polyline->left_sums) + cairn_polyline_residual(&rest);
    if (polyline->best_split < 0 || sse < polyline->best_sse) {
        polyline->best_split = i;
        polyline->best_sse = sse;
        polyline->best_left_sums = polyline->left_sums;
    }
}

/* 1 when the run first ... last - 1 ends there: the next point is of another component, or behind a
 * gap. */
static int is_run_end(const cairn_polyline *polyline)
{
    int32_t component = component_at(polyline, polyline->first);
    /* End of the points to the right, as many as the test of a gap needs. */
    int32_t known_end = polyline->last + 1;

    while (known_end < polyline->last + 3 && component_at(polyline, known_end) == component)
        known_end++;
    return is_gap(polyline, polyline->last - 1, polyline->first, known_end);
}

/* Adds a point of the run to moments. */
static void add_to(const cairn_polyline *polyline, polyline_sums *sums, int32_t i)
{
    cairn_real local[3];

    cairn_polyline_to_local(&polyline->components[component_at(polyline, i)], polyline->params.dim,
                            polyline->points[polyline->order[i]], local);
    cairn_polyline_add_point(sums, local, 1);
}

/* 1 when the run has the points and the length of a segment. */
static int is_segment(const cairn_polyline *polyline)
{
    return polyline->last - polyline->first >= polyline->params.min_points &&
           position_of(polyline, polyline->last - 1) - position_of(polyline, polyline->first) >=
               polyline->params.min_length;
}

/* 1 when a split reduces the sum of squares from `sse` to `split_sse` by as much as it needs. */
static int reduces_enough(const cairn_polyline *polyline, cairn_real sse, cairn_real split_sse)
{
    return sse - split_sse >
           SPLIT_FACTOR * cairn_polyline_split_penalty(polyline, polyline->sums.weight, split_sse);
}

/* Keeps the best split of the run only if it reduces the sum of squares enough. */
static void select_split(cairn_polyline *polyline)
{
    if (polyline->best_split >= 0 &&
        !reduces_enough(polyline, cairn_polyline_residual(&polyline->sums), polyline->best_sse))
        polyline->best_split = -1;
}

/* Makes the run one component, or two when it is split. */
static void emit_run(cairn_polyline *polyline)
{
    int32_t component = component_at(polyline, polyline->first), middle = polyline->best_split + 1;
    polyline_sums rest;

    if (polyline->best_split < 0) {
        emit_component(polyline, component, polyline->first, polyline->last, &polyline->sums, 0);
        return;
    }
    rest = sums_right_of(&polyline->sums, &polyline->best_left_sums);
    emit_component(polyline, component, polyline->first, middle, &polyline->best_left_sums, 1);
    emit_component(polyline, component, middle, polyline->last, &rest, 1);
}

/* See Method in the head of this file. */
int cairn_polyline_support(cairn_polyline *polyline, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(polyline->phase_resume);
    polyline->next_component = 0;
    for (polyline->first = 0; component_at(polyline, polyline->first) >= 0;
         polyline->first = polyline->last) {
        for (polyline->last = polyline->first + 1;
             component_at(polyline, polyline->last) == component_at(polyline, polyline->first);
             polyline->last++) {
            CAIRN_STEP_CHARGE_EIGHTHS(polyline, phase_resume, budget, EIGHTHS_PER_END);
            if (is_run_end(polyline))
                break;
        }
        if (!is_segment(polyline))
            continue;
        memset(&polyline->sums, 0, sizeof polyline->sums);
        for (polyline->cursor = polyline->first; polyline->cursor < polyline->last;
             polyline->cursor++) {
            CAIRN_STEP_CHARGE_EIGHTHS_EVERY(polyline, phase_resume, budget, POLYLINE_GROUP,
                                            polyline->cursor - polyline->first,
                                            polyline->last - polyline->first, EIGHTHS_PER_GROUP);
            add_to(polyline, &polyline->sums, polyline->cursor);
        }
        polyline->best_split = -1;
        memset(&polyline->left_sums, 0, sizeof polyline->left_sums);
        /* No split can reduce the sum of squares by more than the whole. */
        if (polyline->measure.iterations < polyline->params.max_iterations / 2 &&
            reduces_enough(polyline, cairn_polyline_residual(&polyline->sums), 0))
            for (polyline->cursor = polyline->first; polyline->cursor < polyline->last;
                 polyline->cursor++) {
                CAIRN_STEP_CHARGE_EIGHTHS(polyline, phase_resume, budget, EIGHTHS_PER_SPLIT);
                add_to(polyline, &polyline->left_sums, polyline->cursor);
                try_split(polyline);
            }
        select_split(polyline);
        CAIRN_STEP_CHARGE_EIGHTHS(polyline, phase_resume, budget,
                                  EIGHTHS_TO_EMIT +
                                      polyline_search_eighths(polyline, polyline->next_count,
                                                              polyline->best_split < 0 ? 1 : 2));
        emit_run(polyline);
    }
    polyline->outliers_start = polyline->first;
    CAIRN_STEP_END(polyline->phase_resume);
}
