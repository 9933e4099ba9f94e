/* pose_consensus: block moves at the edges of the maximum spanning tree, and submaps.
 *
 * Method: single-node reassignment cannot move nodes that support each other.
 * 1. Maximum spanning tree of each component by log-likelihood ratio (Prim 1957).
 * 2. Cut at each edge, the smaller side is a block. Every hypothesis between the block and the rest
 *    proposes a pose of the block, and it moves to the pose of the greatest support by all pairs.
 * 3. On request blocks whose support may be due to chance are split off as submaps at the end:
 *    unrelated data also have a best relative pose. */
#include "src/base/build.h"

#include <string.h>

#include "src/poses/pose_consensus_work.h"

/* nats: least gain of a block move, above rounding. */
static const cairn_real MIN_GAIN_NATS = CAIRN_REAL(1e-4);

/* Factor on significant_support for a block of several nodes: a chance overlap with the rest is
 * seen, and so counted, by several of its nodes, and a block has more possible poses. */
static const cairn_real BLOCK_FACTOR = 4;

void cairn_pose_consensus_begin_tree(cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_branch bare = {-1, 0, 0};

    memcpy(consensus->current, consensus->best,
           (size_t)consensus->node_count * sizeof *consensus->current);
    for (int32_t i = 0; i < consensus->node_count; i++)
        consensus->tree[i] = bare;
    consensus->component_count = 0;
    for (int32_t i = 0; i < consensus->node_count; i++)
        consensus->component_count = consensus->current[i].component >= consensus->component_count
                                         ? consensus->current[i].component + 1
                                         : consensus->component_count;
    consensus->units_due += consensus->node_count / 2;
    cairn_pose_consensus_enter(consensus, POSE_CONSENSUS_TREE, consensus->node_count);
}

void cairn_pose_consensus_begin_blocks(cairn_pose_consensus *consensus)
{
    if (consensus->result.starts == 0 || consensus->block_passes >= consensus->params.max_rounds ||
        (consensus->block_passes > 0 && consensus->total < consensus->result.total)) {
        cairn_pose_consensus_begin_report(consensus);
        return;
    }
    consensus->block_passes++;
    cairn_pose_consensus_begin_tree(consensus);
}

/* Prim: returns the node outside the trees with the strongest pair to one of them, or else the
 * first one. */
static int32_t next_tree_node(const cairn_pose_consensus *consensus)
{
    int32_t best = -1;

    for (int32_t i = 0; i < consensus->node_count; i++) {
        const cairn_pose_consensus_branch *branch = &consensus->tree[i];

        if (branch->is_in_tree)
            continue;
        if (best < 0 || (branch->parent >= 0 && (consensus->tree[best].parent < 0 ||
                                                 branch->log_likelihood_ratio >
                                                     consensus->tree[best].log_likelihood_ratio)))
            best = i;
    }
    return best;
}

/* Adds the next node to its tree. */
void cairn_pose_consensus_tree_item(cairn_pose_consensus *consensus)
{
    int32_t node, link, units = 1 + consensus->node_count / 4;

    if (consensus->next == consensus->end) {
        consensus->block_node = consensus->changed_nodes = 0;
        consensus->merge.support = 0;
        if (consensus->is_final)
            cairn_pose_consensus_enter(consensus, POSE_CONSENSUS_SPLIT, consensus->node_count);
        else
            cairn_pose_consensus_enter(consensus, POSE_CONSENSUS_BLOCK, 0);
        consensus->units_due++;
        return;
    }
    consensus->next++;
    node = next_tree_node(consensus);
    link = consensus->first_link[node];
    consensus->tree[node].is_in_tree = 1;
    for (int32_t i = 0; i < consensus->node_count && consensus->current[node].component >= 0; i++) {
        cairn_pose_consensus_branch *branch = &consensus->tree[i];
        cairn_real evidence;

        if (branch->is_in_tree ||
            consensus->current[i].component != consensus->current[node].component)
            continue;
        evidence = cairn_pose_consensus_pair_likelihood(
            consensus, node, consensus->current[node].pose, i, &link, &units);
        if (branch->parent < 0 || evidence > branch->log_likelihood_ratio) {
            branch->parent = node;
            branch->log_likelihood_ratio = evidence;
        }
    }
    consensus->units_due +=
        units + (consensus->first_link[node + 1] - consensus->first_link[node]) / 4;
}

