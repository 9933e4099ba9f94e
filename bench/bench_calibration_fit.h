/* bench_calibration_fit: constants of error probabilities, fitted to decisions that were right or
 * wrong. */
#ifndef CAIRN_BENCH_CALIBRATION_FIT_H
#define CAIRN_BENCH_CALIBRATION_FIT_H

#include <stddef.h>
#include <stdint.h>

/* No probability is stated or fitted below it. */
#define BENCH_LEAST_PROBABILITY 1e-3

/* What a probability is stated from. */
typedef struct bench_evidence {
    double support, competing; /* nats, of the pose and of its best competing pose */
    double link_support;       /* nats, of the weakest link of a place */
    int32_t is_ambiguous;      /* 1: a place that the consensus reports as ambiguous */
    /* of a loop closure: cairn_mapper_loop_evidence */
    double path_sigma, prior_distance, competing_score, free_space_violation;
} bench_evidence;

typedef struct bench_decision {
    int64_t seed;
    double stated; /* error probability */
    bench_evidence evidence;
    int32_t wrong;
} bench_decision;

typedef struct bench_decisions {
    bench_decision *list;
    size_t count, capacity;
} bench_decisions;

enum { BENCH_CONSTANTS = 5 };

/* A model of error probabilities with `constants` constants. */
typedef struct bench_calibration_model {
    const char *bench;
    int32_t constants;
    const char *names[BENCH_CONSTANTS];
    /* the probability that the library states */
    double (*stated)(const bench_evidence *evidence);
    /* the same, with other constants; NaN for constants out of their range */
    double (*probability)(const bench_evidence *evidence, const double *constants);
    /* constants for the decisions of even seeds */
    void (*fit)(const struct bench_calibration_model *model, const bench_decisions *all,
                double *constants);
} bench_calibration_model;

/* Sum of the logarithmic losses of the decisions of even seeds; *sure, unless NULL: how many of them
 * are sure. */
double bench_calibration_loss(const bench_calibration_model *model, const bench_decisions *all,
                              const double *constants, int64_t *sure);

/* Constants of least loss of even seeds, from those given: by coordinate search, the steps
 * halved. */
void bench_calibration_search(const bench_calibration_model *model, const bench_decisions *all,
                              double *constants);

/* Reads the decisions that runs have printed from standard input, and fits the constants of a model
 * to those of even seeds. Prints the constants, and the reliability of the probabilities that were
 * stated, that the library states now, and that the fitted constants state: of even and of odd
 * seeds. markdown: not 0: a table of what the library states now of odd seeds instead. An exit code. */
int bench_calibration_fit(const bench_calibration_model *model, int markdown);

#endif
