/* corner: where supporting segments of any scans meet at about a right angle.
 *
 * Corners of the global map are the regions of interest of force field simulation (Adluru 2008,
 * section 7.3.4) and the structures by which maps are merged (section 9). All segments are in
 * one frame, free side on the left of a -> b. */
#ifndef CAIRN_CORNER_H
#define CAIRN_CORNER_H

#include "cairn/geometry.h"
#include "cairn/neighbours.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A corner as the free space sees it. */
typedef int32_t cairn_corner_kind;
enum {
    CAIRN_CORNER_MIXED =
        /* the free sides of the two segments disagree, as those of the two faces of a thin wall
         * do */
    0,
    /* the free side lies between the legs: the corner of a room */
    CAIRN_CORNER_CONCAVE = 1,
    /* the obstacle lies between the legs: the corner of a box */
    CAIRN_CORNER_CONVEX = 2
};

typedef struct cairn_corner {
    /* intersection of the two lines */
    cairn_vec2 position;
    /* unit vectors away from the corner along the segments; leg[1] is to the left of leg[0] */
    cairn_vec2 leg[2];
    /* rad, from leg[0] counter-clockwise to leg[1] */
    cairn_real opening;
    /* m, from the corner to the far end of the segment with the nearer far end */
    cairn_real strength;
    /* leg[k] runs along segments[segment[k]] */
    int32_t segment[2];
    cairn_corner_kind kind;
} cairn_corner;

typedef struct cairn_corner_params {
    /* 1 ... 2^28 */
    int32_t max_segments;
    /* 1 ... 2^28; of more than these the strongest are kept */
    int32_t max_corners;
    /* rad, > 0 (80 degrees) */
    cairn_real min_opening;
    /* rad, >= min_opening, < pi (100 degrees) */
    cairn_real max_opening;
    /* m, > 0: the corner is at most so far from an end of both segments (0.30) */
    cairn_real end_distance;
    /* m, >= 0: of corners of one kind nearer than this whose legs agree within merge_angle only
     * the strongest stays (0.10); 0: all stay */
    cairn_real merge_radius;
    /* rad, 0 ... pi (10 degrees) */
    cairn_real merge_angle;
    /* Not 0: the corner is at most end_distance from both segments, wherever along them: T and X
     * crossings count, too, as in section 7.3.4 (0). */
    int32_t crossings;
} cairn_corner_params;

typedef struct cairn_corner_set cairn_corner_set;

/* Upper bound of cairn_corner_memory as a constant expression. */
#define CAIRN_CORNER_BYTES(segments, corners)                                                      \
    (544 + CAIRN_PIECE_BYTES(segments, sizeof(int32_t)) +                                          \
     CAIRN_PIECE_BYTES(segments, sizeof(cairn_box)) +                                              \
     2 * CAIRN_PIECE_BYTES(corners, sizeof(cairn_corner)))

/* 256 segments, 128 corners, and the values in brackets above. */
cairn_corner_params cairn_corner_default(void);

/* 0 for params that create() would refuse. */
size_t cairn_corner_memory(const cairn_corner_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_corner_create(cairn_corner_set **set, cairn_pool *pool,
                                               const cairn_corner_params *params);

/* Starts a search over segments[0 ... count-1], which must stay as they are until it ends; a
 * search under way is given up. Segments without length have no corners. CAIRN_BAD_ARGUMENT:
 * count < 0, or NULL with count > 0. CAIRN_FULL: count > max_segments. Constant time. */
CAIRN_CHECKED cairn_status cairn_corner_begin(cairn_corner_set *set, const cairn_segment *segments,
                                              int32_t count);

/* Goes on with the search. CAIRN_MORE: the budget is used up. CAIRN_OK: the search has ended, or
 * none was begun. CAIRN_NOT_FINITE: a segment is not finite; the search is given up and the last
 * result stays. Costs the sweep over the segments, three units for each pair of near segments,
 * eight for each corner found and, when corners are merged, one for every eight pairs of them at
 * most. */
CAIRN_CHECKED cairn_status cairn_corner_step(cairn_corner_set *set, cairn_budget *budget);

/* The corners of the last search that ended, the strongest first (ties: by the lower, then the
 * higher index of their two segments); valid until the next search ends. */
const cairn_corner *cairn_corner_list(const cairn_corner_set *set, int32_t *count);

/* Corners that the last search found beyond max_corners and dropped. */
int32_t cairn_corner_dropped(const cairn_corner_set *set);

#ifdef __cplusplus
}
#endif

#endif
