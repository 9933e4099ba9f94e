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
#include "src/base/step.h"

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

    for (int32_t k = 0; k < map->joint.count; k++)
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

    for (int32_t k = 0; k < map->joint.count; k++)
        saw += map->observing_places[k] != but &&
               (cairn_place_map_observed(
                    map, map->observing_places[k],
                    cairn_transform_point(map->observer_map[k], point.position),
                    cairn_transform_direction(map->observer_map[k], point.direction)) &
                PLACE_MAP_OBSERVED_SURFACE) != 0;
    return saw;
}

static cairn_oriented_point placed_point(cairn_transform transform, cairn_oriented_point point)
{
    point.position = cairn_transform_point(transform, point.position);
    point.direction = cairn_transform_direction(transform, point.direction);
    return point;
}

/* Finds the places that observe the place, and the map in the frame of each. */
static void begin_joint(cairn_place_map *map, int32_t place, cairn_pose map_place,
                        const cairn_pose *map_places, const int32_t *parts, int32_t part)
{
    struct place_map_joint *joint = &map->joint;

    memset(joint, 0, sizeof *joint);
    joint->place_map = cairn_transform_of(cairn_pose_inverse(map_place));
    for (int32_t k = 0; k < map->place_count; k++)
        if (k != place && parts[k] == part) {
            map->observing_places[joint->count] = k;
            map->observer_map[joint->count++] =
                cairn_transform_of(cairn_pose_inverse(map_places[k]));
        }
}

/* Starts with the points of the scan, whose place has a pose in the map. */
static void begin_scan(cairn_place_map *map, cairn_pose map_place)
{
    const place_map_place_scan *scan = &map->scans[map->joint.scan];

    map->joint.transform = cairn_transform_of(cairn_pose_compose(map_place, scan->place_scan));
    map->joint.item = scan->first_point;
    map->joint.end = scan->first_point + scan->point_count;
}

/* Number of the next items that are evaluated at once. */
static int32_t next_items(const struct place_map_joint *joint)
{
    int32_t left = joint->end - joint->item;

    return left < PLACE_MAP_JOINT_ITEMS ? left : PLACE_MAP_JOINT_ITEMS;
}

/* Charges lookups in visibility grids, of which less than a unit is left for the next ones. 0 when
 * the budget is used up. */
static int charge_lookups(struct place_map_joint *joint, cairn_pose_likelihood *likelihood,
                          cairn_budget *budget, int32_t lookups)
{
    lookups += joint->lookups;
    if (!cairn_budget_charge(budget, &likelihood->units_charged, lookups / LOOKUPS_PER_UNIT))
        return 0;
    joint->lookups = lookups % LOOKUPS_PER_UNIT;
    return 1;
}

/* Adds the next points of the place, in the visibility grids of the others. */
static void add_own_points(cairn_place_map *map)
{
    struct place_map_joint *joint = &map->joint;

    for (int32_t end = joint->item + next_items(joint); joint->item < end; joint->item++) {
        int32_t seen =
            observed_by_all(map, placed_point(joint->transform, map->points[joint->item]));
        struct place_map_terms terms = terms_of(map, joint->item, seen);

        joint->sum.pro += terms.pro;
        joint->sum.contra += terms.contra;
    }
}

/* Looks up the next points of the scan of another place in the visibility grid of the place. */
static void find_seen(cairn_place_map *map, int32_t place)
{
    struct place_map_joint *joint = &map->joint;

    joint->seen_count = 0;
    for (int32_t i = 0; i < next_items(joint); i++) {
        cairn_oriented_point in_place = placed_point(
            joint->place_map, placed_point(joint->transform, map->points[joint->item + i]));

        joint->seen[i] =
            (uint8_t)cairn_place_map_observed(map, place, in_place.position, in_place.direction);
        joint->seen_count += joint->seen[i] != PLACE_MAP_OBSERVED_UNKNOWN;
    }
}

