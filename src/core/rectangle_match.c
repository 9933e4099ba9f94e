/* Pairs of sides, pairs of pairs, and how much of the rectangle that they make is covered. */
#include "src/core/build.h"

#include <string.h>

#include "src/core/rectangle_work.h"

/* ---- A pair: two sides that face each other ---- */

static cairn_vec2 middle_of(cairn_segment s)
{
    return cairn_vec2_scale(cairn_vec2_add(s.a, s.b), CAIRN_REAL(0.5));
}

/* d, or its opposite when that is nearer to `like`. */
static cairn_vec2 turned_like(cairn_vec2 d, cairn_vec2 like)
{
    return cairn_vec2_dot(d, like) < 0 ? cairn_vec2_scale(d, -1) : d;
}

int cairn_rectangle_pair(const struct cairn_rectangle_set *set, int32_t first, int32_t second,
                         pair *made)
{
    const side *s = &set->sides[first], *t = &set->sides[second];
    cairn_vec2 u =
        cairn_vec2_unit(cairn_vec2_add(s->direction, turned_like(t->direction, s->direction)));
    cairn_vec2 across = cairn_vec2_left(u),
               to = cairn_vec2_sub(middle_of(t->segment), middle_of(s->segment));
    cairn_real apart = cairn_vec2_dot(across, to), slope = cairn_atan2(u.y, u.x);
    int32_t is_above = apart > 0;

    if (cairn_abs(apart) < set->params.min_side ||
        (set->params.oriented && cairn_vec2_dot(s->direction, t->direction) > 0))
        return 0;
    made->side[0] = is_above ? first : second;
    made->side[1] = is_above ? second : first;
    made->kind = CAIRN_RECTANGLE_ANY;
    if (set->params.oriented)
        made->kind = is_above ? CAIRN_RECTANGLE_ROOM : CAIRN_RECTANGLE_BOX;
    slope = slope < 0 ? slope + CAIRN_PI : slope;
    made->slope = slope >= CAIRN_PI ? slope - CAIRN_PI : slope;
    return 1;
}

/* ---- A rectangle: two pairs that stand on each other ---- */

/* The direction of the four sides modulo a right angle, by their lengths, in [0, pi/2). */
static cairn_real common_direction(const struct cairn_rectangle_set *set, const pair *p,
                                   const pair *q)
{
    cairn_real c = 0, s = 0, theta;

    for (int32_t i = 0; i < 4; i++) {
        const side *of = &set->sides[i < 2 ? p->side[i] : q->side[i - 2]];
        cairn_vec2 d = of->direction;
        cairn_real c2 = d.x * d.x - d.y * d.y, s2 = 2 * d.x * d.y;

        c += of->mass * (c2 * c2 - s2 * s2);
        s += of->mass * 2 * c2 * s2;
    }
    theta = cairn_atan2(s, c) / 4;
    return theta < 0 ? theta + CAIRN_PI / 2 : theta;
}

/* Where the line of a side is along `axis`, at the place of `at` along the other axis. */
static cairn_real offset_at(const side *s, cairn_vec2 axis, cairn_vec2 other, cairn_vec2 at)
{
    cairn_vec2 from = middle_of(s->segment);
    cairn_real t =
        cairn_vec2_dot(other, cairn_vec2_sub(at, from)) / cairn_vec2_dot(other, s->direction);

    return cairn_vec2_dot(axis, cairn_vec2_add(from, cairn_vec2_scale(s->direction, t)));
}

/* Share of a side between two places along `axis` that its extent reaches over. */
static cairn_real reach(const side *s, cairn_vec2 axis, cairn_real low, cairn_real high)
{
    cairn_real a = cairn_vec2_dot(axis, s->segment.a), b = cairn_vec2_dot(axis, s->segment.b);
    cairn_real over = cairn_min(cairn_max(a, b), high) - cairn_max(cairn_min(a, b), low);

    return cairn_max(over, 0) / (high - low);
}

/* A pair runs the way of its own sides, which may be against that of the rectangle's axes. */
static void swap_to_rise(cairn_real *low, cairn_real *high, int32_t sides[2])
{
    cairn_real former = *low;
    int32_t first = sides[0];

    if (*low <= *high)
        return;
    *low = *high;
    *high = former;
    sides[0] = sides[1];
    sides[1] = first;
}

/* Lays the rectangle through the lines of its four sides. 0 when they do not stand on each
 * other. */
