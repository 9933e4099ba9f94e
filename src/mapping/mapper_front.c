/* Where is the scan, seen from the key scans of the last while?
 *
 * Method. The pose is predicted from the odometry since the last scan, or by repeating the last
 * motion when there is none or when it is not believed. The match (icp) starts there. Where another
 * motion (the other one of the two; standing still, without odometry) leads elsewhere, it is run
 * from there, too, and the better result stands.
 *
 * A match is in doubt when it is clearly worse than those before it, when it would be a sudden
 * motion, or when there is none. Then scan_match searches the window about the prediction. Where
 * its best hypothesis is the match at hand, that stands; else the match is run from the hypothesis
 * that fits best, of equal ones that with the least sudden motion, and held to it where the scan
 * tells nothing. What stays in doubt gets a covariance that says so.
 *
 * A sudden motion may be a collision, or people who push; or a few points may be on somebody who
 * walks along. So where few points tell of it, the match is run once more with odometry deciding
 * there, and the two compete: points that fit against standard deviations of odometry.
 *
 * Odometry that the matches contradict again and again is not believed any more until they agree
 * with it again. After each contradiction it is believed less exactly for a while: who pushes
 * goes on. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/mapper_work.h"

/* Than the match from the prediction one from another motion must be: who lags behind overlaps
 * more. */
static const cairn_real MIN_QUALITY_RATIO = CAIRN_REAL(1.2);
/* m beyond the prediction, ... */
static const cairn_real JUMP_M = CAIRN_REAL(0.1);
static const cairn_real JUMP_RAD = CAIRN_REAL(0.08);
/* ... and this share of the motion */
static const cairn_real JUMP_SHARE = CAIRN_REAL(0.2);
/* than the mean quality */
static const cairn_real LOW_QUALITY_RATIO = CAIRN_REAL(0.8);
/* ... of the log of the quality */
static const cairn_real PRIOR_WEIGHT = CAIRN_REAL(0.1);
/* m, deviation of the points of what is no match */
static const cairn_real MAX_RESIDUAL_M = CAIRN_REAL(0.1);
/* share of information along a direction of which few points tell */
static const cairn_real CONSTRAINED_INFORMATION_RATIO = CAIRN_REAL(0.15);
/* squared standard deviations from odometry: wheels may slip by any */
static const cairn_real MAX_SQUARED_DEVIATION = 10;
/* Standard deviations, fewer after it was wrong: what odometry is off by beyond, and not by
 * turning, it is off by again. */
static const cairn_real BIAS_MIN_SIGMAS = CAIRN_REAL(1.5);
/* times what odometry may be wrong by, ... */
static const cairn_real MAX_NOISE_SCALE = 4;
/* ... and how that ends, by each scan that agrees */
static const cairn_real NOISE_SCALE_DECAY = CAIRN_REAL(0.8);
/* pace, by each scan that does not tell it */
static const cairn_real VELOCITY_DECAY = CAIRN_REAL(0.99);
/* by each scan, of mean quality and trust */
static const cairn_real SMOOTHING_GAIN = CAIRN_REAL(0.1);
/* odometry whose trust is above is believed */
static const cairn_real MIN_ODOMETRY_HEALTH = CAIRN_REAL(0.5);

/* by each scan */
static const cairn_real MOTION_SMOOTHING_GAIN = CAIRN_REAL(0.5);
/* ns: after a longer one nobody knows how the robot moves */
static const int64_t MAX_SCAN_INTERVAL_NS = 1000000000;

/* ---- Prediction ---- */

static int32_t has_motion(const cairn_scan_input *input)
{
    return input->motion.x != 0 || input->motion.y != 0 || input->motion.theta != 0;
}

/* Who moves while he scans sees the world wound up: a scanner that turns once in a tenth of a
 * second makes every turn of a robot at 45 degrees/s wrong by 1.25 %, always to the same side,
 * and a path that turns much bends. So where nobody tells the motion but how long the sweep
 * takes, the motion since the scan before goes on: that of odometry when it is believed, else
 * that of the matches, smoothed, or their noise would wind up the next scan. */
