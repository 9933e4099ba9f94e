/* hough: straight lines in oriented points by a Hough transform.
 *
 * Finds collinear walls that are far apart, which a fit of single scans cannot relate. Every point
 * votes for the lines through it whose direction is about its own (Hough 1962; Ballard 1981 for the
 * use of directions). Peaks of the accumulator, after non-maximum suppression, become lines by
 * weighted orthogonal regression of their inliers, with the extent of their support. Adluru 2008,
 * section 8.4.1, finds the line hypotheses of virtual scans with a Hough transform.
 *
 * Mode as written (cairn_hough_as_written): the transform of section 8.4.1, of all points: "we do
 * not use the local linear information". A point votes for every line through it, whatever its
 * direction, with one vote per row of the accumulator. `votes` of a line is the number (with
 * weights, the weight) of the points in its bin. Choices: bins of 1 degree and 0.10 m; the line is
 * the centre of its bin, without a fit; a peak has no greater bin within the separation; the extent
 * reaches from the first to the last point of the bin. */
#ifndef CAIRN_HOUGH_H
#define CAIRN_HOUGH_H

#include "cairn/geometry.h"
#include "cairn/object.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Parameters; defaults in brackets. */
typedef struct cairn_hough_params {
    /* 1 ... 256 (32): lines. Of more peaks those with the most votes are kept. */
    int32_t max_lines;
    /* 8 ... 2^12 (180): bins of the direction over half a turn */
    int32_t angles;
    /* 8 ... 2^14 (256): bins of the distance from the centre of the points */
    int32_t distances;
    /* m, > 0, <= 1e6 (0.05): width of a bin of the distance. Wider when the points extend too far for
     * `distances` bins. */
    cairn_real distance_step;
    /* 0 or 1 (1): 1: the two faces of a wall are two lines; 0: directions count modulo half a
     * turn */
    int32_t oriented;
    /* CAIRN_MODE_DEFAULT or CAIRN_MODE_AS_WRITTEN (CAIRN_MODE_DEFAULT): as written, oriented,
     * angle_tolerance and support_distance are ignored */
    int32_t mode;
    /* rad, > 0, <= pi/2 (10 degrees): a point votes for lines whose direction differs by less from
     * its own */
    cairn_real angle_tolerance;
    /* m, > 0, <= 1e6 (0.20): radius of the non-maximum suppression in distance: of lines closer to each
     * other than this and than separation_angle only the one with more votes stays */
    cairn_real separation;
    /* rad, > 0, <= pi/2 (10 degrees): radius of the non-maximum suppression in direction */
    cairn_real separation_angle;
    /* m, > 0, <= 1e6 (0.05): points closer to a line than this are inliers */
    cairn_real support_distance;
    /* m, > 0, <= 1e6 (0.10): usual spacing of the points along a line */
    cairn_real spacing;
    /* > 0 (20): least sum of the weights of a line's inliers */
    cairn_real min_votes;
} cairn_hough_params;

/* Line with the extent of its inliers. */
typedef struct cairn_hough_line {
    /* Weighted centroid of the inliers, in m; a point of the line. */
    cairn_vec2 point;
    /* Unit direction: when oriented that of the points; else, and as written, x > 0, or x == 0 and
     * y > 0. */
    cairn_vec2 direction;
    /* Extent of the inliers along `direction`, from `point`, in m. */
    cairn_real low, high;
    /* Length of the extent without the gaps wider than 2 * spacing, in m. */
    cairn_real covered_length;
    /* Sum of the weights of the inliers. */
    cairn_real votes;
    /* Weighted root mean square distance of the inliers from the line, in m. */
    cairn_real rms;
} cairn_hough_line;

/* Hough transform with its accumulator. */
typedef struct cairn_hough cairn_hough;

/* Upper bound of cairn_hough_memory as a constant expression. */
#define CAIRN_HOUGH_BYTES(angles, distances, lines)                                                \
    (640 + CAIRN_ALLOCATION_BYTES(2 * (angles), sizeof(cairn_vec2)) +                              \
     CAIRN_ALLOCATION_BYTES(2 * (size_t)(angles) * (size_t)(distances), sizeof(cairn_real)) +      \
     CAIRN_ALLOCATION_BYTES((distances) / 32 + 1, sizeof(uint32_t)) +                              \
     2 * CAIRN_ALLOCATION_BYTES(lines, sizeof(cairn_hough_line)) +                                 \
     CAIRN_ALLOCATION_BYTES(lines, 8 + sizeof(double)))

/* Returns the default parameters. */
cairn_hough_params cairn_hough_default(void);

/* Parameters of the mode as written: 180 angles, 256 distances of 0.10 m, lines of at least 20
 * points. */
cairn_hough_params cairn_hough_as_written(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_hough_check(const cairn_hough_params *params,
                                             cairn_object_fault *fault);

/* Bytes that create() allocates. 0 for params that create() would refuse. */
size_t cairn_hough_memory(const cairn_hough_params *params);

/* Creates an object in a pool. CAIRN_BAD_ARGUMENT: NULL, or params out of range. CAIRN_NO_MEMORY:
 * the pool has too few bytes left. A failure changes nothing. */
CAIRN_CHECKED cairn_status cairn_hough_create(cairn_hough **hough, cairn_pool *pool,
                                              const cairn_hough_params *params);

/* Changes tolerances, separations and the least votes, for example as the uncertainty of the points
 * shrinks. A search that runs is discarded. CAIRN_BAD_ARGUMENT: params that create() would refuse,
 * or other max_lines, angles, distances, orientation or mode than at creation. Constant time. */
CAIRN_CHECKED cairn_status cairn_hough_adjust(cairn_hough *hough, const cairn_hough_params *params);

/* Starts a search over points[0 ... count-1], which must not change until the search ends. A search
 * that runs is discarded. weights: [count], >= 0, or NULL when all are 1. CAIRN_BAD_ARGUMENT: NULL,
 * count < 0. Constant time.
 *
 * points: [count] points */
CAIRN_CHECKED cairn_status cairn_hough_begin(cairn_hough *hough, const cairn_oriented_point *points,
                                             const cairn_real *weights, int32_t count);

/* Works on the search until the budget is used up. CAIRN_MORE: call again. CAIRN_OK: the search has
 * ended, or no search was begun. CAIRN_NOT_FINITE, CAIRN_BAD_ARGUMENT (a weight below 0 or beyond
 * 1e6, a coordinate beyond 1e6 m): the search is discarded, and the last result stays. Cost: two
 * units per point and one per four bins that the point votes for; one per 64 bins of the
 * accumulator; twice one per line and four points. As written: one bin per row and point, and one
 * pass over the points per line. Greatest operation: the comparison of all lines, max_lines^2 / 8
 * units, or the votes of a point. */
CAIRN_CHECKED cairn_status cairn_hough_step(cairn_hough *hough, cairn_budget *budget);

/* The lines of the last search that ended, by decreasing votes. *count is set to their number.
 * Valid until the next search ends. */
const cairn_hough_line *cairn_hough_list(const cairn_hough *hough, int32_t *count);

/* Number of peaks of the last search that were dropped because of max_lines. */
int32_t cairn_hough_dropped(const cairn_hough *hough);

/* The segment from `low` to `high` on a line.
 *
 * line: a line of the list */
cairn_segment cairn_hough_segment(const cairn_hough_line *line);

#ifdef __cplusplus
}
#endif

#endif
