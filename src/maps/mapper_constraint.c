/* Sequential constraints of keyframes, and the reference keyframe of other scans.
 *
 * Method.
 *
 * 1. A match is against the whole local map, but its keyframes are not equally certain relative to
 *    each other. A keyframe that was matched to a single wall has a poorly observed position along
 *    it, and later keyframes should not inherit that error. So mutually rigid keyframes form
 *    submaps.
 * 2. The information matrix of a match is split by the submaps that its pairs lie in (icp).
 * 3. A keyframe is constrained to its predecessor by the pairs with the predecessor's submap and by
 *    the odometry since.
 * 4. It is also constrained to the last keyframe of up to MAPPER_MAX_ANCHORS other submaps
 *    (anchors) that increase the determinant of the information by MIN_INFORMATION_GAIN
 *    (D-optimality).
 * 5. A keyframe with a rigid constraint joins that submap; otherwise it begins one of its own.
 *
 * Limits: a submap is assumed rigid even where drift inside it went unnoticed. */
#include "src/base/build.h"

#include <string.h>

#include "src/maps/mapper_work.h"

/* m and rad: standard deviation of an unobserved coordinate */
static const cairn_real UNINFORMATIVE_SIGMA = 1;
/* factor of the information's determinant */
static const cairn_real MIN_INFORMATION_GAIN = 4;
/* share of all information that an anchor's pairs must have */
static const cairn_real MIN_INFORMATION_SHARE = CAIRN_REAL(0.1);
/* m and rad: maximum standard deviations of a rigid constraint */
static const cairn_real MAX_SUBMAP_SIGMA_M = CAIRN_REAL(0.05),
                        MAX_SUBMAP_SIGMA_RAD = CAIRN_REAL(0.03);

/* Odometry of this health agrees with the matches. */
static const cairn_real AGREEING_HEALTH = CAIRN_REAL(0.9);

/* Returns the submap of a part, a keyframe of the local map. */
static int32_t submap_of(const cairn_mapper *mapper, int32_t part)
{
    return mapper->loop.constraints[mapper->target.keyframes[part].keyframe].submap;
}

static int32_t part_count(const cairn_mapper *mapper)
{
    return mapper->current.parts.count < mapper->target.count ? mapper->current.parts.count
                                                              : mapper->target.count;
}

/* Returns the information matrix of the pairs with a submap. */
static cairn_sym3 submap_information(const cairn_mapper *mapper, int32_t submap)
{
    cairn_sym3 gained = cairn_sym3_zero();

    for (int32_t part = 0; part < part_count(mapper); part++)
        if (submap_of(mapper, part) == submap)
            gained = cairn_sym3_add(gained, mapper->current.parts.information[part]);
    return gained;
}

/* Returns the covariance of the current scan relative to a submap, in the scan's own frame: from
 * the pairs with it and the prior, plus an inflation (NULL: none). Little information along a
 * direction is noise of the pairs' normals. */
static cairn_sym3 relative_covariance(const cairn_mapper *mapper, int32_t submap,
                                      const cairn_rigid_motion_pose_prior *prior,
                                      const cairn_real *inflation)
{
    cairn_sym3 gained = submap_information(mapper, submap);
    const cairn_rigid_motion *motion = &mapper->current.parts.motion;
    cairn_rigid_motion_equations known = cairn_rigid_motion_prior(motion, prior);
    cairn_real covariance[9];
    cairn_rigid_motion_basis basis;
    int32_t has_pairs = gained.xx + gained.yy > 0;

    if (has_pairs)
        basis = cairn_rigid_motion_basis_of(gained, mapper->params.icp.weak_ratio);
    cairn_rigid_motion_covariance(motion, has_pairs ? &basis : NULL, has_pairs ? &gained : NULL,
                                  &known, covariance);
    for (int k = 0; k < 9 && inflation != NULL; k++)
        covariance[k] += inflation[k];
    return cairn_mapper_own_covariance(mapper, covariance, motion->map_body.theta);
}

static cairn_real determinant(cairn_sym3 m)
{
    return m.xx * (m.yy * m.zz - m.yz * m.yz) - m.xy * (m.xy * m.zz - m.yz * m.xz) +
           m.xz * (m.xy * m.yz - m.yy * m.xz);
}

