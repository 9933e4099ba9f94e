/* cairn_places_picture: figures 6.6 and 6.7 of Adluru 2008, of places mapped without odometry:
 * for the command and the benches. */
#ifndef CAIRN_TOOLS_CAIRN_PLACES_PICTURE_H
#define CAIRN_TOOLS_CAIRN_PLACES_PICTURE_H

#include "cairn/place_map.h"
#include "cairn/report.h"

/* Stages of the place map as written: shape matching, ICP, decoupled ICP. */
typedef int32_t places_stage;
enum { PLACES_BY_SHAPE, PLACES_WITH_ICP, PLACES_DECOUPLED, PLACES_STAGES };

/* Returns cairn_place_map_as_written() limited to a stage. */
cairn_place_map_params places_stage_params(places_stage stage);

/* Estimated and true poses of the places; all [count], in one frame. */
typedef struct places_errors {
    const char *actual_name; /* legend entry */
    const cairn_pose *actual, *by_shape, *with_icp;
    int32_t count;
} places_errors;

/* Figure 6.6: true and estimated poses, and the error of each place. Statuses of
 * cairn_report_figure_write(). */
CAIRN_CHECKED cairn_status places_draw_errors(const char *path, const places_errors *errors,
                                              cairn_file_error *error);

enum { PLACES_PANELS = 4 };

/* The scans at the poses of each panel. */
typedef struct places_maps {
    const char *title;
    const char *panel_title[PLACES_PANELS];
    /* [count] each; the last panel is the reference of the errors */
    const cairn_pose *pose[PLACES_PANELS];
    /* [count] */
    const cairn_report_scan *scan;
    /* above 0 */
    int32_t count;
} places_maps;

/* Figure 6.7: maps side by side, each with its mean errors. Statuses of
 * cairn_report_map_write(). */
CAIRN_CHECKED cairn_status places_draw_maps(const char *path, const places_maps *maps,
                                            cairn_file_error *error);

/* The titles of figure 6.7, where the thesis has another program's map in (b). */
extern const char *const places_stage_titles[PLACES_STAGES];

#endif
