/* Configurations of parts that agree.
 *
 * Method: distances of votes are those of their centres, over the scale of the one that is looked
 * around, and of the logarithms of their scales, in tolerances. The K nearest within reach come
 * from a hash grid: layers of scales as high as the reach, in each square cells as wide as the
 * reach of its largest scale, so that three layers and a few cells of each hold all that may be
 * near. Of these votes a tree of configurations is gone through, level by level a bundle: one of
 * its votes or none. A configuration's score is its gain less half of what its votes scatter about
 * their mean, by gain. Scatter never falls when a vote is added, so that below a node no score is
 * above its own and the greatest gain of each bundle that is left: what is not better so is left
 * out, and nothing is lost.
 *
 * MODES: the place looked around moves to the mean of the K nearest votes by gain exp(-d^2 / 2)
 * until it moves no more, and is left out when an earlier one is within half a tolerance.
 *
 * As written: the K nearest come from all votes, one by one, by their centres; the tree is gone
 * through whole, but for branches below the threshold (part_configuration_every.c).
 *
 * Layout: the index; the votes near the seed in groups; one node for each level; the best
 * configurations, in order by their slots.
 *
 * Limits: the tree is exponential in the bundles, (K / bundles + 1)^bundles nodes at most;
 * max_nodes bounds it, and is told. One configuration for each seed.
 *
 * Source: Adluru 2008, section 5.2.2; distance, score and bound: this project's. */
#include "src/core/build.h"

#include <string.h>

#include "src/contour/part_configuration_work.h"

enum {
    VOTES_MOST = 1 << 20,
    WRITTEN_MOST = 8192,
    FOUND_MOST = 1 << 16,
    NODES_MOST = 1 << 30,
    PARTS = CONFIGURATION_PARTS
};
/* Steps of a climb; kept configurations that are compared for a unit. */
enum { CLIMBS = 30, COMPARED_A_UNIT = 4 };

static const cairn_real FAR = CAIRN_REAL(1e6);
/* In tolerances, squared: a climb that moves less has ended; two modes that are nearer are one. */
static const cairn_real SETTLED = CAIRN_REAL(1e-4), SAME_MODE = CAIRN_REAL(0.25);

cairn_part_configuration_params cairn_part_configuration_default(void)
{
    cairn_part_configuration_params params = {512,
                                              20,
                                              2,
                                              64,
                                              1000000,
                                              CAIRN_PART_SEEK_NEAREST,
                                              CAIRN_REAL(0.08),
                                              CAIRN_REAL(0.15),
                                              3,
                                              CAIRN_REAL(0.2),
                                              CAIRN_MODE_DEFAULT,
                                              0};

    return params;
}

cairn_part_configuration_params cairn_part_configuration_as_written(void)
{
    cairn_part_configuration_params params = cairn_part_configuration_default();

    params.mode = CAIRN_MODE_AS_WRITTEN;
    params.min_parts = 1;
    params.max_found = 4096;
    params.max_nodes = NODES_MOST;
    return params;
}

static int mode_is_good(const cairn_part_configuration_params *p)
{
    return (p->mode == CAIRN_MODE_DEFAULT || p->mode == CAIRN_MODE_AS_WRITTEN) && p->min_sum >= 0 &&
           p->min_sum <= FAR &&
           (p->mode == CAIRN_MODE_DEFAULT ||
            (p->max_votes <= WRITTEN_MOST && p->seek == CAIRN_PART_SEEK_NEAREST));
}

static int capacities_are_good(const cairn_part_configuration_params *p)
{
    return p->max_votes >= 1 && p->max_votes <= VOTES_MOST && p->nearest >= 1 &&
           p->nearest <= PARTS && p->min_parts >= 1 && p->min_parts <= PARTS && p->max_found >= 1 &&
           p->max_found <= FOUND_MOST && p->max_nodes >= 1 && p->max_nodes <= NODES_MOST;
}

static int params_are_good(const cairn_part_configuration_params *p)
{
    return p != NULL && capacities_are_good(p) && mode_is_good(p) &&
           p->seek >= CAIRN_PART_SEEK_NEAREST && p->seek <= CAIRN_PART_SEEK_MODES &&
           p->centre >= CAIRN_REAL(1e-4) && p->centre <= 10 && p->ratio >= CAIRN_REAL(0.01) &&
           p->ratio <= 1 && p->reach >= CAIRN_REAL(0.5) && p->reach <= 4 && p->overlap >= 0 &&
           p->overlap <= 1;
}

