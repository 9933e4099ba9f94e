/* Common interface of the methods of batch scan alignment: scans and initial poses in, poses with
 * covariances and verdicts out. */
#ifndef CAIRN_BENCH_ALIGN_H
#define CAIRN_BENCH_ALIGN_H

#include "cairn/scan.h"
#include "sim/arena.h"

/* A component of a method that can be left out. */
typedef enum bench_ingredient {
    BENCH_ALL,
    BENCH_NO_DIRECTIONS, /* surfaces without a free side */
    BENCH_NO_FREE_SPACE, /* no free-space violations */
    BENCH_NO_RESTARTS,   /* unplaced scans are not searched again */
    BENCH_NO_JOINT,      /* no walls, no covariances */
    BENCH_INGREDIENTS
} bench_ingredient;

const char *bench_ingredient_name(bench_ingredient without); /* "nothing", "directions" ... */

typedef struct bench_pose {
    sim_pose pose;
    double covariance[9];
    int32_t known;   /* 1: covariance and flagged are valid */
    int32_t flagged; /* the method reports low confidence of the pose */
    int32_t anchor;  /* fixed by the linear system of the method: not counted */
} bench_pose;

typedef struct bench_run {
    int32_t steps, rising; /* rising: steps that raised a potential that should fall */
    double seconds, step_ms;
    size_t pool_bytes;
    int64_t units;      /* of budget, and ... */
    int32_t worst_step; /* ... of the most expensive work item; 0: the method counts none */
    double point_pairs, segment_pairs; /* mean of an iteration; 0: no force field simulation */
    int32_t corners_dropped; /* most of an iteration, beyond the capacity of the force field */
} bench_run;

/* Fits a scan's lines. */
cairn_status bench_fit_scan(cairn_scan *scan, const sim_scan *from, cairn_scan_view *view);

/* The default mode; poses: the start, then the result. [count]. 0 on failure, with a line on
 * standard error. */
int bench_run_default(const sim_scan *scans, int32_t count, bench_ingredient without,
                      bench_pose *poses, bench_run *run);

/* Simultaneous nearest neighbour: every scan by ICP against all others, in turn, `sweeps` times. */
int bench_run_icp(const sim_scan *scans, int32_t count, int32_t sweeps, bench_pose *poses,
                  bench_run *run);

#endif
