/* Particle filter by sequential importance resampling (SIR).
 *
 * Method of a step:
 * 1. All particles propose candidates. Then for each particle, in turn: the prior masses are
 *    normalized, candidates are weighted by the likelihood, followers are drawn.
 * 2. n followers are drawn by residual sampling, m_k copies of candidate k. All copies of a
 *    candidate are one follower with the weight
 *
 *        prior proposal:    w m_k / n p(z | x_k)
 *        optimal proposal:  w m_k / n sum_l p(z | x_l) p(x_l | x)
 *        prior boosting:    w p(z | x_k)
 *
 *    The first two are unbiased, because E[m_k] is n times the mass of k. When there are at most n
 *    candidates none is drawn: each becomes a follower of weight w p(z | x_k) p(x_k | x). Boosted
 *    followers keep w p(z | x_k), drawn or not.
 * 3. The followers of the largest weights, up to max_particles, are kept in a heap.
 * 4. The weights are normalized. When N_eff = 1 / sum w^2 is too small, the population is resampled
 *    by residual resampling: floor(N w) copies of each particle, the rest drawn by the residuals of
 *    N w.
 *
 * Weights are logarithms throughout; only ratios to the largest one are exponentiated.
 *
 * Layout: a node of the tree of histories is a header followed by the caller's state, in a block
 * pool. A node is referenced by its children and by the particles whose history ends there. A node
 * without references is freed, and so on towards the root. There are three populations: the current
 * one, which readers see, the followers, and the one resampled from them.
 *
 * Source: Adluru 2008, sections 2.3, 9.2.2 and 9.3; residual resampling: Liu and Chen 1998; N_eff:
 * Kong, Liu and Wong 1994. */
#include "src/base/build.h"

#include <string.h>

#include "src/containers/heap.h"
#include "src/numerics/particle_filter_work.h"

/* Largest number of particles, candidates or bytes of a state, and of blocks. */
enum { MAX_COUNT = 1 << 20, MAX_BLOCKS = 1 << 28 };

#define INTEGER(field, ...) CAIRN_INTEGER(cairn_particle_filter_params, field, __VA_ARGS__)
#define NUMBER(field, ...)  CAIRN_NUMBER(cairn_particle_filter_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(particles, 100, 1, MAX_COUNT),
    INTEGER(max_particles, 100, 1, MAX_COUNT),
    INTEGER(max_followers, 8, 1, MAX_COUNT),
    INTEGER(max_candidates, 4096, 1, MAX_COUNT),
    INTEGER(max_blocks, 4096, 1, MAX_BLOCKS),
    INTEGER(state_bytes, 64, 1, MAX_COUNT),
    INTEGER(proposal, CAIRN_PARTICLE_FILTER_PROPOSAL_OPTIMAL, CAIRN_PARTICLE_FILTER_PROPOSAL_PRIOR,
            CAIRN_PARTICLE_FILTER_PROPOSAL_BOOSTED),
    INTEGER(adaptive_followers, 1, 0, 1),
    INTEGER(max_history, 0, 0, MAX_COUNT),
    NUMBER(resample_ratio, CAIRN_REAL(0.5), 0, 1),
};
const cairn_parameters cairn_particle_filter_parameters =
    CAIRN_PARAMETERS("particle_filter", cairn_particle_filter_params, rows);

cairn_particle_filter_params cairn_particle_filter_default(void)
{
    cairn_particle_filter_params params;

    cairn_parameters_preset(&cairn_particle_filter_parameters, &params);
    return params;
}

cairn_status cairn_particle_filter_check(const cairn_particle_filter_params *params,
                                         cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_particle_filter_parameters, params, fault);

    if (status == CAIRN_OK)
        status =
            cairn_parameters_require(params->particles <= params->max_particles, "particle_filter",
                                     "particles: at most max_particles", fault);
    return status;
}

