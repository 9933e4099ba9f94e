/* Proposal distribution and importance weight of a particle at a keyframe.
 *
 * Method.
 *
 * 1. The path is walked back. Of the keyframes near the expected pose the most recent ones form the
 *    recent map, the others the old map.
 * 2. The scan is matched against each map alone by ICP, with the motion as prior. Against both
 *    together the nearer, recent map would always win when a particle returns to a known place.
 * 3. Candidates x are drawn from a Gaussian around each match, with its covariance (a mixture
 *    proposal).
 * 4. Each candidate is weighted by p(z | recent map, x) p(z | old map, x) p(x | motion). Their mean
 *    is the weight of the particle, as in Grisetti et al., eq. 18: the candidates represent the
 *    region of the product's mass.
 * 5. p(z | map, x) is a likelihood field (Thrun, Burgard and Fox 2005, section 6.4) of the
 *    distances along the normals of the nearest points. A scan of n points counts as
 *    `independent_points` independent ones.
 *
 * Dividing by the proposal density would make the weight an unbiased but noisy importance weight. A
 * few draws from narrow distributions would then decide which particles survive. Measured: half of
 * all steps resampled, against less than one in ten without. The scan of a path whose ends do not
 * meet fits one of the maps, never both.
 *
 * Source: Grisetti, Stachniss and Burgard 2007, section III-B, with the mixture of Adluru 2008,
 * section 9.2.2. */
#include "src/base/build.h"

#include "src/base/step.h"
#include "src/containers/ranked_list.h"
#include "src/maps/filter_mapper_work.h"

enum {
    WALKED_PER_UNIT = 8,
    POINTS_PER_UNIT = 2,
    CLEARED_PER_UNIT = 64,
    EMPTIED_PER_UNIT = 4,
    DRAW_COST = 8
};

/* maximum distance of a correspondence, in sigmas */
static const cairn_real GATE_SIGMAS = 3;
/* minimum cosine between directions on the same side of a wall */
static const cairn_real MIN_COSINE = CAIRN_REAL(0.5);

/* ---- The local maps ---- */

static void begin(cairn_filter_mapper *mapper, const filter_mapper_path_state *leaf)
{
    filter_mapper_proposal *work = &mapper->proposal;

    work->ancestor = leaf;
    work->expected = cairn_pose_compose(leaf->map_keyframe, mapper->motion);
    work->maps[FILTER_MAPPER_RECENT_MAP].count = work->maps[FILTER_MAPPER_OLD_MAP].count = 0;
    work->mode_count = 0;
}

/* The current local map. */
static filter_mapper_local_map *map_of(filter_mapper_proposal *work)
{
    return &work->maps[work->map_index];
}

/* Removes the last points of a grid. */
static void remove_points(cairn_point_grid *points)
{
    for (int k = 0; k < EMPTIED_PER_UNIT; k++)
        cairn_point_grid_remove_last(points);
}

/* Inserts a keyframe into the list of nearest ones. */
static void insert_nearest(filter_mapper_local_map *map, int32_t most,
                           filter_mapper_local_keyframe keyframe)
{
    ranked_list nearest = {.entries = map->nearest,
                           .count = &map->count,
                           .capacity = most,
                           .entry_bytes = sizeof keyframe,
                           .score_at = offsetof(filter_mapper_local_keyframe, distance),
                           .least_first = 1};

    (void)ranked_list_add(&nearest, &keyframe);
}

/* Walks back along the path, and inserts its keyframes near the expected pose into the maps. */
static void walk_path(cairn_filter_mapper *mapper)
{
    const cairn_filter_mapper_params *p = &mapper->params;
    filter_mapper_proposal *work = &mapper->proposal;

    for (int k = 0; k < WALKED_PER_UNIT && work->ancestor != NULL; k++) {
        const filter_mapper_path_state *s = work->ancestor;
        cairn_real x = s->map_keyframe.x - work->expected.x,
                   y = s->map_keyframe.y - work->expected.y;
        filter_mapper_local_keyframe keyframe = {s->map_keyframe, x * x + y * y, s->keyframe};

        if (keyframe.distance <= p->local_radius * p->local_radius)
            insert_nearest(&work->maps[s->keyframe < mapper->keyframe_count - p->recent_keyframes
                                           ? FILTER_MAPPER_OLD_MAP
                                           : FILTER_MAPPER_RECENT_MAP],
                           p->local_keyframes, keyframe);
        work->ancestor = cairn_particle_filter_state_before(s);
    }
}

