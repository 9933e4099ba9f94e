/* cell_grid: square cells of the plane, numbered for the index of an array.
 *
 * Dense: cells of columns and rows from the origin on, row by row; points beyond belong to the
 * cells at the border. Sorted by their cells (counting_sort), the entries of neighbouring cells of
 * a row are contiguous.
 *
 * Hashed: cells of the whole plane, or of several layers of it, share the buckets of an array; each
 * entry of a bucket is tested by its own position.
 *
 * Limits: at most 2^31 - 1 cells. Coordinates beyond an int32_t belong to the outermost cells. */
#ifndef CAIRN_CONTAINERS_CELL_GRID_H
#define CAIRN_CONTAINERS_CELL_GRID_H

#include "cairn/geometry.h"

/* Size of a dense grid. The side of its cells, in the unit of the points, is an argument: mostly a
 * constant. */
typedef struct cell_grid {
    int32_t columns, rows;
} cell_grid;

/* Range of cells, borders included. */
typedef struct cell_range {
    int32_t x0, x1, y0, y1;
} cell_range;

/* Number of the cells along a side of an image. */
static inline int32_t cell_grid_cells(int32_t pixels, int32_t side)
{
    return (pixels + side - 1) / side;
}

/* The grid over an image, px. */
static inline cell_grid cell_grid_of(int32_t width, int32_t height, int32_t side)
{
    return (cell_grid){cell_grid_cells(width, side), cell_grid_cells(height, side)};
}

/* Number of the cells. */
static inline int32_t cell_grid_count(const cell_grid *grid)
{
    return grid->columns * grid->rows;
}

/* Cell of a coordinate along a side of `count` cells. */
static inline int32_t cell_grid_along(cairn_real coordinate, cairn_real side, int32_t count)
{
    int32_t cell = cairn_real_to_int(coordinate / side);

    return cell < 0 ? 0 : cell >= count ? count - 1 : cell;
}

/* Cell of a point. */
static inline int32_t cell_grid_cell(const cell_grid *grid, cairn_real side, cairn_vec2 p)
{
    return cell_grid_along(p.y, side, grid->rows) * grid->columns +
           cell_grid_along(p.x, side, grid->columns);
}

/* Cells of the points of a box. */
static inline cell_range cell_grid_range(const cell_grid *grid, cairn_real side, cairn_box box)
{
    cell_range range = {.x0 = cell_grid_along(box.min.x, side, grid->columns),
                        .x1 = cell_grid_along(box.max.x, side, grid->columns),
                        .y0 = cell_grid_along(box.min.y, side, grid->rows),
                        .y1 = cell_grid_along(box.max.y, side, grid->rows)};

    return range;
}

/* Hash of a cell of the plane, or of a layer: its lower bits, or its remainder, are the bucket. */
static inline uint32_t cell_hash(int32_t x, int32_t y, int32_t layer)
{
    uint32_t hash = (uint32_t)x * UINT32_C(0x9E3779B1) + (uint32_t)y * UINT32_C(0x85EBCA77) +
                    (uint32_t)layer * UINT32_C(0xC2B2AE3D);

    return hash ^ hash >> 15;
}

#endif
