/* Corrections of all scans of a log. */
#include "src/base/build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/logs/scan_log_correction.h"

static size_t count_beams(const cairn_carmen_log_scans *scans)
{
    size_t beams = 0;

    for (int32_t i = 0; i < scans->count; i++)
        beams += (size_t)scans->record[i].count;
    return beams;
}

cairn_status cairn_scan_log_correct(cairn_scan_log *log, const cairn_scan_correction *correction)
{
    cairn_carmen_log_scans *scans = &log->scans;
    size_t beams = count_beams(scans);
    float *corrected, *at;

    if (cairn_scan_correction_is_none(correction))
        return CAIRN_OK;
    at = corrected = malloc((2 * beams + 1) * sizeof *corrected);
    if (corrected == NULL)
        return CAIRN_NO_MEMORY;
    for (int32_t i = 0; i < scans->count; i++) {
        cairn_carmen_log_record *record = &scans->record[i];

        cairn_scan_correction_apply(correction, &record->scan, at, at + record->count);
        record->range = at;
        if (correction->has_sensor)
            record->laser = cairn_pose_compose(record->robot, correction->base_sensor);
        at += 2 * (size_t)record->count;
    }
    free(scans->range);
    scans->range = corrected;
    if (correction->range_scale != 1)
        scans->info.range_max *= (double)correction->range_scale;
    if (correction->range_max > 0)
        scans->info.range_max = (double)correction->range_max;
    if (correction->has_sensor) {
        scans->info.fixed_mounting = 1;
        scans->info.base_sensor = correction->base_sensor;
    }
    return CAIRN_OK;
}

static int compare_floats(const void *a, const void *b)
{
    float first = *(const float *)a, second = *(const float *)b;

    return (first > second) - (first < second);
}

cairn_status cairn_scan_log_quartiles(const cairn_scan_log *log, double quartile[3])
{
    const cairn_carmen_log_scans *scans = &log->scans;
    float *range = malloc((count_beams(scans) + 1) * sizeof *range);
    size_t count = 0;

    memset(quartile, 0, 3 * sizeof *quartile);
    if (range == NULL)
        return CAIRN_NO_MEMORY;
    for (int32_t i = 0; i < scans->count; i++)
        for (int32_t k = 0; k < scans->record[i].count; k++)
            if (scans->record[i].range[k] > 0 && isfinite(scans->record[i].range[k]))
                range[count++] = scans->record[i].range[k];
    qsort(range, count, sizeof *range, compare_floats);
    for (size_t i = 0; i < 3 && count > 0; i++)
        quartile[i] = (double)range[(i + 1) * (count - 1) / 4];
    free(range);
    return CAIRN_OK;
}
