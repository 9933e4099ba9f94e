/* Summary of loaded scans. */
#include "src/base/build.h"

#include <math.h>

#include "src/host/logs/carmen_log_summary.h"

/* Adds a record; previous: the record before, or NULL. */
static void add_record(cairn_carmen_log_summary *info, const cairn_carmen_log_record *record,
                       const cairn_carmen_log_record *previous)
{
    if (previous == NULL) {
        info->first_ns = info->earliest_ns = info->latest_ns = record->stamp_ns;
        info->min_beams = info->max_beams = record->count;
    } else {
        cairn_pose step = cairn_pose_between(previous->robot, record->robot);

        info->backward_stamps += record->stamp_ns < previous->stamp_ns;
        info->odometry_length += hypot((double)step.x, (double)step.y);
        info->odometry_turn += fabs((double)step.theta);
    }
    info->last_ns = record->stamp_ns;
    info->earliest_ns = record->stamp_ns < info->earliest_ns ? record->stamp_ns : info->earliest_ns;
    info->latest_ns = record->stamp_ns > info->latest_ns ? record->stamp_ns : info->latest_ns;
    info->min_beams = record->count < info->min_beams ? record->count : info->min_beams;
    info->max_beams = record->count > info->max_beams ? record->count : info->max_beams;
    info->beams += record->count;
}

void cairn_carmen_log_summarize(cairn_carmen_log_scans *scans)
{
    cairn_carmen_log_summary *info = &scans->info;

    info->scans = scans->count;
    info->beams = 0;
    info->backward_stamps = 0;
    info->odometry_length = 0;
    info->odometry_turn = 0;
    for (int32_t i = 0; i < scans->count; i++)
        add_record(info, &scans->record[i], i > 0 ? &scans->record[i - 1] : NULL);
}