static int lay(const struct cairn_rectangle_set *set, const pair *p, const pair *q, candidate *c)
{
    cairn_rectangle *r = &c->rectangle;
    const side *s[4];
    cairn_real low_u = 0, high_u = 0, low_v = 0, high_v = 0;
    cairn_vec2 centre = {0, 0};

    r->centre.theta = common_direction(set, p, q);
    cairn_sincos(r->centre.theta, &c->u.y, &c->u.x);
    c->v = cairn_vec2_left(c->u);
    if (cairn_abs(cairn_vec2_dot(c->v, set->sides[p->side[0]].direction)) > CAIRN_REAL(0.7)) {
        const pair *other = p;

        p = q;
        q = other;
    }
    c->deviation = 0;
    for (int32_t i = 0; i < 4; i++) {
        r->side[i] = i < 2 ? p->side[i] : q->side[i - 2];
        s[i] = &set->sides[r->side[i]];
        c->deviation = cairn_max(c->deviation,
                                 cairn_abs(cairn_vec2_cross(i < 2 ? c->u : c->v, s[i]->direction)) /
                                     set->sine_angle);
        centre =
            cairn_vec2_add(centre, cairn_vec2_scale(middle_of(s[i]->segment), CAIRN_REAL(0.25)));
    }
    if (c->deviation > 1)
        return 0;
    for (int32_t i = 0; i < 2; i++) {
        low_v = offset_at(s[0], c->v, c->u, centre);
        high_v = offset_at(s[1], c->v, c->u, centre);
        low_u = offset_at(s[2], c->u, c->v, centre);
        high_u = offset_at(s[3], c->u, c->v, centre);
        centre = cairn_vec2_add(cairn_vec2_scale(c->u, (low_u + high_u) / 2),
                                cairn_vec2_scale(c->v, (low_v + high_v) / 2));
    }
    swap_to_rise(&low_v, &high_v, &r->side[0]);
    swap_to_rise(&low_u, &high_u, &r->side[2]);
    r->centre.x = centre.x;
    r->centre.y = centre.y;
    r->half_length = (high_u - low_u) / 2;
    r->half_width = (high_v - low_v) / 2;
    r->kind = p->kind;
    return r->half_length >= set->params.min_side / 2 && r->half_width >= set->params.min_side / 2;
}

static cairn_real half_of(const cairn_rectangle *r, int32_t side_index)
{
    return side_index < 2 ? r->half_length : r->half_width;
}

/* Share of the outline, from the shares of its sides. */
static cairn_real of_outline(const cairn_rectangle *r, const cairn_real share[4])
{
    return ((share[0] + share[1]) * r->half_length + (share[2] + share[3]) * r->half_width) /
           (2 * (r->half_length + r->half_width));
}

/* Whether the sides' extents, which is the most that their segments may cover, are enough. */
static int can_be_covered(const struct cairn_rectangle_set *set, const candidate *c)
{
    cairn_vec2 centre = {c->rectangle.centre.x, c->rectangle.centre.y};
    cairn_real share[4] = {0, 0, 0, 0};

    for (int32_t i = 0; i < 4; i++) {
        cairn_vec2 axis = i < 2 ? c->u : c->v;
        cairn_real at = cairn_vec2_dot(axis, centre), half = half_of(&c->rectangle, i);

        share[i] = reach(&set->sides[c->rectangle.side[i]], axis, at - half, at + half);
        if (share[i] < set->params.least_side)
            return 0;
    }
    return of_outline(&c->rectangle, share) >= set->params.least_covered;
}

/* ---- Cover ---- */

/* Marks the places of side `at` whose middle a segment covers. */
static void cover(candidate *c, cairn_segment segment)
{
    cairn_vec2 axis = c->at < 2 ? c->u : c->v,
               centre = {c->rectangle.centre.x, c->rectangle.centre.y};
    cairn_real scale = COVER_BITS / (2 * half_of(&c->rectangle, c->at));
    cairn_real a = cairn_vec2_dot(axis, cairn_vec2_sub(segment.a, centre)) * scale +
                   CAIRN_REAL(0.5) * COVER_BITS;
    cairn_real b = cairn_vec2_dot(axis, cairn_vec2_sub(segment.b, centre)) * scale +
                   CAIRN_REAL(0.5) * COVER_BITS;
    cairn_real low = cairn_max(cairn_min(a, b), 0), high = cairn_min(cairn_max(a, b), COVER_BITS);
    int32_t from = cairn_real_to_int(cairn_floor(low + CAIRN_REAL(0.5)));
    int32_t to = cairn_real_to_int(cairn_floor(high + CAIRN_REAL(0.5))); /* one behind the last */

    if (to - from == COVER_BITS)
        c->cover[c->at] = ~(uint64_t)0;
    else if (to > from)
        c->cover[c->at] |= (((uint64_t)1 << ((uint32_t)(to - from) % COVER_BITS)) - 1)
                           << ((uint32_t)from % COVER_BITS);
}

static int32_t bits_of(uint64_t bits)
{
    int32_t count = 0;

    for (; bits != 0; bits &= bits - 1)
        count++;
    return count;
}

/* Two segments a unit. CAIRN_OK: the four sides are done. */
static cairn_status step_cover(struct cairn_rectangle_set *set, cairn_budget *budget)
{
    candidate *c = &set->open;

    while (c->at < 4) {
        const side *s = &set->sides[c->rectangle.side[c->at]];

        if (budget->left <= 0)
            return CAIRN_MORE;
        budget->left--;
        for (int32_t i = 0; i < 2 && c->cursor < s->count; i++, c->cursor++)
            cover(c, set->segments[set->order[s->first - s->count + c->cursor]]);
        if (c->cursor == s->count) {
            c->at++;
            c->cursor = 0;
        }
    }
    return CAIRN_OK;
}

