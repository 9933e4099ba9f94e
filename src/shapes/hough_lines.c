/* Lines of the Hough transform: fitting, measuring and suppression.
 *
 * Method: for each peak
 * 1. a coarse and a fine weighted regression across the line move the line onto its inliers,
 * 2. a third pass measures the inliers, the extent and the covered length.
 * 3. At the end non-maximum suppression drops lines that coincide with one of more votes.
 *
 * As written the line is the centre of its bin, and only the third pass is made. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/ranked_list.h"
#include "src/shapes/hough_work.h"

/* Passes over the points for each peak. */
enum { PASS_COARSE, PASS_FINE, PASS_SUPPORT };

/* Starts a pass over the points. */
static void start_pass(cairn_hough *hough)
{
    hough_moments none = {0, 0, 0, 0, 0, 0};

    hough->moments = none;
    hough->fit.low = CAIRN_REAL_MAX;
    hough->fit.high = -CAIRN_REAL_MAX;
    if (hough->pass == PASS_SUPPORT)
        memset(hough->occupied, 0,
               (size_t)((hough->params.distances + 31) / 32) * sizeof *hough->occupied);
}

/* Starts the line of the current peak at the centre of its bin. */
static void start_line(cairn_hough *hough)
{
    const hough_peak *peak = &hough->peaks[hough->current_peak];
    cairn_vec2 direction = hough->direction[peak->row];
    cairn_real distance =
        ((cairn_real)peak->column - (cairn_real)(hough->params.distances - 1) * CAIRN_REAL(0.5)) *
        hough->bin_width;

    hough->fit.direction = direction;
    hough->fit.point =
        cairn_vec2_add(hough->centre, cairn_vec2_scale(cairn_vec2_left_perp(direction), distance));
    hough->pass = cairn_hough_is_as_written(hough) ? PASS_SUPPORT : PASS_COARSE;
}

/* Marks the position of an inlier along the line. p: in m. */
static void mark_position(cairn_hough *hough, cairn_vec2 p)
{
    cairn_real along = cairn_vec2_dot(hough->fit.direction, cairn_vec2_sub(p, hough->centre));
    int32_t position = cairn_real_to_int(cairn_hough_column(hough, along));

    CAIRN_ASSERT(position >= 0 && position < hough->params.distances);
    hough->occupied[position / 32] |= (uint32_t)1 << (position % 32);
}

/* 1 when a point, at signed distance s in m, is an inlier of the current line. As written: when the
 * point voted for the bin of the peak. */
static int is_inlier(const cairn_hough *hough, const cairn_oriented_point *point, cairn_real s)
{
    cairn_real max_distance = hough->params.support_distance, along, across;

    if (cairn_hough_is_as_written(hough)) {
        const hough_peak *peak = &hough->peaks[hough->current_peak];

        return cairn_hough_bin(hough, peak->row, cairn_vec2_sub(point->position, hough->centre)) ==
               peak->column;
    }
    along = cairn_vec2_dot(hough->fit.direction, point->direction);
    across = cairn_vec2_cross(hough->fit.direction, point->direction);
    if (hough->pass == PASS_COARSE)
        max_distance = cairn_max(2 * max_distance, 2 * hough->bin_width);
    if (!hough->params.oriented)
        along = cairn_abs(along);
    return cairn_abs(s) <= max_distance && along > 0 &&
           cairn_abs(across) <= hough->sine_tolerance * cairn_vec2_norm(point->direction);
}

/* Adds a point to the moments if the point is an inlier of the current line. */
static void add_point(cairn_hough *hough, const cairn_oriented_point *point, cairn_real weight)
{
    cairn_vec2 d = hough->fit.direction, from = cairn_vec2_sub(point->position, hough->fit.point);
    cairn_real t = cairn_vec2_dot(d, from), s = cairn_vec2_cross(d, from);
    hough_moments *moments = &hough->moments;

    if (!(weight > 0) || !is_inlier(hough, point, s))
        return;
    moments->w += weight;
    moments->t += weight * t;
    moments->s += weight * s;
    moments->tt += weight * t * t;
    moments->ts += weight * t * s;
    moments->ss += weight * s * s;
    if (hough->pass == PASS_SUPPORT) {
        hough->fit.low = cairn_min(hough->fit.low, t);
        hough->fit.high = cairn_max(hough->fit.high, t);
        mark_position(hough, point->position);
    }
}

/* Adds the next points, as many as the budget reaches for; 1 when all are added. */
static int add_points(cairn_hough *hough, cairn_budget *budget)
{
    int32_t left = hough->count - hough->cursor,
            wanted = left / HOUGH_POINTS_PER_UNIT + (left % HOUGH_POINTS_PER_UNIT > 0),
            units = cairn_budget_take(budget, wanted),
            end = units < wanted ? hough->cursor + units * HOUGH_POINTS_PER_UNIT : hough->count;

    for (int32_t i = hough->cursor; i < end; i++)
        add_point(hough, &hough->points[i], cairn_hough_weight(hough, i));
    hough->cursor = end;
    return end == hough->count;
}

/* Moves the current line to the weighted regression of s over t. 0 when the inliers have no extent
 * along the line. */
