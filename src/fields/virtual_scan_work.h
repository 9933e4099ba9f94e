/* Internal state shared by virtual_scan.c and virtual_scan_kinds.c. */
#ifndef CAIRN_FIELDS_VIRTUAL_SCAN_WORK_H
#define CAIRN_FIELDS_VIRTUAL_SCAN_WORK_H

#include "cairn/virtual_scan.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_virtual_scan_parameters;

/* Result of a detection. */
typedef struct virtual_scan_result {
    cairn_virtual_scan_hypothesis *hypotheses; /* [max_hypotheses] */
    cairn_oriented_point *points;              /* [max_virtual] */
    cairn_real *weights;                       /* [max_virtual] */
    int32_t count, point_count, dropped;
} virtual_scan_result;

struct cairn_virtual_scan {
    cairn_hough *hough;
    cairn_rectangle_set *rectangles;
    cairn_ellipse_set *ellipses;
    cairn_oriented_point *points; /* [max_points] of the map */
    int32_t *point_scan;
    cairn_segment *segments; /* [max_segments] */
    int32_t *segment_scan;
    /* [max_scans] number of inliers of each scan on the current line or ellipse */
    int32_t *scan_inliers;
    cairn_virtual_scan_hypothesis_detector *detectors; /* [max_detectors] */
    int32_t detector_count;
    cairn_virtual_scan_map map;
    virtual_scan_result work, done;
    /* CAIRN_MORE while a detection is under way; below 0: how a detector ends it */
    cairn_status status;
    /* resume points of the detection, of its phase, and of the scans on a line or ellipse */
    int32_t resume, phase_resume, count_resume;
    /* current line, rectangle, ellipse or detector; current point of the map, or outline */
    int32_t item, cursor;
    /* scans with walls on the current line or ellipse */
    int32_t scan_count;
    int32_t units_charged;
    /* tolerances of lines: m, sine of the angle, at this sigma */
    cairn_real support, sine_angle;
    cairn_real ellipse_support, sine_tangent; /* likewise of ellipses */
    cairn_virtual_scan_params params;
};

/* 1 when a detector's step has ended; 0: it continues, or its status below 0 ends the detection. */
static inline int virtual_scan_has_ended(cairn_virtual_scan *virtual_scan, cairn_status status)
{
    if (status < 0)
        virtual_scan->status = status;
    return status == CAIRN_OK;
}

/* ---- virtual_scan_kinds: each returns 1 when done and 0 when it continues ---- */

/* Sample the hypotheses that a detector has found. */
int cairn_virtual_scan_sample_lines(cairn_virtual_scan *virtual_scan, cairn_budget *budget);
int cairn_virtual_scan_sample_rectangles(cairn_virtual_scan *virtual_scan, cairn_budget *budget);
int cairn_virtual_scan_sample_ellipses(cairn_virtual_scan *virtual_scan, cairn_budget *budget);

/* Runs the caller's detectors. */
int cairn_virtual_scan_run_detectors(cairn_virtual_scan *virtual_scan, cairn_budget *budget);

#endif