cairn_pose cairn_mapper_sweep_motion(const cairn_mapper *mapper, const cairn_scan_input *input,
                                     const cairn_pose *by_odometry)
{
    int32_t uses_odometry = by_odometry != NULL && mapper->odometry_health > MIN_ODOMETRY_HEALTH;
    int64_t span = uses_odometry ? input->stamp_ns - mapper->last_stamp : mapper->last_span;
    cairn_real sweep =
        (cairn_real)input->time_step * (cairn_real)(input->count - 1) * CAIRN_REAL(1e9);

    if (!(sweep > 0) || has_motion(input) || mapper->state.scans < 2 ||
        !(span > 0 && span < MAX_SCAN_INTERVAL_NS))
        return input->motion;
    return cairn_twist_at(cairn_twist_of(uses_odometry ? *by_odometry : mapper->smoothed_motion),
                          cairn_min(1, sweep / (cairn_real)span));
}

void cairn_mapper_predict(cairn_mapper *mapper, cairn_pose last, cairn_pose by_odometry)
{
    mapper->last = last;
    mapper->trusts_odometry = mapper->has_odometry && mapper->odometry_health > MIN_ODOMETRY_HEALTH;
    mapper->motion = mapper->trusts_odometry ? by_odometry : mapper->last_motion;
    mapper->alternative_motion = cairn_pose_identity();
    if (mapper->trusts_odometry)
        mapper->alternative_motion = mapper->last_motion;
    else if (mapper->has_odometry)
        mapper->alternative_motion = by_odometry;
    mapper->by_odometry = by_odometry;
    if (mapper->trusts_odometry) {
        mapper->motion.x += mapper->odometry_bias.x;
        mapper->motion.y += mapper->odometry_bias.y;
    }
    mapper->predicted = cairn_pose_compose(last, mapper->motion);
    mapper->has_match = 0;
    mapper->low_confidence = mapper->is_constrained = 0;
    mapper->search_units_used = mapper->match_units_used = mapper->searches = 0;
}

cairn_pose_prior cairn_mapper_prior_of(const cairn_mapper *mapper, cairn_pose motion,
                                       int32_t is_odometry)
{
    const cairn_mapper_params *p = &mapper->params;
    cairn_real translation = cairn_mapper_way(motion);
    cairn_pose_prior prior;

    prior.mean = cairn_pose_compose(mapper->last, motion);
    if (is_odometry) {
        prior.sigma_x = mapper->odometry_noise_scale *
                        (p->odometry_distance_min + p->odometry_distance * translation);
        prior.sigma_theta = mapper->odometry_noise_scale *
                            (p->odometry_turn_min +
                             p->odometry_turn * (cairn_abs(motion.theta) + translation / 10));
    } else {
        prior.sigma_x = p->motion_distance_min + p->motion_distance * translation;
        prior.sigma_theta = p->motion_turn_min + p->motion_turn * cairn_abs(motion.theta);
    }
    prior.sigma_y = prior.sigma_x;
    return prior;
}

cairn_pose_prior cairn_mapper_prior(const cairn_mapper *mapper)
{
    return cairn_mapper_prior_of(mapper, mapper->motion, mapper->trusts_odometry);
}

cairn_status cairn_mapper_begin_match(cairn_mapper *mapper)
{
    cairn_scan_view view = cairn_scan_read(mapper->scan);
    cairn_pose_prior prior = cairn_mapper_prior_of(mapper, mapper->motion, mapper->trusts_odometry);

    mapper->phase = MAPPER_MATCH;
    return cairn_icp_begin(mapper->icp, view.points, view.point_count, mapper->predicted, &prior,
                           NULL);
}

