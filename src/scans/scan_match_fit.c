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

/* Costs in parts of a unit, beside those of a search: a query point that is paired or scored, a
 * view, a target point; a motion of the query, a covariance; a hypothesis that is ranked, and two
 * comparisons with others. */
enum {
    PARTS_PER_QUERY_POINT = 20,
    PARTS_PER_VIEW = 8,
    PARTS_PER_TARGET_POINT = 12,
    PARTS_PER_MOTION = 24 * SCAN_MATCH_PARTS_PER_UNIT,
    PARTS_PER_COVARIANCE = 40 * SCAN_MATCH_PARTS_PER_UNIT,
    PARTS_PER_RANK = 8,
    COMPARISONS_PER_PART = 2
};

/* Points, iterations, hypotheses kept (at least twice max_hypotheses; 0: max_hypotheses), dense,
 * gates. */
static const scan_match_stage STAGES[SCAN_MATCH_STAGES + 1] = {
    {48, 3, 16, 0, 5, 3},
    {128, 6, 0, 0, 3, CAIRN_REAL(1.5)},
    {1 << 20, 8, 0, 1, 2, 1},
    {1 << 20, 0, 0, 1, 2, 2}, /* evaluation only */
};

/* Starts the refinement of the current hypothesis. */
static void begin_fit(cairn_scan_match *match)
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
    fit->robust.motion = cairn_rigid_motion_at(match->hypotheses[match->hypothesis].target_query,
                                               match->centroid, match->radius);
    fit->robust.gate = stage->gate_start * match->params.spacing;
    fit->robust.sigma = match->stage == 0 ? fit->robust.gate / 2 : match->params.spacing / 2;
    fit->robust.min_sigma = match->params.min_sigma;
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

