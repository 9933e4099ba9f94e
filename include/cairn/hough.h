/* hough: straight lines that the most weight of oriented points lies on, wherever along them.
 *
 * What a fit of single scans cannot see, that walls far apart are one line, shows as a peak of
 * votes: every point votes for the lines through it whose direction is about its own (Hough 1962;
 * Ballard 1981 for the use of directions). Peaks that are the greatest about them become lines by
 * weighted orthogonal regression of the points near them, with the extent of their support. Adluru
 * 2008, section 8.4.1, finds the line hypotheses of virtual scans with a Hough transform.
 *
 * Mode as written (cairn_hough_as_written): the transform of section 8.4.1, of all points, "we
 * do not use the local linear information": a point votes for every line through it, whatever
 * its direction, with one vote a row of the accumulator, and `votes` of a line is the number
 * (with weights, the weight) of the points that took part. Choices: bins of 1 degree and 0.10 m;
 * the line is the middle of its bin, without a fit; a peak has no greater bin within the
 * separation; the extent reaches from the first to the last of the points that took part. */
#ifndef CAIRN_HOUGH_H
#define CAIRN_HOUGH_H

#include "cairn/geometry.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* In brackets the defaults. */
typedef struct cairn_hough_params {
    /* 1 ... 256; of more peaks than these the highest are kept (32) */
    int32_t max_lines;
    /* bins of half a turn, 8 ... 2^12 (180) */
    int32_t angles;
    /* bins of the distance from the middle of the points, 8 ... 2^14 (256) */
    int32_t distances;
    /* m, > 0: width of these bins, unless the points reach too far for them (0.05) */
    cairn_real distance_step;
    /* not 0: the two faces of a wall are two lines; 0: directions count modulo half a turn (1) */
    int32_t oriented;
    /* CAIRN_MODE_DEFAULT; CAIRN_MODE_AS_WRITTEN: oriented, angle_tolerance and support_distance
     * are not read (CAIRN_MODE_DEFAULT) */
    int32_t mode;
    /* rad, > 0, <= pi / 2: a point votes for lines that differ less from its direction (10
     * degrees) */
    cairn_real angle_tolerance;
    /* m, > 0: of lines that are nearer to each other than this in distance from the middle ...
     * (0.20) */
    cairn_real separation;
    /* rad, > 0, <= pi / 2: ... and than this in direction only the stronger stays (10 degrees) */
    cairn_real separation_angle;
    /* m, > 0: points nearer to a line than this support it (0.05) */
    cairn_real support_distance;
    /* m, > 0: how far apart the points of a line usually are (0.10) */
    cairn_real spacing;
    /* > 0: lines with less weight of points are no lines (20) */
    cairn_real least_votes;
} cairn_hough_params;

typedef struct cairn_hough_line {
    /* weighted mean of the support, on the line */
    cairn_vec2 point;
    /* unit; with orientation that of the points; else, and as written, x > 0, or x == 0 and y >
     * 0 */
    cairn_vec2 direction;
    /* m, extent of the support along `direction` from `point` */
    cairn_real low, high;
    /* m of the extent without the gaps that are wider than 2 * spacing */
    cairn_real covered;
    /* weight of the support */
    cairn_real votes;
    /* m, weighted root mean square distance of the support from the line */
    cairn_real rms;
} cairn_hough_line;

typedef struct cairn_hough cairn_hough;

/* Upper bound of cairn_hough_memory as a constant expression. */
#define CAIRN_HOUGH_BYTES(angles, distances, lines)                                                \
    (640 + CAIRN_PIECE_BYTES(2 * (angles), sizeof(cairn_vec2)) +                                   \
     CAIRN_PIECE_BYTES(2 * (size_t)(angles) * (size_t)(distances), sizeof(cairn_real)) +           \
     CAIRN_PIECE_BYTES((distances) / 32 + 1, sizeof(uint32_t)) +                                   \
     2 * CAIRN_PIECE_BYTES(lines, sizeof(cairn_hough_line)) +                                      \
     CAIRN_PIECE_BYTES(lines, 8 + sizeof(double)))

/* The values in brackets above. */
cairn_hough_params cairn_hough_default(void);

/* Mode as written: 180 angles, 256 distances of 0.10 m, lines of 20 points and more. */
cairn_hough_params cairn_hough_as_written(void);

/* 0 for params that create() would refuse. */
size_t cairn_hough_memory(const cairn_hough_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_hough_create(cairn_hough **hough, cairn_pool *pool,
                                              const cairn_hough_params *params);

/* Other tolerances, separations and least votes, as the uncertainty of the points shrinks, say.
 * A search under way is given up. CAIRN_BAD_ARGUMENT: params that create() would refuse, or with
 * other max_lines, angles, distances, orientation or mode. */
CAIRN_CHECKED cairn_status cairn_hough_adjust(cairn_hough *hough, const cairn_hough_params *params);

/* Starts a search over points[0 ... count-1], which must stay as they are until it ends; a
 * search under way is given up. weights: [count], >= 0, or NULL when all are 1.
 * CAIRN_BAD_ARGUMENT: NULL, count < 0. Constant time. */
CAIRN_CHECKED cairn_status cairn_hough_begin(cairn_hough *hough, const cairn_oriented_point *points,
                                             const cairn_real *weights, int32_t count);

/* Goes on. CAIRN_MORE: the budget is used up. CAIRN_OK: the search has ended, or none was begun.
 * CAIRN_NOT_FINITE, CAIRN_BAD_ARGUMENT (a weight below 0; a coordinate beyond 1e6 m, a weight
 * beyond 1e6): the search is given up, and the last result stays. Costs two units for each point
 * and one for four bins that it votes for, one for 64 bins in all, and one for each line and
 * four points, twice; as written a point votes for a bin in each row, and points are gone
 * through once a line. */
CAIRN_CHECKED cairn_status cairn_hough_step(cairn_hough *hough, cairn_budget *budget);

/* The lines of the last search that ended, the one with the most votes first; valid until the
 * next search ends. */
const cairn_hough_line *cairn_hough_list(const cairn_hough *hough, int32_t *count);

/* Peaks that the last search found beyond max_lines and dropped. */
int32_t cairn_hough_dropped(const cairn_hough *hough);

/* The ends of a line's extent, a at `low`. */
cairn_segment cairn_hough_segment(const cairn_hough_line *line);

#ifdef __cplusplus
}
#endif

#endif