static cairn_status begin_alternative(cairn_mapper *mapper)
{
    cairn_scan_view view = cairn_scan_read(mapper->scan);
    cairn_pose_prior prior = cairn_mapper_prior_of(
        mapper, mapper->alternative_motion, mapper->has_odometry && !mapper->trusts_odometry);

    mapper->phase = MAPPER_MATCH_ALTERNATIVE;
    return cairn_icp_begin(mapper->icp, view.points, view.point_count, prior.mean, &prior, NULL);
}

/* ---- Matches ---- */

/* A match is as good as its overlap, less for every 5 cm by which its points deviate from their
 * lines. */
static cairn_real quality(const cairn_icp_result *match)
{
    return match->overlap * cairn_exp(-match->sigma / CAIRN_REAL(0.05));
}

/* How much a motion to a pose is out of the way of both the prediction and standing still, in so
 * many m or rad, squared, up to 4. */
cairn_real cairn_mapper_out_of_the_way(const cairn_mapper *mapper, cairn_pose pose, cairn_real unit)
{
    cairn_pose a = cairn_pose_between(mapper->predicted, pose),
               b = cairn_pose_between(mapper->last, pose);
    cairn_real translation = cairn_min(a.x * a.x + a.y * a.y, b.x * b.x + b.y * b.y);
    cairn_real turn = cairn_min(a.theta * a.theta, b.theta * b.theta);

    return cairn_min((translation + turn) / (unit * unit), 4);
}

static cairn_real prior_penalty(const cairn_mapper *mapper, cairn_pose pose)
{
    return cairn_mapper_out_of_the_way(mapper, pose, MAPPER_PRIOR_SCALE);
}

/* What speaks for a pose: the log of a quality, less for a strange motion. */
static cairn_real match_score(const cairn_mapper *mapper, cairn_real q, cairn_pose pose)
{
    return cairn_log(q + CAIRN_REAL(1e-3)) - PRIOR_WEIGHT * prior_penalty(mapper, pose);
}

static int32_t is_acceptable(const cairn_icp_result *match, cairn_real support)
{
    return match->verdict != CAIRN_ICP_TOO_FEW_PAIRS && match->overlap >= support &&
           match->sigma < MAX_RESIDUAL_M;
}

/* Takes the match that has ended when it counts and is clearly better than what there is. 1:
 * taken. */
static int32_t take_match(cairn_mapper *mapper)
{
    cairn_icp_result match = cairn_icp_read(mapper->icp);

    if (!is_acceptable(&match, mapper->params.min_support) ||
        (mapper->has_match && !(quality(&match) > MIN_QUALITY_RATIO * quality(&mapper->match))))
        return 0;
    mapper->match = match;
    mapper->has_match = 1;
    cairn_icp_read_parts(mapper->icp, &mapper->parts);
    return 1;
}

int32_t cairn_mapper_is_far(const cairn_mapper *mapper, cairn_pose pose)
{
    cairn_pose d = cairn_pose_between(mapper->predicted, pose);

    return cairn_mapper_way(d) > JUMP_M + JUMP_SHARE * cairn_mapper_way(mapper->motion) ||
           cairn_abs(d.theta) > JUMP_RAD + JUMP_SHARE * cairn_abs(mapper->motion.theta);
}

static int32_t is_jump(const cairn_mapper *mapper)
{
    return cairn_mapper_is_far(mapper, mapper->match.target_query);
}

/* What a search found needs only half the support when it is no sudden motion. */
static cairn_real found_min_overlap(const cairn_mapper *mapper, const cairn_icp_result *match)
{
    return mapper->params.min_support / (cairn_mapper_is_far(mapper, match->target_query) ? 1 : 2);
}

/* Takes the match from what the search found when more speaks for it; else what there is stays,
 * in doubt when it is elsewhere. */
