/* corner: corner detection by sweep and prune over the segments.
 *
 * Method:
 * 1. All segments are lengthened by the end distance at both ends and boxed. A corner lies on both
 *    lines, hence in both boxes; the sweep reports overlapping boxes as candidates.
 * 2. The lines of a candidate are tested for their angle first (no square root), then intersected.
 * 3. Corners go into a bounded heap with the weakest at its root, which is replaced by stronger
 *    ones at capacity. Heap sort gives the result.
 * 4. Non-maximum suppression: of near corners of one kind and with the same legs the strongest
 *    stays.
 *
 * Layout: two lists of corners, one in work, one for readers; the boxes of the segments; the sweep.
 * Limits: corners are dropped by strength before the suppression, so that copies of a strong corner
 * can displace a weak one; choose max_corners for the copies too.
 * Source: Adluru 2008, sections 7.3.4 and 9. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/corner.h"
#include "src/base/object.h"
#include "src/base/step.h"

#include "src/containers/heap.h"

enum { MAX_COUNT = 1 << 28 };

/* Factor on squared cosines, beyond rounding. */
#define COSINE_SLACK CAIRN_REAL(1.001)

/* Margin of the boxes in end distances: many times the rounding of a corner. */
#define BOX_MARGIN (CAIRN_REAL(1.0) / 16)

/* Units of a segment that is boxed, of a pair of segments that is tested, and of a corner that is
 * put into the heap or taken out; corners that are compared in a unit. */
enum { UNITS_PER_BOX = 1, UNITS_PER_PAIR = 3, UNITS_PER_CORNER = 4, COMPARISONS_PER_UNIT = 8 };

struct cairn_corner_set {
    cairn_corner_params params;
    cairn_real cos_min, cos_max; /* cosines of min_opening and max_opening, cos_min >= cos_max */
    cairn_real cos_squared;      /* lines with a larger squared cosine make no corner */
    cairn_real cos_merge;        /* cosine of merge_angle */
    cairn_box_sweep *sweep;
    cairn_box *boxes;          /* [max_segments] */
    cairn_corner *work, *done; /* [max_corners] each */
    int32_t work_count, done_count;
    int32_t work_dropped, done_dropped;
    const cairn_segment *segments;
    int32_t segment_count;
    int32_t sorted_boxes; /* segments of the last search */
    /* 1: step() has work left. */
    int32_t is_running;
    /* Resume point, and units charged for the operation that waits. */
    int32_t resume, units_charged;
    cairn_status outcome;
    /* Segment, end of the heap, or corner. */
    int32_t cursor;

    /* State of a phase; no two of these phases are under way at a time. */
    union {
        /* Pairs of segments: status of the sweep, current pair, and its corner. */
        struct {
            cairn_status sweep_status;
            int32_t first, second;
            cairn_corner found;
        };
        /* Suppression: corners that stay, the next of them to be compared, and 1 when the current
         * corner is a duplicate. */
        struct {
            int32_t kept, compared, is_suppressed;
        };
    };
};

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_corner_params, field, __VA_ARGS__)
#define NUMBER(field, ...)   CAIRN_NUMBER(cairn_corner_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_corner_params, field, __VA_ARGS__)
#define BETWEEN(field, ...)  CAIRN_NUMBER_BETWEEN(cairn_corner_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_segments, 256, 1, MAX_COUNT),
    INTEGER(max_corners, 128, 1, MAX_COUNT),
    BETWEEN(min_opening, 80 * (CAIRN_PI / 180), 0, CAIRN_PI),
    BETWEEN(max_opening, 100 * (CAIRN_PI / 180), 0, CAIRN_PI),
    POSITIVE(end_distance, CAIRN_REAL(0.30), 0, CAIRN_REAL_MAX),
    NUMBER(merge_radius, CAIRN_REAL(0.10), 0, CAIRN_REAL_MAX),
    NUMBER(merge_angle, 10 * (CAIRN_PI / 180), 0, CAIRN_PI),
    INTEGER(crossings, 0, 0, 1),
};
extern const cairn_parameters cairn_corner_parameters;
const cairn_parameters cairn_corner_parameters =
    CAIRN_PARAMETERS("corner", cairn_corner_params, rows);

