/* Refinement of the peaks of the Hough transform to ellipses.
 *
 * Method: passes over the points for each peak
 * 1. a histogram of distances gives the radius of a circle;
 * 2. three least-squares fits of a conic, with narrowing gates;
 * 3. the inliers of the result: votes, residuals and covered arcs of the outline. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/ranked_list.h"
#include "src/shapes/ellipse_work.h"

/* Points for one work unit; further work units of an inlier of the current ellipse; work units at
 * the end of a pass. */
enum { POINTS_PER_UNIT = 2, UNITS_PER_INLIER = 2, UNITS_PER_PASS = 16 };

/* Largest distance of an inlier from the current ellipse in this pass, in m. */
static cairn_real distance_of_pass(const cairn_ellipse_set *set)
{
    static const cairn_real shares[] = {0, CAIRN_REAL(0.5), CAIRN_REAL(0.25), CAIRN_REAL(0.1), 0};

    return cairn_max(set->params.support_distance, shares[set->pass] * set->fit.half_width);
}

/* Number of arcs into which the outline is divided for the coverage. */
static int32_t arcs_of(const cairn_ellipse_set *set)
{
    cairn_real arcs =
        cairn_min(cairn_ellipse_length(&set->fit) / (2 * set->params.spacing), ELLIPSE_MAX_ARCS);

    return cairn_real_to_int(cairn_max(arcs, ELLIPSE_MIN_ARCS));
}

/* Largest sine of the angle between an inlier and the outline in this pass. */
static cairn_real sine_of_pass(const cairn_ellipse_set *set)
{
    return set->pass == ELLIPSE_PASS_COARSE ? cairn_min(2 * set->max_sine, 1) : set->max_sine;
}

/* Starts a pass over the points. */
static void start_pass(cairn_ellipse_set *set, int32_t pass)
{
    set->pass = pass;
    set->cursor = 0;
    if (pass == ELLIPSE_PASS_RADIUS) {
        memset(set->radius_histogram, 0, sizeof set->radius_histogram);
        return;
    }
    set->gate = cairn_ellipse_gate_of(&set->fit, distance_of_pass(set), sine_of_pass(set));
    if (pass == ELLIPSE_PASS_SUPPORT) {
        set->inlier_weight = set->squared_residuals = 0;
        set->arc_count = arcs_of(set);
        memset(set->arcs, 0, sizeof set->arcs);
    } else {
        set->equations = cairn_ellipse_conic_begin(&set->fit);
    }
}

/* Starts the passes of the current peak. */
static void start_peak(cairn_ellipse_set *set)
{
    const ellipse_peak *peak = &set->peaks[set->current_peak];

    memset(&set->fit, 0, sizeof set->fit);
    set->fit.kind = set->accumulator_count == 1 ? CAIRN_ELLIPSE_ANY : peak->layer;
    set->fit.centre.x = set->first_cell.x + (cairn_real)peak->column * set->cell_size;
    set->fit.centre.y = set->first_cell.y + (cairn_real)peak->row * set->cell_size;
    start_pass(set, ELLIPSE_PASS_RADIUS);
}

/* Adds a point whose normal passes close to the peak to the radius histogram. */
static void add_radius(cairn_ellipse_set *set, const cairn_oriented_point *point, cairn_real weight)
{
    cairn_vec2 to = {set->fit.centre.x - point->position.x, set->fit.centre.y - point->position.y};
    cairn_real radius = cairn_vec2_cross(point->direction, to),
               offset = cairn_abs(cairn_vec2_dot(point->direction, to)), at;
    int32_t bin;

    if (set->fit.kind == CAIRN_ELLIPSE_COLUMN)
        radius = -radius;
    if (set->fit.kind == CAIRN_ELLIPSE_ANY)
        radius = cairn_abs(radius);
    if (!(radius > 0) || radius > set->params.max_radius ||
        offset > set->max_sine * radius + 2 * set->cell_size)
        return;
    at = radius / set->params.max_radius * (ELLIPSE_RADIUS_BINS - 1);
    bin = (int32_t)at;
    set->radius_histogram[bin] += weight * (1 - (at - (cairn_real)bin));
    if (bin + 1 < ELLIPSE_RADIUS_BINS)
        set->radius_histogram[bin + 1] += weight * (at - (cairn_real)bin);
}

/* Sets the current ellipse to the circle of the maximum of the smoothed radius histogram. */
static void choose_radius(cairn_ellipse_set *set)
{
    int32_t best = 1;
    cairn_real most = -1;

    for (int32_t i = 1; i < ELLIPSE_RADIUS_BINS; i++) {
        cairn_real sum = set->radius_histogram[i - 1] + 2 * set->radius_histogram[i] +
                         (i + 1 < ELLIPSE_RADIUS_BINS ? set->radius_histogram[i + 1] : 0);

        if (sum > most) {
            most = sum;
            best = i;
        }
    }
    set->fit.half_length = set->fit.half_width =
        cairn_max((cairn_real)best * (set->params.max_radius / (ELLIPSE_RADIUS_BINS - 1)),
                  set->params.min_radius);
}

