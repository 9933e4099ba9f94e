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

/* Maximum number of points, and of segments, of all keyframes together. */
#define MAX_KEYFRAME_ELEMENTS (1 << 24)

/* Budget of a call of cairn_mapper_settle(): small enough that no loop event is overwritten before
 * it is read. */
#define SETTLE_BUDGET_UNITS 5000

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
        OPTION_INTEGER("--window", &s->window, 0, 64, "N",
                       "sliding window of keyframes for the force field, 0: none"),
        OPTION_NUMBER("--resolution", &s->resolution, 0.001, 10, "M", "cell size of the map, m"),
        OPTION_NUMBER("--range", &s->range, 0.1, 1000, "M",
                      "maximum range of beams entered into the map, m"),
        OPTION_NUMBER("--clear", &s->clear, 0, 1000, "M",
                      "beams without return free cells when the scanner sees no farther, m"),
        OPTION_NUMBER("--range-max", &s->range_max, 0.1, 1000, "M",
                      "ranges from this value on count as no return, m (from the log)"),
        OPTION_NUMBER("--sweep", &s->sweep, 0, 2, "S",
                      "duration of a scan, first to last beam, s, for logs without it; 0: no "
                      "motion during a scan"),
        OPTION_INTEGER("--filter", &s->particles, 0, 4096, "N",
                       "Rao-Blackwellized particle filter of N particles, without loop closure and "
                       "pose graph (0: the mapper)"),
        OPTION_INTEGER("--seed", &s->seed, 0, 9e15, "N",
                       "seed of the particle filter; the mapper is deterministic"),
        OPTION_TEXT("--report", &s->report, "FILE", PLAYER_HELP),
        OPTION_TEXT("--pool", &s->pool, "BYTES",
                    "memory of the mapper (exactly the memory needed)"),
        OPTION_FLAG("--quiet", &s->quiet, "no progress, no summary"),
    };
    const option_set set = {
        MAP_PROGRAM, "LOG [LOG ...] -o DIR [options]",
        "Maps a log (CARMEN, or a table of ranges, plain or gzipped), scan by scan: every scan is "
        "matched\n"
        "against nearby keyframes, force field simulation refines a sliding window of the last "
        "keyframes, and\n"
        "loops are closed (pose graph). Several logs are mapped one after another, each from the "
        "last pose of the previous one.\n"
        "With --filter every particle has a map of its own, and the map of the most likely path is "
        "written.",
        table, sizeof table / sizeof *table};
    size_t words = MAP_MAX_LOGS;
    option_result result = options_read(&set, argc, argv, s->logs, &words);

    if (result != OPTIONS_READ)
        return result;
    if (words == 0 || s->folder == NULL) {
        (void)options_refuse(MAP_PROGRAM, "%s, expected LOG -o DIR",
                             words == 0 ? "no log" : "no folder to write to (-o)");
        return OPTIONS_BAD;
    }
    s->log = s->logs[0];
    s->log_count = (int32_t)words;
    if (s->cull_keyframes && s->particles > 0) {
        (void)options_refuse(MAP_PROGRAM, "--release with --filter, expected one of them: the "
                                          "particle filter has no keyframe culling");
        return OPTIONS_BAD;
    }
    if (s->window == 1) {
        (void)options_refuse(MAP_PROGRAM, "--window is '1', expected 0 or 2 to 64");
        return OPTIONS_BAD;
    }
    return OPTIONS_READ;
}

static const char *verdict_text(cairn_mapper_verdict verdict)
{
    static const char *const texts[] = {"first", "matched", "predicted", "blind"};

    return texts[verdict];
}