/* Adds the points that were looked up, each by its share. */
static void add_points_of_other(cairn_place_map *map)
{
    struct place_map_joint *joint = &map->joint;
    int32_t observer = map->scans[joint->scan].place, count = next_items(joint);

    for (int32_t i = 0; i < count; i++, joint->item++) {
        struct place_map_terms terms = terms_of(map, joint->item, joint->seen[i]);
        cairn_real share;

        if (joint->seen[i] == PLACE_MAP_OBSERVED_UNKNOWN)
            continue;
        share =
            1 / (cairn_real)(1 + count_observers(
                                     map, placed_point(joint->transform, map->points[joint->item]),
                                     observer));
        joint->sum.pro += share * terms.pro;
        joint->sum.contra += share * terms.contra;
    }
}

/* Starts with the free-space sample of the place. */
static void begin_free(cairn_place_map *map, int32_t place, cairn_pose map_place)
{
    map->joint.transform = cairn_transform_of(map_place);
    map->joint.item = 0;
    map->joint.end = map->places[place].free_count;
}

/* Counts the next points of the free-space sample that any other place observed as free. */
static void count_free(cairn_place_map *map, int32_t place)
{
    struct place_map_joint *joint = &map->joint;
    const cairn_vec2 none = {0, 0};

    for (int32_t end = joint->item + next_items(joint); joint->item < end; joint->item++) {
        cairn_oriented_point point = {cairn_place_map_free_point(map, place, joint->item), none};

        point.position = cairn_transform_point(joint->transform, point.position);
        joint->shared += (observed_by_all(map, point) & PLACE_MAP_OBSERVED_FREE) != 0;
    }
}

int cairn_place_map_joint_likelihood(void *context, int32_t place, cairn_pose map_place,
                                     const cairn_pose *map_places, const int32_t *parts,
                                     int32_t part, cairn_pose_likelihood *likelihood,
                                     cairn_budget *budget)
{
    cairn_place_map *map = context;
    struct place_map_joint *joint = &map->joint;
    const place_map_place *here = &map->places[place];
    cairn_real free_area;

    CAIRN_STEP_BEGIN(likelihood->resume);
    CAIRN_STEP_CHARGE(likelihood, resume, budget, 1);
    begin_joint(map, place, map_place, map_places, parts, part);
    for (joint->scan = here->first_scan; joint->scan < here->first_scan + here->scan_count;
         joint->scan++) {
        begin_scan(map, map_place);
        while (joint->item < joint->end) {
            CAIRN_STEP_UNTIL(likelihood->resume, charge_lookups(joint, likelihood, budget,
                                                                next_items(joint) * joint->count));
            add_own_points(map);
        }
    }
    for (joint->scan = 0; joint->scan < map->scan_count; joint->scan++) {
        if (map->scans[joint->scan].place == place || parts[map->scans[joint->scan].place] != part)
            continue;
        begin_scan(map, map_places[map->scans[joint->scan].place]);
        while (joint->item < joint->end) {
            CAIRN_STEP_UNTIL(likelihood->resume,
                             charge_lookups(joint, likelihood, budget, next_items(joint)));
            find_seen(map, place);
            CAIRN_STEP_UNTIL(likelihood->resume, charge_lookups(joint, likelihood, budget,
                                                                joint->seen_count * joint->count));
            add_points_of_other(map);
        }
    }
    begin_free(map, place, map_place);
    while (joint->item < joint->end) {
        CAIRN_STEP_UNTIL(likelihood->resume, charge_lookups(joint, likelihood, budget,
                                                            next_items(joint) * joint->count));
        count_free(map, place);
    }
    free_area = (cairn_real)joint->shared * cairn_place_map_free_area(map);
    likelihood->against = joint->sum.contra;
    likelihood->ratio = joint->sum.pro + FREE_NATS_PER_M2 * free_area - joint->sum.contra;
    CAIRN_STEP_END(likelihood->resume);
}
