/* bench_calibration_fit: constants of error probabilities, fitted to decisions that were right or
 * wrong. */
#ifndef CAIRN_BENCH_CALIBRATION_FIT_H
#define CAIRN_BENCH_CALIBRATION_FIT_H

#include <stdint.h>

/* What a probability is stated from. */
typedef struct bench_evidence {
    double support, competing; /* nats, of the pose and of its best competing pose */
    double link_support;       /* nats, of the weakest link of a place */
    int32_t is_ambiguous;      /* 1: a place that the consensus reports as ambiguous */
} bench_evidence;

/* What kind of decisions: of which bench, and how the library states that one is wrong. */
typedef struct bench_calibration_kind {
    const char *bench;
    double (*probability)(const bench_evidence *evidence);
} bench_calibration_kind;

/* Reads the decisions that runs have printed from standard input, and fits the constants of the
 * probability to those of even seeds. Prints the constants, and the reliability of the probabilities
 * that were stated, that the library states now, and that the fitted constants state: of even and of
 * odd seeds. markdown: not 0: a table of what the library states now of odd seeds instead. An exit
 * code. */
int bench_calibration_fit(const bench_calibration_kind *kind, int markdown);

#endif
