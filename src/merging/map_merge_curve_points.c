/* Registration by points of curved walls, the third structure of maps.
 *
 * Method.
 *
 * 1. Curved walls have no corners, and no direction that many lines share. So points off all lines
 *    are sampled, evenly spread in each map.
 * 2. A surface point and its normal, matched with one of another map, fix a rigid motion, as two
 *    corners do. Every pair of points is tried; most are rejected after the first few look-ups.
 * 3. Such points also refine a pose: the position of a wall along their normals is known to a
 *    fraction of a cell on average, whatever the wall's shape.
 *
 * Also what all registrations use: the points that agree at one, and lists of the best ones, in
 * which of nearly equal ones only the best stays (non-maximum suppression). */
#include "src/base/build.h"

#include "src/containers/ranked_list.h"
#include "src/merging/map_merge_work.h"

/* cells: reach of the search kernel */
#define SOFT_REACH_CELLS 6

/* ---- Modes ---- */

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

/* Tolerances within which two modes are duplicates. */
typedef struct mode_tolerance {
    cairn_real metres, radians;
} mode_tolerance;

static int is_duplicate(const void *context, const void *entry, const void *other)
{
    const mode_tolerance *tolerance = context;
    const map_merge_mode *a = other, *b = entry;

    return cairn_map_merge_is_same(a->first_second, b->first_second, tolerance->metres,
                                   tolerance->radians);
}

void cairn_map_merge_insert_mode(map_merge_mode *list, int32_t *count, int32_t most,
                                 map_merge_mode mode, cairn_real metres, cairn_real radians)
{
    mode_tolerance tolerance = {metres, radians};
    ranked_list modes = {.entries = list,
                         .count = count,
                         .capacity = most,
                         .entry_bytes = sizeof mode,
                         .score_at = offsetof(map_merge_mode, log_ratio),
                         .is_near = is_duplicate,
                         .context = &tolerance,
                         .replaces_one = 1};

    (void)ranked_list_insert(&modes, &mode);
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

/* ---- Curve points ---- */

/* quarters of a cell: search range of a surface on either side */
enum { SURFACE_SEARCH_QUARTER_CELLS = 10 };

int cairn_map_merge_surface_along(const map_merge_map *map, cairn_vec2 p, cairn_vec2 normal,
                                  cairn_real *along)
{
    cairn_real cell = map->input.resolution, step = cell / 4;
    int32_t class = MAP_MERGE_UNKNOWN, before;

    for (int32_t i = SURFACE_SEARCH_QUARTER_CELLS; i >= -SURFACE_SEARCH_QUARTER_CELLS; i--) {
        cairn_vec2 at = cairn_vec2_sub(
            cairn_vec2_add(p, cairn_vec2_scale(normal, (cairn_real)i * step)), map->corner);

        before = class;
        class = map_merge_class(map_merge_cell_at(map, at.x / cell, at.y / cell));
        if (class != MAP_MERGE_OCCUPIED)
            continue;
        *along = ((cairn_real)i + CAIRN_REAL(0.5)) * step;
        return before == MAP_MERGE_FREE;
    }
    return 0;
}

cairn_status cairn_map_merge_select_curve_points(cairn_map_merge *merge, map_merge_map *map,
                                                 cairn_budget *budget)
{
    for (; merge->cursor < map->point_count; merge->cursor++) {
        const map_merge_point *p = &map->points[merge->cursor];
        map_merge_curve_point curve_point = {p->position, p->normal};
        cairn_real along;

        if (!cairn_budget_charge(budget, &merge->units_charged, 2))
            return CAIRN_MORE;
        if (!p->is_curved || cairn_vec2_norm_squared(p->normal) < CAIRN_REAL(0.5))
            continue;
        map->curved_wall += map->spacing;
        if (map->curve_point_count == MAP_MERGE_MAX_CURVE_POINTS ||
            !cairn_map_merge_surface_along(map, p->position, p->normal, &along))
            continue;
        curve_point.position = cairn_vec2_add(p->position, cairn_vec2_scale(p->normal, along));
        map->curve_points[map->curve_point_count++] = curve_point;
    }
    return CAIRN_OK;
}

/* Returns the motion that maps point b onto point a and aligns their normals. */
static cairn_transform motion_of(const map_merge_curve_point *a, const map_merge_curve_point *b)
{
    cairn_transform t = {0, 0, cairn_vec2_dot(b->normal, a->normal),
                         cairn_vec2_cross(b->normal, a->normal)};
    cairn_vec2 turned = cairn_transform_point(t, b->position);

    t.x = a->position.x - turned.x;
    t.y = a->position.y - turned.y;
    return t;
}

/* Looks up points of each map in the grid of the other until the pose is rejected; merge->inner
 * counts them. Returns 1 when done; merge->search.sums holds the counts. */
static int step_comparison(cairn_map_merge *merge, cairn_transform t, cairn_budget *budget)
{
    const map_merge_map *first = &merge->maps[merge->map], *second = &merge->maps[merge->other];
    cairn_transform back = cairn_transform_inverse(t);
    map_merge_sums *s = &merge->search.sums;

    while (merge->inner < MAP_MERGE_COARSE_POINTS) {
        int32_t end = merge->inner + MAP_MERGE_POINTS_PER_UNIT;

        if (!cairn_budget_charge(budget, &merge->units_charged, 2))
            return 0;
        cairn_map_merge_sum(merge, first, second, &t, merge->inner,
                            end < second->point_count ? end : second->point_count, s);
        cairn_map_merge_sum(merge, second, first, &back, merge->inner,
                            end < first->point_count ? end : first->point_count, s);
        merge->inner = map_merge_is_rejected(s) ? MAP_MERGE_COARSE_POINTS : end;
    }
    return 1;
}

cairn_status cairn_map_merge_register_curve_points(cairn_map_merge *merge, cairn_budget *budget)
{
    const map_merge_map *first = &merge->maps[merge->map], *second = &merge->maps[merge->other];
    const map_merge_sums none = {0, 0, 0, 0, {0, 0}, 0};
    cairn_real wall = map_merge_search_wall(first, second);

    for (; merge->cursor < first->curve_point_count * second->curve_point_count; merge->cursor++) {
        cairn_transform t =
            motion_of(&first->curve_points[merge->cursor / second->curve_point_count],
                      &second->curve_points[merge->cursor % second->curve_point_count]);
        map_merge_mode mode;

        if (merge->inner == 0)
            merge->search.sums = none;
        if (!step_comparison(merge, t, budget))
            return CAIRN_MORE;
        mode.log_ratio = map_merge_search_score(&merge->search.sums, wall);
        merge->inner = 0;
        merge->tried_count++;
        if (mode.log_ratio > 0) {
            mode.first_second.x = t.x;
            mode.first_second.y = t.y;
            mode.first_second.theta = cairn_atan2(t.sine, t.cosine);
            cairn_map_merge_insert_mode(merge->pairs.hypotheses, &merge->pairs.hypothesis_count,
                                        MAP_MERGE_MAX_HYPOTHESES, mode, MAP_MERGE_COARSE_M,
                                        MAP_MERGE_COARSE_RAD);
        }
    }
    return CAIRN_OK;
}
