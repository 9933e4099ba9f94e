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

#include "src/mapping/weak_direction_work.h"

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
static void set_trials(cairn_weak_direction *slide, cairn_real far)
{
    slide->step = cairn_max(slide->params.translation_step,
                            2 * far / (cairn_real)(WEAK_DIRECTION_MAX_TRIALS - 2));
    slide->first_step = cairn_real_to_int(cairn_ceil((slide->expected - far) / slide->step));
    slide->trial_count = cairn_real_to_int(cairn_floor((slide->expected + far) / slide->step)) -
                         slide->first_step + 1;
    if (slide->trial_count < 1) {
        slide->first_step = cairn_real_to_int(cairn_rint(slide->expected / slide->step));
        slide->trial_count = 1;
    }
    slide->trial_count = slide->trial_count < WEAK_DIRECTION_MAX_TRIALS ? slide->trial_count
                                                                        : WEAK_DIRECTION_MAX_TRIALS;
    slide->zero_trial = slide->first_step > -WEAK_DIRECTION_MAX_TRIALS && slide->first_step <= 0
                            ? -slide->first_step
                            : slide->trial_count;
    if (slide->zero_trial >= slide->trial_count)
        slide->zero_trial = slide->trial_count++; /* zero is a trial too, behind the others */
}

int32_t cairn_weak_direction_begin_pair(cairn_weak_direction *slide, int32_t moving, int32_t fixed)
{
    const weak_direction_submap *a = &slide->submaps[moving], *b = &slide->submaps[fixed];
    cairn_real one = 1 / (cairn_real)a->scans, other = 1 / (cairn_real)b->scans;
    cairn_vec2 off = cairn_vec2_sub(cairn_vec2_scale(a->initial_offset, one),
                                    cairn_vec2_scale(b->initial_offset, other));

    slide->moving = moving;
    slide->fixed = fixed;
    slide->expected = cairn_vec2_dot(a->along, off);
    slide->variance = slide->initial_sigma * slide->initial_sigma * (one + other);
    set_trials(slide, MAX_PRIOR_SIGMAS * cairn_sqrt(slide->variance));
    for (int32_t i = 0; i < slide->trial_count; i++) {
        cairn_real miss = cairn_weak_direction_trial_translation(slide, i) - slide->expected;
        weak_direction_trial *trial = &slide->trials[i];

        trial->nats = -miss * miss / (2 * slide->variance);
        trial->scan = trial->fixed_scan = trial->is_begun = 0;
    }
    slide->violating_pair.scan = slide->violating_pair.fixed_scan = WEAK_DIRECTION_NO_SUBMAP;
    slide->item = slide->inner_item = 0;
    slide->best_trial = slide->leading_trial = WEAK_DIRECTION_NO_SUBMAP;
    slide->phase = slide->params.use_thickness && slide->result.thickness > 0
                       ? WEAK_DIRECTION_THICKNESS
                       : WEAK_DIRECTION_FREE_SPACE;
    return 1 + slide->trial_count / TRIALS_PER_UNIT;
}

/* ---- Free-space violations ---- */

static int is_evaluated(const cairn_weak_direction *slide, int32_t i)
{
    return slide->trials[i].scan == slide->scan_count;
}

/* Advances to the next scan of the fixed submap that is a candidate pair with the current moving
 * scan; without one, to the next moving scan. Returns 1: a pair is found. *units: the cost. */
static int32_t find_scan_pair(const cairn_weak_direction *slide, weak_direction_trial *trial,
                              int32_t *units)
{
    int32_t passed = 0, asked = 0, found = 0;

    for (; trial->scan < slide->scan_count && slide->scans[trial->scan].submap != slide->moving;
         passed++)
        trial->scan++;
    if (trial->scan < slide->scan_count) {
        for (; trial->fixed_scan < slide->scan_count && !found;
             trial->fixed_scan += !found, passed++)
            if (slide->scans[trial->fixed_scan].submap == slide->fixed) {
                asked++;
                found =
                    cairn_aligner_is_candidate_pair(slide->aligner, trial->scan, trial->fixed_scan);
            }
        if (!found) {
            trial->fixed_scan = 0;
            trial->scan++;
        }
    }
    *units = 1 + passed / SCANS_PER_UNIT + asked / 4;
    return found;
}

