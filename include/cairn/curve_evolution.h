/* curve_evolution: simplification of a closed polyline by discrete curve evolution (DCE).
 *
 * The vertex of least relevance is removed, one after another, down to a triangle. So every number
 * of vertices is a level of detail of the curve, and each level contains the vertices of the
 * coarser levels. By default no removal makes the polyline intersect itself; as written (Adluru
 * 2008, section 4.3) the least relevant vertex always goes. */
#ifndef CAIRN_CURVE_EVOLUTION_H
#define CAIRN_CURVE_EVOLUTION_H

#include "cairn/geometry.h"
#include "cairn/object.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Parameters; defaults in brackets. */
typedef struct cairn_curve_evolution_params {
    /* 3 ... 4096 (256): vertices */
    int32_t max_points;
    /* CAIRN_MODE_DEFAULT or CAIRN_MODE_AS_WRITTEN (CAIRN_MODE_DEFAULT): as written,
     * self-intersection is not checked */
    int32_t mode;
} cairn_curve_evolution_params;

/* Discrete curve evolution of a polyline. */
typedef struct cairn_curve_evolution cairn_curve_evolution;

/* Returns the default parameters. */
cairn_curve_evolution_params cairn_curve_evolution_default(void);

/* The same in the mode as written. */
cairn_curve_evolution_params cairn_curve_evolution_as_written(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_curve_evolution_check(const cairn_curve_evolution_params *params,
                                                       cairn_object_fault *fault);

/* Bytes that create() allocates. 0 for params that create() would refuse. */
size_t cairn_curve_evolution_memory(const cairn_curve_evolution_params *params);

/* Creates an object in a pool. CAIRN_BAD_ARGUMENT: NULL, or params out of range. CAIRN_NO_MEMORY:
 * the pool has too few bytes left. A failure changes nothing. */
CAIRN_CHECKED cairn_status cairn_curve_evolution_create(cairn_curve_evolution **evolution,
                                                        cairn_pool *pool,
                                                        const cairn_curve_evolution_params *params);

/* Starts the evolution of a closed polyline of either orientation. points: [count], copied. An
 * evolution that runs is discarded. CAIRN_BAD_ARGUMENT: NULL, fewer than 3 points. CAIRN_FULL: more
 * than max_points. CAIRN_NOT_FINITE: a coordinate. Cost: linear. */
CAIRN_CHECKED cairn_status cairn_curve_evolution_begin(cairn_curve_evolution *evolution,
                                                       const cairn_vec2 *points, int32_t count);

/* Works until the budget is used up. CAIRN_MORE: call again. CAIRN_OK: the ranks are complete, or
 * no evolution was begun. Cost: about count^2 / 8 units in all, more where removals are refused. */
CAIRN_CHECKED cairn_status cairn_curve_evolution_step(cairn_curve_evolution *evolution,
                                                      cairn_budget *budget);

/* Order of the removals. */
typedef struct cairn_curve_evolution_result {
    /* [count] Rank of each vertex, a permutation of 0 ... count-1: the level of m vertices consists
     * of the vertices with rank[i] < m. */
    const int32_t *rank;
    /* Number of vertices. */
    int32_t count;
    /* Vertices of the coarsest level: 3, or more when every further removal would make the polyline
     * intersect itself. */
    int32_t min_vertices;
} cairn_curve_evolution_result;

/* The result. All zero until step() returns CAIRN_OK; valid until the next begin(). */
cairn_curve_evolution_result cairn_curve_evolution_read(const cairn_curve_evolution *evolution);

/* Relevance of a vertex between two others: K = beta l1 l2 / (l1 + l2), beta the turning angle in
 * rad, 0 ... pi, and l1, l2 the lengths of the two sides (Adluru 2008, eq. 4.1), in rad times the
 * unit of the points. 0 when the vertex coincides with both neighbours.
 *
 * before, vertex, after: consecutive vertices */
cairn_real cairn_curve_evolution_relevance(cairn_vec2 before, cairn_vec2 vertex, cairn_vec2 after);

#ifdef __cplusplus
}
#endif

#endif
