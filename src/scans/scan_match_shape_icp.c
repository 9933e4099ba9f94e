/* scan_match: the ICP of the shape modes, point to point in closed form, and the passes over the
 * query's points that it and the overlap of a rotation share. scan_match_shape.c describes the
 * method. */
#include "src/base/build.h"

#include <string.h>

#include "src/scans/scan_match_shape.h"

enum {
    MAX_ITERATIONS = 20,
    MIN_PAIRS = 3,
    /* parts of a unit: a query point, beside its search, and a motion */
    PARTS_PER_QUERY_POINT = 10,
    PARTS_PER_MOTION = 3 * SCAN_MATCH_PARTS_PER_UNIT
};

/* spacings: least distance up to which points are paired */
static const cairn_real MIN_PAIR_GATE = CAIRN_REAL(1.5);

/* ---- Passes ---- */

void cairn_scan_match_shape_start_pass(scan_match_shape *shape, cairn_real gate,
                                       cairn_real pair_gate)
{
    scan_match_shape_pass *pass = &shape->pass;

    memset(&pass->sums, 0, sizeof pass->sums);
    pass->target_query = cairn_transform_of(shape->best);
    pass->gate = gate;
    pass->pair_gate = pair_gate;
}

/* Adds the current query point and its nearest target point. */
static CAIRN_STEP_NOT_INLINED void add_overlap(scan_match_shape_pass *pass,
                                               const scan_match_search *search)
{
    scan_match_shape_sums *sums = &pass->sums;
    cairn_real distance = cairn_sqrt(search->nearest);
    cairn_vec2 p = search->p, partner = search->best->position;

    sums->overlap++;
    sums->overlap_distance += distance;
    if (distance > pass->pair_gate)
        return;
    sums->pairs++;
    sums->distance += distance;
    sums->from = cairn_vec2_add(sums->from, p);
    sums->to = cairn_vec2_add(sums->to, partner);
    sums->cross += cairn_vec2_cross(p, partner);
    sums->dot += cairn_vec2_dot(p, partner);
}

int cairn_scan_match_shape_pass(cairn_scan_match *match, cairn_budget *budget)
{
    scan_match_shape_pass *pass = &match->shape->pass;

    CAIRN_STEP_BEGIN(match->resume.part);
    for (pass->point = 0; pass->point < match->query.count; pass->point++) {
        SCAN_MATCH_CHARGE(part, PARTS_PER_QUERY_POINT);
        cairn_scan_match_search_begin(&match->search, &match->index, &pass->target_query,
                                      &match->query.points[pass->point], SCAN_MATCH_SIMILAR_COSINE,
                                      pass->gate);
        CAIRN_STEP_RUN(match, resume.part, budget, cairn_scan_match_search_nearest);
        if (match->search.best != NULL)
            add_overlap(pass, &match->search);
    }
    CAIRN_STEP_END(match->resume.part);
}

/* ---- Motions ---- */

void cairn_scan_match_shape_start_icp(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;

    shape->overlap_gate = shape->gate;
    shape->icp.last = shape->best;
    shape->icp.last_overlap = -1;
    shape->icp.iteration = 0;
}

int cairn_scan_match_shape_rolls_back(scan_match_shape *shape)
{
    scan_match_shape_icp *icp = &shape->icp;
    int32_t overlap = shape->pass.sums.overlap;
    cairn_real mean = overlap > 0 ? shape->pass.sums.overlap_distance / (cairn_real)overlap : 0;

    if (icp->last_overlap >= 0 && overlap < icp->last_overlap && mean > icp->last_mean) {
        shape->best = icp->last;
        return 1;
    }
    icp->last_overlap = overlap;
    icp->last_mean = mean;
    return 0;
}

void cairn_scan_match_shape_move(scan_match_shape *shape)
{
    const scan_match_shape_sums *sums = &shape->pass.sums;
    cairn_real n = (cairn_real)sums->pairs;
    cairn_vec2 from = cairn_vec2_scale(sums->from, 1 / n), to = cairn_vec2_scale(sums->to, 1 / n);
    cairn_real sine = sums->cross - n * cairn_vec2_cross(from, to),
               cosine = sums->dot - n * cairn_vec2_dot(from, to);

    shape->icp.last = shape->best;
    shape->best = cairn_pose_compose(cairn_pose_from_moments(from, to, cosine, sine), shape->best);
}

/* Ends an iteration; returns 1 when the ICP ends. */
static int end_iteration(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;
    const scan_match_shape_sums *sums = &shape->pass.sums;

    if (cairn_scan_match_shape_rolls_back(shape) || shape->icp.iteration++ == MAX_ITERATIONS ||
        sums->pairs < MIN_PAIRS)
        return 1;
    cairn_scan_match_shape_move(shape);
    shape->gate =
        cairn_max(sums->distance / (cairn_real)sums->pairs, MIN_PAIR_GATE * match->params.spacing);
    return 0;
}

int cairn_scan_match_shape_icp(cairn_scan_match *match, cairn_budget *budget)
{
    scan_match_shape *shape = match->shape;

    CAIRN_STEP_BEGIN(match->resume.phase);
    cairn_scan_match_shape_start_icp(match);
    do {
        cairn_scan_match_shape_start_pass(shape, shape->overlap_gate, shape->gate);
        CAIRN_STEP_RUN(match, resume.phase, budget, cairn_scan_match_shape_pass);
        SCAN_MATCH_CHARGE(phase, PARTS_PER_MOTION);
    } while (!end_iteration(match));
    CAIRN_STEP_END(match->resume.phase);
}
