/* occupancy_grid: a grid map with the beam-penetration model.
 *
 * Each cell holds how many beams ended in it (hits h) and the total length of beam through it (d,
 * in m). d / h is the mean distance that a beam travels in such material before it stops; the
 * probability that a beam stops on a chord of length l is 1 - exp(-l h / d) (Eliazar and Parr 2004,
 * DP-SLAM 2.0).
 *
 * Cell (0, 0) is lower left, cells are closed below and to the left. Beams that lie partly
 * outside are clipped; unknown beams change nothing. Memory: 8 bytes a cell. */
#ifndef CAIRN_OCCUPANCY_GRID_H
#define CAIRN_OCCUPANCY_GRID_H

#include "cairn/raster.h"
#include "cairn/scan.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_occupancy_grid cairn_occupancy_grid;

typedef struct cairn_occupancy_grid_params {
    int32_t width, height; /* cells, 1 ... CAIRN_RASTER_MAX_SIDE */
    cairn_real resolution; /* side of a cell in m, > 0 */
    cairn_vec2 origin;     /* lower left corner of cell (0, 0), in m */
} cairn_occupancy_grid_params;

/* 400 x 400 cells of 0.05 m around (0, 0). */
cairn_occupancy_grid_params cairn_occupancy_grid_default(void);

/* Upper bound of cairn_occupancy_grid_memory(), as a constant expression. */
#define CAIRN_OCCUPANCY_GRID_BYTES(width, height)                                                  \
    (CAIRN_PIECE_BYTES(1, 256) + CAIRN_PIECE_BYTES((size_t)(width) * (size_t)(height), 8))

/* 0 for params that create() would refuse. */
size_t cairn_occupancy_grid_memory(const cairn_occupancy_grid_params *params);

/* Cost: linear in the cells. CAIRN_BAD_ARGUMENT (also a grid whose far corner is not finite),
 * CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_occupancy_grid_create(cairn_occupancy_grid **grid,
                                                       cairn_pool *pool,
                                                       const cairn_occupancy_grid_params *params);

/* The params of create(). */
cairn_occupancy_grid_params cairn_occupancy_grid_read(const cairn_occupancy_grid *grid);

/* ---- Adding beams ---- */

/* Adds one beam, in the frame of the map, at once: its chords to the lengths of the cells, and,
 * when hit is not 0, a hit to the cell of `to`. CAIRN_NOT_FINITE: an end is not finite, or so
 * far away that the length overflows. CAIRN_BAD_ARGUMENT: a scan or a clearing is not finished.
 * Cost: the cells on the beam. */
CAIRN_CHECKED cairn_status cairn_occupancy_grid_add_beam(cairn_occupancy_grid *grid,
                                                         cairn_vec2 from, cairn_vec2 to,
                                                         int32_t hit);

/* Starts to add a scan: beams[0 ... count-1], seen from the pose map_scan; they must stay until
 * step() returns CAIRN_OK. CAIRN_BAD_ARGUMENT: count < 0, NULL with count > 0, an unknown kind
 * of beam, or a scan that is not finished. CAIRN_NOT_FINITE: the pose, or an end of a beam that
 * is not unknown. *fault, when not NULL, tells the beam. Cost: a linear pass over the beams. */
CAIRN_CHECKED cairn_status cairn_occupancy_grid_begin_scan(cairn_occupancy_grid *grid,
                                                           const cairn_beam *beams, int32_t count,
                                                           cairn_pose map_scan, cairn_fault *fault);

/* Starts to clear all cells; a scan that is being added is dropped. A scan may be begun right
 * after it. Constant time. */
void cairn_occupancy_grid_clear(cairn_occupancy_grid *grid);

/* Clears, then adds the scan. CAIRN_OK: nothing left to do. CAIRN_MORE: go on. Costs a unit a
 * beam, a unit for two cells on it, and a unit for 64 cells to clear. Readers see the cells that
 * are done: a grid is too large to be kept twice. */
