/* Shortest ways within a polygon with holes.
 *
 * Method: two vertices see each other when they are neighbours of an outline, or when the segment
 * between them leaves both into the shape and touches no side of other vertices. A segment that
 * only grazes a vertex counts as blocked: the way over that vertex is as long, and no rounding
 * decides on which side it passes. Shortest ways bend at reflex vertices alone, so those are all
 * that Floyd's sums over intermediate vertices must visit; straight vertices are taken along, for
 * ways that graze them.
 *
 * Layout: vertices with the directions of the sides behind them, neighbours, flags, the square of
 * distances.
 *
 * Limits: what is nearer than TOUCH (of the size) touches. Vertices must not coincide but for
 * neighbours.
 *
 * Source: Lozano-Perez & Wesley 1979 (ways along vertices); Adluru 2008, section 4.5. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/inner_distance.h"

enum { IDLE, SIGHT, WAYS, SPAN, DONE };
enum { LEAST_POINTS = 3, MOST_POINTS = 2048 };
/* Units: a pair of vertices, sides that it is tested against, sums that are compared. */
enum { UNITS_A_PAIR = 1, SIDES_A_UNIT = 8, SUMS_A_UNIT = 24 };

#ifdef CAIRN_FLOAT
#define TOUCH    CAIRN_REAL(8e-6)
#define STRAIGHT CAIRN_REAL(1e-4)
#else
#define TOUCH    CAIRN_REAL(1.5e-14)
#define STRAIGHT CAIRN_REAL(1e-6)
#endif

typedef struct inner_vertex {
    /* along: unit direction of the side to the next; the shape lies to its left */
    cairn_vec2 at, along;
    int32_t before, after;
    /* 1: shortest ways may bend or graze here */
    int32_t bends;
} inner_vertex;

struct cairn_inner_distance {
    cairn_inner_distance_params params;
    inner_vertex *vertices;
    cairn_real *distance;
    int32_t count, outer;
    int32_t i, k;     /* what the phase is at */
    int32_t blocker;  /* the side that was met last */
    cairn_real touch; /* nearer than that touches */
    cairn_real far;   /* longer than any way */
    cairn_real greatest;
    int32_t phase, paid;
};

cairn_inner_distance_params cairn_inner_distance_default(void)
{
    cairn_inner_distance_params params = {128, 0};

    return params;
}

static cairn_inner_distance *carve(cairn_pool *pool, const cairn_inner_distance_params *p)
{
    size_t n = (size_t)p->max_points;
    cairn_inner_distance *d = cairn_pool_take_one(pool, sizeof *d);
    inner_vertex *vertices = cairn_pool_take(pool, n, sizeof *vertices);
    cairn_real *distance = cairn_pool_take(pool, n * n, sizeof *distance);

    if (d != NULL) {
        memset(d, 0, sizeof *d);
        d->vertices = vertices;
        d->distance = distance;
    }
    return d;
}

