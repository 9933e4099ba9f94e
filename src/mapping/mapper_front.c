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
static const cairn_real BETTER = CAIRN_REAL(1.2);
/* m beyond the prediction, ... */
static const cairn_real SUDDEN = CAIRN_REAL(0.1);
static const cairn_real SUDDEN_TURN = CAIRN_REAL(0.08);
/* ... and this share of the motion */
static const cairn_real SUDDEN_SHARE = CAIRN_REAL(0.2);
/* than the mean quality */
static const cairn_real WORSE = CAIRN_REAL(0.8);
/* ... of the log of the quality */
static const cairn_real STRANGE_COST = CAIRN_REAL(0.1);
/* m, deviation of the points of what is no match */
static const cairn_real LOOSE = CAIRN_REAL(0.1);
/* share of information along a direction of which few points tell */
static const cairn_real HELD = CAIRN_REAL(0.15);
/* squared standard deviations from odometry: wheels may slip by any */
static const cairn_real FARTHEST = 10;
/* Standard deviations, fewer after it was wrong: what odometry is off by beyond, and not by
 * turning, it is off by again. */
static const cairn_real DRAGGED = CAIRN_REAL(1.5);
/* times what odometry may be wrong by, ... */
static const cairn_real SLIP_MOST = 4;
/* ... and how that ends, by each scan that agrees */
static const cairn_real SLIP_FADES = CAIRN_REAL(0.8);
/* pace, by each scan that does not tell it */
static const cairn_real FADES = CAIRN_REAL(0.99);
/* by each scan, of mean quality and trust */
static const cairn_real ADAPTS = CAIRN_REAL(0.1);
/* odometry whose trust is above is believed */
static const cairn_real TRUSTED = CAIRN_REAL(0.5);

/* by each scan */
static const cairn_real STEADY = CAIRN_REAL(0.5);
/* ns: after a longer one nobody knows how the robot moves */
static const int64_t LONGEST_SPAN = 1000000000;

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
    int32_t by_wheels = by_odometry != NULL && mapper->trust > TRUSTED;
    int64_t span = by_wheels ? input->stamp_ns - mapper->last_stamp : mapper->last_span;
    cairn_real sweep =
        (cairn_real)input->time_step * (cairn_real)(input->count - 1) * CAIRN_REAL(1e9);

    if (!(sweep > 0) || has_motion(input) || mapper->state.scans < 2 ||
        !(span > 0 && span < LONGEST_SPAN))
        return input->motion;
    return cairn_twist_at(cairn_twist_of(by_wheels ? *by_odometry : mapper->steady),
                          cairn_min(1, sweep / (cairn_real)span));
}

void cairn_mapper_predict(cairn_mapper *mapper, cairn_pose last, cairn_pose by_odometry)
{
    mapper->last = last;
    mapper->believed = mapper->has_odometry && mapper->trust > TRUSTED;
    mapper->motion = mapper->believed ? by_odometry : mapper->last_motion;
    mapper->other = cairn_pose_identity();
    if (mapper->believed)
        mapper->other = mapper->last_motion;
    else if (mapper->has_odometry)
        mapper->other = by_odometry;
    mapper->by_odometry = by_odometry;
    if (mapper->believed) {
        mapper->motion.x += mapper->drag.x;
        mapper->motion.y += mapper->drag.y;
    }
    mapper->predicted = cairn_pose_compose(last, mapper->motion);
    mapper->has_match = 0;
    mapper->doubtful = mapper->held = 0;
    mapper->spent = mapper->matched = mapper->searches = 0;
}

cairn_pose_prior cairn_mapper_prior_of(const cairn_mapper *mapper, cairn_pose motion,
                                       int32_t is_odometry)
{
    const cairn_mapper_params *p = &mapper->params;
    cairn_real way = cairn_mapper_way(motion);
    cairn_pose_prior prior;

    prior.mean = cairn_pose_compose(mapper->last, motion);
    if (is_odometry) {
        prior.sigma_x = mapper->slip * (p->odometry_distance_min + p->odometry_distance * way);
        prior.sigma_theta =
            mapper->slip *
            (p->odometry_turn_min + p->odometry_turn * (cairn_abs(motion.theta) + way / 10));
    } else {
        prior.sigma_x = p->motion_distance_min + p->motion_distance * way;
        prior.sigma_theta = p->motion_turn_min + p->motion_turn * cairn_abs(motion.theta);
    }
    prior.sigma_y = prior.sigma_x;
    return prior;
}

cairn_pose_prior cairn_mapper_prior(const cairn_mapper *mapper)
{
    return cairn_mapper_prior_of(mapper, mapper->motion, mapper->believed);
}

