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

cairn_polyline_params cairn_polyline_default(void)
{
    cairn_polyline_params params;

    memset(&params, 0, sizeof params);
    params.dim = 2;
    params.max_points = 1024;
    params.max_segments = 256;
    params.min_points = 4;
    params.max_iterations = 20;
    params.min_length = CAIRN_REAL(0.08);
    params.sigma = CAIRN_REAL(0.01);
    params.width_first = CAIRN_REAL(0.04);
    params.width_last = CAIRN_REAL(0.02);
    params.width_decay = CAIRN_REAL(0.5);
    params.gap = CAIRN_REAL(0.25);
    params.gap_factor = 3;
    params.gap_max = CAIRN_REAL(1.5);
    params.merge_angle = CAIRN_REAL(0.26);
    params.merge_distance = CAIRN_REAL(0.10);
    params.segment_penalty = 20;
    params.tolerance = CAIRN_REAL(0.001);
    return params;
}

/* 1 for a finite number > 0. */
static int is_positive(cairn_real value)
{
    return value > 0 && cairn_is_finite(value);
}

/* 1 when all params are in range. */
static int params_are_valid(const cairn_polyline_params *params)
{
    return params != NULL && (params->dim == 2 || params->dim == 3) && params->max_points >= 1 &&
           params->max_points <= INT32_C(1) << 26 && params->max_segments >= 1 &&
           params->max_segments <= INT32_C(1) << 20 && params->min_points >= 3 &&
           params->max_iterations >= 1 && params->min_length >= 0 &&
           cairn_is_finite(params->min_length) && is_positive(params->sigma) &&
           is_positive(params->width_last) && params->width_first >= params->width_last &&
           cairn_is_finite(params->width_first) && params->width_decay > 0 &&
           params->width_decay <= 1 && is_positive(params->gap) && params->gap_factor >= 1 &&
           cairn_is_finite(params->gap_factor) && params->gap_max >= params->gap &&
           cairn_is_finite(params->gap_max) && params->merge_angle >= 0 &&
           params->merge_angle <= CAIRN_PI / 2 && is_positive(params->merge_distance) &&
           is_positive(params->segment_penalty) && is_positive(params->tolerance);
}

/* Allocates the object and its arrays; NULL from a counting pool. */
static cairn_polyline *carve(cairn_pool *pool, const cairn_polyline_params *params)
{
    size_t n = (size_t)params->max_points, m = (size_t)params->max_segments,
           blocks = (n + POLYLINE_BLOCK_POINTS - 1) / POLYLINE_BLOCK_POINTS;
    cairn_polyline *polyline = cairn_pool_take_one(pool, sizeof *polyline);
    cairn_real(*raw_points)[3] = cairn_pool_take(pool, n, sizeof *raw_points);
    cairn_real(*points)[3] = cairn_pool_take(pool, n, sizeof *points);
    uint64_t *morton = cairn_pool_take(pool, n, sizeof *morton);
    int32_t *order = cairn_pool_take(pool, n, sizeof *order);
    int32_t *merge_buffer = cairn_pool_take(pool, n, sizeof *merge_buffer);
    int32_t *raw_index = cairn_pool_take(pool, n, sizeof *raw_index);
    int32_t *component_of = cairn_pool_take(pool, n, sizeof *component_of);
    int32_t *label = cairn_pool_take(pool, n, sizeof *label);
    cairn_real *position = cairn_pool_take(pool, n, sizeof *position);
    cairn_real(*block_min)[3] = cairn_pool_take(pool, blocks, sizeof *block_min);
    cairn_real(*block_max)[3] = cairn_pool_take(pool, blocks, sizeof *block_max);
    polyline_component *components = cairn_pool_take(pool, m, sizeof *components);
    polyline_component *next = cairn_pool_take(pool, m, sizeof *next);
    int32_t *candidate_list = cairn_pool_take(pool, m, sizeof *candidate_list);
    cairn_real *candidate_weight = cairn_pool_take(pool, m, sizeof *candidate_weight);
    cairn_real(*candidate_local)[3] = cairn_pool_take(pool, m, sizeof *candidate_local);
    cairn_polyline_segment *segments = cairn_pool_take(pool, m, sizeof *segments);

    if (polyline != NULL) {
        memset(polyline, 0, sizeof *polyline);
        polyline->params = *params;
        polyline->merge_cosine = cairn_cos(params->merge_angle);
        polyline->raw_points = raw_points;
        polyline->points = points;
        polyline->morton = morton;
        polyline->order = order;
        polyline->merge_buffer = merge_buffer;
        polyline->raw_index = raw_index;
        polyline->component_of = component_of;
        polyline->label = label;
        polyline->position = position;
        polyline->block_min = block_min;
        polyline->block_max = block_max;
        polyline->components = components;
        polyline->next = next;
        polyline->candidate_list = candidate_list;
        polyline->candidate_weight = candidate_weight;
        polyline->candidate_local = candidate_local;
        polyline->segments = segments;
        polyline->is_complete = 1;
        polyline->converged = 1;
    }
    return polyline;
}

