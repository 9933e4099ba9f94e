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

#include "src/alignment/place_map_work.h"

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

/* Terms for and against a pose, nats, >= 0. */
struct likelihood_terms {
    cairn_real pro, contra;
};

/* Returns the terms of a static point, by all observations at it. */
static struct likelihood_terms terms_of_static(int32_t seen)
{
    struct likelihood_terms likelihood_terms = {0, 0};

    if (seen & PLACE_MAP_OBSERVED_PARALLEL)
        likelihood_terms.pro = PARALLEL_NATS;
    else if (seen & PLACE_MAP_OBSERVED_ROUGH)
        likelihood_terms.pro = ROUGH_NATS;
    else if (seen & PLACE_MAP_OBSERVED_OPPOSITE)
        likelihood_terms.pro = OPPOSITE_NATS;
    else if (seen & PLACE_MAP_OBSERVED_DYNAMIC)
        likelihood_terms.pro = DYNAMIC_NATS;
    if (seen & PLACE_MAP_OBSERVED_FREE)
        likelihood_terms.contra =
            seen & PLACE_MAP_OBSERVED_SURFACE ? CONTESTED_PENALTY_NATS : FREE_PENALTY_NATS;
    return likelihood_terms;
}

static struct likelihood_terms terms_of_dynamic(int32_t seen)
{
    struct likelihood_terms likelihood_terms = {0, 0};

    if (seen & (PLACE_MAP_OBSERVED_DYNAMIC | PLACE_MAP_OBSERVED_ROUGH))
        likelihood_terms.pro = DYNAMIC_DYNAMIC_NATS;
    else if (seen & PLACE_MAP_OBSERVED_SURFACE)
        likelihood_terms.pro = DYNAMIC_SURFACE_NATS;
    if (seen & PLACE_MAP_OBSERVED_FREE)
        likelihood_terms.contra = DYNAMIC_FREE_PENALTY_NATS;
    return likelihood_terms;
}

static struct likelihood_terms terms_of(const cairn_place_map *map, int32_t point, int32_t seen)
{
    return map->point_class[point] & PLACE_MAP_POINT_DYNAMIC_CANDIDATE ? terms_of_dynamic(seen)
                                                                       : terms_of_static(seen);
}

/* Returns the union of all observations at a point of the map. */
static int32_t observed_by_all(const cairn_place_map *map, int32_t count,
                               cairn_oriented_point point)
{
    int32_t seen = PLACE_MAP_OBSERVED_UNKNOWN;

    for (int32_t k = 0; k < count; k++)
        seen |= cairn_place_map_observed(
            map, map->observing_places[k],
            cairn_transform_point(map->observer_map[k], point.position),
            cairn_transform_direction(map->observer_map[k], point.direction));
    return seen;
}

/* Returns the number of observing places but one with a surface at a point of the map. */
static int32_t count_observers(const cairn_place_map *map, int32_t count,
                               cairn_oriented_point point, int32_t but)
{
    int32_t saw = 0;

    for (int32_t k = 0; k < count; k++)
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

/* Adds the points of the place, in the visibility grids of the others. */
static void add_own_points(const cairn_place_map *map, int32_t place, cairn_pose map_place,
                           int32_t count, struct likelihood_terms *sum)
{
    const place_map_place *here = &map->places[place];

    for (int32_t s = here->first_scan; s < here->first_scan + here->scan_count; s++) {
        const place_map_place_scan *scan = &map->scans[s];
        cairn_transform transform =
            cairn_transform_of(cairn_pose_compose(map_place, scan->place_scan));

        for (int32_t i = scan->first_point; i < scan->first_point + scan->point_count; i++) {
            int32_t seen = observed_by_all(map, count, placed_point(transform, map->points[i]));
            struct likelihood_terms likelihood_terms = terms_of(map, i, seen);

            sum->pro += likelihood_terms.pro;
            sum->contra += likelihood_terms.contra;
        }
    }
}

/* Adds the points of one other place, in the visibility grid of the place, each by its share.
 * Returns the number of lookups. */
static int32_t add_points_of_other(const cairn_place_map *map, int32_t place,
                                   cairn_transform place_map, int32_t observer,
                                   cairn_pose map_observer, int32_t count,
                                   struct likelihood_terms *sum)
{
    const place_map_place *there = &map->places[observer];
    int32_t lookups = there->point_count;

    for (int32_t s = there->first_scan; s < there->first_scan + there->scan_count; s++) {
        const place_map_place_scan *scan = &map->scans[s];
        cairn_transform transform =
            cairn_transform_of(cairn_pose_compose(map_observer, scan->place_scan));

        for (int32_t i = scan->first_point; i < scan->first_point + scan->point_count; i++) {
            cairn_oriented_point in_map = placed_point(transform, map->points[i]);
            cairn_oriented_point in_place = placed_point(place_map, in_map);
            int32_t seen =
                cairn_place_map_observed(map, place, in_place.position, in_place.direction);
            struct likelihood_terms likelihood_terms = terms_of(map, i, seen);
            cairn_real share;

            if (seen == PLACE_MAP_OBSERVED_UNKNOWN)
                continue;
            share = 1 / (cairn_real)(1 + count_observers(map, count, in_map, observer));
            sum->pro += share * likelihood_terms.pro;
            sum->contra += share * likelihood_terms.contra;
            lookups += count;
        }
    }
    return lookups;
}

/* Returns the free space of the place that any other place observed as free, m^2. */
static cairn_real shared_free_area(const cairn_place_map *map, int32_t place, cairn_pose map_place,
                                   int32_t count)
{
    cairn_transform transform = cairn_transform_of(map_place);
    const cairn_vec2 none = {0, 0};
    int32_t shared = 0;

    for (int32_t i = 0; i < map->places[place].free_count; i++) {
        cairn_oriented_point point = {cairn_place_map_free_point(map, place, i), none};

        point.position = cairn_transform_point(transform, point.position);
        shared += (observed_by_all(map, count, point) & PLACE_MAP_OBSERVED_FREE) != 0;
    }
    return (cairn_real)shared * cairn_place_map_free_area(map);
}

cairn_real cairn_place_map_joint_likelihood(const cairn_place_map *map, int32_t place,
                                            cairn_pose map_place, const cairn_pose *map_places,
                                            const int32_t *parts, int32_t part,
                                            cairn_real *violations, int32_t *units)
{
    const place_map_place *here = &map->places[place];
    cairn_transform place_map = cairn_transform_of(cairn_pose_inverse(map_place));
    struct likelihood_terms sum = {0, 0};
    int32_t count = 0, lookups;

    for (int32_t k = 0; k < map->place_count; k++)
        if (k != place && parts[k] == part) {
            map->observing_places[count] = k;
            map->observer_map[count++] = cairn_transform_of(cairn_pose_inverse(map_places[k]));
        }
    lookups = (here->point_count + here->free_count) * count;
    add_own_points(map, place, map_place, count, &sum);
    for (int32_t k = 0; k < count; k++)
        lookups += add_points_of_other(map, place, place_map, map->observing_places[k],
                                       map_places[map->observing_places[k]], count, &sum);
    *units = 1 + lookups / LOOKUPS_PER_UNIT;
    *violations = sum.contra;
    return sum.pro + FREE_NATS_PER_M2 * shared_free_area(map, place, map_place, count) - sum.contra;
}