/* Marks the arc of the outline, by parametric angle, that contains a point p, in m. */
static void mark_arc(cairn_ellipse_set *set, cairn_vec2 p)
{
    cairn_transform t = set->gate.map_ellipse;
    cairn_vec2 from = {p.x - t.x, p.y - t.y}, local = cairn_transform_inverse_direction(t, from);
    cairn_real along = local.x / set->fit.half_length, across = local.y / set->fit.half_width;
    int32_t arcs = set->arc_count;
    cairn_real place =
        (cairn_atan2(across, along) / (2 * CAIRN_PI) + CAIRN_REAL(0.5)) * (cairn_real)arcs;
    int32_t arc = cairn_real_to_int(cairn_min(cairn_floor(place), (cairn_real)(arcs - 1)));

    set->arcs[arc / 32] |= (uint32_t)1 << (arc % 32);
}

/* Adds an inlier to the pass. distance: from the current ellipse, in m. */
static void add_inlier(cairn_ellipse_set *set, const cairn_oriented_point *point,
                       cairn_real distance, cairn_real weight)
{
    if (set->pass != ELLIPSE_PASS_SUPPORT) {
        cairn_ellipse_conic_add(&set->equations, point, weight);
        return;
    }
    set->inlier_weight += weight;
    set->squared_residuals += weight * distance * distance;
    mark_arc(set, point->position);
}

/* Adds the next point to the pass, if the point is an inlier. 0: the budget is used up. */
static int add_point(cairn_ellipse_set *set, cairn_budget *budget)
{
    cairn_oriented_point point = set->points[set->cursor];
    cairn_real weight = cairn_ellipse_weight(set, set->cursor), distance;

    if (!(weight > 0) || (set->pass != ELLIPSE_PASS_RADIUS &&
                          cairn_ellipse_is_outside_gate(&set->gate, point.position)))
        return 1;
    point.direction = cairn_vec2_unit(point.direction);
    if (set->pass == ELLIPSE_PASS_RADIUS) {
        add_radius(set, &point, weight);
    } else if (cairn_ellipse_gate_passes(&set->gate, &point, &distance)) {
        if (!cairn_budget_charge(budget, &set->units_charged, UNITS_PER_INLIER))
            return 0;
        add_inlier(set, &point, distance, weight);
    }
    return 1;
}

/* 1 when the axes of the current ellipse are within the bounds of the params. */
static int is_in_bounds(const cairn_ellipse_set *set)
{
    const cairn_ellipse *ellipse = &set->fit;

    return ellipse->half_width >= set->params.min_radius &&
           ellipse->half_length <= set->params.max_radius &&
           ellipse->half_length <= set->params.max_axis_ratio * ellipse->half_width;
}

/* Completes the current ellipse: votes, residuals, coverage and score. */
static void finish_ellipse(cairn_ellipse_set *set)
{
    cairn_ellipse *ellipse = &set->fit;
    int32_t arcs = set->arc_count, marked = 0;
    cairn_real mean_squared = set->squared_residuals / set->inlier_weight;

    for (int32_t i = 0; i < arcs; i++)
        marked += ((set->arcs[i / 32] >> (i % 32)) & 1) != 0;
    ellipse->coverage = (cairn_real)marked / (cairn_real)arcs;
    ellipse->votes = set->inlier_weight;
    ellipse->rms = cairn_sqrt(mean_squared);
    ellipse->score =
        ellipse->coverage *
        (1 - mean_squared / (set->params.support_distance * set->params.support_distance));
    ellipse->score = cairn_max(ellipse->score, 0);
}

static void insert_ellipse(cairn_ellipse_set *set)
{
    ranked_list ellipses = {.entries = set->found,
                            .count = &set->found_count,
                            .capacity = set->params.max_ellipses,
                            .entry_bytes = sizeof set->fit,
                            .score_at = offsetof(cairn_ellipse, votes)};

    (void)ranked_list_add(&ellipses, &set->fit);
}

/* Ends a pass over the points, and starts the next one. 0: it was the last of the current peak. */
static int end_pass(cairn_ellipse_set *set)
{
    if (set->pass == ELLIPSE_PASS_RADIUS) {
        choose_radius(set);
        start_pass(set, ELLIPSE_PASS_COARSE);
        return 1;
    }
    if (set->pass != ELLIPSE_PASS_SUPPORT && set->equations.weight >= set->params.min_votes &&
        cairn_ellipse_conic_solve(&set->equations, &set->fit) && is_in_bounds(set)) {
        start_pass(set, set->pass + 1);
        return 1;
    }
    if (set->pass == ELLIPSE_PASS_SUPPORT && set->inlier_weight >= set->params.min_votes) {
        finish_ellipse(set);
        if (set->fit.coverage >= set->params.min_coverage)
            insert_ellipse(set);
    }
    return 0;
}

int cairn_ellipse_refine(cairn_ellipse_set *set, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(set->phase_resume);
    for (set->current_peak = 0; set->current_peak < set->peak_count; set->current_peak++) {
        start_peak(set);
        do {
            for (; set->cursor < set->count; set->cursor++) {
                CAIRN_STEP_CHARGE_EVERY(set, phase_resume, budget, POINTS_PER_UNIT, set->cursor);
                CAIRN_STEP_RUN(set, phase_resume, budget, add_point);
            }
            CAIRN_STEP_CHARGE(set, phase_resume, budget, UNITS_PER_PASS + set->found_count / 2);
        } while (end_pass(set));
    }
    CAIRN_STEP_END(set->phase_resume);
}
