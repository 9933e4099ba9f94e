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

/* ---- Maximum spanning trees ---- */

/* The best map becomes the current one, without trees. */
static void begin_tree(cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_branch bare = {-1, 0, 0};

    memcpy(consensus->current, consensus->best,
           (size_t)consensus->node_count * sizeof *consensus->current);
    consensus->component_count = 0;
    for (int32_t i = 0; i < consensus->node_count; i++) {
        consensus->tree[i] = bare;
        if (consensus->current[i].component >= consensus->component_count)
            consensus->component_count = consensus->current[i].component + 1;
    }
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

/* Adds the strongest node to its tree, keeps the order, and starts with the pairs of the node. */
static void add_to_tree(cairn_pose_consensus *consensus)
{
    int32_t node = next_tree_node(consensus);

    consensus->next_free[consensus->visited] = node;
    consensus->tree[node].is_in_tree = 1;
    cairn_pose_consensus_query_current(consensus, node, POSE_CONSENSUS_BY_PAIRS);
}

/* Returns 1 when the pair of the query may become an edge. */
static int may_branch(const cairn_pose_consensus *consensus)
{
    const struct pose_consensus_query *query = &consensus->query;

    return query->component >= 0 && !consensus->tree[query->other].is_in_tree &&
           consensus->current[query->other].component == query->component;
}

/* Keeps the pair of the query as the edge of its other node, when it is the strongest so far. */
static void keep_branch(cairn_pose_consensus *consensus)
{
    cairn_pose_consensus_branch *branch = &consensus->tree[consensus->query.other];

    if (branch->parent < 0 || consensus->query.ratio > branch->log_likelihood_ratio) {
        branch->parent = consensus->query.node;
        branch->log_likelihood_ratio = consensus->query.ratio;
    }
}

/* Step of a part: the maximum spanning trees of the best map, which becomes the current one. */
static int build_tree(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    struct pose_consensus_query *query = &consensus->query;

    CAIRN_STEP_BEGIN(consensus->resume.part);
    CAIRN_STEP_CHARGE(consensus, resume.part, budget, cairn_pose_consensus_copy_units(consensus));
    begin_tree(consensus);
    for (consensus->visited = 0; consensus->visited < consensus->node_count; consensus->visited++) {
        CAIRN_STEP_CHARGE(consensus, resume.part, budget,
                          cairn_pose_consensus_copy_units(consensus));
        add_to_tree(consensus);
        CAIRN_STEP_CHARGE(consensus, resume.part, budget,
                          cairn_pose_consensus_link_units(consensus, query->node));
        for (query->other = 0; query->other < consensus->node_count; query->other++) {
            if (!may_branch(consensus))
                continue;
            CAIRN_STEP_UNTIL(consensus->resume.part,
                             cairn_pose_consensus_find_pair(consensus, budget));
            keep_branch(consensus);
        }
    }
    CAIRN_STEP_END(consensus->resume.part);
}

/* ---- Block moves ---- */

/* Marks the nodes at and below a node of its tree in component_before. In the order of the trees a
 * parent comes before its children. */
static void mark_below(cairn_pose_consensus *consensus, int32_t branch)
{
    cairn_pose_consensus_assignment *current = consensus->current;

    for (int32_t k = 0; k < consensus->node_count; k++) {
        int32_t node = consensus->next_free[k], parent = consensus->tree[node].parent;

        current[node].component_before =
            node == branch || (parent >= 0 && current[parent].component_before);
    }
}

/* Makes the smaller side of the cut above a node a component of its own; of a root, its whole
 * component unless that holds most nodes. Returns its size. */
static int32_t cut_off(cairn_pose_consensus *consensus, int32_t branch)
{
    cairn_pose_consensus_assignment *current = consensus->current;
    int32_t part = current[branch].component, below = 0, all = 0, takes_below;

    consensus->block.component = part;
    if (part < 0) {
        current[branch].component = consensus->component_count;
        return 1;
    }
    mark_below(consensus, branch);
    for (int32_t i = 0; i < consensus->node_count; i++)
        if (current[i].component == part) {
            all++;
            below += current[i].component_before;
        }
    takes_below = 2 * below <= (consensus->tree[branch].parent < 0 ? consensus->node_count : all);
    for (int32_t i = 0; i < consensus->node_count; i++)
        if (current[i].component == part && current[i].component_before == takes_below)
            current[i].component = consensus->component_count;
    return takes_below ? below : all - below;
}

/* Returns the block to its component. */
static void restore_block(cairn_pose_consensus *consensus)
{
    for (int32_t i = 0; i < consensus->node_count; i++)
        if (consensus->current[i].component == consensus->component_count)
            consensus->current[i].component = consensus->block.component;
}

/* Starts the best pose of the block with the one that it has, whose support is searched. */
static void begin_block(cairn_pose_consensus *consensus)
{
    memset(&consensus->merge, 0, sizeof consensus->merge);
    consensus->merge.node = consensus->component_count;
    consensus->merge.component = consensus->block.component;
    consensus->merge.pose = cairn_pose_consensus_pose_of(cairn_pose_identity());
    consensus->merge.is_current = 1;
    cairn_pose_consensus_set_merger(consensus, &consensus->merge, POSE_CONSENSUS_BY_ALL);
}

/* Returns 1 when the visited hypothesis joins the block to a placed node outside of it: its pose of
 * the node inside is the query. */
static int query_proposed(cairn_pose_consensus *consensus)
{
    const cairn_pose_consensus_hypothesis *h = &consensus->hypotheses[consensus->hypothesis];
    const cairn_pose_consensus_assignment *current = consensus->current;
    int32_t block = consensus->component_count,
            inside = current[h->first].component == block ? h->first : h->second,
            outside = inside == h->first ? h->second : h->first;
    cairn_pose_consensus_pose pose;

    if (current[inside].component != block || current[outside].component < 0 ||
        current[outside].component == block)
        return 0;
    pose = cairn_pose_consensus_compose(&current[outside].pose,
                                        cairn_pose_consensus_relative_to(h, outside));
    cairn_pose_consensus_set_query(consensus, inside, &pose, current[outside].component,
                                   POSE_CONSENSUS_BY_ALL);
    return 1;
}

/* Sets the pose of the block that places its node as in the query. */
static void set_proposed(cairn_pose_consensus *consensus)
{
    const struct pose_consensus_query *query = &consensus->query;
    cairn_pose_consensus_pose inverse =
        cairn_pose_consensus_inverse(&consensus->current[query->node].pose);
    cairn_pose_consensus_candidate merge;

    memset(&merge, 0, sizeof merge);
    merge.node = consensus->component_count;
    merge.component = query->component;
    merge.pose = cairn_pose_consensus_compose(&query->pose, &inverse);
    cairn_pose_consensus_set_merger(consensus, &merge, POSE_CONSENSUS_BY_ALL);
}

/* Keeps the pose whose support was found, when it is the best so far. */
static void keep_proposed(cairn_pose_consensus *consensus)
{
    if (consensus->merger.tried.support > consensus->merge.support + MIN_GAIN_NATS)
        consensus->merge = consensus->merger.tried;
}

/* Step of a part: finds the best supported pose of the block, by its own and by every hypothesis
 * between it and the rest. All pairs of the block are evaluated only when those of the hypothesis'
 * own node have positive support. */
static int find_block_pose(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(consensus->resume.part);
    begin_block(consensus);
    if (consensus->block.component >= 0) {
        CAIRN_STEP_RUN(consensus, resume.part, budget, cairn_pose_consensus_find_merged_support);
        consensus->merge.support = consensus->merger.tried.support;
    }
    for (consensus->hypothesis = 0; consensus->hypothesis < consensus->hypothesis_count;
         consensus->hypothesis++) {
        CAIRN_STEP_CHARGE_UNIT(consensus, resume.part, budget);
        if (!query_proposed(consensus))
            continue;
        CAIRN_STEP_RUN(consensus, resume.part, budget, cairn_pose_consensus_find_support);
        if (!(consensus->query.found.sum > 0))
            continue;
        set_proposed(consensus);
        CAIRN_STEP_RUN(consensus, resume.part, budget, cairn_pose_consensus_find_merged_support);
        keep_proposed(consensus);
    }
    CAIRN_STEP_END(consensus->resume.part);
}

/* Moves the block to its best supported pose, or leaves it. */
static void move_block(cairn_pose_consensus *consensus)
{
    if (!consensus->merge.is_current && consensus->merge.support >= consensus->params.min_support)
        consensus->changed_nodes += cairn_pose_consensus_apply_merge(consensus, &consensus->merge);
    restore_block(consensus);
}

int cairn_pose_consensus_move_blocks(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(consensus->resume.phase);
    CAIRN_STEP_RUN(consensus, resume.phase, budget, build_tree);
    consensus->changed_nodes = 0;
    for (consensus->block.node = 0; consensus->block.node < consensus->node_count;
         consensus->block.node++) {
        CAIRN_STEP_CHARGE(consensus, resume.phase, budget, 1 + consensus->node_count);
        if (cut_off(consensus, consensus->block.node) == 0)
            continue;
        CAIRN_STEP_RUN(consensus, resume.phase, budget, find_block_pose);
        CAIRN_STEP_CHARGE(consensus, resume.phase, budget,
                          cairn_pose_consensus_merge_units(consensus));
        move_block(consensus);
    }
    CAIRN_STEP_END(consensus->resume.phase);
}

/* ---- Submaps ---- */

/* Returns the missing support of a block, nats; not above 0: it is significant. For several nodes
 * the violations are not subtracted: where a block is right, they come from moving people, and
 * where chance chose it there are few. */
static cairn_real missing_support(const cairn_pose_consensus *consensus)
{
    const struct pose_consensus_merger *merger = &consensus->merger;
    cairn_real significant = consensus->params.significant_support, support = merger->tried.support,
               against = merger->tried.violations;

    return merger->size > 1 ? BLOCK_FACTOR * significant - (support + against)
                            : significant - (support - against);
}

/* Lowers the link support of the nodes of a block to that of its cut. Unrelated data of more nodes
 * find a better pose by chance: about with the root of their number. */
static void keep_link_support(cairn_pose_consensus *consensus)
{
    const struct pose_consensus_merger *merger = &consensus->merger;
    cairn_real support =
        (merger->tried.support - merger->tried.violations) / cairn_sqrt((cairn_real)merger->size);

    for (int32_t i = 0; i < consensus->node_count; i++)
        if (consensus->current[i].component == consensus->component_count)
            consensus->nodes[i].link_support = cairn_min(consensus->nodes[i].link_support, support);
}

/* Returns the block to its component, and keeps the one with the greatest missing support. */
static void end_block(cairn_pose_consensus *consensus)
{
    cairn_real lack = missing_support(consensus);

    if (!consensus->block.has_link_support)
        keep_link_support(consensus);
    restore_block(consensus);
    if (lack > consensus->block.lack) {
        consensus->block.lack = lack;
        consensus->block.weakest = consensus->block.node;
    }
}

/* Splits off the nodes below a node as a submap of their own. */
static void split_off(cairn_pose_consensus *consensus, int32_t node)
{
    (void)cut_off(consensus, node);
    memcpy(consensus->best, consensus->current,
           (size_t)consensus->node_count * sizeof *consensus->best);
}

/* Step of a phase: splits off the block with the greatest missing support, until every remaining link
 * is significant. Of the first tree, of all links, also the link support of all nodes. */
static int split(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    struct pose_consensus_block *block = &consensus->block;

    CAIRN_STEP_BEGIN(consensus->resume.phase);
    do {
        CAIRN_STEP_RUN(consensus, resume.phase, budget, build_tree);
        block->lack = 0;
        for (block->node = 0; block->node < consensus->node_count; block->node++) {
            CAIRN_STEP_CHARGE(consensus, resume.phase, budget, 1 + consensus->node_count);
            if (consensus->tree[block->node].parent < 0)
                continue;
            (void)cut_off(consensus, block->node);
            begin_block(consensus);
            CAIRN_STEP_RUN(consensus, resume.phase, budget,
                           cairn_pose_consensus_find_merged_support);
            end_block(consensus);
        }
        block->has_link_support = 1;
        CAIRN_STEP_CHARGE(consensus, resume.phase, budget, 1 + consensus->node_count);
        if (block->lack > 0)
            split_off(consensus, block->weakest);
    } while (block->lack > 0);
    CAIRN_STEP_END(consensus->resume.phase);
}

/* Finds the first node and the size of a node's submap; an unplaced node is a submap by itself. */
static void measure_submap(cairn_pose_consensus *consensus, int32_t node)
{
    int32_t size = 0, first = node;

    for (int32_t i = 0; i < consensus->node_count; i++)
        if (i == node || (consensus->current[node].component >= 0 &&
                          consensus->current[i].component == consensus->current[node].component)) {
            first = i < first ? i : first;
            size++;
        }
    consensus->tree[node].parent = first;
    consensus->next_free[node] = size;
}

/* Numbers the submap of a node within its component: larger ones first, of equal ones that of the
 * lower node. Nodes of all but the first are ambiguous. */
static void number_submap(cairn_pose_consensus *consensus, int32_t own)
{
    cairn_pose_consensus_estimate *node = &consensus->nodes[own];
    int32_t first = consensus->tree[own].parent;

    node->submap = first < own ? consensus->nodes[first].submap : 0;
    for (int32_t i = 0; first == own && i < consensus->node_count; i++)
        node->submap += consensus->tree[i].parent == i &&
                        consensus->nodes[i].component == node->component &&
                        (consensus->next_free[i] > consensus->next_free[own] ||
                         (i < own && consensus->next_free[i] == consensus->next_free[own]));
    node->ambiguous |= node->submap > 0;
    consensus->result.ambiguous += node->ambiguous;
}

int cairn_pose_consensus_search_submaps(cairn_pose_consensus *consensus, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(consensus->resume.search);
    CAIRN_STEP_RUN(consensus, resume.search, budget, split);
    for (consensus->node = 0; consensus->node < consensus->node_count; consensus->node++) {
        CAIRN_STEP_CHARGE(consensus, resume.search, budget,
                          cairn_pose_consensus_node_units(consensus));
        measure_submap(consensus, consensus->node);
    }
    consensus->result.ambiguous = 0;
    for (consensus->node = 0; consensus->node < consensus->node_count; consensus->node++) {
        CAIRN_STEP_CHARGE(consensus, resume.search, budget,
                          cairn_pose_consensus_node_units(consensus));
        number_submap(consensus, consensus->node);
    }
    CAIRN_STEP_END(consensus->resume.search);
}
