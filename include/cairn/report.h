/* report: pictures of maps and figures as SVG, and pages that play how a map came to be.
 *
 * A picture has one to four panels side by side, all in one scale, such as the poses before and
 * after an alignment. A panel shows the walls that the scans saw, mapped by the panel's poses, or
 * an occupancy grid; over it the robot's path, coloured from its start to its end. Below stand a
 * legend and a scale bar. Where there are too many walls to draw one by one they become a picture
 * within the picture (a PNG) whose darkness grows with the number of points.
 *
 * Each panel shows the middle 99 % of its points in x and in y, and all its poses; what lies
 * outside is cut off. */
#ifndef CAIRN_REPORT_H
#define CAIRN_REPORT_H

#include "cairn/file_error.h"
#include "cairn/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CAIRN_REPORT_PANELS_MOST 4

/* What a scan saw, in the frame of its pose. Segments are drawn when there are any, otherwise
 * the points. */
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
    /* NULL: none */
    const char *title;
    /* NULL: none */
    const char *subtitle;
    const cairn_report_panel *panel;
    /* [scan_count], the same in all panels; NULL: only poses and grids */
    const cairn_report_scan *scan;
    /* 1 .. CAIRN_REPORT_PANELS_MOST */
    int32_t panel_count;
    /* above 0 */
    int32_t scan_count;
    /* 1: the poses are a path in their order. Default 1 */
    int32_t connect;
    /* 1: the walls of a scan have the colour of its place in the path. Default 0 */
    int32_t colour_scans;
    /* points or segments of one panel that are drawn one by one. Default 20000 */
    int32_t elements_most;
    /* of the picture in pixels, 200 .. 10000. Default 1200 */
    int32_t width;
} cairn_report_map;

cairn_report_map cairn_report_map_default(void);

/* Writes the picture, or nothing. CAIRN_BAD_ARGUMENT: a count, width or grid size outside its
 * range, or a NULL pose; CAIRN_NOT_FINITE: a pose, point, segment or grid origin (the error says
 * which); CAIRN_IO, CAIRN_NO_MEMORY. Cost: linear in points. */
CAIRN_CHECKED cairn_status cairn_report_map_write(const char *path, const cairn_report_map *map,
                                                  cairn_file_error *error);

/* ---- Figures: plots of points, lines and bars side by side ---- */

#define CAIRN_REPORT_PLOTS_MOST 4

typedef int32_t cairn_report_mark;
enum {
    /* point: [count] */
    CAIRN_REPORT_DOTS = 0,
    /* point: [2 count] from, to */
    CAIRN_REPORT_LINES = 1,
    /* point: [count] bars at x from 0 to y, as wide as `width` in units of x */
    CAIRN_REPORT_BARS = 2
};

typedef struct cairn_report_layer {
    const char *name;   /* in the key, which a name enters once; NULL: not there */
    const char *colour; /* "#1e293b" */
    cairn_report_mark mark;
    int32_t count;
    const cairn_vec2 *point;
    double width;   /* above 0: of dots and lines in pixels */
    double opacity; /* above 0, up to 1 */
} cairn_report_layer;

typedef struct cairn_report_plot {
    const char *title; /* NULL: none */
    const char *note;  /* small, to the right of the title; NULL: none */
    /* With their units. Both NULL: a map in m, equal scales in x and y and a scale bar in place
     * of axes. */
    const char *x_label, *y_label;
    const cairn_report_layer *layer; /* [layer_count], drawn in their order */
    int32_t layer_count;
    cairn_box box;         /* what is shown; empty: all */
    double x_step, y_step; /* between the numbers of the axes; 0: as many as have room */
} cairn_report_plot;

typedef struct cairn_report_figure {
    const char *title;    /* NULL: none */
    const char *subtitle; /* NULL: none */
    const cairn_report_plot *plot;
    int32_t plot_count; /* 1 .. CAIRN_REPORT_PLOTS_MOST */
    int32_t width;      /* of the picture in pixels, 200 .. 10000. Default 1200 */
} cairn_report_figure;

cairn_report_figure cairn_report_figure_default(void);

/* Writes the figure (SVG), or nothing. CAIRN_BAD_ARGUMENT: a count, width, opacity or mark
 * outside its range, NULL points, one label without the other, a step below 0; CAIRN_NOT_FINITE:
 * a point or box (beyond 1e9 too); CAIRN_IO, CAIRN_NO_MEMORY. Linear. */
CAIRN_CHECKED cairn_status cairn_report_figure_write(const char *path,
                                                     const cairn_report_figure *figure,
                                                     cairn_file_error *error);

/* ---- The player: a page (HTML) that plays how a map came to be ----
 *
 *     open -> add scans, frames and links in their order -> write -> free
 *
 * The page holds all that it shows, no other file and no network. It has every frame with a slider,
 * play, pause and keys, the curves with a cursor, a key that switches what is drawn, and a dark and
 * a light dress. `#frame=N` behind its address opens it at step N; `theme=dark`,
 * `show=walls,forces`, `hide=points` and `view=X,Y,WIDTH` (m) may follow, each after `&`.
 *
 * What would make the page too large is thinned out evenly while it is recorded or written, and
 * the page says by how much. Coordinates are rounded: poses to 0.1 mm and 0.01 mrad, points and
 * walls to 2 mm, regions and forces to 5 mm. */
