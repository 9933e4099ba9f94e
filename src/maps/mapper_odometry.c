/* Odometry against matches: its noise is learnt, matches that contradict it are rejected, and those
 * that scatter are averaged with it.
 *
 * Method.
 *
 * 1. Returns may travel with the robot: the floor ahead of a tilted scanner, its own legs, a
 *    trailer. Matches then say that it drives less than it does, scan after scan. A wheel that
 *    slips looks the same. Which of the two is at fault follows from how good the odometry was
 *    before and from how well the match is observed.
 * 2. Motion by odometry and by the poses of the map are accumulated since an anchor, the last pose
 *    where they were found to agree. The deviation is the distance between the two ends, and that
 *    which their difference in heading makes over a stretch. Errors of synchronization, which
 *    change sign from scan to scan, cancel in it.
 * 3. After STRETCH_M of well observed matches the deviation is a sample of the odometry's noise.
 *    The standard deviation follows the median of the samples by stochastic approximation: a step
 *    up when the sample is above the median of a Rayleigh distribution of this deviation, else
 *    down. The median ignores slips and returns that travel, as long as most stretches are free of
 *    both. Where the params state the noise it is not learnt.
 * 4. A match contradicts the odometry when the deviation exceeds MAX_SIGMAS of this noise, which
 *    grows in proportion to the distance beyond STRETCH_M. It may be that of returns that travel
 *    when it is not well observed, when the odometry moves, as all returns look alike to a robot
 *    that stands, when it has agreed with the matches for MIN_SAMPLES stretches, and when the two
 *    agree about the heading within MAX_TRAVEL_RAD: the walls beside the robot do not turn with it.
 *    Otherwise it is right: the wheels slipped, or the odometry jumped.
 * 5. Of these matches, those from the MIN_CONTRADICTIONS-th in a row on are rejected. The pose
 *    continues from the anchor by odometry, which also takes back what the matches before were
 *    short.
 * 6. CONFIRMATIONS contradictions in a row that move and turn as the odometry does are right:
 *    returns that travel with the robot do neither.
 * 7. Matches on rough surfaces, as hedges are, scatter by far more than their covariance says, as
 *    beams do not meet the same leaf twice. The scatter is the median of what a match deviates from
 *    the odometry since the last scan, roughness the median of the residuals' standard deviation.
 *    Where both are large the pose is that of a Kalman filter: predicted by the odometry with the
 *    noise that is learnt, corrected by the match with the scatter. A deviation beyond the search
 *    window is a jump of the odometry or of the robot: there the match is taken as it is.
 * 8. Elsewhere a match that keeps low confidence and is far from the odometry is dropped: it would
 *    become the reference of others. The pose continues by odometry, and the next scan searches.
 *
 * Limits: where returns that travel are observed in all directions, as walls are, the match stays.
 * On rough surfaces a slip of less than the search window is taken out slowly or not at all.
 *
 * Source: Robbins and Monro 1951 (stochastic approximation), of a quantile. */
#include "src/base/build.h"

#include "src/maps/mapper_work.h"

/* m by odometry: length of a stretch */
static const cairn_real STRETCH_M = 3;
/* m: least standard deviation of the deviation after a stretch, that of the matches */
static const cairn_real MIN_SIGMA_M = CAIRN_REAL(0.02);
/* median of a Rayleigh distribution of unit parameter */
static const cairn_real RAYLEIGH_MEDIAN = CAIRN_REAL(1.18);
/* relative step of the standard deviation: 1 over the number of samples, from this number ... */
enum { FIRST_SAMPLES = 4 };
/* ... times this factor, and the least one */
static const cairn_real GAIN = 2, MIN_GAIN = CAIRN_REAL(0.05);
/* standard deviations: a larger deviation is a contradiction */
static const cairn_real MAX_SIGMAS = 6;
/* A match with a smaller ratio of smallest to largest information may be returns that travel. */
static const cairn_real UNCERTAIN_INFORMATION_RATIO = CAIRN_REAL(0.15);
/* m by odometry since the last scan, its turn over a stretch included: with less the robot may be
 * standing. */
static const cairn_real MIN_MOTION_M = CAIRN_REAL(0.05);
/* rad: returns that travel leave the heading observed; a larger deviation is of wheels that slip. */
static const cairn_real MAX_TRAVEL_RAD = CAIRN_REAL(0.3);
enum {
    /* stretches that the noise is learnt from before a match is rejected, unless it is stated */
    MIN_SAMPLES = 3,
    /* contradictions in a row, by matches that may be rejected, before one is */
    MIN_CONTRADICTIONS = 3,
    /* contradictions in a row that are right when they move as the odometry does, ... */
    CONFIRMATIONS = 3
};
/* ... within this distance and this share of its motion. */
static const cairn_real CONFIRMED_M = CAIRN_REAL(0.02), CONFIRMED_SHARE = CAIRN_REAL(0.6);

