/* Weighted votes for directed lines, their peaks, and the lines that fit the points at the peaks.
 *
 * Method: rows of the accumulator are directions, columns signed distances from the middle of the
 * points' box. A point votes in all rows about its own direction, less the farther, and in each row
 * for the two columns that its distance lies between, so that peaks are smooth. Without orientation
 * a row and the one half a turn away are the same with the columns reversed. A peak is refined by
 * two weighted regressions across its line, in the line's own frame, where float has digits to
 * spare; a last pass measures the support. Lines that came to lie on a stronger one are dropped
 * (hough_lines.c). As written a point votes for one column of every row, and the points of a peak's
 * bin are its support.
 *
 * Layout: directions of the rows; the votes; a bit for each place along the line at hand; the
 * peaks; two lists of lines, one in work, one that readers see.
 *
 * Limits: the columns get wider when the points reach too far for them. Votes are sums of reals in
 * the order of the points. Lines through hundreds of metres of points with an error of half a row's
 * angle do not peak; choose more rows.
 *
 * Source: Hough 1962; Ballard 1981; Adluru 2008, section 8.4.1. */
#include "src/core/build.h"

#include <string.h>

#include "src/core/hough_work.h"

#define LIMIT CAIRN_REAL(1e6)

/* Phases of a search. */
enum { IDLE, BOUNDS, CLEAR, VOTE, PEAKS, FIT, THIN };

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
        .least_votes = 20,
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

/* The params with what the mode leaves no choice of. */
static cairn_hough_params in_mode(const cairn_hough_params *params)
{
    cairn_hough_params p = *params;

    if (p.mode == CAIRN_MODE_AS_WRITTEN) {
        p.oriented = 0;
        p.angle_tolerance = CAIRN_PI / 2;
        p.support_distance = p.distance_step;
    }
    return p;
}

static int is_length(cairn_real x)
{
    return x > 0 && x <= LIMIT;
}

static int is_angle(cairn_real x)
{
    return x > 0 && x <= CAIRN_PI / 2;
}

static int params_are_valid(const cairn_hough_params *p)
{
    return p->max_lines >= 1 && p->max_lines <= 256 && p->angles >= 8 && p->angles <= 1 << 12 &&
           p->distances >= 8 && p->distances <= 1 << 14 && is_length(p->distance_step) &&
           is_angle(p->angle_tolerance) && is_length(p->separation) &&
           is_angle(p->separation_angle) && is_length(p->support_distance) &&
           is_length(p->spacing) && p->least_votes > 0 && cairn_is_finite(p->least_votes) &&
           (p->mode == CAIRN_MODE_DEFAULT || p->mode == CAIRN_MODE_AS_WRITTEN);
}

static int32_t rows_of(const cairn_hough_params *params)
{
    return params->oriented ? 2 * params->angles : params->angles;
}

static cairn_hough *carve(cairn_pool *pool, const cairn_hough_params *params)
{
    size_t rows = (size_t)rows_of(params), columns = (size_t)params->distances,
           lines = (size_t)params->max_lines;
    cairn_hough *hough = cairn_pool_take_one(pool, sizeof *hough);
    cairn_vec2 *direction = cairn_pool_take(pool, rows, sizeof *direction);
    cairn_real *votes = cairn_pool_take(pool, rows * columns, sizeof *votes);
    uint32_t *places = cairn_pool_take(pool, (columns + 31) / 32, sizeof *places);
    peak *peaks = cairn_pool_take(pool, lines, sizeof *peaks);
    cairn_hough_line *work = cairn_pool_take(pool, lines, sizeof *work);
    cairn_hough_line *done = cairn_pool_take(pool, lines, sizeof *done);

    if (hough != NULL) {
        memset(hough, 0, sizeof *hough);
        hough->direction = direction;
        hough->votes = votes;
        hough->places = places;
        hough->peaks = peaks;
        hough->work = work;
        hough->done = done;
    }
    return hough;
}

size_t cairn_hough_memory(const cairn_hough_params *params)
{
    cairn_hough_params used;
    cairn_pool counting;

    if (params == NULL)
        return 0;
    used = in_mode(params);
    if (!params_are_valid(&used))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, &used);
    return cairn_pool_counted(&counting);
}

