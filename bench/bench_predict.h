/* bench_predict: rank correlation of map quality measures with pose errors. */
#ifndef CAIRN_BENCH_PREDICT_H
#define CAIRN_BENCH_PREDICT_H

#include <stdint.h>

/* measure, error: [arenas][methods][steps] */
typedef struct bench_predict_maps {
    const double *measure, *error;
    int32_t arenas, methods, steps;
    double good; /* maps of greater errors are ignored */
} bench_predict_maps;

typedef struct bench_prediction {
    double rho, low, high; /* NaN: too few maps */
    int64_t maps;
} bench_prediction;

/* Spearman's rank correlation over the maps of all arenas and methods after the same number of
 * steps; the mean over the steps, weighted by their maps. The interval of 95 % is by 1000 bootstrap
 * draws of arenas. 0 when memory is insufficient. */
int bench_predict(const bench_predict_maps *all, uint64_t seed, bench_prediction *p);

/* Writes its keys, each prefixed with the name, into the open line of JSON. */
void bench_predict_print(const char *name, const bench_prediction *p);

#endif
