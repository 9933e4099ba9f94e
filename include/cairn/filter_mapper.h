/* filter_mapper: from scans to poses by a Rao-Blackwellized particle filter.
 *
 * A mapper without loops and force field goes ahead: it says how the robot moved from key scan to
 * key scan, better than any odometry does. Every key scan is a step of a particle_filter. A
 * particle is a path of key scans, and a map of its own with it: the key scans where this path has
 * them. A particle matches the new key scan against its own map, once against what it saw lately
 * and once against what it saw there long ago; candidates are drawn around both places and weighed
 * by how well the scan lies on both maps and how far they are from the motion. A loop is closed by
 * the particles whose paths fit when it ends; no path is corrected afterwards. On public logs more
 * than one particle betters headings at most, not places (docs/accuracy.md, "What the particles are
 * worth").
 *
 *     add(scan) -> step(budget) until CAIRN_OK -> best(), path() ... */
#ifndef CAIRN_FILTER_MAPPER_H
#define CAIRN_FILTER_MAPPER_H

#include "cairn/mapper.h"
#include "cairn/particle_filter.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The most key scans of a particle's local map. */
#define CAIRN_FILTER_MAPPER_LOCAL_MOST 32

/* The most candidates of a particle. */
#define CAIRN_FILTER_MAPPER_CANDIDATES_MOST 64

typedef struct cairn_filter_mapper cairn_filter_mapper;

typedef struct cairn_filter_mapper_params {
    /* that goes ahead; its window and loop.max_loops are taken as 0 */
    cairn_mapper_params front;
    /* 1 ... 4096; particles times front.max_keys at most 2^28 (30) */
    int32_t particles;
    /* of a particle at a key scan, 1 ... CAIRN_FILTER_MAPPER_CANDIDATES_MOST (6) */
    int32_t candidates;
    /* of the scan that are weighed, >= 1 (60) */
    int32_t points;
    /* of the recent map, and of the old one, 1 ... CAIRN_FILTER_MAPPER_LOCAL_MOST (10) */
    int32_t local_keys;
    /* of either, 1 ... 2^20; key scans that do not fit in are left out, farthest first (2048) */
    int32_t max_local_points;
    /* key scans that are recent, >= 1; the others are old (25) */
    int32_t span;
    /* m, > 0: key scans are at most so far (4) */
    cairn_real local_radius;
    /* the motion is wrong by this share of the way, >= 0 ... */
    cairn_real motion_distance;
    /* ... and of the turn, >= 0 (0.05 and 0.05), ... */
    cairn_real motion_turn;
    /* ... and at least by this, m, > 0 (0.02) ... */
    cairn_real motion_distance_min;
    /* ... and this, rad, > 0 (0.01) */
    cairn_real motion_turn_min;
    /* m, > 0: standard deviation that a match has at least ... (0.0025) */
    cairn_real match_sigma;
    /* ... rad, > 0 (0.001) */
    cairn_real match_sigma_turn;
    /* a match counts when this share of the scan's points has partners, in [0, 1] (0.3) */
    cairn_real min_support;
    /* m, > 0: of a point across the wall that it lies on (0.07) */
    cairn_real sigma;
    /* > 0: a point off all walls is as unlikely as one exp(-this) of the density on them (3) */
    cairn_real outlier;
    /* > 0: of a scan, in independent points; what its points share is not noise (8) */
    cairn_real weight;
    /* of what is drawn (1) */
    uint64_t seed;
} cairn_filter_mapper_params;

/* The values in brackets; the mapper as its own default. */
cairn_filter_mapper_params cairn_filter_mapper_default(void);

/* The same for so many key scans of a scanner of so many beams, and so many particles; see
 * cairn_mapper_default_for(). */
cairn_filter_mapper_params cairn_filter_mapper_default_for(int32_t max_keys, int32_t max_beams,
                                                           int32_t particles);

/* 0 for params that create() would refuse. */
size_t cairn_filter_mapper_memory(const cairn_filter_mapper_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_filter_mapper_create(cairn_filter_mapper **mapper,
                                                      cairn_pool *pool,
                                                      const cairn_filter_mapper_params *params);

/* Takes in the next scan: as cairn_mapper_add(), with its statuses. CAIRN_MORE when the scan
 * before is still being worked on. */
CAIRN_CHECKED cairn_status cairn_filter_mapper_add(cairn_filter_mapper *mapper,
                                                   const cairn_scan_input *input,
                                                   const cairn_pose *odometry, cairn_fault *fault);

/* Goes on with the scan at hand. CAIRN_MORE: the budget is used up. CAIRN_OK: the scan is done.
 * CAIRN_FULL as cairn_mapper_step(). A key scan costs for every particle two alignments of icp,
 * a unit for 8 key scans of its path, a unit for two points of its local maps, and two for every
 * point that is weighed, of every candidate on either map. */
CAIRN_CHECKED cairn_status cairn_filter_mapper_step(cairn_filter_mapper *mapper,
                                                    cairn_budget *budget);

/* ---- Reading: when step() has returned CAIRN_OK ---- */

/* The mapper that goes ahead: on which key scan each scan hangs and where it is seen from there,
 * its points, what was measured. Its key poses are those of the motion alone. */
const cairn_mapper *cairn_filter_mapper_front(const cairn_filter_mapper *mapper);

/* Particles now; 0 before the first scan. */
int32_t cairn_filter_mapper_count(const cairn_filter_mapper *mapper);

/* The particle whose path explains all scans best (ties: the lower index); -1 before the first
 * scan. Linear in the particles. */
int32_t cairn_filter_mapper_best(const cairn_filter_mapper *mapper);

/* The last key scan of a particle in the map; the identity when there is no such particle.
 * Constant time. */
cairn_pose cairn_filter_mapper_last(const cairn_filter_mapper *mapper, int32_t particle);

/* poses[0 ... returned - 1] = the key scans along a particle's path; the first `room` of them
 * where there are more. 0 when there is no such particle. Linear in the key scans. */
int32_t cairn_filter_mapper_path(const cairn_filter_mapper *mapper, int32_t particle,
                                 cairn_pose *poses, int32_t room);

/* Measurements; of the mapper that goes ahead see there. */
typedef struct cairn_filter_mapper_state {
    int32_t keys;              /* steps of the filter and one */
    int32_t resamplings;       /* so far */
    cairn_real n_eff;          /* of the last step, before it was resampled */
    int64_t returns;           /* matches on an old map, of all particles */
    int32_t nodes, nodes_peak; /* of the tree of paths */
    int64_t units;             /* of budget, of the mapper that goes ahead included */
} cairn_filter_mapper_state;

cairn_filter_mapper_state cairn_filter_mapper_measure(const cairn_filter_mapper *mapper);

#ifdef __cplusplus
}
#endif

#endif
