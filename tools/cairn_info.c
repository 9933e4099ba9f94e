/* cairn info: summary of a log of any format. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#include "cairn/number_text.h"
#include "cairn/scan_correction.h"
#include "src/host/base/degrees.h"
#include "src/host/logs/scan_table.h"
#include "tools/cairn_info_check.h"
#include "tools/cairn_tool.h"

/* Statistics of the beams of all scans. */
typedef struct beam_counts {
    int64_t returns, no_returns, unknown;
    double farthest;             /* m */
    float angle_min, angle_last; /* rad, of the first scan */
    float range_max;             /* m, the largest limit of any scan */
} beam_counts;

static void count_beams(beam_counts *counts, const cairn_carmen_log_record *record)
{
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

static beam_counts count_all(const cairn_carmen_log_scans *scans)
{
    const cairn_scan_input *first = &scans->record[0].scan;
    beam_counts counts = {.angle_min = cairn_scan_correction_bearing(first, 0),
                          .angle_last = cairn_scan_correction_bearing(first, first->count - 1)};

    for (int32_t i = 0; i < scans->count; i++)
        count_beams(&counts, &scans->record[i]);
    return counts;
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

static void print_text(const char *path, const cairn_scan_log *log, const beam_counts *beams)
{
    const cairn_carmen_log_summary *info = &log->scans.info;
    const char *unit = log->kind == CAIRN_SCAN_LOG_BAG   ? "messages"
                       : log->kind == CAIRN_SCAN_LOG_CSM ? "objects"
                                                         : "lines";
    char first[CAIRN_NUMBER_TEXT_BYTES], last[CAIRN_NUMBER_TEXT_BYTES];
    double seconds = (double)cairn_time_difference(info->latest_ns, info->earliest_ns) * 1e-9;

    printf("%-12s %s\n", "log", path);
    if (log->taken[0] != 0)
        printf("%-12s %s\n", "taken", log->taken);
    printf("%-12s %" PRId64 " in %" PRId64 " %s\n", "scans", info->scans, info->lines, unit);
    print_range("beams", info->min_beams, info->max_beams, "a scan");
    printf("%-12s %.2f to %.2f degrees in the first scan\n", "bearings",
           (double)beams->angle_min * CAIRN_DEGREES_PER_RADIAN,
           (double)beams->angle_last * CAIRN_DEGREES_PER_RADIAN);
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
           info->odometry_length, info->odometry_turn * CAIRN_DEGREES_PER_RADIAN);
    if (info->fixed_mounting)
        printf("%-12s %.3f m, %.3f m, %.2f degrees on the robot\n", "sensor",
               without_negative_zero((double)info->base_sensor.x),
               without_negative_zero((double)info->base_sensor.y),
               without_negative_zero((double)info->base_sensor.theta * CAIRN_DEGREES_PER_RADIAN));
    else
        printf("%-12s no fixed mounting on the robot\n", "sensor");
    printf("%-12s %" PRId64 " odometry %s, %" PRId64 " of other kinds, %" PRId64 " damaged\n",
           "messages", info->odometry, unit, info->ignored, info->faults);
}

/* Names of the kinds of logs in the JSON object. */
static const char *kind_name(cairn_scan_log_kind kind)
{
    static const char *const names[] = {"carmen", "csv", "urg", "csm", "bag"};

    return names[kind];
}

/* Writes what was read of a topic. frame: of its messages; NULL: not written. */
static void write_topic(cairn_json_writer *json, const char *name,
                        const cairn_scan_log_topic *topic, const char *frame)
{
    cairn_json_write_object(json, name);
    cairn_json_write_text(json, "topic", topic->name);
    cairn_json_write_text(json, "type", topic->type);
    if (frame != NULL)
        cairn_json_write_text(json, "frame", frame);
    cairn_json_write_integer(json, "messages", topic->messages);
    cairn_json_write_integer(json, "used", topic->used);
    cairn_json_write_object_end(json);
}

/* Writes what was taken of a bag. sources: NULL: no bag. */
static void write_sources(cairn_json_writer *json, const cairn_scan_log_sources *sources)
{
    if (sources == NULL) {
        cairn_json_write_null(json, "sources");
        return;
    }
    cairn_json_write_object(json, "sources");
    write_topic(json, "scans", &sources->topics[sources->scans], sources->sensor_frame);
    if (sources->odometry >= 0)
        write_topic(json, "odometry", &sources->topics[sources->odometry], sources->odometry_frame);
    else
        cairn_json_write_null(json, "odometry");
    cairn_json_write_object(json, "mounting");
    cairn_json_write_text(json, "topic",
                          sources->mounting >= 0 ? sources->topics[sources->mounting].name : NULL);
    cairn_json_write_text(json, "base_frame", sources->base_frame);
    cairn_json_write_text(json, "sensor_frame", sources->sensor_frame);
    cairn_json_write_boolean(json, "known", sources->is_mounted);
    cairn_json_write_boolean(json, "upside_down", sources->upside_down);
    cairn_json_write_boolean(json, "moves", sources->moves);
    cairn_json_write_number(json, "tilt_deg", sources->tilt * CAIRN_DEGREES_PER_RADIAN);
    cairn_json_write_object_end(json);
    cairn_json_write_array(json, "topics");
    for (int32_t i = 0; i < sources->topic_count; i++)
        write_topic(json, NULL, &sources->topics[i], NULL);
    cairn_json_write_array_end(json);
    cairn_json_write_object_end(json);
}

static void print_json(const char *path, const cairn_scan_log *log, const beam_counts *beams,
                       const cairn_scanner_check_result *check)
{
    const cairn_carmen_log_summary *info = &log->scans.info;
    double seconds = (double)cairn_time_difference(info->latest_ns, info->earliest_ns) * 1e-9;
    cairn_json_writer json = cairn_json_write_begin(stdout);

    cairn_json_write_text(&json, "log", path);
    cairn_json_write_text(&json, "kind", kind_name(log->kind));
    cairn_json_write_text(&json, "taken", log->taken[0] != 0 ? log->taken : NULL);
    write_sources(&json, log->sources);
    cairn_json_write_integer(&json, "scans", info->scans);
    cairn_json_write_integer(&json, "messages", info->lines);
    cairn_json_write_integer(&json, "min_beams", info->min_beams);
    cairn_json_write_integer(&json, "max_beams", info->max_beams);
    cairn_json_write_number(&json, "first_bearing_deg",
                            (double)beams->angle_min * CAIRN_DEGREES_PER_RADIAN);
    cairn_json_write_number(&json, "last_bearing_deg",
                            (double)beams->angle_last * CAIRN_DEGREES_PER_RADIAN);
    cairn_json_write_number(&json, "farthest_m", beams->farthest);
    cairn_json_write_number(&json, "range_max_m", (double)beams->range_max);
    cairn_json_write_integer(&json, "returns", beams->returns);
    cairn_json_write_integer(&json, "no_returns", beams->no_returns);
    cairn_json_write_integer(&json, "unknown", beams->unknown);
    cairn_json_write_integer(&json, "first_ns", info->first_ns);
    cairn_json_write_integer(&json, "last_ns", info->last_ns);
    cairn_json_write_number(&json, "duration_s", seconds);
    cairn_json_write_number(&json, "scans_per_second",
                            seconds > 0 ? (double)(info->scans - 1) / seconds : (double)NAN);
    cairn_json_write_integer(&json, "backward_stamps", info->backward_stamps);
    cairn_json_write_number(&json, "path_m", info->odometry_length);
    cairn_json_write_number(&json, "turn_deg", info->odometry_turn * CAIRN_DEGREES_PER_RADIAN);
    if (info->fixed_mounting)
        tool_json_pose(&json, "sensor", info->base_sensor);
    else
        cairn_json_write_null(&json, "sensor");
    cairn_json_write_array(&json, "origin_m");
    cairn_json_write_number(&json, NULL, info->origin[0]);
    cairn_json_write_number(&json, NULL, info->origin[1]);
    cairn_json_write_array_end(&json);
    cairn_json_write_integer(&json, "odometry", info->odometry);
    cairn_json_write_integer(&json, "ignored", info->ignored);
    cairn_json_write_integer(&json, "damaged", info->faults);
    info_check_write(&json, check);
    cairn_json_write_end(&json);
}

int tool_info(int argc, char **argv)
{
    const char *scans = NULL;
    int32_t json = 0, checks = 0;
    tool_log_options log_options = {.prints_taken = 1};
    const option table[] = {
        OPTION_NUMBER("--range-max", &log_options.range_max, 1e-3, 1e5, "M",
                      "ranges from this value on count as no return, m (found in the log)"),
        TOOL_LOG_OPTIONS(&log_options.scan_topic, &log_options.odometry_topic,
                         &log_options.scanner),
        TOOL_SWEEP_OPTION(&log_options.scanner),
        OPTION_FLAG(
            "--check", &checks,
            "finds faults of the scanner's set-up, each with the option that mends it: unit "
            "of the ranges, upside-down scanner, angle step, duration of a scan, pose of the "
            "sensor; odometry, stamps"),
        OPTION_TEXT(
            "--scans", &scans, "FILE",
            "writes all scans as a table of ranges (CSV): stamps, poses of the sensor, ranges"),
        OPTION_JSON(&json),
        OPTION_FLAG("--quiet", &log_options.quiet, "no warnings"),
    };
    const option_set set = {"cairn info", "LOG [options]",
                            "Summarizes a " TOOL_LOG ": scans, "
                            "beams, time, path, the "
                            "sensor's mounting, and what is damaged.",
                            table, sizeof table / sizeof *table};
    const char *words[1] = {NULL};
    size_t word_count = 1;
    cairn_file_error error;
    cairn_scan_log log;
    cairn_scanner_check_result check;
    beam_counts beams;
    option_result result;
    int code;

    result = options_read(&set, argc, argv, words, &word_count);
    if (result != OPTIONS_READ)
        return result;
    if (word_count < 1)
        return options_refuse("cairn info", "no log, expected %s", set.synopsis);
    code = tool_load(&log, words[0], &log_options);
    if (code != TOOL_OK)
        return code;
    beams = count_all(&log.scans);
    if (checks)
        code = info_check_run(&check, &log, words[0], &log_options);
    if (code == TOOL_OK && scans != NULL && cairn_scan_table_write(&log, scans, &error) != CAIRN_OK)
        code = tool_report(&error);
    if (code == TOOL_OK && json)
        print_json(words[0], &log, &beams, checks ? &check : NULL);
    if (code == TOOL_OK && !json)
        print_text(words[0], &log, &beams);
    if (code == TOOL_OK && !json && checks)
        info_check_print(&check);
    cairn_scan_log_free(&log);
    return code;
}
