/* cairn map: online SLAM on a log, scan by scan. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/mapper.h"
#include "cairn/output.h"
#include "tools/cairn_map_work.h"
#include "tools/cairn_player.h"
#include "tools/cairn_tool.h"

/* Returns 1 when the log is standard input. */
static int is_stream(const map_settings *s)
{
    return s->log_count == 1 && strcmp(s->log, "-") == 0;
}

/* Refuses options that need a stream without one, or the other way round. */
static int check_stream(const map_settings *s)
{
    const char *without = s->live ? "--live" : s->watch > 0 ? "--watch" : NULL;
    const char *with = s->report != NULL                                    ? "--report"
                       : s->particles > 0                                   ? "--filter"
                       : s->scan_topic != NULL || s->odometry_topic != NULL ? "--scan or --odom"
                       : s->scanner.range_scale > 0                         ? "--range-scale"
                                                                            : NULL;

    if (!is_stream(s) && without != NULL)
        return options_refuse(MAP_PROGRAM, "%s with %s, expected - (standard input)", without,
                              s->log);
    if (is_stream(s) && with != NULL)
        return options_refuse(MAP_PROGRAM, "%s with -, expected a file", with);
    if (s->live && s->json)
        return options_refuse(MAP_PROGRAM, "--json with --live, expected one of them: --live "
                                           "prints a JSON object for each scan");
    if (s->watch > 0 && s->folder == NULL)
        return options_refuse(MAP_PROGRAM, "--watch without -o, expected a folder to write to");
    for (int32_t i = 0; s->log_count > 1 && i < s->log_count; i++)
        if (strcmp(s->logs[i], "-") == 0)
            return options_refuse(MAP_PROGRAM, "- among %d logs, expected it alone",
                                  (int)s->log_count);
    return TOOL_OK;
}

