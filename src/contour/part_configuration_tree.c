/* part_configuration: the best configuration of the votes near a seed. part_configuration.c says
 * how. */
#include "src/core/build.h"

#include "src/contour/part_configuration_work.h"

/* A bound grows by more than rounding may take from it. */
static const cairn_real SLACK = 64 * CAIRN_REAL_EPSILON;

static const cairn_part_vote *vote_of(const cairn_part_configurator *c, int32_t near)
{
    return &c->votes[c->near[near].vote];
}

/* 1 when a comes before b: by bundle, then by gain, then by distance. */
static int is_before(const cairn_part_configurator *c, int32_t a, int32_t b)
{
    const cairn_part_vote *v = vote_of(c, a), *u = vote_of(c, b);

    if (v->bundle != u->bundle)
        return v->bundle < u->bundle;
    return v->gain > u->gain || (v->gain >= u->gain && a < b);
}

/* Groups with the greatest gain first: the sooner there is a good configuration, the less is
 * left of the tree. */
static void sort_groups(cairn_part_configurator *c)
{
    cairn_real rest = 0;

    for (int32_t i = 1; i < c->group_count; i++) {
        vote_group g = c->groups[i];
        int32_t k = i;

        for (; k > 0 && c->groups[k - 1].most < g.most; k--)
            c->groups[k] = c->groups[k - 1];
        c->groups[k] = g;
    }
    for (int32_t i = c->group_count - 1; i >= 0; i--) {
        rest += c->groups[i].most;
        c->groups[i].most = rest;
    }
}

void cairn_part_configuration_plant(cairn_part_configurator *c)
{
    configuration_node root = {0, 0, 0, 0, 0, 0, 0};

    for (int32_t i = 0; i < c->near_count; i++) {
        int32_t k = i;

        for (; k > 0 && is_before(c, i, c->order[k - 1]); k--)
            c->order[k] = c->order[k - 1];
        c->order[k] = i;
    }
    c->group_count = 0;
    for (int32_t i = 0; i < c->near_count; i++) {
        const cairn_part_vote *v = vote_of(c, c->order[i]);
        vote_group *g = &c->groups[c->group_count - (c->group_count > 0)];

        if (c->group_count == 0 || g->bundle != v->bundle) {
            g = &c->groups[c->group_count++];
            g->bundle = v->bundle;
            g->first = i;
            g->count = 0;
            g->most = v->gain;
        }
        g->count++;
    }
    sort_groups(c);
    c->nodes[0] = root;
    c->depth = c->visited = c->best_count = 0;
    c->best = 0;
}

/* Adding a vote: the mean by gain moves, and scatter grows by what both were apart. */
static configuration_node add(const configuration_node *node, const near_vote *n, cairn_real gain)
{
    cairn_real sum = node->gain + gain, x = n->x - node->x, y = n->y - node->y,
               ratio = n->ratio - node->ratio;
    configuration_node added = *node;

    added.scatter += node->gain * gain / sum * (x * x + y * y + ratio * ratio);
    added.x += x * gain / sum;
    added.y += y * gain / sum;
    added.ratio += ratio * gain / sum;
    added.gain = sum;
    added.parts++;
    added.choice = 0;
    return added;
}

static int is_as_written(const cairn_part_configurator *c)
{
    return c->every != NULL;
}

static cairn_real score_of(const configuration_node *node)
{
    return node->gain - node->scatter / 2;
}

/* What two pieces of one chain share, over the shorter; of a closed chain either may lie a round
 * on, and they may meet at both ends. */
static cairn_real shared(const cairn_part_vote *a, const cairn_part_vote *b)
{
    cairn_real shorter = cairn_min(a->to - a->from, b->to - b->from), sum = 0;
    int32_t rounds = a->round > 0;

    for (int32_t k = -rounds; k <= rounds; k++) {
        cairn_real on = (cairn_real)k * a->round;

        sum += cairn_max(0, cairn_min(a->to + on, b->to) - cairn_max(a->from + on, b->from));
    }
    return shorter > 0 ? sum / shorter : 0;
}

static int is_free(const cairn_part_configurator *c, const configuration_node *node,
                   const cairn_part_vote *v)
{
    for (int32_t i = 0; i < node->parts; i++) {
        const cairn_part_vote *u = vote_of(c, c->chosen[i]);

        if (u->chain == v->chain && (is_as_written(c) || shared(u, v) > c->params.overlap))
            return 0;
    }
    return 1;
}

static void take_best(cairn_part_configurator *c, const configuration_node *node)
{
    if (node->parts < c->params.min_parts || !(score_of(node) > c->best))
        return;
    c->best = score_of(node);
    c->best_node = *node;
    c->best_count = node->parts;
    for (int32_t i = 0; i < node->parts; i++)
        c->best_votes[i] = c->near[c->chosen[i]].vote;
}

/* 1 when nothing below the node can be better: each group that is left adds its greatest gain at
 * most, for scatter never falls. As written when nothing below it reaches the threshold. */
static int is_hopeless(const cairn_part_configurator *c, const configuration_node *node)
{
    cairn_real rest = c->groups[c->depth].most, bound = score_of(node) + rest;

    if (is_as_written(c))
        return node->gain + rest + SLACK * (node->gain + rest) < c->params.min_sum ||
               node->parts + c->group_count - c->depth < c->params.min_parts;
    return bound + SLACK * (node->gain + node->scatter + rest) <= c->best ||
           node->parts + c->group_count - c->depth < c->params.min_parts;
}

int cairn_part_configuration_visit(cairn_part_configurator *c)
{
    configuration_node *node = &c->nodes[c->depth];
    const vote_group *group = &c->groups[c->depth];

    if (c->depth == c->group_count || is_hopeless(c, node) || node->choice > group->count) {
        c->depth--;
        return c->depth >= 0;
    }
    if (node->choice == group->count) {
        node->choice++;
        c->nodes[c->depth + 1] = *node;
        c->nodes[++c->depth].choice = 0;
        return 1;
    }
    {
        int32_t near = c->order[group->first + node->choice++];
        const cairn_part_vote *v = vote_of(c, near);

        if (is_free(c, node, v)) {
            c->nodes[c->depth + 1] = add(node, &c->near[near], v->gain);
            c->chosen[node->parts] = near;
            c->depth++;
            if (is_as_written(c)) {
                cairn_part_configuration_every_take(c, node->parts + 1);
                cairn_part_configuration_every_offer(c, &c->nodes[c->depth]);
            } else {
                take_best(c, &c->nodes[c->depth]);
            }
        }
    }
    return 1;
}