int map_copy_result(const map_input *input, const cairn_mapper *mapper, int32_t index,
                    map_scan *scan, map_place *place)
{
    const cairn_carmen_log_record *record = &input->record[index];
    cairn_mapper_result result = cairn_mapper_read(mapper);
    cairn_scan_view view = cairn_mapper_view(mapper);

    if (!map_scan_copy(scan, &view))
        return 0;
    place->keyframe = result.keyframe;
    place->keyframe_scan = result.keyframe_scan;
    scan->line = record->line;
    scan->stamp_ns = record->stamp_ns;
    scan->before = record->robot;
    scan->support = result.overlap;
    if (result.verdict == CAIRN_MAPPER_MATCHED)
        memcpy(scan->covariance, result.covariance, sizeof scan->covariance);
    scan->verdict = verdict_text(result.verdict);
    scan->low_confidence = result.verdict == CAIRN_MAPPER_PREDICTED;
    return 1;
}

/* Returns the current pose of a scan: the pose of its reference keyframe composed with its relative
 * pose. */
static cairn_pose current_pose(const cairn_mapper *mapper, const map_place *place)
{
    return cairn_pose_compose(cairn_mapper_keyframe_pose(mapper, place->keyframe),
                              place->keyframe_scan);
}

cairn_scan_input map_scan_input(const map_settings *s, const map_input *input, int32_t index)
{
    cairn_scan_input scan = input->record[index].scan;

    if (s->sweep > 0 && scan.count > 1)
        scan.time_step = (float)(s->sweep / (scan.count - 1));
    if (s->no_odometry)
        /* the mounting would add information from the log's poses */
        scan.base_sensor = cairn_pose_identity();
    return scan;
}

/* ---- Keyframes ---- */

/* All keyframes ever created, by number, and the current ones of the mapper. */
typedef struct keyframe_list {
    int32_t *scan;   /* [total] scan index in the log, by keyframe number */
    int32_t *number; /* [present] keyframe number, by index in the mapper */
    int32_t total, present, releases;
} keyframe_list;

static int keyframe_list_new(keyframe_list *keys, int32_t scans)
{
    memset(keys, 0, sizeof *keys);
    keys->scan = malloc(((size_t)scans + 1) * sizeof *keys->scan);
    keys->number = malloc(((size_t)scans + 1) * sizeof *keys->number);
    return keys->scan != NULL && keys->number != NULL;
}

static void keyframe_list_free(keyframe_list *keys)
{
    free(keys->scan);
    free(keys->number);
}

/* Re-attaches scans 0 ... count - 1 to their new reference keyframes after keyframe culling since
 * the last call. */
static void apply_culling(keyframe_list *keys, const cairn_mapper *mapper, map_place *places,
                          int32_t count)
{
    cairn_mapper_state state = cairn_mapper_measure(mapper);

    for (; keys->releases < state.culled_keyframes; keys->releases++) {
        cairn_mapper_culling release = cairn_mapper_culling_at(mapper, keys->releases);

        for (int32_t i = 0; i < count; i++)
            cairn_mapper_reattach(release, &places[i].keyframe, &places[i].keyframe_scan);
        keys->present--;
        memmove(&keys->number[release.keyframe], &keys->number[release.keyframe + 1],
                (size_t)(keys->present - release.keyframe) * sizeof *keys->number);
    }
}

/* Appends scan `index` of the log as the last keyframe. */
static void append_keyframe(keyframe_list *keys, int32_t index)
{
    keys->scan[keys->total] = index;
    keys->number[keys->present++] = keys->total++;
}

/* ---- The player ---- */

/* Adds a frame of the player: the keyframes after scan `index` of the log. */
static cairn_status add_frame(cairn_report_player *player, const cairn_mapper *mapper,
                              const keyframe_list *keys, const map_place *places, int32_t index)
{
    cairn_mapper_state state = cairn_mapper_measure(mapper);
    cairn_mapper_result result = cairn_mapper_read(mapper);
    double value[2] = {result.verdict == CAIRN_MAPPER_FIRST ? (double)NAN : (double)result.overlap,
                       (double)state.potential};
    cairn_report_frame frame;
    cairn_pose *pose = malloc(((size_t)keys->total + 1) * sizeof *pose);
    cairn_status status;
    char label[64];

    if (pose == NULL)
        return CAIRN_NO_MEMORY;
    for (int32_t i = 0; i < keys->total; i++)
        pose[i] = current_pose(mapper, &places[keys->scan[i]]);
    memset(&frame, 0, sizeof frame);
    snprintf(label, sizeof label, "%" PRId32 " keyframe%s", state.keyframes,
             state.keyframes == 1 ? "" : "s");
    frame.step = index;
    frame.label = label;
    frame.pose = pose;
    frame.pose_count = keys->total;
    frame.value = value;
    status = cairn_report_player_add_frame(player, &frame);
    free(pose);
    return status;
}

