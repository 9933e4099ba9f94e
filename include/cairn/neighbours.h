/* neighbours: who is near whom: a hash grid over points, sweep-and-prune over boxes. */
#ifndef CAIRN_NEIGHBOURS_H
#define CAIRN_NEIGHBOURS_H

#include "cairn/geometry.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- Hash grid over points ---- */

typedef struct cairn_point_grid cairn_point_grid;

typedef struct cairn_point_grid_params {
    int32_t max_points; /* 1 ... 2^28 */
    cairn_real cell;    /* side of a cell in m, > 0; best near the usual query radius */
} cairn_point_grid_params;

/* 0 for params that create() would refuse. */
size_t cairn_point_grid_memory(const cairn_point_grid_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_point_grid_create(cairn_point_grid **grid, cairn_pool *pool,
                                                   const cairn_point_grid_params *params);

/* Forgets all points. Cost: linear in max_points. */
void cairn_point_grid_clear(cairn_point_grid *grid);

/* Adds a point; its index is the number of points before it. CAIRN_NOT_FINITE, CAIRN_FULL.
 * Constant time. */
CAIRN_CHECKED cairn_status cairn_point_grid_insert(cairn_point_grid *grid, cairn_vec2 point);

/* Takes the point that was added last out again, if there is one. Constant time: a grid can so
 * be emptied in steps. */
void cairn_point_grid_remove_last(cairn_point_grid *grid);

int32_t cairn_point_grid_count(const cairn_point_grid *grid);

/* The point of an index below count(). */
cairn_vec2 cairn_point_grid_point(const cairn_point_grid *grid, int32_t index);

/* Index of the point nearest to p within `radius` (inclusive), the lowest index among equals; -1
 * when there is none. *distance_squared, when not NULL, is set when there is one. Cost: the
 * points in the cells that the radius touches and those cells, at most twice the points in all. */
int32_t cairn_point_grid_nearest(const cairn_point_grid *grid, cairn_vec2 p, cairn_real radius,
                                 cairn_real *distance_squared);

/* Which points count for a search: those whose direction is near the one asked for. */
typedef struct cairn_point_grid_facing {
    const cairn_vec2 *directions; /* [count] of the points, of length 1 */
    cairn_vec2 direction;         /* of length 1 */
    cairn_real least_cosine;      /* of the angle between the two */
} cairn_point_grid_facing;

/* As nearest() among the points that face as asked. *looked_at says how many points and cells
 * were looked at, for a caller who charges for them. */
int32_t cairn_point_grid_nearest_facing(const cairn_point_grid *grid, cairn_vec2 p,
                                        cairn_real radius, const cairn_point_grid_facing *facing,
                                        int32_t *looked_at);

/* 1 when a point lies within `radius` (inclusive) of p. Cost: as nearest() at most. */
int32_t cairn_point_grid_has(const cairn_point_grid *grid, cairn_vec2 p, cairn_real radius);

/* All points within `radius` (inclusive) of p one by one, so that a caller can stop and go on:
 * begin, then next until -1. The order depends only on the points and the order of their
 * insertion. Valid until the grid changes. The cursor is open only to be copied. */
typedef struct cairn_point_grid_cursor {
    cairn_vec2 centre;
    cairn_real radius_squared;
    /* cells */
    int32_t min_x, max_x, max_y;
    int32_t x, y;
    /* candidate in the current cell, -1: none */
    int32_t next;
    /* 1: the radius touches more cells than there are points, so all are looked at in turn */
    int32_t all;
} cairn_point_grid_cursor;

cairn_point_grid_cursor cairn_point_grid_begin(const cairn_point_grid *grid, cairn_vec2 p,
                                               cairn_real radius);
int32_t cairn_point_grid_next(const cairn_point_grid *grid, cairn_point_grid_cursor *cursor);

/* ---- Sweep and prune over boxes ---- */

typedef struct cairn_box_sweep cairn_box_sweep;

typedef struct cairn_box_sweep_params {
    int32_t max_boxes; /* 1 ... 2^28 */
} cairn_box_sweep_params;

size_t cairn_box_sweep_memory(const cairn_box_sweep_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_box_sweep_create(cairn_box_sweep **sweep, cairn_pool *pool,
                                                  const cairn_box_sweep_params *params);

/* Starts to report the overlapping pairs of boxes[0 ... count-1], which must stay as they are
 * until the last pair has been reported. The sorted order of the last sweep is the start of this
 * one (insertion sort: linear when the boxes moved little; new boxes may be appended).
 * CAIRN_BAD_ARGUMENT: count < 0, or NULL with count > 0. CAIRN_FULL: count > max_boxes. A box
 * that is empty or holds a NaN overlaps none. Cost: constant time. */
CAIRN_CHECKED cairn_status cairn_box_sweep_begin(cairn_box_sweep *sweep, const cairn_box *boxes,
                                                 int32_t count);

/* As begin(), but only for the pairs of which both boxes overlap a window: they come in the same
 * order as there. */
CAIRN_CHECKED cairn_status cairn_box_sweep_begin_in(cairn_box_sweep *sweep, const cairn_box *boxes,
                                                    int32_t count, cairn_box window);

/* The next pair, *first < *second. CAIRN_OK: here it is. CAIRN_MORE: the budget is used up
 * before one was found. CAIRN_EMPTY: there are no more. Costs three units for four moves of the
 * sort, and one for four tests. The pairs and their order do not depend on the budget. */
CAIRN_CHECKED cairn_status cairn_box_sweep_next(cairn_box_sweep *sweep, cairn_budget *budget,
                                                int32_t *first, int32_t *second);

#ifdef __cplusplus
}
#endif

#endif
