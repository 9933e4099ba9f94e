/* bench_calibration: whether the error probabilities of map merging are true, on pairs of maps of
 * generated arenas; and the fit of their constants. */
#ifndef CAIRN_BENCH_CALIBRATION_H
#define CAIRN_BENCH_CALIBRATION_H

#include "cairn/map_merge.h"

/* Merges the two maps of each of `seeds` arenas, from `seed` on: of six scenes, with overlaps of 5
 * to 40 %, tiles of 6 to 10 m (larger where the scene has to be), true and distorted, and every fourth
 * map of another arena. Prints an object for each pair of which a pose was found, and the
 * reliability of odd seeds. An exit code. */
int bench_calibration_run(const cairn_map_merge_params *base, int64_t seeds, int64_t seed);

/* Reads the decisions that runs have printed from standard input, and fits the constants of
 * cairn_map_merge_error_probability() to those of even seeds. Prints the constants, and the
 * reliability of the probabilities that were stated, that the library states now, and that the
 * fitted constants state: of even and of odd seeds. markdown: not 0: a table of what the library
 * states now of odd seeds instead. An exit code. */
int bench_calibration_fit(int markdown);

#endif