/* Adds the loop closures since the last call to the player. Pending candidates and failed searches
 * are not shown. */
static cairn_status add_loop_closures(cairn_report_player *player, const cairn_mapper *mapper,
                                      const keyframe_list *keys, int32_t *shown)
{
    cairn_status status = CAIRN_OK;

    for (; status == CAIRN_OK && *shown < cairn_mapper_measure(mapper).loop_events; (*shown)++) {
        cairn_mapper_loop loop = cairn_mapper_loop_at(mapper, *shown);

        if (loop.verdict != CAIRN_MAPPER_LOOP_PENDING && loop.verdict != CAIRN_MAPPER_LOOP_NO_MATCH)
            status = cairn_report_player_add_link(player, keys->number[loop.first],
                                                  keys->number[loop.second],
                                                  loop.verdict == CAIRN_MAPPER_LOOP_ACCEPTED);
    }
    return status;
}

/* Records a keyframe and the poses after it. */
static cairn_status record_keyframe(cairn_report_player *player, const cairn_mapper *mapper,
                                    const keyframe_list *keys, const map_scan *scan,
                                    const map_place *places, int32_t index)
{
    cairn_status status = player_add_scan(player, scan, index);

    return status == CAIRN_OK ? add_frame(player, mapper, keys, places, index) : status;
}

/* Steps the mapper until all pending loop closures are decided, then adds the last frame. */
static int settle(const map_settings *s, cairn_mapper *mapper, cairn_report_player *player,
                  keyframe_list *keys, map_place *places, int32_t shown, int32_t index)
{
    cairn_status status;

    do {
        cairn_budget budget = {SETTLE_BUDGET_UNITS};

        status = cairn_mapper_settle(mapper, &budget);
        apply_culling(keys, mapper, places, index);
        if (player != NULL && (status == CAIRN_OK || status == CAIRN_MORE) &&
            add_loop_closures(player, mapper, keys, &shown) != CAIRN_OK)
            status = CAIRN_NO_MEMORY;
    } while (status == CAIRN_MORE);
    if (status == CAIRN_OK && player != NULL)
        status = add_frame(player, mapper, keys, places, index);
    if (status == CAIRN_OK)
        return TOOL_OK;
    (void)options_refuse(MAP_PROGRAM, "%s: %s", s->log, cairn_status_text(status));
    return tool_exit_code(status);
}

/* Feeds all scans to the mapper and keeps the scans for drawing. TOOL_OK, or another exit code
 * after a line on standard error. *full is set, and no line printed, when the mapper has no
 * capacity for a keyframe. */
