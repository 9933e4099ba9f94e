/* Functions that all subcommands share. */
#include <inttypes.h>
#include <math.h>
#include <time.h>

#include "cairn/number_text.h"
#include "src/host/base/degrees.h"
#include "src/host/base/posix.h"
#include "tools/cairn_tool.h"

#define MAX_SHOWN_FAULTS 10
#define BAR_CELLS        30
#define BAR_INTERVAL_S   0.1

int tool_exit_code(cairn_status status)
{
    if (status >= 0)
        return TOOL_OK;
    return status == CAIRN_NO_MEMORY || status == CAIRN_BAD_BUILD ? TOOL_FAILED : TOOL_BAD;
}

const tool_command *tool_command_find(const tool_command *commands, size_t count, const char *name)
{
    for (size_t i = 0; i < count; i++)
        if (strcmp(name, commands[i].name) == 0)
            return &commands[i];
    return NULL;
}

void tool_commands_print(const tool_command *commands, size_t count, FILE *stream)
{
    for (size_t i = 0; i < count; i++)
        fprintf(stream, "  %-10s %s\n", commands[i].name, commands[i].summary);
}

void tool_commands_table(const char *program, const char *about, const tool_command *commands,
                         size_t count)
{
    const option_set set = {program, "COMMAND [options] ...", about, NULL, 0};

    options_table(&set);
    for (size_t i = 0; i < count; i++)
        printf("command\t%s\t%s\n", commands[i].name, commands[i].summary);
}

option_result tool_read_options(const option_set *set, int argc, char **argv, const char **log,
                                const char *const *folder)
{
    size_t count = 1;
    option_result result = options_read(set, argc, argv, log, &count);

    if (result != OPTIONS_READ || (count > 0 && *folder != NULL))
        return result;
    (void)options_refuse(set->program, "%s, expected LOG -o DIR",
                         count == 0 ? "no log" : "no folder to write to (-o)");
    return OPTIONS_BAD;
}

cairn_status tool_output_open(cairn_output **output, const char *path, cairn_file_error *error)
{
    char *folder = cairn_output_path_folder(path);
    cairn_status status = CAIRN_OK;

    if (folder == NULL)
        return cairn_file_error_set(error, CAIRN_NO_MEMORY, path, 0, "no memory");
    if (*folder != '\0')
        status = cairn_output_folder(folder, error);
    free(folder);
    return status == CAIRN_OK ? cairn_output_open(output, path, error) : status;
}

cairn_status tool_remove_other_maps(cairn_output_set *set, const char *const *names, int32_t count,
                                    cairn_file_error *error)
{
    static const char *const all[] = {
        "poses.csv",  "poses.tum",  "graph.g2o",       "map.pgm",        "map.yaml",  "map.svg",
        "errors.svg", "stages.svg", "transforms.yaml", "transforms.csv", "places.csv"};
    cairn_status status = CAIRN_OK;

    for (size_t i = 0; i < sizeof all / sizeof *all && status == CAIRN_OK; i++) {
        int is_written = 0;

        for (int32_t k = 0; k < count; k++)
            is_written |= strcmp(all[i], names[k]) == 0;
        if (!is_written)
            status = cairn_output_set_remove(set, all[i], error);
    }
    return status;
}

int tool_report(const cairn_file_error *error)
{
    fprintf(stderr, "%s\n", error->text);
    return tool_exit_code(error->status);
}

int tool_report_scan(const char *path, int64_t line, cairn_status status, const cairn_fault *fault)
{
    const char *what =
        fault != NULL && fault->message != NULL ? fault->message : cairn_status_text(status);

    fprintf(stderr, "%s:%" PRId64 ": the scan cannot be used: %s\n", path, line, what);
    return tool_exit_code(status);
}

static int refuse_json(const char *program)
{
    (void)options_refuse(program, "no memory for the result");
    return TOOL_FAILED;
}

int tool_json_open(tool_json *json, const char *program)
{
    if (!cairn_text_stream_open(&json->text))
        return refuse_json(program);
    json->writer = cairn_json_write_begin(json->text.stream);
    return TOOL_OK;
}

int tool_json_close(tool_json *json, const char *program, int32_t is_wanted, int code)
{
    char *text;

    cairn_json_write_end(&json->writer);
    text = cairn_text_stream_close(&json->text);
    if (text == NULL)
        return code == TOOL_OK ? refuse_json(program) : code;
    if (code == TOOL_OK && is_wanted)
        (void)fputs(text, stdout);
    free(text);
    return code;
}

