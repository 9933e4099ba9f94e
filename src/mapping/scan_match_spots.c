/* The target's points as the votes want them: by direction, and within a bin of directions by
 * strips of the longer side of the target's box, so that a search in a window meets few that lie
 * outside. Positions are whole parts of a cell. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/scan_match_work.h"

enum { TURN = 65536 };

/* of a spot: of a box so wide only the near part is resolved */
static const cairn_real FARTHEST = 1 << 30;

static int32_t whole(cairn_real v)
{
    return cairn_real_to_int(cairn_floor(cairn_min(cairn_max(v, -FARTHEST), FARTHEST)));
}

match_spot cairn_match_spot(const cairn_scan_match *x, cairn_vec2 p)
{
    cairn_real per_metre = MATCH_SPOTS / (MATCH_CELL * x->params.spacing);
    match_spot spot = {whole((p.x - x->target_low.x) * per_metre),
                       whole((p.y - x->target_low.y) * per_metre)};

    return spot;
}

int32_t cairn_match_column(const cairn_scan_match *x, match_spot spot)
{
    int32_t along = x->columns_along_y ? spot.y : spot.x, column;

    if (along < 0)
        return 0;
    column = along >> x->column_bits;
    return column < MATCH_COLUMNS ? column : MATCH_COLUMNS - 1;
}

uint16_t cairn_match_turn(cairn_real angle)
{
    return (uint16_t)cairn_real_to_int(cairn_floor(angle * (TURN / (2 * CAIRN_PI))));
}

int32_t cairn_match_turn_bin(uint16_t turn)
{
    return turn * MATCH_DIRECTIONS / TURN;
}

static int32_t *start_of(cairn_scan_match *x, const cairn_oriented_point *p)
{
    int32_t bin =
        cairn_match_turn_bin(cairn_match_turn(cairn_atan2(p->direction.y, p->direction.x)));

    return &x->direction_start[bin * MATCH_COLUMNS +
                               cairn_match_column(x, cairn_match_spot(x, p->position))];
}

void cairn_match_spots_reset(cairn_scan_match *x)
{
    cairn_vec2 side = cairn_vec2_sub(x->target_high, x->target_low);
    match_spot corner = cairn_match_spot(x, x->target_high);
    int32_t longest;

    memset(x->direction_start, 0, sizeof x->direction_start);
    x->columns_along_y = side.y > side.x;
    longest = x->columns_along_y ? corner.y : corner.x;
    x->column_bits = 0;
    while (longest >> x->column_bits >= MATCH_COLUMNS)
        x->column_bits++;
    cairn_match_charge(x, MATCH_DIRECTIONS * MATCH_COLUMNS / 16);
}

void cairn_match_spots_count(cairn_scan_match *x, const cairn_oriented_point *p)
{
    ++*start_of(x, p);
}

void cairn_match_spots_sum(cairn_scan_match *x)
{
    for (int32_t k = 1; k <= MATCH_DIRECTIONS * MATCH_COLUMNS; k++)
        x->direction_start[k] += x->direction_start[k - 1];
    cairn_match_charge(x, MATCH_DIRECTIONS * MATCH_COLUMNS / 3);
}

void cairn_match_spots_place(cairn_scan_match *x, const cairn_oriented_point *p)
{
    x->by_direction[--*start_of(x, p)] = cairn_match_spot(x, p->position);
}
