/* How the cost of the default method grows with the scans: arenas, and arenas of twice their width and height with four
 * times their places, so that the scans stand as densely. */
#ifndef CAIRN_BENCH_GROWTH_H
#define CAIRN_BENCH_GROWTH_H

#include "bench/bench_problem.h"

/* Prints an object for each arena, with the seconds (least of three runs each, taken in turn) and units of both, and one
 * of the medians over the arenas. 0 on failure, with a line on standard error. */
int bench_growth(const bench_problem_kind *kind, int64_t arenas, int64_t seed);

#endif
