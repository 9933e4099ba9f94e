/* Replaces the poses of a log by noise, to prove that a program does not use them. */
#ifndef CAIRN_BENCH_NOISE_H
#define CAIRN_BENCH_NOISE_H

#include "cairn/carmen_log.h"

/* All poses of the log, within 10 m and 3 rad of the origin; the sensor's pose on the robot,
 * too. */
void bench_noise_poses(cairn_carmen_log_scans *log, uint64_t seed);

#endif
