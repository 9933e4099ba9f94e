/* ellipse: circles and ellipses that weighted oriented points outline: round rooms, columns, tanks.
 *
 * Every point votes for the centres that lie along its normal (Duda and Hart 1972; Ballard 1981
 * for the use of directions), and the points about the greatest votes for the distance from
 * there. The circle that comes of it is refined by least squares over conics, by the places of
 * its points and by their directions, so that it becomes an ellipse as far as they ask for it.
 * Its strength is the share of its outline that points cover, less when they lie off it. Adluru
 * 2008, section 8.6, names ellipses as the next kind of hypothesis. */
#ifndef CAIRN_ELLIPSE_H
#define CAIRN_ELLIPSE_H

#include "cairn/geometry.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Which side of its outline is free. */
typedef int32_t cairn_ellipse_kind;
enum {
    CAIRN_ELLIPSE_ROOM = 0,   /* inside */
    CAIRN_ELLIPSE_COLUMN = 1, /* outside */
    CAIRN_ELLIPSE_ANY = 2     /* directions were not asked for */
};

typedef struct cairn_ellipse {
    cairn_pose centre;      /* theta in [0, pi): direction of the longer axis */
    cairn_real half_length; /* m, along theta */
    cairn_real half_width;  /* m, across, <= half_length */
    cairn_real covered;     /* 0 ... 1, share of the outline that points cover */
    cairn_real strength;    /* 0 ... 1 */
    cairn_real votes;       /* weight of the points on it */
    cairn_real rms;         /* m, weighted root mean square distance of these from it */
    cairn_ellipse_kind kind;
} cairn_ellipse;

/* In brackets the defaults. */
typedef struct cairn_ellipse_params {
    /* 1 ... 256; of more centres than these those with the most votes are kept (32) */
    int32_t max_ellipses;
    /* 8 ... 1024: of a side of the square of centres (96) */
    int32_t cells;
    /* m, > 0: width of these, unless the points reach too far for them (0.15) */
    cairn_real cell;
    /* not 0: points have their free side on the left of their direction (1) */
    int32_t oriented;
    /* m, > 0: of half_width (0.15) */
    cairn_real least_radius;
    /* m, > least_radius: of half_length (6) */
    cairn_real most_radius;
    /* >= 1: of half_length to half_width (2) */
    cairn_real most_ratio;
    /* rad, > 0, <= pi / 4: how far points on it may be off its direction (15 degrees) */
    cairn_real angle_tolerance;
    /* m, > 0: and how far off its outline (0.05) */
    cairn_real support_distance;
    /* m, > 0: how far apart the points of an outline usually are (0.10) */
    cairn_real spacing;
    /* > 0: less weight of points is no ellipse (8) */
    cairn_real least_votes;
    /* 0 ... 1: nor is a smaller share of the outline (0.5) */
    cairn_real least_covered;
    /* m, > 0: of ellipses of a kind whose centres and axes differ less only the strongest stays
     * (0.3) */
    cairn_real separation;
} cairn_ellipse_params;

typedef struct cairn_ellipse_set cairn_ellipse_set;

/* The values in brackets above. */
cairn_ellipse_params cairn_ellipse_default(void);

/* 0 for params that create() would refuse. */
size_t cairn_ellipse_memory(const cairn_ellipse_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_ellipse_create(cairn_ellipse_set **set, cairn_pool *pool,
                                                const cairn_ellipse_params *params);

/* Other tolerances, as the uncertainty of the points shrinks, say. A search under way is given
 * up. CAIRN_BAD_ARGUMENT: params that create() would refuse, or with other max_ellipses, cells
 * or orientation. */
CAIRN_CHECKED cairn_status cairn_ellipse_adjust(cairn_ellipse_set *set,
                                                const cairn_ellipse_params *params);

/* Starts a search over points[0 ... count-1], which must stay as they are until it ends; a
 * search under way is given up. weights: [count], >= 0, or NULL when all are 1.
 * CAIRN_BAD_ARGUMENT: NULL, count < 0. Constant time. */
CAIRN_CHECKED cairn_status cairn_ellipse_begin(cairn_ellipse_set *set,
                                               const cairn_oriented_point *points,
                                               const cairn_real *weights, int32_t count);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: the search has ended, or none was begun.
 * CAIRN_NOT_FINITE, CAIRN_BAD_ARGUMENT (a weight below 0 or beyond 1e6, a coordinate beyond 1e6
 * m): the search is given up, and the last result stays. Costs a unit for eight centres that a
 * point votes for, for 16 cells (one that may be a peak costs one more for 32 cells about it, a
 * peak one for eight others), for four points of an ellipse's bounds, and for each centre and
 * two points, five times; two more for each point that is on the ellipse then. */
CAIRN_CHECKED cairn_status cairn_ellipse_step(cairn_ellipse_set *set, cairn_budget *budget);

/* The ellipses of the last search that ended, the one with the most votes first; valid until the
 * next search ends. */
const cairn_ellipse *cairn_ellipse_list(const cairn_ellipse_set *set, int32_t *count);

/* Centres that the last search found beyond max_ellipses and dropped. */
int32_t cairn_ellipse_dropped(const cairn_ellipse_set *set);

/* ---- Shapes ---- */

/* The point at an angle of its circle, from the longer axis on; its direction has the free side
 * on the left: counter-clockwise for rooms and where directions were not asked for, clockwise
 * for columns. */
cairn_oriented_point cairn_ellipse_point(const cairn_ellipse *ellipse, cairn_real angle);

/* m of the outline (Ramanujan's first formula, good to 0.1 % for axes as 1 to 4). */
cairn_real cairn_ellipse_length(const cairn_ellipse *ellipse);

/* m, distance of a point from the outline to first order, positive outside; *normal: unit,
 * outward, there. At the centre that of the nearest end of the shorter axis. */
cairn_real cairn_ellipse_distance(const cairn_ellipse *ellipse, cairn_vec2 point,
                                  cairn_vec2 *normal);

/* 1 when a point lies within `distance` of the outline and its direction within an angle of that
 * `sine` of the outline's; of a kind other than ANY it runs the same way. */
int32_t cairn_ellipse_has(const cairn_ellipse *ellipse, const cairn_oriented_point *point,
                          cairn_real distance, cairn_real sine);

#ifdef __cplusplus
}
#endif

#endif
