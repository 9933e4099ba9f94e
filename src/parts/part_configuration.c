/* Configurations of parts that agree on the object's centre and scale.
 *
 * Method:
 * 1. Nearest neighbours: the distance of two votes combines the distance of their centres, over the
 *    scale of the seed, and of the logarithms of their scales, in tolerances. The K nearest within
 *    the search radius come from a hash grid. Its layers are ranges of scale as high as the radius,
 *    with square cells as wide as the radius of the layer's largest scale. Three layers and a few
 *    cells of each cover a neighbourhood.
 * 2. Branch and bound: the tree of configurations of these votes has one level per bundle, one of
 *    its votes or none. A configuration's score is its weight less half the scatter of its votes
 *    about their weighted mean. Scatter never decreases when a vote is added. So the score of a
 *    node plus the greatest weights of the remaining bundles bounds all scores below it. Pruning by
 *    this bound is exact.
 * 3. Search MODES: mean shift moves the seed to the mean of the K nearest votes, weighted by weight
 *    exp(-d^2 / 2), until convergence. A mode within half a tolerance of an earlier one is
 *    discarded.
 *
 * As written: the K nearest come from a linear scan of all votes, by their centres. The tree is
 * enumerated completely, except for branches below the threshold (part_configuration_exhaustive.c).
 *
 * Memory layout: the index; the neighbouring votes in groups; one node per level; the best
 * configurations, sorted by slots.
 *
 * Limits: the tree is exponential in the bundles, with at most (K / bundles + 1)^bundles nodes;
 * max_nodes bounds it, and truncation is reported. One configuration per seed.
 *
 * Source: Adluru 2008, section 5.2.2; distance, score and bound: this project's. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/ranked_list.h"
#include "src/parts/part_configuration_work.h"

enum {
    MAX_VOTES = 1 << 20,
    MAX_WRITTEN_VOTES = 8192,
    MAX_FOUND = 1 << 16,
    MAX_NODES = 1 << 30,
    MAX_PARTS = PART_CONFIGURATION_MAX_PARTS
};
/* Mean shift iterations; recorded configurations compared per work unit. */
enum { MAX_SHIFTS = 30, COMPARISONS_PER_UNIT = 4 };

static const cairn_real MAX_COORDINATE = CAIRN_REAL(1e6);
/* In tolerances squared: mean shift has converged below the first; modes within the second are
 * duplicates. */
static const cairn_real MIN_SHIFT_SQUARED = CAIRN_REAL(1e-4),
                        MODE_RADIUS_SQUARED = CAIRN_REAL(0.25);

cairn_part_configuration_params cairn_part_configuration_default(void)
{
    cairn_part_configuration_params params = {
        .max_votes = 512,
        .nearest = 20,
        .min_parts = 2,
        .max_found = 64,
        .max_nodes = 1000000,
        .search = CAIRN_PART_SEARCH_NEAREST,
        .centre_tolerance = CAIRN_REAL(0.08),
        .scale_tolerance = CAIRN_REAL(0.15),
        .search_radius = 3,
        .overlap = CAIRN_REAL(0.2),
        .mode = CAIRN_MODE_DEFAULT,
        .min_sum = 0,
    };

    return params;
}

cairn_part_configuration_params cairn_part_configuration_as_written(void)
{
    cairn_part_configuration_params params = cairn_part_configuration_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    params.min_parts = 1;
    params.max_found = 4096;
    params.max_nodes = MAX_NODES;
    return params;
}

static int mode_is_good(const cairn_part_configuration_params *params)
{
    return (params->mode == CAIRN_MODE_DEFAULT || params->mode == CAIRN_MODE_AS_WRITTEN) &&
           params->min_sum >= 0 && params->min_sum <= MAX_COORDINATE &&
           (params->mode == CAIRN_MODE_DEFAULT || (params->max_votes <= MAX_WRITTEN_VOTES &&
                                                   params->search == CAIRN_PART_SEARCH_NEAREST));
}

