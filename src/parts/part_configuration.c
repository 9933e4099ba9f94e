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

/* In tolerances squared: mean shift has converged below the first; modes within the second are
 * duplicates. */
static const cairn_real MIN_SHIFT_SQUARED = CAIRN_REAL(1e-4),
                        MODE_RADIUS_SQUARED = CAIRN_REAL(0.25);

#define INTEGER(field, ...) CAIRN_INTEGER(cairn_part_configuration_params, field, __VA_ARGS__)
#define NUMBER(field, ...)  CAIRN_NUMBER(cairn_part_configuration_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_votes, 512, 1, MAX_VOTES),
    INTEGER(nearest, 20, 1, MAX_PARTS),
    INTEGER(min_parts, 2, 1, MAX_PARTS),
    INTEGER(max_found, 64, 1, MAX_FOUND),
    INTEGER(max_nodes, 1000000, 1, MAX_NODES),
    INTEGER(search, CAIRN_PART_SEARCH_NEAREST, CAIRN_PART_SEARCH_NEAREST, CAIRN_PART_SEARCH_MODES),
    NUMBER(centre_tolerance, CAIRN_REAL(0.08), CAIRN_REAL(1e-4), 10),
    NUMBER(scale_tolerance, CAIRN_REAL(0.15), CAIRN_REAL(0.01), 1),
    NUMBER(search_radius, 3, CAIRN_REAL(0.5), 4),
    NUMBER(overlap, CAIRN_REAL(0.2), 0, 1),
    INTEGER(mode, CAIRN_MODE_DEFAULT, CAIRN_MODE_DEFAULT, CAIRN_MODE_AS_WRITTEN),
    NUMBER(min_sum, 0, 0, CAIRN_MAX_MAGNITUDE),
};
const cairn_parameters cairn_part_configuration_parameters =
    CAIRN_PARAMETERS("part_configuration", cairn_part_configuration_params, rows);