static void take_found(cairn_mapper *mapper)
{
    cairn_icp_result match = cairn_icp_read(mapper->icp);
    cairn_pose apart;

    if (!is_acceptable(&match, found_min_overlap(mapper, &match))) {
        mapper->low_confidence = 1;
        return;
    }
    apart = cairn_pose_between(match.target_query, mapper->match.target_query);
    if (mapper->has_match &&
        match_score(mapper, quality(&match), match.target_query) <=
            match_score(mapper, quality(&mapper->match), mapper->match.target_query)) {
        mapper->low_confidence |= (cairn_mapper_way(apart) > MAPPER_DISTINCT_M ||
                                   cairn_abs(apart.theta) > MAPPER_DISTINCT_RAD) &&
                                  (!mapper->trusts_odometry || is_jump(mapper));
        return;
    }
    mapper->match = match;
    mapper->has_match = 1;
    cairn_icp_read_parts(mapper->icp, &mapper->parts);
}

/* 1 when the two motions lead to different places. */
static int32_t motions_differ(const cairn_mapper *mapper)
{
    cairn_pose d = cairn_pose_between(mapper->motion, mapper->alternative_motion);

    return d.x * d.x + d.y * d.y > MAPPER_DISTINCT_M * MAPPER_DISTINCT_M ||
           cairn_abs(d.theta) > MAPPER_DISTINCT_RAD;
}

static int32_t has_low_confidence(const cairn_mapper *mapper)
{
    return !mapper->has_match || is_jump(mapper) ||
           quality(&mapper->match) < LOW_QUALITY_RATIO * mapper->mean_quality;
}

/* ---- Few points against the odometry ---- */

/* 1 when odometry is contradicted by what few points tell: somebody who walks along, say. */
static int32_t is_weak_jump(const cairn_mapper *mapper)
{
    return mapper->has_match && mapper->trusts_odometry && is_jump(mapper) &&
           mapper->match.weak_ratio < CONSTRAINED_INFORMATION_RATIO;
}

static cairn_status begin_constrained(cairn_mapper *mapper)
{
    cairn_scan_view view = cairn_scan_read(mapper->scan);
    cairn_pose_prior prior = cairn_mapper_prior_of(mapper, mapper->motion, 1);
    cairn_status status = cairn_icp_set_weak_ratio(mapper->icp, CONSTRAINED_INFORMATION_RATIO);

    mapper->phase = MAPPER_MATCH_CONSTRAINED;
    if (status != CAIRN_OK)
        return status;
    return cairn_icp_begin(mapper->icp, view.points, view.point_count, mapper->predicted, &prior,
                           NULL);
}

cairn_status cairn_mapper_end_choice(cairn_mapper *mapper)
{
    mapper->phase = MAPPER_STORE;
    return is_weak_jump(mapper) ? begin_constrained(mapper) : CAIRN_OK;
}

/* Squared distance from where odometry leads, in standard deviations, up to FARTHEST. */
static cairn_real odometry_deviation(const cairn_mapper *mapper, cairn_pose pose)
{
    cairn_pose_prior prior = cairn_mapper_prior_of(mapper, mapper->motion, 1);
    cairn_pose deviation = cairn_pose_between(prior.mean, pose);

    return cairn_min(
        (deviation.x * deviation.x + deviation.y * deviation.y) / (prior.sigma_x * prior.sigma_x) +
            deviation.theta * deviation.theta / (prior.sigma_theta * prior.sigma_theta),
        MAX_SQUARED_DEVIATION);
}

/* The match that odometry holds stands when nearly as much speaks for it. */
static void take_constrained(cairn_mapper *mapper)
{
    cairn_icp_result match = cairn_icp_read(mapper->icp);
    cairn_real points = (cairn_real)cairn_scan_read(mapper->scan).point_count;

    if (!is_acceptable(&match, found_min_overlap(mapper, &match)) ||
        points * (quality(&mapper->match) - quality(&match)) >
            odometry_deviation(mapper, mapper->match.target_query) -
                odometry_deviation(mapper, match.target_query))
        return;
    mapper->match = match;
    mapper->is_constrained = 1;
    cairn_icp_read_parts(mapper->icp, &mapper->parts);
}

