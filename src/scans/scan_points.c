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

/* Starts a segment with the ends of the line fit. */
static void copy_segment(cairn_scan *scan, int32_t index, const cairn_polyline_segment *from)
{
    scan_segment *segment = &scan->fitted[index];

    memset(segment, 0, sizeof *segment);
    segment->segment.a.x = from->a[0];
    segment->segment.a.y = from->a[1];
    segment->segment.b.x = from->b[0];
    segment->segment.b.y = from->b[1];
    segment->length = cairn_segment_length(segment->segment);
    segment->first_angle = CAIRN_REAL_MAX;
}

/* Adds a hit to the side and to the least bearing of its segment. label: segment of the hit; -1:
 * none. */
static void attribute_hit(cairn_scan *scan, int32_t hit, int32_t label)
{
    const cairn_scan_beam *beam = &scan->beams[scan->hit[hit]];
    scan_segment *segment;

    if (label < 0) {
        scan->measure.unassigned_hits++;
        return;
    }
    segment = &scan->fitted[label];
    segment->side += cairn_vec2_cross(cairn_vec2_sub(segment->segment.b, segment->segment.a),
                                      cairn_vec2_sub(beam->from, beam->to));
    segment->first_angle = cairn_min(segment->first_angle, (cairn_real)scan->angle[scan->hit[hit]]);
}

int cairn_scan_attribute(cairn_scan *scan, cairn_budget *budget)
{
    cairn_polyline_view view = cairn_polyline_read(scan->polyline);

    CAIRN_STEP_BEGIN(scan->phase_resume);
    scan->fitted_count = view.segment_count;
    scan->measure.dropped_segments = view.dropped;
    scan->measure.fit_converged = view.converged;
    for (scan->cursor = 0; scan->cursor < scan->fitted_count; scan->cursor++) {
        CAIRN_STEP_CHARGE_EIGHTHS(scan, phase_resume, budget, 8);
        copy_segment(scan, scan->cursor, &view.segments[scan->cursor]);
    }
    for (scan->cursor = 0; scan->cursor < scan->hit_count; scan->cursor++) {
        CAIRN_STEP_CHARGE_EIGHTHS(scan, phase_resume, budget, 6);
        attribute_hit(scan, scan->cursor, view.label[scan->cursor]);
    }
    CAIRN_STEP_END(scan->phase_resume);
}

/* Reverses a segment unless its free side is on its left, and counts its positions. */
static void orient_segment(cairn_scan *scan, int32_t index)
{
    scan_segment *segment = &scan->fitted[index];

    if (segment->side < 0) {
        cairn_vec2 swap = segment->segment.a;

        segment->segment.a = segment->segment.b;
        segment->segment.b = swap;
    }
    segment->positions = cairn_scan_position_count(segment->length, scan->params.spacing);
}

/* 1 when segment a comes before segment b in the order of the view. */
static int comes_before(const cairn_scan *scan, int32_t a, int32_t b)
{
    cairn_real first = scan->fitted[a].first_angle, second = scan->fitted[b].first_angle;

    return first < second || (!(second < first) && a < b);
}

int cairn_scan_turn(cairn_scan *scan, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(scan->phase_resume);
    for (scan->cursor = 0; scan->cursor < scan->fitted_count; scan->cursor++) {
        CAIRN_STEP_CHARGE_EIGHTHS(scan, phase_resume, budget, 16);
        orient_segment(scan, scan->cursor);
        /* Insertion sort. */
        for (scan->place = scan->cursor;
             scan->place > 0 && comes_before(scan, scan->cursor, scan->order[scan->place - 1]);
             scan->place--) {
            CAIRN_STEP_CHARGE_EIGHTHS(scan, phase_resume, budget, 2);
            scan->order[scan->place] = scan->order[scan->place - 1];
        }
        scan->order[scan->place] = scan->cursor;
    }
    CAIRN_STEP_END(scan->phase_resume);
}

/* Adds the positions of a segment to the total, and finds the shortest segment with positions, the
 * last among equals. */
static void add_positions(cairn_scan *scan, int32_t index)
{
    const scan_segment *segment = &scan->fitted[index];

    scan->total += segment->positions;
    if (segment->positions > 0 &&
        (scan->shortest < 0 || segment->length <= scan->fitted[scan->shortest].length))
        scan->shortest = index;
}

/* Leaves out the shortest segment when there are more positions than capacity; 0: none was left
 * out. */
static int leave_out_shortest(cairn_scan *scan)
{
    if (scan->total <= scan->params.max_points)
        return 0;
    scan->fitted[scan->shortest].positions = 0;
    scan->measure.dropped_segments++;
    return 1;
}

/* Numbers the positions of a segment behind those before. */
static void number_positions(cairn_scan *scan, scan_segment *segment)
{
    segment->first_position = scan->position_count;
    scan->position_count += segment->positions;
}

