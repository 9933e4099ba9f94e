/* Sub-cell refinement of a pose by lines, and by surface points where there are none
 * (registration).
 *
 * Method. Normal equations of the point-to-line residuals between one map and its neighbours, with
 * weights by the length of wall that a residual stands for:
 *
 * 1. Lines that are nearly parallel, close and overlapping correspond. Both ends of the common part
 *    are residuals, and the difference of directions is another. Lines are fitted to many cells and
 *    are more accurate than single cells.
 * 2. Curve points are projected along their normals onto the neighbour's surface.
 * 3. Directions that neither observes are held by a prior at the start. */
#include "src/base/build.h"

#include <string.h>

#include "src/merging/map_merge_work.h"

/* maximum sine of the angle, and maximum distance in cells, between corresponding lines */
#define MAX_SINE           CAIRN_REAL(0.14)
#define MAX_DISTANCE_CELLS CAIRN_REAL(1.6)
/* m: minimum common length of corresponding lines */
#define MIN_SHARED_M CAIRN_REAL(0.15)
/* m: standard deviation of a line, and the length of wall that has it once */
#define LINE_SIGMA_M        CAIRN_REAL(0.02)
#define LINE_SIGMA_LENGTH_M CAIRN_REAL(0.2)
/* cells: scale of the residuals; their weight is a half at the side of a cell */
#define SIGMA_CELLS CAIRN_REAL(0.4193)
/* rad: minimum standard deviation of the direction difference of one straight wall in two maps, and
 * the scale of the differences: their weight is a half at 0.03 rad, where there may be two walls */
#define MIN_DIRECTION_SIGMA_RAD    CAIRN_REAL(0.002)
#define CURVED_DIRECTION_SIGMA_RAD CAIRN_REAL(0.01258)
/* m and rad: prior standard deviations of the current pose */
#define PRIOR_SIGMA_M   CAIRN_REAL(0.03)
#define PRIOR_SIGMA_RAD CAIRN_REAL(0.01)
/* m: a step shorter than this ends the iteration; a longer one is limited */
#define CONVERGED_M CAIRN_REAL(2e-4)
#define MAX_STEP_M  CAIRN_REAL(0.1)

enum { LINES_PER_UNIT = 6, UNITS_PER_CURVE_POINT = 2, UNITS_PER_ROUND = 8 };

static cairn_segment mapped(cairn_transform t, cairn_segment s)
{
    cairn_segment moved = {cairn_transform_point(t, s.a), cairn_transform_point(t, s.b)};

    return moved;
}

/* Adds a point-to-line residual: the body's point `body` at p, and the line through `at` with
 * normal n. */
static void add_end(map_merge_fit *fit, cairn_vec2 p, cairn_vec2 at, cairn_vec2 n, cairn_vec2 body,
                    cairn_real weight)
{
    cairn_real error = cairn_vec2_dot(n, cairn_vec2_sub(p, at)), row[3];

    cairn_rigid_motion_jacobian(&fit->robust.motion, n, body, row);
    cairn_rigid_motion_add_residual(
        &fit->robust.sums.equations, row, error,
        weight * cairn_registration_weight(error * error, fit->robust.sigma));
}

/* Returns the variance of the direction of a line fitted to a length in m, rad^2. */
static cairn_real variance_of(cairn_real length)
{
    return 12 * LINE_SIGMA_M * LINE_SIGMA_M * LINE_SIGMA_LENGTH_M / (length * length * length);
}

/* Adds the residual of the directions of two lines: long walls give it far better than their common
 * part does. */
static void add_direction(map_merge_fit *fit, cairn_real turn, cairn_real length,
                          cairn_real own_length)
{
    const cairn_real row[3] = {0, 0, 1 / fit->robust.motion.radius};
    cairn_real weight = cairn_registration_weight(turn * turn, CURVED_DIRECTION_SIGMA_RAD) /
                        (variance_of(length) + variance_of(own_length) +
                         MIN_DIRECTION_SIGMA_RAD * MIN_DIRECTION_SIGMA_RAD);

    cairn_rigid_motion_add_residual(&fit->robust.sums.equations, row, turn, weight);
}

