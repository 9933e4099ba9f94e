/* bench/match --as-written: the map of chapter 6 of Adluru 2008, and its figures 6.6 and 6.7. */
#include "bench/bench_match.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "bench/bench_places.h"

cairn_place_map_params bench_match_written_params(const bench_match_settings *settings,
                                                  places_stage stage)
{
    cairn_place_map_params params = places_stage_params(stage);

    params.max_places = (int32_t)settings->places;
    params.max_scans = BENCH_MATCH_HEADINGS * params.max_places;
    return params;
}

/* Poses of the places and the scans after a stage, relative to the true pose of the first place. */
static int map_stage(const bench_match_settings *settings, const bench_match_problem *p,
                     places_stage stage, sim_pose *places, sim_pose *scans)
{
    cairn_place_map_params params = bench_match_written_params(settings, stage);
    bench_match_machine m = {NULL, 0, NULL, NULL};
    int done = bench_match_machine_make(&params, &m) && bench_match_map(p, &m);

    for (int32_t i = 0; i < p->place_count && done; i++)
        places[i] = bench_pose_compose(
            p->frame[0], bench_sim_pose(cairn_place_map_place_of(m.map, i).map_place));
    for (int32_t k = 0; k < p->scan_count && done; k++)
        scans[k] =
            bench_pose_compose(p->frame[0], bench_sim_pose(cairn_place_map_scan_pose(m.map, k)));
    free(m.memory);
    return done;
}

/* found: after the shape stage alone, and with ICP. */
static int draw_errors(const char *path, const bench_match_problem *p, const sim_pose *by_shape,
                       const sim_pose *by_icp)
{
    const sim_pose *const from[] = {p->frame, by_shape, by_icp};
    size_t n = (size_t)p->place_count;
    cairn_pose *to = malloc(3 * n * sizeof *to);
    places_errors errors = {.actual_name = "actual pose", .count = p->place_count};
    cairn_file_error error;
    int done = 0;

    if (to != NULL) {
        for (size_t k = 0; k < 3; k++)
            for (size_t i = 0; i < n; i++)
                to[k * n + i] = bench_cairn_pose(from[k][i]);
        errors.actual = to;
        errors.by_shape = to + n;
        errors.with_icp = to + 2 * n;
        done = places_draw_errors(path, &errors, &error) == CAIRN_OK;
    }
    if (!done)
        fprintf(stderr, "bench/match: cannot write %s\n", path);
    free(to);
    return done;
}

int bench_match_draw_written(const bench_match_settings *settings, const bench_match_problem *p,
                             uint64_t seed, const char *folder)
{
    const char *const titles[BENCH_PANELS] = {places_stage_titles[0], places_stage_titles[1],
                                              places_stage_titles[2], "(d) actual"};
    size_t n = (size_t)p->scan_count;
    sim_pose *places = malloc(PLACES_STAGES * n * sizeof *places);
    sim_pose *scans = malloc(PLACES_STAGES * n * sizeof *scans);
    int done = places != NULL && scans != NULL;

    for (int stage = 0; stage < PLACES_STAGES && done; stage++)
        done = map_stage(settings, p, stage, places + (size_t)stage * n, scans + (size_t)stage * n);
    if (done) {
        const sim_pose *const all[BENCH_PANELS] = {scans, scans + n, scans + 2 * n, p->truth};
        char path[512];

        (void)snprintf(path, sizeof path, "%s/fig-6.6-%" PRIu64 ".svg", folder, seed);
        done = draw_errors(path, p, places, places + n);
        (void)snprintf(path, sizeof path, "%s/fig-6.7-%" PRIu64 ".svg", folder, seed);
        done = done && bench_draw_maps(path, "Fig. 6.7: maps without odometry", titles, p->scans,
                                       p->scan_count, all);
    }
    free(places);
    free(scans);
    return done;
}
