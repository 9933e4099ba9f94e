/* Relocalization search: after a match of low confidence scan_match searches around the prediction.
 *
 * Method.
 *
 * 1. scan_match gets the nearby keyframes and searches a small window, then a wide one.
 * 2. Where its best hypothesis is the current match, that match is kept.
 * 3. A hypothesis far from healthy odometry competes with the prior against kidnapping: its log
 *    odds must exceed a cost that grows with the squared distance. The one of the highest posterior
 *    is taken.
 * 4. A single scan that nearly does so leaves a pending relocalization hypothesis. When the next
 *    scan finds the same pose, both log odds are added, and those against an agreement by
 *    chance.
 * 5. After a scan without a match the robot may have been turned by any angle, by a person who
 *    stands before it: the wide window has all headings and LOST_SEARCH_M, and the cost is half the
 *    squared Mahalanobis distance by the standard deviation of such scans, which grows with their
 *    number. */
#include "src/base/build.h"

#include "src/base/step.h"
#include "src/maps/mapper_work.h"

/* m and rad: half sides of the small search window */
static const cairn_real SEARCH_RADIUS_M = CAIRN_REAL(0.5), SEARCH_ANGLE_RAD = CAIRN_REAL(0.5);
/* rad: half side of the wide search window, which has MAPPER_WIDE_SEARCH_M */
static const cairn_real WIDE_SEARCH_RAD = CAIRN_REAL(1.6);
/* m: that of the wide search window after a scan without a match, which has all headings */
static const cairn_real LOST_SEARCH_M = 2;
/* m and rad: unit of distance from odometry in the kidnapping prior */
static const cairn_real KIDNAPPING_SCALE = CAIRN_REAL(0.5);
/* nats: negative log prior of being moved by one unit; it grows with the square, ... */
static const cairn_real KIDNAPPING_COST = 3;
/* nats: ... up to this, that of a pose anywhere */
static const cairn_real MAX_KIDNAPPING_COST = 12;
/* m and rad: maximum difference of the poses that two successive scans find */
static const cairn_real REPEAT_TOLERANCE = CAIRN_REAL(0.3);
/* nats: minimum log odds by scan_match; low, since the true pose is most likely in the window */
static const cairn_real MIN_LOG_ODDS = -4;
/* nats: minimum log odds of a pending hypothesis */
static const cairn_real MIN_PENDING_LOG_ODDS = -6;
/* nats: log odds of two scans that find one pose. Poses at random in the wide window, 2 x 2 m and
 * 3.2 rad, agree within the tolerance once in 75 times. */
static const cairn_real REPEAT_LOG_ODDS = 4;
/* Minimum share of the scan that fits in the wide window; of one whose posterior odds are above
 * even, as a person may hide the rest. */
static const cairn_real MIN_WIDE_FIT = CAIRN_REAL(0.5), MIN_HIDDEN_FIT = CAIRN_REAL(0.25);

/* ---- The target ---- */

static int32_t search_keyframes(const cairn_mapper *mapper)
{
    return mapper->target.count < MAPPER_SEARCH_KEYFRAMES ? mapper->target.count
                                                          : MAPPER_SEARCH_KEYFRAMES;
}

/* Returns the next keyframe of the target. */
static int32_t next_keyframe(const cairn_mapper *mapper)
{
    return mapper->target.keyframes[mapper->target.search_count].keyframe;
}

/* Adds the next keyframe to the target, which is complete when scan_match is full. */
static void add_keyframe(cairn_mapper *mapper)
{
    mapper_target *target = &mapper->target;

    if (target->search_count == 0) {
        cairn_mapper_preempt_loop_match(mapper);
        cairn_scan_match_clear_target(mapper->search);
    }
    if (cairn_mapper_add_search_target(mapper, next_keyframe(mapper)))
        target->search_count++;
    else
        target->search_count = search_keyframes(mapper);
}

/* ---- A window ---- */

static int32_t query_units(const cairn_mapper *mapper)
{
    return 2 + cairn_scan_read(mapper->scan).point_count / 4;
}

/* Returns the search window: small, wide, or wide after a scan without a match. */
static cairn_scan_match_window window_of(const cairn_mapper *mapper)
{
    cairn_scan_match_window window = {SEARCH_RADIUS_M, SEARCH_ANGLE_RAD};

    if (mapper->current.relocalization.is_wide) {
        window.distance = mapper->unmatched > 0 ? LOST_SEARCH_M : MAPPER_WIDE_SEARCH_M;
        window.angle = mapper->unmatched > 0 ? CAIRN_PI : WIDE_SEARCH_RAD;
    }
    window.distance += cairn_mapper_translation(mapper->current.motion);
    return window;
}

