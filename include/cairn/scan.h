/* scan: preprocessing of one laser scan: beams corrected for motion (deskewing), line segments, and
 * oriented resampled points. */
#ifndef CAIRN_SCAN_H
#define CAIRN_SCAN_H

#include "cairn/geometry.h"
#include "cairn/object.h"
#include "cairn/polyline.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A laser scan. The fields of a ROS LaserScan map one to one. The arrays are the caller's and are
 * only read. */
typedef struct cairn_scan_input {
    /* [count] m. +inf: free up to range_max; NaN, <= 0, < range_min: unknown */
    const float *range;
    /* [count] rad, any spacing, sense and start; NULL: angle_min + i * angle_step */
    const float *angle;
    /* number of beams */
    int32_t count;
    /* rad, rad, m, m, m: angle of the first beam, angle from beam to beam, limits of valid ranges,
     * standard deviation of a range */
    float angle_min, angle_step, range_min, range_max, range_sigma;
    /* s from beam to beam, 0: unknown. Only mapper reads it, which estimates the motion itself */
    float time_step;
    /* time of the first beam, ns, within CAIRN_SCAN_MAX_STAMP_NS */
    int64_t stamp_ns;
    /* mounting pose of the sensor on the robot */
    cairn_pose base_sensor;
    /* pose of the base at the last beam in the frame of the base at the first; identity: no
     * motion */
    cairn_pose motion;
} cairn_scan_input;

/* Result of a beam. */
typedef int32_t cairn_scan_beam_kind;
enum {
    CAIRN_SCAN_BEAM_UNKNOWN = 0, /* unknown: must clear no cell */
    CAIRN_SCAN_BEAM_HIT = 1,     /* free up to the end point `to`, a surface there */
    CAIRN_SCAN_BEAM_FREE = 2     /* free up to `to` (range_max), no surface */
};

/* One beam in the frame of the base at the first beam, corrected for the motion during the scan. */
typedef struct cairn_scan_beam {
    cairn_vec2 from; /* sensor position, m */
    /* end of the beam, m */
    cairn_vec2 to;
    /* what the beam says of its end */
    cairn_scan_beam_kind kind;
} cairn_scan_beam;

/* A scan after its line fit, in the frame of the base at the first beam. Points are ordered by
 * segment and along it; the direction of a point is that of its segment. The view is valid until
 * the object that holds the arrays is written again. */
typedef struct cairn_scan_view {
    /* [beam_count], in the order of the input */
    const cairn_scan_beam *beams;
    /* [segment_count], free side on the left of a -> b */
    const cairn_segment *segments;
    /* [segment_count + 1]: points of segment k are first_point[k] ... first_point[k+1]-1 */
    const int32_t *first_point;
    /* [point_count], every `spacing` along the segments */
    const cairn_oriented_point *points;
    /* number of beams */
    int32_t beam_count;
    /* number of segments */
    int32_t segment_count;
    /* number of points */
    int32_t point_count;
    /* sensor position at the first beam, m */
    cairn_vec2 sensor;
    /* time of the first beam, ns */
    int64_t stamp_ns;
} cairn_scan_view;

/* Whether the ends of beams can be used, also of those of unknown range; kinds are not looked at.
 * CAIRN_BAD_ARGUMENT: a coordinate beyond the limit. CAIRN_NOT_FINITE. *fault, when not NULL, gives
 * the index of the beam. Cost: linear.
 *
 * beams: [count], not NULL when count > 0
 * limit: largest absolute coordinate, m */
CAIRN_CHECKED cairn_status cairn_scan_beams_check(const cairn_scan_beam *beams, int32_t count,
                                                  cairn_real limit, cairn_fault *fault);

/* Whether a view can be used. CAIRN_BAD_ARGUMENT: a negative count, a count without its array,
 * first_point that does not rise from 0 to point_count, a coordinate beyond CAIRN_MAX_MAGNITUDE.
 * CAIRN_NOT_FINITE. *fault, when not NULL, names what is wrong, and the index of the segment, point
 * or beam. Linear in the view.
 *
 * view: not NULL */
CAIRN_CHECKED cairn_status cairn_scan_view_check(const cairn_scan_view *view, cairn_fault *fault);

/* ---- From the input to the view ----
 *
 *     begin(input) -> step(budget) until CAIRN_OK -> read() */

/* m: limit of ranges, sensor positions and motions. */
#define CAIRN_SCAN_EXTENT CAIRN_REAL(1e5)

/* ns: limit of stamps, 4e9 s to both sides of 0 (from 1970: 126 years). Their differences fit into
 * 64 bits. */
