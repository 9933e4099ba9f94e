#include "bench/bench_sequential.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "cairn/filter_mapper.h"

/* A mapper of either kind. */
typedef struct sequential {
    cairn_mapper *mapper;
    cairn_filter_mapper *filter;
} sequential;

static cairn_status open_mapper(sequential *s, cairn_pool *pool, void **memory, int32_t count,
                                int32_t beams, int32_t particles)
{
    cairn_filter_mapper_params params =
        cairn_filter_mapper_default_for(count, beams, particles > 0 ? particles : 1);
    size_t bytes;
    cairn_status status;

    params.front.max_keyframe_points = count * params.front.scan.max_points;
    params.front.max_keyframe_segments = count * params.front.scan.max_segments;
    bytes =
        particles > 0 ? cairn_filter_mapper_memory(&params) : cairn_mapper_memory(&params.front);
    *memory = malloc(bytes + CAIRN_ALIGN);
    status =
        *memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(pool, *memory, bytes + CAIRN_ALIGN);
    if (status != CAIRN_OK)
        return status;
    return particles > 0 ? cairn_filter_mapper_create(&s->filter, pool, &params)
                         : cairn_mapper_create(&s->mapper, pool, &params.front);
}

/* Maps one scan; returns its reference keyframe and relative pose. */
static cairn_status add(sequential *s, const sim_scan *scan, sim_pose odometry,
                        cairn_mapper_result *result)
{
    cairn_pose at = {(cairn_real)odometry.x, (cairn_real)odometry.y, (cairn_real)odometry.theta};
    cairn_scan_input input = sim_scan_input(scan);
    cairn_status status = s->filter != NULL ? cairn_filter_mapper_map(s->filter, &input, &at, NULL)
                                            : cairn_mapper_map(s->mapper, &input, &at, NULL);

    *result =
        cairn_mapper_read(s->filter != NULL ? cairn_filter_mapper_front(s->filter) : s->mapper);
    return status;
}

/* path: [count] final poses of the keyframes. */
static cairn_status end(sequential *s, cairn_pose *path, int32_t count)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status = CAIRN_OK;

    if (s->filter != NULL) {
        (void)cairn_filter_mapper_path(s->filter, cairn_filter_mapper_best(s->filter), path, count);
        return CAIRN_OK;
    }
    status = cairn_mapper_settle(s->mapper, &budget);
    for (int32_t i = 0; i < cairn_mapper_measure(s->mapper).keyframes; i++)
        path[i] = cairn_mapper_keyframe_pose(s->mapper, i);
    return status;
}

typedef struct turn {
    int32_t place, heading, scan;
} turn;

static int compare(const void *a, const void *b)
{
    const turn *x = a, *y = b;

    return x->place != y->place ? x->place - y->place : x->heading - y->heading;
}

/* The order of the log: place by place, one heading after another. */
static void log_order(const sim_scan *scans, int32_t count, turn *order)
{
    for (int32_t i = 0; i < count; i++) {
        order[i].place = scans[i].place;
        order[i].heading = scans[i].heading;
        order[i].scan = i;
    }
    qsort(order, (size_t)count, sizeof *order, compare);
}

int bench_run_sequential(const sim_scan *scans, int32_t count, int32_t particles, bench_pose *poses,
                         bench_run *run)
{
    size_t n = (size_t)count;
    turn *order = malloc(n * sizeof *order);
    cairn_mapper_result *result = calloc(n, sizeof *result);
    cairn_pose *path = calloc(n, sizeof *path);
    sequential s = {NULL, NULL};
    double start = bench_seconds();
    cairn_status status = CAIRN_NO_MEMORY;
    void *memory = NULL;
    cairn_pool pool;

    memset(run, 0, sizeof *run);
    if (order != NULL && result != NULL && path != NULL)
        status = open_mapper(&s, &pool, &memory, count, scans[0].count, particles);
    if (status == CAIRN_OK)
        log_order(scans, count, order);
    for (int32_t i = 0; i < count && status == CAIRN_OK; i++)
        status = add(&s, &scans[order[i].scan], poses[order[i].scan].pose, &result[i]);
    if (status == CAIRN_OK)
        status = end(&s, path, count);
    for (int32_t i = 0; i < count && status == CAIRN_OK; i++) {
        cairn_pose pose = cairn_pose_compose(path[result[i].keyframe], result[i].keyframe_scan);
        bench_pose *out = &poses[order[i].scan];

        out->pose.x = (double)pose.x;
        out->pose.y = (double)pose.y;
        out->pose.theta = (double)pose.theta;
        out->flagged = result[i].verdict == CAIRN_MAPPER_PREDICTED ||
                       result[i].verdict == CAIRN_MAPPER_NO_FEATURES;
    }
    run->seconds = bench_seconds() - start;
    if (status == CAIRN_OK)
        run->pool_bytes = pool.peak;
    else
        fprintf(stderr, "bench/align: %s\n", cairn_status_text(status));
    free(memory);
    free(path);
    free(result);
    free(order);
    return status == CAIRN_OK;
}
