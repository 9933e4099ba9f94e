/* corner: corner detection, as intersections of two supporting segments at about a right angle.
 *
 * Corners of the global map are the regions of interest of force field simulation (Adluru 2008,
 * section 7.3.4) and the landmarks by which maps are merged (chapter 9). All segments are in one
 * frame, free side on the left of a -> b. The segments may belong to different scans. */
#ifndef CAIRN_CORNER_H
#define CAIRN_CORNER_H

#include "cairn/geometry.h"
#include "cairn/neighbours.h"
#include "cairn/object.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Convexity of a corner as seen from free space. */
typedef int32_t cairn_corner_kind;
enum {
    /* the free sides of the two segments disagree, as at the two faces of a thin wall */
    CAIRN_CORNER_MIXED = 0,
    /* the free side lies between the legs: the corner of a room */
    CAIRN_CORNER_CONCAVE = 1,
    /* the obstacle lies between the legs: the corner of a box */
    CAIRN_CORNER_CONVEX = 2
};

/* A corner of two segments. */
typedef struct cairn_corner {
    /* intersection of the two lines, m */
    cairn_vec2 position;
    /* unit vectors away from the corner along the segments; leg[1] is to the left of leg[0] */
    cairn_vec2 leg[2];
    /* rad, from leg[0] counter-clockwise to leg[1] */
    cairn_real opening;
    /* m: the smaller of the two distances from the corner to the far ends of its segments */
    cairn_real strength;
    /* leg[k] runs along segments[segment[k]] */
    int32_t segment[2];
    /* kind of the corner */
    cairn_corner_kind kind;
} cairn_corner;

/* Parameters; defaults in brackets. */
typedef struct cairn_corner_params {
    /* 1 ... 2^28 (256): capacity for segments */
    int32_t max_segments;
    /* 1 ... 2^28 (128): capacity for corners; of more the strongest are kept */
    int32_t max_corners;
    /* rad, > 0, < pi (80 degrees): least opening angle */
    cairn_real min_opening;
    /* rad, >= min_opening, < pi (100 degrees): greatest opening angle */
    cairn_real max_opening;
    /* m, > 0 (0.30): greatest distance from the corner to an end of both segments */
    cairn_real end_distance;
    /* m, >= 0 (0.10): non-maximum-suppression radius; of corners of one kind within it whose legs
     * agree within merge_angle only the strongest stays; 0: no suppression */
    cairn_real merge_radius;
    /* rad, 0 ... pi (10 degrees): greatest angle between the legs of suppressed corners */
    cairn_real merge_angle;
    /* 0 or 1 (0): 1: end_distance holds to both segments, not to their ends, so that T and X
     * crossings are corners, too, as in section 7.3.4 */
    int32_t crossings;
} cairn_corner_params;

/* Detector of corners, and the corners of its last detection. */
typedef struct cairn_corner_set cairn_corner_set;

/* Upper bound of cairn_corner_memory as a constant expression. */
#define CAIRN_CORNER_BYTES(segments, corners)                                                      \
    (544 + CAIRN_ALLOCATION_BYTES(segments, sizeof(int32_t)) +                                     \
     CAIRN_ALLOCATION_BYTES(segments, sizeof(cairn_box)) +                                         \
     2 * CAIRN_ALLOCATION_BYTES(corners, sizeof(cairn_corner)))

/* Returns the default parameters. */
cairn_corner_params cairn_corner_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_corner_check(const cairn_corner_params *params,
                                              cairn_object_fault *fault);

/* Returns the bytes that create() takes; 0 for params that create() would refuse. */
size_t cairn_corner_memory(const cairn_corner_params *params);

/* Creates the object in memory of the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_corner_create(cairn_corner_set **set, cairn_pool *pool,
                                               const cairn_corner_params *params);

/* Starts a detection over segments[0 ... count-1], which must not change until it ends. A running
 * detection is cancelled. Segments of length 0 have no corners. CAIRN_BAD_ARGUMENT: count < 0, or
 * NULL with count > 0. CAIRN_FULL: count > max_segments. Constant time.
 *
 * segments: [count] segments */
CAIRN_CHECKED cairn_status cairn_corner_begin(cairn_corner_set *set, const cairn_segment *segments,
                                              int32_t count);

/* Continues the detection. CAIRN_MORE: the budget is used up. CAIRN_OK: the detection has ended, or
 * none was begun. CAIRN_NOT_FINITE: a segment is not finite; the detection is cancelled and the
 * last result stays. Cost: the sweep over the segments, three units for each pair of near segments,
 * eight for each corner found, and at most one for every eight pairs of corners in the
 * suppression. */
CAIRN_CHECKED cairn_status cairn_corner_step(cairn_corner_set *set, cairn_budget *budget);

/* Returns the corners of the last completed detection, the strongest first (ties: by the lower,
 * then the higher index of their two segments); valid until the next detection ends.
 *
 * count: set to the number of corners */
const cairn_corner *cairn_corner_list(const cairn_corner_set *set, int32_t *count);

/* Returns the number of corners that the last detection dropped beyond max_corners. */
int32_t cairn_corner_dropped(const cairn_corner_set *set);

#ifdef __cplusplus
}
#endif

#endif
