/* Pictures of a match by shape: an angular histogram, correspondences and the inliers of each
 * filter. */
#include "tools/cairn_match_picture.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/output.h"

/* ---- mode shape: an angular histogram (fig. 6.2) ---- */

enum { BINS = CAIRN_SCAN_MATCH_BINS };

/* Radius of the neighbourhood of a histogram, m. */
#define HISTOGRAM_RADIUS_M CAIRN_REAL(0.5)

/* Returns the point of B whose histogram has the most occupied bins; -1: none. */
static int32_t richest_point(const match_record *record, cairn_real share[BINS])
{
    int32_t best = -1, most = -1;

    for (int32_t i = 0; i < record->query.view.point_count; i++) {
        cairn_real bins[BINS];
        int32_t filled = 0;

        if (cairn_scan_match_histogram(record->match, i, bins) != CAIRN_OK)
            continue;
        for (int32_t b = 0; b < BINS; b++)
            filled += bins[b] > 0;
        if (filled > most) {
            most = filled;
            best = i;
            memcpy(share, bins, sizeof bins);
        }
    }
    return best;
}

/* The circle and the borders of its bins about a point, as lines: 4 BINS points. */
static void draw_frame(cairn_vec2 centre, cairn_vec2 line[4 * BINS])
{
    for (int32_t b = 0; b < BINS; b++) {
        cairn_vec2 from, to;

        cairn_sincos(2 * CAIRN_PI * (cairn_real)b / BINS, &from.y, &from.x);
        cairn_sincos(2 * CAIRN_PI * (cairn_real)(b + 1) / BINS, &to.y, &to.x);
        from = cairn_vec2_add(centre, cairn_vec2_scale(from, HISTOGRAM_RADIUS_M));
        to = cairn_vec2_add(centre, cairn_vec2_scale(to, HISTOGRAM_RADIUS_M));
        line[4 * b] = centre;
        line[4 * b + 1] = line[4 * b + 2] = from;
        line[4 * b + 3] = to;
    }
}

cairn_status match_draw_histogram(const match_record *record, const char *path,
                                  cairn_file_error *error)
{
    cairn_real share[BINS] = {0};
    cairn_vec2 *points = match_points(&record->query, cairn_scan_match_pair_pose(record->match)),
               line[4 * BINS], bar[BINS];
    int32_t point = richest_point(record, share);
    cairn_report_figure figure = cairn_report_figure_default();
    cairn_report_layer map[3], chart;
    cairn_report_plot plot[2];
    char title[256], subtitle[128];
    cairn_vec2 centre = {0, 0};
    cairn_status status;

    if (points == NULL)
        return match_no_memory(path, error);
    if (point >= 0)
        centre = points[point];
    draw_frame(centre, line);
    for (int32_t b = 0; b < BINS; b++) {
        bar[b].x = ((cairn_real)b + CAIRN_REAL(0.5)) * (360 / (cairn_real)BINS);
        bar[b].y = share[b];
    }
    map[0] = match_layer("frame of the histogram", "#94a3b8", CAIRN_REPORT_LINES, 0.8, 0.7);
    map[0].point = line;
    map[0].count = 2 * BINS;
    map[1] = match_layer("points of B", COLOUR_B, CAIRN_REPORT_DOTS, 4, 0.9);
    map[1].point = points;
    map[1].count = record->query.view.point_count;
    map[2] = match_layer("the point", COLOUR_A, CAIRN_REPORT_DOTS, 9, 1);
    map[2].point = &centre;
    map[2].count = point >= 0;
    chart = match_layer("points within 0.5 m", COLOUR_PAIR, CAIRN_REPORT_BARS, 360.0 / BINS, 0.85);
    chart.point = bar;
    chart.count = BINS;
    memset(plot, 0, sizeof plot);
    plot[0].title = "where it counts";
    plot[0].layer = map;
    plot[0].layer_count = 3;
    plot[0].box.min.x = centre.x - CAIRN_REAL(0.6);
    plot[0].box.min.y = centre.y - CAIRN_REAL(0.6);
    plot[0].box.max.x = centre.x + CAIRN_REAL(0.6);
    plot[0].box.max.y = centre.y + CAIRN_REAL(0.6);
    plot[1].title = "angular histogram";
    plot[1].x_label = "bearing (degrees)";
    plot[1].y_label = "share of the fullest bin";
    plot[1].x_step = 45;
    plot[1].layer = &chart;
    plot[1].layer_count = 1;
    plot[1].box.max.x = 360;
    plot[1].box.max.y = 1;
    (void)snprintf(title, sizeof title, "%s:%" PRId64,
                   cairn_output_path_name(record->query.input.path), record->query.input.index);
    (void)snprintf(subtitle, sizeof subtitle, "point %" PRId32 " of %" PRId32, point,
                   record->query.view.point_count);
    figure.title = title;
    figure.subtitle = subtitle;
    figure.plot = plot;
    figure.plot_count = 2;
    status = cairn_report_figure_write(path, &figure, error);
    free(points);
    return status;
}

/* ---- mode shape: correspondences (figs. 6.4, 6.5) ---- */

/* Returns the lines of the correspondences that were rejected at a stage, or with beyond != 0 of
 * all that reached it; *count lines. NULL: no memory. */
