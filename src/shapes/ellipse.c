/* Hough transform for circle centres, and the peaks that become ellipses.
 *
 * Method:
 * 1. A point votes for all centres along its normal between the least and the largest radius, in a
 *    square accumulator. Rooms have their centre on the free side of the point, columns on the
 *    other side; each kind has its own accumulator.
 * 2. The accumulator is smoothed, because normals are inaccurate far from their points.
 * 3. Peaks are local maxima (non-maximum suppression). Around each a histogram of the distances of
 *    the points whose normals pass close to the peak gives a circle (ellipse_refine.c).
 * 4. Three least-squares fits of a conic (ellipse_fit.c), with narrowing gates, refine the circle
 *    to an ellipse; a last pass measures its inliers and coverage.
 * 5. Ellipses that coincide with one of more votes are suppressed.
 *
 * Layout: the accumulators one after the other; the peaks; two lists of ellipses, one of the search
 * that runs and one of the last result.
 *
 * Limits: one radius per peak and kind; of concentric walls the one with the most points. With an
 * axis ratio above 2 the normals pass too far from the centre for a peak there. Cells are larger
 * when the points extend too far.
 *
 * Source: Duda and Hart 1972; Ballard 1981. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/ranked_list.h"
#include "src/shapes/ellipse_work.h"

/* Items for one work unit: points that are checked, cells that are cleared, skipped or compared with
 * a peak, votes, cells of a line that is smoothed. */
enum {
    CHECKED_PER_UNIT = 4,
    CLEARED_PER_UNIT = 128,
    SKIPPED_PER_UNIT = 32,
    COMPARED_PER_UNIT = 32,
    VOTES_PER_UNIT = 4,
    SMOOTHED_PER_UNIT = 16
};

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_ellipse_params, field, __VA_ARGS__)
#define NUMBER(field, ...)   CAIRN_NUMBER(cairn_ellipse_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_ellipse_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_ellipses, 32, 1, 256),
    INTEGER(cells, 96, 8, 1024),
    POSITIVE(cell_size, CAIRN_REAL(0.15), 0, CAIRN_MAX_MAGNITUDE),
    INTEGER(oriented, 1, 0, 1),
    POSITIVE(min_radius, CAIRN_REAL(0.15), 0, CAIRN_MAX_MAGNITUDE),
    POSITIVE(max_radius, 6, 0, CAIRN_MAX_MAGNITUDE),
    NUMBER(max_axis_ratio, 2, 1, CAIRN_MAX_MAGNITUDE),
    POSITIVE(angle_tolerance, 15 * (CAIRN_PI / 180), 0, CAIRN_PI / 4),
    POSITIVE(support_distance, CAIRN_REAL(0.05), 0, CAIRN_MAX_MAGNITUDE),
    POSITIVE(spacing, CAIRN_REAL(0.10), 0, CAIRN_MAX_MAGNITUDE),
    POSITIVE(min_votes, 8, 0, CAIRN_REAL_MAX),
    NUMBER(min_coverage, CAIRN_REAL(0.5), 0, 1),
    POSITIVE(separation, CAIRN_REAL(0.3), 0, CAIRN_MAX_MAGNITUDE),
};
const cairn_parameters cairn_ellipse_parameters =
    CAIRN_PARAMETERS("ellipse", cairn_ellipse_params, rows);

cairn_ellipse_params cairn_ellipse_default(void)
{
    cairn_ellipse_params params;

    cairn_parameters_preset(&cairn_ellipse_parameters, &params);
    return params;
}

cairn_status cairn_ellipse_check(const cairn_ellipse_params *params, cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_ellipse_parameters, params, fault);

    if (status == CAIRN_OK)
        status = cairn_parameters_require(params->max_radius > params->min_radius, "ellipse",
                                          "max_radius: above min_radius", fault);
    return status;
}

/* Number of cells of all accumulators. */
static int32_t cells_of(const cairn_ellipse_params *params)
{
    return (params->oriented ? 2 : 1) * params->cells * params->cells;
}