cairn_part_configuration_params cairn_part_configuration_default(void)
{
    cairn_part_configuration_params params;

    cairn_parameters_preset(&cairn_part_configuration_parameters, &params);
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

cairn_status cairn_part_configuration_check(const cairn_part_configuration_params *params,
                                            cairn_object_fault *fault)
{
    cairn_status status =
        cairn_parameters_check(&cairn_part_configuration_parameters, params, fault);

    if (status != CAIRN_OK || params->mode == CAIRN_MODE_DEFAULT)
        return status;
    status = cairn_parameters_require(params->max_votes <= MAX_WRITTEN_VOTES, "part_configuration",
                                      "max_votes: at most 8192 as written", fault);
    if (status == CAIRN_OK)
        status = cairn_parameters_require(params->search == CAIRN_PART_SEARCH_NEAREST,
                                          "part_configuration",
                                          "search: CAIRN_PART_SEARCH_NEAREST as written", fault);
    return status;
}

static uint32_t bucket_count(int32_t max_votes)
{
    uint32_t buckets = 1;

    while (buckets < (uint32_t)max_votes)
        buckets *= 2;
    return buckets;
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_part_configurator *build(cairn_pool *pool,
                                      const cairn_part_configuration_params *params)
{
    size_t votes = (size_t)params->max_votes, found = (size_t)params->max_found,
           buckets = bucket_count(params->max_votes);
    cairn_part_configurator *configurator = cairn_object_take(pool, sizeof *configurator);
    part_configuration_exhaustive *exhaustive = NULL;

    CAIRN_TAKE(configurator, pool, next_in_bucket, 2 * votes);
    CAIRN_TAKE(configurator, pool, bucket_heads, 2 * buckets);
    CAIRN_TAKE(configurator, pool, modes, votes);
    CAIRN_TAKE(configurator, pool, found, found);
    CAIRN_TAKE(configurator, pool, found_votes, found * MAX_PARTS);
    if (params->mode == CAIRN_MODE_AS_WRITTEN)
        exhaustive = cairn_part_configuration_exhaustive_build(pool, params);
    if (configurator != NULL) {
        configurator->params = *params;
        configurator->exhaustive = exhaustive;
        configurator->vote_layer = configurator->next_in_bucket + votes;
        configurator->bucket_sizes = configurator->bucket_heads + buckets;
        configurator->mask = (uint32_t)buckets - 1;
    }
    return configurator;
}

CAIRN_OBJECT(part_configuration, part_configurator, build);

/* ---- Seeds ---- */

/* Makes a vote the seed: begins the query of its neighbourhood. */
static void begin_seed(cairn_part_configurator *configurator)
{
    const cairn_part_configuration_vote *vote = &configurator->votes[configurator->seed];
    part_configuration_vote_point point = {vote->centre, vote->scale};

    configurator->shift_count = 0;
    cairn_part_configuration_query(configurator, point);
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

static int has_modes(const cairn_part_configurator *configurator)
{
    return configurator->params.search == CAIRN_PART_SEARCH_MODES;
}

/* MODES: records the mode of the seed; 0 when an earlier seed had it. */
static int record_mode(cairn_part_configurator *configurator)
{
    if (!is_new_mode(configurator))
        return 0;
    configurator->modes[configurator->mode_count++] = configurator->query.centre;
    return 1;
}

/* Begins the tree of the votes near the seed. */
static void begin_tree(cairn_part_configurator *configurator)
{
    configurator->seed_count++;
    cairn_part_configuration_begin_tree(configurator);
    if (configurator->exhaustive != NULL)
        cairn_part_configuration_exhaustive_mark_seed(configurator);
}

/* Ends the tree, completed or truncated: records its best configuration. */
static void end_tree(cairn_part_configurator *configurator)
{
    configurator->truncated_count += configurator->tree.depth >= 0;
    configurator->node_count += configurator->tree.visited_count;
    if (configurator->best.count > 0 && configurator->exhaustive == NULL)
        cairn_part_configuration_record(configurator);
}

/* ---- Step ---- */

static void clear_bucket(cairn_part_configurator *configurator, int32_t bucket)
{
    configurator->bucket_heads[bucket] = -1;
    configurator->bucket_sizes[bucket] = 0;
}

static void insert_vote(cairn_part_configurator *configurator, int32_t vote)
{
    cairn_part_configuration_insert(configurator, vote);
    if (configurator->exhaustive != NULL)
        cairn_part_configuration_exhaustive_clear(configurator, vote);
}

/* Costs in units: of an operation of the index and of a node; of the end of a query; of the end of
 * a tree. */
static int32_t node_cost(const cairn_part_configurator *configurator)
{
    return configurator->exhaustive != NULL
               ? cairn_part_configuration_exhaustive_units(configurator)
               : 1;
}

static int32_t query_end_cost(const cairn_part_configurator *configurator)
{
    return 1 + configurator->params.nearest +
           (has_modes(configurator) ? configurator->mode_count : 0);
}

/* The votes of a tree are sorted twice. */
static int32_t tree_cost(const cairn_part_configurator *configurator)
{
    return 1 + configurator->params.nearest * configurator->params.nearest / COMPARISONS_PER_UNIT;
}

static int32_t tree_end_cost(const cairn_part_configurator *configurator)
{
    return configurator->exhaustive != NULL
               ? cairn_part_configuration_exhaustive_units(configurator)
               : 1 + configurator->found_count / COMPARISONS_PER_UNIT;
}

/* The search: see Method in the head of this file. */
static int find_configurations(cairn_part_configurator *configurator, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(configurator->resume);
    for (configurator->cursor = 0; configurator->cursor <= (int32_t)configurator->mask;
         configurator->cursor++) {
        CAIRN_STEP_CHARGE(configurator, resume, budget, node_cost(configurator));
        clear_bucket(configurator, configurator->cursor);
    }
    for (configurator->cursor = 0; configurator->cursor < configurator->count;
         configurator->cursor++) {
        CAIRN_STEP_CHARGE(configurator, resume, budget, node_cost(configurator));
        insert_vote(configurator, configurator->cursor);
    }
    CAIRN_STEP_CHARGE(configurator, resume, budget, node_cost(configurator));
    for (configurator->seed = 0; configurator->seed < configurator->count; configurator->seed++) {
        begin_seed(configurator);
        do {
            while (cairn_part_configuration_query_cost(configurator) > 0) {
                CAIRN_STEP_CHARGE(configurator, resume, budget,
                                  cairn_part_configuration_query_cost(configurator));
                cairn_part_configuration_query_next(configurator);
            }
            CAIRN_STEP_CHARGE(configurator, resume, budget, query_end_cost(configurator));
        } while (has_modes(configurator) && shift_mean(configurator));
        if (has_modes(configurator) && !record_mode(configurator))
            continue;
        CAIRN_STEP_CHARGE(configurator, resume, budget, tree_cost(configurator));
        begin_tree(configurator);
        while (configurator->tree.depth >= 0 &&
               configurator->tree.visited_count < configurator->params.max_nodes) {
            CAIRN_STEP_CHARGE(configurator, resume, budget, node_cost(configurator));
            cairn_part_configuration_visit_node(configurator);
        }
        CAIRN_STEP_CHARGE(configurator, resume, budget, tree_end_cost(configurator));
        end_tree(configurator);
    }
    if (configurator->exhaustive != NULL) {
        CAIRN_STEP_CHARGE(configurator, resume, budget, node_cost(configurator));
        cairn_part_configuration_exhaustive_begin_sort(configurator);
        CAIRN_STEP_RUN(configurator, resume, budget, cairn_part_configuration_exhaustive_sort);
    }
    CAIRN_STEP_END(configurator->resume);
}

/* ---- Calls ---- */

static cairn_status check_vote(const cairn_part_configuration_vote *v, int64_t index,
                               cairn_fault *fault)
{
    if (!cairn_vec2_is_finite(v->centre) || !cairn_is_finite(v->from) || !cairn_is_finite(v->to) ||
        !cairn_is_finite(v->closed_length) || !cairn_is_finite(v->scale) ||
        !cairn_is_finite(v->weight))
        return cairn_refuse(fault, index, "a vote is not finite", CAIRN_NOT_FINITE);
    if (!cairn_vec2_is_within(v->centre, CAIRN_MAX_MAGNITUDE) ||
        cairn_abs(v->from) > CAIRN_MAX_MAGNITUDE || cairn_abs(v->to) > CAIRN_MAX_MAGNITUDE ||
        v->closed_length > CAIRN_MAX_MAGNITUDE)
        return cairn_refuse(fault, index, "a position or length beyond 1e6", CAIRN_BAD_ARGUMENT);
    if (v->scale < 1 / CAIRN_MAX_MAGNITUDE || v->scale > CAIRN_MAX_MAGNITUDE)
        return cairn_refuse(fault, index, "a scale outside 1e-6 ... 1e6", CAIRN_BAD_ARGUMENT);
    if (v->weight > CAIRN_MAX_MAGNITUDE)
        return cairn_refuse(fault, index, "a weight above 1e6", CAIRN_BAD_ARGUMENT);
    if (v->bundle < 0 || v->weight <= 0 || v->to < v->from || v->closed_length < 0)
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
    configurator->mode_count = configurator->found_count = configurator->seed_count =
        configurator->truncated_count = 0;
    configurator->node_count = configurator->pair_count = 0;
    if (configurator->exhaustive != NULL)
        configurator->exhaustive->enumerated_count = 0;
    configurator->resume = configurator->units_charged = 0;
    configurator->is_pending = count > 0;
    configurator->is_complete = !configurator->is_pending;
    return CAIRN_OK;
}

cairn_status cairn_part_configuration_step(cairn_part_configurator *configurator,
                                           cairn_budget *budget)
{
    if (configurator == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (configurator->is_pending && find_configurations(configurator, budget)) {
        configurator->is_pending = 0;
        configurator->is_complete = 1;
    }
    return configurator->is_pending ? CAIRN_MORE : CAIRN_OK;
}

cairn_part_configuration_result
cairn_part_configuration_read(const cairn_part_configurator *configurator)
{
    cairn_part_configuration_result result = {.count = 0};

    if (configurator != NULL && configurator->is_complete) {
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
