/* contour_search_ends: adjacency of segments, by a grid over their ends. Private to the folder
 * detection. */
#ifndef CAIRN_DETECTION_CONTOUR_SEARCH_ENDS_H
#define CAIRN_DETECTION_CONTOUR_SEARCH_ENDS_H

#include "cairn/geometry.h"
#include "src/base/object.h"
#include "src/containers/cell_grid.h"

/* Returns 1 when an end of one segment lies at most max_distance, px, from an end of the other. */
int cairn_contour_search_meet(cairn_segment a, cairn_segment b, cairn_real max_distance);

typedef struct contour_search_ends {
    const cairn_segment *lines;
    /* [count] indices in lines */
    const int32_t *listed;
    int32_t count;
    cell_grid grid;
    cairn_vec2 origin;
    /* px: greatest distance of adjacent ends; cell size of the grid */
    cairn_real max_distance, cell;
    /* [cells + 1] where the ends of each cell begin in by_cell[] */
    int32_t *cell_start;
    /* [2 * count] the ends, cell by cell: 2 * index in the list, + 1 for b */
    int32_t *by_cell;
    /* [count] query that found the segment last */
    int32_t *last_query;
    int32_t query_count;
    /* [count] result of a query */
    int32_t *neighbours;
} contour_search_ends;

/* Allocates the arrays for max_lines segments; ends: NULL, from a counting pool. */
void cairn_contour_search_ends_take(contour_search_ends *ends, cairn_pool *pool, int32_t max_lines);

/* Builds the grid. lines and listed must stay valid; finite, within 1e6 px; max_distance: px, > 0,
 * of adjacent ends. Cost: linear. */
void cairn_contour_search_ends_make(contour_search_ends *ends, const cairn_segment *lines,
                                    const int32_t *listed, int32_t count, cairn_real max_distance);

/* Returns the number of ends that a query compares: those of the cells around the segment's ends.
 * Constant time. */
int32_t cairn_contour_search_ends_compared(const contour_search_ends *ends, int32_t index);

/* Finds the list indices of the segments adjacent to that of a list index, ascending, in
 * ends->neighbours; returns their number. Cost: the ends that it compares. */
int32_t cairn_contour_search_ends_near(contour_search_ends *ends, int32_t index);

#endif
