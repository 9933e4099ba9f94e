/* weak_direction: best translation of one submap against another, by best-first search.
 *
 * Method: trials are all translations that the prior of the initial poses allows, and zero.
 * 1. Each trial starts with the log-likelihood of the initial poses, then of the wall thickness.
 * 2. Free-space violations of pairs of scans are subtracted. They are the most expensive term and
 *    can only lower a trial, so its value is always an upper bound. Best-first: the trial of the
 *    greatest bound is evaluated next, one pair of scans at a time. A trial with all pairs
 *    evaluated and the greatest value is the optimum (branch and bound).
 * 3. The pair of scans with the last clear violation is evaluated first in the next trial, as it
 *    mostly violates again; most trials so need one or two pairs.
 * 4. The best trial outside its neighbourhood is found in the same way; the difference is the
 *    margin. */
#include "src/core/build.h"

#include "src/mapping/wall_slide_work.h"

enum { TRIALS_PER_UNIT = 16, SCANS_PER_UNIT = 16 };

/* m, plus half a step, so that rounding decides nothing: trials within are one solution */
static const cairn_real SAME_SOLUTION_M = CAIRN_REAL(0.06);
/* nats: least gain over the zero translation */
static const cairn_real MIN_GAIN_NATS = 2;
/* nats: a clear free-space violation of one pair of scans */
static const cairn_real CLEAR_VIOLATION_NATS = -1;
/* standard deviations of the initial poses: half width of the trials */
static const cairn_real MAX_PRIOR_SIGMAS = 3;

/* Sets the trials: multiples of the step within +-far of the expected translation, at least one. */
static void set_trials(cairn_wall_slide *slide, cairn_real far)
{
    slide->step = cairn_max(slide->params.step, 2 * far / (cairn_real)(SLIDE_SHIFTS - 2));
    slide->first_shift = cairn_real_to_int(cairn_ceil((slide->expected - far) / slide->step));
    slide->shifts = cairn_real_to_int(cairn_floor((slide->expected + far) / slide->step)) -
                    slide->first_shift + 1;
    if (slide->shifts < 1) {
        slide->first_shift = cairn_real_to_int(cairn_rint(slide->expected / slide->step));
        slide->shifts = 1;
    }
    slide->shifts = slide->shifts < SLIDE_SHIFTS ? slide->shifts : SLIDE_SHIFTS;
    slide->stay = slide->first_shift > -SLIDE_SHIFTS && slide->first_shift <= 0
                      ? -slide->first_shift
                      : slide->shifts;
    if (slide->stay >= slide->shifts)
        slide->stay = slide->shifts++; /* zero is a trial too, behind the others */
}

int32_t cairn_slide_begin_pair(cairn_wall_slide *slide, int32_t moving, int32_t fixed)
{
    const slide_part *a = &slide->parts[moving], *b = &slide->parts[fixed];
    cairn_real one = 1 / (cairn_real)a->scans, other = 1 / (cairn_real)b->scans;
    cairn_vec2 off = cairn_vec2_sub(cairn_vec2_scale(a->off, one), cairn_vec2_scale(b->off, other));

    slide->moving = moving;
    slide->fixed = fixed;
    slide->expected = cairn_vec2_dot(a->along, off);
    slide->variance = slide->spread * slide->spread * (one + other);
    set_trials(slide, MAX_PRIOR_SIGMAS * cairn_sqrt(slide->variance));
    for (int32_t i = 0; i < slide->shifts; i++) {
        cairn_real miss = cairn_slide_shift(slide, i) - slide->expected;
        slide_trial *trial = &slide->trials[i];

        trial->nats = -miss * miss / (2 * slide->variance);
        trial->scan = trial->partner = trial->is_begun = 0;
    }
    slide->objector.scan = slide->objector.partner = SLIDE_NONE;
    slide->i = slide->j = 0;
    slide->best = slide->leaves = SLIDE_NONE;
    slide->phase =
        slide->params.thickness && slide->result.thickness > 0 ? SLIDE_THICKNESS : SLIDE_OBJECT;
    return 1 + slide->shifts / TRIALS_PER_UNIT;
}

/* ---- Free-space violations ---- */

static int is_evaluated(const cairn_wall_slide *slide, int32_t i)
{
    return slide->trials[i].scan == slide->scan_count;
}

/* Advances to the next scan of the fixed submap that is a candidate pair with the current moving
 * scan; without one, to the next moving scan. Returns 1: a pair is found. *units: the cost. */