cairn_corner_params cairn_corner_default(void)
{
    cairn_corner_params params;

    cairn_parameters_preset(&cairn_corner_parameters, &params);
    return params;
}

cairn_status cairn_corner_check(const cairn_corner_params *params, cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_corner_parameters, params, fault);

    if (status == CAIRN_OK)
        status = cairn_parameters_require(params->max_opening >= params->min_opening, "corner",
                                          "max_opening: at least min_opening", fault);
    return status;
}

/* The object, its arrays and its sweep; NULL from a counting pool. */
static cairn_corner_set *build(cairn_pool *pool, const cairn_corner_params *params)
{
    cairn_box_sweep_params sweep = {
        .max_boxes = params->max_segments,
    };
    cairn_corner_set *set = cairn_object_take(pool, sizeof *set);

    CAIRN_TAKE(set, pool, boxes, params->max_segments);
    CAIRN_TAKE(set, pool, work, params->max_corners);
    CAIRN_TAKE(set, pool, done, params->max_corners);
    CAIRN_TAKE_OBJECT(set, pool, sweep, box_sweep, &sweep);
    if (set != NULL) {
        set->params = *params;
        set->cos_min = cairn_cos(params->min_opening);
        set->cos_max = cairn_cos(params->max_opening);
        set->cos_squared =
            cairn_max(set->cos_min * set->cos_min, set->cos_max * set->cos_max) * COSINE_SLACK;
        set->cos_merge = cairn_cos(params->merge_angle);
    }
    return set;
}

CAIRN_OBJECT(corner, corner_set, build);

cairn_status cairn_corner_begin(cairn_corner_set *set, const cairn_segment *segments, int32_t count)
{
    if (set == NULL || count < 0 || (segments == NULL && count > 0))
        return CAIRN_BAD_ARGUMENT;
    if (count > set->params.max_segments)
        return CAIRN_FULL;
    set->segments = segments;
    set->segment_count = count;
    set->work_count = 0;
    set->work_dropped = 0;
    set->resume = set->units_charged = 0;
    set->outcome = CAIRN_OK;
    /* The sweep's order of the last search is of other boxes: reset it. */
    if (count < set->sorted_boxes) {
        cairn_must_be_ok(cairn_box_sweep_begin(set->sweep, NULL, 0));
    }
    set->sorted_boxes = count;
    set->is_running = 1;
    return CAIRN_OK;
}

static int32_t lower(const cairn_corner *corner)
{
    return corner->segment[0] < corner->segment[1] ? corner->segment[0] : corner->segment[1];
}

static int32_t higher(const cairn_corner *corner)
{
    return corner->segment[0] < corner->segment[1] ? corner->segment[1] : corner->segment[0];
}

/* Order of the result, total because every pair of segments makes one corner at most. */
static int is_stronger(const cairn_corner *a, const cairn_corner *b)
{
    if (a->strength != b->strength)
        return a->strength > b->strength;
    if (lower(a) != lower(b))
        return lower(a) < lower(b);
    return higher(a) < higher(b);
}

static int is_weaker_at(const void *context, int32_t a, int32_t b)
{
    const cairn_corner *corners = context;

    return is_stronger(&corners[b], &corners[a]);
}

static void exchange_corners(void *context, int32_t a, int32_t b)
{
    cairn_corner *corners = context, moved = corners[a];

    corners[a] = corners[b];
    corners[b] = moved;
}

static void insert_corner(cairn_corner_set *set, const cairn_corner *corner)
{
    int is_full = set->work_count == set->params.max_corners;

    set->work_dropped += is_full;
    if (is_full && !is_stronger(corner, &set->work[0]))
        return;
    set->work[heap_keep_place(set->work_count, set->params.max_corners)] = *corner;
    set->work_count = heap_keep(set->work, set->work_count, set->params.max_corners, is_weaker_at,
                                exchange_corners);
}

