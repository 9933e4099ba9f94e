/* rectangle: rectangles outlined by straight segments, with gaps in the sides.
 *
 * Segments that are nearly collinear are first merged into sides. Two parallel sides that face each
 * other make a pair with a direction, a length and a distance. Two pairs of perpendicular
 * directions whose lengths and distances fit each other make a rectangle (Lagunovsky and Ablameyko
 * 1997; Adluru 2008, section 8.4.2). The score is the covered fraction of the outline,
 * reduced when the angles are not right angles. */
#ifndef CAIRN_RECTANGLE_H
#define CAIRN_RECTANGLE_H

#include "cairn/geometry.h"
#include "cairn/object.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Which side of the outline is free space. */
typedef int32_t cairn_rectangle_kind;
enum {
    /* Free space is inside: a room. */
    CAIRN_RECTANGLE_ROOM = 0,
    /* Free space is outside: a box. */
    CAIRN_RECTANGLE_BOX = 1,
    /* Unknown, because the segments are not oriented. */
    CAIRN_RECTANGLE_ANY = 2
};

/* Rectangle. */
typedef struct cairn_rectangle {
    /* Centre in m; theta in [0, pi/2), in rad: direction of the sides 0 and 1. */
    cairn_pose centre;
    /* Half the length along theta, in m. */
    cairn_real half_length;
    /* Half the length across theta, in m. */
    cairn_real half_width;
    /* Fraction of the outline that segments cover, 0 ... 1. */
    cairn_real coverage;
    /* Score, 0 ... 1. */
    cairn_real score;
    /* Which side of the outline is free space. */
    cairn_rectangle_kind kind;
    /* Merged sides: 0 and 1 along theta, at -half_width and half_width; 2 and 3 across, at
     * -half_length and half_length. */
    int32_t side[4];
} cairn_rectangle;

/* Parameters; defaults in brackets. */
typedef struct cairn_rectangle_params {
    /* 1 ... 2^20 (1024): segments */
    int32_t max_segments;
    /* 1 ... 2^16 (256): merged sides. Of more sides those of the longest segments are kept. */
    int32_t max_sides;
    /* 1 ... 2^20 (2048): pairs of parallel sides. Further pairs are dropped. */
    int32_t max_pairs;
    /* 1 ... 256 (32): rectangles. Of more those with the highest score are kept. */
    int32_t max_rectangles;
    /* 0 or 1 (1): 1: segments have free space on the left of a -> b; 0: not known */
    int32_t oriented;
    /* m, > 0, <= 1e6 (0.10): segments are merged into a side when their ends are closer than this to its
     * line, and merge_angle and merge_gap hold, too */
    cairn_real merge_distance;
    /* rad, > 0, < pi/4 (10 degrees): greatest difference of the directions of merged segments */
    cairn_real merge_angle;
    /* m, 0 ... 1e6 (2): greatest gap along the line between merged segments */
    cairn_real merge_gap;
    /* rad, > 0, < pi/4 (8 degrees): largest deviation of two sides from parallel, and of two pairs
     * from perpendicular */
    cairn_real max_angle_error;
    /* m, > 0, <= 1e6 (0.3): shortest side */
    cairn_real min_side;
    /* 0 ... 1 (0.15): least covered fraction of each side */
    cairn_real min_side_coverage;
    /* 0 ... 1 (0.5): least covered fraction of the outline */
    cairn_real min_coverage;
    /* m, > 0, <= 1e6 (0.3): non-maximum suppression: of rectangles of a kind whose corners are all closer
     * than this only the one with the highest score stays */
    cairn_real separation;
} cairn_rectangle_params;

/* Search for rectangles, with its result. */
typedef struct cairn_rectangle_set cairn_rectangle_set;

/* Upper bound of cairn_rectangle_memory as a constant expression. */
#define CAIRN_RECTANGLE_BYTES(segments, sides, pairs, rectangles)                                  \
    (512 + 2 * CAIRN_ALLOCATION_BYTES(segments, sizeof(int32_t)) +                                 \
     CAIRN_ALLOCATION_BYTES(segments, sizeof(cairn_real)) +                                        \
     CAIRN_ALLOCATION_BYTES(sides, 16 + 16 * sizeof(cairn_real)) +                                 \
     CAIRN_ALLOCATION_BYTES(sides, sizeof(int32_t)) +                                              \
     CAIRN_ALLOCATION_BYTES(sides, sizeof(cairn_real)) +                                           \
     CAIRN_ALLOCATION_BYTES(pairs, 16 + 8 * sizeof(cairn_real)) +                                  \
     2 * CAIRN_ALLOCATION_BYTES(rectangles, sizeof(cairn_rectangle)))

/* Returns the default parameters. */
cairn_rectangle_params cairn_rectangle_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_rectangle_check(const cairn_rectangle_params *params,
                                                 cairn_object_fault *fault);

/* Bytes that create() allocates. 0 for params that create() would refuse. */
size_t cairn_rectangle_memory(const cairn_rectangle_params *params);

/* Creates an object in a pool. CAIRN_BAD_ARGUMENT: NULL, or params out of range. CAIRN_NO_MEMORY:
 * the pool has too few bytes left. A failure changes nothing. */
CAIRN_CHECKED cairn_status cairn_rectangle_create(cairn_rectangle_set **set, cairn_pool *pool,
                                                  const cairn_rectangle_params *params);

/* Starts a search over segments[0 ... count-1], which must not change until the search ends. A
 * search that runs is discarded. Segments of length 0 are ignored. CAIRN_BAD_ARGUMENT: NULL, count
 * < 0. CAIRN_FULL: count > max_segments. Constant time.
 *
 * segments: [count] segments */
CAIRN_CHECKED cairn_status cairn_rectangle_begin(cairn_rectangle_set *set,
                                                 const cairn_segment *segments, int32_t count);

/* Works on the search until the budget is used up. CAIRN_MORE: call again. CAIRN_OK: the search has
 * ended, or no search was begun. CAIRN_NOT_FINITE, CAIRN_BAD_ARGUMENT (a coordinate beyond 1e6 m):
 * the search is discarded, and the last result stays. Cost: the sorting of segments and sides, and
 * one unit per two sides that a segment is compared with. Further one unit per four pairs of sides,
 * per four pairs of pairs, and per two segments along a candidate. */
CAIRN_CHECKED cairn_status cairn_rectangle_step(cairn_rectangle_set *set, cairn_budget *budget);

/* The rectangles of the last search that ended, by decreasing score. *count is set to their number.
 * Valid until the next search begins. */
const cairn_rectangle *cairn_rectangle_list(const cairn_rectangle_set *set, int32_t *count);

/* Number of sides, pairs and rectangles that the last search dropped because of max_sides,
 * max_pairs and max_rectangles. */
int32_t cairn_rectangle_dropped(const cairn_rectangle_set *set);

/* The four corners in m, counter-clockwise from (-half_length, -half_width).
 *
 * rectangle: a rectangle of the list
 * corners: set to the corners */
void cairn_rectangle_corners(const cairn_rectangle *rectangle, cairn_vec2 corners[4]);

#ifdef __cplusplus
}
#endif

#endif
