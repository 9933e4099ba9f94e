/* Reader of CARMEN logs.
 *
 * Method
 * 1. The first pass over the file checks every line, reports malformed ones, and collects
 *    statistics: the number of scans, a histogram of the ranges, the sensor's mounting on the
 *    robot.
 * 2. The maximum range is estimated from the mode of the histogram.
 * 3. The second pass returns the records, using these results.
 *
 * Layout: the histogram of the FLASER ranges has bins of 1 cm up to 1000 m and one overflow bin.
 *
 * Limits: 100,000 ranges a scan, lines of 16 MiB, regular files. If a file changes between the
 * passes, the records are those of the second pass. */
#include "src/base/build.h"

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/carmen_log.h"
#include "src/host/logs/carmen_log_message.h"
#include "src/host/logs/carmen_log_reader.h"
#include "src/host/logs/log_origin.h"
#include "src/host/logs/log_parameters.h"

/* Range histogram. */
#define RANGE_BINS       100000
#define BINS_PER_METRE   100
#define HISTOGRAM_METRES 1000.0 /* farther ranges are counted in bin RANGE_BINS */
#define WINDOW_BINS      20     /* 0.2 m: spread of the ranges that mean "no return" */
#define BELOW_BINS       200    /* 2 m: the window is compared with the ranges this far below it */
/* Acceptance of a mode of the histogram: lowest bin, minimum ranges. */
#define MODE_FIRST_BIN  (40 * BINS_PER_METRE)
#define MODE_MIN_RANGES 10
/* Tolerance of a fixed mounting, in m and rad. */
#define MOUNTING_TOLERANCE CAIRN_REAL(0.01)

/* Statistics of the first pass beyond the summary. */
typedef struct survey_statistics {
    /* [RANGE_BINS + 1 + WINDOW_BINS] histogram of ranges, then zeros. find_limit turns it into a
     * cumulative histogram from above: the ranges in this bin and all higher ones. */
    uint64_t *bin;
    /* m, the maximum range by a PARAM; 0: none */
    double param_max;
    /* the sensor's mounting in the first scan */
    cairn_pose mounting;
    /* sum of the deviations from it: m, m, rad */
    double deviation_sum[3];
    bool mounting_varies;
    /* the robot's pose in the last scan */
    cairn_pose last;
} survey_statistics;

struct cairn_carmen_log {
    cairn_line_reader *reader;
    cairn_carmen_log_params params;
    cairn_carmen_log_summary info;
    cairn_carmen_log_message message;
    bool has_origin;
    float *range; /* [range_capacity] storage of the record's ranges */
    int32_t range_capacity;
};

static const cairn_host_parameter rows[] = {
    LOG_PARAMETERS(cairn_carmen_log_params),
};

const cairn_host_parameters cairn_carmen_log_parameters =
    CAIRN_HOST_PARAMETERS(cairn_carmen_log_params, rows);

cairn_carmen_log_params cairn_carmen_log_default(void)
{
    cairn_carmen_log_params params;

    cairn_host_parameters_preset(&cairn_carmen_log_parameters, &params);
    return params;
}

static double distance(cairn_pose a, cairn_pose b)
{
    return sqrt((double)((b.x - a.x) * (b.x - a.x) + (b.y - a.y) * (b.y - a.y)));
}

/* Returns the histogram bin of a range. */
static size_t bin_of(double range)
{
    return (size_t)(fmin(range, HISTOGRAM_METRES) * BINS_PER_METRE);
}

/* Adds the ranges of a scan to the histogram. */
static void survey_ranges(survey_statistics *statistics, const cairn_carmen_log_message *message)
{
    int32_t i;

    for (i = 0; i < message->count; i++)
        if (message->range[i] > 0 && message->range[i] <= DBL_MAX)
            statistics->bin[bin_of(message->range[i])]++;
}

