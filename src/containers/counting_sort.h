/* counting_sort: entries sorted by a small integer, such as the cell of a grid or the row of a
 * sparse matrix.
 *
 * Method: keys are 0 ... keys - 1; start has keys + 1 elements.
 * 1. counting_sort_reset() all elements, counting_sort_count() the key of every entry.
 * 2. counting_sort_sum() all elements: the counts become the ends of the keys.
 * 3. counting_sort_place() every entry: its place. The ends become the starts as entries are
 *    placed.
 * Then the entries of a key have the places start[key] ... start[key + 1] - 1, the one placed last
 * first.
 *
 * Ranges of elements can be reset and summed one after the other, in bounded steps.
 *
 * Source: Knuth 1998 (distribution counting). */
#ifndef CAIRN_CONTAINERS_COUNTING_SORT_H
#define CAIRN_CONTAINERS_COUNTING_SORT_H

#include <stdint.h>
#include <string.h>

/* Sets the elements first ... end - 1 to no entry. */
static inline void counting_sort_reset(int32_t *start, int32_t first, int32_t end)
{
    memset(&start[first], 0, (size_t)(end - first) * sizeof *start);
}

/* Counts an entry. */
static inline void counting_sort_count(int32_t *start, int32_t key)
{
    start[key]++;
}

/* Adds up the elements first ... end - 1; those before have been added up. */
static inline void counting_sort_sum(int32_t *start, int32_t first, int32_t end)
{
    for (int32_t key = first > 0 ? first : 1; key < end; key++)
        start[key] += start[key - 1];
}

/* The place of an entry that was counted. */
static inline int32_t counting_sort_place(int32_t *start, int32_t key)
{
    return --start[key];
}

#endif