/* Bytes of a state, rounded up to the alignment. */
static size_t stride_of(const cairn_particle_filter_params *params)
{
    return ((size_t)params->state_bytes + CAIRN_ALIGN - 1) / CAIRN_ALIGN * CAIRN_ALIGN;
}

/* Creates the pool of nodes; of a counting pool, where filter is NULL, counts only its bytes. */
static void take_blocks(cairn_particle_filter *filter, cairn_pool *pool,
                        const cairn_particle_filter_params *params)
{
    size_t bytes = PARTICLE_FILTER_HEADER + stride_of(params), count = (size_t)params->max_blocks;

    if (filter == NULL) {
        cairn_pool_count(pool, cairn_block_pool_memory(bytes, count));
        return;
    }
    cairn_must_be_ok(cairn_block_pool_create(&filter->blocks, pool, bytes, count));
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_particle_filter *build(cairn_pool *pool, const cairn_particle_filter_params *params)
{
    size_t particles = (size_t)params->max_particles, candidates = (size_t)params->max_candidates;
    size_t most = particles > candidates ? particles : candidates;
    cairn_particle_filter *filter = cairn_object_take(pool, sizeof *filter);
    unsigned char *states;

    CAIRN_TAKE(filter, pool, current.list, particles);
    CAIRN_TAKE(filter, pool, next.list, particles);
    CAIRN_TAKE(filter, pool, resampled.list, particles);
    CAIRN_TAKE(filter, pool, candidates, candidates);
    states = cairn_pool_take(pool, candidates, stride_of(params));
    CAIRN_TAKE(filter, pool, first_candidate, particles + 1);
    CAIRN_TAKE(filter, pool, masses.mass, most);
    CAIRN_TAKE(filter, pool, drawing.copies, most);
    take_blocks(filter, pool, params);
    if (filter != NULL) {
        filter->params = *params;
        filter->states = states;
        filter->state_stride = stride_of(params);
        filter->random = cairn_random_seed(0, 0);
    }
    return filter;
}

size_t cairn_particle_filter_memory(const cairn_particle_filter_params *params)
{
    cairn_pool counting;

    if (cairn_particle_filter_check(params, NULL) != CAIRN_OK)
        return 0;
    cairn_pool_init_counting(&counting);
    (void)build(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_particle_filter_create(cairn_particle_filter **filter, cairn_pool *pool,
                                          const cairn_particle_filter_params *params,
                                          const cairn_particle_filter_model *model)
{
    cairn_status status = cairn_object_admit(filter, pool, cairn_particle_filter_memory(params));

    if (model == NULL || model->propose == NULL || model->likelihood == NULL)
        status = CAIRN_BAD_ARGUMENT;
    if (status != CAIRN_OK)
        return status;
    *filter = build(pool, params);
    (*filter)->model = *model;
    return CAIRN_OK;
}

/* ---- The tree of histories ---- */

/* Creates a child of `parent` with a copy of the state and one reference. NULL when no block is
 * free. */
static particle_filter_node *create_node(cairn_particle_filter *filter,
                                         particle_filter_node *parent, const void *state)
{
    particle_filter_node *node = cairn_block_pool_take(filter->blocks);

    if (node == NULL)
        return NULL;
    node->parent = parent;
    node->references = 1;
    node->depth = parent == NULL ? 0 : parent->depth + 1;
    memcpy(particle_filter_state(node), state, (size_t)filter->params.state_bytes);
    if (parent != NULL)
        parent->references++;
    return node;
}

particle_filter_node *cairn_particle_filter_drop_node(cairn_particle_filter *filter,
                                                      particle_filter_node *node)
{
    particle_filter_node *parent = node->parent;

    CAIRN_ASSERT(node->references > 0);
    if (--node->references > 0)
        return NULL;
    cairn_must_be_ok(cairn_block_pool_give(filter->blocks, node));
    return parent;
}

/* Removes a reference from a node, and frees all nodes that are then without one. */
static void release_history(cairn_particle_filter *filter, particle_filter_node *node)
{
    while (node != NULL)
        node = cairn_particle_filter_drop_node(filter, node);
}

/* Truncates a history to the states that are kept (max_history). */
static void truncate_history(cairn_particle_filter *filter, particle_filter_node *leaf)
{
    particle_filter_node *node = leaf;

    for (int32_t k = 0; k < filter->params.max_history && node != NULL; k++)
        node = node->parent;
    if (node != NULL && filter->params.max_history > 0) {
        release_history(filter, node->parent);
        node->parent = NULL;
    }
}

/* ---- Populations ---- */

int cairn_particle_filter_is_lighter(const particle_filter_particle *a,
                                     const particle_filter_particle *b)
{
    return a->log_weight < b->log_weight ||
           (a->log_weight == b->log_weight && a->birth_number > b->birth_number);
}

/* The lightest particle is on top of the heap. */
static int is_lighter_at(const void *context, int32_t a, int32_t b)
{
    const particle_filter_particle *list = context;

    return cairn_particle_filter_is_lighter(&list[a], &list[b]);
}

static void exchange_particles(void *context, int32_t a, int32_t b)
{
    particle_filter_particle *list = context, moved = list[a];

    list[a] = list[b];
    list[b] = moved;
}

cairn_status cairn_particle_filter_add_follower(cairn_particle_filter *filter,
                                                particle_filter_particle follower,
                                                particle_filter_node *parent, const void *state)
{
    particle_filter_population *next = &filter->next;
    int32_t most = filter->params.max_particles;
    int is_full = next->count == most;

    follower.birth_number = filter->birth_count++;
    filter->step_trace.followers++;
    filter->step_trace.pruned_followers += is_full;
    if (is_full && cairn_particle_filter_is_lighter(&follower, &next->list[0]))
        return CAIRN_OK;
    /* Frees one node: its parent has other references. */
    if (is_full)
        release_history(filter, next->list[0].leaf);
    follower.leaf = create_node(filter, parent, state);
    if (follower.leaf == NULL) {
        if (is_full) {
            next->list[0] = next->list[--next->count];
            heap_sift_down(next->list, 0, next->count, is_lighter_at, exchange_particles);
        }
        return CAIRN_FULL;
    }
    truncate_history(filter, follower.leaf);
    if (filter->model.append != NULL)
        filter->model.append(filter->model.context, filter, filter->index,
                             particle_filter_state(follower.leaf));
    next->list[heap_keep_place(next->count, most)] = follower;
    next->count = heap_keep(next->list, next->count, most, is_lighter_at, exchange_particles);
    return CAIRN_OK;
}

cairn_status cairn_particle_filter_clear(cairn_particle_filter *filter, uint64_t seed)
{
    particle_filter_population *all[2];

    if (filter == NULL)
        return CAIRN_BAD_ARGUMENT;
    release_history(filter, filter->node_to_release);
    filter->node_to_release = NULL;
    all[0] = &filter->current;
    all[1] = &filter->next;
    for (int k = 0; k < 2; k++)
        while (all[k]->count > 0)
            release_history(filter, all[k]->list[--all[k]->count].leaf);
    while (filter->resampled.count > 0)
        release_history(filter, filter->resampled.list[--filter->resampled.count].leaf);
    filter->random = cairn_random_seed(seed, 0);
    filter->is_running = 0;
    filter->has_begun = 0;
    memset(&filter->last_trace, 0, sizeof filter->last_trace);
    return CAIRN_OK;
}

cairn_status cairn_particle_filter_start(cairn_particle_filter *filter, const void *state,
                                         cairn_real log_weight)
{
    particle_filter_particle particle = {.log_weight = log_weight};

    if (filter == NULL || state == NULL || filter->has_begun)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_is_finite(log_weight))
        return CAIRN_NOT_FINITE;
    if (filter->current.count == filter->params.max_particles)
        return CAIRN_FULL;
    particle.leaf = create_node(filter, NULL, state);
    if (particle.leaf == NULL)
        return CAIRN_FULL;
    filter->current.list[filter->current.count++] = particle;
    filter->last_trace.particles = filter->current.count;
    return CAIRN_OK;
}

cairn_status cairn_particle_filter_begin(cairn_particle_filter *filter)
{
    if (filter == NULL || filter->is_running)
        return CAIRN_BAD_ARGUMENT;
    if (filter->current.count == 0)
        return CAIRN_EMPTY;
    memset(&filter->step_trace, 0, sizeof filter->step_trace);
    filter->step_trace.steps = filter->last_trace.steps + 1;
    filter->step_trace.resamplings = filter->last_trace.resamplings;
    filter->step_trace.log_evidence = filter->last_trace.log_evidence;
    filter->has_begun = 1;
    filter->first_candidate[0] = 0;
    filter->birth_count = 0;
    filter->max_log_weight = PARTICLE_FILTER_IMPOSSIBLE;
    filter->outcome = CAIRN_OK;
    filter->units_charged = 0;
    filter->resume = filter->follow.resume = filter->phase_resume = 0;
    filter->is_running = 1;
    return CAIRN_OK;
}

cairn_status cairn_particle_filter_offer(cairn_particle_filter *filter, const void *state,
                                         cairn_real log_mass)
{
    int32_t at;

    if (filter == NULL || state == NULL || !filter->is_proposing)
        return CAIRN_BAD_ARGUMENT;
    if (!(log_mass <= CAIRN_REAL_MAX))
        return CAIRN_NOT_FINITE;
    at = filter->step_trace.candidates;
    if (at == filter->params.max_candidates) {
        filter->step_trace.dropped_candidates++;
        return CAIRN_FULL;
    }
    memcpy(filter->states + (size_t)at * filter->state_stride, state,
           (size_t)filter->params.state_bytes);
    filter->candidates[at].log_prior = log_mass;
    filter->candidates[at].log_likelihood = 0;
    filter->step_trace.candidates++;
    return CAIRN_OK;
}

int32_t cairn_particle_filter_count(const cairn_particle_filter *filter)
{
    return filter->current.count;
}

cairn_particle cairn_particle_filter_particle(const cairn_particle_filter *filter, int32_t index)
{
    cairn_particle result = {.state = NULL};

    if (index >= 0 && index < filter->current.count) {
        const particle_filter_particle *particle = &filter->current.list[index];

        result.state = particle_filter_state(particle->leaf);
        result.log_weight = particle->log_weight;
        result.log_likelihood = particle->log_likelihood;
        result.steps = particle->leaf->depth;
    }
    return result;
}

const void *cairn_particle_filter_state_before(const void *state)
{
    const particle_filter_node *node =
        (const void *)((const unsigned char *)state - PARTICLE_FILTER_HEADER);

    return node->parent == NULL ? NULL
                                : (const unsigned char *)node->parent + PARTICLE_FILTER_HEADER;
}

void *cairn_particle_filter_own_state(cairn_particle_filter *filter, int32_t index, void *after)
{
    particle_filter_node **link, *shared, *own;
    cairn_block_pool_usage usage;

    if (filter == NULL || filter->is_running || index < 0 || index >= filter->current.count)
        return NULL;
    link = &filter->current.list[index].leaf;
    if (after != NULL)
        link = &((particle_filter_node *)(void *)((unsigned char *)after - PARTICLE_FILTER_HEADER))
                    ->parent;
    shared = *link;
    if (shared == NULL || shared->references == 1)
        return shared == NULL ? NULL : particle_filter_state(shared);
    own = create_node(filter, shared->parent, particle_filter_state(shared));
    if (own == NULL)
        return NULL;
    shared->references--;
    *link = own;
    usage = cairn_block_pool_read(filter->blocks);
    filter->last_trace.blocks = usage.used;
    filter->last_trace.blocks_peak = usage.peak;
    return particle_filter_state(own);
}

cairn_particle_filter_trace cairn_particle_filter_read(const cairn_particle_filter *filter)
{
    return filter->last_trace;
}
