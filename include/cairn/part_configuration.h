/* part_configuration: parts of an object that agree where it is and how large.
 *
 * Every match of a fragment votes for the object's centre and scale. Of the votes nearest to each
 * one configurations are made, of each bundle one part or none (Adluru 2008, section 5.2.2). By
 * default the best one near each vote, by gain less scatter, is a hypothesis. As written
 * (CAIRN_MODE_AS_WRITTEN) all configurations of the K nearest of every vote are, those whose
 * similarities sum to less than `min_sum` left out (section 5.3.1): (K / bundles + 1)^bundles for
 * each vote, gone through exhaustively, each one once.
 *
 * Choices of the mode as written, where the text is silent: votes are near by their centres
 * alone, the vote itself is one of the K, equally near ones by their index; the mapping of
 * bundles to edge fragments is one to one, so that no chain is used twice; the empty
 * configuration is none; the threshold (min_sum). Sums are bounded from above while
 * configurations are gone through, so that what cannot reach the threshold is left out at once:
 * nothing is lost by that. */
#ifndef CAIRN_PART_CONFIGURATION_H
#define CAIRN_PART_CONFIGURATION_H

#include "cairn/geometry.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_part_vote {
    int32_t bundle;      /* >= 0: of those of the same bundle at most one is used */
    int32_t chain;       /* and no piece of a chain twice */
    cairn_vec2 centre;   /* px, of the object */
    cairn_real scale;    /* px for a unit of the model, > 0 */
    cairn_real gain;     /* > 0: what the part is worth alone; as written its similarity */
    cairn_real from, to; /* px along the chain, from <= to */
    cairn_real round;    /* px, of a closed chain: its length; 0: it is open */
} cairn_part_vote;

typedef int32_t cairn_part_seek;
enum {
    /* configurations of the votes nearest to each vote */
    CAIRN_PART_SEEK_NEAREST = 0,
    /* nearest to each mode of the votes only, to which every vote climbs by mean shift */
    CAIRN_PART_SEEK_MODES = 1
};

typedef struct cairn_part_configuration_params {
    /* 1 ... 2^20 (512) */
    int32_t max_votes;
    /* K: votes that configurations are made of, itself among them, 1 ... 64 (20) */
    int32_t nearest;
    /* of a configuration, 1 ... 64 (2) */
    int32_t min_parts;
    /* configurations that are kept, 1 ... 2^16 (64) */
    int32_t max_found;
    /* 1 ... 2^30: steps of the search through the configurations of one vote: a part taken,
     * refused or given back (1,000,000) */
    int32_t max_nodes;
    /* (NEAREST) */
    cairn_part_seek seek;
    /* tolerance of the centre, in units of the model, 1e-4 ... 10 (0.08) */
    cairn_real centre;
    /* tolerance of the logarithm of the scale, 0.01 ... 1 (0.15) */
    cairn_real ratio;
    /* tolerances within which a vote is near, 0.5 ... 4 (3) */
    cairn_real reach;
    /* 0 ... 1: two parts use a piece of a chain twice when more of the shorter one is in both
     * (0.2) */
    cairn_real overlap;
    /* CAIRN_MODE_DEFAULT or CAIRN_MODE_AS_WRITTEN, which has neither seek, reach, ratio nor
     * overlap, and max_votes up to 8192 (DEFAULT). */
    int32_t mode;
    /* >= 0, as written: of the similarities of a configuration; below it is left out (0) */
    cairn_real min_sum;
} cairn_part_configuration_params;

/* As written score is gain. By default score: the sum of gain (1 - d^2 / 2) over its parts, d:
 * how far a vote is from the mean of all, by gain, in tolerances. */
typedef struct cairn_part_configuration {
    cairn_real score, gain; /* gain: the sum alone */
    cairn_vec2 centre;      /* px, the mean */
    cairn_real scale;
    int32_t seed;         /* the vote near which it lies */
    int32_t first, count; /* votes[first ... first + count - 1], indices in ascending order */
} cairn_part_configuration;

typedef struct cairn_part_configuration_result {
    /* [count] the best first, no two of the same votes; valid until the next begin(). As written
     * of equal ones that of the earlier seed. */
    const cairn_part_configuration *found;
    const int32_t *votes;
    int32_t count;
    /* votes or modes that were looked around */
    int32_t seeds;
    /* of these: more than max_nodes; there the best may be missing */
    int32_t cut;
    /* steps of the searches, */
    int64_t nodes;
    /* and pairs of votes whose distance was measured */
    int64_t pairs;
    /* as written: configurations of min_sum or more, of which the best max_found are kept; else
     * 0 */
    int64_t made;
} cairn_part_configuration_result;

typedef struct cairn_part_configurator cairn_part_configurator;

/* The values in brackets above. */
cairn_part_configuration_params cairn_part_configuration_default(void);

/* CAIRN_MODE_AS_WRITTEN: K = 20, one part and more, no limit of nodes that matters (2^30), 4096
 * configurations, min_sum 0. */
cairn_part_configuration_params cairn_part_configuration_as_written(void);

/* 0 for params that create() would refuse. */
size_t cairn_part_configuration_memory(const cairn_part_configuration_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status
cairn_part_configuration_create(cairn_part_configurator **configurator, cairn_pool *pool,
                                const cairn_part_configuration_params *params);

/* Starts on votes, which must stay until step() returns CAIRN_OK. What ran before is dropped.
 * CAIRN_BAD_ARGUMENT: NULL (but for no votes), a negative count, a vote that is not as said
 * above (*fault: which). CAIRN_FULL: more than max_votes. CAIRN_NOT_FINITE: a place or length
 * beyond 1e6, a scale outside 1e-6 ... 1e6, a gain above 1e6. Cost: linear. */
CAIRN_CHECKED cairn_status cairn_part_configuration_begin(cairn_part_configurator *configurator,
                                                          const cairn_part_vote *votes,
                                                          int32_t count, cairn_fault *fault);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: the configurations stand, or nothing was
 * begun. For each vote: one for each cell of the index that is within reach and each vote that
 * shares its bucket, one for each node, one for four of those found; so quadratic in votes that
 * all lie at one place. As written one for each vote, twelve and one for 512 votes for each
 * node, twelve for each that is kept. */
CAIRN_CHECKED cairn_status cairn_part_configuration_step(cairn_part_configurator *configurator,
                                                         cairn_budget *budget);

/* All zero until step() returns CAIRN_OK. */
cairn_part_configuration_result
cairn_part_configuration_read(const cairn_part_configurator *configurator);

#ifdef __cplusplus
}
#endif

#endif
