/* bench/match --as-written: the map of chapter 6 of Adluru 2008, and its figures 6.6 and 6.7. */
#include "bench/bench_match.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_places.h"
#include "cairn/report.h"

cairn_place_map_params bench_match_written_params(const bench_match_settings *settings, bench_match_written_stage stage)
{
    cairn_place_map_params params = cairn_place_map_as_written();

    params.max_places = (int32_t)settings->places;
    params.max_scans = BENCH_MATCH_HEADINGS * params.max_places;
    if (stage != BENCH_WRITTEN_DECOUPLED)
        params.decoupled = CAIRN_PLACE_MAP_COUPLED;
    if (stage == BENCH_WRITTEN_SHAPE)
        params.match.mode = CAIRN_SCAN_MATCH_AS_WRITTEN_SEGMENTS;
    return params;
}

/* Poses of the places and the scans after a stage, as seen from the truth of the first place. */
static int map_stage(const bench_match_settings *settings, const bench_match_problem *p,
                     bench_match_written_stage stage, sim_pose *places, sim_pose *scans)
{
    cairn_place_map_params params = bench_match_written_params(settings, stage);
    bench_match_machine m = {NULL, 0, NULL, NULL};
    int done = bench_match_machine_make(&params, &m) && bench_match_map(p, &m);

    for (int32_t i = 0; i < p->place_count && done; i++)
        places[i] = bench_pose_compose(p->frame[0], bench_sim_pose(cairn_place_map_place_of(m.map, i).map_place));
    for (int32_t k = 0; k < p->scan_count && done; k++)
        scans[k] = bench_pose_compose(p->frame[0], bench_sim_pose(cairn_place_map_scan_pose(m.map, k)));
    free(m.memory);
    return done;
}

/* ---- Figure 6.6 ---- */

enum { CIRCLE = 24 }; /* sides of a circle */

static cairn_vec2 point_at(double x, double y)
{
    cairn_vec2 p = {(cairn_real)x, (cairn_real)y};

    return p;
}

/* The true places as pluses and the estimated ones as circles of this size, m: [4 count] and [2 CIRCLE count] points. */
static void fill_marks(const sim_pose *truth, const sim_pose *found, int32_t count, double size, cairn_vec2 *plus,
                       cairn_vec2 *circle)
{
    for (int32_t i = 0; i < count; i++) {
        *plus++ = point_at(truth[i].x - size, truth[i].y);
        *plus++ = point_at(truth[i].x + size, truth[i].y);
        *plus++ = point_at(truth[i].x, truth[i].y - size);
        *plus++ = point_at(truth[i].x, truth[i].y + size);
        for (int k = 0; k < 2 * CIRCLE; k++) {
            int corner = (k + 1) / 2;
            double angle = corner * (360.0 / CIRCLE) * BENCH_DEGREE;

            *circle++ = point_at(found[i].x + size * cos(angle), found[i].y + size * sin(angle));
        }
    }
}

/* Error by place, as a line from place to place: [2 (count - 1)] points. */
static void fill_errors(const sim_pose *truth, const sim_pose *found, int32_t count, cairn_vec2 *line)
{
    for (int32_t i = 1; i < count; i++)
        for (int32_t k = i - 1; k <= i; k++)
            *line++ = point_at(k + 1, hypot(found[k].x - truth[k].x, found[k].y - truth[k].y));
}

/* found: of shape alone, and with ICP. */
static int draw_errors(const char *path, const bench_match_problem *p, const sim_pose *by_shape, const sim_pose *by_icp)
{
    int32_t n = p->place_count;
    cairn_vec2 *plus = malloc(4 * (size_t)n * sizeof *plus), *circle = malloc(2 * CIRCLE * (size_t)n * sizeof *circle);
    cairn_vec2 *line = malloc(4 * (size_t)n * sizeof *line);
    cairn_report_figure figure = cairn_report_figure_default();
    cairn_file_error error;
    int done = 0;

    if (plus != NULL && circle != NULL && line != NULL) {
        const cairn_report_layer map[] = {
            {"actual pose", "#1d4ed8", CAIRN_REPORT_LINES, 2 * n, plus, 2, 1},
            {"estimated pose", "#dc2626", CAIRN_REPORT_LINES, CIRCLE * n, circle, 2, 1},
        };
        const cairn_report_layer chart[] = {
            {"by shape", "#dc2626", CAIRN_REPORT_LINES, n - 1, line, 2, 1},
            {"and ICP", "#0f766e", CAIRN_REPORT_LINES, n - 1, line + 2 * n, 2, 1},
        };
        cairn_report_plot plot[2];

        memset(plot, 0, sizeof plot);
        fill_marks(p->frame, by_shape, n, 0.12, plus, circle);
        fill_errors(p->frame, by_shape, n, line);
        fill_errors(p->frame, by_icp, n, line + 2 * n);
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
        done = cairn_report_figure_write(path, &figure, &error) == CAIRN_OK;
    }
    if (!done)
        fprintf(stderr, "bench/match: cannot write %s\n", path);
    free(plus);
    free(circle);
    free(line);
    return done;
}

/* ---- Both ---- */

int bench_match_draw_written(const bench_match_settings *settings, const bench_match_problem *p, uint64_t seed,
                             const char *folder)
{
    static const char *const titles[BENCH_PANELS] = {"(a) by shape", "(b) + ICP", "(c) decoupled", "(d) actual"};
    size_t n = (size_t)p->scan_count;
    sim_pose *places = malloc(BENCH_WRITTEN_STAGES * n * sizeof *places);
    sim_pose *scans = malloc(BENCH_WRITTEN_STAGES * n * sizeof *scans);
    int done = places != NULL && scans != NULL;

    for (int stage = 0; stage < BENCH_WRITTEN_STAGES && done; stage++)
        done = map_stage(settings, p, stage, places + (size_t)stage * n, scans + (size_t)stage * n);
    if (done) {
        const sim_pose *const all[BENCH_PANELS] = {scans, scans + n, scans + 2 * n, p->truth};
        char path[512];

        (void)snprintf(path, sizeof path, "%s/fig-6.6-%" PRIu64 ".svg", folder, seed);
        done = draw_errors(path, p, places, places + n);
        (void)snprintf(path, sizeof path, "%s/fig-6.7-%" PRIu64 ".svg", folder, seed);
        done = done && bench_draw_maps(path, "Fig. 6.7: maps without odometry", titles, p->scans, p->scan_count, all);
    }
    free(places);
    free(scans);
    return done;
}
