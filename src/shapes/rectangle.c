/* Rectangles from segments: the object, the merging of segments into sides, and pairs of sides.
 *
 * Method:
 * 1. The segments are sorted by length. The longest first, each is merged into the closest
 *    collinear side, which becomes the regression of both, or starts a new side.
 * 2. The sides are sorted by slope. Nearly parallel sides that face each other make pairs.
 * 3. The pairs are sorted by slope. Two nearly perpendicular pairs whose sides extend far enough
 *    make a candidate, whose coverage by the segments is measured.
 * 4. Non-maximum suppression among the rectangles (rectangle_match.c).
 *
 * Layout: an order of the segments, first by length, then by side; the side of each segment; sides
 * and pairs with their orders; two lists of rectangles, one of the search that runs and one of the
 * last result.
 *
 * Limits: a side is straight; segments that bend away from a side start another one.
 *
 * Source: Lagunovsky and Ablameyko 1997; Lakaemper and Latecki 2006; Adluru 2008, section 8.4.2. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/line.h"
#include "src/shapes/rectangle_work.h"

/* Sides that are compared for one work unit, with a segment and with a side; work units of a sift, in
 * a heap of a million. */
enum { COMPARED_PER_UNIT = 2, PAIRED_PER_UNIT = 4, UNITS_PER_SIFT = 3 };

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_rectangle_params, field, __VA_ARGS__)
#define NUMBER(field, ...)   CAIRN_NUMBER(cairn_rectangle_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_rectangle_params, field, __VA_ARGS__)
#define BETWEEN(field, ...)  CAIRN_NUMBER_BETWEEN(cairn_rectangle_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_segments, 1024, 1, 1 << 20),
    INTEGER(max_sides, 256, 1, 1 << 16),
    INTEGER(max_pairs, 2048, 1, 1 << 20),
    INTEGER(max_rectangles, 32, 1, 256),
    INTEGER(oriented, 1, 0, 1),
    POSITIVE(merge_distance, CAIRN_REAL(0.10), 0, CAIRN_MAX_MAGNITUDE),
    BETWEEN(merge_angle, 10 * (CAIRN_PI / 180), 0, CAIRN_PI / 4),
    NUMBER(merge_gap, 2, 0, CAIRN_MAX_MAGNITUDE),
    BETWEEN(max_angle_error, 8 * (CAIRN_PI / 180), 0, CAIRN_PI / 4),
    POSITIVE(min_side, CAIRN_REAL(0.3), 0, CAIRN_MAX_MAGNITUDE),
    NUMBER(min_side_coverage, CAIRN_REAL(0.15), 0, 1),
    NUMBER(min_coverage, CAIRN_REAL(0.5), 0, 1),
    POSITIVE(separation, CAIRN_REAL(0.3), 0, CAIRN_MAX_MAGNITUDE),
};
const cairn_parameters cairn_rectangle_parameters =
    CAIRN_PARAMETERS("rectangle", cairn_rectangle_params, rows);

cairn_rectangle_params cairn_rectangle_default(void)
{
    cairn_rectangle_params params;

    cairn_parameters_preset(&cairn_rectangle_parameters, &params);
    return params;
}

cairn_status cairn_rectangle_check(const cairn_rectangle_params *params, cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_rectangle_parameters, params, fault);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_rectangle_set *build(cairn_pool *pool, const cairn_rectangle_params *params)
{
    size_t segments = (size_t)params->max_segments, sides = (size_t)params->max_sides;
    size_t pairs = (size_t)params->max_pairs, rectangles = (size_t)params->max_rectangles;
    cairn_rectangle_set *set = cairn_object_take(pool, sizeof *set);

    CAIRN_TAKE(set, pool, order, segments);
    CAIRN_TAKE(set, pool, side_of_segment, segments);
    CAIRN_TAKE(set, pool, length_key, segments);
    CAIRN_TAKE(set, pool, sides, sides);
    CAIRN_TAKE(set, pool, side_order, sides);
    CAIRN_TAKE(set, pool, side_key, sides);
    CAIRN_TAKE(set, pool, pairs, pairs);
    CAIRN_TAKE(set, pool, pair_order, pairs);
    CAIRN_TAKE(set, pool, pair_key, pairs);
    CAIRN_TAKE(set, pool, found, rectangles);
    CAIRN_TAKE(set, pool, result, rectangles);
    if (set != NULL) {
        set->params = *params;
        set->sine_merge_angle = cairn_sin(params->merge_angle);
        set->sine_max_angle_error = cairn_sin(params->max_angle_error);
    }
    return set;
}

