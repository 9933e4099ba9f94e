/* Contour completion: the segments along the deformed outline, extended along their chains.
 *
 * Method:
 * 1. A segment belongs to the contour when most of it is near the outline and parallel to it.
 * 2. Gaps within a chain are closed: segments between two contour segments of one chain lie on the
 *    same edge.
 * 3. Beyond its last contour segments a chain is followed while it stays near the outline, and
 *    across junctions to other chains that start there. The offset from the outline may grow slowly
 *    on the way.
 * 4. Where edges leave the outline they are followed for a limited length. Near the gaps of the
 *    drawing, where the object continues beyond the model outline, they are followed round any
 *    corner. */
#include "src/base/build.h"

#include <string.h>

#include "src/base/step.h"
#include "src/detection/contour_search_work.h"

/* Share of the object's size: greatest gap within a chain that is closed. */
static const cairn_real MAX_GAP_SHARE = CAIRN_REAL(0.15);
/* Shares of the size. A chain is followed within MAX_OFFSET_SHARE of the outline, or up to
 * OFFSET_GROWTH_SHARE beyond the offset of the previous segment, but never beyond MAX_DRIFT_SHARE.
 * And the least cosine of the angle to the outline. */
static const cairn_real MAX_OFFSET_SHARE = CAIRN_REAL(0.05);
static const cairn_real OFFSET_GROWTH_SHARE = CAIRN_REAL(0.03);
static const cairn_real MAX_DRIFT_SHARE = CAIRN_REAL(0.1);
static const cairn_real MIN_COSINE = CAIRN_REAL(0.8);
/* Greatest distance of a segment along the outline, share of the size, but at least
 * MIN_DISTANCE_PX; and the step of the test samples, px. */
static const cairn_real MAX_DISTANCE_SHARE = CAIRN_REAL(0.045);
enum { MIN_DISTANCE_PX = 3 };
enum { SAMPLE_STEP_PX = 3 };
/* Greatest length that edges are followed beyond the outline, share of the size. */
static const cairn_real MAX_EXTENSION_SHARE = CAIRN_REAL(0.35);
/* Margin of the outline's box within which they are followed, share of the size: a drawing may end
 * where the object continues, as at legs. Least cosines of the turning angle along a chain and
 * across a junction. */
static const cairn_real BOX_MARGIN_SHARE = CAIRN_REAL(0.2);
static const cairn_real MIN_CHAIN_COSINE = CAIRN_REAL(0.5);
static const cairn_real MIN_JUNCTION_COSINE = CAIRN_REAL(0.6);
/* Radius around a gap of the drawing, share of the size, where the object continues. Least cosine
 * of the turning angle along a chain there. Greatest distance of adjacent ends, px, in any
 * direction. */
static const cairn_real GAP_RADIUS_SHARE = CAIRN_REAL(0.3);
static const cairn_real MIN_GAP_COSINE = CAIRN_REAL(0.3);
enum { GAP_JUNCTION_PX = 10 };
/* Greatest distance between adjacent ends of chains, px. */
enum { JUNCTION_PX = 4 };
enum { MAX_ROUNDS = 8 };

/* Segments, outline samples, neighbours that are looked at in a unit. */
enum { SEGMENTS_PER_UNIT = 8, SAMPLES_PER_UNIT = 16, NEIGHBOURS_PER_UNIT = 4 };

static cairn_vec2 middle_of(cairn_segment line)
{
    return cairn_vec2_scale(cairn_vec2_add(line.a, line.b), CAIRN_REAL(0.5));
}

/* Index of the outline sample nearest to a point; *distance to it. */
static int32_t nearest_sample(const contour_search_fitted_outline *fitted, cairn_vec2 point,
                              cairn_real *distance)
{
    return cairn_contour_search_nearest_sample(fitted->outline, fitted->outline_count, point,
                                               distance);
}

/* Returns 1 when a line is parallel to the outline at a sample. */
static int is_parallel(const contour_search_fitted_outline *fitted, int32_t sample,
                       cairn_segment line)
{
    cairn_vec2 along = cairn_vec2_unit(cairn_vec2_sub(line.b, line.a));

    return cairn_abs(cairn_vec2_dot(fitted->outline[sample].direction, along)) >= MIN_COSINE;
}