static uint32_t bucket_count(int32_t max_votes)
{
    uint32_t buckets = 1;

    while (buckets < (uint32_t)max_votes)
        buckets *= 2;
    return buckets;
}

static cairn_part_configurator *carve(cairn_pool *pool, const cairn_part_configuration_params *p)
{
    size_t votes = (size_t)p->max_votes, found = (size_t)p->max_found,
           buckets = bucket_count(p->max_votes);
    cairn_part_configurator *c = cairn_pool_take_one(pool, sizeof *c);
    int32_t *next = cairn_pool_take(pool, 2 * votes, sizeof *next);
    int32_t *heads = cairn_pool_take(pool, 2 * buckets, sizeof *heads);
    vote_place *modes = cairn_pool_take(pool, votes, sizeof *modes);
    cairn_part_configuration *kept = cairn_pool_take(pool, found, sizeof *kept);
    int32_t *found_votes = cairn_pool_take(pool, found * PARTS, sizeof *found_votes);
    configuration_every *every = NULL;

    if (p->mode == CAIRN_MODE_AS_WRITTEN)
        cairn_part_configuration_every_carve(pool, p, &every);
    if (c != NULL) {
        memset(c, 0, sizeof *c);
        c->every = every;
        c->next = next;
        c->layer = next + votes;
        c->heads = heads;
        c->sizes = heads + buckets;
        c->modes = modes;
        c->found = kept;
        c->found_votes = found_votes;
        c->mask = (uint32_t)buckets - 1;
    }
    return c;
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
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    *configurator = carve(pool, params);
    (*configurator)->params = *params;
    return CAIRN_OK;
}

/* ---- What was found ---- */

static int32_t *votes_of(const cairn_part_configurator *c, int32_t slot)
{
    return &c->found_votes[(size_t)c->found[slot].first];
}

static int is_same(const cairn_part_configurator *c, int32_t slot)
{
    return c->found[slot].count == c->best_count &&
           memcmp(votes_of(c, slot), c->best_votes,
                  (size_t)c->best_count * sizeof *c->best_votes) == 0;
}

static void sort_votes(cairn_part_configurator *c)
{
    for (int32_t i = 1; i < c->best_count; i++) {
        int32_t v = c->best_votes[i], k = i;

        for (; k > 0 && c->best_votes[k - 1] > v; k--)
            c->best_votes[k] = c->best_votes[k - 1];
        c->best_votes[k] = v;
    }
}

cairn_part_configuration cairn_part_configuration_describe(cairn_part_configurator *c,
                                                           int32_t first)
{
    const configuration_node *n = &c->best_node;
    cairn_part_configuration made;

    sort_votes(c);
    made.score = c->best;
    made.gain = n->gain;
    made.scale = c->query.at.scale * cairn_exp(n->ratio * c->params.ratio);
    made.centre.x = c->query.at.centre.x + n->x * c->params.centre * c->query.at.scale;
    made.centre.y = c->query.at.centre.y + n->y * c->params.centre * c->query.at.scale;
    made.seed = c->seed;
    made.first = first;
    made.count = c->best_count;
    memcpy(&c->found_votes[first], c->best_votes, (size_t)made.count * sizeof *c->best_votes);
    return made;
}

/* The seed's best configuration among those found; the place of its votes stays with the slot
 * that it takes. */
static void keep(cairn_part_configurator *c)
{
    cairn_part_configuration made;
    int32_t at = 0;

    sort_votes(c);
    while (at < c->found_count && !is_same(c, at))
        at++;
    if (at == c->found_count && c->found_count < c->params.max_found) {
        c->found[at].first = at * PARTS;
        c->found_count++;
    } else {
        at = at < c->found_count ? at : at - 1;
        if (!(c->best > c->found[at].score))
            return;
    }
    made = cairn_part_configuration_describe(c, c->found[at].first);
    for (; at > 0 && c->found[at - 1].score < made.score; at--)
        c->found[at] = c->found[at - 1];
    c->found[at] = made;
}

/* ---- Seeds ---- */

