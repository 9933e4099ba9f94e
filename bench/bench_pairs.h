/* The pairs of scans that bench/pairs matches: of simulated arenas with exact ground truth, or of a
 * log with reference poses. */
#ifndef CAIRN_BENCH_PAIRS_H
#define CAIRN_BENCH_PAIRS_H

#include "bench/bench_views.h"

enum { BENCH_PAIRS_PLACES = 16 }; /* of an arena */

typedef struct bench_pairs_settings {
    const char *log, *truth, *scene;
    int64_t pairs, seed, partners;
    double overlap;
    int32_t simulated, places, unions, noise;
} bench_pairs_settings;

typedef struct bench_pair {
    /* of the views */
    int32_t target, query;
    /* the target is the union of these but the query, in the frame of `target` */
    int32_t first, end;
    /* covariance of the relative pose; 0: not known */
    double bound[9];
} bench_pair;

/* Views and pairs of them. */
typedef struct bench_collection {
    bench_views views;
    bench_pair *pairs;
    int32_t pair_count;
    bench_pair *unrelated;
    int32_t unrelated_count;
} bench_collection;

/* Views, pairs and unrelated pairs, at most `pairs` of each. 0: a line on standard error; free in
 * either case. */
int bench_pairs_collect(const bench_pairs_settings *settings, bench_collection *collection);

void bench_pairs_free(bench_collection *collection);

#endif