typedef struct cairn_report_player cairn_report_player;

#define CAIRN_REPORT_CURVES_MOST 4

typedef struct cairn_report_curve {
    const char *name;
    const char *unit; /* "m"; NULL or "": a pure number */
    const char *note; /* a line below the curve; NULL: none */
} cairn_report_curve;

/* Texts are UTF-8 and are copied. */
typedef struct cairn_report_player_params {
    /* NULL: none */
    const char *title;
    /* NULL: none */
    const char *subtitle;
    /* what a frame shows the end of. Default "step" */
    const char *step_name;
    /* [curve_count] */
    const cairn_report_curve *curve;
    /* 0 .. CAIRN_REPORT_CURVES_MOST */
    int32_t curve_count;
    /* 1: the poses are a path in their order. Default 0 */
    int32_t connect;
    /* 2 or more: of so many every second one goes (600) */
    int32_t frames_most;
    /* of all frames together, 2 or more: likewise (2,000,000) */
    int64_t poses_most;
    /* of all scans, likewise walls, 1 or more (200,000) */
    int64_t points_most;
    /* of all frames, likewise regions and guesses, 1 or more (150,000) */
    int64_t forces_most;
    /* m, >= 0: of the regions of interest (0) */
    cairn_real region_radius;
} cairn_report_player_params;

/* A force in the map at the poses of its frame. The longest arrow of a frame stands for its
 * largest force. */
typedef struct cairn_report_force {
    cairn_vec2 at;
    cairn_vec2 force;
} cairn_report_force;

/* A straight piece of what the map is guessed to hold beside what scans show: a line, a side of
 * a room. */
typedef struct cairn_report_guess {
    cairn_segment segment;
    cairn_real strength; /* 0 ... 1 */
} cairn_report_guess;

/* The poses after a step, and what is known about them. Arrays are copied. */
typedef struct cairn_report_frame {
    /* as shown; grows from frame to frame */
    int64_t step;
    /* a few words, such as "sigma 0.12 m"; NULL: none */
    const char *label;
    /* [pose_count] of the first pose_count scans */
    const cairn_pose *pose;
    /* [pose_count] 1: drawn in red; NULL: none is */
    const uint8_t *doubtful;
    /* [pose_count] -1, or a scan whose colour this one takes: the part it belongs to; NULL: all
     * -1 */
    const int32_t *part;
    /* [curve_count] NaN: not known. NULL: none is */
    const double *value;
    /* [region_count] centres of regions of interest in the map */
    const cairn_vec2 *region;
    /* [force_count] */
    const cairn_report_force *force;
    /* [guess_count] */
    const cairn_report_guess *guess;
    int32_t pose_count;
    int32_t region_count;
    int32_t force_count;
    int32_t guess_count;
} cairn_report_frame;

cairn_report_player_params cairn_report_player_default(void);

/* CAIRN_BAD_ARGUMENT: NULL, a limit or count outside its range; CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_report_player_open(cairn_report_player **player,
                                                    const cairn_report_player_params *params);

/* Adds a scan; its points and segments are copied. index: what the page calls it.
 * CAIRN_BAD_ARGUMENT: NULL, a negative count; CAIRN_NOT_FINITE; CAIRN_NO_MEMORY: nothing was
 * added. */
CAIRN_CHECKED cairn_status cairn_report_player_add_scan(cairn_report_player *player,
                                                        const cairn_report_scan *scan,
                                                        int64_t index);

/* Adds a frame. The last one is always kept. CAIRN_BAD_ARGUMENT: NULL, a count that is negative
 * or above the number of scans, a part that is no scan, a strength outside 0 ... 1, a step not
 * above the last one; CAIRN_NOT_FINITE: a pose, region, force or guess that is not finite or
 * beyond 1e9; CAIRN_NO_MEMORY: nothing was added. Linear in the frame. */
CAIRN_CHECKED cairn_status cairn_report_player_add_frame(cairn_report_player *player,
                                                         const cairn_report_frame *frame);

/* Adds a loop between two scans, to be drawn from the next frame on. CAIRN_BAD_ARGUMENT: no such
 * scans; CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_report_player_add_link(cairn_report_player *player, int32_t a,
                                                        int32_t b, int32_t accepted);

/* The grid that belongs to the last frame, in place of an earlier one; 0 black is drawn as a
 * wall, above 230 as free. CAIRN_BAD_ARGUMENT: no cells or resolution; CAIRN_NOT_FINITE: its
 * origin; CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_report_player_set_grid(cairn_report_player *player,
                                                        const cairn_report_grid *grid);

/* Writes the page, or nothing; the same calls give the same bytes. CAIRN_EMPTY: no frame;
 * CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_report_player_write(const cairn_report_player *player,
                                                     const char *path, cairn_file_error *error);

/* NULL is allowed. */
void cairn_report_player_free(cairn_report_player *player);

#ifdef __cplusplus
}
#endif

#endif
