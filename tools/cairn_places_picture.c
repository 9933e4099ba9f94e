/* Figures of places mapped without odometry. */
#include "tools/cairn_places_picture.h"
#include "src/host/base/degrees.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

/* Half size of a plus sign and radius of a circle, m. */
#define MARK_RADIUS_M 0.12

enum { CIRCLE_SIDES = 24 }; /* sides of the polygon of a circle */

const char *const places_stage_titles[PLACES_STAGES] = {"(a) by shape", "(b) + ICP",
                                                        "(c) decoupled"};

cairn_place_map_params places_stage_params(places_stage stage)
{
    cairn_place_map_params params = cairn_place_map_as_written();

    if (stage != PLACES_DECOUPLED)
        params.decoupled = CAIRN_PLACE_MAP_COUPLED;
    if (stage == PLACES_BY_SHAPE)
        params.match.mode = CAIRN_SCAN_MATCH_AS_WRITTEN_SEGMENTS;
    return params;
}

/* ---- Figure 6.6 ---- */

static cairn_vec2 point_at(double x, double y)
{
    cairn_vec2 p = {(cairn_real)x, (cairn_real)y};

    return p;
}

/* Pluses at the actual places and circles at those found: [4 count] and [2 CIRCLE_SIDES count]
 * points. */
static void fill_marks(const places_errors *e, cairn_vec2 *plus, cairn_vec2 *circle)
{
    for (int32_t i = 0; i < e->count; i++) {
        double x = (double)e->actual[i].x, y = (double)e->actual[i].y;

        *plus++ = point_at(x - MARK_RADIUS_M, y);
        *plus++ = point_at(x + MARK_RADIUS_M, y);
        *plus++ = point_at(x, y - MARK_RADIUS_M);
        *plus++ = point_at(x, y + MARK_RADIUS_M);
        for (int k = 0; k < 2 * CIRCLE_SIDES; k++) {
            int corner = (k + 1) / 2;
            double angle = corner * (2 * PI / CIRCLE_SIDES);

            *circle++ = point_at((double)e->by_shape[i].x + MARK_RADIUS_M * cos(angle),
                                 (double)e->by_shape[i].y + MARK_RADIUS_M * sin(angle));
        }
    }
}

static double distance_of(cairn_pose a, cairn_pose b)
{
    return hypot((double)(a.x - b.x), (double)(a.y - b.y));
}

/* Error by place, as a line from place to place: [2 (count - 1)] points. */
static void fill_errors(const places_errors *e, const cairn_pose *found, cairn_vec2 *line)
{
    for (int32_t i = 1; i < e->count; i++)
        for (int32_t k = i - 1; k <= i; k++)
            *line++ = point_at(k + 1, distance_of(e->actual[k], found[k]));
}

cairn_status places_draw_errors(const char *path, const places_errors *e, cairn_file_error *error)
{
    int32_t n = e->count;
    cairn_vec2 *plus = malloc(4 * (size_t)n * sizeof *plus),
               *circle = malloc(2 * CIRCLE_SIDES * (size_t)n * sizeof *circle);
    cairn_vec2 *line = malloc(4 * (size_t)n * sizeof *line);
    cairn_report_figure figure = cairn_report_figure_default();
    cairn_status status;

    if (plus != NULL && circle != NULL && line != NULL) {
        const cairn_report_layer map[] = {
            {e->actual_name, "#1d4ed8", CAIRN_REPORT_LINES, 2 * n, plus, 2, 1},
            {"estimated pose", "#dc2626", CAIRN_REPORT_LINES, CIRCLE_SIDES * n, circle, 2, 1},
        };
        const cairn_report_layer chart[] = {
            {"by shape", "#dc2626", CAIRN_REPORT_LINES, n - 1, line, 2, 1},
            {"and ICP", "#0f766e", CAIRN_REPORT_LINES, n - 1, line + 2 * n, 2, 1},
        };
        cairn_report_plot plot[2];

        memset(plot, 0, sizeof plot);
        fill_marks(e, plus, circle);
        fill_errors(e, e->by_shape, line);
        fill_errors(e, e->with_icp, line + 2 * n);
        plot[0].title = "(a) poses";
        plot[0].note = "by shape, before ICP";
        plot[0].layer = map;
        plot[1].title = "(b) errors";
        plot[1].x_label = "place";
        plot[1].y_label = "distance from the actual pose (m)";
        plot[1].layer = chart;
        plot[0].layer_count = plot[1].layer_count = 2;
        plot[0].box = plot[1].box = cairn_box_empty();
        figure.title = "Fig. 6.6: actual and estimated poses of the places";
        figure.plot = plot;
        figure.plot_count = 2;
        status = cairn_report_figure_write(path, &figure, error);
    } else {
        status = cairn_file_error_set(error, CAIRN_NO_MEMORY, path, 0, "no memory for the picture");
    }
    free(plus);
    free(circle);
    free(line);
    return status;
}

/* ---- Figure 6.7 ---- */

/* "error 0.123 m, 4.5 deg": means over the scans. */
static void describe(const cairn_pose *pose, const cairn_pose *actual, int32_t count, char *note,
                     size_t size)
{
    double metres = 0, degrees = 0;

    for (int32_t k = 0; k < count; k++) {
        metres += distance_of(pose[k], actual[k]) / count;
        degrees += fabs(remainder((double)(pose[k].theta - actual[k].theta), 2 * PI)) *
                   CAIRN_DEGREES_PER_RADIAN / count;
    }
    (void)snprintf(note, size, "error %.3f m, %.1f deg", metres, degrees);
}

cairn_status places_draw_maps(const char *path, const places_maps *maps, cairn_file_error *error)
{
    cairn_report_map picture = cairn_report_map_default();
    cairn_report_panel panel[PLACES_PANELS];
    char note[PLACES_PANELS][80];

    memset(panel, 0, sizeof panel);
    for (int k = 0; k < PLACES_PANELS; k++) {
        panel[k].title = maps->panel_title[k];
        panel[k].pose = maps->pose[k];
        if (k == PLACES_PANELS - 1)
            break; /* the actual poses */
        describe(maps->pose[k], maps->pose[PLACES_PANELS - 1], maps->count, note[k],
                 sizeof note[k]);
        panel[k].note = note[k];
    }
    picture.title = maps->title;
    picture.panel = panel;
    picture.panel_count = PLACES_PANELS;
    picture.scan = maps->scan;
    picture.scan_count = maps->count;
    return cairn_report_map_write(path, &picture, error);
}
