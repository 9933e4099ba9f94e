/* pose_consensus: merging of components. pose_consensus.c describes the method. */
#include "src/base/build.h"

#include <string.h>

#include "src/poses/pose_consensus_work.h"

cairn_real cairn_pose_consensus_merged_support(cairn_pose_consensus *consensus,
                                               const cairn_pose_consensus_candidate *merge,
                                               int32_t by_likelihood)
{
    cairn_real sum = 0;

    for (int32_t i = 0; i < consensus->node_count; i++)
        if (consensus->current[i].component == merge->node) {
            cairn_pose_consensus_support support = cairn_pose_consensus_support_of(
                consensus, i, cairn_pose_consensus_compose(merge->pose, consensus->current[i].pose),
                merge->component, by_likelihood);

            sum += support.sum;
            consensus->units_due += support.units;
        }
    return sum;
}

static void propose_merge(cairn_pose_consensus *consensus,
                          const cairn_pose_consensus_hypothesis *hypothesis)
{
    const cairn_pose_consensus_assignment *first = &consensus->current[hypothesis->first],
                                          *second = &consensus->current[hypothesis->second];
    cairn_pose_consensus_candidate merge;

    memset(&merge, 0, sizeof merge);
    merge.node = second->component;
    merge.component = first->component;
    merge.pose = cairn_pose_consensus_compose(
        cairn_pose_consensus_compose(first->pose, hypothesis->first_second),
        cairn_pose_consensus_inverse(second->pose));
    merge.support = cairn_pose_consensus_merged_support(consensus, &merge, 0);
    if (merge.support > consensus->merge.support)
        consensus->merge = merge;
}

int32_t cairn_pose_consensus_apply_merge(cairn_pose_consensus *consensus,
                                         const cairn_pose_consensus_candidate *merge)
{
    cairn_pose_consensus_pose back = cairn_pose_consensus_inverse(merge->pose);

    for (int32_t i = 0; i < consensus->node_count; i++) {
        consensus->current[i].component_before = consensus->current[i].component;
        if (consensus->current[i].component == merge->node)
            pose_consensus_place(
                consensus, i, cairn_pose_consensus_compose(merge->pose, consensus->current[i].pose),
                merge->component);
    }
    if (cairn_pose_consensus_within_bounds(consensus, merge->component, -1, back, NULL))
        return 1;
    for (int32_t i = 0; i < consensus->node_count; i++)
        if (consensus->current[i].component_before == merge->node)
            pose_consensus_place(consensus, i,
                                 cairn_pose_consensus_compose(back, consensus->current[i].pose),
                                 merge->node);
    return 0;
}

void cairn_pose_consensus_merge_item(cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_hypothesis *h = &consensus->hypotheses[consensus->next];

    consensus->units_due++;
    if (consensus->next < consensus->end) {
        int32_t first = consensus->current[h->first].component,
                second = consensus->current[h->second].component;

        consensus->next++;
        if (first >= 0 && second >= 0 && first != second)
            propose_merge(consensus, h);
    } else if (consensus->merge.support > 0 &&
               cairn_pose_consensus_merged_support(consensus, &consensus->merge, 1) >=
                   consensus->params.min_support &&
               cairn_pose_consensus_apply_merge(consensus, &consensus->merge)) {
        cairn_pose_consensus_begin_rounds(consensus);
    } else {
        consensus->changed_nodes = 0;
        cairn_pose_consensus_enter(
            consensus, POSE_CONSENSUS_REASSIGN,
            consensus->rounds < consensus->params.max_rounds ? consensus->node_count : 0);
        consensus->rounds++;
    }
}
