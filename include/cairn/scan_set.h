/* scan_set: storage of the segments and points of many scans in fixed arrays, each scan in its own
 * frame.
 *
 * An aligner keeps of its scans no beams, but the supporting segments and the oriented points, each
 * point with a mass, the points of a segment side by side. A scan has a number, its slot, which it
 * keeps; slots and memory of removed scans are used again.
 *
 * The points of scans from the scan module follow from the ends of their segments and one bit for
 * each position along them. With spacing > 0 the set keeps only these and generates the points on
 * demand (Adluru 2008, section 7.3.5), bit for bit the same. */
#ifndef CAIRN_SCAN_SET_H
#define CAIRN_SCAN_SET_H

#include "cairn/scan.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Capacities; a set has no defaults. */
typedef struct cairn_scan_set_params {
    /* 1 ... 2^20 (none): number of scans */
    int32_t max_scans;
    /* 1 ... 2^24 (none): segments of all scans together */
    int32_t max_segments;
    /* 1 ... 2^24 (none): points of all scans together; with spacing also the positions along their
     * segments */
    int32_t max_points;
    /* m, >= 0, <= 1e6 (none): 0: points and masses are kept. > 0: as in cairn_scan_params; points
     * are generated from the segments' ends, all of mass 1. */
    cairn_real spacing;
} cairn_scan_set_params;

/* A scan as a rigid body of points, in the frame of the scan. */
typedef struct cairn_scan_set_scan {
    /* 0: a free slot, whose other fields are undefined */
    int32_t in_use;
    /* its segments are first_segment ... end_segment - 1 */
    int32_t first_segment, end_segment;
    /* its points are first_point ... end_point - 1 */
    int32_t first_point, end_point;
    /* words of the position bits of its segments */
    int32_t word_count;
    /* m; (0, 0) without points */
    cairn_vec2 centroid;
    /* m: sensor position */
    cairn_vec2 sensor;
    /* m^2: mean squared distance of the points from the centroid */
    cairn_real centroid_spread;
    /* m^2: mean squared distance of the points from the sensor */
    cairn_real sensor_spread;
} cairn_scan_set_scan;

/* A segment of a scan and the range of its points. */
typedef struct cairn_scan_set_segment {
    /* m, in the frame of the scan */
    cairn_segment segment;
    cairn_vec2 direction; /* direction of its points: unit vector, or zero without points */
    /* its points are first_point ... end_point - 1 */
    int32_t first_point, end_point;
    int32_t first_word; /* first word of its position bits; 0 without spacing */
    int32_t scan;       /* slot; -1: the scan was removed, pack() will remove the segment */
} cairn_scan_set_segment;

/* The set; its fields are read-only for callers. */
typedef struct cairn_scan_set {
    /* [max_scans] */
    cairn_scan_set_scan *scans;
    /* [max_segments], scan by scan in the order of add() */
    cairn_scan_set_segment *segments;
    /* [max_points], segment by segment; NULL with spacing */
    cairn_vec2 *points;
    /* [max_points]; NULL with spacing */
    cairn_real *mass;
    /* with spacing: position bits, one for each position along a segment; a segment starts at a
     * whole word */
    uint32_t *position_bits;
    /* slots that were ever used: upper bound of the slots in use */
    int32_t scan_count;
    /* segments, points and words in use, removed ones before pack() included */
    int32_t segment_count, point_count, word_count;
    /* slot of the last removed scan, head of the free list; -1: none */
    int32_t free_slot;
    /* not 0: pack() has work to do */
    int32_t needs_packing;
    /* position of pack(): segment read, and segment, point and word written */
    int32_t pack_from, pack_segment, pack_point, pack_word;
    /* units of pack() already charged towards the next scan */
    int32_t pack_units;
    /* capacities and spacing */
    cairn_scan_set_params params;
} cairn_scan_set;

