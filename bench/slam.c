/* bench/slam: whole real logs against their reference relations (Kuemmerle et al. 2009).
 *
 * A relation is the relative pose of two scans. Its error is the difference of the estimated
 * relative pose from the reference: length of the translation, absolute angle of the rotation; mean
 * and standard deviation over all relations. With --no-odometry the poses of the log are
 * overwritten with noise before they are used. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "bench/bench_filter.h"
#include "bench/bench_json.h"
#include "bench/bench_noise.h"
#include "cairn/carmen_log.h"
#include "cairn/map_quality.h"
#include "cairn/mapper.h"
#include "cairn/output.h"
#include "cairn/relation_table.h"
#include "tools/options.h"

static const double DEGREES = 57.29577951308232;

typedef struct settings {
    const char *log, *relations, *data;
    int64_t seed, window, particles, max_keys, first;
    int32_t no_odometry, no_loops, shape_prior;
} settings;

/* Reads the relations of a log's scans; prints errors. To be freed; NULL on failure. */
static cairn_relation_table_row *read_relations(const char *path, const cairn_carmen_log_scans *log,
                                                int32_t *count)
{
    int64_t *stamp = malloc(((size_t)log->count + 1) * sizeof *stamp);
    cairn_relation_table_row *row = NULL;
    cairn_file_error error;

    if (stamp == NULL) {
        fprintf(stderr, "%s: no memory for %" PRId32 " stamps\n", path, log->count);
        return NULL;
    }
    for (int32_t i = 0; i < log->count; i++)
        stamp[i] = log->record[i].stamp_ns;
    if (cairn_relation_table_read(&row, count, path, &error) != CAIRN_OK) {
        fprintf(stderr, "%s\n", error.text);
        row = NULL;
    } else if (cairn_relation_table_find(row, *count, stamp, log->count) < 0) {
        fprintf(stderr, "%s: no memory for %" PRId32 " relations\n", path, *count);
        cairn_relation_table_free(row);
        row = NULL;
    }
    free(stamp);
    return row;
}

/* What one scan cost, in units of budget. */
typedef struct scan_cost {
    double median, worst;
} scan_cost;

static scan_cost cost_of(double *units, int32_t count)
{
    scan_cost out = {0, 0};

    for (int32_t i = 0; i < count; i++)
        out.worst = fmax(out.worst, units[i]);
    out.median = bench_median(units, (size_t)count);
    return out;
}

/* Re-attaches scans 0 ... count - 1 after the keyframes culled since the last call. */
static void rehang(const cairn_mapper *mapper, int32_t *seen, int32_t *key, cairn_pose *poses,
                   int32_t count)
{
    for (int32_t now = cairn_mapper_measure(mapper).culled_keyframes; *seen < now; (*seen)++)
        for (int32_t i = 0; i < count; i++)
            cairn_mapper_reattach(cairn_mapper_culling_at(mapper, *seen), &key[i], &poses[i]);
}

/* Maps the log; poses: [count], of the sensor, as relations are between sensors. Returns the
 * elapsed time, -1 on failure. */
static double map_log(const settings *s, const cairn_carmen_log_scans *log, cairn_pose *poses,
                      size_t *pool_bytes, cairn_mapper_state *state, scan_cost *cost)
{
    int32_t most = log->count < 8192 ? log->count + 1 : 8192;
    cairn_mapper_params params = cairn_mapper_default_for(
        s->max_keys > 0 ? (int32_t)s->max_keys : most, log->info.max_beams);
    int32_t *key = malloc((size_t)log->count * sizeof *key);
    double *units = malloc((size_t)log->count * sizeof *units);
    cairn_mapper *mapper;
    cairn_pool pool;
    size_t bytes;
    void *memory;
    double start;
    cairn_status status;
    int live = isatty(STDERR_FILENO);
    int32_t seen = 0;

    params.cull_keyframes = s->max_keys > 0;
    params.window = (int32_t)s->window;
    if (params.window > 0 && params.window_free >= params.window)
        params.window_free = params.window - 1;
    if (s->no_loops)
        params.loop.max_loops = params.local_span = 0;
    bytes = cairn_mapper_memory(&params) + CAIRN_ALIGN;
    memory = malloc(bytes);
    status = memory == NULL || key == NULL || units == NULL ? CAIRN_NO_MEMORY
                                                            : cairn_pool_init(&pool, memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_mapper_create(&mapper, &pool, &params);
    start = bench_seconds();
    for (int32_t i = 0; i < log->count && status == CAIRN_OK; i++) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        cairn_scan_input input = log->record[i].scan;

        if (s->no_odometry)
            /* the mounting, too, follows from the log's poses */
            input.base_sensor = cairn_pose_identity();
        status =
            cairn_mapper_add(mapper, &input, s->no_odometry ? NULL : &log->record[i].robot, NULL);
        if (status == CAIRN_MORE)
            status = cairn_mapper_step(mapper, &budget);
        units[i] = (double)(CAIRN_UNBOUNDED - budget.left);
        if (status == CAIRN_OK) {
            cairn_mapper_result result = cairn_mapper_read(mapper);

            rehang(mapper, &seen, key, poses, i);
            key[i] = result.keyframe;
            poses[i] = result.keyframe_scan;
        }
        if (live && i % 500 == 0)
            fprintf(stderr, "\r%" PRId32 " of %" PRId32 " scans ", i, log->count);
    }
    if (status == CAIRN_OK) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        status = cairn_mapper_settle(mapper, &budget);
        rehang(mapper, &seen, key, poses, log->count);
    }
    if (live)
        fprintf(stderr, "\r%*s\r", 40, "");
    start = bench_seconds() - start;
    if (status == CAIRN_OK) {
        for (int32_t i = 0; i < log->count; i++)
            poses[i] = cairn_pose_compose(
                cairn_pose_compose(cairn_mapper_keyframe_pose(mapper, key[i]), poses[i]),
                s->no_odometry ? cairn_pose_identity() : log->record[i].scan.base_sensor);
        *state = cairn_mapper_measure(mapper);
        *cost = cost_of(units, log->count);
        *pool_bytes = pool.peak;
    } else {
        fprintf(stderr, "mapper: %s\n", cairn_status_text(status));
    }
    free(key);
    free(units);
    free(memory);
    return status == CAIRN_OK ? start : -1;
}

