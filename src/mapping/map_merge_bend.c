/* The third structure of maps: pieces of wall that are not straight.
 *
 * Method. A point of a wall and its normal fix a rigid motion together with one of another map,
 * as two corners do. Where walls bend there are no corners, and no directions that many lines
 * share; so points off all lines are taken, an even choice in each map, and every pair of them
 * is tried. Most end after the first few points that are looked up. Such points refine a place,
 * too: where a wall begins along their normals is known to a fraction of a cell in the mean,
 * however the wall runs. */
#include "src/core/build.h"

#include "src/mapping/map_merge_work.h"

/* Quarters of a cell within which a surface is looked for on either side. */
enum { QUARTERS = 10 };

int cairn_merge_surface_along(const merge_map *map, cairn_vec2 p, cairn_vec2 normal,
                              cairn_real *along)
{
    cairn_real cell = map->input.resolution, step = cell / 4;
    int32_t class = MERGE_UNKNOWN, before;

    for (int32_t i = QUARTERS; i >= -QUARTERS; i--) {
        cairn_vec2 at = cairn_vec2_sub(
            cairn_vec2_add(p, cairn_vec2_scale(normal, (cairn_real)i * step)), map->corner);

        before = class;
        class = merge_class(merge_cell_at(map, at.x / cell, at.y / cell));
        if (class != MERGE_OCCUPIED)
            continue;
        *along = ((cairn_real)i + CAIRN_REAL(0.5)) * step;
        return before == MERGE_FREE;
    }
    return 0;
}

cairn_status cairn_merge_choose_bends(cairn_map_merge *m, merge_map *map, cairn_budget *budget)
{
    for (; m->cursor < map->point_count; m->cursor++) {
        const merge_point *p = &map->points[m->cursor];
        merge_bend bend = {p->at, p->normal};
        cairn_real along;

        if (!cairn_budget_pay(budget, &m->paid, 2))
            return CAIRN_MORE;
        if (!p->bent || cairn_vec2_norm_squared(p->normal) < CAIRN_REAL(0.5))
            continue;
        map->bent += map->spacing;
        if (map->bend_count == MERGE_BENDS_MOST ||
            !cairn_merge_surface_along(map, p->at, p->normal, &along))
            continue;
        bend.at = cairn_vec2_add(p->at, cairn_vec2_scale(p->normal, along));
        map->bends[map->bend_count++] = bend;
    }
    return CAIRN_OK;
}

/* The motion that lays point b on point a, their normals on each other. */
static cairn_transform motion_of(const merge_bend *a, const merge_bend *b)
{
    cairn_transform t = {0, 0, cairn_vec2_dot(b->normal, a->normal),
                         cairn_vec2_cross(b->normal, a->normal)};
    cairn_vec2 turned = cairn_transform_point(t, b->at);

    t.x = a->at.x - turned.x;
    t.y = a->at.y - turned.y;
    return t;
}

static cairn_transform inverse_of(cairn_transform t)
{
    cairn_transform back = {-(t.cosine * t.x + t.sine * t.y), t.sine * t.x - t.cosine * t.y,
                            t.cosine, -t.sine};

    return back;
}

/* Points of each map in the grid of the other until too many speak against the place; m->inner
 * counts those looked up. 1 when done, and then m->search.sums holds them. */
static int step_bend(cairn_map_merge *m, cairn_transform t, cairn_budget *budget)
{
    const merge_map *first = &m->maps[m->map], *second = &m->maps[m->other];
    cairn_transform back = inverse_of(t);
    merge_sums *s = &m->search.sums;

    while (m->inner < MERGE_FIRST_POINTS) {
        int32_t end = m->inner + MERGE_POINTS_PER_UNIT;

        if (!cairn_budget_pay(budget, &m->paid, 2))
            return 0;
        cairn_merge_sum(m, first, second, &t, m->inner,
                        end < second->point_count ? end : second->point_count, s);
        cairn_merge_sum(m, second, first, &back, m->inner,
                        end < first->point_count ? end : first->point_count, s);
        m->inner = merge_is_hopeless(s) ? MERGE_FIRST_POINTS : end;
    }
    return 1;
}

cairn_status cairn_merge_try_bends(cairn_map_merge *m, cairn_budget *budget)
{
    const merge_map *first = &m->maps[m->map], *second = &m->maps[m->other];
    const merge_sums none = {0, 0, 0, 0, {0, 0}, 0};
    cairn_real wall = merge_search_wall(first, second);

    for (; m->cursor < first->bend_count * second->bend_count; m->cursor++) {
        cairn_transform t = motion_of(&first->bends[m->cursor / second->bend_count],
                                      &second->bends[m->cursor % second->bend_count]);
        merge_mode mode;

        if (m->inner == 0)
            m->search.sums = none;
        if (!step_bend(m, t, budget))
            return CAIRN_MORE;
        mode.evidence = merge_search_score(&m->search.sums, wall);
        m->inner = 0;
        m->tried++;
        if (mode.evidence > 0) {
            mode.first_second.x = t.x;
            mode.first_second.y = t.y;
            mode.first_second.theta = cairn_atan2(t.sine, t.cosine);
            cairn_merge_keep(m->kept, &m->kept_count, MERGE_KEPT, mode, MERGE_COARSE_M,
                             MERGE_COARSE_RAD);
        }
    }
    return CAIRN_OK;
}