/* Finds the leg of a corner at p, on the line of a segment; *forward: 1 when it runs as a -> b.
 * Returns 0 when p is too far from both ends or, with crossings, from the segment. */
static int find_leg(const cairn_corner_params *params, cairn_segment segment, cairn_vec2 p,
                    cairn_vec2 *leg, cairn_real *length, int *forward)
{
    cairn_vec2 along = cairn_vec2_sub(segment.b, segment.a);
    cairn_real to_a = cairn_vec2_norm(cairn_vec2_sub(segment.a, p));
    cairn_real to_b = cairn_vec2_norm(cairn_vec2_sub(segment.b, p));

    *forward = to_a <= to_b;
    *length = *forward ? to_b : to_a;
    *leg = cairn_vec2_unit(*forward ? along : cairn_vec2_sub(segment.a, segment.b));
    if (params->crossings && cairn_vec2_dot(cairn_vec2_sub(p, segment.a), along) >= 0 &&
        cairn_vec2_dot(cairn_vec2_sub(p, segment.b), along) <= 0)
        return 1;
    return (*forward ? to_a : to_b) <= params->end_distance;
}

/* Returns 1 and sets *corner when the two segments make a corner. */
static int find_corner(const cairn_corner_set *set, int32_t first, int32_t second,
                       cairn_corner *corner)
{
    cairn_segment s = set->segments[first], t = set->segments[second];
    cairn_vec2 u = cairn_vec2_sub(s.b, s.a), v = cairn_vec2_sub(t.b, t.a), leg_s, leg_t;
    cairn_real along = cairn_vec2_dot(u, v), length_s, length_t, cosine;
    int forward_s, forward_t, left;

    if (along * along > set->cos_squared * cairn_vec2_norm_squared(u) * cairn_vec2_norm_squared(v))
        return 0;
    if (!cairn_line_intersection(s, t, &corner->position) ||
        !find_leg(&set->params, s, corner->position, &leg_s, &length_s, &forward_s) ||
        !find_leg(&set->params, t, corner->position, &leg_t, &length_t, &forward_t))
        return 0;
    cosine = cairn_vec2_dot(leg_s, leg_t);
    if (cosine > set->cos_min || cosine < set->cos_max)
        return 0;

    left = cairn_vec2_cross(leg_s, leg_t) > 0;
    corner->leg[0] = left ? leg_s : leg_t;
    corner->leg[1] = left ? leg_t : leg_s;
    corner->segment[0] = left ? first : second;
    corner->segment[1] = left ? second : first;
    corner->opening = cairn_atan2(cairn_vec2_cross(corner->leg[0], corner->leg[1]), cosine);
    corner->strength = cairn_min(length_s, length_t);
    /* The free side is on the left of a -> b: between the legs when leg[0] runs along its segment
     * and leg[1] against. */
    if (forward_s == forward_t)
        corner->kind = CAIRN_CORNER_MIXED;
    else
        corner->kind = forward_s == left ? CAIRN_CORNER_CONCAVE : CAIRN_CORNER_CONVEX;
    return 1;
}

/* ---- Detection ---- */

/* Returns the box of a segment lengthened by `by` m at both ends. */
static cairn_box box_of(cairn_segment s, cairn_real by)
{
    cairn_vec2 along = cairn_vec2_unit(cairn_vec2_sub(s.b, s.a));
    cairn_real x = by * (cairn_abs(along.x) + BOX_MARGIN),
               y = by * (cairn_abs(along.y) + BOX_MARGIN);
    cairn_box box = {{cairn_min(s.a.x, s.b.x) - x, cairn_min(s.a.y, s.b.y) - y},
                     {cairn_max(s.a.x, s.b.x) + x, cairn_max(s.a.y, s.b.y) + y}};

    return box;
}

/* Sets the box of a segment, which must be finite. */
static void set_box(cairn_corner_set *set, int32_t index)
{
    if (cairn_segment_is_finite(set->segments[index]))
        set->boxes[index] = box_of(set->segments[index], set->params.end_distance);
    else
        set->outcome = CAIRN_NOT_FINITE;
}