/* Returns 0 when the prediction is out of the searchable range. */
static int begin_window(cairn_mapper *mapper)
{
    cairn_scan_view view = cairn_scan_read(mapper->scan);
    cairn_scan_match_part query = cairn_scan_match_part_of(&view);
    cairn_scan_match_window window = window_of(mapper);

    return cairn_scan_match_begin(mapper->search, &query, mapper->current.predicted, &window,
                                  NULL) == CAIRN_OK;
}

/* Returns the units of this scan's search and matches. After an interval without scans the robot may
 * have moved far; the search takes those of the missing scans, too. */
static int32_t units_of_scan(const cairn_mapper *mapper)
{
    int64_t units = (int64_t)mapper->params.search_units * mapper->previous.intervals;

    return units < INT32_MAX ? (int32_t)units : INT32_MAX;
}

/* Continues the search within its share of units. Returns 1 when it is complete or the share is
 * used up. */
static int search_window(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper_current *current = &mapper->current;
    int32_t all = units_of_scan(mapper),
            quota = all - current->match_units_used - current->search_units_used;
    int32_t most = budget->left < quota ? budget->left : quota;
    cairn_budget share = {most};

    current->relocalization.is_complete =
        cairn_scan_match_step(mapper->search, &share) != CAIRN_MORE;
    cairn_budget_spend(budget, most - share.left);
    current->search_units_used += most - share.left;
    return current->relocalization.is_complete ||
           current->match_units_used + current->search_units_used >= all;
}

/* ---- Its hypotheses ---- */

/* Returns 1 when the previous scan's pending hypothesis predicts the same pose. */
static int32_t is_repeated(const cairn_mapper *mapper, cairn_pose pose)
{
    return mapper->hypothesis.scan > 0 && mapper->hypothesis.scan == mapper->state.scans &&
           !cairn_mapper_differ(cairn_pose_compose(mapper->hypothesis.pose, mapper->current.motion),
                                pose, REPEAT_TOLERANCE, REPEAT_TOLERANCE);
}

/* Returns the log odds of a pose: those of this scan plus those of the pending hypothesis. */
static cairn_real total_log_odds(const cairn_mapper *mapper,
                                 const cairn_scan_match_hypothesis *found)
{
    return found->log_odds + (is_repeated(mapper, found->target_query)
                                  ? mapper->hypothesis.log_odds + REPEAT_LOG_ODDS
                                  : 0);
}

/* Returns the negative log prior of a pose after scans without a match, nats. */
static cairn_real unmatched_cost(const cairn_mapper *mapper, cairn_pose pose)
{
    cairn_pose off = cairn_pose_between(mapper->current.predicted, pose);
    cairn_real x = cairn_mapper_translation(off) / MAPPER_UNMATCHED_M,
               turn = off.theta / MAPPER_UNMATCHED_RAD;

    return cairn_min((x * x + turn * turn) / (2 * (cairn_real)(mapper->unmatched + 1)),
                     MAX_KIDNAPPING_COST);
}

/* Returns the negative log prior of a pose far from odometry, nats. It is halved when the pending
 * hypothesis agrees: random similarities differ between scans. */
static cairn_real kidnapping_cost(const cairn_mapper *mapper, cairn_pose pose)
{
    cairn_real cost =
        mapper->unmatched > 0
            ? unmatched_cost(mapper, pose)
            : KIDNAPPING_COST * cairn_mapper_prior_deviation(mapper, pose, KIDNAPPING_SCALE);

    return is_repeated(mapper, pose) ? cost / 2 : cost;
}

/* Returns the log of the posterior odds of a hypothesis, nats. */
static cairn_real log_posterior(const cairn_mapper *mapper,
                                const cairn_scan_match_hypothesis *found)
{
    return total_log_odds(mapper, found) - kidnapping_cost(mapper, found->target_query);
}

/* Returns the hypothesis of the highest posterior with healthy odometry, else that of the highest
 * score. The result has one. */
static const cairn_scan_match_hypothesis *best_of(const cairn_mapper *mapper,
                                                  const cairn_scan_match_result *result)
{
    cairn_real highest = -CAIRN_REAL_MAX;
    int32_t best = 0;

    for (int32_t i = 0; i < result->count && mapper->current.uses_odometry; i++) {
        cairn_real value = log_posterior(mapper, &result->hypotheses[i]);

        if (value > highest) {
            highest = value;
            best = i;
        }
    }
    return &result->hypotheses[best];
}