/* Copies the points of a keyframe, in its own frame; returns their number. */
static int32_t read_key(cairn_filter_mapper *mapper, int32_t keyframe)
{
    const cairn_scan_set *keys = cairn_mapper_keyframes(mapper->front);
    const cairn_scan_set_scan *scan = &keys->scans[keyframe];
    int32_t count = 0;

    for (int32_t s = scan->first_segment; s < scan->end_segment; s++)
        for (int32_t p = keys->segments[s].first_point; p < keys->segments[s].end_point; p++) {
            mapper->points[count].position = keys->points[p];
            mapper->points[count].direction = keys->segments[s].direction;
            count++;
        }
    return count;
}

/* Adds the keyframe at the cursor of the current map to the target of the match and to the grid.
 * Returns 0 without capacity. */
static int add_key(cairn_filter_mapper *mapper)
{
    filter_mapper_local_map *map = map_of(&mapper->proposal);
    const filter_mapper_local_keyframe *keyframe = &map->nearest[mapper->proposal.cursor];
    int32_t count = read_key(mapper, keyframe->keyframe);
    cairn_transform map_key = cairn_transform_of(keyframe->map_keyframe);

    if (count > mapper->params.max_local_points - cairn_point_grid_count(map->points))
        return 0;
    cairn_must_be_ok(
        cairn_icp_add_target(mapper->icp, mapper->points, count, keyframe->map_keyframe, NULL));
    for (int32_t i = 0; i < count; i++) {
        map->direction[cairn_point_grid_count(map->points)] =
            cairn_transform_direction(map_key, mapper->points[i].direction);
        cairn_must_be_ok(cairn_point_grid_insert(
            map->points, cairn_transform_point(map_key, mapper->points[i].position)));
    }
    return 1;
}

/* Units of that keyframe. */
static int32_t units_of_key(cairn_filter_mapper *mapper)
{
    const cairn_scan_set *keys = cairn_mapper_keyframes(mapper->front);
    const filter_mapper_local_map *map = map_of(&mapper->proposal);
    const cairn_scan_set_scan *scan = &keys->scans[map->nearest[mapper->proposal.cursor].keyframe];

    return 1 + (scan->end_point - scan->first_point) / POINTS_PER_UNIT;
}

/* ---- The matches ---- */

/* Begins the match against the current local map; returns 0 when that is empty. */
static int begin_match(cairn_filter_mapper *mapper)
{
    cairn_scan_view view = cairn_mapper_view(mapper->front);
    cairn_rigid_motion_pose_prior prior = {mapper->proposal.expected, mapper->sigma_distance,
                                           mapper->sigma_distance, mapper->sigma_theta};

    return cairn_icp_begin(mapper->icp, view.points, view.point_count, mapper->proposal.expected,
                           &prior, NULL) == CAIRN_OK;
}

static void add_mode(cairn_filter_mapper *mapper, cairn_pose mean, cairn_sym3 covariance)
{
    filter_mapper_proposal_mode *p = &mapper->proposal.modes[mapper->proposal.mode_count++];
    cairn_real variance[3];

    p->mean = mean;
    cairn_sym3_eigen(covariance, variance, p->axis);
    for (int k = 0; k < 3; k++)
        p->sigma[k] = cairn_sqrt(variance[k]);
}

/* Adds a valid match as a mode of the proposal. */
static void end_match(cairn_filter_mapper *mapper)
{
    const cairn_filter_mapper_params *p = &mapper->params;
    cairn_icp_result match = cairn_icp_read(mapper->icp);
    const cairn_real *c = match.covariance;
    cairn_sym3 covariance = {c[0] + p->match_sigma * p->match_sigma,
                             c[1],
                             c[2],
                             c[4] + p->match_sigma * p->match_sigma,
                             c[5],
                             c[8] + p->match_sigma_theta * p->match_sigma_theta};

    if (match.verdict == CAIRN_ICP_TOO_FEW_PAIRS || match.overlap < p->min_overlap)
        return;
    add_mode(mapper, match.target_query, covariance);
    mapper->revisit_matches += mapper->proposal.map_index == FILTER_MAPPER_OLD_MAP;
}

