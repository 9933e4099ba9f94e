/* sequence: alignment of two sequences by dynamic programming: longest common subsequence (LCS),
 * local alignment (Smith and Waterman), dynamic time warping (DTW).
 *
 * All three find the best path through the table of both sequences. The memory is linear in the
 * lengths, and the path is still found, by divide and conquer (Hirschberg 1975) in bounded steps,
 * without recursion. */
#ifndef CAIRN_SEQUENCE_H
#define CAIRN_SEQUENCE_H

#include "cairn/object.h"
#include "cairn/pool.h"
#include "cairn/real.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Alignment of two sequences. */
typedef struct cairn_sequence cairn_sequence;

/* Kind of alignment. */
typedef int32_t cairn_sequence_kind;
enum {
    /* Longest common subsequence: the largest number of matching pairs, in order. */
    CAIRN_SEQUENCE_LCS = 0,
    /* Local alignment of the best-scoring subsequences, with linear gap costs (Smith and Waterman
     * 1981). */
    CAIRN_SEQUENCE_LOCAL = 1,
    /* Dynamic time warping: every element is paired at least once, with the least sum of distances
     * (Sakoe and Chiba 1978). */
    CAIRN_SEQUENCE_DTW = 2
};

/* Compares element i of the first sequence with element j of the second. LCS: > 0 when both match.
 * LOCAL: score of the pair, of either sign. DTW: distance, >= 0. The value must be finite, below
 * 1e9 in magnitude, and the same in every call.
 *
 * context: that of begin()
 * i, j: indices of the elements, from 0 */
typedef cairn_real (*cairn_sequence_compare)(const void *context, int32_t i, int32_t j);

/* Parameters; defaults in brackets. */
typedef struct cairn_sequence_params {
    /* any (CAIRN_SEQUENCE_LCS): kind of alignment */
    cairn_sequence_kind kind;
    /* 1 ... 2^24 (1024): elements of the first sequence */
    int32_t max_first;
    /* 1 ... 2^24 (1024): elements of the second sequence */
    int32_t max_second;
    /* 0 ... 1e9 (1): kind LOCAL: cost of an unpaired element between pairs */
    cairn_real gap_cost;
} cairn_sequence_params;

/* Returns the default parameters. */
cairn_sequence_params cairn_sequence_default(void);

/* Indices of a pair of elements. */
typedef struct cairn_sequence_pair {
    /* index in the first and in the second sequence */
    int32_t first, second;
} cairn_sequence_pair;

/* Alignment. */
typedef struct cairn_sequence_result {
    /* [count] Pairs in ascending order; valid until the next begin(). */
    const cairn_sequence_pair *pairs;
    /* Number of pairs. */
    int32_t count;
    /* LCS: number of pairs; LOCAL: sum of the scores minus the gap costs; DTW: sum of distances. */
    cairn_real score;
} cairn_sequence_result;

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_sequence_check(const cairn_sequence_params *params,
                                                cairn_object_fault *fault);

/* Bytes that create() allocates. 0 for params that create() would refuse. */
size_t cairn_sequence_memory(const cairn_sequence_params *params);

/* Creates an object in a pool. CAIRN_BAD_ARGUMENT: NULL, or params out of range. CAIRN_NO_MEMORY:
 * the pool has too few bytes left. A failure changes nothing. */
CAIRN_CHECKED cairn_status cairn_sequence_create(cairn_sequence **sequence, cairn_pool *pool,
                                                 const cairn_sequence_params *params);

/* Starts an alignment. An alignment that runs is discarded. `context` is passed to compare() and
 * must stay until step() returns CAIRN_OK. CAIRN_BAD_ARGUMENT: NULL (context may be NULL), a
 * negative count. CAIRN_FULL: more than max_first or max_second elements. Constant time.
 *
 * first_count, second_count: numbers of elements, 0 ... max_first and max_second
 * compare: compares two elements
 * context: passed to compare() */
CAIRN_CHECKED cairn_status cairn_sequence_begin(cairn_sequence *sequence, int32_t first_count,
                                                int32_t second_count,
                                                cairn_sequence_compare compare,
                                                const void *context);

/* Works until the budget is used up. CAIRN_OK: the result is complete. CAIRN_MORE: call again.
 * CAIRN_BAD_ARGUMENT: NULL. Cost: one unit per comparison; in all about twice the number of cells
 * of the table, three times for LOCAL. */
CAIRN_CHECKED cairn_status cairn_sequence_step(cairn_sequence *sequence, cairn_budget *budget);

/* The result. Empty until step() returns CAIRN_OK. Ties between paths are broken the same way in
 * every run. */
cairn_sequence_result cairn_sequence_read(const cairn_sequence *sequence);

#ifdef __cplusplus
}
#endif

#endif
