/* place_map: the map of Adluru 2008, chapter 6, as written: place after place, each with the last
 * few.
 *
 * Method:
 * 1. The target is the union of the last recent_places that were placed, each one part in the order
 *    of its readings.
 * 2. The place, its scans one after the other, is matched with the target by shape and ICP
 *    (scan_match, mode AS_WRITTEN), from the position of the place before and the heading of the
 *    first.
 * 3. On request each of its scans is aligned individually by the same ICP with the same target.
 *
 * `next` counts the decoupled scans of the place; `place` is the number of places of the last
 * complete map. */
#include "src/base/build.h"

#include "src/alignment/place_map_work.h"

enum { POINTS_PER_UNIT = 16 };

/* Appends the transformed points of a scan; returns the number of points. */
static int32_t append_scan(cairn_place_map *map, const place_map_place_scan *scan, cairn_pose pose,
                           int32_t count)
{
    cairn_transform t = cairn_transform_of(pose);

    for (int32_t i = scan->first_point; i < scan->first_point + scan->point_count; i++) {
        map->query_points[count].position = cairn_transform_point(t, map->points[i].position);
        map->query_points[count++].direction =
            cairn_transform_direction(t, map->points[i].direction);
    }
    map->units_due += scan->point_count / POINTS_PER_UNIT;
    return count;
}

/* Returns a place as one part: in the map (is_map), or in its own frame. */
static cairn_scan_match_part part_of_place(cairn_place_map *map, int32_t place, int32_t is_map)
{
    const place_map_place *here = &map->places[place];
    cairn_scan_match_part part = {.points = map->query_points};

    for (int32_t s = here->first_scan; s < here->first_scan + here->scan_count; s++) {
        const place_map_place_scan *scan = &map->scans[s];

        part.count = append_scan(map, scan, is_map ? scan->map_scan : scan->place_scan, part.count);
    }
    return part;
}

/* Returns the last placed place before the query; the first one always is. */
static int32_t placed_before(const cairn_place_map *map, int32_t place)
{
    do
        place--;
    while (map->places[place].component > 0);
    return place;
}

static void target_item(cairn_place_map *map)
{
    int32_t first = map->query;

    map->units_due++;
    if (map->query == 1 && map->place == 0)
        cairn_place_map_place_scans(map, 0);
    if (map->query >= map->place_count) {
        map->place = map->place_count;
        cairn_place_map_finish(map);
        return;
    }
    for (int32_t k = 0; k < map->params.recent_places && first > 0; k++)
        first = placed_before(map, first);
    cairn_scan_match_clear_target(map->match);
    for (int32_t i = first; i < map->query; i++) {
        cairn_scan_match_part part;

        if (map->places[i].component > 0)
            continue;
        part = part_of_place(map, i, 1);
        if (cairn_scan_match_add_target(map->match, &part, cairn_pose_identity(), NULL) != CAIRN_OK)
            map->units_due++; /* too far away to match with */
    }
    place_map_enter(map, CAIRN_PLACE_MAP_MATCH);
}

static void next_place(cairn_place_map *map)
{
    map->query++;
    place_map_enter(map, CAIRN_PLACE_MAP_TARGET);
}

/* Makes the current place a component of its own. */
static void set_unplaced(cairn_place_map *map)
{
    place_map_place *here = &map->places[map->query];

    for (int32_t i = 0; i < map->query; i++)
        here->component = map->places[i].component >= here->component ? map->places[i].component + 1
                                                                      : here->component;
    map->units_due += 1 + map->query / POINTS_PER_UNIT;
    cairn_place_map_place_scans(map, map->query);
    next_place(map);
}

/* The match of a place has ended. */
static void store_match(cairn_place_map *map)
{
    cairn_scan_match_result found = cairn_scan_match_read(map->match);
    place_map_place *here = &map->places[map->query];

    map->result.matches++;
    if (found.count == 0) {
        set_unplaced(map);
        return;
    }
    here->map_place = found.hypotheses[0].target_query;
    cairn_place_map_place_scans(map, map->query);
    if (map->params.decoupled == CAIRN_PLACE_MAP_COUPLED)
        next_place(map);
    else
        place_map_enter(map, CAIRN_PLACE_MAP_DECOUPLE);
}

static void match_item(cairn_place_map *map, cairn_budget *budget)
{
    cairn_scan_match_window window = {CAIRN_SCAN_EXTENT, CAIRN_SCAN_MATCH_WRITTEN_HEADING};
    cairn_pose start = cairn_pose_identity();
    cairn_scan_match_part part;
    cairn_pose before;

    if (map->inner_running) {
        if (cairn_scan_match_step(map->match, budget) == CAIRN_OK)
            store_match(map);
        return;
    }
    before = map->places[placed_before(map, map->query)].map_place;
    start.x = before.x;
    start.y = before.y;
    part = part_of_place(map, map->query, 0);
    map->units_due++;
    map->inner_running =
        cairn_scan_match_begin(map->match, &part, start, &window, NULL) == CAIRN_OK;
    if (!map->inner_running)
        set_unplaced(map);
}

static void decouple_item(cairn_place_map *map, cairn_budget *budget)
{
    const place_map_place *here = &map->places[map->query];
    place_map_place_scan *scan = &map->scans[here->first_scan + map->item];

    if (map->inner_running) {
        if (cairn_scan_match_step(map->match, budget) == CAIRN_OK) {
            cairn_scan_match_result found = cairn_scan_match_read(map->match);

            if (found.count > 0) {
                scan->map_scan = found.hypotheses[0].target_query;
                map->result.decoupled++;
            }
            map->inner_running = 0;
            map->item++;
        }
    } else if (map->item == here->scan_count) {
        map->units_due++;
        next_place(map);
    } else {
        cairn_scan_match_part part = {.points = map->points + scan->first_point,
                                      .count = scan->point_count};

        map->units_due++;
        map->inner_running =
            cairn_scan_match_begin_icp(map->match, &part, scan->map_scan, NULL) == CAIRN_OK;
        map->item += !map->inner_running;
    }
}

void cairn_place_map_written_extend(cairn_place_map *map)
{
    for (int32_t i = map->place; i < map->place_count; i++) {
        map->places[i].map_place = cairn_pose_identity();
        map->places[i].component = 0;
    }
    map->query = map->place;
    map->item = map->inner_running = map->units_due = 0;
    place_map_enter(map, CAIRN_PLACE_MAP_TARGET);
}

void cairn_place_map_written_item(cairn_place_map *map, cairn_budget *budget)
{
    if (map->phase == CAIRN_PLACE_MAP_TARGET)
        target_item(map);
    else if (map->phase == CAIRN_PLACE_MAP_MATCH)
        match_item(map, budget);
    else
        decouple_item(map, budget);
}