/* Adds the free-space violation of a pair of scans to a trial; returns units. */
static int32_t add_violation(cairn_weak_direction *slide, int32_t i, weak_direction_scan_pair two)
{
    const weak_direction_scan *a = &slide->scans[two.scan], *b = &slide->scans[two.fixed_scan];
    cairn_vec2 shift = cairn_vec2_add(
        a->translation, cairn_vec2_scale(slide->submaps[slide->moving].along,
                                         cairn_weak_direction_trial_translation(slide, i)));
    cairn_pose pose = a->map_scan;
    cairn_real nats;
    int32_t units;

    pose.x += shift.x - b->translation.x;
    pose.y += shift.y - b->translation.y;
    nats = cairn_aligner_free_space_violation(slide->aligner, two.scan, two.fixed_scan,
                                              cairn_pose_between(b->map_scan, pose), &units);
    slide->trials[i].nats += nats;
    if (nats < CLEAR_VIOLATION_NATS)
        slide->violating_pair = two;
    return 1 + units;
}

/* Evaluates the next pair of scans of a trial; returns units. */
static int32_t evaluate_next_pair(cairn_weak_direction *slide, int32_t i)
{
    weak_direction_trial *trial = &slide->trials[i];
    weak_direction_scan_pair two;
    int32_t passed;

    if (!trial->is_begun) {
        trial->is_begun = 1;
        trial->first_pair = slide->violating_pair;
        if (trial->first_pair.scan != WEAK_DIRECTION_NO_SUBMAP)
            return add_violation(slide, i, trial->first_pair);
    }
    if (!find_scan_pair(slide, trial, &passed))
        return passed;
    two.scan = trial->scan;
    two.fixed_scan = trial->fixed_scan++;
    if (two.scan == trial->first_pair.scan && two.fixed_scan == trial->first_pair.fixed_scan)
        return passed;
    return passed + add_violation(slide, i, two);
}

/* ---- Best-first search ---- */

/* Returns the trial of the greatest bound; once the best is known, of those outside its
 * neighbourhood; NO_SUBMAP: none. */
static int32_t best_bound(const cairn_weak_direction *slide)
{
    int32_t best = WEAK_DIRECTION_NO_SUBMAP;

    for (int32_t i = 0; i < slide->trial_count; i++)
        if ((slide->best_trial < 0 ||
             cairn_abs(cairn_weak_direction_trial_translation(slide, i) -
                       cairn_weak_direction_trial_translation(slide, slide->best_trial)) >
                 SAME_SOLUTION_M + slide->step / 2) &&
            (best < 0 || slide->trials[i].nats > slide->trials[best].nats))
            best = i;
    return best;
}

static void end_pair(cairn_weak_direction *slide, int32_t second)
{
    weak_direction_submap_pair *pair =
        cairn_weak_direction_pair(slide, slide->moving, slide->fixed);

    pair->translation = cairn_weak_direction_trial_translation(slide, slide->best_trial);
    pair->margin =
        second >= 0
            ? cairn_max(slide->trials[slide->best_trial].nats - slide->trials[second].nats, 0)
            : CAIRN_REAL_MAX;
    slide->phase = WEAK_DIRECTION_NEXT_PAIR;
}

int32_t cairn_weak_direction_free_space_item(cairn_weak_direction *slide)
{
    int32_t units = 1 + slide->trial_count / TRIALS_PER_UNIT, at;

    /* compare with the zero translation */
    if (slide->leading_trial >= 0 && slide->best_trial < 0) {
        if (!is_evaluated(slide, slide->zero_trial) &&
            slide->trials[slide->leading_trial].nats - slide->trials[slide->zero_trial].nats <
                MIN_GAIN_NATS)
            return evaluate_next_pair(slide, slide->zero_trial);
        slide->best_trial =
            slide->trials[slide->leading_trial].nats - slide->trials[slide->zero_trial].nats <
                    MIN_GAIN_NATS
                ? slide->zero_trial
                : slide->leading_trial;
        return 1;
    }
    at = best_bound(slide);
    if (at >= 0 && !is_evaluated(slide, at))
        return units + evaluate_next_pair(slide, at);
    if (slide->best_trial < 0)
        slide->leading_trial = at;
    else
        end_pair(slide, at);
    return units;
}
