/* place_map: what all places of a part together say for the pose of one more.
 *
 * Method. Sums over pairs count a wall as often as places saw it, so that a place seems to fit best
 * where most have been, and one at the edge of the map, which a single other one overlaps, nowhere.
 * Here each point of the place is told once by what any of the others saw there, points of the
 * others in the sight of the place count by their share of all that saw the same surface, and space
 * counts once that the place and any of the others saw free. What each is worth follows a
 * conditional logistic regression: the right pose of a place against the best wrong ones of all
 * poses, in simulated arenas with people and with tilted scans; its nats are taken times four, so
 * that they compare with those of pairs.
 *
 * Points that others of the map see through count too: what the map says cannot excuse a place that
 * contradicts it.
 *
 * Layout: places of the part and the map seen from each of them, in scratch of the object. */
#include "src/core/build.h"

#include "src/mapping/place_map_work.h"

enum { LOOKS_TO_UNIT = 6 };

/* Nats of a sound point: on a surface of its direction, on a rough one, on a body, on the other
 * side of a wall; against the pose in free space, or in what some saw free and some not. */
static const cairn_real ALONG = CAIRN_REAL(0.2), ROUGH = CAIRN_REAL(0.87),
                        ON_BODY = CAIRN_REAL(0.1);
static const cairn_real BACK = CAIRN_REAL(0.1), FREE = CAIRN_REAL(1.2),
                        CONTESTED = CAIRN_REAL(1.75);
/* Nats of a point of a body: on a body or a rough surface, on another one; against the pose in
 * free space. */
static const cairn_real BODY_BODY = CAIRN_REAL(0.42), BODY_SURFACE = CAIRN_REAL(0.26);
static const cairn_real BODY_FREE = CAIRN_REAL(0.19);
/* Nats of a square metre. */
static const cairn_real SPACE = 5;

/* What speaks for a pose, and against it. */
struct worth {
    cairn_real pro, contra;
};

/* A sound point, by all that was seen where it lies. */
static struct worth worth_of_sound(int32_t seen)
{
    struct worth worth = {0, 0};

    if (seen & CAIRN_SAW_ALONG)
        worth.pro = ALONG;
    else if (seen & CAIRN_SAW_ROUGH)
        worth.pro = ROUGH;
    else if (seen & CAIRN_SAW_BACK)
        worth.pro = BACK;
    else if (seen & CAIRN_SAW_BODY)
        worth.pro = ON_BODY;
    if (seen & CAIRN_SAW_FREE)
        worth.contra = seen & CAIRN_SAW_SURFACE ? CONTESTED : FREE;
    return worth;
}

static struct worth worth_of_body(int32_t seen)
{
    struct worth worth = {0, 0};

    if (seen & (CAIRN_SAW_BODY | CAIRN_SAW_ROUGH))
        worth.pro = BODY_BODY;
    else if (seen & CAIRN_SAW_SURFACE)
        worth.pro = BODY_SURFACE;
    if (seen & CAIRN_SAW_FREE)
        worth.contra = BODY_FREE;
    return worth;
}

static struct worth worth_of(const cairn_place_map *map, int32_t point, int32_t seen)
{
    return map->doubt[point] & CAIRN_POINT_FLOATING ? worth_of_body(seen) : worth_of_sound(seen);
}

/* All that the seers saw at a point of the map. */
static int32_t seen_by_all(const cairn_place_map *map, int32_t count, cairn_oriented_point point)
{
    int32_t seen = CAIRN_SAW_NOTHING;

    for (int32_t k = 0; k < count; k++)
        seen |= cairn_place_map_saw(map, map->seers[k],
                                    cairn_transform_point(map->seers_map[k], point.position),
                                    cairn_transform_direction(map->seers_map[k], point.direction));
    return seen;
}

/* How many of the seers but one saw a surface at a point of the map. */
static int32_t count_that_saw(const cairn_place_map *map, int32_t count, cairn_oriented_point point,
                              int32_t but)
{
    int32_t saw = 0;

    for (int32_t k = 0; k < count; k++)
        saw += map->seers[k] != but &&
               (cairn_place_map_saw(map, map->seers[k],
                                    cairn_transform_point(map->seers_map[k], point.position),
                                    cairn_transform_direction(map->seers_map[k], point.direction)) &
                CAIRN_SAW_SURFACE) != 0;
    return saw;
}

