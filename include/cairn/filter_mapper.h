/* filter_mapper: SLAM by a Rao-Blackwellized particle filter (FastSLAM, grid-free).
 *
 * Method.
 *
 * 1. A front-end mapper without loop closure and force field estimates the motion from keyframe to
 *    keyframe by scan matching.
 * 2. Every keyframe is a step of a particle_filter. A particle is a path of keyframe poses. Its map
 *    consists of the keyframes at these poses.
 * 3. Proposal: the particle matches the new keyframe by ICP against the older part of its own map,
 *    within the drift since that part was left. Candidate poses are drawn around the matches, which
 *    close a loop, and around the pose by the motion alone.
 *    With shape_prior it also starts where the shapes of scan and map are alike.
 * 4. Weight: a candidate is weighted by the scan's likelihood on the old map and by the drift.
 * 5. The drift between loops is a Gaussian, which needs no particles: when a particle closes a loop,
 *    its path along the loop is corrected in closed form.
 *
 * Ablation (docs/lab/particles.md): ten particles are as good as thirty. One maps Intel as well, and
 * ACES and Freiburg 079 less accurately. shape_prior gains nothing on these logs.
 *
 * Limits: a closed loop keeps its shape; what is corrected later moves it as a whole. A loop is
 * sought within local_radius of the expected pose, from starts at most 2.8 m from it along the
 * longest axis of the drift, whatever the drift: with a larger one a loop may stay open. The drift
 * since a keyframe is the difference of two drifts since the first one: in float, on a straight way
 * of 500 keyframes at 0.5 m its variance across the way is right within 0.2 %, on one of 1,000 it is
 * off by 4 %, of 2,000 by half; where it is lost, that of the last motion is taken.
 *
 *     add(scan) -> step(budget) until CAIRN_OK -> best(), path() ... */
#ifndef CAIRN_FILTER_MAPPER_H
#define CAIRN_FILTER_MAPPER_H

#include "cairn/mapper.h"
#include "cairn/object.h"
#include "cairn/particle_filter.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Maximum number of keyframes in a particle's local map. */
#define CAIRN_FILTER_MAPPER_MAX_LOCAL_KEYFRAMES 32

/* Maximum number of candidate poses per particle. */
#define CAIRN_FILTER_MAPPER_MAX_CANDIDATES 64

/* SLAM by a Rao-Blackwellized particle filter. */
typedef struct cairn_filter_mapper cairn_filter_mapper;

/* Parameters; defaults in brackets. */
typedef struct cairn_filter_mapper_params {
    /* front-end mapper; its window and loop.max_loops are taken as 0 */
    cairn_mapper_params front;
    /* 1 ... 4096 (30): particles of the filter; particles times front.max_keyframes is at most
     * 2^28 */
    int32_t particles;
    /* 4 ... CAIRN_FILTER_MAPPER_MAX_CANDIDATES (6): candidate poses per particle and keyframe: at
     * least one of each of the three matches and of the motion */
    int32_t candidates;
    /* >= 1 (60): points of a scan that its likelihood uses */
    int32_t scored_points;
    /* 1 ... CAIRN_FILTER_MAPPER_MAX_LOCAL_KEYFRAMES (10): keyframes of the old map */
    int32_t local_keyframes;
    /* 1 ... 2^20 (2048): capacity for points of the old map; keyframes beyond it are left out,
     * farthest first */
    int32_t max_local_points;
    /* >= 1 (25): number of most recent keyframes, which do not belong to the old map */
    int32_t recent_keyframes;
    /* m, 0.001 ... 1000 (4): maximum distance of keyframes in the old map */
    cairn_real local_radius;
    /* m per m, 0 ... 10 (0.02): noise of a motion, added to the covariance of its match: standard
     * deviation of translation per metre travelled */
    cairn_real motion_distance;
    /* rad per rad, 0 ... 10 (0.02): standard deviation of rotation per radian turned */
    cairn_real motion_turn;
    /* m, 0.0001 ... 100 (0.01): minimum standard deviation of translation */
    cairn_real motion_distance_min;
    /* rad, 0.00001 ... 3 (0.004): minimum standard deviation of rotation */
    cairn_real motion_turn_min;
    /* m, 0.0001 ... 100 (0.0025): standard deviation added to a match */
    cairn_real match_sigma;
    /* rad, 0.00001 ... 3 (0.001): likewise in heading */
    cairn_real match_sigma_theta;
    /* 0 ... 1 (0.3): minimum overlap of a valid match: share of the scan's points with a
     * correspondence */
    cairn_real min_overlap;
    /* m, 0.001 ... 100 (0.07): standard deviation of a point normal to its wall, in the likelihood field */
    cairn_real sigma;
    /* nats, 0.001 ... 1000 (3): cost of a point off all walls, and greatest cost of a point */
    cairn_real max_point_cost;
    /* 0.001 ... 1000000 (8): effective number of independent points per scan, since errors of neighbours
     * correlate */
    cairn_real independent_points;
    /* 0 or 1 (0): 1: shape prior (Adluru 2008, 6.6): the match against the old map also starts at
     * the pose that the shapes of the scan and of the nearest old keyframe give (scan_match, mode
     * SHAPE), where the drift allows it */
    int32_t shape_prior;
    /* any (1): seed of the random generator */
    uint64_t seed;
} cairn_filter_mapper_params;