/* Upper bound of cairn_scan_set_memory as a constant expression, with the points kept. */
#define CAIRN_SCAN_SET_BYTES(scans, points, segments)                                              \
    (CAIRN_ALLOCATION_BYTES(1, sizeof(cairn_scan_set)) +                                           \
     CAIRN_ALLOCATION_BYTES(scans, sizeof(cairn_scan_set_scan)) +                                  \
     CAIRN_ALLOCATION_BYTES(segments, sizeof(cairn_scan_set_segment)) +                            \
     CAIRN_ALLOCATION_BYTES(points, sizeof(cairn_vec2)) +                                          \
     CAIRN_ALLOCATION_BYTES(points, sizeof(cairn_real)))

/* Upper bound of cairn_scan_set_memory as a constant expression, with spacing. */
#define CAIRN_SCAN_SET_BITS_BYTES(scans, points, segments)                                         \
    (CAIRN_ALLOCATION_BYTES(1, sizeof(cairn_scan_set)) +                                           \
     CAIRN_ALLOCATION_BYTES(scans, sizeof(cairn_scan_set_scan)) +                                  \
     CAIRN_ALLOCATION_BYTES(segments, sizeof(cairn_scan_set_segment)) +                            \
     CAIRN_ALLOCATION_BYTES((points) / 32 + (segments), sizeof(uint32_t)))

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_scan_set_check(const cairn_scan_set_params *params,
                                                cairn_object_fault *fault);

/* Returns the bytes that create() takes; 0 for params that create() would refuse. */
size_t cairn_scan_set_memory(const cairn_scan_set_params *params);

/* Creates the object in memory of the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY.
 *
 * set: receives the created set */
CAIRN_CHECKED cairn_status cairn_scan_set_create(cairn_scan_set **set, cairn_pool *pool,
                                                 const cairn_scan_set_params *params);

/* Returns the slot that the next scan will get: the last free one on the free list, else one never
 * used. -1: max_scans are in use.
 *
 * set: the set */
int32_t cairn_scan_set_next(const cairn_scan_set *set);

/* Adds the segments and points of a scan; they are copied. The direction of all points of a segment
 * is that of its first point. mass: [point_count], > 0, or NULL: all 1.
 *
 * CAIRN_BAD_ARGUMENT: NULL, a view that cairn_scan_view_check() refuses without its beams, which are
 * not read, a mass <= 0 or beyond CAIRN_MAX_MAGNITUDE; with spacing masses, and points that are not,
 * in their order, at the positions of cairn_scan with the same spacing. CAIRN_NOT_FINITE.
 * CAIRN_FULL: more scans, segments or points than params allow, including removed ones before
 * pack(). *fault, when not NULL, names the point, segment or mass. Linear in the scan and its
 * positions.
 *
 * set: the set
 * view: segments and points of the scan */
CAIRN_CHECKED cairn_status cairn_scan_set_add(cairn_scan_set *set, const cairn_scan_view *view,
                                              const cairn_real *mass, cairn_fault *fault);

/* Removes a scan; its slot is free at once, its memory after pack(). CAIRN_BAD_ARGUMENT: no such
 * scan. Linear in its segments.
 *
 * set: the set
 * scan: slot of the scan */
CAIRN_CHECKED cairn_status cairn_scan_set_remove(cairn_scan_set *set, int32_t scan);

/* Compacts the arrays after removals: later scans move up, whole scan by scan, so that readers
 * never see a partial move. CAIRN_MORE: the budget is used up. CAIRN_OK: the arrays are compact.
 * Scans may be added between two calls. Cost per scan behind the first gap: a unit, one for two of
 * its segments and one for eight of its points.
 *
 * set: the set */
CAIRN_CHECKED cairn_status cairn_scan_set_pack(cairn_scan_set *set, cairn_budget *budget);

/* Reads points first ... first+count-1 of a segment (0 is its first one), which must exist, into
 * points[0 ... count-1]. Linear in count, and with spacing in the 32nd part of the positions
 * before.
 *
 * set: the set
 * segment: index of the segment
 * first: first point to read, 0: that of the segment
 * points: [count] set to the points, m */
void cairn_scan_set_read(const cairn_scan_set *set, int32_t segment, int32_t first, int32_t count,
                         cairn_vec2 *points);

/* Removes all scans. Constant time.
 *
 * set: the set */
void cairn_scan_set_clear(cairn_scan_set *set);

#ifdef __cplusplus
}
#endif

#endif
