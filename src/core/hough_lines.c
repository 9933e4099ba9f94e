/* The line at each peak: fitted to the points by two weighted regressions across it, then
 * measured, and dropped when it has come to lie on a stronger one. As written it is the middle
 * of its bin, and measured alone. */
#include "src/core/build.h"

#include <string.h>

#include "src/core/hough_work.h"

/* Passes over the points for each peak. */
enum { COARSE, FINE, SUPPORT };

static void start_pass(cairn_hough *hough)
{
    moments none = {0, 0, 0, 0, 0, 0};

    hough->sum = none;
    hough->cursor = 0;
    hough->fit.low = CAIRN_REAL_MAX;
    hough->fit.high = -CAIRN_REAL_MAX;
    if (hough->pass == SUPPORT)
        memset(hough->places, 0,
               (size_t)((hough->params.distances + 31) / 32) * sizeof *hough->places);
}

static void start_line(cairn_hough *hough)
{
    const peak *p = &hough->peaks[hough->line];
    cairn_vec2 direction = hough->direction[p->row];
    cairn_real distance =
        ((cairn_real)p->column - (cairn_real)(hough->params.distances - 1) * CAIRN_REAL(0.5)) *
        hough->step;

    hough->fit.direction = direction;
    hough->fit.point =
        cairn_vec2_add(hough->middle, cairn_vec2_scale(cairn_vec2_left(direction), distance));
    hough->pass = cairn_hough_is_as_written(hough) ? SUPPORT : COARSE;
    start_pass(hough);
}

static void mark_place(cairn_hough *hough, cairn_vec2 p)
{
    cairn_real along = cairn_vec2_dot(hough->fit.direction, cairn_vec2_sub(p, hough->middle));
    int32_t place = cairn_real_to_int(cairn_hough_column(hough, along));

    CAIRN_ASSERT(place >= 0 && place < hough->params.distances);
    hough->places[place / 32] |= (uint32_t)1 << (place % 32);
}

/* 1 when the point belongs to the current line, from which it is s away. As written: when it has
 * voted for it. */
static int belongs(const cairn_hough *hough, const cairn_oriented_point *p, cairn_real s)
{
    cairn_real reach = hough->params.support_distance, along, across;

    if (cairn_hough_is_as_written(hough)) {
        const peak *at = &hough->peaks[hough->line];

        return cairn_hough_bin(hough, at->row, cairn_vec2_sub(p->position, hough->middle)) ==
               at->column;
    }
    along = cairn_vec2_dot(hough->fit.direction, p->direction);
    across = cairn_vec2_cross(hough->fit.direction, p->direction);
    if (hough->pass == COARSE)
        reach = cairn_max(2 * reach, 2 * hough->step);
    if (!hough->params.oriented)
        along = cairn_abs(along);
    return cairn_abs(s) <= reach && along > 0 &&
           cairn_abs(across) <= hough->sine_tolerance * cairn_vec2_norm(p->direction);
}

/* A point as far as it belongs to the line at hand. */
static void add_point(cairn_hough *hough, const cairn_oriented_point *p, cairn_real weight)
{
    cairn_vec2 d = hough->fit.direction, from = cairn_vec2_sub(p->position, hough->fit.point);
    cairn_real t = cairn_vec2_dot(d, from), s = cairn_vec2_cross(d, from);
    moments *m = &hough->sum;

    if (!(weight > 0) || !belongs(hough, p, s))
        return;
    m->w += weight;
    m->t += weight * t;
    m->s += weight * s;
    m->tt += weight * t * t;
    m->ts += weight * t * s;
    m->ss += weight * s * s;
    if (hough->pass == SUPPORT) {
        hough->fit.low = cairn_min(hough->fit.low, t);
        hough->fit.high = cairn_max(hough->fit.high, t);
        mark_place(hough, p->position);
    }
}

/* Moves the line at hand to the regression of s over t. 0 when the points have no extent along
 * it. */
static int refit(cairn_hough *hough)
{
    const moments *m = &hough->sum;
    cairn_vec2 d = hough->fit.direction, left = cairn_vec2_left(d);
    cairn_real t, s, tt, slope;

    if (!(m->w > 0))
        return 0;
    t = m->t / m->w;
    s = m->s / m->w;
    tt = m->tt / m->w - t * t;
    if (!(tt > 0))
        return 0;
    slope = (m->ts / m->w - t * s) / tt;
    hough->fit.point = cairn_vec2_add(
        hough->fit.point, cairn_vec2_add(cairn_vec2_scale(d, t), cairn_vec2_scale(left, s)));
    hough->fit.direction = cairn_vec2_unit(cairn_vec2_add(d, cairn_vec2_scale(left, slope)));
    return 1;
}