cairn_status cairn_mapper_begin_match(cairn_mapper *mapper)
{
    cairn_scan_view view = cairn_scan_read(mapper->scan);
    cairn_pose_prior prior = cairn_mapper_prior_of(mapper, mapper->motion, mapper->believed);

    mapper->phase = MATCH;
    return cairn_icp_begin(mapper->icp, view.points, view.point_count, mapper->predicted, &prior,
                           NULL);
}

static cairn_status begin_other(cairn_mapper *mapper)
{
    cairn_scan_view view = cairn_scan_read(mapper->scan);
    cairn_pose_prior prior =
        cairn_mapper_prior_of(mapper, mapper->other, mapper->has_odometry && !mapper->believed);

    mapper->phase = MATCH_OTHER;
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
    cairn_real way = cairn_min(a.x * a.x + a.y * a.y, b.x * b.x + b.y * b.y);
    cairn_real turn = cairn_min(a.theta * a.theta, b.theta * b.theta);

    return cairn_min((way + turn) / (unit * unit), 4);
}

static cairn_real strangeness(const cairn_mapper *mapper, cairn_pose pose)
{
    return cairn_mapper_out_of_the_way(mapper, pose, MAPPER_STRANGE);
}

/* What speaks for a pose: the log of a quality, less for a strange motion. */
static cairn_real value_of(const cairn_mapper *mapper, cairn_real q, cairn_pose pose)
{
    return cairn_log(q + CAIRN_REAL(1e-3)) - STRANGE_COST * strangeness(mapper, pose);
}

static int32_t counts(const cairn_icp_result *match, cairn_real support)
{
    return match->verdict != CAIRN_ICP_TOO_FEW_PAIRS && match->overlap >= support &&
           match->sigma < LOOSE;
}

/* Takes the match that has ended when it counts and is clearly better than what there is. 1:
 * taken. */
static int32_t take_match(cairn_mapper *mapper)
{
    cairn_icp_result match = cairn_icp_read(mapper->icp);

    if (!counts(&match, mapper->params.min_support) ||
        (mapper->has_match && !(quality(&match) > BETTER * quality(&mapper->match))))
        return 0;
    mapper->match = match;
    mapper->has_match = 1;
    cairn_icp_read_parts(mapper->icp, &mapper->parts);
    return 1;
}

int32_t cairn_mapper_is_far(const cairn_mapper *mapper, cairn_pose pose)
{
    cairn_pose d = cairn_pose_between(mapper->predicted, pose);

    return cairn_mapper_way(d) > SUDDEN + SUDDEN_SHARE * cairn_mapper_way(mapper->motion) ||
           cairn_abs(d.theta) > SUDDEN_TURN + SUDDEN_SHARE * cairn_abs(mapper->motion.theta);
}

static int32_t is_sudden(const cairn_mapper *mapper)
{
    return cairn_mapper_is_far(mapper, mapper->match.target_query);
}

/* What a search found needs only half the support when it is no sudden motion. */
static cairn_real found_support(const cairn_mapper *mapper, const cairn_icp_result *match)
{
    return mapper->params.min_support / (cairn_mapper_is_far(mapper, match->target_query) ? 1 : 2);
}

/* Takes the match from what the search found when more speaks for it; else what there is stays,
 * in doubt when it is elsewhere. */
static void take_found(cairn_mapper *mapper)
{
    cairn_icp_result match = cairn_icp_read(mapper->icp);
    cairn_pose apart;

    if (!counts(&match, found_support(mapper, &match))) {
        mapper->doubtful = 1;
        return;
    }
    apart = cairn_pose_between(match.target_query, mapper->match.target_query);
    if (mapper->has_match &&
        value_of(mapper, quality(&match), match.target_query) <=
            value_of(mapper, quality(&mapper->match), mapper->match.target_query)) {
        mapper->doubtful |= (cairn_mapper_way(apart) > MAPPER_APART ||
                             cairn_abs(apart.theta) > MAPPER_APART_TURN) &&
                            (!mapper->believed || is_sudden(mapper));
        return;
    }
    mapper->match = match;
    mapper->has_match = 1;
    cairn_icp_read_parts(mapper->icp, &mapper->parts);
}

/* 1 when the two motions lead to different places. */
static int32_t motions_differ(const cairn_mapper *mapper)
{
    cairn_pose d = cairn_pose_between(mapper->motion, mapper->other);

    return d.x * d.x + d.y * d.y > MAPPER_APART * MAPPER_APART ||
           cairn_abs(d.theta) > MAPPER_APART_TURN;
}

