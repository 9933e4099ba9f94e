/* polyline: straight segments through points in the plane or in space, their number not given:
 * extended EM line fitting (Adluru 2008, refs 168 and 170: Lakaemper and Latecki, extended
 * expectation maximisation with split and merge).
 *
 * Order of the points does not matter, not even to the last bit: they are first brought into an
 * order of their own. Points that no segment claims ("uncertain data") are left without one; that
 * is where clutter ends up.
 *
 *     begin(points) -> step(budget) until CAIRN_OK -> read() */
#ifndef CAIRN_POLYLINE_H
#define CAIRN_POLYLINE_H

#include "cairn/geometry.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Coordinates may be this large, in m. */
#define CAIRN_POLYLINE_EXTENT CAIRN_REAL(1e6)

typedef struct cairn_polyline cairn_polyline;

typedef struct cairn_polyline_params {
    /* 2 or 3 */
    int32_t dim;
    /* 1 ... 2^26 */
    int32_t max_points;
    /* 1 ... 2^20; also holds the pieces of walls while fitting: about 4 times the final number */
    int32_t max_segments;
    /* >= 3: segments of fewer points vanish */
    int32_t min_points;
    /* >= 1; cuts at bends, and growth across holes, only in the first half of them */
    int32_t max_iterations;
    /* m, >= 0: shorter segments vanish */
    cairn_real min_length;
    /* m, > 0: standard deviation of a point across its line; less is never read out of the data */
    cairn_real sigma;
    /* m, >= s_last: width s of the E-step at first; larger bridges more, and blurs corners more */
    cairn_real s_first;
    /* m, > 0: s at last; twice sigma keeps nearly all points of a line */
    cairn_real s_last;
    /* (0, 1]: s times this in each iteration */
    cairn_real shrink;
    /* m, > 0: a hole along a segment that is longer cuts it, ... */
    cairn_real gap;
    /* >= 1: ... unless it is at most so many times the distance of the points beside it, ... */
    cairn_real gap_factor;
    /* m, >= gap: ... and then still when it is longer than this */
    cairn_real gap_max;
    /* rad, [0, pi/2]: segments that differ by more are never joined */
    cairn_real merge_angle;
    /* m, > 0: nor when an end of the lighter one is farther from the other's line */
    cairn_real merge_distance;
    /* > 0: two lines stay two when that saves so many variances of the sum of squares (and a
     * quarter of a variance for each point); one is cut in two when that saves half as much
     * again. */
    cairn_real bend;
    cairn_real tolerance; /* m, > 0: fitting ends when no end moved farther */
} cairn_polyline_params;

/* For scans of rooms: 2-D, 1 cm noise. Capacities: 1024 points, 256 segments. */
cairn_polyline_params cairn_polyline_default(void);

/* 0 for params that create() would refuse. */
size_t cairn_polyline_memory(const cairn_polyline_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_polyline_create(cairn_polyline **polyline, cairn_pool *pool,
                                                 const cairn_polyline_params *params);

/* Takes a copy of the points and forgets the last result. points: [count][dim], row by row (an
 * array of cairn_vec2 when dim is 2). count 0 is legal and gives no segments.
 * CAIRN_BAD_ARGUMENT: NULL with count > 0, count < 0, or a coordinate beyond
 * CAIRN_POLYLINE_EXTENT. CAIRN_FULL: count > max_points. CAIRN_NOT_FINITE: NaN or infinity.
 * *fault, when not NULL, tells the index of the point. A refused call changes nothing. Cost: two
 * linear passes. */
CAIRN_CHECKED cairn_status cairn_polyline_begin(cairn_polyline *polyline, const cairn_real *points,
                                                int32_t count, cairn_fault *fault);

/* The same one by one, for callers that must not make a whole pass at once: clear, then add each
 * point, then step. sigma, s_first and s_last are all times `scale` for this fit: 1, or more for
 * points of less accuracy. Constant time. CAIRN_BAD_ARGUMENT: NULL, or scale is not finite and >
 * 0. */
CAIRN_CHECKED cairn_status cairn_polyline_clear(cairn_polyline *polyline, cairn_real scale);

/* point: [dim]. Statuses as for begin(); CAIRN_BAD_ARGUMENT also after the first step. */
CAIRN_CHECKED cairn_status cairn_polyline_add(cairn_polyline *polyline, const cairn_real *point);

/* Goes on fitting. CAIRN_MORE, CAIRN_OK; CAIRN_BAD_ARGUMENT: NULL. The dearest item costs 7
 * units, in space 12, and when max_segments are in use one more for each 8 of them. The result
 * does not depend on the budgets. */
CAIRN_CHECKED cairn_status cairn_polyline_step(cairn_polyline *polyline, cairn_budget *budget);

typedef struct cairn_polyline_segment {
    cairn_real a[3], b[3]; /* the ends; [2] is 0 when dim is 2 */
    cairn_real rms;        /* m, of the distances of its points to its line */
    int32_t count;         /* points */
} cairn_polyline_segment;

/* Valid until the next begin(). Empty from begin() until step() returns CAIRN_OK. */
typedef struct cairn_polyline_view {
    /* [segment_count] */
    const cairn_polyline_segment *segments;
    /* [point_count]: segment of each point in order of the input, or -1 */
    const int32_t *label;
    int32_t segment_count;
    int32_t point_count;
    /* 0: stopped by max_iterations */
    int32_t converged;
    /* pieces dropped, those of fewest points first, because max_segments were in use; 0 is usual */
    int32_t left_out;
} cairn_polyline_view;

cairn_polyline_view cairn_polyline_read(const cairn_polyline *polyline);

/* What the last fit cost. */
typedef struct cairn_polyline_measure {
    int64_t units;
    int32_t iterations;
    int32_t cuts; /* at gaps and bends */
    int32_t merges;
    int32_t peak_segments; /* most pieces at a time */
} cairn_polyline_measure;

cairn_polyline_measure cairn_polyline_measured(const cairn_polyline *polyline);

#ifdef __cplusplus
}
#endif

#endif
