/* occupancy_grid: grid map with the beam-penetration model (DP-SLAM).
 *
 * Each cell holds the number of beams that ended in it (hits h) and the total length of beam
 * through it (d, in m). d / h is the mean distance that a beam travels in the cell's material
 * before it stops. The probability that a beam stops on a chord of length l is 1 - exp(-l h / d)
 * (Eliazar and Parr 2004, DP-SLAM 2.0). Unlike log odds, it needs no constants of a sensor model,
 * and a cell that stops only some beams (an edge, a hedge) keeps a probability in between.
 *
 *     begin_scan(cairn_scan_read().beams, pose) -> step(budget) until CAIRN_OK ->
 *     begin_scan() ... ; probability(), classify()
 *
 * Cell (0, 0) is lower left; cells are closed below and to the left. Beams that lie partly outside
 * are clipped; unknown beams are ignored. Memory: 8 bytes a cell.
 *
 * Limits: counts do not age, so a surface that was moved stays until enough beams have crossed its
 * cells. Hits saturate at INT32_MAX; lengths stop growing when a cell holds 1.6e7 times its
 * chord. */
#ifndef CAIRN_OCCUPANCY_GRID_H
#define CAIRN_OCCUPANCY_GRID_H

#include "cairn/object.h"
#include "cairn/raster.h"
#include "cairn/scan.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Occupancy grid that counts hits and chords of beams. */
typedef struct cairn_occupancy_grid cairn_occupancy_grid;

/* Size and place of the grid; defaults in brackets. */
typedef struct cairn_occupancy_grid_params {
    /* cells, 1 ... CAIRN_RASTER_MAX_SIDE (400 and 400): size of the grid */
    int32_t width, height;
    /* m, > 1/CAIRN_REAL_MAX (0.05): side of a cell */
    cairn_real resolution;
    /* m, finite (-10 and -10): lower left corner of cell (0, 0) */
    cairn_vec2 origin;
} cairn_occupancy_grid_params;

/* Returns the default parameters: 400 x 400 cells of 0.05 m centred at (0, 0). */
cairn_occupancy_grid_params cairn_occupancy_grid_default(void);

/* Upper bound of cairn_occupancy_grid_memory() as a constant expression. */
#define CAIRN_OCCUPANCY_GRID_BYTES(width, height)                                                  \
    (CAIRN_ALLOCATION_BYTES(1, 256) + CAIRN_ALLOCATION_BYTES((size_t)(width) * (size_t)(height), 8))

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_occupancy_grid_check(const cairn_occupancy_grid_params *params,
                                                      cairn_object_fault *fault);

/* Returns the bytes that create() takes from the pool; 0 for invalid params. */
size_t cairn_occupancy_grid_memory(const cairn_occupancy_grid_params *params);

/* Creates a grid of unobserved cells in the pool. CAIRN_BAD_ARGUMENT: NULL, invalid params, or a
 * far corner that is not finite. CAIRN_NO_MEMORY. Cost: linear in the cells. */
CAIRN_CHECKED cairn_status cairn_occupancy_grid_create(cairn_occupancy_grid **grid,
                                                       cairn_pool *pool,
                                                       const cairn_occupancy_grid_params *params);

/* Returns the params of create(). */
cairn_occupancy_grid_params cairn_occupancy_grid_read(const cairn_occupancy_grid *grid);

/* ---- Adding beams ---- */

/* Adds one beam in the frame of the map, at once: its chords to the lengths of the cells, and, when
 * hit is not 0, a hit to the cell of `to`. CAIRN_NOT_FINITE: an end is not finite, or so far away
 * that the length overflows. CAIRN_BAD_ARGUMENT: a scan or a clearing is in progress. Cost: linear
 * in the cells on the beam.
 *
 * from: m: start of the beam, the sensor
 * to: m: end of the beam
 * hit: 0: the beam ends without a surface */
CAIRN_CHECKED cairn_status cairn_occupancy_grid_add_beam(cairn_occupancy_grid *grid,
                                                         cairn_vec2 from, cairn_vec2 to,
                                                         int32_t hit);

/* Starts to add a scan: beams[0 ... count-1] in the scan's frame at pose map_scan; they must stay
 * valid until step() returns CAIRN_OK. CAIRN_BAD_ARGUMENT: count < 0, NULL with count > 0, an
 * unknown kind of beam, or a scan in progress. CAIRN_NOT_FINITE: the pose, or an end of a beam that
 * is not unknown. *fault, when not NULL, names the beam. Cost: linear in the beams.
 *
 * beams: [count] beams, m, in the frame of the scan */
CAIRN_CHECKED cairn_status cairn_occupancy_grid_begin_scan(cairn_occupancy_grid *grid,
                                                           const cairn_scan_beam *beams,
                                                           int32_t count, cairn_pose map_scan,
                                                           cairn_fault *fault);

/* Starts to clear all cells; a scan in progress is dropped. A scan may be begun right after it.
 * Constant time. */
void cairn_occupancy_grid_clear(cairn_occupancy_grid *grid);

/* Continues clearing, then adding the scan. CAIRN_OK: nothing left to do. CAIRN_MORE: the budget is
 * used up. Costs one unit a beam, one for two cells on it, and one for 64 cells to clear. Readers
 * see a partly updated grid meanwhile, since a grid is too large to be double-buffered. */
