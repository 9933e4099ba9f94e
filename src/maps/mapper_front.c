/* Front end of the mapper: motion prediction, scan matching, odometry health.
 *
 * Method.
 *
 * 1. The pose is predicted from the odometry since the last scan, or by a constant-velocity model
 *    when there is no odometry or it is unhealthy. ICP starts there.
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
 * 5. A match that keeps low confidence gets an inflated covariance.
 * 6. A match that contradicts good odometry may be rejected (mapper_odometry.c).
 * 7. Odometry health is a smoothed rate of agreement with the matches. Unhealthy odometry is not
 *    used until it agrees again. After each disagreement its noise is scaled up for a while, since
 *    the cause, such as a push, may last. */
#include "src/base/build.h"

#include <string.h>

#include "src/base/step.h"
#include "src/maps/mapper_work.h"

/* Acceptance ratio: the quality of a match from another motion must be greater by this factor, as a
 * match that lags behind the motion overlaps more. */
static const cairn_real MIN_QUALITY_RATIO = CAIRN_REAL(1.2);
/* Jump threshold: a match farther from the prediction is a jump; m, rad, ... */
static const cairn_real JUMP_M = CAIRN_REAL(0.1);
static const cairn_real JUMP_RAD = CAIRN_REAL(0.08);
/* ... plus this share of the motion. */
static const cairn_real JUMP_SHARE = CAIRN_REAL(0.2);
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
/* Standard deviations; fewer after a disagreement. A larger pure translation error is treated as a
 * bias of the next motion. */
static const cairn_real BIAS_MIN_SIGMAS = CAIRN_REAL(1.5);
/* maximum factor of the odometry noise */
static const cairn_real MAX_NOISE_SCALE = 4;
/* decay of the noise scale, and of the bias, per scan */
static const cairn_real NOISE_SCALE_DECAY = CAIRN_REAL(0.8);
/* decay of the velocity estimate per scan that does not observe it */
static const cairn_real VELOCITY_DECAY = CAIRN_REAL(0.99);
/* gain of exponential smoothing per scan: mean quality, odometry health, velocity */
static const cairn_real SMOOTHING_GAIN = CAIRN_REAL(0.1);
/* odometry of greater health predicts the motion */
static const cairn_real MIN_ODOMETRY_HEALTH = CAIRN_REAL(0.5);

/* gain of exponential smoothing of the motion, per scan */
static const cairn_real MOTION_SMOOTHING_GAIN = CAIRN_REAL(0.5);
/* ns: a longer interval between scans invalidates the motion for deskewing */
static const int64_t MAX_SCAN_INTERVAL_NS = 1000000000;

/* ---- Prediction ---- */

static int32_t has_motion(const cairn_scan_input *input)
{
    return input->motion.x != 0 || input->motion.y != 0 || input->motion.theta != 0;
}

/* Returns the motion during the sweep, for deskewing. A scanner that turns once in 0.1 s makes
 * every rotation of a robot at 45 degrees/s wrong by 1.25 %, always to the same side, and bends a
 * path with many turns. Where the input has no motion but a sweep duration, the motion since the
 * previous scan is scaled to it at constant twist. It is the motion of healthy odometry, otherwise
 * that of the matches, smoothed because their noise would distort the next scan. */
cairn_pose cairn_mapper_sweep_motion(const cairn_mapper *mapper, const cairn_scan_input *input,
                                     const cairn_pose *by_odometry)
{
    int32_t uses_odometry = by_odometry != NULL && mapper->odometry.health > MIN_ODOMETRY_HEALTH;
    int64_t span = uses_odometry ? cairn_time_difference(input->stamp_ns, mapper->previous.stamp)
                                 : mapper->previous.span;
    cairn_real sweep =
        (cairn_real)input->time_step * (cairn_real)(input->count - 1) * CAIRN_REAL(1e9);

    if (!(sweep > 0) || has_motion(input) || mapper->state.scans < 2 ||
        !(span > 0 && span < MAX_SCAN_INTERVAL_NS))
        return input->motion;
    return cairn_twist_exp(
        cairn_twist_log(uses_odometry ? *by_odometry : mapper->previous.smoothed_motion),
        cairn_min(1, sweep / (cairn_real)span));
}

