/* Alignment problem of an arena: the shuffled scans of a survey at disturbed poses. */
#ifndef CAIRN_BENCH_PROBLEM_H
#define CAIRN_BENCH_PROBLEM_H

#include "bench/bench_align.h"

typedef struct bench_problem_kind {
    const char *scene;
    int64_t places, headings, beams;
    double fov;             /* degrees */
    double metres, degrees; /* disturbance, uniform +- */
    double jitter[2];       /* m, degrees, of the sensors of one place; NaN: the survey's own */
    double size[2];         /* m, of the arena; 0: the scene's own */
} bench_problem_kind;

/* 15 places with 4 headings of 100 degrees, 401 beams, in a rescue arena; 0.30 m and 20 degrees. */
bench_problem_kind bench_problem_kind_default(void);

typedef struct bench_problem {
    sim_arena *arena;
    sim_survey *survey;
    sim_scan *scans;
    sim_pose *truth, *start;
    bench_pose *poses; /* the start */
    int32_t count;
} bench_problem;

/* 0 on failure, with a line on standard error; to be closed in any case. */
int bench_problem_open(bench_problem *p, const bench_problem_kind *kind, uint64_t seed);
void bench_problem_close(bench_problem *p);

#endif
