/* Pairwise merging of real maps, evaluated against annotated transforms. */
#ifndef CAIRN_BENCH_MAPS_H
#define CAIRN_BENCH_MAPS_H

#include "cairn/map_merge.h"

/* Rows and a summary of `halmstad/` (pairs.csv) and `parts/` (placed in the whole) in a folder.
 * `base`: mode, perception and particles; capacities are set to the maps. An exit code: 3 when the
 * data are missing. */
int bench_maps_run(const char *folder, const cairn_map_merge_params *base);

#endif
