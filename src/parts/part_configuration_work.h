/* part_configuration_work: shared definitions of the part_configuration sources. Internal to the
 * library. */
#ifndef CAIRN_PARTS_PART_CONFIGURATION_WORK_H
#define CAIRN_PARTS_PART_CONFIGURATION_WORK_H

#include "cairn/part_configuration.h"
#include "src/base/object.h"
#include "src/base/step.h"
#include "src/containers/heap.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_part_configuration_parameters;

/* Greatest number of parts of a configuration. */
enum { PART_CONFIGURATION_MAX_PARTS = 64 };
/* A point in the voting space: position (px) and scale (px per unit of the model). */
typedef struct part_configuration_vote_point {
    cairn_vec2 centre;
    cairn_real scale;
} part_configuration_vote_point;

/* A vote in the neighbourhood of the seed. x, y, log_scale: offset from the seed in tolerances.
 * squared_distance: in tolerances squared; as written that of the centres in px^2. */
typedef struct part_configuration_near_vote {
    cairn_real x, y, log_scale, squared_distance;
    int32_t vote;
} part_configuration_near_vote;

/* Votes of a bundle by descending weight: order[first ... first + count - 1]. */
typedef struct part_configuration_vote_group {
    int32_t bundle, first, count;
    cairn_real bound; /* sum of the greatest weights of this and all following groups */
} part_configuration_vote_group;

/* A node of the search tree, a partial configuration: sum of weights, weighted mean, and scatter
 * about it (sum of weight d^2). */
typedef struct part_configuration_node {
    cairn_real weight, x, y, log_scale, scatter;
    /* branch in the next group: number of its votes tried; count: the branch without a vote */
    int32_t choice;
    int32_t part_count;
} part_configuration_node;

/* State of a range query in the index. */
typedef struct part_configuration_vote_query {
    part_configuration_vote_point centre;
    /* px, cell size of the layer */
    cairn_real cell;
    int32_t layer, last_layer, x, y, min_x, max_x, max_y;
    /* next vote of the cell's bucket, and votes left in it */
    int32_t next_vote, votes_left;
    /* 1: linear scan over all votes, when it is cheaper than the cells; x is the next vote */
    int32_t is_linear_scan;
} part_configuration_vote_query;

/* State of the exhaustive enumeration: detection of configurations that an earlier seed had, and
 * the order of those found. A row has one bit per seed. */
typedef struct part_configuration_exhaustive {
    /* [max_votes * row_words] per vote: the seeds in whose neighbourhood it is, up to the current
     * one */
    uint32_t *near_seeds;
    /* [(MAX_PARTS + 1) * row_words] row k: the seeds that have the first k parts of the partial
     * configuration */
    uint32_t *common_seeds;
    /* [max_found] sequence number of each configuration found */
    int64_t *sequence;
    int64_t enumerated_count;
    int32_t row_words;
    heap_sorting sorting; /* of those found, at the end */
} part_configuration_exhaustive;

/* The search in the neighbourhood of a seed: branch and bound over one vote of each bundle. */
typedef struct part_configuration_tree {
    /* [near_count] indices in near_votes, by bundle and weight */
    int32_t order[PART_CONFIGURATION_MAX_PARTS];
    part_configuration_vote_group groups[PART_CONFIGURATION_MAX_PARTS];
    /* partial configurations, from the empty one on */
    part_configuration_node nodes[PART_CONFIGURATION_MAX_PARTS + 1];
    /* indices in near_votes of the current partial configuration */
    int32_t chosen[PART_CONFIGURATION_MAX_PARTS];
    int32_t group_count, depth, visited_count;
} part_configuration_tree;

/* The best configuration of a seed. */
typedef struct part_configuration_best {
    part_configuration_node node;
    cairn_real score;
    int32_t votes[PART_CONFIGURATION_MAX_PARTS], count;
} part_configuration_best;

struct cairn_part_configurator {
    cairn_part_configuration_params params;
    /* NULL in the default mode */
    part_configuration_exhaustive *exhaustive;