/* Adds the residuals of line `own` of the map and line `t` of the neighbour. */
static void add_lines(map_merge_fit *fit, cairn_segment own, cairn_segment t)
{
    cairn_segment s = mapped(fit->robust.motion.transform, own);
    cairn_vec2 along = cairn_vec2_sub(t.b, t.a), way = cairn_vec2_sub(s.b, s.a);
    cairn_real length = cairn_vec2_norm(along), own_length = cairn_vec2_norm(way), low, high, from,
               to, weight;
    cairn_vec2 u = cairn_vec2_scale(along, 1 / length), v = cairn_vec2_scale(way, 1 / own_length),
               n = cairn_vec2_left_perp(u);
    int near = 0;

    if (length < MAP_MERGE_MIN_LINE_M || own_length < MAP_MERGE_MIN_LINE_M)
        return;
    if (cairn_vec2_dot(u, v) <= 0 || cairn_abs(cairn_vec2_cross(u, v)) > MAX_SINE)
        return;
    from = cairn_vec2_dot(u, cairn_vec2_sub(s.a, t.a));
    to = cairn_vec2_dot(u, cairn_vec2_sub(s.b, t.a));
    low = cairn_max(from, 0);
    high = cairn_min(to, length);
    if (high - low < MIN_SHARED_M)
        return;
    weight = (high - low) / (2 * LINE_SIGMA_LENGTH_M * LINE_SIGMA_M * LINE_SIGMA_M);
    for (int end = 0; end < 2; end++) {
        cairn_real share = ((end == 0 ? low : high) - from) / (to - from);
        cairn_vec2 body = cairn_vec2_interpolate(own.a, own.b, share),
                   p = cairn_transform_point(fit->robust.motion.transform, body);

        if (cairn_abs(cairn_vec2_dot(n, cairn_vec2_sub(p, t.a))) >= MAX_DISTANCE_CELLS * fit->cell)
            continue;
        add_end(fit, p, t.a, n, body, weight);
        near++;
    }
    if (near == 2)
        add_direction(fit, cairn_vec2_cross(u, v), length, own_length);
}

/* Adds line `index` of the current neighbour against all lines of the map. */
static void add_line(map_merge_fit *fit, const map_merge_map *body, const map_merge_map *other,
                     int32_t index)
{
    cairn_segment line = mapped(fit->neighbour_transform, other->lines[index]);

    for (int32_t k = 0; k < body->line_count; k++)
        add_lines(fit, body->lines[k], line);
}

static cairn_real curve_point_weight(const map_merge_map *map)
{
    return cairn_min(map->curved_wall / ((cairn_real)map->curve_point_count * LINE_SIGMA_LENGTH_M),
                     1) /
           (2 * LINE_SIGMA_M * LINE_SIGMA_M);
}

/* Adds a curve point of the map against the surface of the neighbour. */
static void add_curve_point(map_merge_fit *fit, const map_merge_map *body,
                            const map_merge_map *other, int32_t index)
{
    const map_merge_curve_point *curve_point = &body->curve_points[index];
    cairn_vec2 p = cairn_transform_point(fit->to_neighbour, curve_point->position),
               n = cairn_transform_direction(fit->to_neighbour, curve_point->normal);
    cairn_real along;

    if (cairn_map_merge_surface_along(other, p, n, &along))
        add_end(fit, cairn_transform_point(fit->neighbour_transform, p),
                cairn_transform_point(fit->neighbour_transform,
                                      cairn_vec2_add(p, cairn_vec2_scale(n, along))),
                cairn_transform_direction(fit->neighbour_transform, n), curve_point->position,
                curve_point_weight(body));
}

/* Adds a curve point of the neighbour against the surface of the map. */
static void add_curve_point_of_neighbour(map_merge_fit *fit, const map_merge_map *body,
                                         const map_merge_map *other, int32_t index)
{
    const map_merge_curve_point *curve_point = &other->curve_points[index];
    cairn_vec2 p = cairn_transform_point(fit->to_map, curve_point->position),
               n = cairn_transform_direction(fit->to_map, curve_point->normal);
    cairn_real along;

    if (cairn_map_merge_surface_along(body, p, n, &along)) {
        p = cairn_vec2_add(p, cairn_vec2_scale(n, along));
        add_end(fit, cairn_transform_point(fit->robust.motion.transform, p),
                cairn_transform_point(fit->neighbour_transform, curve_point->position),
                cairn_transform_direction(fit->neighbour_transform, curve_point->normal), p,
                curve_point_weight(other));
    }
}

