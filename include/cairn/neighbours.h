/* neighbours: nearest-neighbour and radius search over points by a hash grid (point_grid), and
 * overlapping pairs of boxes by sweep and prune (box_sweep). */
#ifndef CAIRN_NEIGHBOURS_H
#define CAIRN_NEIGHBOURS_H

#include "cairn/geometry.h"
#include "cairn/object.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- Hash grid over points ---- */

/* Points in the plane, hashed by square cells. */
typedef struct cairn_point_grid cairn_point_grid;

/* Parameters of a point grid. */
typedef struct cairn_point_grid_params {
    /* 1 ... 2^28 (none): points */
    int32_t max_points;
    /* m, > 1/CAIRN_REAL_MAX (none): side of a cell; fastest when about the usual query radius */
    cairn_real cell_size;
} cairn_point_grid_params;

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_point_grid_check(const cairn_point_grid_params *params,
                                                  cairn_object_fault *fault);

/* Bytes that create() allocates. 0 for params that create() would refuse. */
size_t cairn_point_grid_memory(const cairn_point_grid_params *params);

/* Creates an object in a pool. CAIRN_BAD_ARGUMENT: NULL, or params out of range. CAIRN_NO_MEMORY:
 * the pool has too few bytes left. A failure changes nothing. */
CAIRN_CHECKED cairn_status cairn_point_grid_create(cairn_point_grid **grid, cairn_pool *pool,
                                                   const cairn_point_grid_params *params);

/* Removes all points. Cost: linear in max_points. */
void cairn_point_grid_clear(cairn_point_grid *grid);

/* Adds a point. Its index is the number of points added before. CAIRN_NOT_FINITE. CAIRN_FULL:
 * max_points. Constant time. */
CAIRN_CHECKED cairn_status cairn_point_grid_insert(cairn_point_grid *grid, cairn_vec2 point);

/* Removes the point that was added last, if the grid is not empty. Constant time, so a grid can be
 * emptied in bounded steps. */
void cairn_point_grid_remove_last(cairn_point_grid *grid);

/* Number of points. */
int32_t cairn_point_grid_count(const cairn_point_grid *grid);

/* The point with an index from 0 to count() - 1.
 *
 * index: index of the point */
cairn_vec2 cairn_point_grid_point(const cairn_point_grid *grid, int32_t index);

/* Nearest neighbour: the index of the point closest to p within `radius` m (inclusive), the lowest
 * index among equal distances. -1 when no point is in range. *distance_squared, in m^2, is set when
 * not NULL and a point was found. Cost: linear in the cells within the radius and the points in
 * these cells, at most twice the number of points.
 *
 * p: m: centre of the search
 * radius: m: greatest distance, inclusive */
int32_t cairn_point_grid_nearest(const cairn_point_grid *grid, cairn_vec2 p, cairn_real radius,
                                 cairn_real *distance_squared);

/* Gate on the direction of points (normal or tangent compatibility) in a nearest-neighbour
 * search. */
typedef struct cairn_point_grid_facing {
    /* [count] Unit directions of the points. */
    const cairn_vec2 *directions;
    /* Unit direction of the query. */
    cairn_vec2 direction;
    /* Least cosine of the angle between both directions, inclusive. */
    cairn_real min_cosine;
} cairn_point_grid_facing;

/* Nearest neighbour among the points whose direction passes the gate; else as nearest().
 * *visited is set to the number of points and cells visited, for charging a budget.
 *
 * p: m: centre of the search
 * radius: m: greatest distance, inclusive
 * facing: directions of the points, and the gate */
int32_t cairn_point_grid_nearest_facing(const cairn_point_grid *grid, cairn_vec2 p,
                                        cairn_real radius, const cairn_point_grid_facing *facing,
                                        int32_t *visited);

/* 1 when any point lies within `radius` m (inclusive) of p. Cost: at most that of nearest(). */
int32_t cairn_point_grid_has_near(const cairn_point_grid *grid, cairn_vec2 p, cairn_real radius);

