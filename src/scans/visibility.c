/* visibility: visibility profile of a scan: ranges by bearing, and the observation at a point.
 *
 * Method:
 * 1. A beam enters its bin and the bins of a small gap to the beam before; a bin keeps the least
 *    range.
 * 2. A point is compared with the range of its bin, and of both bins beside it where the rule says
 *    so. Squared distances are compared, without a square root.
 *    - Free: nearer than the least of these ranges by the clearance.
 *    - Back face: beyond the range of its bin, with a normal away from the sensor.
 *    - Surface: at one of these ranges, or between them and its own when the surface is closed.
 *    - Behind: all else.
 *
 * Limits: one range a bin: of two surfaces in a bin the farther one is hidden. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/visibility.h"

extern inline int32_t cairn_visibility_bin(cairn_vec2 direction, int32_t bins);
extern inline cairn_real cairn_visibility_range(const cairn_visibility *visibility, int32_t bin);
extern inline cairn_visibility_answer cairn_visibility_query_bin(const cairn_visibility *visibility,
                                                                 int32_t bin, cairn_vec2 ray,
                                                                 cairn_vec2 normal,
                                                                 const cairn_visibility_rule *rule);

cairn_vec2 cairn_visibility_direction(int32_t bin, int32_t bins)
{
    cairn_real turn = 4 * ((cairn_real)bin + CAIRN_REAL(0.5)) / (cairn_real)bins;
    cairn_vec2 p;

    p.x = cairn_abs(turn - 2) - 1;
    p.y = turn < 2 ? 1 - cairn_abs(p.x) : cairn_abs(p.x) - 1;
    return cairn_vec2_unit(p);
}

/* ---- Beams ---- */

void cairn_visibility_clear(cairn_visibility *visibility, cairn_vec2 sensor)
{
    visibility->sensor = sensor;
    visibility->last = -1;
    memset(visibility->range, 0, (size_t)visibility->bins * sizeof *visibility->range);
    if (visibility->surface != NULL)
        memset(visibility->surface, CAIRN_VISIBILITY_NO_SURFACE, (size_t)visibility->bins);
}

/* A range in steps, >= 1. */
static uint16_t steps_of(const cairn_visibility *visibility, cairn_real range)
{
    cairn_real share = cairn_min(range / (visibility->step * CAIRN_VISIBILITY_STEPS), 1);

    return (uint16_t)cairn_real_to_int(cairn_max(1, share * CAIRN_VISIBILITY_STEPS));
}

void cairn_visibility_add(cairn_visibility *visibility, cairn_vec2 ray, uint8_t surface)
{
    cairn_real range = cairn_vec2_norm(ray);
    int32_t mask = visibility->bins - 1, bin = cairn_visibility_bin(ray, visibility->bins),
            first = bin, end = bin + 1;
    uint16_t steps;

    if (!(range > 0)) {
        visibility->last = -1;
        return;
    }
    steps = steps_of(visibility, range);
    if (visibility->last >= 0) {
        int32_t before = (bin - visibility->last) & mask, behind = (visibility->last - bin) & mask;

        if (before > 0 && before <= visibility->max_gap)
            first = end - before;
        else if (behind > 0 && behind <= visibility->max_gap)
            end = first + behind;
    }
    for (int32_t k = first; k < end; k++) {
        uint16_t *least = &visibility->range[k & mask];

        if (*least != 0 && *least <= steps)
            continue;
        *least = steps;
        if (visibility->surface != NULL)
            visibility->surface[k & mask] = surface;
    }
    visibility->last = bin;
}

void cairn_visibility_fill(cairn_visibility *visibility, cairn_vec2 sensor,
                           const cairn_scan_beam *beams, int32_t count)
{
    const cairn_vec2 unknown = {0, 0};

    cairn_visibility_clear(visibility, sensor);
    for (int32_t i = 0; i < count; i++)
        cairn_visibility_add(visibility,
                             beams[i].kind == CAIRN_SCAN_BEAM_UNKNOWN
                                 ? unknown
                                 : cairn_vec2_sub(beams[i].to, sensor),
                             CAIRN_VISIBILITY_NO_SURFACE);
}
