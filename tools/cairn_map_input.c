/* Reads logs of any format and concatenates them. */
#include "tools/cairn_map_input.h"

#include <stdlib.h>
#include <string.h>

#include "cairn/range_table.h"
#include "tools/cairn_tool.h"

static int load_log(map_log *log, double range_max, int32_t quiet)
{
    cairn_carmen_log_params params = cairn_carmen_log_default();
    tool_faults faults = {0, quiet};
    cairn_range_table_kind kind;
    cairn_file_error error;
    cairn_status status;

    params.range_max = range_max;
    params.on_fault = tool_on_fault;
    params.context = &faults;
    status = cairn_range_table_find_kind(&kind, log->path, &error);
    if (status != CAIRN_OK)
        return tool_report(&error);
    log->has_odometry = 1;
    if (kind == CAIRN_RANGE_TABLE_NONE)
        status = cairn_carmen_log_load(&log->scans, log->path, &params, &error);
    else
        status = cairn_range_table_load(&log->scans, &log->has_odometry, log->path, kind, &params,
                                        &error);
    tool_faults_end(&faults);
    tool_tell_origin(log->path, &log->scans.info, quiet || status != CAIRN_OK);
    return status == CAIRN_OK ? TOOL_OK : tool_report(&error);
}

/* Moves the records of all logs into one array. 0 when there is no memory. */
static int join(map_input *input)
{
    int64_t count = 0;

    for (int32_t i = 0; i < input->log_count; i++)
        count += input->log[i].scans.count;
    input->record = count <= INT32_MAX ? malloc(((size_t)count + 1) * sizeof *input->record) : NULL;
    if (input->record == NULL)
        return 0;
    for (int32_t i = 0; i < input->log_count; i++) {
        map_log *log = &input->log[i];
        const cairn_carmen_log_summary *info = &log->scans.info;

        log->first = input->count;
        memcpy(&input->record[input->count], log->scans.record,
               (size_t)log->scans.count * sizeof *input->record);
        input->count += log->scans.count;
        input->beams_most =
            info->max_beams > input->beams_most ? info->max_beams : input->beams_most;
        input->has_odometry |= log->has_odometry;
        input->faults += info->faults;
        input->stamps_back += info->backward_stamps;
    }
    return 1;
}

int map_input_load(map_input *input, const char *const *path, int32_t count, double range_max,
                   int32_t quiet)
{
    int code = TOOL_OK;

    memset(input, 0, sizeof *input);
    while (code == TOOL_OK && input->log_count < count) {
        map_log *log = &input->log[input->log_count];

        log->path = path[input->log_count];
        code = load_log(log, range_max, quiet);
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

void map_input_free(map_input *input)
{
    for (int32_t i = 0; i < input->log_count; i++)
        cairn_carmen_log_scans_free(&input->log[i].scans);
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

    if (!log->has_odometry || (scan > 0 && scan == log->first))
        return NULL;
    return &input->record[scan].robot;
}
