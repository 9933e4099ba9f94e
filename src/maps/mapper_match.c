/* The match of a scan with the local map.
 *
 * Method.
 *
 * 1. ICP starts at the predicted pose (mapper_front.c).
 * 2. If the predictions by odometry and by constant velocity differ by more than MAPPER_DISTINCT_M
 *    or MAPPER_DISTINCT_RAD, ICP also starts at the second one (without odometry: at zero motion),
 *    and the better result is kept.
 * 3. A match has low confidence when it is clearly worse than earlier ones, when it is a jump, or
 *    when there is none. Then scan_match searches a window about the prediction (mapper_search.c).
 *    Where its best hypothesis is the current match, that is kept. Otherwise ICP runs from the
 *    hypothesis of the best score, with a prior there.
 * 4. A jump in a weakly observable direction may come from a few points on a person who walks
 *    along. ICP then runs again with the odometry prior deciding in that direction. The result with
 *    the better score is kept; the score trades the share of inliers for the Mahalanobis distance
 *    from odometry.
 * 5. Without odometry, the translation along a weakly observable direction comes from the ranges of
 *    this scan and of the one before (mapper_ranges.c). */
#include "src/base/build.h"

#include "src/base/step.h"
#include "src/maps/mapper_work.h"

/* Acceptance ratio: the quality of a match from another motion must be greater by this factor, as a
 * match that lags behind the motion overlaps more. */
static const cairn_real MIN_QUALITY_RATIO = CAIRN_REAL(1.2);
/* A match below this share of the mean quality has low confidence. */
static const cairn_real LOW_QUALITY_RATIO = CAIRN_REAL(0.8);
/* Weight of the prior deviation in a match score, against the log of the quality. */
static const cairn_real PRIOR_WEIGHT = CAIRN_REAL(0.1);
/* m: maximum residual standard deviation of a valid match */
static const cairn_real MAX_RESIDUAL_M = CAIRN_REAL(0.1);
/* A direction with a smaller ratio of smallest to largest information is constrained by the
 * prior. */
static const cairn_real CONSTRAINED_INFORMATION_RATIO = CAIRN_REAL(0.15);
/* Bound of the squared Mahalanobis distance from odometry: wheel slip may be arbitrarily large. */
static const cairn_real MAX_SQUARED_DEVIATION = 10;

/* ---- ICP ---- */

/* Returns the prior of the second motion hypothesis. */
static cairn_rigid_motion_pose_prior alternative_prior(const cairn_mapper *mapper)
{
    return cairn_mapper_prior_of(mapper, mapper->current.alternative_motion,
                                 mapper->current.has_odometry && !mapper->current.uses_odometry);
}

/* Returns the motion prior about the pose that the search has found. */
static cairn_rigid_motion_pose_prior found_prior(const cairn_mapper *mapper)
{
    cairn_rigid_motion_pose_prior prior = cairn_mapper_prior_of(mapper, mapper->current.motion, 0);

    prior.mean = mapper->current.relocalization.pose;
    return prior;
}

/* Starts ICP at the mean of a prior; returns 0 when it is refused. */
static int begin_icp(cairn_mapper *mapper, cairn_rigid_motion_pose_prior prior)
{
    cairn_scan_view view = cairn_scan_read(mapper->scan);

    return cairn_icp_begin(mapper->icp, view.points, view.point_count, prior.mean, &prior, NULL) ==
           CAIRN_OK;
}

/* Continues ICP; returns 1 at its end. */
static int run_icp(cairn_mapper *mapper, cairn_budget *budget)
{
    int32_t before = budget->left;
    cairn_status status = cairn_icp_step(mapper->icp, budget);

    mapper->current.match_units_used += before - budget->left;
    return status != CAIRN_MORE;
}

/* ---- Its result ---- */

/* Returns the score of a match: the log of the quality, less a penalty for deviating from the
 * prior. */