static cairn_vec2 *pair_lines(const match_record *record, const cairn_vec2 *a, const cairn_vec2 *b,
                              int32_t stage, int beyond, int32_t *count)
{
    int32_t pairs = cairn_scan_match_pair_count(record->match);
    cairn_vec2 *line = malloc((2 * (size_t)pairs + 1) * sizeof *line);

    *count = 0;
    for (int32_t i = 0; i < pairs && line != NULL; i++) {
        cairn_scan_match_pair pair = cairn_scan_match_pair_at(record->match, i);

        if (pair.stage != stage && !(beyond && pair.stage > stage))
            continue;
        line[2 * *count] = b[pair.query];
        line[2 * *count + 1] = a[pair.target];
        ++*count;
    }
    return line;
}

static const char *const stage_names[] = {"dropped: colinear", "dropped with its segment", "kept"};
static const char *const stage_colours[] = {"#94a3b8", "#f59e0b", COLOUR_PAIR};

cairn_status match_draw_pairs(const match_record *record, const char *path, cairn_file_error *error)
{
    cairn_vec2 *a = match_points(&record->target, cairn_pose_identity()),
               *b = match_points(&record->query, cairn_scan_match_pair_pose(record->match));
    cairn_vec2 *line[3] = {NULL, NULL, NULL};
    cairn_report_figure figure = cairn_report_figure_default();
    cairn_report_layer layer[5];
    cairn_report_plot plot;
    char title[256], subtitle[128];
    cairn_status status = CAIRN_NO_MEMORY;
    int whole = a != NULL && b != NULL;

    for (int k = 0; k < 3 && whole; k++) {
        layer[k] = match_layer(stage_names[k], stage_colours[k], CAIRN_REPORT_LINES, 1.2, 0.85);
        line[k] = pair_lines(record, a, b, k, 0, &layer[k].count);
        layer[k].point = line[k];
        whole = line[k] != NULL;
    }
    if (whole) {
        layer[3] = match_layer("points of A", COLOUR_A, CAIRN_REPORT_DOTS, 4, 0.9);
        layer[3].point = a;
        layer[3].count = record->target.view.point_count;
        layer[4] = match_layer("points of B, turned", COLOUR_B, CAIRN_REPORT_DOTS, 4, 0.9);
        layer[4].point = b;
        layer[4].count = record->query.view.point_count;
        memset(&plot, 0, sizeof plot);
        plot.title = "correspondences of the longest common subsequence";
        plot.layer = layer;
        plot.layer_count = 5;
        plot.box = cairn_box_empty();
        match_names(record, title, sizeof title);
        (void)snprintf(subtitle, sizeof subtitle,
                       "%" PRId32 " pairs, of which %" PRId32 " are kept",
                       cairn_scan_match_pair_count(record->match), layer[2].count);
        figure.title = title;
        figure.subtitle = subtitle;
        figure.plot = &plot;
        figure.plot_count = 1;
        status = cairn_report_figure_write(path, &figure, error);
    }
    free(a);
    free(b);
    for (int k = 0; k < 3; k++)
        free(line[k]);
    return whole ? status : match_no_memory(path, error);
}

cairn_status match_draw_filters(const match_record *record, const char *path,
                                cairn_file_error *error)
{
    static const char *const titles[] = {"common subsequence", "colinear filter", "segment filter",
                                         "aligned"};
    cairn_pose after = record->result.count > 0 ? record->result.hypotheses[0].target_query
                                                : cairn_scan_match_pair_pose(record->match);
    cairn_vec2 *a = match_points(&record->target, cairn_pose_identity()),
               *b = match_points(&record->query, cairn_scan_match_pair_pose(record->match));
    cairn_vec2 *moved = match_points(&record->query, after), *line[3] = {NULL, NULL, NULL};
    cairn_report_figure figure = cairn_report_figure_default();
    cairn_report_layer layer[4][3];
    cairn_report_plot plot[4];
    char title[256], note[3][48];
    cairn_status status = CAIRN_NO_MEMORY;
    int whole = a != NULL && b != NULL && moved != NULL;

    memset(plot, 0, sizeof plot);
    for (int k = 0; k < 4 && whole; k++) {
        layer[k][0] = match_layer("points of A", COLOUR_A, CAIRN_REPORT_DOTS, 3, 0.9);
        layer[k][0].point = a;
        layer[k][0].count = record->target.view.point_count;
        layer[k][1] = match_layer("points of B", COLOUR_B, CAIRN_REPORT_DOTS, 3, 0.9);
        layer[k][1].point = k < 3 ? b : moved;
        layer[k][1].count = record->query.view.point_count;
        plot[k].title = titles[k];
        plot[k].layer = layer[k];
        plot[k].layer_count = k < 3 ? 3 : 2;
        plot[k].box = cairn_box_empty();
        if (k == 3)
            break;
        layer[k][2] = match_layer("correspondence", COLOUR_PAIR, CAIRN_REPORT_LINES, 1, 0.7);
        line[k] = pair_lines(record, a, b, k, 1, &layer[k][2].count);
        layer[k][2].point = line[k];
        whole = line[k] != NULL;
        (void)snprintf(note[k], sizeof note[k], "%" PRId32 " pairs", layer[k][2].count);
        plot[k].note = note[k];
    }
    if (whole) {
        match_names(record, title, sizeof title);
        figure.title = title;
        figure.subtitle = match_verdict_text(record->result.verdict);
        figure.plot = plot;
        figure.plot_count = 4;
        figure.width = 1800;
        status = cairn_report_figure_write(path, &figure, error);
    }
    free(a);
    free(b);
    free(moved);
    for (int k = 0; k < 3; k++)
        free(line[k]);
    return whole ? status : match_no_memory(path, error);
}
