/* sequence: longest common subsequence, local alignment (Smith and Waterman), dynamic time warping:
 * one core.
 *
 * All three look for the best path through the table of two sequences. The core needs memory
 * linear in the sequences and still gives the path (Hirschberg 1975), with a stack of its own,
 * in steps. */
#ifndef CAIRN_SEQUENCE_H
#define CAIRN_SEQUENCE_H

#include "cairn/pool.h"
#include "cairn/real.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_sequence cairn_sequence;

typedef int32_t cairn_sequence_kind;
enum {
    /* longest common subsequence: as many pairs that are alike as can be, in order */
    CAIRN_SEQUENCE_COMMON = 0,
    /* Smith and Waterman 1981: the best pieces of both, pairs by score, gaps cost */
    CAIRN_SEQUENCE_LOCAL = 1,
    /* dynamic time warping: every element paired at least once, least sum of distances */
    CAIRN_SEQUENCE_WARP = 2
};

/* Compares first[i] with second[j]: COMMON: > 0 when they are alike; LOCAL: the score of the
 * pair, of either sign; WARP: their distance, >= 0. Must be finite, below 1e9 in size, and
 * always the same. */
typedef cairn_real (*cairn_sequence_compare)(const void *context, int32_t i, int32_t j);

typedef struct cairn_sequence_params {
    cairn_sequence_kind kind;
    int32_t max_first;  /* elements, 1 ... 2^24 */
    int32_t max_second; /* elements, 1 ... 2^24 */
    cairn_real gap;     /* LOCAL: cost of an element that is left out between pairs, >= 0 */
} cairn_sequence_params;

/* COMMON, 1024 and 1024 elements, gap 1. */
cairn_sequence_params cairn_sequence_default(void);

typedef struct cairn_sequence_pair {
    int32_t first, second;
} cairn_sequence_pair;

typedef struct cairn_sequence_result {
    /* [count], in order; valid until the next begin() */
    const cairn_sequence_pair *pairs;
    int32_t count;
    /* COMMON: the number of pairs; LOCAL: scores less gaps; WARP: the sum of distances */
    cairn_real score;
} cairn_sequence_result;

/* 0 for params that create() would refuse. */
size_t cairn_sequence_memory(const cairn_sequence_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_sequence_create(cairn_sequence **sequence, cairn_pool *pool,
                                                 const cairn_sequence_params *params);

/* Starts; what ran before is dropped. `context` must stay until step() returns CAIRN_OK.
 * CAIRN_BAD_ARGUMENT: NULL (context may be NULL), a negative count. CAIRN_FULL: more elements
 * than the params say. Constant time. */
CAIRN_CHECKED cairn_status cairn_sequence_begin(cairn_sequence *sequence, int32_t first_count,
                                                int32_t second_count,
                                                cairn_sequence_compare compare,
                                                const void *context);

/* CAIRN_OK: the result stands. CAIRN_MORE: go on. CAIRN_BAD_ARGUMENT: NULL. One unit is one
 * comparison: about twice as many as there are cells in the table, three times for LOCAL. */
CAIRN_CHECKED cairn_status cairn_sequence_step(cairn_sequence *sequence, cairn_budget *budget);

/* Empty until step() returns CAIRN_OK. Of equally good paths always the same one is given. */
cairn_sequence_result cairn_sequence_read(const cairn_sequence *sequence);

#ifdef __cplusplus
}
#endif

#endif
