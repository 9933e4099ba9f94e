/* scan: one sweep of a range scanner as it comes, its segments, and its oriented resampled points. */
#ifndef CAIRN_SCAN_H
#define CAIRN_SCAN_H

#include "cairn/geometry.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A sweep. The fields of a ROS LaserScan map one to one. Arrays are the caller's and are only read. */
typedef struct cairn_scan_input {
    const float *range; /* [count] m. +inf: free up to range_max; NaN, <= 0, < range_min: nothing known */
    const float *angle; /* [count] rad, any spacing, sense and start; NULL: angle_min + i * angle_step */
    int32_t count;
    float angle_min, angle_step, range_min, range_max, range_sigma;
    int64_t stamp_ns;       /* first beam */
    cairn_pose base_sensor; /* where the sensor sits on the robot */
    cairn_pose motion;      /* the base at the last beam seen from the base at the first; identity: it stood still */
} cairn_scan_input;

/* What a beam says. */
typedef int32_t cairn_beam_kind;
enum {
    CAIRN_BEAM_UNKNOWN = 0, /* nothing known: must clear no cell */
    CAIRN_BEAM_HIT = 1,     /* free up to `to`, a surface there */
    CAIRN_BEAM_FREE = 2     /* free up to `to` (range_max), no surface seen */
};

/* One beam in the frame of the base at the first beam, corrected for the motion during the sweep. */
typedef struct cairn_beam {
    cairn_vec2 from; /* the sensor */
    cairn_vec2 to;
    cairn_beam_kind kind;
} cairn_beam;

/* A scan after its line fit, in the frame of the base at the first beam. Points are ordered by segment and along it; the
 * direction of a point is that of its segment. The view is valid as long as the object that holds the arrays is not fed
 * again. */
typedef struct cairn_scan_view {
    const cairn_beam *beams;       /* [beam_count], in order of the input */
    const cairn_segment *segments; /* [segment_count], free side on the left of a -> b */
    const int32_t *first_point; /* [segment_count + 1]: points of segment k are first_point[k] ... first_point[k+1]-1 */
    const cairn_oriented_point *points; /* [point_count], every `spacing` along the segments */
    int32_t beam_count;
    int32_t segment_count;
    int32_t point_count;
    cairn_vec2 sensor; /* of the first beam */
    int64_t stamp_ns;
} cairn_scan_view;

#ifdef __cplusplus
}
#endif

#endif
