/* scan: one sweep of a range scanner as it comes, its segments, and its oriented resampled
 * points. */
#ifndef CAIRN_SCAN_H
#define CAIRN_SCAN_H

#include "cairn/geometry.h"
#include "cairn/polyline.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A sweep. The fields of a ROS LaserScan map one to one. Arrays are the caller's and are only
 * read. */
typedef struct cairn_scan_input {
    /* [count] m. +inf: free up to range_max; NaN, <= 0, < range_min: nothing known */
    const float *range;
    /* [count] rad, any spacing, sense and start; NULL: angle_min + i * angle_step */
    const float *angle;
    int32_t count;
    float angle_min, angle_step, range_min, range_max, range_sigma;
    /* s from beam to beam, 0: not known. Only who finds the motion himself reads it: mapper */
    float time_step;
    /* first beam */
    int64_t stamp_ns;
    /* where the sensor sits on the robot */
    cairn_pose base_sensor;
    /* the base at the last beam seen from the base at the first; identity: it stood still */
    cairn_pose motion;
} cairn_scan_input;

/* What a beam says. */
typedef int32_t cairn_beam_kind;
enum {
    CAIRN_BEAM_UNKNOWN = 0, /* nothing known: must clear no cell */
    CAIRN_BEAM_HIT = 1,     /* free up to `to`, a surface there */
    CAIRN_BEAM_FREE = 2     /* free up to `to` (range_max), no surface seen */
};

/* One beam in the frame of the base at the first beam, corrected for the motion during the
 * sweep. */
typedef struct cairn_beam {
    cairn_vec2 from; /* the sensor */
    cairn_vec2 to;
    cairn_beam_kind kind;
} cairn_beam;

/* A scan after its line fit, in the frame of the base at the first beam. Points are ordered by
 * segment and along it; the direction of a point is that of its segment. The view is valid as
 * long as the object that holds the arrays is not fed again. */
typedef struct cairn_scan_view {
    /* [beam_count], in order of the input */
    const cairn_beam *beams;
    /* [segment_count], free side on the left of a -> b */
    const cairn_segment *segments;
    /* [segment_count + 1]: points of segment k are first_point[k] ... first_point[k+1]-1 */
    const int32_t *first_point;
    /* [point_count], every `spacing` along the segments */
    const cairn_oriented_point *points;
    int32_t beam_count;
    int32_t segment_count;
    int32_t point_count;
    /* of the first beam */
    cairn_vec2 sensor;
    int64_t stamp_ns;
} cairn_scan_view;

/* ---- From the input to the view ----
 *
 *     begin(input) -> step(budget) until CAIRN_OK -> read() */

/* Ranges, sensor places and motions may be this large, in m. */
#define CAIRN_SCAN_EXTENT CAIRN_REAL(1e5)

typedef struct cairn_scan cairn_scan;

typedef struct cairn_scan_params {
    /* 1 ... 100,000 */
    int32_t max_beams;
    /* as in cairn_polyline_params */
    int32_t max_segments;
    /* >= 1: resampled points. When there would be more, the shortest segments are left out */
    int32_t max_points;
    /* m, > 0: of the resampled points */
    cairn_real spacing;
    /* m, > 0: a resampled point without a hit of its segment so near along it is left out */
    cairn_real support;
    /* of the hits; its dim, max_points and max_segments are not read */
    cairn_polyline_params fit;
} cairn_scan_params;

/* 1024 beams, 128 segments, 2048 points every 0.10 m, support 0.20 m, fit as
 * cairn_polyline_default(). */
cairn_scan_params cairn_scan_default(void);

/* 0 for params that create() would refuse. */
size_t cairn_scan_memory(const cairn_scan_params *params);

/* CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_scan_create(cairn_scan **scan, cairn_pool *pool,
                                             const cairn_scan_params *params);

/* Checks a sweep, copies it, and forgets the last one. Cost: one linear pass.
 *
 * Beams may come in any order and sense (negative angle_step, `angle` as it likes); beam i is taken
 * at the fraction i / (count - 1) of the motion. Ranges are free to be NaN or infinite, see
 * cairn_beam_kind. When range_sigma is above the fit's sigma, the fit takes it instead, and its s
 * in proportion.
 *
 * CAIRN_BAD_ARGUMENT: NULL, count < 1, range_min < 0, range_max not above it or beyond
 * CAIRN_SCAN_EXTENT, range_sigma < 0, time_step < 0, a place or motion beyond CAIRN_SCAN_EXTENT.
 * CAIRN_FULL: count > max_beams. CAIRN_NOT_FINITE: any field but a range is NaN or infinite.
 * *fault, when not NULL, tells what, and in an array where. A refused call changes nothing. */
CAIRN_CHECKED cairn_status cairn_scan_begin(cairn_scan *scan, const cairn_scan_input *input,
                                            cairn_fault *fault);

/* Goes on: beams, line fit, orientation, resampling. CAIRN_MORE, CAIRN_OK; CAIRN_BAD_ARGUMENT:
 * NULL. The dearest item costs 7 units. The result does not depend on the budgets. */
CAIRN_CHECKED cairn_status cairn_scan_step(cairn_scan *scan, cairn_budget *budget);

/* The result. Empty from begin() until step() returns CAIRN_OK; a scan without a hit has beams and
 * nothing else.
 *
 * Beams: UNKNOWN for a range that is NaN, <= 0, < range_min or -infinity (`to` is `from`); FREE
 * for one > range_max or +infinity; else HIT. The base moves on an arc of constant twist from
 * the identity to `motion`. Segments: in the order of the smallest angle of their hits, which is
 * counter-clockwise. Points: a segment of length L has floor(L / spacing) + 1 places, `spacing`
 * apart and centred, of which those with support are points: a segment shorter than `spacing`
 * has its middle. */
cairn_scan_view cairn_scan_read(const cairn_scan *scan);

/* What the last scan was, and cost. */
typedef struct cairn_scan_measure {
    int64_t units;
    /* beams of each kind */
    int32_t hits, free, unknown;
    /* hits that belong to no segment */
    int32_t uncertain;
    /* of the fit */
    int32_t iterations;
    /* of the fit */
    int32_t converged;
    /* segments for which max_points, or pieces for which max_segments had no room */
    int32_t left_out;
} cairn_scan_measure;

cairn_scan_measure cairn_scan_measured(const cairn_scan *scan);

#ifdef __cplusplus
}
#endif

#endif
