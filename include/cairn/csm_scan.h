/* csm_scan: reader of laser scans in the JSON format of the Canonical Scan Matcher (CSM), one
 * object after another, plain or gzipped.
 *
 *   {"nrays": 3, "min_theta": -1.57, "max_theta": 1.57, "theta": [-1.57, 0, 1.57],
 *    "readings": [2.5, null, 3.1], "valid": [1, 0, 1], "odometry": [0, 0, 0],
 *    "estimate": [0, 0, 0], "true_pose": [null, null, null], "timestamp": [1147713122, 541201]}
 *
 * Ranges are in m, angles in rad. A timestamp is s and us, or s with decimals. Required are nrays,
 * readings, and theta or both of min_theta and max_theta, between which the rays are then evenly
 * spaced. A reading that is null, 0 or negative, or whose `valid` is 0, null or false, is invalid.
 * A reading at or above the maximum range is a no return. A pose with a null is unknown. Fields with
 * other names are ignored; a duplicate field is an error. */
#ifndef CAIRN_CSM_SCAN_H
#define CAIRN_CSM_SCAN_H

#include "cairn/file_error.h"
#include "cairn/scan.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The maximum number of rays of a scan. */
#define CAIRN_CSM_SCAN_MAX_RAYS 100000

/* Parameters of the reader. */
typedef struct cairn_csm_scan_params {
    /* m, 0 ... CAIRN_SCAN_EXTENT (0): ranges at or above it are no returns; 0: 80 m */
    double range_max;
    /* m, 0 ... CAIRN_SCAN_EXTENT (0.01): standard deviation of the ranges, copied into the scans */
    double range_sigma;
} cairn_csm_scan_params;

/* Returns the default parameters. */
cairn_csm_scan_params cairn_csm_scan_default(void);

/* One scan. */
typedef struct cairn_csm_scan {
    int64_t line; /* line of the file where its object begins, from 1 */
    /* the scan; its arrays belong to the list */
    cairn_scan_input scan;
    cairn_pose odometry, estimate, true_pose; /* m, m, rad; identity when unknown */
    /* 1: the pose of this name is given */
    int32_t has_odometry, has_estimate, has_true_pose;
    int32_t has_stamp; /* 0: no timestamp, scan.stamp_ns is 0 */
} cairn_csm_scan;

/* All scans of a file. */
typedef struct cairn_csm_scan_list {
    cairn_csm_scan *scan; /* [count] */
    /* number of scans */
    int32_t count;
    int32_t max_rays; /* most rays of one scan */
    /* m: ranges at or above it are no returns */
    double range_max;
    /* m, x and y: all poses are relative to it; 0 unless the first pose is farther than 1e5 m */
    double origin[2];
} cairn_csm_scan_list;

/* Reads a whole file. CAIRN_BAD_FORMAT, CAIRN_TRUNCATED: not in the format above, the error has
 * file and line; CAIRN_EMPTY: no scan; CAIRN_FULL: more rays than CAIRN_CSM_SCAN_MAX_RAYS or
 * nested too deep; CAIRN_UNSUPPORTED (not a regular file), CAIRN_IO, CAIRN_NO_MEMORY;
 * CAIRN_BAD_ARGUMENT: params. params NULL: the defaults. On failure there is nothing to free.
 *
 * scans: set to the scans
 * path: file, plain or gzipped */
CAIRN_CHECKED cairn_status cairn_csm_scan_load(cairn_csm_scan_list *scans, const char *path,
                                               const cairn_csm_scan_params *params,
                                               cairn_file_error *error);

/* Frees the scans. */
void cairn_csm_scan_list_free(cairn_csm_scan_list *scans);

#ifdef __cplusplus
}
#endif

#endif
