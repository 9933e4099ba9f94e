/* A variant of the methods of place_map, for ablation studies: a further value of the field `mode` of
 * cairn_place_map_params. _check() accepts it, and says the range of the public ones. */
#ifndef CAIRN_ALIGNMENT_PLACE_MAP_VARIANTS_H
#define CAIRN_ALIGNMENT_PLACE_MAP_VARIANTS_H

#include "cairn/place_map.h"

enum {
    /* Scan-to-map matching: each place with the union of the last recent_places, in order, by
     * params.match. */
    CAIRN_PLACE_MAP_SEQUENTIAL = 4
};

#endif
