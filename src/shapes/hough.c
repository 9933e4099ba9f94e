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

/* Bins cleared for one work unit, and bins below the threshold that are skipped for one. */
enum { CLEARED_PER_UNIT = 128, SKIPPED_PER_UNIT = 32 };

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_hough_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_hough_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter parameter_rows[] = {
    INTEGER(max_lines, 32, 1, 256),
    INTEGER(angles, 180, 8, 1 << 12),
    INTEGER(distances, 256, 8, 1 << 14),
    POSITIVE(distance_step, CAIRN_REAL(0.05), 0, CAIRN_MAX_MAGNITUDE),
    INTEGER(oriented, 1, 0, 1),
    INTEGER(mode, CAIRN_MODE_DEFAULT, CAIRN_MODE_DEFAULT, CAIRN_MODE_AS_WRITTEN),
    POSITIVE(angle_tolerance, 10 * (CAIRN_PI / 180), 0, CAIRN_PI / 2),
    POSITIVE(separation, CAIRN_REAL(0.20), 0, CAIRN_MAX_MAGNITUDE),
    POSITIVE(separation_angle, 10 * (CAIRN_PI / 180), 0, CAIRN_PI / 2),
    POSITIVE(support_distance, CAIRN_REAL(0.05), 0, CAIRN_MAX_MAGNITUDE),
    POSITIVE(spacing, CAIRN_REAL(0.10), 0, CAIRN_MAX_MAGNITUDE),
    POSITIVE(min_votes, 20, 0, CAIRN_REAL_MAX),
};
const cairn_parameters cairn_hough_parameters =
    CAIRN_PARAMETERS("hough", cairn_hough_params, parameter_rows);

