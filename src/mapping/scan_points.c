/* scan: orientation of the fitted segments, free side on the left, and resampling at equal spacing.
 *
 * Method:
 * 1. Orientation: a segment is reversed unless the sensors of its hits are, on balance, on its
 *    left.
 * 2. Segments are sorted by bearing; the shortest are left out until the points fit in memory.
 * 3. Support of the positions along all segments is counted in one difference array: +1 at the
 *    first position a hit supports, -1 behind the last.
 * 4. A prefix sum gives the positions with support, which become points. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/scan_place.h"
#include "src/mapping/scan_work.h"

/* Stage 0 copies the segments; stage 1 adds up the side and the least bearing of each segment's
 * hits. */
cairn_status cairn_scan_attribute(cairn_scan *scan, cairn_budget *budget)
{
    cairn_polyline_view view = cairn_polyline_read(scan->polyline);

    for (; scan->stage == 0 && scan->at < view.segment_count; scan->at++) {
        const cairn_polyline_segment *from = &view.segments[scan->at];
        scan_segment *w = &scan->walls[scan->at];

        if (!cairn_scan_pay(scan, budget, 8))
            return CAIRN_MORE;
        memset(w, 0, sizeof *w);
        w->segment.a.x = from->a[0];
        w->segment.a.y = from->a[1];
        w->segment.b.x = from->b[0];
        w->segment.b.y = from->b[1];
        w->length = cairn_segment_length(w->segment);
        w->first_angle = CAIRN_REAL_MAX;
    }
    if (scan->stage == 0) {
        scan->wall_count = view.segment_count;
        scan->measure.left_out = view.left_out;
        scan->measure.converged = view.converged;
        scan->stage = 1;
        scan->at = 0;
    }
    for (; scan->at < scan->hit_count; scan->at++) {
        int32_t label = view.label[scan->at];
        const cairn_beam *beam = &scan->beams[scan->hit[scan->at]];
        scan_segment *w;

        if (!cairn_scan_pay(scan, budget, 6))
            return CAIRN_MORE;
        if (label < 0) {
            scan->measure.uncertain++;
            continue;
        }
        w = &scan->walls[label];
        w->side += cairn_vec2_cross(cairn_vec2_sub(w->segment.b, w->segment.a),
                                    cairn_vec2_sub(beam->from, beam->to));
        w->first_angle = cairn_min(w->first_angle, (cairn_real)scan->angle[scan->hit[scan->at]]);
    }
    return CAIRN_OK;
}

static int comes_before(const cairn_scan *scan, int32_t a, int32_t b)
{
    cairn_real first = scan->walls[a].first_angle, second = scan->walls[b].first_angle;

    return first < second || (!(second < first) && a < b);
}

/* Orients the segments, counts their positions, and sorts them by insertion. */
cairn_status cairn_scan_turn(cairn_scan *scan, cairn_budget *budget)
{
    for (; scan->at < scan->wall_count; scan->at++) {
        scan_segment *w = &scan->walls[scan->at];

        if (scan->stage == 0) {
            if (!cairn_scan_pay(scan, budget, 16))
                return CAIRN_MORE;
            if (w->side < 0) {
                cairn_vec2 swap = w->segment.a;

                w->segment.a = w->segment.b;
                w->segment.b = swap;
            }
            w->places = cairn_scan_places(w->length, scan->params.spacing);
            scan->other = scan->at;
            scan->stage = 1;
        }
        for (; scan->other > 0 && comes_before(scan, scan->at, scan->order[scan->other - 1]);
             scan->other--) {
            if (!cairn_scan_pay(scan, budget, 2))
                return CAIRN_MORE;
            scan->order[scan->other] = scan->order[scan->other - 1];
        }
        scan->order[scan->other] = scan->at;
        scan->stage = 0;
    }
    return CAIRN_OK;
}

/* Stage 0 sums the positions and finds the shortest segment, the last among equals; while the sum
 * exceeds max_points this segment is left out and the sum restarts. Stage 1 numbers the positions
 * in the order of the view. */
