/* pose_consensus: blocks of nodes that hang by a single pair are laid anew as wholes.
 *
 * Choosing node by node cannot move two nodes that hold each other where they are. The tree of
 * the strongest pairs of the best map (Prim 1957) says where it could come apart: cut at any of
 * its pairs, the smaller side is a block, every hypothesis between the block and the rest
 * proposes where it could lie instead, and it goes where evidence of all pairs is most. On
 * request blocks whose evidence could be chance are told as islands in the end: what has nothing
 * in common lies nowhere to each other, however well it can be fitted. */
#include "src/core/build.h"

#include <string.h>

#include "src/mapping/pose_consensus_work.h"

/* A block moves only for more support than rounding makes. */
static const cairn_real MOVE = CAIRN_REAL(1e-4);

/* Times what one node needs to be believed, for a block of several: what it shares with the rest
 * by chance is seen, and so counted, by several of its nodes, and there are more ways to lay it. */
static const cairn_real SEVERAL = 4;

void cairn_consensus_begin_tree(cairn_pose_consensus *c)
{
    const cairn_consensus_branch bare = {-1, 0, 0};

    memcpy(c->chart, c->best, (size_t)c->node_count * sizeof *c->chart);
    for (int32_t i = 0; i < c->node_count; i++)
        c->tree[i] = bare;
    c->parts = 0;
    for (int32_t i = 0; i < c->node_count; i++)
        c->parts = c->chart[i].part >= c->parts ? c->chart[i].part + 1 : c->parts;
    c->debt += c->node_count / 2;
    cairn_consensus_enter(c, CAIRN_CONSENSUS_TREE, c->node_count);
}

void cairn_consensus_begin_blocks(cairn_pose_consensus *c)
{
    if (c->result.starts == 0 || c->passes >= c->params.max_rounds ||
        (c->passes > 0 && c->total < c->result.total)) {
        cairn_consensus_begin_report(c);
        return;
    }
    c->passes++;
    cairn_consensus_begin_tree(c);
}

/* The node outside the trees with the strongest pair to one of them, or else the first one. */
static int32_t next_branch(const cairn_pose_consensus *c)
{
    int32_t best = -1;

    for (int32_t i = 0; i < c->node_count; i++) {
        const cairn_consensus_branch *branch = &c->tree[i];

        if (branch->is_in)
            continue;
        if (best < 0 || (branch->parent >= 0 &&
                         (c->tree[best].parent < 0 || branch->evidence > c->tree[best].evidence)))
            best = i;
    }
    return best;
}

/* Takes the next node into its tree. */
void cairn_consensus_tree_item(cairn_pose_consensus *c)
{
    int32_t node, link, units = 1 + c->node_count / 4;

    if (c->next == c->end) {
        c->block = c->changed = 0;
        c->merge.support = 0;
        if (c->is_settled)
            cairn_consensus_enter(c, CAIRN_CONSENSUS_PART, c->node_count);
        else
            cairn_consensus_enter(c, CAIRN_CONSENSUS_BLOCK, 0);
        c->debt++;
        return;
    }
    c->next++;
    node = next_branch(c);
    link = c->first_link[node];
    c->tree[node].is_in = 1;
    for (int32_t i = 0; i < c->node_count && c->chart[node].part >= 0; i++) {
        cairn_consensus_branch *branch = &c->tree[i];
        cairn_real evidence;

        if (branch->is_in || c->chart[i].part != c->chart[node].part)
            continue;
        evidence = cairn_consensus_evidence(c, node, c->chart[node].pose, i, &link, &units);
        if (branch->parent < 0 || evidence > branch->evidence) {
            branch->parent = node;
            branch->evidence = evidence;
        }
    }
    c->debt += units + (c->first_link[node + 1] - c->first_link[node]) / 4;
}

/* 1 when the way from a node to the root of its tree leads through `branch`. */
static int hangs_by(const cairn_pose_consensus *c, int32_t node, int32_t branch)
{
    while (node >= 0 && node != branch)
        node = c->tree[node].parent;
    return node == branch;
}

/* Makes the smaller side of the cut above a node a part of its own; of a root, its whole part
 * unless that holds most nodes. Returns its size. */
static int32_t cut_off(cairn_pose_consensus *c, int32_t branch)
{
    int32_t below = 0, all = 0, takes_below, size, is_root = c->tree[branch].parent < 0;

    c->whole = c->chart[branch].part;
    if (c->whole < 0) {
        c->chart[branch].part = c->parts;
        return 1;
    }
    for (int32_t i = 0; i < c->node_count; i++) {
        all += c->chart[i].part == c->whole;
        below += c->chart[i].part == c->whole && hangs_by(c, i, branch);
    }
    takes_below = 2 * below <= (is_root ? c->node_count : all);
    size = takes_below ? below : all - below;
    for (int32_t i = 0; i < c->node_count; i++)
        if (c->chart[i].part == c->whole && hangs_by(c, i, branch) == takes_below)
            c->chart[i].part = c->parts;
    c->debt += c->node_count;
    return size;
}

/* Goes on to the next block, or to what follows the last. */
void cairn_consensus_block_item(cairn_pose_consensus *c)
{
    c->debt++;
    while (c->block < c->node_count && cut_off(c, c->block) == 0)
        c->block++;
    if (c->block == c->node_count) {
        c->rounds = 0;
        if (c->changed > 0)
            cairn_consensus_begin_rounds(c);
        else
            cairn_consensus_begin_report(c);
        return;
    }
    memset(&c->merge, 0, sizeof c->merge);
    c->merge.node = c->parts;
    c->merge.part = c->whole;
    c->merge.pose = cairn_turned_of(cairn_pose_identity());
    c->merge.current = 1;
    if (c->whole >= 0)
        c->merge.support = cairn_consensus_merged_support(c, &c->merge, 1);
    cairn_consensus_enter(c, CAIRN_CONSENSUS_PROPOSE, c->hypothesis_count);
}