/* Adds the mounting and the motion of a scan to the statistics. */
static void survey_poses(survey_statistics *statistics, cairn_carmen_log_summary *info,
                         const cairn_carmen_log_message *message)
{
    cairn_pose robot = log_origin_pose(message->robot),
               mounting = cairn_pose_between(robot, log_origin_pose(message->laser));
    cairn_pose deviation;

    if (info->scans == 0) {
        statistics->mounting = mounting;
    } else {
        info->odometry_length += distance(statistics->last, robot);
        info->odometry_turn += fabs((double)cairn_wrap_angle(robot.theta - statistics->last.theta));
    }
    deviation.x = mounting.x - statistics->mounting.x;
    deviation.y = mounting.y - statistics->mounting.y;
    deviation.theta = cairn_wrap_angle(mounting.theta - statistics->mounting.theta);
    if (!cairn_pose_is_within(mounting, CAIRN_SCAN_EXTENT))
        statistics->mounting_varies = true;
    if (!(cairn_abs(deviation.x) <= MOUNTING_TOLERANCE &&
          cairn_abs(deviation.y) <= MOUNTING_TOLERANCE &&
          cairn_abs(deviation.theta) <= MOUNTING_TOLERANCE))
        statistics->mounting_varies = true;
    statistics->deviation_sum[0] += (double)deviation.x;
    statistics->deviation_sum[1] += (double)deviation.y;
    statistics->deviation_sum[2] += (double)deviation.theta;
    statistics->last = robot;
}

/* Adds a scan to the statistics and the summary. */
static void survey_scan(survey_statistics *statistics, cairn_carmen_log_summary *info,
                        const cairn_carmen_log_message *message)
{
    if (!(message->range_max > 0))
        survey_ranges(statistics, message);
    survey_poses(statistics, info, message);
    if (info->scans == 0) {
        info->min_beams = message->count;
        info->first_ns = message->stamp_ns;
        info->earliest_ns = message->stamp_ns;
        info->latest_ns = message->stamp_ns;
        info->last_ns = message->stamp_ns;
    }
    info->beams += message->count;
    info->min_beams = message->count < info->min_beams ? message->count : info->min_beams;
    info->max_beams = message->count > info->max_beams ? message->count : info->max_beams;
    info->earliest_ns =
        message->stamp_ns < info->earliest_ns ? message->stamp_ns : info->earliest_ns;
    info->latest_ns = message->stamp_ns > info->latest_ns ? message->stamp_ns : info->latest_ns;
    info->backward_stamps += message->stamp_ns < info->last_ns;
    info->last_ns = message->stamp_ns;
    info->scans++;
}

/* Returns the first bin of the mode: the window of 0.2 m from bin `from` on with the most ranges,
 * the higher of equals. *count: its ranges. `bin` is the cumulative histogram. */
static size_t fullest_window(const uint64_t *bin, size_t from, uint64_t *count)
{
    size_t best = RANGE_BINS, first = RANGE_BINS;

    *count = bin[RANGE_BINS];
    while (first-- > from)
        if (bin[first] - bin[first + WINDOW_BINS] > *count) {
            *count = bin[first] - bin[first + WINDOW_BINS];
            best = first;
        }
    return best;
}

/* Estimates the maximum range in m: rules 3 to 5 of the header. */
static double find_limit(survey_statistics *statistics)
{
    uint64_t window_count;
    size_t bin, from;

    for (bin = RANGE_BINS; bin-- > 0;)
        statistics->bin[bin] += statistics->bin[bin + 1];
    if (statistics->param_max > 0) {
        from = bin_of(statistics->param_max);
        (void)fullest_window(statistics->bin, from, &window_count);
        if (window_count * 10 >= statistics->bin[from] * 9)
            return statistics->param_max;
    }
    bin = fullest_window(statistics->bin, MODE_FIRST_BIN, &window_count);
    if (window_count >= MODE_MIN_RANGES && window_count * 10 >= statistics->bin[bin] * 9 &&
        window_count > statistics->bin[bin - BELOW_BINS] - statistics->bin[bin])
        return (double)bin / BINS_PER_METRE;
    return LOG_DEFAULT_RANGE_MAX_M;
}

