/* report_layout: layout and validation of map pictures. Internal to the host library. */
#ifndef CAIRN_HOST_REPORT_LAYOUT_H
#define CAIRN_HOST_REPORT_LAYOUT_H

#include "cairn/report.h"
#include "src/host/pictures/report_text.h"

/* Positions and sizes in px. */
typedef struct cairn_report_layout {
    double head;  /* of the panels' titles */
    double top;   /* of the frames */
    double width; /* of a frame */
    double height;
    double scale; /* pixels per m */
    cairn_box box[CAIRN_REPORT_MAX_PANELS];
} cairn_report_layout;

/* Transformation from metres of a map to px of the SVG: x = left + (mx - min_x) scale, y = bottom -
 * (my - min_y) scale. */
typedef struct cairn_report_view {
    double min_x, min_y;
    double left, bottom;
    double scale;
    double width, height; /* of the frame, px */
    double frame_left, frame_top;
} cairn_report_view;

static inline double cairn_report_view_x(const cairn_report_view *view, double x)
{
    return view->left + (x - view->min_x) * view->scale;
}

static inline double cairn_report_view_y(const cairn_report_view *view, double y)
{
    return view->bottom - (y - view->min_y) * view->scale;
}

/* Validates a map picture. CAIRN_BAD_ARGUMENT, CAIRN_NOT_FINITE as in cairn_report_map_write(). */
CAIRN_CHECKED cairn_status cairn_report_check(const char *path, const cairn_report_map *map,
                                              cairn_file_error *error);

/* Computes the layout. */
void cairn_report_compute_layout(const cairn_report_map *map, cairn_report_layout *layout);

/* Returns the transformation of panel `index`. */
cairn_report_view cairn_report_view_of(const cairn_report_layout *layout, int32_t index);

/* Returns the number of points and segments that a panel without a grid draws. */
int64_t cairn_report_elements(const cairn_report_map *map);

#endif
