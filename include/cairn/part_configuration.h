/* part_configuration: sets of matched parts whose votes agree on an object's centre and scale
 * (generalized Hough voting).
 *
 * Every match of a fragment votes for the object's centre and scale. Configurations are formed from
 * the nearest votes around each vote, with at most one part per bundle (Adluru 2008, section
 * 5.2.2). By default the best configuration around each vote, by weight less scatter, is a
 * hypothesis. It is found by branch and bound. As written (CAIRN_MODE_AS_WRITTEN) every
 * configuration of the K nearest votes is a hypothesis unless its summed similarity is below
 * `min_sum` (section 5.3.1): up to (K / bundles + 1)^bundles per vote, enumerated exhaustively,
 * each reported once.
 *
 * Choices of the mode as written, where the text leaves details open: nearness is measured by the
 * centres alone; the vote itself is one of the K; ties go by index; the mapping of bundles to edge
 * fragments is one to one, so no chain is used twice; the empty configuration does not count; the
 * threshold (min_sum). An upper bound of the sum prunes branches that cannot reach the threshold;
 * the pruning is exact. */
#ifndef CAIRN_PART_CONFIGURATION_H
#define CAIRN_PART_CONFIGURATION_H

#include "cairn/geometry.h"
#include "cairn/object.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Vote of a matched part for the centre and the scale of an object. */
typedef struct cairn_part_configuration_vote {
    int32_t bundle;      /* >= 0: bundle index; a configuration uses at most one vote per bundle */
    int32_t chain;       /* chain index; a configuration uses no interval of a chain twice */
    cairn_vec2 centre;   /* px, centre of the object */
    cairn_real scale;    /* px per unit of the model, > 0 */
    cairn_real weight;   /* > 0: weight of the part alone; as written its similarity */
    cairn_real from, to; /* px, interval along the chain, from <= to */
    cairn_real closed_length; /* px, length of a closed chain; 0: an open chain */
} cairn_part_configuration_vote;

/* Neighbourhoods in which configurations are searched. */
typedef int32_t cairn_part_search;
enum {
    /* configurations of the votes nearest to each vote */
    CAIRN_PART_SEARCH_NEAREST = 0,
    /* configurations of the votes nearest to each mode of the votes, found by mean shift from every
     * vote */
    CAIRN_PART_SEARCH_MODES = 1
};

/* Parameters; defaults in brackets. */
typedef struct cairn_part_configuration_params {
    /* 1 ... 2^20 (512): capacity for votes */
    int32_t max_votes;
    /* 1 ... 64 (20): K: number of nearest votes that configurations are formed from, the vote
     * itself included */
    int32_t nearest;
    /* 1 ... 64 (2): least number of parts of a configuration */
    int32_t min_parts;
    /* 1 ... 2^16 (64): capacity for configurations */
    int32_t max_found;
    /* 1 ... 2^30 (1,000,000): limit of search-tree nodes per vote: a part added, skipped or
     * removed */
    int32_t max_nodes;
    /* any (CAIRN_PART_SEARCH_NEAREST): votes that configurations are formed from */
    cairn_part_search search;
    /* units of the model, 1e-4 ... 10 (0.08): tolerance of the centre */
    cairn_real centre_tolerance;
    /* 0.01 ... 1 (0.15): tolerance of the logarithm of the scale */
    cairn_real scale_tolerance;
    /* tolerances, 0.5 ... 4 (3): radius of the neighbourhood of a vote */
    cairn_real search_radius;
    /* 0 ... 1 (0.2): two parts conflict when a greater share of the shorter one's interval lies in
     * both */
    cairn_real overlap;
    /* CAIRN_MODE_DEFAULT or CAIRN_MODE_AS_WRITTEN (CAIRN_MODE_DEFAULT): as written, search
     * must be CAIRN_PART_SEARCH_NEAREST, max_votes is at most 8192, and search_radius,
     * scale_tolerance and overlap are ignored */
    int32_t mode;
    /* 0 ... 1e6 (0): as written: least summed similarity of a configuration */
    cairn_real min_sum;
} cairn_part_configuration_params;

