/* scan_match: visibility profiles: free range by bearing, and tests of points against them.
 *
 * Bearings are pseudo angles y / (|x| + |y|), which grow with the angle and need no arc tangent. A
 * bin holds the least range of its beams. A point is compared with its bin and both neighbours, so
 * that a grazing beam that passes beyond a wall's end does not put the wall into free space. */
#include "src/base/build.h"

#include "src/scans/scan_match_work.h"

static int32_t bearing_bin(cairn_vec2 d)
{
    cairn_real sum = cairn_abs(d.x) + cairn_abs(d.y), turn; /* 0 ... 4 */

    if (!(sum > 0))
        return 0;
    turn = d.x >= 0 ? (d.y >= 0 ? d.y / sum : 4 + d.y / sum) : 2 - d.y / sum;
    return cairn_real_to_int(turn / 4 * SCAN_MATCH_PROFILE_BINS) & (SCAN_MATCH_PROFILE_BINS - 1);
}

void cairn_scan_match_profile_clear(scan_match_visibility_profile *profile, cairn_vec2 sensor)
{
    profile->sensor = sensor;
    for (int32_t i = 0; i < SCAN_MATCH_PROFILE_BINS; i++)
        profile->range[i] = -1;
}

void cairn_scan_match_profile_add(scan_match_visibility_profile *profile, cairn_vec2 to)
{
    cairn_vec2 d = cairn_vec2_sub(to, profile->sensor);
    float *range = &profile->range[bearing_bin(d)], seen = (float)cairn_vec2_norm(d);

    if (*range < 0 || seen < *range)
        *range = seen;
}

int32_t cairn_scan_match_profile_lookup(const scan_match_visibility_profile *profile, cairn_vec2 p,
                                        cairn_real margin)
{
    cairn_vec2 d = cairn_vec2_sub(p, profile->sensor);
    int32_t bin = bearing_bin(d), ends = 0;
    cairn_real distance = cairn_vec2_norm(d), least = CAIRN_REAL_MAX;

    if (profile->range[bin] < 0)
        return 0;
    margin += CAIRN_REAL(0.01) * distance;
    for (int32_t k = -1; k <= 1; k++) {
        cairn_real range = (cairn_real)profile->range[(bin + k) & (SCAN_MATCH_PROFILE_BINS - 1)];

        if (range < 0)
            continue;
        least = cairn_min(least, range);
        ends |= cairn_abs(range - distance) <= margin;
    }
    if (distance < least - margin)
        return 1;
    return ends ? -1 : 0;
}
