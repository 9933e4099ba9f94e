/* Hough transform of oriented points: weighted votes for lines, and the peaks of the accumulator.
 *
 * Method:
 * 1. Rows of the accumulator are directions, columns signed distances from the centre of the
 *    points' bounding box. A point votes in all rows near its own direction, with a weight that
 *    decreases with the angle. In each row it votes for the two columns around its distance (linear
 *    interpolation), so peaks are smooth. Without orientation a row equals the one half a turn away
 *    with the columns reversed.
 * 2. Peaks are the local maxima within the separation (non-maximum suppression).
 * 3. Each peak is refined by two weighted regressions across its line, in the frame of the line,
 *    which keeps precision in float. A third pass measures the inliers (hough_lines.c).
 * 4. Lines that coincide with a line of more votes are suppressed (hough_lines.c).
 *
 * As written a point votes for one column of every row, and the inliers of a line are the points of
 * the peak's bin.
 *
 * Layout: directions of the rows; the accumulator; a bit per position along the current line; the
 * peaks; two lists of lines, one of the search that runs and one of the last result.
 *
 * Limits: columns are wider when the points extend too far. Votes are sums of reals in the order of
 * the points. Lines over hundreds of metres whose points are off by half a row's angle have no
 * peak; use more rows.
 *
 * Source: Hough 1962; Ballard 1981; Adluru 2008, section 8.4.1. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/ranked_list.h"
#include "src/shapes/hough_work.h"

/* Largest absolute coordinate in m, and largest weight. */
#define MAX_MAGNITUDE CAIRN_REAL(1e6)

/* Phases of a search. */
enum { PHASE_IDLE, PHASE_BOUNDS, PHASE_CLEAR, PHASE_VOTE, PHASE_PEAKS, PHASE_FIT, PHASE_SUPPRESS };

cairn_hough_params cairn_hough_default(void)
{
    cairn_hough_params params = {
        .max_lines = 32,
        .angles = 180,
        .distances = 256,
        .distance_step = CAIRN_REAL(0.05),
        .oriented = 1,
        .mode = CAIRN_MODE_DEFAULT,
        .angle_tolerance = 10 * (CAIRN_PI / 180),
        .separation = CAIRN_REAL(0.20),
        .separation_angle = 10 * (CAIRN_PI / 180),
        .support_distance = CAIRN_REAL(0.05),
        .spacing = CAIRN_REAL(0.10),
        .min_votes = 20,
    };
    return params;
}

cairn_hough_params cairn_hough_as_written(void)
{
    cairn_hough_params params = cairn_hough_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    params.oriented = 0;
    params.distance_step = CAIRN_REAL(0.10);
    return params;
}

/* The params, with the fields that the mode as written ignores set to its values. */
static cairn_hough_params params_in_mode(const cairn_hough_params *params)
{
    cairn_hough_params p = *params;

    if (p.mode == CAIRN_MODE_AS_WRITTEN) {
        p.oriented = 0;
        p.angle_tolerance = CAIRN_PI / 2;
        p.support_distance = p.distance_step;
    }
    return p;
}

/* 1 for a length in m that is allowed. */
static int is_length(cairn_real x)
{
    return x > 0 && x <= MAX_MAGNITUDE;
}

/* 1 for an angle in rad that is allowed. */
static int is_angle(cairn_real x)
{
    return x > 0 && x <= CAIRN_PI / 2;
}

/* 1 when all params are in range. */
static int params_are_valid(const cairn_hough_params *params)
{
    return params->max_lines >= 1 && params->max_lines <= 256 && params->angles >= 8 &&
           params->angles <= 1 << 12 && params->distances >= 8 && params->distances <= 1 << 14 &&
           is_length(params->distance_step) && is_angle(params->angle_tolerance) &&
           is_length(params->separation) && is_angle(params->separation_angle) &&
           is_length(params->support_distance) && is_length(params->spacing) &&
           params->min_votes > 0 && cairn_is_finite(params->min_votes) &&
           (params->mode == CAIRN_MODE_DEFAULT || params->mode == CAIRN_MODE_AS_WRITTEN);
}

