/* Relocalization search: after a match of low confidence scan_match searches around the prediction.
 *
 * Method.
 *
 * 1. scan_match gets the nearby keyframes and searches a small window, then a wide one.
 * 2. Where its best hypothesis is the current match, that match is kept.
 * 3. A hypothesis far from healthy odometry competes with the prior against kidnapping: its log
 *    odds must exceed a cost that grows with the squared distance.
 * 4. A single scan that nearly does so leaves a pending relocalization hypothesis. When the next
 *    scan finds the same pose, both log odds are added. A scan with a new pending hypothesis does
 *    not become a keyframe. */
#include "src/base/build.h"

#include "src/maps/mapper_work.h"

/* m and rad: half sides of the small search window */
static const cairn_real SEARCH_RADIUS_M = CAIRN_REAL(0.5), SEARCH_ANGLE_RAD = CAIRN_REAL(0.5);
/* rad: half side of the wide search window, which has MAPPER_WIDE_SEARCH_M */
static const cairn_real WIDE_SEARCH_RAD = CAIRN_REAL(1.6);
/* m and rad: unit of distance from odometry in the kidnapping prior */
static const cairn_real KIDNAPPING_SCALE = CAIRN_REAL(0.5);
/* nats: negative log prior of being moved by one unit; it grows with the square, up to 4 times */
static const cairn_real KIDNAPPING_COST = 3;
/* m and rad: maximum difference of the poses that two successive scans find */
static const cairn_real REPEAT_TOLERANCE = CAIRN_REAL(0.3);
/* nats: minimum log odds by scan_match; low, since the true pose is most likely in the window */
static const cairn_real MIN_LOG_ODDS = -4;
/* minimum share of the scan that fits in the wide window */
static const cairn_real MIN_WIDE_FIT = CAIRN_REAL(0.5);

static cairn_status begin_search(cairn_mapper *mapper)
{
    cairn_scan_view view = cairn_scan_read(mapper->scan);
    cairn_scan_match_part query = cairn_scan_match_part_of(&view);
    cairn_scan_match_window window = {
        SEARCH_RADIUS_M + cairn_mapper_translation(mapper->current.motion), SEARCH_ANGLE_RAD};

    if (mapper->current.searches > 0) {
        window.distance = MAPPER_WIDE_SEARCH_M + cairn_mapper_translation(mapper->current.motion);
        window.angle = WIDE_SEARCH_RAD;
    }
    mapper->state.searched += mapper->current.searches == 0;
    mapper->current.searches++;
    mapper->phase = MAPPER_SEARCH;
    if (cairn_scan_match_begin(mapper->search, &query, mapper->current.predicted, &window, NULL) !=
        CAIRN_OK) {
        /* The prediction is out of the searchable range. */
        mapper->phase = MAPPER_STORE;
        mapper->current.low_confidence = 1;
    }
    return CAIRN_OK;
}

static int32_t search_keyframes(const cairn_mapper *mapper)
{
    return mapper->target.count < MAPPER_SEARCH_KEYFRAMES ? mapper->target.count
                                                          : MAPPER_SEARCH_KEYFRAMES;
}

cairn_status cairn_mapper_search_target(cairn_mapper *mapper, cairn_budget *budget)
{
    int32_t keyframe;

    if (mapper->target.search_count == search_keyframes(mapper))
        return begin_search(mapper);
    if (mapper->target.search_count == 0) {
        cairn_mapper_preempt_loop_match(mapper);
        cairn_scan_match_clear_target(mapper->search);
    }
    keyframe = mapper->target.keyframes[mapper->target.search_count++].keyframe;
    cairn_budget_spend(budget, 1);
    if (cairn_mapper_add_search_target(mapper, keyframe, budget) != CAIRN_OK)
        mapper->target.search_count = search_keyframes(mapper); /* full */
    return CAIRN_OK;
}

/* Returns 1 when the previous scan's pending hypothesis predicts the same pose. */
static int32_t is_repeated(const cairn_mapper *mapper, cairn_pose pose)
{
    cairn_pose difference = cairn_pose_between(
        cairn_pose_compose(mapper->hypothesis.pose, mapper->current.motion), pose);

    return mapper->hypothesis.scan > 0 && mapper->hypothesis.scan == mapper->state.scans &&
           cairn_mapper_translation(difference) <= REPEAT_TOLERANCE &&
           cairn_abs(difference.theta) <= REPEAT_TOLERANCE;
}

/* Returns the log odds of a pose: those of this scan plus those of the pending hypothesis. */
static cairn_real total_log_odds(const cairn_mapper *mapper,
                                 const cairn_scan_match_hypothesis *found)
{
    return found->log_odds +
           (is_repeated(mapper, found->target_query) ? mapper->hypothesis.log_odds : 0);
}

/* Returns the negative log prior of a pose far from odometry, nats. It is halved when the previous
 * scan had no match, since kidnapping may have begun there. It is halved again when the pending
 * hypothesis agrees: random similarities differ between scans. */
