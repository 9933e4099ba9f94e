/* The segments of a fit, with the free side on the left, and the points every `spacing` along them.
 *
 * A segment is turned so that the sensors that saw its hits are, on balance, on its left.
 * Support of the places along all segments is counted in one array of differences: +1 where a
 * hit's support begins, -1 behind where it ends. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/scan_place.h"
#include "src/mapping/scan_work.h"

/* Stage 0 takes the segments over; stage 1 asks each hit for its side and angle. */
cairn_status cairn_scan_attribute(cairn_scan *x, cairn_budget *budget)
{
    cairn_polyline_view view = cairn_polyline_read(x->polyline);

    for (; x->stage == 0 && x->at < view.segment_count; x->at++) {
        const cairn_polyline_segment *from = &view.segments[x->at];
        scan_wall *w = &x->walls[x->at];

        if (!scan_pay(x, budget, 8))
            return CAIRN_MORE;
        memset(w, 0, sizeof *w);
        w->segment.a.x = from->a[0];
        w->segment.a.y = from->a[1];
        w->segment.b.x = from->b[0];
        w->segment.b.y = from->b[1];
        w->length = cairn_segment_length(w->segment);
        w->first_angle = CAIRN_REAL_MAX;
    }
    if (x->stage == 0) {
        x->wall_count = view.segment_count;
        x->measure.left_out = view.left_out;
        x->measure.converged = view.converged;
        x->stage = 1;
        x->at = 0;
    }
    for (; x->at < x->hit_count; x->at++) {
        int32_t label = view.label[x->at];
        const cairn_beam *beam = &x->beams[x->hit[x->at]];
        scan_wall *w;

        if (!scan_pay(x, budget, 6))
            return CAIRN_MORE;
        if (label < 0) {
            x->measure.uncertain++;
            continue;
        }
        w = &x->walls[label];
        w->side += cairn_vec2_cross(cairn_vec2_sub(w->segment.b, w->segment.a),
                                    cairn_vec2_sub(beam->from, beam->to));
        w->first_angle = cairn_min(w->first_angle, (cairn_real)x->angle[x->hit[x->at]]);
    }
    return CAIRN_OK;
}

static int wall_before(const cairn_scan *x, int32_t a, int32_t b)
{
    cairn_real first = x->walls[a].first_angle, second = x->walls[b].first_angle;

    return first < second || (!(second < first) && a < b);
}

/* Turns the walls, counts their places, and sorts them by insertion. */
cairn_status cairn_scan_turn(cairn_scan *x, cairn_budget *budget)
{
    for (; x->at < x->wall_count; x->at++) {
        scan_wall *w = &x->walls[x->at];

        if (x->stage == 0) {
            if (!scan_pay(x, budget, 16))
                return CAIRN_MORE;
            if (w->side < 0) {
                cairn_vec2 swap = w->segment.a;

                w->segment.a = w->segment.b;
                w->segment.b = swap;
            }
            w->places = cairn_scan_places(w->length, x->params.spacing);
            x->other = x->at;
            x->stage = 1;
        }
        for (; x->other > 0 && wall_before(x, x->at, x->order[x->other - 1]); x->other--) {
            if (!scan_pay(x, budget, 2))
                return CAIRN_MORE;
            x->order[x->other] = x->order[x->other - 1];
        }
        x->order[x->other] = x->at;
        x->stage = 0;
    }
    return CAIRN_OK;
}

/* Adds the places up and finds the shortest wall, the last among equals; it is left out and the
 * sum made anew as long as there are more than max_points. Stage 1 numbers the places in the
 * order of the view. */