static int capacities_are_good(const cairn_part_configuration_params *params)
{
    return params->max_votes >= 1 && params->max_votes <= MAX_VOTES && params->nearest >= 1 &&
           params->nearest <= MAX_PARTS && params->min_parts >= 1 &&
           params->min_parts <= MAX_PARTS && params->max_found >= 1 &&
           params->max_found <= MAX_FOUND && params->max_nodes >= 1 &&
           params->max_nodes <= MAX_NODES;
}

static int params_are_good(const cairn_part_configuration_params *params)
{
    return params != NULL && capacities_are_good(params) && mode_is_good(params) &&
           params->search >= CAIRN_PART_SEARCH_NEAREST &&
           params->search <= CAIRN_PART_SEARCH_MODES &&
           params->centre_tolerance >= CAIRN_REAL(1e-4) && params->centre_tolerance <= 10 &&
           params->scale_tolerance >= CAIRN_REAL(0.01) && params->scale_tolerance <= 1 &&
           params->search_radius >= CAIRN_REAL(0.5) && params->search_radius <= 4 &&
           params->overlap >= 0 && params->overlap <= 1;
}

static uint32_t bucket_count(int32_t max_votes)
{
    uint32_t buckets = 1;

    while (buckets < (uint32_t)max_votes)
        buckets *= 2;
    return buckets;
}

static cairn_part_configurator *carve(cairn_pool *pool,
                                      const cairn_part_configuration_params *params)
{
    size_t votes = (size_t)params->max_votes, found = (size_t)params->max_found,
           buckets = bucket_count(params->max_votes);
    cairn_part_configurator *configurator = cairn_pool_take_one(pool, sizeof *configurator);
    int32_t *next = cairn_pool_take(pool, 2 * votes, sizeof *next);
    int32_t *heads = cairn_pool_take(pool, 2 * buckets, sizeof *heads);
    part_configuration_vote_point *modes = cairn_pool_take(pool, votes, sizeof *modes);
    cairn_part_configuration *kept = cairn_pool_take(pool, found, sizeof *kept);
    int32_t *found_votes = cairn_pool_take(pool, found * MAX_PARTS, sizeof *found_votes);
    part_configuration_exhaustive *exhaustive = NULL;

    if (params->mode == CAIRN_MODE_AS_WRITTEN)
        cairn_part_configuration_exhaustive_carve(pool, params, &exhaustive);
    if (configurator != NULL) {
        memset(configurator, 0, sizeof *configurator);
        configurator->exhaustive = exhaustive;
        configurator->next_in_bucket = next;
        configurator->vote_layer = next + votes;
        configurator->bucket_heads = heads;
        configurator->bucket_sizes = heads + buckets;
        configurator->modes = modes;
        configurator->found = kept;
        configurator->found_votes = found_votes;
        configurator->mask = (uint32_t)buckets - 1;
    }
    return configurator;
}