/* ---- The list ---- */

/* The farthest that a corner of one is from the nearest of the other; in a square any corner may
 * be the first. */
static cairn_real apart(const cairn_rectangle *a, const cairn_rectangle *b)
{
    cairn_vec2 of_a[4], of_b[4];
    cairn_real farthest = 0;

    cairn_rectangle_corners(a, of_a);
    cairn_rectangle_corners(b, of_b);
    for (int32_t i = 0; i < 4; i++) {
        cairn_real nearest = CAIRN_REAL_MAX;

        for (int32_t j = 0; j < 4; j++)
            nearest = cairn_min(nearest, cairn_vec2_norm_squared(cairn_vec2_sub(of_a[i], of_b[j])));
        farthest = cairn_max(farthest, nearest);
    }
    return cairn_sqrt(farthest);
}

static int is_same(const struct cairn_rectangle_set *set, const cairn_rectangle *a,
                   const cairn_rectangle *b)
{
    return a->kind == b->kind && apart(a, b) < set->params.separation;
}

static void take_out(struct cairn_rectangle_set *set, int32_t at)
{
    for (int32_t i = at + 1; i < set->list_count; i++)
        set->list[i - 1] = set->list[i];
    set->list_count--;
}

/* Where it is stronger than all the same, in their place; where there is room. */
static void keep(struct cairn_rectangle_set *set, const cairn_rectangle *r)
{
    int32_t at;

    for (int32_t i = 0; i < set->list_count; i++)
        if (set->list[i].strength >= r->strength && is_same(set, &set->list[i], r))
            return;
    for (int32_t i = set->list_count - 1; i >= 0; i--)
        if (is_same(set, &set->list[i], r))
            take_out(set, i);
    if (set->list_count == set->params.max_rectangles) {
        set->dropped++;
        if (set->list[set->list_count - 1].strength >= r->strength)
            return;
        set->list_count--;
    }
    for (at = set->list_count++; at > 0 && set->list[at - 1].strength < r->strength; at--)
        set->list[at] = set->list[at - 1];
    set->list[at] = *r;
}

/* A candidate whose cover is known. */
static void judge(struct cairn_rectangle_set *set)
{
    candidate *c = &set->open;
    cairn_real share[4] = {0, 0, 0, 0};

    for (int32_t i = 0; i < 4; i++) {
        share[i] = (cairn_real)bits_of(c->cover[i]) / COVER_BITS;
        if (share[i] < set->params.least_side)
            return;
    }
    c->rectangle.covered = of_outline(&c->rectangle, share);
    c->rectangle.strength = c->rectangle.covered * (1 - c->deviation * c->deviation / 2);
    if (c->rectangle.covered >= set->params.least_covered)
        keep(set, &c->rectangle);
}

/* ---- Pairs of pairs ---- */

static const pair *pair_at(const struct cairn_rectangle_set *set, int32_t place)
{
    return &set->pairs[set->pair_order[place % set->pair_count]];
}

/* The first place in the order of pairs whose slope is not below. */
static int32_t first_from(const struct cairn_rectangle_set *set, cairn_real slope)
{
    int32_t low = 0, high = set->pair_count;

    while (low < high) {
        int32_t middle = low + (high - low) / 2;

        if (pair_at(set, middle)->slope < slope)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* The candidate of two pairs, when they can make a rectangle. */
static int open_candidate(struct cairn_rectangle_set *set, const pair *p, const pair *q)
{
    candidate *c = &set->open;

    if (p->kind != q->kind)
        return 0;
    memset(c, 0, sizeof *c);
    return lay(set, p, q, c) && can_be_covered(set, c);
}

cairn_status cairn_rectangle_match(struct cairn_rectangle_set *set, cairn_budget *budget)
{
    while (set->cursor < set->pair_count || set->is_open) {
        const pair *p, *q;
        cairn_real from;

        if (set->is_open) {
            if (step_cover(set, budget) == CAIRN_MORE ||
                !cairn_budget_pay(budget, &set->paid, 8 + 4 * set->list_count))
                return CAIRN_MORE;
            judge(set);
            set->is_open = 0;
            continue;
        }
        if (!cairn_budget_pay(budget, &set->paid, 2))
            return CAIRN_MORE;
        p = pair_at(set, set->cursor);
        from = p->slope + CAIRN_PI / 2 - set->params.angle;
        from = from >= CAIRN_PI ? from - CAIRN_PI : from;
        if (set->against == 0)
            set->best = first_from(set, from);
        if (set->against < set->pair_count) {
            q = pair_at(set, set->best + set->against);
            set->against++;
            if (cairn_rectangle_turn(q->slope, from) <= 2 * set->params.angle) {
                /* of the two that see each other the first */
                set->is_open = q > p && open_candidate(set, p, q);
                continue;
            }
        }
        set->cursor++;
        set->against = 0;
    }
    return CAIRN_OK;
}
