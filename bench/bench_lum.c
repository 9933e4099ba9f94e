#include "bench/bench_lum.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static cairn_pose pose_of(sim_pose p)
{
    cairn_pose pose = {(cairn_real)p.x, (cairn_real)p.y, (cairn_real)p.theta};

    return pose;
}

static cairn_status fit(cairn_scan *scan, const sim_scan *from, cairn_scan_view *view)
{
    cairn_scan_input input = sim_scan_input(from);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status = cairn_scan_begin(scan, &input, NULL);

    if (status == CAIRN_OK)
        status = cairn_scan_step(scan, &budget);
    *view = cairn_scan_read(scan);
    return status;
}

static cairn_status make(bench_lum_run *run, const sim_scan *scans, int32_t count, const sim_pose *poses,
                         const cairn_scan_params *scan_params, const cairn_lum_params *params)
{
    size_t bytes = cairn_lum_memory(params) + cairn_scan_memory(scan_params) + CAIRN_ALIGN;
    cairn_scan *scan = NULL;
    cairn_status status;
    cairn_pool pool;

    run->memory = malloc(bytes);
    status = run->memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(&pool, run->memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_scan_create(&scan, &pool, scan_params);
    if (status == CAIRN_OK)
        status = cairn_lum_create(&run->lum, &pool, params);
    for (int32_t i = 0; i < count && status == CAIRN_OK; i++) {
        cairn_scan_view view;

        status = fit(scan, &scans[i], &view);
        if (status == CAIRN_OK)
            status = cairn_lum_add_scan(run->lum, view.points, view.point_count, pose_of(poses[i]), NULL);
    }
    run->pool_bytes = pool.peak;
    return status == CAIRN_OK ? cairn_lum_begin(run->lum) : status;
}

int bench_lum_begin(bench_lum_run *run, const sim_scan *scans, int32_t count, const sim_pose *poses, int32_t iterations,
                    int32_t rebuild)
{
    cairn_scan_params scan_params = cairn_scan_default();
    cairn_lum_params params = cairn_lum_default();
    cairn_status status;

    memset(run, 0, sizeof *run);
    scan_params.max_beams = scans[0].count;
    scan_params.spacing = CAIRN_REAL(0.03); /* about what the beams have: evenly spaced points lock into each other */
    scan_params.max_points = 2048;
    params.max_scans = count;
    params.max_points = count * scan_params.max_points;
    params.max_links = params.max_fill = count * (count - 1) / 2 + 1;
    params.max_iterations = iterations;
    params.rebuild = rebuild;
    status = make(run, scans, count, poses, &scan_params, &params);
    if (status != CAIRN_OK)
        fprintf(stderr, "bench: %s\n", cairn_status_text(status));
    return status == CAIRN_OK;
}

void bench_lum_end(bench_lum_run *run)
{
    free(run->memory);
    run->memory = NULL;
}

int bench_lum_align(const sim_scan *scans, int32_t count, int32_t iterations, int32_t rebuild, sim_pose *poses,
                    int32_t *steps, size_t *pool_bytes)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    bench_lum_run run;
    int done = bench_lum_begin(&run, scans, count, poses, iterations, rebuild);

    while (done && cairn_lum_step(run.lum, &budget) == CAIRN_MORE)
        budget.left = CAIRN_UNBOUNDED;
    for (int32_t i = 0; i < count && done; i++) {
        cairn_pose pose = cairn_lum_pose(run.lum, i);

        poses[i].x = (double)pose.x;
        poses[i].y = (double)pose.y;
        poses[i].theta = (double)pose.theta;
    }
    *steps = done ? cairn_lum_read(run.lum).iterations : 0;
    *pool_bytes = run.pool_bytes;
    bench_lum_end(&run);
    return done;
}
