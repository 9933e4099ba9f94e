/* Private state and phases of the scan module. */
#ifndef CAIRN_SCANS_SCAN_WORK_H
#define CAIRN_SCANS_SCAN_WORK_H

#include "cairn/scan.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_scan_parameters;

/* A segment of the line fit. */
typedef struct scan_segment {
    cairn_segment segment;
    cairn_real length;
    cairn_real side;        /* sum over its hits; > 0: the sensors are on the left */
    cairn_real first_angle; /* rad, smallest bearing of its hits */
    int32_t first_position; /* index of its first position in support */
    int32_t positions;      /* positions of resampled points; 0: left out */
} scan_segment;

struct cairn_scan {
    /* Resume points of the scan, and of its current phase. */
    int32_t resume, phase_resume;
    /* Beam, hit, segment or position of the current phase. */
    int32_t cursor;
    /* Eighths of a unit, used but not yet charged. */
    int32_t eighths_used;
    /* 1: the view is complete. */
    int32_t is_complete;
    int32_t hit_count, fitted_count, position_count, segment_count, point_count;
    /* State of a phase; no two of these phases are under way at a time. */
    union {
        /* Order: place in order[] of the segment that is inserted. */
        int32_t place;
        /* Capacity: positions of all segments that stay, and the shortest of these, -1: none. */
        struct {
            int64_t total;
            int32_t shortest;
        };
        /* Points: position on the segment, number of hits that support it, and direction of the
         * segment. */
        struct {
            int32_t position, support_count;
            cairn_vec2 direction;
        };
    };

    cairn_polyline *polyline;
    float *range, *angle;
    cairn_scan_beam *beams;
    int32_t *hit; /* [max_beams] beam of each hit */
    scan_segment *fitted;
    int32_t *order; /* [max_segments] segments of the fit, in the order of the view */
    /* [max_points + 1] difference array: changes of the number of hits that support a position */
    int32_t *support;
    cairn_segment *segments;
    int32_t *first_point;
    cairn_oriented_point *points;

    cairn_scan_input input; /* without its arrays */
    cairn_twist twist;      /* twist of the motion */
    cairn_scan_view view;
    cairn_scan_measure measure;
    cairn_scan_params params;
};

/* ---- Phases after the line fit: each returns 1 when done and 0 when the budget is used up ---- */

/* Side and bearing of each segment. */
int cairn_scan_attribute(cairn_scan *scan, cairn_budget *budget);

/* Orientation of the segments, their positions, and their order by bearing. */
int cairn_scan_turn(cairn_scan *scan, cairn_budget *budget);

/* Segments within the capacity for points, the shortest left out, and numbers of their
 * positions. */
int cairn_scan_choose(cairn_scan *scan, cairn_budget *budget);

/* Support of the positions. */
int cairn_scan_mark(cairn_scan *scan, cairn_budget *budget);

/* Points and segments of the view. */
int cairn_scan_emit(cairn_scan *scan, cairn_budget *budget);

#endif
