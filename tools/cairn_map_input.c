/* Reads logs of any format and concatenates them. */
#include "tools/cairn_map_input.h"

#include <stdlib.h>
#include <string.h>

/* Moves the records of all logs into one array. 0 when there is no memory. */
static int join(map_input *input)
{
    int64_t count = 0;

    for (int32_t i = 0; i < input->log_count; i++)
        count += input->log[i].log.scans.count;
    input->record = count <= INT32_MAX ? malloc(((size_t)count + 1) * sizeof *input->record) : NULL;
    if (input->record == NULL)
        return 0;
    for (int32_t i = 0; i < input->log_count; i++) {
        map_log *log = &input->log[i];
        const cairn_carmen_log_scans *scans = &log->log.scans;

        log->first = input->count;
        memcpy(&input->record[input->count], scans->record,
               (size_t)scans->count * sizeof *input->record);
        input->count += scans->count;
        input->beams_most =
            scans->info.max_beams > input->beams_most ? scans->info.max_beams : input->beams_most;
        input->has_odometry |= log->log.has_odometry;
        input->faults += scans->info.faults;
        input->stamps_back += scans->info.backward_stamps;
    }
    return 1;
}

int map_input_load(map_input *input, const char *const *path, int32_t count,
                   const tool_log_options *options)
{
    int code = TOOL_OK;

    memset(input, 0, sizeof *input);
    while (code == TOOL_OK && input->log_count < count) {
        map_log *log = &input->log[input->log_count];

        log->path = path[input->log_count];
        code = tool_load(&log->log, log->path, options);
        input->log_count += code == TOOL_OK;
    }
    if (code == TOOL_OK && !join(input)) {
        (void)options_refuse("cairn map", "no memory for the scans of %d logs", (int)count);
        code = TOOL_FAILED;
    }
    if (code != TOOL_OK)
        map_input_free(input);
    return code;
}

int map_input_correct(map_input *input, const cairn_scan_correction *correction)
{
    for (int32_t i = 0; i < input->log_count; i++) {
        cairn_scan_log *log = &input->log[i].log;

        if (cairn_scan_log_correct(log, correction) != CAIRN_OK)
            return 0;
        memcpy(&input->record[input->log[i].first], log->scans.record,
               (size_t)log->scans.count * sizeof *input->record);
    }
    return 1;
}

void map_input_free(map_input *input)
{
    for (int32_t i = 0; i < input->log_count; i++)
        cairn_scan_log_free(&input->log[i].log);
    free(input->record);
    memset(input, 0, sizeof *input);
}

const map_log *map_input_log(const map_input *input, int32_t scan)
{
    int32_t i = input->log_count - 1;

    while (i > 0 && input->log[i].first > scan)
        i--;
    return &input->log[i];
}

const cairn_pose *map_input_odometry(const map_input *input, int32_t scan)
{
    const map_log *log = map_input_log(input, scan);

    if (!log->log.has_odometry || (scan > 0 && scan == log->first))
        return NULL;
    return &input->record[scan].robot;
}