static void take_params(cairn_hough *hough, const cairn_hough_params *params)
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
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    used = in_mode(params);
    made = carve(pool, &used);
    take_params(made, &used);
    made->rows = rows_of(&used);
    made->turn = CAIRN_PI / (cairn_real)used.angles;
    for (int32_t row = 0; row < made->rows; row++)
        cairn_sincos((cairn_real)row * made->turn, &made->direction[row].y,
                     &made->direction[row].x);
    *hough = made;
    return CAIRN_OK;
}

cairn_status cairn_hough_adjust(cairn_hough *hough, const cairn_hough_params *params)
{
    cairn_hough_params used;

    if (hough == NULL || params == NULL)
        return CAIRN_BAD_ARGUMENT;
    used = in_mode(params);
    if (!params_are_valid(&used) || used.max_lines != hough->params.max_lines ||
        used.angles != hough->params.angles || used.distances != hough->params.distances ||
        (used.oriented != 0) != (hough->params.oriented != 0) || used.mode != hough->params.mode)
        return CAIRN_BAD_ARGUMENT;
    hough->phase = IDLE;
    take_params(hough, &used);
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
    hough->box.min.x = hough->box.min.y = LIMIT;
    hough->box.max.x = hough->box.max.y = -LIMIT;
    hough->peak_count = 0;
    hough->work_count = 0;
    hough->work_dropped = 0;
    hough->phase = BOUNDS;
    return CAIRN_OK;
}

/* ---- Bounds ---- */

static cairn_status check(const cairn_oriented_point *p, cairn_real weight)
{
    if (!cairn_is_finite(p->position.x) || !cairn_is_finite(p->position.y) ||
        !cairn_is_finite(p->direction.x) || !cairn_is_finite(p->direction.y) ||
        !cairn_is_finite(weight))
        return CAIRN_NOT_FINITE;
    if (cairn_abs(p->position.x) > LIMIT || cairn_abs(p->position.y) > LIMIT || weight < 0 ||
        weight > LIMIT)
        return CAIRN_BAD_ARGUMENT;
    return CAIRN_OK;
}

/* The columns' width, and how far about a peak there is no other. */
static void lay_columns(cairn_hough *hough)
{
    const cairn_hough_params *p = &hough->params;
    cairn_vec2 half =
        cairn_vec2_scale(cairn_vec2_sub(hough->box.max, hough->box.min), CAIRN_REAL(0.5));
    cairn_real radius = hough->count > 0 ? cairn_vec2_norm(half) : 0;

    hough->middle = cairn_vec2_add(hough->box.min, half);
    hough->step = cairn_max(p->distance_step, 2 * radius / (cairn_real)(p->distances - 3));
    hough->row_reach = cairn_real_to_int(cairn_ceil(p->separation_angle / hough->turn));
    hough->column_reach = cairn_real_to_int(cairn_ceil(p->separation / hough->step));
    if (hough->column_reach > p->distances)
        hough->column_reach = p->distances;
}

static cairn_status step_bounds(cairn_hough *hough, cairn_budget *budget)
{
    while (hough->cursor < hough->count) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        for (int32_t i = 0; i < 4 && hough->cursor < hough->count; i++, hough->cursor++) {
            const cairn_oriented_point *p = &hough->points[hough->cursor];
            cairn_status status = check(p, cairn_hough_weight(hough, hough->cursor));

            if (status != CAIRN_OK)
                return status;
            hough->box.min.x = cairn_min(hough->box.min.x, p->position.x);
            hough->box.min.y = cairn_min(hough->box.min.y, p->position.y);
            hough->box.max.x = cairn_max(hough->box.max.x, p->position.x);
            hough->box.max.y = cairn_max(hough->box.max.y, p->position.y);
        }
    }
    lay_columns(hough);
    return CAIRN_OK;
}

/* ---- Votes ---- */