/* Cursor of a radius search: enumerates the points within a radius one by one, so a caller can stop
 * and resume. Call begin(), then next() until -1. The order depends only on the points and their
 * order of insertion. Valid until the grid changes. The fields are public only so that a cursor can
 * be copied. */
typedef struct cairn_point_grid_cursor {
    /* Centre of the search, in m. */
    cairn_vec2 centre;
    /* Squared radius, in m^2. */
    cairn_real radius_squared;
    /* Range of cells within the radius. */
    int32_t min_x, max_x, max_y;
    /* Current cell. */
    int32_t x, y;
    /* Next candidate in the current cell, -1: none. */
    int32_t next;
    /* 1: the radius covers more cells than there are points, so all points are tested in turn. */
    int32_t all;
} cairn_point_grid_cursor;

/* Starts a radius search around p. Returns the cursor before the first point.
 *
 * p: centre, m
 * radius: m, inclusive */
cairn_point_grid_cursor cairn_point_grid_begin(const cairn_point_grid *grid, cairn_vec2 p,
                                               cairn_real radius);

/* Index of the next point within the radius (inclusive), -1 after the last.
 *
 * cursor: cursor of cairn_point_grid_begin() */
int32_t cairn_point_grid_next(const cairn_point_grid *grid, cairn_point_grid_cursor *cursor);

/* ---- Sweep and prune over boxes ---- */

/* Broad-phase collision detection: all pairs of boxes that overlap. */
typedef struct cairn_box_sweep cairn_box_sweep;

/* Capacity of a sweep. */
typedef struct cairn_box_sweep_params {
    /* 1 ... 2^28 (none): boxes */
    int32_t max_boxes;
} cairn_box_sweep_params;

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_box_sweep_check(const cairn_box_sweep_params *params,
                                                 cairn_object_fault *fault);

/* Bytes that create() allocates. 0 for params that create() would refuse. */
size_t cairn_box_sweep_memory(const cairn_box_sweep_params *params);

/* Creates an object in a pool. CAIRN_BAD_ARGUMENT: NULL, or params out of range. CAIRN_NO_MEMORY:
 * the pool has too few bytes left. A failure changes nothing. */
CAIRN_CHECKED cairn_status cairn_box_sweep_create(cairn_box_sweep **sweep, cairn_pool *pool,
                                                  const cairn_box_sweep_params *params);

/* Starts a sweep over boxes[0 ... count-1], which must not change until the last pair is reported.
 * The sorting starts from the order of the last sweep (temporal coherence: linear when the boxes
 * moved little; new boxes may be appended). Boxes that are empty or contain a NaN overlap no box.
 * CAIRN_BAD_ARGUMENT: count < 0, or NULL with count > 0. CAIRN_FULL: count > max_boxes. Constant
 * time.
 *
 * boxes: [count] boxes */
CAIRN_CHECKED cairn_status cairn_box_sweep_begin(cairn_box_sweep *sweep, const cairn_box *boxes,
                                                 int32_t count);

/* As begin(), with its statuses, for the pairs of which both boxes overlap a window. These pairs
 * are reported in the same order as after begin().
 *
 * boxes: [count] as for begin()
 * window: box that both boxes of a pair overlap */
CAIRN_CHECKED cairn_status cairn_box_sweep_begin_in(cairn_box_sweep *sweep, const cairn_box *boxes,
                                                    int32_t count, cairn_box window);

/* Reports the next overlapping pair, *first < *second. CAIRN_OK: a pair is set. CAIRN_MORE: the
 * budget was used up before the next pair. CAIRN_EMPTY: no more pairs. The pairs and their order do
 * not depend on the budget. Cost: three units per four moves of the sort, and one unit per four
 * overlap tests.
 *
 * first, second: set to the indices of the boxes */
CAIRN_CHECKED cairn_status cairn_box_sweep_next(cairn_box_sweep *sweep, cairn_budget *budget,
                                                int32_t *first, int32_t *second);

#ifdef __cplusplus
}
#endif

#endif