cairn_hough_params cairn_hough_default(void)
{
    cairn_hough_params params;

    cairn_parameters_preset(&cairn_hough_parameters, &params);
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

cairn_status cairn_hough_check(const cairn_hough_params *params, cairn_object_fault *fault)
{
    cairn_hough_params used;

    if (params == NULL)
        return cairn_parameters_check(&cairn_hough_parameters, NULL, fault);
    used = params_in_mode(params);
    return cairn_parameters_check(&cairn_hough_parameters, &used, fault);
}

/* Rows of the accumulator: over a full turn when oriented, else over half a turn. */
static int32_t rows_of(const cairn_hough_params *params)
{
    return params->oriented ? 2 * params->angles : params->angles;
}

/* Copies the params, and computes the sines. */
static void set_params(cairn_hough *hough, const cairn_hough_params *params)
{
    hough->params = *params;
    hough->sine_tolerance = cairn_sin(params->angle_tolerance);
    hough->sine_separation = cairn_sin(params->separation_angle);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_hough *build(cairn_pool *pool, const cairn_hough_params *params)
{
    cairn_hough_params used = params_in_mode(params);
    size_t rows = (size_t)rows_of(&used), columns = (size_t)used.distances,
           lines = (size_t)used.max_lines;
    cairn_hough *hough = cairn_object_take(pool, sizeof *hough);

    CAIRN_TAKE(hough, pool, direction, rows);
    CAIRN_TAKE(hough, pool, accumulator, rows * columns);
    CAIRN_TAKE(hough, pool, occupied, (columns + 31) / 32);
    CAIRN_TAKE(hough, pool, peaks, lines);
    CAIRN_TAKE(hough, pool, found, lines);
    CAIRN_TAKE(hough, pool, result, lines);
    if (hough != NULL) {
        set_params(hough, &used);
        hough->rows = (int32_t)rows;
        hough->angle_step = CAIRN_PI / (cairn_real)used.angles;
        for (int32_t row = 0; row < hough->rows; row++)
            cairn_sincos((cairn_real)row * hough->angle_step, &hough->direction[row].y,
                         &hough->direction[row].x);
    }
    return hough;
}

CAIRN_OBJECT(hough, hough, build);

cairn_status cairn_hough_adjust(cairn_hough *hough, const cairn_hough_params *params)
{
    cairn_hough_params used;

    if (hough == NULL || cairn_hough_check(params, NULL) != CAIRN_OK)
        return CAIRN_BAD_ARGUMENT;
    used = params_in_mode(params);
    if (used.max_lines != hough->params.max_lines || used.angles != hough->params.angles ||
        used.distances != hough->params.distances ||
        (used.oriented != 0) != (hough->params.oriented != 0) || used.mode != hough->params.mode)
        return CAIRN_BAD_ARGUMENT;
    hough->is_running = 0;
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
    hough->box.min.x = hough->box.min.y = CAIRN_MAX_MAGNITUDE;
    hough->box.max.x = hough->box.max.y = -CAIRN_MAX_MAGNITUDE;
    hough->peak_count = 0;
    hough->found_count = 0;
    hough->found_dropped = 0;
    hough->outcome = CAIRN_OK;
    hough->units_charged = 0;
    hough->resume = hough->phase_resume = 0;
    hough->is_running = 1;
    return CAIRN_OK;
}

/* ---- Bounds ---- */

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

/* Checks the next points, and enlarges the bounding box by them. */
static void add_to_box(cairn_hough *hough)
{
    int32_t first = hough->cursor;

    for (int32_t i = first;
         i < hough->count && i - first < HOUGH_POINTS_PER_UNIT && hough->outcome == CAIRN_OK; i++) {
        cairn_vec2 p = hough->points[i].position;

        hough->outcome =
            cairn_weighted_point_check(&hough->points[i], cairn_hough_weight(hough, i));
        hough->box.min.x = cairn_min(hough->box.min.x, p.x);
        hough->box.min.y = cairn_min(hough->box.min.y, p.y);
        hough->box.max.x = cairn_max(hough->box.max.x, p.x);
        hough->box.max.y = cairn_max(hough->box.max.y, p.y);
    }
}

/* Checks the points and computes their bounding box. */
static int find_bounds(cairn_hough *hough, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(hough->phase_resume);
    for (hough->cursor = 0; hough->cursor < hough->count && hough->outcome == CAIRN_OK;
         hough->cursor += HOUGH_POINTS_PER_UNIT) {
        CAIRN_STEP_CHARGE_UNIT(hough, phase_resume, budget);
        add_to_box(hough);
    }
    if (hough->outcome == CAIRN_OK)
        set_up_columns(hough);
    CAIRN_STEP_END(hough->phase_resume);
}

/* ---- Votes ---- */

/* Sets the next bins to 0. */
static void clear_bins(cairn_hough *hough, int32_t bins)
{
    int32_t left = bins - hough->cursor, count = left < CLEARED_PER_UNIT ? left : CLEARED_PER_UNIT;

    memset(&hough->accumulator[hough->cursor], 0, (size_t)count * sizeof *hough->accumulator);
}

/* Sets the accumulator to 0. */
static int clear(cairn_hough *hough, cairn_budget *budget)
{
    int32_t bins = hough->rows * hough->params.distances;

    CAIRN_STEP_BEGIN(hough->phase_resume);
    for (hough->cursor = 0; hough->cursor < bins; hough->cursor += CLEARED_PER_UNIT) {
        CAIRN_STEP_CHARGE_UNIT(hough, phase_resume, budget);
        clear_bins(hough, bins);
    }
    CAIRN_STEP_END(hough->phase_resume);
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

/* Sets the rows in which a point votes: those near its direction. */
static void set_rows(cairn_hough *hough, const cairn_oriented_point *point)
{
    cairn_real row_tolerance = hough->params.angle_tolerance / hough->angle_step;

    hough->direction_row = cairn_atan2(point->direction.y, point->direction.x) / hough->angle_step;
    hough->first_row = cairn_real_to_int(cairn_ceil(hough->direction_row - row_tolerance));
    hough->last_row = cairn_real_to_int(cairn_floor(hough->direction_row + row_tolerance));
}

/* Votes in these rows, with weights that decrease with the angle to the direction of the point. */
static void vote_in_rows(cairn_hough *hough, const cairn_oriented_point *point, cairn_real weight)
{
    cairn_real row_tolerance = hough->params.angle_tolerance / hough->angle_step;
    cairn_vec2 p = cairn_vec2_sub(point->position, hough->centre);

    if (!(weight > 0 && cairn_vec2_norm_squared(point->direction) > 0))
        return;
    for (int32_t i = hough->first_row; i <= hough->last_row; i++) {
        cairn_real share = 1 - cairn_abs((cairn_real)i - hough->direction_row) / row_tolerance;
        int32_t row = (i + 2 * hough->rows) % hough->rows;

        if (share > 0)
            vote_in_row(hough, row, p, weight * share);
    }
}

/* Votes of the points. */
static int vote(cairn_hough *hough, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(hough->phase_resume);
    for (hough->cursor = 0; hough->cursor < hough->count; hough->cursor++) {
        set_rows(hough, &hough->points[hough->cursor]);
        CAIRN_STEP_CHARGE(hough, phase_resume, budget,
                          2 + (hough->last_row - hough->first_row) / 4);
        vote_in_rows(hough, &hough->points[hough->cursor],
                     cairn_hough_weight(hough, hough->cursor));
    }
    CAIRN_STEP_END(hough->phase_resume);
}

/* As written: point i votes for one column in every row. */
static void vote_in_every_row(cairn_hough *hough, int32_t i)
{
    cairn_vec2 p = cairn_vec2_sub(hough->points[i].position, hough->centre);
    cairn_real weight = cairn_hough_weight(hough, i);

    for (int32_t row = 0; row < hough->rows; row++) {
        int32_t column = cairn_hough_bin(hough, row, p);

        CAIRN_ASSERT(column >= 0 && column < hough->params.distances);
        hough->accumulator[row * hough->params.distances + column] += weight;
    }
}

/* Votes of the points, as written. */
static int vote_as_written(cairn_hough *hough, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(hough->phase_resume);
    for (hough->cursor = 0; hough->cursor < hough->count; hough->cursor++) {
        CAIRN_STEP_CHARGE(hough, phase_resume, budget, 2 + hough->rows / 4);
        vote_in_every_row(hough, hough->cursor);
    }
    CAIRN_STEP_END(hough->phase_resume);
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

/* Skips the next bins below the threshold. */
static void skip_bins(cairn_hough *hough, int32_t bins)
{
    for (int32_t i = 0;
         i < SKIPPED_PER_UNIT && hough->cursor < bins && !is_above_threshold(hough, hough->cursor);
         i++)
        hough->cursor++;
}

/* Tests the next bin for a peak. */
static void test_bin(cairn_hough *hough)
{
    int32_t row = hough->cursor / hough->params.distances,
            column = hough->cursor % hough->params.distances;

    if (is_peak(hough, row, column))
        insert_peak(hough, row, column);
    hough->cursor++;
}

/* Local maxima of the accumulator. */
static int find_peaks(cairn_hough *hough, cairn_budget *budget)
{
    int32_t bins = hough->rows * hough->params.distances;
    int32_t window_bins = (2 * hough->row_radius + 1) * (2 * hough->column_radius + 1);

    CAIRN_STEP_BEGIN(hough->phase_resume);
    hough->cursor = 0;
    while (hough->cursor < bins)
        if (is_above_threshold(hough, hough->cursor)) {
            CAIRN_STEP_CHARGE(hough, phase_resume, budget,
                              2 + window_bins / 16 + hough->peak_count / 8);
            test_bin(hough);
        } else {
            CAIRN_STEP_CHARGE_UNIT(hough, phase_resume, budget);
            skip_bins(hough, bins);
        }
    CAIRN_STEP_END(hough->phase_resume);
}

/* ---- Search ---- */

/* The search: see Method in the head of this file. */
static int search(cairn_hough *hough, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(hough->resume);
    CAIRN_STEP_RUN(hough, resume, budget, find_bounds);
    if (hough->outcome == CAIRN_OK) {
        CAIRN_STEP_RUN(hough, resume, budget, clear);
        if (cairn_hough_is_as_written(hough))
            CAIRN_STEP_RUN(hough, resume, budget, vote_as_written);
        else
            CAIRN_STEP_RUN(hough, resume, budget, vote);
        CAIRN_STEP_RUN(hough, resume, budget, find_peaks);
        CAIRN_STEP_RUN(hough, resume, budget, cairn_hough_fit_lines);
        CAIRN_STEP_CHARGE(hough, resume, budget, 1 + hough->found_count * hough->found_count / 8);
        cairn_hough_suppress_lines(hough);
    }
    CAIRN_STEP_END(hough->resume);
}

cairn_status cairn_hough_step(cairn_hough *hough, cairn_budget *budget)
{
    if (hough == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!hough->is_running)
        return CAIRN_OK;
    if (!search(hough, budget))
        return CAIRN_MORE;
    hough->is_running = 0;
    return hough->outcome;
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
