/* scan_correction: corrections of a scanner's set-up.
 *
 * Method: ranges are scaled, then limited; bearings are stretched about the middle of the field of
 * view, then mirrored; a sweep from the last beam to the first reverses the order of both.
 *
 * Limits: bearings are those of float, to 1e-7 rad, in both builds. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/scan_correction.h"

/* m: no scanner sees farther. Ranges in m whose limit is scaled beyond it keep their limit. */
static const cairn_real LONGEST_RANGE_M = 1000;

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

float cairn_scan_correction_bearing(const cairn_scan_input *scan, int32_t beam)
{
    return scan->angle != NULL ? scan->angle[beam]
                               : scan->angle_min + (float)beam * scan->angle_step;
}

/* The same as a number to calculate with. */
static cairn_real bearing_of(const cairn_scan_input *scan, int32_t beam)
{
    return (cairn_real)cairn_scan_correction_bearing(scan, beam);
}

cairn_real cairn_scan_correction_mean_step(const cairn_scan_input *scan)
{
    if (scan->count < 2)
        return 0;
    return (bearing_of(scan, scan->count - 1) - bearing_of(scan, 0)) /
           (cairn_real)(scan->count - 1);
}

cairn_real cairn_scan_correction_limit(cairn_real limit, cairn_real median, cairn_real scale)
{
    cairn_real scaled = limit * scale, scaled_median = median * scale;

    return scaled > scaled_median && (scaled <= LONGEST_RANGE_M || limit <= scaled_median) ? scaled
                                                                                           : limit;
}

/* Corrects a range; scaled invalid readings stay invalid. */
static float correct_range(const cairn_scan_correction *correction, float range)
{
    cairn_real scaled = (cairn_real)range * correction->range_scale;

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

void cairn_scan_correction_apply(const cairn_scan_correction *correction, cairn_scan_input *scan,
                                 float *range, float *angle)
{
    const int32_t count = scan->count;
    cairn_real step = cairn_abs(cairn_scan_correction_mean_step(scan)),
               stretch = correction->angle_step > 0 && step > 0 ? correction->angle_step / step : 1,
               sense = correction->flips ? -1 : 1,
               middle = CAIRN_REAL(0.5) * (bearing_of(scan, 0) + bearing_of(scan, count - 1));

    for (int32_t i = 0; i < count; i++) {
        cairn_real bearing = bearing_of(scan, i);

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
        scan->range_min = (float)((cairn_real)scan->range_min * correction->range_scale);
        scan->range_max = (float)((cairn_real)scan->range_max * correction->range_scale);
    }
    if (correction->range_max > 0)
        scan->range_max = (float)correction->range_max;
    if (correction->sweep != 0 && count > 1)
        scan->time_step = (float)(cairn_abs(correction->sweep) / (cairn_real)(count - 1));
    if (correction->has_sensor)
        scan->base_sensor = correction->base_sensor;
}