size_t cairn_part_configuration_memory(const cairn_part_configuration_params *params)
{
    cairn_pool counting;

    if (!params_are_good(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_part_configuration_create(cairn_part_configurator **configurator,
                                             cairn_pool *pool,
                                             const cairn_part_configuration_params *params)
{
    size_t need = cairn_part_configuration_memory(params);

    if (configurator == NULL || pool == NULL || need == 0)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_capacity(pool, need))
        return CAIRN_NO_MEMORY;
    *configurator = carve(pool, params);
    (*configurator)->params = *params;
    return CAIRN_OK;
}

/* ---- Results ---- */

static int32_t *votes_of(const cairn_part_configurator *configurator, int32_t slot)
{
    return &configurator->found_votes[(size_t)configurator->found[slot].first];
}

static int is_duplicate(const cairn_part_configurator *configurator, int32_t slot)
{
    return configurator->found[slot].count == configurator->best_count &&
           memcmp(votes_of(configurator, slot), configurator->best_votes,
                  (size_t)configurator->best_count * sizeof *configurator->best_votes) == 0;
}

static void sort_votes(cairn_part_configurator *configurator)
{
    for (int32_t i = 1; i < configurator->best_count; i++) {
        int32_t v = configurator->best_votes[i], k = i;

        for (; k > 0 && configurator->best_votes[k - 1] > v; k--)
            configurator->best_votes[k] = configurator->best_votes[k - 1];
        configurator->best_votes[k] = v;
    }
}

cairn_part_configuration cairn_part_configuration_describe(cairn_part_configurator *configurator,
                                                           int32_t first)
{
    const part_configuration_node *node = &configurator->best_node;
    cairn_part_configuration configuration;

    sort_votes(configurator);
    configuration.score = configurator->best_score;
    configuration.weight_sum = node->weight;
    configuration.scale = configurator->query.centre.scale *
                          cairn_exp(node->log_scale * configurator->params.scale_tolerance);
    configuration.centre.x =
        configurator->query.centre.centre.x +
        node->x * configurator->params.centre_tolerance * configurator->query.centre.scale;
    configuration.centre.y =
        configurator->query.centre.centre.y +
        node->y * configurator->params.centre_tolerance * configurator->query.centre.scale;
    configuration.seed = configurator->seed;
    configuration.first = first;
    configuration.count = configurator->best_count;
    memcpy(&configurator->found_votes[first], configurator->best_votes,
           (size_t)configuration.count * sizeof *configurator->best_votes);
    return configuration;
}

/* Inserts the seed's best configuration into the sorted list, without duplicates. The votes' memory
 * of the one that it replaces, a duplicate or the last of a full list, becomes its own. */
static void insert_configuration(cairn_part_configurator *configurator)
{
    cairn_part_configuration configuration;
    ranked_list found = {.entries = configurator->found,
                         .count = &configurator->found_count,
                         .capacity = configurator->params.max_found,
                         .entry_bytes = sizeof configuration,
                         .score_at = offsetof(cairn_part_configuration, score)};
    int32_t index = 0, first = configurator->found_count * MAX_PARTS;

    sort_votes(configurator);
    while (index < configurator->found_count && !is_duplicate(configurator, index))
        index++;
    if (index == configurator->params.max_found)
        index--;
    if (index < configurator->found_count) {
        if (!(configurator->best_score > configurator->found[index].score))
            return;
        first = configurator->found[index].first;
        ranked_list_remove(&found, index);
    }
    configuration = cairn_part_configuration_describe(configurator, first);
    (void)ranked_list_add(&found, &configuration);
}

/* ---- Seeds ---- */

/* Starts the next vote as seed, or ends the search. */
static void next_seed(cairn_part_configurator *configurator)
{
    part_configuration_vote_point point;

    configurator->phase =
        configurator->exhaustive != NULL ? PART_CONFIGURATION_SORT : PART_CONFIGURATION_DONE;
    if (++configurator->seed >= configurator->count)
        return;
    point.centre = configurator->votes[configurator->seed].centre;
    point.scale = configurator->votes[configurator->seed].scale;
    configurator->shift_count = 0;
    cairn_part_configuration_query(configurator, point);
    configurator->phase = PART_CONFIGURATION_GATHER;
}

/* One mean shift iteration; 0: converged. */
static int shift_mean(cairn_part_configurator *configurator)
{
    cairn_real sum = 0, x = 0, y = 0, log_scale = 0,
               size = configurator->params.centre_tolerance * configurator->query.centre.scale;
    part_configuration_vote_point point = configurator->query.centre;

    for (int32_t i = 0; i < configurator->near_count; i++) {
        const part_configuration_near_vote *near = &configurator->near_votes[i];
        cairn_real weight =
            configurator->votes[near->vote].weight * cairn_exp(-near->squared_distance / 2);

        sum += weight;
        x += weight * near->x;
        y += weight * near->y;
        log_scale += weight * near->log_scale;
    }
    if (configurator->shift_count++ == MAX_SHIFTS ||
        !(x * x + y * y + log_scale * log_scale > MIN_SHIFT_SQUARED * sum * sum))
        return 0;
    point.centre.x += x / sum * size;
    point.centre.y += y / sum * size;
    point.scale *= cairn_exp(log_scale / sum * configurator->params.scale_tolerance);
    cairn_part_configuration_query(configurator, point);
    return 1;
}

static int is_new_mode(const cairn_part_configurator *configurator)
{
    cairn_real size = configurator->params.centre_tolerance * configurator->query.centre.scale,
               scale = cairn_log(configurator->query.centre.scale);

    for (int32_t i = 0; i < configurator->mode_count; i++) {
        cairn_vec2 offset = cairn_vec2_scale(
            cairn_vec2_sub(configurator->modes[i].centre, configurator->query.centre.centre),
            1 / size);
        cairn_real log_scale = (cairn_log(configurator->modes[i].scale) - scale) /
                               configurator->params.scale_tolerance;

        if (cairn_vec2_norm_squared(offset) + log_scale * log_scale < MODE_RADIUS_SQUARED)
            return 0;
    }
    return 1;
}

/* The neighbourhood of the seed is complete: shifts it (MODES) or starts the tree. */
static void end_gather(cairn_part_configurator *configurator)
{
    if (configurator->params.search == CAIRN_PART_SEARCH_MODES) {
        if (shift_mean(configurator))
            return;
        if (!is_new_mode(configurator)) {
            next_seed(configurator);
            return;
        }
        configurator->modes[configurator->mode_count++] = configurator->query.centre;
    }
    configurator->seed_count++;
    cairn_part_configuration_begin_tree(configurator);
    if (configurator->exhaustive != NULL)
        cairn_part_configuration_exhaustive_mark_seed(configurator);
    configurator->phase = PART_CONFIGURATION_ENUMERATE;
}

/* Returns 0 when the budget is exhausted. */
static int step_gather(cairn_part_configurator *configurator, cairn_budget *budget)
{
    int32_t cost = cairn_part_configuration_query_cost(configurator);
    int32_t end =
        configurator->params.nearest +
        (configurator->params.search == CAIRN_PART_SEARCH_MODES ? configurator->mode_count : 0);

    if (!cairn_budget_charge(budget, &configurator->units_charged, cost > 0 ? cost : 1 + end))
        return 0;
    if (cost > 0)
        cairn_part_configuration_query_next(configurator);
    else
        end_gather(configurator);
    return 1;
}

static int step_enumerate(cairn_part_configurator *configurator, cairn_budget *budget)
{
    int ends =
        configurator->depth < 0 || configurator->visited_count == configurator->params.max_nodes;
    int32_t units = configurator->exhaustive != NULL
                        ? cairn_part_configuration_exhaustive_units(configurator)
                    : ends ? 1 + configurator->found_count / COMPARISONS_PER_UNIT
                           : 1;

    if (!cairn_budget_charge(budget, &configurator->units_charged, units))
        return 0;
    if (!ends) {
        configurator->visited_count++;
        (void)cairn_part_configuration_visit_node(configurator);
        return 1;
    }
    configurator->truncated_count += configurator->depth >= 0;
    configurator->node_count += configurator->visited_count;
    if (configurator->best_count > 0 && configurator->exhaustive == NULL)
        insert_configuration(configurator);
    next_seed(configurator);
    return 1;
}

/* Clears a bucket, or inserts a vote. */
static int step_index(cairn_part_configurator *configurator, cairn_budget *budget)
{
    int32_t buckets = (int32_t)configurator->mask + 1;

    if (!cairn_budget_charge(budget, &configurator->units_charged,
                             configurator->exhaustive != NULL
                                 ? cairn_part_configuration_exhaustive_units(configurator)
                                 : 1))
        return 0;
    if (configurator->index_cursor < buckets) {
        configurator->bucket_heads[configurator->index_cursor] = -1;
        configurator->bucket_sizes[configurator->index_cursor] = 0;
    } else if (configurator->index_cursor < buckets + configurator->count) {
        cairn_part_configuration_insert(configurator, configurator->index_cursor - buckets);
        if (configurator->exhaustive != NULL)
            cairn_part_configuration_exhaustive_clear(configurator,
                                                      configurator->index_cursor - buckets);
    } else {
        configurator->seed = -1;
        next_seed(configurator);
        return 1;
    }
    configurator->index_cursor++;
    return 1;
}

static int step_sort(cairn_part_configurator *configurator, cairn_budget *budget)
{
    if (!cairn_budget_charge(budget, &configurator->units_charged,
                             cairn_part_configuration_exhaustive_units(configurator)))
        return 0;
    if (!cairn_part_configuration_exhaustive_sort(configurator))
        configurator->phase = PART_CONFIGURATION_DONE;
    return 1;
}

/* ---- Calls ---- */

static cairn_status check_vote(const cairn_part_configuration_vote *v, int64_t index,
                               cairn_fault *fault)
{
    if (!(cairn_abs(v->centre.x) <= MAX_COORDINATE) ||
        !(cairn_abs(v->centre.y) <= MAX_COORDINATE) || !(cairn_abs(v->from) <= MAX_COORDINATE) ||
        !(cairn_abs(v->to) <= MAX_COORDINATE) || !(cairn_abs(v->closed_length) <= MAX_COORDINATE))
        return cairn_refuse(fault, index, "a position that is not finite or beyond 1e6",
                            CAIRN_NOT_FINITE);
    if (!(v->scale >= 1 / MAX_COORDINATE && v->scale <= MAX_COORDINATE))
        return cairn_refuse(fault, index, "a scale outside 1e-6 ... 1e6", CAIRN_NOT_FINITE);
    if (!(v->weight <= MAX_COORDINATE))
        return cairn_refuse(fault, index, "a weight that is not finite or above 1e6",
                            CAIRN_NOT_FINITE);
    if (v->bundle < 0 || !(v->weight > 0) || v->to < v->from || v->closed_length < 0)
        return cairn_refuse(
            fault, index, "no vote, expected a bundle, a weight above 0 and an interval of a chain",
            CAIRN_BAD_ARGUMENT);
    return CAIRN_OK;
}

cairn_status cairn_part_configuration_begin(cairn_part_configurator *configurator,
                                            const cairn_part_configuration_vote *votes,
                                            int32_t count, cairn_fault *fault)
{
    cairn_status status = CAIRN_OK;

    if (configurator == NULL || count < 0 || (count > 0 && votes == NULL))
        return cairn_refuse(fault, -1, "no votes, expected an array", CAIRN_BAD_ARGUMENT);
    if (count > configurator->params.max_votes)
        return cairn_refuse(fault, -1, "more votes than max_votes", CAIRN_FULL);
    for (int32_t i = 0; i < count && status == CAIRN_OK; i++)
        status = check_vote(&votes[i], i, fault);
    if (status != CAIRN_OK)
        return status;
    configurator->votes = votes;
    configurator->count = count;
    configurator->index_cursor = configurator->mode_count = configurator->found_count =
        configurator->seed_count = configurator->truncated_count = configurator->units_charged = 0;
    configurator->node_count = configurator->pair_count = 0;
    if (configurator->exhaustive != NULL) {
        configurator->exhaustive->enumerated_count = 0;
        configurator->exhaustive->sorted_count = 0;
    }
    configurator->phase = count > 0 ? PART_CONFIGURATION_INDEX : PART_CONFIGURATION_DONE;
    return CAIRN_OK;
}

cairn_status cairn_part_configuration_step(cairn_part_configurator *configurator,
                                           cairn_budget *budget)
{
    int more = 1;

    if (configurator == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (more && configurator->phase != PART_CONFIGURATION_IDLE &&
           configurator->phase != PART_CONFIGURATION_DONE)
        more =
            configurator->phase == PART_CONFIGURATION_INDEX    ? step_index(configurator, budget)
            : configurator->phase == PART_CONFIGURATION_GATHER ? step_gather(configurator, budget)
            : configurator->phase == PART_CONFIGURATION_SORT   ? step_sort(configurator, budget)
                                                             : step_enumerate(configurator, budget);
    return more ? CAIRN_OK : CAIRN_MORE;
}

cairn_part_configuration_result
cairn_part_configuration_read(const cairn_part_configurator *configurator)
{
    cairn_part_configuration_result result = {.count = 0};

    if (configurator != NULL && configurator->phase == PART_CONFIGURATION_DONE) {
        result.found = configurator->found;
        result.votes = configurator->found_votes;
        result.count = configurator->found_count;
        result.seed_count = configurator->seed_count;
        result.truncated_count = configurator->truncated_count;
        result.node_count = configurator->node_count;
        result.pair_count = configurator->pair_count;
        result.enumerated_count =
            configurator->exhaustive != NULL ? configurator->exhaustive->enumerated_count : 0;
    }
    return result;
}
