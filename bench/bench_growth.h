/* Growth of the cost of the default method with the number of scans at equal density: in an arena
 * (small), in one of twice its width and height with four times its places (large), and in a
 * quarter of that one (part): the scans nearest to the one that is farthest from the middle. The
 * walls of a small arena shorten the visible ranges; scans of the part see as far as those of the
 * large arena. */
#ifndef CAIRN_BENCH_GROWTH_H
#define CAIRN_BENCH_GROWTH_H

#include "bench/bench_problem.h"

/* Prints an object for each arena: the seconds (least of three runs each, taken in turn) and units.
 * Prints one object of medians over the arenas: the cost ratios of the large arena to the other
 * two. 0 on failure, with a line on standard error. */
int bench_growth(const bench_problem_kind *kind, int64_t arenas, int64_t seed);

#endif
