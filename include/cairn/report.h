/* report: pictures of maps and plots as SVG, and HTML pages that play back the steps of a mapping
 * run.
 *
 * A map picture has one to four panels side by side in one scale, such as the poses before and
 * after an alignment. A panel shows the walls of the scans, transformed by the panel's poses, or an
 * occupancy grid, and over it the robot's path, coloured from its start to its end. Below are a
 * legend and a scale bar. When there are too many walls to draw as vectors, they are embedded as a
 * density image (PNG) that is darker where more points fall.
 *
 * Each panel shows all of its walls, grid and poses. */
#ifndef CAIRN_REPORT_H
#define CAIRN_REPORT_H

#include "cairn/file_error.h"
#include "cairn/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The maximum number of panels of a picture. */
#define CAIRN_REPORT_MAX_PANELS 4

/* Points and walls of a scan in the frame of its pose, m. The segments are drawn when there are
 * any, otherwise the points. */
typedef struct cairn_report_scan {
    /* [point_count] points */
    const cairn_vec2 *point;
    /* [segment_count] walls */
    const cairn_segment *segment;
    /* number of points */
    int32_t point_count;
    /* number of walls */
    int32_t segment_count;
} cairn_report_scan;

/* An occupancy grid to draw in place of the scans' walls. */
typedef struct cairn_report_grid {
    const uint8_t *pixel; /* [height * width] grey, 0 black .. 255 white; row 0 lowest */
    /* size, px */
    int32_t width, height;
    cairn_real resolution; /* m per cell */
    cairn_pose origin;     /* pose of the lower left corner of pixel (0, 0); m, m, rad */
} cairn_report_grid;

/* One panel of a map picture. */
typedef struct cairn_report_panel {
    const char *title;      /* NULL: none. All texts are UTF-8 */
    const char *note;       /* small, to the right of the title; NULL: none */
    const cairn_pose *pose; /* [scan_count] poses of the scans; m, m, rad */
    /* [scan_count] 1: a pose with low confidence, drawn in red; NULL: none */
    const uint8_t *low_confidence;
    const cairn_report_grid *grid; /* NULL: the walls of the scans are drawn */
} cairn_report_panel;

/* A map picture. */
typedef struct cairn_report_map {
    /* NULL: none */
    const char *title;
    /* NULL: none */
    const char *subtitle;
    /* [panel_count] panels, side by side */
    const cairn_report_panel *panel;
    /* [scan_count], shared by all panels; NULL: only poses and grids */
    const cairn_report_scan *scan;
    /* 1 .. CAIRN_REPORT_MAX_PANELS */
    int32_t panel_count;
    /* scans and poses, above 0 */
    int32_t scan_count;
    /* 1: the poses are connected in order as a path. Default 1 */
    int32_t connect;
    /* 1: the walls of a scan have the colour of its position along the path. Default 0 */
    int32_t colour_scans;
    /* limit of the points or segments drawn as vectors in a panel; beyond it they are drawn as a
     * density image. Default 20000 */
    int32_t max_elements;
    /* width of the picture in pixels, 200 .. 10000. Default 1200 */
    int32_t width;
} cairn_report_map;

/* Returns a map picture with the defaults and without panels. */
cairn_report_map cairn_report_map_default(void);

/* Writes the picture atomically. CAIRN_BAD_ARGUMENT: a count, width or grid size outside its range,
 * or a NULL pose; CAIRN_NOT_FINITE: a pose, point, segment or grid origin, named in the error;
 * CAIRN_IO, CAIRN_NO_MEMORY. Cost: linear in points.
 *
 * path: target, an SVG file
 * map: the picture */
CAIRN_CHECKED cairn_status cairn_report_map_write(const char *path, const cairn_report_map *map,
                                                  cairn_file_error *error);

/* ---- Figures: plots of points, lines and bars side by side ---- */

/* The maximum number of plots of a figure. */
#define CAIRN_REPORT_MAX_PLOTS 4

/* The marks of a layer. */
typedef int32_t cairn_report_mark;
enum {
    /* point: [count] */
    CAIRN_REPORT_DOTS = 0,
    /* point: [2 count] start and end of each line */
    CAIRN_REPORT_LINES = 1,
    /* point: [count] bars at x from 0 to y; `width` is in units of x */
    CAIRN_REPORT_BARS = 2
};

/* One data series of a plot. */
typedef struct cairn_report_layer {
    const char *name;   /* in the legend, once for each name; NULL: not in the legend */
    const char *colour; /* "#1e293b" */
    /* kind of the marks */
    cairn_report_mark mark;
    /* number of marks */
    int32_t count;
    /* points of the marks, see cairn_report_mark */
    const cairn_vec2 *point;
    double width;   /* above 0; of dots and lines in pixels */
    double opacity; /* above 0, up to 1 */
} cairn_report_layer;

