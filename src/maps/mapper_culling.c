/* Keyframe culling: removal of the most redundant keyframes when memory runs low.
 *
 * Method.
 *
 * 1. When little capacity is left, pending closures are optimized first. Then the most redundant
 *    keyframe (mapper_redundancy.c) is culled, one after another until there is some capacity
 *    again.
 * 2. The keyframe is contracted into a neighbour of the graph, the other end of its most
 *    informative link.
 * 3. Each other link becomes one of that neighbour, composed with the best link. Covariances are
 *    added in the frame of the far end. This equals marginalization for a keyframe of two links.
 *    For more links it is approximate: the best link's covariance, the least there is, enters each
 *    of them.
 * 4. A link that duplicates an existing one is fused with it, weighted by information. The result
 *    has at least MIN_VARIANCE_SHARE of the variances `sigma` and `sigma_theta` that all
 *    measurements share. Of two contradictory measurements the one consistent with the current
 *    poses stands.
 *
 * Only keyframes that loop-closure detection has processed may be culled. When it lags far behind,
 * the force field rests and loop closure takes its share of the units. When there is no capacity at
 * all, the force field ends with the poses reached so far.
 *
 * Layout: keyframes are numbered from 0 in order of arrival. After a culling all higher indices
 * decrease by one, wherever they are stored. Only slots of the set keep their numbers.
 *
 * Limits: the first keyframe, which fixes the map, and the most recent ones are never culled. Where
 * links have little capacity, closures are fused into existing links but add no others. */
#include "src/base/build.h"

#include <string.h>

#include "src/base/step.h"
#include "src/maps/mapper_work.h"

enum { UNITS_PER_LINK = 16 /* that is redirected */ };

/* share of the variance of one measurement that a fused one has at least */
static const cairn_real MIN_VARIANCE_SHARE = CAIRN_REAL(0.01);

/* ---- Measurements ---- */

/* A relative pose and its covariance in its own frame. */
typedef struct measurement {
    cairn_pose pose;
    cairn_sym3 covariance;
} measurement;

/* Returns the inverse relative pose with its covariance. */
static measurement invert(measurement m)
{
    measurement out = {cairn_pose_inverse(m.pose),
                       cairn_rigid_motion_adjoint(m.pose, m.covariance)};

    return out;
}

/* Returns the composition of two independent relative poses, covariances to first order. */
static measurement compose(measurement a, measurement b)
{
    measurement out = {
        cairn_pose_compose(a.pose, b.pose),
        cairn_sym3_add(cairn_rigid_motion_adjoint(cairn_pose_inverse(b.pose), a.covariance),
                       b.covariance)};

    return out;
}

/* Returns a link's measurement of its other end relative to `from`. 0: it cannot be inverted. */
static int32_t link_measurement(const cairn_mapper *mapper, int32_t link, int32_t from,
                                measurement *out)
{
    cairn_sym3 information;

    out->pose = cairn_pose_graph_measurement(mapper->loop.graph, link, &information);
    if (!cairn_sym3_inverse(information, &out->covariance))
        return 0;
    if (mapper->loop.links[link].second == from)
        *out = invert(*out);
    return 1;
}

/* Returns the covariance, scaled up to the minimum variance of fused measurements. */
static cairn_sym3 clamp_covariance(const cairn_mapper *mapper, cairn_sym3 m)
{
    cairn_real least = mapper->params.loop.sigma * mapper->params.loop.sigma * MIN_VARIANCE_SHARE;
    cairn_real turn =
        mapper->params.loop.sigma_theta * mapper->params.loop.sigma_theta * MIN_VARIANCE_SHARE;
    cairn_real scale = cairn_max(cairn_max(1, turn / m.zz), cairn_max(least / m.xx, least / m.yy));

    return cairn_sym3_scale(m, scale);
}

/* Fuses two measurements of the same relative pose, weighted by information, to first order. 0:
 * they contradict each other (chi-squared above max_chi2), or a covariance is singular. */
static int32_t fuse(const cairn_mapper *mapper, measurement a, measurement b, measurement *out)
{
    cairn_pose off = cairn_pose_between(a.pose, b.pose);
    cairn_real e[3], w[3], step[3];
    cairn_sym3 ia, ib;

    e[0] = off.x;
    e[1] = off.y;
    e[2] = off.theta;
    if (!cairn_sym3_solve(cairn_sym3_add(a.covariance, b.covariance), e, w) ||
        e[0] * w[0] + e[1] * w[1] + e[2] * w[2] > mapper->params.loop.max_chi2 ||
        !cairn_sym3_inverse(a.covariance, &ia) || !cairn_sym3_inverse(b.covariance, &ib) ||
        !cairn_sym3_inverse(cairn_sym3_add(ia, ib), &out->covariance))
        return 0;
    cairn_sym3_times(a.covariance, w, step);
    off.x = step[0];
    off.y = step[1];
    off.theta = step[2];
    out->pose = cairn_pose_compose(a.pose, off);
    out->covariance = clamp_covariance(mapper, out->covariance);
    return 1;
}