/* Estimates the maximum range and the mounting. */
static void finish_survey(cairn_carmen_log *log, survey_statistics *statistics)
{
    cairn_carmen_log_summary *info = &log->info;

    info->range_max = log->params.range_max > 0 ? log->params.range_max : find_limit(statistics);
    info->fixed_mounting = !statistics->mounting_varies;
    info->base_sensor = cairn_pose_identity();
    if (info->fixed_mounting) {
        info->base_sensor.x = statistics->mounting.x +
                              (cairn_real)(statistics->deviation_sum[0] / (double)info->scans);
        info->base_sensor.y = statistics->mounting.y +
                              (cairn_real)(statistics->deviation_sum[1] / (double)info->scans);
        info->base_sensor.theta =
            cairn_wrap_angle(statistics->mounting.theta +
                             (cairn_real)(statistics->deviation_sum[2] / (double)info->scans));
    }
}

static void report_fault(cairn_carmen_log *log, const cairn_file_error *fault)
{
    log->info.faults++;
    if (log->params.on_fault != NULL)
        log->params.on_fault(log->params.context, fault);
}

/* Takes the poses of a message from the log's origin, which is that of the first one. */
static void take_from_origin(cairn_carmen_log *log)
{
    cairn_carmen_log_message *message = &log->message;

    if (message->kind != CAIRN_MESSAGE_SCAN && message->kind != CAIRN_MESSAGE_ODOMETRY)
        return;
    if (!log->has_origin)
        log_origin_set(log->info.origin, message->robot);
    log->has_origin = true;
    log_origin_take(log->info.origin, message->robot);
    log_origin_take(log->info.origin, message->laser);
}

/* Parses the next well-formed line. Malformed lines are reported in the first pass. CAIRN_EMPTY at
 * the end. */
static cairn_status next_message(cairn_carmen_log *log, int32_t first_pass, cairn_file_error *error)
{
    const char *path = cairn_line_reader_path(log->reader), *line;
    cairn_file_error fault;
    size_t length;
    cairn_status status;

    for (;;) {
        status = cairn_line_reader_next(log->reader, &line, &length, &fault);
        if (status == CAIRN_FULL)
            (void)cairn_file_error_set(&fault, status, path, cairn_line_reader_number(log->reader),
                                       "the line has %zu bytes, expected at most %d", length,
                                       CAIRN_LINE_READER_MAX_BYTES);
        if (status == CAIRN_OK)
            status = cairn_carmen_log_message_read(&log->message, line, length, path,
                                                   cairn_line_reader_number(log->reader), &fault);
        if (status == CAIRN_OK)
            take_from_origin(log);
        if (status == CAIRN_OK || status == CAIRN_EMPTY || status == CAIRN_MORE)
            return status;
        if (status == CAIRN_IO || status == CAIRN_NO_MEMORY) {
            if (error != NULL)
                *error = fault;
            return status;
        }
        if (first_pass)
            report_fault(log, &fault);
    }
}

