/* weak_direction: correction of weakly observable directions: submaps that only long parallel walls
 * constrain are translated along these walls to their most probable position.
 *
 *     begin -> add every scan -> step until CAIRN_OK -> read, shift_of
 *
 * Scans of a hallway and of the rooms beside it share walls of one direction only (degenerate
 * geometry). Along it, whole submaps may be off by decimetres while each scan by itself is at a
 * minimum. Such submaps are found from the marginal covariances relative to the alignment's anchor
 * and from the walls that their scans share.
 *
 * Three terms determine the translation: free-space violations between scans; the initial poses of
 * all scans together; and a prior on wall thickness: the two faces of a wall, which no scan sees
 * both, are as far apart as those of the other walls of the map. The weight of the thickness prior
 * is estimated from the walls whose faces the map constrains strongly; it is zero where all
 * thicknesses differ (cf. Adluru 2008, chapter 8: a box seen from two sides). The pair of submaps
 * with the most certain relative position is merged first, then the others are evaluated again. A
 * submap that gains less than 2 nats stays. */
#ifndef CAIRN_WEAK_DIRECTION_H
#define CAIRN_WEAK_DIRECTION_H

#include "cairn/aligner.h"
#include "cairn/object.h"
#include "cairn/scan_set.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Parameters; defaults in brackets. */
typedef struct cairn_weak_direction_params {
    /* 1 ... 2^16 (64): number of scans */
    int32_t max_scans;
    /* 1 ... 2^16 (1024): segments of all scans that are used; beyond the limit segments are left
     * out, first those of strongly constrained scans */
    int32_t max_walls;
    /* 1 ... 64 (24): submaps that may be translated; beyond the limit submaps stay */
    int32_t max_submaps;
    /* 0 or 1 (1): 1: use the prior on wall thickness */
    int32_t use_thickness;
    /* m, > 0, <= 1e6 (0.03): a direction with a greater standard deviation is weakly observable */
    cairn_real weak_sigma;
    /* m, > 0, <= 1e6 (0.05): greatest standard deviation across the weakly observable direction */
    cairn_real max_cross_sigma;
    /* rad, > 0, <= 1e6 (1 degree): greatest standard deviation of the heading */
    cairn_real max_sigma_theta;
    /* m, > 0, <= 1e6 (0.02): step of the translations that are tried, or the 401st part of 6
     * standard deviations */
    cairn_real translation_step;
    /* m, > 0, <= 1e6 (0.02): standard deviation of the thickness of equal walls */
    cairn_real thickness_sigma;
} cairn_weak_direction_params;

/* Counts of the submaps and scans, and the thickness of the walls. */
typedef struct cairn_weak_direction_result {
    int32_t weak_submaps;     /* submaps with a weakly observable direction */
    int32_t merged_submaps;   /* submaps that were merged with another */
    int32_t translated_scans; /* scans that were translated */
    int32_t dropped;          /* walls and submaps beyond max_walls and max_submaps */
    /* m: the most common wall thickness; 0: no wall was seen from both sides */
    cairn_real thickness;
    /* share of the walls of this thickness, 0 ... 1, shrunk while they are few */
    cairn_real thickness_share;
    int64_t units; /* work units of all steps */
} cairn_weak_direction_result;

/* Translation of submaps along weakly observable directions. */
typedef struct cairn_weak_direction cairn_weak_direction;

/* Returns the default parameters. */
cairn_weak_direction_params cairn_weak_direction_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_weak_direction_check(const cairn_weak_direction_params *params,
                                                      cairn_object_fault *fault);

/* Returns the bytes that create() takes; 0 for params that create() would refuse. */
size_t cairn_weak_direction_memory(const cairn_weak_direction_params *params);

/* Creates the object in memory of the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_weak_direction_create(cairn_weak_direction **weak_direction,
                                                       cairn_pool *pool,
                                                       const cairn_weak_direction_params *params);

/* Returns 1 when a scan is in the largest component of an alignment, with, relative to the anchor, a
 * well observable heading and exactly one weakly observable direction of translation. Constant time.
 *
 * aligned: result of the scan */
int32_t cairn_weak_direction_is_weak(const cairn_weak_direction *weak_direction,
                                     const cairn_aligner_pose *aligned);

/* Starts with an aligner that has ended, and a set with the same scans in the same slots. Both must
 * not change until the last step. spread: m, > 0, standard deviation of x and of y of the initial
 * poses of add(), as the alignment from these poses estimated it (cairn_aligner_result); an
 * alignment by cairn_aligner_begin_warm() estimates that of other poses. CAIRN_BAD_ARGUMENT: NULL,
 * spread not > 0, an aligner that is running, or with other scans than the set. CAIRN_FULL: more
 * scans than params allow. Linear in params.
 *
 * set: segments and points of the scans */
CAIRN_CHECKED cairn_status cairn_weak_direction_begin(cairn_weak_direction *weak_direction,
                                                      const cairn_aligner *aligner,
                                                      const cairn_scan_set *set, cairn_real spread);

/* Adds the next scan: its pose before the alignment, and the result of the alignment.
 * CAIRN_BAD_ARGUMENT: NULL, all scans have been added, or poses beyond 1e6 m. CAIRN_NOT_FINITE.
 * Constant time.
 *
 * start: pose before the alignment
 * aligned: result of the alignment */
CAIRN_CHECKED cairn_status cairn_weak_direction_add(cairn_weak_direction *weak_direction,
                                                    cairn_pose start,
                                                    const cairn_aligner_pose *aligned);

/* Continues. CAIRN_MORE: the budget is used up. CAIRN_OK: the correction has ended.
 * CAIRN_BAD_ARGUMENT: NULL. CAIRN_EMPTY: scans are missing. Cost: linear in the scans without a
 * weakly observable direction; else the square of the walls, and for every pair of submaps the
 * trial translations: most with one or two pairs of their scans, the best with all overlapping
 * pairs, each as one evaluation of the aligner's free-space violation. Units are charged before the
 * operation that they are for: at most max_scans / 2 for the fit of the initial poses,
 * (max_scans + max_walls) / 16 for a merge of two submaps, max_walls / 8 for a wall against all
 * others, and for two scans a third of their points at one translation, or a 16th of the product of
 * their segments. */
CAIRN_CHECKED cairn_status cairn_weak_direction_step(cairn_weak_direction *weak_direction,
                                                     cairn_budget *budget);

/* ---- The result: all zero until step() returns CAIRN_OK ---- */

/* Returns the result; all zero until step() returns CAIRN_OK. */
cairn_weak_direction_result cairn_weak_direction_read(const cairn_weak_direction *weak_direction);

/* Returns the translation of a scan in the map, m; 0 for a scan that stays, and for one that does
 * not exist.
 *
 * scan: slot of the scan */
cairn_vec2 cairn_weak_direction_translation(const cairn_weak_direction *weak_direction,
                                            int32_t scan);

#ifdef __cplusplus
}
#endif

#endif
