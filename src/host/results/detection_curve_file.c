/* Detection curves as a table and as a plot. */
#include "src/base/build.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

#include "cairn/detection_curve_file.h"
#include "cairn/output.h"
#include "cairn/report.h"

enum { LINE_COUNT = 6, PATH_BYTES = 4096 };

static void print_point(cairn_output *output, const cairn_detection_curve_point *point)
{
    cairn_real low[2], high[2];

    cairn_detection_curve_interval(point->recall, point->instances, &low[0], &high[0]);
    cairn_detection_curve_interval(point->precision, point->detections, &low[1], &high[1]);
    cairn_output_print(output, "%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f\n", (double)point->score,
                       (double)point->recall, (double)low[0], (double)high[0],
                       (double)point->precision, (double)low[1], (double)high[1],
                       (double)point->false_per_image);
}

static cairn_status write_table(const char *path, const cairn_detection_curve_point *points,
                                int32_t count, cairn_file_error *error)
{
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    cairn_output_print(output, "score,recall,recall_low,recall_high,precision,precision_low,"
                               "precision_high,false_per_image\n");
    for (int32_t i = 0; i < count; i++)
        print_point(output, &points[i]);
    return cairn_output_commit(output, error);
}

/* Line segments between consecutive points; by_recall: precision over recall, otherwise recall over
 * false positives. bound: -1, 1: lower or upper confidence bound. */
static void make_lines(cairn_vec2 *line, const cairn_detection_curve_point *points, int32_t count,
                       int by_recall, int bound)
{
    for (int32_t i = 0; i + 1 < count; i++)
        for (int32_t k = 0; k < 2; k++) {
            const cairn_detection_curve_point *point = &points[i + k];
            cairn_real low, high, value = by_recall ? point->precision : point->recall;

            cairn_detection_curve_interval(value, by_recall ? point->detections : point->instances,
                                           &low, &high);
            line[2 * i + k].x = by_recall ? point->recall : point->false_per_image;
            line[2 * i + k].y = bound < 0 ? low : bound > 0 ? high : value;
        }
}

static cairn_status draw(const char *path, const char *title,
                         const cairn_detection_curve_point *points, int32_t count,
                         cairn_file_error *error)
{
    static const char *const colours[LINE_COUNT] = {"#2563eb", "#93c5fd", "#93c5fd",
                                                    "#dc2626", "#fca5a5", "#fca5a5"};
    static const int bounds[] = {0, -1, 1};
    size_t capacity = 2 * (size_t)count;
    cairn_vec2 *lines = calloc(LINE_COUNT * capacity + 1, sizeof *lines);
    cairn_report_figure figure = cairn_report_figure_default();
    cairn_report_layer layer[LINE_COUNT];
    cairn_report_plot plot[2] = {{.x_label = "recall",
                                  .y_label = "precision",
                                  .layer = &layer[0],
                                  .layer_count = 3,
                                  .box = {{0, 0}, {1, 1}}},
                                 {.x_label = "false positives per image",
                                  .y_label = "detection rate",
                                  .layer = &layer[3],
                                  .layer_count = 3,
                                  .box = {{0, 0}, {CAIRN_REAL(1.5), 1}}}};
    cairn_status status;

    if (lines == NULL)
        return cairn_file_error_system(error, path, "curves", ENOMEM);
    for (int32_t i = 0; i < LINE_COUNT; i++) {
        cairn_report_layer own = {.colour = colours[i],
                                  .mark = CAIRN_REPORT_LINES,
                                  .count = count > 0 ? count - 1 : 0,
                                  .point = lines + (size_t)i * capacity,
                                  .width = i % 3 == 0 ? 2 : 1,
                                  .opacity = 1};

        layer[i] = own;
        make_lines(lines + (size_t)i * capacity, points, count, i < 3, bounds[i % 3]);
    }
    figure.title = title;
    figure.plot = plot;
    figure.plot_count = 2;
    status = cairn_report_figure_write(path, &figure, error);
    free(lines);
    return status;
}

cairn_status cairn_detection_curve_file_write(const char *stem, const char *title,
                                              const cairn_detection_curve_point *points,
                                              int32_t count, cairn_file_error *error)
{
    char path[PATH_BYTES];
    cairn_status status;

    if (snprintf(path, sizeof path, "%s.csv", stem) >= (int)sizeof path)
        return cairn_file_error_system(error, stem, "curves", ENAMETOOLONG);
    status = write_table(path, points, count, error);
    if (status != CAIRN_OK)
        return status;
    (void)snprintf(path, sizeof path, "%s.svg", stem);
    return draw(path, title, points, count, error);
}
