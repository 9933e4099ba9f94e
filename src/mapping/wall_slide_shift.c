/* Which shift of one part against another is best, and by how much.
 *
 * For every shift that the initial poses allow, and for staying: the nats of the initial poses
 * and of the walls' thickness, less what speaks against it, two scans after the other. That last
 * is the dear part, and can only take away: so always the shift that is best by what has been
 * looked at is looked at next. When it has met all scans no other can be better. The two scans
 * that have spoken against a shift are asked first of the next, as they mostly do again: so most
 * shifts never meet more than two. The best of those that are not near it follows in the same
 * way. */
#include "src/core/build.h"

#include "src/mapping/wall_slide_work.h"

enum { SHIFTS_OF_UNIT = 16, SCANS_OF_UNIT = 16 };

/* m, and half a step, so that no rounding decides */
static const cairn_real SAME_PLACE = CAIRN_REAL(0.06);
/* nats that a part must gain to leave its place */
static const cairn_real BETTER = 2;
/* nats with which two scans speak against a shift by themselves */
static const cairn_real PLAINLY = -1;
/* standard deviations */
static const cairn_real FARTHEST = 3;

/* The multiples of the step that are as near to the expected shift as the initial poses allow,
 * or one at least. */
static void lay_shifts(cairn_wall_slide *x, cairn_real far)
{
    x->step = cairn_max(x->params.step, 2 * far / (cairn_real)(SLIDE_SHIFTS - 2));
    x->first_shift = cairn_real_to_int(cairn_ceil((x->expected - far) / x->step));
    x->shifts = cairn_real_to_int(cairn_floor((x->expected + far) / x->step)) - x->first_shift + 1;
    if (x->shifts < 1) {
        x->first_shift = cairn_real_to_int(cairn_rint(x->expected / x->step));
        x->shifts = 1;
    }
    x->shifts = x->shifts < SLIDE_SHIFTS ? x->shifts : SLIDE_SHIFTS;
    x->stay = x->first_shift > -SLIDE_SHIFTS && x->first_shift <= 0 ? -x->first_shift : x->shifts;
    if (x->stay >= x->shifts)
        x->stay = x->shifts++; /* weighed as well, behind the others */
}

int32_t cairn_slide_begin_pair(cairn_wall_slide *x, int32_t moving, int32_t fixed)
{
    const slide_part *a = &x->parts[moving], *b = &x->parts[fixed];
    cairn_real one = 1 / (cairn_real)a->scans, other = 1 / (cairn_real)b->scans;
    cairn_vec2 off = cairn_vec2_sub(cairn_vec2_scale(a->off, one), cairn_vec2_scale(b->off, other));

    x->moving = moving;
    x->fixed = fixed;
    x->expected = cairn_vec2_dot(a->along, off);
    x->variance = x->spread * x->spread * (one + other);
    lay_shifts(x, FARTHEST * cairn_sqrt(x->variance));
    for (int32_t i = 0; i < x->shifts; i++) {
        cairn_real miss = cairn_slide_shift(x, i) - x->expected;
        slide_trial *trial = &x->trials[i];

        trial->nats = -miss * miss / (2 * x->variance);
        trial->scan = trial->partner = trial->is_begun = 0;
    }
    x->objector.scan = x->objector.partner = SLIDE_NONE;
    x->i = x->j = 0;
    x->best = x->leaves = SLIDE_NONE;
    x->phase = x->params.thickness && x->result.thickness > 0 ? SLIDE_THICKNESS : SLIDE_OBJECT;
    return 1 + x->shifts / SHIFTS_OF_UNIT;
}

/* ---- What speaks against a shift ---- */

static int is_weighed(const cairn_wall_slide *x, int32_t i)
{
    return x->trials[i].scan == x->scan_count;
}

/* On to the next scan of the fixed part that the moving one at hand may meet; where there is
 * none, to the next moving scan. 1: two scans are found. *units: what it cost. */
