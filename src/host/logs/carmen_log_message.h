/* carmen_log_message: parser of one line of a CARMEN log. Internal to the host library; the formats
 * are in cairn/carmen_log.h. */
#ifndef CAIRN_HOST_CARMEN_LOG_MESSAGE_H
#define CAIRN_HOST_CARMEN_LOG_MESSAGE_H

#include "cairn/carmen_log.h"

/* The kind of a message. */
typedef int32_t cairn_carmen_log_message_kind;
enum {
    CAIRN_MESSAGE_BLANK = 0, /* a blank line or a comment */
    CAIRN_MESSAGE_SCAN = 1,
    CAIRN_MESSAGE_ODOMETRY = 2,
    CAIRN_MESSAGE_PARAM = 3, /* a PARAM of the scanner's maximum range: range_max */
    CAIRN_MESSAGE_OTHER = 4
};

/* A parsed message. */
typedef struct cairn_carmen_log_message {
    cairn_carmen_log_message_kind kind;
    int32_t count; /* ranges */
    double *range; /* [count] m, of [capacity]; on the heap, owned by the message */
    int32_t capacity;
    double angle_min, angle_step; /* rad */
    double range_max;             /* m, the scanner's maximum range by this message; 0: none */
    double laser[3], robot[3];    /* poses: m, m, rad */
    int64_t stamp_ns;
} cairn_carmen_log_message;

/* Parses line[0 .. length), line `number` of the file `path`. CAIRN_BAD_FORMAT, CAIRN_TRUNCATED,
 * CAIRN_NOT_FINITE: the line is malformed, and *fault says why; CAIRN_NO_MEMORY. The fault may be
 * NULL. */
CAIRN_CHECKED cairn_status cairn_carmen_log_message_read(cairn_carmen_log_message *message,
                                                         const char *line, size_t length,
                                                         const char *path, int64_t number,
                                                         cairn_file_error *fault);

#endif