CAIRN_CHECKED cairn_status cairn_occupancy_grid_step(cairn_occupancy_grid *grid,
                                                     cairn_budget *budget);

/* ---- Reading ---- */

typedef struct cairn_occupancy_cell {
    int32_t hits;
    float length; /* m */
} cairn_occupancy_cell;

/* 1 and *x, *y set when the point lies in a cell of the grid. */
int32_t cairn_occupancy_grid_locate(const cairn_occupancy_grid *grid, cairn_vec2 point, int32_t *x,
                                    int32_t *y);

/* Hits and length of cell (x, y); zeros outside the grid. */
cairn_occupancy_cell cairn_occupancy_grid_cell(const cairn_occupancy_grid *grid, int32_t x,
                                               int32_t y);

/* Probability that a beam stops on a chord as long as the side of the cell, in [0, 1]; -1 when
 * no beam has passed or ended in it, or outside the grid. */
cairn_real cairn_occupancy_grid_probability(const cairn_occupancy_grid *grid, int32_t x, int32_t y);

/* Values of the trinary maps of ROS map_server. */
enum { CAIRN_CELL_OCCUPIED = 0, CAIRN_CELL_UNKNOWN = 205, CAIRN_CELL_FREE = 254 };

typedef struct cairn_occupancy_thresholds {
    cairn_real occupied; /* occupied from this probability on, < 1 */
    cairn_real free;     /* free up to this one, > 0 and <= occupied; in between unknown */
} cairn_occupancy_thresholds;

/* 0.25 and 0.1: what stops a quarter of the beams that cross it is a surface. */
cairn_occupancy_thresholds cairn_occupancy_thresholds_default(void);

/* Writes the states of rows first_row ... first_row + out.height - 1 into `out`, which is as
 * wide as the grid; cells never seen are unknown. CAIRN_BAD_ARGUMENT: a bad view, another width,
 * rows outside the grid, bad thresholds. Cost: linear in the cells of these rows. */
CAIRN_CHECKED cairn_status cairn_occupancy_grid_classify(const cairn_occupancy_grid *grid,
                                                         cairn_occupancy_thresholds thresholds,
                                                         int32_t first_row, cairn_raster_u8 out);

/* ---- The cells on a beam ---- */

/* Open to be kept and copied by who walks; ends_inside and length may be read. */
typedef struct cairn_occupancy_walk {
    /* in cells */
    cairn_real from_x, from_y;
    /* share of the beam to cross a cell, signed */
    cairn_real inverse_x, inverse_y;
    /* of the beam: at the current cell's entry, at the border of the grid or the end */
    cairn_real share, share_end;
    /* of the whole beam, m */
    cairn_real length;
    int32_t x, y, end_x, end_y;
    int32_t step_x, step_y;
    /* 1: the last cell is that of the beam's end; 0: the beam leaves the grid */
    int32_t ends_inside;
    int32_t done;
} cairn_occupancy_walk;

typedef struct cairn_occupancy_chord {
    int32_t x, y;
    cairn_real length; /* m; 0 where the beam touches just a corner */
} cairn_occupancy_chord;

/* Starts to walk the cells that the beam crosses, from its beginning to its end. CAIRN_EMPTY: it
 * misses the grid. CAIRN_NOT_FINITE as for add_beam(). Source: Amanatides and Woo 1987, with the
 * border crossings computed one by one, so that no error adds up. */
CAIRN_CHECKED cairn_status cairn_occupancy_grid_walk(const cairn_occupancy_grid *grid,
                                                     cairn_vec2 from, cairn_vec2 to,
                                                     cairn_occupancy_walk *walk);

/* 1 and the next cell with the length of the beam in it; 0 when there are no more. */
int32_t cairn_occupancy_walk_next(cairn_occupancy_walk *walk, cairn_occupancy_chord *chord);

#ifdef __cplusplus
}
#endif

#endif
