/* Reader of a stream of scans, line by line.
 *
 * Method: the format is that of the first line with content. A line is parsed by the parser of its
 * format into ranges in double, bearings and poses, and converted to a record.
 *
 * Limits: lines of 16 MiB, 100,000 ranges a scan. */
#include "src/base/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "src/host/logs/carmen_log_message.h"
#include "src/host/logs/carmen_log_reader.h"
#include "src/host/logs/log_origin.h"
#include "src/host/logs/log_parameters.h"
#include "src/host/logs/scan_log_work.h"

enum { FORMAT_UNKNOWN, FORMAT_CARMEN, FORMAT_JSON };

struct cairn_scan_log_stream {
    cairn_line_reader *reader;
    cairn_scan_log_params params;
    int32_t format;
    int64_t faults;
    cairn_carmen_log_message message;
    cairn_scan_log_json json;
    cairn_scan_log_beams beams; /* of JSON */
    double param_max;           /* m, by the last PARAM; 0: none */
    int32_t has_mounting, has_origin;
    double origin[2];    /* m, x and y */
    cairn_pose mounting; /* of CARMEN */
    float *range;        /* [range_capacity] of the record */
    int32_t range_capacity;
};

cairn_status cairn_scan_log_stream_open(cairn_scan_log_stream **stream, int32_t file,
                                        const char *name, const cairn_scan_log_params *params,
                                        cairn_file_error *error)
{
    cairn_scan_log_params settings = params != NULL ? *params : cairn_scan_log_default();
    cairn_status status = cairn_scan_log_check(&settings, name, error);
    cairn_scan_log_stream *created = NULL;

    *stream = NULL;
    if (status == CAIRN_OK) {
        created = calloc(1, sizeof *created);
        if (created == NULL)
            status = cairn_file_error_system(error, name, "read", ENOMEM);
    }
    if (created == NULL) {
        (void)close(file);
        return status;
    }
    created->params = settings;
    status = cairn_line_reader_open_file(&created->reader, file, name, error);
    if (status == CAIRN_OK)
        *stream = created;
    else
        free(created);
    return status;
}

int64_t cairn_scan_log_stream_faults(const cairn_scan_log_stream *stream)
{
    return stream->faults;
}

void cairn_scan_log_stream_origin(const cairn_scan_log_stream *stream, double origin[2])
{
    origin[0] = stream->origin[0];
    origin[1] = stream->origin[1];
}

void cairn_scan_log_stream_close(cairn_scan_log_stream *stream)
{
    if (stream == NULL)
        return;
    cairn_line_reader_close(stream->reader);
    free(stream->message.range);
    free(stream->beams.range);
    free(stream->range);
    free(stream);
}

/* Takes a pose of the odometry from the stream's origin, which is that of the first one. */
static void take_from_origin(cairn_scan_log_stream *stream, double pose[3])
{
    if (!stream->has_origin)
        log_origin_set(stream->origin, pose);
    stream->has_origin = 1;
    log_origin_take(stream->origin, pose);
}

/* Returns the maximum range of a scan; own: that of its message, 0 or NaN: none. */
static double limit_of(const cairn_scan_log_stream *stream, double own)
{
    if (stream->params.range_max > 0)
        return stream->params.range_max;
    if (own > 0 && own <= (double)CAIRN_SCAN_EXTENT)
        return own;
    return stream->param_max > 0 ? stream->param_max : LOG_DEFAULT_RANGE_MAX_M;
}

/* Fills ranges, maximum range and counts of a record. CAIRN_NO_MEMORY. */
static cairn_status fill_ranges(cairn_scan_log_stream *stream, cairn_carmen_log_record *record,
                                const double *range, int32_t count, double limit)
{
    if (count > stream->range_capacity) {
        float *grown = realloc(stream->range, (size_t)count * sizeof *grown);

        if (grown == NULL)
            return CAIRN_NO_MEMORY;
        stream->range = grown;
        stream->range_capacity = count;
    }
    for (int32_t i = 0; i < count; i++)
        stream->range[i] = range[i] >= limit             ? INFINITY
                           : range[i] < -(double)FLT_MAX ? NAN
                                                         : (float)range[i];
    memset(record, 0, sizeof *record);
    record->kind = CAIRN_CARMEN_LOG_SCAN;
    record->line = cairn_line_reader_number(stream->reader);
    record->count = record->scan.count = count;
    record->range = record->scan.range = stream->range;
    record->scan.range_max = (float)limit;
    record->scan.range_sigma = (float)stream->params.range_sigma;
    return CAIRN_OK;
}

