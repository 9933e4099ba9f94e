/* Lu and Milios on simulated scans. */
#ifndef CAIRN_BENCH_LUM_H
#define CAIRN_BENCH_LUM_H

#include "bench/bench_align.h"

/* Variants of Lu and Milios. */
typedef int32_t bench_lum_way;
enum {
    /* links of 0.20 m and 60 degrees, searched anew every 5 iterations */
    BENCH_LUM_ALONE = 0,
    /* the same after sequential registration */
    BENCH_LUM_REGISTERED = 1,
    /* cairn_lum_as_written(), of the hits of the beams */
    BENCH_LUM_AS_WRITTEN = 2
};

/* Points that Lu and Milios as written pair: the hits of a scan's beams. points:
 * [view->beam_count]. Returns their number. */
int32_t bench_lum_hits(const cairn_scan_view *view, cairn_oriented_point *points);

/* At most `iterations` of them. poses: the start, then the result; scans without links to the first
 * one's component are flagged. 0 on failure, with a line on standard error. */
int bench_run_lum(const sim_scan *scans, int32_t count, int32_t iterations, bench_lum_way way,
                  bench_pose *poses, bench_run *run);

#endif
