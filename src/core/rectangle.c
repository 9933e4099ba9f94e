/* Rectangles from segments: the object, and the merging of segments to sides.
 *
 * Method: the longest segment first, each joins the side that it fits best, which is then the
 * regression of both, or begins a side of its own. Sides sorted by slope give the pairs that face
 * each other, pairs sorted by slope those that stand on each other; of these only what can reach
 * the least cover is laid out as a rectangle and measured with the segments themselves
 * (rectangle_match.c).
 *
 * Layout: an order of the segments, first by length, then by side; the side of each; sides and
 * pairs with their orders; two lists of rectangles, one in work, one that readers see.
 *
 * Limits: a side is one line; segments that bend away from it begin another.
 *
 * Source: Lagunovsky and Ablameyko 1997; Lakaemper and Latecki 2006; Adluru 2008, section 8.4.2. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/line.h"
#include "src/core/rectangle_work.h"

#define LIMIT CAIRN_REAL(1e6)

cairn_rectangle_params cairn_rectangle_default(void)
{
    cairn_rectangle_params params = {
        .max_segments = 1024,
        .max_sides = 256,
        .max_pairs = 2048,
        .max_rectangles = 32,
        .oriented = 1,
        .merge_distance = CAIRN_REAL(0.10),
        .merge_angle = 10 * (CAIRN_PI / 180),
        .merge_gap = 2,
        .angle = 8 * (CAIRN_PI / 180),
        .min_side = CAIRN_REAL(0.3),
        .least_side = CAIRN_REAL(0.15),
        .least_covered = CAIRN_REAL(0.5),
        .separation = CAIRN_REAL(0.3),
    };
    return params;
}

static int is_count(int32_t count, int32_t most)
{
    return count >= 1 && count <= most;
}

static int is_length(cairn_real x)
{
    return x > 0 && x <= LIMIT;
}

static int is_angle(cairn_real x)
{
    return x > 0 && x < CAIRN_PI / 4;
}

static int is_share(cairn_real x)
{
    return x >= 0 && x <= 1;
}

static int params_are_valid(const cairn_rectangle_params *p)
{
    return p != NULL && is_count(p->max_segments, 1 << 20) && is_count(p->max_sides, 1 << 16) &&
           is_count(p->max_pairs, 1 << 20) && is_count(p->max_rectangles, 256) &&
           is_length(p->merge_distance) && is_angle(p->merge_angle) && p->merge_gap >= 0 &&
           p->merge_gap <= LIMIT && is_angle(p->angle) && is_length(p->min_side) &&
           is_share(p->least_side) && is_share(p->least_covered) && is_length(p->separation);
}

static cairn_rectangle_set *carve(cairn_pool *pool, const cairn_rectangle_params *params)
{
    size_t segments = (size_t)params->max_segments, sides = (size_t)params->max_sides;
    size_t pairs = (size_t)params->max_pairs, rectangles = (size_t)params->max_rectangles;
    cairn_rectangle_set *set = cairn_pool_take_one(pool, sizeof *set);
    int32_t *order = cairn_pool_take(pool, segments, sizeof *order);
    int32_t *member = cairn_pool_take(pool, segments, sizeof *member);
    cairn_real *key = cairn_pool_take(pool, segments, sizeof *key);
    side *side_array = cairn_pool_take(pool, sides, sizeof *side_array);
    int32_t *side_order = cairn_pool_take(pool, sides, sizeof *side_order);
    cairn_real *side_key = cairn_pool_take(pool, sides, sizeof *side_key);
    pair *pair_array = cairn_pool_take(pool, pairs, sizeof *pair_array);
    int32_t *pair_order = cairn_pool_take(pool, pairs, sizeof *pair_order);
    cairn_real *pair_key = cairn_pool_take(pool, pairs, sizeof *pair_key);
    cairn_rectangle *list = cairn_pool_take(pool, rectangles, sizeof *list);
    cairn_rectangle *done = cairn_pool_take(pool, rectangles, sizeof *done);

    if (set != NULL) {
        memset(set, 0, sizeof *set);
        set->order = order;
        set->member = member;
        set->key = key;
        set->sides = side_array;
        set->side_order = side_order;
        set->side_key = side_key;
        set->pairs = pair_array;
        set->pair_order = pair_order;
        set->pair_key = pair_key;
        set->list = list;
        set->done = done;
    }
    return set;
}

size_t cairn_rectangle_memory(const cairn_rectangle_params *params)
{
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_rectangle_create(cairn_rectangle_set **set, cairn_pool *pool,
                                    const cairn_rectangle_params *params)
{
    size_t need = cairn_rectangle_memory(params);
    cairn_rectangle_set *made;

    if (set == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve(pool, params);
    made->params = *params;
    made->sine_merge = cairn_sin(params->merge_angle);
    made->sine_angle = cairn_sin(params->angle);
    *set = made;
    return CAIRN_OK;
}

cairn_status cairn_rectangle_begin(cairn_rectangle_set *set, const cairn_segment *segments,
                                   int32_t count)
{
    if (set == NULL || count < 0 || (segments == NULL && count > 0))
        return CAIRN_BAD_ARGUMENT;
    if (count > set->params.max_segments)
        return CAIRN_FULL;
    set->segments = segments;
    set->segment_count = count;
    set->ordered = 0;
    set->side_count = 0;
    set->pair_count = 0;
    set->list_count = 0;
    set->dropped = 0;
    set->cursor = 0;
    set->best = -1;
    set->is_open = 0;
    set->phase = RECTANGLE_LENGTHS;
    return CAIRN_OK;
}

/* ---- Sorting ---- */

