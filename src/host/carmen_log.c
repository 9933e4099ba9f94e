/* CARMEN logs.
 *
 * Two passes over the file. The first checks every line, reports what is damaged and surveys the
 * log: how many scans, where the ranges pile up (the scanner's limit), whether the sensor's place
 * on the robot is fixed. The second hands out the records with what the first has found.
 *
 * Layout: a histogram of the FLASER ranges in bins of 1 cm up to 1000 m, in which longer ranges
 * count at the end; counts and sums.
 *
 * Limits: 100,000 ranges a scan, lines of 16 MiB, regular files. A file that changes between the
 * passes gives the records that it holds in the second. */
#include "src/core/build.h"

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/carmen_log.h"
#include "src/host/carmen_log_message.h"
#include "src/host/carmen_log_reader.h"

#define BINS           100000
#define BINS_PER_METRE 100
#define BINNED_METRES  1000.0 /* farther ranges are in bin BINS */
#define WINDOW_BINS    20     /* 0.2 m: ranges that mean "no return" lie that close together */
#define BELOW_BINS     200    /* 2 m */
#define PILE_FROM_BIN  (40 * BINS_PER_METRE)
#define PILE_LEAST     10
#define FLASER_LIMIT   80.0
#define SAME_PLACE     CAIRN_REAL(0.01) /* m and rad */

/* What the first pass gathers beyond the info. */
typedef struct survey {
    /* [BINS + 1 + WINDOW_BINS] ranges per bin, later ranges from this bin on; then zeros */
    uint64_t *bin;
    /* 0: no PARAM tells it */
    double param_max;
    /* of the sensor on the robot, in the first scan */
    cairn_pose place;
    /* of the differences to it */
    double place_sum[3];
    bool place_varies;
    /* the robot in the last scan */
    cairn_pose last;
} survey;

struct cairn_carmen_log {
    cairn_line_reader *reader;
    cairn_carmen_params params;
    cairn_carmen_info info;
    cairn_carmen_message message;
    float *range; /* [range_capacity] what records point to */
    int32_t range_capacity;
};

cairn_carmen_params cairn_carmen_default(void)
{
    cairn_carmen_params params;

    memset(&params, 0, sizeof params);
    params.range_sigma = 0.01;
    return params;
}

static cairn_pose pose_of(const double pose[3])
{
    cairn_pose p = {(cairn_real)pose[0], (cairn_real)pose[1], (cairn_real)pose[2]};

    p.theta = cairn_wrap_angle(p.theta);
    return p;
}

static double distance(cairn_pose a, cairn_pose b)
{
    return sqrt((double)((b.x - a.x) * (b.x - a.x) + (b.y - a.y) * (b.y - a.y)));
}

static size_t bin_of(double range)
{
    return (size_t)(fmin(range, BINNED_METRES) * BINS_PER_METRE);
}

static void survey_ranges(survey *s, const cairn_carmen_message *m)
{
    int32_t i;

    for (i = 0; i < m->count; i++)
        if (m->range[i] > 0 && m->range[i] <= DBL_MAX)
            s->bin[bin_of(m->range[i])]++;
}

static void survey_poses(survey *s, cairn_carmen_info *info, const cairn_carmen_message *m)
{
    cairn_pose robot = pose_of(m->robot), place = cairn_pose_between(robot, pose_of(m->laser));
    cairn_pose off;

    if (info->scans == 0) {
        s->place = place;
    } else {
        info->odometry_length += distance(s->last, robot);
        info->odometry_turn += fabs((double)cairn_wrap_angle(robot.theta - s->last.theta));
    }
    off.x = place.x - s->place.x;
    off.y = place.y - s->place.y;
    off.theta = cairn_wrap_angle(place.theta - s->place.theta);
    if (!(cairn_abs(place.x) <= CAIRN_SCAN_EXTENT && cairn_abs(place.y) <= CAIRN_SCAN_EXTENT))
        s->place_varies = true;
    if (!(cairn_abs(off.x) <= SAME_PLACE && cairn_abs(off.y) <= SAME_PLACE &&
          cairn_abs(off.theta) <= SAME_PLACE))
        s->place_varies = true;
    s->place_sum[0] += (double)off.x;
    s->place_sum[1] += (double)off.y;
    s->place_sum[2] += (double)off.theta;
    s->last = robot;
}

