/* scan_match: refinement of one hypothesis by robust point-to-line ICP, and its inlier and
 * free-space-violation counts.
 *
 * Method:
 * 1. Robust Gauss-Newton steps of registration; unobservable directions are not moved.
 * 2. Stages of more and more points, the last with one point per beam, so that every range has
 *    equal weight.
 * 3. Covariance of an M-estimator (Huber 1981, section 7.6). Its information is formed from the
 *    products of the normals of both points of a pair. Plain Gauss-Newton uses one normal twice:
 *    the squared noise of the normals of a bare wall is then false information along the wall.
 *    Products of independent normals cancel it. Errors that do not average out
 *    (bent surfaces, the choice of pairs) are a floor: with a thousand beams they dominate.
 * 4. Scoring: query points on a target surface are inliers, those in its free space are violations;
 *    target samples are tested in the query's visibility profile. */
#include "src/base/build.h"

#include <string.h>

#include "src/scans/scan_match_work.h"

/* direction gate of a pair */
static const cairn_real MIN_PAIR_COSINE = CAIRN_REAL(0.7);
/* direction gate of an inlier */
static const cairn_real MIN_INLIER_COSINE = CAIRN_REAL(0.85);
/* spacings: distance gate of an inlier */
static const cairn_real INLIER_GATE = CAIRN_REAL(1.5);
/* spacings: distance from the surface at which a point has half weight */
static const cairn_real HALF_WEIGHT_DISTANCE = CAIRN_REAL(0.3);
/* spacings: standard deviation of the covariance floor */
static const cairn_real COVARIANCE_FLOOR = CAIRN_REAL(0.015);
/* least information ratio of a direction that a step may move */
static const cairn_real MIN_STEP_RATIO = CAIRN_REAL(3e-4);
/* spacings, and share of the distance: least distance before a surface of a free-space violation */
static const cairn_real FREE_SPACE_MARGIN = 1, FREE_SPACE_MARGIN_RATIO = CAIRN_REAL(0.01);

/* variance of a residual beside the prior, in sigma^2 */
static const cairn_real VARIANCE_FACTOR = 2;

enum { MIN_PAIRS = 4 };

/* Points, iterations, hypotheses kept (at least twice max_hypotheses; 0: max_hypotheses), dense,
 * gates. */
static const scan_match_stage STAGES[SCAN_MATCH_STAGES + 1] = {
    {48, 3, 16, 0, 5, 3},
    {128, 6, 0, 0, 3, CAIRN_REAL(1.5)},
    {1 << 20, 8, 0, 1, 2, 1},
    {1 << 20, 0, 0, 1, 2, 2}, /* evaluation only */
};

const scan_match_stage *cairn_scan_match_current_stage(const cairn_scan_match *match)
{
    return &STAGES[match->stage];
}

void cairn_scan_match_fit_begin(cairn_scan_match *match, cairn_pose pose)
{
    const scan_match_stage *stage = &STAGES[match->stage];
    scan_match_fit *fit = &match->fit;
    int32_t dense = stage->dense && match->query.dense_count > 0;
    int32_t both = dense && match->dense_count > 0 && !match->lacks_dense;

    memset(fit, 0, sizeof *fit);
    fit->points = dense ? match->query.dense : match->query.points;
    fit->count = dense ? match->query.dense_count : match->query.count;
    fit->index = both ? &match->dense_index : &match->index;
    fit->stride = (fit->count + stage->points - 1) / stage->points;
    fit->robust.motion = cairn_rigid_motion_at(pose, match->centroid, match->radius);
    fit->robust.gate = stage->gate_start * match->params.spacing;
    fit->robust.sigma = match->stage == 0 ? fit->robust.gate / 2 : match->params.spacing / 2;
    fit->robust.min_sigma = match->params.min_sigma;
    match->index_in_phase = 0;
}

/* Adds the symmetric product of a pair's two Jacobian rows, one per normal. */
static void add_cross(cairn_scan_match *match, const cairn_real row[3], cairn_vec2 direction,
                      cairn_vec2 position, cairn_real weight)
{
    cairn_real other[3], sum[3], difference[3];

    cairn_rigid_motion_jacobian(&match->fit.robust.motion, cairn_vec2_left_perp(direction),
                                position, other);
    for (int k = 0; k < 3; k++) {
        sum[k] = row[k] + other[k];
        difference[k] = row[k] - other[k];
    }
    cairn_sym3_add_outer(&match->fit.cross, sum, weight / 4);
    cairn_sym3_add_outer(&match->fit.cross, difference, -weight / 4);
}