/* The first pass: collects statistics and reports faults. */
static cairn_status run_survey(cairn_carmen_log *log, survey_statistics *statistics,
                               cairn_file_error *error)
{
    const char *path = cairn_line_reader_path(log->reader);
    cairn_carmen_log_summary *info = &log->info;
    cairn_status status;

    while ((status = next_message(log, 1, error)) == CAIRN_OK) {
        switch (log->message.kind) {
        case CAIRN_MESSAGE_SCAN:
            survey_scan(statistics, info, &log->message);
            break;
        case CAIRN_MESSAGE_ODOMETRY:
            info->odometry++;
            break;
        case CAIRN_MESSAGE_PARAM:
            statistics->param_max = log->message.range_max;
            info->ignored++;
            break;
        case CAIRN_MESSAGE_OTHER:
            info->ignored++;
            break;
        default:
            break;
        }
    }
    if (status != CAIRN_EMPTY)
        return status;
    info->lines = cairn_line_reader_number(log->reader);
    if (info->lines == 0)
        return cairn_file_error_set(error, CAIRN_EMPTY, path, 0,
                                    "the file is empty, expected a log of scans");
    if (info->scans == 0)
        return cairn_file_error_set(
            error, CAIRN_EMPTY, path, 0,
            "no whole scan in %lld lines (%lld damaged), expected FLASER or ROBOTLASER1 lines "
            "of a CARMEN log, a log of URG or CSM, a table of ranges with a header, or a bag of "
            "ROS",
            (long long)info->lines, (long long)info->faults);
    finish_survey(log, statistics);
    return cairn_line_reader_rewind(log->reader, error);
}

cairn_status cairn_carmen_log_open(cairn_carmen_log **log, const char *path,
                                   const cairn_carmen_log_params *params, cairn_file_error *error)
{
    cairn_carmen_log_params settings = params != NULL ? *params : cairn_carmen_log_default();
    cairn_carmen_log *created;
    cairn_status status;
    survey_statistics statistics;

    *log = NULL;
    status = cairn_host_parameters_check(&cairn_carmen_log_parameters, &settings, path, error);
    if (status != CAIRN_OK)
        return status;
    memset(&statistics, 0, sizeof statistics);
    created = calloc(1, sizeof *created);
    statistics.bin = calloc(RANGE_BINS + 1 + WINDOW_BINS, sizeof *statistics.bin);
    if (created == NULL || statistics.bin == NULL) {
        free(created);
        free(statistics.bin);
        return cairn_file_error_system(error, path, "open", ENOMEM);
    }
    created->params = settings;
    status = cairn_line_reader_open(&created->reader, path, error);
    if (status == CAIRN_OK)
        status = run_survey(created, &statistics, error);
    free(statistics.bin);
    if (status != CAIRN_OK) {
        cairn_carmen_log_close(created);
        return status;
    }
    *log = created;
    return CAIRN_OK;
}

cairn_carmen_log_summary cairn_carmen_log_info(const cairn_carmen_log *log)
{
    return log->info;
}

cairn_status cairn_carmen_log_rewind(cairn_carmen_log *log, cairn_file_error *error)
{
    return cairn_line_reader_rewind(log->reader, error);
}

void cairn_carmen_log_close(cairn_carmen_log *log)
{
    if (log == NULL)
        return;
    cairn_line_reader_close(log->reader);
    free(log->message.range);
    free(log->range);
    free(log);
}

/* Converts ranges for a scan: no returns become +infinity. */
static void convert_ranges(const cairn_carmen_log_message *message, double limit, float *range)
{
    int32_t i;

    for (i = 0; i < message->count; i++) {
        if (message->range[i] >= limit)
            range[i] = INFINITY;
        else if (message->range[i] < -(double)FLT_MAX)
            range[i] = NAN;
        else
            range[i] = (float)message->range[i];
    }
}

/* Fills the scan of a record from the current message. */
static void fill_scan(const cairn_carmen_log *log, cairn_carmen_log_record *record)
{
    const cairn_carmen_log_message *message = &log->message;
    double limit = message->range_max > 0 && !(log->params.range_max > 0) ? message->range_max
                                                                          : log->info.range_max;

    convert_ranges(message, limit, log->range);
    record->count = message->count;
    record->range = log->range;
    record->scan.range = log->range;
    record->scan.count = message->count;
    record->scan.angle_min = (float)message->angle_min;
    record->scan.angle_step = (float)message->angle_step;
    record->scan.range_max = (float)limit;
    record->scan.range_sigma = (float)log->params.range_sigma;
    record->scan.stamp_ns = message->stamp_ns;
    record->scan.base_sensor = log->info.base_sensor;
}

