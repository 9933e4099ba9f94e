/* part_configuration as written: exhaustive enumeration of the configurations of every vote's
 * nearest votes, each reported once.
 *
 * Method:
 * 1. A seed has a configuration when all its votes are among the seed's nearest. Each vote has a
 *    row of bits, one for each seed that it is near to.
 * 2. The rows of a configuration's votes, intersected (and-ed) as parts are added, give the seeds
 *    that have it. Only the first of them reports it.
 * 3. The configurations found form a heap with the worst at its root, which a better one replaces
 *    when the heap is full. At the end the heap is sorted.
 *
 * Source: Adluru 2008, section 5.2.2. */
#include "src/base/build.h"

#include <string.h>

#include "src/parts/part_configuration_work.h"

enum { WORD_BITS = 32, MAX_PARTS = PART_CONFIGURATION_MAX_PARTS };
/* Work units of a node: its arithmetic and the path through the heap of at most 16 levels; words of
 * a row per additional unit. */
enum { UNITS_PER_NODE = 12, WORDS_PER_UNIT = 16 };

part_configuration_exhaustive *
cairn_part_configuration_exhaustive_build(cairn_pool *pool,
                                          const cairn_part_configuration_params *params)
{
    size_t votes = (size_t)params->max_votes, words = (votes + WORD_BITS - 1) / WORD_BITS;
    part_configuration_exhaustive *exhaustive = cairn_object_take(pool, sizeof *exhaustive);

    CAIRN_TAKE(exhaustive, pool, near_seeds, votes * words);
    CAIRN_TAKE(exhaustive, pool, common_seeds, (MAX_PARTS + 1) * words);
    CAIRN_TAKE(exhaustive, pool, sequence, params->max_found);
    if (exhaustive != NULL)
        exhaustive->row_words = (int32_t)words;
    return exhaustive;
}

int32_t cairn_part_configuration_exhaustive_units(const cairn_part_configurator *configurator)
{
    return UNITS_PER_NODE + configurator->exhaustive->row_words / WORDS_PER_UNIT;
}

static uint32_t *row_of(const cairn_part_configurator *configurator, uint32_t *rows, int32_t row)
{
    return &rows[(size_t)row * (size_t)configurator->exhaustive->row_words];
}

void cairn_part_configuration_exhaustive_clear(cairn_part_configurator *configurator, int32_t vote)
{
    memset(row_of(configurator, configurator->exhaustive->near_seeds, vote), 0,
           (size_t)configurator->exhaustive->row_words * sizeof(uint32_t));
}

void cairn_part_configuration_exhaustive_mark_seed(cairn_part_configurator *configurator)
{
    for (int32_t i = 0; i < configurator->near_count; i++)
        row_of(configurator, configurator->exhaustive->near_seeds,
               configurator->near_votes[i].vote)[configurator->seed / WORD_BITS] |=
            UINT32_C(1) << (configurator->seed % WORD_BITS);
}

void cairn_part_configuration_exhaustive_extend(cairn_part_configurator *configurator,
                                                int32_t parts)
{
    const uint32_t *own =
        row_of(configurator, configurator->exhaustive->near_seeds,
               configurator->near_votes[configurator->tree.chosen[parts - 1]].vote);
    const uint32_t *before =
        row_of(configurator, configurator->exhaustive->common_seeds, parts - 1);
    uint32_t *common_seeds = row_of(configurator, configurator->exhaustive->common_seeds, parts);

    for (int32_t i = 0; i <= configurator->seed / WORD_BITS; i++)
        common_seeds[i] = parts > 1 ? before[i] & own[i] : own[i];
}

/* Returns 1 when an earlier seed has all parts, too. */
static int is_enumerated(const cairn_part_configurator *configurator, int32_t parts)
{
    const uint32_t *common_seeds =
        row_of(configurator, configurator->exhaustive->common_seeds, parts);
    int32_t last = configurator->seed / WORD_BITS;

    for (int32_t i = 0; i < last; i++)
        if (common_seeds[i] != 0)
            return 1;
    return (common_seeds[last] & ((UINT32_C(1) << (configurator->seed % WORD_BITS)) - 1)) != 0;
}

/* ---- The heap ---- */

/* The worst configuration is on top. */
static int is_worse(const void *context, int32_t a, int32_t b)
{
    const cairn_part_configurator *configurator = context;
    const cairn_part_configuration *p = &configurator->found[a], *query = &configurator->found[b];

    return p->score < query->score ||
           (p->score <= query->score &&
            configurator->exhaustive->sequence[a] > configurator->exhaustive->sequence[b]);
}

static void exchange(void *context, int32_t a, int32_t b)
{
    cairn_part_configurator *configurator = context;
    cairn_part_configuration kept = configurator->found[a];
    int64_t sequence = configurator->exhaustive->sequence[a];

    configurator->found[a] = configurator->found[b];
    configurator->found[b] = kept;
    configurator->exhaustive->sequence[a] = configurator->exhaustive->sequence[b];
    configurator->exhaustive->sequence[b] = sequence;
}

void cairn_part_configuration_exhaustive_offer(cairn_part_configurator *configurator,
                                               const part_configuration_node *node)
{
    part_configuration_exhaustive *exhaustive = configurator->exhaustive;
    int32_t most = configurator->params.max_found,
            index = heap_keep_place(configurator->found_count, most);

    if (node->part_count < configurator->params.min_parts ||
        node->weight < configurator->params.min_sum ||
        is_enumerated(configurator, node->part_count))
        return;
    exhaustive->enumerated_count++;
    if (configurator->found_count == most && !(node->weight > configurator->found[0].score))
        return;
    configurator->best.score = node->weight;
    configurator->best.node = *node;
    configurator->best.count = node->part_count;
    for (int32_t i = 0; i < node->part_count; i++)
        configurator->best.votes[i] = configurator->near_votes[configurator->tree.chosen[i]].vote;
    configurator->found[index] = cairn_part_configuration_describe(
        configurator,
        configurator->found_count < most ? index * MAX_PARTS : configurator->found[0].first);
    exhaustive->sequence[index] = exhaustive->enumerated_count;
    configurator->found_count =
        heap_keep(configurator, configurator->found_count, most, is_worse, exchange);
}

void cairn_part_configuration_exhaustive_begin_sort(cairn_part_configurator *configurator)
{
    configurator->exhaustive->sorting = heap_sorting_of_heap(configurator->found_count);
}

int cairn_part_configuration_exhaustive_sort(cairn_part_configurator *configurator,
                                             cairn_budget *budget)
{
    return heap_sort_step(&configurator->exhaustive->sorting, budget, &configurator->units_charged,
                          cairn_part_configuration_exhaustive_units(configurator), configurator,
                          is_worse, exchange);
}
