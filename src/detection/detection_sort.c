/* Sorting of items of any size by a comparison, in place: the heap sort of src/containers/heap.h with
 * an exchange by bytes.
 *
 * Limits: not stable. The comparisons here are total orders, except of items with equal bytes. */
#include "src/base/build.h"

#include <string.h>

#include "src/detection/detection_sort.h"

enum { CHUNK_BYTES = 64 };

static unsigned char *item_at(const detection_sort *sort, int32_t index)
{
    return sort->items + (size_t)index * sort->size;
}

/* The last in order is on top of the heap. */
static int comes_after(const void *context, int32_t a, int32_t b)
{
    const detection_sort *sort = context;

    return sort->compare(item_at(sort, a), item_at(sort, b)) > 0;
}

static void exchange(void *context, int32_t first, int32_t second)
{
    const detection_sort *sort = context;
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

/* Levels of a heap: the greatest number of exchanges of an item that sinks. */
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
    sort->size = size;
    sort->compare = compare;
    sort->sorting = heap_sorting_of(count);
    sort->units_per_item = levels_of(count);
    sort->units_charged = 0;
}

int cairn_detection_sort_step(detection_sort *sort, cairn_budget *budget)
{
    return heap_sort_step(&sort->sorting, budget, &sort->units_charged, sort->units_per_item, sort,
                          comes_after, exchange);
}

void cairn_detection_sort_all(void *items, int32_t count, size_t size,
                              detection_sort_compare compare)
{
    detection_sort sort = {.items = items, .size = size, .compare = compare};

    heap_sort(&sort, count, comes_after, exchange);
}
