/* Discrete curve evolution (DCE) of a closed polyline.
 *
 * Method:
 * 1. The vertices form a ring (a doubly linked list). Each has a relevance.
 * 2. The vertex of least relevance, of equals the one of lowest index, is removed, unless the side
 *    that replaces it would intersect another side. Then the next vertex in this order is tried.
 *    As written it is removed in any case.
 * 3. A removal changes the relevance of the two neighbours only. A vertex that could not be removed
 *    is tried again after the next removal.
 *
 * Layout: vertices, relevances, links of the ring in both directions, ranks.
 *
 * Limits: a polyline that intersects itself from the start is evolved as well; its intersections
 * mostly stay.
 *
 * Source: Latecki and Lakaemper 1999; Adluru 2008, section 4.3. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/curve_evolution.h"

/* Phases: search for the next candidate, and check of its removal. */
typedef int32_t curve_evolution_phase;
enum { PHASE_IDLE, PHASE_SEARCH, PHASE_CHECK, PHASE_DONE };
/* Bounds of the number of vertices. */
enum { MIN_POINTS = 3, MAX_POINTS = 4096 };
/* Vertices visited and sides tested per work unit, and work units of a removal. */
enum { VISITS_PER_UNIT = 16, TESTS_PER_UNIT = 3, UNITS_PER_REMOVAL = 6 };

struct cairn_curve_evolution {
    cairn_curve_evolution_params params;
    /* [max_points] Vertices and their relevances. */
    cairn_vec2 *points;
    cairn_real *relevance;
    /* [max_points] Links of the ring, and ranks; rank -1: not removed yet. */
    int32_t *previous, *next, *rank;
    /* Number of vertices in all, and in the ring. */
    int32_t count, remaining;
    /* A vertex of the ring. */
    int32_t ring_start;
    /* Vertex that was tried last, -1: none since the last removal. */
    int32_t candidate;
    curve_evolution_phase phase;
    /* Work units charged for the next operation so far. */
    int32_t units_charged;
};

cairn_curve_evolution_params cairn_curve_evolution_default(void)
{
    cairn_curve_evolution_params params = {.max_points = 256};

    return params;
}

cairn_curve_evolution_params cairn_curve_evolution_as_written(void)
{
    cairn_curve_evolution_params params = cairn_curve_evolution_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    return params;
}

/* Allocates the object and its arrays; NULL from a counting pool. */
static cairn_curve_evolution *carve(cairn_pool *pool, const cairn_curve_evolution_params *params)
{
    size_t n = (size_t)params->max_points;
    cairn_curve_evolution *evolution = cairn_pool_take_one(pool, sizeof *evolution);
    cairn_vec2 *points = cairn_pool_take(pool, n, sizeof *points);
    cairn_real *relevance = cairn_pool_take(pool, n, sizeof *relevance);
    int32_t *previous = cairn_pool_take(pool, n, sizeof *previous);
    int32_t *next = cairn_pool_take(pool, n, sizeof *next);
    int32_t *rank = cairn_pool_take(pool, n, sizeof *rank);

    if (evolution != NULL) {
        memset(evolution, 0, sizeof *evolution);
        evolution->points = points;
        evolution->relevance = relevance;
        evolution->previous = previous;
        evolution->next = next;
        evolution->rank = rank;
    }
    return evolution;
}

size_t cairn_curve_evolution_memory(const cairn_curve_evolution_params *params)
{
    cairn_pool counting;

    if (params == NULL || params->max_points < MIN_POINTS || params->max_points > MAX_POINTS ||
        params->mode < CAIRN_MODE_DEFAULT || params->mode > CAIRN_MODE_AS_WRITTEN)
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
    if (!cairn_pool_has_capacity(pool, need))
        return CAIRN_NO_MEMORY;
    *evolution = carve(pool, params);
    (*evolution)->params = *params;
    return CAIRN_OK;
}

cairn_real cairn_curve_evolution_relevance(cairn_vec2 before, cairn_vec2 vertex, cairn_vec2 after)
{
    cairn_vec2 in = cairn_vec2_sub(vertex, before), out = cairn_vec2_sub(after, vertex);
    cairn_real first = cairn_vec2_norm(in), second = cairn_vec2_norm(out);

    if (!(first + second > 0))
        return 0;
    return cairn_abs(cairn_vec2_angle(in, out)) * (first / (first + second) * second);
}

/* Computes the relevance of vertex i. */
static void update_relevance(cairn_curve_evolution *evolution, int32_t i)
{
    evolution->relevance[i] = cairn_curve_evolution_relevance(
        evolution->points[evolution->previous[i]], evolution->points[i],
        evolution->points[evolution->next[i]]);
}

