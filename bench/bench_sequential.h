/* Sequential mapping: sparse scans in the order of the log, with the disturbed poses as odometry,
 * by the mapper. */
#ifndef CAIRN_BENCH_SEQUENTIAL_H
#define CAIRN_BENCH_SEQUENTIAL_H

#include "bench/bench_align.h"

/* particles: of filter_mapper; 0: by the mapper. poses: the start, then the result. 0 on
 * failure, with a line on standard error. */
int bench_run_sequential(const sim_scan *scans, int32_t count, int32_t particles, bench_pose *poses,
                         bench_run *run);

#endif