void cairn_mapper_predict(cairn_mapper *mapper)
{
    mapper_current *current = &mapper->current;

    current->uses_odometry =
        current->has_odometry &&
        (mapper->odometry.health > MIN_ODOMETRY_HEALTH || cairn_mapper_is_rejecting(mapper));
    current->motion = current->uses_odometry ? current->by_odometry : mapper->previous.motion;
    current->alternative_motion = cairn_pose_identity();
    if (current->uses_odometry)
        current->alternative_motion = mapper->previous.motion;
    else if (current->has_odometry)
        current->alternative_motion = current->by_odometry;
    if (current->uses_odometry) {
        current->motion.x += mapper->odometry.bias.x;
        current->motion.y += mapper->odometry.bias.y;
    }
    current->predicted = cairn_pose_compose(mapper->previous.pose, current->motion);
    current->has_match = 0;
    current->low_confidence = current->is_constrained = 0;
    current->search_units_used = current->match_units_used = 0;
}

cairn_rigid_motion_pose_prior cairn_mapper_prior_of(const cairn_mapper *mapper, cairn_pose motion,
                                                    int32_t is_odometry)
{
    const cairn_mapper_params *p = &mapper->params;
    cairn_real translation = cairn_mapper_translation(motion);
    cairn_rigid_motion_pose_prior prior;

    prior.mean = cairn_pose_compose(mapper->previous.pose, motion);
    if (is_odometry) {
        prior.sigma_x = mapper->odometry.noise_scale *
                        (p->odometry_distance_min + p->odometry_distance * translation);
        prior.sigma_theta = mapper->odometry.noise_scale *
                            (p->odometry_turn_min +
                             p->odometry_turn * (cairn_abs(motion.theta) + translation / 10));
    } else {
        prior.sigma_x = p->motion_distance_min + p->motion_distance * translation;
        prior.sigma_theta = p->motion_turn_min + p->motion_turn * cairn_abs(motion.theta);
    }
    prior.sigma_y = prior.sigma_x;
    return prior;
}

cairn_rigid_motion_pose_prior cairn_mapper_prior(const cairn_mapper *mapper)
{
    return cairn_mapper_prior_of(mapper, mapper->current.motion, mapper->current.uses_odometry);
}

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

/* ---- ICP ---- */

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

/* ---- Matches ---- */

/* Returns the quality of a match: overlap times exp(-sigma / 5 cm), sigma being the residual
 * standard deviation. */
static cairn_real quality(const cairn_icp_result *match)
{
    return match->overlap * cairn_exp(-match->sigma / CAIRN_REAL(0.05));
}

/* Returns the squared distance of a pose from the prediction or from standing still, whichever is
 * less, in units of m and rad; at most 4. */
cairn_real cairn_mapper_prior_deviation(const cairn_mapper *mapper, cairn_pose pose,
                                        cairn_real unit)
{
    cairn_pose a = cairn_pose_between(mapper->current.predicted, pose),
               b = cairn_pose_between(mapper->previous.pose, pose);
    cairn_real translation = cairn_min(a.x * a.x + a.y * a.y, b.x * b.x + b.y * b.y);
    cairn_real turn = cairn_min(a.theta * a.theta, b.theta * b.theta);

    return cairn_min((translation + turn) / (unit * unit), 4);
}

static cairn_real prior_penalty(const cairn_mapper *mapper, cairn_pose pose)
{
    return cairn_mapper_prior_deviation(mapper, pose, MAPPER_PRIOR_SCALE);
}

/* Returns the score of a pose: the log of the quality, less a penalty for deviating from the
 * prior. */