/* Returns 1 when the contour continues from one selected segment to another. */
static int is_continuation(const contour_search_fitted_outline *fitted, cairn_segment from,
                           cairn_segment line)
{
    cairn_real previous, distance;
    int32_t sample = nearest_sample(fitted, middle_of(line), &distance);

    (void)nearest_sample(fitted, middle_of(from), &previous);
    return distance <= MAX_DRIFT_SHARE * fitted->size &&
           distance <= cairn_max(MAX_OFFSET_SHARE * fitted->size,
                                 previous + OFFSET_GROWTH_SHARE * fitted->size) &&
           is_parallel(fitted, sample, line);
}

/* Returns 1 when most of a segment is along the outline. */
static int is_along_outline(const contour_search_fitted_outline *fitted, cairn_segment line)
{
    int32_t steps = 1 + (int32_t)(cairn_segment_length(line) / SAMPLE_STEP_PX), near_count = 0;
    cairn_real max_distance = cairn_max(MIN_DISTANCE_PX, MAX_DISTANCE_SHARE * fitted->size);

    for (int32_t k = 0; k <= steps; k++) {
        cairn_real share = (cairn_real)k / (cairn_real)steps, distance;
        int32_t sample =
            nearest_sample(fitted, cairn_vec2_interpolate(line.a, line.b, share), &distance);

        near_count += distance <= max_distance && is_parallel(fitted, sample, line);
    }
    return 2 * near_count > steps + 1;
}

/* Closes the gaps of one chain, segments [from ... to - 1]. */
static void close_gaps(const cairn_contour_search_tokens *tokens,
                       const contour_search_fitted_outline *fitted, int32_t from, int32_t to,
                       uint8_t *selected)
{
    cairn_real gap = 0;
    int32_t previous = -1;

    for (int32_t i = from; i < to; i++) {
        if (!selected[i]) {
            gap += cairn_segment_length(tokens->lines[i]);
            continue;
        }
        if (previous >= 0 && gap <= MAX_GAP_SHARE * fitted->size)
            memset(&selected[previous], 1, (size_t)(i - previous));
        previous = i;
        gap = 0;
    }
}

/* Extends the selection along one chain, in both directions. */
static void follow(const cairn_contour_search_tokens *tokens,
                   const contour_search_fitted_outline *fitted, int32_t from, int32_t to,
                   uint8_t *selected)
{
    for (int32_t i = from + 1; i < to; i++)
        if (!selected[i] && selected[i - 1])
            selected[i] = (uint8_t)is_continuation(fitted, tokens->lines[i - 1], tokens->lines[i]);
    for (int32_t i = to - 2; i >= from; i--)
        if (!selected[i] && selected[i + 1])
            selected[i] = (uint8_t)is_continuation(fitted, tokens->lines[i + 1], tokens->lines[i]);
}

/* Whether the segment at the cursor belongs to the contour. */
static int is_selected(const contour_search_collector *collector)
{
    return collector->selected[collector->ends.listed[collector->cursor]];
}

/* Units of finding the neighbours of the segment at the cursor, when they are wanted. */
static int32_t units_of_query(const contour_search_collector *collector, int is_wanted)
{
    return 1 + (is_wanted
                    ? cairn_contour_search_ends_compared(&collector->ends, collector->cursor) /
                          NEIGHBOURS_PER_UNIT
                    : 0);
}

/* Finds the neighbours of the end at the cursor, when its segment is selected. */
static void find_neighbours(contour_search_collector *collector)
{
    collector->neighbour_count =
        is_selected(collector) ? cairn_contour_search_ends_near(&collector->ends, collector->cursor)
                               : 0;
}

