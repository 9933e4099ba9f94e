/* uncertain_stretch: stretches of a drive whose motion no match determines: there the map may be
 * bent, a corridor of another length, or drawn twice.
 *
 * Method. A scan is uncertain when it has no match, or when the covariance of its match has a
 * standard deviation above 0.2 m or 0.1 rad in any direction. Uncertain scans with at most two
 * others between them are one stretch. One in which the robot has neither driven 1 m nor turned 30
 * degrees by uncertain scans is not reported.
 *
 * Limits: a wrong match that is sure of itself is not seen. */
#ifndef CAIRN_UNCERTAIN_STRETCH_H
#define CAIRN_UNCERTAIN_STRETCH_H

#include "cairn/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A stretch of a drive. */
typedef struct cairn_uncertain_stretch {
    /* indices of its first and last uncertain scan */
    int32_t first, last;
    /* scans without a match */
    int32_t unmatched;
    /* m driven by uncertain scans */
    cairn_real length;
    /* rad turned by uncertain scans, to both sides */
    cairn_real turn;
} cairn_uncertain_stretch;

/* A drive of which the stretches are found, scan by scan; all 0 before the first scan. */
typedef struct cairn_uncertain_drive {
    /* number of scans so far, up to 2^31 - 1 */
    int32_t scans;
    /* 1: `current` is a stretch that has not ended, however short */
    int32_t is_uncertain;
    /* the last stretch that has begun */
    cairn_uncertain_stretch current;
} cairn_uncertain_drive;

/* Adds the next scan. Returns 1 when a stretch that is reported has ended before it. Constant time.
 *
 * drive: all 0 before the first scan
 * covariance: [9] of its match, row-major over x, y, theta; not finite: without a match. That of
 *             the first scan is not read
 * motion: from the pose of the scan before to its own; one that is not finite is long enough to be
 *         reported
 * ended: not NULL; the stretch that has ended, unchanged when there is none */
int32_t cairn_uncertain_stretch_add(cairn_uncertain_drive *drive, const cairn_real covariance[9],
                                    cairn_pose motion, cairn_uncertain_stretch *ended);

/* Ends the drive. Returns 1 when its last stretch is reported. Constant time.
 *
 * drive: with its scans
 * ended: not NULL; the stretch that has ended, unchanged when there is none */
int32_t cairn_uncertain_stretch_end(cairn_uncertain_drive *drive, cairn_uncertain_stretch *ended);

#ifdef __cplusplus
}
#endif

#endif
