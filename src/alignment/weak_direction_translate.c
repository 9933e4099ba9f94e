/* weak_direction: best translation of one submap against another, by best-first search.
 *
 * Method: trials are all translations that the prior of the initial poses allows, and zero.
 * 1. Each trial starts with the log-likelihood of the initial poses, then of the wall thickness.
 * 2. Free-space violations of pairs of scans are subtracted. They are the most expensive term and
 *    can only lower a trial, so its value is always an upper bound. Best-first: the trial of the
 *    greatest bound is evaluated next, one pair of scans at a time. A trial with all pairs
 *    evaluated and the greatest value is the optimum (branch and bound).
 * 3. The pair of scans with the last clear violation is evaluated first in the next trial, as it
 *    mostly violates again; most trials therefore need one or two pairs.
 * 4. The best trial outside its neighbourhood is found in the same way; the difference is the
 *    margin. */
#include "src/base/build.h"

#include "src/alignment/weak_direction_work.h"

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
static void set_trials(cairn_weak_direction *weak_direction, cairn_real far)
{
    weak_direction->step = cairn_max(weak_direction->params.translation_step,
                                     2 * far / (cairn_real)(WEAK_DIRECTION_MAX_TRIALS - 2));
    weak_direction->first_step =
        cairn_real_to_int(cairn_ceil((weak_direction->expected - far) / weak_direction->step));
    weak_direction->trial_count =
        cairn_real_to_int(cairn_floor((weak_direction->expected + far) / weak_direction->step)) -
        weak_direction->first_step + 1;
    if (weak_direction->trial_count < 1) {
        weak_direction->first_step =
            cairn_real_to_int(cairn_rint(weak_direction->expected / weak_direction->step));
        weak_direction->trial_count = 1;
    }
    weak_direction->trial_count = weak_direction->trial_count < WEAK_DIRECTION_MAX_TRIALS
                                      ? weak_direction->trial_count
                                      : WEAK_DIRECTION_MAX_TRIALS;
    weak_direction->zero_trial =
        weak_direction->first_step > -WEAK_DIRECTION_MAX_TRIALS && weak_direction->first_step <= 0
            ? -weak_direction->first_step
            : weak_direction->trial_count;
    if (weak_direction->zero_trial >= weak_direction->trial_count)
        weak_direction->zero_trial =
            weak_direction->trial_count++; /* zero is a trial too, behind the others */
}

int32_t cairn_weak_direction_begin_pair(cairn_weak_direction *weak_direction, int32_t moving,
                                        int32_t fixed)
{
    const weak_direction_submap *a = &weak_direction->submaps[moving],
                                *b = &weak_direction->submaps[fixed];
    cairn_real one = 1 / (cairn_real)a->scans, other = 1 / (cairn_real)b->scans;
    cairn_vec2 off = cairn_vec2_sub(cairn_vec2_scale(a->initial_offset, one),
                                    cairn_vec2_scale(b->initial_offset, other));

    weak_direction->moving = moving;
    weak_direction->fixed = fixed;
    weak_direction->expected = cairn_vec2_dot(a->along, off);
    weak_direction->variance =
        weak_direction->initial_sigma * weak_direction->initial_sigma * (one + other);
    set_trials(weak_direction, MAX_PRIOR_SIGMAS * cairn_sqrt(weak_direction->variance));
    for (int32_t i = 0; i < weak_direction->trial_count; i++) {
        cairn_real miss =
            cairn_weak_direction_trial_translation(weak_direction, i) - weak_direction->expected;
        weak_direction_trial *trial = &weak_direction->trials[i];

        trial->nats = -miss * miss / (2 * weak_direction->variance);
        trial->scan = trial->fixed_scan = trial->is_begun = 0;
    }
    weak_direction->violating_pair.scan = weak_direction->violating_pair.fixed_scan =
        WEAK_DIRECTION_NO_SUBMAP;
    weak_direction->item = 0;
    weak_direction->best_trial = weak_direction->leading_trial = WEAK_DIRECTION_NO_SUBMAP;
    weak_direction->phase =
        weak_direction->params.use_thickness && weak_direction->result.thickness > 0
            ? WEAK_DIRECTION_THICKNESS
            : WEAK_DIRECTION_FREE_SPACE;
    return 1 + weak_direction->trial_count / TRIALS_PER_UNIT;
}

/* ---- Free-space violations ---- */

static int is_evaluated(const cairn_weak_direction *weak_direction, int32_t i)
{
    return weak_direction->trials[i].scan == weak_direction->scan_count;
}

/* Advances to the next scan of the fixed submap that is a candidate pair with the current moving
 * scan; without one, to the next moving scan. Returns 1: a pair is found. *units: the cost. */
static int32_t find_scan_pair(const cairn_weak_direction *weak_direction,
                              weak_direction_trial *trial, int32_t *units)
{
    int32_t passed = 0, tested = 0, found = 0;

    for (; trial->scan < weak_direction->scan_count &&
           weak_direction->scans[trial->scan].submap != weak_direction->moving;
         passed++)
        trial->scan++;
    if (trial->scan < weak_direction->scan_count) {
        for (; trial->fixed_scan < weak_direction->scan_count && !found;
             trial->fixed_scan += !found, passed++)
            if (weak_direction->scans[trial->fixed_scan].submap == weak_direction->fixed) {
                tested++;
                found = cairn_aligner_is_candidate_pair(weak_direction->aligner, trial->scan,
                                                        trial->fixed_scan);
            }
        if (!found) {
            trial->fixed_scan = 0;
            trial->scan++;
        }
    }
    *units = 1 + passed / SCANS_PER_UNIT + tested / 4;
    return found;
}

