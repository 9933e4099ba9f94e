/* scan: orientation of the fitted segments, free side on the left, and resampling at equal spacing.
 *
 * Method:
 * 1. Orientation: a segment is reversed unless the sensors of its hits are, on balance, on its
 *    left.
 * 2. Segments are sorted by bearing; the shortest are left out until the points fit in memory.
 * 3. Support of the positions along all segments is counted in one difference array: +1 at the
 *    first position a hit supports, -1 behind the last.
 * 4. A prefix sum gives the positions with support, which become points. */
#include "src/base/build.h"

#include <string.h>

#include "src/scans/scan_place.h"
#include "src/scans/scan_work.h"

/* Stage 0 copies the segments; stage 1 adds up the side and the least bearing of each segment's
 * hits. */
cairn_status cairn_scan_attribute(cairn_scan *scan, cairn_budget *budget)
{
    cairn_polyline_view view = cairn_polyline_read(scan->polyline);

    for (; scan->stage == 0 && scan->item_index < view.segment_count; scan->item_index++) {
        const cairn_polyline_segment *from = &view.segments[scan->item_index];
        scan_segment *w = &scan->fitted[scan->item_index];

        if (!cairn_scan_charge(scan, budget, 8))
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
        scan->fitted_count = view.segment_count;
        scan->measure.dropped_segments = view.dropped;
        scan->measure.fit_converged = view.converged;
        scan->stage = 1;
        scan->item_index = 0;
    }
    for (; scan->item_index < scan->hit_count; scan->item_index++) {
        int32_t label = view.label[scan->item_index];
        const cairn_scan_beam *beam = &scan->beams[scan->hit[scan->item_index]];
        scan_segment *w;

        if (!cairn_scan_charge(scan, budget, 6))
            return CAIRN_MORE;
        if (label < 0) {
            scan->measure.unassigned_hits++;
            continue;
        }
        w = &scan->fitted[label];
        w->side += cairn_vec2_cross(cairn_vec2_sub(w->segment.b, w->segment.a),
                                    cairn_vec2_sub(beam->from, beam->to));
        w->first_angle =
            cairn_min(w->first_angle, (cairn_real)scan->angle[scan->hit[scan->item_index]]);
    }
    return CAIRN_OK;
}

static int comes_before(const cairn_scan *scan, int32_t a, int32_t b)
{
    cairn_real first = scan->fitted[a].first_angle, second = scan->fitted[b].first_angle;

    return first < second || (!(second < first) && a < b);
}

/* Orients the segments, counts their positions, and sorts them by insertion. */
cairn_status cairn_scan_turn(cairn_scan *scan, cairn_budget *budget)
{
    for (; scan->item_index < scan->fitted_count; scan->item_index++) {
        scan_segment *w = &scan->fitted[scan->item_index];

        if (scan->stage == 0) {
            if (!cairn_scan_charge(scan, budget, 16))
                return CAIRN_MORE;
            if (w->side < 0) {
                cairn_vec2 swap = w->segment.a;

                w->segment.a = w->segment.b;
                w->segment.b = swap;
            }
            w->positions = cairn_scan_position_count(w->length, scan->params.spacing);
            scan->inner_index = scan->item_index;
            scan->stage = 1;
        }
        for (; scan->inner_index > 0 &&
               comes_before(scan, scan->item_index, scan->order[scan->inner_index - 1]);
             scan->inner_index--) {
            if (!cairn_scan_charge(scan, budget, 2))
                return CAIRN_MORE;
            scan->order[scan->inner_index] = scan->order[scan->inner_index - 1];
        }
        scan->order[scan->inner_index] = scan->item_index;
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
        if (scan->item_index == 0) {
            scan->total = 0;
            scan->inner_index = -1;
        }
        for (; scan->item_index < scan->fitted_count; scan->item_index++) {
            const scan_segment *w = &scan->fitted[scan->item_index];

            if (!cairn_scan_charge(scan, budget, 2))
                return CAIRN_MORE;
            scan->total += w->positions;
            if (w->positions > 0 &&
                (scan->inner_index < 0 || w->length <= scan->fitted[scan->inner_index].length))
                scan->inner_index = scan->item_index;
        }
        scan->item_index = 0;
        if (scan->total <= scan->params.max_points) {
            scan->stage = 1;
            scan->position_count = 0;
        } else {
            scan->fitted[scan->inner_index].positions = 0;
            scan->measure.dropped_segments++;
        }
    }
    for (; scan->item_index < scan->fitted_count; scan->item_index++) {
        scan_segment *w = &scan->fitted[scan->order[scan->item_index]];

        if (!cairn_scan_charge(scan, budget, 2))
            return CAIRN_MORE;
        w->first_position = scan->position_count;
        scan->position_count += w->positions;
    }
    return CAIRN_OK;
}

