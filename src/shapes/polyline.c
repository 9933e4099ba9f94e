/* Line segments by extended EM (split and merge): the object, and the order of the phases.
 *
 * Method:
 * 1. The points are sorted by Morton code (polyline_order.c), so nothing depends on their order in
 *    the input, and neighbours in memory are neighbours in space.
 * 2. Cells of the quadtree of the code give the initial components (polyline_initial.c).
 * 3. Until convergence, with a decreasing width of the Gaussian (annealing): E-step and M-step
 *    (polyline_em.c), splits at gaps and bends (polyline_support.c), merges (polyline_merge.c).
 * 4. Final assignment of the points and result.
 *
 * Layout: one allocation per array. A point is three reals also in the plane, with z = 0.
 *
 * Limits: coordinates up to CAIRN_POLYLINE_EXTENT. Points closer than 2^-20 of the whole extent are
 * still distinguished.
 *
 * Source: Adluru 2008, section 2 and refs 168, 170 (Lakaemper and Latecki, extended EM); the
 * initialization by a quadtree is cairn's. */
#include "src/base/build.h"

#include <string.h>

#include "src/shapes/polyline_work.h"

#define MAX_POINTS   (INT32_C(1) << 26)
#define MAX_SEGMENTS (INT32_C(1) << 20)

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_polyline_params, field, __VA_ARGS__)
#define NUMBER(field, ...)   CAIRN_NUMBER(cairn_polyline_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_polyline_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(dim, 2, 2, 3),
    INTEGER(max_points, 1024, 1, MAX_POINTS),
    INTEGER(max_segments, 256, 1, MAX_SEGMENTS),
    INTEGER(min_points, 4, 3, INT32_MAX),
    INTEGER(max_iterations, 20, 1, INT32_MAX),
    NUMBER(min_length, CAIRN_REAL(0.08), 0, CAIRN_REAL_MAX),
    POSITIVE(sigma, CAIRN_REAL(0.01), 0, CAIRN_REAL_MAX),
    POSITIVE(width_first, CAIRN_REAL(0.04), 0, CAIRN_REAL_MAX),
    POSITIVE(width_last, CAIRN_REAL(0.02), 0, CAIRN_REAL_MAX),
    POSITIVE(width_decay, CAIRN_REAL(0.5), 0, 1),
    POSITIVE(gap, CAIRN_REAL(0.25), 0, CAIRN_REAL_MAX),
    NUMBER(gap_factor, 3, 1, CAIRN_REAL_MAX),
    POSITIVE(gap_max, CAIRN_REAL(1.5), 0, CAIRN_REAL_MAX),
    NUMBER(merge_angle, CAIRN_REAL(0.26), 0, CAIRN_PI / 2),
    POSITIVE(merge_distance, CAIRN_REAL(0.10), 0, CAIRN_REAL_MAX),
    POSITIVE(segment_penalty, 20, 0, CAIRN_REAL_MAX),
    POSITIVE(tolerance, CAIRN_REAL(0.001), 0, CAIRN_REAL_MAX),
};
const cairn_parameters cairn_polyline_parameters =
    CAIRN_PARAMETERS("polyline", cairn_polyline_params, rows);

cairn_polyline_params cairn_polyline_default(void)
{
    cairn_polyline_params params;

    cairn_parameters_preset(&cairn_polyline_parameters, &params);
    return params;
}

cairn_status cairn_polyline_check(const cairn_polyline_params *params, cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_polyline_parameters, params, fault);

    if (status == CAIRN_OK)
        status = cairn_parameters_require(params->width_first >= params->width_last, "polyline",
                                          "width_first: at least width_last", fault);
    if (status == CAIRN_OK)
        status = cairn_parameters_require(params->gap_max >= params->gap, "polyline",
                                          "gap_max: at least gap", fault);
    return status;
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_polyline *build(cairn_pool *pool, const cairn_polyline_params *params)
{
    size_t n = (size_t)params->max_points, m = (size_t)params->max_segments,
           blocks = (n + POLYLINE_BLOCK_POINTS - 1) / POLYLINE_BLOCK_POINTS;
    cairn_polyline *polyline = cairn_object_take(pool, sizeof *polyline);

    CAIRN_TAKE(polyline, pool, raw_points, n);
    CAIRN_TAKE(polyline, pool, points, n);
    CAIRN_TAKE(polyline, pool, morton, n);
    CAIRN_TAKE(polyline, pool, order, n);
    CAIRN_TAKE(polyline, pool, merge_buffer, n);
    CAIRN_TAKE(polyline, pool, raw_index, n);
    CAIRN_TAKE(polyline, pool, component_of, n);
    CAIRN_TAKE(polyline, pool, label, n);
    CAIRN_TAKE(polyline, pool, position, n);
    CAIRN_TAKE(polyline, pool, block_min, blocks);
    CAIRN_TAKE(polyline, pool, block_max, blocks);
    CAIRN_TAKE(polyline, pool, components, m);
    CAIRN_TAKE(polyline, pool, next, m);
    CAIRN_TAKE(polyline, pool, candidate_list, m);
    CAIRN_TAKE(polyline, pool, candidate_weight, m);
    CAIRN_TAKE(polyline, pool, candidate_local, m);
    CAIRN_TAKE(polyline, pool, segments, m);
    if (polyline != NULL) {
        polyline->params = *params;
        polyline->merge_cosine = cairn_cos(params->merge_angle);
        polyline->is_complete = polyline->converged = 1;
    }
    return polyline;
}

