/* Refinement of one pose by point-to-line distances, and what speaks for and against it.
 *
 * Gauss-Newton as in icp: robust weights (Cauchy) with the scale of the residuals, directions of
 * motion that the pairs do not tell left alone. Poses go through stages of more and more points,
 * the last with one point a beam, so that every range counts as much as it should; whoever does
 * badly stays behind.
 *
 * Covariance: that of an M-estimator (Huber 1981, section 7.6). Its information is made of the
 * products of the normals of both points of a pair, as Gauss-Newton's would be of those of one:
 * noise of the normals of a bare wall adds up in squares and feigns information along the wall,
 * while in products of independent normals it cancels. What does not average out (bent surfaces,
 * the choice of pairs) is a floor: with a thousand beams it is most of the error. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/scan_match_work.h"

static const cairn_real CAUCHY = CAIRN_REAL(2.385);
static const cairn_real CAUCHY_VARIANCE = CAIRN_REAL(1.26);
/* of the directions of a pair */
static const cairn_real LEAST_COSINE = CAIRN_REAL(0.7);
/* ... of a point that is explained */
static const cairn_real TALLY_COSINE = CAIRN_REAL(0.85);
/* spacings */
static const cairn_real TALLY_GATE = CAIRN_REAL(1.5);
/* spacings from the surface at which a point counts half */
static const cairn_real CLOSE = CAIRN_REAL(0.3);
/* spacings, standard deviation */
static const cairn_real FLOOR = CAIRN_REAL(0.015);
/* of the information of a direction in which a step goes */
static const cairn_real LEAST_RATIO = CAIRN_REAL(3e-4);
/* spacings by which a point stands before a surface */
static const cairn_real MARGIN = 1;

enum { LEAST_PAIRS = 4 };

/* Points, iterations, poses kept (at least twice the hypotheses asked for; 0: those), dense,
 * gates. */
static const match_stage STAGES[MATCH_STAGES + 1] = {
    {48, 3, 16, 0, 5, 3},
    {128, 6, 0, 0, 3, CAIRN_REAL(1.5)},
    {1 << 20, 8, 0, 1, 2, 1},
    {1 << 20, 0, 0, 1, 2, 2}, /* looks only */
};

const match_stage *cairn_match_stage_of(const cairn_scan_match *x)
{
    return &STAGES[x->stage];
}

void cairn_match_fit_begin(cairn_scan_match *x, cairn_pose pose)
{
    const match_stage *stage = &STAGES[x->stage];
    match_fit *fit = &x->fit;
    int32_t dense = stage->dense && x->query.dense_count > 0;
    int32_t both = dense && x->dense_count > 0 && !x->lacks_dense;

    memset(fit, 0, sizeof *fit);
    fit->points = dense ? x->query.dense : x->query.points;
    fit->count = dense ? x->query.dense_count : x->query.count;
    fit->index = both ? &x->dense_index : &x->index;
    fit->stride = (fit->count + stage->points - 1) / stage->points;
    fit->motion = cairn_rigid_motion_at(pose, x->centroid, x->radius);
    fit->gate = stage->gate_start * x->params.spacing;
    fit->sigma = x->stage == 0 ? fit->gate / 2 : x->params.spacing / 2;
    x->at = 0;
}

/* Adds what the pair tells as both normals see it: the symmetric product of their rows. */
static void add_cross(cairn_scan_match *x, const cairn_real row[3], cairn_vec2 direction,
                      cairn_vec2 position, cairn_real weight)
{
    cairn_real other[3], sum[3], difference[3];

    cairn_rigid_motion_row(&x->fit.motion, cairn_vec2_left(direction), position, other);
    for (int k = 0; k < 3; k++) {
        sum[k] = row[k] + other[k];
        difference[k] = row[k] - other[k];
    }
    cairn_sym3_add_outer(&x->fit.sums.cross, sum, weight / 4);
    cairn_sym3_add_outer(&x->fit.sums.cross, difference, -weight / 4);
}

static void add_pair(cairn_scan_match *x, const cairn_oriented_point *q)
{
    match_fit *fit = &x->fit;
    match_sums *sums = &fit->sums;
    match_search search;
    const cairn_oriented_point *m;
    cairn_real error, squared, weight, scale = CAUCHY * fit->sigma, row[3];
    cairn_vec2 normal;
    int32_t parts = 20;

    search.p = cairn_transform_point(fit->motion.transform, q->position);
    search.direction = cairn_transform_direction(fit->motion.transform, q->direction);
    search.cosine = LEAST_COSINE;
    m = cairn_match_index_nearest(fit->index, &search, fit->gate, &parts);
    cairn_match_charge(x, parts);
    if (m == NULL)
        return;
    normal = cairn_vec2_left(m->direction);
    error = cairn_vec2_dot(normal, cairn_vec2_sub(search.p, m->position));
    squared = error * error;
    weight = 1 / (1 + squared / (scale * scale));
    cairn_rigid_motion_row(&fit->motion, normal, q->position, row);
    cairn_sym3_add_outer(&sums->lines, row, weight);
    if (STAGES[x->stage].dense)
        add_cross(x, row, search.direction, q->position, weight);
    for (int k = 0; k < 3; k++)
        sums->gradient[k] += weight * error * row[k];
    sums->weight += weight;
    sums->squares += weight * squared;
    sums->psi_squares += weight * weight * squared;
    /* psi = w e, psi' = 1 - (e / scale)^2 over (...)^2 */
    sums->slopes += weight * weight * (2 - 1 / weight);
    sums->pairs++;
}