/* Copies the params, and computes the sine. */
static void set_params(cairn_ellipse_set *set, const cairn_ellipse_params *params)
{
    set->params = *params;
    set->max_sine = cairn_sin(params->angle_tolerance);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_ellipse_set *build(cairn_pool *pool, const cairn_ellipse_params *params)
{
    size_t ellipses = (size_t)params->max_ellipses;
    cairn_ellipse_set *set = cairn_object_take(pool, sizeof *set);

    CAIRN_TAKE(set, pool, accumulator, cells_of(params));
    CAIRN_TAKE(set, pool, peaks, ellipses);
    CAIRN_TAKE(set, pool, found, ellipses);
    CAIRN_TAKE(set, pool, result, ellipses);
    if (set != NULL) {
        set_params(set, params);
        set->accumulator_count = params->oriented ? 2 : 1;
    }
    return set;
}

CAIRN_OBJECT(ellipse, ellipse_set, build);

cairn_status cairn_ellipse_adjust(cairn_ellipse_set *set, const cairn_ellipse_params *params)
{
    if (set == NULL || cairn_ellipse_check(params, NULL) != CAIRN_OK ||
        params->max_ellipses != set->params.max_ellipses || params->cells != set->params.cells ||
        (params->oriented != 0) != (set->params.oriented != 0))
        return CAIRN_BAD_ARGUMENT;
    set->is_running = 0;
    set_params(set, params);
    return CAIRN_OK;
}

cairn_status cairn_ellipse_begin(cairn_ellipse_set *set, const cairn_oriented_point *points,
                                 const cairn_real *weights, int32_t count)
{
    if (set == NULL || count < 0 || (points == NULL && count > 0))
        return CAIRN_BAD_ARGUMENT;
    set->points = points;
    set->weights = weights;
    set->count = count;
    set->units_charged = 0;
    set->resume = set->phase_resume = 0;
    set->outcome = CAIRN_OK;
    set->is_running = 1;
    set->box = cairn_box_empty();
    set->peak_count = set->found_count = set->found_dropped = 0;
    return CAIRN_OK;
}

/* ---- Bounds ---- */

/* Sets the cells of the accumulators, which cover the bounding box of the points, and the
 * suppression radius. */
static void set_up_cells(cairn_ellipse_set *set)
{
    const cairn_ellipse_params *params = &set->params;
    cairn_vec2 size = {0, 0}, centre = {0, 0};
    cairn_real half;

    if (set->count > 0) {
        size = cairn_vec2_sub(set->box.max, set->box.min);
        centre = cairn_vec2_scale(cairn_vec2_add(set->box.max, set->box.min), CAIRN_REAL(0.5));
    }
    set->cell_size =
        cairn_max(params->cell_size, cairn_max(size.x, size.y) / (cairn_real)(params->cells - 3));
    half = set->cell_size * (cairn_real)(params->cells - 1) / 2;
    set->first_cell.x = centre.x - half;
    set->first_cell.y = centre.y - half;
    set->nms_radius = cairn_real_to_int(
        cairn_min(cairn_ceil(params->separation / set->cell_size), (cairn_real)params->cells));
}

/* Checks the next points, and extends the bounding box to them. */
static void check_points(cairn_ellipse_set *set)
{
    for (int32_t i = 0; i < CHECKED_PER_UNIT && set->cursor < set->count; i++, set->cursor++) {
        const cairn_oriented_point *point = &set->points[set->cursor];

        set->outcome = cairn_weighted_point_check(point, cairn_ellipse_weight(set, set->cursor));
        if (set->outcome != CAIRN_OK)
            return;
        set->box = cairn_box_extend(set->box, point->position);
    }
}

/* Bounding box of the points, and the cells that cover it. */
static int find_bounds(cairn_ellipse_set *set, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(set->phase_resume);
    for (set->cursor = 0; set->cursor < set->count && set->outcome == CAIRN_OK;) {
        CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
        check_points(set);
    }
    if (set->outcome == CAIRN_OK)
        set_up_cells(set);
    CAIRN_STEP_END(set->phase_resume);
}

/* ---- Votes ---- */

/* Sets the next cells of the accumulators to 0. */
static void clear_cells(cairn_ellipse_set *set, int32_t cells)
{
    int32_t chunk = cells - set->cursor < CLEARED_PER_UNIT ? cells - set->cursor : CLEARED_PER_UNIT;

    memset(&set->accumulator[set->cursor], 0, (size_t)chunk * sizeof *set->accumulator);
    set->cursor += chunk;
}

/* Accumulators without votes. */
static int clear(cairn_ellipse_set *set, cairn_budget *budget)
{
    int32_t cells = cells_of(&set->params);

    CAIRN_STEP_BEGIN(set->phase_resume);
    for (set->cursor = 0; set->cursor < cells;) {
        CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
        clear_cells(set, cells);
    }
    CAIRN_STEP_END(set->phase_resume);
}

/* Number of centres along a normal that a point votes for. */
static int32_t votes_per_point(const cairn_ellipse_set *set)
{
    cairn_real steps = (set->params.max_radius - set->params.min_radius) / set->cell_size;

    return cairn_real_to_int(cairn_min(steps, (cairn_real)(2 * set->params.cells))) + 1;
}

/* Votes for the centres along a unit normal from a point, a cell apart. */
static void vote_along(cairn_ellipse_set *set, int32_t layer, cairn_vec2 from, cairn_vec2 normal,
                       cairn_real weight)
{
    int32_t cells = set->params.cells, steps = votes_per_point(set);
    cairn_real *accumulator = &set->accumulator[layer * cells * cells],
               min_radius = set->params.min_radius / set->cell_size;
    cairn_real x =
        (from.x - set->first_cell.x) / set->cell_size + CAIRN_REAL(0.5) + normal.x * min_radius;
    cairn_real y =
        (from.y - set->first_cell.y) / set->cell_size + CAIRN_REAL(0.5) + normal.y * min_radius;

    for (int32_t k = 0; k < steps; k++) {
        if (x >= 0 && y >= 0 && x < (cairn_real)cells && y < (cairn_real)cells)
            accumulator[(int32_t)y * cells + (int32_t)x] += weight;
        x += normal.x;
        y += normal.y;
    }
}

/* Votes of the point at the cursor. */
static void vote_of_point(cairn_ellipse_set *set)
{
    const cairn_oriented_point *point = &set->points[set->cursor];
    cairn_vec2 normal = cairn_vec2_left_perp(cairn_vec2_unit(point->direction));
    cairn_real weight = cairn_ellipse_weight(set, set->cursor);

    if (!(weight > 0) || !(cairn_vec2_norm_squared(normal) > 0))
        return;
    vote_along(set, 0, point->position, normal, weight);
    vote_along(set, set->accumulator_count - 1, point->position, cairn_vec2_scale(normal, -1),
               weight);
}

/* Votes of all points. */
static int vote(cairn_ellipse_set *set, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(set->phase_resume);
    for (set->cursor = 0; set->cursor < set->count; set->cursor++) {
        CAIRN_STEP_CHARGE(set, phase_resume, budget, 1 + votes_per_point(set) / VOTES_PER_UNIT);
        vote_of_point(set);
    }
    CAIRN_STEP_END(set->phase_resume);
}

/* ---- Peaks ---- */

/* Smooths a line of cells with the kernel (1, 2, 1). */
static void smooth_line(cairn_real *first, int32_t stride, int32_t count)
{
    cairn_real before = 0;

    for (int32_t i = 0; i < count; i++) {
        cairn_real *cell = &first[i * stride], value = *cell,
                   after = i + 1 < count ? cell[stride] : 0;

        *cell = before + 2 * value + after;
        before = value;
    }
}

/* Smooths the line of cells at the cursor: of each accumulator the rows, then the columns. */
static void smooth_next_line(cairn_ellipse_set *set)
{
    int32_t cells = set->params.cells, line = set->cursor % (2 * cells);
    cairn_real *layer = &set->accumulator[set->cursor / (2 * cells) * cells * cells];

    if (line < cells)
        smooth_line(&layer[line * cells], 1, cells);
    else
        smooth_line(&layer[line - cells], cells, cells);
}

/* Smoothed votes (separable filter). */
static int smooth(cairn_ellipse_set *set, cairn_budget *budget)
{
    int32_t cells = set->params.cells;

    CAIRN_STEP_BEGIN(set->phase_resume);
    for (set->cursor = 0; set->cursor < 2 * cells * set->accumulator_count; set->cursor++) {
        CAIRN_STEP_CHARGE(set, phase_resume, budget, 1 + cells / SMOOTHED_PER_UNIT);
        smooth_next_line(set);
    }
    CAIRN_STEP_END(set->phase_resume);
}

/* 1 when a cell is a local maximum: no cell within the suppression radius has more votes, or as
 * many and a lower index. */
static int is_peak(const cairn_ellipse_set *set, int32_t cell)
{
    int32_t cells = set->params.cells, layer = cell - cell % (cells * cells);
    int32_t row = (cell - layer) / cells, column = (cell - layer) % cells;
    int32_t left = column > set->nms_radius ? column - set->nms_radius : 0;
    int32_t right = cells - 1 - column > set->nms_radius ? column + set->nms_radius : cells - 1;
    int32_t low = row > set->nms_radius ? row - set->nms_radius : 0;
    int32_t high = cells - 1 - row > set->nms_radius ? row + set->nms_radius : cells - 1;

    for (int32_t i = low; i <= high; i++)
        for (int32_t k = layer + i * cells + left; k <= layer + i * cells + right; k++)
            if (set->accumulator[k] > set->accumulator[cell] ||
                (k < cell && set->accumulator[k] == set->accumulator[cell]))
                return 0;
    return 1;
}

static void insert_peak(cairn_ellipse_set *set, int32_t cell)
{
    int32_t cells = set->params.cells;
    ellipse_peak p = {set->accumulator[cell], cell / (cells * cells), cell / cells % cells,
                      cell % cells};
    ranked_list peaks = {.entries = set->peaks,
                         .count = &set->peak_count,
                         .capacity = set->params.max_ellipses,
                         .entry_bytes = sizeof p,
                         .score_at = offsetof(ellipse_peak, votes)};

    set->found_dropped += set->peak_count == set->params.max_ellipses;
    (void)ranked_list_add(&peaks, &p);
}

/* 1 when a cell has enough votes for a peak. The smoothing multiplies votes within one cell by 4,
 * and votes spread over 4 x 4 cells by 1. */
static int is_above_threshold(const cairn_ellipse_set *set, int32_t cell)
{
    return set->accumulator[cell] >= set->params.min_votes;
}

/* Skips the next cells without enough votes. */
static void skip_cells(cairn_ellipse_set *set, int32_t cells)
{
    for (int32_t i = 0;
         i < SKIPPED_PER_UNIT && set->cursor < cells && !is_above_threshold(set, set->cursor); i++)
        set->cursor++;
}

/* Local maxima of the accumulators. */
static int find_peaks(cairn_ellipse_set *set, cairn_budget *budget)
{
    int32_t cells = cells_of(&set->params), width = 2 * set->nms_radius + 1;

    CAIRN_STEP_BEGIN(set->phase_resume);
    for (set->cursor = 0; set->cursor < cells;)
        if (is_above_threshold(set, set->cursor)) {
            CAIRN_STEP_CHARGE(set, phase_resume, budget, 1 + width * width / COMPARED_PER_UNIT);
            if (is_peak(set, set->cursor)) {
                CAIRN_STEP_CHARGE(set, phase_resume, budget, 1 + set->peak_count / 8);
                insert_peak(set, set->cursor);
            }
            set->cursor++;
        } else {
            CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
            skip_cells(set, cells);
        }
    CAIRN_STEP_END(set->phase_resume);
}

/* ---- Search ---- */

/* 1 when two ellipses of a kind coincide. */
static int is_duplicate(const void *context, const void *entry, const void *other)
{
    const cairn_ellipse_set *set = context;
    const cairn_ellipse *a = other, *b = entry;
    cairn_vec2 offset = {a->centre.x - b->centre.x, a->centre.y - b->centre.y};

    return a->kind == b->kind && cairn_vec2_norm(offset) < set->params.separation &&
           cairn_abs(a->half_length - b->half_length) < set->params.separation &&
           cairn_abs(a->half_width - b->half_width) < set->params.separation;
}

/* Non-maximum suppression: drops ellipses that coincide with one of more votes, and publishes the
 * rest as the result. */
static void suppress(cairn_ellipse_set *set)
{
    cairn_ellipse *list = set->result;
    ranked_list ellipses = {.entries = set->found,
                            .count = &set->found_count,
                            .entry_bytes = sizeof *set->found,
                            .is_near = is_duplicate,
                            .context = set};

    ranked_list_suppress_all(&ellipses);
    set->result = set->found;
    set->result_count = set->found_count;
    set->result_dropped = set->found_dropped;
    set->found = list;
}

/* The search: see Method in the head of this file. */
static int search(cairn_ellipse_set *set, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(set->resume);
    CAIRN_STEP_RUN(set, resume, budget, find_bounds);
    if (set->outcome == CAIRN_OK) {
        CAIRN_STEP_RUN(set, resume, budget, clear);
        CAIRN_STEP_RUN(set, resume, budget, vote);
        CAIRN_STEP_RUN(set, resume, budget, smooth);
        CAIRN_STEP_RUN(set, resume, budget, find_peaks);
        CAIRN_STEP_RUN(set, resume, budget, cairn_ellipse_refine);
        CAIRN_STEP_CHARGE(set, resume, budget, 1 + set->found_count * set->found_count / 8);
        suppress(set);
    }
    CAIRN_STEP_END(set->resume);
}

cairn_status cairn_ellipse_step(cairn_ellipse_set *set, cairn_budget *budget)
{
    if (set == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!set->is_running)
        return CAIRN_OK;
    if (!search(set, budget))
        return CAIRN_MORE;
    set->is_running = 0;
    return set->outcome;
}

const cairn_ellipse *cairn_ellipse_list(const cairn_ellipse_set *set, int32_t *count)
{
    *count = set->result_count;
    return set->result;
}

int32_t cairn_ellipse_dropped(const cairn_ellipse_set *set)
{
    return set->result_dropped;
}
