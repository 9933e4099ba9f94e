/* shape_context: shape distance of two point sets by shape contexts (log-polar histograms).
 *
 * Method:
 * 1. The shape context of a point is a histogram of the other points of its shape: 5 rings by 12
 *    sectors, ring radii in geometric progression.
 * 2. The cost of a pair of points is half the chi-squared distance of their histograms, 0 ... 1.
 * 3. Whole shapes: minimum-cost bipartite assignment. Part of a shape: nearest neighbours.
 *
 * Limits: shapes are compared upright, without rotation and without a thin-plate-spline warp.
 *
 * Source: Belongie, Malik and Puzicha 2002; Adluru 2008, section 5.3.1. */
#ifndef CAIRN_SHAPE_CONTEXT_H
#define CAIRN_SHAPE_CONTEXT_H

#include "cairn/geometry.h"
#include "cairn/object.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Bins of a shape context: rings, sectors, and their product. */
#define CAIRN_SHAPE_CONTEXT_RINGS   5
#define CAIRN_SHAPE_CONTEXT_SECTORS 12
#define CAIRN_SHAPE_CONTEXT_BINS    (CAIRN_SHAPE_CONTEXT_RINGS * CAIRN_SHAPE_CONTEXT_SECTORS)

/* Comparison of two shapes by shape contexts. */
typedef struct cairn_shape_context cairn_shape_context;

/* How the points of two shapes are assigned. */
typedef int32_t cairn_shape_context_kind;
enum {
    /* Both shapes are whole, of any size: one-to-one assignment of least total cost. */
    CAIRN_SHAPE_CONTEXT_WHOLE = 0,
    /* The first shape is a part of the second, in its frame: nearest neighbour of each of its
     * points. */
    CAIRN_SHAPE_CONTEXT_PART = 1
};

/* Parameters; defaults in brackets. */
typedef struct cairn_shape_context_params {
    /* 2 ... 1024 (128): capacity of points of either shape; the memory grows with its square */
    int32_t max_points;
    /* mean distances of two points, > 0 (1/8 and 2): radii of the innermost and outermost ring,
     * inner_radius < outer_radius */
    cairn_real inner_radius, outer_radius;
    /* >= 0 (1): cost of an unmatched point, and of the missing share of a shape */
    cairn_real missing_cost;
} cairn_shape_context_params;

/* Returns the default parameters. */
cairn_shape_context_params cairn_shape_context_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_shape_context_check(const cairn_shape_context_params *params,
                                                     cairn_object_fault *fault);

/* Returns the memory of an object in bytes; 0 for params that create() rejects. */
size_t cairn_shape_context_memory(const cairn_shape_context_params *params);

/* Creates a matcher. CAIRN_BAD_ARGUMENT: invalid params. CAIRN_NO_MEMORY: the pool is too small. */
CAIRN_CHECKED cairn_status cairn_shape_context_create(cairn_shape_context **context,
                                                      cairn_pool *pool,
                                                      const cairn_shape_context_params *params);

/* Two shapes to compare. */
typedef struct cairn_shape_context_input {
    /* Kind of the comparison. */
    cairn_shape_context_kind kind;
    /* [first_count], [second_count] Equidistant points along the contours. */
    const cairn_vec2 *first, *second;
    /* Numbers of points, 2 ... max_points. */
    int32_t first_count, second_count;
    /* PART: share of the second shape's length that the first lacks, 0 ... 1. */
    cairn_real missing_share;
} cairn_shape_context_input;

/* Starts a comparison and discards the previous result; the points are copied.
 * CAIRN_BAD_ARGUMENT: NULL, an unknown kind, fewer than 2 points, a share outside 0 ... 1.
 * CAIRN_FULL: more than max_points. CAIRN_NOT_FINITE: a coordinate that is not finite or beyond
 * 1e9. Cost: linear.
 *
 * input: points of both shapes, and how they are compared */
CAIRN_CHECKED cairn_status cairn_shape_context_begin(cairn_shape_context *context,
                                                     const cairn_shape_context_input *input);

/* Resumes the computation. CAIRN_MORE: the budget is used up. CAIRN_OK: the result is complete,
 * or nothing was begun. CAIRN_EMPTY: all points of a shape coincide (PART: of the second);
 * aborted. Cost: about n (n - 1) + m (m - 1) units for the contexts and 3 n m for the costs. */
CAIRN_CHECKED cairn_status cairn_shape_context_step(cairn_shape_context *context,
                                                    cairn_budget *budget);

/* The distance of two shapes.
 *
 * distance, WHOLE: sum of the costs of all pairs and of the unmatched points, divided by the
 * greater number of points (Belongie et al. 2002, without their warp). distance, PART: mean cost of
 * the first shape's points plus the cost of the missing share (Adluru 2008, section 5.3.1).
 *
 * symmetric_distance: mean nearest-neighbour cost from first to second plus that from second to
 * first. It is the shape context distance of Belongie et al. with the identity as transform. */
typedef struct cairn_shape_context_result {
    /* [count] Index of the second shape's point matched to each of the first's; -1: unmatched.
     * Valid until the next begin(). */
    const int32_t *match;
    /* Number of points of the first shape. */
    int32_t count;
    /* Shape distance, see above. */
    cairn_real distance;
    /* WHOLE: see above; 0 for PART. */
    cairn_real symmetric_distance;
} cairn_shape_context_result;

/* Returns the result. All zero until step() returns CAIRN_OK. */
cairn_shape_context_result cairn_shape_context_read(const cairn_shape_context *context);

#ifdef __cplusplus
}
#endif

#endif
