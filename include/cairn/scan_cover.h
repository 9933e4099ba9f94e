/* scan_cover: how well the scans of a set are covered by each other, and which of them can best go.
 *
 * A robot that runs on and on with room for so many scans releases one for each that comes. What
 * goes with a scan is what no other shows: a point that n other scans show, too, is lost to 1 /
 * (1 + n), and the loss of a scan is the sum over its points. The one with the least loss is the
 * one whose place is best covered by others, however old it is. */
#ifndef CAIRN_SCAN_COVER_H
#define CAIRN_SCAN_COVER_H

#include "cairn/neighbours.h"
#include "cairn/scan_set.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_scan_cover cairn_scan_cover;

/* In brackets the defaults. */
typedef struct cairn_scan_cover_params {
    /* slots of the set, 1 ... 2^20 (64) */
    int32_t max_scans;
    /* of all scans, 1 ... 2^24 (8192) */
    int32_t max_points;
    /* m, > 0, <= 1e6: a point is shown by another scan that has one so near ... (0.15) */
    cairn_real radius;
    /* rad, in (0, pi]: ... whose direction differs by at most this (30 degrees) */
    cairn_real direction_gate;
} cairn_scan_cover_params;

cairn_scan_cover_params cairn_scan_cover_default(void);

/* 0 for params that create() would refuse. */
size_t cairn_scan_cover_memory(const cairn_scan_cover_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_scan_cover_create(cairn_scan_cover **cover, cairn_pool *pool,
                                                   const cairn_scan_cover_params *params);

/* Begins anew with the scans of a set, which must stay as it is until step() returns CAIRN_OK.
 * map_scan: [set->scan_count], the poses by slot; those of slots that are not in use do not
 * count. CAIRN_BAD_ARGUMENT: NULL, or a pose beyond 1e6 m. CAIRN_FULL: more slots or points than
 * params allow. CAIRN_NOT_FINITE: a pose. Linear in the scans. */
CAIRN_CHECKED cairn_status cairn_scan_cover_begin(cairn_scan_cover *cover,
                                                  const cairn_scan_set *set,
                                                  const cairn_pose *map_scan);

/* CAIRN_OK: nothing left to do. CAIRN_MORE: go on. Costs per point about five units, and one for
 * each point of the set that is within the radius. */
CAIRN_CHECKED cairn_status cairn_scan_cover_step(cairn_scan_cover *cover, cairn_budget *budget);

/* The loss of a scan, in points, after the last step that returned CAIRN_OK; -1 for slots that
 * were not in use, and while step() has work left. */
cairn_real cairn_scan_cover_loss(const cairn_scan_cover *cover, int32_t scan);

/* The scan with the least loss, the lowest slot among equals; never `spared`, such as the one
 * that holds the map (-1: none is spared). -1: there is none, or step() has work left. Linear in
 * the scans. */
int32_t cairn_scan_cover_least(const cairn_scan_cover *cover, int32_t spared);

#ifdef __cplusplus
}
#endif

#endif
