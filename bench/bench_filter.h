/* Runs the particle filter mapper (filter_mapper) over a log, and over scans in another order. */
#ifndef CAIRN_BENCH_FILTER_H
#define CAIRN_BENCH_FILTER_H

#include "cairn/carmen_log.h"
#include "cairn/filter_mapper.h"

typedef struct bench_filter {
    int32_t particles;
    uint64_t seed;
    int32_t no_odometry, shape_prior;
    double seconds;
    size_t pool_bytes;
    cairn_mapper_state front;
    cairn_filter_mapper_state state;
} bench_filter;

/* Maps the log; poses: [count] of the robot along the best path, units: [count] work units of each
 * scan. 0 on failure, with a line on standard error. */
int bench_filter_map(bench_filter *run, const cairn_carmen_log_scans *log, cairn_pose *poses,
                     double *units);

#endif
