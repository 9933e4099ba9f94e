/* scan_set: the segments and points of many scans in fixed arrays, each scan in its own frame.
 *
 * What an aligner keeps of its scans: no beams, but supporting segments and oriented points with a mass each, the points
 * of a segment side by side. Scans are only added, or all forgotten. */
#ifndef CAIRN_SCAN_SET_H
#define CAIRN_SCAN_SET_H

#include "cairn/scan.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Coordinates (m) and masses beyond this are refused, so that no sum of squares overflows in float. */
#define CAIRN_SCAN_SET_LIMIT CAIRN_REAL(1e6)

typedef struct cairn_scan_set_params {
    int32_t max_scans;    /* 1 ... 2^20 */
    int32_t max_segments; /* of all scans, 1 ... 2^24 */
    int32_t max_points;   /* of all scans, 1 ... 2^24 */
} cairn_scan_set_params;

/* A scan as a rigid body of points of mass 1; in the frame of the scan. */
typedef struct cairn_scan_set_scan {
    int32_t first_segment, end_segment; /* its segments are first_segment ... end_segment - 1 */
    int32_t first_point, end_point;
    cairn_vec2 centroid; /* (0, 0) without points */
    cairn_vec2 sensor;
    cairn_real centroid_spread; /* m^2, mean squared distance of the points from the centroid */
    cairn_real sensor_spread;   /* m^2, from the sensor */
} cairn_scan_set_scan;

typedef struct cairn_scan_set_segment {
    cairn_segment segment;
    cairn_vec2 direction; /* of its points: unit, or zero when it has none */
    cairn_real spacing;   /* m: point k lies k * spacing along direction from the first, to spacing / 1000; 0: uneven */
    int32_t first_point, end_point;
    int32_t scan;
} cairn_scan_set_segment;

/* Open for reading. */
typedef struct cairn_scan_set {
    cairn_scan_set_scan *scans;       /* [max_scans] */
    cairn_scan_set_segment *segments; /* [max_segments], scan by scan */
    cairn_vec2 *points;               /* [max_points], segment by segment */
    cairn_real *mass;                 /* [max_points] */
    int32_t scan_count, segment_count, point_count;
    cairn_scan_set_params params;
} cairn_scan_set;

/* Upper bound of cairn_scan_set_memory as a constant expression. */
#define CAIRN_SCAN_SET_BYTES(scans, points, segments)                                                                  \
    (CAIRN_PIECE_BYTES(1, sizeof(cairn_scan_set)) + CAIRN_PIECE_BYTES(scans, sizeof(cairn_scan_set_scan)) +            \
     CAIRN_PIECE_BYTES(segments, sizeof(cairn_scan_set_segment)) + CAIRN_PIECE_BYTES(points, sizeof(cairn_vec2)) +     \
     CAIRN_PIECE_BYTES(points, sizeof(cairn_real)))

/* 0 for params that create() would refuse. */
size_t cairn_scan_set_memory(const cairn_scan_set_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_scan_set_create(cairn_scan_set **set, cairn_pool *pool,
                                                 const cairn_scan_set_params *params);

/* Copies the segments and points of a scan behind those that are there. The direction of all points of a segment is that
 * of its first one. mass: [point_count], > 0, or NULL: all 1.
 *
 * CAIRN_BAD_ARGUMENT: NULL, negative counts, first_point that does not rise from 0 to point_count, a mass <= 0, a
 * coordinate or mass beyond CAIRN_SCAN_SET_LIMIT. CAIRN_NOT_FINITE. CAIRN_FULL: more scans, segments or points than params
 * allow. *fault, when not NULL, says which point, segment or mass it is. Linear in the scan. */
CAIRN_CHECKED cairn_status cairn_scan_set_add(cairn_scan_set *set, const cairn_scan_view *view, const cairn_real *mass,
                                              cairn_fault *fault);

/* Forgets all scans. Constant time. */
void cairn_scan_set_clear(cairn_scan_set *set);

#ifdef __cplusplus
}
#endif

#endif