static cairn_status step_clear(cairn_hough *hough, cairn_budget *budget)
{
    int32_t bins = hough->rows * hough->params.distances;

    while (hough->cursor < bins) {
        int32_t some = bins - hough->cursor < 128 ? bins - hough->cursor : 128;

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        memset(&hough->votes[hough->cursor], 0, (size_t)some * sizeof *hough->votes);
        hough->cursor += some;
    }
    return CAIRN_OK;
}

static void vote(cairn_hough *hough, int32_t row, cairn_vec2 p, cairn_real weight)
{
    cairn_real at = cairn_hough_column(hough, cairn_vec2_cross(hough->direction[row], p)),
               low = cairn_floor(at);
    cairn_real *bin = &hough->votes[row * hough->params.distances + cairn_real_to_int(low)];

    CAIRN_ASSERT(low >= 0 && low < (cairn_real)(hough->params.distances - 1));
    bin[0] += weight * (1 - (at - low));
    bin[1] += weight * (at - low);
}

/* The rows that a point of a direction votes in: first ... last, which may be below 0 or beyond
 * the last row. */
static cairn_real rows_about(const cairn_hough *hough, cairn_vec2 direction, int32_t *first,
                             int32_t *last)
{
    cairn_real centre = cairn_atan2(direction.y, direction.x) / hough->turn;
    cairn_real reach = hough->params.angle_tolerance / hough->turn;

    *first = cairn_real_to_int(cairn_ceil(centre - reach));
    *last = cairn_real_to_int(cairn_floor(centre + reach));
    return centre;
}

static void vote_all(cairn_hough *hough, cairn_vec2 p, cairn_real weight, cairn_real centre,
                     int32_t first, int32_t last)
{
    cairn_real reach = hough->params.angle_tolerance / hough->turn;

    for (int32_t i = first; i <= last; i++) {
        cairn_real share = 1 - cairn_abs((cairn_real)i - centre) / reach;
        int32_t row = (i + 2 * hough->rows) % hough->rows;

        if (share > 0)
            vote(hough, row, p, weight * share);
    }
}

/* One vote in every row. */
static void vote_as_written(cairn_hough *hough, cairn_vec2 p, cairn_real weight)
{
    for (int32_t row = 0; row < hough->rows; row++) {
        int32_t column = cairn_hough_bin(hough, row, p);

        CAIRN_ASSERT(column >= 0 && column < hough->params.distances);
        hough->votes[row * hough->params.distances + column] += weight;
    }
}

static cairn_status step_vote_as_written(cairn_hough *hough, cairn_budget *budget)
{
    for (; hough->cursor < hough->count; hough->cursor++) {
        cairn_vec2 p = cairn_vec2_sub(hough->points[hough->cursor].position, hough->middle);

        if (!cairn_budget_pay(budget, &hough->paid, 2 + hough->rows / 4))
            return CAIRN_MORE;
        vote_as_written(hough, p, cairn_hough_weight(hough, hough->cursor));
    }
    return CAIRN_OK;
}

static cairn_status step_vote(cairn_hough *hough, cairn_budget *budget)
{
    for (; hough->cursor < hough->count; hough->cursor++) {
        const cairn_oriented_point *p = &hough->points[hough->cursor];
        cairn_real weight = cairn_hough_weight(hough, hough->cursor), centre;
        int32_t first, last;

        if (budget->left <= 0)
            return CAIRN_MORE;
        centre = rows_about(hough, p->direction, &first, &last);
        if (!cairn_budget_pay(budget, &hough->paid, 2 + (last - first) / 4))
            return CAIRN_MORE;
        if (weight > 0 && cairn_vec2_norm_squared(p->direction) > 0)
            vote_all(hough, cairn_vec2_sub(p->position, hough->middle), weight, centre, first,
                     last);
    }
    return CAIRN_OK;
}

/* ---- Peaks ---- */

/* 1 when no bin near (row, column) has more votes, or as many and comes before. */
static int is_peak(const cairn_hough *hough, int32_t row, int32_t column)
{
    int32_t columns = hough->params.distances, self = row * columns + column;
    cairn_real votes = hough->votes[self];

    for (int32_t i = -hough->row_reach; i <= hough->row_reach; i++) {
        int32_t other = (row + i + hough->rows) % hough->rows;
        int32_t reversed = !hough->params.oriented && other != row + i;
        int32_t about = reversed ? columns - 1 - column : column;
        int32_t from = about > hough->column_reach ? about - hough->column_reach : 0;
        int32_t to =
            columns - 1 - about > hough->column_reach ? about + hough->column_reach : columns - 1;

        for (int32_t j = other * columns + from; j <= other * columns + to; j++)
            if (hough->votes[j] > votes || (j < self && hough->votes[j] == votes))
                return 0;
    }
    return 1;
}