static int feed(const map_settings *s, const map_input *input, cairn_mapper *mapper,
                map_scan *scans, map_place *places, keyframe_list *keys,
                cairn_report_player *player, int32_t *full)
{
    tool_progress progress = tool_progress_begin("map", input->count, s->quiet);
    cairn_status status = CAIRN_OK;
    int32_t i, shown = 0;

    *full = 0;
    for (i = 0; i < input->count; i++) {
        const cairn_carmen_log_record *record = &input->record[i];
        cairn_fault fault = {-1, NULL};
        cairn_mapper_result result;
        cairn_scan_input scan = map_scan_input(s, input, i);

        status = cairn_mapper_add(mapper, &scan,
                                  s->no_odometry ? NULL : map_input_odometry(input, i), &fault);
        while (status == CAIRN_OK || status == CAIRN_MORE) {
            cairn_budget budget = {CAIRN_UNBOUNDED};

            status = cairn_mapper_step(mapper, &budget);
            if (status == CAIRN_OK)
                break;
        }
        if (status != CAIRN_OK) {
            tool_progress_end(&progress);
            *full = status == CAIRN_FULL;
            return *full ? TOOL_BAD
                         : tool_report_scan(map_input_log(input, i)->path, record->line, status,
                                            &fault);
        }
        result = cairn_mapper_read(mapper);
        apply_culling(keys, mapper, places, i);
        if (result.is_keyframe)
            append_keyframe(keys, i);
        if (!map_copy_result(input, mapper, i, &scans[i], &places[i]))
            status = CAIRN_NO_MEMORY;
        if (status == CAIRN_OK && player != NULL && (result.is_keyframe || i == input->count - 1))
            status = result.is_keyframe
                         ? record_keyframe(player, mapper, keys, &scans[i], places, i)
                         : add_frame(player, mapper, keys, places, i);
        if (status == CAIRN_OK && player != NULL)
            status = add_loop_closures(player, mapper, keys, &shown);
        if (status != CAIRN_OK) {
            tool_progress_end(&progress);
            return tool_report_scan(map_input_log(input, i)->path, record->line, status, NULL);
        }
        tool_progress_at(&progress, i);
    }
    tool_progress_end(&progress);
    return settle(s, mapper, player, keys, places, shown, input->count);
}

/* The player for --report; NULL without it. */
static cairn_status open_player(const map_settings *s, const map_input *input,
                                cairn_report_player **player)
{
    static const cairn_report_curve curves[] = {
        {"support", "", "fraction of the scan's points with a correspondence"},
        {"potential P(g)", "", "of the keyframes in the window"},
    };
    cairn_report_player_params params = cairn_report_player_default();
    char title[256], subtitle[256];

    *player = NULL;
    if (s->report == NULL)
        return CAIRN_OK;
    snprintf(title, sizeof title, "%s, mapped", cairn_output_path_name(s->log));
    snprintf(subtitle, sizeof subtitle, "%" PRId32 " scans%s", input->count,
             s->no_odometry ? ", without odometry" : "");
    params.title = title;
    params.subtitle = subtitle;
    params.step_name = "scan";
    params.connect = 1;
    params.curve = curves;
    params.curve_count = (int32_t)(sizeof curves / sizeof *curves) - (s->window == 0);
    return cairn_report_player_open(player, &params);
}

/* Copies the pose graph of the keyframes without rejected links. Returns 0 when there is no
 * memory. */
static int graph_of(const cairn_mapper *mapper, cairn_pose_graph_file *graph)
{
    int32_t keys = cairn_mapper_measure(mapper).keyframes, links = cairn_mapper_link_count(mapper);

    memset(graph, 0, sizeof *graph);
    graph->vertex = calloc((size_t)keys, sizeof *graph->vertex);
    graph->edge = calloc((size_t)links + 1, sizeof *graph->edge);
    if (graph->vertex == NULL || graph->edge == NULL) {
        free(graph->vertex);
        free(graph->edge);
        return 0;
    }
    for (; graph->vertex_count < keys; graph->vertex_count++) {
        graph->vertex[graph->vertex_count].id = graph->vertex_count;
        graph->vertex[graph->vertex_count].pose =
            cairn_mapper_keyframe_pose(mapper, graph->vertex_count);
    }
    for (int32_t i = 0; i < links; i++) {
        cairn_mapper_link link = cairn_mapper_link_at(mapper, i);
        cairn_pose_graph_file_edge *edge = &graph->edge[graph->edge_count];

        if (link.is_outlier)
            continue;
        edge->first = link.first;
        edge->second = link.second;
        edge->first_second = link.first_second;
        edge->information = link.information;
        graph->edge_count++;
    }
    return 1;
}