/* A configuration. Default mode: score is the sum over its parts of weight (1 - d^2 / 2), with d
 * the distance of a vote from the weighted mean, in tolerances. As written: score is weight_sum. */
typedef struct cairn_part_configuration {
    cairn_real score, weight_sum; /* weight_sum: sum of the weights */
    cairn_vec2 centre;            /* px, weighted mean */
    /* px per unit of the model, weighted mean */
    cairn_real scale;
    int32_t seed;         /* index of the vote whose neighbourhood it was found in */
    int32_t first, count; /* votes[first ... first + count - 1], vote indices in ascending order */
} cairn_part_configuration;

/* The configurations found, and counts of the work done. */
typedef struct cairn_part_configuration_result {
    /* [count] by descending score, without duplicates; valid until the next begin(). As written
     * ties go to the earlier seed. */
    const cairn_part_configuration *found;
    /* indices of the votes of all configurations */
    const int32_t *votes;
    /* number of configurations */
    int32_t count;
    /* votes or modes whose neighbourhoods were searched */
    int32_t seed_count;
    /* seeds whose search was truncated at max_nodes; the best configuration may be missing there */
    int32_t truncated_count;
    /* search-tree nodes of all seeds */
    int64_t node_count;
    /* pairs of votes whose distance was computed */
    int64_t pair_count;
    /* as written: enumerated configurations of at least min_sum, of which the best max_found are
     * kept; else 0 */
    int64_t enumerated_count;
} cairn_part_configuration_result;

/* Search for configurations of parts. */
typedef struct cairn_part_configurator cairn_part_configurator;

/* Returns the default parameters. */
cairn_part_configuration_params cairn_part_configuration_default(void);

/* Returns the params of CAIRN_MODE_AS_WRITTEN: K = 20, at least one part, an effectively unlimited
 * number of nodes (2^30), 4096 configurations, min_sum 0. */
cairn_part_configuration_params cairn_part_configuration_as_written(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_part_configuration_check(
    const cairn_part_configuration_params *params, cairn_object_fault *fault);

/* Returns the bytes that create() takes from the pool; 0 for params that create() would refuse. */
size_t cairn_part_configuration_memory(const cairn_part_configuration_params *params);

/* Creates a configurator in the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status
cairn_part_configuration_create(cairn_part_configurator **configurator, cairn_pool *pool,
                                const cairn_part_configuration_params *params);

/* Starts on a set of votes, which must stay valid until step() returns CAIRN_OK, and discards the
 * previous run. CAIRN_BAD_ARGUMENT: NULL (except for no votes), a negative count, an invalid vote
 * (*fault: its index), such as a position or length beyond 1e6, a scale outside 1e-6 ... 1e6, a
 * weight above 1e6. CAIRN_FULL: more than max_votes. CAIRN_NOT_FINITE: a vote (*fault: its index).
 * Cost: linear.
 *
 * votes: [count] votes */
CAIRN_CHECKED cairn_status cairn_part_configuration_begin(
    cairn_part_configurator *configurator, const cairn_part_configuration_vote *votes,
    int32_t count, cairn_fault *fault);

/* Resumes the search. CAIRN_MORE: the budget is exhausted. CAIRN_OK: the configurations are
 * complete, or nothing was begun. Cost per vote: one unit per cell of the index within the search
 * radius and per vote in the same bucket, one per node, one per four configurations found;
 * quadratic in votes that all share one position. As written: one unit per vote, twelve plus one
 * per 512 votes for each node, twelve per kept configuration. */
CAIRN_CHECKED cairn_status cairn_part_configuration_step(cairn_part_configurator *configurator,
                                                         cairn_budget *budget);

/* Returns the result; all zero until step() returns CAIRN_OK. */
cairn_part_configuration_result
cairn_part_configuration_read(const cairn_part_configurator *configurator);

#ifdef __cplusplus
}
#endif

#endif