static cairn_real match_score(const cairn_mapper *mapper, cairn_real q, cairn_pose pose)
{
    return cairn_log(q + CAIRN_REAL(1e-3)) - PRIOR_WEIGHT * prior_penalty(mapper, pose);
}

/* Returns 1 when a match has enough pairs and overlap and small residuals. */
static int32_t is_acceptable(const cairn_icp_result *match, cairn_real support)
{
    return match->verdict != CAIRN_ICP_TOO_FEW_PAIRS && match->overlap >= support &&
           match->sigma < MAX_RESIDUAL_M;
}

/* Takes the finished match when it is acceptable and clearly better than the current one. Returns 1
 * when taken. */
static int32_t take_match(cairn_mapper *mapper)
{
    cairn_icp_result match = cairn_icp_read(mapper->icp);

    if (!is_acceptable(&match, mapper->params.min_overlap) ||
        (mapper->current.has_match &&
         !(quality(&match) > MIN_QUALITY_RATIO * quality(&mapper->current.match))))
        return 0;
    mapper->current.match = match;
    mapper->current.has_match = 1;
    cairn_icp_read_parts(mapper->icp, &mapper->current.parts);
    return 1;
}

int32_t cairn_mapper_is_motion_outlier(const cairn_mapper *mapper, cairn_pose pose)
{
    cairn_pose d = cairn_pose_between(mapper->current.predicted, pose);

    return cairn_mapper_translation(d) >
               JUMP_M + JUMP_SHARE * cairn_mapper_translation(mapper->current.motion) ||
           cairn_abs(d.theta) > JUMP_RAD + JUMP_SHARE * cairn_abs(mapper->current.motion.theta);
}

/* Returns 1 when the match is a jump: an outlier of the predicted motion. */
static int32_t is_jump(const cairn_mapper *mapper)
{
    return cairn_mapper_is_motion_outlier(mapper, mapper->current.match.target_query);
}

/* Returns the minimum overlap of a match from a search: half of min_overlap when it is no jump. */
static cairn_real found_min_overlap(const cairn_mapper *mapper, const cairn_icp_result *match)
{
    return mapper->params.min_overlap /
           (cairn_mapper_is_motion_outlier(mapper, match->target_query) ? 1 : 2);
}

/* Takes the match from the search's hypothesis when its score is higher. Otherwise the current
 * match stays, with low confidence when the two differ. */
static void take_found(cairn_mapper *mapper)
{
    cairn_icp_result match = cairn_icp_read(mapper->icp);
    cairn_pose difference;

    if (!is_acceptable(&match, found_min_overlap(mapper, &match))) {
        mapper->current.low_confidence = 1;
        return;
    }
    difference = cairn_pose_between(match.target_query, mapper->current.match.target_query);
    if (mapper->current.has_match && match_score(mapper, quality(&match), match.target_query) <=
                                         match_score(mapper, quality(&mapper->current.match),
                                                     mapper->current.match.target_query)) {
        mapper->current.low_confidence |=
            (cairn_mapper_translation(difference) > MAPPER_DISTINCT_M ||
             cairn_abs(difference.theta) > MAPPER_DISTINCT_RAD) &&
            (!mapper->current.uses_odometry || is_jump(mapper));
        return;
    }
    mapper->current.match = match;
    mapper->current.has_match = 1;
    cairn_icp_read_parts(mapper->icp, &mapper->current.parts);
}

/* Returns 1 when the two motion hypotheses lead to different poses. */
static int32_t motions_differ(const cairn_mapper *mapper)
{
    cairn_pose d = cairn_pose_between(mapper->current.motion, mapper->current.alternative_motion);

    return d.x * d.x + d.y * d.y > MAPPER_DISTINCT_M * MAPPER_DISTINCT_M ||
           cairn_abs(d.theta) > MAPPER_DISTINCT_RAD;
}

