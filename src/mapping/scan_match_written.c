/* The ICP of Adluru 2008, section 6.4, as written.
 *
 * Method. An iteration goes through the query points twice. First its quality is measured: how
 * many points overlap the target, and their mean distance; when fewer overlap and they are
 * farther apart, the last motion is taken back and the alignment ends. Then the points that are
 * nearer than that mean are paired, and the motion that brings the pairs together is taken. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/scan_match_shape.h"

enum { ITERATIONS = 20, LEAST_PAIRS = 3 };

static const cairn_real COINCIDENT = CAIRN_REAL(1e-9); /* m: pairs so near need no motion */

/* The quality of the pose is known. 1: the alignment ended. */
static int32_t end_measuring(cairn_scan_match *x)
{
    match_shape *s = x->shape;
    int32_t overlap = s->sums.overlap;
    cairn_real mean = overlap > 0 ? s->sums.overlap_distance / (cairn_real)overlap : 0;

    if (s->last_overlap >= 0 && overlap < s->last_overlap && mean > s->last_mean) {
        s->best = s->last;
        return 1;
    }
    if (s->last_overlap < 0)
        s->best_overlap = overlap;
    s->last_overlap = overlap;
    s->last_mean = mean;
    s->gate = mean;
    s->is_summing = 1;
    return s->iteration++ == ITERATIONS || overlap < LEAST_PAIRS || mean < COINCIDENT;
}

/* The pairs are known. 1: the alignment ended. */
static int32_t end_summing(cairn_scan_match *x)
{
    match_shape *s = x->shape;

    if (s->sums.pairs < LEAST_PAIRS)
        return 1;
    s->last = s->best;
    s->best = cairn_match_shape_moved(&s->sums, s->best);
    s->is_summing = 0;
    return 0;
}

int32_t cairn_match_written_icp(cairn_scan_match *x)
{
    match_shape *s = x->shape;
    cairn_real distance;
    const cairn_oriented_point *found;
    cairn_vec2 p;

    if (x->at == x->query.count) {
        int32_t ended = s->is_summing ? end_summing(x) : end_measuring(x);

        cairn_match_charge(x, 3 * MATCH_PART);
        memset(&s->sums, 0, sizeof s->sums);
        x->at = 0;
        return ended;
    }
    if (x->at == 0)
        s->turn = cairn_transform_of(s->best);
    found = cairn_match_shape_partner(x, &x->query.points[x->at++], s->turn,
                                      s->is_summing ? s->gate : s->overlap_gate, &p, &distance);
    cairn_match_charge(x, 2);
    if (found == NULL)
        return 0;
    if (s->is_summing) {
        cairn_match_shape_add(&s->sums, p, found->position, distance);
    } else {
        s->sums.overlap++;
        s->sums.overlap_distance += distance;
    }
    return 0;
}
