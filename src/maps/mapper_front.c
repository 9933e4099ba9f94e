/* Front end of the mapper: motion prediction, odometry health.
 *
 * Method.
 *
 * 1. The pose is predicted from the odometry since the last scan, or by a constant-velocity model
 *    when there is no odometry or it is unhealthy. The scan is matched from there
 *    (mapper_match.c).
 * 2. A match that keeps low confidence gets an inflated covariance.
 * 3. A match that contradicts good odometry may be rejected (mapper_odometry.c).
 * 4. Odometry health is a smoothed rate of agreement with the matches. Unhealthy odometry is not
 *    used until it agrees again. After each disagreement its noise is scaled up for a while, since
 *    the cause, such as a push, may last. */
#include "src/base/build.h"

#include <string.h>

#include "src/maps/mapper_work.h"

/* Jump threshold: a match farther from the prediction is a jump; m, rad, ... */
static const cairn_real JUMP_M = CAIRN_REAL(0.1);
static const cairn_real JUMP_RAD = CAIRN_REAL(0.08);
/* ... plus this share of the motion. */
static const cairn_real JUMP_SHARE = CAIRN_REAL(0.2);
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
/* decay of the predicted turn per scan without a match: turns are short */
static const cairn_real TURN_DECAY = CAIRN_REAL(0.5);
/* Scans in a row without a match, and m by odometry meanwhile, until the search for the pose is
 * given up. */
enum { MIN_UNMATCHED_SCANS = 2, MAX_UNMATCHED_SCANS = 8 };
static const cairn_real MAX_UNMATCHED_M = 2;
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
    current->low_confidence = current->is_constrained = current->is_averaged = 0;
    current->weak_sigma = MAPPER_LOW_CONFIDENCE_M;
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

/* ---- Quality and deviation of a match ---- */

cairn_real cairn_mapper_quality(const cairn_icp_result *match)
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

int32_t cairn_mapper_differ(cairn_pose a, cairn_pose b, cairn_real distance, cairn_real angle)
{
    cairn_pose difference = cairn_pose_between(a, b);

    return cairn_mapper_translation(difference) > distance || cairn_abs(difference.theta) > angle;
}

int32_t cairn_mapper_is_motion_outlier(const cairn_mapper *mapper, cairn_pose pose)
{
    return cairn_mapper_differ(mapper->current.predicted, pose,
                               JUMP_M +
                                   JUMP_SHARE * cairn_mapper_translation(mapper->current.motion),
                               JUMP_RAD + JUMP_SHARE * cairn_abs(mapper->current.motion.theta));
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
 * unnoticed unless odometry or the ranges constrain it. */
static void inflate_weak_direction(cairn_mapper *mapper)
{
    cairn_real sigma = mapper->current.weak_sigma,
               x = sigma * mapper->current.match.weak_direction[0],
               y = sigma * mapper->current.match.weak_direction[1];

    mapper->current.extra_covariance[0] += x * x;
    mapper->current.extra_covariance[1] += x * y;
    mapper->current.extra_covariance[3] += x * y;
    mapper->current.extra_covariance[4] += y * y;
}

/* Counts the scans in a row without a match, with odometry. After MAX_UNMATCHED_SCANS, or
 * MAX_UNMATCHED_M and MIN_UNMATCHED_SCANS, the search is given up: the robot may be where the map has
 * nothing. Where matches scatter, few scans match well. */
static void count_unmatched(cairn_mapper *mapper)
{
    int32_t can_match = mapper->current.has_odometry && mapper->keyframes->point_count > 0;
    int32_t most = cairn_mapper_matches_scatter(mapper) ? MIN_UNMATCHED_SCANS : MAX_UNMATCHED_SCANS;

    mapper->unmatched++;
    mapper->unmatched_m += cairn_abs(mapper->current.by_odometry.x);
    if (mapper->current.has_match || !can_match || mapper->unmatched > most ||
        (mapper->unmatched > MIN_UNMATCHED_SCANS && mapper->unmatched_m > MAX_UNMATCHED_M)) {
        mapper->unmatched = 0;
        mapper->unmatched_m = 0;
    }
}

/* Accumulates the variance of the predicted motion since the last keyframe. */
static void accumulate_motion_variance(cairn_mapper *mapper)
{
    cairn_rigid_motion_pose_prior prior = cairn_mapper_prior(mapper);

    if (mapper->scans_since_keyframe == 0)
        mapper->motion_variance = mapper->motion_heading_variance = 0;
    mapper->motion_variance += prior.sigma_x * prior.sigma_x;
    mapper->motion_heading_variance += prior.sigma_theta * prior.sigma_theta;
    if (mapper->unmatched > 0) {
        mapper->motion_variance += MAPPER_UNMATCHED_M * MAPPER_UNMATCHED_M;
        mapper->motion_heading_variance += MAPPER_UNMATCHED_RAD * MAPPER_UNMATCHED_RAD;
    }
}

void cairn_mapper_update_motion_model(cairn_mapper *mapper)
{
    cairn_mapper_weigh_match(mapper);
    count_unmatched(mapper);
    cairn_mapper_check_match(mapper);
    accumulate_motion_variance(mapper);
    memset(mapper->current.extra_covariance, 0, sizeof mapper->current.extra_covariance);
    if (mapper->current.has_match && mapper->current.low_confidence) {
        mapper->current.extra_covariance[0] = mapper->current.extra_covariance[4] =
            MAPPER_LOW_CONFIDENCE_M * MAPPER_LOW_CONFIDENCE_M;
        mapper->current.extra_covariance[8] = MAPPER_LOW_CONFIDENCE_RAD * MAPPER_LOW_CONFIDENCE_RAD;
    }
    if (mapper->current.has_match && mapper->current.is_averaged) {
        mapper->current.extra_covariance[0] += mapper->odometry.variance_m;
        mapper->current.extra_covariance[4] += mapper->odometry.variance_m;
        mapper->current.extra_covariance[8] += mapper->odometry.variance_rad;
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
    if (!mapper->current.has_match) {
        mapper->odometry.bias.x = mapper->odometry.bias.y = 0;
        return;
    }
    if (mapper->previous.quality > 0)
        mapper->previous.quality += SMOOTHING_GAIN * (cairn_mapper_quality(&mapper->current.match) -
                                                      mapper->previous.quality);
    else
        mapper->previous.quality = cairn_mapper_quality(&mapper->current.match);
    if (mapper->current.has_odometry && !mapper->current.low_confidence)
        update_odometry_health(mapper);
}

/* Returns the motion that the velocity model predicts for the next scan. Without a match and without
 * odometry the turn decays. A jump counts half, since wheel slip may have caused it. Along a weakly
 * observable direction the decaying velocity estimate is used, unless the ranges observe the
 * translation: a match there mostly repeats its prediction. */
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

    if (!mapper->current.has_match) {
        if (!mapper->current.uses_odometry)
            motion.theta *= TURN_DECAY;
        return motion;
    }
    if (cairn_mapper_is_motion_outlier(mapper, mapper->current.match.target_query)) {
        motion.x = (motion.x + before.x) / 2;
        motion.y = (motion.y + before.y) / 2;
        motion.theta =
            cairn_wrap_angle(before.theta + cairn_wrap_angle(motion.theta - before.theta) / 2);
    }
    if (mapper->current.match.weak_ratio >= MAPPER_MIN_INFORMATION_RATIO ||
        mapper->current.weak_sigma < MAPPER_LOW_CONFIDENCE_M) {
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