/* To the next vote, or none. */
static void next_seed(cairn_part_configurator *c)
{
    vote_place at;

    c->phase = c->every != NULL ? CONFIGURATION_SORT : CONFIGURATION_DONE;
    if (++c->seed >= c->count)
        return;
    at.centre = c->votes[c->seed].centre;
    at.scale = c->votes[c->seed].scale;
    c->climbs = 0;
    cairn_part_configuration_query(c, at);
    c->phase = CONFIGURATION_GATHER;
}

/* A step of the mean shift. 0: it has settled. */
static int climb(cairn_part_configurator *c)
{
    cairn_real sum = 0, x = 0, y = 0, ratio = 0, size = c->params.centre * c->query.at.scale;
    vote_place at = c->query.at;

    for (int32_t i = 0; i < c->near_count; i++) {
        const near_vote *n = &c->near[i];
        cairn_real weight = c->votes[n->vote].gain * cairn_exp(-n->squared / 2);

        sum += weight;
        x += weight * n->x;
        y += weight * n->y;
        ratio += weight * n->ratio;
    }
    if (c->climbs++ == CLIMBS || !(x * x + y * y + ratio * ratio > SETTLED * sum * sum))
        return 0;
    at.centre.x += x / sum * size;
    at.centre.y += y / sum * size;
    at.scale *= cairn_exp(ratio / sum * c->params.ratio);
    cairn_part_configuration_query(c, at);
    return 1;
}

static int is_new_mode(const cairn_part_configurator *c)
{
    cairn_real size = c->params.centre * c->query.at.scale, scale = cairn_log(c->query.at.scale);

    for (int32_t i = 0; i < c->modes_count; i++) {
        cairn_vec2 apart =
            cairn_vec2_scale(cairn_vec2_sub(c->modes[i].centre, c->query.at.centre), 1 / size);
        cairn_real ratio = (cairn_log(c->modes[i].scale) - scale) / c->params.ratio;

        if (cairn_vec2_norm_squared(apart) + ratio * ratio < SAME_MODE)
            return 0;
    }
    return 1;
}

/* The votes near the seed are all there. */
static void end_gathering(cairn_part_configurator *c)
{
    if (c->params.seek == CAIRN_PART_SEEK_MODES) {
        if (climb(c))
            return;
        if (!is_new_mode(c)) {
            next_seed(c);
            return;
        }
        c->modes[c->modes_count++] = c->query.at;
    }
    c->seeds++;
    cairn_part_configuration_plant(c);
    if (c->every != NULL)
        cairn_part_configuration_every_plant(c);
    c->phase = CONFIGURATION_ENUMERATE;
}

/* 0: the budget is used up. */
static int do_gather(cairn_part_configurator *c, cairn_budget *budget)
{
    int32_t cost = cairn_part_configuration_query_cost(c);
    int32_t end =
        c->params.nearest + (c->params.seek == CAIRN_PART_SEEK_MODES ? c->modes_count : 0);

    if (!cairn_budget_pay(budget, &c->paid, cost > 0 ? cost : 1 + end))
        return 0;
    if (cost > 0)
        cairn_part_configuration_query_next(c);
    else
        end_gathering(c);
    return 1;
}

static int do_enumerate(cairn_part_configurator *c, cairn_budget *budget)
{
    int ends = c->depth < 0 || c->visited == c->params.max_nodes;
    int32_t units = c->every != NULL ? cairn_part_configuration_every_units(c)
                    : ends           ? 1 + c->found_count / COMPARED_A_UNIT
                                     : 1;

    if (!cairn_budget_pay(budget, &c->paid, units))
        return 0;
    if (!ends) {
        c->visited++;
        (void)cairn_part_configuration_visit(c);
        return 1;
    }
    c->cut += c->depth >= 0;
    c->all_nodes += c->visited;
    if (c->best_count > 0 && c->every == NULL)
        keep(c);
    next_seed(c);
    return 1;
}

/* Empties a bucket, or takes in a vote. */
static int do_index(cairn_part_configurator *c, cairn_budget *budget)
{
    int32_t buckets = (int32_t)c->mask + 1;

    if (!cairn_budget_pay(budget, &c->paid,
                          c->every != NULL ? cairn_part_configuration_every_units(c) : 1))
        return 0;
    if (c->indexed < buckets) {
        c->heads[c->indexed] = -1;
        c->sizes[c->indexed] = 0;
    } else if (c->indexed < buckets + c->count) {
        cairn_part_configuration_insert(c, c->indexed - buckets);
        if (c->every != NULL)
            cairn_part_configuration_every_clear(c, c->indexed - buckets);
    } else {
        c->seed = -1;
        next_seed(c);
        return 1;
    }
    c->indexed++;
    return 1;
}

