/* A building in which a room is furnished twice alike: where its second map belongs only a third
 * one tells. */
#ifndef CAIRN_BENCH_REPEAT_H
#define CAIRN_BENCH_REPEAT_H

#include "bench/bench_parts.h"

/* Three maps. The first has seen all of room 0 but the nearer part of room 2, its twin; the
 * second one all of room 2 and what lies behind it; the third one what lies behind both and a
 * part of what the first one has seen. Beside the first map alone the second fits better into
 * room 0, where it does not belong. 0 on failure, with a line on standard error. */
int bench_repeat_make(uint64_t seed, double resolution, bench_parts *parts);

#endif
