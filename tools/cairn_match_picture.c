/* Pictures of a match. */
#include "tools/cairn_match_picture.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/output.h"
#include "cairn/report.h"
#include "src/host/base/degrees.h"

/* ---- layers ---- */

cairn_report_layer match_layer(const char *name, const char *colour, cairn_report_mark mark,
                               double width, double opacity)
{
    cairn_report_layer layer = {name, colour, mark, 0, NULL, width, opacity};

    return layer;
}

/* The dense points of a side, mapped; NULL: no memory. */
static cairn_vec2 *hits_of(const match_side *side, cairn_pose map_side)
{
    cairn_transform t = cairn_transform_of(map_side);
    cairn_vec2 *point = malloc(((size_t)side->dense_count + 1) * sizeof *point);

    for (int32_t i = 0; i < side->dense_count && point != NULL; i++)
        point[i] = cairn_transform_point(t, side->dense[i].position);
    return point;
}

cairn_vec2 *match_points(const match_side *side, cairn_pose map_side)
{
    cairn_transform t = cairn_transform_of(map_side);
    cairn_vec2 *point = malloc(((size_t)side->view.point_count + 1) * sizeof *point);

    for (int32_t i = 0; i < side->view.point_count && point != NULL; i++)
        point[i] = cairn_transform_point(t, side->view.points[i].position);
    return point;
}

/* The ends of the walls of a side; NULL: no memory. */
static cairn_vec2 *walls_of(const match_side *side)
{
    cairn_vec2 *point = malloc((2 * (size_t)side->view.segment_count + 1) * sizeof *point);

    for (int32_t i = 0; i < side->view.segment_count && point != NULL; i++) {
        point[2 * i] = side->view.segments[i].a;
        point[2 * i + 1] = side->view.segments[i].b;
    }
    return point;
}

cairn_status match_no_memory(const char *path, cairn_file_error *error)
{
    return cairn_file_error_set(error, CAIRN_NO_MEMORY, path, 0, "no memory for the picture");
}

void match_names(const match_record *record, char *title, size_t size)
{
    (void)snprintf(title, size, "%s:%" PRId64 " and %s:%" PRId64,
                   cairn_output_path_name(record->target.input.path), record->target.input.index,
                   cairn_output_path_name(record->query.input.path), record->query.input.index);
}

/* ---- overlay ---- */

cairn_status match_draw_overlay(const match_record *record, const char *path,
                                cairn_file_error *error)
{
    const cairn_scan_match_result *result = &record->result;
    cairn_pose after = result->count > 0 ? result->hypotheses[0].target_query : record->start;
    cairn_vec2 *a = hits_of(&record->target, cairn_pose_identity());
    cairn_vec2 *b[2] = {hits_of(&record->query, record->start), hits_of(&record->query, after)};
    cairn_vec2 sensor[3] = {record->target.view.sensor,
                            cairn_pose_point(record->start, record->query.view.sensor),
                            cairn_pose_point(after, record->query.view.sensor)};
    cairn_report_figure figure = cairn_report_figure_default();
    cairn_report_layer layer[2][4];
    cairn_report_plot plot[2];
    char title[256], subtitle[256];
    cairn_status status;

    memset(plot, 0, sizeof plot);
    for (int k = 0; k < 2; k++) {
        layer[k][0] = match_layer("hits of A", COLOUR_A, CAIRN_REPORT_DOTS, 2.6, 0.8);
        layer[k][0].point = a;
        layer[k][0].count = record->target.dense_count;
        layer[k][1] = match_layer("hits of B", COLOUR_B, CAIRN_REPORT_DOTS, 2.6, 0.8);
        layer[k][1].point = b[k];
        layer[k][1].count = record->query.dense_count;
        layer[k][2] = match_layer("sensor of A", COLOUR_A, CAIRN_REPORT_DOTS, 10, 0.9);
        layer[k][2].point = &sensor[0];
        layer[k][3] = match_layer("sensor of B", COLOUR_B, CAIRN_REPORT_DOTS, 10, 0.9);
        layer[k][3].point = &sensor[1 + k];
        layer[k][2].count = layer[k][3].count = 1;
        plot[k].layer = layer[k];
        plot[k].layer_count = 4;
        plot[k].box = cairn_box_empty();
    }
    plot[0].title = "before";
    plot[0].note = record->has_start ? "start" : "each in its own frame";
    plot[1].title = "after";
    plot[1].note = match_verdict_text(result->verdict);
    match_names(record, title, sizeof title);
    if (result->count > 0)
        (void)snprintf(subtitle, sizeof subtitle,
                       "%s: B at x %.3f m, y %.3f m, %.2f\xC2\xB0; overlap %.0f %%",
                       match_verdict_text(result->verdict), (double)after.x, (double)after.y,
                       (double)(after.theta * (cairn_real)CAIRN_DEGREES_PER_RADIAN),
                       100 * (double)result->hypotheses[0].overlap);
    else
        (void)snprintf(subtitle, sizeof subtitle, "%s", match_verdict_text(result->verdict));
    figure.title = title;
    figure.subtitle = subtitle;
    figure.plot = plot;
    figure.plot_count = 2;
    status = a != NULL && b[0] != NULL && b[1] != NULL
                 ? cairn_report_figure_write(path, &figure, error)
                 : match_no_memory(path, error);
    free(a);
    free(b[0]);
    free(b[1]);
    return status;
}