/* Returns 1 when `branch` is on the path from a node to the root of its tree. */
static int is_below(const cairn_pose_consensus *consensus, int32_t node, int32_t branch)
{
    while (node >= 0 && node != branch)
        node = consensus->tree[node].parent;
    return node == branch;
}

/* Makes the smaller side of the cut above a node a component of its own; of a root, its whole
 * component unless that holds most nodes. Returns its size. */
static int32_t cut_off(cairn_pose_consensus *consensus, int32_t branch)
{
    int32_t below = 0, all = 0, takes_below, size, is_root = consensus->tree[branch].parent < 0;

    consensus->block_component = consensus->current[branch].component;
    if (consensus->block_component < 0) {
        consensus->current[branch].component = consensus->component_count;
        return 1;
    }
    for (int32_t i = 0; i < consensus->node_count; i++) {
        all += consensus->current[i].component == consensus->block_component;
        below += consensus->current[i].component == consensus->block_component &&
                 is_below(consensus, i, branch);
    }
    takes_below = 2 * below <= (is_root ? consensus->node_count : all);
    size = takes_below ? below : all - below;
    for (int32_t i = 0; i < consensus->node_count; i++)
        if (consensus->current[i].component == consensus->block_component &&
            is_below(consensus, i, branch) == takes_below)
            consensus->current[i].component = consensus->component_count;
    consensus->units_due += consensus->node_count;
    return size;
}

/* Starts the next block, or the phase after the last. */
void cairn_pose_consensus_block_item(cairn_pose_consensus *consensus)
{
    consensus->units_due++;
    while (consensus->block_node < consensus->node_count &&
           cut_off(consensus, consensus->block_node) == 0)
        consensus->block_node++;
    if (consensus->block_node == consensus->node_count) {
        consensus->rounds = 0;
        if (consensus->changed_nodes > 0)
            cairn_pose_consensus_begin_rounds(consensus);
        else
            cairn_pose_consensus_begin_report(consensus);
        return;
    }
    memset(&consensus->merge, 0, sizeof consensus->merge);
    consensus->merge.node = consensus->component_count;
    consensus->merge.component = consensus->block_component;
    consensus->merge.pose = cairn_pose_consensus_pose_of(cairn_pose_identity());
    consensus->merge.is_current = 1;
    if (consensus->block_component >= 0)
        consensus->merge.support =
            cairn_pose_consensus_merged_support(consensus, &consensus->merge, 1);
    cairn_pose_consensus_enter(consensus, POSE_CONSENSUS_PROPOSE, consensus->hypothesis_count);
}

/* Returns the block to its component. */
static void restore_block(cairn_pose_consensus *consensus)
{
    for (int32_t i = 0; i < consensus->node_count; i++)
        if (consensus->current[i].component == consensus->component_count)
            consensus->current[i].component = consensus->block_component;
}

/* Moves the block to its best supported pose, or leaves it. */
static void move_block(cairn_pose_consensus *consensus)
{
    if (!consensus->merge.is_current && consensus->merge.support >= consensus->params.min_support)
        consensus->changed_nodes += cairn_pose_consensus_apply_merge(consensus, &consensus->merge);
    restore_block(consensus);
    consensus->block_node++;
    cairn_pose_consensus_enter(consensus, POSE_CONSENSUS_BLOCK, 0);
}

/* Evaluates the block's pose by the next hypothesis. All pairs of the block are evaluated only when
 * those of the hypothesis' own node have positive support. */
void cairn_pose_consensus_propose_item(cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_hypothesis *h = &consensus->hypotheses[consensus->next];
    cairn_pose_consensus_support own;
    cairn_pose_consensus_candidate merge;
    int32_t inside, outside;

    consensus->units_due++;
    if (consensus->next == consensus->end) {
        move_block(consensus);
        return;
    }
    consensus->next++;
    inside =
        consensus->current[h->first].component == consensus->component_count ? h->first : h->second;
    outside = inside == h->first ? h->second : h->first;
    if (consensus->current[inside].component != consensus->component_count ||
        consensus->current[outside].component < 0 ||
        consensus->current[outside].component == consensus->component_count)
        return;
    memset(&merge, 0, sizeof merge);
    merge.node = consensus->component_count;
    merge.component = consensus->current[outside].component;
    merge.pose = cairn_pose_consensus_compose(consensus->current[outside].pose,
                                              cairn_pose_consensus_relative_to(h, outside));
    own = cairn_pose_consensus_support_of(consensus, inside, merge.pose, merge.component, 1);
    consensus->units_due += own.units;
    if (!(own.sum > 0))
        return;
    merge.pose = cairn_pose_consensus_compose(
        merge.pose, cairn_pose_consensus_inverse(consensus->current[inside].pose));
    merge.support = cairn_pose_consensus_merged_support(consensus, &merge, 1);
    if (merge.support > consensus->merge.support + MIN_GAIN_NATS)
        consensus->merge = merge;
}

