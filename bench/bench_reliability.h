/* bench_reliability: how often what is said to be wrong with a probability is wrong. */
#ifndef CAIRN_BENCH_RELIABILITY_H
#define CAIRN_BENCH_RELIABILITY_H

#include <stdint.h>

enum { BENCH_RELIABILITY_BINS = 8 };

/* Counts of decisions by the probability that was stated of them. */
typedef struct bench_reliability {
    int64_t count[BENCH_RELIABILITY_BINS], wrong[BENCH_RELIABILITY_BINS];
    /* sums of the stated probabilities of each bin, and of the logarithmic losses in nats */
    double stated[BENCH_RELIABILITY_BINS], loss;
    /* decisions of at most BENCH_SURE, and of at least 1 - BENCH_SURE */
    int64_t sure, sure_wrong, denied, denied_wrong;
} bench_reliability;

/* Largest probability of an error at which a decision is said to be sure. */
#define BENCH_SURE 0.01

/* probability: that the decision is wrong, as stated; wrong: whether it is */
void bench_reliability_add(bench_reliability *r, double probability, int wrong);

/* Prints an object for each bin that is not empty, then a summary; `name` is the kind of
 * decisions. */
void bench_reliability_print(const char *bench, const char *name, const bench_reliability *r);

/* Prints the bins as rows of a table in Markdown, with its head. */
void bench_reliability_table(const bench_reliability *r);

#endif