/* Returns the last keyframe of a submap in the local map. */
static int32_t last_keyframe_of(const cairn_mapper *mapper, int32_t submap)
{
    int32_t last = submap;

    for (int32_t part = 0; part < part_count(mapper); part++)
        if (submap_of(mapper, part) == submap && mapper->target.keyframes[part].keyframe > last)
            last = mapper->target.keyframes[part].keyframe;
    return last;
}

/* Returns 1 when a part is the first one of its submap, that has full confidence, and enough pairs
 * lie in it: a few may be on a dynamic object. */
static int32_t is_anchor(const cairn_mapper *mapper, int32_t part)
{
    int32_t submap = submap_of(mapper, part);
    cairn_sym3 gained = submap_information(mapper, submap);
    cairn_real all_xx = 0, all_yy = 0;

    for (int32_t i = 0; i < part_count(mapper); i++) {
        if (i < part && submap_of(mapper, i) == submap)
            return 0;
        all_xx += mapper->current.parts.information[i].xx;
        all_yy += mapper->current.parts.information[i].yy;
    }
    return !mapper->loop.constraints[submap].low_confidence &&
           gained.xx + gained.yy > MIN_INFORMATION_SHARE * (all_xx + all_yy);
}

static int32_t is_anchored(const mapper_constraint *constraint, int32_t keyframe)
{
    for (int32_t i = 0; i < constraint->anchor_count; i++)
        if (constraint->anchors[i] == keyframe)
            return 1;
    return 0;
}

/* Adds the anchor of largest information gain; returns 0 when no gain is large. known: information
 * so far. */
static int32_t add_anchor(const cairn_mapper *mapper, mapper_constraint *constraint,
                          int32_t previous_submap, cairn_sym3 *known)
{
    cairn_rigid_motion_pose_prior flat_prior = {mapper->current.match.target_query,
                                                UNINFORMATIVE_SIGMA, UNINFORMATIVE_SIGMA,
                                                UNINFORMATIVE_SIGMA};
    cairn_real best = MIN_INFORMATION_GAIN * determinant(*known);
    cairn_sym3 before = *known;
    int32_t at = constraint->anchor_count, found = 0;

    for (int32_t part = 0; part < part_count(mapper); part++) {
        int32_t submap = submap_of(mapper, part);
        cairn_sym3 covariance, information, sum;

        if (submap == previous_submap || !is_anchor(mapper, part) ||
            is_anchored(constraint, last_keyframe_of(mapper, submap)))
            continue;
        covariance = relative_covariance(mapper, submap, &flat_prior, NULL);
        if (!cairn_sym3_inverse(covariance, &information))
            continue;
        sum = cairn_sym3_add(before, information);
        if (!(determinant(sum) > best))
            continue;
        best = determinant(sum);
        *known = sum;
        constraint->anchors[at] = last_keyframe_of(mapper, submap);
        constraint->anchor_covariance[at] = covariance;
        found = 1;
    }
    constraint->anchor_count += found;
    return found;
}

/* Returns the standard deviation of the position, m. */
static cairn_real position_sigma(cairn_sym3 covariance)
{
    return cairn_sqrt(covariance.xx + covariance.yy);
}

/* Returns 1 when a constraint is rigid enough for one submap. */
static int32_t is_rigid(cairn_sym3 covariance)
{
    return position_sigma(covariance) < MAX_SUBMAP_SIGMA_M &&
           covariance.zz < MAX_SUBMAP_SIGMA_RAD * MAX_SUBMAP_SIGMA_RAD;
}

/* Returns the submap that the current scan is rigidly constrained to; -1: none, it begins one. */
static int32_t choose_submap(const cairn_mapper *mapper, const mapper_constraint *constraint,
                             int32_t before)
{
    if (is_rigid(constraint->covariance))
        return mapper->loop.constraints[before].submap;
    for (int32_t i = 0; i < constraint->anchor_count; i++)
        if (is_rigid(constraint->anchor_covariance[i]))
            return mapper->loop.constraints[constraint->anchors[i]].submap;
    return -1;
}