static int32_t find_two(const cairn_wall_slide *x, slide_trial *trial, int32_t *units)
{
    int32_t passed = 0, asked = 0, found = 0;

    for (; trial->scan < x->scan_count && x->scans[trial->scan].part != x->moving; passed++)
        trial->scan++;
    if (trial->scan < x->scan_count) {
        for (; trial->partner < x->scan_count && !found; trial->partner += !found, passed++)
            if (x->scans[trial->partner].part == x->fixed) {
                asked++;
                found = cairn_aligner_are_partners(x->aligner, trial->scan, trial->partner);
            }
        if (!found) {
            trial->partner = 0;
            trial->scan++;
        }
    }
    *units = 1 + passed / SCANS_OF_UNIT + asked / 4;
    return found;
}

/* What two scans say of a shift; returns units. */
static int32_t ask(cairn_wall_slide *x, int32_t i, slide_two two)
{
    const slide_scan *a = &x->scans[two.scan], *b = &x->scans[two.partner];
    cairn_vec2 shift = cairn_vec2_add(
        a->shift, cairn_vec2_scale(x->parts[x->moving].along, cairn_slide_shift(x, i)));
    cairn_pose pose = a->map_scan;
    cairn_real nats;
    int32_t units;

    pose.x += shift.x - b->shift.x;
    pose.y += shift.y - b->shift.y;
    nats = cairn_aligner_objection(x->aligner, two.scan, two.partner,
                                   cairn_pose_between(b->map_scan, pose), &units);
    x->trials[i].nats += nats;
    if (nats < PLAINLY)
        x->objector = two;
    return 1 + units;
}

/* By the next two scans. */
static int32_t object_to(cairn_wall_slide *x, int32_t i)
{
    slide_trial *trial = &x->trials[i];
    slide_two two;
    int32_t passed;

    if (!trial->is_begun) {
        trial->is_begun = 1;
        trial->first = x->objector;
        if (trial->first.scan != SLIDE_NONE)
            return ask(x, i, trial->first);
    }
    if (!find_two(x, trial, &passed))
        return passed;
    two.scan = trial->scan;
    two.partner = trial->partner++;
    if (two.scan == trial->first.scan && two.partner == trial->first.partner)
        return passed;
    return passed + ask(x, i, two);
}

/* ---- The best ---- */

/* The best shift by what is known; once there is a best one, of those elsewhere; SLIDE_NONE. */
static int32_t foremost(const cairn_wall_slide *x)
{
    int32_t best = SLIDE_NONE;

    for (int32_t i = 0; i < x->shifts; i++)
        if ((x->best < 0 || cairn_abs(cairn_slide_shift(x, i) - cairn_slide_shift(x, x->best)) >
                                SAME_PLACE + x->step / 2) &&
            (best < 0 || x->trials[i].nats > x->trials[best].nats))
            best = i;
    return best;
}

static void end_pair(cairn_wall_slide *x, int32_t second)
{
    slide_pair *pair = cairn_slide_pair(x, x->moving, x->fixed);

    pair->shift = cairn_slide_shift(x, x->best);
    pair->surer = second >= 0 ? cairn_max(x->trials[x->best].nats - x->trials[second].nats, 0)
                              : CAIRN_REAL_MAX;
    x->phase = SLIDE_NEXT;
}

int32_t cairn_slide_object_item(cairn_wall_slide *x)
{
    int32_t units = 1 + x->shifts / SHIFTS_OF_UNIT, at;

    if (x->leaves >= 0 && x->best < 0) { /* whether it is enough better than staying */
        if (!is_weighed(x, x->stay) && x->trials[x->leaves].nats - x->trials[x->stay].nats < BETTER)
            return object_to(x, x->stay);
        x->best =
            x->trials[x->leaves].nats - x->trials[x->stay].nats < BETTER ? x->stay : x->leaves;
        return 1;
    }
    at = foremost(x);
    if (at >= 0 && !is_weighed(x, at))
        return units + object_to(x, at);
    if (x->best < 0)
        x->leaves = at;
    else
        end_pair(x, at);
    return units;
}