/* Selects those neighbours with which the contour continues from the end at the cursor. */
static void cross_junction(contour_search_collector *collector)
{
    const contour_search_ends *ends = &collector->ends;
    int32_t from = ends->listed[collector->cursor];

    for (int32_t k = 0; k < collector->neighbour_count; k++) {
        int32_t to = ends->listed[ends->neighbours[k]];

        if (!collector->selected[to] &&
            is_continuation(&collector->fitted, collector->tokens->lines[from],
                            collector->tokens->lines[to])) {
            collector->selected[to] = 1;
            collector->has_grown = 1;
        }
    }
}

/* Returns 1 when a segment of a chain is selected. */
static int is_any_selected(const contour_search_collector *collector, int32_t from, int32_t to)
{
    int is_any = 0;

    for (int32_t i = from; i < to && !is_any; i++)
        is_any = collector->selected[i];
    return is_any;
}

/* Closes gaps and extends the ends of a chain with a selected segment. */
static void complete_chain(contour_search_collector *collector, int32_t from, int32_t to)
{
    if (!is_any_selected(collector, from, to))
        return;
    close_gaps(collector->tokens, &collector->fitted, from, to, collector->selected);
    follow(collector->tokens, &collector->fitted, from, to, collector->selected);
}

/* Lists the first and last segments of the chains near the object; returns their number. */
static int32_t list_ends(const cairn_contour_search_tokens *tokens,
                         const contour_search_fitted_outline *fitted, int32_t *ends)
{
    int32_t count = 0;

    for (int32_t from = 0, to; from < tokens->count; from = to) {
        to = cairn_contour_search_end_of_chain(tokens, from);
        for (int32_t k = 0; k < 1 + (to - from > 1); k++) {
            int32_t i = k == 0 ? from : to - 1;

            if (cairn_vec2_norm(cairn_vec2_sub(middle_of(tokens->lines[i]), fitted->origin)) <=
                fitted->size)
                ends[count++] = i;
        }
    }
    return count;
}

static int32_t compare_places(const void *first, const void *second)
{
    const contour_search_order *a = first, *b = second;

    return a->sample != b->sample ? a->sample - b->sample : a->segment - b->segment;
}

/* Returns 1 for a segment along the outline, near the object only. */
static int is_near_outline(const contour_search_collector *collector, int32_t segment)
{
    const contour_search_fitted_outline *fitted = &collector->fitted;
    cairn_segment line = collector->tokens->lines[segment];

    return cairn_vec2_norm(cairn_vec2_sub(middle_of(line), fitted->origin)) <= fitted->size &&
           is_along_outline(fitted, line);
}

/* ---- Beyond the outline ---- */

static int is_turn_below(cairn_segment from, cairn_segment to, cairn_real cosine)
{
    return cairn_vec2_dot(cairn_vec2_unit(cairn_vec2_sub(from.b, from.a)),
                          cairn_vec2_unit(cairn_vec2_sub(to.b, to.a))) >= cosine;
}

/* Returns 1 when the second line continues from an end of the first, within `junction` px and a
 * turning angle of at least the given cosine. */
static int continues(cairn_segment from, cairn_segment to, cairn_real junction, cairn_real cosine)
{
    for (int32_t k = 0; k < 4; k++) {
        cairn_vec2 end = k % 2 == 0 ? from.b : from.a,
                   out = cairn_vec2_sub(end, k % 2 == 0 ? from.a : from.b);
        cairn_vec2 start = k / 2 == 0 ? to.a : to.b,
                   forward = cairn_vec2_sub(k / 2 == 0 ? to.b : to.a, start);

        if (cairn_vec2_norm_squared(cairn_vec2_sub(start, end)) <= junction * junction &&
            cairn_vec2_dot(cairn_vec2_unit(out), cairn_vec2_unit(forward)) >= cosine)
            return 1;
    }
    return 0;
}

static int is_near_gap(const contour_search_collector *collector, cairn_vec2 middle)
{
    const contour_search_gaps *gaps = &collector->gaps;
    int32_t is_near = !collector->extension.only_near_gaps;

    for (int32_t i = 0; !is_near && i < gaps->count; i++)
        is_near =
            cairn_vec2_norm(cairn_vec2_sub(middle, gaps->at[i])) <= collector->extension.gap_radius;
    return is_near;
}

