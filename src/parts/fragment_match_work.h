/* Internal structures of module fragment_match. */
#ifndef CAIRN_PARTS_FRAGMENT_MATCH_WORK_H
#define CAIRN_PARTS_FRAGMENT_MATCH_WORK_H

#include "cairn/fragment_match.h"
#include "cairn/sequence.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_fragment_match_parameters;

/* Quantized directions per turn; score of an equal pair; chain samples of the traceback window
 * for each fragment sample; capacity of fragment samples. */
enum {
    FRAGMENT_MATCH_DIRECTIONS = 1024,
    FRAGMENT_MATCH_SCORE_UNIT = 1024,
    FRAGMENT_MATCH_WINDOW_RATIO = 3,
    FRAGMENT_MATCH_MAX_SAMPLES = 64
};
/* The end of an alignment: its last chain sample (column), sampling step (level) and score. */
typedef struct fragment_match_alignment_end {
    int32_t score, level, chain, reversed, column;
} fragment_match_alignment_end;

struct cairn_fragment_matcher {
    cairn_part_bundle_model model;
    const cairn_curve *chains;
    /* [max_chains] Length of each chain, px. */
    cairn_real *length;
    /* [2 * max_fragments * samples_per_fragment] Direction codes, forward and reversed. */
    int16_t *fragment_code;
    /* [max_samples] Samples of the current chain, px, and their unit tangents. */
    cairn_vec2 *positions, *direction;
    /* [max_samples] Direction codes of the chain. */
    int16_t *chain_code;
    /* [max_fragments * matches_per_fragment] Best alignment ends of each fragment. */
    fragment_match_alignment_end *ends;
    /* [max_fragments] */
    int32_t *end_count;
    /* [max_fragments * matches_per_fragment] */
    cairn_fragment_match *matches;
    /* Traceback of an alignment. */
    cairn_sequence *aligner;
    /* Score by quantized direction difference, in 1 / FRAGMENT_MATCH_SCORE_UNIT. */
    int32_t gain[FRAGMENT_MATCH_DIRECTIONS];
    /* Factor by which the scale range is widened on both sides, >= 1. */
    cairn_real scale_slack;
    /* In 1 / FRAGMENT_MATCH_SCORE_UNIT; min_score: least score of a match. */
    int32_t gap_score, min_score;
    /* Least number of samples of a chain. */
    int32_t min_samples;
    int32_t chain_count;
    int32_t match_count, candidate_count;
    int64_t cell_count;

    /* 1: matches are to be found; 1: the result is complete. */
    int32_t is_pending, is_complete;
    /* Resume point, and units charged for the next operation. */
    int32_t resume, units_charged;
    /* Current and last sampling step, px. */
    cairn_real step, last_step;
    /* Index of the sampling step; current chain and fragment. */
    int32_t level, chain, fragment;
    /* Samples of the chain; closed: it wraps around; columns including the extension. */
    int32_t sample_count, closed, column_count;
    /* State of both halves of the method, which do not overlap. */
    union {
        /* Search for alignment ends: orientation and column; best score of the chain and its
         * column, -1: none; column of the Smith-Waterman table. */
        struct {
            int32_t reversed, current_column, best_score, best_column;
            int32_t dp_column[FRAGMENT_MATCH_MAX_SAMPLES];
        };
        /* Traceback: index in the alignment ends of the fragment. */
        int32_t next_end;
    };
    cairn_fragment_match_params params;
};

/* Returns the quantized direction, 0 ... FRAGMENT_MATCH_DIRECTIONS - 1. */
static inline int16_t cairn_fragment_match_quantize(cairn_vec2 direction)
{
    cairn_real parts =
        cairn_atan2(direction.y, direction.x) * (FRAGMENT_MATCH_DIRECTIONS / (2 * CAIRN_PI));

    return (int16_t)((uint32_t)cairn_real_to_int(cairn_rint(parts)) &
                     (FRAGMENT_MATCH_DIRECTIONS - 1));
}

/* Returns the direction codes of a fragment, forward or reversed. */
static inline int16_t *cairn_fragment_match_codes(const cairn_fragment_matcher *matcher,
                                                  int32_t fragment, int32_t reversed)
{
    return &matcher->fragment_code[(size_t)(2 * fragment + reversed) *
                                   (size_t)matcher->model.samples_each];
}

#endif
