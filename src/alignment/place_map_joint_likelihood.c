/* place_map: joint log-likelihood ratio of a place's pose given all other places of a component.
 *
 * Method: sums over pairs count a wall as often as places observed it. A place would fit best where
 * most places are, and never at the edge of the map, where a single other one overlaps.
 * 1. Each point of the place counts once, by the union of the others' observations there.
 * 2. Points of the others in the visibility grid of the place count by 1 over the number of places
 *    that observed the same surface.
 * 3. Free space counts once that the place and any of the others observed.
 * 4. The weights are those of a conditional logistic regression: the true pose of a place against
 *    the best wrong ones of all poses. Data: simulated arenas with people and with tilted scans.
 *    The nats are multiplied by four to compare with those of pairs.
 *
 * Invalidated points count too: the map cannot excuse a place that contradicts it.
 * Layout: places of the component, and the map in the frame of each, in scratch of the object. */
#include "src/base/build.h"

#include <string.h>

#include "src/alignment/place_map_work.h"

/* Cells of a visibility grid that a work unit covers. */
enum { LOOKUPS_PER_UNIT = 6 };

/* nats of a static point: on a surface of its direction, a rough one, a dynamic-object candidate,
 * the opposite face of a wall; penalties: in free space, and where some observed free space and
 * some a surface. */
static const cairn_real PARALLEL_NATS = CAIRN_REAL(0.2), ROUGH_NATS = CAIRN_REAL(0.87),
                        DYNAMIC_NATS = CAIRN_REAL(0.1);
static const cairn_real OPPOSITE_NATS = CAIRN_REAL(0.1), FREE_PENALTY_NATS = CAIRN_REAL(1.2),
                        CONTESTED_PENALTY_NATS = CAIRN_REAL(1.75);
/* nats of a point of a dynamic-object candidate: on another one or a rough surface, on another
 * surface; penalty in free space. */
static const cairn_real DYNAMIC_DYNAMIC_NATS = CAIRN_REAL(0.42),
                        DYNAMIC_SURFACE_NATS = CAIRN_REAL(0.26);
static const cairn_real DYNAMIC_FREE_PENALTY_NATS = CAIRN_REAL(0.19);
/* nats per square metre of shared free space. */
static const cairn_real FREE_NATS_PER_M2 = 5;

/* Returns the terms of a static point, by all observations at it. */
static struct place_map_terms terms_of_static(int32_t seen)
{
    struct place_map_terms terms = {0, 0};

    if (seen & PLACE_MAP_OBSERVED_PARALLEL)
        terms.pro = PARALLEL_NATS;
    else if (seen & PLACE_MAP_OBSERVED_ROUGH)
        terms.pro = ROUGH_NATS;
    else if (seen & PLACE_MAP_OBSERVED_OPPOSITE)
        terms.pro = OPPOSITE_NATS;
    else if (seen & PLACE_MAP_OBSERVED_DYNAMIC)
        terms.pro = DYNAMIC_NATS;
    if (seen & PLACE_MAP_OBSERVED_FREE)
        terms.contra =
            seen & PLACE_MAP_OBSERVED_SURFACE ? CONTESTED_PENALTY_NATS : FREE_PENALTY_NATS;
    return terms;
}

static struct place_map_terms terms_of_dynamic(int32_t seen)
{
    struct place_map_terms terms = {0, 0};

    if (seen & (PLACE_MAP_OBSERVED_DYNAMIC | PLACE_MAP_OBSERVED_ROUGH))
        terms.pro = DYNAMIC_DYNAMIC_NATS;
    else if (seen & PLACE_MAP_OBSERVED_SURFACE)
        terms.pro = DYNAMIC_SURFACE_NATS;
    if (seen & PLACE_MAP_OBSERVED_FREE)
        terms.contra = DYNAMIC_FREE_PENALTY_NATS;
    return terms;
}

static struct place_map_terms terms_of(const cairn_place_map *map, int32_t point, int32_t seen)
{
    return map->point_class[point] & PLACE_MAP_POINT_DYNAMIC_CANDIDATE ? terms_of_dynamic(seen)
                                                                       : terms_of_static(seen);
}

