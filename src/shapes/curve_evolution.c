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
#include "src/base/object.h"
#include "src/base/step.h"

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
    /* CAIRN_MORE: in work; CAIRN_OK: the result is complete; else there is none. */
    cairn_status status;
    /* Resume point of the evolution. */
    int32_t resume;
    /* Work units charged for the next operation so far. */
    int32_t units_charged;
};

#define INTEGER(field, ...) CAIRN_INTEGER(cairn_curve_evolution_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_points, 256, MIN_POINTS, MAX_POINTS),
    INTEGER(mode, CAIRN_MODE_DEFAULT, CAIRN_MODE_DEFAULT, CAIRN_MODE_AS_WRITTEN),
};
extern const cairn_parameters cairn_curve_evolution_parameters;
const cairn_parameters cairn_curve_evolution_parameters =
    CAIRN_PARAMETERS("curve_evolution", cairn_curve_evolution_params, rows);

cairn_curve_evolution_params cairn_curve_evolution_default(void)
{
    cairn_curve_evolution_params params;

    cairn_parameters_preset(&cairn_curve_evolution_parameters, &params);
    return params;
}

cairn_curve_evolution_params cairn_curve_evolution_as_written(void)
{
    cairn_curve_evolution_params params = cairn_curve_evolution_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    return params;
}

cairn_status cairn_curve_evolution_check(const cairn_curve_evolution_params *params,
                                         cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_curve_evolution_parameters, params, fault);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_curve_evolution *build(cairn_pool *pool, const cairn_curve_evolution_params *params)
{
    size_t n = (size_t)params->max_points;
    cairn_curve_evolution *evolution = cairn_object_take(pool, sizeof *evolution);

    CAIRN_TAKE(evolution, pool, points, n);
    CAIRN_TAKE(evolution, pool, relevance, n);
    CAIRN_TAKE(evolution, pool, previous, n);
    CAIRN_TAKE(evolution, pool, next, n);
    CAIRN_TAKE(evolution, pool, rank, n);
    if (evolution != NULL) {
        evolution->params = *params;
        evolution->status = CAIRN_EMPTY;
    }
    return evolution;
}

CAIRN_OBJECT(curve_evolution, curve_evolution, build);

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
    for (int32_t i = 0; i < count; i++)
        update_relevance(evolution, i);
    evolution->resume = 0;
    evolution->status = CAIRN_MORE;
    return CAIRN_OK;
}

/* 1 when vertex i comes before k in the order of removal. */
static int is_removed_before(const cairn_curve_evolution *evolution, int32_t i, int32_t k)
{
    cairn_real own = evolution->relevance[i], other = evolution->relevance[k];

    return own < other || (own <= other && i < k);
}

/* First vertex in the order of removal after the last candidate; -1: none, or no vertex may be
 * removed. */
static int32_t next_candidate(const cairn_curve_evolution *evolution)
{
    int32_t best = -1, i = evolution->ring_start;

    if (evolution->remaining == MIN_POINTS)
        return -1;
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
}

/* Removes the candidate, unless an intersection forbids it. */
static void try_removal(cairn_curve_evolution *evolution)
{
    if (evolution->params.mode != CAIRN_MODE_AS_WRITTEN &&
        would_intersect(evolution, evolution->candidate))
        return;
    remove_vertex(evolution, evolution->candidate);
    evolution->candidate = -1;
}

/* The evolution: see Method in the head of this file. */
static int evolve(cairn_curve_evolution *evolution, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(evolution->resume);
    evolution->candidate = -1;
    for (;;) {
        CAIRN_STEP_CHARGE(evolution, resume, budget, 1 + evolution->remaining / VISITS_PER_UNIT);
        evolution->candidate = next_candidate(evolution);
        if (evolution->candidate < 0)
            break;
        CAIRN_STEP_CHARGE(evolution, resume, budget,
                          UNITS_PER_REMOVAL + evolution->remaining / TESTS_PER_UNIT);
        try_removal(evolution);
    }
    rank_remaining(evolution);
    CAIRN_STEP_END(evolution->resume);
}

cairn_status cairn_curve_evolution_step(cairn_curve_evolution *evolution, cairn_budget *budget)
{
    if (evolution == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (evolution->status != CAIRN_MORE)
        return CAIRN_OK;
    if (!evolve(evolution, budget))
        return CAIRN_MORE;
    evolution->status = CAIRN_OK;
    return CAIRN_OK;
}

cairn_curve_evolution_result cairn_curve_evolution_read(const cairn_curve_evolution *evolution)
{
    cairn_curve_evolution_result result = {0};

    if (evolution != NULL && evolution->status == CAIRN_OK) {
        result.rank = evolution->rank;
        result.count = evolution->count;
        result.min_vertices = evolution->remaining;
    }
    return result;
}