/* ---- The graph ---- */

static int32_t other_end(const mapper_link *link, int32_t keyframe)
{
    return link->first == keyframe ? link->second : link->first;
}

/* Returns the link of a keyframe that follows another one; -1: none. */
static int32_t next_link(const mapper_loop *loop, int32_t link, int32_t keyframe)
{
    return loop->links[link].next[loop->links[link].second == keyframe];
}

/* Returns the link of a keyframe of least variance times chi-squared (at least 1). */
static int32_t most_informative_link(const cairn_mapper *mapper, int32_t keyframe)
{
    const mapper_loop *loop = &mapper->loop;
    cairn_real least = 0;
    int32_t best = -1;

    for (int32_t link = loop->first_link[keyframe]; link >= 0;
         link = next_link(loop, link, keyframe)) {
        const mapper_link *l = &loop->links[link];
        cairn_real chi2 = cairn_max(1, cairn_pose_graph_link_of(loop->graph, link).chi2);
        cairn_real cost = chi2 * (l->variance + l->heading_variance);

        if (l->dropped || (best >= 0 && !(cost < least)))
            continue;
        best = link;
        least = cost;
    }
    return best;
}

/* Returns the link between two keyframes that is in use; -1: none. */
static int32_t link_between(const mapper_loop *loop, int32_t a, int32_t b)
{
    for (int32_t link = loop->first_link[a]; link >= 0; link = next_link(loop, link, a))
        if (other_end(&loop->links[link], a) == b && !loop->links[link].dropped)
            return link;
    return -1;
}

/* Sets the measurement of a link; its first end is the older one. */
static cairn_status set_link(cairn_mapper *mapper, int32_t link, int32_t from, int32_t to,
                             measurement m)
{
    mapper_link *l = &mapper->loop.links[link];
    measurement forth = from < to ? m : invert(m);
    cairn_sym3 information;

    if (!cairn_sym3_inverse(forth.covariance, &information))
        return CAIRN_BAD_ARGUMENT;
    l->first = from < to ? from : to;
    l->second = from < to ? to : from;
    cairn_mapper_set_link_variances(l, forth.covariance);
    return cairn_pose_graph_set_link(mapper->loop.graph, link, l->first, l->second, forth.pose,
                                     information);
}

/* Fuses a link with another measurement between the same keyframes. */
static cairn_status merge_link(cairn_mapper *mapper, int32_t link, int32_t from, int32_t to,
                               measurement m, int32_t is_loop)
{
    mapper_link *l = &mapper->loop.links[link];
    measurement existing, both;

    if (!link_measurement(mapper, link, from, &existing))
        return CAIRN_BAD_ARGUMENT;
    if (!fuse(mapper, existing, m, &both)) {
        cairn_real existing_chi2 =
            cairn_mapper_chi2(mapper, from, to, existing.pose, existing.covariance);

        both = cairn_mapper_chi2(mapper, from, to, m.pose, m.covariance) < existing_chi2 ? m
                                                                                         : existing;
    }
    l->is_loop &= is_loop;
    return set_link(mapper, link, from, to, both);
}

/* Redirects a link of the culled keyframe to the neighbour and attaches it to the neighbour's
 * adjacency list. */
static cairn_status redirect_link(cairn_mapper *mapper, int32_t link, int32_t keyframe,
                                  int32_t neighbour, measurement neighbour_keyframe)
{
    mapper_loop *loop = &mapper->loop;
    mapper_link *l = &loop->links[link];
    int32_t far = other_end(l, keyframe), next = next_link(loop, link, far),
            existing = link_between(loop, neighbour, far);
    measurement key_far, neighbour_far;
    cairn_status status;

    if (far == neighbour)
        return CAIRN_OK;
    if (!link_measurement(mapper, link, keyframe, &key_far))
        return CAIRN_BAD_ARGUMENT;
    neighbour_far = compose(neighbour_keyframe, key_far);
    if (existing >= 0)
        return merge_link(mapper, existing, neighbour, far, neighbour_far, l->is_loop);
    if (l->is_loop && loop->link_count >= 2 * loop->graph_keyframes)
        return CAIRN_OK;
    status = set_link(mapper, link, neighbour, far, neighbour_far);
    l->next[l->second == far] = next;
    cairn_mapper_attach_link(loop, link, l->second == neighbour);
    return status;
}