/* ---- What comes after a match ---- */

static cairn_status finish_or_search(cairn_mapper *mapper)
{
    mapper->phase = MAPPER_STORE;
    if (!mapper->params.search || !has_low_confidence(mapper))
        return CAIRN_OK;
    mapper->phase = MAPPER_BUILD_SEARCH_TARGET;
    return CAIRN_OK;
}

cairn_status cairn_mapper_end_match(cairn_mapper *mapper)
{
    int32_t taken;

    switch (mapper->phase) {
    case MAPPER_MATCH:
        (void)take_match(mapper);
        return motions_differ(mapper) ? begin_alternative(mapper) : finish_or_search(mapper);
    case MAPPER_MATCH_ALTERNATIVE:
        taken = take_match(mapper);
        mapper->state.odometry_rejected += taken && mapper->trusts_odometry;
        return finish_or_search(mapper);
    case MAPPER_MATCH_FOUND:
        take_found(mapper);
        return cairn_mapper_end_choice(mapper);
    default:
        take_constrained(mapper);
        mapper->phase = MAPPER_STORE;
        return cairn_icp_set_weak_ratio(mapper->icp, mapper->params.icp.weak_ratio);
    }
}

/* ---- What is learnt ---- */

/* Believes odometry more, or less, by how it foretold a match. */
static void update_odometry_health(cairn_mapper *mapper)
{
    cairn_pose_prior prior = cairn_mapper_prior_of(mapper, mapper->by_odometry, 1);
    cairn_pose e = cairn_pose_between(prior.mean, mapper->match.target_query);
    cairn_real deviation =
        mapper->odometry_noise_scale *
        cairn_max(cairn_mapper_way(e) / prior.sigma_x, cairn_abs(e.theta) / prior.sigma_theta);
    cairn_vec2 translation = {e.x, e.y};
    int32_t contradicted = deviation > 2;

    if (mapper->match.weak_ratio >= MAPPER_MIN_INFORMATION_RATIO && !mapper->is_constrained) {
        mapper->odometry_noise_scale =
            cairn_max(1, cairn_max(mapper->odometry_noise_scale * NOISE_SCALE_DECAY,
                                   cairn_min(deviation, MAX_NOISE_SCALE)));
        mapper->odometry_bias.x = mapper->odometry_bias.y = 0;
        if (mapper->odometry_noise_scale * cairn_mapper_way(e) > BIAS_MIN_SIGMAS * prior.sigma_x &&
            cairn_abs(e.theta) < JUMP_RAD && cairn_mapper_way(e) > JUMP_M)
            mapper->odometry_bias = translation;
    } else {
        mapper->odometry_bias = cairn_vec2_scale(mapper->odometry_bias, NOISE_SCALE_DECAY);
    }
    mapper->odometry_health +=
        SMOOTHING_GAIN * ((cairn_real)!contradicted - mapper->odometry_health);
    mapper->state.odometry_contradicted += contradicted;
}

/* Along a wall that tells little of it a scan slips unnoticed, unless odometry holds it. */
static void inflate_weak_direction(cairn_mapper *mapper)
{
    cairn_real x = MAPPER_LOW_CONFIDENCE_M * mapper->match.weak[0],
               y = MAPPER_LOW_CONFIDENCE_M * mapper->match.weak[1];

    mapper->extra_covariance[0] += x * x;
    mapper->extra_covariance[1] += x * y;
    mapper->extra_covariance[3] += x * y;
    mapper->extra_covariance[4] += y * y;
}

/* How far odometry may have led astray since the last key scan. */
static void accumulate_motion_variance(cairn_mapper *mapper)
{
    cairn_pose_prior prior = cairn_mapper_prior(mapper);

    if (mapper->scans_since_keyframe == 0)
        mapper->motion_variance = mapper->motion_heading_variance = 0;
    mapper->motion_variance += prior.sigma_x * prior.sigma_x;
    mapper->motion_heading_variance += prior.sigma_theta * prior.sigma_theta;
}