static sorter sort_begin(int32_t *index, const cairn_real *key, int32_t count)
{
    sorter s = {index, key, count, count / 2, count};

    return s;
}

static int comes_first(const sorter *s, int32_t a, int32_t b)
{
    return s->key[a] < s->key[b] || (!(s->key[b] < s->key[a]) && a < b);
}

/* Lets index[hole] sink in the heap index[0 ... end-1], whose parents come last. */
static void sink(sorter *s, int32_t hole, int32_t end)
{
    int32_t sinking = s->index[hole];

    for (;;) {
        int32_t child = 2 * hole + 1;

        if (child >= end)
            break;
        if (child + 1 < end && comes_first(s, s->index[child], s->index[child + 1]))
            child++;
        if (!comes_first(s, sinking, s->index[child]))
            break;
        s->index[hole] = s->index[child];
        hole = child;
    }
    s->index[hole] = sinking;
}

/* Three units are a way through a heap of a million. */
static cairn_status step_sort(sorter *s, int32_t *paid, cairn_budget *budget)
{
    while (s->build > 0) {
        if (!cairn_budget_pay(budget, paid, 3))
            return CAIRN_MORE;
        s->build--;
        sink(s, s->build, s->count);
    }
    while (s->end > 1) {
        int32_t last;

        if (!cairn_budget_pay(budget, paid, 3))
            return CAIRN_MORE;
        s->end--;
        last = s->index[0];
        s->index[0] = s->index[s->end];
        s->index[s->end] = last;
        sink(s, 0, s->end);
    }
    return CAIRN_OK;
}

/* ---- Merging segments to sides ---- */

static cairn_status check(cairn_segment s)
{
    if (!cairn_is_finite(s.a.x) || !cairn_is_finite(s.a.y) || !cairn_is_finite(s.b.x) ||
        !cairn_is_finite(s.b.y))
        return CAIRN_NOT_FINITE;
    if (cairn_abs(s.a.x) > LIMIT || cairn_abs(s.a.y) > LIMIT || cairn_abs(s.b.x) > LIMIT ||
        cairn_abs(s.b.y) > LIMIT)
        return CAIRN_BAD_ARGUMENT;
    return CAIRN_OK;
}

static cairn_status step_lengths(cairn_rectangle_set *set, cairn_budget *budget)
{
    for (; set->cursor < set->segment_count; set->cursor++) {
        cairn_segment segment = set->segments[set->cursor];
        cairn_status status = check(segment);
        cairn_real length;

        if (status != CAIRN_OK)
            return status;
        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        length = cairn_segment_length(segment);
        set->key[set->cursor] = -length;
        set->member[set->cursor] = -1;
        if (length > 0)
            set->order[set->ordered++] = set->cursor;
    }
    return CAIRN_OK;
}