/* relative step of the medians of residual and scatter, per scan */
static const cairn_real MEDIAN_GAIN = CAIRN_REAL(0.1);
/* m and rad: least scatter */
static const cairn_real MIN_SCATTER_M = CAIRN_REAL(0.003), MIN_SCATTER_RAD = CAIRN_REAL(0.0005);
/* m: surfaces are rough where residual and scatter are above these. Between those of buildings, at
 * most 0.016 and 0.023 m in nine tenths of three logs, where the scatter is that of the time stamps
 * of the odometry, and those among hedges, 0.03 and 0.06 m. */
static const cairn_real ROUGH_RESIDUAL_M = CAIRN_REAL(0.015), ROUGH_SCATTER_M = CAIRN_REAL(0.025);
/* median of the absolute value of a normal distribution of unit variance */
static const cairn_real NORMAL_MEDIAN = CAIRN_REAL(0.67);
/* rad per m: standard deviation of the odometry's heading relative to that of its position */
static const cairn_real HEADING_PER_POSITION = CAIRN_REAL(0.1);

cairn_real cairn_mapper_learnt_sigma(cairn_real sigma, int32_t samples, cairn_real deviation)
{
    cairn_real gain = cairn_max(MIN_GAIN, GAIN / (cairn_real)(samples + FIRST_SAMPLES));

    sigma += (deviation > RAYLEIGH_MEDIAN * sigma ? gain : -gain) * sigma;
    return cairn_max(sigma, MIN_SIGMA_M);
}

void cairn_mapper_begin_odometry(cairn_mapper *mapper)
{
    cairn_real stated = mapper->params.odometry_sigma;

    mapper->odometry.sigma = stated > 0 ? stated : MAPPER_INITIAL_ODOMETRY_M;
    mapper->odometry.samples = stated > 0 ? MIN_SAMPLES : 0;
}

static void begin_stretch(mapper_odometry *odometry)
{
    odometry->by_odometry = odometry->by_poses = cairn_pose_identity();
    odometry->distance = 0;
    odometry->is_uncertain = 0;
}

/* Returns the length of a motion, m: its translation, and what its heading makes over a stretch. */
static cairn_real motion_length(cairn_pose motion)
{
    return cairn_mapper_translation(motion) + STRETCH_M * cairn_abs(motion.theta);
}

/* Returns 1 when a match that contradicts the odometry may be that of returns that travel. */
static int32_t may_travel(const cairn_mapper *mapper, cairn_pose deviation)
{
    return mapper->odometry.samples >= MIN_SAMPLES && cairn_abs(deviation.theta) < MAX_TRAVEL_RAD &&
           (mapper->current.low_confidence ||
            mapper->current.match.weak_ratio < UNCERTAIN_INFORMATION_RATIO) &&
           motion_length(mapper->current.by_odometry) > MIN_MOTION_M;
}

/* Returns 1 when the last contradictions, this one included, move as the odometry does: their
 * deviation stays. */
static int32_t is_confirmed(const cairn_mapper *mapper, mapper_odometry *odometry,
                            cairn_real deviation)
{
    cairn_real change = cairn_abs(deviation - odometry->deviation);

    odometry->deviation = deviation;
    if (odometry->contradictions == 0 ||
        change > CONFIRMED_M + CONFIRMED_SHARE * motion_length(mapper->current.by_odometry))
        odometry->confirmations = 0;
    return ++odometry->confirmations == CONFIRMATIONS;
}

int32_t cairn_mapper_is_rejecting(const cairn_mapper *mapper)
{
    return mapper->odometry.contradictions >= MIN_CONTRADICTIONS;
}

/* Predicts the pose from the anchor by odometry, in place of the match. before: motion of the poses
 * from the anchor to the previous scan */
static void reject_match(cairn_mapper *mapper, cairn_pose before)
{
    mapper_odometry *odometry = &mapper->odometry;

    mapper->current.motion = cairn_pose_between(before, odometry->by_odometry);
    mapper->current.predicted = cairn_pose_compose(mapper->previous.pose, mapper->current.motion);
    mapper->current.has_match = 0;
    mapper->current.uses_odometry = 1;
    odometry->by_poses = odometry->by_odometry;
    mapper->state.matches_rejected++;
    mapper->state.stretches_rejected += odometry->contradictions == MIN_CONTRADICTIONS;
}

/* ---- Matches that scatter ---- */

/* Moves the estimate of a median towards a sample. */
static void follow_median(cairn_real *median, cairn_real sample, cairn_real least)
{
    *median += (sample > *median ? MEDIAN_GAIN : -MEDIAN_GAIN) * *median;
    *median = cairn_max(*median, least);
}

int32_t cairn_mapper_matches_scatter(const cairn_mapper *mapper)
{
    const mapper_odometry *odometry = &mapper->odometry;

    return odometry->samples >= MIN_SAMPLES && odometry->residual > ROUGH_RESIDUAL_M &&
           odometry->scatter_m > ROUGH_SCATTER_M;
}

/* Returns 1 when the match is averaged with the odometry. */
static int32_t is_averaged(const cairn_mapper *mapper, cairn_pose deviation)
{
    return mapper->current.uses_odometry && cairn_mapper_matches_scatter(mapper) &&
           motion_length(mapper->current.by_odometry) > MIN_MOTION_M &&
           cairn_mapper_translation(deviation) < MAPPER_WIDE_SEARCH_M;
}

