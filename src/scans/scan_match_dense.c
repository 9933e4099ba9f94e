/* scan_match: surface points at full resolution: the ends of the beams with local surface
 * directions.
 *
 * Method: the line at each hit is fitted to its neighbouring hits, not taken from the scan's
 * segments. This keeps structure smaller than a segment (door frames, posts). Along bare walls it
 * alone constrains the translation along the wall. */
#include "src/base/build.h"

#include "cairn/scan_match.h"
#include "cairn/small_matrix.h"

enum { MAX_NEIGHBOURS = 12 }; /* neighbouring beams, to each side */

/* m: root mean square residual of a line above which the surface is bent */
static const cairn_real MAX_LINE_RMS_M = CAIRN_REAL(0.013);

static int is_hit_near(const cairn_scan_beam *beam, cairn_vec2 p, cairn_real reach)
{
    return beam->kind == CAIRN_SCAN_BEAM_HIT &&
           cairn_vec2_norm_squared(cairn_vec2_sub(beam->to, p)) < reach * reach;
}

/* Total least squares line through the ends of beams[low ... high]: its direction; returns the mean
 * squared residual, m^2; -1: the ends are one point. */
static cairn_real fit_line(const cairn_scan_view *view, int32_t low, int32_t high,
                           cairn_vec2 *direction)
{
    cairn_vec2 origin = view->beams[low].to, sum = {0, 0}, minor;
    cairn_sym2 spread = {0, 0, 0};
    cairn_real n = (cairn_real)(high - low + 1), values[2];

    for (int32_t k = low; k <= high; k++) {
        cairn_vec2 d = cairn_vec2_sub(view->beams[k].to, origin);

        sum = cairn_vec2_add(sum, d);
        spread.xx += d.x * d.x;
        spread.xy += d.x * d.y;
        spread.yy += d.y * d.y;
    }
    spread.xx -= sum.x * sum.x / n;
    spread.xy -= sum.x * sum.y / n;
    spread.yy -= sum.y * sum.y / n;
    cairn_sym2_eigen(spread, values, &minor, direction);
    return values[1] > 0 ? cairn_max(values[0], 0) / n : -1;
}

/* Finds the surface direction at the end of a beam, the sensor on its left, from the neighbouring
 * hits; returns 0 without any. Near a corner, where both sides do not form a line, the straighter
 * side is used. */
static int surface_direction(const cairn_scan_view *view, int32_t i, cairn_vec2 *direction)
{
    const cairn_scan_beam *beam = &view->beams[i];
    cairn_vec2 to_sensor = cairn_vec2_sub(beam->from, beam->to);
    cairn_real reach = CAIRN_REAL(0.08) + CAIRN_REAL(0.03) * cairn_vec2_norm(to_sensor), spread;
    int32_t low = i, high = i;

    while (low > 0 && i - low < MAX_NEIGHBOURS &&
           is_hit_near(&view->beams[low - 1], beam->to, reach))
        low--;
    while (high + 1 < view->beam_count && high - i < MAX_NEIGHBOURS &&
           is_hit_near(&view->beams[high + 1], beam->to, reach))
        high++;
    spread = fit_line(view, low, high, direction);
    if (spread > MAX_LINE_RMS_M * MAX_LINE_RMS_M) {
        cairn_vec2 side = *direction;
        cairn_real before = i - low >= 2 ? fit_line(view, low, i, &side) : -1;

        if (before >= 0 && before < spread / 2) {
            spread = 2 * before;
            *direction = side;
        }
        before = high - i >= 2 ? fit_line(view, i, high, &side) : -1;
        if (before >= 0 && before < spread / 2)
            *direction = side;
    }
    if (spread < 0)
        return 0;
    if (cairn_vec2_cross(*direction, to_sensor) < 0)
        *direction = cairn_vec2_scale(*direction, -1);
    return 1;
}

int32_t cairn_scan_match_dense(const cairn_scan_view *view, cairn_oriented_point *dense)
{
    int32_t count = 0;

    for (int32_t i = 0; i < view->beam_count; i++) {
        if (view->beams[i].kind != CAIRN_SCAN_BEAM_HIT ||
            !surface_direction(view, i, &dense[count].direction))
            continue;
        dense[count++].position = view->beams[i].to;
    }
    return count;
}

/* Returns the direction of the segment nearest to a point. */
static cairn_vec2 nearest_direction(const cairn_scan_view *view, cairn_vec2 p)
{
    cairn_real nearest = CAIRN_REAL_MAX;
    int32_t best = 0;

    for (int32_t k = 0; k < view->segment_count; k++) {
        cairn_real distance = cairn_segment_distance(view->segments[k], p);

        if (distance < nearest) {
            nearest = distance;
            best = k;
        }
    }
    return cairn_vec2_unit(cairn_vec2_sub(view->segments[best].b, view->segments[best].a));
}

int32_t cairn_scan_match_readings(const cairn_scan_view *view, cairn_oriented_point *readings)
{
    int32_t count = 0;

    for (int32_t i = 0; i < view->beam_count && view->segment_count > 0; i++) {
        if (view->beams[i].kind != CAIRN_SCAN_BEAM_HIT)
            continue;
        readings[count].position = view->beams[i].to;
        readings[count++].direction = nearest_direction(view, view->beams[i].to);
    }
    return count;
}