/* 1 / variance of a residual. */
static cairn_real information_scale(const cairn_scan_match *x)
{
    const match_sums *sums = &x->fit.sums;
    cairn_real n = (cairn_real)sums->pairs, slope = cairn_max(sums->slopes / n, CAIRN_REAL(0.1));
    cairn_real scale =
        sums->psi_squares / cairn_max(n - 3, 1) * (sums->weight / n) / (slope * slope);

    return 1 / cairn_max(scale, x->params.sigma * x->params.sigma);
}

static cairn_sym3 scaled(cairn_sym3 m, cairn_real by)
{
    cairn_sym3 out = {m.xx * by, m.xy * by, m.xz * by, m.yy * by, m.yz * by, m.zz * by};
    return out;
}

/* Adds the errors that do not average out with the number of points: FLOOR spacings of any
 * motion about the centroid. */
static void add_floor(const cairn_scan_match *x, cairn_real covariance[9])
{
    cairn_real by = 1 / (FLOOR * x->params.spacing * (FLOOR * x->params.spacing)), more[9];
    cairn_sym3 information = {by, 0, 0, by, 0, by};
    cairn_motion_basis basis = cairn_motion_basis_of(information, 0);

    cairn_rigid_motion_covariance(&x->fit.motion, &basis, &information, NULL, more);
    for (int k = 0; k < 9; k++)
        covariance[k] += more[k];
}

/* Writes down where the fit ended; what it tells, of the last ones alone. */
static void conclude(cairn_scan_match *x, const cairn_motion_basis *basis)
{
    cairn_scan_match_hypothesis *h = &x->hypotheses[x->other];
    cairn_motion_basis seen;
    cairn_normal_equations prior;
    cairn_sym3 information = cairn_sym3_zero();

    h->target_query = x->fit.motion.map_body;
    if (!STAGES[x->stage].dense)
        return;
    cairn_match_charge(x, 40 * MATCH_PART);
    h->pairs = x->fit.sums.pairs;
    h->sigma = x->fit.sigma;
    h->radius = x->radius;
    h->observable = 0;
    h->weak_ratio = 0;
    memset(h->weak, 0, sizeof h->weak);
    if (x->has_window)
        prior = cairn_rigid_motion_prior(&x->fit.motion, &x->prior);
    if (basis != NULL) {
        seen = cairn_motion_basis_of(x->fit.sums.cross, x->params.weak_ratio);
        basis = &seen;
        information = scaled(x->fit.sums.cross, information_scale(x));
        h->observable = 3 - basis->weak;
        h->weak_ratio = basis->ratio;
        memcpy(h->weak, basis->vectors[0], sizeof h->weak);
    }
    cairn_rigid_motion_covariance(&x->fit.motion, basis, basis == NULL ? NULL : &information,
                                  x->has_window ? &prior : NULL, h->covariance);
    add_floor(x, h->covariance);
}

/* In the early stages, of which the scale of the residuals is that of the search, the prior
 * would pull candidates of a wide window together; it counts there only when all of the window
 * lies within the gate. */
static int32_t prior_counts(const cairn_scan_match *x)
{
    const match_stage *stage = &STAGES[x->stage];

    return x->has_window &&
           (stage->dense || 2 * x->window.distance <= stage->gate_start * x->params.spacing);
}

/* One Gauss-Newton step; 1 when the fit is through. */
static int32_t end_iteration(cairn_scan_match *x)
{
    int32_t use_prior = prior_counts(x);
    const match_stage *stage = &STAGES[x->stage];
    match_fit *fit = &x->fit;
    cairn_normal_equations equations, prior;
    cairn_motion_basis basis;
    cairn_real step[3], moved, by, gate_end = stage->gate_end * x->params.spacing,
                                   sigma = fit->sigma;

    cairn_match_charge(x, 24 * MATCH_PART);
    fit->iteration++;
    if (fit->sums.pairs < LEAST_PAIRS) {
        conclude(x, NULL);
        return 1;
    }
    fit->sigma = cairn_max(x->params.sigma,
                           cairn_sqrt(CAUCHY_VARIANCE * fit->sums.squares / fit->sums.weight));
    by = 1 / (2 * fit->sigma * fit->sigma);
    basis = cairn_motion_basis_of(fit->sums.lines, LEAST_RATIO);
    if (stage->iterations == 0) {
        conclude(x, &basis);
        return 1;
    }
    equations.information = scaled(fit->sums.lines, by);
    for (int k = 0; k < 3; k++)
        equations.gradient[k] = by * fit->sums.gradient[k];
    if (use_prior)
        prior = cairn_rigid_motion_prior(&fit->motion, &x->prior);
    if (!cairn_motion_solve(&basis, &equations, use_prior ? &prior : NULL, fit->gate, step)) {
        conclude(x, &basis);
        return 1;
    }
    cairn_rigid_motion_move(&fit->motion, step);
    moved = cairn_sqrt(step[0] * step[0] + step[1] * step[1] + step[2] * step[2]);
    if (fit->iteration == stage->iterations ||
        (moved < CAIRN_REAL(1e-3) * x->params.spacing && fit->gate <= gate_end &&
         fit->sigma > CAIRN_REAL(0.95) * sigma)) {
        conclude(x, &basis);
        return 1;
    }
    fit->gate = cairn_max(gate_end, CAIRN_REAL(0.7) * fit->gate);
    memset(&fit->sums, 0, sizeof fit->sums);
    x->at = 0;
    return 0;
}