static int32_t is_doubtful(const cairn_mapper *mapper)
{
    return !mapper->has_match || is_sudden(mapper) ||
           quality(&mapper->match) < WORSE * mapper->mean_quality;
}

/* ---- Few points against the odometry ---- */

/* 1 when odometry is contradicted by what few points tell: somebody who walks along, say. */
static int32_t is_outvoted(const cairn_mapper *mapper)
{
    return mapper->has_match && mapper->believed && is_sudden(mapper) &&
           mapper->match.weak_ratio < HELD;
}

static cairn_status begin_held(cairn_mapper *mapper)
{
    cairn_scan_view view = cairn_scan_read(mapper->scan);
    cairn_pose_prior prior = cairn_mapper_prior_of(mapper, mapper->motion, 1);
    cairn_status status = cairn_icp_set_weak_ratio(mapper->icp, HELD);

    mapper->phase = MATCH_HELD;
    if (status != CAIRN_OK)
        return status;
    return cairn_icp_begin(mapper->icp, view.points, view.point_count, mapper->predicted, &prior,
                           NULL);
}

cairn_status cairn_mapper_end_choice(cairn_mapper *mapper)
{
    mapper->phase = KEEP;
    return is_outvoted(mapper) ? begin_held(mapper) : CAIRN_OK;
}

/* Squared distance from where odometry leads, in standard deviations, up to FARTHEST. */
static cairn_real off_odometry(const cairn_mapper *mapper, cairn_pose pose)
{
    cairn_pose_prior prior = cairn_mapper_prior_of(mapper, mapper->motion, 1);
    cairn_pose off = cairn_pose_between(prior.mean, pose);

    return cairn_min((off.x * off.x + off.y * off.y) / (prior.sigma_x * prior.sigma_x) +
                         off.theta * off.theta / (prior.sigma_theta * prior.sigma_theta),
                     FARTHEST);
}

/* The match that odometry holds stands when nearly as much speaks for it. */
static void take_held(cairn_mapper *mapper)
{
    cairn_icp_result match = cairn_icp_read(mapper->icp);
    cairn_real points = (cairn_real)cairn_scan_read(mapper->scan).point_count;

    if (!counts(&match, found_support(mapper, &match)) ||
        points * (quality(&mapper->match) - quality(&match)) >
            off_odometry(mapper, mapper->match.target_query) -
                off_odometry(mapper, match.target_query))
        return;
    mapper->match = match;
    mapper->held = 1;
    cairn_icp_read_parts(mapper->icp, &mapper->parts);
}

/* ---- What comes after a match ---- */

static cairn_status end_doubt(cairn_mapper *mapper)
{
    mapper->phase = KEEP;
    if (!mapper->params.search || !is_doubtful(mapper))
        return CAIRN_OK;
    mapper->phase = SEARCH_TARGET;
    return CAIRN_OK;
}

cairn_status cairn_mapper_end_match(cairn_mapper *mapper)
{
    int32_t taken;

    switch (mapper->phase) {
    case MATCH:
        (void)take_match(mapper);
        return motions_differ(mapper) ? begin_other(mapper) : end_doubt(mapper);
    case MATCH_OTHER:
        taken = take_match(mapper);
        mapper->state.odometry_rejected += taken && mapper->believed;
        return end_doubt(mapper);
    case MATCH_FOUND:
        take_found(mapper);
        return cairn_mapper_end_choice(mapper);
    default:
        take_held(mapper);
        mapper->phase = KEEP;
        return cairn_icp_set_weak_ratio(mapper->icp, mapper->params.icp.weak_ratio);
    }
}

/* ---- What is learnt ---- */

/* Believes odometry more, or less, by how it foretold a match. */
static void weigh_odometry(cairn_mapper *mapper)
{
    cairn_pose_prior prior = cairn_mapper_prior_of(mapper, mapper->by_odometry, 1);
    cairn_pose e = cairn_pose_between(prior.mean, mapper->match.target_query);
    cairn_real off = mapper->slip * cairn_max(cairn_mapper_way(e) / prior.sigma_x,
                                              cairn_abs(e.theta) / prior.sigma_theta);
    cairn_vec2 way = {e.x, e.y};
    int32_t contradicted = off > 2;

    if (mapper->match.weak_ratio >= MAPPER_SLIPPERY && !mapper->held) {
        mapper->slip =
            cairn_max(1, cairn_max(mapper->slip * SLIP_FADES, cairn_min(off, SLIP_MOST)));
        mapper->drag.x = mapper->drag.y = 0;
        if (mapper->slip * cairn_mapper_way(e) > DRAGGED * prior.sigma_x &&
            cairn_abs(e.theta) < SUDDEN_TURN && cairn_mapper_way(e) > SUDDEN)
            mapper->drag = way;
    } else {
        mapper->drag = cairn_vec2_scale(mapper->drag, SLIP_FADES);
    }
    mapper->trust += ADAPTS * ((cairn_real)!contradicted - mapper->trust);
    mapper->state.odometry_contradicted += contradicted;
}