size_t cairn_polyline_memory(const cairn_polyline_params *params)
{
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_polyline_create(cairn_polyline **polyline, cairn_pool *pool,
                                   const cairn_polyline_params *params)
{
    size_t need = cairn_polyline_memory(params);

    if (polyline == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_capacity(pool, need))
        return CAIRN_NO_MEMORY;
    *polyline = carve(pool, params);
    return CAIRN_OK;
}

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
    if (polyline == NULL || !is_positive(scale))
        return CAIRN_BAD_ARGUMENT;
    polyline->sigma = scale * polyline->params.sigma;
    polyline->width_first = scale * polyline->params.width_first;
    polyline->width_last = scale * polyline->params.width_last;
    polyline->width = polyline->width_first;
    polyline->box_side = 0;
    polyline->point_count = 0;
    polyline->component_count = polyline->next_count = 0;
    polyline->result_points = polyline->result_segments = 0;
    polyline->list_start = 0;
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

/* Positions of the points along their components. */
static int project_points(cairn_polyline *polyline, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(polyline->phase_resume);
    for (polyline->cursor = 0; polyline->cursor < polyline->point_count; polyline->cursor++) {
        POLYLINE_PAY_FOUR(polyline, budget, polyline->cursor, polyline->point_count, 6);
        if (polyline->component_of[polyline->cursor] >= 0) {
            cairn_real local[3];

            cairn_polyline_to_local(&polyline->components[polyline->component_of[polyline->cursor]],
                                    polyline->params.dim, polyline->points[polyline->cursor],
                                    local);
            polyline->position[polyline->cursor] = local[0];
        }
    }
    CAIRN_STEP_END(polyline->phase_resume);
}

/* Removes the components that merging emptied. */
static int remove_empty(cairn_polyline *polyline, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(polyline->phase_resume);
    polyline->other = 0;
    for (polyline->cursor = 0; polyline->cursor < polyline->next_count; polyline->cursor++) {
        POLYLINE_PAY(polyline, budget, 24);
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

/* The segments with their inliers, and the labels in the order of the input. */
static int write_result(cairn_polyline *polyline, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(polyline->phase_resume);
    for (polyline->cursor = 0; polyline->cursor < polyline->component_count; polyline->cursor++) {
        POLYLINE_PAY(polyline, budget, 12);
        write_ends(polyline, polyline->cursor);
    }
    for (polyline->cursor = 0; polyline->cursor < polyline->point_count; polyline->cursor++) {
        POLYLINE_PAY(polyline, budget, 8);
        write_label(polyline, polyline->cursor);
    }
    for (polyline->cursor = 0; polyline->cursor < polyline->component_count; polyline->cursor++) {
        cairn_polyline_segment *segment;

        POLYLINE_PAY(polyline, budget, 4);
        segment = &polyline->segments[polyline->cursor];
        if (segment->count > 0)
            segment->rms = cairn_sqrt(segment->rms / (cairn_real)segment->count);
    }
    polyline->result_segments = polyline->component_count;
    polyline->result_points = polyline->point_count;
    CAIRN_STEP_END(polyline->phase_resume);
}

/* 1 after the last iteration. */
static int is_exhausted(const cairn_polyline *polyline)
{
    return polyline->measure.iterations >= polyline->params.max_iterations;
}

/* 1 when the outliers are searched for further initial components, which is done twice, once the
 * width has reached its last value. */
static int searches_outliers(const cairn_polyline *polyline)
{
    return !is_exhausted(polyline) && polyline->width <= polyline->width_last &&
           polyline->initial_round < POLYLINE_INITIAL_ROUNDS - 1;
}

/* Ends an iteration: the components left by merging become those of the next one. */
static void end_iteration(cairn_polyline *polyline)
{
    polyline_component *swap = polyline->components;

    polyline->components = polyline->next;
    polyline->next = swap;
    polyline->has_changed =
        polyline->has_changed || polyline->component_count != polyline->next_count;
    polyline->component_count = polyline->next_count;
    polyline->next_count = 0;
    polyline->measure.iterations++;
    polyline->converged = !is_exhausted(polyline) && !searches_outliers(polyline) &&
                          !polyline->has_changed &&
                          polyline->max_end_motion <= polyline->params.tolerance &&
                          polyline->width <= polyline->width_last;
    polyline->max_end_motion = 0;
    polyline->has_changed = 0;
}

/* The fit: see Method in the head of this file. */
static int fit(cairn_polyline *polyline, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(polyline->resume);
    CAIRN_STEP_UNTIL(polyline->resume, cairn_polyline_keys(polyline, budget));
    CAIRN_STEP_UNTIL(polyline->resume,
                     cairn_polyline_sort(polyline, budget, cairn_polyline_point_before));
    CAIRN_STEP_UNTIL(polyline->resume, cairn_polyline_gather(polyline, budget));
    polyline->list_start = 0;
    for (polyline->initial_round = 0;; polyline->initial_round++) {
        CAIRN_STEP_UNTIL(polyline->resume, cairn_polyline_list_outliers(polyline, budget));
        CAIRN_STEP_UNTIL(polyline->resume,
                         cairn_polyline_sort(polyline, budget, cairn_polyline_outlier_before));
        CAIRN_STEP_UNTIL(polyline->resume, cairn_polyline_initial(polyline, budget));
        for (;;) {
            CAIRN_STEP_UNTIL(polyline->resume, cairn_polyline_expect(polyline, budget));
            CAIRN_STEP_UNTIL(polyline->resume, cairn_polyline_maximize(polyline, budget));
            CAIRN_STEP_UNTIL(polyline->resume, project_points(polyline, budget));
            polyline->list_start = 0;
            CAIRN_STEP_UNTIL(polyline->resume,
                             cairn_polyline_sort(polyline, budget, cairn_polyline_support_before));
            CAIRN_STEP_UNTIL(polyline->resume, cairn_polyline_support(polyline, budget));
            CAIRN_STEP_UNTIL(polyline->resume, cairn_polyline_merge(polyline, budget));
            CAIRN_STEP_UNTIL(polyline->resume, remove_empty(polyline, budget));
            end_iteration(polyline);
            if (is_exhausted(polyline) || searches_outliers(polyline) || polyline->converged)
                break;
            polyline->width =
                cairn_max(polyline->width * polyline->params.width_decay, polyline->width_last);
        }
        if (!searches_outliers(polyline))
            break;
        polyline->list_start = polyline->outliers_start;
    }
    CAIRN_STEP_UNTIL(polyline->resume, cairn_polyline_assign(polyline, budget));
    CAIRN_STEP_UNTIL(polyline->resume, write_result(polyline, budget));
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
