/* part_configuration: branch-and-bound search for the best configuration of the votes near a seed.
 * part_configuration.c describes it. */
#include "src/base/build.h"

#include "src/parts/part_configuration_work.h"

/* Relative slack of a bound, above the rounding error. */
static const cairn_real BOUND_SLACK = 64 * CAIRN_REAL_EPSILON;

static const cairn_part_configuration_vote *vote_of(const cairn_part_configurator *configurator,
                                                    int32_t near)
{
    return &configurator->votes[configurator->near_votes[near].vote];
}

/* Order of votes: by bundle, then by descending weight, then by distance. */
static int is_before(const cairn_part_configurator *configurator, int32_t a, int32_t b)
{
    const cairn_part_configuration_vote *v = vote_of(configurator, a),
                                        *u = vote_of(configurator, b);

    if (v->bundle != u->bundle)
        return v->bundle < u->bundle;
    return v->weight > u->weight || (v->weight >= u->weight && a < b);
}

/* Sorts groups by descending weight, so that good configurations are found early and prune more;
 * then suffix sums. */
static void sort_groups(cairn_part_configurator *configurator)
{
    cairn_real bound = 0;

    for (int32_t i = 1; i < configurator->tree.group_count; i++) {
        part_configuration_vote_group g = configurator->tree.groups[i];
        int32_t k = i;

        for (; k > 0 && configurator->tree.groups[k - 1].bound < g.bound; k--)
            configurator->tree.groups[k] = configurator->tree.groups[k - 1];
        configurator->tree.groups[k] = g;
    }
    for (int32_t i = configurator->tree.group_count - 1; i >= 0; i--) {
        bound += configurator->tree.groups[i].bound;
        configurator->tree.groups[i].bound = bound;
    }
}

void cairn_part_configuration_begin_tree(cairn_part_configurator *configurator)
{
    part_configuration_node root = {.weight = 0};

    for (int32_t i = 0; i < configurator->near_count; i++) {
        int32_t k = i;

        for (; k > 0 && is_before(configurator, i, configurator->tree.order[k - 1]); k--)
            configurator->tree.order[k] = configurator->tree.order[k - 1];
        configurator->tree.order[k] = i;
    }
    configurator->tree.group_count = 0;
    for (int32_t i = 0; i < configurator->near_count; i++) {
        const cairn_part_configuration_vote *v = vote_of(configurator, configurator->tree.order[i]);
        part_configuration_vote_group *g =
            &configurator->tree
                 .groups[configurator->tree.group_count - (configurator->tree.group_count > 0)];

        if (configurator->tree.group_count == 0 || g->bundle != v->bundle) {
            g = &configurator->tree.groups[configurator->tree.group_count++];
            g->bundle = v->bundle;
            g->first = i;
            g->count = 0;
            g->bound = v->weight;
        }
        g->count++;
    }
    sort_groups(configurator);
    configurator->tree.nodes[0] = root;
    configurator->tree.depth = configurator->tree.visited_count = configurator->best.count = 0;
    configurator->best.score = 0;
}

/* Node after adding a vote: incremental update of the weighted mean and of the scatter. */
static part_configuration_node add_vote(const part_configuration_node *node,
                                        const part_configuration_near_vote *vote, cairn_real weight)
{
    cairn_real sum = node->weight + weight, x = vote->x - node->x, y = vote->y - node->y,
               log_scale = vote->log_scale - node->log_scale;
    part_configuration_node added = *node;

    added.scatter += node->weight * weight / sum * (x * x + y * y + log_scale * log_scale);
    added.x += x * weight / sum;
    added.y += y * weight / sum;
    added.log_scale += log_scale * weight / sum;
    added.weight = sum;
    added.part_count++;
    added.choice = 0;
    return added;
}

static int is_as_written(const cairn_part_configurator *configurator)
{
    return configurator->exhaustive != NULL;
}

static cairn_real score_of(const part_configuration_node *node)
{
    return node->weight - node->scatter / 2;
}

/* Overlap of two intervals of one chain, over the shorter. On a closed chain either may be shifted
 * by the chain's length, and they may meet at both ends. */
