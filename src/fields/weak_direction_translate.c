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

#include "src/fields/weak_direction_work.h"

/* Visited trials, and points of two scans, for a work unit; visited scans that a test for a
 * candidate pair costs beside its own. */
enum { TRIALS_PER_UNIT = 16, POINTS_PER_UNIT = 3, SCANS_PER_CANDIDATE_TEST = 3 };

/* m, plus half a step, so that rounding decides nothing: trials within are one solution */
static const cairn_real SAME_SOLUTION_M = CAIRN_REAL(0.06);
/* nats: least gain over the zero translation */
static const cairn_real MIN_GAIN_NATS = 2;
/* nats: a clear free-space violation of one pair of scans */
static const cairn_real CLEAR_VIOLATION_NATS = -1;
/* standard deviations of the initial poses: half width of the trials */
static const cairn_real MAX_PRIOR_SIGMAS = 3;

/* ---- Trials ---- */

/* Sets the trials: multiples of the step within +-far of the expected translation, at least one. */
static void set_range(struct weak_direction_search *search, cairn_real least_step, cairn_real far)
{
    search->step = cairn_max(least_step, 2 * far / (cairn_real)(WEAK_DIRECTION_MAX_TRIALS - 2));
    search->first_step = cairn_real_to_int(cairn_ceil((search->expected - far) / search->step));
    search->trial_count = cairn_real_to_int(cairn_floor((search->expected + far) / search->step)) -
                          search->first_step + 1;
    if (search->trial_count < 1) {
        search->first_step = cairn_real_to_int(cairn_rint(search->expected / search->step));
        search->trial_count = 1;
    }
    search->trial_count = search->trial_count < WEAK_DIRECTION_MAX_TRIALS
                              ? search->trial_count
                              : WEAK_DIRECTION_MAX_TRIALS;
    search->zero_trial = search->first_step > -WEAK_DIRECTION_MAX_TRIALS && search->first_step <= 0
                             ? -search->first_step
                             : search->trial_count;
    if (search->zero_trial >= search->trial_count)
        search->zero_trial = search->trial_count++; /* zero is a trial too, behind the others */
}

/* Sets the translations of the trials. */
static void set_trials(cairn_weak_direction *weak_direction)
{
    struct weak_direction_search *search = &weak_direction->phase.search;
    const weak_direction_submap *a = &weak_direction->submaps[weak_direction->moving],
                                *b = &weak_direction->submaps[weak_direction->fixed];
    cairn_real one = 1 / (cairn_real)a->scans, other = 1 / (cairn_real)b->scans;
    cairn_vec2 off = cairn_vec2_sub(cairn_vec2_scale(a->initial_offset, one),
                                    cairn_vec2_scale(b->initial_offset, other));

    search->expected = cairn_vec2_dot(a->along, off);
    search->variance =
        weak_direction->initial_sigma * weak_direction->initial_sigma * (one + other);
    set_range(search, weak_direction->params.translation_step,
              MAX_PRIOR_SIGMAS * cairn_sqrt(search->variance));
    search->violating_pair.scan = search->violating_pair.fixed_scan = WEAK_DIRECTION_NO_SUBMAP;
    search->best_trial = WEAK_DIRECTION_NO_SUBMAP;
}

/* Starts each trial with the log-likelihood of the initial poses. */
static void add_initial_poses(cairn_weak_direction *weak_direction)
{
    const struct weak_direction_search *search = &weak_direction->phase.search;

    for (int32_t i = 0; i < search->trial_count; i++) {
        cairn_real miss =
            cairn_weak_direction_trial_translation(weak_direction, i) - search->expected;
        weak_direction_trial *trial = &weak_direction->trials[i];

        trial->nats = -miss * miss / (2 * search->variance);
        trial->scan = trial->fixed_scan = trial->is_begun = 0;
    }
}

/* Units of an operation that visits all trials. */
static int32_t all_trials_units(const cairn_weak_direction *weak_direction)
{
    return 1 + weak_direction->phase.search.trial_count / TRIALS_PER_UNIT;
}

int cairn_weak_direction_begin_trials(cairn_weak_direction *weak_direction, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(weak_direction->phase_resume);
    set_trials(weak_direction);
    CAIRN_STEP_CHARGE(weak_direction, phase_resume, budget, all_trials_units(weak_direction));
    add_initial_poses(weak_direction);
    CAIRN_STEP_END(weak_direction->phase_resume);
}

