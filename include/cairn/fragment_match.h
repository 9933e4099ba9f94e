/* fragment_match: local alignment of a model's outline fragments to an image's edge chains.
 *
 * Method:
 * 1. Fragments and chains are sampled evenly, the chain at many scales. Each sample is a quantized
 *    tangent direction. Shapes are upright; a chain is tried in both orientations.
 * 2. Smith-Waterman local alignment of the two sequences (dynamic programming).
 * 3. A least-squares fit to the aligned samples gives the scale of the object and its centroid.
 *
 * Source: Adluru 2008, section 5.2.2. */
#ifndef CAIRN_FRAGMENT_MATCH_H
#define CAIRN_FRAGMENT_MATCH_H

#include "cairn/curve.h"
#include "cairn/object.h"
#include "cairn/part_bundle.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Parameters; defaults in brackets. */
typedef struct cairn_fragment_match_params {
    /* 1 ... 65536 (CAIRN_PART_MAX_FRAGMENTS): capacity of fragments of a model */
    int32_t max_fragments;
    /* 2 ... 64 (20): capacity of samples of a fragment */
    int32_t samples_per_fragment;
    /* 1 ... 2^24 (10,000): capacity of chains */
    int32_t max_chains;
    /* 4 ... 2^20 (4096): capacity of samples of a chain at min_step */
    int32_t max_samples;
    /* 1 ... 64 (2): matches kept for each fragment, each on a different chain */
    int32_t matches_per_fragment;
    /* px per unit of the model, > 0, <= 1e6 (24 and 800): range of scales, min_scale <= max_scale.
     * A range narrower than step_ratio is widened to step_ratio about its centre. */
    cairn_real min_scale, max_scale;
    /* px, 0.5 ... 1e6 (1.5): smallest sampling step of a chain */
    cairn_real min_step;
    /* 1.05 ... 2 (1.19): ratio of consecutive sampling steps */
    cairn_real step_ratio;
    /* rad, 0.02 ... pi (pi/8): difference of two directions at which a pair scores 0 */
    cairn_real zero_score_angle;
    /* 0.5 ... 4 (0.5): cost of a skipped sample, relative to the gain of an equal pair */
    cairn_real gap_cost;
    /* > 0, <= 1 (0.5): least similarity of a match */
    cairn_real min_similarity;
} cairn_fragment_match_params;

/* A local alignment of a fragment and a chain. */
typedef struct cairn_fragment_match {
    /* Indices of the fragment and the chain. */
    int32_t fragment, chain;
    /* 1: the chain's points run against the orientation of the outline. */
    int32_t reversed;
    /* Number of aligned samples. */
    int32_t pair_count;
    /* Alignment score (gains less gap costs) divided by the fragment's samples, 0 ... 1. */
    cairn_real similarity;
    /* Scale, px per unit of the model, from an upright least-squares fit to the pairs. */
    cairn_real scale;
    /* Predicted centroid of the model, px. */
    cairn_vec2 centroid;
    /* Root mean square residual of the fitted pairs, px. */
    cairn_real rms_residual;
    /* Arc length along the chain from its first point, px; on a closed chain `to` may exceed its
     * length. */
    cairn_real from, to;
} cairn_fragment_match;

/* The matches of all fragments, and counts of the work done. */
typedef struct cairn_fragment_match_result {
    /* [count] Sorted by fragment, then by decreasing similarity; valid until the next begin(). */
    const cairn_fragment_match *matches;
    /* Number of matches. */
    int32_t count;
    /* Number of alignments before those without a scale, or with one outside min_scale ...
     * max_scale, were dropped. */
    int32_t candidate_count;
    /* Number of evaluated cells of the alignment tables. */
    int64_t cell_count;
} cairn_fragment_match_result;

/* Matcher of outline fragments to edge chains. */
typedef struct cairn_fragment_matcher cairn_fragment_matcher;

/* Returns the default parameters. */
cairn_fragment_match_params cairn_fragment_match_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_fragment_match_check(const cairn_fragment_match_params *params,
                                                      cairn_object_fault *fault);

/* Returns the memory of a matcher in bytes; 0 for params that create() rejects. */
size_t cairn_fragment_match_memory(const cairn_fragment_match_params *params);

/* Creates a matcher. CAIRN_BAD_ARGUMENT: invalid params. CAIRN_NO_MEMORY: the pool is too small. */
CAIRN_CHECKED cairn_status cairn_fragment_match_create(cairn_fragment_matcher **matcher,
                                                       cairn_pool *pool,
                                                       const cairn_fragment_match_params *params);

/* Starts on a model (its fragments, samples and centroid) and the edge chains of an image, px,
 * and discards the previous result. Both must stay valid until step() returns CAIRN_OK. Chains
 * of fewer than two points or of zero length match nothing; so do fragments of zero length.
 * Ties: the larger scale wins, then the chain of lower index. CAIRN_BAD_ARGUMENT: NULL (chains
 * may be NULL if chain_count is 0), a negative count, fewer than 2 samples of a fragment, a
 * coordinate or a fragment's length beyond 1e6, a negative length. CAIRN_FULL: fragments, samples
 * or chains beyond the capacities, a chain longer than max_samples steps of min_step.
 * CAIRN_NOT_FINITE: a coordinate, a fragment's length. Cost: linear.
 *
 * chains: [chain_count] edge chains, px
 * model: fragments, samples and centroid of the model */
CAIRN_CHECKED cairn_status cairn_fragment_match_begin(cairn_fragment_matcher *matcher,
                                                      const cairn_part_bundle_model *model,
                                                      const cairn_curve *chains,
                                                      int32_t chain_count);

/* Resumes the computation. CAIRN_MORE: the budget is used up. CAIRN_OK: the matches are
 * complete, or nothing was begun. Cost: about 1 unit a sample for each sampling step and each
 * chain that is long enough, charged at once; 1 unit for eight cells for each fragment at a
 * scale within the range; for each match about 9 units for a fragment sample times the samples,
 * and 1 for four pairs. */
CAIRN_CHECKED cairn_status cairn_fragment_match_step(cairn_fragment_matcher *matcher,
                                                     cairn_budget *budget);

/* Returns the matches. All zero until step() returns CAIRN_OK. */
cairn_fragment_match_result cairn_fragment_match_read(const cairn_fragment_matcher *matcher);

#ifdef __cplusplus
}
#endif

#endif
