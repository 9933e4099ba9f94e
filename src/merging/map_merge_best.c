/* map_merge: the best of several mergings of the same maps, with coarser and coarser cells. */
#include "src/base/build.h"

#include "cairn/map_merge.h"

/* Cells of the longest side of all maps: maximum of the first merging, minimum of those after it. */
enum { MIN_SIDE_CELLS = 175, MAX_SIDE_CELLS = 800 };

/* Maximum error probability of a placement that is sure. */
#define MAX_SURE_ERROR_PROBABILITY CAIRN_REAL(0.01)

int32_t cairn_map_merge_next_coarsening(int32_t k, int32_t longest_side)
{
    int32_t next = k + (k + 1) / 2;

    if (k == 0)
        return (longest_side - 1) / MAX_SIDE_CELLS + 1;
    return longest_side / next >= MIN_SIDE_CELLS ? next : 0;
}

int32_t cairn_map_merge_is_better(const cairn_map_merge_result *result,
                                  const cairn_map_merge_result *best)
{
    return result->placed > best->placed ||
           (result->placed == best->placed &&
            result->log_likelihood_ratio > best->log_likelihood_ratio);
}

int32_t cairn_map_merge_is_sure(const cairn_map_merge_placed *placed)
{
    return placed->error_probability <= MAX_SURE_ERROR_PROBABILITY;
}
