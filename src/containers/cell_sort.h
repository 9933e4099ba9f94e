/* cell_sort: entries sorted by the cell of a grid that they lie in, by counting sort.
 *
 * Method: cells are numbered 0 ... cells - 1; start has cells + 1 elements.
 * 1. cell_sort_reset() all elements, cell_sort_count() the cell of every entry.
 * 2. cell_sort_sum() all elements: the counts become the ends of the cells.
 * 3. cell_sort_place() every entry: its place. The ends become the starts as entries are placed.
 * Then the entries of a cell have the places start[cell] ... start[cell + 1] - 1, the one placed
 * last first, and cells of successive numbers follow each other.
 *
 * Ranges of elements can be reset and summed one after the other, in bounded steps.
 *
 * Source: Knuth 1998 (distribution counting). */
#ifndef CAIRN_CONTAINERS_CELL_SORT_H
#define CAIRN_CONTAINERS_CELL_SORT_H

#include <stdint.h>
#include <string.h>

/* Sets the elements first ... end - 1 to no entry. */
static inline void cell_sort_reset(int32_t *start, int32_t first, int32_t end)
{
    memset(&start[first], 0, (size_t)(end - first) * sizeof *start);
}

/* Counts an entry. */
static inline void cell_sort_count(int32_t *start, int32_t cell)
{
    start[cell]++;
}

/* Adds up the elements first ... end - 1; those before have been added up. */
static inline void cell_sort_sum(int32_t *start, int32_t first, int32_t end)
{
    for (int32_t cell = first > 0 ? first : 1; cell < end; cell++)
        start[cell] += start[cell - 1];
}

/* The place of an entry that was counted. */
static inline int32_t cell_sort_place(int32_t *start, int32_t cell)
{
    return --start[cell];
}

#endif
