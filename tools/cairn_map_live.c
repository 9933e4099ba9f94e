/* cairn map -: online SLAM on a stream, while it comes.
 *
 * Method: each scan is mapped as soon as its line has come, and its pose printed (--live). The
 * files are rewritten every N seconds (--watch), and written at the end of the stream. SIGINT
 * ends the stream: it puts the null device in the place of standard input, so that neither a read that
 * waits nor a later one blocks. A second SIGINT ends the program.
 *
 * Limits: the beams of a scan are at most four times those of the first one, or 2048; keyframes
 * have 640 points on average. Without -o no scan is kept. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/base/posix.h"
#include "tools/cairn_map_work.h"
#include "tools/cairn_tool.h"

/* Points of a keyframe, on average, for which there is memory. */
enum { KEYFRAME_POINTS = 640, LEAST_BEAMS = 2048 };

/* The null device, for the handler. */
static int null_file = -1;

static void on_interrupt(int number)
{
    (void)number;
    (void)dup2(null_file, STDIN_FILENO);
}

/* Lets SIGINT end the stream; 0 when the system refuses. */
static int catch_interrupt(void)
{
    null_file = open(NULL_DEVICE, O_RDONLY | O_CLOEXEC);
    return null_file >= 0 && cairn_on_interrupt(on_interrupt);
}

/* Prints the pose of the scan that was mapped last, and flushes. */
static void print_pose(const map_run *run, const cairn_carmen_log_record *record)
{
    cairn_mapper_result result = cairn_mapper_read(run->mapper);
    cairn_json_writer json = cairn_json_write_begin(stdout);

    json.compact = 1;
    map_write_pose(&json, run->count - 1, record->stamp_ns, result.map_scan,
                   result.verdict == CAIRN_MAPPER_MATCHED ? result.covariance : NULL,
                   cairn_placed_scan_verdict(result.verdict));
    cairn_json_write_end(&json);
    (void)fflush(stdout);
}

/* Begins the run with the first scan. */
static int begin(map_run *run, const map_settings *s, const cairn_carmen_log_record *record)
{
    int32_t beams = 4 * record->count > LEAST_BEAMS ? 4 * record->count : LEAST_BEAMS;
    cairn_mapper_params params = map_params(
        s, INT32_MAX, beams < CAIRN_CARMEN_LOG_MAX_BEAMS ? beams : CAIRN_CARMEN_LOG_MAX_BEAMS,
        KEYFRAME_POINTS);
    int code = map_check_params(s, &params);

    return code == TOOL_OK ? map_run_open(run, s, &params, 0) : code;
}

/* Reports a scan that the mapper refused; the exit code. */
static int refuse(const map_run *run, const cairn_carmen_log_record *record, cairn_status status,
                  const cairn_fault *fault)
{
    if (status == CAIRN_FULL && fault->message == NULL)
        return map_refuse_keys(run->settings, (int32_t)run->settings->max_keyframes);
    return tool_report_scan("-", record->line, status, fault);
}

/* Maps one scan. */
static int map_scan_of(map_run *run, const cairn_carmen_log_record *record, int32_t has_odometry,
                       double *written)
{
    const map_settings *s = run->settings;
    cairn_fault fault = {-1, NULL};
    cairn_status status = map_run_add(run, record, has_odometry ? &record->robot : NULL, 0, &fault);

    if (status != CAIRN_OK)
        return refuse(run, record, status, &fault);
    if (s->live)
        print_pose(run, record);
    if (!(s->watch > 0) || tool_seconds() - *written < s->watch)
        return TOOL_OK;
    *written = tool_seconds();
    return map_run_write(run);
}

/* Ends the run: decides what is pending, writes, prints the summary. */
static int finish(map_run *run, int64_t faults, double seconds)
{
    const map_settings *s = run->settings;
    int code = map_run_settle(run);

    if (code == TOOL_OK && s->folder != NULL)
        code = map_run_write(run);
    if (code == TOOL_OK)
        map_run_print(run, faults, 0, seconds, seconds);
    return code;
}

/* Scans of the stream with a corrected scanner. */
typedef struct corrector {
    cairn_scan_correction correction;
    float *beam; /* [2 capacity] ranges and bearings of the last scan */
    int32_t capacity;
} corrector;

/* Corrects a scan, whose arrays are valid until the next one. TOOL_OK; or TOOL_FAILED after a line on
 * standard error. */
static int correct(corrector *by, cairn_carmen_log_record *record)
{
    if (cairn_scan_correction_is_none(&by->correction))
        return TOOL_OK;
    if (record->count > by->capacity) {
        free(by->beam);
        by->capacity = record->count;
        by->beam = malloc(2 * (size_t)by->capacity * sizeof *by->beam);
    }
    if (by->beam == NULL) {
        (void)options_refuse(MAP_PROGRAM, "-: no memory for a scan of %d beams",
                             (int)record->count);
        return TOOL_FAILED;
    }
    cairn_scan_correction_apply(&by->correction, &record->scan, by->beam, by->beam + record->count);
    record->range = record->scan.range;
    return TOOL_OK;
}

/* Maps all scans of the stream. */
static int map_stream(const map_settings *s, corrector *by, cairn_scan_log_stream *stream)
{
    double start = tool_seconds(), written = start;
    cairn_carmen_log_record record;
    cairn_file_error error;
    map_run run;
    int32_t is_open = 0, has_odometry, has_origin = 0;
    int code = TOOL_OK;

    while (code == TOOL_OK) {
        cairn_status status = cairn_scan_log_stream_next(stream, &record, &has_odometry, &error);

        if (status == CAIRN_EMPTY)
            break;
        if (status != CAIRN_OK)
            code = tool_report(&error);
        if (code == TOOL_OK && has_odometry && !has_origin && !s->quiet) {
            double origin[2];

            cairn_scan_log_stream_origin(stream, origin);
            tool_print_origin("-", origin);
        }
        if (code == TOOL_OK)
            code = correct(by, &record);
        if (code == TOOL_OK && !is_open)
            is_open = (code = begin(&run, s, &record)) == TOOL_OK;
        if (code == TOOL_OK)
            code = map_scan_of(&run, &record, has_odometry, &written);
        has_origin |= code == TOOL_OK && has_odometry;
    }
    if (!is_open)
        return code != TOOL_OK
                   ? code
                   : options_refuse(MAP_PROGRAM, "-: no scan, expected a CARMEN log or a LaserScan "
                                                 "as JSON a line");
    if (code == TOOL_OK)
        code = finish(&run, cairn_scan_log_stream_faults(stream), tool_seconds() - start);
    map_run_close(&run);
    return code;
}

int map_live(map_settings *s)
{
    cairn_scan_log_params params = cairn_scan_log_default();
    tool_faults faults = {0, s->quiet};
    cairn_scan_log_stream *stream;
    corrector by = {.beam = NULL};
    cairn_file_error error;
    int code = tool_correction(&s->scanner, &by.correction);

    if (code != TOOL_OK)
        return code;
    params.range_max = s->range_max;
    params.on_fault = tool_on_fault;
    params.context = &faults;
    if (!catch_interrupt()) {
        (void)options_refuse(MAP_PROGRAM, "-: cannot catch SIGINT");
        return TOOL_FAILED;
    }
    if (cairn_scan_log_stream_open(&stream, STDIN_FILENO, "-", &params, &error) != CAIRN_OK)
        return tool_report(&error);
    code = map_stream(s, &by, stream);
    free(by.beam);
    tool_faults_end(&faults);
    cairn_scan_log_stream_close(stream);
    (void)close(null_file);
    return code;
}
