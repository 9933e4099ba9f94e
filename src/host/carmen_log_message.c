/* One line of a CARMEN log, token by token. The first thing that is wrong is the fault; what is
 * taken after it is nothing. */
#include "src/core/build.h"

#include <errno.h>
#include <stdbool.h>
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
    const char *wanted; /* what the token at hand should be, ... */
    int32_t index;      /* "reading 17"; 0: there is but one */
    char words[64];     /* ... in words */
} cursor;

static const char *words(cursor *c)
{
    if (c->index > 0)
        (void)snprintf(c->words, sizeof c->words, "%s %d", c->wanted, (int)c->index);
    else
        (void)snprintf(c->words, sizeof c->words, "%s", c->wanted);
    return c->words;
}

/* The next token; NULL when the line is faulty, or ends here, which then is the fault. */
static const char *take(cursor *c, const char *wanted, int32_t index, size_t *length)
{
    const char *token;

    if (c->status != CAIRN_OK)
        return NULL;
    c->wanted = wanted;
    c->index = index;
    *length = cairn_token_next(&c->at, c->end, &token);
    if (*length > 0)
        return token;
    c->status = cairn_file_error_set(c->fault, CAIRN_TRUNCATED, c->path, c->number,
                                     "the %s line ends early, expected %s", c->name, words(c));
    return NULL;
}

static void refuse(cursor *c, const char *token, size_t length, const char *expected)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];

    c->status = cairn_file_error_set(c->fault, CAIRN_BAD_FORMAT, c->path, c->number,
                                     "%s is %s, expected %s", words(c),
                                     cairn_token_text(shown, token, length), expected);
}

static bool take_number(cursor *c, const char *wanted, int32_t index, double *value)
{
    size_t length;
    const char *token = take(c, wanted, index, &length);

    if (token == NULL)
        return false;
    if (!cairn_number_read(token, length, value)) {
        refuse(c, token, length, "a number");
        return false;
    }
    return true;
}

/* Numbers that are finite, and small enough to be so in float and after some arithmetic, too. */
static void take_finite(cursor *c, const char *wanted, double *value, int32_t count)
{
    int32_t i;

    for (i = 0; i < count; i++) {
        if (!take_number(c, wanted, 0, &value[i]))
            return;
        if (!(fabs(value[i]) <= DBL_MAX))
            c->status =
                cairn_file_error_set(c->fault, CAIRN_NOT_FINITE, c->path, c->number,
                                     "%s is %g, expected a finite number", wanted, value[i]);
        else if (fabs(value[i]) > LARGEST)
            c->status = cairn_file_error_set(c->fault, CAIRN_BAD_FORMAT, c->path, c->number,
                                             "%s is %g, expected a number up to %g", wanted,
                                             value[i], LARGEST);
    }
}

static void take_count(cursor *c, const char *wanted, int32_t least, int32_t *count)
{
    size_t length;
    const char *token = take(c, wanted, 0, &length);
    char expected[64];
    int64_t value;

    if (token == NULL)
        return;
    if (cairn_number_read_integer(token, length, &value) && value >= least &&
        value <= CAIRN_CARMEN_BEAMS_MOST) {
        *count = (int32_t)value;
        return;
    }
    (void)snprintf(expected, sizeof expected, "a whole number from %d to %d", (int)least,
                   CAIRN_CARMEN_BEAMS_MOST);
    refuse(c, token, length, expected);
}

/* "stamp host logger_stamp" and the end of the line. */
static void take_tail(cursor *c, int64_t *stamp_ns)
{
    char shown[CAIRN_TOKEN_TEXT_BYTES];
    const char *token;
    double logger_stamp;
    size_t length;

    token = take(c, "the stamp", 0, &length);
    if (token != NULL && !cairn_number_read_stamp(token, length, stamp_ns))
        refuse(c, token, length, "seconds, at most 9223372036");
    (void)take(c, "the host", 0, &length);
    take_number(c, "the logger's stamp", 0, &logger_stamp);
    length = cairn_token_next(&c->at, c->end, &token);
    if (c->status == CAIRN_OK && length > 0)
        c->status = cairn_file_error_set(
            c->fault, CAIRN_BAD_FORMAT, c->path, c->number,
            "%s follows the last field of the %s message, expected its end: is the "
            "number of readings right?",
            cairn_token_text(shown, token, length), c->name);
}

static void take_ranges(cursor *c, cairn_carmen_message *m)
{
    double *grown;
    int32_t i;

    take_count(c, "the number of readings", 1, &m->count);
    if (m->count > m->capacity) {
        grown = realloc(m->range, (size_t)m->count * sizeof *grown);
        if (grown == NULL) {
            c->status = cairn_file_error_system(c->fault, c->path, "read", ENOMEM);
            return;
        }
        m->range = grown;
        m->capacity = m->count;
    }
    for (i = 0; i < m->count; i++)
        take_number(c, "reading", i + 1, &m->range[i]);
}

