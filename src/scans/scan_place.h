/* scan_place: positions of the resampled points of a segment, shared by scan, which generates them,
 * and scan_set, which generates them again. */
#ifndef CAIRN_SCANS_SCAN_PLACE_H
#define CAIRN_SCANS_SCAN_PLACE_H

#include "cairn/geometry.h"

/* Number of positions, `spacing` apart and centred, along a segment of a length. */
static inline int32_t cairn_scan_position_count(cairn_real length, cairn_real spacing)
{
    return cairn_real_to_int(cairn_floor(length / spacing) + 1);
}

/* Distance of the first position from a along the segment, m. */
static inline cairn_real cairn_scan_first_position(cairn_real length, int32_t places,
                                                   cairn_real spacing)
{
    return (length - (cairn_real)(places - 1) * spacing) / 2;
}

/* Coordinates of a position. direction: unit vector, from a to b. */
static inline cairn_vec2 cairn_scan_position(cairn_vec2 a, cairn_vec2 direction, cairn_real margin,
                                             int32_t place, cairn_real spacing)
{
    return cairn_vec2_add(a, cairn_vec2_scale(direction, margin + (cairn_real)place * spacing));
}

#endif