static option_result read_settings(map_settings *s, int argc, char **argv)
{
    const option table[] = {
        OPTION_TEXT("-o", &s->folder, "DIR",
                    "folder for poses.csv, poses.tum, graph.g2o, map.pgm, map.yaml, map.svg"),
        OPTION_FLAG("--no-odometry", &s->no_odometry,
                    "uses the ranges alone; poses are then those of the sensor"),
        OPTION_INTEGER("--max-keys", &s->max_keyframes, 2, 1000000, "N",
                       "maximum number of keyframes"),
        OPTION_FLAG("--release", &s->cull_keyframes,
                    "keyframe culling: beyond --max-keys the most redundant keyframes are removed"),
        OPTION_FLAG(
            "--no-loops", &s->no_loops,
            "no loop closure and no pose graph: shows whether a loop closure has folded the map"),
        OPTION_INTEGER("--window", &s->window, 0, 64, "N",
                       "sliding window of keyframes for the force field, 0: none"),
        OPTION_NUMBER("--resolution", &s->resolution, 0.001, 10, "M", "cell size of the map, m"),
        OPTION_NUMBER("--range", &s->range, 0.1, 1000, "M",
                      "maximum range of beams entered into the map, m"),
        OPTION_NUMBER(
            "--clear", &s->clear, 0, 1000, "M",
            "beams without return free cells up to the first wall when the scanner sees no "
            "farther, m"),
        OPTION_NUMBER("--range-max", &s->range_max, 0.1, 1000, "M",
                      "ranges from this value on count as no return, m (from the log)"),
        TOOL_LOG_OPTIONS(&s->scan_topic, &s->odometry_topic, &s->scanner),
        OPTION_NUMBER("--odometry-sigma", &s->odometry_sigma, 0.001, 10, "M",
                      "standard deviation of the odometry after 3 m, m, where it is known; turns "
                      "count 3 m per rad (learnt from the log)"),
        OPTION_FLAG("--keep-angle-step", &s->keep_angle_step,
                    "the angle step of the log, also where overlapping scans show that its field "
                    "of view is one beam too wide"),
        TOOL_SWEEP_OPTION(&s->scanner),
        OPTION_INTEGER("--filter", &s->particles, 0, 4096, "N",
                       "Rao-Blackwellized particle filter of N particles, which close loops "
                       "themselves, without pose graph; ten are as good as thirty (0: the "
                       "mapper)"),
        OPTION_FLAG("--shape-prior", &s->shape_prior,
                    "with --filter: matches with the old map also start where the shapes of the "
                    "scans are alike (section 6.6 of the thesis; no gain on public logs)"),
        OPTION_INTEGER("--seed", &s->seed, 0, 9e15, "N",
                       "seed of the particle filter; the mapper is deterministic"),
        OPTION_FLAG("--live", &s->live,
                    "prints the pose of each scan of - as a line of JSON; -o may lack"),
        OPTION_NUMBER("--watch", &s->watch, 0.1, 1e6, "S",
                      "rewrites the files of -o every S seconds while it reads -"),
        OPTION_TEXT("--report", &s->report, "FILE", PLAYER_HELP),
        OPTION_TEXT("--pool", &s->pool, "BYTES",
                    "memory of the mapper (exactly the memory needed)"),
        OPTION_JSON(&s->json),
        OPTION_FLAG("--quiet", &s->quiet, "no progress, no warnings, no summary"),
    };
    const option_set set = {
        MAP_PROGRAM, "LOG [LOG ...] -o DIR [options]",
        "Maps a " TOOL_LOG ", scan by scan: every scan is "
        "matched "
        "against nearby keyframes, force field simulation refines a sliding window of the last "
        "keyframes, and "
        "loops are closed (pose graph). Several logs are mapped one after another, each from the "
        "last pose of the previous one. "
        "LOG may be -: a CARMEN log, or a LaserScan as JSON a line, from standard input, mapped "
        "while it "
        "comes; SIGINT ends it. "
        "With --filter every particle has a map of its own, and the map of the most likely path is "
        "written.",
        table, sizeof table / sizeof *table};
    size_t words = MAP_MAX_LOGS;
    option_result result = options_read(&set, argc, argv, s->logs, &words);

    if (result != OPTIONS_READ)
        return result;
    s->log_count = (int32_t)words;
    if (words == 0 || (s->folder == NULL && !s->live)) {
        (void)options_refuse(MAP_PROGRAM, "%s, expected LOG -o DIR",
                             words == 0 ? "no log" : "no folder to write to (-o)");
        return OPTIONS_BAD;
    }
    s->log = s->logs[0];
    if (check_stream(s) != TOOL_OK)
        return OPTIONS_BAD;
    if (s->cull_keyframes && s->particles > 0) {
        (void)options_refuse(MAP_PROGRAM, "--release with --filter, expected one of them: the "
                                          "particle filter has no keyframe culling");
        return OPTIONS_BAD;
    }
    if (s->shape_prior && s->particles == 0) {
        (void)options_refuse(MAP_PROGRAM, "--shape-prior without --filter, expected both");
        return OPTIONS_BAD;
    }
    if (s->no_loops && (s->cull_keyframes || s->particles > 0)) {
        (void)options_refuse(MAP_PROGRAM, "--no-loops with %s, expected one of them: %s",
                             s->cull_keyframes ? "--release" : "--filter",
                             s->cull_keyframes ? "keyframe culling needs the pose graph"
                                               : "the particles close loops themselves");
        return OPTIONS_BAD;
    }
    if (s->odometry_sigma > 0 && s->no_odometry) {
        (void)options_refuse(MAP_PROGRAM,
                             "--odometry-sigma with --no-odometry, expected one of them");
        return OPTIONS_BAD;
    }
    if (s->window == 1) {
        (void)options_refuse(MAP_PROGRAM, "--window is '1', expected 0 or 2 to 64");
        return OPTIONS_BAD;
    }
    return OPTIONS_READ;
}

/* Feeds all scans to the mapper. TOOL_OK, or another exit code after a line on standard error.
 * *full is set, and no line printed, when the mapper has no capacity for a keyframe. */
static int feed(map_run *run, const map_input *input, int32_t *full)
{
    tool_progress progress = tool_progress_begin("map", input->count, run->settings->quiet);
    cairn_fault fault = {-1, NULL};
    cairn_status status = CAIRN_OK;
    int32_t i;

    for (i = 0; i < input->count; i++) {
        status = map_run_add(run, &input->record[i], map_input_odometry(input, i),
                             i == input->count - 1, &fault);
        if (status != CAIRN_OK)
            break;
        tool_progress_at(&progress, i);
    }
    tool_progress_end(&progress);
    *full = status == CAIRN_FULL;
    if (status == CAIRN_OK)
        return map_run_settle(run);
    return *full ? TOOL_BAD
                 : tool_report_scan(map_input_log(input, i)->path, input->record[i].line, status,
                                    &fault);
}