/* The same by particles. */
static double filter_log(const settings *s, const cairn_carmen_log_scans *log, cairn_pose *poses,
                         bench_filter *filter, scan_cost *cost)
{
    double *units = malloc((size_t)log->count * sizeof *units);
    int done;

    filter->particles = (int32_t)s->particles;
    filter->seed = (uint64_t)s->seed;
    filter->no_odometry = s->no_odometry;
    filter->shape_prior = s->shape_prior;
    done = units != NULL && bench_filter_map(filter, log, poses, units);
    for (int32_t i = 0; i < log->count && done && !s->no_odometry; i++)
        poses[i] = cairn_pose_compose(poses[i], log->record[i].scan.base_sensor);
    if (done)
        *cost = cost_of(units, log->count);
    free(units);
    return done ? filter->seconds : -1;
}

/* Relations with scans missing in the log are left out, and counted. */
static void print_errors(const settings *s, const char *name, const cairn_carmen_log_scans *log,
                         const cairn_pose *poses, const cairn_relation_table_row *row,
                         int32_t count, double seconds, size_t pool_bytes,
                         const cairn_mapper_state *state, const bench_filter *filter,
                         scan_cost cost)
{
    cairn_map_quality_relation_sums sums = {0, 0, 0, 0, 0};
    cairn_map_quality_relation_errors errors;

    for (int32_t i = 0; i < count; i++)
        if (row[i].first >= 0 &&
            cairn_map_quality_relation_add(&sums, row[i].reference, poses[row[i].first],
                                           poses[row[i].second]) != CAIRN_OK)
            fprintf(stderr, "bench/slam: line %" PRId64 ": the relation cannot be compared\n",
                    row[i].line);
    errors = cairn_map_quality_relation_errors_of(&sums);
    bench_json_begin("slam");
    bench_json_text("log", name);
    bench_json_text("method", s->particles > 0 ? "filter" : "mapper");
    bench_json_text("odometry", s->no_odometry ? "none" : "log");
    bench_json_integer("scans", log->count);
    bench_json_integer("relations", sums.count);
    bench_json_integer("left_out", count - sums.count);
    bench_json_number("trans_mean_m", (double)errors.distance_mean);
    bench_json_number("trans_sd_m", (double)errors.distance_sd);
    bench_json_number("rot_mean_deg", (double)errors.angle_mean * DEGREES);
    bench_json_number("rot_sd_deg", (double)errors.angle_sd * DEGREES);
    bench_json_number("scans_per_second", (double)log->count / seconds);
    bench_json_integer("pool_bytes", (int64_t)pool_bytes);
    bench_json_number("units_median", cost.median);
    bench_json_number("ops_worst_over_median", cost.worst / cost.median);
    bench_json_integer("keys", state->keyframes);
    bench_json_integer("releases", state->culled_keyframes);
    bench_json_integer("unmatched", state->predicted);
    bench_json_number("unobservable_share", (double)state->unobservable / log->count);
    bench_json_integer("searched", state->searched);
    bench_json_integer("doubtful", state->low_confidence);
    bench_json_integer("contradicted", state->odometry_contradicted);
    bench_json_integer("loops", state->loops);
    bench_json_integer("solutions", state->graph_solutions);
    bench_json_integer("lacks_room", state->capacity_exceeded);
    if (s->particles > 0) {
        bench_json_integer("particles", s->particles);
        bench_json_integer("shape_matches", filter->state.shape_matches);
        bench_json_integer("shape_starts", filter->state.shape_starts);
        bench_json_integer("resamplings", filter->state.resamplings);
        bench_json_integer("returns", filter->state.revisit_matches);
        bench_json_integer("nodes_peak", filter->state.nodes_peak);
    }
    bench_json_true("summary");
    bench_json_end();
}

