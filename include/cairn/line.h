/* line: line fitting by weighted orthogonal regression (total least squares), and merging of two
 * segments into one. */
#ifndef CAIRN_LINE_H
#define CAIRN_LINE_H

#include "cairn/geometry.h"
#include "cairn/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Fitted line. */
typedef struct cairn_line {
    /* Weighted centroid of the points, in m; a point of the line. */
    cairn_vec2 mean;
    /* Unit direction; x > 0, or x == 0 and y > 0. */
    cairn_vec2 direction;
    /* Extent of the points of weight > 0 along `direction`, from `mean`, in m. */
    cairn_real low, high;
    /* Sum of the weights. */
    cairn_real mass;
    /* Weighted root mean square of the orthogonal distances, in m. */
    cairn_real rms;
} cairn_line;

/* Fits the line with the least weighted sum of squared orthogonal distances to points[0 ...
 * count-1] (total least squares). weights: [count], >= 0, or NULL when all are 1.
 * CAIRN_BAD_ARGUMENT: NULL, count < 2, or a weight < 0. CAIRN_NOT_FINITE: a NaN or infinity.
 * CAIRN_EMPTY: the points of weight > 0 coincide, so the direction is undefined. Cost: linear, four
 * passes.
 *
 * points: [count] points, m
 * line: set to the line */
CAIRN_CHECKED cairn_status cairn_line_fit(const cairn_vec2 *points, const cairn_real *weights,
                                          int32_t count, cairn_line *line);

/* The segment from `low` to `high` on the line.
 *
 * line: line with its extent */
cairn_segment cairn_line_segment(const cairn_line *line);

/* Merges two segments into one: the orthogonal regression of both, each with its mass (for example
 * its number of points, or its length) spread uniformly over the segment. The extent covers the
 * four end points. The direction is that of the segment of larger mass, of `first` when equal.
 * Constant time. CAIRN_BAD_ARGUMENT: NULL, or a mass that is not > 0. CAIRN_NOT_FINITE.
 * CAIRN_EMPTY: both segments are the same point. Source: the segment merging of Lakaemper and
 * Latecki 2006, with moments in place of end points.
 *
 * first, second: segments, m
 * first_mass, second_mass: their masses, > 0
 * merged: set to the merged segment */
CAIRN_CHECKED cairn_status cairn_line_merge(cairn_segment first, cairn_real first_mass,
                                            cairn_segment second, cairn_real second_mass,
                                            cairn_segment *merged);

#ifdef __cplusplus
}
#endif

#endif