static void add_pair(cairn_scan_match *match, const cairn_oriented_point *point)
{
    scan_match_fit *fit = &match->fit;
    cairn_transform target_query = fit->robust.motion.transform;
    scan_match_search search;
    const cairn_oriented_point *m;
    cairn_real error, weight, row[3];
    cairn_vec2 normal;
    int32_t parts = 20;

    search.p = cairn_transform_point(target_query, point->position);
    search.direction = cairn_transform_direction(target_query, point->direction);
    search.cosine = MIN_PAIR_COSINE;
    m = cairn_scan_match_index_nearest(fit->index, &search, fit->robust.gate, &parts);
    cairn_scan_match_charge(match, parts);
    if (m == NULL)
        return;
    normal = cairn_vec2_left_perp(m->direction);
    error = cairn_vec2_dot(normal, cairn_vec2_sub(search.p, m->position));
    weight = cairn_registration_add_pair(&fit->robust, point->position, normal, error, row);
    if (STAGES[match->stage].dense)
        add_cross(match, row, search.direction, point->position, weight);
}

/* Adds the covariance floor: COVARIANCE_FLOOR spacings of any motion about the centroid. */
static void add_covariance_floor(const cairn_scan_match *match, cairn_real covariance[9])
{
    cairn_real sigma = COVARIANCE_FLOOR * match->params.spacing, by = 1 / (sigma * sigma), more[9];
    const cairn_rigid_motion_equations isotropic = {.information = {by, 0, 0, by, 0, by}};

    cairn_rigid_motion_covariance(&match->fit.robust.motion, NULL, NULL, &isotropic, more);
    for (int k = 0; k < 9; k++)
        covariance[k] += more[k];
}

/* Stores the refined pose; of the last stage also its covariance and observability. */
static void store_hypothesis(cairn_scan_match *match, const cairn_rigid_motion_basis *basis)
{
    cairn_scan_match_hypothesis *h = &match->hypotheses[match->hypothesis_index];
    const cairn_registration *robust = &match->fit.robust;
    cairn_rigid_motion_basis seen;

    h->target_query = robust->motion.map_body;
    if (!STAGES[match->stage].dense)
        return;
    cairn_scan_match_charge(match, 40 * SCAN_MATCH_PARTS_PER_UNIT);
    h->pairs = robust->sums.pairs;
    h->sigma = robust->sigma;
    h->radius = match->radius;
    h->observable_dof = 0;
    h->weak_ratio = 0;
    memset(h->weak_direction, 0, sizeof h->weak_direction);
    if (basis != NULL) {
        seen = cairn_rigid_motion_basis_of(match->fit.cross, match->params.weak_ratio);
        basis = &seen;
        h->observable_dof = 3 - basis->unobservable;
        h->weak_ratio = basis->inverse_condition;
        memcpy(h->weak_direction, basis->vectors[0], sizeof h->weak_direction);
    }
    cairn_registration_covariance(robust, basis, match->fit.cross,
                                  match->has_window ? &match->prior : NULL, h->covariance);
    add_covariance_floor(match, h->covariance);
}

/* Returns 1 when the prior is used. In the early stages the residual scale is that of the search,
 * and the prior would attract the candidates of a wide window to its centre. There it is used only
 * when the whole window lies within the gate. */
static int32_t uses_prior(const cairn_scan_match *match)
{
    const scan_match_stage *stage = &STAGES[match->stage];

    return match->has_window && (stage->dense || 2 * match->window.distance <=
                                                     stage->gate_start * match->params.spacing);
}

/* One Gauss-Newton step; returns 1 at the end of the refinement. */
static int32_t end_iteration(cairn_scan_match *match)
{
    const scan_match_stage *stage = &STAGES[match->stage];
    scan_match_fit *fit = &match->fit;
    cairn_registration *robust = &fit->robust;
    cairn_rigid_motion_basis basis;
    cairn_real step[3], moved, gate_end = stage->gate_end * match->params.spacing,
                               sigma = robust->sigma;

    cairn_scan_match_charge(match, 24 * SCAN_MATCH_PARTS_PER_UNIT);
    fit->iteration++;
    if (robust->sums.pairs < MIN_PAIRS) {
        store_hypothesis(match, NULL);
        return 1;
    }
    cairn_registration_update_sigma(robust);
    basis = cairn_rigid_motion_basis_of(robust->sums.equations.information, MIN_STEP_RATIO);
    if (stage->iterations == 0 ||
        !cairn_registration_move(robust, &basis, &robust->sums.equations,
                                 VARIANCE_FACTOR * robust->sigma * robust->sigma,
                                 uses_prior(match) ? &match->prior : NULL, step)) {
        store_hypothesis(match, &basis);
        return 1;
    }
    moved = cairn_sqrt(step[0] * step[0] + step[1] * step[1] + step[2] * step[2]);
    if (fit->iteration == stage->iterations ||
        (moved < CAIRN_REAL(1e-3) * match->params.spacing && robust->gate <= gate_end &&
         robust->sigma > CAIRN_REAL(0.95) * sigma)) {
        store_hypothesis(match, &basis);
        return 1;
    }
    robust->gate = cairn_max(gate_end, CAIRN_REAL(0.7) * robust->gate);
    memset(&robust->sums, 0, sizeof robust->sums);
    fit->cross = cairn_sym3_zero();
    match->index_in_phase = 0;
    return 0;
}

int32_t cairn_scan_match_fit_item(cairn_scan_match *match)
{
    if (match->index_in_phase >= match->fit.count)
        return end_iteration(match);
    add_pair(match, &match->fit.points[match->index_in_phase]);
    match->index_in_phase += match->fit.stride;
    return 0;
}

