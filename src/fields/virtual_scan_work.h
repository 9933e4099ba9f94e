/* Internal state shared by virtual_scan.c and virtual_scan_kinds.c. */
#ifndef CAIRN_MAPPING_VIRTUAL_SCAN_WORK_H
#define CAIRN_MAPPING_VIRTUAL_SCAN_WORK_H

#include "cairn/virtual_scan.h"

typedef int32_t virtual_scan_phase;
enum {
    VIRTUAL_SCAN_IDLE,
    VIRTUAL_SCAN_GATHER,
    VIRTUAL_SCAN_LINES,
    VIRTUAL_SCAN_SAMPLE_LINES,
    VIRTUAL_SCAN_RECTANGLES,
    VIRTUAL_SCAN_SAMPLE_RECTANGLES,
    VIRTUAL_SCAN_ELLIPSES,
    VIRTUAL_SCAN_SAMPLE_ELLIPSES,
    VIRTUAL_SCAN_CALLER_DETECTORS
};

/* Result of a detection. */
typedef struct virtual_scan_result {
    cairn_virtual_scan_hypothesis *hypotheses; /* [max_hypotheses] */
    cairn_oriented_point *points;              /* [max_virtual] */
    cairn_real *weights;                       /* [max_virtual] */
    int32_t count, point_count, dropped;
} virtual_scan_result;

struct cairn_virtual_scan {
    cairn_virtual_scan_params params;
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
    virtual_scan_phase phase;
    int32_t cursor;          /* current point of the map, or of an outline */
    int32_t item;            /* current line, rectangle, ellipse or detector */
    int32_t inliers_cleared; /* 1: scan_inliers is cleared */
    int32_t scans_counted;   /* 1: scan_count is that of the current line or ellipse */
    int32_t scan_count;      /* scans with walls on it */
    int32_t detector_begun;  /* VIRTUAL_SCAN_CALLER_DETECTORS: 1: the current detector has begun */
    int32_t units_charged;
    /* tolerances of lines: m, sine of the angle, at this sigma */
    cairn_real support, sine_angle;
    cairn_real ellipse_support, sine_tangent; /* likewise of ellipses */
};

/* Samples the hypotheses that the detector of a phase has found, and runs the caller's detectors;
 * CAIRN_OK when all are sampled. */
cairn_status cairn_virtual_scan_sample_lines(cairn_virtual_scan *virtual_scan,
                                             cairn_budget *budget);
cairn_status cairn_virtual_scan_sample_rectangles(cairn_virtual_scan *virtual_scan,
                                                  cairn_budget *budget);
cairn_status cairn_virtual_scan_sample_ellipses(cairn_virtual_scan *virtual_scan,
                                                cairn_budget *budget);
cairn_status cairn_virtual_scan_run_detectors(cairn_virtual_scan *virtual_scan,
                                              cairn_budget *budget);

#endif
