/* Proposal distribution and importance weight of a particle at a keyframe.
 *
 * Method.
 *
 * 1. The path is walked back. The keyframes nearest to the expected pose form the old map, except
 *    for the most recent ones: the motion comes from their match.
 * 2. The scan is matched against the old map by ICP. Its prior is the covariance of the expected
 *    pose relative to the map, so the window grows with the drift since the map was left. The match
 *    starts at several places along the longest axis of that covariance, with a shape prior also at
 *    the pose relative to the nearest old keyframe that their shapes give, unless the drift excludes
 *    it. A match with an unobservable direction is not used.
 * 3. Candidates x are drawn from a Gaussian around each different match, with its covariance, and
 *    around the expected pose (a mixture proposal). Those around a match close a loop.
 * 4. Each candidate is weighted by p(z | old map, x), and those of a match by p(x | drift). Their
 *    mean is the weight of the particle, as in Grisetti et al., eq. 18: the candidates represent
 *    the region of the product's mass.
 * 5. p(z | map, x) is a likelihood field (Thrun, Burgard and Fox 2005, section 6.4) of the
 *    distances along the normals of the nearest points, relative to that of points off all walls.
 *    A scan of n points counts as `independent_points` independent ones.
 * 6. A loop is closed only where that ratio, averaged over all poses that the drift allows, is
 *    above 1. The larger the drift, the better the match must be.
 *
 * Dividing by the proposal density would make the weight an unbiased but noisy importance weight. A
 * few draws from narrow distributions would then decide which particles survive. The evidence of a
 * scan is used once: on the recent map for the motion, on the old one for the weight.
 *
 * Source: Grisetti, Stachniss and Burgard 2007, section III-B, with the mixture of Adluru 2008,
 * section 9.2.2, and the shape prior of its section 6.6; the average by Laplace's method: MacKay
 * 2003, chapter 27. */
#include "src/base/build.h"

#include "src/base/step.h"
#include "src/containers/ranked_list.h"
#include "src/maps/filter_mapper_work.h"

enum {
    POINTS_PER_UNIT = 2,
    CLEARED_PER_UNIT = 64,
    EMPTIED_PER_UNIT = 4,
    STARTS_COST = 12,
    QUERY_POINTS_PER_UNIT = 8,
    MODE_COST = 8,
    /* of a start: begin of its match, and mode of the match */
    START_COST = 2 + MODE_COST,
    DRAW_COST = 8,
    SHAPE_COST = 4,
    WEIGHED_COST = 2
};

/* Maximum distance of a correspondence, in sigmas: holds 99.7 % of a Gaussian. */
static const cairn_real GATE_SIGMAS = 3;
/* Minimum cosine between directions on the same side of a wall: 60 degrees, the direction gate of
 * ICP by default. */
static const cairn_real MIN_COSINE = CAIRN_REAL(0.5);
/* m: distance between starts of the match, so that every pose between two starts is within 0.2 m of
 * one: ICP converges from about 0.3 m (Limits in cairn/icp.h). */
static const cairn_real START_SPACING = CAIRN_REAL(0.4);
/* Standard deviations that the starts reach to either side: hold 95 % of a Gaussian. */
static const cairn_real SEARCHED_SIGMAS = 2;
/* m, rad: matches within both are one mode: more than ICP's ends from several starts differ, less
 * than the likelihood field distinguishes (params.sigma, 0.07 m; the angle moves a point at 2.5 m as
 * far as the distance). Own choice. */
static const cairn_real SAME_DISTANCE = CAIRN_REAL(0.05), SAME_ANGLE = CAIRN_REAL(0.02);

/* ---- The old map ---- */

static void begin_proposal(cairn_filter_mapper *mapper, const filter_mapper_path_state *last)
{
    filter_mapper_proposal *work = &mapper->proposal;

    work->ancestor = last;
    work->expected = cairn_filter_mapper_predict(mapper, last);
    work->map.count = work->start_count = work->mode_count = 0;
}

/* Removes the last points of a grid. */
static void remove_points(cairn_point_grid *points)
{
    for (int k = 0; k < EMPTIED_PER_UNIT; k++)
        cairn_point_grid_remove_last(points);
}