/* Adds the free-space violation of a pair of scans to a trial; returns units. */
static int32_t add_violation(cairn_weak_direction *weak_direction, int32_t i,
                             weak_direction_scan_pair two)
{
    const weak_direction_scan *a = &weak_direction->scans[two.scan],
                              *b = &weak_direction->scans[two.fixed_scan];
    cairn_vec2 shift =
        cairn_vec2_add(a->translation,
                       cairn_vec2_scale(weak_direction->submaps[weak_direction->moving].along,
                                        cairn_weak_direction_trial_translation(weak_direction, i)));
    cairn_pose pose = a->map_scan;
    cairn_real nats;
    int32_t units;

    pose.x += shift.x - b->translation.x;
    pose.y += shift.y - b->translation.y;
    nats = cairn_aligner_free_space_violation(weak_direction->aligner, two.scan, two.fixed_scan,
                                              cairn_pose_between(b->map_scan, pose), &units);
    weak_direction->trials[i].nats += nats;
    if (nats < CLEAR_VIOLATION_NATS)
        weak_direction->violating_pair = two;
    return 1 + units;
}

/* Evaluates the next pair of scans of a trial; returns units. */
static int32_t evaluate_next_pair(cairn_weak_direction *weak_direction, int32_t i)
{
    weak_direction_trial *trial = &weak_direction->trials[i];
    weak_direction_scan_pair two;
    int32_t passed;

    if (!trial->is_begun) {
        trial->is_begun = 1;
        trial->first_pair = weak_direction->violating_pair;
        if (trial->first_pair.scan != WEAK_DIRECTION_NO_SUBMAP)
            return add_violation(weak_direction, i, trial->first_pair);
    }
    if (!find_scan_pair(weak_direction, trial, &passed))
        return passed;
    two.scan = trial->scan;
    two.fixed_scan = trial->fixed_scan++;
    if (two.scan == trial->first_pair.scan && two.fixed_scan == trial->first_pair.fixed_scan)
        return passed;
    return passed + add_violation(weak_direction, i, two);
}

/* ---- Best-first search ---- */

/* Returns the trial of the greatest bound; once the best is known, of those outside its
 * neighbourhood; NO_SUBMAP: none. */
static int32_t best_bound(const cairn_weak_direction *weak_direction)
{
    int32_t best = WEAK_DIRECTION_NO_SUBMAP;

    for (int32_t i = 0; i < weak_direction->trial_count; i++)
        if ((weak_direction->best_trial < 0 ||
             cairn_abs(cairn_weak_direction_trial_translation(weak_direction, i) -
                       cairn_weak_direction_trial_translation(weak_direction,
                                                              weak_direction->best_trial)) >
                 SAME_SOLUTION_M + weak_direction->step / 2) &&
            (best < 0 || weak_direction->trials[i].nats > weak_direction->trials[best].nats))
            best = i;
    return best;
}

static void end_pair(cairn_weak_direction *weak_direction, int32_t second)
{
    weak_direction_submap_pair *pair =
        cairn_weak_direction_pair(weak_direction, weak_direction->moving, weak_direction->fixed);

    pair->translation =
        cairn_weak_direction_trial_translation(weak_direction, weak_direction->best_trial);
    pair->margin = second >= 0 ? cairn_max(weak_direction->trials[weak_direction->best_trial].nats -
                                               weak_direction->trials[second].nats,
                                           0)
                               : CAIRN_REAL_MAX;
    weak_direction->phase = WEAK_DIRECTION_NEXT_PAIR;
}

int32_t cairn_weak_direction_free_space_item(cairn_weak_direction *weak_direction)
{
    int32_t units = 1 + weak_direction->trial_count / TRIALS_PER_UNIT, at;

    /* compare with the zero translation */
    if (weak_direction->leading_trial >= 0 && weak_direction->best_trial < 0) {
        if (!is_evaluated(weak_direction, weak_direction->zero_trial) &&
            weak_direction->trials[weak_direction->leading_trial].nats -
                    weak_direction->trials[weak_direction->zero_trial].nats <
                MIN_GAIN_NATS)
            return evaluate_next_pair(weak_direction, weak_direction->zero_trial);
        weak_direction->best_trial =
            weak_direction->trials[weak_direction->leading_trial].nats -
                        weak_direction->trials[weak_direction->zero_trial].nats <
                    MIN_GAIN_NATS
                ? weak_direction->zero_trial
                : weak_direction->leading_trial;
        return 1;
    }
    at = best_bound(weak_direction);
    if (at >= 0 && !is_evaluated(weak_direction, at))
        return units + evaluate_next_pair(weak_direction, at);
    if (weak_direction->best_trial < 0)
        weak_direction->leading_trial = at;
    else
        end_pair(weak_direction, at);
    return units;
}
