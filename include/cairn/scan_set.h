/* scan_set: the segments and points of many scans in fixed arrays, each scan in its own frame.
 *
 * What an aligner keeps of its scans: no beams, but supporting segments and oriented points with a
 * mass each, the points of a segment side by side. A scan has a number, its slot, which it keeps;
 * slots and room of scans that were removed are used again.
 *
 * The points of scans from the scan room follow from the ends of their segments and one bit for
 * each place along them. With `spacing` given the set keeps no more than that and makes the
 * points when they are asked for (Adluru 2008, section 7.3.5), with the same bits. */
#ifndef CAIRN_SCAN_SET_H
#define CAIRN_SCAN_SET_H

#include "cairn/scan.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Coordinates (m) and masses beyond this are refused, so that no sum of squares overflows in
 * float. */
#define CAIRN_SCAN_SET_LIMIT CAIRN_REAL(1e6)

typedef struct cairn_scan_set_params {
    /* 1 ... 2^20 */
    int32_t max_scans;
    /* of all scans, 1 ... 2^24 */
    int32_t max_segments;
    /* of all scans, 1 ... 2^24; with `spacing` also of the places along their segments */
    int32_t max_points;
    /* 0: points and masses are kept. > 0, m: as in cairn_scan_params; points are made from the
     * segments' ends, all of mass 1 */
    cairn_real spacing;
} cairn_scan_set_params;

/* A scan as a rigid body of points of mass 1; in the frame of the scan. */
typedef struct cairn_scan_set_scan {
    /* 0: a slot without a scan, whose other fields mean nothing */
    int32_t in_use;
    /* its segments are first_segment ... end_segment - 1 */
    int32_t first_segment, end_segment;
    int32_t first_point, end_point;
    /* of `places` that its segments have */
    int32_t words;
    /* (0, 0) without points */
    cairn_vec2 centroid;
    cairn_vec2 sensor;
    /* m^2, mean squared distance of the points from the centroid */
    cairn_real centroid_spread;
    /* m^2, from the sensor */
    cairn_real sensor_spread;
} cairn_scan_set_scan;

typedef struct cairn_scan_set_segment {
    cairn_segment segment;
    cairn_vec2 direction; /* of its points: unit, or zero when it has none */
    int32_t first_point, end_point;
    int32_t first_word; /* of `places`; 0 without spacing */
    int32_t scan;       /* slot; -1: the scan was removed, pack() takes the segment away */
} cairn_scan_set_segment;

/* Open for reading. */
typedef struct cairn_scan_set {
    /* [max_scans] */
    cairn_scan_set_scan *scans;
    /* [max_segments], scan by scan in the order in which the scans came */
    cairn_scan_set_segment *segments;
    /* [max_points], segment by segment; NULL with spacing */
    cairn_vec2 *points;
    /* [max_points]; NULL with spacing */
    cairn_real *mass;
    /* with spacing: a bit for each place of a segment, from a whole word on */
    uint32_t *places;
    /* slots that were ever used: the highest slot in use is below */
    int32_t scan_count;
    int32_t segment_count, point_count, word_count;
    /* of the removed scans the last; -1: none */
    int32_t free_slot;
    /* not 0: pack() has something to do */
    int32_t gaps;
    /* of pack() */
    int32_t from, to_segment, to_point, to_word;
    /* of pack(): units towards the next scan */
    int32_t paid;
    cairn_scan_set_params params;
} cairn_scan_set;

/* Upper bound of cairn_scan_set_memory as a constant expression, with the points kept ... */
#define CAIRN_SCAN_SET_BYTES(scans, points, segments)                                              \
    (CAIRN_PIECE_BYTES(1, sizeof(cairn_scan_set)) +                                                \
     CAIRN_PIECE_BYTES(scans, sizeof(cairn_scan_set_scan)) +                                       \
     CAIRN_PIECE_BYTES(segments, sizeof(cairn_scan_set_segment)) +                                 \
     CAIRN_PIECE_BYTES(points, sizeof(cairn_vec2)) +                                               \
     CAIRN_PIECE_BYTES(points, sizeof(cairn_real)))

/* ... and with spacing. */
#define CAIRN_SCAN_SET_PLACES_BYTES(scans, points, segments)                                       \
    (CAIRN_PIECE_BYTES(1, sizeof(cairn_scan_set)) +                                                \
     CAIRN_PIECE_BYTES(scans, sizeof(cairn_scan_set_scan)) +                                       \
     CAIRN_PIECE_BYTES(segments, sizeof(cairn_scan_set_segment)) +                                 \
     CAIRN_PIECE_BYTES((points) / 32 + (segments), sizeof(uint32_t)))

/* 0 for params that create() would refuse. */
size_t cairn_scan_set_memory(const cairn_scan_set_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_scan_set_create(cairn_scan_set **set, cairn_pool *pool,
                                                 const cairn_scan_set_params *params);

/* The slot that the next scan will get: that of the scan removed last which is free, else one
 * never used. -1: max_scans are there. */
int32_t cairn_scan_set_next(const cairn_scan_set *set);

/* Copies the segments and points of a scan behind those that are there. The direction of all points
 * of a segment is that of its first one. mass: [point_count], > 0, or NULL: all 1.
 *
 * CAIRN_BAD_ARGUMENT: NULL, negative counts, first_point that does not rise from 0 to
 * point_count, a mass <= 0, a coordinate or mass beyond CAIRN_SCAN_SET_LIMIT; with spacing
 * masses, and points that are not, in their order, of the places that cairn_scan puts them at
 * with the same spacing. CAIRN_NOT_FINITE. CAIRN_FULL: more scans, segments or points than
 * params allow, those that pack() has not yet taken away included. *fault, when not NULL, says
 * which point, segment or mass it is. Linear in the scan and its places. */
CAIRN_CHECKED cairn_status cairn_scan_set_add(cairn_scan_set *set, const cairn_scan_view *view,
                                              const cairn_real *mass, cairn_fault *fault);

/* Removes a scan; its slot is free at once, its room after pack(). CAIRN_BAD_ARGUMENT: no scan
 * there. Linear in its segments. */
CAIRN_CHECKED cairn_status cairn_scan_set_remove(cairn_scan_set *set, int32_t scan);

/* Closes the gaps that removed scans left: those behind move up, whole scan by scan, so that
 * readers see no half. CAIRN_MORE: the budget is used up. CAIRN_OK: there are no gaps. Scans may
 * be added between two calls. Costs per scan behind the first gap a unit, and one for two of its
 * segments and eight of its points. */
CAIRN_CHECKED cairn_status cairn_scan_set_pack(cairn_scan_set *set, cairn_budget *budget);

/* points[0 ... count-1] = the points first ... first+count-1 of a segment (0 is its first one),
 * which it must have. Linear in count, and with spacing in the 32nd part of the places before. */
void cairn_scan_set_read(const cairn_scan_set *set, int32_t segment, int32_t first, int32_t count,
                         cairn_vec2 *points);

/* Forgets all scans. Constant time. */
void cairn_scan_set_clear(cairn_scan_set *set);

#ifdef __cplusplus
}
#endif

#endif
