/* Test scenes of the rectangle detector: 60 % of the sides as noisy segments among clutter
 * segments. */
#ifndef CAIRN_BENCH_RECTANGLES_H
#define CAIRN_BENCH_RECTANGLES_H

#include <stdint.h>

/* Searches as virtual_scan does. Adds the numbers of true rectangles, of those found, and of false
 * ones. 0 on failure. */
int bench_rectangles_find(uint64_t seed, int32_t *there, int32_t *found, int32_t *wrong);

#endif