CAIRN_OBJECT(polyline, polyline, build);

/* CAIRN_OK when a point is in range; *what is set to the fault. */
static cairn_status check_point(const cairn_real *point, int32_t dim, const char **what)
{
    for (int32_t j = 0; j < dim; j++) {
        *what = "coordinate: not a finite number";
        if (!cairn_is_finite(point[j]))
            return CAIRN_NOT_FINITE;
        *what = "coordinate: beyond CAIRN_POLYLINE_EXTENT";
        if (cairn_abs(point[j]) > CAIRN_POLYLINE_EXTENT)
            return CAIRN_BAD_ARGUMENT;
    }
    *what = NULL;
    return CAIRN_OK;
}

/* CAIRN_OK when all points are in range; *fault is set. */
static cairn_status check_points(const cairn_polyline *polyline, const cairn_real *points,
                                 int32_t count, cairn_fault *fault)
{
    cairn_status status = CAIRN_OK;

    fault->index = -1;
    fault->message = "points: NULL or a negative count, expected an array";
    if (polyline == NULL || count < 0 || (points == NULL && count > 0))
        return CAIRN_BAD_ARGUMENT;
    fault->index = polyline->params.max_points;
    fault->message = "points: more than max_points";
    if (count > polyline->params.max_points)
        return CAIRN_FULL;
    fault->message = NULL;
    for (int32_t i = 0; i < count && status == CAIRN_OK; i++) {
        fault->index = i;
        status = check_point(points + (size_t)i * (size_t)polyline->params.dim,
                             polyline->params.dim, &fault->message);
    }
    return status;
}

cairn_status cairn_polyline_clear(cairn_polyline *polyline, cairn_real scale)
{
    if (polyline == NULL || !(scale > 0 && cairn_is_finite(scale)))
        return CAIRN_BAD_ARGUMENT;
    polyline->sigma = scale * polyline->params.sigma;
    polyline->width_first = scale * polyline->params.width_first;
    polyline->width_last = scale * polyline->params.width_last;
    polyline->width = polyline->width_first;
    polyline->box_side = 0;
    polyline->point_count = 0;
    polyline->component_count = polyline->next_count = 0;
    polyline->result_points = polyline->result_segments = 0;
    polyline->max_end_motion = 0;
    polyline->has_changed = polyline->converged = polyline->dropped = 0;
    memset(&polyline->measure, 0, sizeof polyline->measure);
    polyline->eighths_used = 0;
    polyline->resume = polyline->phase_resume = 0;
    polyline->is_open = 1;
    polyline->is_complete = 0;
    return CAIRN_OK;
}

/* Appends a point, and updates the bounding box. */
static void append_point(cairn_polyline *polyline, const cairn_real *point)
{
    for (int j = 0; j < 3; j++) {
        cairn_real value = j < polyline->params.dim ? point[j] : 0;

        polyline->raw_points[polyline->point_count][j] = value;
        polyline->box_min[j] =
            polyline->point_count == 0 ? value : cairn_min(polyline->box_min[j], value);
        polyline->box_max[j] =
            polyline->point_count == 0 ? value : cairn_max(polyline->box_max[j], value);
        polyline->box_side =
            cairn_max(polyline->box_side, polyline->box_max[j] - polyline->box_min[j]);
    }
    polyline->cell_size = cairn_max(polyline->box_side, polyline->sigma) /
                          ((INT32_C(1) << (POLYLINE_MORTON_BITS - 1)) - 1);
    polyline->point_count++;
}