int cairn_scan_choose(cairn_scan *scan, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(scan->phase_resume);
    do {
        scan->total = 0;
        scan->shortest = -1;
        for (scan->cursor = 0; scan->cursor < scan->fitted_count; scan->cursor++) {
            CAIRN_STEP_CHARGE_EIGHTHS(scan, phase_resume, budget, 2);
            add_positions(scan, scan->cursor);
        }
    } while (leave_out_shortest(scan));
    scan->position_count = 0;
    for (scan->cursor = 0; scan->cursor < scan->fitted_count; scan->cursor++) {
        CAIRN_STEP_CHARGE_EIGHTHS(scan, phase_resume, budget, 2);
        number_positions(scan, &scan->fitted[scan->order[scan->cursor]]);
    }
    CAIRN_STEP_END(scan->phase_resume);
}

/* Distance of the first position from the segment's start, m. */
static cairn_real first_position(const cairn_scan *scan, const scan_segment *segment)
{
    return cairn_scan_first_position(segment->length, segment->positions, scan->params.spacing);
}

/* Enters the interval of positions that a hit supports into the difference array. label: segment of
 * the hit; -1: none. */
static void mark_support(cairn_scan *scan, int32_t hit, int32_t label)
{
    const scan_segment *segment = &scan->fitted[label < 0 ? 0 : label];
    int32_t first, last;
    cairn_real along;

    if (label < 0 || segment->positions == 0)
        return;
    (void)cairn_segment_nearest(segment->segment, scan->beams[scan->hit[hit]].to, &along);
    along = along * segment->length - first_position(scan, segment);
    first = cairn_real_to_int(
        cairn_ceil((along - scan->params.support_distance) / scan->params.spacing));
    last = cairn_real_to_int(
        cairn_floor((along + scan->params.support_distance) / scan->params.spacing));
    first = first > 0 ? first : 0;
    last = last < segment->positions - 1 ? last : segment->positions - 1;
    if (first > last)
        return;
    scan->support[segment->first_position + first]++;
    scan->support[segment->first_position + last + 1]--;
}

int cairn_scan_mark(cairn_scan *scan, cairn_budget *budget)
{
    cairn_polyline_view view = cairn_polyline_read(scan->polyline);

    CAIRN_STEP_BEGIN(scan->phase_resume);
    for (scan->cursor = 0; scan->cursor <= scan->position_count; scan->cursor++) {
        CAIRN_STEP_CHARGE_EIGHTHS(scan, phase_resume, budget, 1);
        scan->support[scan->cursor] = 0;
    }
    for (scan->cursor = 0; scan->cursor < scan->hit_count; scan->cursor++) {
        CAIRN_STEP_CHARGE_EIGHTHS(scan, phase_resume, budget, 12);
        mark_support(scan, scan->cursor, view.label[scan->cursor]);
    }
    CAIRN_STEP_END(scan->phase_resume);
}

/* Writes the point at the current position of a segment when a hit supports it. */
static void emit_point(cairn_scan *scan, const scan_segment *segment)
{
    cairn_oriented_point *point = &scan->points[scan->point_count];

    scan->support_count += scan->support[segment->first_position + scan->position];
    if (scan->support_count <= 0)
        return;
    point->position =
        cairn_scan_position(segment->segment.a, scan->direction, first_position(scan, segment),
                            scan->position, scan->params.spacing);
    point->direction = scan->direction;
    scan->point_count++;
}

/* Writes a segment, whose points are written, unless it was left out. */
static void emit_segment(cairn_scan *scan, const scan_segment *segment)
{
    if (segment->positions == 0)
        return;
    scan->segments[scan->segment_count++] = segment->segment;
    scan->first_point[scan->segment_count] = scan->point_count;
}

/* Completes the view. */
static void end_view(cairn_scan *scan)
{
    scan->view.beam_count = scan->input.count;
    scan->view.segment_count = scan->segment_count;
    scan->view.point_count = scan->point_count;
    scan->view.sensor = scan->beams[0].from;
    scan->view.stamp_ns = scan->input.stamp_ns;
}

/* The segment at the cursor, in the order of the view. */
static const scan_segment *segment_at(const cairn_scan *scan)
{
    return &scan->fitted[scan->order[scan->cursor]];
}

int cairn_scan_emit(cairn_scan *scan, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(scan->phase_resume);
    scan->support_count = 0;
    for (scan->cursor = 0; scan->cursor < scan->fitted_count; scan->cursor++) {
        CAIRN_STEP_CHARGE_EIGHTHS(scan, phase_resume, budget, 16);
        scan->direction = cairn_vec2_unit(
            cairn_vec2_sub(segment_at(scan)->segment.b, segment_at(scan)->segment.a));
        for (scan->position = 0; scan->position < segment_at(scan)->positions; scan->position++) {
            CAIRN_STEP_CHARGE_EIGHTHS(scan, phase_resume, budget, 9);
            emit_point(scan, segment_at(scan));
        }
        emit_segment(scan, segment_at(scan));
    }
    end_view(scan);
    CAIRN_STEP_END(scan->phase_resume);
}
