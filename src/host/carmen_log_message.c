/* One line of a CARMEN log, token by token. The first thing that is wrong ends the reading and is the fault. */
#include "src/core/build.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/number_text.h"
#include "src/host/carmen_log_message.h"
#include "src/host/carmen_log_reader.h"

/* m and rad, of poses, bearings and motions. */
#define LARGEST 1e9

typedef struct cursor {
    const char *at, *end;
    const char *path;
    int64_t number;
    const char *name; /* of the message */
    cairn_file_error *fault;
    cairn_status status;
} cursor;

/* What a token should have been; count > 0: "reading 17". */
typedef struct expected {
    const char *what;
    int32_t count;
} expected;

static const char *words(char text[64], expected e)
{
    if (e.count > 0)
        (void)snprintf(text, 64, "%s %d", e.what, (int)e.count);
    else
        (void)snprintf(text, 64, "%s", e.what);
    return text;
}

/* The next token; 0 and the fault when the line has ended. */
static size_t take(cursor *c, expected e, const char **token)
{
    char text[64];
    size_t length = cairn_token_next(&c->at, c->end, token);

    if (length == 0)
        c->status = cairn_file_error_set(c->fault, CAIRN_TRUNCATED, c->path, c->number,
                                         "the %s line ends early, expected %s", c->name, words(text, e));
    return length;
}

static int32_t refuse(cursor *c, expected e, const char *token, size_t length, const char *wanted)
{
    char text[64], shown[CAIRN_TOKEN_TEXT_BYTES];

    c->status = cairn_file_error_set(c->fault, CAIRN_BAD_FORMAT, c->path, c->number, "%s is %s, expected %s",
                                     words(text, e), cairn_token_text(shown, token, length), wanted);
    return 0;
}

static int32_t take_number(cursor *c, expected e, double *value)
{
    const char *token;
    size_t length = take(c, e, &token);

    if (length == 0)
        return 0;
    return cairn_number_read(token, length, value) ? 1 : refuse(c, e, token, length, "a number");
}

/* Numbers that are finite, and small enough to be so in float and after some arithmetic, too. */
static int32_t take_finite(cursor *c, const char *what, double *value, int32_t count)
{
    expected e = {what, 0};
    int32_t i;

    for (i = 0; i < count; i++) {
        if (!take_number(c, e, &value[i]))
            return 0;
        if (!(fabs(value[i]) <= DBL_MAX)) {
            c->status = cairn_file_error_set(c->fault, CAIRN_NOT_FINITE, c->path, c->number,
                                             "%s is %g, expected a finite number", what, value[i]);
            return 0;
        }
        if (fabs(value[i]) > LARGEST) {
            c->status = cairn_file_error_set(c->fault, CAIRN_BAD_FORMAT, c->path, c->number,
                                             "%s is %g, expected a number up to %g", what, value[i], LARGEST);
            return 0;
        }
    }
    return 1;
}

static int32_t take_count(cursor *c, const char *what, int32_t least, int32_t *count)
{
    expected e = {what, 0};
    const char *token;
    size_t length = take(c, e, &token);
    char wanted[64];
    int64_t value;

    if (length == 0)
        return 0;
    if (cairn_number_read_integer(token, length, &value) && value >= least && value <= CAIRN_CARMEN_BEAMS_MOST) {
        *count = (int32_t)value;
        return 1;
    }
    (void)snprintf(wanted, sizeof wanted, "a whole number from %d to %d", (int)least, CAIRN_CARMEN_BEAMS_MOST);
    return refuse(c, e, token, length, wanted);
}

/* "stamp host logger_stamp" and the end of the line. */
static int32_t take_tail(cursor *c, int64_t *stamp_ns)
{
    expected stamp = {"the stamp", 0}, host = {"the host", 0}, logger = {"the logger's stamp", 0};
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    const char *token;
    size_t length = take(c, stamp, &token);
    double logger_stamp;

    if (length == 0)
        return 0;
    if (!cairn_number_read_stamp(token, length, stamp_ns))
        return refuse(c, stamp, token, length, "seconds, at most 9223372036");
    if (take(c, host, &token) == 0 || !take_number(c, logger, &logger_stamp))
        return 0;
    length = cairn_token_next(&c->at, c->end, &token);
    if (length == 0)
        return 1;
    c->status = cairn_file_error_set(c->fault, CAIRN_BAD_FORMAT, c->path, c->number,
                                     "%s follows the last field of the %s message, expected its end: is the number of "
                                     "readings right?",
                                     cairn_token_text(shown, token, length), c->name);
    return 0;
}

static int32_t take_ranges(cursor *c, cairn_carmen_message *m)
{
    expected reading = {"reading", 0};
    double *grown;

    if (!take_count(c, "the number of readings", 1, &m->count))
        return 0;
    if (m->count > m->capacity) {
        grown = realloc(m->range, (size_t)m->count * sizeof *grown);
        if (grown == NULL) {
            c->status = cairn_file_error_system(c->fault, c->path, "read", ENOMEM);
            return 0;
        }
        m->range = grown;
        m->capacity = m->count;
    }
    for (reading.count = 1; reading.count <= m->count; reading.count++)
        if (!take_number(c, reading, &m->range[reading.count - 1]))
            return 0;
    return 1;
}

