#include "bench/bench_lum.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "cairn/lum.h"

int32_t bench_lum_hits(const cairn_scan_view *view, cairn_oriented_point *points)
{
    const cairn_vec2 any = {1, 0};
    int32_t count = 0;

    for (int32_t k = 0; k < view->beam_count; k++)
        if (view->beams[k].kind == CAIRN_SCAN_BEAM_HIT) {
            points[count].position = view->beams[k].to;
            points[count++].direction = any;
        }
    return count;
}

/* hits: [beams of a scan] as working memory, as written; NULL: the scans' points are aligned. */
static cairn_status align(const sim_scan *scans, int32_t count, cairn_scan *scan, cairn_lum *lum,
                          cairn_oriented_point *hits, bench_pose *poses)
{
    cairn_status status = CAIRN_OK;

    for (int32_t i = 0; i < count && status == CAIRN_OK; i++) {
        sim_pose p = poses[i].pose;
        cairn_pose pose = {(cairn_real)p.x, (cairn_real)p.y, (cairn_real)p.theta};
        cairn_scan_view view;

        status = bench_fit_scan(scan, &scans[i], &view);
        if (status == CAIRN_OK && hits != NULL)
            status = cairn_lum_add_scan(lum, hits, bench_lum_hits(&view, hits), pose, NULL);
        else if (status == CAIRN_OK)
            status = cairn_lum_add_scan(lum, view.points, view.point_count, pose, NULL);
    }
    if (status == CAIRN_OK)
        status = cairn_lum_begin(lum);
    while (status == CAIRN_OK && cairn_lum_read(lum).verdict == CAIRN_LUM_RUNNING) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        status = cairn_lum_step(lum, &budget);
        status = status == CAIRN_MORE ? CAIRN_OK : status;
    }
    for (int32_t i = 0; i < count && status == CAIRN_OK; i++) {
        cairn_pose pose = cairn_lum_pose(lum, i);

        poses[i].pose.x = (double)pose.x;
        poses[i].pose.y = (double)pose.y;
        poses[i].pose.theta = (double)pose.theta;
        poses[i].flagged = !cairn_lum_is_connected(lum, i);
    }
    return status;
}

int bench_run_lum(const sim_scan *scans, int32_t count, int32_t iterations, bench_lum_way way,
                  bench_pose *poses, bench_run *run)
{
    double start = bench_seconds();
    cairn_scan_params scan_params = cairn_scan_default();
    cairn_lum_params params =
        way == BENCH_LUM_AS_WRITTEN ? cairn_lum_as_written() : cairn_lum_default();
    cairn_oriented_point *hits = NULL;
    cairn_scan *scan = NULL;
    cairn_lum *lum = NULL;
    cairn_status status;
    cairn_pool pool;
    void *memory;
    size_t bytes;

    memset(run, 0, sizeof *run);
    scan_params.max_beams = scans[0].count;
    /* about the spacing of the beams: evenly spaced points lock into a false optimum */
    scan_params.spacing = CAIRN_REAL(0.03);
    scan_params.max_points = 2048;
    params.max_scans = count;
    params.max_points = count * scan_params.max_points;
    params.max_links = params.max_fill = count * (count - 1) / 2 + 1;
    params.max_iterations = iterations;
    if (way == BENCH_LUM_AS_WRITTEN) {
        hits = malloc(((size_t)scans[0].count + 1) * sizeof *hits);
    } else {
        params.rebuild_interval = 5;
        params.sequential_registration = way == BENCH_LUM_REGISTERED;
    }
    bytes = cairn_lum_memory(&params) + cairn_scan_memory(&scan_params) + CAIRN_ALIGN;
    memory = malloc(bytes);
    status = memory == NULL || (way == BENCH_LUM_AS_WRITTEN && hits == NULL)
                 ? CAIRN_NO_MEMORY
                 : cairn_pool_init(&pool, memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_scan_create(&scan, &pool, &scan_params);
    if (status == CAIRN_OK)
        status = cairn_lum_create(&lum, &pool, &params);
    if (status == CAIRN_OK)
        status = align(scans, count, scan, lum, hits, poses);
    if (status == CAIRN_OK) {
        run->steps = cairn_lum_read(lum).iterations;
        run->seconds = bench_seconds() - start;
        run->step_ms = 1e3 * run->seconds / (run->steps > 0 ? run->steps : 1);
        run->pool_bytes = pool.peak;
    } else {
        fprintf(stderr, "bench: %s\n", cairn_status_text(status));
    }
    free(hits);
    free(memory);
    return status == CAIRN_OK;
}
