/* inner_distance: geodesic (inner) distances between the outline vertices of a shape.
 *
 * The inner distance of two vertices is the length of the shortest path within the shape. The shape
 * is a polygon with holes, or with filled holes. Distances are exact shortest paths in the
 * visibility graph of the vertices. They hardly change when the shape bends at a joint.
 *
 * Source: Ling and Jacobs 2007; Adluru 2008, section 4.5. */
#ifndef CAIRN_INNER_DISTANCE_H
#define CAIRN_INNER_DISTANCE_H

#include "cairn/curve.h"
#include "cairn/object.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Parameters; defaults in brackets. */
typedef struct cairn_inner_distance_params {
    /* 3 ... 2048 (128): capacity of vertices of all outlines */
    int32_t max_points;
    /* 0 or 1 (0): 0: holes are outside of the shape; 1: holes are filled */
    int32_t fill_holes;
} cairn_inner_distance_params;

/* Computation of inner distances. */
typedef struct cairn_inner_distance cairn_inner_distance;

/* Returns the default parameters. */
cairn_inner_distance_params cairn_inner_distance_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_inner_distance_check(const cairn_inner_distance_params *params,
                                                      cairn_object_fault *fault);

/* Returns the memory of an object in bytes; 0 for params that create() rejects. Grows with the
 * square of the points. */
size_t cairn_inner_distance_memory(const cairn_inner_distance_params *params);

/* Creates an object. CAIRN_BAD_ARGUMENT: invalid params. CAIRN_NO_MEMORY: the pool is too small. */
CAIRN_CHECKED cairn_status cairn_inner_distance_create(cairn_inner_distance **inner,
                                                       cairn_pool *pool,
                                                       const cairn_inner_distance_params *params);

/* Starts on a shape: outlines[0] is its outline, the others are holes, each in either
 * orientation; they are copied. For a hole outside the outline and for crossing outlines,
 * distances are at most those along the outline and otherwise undefined. CAIRN_BAD_ARGUMENT:
 * NULL, count below 1, an outline of fewer than 3 vertices or an open outline. CAIRN_FULL: more
 * than max_points vertices. CAIRN_NOT_FINITE: a vertex, or coordinates so large that lengths
 * overflow. CAIRN_EMPTY: an outline without area. Cost: linear.
 *
 * outlines: [count] closed outlines */
CAIRN_CHECKED cairn_status cairn_inner_distance_begin(cairn_inner_distance *inner,
                                                      const cairn_curve *outlines, int32_t count);

/* Resumes the computation. CAIRN_MORE: the budget is used up. CAIRN_OK: the distances are
 * complete, or nothing was begun. Cost: about n^3 / 20 units for n vertices. */
CAIRN_CHECKED cairn_status cairn_inner_distance_step(cairn_inner_distance *inner,
                                                     cairn_budget *budget);

/* Inner distances and angles of all pairs of vertices. */
typedef struct cairn_inner_distance_result {
    /* [i * stride + k] Distance from vertex i to k of outlines[0], 0 <= i, k < count, in the
     * units of the outline. */
    const cairn_real *distance;
    /* Vertices of outlines[0]; row length of the matrix. */
    int32_t count, stride;
    /* Greatest distance. */
    cairn_real max_distance;
} cairn_inner_distance_result;

/* Returns the distances. All zero until step() returns CAIRN_OK; valid until the next begin(). */
cairn_inner_distance_result cairn_inner_distance_read(const cairn_inner_distance *inner);

#ifdef __cplusplus
}
#endif

#endif
