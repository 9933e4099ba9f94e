/* scan_map: the occupancy grid of scans at known poses, in which beams without return end at walls.
 *
 * A beam without return passes a wall where the wall returns no light (glass, a flat angle), and
 * frees what is behind it. So all beams are added twice: first they pass everything; what stays
 * occupied then is a wall, at which beams without return end.
 *
 *     begin(grid, scans) -> step(budget) until CAIRN_OK -> the readers of the grid
 *
 * Memory: one bit a cell, and none when beams pass walls. Grid and scans are the caller's. */
#ifndef CAIRN_SCAN_MAP_H
#define CAIRN_SCAN_MAP_H

#include "cairn/occupancy_grid.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Map maker: adds scans to a grid. */
typedef struct cairn_scan_map cairn_scan_map;

/* How beams enter the grid; defaults in brackets. */
typedef struct cairn_scan_map_params {
    /* cells, 1 ... 2^30 (160000): largest grid; not in use when stop_at_walls is 0 */
    int32_t max_cells;
    /* 0 or 1 (1): 1: beams without return end at the first wall; 0: they pass walls */
    int32_t stop_at_walls;
    /* m, > 0 (30): a longer beam is cut there, and is no hit */
    cairn_real max_range;
    /* m, >= 0 (5): a longer beam without return is left out. A scanner that sees farther would have
     * seen the room's wall: there is glass, or the beam is lost */
    cairn_real max_free_range;
} cairn_scan_map_params;

/* Returns the default parameters, for grids of cairn_occupancy_grid_default(). */
cairn_scan_map_params cairn_scan_map_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_scan_map_check(const cairn_scan_map_params *params,
                                                cairn_object_fault *fault);

/* Returns the bytes that create() takes from the pool; 0 for invalid params. */
size_t cairn_scan_map_memory(const cairn_scan_map_params *params);

/* Creates a map maker in the pool. CAIRN_BAD_ARGUMENT: NULL or invalid params. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_scan_map_create(cairn_scan_map **map, cairn_pool *pool,
                                                 const cairn_scan_map_params *params);

/* ---- Beams ---- */

/* A scan at its pose. */
typedef struct cairn_scan_map_scan {
    /* Pose of the scan in the map. */
    cairn_pose map_scan;
    /* m, in the frame of the scan: start of all beams. */
    cairn_vec2 sensor;
    /* [2 beam_count] m, in the frame of the scan: x and y of the end of each beam. */
    const float *ends;
    /* [beam_count] 1: the beam ends at a surface, 0: without return. */
    const uint8_t *hits;
    /* Number of beams. */
    int32_t beam_count;
} cairn_scan_map_scan;

/* Transforms a beam to the map and cuts it at max_range. Returns 1; 0 for a beam that says nothing:
 * of zero length, or without return and longer than max_free_range. Constant time.
 *
 * params: how beams enter the grid
 * scan: a scan
 * i: 0 ... beam_count - 1
 * map_scan: transform of scan->map_scan
 * from, to: m, in the map: set to the ends of the beam
 * hit: set to 1 when the beam ends at a surface within max_range, else to 0 */
int32_t cairn_scan_map_beam(const cairn_scan_map_params *params, const cairn_scan_map_scan *scan,
                            int32_t i, cairn_transform map_scan, cairn_vec2 *from, cairn_vec2 *to,
                            int32_t *hit);

/* Returns the box, extended by the sensor and the beams of a scan as they enter the grid. Cost:
 * linear in the beams.
 *
 * params: how beams enter the grid
 * scan: a scan
 * box: m, in the map; cairn_box_empty() for the first scan */
cairn_box cairn_scan_map_bounds(const cairn_scan_map_params *params,
                                const cairn_scan_map_scan *scan, cairn_box box);

/* ---- Making the map ---- */

/* Starts a map: clears the grid and drops a map in progress. Grid and scans must stay valid until
 * step() returns CAIRN_OK, the grid unchanged. CAIRN_BAD_ARGUMENT: NULL, count < 0, or a scan with a
 * count below 0 or without arrays. CAIRN_FULL: the grid has more than max_cells. CAIRN_NOT_FINITE: a
 * pose or a sensor's position. *fault, when not NULL, names the scan. Cost: linear in the scans.
 *
 * grid: the occupancy grid that is filled
 * scans: [count] scans with their poses */
CAIRN_CHECKED cairn_status cairn_scan_map_begin(cairn_scan_map *map, cairn_occupancy_grid *grid,
                                                const cairn_scan_map_scan *scans, int32_t count,
                                                cairn_fault *fault);

/* Continues the map. CAIRN_OK: nothing left to do. CAIRN_MORE: the budget is used up.
 * CAIRN_NOT_FINITE: a beam ends at infinity; the grid is incomplete. CAIRN_BAD_ARGUMENT: NULL.
 * Costs two units a beam and one for two cells on it, twice with stop_at_walls; then also a unit
 * for each cell on a beam without return, and one for two cells of the grid. */
CAIRN_CHECKED cairn_status cairn_scan_map_step(cairn_scan_map *map, cairn_budget *budget);

#ifdef __cplusplus
}
#endif

#endif
