/* fragment_match: which pieces of an image's edges run like a fragment of a model's outline.
 *
 * Directions along both are aligned locally (Smith and Waterman), the chain taken in either
 * sense and at many scales, upright. What is aligned says how large the object would be and
 * where its centre would lie (Adluru 2008, section 5.2.2). */
#ifndef CAIRN_FRAGMENT_MATCH_H
#define CAIRN_FRAGMENT_MATCH_H

#include "cairn/curve.h"
#include "cairn/part_bundle.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_fragment_match_params {
    int32_t max_fragments; /* of a model, 1 ... 65536 (CAIRN_PART_FRAGMENTS) */
    int32_t samples_each;  /* of a fragment at most, 2 ... 64 (20) */
    int32_t max_chains;    /* 1 ... 2^24 (10,000) */
    int32_t max_samples;   /* of a chain at min_step, 4 ... 2^20 (4096) */
    int32_t matches_each;  /* kept of a fragment, each on a chain of its own, 1 ... 64 (2) */
    /* px for a unit of the model, 0 < min <= max <= 1e6 (24 ... 800); limits that are nearer to
     * each other than step_ratio stand for limits about them that are as far apart as that. */
    cairn_real min_scale, max_scale;
    /* px, >= 0.5: chains are sampled at steps of this and more (1.5) */
    cairn_real min_step;
    /* from one step to the next, 1.05 ... 2 (1.19) */
    cairn_real step_ratio;
    /* rad, 0.02 ... pi: so far apart, directions speak neither for nor against each other (pi/8) */
    cairn_real turn;
    /* 0.5 ... 4: cost of a sample that is left out, of what one gains that agrees (0.5) */
    cairn_real gap;
    /* > 0 ... 1 (0.5) */
    cairn_real min_similarity;
} cairn_fragment_match_params;

/* A fragment where a chain runs like it. */
typedef struct cairn_fragment_match {
    int32_t fragment, chain;
    /* 1: the chain's points run against the outline */
    int32_t reversed;
    /* samples that are aligned */
    int32_t pairs;
    /* 0 ... 1: what they gain less the gaps, over the samples of the fragment */
    cairn_real similarity;
    /* px for a unit of the model, by least squares of the pairs, upright */
    cairn_real scale;
    /* px, where the model's centroid lies */
    cairn_vec2 centre;
    /* px, root mean square of what the pairs lie apart then */
    cairn_real off;
    /* px along the chain, from its first point; of a closed one `to` may lie beyond its length */
    cairn_real from, to;
} cairn_fragment_match;

typedef struct cairn_fragment_match_result {
    /* [count] by fragment, its best first; valid until the next begin() */
    const cairn_fragment_match *matches;
    int32_t count;
    /* before those went whose scale is none, or beyond min_scale or max_scale */
    int32_t kept;
    /* pairs of samples that were compared */
    int64_t cells;
} cairn_fragment_match_result;

typedef struct cairn_fragment_matcher cairn_fragment_matcher;

/* The values in brackets above. */
cairn_fragment_match_params cairn_fragment_match_default(void);

/* 0 for params that create() would refuse. */
size_t cairn_fragment_match_memory(const cairn_fragment_match_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_fragment_match_create(cairn_fragment_matcher **matcher,
                                                       cairn_pool *pool,
                                                       const cairn_fragment_match_params *params);

/* Starts on a model (its fragments, samples and centroid) and the edge chains of an image, px;
 * both must stay until step() returns CAIRN_OK. What ran before is dropped. Chains of fewer than
 * two points or without length match nothing; so do fragments without length. Equal matches: the
 * larger scale is the better one, then the chain of the lower index. CAIRN_BAD_ARGUMENT: NULL
 * (chains may be NULL when there are none), a negative count, fewer than 2 samples to a
 * fragment. CAIRN_FULL: more fragments, samples, chains than the params say, a chain longer than
 * max_samples steps of min_step. CAIRN_NOT_FINITE: a coordinate that is not finite, or beyond
 * 1e6; a fragment's length that is not finite, negative or beyond 1e6. Cost: linear. */
CAIRN_CHECKED cairn_status cairn_fragment_match_begin(cairn_fragment_matcher *matcher,
                                                      const cairn_part_model *model,
                                                      const cairn_curve *chains,
                                                      int32_t chain_count);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: the matches stand, or nothing was begun.
 * For each step that a fragment needs and each chain that is long enough about a unit a sample,
 * paid at once, and for each fragment at a scale within the limits one for eight cells; then for
 * each match about nine for a sample of the fragment times samples, and one for four pairs. */
CAIRN_CHECKED cairn_status cairn_fragment_match_step(cairn_fragment_matcher *matcher,
                                                     cairn_budget *budget);

/* All zero until step() returns CAIRN_OK. */
cairn_fragment_match_result cairn_fragment_match_read(const cairn_fragment_matcher *matcher);

#ifdef __cplusplus
}
#endif

#endif
