/* A place refined far below the size of a cell, by lines.
 *
 * Gauss and Newton over the lines of one map on those of the maps around it: where two run the same way, near each other and
 * beside each other, both ends of what they share are drawn onto the other line. Lines are fitted to many cells and so much finer
 * than these. What no line tells stays as it was. */
#include "src/core/build.h"

#include "cairn/rigid_motion.h"
#include "src/mapping/map_merge_work.h"

/* Sine of the angle, and cells of the distance, by which lines that are one differ at most. */
#define SAME_SINE  CAIRN_REAL(0.14)
#define SAME_CELLS CAIRN_REAL(1.6)
/* m: shorter lines are not straight enough. */
#define LEAST_LINE CAIRN_REAL(0.35)
/* m: lines that share less say nothing. */
#define LEAST_SHARED CAIRN_REAL(0.15)
/* m: error of a line, and the length of wall that has it once. */
#define SIGMA  CAIRN_REAL(0.02)
#define LENGTH CAIRN_REAL(0.2)
/* rad: by which the two pictures of a straight wall differ in direction at least, and where they may be two walls. */
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

enum { LINES_PER_UNIT = 6 };

typedef struct line_fit {
    cairn_rigid_motion motion;
    cairn_normal_equations equations;
} line_fit;

static cairn_segment mapped(cairn_transform t, cairn_segment s)
{
    cairn_segment moved = {cairn_transform_point(t, s.a), cairn_transform_point(t, s.b)};

    return moved;
}

/* One end of what line `s` shares with the line through `at` with normal `n`. */
static void add_end(line_fit *f, cairn_vec2 p, cairn_vec2 at, cairn_vec2 n, cairn_vec2 body, cairn_real weight,
                    cairn_real cell)
{
    cairn_real r = cairn_vec2_dot(n, cairn_vec2_sub(p, at)), row[3];

    weight /= 1 + r * r / (cell * cell);
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

/* The direction of the body's line on that of the map's: known far better of long walls than from what they share. */
static void add_direction(line_fit *f, cairn_real turn, cairn_real length, cairn_real own_length)
{
    cairn_real row = 1 / f->motion.radius;
    cairn_real weight = 1 / (variance_of(length) + variance_of(own_length) + STRAIGHT * STRAIGHT);

    weight /= 1 + turn * turn / (BENT * BENT);
    f->equations.information.zz += weight * row * row;
    f->equations.gradient[2] += weight * row * turn;
}

/* Line `own` of the body on line `t` of the map. */
static void add_lines(line_fit *f, cairn_segment own, cairn_segment t, cairn_real cell)
{
    cairn_segment s = mapped(f->motion.transform, own);
    cairn_vec2 along = cairn_vec2_sub(t.b, t.a), way = cairn_vec2_sub(s.b, s.a);
    cairn_real length = cairn_vec2_norm(along), own_length = cairn_vec2_norm(way), low, high, from, to, share, weight;
    cairn_vec2 u = cairn_vec2_scale(along, 1 / length), v = cairn_vec2_scale(way, 1 / own_length),
               n = cairn_vec2_left(u);
    int near = 0;

    if (length < LEAST_LINE || own_length < LEAST_LINE)
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
            cairn_vec2 body = cairn_vec2_add(own.a, cairn_vec2_scale(cairn_vec2_sub(own.b, own.a), share));
            cairn_vec2 p = cairn_transform_point(f->motion.transform, body);

            if (cairn_abs(cairn_vec2_dot(n, cairn_vec2_sub(p, t.a))) >= SAME_CELLS * cell)
                continue;
            add_end(f, p, t.a, n, body, weight, cell);
            near++;
        }
    }
    if (near == 2)
        add_direction(f, cairn_vec2_cross(u, v), length, own_length);
}

/* All lines of the body on all of one neighbour. */
static void add_neighbour(const cairn_map_merge *m, line_fit *f, int32_t near)
{
    const merge_map *body = &m->maps[m->total.map], *other = &m->maps[m->near[near]];
    cairn_transform t = cairn_transform_of(m->near_pose[near]);
    cairn_real cell = cairn_max(body->input.resolution, other->input.resolution);

    for (int32_t i = 0; i < other->line_count; i++) {
        cairn_segment line = mapped(t, other->lines[i]);

        for (int32_t k = 0; k < body->line_count; k++)
            add_lines(f, body->lines[k], line, cell);
    }
}

static int is_apart(const cairn_map_merge *m, int32_t near)
{
    return cairn_merge_is_apart(m, m->near[near], m->total.map, cairn_pose_between(m->near_pose[near], m->climb.best));
}

static int32_t cost_of(const cairn_map_merge *m)
{
    int32_t lines = 0;

    for (int32_t i = 0; i < m->near_count; i++)
        lines += is_apart(m, i) ? 0 : m->maps[m->near[i]].line_count;
    return 8 + m->near_count + lines * m->maps[m->total.map].line_count / LINES_PER_UNIT;
}

void cairn_merge_begin_lines(cairn_map_merge *m, int32_t map, cairn_pose start, cairn_pose pose, int32_t rounds)
{
    m->total.map = map;
    m->climb.best = pose;
    m->climb.rounds = rounds;
    m->climb.start = start;
}

int cairn_merge_go_on_lines(cairn_map_merge *m, cairn_budget *budget)
{
    const cairn_vec2 centre = {0, 0};
    cairn_pose_prior prior = {m->climb.start, START_M, START_M, START_RAD};

    while (m->climb.rounds > 0) {
        line_fit f = {cairn_rigid_motion_at(m->climb.best, centre, RADIUS), {cairn_sym3_zero(), {0, 0, 0}}};
        cairn_normal_equations before;
        cairn_motion_basis basis;
        cairn_real step[3];

        if (!cairn_budget_pay(budget, &m->paid, cost_of(m)))
            return 0;
        for (int32_t i = 0; i < m->near_count; i++)
            if (!is_apart(m, i))
                add_neighbour(m, &f, i);
        if (!(f.equations.information.xx + f.equations.information.yy > 0))
            return 1;
        before = cairn_rigid_motion_prior(&f.motion, &prior);
        basis = cairn_motion_basis_of(f.equations.information, 0);
        if (!cairn_motion_solve(&basis, &f.equations, &before, STEP_LIMIT, step))
            return 1;
        cairn_rigid_motion_move(&f.motion, step);
        m->climb.best = f.motion.map_body;
        m->climb.rounds--;
        if (step[0] * step[0] + step[1] * step[1] + step[2] * step[2] < SETTLED * SETTLED)
            return 1;
    }
    return 1;
}