/* Returns the union of all observations at a point of the map. */
static int32_t observed_by_all(const cairn_place_map *map, cairn_oriented_point point)
{
    int32_t seen = PLACE_MAP_OBSERVED_UNKNOWN;

    for (int32_t k = 0; k < map->observer_count; k++)
        seen |= cairn_place_map_observed(
            map, map->observing_places[k],
            cairn_transform_point(map->observer_map[k], point.position),
            cairn_transform_direction(map->observer_map[k], point.direction));
    return seen;
}

/* Returns the number of observing places but one with a surface at a point of the map. */
static int32_t count_observers(const cairn_place_map *map, cairn_oriented_point point, int32_t but)
{
    int32_t saw = 0;

    for (int32_t k = 0; k < map->observer_count; k++)
        saw += map->observing_places[k] != but &&
               (cairn_place_map_observed(
                    map, map->observing_places[k],
                    cairn_transform_point(map->observer_map[k], point.position),
                    cairn_transform_direction(map->observer_map[k], point.direction)) &
                PLACE_MAP_OBSERVED_SURFACE) != 0;
    return saw;
}

/* Finds the places that observe the place. */
static void begin_joint(cairn_place_map *map, int32_t place, cairn_pose map_place,
                        const cairn_pose *map_places, const int32_t *parts, int32_t part)
{
    memset(&map->joint, 0, sizeof map->joint);
    map->joint.place_map = cairn_transform_of(cairn_pose_inverse(map_place));
    map->observer_count = 0;
    for (int32_t k = 0; k < map->place_count; k++)
        if (k != place && parts[k] == part)
            cairn_place_map_add_observer(map, k, map_places[k]);
}

/* Charges lookups in visibility grids, of which less than a unit is left for the next ones. 0 when
 * the budget is used up. */
static int charge_lookups(cairn_place_map *map, cairn_pose_likelihood *likelihood,
                          cairn_budget *budget, int32_t lookups)
{
    lookups += map->joint.lookups;
    if (!cairn_budget_charge(budget, &likelihood->units_charged, lookups / LOOKUPS_PER_UNIT))
        return 0;
    map->joint.lookups = lookups % LOOKUPS_PER_UNIT;
    return 1;
}

/* The same for the next items in the grids of all observing places. */
static int charge_items(cairn_place_map *map, cairn_pose_likelihood *likelihood,
                        cairn_budget *budget)
{
    return charge_lookups(map, likelihood, budget,
                          cairn_place_map_next_items(map) * map->observer_count);
}

/* Adds the next points of the place, in the visibility grids of the others. */
static void add_own_points(cairn_place_map *map)
{
    struct place_map_joint *joint = &map->joint;
    struct place_map_visit *visit = &map->visit;

    for (int32_t end = visit->item + cairn_place_map_next_items(map); visit->item < end;
         visit->item++) {
        int32_t seen = observed_by_all(
            map, place_map_placed_point(visit->transform, map->points[visit->item]));
        struct place_map_terms terms = terms_of(map, visit->item, seen);

        joint->sum.pro += terms.pro;
        joint->sum.contra += terms.contra;
    }
}

/* Looks up the next points of the scan of another place in the visibility grid of the place. */
static void find_seen(cairn_place_map *map, int32_t place)
{
    struct place_map_joint *joint = &map->joint;
    int32_t count = cairn_place_map_next_items(map);

    joint->seen_count = 0;
    for (int32_t i = 0; i < count; i++) {
        cairn_oriented_point in_map =
            place_map_placed_point(map->visit.transform, map->points[map->visit.item + i]);
        cairn_oriented_point in_place = place_map_placed_point(joint->place_map, in_map);

        joint->seen[i] =
            (uint8_t)cairn_place_map_observed(map, place, in_place.position, in_place.direction);
        joint->seen_count += joint->seen[i] != PLACE_MAP_OBSERVED_UNKNOWN;
    }
}

