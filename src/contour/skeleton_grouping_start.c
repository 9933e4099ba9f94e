/* Bootstrapping: lines through the CPs in (x, y, radius), and the CP in the middle of each that
 * is an axis of mirror symmetry. */
#include "src/core/build.h"

#include "src/contour/skeleton_grouping_written.h"

/* Distances of two edgels from the axis that differ by less are alike. */
#define ALIKE CAIRN_REAL(0.2)
/* A deviation of so many rad counts as much as lying half a line from its middle. */
#define OFF_MIDDLE CAIRN_REAL(0.3)

static cairn_status add_centres(cairn_skeleton *g, cairn_budget *budget)
{
    cairn_status status = g->cursor == 0 ? cairn_polyline_clear(g->polyline, 1) : CAIRN_OK;

    for (; g->cursor < g->centre_count && status == CAIRN_OK; g->cursor++) {
        const skeleton_centre *c = &g->centres[g->cursor];
        cairn_real point[3] = {c->at.x, c->at.y, c->radius};

        if (!cairn_budget_pay(budget, &g->paid, 1))
            return CAIRN_MORE;
        status = cairn_polyline_add(g->polyline, point);
    }
    return status;
}

cairn_status cairn_skeleton_lines(cairn_skeleton *g, cairn_budget *budget)
{
    cairn_status status;

    if (g->item == 0) {
        status = add_centres(g, budget);
        if (status != CAIRN_OK)
            return status;
        g->item = 1;
    }
    status = cairn_polyline_step(g->polyline, budget);
    if (status == CAIRN_OK)
        g->line_count = cairn_polyline_read(g->polyline).segment_count;
    return status;
}

int cairn_skeleton_is_mirrored(const cairn_skeleton *g, const skeleton_centre *c,
                               const cairn_polyline_segment *s)
{
    cairn_vec2 a = {s->a[0], s->a[1]}, b = {s->b[0], s->b[1]},
               along = cairn_vec2_unit(cairn_vec2_sub(b, a));
    cairn_real first = cairn_vec2_cross(along, cairn_vec2_sub(g->edgels[c->edgel[0]].at, a));
    cairn_real second = cairn_vec2_cross(along, cairn_vec2_sub(g->edgels[c->edgel[1]].at, a));

    return (first > 0) != (second > 0) &&
           cairn_abs(first + second) <= ALIKE * cairn_max(cairn_abs(first), cairn_abs(second));
}

/* How far a CP lies from the middle of its line, of its length, and how ill it is. */
static cairn_real off_middle(const skeleton_centre *c, const cairn_polyline_segment *s)
{
    cairn_real d[3] = {c->at.x - (s->a[0] + s->b[0]) / 2, c->at.y - (s->a[1] + s->b[1]) / 2,
                       c->radius - (s->a[2] + s->b[2]) / 2};
    cairn_real l[3] = {s->b[0] - s->a[0], s->b[1] - s->a[1], s->b[2] - s->a[2]};

    return cairn_sqrt((d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) /
                      cairn_max(l[0] * l[0] + l[1] * l[1] + l[2] * l[2], 1)) +
           c->deviation / OFF_MIDDLE / 2;
}

/* 1: start a comes before b. */
static int is_before(const skeleton_start *a, const skeleton_start *b)
{
    return a->support != b->support ? a->support > b->support : a->centre < b->centre;
}

/* The lines that are kept, those of most support first. */
static void sort_in(cairn_skeleton *g, const skeleton_start *start)
{
    int32_t i = g->start_count++;

    for (; i > 0 && is_before(start, &g->starts[i - 1]); i--)
        g->starts[i] = g->starts[i - 1];
    g->starts[i] = *start;
}

/* 1: a CP of its own may be a start: short and bent parts have no line. It is symmetric, the
 * object lies on the same side of both contrasts, and both are no less than the mean one. */
static int may_start(const cairn_skeleton *g, const skeleton_centre *c)
{
    return c->deviation <= g->params.symmetry && c->sense[0] == c->sense[1] &&
           (g->params.contrast == 0 ||
            (g->edgels[c->edgel[0]].contrast >= 0 && g->edgels[c->edgel[1]].contrast >= 0));
}

/* The room that is left goes to them, evenly over the image: they are counted, and one in so
 * many is taken. */
static cairn_status add_loose(cairn_skeleton *g, cairn_budget *budget)
{
    int32_t n = g->centre_count, room;

    if (g->other == 0)
        g->line_starts = g->start_count;
    room = g->params.max_lines - g->line_starts;
    for (; room > 0 && g->other < 2 * n; g->other++) {
        int32_t i = g->other < n ? g->other : g->other - n;
        skeleton_start start = {i, 0};

        if (!cairn_budget_pay(budget, &g->paid, 1))
            return CAIRN_MORE;
        if (!may_start(g, &g->centres[i]))
            continue;
        if (g->other < n)
            g->item++;
        else if (g->sense++ % (1 + (g->item - 1) / room) == 0)
            g->starts[g->start_count++] = start;
    }
    return CAIRN_OK;
}

/* Line by line. Cost: all CPs for each. */
cairn_status cairn_skeleton_mirror(cairn_skeleton *g, cairn_budget *budget)
{
    cairn_polyline_view view = cairn_polyline_read(g->polyline);

    for (; g->cursor < view.segment_count; g->cursor++) {
        const cairn_polyline_segment *s = &view.segments[g->cursor];
        skeleton_start start = {-1, 0};
        cairn_real best = CAIRN_REAL_MAX;

        if (!cairn_budget_pay(budget, &g->paid, 1 + g->centre_count / 16 + s->count))
            return CAIRN_MORE;
        for (int32_t i = 0; i < g->centre_count; i++) {
            const skeleton_centre *c = &g->centres[i];
            cairn_real off;

            if (view.label[i] != g->cursor || !cairn_skeleton_is_mirrored(g, c, s))
                continue;
            start.support++;
            off = off_middle(c, s);
            if (off < best) {
                best = off;
                start.centre = i;
            }
        }
        /* As written the line is where walks begin, from all of its CPs. */
        if (start.centre >= 0 && g->params.mode == CAIRN_MODE_AS_WRITTEN)
            start.centre = g->cursor;
        if (start.centre >= 0 &&
            (cairn_real)start.support >= g->params.min_mirror * (cairn_real)s->count)
            sort_in(g, &start);
    }
    if (g->params.mode != CAIRN_MODE_AS_WRITTEN)
        return add_loose(g, budget);
    g->line_starts = g->start_count;
    return CAIRN_OK;
}
