/* rectangle: rectangles that straight segments outline, seen in pieces and with sides missing in
 * part.
 *
 * Segments that are near to each other and nearly parallel are first merged to sides. Two sides
 * that face each other make a pair, which has a slope, a length and a distance; two pairs of
 * perpendicular slopes whose lengths and distances fit each other make a rectangle (Lagunovsky
 * and Ablameyko 1997; Adluru 2008, section 8.4.2). Its strength is the covered share of its
 * outline, less when its angles are not right ones. */
#ifndef CAIRN_RECTANGLE_H
#define CAIRN_RECTANGLE_H

#include "cairn/geometry.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Which side of its outline is free. */
typedef int32_t cairn_rectangle_kind;
enum {
    CAIRN_RECTANGLE_ROOM = 0, /* inside */
    CAIRN_RECTANGLE_BOX = 1,  /* outside */
    CAIRN_RECTANGLE_ANY = 2   /* directions were not asked for */
};

typedef struct cairn_rectangle {
    /* theta in [0, pi/2): the direction of the sides 0 and 1 */
    cairn_pose centre;
    /* m, along theta */
    cairn_real half_length;
    /* m, across */
    cairn_real half_width;
    /* 0 ... 1, share of the outline that segments cover */
    cairn_real covered;
    /* 0 ... 1 */
    cairn_real strength;
    cairn_rectangle_kind kind;
    /* merged sides: 0 and 1 along theta, at -half_width and half_width; 2 and 3 across, at
     * -half_length and half_length */
    int32_t side[4];
} cairn_rectangle;

/* In brackets the defaults. */
typedef struct cairn_rectangle_params {
    /* 1 ... 2^20 (1024) */
    int32_t max_segments;
    /* 1 ... 2^16: of more merged sides than these those of the longest segments are kept (256) */
    int32_t max_sides;
    /* 1 ... 2^20; more pairs of sides are dropped (2048) */
    int32_t max_pairs;
    /* 1 ... 256; of more the strongest are kept (32) */
    int32_t max_rectangles;
    /* not 0: segments have their free side on the left of a -> b (1) */
    int32_t oriented;
    /* m, > 0: segments become one side when their ends are nearer than that to its line ...
     * (0.10) */
    cairn_real merge_distance;
    /* rad, > 0, < pi / 4: ... they differ less than that in direction ... (10 degrees) */
    cairn_real merge_angle;
    /* m, >= 0: ... and lie at most so far apart along it (2) */
    cairn_real merge_gap;
    /* rad, > 0, < pi / 4: by which pairs of sides may differ from parallel and perpendicular (8
     * degrees) */
    cairn_real angle;
    /* m, > 0: shortest side (0.3) */
    cairn_real min_side;
    /* 0 ... 1: of each side at least that share is covered (0.15) ... */
    cairn_real least_side;
    /* 0 ... 1: ... and of the outline that (0.5) */
    cairn_real least_covered;
    /* m, > 0: of rectangles of a kind whose corners are all nearer than that only the strongest
     * stays (0.3) */
    cairn_real separation;
} cairn_rectangle_params;

typedef struct cairn_rectangle_set cairn_rectangle_set;

/* Upper bound of cairn_rectangle_memory as a constant expression. */
#define CAIRN_RECTANGLE_BYTES(segments, sides, pairs, rectangles)                                  \
    (512 + 2 * CAIRN_PIECE_BYTES(segments, sizeof(int32_t)) +                                      \
     CAIRN_PIECE_BYTES(segments, sizeof(cairn_real)) +                                             \
     CAIRN_PIECE_BYTES(sides, 16 + 16 * sizeof(cairn_real)) +                                      \
     CAIRN_PIECE_BYTES(sides, sizeof(int32_t)) + CAIRN_PIECE_BYTES(sides, sizeof(cairn_real)) +    \
     CAIRN_PIECE_BYTES(pairs, 16 + 8 * sizeof(cairn_real)) +                                       \
     2 * CAIRN_PIECE_BYTES(rectangles, sizeof(cairn_rectangle)))

/* The values in brackets above. */
cairn_rectangle_params cairn_rectangle_default(void);

/* 0 for params that create() would refuse. */
size_t cairn_rectangle_memory(const cairn_rectangle_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_rectangle_create(cairn_rectangle_set **set, cairn_pool *pool,
                                                  const cairn_rectangle_params *params);

/* Starts a search over segments[0 ... count-1], which must stay as they are until it ends; a
 * search under way is given up. Segments without length are left out. CAIRN_BAD_ARGUMENT: NULL,
 * count < 0. CAIRN_FULL: count > max_segments. Constant time. */
CAIRN_CHECKED cairn_status cairn_rectangle_begin(cairn_rectangle_set *set,
                                                 const cairn_segment *segments, int32_t count);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: the search has ended, or none was begun.
 * CAIRN_NOT_FINITE, CAIRN_BAD_ARGUMENT (a coordinate beyond 1e6 m): the search is given up and
 * the last result stays. Costs the sorting of segments and sides, a unit for two of the sides
 * that a segment is compared with, for four pairs of sides, for four pairs of pairs, and for two
 * segments along a candidate. */
CAIRN_CHECKED cairn_status cairn_rectangle_step(cairn_rectangle_set *set, cairn_budget *budget);

/* The rectangles of the last search that ended, the strongest first; valid until the next search
 * begins. */
const cairn_rectangle *cairn_rectangle_list(const cairn_rectangle_set *set, int32_t *count);

/* What the last search dropped: sides beyond max_sides, pairs beyond max_pairs, rectangles
 * beyond max_rectangles. */
int32_t cairn_rectangle_dropped(const cairn_rectangle_set *set);

/* Counter-clockwise from (-half_length, -half_width). */
void cairn_rectangle_corners(const cairn_rectangle *rectangle, cairn_vec2 corners[4]);

#ifdef __cplusplus
}
#endif

#endif
