/* Initial poses of scans without a prior: every place is matched as a whole with all other places,
 * or as written by shape with the three previous places. */
#ifndef CAIRN_BENCH_CHAIN_H
#define CAIRN_BENCH_CHAIN_H

#include "bench/bench_align.h"

/* poses: [count], of the scans in the frame of the map; those of unmatched places are at the origin
 * of their place. Known are the poses of the scans of a place relative to its first one, up to
 * error (m and degrees, uniform +-, by the seed), and as written the heading of all places up to 2
 * degrees (uniform); nothing else. 0 on failure, with a line on standard error. */
int bench_chain_start(const sim_scan *scans, int32_t count, int32_t as_written,
                      const double error[2], uint64_t seed, bench_pose *poses);

/* ---- Place after place, as written (section 7.3.6) ---- */

typedef struct bench_chain bench_chain;

/* NULL: a line on standard error. scans and error stay the caller's. */
bench_chain *bench_chain_open(const sim_scan *scans, int32_t count, int32_t as_written,
                              const double error[2], uint64_t seed);
void bench_chain_close(bench_chain *chain);

/* Adds the next place, matched with the current poses of those before it, and sets the poses of its
 * scans. Returns how many scans have been added; they are (*order)[0], (*order)[1] ... 0: there is
 * no other place; -1: a line on standard error. */
int32_t bench_chain_next(bench_chain *chain, bench_pose *poses, const int32_t **order);

/* Moves scan (*order)[k]. */
cairn_status bench_chain_move(bench_chain *chain, int32_t k, cairn_pose pose);

#endif