static cairn_real overlap_of(const cairn_part_configuration_vote *a,
                             const cairn_part_configuration_vote *b)
{
    cairn_real shorter = cairn_min(a->to - a->from, b->to - b->from), sum = 0;
    int32_t has_rounds = a->closed_length > 0;

    for (int32_t k = -has_rounds; k <= has_rounds; k++) {
        cairn_real shift = (cairn_real)k * a->closed_length;

        sum += cairn_max(0, cairn_min(a->to + shift, b->to) - cairn_max(a->from + shift, b->from));
    }
    return shorter > 0 ? sum / shorter : 0;
}

/* Returns 1 when a vote shares no chain interval with the parts chosen so far. */
static int is_compatible(const cairn_part_configurator *configurator,
                         const part_configuration_node *node,
                         const cairn_part_configuration_vote *vote)
{
    for (int32_t i = 0; i < node->part_count; i++) {
        const cairn_part_configuration_vote *u =
            vote_of(configurator, configurator->tree.chosen[i]);

        if (u->chain == vote->chain &&
            (is_as_written(configurator) || overlap_of(u, vote) > configurator->params.overlap))
            return 0;
    }
    return 1;
}

static void update_best(cairn_part_configurator *configurator, const part_configuration_node *node)
{
    if (node->part_count < configurator->params.min_parts ||
        !(score_of(node) > configurator->best.score))
        return;
    configurator->best.score = score_of(node);
    configurator->best.node = *node;
    configurator->best.count = node->part_count;
    for (int32_t i = 0; i < node->part_count; i++)
        configurator->best.votes[i] = configurator->near_votes[configurator->tree.chosen[i]].vote;
}

/* Returns 1 when no descendant can be better (bound): each remaining group adds at most its
 * greatest weight, because scatter never decreases. As written: when no descendant reaches the
 * threshold. */
static int can_prune(const cairn_part_configurator *configurator,
                     const part_configuration_node *node)
{
    cairn_real rest = configurator->tree.groups[configurator->tree.depth].bound,
               bound = score_of(node) + rest;

    if (is_as_written(configurator))
        return node->weight + rest + BOUND_SLACK * (node->weight + rest) <
                   configurator->params.min_sum ||
               node->part_count + configurator->tree.group_count - configurator->tree.depth <
                   configurator->params.min_parts;
    return bound + BOUND_SLACK * (node->weight + node->scatter + rest) <=
               configurator->best.score ||
           node->part_count + configurator->tree.group_count - configurator->tree.depth <
               configurator->params.min_parts;
}

/* Adds a vote of the group to the partial configuration of a node, unless it conflicts with a part
 * of it. */
static void try_vote(cairn_part_configurator *configurator, const part_configuration_node *node,
                     int32_t near)
{
    const cairn_part_configuration_vote *v = vote_of(configurator, near);
    part_configuration_node *added = &configurator->tree.nodes[configurator->tree.depth + 1];

    if (!is_compatible(configurator, node, v))
        return;
    *added = add_vote(node, &configurator->near_votes[near], v->weight);
    configurator->tree.chosen[node->part_count] = near;
    configurator->tree.depth++;
    if (is_as_written(configurator)) {
        cairn_part_configuration_exhaustive_extend(configurator, added->part_count);
        cairn_part_configuration_exhaustive_offer(configurator, added);
    } else {
        update_best(configurator, added);
    }
}

void cairn_part_configuration_visit_node(cairn_part_configurator *configurator)
{
    part_configuration_node *node = &configurator->tree.nodes[configurator->tree.depth];
    const part_configuration_vote_group *group =
        &configurator->tree.groups[configurator->tree.depth];

    configurator->tree.visited_count++;
    if (configurator->tree.depth == configurator->tree.group_count ||
        can_prune(configurator, node) || node->choice > group->count) {
        configurator->tree.depth--;
    } else if (node->choice == group->count) {
        node->choice++;
        configurator->tree.nodes[configurator->tree.depth + 1] = *node;
        configurator->tree.nodes[++configurator->tree.depth].choice = 0;
    } else {
        try_vote(configurator, node, configurator->tree.order[group->first + node->choice++]);
    }
}