static int run_log(const settings *s, const char *log_path, const char *relations_path)
{
    cairn_carmen_log_scans all, log;
    cairn_file_error error;
    cairn_mapper_state state = {0};
    bench_filter filter = {0};
    cairn_relation_table_row *row;
    cairn_pose *poses;
    size_t pool_bytes = 0;
    scan_cost cost = {0, 0};
    int32_t count = 0;
    double seconds = -1;

    if (cairn_carmen_log_load(&all, log_path, NULL, &error) != CAIRN_OK) {
        fprintf(stderr, "%s\n", error.text);
        return 3;
    }
    if (s->first >= all.count) {
        fprintf(stderr, "bench/slam: --first is %" PRId64 ", but %s has %" PRId32 " scans\n",
                s->first, log_path, all.count);
        cairn_carmen_log_scans_free(&all);
        return 2;
    }
    log = all;
    log.record += s->first;
    log.count -= (int32_t)s->first;
    row = read_relations(relations_path, &log, &count);
    poses = malloc((size_t)log.count * sizeof *poses);
    if (s->no_odometry)
        bench_noise_poses(&log, (uint64_t)s->seed);
    if (poses == NULL)
        fprintf(stderr, "%s: no memory for %" PRId32 " poses\n", log_path, log.count);
    if (row != NULL && poses != NULL && s->particles > 0) {
        seconds = filter_log(s, &log, poses, &filter, &cost);
        pool_bytes = filter.pool_bytes;
        state = filter.front;
    } else if (row != NULL && poses != NULL) {
        seconds = map_log(s, &log, poses, &pool_bytes, &state, &cost);
    }
    if (seconds >= 0)
        print_errors(s, cairn_output_path_name(log_path), &log, poses, row, count, seconds,
                     pool_bytes, &state, &filter, cost);
    free(poses);
    cairn_relation_table_free(row);
    cairn_carmen_log_scans_free(&all);
    return seconds >= 0 ? 0 : 3;
}

/* A log of the data sets by its name: DIR/slam/NAME.clf.gz with NAME.relations. */
static int run_named(const settings *s, const char *name)
{
    char log[4096], relations[4096];

    snprintf(log, sizeof log, "%s/slam/%s.clf.gz", s->data, name);
    snprintf(relations, sizeof relations, "%s/slam/%s.relations", s->data, name);
    return run_log(s, log, relations);
}

int main(int argc, char **argv)
{
    static const char *const names[] = {"intel", "fr079", "aces"};
    settings s = {.data = "../shared/data", .seed = 1, .window = 8};
    const option table[] = {
        OPTION_TEXT("--log", &s.log, "FILE",
                    "one CARMEN log; without --relations the name of one in DIR/slam (all three)"),
        OPTION_TEXT("--relations", &s.relations, "FILE", "its reference relations"),
        OPTION_TEXT("--data", &s.data, "DIR", "folder of the data sets (../shared/data)"),
        OPTION_INTEGER("--first", &s.first, 0, INT32_MAX, "N", "index of the scan to begin with"),
        OPTION_FLAG("--no-odometry", &s.no_odometry,
                    "uses the ranges alone; the log's poses are overwritten with noise"),
        OPTION_FLAG("--no-loops", &s.no_loops, "no loop closure"),
        OPTION_INTEGER("--window", &s.window, 0, 64, "N",
                       "sliding window of keyframes for the force field"),
        OPTION_INTEGER("--max-keys", &s.max_keys, 0, 1 << 20, "N",
                       "capacity of N keyframes with keyframe culling (0: capacity for all)"),
        OPTION_INTEGER("--filter", &s.particles, 0, 4096, "N",
                       "Rao-Blackwellized particle filter of N particles, 0: the mapper"),
        OPTION_FLAG("--shape-prior", &s.shape_prior, "with --filter: starts by shape, too"),
        OPTION_INTEGER("--seed", &s.seed, 0, 9e15, "N",
                       "seed of that noise and of the particle filter"),
    };
    const option_set set = {"bench/slam", "[--log NAME | --log FILE --relations FILE] [options]",
                            "Absolute errors of mapped logs over their reference relations.", table,
                            sizeof table / sizeof *table};
    size_t words = 0;
    option_result result;
    int code = 0;

    result = options_read(&set, argc, argv, NULL, &words);
    if (result != OPTIONS_READ)
        return result;
    if (s.log == NULL && s.relations != NULL)
        return options_refuse("bench/slam", "--relations without --log, expected both");
    if (s.shape_prior && s.particles == 0)
        return options_refuse("bench/slam", "--shape-prior without --filter, expected both");
    if (s.window == 1)
        return options_refuse("bench/slam", "--window is '1', expected 0 or 2 to 64");
    if (s.log != NULL)
        return s.relations != NULL ? run_log(&s, s.log, s.relations) : run_named(&s, s.log);
    for (size_t i = 0; i < sizeof names / sizeof *names && code == 0; i++)
        code = run_named(&s, names[i]);
    return code;
}