/* ---- tangent directions ---- */

cairn_status match_draw_tangents(const match_record *record, const char *path,
                                 cairn_file_error *error)
{
    const cairn_scan_view *view = &record->query.view;
    cairn_vec2 *hits = hits_of(&record->query, cairn_pose_identity()),
               *walls = walls_of(&record->query);
    cairn_vec2 *sequence = malloc(((size_t)view->point_count + 1) * sizeof *sequence);
    cairn_report_figure figure = cairn_report_figure_default();
    cairn_report_layer map[2], chart;
    cairn_report_plot plot[2];
    char title[256], subtitle[256];
    cairn_status status;

    for (int32_t i = 0; i < view->point_count && sequence != NULL; i++) {
        sequence[i].x = (cairn_real)i;
        sequence[i].y = cairn_atan2(view->points[i].direction.y, view->points[i].direction.x) *
                        (cairn_real)CAIRN_DEGREES_PER_RADIAN;
    }
    map[0] = match_layer("hits of B", COLOUR_B, CAIRN_REPORT_DOTS, 2.4, 0.7);
    map[0].point = hits;
    map[0].count = record->query.dense_count;
    map[1] = match_layer("walls by EM", COLOUR_A, CAIRN_REPORT_LINES, 1.8, 0.9);
    map[1].point = walls;
    map[1].count = view->segment_count;
    chart = match_layer("direction of a point", COLOUR_PAIR, CAIRN_REPORT_DOTS, 3, 0.9);
    chart.point = sequence;
    chart.count = view->point_count;
    memset(plot, 0, sizeof plot);
    plot[0].title = "walls";
    plot[0].layer = map;
    plot[0].layer_count = 2;
    plot[0].box = cairn_box_empty();
    plot[1].title = "tangent directions";
    plot[1].x_label = "point, in the order of the scan";
    plot[1].y_label = "direction (degrees)";
    plot[1].layer = &chart;
    plot[1].layer_count = 1;
    plot[1].y_step = 45;
    plot[1].box.min.y = -180;
    plot[1].box.max.y = 180;
    plot[1].box.max.x = (cairn_real)(view->point_count > 1 ? view->point_count - 1 : 1);
    (void)snprintf(title, sizeof title, "%s:%" PRId64,
                   cairn_output_path_name(record->query.input.path), record->query.input.index);
    (void)snprintf(subtitle, sizeof subtitle, "%" PRId32 " points on %" PRId32 " walls",
                   view->point_count, view->segment_count);
    figure.title = title;
    figure.subtitle = subtitle;
    figure.plot = plot;
    figure.plot_count = 2;
    status = hits != NULL && walls != NULL && sequence != NULL
                 ? cairn_report_figure_write(path, &figure, error)
                 : match_no_memory(path, error);
    free(hits);
    free(walls);
    free(sequence);
    return status;
}
