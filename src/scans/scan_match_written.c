/* scan_match: the ICP of Adluru 2008, section 6.4, as written.
 *
 * Method: an iteration has two passes over the query points.
 * 1. Quality: the number of overlapping points and their mean distance. When the overlap falls and
 *    the mean distance rises, the last motion is undone and the ICP ends.
 * 2. Pairs nearer than that mean distance, and their least-squares motion in closed form. */
#include "src/base/build.h"

#include "src/scans/scan_match_shape.h"

enum {
    MAX_ITERATIONS = 20,
    MIN_PAIRS = 3,
    PARTS_PER_PASS = 3 * SCAN_MATCH_PARTS_PER_UNIT /* the end of a pass, in parts of a unit */
};

/* m: mean distance below which no motion is needed */
static const cairn_real MIN_MEAN_DISTANCE_M = CAIRN_REAL(1e-9);

/* Ends the quality pass; returns 1 when the ICP ends. */
static int end_measuring(scan_match_shape *shape)
{
    int32_t overlap = shape->pass.sums.overlap;

    if (shape->icp.last_overlap < 0)
        shape->best_overlap = overlap;
    return cairn_scan_match_shape_rolls_back(shape) || shape->icp.iteration++ == MAX_ITERATIONS ||
           overlap < MIN_PAIRS || shape->icp.last_mean < MIN_MEAN_DISTANCE_M;
}

int cairn_scan_match_written_icp(cairn_scan_match *match, cairn_budget *budget)
{
    scan_match_shape *shape = match->shape;

    CAIRN_STEP_BEGIN(match->resume.phase);
    cairn_scan_match_shape_start_icp(match);
    for (;;) {
        cairn_scan_match_shape_start_pass(shape, shape->overlap_gate, -1);
        CAIRN_STEP_RUN(match, resume.phase, budget, cairn_scan_match_shape_pass);
        SCAN_MATCH_CHARGE(phase, PARTS_PER_PASS);
        if (end_measuring(shape))
            break;
        cairn_scan_match_shape_start_pass(shape, shape->icp.last_mean, CAIRN_REAL_MAX);
        CAIRN_STEP_RUN(match, resume.phase, budget, cairn_scan_match_shape_pass);
        SCAN_MATCH_CHARGE(phase, PARTS_PER_PASS);
        if (shape->pass.sums.pairs < MIN_PAIRS)
            break;
        cairn_scan_match_shape_move(shape);
    }
    CAIRN_STEP_END(match->resume.phase);
}
