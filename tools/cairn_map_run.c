/* A run of the mapper: scans in, results and files out. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/output.h"
#include "tools/cairn_map_work.h"
#include "tools/cairn_player.h"
#include "tools/cairn_tool.h"

int map_copy_result(const cairn_carmen_log_record *record, const cairn_mapper *mapper,
                    map_scan *scan, cairn_scan_place *place)
{
    if (!cairn_placed_scan_take(scan, place, mapper))
        return 0;
    scan->line = record->line;
    scan->stamp_ns = record->stamp_ns;
    scan->before = record->robot;
    return 1;
}

cairn_scan_input map_scan_input(const map_settings *s, const cairn_carmen_log_record *record)
{
    cairn_scan_input scan = record->scan;

    if (s->no_odometry)
        /* the mounting would add information from the log's poses */
        scan.base_sensor = cairn_pose_identity();
    return scan;
}

/* ---- Keyframes ---- */

/* Makes space for one more keyframe; 0 when there is no memory. */
static int reserve_keyframe(keyframe_list *keys)
{
    int32_t capacity = 2 * keys->capacity + 256;
    int32_t *scan, *number;

    if (keys->total < keys->capacity)
        return 1;
    scan = realloc(keys->scan, (size_t)capacity * sizeof *scan);
    if (scan != NULL)
        keys->scan = scan;
    number = realloc(keys->number, (size_t)capacity * sizeof *number);
    if (number != NULL)
        keys->number = number;
    if (scan == NULL || number == NULL)
        return 0;
    keys->capacity = capacity;
    return 1;
}

/* Re-attaches scans 0 ... count - 1 to their new reference keyframes after keyframe culling since
 * the last call. */
static void apply_culling(keyframe_list *keys, const cairn_mapper *mapper, cairn_scan_place *places,
                          int32_t count)
{
    cairn_mapper_state state = cairn_mapper_measure(mapper);

    for (; keys->releases < state.culled_keyframes; keys->releases++) {
        cairn_mapper_culling release = cairn_mapper_culling_at(mapper, keys->releases);

        cairn_scan_places_reattach(places, count, release);
        keys->present--;
        memmove(&keys->number[release.keyframe], &keys->number[release.keyframe + 1],
                (size_t)(keys->present - release.keyframe) * sizeof *keys->number);
    }
}

/* Appends scan `index` of the log as the last keyframe. CAIRN_NO_MEMORY. */
static cairn_status append_keyframe(keyframe_list *keys, int32_t index)
{
    if (!reserve_keyframe(keys))
        return CAIRN_NO_MEMORY;
    keys->scan[keys->total] = index;
    keys->number[keys->present++] = keys->total++;
    return CAIRN_OK;
}

/* ---- The player ---- */

/* Adds a frame of the player: the keyframes after scan `index` of the log. */
static cairn_status add_frame(cairn_report_player *player, const cairn_mapper *mapper,
                              const keyframe_list *keys, const cairn_scan_place *places,
                              int32_t index)
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
        pose[i] = cairn_scan_place_pose(mapper, &places[keys->scan[i]]);
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
                                    const cairn_scan_place *places, int32_t index)
{
    cairn_status status = player_add_scan(player, scan, index);

    return status == CAIRN_OK ? add_frame(player, mapper, keys, places, index) : status;
}

/* ---- Scans ---- */

/* Makes space for the results of one more scan; 0 when there is no memory. */
static int reserve_result(map_run *run)
{
    int32_t capacity = run->capacity > 0 ? 2 * run->capacity : 1024;
    cairn_scan_place *places;
    map_scan *scans;

    if (run->count < run->capacity)
        return 1;
    if (run->capacity > INT32_MAX / 2)
        return 0;
    places = realloc(run->places, (size_t)capacity * sizeof *places);
    if (places == NULL)
        return 0;
    run->places = places;
    scans = cairn_placed_scans_new(capacity);
    if (scans == NULL)
        return 0;
    if (run->count > 0)
        memcpy(scans, run->scans, (size_t)run->count * sizeof *scans);
    free(run->scans);
    run->scans = scans;
    run->capacity = capacity;
    return 1;
}

/* Adds what is new to the player. */
static cairn_status show(map_run *run, const cairn_mapper_result *result, int32_t is_last)
{
    int32_t index = run->count - 1;
    cairn_status status = CAIRN_OK;

    if (run->player == NULL)
        return CAIRN_OK;
    if (result->is_keyframe)
        status = record_keyframe(run->player, run->mapper, &run->keys, &run->scans[index],
                                 run->places, index);
    else if (is_last)
        status = add_frame(run->player, run->mapper, &run->keys, run->places, index);
    return status == CAIRN_OK ? add_loop_closures(run->player, run->mapper, &run->keys, &run->shown)
                              : status;
}

/* Keeps the result of the scan that the mapper has taken. */
static cairn_status keep(map_run *run, const cairn_carmen_log_record *record, int32_t is_last)
{
    cairn_mapper_result result = cairn_mapper_read(run->mapper);

    apply_culling(&run->keys, run->mapper, run->places, run->keeps ? run->count : 0);
    if (result.is_keyframe && append_keyframe(&run->keys, run->count) != CAIRN_OK)
        return CAIRN_NO_MEMORY;
    if (run->keeps &&
        (!reserve_result(run) ||
         !map_copy_result(record, run->mapper, &run->scans[run->count], &run->places[run->count])))
        return CAIRN_NO_MEMORY;
    run->count++;
    return show(run, &result, is_last);
}

