/* disjoint_sets: sets of the items 0 ... count - 1, which are united one by one (union-find): which
 * items are connected by links?
 *
 * Method: each set is a tree in the array [count] of its user, root[i] the item over item i. The
 * least item of a set is its root, so it does not depend on the order of the links. A search of the
 * root halves the path.
 *
 * The functions are inline, so that the libraries export none.
 *
 * Limits: without union by size, logarithmic time per operation on average only.
 *
 * Source: Galler and Fischer 1964; Tarjan and van Leeuwen 1984 (path halving). */
#ifndef CAIRN_CONTAINERS_DISJOINT_SETS_H
#define CAIRN_CONTAINERS_DISJOINT_SETS_H

#include <stdint.h>

/* Makes an item a set of its own. */
static inline void disjoint_sets_add(int32_t *root, int32_t item)
{
    root[item] = item;
}

/* Makes each of `count` items a set of its own. */
static inline void disjoint_sets_reset(int32_t *root, int32_t count)
{
    for (int32_t item = 0; item < count; item++)
        disjoint_sets_add(root, item);
}

/* The least item of the set of an item. */
static inline int32_t disjoint_sets_root(int32_t *root, int32_t item)
{
    while (root[item] != item) {
        root[item] = root[root[item]];
        item = root[item];
    }
    return item;
}

/* Unites the sets of two items; 1 when they were different. */
static inline int disjoint_sets_unite(int32_t *root, int32_t a, int32_t b)
{
    a = disjoint_sets_root(root, a);
    b = disjoint_sets_root(root, b);
    root[a > b ? a : b] = a > b ? b : a;
    return a != b;
}

#endif
