/* contour_search_ends: which segments meet, by a grid over their ends. Internal to the host
 * library. */
#ifndef CAIRN_HOST_CONTOUR_SEARCH_ENDS_H
#define CAIRN_HOST_CONTOUR_SEARCH_ENDS_H

#include "cairn/geometry.h"

/* 1 when an end of one lies at most so far from an end of the other, px. */
int cairn_contour_meet(cairn_segment a, cairn_segment b, cairn_real max_distance);

typedef struct contour_ends {
    const cairn_segment *lines;
    /* [count] of lines */
    const int32_t *listed;
    int32_t count, columns, rows;
    cairn_vec2 origin;
    /* px: of ends that meet; of the grid */
    cairn_real max_distance, cell;
    /* [columns * rows] 1 + an end: 2 * place in the list, + 1 for b; 0: none */
    int32_t *cell_heads;
    /* [2 * count] */
    int32_t *next;
    /* [count] by which query it was met last */
    int32_t *last_query;
    int32_t query_count;
    /* [count] */
    int32_t *neighbours;
} contour_ends;

/* lines and listed must stay; finite, within 1e6 px; apart: px, > 0, of ends that meet. Cost:
 * linear. 0: no memory, and nothing to free. */
int cairn_contour_ends_make(contour_ends *ends, const cairn_segment *lines, const int32_t *listed,
                            int32_t count, cairn_real max_distance);

/* The places in the list whose segments meet that of another place, ascending, in ends->near;
 * how many. Cost: those in the cells about its ends. */
int32_t cairn_contour_ends_near(contour_ends *ends, int32_t place);

void cairn_contour_ends_free(contour_ends *ends);

#endif