    /* The input, and the state of its search: */
    const cairn_part_configuration_vote *votes;
    /* number of votes; 1: configurations are to be found; 1: the result is complete */
    int32_t count, is_pending, is_complete;
    int32_t resume, units_charged;
    /* a bucket or a vote of the index; the vote that is the current seed */
    int32_t cursor, seed;

    /* The index of the votes: */
    uint32_t mask;
    /* [max_votes] next vote of the same bucket; scale layer of each vote */
    int32_t *next_in_bucket, *vote_layer;
    /* [mask + 1] first vote and number of votes of each bucket */
    int32_t *bucket_heads, *bucket_sizes;
    part_configuration_vote_query query;

    /* Of the current seed: */
    part_configuration_near_vote near_votes[PART_CONFIGURATION_MAX_PARTS];
    int32_t near_count, shift_count;
    part_configuration_tree tree;
    part_configuration_best best;

    /* The result: */
    /* [max_votes] modes found */
    part_configuration_vote_point *modes;
    /* [max_found] */
    cairn_part_configuration *found;
    /* [max_found * PART_CONFIGURATION_MAX_PARTS] votes of slot k from
     * k * PART_CONFIGURATION_MAX_PARTS on */
    int32_t *found_votes;
    int32_t mode_count, found_count, seed_count, truncated_count;
    int64_t node_count, pair_count;
};

/* Spatial index: a hash grid. A layer holds a range of scales as high as the search radius; its
 * cells are as wide as the search radius at its largest scale. */
void cairn_part_configuration_insert(cairn_part_configurator *configurator, int32_t vote);
void cairn_part_configuration_query(cairn_part_configurator *configurator,
                                    part_configuration_vote_point at);
/* Work units of the query's next step; 0: the query is complete. */
int32_t cairn_part_configuration_query_cost(const cairn_part_configurator *configurator);
/* Processes the next few votes of a cell. */
void cairn_part_configuration_query_next(cairn_part_configurator *configurator);

/* Builds the search tree over the nearest votes. */
void cairn_part_configuration_begin_tree(cairn_part_configurator *configurator);
/* Visits a node; depth < 0 afterwards: the search is complete. */
void cairn_part_configuration_visit_node(cairn_part_configurator *configurator);
/* Inserts the seed's best configuration into the sorted list, without duplicates. */
void cairn_part_configuration_record(cairn_part_configurator *configurator);
/* Creates a configuration from best_votes, which are sorted, and best_node; its votes are copied to
 * found_votes[first ...]. */
cairn_part_configuration cairn_part_configuration_describe(cairn_part_configurator *configurator,
                                                           int32_t first);

/* ---- As written (part_configuration_exhaustive.c) ---- */

/* The state and its arrays; NULL from a counting pool. */
part_configuration_exhaustive *
cairn_part_configuration_exhaustive_build(cairn_pool *pool,
                                          const cairn_part_configuration_params *params);
/* Clears the seeds of a vote. */
void cairn_part_configuration_exhaustive_clear(cairn_part_configurator *configurator, int32_t vote);
/* Marks the current seed in the rows of its nearest votes. */
void cairn_part_configuration_exhaustive_mark_seed(cairn_part_configurator *configurator);
/* Updates the common seeds after a part was added: the last of chosen[0 ... parts - 1]. */
void cairn_part_configuration_exhaustive_extend(cairn_part_configurator *configurator,
                                                int32_t parts);
/* Records the configuration unless an earlier seed had it or max_found better ones are recorded. */
void cairn_part_configuration_exhaustive_offer(cairn_part_configurator *configurator,
                                               const part_configuration_node *node);
/* Sorts the configurations found, of which the heap is made. 0: the budget is used up. */
void cairn_part_configuration_exhaustive_begin_sort(cairn_part_configurator *configurator);
int cairn_part_configuration_exhaustive_sort(cairn_part_configurator *configurator,
                                             cairn_budget *budget);
/* Work units of a node, and of a sort step. */
int32_t cairn_part_configuration_exhaustive_units(const cairn_part_configurator *configurator);

#endif