/* Returns 1 when there is no match, or it is a jump or of low quality. */
static int32_t has_low_confidence(const cairn_mapper *mapper)
{
    return !mapper->current.has_match || is_jump(mapper) ||
           quality(&mapper->current.match) < LOW_QUALITY_RATIO * mapper->previous.quality;
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

    if (!is_acceptable(&match, found_min_overlap(mapper, &match)) ||
        points * (quality(&mapper->current.match) - quality(&match)) >
            odometry_deviation(mapper, mapper->current.match.target_query) -
                odometry_deviation(mapper, match.target_query))
        return;
    mapper->current.match = match;
    mapper->current.is_constrained = 1;
    cairn_icp_read_parts(mapper->icp, &mapper->current.parts);
}

/* Sets the information ratio below which ICP leaves a direction to the prior. */
static void set_weak_ratio(cairn_mapper *mapper, cairn_real ratio)
{
    cairn_status status = cairn_icp_set_weak_ratio(mapper->icp, ratio);

    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
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
    CAIRN_STEP_END(current->resume);
}

/* ---- Odometry health, noise scale and bias; covariance inflation ---- */

/* Updates odometry health, noise scale and bias from the residual between odometry and match. */
static void update_odometry_health(cairn_mapper *mapper)
{
    cairn_rigid_motion_pose_prior prior =
        cairn_mapper_prior_of(mapper, mapper->current.by_odometry, 1);
    cairn_pose e = cairn_pose_between(prior.mean, mapper->current.match.target_query);
    cairn_real deviation =
        mapper->odometry.noise_scale * cairn_max(cairn_mapper_translation(e) / prior.sigma_x,
                                                 cairn_abs(e.theta) / prior.sigma_theta);
    cairn_vec2 translation = {e.x, e.y};
    int32_t contradicted = deviation > 2;

    if (mapper->current.match.weak_ratio >= MAPPER_MIN_INFORMATION_RATIO &&
        !mapper->current.is_constrained) {
        mapper->odometry.noise_scale =
            cairn_max(1, cairn_max(mapper->odometry.noise_scale * NOISE_SCALE_DECAY,
                                   cairn_min(deviation, MAX_NOISE_SCALE)));
        mapper->odometry.bias.x = mapper->odometry.bias.y = 0;
        if (mapper->odometry.noise_scale * cairn_mapper_translation(e) >
                BIAS_MIN_SIGMAS * prior.sigma_x &&
            cairn_abs(e.theta) < JUMP_RAD && cairn_mapper_translation(e) > JUMP_M)
            mapper->odometry.bias = translation;
    } else {
        mapper->odometry.bias = cairn_vec2_scale(mapper->odometry.bias, NOISE_SCALE_DECAY);
    }
    mapper->odometry.health +=
        SMOOTHING_GAIN * ((cairn_real)!contradicted - mapper->odometry.health);
    mapper->state.odometry_contradicted += contradicted;
}

/* Inflates the covariance along the weakly observable direction, where an error of the match goes
 * unnoticed unless odometry constrains it. */
static void inflate_weak_direction(cairn_mapper *mapper)
{
    cairn_real x = MAPPER_LOW_CONFIDENCE_M * mapper->current.match.weak_direction[0],
               y = MAPPER_LOW_CONFIDENCE_M * mapper->current.match.weak_direction[1];

    mapper->current.extra_covariance[0] += x * x;
    mapper->current.extra_covariance[1] += x * y;
    mapper->current.extra_covariance[3] += x * y;
    mapper->current.extra_covariance[4] += y * y;
}

/* Accumulates the variance of the predicted motion since the last keyframe. */
static void accumulate_motion_variance(cairn_mapper *mapper)
{
    cairn_rigid_motion_pose_prior prior = cairn_mapper_prior(mapper);

    if (mapper->scans_since_keyframe == 0)
        mapper->motion_variance = mapper->motion_heading_variance = 0;
    mapper->motion_variance += prior.sigma_x * prior.sigma_x;
    mapper->motion_heading_variance += prior.sigma_theta * prior.sigma_theta;
}