/* Along a wall that tells little of it a scan slips unnoticed, unless odometry holds it. */
static void doubt_weak_direction(cairn_mapper *mapper)
{
    cairn_real x = MAPPER_DOUBT * mapper->match.weak[0], y = MAPPER_DOUBT * mapper->match.weak[1];

    mapper->doubt[0] += x * x;
    mapper->doubt[1] += x * y;
    mapper->doubt[3] += x * y;
    mapper->doubt[4] += y * y;
}

/* How far odometry may have led astray since the last key scan. */
static void add_gap(cairn_mapper *mapper)
{
    cairn_pose_prior prior = cairn_mapper_prior(mapper);

    if (mapper->since_key == 0)
        mapper->gap_variance = mapper->gap_turn_variance = 0;
    mapper->gap_variance += prior.sigma_x * prior.sigma_x;
    mapper->gap_turn_variance += prior.sigma_theta * prior.sigma_theta;
}

void cairn_mapper_learn(cairn_mapper *mapper)
{
    add_gap(mapper);
    memset(mapper->doubt, 0, sizeof mapper->doubt);
    if (mapper->has_match && mapper->doubtful) {
        mapper->doubt[0] = mapper->doubt[4] = MAPPER_DOUBT * MAPPER_DOUBT;
        mapper->doubt[8] = MAPPER_DOUBT_TURN * MAPPER_DOUBT_TURN;
    }
    if (mapper->has_match &&
        (mapper->held || (!mapper->believed && mapper->match.weak_ratio < MAPPER_SLIPPERY)))
        doubt_weak_direction(mapper);
    for (int k = 0; k < 9 && mapper->has_match; k++)
        mapper->match.covariance[k] += mapper->doubt[k];
    mapper->state.doubtful += mapper->doubtful;
    mapper->state.unobservable += !mapper->has_match || mapper->match.weak_ratio < MAPPER_SLIPPERY;
    if (!mapper->has_match)
        return;
    if (mapper->mean_quality > 0)
        mapper->mean_quality += ADAPTS * (quality(&mapper->match) - mapper->mean_quality);
    else
        mapper->mean_quality = quality(&mapper->match);
    if (mapper->has_odometry && !mapper->doubtful)
        weigh_odometry(mapper);
}

/* The motion that the next scan is expected to repeat. Of a sudden one half, which may have been
 * a slip. Along a wall that tells little of it the pace of before, which fades: what such
 * matches tell of it is mostly that of the prediction. */
cairn_pose cairn_mapper_next_motion(cairn_mapper *mapper, cairn_pose motion)
{
    cairn_pose before = mapper->last_motion;
    cairn_vec2 weak, lost;

    mapper->steady.x += STEADY * (motion.x - mapper->steady.x);
    mapper->steady.y += STEADY * (motion.y - mapper->steady.y);
    mapper->steady.theta += STEADY * cairn_wrap_angle(motion.theta - mapper->steady.theta);

    if (!mapper->has_match)
        return motion;
    if (is_sudden(mapper)) {
        motion.x = (motion.x + before.x) / 2;
        motion.y = (motion.y + before.y) / 2;
        motion.theta =
            cairn_wrap_angle(before.theta + cairn_wrap_angle(motion.theta - before.theta) / 2);
    }
    if (mapper->match.weak_ratio >= MAPPER_SLIPPERY) {
        mapper->pace.x += ADAPTS * (motion.x - mapper->pace.x);
        mapper->pace.y += ADAPTS * (motion.y - mapper->pace.y);
        return motion;
    }
    weak.x = mapper->match.weak[0];
    weak.y = mapper->match.weak[1];
    weak = cairn_transform_direction(
        cairn_transform_of(cairn_pose_inverse(mapper->match.target_query)), weak);
    lost.x = mapper->pace.x - motion.x;
    lost.y = mapper->pace.y - motion.y;
    motion.x += weak.x * cairn_vec2_dot(weak, lost);
    motion.y += weak.y * cairn_vec2_dot(weak, lost);
    mapper->pace = cairn_vec2_scale(mapper->pace, FADES);
    return motion;
}
