/* part_configuration as written: every configuration of the nearest of every vote, each once.
 *
 * Method: a configuration that an earlier seed had is one all of whose votes are among that seed's
 * nearest. Each vote has a row of bits, one for each seed that it is near to; the rows of a
 * configuration's votes, and-ed as parts are added, tell which seeds have it, and it is taken from
 * the first of them. Those found are a heap with the worst at its root, which goes when there is a
 * better one and the heap is full; at the end it is sorted.
 *
 * Source: Adluru 2008, section 5.2.2. */
#include "src/core/build.h"

#include <string.h>

#include "src/contour/part_configuration_work.h"

enum { BITS = 32, PARTS = CONFIGURATION_PARTS };
/* Of a node: its arithmetic and the way through the heap, 16 levels at most; words of a row for
 * one more. */
enum { UNITS_A_NODE = 12, WORDS_A_UNIT = 16 };

void cairn_part_configuration_every_carve(cairn_pool *pool,
                                          const cairn_part_configuration_params *p,
                                          configuration_every **every)
{
    size_t words = ((size_t)p->max_votes + BITS - 1) / BITS;
    configuration_every *e = cairn_pool_take_one(pool, sizeof *e);
    uint32_t *seeds = cairn_pool_take(pool, (size_t)p->max_votes * words, sizeof *seeds);
    uint32_t *both = cairn_pool_take(pool, (PARTS + 1) * words, sizeof *both);
    int64_t *age = cairn_pool_take(pool, (size_t)p->max_found, sizeof *age);

    if (e != NULL) {
        memset(e, 0, sizeof *e);
        e->seeds = seeds;
        e->both = both;
        e->age = age;
        e->words = (int32_t)words;
    }
    *every = e;
}

int32_t cairn_part_configuration_every_units(const cairn_part_configurator *c)
{
    return UNITS_A_NODE + c->every->words / WORDS_A_UNIT;
}

static uint32_t *row_of(const cairn_part_configurator *c, uint32_t *rows, int32_t row)
{
    return &rows[(size_t)row * (size_t)c->every->words];
}

void cairn_part_configuration_every_clear(cairn_part_configurator *c, int32_t vote)
{
    memset(row_of(c, c->every->seeds, vote), 0, (size_t)c->every->words * sizeof(uint32_t));
}

void cairn_part_configuration_every_plant(cairn_part_configurator *c)
{
    for (int32_t i = 0; i < c->near_count; i++)
        row_of(c, c->every->seeds, c->near[i].vote)[c->seed / BITS] |= UINT32_C(1)
                                                                       << (c->seed % BITS);
}

void cairn_part_configuration_every_take(cairn_part_configurator *c, int32_t parts)
{
    const uint32_t *own = row_of(c, c->every->seeds, c->near[c->chosen[parts - 1]].vote);
    const uint32_t *before = row_of(c, c->every->both, parts - 1);
    uint32_t *both = row_of(c, c->every->both, parts);

    for (int32_t i = 0; i <= c->seed / BITS; i++)
        both[i] = parts > 1 ? before[i] & own[i] : own[i];
}

/* 1 when an earlier seed has all parts, too. */
static int was_made(const cairn_part_configurator *c, int32_t parts)
{
    const uint32_t *both = row_of(c, c->every->both, parts);
    int32_t last = c->seed / BITS;

    for (int32_t i = 0; i < last; i++)
        if (both[i] != 0)
            return 1;
    return (both[last] & ((UINT32_C(1) << (c->seed % BITS)) - 1)) != 0;
}

/* ---- The heap ---- */

static int is_worse(const cairn_part_configurator *c, int32_t a, int32_t b)
{
    const cairn_part_configuration *p = &c->found[a], *q = &c->found[b];

    return p->score < q->score || (p->score <= q->score && c->every->age[a] > c->every->age[b]);
}

static void swap(cairn_part_configurator *c, int32_t a, int32_t b)
{
    cairn_part_configuration kept = c->found[a];
    int64_t age = c->every->age[a];

    c->found[a] = c->found[b];
    c->found[b] = kept;
    c->every->age[a] = c->every->age[b];
    c->every->age[b] = age;
}

/* The root of the first `count` finds its place. */
static void sink(cairn_part_configurator *c, int32_t count)
{
    for (int32_t at = 0, below = 1; below < count; at = below, below = 2 * at + 1) {
        if (below + 1 < count && is_worse(c, below + 1, below))
            below++;
        if (!is_worse(c, below, at))
            return;
        swap(c, at, below);
    }
}

static void rise(cairn_part_configurator *c, int32_t at)
{
    for (; at > 0 && is_worse(c, at, (at - 1) / 2); at = (at - 1) / 2)
        swap(c, at, (at - 1) / 2);
}

void cairn_part_configuration_every_offer(cairn_part_configurator *c,
                                          const configuration_node *node)
{
    configuration_every *e = c->every;
    int32_t at = c->found_count < c->params.max_found ? c->found_count : 0;

    if (node->parts < c->params.min_parts || node->gain < c->params.min_sum ||
        was_made(c, node->parts))
        return;
    e->made++;
    if (c->found_count == c->params.max_found && !(node->gain > c->found[0].score))
        return;
    c->best = node->gain;
    c->best_node = *node;
    c->best_count = node->parts;
    for (int32_t i = 0; i < node->parts; i++)
        c->best_votes[i] = c->near[c->chosen[i]].vote;
    c->found[at] = cairn_part_configuration_describe(
        c, c->found_count < c->params.max_found ? at * PARTS : c->found[0].first);
    e->age[at] = e->made;
    if (c->found_count < c->params.max_found)
        rise(c, c->found_count++);
    else
        sink(c, c->found_count);
}

int cairn_part_configuration_every_sort(cairn_part_configurator *c)
{
    int32_t left = c->found_count - c->every->sorted;

    if (left < 2)
        return 0;
    swap(c, 0, left - 1);
    sink(c, left - 1);
    c->every->sorted++;
    return 1;
}
