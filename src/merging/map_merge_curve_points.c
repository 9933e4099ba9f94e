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
 * Also what all registrations use: the points that agree at one. */
#include "src/base/build.h"

#include "src/merging/map_merge_work.h"

/* cells: reach of the search kernel */
#define SOFT_REACH_CELLS 6

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

/* Units of a curve point that is selected, and of MAP_MERGE_POINTS_PER_UNIT points of each map that
 * are looked up. */
enum { UNITS_PER_CURVE_POINT = 2, UNITS_PER_LOOK_UP = 2 };

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

/* Adds a point as a curve point when it is on no line, and the surface is beside it. */
static void add_curve_point(map_merge_map *map, const map_merge_point *p)
{
    map_merge_curve_point curve_point = {p->position, p->normal};
    cairn_real along;

    if (!p->is_curved || cairn_vec2_norm_squared(p->normal) < CAIRN_REAL(0.5))
        return;
    map->curved_wall += map->spacing;
    if (map->curve_point_count == MAP_MERGE_MAX_CURVE_POINTS ||
        !cairn_map_merge_surface_along(map, p->position, p->normal, &along))
        return;
    curve_point.position = cairn_vec2_add(p->position, cairn_vec2_scale(p->normal, along));
    map->curve_points[map->curve_point_count++] = curve_point;
}

int cairn_map_merge_select_curve_points(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_preparation *prepared = &merge->prepared;
    map_merge_map *map = &merge->maps[prepared->map];

    CAIRN_STEP_BEGIN(merge->resume.phase);
    map->curve_point_count = 0;
    map->curved_wall = 0;
    for (prepared->point = 0; prepared->point < map->point_count; prepared->point++) {
        CAIRN_STEP_CHARGE(merge, resume.phase, budget, UNITS_PER_CURVE_POINT);
        add_curve_point(map, &map->points[prepared->point]);
    }
    CAIRN_STEP_END(merge->resume.phase);
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

/* Sets the motion of the current pair of curve points. */
static void begin_points(cairn_map_merge *merge)
{
    const map_merge_map *first = &merge->maps[merge->pairs.first],
                        *second = &merge->maps[merge->pairs.second];
    const map_merge_sums none = {0, 0, 0, 0, {0, 0}, 0};
    map_merge_curves *curves = &merge->curves;

    curves->there = motion_of(&first->curve_points[curves->points.first],
                              &second->curve_points[curves->points.second]);
    curves->back = cairn_transform_inverse(curves->there);
    curves->point = 0;
    curves->sums = none;
}

/* Looks up the next points of each map in the grid of the other; none are left when the motion is
 * rejected. */
static void look_up_points(cairn_map_merge *merge)
{
    const map_merge_map *first = &merge->maps[merge->pairs.first],
                        *second = &merge->maps[merge->pairs.second];
    map_merge_curves *curves = &merge->curves;
    int32_t begin = curves->point, end = begin + MAP_MERGE_POINTS_PER_UNIT;

    cairn_map_merge_sum(merge, first, second, &curves->there, begin,
                        end < second->point_count ? end : second->point_count, &curves->sums);
    cairn_map_merge_sum(merge, second, first, &curves->back, begin,
                        end < first->point_count ? end : first->point_count, &curves->sums);
    curves->point = map_merge_is_rejected(&curves->sums) ? MAP_MERGE_COARSE_POINTS : end;
}

static void end_points(cairn_map_merge *merge)
{
    const map_merge_curves *curves = &merge->curves;
    cairn_real score = map_merge_search_score(&curves->sums, curves->wall);

    merge->tried_count++;
    if (score > 0) {
        cairn_pose first_second = {curves->there.x, curves->there.y,
                                   cairn_atan2(curves->there.sine, curves->there.cosine)};

        cairn_map_merge_insert_hypothesis(merge, first_second, score);
    }
}

int cairn_map_merge_register_curve_points(cairn_map_merge *merge, cairn_budget *budget)
{
    const map_merge_map *first = &merge->maps[merge->pairs.first],
                        *second = &merge->maps[merge->pairs.second];
    map_merge_curves *curves = &merge->curves;
    map_merge_item_pair *at = &curves->points;

    CAIRN_STEP_BEGIN(merge->resume.phase);
    curves->wall = map_merge_search_wall(first, second);
    for (at->first = 0; at->first < first->curve_point_count; at->first++)
        for (at->second = 0; at->second < second->curve_point_count; at->second++) {
            CAIRN_STEP_CHARGE(merge, resume.phase, budget, UNITS_PER_LOOK_UP);
            begin_points(merge);
            look_up_points(merge);
            while (curves->point < MAP_MERGE_COARSE_POINTS) {
                CAIRN_STEP_CHARGE(merge, resume.phase, budget, UNITS_PER_LOOK_UP);
                look_up_points(merge);
            }
            end_points(merge);
        }
    CAIRN_STEP_END(merge->resume.phase);
}
