/* place_map: poses of the scans, and the result in the frames of the first places. */
#include "src/base/build.h"

#include "src/alignment/place_map_work.h"

void cairn_place_map_place_scans(cairn_place_map *map, int32_t place)
{
    const place_map_place *here = &map->places[place];

    for (int32_t s = here->first_scan; s < here->first_scan + here->scan_count; s++)
        map->scans[s].map_scan = cairn_pose_compose(here->map_place, map->scans[s].place_scan);
}

static int32_t first_of_part(const cairn_place_map *map, int32_t place)
{
    int32_t first = 0;

    while (map->places[first].component != map->places[place].component)
        first++;
    return first;
}

static int32_t count_placed(const cairn_place_map *map)
{
    int32_t placed = 0;

    for (int32_t i = 0; i < map->place_count; i++)
        placed += map->places[i].component == 0;
    return placed;
}

/* The last places first, as they need the first one's pose unchanged. */
void cairn_place_map_finish(cairn_place_map *map)
{
    cairn_place_map_result *result = &map->result;

    result->places = map->place_count;
    for (int32_t i = map->place_count - 1; i >= 0; i--) {
        place_map_place *place = &map->places[i];
        cairn_pose part_map = cairn_pose_inverse(map->places[first_of_part(map, i)].map_place);

        for (int32_t s = place->first_scan; s < place->first_scan + place->scan_count; s++)
            map->scans[s].map_scan = cairn_pose_compose(part_map, map->scans[s].map_scan);
        place->map_place = cairn_pose_compose(part_map, place->map_place);
        result->components =
            place->component >= result->components ? place->component + 1 : result->components;
    }
    result->placed = count_placed(map);
}
