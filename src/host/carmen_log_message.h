/* carmen_log_message: one line of a CARMEN log. Internal to the host library; the formats are in
 * cairn/carmen_log.h. */
#ifndef CAIRN_HOST_CARMEN_LOG_MESSAGE_H
#define CAIRN_HOST_CARMEN_LOG_MESSAGE_H

#include "cairn/carmen_log.h"

typedef int32_t cairn_carmen_message_kind;
enum {
    CAIRN_MESSAGE_BLANK = 0, /* nothing, or a comment */
    CAIRN_MESSAGE_SCAN = 1,
    CAIRN_MESSAGE_ODOMETRY = 2,
    CAIRN_MESSAGE_PARAM = 3, /* one that tells the scanner's limit: range_max */
    CAIRN_MESSAGE_OTHER = 4
};

/* Numbers as they stand in the line. */
typedef struct cairn_carmen_message {
    cairn_carmen_message_kind kind;
    int32_t count;
    double *range; /* [count] of [capacity]; from the heap, the message's own */
    int32_t capacity;
    double angle_min, angle_step;
    double range_max; /* what the message says about the scanner's limit; 0: nothing */
    double laser[3], robot[3];
    int64_t stamp_ns;
} cairn_carmen_message;

/* Reads line[0 .. length), the line `number` of `path`. CAIRN_BAD_FORMAT, CAIRN_TRUNCATED,
 * CAIRN_NOT_FINITE and the fault: the line is damaged; CAIRN_NO_MEMORY. The fault may be NULL. */
CAIRN_CHECKED cairn_status cairn_carmen_message_read(cairn_carmen_message *message,
                                                     const char *line, size_t length,
                                                     const char *path, int64_t number,
                                                     cairn_file_error *fault);

#endif
