/* Functions that all subcommands share. */
#include <inttypes.h>
#include <time.h>

#include "cairn/number_text.h"
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

int tool_load(cairn_scan_log *log, const char *path, const tool_log_options *options)
{
    cairn_scan_log_params params = cairn_scan_log_default();
    tool_faults faults = {0, options->quiet};
    cairn_file_error error;
    cairn_status status;

    params.range_max = options->range_max;
    params.scan_topic = options->scan_topic;
    params.odometry_topic = options->odometry_topic;
    params.on_fault = tool_on_fault;
    params.context = &faults;
    status = cairn_scan_log_load(log, path, &params, &error);
    tool_faults_end(&faults);
    if (status != CAIRN_OK)
        return tool_report(&error);
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
