/* heap: binary heap over the places 0 ... count - 1 of memory that its user holds.
 *
 * The order and the exchange of two entries are callbacks of the user with one context, so an
 * entry may be an element of one array, of several, or an index whose place is kept beside it.
 *
 * Method: no entry belongs above the entry at (place - 1) / 2 over it. An entry that does not fit
 * is exchanged with that one (sift-up), or with the upper one of the two at 2 place + 1 and
 * 2 place + 2 (sift-down), until it fits. Heap sort moves the top behind the heap, again and again;
 * the entry that belongs on top then is the last. A heap with the worst entry on top keeps the best
 * of many: a better one takes the place of the top (heap_keep).
 *
 * The functions are inline, so that the compiler sees the callbacks.
 *
 * Limits: the order is total, which makes the sequence in which entries leave the top the only one
 * possible.
 *
 * Source: Williams 1964; Floyd 1964. */
#ifndef CAIRN_CONTAINERS_HEAP_H
#define CAIRN_CONTAINERS_HEAP_H

#include "cairn/status.h"

/* 1 when the entry at place a belongs above the entry at place b. */
typedef int (*heap_is_above)(const void *context, int32_t a, int32_t b);

/* Exchanges the entries at the places a and b, which may be equal. */
typedef void (*heap_exchange)(void *context, int32_t a, int32_t b);

/* Restores the order upwards from the entry at a place, which may belong above those over it.
 * Cost: logarithmic. */
static inline void heap_sift_up(void *context, int32_t place, heap_is_above is_above,
                                heap_exchange exchange)
{
    for (int32_t over; place > 0; place = over) {
        over = (place - 1) / 2;
        if (!is_above(context, place, over))
            return;
        exchange(context, place, over);
    }
}

/* Restores the order downwards from the entry at a place, which may belong below those under it.
 * Cost: logarithmic. */
static inline void heap_sift_down(void *context, int32_t place, int32_t count,
                                  heap_is_above is_above, heap_exchange exchange)
{
    for (int32_t under; (under = 2 * place + 1) < count; place = under) {
        if (under + 1 < count && is_above(context, under + 1, under))
            under++;
        if (!is_above(context, under, place))
            return;
        exchange(context, under, place);
    }
}

/* Place at which the next entry is written that a heap of the `most` best keeps, with the worst on
 * top: behind the heap, or, when it is full, the top, which is left out. */
static inline int32_t heap_keep_place(int32_t count, int32_t most)
{
    return count < most ? count : 0;
}

/* Restores the order after an entry was written to heap_keep_place(). Returns the number of entries
 * of the heap. Cost: logarithmic. */
static inline int32_t heap_keep(void *context, int32_t count, int32_t most, heap_is_above is_above,
                                heap_exchange exchange)
{
    if (count < most) {
        heap_sift_up(context, count, is_above, exchange);
        return count + 1;
    }
    heap_sift_down(context, 0, count, is_above, exchange);
    return count;
}

/* Restores the order after the entry at a place has changed. Cost: logarithmic. */
static inline void heap_update(void *context, int32_t place, int32_t count, heap_is_above is_above,
                               heap_exchange exchange)
{
    heap_sift_up(context, place, is_above, exchange);
    heap_sift_down(context, place, count, is_above, exchange);
}

/* Exchanges the entry at a place with the last one and restores the order of the count - 1 others.
 * Cost: logarithmic. */
static inline void heap_remove(void *context, int32_t place, int32_t count, heap_is_above is_above,
                               heap_exchange exchange)
{
    exchange(context, place, count - 1);
    if (place < count - 1)
        heap_update(context, place, count - 1, is_above, exchange);
}

/* Exchanges the top with the last entry and restores the order of the count - 1 others. Called with
 * count, count - 1, ... 1 it sorts, the first on top to the end. */
static inline void heap_pop(void *context, int32_t count, heap_is_above is_above,
                            heap_exchange exchange)
{
    exchange(context, 0, count - 1);
    heap_sift_down(context, 0, count - 1, is_above, exchange);
}

/* Sorts entries in any order by heap sort: the one that belongs above all others becomes the last.
 * Cost: count log count. */
static inline void heap_sort(void *context, int32_t count, heap_is_above is_above,
                             heap_exchange exchange)
{
    for (int32_t place = count / 2 - 1; place >= 0; place--)
        heap_sift_down(context, place, count, is_above, exchange);
    for (; count > 1; count--)
        heap_pop(context, count, is_above, exchange);
}

/* A heap sort in bounded steps: places whose entries are not in order with those under them yet,
 * and entries of the heap. */
typedef struct heap_sorting {
    int32_t unordered, count;
} heap_sorting;

/* A sort that begins: of entries in any order. */
static inline heap_sorting heap_sorting_of(int32_t count)
{
    return (heap_sorting){count / 2, count};
}

/* The same of a heap. */
static inline heap_sorting heap_sorting_of_heap(int32_t count)
{
    return (heap_sorting){0, count};
}

/* Sorts as heap_sort(). 0: the budget is used up; called again it continues. `units` are charged
 * for each entry that sinks; *charged: units of the next one so far. */
static inline int heap_sort_step(heap_sorting *sorting, cairn_budget *budget, int32_t *charged,
                                 int32_t units, void *context, heap_is_above is_above,
                                 heap_exchange exchange)
{
    for (; sorting->unordered > 0; sorting->unordered--) {
        if (!cairn_budget_charge(budget, charged, units))
            return 0;
        heap_sift_down(context, sorting->unordered - 1, sorting->count, is_above, exchange);
    }
    for (; sorting->count > 1; sorting->count--) {
        if (!cairn_budget_charge(budget, charged, units))
            return 0;
        heap_pop(context, sorting->count, is_above, exchange);
    }
    return 1;
}

#endif
