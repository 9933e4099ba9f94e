/* Discrete curve evolution.
 *
 * Method: vertices stand in a ring; each has its relevance, which a removal changes for two of them
 * only. The least one goes, of equals that of the lowest index, unless the side that takes its
 * place touches another side; then the next in that order is tried. A vertex that could not go is
 * tried again after the next removal.
 *
 * Layout: vertices, relevances, the ring's links both ways, ranks.
 *
 * Limits: a polyline that touches itself from the start is evolved as well; what touches then
 * mostly stays.
 *
 * Source: Latecki & Lakaemper 1999; Adluru 2008, section 4.3. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/curve_evolution.h"

enum { IDLE, SEARCH, CHECK, DONE };
enum { LEAST_POINTS = 3, MOST_POINTS = 4096 };
/* Units: vertices looked at, sides tested and a removal. */
enum { LOOKS_A_UNIT = 16, TESTS_A_UNIT = 3, UNITS_A_REMOVAL = 6 };

struct cairn_curve_evolution {
    cairn_curve_evolution_params params;
    cairn_vec2 *points;
    cairn_real *relevance;
    int32_t *before, *after, *rank;
    int32_t count, left; /* vertices in all, and in the ring */
    int32_t first;       /* of the ring */
    int32_t tried;       /* the candidate, -1: none since the last removal */
    int32_t phase, paid;
};

cairn_curve_evolution_params cairn_curve_evolution_default(void)
{
    cairn_curve_evolution_params params = {256};

    return params;
}

static cairn_curve_evolution *carve(cairn_pool *pool, const cairn_curve_evolution_params *p)
{
    size_t n = (size_t)p->max_points;
    cairn_curve_evolution *e = cairn_pool_take_one(pool, sizeof *e);
    cairn_vec2 *points = cairn_pool_take(pool, n, sizeof *points);
    cairn_real *relevance = cairn_pool_take(pool, n, sizeof *relevance);
    int32_t *before = cairn_pool_take(pool, n, sizeof *before);
    int32_t *after = cairn_pool_take(pool, n, sizeof *after);
    int32_t *rank = cairn_pool_take(pool, n, sizeof *rank);

    if (e != NULL) {
        memset(e, 0, sizeof *e);
        e->points = points;
        e->relevance = relevance;
        e->before = before;
        e->after = after;
        e->rank = rank;
    }
    return e;
}