CAIRN_CHECKED cairn_status cairn_occupancy_grid_step(cairn_occupancy_grid *grid,
                                                     cairn_budget *budget);

/* ---- Reading ---- */

/* Counts of a cell. */
typedef struct cairn_occupancy_grid_cell_state {
    /* beams that ended in the cell */
    int32_t hits;
    float length; /* m */
} cairn_occupancy_grid_cell_state;

/* Returns 1 and sets *x, *y to the cell that contains the point; 0 outside the grid.
 *
 * point: m, in the map
 * x, y: set to column and row of the cell */
int32_t cairn_occupancy_grid_locate(const cairn_occupancy_grid *grid, cairn_vec2 point, int32_t *x,
                                    int32_t *y);

/* Returns hits and length of cell (x, y); zeros outside the grid. */
cairn_occupancy_grid_cell_state cairn_occupancy_grid_cell(const cairn_occupancy_grid *grid,
                                                          int32_t x, int32_t y);

/* Returns the probability that a beam stops on a chord as long as the side of the cell, in [0, 1];
 * -1 for an unobserved cell or outside the grid.
 *
 * x, y: column and row of the cell */
cairn_real cairn_occupancy_grid_probability(const cairn_occupancy_grid *grid, int32_t x, int32_t y);

/* Cell values of the trinary maps of ROS map_server. */
enum {
    /* probability at or above thresholds.occupied */
    CAIRN_OCCUPANCY_GRID_OCCUPIED = 0,
    /* in between, or not observed */
    CAIRN_OCCUPANCY_GRID_UNKNOWN = 205,
    /* probability at or below thresholds.free */
    CAIRN_OCCUPANCY_GRID_FREE = 254
};

/* Probabilities that separate occupied, unknown and free cells. */
typedef struct cairn_occupancy_grid_thresholds {
    cairn_real occupied; /* minimum probability of an occupied cell, < 1 */
    /* maximum probability of a free cell, > 0 and <= occupied; unknown in between */
    cairn_real free;
} cairn_occupancy_grid_thresholds;

/* Returns the default thresholds 0.25 and 0.1: a cell that stops a quarter of the beams that cross
 * it is a surface. */
cairn_occupancy_grid_thresholds cairn_occupancy_grid_thresholds_default(void);

/* Classifies rows first_row ... first_row + out.height - 1 into `out`, which is as wide as the
 * grid; unobserved cells are unknown. CAIRN_BAD_ARGUMENT: a bad view, another width, rows outside
 * the grid, or bad thresholds. Cost: linear in the cells of these rows.
 *
 * thresholds: 0 < free <= occupied < 1
 * first_row: row of the grid that row 0 of `out` shows
 * out: set to the classes, see the enumeration */
CAIRN_CHECKED cairn_status cairn_occupancy_grid_classify(const cairn_occupancy_grid *grid,
                                                         cairn_occupancy_grid_thresholds thresholds,
                                                         int32_t first_row, cairn_raster_u8 out);

/* ---- Ray traversal ---- */

/* Iterator over the cells on a beam (voxel traversal). The caller owns it and may copy it; only
 * ends_inside and length are to be read. */
typedef struct cairn_occupancy_grid_ray {
    /* start of the beam, in cells */
    cairn_real from_x, from_y;
    /* share of the beam per cell in x and y, signed */
    cairn_real inverse_x, inverse_y;
    /* share of the beam at the current cell's entry, and at the border of the grid or the end */
    cairn_real share, share_end;
    /* m, of the whole beam */
    cairn_real length;
    /* current cell and last cell */
    int32_t x, y, end_x, end_y;
    /* -1 or 1: direction of the next cell */
    int32_t step_x, step_y;
    /* 1: the last cell contains the end of the beam; 0: the beam leaves the grid */
    int32_t ends_inside;
    /* 1: the last cell was returned */
    int32_t done;
} cairn_occupancy_grid_ray;

/* A cell that a beam crosses. */
typedef struct cairn_occupancy_grid_chord {
    /* column and row of the cell */
    int32_t x, y;
    cairn_real length; /* m; 0 where the beam only touches a corner */
} cairn_occupancy_grid_chord;

/* Starts a traversal of the cells that the beam crosses, from its start to its end. CAIRN_EMPTY: it
 * misses the grid. CAIRN_NOT_FINITE as for add_beam(). Source: Amanatides and Woo 1987, with the
 * border crossings computed one by one, so that no error accumulates.
 *
 * from, to: m: start and end of the beam
 * walk: set to the state of the traversal */
CAIRN_CHECKED cairn_status cairn_occupancy_grid_walk(const cairn_occupancy_grid *grid,
                                                     cairn_vec2 from, cairn_vec2 to,
                                                     cairn_occupancy_grid_ray *walk);

/* Returns 1 and the next cell with the length of the beam in it; 0 after the last cell.
 *
 * walk: state of the traversal
 * chord: set when 1 is returned */
int32_t cairn_occupancy_grid_ray_next(cairn_occupancy_grid_ray *walk,
                                      cairn_occupancy_grid_chord *chord);

#ifdef __cplusplus
}
#endif

#endif
