/* The methods of batch scan alignment behind one interface. */
#include "bench/bench_align.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "bench/bench_score.h"
#include "cairn/aligner.h"
#include "cairn/icp.h"

const char *bench_ingredient_name(bench_ingredient without)
{
    static const char *const names[BENCH_INGREDIENTS] = {"nothing", "directions", "free_space",
                                                         "restarts", "joint"};

    return names[without];
}

cairn_status bench_fit_scan(cairn_scan *scan, const sim_scan *from, cairn_scan_view *view)
{
    cairn_scan_input input = sim_scan_input(from);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status = cairn_scan_begin(scan, &input, NULL);

    if (status == CAIRN_OK)
        status = cairn_scan_step(scan, &budget);
    *view = cairn_scan_read(scan);
    return status;
}

/* A scan in a pool of its own. */
typedef struct fitter {
    cairn_scan *scan;
    void *memory;
    cairn_pool pool;
} fitter;

static cairn_status open_fitter(fitter *f, int32_t beams)
{
    cairn_scan_params params = cairn_scan_default();
    cairn_status status;
    size_t bytes;

    params.max_beams = beams;
    bytes = cairn_scan_memory(&params) + CAIRN_ALIGN;
    f->memory = malloc(bytes);
    status = f->memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(&f->pool, f->memory, bytes);
    return status == CAIRN_OK ? cairn_scan_create(&f->scan, &f->pool, &params) : status;
}

static int report(cairn_status status)
{
    if (status < 0)
        fprintf(stderr, "bench/align: %s\n", cairn_status_text(status));
    return status >= 0;
}

/* ---- default ---- */

/* Capacities that exactly fit the scans. */
static cairn_status count_room(fitter *f, const sim_scan *scans, int32_t count,
                               cairn_aligner_params *params)
{
    cairn_status status = CAIRN_OK;

    params->max_scans = count;
    params->max_segments = params->max_points = 1;
    params->max_short_segments = count;
    params->max_hypotheses = 24 * count;
    params->max_fill = 32 * count;
    for (int32_t i = 0; i < count && status == CAIRN_OK; i++) {
        cairn_scan_view view;

        status = bench_fit_scan(f->scan, &scans[i], &view);
        params->max_segments += view.segment_count;
        params->max_points += view.point_count;
    }
    return status;
}

static void leave_out(bench_ingredient without, cairn_aligner_params *params)
{
    if (without == BENCH_NO_DIRECTIONS)
        params->oriented = 0;
    if (without == BENCH_NO_FREE_SPACE)
        params->free_space_penalty = 0;
    if (without == BENCH_NO_RESTARTS)
        params->max_relocalizations = 0;
    if (without == BENCH_NO_JOINT)
        params->max_iterations = 0;
}

static void read_poses(const cairn_aligner *aligner, bench_pose *poses)
{
    cairn_aligner_result result = cairn_aligner_read(aligner);

    for (int32_t i = 0; i < cairn_aligner_scan_count(aligner); i++) {
        cairn_aligner_pose pose = cairn_aligner_pose_of(aligner, i);

        poses[i].pose = bench_sim_pose(pose.map_scan);
        for (int k = 0; k < 9; k++)
            poses[i].covariance[k] = (double)pose.covariance[k];
        poses[i].known = result.anchor >= 0;
        poses[i].flagged = !pose.placed;
        poses[i].anchor = i == result.anchor;
    }
}

static cairn_status align(fitter *f, cairn_aligner *aligner, const sim_scan *scans, int32_t count,
                          bench_pose *poses, bench_run *run)
{
    double start = bench_cpu_seconds();
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status = CAIRN_OK;

    for (int32_t i = 0; i < count && status == CAIRN_OK; i++) {
        cairn_scan_view view;

        status = bench_fit_scan(f->scan, &scans[i], &view);
        if (status == CAIRN_OK)
            status = cairn_aligner_add_scan(aligner, &view, bench_cairn_pose(poses[i].pose), NULL);
    }
    if (status == CAIRN_OK)
        status = cairn_aligner_begin(aligner);
    while (status == CAIRN_OK && (status = cairn_aligner_step(aligner, &budget)) == CAIRN_MORE) {
        budget.left = CAIRN_UNBOUNDED;
        status = CAIRN_OK;
    }
    run->seconds = bench_cpu_seconds() - start;
    run->steps = cairn_aligner_read(aligner).iterations;
    run->units = cairn_aligner_read(aligner).units;
    run->worst_step = cairn_aligner_read(aligner).worst_step;
    return status;
}

