/* Uncertainty of keyframes in the map.
 *
 * Method. Uncertain are links of the pose graph whose position or heading has a large standard
 * deviation, as those of matches of low confidence, and the first sequential ones after scans without
 * a match: a search may have found the wrong place. Their heading is taken as exact where the odometry
 * agrees with the matches, as in a corridor, where one submap may observe the position and another the
 * heading. Other links are exact, and closures that are likely to be wrong are left out. The
 * uncertainty of a keyframe is that of the path from the first keyframe that has the least variance of
 * the position: a heading error at one link displaces all that follows, by its distance from there. So
 * a stretch where the robot was lost makes all keyframes after it uncertain, until a closure or a
 * constraint to an earlier submap joins them past it. Label correcting (Bellman 1958) over the links in
 * their order, which is mostly that of the path, until no variance falls.
 *
 * Limits: drift over many certain links is not counted. A wrong match of high confidence is taken as
 * exact. */
#include "src/base/build.h"

#include "src/maps/mapper_work.h"

/* m and rad: standard deviations above which a link is uncertain */
static const cairn_real UNCERTAIN_M = CAIRN_REAL(0.2), UNCERTAIN_RAD = CAIRN_REAL(0.07);
/* error probability from which a closure is left out */
static const cairn_real LIKELY_WRONG = CAIRN_REAL(0.1);

/* share of a variance by which a smaller one has to differ: rounding could go round the loops of the
 * graph without end */
static const cairn_real ROUNDING = CAIRN_REAL(0.001);

/* Returns a variance, or 0 when its root is at most `sigma`. */
static cairn_real if_uncertain(cairn_real variance, cairn_real sigma)
{
    return variance > sigma * sigma ? variance : 0;
}

/* A link between two keyframes: variances of the position, m^2, and of the heading, rad^2. */
typedef struct join {
    int32_t first, second;
    cairn_real variance, heading_variance;
} join;

/* Takes the uncertainty of keyframe `to` by way of keyframe `from` when it has less variance; returns 1
 * then. */
static int32_t reach(const cairn_mapper *mapper, cairn_mapper_uncertainty *keyframes, int32_t from,
                     int32_t to, const join *link)
{
    cairn_mapper_uncertainty by = keyframes[from];
    cairn_pose a = mapper->keyframe_pose[from], b = mapper->keyframe_pose[to];
    cairn_vec2 way = {b.x - a.x, b.y - a.y}, turned = cairn_vec2_scale(way, by.heading_variance);

    by.position_variance = cairn_max(by.position_variance + 2 * cairn_vec2_dot(by.covariance, way) +
                                         cairn_vec2_dot(turned, way),
                                     0) +
                           if_uncertain(link->variance, UNCERTAIN_M);
    by.covariance = cairn_vec2_add(by.covariance, turned);
    by.heading_variance += if_uncertain(link->heading_variance, UNCERTAIN_RAD);
    if (!(by.position_variance < (1 - ROUNDING) * keyframes[to].position_variance))
        return 0;
    keyframes[to] = by;
    return 1;
}

/* Relaxes a link both ways; returns how many keyframes have a smaller variance now. A sequential link
 * after scans without a match has their variance at least. */
static int32_t relax(const cairn_mapper *mapper, cairn_mapper_uncertainty *keyframes, join link,
                     int32_t is_loop)
{
    int32_t later = link.first > link.second ? link.first : link.second;
    int32_t heading = is_loop ? MAPPER_HEADING_BY_MATCH : mapper->loop.constraints[later].heading;

    if (heading == MAPPER_HEADING_BY_ODOMETRY)
        link.heading_variance = 0;
    if (heading == MAPPER_HEADING_UNKNOWN) {
        link.variance = cairn_max(link.variance, 2 * MAPPER_UNMATCHED_M * MAPPER_UNMATCHED_M);
        link.heading_variance =
            cairn_max(link.heading_variance, MAPPER_UNMATCHED_RAD * MAPPER_UNMATCHED_RAD);
    }
    return reach(mapper, keyframes, link.first, link.second, &link) +
           reach(mapper, keyframes, link.second, link.first, &link);
}

static int32_t relax_links(const cairn_mapper *mapper, cairn_mapper_uncertainty *keyframes)
{
    int32_t improved = 0;

    for (int32_t i = 0; i < mapper->loop.link_count; i++) {
        const mapper_link *link = &mapper->loop.links[i];
        join one = {link->first, link->second, link->variance, link->heading_variance};

        if (!link->dropped && !(link->is_loop && link->error_probability >= LIKELY_WRONG))
            improved += relax(mapper, keyframes, one, link->is_loop);
    }
    return improved;
}

static join sequential_join(int32_t first, int32_t second, cairn_sym3 covariance)
{
    join link = {first, second, covariance.xx + covariance.yy, covariance.zz};

    return link;
}

/* Keyframes that are not in the graph yet, by their sequential constraints. */
static void relax_pending(const cairn_mapper *mapper, cairn_mapper_uncertainty *keyframes)
{
    for (int32_t k = mapper->loop.graph_keyframes; k < mapper->keyframe_count; k++) {
        const mapper_constraint *constraint = &mapper->loop.constraints[k];

        if (k > 0)
            (void)relax(mapper, keyframes, sequential_join(k - 1, k, constraint->covariance), 0);
        for (int32_t i = 0; i < constraint->anchor_count; i++)
            (void)relax(
                mapper, keyframes,
                sequential_join(constraint->anchors[i], k, constraint->anchor_covariance[i]), 0);
    }
}

cairn_status cairn_mapper_find_uncertainty(const cairn_mapper *mapper,
                                           cairn_mapper_uncertainty *keyframes, int32_t count)
{
    if (count != mapper->keyframe_count || (keyframes == NULL && count > 0))
        return CAIRN_BAD_ARGUMENT;
    if (mapper->loop.graph == NULL)
        return CAIRN_UNSUPPORTED;
    if (keyframes == NULL)
        return CAIRN_OK;
    for (int32_t k = 0; k < count; k++) {
        cairn_mapper_uncertainty exact = {0, {0, 0}, 0}, unknown = {CAIRN_REAL_MAX, {0, 0}, 0};

        keyframes[k] = k == 0 ? exact : unknown;
    }
    for (int32_t sweep = 0; sweep < count && relax_links(mapper, keyframes) > 0; sweep++)
        continue;
    relax_pending(mapper, keyframes);
    return CAIRN_OK;
}