/* Returns 1 when the best hypothesis is accepted. With healthy odometry its log odds must exceed
 * the kidnapping prior, and in the wide window most of the scan must fit, or its posterior odds must
 * be above even. */
static int32_t is_found(const cairn_mapper *mapper, const cairn_scan_match_result *result)
{
    const cairn_scan_match_hypothesis *best;
    cairn_real value;

    if (result->count == 0)
        return 0;
    best = best_of(mapper, result);
    if (!mapper->current.uses_odometry)
        return best->log_odds > MIN_LOG_ODDS;
    value = log_posterior(mapper, best);
    if (mapper->current.relocalization.is_wide &&
        (result->verdict == CAIRN_SCAN_MATCH_NONE || best->fit <= MIN_WIDE_FIT))
        return best->fit > MIN_HIDDEN_FIT && value > 0;
    return value > MIN_LOG_ODDS;
}

/* Stores the best hypothesis as pending; the next scan may confirm it. */
static void store_hypothesis(cairn_mapper *mapper, const cairn_scan_match_result *result)
{
    const cairn_scan_match_hypothesis *best;
    cairn_real log_odds;

    if (result->count == 0 || !mapper->current.uses_odometry)
        return;
    best = best_of(mapper, result);
    log_odds = total_log_odds(mapper, best);
    if (!(log_odds > MIN_PENDING_LOG_ODDS))
        return;
    mapper->hypothesis.pose = best->target_query;
    mapper->hypothesis.log_odds = log_odds;
    mapper->hypothesis.scan = mapper->state.scans + 1;
}

/* Returns 1 when the search found the current match. One that contradicts healthy odometry needs
 * MIN_LOG_ODDS. */
static int32_t confirms(const cairn_mapper *mapper, const cairn_scan_match_result *result)
{
    return mapper->current.has_match && result->count > 0 &&
           (!mapper->current.uses_odometry || result->hypotheses[0].log_odds > MIN_LOG_ODDS ||
            !cairn_mapper_is_motion_outlier(mapper, mapper->current.match.target_query)) &&
           !cairn_mapper_differ(mapper->current.match.target_query,
                                result->hypotheses[0].target_query, 2 * MAPPER_DISTINCT_M,
                                2 * MAPPER_DISTINCT_RAD);
}

/* Accepts the best hypothesis. */
static void take_hypothesis(cairn_mapper *mapper, const cairn_scan_match_result *result)
{
    mapper_relocalization *relocalization = &mapper->current.relocalization;

    relocalization->is_found = 1;
    relocalization->pose = best_of(mapper, result)->target_query;
    /* Odometry decides between ambiguous hypotheses. */
    mapper->current.low_confidence = cairn_mapper_is_ambiguous(result) &&
                                     (!mapper->current.uses_odometry ||
                                      cairn_mapper_is_motion_outlier(mapper, relocalization->pose));
}

/* Evaluates what a window has: takes its best hypothesis, or stores it. Returns 1 when the search ends
 * with this window. */
static int evaluate_window(cairn_mapper *mapper)
{
    mapper_relocalization *relocalization = &mapper->current.relocalization;
    cairn_scan_match_result result = cairn_scan_match_read(mapper->search);

    if (!relocalization->is_complete)
        return 1;
    if (is_found(mapper, &result)) {
        take_hypothesis(mapper, &result);
    } else if (confirms(mapper, &result)) {
        relocalization->is_confirmed = 1;
        mapper->current.low_confidence = 0;
    } else if (relocalization->is_wide) {
        store_hypothesis(mapper, &result);
    }
    return relocalization->is_found || relocalization->is_confirmed;
}

int cairn_mapper_relocalize(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper_relocalization *relocalization = &mapper->current.relocalization;

    CAIRN_STEP_BEGIN(relocalization->resume);
    relocalization->is_found = relocalization->is_confirmed = 0;
    mapper->current.low_confidence = 1;
    mapper->state.searched++;
    while (mapper->target.search_count < search_keyframes(mapper)) {
        CAIRN_STEP_CHARGE(relocalization, resume, budget,
                          cairn_mapper_search_target_units(mapper, next_keyframe(mapper)));
        add_keyframe(mapper);
    }
    for (relocalization->is_wide = mapper->unmatched > 0; relocalization->is_wide < 2;
         relocalization->is_wide++) {
        CAIRN_STEP_CHARGE(relocalization, resume, budget, query_units(mapper));
        if (!begin_window(mapper))
            break;
        CAIRN_STEP_UNTIL(relocalization->resume, search_window(mapper, budget));
        if (evaluate_window(mapper))
            break;
    }
    CAIRN_STEP_END(relocalization->resume);
}
