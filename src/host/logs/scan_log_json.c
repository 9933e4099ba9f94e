/* A scan as JSON with the fields of a LaserScan. */
#include "src/base/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/json_text.h"
#include "cairn/number_text.h"
#include "src/host/logs/scan_log_work.h"

/* Largest accepted magnitude of bearings, poses and times. */
static const double MAX_MAGNITUDE = 1e9;

/* The parser of an object. */
typedef struct json_parser {
    cairn_json json;
    const char *path;
    cairn_file_error *fault;
    cairn_scan_log_json *scan;
    cairn_scan_log_beams *beams;
    int32_t has_ranges;
} json_parser;

static cairn_status refuse(const json_parser *parser, const char *what)
{
    return cairn_file_error_set(parser->fault, CAIRN_BAD_FORMAT, parser->path, parser->json.line,
                                "%s", what);
}

/* Reads a number of bounded magnitude. */
static cairn_status read_number(json_parser *parser, double *value)
{
    cairn_json_token token;
    cairn_status status = cairn_json_next(&parser->json, &token, parser->fault);

    if (status != CAIRN_OK)
        return status;
    if (token.kind != CAIRN_JSON_NUMBER || fabs(token.number) > MAX_MAGNITUDE)
        return refuse(parser, "a field is no number up to 1e9, expected one");
    *value = token.number;
    return CAIRN_OK;
}

/* Reads an integer exactly: a double has too few digits for nanoseconds. */
static cairn_status read_integer(json_parser *parser, int64_t *value)
{
    cairn_json_token token;
    cairn_status status = cairn_json_next(&parser->json, &token, parser->fault);

    if (status != CAIRN_OK)
        return status;
    if (token.kind != CAIRN_JSON_NUMBER ||
        !cairn_number_read_integer(token.text, token.length, value))
        return refuse(parser, "a part of the stamp is no whole number, expected one");
    return CAIRN_OK;
}

/* Appends a range. */
static cairn_status append_range(json_parser *parser, double range)
{
    cairn_scan_log_beams *beams = parser->beams;

    if (beams->count == CAIRN_CARMEN_LOG_MAX_BEAMS)
        return cairn_file_error_set(parser->fault, CAIRN_FULL, parser->path, parser->json.line,
                                    "more than %d ranges, expected at most that",
                                    CAIRN_CARMEN_LOG_MAX_BEAMS);
    if (beams->count == beams->capacity) {
        int32_t capacity = 2 * beams->capacity + 512;
        double *grown = realloc(beams->range, (size_t)capacity * sizeof *grown);

        if (grown == NULL)
            return cairn_file_error_system(parser->fault, parser->path, "read", ENOMEM);
        beams->range = grown;
        beams->capacity = capacity;
    }
    beams->range[beams->count++] = range;
    return CAIRN_OK;
}

static cairn_status read_ranges(json_parser *parser)
{
    cairn_json_token token;
    cairn_status status = cairn_json_next(&parser->json, &token, parser->fault);

    if (status == CAIRN_OK && token.kind != CAIRN_JSON_ARRAY)
        status = refuse(parser, "ranges is not a list, expected [ and numbers");
    parser->beams->count = 0;
    parser->has_ranges = 1;
    while (status == CAIRN_OK) {
        status = cairn_json_next(&parser->json, &token, parser->fault);
        if (status != CAIRN_OK || token.kind == CAIRN_JSON_ARRAY_END)
            return status;
        if (token.kind != CAIRN_JSON_NUMBER && token.kind != CAIRN_JSON_NULL)
            return refuse(parser, "ranges holds something else, expected numbers and null");
        status = append_range(parser, token.kind == CAIRN_JSON_NULL ? (double)NAN : token.number);
    }
    return status;
}

/* Reads [x, y, theta]. */
static cairn_status read_pose(json_parser *parser, double pose[3])
{
    cairn_json_token token;
    cairn_status status = cairn_json_next(&parser->json, &token, parser->fault);

    if (status == CAIRN_OK && token.kind != CAIRN_JSON_ARRAY)
        status = refuse(parser, "a pose is not a list, expected [x, y, theta]");
    for (int i = 0; i < 3 && status == CAIRN_OK; i++)
        status = read_number(parser, &pose[i]);
    if (status == CAIRN_OK)
        status = cairn_json_next(&parser->json, &token, parser->fault);
    return status != CAIRN_OK || token.kind == CAIRN_JSON_ARRAY_END
               ? status
               : refuse(parser, "a pose of more than three numbers, expected [x, y, theta]");
}

