#include "bench/bench_places.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "cairn/report.h"
#include "src/host/base/degrees.h"
#include "tools/cairn_places_picture.h"

void bench_pose_errors(const sim_pose *truth, const sim_pose *poses, int32_t count, double *metres,
                       double *degrees)
{
    for (int32_t i = 0; i < count; i++) {
        metres[i] = hypot(poses[i].x - truth[i].x, poses[i].y - truth[i].y);
        degrees[i] = fabs(remainder(poses[i].theta - truth[i].theta, 2 * 3.14159265358979323846)) /
                     CAIRN_DEGREE;
    }
}

/* End points of the beams of all scans, in the frames of the scans: scans[k].point into one array;
 * NULL: memory is insufficient. */
static cairn_vec2 *hits_of(const sim_scan *sims, int32_t count, cairn_report_scan *scans)
{
    size_t beams = 0, used = 0;
    cairn_vec2 *points;

    for (int32_t k = 0; k < count; k++)
        beams += (size_t)sims[k].count;
    points = malloc(beams * sizeof *points);
    for (int32_t k = 0; k < count && points != NULL; k++) {
        const sim_scan *scan = &sims[k];

        memset(&scans[k], 0, sizeof scans[k]);
        scans[k].point = points + used;
        for (int32_t i = 0; i < scan->count; i++) {
            double angle = scan->angle_min + i * scan->angle_step, range = (double)scan->range[i];
            sim_pose end = {range * cos(angle), range * sin(angle), 0};

            if (!isfinite(range))
                continue;
            end = bench_pose_compose(scan->base_sensor, end);
            points[used].x = (cairn_real)end.x;
            points[used++].y = (cairn_real)end.y;
            scans[k].point_count++;
        }
    }
    return points;
}

int bench_draw_maps(const char *path, const char *heading, const char *const titles[BENCH_PANELS],
                    const sim_scan *sims, int32_t count, const sim_pose *const poses[BENCH_PANELS])
{
    size_t n = (size_t)count;
    places_maps maps = {.title = heading, .count = count};
    cairn_report_scan *scans = malloc(n * sizeof *scans);
    cairn_pose *copies = malloc(BENCH_PANELS * n * sizeof *copies);
    cairn_vec2 *points = scans != NULL ? hits_of(sims, count, scans) : NULL;
    cairn_file_error error;
    int done = 0;

    if (points != NULL && copies != NULL) {
        for (int k = 0; k < BENCH_PANELS; k++) {
            for (size_t i = 0; i < n; i++)
                copies[(size_t)k * n + i] = bench_cairn_pose(poses[k][i]);
            maps.panel_title[k] = titles[k];
            maps.pose[k] = copies + (size_t)k * n;
        }
        maps.scan = scans;
        done = places_draw_maps(path, &maps, &error) == CAIRN_OK;
        if (!done)
            fprintf(stderr, "bench/match: cannot write %s\n", path);
    }
    free(scans);
    free(copies);
    free(points);
    return done;
}

/* ---- Errors ---- */

/* Magnification of the drawn errors: a power of ten, such that the median is at most half a
 * metre. */
static double enlargement(const sim_scan *sims, int32_t count, const sim_pose *poses,
                          double *median)
{
    double *metres = malloc(2 * (size_t)count * sizeof *metres), by = 1;

    *median = 0;
    if (metres != NULL) {
        for (int32_t k = 0; k < count; k++)
            bench_pose_errors(&sims[k].truth, &poses[k], 1, &metres[k], &metres[count + k]);
        *median = bench_median(metres, (size_t)count);
    }
    free(metres);
    while (by < 1000 && *median * by * 10 <= 0.5)
        by *= 10;
    return by;
}

/* Walls: the hits at the true poses. */
static int32_t true_hits(const sim_scan *sims, int32_t count, const cairn_report_scan *scans,
                         cairn_vec2 *out)
{
    int32_t used = 0;

    for (int32_t k = 0; k < count; k++)
        for (int32_t i = 0; i < scans[k].point_count; i++) {
            sim_pose hit = {(double)scans[k].point[i].x, (double)scans[k].point[i].y, 0};

            hit = bench_pose_compose(sims[k].truth, hit);
            out[used].x = (cairn_real)hit.x;
            out[used++].y = (cairn_real)hit.y;
        }
    return used;
}

static void fill_errors(const sim_scan *sims, int32_t count, const sim_pose *poses, double by,
                        cairn_vec2 *dots, cairn_vec2 *vectors)
{
    for (int32_t k = 0; k < count; k++) {
        sim_pose truth = sims[k].truth;

        dots[k].x = vectors[2 * k].x = (cairn_real)truth.x;
        dots[k].y = vectors[2 * k].y = (cairn_real)truth.y;
        vectors[2 * k + 1].x = (cairn_real)(truth.x + by * (poses[k].x - truth.x));
        vectors[2 * k + 1].y = (cairn_real)(truth.y + by * (poses[k].y - truth.y));
    }
}

int bench_draw_errors(const char *folder, uint64_t seed, const sim_scan *sims, int32_t count,
                      const sim_pose *poses)
{
    size_t n = (size_t)count;
    cairn_report_scan *scans = malloc(n * sizeof *scans);
    cairn_vec2 *points = scans != NULL ? hits_of(sims, count, scans) : NULL,
               *marks = malloc(3 * n * sizeof *marks);
    cairn_vec2 *walls = NULL;
    cairn_report_figure figure = cairn_report_figure_default();
    double median, by = enlargement(sims, count, poses, &median);
    char subtitle[120], path[512];
    size_t hits = 0;
    cairn_file_error error;
    int done = 0;

    for (int32_t k = 0; k < count && points != NULL; k++)
        hits += (size_t)scans[k].point_count;
    if (points != NULL)
        walls = malloc((hits + 1) * sizeof *walls);
    if (walls != NULL && marks != NULL) {
        int32_t wall_count = true_hits(sims, count, scans, walls);
        const cairn_report_layer layers[] = {
            {"walls", "#94a3b8", CAIRN_REPORT_DOTS, wall_count, walls, 1, 0.5},
            {"error of a pose", "#dc2626", CAIRN_REPORT_LINES, count, marks + n, 2, 1},
            {"true pose", "#1d4ed8", CAIRN_REPORT_DOTS, count, marks, 5, 1},
        };
        cairn_report_plot plot;

        memset(&plot, 0, sizeof plot);
        plot.box = cairn_box_empty();
        plot.layer = layers;
        plot.layer_count = sizeof layers / sizeof *layers;
        fill_errors(sims, count, poses, by, marks, marks + n);
        (void)snprintf(subtitle, sizeof subtitle,
                       "errors drawn %.0f times larger; their median is %.1f mm", by,
                       1000 * median);
        figure.title = "Poses found without odometry, and their errors";
        figure.subtitle = subtitle;
        figure.plot = &plot;
        figure.plot_count = 1;
        (void)snprintf(path, sizeof path, "%s/errors-%" PRIu64 ".svg", folder, seed);
        done = cairn_report_figure_write(path, &figure, &error) == CAIRN_OK;
        if (!done)
            fprintf(stderr, "bench/match: cannot write %s\n", path);
    }
    free(scans);
    free(points);
    free(marks);
    free(walls);
    return done;
}