cairn_status cairn_polyline_add(cairn_polyline *polyline, const cairn_real *point)
{
    const char *what;
    cairn_status status;

    if (polyline == NULL || point == NULL || !polyline->is_open)
        return CAIRN_BAD_ARGUMENT;
    if (polyline->point_count == polyline->params.max_points)
        return CAIRN_FULL;
    status = check_point(point, polyline->params.dim, &what);
    if (status == CAIRN_OK)
        append_point(polyline, point);
    return status;
}

cairn_status cairn_polyline_begin(cairn_polyline *polyline, const cairn_real *points, int32_t count,
                                  cairn_fault *fault)
{
    cairn_fault found;
    cairn_status status = check_points(polyline, points, count, &found);

    if (fault != NULL)
        *fault = found;
    if (status != CAIRN_OK)
        return status;
    status = cairn_polyline_clear(polyline, 1);
    for (int32_t i = 0; i < count; i++)
        append_point(polyline, points + (size_t)i * (size_t)polyline->params.dim);
    return status;
}

/* Position of a point along its component, if it has one. */
static void project_point(cairn_polyline *polyline, int32_t point)
{
    int32_t component = polyline->component_of[point];
    cairn_real local[3];

    if (component < 0)
        return;
    cairn_polyline_to_local(&polyline->components[component], polyline->params.dim,
                            polyline->points[point], local);
    polyline->position[point] = local[0];
}

/* Positions of the points along their components. */
static int project_points(cairn_polyline *polyline, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(polyline->phase_resume);
    for (polyline->cursor = 0; polyline->cursor < polyline->point_count; polyline->cursor++) {
        CAIRN_STEP_CHARGE_EIGHTHS_EVERY(polyline, phase_resume, budget, POLYLINE_GROUP,
                                        polyline->cursor, polyline->point_count, 6);
        project_point(polyline, polyline->cursor);
    }
    CAIRN_STEP_END(polyline->phase_resume);
}

/* Removes the components that merging emptied. */
static int remove_empty(cairn_polyline *polyline, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(polyline->phase_resume);
    polyline->other = 0;
    for (polyline->cursor = 0; polyline->cursor < polyline->next_count; polyline->cursor++) {
        CAIRN_STEP_CHARGE_EIGHTHS(polyline, phase_resume, budget, 24);
        if (polyline->next[polyline->cursor].count > 0)
            polyline->next[polyline->other++] = polyline->next[polyline->cursor];
    }
    polyline->next_count = polyline->other;
    CAIRN_STEP_END(polyline->phase_resume);
}

/* Ends of a component as a segment without points. */
static void write_ends(cairn_polyline *polyline, int32_t component)
{
    const polyline_component *from = &polyline->components[component];
    cairn_polyline_segment *segment = &polyline->segments[component];

    cairn_polyline_point_at(from, from->low, segment->a);
    cairn_polyline_point_at(from, from->high, segment->b);
    segment->count = 0;
    segment->rms = 0;
}

/* Labels a point, and adds its squared residual to that of its segment. */
static void write_label(cairn_polyline *polyline, int32_t point)
{
    int32_t component = polyline->component_of[point];
    cairn_real local[3];

    polyline->label[polyline->raw_index[point]] = component;
    if (component < 0)
        return;
    cairn_polyline_to_local(&polyline->components[component], polyline->params.dim,
                            polyline->points[point], local);
    polyline->segments[component].count++;
    polyline->segments[component].rms += local[1] * local[1] + local[2] * local[2];
}

/* Root mean square of the residuals of a segment, from the sum of their squares. */
static void write_rms(cairn_polyline_segment *segment)
{
    if (segment->count > 0)
        segment->rms = cairn_sqrt(segment->rms / (cairn_real)segment->count);
}

/* The segments with their inliers, and the labels in the order of the input. */
static int write_result(cairn_polyline *polyline, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(polyline->phase_resume);
    for (polyline->cursor = 0; polyline->cursor < polyline->component_count; polyline->cursor++) {
        CAIRN_STEP_CHARGE_EIGHTHS(polyline, phase_resume, budget, 12);
        write_ends(polyline, polyline->cursor);
    }
    for (polyline->cursor = 0; polyline->cursor < polyline->point_count; polyline->cursor++) {
        CAIRN_STEP_CHARGE_EIGHTHS(polyline, phase_resume, budget, 8);
        write_label(polyline, polyline->cursor);
    }
    for (polyline->cursor = 0; polyline->cursor < polyline->component_count; polyline->cursor++) {
        CAIRN_STEP_CHARGE_EIGHTHS(polyline, phase_resume, budget, 4);
        write_rms(&polyline->segments[polyline->cursor]);
    }
    polyline->result_segments = polyline->component_count;
    polyline->result_points = polyline->point_count;
    CAIRN_STEP_END(polyline->phase_resume);
}

