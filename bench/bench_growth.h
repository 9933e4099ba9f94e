/* How the cost of the default method grows with the scans, which stand as densely in all: in an
 * arena (small), in one of twice its width and height with four times its places (large), and in
 * a quarter of that one (part): the scans nearest to the one that is farthest from the middle. A
 * small arena's own walls cut short what its scans see; those of the part are as those of the
 * large arena. */
#ifndef CAIRN_BENCH_GROWTH_H
#define CAIRN_BENCH_GROWTH_H

#include "bench/bench_problem.h"

/* Prints an object for each arena, with the seconds (least of three runs each, taken in turn)
 * and units of all, and one of the medians over the arenas of what the large one takes over that
 * of the other two. 0 on failure, with a line on standard error. */
int bench_growth(const bench_problem_kind *kind, int64_t arenas, int64_t seed);

#endif
