/* polyline: fits line segments to points in the plane or in space, without a given number of
 * segments: extended EM line fitting with split and merge (Adluru 2008, refs 168 and 170: Lakaemper
 * and Latecki).
 *
 * The result does not depend on the order of the points, not even in the last bit, because the
 * points are sorted first. Points that fit no segment (outliers, clutter; "uncertain data" in the
 * thesis) get no label.
 *
 *     begin(points) -> step(budget) until CAIRN_OK -> read() */
#ifndef CAIRN_POLYLINE_H
#define CAIRN_POLYLINE_H

#include "cairn/geometry.h"
#include "cairn/object.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Largest absolute value of a coordinate, in m. */
#define CAIRN_POLYLINE_EXTENT CAIRN_REAL(1e6)

/* Fit of line segments. */
typedef struct cairn_polyline cairn_polyline;

/* Parameters. Default values, for indoor range scans, in brackets. */
typedef struct cairn_polyline_params {
    /* 2 or 3 (2): dimension of the points */
    int32_t dim;
    /* 1 ... 2^26 (1024): points */
    int32_t max_points;
    /* 1 ... 2^20 (256): segments. While fitting, walls are in pieces: about 4 times the final
     * number is needed. */
    int32_t max_segments;
    /* >= 3 (4): segments of fewer points are dropped */
    int32_t min_points;
    /* >= 1 (20): EM iterations. Splits at bends, and growth across gaps, happen only in the first
     * half. */
    int32_t max_iterations;
    /* m, >= 0 (0.08): shorter segments are dropped */
    cairn_real min_length;
    /* m, > 0 (0.01): standard deviation of the points across their line (sensor noise). The
     * variance is never estimated smaller. */
    cairn_real sigma;
    /* m, >= width_last (0.04): width of the Gaussian of the E-step in the first iteration. A larger
     * width bridges more gaps and blurs corners more. */
    cairn_real width_first;
    /* m, > 0 (0.02): width of the Gaussian of the E-step in the last iterations. Twice sigma keeps
     * nearly all points of a line. */
    cairn_real width_last;
    /* > 0, <= 1 (0.5): factor of the width per iteration (annealing) */
    cairn_real width_decay;
    /* m, > 0 (0.25): a segment is split at a gap between its points that is longer */
    cairn_real gap;
    /* >= 1 (3): exception: a gap up to gap_factor times the spacing of the adjacent points splits
     * nothing */
    cairn_real gap_factor;
    /* m, >= gap (1.5): a gap that is longer always splits the segment */
    cairn_real gap_max;
    /* rad, 0 ... pi/2 (0.26): segments whose directions differ by more are not merged */
    cairn_real merge_angle;
    /* m, > 0 (0.10): segments are not merged when an end of the lighter one is farther from the
     * line of the other */
    cairn_real merge_distance;
    /* > 0 (20): penalty of a further segment (model selection), as a multiple of the variance of
     * the residuals, which is at least sigma^2. The penalty is at least sigma^2 / 4 per point. Two
     * segments are merged unless they reduce the sum of squared residuals by more than the penalty;
     * a segment is split when the reduction is more than 1.5 times the penalty. */
    cairn_real segment_penalty;
    /* m, > 0 (0.001): the fit has converged when no end point moves farther in an iteration */
    cairn_real tolerance;
} cairn_polyline_params;

/* Returns the default parameters. */
cairn_polyline_params cairn_polyline_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_polyline_check(const cairn_polyline_params *params,
                                                cairn_object_fault *fault);

/* Bytes that create() allocates. 0 for params that create() would refuse. */
size_t cairn_polyline_memory(const cairn_polyline_params *params);

/* Creates an object in a pool. CAIRN_BAD_ARGUMENT: NULL, or params out of range. CAIRN_NO_MEMORY:
 * the pool has too few bytes left. A failure changes nothing. */
CAIRN_CHECKED cairn_status cairn_polyline_create(cairn_polyline **polyline, cairn_pool *pool,
                                                 const cairn_polyline_params *params);

/* Starts a fit on a copy of the points; the last result is discarded. points: [count][dim],
 * row-major (an array of cairn_vec2 when dim is 2). count 0 is valid and gives no segments.
 * CAIRN_BAD_ARGUMENT: NULL with count > 0, count < 0, or a coordinate beyond
 * CAIRN_POLYLINE_EXTENT. CAIRN_FULL: count > max_points. CAIRN_NOT_FINITE: NaN or infinity.
 * *fault, when not NULL, is set to the index of the point. A refused call changes nothing. Cost:
 * linear, two passes. */
CAIRN_CHECKED cairn_status cairn_polyline_begin(cairn_polyline *polyline, const cairn_real *points,
                                                int32_t count, cairn_fault *fault);

/* Starts a fit without points, for callers that add the points one by one in bounded steps: clear,
 * add each point, then step. scale multiplies sigma and both widths for this fit: 1, or more for
 * less accurate points. CAIRN_BAD_ARGUMENT: NULL, or scale is not finite and > 0. Constant time.
 *
 * scale: factor of sigma and of both widths, > 0 */
CAIRN_CHECKED cairn_status cairn_polyline_clear(cairn_polyline *polyline, cairn_real scale);

/* Adds a point after clear(). point: [dim]. Statuses as for begin(); CAIRN_BAD_ARGUMENT also after
 * the first step. Constant time. */
CAIRN_CHECKED cairn_status cairn_polyline_add(cairn_polyline *polyline, const cairn_real *point);

/* Works on the fit until the budget is used up. CAIRN_OK: the result is complete. CAIRN_MORE: call
 * again. CAIRN_BAD_ARGUMENT: NULL. The result does not depend on the budgets. Cost: the most
 * expensive operation takes 7 units in the plane and 12 in space, and two more per 8 segments when
 * max_segments are in use. */
CAIRN_CHECKED cairn_status cairn_polyline_step(cairn_polyline *polyline, cairn_budget *budget);

/* Fitted segment. */
typedef struct cairn_polyline_segment {
    /* End points, in m; [2] is 0 when dim is 2. */
    cairn_real a[3], b[3];
    /* Root mean square distance of the points from the line, in m. */
    cairn_real rms;
    /* Number of points. */
    int32_t count;
} cairn_polyline_segment;

/* Result of a fit. Valid until the next begin() or clear(). Empty until step() returns CAIRN_OK. */
typedef struct cairn_polyline_view {
    /* [segment_count] Segments. */
    const cairn_polyline_segment *segments;
    /* [point_count] Index of the segment of each point, in order of the input; -1: outlier. */
    const int32_t *label;
    /* Number of segments. */
    int32_t segment_count;
    /* Number of points. */
    int32_t point_count;
    /* 1: the fit converged; 0: the fit was stopped by max_iterations. */
    int32_t converged;
    /* Number of segments dropped, those of fewest points first, because max_segments were in use;
     * usually 0. */
    int32_t dropped;
} cairn_polyline_view;

/* The result of the last fit. */
cairn_polyline_view cairn_polyline_read(const cairn_polyline *polyline);

/* Statistics of a fit. */
typedef struct cairn_polyline_measure {
    /* Work units charged. */
    int64_t units;
    /* EM iterations. */
    int32_t iterations;
    /* Splits at gaps and bends. */
    int32_t splits;
    /* Merges of two segments. */
    int32_t merges;
    /* Largest number of segments at a time. */
    int32_t peak_segments;
} cairn_polyline_measure;

/* Statistics of the last fit. */
cairn_polyline_measure cairn_polyline_measured(const cairn_polyline *polyline);

#ifdef __cplusplus
}
#endif

#endif