/* Removes the remaining links of the culled keyframe; rebuilds indices and adjacency lists of the
 * others. */
static void remove_links(cairn_mapper *mapper, int32_t keyframe)
{
    mapper_loop *loop = &mapper->loop;
    int32_t kept = 0;

    mapper->state.loops = 0;
    for (int32_t i = 0; i < loop->graph_keyframes; i++)
        loop->first_link[i] = -1;
    for (int32_t i = 0; i < loop->link_count; i++) {
        mapper_link link = loop->links[i];

        if (link.first == keyframe || link.second == keyframe)
            continue;
        link.first -= link.first > keyframe;
        link.second -= link.second > keyframe;
        loop->links[kept] = link;
        cairn_mapper_attach_link(loop, kept, 0);
        cairn_mapper_attach_link(loop, kept, 1);
        mapper->state.loops += link.is_loop && !link.dropped;
        kept++;
    }
    loop->link_count = kept;
}

/* ---- Renumbering ---- */

/* Maps the culled keyframe to its neighbour and decreases the indices after it. */
static void renumber_keyframe(const cairn_mapper_culling *culling, int32_t *keyframe)
{
    if (*keyframe == culling->keyframe)
        *keyframe = culling->reference;
    else
        *keyframe -= *keyframe > culling->keyframe;
}

void cairn_mapper_reattach(cairn_mapper_culling culling, int32_t *keyframe,
                           cairn_pose *keyframe_scan)
{
    if (*keyframe == culling.keyframe)
        *keyframe_scan = cairn_pose_compose(culling.reference_keyframe, *keyframe_scan);
    renumber_keyframe(&culling, keyframe);
}

/* A submap whose first keyframe is culled gets the index of its next keyframe. What the heading of
 * the culled keyframe rests on, that of the next one does, too. */
static void renumber_submaps(cairn_mapper *mapper, int32_t culled)
{
    mapper_constraint *constraints = mapper->loop.constraints;
    int32_t successor = -1;

    if (culled + 1 < mapper->keyframe_count &&
        constraints[culled + 1].heading < constraints[culled].heading)
        constraints[culled + 1].heading = constraints[culled].heading;
    for (int32_t keyframe = culled + 1; keyframe < mapper->keyframe_count; keyframe++) {
        if (constraints[keyframe].submap == culled) {
            if (successor < 0)
                constraints[keyframe].low_confidence = constraints[culled].low_confidence;
            successor = successor < 0 ? keyframe : successor;
            constraints[keyframe].submap = successor;
        }
    }
}

/* Closes the gap in the arrays indexed by keyframes. */
static void shift_indices(cairn_mapper *mapper, const cairn_mapper_culling *culling)
{
    mapper_loop *loop = &mapper->loop;

    mapper->keyframe_count--;
    for (int32_t keyframe = 0; keyframe < mapper->keyframe_count; keyframe++) {
        int32_t from = keyframe + (keyframe >= culling->keyframe);

        mapper->slot[keyframe] = mapper->slot[from];
        mapper->keyframe_pose[keyframe] = mapper->keyframe_pose[from];
        loop->constraints[keyframe] = loop->constraints[from];
        loop->constraints[keyframe].submap -=
            loop->constraints[keyframe].submap > culling->keyframe;
        for (int32_t i = 0; i < loop->constraints[keyframe].anchor_count; i++)
            renumber_keyframe(culling, &loop->constraints[keyframe].anchors[i]);
        loop->redundancy.score[keyframe] = loop->redundancy.score[from];
        loop->redundancy.neighbour_radius2[keyframe] = loop->redundancy.neighbour_radius2[from];
    }
}

/* Reattaches pending closures to the neighbour. Those that end at the culled keyframe are
 * outdated. */
static void renumber_pending(mapper_loop *loop, const cairn_mapper_culling *culling)
{
    int32_t count =
        loop->pending_count < MAPPER_MAX_PENDING ? loop->pending_count : MAPPER_MAX_PENDING;

    for (int32_t i = 0; i < count; i++) {
        mapper_pending *closure = &loop->pending[i];

        cairn_mapper_reattach(*culling, &closure->event.first, &closure->event.first_second);
        closure->event.second -= closure->event.second >= culling->keyframe;
    }
}

