/* Parser of one line of a CARMEN log, token by token. The first error is the fault; after it, the
 * remaining reads have no effect. */
#include "src/base/build.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/number_text.h"
#include "src/host/logs/carmen_log_message.h"
#include "src/host/logs/carmen_log_reader.h"

/* Largest accepted magnitude of poses, bearings and motions, in m and rad. */
#define MAX_MAGNITUDE 1e9

/* State of the parser. */
typedef struct line_parser {
    const char *at, *end; /* the unread rest of the line */
    const char *path;
    int64_t number;   /* of the line, from 1 */
    const char *name; /* of the message */
    cairn_file_error *fault;
    cairn_status status;
    const char *field_name; /* of the current token */
    int32_t field_index;    /* its element, from 1, as in "reading 17"; 0: a single field */
    char field_text[64];    /* both, formatted by describe_field */
} line_parser;

/* Names the current field for an error text. */
static const char *describe_field(line_parser *parser)
{
    if (parser->field_index > 0)
        (void)snprintf(parser->field_text, sizeof parser->field_text, "%s %d", parser->field_name,
                       (int)parser->field_index);
    else
        (void)snprintf(parser->field_text, sizeof parser->field_text, "%s", parser->field_name);
    return parser->field_text;
}

/* Returns the next token and its length; NULL after an error and at the end of the line, which is
 * then the fault. */
static const char *next_token(line_parser *parser, const char *field_name, int32_t field_index,
                              size_t *length)
{
    const char *token;

    if (parser->status != CAIRN_OK)
        return NULL;
    parser->field_name = field_name;
    parser->field_index = field_index;
    *length = cairn_token_next(&parser->at, parser->end, &token);
    if (*length > 0)
        return token;
    parser->status = cairn_file_error_set(parser->fault, CAIRN_TRUNCATED, parser->path,
                                          parser->number, "the %s line ends early, expected %s",
                                          parser->name, describe_field(parser));
    return NULL;
}

static void report_bad_token(line_parser *parser, const char *token, size_t length,
                             const char *expected)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];

    parser->status = cairn_file_error_set(
        parser->fault, CAIRN_BAD_FORMAT, parser->path, parser->number, "%s is %s, expected %s",
        describe_field(parser), cairn_token_text(shown, token, length), expected);
}

static bool read_number(line_parser *parser, const char *field_name, int32_t field_index,
                        double *value)
{
    size_t length;
    const char *token = next_token(parser, field_name, field_index, &length);

    if (token == NULL)
        return false;
    if (!cairn_number_read(token, length, value)) {
        report_bad_token(parser, token, length, "a number");
        return false;
    }
    return true;
}

/* Reads finite numbers of bounded magnitude, so that they stay finite in float and in sums. */
static void read_finite(line_parser *parser, const char *field_name, double *value, int32_t count)
{
    int32_t i;

    for (i = 0; i < count; i++) {
        if (!read_number(parser, field_name, 0, &value[i]))
            return;
        if (!(fabs(value[i]) <= DBL_MAX))
            parser->status =
                cairn_file_error_set(parser->fault, CAIRN_NOT_FINITE, parser->path, parser->number,
                                     "%s is %g, expected a finite number", field_name, value[i]);
        else if (fabs(value[i]) > MAX_MAGNITUDE)
            parser->status = cairn_file_error_set(
                parser->fault, CAIRN_BAD_FORMAT, parser->path, parser->number,
                "%s is %g, expected a number up to %g", field_name, value[i], MAX_MAGNITUDE);
    }
}

/* Reads an integer from `least` to CAIRN_CARMEN_LOG_MAX_BEAMS. */
static void read_count(line_parser *parser, const char *field_name, int32_t least, int32_t *count)
{
    size_t length;
    const char *token = next_token(parser, field_name, 0, &length);
    char expected[64];
    int64_t value;

    if (token == NULL)
        return;
    if (cairn_number_read_integer(token, length, &value) && value >= least &&
        value <= CAIRN_CARMEN_LOG_MAX_BEAMS) {
        *count = (int32_t)value;
        return;
    }
    (void)snprintf(expected, sizeof expected, "a whole number from %d to %d", (int)least,
                   CAIRN_CARMEN_LOG_MAX_BEAMS);
    report_bad_token(parser, token, length, expected);
}

/* Reads "stamp host logger_stamp" and checks for the end of the line. */
static void read_tail(line_parser *parser, int64_t *stamp_ns)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    const char *token;
    double logger_stamp;
    size_t length;

    token = next_token(parser, "the stamp", 0, &length);
    if (token != NULL &&
        (!cairn_number_read_stamp(token, length, stamp_ns) || *stamp_ns > CAIRN_SCAN_MAX_STAMP_NS ||
         *stamp_ns < -CAIRN_SCAN_MAX_STAMP_NS))
        report_bad_token(parser, token, length, "seconds within 4e9");
    (void)next_token(parser, "the host", 0, &length);
    read_number(parser, "the logger's stamp", 0, &logger_stamp);
    length = cairn_token_next(&parser->at, parser->end, &token);
    if (parser->status == CAIRN_OK && length > 0)
        parser->status = cairn_file_error_set(
            parser->fault, CAIRN_BAD_FORMAT, parser->path, parser->number,
            "%s follows the last field of the %s message, expected its end: is the "
            "number of readings right?",
            cairn_token_text(shown, token, length), parser->name);
}