/* Among the peaks found before, all of which come before it when they are as high. */
static void keep(cairn_hough *hough, int32_t row, int32_t column)
{
    peak p = {hough->votes[row * hough->params.distances + column], row, column};
    int32_t at = hough->peak_count;

    if (at == hough->params.max_lines) {
        hough->work_dropped++;
        if (hough->peaks[at - 1].votes >= p.votes)
            return;
        at--;
    } else {
        hough->peak_count++;
    }
    for (; at > 0 && hough->peaks[at - 1].votes < p.votes; at--)
        hough->peaks[at] = hough->peaks[at - 1];
    hough->peaks[at] = p;
}

/* A line between two columns loses half of its votes to the other one, and some more between two
 * rows; as written it keeps them. */
static int may_be_peak(const cairn_hough *hough, int32_t bin)
{
    cairn_real share = cairn_hough_is_as_written(hough) ? 1 : CAIRN_REAL(0.4);

    return hough->votes[bin] >= share * hough->params.least_votes;
}

static cairn_status step_peaks(cairn_hough *hough, cairn_budget *budget)
{
    int32_t columns = hough->params.distances, bins = hough->rows * columns;
    int32_t about = (2 * hough->row_reach + 1) * (2 * hough->column_reach + 1);

    while (hough->cursor < bins) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        if (!may_be_peak(hough, hough->cursor)) {
            budget->left--;
            for (int32_t i = 0;
                 i < 32 && hough->cursor < bins && !may_be_peak(hough, hough->cursor); i++)
                hough->cursor++;
            continue;
        }
        if (!cairn_budget_pay(budget, &hough->paid, 2 + about / 16 + hough->peak_count / 8))
            return CAIRN_MORE;
        if (is_peak(hough, hough->cursor / columns, hough->cursor % columns))
            keep(hough, hough->cursor / columns, hough->cursor % columns);
        hough->cursor++;
    }
    return CAIRN_OK;
}

/* ---- All of it ---- */

static cairn_status step_phase(cairn_hough *hough, cairn_budget *budget)
{
    switch (hough->phase) {
    case BOUNDS:
        return step_bounds(hough, budget);
    case CLEAR:
        return step_clear(hough, budget);
    case VOTE:
        return cairn_hough_is_as_written(hough) ? step_vote_as_written(hough, budget)
                                                : step_vote(hough, budget);
    case PEAKS:
        return step_peaks(hough, budget);
    case FIT:
        return cairn_hough_fit_lines(hough, budget);
    default:
        return cairn_hough_thin_lines(hough, budget);
    }
}

cairn_status cairn_hough_step(cairn_hough *hough, cairn_budget *budget)
{
    if (hough == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (hough->phase != IDLE) {
        cairn_status status = step_phase(hough, budget);

        if (status == CAIRN_MORE)
            return status;
        hough->phase = status < 0 || hough->phase == THIN ? IDLE : hough->phase + 1;
        if (status < 0)
            return status;
        hough->cursor = 0;
        hough->paid = 0;
        if (hough->phase == FIT)
            cairn_hough_begin_lines(hough);
    }
    return CAIRN_OK;
}

const cairn_hough_line *cairn_hough_list(const cairn_hough *hough, int32_t *count)
{
    *count = hough->done_count;
    return hough->done;
}

int32_t cairn_hough_dropped(const cairn_hough *hough)
{
    return hough->done_dropped;
}

cairn_segment cairn_hough_segment(const cairn_hough_line *line)
{
    cairn_segment segment = {
        cairn_vec2_add(line->point, cairn_vec2_scale(line->direction, line->low)),
        cairn_vec2_add(line->point, cairn_vec2_scale(line->direction, line->high))};
    return segment;
}
