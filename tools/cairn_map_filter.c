/* cairn map --filter N: SLAM by a Rao-Blackwellized particle filter (filter_mapper). */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/filter_mapper.h"
#include "cairn/output.h"
#include "tools/cairn_map_work.h"
#include "tools/cairn_player.h"
#include "tools/cairn_tool.h"

/* State of a run. */
typedef struct filter_run {
    const map_settings *settings;
    const map_input *input;
    cairn_filter_mapper *mapper;
    cairn_pool pool;
    cairn_report_player *player;
    cairn_pose *path; /* [max_keys] path of the particle of largest weight */
    int32_t max_keys;
} filter_run;

/* Copies the path of the particle of largest weight; returns its number of keyframes. */
static int32_t read_best(filter_run *run)
{
    return cairn_filter_mapper_path(run->mapper, cairn_filter_mapper_best(run->mapper), run->path,
                                    run->max_keys);
}

/* Adds a frame of the player: the path of the best particle after scan `index` of the log. The best
 * particle may have changed. */
static cairn_status add_frame(filter_run *run, int32_t index)
{
    cairn_mapper_result result = cairn_mapper_read(cairn_filter_mapper_front(run->mapper));
    cairn_filter_mapper_state state = cairn_filter_mapper_measure(run->mapper);
    double value[2] = {result.verdict == CAIRN_MAPPER_FIRST ? (double)NAN : (double)result.overlap,
                       state.keyframes > 1 ? (double)state.n_eff : (double)NAN};
    cairn_report_frame frame;
    char label[64];

    memset(&frame, 0, sizeof frame);
    snprintf(label, sizeof label, "%" PRId32 " keyframe%s", state.keyframes,
             state.keyframes == 1 ? "" : "s");
    frame.step = index;
    frame.label = label;
    frame.pose = run->path;
    frame.pose_count = read_best(run);
    frame.value = value;
    return cairn_report_player_add_frame(run->player, &frame);
}

/* Maps one scan and keeps it for drawing. */
static cairn_status map_scan_at(filter_run *run, int32_t index, map_scan *scan,
                                cairn_scan_place *place, cairn_fault *fault)
{
    const map_settings *s = run->settings;
    const cairn_mapper *front = cairn_filter_mapper_front(run->mapper);
    cairn_scan_input input = map_scan_input(s, &run->input->record[index]);
    cairn_status status = cairn_filter_mapper_map(
        run->mapper, &input, s->no_odometry ? NULL : map_input_odometry(run->input, index), fault);

    if (status == CAIRN_OK && !map_copy_result(&run->input->record[index], front, scan, place))
        status = CAIRN_NO_MEMORY;
    if (status == CAIRN_OK && run->player != NULL && cairn_mapper_read(front).is_keyframe) {
        status = player_add_scan(run->player, scan, index);
        if (status == CAIRN_OK)
            status = add_frame(run, index);
    }
    return status;
}

static int feed(filter_run *run, map_scan *scans, cairn_scan_place *places, int32_t *full)
{
    const map_input *input = run->input;
    tool_progress progress = tool_progress_begin("map", input->count, run->settings->quiet);
    cairn_fault fault = {-1, NULL};
    cairn_status status = CAIRN_OK;
    int32_t i;

    for (i = 0; i < input->count; i++) {
        status = map_scan_at(run, i, &scans[i], &places[i], &fault);
        if (status != CAIRN_OK)
            break;
        tool_progress_at(&progress, i);
    }
    tool_progress_end(&progress);
    *full = status == CAIRN_FULL;
    if (status == CAIRN_OK)
        return TOOL_OK;
    if (!*full)
        return tool_report_scan(map_input_log(input, i)->path, input->record[i].line, status,
                                &fault);
    if (cairn_mapper_measure(cairn_filter_mapper_front(run->mapper)).keyframes < run->max_keys)
        return TOOL_BAD;
    *full = 0;
    return map_refuse_keys(run->settings, run->max_keys);
}

/* The player for --report; NULL without it. */
static cairn_status open_player(filter_run *run)
{
    static const cairn_report_curve curves[] = {
        {"support", "", "fraction of the scan's points with a correspondence"},
        {"N_eff", "", "effective sample size before resampling"},
    };
    cairn_report_player_params params = cairn_report_player_default();
    char title[256], subtitle[256];

    if (run->settings->report == NULL)
        return CAIRN_OK;
    snprintf(title, sizeof title, "%s, mapped", cairn_output_path_name(run->settings->log));
    snprintf(subtitle, sizeof subtitle, "%" PRId32 " scans, the best of %" PRId64 " particles",
             run->input->count, run->settings->particles);
    params.title = title;
    params.subtitle = subtitle;
    params.step_name = "scan";
    params.connect = 1;
    params.curve = curves;
    params.curve_count = (int32_t)(sizeof curves / sizeof *curves);
    return cairn_report_player_open(&run->player, &params);
}

