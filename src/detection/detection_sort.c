/* Sorting of items of any size by a comparison, in place.
 *
 * Method: heap sort (Williams 1964).
 * 1. Items are sifted down into a heap whose root is the last in order.
 * 2. The root is exchanged with the last item of the heap, which shrinks by it.
 *
 * Limits: not stable. The comparisons here are total orders, except of items with equal bytes.
 *
 * Source: Williams 1964; heap construction after Floyd 1964. */
#include "src/base/build.h"

#include <string.h>

#include "src/detection/detection_sort.h"

enum { CHUNK_BYTES = 64 };

static unsigned char *item_at(const detection_sort *sort, int32_t index)
{
    return sort->items + (size_t)index * sort->size;
}

static void exchange(const detection_sort *sort, int32_t first, int32_t second)
{
    unsigned char chunk[CHUNK_BYTES], *a = item_at(sort, first), *b = item_at(sort, second);

    for (size_t left = sort->size; left > 0;) {
        size_t bytes = left < CHUNK_BYTES ? left : CHUNK_BYTES;

        memcpy(chunk, a, bytes);
        memcpy(a, b, bytes);
        memcpy(b, chunk, bytes);
        a += bytes;
        b += bytes;
        left -= bytes;
    }
}

/* Sifts an item down the heap of the first `count` items. */
static void sift_down(const detection_sort *sort, int32_t index, int32_t count)
{
    while (2 * (int64_t)index + 1 < count) {
        int32_t child = 2 * index + 1;

        if (child + 1 < count && sort->compare(item_at(sort, child), item_at(sort, child + 1)) < 0)
            child++;
        if (sort->compare(item_at(sort, index), item_at(sort, child)) >= 0)
            return;
        exchange(sort, index, child);
        index = child;
    }
}

/* Levels of a heap: the greatest number of exchanges of a sift. */
static int32_t levels_of(int32_t count)
{
    int32_t levels = 1;

    for (; count > 1; count /= 2)
        levels++;
    return levels;
}

void cairn_detection_sort_begin(detection_sort *sort, void *items, int32_t count, size_t size,
                                detection_sort_compare compare)
{
    sort->items = items;
    sort->count = count;
    sort->size = size;
    sort->compare = compare;
    sort->unheaped = count / 2;
    sort->heaped = count;
    sort->units_charged = 0;
}

cairn_status cairn_detection_sort_step(detection_sort *sort, cairn_budget *budget)
{
    int32_t units_per_sift = levels_of(sort->count);

    for (; sort->unheaped > 0; sort->unheaped--) {
        if (!cairn_budget_charge(budget, &sort->units_charged, units_per_sift))
            return CAIRN_MORE;
        sift_down(sort, sort->unheaped - 1, sort->count);
    }
    for (; sort->heaped > 1; sort->heaped--) {
        if (!cairn_budget_charge(budget, &sort->units_charged, units_per_sift))
            return CAIRN_MORE;
        exchange(sort, 0, sort->heaped - 1);
        sift_down(sort, 0, sort->heaped - 1);
    }
    return CAIRN_OK;
}

void cairn_detection_sort_all(void *items, int32_t count, size_t size,
                              detection_sort_compare compare)
{
    detection_sort sort;
    cairn_budget budget;

    cairn_detection_sort_begin(&sort, items, count, size, compare);
    do {
        budget.left = INT32_MAX;
    } while (cairn_detection_sort_step(&sort, &budget) == CAIRN_MORE);
}
