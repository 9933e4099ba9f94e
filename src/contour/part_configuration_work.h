/* part_configuration_work: what the parts of part_configuration share. Internal to the library. */
#ifndef CAIRN_CONTOUR_PART_CONFIGURATION_WORK_H
#define CAIRN_CONTOUR_PART_CONFIGURATION_WORK_H

#include "cairn/part_configuration.h"

/* Of a configuration: parts at most. */
enum { CONFIGURATION_PARTS = 64 };
enum {
    CONFIGURATION_IDLE,
    CONFIGURATION_INDEX,
    CONFIGURATION_GATHER,
    CONFIGURATION_ENUMERATE,
    CONFIGURATION_SORT,
    CONFIGURATION_DONE
};

/* A place among the votes. */
typedef struct vote_place {
    cairn_vec2 centre;
    cairn_real scale;
} vote_place;

/* A vote near the seed: its place from there in tolerances; squared: its distance, as written
 * that of the centres in px^2. */
typedef struct near_vote {
    cairn_real x, y, ratio, squared;
    int32_t vote;
} near_vote;

/* Votes of a bundle, the greatest gain first: order[first ... first + count - 1]. */
typedef struct vote_group {
    int32_t bundle, first, count;
    cairn_real most; /* gain of this group and those behind it, each its greatest */
} vote_group;

/* A partial configuration: sums of gain, the mean by it, what its votes scatter about it (sum of
 * gain d^2). */
typedef struct configuration_node {
    cairn_real gain, x, y, ratio, scatter;
    int32_t choice; /* of the next group: votes of it that were tried; count: none of them */
    int32_t parts;
} configuration_node;

/* Where a query of the index is. */
typedef struct vote_query {
    vote_place at;
    /* px, of the layer */
    cairn_real cell;
    int32_t layer, last_layer, x, y, min_x, max_x, max_y;
    /* of the cell's bucket: the next, and how many are not looked at */
    int32_t vote, left;
    /* 1: the cells are more than the votes, which are looked at one by one; the next in x */
    int32_t all;
} vote_query;

/* As written: what tells a configuration that an earlier seed had, and the order of those found.
 * A row of bits has one for each seed. */
typedef struct configuration_every {
    /* [max_votes * words] of each vote: the seeds among whose nearest it is, up to the one that
     * is looked around */
    uint32_t *seeds;
    /* [(PARTS + 1) * words] row k: the seeds that have the first k parts of the partial
     * configuration */
    uint32_t *both;
    /* [max_found] of each one found: how many were made before */
    int64_t *age;
    int64_t made;
    /* sorted: how many of found are in their place, from the end */
    int32_t words, sorted;
} configuration_every;

struct cairn_part_configurator {
    cairn_part_configuration_params params;
    const cairn_part_vote *votes;
    /* [max_votes] the next of its bucket; its layer */
    int32_t *next, *layer;
    /* [mask + 1] */
    int32_t *heads, *sizes;
    /* [max_votes] */
    vote_place *modes;
    /* [max_found] */
    cairn_part_configuration *found;
    /* [max_found * CONFIGURATION_PARTS] of slot k those from k * PARTS on */
    int32_t *found_votes;
    uint32_t mask;
    int32_t count, indexed, seed, modes_count, climbs;
    vote_query query;
    near_vote near[CONFIGURATION_PARTS];
    int32_t near_count;
    /* of near */
    int32_t order[CONFIGURATION_PARTS];
    vote_group groups[CONFIGURATION_PARTS];
    int32_t group_count;
    configuration_node nodes[CONFIGURATION_PARTS + 1];
    /* of near, for each part */
    int32_t chosen[CONFIGURATION_PARTS];
    int32_t depth, visited;
    cairn_real best;
    configuration_node best_node;
    int32_t best_votes[CONFIGURATION_PARTS], best_count;
    int32_t found_count, seeds, cut;
    int64_t all_nodes, pairs;
    int32_t phase, paid;
    /* NULL: not as written */
    configuration_every *every;
};

/* The index. A layer holds the scales within one reach, its cells are as wide as the reach of
 * its largest. */
void cairn_part_configuration_insert(cairn_part_configurator *c, int32_t vote);
void cairn_part_configuration_query(cairn_part_configurator *c, vote_place at);
/* Units of the query's next item; 0: there is none. */
int32_t cairn_part_configuration_query_cost(const cairn_part_configurator *c);
/* Takes the next votes of a cell, a few at once, among the nearest. */
void cairn_part_configuration_query_next(cairn_part_configurator *c);

/* The tree of configurations of the nearest votes. */
void cairn_part_configuration_plant(cairn_part_configurator *c);
/* Visits a node; 0: there are no more. */
int cairn_part_configuration_visit(cairn_part_configurator *c);
/* What is found: the votes of best_votes, sorted here, with best_node; its votes go to
 * found_votes[first ...]. */
cairn_part_configuration cairn_part_configuration_describe(cairn_part_configurator *c,
                                                           int32_t first);

/* ---- As written (part_configuration_every.c) ---- */

void cairn_part_configuration_every_carve(cairn_pool *pool,
                                          const cairn_part_configuration_params *p,
                                          configuration_every **every);
/* A vote has no seeds yet. */
void cairn_part_configuration_every_clear(cairn_part_configurator *c, int32_t vote);
/* The nearest of the seed are found: they have it. */
void cairn_part_configuration_every_plant(cairn_part_configurator *c);
/* The partial configuration has one more part: the last of chosen[0 ... parts - 1]. */
void cairn_part_configuration_every_take(cairn_part_configurator *c, int32_t parts);
/* Keeps the configuration unless an earlier seed had it or max_found better ones are there. */
void cairn_part_configuration_every_offer(cairn_part_configurator *c,
                                          const configuration_node *node);
/* Puts one more of found in its place; 0: all are. */
int cairn_part_configuration_every_sort(cairn_part_configurator *c);
/* Units of a node, of one that is sorted. */
int32_t cairn_part_configuration_every_units(const cairn_part_configurator *c);

#endif