static cairn_real match_score(const cairn_mapper *mapper, const cairn_icp_result *match)
{
    return cairn_log(cairn_mapper_quality(match) + CAIRN_REAL(1e-3)) -
           PRIOR_WEIGHT *
               cairn_mapper_prior_deviation(mapper, match->target_query, MAPPER_PRIOR_SCALE);
}

/* Returns 1 when a match has enough pairs and overlap and small residuals. */
static int32_t is_acceptable(const cairn_icp_result *match, cairn_real support)
{
    return match->verdict != CAIRN_ICP_TOO_FEW_PAIRS && match->overlap >= support &&
           match->sigma < MAX_RESIDUAL_M;
}

/* Makes the finished match the current one. */
static void set_match(cairn_mapper *mapper, const cairn_icp_result *match)
{
    mapper->current.match = *match;
    mapper->current.has_match = 1;
    cairn_icp_read_parts(mapper->icp, &mapper->current.parts);
}

/* Takes the finished match when it is acceptable and clearly better than the current one. Returns 1
 * when taken. */
static int32_t take_match(cairn_mapper *mapper)
{
    cairn_icp_result match = cairn_icp_read(mapper->icp);

    if (!is_acceptable(&match, mapper->params.min_overlap) ||
        (mapper->current.has_match &&
         !(cairn_mapper_quality(&match) >
           MIN_QUALITY_RATIO * cairn_mapper_quality(&mapper->current.match))))
        return 0;
    set_match(mapper, &match);
    return 1;
}

/* Returns 1 when the match is a jump: an outlier of the predicted motion. */
static int32_t is_jump(const cairn_mapper *mapper)
{
    return cairn_mapper_is_motion_outlier(mapper, mapper->current.match.target_query);
}

/* Returns 1 when a match from a search is acceptable: half of min_overlap is enough when it is no
 * jump. */
static int32_t is_acceptable_found(const cairn_mapper *mapper, const cairn_icp_result *match)
{
    return is_acceptable(match,
                         mapper->params.min_overlap /
                             (cairn_mapper_is_motion_outlier(mapper, match->target_query) ? 1 : 2));
}

/* Takes the match from the search's hypothesis when its score is higher. Otherwise the current
 * match stays, with low confidence when the two differ. */
static void take_found(cairn_mapper *mapper)
{
    cairn_icp_result match = cairn_icp_read(mapper->icp);

    if (!is_acceptable_found(mapper, &match)) {
        mapper->current.low_confidence = 1;
        return;
    }
    if (mapper->current.has_match &&
        match_score(mapper, &match) <= match_score(mapper, &mapper->current.match)) {
        mapper->current.low_confidence |=
            cairn_mapper_differ(match.target_query, mapper->current.match.target_query,
                                MAPPER_DISTINCT_M, MAPPER_DISTINCT_RAD) &&
            (!mapper->current.uses_odometry || is_jump(mapper));
        return;
    }
    set_match(mapper, &match);
}

/* Returns 1 when the two motion hypotheses lead to different poses. */
static int32_t motions_differ(const cairn_mapper *mapper)
{
    cairn_pose d = cairn_pose_between(mapper->current.motion, mapper->current.alternative_motion);

    return d.x * d.x + d.y * d.y > MAPPER_DISTINCT_M * MAPPER_DISTINCT_M ||
           cairn_abs(d.theta) > MAPPER_DISTINCT_RAD;
}

/* Returns 1 when there is no match, the scan before had none, or it is a jump or of low quality. */
static int32_t has_low_confidence(const cairn_mapper *mapper)
{
    return !mapper->current.has_match || mapper->unmatched > 0 || is_jump(mapper) ||
           cairn_mapper_quality(&mapper->current.match) <
               LOW_QUALITY_RATIO * mapper->previous.quality;
}

/* ---- Jumps in weakly observable directions ---- */

/* Returns 1 when a jump against healthy odometry rests on few points, as on a person who walks
 * along. */
static int32_t is_weak_jump(const cairn_mapper *mapper)
{
    return mapper->current.has_match && mapper->current.uses_odometry && is_jump(mapper) &&
           mapper->current.match.weak_ratio < CONSTRAINED_INFORMATION_RATIO;
}