static void renumber_all(cairn_mapper *mapper, const cairn_mapper_culling *culling)
{
    mapper_loop *loop = &mapper->loop;

    renumber_submaps(mapper, culling->keyframe);
    shift_indices(mapper, culling);
    renumber_pending(loop, culling);
    for (int32_t i = 0; i < MAPPER_LOOP_EVENTS; i++) {
        renumber_keyframe(culling, &loop->events[i].first);
        renumber_keyframe(culling, &loop->events[i].second);
    }
    for (int32_t i = 0; i < mapper->target.count; i++)
        renumber_keyframe(culling, &mapper->target.keyframes[i].keyframe);
    cairn_mapper_reattach(*culling, &mapper->result.keyframe, &mapper->result.keyframe_scan);
    loop->graph_keyframes--;
    mapper->state.keyframes = mapper->keyframe_count;
}

/* ---- Culling ---- */

static int32_t link_count_of(const mapper_loop *loop, int32_t keyframe)
{
    int32_t count = 0;

    for (int32_t link = loop->first_link[keyframe]; link >= 0;
         link = next_link(loop, link, keyframe))
        count++;
    return count;
}

/* Culls a keyframe: redirects its links, renumbers. Its memory is free after compaction. */
static cairn_status cull_keyframe(cairn_mapper *mapper, int32_t keyframe)
{
    mapper_loop *loop = &mapper->loop;
    int32_t best = most_informative_link(mapper, keyframe), neighbour, next;
    cairn_mapper_culling *culling =
        &mapper->cullings[mapper->state.culled_keyframes % MAPPER_CULLING_EVENTS];
    measurement neighbour_keyframe;
    cairn_status status;

    /* The graph is connected without its closures. */
    CAIRN_ASSERT(best >= 0);
    neighbour = other_end(&loop->links[best], keyframe);
    status = link_measurement(mapper, best, neighbour, &neighbour_keyframe) ? CAIRN_OK
                                                                            : CAIRN_BAD_ARGUMENT;

    for (int32_t link = loop->first_link[keyframe]; link >= 0 && status == CAIRN_OK; link = next) {
        next = next_link(loop, link, keyframe);
        if (link != best && !loop->links[link].dropped)
            status = redirect_link(mapper, link, keyframe, neighbour, neighbour_keyframe);
    }
    if (status == CAIRN_OK)
        status = cairn_pose_graph_remove_pose(loop->graph, keyframe);
    if (status == CAIRN_OK)
        status = cairn_scan_set_remove(mapper->keyframes, mapper->slot[keyframe]);
    if (status != CAIRN_OK)
        return status;
    culling->keyframe = keyframe;
    culling->reference = neighbour - (neighbour > keyframe);
    culling->reference_keyframe = cairn_mapper_relative_pose(mapper, neighbour, keyframe);
    mapper->state.culled_keyframes =
        mapper->state.culled_keyframes == INT32_MAX ? 0 : mapper->state.culled_keyframes + 1;
    cairn_mapper_invalidate_redundancy_near(mapper, keyframe);
    remove_links(mapper, keyframe);
    renumber_all(mapper, culling);
    loop->factor_full = 0;
    return CAIRN_OK;
}

static int pack_keyframes(cairn_mapper *mapper, cairn_budget *budget)
{
    return cairn_scan_set_pack(mapper->keyframes, budget) != CAIRN_MORE;
}

int cairn_mapper_cull(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper_loop *loop = &mapper->loop;
    mapper_redundancy *redundancy = &loop->redundancy;

    CAIRN_STEP_BEGIN(loop->cull_resume);
    CAIRN_STEP_UNTIL(loop->cull_resume,
                     cairn_mapper_charge_next(mapper, budget, &loop->units_charged, 1));
    CAIRN_STEP_UNTIL(loop->cull_resume,
                     cairn_mapper_run_in_share(mapper, budget, cairn_mapper_score_redundancy));
    CAIRN_STEP_UNTIL(loop->cull_resume,
                     cairn_mapper_charge_next(mapper, budget, &loop->units_charged,
                                              1 + (mapper->keyframe_count + loop->link_count) / 8));
    redundancy->most_redundant = cairn_mapper_most_redundant(mapper);
    CAIRN_STEP_UNTIL(
        loop->cull_resume,
        cairn_mapper_charge_next(mapper, budget, &loop->units_charged,
                                 UNITS_PER_LINK * link_count_of(loop, redundancy->most_redundant)));
    mapper->status = cull_keyframe(mapper, redundancy->most_redundant);
    CAIRN_STEP_UNTIL(loop->cull_resume, cairn_mapper_run_in_share(mapper, budget, pack_keyframes));
    CAIRN_STEP_END(loop->cull_resume);
}
