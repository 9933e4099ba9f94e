/* symmetric_point: symmetric points of pairs of edges: centres of discs that touch two edges,
 * candidate points of an object's skeleton (symmetry axis, medial axis).
 *
 * Adluru 2008, section 2. An edgel is a point of an edge with its direction. The perpendicular
 * bisector of the chord between two edgels is the mirror axis that maps one position to the other.
 * Each edge normal intersects the bisector, and the symmetric point (SP) lies between the two
 * intersections. The deviation of the normals from the directions to the SP measures the asymmetry
 * of the pair. Image coordinates, pixels; the two sides of an edge are not distinguished. */
#ifndef CAIRN_SYMMETRIC_POINT_H
#define CAIRN_SYMMETRIC_POINT_H

#include "cairn/geometry.h"
#include "cairn/neighbours.h"
#include "cairn/object.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Symmetric point (SP) of two edgels: centre and radius of a disc that touches both. */
typedef struct cairn_symmetric_point {
    /* px: centre of the disc */
    cairn_vec2 centre;
    /* px, distance of the centre to both edgels */
    cairn_real radius;
    /* rad, mean angle between the edgels' normals and their directions to the centre */
    cairn_real deviation;
    /* px, contact points: positions of the two edgels, on the first and on the second segment */
    cairn_vec2 contact[2];
    /* indices of the segments, first < second; 0 and 1 from the functions for one pair */
    int32_t first, second;
} cairn_symmetric_point;

/* Parameters; defaults in brackets. */
typedef struct cairn_symmetric_point_params {
    /* 1 ... 2^26 (4096): capacity for segments */
    int32_t max_segments;
    /* 1 ... 2^28 (8192): capacity for points; of more the most symmetric are kept */
    int32_t max_points;
    /* 1 ... 16 (5): greatest number of edgels sampled per segment */
    int32_t samples;
    /* CAIRN_MODE_DEFAULT or CAIRN_MODE_AS_WRITTEN (CAIRN_MODE_DEFAULT): definition of the centre.
     * Default: both normals deviate equally from the directions to the centre. As written: the
     * midpoint of their intersections with the bisector. */
    int32_t mode;
    /* px, > 0 (4): spacing of the sampled edgels */
    cairn_real sample_step;
    /* px, >= 0 (2): least radius */
    cairn_real min_radius;
    /* px, >= min_radius, finite (100): greatest radius */
    cairn_real max_radius;
    /* rad, > 0, < pi/2 (60 degrees): greatest angle between a normal and the chord */
    cairn_real max_angle;
    /* rad, >= 0 (45 degrees): greatest deviation */
    cairn_real max_deviation;
} cairn_symmetric_point_params;

/* Detector of symmetric points, and the points of its last run. */
typedef struct cairn_symmetric_point_set cairn_symmetric_point_set;

/* Returns the default parameters. */
cairn_symmetric_point_params cairn_symmetric_point_default(void);

/* Returns the defaults with centres as in Adluru 2008, figure 2.3. */
cairn_symmetric_point_params cairn_symmetric_point_as_written(void);

/* Computes the SP of two edgels; the signs of their directions do not matter. Returns 1, or 0
 * without an SP: both edgels at one position, or a normal at more than max_angle (rad, below pi/2)
 * to the chord. The centre is the point on the bisector where both normals deviate equally: both
 * are rotated to the mean of their angles with the chord and intersected with the bisector.
 * Constant time.
 *
 * first, second: the edgels; directions of length 1
 * max_angle: rad, > 0, < pi/2
 * point: set when 1 is returned */
int32_t cairn_symmetric_point_of(cairn_oriented_point first, cairn_oriented_point second,
                                 cairn_real max_angle, cairn_symmetric_point *point);

/* Computes the SP of two segments: the one of least deviation over all pairs of their samples.
 * Ties: the nearest to the midpoint of its chord, then the first. Returns 0 when no SP lies within
 * the params' radii and deviation, or a segment has zero length. Cost: samples^2.
 *
 * first, second: the segments, px
 * point: set when 1 is returned */
int32_t cairn_symmetric_point_of_segments(const cairn_symmetric_point_params *params,
                                          cairn_segment first, cairn_segment second,
                                          cairn_symmetric_point *point);

/* Returns the quality of an SP, exp(-deviation^2 / (2 sigma^2)), Adluru 2008 (2.10); sigma in rad,
 * > 0.
 *
 * point: symmetric point
 * sigma: rad, > 0 */
cairn_real cairn_symmetric_point_quality(const cairn_symmetric_point *point, cairn_real sigma);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_symmetric_point_check(const cairn_symmetric_point_params *params,
                                                       cairn_object_fault *fault);

/* Returns the bytes that create() takes from the pool; 0 for params that create() would refuse. */
size_t cairn_symmetric_point_memory(const cairn_symmetric_point_params *params);

/* Creates a point set in the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_symmetric_point_create(cairn_symmetric_point_set **set,
                                                        cairn_pool *pool,
                                                        const cairn_symmetric_point_params *params);

/* Replaces the range of radii from the next begin() on. CAIRN_BAD_ARGUMENT: NULL, or radii that
 * create() would refuse.
 *
 * min_radius, max_radius: px, as in params */
CAIRN_CHECKED cairn_status cairn_symmetric_point_set_radii(cairn_symmetric_point_set *set,
                                                           cairn_real min_radius,
                                                           cairn_real max_radius);

/* Starts on segments[0 ... count-1] and discards earlier results. The segments must stay valid
 * until step() returns CAIRN_OK. CAIRN_BAD_ARGUMENT: count < 0, or NULL with count > 0. CAIRN_FULL:
 * count > max_segments. Constant time.
 *
 * segments: [count] segments, px */
CAIRN_CHECKED cairn_status cairn_symmetric_point_begin(cairn_symmetric_point_set *set,
                                                       const cairn_segment *segments,
                                                       int32_t count);

/* Resumes the search over the pairs of segments that a disc of at most max_radius can touch (sweep
 * and prune). CAIRN_MORE: the budget is exhausted. CAIRN_OK: the points are complete, or nothing
 * was begun. CAIRN_NOT_FINITE: a segment is not finite; the search ends without points. Cost: the
 * sweep over the segments' boxes, three units per pair of samples, and four per pair of segments
 * and per point. */
CAIRN_CHECKED cairn_status cairn_symmetric_point_step(cairn_symmetric_point_set *set,
                                                      cairn_budget *budget);

/* Returns the points by ascending deviation (ties: by first, then by second); NULL until step()
 * returns CAIRN_OK; valid until the next begin(). *count, when not NULL, is their number. */
const cairn_symmetric_point *cairn_symmetric_point_list(const cairn_symmetric_point_set *set,
                                                        int32_t *count);

/* Returns the number of points that the last search dropped beyond max_points. */
int32_t cairn_symmetric_point_dropped(const cairn_symmetric_point_set *set);

#ifdef __cplusplus
}
#endif

#endif