/* Returns the squared Mahalanobis distance of a pose from the odometry prior, at most
 * MAX_SQUARED_DEVIATION. */
static cairn_real odometry_deviation(const cairn_mapper *mapper, cairn_pose pose)
{
    cairn_rigid_motion_pose_prior prior = cairn_mapper_prior_of(mapper, mapper->current.motion, 1);
    cairn_pose deviation = cairn_pose_between(prior.mean, pose);

    return cairn_min(
        (deviation.x * deviation.x + deviation.y * deviation.y) / (prior.sigma_x * prior.sigma_x) +
            deviation.theta * deviation.theta / (prior.sigma_theta * prior.sigma_theta),
        MAX_SQUARED_DEVIATION);
}

/* Takes the match constrained by odometry when it fits nearly as many points. */
static void take_constrained(cairn_mapper *mapper)
{
    cairn_icp_result match = cairn_icp_read(mapper->icp);
    cairn_real points = (cairn_real)cairn_scan_read(mapper->scan).point_count;

    if (!is_acceptable_found(mapper, &match) ||
        points * (cairn_mapper_quality(&mapper->current.match) - cairn_mapper_quality(&match)) >
            odometry_deviation(mapper, mapper->current.match.target_query) -
                odometry_deviation(mapper, match.target_query))
        return;
    set_match(mapper, &match);
    mapper->current.is_constrained = 1;
}

/* Sets the information ratio below which ICP leaves a direction to the prior. */
static void set_weak_ratio(cairn_mapper *mapper, cairn_real ratio)
{
    cairn_status status = cairn_icp_set_weak_ratio(mapper->icp, ratio);

    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
}

/* Returns 1 when only the prediction determines the match along a weakly observable direction, and
 * the pose of the scan before is no prediction. */
static int32_t is_weak_without_odometry(const cairn_mapper *mapper)
{
    return mapper->current.has_match && !mapper->current.uses_odometry &&
           (mapper->result.verdict == CAIRN_MAPPER_MATCHED ||
            mapper->result.verdict == CAIRN_MAPPER_FIRST) &&
           mapper->current.match.weak_ratio < MAPPER_MIN_INFORMATION_RATIO;
}

/* ---- The match ---- */

int cairn_mapper_match(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper_current *current = &mapper->current;
    mapper_relocalization *found = &current->relocalization;

    CAIRN_STEP_BEGIN(current->resume);
    if (begin_icp(mapper, cairn_mapper_prior(mapper))) {
        CAIRN_STEP_UNTIL(current->resume, run_icp(mapper, budget));
        (void)take_match(mapper);
    }
    if (motions_differ(mapper) && begin_icp(mapper, alternative_prior(mapper))) {
        CAIRN_STEP_UNTIL(current->resume, run_icp(mapper, budget));
        mapper->state.odometry_rejected += take_match(mapper) && current->uses_odometry;
    }
    if (mapper->params.search && has_low_confidence(mapper)) {
        CAIRN_STEP_UNTIL(current->resume, cairn_mapper_relocalize(mapper, budget));
        if (found->is_found && begin_icp(mapper, found_prior(mapper))) {
            CAIRN_STEP_UNTIL(current->resume, run_icp(mapper, budget));
            take_found(mapper);
        }
        if ((found->is_found || found->is_confirmed) && is_weak_jump(mapper)) {
            set_weak_ratio(mapper, CONSTRAINED_INFORMATION_RATIO);
            if (begin_icp(mapper, cairn_mapper_prior_of(mapper, current->motion, 1))) {
                CAIRN_STEP_UNTIL(current->resume, run_icp(mapper, budget));
                take_constrained(mapper);
            }
            set_weak_ratio(mapper, mapper->params.icp.weak_ratio);
        }
    }
    if (is_weak_without_odometry(mapper))
        CAIRN_STEP_UNTIL(current->resume, cairn_mapper_compare_ranges(mapper, budget));
    CAIRN_STEP_END(current->resume);
}
