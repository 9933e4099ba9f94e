/* part_configuration: the record of the configurations found. part_configuration.c describes it. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/ranked_list.h"
#include "src/parts/part_configuration_work.h"

static int32_t *votes_of(const cairn_part_configurator *configurator, int32_t slot)
{
    return &configurator->found_votes[(size_t)configurator->found[slot].first];
}

static int is_duplicate(const cairn_part_configurator *configurator, int32_t slot)
{
    return configurator->found[slot].count == configurator->best.count &&
           memcmp(votes_of(configurator, slot), configurator->best.votes,
                  (size_t)configurator->best.count * sizeof *configurator->best.votes) == 0;
}

static void sort_votes(cairn_part_configurator *configurator)
{
    for (int32_t i = 1; i < configurator->best.count; i++) {
        int32_t v = configurator->best.votes[i], k = i;

        for (; k > 0 && configurator->best.votes[k - 1] > v; k--)
            configurator->best.votes[k] = configurator->best.votes[k - 1];
        configurator->best.votes[k] = v;
    }
}

cairn_part_configuration cairn_part_configuration_describe(cairn_part_configurator *configurator,
                                                           int32_t first)
{
    const part_configuration_node *node = &configurator->best.node;
    cairn_part_configuration configuration;

    sort_votes(configurator);
    configuration.score = configurator->best.score;
    configuration.weight_sum = node->weight;
    configuration.scale = configurator->query.centre.scale *
                          cairn_exp(node->log_scale * configurator->params.scale_tolerance);
    configuration.centre.x =
        configurator->query.centre.centre.x +
        node->x * configurator->params.centre_tolerance * configurator->query.centre.scale;
    configuration.centre.y =
        configurator->query.centre.centre.y +
        node->y * configurator->params.centre_tolerance * configurator->query.centre.scale;
    configuration.seed = configurator->seed;
    configuration.first = first;
    configuration.count = configurator->best.count;
    memcpy(&configurator->found_votes[first], configurator->best.votes,
           (size_t)configuration.count * sizeof *configurator->best.votes);
    return configuration;
}

void cairn_part_configuration_record(cairn_part_configurator *configurator)
{
    cairn_part_configuration configuration;
    ranked_list found = {.entries = configurator->found,
                         .count = &configurator->found_count,
                         .capacity = configurator->params.max_found,
                         .entry_bytes = sizeof configuration,
                         .score_at = offsetof(cairn_part_configuration, score)};
    int32_t index = 0, first = configurator->found_count * PART_CONFIGURATION_MAX_PARTS;

    /* The votes' memory of the one that it replaces, a duplicate or the last of a full list, becomes
     * its own. */
    sort_votes(configurator);
    while (index < configurator->found_count && !is_duplicate(configurator, index))
        index++;
    if (index == configurator->params.max_found)
        index--;
    if (index < configurator->found_count) {
        if (!(configurator->best.score > configurator->found[index].score))
            return;
        first = configurator->found[index].first;
        ranked_list_remove(&found, index);
    }
    configuration = cairn_part_configuration_describe(configurator, first);
    (void)ranked_list_add(&found, &configuration);
}