/* Runs the sweep to the next pair of boxes that overlap, or to its end. */
static int find_pair(cairn_corner_set *set, cairn_budget *budget)
{
    set->sweep_status = cairn_box_sweep_next(set->sweep, budget, &set->first, &set->second);
    return set->sweep_status != CAIRN_MORE;
}

static int is_duplicate(const cairn_corner_set *set, const cairn_corner *a, const cairn_corner *b)
{
    cairn_real radius = set->params.merge_radius;

    return a->kind == b->kind &&
           cairn_vec2_norm_squared(cairn_vec2_sub(a->position, b->position)) < radius * radius &&
           cairn_vec2_dot(a->leg[0], b->leg[0]) >= set->cos_merge &&
           cairn_vec2_dot(a->leg[1], b->leg[1]) >= set->cos_merge;
}

/* Compares the corner at the cursor with the next of those that stay, until a stronger duplicate is
 * found. */
static void compare_corners(cairn_corner_set *set)
{
    for (int32_t i = 0;
         i < COMPARISONS_PER_UNIT && set->compared < set->kept && !set->is_suppressed; i++)
        set->is_suppressed =
            is_duplicate(set, &set->work[set->cursor], &set->work[set->compared++]);
}

/* Makes the list in work that for readers. */
static void commit(cairn_corner_set *set)
{
    cairn_corner *list = set->done;

    set->done = set->work;
    set->done_count = set->work_count;
    set->done_dropped = set->work_dropped;
    set->work = list;
}

/* The detection: see Method in the head of this file. */
static int detect(cairn_corner_set *set, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(set->resume);
    for (set->cursor = 0; set->outcome == CAIRN_OK && set->cursor < set->segment_count;
         set->cursor++) {
        CAIRN_STEP_CHARGE(set, resume, budget, UNITS_PER_BOX);
        set_box(set, set->cursor);
    }
    if (set->outcome == CAIRN_OK) {
        cairn_must_be_ok(cairn_box_sweep_begin(set->sweep, set->boxes, set->segment_count));
        for (;;) {
            CAIRN_STEP_RUN(set, resume, budget, find_pair);
            if (set->sweep_status != CAIRN_OK)
                break;
            CAIRN_STEP_CHARGE(set, resume, budget, UNITS_PER_PAIR);
            if (find_corner(set, set->first, set->second, &set->found)) {
                CAIRN_STEP_CHARGE(set, resume, budget, UNITS_PER_CORNER);
                insert_corner(set, &set->found);
            }
        }
        for (set->cursor = set->work_count; set->cursor > 1; set->cursor--) {
            CAIRN_STEP_CHARGE(set, resume, budget, UNITS_PER_CORNER);
            heap_pop(set->work, set->cursor, is_weaker_at, exchange_corners);
        }
        if (set->params.merge_radius > 0) {
            set->kept = 0;
            for (set->cursor = 0; set->cursor < set->work_count; set->cursor++) {
                set->compared = set->is_suppressed = 0;
                do {
                    CAIRN_STEP_CHARGE(set, resume, budget, 1);
                    compare_corners(set);
                } while (!set->is_suppressed && set->compared < set->kept);
                if (!set->is_suppressed)
                    set->work[set->kept++] = set->work[set->cursor];
            }
            set->work_count = set->kept;
        }
        commit(set);
    }
    CAIRN_STEP_END(set->resume);
}

cairn_status cairn_corner_step(cairn_corner_set *set, cairn_budget *budget)
{
    if (set == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!set->is_running)
        return CAIRN_OK;
    if (!detect(set, budget))
        return CAIRN_MORE;
    set->is_running = 0;
    return set->outcome;
}

const cairn_corner *cairn_corner_list(const cairn_corner_set *set, int32_t *count)
{
    *count = set->done_count;
    return set->done;
}

int32_t cairn_corner_dropped(const cairn_corner_set *set)
{
    return set->done_dropped;
}