cairn_status cairn_curve_evolution_begin(cairn_curve_evolution *evolution, const cairn_vec2 *points,
                                         int32_t count)
{
    if (evolution == NULL || points == NULL || count < MIN_POINTS)
        return CAIRN_BAD_ARGUMENT;
    if (count > evolution->params.max_points)
        return CAIRN_FULL;
    for (int32_t i = 0; i < count; i++)
        if (!cairn_vec2_is_finite(points[i]))
            return CAIRN_NOT_FINITE;
    memcpy(evolution->points, points, (size_t)count * sizeof *points);
    for (int32_t i = 0; i < count; i++) {
        evolution->previous[i] = i > 0 ? i - 1 : count - 1;
        evolution->next[i] = i + 1 < count ? i + 1 : 0;
        evolution->rank[i] = -1;
    }
    evolution->count = evolution->remaining = count;
    evolution->ring_start = evolution->units_charged = 0;
    evolution->candidate = -1;
    for (int32_t i = 0; i < count; i++)
        update_relevance(evolution, i);
    evolution->phase = PHASE_SEARCH;
    return CAIRN_OK;
}

/* 1 when vertex i comes before k in the order of removal. */
static int is_removed_before(const cairn_curve_evolution *evolution, int32_t i, int32_t k)
{
    cairn_real own = evolution->relevance[i], other = evolution->relevance[k];

    return own < other || (own <= other && i < k);
}

/* First vertex in the order of removal after the last candidate; -1: none. */
static int32_t next_candidate(const cairn_curve_evolution *evolution)
{
    int32_t best = -1, i = evolution->ring_start;

    for (int32_t k = 0; k < evolution->remaining; k++, i = evolution->next[i])
        if ((evolution->candidate < 0 || is_removed_before(evolution, evolution->candidate, i)) &&
            (best < 0 || is_removed_before(evolution, i, best)))
            best = i;
    return best;
}

/* 1 when the side from `end` to `beyond` overlaps the side from `start` to `end`. */
static int folds_back(cairn_vec2 start, cairn_vec2 end, cairn_vec2 beyond)
{
    cairn_vec2 back = cairn_vec2_sub(start, end), onward = cairn_vec2_sub(beyond, end);

    return cairn_vec2_cross(back, onward) == 0 && cairn_vec2_dot(back, onward) > 0;
}

/* 1 when the side that replaces vertex i would intersect another side. */
static int would_intersect(const cairn_curve_evolution *evolution, int32_t i)
{
    const cairn_vec2 *points = evolution->points;
    int32_t from = evolution->previous[i], to = evolution->next[i];
    cairn_segment side = {points[from], points[to]};

    for (int32_t k = evolution->next[to]; evolution->next[k] != from; k = evolution->next[k]) {
        cairn_segment other = {points[k], points[evolution->next[k]]};

        if (cairn_segments_intersect(side, other))
            return 1;
    }
    return folds_back(points[from], points[to], points[evolution->next[to]]) ||
           folds_back(points[to], points[from], points[evolution->previous[from]]);
}

/* Removes vertex i from the ring and ranks it. */
static void remove_vertex(cairn_curve_evolution *evolution, int32_t i)
{
    int32_t from = evolution->previous[i], to = evolution->next[i];

    evolution->next[from] = to;
    evolution->previous[to] = from;
    evolution->ring_start = evolution->ring_start == i ? to : evolution->ring_start;
    evolution->rank[i] = --evolution->remaining;
    update_relevance(evolution, from);
    update_relevance(evolution, to);
}

/* Ranks the remaining vertices in their order. */
static void rank_remaining(cairn_curve_evolution *evolution)
{
    int32_t rank = 0;

    for (int32_t i = 0; i < evolution->count; i++)
        if (evolution->rank[i] < 0)
            evolution->rank[i] = rank++;
    evolution->phase = PHASE_DONE;
}

cairn_status cairn_curve_evolution_step(cairn_curve_evolution *evolution, cairn_budget *budget)
{
    if (evolution == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (evolution->phase == PHASE_SEARCH || evolution->phase == PHASE_CHECK) {
        int32_t cost = evolution->phase == PHASE_SEARCH
                           ? 1 + evolution->remaining / VISITS_PER_UNIT
                           : UNITS_PER_REMOVAL + evolution->remaining / TESTS_PER_UNIT;

        if (!cairn_budget_charge(budget, &evolution->units_charged, cost))
            return CAIRN_MORE;
        if (evolution->phase == PHASE_SEARCH) {
            evolution->candidate =
                evolution->remaining > MIN_POINTS ? next_candidate(evolution) : -1;
            if (evolution->candidate < 0)
                rank_remaining(evolution);
            else
                evolution->phase = PHASE_CHECK;
        } else {
            if (evolution->params.mode == CAIRN_MODE_AS_WRITTEN ||
                !would_intersect(evolution, evolution->candidate)) {
                remove_vertex(evolution, evolution->candidate);
                evolution->candidate = -1;
            }
            evolution->phase = PHASE_SEARCH;
        }
    }
    return CAIRN_OK;
}

cairn_curve_evolution_result cairn_curve_evolution_read(const cairn_curve_evolution *evolution)
{
    cairn_curve_evolution_result result = {0};

    if (evolution != NULL && evolution->phase == PHASE_DONE) {
        result.rank = evolution->rank;
        result.count = evolution->count;
        result.min_vertices = evolution->remaining;
    }
    return result;
}
