/* Records the poses of alignment methods after each iteration. */
#ifndef CAIRN_BENCH_TRACK_H
#define CAIRN_BENCH_TRACK_H

#include "bench/bench_problem.h"

enum {
    BENCH_TRACK_SAMPLES = 96, /* the start, steps 1 ... 50 by 1 and 60 ... 500 by 10 */
    BENCH_TRACK_LAST = 500
};

typedef int32_t bench_track_method;
enum {
    /* force field simulation as in the thesis, a step an iteration */
    BENCH_TRACK_GRADIENT = 0,
    /* the aligner, a step a commit point */
    BENCH_TRACK_DEFAULT = 1,
    /* sequential registration, then an iteration of Lu and Milios a step */
    BENCH_TRACK_LUM = 2,
    BENCH_TRACK_METHODS = 3
};

const char *bench_track_name(bench_track_method method);

/* Step of sample k. */
int32_t bench_track_step(int32_t k);

/* Aligns the problem from its start. as_written not 0: gradient and lum as in the thesis, lum
 * without registration and of the hits of the beams. poses: [BENCH_TRACK_SAMPLES * count], sample
 * by sample; a method that has ended keeps its poses. *steps: their number. 0 on failure, with a
 * line on standard error. */
int bench_track_run(bench_track_method method, const bench_problem *problem, int32_t as_written,
                    cairn_pose *poses, int32_t *steps);

#endif