size_t cairn_inner_distance_memory(const cairn_inner_distance_params *params)
{
    cairn_pool counting;

    if (params == NULL || params->max_points < LEAST_POINTS || params->max_points > MOST_POINTS ||
        (params->fill_holes != 0 && params->fill_holes != 1))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_inner_distance_create(cairn_inner_distance **inner, cairn_pool *pool,
                                         const cairn_inner_distance_params *params)
{
    size_t need = cairn_inner_distance_memory(params);

    if (inner == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    *inner = carve(pool, params);
    (*inner)->params = *params;
    return CAIRN_OK;
}

/* ---- The outlines ---- */

/* *reach: the greatest coordinate; *whole: the length of all outlines. */
static cairn_status check_outlines(const cairn_inner_distance *d, const cairn_curve *outlines,
                                   int32_t count, cairn_real *reach, cairn_real *whole)
{
    int32_t points = 0;

    for (int32_t i = 0; i < count; i++) {
        const cairn_curve *c = &outlines[i];

        if (c->points == NULL || c->count < LEAST_POINTS || !c->closed)
            return CAIRN_BAD_ARGUMENT;
        if (c->count > d->params.max_points - points)
            return CAIRN_FULL;
        points += c->count;
    }
    *reach = *whole = 0;
    for (int32_t i = 0; i < count; i++) {
        const cairn_curve *c = &outlines[i];

        for (int32_t k = 0; k < c->count; k++) {
            if (!cairn_is_finite(c->points[k].x) || !cairn_is_finite(c->points[k].y))
                return CAIRN_NOT_FINITE;
            *reach =
                cairn_max(*reach, cairn_max(cairn_abs(c->points[k].x), cairn_abs(c->points[k].y)));
        }
        *whole += cairn_curve_length(c);
        if (!cairn_is_finite(4 * *whole) || !cairn_is_finite(*reach * *reach))
            return CAIRN_NOT_FINITE;
        if (!(cairn_abs(cairn_polygon_area(c->points, c->count)) > 0))
            return CAIRN_EMPTY;
    }
    return CAIRN_OK;
}

/* Takes an outline over so that the shape lies to its left, its vertices in their order. */
static void add_outline(cairn_inner_distance *d, const cairn_curve *curve, int32_t is_hole)
{
    int32_t first = d->count, n = curve->count;
    int forward = (cairn_polygon_area(curve->points, n) > 0) != is_hole;

    for (int32_t i = 0; i < n; i++) {
        inner_vertex *v = &d->vertices[first + i];
        int32_t low = first + (i > 0 ? i - 1 : n - 1), high = first + (i + 1 < n ? i + 1 : 0);

        v->at = curve->points[i];
        v->before = forward ? low : high;
        v->after = forward ? high : low;
    }
    d->count += n;
    for (int32_t i = first; i < d->count; i++)
        d->vertices[i].along = cairn_vec2_unit(
            cairn_vec2_sub(d->vertices[d->vertices[i].after].at, d->vertices[i].at));
    for (int32_t i = first; i < d->count; i++)
        d->vertices[i].bends = cairn_vec2_cross(d->vertices[d->vertices[i].before].along,
                                                d->vertices[i].along) <= STRAIGHT;
}

cairn_status cairn_inner_distance_begin(cairn_inner_distance *d, const cairn_curve *outlines,
                                        int32_t count)
{
    cairn_real reach, whole;
    cairn_status status;

    if (d == NULL || outlines == NULL || count < 1)
        return CAIRN_BAD_ARGUMENT;
    count = d->params.fill_holes ? 1 : count;
    status = check_outlines(d, outlines, count, &reach, &whole);
    if (status != CAIRN_OK)
        return status;
    d->count = 0;
    for (int32_t i = 0; i < count; i++)
        add_outline(d, &outlines[i], i > 0);
    d->outer = outlines[0].count;
    d->touch = TOUCH * (reach + whole);
    d->far = 2 * whole;
    d->i = d->k = d->blocker = d->paid = 0;
    d->greatest = 0;
    d->phase = SIGHT;
    return CAIRN_OK;
}

/* ---- Who sees whom ---- */

/* 1 when a unit direction leaves a vertex into the shape, or along one of its sides. */
static int leads_inside(const cairn_inner_distance *d, const inner_vertex *v, cairn_vec2 direction)
{
    cairn_vec2 in = d->vertices[v->before].along;
    int of_in = cairn_vec2_cross(in, direction) >= -STRAIGHT,
        of_out = cairn_vec2_cross(v->along, direction) >= -STRAIGHT;

    return cairn_vec2_cross(in, v->along) >= 0 ? of_in && of_out : of_in || of_out;
}

/* A segment between two vertices: where it begins, its unit direction, its length. */
typedef struct sight {
    cairn_vec2 from, along;
    cairn_real length;
} sight;

static cairn_real aside(const sight *s, cairn_vec2 p)
{
    return cairn_vec2_cross(s->along, cairn_vec2_sub(p, s->from));
}

static cairn_real ahead(const sight *s, cairn_vec2 p)
{
    return cairn_vec2_dot(s->along, cairn_vec2_sub(p, s->from));
}

static int is_within(const sight *s, cairn_real place)
{
    return place >= 0 && place <= s->length;
}

/* 1 when the segment meets a side, whose ends lie `a` and `b` aside of it. */
static int meets(const sight *s, cairn_vec2 from, cairn_vec2 to, cairn_real a, cairn_real b,
                 cairn_real touch)
{
    if ((a > touch && b > touch) || (a < -touch && b < -touch))
        return 0;
    if (cairn_abs(a) <= touch || cairn_abs(b) <= touch)
        return (cairn_abs(a) <= touch && is_within(s, ahead(s, from))) ||
               (cairn_abs(b) <= touch && is_within(s, ahead(s, to)));
    return is_within(s, (ahead(s, from) * b - ahead(s, to) * a) / (b - a));
}

static int blocks(const cairn_inner_distance *d, const sight *s, int32_t side, int32_t i, int32_t k)
{
    const inner_vertex *v = &d->vertices[side];
    cairn_vec2 to = d->vertices[v->after].at;

    if (side == i || side == k || v->after == i || v->after == k)
        return 0;
    return meets(s, v->at, to, aside(s, v->at), aside(s, to), d->touch);
}

/* Neighbouring segments are mostly blocked by the same side: it is asked first. */
static int are_in_sight(cairn_inner_distance *d, int32_t i, int32_t k)
{
    const inner_vertex *a = &d->vertices[i], *b = &d->vertices[k];
    cairn_vec2 way = cairn_vec2_sub(b->at, a->at);
    sight s = {a->at, cairn_vec2_unit(way), cairn_vec2_norm(way)};

    if (a->after == k || a->before == k)
        return 1;
    if (!leads_inside(d, a, s.along) || !leads_inside(d, b, cairn_vec2_scale(s.along, -1)) ||
        blocks(d, &s, d->blocker, i, k))
        return 0;
    for (int32_t side = 0; side < d->count; side++)
        if (blocks(d, &s, side, i, k)) {
            d->blocker = side;
            return 0;
        }
    return 1;
}

static cairn_status step_sight(cairn_inner_distance *d, cairn_budget *budget)
{
    int32_t n = d->count;

    for (; d->i < n; d->i++, d->k = 0) {
        for (; d->k < d->i; d->k++) {
            cairn_real length = d->far;

            if (!cairn_budget_pay(budget, &d->paid, UNITS_A_PAIR + n / SIDES_A_UNIT))
                return CAIRN_MORE;
            if (are_in_sight(d, d->i, d->k))
                length =
                    cairn_vec2_norm(cairn_vec2_sub(d->vertices[d->i].at, d->vertices[d->k].at));
            d->distance[d->i * n + d->k] = d->distance[d->k * n + d->i] = length;
        }
        d->distance[d->i * n + d->i] = 0;
    }
    d->i = d->k = 0;
    d->phase = WAYS;
    return CAIRN_OK;
}

/* ---- The ways ---- */

/* Ways from vertex i over vertex k to all others. */
static void relax(cairn_inner_distance *d, int32_t i, int32_t k)
{
    cairn_real *own = &d->distance[i * d->count], first = own[k];
    const cairn_real *over = &d->distance[k * d->count];

    for (int32_t to = 0; to < d->count; to++)
        own[to] = cairn_min(own[to], first + over[to]);
}

static cairn_status step_ways(cairn_inner_distance *d, cairn_budget *budget)
{
    int32_t n = d->count;

    for (; d->k < n; d->k++, d->i = 0) {
        for (; d->i < n && d->vertices[d->k].bends; d->i++) {
            if (!cairn_budget_pay(budget, &d->paid, 1 + n / SUMS_A_UNIT))
                return CAIRN_MORE;
            if (d->distance[d->i * n + d->k] < d->far)
                relax(d, d->i, d->k);
        }
    }
    d->i = 0;
    d->phase = SPAN;
    return CAIRN_OK;
}

static cairn_status step_span(cairn_inner_distance *d, cairn_budget *budget)
{
    for (; d->i < d->outer; d->i++) {
        if (!cairn_budget_pay(budget, &d->paid, 1 + d->outer / SUMS_A_UNIT))
            return CAIRN_MORE;
        for (int32_t k = 0; k < d->outer; k++)
            d->greatest = cairn_max(d->greatest, d->distance[d->i * d->count + k]);
    }
    d->phase = DONE;
    return CAIRN_OK;
}

cairn_status cairn_inner_distance_step(cairn_inner_distance *d, cairn_budget *budget)
{
    cairn_status status = CAIRN_OK;

    if (d == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (d->phase == SIGHT)
        status = step_sight(d, budget);
    if (d->phase == WAYS && status == CAIRN_OK)
        status = step_ways(d, budget);
    if (d->phase == SPAN && status == CAIRN_OK)
        status = step_span(d, budget);
    return status;
}

cairn_inner_distance_result cairn_inner_distance_read(const cairn_inner_distance *d)
{
    cairn_inner_distance_result result = {NULL, 0, 0, 0};

    if (d != NULL && d->phase == DONE) {
        result.distance = d->distance;
        result.count = d->outer;
        result.stride = d->count;
        result.greatest = d->greatest;
    }
    return result;
}