static void take_poses(cursor *c, cairn_carmen_message *m)
{
    take_finite(c, "the laser's pose", m->laser, 3);
    take_finite(c, "the robot's pose", m->robot, 3);
}

static void read_flaser(cursor *c, cairn_carmen_message *m)
{
    int32_t steps;

    take_ranges(c, m);
    take_poses(c, m);
    take_tail(c, &m->stamp_ns);
    steps = m->count % 2 == 0 ? m->count : m->count - 1;
    m->angle_min = steps == 0 ? 0 : -(double)CAIRN_PI / 2;
    m->angle_step = steps == 0 ? 0 : (double)CAIRN_PI / steps;
    m->range_max = 0;
}

static void read_robotlaser(cursor *c, cairn_carmen_message *m)
{
    /* laser_type start_angle field_of_view angular_resolution maximum_range accuracy
     * remission_mode */
    double scanner[7] = {0}, motion[5], value;
    int32_t remissions = 0, i;

    take_finite(c, "the scanner's description", scanner, 7);
    take_ranges(c, m);
    take_count(c, "the number of remissions", 0, &remissions);
    for (i = 0; i < remissions; i++)
        take_number(c, "remission", i + 1, &value);
    take_poses(c, m);
    take_finite(c, "the robot's motion", motion, 5);
    take_tail(c, &m->stamp_ns);
    if (c->status != CAIRN_OK)
        return;
    if (scanner[4] > (double)CAIRN_SCAN_EXTENT)
        c->status = cairn_file_error_set(c->fault, CAIRN_BAD_FORMAT, c->path, c->number,
                                         "the maximum range is %g, expected at most %g m",
                                         scanner[4], (double)CAIRN_SCAN_EXTENT);
    m->angle_min = scanner[1];
    m->angle_step = scanner[3];
    if (!(fabs(m->angle_step) > 0) && m->count > 1)
        m->angle_step = scanner[2] / (m->count - 1);
    m->range_max = fmax(scanner[4], 0);
}

static void read_odometry(cursor *c, cairn_carmen_message *m)
{
    double motion[3];

    take_finite(c, "the robot's pose", m->robot, 3);
    take_finite(c, "the robot's motion", motion, 3);
    take_tail(c, &m->stamp_ns);
    memcpy(m->laser, m->robot, sizeof m->laser);
}

static bool is_name(const char *token, size_t length, const char *name)
{
    return length == strlen(name) && memcmp(token, name, length) == 0;
}

/* Only a limit that can be read matters; any other PARAM is none of ours. */
static void read_param(cursor *c, cairn_carmen_message *m)
{
    const char *token;
    size_t length = cairn_token_next(&c->at, c->end, &token);
    bool known = is_name(token, length, "robot_frontlaser_max") ||
                 is_name(token, length, "robot_front_laser_max");

    length = cairn_token_next(&c->at, c->end, &token);
    m->kind = CAIRN_MESSAGE_OTHER;
    if (known && cairn_number_read(token, length, &m->range_max) && m->range_max > 0 &&
        m->range_max <= (double)CAIRN_SCAN_EXTENT)
        m->kind = CAIRN_MESSAGE_PARAM;
}

typedef struct message_reader {
    const char *name;
    cairn_carmen_message_kind kind;
    void (*read)(cursor *c, cairn_carmen_message *m);
} message_reader;

static const message_reader readers[] = {{"FLASER", CAIRN_MESSAGE_SCAN, read_flaser},
                                         {"ROBOTLASER1", CAIRN_MESSAGE_SCAN, read_robotlaser},
                                         {"ODOM", CAIRN_MESSAGE_ODOMETRY, read_odometry},
                                         {"PARAM", CAIRN_MESSAGE_OTHER, read_param}};

cairn_status cairn_carmen_message_read(cairn_carmen_message *message, const char *line,
                                       size_t length, const char *path, int64_t number,
                                       cairn_file_error *fault)
{
    cursor c = {.at = line,
                .end = line + length,
                .path = path,
                .number = number,
                .fault = fault,
                .status = CAIRN_OK};
    const char *token;
    size_t name = cairn_token_next(&c.at, c.end, &token), i;

    message->count = 0;
    message->kind = name == 0 || token[0] == '#' ? CAIRN_MESSAGE_BLANK : CAIRN_MESSAGE_OTHER;
    for (i = 0; i < sizeof readers / sizeof *readers; i++)
        if (is_name(token, name, readers[i].name)) {
            c.name = readers[i].name;
            message->kind = readers[i].kind;
            readers[i].read(&c, message);
        }
    return c.status;
}