/* Converts the CARMEN message. */
static cairn_status convert_message(cairn_scan_log_stream *stream, cairn_carmen_log_record *record)
{
    cairn_carmen_log_message *message = &stream->message;
    cairn_status status = fill_ranges(stream, record, message->range, message->count,
                                      limit_of(stream, message->range_max));

    if (status != CAIRN_OK)
        return status;
    take_from_origin(stream, message->robot);
    take_from_origin(stream, message->laser);
    record->robot = log_origin_pose(message->robot);
    record->laser = log_origin_pose(message->laser);
    if (!stream->has_mounting) {
        cairn_pose mounting = cairn_pose_between(record->robot, record->laser);

        stream->has_mounting = 1;
        stream->mounting =
            cairn_pose_is_within(mounting, CAIRN_SCAN_EXTENT) ? mounting : cairn_pose_identity();
    }
    record->stamp_ns = record->scan.stamp_ns = message->stamp_ns;
    record->scan.angle_min = (float)message->angle_min;
    record->scan.angle_step = (float)message->angle_step;
    record->scan.base_sensor = stream->mounting;
    return CAIRN_OK;
}

/* Converts the JSON scan. */
static cairn_status convert_json(cairn_scan_log_stream *stream, cairn_carmen_log_record *record)
{
    cairn_scan_log_json *json = &stream->json;
    cairn_status status = fill_ranges(stream, record, stream->beams.range, stream->beams.count,
                                      limit_of(stream, json->range_max));

    if (status != CAIRN_OK)
        return status;
    if (json->has_odometry)
        take_from_origin(stream, json->odometry);
    record->robot = log_origin_pose(json->odometry);
    record->scan.base_sensor = log_origin_pose(json->sensor);
    record->laser = cairn_pose_compose(record->robot, record->scan.base_sensor);
    record->stamp_ns = record->scan.stamp_ns = json->stamp_ns;
    record->scan.angle_min = (float)json->angle_min;
    record->scan.angle_step = (float)json->angle_step;
    record->scan.range_min = (float)fmax(json->range_min, 0);
    record->scan.time_step = (float)fmax(json->time_step, 0);
    return CAIRN_OK;
}

/* Detects the format by a line with content. */
static int32_t format_of(const char *line, size_t length)
{
    const char *at = line, *token;

    if (cairn_token_next(&at, line + length, &token) == 0 || token[0] == '#')
        return FORMAT_UNKNOWN;
    return token[0] == '{' ? FORMAT_JSON : FORMAT_CARMEN;
}

/* Parses a line. *is_scan: it holds one. */
static cairn_status parse(cairn_scan_log_stream *stream, const char *line, size_t length,
                          int32_t *is_scan, cairn_file_error *fault)
{
    const char *path = cairn_line_reader_path(stream->reader);
    int64_t number = cairn_line_reader_number(stream->reader);
    cairn_status status;

    *is_scan = 0;
    if (stream->format == FORMAT_UNKNOWN)
        stream->format = format_of(line, length);
    if (stream->format == FORMAT_UNKNOWN || format_of(line, length) == FORMAT_UNKNOWN)
        return CAIRN_OK;
    if (stream->format == FORMAT_JSON) {
        status = cairn_scan_log_json_read(&stream->json, &stream->beams, path, number, line, length,
                                          fault);
        *is_scan = status == CAIRN_OK;
        return status;
    }
    status = cairn_carmen_log_message_read(&stream->message, line, length, path, number, fault);
    if (status == CAIRN_OK && stream->message.kind == CAIRN_MESSAGE_PARAM)
        stream->param_max = stream->message.range_max;
    *is_scan = status == CAIRN_OK && stream->message.kind == CAIRN_MESSAGE_SCAN;
    return status;
}

/* Reports a faulty line. */
static void report(cairn_scan_log_stream *stream, const cairn_file_error *fault)
{
    stream->faults++;
    if (stream->params.on_fault != NULL)
        stream->params.on_fault(stream->params.context, fault);
}

cairn_status cairn_scan_log_stream_next(cairn_scan_log_stream *stream,
                                        cairn_carmen_log_record *record, int32_t *has_odometry,
                                        cairn_file_error *error)
{
    const char *path = cairn_line_reader_path(stream->reader), *line;
    cairn_file_error fault;
    cairn_status status;
    int32_t is_scan;
    size_t length;

    for (;;) {
        status = cairn_line_reader_next(stream->reader, &line, &length, &fault);
        if (status == CAIRN_FULL)
            (void)cairn_file_error_set(
                &fault, status, path, cairn_line_reader_number(stream->reader),
                "the line has %zu bytes, expected at most %d", length, CAIRN_LINE_READER_MAX_BYTES);
        is_scan = 0;
        if (status == CAIRN_OK)
            status = parse(stream, line, length, &is_scan, &fault);
        if (status == CAIRN_IO || status == CAIRN_NO_MEMORY || status == CAIRN_EMPTY ||
            status == CAIRN_MORE)
            break;
        if (is_scan) {
            *has_odometry = stream->format == FORMAT_CARMEN || stream->json.has_odometry;
            status = stream->format == FORMAT_CARMEN ? convert_message(stream, record)
                                                     : convert_json(stream, record);
            return status == CAIRN_OK ? CAIRN_OK
                                      : cairn_file_error_system(error, path, "read", ENOMEM);
        }
        if (status != CAIRN_OK)
            report(stream, &fault);
    }
    if (status != CAIRN_EMPTY && status != CAIRN_MORE && error != NULL)
        *error = fault;
    return status;
}