static int32_t find_scan_pair(const cairn_wall_slide *slide, slide_trial *trial, int32_t *units)
{
    int32_t passed = 0, asked = 0, found = 0;

    for (; trial->scan < slide->scan_count && slide->scans[trial->scan].part != slide->moving;
         passed++)
        trial->scan++;
    if (trial->scan < slide->scan_count) {
        for (; trial->partner < slide->scan_count && !found; trial->partner += !found, passed++)
            if (slide->scans[trial->partner].part == slide->fixed) {
                asked++;
                found = cairn_aligner_are_partners(slide->aligner, trial->scan, trial->partner);
            }
        if (!found) {
            trial->partner = 0;
            trial->scan++;
        }
    }
    *units = 1 + passed / SCANS_PER_UNIT + asked / 4;
    return found;
}

/* Adds the free-space violation of a pair of scans to a trial; returns units. */
static int32_t add_violation(cairn_wall_slide *slide, int32_t i, slide_two two)
{
    const slide_scan *a = &slide->scans[two.scan], *b = &slide->scans[two.partner];
    cairn_vec2 shift = cairn_vec2_add(
        a->shift, cairn_vec2_scale(slide->parts[slide->moving].along, cairn_slide_shift(slide, i)));
    cairn_pose pose = a->map_scan;
    cairn_real nats;
    int32_t units;

    pose.x += shift.x - b->shift.x;
    pose.y += shift.y - b->shift.y;
    nats = cairn_aligner_objection(slide->aligner, two.scan, two.partner,
                                   cairn_pose_between(b->map_scan, pose), &units);
    slide->trials[i].nats += nats;
    if (nats < CLEAR_VIOLATION_NATS)
        slide->objector = two;
    return 1 + units;
}

/* Evaluates the next pair of scans of a trial; returns units. */
static int32_t evaluate_next_pair(cairn_wall_slide *slide, int32_t i)
{
    slide_trial *trial = &slide->trials[i];
    slide_two two;
    int32_t passed;

    if (!trial->is_begun) {
        trial->is_begun = 1;
        trial->first = slide->objector;
        if (trial->first.scan != SLIDE_NONE)
            return add_violation(slide, i, trial->first);
    }
    if (!find_scan_pair(slide, trial, &passed))
        return passed;
    two.scan = trial->scan;
    two.partner = trial->partner++;
    if (two.scan == trial->first.scan && two.partner == trial->first.partner)
        return passed;
    return passed + add_violation(slide, i, two);
}

/* ---- Best-first search ---- */

/* Returns the trial of the greatest bound; once the best is known, of those outside its
 * neighbourhood; NO_SUBMAP: none. */
static int32_t best_bound(const cairn_wall_slide *slide)
{
    int32_t best = SLIDE_NONE;

    for (int32_t i = 0; i < slide->shifts; i++)
        if ((slide->best < 0 ||
             cairn_abs(cairn_slide_shift(slide, i) - cairn_slide_shift(slide, slide->best)) >
                 SAME_SOLUTION_M + slide->step / 2) &&
            (best < 0 || slide->trials[i].nats > slide->trials[best].nats))
            best = i;
    return best;
}

static void end_pair(cairn_wall_slide *slide, int32_t second)
{
    slide_pair *pair = cairn_slide_pair(slide, slide->moving, slide->fixed);

    pair->shift = cairn_slide_shift(slide, slide->best);
    pair->surer = second >= 0
                      ? cairn_max(slide->trials[slide->best].nats - slide->trials[second].nats, 0)
                      : CAIRN_REAL_MAX;
    slide->phase = SLIDE_NEXT;
}

int32_t cairn_slide_object_item(cairn_wall_slide *slide)
{
    int32_t units = 1 + slide->shifts / TRIALS_PER_UNIT, at;

    if (slide->leaves >= 0 && slide->best < 0) { /* compare with the zero translation */
        if (!is_evaluated(slide, slide->stay) &&
            slide->trials[slide->leaves].nats - slide->trials[slide->stay].nats < MIN_GAIN_NATS)
            return evaluate_next_pair(slide, slide->stay);
        slide->best =
            slide->trials[slide->leaves].nats - slide->trials[slide->stay].nats < MIN_GAIN_NATS
                ? slide->stay
                : slide->leaves;
        return 1;
    }
    at = best_bound(slide);
    if (at >= 0 && !is_evaluated(slide, at))
        return units + evaluate_next_pair(slide, at);
    if (slide->best < 0)
        slide->leaves = at;
    else
        end_pair(slide, at);
    return units;
}