/* ---- Free-space violations ---- */

/* 1 when all pairs of scans of a trial are evaluated. */
static int is_evaluated(const cairn_weak_direction *weak_direction, int32_t i)
{
    return weak_direction->trials[i].scan == weak_direction->scan_count;
}

/* Returns the pair of scans that a trial begins with: the last one with a clear violation.
 * NO_SUBMAP once it has begun, and without such a pair. */
static weak_direction_scan_pair begin_trial(const cairn_weak_direction *weak_direction,
                                            weak_direction_trial *trial)
{
    static const weak_direction_scan_pair none = {WEAK_DIRECTION_NO_SUBMAP,
                                                  WEAK_DIRECTION_NO_SUBMAP};

    if (trial->is_begun)
        return none;
    trial->is_begun = 1;
    trial->first_pair = weak_direction->phase.search.violating_pair;
    return trial->first_pair;
}

/* Advances to the next pair of scans of the two submaps, a candidate pair that was not evaluated
 * first, over the scans of one unit at most; otherwise the pair stays NO_SUBMAP. */
static void find_pair(cairn_weak_direction *weak_direction, weak_direction_trial *trial)
{
    weak_direction_scan_pair *pair = &weak_direction->phase.search.pair;
    int32_t count = weak_direction->scan_count, visited = 0;

    while (visited < WEAK_DIRECTION_SCANS_PER_UNIT && trial->scan < count) {
        int32_t fixed_scan = trial->fixed_scan++;

        visited++;
        if (fixed_scan == count || weak_direction->submap[trial->scan] != weak_direction->moving) {
            trial->scan++;
            trial->fixed_scan = 0;
            continue;
        }
        if (weak_direction->submap[fixed_scan] != weak_direction->fixed)
            continue;
        visited += SCANS_PER_CANDIDATE_TEST;
        if (cairn_aligner_is_candidate_pair(weak_direction->aligner, trial->scan, fixed_scan) &&
            (trial->scan != trial->first_pair.scan || fixed_scan != trial->first_pair.fixed_scan)) {
            pair->scan = trial->scan;
            pair->fixed_scan = fixed_scan;
            return;
        }
    }
}

/* Number of points of a scan. */
static int32_t points_of(const cairn_weak_direction *weak_direction, int32_t scan)
{
    const cairn_scan_set_scan *of = &weak_direction->set->scans[scan];

    return of->end_point - of->first_point;
}

/* Units of the free-space violation of the pair of scans: at most all points of both are looked up
 * in the other. */
static int32_t violation_units(const cairn_weak_direction *weak_direction)
{
    const weak_direction_scan_pair *pair = &weak_direction->phase.search.pair;

    return 2 +
           (points_of(weak_direction, pair->scan) + points_of(weak_direction, pair->fixed_scan)) /
               POINTS_PER_UNIT;
}

/* Adds the free-space violation of the pair of scans to the trial. */
static void add_violation(cairn_weak_direction *weak_direction)
{
    struct weak_direction_search *search = &weak_direction->phase.search;
    weak_direction_scan_pair pair = search->pair;
    const weak_direction_scan *a = &weak_direction->scans[pair.scan],
                              *b = &weak_direction->scans[pair.fixed_scan];
    cairn_vec2 shift = cairn_vec2_add(
        a->translation,
        cairn_vec2_scale(weak_direction->submaps[weak_direction->moving].along,
                         cairn_weak_direction_trial_translation(weak_direction, search->trial)));
    cairn_pose pose = a->map_scan;
    cairn_real nats;

    pose.x += shift.x - b->translation.x;
    pose.y += shift.y - b->translation.y;
    nats = cairn_aligner_free_space_violation(weak_direction->aligner, pair.scan, pair.fixed_scan,
                                              cairn_pose_between(b->map_scan, pose), NULL);
    weak_direction->trials[search->trial].nats += nats;
    if (nats < CLEAR_VIOLATION_NATS)
        search->violating_pair = pair;
}