/* The marked places' way from the first to the last, without the wide gaps. */
static cairn_real covered(const cairn_hough *hough)
{
    int32_t widest = cairn_real_to_int(2 * hough->params.spacing / hough->step), last = -1, sum = 0;

    for (int32_t i = 0; i < hough->params.distances; i++) {
        if (!((hough->places[i / 32] >> (i % 32)) & 1))
            continue;
        if (last >= 0 && i - last <= widest)
            sum += i - last;
        last = i;
    }
    return (cairn_real)sum * hough->step;
}

/* The line as it is reported: its point is the mean of the support. */
static void measure(cairn_hough *hough)
{
    const moments *m = &hough->sum;
    cairn_hough_line *l = &hough->fit;
    cairn_real t = m->t / m->w, s = cairn_hough_is_as_written(hough) ? 0 : m->s / m->w;

    l->point = cairn_vec2_add(l->point, cairn_vec2_scale(l->direction, t));
    l->low -= t;
    l->high -= t;
    l->covered = cairn_min(covered(hough), l->high - l->low);
    l->votes = m->w;
    l->rms = cairn_sqrt(cairn_max(m->ss / m->w - s * s, 0));
    if (!hough->params.oriented &&
        (l->direction.x < 0 || (l->direction.x == 0 && l->direction.y < 0))) {
        cairn_real low = l->low;

        l->direction = cairn_vec2_scale(l->direction, -1);
        l->low = -l->high;
        l->high = -low;
    }
}

/* 1 when one of the two lines ends up on the other, seen from the middle of the points. */
static int is_same(const cairn_hough *hough, const cairn_hough_line *a, const cairn_hough_line *b)
{
    cairn_real along = cairn_vec2_dot(a->direction, b->direction), sign = along < 0 ? -1 : 1;
    cairn_real apart =
        cairn_vec2_cross(a->direction, cairn_vec2_sub(a->point, hough->middle)) -
        sign * cairn_vec2_cross(b->direction, cairn_vec2_sub(b->point, hough->middle));

    if (hough->params.oriented && along < 0)
        return 0;
    return cairn_abs(apart) < hough->params.separation &&
           cairn_abs(cairn_vec2_cross(a->direction, b->direction)) < hough->sine_separation;
}

/* Among the lines that were found before, behind those with as many votes. */
static void insert(cairn_hough *hough)
{
    int32_t at = hough->work_count++;

    for (; at > 0 && hough->work[at - 1].votes < hough->fit.votes; at--)
        hough->work[at] = hough->work[at - 1];
    hough->work[at] = hough->fit;
}

/* Ends a pass over the points; goes to the next, or to the next line. */
static void end_pass(cairn_hough *hough)
{
    if (hough->pass != SUPPORT && refit(hough)) {
        hough->pass++;
        start_pass(hough);
        return;
    }
    if (hough->pass == SUPPORT && hough->sum.w >= hough->params.least_votes &&
        hough->fit.high > hough->fit.low) {
        measure(hough);
        insert(hough);
    }
    hough->line++;
    if (hough->line < hough->peak_count)
        start_line(hough);
}

void cairn_hough_begin_lines(cairn_hough *hough)
{
    hough->line = 0;
    if (hough->peak_count > 0)
        start_line(hough);
}

cairn_status cairn_hough_fit_lines(cairn_hough *hough, cairn_budget *budget)
{
    while (hough->line < hough->peak_count) {
        while (hough->cursor < hough->count) {
            if (budget->left <= 0)
                return CAIRN_MORE;
            budget->left--;
            for (int32_t i = 0; i < 4 && hough->cursor < hough->count; i++, hough->cursor++)
                add_point(hough, &hough->points[hough->cursor],
                          cairn_hough_weight(hough, hough->cursor));
        }
        if (!cairn_budget_pay(budget, &hough->paid,
                              4 + hough->params.distances / 16 + hough->work_count / 2))
            return CAIRN_MORE;
        end_pass(hough);
    }
    return CAIRN_OK;
}

cairn_status cairn_hough_thin_lines(cairn_hough *hough, cairn_budget *budget)
{
    cairn_hough_line *list = hough->done;
    int32_t kept = 0;

    if (!cairn_budget_pay(budget, &hough->paid, 1 + hough->work_count * hough->work_count / 8))
        return CAIRN_MORE;
    for (int32_t i = 0; i < hough->work_count; i++) {
        int same = 0;

        for (int32_t j = 0; j < kept && !same; j++)
            same = is_same(hough, &hough->work[j], &hough->work[i]);
        if (!same)
            hough->work[kept++] = hough->work[i];
    }
    hough->done = hough->work;
    hough->done_count = kept;
    hough->done_dropped = hough->work_dropped;
    hough->work = list;
    return CAIRN_OK;
}
