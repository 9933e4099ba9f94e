/* scan_redundancy: redundancy of the scans of a set, for keyframe culling.
 *
 * A robot that maps without end in memory for N scans removes one scan for each new one. A removed
 * scan loses the points that no other scan shows. A point that n other scans show has the loss 1 /
 * (1 + n); the loss of a scan is the sum over its points. The scan of least loss is the most
 * redundant one, whatever its age. */
#ifndef CAIRN_SCAN_REDUNDANCY_H
#define CAIRN_SCAN_REDUNDANCY_H

#include "cairn/neighbours.h"
#include "cairn/scan_set.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Scoring of scans by their redundancy. */
typedef struct cairn_scan_redundancy cairn_scan_redundancy;

/* Parameters; defaults in brackets. */
typedef struct cairn_scan_redundancy_params {
    /* 1 ... 2^20 (64): slots of the set */
    int32_t max_scans;
    /* 1 ... 2^24 (8192): points of all scans together */
    int32_t max_points;
    /* m, > 0.5/CAIRN_REAL_MAX, <= 1e6 (0.15): a scan shows a point when one of its points is within
     * this distance, and within direction_gate */
    cairn_real radius;
    /* rad, > 0, <= pi (30 degrees): greatest angle between the directions of both points */
    cairn_real direction_gate;
} cairn_scan_redundancy_params;

/* Returns the default parameters. */
cairn_scan_redundancy_params cairn_scan_redundancy_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_scan_redundancy_check(const cairn_scan_redundancy_params *params,
                                                       cairn_object_fault *fault);

/* Returns the bytes that create() takes; 0 for params that create() would refuse. */
size_t cairn_scan_redundancy_memory(const cairn_scan_redundancy_params *params);

/* Creates the object in memory of the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_scan_redundancy_create(cairn_scan_redundancy **redundancy,
                                                        cairn_pool *pool,
                                                        const cairn_scan_redundancy_params *params);

/* Starts to score the scans of a set, which must not change until step() returns CAIRN_OK.
 * map_scan: [set->scan_count], the poses by slot; those of free slots are not used.
 * CAIRN_BAD_ARGUMENT: NULL, or a pose beyond 1e6 m. CAIRN_FULL: more slots or points than params
 * allow. CAIRN_NOT_FINITE: a pose. Linear in the scans.
 *
 * set: the scans */
CAIRN_CHECKED cairn_status cairn_scan_redundancy_begin(cairn_scan_redundancy *redundancy,
                                                       const cairn_scan_set *set,
                                                       const cairn_pose *map_scan);

/* Continues. CAIRN_OK: all scans have a score. CAIRN_MORE: the budget is used up. Cost per point:
 * about five units, and one for each point of the set within the radius. */
CAIRN_CHECKED cairn_status cairn_scan_redundancy_step(cairn_scan_redundancy *redundancy,
                                                      cairn_budget *budget);

/* Returns the redundancy score of a scan: its loss, in points; the lower, the more redundant. Valid
 * after the last step that returned CAIRN_OK; -1 for slots that were free, and while step() has
 * work left.
 *
 * scan: slot of the scan */
cairn_real cairn_scan_redundancy_loss(const cairn_scan_redundancy *redundancy, int32_t scan);

/* Returns the most redundant scan: that of least loss, the lowest slot among equals. The slot
 * `spared` is excluded, such as the anchor of the map (-1: none). -1: there is none, or step() has
 * work left. Linear in the scans.
 *
 * spared: slot that is excluded; -1: none */
int32_t cairn_scan_redundancy_most_redundant(const cairn_scan_redundancy *redundancy,
                                             int32_t spared);

#ifdef __cplusplus
}
#endif

#endif