size_t cairn_curve_evolution_memory(const cairn_curve_evolution_params *params)
{
    cairn_pool counting;

    if (params == NULL || params->max_points < LEAST_POINTS || params->max_points > MOST_POINTS)
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_curve_evolution_create(cairn_curve_evolution **evolution, cairn_pool *pool,
                                          const cairn_curve_evolution_params *params)
{
    size_t need = cairn_curve_evolution_memory(params);

    if (evolution == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    *evolution = carve(pool, params);
    (*evolution)->params = *params;
    return CAIRN_OK;
}

cairn_real cairn_curve_relevance(cairn_vec2 before, cairn_vec2 vertex, cairn_vec2 after)
{
    cairn_vec2 in = cairn_vec2_sub(vertex, before), out = cairn_vec2_sub(after, vertex);
    cairn_real first = cairn_vec2_norm(in), second = cairn_vec2_norm(out);

    if (!(first + second > 0))
        return 0;
    return cairn_abs(cairn_atan2(cairn_vec2_cross(in, out), cairn_vec2_dot(in, out))) *
           (first / (first + second) * second);
}

static void weigh(cairn_curve_evolution *e, int32_t i)
{
    e->relevance[i] =
        cairn_curve_relevance(e->points[e->before[i]], e->points[i], e->points[e->after[i]]);
}

cairn_status cairn_curve_evolution_begin(cairn_curve_evolution *e, const cairn_vec2 *points,
                                         int32_t count)
{
    if (e == NULL || points == NULL || count < LEAST_POINTS)
        return CAIRN_BAD_ARGUMENT;
    if (count > e->params.max_points)
        return CAIRN_FULL;
    for (int32_t i = 0; i < count; i++)
        if (!cairn_is_finite(points[i].x) || !cairn_is_finite(points[i].y))
            return CAIRN_NOT_FINITE;
    memcpy(e->points, points, (size_t)count * sizeof *points);
    for (int32_t i = 0; i < count; i++) {
        e->before[i] = i > 0 ? i - 1 : count - 1;
        e->after[i] = i + 1 < count ? i + 1 : 0;
        e->rank[i] = -1;
    }
    e->count = e->left = count;
    e->first = e->paid = 0;
    e->tried = -1;
    for (int32_t i = 0; i < count; i++)
        weigh(e, i);
    e->phase = SEARCH;
    return CAIRN_OK;
}

/* The order in which vertices go. */
static int goes_before(const cairn_curve_evolution *e, int32_t i, int32_t k)
{
    cairn_real own = e->relevance[i], other = e->relevance[k];

    return own < other || (own <= other && i < k);
}

/* The first in that order of those behind the one that was tried; -1: there is none. */
static int32_t next_candidate(const cairn_curve_evolution *e)
{
    int32_t best = -1, i = e->first;

    for (int32_t k = 0; k < e->left; k++, i = e->after[i])
        if ((e->tried < 0 || goes_before(e, e->tried, i)) && (best < 0 || goes_before(e, i, best)))
            best = i;
    return best;
}

/* 1 when the side from `end` runs back over the one that ends there. */
static int runs_back(cairn_vec2 start, cairn_vec2 end, cairn_vec2 beyond)
{
    cairn_vec2 back = cairn_vec2_sub(start, end), on = cairn_vec2_sub(beyond, end);

    return cairn_vec2_cross(back, on) == 0 && cairn_vec2_dot(back, on) > 0;
}

/* 1 when the side past vertex i would touch another one. */
static int would_touch(const cairn_curve_evolution *e, int32_t i)
{
    const cairn_vec2 *p = e->points;
    int32_t from = e->before[i], to = e->after[i];
    cairn_segment side = {p[from], p[to]};

    for (int32_t k = e->after[to]; e->after[k] != from; k = e->after[k]) {
        cairn_segment other = {p[k], p[e->after[k]]};

        if (cairn_segments_cross(side, other))
            return 1;
    }
    return runs_back(p[from], p[to], p[e->after[to]]) ||
           runs_back(p[to], p[from], p[e->before[from]]);
}

static void remove_vertex(cairn_curve_evolution *e, int32_t i)
{
    int32_t from = e->before[i], to = e->after[i];

    e->after[from] = to;
    e->before[to] = from;
    e->first = e->first == i ? to : e->first;
    e->rank[i] = --e->left;
    weigh(e, from);
    weigh(e, to);
}

/* Those that stay are ranked in their order. */
static void rank_rest(cairn_curve_evolution *e)
{
    int32_t rank = 0;

    for (int32_t i = 0; i < e->count; i++)
        if (e->rank[i] < 0)
            e->rank[i] = rank++;
    e->phase = DONE;
}

cairn_status cairn_curve_evolution_step(cairn_curve_evolution *e, cairn_budget *budget)
{
    if (e == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (e->phase == SEARCH || e->phase == CHECK) {
        int32_t cost = e->phase == SEARCH ? 1 + e->left / LOOKS_A_UNIT
                                          : UNITS_A_REMOVAL + e->left / TESTS_A_UNIT;

        if (!cairn_budget_pay(budget, &e->paid, cost))
            return CAIRN_MORE;
        if (e->phase == SEARCH) {
            e->tried = e->left > LEAST_POINTS ? next_candidate(e) : -1;
            if (e->tried < 0)
                rank_rest(e);
            else
                e->phase = CHECK;
        } else {
            if (!would_touch(e, e->tried)) {
                remove_vertex(e, e->tried);
                e->tried = -1;
            }
            e->phase = SEARCH;
        }
    }
    return CAIRN_OK;
}

cairn_curve_evolution_result cairn_curve_evolution_read(const cairn_curve_evolution *e)
{
    cairn_curve_evolution_result result = {NULL, 0, 0};

    if (e != NULL && e->phase == DONE) {
        result.rank = e->rank;
        result.count = e->count;
        result.least = e->left;
    }
    return result;
}
