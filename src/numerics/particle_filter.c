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
 *    which is unbiased, because E[m_k] is n times the mass of k. When there are at most n
 *    candidates none is drawn: each becomes a follower of weight w p(z | x_k) p(x_k | x).
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

cairn_particle_filter_params cairn_particle_filter_default(void)
{
    cairn_particle_filter_params params = {
        .particles = 100,
        .max_particles = 100,
        .max_followers = 8,
        .max_candidates = 4096,
        .max_blocks = 4096,
        .state_bytes = 64,
        .proposal = CAIRN_PARTICLE_FILTER_PROPOSAL_OPTIMAL,
        .adaptive_followers = 1,
        .resample_ratio = CAIRN_REAL(0.5),
    };
    return params;
}

/* 1 for a number in range. */
static int is_count(int32_t count)
{
    return count >= 1 && count <= MAX_COUNT;
}

/* 1 when all params are in range. */
static int params_are_valid(const cairn_particle_filter_params *params)
{
    return params != NULL && params->particles >= 1 && is_count(params->max_particles) &&
           params->particles <= params->max_particles && is_count(params->max_followers) &&
           is_count(params->max_candidates) && params->max_blocks >= 1 &&
           params->max_blocks <= MAX_BLOCKS && is_count(params->state_bytes) &&
           params->proposal >= CAIRN_PARTICLE_FILTER_PROPOSAL_PRIOR &&
           params->proposal <= CAIRN_PARTICLE_FILTER_PROPOSAL_BOOSTED &&
           params->adaptive_followers >= 0 && params->adaptive_followers <= 1 &&
           params->max_history >= 0 && params->max_history <= MAX_COUNT &&
           params->resample_ratio >= 0 && params->resample_ratio <= 1;
}

/* Bytes of a state, rounded up to the alignment. */
static size_t stride_of(const cairn_particle_filter_params *params)
{
    return ((size_t)params->state_bytes + CAIRN_ALIGN - 1) / CAIRN_ALIGN * CAIRN_ALIGN;
}

/* Allocates the block pool; NULL from a counting pool. */
static cairn_block_pool *carve_blocks(cairn_pool *pool, size_t bytes, size_t count)
{
    cairn_block_pool *blocks = NULL;
    cairn_status status;

    if (pool->base == NULL) {
        cairn_pool_count(pool, cairn_block_pool_memory(bytes, count));
        return NULL;
    }
    status = cairn_block_pool_create(&blocks, pool, bytes, count);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    return blocks;
}

/* Allocates the object and its arrays; NULL from a counting pool. */
static cairn_particle_filter *carve(cairn_pool *pool, const cairn_particle_filter_params *params)
{
    size_t particles = (size_t)params->max_particles, candidates = (size_t)params->max_candidates;
    size_t most = particles > candidates ? particles : candidates;
    cairn_particle_filter *filter = cairn_pool_take_one(pool, sizeof *filter);
    particle_filter_particle *current = cairn_pool_take(pool, particles, sizeof *current);
    particle_filter_particle *next = cairn_pool_take(pool, particles, sizeof *next);
    particle_filter_particle *resampled = cairn_pool_take(pool, particles, sizeof *resampled);
    particle_filter_candidate *candidate_list =
        cairn_pool_take(pool, candidates, sizeof *candidate_list);
    unsigned char *states = cairn_pool_take(pool, candidates, stride_of(params));
    int32_t *first_candidate = cairn_pool_take(pool, particles + 1, sizeof *first_candidate);
    cairn_real *mass = cairn_pool_take(pool, most, sizeof *mass);
    int32_t *copies = cairn_pool_take(pool, most, sizeof *copies);
    cairn_block_pool *blocks =
        carve_blocks(pool, PARTICLE_FILTER_HEADER + stride_of(params), (size_t)params->max_blocks);

    if (filter == NULL)
        return NULL;
    memset(filter, 0, sizeof *filter);
    filter->params = *params;
    filter->state_stride = stride_of(params);
    filter->current.list = current;
    filter->next.list = next;
    filter->resampled.list = resampled;
    filter->candidates = candidate_list;
    filter->states = states;
    filter->first_candidate = first_candidate;
    filter->mass = mass;
    filter->copies = copies;
    filter->blocks = blocks;
    return filter;
}

