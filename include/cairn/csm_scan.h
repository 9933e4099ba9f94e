/* csm_scan: laser scans as the Canonical Scan Matcher (CSM) keeps them, one JSON object after
 * another, plain or gzipped:
 *
 *   {"nrays": 3, "min_theta": -1.57, "max_theta": 1.57, "theta": [-1.57, 0, 1.57], "readings":
 *   [2.5, null, 3.1],
 *    "valid": [1, 0, 1], "odometry": [0, 0, 0], "estimate": [0, 0, 0], "true_pose": [null, null,
 *    null], "timestamp": [1147713122, 541201]}
 *
 * Ranges are in m, angles in rad, a timestamp is s and us, or s with decimals. Needed are nrays,
 * readings, and theta or both of min_theta and max_theta, between which the beams are then
 * spread evenly. A reading that is null, 0 or negative, or whose `valid` is 0, null or false,
 * says nothing; one from params.range_max on says that nothing came back. A pose with a null is
 * not known. Fields of other names are passed over; one that stands twice is refused. */
#ifndef CAIRN_CSM_SCAN_H
#define CAIRN_CSM_SCAN_H

#include "cairn/file_error.h"
#include "cairn/scan.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The most rays of a scan. */
#define CAIRN_CSM_RAYS_MOST 100000

typedef struct cairn_csm_params {
    double range_max;   /* m, above 0: ranges from here on are no return. Default 80 */
    double range_sigma; /* m, standard deviation handed on to the scans. Default 0.01 */
} cairn_csm_params;

cairn_csm_params cairn_csm_default(void);

typedef struct cairn_csm_scan {
    int64_t line; /* of the file, from 1: where its object begins */
    cairn_scan_input scan;
    cairn_pose odometry, estimate, true_pose; /* identity when not known */
    int32_t has_odometry, has_estimate, has_true_pose;
    int32_t has_stamp; /* scan.stamp_ns is 0 without */
} cairn_csm_scan;

typedef struct cairn_csm_scans {
    cairn_csm_scan *scan; /* [count] */
    int32_t count;
    int32_t rays_most; /* of one scan */
} cairn_csm_scans;

/* Reads a whole file. CAIRN_BAD_FORMAT, CAIRN_TRUNCATED: not as said above, the error names file
 * and line; CAIRN_EMPTY: no scan in it; CAIRN_UNSUPPORTED, CAIRN_IO, CAIRN_FULL (more rays, or
 * nested deeper, than can be), CAIRN_NO_MEMORY; CAIRN_BAD_ARGUMENT: params. params NULL: the
 * default. On failure there is nothing to free. */
CAIRN_CHECKED cairn_status cairn_csm_load(cairn_csm_scans *scans, const char *path,
                                          const cairn_csm_params *params, cairn_file_error *error);

void cairn_csm_scans_free(cairn_csm_scans *scans);

#ifdef __cplusplus
}
#endif

#endif
