/* symmetric_point: centres of the discs that touch two edges: the places where the axis of an
 * object may run.
 *
 * Adluru 2008, section 2: of two edgels (points of an edge with its direction) the perpendicular
 * bisector of their chord is the mirror that carries one place to the other; each edge normal
 * meets it in a point, and the symmetric point (SP) lies between the two. How far the normals
 * deviate from the way to it says how symmetric the two edgels are. Image coordinates, pixels;
 * sides of edges are not told apart. */
#ifndef CAIRN_SYMMETRIC_POINT_H
#define CAIRN_SYMMETRIC_POINT_H

#include "cairn/geometry.h"
#include "cairn/neighbours.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_symmetric_point {
    cairn_vec2 centre;
    /* px, its distance to both edgels */
    cairn_real radius;
    /* rad, mean angle between the normals of the edgels and their way to the centre */
    cairn_real deviation;
    /* the two edgels, on the first and on the second segment */
    cairn_vec2 touch[2];
    /* indices of the segments, first < second; 0 and 1 from the functions for one pair */
    int32_t first, second;
} cairn_symmetric_point;

typedef struct cairn_symmetric_point_params {
    /* 1 ... 2^26 (4096) */
    int32_t max_segments;
    /* 1 ... 2^28; of more than these the most symmetric are kept (8192) */
    int32_t max_points;
    /* 1 ... 16 edgels of each segment at most (5) */
    int32_t samples;
    /* of centres: CAIRN_MODE_DEFAULT: both normals deviate from the way to it alike;
     * CAIRN_MODE_AS_WRITTEN: the middle between where they meet the bisector (CAIRN_MODE_DEFAULT) */
    int32_t mode;
    /* px, > 0, between them (4) */
    cairn_real sample_step;
    /* px, >= 0 (2) */
    cairn_real min_radius;
    /* px, >= min_radius, finite (100) */
    cairn_real max_radius;
    /* rad, > 0, < pi/2: normals farther from the chord have no SP (60 degrees) */
    cairn_real max_angle;
    /* rad, >= 0 (45 degrees) */
    cairn_real max_deviation;
} cairn_symmetric_point_params;

typedef struct cairn_symmetric_point_set cairn_symmetric_point_set;

/* The values in brackets above. */
cairn_symmetric_point_params cairn_symmetric_point_default(void);

/* The same, with centres as in Adluru 2008, figure 2.3. */
cairn_symmetric_point_params cairn_symmetric_point_as_written(void);

/* The SP of two edgels; the senses of their directions do not matter. 1: here it is. 0: there is
 * none: they are at one place, or a normal is more than max_angle (rad, below pi/2) from their
 * chord. Its centre is where the normals would meet the bisector if both deviated from the chord
 * by the mean of their angles, so that both deviate from the way to it alike. Constant time. */
int32_t cairn_symmetric_point_of(cairn_oriented_point first, cairn_oriented_point second,
                                 cairn_real max_angle, cairn_symmetric_point *point);

/* The SP of two segments: that of least deviation of all pairs of their samples; of equally good
 * ones that nearest to the middle of its chord, then the first. 0: there is none within the
 * params' radii and deviation, or a segment has no length. Cost: samples^2. */
int32_t cairn_symmetric_point_of_segments(const cairn_symmetric_point_params *params,
                                          cairn_segment first, cairn_segment second,
                                          cairn_symmetric_point *point);

/* exp(-deviation^2 / (2 sigma^2)), Adluru 2008 (2.10); sigma in rad, > 0. */
cairn_real cairn_symmetric_point_quality(const cairn_symmetric_point *point, cairn_real sigma);

/* 0 for params that create() would refuse. */
size_t cairn_symmetric_point_memory(const cairn_symmetric_point_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_symmetric_point_create(cairn_symmetric_point_set **set,
                                                        cairn_pool *pool,
                                                        const cairn_symmetric_point_params *params);

/* Other radii than those of the params, from the next begin() on. CAIRN_BAD_ARGUMENT: NULL, or
 * ones that create() would refuse. */
CAIRN_CHECKED cairn_status cairn_symmetric_point_set_radii(cairn_symmetric_point_set *set,
                                                           cairn_real min_radius,
                                                           cairn_real max_radius);

/* Starts on segments[0 ... count-1], which must stay until step() returns CAIRN_OK; what was
 * found before is gone. CAIRN_BAD_ARGUMENT: count < 0, or NULL with count > 0. CAIRN_FULL: count
 * > max_segments. Constant time. */
CAIRN_CHECKED cairn_status cairn_symmetric_point_begin(cairn_symmetric_point_set *set,
                                                       const cairn_segment *segments,
                                                       int32_t count);

/* Goes on over the pairs of segments that discs of max_radius can touch. CAIRN_MORE: the budget
 * is used up. CAIRN_OK: the points stand, or nothing was begun. CAIRN_NOT_FINITE: a segment is
 * not finite; given up, and there are none. Costs the sweep over the segments' boxes, three
 * units for each pair of samples, and four for each pair of segments and for each point. */
CAIRN_CHECKED cairn_status cairn_symmetric_point_step(cairn_symmetric_point_set *set,
                                                      cairn_budget *budget);

/* The points, the most symmetric first (ties: by first, then by second); none until step()
 * returns CAIRN_OK; valid until the next begin(). *count, when not NULL, is their number. */
const cairn_symmetric_point *cairn_symmetric_point_list(const cairn_symmetric_point_set *set,
                                                        int32_t *count);

/* Points that the last search found beyond max_points and dropped. */
int32_t cairn_symmetric_point_dropped(const cairn_symmetric_point_set *set);

#ifdef __cplusplus
}
#endif

#endif
