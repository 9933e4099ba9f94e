/* line: weighted orthogonal regression of points in the plane, and of segments that are to
 * become one. */
#ifndef CAIRN_LINE_H
#define CAIRN_LINE_H

#include "cairn/geometry.h"
#include "cairn/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_line {
    /* weighted mean of the points, on the line */
    cairn_vec2 mean;
    /* unit; x > 0, or x == 0 and y > 0 */
    cairn_vec2 direction;
    /* extent of the points of weight > 0 along `direction` from `mean`, in m */
    cairn_real low, high;
    /* sum of the weights */
    cairn_real mass;
    /* weighted root mean square of the distances to the line, in m */
    cairn_real rms;
} cairn_line;

/* The line with the least weighted sum of squared orthogonal distances to points[0 ... count-1].
 * weights: [count], >= 0, or NULL when all are 1. Cost: three linear passes. CAIRN_BAD_ARGUMENT:
 * NULL, count < 2, or a weight < 0. CAIRN_NOT_FINITE: a NaN or infinity. CAIRN_EMPTY: the points
 * of weight > 0 are all at one place, so that they have no direction. */
CAIRN_CHECKED cairn_status cairn_line_fit(const cairn_vec2 *points, const cairn_real *weights,
                                          int32_t count, cairn_line *line);

/* The ends of the line's extent, a at `low`. */
cairn_segment cairn_line_segment(const cairn_line *line);

/* One segment in place of two: the orthogonal regression of both, taken as uniformly laid with
 * their masses (number of points, say, or length), with the extent of their four ends. It runs
 * the way of the one with the larger mass, `first` among equals. Source: the segment merging of
 * Lakaemper and Latecki 2006, with moments in place of end points. CAIRN_BAD_ARGUMENT: NULL, or
 * a mass that is not > 0. CAIRN_NOT_FINITE. CAIRN_EMPTY: both are the same point. */
CAIRN_CHECKED cairn_status cairn_segment_merge(cairn_segment first, cairn_real first_mass,
                                               cairn_segment second, cairn_real second_mass,
                                               cairn_segment *merged);

#ifdef __cplusplus
}
#endif

#endif
