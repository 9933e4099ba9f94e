/* bench_closures: whether the error probabilities of loop closures are true, on generated drives. */
#ifndef CAIRN_BENCH_CLOSURES_H
#define CAIRN_BENCH_CLOSURES_H

#include "bench/bench_calibration_fit.h"
#include "cairn/mapper.h"

/* A drive whose closures are decisions. */
typedef struct bench_closures_drive {
    int64_t seed;
    const char *scene;
    int32_t movers, no_odometry;
} bench_closures_drive;

/* The drive of a seed: one of eight scenes, each as likely; among five people, without odometry or
 * neither, each as likely. */
bench_closures_drive bench_closures_drive_of(int64_t seed);

/* Prints the object of an accepted closure. */
void bench_closures_print(const bench_closures_drive *drive, const cairn_mapper_loop *loop,
                          int32_t wrong);

/* The model of the error probability of closures, for bench_calibration_fit(). */
bench_calibration_model bench_calibration_of_closures(void);

#endif
