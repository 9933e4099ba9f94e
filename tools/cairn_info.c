/* cairn info: summary of a CARMEN log. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#include "cairn/number_text.h"
#include "tools/cairn_tool.h"

#define DEGREES (180 / 3.14159265358979323846)

/* Statistics of the beams of all scans. */
typedef struct beam_counts {
    int64_t returns, no_returns, unknown;
    double farthest;             /* m */
    float angle_min, angle_last; /* rad, of the first scan */
    float range_max;             /* m, the largest limit of any scan */
} beam_counts;

static void count_beams(beam_counts *counts, const cairn_carmen_log_record *record, int first)
{
    if (first) {
        counts->angle_min = record->scan.angle_min;
        counts->angle_last =
            record->scan.angle_min + (float)(record->count - 1) * record->scan.angle_step;
    }
    counts->range_max = fmaxf(counts->range_max, record->scan.range_max);
    for (int32_t i = 0; i < record->count; i++) {
        float range = record->range[i];

        if (isinf(range)) {
            counts->no_returns++;
        } else if (range > 0) {
            counts->returns++;
            counts->farthest = fmax(counts->farthest, (double)range);
        } else {
            counts->unknown++;
        }
    }
}

static int read_beams(cairn_carmen_log *log, beam_counts *counts, int32_t quiet)
{
    tool_progress progress =
        tool_progress_begin("reading", cairn_carmen_log_info(log).scans, quiet);
    cairn_carmen_log_record record;
    cairn_file_error error;
    cairn_status status;
    int64_t scans = 0;

    while ((status = cairn_carmen_log_next(log, &record, &error)) == CAIRN_OK) {
        if (record.kind != CAIRN_CARMEN_LOG_SCAN)
            continue;
        count_beams(counts, &record, scans == 0);
        tool_progress_at(&progress, ++scans);
    }
    tool_progress_end(&progress);
    return status == CAIRN_EMPTY ? TOOL_OK : tool_report(&error);
}

/* Returns x, or 0 when x would print as -0. */
static double without_negative_zero(double x)
{
    return fabs(x) < 5e-4 ? 0 : x;
}

static double percent(int64_t part, int64_t whole)
{
    return whole > 0 ? 100.0 * (double)part / (double)whole : 0;
}

static void print_range(const char *label, int64_t least, int64_t most, const char *unit)
{
    if (least == most)
        printf("%-12s %" PRId64 " %s\n", label, least, unit);
    else
        printf("%-12s %" PRId64 " to %" PRId64 " %s\n", label, least, most, unit);
}

static void print_text(const char *path, const cairn_carmen_log_summary *info,
                       const beam_counts *beams)
{
    char first[CAIRN_NUMBER_TEXT_BYTES], last[CAIRN_NUMBER_TEXT_BYTES];
    double seconds = (double)cairn_time_difference(info->latest_ns, info->earliest_ns) * 1e-9;

    printf("%-12s %s\n", "log", path);
    printf("%-12s %" PRId64 " in %" PRId64 " lines\n", "scans", info->scans, info->lines);
    print_range("beams", info->min_beams, info->max_beams, "a scan");
    printf("%-12s %.2f to %.2f degrees in the first scan\n", "bearings",
           (double)beams->angle_min * DEGREES, (double)beams->angle_last * DEGREES);
    printf("%-12s up to %.2f m; no return from %.2f m on\n", "ranges", beams->farthest,
           (double)beams->range_max);
    printf("%-12s %.1f %% returns, %.1f %% without return, %.1f %% unknown\n", "of beams",
           percent(beams->returns, info->beams), percent(beams->no_returns, info->beams),
           percent(beams->unknown, info->beams));
    printf("%-12s %s to %s, %.1f s", "time", cairn_number_write_stamp(first, info->first_ns),
           cairn_number_write_stamp(last, info->last_ns), seconds);
    if (seconds > 0 && info->scans > 1)
        printf(", %.2f scans/s", (double)(info->scans - 1) / seconds);
    printf("\n");
    if (info->backward_stamps > 0)
        printf("%-12s %" PRId64 " scans are stamped earlier than the one before\n", "",
               info->backward_stamps);
    printf("%-12s %.1f m, %.0f degrees of turning, from the scans' odometry\n", "path",
           info->odometry_length, info->odometry_turn * DEGREES);
    if (info->fixed_mounting)
        printf("%-12s %.3f m, %.3f m, %.2f degrees on the robot\n", "sensor",
               without_negative_zero((double)info->base_sensor.x),
               without_negative_zero((double)info->base_sensor.y),
               without_negative_zero((double)info->base_sensor.theta * DEGREES));
    else
        printf("%-12s no fixed mounting on the robot\n", "sensor");
    printf("%-12s %" PRId64 " odometry lines, %" PRId64 " of other kinds, %" PRId64 " damaged\n",
           "messages", info->odometry, info->ignored, info->faults);
}

int tool_info(int argc, char **argv)
{
    cairn_carmen_log_params params = cairn_carmen_log_default();
    tool_faults faults = {0, 0};
    int32_t quiet = 0;
    const option table[] = {
        OPTION_NUMBER("--range-max", &params.range_max, 1e-3, 1e5, "M",
                      "ranges from this value on count as no return, m (found in the log)"),
        OPTION_FLAG("--quiet", &quiet, "no progress bar, no warnings"),
    };
    const option_set set = {"cairn info", "LOG [options]",
                            "Summarizes a CARMEN log (plain or gzipped): scans, beams, time, path, "
                            "the sensor's mounting, and\n"
                            "which lines are damaged.",
                            table, sizeof table / sizeof *table};
    const char *words[1] = {NULL};
    size_t word_count = 1;
    beam_counts beams = {0, 0, 0, 0, 0, 0, 0};
    cairn_carmen_log *log;
    cairn_carmen_log_summary info;
    cairn_file_error error;
    option_result result;
    int code;

    result = options_read(&set, argc, argv, words, &word_count);
    if (result != OPTIONS_READ)
        return result;
    if (word_count < 1)
        return options_refuse("cairn info", "no log, expected %s", set.synopsis);
    faults.quiet = quiet;
    params.on_fault = tool_on_fault;
    params.context = &faults;
    if (cairn_carmen_log_open(&log, words[0], &params, &error) != CAIRN_OK) {
        tool_faults_end(&faults);
        return tool_report(&error);
    }
    tool_faults_end(&faults);
    info = cairn_carmen_log_info(log);
    code = read_beams(log, &beams, quiet);
    cairn_carmen_log_close(log);
    if (code == TOOL_OK)
        print_text(words[0], &info, &beams);
    return code;
}