/* One plot of a figure. */
typedef struct cairn_report_plot {
    const char *title; /* NULL: none */
    const char *note;  /* small, to the right of the title; NULL: none */
    /* Labels of the axes with their units. Both NULL: a map in m, with equal scales in x and y and
     * a scale bar in place of axes. */
    const char *x_label, *y_label;
    const cairn_report_layer *layer; /* [layer_count], drawn in their order */
    /* number of layers */
    int32_t layer_count;
    cairn_box box;         /* the displayed range; empty: that of all layers */
    double x_step, y_step; /* between the ticks of the axes; 0: automatic */
} cairn_report_plot;

/* A figure. */
typedef struct cairn_report_figure {
    const char *title;    /* NULL: none */
    const char *subtitle; /* NULL: none */
    /* [plot_count] plots, side by side */
    const cairn_report_plot *plot;
    int32_t plot_count; /* 1 .. CAIRN_REPORT_MAX_PLOTS */
    int32_t width;      /* width of the picture in pixels, 200 .. 10000. Default 1200 */
} cairn_report_figure;

/* Returns a figure with the default width and without plots. */
cairn_report_figure cairn_report_figure_default(void);

/* Writes the figure as SVG, atomically. CAIRN_BAD_ARGUMENT: a count, width, opacity or mark outside
 * its range, NULL points, one label without the other, a step below 0; CAIRN_NOT_FINITE: a point or
 * box that is not finite or beyond 1e9; CAIRN_IO, CAIRN_NO_MEMORY. Cost: linear in points.
 *
 * path: target, an SVG file */
CAIRN_CHECKED cairn_status cairn_report_figure_write(const char *path,
                                                     const cairn_report_figure *figure,
                                                     cairn_file_error *error);

/* ---- Player: an HTML page that plays back the steps of a mapping run ----
 *
 *     open -> add scans, frames and links in their order -> write -> free
 *
 * The page is self-contained: no other file and no network. It shows every frame, with a slider,
 * play, pause and keyboard shortcuts, curves with a cursor, a legend that switches layers on and
 * off, and a light and a dark theme. The fragment `#frame=N` of its address opens it at step N;
 * `theme=dark`, `show=walls,forces`, `hide=points` and `view=X,Y,WIDTH` (m) may follow, separated
 * by `&`.
 *
 * Data beyond the limits below are subsampled evenly, and the page states the factor. Coordinates
 * are quantized: poses to 0.1 mm and 0.01 mrad, points and walls to 2 mm, regions and forces to 5
 * mm. */

/* An HTML player of a mapping run, under construction. */
typedef struct cairn_report_player cairn_report_player;

/* The maximum number of curves of a player. */
#define CAIRN_REPORT_MAX_CURVES 4

/* A quantity that is plotted over the frames. */
typedef struct cairn_report_curve {
    /* name of the quantity */
    const char *name;
    const char *unit; /* such as "m"; NULL or "": dimensionless */
    const char *note; /* a line below the curve; NULL: none */
} cairn_report_curve;

/* Parameters of a player; defaults in brackets. Texts are UTF-8 and are copied. */
typedef struct cairn_report_player_params {
    /* any (NULL): title of the page; NULL: none */
    const char *title;
    /* any (NULL): line below the title; NULL: none */
    const char *subtitle;
    /* any ("step"): name of a step */
    const char *step_name;
    /* any (NULL): [curve_count] curves of values below the pictures */
    const cairn_report_curve *curve;
    /* 0 ... CAIRN_REPORT_MAX_CURVES (0): number of curves */
    int32_t curve_count;
    /* 0 or 1 (0): 1: the poses are connected in order as a path */
    int32_t connect;
    /* >= 2 (600): limit of frames: beyond it every second frame is dropped */
    int32_t max_frames;
    /* >= 2 (2,000,000): limit of the poses of all frames: likewise */
    int64_t max_poses;
    /* >= 1 (200,000): limit of the points, and of the walls, of all scans */
    int64_t max_points;
    /* >= 1 (150,000): limit of the forces, of the regions, and of the hypotheses of all frames */
    int64_t max_forces;
    /* m, 0 ... 1e9 (0): radius of the regions of interest */
    cairn_real region_radius;
    /* 0 ... 1024 (0): above 0: the steps of a search in an image, px of it for each unit of length.
     * The scale is in px, and the legend names the walls edges, the scans particles and the grid the
     * image. 0: a map in m */
    int32_t image;
} cairn_report_player_params;

