/* pose_consensus: block moves at the edges of the maximum spanning tree, and submaps.
 *
 * Method: single-node reassignment cannot move nodes that support each other.
 * 1. Maximum spanning tree of each component by log-likelihood ratio (Prim 1957).
 * 2. Cut at each edge, the smaller side is a block. Every hypothesis between the block and the rest
 *    proposes a pose of the block, and it moves to the pose of the greatest support by all pairs.
 * 3. On request blocks whose support may be due to chance are split off as submaps at the end:
 *    unrelated data also have a best relative pose. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/pose_consensus_work.h"

/* nats: least gain of a block move, above rounding. */
static const cairn_real MIN_GAIN_NATS = CAIRN_REAL(1e-4);

/* Factor on significant_support for a block of several nodes: a chance overlap with the rest is
 * seen, and so counted, by several of its nodes, and a block has more possible poses. */
static const cairn_real BLOCK_FACTOR = 4;

void cairn_consensus_begin_tree(cairn_pose_consensus *consensus)
{
    const cairn_consensus_branch bare = {-1, 0, 0};

    memcpy(consensus->chart, consensus->best,
           (size_t)consensus->node_count * sizeof *consensus->chart);
    for (int32_t i = 0; i < consensus->node_count; i++)
        consensus->tree[i] = bare;
    consensus->parts = 0;
    for (int32_t i = 0; i < consensus->node_count; i++)
        consensus->parts = consensus->chart[i].part >= consensus->parts
                               ? consensus->chart[i].part + 1
                               : consensus->parts;
    consensus->debt += consensus->node_count / 2;
    cairn_consensus_enter(consensus, CAIRN_CONSENSUS_TREE, consensus->node_count);
}

void cairn_consensus_begin_blocks(cairn_pose_consensus *consensus)
{
    if (consensus->result.starts == 0 || consensus->passes >= consensus->params.max_rounds ||
        (consensus->passes > 0 && consensus->total < consensus->result.total)) {
        cairn_consensus_begin_report(consensus);
        return;
    }
    consensus->passes++;
    cairn_consensus_begin_tree(consensus);
}

/* Prim: returns the node outside the trees with the strongest pair to one of them, or else the
 * first one. */
static int32_t next_tree_node(const cairn_pose_consensus *consensus)
{
    int32_t best = -1;

    for (int32_t i = 0; i < consensus->node_count; i++) {
        const cairn_consensus_branch *branch = &consensus->tree[i];

        if (branch->is_in)
            continue;
        if (best < 0 ||
            (branch->parent >= 0 && (consensus->tree[best].parent < 0 ||
                                     branch->evidence > consensus->tree[best].evidence)))
            best = i;
    }
    return best;
}

/* Adds the next node to its tree. */
void cairn_consensus_tree_item(cairn_pose_consensus *consensus)
{
    int32_t node, link, units = 1 + consensus->node_count / 4;

    if (consensus->next == consensus->end) {
        consensus->block = consensus->changed = 0;
        consensus->merge.support = 0;
        if (consensus->is_settled)
            cairn_consensus_enter(consensus, CAIRN_CONSENSUS_PART, consensus->node_count);
        else
            cairn_consensus_enter(consensus, CAIRN_CONSENSUS_BLOCK, 0);
        consensus->debt++;
        return;
    }
    consensus->next++;
    node = next_tree_node(consensus);
    link = consensus->first_link[node];
    consensus->tree[node].is_in = 1;
    for (int32_t i = 0; i < consensus->node_count && consensus->chart[node].part >= 0; i++) {
        cairn_consensus_branch *branch = &consensus->tree[i];
        cairn_real evidence;

        if (branch->is_in || consensus->chart[i].part != consensus->chart[node].part)
            continue;
        evidence = cairn_consensus_evidence(consensus, node, consensus->chart[node].pose, i, &link,
                                            &units);
        if (branch->parent < 0 || evidence > branch->evidence) {
            branch->parent = node;
            branch->evidence = evidence;
        }
    }
    consensus->debt += units + (consensus->first_link[node + 1] - consensus->first_link[node]) / 4;
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

    consensus->whole = consensus->chart[branch].part;
    if (consensus->whole < 0) {
        consensus->chart[branch].part = consensus->parts;
        return 1;
    }
    for (int32_t i = 0; i < consensus->node_count; i++) {
        all += consensus->chart[i].part == consensus->whole;
        below += consensus->chart[i].part == consensus->whole && is_below(consensus, i, branch);
    }
    takes_below = 2 * below <= (is_root ? consensus->node_count : all);
    size = takes_below ? below : all - below;
    for (int32_t i = 0; i < consensus->node_count; i++)
        if (consensus->chart[i].part == consensus->whole &&
            is_below(consensus, i, branch) == takes_below)
            consensus->chart[i].part = consensus->parts;
    consensus->debt += consensus->node_count;
    return size;
}

/* Starts the next block, or the phase after the last. */
void cairn_consensus_block_item(cairn_pose_consensus *consensus)
{
    consensus->debt++;
    while (consensus->block < consensus->node_count && cut_off(consensus, consensus->block) == 0)
        consensus->block++;
    if (consensus->block == consensus->node_count) {
        consensus->rounds = 0;
        if (consensus->changed > 0)
            cairn_consensus_begin_rounds(consensus);
        else
            cairn_consensus_begin_report(consensus);
        return;
    }
    memset(&consensus->merge, 0, sizeof consensus->merge);
    consensus->merge.node = consensus->parts;
    consensus->merge.part = consensus->whole;
    consensus->merge.pose = cairn_turned_of(cairn_pose_identity());
    consensus->merge.current = 1;
    if (consensus->whole >= 0)
        consensus->merge.support = cairn_consensus_merged_support(consensus, &consensus->merge, 1);
    cairn_consensus_enter(consensus, CAIRN_CONSENSUS_PROPOSE, consensus->hypothesis_count);
}