int map_refuse_keys(const map_settings *s, int32_t max_keys)
{
    return options_refuse(MAP_PROGRAM,
                          "%s: needs more than %" PRId32
                          " keyframes, expected at most that: raise --max-keys",
                          s->log, max_keys);
}

/* How a pass over the logs has ended. */
typedef enum map_end { MAP_ENDED, MAP_FULL, MAP_CORRECTED } map_end;

/* Maps and writes with a capacity of `points` points per keyframe. No line is printed when the
 * capacity is too small, or when the angle step of the input was corrected: then nothing is written
 * either. */
static int map_with_capacity(map_settings *s, map_input *input, int32_t points, map_end *end)
{
    cairn_mapper_params params = map_params(s, input->count, input->beams_most, points);
    double start = tool_seconds(), fed;
    int32_t full = 0;
    map_run run;
    int code = map_check_params(s, &params);

    *end = MAP_ENDED;
    if (code != TOOL_OK)
        return code;
    if (s->particles > 0) {
        code = map_by_filter(s, input, &params, &full);
        *end = full ? MAP_FULL : MAP_ENDED;
        return code;
    }
    code = map_run_open(&run, s, &params, input->count);
    if (code != TOOL_OK)
        return code;
    code = feed(&run, input, &full);
    fed = tool_seconds();
    if (full && cairn_mapper_measure(run.mapper).keyframes == params.max_keyframes)
        code = map_refuse_keys(s, params.max_keyframes);
    else if (full)
        *end = MAP_FULL;
    if (code == TOOL_OK && !s->angle_step.is_checked) {
        code = map_check_angle_step(s, &run, input);
        *end = s->angle_step.is_corrected ? MAP_CORRECTED : MAP_ENDED;
    }
    if (code == TOOL_OK && *end == MAP_ENDED)
        code = map_run_write(&run);
    if (code == TOOL_OK && *end == MAP_ENDED)
        map_run_print(&run, input->faults, input->stamps_back > 0, tool_seconds() - start,
                      fed - start);
    map_run_close(&run);
    return code;
}

/* Maps the log; again with more points per keyframe while the capacity is too small, and with the
 * angle step that was found. */
static int map_files(map_settings *s, map_input *input)
{
    int32_t points = cairn_capacity_keyframe_points(0);
    map_end end = MAP_FULL;
    int code = TOOL_OK;

    while (end != MAP_ENDED && points > 0) {
        code = map_with_capacity(s, input, points, &end);
        if (end == MAP_FULL)
            points = cairn_capacity_keyframe_points(points);
    }
    if (end == MAP_FULL)
        code = options_refuse(
            MAP_PROGRAM, "%s: the keyframes have more than %d points or segments, expected fewer",
            s->log, CAIRN_CAPACITY_MAX_POINTS);
    return code;
}

int tool_map(int argc, char **argv)
{
    map_settings s = {0};
    cairn_file_error error;
    option_result result;
    map_input input;
    int code;

    s.max_keyframes = 4096;
    s.window = 8;
    s.seed = 1;
    s.resolution = 0.05;
    s.range = 30;
    s.clear = 5;
    result = read_settings(&s, argc, argv);
    if (result != OPTIONS_READ)
        return result;
    if (s.folder != NULL &&
        map_output_check(s.folder, s.particles == 0 && !s.no_loops, s.report, &error) != CAIRN_OK)
        return tool_report(&error);
    if (is_stream(&s))
        return map_live(&s);
    code = map_input_load(&input, s.logs, s.log_count,
                          &(tool_log_options){.range_max = s.range_max,
                                              .scan_topic = s.scan_topic,
                                              .odometry_topic = s.odometry_topic,
                                              .scanner = s.scanner,
                                              .quiet = s.quiet});
    if (code != TOOL_OK)
        return code;
    s.no_odometry |= !input.has_odometry;
    if (s.odometry_sigma > 0 && s.no_odometry) {
        map_input_free(&input);
        return options_refuse(MAP_PROGRAM, "%s: no odometry, --odometry-sigma expects some", s.log);
    }
    code = map_files(&s, &input);
    map_input_free(&input);
    return code;
}