/* A force on a point of the map, in the map frame. Arrows are scaled to the largest force of a
 * frame. */
typedef struct cairn_report_force {
    /* point on which the force acts, m */
    cairn_vec2 at;
    /* force, in any unit */
    cairn_vec2 force;
} cairn_report_force;

/* A segment of a hypothesized structure that no scan shows yet, such as a line or a side of a
 * rectangle. */
typedef struct cairn_report_hypothesis {
    /* m, in the map */
    cairn_segment segment;
    cairn_real strength; /* relative weight, 0 ... 1 */
} cairn_report_hypothesis;

/* The state after a step. Arrays are copied. */
typedef struct cairn_report_frame {
    /* as displayed; increases from frame to frame */
    int64_t step;
    /* a short label, such as "sigma 0.12 m"; NULL: none */
    const char *label;
    /* [pose_count] poses of the first pose_count scans; m, m, rad */
    const cairn_pose *pose;
    /* [pose_count] 1: a pose with low confidence, drawn in red; NULL: none */
    const uint8_t *low_confidence;
    /* [pose_count] submap of each scan: -1: none, or the scan whose colour it takes; NULL: all
     * -1 */
    const int32_t *submap;
    /* [curve_count] values of the curves; NaN: unknown; NULL: all unknown */
    const double *value;
    /* [region_count] centres of the regions of interest, m */
    const cairn_vec2 *region;
    /* [force_count] forces */
    const cairn_report_force *force;
    /* [hypothesis_count] segments of hypotheses */
    const cairn_report_hypothesis *hypothesis;
    /* number of poses */
    int32_t pose_count;
    /* number of regions */
    int32_t region_count;
    /* number of forces */
    int32_t force_count;
    /* number of segments of hypotheses */
    int32_t hypothesis_count;
} cairn_report_frame;

/* Returns the default parameters. */
cairn_report_player_params cairn_report_player_default(void);

/* Creates a player. CAIRN_BAD_ARGUMENT: NULL, a limit or count outside its range;
 * CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_report_player_open(cairn_report_player **player,
                                                    const cairn_report_player_params *params);

/* Adds a scan; its points and segments are copied. index: the number that the page displays; below
 * 0: the pose has no marker, as that of a background.
 * CAIRN_BAD_ARGUMENT: NULL, a negative count; CAIRN_NOT_FINITE; CAIRN_NO_MEMORY: the player is
 * unchanged.
 *
 * scan: points and walls in the frame of its pose */
CAIRN_CHECKED cairn_status cairn_report_player_add_scan(cairn_report_player *player,
                                                        const cairn_report_scan *scan,
                                                        int64_t index);

/* Adds a frame. The last frame is always kept. CAIRN_BAD_ARGUMENT: NULL, a count that is negative
 * or above the number of scans, an unknown submap, a strength outside 0 ... 1, a step not above the
 * previous one; CAIRN_NOT_FINITE: a pose, region, force or hypothesis that is not finite or beyond
 * 1e9; CAIRN_NO_MEMORY: the player is unchanged. Cost: linear in the frame. */
CAIRN_CHECKED cairn_status cairn_report_player_add_frame(cairn_report_player *player,
                                                         const cairn_report_frame *frame);

/* Adds a loop closure between two scans, drawn from the next frame on. CAIRN_BAD_ARGUMENT: unknown
 * scans; CAIRN_NO_MEMORY.
 *
 * a, b: indices of the scans
 * accepted: 0: a rejected one */
CAIRN_CHECKED cairn_status cairn_report_player_add_link(cairn_report_player *player, int32_t a,
                                                        int32_t b, int32_t accepted);

/* Sets the occupancy grid of the last frame and replaces an earlier one. Black (0) is drawn as a
 * wall, above 230 as free. CAIRN_BAD_ARGUMENT: no cells or resolution; CAIRN_NOT_FINITE: its
 * origin; CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_report_player_set_grid(cairn_report_player *player,
                                                        const cairn_report_grid *grid);

/* Writes the page atomically; the same calls give the same bytes. CAIRN_EMPTY: no frame; CAIRN_IO,
 * CAIRN_NO_MEMORY.
 *
 * path: target, an HTML file */
CAIRN_CHECKED cairn_status cairn_report_player_write(const cairn_report_player *player,
                                                     const char *path, cairn_file_error *error);

/* Frees the player. NULL is allowed. */
void cairn_report_player_free(cairn_report_player *player);

#ifdef __cplusplus
}
#endif

#endif