int32_t cairn_match_fit_item(cairn_scan_match *x)
{
    if (x->at >= x->fit.count)
        return end_iteration(x);
    add_pair(x, &x->fit.points[x->at]);
    x->at += x->fit.stride;
    return 0;
}

/* ---- For and against ---- */

void cairn_match_tally_begin(cairn_scan_match *x)
{
    const match_stage *stage = &STAGES[x->stage];
    int32_t witnesses;

    memset(&x->tally, 0, sizeof x->tally);
    x->tally_transform = cairn_transform_of(x->hypotheses[x->other].target_query);
    x->tally_inverse = cairn_transform_of(cairn_pose_inverse(x->hypotheses[x->other].target_query));
    x->tally_stride = x->fit.stride;
    witnesses = stage->points < MATCH_WITNESSES ? stage->points : MATCH_WITNESSES;
    x->witness_stride = (x->target_count + witnesses - 1) / witnesses;
    x->at = 0;
}

static void ask_query_point(cairn_scan_match *x, const cairn_oriented_point *q)
{
    const cairn_oriented_point *m;
    match_search search;
    int32_t parts = 20;

    search.p = cairn_transform_point(x->tally_transform, q->position);
    search.direction = cairn_transform_direction(x->tally_transform, q->direction);
    search.cosine = TALLY_COSINE;
    x->tally.asked++;
    m = cairn_match_index_nearest(x->fit.index, &search, TALLY_GATE * x->params.spacing, &parts);
    if (m != NULL) {
        cairn_real e =
            cairn_vec2_dot(cairn_vec2_left(m->direction), cairn_vec2_sub(search.p, m->position)) /
            (CLOSE * x->params.spacing);

        x->tally.closeness += 1 / (1 + e * e);
        x->tally.explained++;
        cairn_match_charge(x, parts);
        return;
    }
    for (int32_t i = 0; i < x->view_count; i++) {
        parts += 8;
        if (cairn_match_profile_ask(&x->views[i], search.p, MARGIN * x->params.spacing) > 0) {
            x->tally.contradicted++;
            break;
        }
    }
    cairn_match_charge(x, parts);
}

static void ask_target_point(cairn_scan_match *x, const cairn_oriented_point *p)
{
    int32_t says = cairn_match_profile_ask(x->query_profile,
                                           cairn_transform_point(x->tally_inverse, p->position),
                                           MARGIN * x->params.spacing);

    x->tally.target_explained += says < 0;
    x->tally.target_contradicted += says > 0;
    cairn_match_charge(x, 12);
}

static cairn_real share(cairn_real part, int32_t rest)
{
    return part > 0 ? part / (part + (cairn_real)rest) : 0;
}

static void score(cairn_scan_match *x)
{
    cairn_scan_match_hypothesis *h = &x->hypotheses[x->other];
    const match_tally *t = &x->tally;
    cairn_real asked = (cairn_real)(t->asked > 0 ? t->asked : 1), agreement;

    h->overlap = (cairn_real)t->explained / asked;
    h->fit = t->closeness / asked;
    h->contradiction = share((cairn_real)t->contradicted, t->explained);
    h->target_contradiction = share((cairn_real)t->target_contradicted, t->target_explained);
    agreement = (1 - h->contradiction) * (1 - h->target_contradiction);
    h->score = h->fit * agreement * agreement * agreement;
}

int32_t cairn_match_tally_item(cairn_scan_match *x)
{
    int32_t queries = x->fit.count, witnesses = x->query_sees ? x->target_count : 0;

    if (x->at < queries) {
        ask_query_point(x, &x->fit.points[x->at]);
        x->at += x->tally_stride;
        if (x->at < queries)
            return 0;
        x->at = queries;
    } else if (x->at - queries < witnesses) {
        ask_target_point(x, &x->target[x->at - queries]);
        x->at += x->witness_stride;
    }
    if (x->at - queries < witnesses)
        return 0;
    score(x);
    return 1;
}
