/* inner_distance: how far the places of a shape's outline are from each other when the way must
 * stay within the shape.
 *
 * The shape is a polygon, with holes or with these filled; distances are exact, those of the
 * shortest ways along its vertices. They hardly change when the shape bends at a joint (Ling &
 * Jacobs 2007; Adluru 2008, section 4.5). */
#ifndef CAIRN_INNER_DISTANCE_H
#define CAIRN_INNER_DISTANCE_H

#include "cairn/curve.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_inner_distance_params {
    int32_t max_points; /* vertices of all outlines, 3 ... 2048 (128) */
    int32_t fill_holes; /* 0: holes are outside; 1: they are filled (0) */
} cairn_inner_distance_params;

typedef struct cairn_inner_distance cairn_inner_distance;

/* The values in brackets above. */
cairn_inner_distance_params cairn_inner_distance_default(void);

/* 0 for params that create() would refuse. Grows with the square of the points. */
size_t cairn_inner_distance_memory(const cairn_inner_distance_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_inner_distance_create(cairn_inner_distance **inner,
                                                       cairn_pool *pool,
                                                       const cairn_inner_distance_params *params);

/* Starts on a shape: outlines[0] its outline, the others holes in it, each in either sense of
 * rotation; they are copied. A hole that is not inside, and outlines that cross, give distances
 * that are no less than those along the outline, and of no meaning otherwise.
 * CAIRN_BAD_ARGUMENT: NULL, count below 1, an outline of fewer than 3 vertices or that is not
 * closed. CAIRN_FULL: more vertices than the params say. CAIRN_NOT_FINITE: a vertex, or its
 * coordinates are so large that lengths are not. CAIRN_EMPTY: an outline without area. Cost:
 * linear. */
CAIRN_CHECKED cairn_status cairn_inner_distance_begin(cairn_inner_distance *inner,
                                                      const cairn_curve *outlines, int32_t count);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: the distances stand, or nothing was
 * begun. About n^3 / 20 units for n vertices. */
CAIRN_CHECKED cairn_status cairn_inner_distance_step(cairn_inner_distance *inner,
                                                     cairn_budget *budget);

typedef struct cairn_inner_distance_result {
    /* [i * stride + k] from vertex i to k of outlines[0], 0 <= i, k < count */
    const cairn_real *distance;
    int32_t count, stride;
    /* of all of them */
    cairn_real greatest;
} cairn_inner_distance_result;

/* All zero until step() returns CAIRN_OK; valid until the next begin(). */
cairn_inner_distance_result cairn_inner_distance_read(const cairn_inner_distance *inner);

#ifdef __cplusplus
}
#endif

#endif
