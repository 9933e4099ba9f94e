/* detection_sort: sorting of items of any size by a comparison, in place, in bounded steps. Private
 * to the folder detection. */
#ifndef CAIRN_DETECTION_SORT_H
#define CAIRN_DETECTION_SORT_H

#include "src/containers/heap.h"

/* Order of two items: below 0 when the first comes first, above 0 when the second does, 0 when they
 * are equal. */
typedef int32_t (*detection_sort_compare)(const void *first, const void *second);

/* A sort that is under way. */
typedef struct detection_sort {
    unsigned char *items; /* items of `size` bytes */
    size_t size;
    detection_sort_compare compare;
    heap_sorting sorting;
    int32_t units_per_item, units_charged;
} detection_sort;

/* Starts to sort `count` items of `size` bytes. Items that compare equal end in any order. */
void cairn_detection_sort_begin(detection_sort *sort, void *items, int32_t count, size_t size,
                                detection_sort_compare compare);

/* Resumes. 0: the budget is used up; 1: sorted. Cost: for each item at most twice the units of one
 * that sinks, which are 1 for every halving of the count. */
int cairn_detection_sort_step(detection_sort *sort, cairn_budget *budget);

/* Sorts at once. Cost: n log n. */
void cairn_detection_sort_all(void *items, int32_t count, size_t size,
                              detection_sort_compare compare);

#endif