/* Matches the scan against the current local map. */
static int match_map(cairn_filter_mapper *mapper, cairn_budget *budget)
{
    filter_mapper_proposal *work = &mapper->proposal;

    CAIRN_STEP_BEGIN(work->phase_resume);
    CAIRN_STEP_CHARGE(work, phase_resume, budget,
                      1 + mapper->params.max_local_points / CLEARED_PER_UNIT);
    cairn_icp_clear_target(mapper->icp);
    for (work->cursor = 0; work->cursor < map_of(work)->count; work->cursor++) {
        CAIRN_STEP_CHARGE(work, phase_resume, budget, units_of_key(mapper));
        if (!add_key(mapper))
            break;
    }
    if (begin_match(mapper)) {
        CAIRN_STEP_UNTIL(work->phase_resume, cairn_icp_step(mapper->icp, budget) != CAIRN_MORE);
        end_match(mapper);
    }
    CAIRN_STEP_END(work->phase_resume);
}

/* ---- The candidates ---- */

/* Without a valid match the motion model alone is the proposal. */
static void end_matches(cairn_filter_mapper *mapper)
{
    cairn_real distance = mapper->sigma_distance * mapper->sigma_distance,
               turn = mapper->sigma_theta * mapper->sigma_theta;
    cairn_sym3 motion = {distance, 0, 0, distance, 0, turn};

    if (mapper->proposal.mode_count == 0)
        add_mode(mapper, mapper->proposal.expected, motion);
}

static cairn_pose draw_from(cairn_filter_mapper *mapper, const filter_mapper_proposal_mode *from)
{
    cairn_real e[3] = {0, 0, 0};
    cairn_pose pose;

    for (int k = 0; k < 3; k++) {
        cairn_real step = from->sigma[k] * cairn_random_normal(&mapper->random);

        for (int i = 0; i < 3; i++)
            e[i] += step * from->axis[k][i];
    }
    pose.x = from->mean.x + e[0];
    pose.y = from->mean.y + e[1];
    pose.theta = cairn_wrap_angle(from->mean.theta + e[2]);
    return pose;
}

/* Returns the log density of a motion up to a common constant, nats. */
static cairn_real log_motion(const cairn_filter_mapper *mapper, cairn_pose x)
{
    cairn_pose e = cairn_pose_between(mapper->proposal.expected, x);
    cairn_real distance = mapper->sigma_distance, turn = e.theta / mapper->sigma_theta;

    return -((e.x * e.x + e.y * e.y) / (distance * distance) + turn * turn) / 2;
}

/* Draws the current candidate from its mode, the modes in turn. */
static void draw_candidate(cairn_filter_mapper *mapper)
{
    filter_mapper_proposal *work = &mapper->proposal;
    filter_mapper_path_state *s = &work->candidates[work->candidate];

    s->keyframe = mapper->keyframe_count;
    s->map_keyframe = draw_from(mapper, &work->modes[work->candidate % work->mode_count]);
    s->log_weight = log_motion(mapper, s->map_keyframe);
}

/* ---- Their weights ---- */

/* Returns n where every n-th point of the scan is scored. */
static int32_t stride_of(const cairn_filter_mapper *mapper, int32_t count)
{
    return (count + mapper->params.scored_points - 1) / mapper->params.scored_points;
}

/* Returns the cost of a point against a map: half the squared normalized distance along the normal,
 * 0 ... max_point_cost. */
static cairn_real point_cost(const cairn_filter_mapper *mapper, const filter_mapper_local_map *map,
                             cairn_transform map_scan, cairn_oriented_point point)
{
    cairn_vec2 p = cairn_transform_point(map_scan, point.position);
    cairn_vec2 direction = cairn_transform_direction(map_scan, point.direction);
    int32_t nearest =
        cairn_point_grid_nearest(map->points, p, GATE_SIGMAS * mapper->params.sigma, NULL);
    cairn_real across;

    if (nearest < 0 || cairn_vec2_dot(direction, map->direction[nearest]) < MIN_COSINE)
        return mapper->params.max_point_cost;
    across = cairn_vec2_cross(map->direction[nearest],
                              cairn_vec2_sub(p, cairn_point_grid_point(map->points, nearest))) /
             mapper->params.sigma;
    return cairn_min(across * across / 2, mapper->params.max_point_cost);
}