/* Extends the selection from one segment to another. */
static void extend(contour_search_collector *collector, int32_t from, int32_t to)
{
    contour_search_extension *extension = &collector->extension;
    cairn_vec2 middle = middle_of(collector->tokens->lines[to]);
    cairn_real length;

    if (!(extension->length[from] < CAIRN_REAL_MAX) || extension->length[to] == 0)
        return;
    length = extension->length[from] + cairn_segment_length(collector->tokens->lines[to]);
    if (length <= extension->max_length && length < extension->length[to] &&
        middle.x >= extension->box_min.x && middle.y >= extension->box_min.y &&
        middle.x <= extension->box_max.x && middle.y <= extension->box_max.y &&
        is_near_gap(collector, middle)) {
        extension->length[to] = length;
        collector->has_grown = 1;
    }
}

static void extend_chain(contour_search_collector *collector, int32_t from, int32_t to)
{
    const cairn_segment *lines = collector->tokens->lines;

    for (int32_t i = from + 1; i < to; i++)
        if (is_turn_below(lines[i - 1], lines[i], collector->extension.chain_cosine))
            extend(collector, i - 1, i);
    for (int32_t i = to - 2; i >= from; i--)
        if (is_turn_below(lines[i], lines[i + 1], collector->extension.chain_cosine))
            extend(collector, i + 1, i);
}

/* Whether the segment at the cursor is reached and may be followed further. */
static int is_extended(const contour_search_collector *collector)
{
    const contour_search_extension *extension = &collector->extension;

    return extension->length[collector->ends.listed[collector->cursor]] < extension->max_length;
}

/* Finds the neighbours of the end at the cursor, when the selection may grow from its segment. */
static void find_extending_neighbours(contour_search_collector *collector)
{
    collector->neighbour_count =
        is_extended(collector) ? cairn_contour_search_ends_near(&collector->ends, collector->cursor)
                               : 0;
}

/* Extends the selection from the end at the cursor to its neighbours. */
static void extend_junction(contour_search_collector *collector)
{
    const contour_search_ends *ends = &collector->ends;
    const contour_search_extension *extension = &collector->extension;
    int32_t from = ends->listed[collector->cursor];

    for (int32_t k = 0; k < collector->neighbour_count; k++) {
        int32_t to = ends->listed[ends->neighbours[k]];

        if (continues(collector->tokens->lines[from], collector->tokens->lines[to],
                      ends->max_distance, extension->junction_cosine))
            extend(collector, from, to);
    }
}

/* Starts to follow edges from the selected segments. */
static void begin_extension(contour_search_collector *collector)
{
    contour_search_extension *extension = &collector->extension;
    const contour_search_fitted_outline *fitted = &collector->fitted;
    cairn_real margin = BOX_MARGIN_SHARE * fitted->size;
    cairn_box box = cairn_box_empty();

    for (int32_t i = 0; i < fitted->outline_count; i++)
        box = cairn_box_extend(box, fitted->outline[i].position);
    extension->box_min = cairn_vec2_sub(box.min, (cairn_vec2){margin, margin});
    extension->box_max = cairn_vec2_add(box.max, (cairn_vec2){margin, margin});
    extension->max_length = MAX_EXTENSION_SHARE * fitted->size;
    extension->chain_cosine = MIN_CHAIN_COSINE;
    extension->junction_cosine = MIN_JUNCTION_COSINE;
    extension->only_near_gaps = 0;
    extension->gap_radius = GAP_RADIUS_SHARE * fitted->size;
    for (int32_t i = 0; i < collector->tokens->count; i++)
        extension->length[i] = collector->selected[i] ? 0 : CAIRN_REAL_MAX;
}

/* Starts the second pass near the gaps, from all segments reached. */
static void begin_gap_extension(contour_search_collector *collector)
{
    contour_search_extension *extension = &collector->extension;

    cairn_contour_search_ends_make(&collector->ends, collector->tokens->lines, collector->listed,
                                   collector->listed_count, GAP_JUNCTION_PX);
    for (int32_t i = 0; i < collector->tokens->count; i++)
        extension->length[i] = extension->length[i] < CAIRN_REAL_MAX ? 0 : CAIRN_REAL_MAX;
    extension->only_near_gaps = 1;
    extension->chain_cosine = MIN_GAP_COSINE;
    extension->junction_cosine = -1;
}

