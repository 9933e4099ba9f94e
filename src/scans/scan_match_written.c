/* scan_match: the ICP of Adluru 2008, section 6.4, as written.
 *
 * Method: an iteration has two passes over the query points.
 * 1. Quality: the number of overlapping points and their mean distance. When the overlap falls and
 *    the mean distance rises, the last motion is undone and the ICP ends.
 * 2. Pairs nearer than that mean distance, and their least-squares motion in closed form. */
#include "src/base/build.h"

#include <string.h>

#include "src/scans/scan_match_shape.h"

enum { MAX_ITERATIONS = 20, MIN_PAIRS = 3 };

/* m: mean distance below which no motion is needed */
static const cairn_real MIN_MEAN_DISTANCE_M = CAIRN_REAL(1e-9);

/* Ends the quality pass; returns 1 when the ICP ends. */
static int32_t end_measuring(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;
    int32_t overlap = shape->sums.overlap;
    cairn_real mean = overlap > 0 ? shape->sums.overlap_distance / (cairn_real)overlap : 0;

    if (shape->last_overlap >= 0 && overlap < shape->last_overlap && mean > shape->last_mean) {
        shape->best = shape->last;
        return 1;
    }
    if (shape->last_overlap < 0)
        shape->best_overlap = overlap;
    shape->last_overlap = overlap;
    shape->last_mean = mean;
    shape->gate = mean;
    shape->is_summing = 1;
    return shape->iteration++ == MAX_ITERATIONS || overlap < MIN_PAIRS ||
           mean < MIN_MEAN_DISTANCE_M;
}

/* Ends the pass of pairs; returns 1 when the ICP ends. */
static int32_t end_summing(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;

    if (shape->sums.pairs < MIN_PAIRS)
        return 1;
    shape->last = shape->best;
    shape->best = cairn_scan_match_shape_move(&shape->sums, shape->best);
    shape->is_summing = 0;
    return 0;
}

int32_t cairn_scan_match_written_icp(cairn_scan_match *match)
{
    scan_match_shape *shape = match->shape;
    cairn_real distance;
    const cairn_oriented_point *found;
    cairn_vec2 p;

    if (match->index_in_phase == match->query.count) {
        int32_t ended = shape->is_summing ? end_summing(match) : end_measuring(match);

        cairn_scan_match_charge(match, 3 * SCAN_MATCH_PARTS_PER_UNIT);
        memset(&shape->sums, 0, sizeof shape->sums);
        match->index_in_phase = 0;
        return ended;
    }
    if (match->index_in_phase == 0)
        shape->rotation_transform = cairn_transform_of(shape->best);
    found = cairn_scan_match_shape_nearest(
        match, &match->query.points[match->index_in_phase++], shape->rotation_transform,
        shape->is_summing ? shape->gate : shape->overlap_gate, &p, &distance);
    cairn_scan_match_charge(match, 2);
    if (found == NULL)
        return 0;
    if (shape->is_summing) {
        cairn_scan_match_shape_add_pair(&shape->sums, p, found->position, distance);
    } else {
        shape->sums.overlap++;
        shape->sums.overlap_distance += distance;
    }
    return 0;
}