cairn_status cairn_scan_choose(cairn_scan *scan, cairn_budget *budget)
{
    while (scan->stage == 0) {
        if (scan->at == 0) {
            scan->total = 0;
            scan->other = -1;
        }
        for (; scan->at < scan->wall_count; scan->at++) {
            const scan_segment *w = &scan->walls[scan->at];

            if (!cairn_scan_pay(scan, budget, 2))
                return CAIRN_MORE;
            scan->total += w->places;
            if (w->places > 0 && (scan->other < 0 || w->length <= scan->walls[scan->other].length))
                scan->other = scan->at;
        }
        scan->at = 0;
        if (scan->total <= scan->params.max_points) {
            scan->stage = 1;
            scan->place_count = 0;
        } else {
            scan->walls[scan->other].places = 0;
            scan->measure.left_out++;
        }
    }
    for (; scan->at < scan->wall_count; scan->at++) {
        scan_segment *w = &scan->walls[scan->order[scan->at]];

        if (!cairn_scan_pay(scan, budget, 2))
            return CAIRN_MORE;
        w->first_place = scan->place_count;
        scan->place_count += w->places;
    }
    return CAIRN_OK;
}

/* Distance of the first position from the segment's start, m. */
static cairn_real first_position(const cairn_scan *scan, const scan_segment *w)
{
    return cairn_scan_margin(w->length, w->places, scan->params.spacing);
}

/* Stage 0 clears the difference array, stage 1 enters the interval that each hit supports. */
cairn_status cairn_scan_mark(cairn_scan *scan, cairn_budget *budget)
{
    cairn_polyline_view view = cairn_polyline_read(scan->polyline);

    for (; scan->stage == 0 && scan->at <= scan->place_count; scan->at++) {
        if (!cairn_scan_pay(scan, budget, 1))
            return CAIRN_MORE;
        scan->support[scan->at] = 0;
    }
    if (scan->stage == 0) {
        scan->stage = 1;
        scan->at = 0;
    }
    for (; scan->at < scan->hit_count; scan->at++) {
        int32_t label = view.label[scan->at], first, last;
        const scan_segment *w = &scan->walls[label < 0 ? 0 : label];
        cairn_real along;

        if (!cairn_scan_pay(scan, budget, 12))
            return CAIRN_MORE;
        if (label < 0 || w->places == 0)
            continue;
        (void)cairn_segment_nearest(w->segment, scan->beams[scan->hit[scan->at]].to, &along);
        along = along * w->length - first_position(scan, w);
        first =
            cairn_real_to_int(cairn_ceil((along - scan->params.support) / scan->params.spacing));
        last =
            cairn_real_to_int(cairn_floor((along + scan->params.support) / scan->params.spacing));
        first = first > 0 ? first : 0;
        last = last < w->places - 1 ? last : w->places - 1;
        if (first > last)
            continue;
        scan->support[w->first_place + first]++;
        scan->support[w->first_place + last + 1]--;
    }
    return CAIRN_OK;
}

/* Writes points and segments of the view. item_index: segment of the view; inner_index: position on
 * it; support_count: number of hits that support the position. */
cairn_status cairn_scan_emit(cairn_scan *scan, cairn_budget *budget)
{
    for (; scan->at < scan->wall_count; scan->at++, scan->other = 0) {
        const scan_segment *w = &scan->walls[scan->order[scan->at]];
        cairn_vec2 direction;

        if (scan->stage == 0 && !cairn_scan_pay(scan, budget, 16))
            return CAIRN_MORE;
        scan->stage = 1;
        direction = cairn_vec2_unit(cairn_vec2_sub(w->segment.b, w->segment.a));
        for (; scan->other < w->places; scan->other++) {
            cairn_oriented_point *point = &scan->points[scan->point_count];

            if (!cairn_scan_pay(scan, budget, 9))
                return CAIRN_MORE;
            scan->running += scan->support[w->first_place + scan->other];
            if (scan->running <= 0)
                continue;
            point->position = cairn_scan_place(w->segment.a, direction, first_position(scan, w),
                                               scan->other, scan->params.spacing);
            point->direction = direction;
            scan->point_count++;
        }
        scan->stage = 0;
        if (w->places == 0)
            continue;
        scan->segments[scan->segment_count++] = w->segment;
        scan->first_point[scan->segment_count] = scan->point_count;
    }
    scan->view.beam_count = scan->input.count;
    scan->view.segment_count = scan->segment_count;
    scan->view.point_count = scan->point_count;
    scan->view.sensor = scan->beams[0].from;
    scan->view.stamp_ns = scan->input.stamp_ns;
    return CAIRN_OK;
}