/* Returns the default parameters; front has the mapper's own. */
cairn_filter_mapper_params cairn_filter_mapper_default(void);

/* Returns the defaults sized for max_keyframes keyframes of a scanner with max_beams beams, and
 * `particles` particles; see cairn_mapper_default_for().
 *
 * max_keyframes: capacity for keyframes, >= 1
 * max_beams: most beams of a scan, >= 1
 * particles: number of particles, >= 1 */
cairn_filter_mapper_params cairn_filter_mapper_default_for(int32_t max_keyframes, int32_t max_beams,
                                                           int32_t particles);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_filter_mapper_check(const cairn_filter_mapper_params *params,
                                                     cairn_object_fault *fault);

/* Returns the bytes that create() takes from the pool; 0 for invalid params. */
size_t cairn_filter_mapper_memory(const cairn_filter_mapper_params *params);

/* Creates a filter mapper in the pool. CAIRN_BAD_ARGUMENT: NULL or invalid params.
 * CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_filter_mapper_create(cairn_filter_mapper **mapper,
                                                      cairn_pool *pool,
                                                      const cairn_filter_mapper_params *params);

/* Takes the next scan: as cairn_mapper_add(), with its statuses. CAIRN_MORE: the scan is taken, and
 * step() is pending. CAIRN_BUSY: the previous scan is still being processed, nothing was taken.
 *
 * input: ranges, angles and poses
 * odometry: pose of the base in the odometry frame; NULL: none */
CAIRN_CHECKED cairn_status cairn_filter_mapper_add(cairn_filter_mapper *mapper,
                                                   const cairn_scan_input *input,
                                                   const cairn_pose *odometry, cairn_fault *fault);

/* Maps a scan: add(), and steps without a limit until the scan is done, as cairn_mapper_map().
 * Returns the statuses of both.
 *
 * input: ranges, angles and poses
 * odometry: pose of the base in the odometry frame; NULL: none */
CAIRN_CHECKED cairn_status cairn_filter_mapper_map(cairn_filter_mapper *mapper,
                                                   const cairn_scan_input *input,
                                                   const cairn_pose *odometry, cairn_fault *fault);

/* Continues processing the current scan. CAIRN_MORE: the budget is used up. CAIRN_OK: the scan is
 * done. CAIRN_FULL as cairn_mapper_step(). Cost beside that of the front-end mapper, per particle and
 * keyframe: one unit for 8 keyframes of its path, one for 64 of max_local_points, 8 per candidate and
 * 8 for the motion; where it has an old map, also one unit for two of its points, 12, for each of up
 * to 15 starts 10 units, one for 8 points of the scan and an ICP alignment, and two for every scored
 * point of every candidate. With shape_prior also 4 units, one start more, and for each keyframe that
 * is the nearest old one of some particle one unit for two points of both scans and a match of
 * scan_match. A loop that it closes: one unit for 8 keyframes of the walk back to it, and three for
 * every keyframe that is corrected. */
CAIRN_CHECKED cairn_status cairn_filter_mapper_step(cairn_filter_mapper *mapper,
                                                    cairn_budget *budget);

/* ---- Reading: when step() has returned CAIRN_OK ---- */

/* Returns the front-end mapper: reference keyframes and relative poses of the scans, their points,
 * counters. Its keyframe poses are those of the motion alone. */
const cairn_mapper *cairn_filter_mapper_front(const cairn_filter_mapper *mapper);

/* Returns the current number of particles; 0 before the first scan. */
int32_t cairn_filter_mapper_count(const cairn_filter_mapper *mapper);

/* Returns the particle of the most likely path (ties: the lower index); -1 before the first scan.
 * Linear in the particles. */
int32_t cairn_filter_mapper_best(const cairn_filter_mapper *mapper);

/* Returns the pose of a particle's last keyframe in the map; the identity for an invalid particle.
 * Constant time.
 *
 * particle: index of the particle */
cairn_pose cairn_filter_mapper_last(const cairn_filter_mapper *mapper, int32_t particle);

/* Copies the keyframe poses along a particle's path to poses[0 ... returned - 1], at most the first
 * `capacity` of them. Returns 0 for an invalid particle. Linear in the keyframes.
 *
 * particle: index of the particle
 * poses: [capacity] set to the keyframe poses, m and rad */
int32_t cairn_filter_mapper_path(const cairn_filter_mapper *mapper, int32_t particle,
                                 cairn_pose *poses, int32_t capacity);

/* Counters; those of the front-end mapper are read from it. */
typedef struct cairn_filter_mapper_state {
    int32_t keyframes;   /* keyframes: filter steps + 1 */
    int32_t resamplings; /* resampling steps so far */
    /* effective sample size 1 / sum w^2 of the last step, before resampling */
    cairn_real n_eff;
    int64_t revisit_matches;   /* matches on an old map that were modes of a proposal */
    int64_t shape_matches;     /* pairs of keyframes that were matched by shape */
    int64_t shape_starts;      /* starts of a match by shape */
    int32_t nodes, nodes_peak; /* nodes of the tree of paths, and their peak */
    int64_t units;             /* work units charged, the front-end mapper included */
} cairn_filter_mapper_state;

/* Returns the counters. */
cairn_filter_mapper_state cairn_filter_mapper_measure(const cairn_filter_mapper *mapper);

#ifdef __cplusplus
}
#endif

#endif