/* Adds the points that were looked up, each by its share. */
static void add_points_of_other(cairn_place_map *map)
{
    struct place_map_joint *joint = &map->joint;
    struct place_map_visit *visit = &map->visit;
    int32_t observer = map->scans[visit->scan].place, count = cairn_place_map_next_items(map);

    for (int32_t i = 0; i < count; i++, visit->item++) {
        struct place_map_terms terms = terms_of(map, visit->item, joint->seen[i]);
        cairn_oriented_point in_map =
            place_map_placed_point(visit->transform, map->points[visit->item]);
        cairn_real share;

        if (joint->seen[i] == PLACE_MAP_OBSERVED_UNKNOWN)
            continue;
        share = 1 / (cairn_real)(1 + count_observers(map, in_map, observer));
        joint->sum.pro += share * terms.pro;
        joint->sum.contra += share * terms.contra;
    }
}

/* Counts the next points of the free-space sample that any other place observed as free. */
static void count_free(cairn_place_map *map, int32_t place)
{
    struct place_map_visit *visit = &map->visit;
    const cairn_vec2 none = {0, 0};

    for (int32_t end = visit->item + cairn_place_map_next_items(map); visit->item < end;
         visit->item++) {
        cairn_oriented_point point = {cairn_place_map_free_point(map, place, visit->item), none};

        point.position = cairn_transform_point(visit->transform, point.position);
        map->joint.shared += (observed_by_all(map, point) & PLACE_MAP_OBSERVED_FREE) != 0;
    }
}

/* Writes the result. */
static void end_joint(const cairn_place_map *map, cairn_pose_likelihood *likelihood)
{
    const struct place_map_joint *joint = &map->joint;
    cairn_real free_area = (cairn_real)joint->shared * cairn_place_map_free_area(map);

    likelihood->against = joint->sum.contra;
    likelihood->ratio = joint->sum.pro + FREE_NATS_PER_M2 * free_area - joint->sum.contra;
}

int cairn_place_map_joint_likelihood(void *context, int32_t place, cairn_pose map_place,
                                     const cairn_pose *map_places, const int32_t *parts,
                                     int32_t part, cairn_pose_likelihood *likelihood,
                                     cairn_budget *budget)
{
    cairn_place_map *map = context;
    struct place_map_visit *visit = &map->visit;
    const place_map_place *here = &map->places[place];

    CAIRN_STEP_BEGIN(likelihood->resume);
    CAIRN_STEP_CHARGE_UNIT(likelihood, resume, budget);
    begin_joint(map, place, map_place, map_places, parts, part);
    for (visit->scan = here->first_scan; visit->scan < here->first_scan + here->scan_count;
         visit->scan++) {
        cairn_place_map_begin_points(map, map_place);
        while (visit->item < visit->end) {
            CAIRN_STEP_UNTIL(likelihood->resume, charge_items(map, likelihood, budget));
            add_own_points(map);
        }
    }
    for (visit->scan = 0; visit->scan < map->scan_count; visit->scan++) {
        if (map->scans[visit->scan].place == place || parts[map->scans[visit->scan].place] != part)
            continue;
        cairn_place_map_begin_points(map, map_places[map->scans[visit->scan].place]);
        while (visit->item < visit->end) {
            CAIRN_STEP_UNTIL(likelihood->resume, charge_lookups(map, likelihood, budget,
                                                                cairn_place_map_next_items(map)));
            find_seen(map, place);
            CAIRN_STEP_UNTIL(likelihood->resume,
                             charge_lookups(map, likelihood, budget,
                                            map->joint.seen_count * map->observer_count));
            add_points_of_other(map);
        }
    }
    cairn_place_map_begin_visit(map, map_place, 0, here->free_count);
    while (visit->item < visit->end) {
        CAIRN_STEP_UNTIL(likelihood->resume, charge_items(map, likelihood, budget));
        count_free(map, place);
    }
    end_joint(map, likelihood);
    CAIRN_STEP_END(likelihood->resume);
}
