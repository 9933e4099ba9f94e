/* bench_calibration: whether the error probabilities of map merging are true, on pairs of maps of
 * generated arenas. */
#ifndef CAIRN_BENCH_CALIBRATION_H
#define CAIRN_BENCH_CALIBRATION_H

#include "bench/bench_calibration_fit.h"
#include "cairn/map_merge.h"

/* Merges the two maps of each of `seeds` arenas, from `seed` on: of six scenes, with overlaps of 5
 * to 40 %, tiles of 6 to 10 m (larger where the scene has to be), true and distorted, and every fourth
 * map of another arena. Prints an object for each pair of which a pose was found, and the
 * reliability of odd seeds. An exit code. */
int bench_calibration_run(const cairn_map_merge_params *base, int64_t seeds, int64_t seed);

/* The model of the error probability of maps, for bench_calibration_fit(). */
bench_calibration_model bench_calibration_of_maps(void);

#endif