/* Adds the pair that was found for the current query point. */
static CAIRN_STEP_NOT_INLINED void add_pair(cairn_scan_match *match)
{
    scan_match_fit *fit = &match->fit;
    const scan_match_search *search = &match->search;
    const cairn_oriented_point *m = search->best;
    cairn_vec2 position = fit->points[fit->point].position,
               normal = cairn_vec2_left_perp(m->direction);
    cairn_real error = cairn_vec2_dot(normal, cairn_vec2_sub(search->p, m->position)), row[3];
    cairn_real weight = cairn_registration_add_pair(&fit->robust, position, normal, error, row);

    if (STAGES[match->stage].dense)
        add_cross(match, row, search->direction, position, weight);
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
static void store_hypothesis(cairn_scan_match *match)
{
    cairn_scan_match_hypothesis *h = &match->hypotheses[match->hypothesis];
    const cairn_registration *robust = &match->fit.robust;
    int has_pairs = robust->sums.pairs >= MIN_PAIRS;
    cairn_rigid_motion_basis basis;

    h->target_query = robust->motion.map_body;
    if (!STAGES[match->stage].dense)
        return;
    h->pairs = robust->sums.pairs;
    h->sigma = robust->sigma;
    h->radius = match->radius;
    h->observable_dof = 0;
    h->weak_ratio = 0;
    memset(h->weak_direction, 0, sizeof h->weak_direction);
    if (has_pairs) {
        basis = cairn_rigid_motion_basis_of(match->fit.cross, match->params.weak_ratio);
        h->observable_dof = 3 - basis.unobservable;
        h->weak_ratio = basis.inverse_condition;
        memcpy(h->weak_direction, basis.vectors[0], sizeof h->weak_direction);
    }
    cairn_registration_covariance(robust, has_pairs ? &basis : NULL, match->fit.cross,
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
static CAIRN_STEP_NOT_INLINED int move_query(cairn_scan_match *match)
{
    const scan_match_stage *stage = &STAGES[match->stage];
    scan_match_fit *fit = &match->fit;
    cairn_registration *robust = &fit->robust;
    cairn_rigid_motion_basis basis;
    cairn_real step[3], moved, gate_end = stage->gate_end * match->params.spacing,
                               sigma = robust->sigma;

    fit->iteration++;
    if (robust->sums.pairs < MIN_PAIRS)
        return 1;
    cairn_registration_update_sigma(robust);
    basis = cairn_rigid_motion_basis_of(robust->sums.equations.information, MIN_STEP_RATIO);
    if (stage->iterations == 0 ||
        !cairn_registration_move(robust, &basis, &robust->sums.equations,
                                 VARIANCE_FACTOR * robust->sigma * robust->sigma,
                                 uses_prior(match) ? &match->prior : NULL, step))
        return 1;
    moved = cairn_sqrt(step[0] * step[0] + step[1] * step[1] + step[2] * step[2]);
    if (fit->iteration == stage->iterations ||
        (moved < CAIRN_REAL(1e-3) * match->params.spacing && robust->gate <= gate_end &&
         robust->sigma > CAIRN_REAL(0.95) * sigma))
        return 1;
    robust->gate = cairn_max(gate_end, CAIRN_REAL(0.7) * robust->gate);
    memset(&robust->sums, 0, sizeof robust->sums);
    fit->cross = cairn_sym3_zero();
    return 0;
}

/* Part: the refinement of the current hypothesis. */
static int fit_query(cairn_scan_match *match, cairn_budget *budget)
{
    scan_match_fit *fit = &match->fit;

    CAIRN_STEP_BEGIN(match->resume.part);
    begin_fit(match);
    do {
        for (fit->point = 0; fit->point < fit->count; fit->point += fit->stride) {
            SCAN_MATCH_CHARGE(part, PARTS_PER_QUERY_POINT);
            cairn_scan_match_search_begin(&match->search, fit->index, &fit->robust.motion.transform,
                                          &fit->points[fit->point], MIN_PAIR_COSINE,
                                          fit->robust.gate);
            CAIRN_STEP_RUN(match, resume.part, budget, cairn_scan_match_search_nearest);
            if (match->search.best != NULL)
                add_pair(match);
        }
        SCAN_MATCH_CHARGE(part, PARTS_PER_MOTION);
    } while (!move_query(match));
    if (STAGES[match->stage].dense)
        SCAN_MATCH_CHARGE(part, PARTS_PER_COVARIANCE);
    store_hypothesis(match);
    CAIRN_STEP_END(match->resume.part);
}

/* ---- Inliers and free-space violations ---- */

static void begin_scoring(cairn_scan_match *match)
{
    cairn_pose target_query = match->hypotheses[match->hypothesis].target_query;
    int32_t points = STAGES[match->stage].points, samples = points < SCAN_MATCH_MAX_TARGET_SAMPLES
                                                                ? points
                                                                : SCAN_MATCH_MAX_TARGET_SAMPLES;

    memset(&match->scoring, 0, sizeof match->scoring);
    match->scoring.target_query = cairn_transform_of(target_query);
    match->scoring.query_target = cairn_transform_of(cairn_pose_inverse(target_query));
    match->scoring.sample_stride = (match->target_count + samples - 1) / samples;
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

/* Counts the current query point, which lies on a target surface. */
static void add_inlier(cairn_scan_match *match)
{
    const cairn_oriented_point *m = match->search.best;
    cairn_real e = cairn_vec2_dot(cairn_vec2_left_perp(m->direction),
                                  cairn_vec2_sub(match->search.p, m->position)) /
                   (HALF_WEIGHT_DISTANCE * match->params.spacing);

    match->scoring.fit_sum += 1 / (1 + e * e);
    match->scoring.inliers++;
}

/* Returns 1 when the current query point lies in the free space of the current view. */
static int is_in_free_space(const cairn_scan_match *match)
{
    const scan_match_view *view = &match->views[match->scoring.view];

    return observe(match, view, cairn_transform_point(view->part_target, match->search.p)) ==
           CAIRN_VISIBILITY_FREE;
}

static void test_target_point(cairn_scan_match *match)
{
    cairn_vec2 position = match->target[match->scoring.sample].position;
    cairn_visibility_answer answer = observe(
        match, match->query_view, cairn_transform_point(match->scoring.query_target, position));

    match->scoring.target_inliers += answer == CAIRN_VISIBILITY_SURFACE;
    match->scoring.target_violations += answer == CAIRN_VISIBILITY_FREE;
}

static cairn_real share(cairn_real part, int32_t rest)
{
    return part > 0 ? part / (part + (cairn_real)rest) : 0;
}

static void store_score(cairn_scan_match *match)
{
    cairn_scan_match_hypothesis *h = &match->hypotheses[match->hypothesis];
    const scan_match_scoring *t = &match->scoring;
    cairn_real query_points = (cairn_real)(t->query_points > 0 ? t->query_points : 1), agreement;

    h->overlap = (cairn_real)t->inliers / query_points;
    h->fit = t->fit_sum / query_points;
    h->free_space_violation = share((cairn_real)t->violations, t->inliers);
    h->target_free_space_violation = share((cairn_real)t->target_violations, t->target_inliers);
    agreement = (1 - h->free_space_violation) * (1 - h->target_free_space_violation);
    h->score = h->fit * agreement * agreement * agreement;
}

/* Part: the score of the current hypothesis. */
static int score_query(cairn_scan_match *match, cairn_budget *budget)
{
    const scan_match_fit *fit = &match->fit;
    scan_match_scoring *t = &match->scoring;

    CAIRN_STEP_BEGIN(match->resume.part);
    begin_scoring(match);
    for (t->point = 0; t->point < fit->count; t->point += fit->stride) {
        SCAN_MATCH_CHARGE(part, PARTS_PER_QUERY_POINT);
        cairn_scan_match_search_begin(&match->search, fit->index, &t->target_query,
                                      &fit->points[t->point], MIN_INLIER_COSINE,
                                      INLIER_GATE * match->params.spacing);
        CAIRN_STEP_RUN(match, resume.part, budget, cairn_scan_match_search_nearest);
        t->query_points++;
        if (match->search.best != NULL)
            add_inlier(match);
        for (t->view = 0; match->search.best == NULL && t->view < match->view_count; t->view++) {
            SCAN_MATCH_CHARGE(part, PARTS_PER_VIEW);
            if (is_in_free_space(match)) {
                t->violations++;
                break;
            }
        }
    }
    for (t->sample = 0; match->query_has_view && t->sample < match->target_count;
         t->sample += t->sample_stride) {
        SCAN_MATCH_CHARGE(part, PARTS_PER_TARGET_POINT);
        test_target_point(match);
    }
    store_score(match);
    CAIRN_STEP_END(match->resume.part);
}

/* ---- Stages ---- */

/* Returns the number of hypotheses that enter the next stage. */
static int32_t kept_hypotheses(const cairn_scan_match *match)
{
    int32_t most = match->params.max_hypotheses, keep = STAGES[match->stage].keep;

    if (keep == 0)
        return most;
    return keep < 2 * most ? 2 * most : keep;
}

int cairn_scan_match_refine(cairn_scan_match *match, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(match->resume.phase);
    for (match->hypothesis = 0; match->hypothesis < match->hypothesis_count; match->hypothesis++) {
        CAIRN_STEP_RUN(match, resume.phase, budget, fit_query);
        CAIRN_STEP_RUN(match, resume.phase, budget, score_query);
        match->measure.refinements++;
    }
    SCAN_MATCH_CHARGE(phase, match->hypothesis_count *
                                 (PARTS_PER_RANK + match->hypothesis_count / COMPARISONS_PER_PART));
    cairn_scan_match_select(match, kept_hypotheses(match));
    CAIRN_STEP_END(match->resume.phase);
}
