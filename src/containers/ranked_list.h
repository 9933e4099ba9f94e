/* ranked_list: the best entries found so far, the best first, with non-maximum suppression.
 *
 * Method: an entry goes before those that rank behind it, and behind its equals, which stay in the
 * order of their arrival. At capacity the last one is dropped for it. Where entries can be near
 * each other, an entry is refused when a near one does not rank behind it; otherwise it replaces
 * the near ones.
 *
 * The functions are inline, so that the compiler sees the callbacks.
 *
 * Limits: the order is total up to equal entries. Time linear in the number of entries; of many
 * whose order is needed only at the end, a heap. Entries that were removed for one that is dropped
 * later do not come back.
 *
 * Source: Neubeck and Van Gool 2006 (greedy non-maximum suppression). */
#ifndef CAIRN_CONTAINERS_RANKED_LIST_H
#define CAIRN_CONTAINERS_RANKED_LIST_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "cairn/real.h"

/* Always inline, also where code is small before all: a call by pointer would hide the stack of the
 * callback, and code that knows the list is smaller. */
#ifdef __GNUC__
#define RANKED_LIST_INLINE __attribute__((always_inline)) static inline
#else
#define RANKED_LIST_INLINE static inline
#endif

/* A list in the memory of its user, and the order of its entries. */
typedef struct ranked_list {
    /* [capacity] Entries of entry_bytes bytes, and their number. */
    void *entries;
    int32_t *count;
    int32_t capacity;
    size_t entry_bytes;
    /* Bytes from an entry to the cairn_real that ranks it: the greatest first; 1: the least. */
    size_t score_at;
    int least_first;
    /* Of entries that no real ranks: 1 when one ranks before another, 0 of equal ones. */
    int (*ranks_before)(const void *context, const void *entry, const void *other);
    /* 1 when two entries are near each other; NULL: they never are. */
    int (*is_near)(const void *context, const void *entry, const void *other);
    /* Given to the callbacks. */
    const void *context;
    /* 1: of several near ones that rank behind a new entry only the first is removed. */
    int replaces_one;
} ranked_list;

/* The entry at a place. */
static inline unsigned char *ranked_list_at(const ranked_list *list, int32_t place)
{
    return (unsigned char *)list->entries + (size_t)place * list->entry_bytes;
}

/* Moves the entries from a place to the end to another place. */
static inline void ranked_list_move(const ranked_list *list, int32_t to, int32_t from)
{
    memmove(ranked_list_at(list, to), ranked_list_at(list, from),
            (size_t)(*list->count - from) * list->entry_bytes);
}

/* 1 when an entry ranks before another. */
RANKED_LIST_INLINE int ranked_list_is_before(const ranked_list *list, const void *entry,
                                             const void *other)
{
    cairn_real score, other_score;

    if (list->ranks_before != NULL)
        return list->ranks_before(list->context, entry, other);
    memcpy(&score, (const unsigned char *)entry + list->score_at, sizeof score);
    memcpy(&other_score, (const unsigned char *)other + list->score_at, sizeof other_score);
    return list->least_first ? score < other_score : score > other_score;
}

/* Removes the entry at a place. */
static inline void ranked_list_remove(const ranked_list *list, int32_t place)
{
    ranked_list_move(list, place, place + 1);
    --*list->count;
}

/* Removes the entries near a new one, which all must rank behind it. 0, and no change, when one
 * does not. */
RANKED_LIST_INLINE int ranked_list_suppress(const ranked_list *list, const void *entry)
{
    for (int32_t place = 0; place < *list->count;) {
        const void *other = ranked_list_at(list, place);

        if (!list->is_near(list->context, entry, other)) {
            place++;
            continue;
        }
        if (!ranked_list_is_before(list, entry, other))
            return 0;
        ranked_list_remove(list, place);
        if (list->replaces_one)
            return 1;
    }
    return 1;
}

/* Puts an entry at its place, whatever is near it. Returns the place; -1: the list is full of
 * entries that do not rank behind it. */
RANKED_LIST_INLINE int32_t ranked_list_add(const ranked_list *list, const void *entry)
{
    int32_t place = *list->count;

    while (place > 0 && ranked_list_is_before(list, entry, ranked_list_at(list, place - 1)))
        place--;
    if (place == list->capacity)
        return -1;
    *list->count -= *list->count == list->capacity;
    ranked_list_move(list, place + 1, place);
    memcpy(ranked_list_at(list, place), entry, list->entry_bytes);
    ++*list->count;
    return place;
}

/* Adds an entry with non-maximum suppression. Returns its place; -1: refused. */
RANKED_LIST_INLINE int32_t ranked_list_insert(const ranked_list *list, const void *entry)
{
    return ranked_list_suppress(list, entry) ? ranked_list_add(list, entry) : -1;
}

/* Appends the entry at a place behind the end, unless it is near one of the list: called with the
 * places of sorted entries in order, from an empty list, it suppresses those that are near a better
 * one. */
RANKED_LIST_INLINE void ranked_list_keep(const ranked_list *list, int32_t place)
{
    const unsigned char *entry = ranked_list_at(list, place);
    int32_t other = 0;

    while (other < *list->count &&
           !list->is_near(list->context, entry, ranked_list_at(list, other)))
        other++;
    if (other < *list->count)
        return;
    memmove(ranked_list_at(list, other), entry, list->entry_bytes);
    ++*list->count;
}

/* Removes from a list that was filled without suppression each entry that is near one before it,
 * unless that is removed itself. */
RANKED_LIST_INLINE void ranked_list_suppress_all(const ranked_list *list)
{
    int32_t all = *list->count;

    *list->count = 0;
    for (int32_t place = 0; place < all; place++)
        ranked_list_keep(list, place);
}

#endif