static int32_t take_poses(cursor *c, cairn_carmen_message *m)
{
    return take_finite(c, "the laser's pose", m->laser, 3) && take_finite(c, "the robot's pose", m->robot, 3);
}

static int32_t read_flaser(cursor *c, cairn_carmen_message *m)
{
    int32_t steps;

    if (!take_ranges(c, m) || !take_poses(c, m) || !take_tail(c, &m->stamp_ns))
        return 0;
    steps = m->count % 2 == 0 ? m->count : m->count - 1;
    m->angle_min = steps == 0 ? 0 : -(double)CAIRN_PI / 2;
    m->angle_step = steps == 0 ? 0 : (double)CAIRN_PI / steps;
    m->range_max = 0;
    return 1;
}

static int32_t read_robotlaser(cursor *c, cairn_carmen_message *m)
{
    expected remission = {"remission", 0};
    double scanner[7], motion[5], value;
    int32_t remissions;

    /* laser_type start_angle field_of_view angular_resolution maximum_range accuracy remission_mode */
    if (!take_finite(c, "the scanner's description", scanner, 7) || !take_ranges(c, m) ||
        !take_count(c, "the number of remissions", 0, &remissions))
        return 0;
    for (remission.count = 1; remission.count <= remissions; remission.count++)
        if (!take_number(c, remission, &value))
            return 0;
    if (!take_poses(c, m) || !take_finite(c, "the robot's motion", motion, 5) || !take_tail(c, &m->stamp_ns))
        return 0;
    if (scanner[4] > (double)CAIRN_SCAN_EXTENT) {
        c->status = cairn_file_error_set(c->fault, CAIRN_BAD_FORMAT, c->path, c->number,
                                         "the maximum range is %g, expected at most %g m", scanner[4],
                                         (double)CAIRN_SCAN_EXTENT);
        return 0;
    }
    m->angle_min = scanner[1];
    m->angle_step = scanner[3];
    if (!(fabs(m->angle_step) > 0) && m->count > 1)
        m->angle_step = scanner[2] / (m->count - 1);
    m->range_max = scanner[4] > 0 ? scanner[4] : 0;
    return 1;
}

static int32_t read_odometry(cursor *c, cairn_carmen_message *m)
{
    double motion[3];

    m->count = 0;
    if (!take_finite(c, "the robot's pose", m->robot, 3) || !take_finite(c, "the robot's motion", motion, 3) ||
        !take_tail(c, &m->stamp_ns))
        return 0;
    memcpy(m->laser, m->robot, sizeof m->laser);
    return 1;
}

static int is_name(const char *token, size_t length, const char *name)
{
    return length == strlen(name) && memcmp(token, name, length) == 0;
}

/* Only a limit that can be read matters; any other PARAM is none of ours. */
static void read_param(cursor *c, cairn_carmen_message *m)
{
    const char *token;
    size_t length = cairn_token_next(&c->at, c->end, &token);
    int known = is_name(token, length, "robot_frontlaser_max") || is_name(token, length, "robot_front_laser_max");

    length = cairn_token_next(&c->at, c->end, &token);
    m->kind = CAIRN_MESSAGE_OTHER;
    if (known && cairn_number_read(token, length, &m->range_max) && m->range_max > 0 &&
        m->range_max <= (double)CAIRN_SCAN_EXTENT)
        m->kind = CAIRN_MESSAGE_PARAM;
}

cairn_status cairn_carmen_message_read(cairn_carmen_message *message, const char *line, size_t length, const char *path,
                                       int64_t number, cairn_file_error *fault)
{
    cursor c = {line, line + length, path, number, "", fault, CAIRN_OK};
    cairn_carmen_message *m = message;
    const char *token;
    size_t name = cairn_token_next(&c.at, c.end, &token);

    m->kind = CAIRN_MESSAGE_OTHER;
    if (name == 0 || token[0] == '#') {
        m->kind = CAIRN_MESSAGE_BLANK;
    } else if (is_name(token, name, "FLASER")) {
        c.name = "FLASER";
        if (read_flaser(&c, m))
            m->kind = CAIRN_MESSAGE_SCAN;
    } else if (is_name(token, name, "ROBOTLASER1")) {
        c.name = "ROBOTLASER1";
        if (read_robotlaser(&c, m))
            m->kind = CAIRN_MESSAGE_SCAN;
    } else if (is_name(token, name, "ODOM")) {
        c.name = "ODOM";
        if (read_odometry(&c, m))
            m->kind = CAIRN_MESSAGE_ODOMETRY;
    } else if (is_name(token, name, "PARAM")) {
        read_param(&c, m);
    }
    return c.status;
}