size_t cairn_particle_filter_memory(const cairn_particle_filter_params *params)
{
    cairn_pool counting;

    if (!params_are_valid(params))
        return 0;
    cairn_pool_init_counting(&counting);
    (void)carve(&counting, params);
    return cairn_pool_counted(&counting);
}

cairn_status cairn_particle_filter_create(cairn_particle_filter **filter, cairn_pool *pool,
                                          const cairn_particle_filter_params *params,
                                          const cairn_particle_filter_model *model)
{
    size_t need = cairn_particle_filter_memory(params);
    cairn_particle_filter *made;

    if (filter == NULL || pool == NULL || need == 0 || model == NULL || model->propose == NULL ||
        model->likelihood == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_capacity(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve(pool, params);
    made->model = *model;
    made->random = cairn_random_seed(0, 0);
    *filter = made;
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
    cairn_status status;

    CAIRN_ASSERT(node->references > 0);
    if (--node->references > 0)
        return NULL;
    status = cairn_block_pool_give(filter->blocks, node);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
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

/* Restores the heap of the followers when the one on top is new. */
static void sift_top(particle_filter_population *heap)
{
    heap_sift_down(heap->list, 0, heap->count, is_lighter_at, exchange_particles);
}

cairn_status cairn_particle_filter_add_follower(cairn_particle_filter *filter,
                                                particle_filter_particle follower,
                                                particle_filter_node *parent, const void *state)
{
    int is_full = filter->next.count == filter->params.max_particles;

    follower.birth_number = filter->birth_count++;
    filter->step_trace.followers++;
    filter->step_trace.pruned_followers += is_full;
    if (is_full && cairn_particle_filter_is_lighter(&follower, &filter->next.list[0]))
        return CAIRN_OK;
    if (is_full)
        release_history(
            filter,
            filter->next.list[0].leaf); /* frees one node: its parent has other references */
    follower.leaf = create_node(filter, parent, state);
    if (follower.leaf == NULL) {
        if (is_full) {
            filter->next.list[0] = filter->next.list[--filter->next.count];
            sift_top(&filter->next);
        }
        return CAIRN_FULL;
    }
    truncate_history(filter, follower.leaf);
    if (filter->model.append != NULL)
        filter->model.append(filter->model.context, filter, filter->index,
                             particle_filter_state(follower.leaf));
    if (is_full) {
        filter->next.list[0] = follower;
        sift_top(&filter->next);
    } else {
        filter->next.list[filter->next.count] = follower;
        heap_sift_up(filter->next.list, filter->next.count++, is_lighter_at, exchange_particles);
    }
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
    filter->phase = PARTICLE_FILTER_IDLE;
    filter->has_begun = 0;
    filter->units_charged = 0;
    filter->is_call_charged = 0;
    memset(&filter->last_trace, 0, sizeof filter->last_trace);
    return CAIRN_OK;
}

cairn_status cairn_particle_filter_start(cairn_particle_filter *filter, const void *state,
                                         cairn_real log_weight)
{
    particle_filter_particle particle = {NULL, log_weight, 0, 0};

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
    if (filter == NULL || filter->phase != PARTICLE_FILTER_IDLE)
        return CAIRN_BAD_ARGUMENT;
    if (filter->current.count == 0)
        return CAIRN_EMPTY;
    memset(&filter->step_trace, 0, sizeof filter->step_trace);
    filter->step_trace.steps = filter->last_trace.steps + 1;
    filter->step_trace.resamplings = filter->last_trace.resamplings;
    filter->step_trace.log_evidence = filter->last_trace.log_evidence;
    filter->has_begun = 1;
    filter->first_candidate[0] = 0;
    filter->index = 0;
    filter->birth_count = 0;
    filter->max_log_weight = PARTICLE_FILTER_IMPOSSIBLE;
    filter->outcome = CAIRN_OK;
    filter->units_charged = 0;
    filter->phase = PARTICLE_FILTER_PROPOSE;
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
    cairn_particle result = {NULL, 0, 0, 0};

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

cairn_particle_filter_trace cairn_particle_filter_read(const cairn_particle_filter *filter)
{
    return filter->last_trace;
}