/* Inserts a keyframe into the list of nearest ones. */
static void insert_nearest(filter_mapper_old_map *map, int32_t most,
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

/* Walks back along the path, and inserts its old keyframes near the expected pose into the map. */
static void walk_path(cairn_filter_mapper *mapper)
{
    const cairn_filter_mapper_params *p = &mapper->params;
    filter_mapper_proposal *work = &mapper->proposal;

    for (int k = 0; k < FILTER_MAPPER_WALKED_PER_UNIT && work->ancestor != NULL; k++) {
        const filter_mapper_path_state *s = work->ancestor;
        cairn_real x = s->map_keyframe.x - work->expected.map_keyframe.x,
                   y = s->map_keyframe.y - work->expected.map_keyframe.y;
        filter_mapper_local_keyframe keyframe = {s, x * x + y * y};

        if (s->keyframe < mapper->keyframe_count - p->recent_keyframes &&
            keyframe.distance <= p->local_radius * p->local_radius)
            insert_nearest(&work->map, p->local_keyframes, keyframe);
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
    filter_mapper_old_map *map = &mapper->proposal.map;
    const filter_mapper_path_state *keyframe = map->nearest[mapper->proposal.cursor].state;
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
    const filter_mapper_old_map *map = &mapper->proposal.map;
    const cairn_scan_set_scan *scan =
        &keys->scans[map->nearest[mapper->proposal.cursor].state->keyframe];

    return 1 + (scan->end_point - scan->first_point) / POINTS_PER_UNIT;
}

/* ---- The matches ---- */

/* Sets the covariance of the expected pose relative to the nearest keyframe of the map. Where the
 * drifts are so large that their difference is lost in rounding errors it is that of the motion. */
static void set_relative_covariance(cairn_filter_mapper *mapper)
{
    filter_mapper_proposal *work = &mapper->proposal;

    work->relative =
        cairn_filter_mapper_relative_drift(work->map.nearest[0].state, &work->expected);
    if (!cairn_sym3_inverse(work->relative, &work->information)) {
        work->relative =
            cairn_filter_mapper_motion_covariance(mapper, work->expected.map_keyframe.theta);
        (void)cairn_sym3_inverse(work->relative, &work->information);
    }
}

/* Sets the starts of the match: the expected pose, and poses along the longest axis of its
 * covariance. */
static void set_starts(cairn_filter_mapper *mapper)
{
    filter_mapper_proposal *work = &mapper->proposal;
    cairn_pose expected = work->expected.map_keyframe;
    cairn_real variance[3], axis[3][3];
    int32_t side = FILTER_MAPPER_LINE_STARTS / 2;

    cairn_sym3_eigen(work->relative, variance, axis);
    work->log_spread = cairn_log(variance[0] * variance[1] * variance[2]) / 2;
    while (side > 0 && (cairn_real)side * START_SPACING > SEARCHED_SIGMAS * cairn_sqrt(variance[2]))
        side--;
    for (int32_t k = -side; k <= side; k++) {
        cairn_real step = START_SPACING * (cairn_real)k;
        cairn_pose start = {expected.x + step * axis[2][0], expected.y + step * axis[2][1],
                            cairn_wrap_angle(expected.theta + step * axis[2][2])};

        work->starts[work->start_count++] = start;
    }
}

/* ---- The shape prior ---- */

static int32_t nearest_keyframe(const cairn_filter_mapper *mapper)
{
    return mapper->proposal.map.nearest[0].state->keyframe;
}

/* Returns the pair of the scan and a keyframe if it was matched by shape; NULL: it was not. */
static const filter_mapper_shape *known_shape(const cairn_filter_mapper *mapper, int32_t keyframe)
{
    for (int32_t i = 0; i < mapper->shape_count && i < FILTER_MAPPER_KNOWN_SHAPES; i++)
        if (mapper->shapes[i].keyframe == keyframe)
            return &mapper->shapes[i];
    return NULL;
}

/* Units of beginning that match: linear in the points of both. */
static int32_t units_of_shape(const cairn_filter_mapper *mapper)
{
    const cairn_scan_set_scan *key =
        &cairn_mapper_keyframes(mapper->front)->scans[nearest_keyframe(mapper)];

    return 1 + (cairn_mapper_view(mapper->front).point_count + key->end_point - key->first_point) /
                   POINTS_PER_UNIT;
}

/* Begins to match the shapes of the scan and of the nearest keyframe, any pose. */
static void begin_shape(cairn_filter_mapper *mapper)
{
    cairn_scan_view view = cairn_mapper_view(mapper->front);
    cairn_scan_match_part query = {.points = view.points, .count = view.point_count},
                          target = {.points = mapper->points,
                                    .count = read_key(mapper, nearest_keyframe(mapper))};

    cairn_scan_match_clear_target(mapper->shape);
    cairn_must_be_ok(
        cairn_scan_match_add_target(mapper->shape, &target, cairn_pose_identity(), NULL));
    cairn_must_be_ok(
        cairn_scan_match_begin(mapper->shape, &query, cairn_pose_identity(), NULL, NULL));
    mapper->shape_matches++;
}

/* Stores the result of that match. */
static void end_shape(cairn_filter_mapper *mapper)
{
    cairn_scan_match_result result = cairn_scan_match_read(mapper->shape);
    filter_mapper_shape *shape =
        &mapper->shapes[mapper->shape_count++ % FILTER_MAPPER_KNOWN_SHAPES];

    shape->keyframe = nearest_keyframe(mapper);
    shape->is_found = result.verdict != CAIRN_SCAN_MATCH_NONE && result.count > 0;
    if (shape->is_found)
        shape->keyframe_scan = result.hypotheses[0].target_query;
}

/* Adds the pose by shape to the starts, unless it is outside what the drift allows. */
static void add_shape_start(cairn_filter_mapper *mapper)
{
    filter_mapper_proposal *work = &mapper->proposal;
    const filter_mapper_shape *shape = known_shape(mapper, nearest_keyframe(mapper));
    cairn_pose start;
    cairn_real e[3];

    if (shape == NULL || !shape->is_found)
        return;
    start = cairn_pose_compose(work->map.nearest[0].state->map_keyframe, shape->keyframe_scan);
    cairn_filter_mapper_displacement(work->expected.map_keyframe, start, e);
    if (cairn_sym3_form(work->information, e) > GATE_SIGMAS * GATE_SIGMAS)
        return;
    work->starts[work->start_count++] = start;
    mapper->shape_starts++;
}

/* The start by shape: the pair of scan and nearest keyframe is matched, unless it was for another
 * particle. */
static int find_shape_start(cairn_filter_mapper *mapper, cairn_budget *budget)
{
    filter_mapper_proposal *work = &mapper->proposal;

    CAIRN_STEP_BEGIN(work->shape_resume);
    CAIRN_STEP_CHARGE(work, shape_resume, budget, SHAPE_COST);
    if (known_shape(mapper, nearest_keyframe(mapper)) == NULL) {
        CAIRN_STEP_CHARGE(work, shape_resume, budget, units_of_shape(mapper));
        begin_shape(mapper);
        CAIRN_STEP_UNTIL(work->shape_resume,
                         cairn_scan_match_step(mapper->shape, budget) != CAIRN_MORE);
        end_shape(mapper);
    }
    add_shape_start(mapper);
    CAIRN_STEP_END(work->shape_resume);
}

/* ---- The matches from all starts ---- */

/* Units of a start, beside the alignment. */
static int32_t units_of_start(const cairn_filter_mapper *mapper)
{
    return START_COST + cairn_mapper_view(mapper->front).point_count / QUERY_POINTS_PER_UNIT;
}

/* Begins the match against the old map from the current start. */
static void begin_match(cairn_filter_mapper *mapper)
{
    filter_mapper_proposal *work = &mapper->proposal;
    cairn_scan_view view = cairn_mapper_view(mapper->front);
    cairn_rigid_motion_pose_prior prior = {.mean = work->expected.map_keyframe};
    cairn_sym3 variance = cairn_sym3_rotate_by(work->relative, -prior.mean.theta);

    prior.sigma_x = cairn_sqrt(variance.xx);
    prior.sigma_y = cairn_sqrt(variance.yy);
    prior.sigma_theta = cairn_sqrt(variance.zz);
    cairn_must_be_ok(cairn_icp_begin(mapper->icp, view.points, view.point_count,
                                     work->starts[work->start], &prior, NULL));
}

/* Adds a mode; of matches those with the largest overlaps are kept, the motion comes last. */
static void add_mode(cairn_filter_mapper *mapper, cairn_pose mean, cairn_sym3 covariance,
                     cairn_real overlap)
{
    const cairn_filter_mapper_params *p = &mapper->params;
    filter_mapper_proposal *work = &mapper->proposal;
    filter_mapper_proposal_mode mode = {.mean = mean, .overlap = overlap};
    ranked_list modes = {.entries = work->modes,
                         .count = &work->mode_count,
                         .capacity =
                             overlap > 0 ? FILTER_MAPPER_MAX_MATCHES : FILTER_MAPPER_MAX_MODES,
                         .entry_bytes = sizeof mode,
                         .score_at = offsetof(filter_mapper_proposal_mode, overlap),
                         .least_first = 0};
    cairn_real variance[3];

    covariance.xx += p->match_sigma * p->match_sigma;
    covariance.yy += p->match_sigma * p->match_sigma;
    covariance.zz += p->match_sigma_theta * p->match_sigma_theta;
    cairn_sym3_eigen(covariance, variance, mode.axis);
    for (int k = 0; k < 3; k++)
        mode.sigma[k] = cairn_sqrt(variance[k]);
    (void)ranked_list_add(&modes, &mode);
}

/* Whether a match from another start has ended at the same pose. */
static int is_known(const filter_mapper_proposal *work, cairn_pose pose)
{
    for (int32_t k = 0; k < work->mode_count; k++) {
        cairn_pose e = cairn_pose_between(work->modes[k].mean, pose);

        if (e.x * e.x + e.y * e.y < SAME_DISTANCE * SAME_DISTANCE &&
            cairn_abs(e.theta) < SAME_ANGLE)
            return 1;
    }
    return 0;
}

/* Adds a valid match as a mode of the proposal. */
static void end_match(cairn_filter_mapper *mapper)
{
    filter_mapper_proposal *work = &mapper->proposal;
    cairn_icp_result match = cairn_icp_read(mapper->icp);

    if (match.verdict == CAIRN_ICP_TOO_FEW_PAIRS || match.observable_dof < 3 ||
        match.overlap < mapper->params.min_overlap || is_known(work, match.target_query))
        return;
    add_mode(mapper, match.target_query, cairn_sym3_of_full(match.covariance), match.overlap);
}

/* Matches the scan against the old map. */
static int match_map(cairn_filter_mapper *mapper, cairn_budget *budget)
{
    filter_mapper_proposal *work = &mapper->proposal;

    CAIRN_STEP_BEGIN(work->phase_resume);
    CAIRN_STEP_CHARGE(work, phase_resume, budget,
                      1 + mapper->params.max_local_points / CLEARED_PER_UNIT);
    cairn_icp_clear_target(mapper->icp);
    for (work->cursor = 0; work->cursor < work->map.count; work->cursor++) {
        CAIRN_STEP_CHARGE(work, phase_resume, budget, units_of_key(mapper));
        if (!add_key(mapper))
            break;
    }
    if (work->map.count > 0) {
        CAIRN_STEP_CHARGE(work, phase_resume, budget, STARTS_COST);
        set_relative_covariance(mapper);
    }
    if (cairn_icp_target_count(mapper->icp) > 0)
        set_starts(mapper);
    if (mapper->shape != NULL && work->start_count > 0)
        CAIRN_STEP_UNTIL(work->phase_resume, find_shape_start(mapper, budget));
    for (work->start = 0; work->start < work->start_count; work->start++) {
        CAIRN_STEP_CHARGE(work, phase_resume, budget, units_of_start(mapper));
        begin_match(mapper);
        CAIRN_STEP_UNTIL(work->phase_resume, cairn_icp_step(mapper->icp, budget) != CAIRN_MORE);
        end_match(mapper);
    }
    mapper->revisit_matches += work->mode_count;
    CAIRN_STEP_END(work->phase_resume);
}

/* ---- The candidates ---- */

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

/* Draws the current candidate from its mode, the modes in turn. */
static void draw_candidate(cairn_filter_mapper *mapper)
{
    filter_mapper_proposal *work = &mapper->proposal;
    const filter_mapper_proposal_mode *mode = &work->modes[work->candidate % work->mode_count];
    filter_mapper_path_state *s = &work->candidates[work->candidate];

    *s = work->expected;
    s->map_keyframe = draw_from(mapper, mode);
    s->drift = cairn_filter_mapper_carry(&work->expected, s->map_keyframe);
    if (mode->overlap > 0)
        s->revisited = work->map.nearest[0].state->keyframe;
}

/* ---- Their weights ---- */

/* Returns n where every n-th point of the scan is scored. */
static int32_t stride_of(const cairn_filter_mapper *mapper, int32_t count)
{
    return 1 + (count - 1) / mapper->params.scored_points;
}

/* Returns how much more likely a point is on a map than off all walls, nats, 0 ... max_point_cost:
 * the cost is half the squared normalized distance along the normal. */
static cairn_real point_gain(const cairn_filter_mapper *mapper, const filter_mapper_old_map *map,
                             cairn_transform map_scan, cairn_oriented_point point)
{
    cairn_vec2 p = cairn_transform_point(map_scan, point.position);
    cairn_vec2 direction = cairn_transform_direction(map_scan, point.direction);
    int32_t nearest =
        cairn_point_grid_nearest(map->points, p, GATE_SIGMAS * mapper->params.sigma, NULL);
    cairn_real across;

    if (nearest < 0 || cairn_vec2_dot(direction, map->direction[nearest]) < MIN_COSINE)
        return 0;
    across = cairn_vec2_cross(map->direction[nearest],
                              cairn_vec2_sub(p, cairn_point_grid_point(map->points, nearest))) /
             mapper->params.sigma;
    return cairn_max(mapper->params.max_point_cost - across * across / 2, 0);
}

/* Sets the weight of the current candidate from its gain. A closed loop is impossible where, over
 * all poses that the drift allows, the scan is less likely on the map than off all walls (Laplace's
 * method: the volume of the match over that of the drift). */
static void set_weight(const filter_mapper_proposal *work, filter_mapper_path_state *s,
                       cairn_real gain)
{
    const filter_mapper_proposal_mode *mode = &work->modes[work->candidate % work->mode_count];
    cairn_real e[3];

    s->log_weight = gain;
    if (s->revisited < 0)
        return;
    cairn_filter_mapper_displacement(work->expected.map_keyframe, s->map_keyframe, e);
    s->log_weight -= cairn_sym3_form(work->information, e) / 2;
    if (s->log_weight + cairn_log(mode->sigma[0] * mode->sigma[1] * mode->sigma[2]) <
        work->log_spread)
        s->log_weight = -CAIRN_REAL_MAX;
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
    work->gain = 0;
    for (work->cursor = 0; work->cursor < view.point_count; work->cursor += stride) {
        CAIRN_STEP_CHARGE(work, phase_resume, budget, WEIGHED_COST);
        work->gain += point_gain(mapper, &work->map, map_scan, view.points[work->cursor]);
    }
    set_weight(work, s, work->gain * mapper->params.independent_points / (cairn_real)weighed);
    CAIRN_STEP_END(work->phase_resume);
}

/* ---- A particle ---- */

/* See Method in the head of this file. leaf: the end of the particle's path. */
static int make_candidates(cairn_filter_mapper *mapper, const filter_mapper_path_state *leaf,
                           cairn_budget *budget)
{
    filter_mapper_proposal *work = &mapper->proposal;

    CAIRN_STEP_BEGIN(work->resume);
    begin_proposal(mapper, leaf);
    while (cairn_point_grid_count(work->map.points) > 0) {
        CAIRN_STEP_CHARGE_UNIT(work, resume, budget);
        remove_points(work->map.points); /* of the previous particle */
    }
    while (work->ancestor != NULL) {
        CAIRN_STEP_CHARGE_UNIT(work, resume, budget);
        walk_path(mapper);
    }
    CAIRN_STEP_UNTIL(work->resume, match_map(mapper, budget));
    CAIRN_STEP_CHARGE(work, resume, budget, MODE_COST);
    add_mode(mapper, work->expected.map_keyframe, cairn_sym3_zero(), 0);
    for (work->candidate = 0; work->candidate < mapper->params.candidates; work->candidate++) {
        CAIRN_STEP_CHARGE(work, resume, budget, DRAW_COST);
        draw_candidate(mapper);
    }
    for (work->candidate = 0; work->candidate < mapper->params.candidates; work->candidate++)
        if (work->map.count > 0)
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
