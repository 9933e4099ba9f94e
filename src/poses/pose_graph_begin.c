/* pose_graph: start of a solution: connectivity by union-find, and the solver's sparsity
 * structure. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/disjoint_sets.h"
#include "src/poses/pose_graph_work.h"

/* Returns the first pose that is not connected to a fixed one; -1: none. */
static int32_t find_disconnected(cairn_pose_graph *graph)
{
    int32_t stays = -1;

    disjoint_sets_reset(graph->root, graph->state.poses);
    for (int32_t i = 0; i < graph->state.poses; i++)
        if (cairn_pose_graph_is_fixed(graph, i)) {
            if (stays >= 0)
                (void)disjoint_sets_unite(graph->root, stays, i);
            stays = i;
        }
    for (int32_t l = 0; l < graph->state.links; l++)
        if (!graph->links[l].is_excluded)
            (void)disjoint_sets_unite(graph->root, graph->links[l].first, graph->links[l].second);
    for (int32_t i = 0; i < graph->state.poses; i++)
        if (disjoint_sets_root(graph->root, i) != disjoint_sets_root(graph->root, stays))
            return i;
    return -1;
}

/* Gives the solver the sparsity structure. */
static cairn_status begin_structure(cairn_pose_graph *graph)
{
    cairn_status status = graph->solver.begin(graph->solver.context, graph->state.poses);

    for (int32_t l = 0; l < graph->state.links && status == CAIRN_OK; l++)
        status = graph->solver.add_link(graph->solver.context, graph->links[l].first,
                                        graph->links[l].second);
    return status == CAIRN_OK ? graph->solver.analyze(graph->solver.context) : status;
}

cairn_status cairn_pose_graph_solve(cairn_pose_graph *graph)
{
    cairn_pose_graph_state fresh;

    if (graph == NULL || !cairn_pose_graph_is_idle(graph))
        return CAIRN_BAD_ARGUMENT;
    if (graph->state.poses == 0)
        return CAIRN_EMPTY;
    memset(&fresh, 0, sizeof fresh);
    fresh.poses = graph->state.poses;
    fresh.links = graph->state.links;
    fresh.fill = graph->analyzed ? graph->state.fill : 0;
    fresh.pose = find_disconnected(graph);
    graph->is_solution = 0;
    graph->has_marginals = 0;
    if (fresh.pose >= 0) {
        fresh.verdict = CAIRN_POSE_GRAPH_DISCONNECTED;
        graph->state = fresh;
        return CAIRN_OK;
    }
    if (!graph->analyzed) {
        cairn_status status = begin_structure(graph);

        if (status != CAIRN_OK)
            return status;
    }
    graph->state = fresh;
    graph->newton.kernel_scale = 1;
    graph->newton.step_fraction = 1;
    graph->newton.is_watchdog_step = 0;
    memcpy(graph->trial, graph->poses, (size_t)fresh.poses * sizeof *graph->trial);
    graph->is_solving = 1;
    return CAIRN_OK;
}

cairn_status cairn_pose_graph_marginals(cairn_pose_graph *graph)
{
    if (graph == NULL || !cairn_pose_graph_is_idle(graph) || !graph->is_solution)
        return CAIRN_BAD_ARGUMENT;
    graph->has_marginals = 0;
    graph->newton.kernel_scale = 1;
    graph->is_inverting = 1;
    return CAIRN_OK;
}