void cairn_mapper_update_motion_model(cairn_mapper *mapper)
{
    cairn_mapper_check_match(mapper);
    accumulate_motion_variance(mapper);
    memset(mapper->current.extra_covariance, 0, sizeof mapper->current.extra_covariance);
    if (mapper->current.has_match && mapper->current.low_confidence) {
        mapper->current.extra_covariance[0] = mapper->current.extra_covariance[4] =
            MAPPER_LOW_CONFIDENCE_M * MAPPER_LOW_CONFIDENCE_M;
        mapper->current.extra_covariance[8] = MAPPER_LOW_CONFIDENCE_RAD * MAPPER_LOW_CONFIDENCE_RAD;
    }
    if (mapper->current.has_match &&
        (mapper->current.is_constrained ||
         (!mapper->current.uses_odometry &&
          mapper->current.match.weak_ratio < MAPPER_MIN_INFORMATION_RATIO)))
        inflate_weak_direction(mapper);
    for (int k = 0; k < 9 && mapper->current.has_match; k++)
        mapper->current.match.covariance[k] += mapper->current.extra_covariance[k];
    mapper->state.low_confidence += mapper->current.low_confidence;
    mapper->state.unobservable += !mapper->current.has_match ||
                                  mapper->current.match.weak_ratio < MAPPER_MIN_INFORMATION_RATIO;
    if (!mapper->current.has_match)
        return;
    if (mapper->previous.quality > 0)
        mapper->previous.quality +=
            SMOOTHING_GAIN * (quality(&mapper->current.match) - mapper->previous.quality);
    else
        mapper->previous.quality = quality(&mapper->current.match);
    if (mapper->current.has_odometry && !mapper->current.low_confidence)
        update_odometry_health(mapper);
}

/* Returns the motion that the velocity model predicts for the next scan. A jump counts half, since
 * wheel slip may have caused it. Along a weakly observable direction the decaying velocity estimate
 * is used: a match there mostly repeats its prediction. */
cairn_pose cairn_mapper_next_motion(cairn_mapper *mapper, cairn_pose motion)
{
    cairn_pose before = mapper->previous.motion;
    cairn_vec2 weak, correction;

    mapper->previous.smoothed_motion.x +=
        MOTION_SMOOTHING_GAIN * (motion.x - mapper->previous.smoothed_motion.x);
    mapper->previous.smoothed_motion.y +=
        MOTION_SMOOTHING_GAIN * (motion.y - mapper->previous.smoothed_motion.y);
    mapper->previous.smoothed_motion.theta +=
        MOTION_SMOOTHING_GAIN *
        cairn_wrap_angle(motion.theta - mapper->previous.smoothed_motion.theta);

    if (!mapper->current.has_match)
        return motion;
    if (is_jump(mapper)) {
        motion.x = (motion.x + before.x) / 2;
        motion.y = (motion.y + before.y) / 2;
        motion.theta =
            cairn_wrap_angle(before.theta + cairn_wrap_angle(motion.theta - before.theta) / 2);
    }
    if (mapper->current.match.weak_ratio >= MAPPER_MIN_INFORMATION_RATIO) {
        mapper->previous.velocity.x += SMOOTHING_GAIN * (motion.x - mapper->previous.velocity.x);
        mapper->previous.velocity.y += SMOOTHING_GAIN * (motion.y - mapper->previous.velocity.y);
        return motion;
    }
    weak.x = mapper->current.match.weak_direction[0];
    weak.y = mapper->current.match.weak_direction[1];
    weak = cairn_transform_direction(
        cairn_transform_of(cairn_pose_inverse(mapper->current.match.target_query)), weak);
    correction.x = mapper->previous.velocity.x - motion.x;
    correction.y = mapper->previous.velocity.y - motion.y;
    motion.x += weak.x * cairn_vec2_dot(weak, correction);
    motion.y += weak.y * cairn_vec2_dot(weak, correction);
    mapper->previous.velocity = cairn_vec2_scale(mapper->previous.velocity, VELOCITY_DECAY);
    return motion;
}