/* ---- The steps ---- */

void cairn_contour_search_collector_take(contour_search_collector *collector, cairn_pool *pool,
                                         int32_t max_lines)
{
    CAIRN_TAKE(collector, pool, order, max_lines);
    CAIRN_TAKE(collector, pool, selected, max_lines);
    CAIRN_TAKE(collector, pool, listed, max_lines);
    CAIRN_TAKE(collector, pool, extension.length, max_lines);
    cairn_contour_search_ends_take(collector != NULL ? &collector->ends : NULL, pool, max_lines);
}

void cairn_contour_search_collect_begin(contour_search_collector *collector,
                                        const cairn_contour_search_tokens *tokens,
                                        const contour_search_fitted_outline *fitted,
                                        const contour_search_gaps *gaps)
{
    collector->tokens = tokens;
    collector->fitted = *fitted;
    collector->gaps.count = 0;
    if (gaps != NULL)
        collector->gaps = *gaps;
    collector->count = 0;
    collector->resume = collector->phase_resume = collector->units_charged = 0;
}

/* Units of an operation on all segments and the outline. */
static int32_t units_of_all(const contour_search_collector *collector)
{
    return 1 + (collector->tokens->count + collector->fitted.outline_count) / SEGMENTS_PER_UNIT;
}

/* Units of a search for the nearest samples of a number of points. */
static int32_t units_of_points(const contour_search_collector *collector, int32_t points)
{
    int64_t units = (int64_t)points * (1 + collector->fitted.outline_count / SAMPLES_PER_UNIT);

    return (int32_t)(units < INT32_MAX / 2 ? units : INT32_MAX / 2);
}

/* Lists the ends of chains near the object. */
static void list_near_object(contour_search_collector *collector)
{
    collector->listed_count = list_ends(collector->tokens, &collector->fitted, collector->listed);
    cairn_contour_search_ends_make(&collector->ends, collector->tokens->lines, collector->listed,
                                   collector->listed_count, JUNCTION_PX);
}

/* Units of the test whether the segment at the cursor is along the outline. */
static int32_t units_of_segment(const contour_search_collector *collector)
{
    cairn_real length = cairn_segment_length(collector->tokens->lines[collector->cursor]);

    return 1 + units_of_points(collector, cairn_real_to_int(length) / SAMPLE_STEP_PX);
}

/* Selects the segment at the cursor when it is along the outline. */
static void select_segment(contour_search_collector *collector)
{
    collector->selected[collector->cursor] = (uint8_t)is_near_outline(collector, collector->cursor);
}

/* The end of the chain whose first segment is at the cursor. */
static int32_t end_of_chain(const contour_search_collector *collector)
{
    return cairn_contour_search_end_of_chain(collector->tokens, collector->cursor);
}

/* Units of the completion of the chain at the cursor. */
static int32_t units_of_completion(const contour_search_collector *collector)
{
    int32_t from = collector->cursor, to = end_of_chain(collector);

    return is_any_selected(collector, from, to) ? units_of_points(collector, to - from)
                                                : 1 + (to - from) / SEGMENTS_PER_UNIT;
}

/* Completes the chain at the cursor, which goes to the next one. */
static void complete_next_chain(contour_search_collector *collector)
{
    int32_t from = collector->cursor, to = end_of_chain(collector);

    complete_chain(collector, from, to);
    collector->cursor = to;
}

/* Completes the chains and crosses junctions, in turn until no chain is added. */
static int complete_chains(contour_search_collector *collector, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(collector->phase_resume);
    collector->round = 0;
    do {
        for (collector->cursor = 0; collector->cursor < collector->tokens->count;) {
            CAIRN_STEP_CHARGE(collector, phase_resume, budget, units_of_completion(collector));
            complete_next_chain(collector);
        }
        collector->has_grown = 0;
        for (collector->cursor = 0;
             collector->round < MAX_ROUNDS && collector->cursor < collector->ends.count;
             collector->cursor++) {
            CAIRN_STEP_CHARGE(collector, phase_resume, budget,
                              units_of_query(collector, is_selected(collector)));
            find_neighbours(collector);
            CAIRN_STEP_CHARGE(collector, phase_resume, budget,
                              units_of_points(collector, collector->neighbour_count));
            cross_junction(collector);
        }
        collector->round++;
    } while (collector->has_grown);
    CAIRN_STEP_END(collector->phase_resume);
}