/* Corrects a variance by that of a measurement; returns the gain. */
static cairn_real correct(cairn_real *variance, cairn_real measured)
{
    cairn_real gain = *variance / (*variance + measured);

    *variance *= 1 - gain;
    return gain;
}

/* Returns 1 when a match of low confidence is farther from the odometry than its standard deviation,
 * where not all matches scatter. */
static int32_t is_dropped(const cairn_mapper *mapper, cairn_pose deviation)
{
    return mapper->current.uses_odometry && mapper->current.low_confidence &&
           !cairn_mapper_matches_scatter(mapper) &&
           (cairn_mapper_translation(deviation) > MAPPER_LOW_CONFIDENCE_M ||
            cairn_abs(deviation.theta) > MAPPER_LOW_CONFIDENCE_RAD);
}

void cairn_mapper_weigh_match(cairn_mapper *mapper)
{
    mapper_odometry *odometry = &mapper->odometry;
    mapper_current *current = &mapper->current;
    cairn_real added =
        odometry->sigma * odometry->sigma * motion_length(current->by_odometry) / STRETCH_M;
    cairn_real sigma_m, sigma_rad, gain;
    cairn_pose predicted, deviation;

    if (!current->has_odometry) {
        odometry->variance_m = MAPPER_LOW_CONFIDENCE_M * MAPPER_LOW_CONFIDENCE_M;
        odometry->variance_rad = MAPPER_LOW_CONFIDENCE_RAD * MAPPER_LOW_CONFIDENCE_RAD;
        return;
    }
    odometry->variance_m += added;
    odometry->variance_rad += HEADING_PER_POSITION * HEADING_PER_POSITION * added;
    if (!current->has_match)
        return;
    predicted = cairn_pose_compose(mapper->previous.pose, current->by_odometry);
    deviation = cairn_pose_between(predicted, current->match.target_query);
    follow_median(&odometry->residual, current->match.sigma, MIN_SCATTER_M);
    follow_median(&odometry->scatter_m, cairn_mapper_translation(deviation), MIN_SCATTER_M);
    follow_median(&odometry->scatter_rad, cairn_abs(deviation.theta), MIN_SCATTER_RAD);
    sigma_m = odometry->scatter_m / RAYLEIGH_MEDIAN;
    sigma_rad = odometry->scatter_rad / NORMAL_MEDIAN;
    if (is_dropped(mapper, deviation)) {
        current->has_match = 0;
        return;
    }
    current->is_averaged = is_averaged(mapper, deviation);
    if (!current->is_averaged) {
        odometry->variance_m = sigma_m * sigma_m;
        odometry->variance_rad = sigma_rad * sigma_rad;
        return;
    }
    gain = correct(&odometry->variance_m, sigma_m * sigma_m);
    deviation.x *= gain;
    deviation.y *= gain;
    deviation.theta *= correct(&odometry->variance_rad, sigma_rad * sigma_rad);
    current->match.target_query = cairn_pose_compose(predicted, deviation);
}

/* ---- Matches that contradict ---- */

void cairn_mapper_check_match(cairn_mapper *mapper)
{
    mapper_odometry *odometry = &mapper->odometry;
    cairn_pose before = odometry->by_poses, off;
    cairn_real deviation;
    int32_t contradicts;

    if (!mapper->current.has_odometry) {
        odometry->contradictions = 0;
        begin_stretch(odometry);
        return;
    }
    odometry->distance += cairn_mapper_translation(mapper->current.by_odometry);
    odometry->by_odometry = cairn_pose_compose(odometry->by_odometry, mapper->current.by_odometry);
    odometry->by_poses = cairn_pose_compose(
        before, cairn_pose_between(mapper->previous.pose, mapper->current.has_match
                                                              ? mapper->current.match.target_query
                                                              : mapper->current.predicted));
    if (!mapper->current.has_match) {
        odometry->is_uncertain = 1;
        return;
    }
    off = cairn_pose_between(odometry->by_odometry, odometry->by_poses);
    deviation = motion_length(off);
    contradicts =
        deviation > MAX_SIGMAS * odometry->sigma * cairn_max(1, odometry->distance / STRETCH_M);
    if (contradicts && may_travel(mapper, off) && !is_confirmed(mapper, odometry, deviation)) {
        odometry->is_uncertain = 1;
        odometry->contradictions++;
        if (cairn_mapper_is_rejecting(mapper))
            reject_match(mapper, before);
        return;
    }
    odometry->contradictions = 0;
    if (!contradicts && (mapper->current.low_confidence || mapper->current.is_constrained ||
                         mapper->current.match.weak_ratio < MAPPER_MIN_INFORMATION_RATIO)) {
        odometry->is_uncertain = 1;
        return;
    }
    if (!contradicts && !odometry->is_uncertain) {
        if (odometry->distance < STRETCH_M)
            return;
        if (!(mapper->params.odometry_sigma > 0))
            odometry->sigma =
                cairn_mapper_learnt_sigma(odometry->sigma, odometry->samples++, deviation);
    }
    begin_stretch(odometry);
}
