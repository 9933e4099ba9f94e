/* scan_match: quantized positions of the target points, sorted by direction and, within a direction
 * bin, by strips of the longer side of the target's bounding box, so that a windowed search visits
 * few points outside. Positions are in integer steps of a cell. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/scan_match_work.h"

enum { FULL_CIRCLE = 65536 };

/* limit of a quantized position: in a very wide bounding box only the near part is resolved */
static const cairn_real MAX_POSITION = 1 << 30;

static int32_t quantize(cairn_real v)
{
    return cairn_real_to_int(cairn_floor(cairn_min(cairn_max(v, -MAX_POSITION), MAX_POSITION)));
}

match_spot cairn_match_spot(const cairn_scan_match *match, cairn_vec2 p)
{
    cairn_real per_metre = MATCH_SPOTS / (MATCH_CELL * match->params.spacing);
    match_spot spot = {quantize((p.x - match->target_low.x) * per_metre),
                       quantize((p.y - match->target_low.y) * per_metre)};

    return spot;
}

int32_t cairn_match_column(const cairn_scan_match *match, match_spot spot)
{
    int32_t along = match->columns_along_y ? spot.y : spot.x, column;

    if (along < 0)
        return 0;
    column = along >> match->column_bits;
    return column < MATCH_COLUMNS ? column : MATCH_COLUMNS - 1;
}

uint16_t cairn_match_turn(cairn_real angle)
{
    return (uint16_t)cairn_real_to_int(cairn_floor(angle * (FULL_CIRCLE / (2 * CAIRN_PI))));
}

int32_t cairn_match_turn_bin(uint16_t turn)
{
    return turn * MATCH_DIRECTIONS / FULL_CIRCLE;
}

static int32_t *start_of(cairn_scan_match *match, const cairn_oriented_point *p)
{
    int32_t bin =
        cairn_match_turn_bin(cairn_match_turn(cairn_atan2(p->direction.y, p->direction.x)));

    return &match->direction_start[bin * MATCH_COLUMNS +
                                   cairn_match_column(match, cairn_match_spot(match, p->position))];
}

void cairn_match_spots_reset(cairn_scan_match *match)
{
    cairn_vec2 side = cairn_vec2_sub(match->target_high, match->target_low);
    match_spot corner = cairn_match_spot(match, match->target_high);
    int32_t longest;

    memset(match->direction_start, 0, sizeof match->direction_start);
    match->columns_along_y = side.y > side.x;
    longest = match->columns_along_y ? corner.y : corner.x;
    match->column_bits = 0;
    while (longest >> match->column_bits >= MATCH_COLUMNS)
        match->column_bits++;
    cairn_match_charge(match, MATCH_DIRECTIONS * MATCH_COLUMNS / 16);
}

void cairn_match_spots_count(cairn_scan_match *match, const cairn_oriented_point *p)
{
    ++*start_of(match, p);
}

void cairn_match_spots_sum(cairn_scan_match *match)
{
    for (int32_t k = 1; k <= MATCH_DIRECTIONS * MATCH_COLUMNS; k++)
        match->direction_start[k] += match->direction_start[k - 1];
    cairn_match_charge(match, MATCH_DIRECTIONS * MATCH_COLUMNS / 3);
}

void cairn_match_spots_place(cairn_scan_match *match, const cairn_oriented_point *p)
{
    match->by_direction[--*start_of(match, p)] = cairn_match_spot(match, p->position);
}
