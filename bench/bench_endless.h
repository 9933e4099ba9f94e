/* Long-term operation in bounded memory: a robot drives laps through an arena; every new scan is
 * aligned with the stored scans, and the most redundant scan is removed. Or online SLAM by the
 * mapper on a path driven forward and back. */
#ifndef CAIRN_BENCH_ENDLESS_H
#define CAIRN_BENCH_ENDLESS_H

#include "sim/arena.h"

typedef struct bench_endless_options {
    sim_scene scene;
    uint64_t seed;
    int64_t scans;          /* in all */
    int32_t places;         /* of a lap */
    int32_t variants;       /* poses at each place, visited in turn */
    int32_t kept;           /* scans in the map; the first defines the map */
    double noise;           /* m, of every range, new in every lap */
    double metres, degrees; /* bound of the odometry errors from place to place, uniform */
} bench_endless_options;

/* A rescue arena, 100000 scans from 30 places, 32 kept, 0.01 m, 0.03 m and 1 degree. */
bench_endless_options bench_endless_default(void);

/* Results of a lap. Errors are those of a scan's first pose, relative to the truth. */
typedef struct bench_endless_lap {
    int64_t lap;
    /* the first that began with full memory */
    int32_t is_first;
    int32_t scans, kept;
    /* of budget */
    int64_t units;
    /* work units of the most expensive scan */
    int64_t worst;
    /* scans, and of these ... */
    int32_t released;
    /* ... removed scans that were the oldest, except the first, and ... */
    int32_t oldest;
    /* ... removed scans that had just arrived */
    int32_t newest;
    /* m */
    double mean, most;
    double most_degrees;
    /* of the mapper's graph, at the end */
    int32_t loops, links;
    /* m: the largest difference of the error at a place from that of the first lap in full
     * memory */
    double away;
    double seconds;
    /* bytes */
    uint64_t pool_used;
} bench_endless_lap;

/* Calls report for every lap. 0 on failure, with a line on standard error. */
int bench_endless_run(const bench_endless_options *options,
                      void (*report)(void *context, const bench_endless_lap *lap), void *context);

/* The same with the mapper and keyframe culling: a lap is a drive of places / 2 scans, one every
 * 0.3 m or 0.3 rad, and the same backwards; at most `kept` keyframes; the odometry error per step
 * of 0.3 m is at most `metres` and `degrees`. */
int bench_endless_map(const bench_endless_options *options,
                      void (*report)(void *context, const bench_endless_lap *lap), void *context);

#endif