static cairn_oriented_point placed_point(cairn_transform transform, cairn_oriented_point point)
{
    point.position = cairn_transform_point(transform, point.position);
    point.direction = cairn_transform_direction(transform, point.direction);
    return point;
}

/* The points of the place in the sight of the seers. */
static void weigh_own(const cairn_place_map *map, int32_t place, cairn_pose map_place,
                      int32_t count, struct worth *sum)
{
    const cairn_place *here = &map->places[place];

    for (int32_t s = here->first_scan; s < here->first_scan + here->scan_count; s++) {
        const cairn_place_scan *scan = &map->scans[s];
        cairn_transform transform =
            cairn_transform_of(cairn_pose_compose(map_place, scan->place_scan));

        for (int32_t i = scan->first_point; i < scan->first_point + scan->point_count; i++) {
            int32_t seen = seen_by_all(map, count, placed_point(transform, map->points[i]));
            struct worth worth = worth_of(map, i, seen);

            sum->pro += worth.pro;
            sum->contra += worth.contra;
        }
    }
}

/* The points of one of the seers in the sight of the place, each by its share of those that saw
 * what it is on. Returns how often something was looked at. */
static int32_t weigh_other(const cairn_place_map *map, int32_t place, cairn_transform place_map,
                           int32_t seer, cairn_pose map_seer, int32_t count, struct worth *sum)
{
    const cairn_place *there = &map->places[seer];
    int32_t looks = there->point_count;

    for (int32_t s = there->first_scan; s < there->first_scan + there->scan_count; s++) {
        const cairn_place_scan *scan = &map->scans[s];
        cairn_transform transform =
            cairn_transform_of(cairn_pose_compose(map_seer, scan->place_scan));

        for (int32_t i = scan->first_point; i < scan->first_point + scan->point_count; i++) {
            cairn_oriented_point in_map = placed_point(transform, map->points[i]);
            cairn_oriented_point in_place = placed_point(place_map, in_map);
            int32_t seen = cairn_place_map_saw(map, place, in_place.position, in_place.direction);
            struct worth worth = worth_of(map, i, seen);
            cairn_real share;

            if (seen == CAIRN_SAW_NOTHING)
                continue;
            share = 1 / (cairn_real)(1 + count_that_saw(map, count, in_map, seer));
            sum->pro += share * worth.pro;
            sum->contra += share * worth.contra;
            looks += count;
        }
    }
    return looks;
}

/* Square metres of what the place saw free that any of the seers saw free too. */
static cairn_real weigh_space(const cairn_place_map *map, int32_t place, cairn_pose map_place,
                              int32_t count)
{
    cairn_transform transform = cairn_transform_of(map_place);
    const cairn_vec2 none = {0, 0};
    int32_t shared = 0;

    for (int32_t i = 0; i < map->places[place].free_count; i++) {
        cairn_oriented_point point = {cairn_place_map_free_point(map, place, i), none};

        point.position = cairn_transform_point(transform, point.position);
        shared += (seen_by_all(map, count, point) & CAIRN_SAW_FREE) != 0;
    }
    return (cairn_real)shared * cairn_place_map_free_area(map);
}

cairn_real cairn_place_map_among(const cairn_place_map *map, int32_t place, cairn_pose map_place,
                                 const cairn_pose *map_places, const int32_t *parts, int32_t part,
                                 cairn_real *against, int32_t *units)
{
    const cairn_place *here = &map->places[place];
    cairn_transform place_map = cairn_transform_of(cairn_pose_inverse(map_place));
    struct worth sum = {0, 0};
    int32_t count = 0, looks;

    for (int32_t k = 0; k < map->place_count; k++)
        if (k != place && parts[k] == part) {
            map->seers[count] = k;
            map->seers_map[count++] = cairn_transform_of(cairn_pose_inverse(map_places[k]));
        }
    looks = (here->point_count + here->free_count) * count;
    weigh_own(map, place, map_place, count, &sum);
    for (int32_t k = 0; k < count; k++)
        looks += weigh_other(map, place, place_map, map->seers[k], map_places[map->seers[k]], count,
                             &sum);
    *units = 1 + looks / LOOKS_TO_UNIT;
    *against = sum.contra;
    return sum.pro + SPACE * weigh_space(map, place, map_place, count) - sum.contra;
}