int32_t cairn_mapper_choose_reference(const cairn_mapper *mapper)
{
    int32_t last = mapper->keyframe_count - 1, best = last, last_submap;
    cairn_rigid_motion_pose_prior prior = cairn_mapper_prior(mapper);
    cairn_real least;

    if (!mapper->current.has_match || mapper->loop.graph == NULL || mapper->current.low_confidence)
        return last;
    last_submap = mapper->loop.constraints[last].submap;
    prior.mean = mapper->current.match.target_query;
    least =
        determinant(relative_covariance(mapper, last_submap, &prior, NULL)) / MIN_INFORMATION_GAIN;
    if (mapper->loop.constraints[last].low_confidence)
        least = UNINFORMATIVE_SIGMA;
    prior.sigma_x = prior.sigma_y = prior.sigma_theta = UNINFORMATIVE_SIGMA;
    for (int32_t part = 0; part < part_count(mapper); part++) {
        cairn_real d;

        if (submap_of(mapper, part) == last_submap || !is_anchor(mapper, part))
            continue;
        d = determinant(relative_covariance(mapper, submap_of(mapper, part), &prior, NULL));
        if (!(d < least))
            continue;
        least = d;
        best = last_keyframe_of(mapper, submap_of(mapper, part));
    }
    return best;
}

/* Returns MAPPER_HEADING_... of the current scan as a keyframe. */
static int32_t heading_basis(const cairn_mapper *mapper)
{
    if (mapper->motion_heading_variance >= MAPPER_UNMATCHED_RAD * MAPPER_UNMATCHED_RAD)
        return MAPPER_HEADING_UNKNOWN;
    return mapper->current.has_odometry && mapper->odometry.health >= AGREEING_HEALTH
               ? MAPPER_HEADING_BY_ODOMETRY
               : MAPPER_HEADING_BY_MATCH;
}

/* Constrains a keyframe without a match by odometry alone. */
static void constrain_by_odometry(const cairn_mapper *mapper, mapper_constraint *constraint)
{
    cairn_real covariance[9] = {0};

    covariance[0] = covariance[4] = mapper->motion_variance;
    covariance[8] = mapper->motion_heading_variance;
    constraint->covariance = cairn_mapper_own_covariance(mapper, covariance, 0);
    constraint->position_sigma = position_sigma(constraint->covariance);
}

void cairn_mapper_constrain_keyframe(const cairn_mapper *mapper, mapper_constraint *constraint)
{
    int32_t keyframe = mapper->keyframe_count - 1, before = keyframe - 1, submap;
    cairn_real gap = cairn_sqrt(mapper->motion_variance);
    cairn_rigid_motion_pose_prior prior = {mapper->current.match.target_query, gap, gap,
                                           cairn_sqrt(mapper->motion_heading_variance)};
    cairn_sym3 known;

    memset(constraint, 0, sizeof *constraint);
    constraint->low_confidence = mapper->current.low_confidence;
    constraint->heading = heading_basis(mapper);
    constraint->submap = keyframe;
    if (before < 0)
        return;
    if (!mapper->current.has_match) {
        constrain_by_odometry(mapper, constraint);
        return;
    }
    constraint->covariance = relative_covariance(mapper, mapper->loop.constraints[before].submap,
                                                 &prior, mapper->current.extra_covariance);
    if (mapper->loop.constraints[before].low_confidence) {
        constraint->covariance.xx += MAPPER_LOW_CONFIDENCE_M * MAPPER_LOW_CONFIDENCE_M;
        constraint->covariance.yy += MAPPER_LOW_CONFIDENCE_M * MAPPER_LOW_CONFIDENCE_M;
        constraint->covariance.zz += MAPPER_LOW_CONFIDENCE_RAD * MAPPER_LOW_CONFIDENCE_RAD;
    }
    constraint->position_sigma = position_sigma(constraint->covariance);
    if (constraint->low_confidence || !cairn_sym3_inverse(constraint->covariance, &known))
        return;
    while (constraint->anchor_count < MAPPER_MAX_ANCHORS &&
           add_anchor(mapper, constraint, mapper->loop.constraints[before].submap, &known))
        continue;
    if (cairn_sym3_inverse(known, &known))
        constraint->position_sigma = position_sigma(known);
    submap = choose_submap(mapper, constraint, before);
    if (submap >= 0)
        constraint->submap = submap;
}