cairn_status cairn_scan_choose(cairn_scan *x, cairn_budget *budget)
{
    while (x->stage == 0) {
        if (x->at == 0) {
            x->total = 0;
            x->other = -1;
        }
        for (; x->at < x->wall_count; x->at++) {
            const scan_wall *w = &x->walls[x->at];

            if (!scan_pay(x, budget, 2))
                return CAIRN_MORE;
            x->total += w->places;
            if (w->places > 0 && (x->other < 0 || w->length <= x->walls[x->other].length))
                x->other = x->at;
        }
        x->at = 0;
        if (x->total <= x->params.max_points) {
            x->stage = 1;
            x->place_count = 0;
        } else {
            x->walls[x->other].places = 0;
            x->measure.left_out++;
        }
    }
    for (; x->at < x->wall_count; x->at++) {
        scan_wall *w = &x->walls[x->order[x->at]];

        if (!scan_pay(x, budget, 2))
            return CAIRN_MORE;
        w->first_place = x->place_count;
        x->place_count += w->places;
    }
    return CAIRN_OK;
}

/* Where the first place of a wall is along it. */
static cairn_real margin(const cairn_scan *x, const scan_wall *w)
{
    return cairn_scan_margin(w->length, w->places, x->params.spacing);
}

/* Stage 0 clears the differences, stage 1 enters what each hit supports. */
cairn_status cairn_scan_mark(cairn_scan *x, cairn_budget *budget)
{
    cairn_polyline_view view = cairn_polyline_read(x->polyline);

    for (; x->stage == 0 && x->at <= x->place_count; x->at++) {
        if (!scan_pay(x, budget, 1))
            return CAIRN_MORE;
        x->support[x->at] = 0;
    }
    if (x->stage == 0) {
        x->stage = 1;
        x->at = 0;
    }
    for (; x->at < x->hit_count; x->at++) {
        int32_t label = view.label[x->at], first, last;
        const scan_wall *w = &x->walls[label < 0 ? 0 : label];
        cairn_real along;

        if (!scan_pay(x, budget, 12))
            return CAIRN_MORE;
        if (label < 0 || w->places == 0)
            continue;
        (void)cairn_segment_nearest(w->segment, x->beams[x->hit[x->at]].to, &along);
        along = along * w->length - margin(x, w);
        first = cairn_real_to_int(cairn_ceil((along - x->params.support) / x->params.spacing));
        last = cairn_real_to_int(cairn_floor((along + x->params.support) / x->params.spacing));
        first = first > 0 ? first : 0;
        last = last < w->places - 1 ? last : w->places - 1;
        if (first > last)
            continue;
        x->support[w->first_place + first]++;
        x->support[w->first_place + last + 1]--;
    }
    return CAIRN_OK;
}

/* `at` is the segment of the view, `other` the place on it, `running` the hits that support that
 * place. */
cairn_status cairn_scan_emit(cairn_scan *x, cairn_budget *budget)
{
    for (; x->at < x->wall_count; x->at++, x->other = 0) {
        const scan_wall *w = &x->walls[x->order[x->at]];
        cairn_vec2 direction;

        if (x->stage == 0 && !scan_pay(x, budget, 16))
            return CAIRN_MORE;
        x->stage = 1;
        direction = cairn_vec2_unit(cairn_vec2_sub(w->segment.b, w->segment.a));
        for (; x->other < w->places; x->other++) {
            cairn_oriented_point *point = &x->points[x->point_count];

            if (!scan_pay(x, budget, 9))
                return CAIRN_MORE;
            x->running += x->support[w->first_place + x->other];
            if (x->running <= 0)
                continue;
            point->position = cairn_scan_place(w->segment.a, direction, margin(x, w), x->other,
                                               x->params.spacing);
            point->direction = direction;
            x->point_count++;
        }
        x->stage = 0;
        if (w->places == 0)
            continue;
        x->segments[x->segment_count++] = w->segment;
        x->first_point[x->segment_count] = x->point_count;
    }
    x->view.beam_count = x->input.count;
    x->view.segment_count = x->segment_count;
    x->view.point_count = x->point_count;
    x->view.sensor = x->beams[0].from;
    x->view.stamp_ns = x->input.stamp_ns;
    return CAIRN_OK;
}
