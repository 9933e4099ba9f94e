/* Corrections of a log's scanner. */
#include "src/base/build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/logs/scan_correction.h"

/* m: no scanner sees farther. A log in m whose limit is scaled beyond it keeps its limit. */
static const double LONGEST_RANGE_M = 1000;

cairn_scan_correction cairn_scan_correction_none(void)
{
    cairn_scan_correction none;

    memset(&none, 0, sizeof none);
    none.range_scale = 1;
    none.base_sensor = cairn_pose_identity();
    return none;
}

int32_t cairn_scan_correction_is_none(const cairn_scan_correction *correction)
{
    return correction->range_scale == 1 && !(correction->range_max > 0) &&
           !(correction->angle_step > 0) && correction->sweep == 0 && !correction->flips &&
           !correction->has_sensor;
}

float cairn_scan_bearing(const cairn_scan_input *scan, int32_t beam)
{
    return scan->angle != NULL ? scan->angle[beam]
                               : scan->angle_min + (float)beam * scan->angle_step;
}

double cairn_scan_mean_step(const cairn_scan_input *scan)
{
    if (scan->count < 2)
        return 0;
    return ((double)cairn_scan_bearing(scan, scan->count - 1) -
            (double)cairn_scan_bearing(scan, 0)) /
           (scan->count - 1);
}

/* Corrects a range; scaled invalid readings stay invalid. */
static float correct_range(const cairn_scan_correction *correction, float range)
{
    double scaled = (double)range * correction->range_scale;

    return correction->range_max > 0 && scaled >= correction->range_max ? INFINITY : (float)scaled;
}

static void reverse(float *value, int32_t count)
{
    for (int32_t i = 0; i < count / 2; i++) {
        float kept = value[i];

        value[i] = value[count - 1 - i];
        value[count - 1 - i] = kept;
    }
}

void cairn_scan_correct(const cairn_scan_correction *correction, cairn_scan_input *scan,
                        float *range, float *angle)
{
    const int32_t count = scan->count;
    double step = fabs(cairn_scan_mean_step(scan)),
           stretch = correction->angle_step > 0 && step > 0 ? correction->angle_step / step : 1,
           sense = correction->flips ? -1 : 1;
    double middle =
        0.5 * ((double)cairn_scan_bearing(scan, 0) + (double)cairn_scan_bearing(scan, count - 1));

    for (int32_t i = 0; i < count; i++) {
        double bearing = (double)cairn_scan_bearing(scan, i);

        range[i] = correct_range(correction, scan->range[i]);
        angle[i] =
            (float)(sense * (stretch == 1 ? bearing : middle + stretch * (bearing - middle)));
    }
    if (correction->sweep < 0 && count > 1) {
        reverse(range, count);
        reverse(angle, count);
    }
    scan->range = range;
    scan->angle = angle;
    if (correction->range_scale != 1) {
        scan->range_min = (float)((double)scan->range_min * correction->range_scale);
        scan->range_max = (float)((double)scan->range_max * correction->range_scale);
    }
    if (correction->range_max > 0)
        scan->range_max = (float)correction->range_max;
    if (correction->sweep != 0 && count > 1)
        scan->time_step = (float)(fabs(correction->sweep) / (count - 1));
    if (correction->has_sensor)
        scan->base_sensor = correction->base_sensor;
}

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

        cairn_scan_correct(correction, &record->scan, at, at + record->count);
        record->range = at;
        if (correction->has_sensor)
            record->laser = cairn_pose_compose(record->robot, correction->base_sensor);
        at += 2 * (size_t)record->count;
    }
    free(scans->range);
    scans->range = corrected;
    if (correction->range_scale != 1)
        scans->info.range_max *= correction->range_scale;
    if (correction->range_max > 0)
        scans->info.range_max = correction->range_max;
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

double cairn_scan_correction_limit(double limit, double median, double scale)
{
    double scaled = limit * scale, scaled_median = median * scale;

    return scaled > scaled_median && (scaled <= LONGEST_RANGE_M || limit <= scaled_median) ? scaled
                                                                                           : limit;
}