/* The block becomes part of the whole again. */
static void join_again(cairn_pose_consensus *c)
{
    for (int32_t i = 0; i < c->node_count; i++)
        if (c->chart[i].part == c->parts)
            c->chart[i].part = c->whole;
}

/* Lays the block where it has most support, or back. */
static void lay_block(cairn_pose_consensus *c)
{
    if (!c->merge.current && c->merge.support >= c->params.min_support)
        c->changed += cairn_consensus_lay(c, &c->merge);
    join_again(c);
    c->block++;
    cairn_consensus_enter(c, CAIRN_CONSENSUS_BLOCK, 0);
}

/* Where the next hypothesis would lay the block. All pairs of the block are weighed only when
 * those of its own node speak for it. */
void cairn_consensus_propose_item(cairn_pose_consensus *c)
{
    const cairn_kept_hypothesis *h = &c->hypotheses[c->next];
    cairn_consensus_support own;
    cairn_candidate merge;
    int32_t inside, outside;

    c->debt++;
    if (c->next == c->end) {
        lay_block(c);
        return;
    }
    c->next++;
    inside = c->chart[h->first].part == c->parts ? h->first : h->second;
    outside = inside == h->first ? h->second : h->first;
    if (c->chart[inside].part != c->parts || c->chart[outside].part < 0 ||
        c->chart[outside].part == c->parts)
        return;
    memset(&merge, 0, sizeof merge);
    merge.node = c->parts;
    merge.part = c->chart[outside].part;
    merge.pose =
        cairn_turned_compose(c->chart[outside].pose, cairn_consensus_seen_from(h, outside));
    own = cairn_consensus_support_of(c, inside, merge.pose, merge.part, 1);
    c->debt += own.units;
    if (!(own.sum > 0))
        return;
    merge.pose = cairn_turned_compose(merge.pose, cairn_turned_inverse(c->chart[inside].pose));
    merge.support = cairn_consensus_merged_support(c, &merge, 1);
    if (merge.support > c->merge.support + MOVE)
        c->merge = merge;
}

/* ---- What is not believed ---- */

/* Nats that the block lacks to be believed where it lies; not above 0: none. Of several nodes
 * all that speaks for them counts: contradictions are those of people who walked there where a
 * block is right, and few where chance was chosen for it. */
static cairn_real lack_of_block(cairn_pose_consensus *c)
{
    cairn_real support = 0, against = 0;
    int32_t size = 0;

    for (int32_t i = 0; i < c->node_count; i++)
        if (c->chart[i].part == c->parts) {
            cairn_consensus_support of =
                cairn_consensus_support_of(c, i, c->chart[i].pose, c->whole, 1);

            support += of.sum;
            against += of.against;
            size++;
            c->debt += of.units;
        }
    return size > 1 ? SEVERAL * c->params.believed - (support + against)
                    : c->params.believed - (support - against);
}

/* What hangs at a node becomes an island of its own. */
static void part_from(cairn_pose_consensus *c, int32_t node)
{
    (void)cut_off(c, node);
    memcpy(c->best, c->chart, (size_t)c->node_count * sizeof *c->best);
}

/* Finds the first node of the next node's island, and how many nodes it has; a node that is not
 * placed is one by itself. */
void cairn_consensus_island_item(cairn_pose_consensus *c)
{
    int32_t node = c->next, size = 0, first = node;

    if (c->next == c->end) {
        c->result.ambiguous = 0;
        cairn_consensus_enter(c, CAIRN_CONSENSUS_NUMBER, c->node_count);
        return;
    }
    c->next++;
    c->debt += c->node_count - c->node_count / 2;
    for (int32_t i = 0; i < c->node_count; i++)
        if (i == node || (c->chart[node].part >= 0 && c->chart[i].part == c->chart[node].part)) {
            first = i < first ? i : first;
            size++;
        }
    c->tree[node].parent = first;
    c->fill[node] = size;
}

/* Numbers the island of the next node within its part of the result: larger ones come first, of
 * equal ones that of the lower node. Nodes of all but the first are in doubt. */
void cairn_consensus_number_item(cairn_pose_consensus *c)
{
    int32_t own = c->next, first;
    cairn_consensus_node *node = &c->nodes[own];

    if (c->next == c->end) {
        cairn_consensus_enter(c, CAIRN_CONSENSUS_IDLE, 0);
        return;
    }
    c->next++;
    c->debt += c->node_count / 2;
    first = c->tree[own].parent;
    node->island = first < own ? c->nodes[first].island : 0;
    for (int32_t i = 0; first == own && i < c->node_count; i++)
        node->island += c->tree[i].parent == i && c->nodes[i].part == node->part &&
                        (c->fill[i] > c->fill[own] || (i < own && c->fill[i] == c->fill[own]));
    node->ambiguous |= node->island > 0;
    c->result.ambiguous += node->ambiguous;
}

/* Of all blocks the one that lacks most is cut off, until all that hangs together is believed. */
void cairn_consensus_part_item(cairn_pose_consensus *c)
{
    c->debt++;
    if (c->next < c->end) {
        int32_t node = c->next++;
        cairn_real lack;

        if (c->tree[node].parent < 0)
            return;
        (void)cut_off(c, node);
        lack = lack_of_block(c);
        join_again(c);
        if (lack > c->merge.support) {
            c->merge.support = lack;
            c->block = node;
        }
    } else if (c->merge.support > 0) {
        part_from(c, c->block);
        cairn_consensus_begin_tree(c);
    } else {
        cairn_consensus_enter(c, CAIRN_CONSENSUS_ISLANDS, c->node_count);
    }
}