/* Rows of the accumulator: over a full turn when oriented, else over half a turn. */
static int32_t rows_of(const cairn_hough_params *params)
{
    return params->oriented ? 2 * params->angles : params->angles;
}

/* Allocates the object and its arrays; NULL from a counting pool. */
static cairn_hough *carve(cairn_pool *pool, const cairn_hough_params *params)
{
    size_t rows = (size_t)rows_of(params), columns = (size_t)params->distances,
           lines = (size_t)params->max_lines;
    cairn_hough *hough = cairn_pool_take_one(pool, sizeof *hough);
    cairn_vec2 *direction = cairn_pool_take(pool, rows, sizeof *direction);
    cairn_real *votes = cairn_pool_take(pool, rows * columns, sizeof *votes);
    uint32_t *occupied = cairn_pool_take(pool, (columns + 31) / 32, sizeof *occupied);
    hough_peak *peaks = cairn_pool_take(pool, lines, sizeof *peaks);
    cairn_hough_line *found = cairn_pool_take(pool, lines, sizeof *found);
    cairn_hough_line *result = cairn_pool_take(pool, lines, sizeof *result);

    if (hough != NULL) {
        memset(hough, 0, sizeof *hough);
        hough->direction = direction;
        hough->accumulator = votes;
        hough->occupied = occupied;
        hough->peaks = peaks;
        hough->found = found;
        hough->result = result;
    }
    return hough;
}

size_t cairn_hough_memory(const cairn_hough_params *params)
{
    cairn_hough_params used;
    cairn_pool counting;

    if (params == NULL)
        return 0;
    used = params_in_mode(params);
    if (!params_are_valid(&used))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, &used);
    return cairn_pool_counted(&counting);
}

/* Copies the params, and computes the sines. */
static void set_params(cairn_hough *hough, const cairn_hough_params *params)
{
    hough->params = *params;
    hough->sine_tolerance = cairn_sin(params->angle_tolerance);
    hough->sine_separation = cairn_sin(params->separation_angle);
}

cairn_status cairn_hough_create(cairn_hough **hough, cairn_pool *pool,
                                const cairn_hough_params *params)
{
    size_t need = cairn_hough_memory(params);
    cairn_hough_params used;
    cairn_hough *made;

    if (hough == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_capacity(pool, need))
        return CAIRN_NO_MEMORY;
    used = params_in_mode(params);
    made = carve(pool, &used);
    set_params(made, &used);
    made->rows = rows_of(&used);
    made->angle_step = CAIRN_PI / (cairn_real)used.angles;
    for (int32_t row = 0; row < made->rows; row++)
        cairn_sincos((cairn_real)row * made->angle_step, &made->direction[row].y,
                     &made->direction[row].x);
    *hough = made;
    return CAIRN_OK;
}

cairn_status cairn_hough_adjust(cairn_hough *hough, const cairn_hough_params *params)
{
    cairn_hough_params used;

    if (hough == NULL || params == NULL)
        return CAIRN_BAD_ARGUMENT;
    used = params_in_mode(params);
    if (!params_are_valid(&used) || used.max_lines != hough->params.max_lines ||
        used.angles != hough->params.angles || used.distances != hough->params.distances ||
        (used.oriented != 0) != (hough->params.oriented != 0) || used.mode != hough->params.mode)
        return CAIRN_BAD_ARGUMENT;
    hough->phase = PHASE_IDLE;
    set_params(hough, &used);
    return CAIRN_OK;
}

cairn_status cairn_hough_begin(cairn_hough *hough, const cairn_oriented_point *points,
                               const cairn_real *weights, int32_t count)
{
    if (hough == NULL || count < 0 || (points == NULL && count > 0))
        return CAIRN_BAD_ARGUMENT;
    hough->points = points;
    hough->weights = weights;
    hough->count = count;
    hough->cursor = 0;
    hough->box.min.x = hough->box.min.y = MAX_MAGNITUDE;
    hough->box.max.x = hough->box.max.y = -MAX_MAGNITUDE;
    hough->peak_count = 0;
    hough->found_count = 0;
    hough->found_dropped = 0;
    hough->phase = PHASE_BOUNDS;
    return CAIRN_OK;
}