/* What follows on an iteration. */
enum { ITERATE_ON, SEARCH_OUTLIERS, HAS_ENDED };

/* Ends an iteration: the components left by merging become those of the next one. When the width
 * has reached its last value, the outliers are searched twice for further initial components.
 * Returns what follows. */
static int32_t end_iteration(cairn_polyline *polyline)
{
    polyline_component *swap = polyline->components;
    int is_last_width = polyline->width <= polyline->width_last;
    int has_settled;

    polyline->components = polyline->next;
    polyline->next = swap;
    polyline->has_changed =
        polyline->has_changed || polyline->component_count != polyline->next_count;
    polyline->component_count = polyline->next_count;
    polyline->next_count = 0;
    polyline->measure.iterations++;
    has_settled = !polyline->has_changed && is_last_width &&
                  polyline->max_end_motion <= polyline->params.tolerance;
    polyline->max_end_motion = 0;
    polyline->has_changed = 0;
    polyline->width =
        cairn_max(polyline->width * polyline->params.width_decay, polyline->width_last);
    if (polyline->measure.iterations >= polyline->params.max_iterations)
        return HAS_ENDED;
    if (is_last_width && polyline->initial_round < POLYLINE_INITIAL_ROUNDS - 1)
        return SEARCH_OUTLIERS;
    polyline->converged = has_settled;
    return has_settled ? HAS_ENDED : ITERATE_ON;
}

/* The fit: see Method in the head of this file. */
static int fit(cairn_polyline *polyline, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(polyline->resume);
    polyline->list_start = 0;
    polyline->initial_round = 0;
    CAIRN_STEP_RUN(polyline, resume, budget, cairn_polyline_keys);
    CAIRN_STEP_UNTIL(polyline->resume,
                     cairn_polyline_sort(polyline, budget, cairn_polyline_point_before));
    CAIRN_STEP_RUN(polyline, resume, budget, cairn_polyline_gather);
    do {
        CAIRN_STEP_RUN(polyline, resume, budget, cairn_polyline_list_outliers);
        CAIRN_STEP_UNTIL(polyline->resume,
                         cairn_polyline_sort(polyline, budget, cairn_polyline_outlier_before));
        CAIRN_STEP_RUN(polyline, resume, budget, cairn_polyline_initial);
        do {
            CAIRN_STEP_RUN(polyline, resume, budget, cairn_polyline_expect);
            CAIRN_STEP_RUN(polyline, resume, budget, cairn_polyline_maximize);
            CAIRN_STEP_RUN(polyline, resume, budget, project_points);
            polyline->list_start = 0;
            CAIRN_STEP_UNTIL(polyline->resume,
                             cairn_polyline_sort(polyline, budget, cairn_polyline_support_before));
            CAIRN_STEP_RUN(polyline, resume, budget, cairn_polyline_support);
            CAIRN_STEP_RUN(polyline, resume, budget, cairn_polyline_merge);
            CAIRN_STEP_RUN(polyline, resume, budget, remove_empty);
            polyline->follows = end_iteration(polyline);
        } while (polyline->follows == ITERATE_ON);
        polyline->initial_round++;
        polyline->list_start = polyline->outliers_start;
    } while (polyline->follows == SEARCH_OUTLIERS);
    CAIRN_STEP_RUN(polyline, resume, budget, cairn_polyline_assign);
    CAIRN_STEP_RUN(polyline, resume, budget, write_result);
    CAIRN_STEP_END(polyline->resume);
}

cairn_status cairn_polyline_step(cairn_polyline *polyline, cairn_budget *budget)
{
    if (polyline == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    polyline->is_open = 0;
    if (!polyline->is_complete)
        polyline->is_complete = fit(polyline, budget);
    return polyline->is_complete ? CAIRN_OK : CAIRN_MORE;
}

cairn_polyline_view cairn_polyline_read(const cairn_polyline *polyline)
{
    cairn_polyline_view view = {polyline->segments,        polyline->label,
                                polyline->result_segments, polyline->result_points,
                                polyline->converged,       polyline->dropped};
    return view;
}

cairn_polyline_measure cairn_polyline_measured(const cairn_polyline *polyline)
{
    return polyline->measure;
}
