/* curve_evolution: what matters of a closed polyline: discrete curve evolution.
 *
 * The vertex of least relevance goes, one after another, down to a triangle, so that every
 * number of vertices is a level of detail of the curve and each level holds those below it. The
 * polyline never comes to touch itself by a removal. */
#ifndef CAIRN_CURVE_EVOLUTION_H
#define CAIRN_CURVE_EVOLUTION_H

#include "cairn/geometry.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_curve_evolution_params {
    int32_t max_points; /* vertices, 3 ... 4096 (256) */
} cairn_curve_evolution_params;

typedef struct cairn_curve_evolution cairn_curve_evolution;

/* The value in brackets above. */
cairn_curve_evolution_params cairn_curve_evolution_default(void);

/* 0 for params that create() would refuse. */
size_t cairn_curve_evolution_memory(const cairn_curve_evolution_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_curve_evolution_create(cairn_curve_evolution **evolution,
                                                        cairn_pool *pool,
                                                        const cairn_curve_evolution_params *params);

/* Starts on a closed polyline, in either sense; points: [count], copied. What ran before is
 * dropped. CAIRN_BAD_ARGUMENT: NULL, fewer than 3 points. CAIRN_FULL: more than the params say.
 * CAIRN_NOT_FINITE. Cost: linear. */
CAIRN_CHECKED cairn_status cairn_curve_evolution_begin(cairn_curve_evolution *evolution,
                                                       const cairn_vec2 *points, int32_t count);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: the ranks stand, or nothing was begun.
 * About count^2 / 8 units, more where removals are refused. */
CAIRN_CHECKED cairn_status cairn_curve_evolution_step(cairn_curve_evolution *evolution,
                                                      cairn_budget *budget);

typedef struct cairn_curve_evolution_result {
    /* [count] vertex i belongs to the level of m vertices when rank[i] < m; each rank is there
     * once */
    const int32_t *rank;
    int32_t count;
    /* vertices left at the end: 3, or more where every removal would make the polyline touch
     * itself */
    int32_t least;
} cairn_curve_evolution_result;

/* All zero until step() returns CAIRN_OK; valid until the next begin(). */
cairn_curve_evolution_result cairn_curve_evolution_read(const cairn_curve_evolution *evolution);

/* K = beta l1 l2 / (l1 + l2) of the vertex between two others: beta its turn in rad, 0 ... pi, l
 * the lengths of its sides (Adluru 2008, eq. 4.1, in the unit of the points). 0 where it
 * coincides with both neighbours. */
cairn_real cairn_curve_relevance(cairn_vec2 before, cairn_vec2 vertex, cairn_vec2 after);

#ifdef __cplusplus
}
#endif

#endif