/* Returns the block to its component. */
static void restore_block(cairn_pose_consensus *consensus)
{
    for (int32_t i = 0; i < consensus->node_count; i++)
        if (consensus->chart[i].part == consensus->parts)
            consensus->chart[i].part = consensus->whole;
}

/* Moves the block to its best supported pose, or leaves it. */
static void move_block(cairn_pose_consensus *consensus)
{
    if (!consensus->merge.current && consensus->merge.support >= consensus->params.min_support)
        consensus->changed += cairn_consensus_lay(consensus, &consensus->merge);
    restore_block(consensus);
    consensus->block++;
    cairn_consensus_enter(consensus, CAIRN_CONSENSUS_BLOCK, 0);
}

/* Evaluates the block's pose by the next hypothesis. All pairs of the block are evaluated only when
 * those of the hypothesis' own node have positive support. */
void cairn_consensus_propose_item(cairn_pose_consensus *consensus)
{
    const cairn_kept_hypothesis *h = &consensus->hypotheses[consensus->next];
    cairn_consensus_support own;
    cairn_candidate merge;
    int32_t inside, outside;

    consensus->debt++;
    if (consensus->next == consensus->end) {
        move_block(consensus);
        return;
    }
    consensus->next++;
    inside = consensus->chart[h->first].part == consensus->parts ? h->first : h->second;
    outside = inside == h->first ? h->second : h->first;
    if (consensus->chart[inside].part != consensus->parts || consensus->chart[outside].part < 0 ||
        consensus->chart[outside].part == consensus->parts)
        return;
    memset(&merge, 0, sizeof merge);
    merge.node = consensus->parts;
    merge.part = consensus->chart[outside].part;
    merge.pose =
        cairn_turned_compose(consensus->chart[outside].pose, cairn_consensus_seen_from(h, outside));
    own = cairn_consensus_support_of(consensus, inside, merge.pose, merge.part, 1);
    consensus->debt += own.units;
    if (!(own.sum > 0))
        return;
    merge.pose =
        cairn_turned_compose(merge.pose, cairn_turned_inverse(consensus->chart[inside].pose));
    merge.support = cairn_consensus_merged_support(consensus, &merge, 1);
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
        if (consensus->chart[i].part == consensus->parts) {
            cairn_consensus_support of = cairn_consensus_support_of(
                consensus, i, consensus->chart[i].pose, consensus->whole, 1);

            support += of.sum;
            against += of.against;
            size++;
            consensus->debt += of.units;
        }
    return size > 1 ? BLOCK_FACTOR * consensus->params.believed - (support + against)
                    : consensus->params.believed - (support - against);
}

/* Splits off the nodes below a node as a submap of their own. */
static void split_off(cairn_pose_consensus *consensus, int32_t node)
{
    (void)cut_off(consensus, node);
    memcpy(consensus->best, consensus->chart,
           (size_t)consensus->node_count * sizeof *consensus->best);
}

/* Finds the first node and the size of the next node's submap; an unplaced node is a submap by
 * itself. */
void cairn_consensus_island_item(cairn_pose_consensus *consensus)
{
    int32_t node = consensus->next, size = 0, first = node;

    if (consensus->next == consensus->end) {
        consensus->result.ambiguous = 0;
        cairn_consensus_enter(consensus, CAIRN_CONSENSUS_NUMBER, consensus->node_count);
        return;
    }
    consensus->next++;
    consensus->debt += consensus->node_count - consensus->node_count / 2;
    for (int32_t i = 0; i < consensus->node_count; i++)
        if (i == node || (consensus->chart[node].part >= 0 &&
                          consensus->chart[i].part == consensus->chart[node].part)) {
            first = i < first ? i : first;
            size++;
        }
    consensus->tree[node].parent = first;
    consensus->fill[node] = size;
}

/* Numbers the submap of the next node within its component: larger ones first, of equal ones that
 * of the lower node. Nodes of all but the first are ambiguous. */
void cairn_consensus_number_item(cairn_pose_consensus *consensus)
{
    int32_t own = consensus->next, first;
    cairn_consensus_node *node = &consensus->nodes[own];

    if (consensus->next == consensus->end) {
        cairn_consensus_enter(consensus, CAIRN_CONSENSUS_IDLE, 0);
        return;
    }
    consensus->next++;
    consensus->debt += consensus->node_count / 2;
    first = consensus->tree[own].parent;
    node->island = first < own ? consensus->nodes[first].island : 0;
    for (int32_t i = 0; first == own && i < consensus->node_count; i++)
        node->island += consensus->tree[i].parent == i && consensus->nodes[i].part == node->part &&
                        (consensus->fill[i] > consensus->fill[own] ||
                         (i < own && consensus->fill[i] == consensus->fill[own]));
    node->ambiguous |= node->island > 0;
    consensus->result.ambiguous += node->ambiguous;
}

/* Splits off the block with the greatest missing support, until every remaining link is
 * significant. */
void cairn_consensus_part_item(cairn_pose_consensus *consensus)
{
    consensus->debt++;
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
            consensus->block = node;
        }
    } else if (consensus->merge.support > 0) {
        split_off(consensus, consensus->block);
        cairn_consensus_begin_tree(consensus);
    } else {
        cairn_consensus_enter(consensus, CAIRN_CONSENSUS_ISLANDS, consensus->node_count);
    }
}
