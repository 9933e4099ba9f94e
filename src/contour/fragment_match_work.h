/* fragment_match_work: what the parts of fragment_match share. Internal to the library. */
#ifndef CAIRN_CONTOUR_FRAGMENT_MATCH_WORK_H
#define CAIRN_CONTOUR_FRAGMENT_MATCH_WORK_H

#include "cairn/fragment_match.h"
#include "cairn/sequence.h"

/* Of a turn; what a pair of the same direction gains; samples before the end of an alignment for
 * each of the fragment's. */
enum {
    FRAGMENT_DIRECTIONS = 1024,
    FRAGMENT_UNIT = 1024,
    FRAGMENT_WINDOW = 3,
    FRAGMENT_SAMPLES_EACH_MOST = 64
};
enum {
    FRAGMENT_IDLE,
    FRAGMENT_SAMPLE,
    FRAGMENT_ALIGN,
    FRAGMENT_TRACE,
    FRAGMENT_PAIR,
    FRAGMENT_FIT,
    FRAGMENT_DONE
};

/* The end of an alignment: behind row and column. */
typedef struct kept_match {
    int32_t score, level, chain, reversed, column;
} kept_match;

struct cairn_fragment_matcher {
    cairn_fragment_match_params params;
    cairn_part_model model;
    const cairn_curve *chains;
    /* [max_chains] px */
    cairn_real *length;
    /* [2 * max_fragments * samples_each] as they run, then reversed */
    int16_t *fragment_code;
    /* [max_samples] of the chain */
    cairn_vec2 *places, *direction;
    /* [max_samples] */
    int16_t *chain_code;
    /* [max_fragments * matches_each] */
    kept_match *kept;
    /* [max_fragments] */
    int32_t *kept_count;
    /* [max_fragments * matches_each] */
    cairn_fragment_match *matches;
    cairn_sequence *pairing;
    int32_t gain[FRAGMENT_DIRECTIONS];
    int32_t column[FRAGMENT_SAMPLES_EACH_MOST];
    /* >= 1: that the limits of the scale are beyond themselves */
    cairn_real slack;
    /* parts of FRAGMENT_UNIT; of a similarity */
    int32_t gap, least;
    /* samples of a chain at least */
    int32_t need;
    /* px */
    cairn_real step, last;
    int32_t level, chain_count, chain, fragment, reversed;
    /* of the chain, and how many are gone through */
    int32_t samples, closed, columns;
    int32_t at, best, best_at;
    /* of the fragment's kept matches */
    int32_t next;
    int32_t match_count, kept_all;
    int64_t cells;
    int32_t phase, paid;
};

/* A direction in parts of a turn. */
static inline int16_t cairn_fragment_match_code(cairn_vec2 direction)
{
    cairn_real parts =
        cairn_atan2(direction.y, direction.x) * (FRAGMENT_DIRECTIONS / (2 * CAIRN_PI));

    return (int16_t)((uint32_t)cairn_real_to_int(cairn_rint(parts)) & (FRAGMENT_DIRECTIONS - 1));
}

/* Those of a fragment as it runs, or reversed. */
static inline int16_t *cairn_fragment_match_codes(const cairn_fragment_matcher *m, int32_t fragment,
                                                  int32_t reversed)
{
    return &m->fragment_code[(size_t)(2 * fragment + reversed) * (size_t)m->model.samples_each];
}

#endif
