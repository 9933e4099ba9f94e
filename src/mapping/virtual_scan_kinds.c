/* How hypotheses of each kind are laid out as points, and which lines and ellipses count. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/virtual_scan_work.h"

/* ---- Outlines ---- */

/* A hypothesis without points yet; NULL and counted as dropped when there is no room. */
static cairn_hypothesis *add_hypothesis(cairn_virtual_scan *v, cairn_hypothesis_kind kind,
                                        cairn_real strength)
{
    cairn_hypothesis *h = &v->work.hypotheses[v->work.count];

    if (v->work.count == v->params.max_hypotheses) {
        v->work.dropped++;
        return NULL;
    }
    v->work.count++;
    h->kind = kind;
    h->first_point = h->end_point = v->work.point_count;
    h->scans = 0;
    h->strength = strength;
    h->weight = v->params.weight * strength;
    return h;
}

/* Points on a segment, `spacing` apart about its middle; those without room are counted as
 * dropped. */
static void lay_out(cairn_virtual_scan *v, cairn_hypothesis *h, cairn_segment s)
{
    cairn_vec2 run = cairn_vec2_sub(s.b, s.a), direction = cairn_vec2_unit(run);
    cairn_real length = cairn_vec2_norm(run), steps = cairn_floor(length / v->params.spacing);
    cairn_real first = (length - steps * v->params.spacing) / 2;
    int32_t count = cairn_real_to_int(cairn_min(steps, CAIRN_REAL(1e9))) + 1;
    int32_t room = v->params.max_virtual - v->work.point_count;

    if (count > room) {
        v->work.dropped += count - room;
        count = room;
    }
    for (int32_t i = 0; i < count; i++) {
        cairn_oriented_point *p = &v->work.points[v->work.point_count];

        p->position = cairn_vec2_add(
            s.a, cairn_vec2_scale(direction, first + (cairn_real)i * v->params.spacing));
        p->direction = direction;
        v->work.weights[v->work.point_count++] = h->weight;
    }
    h->end_point = v->work.point_count;
}

/* Units that laying out a way of so many metres costs. */
static int32_t price(const cairn_virtual_scan *v, cairn_real length)
{
    cairn_real points = cairn_min(length / v->params.spacing,
                                  (cairn_real)(v->params.max_virtual - v->work.point_count));

    return 2 + cairn_real_to_int(points / 4);
}

/* ---- Lines ---- */

static int is_on(const cairn_virtual_scan *v, const cairn_hough_line *l,
                 const cairn_oriented_point *p)
{
    cairn_vec2 from = cairn_vec2_sub(p->position, l->point);
    cairn_real along = cairn_vec2_dot(l->direction, p->direction);

    if (!v->params.hough.oriented)
        along = cairn_abs(along);
    return cairn_abs(cairn_vec2_cross(l->direction, from)) <= v->support && along > 0 &&
           cairn_abs(cairn_vec2_cross(l->direction, p->direction)) <= v->sine_angle;
}

static int is_on_line(const cairn_virtual_scan *v, const cairn_oriented_point *p)
{
    int32_t count;

    return is_on(v, &cairn_hough_list(v->hough, &count)[v->item], p);
}

static int is_on_ellipse(const cairn_virtual_scan *v, const cairn_oriented_point *p)
{
    int32_t count;

    return cairn_ellipse_has(&cairn_ellipse_list(v->ellipses, &count)[v->item], p, v->round_support,
                             v->sine_tangent);
}

/* How many scans have walls on the line or ellipse at hand. */
static cairn_status count_scans(cairn_virtual_scan *v,
                                int (*is_on_it)(const cairn_virtual_scan *,
                                                const cairn_oriented_point *),
                                cairn_budget *budget)
{
    int32_t used = v->params.max_scans;

    if (!v->is_clear) {
        if (!cairn_budget_pay(budget, &v->paid, 1 + used / 64))
            return CAIRN_MORE;
        memset(v->on_it, 0, (size_t)used * sizeof *v->on_it);
        v->is_clear = 1;
    }
    while (v->cursor < v->map.point_count) {
        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        for (int32_t i = 0; i < 4 && v->cursor < v->map.point_count; i++, v->cursor++)
            v->on_it[v->point_scan[v->cursor]] += is_on_it(v, &v->points[v->cursor]);
    }
    if (!cairn_budget_pay(budget, &v->paid, 1 + used / 32))
        return CAIRN_MORE;
    v->scans = 0;
    for (int32_t i = 0; i < used; i++)
        v->scans += v->on_it[i] > 0 &&
                    (cairn_real)v->on_it[i] * v->params.hough.spacing >= v->params.least_length;
    v->is_counted = 1;
    return CAIRN_OK;
}

static void next_item(cairn_virtual_scan *v)
{
    v->cursor = 0;
    v->is_clear = v->is_counted = 0;
    v->item++;
}

/* As written: of the points that take part in a line, by those of the first, which has the most;
 * else the covered share. */
static cairn_real strength_of(const cairn_virtual_scan *v, const cairn_hough_line *lines,
                              const cairn_hough_line *l)
{
    return v->params.mode == CAIRN_MODE_AS_WRITTEN ? l->votes / lines->votes
                                                   : l->covered / (l->high - l->low);
}