/* Follows the edges along the chain at the cursor, which goes to the next one. */
static void extend_next_chain(contour_search_collector *collector)
{
    int32_t from = collector->cursor, to = end_of_chain(collector);

    extend_chain(collector, from, to);
    collector->cursor = to;
}

/* Follows the edges along the chains and across junctions, in turn until none is added. */
static int follow_edges(contour_search_collector *collector, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(collector->phase_resume);
    collector->round = 0;
    do {
        collector->has_grown = 0;
        for (collector->cursor = 0; collector->cursor < collector->tokens->count;) {
            CAIRN_STEP_CHARGE(collector, phase_resume, budget,
                              1 + (end_of_chain(collector) - collector->cursor) /
                                      NEIGHBOURS_PER_UNIT);
            extend_next_chain(collector);
        }
        for (collector->cursor = 0; collector->cursor < collector->ends.count;
             collector->cursor++) {
            CAIRN_STEP_CHARGE(collector, phase_resume, budget,
                              units_of_query(collector, is_extended(collector)));
            find_extending_neighbours(collector);
            CAIRN_STEP_CHARGE(collector, phase_resume, budget,
                              collector->neighbour_count / NEIGHBOURS_PER_UNIT);
            extend_junction(collector);
        }
        collector->round++;
    } while (collector->has_grown && collector->round < MAX_ROUNDS);
    CAIRN_STEP_END(collector->phase_resume);
}

/* Returns 1 when the segment at the cursor was reached. */
static int is_reached(const contour_search_collector *collector)
{
    return collector->extension.length[collector->cursor] < CAIRN_REAL_MAX;
}

/* Puts the segment at the cursor at the end of the list when it was reached. */
static void list_segment(contour_search_collector *collector)
{
    contour_search_order *order = &collector->order[collector->count];
    cairn_real distance;

    if (!is_reached(collector))
        return;
    order->sample = nearest_sample(
        &collector->fitted, middle_of(collector->tokens->lines[collector->cursor]), &distance);
    order->segment = collector->cursor;
    collector->count++;
}

/* See Method in the head of this file. */
int cairn_contour_search_collect_step(contour_search_collector *collector, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(collector->resume);
    CAIRN_STEP_CHARGE(collector, resume, budget, 2 * units_of_all(collector));
    list_near_object(collector);
    for (collector->cursor = 0; collector->cursor < collector->tokens->count; collector->cursor++) {
        CAIRN_STEP_CHARGE(collector, resume, budget, units_of_segment(collector));
        select_segment(collector);
    }
    CAIRN_STEP_RUN(collector, resume, budget, complete_chains);
    CAIRN_STEP_CHARGE(collector, resume, budget, units_of_all(collector));
    begin_extension(collector);
    CAIRN_STEP_RUN(collector, resume, budget, follow_edges);
    if (collector->gaps.count > 0) {
        CAIRN_STEP_CHARGE(collector, resume, budget, 2 * units_of_all(collector));
        begin_gap_extension(collector);
        CAIRN_STEP_RUN(collector, resume, budget, follow_edges);
    }
    for (collector->cursor = 0; collector->cursor < collector->tokens->count; collector->cursor++) {
        CAIRN_STEP_CHARGE(collector, resume, budget,
                          1 + units_of_points(collector, is_reached(collector)));
        list_segment(collector);
    }
    cairn_detection_sort_begin(&collector->sort, collector->order, collector->count,
                               sizeof *collector->order, compare_places);
    CAIRN_STEP_UNTIL(collector->resume, cairn_detection_sort_step(&collector->sort, budget));
    CAIRN_STEP_END(collector->resume);
}
