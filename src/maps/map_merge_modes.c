/* Modes: registrations of two maps, the points that agree at one, and lists of the best.
 *
 * Method: points of a map are transformed and looked up in the distance map of the other. Of modes
 * that are nearly equal only the best stays in a list (non-maximum suppression). */
#include "src/base/build.h"

#include "src/maps/map_merge_work.h"

/* cells: reach of the search kernel */
#define SOFT_REACH_CELLS 6

int cairn_map_merge_is_same(cairn_pose a, cairn_pose b, cairn_real metres, cairn_real radians)
{
    cairn_real x = a.x - b.x, y = a.y - b.y;

    return x * x + y * y < metres * metres &&
           cairn_abs(cairn_wrap_angle(a.theta - b.theta)) < radians;
}

static cairn_real reach_of(const map_merge_map *map)
{
    return cairn_vec2_norm(map->corner);
}

int cairn_map_merge_is_disjoint(const cairn_map_merge *merge, int32_t first, int32_t second,
                                cairn_pose first_second)
{
    cairn_real reach = reach_of(&merge->maps[first]) + reach_of(&merge->maps[second]);

    return first_second.x * first_second.x + first_second.y * first_second.y > reach * reach;
}

void cairn_map_merge_insert_mode(map_merge_mode *list, int32_t *count, int32_t most,
                                 map_merge_mode mode, cairn_real metres, cairn_real radians)
{
    int32_t at;

    for (int32_t i = 0; i < *count; i++)
        if (cairn_map_merge_is_same(list[i].first_second, mode.first_second, metres, radians)) {
            if (list[i].log_ratio >= mode.log_ratio)
                return;
            for (; i + 1 < *count; i++)
                list[i] = list[i + 1];
            --*count;
            break;
        }
    if (*count == most && list[most - 1].log_ratio >= mode.log_ratio)
        return;
    at = *count < most ? (*count)++ : most - 1;
    for (; at > 0 && list[at - 1].log_ratio < mode.log_ratio; at--)
        list[at] = list[at - 1];
    list[at] = mode;
}

static uint16_t cell_of(const map_merge_map *to, cairn_vec2 p, cairn_real scale)
{
    return map_merge_cell_at(to, (p.x - to->corner.x) * scale, (p.y - to->corner.y) * scale);
}

/* Adds points begin ... end - 1 of `from`, mapped by t, looked up in the grid of `to`. A point
 * agrees when it lies on a wall and has free space in front, as in its own map: the two faces of a
 * wall do not agree. A point two cells beside a wall may lie on the other face or be displaced by
 * noise: it counts half. A third one is neutral. */
void cairn_map_merge_sum(const cairn_map_merge *merge, const map_merge_map *to,
                         const map_merge_map *from, const cairn_transform *transform, int32_t begin,
                         int32_t end, map_merge_sums *sums)
{
    cairn_real scale = 1 / to->input.resolution;

    for (int32_t i = begin; i < end; i++) {
        cairn_vec2 p = cairn_transform_point(*transform, from->points[i].position);
        uint16_t cell = cell_of(to, p, scale);
        int32_t d = map_merge_to_occupied(cell);

        if (map_merge_class(cell) == MAP_MERGE_UNKNOWN)
            continue;
        sums->known_count++;
        sums->centroid_sum = cairn_vec2_add(sums->centroid_sum, p);
        if (d > 3 && map_merge_class(cell) == MAP_MERGE_FREE) {
            sums->conflict += 1;
            sums->soft_conflict += d > 5;
        }
        if (d > SOFT_REACH_CELLS ||
            map_merge_class(
                cell_of(to, cairn_transform_point(*transform, from->points[i].free_side), scale)) !=
                MAP_MERGE_FREE)
            continue;
        sums->soft_agree += merge->soft_kernel[d];
        if (d <= 2)
            sums->agree += d < 2 ? from->points[i].weight : from->points[i].weight / 2;
    }
}