/* Distance of the first position from the segment's start, m. */
static cairn_real first_position(const cairn_scan *scan, const scan_segment *segment)
{
    return cairn_scan_first_position(segment->length, segment->positions, scan->params.spacing);
}

/* Stage 0 clears the difference array, stage 1 enters the interval that each hit supports. */
cairn_status cairn_scan_mark(cairn_scan *scan, cairn_budget *budget)
{
    cairn_polyline_view view = cairn_polyline_read(scan->polyline);

    for (; scan->stage == 0 && scan->item_index <= scan->position_count; scan->item_index++) {
        if (!cairn_scan_charge(scan, budget, 1))
            return CAIRN_MORE;
        scan->support[scan->item_index] = 0;
    }
    if (scan->stage == 0) {
        scan->stage = 1;
        scan->item_index = 0;
    }
    for (; scan->item_index < scan->hit_count; scan->item_index++) {
        int32_t label = view.label[scan->item_index], first, last;
        const scan_segment *w = &scan->fitted[label < 0 ? 0 : label];
        cairn_real along;

        if (!cairn_scan_charge(scan, budget, 12))
            return CAIRN_MORE;
        if (label < 0 || w->positions == 0)
            continue;
        (void)cairn_segment_nearest(w->segment, scan->beams[scan->hit[scan->item_index]].to,
                                    &along);
        along = along * w->length - first_position(scan, w);
        first = cairn_real_to_int(
            cairn_ceil((along - scan->params.support_distance) / scan->params.spacing));
        last = cairn_real_to_int(
            cairn_floor((along + scan->params.support_distance) / scan->params.spacing));
        first = first > 0 ? first : 0;
        last = last < w->positions - 1 ? last : w->positions - 1;
        if (first > last)
            continue;
        scan->support[w->first_position + first]++;
        scan->support[w->first_position + last + 1]--;
    }
    return CAIRN_OK;
}

/* Writes points and segments of the view. item_index: segment of the view; inner_index: position on
 * it; support_count: number of hits that support the position. */
cairn_status cairn_scan_emit(cairn_scan *scan, cairn_budget *budget)
{
    for (; scan->item_index < scan->fitted_count; scan->item_index++, scan->inner_index = 0) {
        const scan_segment *w = &scan->fitted[scan->order[scan->item_index]];
        cairn_vec2 direction;

        if (scan->stage == 0 && !cairn_scan_charge(scan, budget, 16))
            return CAIRN_MORE;
        scan->stage = 1;
        direction = cairn_vec2_unit(cairn_vec2_sub(w->segment.b, w->segment.a));
        for (; scan->inner_index < w->positions; scan->inner_index++) {
            cairn_oriented_point *point = &scan->points[scan->point_count];

            if (!cairn_scan_charge(scan, budget, 9))
                return CAIRN_MORE;
            scan->support_count += scan->support[w->first_position + scan->inner_index];
            if (scan->support_count <= 0)
                continue;
            point->position = cairn_scan_position(w->segment.a, direction, first_position(scan, w),
                                                  scan->inner_index, scan->params.spacing);
            point->direction = direction;
            scan->point_count++;
        }
        scan->stage = 0;
        if (w->positions == 0)
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
