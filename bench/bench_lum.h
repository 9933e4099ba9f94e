/* Lu and Milios on simulated scans. */
#ifndef CAIRN_BENCH_LUM_H
#define CAIRN_BENCH_LUM_H

#include "bench/bench_align.h"

/* Links of 0.20 m, looked for anew every 5 iterations, at most `iterations`; registers: 1 with sequential registration
 * first. poses: the start, then the result; scans that no links join to the first are flagged. 0 on failure, with a line on
 * standard error. */
int bench_run_lum(const sim_scan *scans, int32_t count, int32_t iterations, int registers, bench_pose *poses,
                  bench_run *run);

#endif