int bench_run_default(const sim_scan *scans, int32_t count, bench_ingredient without,
                      bench_pose *poses, bench_run *run)
{
    cairn_aligner_params params = cairn_aligner_default();
    cairn_aligner *aligner = NULL;
    fitter f = {NULL, NULL, {NULL, 0, 0, 0, 0, 0}};
    void *memory = NULL;
    cairn_pool pool;
    cairn_status status = open_fitter(&f, scans[0].count);

    if (status == CAIRN_OK)
        status = count_room(&f, scans, count, &params);
    leave_out(without, &params);
    if (status == CAIRN_OK) {
        size_t bytes = cairn_aligner_memory(&params);

        memory = malloc(bytes + CAIRN_ALIGN);
        status =
            memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(&pool, memory, bytes + CAIRN_ALIGN);
    }
    if (status == CAIRN_OK)
        status = cairn_aligner_create(&aligner, &pool, &params);
    if (status == CAIRN_OK)
        status = align(&f, aligner, scans, count, poses, run);
    if (status == CAIRN_OK) {
        read_poses(aligner, poses);
        params.max_fill = cairn_aligner_read(aligner).fill;
        params.max_hypotheses = cairn_aligner_read(aligner).hypotheses;
        run->pool_bytes = cairn_aligner_memory(&params);
    }
    free(memory);
    free(f.memory);
    return report(status);
}

/* ---- icp ---- */

/* All scans' points, scan by scan. */
typedef struct cloud {
    cairn_oriented_point *points;
    int32_t *first; /* [count + 1] */
} cloud;

static cairn_status fill_cloud(fitter *f, const sim_scan *scans, int32_t count, cloud *c)
{
    cairn_status status = CAIRN_OK;

    c->first = calloc((size_t)count + 1, sizeof *c->first);
    if (c->first == NULL)
        return CAIRN_NO_MEMORY;
    for (int32_t i = 0; i < count && status == CAIRN_OK; i++) {
        cairn_oriented_point *grown;
        cairn_scan_view view;
        size_t before = (size_t)c->first[i];

        status = bench_fit_scan(f->scan, &scans[i], &view);
        if (status != CAIRN_OK)
            break;
        grown = realloc(c->points, (before + (size_t)view.point_count + 1) * sizeof *grown);
        if (grown == NULL)
            return CAIRN_NO_MEMORY;
        c->points = grown;
        memcpy(grown + before, view.points, (size_t)view.point_count * sizeof *grown);
        c->first[i + 1] = c->first[i] + view.point_count;
    }
    return status;
}

/* Scan i against all others at their current poses. */
static cairn_status align_one(cairn_icp *icp, const cloud *c, int32_t count, int32_t i,
                              bench_pose *poses)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status = CAIRN_OK;

    cairn_icp_clear_target(icp);
    for (int32_t j = 0; j < count && status == CAIRN_OK; j++)
        if (j != i)
            status =
                cairn_icp_add_target(icp, c->points + c->first[j], c->first[j + 1] - c->first[j],
                                     bench_cairn_pose(poses[j].pose), NULL);
    if (status == CAIRN_OK)
        status = cairn_icp_begin(icp, c->points + c->first[i], c->first[i + 1] - c->first[i],
                                 bench_cairn_pose(poses[i].pose), NULL, NULL);
    if (status == CAIRN_EMPTY)
        return CAIRN_OK;
    if (status == CAIRN_OK)
        status = cairn_icp_step(icp, &budget);
    if (status == CAIRN_OK)
        poses[i].pose = bench_sim_pose(cairn_icp_read(icp).target_query);
    return status;
}

int bench_run_icp(const sim_scan *scans, int32_t count, int32_t sweeps, bench_pose *poses,
                  bench_run *run)
{
    cairn_icp_params params = cairn_icp_default();
    fitter f = {NULL, NULL, {NULL, 0, 0, 0, 0, 0}};
    double start = bench_seconds();
    cloud c = {NULL, NULL};
    cairn_icp *icp = NULL;
    void *memory = NULL;
    cairn_pool pool = {NULL, 0, 0, 0, 0, 0};
    cairn_status status = open_fitter(&f, scans[0].count);

    if (status == CAIRN_OK)
        status = fill_cloud(&f, scans, count, &c);
    if (status == CAIRN_OK) {
        size_t bytes;

        params.max_target = c.first[count] + 1;
        params.max_iterations = 5;
        params.gate_start = CAIRN_REAL(0.5);
        bytes = cairn_icp_memory(&params) + CAIRN_ALIGN;
        memory = malloc(bytes);
        status = memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(&pool, memory, bytes);
    }
    if (status == CAIRN_OK)
        status = cairn_icp_create(&icp, &pool, &params);
    for (int32_t sweep = 0; sweep < sweeps; sweep++)
        for (int32_t i = 0; i < count && status == CAIRN_OK; i++)
            status = align_one(icp, &c, count, i, poses);
    run->steps = sweeps;
    run->seconds = bench_seconds() - start;
    run->step_ms = 1e3 * run->seconds / sweeps;
    run->pool_bytes = pool.peak;
    free(c.points);
    free(c.first);
    free(memory);
    free(f.memory);
    return report(status);
}
