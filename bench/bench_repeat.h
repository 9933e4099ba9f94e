/* Perceptual aliasing: a building with two identical rooms; the place of its second map is
 * ambiguous without a third one. */
#ifndef CAIRN_BENCH_REPEAT_H
#define CAIRN_BENCH_REPEAT_H

#include "bench/bench_parts.h"

/* Three maps. The first covers all of room 0 but only the nearer part of room 2, its duplicate; the
 * second one all of room 2 and the area behind it; the third one covers the area behind both and
 * overlaps with the first. Against the first map alone the second fits better into room 0, which is
 * wrong. 0 on failure, with a line on standard error. */
int bench_repeat_make(uint64_t seed, double resolution, bench_parts *parts);

#endif
