/* Evaluation of detections against ground truth.
 *
 * Method: the protocol of the ETHZ shape classes and of PASCAL VOC 2007: each object is matched
 * once, by the best detection that overlaps it enough; 11-point interpolated average precision.
 *
 * Source: Everingham et al. 2010 (11 points); Wilson 1927 (intervals). */
#include "src/base/build.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "cairn/detection_curve.h"
#include "cairn/output.h"
#include "cairn/report.h"

#define WILSON_Z 1.96
enum { LINE_COUNT = 6, PATH_BYTES = 4096 };

double cairn_detection_curve_overlap(const double a[4], const double b[4])
{
    double w = fmin(a[2], b[2]) - fmax(a[0], b[0]), h = fmin(a[3], b[3]) - fmax(a[1], b[1]);
    double intersection = w > 0 && h > 0 ? w * h : 0;

    return intersection /
           ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - intersection);
}

int32_t cairn_detection_curve_object(const double (*objects)[4], const int32_t *claimed,
                                     int32_t count, const double box[4], double *share)
{
    int32_t best = -1;

    *share = 0;
    for (int32_t i = 0; i < count; i++) {
        double overlap = cairn_detection_curve_overlap(objects[i], box);

        if (!claimed[i] && overlap > *share) {
            *share = overlap;
            best = i;
        }
    }
    return best;
}

static int compare_events(const void *a, const void *b)
{
    const cairn_detection_curve_event *x = a, *y = b;

    if (x->score != y->score)
        return x->score < y->score ? 1 : -1;
    return x->hit - y->hit;
}

void cairn_detection_curve(cairn_detection_curve_event *events, int32_t count, int32_t images,
                           int32_t instances, cairn_detection_curve_point *points)
{
    int32_t hits = 0;

    if (count > 1)
        qsort(events, (size_t)count, sizeof *events, compare_events);
    for (int32_t i = 0; i < count; i++) {
        hits += events[i].hit;
        points[i].score = events[i].score;
        points[i].recall = (double)hits / (instances > 0 ? instances : 1);
        points[i].precision = (double)hits / (i + 1);
        points[i].false_per_image = (double)(i + 1 - hits) / (images > 0 ? images : 1);
        points[i].instances = instances;
        points[i].detections = i + 1;
    }
}

double cairn_detection_curve_rate_at(const cairn_detection_curve_point *points, int32_t count,
                                     double false_per_image)
{
    double rate = 0;

    for (int32_t i = 0; i < count && points[i].false_per_image <= false_per_image; i++)
        rate = points[i].recall;
    return rate;
}

double cairn_detection_curve_precision_at(const cairn_detection_curve_point *points, int32_t count,
                                          double recall)
{
    double best = 0;

    for (int32_t i = 0; i < count; i++)
        if (points[i].recall >= recall - 1e-9)
            best = fmax(best, points[i].precision);
    return best;
}

double cairn_detection_curve_average_precision(const cairn_detection_curve_point *points,
                                               int32_t count)
{
    double sum = 0;

    for (int32_t k = 0; k <= 10; k++)
        sum += cairn_detection_curve_precision_at(points, count, k / 10.0);
    return sum / 11;
}

void cairn_detection_curve_interval(double share, int32_t count, double *low, double *high)
{
    double n = count > 0 ? count : 1, z2 = WILSON_Z * WILSON_Z,
           centre = (share + z2 / (2 * n)) / (1 + z2 / n);
    double half = WILSON_Z / (1 + z2 / n) * sqrt(share * (1 - share) / n + z2 / (4 * n * n));

    *low = fmax(0, centre - half);
    *high = fmin(1, centre + half);
}

/* ---- Files ---- */

static void print_point(cairn_output *output, const cairn_detection_curve_point *point)
{
    double low[2], high[2];

    cairn_detection_curve_interval(point->recall, point->instances, &low[0], &high[0]);
    cairn_detection_curve_interval(point->precision, point->detections, &low[1], &high[1]);
    cairn_output_print(output, "%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f\n", point->score,
                       point->recall, low[0], high[0], point->precision, low[1], high[1],
                       point->false_per_image);
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
            double low, high, value = by_recall ? point->precision : point->recall;

            cairn_detection_curve_interval(value, by_recall ? point->detections : point->instances,
                                           &low, &high);
            line[2 * i + k].x = (cairn_real)(by_recall ? point->recall : point->false_per_image);
            line[2 * i + k].y = (cairn_real)(bound < 0 ? low : bound > 0 ? high : value);
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

cairn_status cairn_detection_curve_write(const char *stem, const char *title,
                                         const cairn_detection_curve_point *points, int32_t count,
                                         cairn_file_error *error)
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
