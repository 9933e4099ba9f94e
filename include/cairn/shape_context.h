/* shape_context: how alike two shapes are, by where each of their points sees all the others.
 *
 * The context of a point counts the other points of its shape in 5 rings by 12 sectors about it,
 * the rings wider the farther out. Two points cost half the chi-squared distance of their
 * contexts, 0 ... 1. Shapes are compared upright. */
#ifndef CAIRN_SHAPE_CONTEXT_H
#define CAIRN_SHAPE_CONTEXT_H

#include "cairn/geometry.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CAIRN_SHAPE_CONTEXT_RINGS   5
#define CAIRN_SHAPE_CONTEXT_SECTORS 12
#define CAIRN_SHAPE_CONTEXT_BINS    (CAIRN_SHAPE_CONTEXT_RINGS * CAIRN_SHAPE_CONTEXT_SECTORS)

typedef struct cairn_shape_context cairn_shape_context;

typedef int32_t cairn_shape_context_kind;
enum {
    CAIRN_SHAPE_CONTEXT_WHOLE =
        0, /* both are whole, of any size: points are paired one to one at the least cost in all */
    CAIRN_SHAPE_CONTEXT_PART =
        1 /* the first is a part of the second, in its frame: each of its points by the nearest */
};

typedef struct cairn_shape_context_params {
    /* of either shape, 2 ... 1024 (128); the memory grows with its square */
    int32_t max_points;
    /* radii of the first and the last ring, of the mean distance of two points, 0 < inner <
     * outer (1/8, 2) */
    cairn_real inner, outer;
    /* the cost of a point that has no other, and of all that is missing, >= 0 (1) */
    cairn_real missing;
} cairn_shape_context_params;

/* The values in brackets above. */
cairn_shape_context_params cairn_shape_context_default(void);

/* 0 for params that create() would refuse. */
size_t cairn_shape_context_memory(const cairn_shape_context_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_shape_context_create(cairn_shape_context **context,
                                                      cairn_pool *pool,
                                                      const cairn_shape_context_params *params);

typedef struct cairn_shape_context_input {
    cairn_shape_context_kind kind;
    /* [first_count], [second_count], at even steps along their contours */
    const cairn_vec2 *first, *second;
    int32_t first_count, second_count;
    /* PART: of the second, by length, that the first does not have, 0 ... 1 */
    cairn_real missing_share;
} cairn_shape_context_input;

/* Starts; the points are copied. What ran before is dropped. CAIRN_BAD_ARGUMENT: NULL, an
 * unknown kind, fewer than 2 points, a share outside 0 ... 1. CAIRN_FULL: more points than the
 * params say. CAIRN_NOT_FINITE: a coordinate that is not finite or beyond 1e9. Cost: linear. */
CAIRN_CHECKED cairn_status cairn_shape_context_begin(cairn_shape_context *context,
                                                     const cairn_shape_context_input *input);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: the result stands, or nothing was begun.
 * CAIRN_EMPTY: all points of a shape coincide (PART: of the second); given up. About n (n - 1) +
 * m (m - 1) units for the contexts and 3 n m for the costs. */
CAIRN_CHECKED cairn_status cairn_shape_context_step(cairn_shape_context *context,
                                                    cairn_budget *budget);

/* distance: WHOLE: the costs of all pairs and of the points without one, over the greater number
 * of points (Belongie et al. 2002, without their warping); symmetric: the mean over the first's
 * points of the cost of the nearest of the second's, and the same the other way round, both
 * added up: their shape context distance, the transform that they estimate being the identity.
 * PART: the mean cost of the first's points and the cost of what is missing (Adluru 2008,
 * section 5.3.1). */
typedef struct cairn_shape_context_result {
    /* [count] of each of the first's points the second's; -1: none is left. Valid until the next
     * begin() */
    const int32_t *match;
    int32_t count;
    cairn_real distance;
    /* WHOLE: see above; 0 of PART */
    cairn_real symmetric;
} cairn_shape_context_result;

/* All zero until step() returns CAIRN_OK. */
cairn_shape_context_result cairn_shape_context_read(const cairn_shape_context *context);

#ifdef __cplusplus
}
#endif

#endif