cairn_status cairn_carmen_log_next(cairn_carmen_log *log, cairn_carmen_log_record *record,
                                   cairn_file_error *error)
{
    const cairn_carmen_log_message *message = &log->message;
    cairn_status status;
    float *grown;

    do {
        status = next_message(log, 0, error);
        if (status != CAIRN_OK)
            return status;
    } while (message->kind != CAIRN_MESSAGE_SCAN && message->kind != CAIRN_MESSAGE_ODOMETRY);
    if (message->count > log->range_capacity) {
        grown = realloc(log->range, (size_t)message->count * sizeof *grown);
        if (grown == NULL)
            return cairn_file_error_system(error, cairn_line_reader_path(log->reader), "read",
                                           ENOMEM);
        log->range = grown;
        log->range_capacity = message->count;
    }
    memset(record, 0, sizeof *record);
    record->line = cairn_line_reader_number(log->reader);
    record->stamp_ns = message->stamp_ns;
    record->robot = log_origin_pose(message->robot);
    record->laser = log_origin_pose(message->laser);
    record->kind = CAIRN_CARMEN_LOG_ODOMETRY;
    if (message->kind == CAIRN_MESSAGE_SCAN) {
        record->kind = CAIRN_CARMEN_LOG_SCAN;
        fill_scan(log, record);
    }
    return CAIRN_OK;
}

/* Copies all scans into arrays of the sizes counted by the first pass. */
static cairn_status collect(cairn_carmen_log *log, cairn_carmen_log_scans *scans,
                            cairn_file_error *error)
{
    size_t beams = 0, capacity = (size_t)scans->info.beams;
    cairn_carmen_log_record record = {.kind = CAIRN_CARMEN_LOG_ODOMETRY};
    cairn_status status = CAIRN_OK;

    while (scans->count < (int32_t)scans->info.scans) {
        status = cairn_carmen_log_next(log, &record, error);
        if (status != CAIRN_OK)
            break;
        if (record.kind != CAIRN_CARMEN_LOG_SCAN)
            continue;
        if ((size_t)record.count > capacity - beams)
            break;
        memcpy(scans->range + beams, record.range, (size_t)record.count * sizeof *scans->range);
        record.range = scans->range + beams;
        record.scan.range = record.range;
        beams += (size_t)record.count;
        scans->record[scans->count++] = record;
    }
    return status == CAIRN_EMPTY ? CAIRN_OK : status;
}

cairn_status cairn_carmen_log_load(cairn_carmen_log_scans *scans, const char *path,
                                   const cairn_carmen_log_params *params, cairn_file_error *error)
{
    cairn_carmen_log *log;
    cairn_status status;

    memset(scans, 0, sizeof *scans);
    status = cairn_carmen_log_open(&log, path, params, error);
    if (log == NULL)
        return status;
    scans->info = log->info;
    if (log->info.scans > CAIRN_CARMEN_LOG_MAX_SCANS) {
        status = cairn_file_error_set(error, CAIRN_FULL, path, 0, "%lld scans, expected at most %d",
                                      (long long)log->info.scans, CAIRN_CARMEN_LOG_MAX_SCANS);
    } else {
        CAIRN_ASSERT(log->info.scans > 0);
        scans->record = calloc((size_t)log->info.scans, sizeof *scans->record);
        scans->range = calloc((size_t)log->info.beams, sizeof *scans->range);
        if (scans->record == NULL || scans->range == NULL)
            status = cairn_file_error_system(error, path, "read", ENOMEM);
        else
            status = collect(log, scans, error);
    }
    cairn_carmen_log_close(log);
    if (status != CAIRN_OK)
        cairn_carmen_log_scans_free(scans);
    return status;
}

void cairn_carmen_log_scans_free(cairn_carmen_log_scans *scans)
{
    free(scans->record);
    free(scans->range);
    memset(scans, 0, sizeof *scans);
}
