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

#include "src/containers/heap.h"

enum { MAX_COUNT = 1 << 28 };

/* Factor on squared cosines, beyond rounding. */
#define COSINE_SLACK CAIRN_REAL(1.001)

/* Margin of the boxes in end distances: many times the rounding of a corner. */
#define BOX_MARGIN (CAIRN_REAL(1.0) / 16)

typedef int32_t corner_phase;
enum { PHASE_IDLE, PHASE_BOXES, PHASE_PAIRS, PHASE_SORT, PHASE_SUPPRESS };

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
    corner_phase phase;
    /* PHASE_BOXES: segment; PHASE_SORT: end of the heap; PHASE_SUPPRESS: corner to be tested */
    int32_t cursor;
    /* PHASE_SUPPRESS: corners that stay, and the next of them to be compared */
    int32_t kept, compared;
    int32_t first, second; /* PHASE_PAIRS: near segments to be tested next; first -1: none */
    int32_t is_found;      /* PHASE_PAIRS: `found` is to be inserted */
    int32_t item_units;    /* units already charged to the current item */
    cairn_corner found;
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

size_t cairn_corner_memory(const cairn_corner_params *params)
{
    cairn_pool counting;

    if (cairn_corner_check(params, NULL) != CAIRN_OK)
        return 0;
    cairn_pool_init_counting(&counting);
    (void)build(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_corner_create(cairn_corner_set **set, cairn_pool *pool,
                                 const cairn_corner_params *params)
{
    cairn_status status = cairn_object_admit(set, pool, cairn_corner_memory(params));

    if (status == CAIRN_OK)
        *set = build(pool, params);
    return status;
}

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
    set->cursor = 0;
    set->first = -1;
    set->is_found = 0;
    set->item_units = 0;
    /* The sweep's order of the last search is of other boxes: reset it. */
    if (count < set->sorted_boxes) {
        cairn_status status = cairn_box_sweep_begin(set->sweep, NULL, 0);

        CAIRN_ASSERT(status == CAIRN_OK);
        (void)status;
    }
    set->sorted_boxes = count;
    set->phase = PHASE_BOXES;
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
    if (set->work_count < set->params.max_corners) {
        set->work[set->work_count] = *corner;
        heap_sift_up(set->work, set->work_count++, is_weaker_at, exchange_corners);
        return;
    }
    set->work_dropped++;
    if (is_stronger(corner, &set->work[0])) {
        set->work[0] = *corner;
        heap_sift_down(set->work, 0, set->work_count, is_weaker_at, exchange_corners);
    }
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

/* ---- Phases; each returns CAIRN_OK at its end ---- */

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

static cairn_status step_boxes(cairn_corner_set *set, cairn_budget *budget)
{
    for (; set->cursor < set->segment_count; set->cursor++) {
        cairn_segment s = set->segments[set->cursor];

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        if (!cairn_segment_is_finite(s))
            return CAIRN_NOT_FINITE;
        set->boxes[set->cursor] = box_of(s, set->params.end_distance);
    }
    return cairn_box_sweep_begin(set->sweep, set->boxes, set->segment_count);
}

/* Tests the current pair and inserts its corner. */
static int finish_pair(cairn_corner_set *set, cairn_budget *budget)
{
    if (set->first >= 0) {
        if (!cairn_budget_charge(budget, &set->item_units, 3))
            return 0;
        set->is_found = find_corner(set, set->first, set->second, &set->found);
        set->first = -1;
    }
    if (set->is_found) {
        if (!cairn_budget_charge(budget, &set->item_units, 4))
            return 0;
        insert_corner(set, &set->found);
        set->is_found = 0;
    }
    return 1;
}

static cairn_status step_pairs(cairn_corner_set *set, cairn_budget *budget)
{
    for (;;) {
        int32_t first, second;
        cairn_status status;

        if (!finish_pair(set, budget))
            return CAIRN_MORE;
        status = cairn_box_sweep_next(set->sweep, budget, &first, &second);
        if (status == CAIRN_MORE)
            return status;
        if (status != CAIRN_OK)
            break;
        set->first = first;
        set->second = second;
    }
    set->cursor = set->work_count;
    return CAIRN_OK;
}

/* Heap sort: moves the weakest corner behind the heap's end until the heap is empty. */
static cairn_status step_sort(cairn_corner_set *set, cairn_budget *budget)
{
    for (; set->cursor > 1; set->cursor--) {
        if (!cairn_budget_charge(budget, &set->item_units, 4))
            return CAIRN_MORE;
        heap_pop(set->work, set->cursor, is_weaker_at, exchange_corners);
    }
    set->cursor = 0;
    set->kept = 0;
    set->compared = 0;
    return CAIRN_OK;
}

static int is_duplicate(const cairn_corner_set *set, const cairn_corner *a, const cairn_corner *b)
{
    cairn_real radius = set->params.merge_radius;

    return a->kind == b->kind &&
           cairn_vec2_norm_squared(cairn_vec2_sub(a->position, b->position)) < radius * radius &&
           cairn_vec2_dot(a->leg[0], b->leg[0]) >= set->cos_merge &&
           cairn_vec2_dot(a->leg[1], b->leg[1]) >= set->cos_merge;
}

/* Non-maximum suppression: each corner, the strongest first, is compared with those that stay,
 * eight per unit. */
static cairn_status step_suppress(cairn_corner_set *set, cairn_budget *budget)
{
    int same = 0;

    while (set->cursor < set->work_count) {
        const cairn_corner *c = &set->work[set->cursor];

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        for (int32_t i = 0; i < 8 && set->compared < set->kept && !same; i++)
            same = is_duplicate(set, c, &set->work[set->compared++]);
        if (!same && set->compared < set->kept)
            continue;
        if (!same)
            set->work[set->kept++] = *c;
        set->cursor++;
        set->compared = 0;
        same = 0;
    }
    set->work_count = set->kept;
    return CAIRN_OK;
}

static void finish(cairn_corner_set *set)
{
    cairn_corner *list = set->done;

    set->done = set->work;
    set->done_count = set->work_count;
    set->done_dropped = set->work_dropped;
    set->work = list;
}

cairn_status cairn_corner_step(cairn_corner_set *set, cairn_budget *budget)
{
    cairn_status status = CAIRN_OK;

    if (set == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (set->phase != PHASE_IDLE) {
        corner_phase next = set->phase + 1;

        switch (set->phase) {
        case PHASE_BOXES:
            status = step_boxes(set, budget);
            break;
        case PHASE_PAIRS:
            status = step_pairs(set, budget);
            break;
        case PHASE_SORT:
            status = step_sort(set, budget);
            if (!(set->params.merge_radius > 0))
                next = PHASE_IDLE;
            break;
        default:
            status = step_suppress(set, budget);
            next = PHASE_IDLE;
            break;
        }
        if (status == CAIRN_MORE)
            return status;
        if (status < 0) {
            set->phase = PHASE_IDLE;
            return status;
        }
        set->phase = next;
        if (next == PHASE_IDLE)
            finish(set);
    }
    return CAIRN_OK;
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