static int refit(cairn_hough *hough)
{
    const hough_moments *moments = &hough->moments;
    cairn_vec2 d = hough->fit.direction, left = cairn_vec2_left_perp(d);
    cairn_real t, s, tt, slope;

    if (!(moments->w > 0))
        return 0;
    t = moments->t / moments->w;
    s = moments->s / moments->w;
    tt = moments->tt / moments->w - t * t;
    if (!(tt > 0))
        return 0;
    slope = (moments->ts / moments->w - t * s) / tt;
    hough->fit.point = cairn_vec2_add(
        hough->fit.point, cairn_vec2_add(cairn_vec2_scale(d, t), cairn_vec2_scale(left, s)));
    hough->fit.direction = cairn_vec2_unit(cairn_vec2_add(d, cairn_vec2_scale(left, slope)));
    return 1;
}

/* Length in m from the first to the last marked position, without the gaps wider than 2 *
 * spacing. */
static cairn_real covered_length(const cairn_hough *hough)
{
    int32_t max_gap = cairn_real_to_int(2 * hough->params.spacing / hough->bin_width), last = -1,
            sum = 0;

    for (int32_t i = 0; i < hough->params.distances; i++) {
        if (!((hough->occupied[i / 32] >> (i % 32)) & 1))
            continue;
        if (last >= 0 && i - last <= max_gap)
            sum += i - last;
        last = i;
    }
    return (cairn_real)sum * hough->bin_width;
}

/* Completes the current line from its moments: its point becomes the centroid of the inliers. */
static void finish_line(cairn_hough *hough)
{
    const hough_moments *moments = &hough->moments;
    cairn_hough_line *line = &hough->fit;
    cairn_real t = moments->t / moments->w,
               s = cairn_hough_is_as_written(hough) ? 0 : moments->s / moments->w;

    line->point = cairn_vec2_add(line->point, cairn_vec2_scale(line->direction, t));
    line->low -= t;
    line->high -= t;
    line->covered_length = cairn_min(covered_length(hough), line->high - line->low);
    line->votes = moments->w;
    line->rms = cairn_sqrt(cairn_max(moments->ss / moments->w - s * s, 0));
    if (!hough->params.oriented &&
        (line->direction.x < 0 || (line->direction.x == 0 && line->direction.y < 0))) {
        cairn_real low = line->low;

        line->direction = cairn_vec2_scale(line->direction, -1);
        line->low = -line->high;
        line->high = -low;
    }
}

/* 1 when two lines coincide: their directions, and their distances from the centre of the points,
 * differ by less than the separation. */
static int is_duplicate(const void *context, const void *entry, const void *other)
{
    const cairn_hough *hough = context;
    const cairn_hough_line *a = other, *b = entry;
    cairn_real along = cairn_vec2_dot(a->direction, b->direction), sign = along < 0 ? -1 : 1;
    cairn_real offset =
        cairn_vec2_cross(a->direction, cairn_vec2_sub(a->point, hough->centre)) -
        sign * cairn_vec2_cross(b->direction, cairn_vec2_sub(b->point, hough->centre));

    if (hough->params.oriented && along < 0)
        return 0;
    return cairn_abs(offset) < hough->params.separation &&
           cairn_abs(cairn_vec2_cross(a->direction, b->direction)) < hough->sine_separation;
}

static void insert_line(cairn_hough *hough)
{
    ranked_list lines = {.entries = hough->found,
                         .count = &hough->found_count,
                         .capacity = hough->params.max_lines,
                         .entry_bytes = sizeof hough->fit,
                         .score_at = offsetof(cairn_hough_line, votes)};

    (void)ranked_list_add(&lines, &hough->fit);
}

/* Ends a pass over the points. 1 when another one follows for the same peak. */
static int end_pass(cairn_hough *hough)
{
    if (hough->pass != PASS_SUPPORT) {
        hough->pass++;
        return refit(hough);
    }
    if (hough->moments.w >= hough->params.min_votes && hough->fit.high > hough->fit.low) {
        finish_line(hough);
        insert_line(hough);
    }
    return 0;
}

int cairn_hough_fit_lines(cairn_hough *hough, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(hough->phase_resume);
    for (hough->current_peak = 0; hough->current_peak < hough->peak_count; hough->current_peak++) {
        start_line(hough);
        do {
            start_pass(hough);
            hough->cursor = 0;
            CAIRN_STEP_RUN(hough, phase_resume, budget, add_points);
            CAIRN_STEP_CHARGE(hough, phase_resume, budget,
                              4 + hough->params.distances / 16 + hough->found_count / 2);
        } while (end_pass(hough));
    }
    CAIRN_STEP_END(hough->phase_resume);
}

void cairn_hough_suppress_lines(cairn_hough *hough)
{
    cairn_hough_line *list = hough->result;
    ranked_list lines = {.entries = hough->found,
                         .count = &hough->found_count,
                         .entry_bytes = sizeof *hough->found,
                         .is_near = is_duplicate,
                         .context = hough};

    ranked_list_suppress_all(&lines);
    hough->result = hough->found;
    hough->result_count = hough->found_count;
    hough->result_dropped = hough->found_dropped;
    hough->found = list;
}
