/* Input of cairn map: several logs concatenated. */
#ifndef CAIRN_TOOLS_CAIRN_MAP_INPUT_H
#define CAIRN_TOOLS_CAIRN_MAP_INPUT_H

#include "tools/cairn_tool.h"

enum { MAP_MAX_LOGS = 64 };

typedef struct map_log {
    const char *path;
    cairn_scan_log log; /* its records are copied to map_input.record */
    int32_t first;      /* index of its first scan among all */
} map_log;

typedef struct map_input {
    map_log log[MAP_MAX_LOGS];
    int32_t log_count;
    cairn_carmen_log_record *record; /* [count] of all logs */
    int32_t count;
    int32_t beams_most;
    int32_t has_odometry; /* 1: at least one log has odometry */
    int64_t faults, stamps_back;
} map_input;

/* Reads logs of any format and prints their faults. TOOL_OK, or another exit code after a line on
 * standard error; then there is nothing to free. */
int map_input_load(map_input *input, const char *const *path, int32_t count,
                   const tool_log_options *options);
void map_input_free(map_input *input);

/* Corrects all scans of all logs. 0: no memory; then some may be corrected. */
int map_input_correct(map_input *input, const cairn_scan_correction *correction);

/* The log of a scan. */
const map_log *map_input_log(const map_input *input, int32_t scan);

/* Returns the odometry pose of a scan; NULL: its log has none, or the scan is the first of a
 * further log, whose odometry starts in a new frame. */
const cairn_pose *map_input_odometry(const map_input *input, int32_t scan);

#endif