cairn_status cairn_virtual_lay_lines(cairn_virtual_scan *v, cairn_budget *budget)
{
    int32_t count, is_as_written = v->params.mode == CAIRN_MODE_AS_WRITTEN;
    const cairn_hough_line *lines = cairn_hough_list(v->hough, &count);

    for (; v->item < count; next_item(v)) {
        const cairn_hough_line *l = &lines[v->item];
        cairn_hypothesis *h;

        if (!is_as_written && !v->is_counted && count_scans(v, is_on_line, budget) != CAIRN_OK)
            return CAIRN_MORE;
        if (!is_as_written && v->scans < v->params.least_scans)
            continue;
        if (!cairn_budget_pay(budget, &v->paid, price(v, l->high - l->low)))
            return CAIRN_MORE;
        h = add_hypothesis(v, CAIRN_HYPOTHESIS_LINE, strength_of(v, lines, l));
        if (h != NULL) {
            h->scans = is_as_written ? 0 : v->scans;
            lay_out(v, h, cairn_hough_segment(l));
        }
    }
    return CAIRN_OK;
}

/* ---- Ellipses ---- */

/* Points on the outline, about `spacing` apart, at even angles of its circle. */
static void lay_ellipse(cairn_virtual_scan *v, cairn_hypothesis *h, const cairn_ellipse *e)
{
    cairn_real length = cairn_ellipse_length(e);
    int32_t count = cairn_real_to_int(cairn_max(cairn_ceil(length / v->params.spacing), 8));
    int32_t room = v->params.max_virtual - v->work.point_count;

    if (count > room) {
        v->work.dropped += count - room;
        count = room;
    }
    for (int32_t i = 0; i < count; i++) {
        v->work.points[v->work.point_count] =
            cairn_ellipse_point(e, 2 * CAIRN_PI * (cairn_real)i / (cairn_real)count);
        v->work.weights[v->work.point_count++] = h->weight;
    }
    h->end_point = v->work.point_count;
}

cairn_status cairn_virtual_lay_ellipses(cairn_virtual_scan *v, cairn_budget *budget)
{
    int32_t count;
    const cairn_ellipse *ellipses = cairn_ellipse_list(v->ellipses, &count);

    for (; v->item < count; next_item(v)) {
        const cairn_ellipse *e = &ellipses[v->item];
        cairn_hypothesis *h;

        if (!v->is_counted && count_scans(v, is_on_ellipse, budget) != CAIRN_OK)
            return CAIRN_MORE;
        if (v->scans < v->params.least_scans)
            continue;
        if (!cairn_budget_pay(budget, &v->paid, 4 * price(v, cairn_ellipse_length(e))))
            return CAIRN_MORE;
        h = add_hypothesis(v, CAIRN_HYPOTHESIS_ELLIPSE, e->strength);
        if (h != NULL) {
            h->scans = v->scans;
            lay_ellipse(v, h, e);
        }
    }
    return CAIRN_OK;
}

/* ---- Rectangles ---- */

/* Side i; free inside for rooms and those without directions, outside for boxes. */
static cairn_segment side_of(const cairn_rectangle *r, int32_t i)
{
    cairn_vec2 corners[4];
    cairn_segment side;

    cairn_rectangle_corners(r, corners);
    side.a = corners[i];
    side.b = corners[(i + 1) % 4];
    if (r->kind == CAIRN_RECTANGLE_BOX) {
        side.a = corners[(i + 1) % 4];
        side.b = corners[i];
    }
    return side;
}

cairn_status cairn_virtual_lay_rectangles(cairn_virtual_scan *v, cairn_budget *budget)
{
    int32_t count;
    const cairn_rectangle *list = cairn_rectangle_list(v->rectangles, &count);

    for (; v->item < count; v->item++) {
        const cairn_rectangle *r = &list[v->item];
        cairn_hypothesis *h;

        if (!cairn_budget_pay(budget, &v->paid, price(v, 4 * (r->half_length + r->half_width))))
            return CAIRN_MORE;
        h = add_hypothesis(v, CAIRN_HYPOTHESIS_RECTANGLE, r->strength);
        for (int32_t i = 0; i < 4 && h != NULL; i++)
            lay_out(v, h, side_of(r, i));
    }
    return CAIRN_OK;
}

/* ---- Kinds of the caller ---- */

static void take_outline(cairn_virtual_scan *v, const cairn_hypothesis_detector *d, int32_t index)
{
    cairn_hypothesis *h = add_hypothesis(v, CAIRN_HYPOTHESIS_CALLER + v->item, 0);
    int32_t room = v->params.max_virtual - v->work.point_count, count;
    cairn_real strength = 0;

    if (h == NULL)
        return;
    count = d->outline(d->state, index, v->params.spacing, &v->work.points[v->work.point_count],
                       room, &strength);
    CAIRN_ASSERT(count >= 0 && count <= room && strength >= 0 && strength <= 1);
    h->strength = strength;
    h->weight = v->params.weight * strength;
    for (int32_t i = 0; i < count; i++)
        v->work.weights[v->work.point_count++] = h->weight;
    h->end_point = v->work.point_count;
}

cairn_status cairn_virtual_ask_callers(cairn_virtual_scan *v, cairn_budget *budget)
{
    while (v->item < v->detector_count) {
        const cairn_hypothesis_detector *d = &v->detectors[v->item];
        cairn_status status = CAIRN_OK;

        if (!v->asked)
            status = d->begin(d->state, &v->map);
        v->asked = 1;
        if (status == CAIRN_OK)
            status = d->step(d->state, budget);
        if (status != CAIRN_OK)
            return status;
        for (; v->cursor < d->count(d->state); v->cursor++) {
            if (!cairn_budget_pay(budget, &v->paid, price(v, CAIRN_REAL(1e6))))
                return CAIRN_MORE;
            take_outline(v, d, v->cursor);
        }
        v->item++;
        v->cursor = 0;
        v->asked = 0;
    }
    return CAIRN_OK;
}