/* How far a segment is from a side's line; beyond merge_distance when it does not belong to it. */
static cairn_real misfit(const cairn_rectangle_set *set, const side *s, cairn_segment segment)
{
    cairn_vec2 a = cairn_vec2_sub(segment.a, s->segment.a),
               b = cairn_vec2_sub(segment.b, s->segment.a);
    cairn_vec2 run = cairn_vec2_sub(b, a);
    cairn_real length = cairn_vec2_norm(run), along = cairn_vec2_dot(s->direction, run);
    cairn_real from = cairn_vec2_dot(s->direction, a), to = cairn_vec2_dot(s->direction, b);
    cairn_real extent = cairn_vec2_dot(s->direction, cairn_vec2_sub(s->segment.b, s->segment.a));
    cairn_real gap = cairn_max(cairn_min(from, to) - extent, -cairn_max(from, to));

    if (cairn_abs(cairn_vec2_cross(s->direction, run)) > set->sine_merge * length ||
        gap > set->params.merge_gap || (set->params.oriented && along < 0))
        return CAIRN_REAL_MAX;
    return cairn_max(cairn_abs(cairn_vec2_cross(s->direction, a)),
                     cairn_abs(cairn_vec2_cross(s->direction, b)));
}

static void set_segment(side *s, cairn_segment segment)
{
    s->segment = segment;
    s->direction = cairn_vec2_unit(cairn_vec2_sub(segment.b, segment.a));
}

static void join(cairn_rectangle_set *set, int32_t segment, int32_t to)
{
    side *s = &set->sides[to];
    cairn_real length = -set->key[segment];
    cairn_segment merged = s->segment;
    cairn_status status =
        cairn_segment_merge(s->segment, s->mass, set->segments[segment], length, &merged);

    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    set_segment(s, merged);
    s->mass += length;
    s->count++;
    set->member[segment] = to;
}

static void begin_side(cairn_rectangle_set *set, int32_t segment)
{
    side *s = &set->sides[set->side_count];

    if (set->side_count == set->params.max_sides) {
        set->dropped++;
        return;
    }
    set_segment(s, set->segments[segment]);
    s->mass = -set->key[segment];
    s->count = 1;
    set->member[segment] = set->side_count++;
}

static cairn_status step_merge(cairn_rectangle_set *set, cairn_budget *budget)
{
    while (set->cursor < set->ordered) {
        int32_t segment = set->order[set->cursor];

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        for (int32_t i = 0; i < 2 && set->against < set->side_count; i++, set->against++) {
            cairn_real distance = misfit(set, &set->sides[set->against], set->segments[segment]);

            if (distance < set->params.merge_distance &&
                (set->best < 0 || distance < set->best_distance)) {
                set->best = set->against;
                set->best_distance = distance;
            }
        }
        if (set->against < set->side_count)
            continue;
        if (set->best >= 0)
            join(set, segment, set->best);
        else
            begin_side(set, segment);
        set->best = -1;
        set->against = 0;
        set->cursor++;
    }
    return CAIRN_OK;
}

/* The segments in the order of their sides, and the sides' slopes. */
static cairn_status step_members(cairn_rectangle_set *set, cairn_budget *budget)
{
    for (; set->against < set->side_count; set->against++) {
        side *s = &set->sides[set->against];

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        s->first = set->against > 0 ? s[-1].first + s[-1].count : 0;
        s->slope = cairn_atan2(s->direction.y, s->direction.x);
        s->slope = s->slope < 0 ? s->slope + CAIRN_PI : s->slope;
        s->slope = s->slope >= CAIRN_PI ? s->slope - CAIRN_PI : s->slope;
        set->side_key[set->against] = s->slope;
        set->side_order[set->against] = set->against;
    }
    for (; set->cursor < set->segment_count; set->cursor++) {
        int32_t to = set->member[set->cursor];

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        if (to >= 0)
            set->order[set->sides[to].first++] = set->cursor;
    }
    return CAIRN_OK;
}