map_output map_output_of(const map_settings *s, map_scan *scans, int32_t count)
{
    map_output output;

    memset(&output, 0, sizeof output);
    output.scan = scans;
    output.count = count;
    output.in_order = 1;
    output.grid_panel = 1;
    output.resolution = s->resolution;
    output.range = s->range;
    output.clear = s->clear;
    output.report = s->report;
    return output;
}

static int write_all(const map_settings *s, const map_input *input, const cairn_mapper *mapper,
                     map_scan *scans, const map_place *places, cairn_report_player *player)
{
    cairn_file_error error;
    map_output output;
    cairn_pose_graph_file graph;
    int code = TOOL_OK;
    char title[256], subtitle[256];

    if (!graph_of(mapper, &graph)) {
        (void)options_refuse(MAP_PROGRAM, "no memory for the graph");
        return TOOL_FAILED;
    }
    for (int32_t i = 0; i < input->count; i++)
        scans[i].after = current_pose(mapper, &places[i]);
    snprintf(title, sizeof title, "%s, mapped", cairn_output_path_name(s->log));
    snprintf(subtitle, sizeof subtitle, "%" PRId32 " scans, %" PRId32 " keyframes%s", input->count,
             cairn_mapper_measure(mapper).keyframes, s->no_odometry ? ", without odometry" : "");
    output = map_output_of(s, scans, input->count);
    output.title = title;
    output.subtitle = subtitle;
    output.player = player;
    output.graph = &graph;
    if (map_output_write(&output, s->folder, &error) != CAIRN_OK)
        code = tool_report(&error);
    free(graph.vertex);
    free(graph.edge);
    return code;
}

static void print_summary(const map_input *input, const cairn_mapper *mapper, size_t pool_bytes,
                          double seconds, double seconds_to_map)
{
    cairn_mapper_state state = cairn_mapper_measure(mapper);

    printf("scans      %" PRId32 " (%" PRId64 " damaged lines left out%s)\n"
           "seconds    %.3f, %.0f scans/s\n"
           "pool       %zu bytes at most\n"
           "keyframes  %" PRId32 " (%" PRId32 " culled)\n"
           "loops      %" PRId32 " closed, %" PRId32 " corrections%s\n"
           "unmatched  %" PRId64 " (pose by prediction)\n"
           "uncertain  %" PRId64 ", weakly observable in some direction %" PRId64 "\n"
           "odometry   contradicted by %" PRId64 " matches, %" PRId64
           " matched better from the predicted motion\n"
           "potential  %.6g\n",
           input->count, input->faults, input->stamps_back > 0 ? ", some times run back" : "",
           seconds, input->count / seconds_to_map, pool_bytes, state.keyframes,
           state.culled_keyframes, state.loops, state.graph_solutions,
           state.capacity_exceeded ? ", capacity reached" : "", state.predicted,
           state.low_confidence, state.unobservable, state.odometry_contradicted,
           state.odometry_rejected, (double)state.potential);
}

static int32_t least(int64_t a, int32_t b)
{
    return a < b ? (int32_t)a : b;
}

/* Returns the mapper's params with a capacity of `points` points per keyframe. */
static cairn_mapper_params params_for(const map_settings *s, const map_input *input, int32_t points)
{
    cairn_mapper_params params =
        cairn_mapper_default_for(least(s->max_keyframes, input->count), input->beams_most);

    params.cull_keyframes = s->cull_keyframes && s->max_keyframes < input->count;
    params.window = (int32_t)s->window;
    params.field.potential = 1;
    if (params.window > 0 && params.window_free >= params.window)
        params.window_free = params.window - 1;
    params.max_keyframe_points = least(
        (int64_t)params.max_keyframes * points + params.scan.max_points, MAX_KEYFRAME_ELEMENTS);
    params.max_keyframe_segments =
        least((int64_t)params.max_keyframes * points / 4 + params.scan.max_segments,
              MAX_KEYFRAME_ELEMENTS);
    return params;
}

int map_refuse_keys(const map_settings *s, int32_t max_keys)
{
    return options_refuse(MAP_PROGRAM,
                          "%s: needs more than %" PRId32
                          " keyframes, expected at most that: raise --max-keys",
                          s->log, max_keys);
}

