/* part_configuration: nearest-neighbour queries by a hash grid over centre and logarithm of the
 * scale. part_configuration.c describes it. */
#include "src/base/build.h"

#include "src/containers/cell_grid.h"
#include "src/containers/ranked_list.h"
#include "src/parts/part_configuration_work.h"

/* Factor that widens radii by more than the rounding error. */
static const cairn_real ROUND_UP = CAIRN_REAL(1.0001);

static cairn_real layer_height(const cairn_part_configurator *configurator)
{
    return ROUND_UP * configurator->params.search_radius * configurator->params.scale_tolerance;
}

static int32_t floor_to_int(cairn_real value)
{
    return cairn_real_to_int(cairn_floor(value));
}

static int32_t layer_of(const cairn_part_configurator *configurator, cairn_real scale)
{
    return floor_to_int(cairn_log(scale) / layer_height(configurator));
}

static cairn_real cell_of_layer(const cairn_part_configurator *configurator, int32_t layer)
{
    return configurator->params.search_radius * configurator->params.centre_tolerance *
           cairn_exp((cairn_real)(layer + 1) * layer_height(configurator));
}

static uint32_t bucket_of(const cairn_part_configurator *configurator, int32_t layer, int32_t x,
                          int32_t y)
{
    return cell_hash(x, y, layer) & configurator->mask;
}

void cairn_part_configuration_insert(cairn_part_configurator *configurator, int32_t vote)
{
    const cairn_part_configuration_vote *v = &configurator->votes[vote];
    int32_t layer = layer_of(configurator, v->scale);
    cairn_real cell = cell_of_layer(configurator, layer);
    uint32_t bucket = bucket_of(configurator, layer, floor_to_int(v->centre.x / cell),
                                floor_to_int(v->centre.y / cell));

    configurator->vote_layer[vote] = layer;
    configurator->next_in_bucket[vote] = configurator->bucket_heads[bucket];
    configurator->bucket_heads[bucket] = vote;
    configurator->bucket_sizes[bucket]++;
}

/* Votes of a bucket processed in one step. */
enum { VOTES_PER_STEP = 16 };

static void enter_cell(cairn_part_configurator *configurator)
{
    part_configuration_vote_query *query = &configurator->query;
    uint32_t bucket = bucket_of(configurator, query->layer, query->x, query->y);

    query->next_vote = configurator->bucket_heads[bucket];
    query->votes_left = configurator->bucket_sizes[bucket];
}

/* Computes the range of cells of the query's layer. */
static void enter_layer(cairn_part_configurator *configurator)
{
    part_configuration_vote_query *query = &configurator->query;
    cairn_real cell = cell_of_layer(configurator, query->layer),
               reach = ROUND_UP * configurator->params.search_radius *
                       configurator->params.centre_tolerance * query->centre.scale;

    query->cell = cell;
    query->min_x = query->x = floor_to_int((query->centre.centre.x - reach) / cell);
    query->max_x = floor_to_int((query->centre.centre.x + reach) / cell);
    query->y = floor_to_int((query->centre.centre.y - reach) / cell);
    query->max_y = floor_to_int((query->centre.centre.y + reach) / cell);
    enter_cell(configurator);
}

void cairn_part_configuration_query(cairn_part_configurator *configurator,
                                    part_configuration_vote_point centre)
{
    part_configuration_vote_query *query = &configurator->query;
    int32_t layer = layer_of(configurator, centre.scale);

    query->centre = centre;
    query->last_layer = layer + 1;
    /* The layer below has the smallest cells. */
    query->layer = layer - 1;
    enter_layer(configurator);
    query->is_linear_scan =
        ((int64_t)query->max_x - query->min_x + 1) * ((int64_t)query->max_y - query->y + 1) >
        configurator->count; /* the other layers have fewer cells */
    query->is_linear_scan = query->is_linear_scan || configurator->exhaustive != NULL;
    if (query->is_linear_scan)
        query->x = 0;
    configurator->near_count = 0;
}

int32_t cairn_part_configuration_query_cost(const cairn_part_configurator *configurator)
{
    const part_configuration_vote_query *query = &configurator->query;

    if (query->is_linear_scan)
        return query->x < configurator->count;
    return query->layer <= query->last_layer
               ? 1 + (query->votes_left < VOTES_PER_STEP ? query->votes_left : VOTES_PER_STEP)
               : 0;
}

static int is_nearer(const void *context, const void *entry, const void *other)
{
    const part_configuration_near_vote *a = entry, *b = other;

    (void)context;
    return a->squared_distance < b->squared_distance ||
           (a->squared_distance <= b->squared_distance && a->vote < b->vote);
}

/* Inserts a vote into the K nearest, sorted by distance, then index. */
static void insert_near_vote(cairn_part_configurator *configurator, int32_t vote)
{
    const cairn_part_configuration_vote *v = &configurator->votes[vote];
    cairn_real size = configurator->params.centre_tolerance * configurator->query.centre.scale,
               reach = configurator->params.search_radius;
    part_configuration_near_vote n;
    ranked_list nearest = {.entries = configurator->near_votes,
                           .count = &configurator->near_count,
                           .capacity = configurator->params.nearest,
                           .entry_bytes = sizeof n,
                           .ranks_before = is_nearer};

    n.x = (v->centre.x - configurator->query.centre.centre.x) / size;
    n.y = (v->centre.y - configurator->query.centre.centre.y) / size;
    n.log_scale = (cairn_log(v->scale) - cairn_log(configurator->query.centre.scale)) /
                  configurator->params.scale_tolerance;
    n.squared_distance =
        configurator->exhaustive == NULL
            ? n.x * n.x + n.y * n.y + n.log_scale * n.log_scale
            : cairn_vec2_norm_squared(cairn_vec2_sub(v->centre, configurator->query.centre.centre));
    n.vote = vote;
    configurator->pair_count++;
    if (configurator->exhaustive != NULL || n.squared_distance <= reach * reach)
        (void)ranked_list_add(&nearest, &n);
}

/* Returns 1 when a vote of the bucket lies in the query's cell; hash collisions are skipped. */
static int is_in_cell(const cairn_part_configurator *configurator, int32_t vote)
{
    const part_configuration_vote_query *query = &configurator->query;

    return configurator->vote_layer[vote] == query->layer &&
           floor_to_int(configurator->votes[vote].centre.x / query->cell) == query->x &&
           floor_to_int(configurator->votes[vote].centre.y / query->cell) == query->y;
}

/* Advances to the next cell. */
static void leave_cell(cairn_part_configurator *configurator)
{
    part_configuration_vote_query *query = &configurator->query;

    if (query->x < query->max_x) {
        query->x++;
    } else if (query->y < query->max_y) {
        query->x = query->min_x;
        query->y++;
    } else {
        if (++query->layer <= query->last_layer)
            enter_layer(configurator);
        return;
    }
    enter_cell(configurator);
}

void cairn_part_configuration_query_next(cairn_part_configurator *configurator)
{
    part_configuration_vote_query *query = &configurator->query;

    if (query->is_linear_scan) {
        insert_near_vote(configurator, query->x++);
        return;
    }
    for (int32_t i = 0; i < VOTES_PER_STEP && query->votes_left > 0; i++, query->votes_left--,
                 query->next_vote = configurator->next_in_bucket[query->next_vote])
        if (is_in_cell(configurator, query->next_vote))
            insert_near_vote(configurator, query->next_vote);
    if (query->votes_left == 0)
        leave_cell(configurator);
}