static void survey_scan(survey *s, cairn_carmen_info *info, const cairn_carmen_message *m)
{
    if (!(m->range_max > 0))
        survey_ranges(s, m);
    survey_poses(s, info, m);
    if (info->scans == 0) {
        info->beams_least = m->count;
        info->first_ns = m->stamp_ns;
        info->least_ns = m->stamp_ns;
        info->most_ns = m->stamp_ns;
        info->last_ns = m->stamp_ns;
    }
    info->beams += m->count;
    info->beams_least = m->count < info->beams_least ? m->count : info->beams_least;
    info->beams_most = m->count > info->beams_most ? m->count : info->beams_most;
    info->least_ns = m->stamp_ns < info->least_ns ? m->stamp_ns : info->least_ns;
    info->most_ns = m->stamp_ns > info->most_ns ? m->stamp_ns : info->most_ns;
    info->stamps_back += m->stamp_ns < info->last_ns;
    info->last_ns = m->stamp_ns;
    info->scans++;
}

/* The window of 0.2 m from `from` on that holds the most ranges: its first bin, the higher one
 * of equals. `bin` holds the numbers of ranges from each bin on. */
static size_t fullest_window(const uint64_t *bin, size_t from, uint64_t *count)
{
    size_t best = BINS, b = BINS;

    *count = bin[BINS];
    while (b-- > from)
        if (bin[b] - bin[b + WINDOW_BINS] > *count) {
            *count = bin[b] - bin[b + WINDOW_BINS];
            best = b;
        }
    return best;
}

/* Rules 3 to 5 of the header. */
static double find_limit(survey *s)
{
    uint64_t held;
    size_t b, from;

    for (b = BINS; b-- > 0;)
        s->bin[b] += s->bin[b + 1];
    if (s->param_max > 0) {
        from = bin_of(s->param_max);
        (void)fullest_window(s->bin, from, &held);
        if (held * 10 >= s->bin[from] * 9)
            return s->param_max;
    }
    b = fullest_window(s->bin, PILE_FROM_BIN, &held);
    if (held >= PILE_LEAST && held * 10 >= s->bin[b] * 9 &&
        held > s->bin[b - BELOW_BINS] - s->bin[b])
        return (double)b / BINS_PER_METRE;
    return FLASER_LIMIT;
}

static void finish_survey(cairn_carmen_log *log, survey *s)
{
    cairn_carmen_info *info = &log->info;

    info->range_max = log->params.range_max > 0 ? log->params.range_max : find_limit(s);
    info->fixed_mounting = !s->place_varies;
    info->base_sensor = cairn_pose_identity();
    if (info->fixed_mounting) {
        info->base_sensor.x = s->place.x + (cairn_real)(s->place_sum[0] / (double)info->scans);
        info->base_sensor.y = s->place.y + (cairn_real)(s->place_sum[1] / (double)info->scans);
        info->base_sensor.theta =
            cairn_wrap_angle(s->place.theta + (cairn_real)(s->place_sum[2] / (double)info->scans));
    }
}

static void report(cairn_carmen_log *log, const cairn_file_error *fault)
{
    log->info.faults++;
    if (log->params.on_fault != NULL)
        log->params.on_fault(log->params.context, fault);
}

