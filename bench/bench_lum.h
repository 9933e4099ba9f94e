/* Lu and Milios on simulated scans. */
#ifndef CAIRN_BENCH_LUM_H
#define CAIRN_BENCH_LUM_H

#include "cairn/lum.h"
#include "sim/arena.h"

typedef struct bench_lum_run {
    cairn_lum *lum;
    void *memory;
    size_t pool_bytes;
} bench_lum_run;

/* Fits the scans and begins to align them from the poses: link distance 0.20 m, links looked for anew every `rebuild`
 * iterations, at most `iterations`. 1, or 0 after a line on standard error; bench_lum_end() in any case. */
int bench_lum_begin(bench_lum_run *run, const sim_scan *scans, int32_t count, const sim_pose *poses, int32_t iterations,
                    int32_t rebuild);
void bench_lum_end(bench_lum_run *run);

/* From ranges to poses. 1, or 0 after a line on standard error. */
int bench_lum_align(const sim_scan *scans, int32_t count, int32_t iterations, int32_t rebuild, sim_pose *poses,
                    int32_t *steps, size_t *pool_bytes);

#endif