/* ---- Bounds ---- */

/* CAIRN_OK when a point and its weight are in range. */
static cairn_status check_point(const cairn_oriented_point *point, cairn_real weight)
{
    if (!cairn_vec2_is_finite(point->position) || !cairn_vec2_is_finite(point->direction) ||
        !cairn_is_finite(weight))
        return CAIRN_NOT_FINITE;
    if (cairn_abs(point->position.x) > MAX_MAGNITUDE ||
        cairn_abs(point->position.y) > MAX_MAGNITUDE || weight < 0 || weight > MAX_MAGNITUDE)
        return CAIRN_BAD_ARGUMENT;
    return CAIRN_OK;
}

/* Sets the centre, the width of a column and the non-maximum suppression radius. */
static void set_up_columns(cairn_hough *hough)
{
    const cairn_hough_params *params = &hough->params;
    cairn_vec2 half =
        cairn_vec2_scale(cairn_vec2_sub(hough->box.max, hough->box.min), CAIRN_REAL(0.5));
    cairn_real radius = hough->count > 0 ? cairn_vec2_norm(half) : 0;

    hough->centre = cairn_vec2_add(hough->box.min, half);
    hough->bin_width =
        cairn_max(params->distance_step, 2 * radius / (cairn_real)(params->distances - 3));
    hough->row_radius = cairn_real_to_int(cairn_ceil(params->separation_angle / hough->angle_step));
    hough->column_radius = cairn_real_to_int(cairn_ceil(params->separation / hough->bin_width));
    if (hough->column_radius > params->distances)
        hough->column_radius = params->distances;
}

/* Phase BOUNDS: checks the points and computes their bounding box. */
static cairn_status step_bounds(cairn_hough *hough, cairn_budget *budget)
{
    while (hough->cursor < hough->count) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        for (int32_t i = 0; i < 4 && hough->cursor < hough->count; i++, hough->cursor++) {
            const cairn_oriented_point *point = &hough->points[hough->cursor];
            cairn_status status = check_point(point, cairn_hough_weight(hough, hough->cursor));

            if (status != CAIRN_OK)
                return status;
            hough->box.min.x = cairn_min(hough->box.min.x, point->position.x);
            hough->box.min.y = cairn_min(hough->box.min.y, point->position.y);
            hough->box.max.x = cairn_max(hough->box.max.x, point->position.x);
            hough->box.max.y = cairn_max(hough->box.max.y, point->position.y);
        }
    }
    set_up_columns(hough);
    return CAIRN_OK;
}

/* ---- Votes ---- */

/* Phase CLEAR: sets the accumulator to 0. */
static cairn_status step_clear(cairn_hough *hough, cairn_budget *budget)
{
    int32_t bins = hough->rows * hough->params.distances;

    while (hough->cursor < bins) {
        int32_t chunk = bins - hough->cursor < 128 ? bins - hough->cursor : 128;

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        memset(&hough->accumulator[hough->cursor], 0, (size_t)chunk * sizeof *hough->accumulator);
        hough->cursor += chunk;
    }
    return CAIRN_OK;
}

/* Votes in a row for the two columns around a point, relative to the centre in m. */
static void vote_in_row(cairn_hough *hough, int32_t row, cairn_vec2 p, cairn_real weight)
{
    cairn_real at = cairn_hough_column(hough, cairn_vec2_cross(hough->direction[row], p)),
               low = cairn_floor(at);
    cairn_real *bin = &hough->accumulator[row * hough->params.distances + cairn_real_to_int(low)];

    CAIRN_ASSERT(low >= 0 && low < (cairn_real)(hough->params.distances - 1));
    bin[0] += weight * (1 - (at - low));
    bin[1] += weight * (at - low);
}

/* Rows in which a point of a direction votes: first ... last, which may be below 0 or beyond the
 * last row. Returns the direction in rows. */