CAIRN_OBJECT(rectangle, rectangle_set, build);

cairn_status cairn_rectangle_begin(cairn_rectangle_set *set, const cairn_segment *segments,
                                   int32_t count)
{
    if (set == NULL || count < 0 || (segments == NULL && count > 0))
        return CAIRN_BAD_ARGUMENT;
    if (count > set->params.max_segments)
        return CAIRN_FULL;
    set->segments = segments;
    set->segment_count = count;
    set->ordered_count = 0;
    set->side_count = 0;
    set->pair_count = 0;
    set->found_count = 0;
    set->found_dropped = 0;
    set->units_charged = 0;
    set->resume = set->phase_resume = 0;
    set->outcome = CAIRN_OK;
    set->is_running = 1;
    return CAIRN_OK;
}

/* ---- Sorting ---- */

/* Starts a sort. */
static void begin_sort(cairn_rectangle_set *set, int32_t *index, const cairn_real *key,
                       int32_t count)
{
    rectangle_sorter sorter = {index, key, heap_sorting_of(count)};

    set->sorter = sorter;
}

/* The last in the sorted order is on top of the heap. */
static int comes_after(const void *context, int32_t a, int32_t b)
{
    const rectangle_sorter *sorter = context;
    int32_t first = sorter->index[b], second = sorter->index[a];

    return sorter->key[first] < sorter->key[second] ||
           (!(sorter->key[second] < sorter->key[first]) && first < second);
}

static void exchange(void *context, int32_t a, int32_t b)
{
    const rectangle_sorter *sorter = context;
    int32_t moved = sorter->index[a];

    sorter->index[a] = sorter->index[b];
    sorter->index[b] = moved;
}

/* The sort that was begun. */
static int sort(cairn_rectangle_set *set, cairn_budget *budget)
{
    return heap_sort_step(&set->sorter.sorting, budget, &set->units_charged, UNITS_PER_SIFT,
                          &set->sorter, comes_after, exchange);
}

/* ---- Merging of segments into sides ---- */

/* CAIRN_OK when a segment is in range. */
static cairn_status check_segment(cairn_segment segment)
{
    if (!cairn_segment_is_finite(segment))
        return CAIRN_NOT_FINITE;
    if (cairn_abs(segment.a.x) > CAIRN_MAX_MAGNITUDE ||
        cairn_abs(segment.a.y) > CAIRN_MAX_MAGNITUDE ||
        cairn_abs(segment.b.x) > CAIRN_MAX_MAGNITUDE ||
        cairn_abs(segment.b.y) > CAIRN_MAX_MAGNITUDE)
        return CAIRN_BAD_ARGUMENT;
    return CAIRN_OK;
}

/* Measures the segment at the cursor; one without length is left out. */
static void measure_segment(cairn_rectangle_set *set)
{
    cairn_segment segment = set->segments[set->cursor];
    cairn_real length;

    set->outcome = check_segment(segment);
    if (set->outcome != CAIRN_OK)
        return;
    length = cairn_segment_length(segment);
    set->length_key[set->cursor] = -length;
    set->side_of_segment[set->cursor] = -1;
    if (length > 0)
        set->order[set->ordered_count++] = set->cursor;
}

/* Lengths of the segments. */
static int measure_segments(cairn_rectangle_set *set, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(set->phase_resume);
    for (set->cursor = 0; set->cursor < set->segment_count && set->outcome == CAIRN_OK;
         set->cursor++) {
        CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
        measure_segment(set);
    }
    CAIRN_STEP_END(set->phase_resume);
}

/* Distance in m of a segment's farther end from the line of a side; CAIRN_REAL_MAX when the
 * direction or the gap excludes merging. */
