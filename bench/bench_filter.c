#include "bench/bench_filter.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "bench/bench_json.h"

static cairn_status feed(const bench_filter *run, cairn_filter_mapper *mapper,
                         const cairn_carmen_log_scans *log, int32_t *key, cairn_pose *poses,
                         double *units)
{
    cairn_status status = CAIRN_OK;
    int live = isatty(STDERR_FILENO);

    for (int32_t i = 0; i < log->count && status == CAIRN_OK; i++) {
        cairn_budget budget = {CAIRN_UNBOUNDED};
        cairn_scan_input input = log->record[i].scan;
        cairn_mapper_result result;

        if (run->no_odometry)
            /* the mounting, too, follows from the log's poses */
            input.base_sensor = cairn_pose_identity();
        status = cairn_filter_mapper_add(mapper, &input,
                                         run->no_odometry ? NULL : &log->record[i].robot, NULL);
        if (status == CAIRN_MORE)
            status = cairn_filter_mapper_step(mapper, &budget);
        units[i] = (double)(CAIRN_UNBOUNDED - budget.left);
        result = cairn_mapper_read(cairn_filter_mapper_front(mapper));
        key[i] = result.keyframe;
        poses[i] = result.keyframe_scan;
        if (live && i % 500 == 0)
            fprintf(stderr, "\r%" PRId32 " of %" PRId32 " scans ", i, log->count);
    }
    if (live)
        fprintf(stderr, "\r%*s\r", 40, "");
    return status;
}

int bench_filter_map(bench_filter *run, const cairn_carmen_log_scans *log, cairn_pose *poses,
                     double *units)
{
    cairn_filter_mapper_params params = cairn_filter_mapper_default_for(
        log->count < 8192 ? log->count + 1 : 8192, log->info.max_beams, run->particles);
    int32_t *key = malloc(((size_t)log->count + 1) * sizeof *key), best;
    cairn_pose *path = malloc((size_t)params.front.max_keyframes * sizeof *path);
    cairn_filter_mapper *mapper = NULL;
    cairn_pool pool;
    cairn_status status;
    double start = bench_seconds();
    size_t bytes;
    void *memory;

    params.seed = run->seed;
    params.shape_prior = run->shape_prior;
    bytes = cairn_filter_mapper_memory(&params) + CAIRN_ALIGN;
    memory = malloc(bytes);
    status = memory == NULL || key == NULL || path == NULL ? CAIRN_NO_MEMORY
                                                           : cairn_pool_init(&pool, memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_filter_mapper_create(&mapper, &pool, &params);
    if (status == CAIRN_OK)
        status = feed(run, mapper, log, key, poses, units);
    if (status == CAIRN_OK) {
        best = cairn_filter_mapper_best(mapper);
        (void)cairn_filter_mapper_path(mapper, best, path, params.front.max_keyframes);
        for (int32_t i = 0; i < log->count; i++)
            poses[i] = cairn_pose_compose(path[key[i]], poses[i]);
        run->seconds = bench_seconds() - start;
        run->pool_bytes = pool.peak;
        run->front = cairn_mapper_measure(cairn_filter_mapper_front(mapper));
        run->state = cairn_filter_mapper_measure(mapper);
    } else {
        fprintf(stderr, "filter: %s\n", cairn_status_text(status));
    }
    free(memory);
    free(path);
    free(key);
    return status == CAIRN_OK;
}