/* The next line that can be read as a message. Lines that cannot are reported in the first pass.
 * CAIRN_EMPTY at the end. */
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
                                       CAIRN_LINE_LONGEST);
        if (status == CAIRN_OK)
            status = cairn_carmen_message_read(&log->message, line, length, path,
                                               cairn_line_reader_number(log->reader), &fault);
        if (status == CAIRN_OK || status == CAIRN_EMPTY)
            return status;
        if (status == CAIRN_IO || status == CAIRN_NO_MEMORY) {
            if (error != NULL)
                *error = fault;
            return status;
        }
        if (first_pass)
            report(log, &fault);
    }
}

static cairn_status run_survey(cairn_carmen_log *log, survey *s, cairn_file_error *error)
{
    const char *path = cairn_line_reader_path(log->reader);
    cairn_carmen_info *info = &log->info;
    cairn_status status;

    while ((status = next_message(log, 1, error)) == CAIRN_OK) {
        switch (log->message.kind) {
        case CAIRN_MESSAGE_SCAN:
            survey_scan(s, info, &log->message);
            break;
        case CAIRN_MESSAGE_ODOMETRY:
            info->odometry++;
            break;
        case CAIRN_MESSAGE_PARAM:
            s->param_max = log->message.range_max;
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
                                    "the file is empty, expected a CARMEN log");
    if (info->scans == 0)
        return cairn_file_error_set(
            error, CAIRN_EMPTY, path, 0,
            "no whole scan in %lld lines (%lld damaged), expected FLASER or ROBOTLASER1 lines "
            "of a CARMEN log",
            (long long)info->lines, (long long)info->faults);
    finish_survey(log, s);
    return cairn_line_reader_rewind(log->reader, error);
}

cairn_status cairn_carmen_log_open(cairn_carmen_log **log, const char *path,
                                   const cairn_carmen_params *params, cairn_file_error *error)
{
    cairn_carmen_params p = params != NULL ? *params : cairn_carmen_default();
    cairn_carmen_log *l;
    cairn_status status;
    survey s;

    *log = NULL;
    if (!(p.range_max >= 0 && p.range_max <= (double)CAIRN_SCAN_EXTENT))
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "the range limit is %g, expected a number from 0 (find it) to %g", p.range_max,
            (double)CAIRN_SCAN_EXTENT);
    if (!(p.range_sigma >= 0 && p.range_sigma <= (double)FLT_MAX))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "the deviation of ranges is %g, expected a number from 0",
                                    p.range_sigma);
    memset(&s, 0, sizeof s);
    l = calloc(1, sizeof *l);
    s.bin = calloc(BINS + 1 + WINDOW_BINS, sizeof *s.bin);
    if (l == NULL || s.bin == NULL) {
        free(l);
        free(s.bin);
        return cairn_file_error_system(error, path, "open", ENOMEM);
    }
    l->params = p;
    status = cairn_line_reader_open(&l->reader, path, error);
    if (status == CAIRN_OK)
        status = run_survey(l, &s, error);
    free(s.bin);
    if (status != CAIRN_OK) {
        cairn_carmen_log_close(l);
        return status;
    }
    *log = l;
    return CAIRN_OK;
}

cairn_carmen_info cairn_carmen_log_info(const cairn_carmen_log *log)
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

/* Ranges as a scan has them. */
static void convert_ranges(const cairn_carmen_message *m, double limit, float *range)
{
    int32_t i;

    for (i = 0; i < m->count; i++) {
        if (m->range[i] >= limit)
            range[i] = INFINITY;
        else if (m->range[i] < -(double)FLT_MAX)
            range[i] = NAN;
        else
            range[i] = (float)m->range[i];
    }
}

static void fill_scan(const cairn_carmen_log *log, cairn_carmen_record *record)
{
    const cairn_carmen_message *m = &log->message;
    double limit =
        m->range_max > 0 && !(log->params.range_max > 0) ? m->range_max : log->info.range_max;

    convert_ranges(m, limit, log->range);
    record->count = m->count;
    record->range = log->range;
    record->scan.range = log->range;
    record->scan.count = m->count;
    record->scan.angle_min = (float)m->angle_min;
    record->scan.angle_step = (float)m->angle_step;
    record->scan.range_max = (float)limit;
    record->scan.range_sigma = (float)log->params.range_sigma;
    record->scan.stamp_ns = m->stamp_ns;
    record->scan.base_sensor = log->info.base_sensor;
}