static cairn_real distance_to_side(const cairn_rectangle_set *set, const rectangle_side *side,
                                   cairn_segment segment)
{
    cairn_vec2 a = cairn_vec2_sub(segment.a, side->segment.a),
               b = cairn_vec2_sub(segment.b, side->segment.a);
    cairn_vec2 run = cairn_vec2_sub(b, a);
    cairn_real length = cairn_vec2_norm(run), along = cairn_vec2_dot(side->direction, run);
    cairn_real from = cairn_vec2_dot(side->direction, a), to = cairn_vec2_dot(side->direction, b);
    cairn_real extent =
        cairn_vec2_dot(side->direction, cairn_vec2_sub(side->segment.b, side->segment.a));
    cairn_real gap = cairn_max(cairn_min(from, to) - extent, -cairn_max(from, to));

    if (cairn_abs(cairn_vec2_cross(side->direction, run)) > set->sine_merge_angle * length ||
        gap > set->params.merge_gap || (set->params.oriented && along < 0))
        return CAIRN_REAL_MAX;
    return cairn_max(cairn_abs(cairn_vec2_cross(side->direction, a)),
                     cairn_abs(cairn_vec2_cross(side->direction, b)));
}

/* Sets segment and direction of a side. */
static void set_segment(rectangle_side *side, cairn_segment segment)
{
    side->segment = segment;
    side->direction = cairn_vec2_unit(cairn_vec2_sub(segment.b, segment.a));
}

/* Merges a segment into a side. */
static void merge_into_side(cairn_rectangle_set *set, int32_t segment, int32_t side_index)
{
    rectangle_side *side = &set->sides[side_index];
    cairn_real length = -set->length_key[segment];
    cairn_segment merged = side->segment;
    cairn_status status =
        cairn_line_merge(side->segment, side->mass, set->segments[segment], length, &merged);

    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    set_segment(side, merged);
    side->mass += length;
    side->count++;
    set->side_of_segment[segment] = side_index;
}

/* Starts a new side with a segment. */
static void begin_side(cairn_rectangle_set *set, int32_t segment)
{
    rectangle_side *side = &set->sides[set->side_count];

    if (set->side_count == set->params.max_sides) {
        set->found_dropped++;
        return;
    }
    set_segment(side, set->segments[segment]);
    side->mass = -set->length_key[segment];
    side->count = 1;
    set->side_of_segment[segment] = set->side_count++;
}

/* Compares the current segment with the next sides. */
static void compare_with_sides(cairn_rectangle_set *set)
{
    cairn_segment segment = set->segments[set->order[set->cursor]];

    for (int32_t i = 0; i < COMPARED_PER_UNIT && set->compared < set->side_count;
         i++, set->compared++) {
        cairn_real distance = distance_to_side(set, &set->sides[set->compared], segment);

        if (distance < set->params.merge_distance &&
            (set->closest < 0 || distance < set->closest_distance)) {
            set->closest = set->compared;
            set->closest_distance = distance;
        }
    }
}

/* Sides: merges every segment into the closest one, or starts a new one. */
static int merge_segments(cairn_rectangle_set *set, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(set->phase_resume);
    for (set->cursor = 0; set->cursor < set->ordered_count; set->cursor++) {
        set->closest = -1;
        set->compared = 0;
        do {
            CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
            compare_with_sides(set);
        } while (set->compared < set->side_count);
        if (set->closest >= 0)
            merge_into_side(set, set->order[set->cursor], set->closest);
        else
            begin_side(set, set->order[set->cursor]);
    }
    CAIRN_STEP_END(set->phase_resume);
}

/* Slope of the side at the cursor, and the place of its segments. */
static void set_slope(cairn_rectangle_set *set)
{
    rectangle_side *side = &set->sides[set->cursor];

    side->first = set->cursor > 0 ? side[-1].first + side[-1].count : 0;
    side->slope = cairn_atan2(side->direction.y, side->direction.x);
    side->slope = side->slope < 0 ? side->slope + CAIRN_PI : side->slope;
    side->slope = side->slope >= CAIRN_PI ? side->slope - CAIRN_PI : side->slope;
    set->side_key[set->cursor] = side->slope;
    set->side_order[set->cursor] = set->cursor;
}

/* Lists the segment at the cursor with those of its side. */
static void list_segment(cairn_rectangle_set *set)
{
    int32_t side = set->side_of_segment[set->cursor];

    if (side >= 0)
        set->order[set->sides[side].first++] = set->cursor;
}