/* Reads an object's fields by a function. */
static cairn_status read_fields(json_parser *parser,
                                cairn_status (*read)(json_parser *, const cairn_json_token *))
{
    cairn_json_token token;
    cairn_status status = cairn_json_next(&parser->json, &token, parser->fault);

    if (status == CAIRN_OK && token.kind != CAIRN_JSON_OBJECT)
        status = refuse(parser, "not an object, expected { and the fields of a LaserScan");
    while (status == CAIRN_OK) {
        status = cairn_json_next(&parser->json, &token, parser->fault);
        if (status != CAIRN_OK || token.kind == CAIRN_JSON_OBJECT_END)
            return status;
        status = read(parser, &token);
    }
    return status;
}

/* Refuses a stamp that no scan may have. */
static cairn_status check_stamp(const json_parser *parser)
{
    int64_t stamp_ns = parser->scan->stamp_ns;

    return stamp_ns <= CAIRN_SCAN_MAX_STAMP_NS && stamp_ns >= -CAIRN_SCAN_MAX_STAMP_NS
               ? CAIRN_OK
               : refuse(parser, "a stamp beyond 4e9 s, expected one within it");
}

static cairn_status read_stamp_ns(json_parser *parser)
{
    cairn_status status = read_integer(parser, &parser->scan->stamp_ns);

    return status == CAIRN_OK ? check_stamp(parser) : status;
}

/* A field of header.stamp; secs and nsecs are those of ROS 1. */
static cairn_status read_stamp_field(json_parser *parser, const cairn_json_token *name)
{
    int is_seconds = cairn_json_is(name, "sec") || cairn_json_is(name, "secs");
    int64_t value = 0;
    cairn_status status;

    if (!is_seconds && !cairn_json_is(name, "nanosec") && !cairn_json_is(name, "nsecs"))
        return cairn_json_skip(&parser->json, parser->fault);
    status = read_integer(parser, &value);
    if (status == CAIRN_OK && (value < 0 || value > INT32_MAX))
        status = refuse(parser, "a stamp beyond 2038 or below 0, expected sec and nanosec");
    if (status != CAIRN_OK)
        return status;
    parser->scan->stamp_ns += is_seconds ? value * 1000000000 : value;
    return check_stamp(parser);
}

static cairn_status read_header_field(json_parser *parser, const cairn_json_token *name)
{
    if (!cairn_json_is(name, "stamp"))
        return cairn_json_skip(&parser->json, parser->fault);
    parser->scan->stamp_ns = 0;
    return read_fields(parser, read_stamp_field);
}

/* A field of the scan. */
static cairn_status read_field(json_parser *parser, const cairn_json_token *name)
{
    cairn_scan_log_json *scan = parser->scan;
    const struct {
        const char *name;
        double *value;
    } numbers[] = {{"angle_min", &scan->angle_min},
                   {"angle_increment", &scan->angle_step},
                   {"time_increment", &scan->time_step},
                   {"range_min", &scan->range_min},
                   {"range_max", &scan->range_max}};

    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        if (cairn_json_is(name, numbers[i].name))
            return read_number(parser, numbers[i].value);
    if (cairn_json_is(name, "ranges"))
        return read_ranges(parser);
    if (cairn_json_is(name, "stamp_ns"))
        return read_stamp_ns(parser);
    if (cairn_json_is(name, "header"))
        return read_fields(parser, read_header_field);
    if (cairn_json_is(name, "sensor"))
        return read_pose(parser, scan->sensor);
    if (!cairn_json_is(name, "odometry"))
        return cairn_json_skip(&parser->json, parser->fault);
    scan->has_odometry = 1;
    return read_pose(parser, scan->odometry);
}

cairn_status cairn_scan_log_json_read(cairn_scan_log_json *scan, cairn_scan_log_beams *beams,
                                      const char *path, int64_t number, const char *line,
                                      size_t length, cairn_file_error *fault)
{
    json_parser parser = {.json = cairn_json_begin(path, line, length),
                          .path = path,
                          .fault = fault,
                          .scan = scan,
                          .beams = beams};
    cairn_json_token token;
    cairn_status status;

    memset(scan, 0, sizeof *scan);
    scan->angle_min = scan->angle_step = scan->range_max = (double)NAN;
    parser.json.line = number;
    status = read_fields(&parser, read_field);
    if (status == CAIRN_OK)
        status = cairn_json_next(&parser.json, &token, fault);
    if (status != CAIRN_OK)
        return status;
    if (token.kind != CAIRN_JSON_END)
        return refuse(&parser, "more than one value in the line, expected one object");
    if (!parser.has_ranges || beams->count < 1)
        return refuse(&parser, "a scan without ranges, expected at least one");
    if (!(fabs(scan->angle_min) <= MAX_MAGNITUDE) || !(fabs(scan->angle_step) <= MAX_MAGNITUDE))
        return refuse(&parser, "a scan without bearings, expected angle_min and angle_increment");
    return CAIRN_OK;
}
