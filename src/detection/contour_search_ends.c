/* Adjacency of segments: a dense grid over their ends, with cells as wide as the greatest distance,
 * or wider when that would give many more cells than ends. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/counting_sort.h"
#include "src/detection/contour_search_ends.h"
#include "src/detection/detection_sort.h"

/* Greatest number of cells: MIN_CELLS and CELLS_PER_SEGMENT of each segment. */
enum { MIN_CELLS = 1024, CELLS_PER_SEGMENT = 4 };

int cairn_contour_search_meet(cairn_segment a, cairn_segment b, cairn_real max_distance)
{
    const cairn_real max_squared = max_distance * max_distance;

    return cairn_vec2_norm_squared(cairn_vec2_sub(a.a, b.a)) <= max_squared ||
           cairn_vec2_norm_squared(cairn_vec2_sub(a.a, b.b)) <= max_squared ||
           cairn_vec2_norm_squared(cairn_vec2_sub(a.b, b.a)) <= max_squared ||
           cairn_vec2_norm_squared(cairn_vec2_sub(a.b, b.b)) <= max_squared;
}

static cairn_vec2 end_position(const contour_search_ends *ends, int32_t end)
{
    const cairn_segment *line = &ends->lines[ends->listed[end / 2]];

    return end % 2 == 0 ? line->a : line->b;
}

/* An end from the corner of the grid. */
static cairn_vec2 end_in_grid(const contour_search_ends *ends, int32_t end)
{
    return cairn_vec2_sub(end_position(ends, end), ends->origin);
}

static int32_t cell_of(const contour_search_ends *ends, int32_t end)
{
    return cell_grid_cell(&ends->grid, ends->cell, end_in_grid(ends, end));
}

void cairn_contour_search_ends_take(contour_search_ends *ends, cairn_pool *pool, int32_t max_lines)
{
    size_t lines = (size_t)max_lines;

    CAIRN_TAKE(ends, pool, cell_start, MIN_CELLS + CELLS_PER_SEGMENT * lines + 1);
    CAIRN_TAKE(ends, pool, by_cell, 2 * lines);
    CAIRN_TAKE(ends, pool, last_query, lines);
    CAIRN_TAKE(ends, pool, neighbours, lines);
}

void cairn_contour_search_ends_make(contour_search_ends *ends, const cairn_segment *lines,
                                    const int32_t *listed, int32_t count, cairn_real max_distance)
{
    cairn_box box = cairn_box_empty();
    cell_grid *grid = &ends->grid;
    int32_t cells;

    ends->lines = lines;
    ends->listed = listed;
    ends->count = count;
    ends->max_distance = max_distance;
    ends->query_count = 0;
    for (int32_t i = 0; i < 2 * count; i++)
        box = cairn_box_extend(box, end_position(ends, i));
    ends->origin = count > 0 ? box.min : (cairn_vec2){0, 0};
    ends->cell = max_distance * CAIRN_REAL(1.001);
    *grid = (cell_grid){1, 1};
    while (count > 0) {
        grid->columns = 1 + cairn_real_to_int((box.max.x - box.min.x) / ends->cell);
        grid->rows = 1 + cairn_real_to_int((box.max.y - box.min.y) / ends->cell);
        if ((int64_t)grid->columns * grid->rows <= MIN_CELLS + CELLS_PER_SEGMENT * (int64_t)count)
            break;
        ends->cell *= 2;
    }
    memset(ends->last_query, 0, (size_t)count * sizeof *ends->last_query);
    cells = cell_grid_count(grid);
    counting_sort_reset(ends->cell_start, 0, cells + 1);
    for (int32_t i = 0; i < 2 * count; i++)
        counting_sort_count(ends->cell_start, cell_of(ends, i));
    counting_sort_sum(ends->cell_start, 0, cells + 1);
    for (int32_t i = 0; i < 2 * count; i++)
        ends->by_cell[counting_sort_place(ends->cell_start, cell_of(ends, i))] = i;
}

/* Cells around an end of a segment. */
static cell_range cells_around(const contour_search_ends *ends, int32_t end)
{
    cairn_vec2 at = end_in_grid(ends, end);

    return cell_grid_range(&ends->grid, ends->cell,
                           cairn_box_grow((cairn_box){at, at}, ends->cell));
}

/* Range in by_cell[] of the ends of the cells x0 ... x1 of a row. */
static void range_of_row(const contour_search_ends *ends, cell_range cells, int32_t row,
                         int32_t range[2])
{
    range[0] = ends->cell_start[row * ends->grid.columns + cells.x0];
    range[1] = ends->cell_start[row * ends->grid.columns + cells.x1 + 1];
}

int32_t cairn_contour_search_ends_compared(const contour_search_ends *ends, int32_t index)
{
    int32_t count = 0;

    for (int32_t end = 2 * index; end < 2 * index + 2; end++) {
        cell_range cells = cells_around(ends, end);

        for (int32_t row = cells.y0; row <= cells.y1; row++) {
            int32_t range[2];

            range_of_row(ends, cells, row, range);
            count += range[1] - range[0];
        }
    }
    return count;
}

static int32_t ascending(const void *first, const void *second)
{
    const int32_t *a = first, *b = second;

    return (*a > *b) - (*a < *b);
}

int32_t cairn_contour_search_ends_near(contour_search_ends *ends, int32_t index)
{
    int32_t count = 0;

    ends->query_count++;
    for (int32_t end = 2 * index; end < 2 * index + 2; end++) {
        cell_range cells = cells_around(ends, end);

        for (int32_t row = cells.y0; row <= cells.y1; row++) {
            int32_t range[2];

            range_of_row(ends, cells, row, range);
            for (int32_t i = range[0]; i < range[1]; i++) {
                int32_t other = ends->by_cell[i] / 2;

                if (other == index || ends->last_query[other] == ends->query_count ||
                    !cairn_contour_search_meet(ends->lines[ends->listed[index]],
                                               ends->lines[ends->listed[other]],
                                               ends->max_distance))
                    continue;
                ends->last_query[other] = ends->query_count;
                ends->neighbours[count++] = other;
            }
        }
    }
    cairn_detection_sort_all(ends->neighbours, count, sizeof *ends->neighbours, ascending);
    return count;
}