static cairn_real rows_near_direction(const cairn_hough *hough, cairn_vec2 direction,
                                      int32_t *first, int32_t *last)
{
    cairn_real centre = cairn_atan2(direction.y, direction.x) / hough->angle_step;
    cairn_real row_tolerance = hough->params.angle_tolerance / hough->angle_step;

    *first = cairn_real_to_int(cairn_ceil(centre - row_tolerance));
    *last = cairn_real_to_int(cairn_floor(centre + row_tolerance));
    return centre;
}

/* Votes in the rows first ... last, with weights that decrease with the angle to the direction. */
static void vote_near_direction(cairn_hough *hough, cairn_vec2 p, cairn_real weight,
                                cairn_real centre, int32_t first, int32_t last)
{
    cairn_real row_tolerance = hough->params.angle_tolerance / hough->angle_step;

    for (int32_t i = first; i <= last; i++) {
        cairn_real share = 1 - cairn_abs((cairn_real)i - centre) / row_tolerance;
        int32_t row = (i + 2 * hough->rows) % hough->rows;

        if (share > 0)
            vote_in_row(hough, row, p, weight * share);
    }
}

/* As written: votes for one column in every row. */
static void vote_as_written(cairn_hough *hough, cairn_vec2 p, cairn_real weight)
{
    for (int32_t row = 0; row < hough->rows; row++) {
        int32_t column = cairn_hough_bin(hough, row, p);

        CAIRN_ASSERT(column >= 0 && column < hough->params.distances);
        hough->accumulator[row * hough->params.distances + column] += weight;
    }
}

/* Phase VOTE, as written. */
static cairn_status step_vote_as_written(cairn_hough *hough, cairn_budget *budget)
{
    for (; hough->cursor < hough->count; hough->cursor++) {
        cairn_vec2 p = cairn_vec2_sub(hough->points[hough->cursor].position, hough->centre);

        if (!cairn_budget_charge(budget, &hough->units_charged, 2 + hough->rows / 4))
            return CAIRN_MORE;
        vote_as_written(hough, p, cairn_hough_weight(hough, hough->cursor));
    }
    return CAIRN_OK;
}

/* Phase VOTE. */
static cairn_status step_vote(cairn_hough *hough, cairn_budget *budget)
{
    for (; hough->cursor < hough->count; hough->cursor++) {
        const cairn_oriented_point *point = &hough->points[hough->cursor];
        cairn_real weight = cairn_hough_weight(hough, hough->cursor), centre;
        int32_t first, last;

        if (budget->left <= 0)
            return CAIRN_MORE;
        centre = rows_near_direction(hough, point->direction, &first, &last);
        if (!cairn_budget_charge(budget, &hough->units_charged, 2 + (last - first) / 4))
            return CAIRN_MORE;
        if (weight > 0 && cairn_vec2_norm_squared(point->direction) > 0)
            vote_near_direction(hough, cairn_vec2_sub(point->position, hough->centre), weight,
                                centre, first, last);
    }
    return CAIRN_OK;
}

/* ---- Peaks ---- */

/* 1 when (row, column) is a local maximum: no bin within the suppression radius has more votes, or
 * as many and a lower index. */
static int is_peak(const cairn_hough *hough, int32_t row, int32_t column)
{
    int32_t columns = hough->params.distances, bin = row * columns + column;
    cairn_real votes = hough->accumulator[bin];

    for (int32_t i = -hough->row_radius; i <= hough->row_radius; i++) {
        int32_t other = (row + i + hough->rows) % hough->rows;
        int32_t is_reversed = !hough->params.oriented && other != row + i;
        int32_t centre = is_reversed ? columns - 1 - column : column;
        int32_t from = centre > hough->column_radius ? centre - hough->column_radius : 0;
        int32_t to = columns - 1 - centre > hough->column_radius ? centre + hough->column_radius
                                                                 : columns - 1;

        for (int32_t j = other * columns + from; j <= other * columns + to; j++)
            if (hough->accumulator[j] > votes || (j < bin && hough->accumulator[j] == votes))
                return 0;
    }
    return 1;
}

