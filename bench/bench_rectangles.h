/* Test scenes of the rectangle detector: 60 % of the sides as noisy segments among clutter
 * segments. */
#ifndef CAIRN_BENCH_RECTANGLES_H
#define CAIRN_BENCH_RECTANGLES_H

#include <stdint.h>

/* Looks for them as virtual_scan does. Adds how many there were, how many were found, and how
 * many others. 0 on failure. */
int bench_rectangles_find(uint64_t seed, int32_t *there, int32_t *found, int32_t *wrong);

#endif
