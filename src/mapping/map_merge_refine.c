/* A place refined far below the size of a cell, by lines, and by surfaces where there are none.
 *
 * Gauss and Newton over the lines of one map on those of the maps around it: where two run the
 * same way, near each other and beside each other, both ends of what they share are drawn onto
 * the other line. Lines are fitted to many cells and so much finer than these. Points off all
 * lines are drawn onto the surface that they meet along their normals. What neither tells stays
 * as it was. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/map_merge_work.h"

/* Sine of the angle, and cells of the distance, by which lines that are one differ at most. */
#define SAME_SINE  CAIRN_REAL(0.14)
#define SAME_CELLS CAIRN_REAL(1.6)
/* m: lines that share less say nothing. */
#define LEAST_SHARED CAIRN_REAL(0.15)
/* m: error of a line, and the length of wall that has it once. */
#define SIGMA  CAIRN_REAL(0.02)
#define LENGTH CAIRN_REAL(0.2)
/* rad: by which the two pictures of a straight wall differ in direction at least, and where they
 * may be two walls. */
#define STRAIGHT CAIRN_REAL(0.002)
#define BENT     CAIRN_REAL(0.03)
/* m and rad: how far the place at hand may be off. */
#define START_M   CAIRN_REAL(0.03)
#define START_RAD CAIRN_REAL(0.01)
/* m: a motion about so large a body. */
#define RADIUS CAIRN_REAL(3.0)
/* m: a step shorter than this is the last one; a longer one is cut. */
#define SETTLED    CAIRN_REAL(2e-4)
#define STEP_LIMIT CAIRN_REAL(0.1)

enum { LINES_PER_UNIT = 6, UNITS_PER_BEND = 2 };

static cairn_segment mapped(cairn_transform t, cairn_segment s)
{
    cairn_segment moved = {cairn_transform_point(t, s.a), cairn_transform_point(t, s.b)};

    return moved;
}

/* The body's point `body`, which lies at p, drawn onto the line through `at` with normal n. */
static void add_end(merge_fit *f, cairn_vec2 p, cairn_vec2 at, cairn_vec2 n, cairn_vec2 body,
                    cairn_real weight)
{
    cairn_real r = cairn_vec2_dot(n, cairn_vec2_sub(p, at)), row[3];

    weight /= 1 + r * r / (f->cell * f->cell);
    cairn_rigid_motion_row(&f->motion, n, body, row);
    cairn_sym3_add_outer(&f->equations.information, row, weight);
    for (int i = 0; i < 3; i++)
        f->equations.gradient[i] += weight * row[i] * r;
}

/* Variance of the direction of a line that was fitted to so many m. */
static cairn_real variance_of(cairn_real length)
{
    return 12 * SIGMA * SIGMA * LENGTH / (length * length * length);
}

/* The direction of the body's line on that of the map's: known far better of long walls than
 * from what they share. */
static void add_direction(merge_fit *f, cairn_real turn, cairn_real length, cairn_real own_length)
{
    cairn_real row = 1 / f->motion.radius;
    cairn_real weight = 1 / (variance_of(length) + variance_of(own_length) + STRAIGHT * STRAIGHT);

    weight /= 1 + turn * turn / (BENT * BENT);
    f->equations.information.zz += weight * row * row;
    f->equations.gradient[2] += weight * row * turn;
}

/* Line `own` of the body on line `t` of the map. */
static void add_lines(merge_fit *f, cairn_segment own, cairn_segment t)
{
    cairn_segment s = mapped(f->motion.transform, own);
    cairn_vec2 along = cairn_vec2_sub(t.b, t.a), way = cairn_vec2_sub(s.b, s.a);
    cairn_real length = cairn_vec2_norm(along), own_length = cairn_vec2_norm(way), low, high, from,
               to, share, weight;
    cairn_vec2 u = cairn_vec2_scale(along, 1 / length), v = cairn_vec2_scale(way, 1 / own_length),
               n = cairn_vec2_left(u);
    int near = 0;

    if (length < MERGE_LINE_M || own_length < MERGE_LINE_M)
        return;
    if (cairn_vec2_dot(u, v) <= 0 || cairn_abs(cairn_vec2_cross(u, v)) > SAME_SINE)
        return;
    from = cairn_vec2_dot(u, cairn_vec2_sub(s.a, t.a));
    to = cairn_vec2_dot(u, cairn_vec2_sub(s.b, t.a));
    low = cairn_max(from, 0);
    high = cairn_min(to, length);
    if (high - low < LEAST_SHARED)
        return;
    weight = (high - low) / (2 * LENGTH * SIGMA * SIGMA);
    for (int end = 0; end < 2; end++) {
        share = ((end == 0 ? low : high) - from) / (to - from);
        {
            cairn_vec2 body =
                cairn_vec2_add(own.a, cairn_vec2_scale(cairn_vec2_sub(own.b, own.a), share));
            cairn_vec2 p = cairn_transform_point(f->motion.transform, body);

            if (cairn_abs(cairn_vec2_dot(n, cairn_vec2_sub(p, t.a))) >= SAME_CELLS * f->cell)
                continue;
            add_end(f, p, t.a, n, body, weight);
            near++;
        }
    }
    if (near == 2)
        add_direction(f, cairn_vec2_cross(u, v), length, own_length);
}

/* Line `index` of the neighbour at hand and all of the body's. */
static void add_line(merge_fit *f, const merge_map *body, const merge_map *other, int32_t index)
{
    cairn_segment line = mapped(f->at, other->lines[index]);

    for (int32_t k = 0; k < body->line_count; k++)
        add_lines(f, body->lines[k], line);
}

