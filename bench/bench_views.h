/* Copies of scans after line fitting, for the benches of scan matching. */
#ifndef CAIRN_BENCH_VIEWS_H
#define CAIRN_BENCH_VIEWS_H

#include "cairn/scan_match.h"

typedef struct bench_view {
    cairn_scan_match_part part; /* points, dense points, beams: all owned by the views */
    cairn_segment *segments;
    int32_t segment_count;
    cairn_pose truth; /* world_base */
    int32_t scan;     /* number in the log or in the survey */
} bench_view;

typedef struct bench_views {
    bench_view *at; /* [count] */
    int32_t count, capacity;
    cairn_scan *scan; /* that fits */
    void *memory;
} bench_views;

/* Views of scans of up to `beams` beams, at most `capacity`. 0: memory is insufficient. */
int bench_views_start(bench_views *views, int32_t capacity, int32_t beams);

/* Fits a scan and keeps it. 0 and a line on standard error on failure. */
int bench_views_add(bench_views *views, const cairn_scan_input *input, cairn_pose truth,
                    int32_t scan);

void bench_views_free(bench_views *views);

/* Maximum numbers of points and dense points of one view. */
void bench_views_most(const bench_views *views, int32_t *points, int32_t *dense);

#endif
