/* scan_match: quantized positions of the target points, sorted by direction and, within a direction
 * bin, by strips of the longer side of the target's bounding box, so that a windowed search visits
 * few points outside. Positions are in integer steps of a cell. */
#include "src/base/build.h"

#include "src/containers/counting_sort.h"
#include "src/scans/scan_match_work.h"

enum { FULL_CIRCLE = 65536 }; /* steps of a full circle */

/* limit of a quantized position: in a very wide bounding box only the near part is resolved */
static const cairn_real MAX_POSITION = 1 << 30;

static int32_t quantize(cairn_real v)
{
    return cairn_real_to_int(cairn_floor(cairn_min(cairn_max(v, -MAX_POSITION), MAX_POSITION)));
}

scan_match_position cairn_scan_match_quantize(const cairn_scan_match *match, cairn_vec2 p)
{
    cairn_real per_metre =
        SCAN_MATCH_CELL_STEPS / (SCAN_MATCH_CELL_SPACINGS * match->params.spacing);
    scan_match_position q = {quantize((p.x - match->target_low.x) * per_metre),
                             quantize((p.y - match->target_low.y) * per_metre)};

    return q;
}

int32_t cairn_scan_match_strip(const cairn_scan_match *match, scan_match_position q)
{
    int32_t along = match->strips_along_y ? q.y : q.x, column;

    if (along < 0)
        return 0;
    column = along >> match->strip_bits;
    return column < SCAN_MATCH_STRIPS ? column : SCAN_MATCH_STRIPS - 1;
}

uint16_t cairn_scan_match_quantize_angle(cairn_real angle)
{
    return (uint16_t)cairn_real_to_int(cairn_floor(angle * (FULL_CIRCLE / (2 * CAIRN_PI))));
}

int32_t cairn_scan_match_angle_bin(uint16_t turn)
{
    return turn * SCAN_MATCH_DIRECTION_BINS / FULL_CIRCLE;
}

/* The cell of a point: its strip in its direction bin. */
static int32_t cell_of(const cairn_scan_match *match, const cairn_oriented_point *point)
{
    int32_t bin = cairn_scan_match_angle_bin(
        cairn_scan_match_quantize_angle(cairn_atan2(point->direction.y, point->direction.x)));

    return bin * SCAN_MATCH_STRIPS +
           cairn_scan_match_strip(match, cairn_scan_match_quantize(match, point->position));
}

void cairn_scan_match_positions_reset(cairn_scan_match *match)
{
    cairn_vec2 side = cairn_vec2_sub(match->target_high, match->target_low);
    scan_match_position corner = cairn_scan_match_quantize(match, match->target_high);
    int32_t longest;

    counting_sort_reset(match->direction_start, 0, SCAN_MATCH_DIRECTION_CELLS + 1);
    match->strips_along_y = side.y > side.x;
    longest = match->strips_along_y ? corner.y : corner.x;
    match->strip_bits = 0;
    while (longest >> match->strip_bits >= SCAN_MATCH_STRIPS)
        match->strip_bits++;
}

void cairn_scan_match_positions_count(cairn_scan_match *match, const cairn_oriented_point *point)
{
    counting_sort_count(match->direction_start, cell_of(match, point));
}

void cairn_scan_match_positions_sum(cairn_scan_match *match)
{
    counting_sort_sum(match->direction_start, 0, SCAN_MATCH_DIRECTION_CELLS + 1);
}

void cairn_scan_match_positions_place(cairn_scan_match *match, const cairn_oriented_point *point)
{
    match->by_direction[counting_sort_place(match->direction_start, cell_of(match, point))] =
        cairn_scan_match_quantize(match, point->position);
}
