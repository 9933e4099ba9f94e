/* detection_sort: sorting in place, in bounded steps. Private to the folder detection. */
#ifndef CAIRN_DETECTION_SORT_H
#define CAIRN_DETECTION_SORT_H

#include "cairn/status.h"

/* Order of two items: below 0 when the first comes first, above 0 when the second does, 0 when they
 * are equal. */
typedef int32_t (*detection_sort_compare)(const void *first, const void *second);

/* A sort that is under way. */
typedef struct detection_sort {
    unsigned char *items; /* [count] items of `size` bytes */
    int32_t count;
    size_t size;
    detection_sort_compare compare;
    /* Work left: items that are not yet part of the heap, then items of the heap. */
    int32_t unheaped, heaped;
    int32_t units_charged;
} detection_sort;

/* Starts to sort `count` items of `size` bytes. Items that compare equal end in any order. */
void cairn_detection_sort_begin(detection_sort *sort, void *items, int32_t count, size_t size,
                                detection_sort_compare compare);

/* Resumes. CAIRN_MORE: the budget is used up. Cost: for each item twice the units of one sift, which
 * is 1 unit for every halving of the count. */
cairn_status cairn_detection_sort_step(detection_sort *sort, cairn_budget *budget);

/* Sorts at once. Cost: n log n. */
void cairn_detection_sort_all(void *items, int32_t count, size_t size,
                              detection_sort_compare compare);

#endif