static void begin_round(map_merge_fit *fit)
{
    const cairn_vec2 centre = {0, 0};

    memset(&fit->robust, 0, sizeof fit->robust);
    fit->robust.motion = cairn_rigid_motion_at(fit->pose, centre, MAP_MERGE_BODY_RADIUS_M);
    fit->robust.gate = MAX_STEP_M;
}

int cairn_map_merge_begin_neighbour(cairn_map_merge *merge)
{
    map_merge_fit *f = &merge->fit;
    cairn_pose pose = merge->neighbours.poses[f->neighbour],
               seen = cairn_pose_between(pose, f->pose);
    int32_t near = merge->neighbours.maps[f->neighbour];

    if (cairn_map_merge_is_disjoint(merge, near, f->map, seen))
        return 0;
    f->other = &merge->maps[near];
    f->neighbour_transform = cairn_transform_of(pose);
    f->to_neighbour = cairn_transform_of(seen);
    f->to_map = cairn_transform_of(cairn_pose_between(f->pose, pose));
    f->cell = cairn_max(merge->maps[f->map].input.resolution, f->other->input.resolution);
    return 1;
}

/* Moves the map; returns 1 on convergence. */
static int end_round(map_merge_fit *fit)
{
    cairn_registration *robust = &fit->robust;
    const cairn_rigid_motion_equations *equations = &robust->sums.equations;
    const cairn_rigid_motion_pose_prior prior = {fit->start, PRIOR_SIGMA_M, PRIOR_SIGMA_M,
                                                 PRIOR_SIGMA_RAD};
    cairn_rigid_motion_basis basis;
    cairn_real step[3];

    if (!(equations->information.xx + equations->information.yy > 0))
        return 1;
    basis = cairn_rigid_motion_basis_of(equations->information, 0);
    if (!cairn_registration_move(robust, &basis, equations, 1, &prior, step))
        return 1;
    fit->pose = robust->motion.map_body;
    return step[0] * step[0] + step[1] * step[1] + step[2] * step[2] < CONVERGED_M * CONVERGED_M;
}

void cairn_map_merge_begin_fit(cairn_map_merge *merge, int32_t map, cairn_pose start,
                               cairn_pose pose, int32_t rounds)
{
    merge->fit.map = map;
    merge->fit.start = start;
    merge->fit.pose = pose;
    merge->fit.rounds = rounds;
}

/* Step: adds the lines of the current neighbour, the curve points of the map, and those of the
 * neighbour. */
static int add_neighbour(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_fit *f = &merge->fit;
    const map_merge_map *body = &merge->maps[f->map], *other = f->other;

    CAIRN_STEP_BEGIN(merge->resume.neighbour);
    f->robust.sigma = SIGMA_CELLS * f->cell;
    for (f->line = 0; f->line < other->line_count; f->line++) {
        CAIRN_STEP_CHARGE(merge, resume.neighbour, budget, 1 + body->line_count / LINES_PER_UNIT);
        add_line(f, body, other, f->line);
    }
    for (f->point = 0; f->point < body->curve_point_count; f->point++) {
        CAIRN_STEP_CHARGE(merge, resume.neighbour, budget, UNITS_PER_CURVE_POINT);
        add_curve_point(f, body, other, f->point);
    }
    for (f->point = 0; f->point < other->curve_point_count; f->point++) {
        CAIRN_STEP_CHARGE(merge, resume.neighbour, budget, UNITS_PER_CURVE_POINT);
        add_curve_point_of_neighbour(f, body, other, f->point);
    }
    CAIRN_STEP_END(merge->resume.neighbour);
}

int cairn_map_merge_step_lines(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_fit *f = &merge->fit;

    CAIRN_STEP_BEGIN(merge->resume.lines);
    for (; f->rounds > 0; f->rounds--) {
        CAIRN_STEP_CHARGE(merge, resume.lines, budget, UNITS_PER_ROUND + merge->neighbours.count);
        begin_round(f);
        for (f->neighbour = 0; f->neighbour < merge->neighbours.count; f->neighbour++)
            if (cairn_map_merge_begin_neighbour(merge))
                CAIRN_STEP_RUN(merge, resume.lines, budget, add_neighbour);
        if (end_round(f))
            break;
    }
    CAIRN_STEP_END(merge->resume.lines);
}
