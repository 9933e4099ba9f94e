/* Back end of the mapper: the pose graph of keyframes and its optimization.
 *
 * Method.
 *
 * 1. Every keyframe is linked to those that constrain it (mapper_constraint.c) by the relative pose
 *    after local map matching and force field. Loop closures link keyframes that are far apart in
 *    time.
 * 2. An optimization solves for all keyframe poses (pose_graph, Huber kernel) and is applied as a
 *    whole. Keyframes stored since then move rigidly with the last one in the graph.
 * 3. A closure whose chi-squared exceeds loop.max_chi2 afterwards is removed as an outlier, and the
 *    graph is optimized again. */
#include "src/base/build.h"

#include "src/base/step.h"
#include "src/maps/mapper_work.h"

/* An optimization costs about as much as the loop search of (keyframes in the graph / 48)
 * keyframes. */
enum { KEYFRAMES_PER_SOLVE = 48 };

/* chi-squared of a closure that triggers an optimization at once */
static const cairn_real URGENT_CHI2 = 100;

void cairn_mapper_record_loop(cairn_mapper *mapper, const cairn_mapper_loop *event)
{
    mapper->loop.events[mapper->state.loop_events % MAPPER_LOOP_EVENTS] = *event;
    mapper->state.loop_events =
        mapper->state.loop_events == INT32_MAX ? 0 : mapper->state.loop_events + 1;
}

cairn_sym3 cairn_mapper_own_covariance(const cairn_mapper *mapper, const cairn_real covariance[9],
                                       cairn_real theta)
{
    const cairn_mapper_loop_params *p = &mapper->params.loop;
    cairn_sym3 own = cairn_sym3_rotate_by(cairn_sym3_of_full(covariance), -theta);

    own.xx += p->sigma * p->sigma;
    own.yy += p->sigma * p->sigma;
    own.zz += p->sigma_theta * p->sigma_theta;
    return own;
}

void cairn_mapper_attach_link(mapper_loop *loop, int32_t link, int32_t end)
{
    int32_t keyframe = end ? loop->links[link].second : loop->links[link].first;

    loop->links[link].next[end] = loop->first_link[keyframe];
    loop->first_link[keyframe] = link;
}

void cairn_mapper_set_link_variances(mapper_link *link, cairn_sym3 covariance)
{
    link->variance = covariance.xx + covariance.yy;
    link->anisotropy.x = covariance.xx - covariance.yy;
    link->anisotropy.y = 2 * covariance.xy;
    link->heading_variance = covariance.zz;
}

/* Adds a link to the graph and to the adjacency lists. */
static cairn_status add_link(cairn_mapper *mapper, int32_t first, int32_t second,
                             cairn_pose first_second, cairn_sym3 covariance, int32_t is_loop)
{
    mapper_loop *loop = &mapper->loop;
    mapper_link *link = &loop->links[loop->link_count];
    cairn_sym3 information;
    cairn_status status;

    if (!cairn_sym3_inverse(covariance, &information))
        return CAIRN_BAD_ARGUMENT;
    status = cairn_pose_graph_add_link(loop->graph, first, second, first_second, information);
    if (status != CAIRN_OK)
        return status;
    link->first = first;
    link->second = second;
    cairn_mapper_set_link_variances(link, covariance);
    link->is_loop = is_loop;
    link->dropped = 0;
    cairn_mapper_attach_link(loop, loop->link_count, 0);
    cairn_mapper_attach_link(loop, loop->link_count, 1);
    loop->link_count++;
    return CAIRN_OK;
}

cairn_status cairn_mapper_add_to_graph(cairn_mapper *mapper)
{
    mapper_loop *loop = &mapper->loop;
    int32_t keyframe = loop->graph_keyframes;
    cairn_status status = cairn_pose_graph_add_pose(loop->graph, mapper->keyframe_pose[keyframe]);

    CAIRN_ASSERT(status == CAIRN_OK);
    loop->first_link[keyframe] = -1;
    loop->graph_keyframes++;
    if (keyframe > 0)
        status = add_link(mapper, keyframe - 1, keyframe,
                          cairn_mapper_relative_pose(mapper, keyframe - 1, keyframe),
                          loop->constraints[keyframe].covariance, 0);
    for (int32_t i = 0; i < loop->constraints[keyframe].anchor_count && status == CAIRN_OK; i++) {
        int32_t anchor = loop->constraints[keyframe].anchors[i];

        if (loop->link_count - loop->graph_keyframes + 1 >= mapper->params.loop.max_loops)
            break;
        status =
            add_link(mapper, anchor, keyframe, cairn_mapper_relative_pose(mapper, anchor, keyframe),
                     loop->constraints[keyframe].anchor_covariance[i], 0);
    }
    return status;
}

cairn_real cairn_mapper_chi2(const cairn_mapper *mapper, int32_t first, int32_t second,
                             cairn_pose first_second, cairn_sym3 covariance)
{
    cairn_pose e =
        cairn_pose_between(first_second, cairn_mapper_relative_pose(mapper, first, second));
    cairn_real error[3], solved[3];

    error[0] = e.x;
    error[1] = e.y;
    error[2] = e.theta;
    if (!cairn_sym3_solve(covariance, error, solved))
        return 0;
    return error[0] * solved[0] + error[1] * solved[1] + error[2] * solved[2];
}

