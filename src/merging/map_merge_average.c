/* The pose of a map that is distorted against its neighbours: the mean over all walls (registration
 * by surface points).
 *
 * Two maps that are bent against each other agree to a cell in some part only, and the refinement by
 * lines ends where the longest walls do. The pose that is least off in the mean is that of all
 * surface points together, none of which agrees well.
 *
 * Method:
 * 1. The surface points of either map are projected along their normals onto the surface of the
 *    other. The point-to-line residuals have Cauchy weights, whose scale is that of the residuals.
 * 2. Maps whose residuals have less than DISTORTED_CELLS stay where the refinement by lines put
 *    them: it is more accurate where the walls are straight.
 * 3. Gauss-Newton steps, with priors of the position and the heading, until one is short, or
 *    ROUNDS.
 *
 * Limits: surfaces within 2.5 cells of a point count. Several distorted maps move in turn, once each.
 * One scale holds for all neighbours of a map, that of the coarsest cells.
 *
 * Source: Chen and Medioni 1992 (point to plane); Holland and Welsch 1977 (Cauchy weights). */
#include "src/base/build.h"

#include <string.h>

#include "src/merging/map_merge_work.h"

/* cells: scale of the residuals from which on maps are distorted. Generated maps without distortion
 * have 0.48 to 0.56, real maps that are bent by two cells 0.8 to 1.2. */
#define DISTORTED_CELLS CAIRN_REAL(0.65)
/* cells: scale of the residuals at the start; its lower bound; the longest step; a step that ends the
 * iteration */
#define START_SIGMA_CELLS CAIRN_REAL(1.0)
#define MIN_SIGMA_CELLS   CAIRN_REAL(0.1)
#define MAX_STEP_CELLS    CAIRN_REAL(0.5)
#define CONVERGED_CELLS   CAIRN_REAL(0.004)

/* cells and rad: prior standard deviations of the pose at the start. The points give the position where
 * they observe it at all, lines the heading. */
#define PRIOR_SIGMA_CELLS CAIRN_REAL(1.0)
#define PRIOR_SIGMA_RAD   CAIRN_REAL(0.002)

enum { ROUNDS = 12, MIN_PAIRS = 20, UNITS_PER_POINT = 2, UNITS_PER_ROUND = 8 };

/* A point of the surface, between the occupied cell of a point and free space. */
static cairn_vec2 surface_of(const map_merge_point *point, const map_merge_map *map)
{
    return cairn_vec2_add(point->position,
                          cairn_vec2_scale(point->normal, map->input.resolution / 2));
}

/* Adds a surface point of the map against the surface of the current neighbour, or, is_own 0, one of
 * the neighbour against that of the map. */
static void add_point(map_merge_fit *fit, const map_merge_map *body, const map_merge_point *point,
                      int is_own)
{
    cairn_transform seen = is_own ? fit->to_neighbour : fit->to_map;
    cairn_vec2 surface = surface_of(point, is_own ? body : fit->other),
               p = cairn_transform_point(seen, surface),
               n = cairn_transform_direction(seen, point->normal);
    cairn_real along, row[3];

    if (!cairn_map_merge_surface_along(is_own ? fit->other : body, p, n, &along))
        return;
    if (!is_own) {
        surface = cairn_vec2_add(p, cairn_vec2_scale(n, along));
        n = point->normal;
        along = -along;
    }
    (void)cairn_registration_add_pair(
        &fit->robust, surface, cairn_transform_direction(fit->neighbour_transform, n), -along, row);
}

/* Step: adds the surface points of the map and of the current neighbour. */
static int add_neighbour(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_fit *fit = &merge->fit;
    const map_merge_map *body = &merge->maps[fit->map];

    CAIRN_STEP_BEGIN(merge->resume.neighbour);
    for (fit->point = 0; fit->point < body->point_count; fit->point++) {
        CAIRN_STEP_CHARGE(merge, resume.neighbour, budget, UNITS_PER_POINT);
        add_point(fit, body, &body->points[fit->point], 1);
    }
    for (fit->point = 0; fit->point < fit->other->point_count; fit->point++) {
        CAIRN_STEP_CHARGE(merge, resume.neighbour, budget, UNITS_PER_POINT);
        add_point(fit, body, &fit->other->points[fit->point], 0);
    }
    CAIRN_STEP_END(merge->resume.neighbour);
}

static void begin_round(map_merge_fit *fit)
{
    const cairn_vec2 centre = {0, 0};

    memset(&fit->robust.sums, 0, sizeof fit->robust.sums);
    fit->robust.motion = cairn_rigid_motion_at(fit->pose, centre, MAP_MERGE_BODY_RADIUS_M);
}

/* Moves the map; returns 1 when it stays from here on. */
static int end_round(map_merge_fit *fit, int is_first)
{
    cairn_registration *robust = &fit->robust;
    cairn_real cell = robust->gate / MAX_STEP_CELLS;
    const cairn_rigid_motion_pose_prior prior = {fit->start, PRIOR_SIGMA_CELLS * cell,
                                                 PRIOR_SIGMA_CELLS * cell, PRIOR_SIGMA_RAD};
    cairn_rigid_motion_basis basis;
    cairn_real step[3];

    if (robust->sums.pairs < MIN_PAIRS)
        return 1;
    cairn_registration_update_sigma(robust);
    if (is_first && robust->sigma < DISTORTED_CELLS * cell)
        return 1;
    basis = cairn_rigid_motion_basis_of(robust->sums.equations.information, 0);
    if (!cairn_registration_move(robust, &basis, &robust->sums.equations,
                                 robust->sigma * robust->sigma, &prior, step))
        return 1;
    fit->pose = robust->motion.map_body;
    return cairn_sqrt(step[0] * step[0] + step[1] * step[1] + step[2] * step[2]) <
           CONVERGED_CELLS * cell;
}

/* The largest side of the cells of the map and of its neighbours, m. */
static cairn_real largest_cell(const cairn_map_merge *merge, int32_t map)
{
    cairn_real cell = merge->maps[map].input.resolution;

    for (int32_t i = 0; i < merge->neighbours.count; i++)
        cell = cairn_max(cell, merge->maps[merge->neighbours.maps[i]].input.resolution);
    return cell;
}

void cairn_map_merge_begin_average(cairn_map_merge *merge, int32_t map, cairn_pose pose)
{
    cairn_registration *robust = &merge->fit.robust;
    cairn_real cell = largest_cell(merge, map);

    cairn_map_merge_begin_fit(merge, map, pose, pose, ROUNDS);
    robust->sigma = START_SIGMA_CELLS * cell;
    robust->min_sigma = MIN_SIGMA_CELLS * cell;
    robust->gate = MAX_STEP_CELLS * cell;
}

int cairn_map_merge_step_average(cairn_map_merge *merge, cairn_budget *budget)
{
    map_merge_fit *fit = &merge->fit;

    CAIRN_STEP_BEGIN(merge->resume.lines);
    for (; fit->rounds > 0; fit->rounds--) {
        CAIRN_STEP_CHARGE(merge, resume.lines, budget,
                          UNITS_PER_ROUND + 2 * merge->neighbours.count);
        begin_round(fit);
        for (fit->neighbour = 0; fit->neighbour < merge->neighbours.count; fit->neighbour++)
            if (cairn_map_merge_begin_neighbour(merge))
                CAIRN_STEP_RUN(merge, resume.lines, budget, add_neighbour);
        if (end_round(fit, fit->rounds == ROUNDS))
            break;
    }
    CAIRN_STEP_END(merge->resume.lines);
}
