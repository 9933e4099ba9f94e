/* What the files of the virtual_scan room share. */
#ifndef CAIRN_MAPPING_VIRTUAL_SCAN_WORK_H
#define CAIRN_MAPPING_VIRTUAL_SCAN_WORK_H

#include "cairn/virtual_scan.h"

typedef int32_t virtual_phase;
enum {
    VIRTUAL_IDLE,
    VIRTUAL_GATHER,
    VIRTUAL_LINES,
    VIRTUAL_SAMPLE_LINES,
    VIRTUAL_RECTANGLES,
    VIRTUAL_SAMPLE_RECTANGLES,
    VIRTUAL_ELLIPSES,
    VIRTUAL_SAMPLE_ELLIPSES,
    VIRTUAL_CALLER_DETECTORS
};

/* What readers see. */
typedef struct virtual_result {
    cairn_hypothesis *hypotheses; /* [max_hypotheses] */
    cairn_oriented_point *points; /* [max_virtual] */
    cairn_real *weights;          /* [max_virtual] */
    int32_t count, point_count, dropped;
} virtual_result;

struct cairn_virtual_scan {
    cairn_virtual_scan_params params;
    cairn_hough *hough;
    cairn_rectangle_set *rectangles;
    cairn_ellipse_set *ellipses;
    cairn_oriented_point *points; /* [max_points] of the map */
    int32_t *point_scan;
    cairn_segment *segments; /* [max_segments] */
    int32_t *segment_scan;
    int32_t *scan_inliers;                /* [max_scans] points on the line or ellipse at hand */
    cairn_hypothesis_detector *detectors; /* [max_detectors] */
    int32_t detector_count;
    cairn_virtual_map map;
    virtual_result work, done;
    virtual_phase phase;
    int32_t cursor;          /* point of the map, or of an outline */
    int32_t item;            /* line, rectangle, ellipse or detector at hand */
    int32_t inliers_cleared; /* `on_it` */
    int32_t scans_counted;   /* `scans` is that of the line or ellipse at hand */
    int32_t scan_count;      /* that it brings together */
    int32_t detector_begun;  /* VIRTUAL_CALLER_DETECTORS: the detector at hand has begun */
    int32_t units_charged;
    cairn_real support, sine_angle;           /* of lines, at this sigma */
    cairn_real ellipse_support, sine_tangent; /* of ellipses */
};

/* Lays out what the detector of a phase has found, and asks those of the caller; CAIRN_OK when
 * all is laid out. */
cairn_status cairn_virtual_lay_lines(cairn_virtual_scan *virtual_scan, cairn_budget *budget);
cairn_status cairn_virtual_lay_rectangles(cairn_virtual_scan *virtual_scan, cairn_budget *budget);
cairn_status cairn_virtual_lay_ellipses(cairn_virtual_scan *virtual_scan, cairn_budget *budget);
cairn_status cairn_virtual_ask_callers(cairn_virtual_scan *virtual_scan, cairn_budget *budget);

#endif