/* Maps and writes with a capacity of `points` points per keyframe. *full is set, and no line
 * printed, when the capacity is too small. */
static int map_with_capacity(const map_settings *s, const map_input *input, map_scan *scans,
                             map_place *places, int32_t points, int32_t *full)
{
    cairn_mapper_params params = params_for(s, input, points);
    double start = tool_seconds(), fed;
    cairn_report_player *player = NULL;
    cairn_mapper *mapper = NULL;
    keyframe_list keys = {0};
    cairn_status status;
    cairn_pool pool;
    int code;

    *full = 0;
    if (params.cull_keyframes && cairn_mapper_memory(&params) == 0)
        return options_refuse(MAP_PROGRAM,
                              "--max-keys is '%" PRId64 "', expected more with --release",
                              s->max_keyframes);
    if (s->particles > 0)
        return map_by_filter(s, input, &params, scans, places, full);
    code = tool_pool_open(&pool, MAP_PROGRAM, s->pool, cairn_mapper_memory(&params));
    if (code != TOOL_OK)
        return code;
    status = keyframe_list_new(&keys, input->count) ? cairn_mapper_create(&mapper, &pool, &params)
                                                    : CAIRN_NO_MEMORY;
    if (status == CAIRN_OK)
        status = open_player(s, input, &player);
    if (status != CAIRN_OK) {
        keyframe_list_free(&keys);
        tool_pool_close(&pool);
        (void)options_refuse(MAP_PROGRAM, "%s: %s", s->log, cairn_status_text(status));
        return tool_exit_code(status);
    }
    code = feed(s, input, mapper, scans, places, &keys, player, full);
    fed = tool_seconds();
    if (*full && cairn_mapper_measure(mapper).keyframes == params.max_keyframes) {
        *full = 0;
        code = map_refuse_keys(s, params.max_keyframes);
    }
    if (code == TOOL_OK)
        code = write_all(s, input, mapper, scans, places, player);
    if (code == TOOL_OK && !s->quiet)
        print_summary(input, mapper, pool.peak, tool_seconds() - start, fed - start);
    cairn_report_player_free(player);
    keyframe_list_free(&keys);
    tool_pool_close(&pool);
    return code;
}

/* Maps the log. Keyframes in buildings have about 100 points and 30 segments; when the capacity is
 * too small, mapping restarts with twice the capacity. */
static int run(const map_settings *s, const map_input *input, map_scan *scans, map_place *places)
{
    int32_t most = cairn_mapper_default().scan.max_points, full = 1;
    int code = TOOL_OK;

    for (int32_t points = 160; full && points < 2 * most; points *= 2)
        code = map_with_capacity(s, input, scans, places, points, &full);
    if (full)
        code = options_refuse(
            MAP_PROGRAM, "%s: the keyframes have more than %d points or segments, expected fewer",
            s->log, MAX_KEYFRAME_ELEMENTS);
    return code;
}

int tool_map(int argc, char **argv)
{
    map_settings s = {0};
    cairn_file_error error;
    option_result result;
    map_input input;
    map_scan *scans;
    map_place *places;
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
    if (map_output_check(s.folder, s.particles == 0, s.report, &error) != CAIRN_OK)
        return tool_report(&error);
    code = map_input_load(&input, s.logs, s.log_count, s.range_max, s.quiet);
    if (code != TOOL_OK)
        return code;
    s.no_odometry |= !input.has_odometry;
    scans = map_scans_new(input.count);
    places = calloc((size_t)input.count, sizeof *places);
    if (scans == NULL || places == NULL) {
        (void)options_refuse(MAP_PROGRAM, "no memory for %" PRId32 " scans", input.count);
        code = TOOL_FAILED;
    } else {
        code = run(&s, &input, scans, places);
    }
    map_scans_free(scans, input.count);
    free(places);
    map_input_free(&input);
    return code;
}