static cairn_real weight_of_bend(const merge_map *map)
{
    return cairn_min(map->bent / ((cairn_real)map->bend_count * LENGTH), 1) / (2 * SIGMA * SIGMA);
}

/* A bend of the body on the surface of the neighbour. */
static void add_bend(merge_fit *f, const merge_map *body, const merge_map *other, int32_t index)
{
    const merge_bend *bend = &body->bends[index];
    cairn_vec2 p = cairn_transform_point(f->there, bend->at),
               n = cairn_transform_direction(f->there, bend->normal);
    cairn_real along;

    if (cairn_merge_surface_along(other, p, n, &along))
        add_end(f, cairn_transform_point(f->at, p),
                cairn_transform_point(f->at, cairn_vec2_add(p, cairn_vec2_scale(n, along))),
                cairn_transform_direction(f->at, n), bend->at, weight_of_bend(body));
}

/* A bend of the neighbour on the surface of the body. */
static void add_bend_around(merge_fit *f, const merge_map *body, const merge_map *other,
                            int32_t index)
{
    const merge_bend *bend = &other->bends[index];
    cairn_vec2 p = cairn_transform_point(f->here, bend->at),
               n = cairn_transform_direction(f->here, bend->normal);
    cairn_real along;

    if (cairn_merge_surface_along(body, p, n, &along)) {
        p = cairn_vec2_add(p, cairn_vec2_scale(n, along));
        add_end(f, cairn_transform_point(f->motion.transform, p),
                cairn_transform_point(f->at, bend->at),
                cairn_transform_direction(f->at, bend->normal), p, weight_of_bend(other));
    }
}

static void begin_fit(cairn_map_merge *m)
{
    const cairn_vec2 centre = {0, 0};
    merge_fit *f = &m->fit;

    memset(f, 0, sizeof *f);
    f->motion = cairn_rigid_motion_at(m->climb.best, centre, RADIUS);
    f->near = -1;
}

/* The next neighbour that is not apart; 0 when there is none. */
static int next_neighbour(cairn_map_merge *m)
{
    merge_fit *f = &m->fit;

    while (++f->near < m->near_count) {
        cairn_pose pose = m->near_pose[f->near];
        const merge_map *body = &m->maps[m->total.map], *other = &m->maps[m->near[f->near]];

        if (cairn_merge_is_apart(m, m->near[f->near], m->total.map,
                                 cairn_pose_between(pose, m->climb.best)))
            continue;
        f->at = cairn_transform_of(pose);
        f->there = cairn_transform_of(cairn_pose_between(pose, m->climb.best));
        f->here = cairn_transform_of(cairn_pose_between(m->climb.best, pose));
        f->cell = cairn_max(body->input.resolution, other->input.resolution);
        f->item = 0;
        return 1;
    }
    return 0;
}

/* The lines and bends of the neighbour at hand. */
static int add_neighbour(cairn_map_merge *m, cairn_budget *budget)
{
    merge_fit *f = &m->fit;
    const merge_map *body = &m->maps[m->total.map], *other = &m->maps[m->near[f->near]];
    int32_t bends = other->line_count + body->bend_count, count = bends + other->bend_count;

    for (; f->item < count; f->item++) {
        if (!cairn_budget_pay(budget, &m->paid,
                              f->item < other->line_count ? 1 + body->line_count / LINES_PER_UNIT
                                                          : UNITS_PER_BEND))
            return 0;
        if (f->item < other->line_count)
            add_line(f, body, other, f->item);
        else if (f->item < bends)
            add_bend(f, body, other, f->item - other->line_count);
        else
            add_bend_around(f, body, other, f->item - bends);
    }
    return 1;
}

/* 1 when the place moves no more. */
static int end_fit(cairn_map_merge *m)
{
    merge_fit *f = &m->fit;
    cairn_pose_prior prior = {m->climb.start, START_M, START_M, START_RAD};
    cairn_normal_equations before;
    cairn_motion_basis basis;
    cairn_real step[3];

    if (!(f->equations.information.xx + f->equations.information.yy > 0))
        return 1;
    before = cairn_rigid_motion_prior(&f->motion, &prior);
    basis = cairn_motion_basis_of(f->equations.information, 0);
    if (!cairn_motion_solve(&basis, &f->equations, &before, STEP_LIMIT, step))
        return 1;
    cairn_rigid_motion_move(&f->motion, step);
    m->climb.best = f->motion.map_body;
    return step[0] * step[0] + step[1] * step[1] + step[2] * step[2] < SETTLED * SETTLED;
}

void cairn_merge_begin_lines(cairn_map_merge *m, int32_t map, cairn_pose start, cairn_pose pose,
                             int32_t rounds)
{
    m->total.map = map;
    m->climb.best = pose;
    m->climb.rounds = rounds;
    m->climb.start = start;
    m->fit.under_way = 0;
}

int cairn_merge_go_on_lines(cairn_map_merge *m, cairn_budget *budget)
{
    for (; m->climb.rounds > 0; m->climb.rounds--) {
        int more = 1;

        if (!m->fit.under_way) {
            if (!cairn_budget_pay(budget, &m->paid, 8 + m->near_count))
                return 0;
            begin_fit(m);
            more = next_neighbour(m);
            m->fit.under_way = 1;
        }
        for (; more; more = next_neighbour(m))
            if (!add_neighbour(m, budget))
                return 0;
        m->fit.under_way = 0;
        if (end_fit(m))
            return 1;
    }
    return 1;
}