/* ---- Pairs ---- */

/* Every side with those that come after it in the order of slopes, around, as long as they are
 * near to parallel. */
static cairn_status step_pairs(cairn_rectangle_set *set, cairn_budget *budget)
{
    while (set->cursor < set->side_count) {
        const side *s = &set->sides[set->side_order[set->cursor]];
        int32_t is_last = 0;

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        for (int32_t i = 0; i < 4 && !is_last; i++) {
            int32_t place = set->cursor + ++set->against,
                    next = set->side_order[place % set->side_count];
            pair made;

            is_last = (place >= set->side_count && set->sides[next].slope >= s->slope) ||
                      cairn_rectangle_turn(set->sides[next].slope, s->slope) > set->params.angle;
            if (is_last || !cairn_rectangle_pair(set, set->side_order[set->cursor], next, &made))
                continue;
            if (set->pair_count == set->params.max_pairs) {
                set->dropped++;
                continue;
            }
            set->pair_key[set->pair_count] = made.slope;
            set->pair_order[set->pair_count] = set->pair_count;
            set->pairs[set->pair_count++] = made;
        }
        if (is_last) {
            set->cursor++;
            set->against = 0;
        }
    }
    return CAIRN_OK;
}

/* ---- The search ---- */

/* What a phase needs at its begin. */
static void begin_phase(cairn_rectangle_set *set)
{
    set->cursor = 0;
    set->against = 0;
    set->paid = 0;
    if (set->phase == RECTANGLE_BY_LENGTH)
        set->sort = sort_begin(set->order, set->key, set->ordered);
    else if (set->phase == RECTANGLE_BY_SLOPE)
        set->sort = sort_begin(set->side_order, set->side_key, set->side_count);
    else if (set->phase == RECTANGLE_BY_PAIR_SLOPE)
        set->sort = sort_begin(set->pair_order, set->pair_key, set->pair_count);
}

static cairn_status step_phase(cairn_rectangle_set *set, cairn_budget *budget)
{
    switch (set->phase) {
    case RECTANGLE_LENGTHS:
        return step_lengths(set, budget);
    case RECTANGLE_MERGE:
        return step_merge(set, budget);
    case RECTANGLE_MEMBERS:
        return step_members(set, budget);
    case RECTANGLE_PAIRS:
        return step_pairs(set, budget);
    case RECTANGLE_MATCH:
        return cairn_rectangle_match(set, budget);
    default:
        return step_sort(&set->sort, &set->paid, budget);
    }
}

static void finish(cairn_rectangle_set *set)
{
    cairn_rectangle *list = set->done;

    set->done = set->list;
    set->done_count = set->list_count;
    set->done_dropped = set->dropped;
    set->list = list;
}

cairn_status cairn_rectangle_step(cairn_rectangle_set *set, cairn_budget *budget)
{
    if (set == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (set->phase != RECTANGLE_IDLE) {
        cairn_status status = step_phase(set, budget);

        if (status == CAIRN_MORE)
            return status;
        if (status < 0) {
            set->phase = RECTANGLE_IDLE;
            return status;
        }
        if (set->phase == RECTANGLE_MATCH)
            finish(set);
        set->phase = set->phase == RECTANGLE_MATCH ? RECTANGLE_IDLE : set->phase + 1;
        begin_phase(set);
    }
    return CAIRN_OK;
}

const cairn_rectangle *cairn_rectangle_list(const cairn_rectangle_set *set, int32_t *count)
{
    *count = set->done_count;
    return set->done;
}

int32_t cairn_rectangle_dropped(const cairn_rectangle_set *set)
{
    return set->done_dropped;
}

void cairn_rectangle_corners(const cairn_rectangle *rectangle, cairn_vec2 corners[4])
{
    static const int8_t signs[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    cairn_transform t = cairn_transform_of(rectangle->centre);

    for (int32_t i = 0; i < 4; i++) {
        cairn_vec2 corner = {signs[i][0] * rectangle->half_length,
                             signs[i][1] * rectangle->half_width};

        corners[i] = cairn_transform_point(t, corner);
    }
}
