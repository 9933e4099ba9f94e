/* ellipse: circles and ellipses outlined by weighted oriented points, by a Hough transform and
 * conic fitting: round rooms, columns, tanks.
 *
 * Every point votes for the centres along its normal (Duda and Hart 1972; Ballard 1981 for the use
 * of directions). The points around a peak vote for the radius. The circle is refined to an ellipse
 * by linear least squares over conics, on the positions and the directions of its inliers. The
 * score is the covered fraction of the outline, reduced by the residuals of the points.
 * Adluru 2008, section 8.7, names ellipses as the next kind of hypothesis. */
#ifndef CAIRN_ELLIPSE_H
#define CAIRN_ELLIPSE_H

#include "cairn/geometry.h"
#include "cairn/object.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Which side of the outline is free space. */
typedef int32_t cairn_ellipse_kind;
enum {
    /* Free space is inside: a round room. */
    CAIRN_ELLIPSE_ROOM = 0,
    /* Free space is outside: a column. */
    CAIRN_ELLIPSE_COLUMN = 1,
    /* Unknown, because the points are not oriented. */
    CAIRN_ELLIPSE_ANY = 2
};

/* Ellipse. */
typedef struct cairn_ellipse {
    /* Centre in m; theta in [0, pi), in rad: direction of the major axis. */
    cairn_pose centre;
    /* Semi-major axis, along theta, in m. */
    cairn_real half_length;
    /* Semi-minor axis, in m, <= half_length. */
    cairn_real half_width;
    /* Fraction of the outline that points cover, 0 ... 1. */
    cairn_real coverage;
    /* Score, 0 ... 1. */
    cairn_real score;
    /* Sum of the weights of the inliers. */
    cairn_real votes;
    /* Weighted root mean square distance of the inliers from the outline, in m. */
    cairn_real rms;
    /* Which side of the outline is free space. */
    cairn_ellipse_kind kind;
} cairn_ellipse;

/* Parameters; defaults in brackets. */
typedef struct cairn_ellipse_params {
    /* 1 ... 256 (32): ellipses. Of more peaks those with the most votes are kept. */
    int32_t max_ellipses;
    /* 8 ... 1024 (96): cells along a side of the square accumulator of centres */
    int32_t cells;
    /* m, > 0, <= 1e6 (0.15): side of a cell. Larger when the points extend too far for `cells` cells. */
    cairn_real cell_size;
    /* 0 or 1 (1): 1: points have free space on the left of their direction; 0: not known */
    int32_t oriented;
    /* m, > 0, <= 1e6 (0.15): least semi-minor axis */
    cairn_real min_radius;
    /* m, > 0, <= 1e6 (6): larger than min_radius: largest semi-major axis */
    cairn_real max_radius;
    /* 1 ... 1e6 (2): largest ratio of the major to the minor axis */
    cairn_real max_axis_ratio;
    /* rad, > 0, <= pi/4 (15 degrees): largest angle of an inlier's direction to the outline */
    cairn_real angle_tolerance;
    /* m, > 0, <= 1e6 (0.05): largest distance of an inlier from the outline */
    cairn_real support_distance;
    /* m, > 0, <= 1e6 (0.10): usual spacing of the points along an outline */
    cairn_real spacing;
    /* > 0 (8): least sum of the weights of an ellipse's inliers */
    cairn_real min_votes;
    /* 0 ... 1 (0.5): least covered fraction of the outline */
    cairn_real min_coverage;
    /* m, > 0, <= 1e6 (0.3): non-maximum suppression: of ellipses of a kind whose centres and axes differ by
     * less only the one with the most votes stays */
    cairn_real separation;
} cairn_ellipse_params;

/* Search for ellipses, with its result. */
typedef struct cairn_ellipse_set cairn_ellipse_set;

/* Returns the default parameters. */
cairn_ellipse_params cairn_ellipse_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_ellipse_check(const cairn_ellipse_params *params,
                                               cairn_object_fault *fault);

/* Bytes that create() allocates. 0 for params that create() would refuse. */
size_t cairn_ellipse_memory(const cairn_ellipse_params *params);