/* ---- Submaps ---- */

/* Returns the missing support of a block, nats; not above 0: it is significant. For several nodes
 * the violations are not subtracted: where a block is right, they come from moving people, and
 * where chance chose it there are few. */
static cairn_real missing_support(cairn_pose_consensus *consensus)
{
    cairn_real support = 0, against = 0;
    int32_t size = 0;

    for (int32_t i = 0; i < consensus->node_count; i++)
        if (consensus->current[i].component == consensus->component_count) {
            cairn_pose_consensus_support of = cairn_pose_consensus_support_of(
                consensus, i, consensus->current[i].pose, consensus->block_component, 1);

            support += of.sum;
            against += of.violations;
            size++;
            consensus->units_due += of.units;
        }
    return size > 1 ? BLOCK_FACTOR * consensus->params.significant_support - (support + against)
                    : consensus->params.significant_support - (support - against);
}

/* Splits off the nodes below a node as a submap of their own. */
static void split_off(cairn_pose_consensus *consensus, int32_t node)
{
    (void)cut_off(consensus, node);
    memcpy(consensus->best, consensus->current,
           (size_t)consensus->node_count * sizeof *consensus->best);
}

/* Finds the first node and the size of the next node's submap; an unplaced node is a submap by
 * itself. */
void cairn_pose_consensus_submap_item(cairn_pose_consensus *consensus)
{
    int32_t node = consensus->next, size = 0, first = node;

    if (consensus->next == consensus->end) {
        consensus->result.ambiguous = 0;
        cairn_pose_consensus_enter(consensus, POSE_CONSENSUS_NUMBER_SUBMAPS, consensus->node_count);
        return;
    }
    consensus->next++;
    consensus->units_due += consensus->node_count - consensus->node_count / 2;
    for (int32_t i = 0; i < consensus->node_count; i++)
        if (i == node || (consensus->current[node].component >= 0 &&
                          consensus->current[i].component == consensus->current[node].component)) {
            first = i < first ? i : first;
            size++;
        }
    consensus->tree[node].parent = first;
    consensus->next_free[node] = size;
}

/* Numbers the submap of the next node within its component: larger ones first, of equal ones that
 * of the lower node. Nodes of all but the first are ambiguous. */
void cairn_pose_consensus_number_item(cairn_pose_consensus *consensus)
{
    int32_t own = consensus->next, first;
    cairn_pose_consensus_estimate *node = &consensus->nodes[own];

    if (consensus->next == consensus->end) {
        cairn_pose_consensus_enter(consensus, POSE_CONSENSUS_IDLE, 0);
        return;
    }
    consensus->next++;
    consensus->units_due += consensus->node_count / 2;
    first = consensus->tree[own].parent;
    node->submap = first < own ? consensus->nodes[first].submap : 0;
    for (int32_t i = 0; first == own && i < consensus->node_count; i++)
        node->submap += consensus->tree[i].parent == i &&
                        consensus->nodes[i].component == node->component &&
                        (consensus->next_free[i] > consensus->next_free[own] ||
                         (i < own && consensus->next_free[i] == consensus->next_free[own]));
    node->ambiguous |= node->submap > 0;
    consensus->result.ambiguous += node->ambiguous;
}

/* Splits off the block with the greatest missing support, until every remaining link is
 * significant. */
void cairn_pose_consensus_split_item(cairn_pose_consensus *consensus)
{
    consensus->units_due++;
    if (consensus->next < consensus->end) {
        int32_t node = consensus->next++;
        cairn_real lack;

        if (consensus->tree[node].parent < 0)
            return;
        (void)cut_off(consensus, node);
        lack = missing_support(consensus);
        restore_block(consensus);
        if (lack > consensus->merge.support) {
            consensus->merge.support = lack;
            consensus->block_node = node;
        }
    } else if (consensus->merge.support > 0) {
        split_off(consensus, consensus->block_node);
        cairn_pose_consensus_begin_tree(consensus);
    } else {
        cairn_pose_consensus_enter(consensus, POSE_CONSENSUS_SUBMAPS, consensus->node_count);
    }
}
