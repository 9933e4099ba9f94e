/* scan_place: where the resampled points of a segment lie, for those who make them and those who
 * make them again. */
#ifndef CAIRN_MAPPING_SCAN_PLACE_H
#define CAIRN_MAPPING_SCAN_PLACE_H

#include "cairn/geometry.h"

/* Places every `spacing` along a segment of some length, centred. */
static inline int32_t cairn_scan_places(cairn_real length, cairn_real spacing)
{
    return cairn_real_to_int(cairn_floor(length / spacing) + 1);
}

/* Where the first of `places` is, from a along the segment. */
static inline cairn_real cairn_scan_margin(cairn_real length, int32_t places, cairn_real spacing)
{
    return (length - (cairn_real)(places - 1) * spacing) / 2;
}

/* A place. direction: unit, from a to b. */
static inline cairn_vec2 cairn_scan_place(cairn_vec2 a, cairn_vec2 direction, cairn_real margin,
                                          int32_t place, cairn_real spacing)
{
    return cairn_vec2_add(a, cairn_vec2_scale(direction, margin + (cairn_real)place * spacing));
}

#endif