/* ---- Inliers and free-space violations ---- */

void cairn_scan_match_score_begin(cairn_scan_match *match)
{
    const scan_match_stage *stage = &STAGES[match->stage];
    int32_t target_samples;

    memset(&match->inlier_count, 0, sizeof match->inlier_count);
    match->target_query =
        cairn_transform_of(match->hypotheses[match->hypothesis_index].target_query);
    match->query_target = cairn_transform_of(
        cairn_pose_inverse(match->hypotheses[match->hypothesis_index].target_query));
    match->query_stride = match->fit.stride;
    target_samples = stage->points < SCAN_MATCH_MAX_TARGET_SAMPLES ? stage->points
                                                                   : SCAN_MATCH_MAX_TARGET_SAMPLES;
    match->target_stride = (match->target_count + target_samples - 1) / target_samples;
    match->index_in_phase = 0;
}

/* Returns the observation of a view at a point in the frame of its part. */
static cairn_visibility_answer observe(const cairn_scan_match *match, const scan_match_view *view,
                                       cairn_vec2 point)
{
    const cairn_vec2 unknown_normal = {0, 0};
    const cairn_visibility_rule rule = {
        .clearance = FREE_SPACE_MARGIN * match->params.spacing,
        .clearance_of_range = 0,
        .depth = FREE_SPACE_MARGIN * match->params.spacing,
        .margin_of_distance = FREE_SPACE_MARGIN_RATIO,
        .beside = 1,
        .is_closed = 0,
    };

    return cairn_visibility_query(&view->visibility, point, unknown_normal, &rule);
}

static void test_query_point(cairn_scan_match *match, const cairn_oriented_point *point)
{
    const cairn_oriented_point *m;
    scan_match_search search;
    int32_t parts = 20;

    search.p = cairn_transform_point(match->target_query, point->position);
    search.direction = cairn_transform_direction(match->target_query, point->direction);
    search.cosine = MIN_INLIER_COSINE;
    match->inlier_count.query_points++;
    m = cairn_scan_match_index_nearest(match->fit.index, &search,
                                       INLIER_GATE * match->params.spacing, &parts);
    if (m != NULL) {
        cairn_real e = cairn_vec2_dot(cairn_vec2_left_perp(m->direction),
                                      cairn_vec2_sub(search.p, m->position)) /
                       (HALF_WEIGHT_DISTANCE * match->params.spacing);

        match->inlier_count.fit_sum += 1 / (1 + e * e);
        match->inlier_count.inliers++;
        cairn_scan_match_charge(match, parts);
        return;
    }
    for (int32_t i = 0; i < match->view_count; i++) {
        parts += 8;
        if (observe(match, &match->views[i],
                    cairn_transform_point(match->views[i].part_target, search.p)) ==
            CAIRN_VISIBILITY_FREE) {
            match->inlier_count.violations++;
            break;
        }
    }
    cairn_scan_match_charge(match, parts);
}

static void test_target_point(cairn_scan_match *match, const cairn_oriented_point *point)
{
    cairn_visibility_answer answer = observe(
        match, match->query_view, cairn_transform_point(match->query_target, point->position));

    match->inlier_count.target_inliers += answer == CAIRN_VISIBILITY_SURFACE;
    match->inlier_count.target_violations += answer == CAIRN_VISIBILITY_FREE;
    cairn_scan_match_charge(match, 12);
}

static cairn_real share(cairn_real part, int32_t rest)
{
    return part > 0 ? part / (part + (cairn_real)rest) : 0;
}

static void score(cairn_scan_match *match)
{
    cairn_scan_match_hypothesis *h = &match->hypotheses[match->hypothesis_index];
    const scan_match_inlier_count *t = &match->inlier_count;
    cairn_real query_points = (cairn_real)(t->query_points > 0 ? t->query_points : 1), agreement;

    h->overlap = (cairn_real)t->inliers / query_points;
    h->fit = t->fit_sum / query_points;
    h->free_space_violation = share((cairn_real)t->violations, t->inliers);
    h->target_free_space_violation = share((cairn_real)t->target_violations, t->target_inliers);
    agreement = (1 - h->free_space_violation) * (1 - h->target_free_space_violation);
    h->score = h->fit * agreement * agreement * agreement;
}

int32_t cairn_scan_match_score_item(cairn_scan_match *match)
{
    int32_t queries = match->fit.count,
            target_samples = match->query_has_view ? match->target_count : 0;

    if (match->index_in_phase < queries) {
        test_query_point(match, &match->fit.points[match->index_in_phase]);
        match->index_in_phase += match->query_stride;
        if (match->index_in_phase < queries)
            return 0;
        match->index_in_phase = queries;
    } else if (match->index_in_phase - queries < target_samples) {
        test_target_point(match, &match->target[match->index_in_phase - queries]);
        match->index_in_phase += match->target_stride;
    }
    if (match->index_in_phase - queries < target_samples)
        return 0;
    score(match);
    return 1;
}
