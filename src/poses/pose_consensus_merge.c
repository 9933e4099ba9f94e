/* pose_consensus: merging of components. pose_consensus.c describes the method. */
#include "src/base/build.h"

#include <string.h>

#include "src/poses/pose_consensus_work.h"

void cairn_pose_consensus_set_merger(cairn_pose_consensus *consensus,
                                     const cairn_pose_consensus_candidate *merge,
                                     cairn_pose_consensus_evidence evidence)
{
    consensus->merger.tried = *merge;
    consensus->merger.evidence = evidence;
}

/* Sets the query: the support of the visited node of the component that is moved. */
static void query_moved(cairn_pose_consensus *consensus)
{
    const struct pose_consensus_merger *merger = &consensus->merger;
    cairn_pose_consensus_pose moved =
        cairn_pose_consensus_compose(&merger->tried.pose, &consensus->current[merger->node].pose);

    cairn_pose_consensus_set_query(consensus, merger->node, &moved, merger->tried.component,
                                   merger->evidence);
}

int cairn_pose_consensus_find_merged_support(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    struct pose_consensus_merger *merger = &consensus->merger;

    CAIRN_STEP_BEGIN(consensus->resume.sum);
    CAIRN_STEP_CHARGE(consensus, resume.sum, budget, cairn_pose_consensus_node_units(consensus));
    merger->tried.support = merger->tried.violations = 0;
    merger->size = 0;
    for (merger->node = 0; merger->node < consensus->node_count; merger->node++) {
        if (consensus->current[merger->node].component != merger->tried.node)
            continue;
        query_moved(consensus);
        CAIRN_STEP_RUN(consensus, resume.sum, budget, cairn_pose_consensus_find_support);
        merger->tried.support += consensus->query.found.sum;
        merger->tried.violations += consensus->query.found.violations;
        merger->size++;
    }
    CAIRN_STEP_END(consensus->resume.sum);
}

/* Returns 1 when a hypothesis joins two components. */
static int joins_parts(const cairn_pose_consensus *consensus, int32_t hypothesis)
{
    const cairn_pose_consensus_hypothesis *h = &consensus->hypotheses[hypothesis];
    int32_t first = consensus->current[h->first].component,
            second = consensus->current[h->second].component;

    return first >= 0 && second >= 0 && first != second;
}

/* Sets the merge of the two components that a hypothesis joins. */
static void set_merger(cairn_pose_consensus *consensus, int32_t hypothesis)
{
    const cairn_pose_consensus_hypothesis *h = &consensus->hypotheses[hypothesis];
    const cairn_pose_consensus_assignment *first = &consensus->current[h->first],
                                          *second = &consensus->current[h->second];
    cairn_pose_consensus_pose placed = cairn_pose_consensus_compose(&first->pose, &h->first_second),
                              inverse = cairn_pose_consensus_inverse(&second->pose);
    cairn_pose_consensus_candidate merge;

    memset(&merge, 0, sizeof merge);
    merge.node = second->component;
    merge.component = first->component;
    merge.pose = cairn_pose_consensus_compose(&placed, &inverse);
    cairn_pose_consensus_set_merger(consensus, &merge, POSE_CONSENSUS_BY_HYPOTHESES);
}

/* Keeps the merge whose support was found, when it is the best so far. */
static void keep_merge(cairn_pose_consensus *consensus)
{
    if (consensus->merger.tried.support > consensus->merge.support)
        consensus->merge = consensus->merger.tried;
}

int32_t cairn_pose_consensus_merge_units(const cairn_pose_consensus *consensus)
{
    return cairn_pose_consensus_copy_units(consensus) + cairn_pose_consensus_bound_units(consensus);
}

/* Moves the nodes that were in a component before the merge, into the component `to`. */
static void move_nodes(cairn_pose_consensus *consensus, const cairn_pose_consensus_pose *motion,
                       int32_t from, int32_t to)
{
    for (int32_t i = 0; i < consensus->node_count; i++)
        if (consensus->current[i].component_before == from) {
            consensus->current[i].pose =
                cairn_pose_consensus_compose(motion, &consensus->current[i].pose);
            consensus->current[i].component = to;
        }
}

int32_t cairn_pose_consensus_apply_merge(cairn_pose_consensus *consensus,
                                         const cairn_pose_consensus_candidate *merge)
{
    cairn_pose_consensus_pose back = cairn_pose_consensus_inverse(&merge->pose);

    for (int32_t i = 0; i < consensus->node_count; i++)
        consensus->current[i].component_before = consensus->current[i].component;
    move_nodes(consensus, &merge->pose, merge->node, merge->component);
    if (cairn_pose_consensus_within_bounds(consensus, merge->component, -1, NULL, NULL))
        return 1;
    move_nodes(consensus, &back, merge->node, merge->node);
    return 0;
}

int cairn_pose_consensus_merge_parts(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(consensus->resume.part);
    consensus->merge.support = 0;
    consensus->is_merged = 0;
    for (consensus->hypothesis = 0; consensus->hypothesis < consensus->hypothesis_count;
         consensus->hypothesis++) {
        CAIRN_STEP_CHARGE_UNIT(consensus, resume.part, budget);
        if (!joins_parts(consensus, consensus->hypothesis))
            continue;
        set_merger(consensus, consensus->hypothesis);
        CAIRN_STEP_RUN(consensus, resume.part, budget, cairn_pose_consensus_find_merged_support);
        keep_merge(consensus);
    }
    if (consensus->merge.support > 0) {
        cairn_pose_consensus_set_merger(consensus, &consensus->merge, POSE_CONSENSUS_BY_ALL);
        CAIRN_STEP_RUN(consensus, resume.part, budget, cairn_pose_consensus_find_merged_support);
        CAIRN_STEP_CHARGE(consensus, resume.part, budget,
                          cairn_pose_consensus_merge_units(consensus));
        consensus->is_merged = consensus->merger.tried.support >= consensus->params.min_support &&
                               cairn_pose_consensus_apply_merge(consensus, &consensus->merge);
    }
    CAIRN_STEP_END(consensus->resume.part);
}