cairn_status cairn_carmen_log_next(cairn_carmen_log *log, cairn_carmen_record *record,
                                   cairn_file_error *error)
{
    const cairn_carmen_message *m = &log->message;
    cairn_status status;
    float *grown;

    do {
        status = next_message(log, 0, error);
        if (status != CAIRN_OK)
            return status;
    } while (m->kind != CAIRN_MESSAGE_SCAN && m->kind != CAIRN_MESSAGE_ODOMETRY);
    if (m->count > log->range_capacity) {
        grown = realloc(log->range, (size_t)m->count * sizeof *grown);
        if (grown == NULL)
            return cairn_file_error_system(error, cairn_line_reader_path(log->reader), "read",
                                           ENOMEM);
        log->range = grown;
        log->range_capacity = m->count;
    }
    memset(record, 0, sizeof *record);
    record->line = cairn_line_reader_number(log->reader);
    record->stamp_ns = m->stamp_ns;
    record->robot = pose_of(m->robot);
    record->laser = pose_of(m->laser);
    record->kind = CAIRN_CARMEN_ODOMETRY;
    if (m->kind == CAIRN_MESSAGE_SCAN) {
        record->kind = CAIRN_CARMEN_SCAN;
        fill_scan(log, record);
    }
    return CAIRN_OK;
}

/* Copies all scans into arrays of the size that the first pass has counted. */
static cairn_status collect(cairn_carmen_log *log, cairn_carmen_scans *scans,
                            cairn_file_error *error)
{
    size_t beams = 0, most = (size_t)scans->info.beams;
    cairn_carmen_record record = {.kind = CAIRN_CARMEN_ODOMETRY};
    cairn_status status = CAIRN_OK;

    while (scans->count < (int32_t)scans->info.scans) {
        status = cairn_carmen_log_next(log, &record, error);
        if (status != CAIRN_OK)
            break;
        if (record.kind != CAIRN_CARMEN_SCAN)
            continue;
        if ((size_t)record.count > most - beams)
            break;
        memcpy(scans->range + beams, record.range, (size_t)record.count * sizeof *scans->range);
        record.range = scans->range + beams;
        record.scan.range = record.range;
        beams += (size_t)record.count;
        scans->record[scans->count++] = record;
    }
    return status == CAIRN_EMPTY ? CAIRN_OK : status;
}

cairn_status cairn_carmen_load(cairn_carmen_scans *scans, const char *path,
                               const cairn_carmen_params *params, cairn_file_error *error)
{
    cairn_carmen_log *log;
    cairn_status status;

    memset(scans, 0, sizeof *scans);
    status = cairn_carmen_log_open(&log, path, params, error);
    if (log == NULL)
        return status;
    scans->info = log->info;
    if (log->info.scans > INT32_MAX) {
        status = cairn_file_error_set(error, CAIRN_FULL, path, 0, "%lld scans, expected at most %d",
                                      (long long)log->info.scans, INT32_MAX);
    } else {
        scans->record = calloc((size_t)log->info.scans, sizeof *scans->record);
        scans->range = calloc((size_t)log->info.beams, sizeof *scans->range);
        if (scans->record == NULL || scans->range == NULL)
            status = cairn_file_error_system(error, path, "read", ENOMEM);
        else
            status = collect(log, scans, error);
    }
    cairn_carmen_log_close(log);
    if (status != CAIRN_OK)
        cairn_carmen_scans_free(scans);
    return status;
}

void cairn_carmen_scans_free(cairn_carmen_scans *scans)
{
    free(scans->record);
    free(scans->range);
    memset(scans, 0, sizeof *scans);
}