/* Slopes of the sides, and the segments in the order of their sides. */
static int list_sides(cairn_rectangle_set *set, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(set->phase_resume);
    for (set->cursor = 0; set->cursor < set->side_count; set->cursor++) {
        CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
        set_slope(set);
    }
    for (set->cursor = 0; set->cursor < set->segment_count; set->cursor++) {
        CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
        list_segment(set);
    }
    CAIRN_STEP_END(set->phase_resume);
}

/* ---- Pairs ---- */

/* Adds a pair. */
static void add_pair(cairn_rectangle_set *set, const rectangle_pair *pair)
{
    if (set->pair_count == set->params.max_pairs) {
        set->found_dropped++;
        return;
    }
    set->pair_key[set->pair_count] = pair->slope;
    set->pair_order[set->pair_count] = set->pair_count;
    set->pairs[set->pair_count++] = *pair;
}

/* Pairs the current side with the next sides in the cyclic order of slopes. 0: one of them is not
 * nearly parallel, or has been paired with it. */
static int pair_with_sides(cairn_rectangle_set *set)
{
    int32_t current = set->side_order[set->cursor];
    cairn_real slope = set->sides[current].slope;

    for (int32_t i = 0; i < PAIRED_PER_UNIT; i++) {
        int32_t position = set->cursor + ++set->compared,
                next = set->side_order[position % set->side_count];
        rectangle_pair made;

        if ((position >= set->side_count && set->sides[next].slope >= slope) ||
            cairn_rectangle_angle_difference(set->sides[next].slope, slope) >
                set->params.max_angle_error)
            return 0;
        if (cairn_rectangle_make_pair(set, current, next, &made))
            add_pair(set, &made);
    }
    return 1;
}

/* Pairs of nearly parallel sides that face each other. */
static int make_pairs(cairn_rectangle_set *set, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(set->phase_resume);
    for (set->cursor = 0; set->cursor < set->side_count; set->cursor++) {
        set->compared = 0;
        do
            CAIRN_STEP_CHARGE_UNIT(set, phase_resume, budget);
        while (pair_with_sides(set));
    }
    CAIRN_STEP_END(set->phase_resume);
}

/* ---- Search ---- */

/* Makes the rectangles found the result. */
static void publish_result(cairn_rectangle_set *set)
{
    cairn_rectangle *list = set->result;

    set->result = set->found;
    set->result_count = set->found_count;
    set->result_dropped = set->found_dropped;
    set->found = list;
}

/* The search: see Method in the head of this file. */
static int search(cairn_rectangle_set *set, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(set->resume);
    CAIRN_STEP_RUN(set, resume, budget, measure_segments);
    if (set->outcome == CAIRN_OK) {
        begin_sort(set, set->order, set->length_key, set->ordered_count);
        CAIRN_STEP_RUN(set, resume, budget, sort);
        CAIRN_STEP_RUN(set, resume, budget, merge_segments);
        CAIRN_STEP_RUN(set, resume, budget, list_sides);
        begin_sort(set, set->side_order, set->side_key, set->side_count);
        CAIRN_STEP_RUN(set, resume, budget, sort);
        CAIRN_STEP_RUN(set, resume, budget, make_pairs);
        begin_sort(set, set->pair_order, set->pair_key, set->pair_count);
        CAIRN_STEP_RUN(set, resume, budget, sort);
        CAIRN_STEP_RUN(set, resume, budget, cairn_rectangle_match);
        publish_result(set);
    }
    CAIRN_STEP_END(set->resume);
}

cairn_status cairn_rectangle_step(cairn_rectangle_set *set, cairn_budget *budget)
{
    if (set == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!set->is_running)
        return CAIRN_OK;
    if (!search(set, budget))
        return CAIRN_MORE;
    set->is_running = 0;
    return set->outcome;
}

const cairn_rectangle *cairn_rectangle_list(const cairn_rectangle_set *set, int32_t *count)
{
    *count = set->result_count;
    return set->result;
}

int32_t cairn_rectangle_dropped(const cairn_rectangle_set *set)
{
    return set->result_dropped;
}