/* Adds the cost of the point at the cursor against both maps. */
static void weigh_point(cairn_filter_mapper *mapper, cairn_transform map_scan,
                        cairn_oriented_point point)
{
    for (int which = 0; which < FILTER_MAPPER_LOCAL_MAPS; which++)
        mapper->proposal.cost += point_cost(mapper, &mapper->proposal.maps[which], map_scan, point);
}

/* Weighs the current candidate by every n-th point of the scan. */
static int weigh_candidate(cairn_filter_mapper *mapper, cairn_budget *budget)
{
    filter_mapper_proposal *work = &mapper->proposal;
    filter_mapper_path_state *s = &work->candidates[work->candidate];
    cairn_transform map_scan = cairn_transform_of(s->map_keyframe);
    cairn_scan_view view = cairn_mapper_view(mapper->front);
    int32_t stride = stride_of(mapper, view.point_count),
            weighed = (view.point_count + stride - 1) / stride;

    CAIRN_STEP_BEGIN(work->phase_resume);
    work->cost = 0;
    for (work->cursor = 0; work->cursor < view.point_count; work->cursor += stride) {
        CAIRN_STEP_CHARGE(work, phase_resume, budget, 2 * FILTER_MAPPER_LOCAL_MAPS);
        weigh_point(mapper, map_scan, view.points[work->cursor]);
    }
    s->log_weight -= work->cost * mapper->params.independent_points / (cairn_real)weighed;
    CAIRN_STEP_END(work->phase_resume);
}

/* ---- A particle ---- */

/* See Method in the head of this file. leaf: the end of the particle's path. */
static int make_candidates(cairn_filter_mapper *mapper, const filter_mapper_path_state *leaf,
                           cairn_budget *budget)
{
    filter_mapper_proposal *work = &mapper->proposal;

    CAIRN_STEP_BEGIN(work->resume);
    begin(mapper, leaf);
    for (work->map_index = 0; work->map_index < FILTER_MAPPER_LOCAL_MAPS; work->map_index++)
        while (cairn_point_grid_count(map_of(work)->points) > 0) {
            CAIRN_STEP_CHARGE_UNIT(work, resume, budget);
            remove_points(map_of(work)->points); /* of the previous particle */
        }
    while (work->ancestor != NULL) {
        CAIRN_STEP_CHARGE_UNIT(work, resume, budget);
        walk_path(mapper);
    }
    for (work->map_index = 0; work->map_index < FILTER_MAPPER_LOCAL_MAPS; work->map_index++)
        CAIRN_STEP_UNTIL(work->resume, match_map(mapper, budget));
    end_matches(mapper);
    for (work->candidate = 0; work->candidate < mapper->params.candidates; work->candidate++) {
        CAIRN_STEP_CHARGE(work, resume, budget, DRAW_COST);
        draw_candidate(mapper);
    }
    for (work->candidate = 0; work->candidate < mapper->params.candidates; work->candidate++)
        CAIRN_STEP_UNTIL(work->resume, weigh_candidate(mapper, budget));
    CAIRN_STEP_END(work->resume);
}

static cairn_status propose(void *context, cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    cairn_filter_mapper *mapper = context;

    if (!make_candidates(mapper, cairn_particle_filter_particle(filter, index).state, budget))
        return CAIRN_MORE;
    for (int32_t k = 0; k < mapper->params.candidates; k++)
        cairn_must_be_ok(cairn_particle_filter_offer(filter, &mapper->proposal.candidates[k], 0));
    return CAIRN_OK;
}

/* Likelihood callback: returns the weight computed when the candidate was drawn, since the local
 * maps are those of one particle at a time. */
static cairn_status likelihood(void *context, const cairn_particle_filter *filter, int32_t index,
                               const void *state, cairn_real *log_likelihood, cairn_budget *budget)
{
    const filter_mapper_path_state *s = state;

    (void)context;
    (void)filter;
    (void)index;
    (void)budget;
    *log_likelihood = s->log_weight;
    return CAIRN_OK;
}

cairn_particle_filter_model cairn_filter_mapper_model(cairn_filter_mapper *mapper)
{
    cairn_particle_filter_model model = {mapper, propose, likelihood, NULL, NULL};

    return model;
}