/* Evaluates the next pair of scans of the trial, if one is left. */
static int evaluate_pair(cairn_weak_direction *weak_direction, cairn_budget *budget)
{
    struct weak_direction_search *search = &weak_direction->phase.search;
    weak_direction_trial *trial = &weak_direction->trials[search->trial];

    CAIRN_STEP_BEGIN(weak_direction->pair_resume);
    search->pair = begin_trial(weak_direction, trial);
    while (search->pair.scan == WEAK_DIRECTION_NO_SUBMAP &&
           !is_evaluated(weak_direction, search->trial)) {
        CAIRN_STEP_CHARGE(weak_direction, pair_resume, budget, 1);
        find_pair(weak_direction, trial);
    }
    if (search->pair.scan != WEAK_DIRECTION_NO_SUBMAP) {
        CAIRN_STEP_CHARGE(weak_direction, pair_resume, budget, violation_units(weak_direction));
        add_violation(weak_direction);
    }
    CAIRN_STEP_END(weak_direction->pair_resume);
}

/* ---- Best-first search ---- */

/* 1 when a trial is outside of the neighbourhood of the best, or that is not known. */
static int is_other_solution(const cairn_weak_direction *weak_direction, int32_t i)
{
    const struct weak_direction_search *search = &weak_direction->phase.search;

    return search->best_trial < 0 ||
           cairn_abs(cairn_weak_direction_trial_translation(weak_direction, i) -
                     cairn_weak_direction_trial_translation(weak_direction, search->best_trial)) >
               SAME_SOLUTION_M + search->step / 2;
}

/* Returns the trial of the greatest bound; once the best is known, of those outside its
 * neighbourhood; NO_SUBMAP: none. */
static int32_t best_bound(const cairn_weak_direction *weak_direction)
{
    int32_t best = WEAK_DIRECTION_NO_SUBMAP;

    for (int32_t i = 0; i < weak_direction->phase.search.trial_count; i++)
        if (is_other_solution(weak_direction, i) &&
            (best < 0 || weak_direction->trials[i].nats > weak_direction->trials[best].nats))
            best = i;
    return best;
}

/* Evaluates trials until that of the greatest bound is evaluated, or none is left. */
static int find_best(cairn_weak_direction *weak_direction, cairn_budget *budget)
{
    struct weak_direction_search *search = &weak_direction->phase.search;

    CAIRN_STEP_BEGIN(weak_direction->trial_resume);
    for (;;) {
        CAIRN_STEP_CHARGE(weak_direction, trial_resume, budget, all_trials_units(weak_direction));
        search->trial = best_bound(weak_direction);
        if (search->trial < 0 || is_evaluated(weak_direction, search->trial))
            break;
        CAIRN_STEP_RUN(weak_direction, trial_resume, budget, evaluate_pair);
    }
    CAIRN_STEP_END(weak_direction->trial_resume);
}

/* 1 when the leading trial gains too little over the zero translation. */
static int gains_little(const cairn_weak_direction *weak_direction)
{
    const struct weak_direction_search *search = &weak_direction->phase.search;

    return weak_direction->trials[search->leading_trial].nats -
               weak_direction->trials[search->zero_trial].nats <
           MIN_GAIN_NATS;
}

/* Stores the best translation and its margin over the trial, if any. */
static void store_pair(cairn_weak_direction *weak_direction)
{
    const struct weak_direction_search *search = &weak_direction->phase.search;
    const weak_direction_trial *trials = weak_direction->trials;

    weak_direction->pair->translation =
        cairn_weak_direction_trial_translation(weak_direction, search->best_trial);
    weak_direction->pair->margin =
        search->trial >= 0
            ? cairn_max(trials[search->best_trial].nats - trials[search->trial].nats, 0)
            : CAIRN_REAL_MAX;
}

int cairn_weak_direction_search_trials(cairn_weak_direction *weak_direction, cairn_budget *budget)
{
    struct weak_direction_search *search = &weak_direction->phase.search;

    CAIRN_STEP_BEGIN(weak_direction->phase_resume);
    CAIRN_STEP_RUN(weak_direction, phase_resume, budget, find_best);
    search->leading_trial = search->trial;
    search->trial = search->zero_trial;
    while (gains_little(weak_direction) && !is_evaluated(weak_direction, search->zero_trial))
        CAIRN_STEP_RUN(weak_direction, phase_resume, budget, evaluate_pair);
    search->best_trial = gains_little(weak_direction) ? search->zero_trial : search->leading_trial;
    CAIRN_STEP_RUN(weak_direction, phase_resume, budget, find_best);
    store_pair(weak_direction);
    CAIRN_STEP_END(weak_direction->phase_resume);
}
