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
 * `scan` counts the decoupled scans of the place; `place` is the number of places of the last
 * complete map. */
#include "src/base/build.h"

#include "src/alignment/place_map_work.h"

enum { POINTS_PER_UNIT = 16 };

/* Returns the units of copying the points of a place. */
static int32_t copy_units(const cairn_place_map *map, int32_t place)
{
    return 1 + map->places[place].point_count / POINTS_PER_UNIT;
}

/* Appends the transformed points of a scan to a part. */
static void append_scan(cairn_place_map *map, const place_map_place_scan *scan, cairn_pose pose,
                        cairn_scan_match_part *part)
{
    cairn_transform t = cairn_transform_of(pose);

    for (int32_t i = scan->first_point; i < scan->first_point + scan->point_count; i++)
        map->query_points[part->count++] = place_map_placed_point(t, map->points[i]);
}

/* Returns a place as one part: in the map (is_map), or in its own frame. */
static cairn_scan_match_part part_of_place(cairn_place_map *map, int32_t place, int32_t is_map)
{
    const place_map_place *here = &map->places[place];
    cairn_scan_match_part part = {.points = map->query_points};

    for (int32_t s = here->first_scan; s < here->first_scan + here->scan_count; s++) {
        const place_map_place_scan *scan = &map->scans[s];

        append_scan(map, scan, is_map ? scan->map_scan : scan->place_scan, &part);
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

/* Clears the target, and starts with the first place of the new one. */
static void begin_target(cairn_place_map *map)
{
    map->target = map->query;
    for (int32_t k = 0; k < map->params.recent_places && map->target > 0; k++)
        map->target = placed_before(map, map->target);
    cairn_scan_match_clear_target(map->match);
}

/* Adds a place to the target; 0 when it is too far away to match with. */
static int add_to_target(cairn_place_map *map)
{
    cairn_scan_match_part part = part_of_place(map, map->target, 1);

    return cairn_scan_match_add_target(map->match, &part, cairn_pose_identity(), NULL) == CAIRN_OK;
}

/* Starts the match of the query; 0 when there is none. */
static int begin_match(cairn_place_map *map)
{
    cairn_scan_match_window window = {CAIRN_SCAN_EXTENT, CAIRN_SCAN_MATCH_WRITTEN_HEADING};
    cairn_pose start = map->places[placed_before(map, map->query)].map_place;
    cairn_scan_match_part part = part_of_place(map, map->query, 0);

    start.theta = 0;
    return cairn_scan_match_begin(map->match, &part, start, &window, NULL) == CAIRN_OK;
}

/* Places the query as it was matched; returns 0 when it was not. */
static int store_match(cairn_place_map *map)
{
    cairn_scan_match_result found = cairn_scan_match_read(map->match);

    map->result.matches++;
    if (found.count > 0)
        map->places[map->query].map_place = found.hypotheses[0].target_query;
    return found.count > 0;
}

/* Makes the query a component of its own. */
static void set_unplaced(cairn_place_map *map)
{
    place_map_place *here = &map->places[map->query];

    for (int32_t i = 0; i < map->query; i++)
        here->component = map->places[i].component >= here->component ? map->places[i].component + 1
                                                                      : here->component;
}

/* Step of a phase: matches the query with the places before. */
static int match(cairn_place_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->resume.phase);
    CAIRN_STEP_CHARGE_UNIT(map, resume.phase, budget);
    for (begin_target(map); map->target < map->query; map->target++) {
        if (map->places[map->target].component > 0)
            continue;
        CAIRN_STEP_CHARGE(map, resume.phase, budget, copy_units(map, map->target));
        (void)add_to_target(map);
    }
    CAIRN_STEP_CHARGE(map, resume.phase, budget, copy_units(map, map->query));
    map->is_matched = begin_match(map);
    if (map->is_matched) {
        CAIRN_STEP_UNTIL(map->resume.phase, cairn_scan_match_step(map->match, budget) == CAIRN_OK);
        map->is_matched = store_match(map);
    }
    CAIRN_STEP_CHARGE(map, resume.phase, budget, 1 + map->query / POINTS_PER_UNIT);
    if (!map->is_matched)
        set_unplaced(map);
    cairn_place_map_place_scans(map, map->query);
    CAIRN_STEP_END(map->resume.phase);
}

static place_map_place_scan *scan_of_query(const cairn_place_map *map)
{
    return &map->scans[map->places[map->query].first_scan + map->scan];
}

/* Starts the alignment of a scan of the query; 0 when there is none. */
static int begin_icp(cairn_place_map *map)
{
    const place_map_place_scan *scan = scan_of_query(map);
    cairn_scan_match_part part = {.points = map->points + scan->first_point,
                                  .count = scan->point_count};

    return cairn_scan_match_begin_icp(map->match, &part, scan->map_scan, NULL) == CAIRN_OK;
}

static void store_scan(cairn_place_map *map)
{
    cairn_scan_match_result found = cairn_scan_match_read(map->match);

    if (found.count > 0) {
        scan_of_query(map)->map_scan = found.hypotheses[0].target_query;
        map->result.decoupled++;
    }
}

/* Step of a phase: aligns each scan of the query with the same target. */
static int decouple(cairn_place_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->resume.phase);
    for (map->scan = 0; map->scan < map->places[map->query].scan_count; map->scan++) {
        CAIRN_STEP_CHARGE_UNIT(map, resume.phase, budget);
        if (!begin_icp(map))
            continue;
        CAIRN_STEP_UNTIL(map->resume.phase, cairn_scan_match_step(map->match, budget) == CAIRN_OK);
        store_scan(map);
    }
    CAIRN_STEP_END(map->resume.phase);
}

int cairn_place_map_written_run(cairn_place_map *map, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(map->resume.run);
    CAIRN_STEP_CHARGE_UNIT(map, resume.run, budget);
    if (map->place == 0)
        cairn_place_map_place_scans(map, 0);
    for (; map->query < map->place_count; map->query++) {
        CAIRN_STEP_RUN(map, resume.run, budget, match);
        if (map->is_matched && map->params.decoupled != CAIRN_PLACE_MAP_COUPLED)
            CAIRN_STEP_RUN(map, resume.run, budget, decouple);
    }
    map->place = map->place_count;
    CAIRN_STEP_CHARGE(map, resume.run, budget, map->scan_count);
    cairn_place_map_finish(map);
    CAIRN_STEP_END(map->resume.run);
}
