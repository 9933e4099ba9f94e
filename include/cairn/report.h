/* report: pictures of maps as SVG.
 *
 * A picture has one to four panels side by side, all in one scale, such as the poses before and after an alignment. A
 * panel shows the walls that the scans saw, mapped by the panel's poses, or an occupancy grid; over it the robot's
 * path, coloured from its start to its end. Below stand a legend and a scale bar. Where there are too many walls to
 * draw one by one they become a picture within the picture (a PNG) whose darkness grows with the number of points.
 *
 * Each panel shows the middle 99 % of its points in x and in y, and all its poses; what lies outside is cut off. */
#ifndef CAIRN_REPORT_H
#define CAIRN_REPORT_H

#include "cairn/file_error.h"
#include "cairn/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CAIRN_REPORT_PANELS_MOST 4

/* What a scan saw, in the frame of its pose. Segments are drawn when there are any, otherwise the points. */
typedef struct cairn_report_scan {
    const cairn_vec2 *point;
    const cairn_segment *segment;
    int32_t point_count;
    int32_t segment_count;
} cairn_report_scan;

/* A grid to draw in place of the scans' walls. */
typedef struct cairn_report_grid {
    const uint8_t *pixel; /* [height * width] grey, 0 black .. 255 white; row 0 lowest */
    int32_t width, height;
    cairn_real resolution; /* m */
    cairn_pose origin;     /* of the lower left corner of pixel (0, 0) */
} cairn_report_grid;

typedef struct cairn_report_panel {
    const char *title;             /* UTF-8; NULL: none */
    const char *note;              /* small, to the right of the title; NULL: none */
    const cairn_pose *pose;        /* [scan_count] */
    const uint8_t *doubtful;       /* [scan_count] 1: drawn in red; NULL: none is */
    const cairn_report_grid *grid; /* NULL: walls from the scans */
} cairn_report_panel;

typedef struct cairn_report_map {
    const char *title;    /* NULL: none */
    const char *subtitle; /* NULL: none */
    const cairn_report_panel *panel;
    const cairn_report_scan *scan; /* [scan_count], the same in all panels; NULL: only poses and grids */
    int32_t panel_count;           /* 1 .. CAIRN_REPORT_PANELS_MOST */
    int32_t scan_count;            /* above 0 */
    int32_t connect;               /* 1: the poses are a path in their order. Default 1 */
    int32_t colour_scans;          /* 1: the walls of a scan have the colour of its place in the path. Default 0 */
    int32_t elements_most;         /* points or segments of one panel that are drawn one by one. Default 20000 */
    int32_t width;                 /* of the picture in pixels, 200 .. 10000. Default 1200 */
} cairn_report_map;

cairn_report_map cairn_report_map_default(void);

/* Writes the picture, or nothing. CAIRN_BAD_ARGUMENT: a count, width or grid size outside its range, or a NULL pose;
 * CAIRN_NOT_FINITE: a pose, point, segment or grid origin (the error says which); CAIRN_IO, CAIRN_NO_MEMORY. Cost:
 * linear in points. */
CAIRN_CHECKED cairn_status cairn_report_map_write(const char *path, const cairn_report_map *map,
                                                  cairn_file_error *error);

#ifdef __cplusplus
}
#endif

#endif