static int write_all(filter_run *run, map_scan *scans, const cairn_scan_place *places)
{
    int32_t count = run->input->count, keys = read_best(run);
    map_output output = map_output_of(run->settings, scans, count);
    char title[256], subtitle[256];
    cairn_file_error error;

    for (int32_t i = 0; i < count; i++)
        scans[i].after = cairn_pose_compose(run->path[places[i].keyframe], places[i].keyframe_scan);
    snprintf(title, sizeof title, "%s, mapped", cairn_output_path_name(run->settings->log));
    snprintf(subtitle, sizeof subtitle,
             "%" PRId32 " scans, %" PRId32 " keyframes, the best of %" PRId64 " particles", count,
             keys, run->settings->particles);
    output.title = title;
    output.subtitle = subtitle;
    output.player = run->player;
    return map_output_write(&output, run->settings->folder, &error) == CAIRN_OK
               ? TOOL_OK
               : tool_report(&error);
}

static void print_summary(const filter_run *run, double seconds, double seconds_to_map)
{
    cairn_mapper_state front = cairn_mapper_measure(cairn_filter_mapper_front(run->mapper));
    cairn_filter_mapper_state state = cairn_filter_mapper_measure(run->mapper);

    printf("scans      %" PRId32 " (%" PRId64 " damaged lines left out%s)\n"
           "seconds    %.3f, %.0f scans/s\n"
           "pool       %zu bytes at most\n"
           "keyframes  %" PRId32 "\n"
           "particles  %" PRId32 ", resampled %" PRId32 " times\n"
           "nodes      %" PRId32 " in all paths together, %" PRId32 " at most\n"
           "unmatched  %" PRId64 " (pose by prediction)\n",
           run->input->count, run->input->faults,
           run->input->stamps_back > 0 ? ", some times run back" : "", seconds,
           run->input->count / seconds_to_map, run->pool.peak, state.keyframes,
           cairn_filter_mapper_count(run->mapper), state.resamplings, state.nodes, state.nodes_peak,
           front.predicted);
}

static void print_json(const filter_run *run, const map_scan *scans, double seconds,
                       double seconds_to_map)
{
    cairn_mapper_state front = cairn_mapper_measure(cairn_filter_mapper_front(run->mapper));
    cairn_filter_mapper_state state = cairn_filter_mapper_measure(run->mapper);
    cairn_json_writer json = cairn_json_write_begin(stdout);

    cairn_json_write_text(&json, "method", "filter");
    map_write_common(&json, run->settings, run->input->count, run->input->faults,
                     run->input->stamps_back > 0, seconds, seconds_to_map, run->pool.peak);
    cairn_json_write_integer(&json, "keyframes", state.keyframes);
    cairn_json_write_integer(&json, "unmatched", front.predicted);
    cairn_json_write_integer(&json, "particles", cairn_filter_mapper_count(run->mapper));
    cairn_json_write_integer(&json, "resamplings", state.resamplings);
    if (run->settings->shape_prior)
        cairn_json_write_integer(&json, "shape_starts", state.shape_starts);
    cairn_json_write_integer(&json, "nodes", state.nodes);
    cairn_json_write_integer(&json, "nodes_most", state.nodes_peak);
    map_write_poses(&json, scans, run->input->count);
    cairn_json_write_end(&json);
}

int map_by_filter(const map_settings *s, const map_input *input, const cairn_mapper_params *front,
                  int32_t *full)
{
    cairn_filter_mapper_params params = cairn_filter_mapper_default();
    filter_run run = {s, input, NULL, {0}, NULL, NULL, front->max_keyframes};
    double start = tool_seconds(), fed;
    cairn_scan_place *places;
    map_scan *scans;
    cairn_status status;
    int code;

    *full = 0;
    params.front = *front;
    params.particles = (int32_t)s->particles;
    params.seed = (uint64_t)s->seed;
    params.shape_prior = s->shape_prior;
    code = tool_pool_open(&run.pool, MAP_PROGRAM, s->pool, cairn_filter_mapper_memory(&params));
    if (code != TOOL_OK)
        return code;
    run.path = malloc((size_t)front->max_keyframes * sizeof *run.path);
    scans = cairn_placed_scans_new(input->count);
    places = calloc((size_t)input->count, sizeof *places);
    status = run.path == NULL || scans == NULL || places == NULL
                 ? CAIRN_NO_MEMORY
                 : cairn_filter_mapper_create(&run.mapper, &run.pool, &params);
    if (status == CAIRN_OK)
        status = open_player(&run);
    if (status == CAIRN_OK) {
        code = feed(&run, scans, places, full);
        fed = tool_seconds();
        if (code == TOOL_OK)
            code = write_all(&run, scans, places);
        if (code == TOOL_OK && s->json)
            print_json(&run, scans, tool_seconds() - start, fed - start);
        else if (code == TOOL_OK && !s->quiet)
            print_summary(&run, tool_seconds() - start, fed - start);
    } else {
        (void)options_refuse(MAP_PROGRAM, "%s: %s", s->log, cairn_status_text(status));
        code = tool_exit_code(status);
    }
    cairn_report_player_free(run.player);
    cairn_placed_scans_free(scans, input->count);
    free(places);
    free(run.path);
    tool_pool_close(&run.pool);
    return code;
}