/* Parses the number of ranges and the ranges. */
static void read_ranges(line_parser *parser, cairn_carmen_log_message *message)
{
    double *grown;
    int32_t i;

    read_count(parser, "the number of readings", 1, &message->count);
    if (message->count > message->capacity) {
        grown = realloc(message->range, (size_t)message->count * sizeof *grown);
        if (grown == NULL) {
            parser->status = cairn_file_error_system(parser->fault, parser->path, "read", ENOMEM);
            return;
        }
        message->range = grown;
        message->capacity = message->count;
    }
    for (i = 0; i < message->count; i++)
        read_number(parser, "reading", i + 1, &message->range[i]);
}

static void read_poses(line_parser *parser, cairn_carmen_log_message *message)
{
    read_finite(parser, "the laser's pose", message->laser, 3);
    read_finite(parser, "the robot's pose", message->robot, 3);
}

/* Parses a FLASER message; its bearings follow from the number of ranges. */
static void read_flaser(line_parser *parser, cairn_carmen_log_message *message)
{
    int32_t steps;

    read_ranges(parser, message);
    read_poses(parser, message);
    read_tail(parser, &message->stamp_ns);
    steps = message->count % 2 == 0 ? message->count : message->count - 1;
    message->angle_min = steps == 0 ? 0 : -(double)CAIRN_PI / 2;
    message->angle_step = steps == 0 ? 0 : (double)CAIRN_PI / steps;
    message->range_max = 0;
}

/* Parses a ROBOTLASER1 message. */
static void read_robotlaser(line_parser *parser, cairn_carmen_log_message *message)
{
    /* laser_type start_angle field_of_view angular_resolution maximum_range accuracy
     * remission_mode */
    double scanner[7] = {0}, motion[5], value;
    int32_t remissions = 0, i;

    read_finite(parser, "the scanner's description", scanner, 7);
    read_ranges(parser, message);
    read_count(parser, "the number of remissions", 0, &remissions);
    for (i = 0; i < remissions; i++)
        read_number(parser, "remission", i + 1, &value);
    read_poses(parser, message);
    read_finite(parser, "the robot's motion", motion, 5);
    read_tail(parser, &message->stamp_ns);
    if (parser->status != CAIRN_OK)
        return;
    if (scanner[4] > (double)CAIRN_SCAN_EXTENT)
        parser->status =
            cairn_file_error_set(parser->fault, CAIRN_BAD_FORMAT, parser->path, parser->number,
                                 "the maximum range is %g, expected at most %g m", scanner[4],
                                 (double)CAIRN_SCAN_EXTENT);
    message->angle_min = scanner[1];
    message->angle_step = scanner[3];
    if (!(fabs(message->angle_step) > 0) && message->count > 1)
        message->angle_step = scanner[2] / (message->count - 1);
    message->range_max = fmax(scanner[4], 0);
}

/* Parses an ODOM message. */
static void read_odometry(line_parser *parser, cairn_carmen_log_message *message)
{
    double motion[3];

    read_finite(parser, "the robot's pose", message->robot, 3);
    read_finite(parser, "the robot's motion", motion, 3);
    read_tail(parser, &message->stamp_ns);
    memcpy(message->laser, message->robot, sizeof message->laser);
}

static bool is_name(const char *token, size_t length, const char *name)
{
    return length == strlen(name) && memcmp(token, name, length) == 0;
}

/* Reads a PARAM of the scanner's maximum range; other parameters, and values out of range, are
 * ignored. */
static void read_param(line_parser *parser, cairn_carmen_log_message *message)
{
    const char *token;
    size_t length = cairn_token_next(&parser->at, parser->end, &token);
    bool known = is_name(token, length, "robot_frontlaser_max") ||
                 is_name(token, length, "robot_front_laser_max");

    length = cairn_token_next(&parser->at, parser->end, &token);
    message->kind = CAIRN_MESSAGE_OTHER;
    if (known && cairn_number_read(token, length, &message->range_max) && message->range_max > 0 &&
        message->range_max <= (double)CAIRN_SCAN_EXTENT)
        message->kind = CAIRN_MESSAGE_PARAM;
}

typedef struct message_parser {
    const char *name;
    cairn_carmen_log_message_kind kind;
    void (*read)(line_parser *parser, cairn_carmen_log_message *message);
} message_parser;

/* Parsers of the known messages. */
static const message_parser message_parsers[] = {
    {"FLASER", CAIRN_MESSAGE_SCAN, read_flaser},
    {"ROBOTLASER1", CAIRN_MESSAGE_SCAN, read_robotlaser},
    {"ODOM", CAIRN_MESSAGE_ODOMETRY, read_odometry},
    {"PARAM", CAIRN_MESSAGE_OTHER, read_param}};

cairn_status cairn_carmen_log_message_read(cairn_carmen_log_message *message, const char *line,
                                           size_t length, const char *path, int64_t number,
                                           cairn_file_error *fault)
{
    line_parser parser = {.at = line,
                          .end = line + length,
                          .path = path,
                          .number = number,
                          .fault = fault,
                          .status = CAIRN_OK};
    const char *token;
    size_t name = cairn_token_next(&parser.at, parser.end, &token), i;

    message->count = 0;
    message->kind = name == 0 || token[0] == '#' ? CAIRN_MESSAGE_BLANK : CAIRN_MESSAGE_OTHER;
    for (i = 0; i < sizeof message_parsers / sizeof *message_parsers; i++)
        if (is_name(token, name, message_parsers[i].name)) {
            parser.name = message_parsers[i].name;
            message->kind = message_parsers[i].kind;
            message_parsers[i].read(&parser, message);
        }
    return parser.status;
}