static cairn_real kidnapping_cost(const cairn_mapper *mapper, cairn_pose pose)
{
    cairn_real cost =
        KIDNAPPING_COST * cairn_mapper_prior_deviation(mapper, pose, KIDNAPPING_SCALE);

    if (mapper->result.verdict != CAIRN_MAPPER_MATCHED)
        cost /= 2;
    return is_repeated(mapper, pose) ? cost / 2 : cost;
}

/* Returns 1 when the best hypothesis is accepted. With healthy odometry its log odds must exceed
 * the kidnapping prior, and in the wide window most of the scan must fit. */
static int32_t is_found(const cairn_mapper *mapper, const cairn_scan_match_result *result)
{
    const cairn_scan_match_hypothesis *best = result->hypotheses;

    if (result->count == 0)
        return 0;
    if (!mapper->current.uses_odometry)
        return best->log_odds > MIN_LOG_ODDS;
    if (mapper->current.searches > 1 &&
        (result->verdict == CAIRN_SCAN_MATCH_NONE || best->fit <= MIN_WIDE_FIT))
        return 0;
    return total_log_odds(mapper, best) >
           MIN_LOG_ODDS + kidnapping_cost(mapper, best->target_query);
}

/* Stores the best hypothesis as pending; the next scan may confirm it. */
static void store_hypothesis(cairn_mapper *mapper, const cairn_scan_match_result *result)
{
    const cairn_scan_match_hypothesis *best = result->hypotheses;
    cairn_real log_odds;

    if (result->count == 0 || !mapper->current.uses_odometry)
        return;
    log_odds = total_log_odds(mapper, best);
    if (!(log_odds > 0))
        return;
    mapper->hypothesis.is_new = mapper->hypothesis.scan != mapper->state.scans;
    mapper->hypothesis.pose = best->target_query;
    mapper->hypothesis.log_odds = log_odds;
    mapper->hypothesis.scan = mapper->state.scans + 1;
}

/* Returns 1 when the search found the current match. */
static int32_t confirms(const cairn_mapper *mapper, const cairn_scan_match_result *result)
{
    cairn_pose difference;

    if (!mapper->current.has_match || result->count == 0)
        return 0;
    difference =
        cairn_pose_between(mapper->current.match.target_query, result->hypotheses[0].target_query);
    return cairn_mapper_translation(difference) <= 2 * MAPPER_DISTINCT_M &&
           cairn_abs(difference.theta) <= 2 * MAPPER_DISTINCT_RAD;
}

/* Ends the search: ICP runs from the best hypothesis, or the current match stays with low
 * confidence. */
static cairn_status end_search(cairn_mapper *mapper)
{
    cairn_scan_match_result result = cairn_scan_match_read(mapper->search);
    cairn_scan_view view = cairn_scan_read(mapper->scan);
    cairn_rigid_motion_pose_prior prior = cairn_mapper_prior_of(mapper, mapper->current.motion, 0);
    cairn_real best = 0;
    int32_t chosen = -1;

    if (!is_found(mapper, &result) && confirms(mapper, &result))
        return cairn_mapper_finish_match(mapper);
    if (!is_found(mapper, &result) && mapper->current.searches == 1)
        return begin_search(mapper);
    mapper->phase = MAPPER_STORE;
    mapper->current.low_confidence = 1;
    if (!is_found(mapper, &result)) {
        store_hypothesis(mapper, &result);
        return CAIRN_OK;
    }
    for (int32_t i = 0; i < result.count; i++) {
        cairn_pose pose = result.hypotheses[i].target_query;
        cairn_real value =
            cairn_log(result.hypotheses[i].score + CAIRN_REAL(1e-3)) -
            CAIRN_REAL(0.05) * cairn_mapper_prior_deviation(mapper, pose, MAPPER_PRIOR_SCALE);

        if (chosen < 0 || value > best) {
            chosen = i;
            best = value;
        }
    }
    /* Odometry decides between ambiguous hypotheses. */
    mapper->current.low_confidence =
        cairn_mapper_is_ambiguous(&result) &&
        (!mapper->current.uses_odometry ||
         cairn_mapper_is_motion_outlier(mapper, result.hypotheses[chosen].target_query));
    mapper->phase = MAPPER_MATCH_FOUND;
    prior.mean = result.hypotheses[chosen].target_query;
    return cairn_icp_begin(mapper->icp, view.points, view.point_count,
                           result.hypotheses[chosen].target_query, &prior, NULL);
}

cairn_status cairn_mapper_search_step(cairn_mapper *mapper, cairn_budget *budget)
{
    int32_t quota = mapper->params.search_units - mapper->current.match_units_used -
                    mapper->current.search_units_used;
    int32_t most = budget->left < quota ? budget->left : quota;
    cairn_budget share = {most};
    cairn_status status = cairn_scan_match_step(mapper->search, &share);

    cairn_budget_spend(budget, most - share.left);
    mapper->current.search_units_used += most - share.left;
    if (status == CAIRN_OK)
        return end_search(mapper);
    if (status == CAIRN_MORE &&
        mapper->current.match_units_used + mapper->current.search_units_used >=
            mapper->params.search_units) {
        mapper->phase = MAPPER_STORE;
        mapper->current.low_confidence = 1;
    }
    return status == CAIRN_MORE ? CAIRN_OK : status;
}