void tool_json_pose(cairn_json_writer *json, const char *name, cairn_pose pose)
{
    cairn_json_write_object(json, name);
    cairn_json_write_exact(json, "x", pose.x);
    cairn_json_write_exact(json, "y", pose.y);
    cairn_json_write_exact(json, "theta", pose.theta);
    cairn_json_write_object_end(json);
}

double tool_seconds(void)
{
    struct timespec now = {0, 0};

    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

void tool_on_fault(void *context, const cairn_file_error *fault)
{
    tool_faults *faults = context;

    faults->count++;
    if (!faults->quiet && faults->count <= MAX_SHOWN_FAULTS)
        fprintf(stderr, "%s\n", fault->text);
}

void tool_faults_end(const tool_faults *faults)
{
    if (!faults->quiet && faults->count > MAX_SHOWN_FAULTS)
        fprintf(stderr, "... and %" PRId64 " more damaged lines\n",
                faults->count - MAX_SHOWN_FAULTS);
}

void tool_print_origin(const char *path, const double origin[2])
{
    if (origin[0] != 0 || origin[1] != 0)
        fprintf(stderr, "%s: coordinates are taken from %.0f %.0f (m), where the log begins\n",
                path, origin[0], origin[1]);
}

int32_t tool_read_pose(const char *text, double pose[3])
{
    for (int i = 0; i < 3; i++) {
        const char *end = i < 2 ? strchr(text, ',') : text + strlen(text);

        if (end == NULL || !cairn_number_read(text, (size_t)(end - text), &pose[i]) ||
            !(fabs(pose[i]) <= TOOL_POSE_LIMIT))
            return 0;
        text = end + 1;
    }
    return 1;
}

int tool_correction(const tool_scanner *scanner, cairn_scan_correction *correction)
{
    double sensor[3] = {0, 0, 0};

    *correction = cairn_scan_correction_none();
    if (scanner->sensor != NULL && !tool_read_pose(scanner->sensor, sensor))
        return options_refuse("cairn",
                              "--sensor is '%s', expected three numbers X,Y,DEG within 1e5",
                              scanner->sensor);
    if (scanner->range_scale > 0)
        correction->range_scale = (cairn_real)scanner->range_scale;
    correction->angle_step = (cairn_real)(scanner->angle_step * CAIRN_DEGREE);
    correction->sweep = (cairn_real)scanner->sweep;
    correction->flips = scanner->flip;
    correction->has_sensor = scanner->sensor != NULL;
    correction->base_sensor.x = (cairn_real)sensor[0];
    correction->base_sensor.y = (cairn_real)sensor[1];
    correction->base_sensor.theta = (cairn_real)(sensor[2] * CAIRN_DEGREE);
    return TOOL_OK;
}

/* Loads a log as it is. */
static int load(cairn_scan_log *log, const char *path, const tool_log_options *options,
                double range_max)
{
    cairn_scan_log_params params = cairn_scan_log_default();
    tool_faults faults = {0, options->quiet};
    cairn_file_error error;
    cairn_status status;

    if (strcmp(path, "-") == 0) {
        (void)cairn_file_error_set(&error, CAIRN_BAD_ARGUMENT, path, 0,
                                   "standard input is read by cairn map alone, expected a file");
        return tool_report(&error);
    }
    params.range_max = range_max;
    params.scan_topic = options->scan_topic;
    params.odometry_topic = options->odometry_topic;
    params.on_fault = tool_on_fault;
    params.context = &faults;
    status = cairn_scan_log_load(log, path, &params, &error);
    tool_faults_end(&faults);
    return status == CAIRN_OK ? TOOL_OK : tool_report(&error);
}

int tool_load_raw(cairn_scan_log *log, const char *path, const tool_log_options *options)
{
    tool_log_options silent = *options;
    float limit;
    int code;

    silent.quiet = 1;
    code = load(log, path, &silent, options->range_max);
    if (code != TOOL_OK)
        return code;
    limit = log->scans.record[0].scan.range_max;
    cairn_scan_log_free(log);
    code = load(log, path, &silent, (double)CAIRN_SCAN_EXTENT);
    for (int32_t i = 0; code == TOOL_OK && i < log->scans.count; i++)
        log->scans.record[i].scan.range_max = limit;
    return code;
}

/* Loads a log whose ranges are to be scaled. Its limit is known after it was read once, and is given
 * in m or in the unit of the ranges. */
static int load_scaled(cairn_scan_log *log, const char *path, const tool_log_options *options,
                       cairn_scan_correction *correction)
{
    tool_log_options own = *options;
    double quartile[3];
    int code;

    own.range_max = 0;
    code = tool_load_raw(log, path, &own);
    if (code != TOOL_OK)
        return code;
    if (cairn_scan_log_quartiles(log, quartile) != CAIRN_OK) {
        cairn_scan_log_free(log);
        (void)options_refuse("cairn", "%s: no memory for the ranges", path);
        return TOOL_FAILED;
    }
    correction->range_max =
        options->range_max > 0
            ? (cairn_real)options->range_max
            : cairn_scan_correction_limit((cairn_real)log->scans.record[0].scan.range_max,
                                          (cairn_real)quartile[1], correction->range_scale);
    return TOOL_OK;
}

int tool_load(cairn_scan_log *log, const char *path, const tool_log_options *options)
{
    cairn_scan_correction correction;
    int code = tool_correction(&options->scanner, &correction);

    if (code == TOOL_OK)
        code = correction.range_scale == 1 ? load(log, path, options, options->range_max)
                                           : load_scaled(log, path, options, &correction);
    if (code != TOOL_OK)
        return code;
    if (cairn_scan_log_correct(log, &correction) != CAIRN_OK) {
        cairn_scan_log_free(log);
        (void)options_refuse("cairn", "%s: no memory for the corrected scans", path);
        return TOOL_FAILED;
    }
    if (!options->quiet)
        tool_print_origin(path, log->scans.info.origin);
    if (!options->quiet && !options->prints_taken && log->taken[0] != 0)
        fprintf(stderr, "%s: %s\n", path, log->taken);
    return TOOL_OK;
}

int tool_load_with_poses(cairn_scan_log *log, const char *program, const char *path,
                         const tool_log_options *options)
{
    int code = tool_load(log, path, options);

    if (code != TOOL_OK || log->has_odometry)
        return code;
    cairn_scan_log_free(log);
    return options_refuse(program, "%s has no odometry, expected poses of its scans", path);
}

tool_progress tool_progress_begin(const char *label, int64_t total, int32_t quiet)
{
    tool_progress progress = {label, total, 0, !quiet && isatty(STDERR_FILENO), tool_seconds()};

    return progress;
}

void tool_progress_at(tool_progress *progress, int64_t done)
{
    char bar[BAR_CELLS + 1];
    double now;
    int cells;

    if (!progress->live || progress->total <= 0)
        return;
    now = tool_seconds();
    if (now - progress->drawn < BAR_INTERVAL_S)
        return;
    progress->drawn = now;
    progress->shown = 1;
    done = done < progress->total ? done : progress->total;
    cells = (int)(BAR_CELLS * done / progress->total);
    memset(bar, '.', BAR_CELLS);
    memset(bar, '#', (size_t)cells);
    bar[BAR_CELLS] = '\0';
    fprintf(stderr, "\r%s [%s] %3d %%", progress->label, bar, (int)(100 * done / progress->total));
    fflush(stderr);
}

void tool_progress_end(tool_progress *progress)
{
    if (progress->shown)
        fprintf(stderr, "\r\033[K");
    progress->shown = 0;
    progress->live = 0;
}

int32_t tool_read_bytes(const char *text, size_t *bytes)
{
    static const char units[] = "KMG";
    size_t length = strlen(text);
    const char *unit = length > 0 ? strchr(units, text[length - 1]) : NULL;
    int shift = unit != NULL ? 10 * (int)(unit - units + 1) : 0;
    int64_t value;

    if (!cairn_number_read_integer(text, length - (unit != NULL), &value) || value < 1 ||
        (uint64_t)value > (uint64_t)(SIZE_MAX / 2) >> shift)
        return 0;
    *bytes = (size_t)value << shift;
    return 1;
}

int tool_pool_open(cairn_pool *pool, const char *program, const char *pool_size, size_t need)
{
    size_t bytes = need;
    void *memory;
    cairn_status status;

    if (pool_size != NULL && !tool_read_bytes(pool_size, &bytes))
        return options_refuse(program,
                              "--pool is '%s', expected a number of bytes such as 65536, 64K or 2M",
                              pool_size);
    bytes = bytes / CAIRN_ALIGN * CAIRN_ALIGN;
    if (bytes < need)
        return options_refuse(program, "--pool is '%s', expected at least %zu bytes", pool_size,
                              need);
    bytes = bytes > 0 ? bytes : CAIRN_ALIGN;
    memory = aligned_alloc(CAIRN_ALIGN, bytes);
    if (memory == NULL) {
        (void)options_refuse(program, "no memory for a pool of %zu bytes", bytes);
        return TOOL_FAILED;
    }
    status = cairn_pool_init(pool, memory, bytes);
    if (status != CAIRN_OK) {
        free(memory);
        (void)options_refuse(program, "%s", cairn_status_text(status));
        return tool_exit_code(status);
    }
    return TOOL_OK;
}

void tool_pool_close(cairn_pool *pool)
{
    free(pool->base);
    memset(pool, 0, sizeof *pool);
}
