/* Initial poses of scans from nothing: the scans of each place are matched as a whole with those of all other places. */
#ifndef CAIRN_BENCH_CHAIN_H
#define CAIRN_BENCH_CHAIN_H

#include "bench/bench_align.h"

/* poses: [count], of the scans in the frame of the map; those of places that found no other one lie where their place begins.
 * How the scans of a place lie to its first one is known up to error (m and degrees, uniform +-, by the seed), nothing else.
 * 0 on failure, with a line on standard error. */
int bench_chain_start(const sim_scan *scans, int32_t count, const double error[2], uint64_t seed, bench_pose *poses);

#endif