#define CAIRN_SCAN_MAX_STAMP_NS INT64_C(4000000000000000000)

/* Returns a - b; the nearest 64-bit integer where the difference exceeds these.
 *
 * a: time, ns
 * b: time, ns */
int64_t cairn_time_difference(int64_t a, int64_t b);

/* Preprocessing of one laser scan. */
typedef struct cairn_scan cairn_scan;

/* Parameters; defaults in brackets. */
typedef struct cairn_scan_params {
    /* 1 ... 100,000 (1024): beams of a scan */
    int32_t max_beams;
    /* 1 ... 2^20 (128): capacity for segments, as in cairn_polyline_params */
    int32_t max_segments;
    /* 1 ... 2^31 - 2 (2048): resampled points; beyond the limit the shortest segments are left
     * out */
    int32_t max_points;
    /* m, > 0 (0.10): spacing of the resampled points */
    cairn_real spacing;
    /* m, > 0 (0.20): a resampled point is left out without a hit of its segment within this
     * distance along it */
    cairn_real support_distance;
    /* line fit of the hits; its dim, max_points and max_segments are not read */
    cairn_polyline_params fit;
} cairn_scan_params;

/* Returns the default parameters; fit is that of cairn_polyline_default(). */
cairn_scan_params cairn_scan_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_scan_check(const cairn_scan_params *params,
                                            cairn_object_fault *fault);

/* Returns the bytes that create() takes; 0 for params that create() would refuse. */
size_t cairn_scan_memory(const cairn_scan_params *params);

/* Creates the object in memory of the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_scan_create(cairn_scan **scan, cairn_pool *pool,
                                             const cairn_scan_params *params);

/* Checks a laser scan, copies it, and discards the last one. Cost: one linear pass.
 *
 * Beams may come in any order and sense (negative angle_step, any array `angle`); beam i was
 * measured at the fraction i / (count - 1) of the motion. Ranges may be NaN or infinite, see
 * cairn_scan_beam_kind. When range_sigma is above the fit's sigma, the fit takes it instead, and
 * its s in proportion.
 *
 * CAIRN_BAD_ARGUMENT: NULL, count < 1, range_min < 0, range_max not above it or beyond
 * CAIRN_SCAN_EXTENT, range_sigma < 0, time_step < 0, a position or motion beyond CAIRN_SCAN_EXTENT,
 * a stamp beyond CAIRN_SCAN_MAX_STAMP_NS.
 * CAIRN_FULL: count > max_beams. CAIRN_NOT_FINITE: any field but a range is NaN or infinite.
 * *fault, when not NULL, names the field, and the index in an array. A refused call changes
 * nothing.
 *
 * input: ranges, angles and poses */
CAIRN_CHECKED cairn_status cairn_scan_begin(cairn_scan *scan, const cairn_scan_input *input,
                                            cairn_fault *fault);

/* Continues: beams, line fit, orientation, resampling. CAIRN_MORE, CAIRN_OK; CAIRN_BAD_ARGUMENT:
 * NULL. The most expensive item costs 7 units. The result does not depend on the budgets. */
CAIRN_CHECKED cairn_status cairn_scan_step(cairn_scan *scan, cairn_budget *budget);

/* Returns the result. Empty from begin() until step() returns CAIRN_OK; a scan without a hit has
 * beams only.
 *
 * Beams: UNKNOWN for a range that is NaN, <= 0, < range_min or -infinity (`to` is `from`); FREE for
 * one > range_max or +infinity; else HIT. The base moves on an arc of constant twist from the
 * identity to `motion`. Segments: in the order of the smallest angle of their hits, which is
 * counter-clockwise. Points: a segment of length L has floor(L / spacing) + 1 positions, `spacing`
 * apart and centred; those with support become points. A segment shorter than `spacing` has one
 * position, its middle. */
cairn_scan_view cairn_scan_read(const cairn_scan *scan);

/* Statistics and cost of the last scan. */
typedef struct cairn_scan_measure {
    /* work units charged */
    int64_t units;
    /* number of beams of each kind */
    int32_t hits, free, unknown;
    /* hits that belong to no segment */
    int32_t unassigned_hits;
    /* iterations of the line fit */
    int32_t fit_iterations;
    /* 1: the line fit converged */
    int32_t fit_converged;
    /* segments beyond max_points, or polyline pieces beyond max_segments */
    int32_t dropped_segments;
} cairn_scan_measure;

/* Returns the statistics of the last scan. */
cairn_scan_measure cairn_scan_measured(const cairn_scan *scan);

#ifdef __cplusplus
}
#endif

#endif