static void insert_peak(cairn_hough *hough, int32_t row, int32_t column)
{
    hough_peak p = {hough->accumulator[row * hough->params.distances + column], row, column};
    ranked_list peaks = {.entries = hough->peaks,
                         .count = &hough->peak_count,
                         .capacity = hough->params.max_lines,
                         .entry_bytes = sizeof p,
                         .score_at = offsetof(hough_peak, votes)};

    hough->found_dropped += hough->peak_count == hough->params.max_lines;
    (void)ranked_list_add(&peaks, &p);
}

/* 1 when a bin has enough votes for a peak. A line between two columns has half of its votes in
 * each, and fewer between two rows; as written it has all votes in one bin. */
static int is_above_threshold(const cairn_hough *hough, int32_t bin)
{
    cairn_real share = cairn_hough_is_as_written(hough) ? 1 : CAIRN_REAL(0.4);

    return hough->accumulator[bin] >= share * hough->params.min_votes;
}

/* Phase PEAKS: finds the local maxima of the accumulator. */
static cairn_status step_peaks(cairn_hough *hough, cairn_budget *budget)
{
    int32_t columns = hough->params.distances, bins = hough->rows * columns;
    int32_t window_bins = (2 * hough->row_radius + 1) * (2 * hough->column_radius + 1);

    while (hough->cursor < bins) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        if (!is_above_threshold(hough, hough->cursor)) {
            budget->left--;
            for (int32_t i = 0;
                 i < 32 && hough->cursor < bins && !is_above_threshold(hough, hough->cursor); i++)
                hough->cursor++;
            continue;
        }
        if (!cairn_budget_charge(budget, &hough->units_charged,
                                 2 + window_bins / 16 + hough->peak_count / 8))
            return CAIRN_MORE;
        if (is_peak(hough, hough->cursor / columns, hough->cursor % columns))
            insert_peak(hough, hough->cursor / columns, hough->cursor % columns);
        hough->cursor++;
    }
    return CAIRN_OK;
}

/* ---- Search ---- */

/* Works on the current phase. CAIRN_OK: the phase has ended. */
static cairn_status step_phase(cairn_hough *hough, cairn_budget *budget)
{
    switch (hough->phase) {
    case PHASE_BOUNDS:
        return step_bounds(hough, budget);
    case PHASE_CLEAR:
        return step_clear(hough, budget);
    case PHASE_VOTE:
        return cairn_hough_is_as_written(hough) ? step_vote_as_written(hough, budget)
                                                : step_vote(hough, budget);
    case PHASE_PEAKS:
        return step_peaks(hough, budget);
    case PHASE_FIT:
        return cairn_hough_fit_lines(hough, budget);
    default:
        return cairn_hough_suppress_lines(hough, budget);
    }
}

cairn_status cairn_hough_step(cairn_hough *hough, cairn_budget *budget)
{
    if (hough == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (hough->phase != PHASE_IDLE) {
        cairn_status status = step_phase(hough, budget);

        if (status == CAIRN_MORE)
            return status;
        hough->phase = status < 0 || hough->phase == PHASE_SUPPRESS ? PHASE_IDLE : hough->phase + 1;
        if (status < 0)
            return status;
        hough->cursor = 0;
        hough->units_charged = 0;
        if (hough->phase == PHASE_FIT)
            cairn_hough_begin_lines(hough);
    }
    return CAIRN_OK;
}

const cairn_hough_line *cairn_hough_list(const cairn_hough *hough, int32_t *count)
{
    *count = hough->result_count;
    return hough->result;
}

int32_t cairn_hough_dropped(const cairn_hough *hough)
{
    return hough->result_dropped;
}

cairn_segment cairn_hough_segment(const cairn_hough_line *line)
{
    cairn_segment segment = {
        cairn_vec2_add(line->point, cairn_vec2_scale(line->direction, line->low)),
        cairn_vec2_add(line->point, cairn_vec2_scale(line->direction, line->high))};
    return segment;
}
