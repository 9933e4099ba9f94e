/* part_configuration: the votes near a place, by a hash grid over centre and logarithm of the
 * scale. part_configuration.c says how. */
#include "src/core/build.h"

#include "src/contour/part_configuration_work.h"

/* Reaches grow by more than what rounding may take. */
static const cairn_real MORE = CAIRN_REAL(1.0001);

static cairn_real layer_height(const cairn_part_configurator *c)
{
    return MORE * c->params.reach * c->params.ratio;
}

static int32_t floor_of(cairn_real x)
{
    return cairn_real_to_int(cairn_floor(x));
}

static int32_t layer_of(const cairn_part_configurator *c, cairn_real scale)
{
    return floor_of(cairn_log(scale) / layer_height(c));
}

static cairn_real cell_of_layer(const cairn_part_configurator *c, int32_t layer)
{
    return c->params.reach * c->params.centre *
           cairn_exp((cairn_real)(layer + 1) * layer_height(c));
}

static uint32_t bucket_of(const cairn_part_configurator *c, int32_t layer, int32_t x, int32_t y)
{
    uint32_t hash = (uint32_t)x * UINT32_C(0x9E3779B1) + (uint32_t)y * UINT32_C(0x85EBCA77) +
                    (uint32_t)layer * UINT32_C(0xC2B2AE3D);

    return (hash ^ hash >> 15) & c->mask;
}

void cairn_part_configuration_insert(cairn_part_configurator *c, int32_t vote)
{
    const cairn_part_vote *v = &c->votes[vote];
    int32_t layer = layer_of(c, v->scale);
    cairn_real cell = cell_of_layer(c, layer);
    uint32_t bucket =
        bucket_of(c, layer, floor_of(v->centre.x / cell), floor_of(v->centre.y / cell));

    c->layer[vote] = layer;
    c->next[vote] = c->heads[bucket];
    c->heads[bucket] = vote;
    c->sizes[bucket]++;
}

/* Votes of a bucket that are looked at in one item. */
enum { VOTES_OF_ITEM = 16 };

static void enter_cell(cairn_part_configurator *c)
{
    vote_query *q = &c->query;
    uint32_t bucket = bucket_of(c, q->layer, q->x, q->y);

    q->vote = c->heads[bucket];
    q->left = c->sizes[bucket];
}

/* Cells of the query's layer. */
static void enter_layer(cairn_part_configurator *c)
{
    vote_query *q = &c->query;
    cairn_real cell = cell_of_layer(c, q->layer),
               reach = MORE * c->params.reach * c->params.centre * q->at.scale;

    q->cell = cell;
    q->min_x = q->x = floor_of((q->at.centre.x - reach) / cell);
    q->max_x = floor_of((q->at.centre.x + reach) / cell);
    q->y = floor_of((q->at.centre.y - reach) / cell);
    q->max_y = floor_of((q->at.centre.y + reach) / cell);
    enter_cell(c);
}

void cairn_part_configuration_query(cairn_part_configurator *c, vote_place at)
{
    vote_query *q = &c->query;
    int32_t layer = layer_of(c, at.scale);

    q->at = at;
    q->last_layer = layer + 1;
    /* The smallest cells are those of the layer below. */
    q->layer = layer - 1;
    enter_layer(c);
    q->all = ((int64_t)q->max_x - q->min_x + 1) * ((int64_t)q->max_y - q->y + 1) >
             c->count; /* cells of other layers are fewer */
    q->all = q->all || c->every != NULL;
    if (q->all)
        q->x = 0;
    c->near_count = 0;
}

int32_t cairn_part_configuration_query_cost(const cairn_part_configurator *c)
{
    const vote_query *q = &c->query;

    if (q->all)
        return q->x < c->count;
    return q->layer <= q->last_layer ? 1 + (q->left < VOTES_OF_ITEM ? q->left : VOTES_OF_ITEM) : 0;
}

/* Takes a vote among the nearest K: by its distance, then its index. */
static void offer(cairn_part_configurator *c, int32_t vote)
{
    const cairn_part_vote *v = &c->votes[vote];
    cairn_real size = c->params.centre * c->query.at.scale, reach = c->params.reach;
    near_vote n;
    int32_t at;

    n.x = (v->centre.x - c->query.at.centre.x) / size;
    n.y = (v->centre.y - c->query.at.centre.y) / size;
    n.ratio = (cairn_log(v->scale) - cairn_log(c->query.at.scale)) / c->params.ratio;
    n.squared = c->every == NULL
                    ? n.x * n.x + n.y * n.y + n.ratio * n.ratio
                    : cairn_vec2_norm_squared(cairn_vec2_sub(v->centre, c->query.at.centre));
    n.vote = vote;
    c->pairs++;
    if (c->every == NULL && !(n.squared <= reach * reach))
        return;
    at = c->near_count;
    while (at > 0 && (n.squared < c->near[at - 1].squared ||
                      (n.squared <= c->near[at - 1].squared && vote < c->near[at - 1].vote)))
        at--;
    if (at == c->params.nearest)
        return;
    c->near_count += c->near_count < c->params.nearest;
    for (int32_t i = c->near_count - 1; i > at; i--)
        c->near[i] = c->near[i - 1];
    c->near[at] = n;
}

/* 1 when a vote of the bucket lies in the query's cell: others of the same bucket come with
 * their own. */
static int is_in_cell(const cairn_part_configurator *c, int32_t vote)
{
    const vote_query *q = &c->query;

    return c->layer[vote] == q->layer && floor_of(c->votes[vote].centre.x / q->cell) == q->x &&
           floor_of(c->votes[vote].centre.y / q->cell) == q->y;
}

/* To the next cell. */
static void leave_cell(cairn_part_configurator *c)
{
    vote_query *q = &c->query;

    if (q->x < q->max_x) {
        q->x++;
    } else if (q->y < q->max_y) {
        q->x = q->min_x;
        q->y++;
    } else {
        if (++q->layer <= q->last_layer)
            enter_layer(c);
        return;
    }
    enter_cell(c);
}

void cairn_part_configuration_query_next(cairn_part_configurator *c)
{
    vote_query *q = &c->query;

    if (q->all) {
        offer(c, q->x++);
        return;
    }
    for (int32_t i = 0; i < VOTES_OF_ITEM && q->left > 0;
         i++, q->left--, q->vote = c->next[q->vote])
        if (is_in_cell(c, q->vote))
            offer(c, q->vote);
    if (q->left == 0)
        leave_cell(c);
}