cairn_status map_run_add(map_run *run, const cairn_carmen_log_record *record,
                         const cairn_pose *odometry, int32_t is_last, cairn_fault *fault)
{
    cairn_scan_input scan = map_scan_input(run->settings, record);
    cairn_status status =
        cairn_mapper_map(run->mapper, &scan, run->settings->no_odometry ? NULL : odometry, fault);

    if (status != CAIRN_OK)
        return status;
    *fault = (cairn_fault){-1, NULL};
    return keep(run, record, is_last);
}

int map_run_settle(map_run *run)
{
    cairn_status status;

    do {
        cairn_budget budget = {CAIRN_CAPACITY_SETTLE_UNITS};

        status = cairn_mapper_settle(run->mapper, &budget);
        apply_culling(&run->keys, run->mapper, run->places, run->keeps ? run->count : 0);
        if (run->player != NULL && (status == CAIRN_OK || status == CAIRN_MORE) &&
            add_loop_closures(run->player, run->mapper, &run->keys, &run->shown) != CAIRN_OK)
            status = CAIRN_NO_MEMORY;
    } while (status == CAIRN_MORE);
    if (status == CAIRN_OK && run->player != NULL)
        status = add_frame(run->player, run->mapper, &run->keys, run->places, run->count);
    if (status == CAIRN_OK)
        return TOOL_OK;
    (void)options_refuse(MAP_PROGRAM, "%s: %s", run->settings->log, cairn_status_text(status));
    return tool_exit_code(status);
}

/* ---- Files ---- */

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

int map_run_write(map_run *run)
{
    const map_settings *s = run->settings;
    cairn_file_error error;
    map_output output;
    cairn_pose_graph_file graph;
    int code = TOOL_OK;
    char title[256], subtitle[256];

    if (!graph_of(run->mapper, &graph)) {
        (void)options_refuse(MAP_PROGRAM, "no memory for the graph");
        return TOOL_FAILED;
    }
    if (cairn_placed_scans_place(run->scans, run->places, run->count, run->mapper) != CAIRN_OK) {
        free(graph.vertex);
        free(graph.edge);
        (void)options_refuse(MAP_PROGRAM, "no memory for the poses");
        return TOOL_FAILED;
    }
    snprintf(title, sizeof title, "%s, mapped", cairn_output_path_name(s->log));
    snprintf(subtitle, sizeof subtitle, "%" PRId32 " scans, %" PRId32 " keyframes%s", run->count,
             cairn_mapper_measure(run->mapper).keyframes,
             s->no_odometry ? ", without odometry" : "");
    output = map_output_of(s, run->scans, run->count);
    output.title = title;
    output.subtitle = subtitle;
    output.player = run->player;
    output.graph = s->no_loops ? NULL : &graph;
    if (map_output_write(&output, s->folder, &error) != CAIRN_OK)
        code = tool_report(&error);
    free(graph.vertex);
    free(graph.edge);
    return code;
}

/* The player for --report; NULL without it. */
static cairn_status open_player(const map_settings *s, int32_t scans, cairn_report_player **player)
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
    snprintf(subtitle, sizeof subtitle, "%" PRId32 " scans%s", scans,
             s->no_odometry ? ", without odometry" : "");
    params.title = title;
    params.subtitle = subtitle;
    params.step_name = "scan";
    params.connect = 1;
    params.curve = curves;
    params.curve_count = (int32_t)(sizeof curves / sizeof *curves) - (s->window == 0);
    return cairn_report_player_open(player, &params);
}

cairn_mapper_params map_params(const map_settings *s, int32_t scans, int32_t beams, int32_t points)
{
    cairn_capacity_mapping mapping = {s->max_keyframes, s->cull_keyframes, (int32_t)s->window,
                                      s->no_loops};
    cairn_mapper_params params = cairn_capacity_mapper(&mapping, scans, beams, points);

    params.odometry_sigma = (cairn_real)s->odometry_sigma;
    return params;
}

int map_check_params(const map_settings *s, const cairn_mapper_params *params)
{
    if (params->cull_keyframes && cairn_mapper_memory(params) == 0)
        return options_refuse(MAP_PROGRAM,
                              "--max-keys is '%" PRId64 "', expected more with --release",
                              s->max_keyframes);
    return TOOL_OK;
}

int map_run_open(map_run *run, const map_settings *s, const cairn_mapper_params *params,
                 int32_t scans)
{
    cairn_status status;
    int code;

    memset(run, 0, sizeof *run);
    run->settings = s;
    run->keeps = s->folder != NULL;
    code = tool_pool_open(&run->pool, MAP_PROGRAM, s->pool, cairn_mapper_memory(params));
    if (code != TOOL_OK)
        return code;
    status = cairn_mapper_create(&run->mapper, &run->pool, params);
    if (status == CAIRN_OK)
        status = open_player(s, scans, &run->player);
    if (status == CAIRN_OK)
        return TOOL_OK;
    map_run_close(run);
    (void)options_refuse(MAP_PROGRAM, "%s: %s", s->log, cairn_status_text(status));
    return tool_exit_code(status);
}

void map_run_close(map_run *run)
{
    cairn_report_player_free(run->player);
    cairn_placed_scans_free(run->scans, run->capacity);
    free(run->places);
    free(run->keys.scan);
    free(run->keys.number);
    tool_pool_close(&run->pool);
    memset(run, 0, sizeof *run);
}