cairn_status cairn_mapper_add_closure(cairn_mapper *mapper, const cairn_mapper_loop *event,
                                      cairn_sym3 covariance)
{
    mapper_loop *loop = &mapper->loop;
    cairn_status status;

    if (loop->link_count - (loop->graph_keyframes - 1) == mapper->params.loop.max_loops)
        return CAIRN_FULL;
    status = add_link(mapper, event->first, event->second, event->first_second, covariance, 1);
    if (status != CAIRN_OK)
        return status;
    loop->links[loop->link_count - 1].error_probability = event->error_probability;
    loop->largest_chi2 =
        cairn_max(loop->largest_chi2, cairn_mapper_chi2(mapper, event->first, event->second,
                                                        event->first_second, covariance));
    loop->unsolved_closures++;
    mapper->state.loops++;
    return CAIRN_OK;
}

int32_t cairn_mapper_needs_optimization(const cairn_mapper *mapper)
{
    const mapper_loop *loop = &mapper->loop;

    if (loop->unsolved_closures == 0 || loop->factor_full)
        return 0;
    return loop->largest_chi2 > URGENT_CHI2 ||
           loop->keyframes_since_solve > 8 + loop->graph_keyframes / KEYFRAMES_PER_SOLVE;
}

/* Applies the solution to the keyframe poses. */
static void apply_solution(cairn_mapper *mapper)
{
    mapper_loop *loop = &mapper->loop;
    int32_t last = loop->graph_keyframes - 1;
    cairn_pose before = mapper->keyframe_pose[last],
               after = cairn_pose_graph_pose(loop->graph, last);

    for (int32_t keyframe = 0; keyframe <= last; keyframe++)
        mapper->keyframe_pose[keyframe] = cairn_pose_graph_pose(loop->graph, keyframe);
    for (int32_t keyframe = last + 1; keyframe < mapper->keyframe_count; keyframe++)
        mapper->keyframe_pose[keyframe] =
            cairn_pose_compose(after, cairn_pose_between(before, mapper->keyframe_pose[keyframe]));
    mapper->target.is_stale = 1;
    if (mapper->params.cull_keyframes)
        cairn_mapper_invalidate_redundancy(mapper);
    mapper->state.graph_solutions++;
}

/* Removes the closures that are outliers; returns their number. */
static int32_t drop_outliers(cairn_mapper *mapper)
{
    mapper_loop *loop = &mapper->loop;
    int32_t dropped = 0;

    for (int32_t i = 0; i < loop->link_count; i++) {
        mapper_link *link = &loop->links[i];
        cairn_mapper_loop outlier = {.first = link->first,
                                     .second = link->second,
                                     .verdict = CAIRN_MAPPER_LOOP_OUTLIER,
                                     .error_probability = 1};

        if (!link->is_loop || link->dropped ||
            !(cairn_pose_graph_link_of(loop->graph, i).chi2 > mapper->params.loop.max_chi2) ||
            cairn_pose_graph_exclude_link(loop->graph, i, 1) != CAIRN_OK)
            continue;
        link->dropped = 1;
        cairn_mapper_record_loop(mapper, &outlier);
        dropped++;
    }
    mapper->state.loops -= dropped;
    return dropped;
}

static int solve(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper->loop.graph_status = cairn_pose_graph_step(mapper->loop.graph, budget);
    return mapper->loop.graph_status != CAIRN_MORE;
}

int cairn_mapper_optimize(cairn_mapper *mapper, cairn_budget *budget)
{
    mapper_loop *loop = &mapper->loop;

    CAIRN_STEP_BEGIN(loop->optimize_resume);
    CAIRN_STEP_UNTIL(loop->optimize_resume,
                     cairn_mapper_charge_next(mapper, budget, &loop->units_charged,
                                              1 + (loop->graph_keyframes + loop->link_count) / 8));
    loop->graph_status = cairn_pose_graph_solve(loop->graph);
    if (loop->graph_status == CAIRN_OK)
        CAIRN_STEP_UNTIL(loop->optimize_resume, cairn_mapper_run_in_share(mapper, budget, solve));
    loop->unsolved_closures = loop->keyframes_since_solve = 0;
    loop->largest_chi2 = 0;
    if (loop->graph_status == CAIRN_OK) {
        CAIRN_STEP_UNTIL(
            loop->optimize_resume,
            cairn_mapper_charge_next(mapper, budget, &loop->units_charged,
                                     1 + mapper->keyframe_count / 4 + loop->link_count / 8));
        apply_solution(mapper);
        if (drop_outliers(mapper) > 0)
            loop->unsolved_closures = 1;
    } else {
        loop->factor_full = 1;
        mapper->state.capacity_exceeded = 2;
    }
    CAIRN_STEP_END(loop->optimize_resume);
}