void cairn_mapper_learn(cairn_mapper *mapper)
{
    accumulate_motion_variance(mapper);
    memset(mapper->extra_covariance, 0, sizeof mapper->extra_covariance);
    if (mapper->has_match && mapper->low_confidence) {
        mapper->extra_covariance[0] = mapper->extra_covariance[4] =
            MAPPER_LOW_CONFIDENCE_M * MAPPER_LOW_CONFIDENCE_M;
        mapper->extra_covariance[8] = MAPPER_LOW_CONFIDENCE_RAD * MAPPER_LOW_CONFIDENCE_RAD;
    }
    if (mapper->has_match &&
        (mapper->is_constrained ||
         (!mapper->trusts_odometry && mapper->match.weak_ratio < MAPPER_MIN_INFORMATION_RATIO)))
        inflate_weak_direction(mapper);
    for (int k = 0; k < 9 && mapper->has_match; k++)
        mapper->match.covariance[k] += mapper->extra_covariance[k];
    mapper->state.doubtful += mapper->low_confidence;
    mapper->state.unobservable +=
        !mapper->has_match || mapper->match.weak_ratio < MAPPER_MIN_INFORMATION_RATIO;
    if (!mapper->has_match)
        return;
    if (mapper->mean_quality > 0)
        mapper->mean_quality += SMOOTHING_GAIN * (quality(&mapper->match) - mapper->mean_quality);
    else
        mapper->mean_quality = quality(&mapper->match);
    if (mapper->has_odometry && !mapper->low_confidence)
        update_odometry_health(mapper);
}

/* The motion that the next scan is expected to repeat. Of a sudden one half, which may have been
 * a slip. Along a wall that tells little of it the pace of before, which fades: what such
 * matches tell of it is mostly that of the prediction. */
cairn_pose cairn_mapper_next_motion(cairn_mapper *mapper, cairn_pose motion)
{
    cairn_pose before = mapper->last_motion;
    cairn_vec2 weak, correction;

    mapper->smoothed_motion.x += MOTION_SMOOTHING_GAIN * (motion.x - mapper->smoothed_motion.x);
    mapper->smoothed_motion.y += MOTION_SMOOTHING_GAIN * (motion.y - mapper->smoothed_motion.y);
    mapper->smoothed_motion.theta +=
        MOTION_SMOOTHING_GAIN * cairn_wrap_angle(motion.theta - mapper->smoothed_motion.theta);

    if (!mapper->has_match)
        return motion;
    if (is_jump(mapper)) {
        motion.x = (motion.x + before.x) / 2;
        motion.y = (motion.y + before.y) / 2;
        motion.theta =
            cairn_wrap_angle(before.theta + cairn_wrap_angle(motion.theta - before.theta) / 2);
    }
    if (mapper->match.weak_ratio >= MAPPER_MIN_INFORMATION_RATIO) {
        mapper->velocity.x += SMOOTHING_GAIN * (motion.x - mapper->velocity.x);
        mapper->velocity.y += SMOOTHING_GAIN * (motion.y - mapper->velocity.y);
        return motion;
    }
    weak.x = mapper->match.weak[0];
    weak.y = mapper->match.weak[1];
    weak = cairn_transform_direction(
        cairn_transform_of(cairn_pose_inverse(mapper->match.target_query)), weak);
    correction.x = mapper->velocity.x - motion.x;
    correction.y = mapper->velocity.y - motion.y;
    motion.x += weak.x * cairn_vec2_dot(weak, correction);
    motion.y += weak.y * cairn_vec2_dot(weak, correction);
    mapper->velocity = cairn_vec2_scale(mapper->velocity, VELOCITY_DECAY);
    return motion;
}