static int do_sort(cairn_part_configurator *c, cairn_budget *budget)
{
    if (!cairn_budget_pay(budget, &c->paid, cairn_part_configuration_every_units(c)))
        return 0;
    if (!cairn_part_configuration_every_sort(c))
        c->phase = CONFIGURATION_DONE;
    return 1;
}

/* ---- Calls ---- */

static cairn_status check_vote(const cairn_part_vote *v, int64_t index, cairn_fault *fault)
{
    if (!(cairn_abs(v->centre.x) <= FAR) || !(cairn_abs(v->centre.y) <= FAR) ||
        !(cairn_abs(v->from) <= FAR) || !(cairn_abs(v->to) <= FAR) || !(cairn_abs(v->round) <= FAR))
        return cairn_refuse(fault, index, "a place that is not finite or beyond 1e6",
                            CAIRN_NOT_FINITE);
    if (!(v->scale >= 1 / FAR && v->scale <= FAR))
        return cairn_refuse(fault, index, "a scale outside 1e-6 ... 1e6", CAIRN_NOT_FINITE);
    if (!(v->gain <= FAR))
        return cairn_refuse(fault, index, "a gain that is not finite or above 1e6",
                            CAIRN_NOT_FINITE);
    if (v->bundle < 0 || !(v->gain > 0) || v->to < v->from || v->round < 0)
        return cairn_refuse(fault, index,
                            "no vote, expected a bundle, a gain above 0 and a piece of a chain",
                            CAIRN_BAD_ARGUMENT);
    return CAIRN_OK;
}

cairn_status cairn_part_configuration_begin(cairn_part_configurator *c,
                                            const cairn_part_vote *votes, int32_t count,
                                            cairn_fault *fault)
{
    cairn_status status = CAIRN_OK;

    if (c == NULL || count < 0 || (count > 0 && votes == NULL))
        return cairn_refuse(fault, -1, "no votes, expected an array", CAIRN_BAD_ARGUMENT);
    if (count > c->params.max_votes)
        return cairn_refuse(fault, -1, "more votes than max_votes", CAIRN_FULL);
    for (int32_t i = 0; i < count && status == CAIRN_OK; i++)
        status = check_vote(&votes[i], i, fault);
    if (status != CAIRN_OK)
        return status;
    c->votes = votes;
    c->count = count;
    c->indexed = c->modes_count = c->found_count = c->seeds = c->cut = c->paid = 0;
    c->all_nodes = c->pairs = 0;
    if (c->every != NULL) {
        c->every->made = 0;
        c->every->sorted = 0;
    }
    c->phase = count > 0 ? CONFIGURATION_INDEX : CONFIGURATION_DONE;
    return CAIRN_OK;
}

cairn_status cairn_part_configuration_step(cairn_part_configurator *c, cairn_budget *budget)
{
    int more = 1;

    if (c == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    while (more && c->phase != CONFIGURATION_IDLE && c->phase != CONFIGURATION_DONE)
        more = c->phase == CONFIGURATION_INDEX    ? do_index(c, budget)
               : c->phase == CONFIGURATION_GATHER ? do_gather(c, budget)
               : c->phase == CONFIGURATION_SORT   ? do_sort(c, budget)
                                                  : do_enumerate(c, budget);
    return more ? CAIRN_OK : CAIRN_MORE;
}

cairn_part_configuration_result cairn_part_configuration_read(const cairn_part_configurator *c)
{
    cairn_part_configuration_result result = {NULL, NULL, 0, 0, 0, 0, 0, 0};

    if (c != NULL && c->phase == CONFIGURATION_DONE) {
        result.found = c->found;
        result.votes = c->found_votes;
        result.count = c->found_count;
        result.seeds = c->seeds;
        result.cut = c->cut;
        result.nodes = c->all_nodes;
        result.pairs = c->pairs;
        result.made = c->every != NULL ? c->every->made : 0;
    }
    return result;
}
