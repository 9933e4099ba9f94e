/* Stretches of a drive whose motion no match determines: there the map may be bent, a corridor of
 * another length, or drawn twice.
 *
 * Method. A scan is uncertain when it has no match, or when the covariance of its match has a
 * standard deviation above 0.2 m or 0.1 rad in any direction. Uncertain scans with at most two
 * others between them are one stretch. One in which the robot has neither driven 1 m nor turned 30
 * degrees by uncertain scans is not reported.
 *
 * Limits: a wrong match that is sure of itself is not seen. */
#ifndef CAIRN_HOST_MAPS_UNCERTAIN_STRETCH_H
#define CAIRN_HOST_MAPS_UNCERTAIN_STRETCH_H

#include "src/host/maps/placed_scan.h"

typedef struct cairn_uncertain_stretch {
    int32_t first, last; /* scans */
    int32_t unmatched;   /* scans without a match */
    double length;       /* m driven by uncertain scans */
    double turn;         /* rad turned by uncertain scans, to both sides */
} cairn_uncertain_stretch;

/* Finds the first stretch from scan *next on. Returns 0 when there is none.
 *
 * scan: [count] with pose `after` and covariance, NaN without a match; the first one is certain
 * next: 0 before the first call; set to the scan after the stretch */
int32_t cairn_uncertain_stretch_next(const cairn_placed_scan *scan, int32_t count, int32_t *next,
                                     cairn_uncertain_stretch *stretch);

#endif