/* Creates an object in a pool. CAIRN_BAD_ARGUMENT: NULL, or params out of range. CAIRN_NO_MEMORY:
 * the pool has too few bytes left. A failure changes nothing. */
CAIRN_CHECKED cairn_status cairn_ellipse_create(cairn_ellipse_set **set, cairn_pool *pool,
                                                const cairn_ellipse_params *params);

/* Changes tolerances, for example as the uncertainty of the points shrinks. A search that runs is
 * discarded. CAIRN_BAD_ARGUMENT: params that create() would refuse, or other max_ellipses, cells or
 * orientation than at creation. Constant time. */
CAIRN_CHECKED cairn_status cairn_ellipse_adjust(cairn_ellipse_set *set,
                                                const cairn_ellipse_params *params);

/* Starts a search over points[0 ... count-1], which must not change until the search ends. A search
 * that runs is discarded. weights: [count], >= 0, or NULL when all are 1. CAIRN_BAD_ARGUMENT: NULL,
 * count < 0. Constant time.
 *
 * points: [count] points */
CAIRN_CHECKED cairn_status cairn_ellipse_begin(cairn_ellipse_set *set,
                                               const cairn_oriented_point *points,
                                               const cairn_real *weights, int32_t count);

/* Works on the search until the budget is used up. CAIRN_MORE: call again. CAIRN_OK: the search has
 * ended, or no search was begun. CAIRN_NOT_FINITE, CAIRN_BAD_ARGUMENT (a weight below 0 or beyond
 * 1e6, a coordinate beyond 1e6 m): the search is discarded, and the last result stays. Cost: one
 * unit per eight centres that a point votes for; per 16 cells (a candidate for a peak: one more per
 * 32 cells around the candidate; a peak: one per eight other peaks); per four points of an
 * ellipse's bounds; five times one per peak and two points; two more per inlier. Greatest operation:
 * the comparison of all ellipses, max_ellipses^2 / 8 units, or the votes of a point. */
CAIRN_CHECKED cairn_status cairn_ellipse_step(cairn_ellipse_set *set, cairn_budget *budget);

/* The ellipses of the last search that ended, by decreasing votes. *count is set to their number.
 * Valid until the next search ends. */
const cairn_ellipse *cairn_ellipse_list(const cairn_ellipse_set *set, int32_t *count);

/* Number of peaks of the last search that were dropped because of max_ellipses. */
int32_t cairn_ellipse_dropped(const cairn_ellipse_set *set);

/* ---- Geometry of an ellipse ---- */

/* The point of the outline at a parametric (eccentric) angle in rad, 0 on the major axis. The
 * direction has free space on its left: counter-clockwise for rooms and unknown kinds, clockwise
 * for columns.
 *
 * ellipse: an ellipse of the list
 * angle: parametric angle, rad */
cairn_oriented_point cairn_ellipse_point(const cairn_ellipse *ellipse, cairn_real angle);

/* Perimeter in m by Ramanujan's first formula, accurate to 0.1 % for an axis ratio up to 4.
 *
 * ellipse: an ellipse of the list */
cairn_real cairn_ellipse_length(const cairn_ellipse *ellipse);

/* Signed distance of a point from the outline to first order (Sampson distance), in m, positive
 * outside. *normal is set to the outward unit normal of the outline near the point. At the centre
 * both are those of the closest end of the minor axis.
 *
 * ellipse: an ellipse of the list
 * point: point, m
 * normal: set to the outward unit normal */
cairn_real cairn_ellipse_distance(const cairn_ellipse *ellipse, cairn_vec2 point,
                                  cairn_vec2 *normal);

/* 1 when a point is an inlier of the ellipse: within max_distance m of the outline, with the angle
 * between its direction and the outline's of a sine of at most max_sine. For kinds other than ANY
 * the directions must also have the same sense.
 *
 * ellipse: an ellipse of the list
 * point: point with its direction
 * max_distance: m, >= 0
 * max_sine: sine of the greatest angle, 0 ... 1 */
int32_t cairn_ellipse_is_inlier(const cairn_ellipse *ellipse, const cairn_oriented_point *point,
                                cairn_real max_distance, cairn_real max_sine);

#ifdef __cplusplus
}
#endif

#endif
