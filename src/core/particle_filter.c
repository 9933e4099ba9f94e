/* Sequential importance resampling.
 *
 * Method. A step proposes for every particle, then goes through the particles' groups of candidates
 * one by one: the prior masses are normalised, candidates are weighed and drawn, each drawn one
 * becomes a follower. n followers are drawn by residual sampling, m_k copies of candidate k; copies
 * of one candidate are one follower with the weight of all of them,
 *
 *     prior:    w m_k / n p(z | x_k)                    optimal:  w m_k / n sum_l p(z | x_l) p(x_l
 *     | x)
 *
 * which is unbiased because E[m_k] is n times the mass of k. Where there is room for all candidates
 * none is drawn: each is a follower of weight w p(z | x_k) p(x_k | x). The heaviest followers up to
 * max_particles are kept in a heap. Then weights are normalised, and by N_eff = 1 / sum w^2 the
 * population is resampled, by residuals as well: floor(N w) copies of each, the rest drawn by what
 * is left of N w.
 *
 * Weights are logarithms throughout; only ratios to the largest are ever exponentials.
 *
 * Layout. A node of the tree of histories is a header and the caller's state behind it, in a block
 * pool. A node is referred to by its children and by the particles that end in it; when nobody does
 * it is given back, and so on towards the root. There are three populations: that which readers
 * see, the followers, and what is resampled from them.
 *
 * Source: Adluru 2008, sections 2.3, 9.2.2 and 9.3; residual resampling: Liu and Chen 1998;
 * N_eff: Kong, Liu and Wong 1994. */
#include "src/core/build.h"

#include <string.h>

#include "src/core/particle_filter_work.h"

enum { COUNT_MOST = 1 << 20, BLOCKS_MOST = 1 << 28 };

cairn_particle_filter_params cairn_particle_filter_default(void)
{
    cairn_particle_filter_params params = {
        .particles = 100,
        .max_particles = 100,
        .max_followers = 8,
        .max_candidates = 4096,
        .max_blocks = 4096,
        .state_bytes = 64,
        .proposal = CAIRN_PROPOSAL_OPTIMAL,
        .by_entropy = 1,
        .resample_below = CAIRN_REAL(0.5),
    };
    return params;
}

static int is_count(int32_t n)
{
    return n >= 1 && n <= COUNT_MOST;
}

static int params_are_valid(const cairn_particle_filter_params *p)
{
    return p != NULL && p->particles >= 1 && is_count(p->max_particles) &&
           p->particles <= p->max_particles && is_count(p->max_followers) &&
           is_count(p->max_candidates) && p->max_blocks >= 1 && p->max_blocks <= BLOCKS_MOST &&
           is_count(p->state_bytes) && p->proposal >= CAIRN_PROPOSAL_PRIOR &&
           p->proposal <= CAIRN_PROPOSAL_OPTIMAL && p->by_entropy >= 0 && p->by_entropy <= 1 &&
           p->past >= 0 && p->past <= COUNT_MOST && p->resample_below >= 0 &&
           p->resample_below <= 1;
}

static size_t stride_of(const cairn_particle_filter_params *p)
{
    return ((size_t)p->state_bytes + CAIRN_ALIGN - 1) / CAIRN_ALIGN * CAIRN_ALIGN;
}

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

static cairn_particle_filter *carve(cairn_pool *pool, const cairn_particle_filter_params *p)
{
    size_t particles = (size_t)p->max_particles, candidates = (size_t)p->max_candidates;
    size_t most = particles > candidates ? particles : candidates;
    cairn_particle_filter *f = cairn_pool_take_one(pool, sizeof *f);
    filter_particle *now = cairn_pool_take(pool, particles, sizeof *now);
    filter_particle *next = cairn_pool_take(pool, particles, sizeof *next);
    filter_particle *spare = cairn_pool_take(pool, particles, sizeof *spare);
    filter_candidate *list = cairn_pool_take(pool, candidates, sizeof *list);
    unsigned char *states = cairn_pool_take(pool, candidates, stride_of(p));
    int32_t *first = cairn_pool_take(pool, particles + 1, sizeof *first);
    cairn_real *mass = cairn_pool_take(pool, most, sizeof *mass);
    int32_t *copies = cairn_pool_take(pool, most, sizeof *copies);
    cairn_block_pool *blocks =
        carve_blocks(pool, FILTER_HEADER + stride_of(p), (size_t)p->max_blocks);

    if (f == NULL)
        return NULL;
    memset(f, 0, sizeof *f);
    f->params = *p;
    f->stride = stride_of(p);
    f->now.list = now;
    f->next.list = next;
    f->spare.list = spare;
    f->candidates = list;
    f->states = states;
    f->first = first;
    f->mass = mass;
    f->copies = copies;
    f->blocks = blocks;
    return f;
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
                                          const cairn_particle_model *model)
{
    size_t need = cairn_particle_filter_memory(params);
    cairn_particle_filter *made;

    if (filter == NULL || pool == NULL || need == 0 || model == NULL || model->propose == NULL ||
        model->likelihood == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_pool_has_room(pool, need))
        return CAIRN_NO_MEMORY;
    made = carve(pool, params);
    made->model = *model;
    made->random = cairn_random_seed(0, 0);
    *filter = made;
    return CAIRN_OK;
}

/* ---- The tree of histories ---- */

/* A node behind `parent` with a copy of the state, referred to once; NULL when there is no
 * block. */
static filter_node *grow(cairn_particle_filter *f, filter_node *parent, const void *state)
{
    filter_node *n = cairn_block_pool_take(f->blocks);

    if (n == NULL)
        return NULL;
    n->parent = parent;
    n->references = 1;
    n->depth = parent == NULL ? 0 : parent->depth + 1;
    memcpy(filter_state(n), state, (size_t)f->params.state_bytes);
    if (parent != NULL)
        parent->references++;
    return n;
}

filter_node *cairn_particle_node_drop(cairn_particle_filter *f, filter_node *n)
{
    filter_node *parent = n->parent;
    cairn_status status;

    CAIRN_ASSERT(n->references > 0);
    if (--n->references > 0)
        return NULL;
    status = cairn_block_pool_give(f->blocks, n);
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
    return parent;
}

static void drop_history(cairn_particle_filter *f, filter_node *n)
{
    while (n != NULL)
        n = cairn_particle_node_drop(f, n);
}

/* Cuts a history off behind the states that are kept of it. */
static void forget(cairn_particle_filter *f, filter_node *leaf)
{
    filter_node *n = leaf;

    for (int32_t k = 0; k < f->params.past && n != NULL; k++)
        n = n->parent;
    if (n != NULL && f->params.past > 0) {
        drop_history(f, n->parent);
        n->parent = NULL;
    }
}

/* ---- Populations ---- */

int cairn_particle_is_lighter(const filter_particle *a, const filter_particle *b)
{
    return a->log_weight < b->log_weight || (a->log_weight == b->log_weight && a->born > b->born);
}

/* Puts `p` into the heap from the vacant place `hole` down; no particle is lighter than its
 * parent. */
static void sift_down(filter_population *heap, int32_t hole, filter_particle p)
{
    for (;;) {
        int32_t child = 2 * hole + 1;

        if (child >= heap->count)
            break;
        if (child + 1 < heap->count &&
            cairn_particle_is_lighter(&heap->list[child + 1], &heap->list[child]))
            child++;
        if (!cairn_particle_is_lighter(&heap->list[child], &p))
            break;
        heap->list[hole] = heap->list[child];
        hole = child;
    }
    heap->list[hole] = p;
}

static void sift_up(filter_population *heap, int32_t hole, filter_particle p)
{
    while (hole > 0 && cairn_particle_is_lighter(&p, &heap->list[(hole - 1) / 2])) {
        heap->list[hole] = heap->list[(hole - 1) / 2];
        hole = (hole - 1) / 2;
    }
    heap->list[hole] = p;
}

cairn_status cairn_particle_follow(cairn_particle_filter *f, filter_particle follower,
                                   filter_node *parent, const void *state)
{
    int full = f->next.count == f->params.max_particles;

    follower.born = f->born++;
    f->trace.followers++;
    f->trace.cut += full;
    if (full && cairn_particle_is_lighter(&follower, &f->next.list[0]))
        return CAIRN_OK;
    if (full)
        drop_history(f, f->next.list[0].leaf); /* new itself, and its parent lives: one node goes */
    follower.leaf = grow(f, parent, state);
    if (follower.leaf == NULL) {
        if (full) {
            filter_particle last = f->next.list[--f->next.count];

            sift_down(&f->next, 0, last);
        }
        return CAIRN_FULL;
    }
    forget(f, follower.leaf);
    if (f->model.append != NULL)
        f->model.append(f->model.context, f, f->index, filter_state(follower.leaf));
    if (full)
        sift_down(&f->next, 0, follower);
    else
        sift_up(&f->next, f->next.count++, follower);
    return CAIRN_OK;
}

cairn_status cairn_particle_filter_clear(cairn_particle_filter *filter, uint64_t seed)
{
    filter_population *all[2];

    if (filter == NULL)
        return CAIRN_BAD_ARGUMENT;
    drop_history(filter, filter->falling);
    filter->falling = NULL;
    all[0] = &filter->now;
    all[1] = &filter->next;
    for (int k = 0; k < 2; k++)
        while (all[k]->count > 0)
            drop_history(filter, all[k]->list[--all[k]->count].leaf);
    while (filter->spare.count > 0)
        drop_history(filter, filter->spare.list[--filter->spare.count].leaf);
    filter->random = cairn_random_seed(seed, 0);
    filter->phase = FILTER_IDLE;
    filter->begun = 0;
    filter->paid = 0;
    filter->entered = 0;
    memset(&filter->done, 0, sizeof filter->done);
    return CAIRN_OK;
}

cairn_status cairn_particle_filter_start(cairn_particle_filter *filter, const void *state,
                                         cairn_real log_weight)
{
    filter_particle p = {NULL, log_weight, 0, 0};

    if (filter == NULL || state == NULL || filter->begun)
        return CAIRN_BAD_ARGUMENT;
    if (!cairn_is_finite(log_weight))
        return CAIRN_NOT_FINITE;
    if (filter->now.count == filter->params.max_particles)
        return CAIRN_FULL;
    p.leaf = grow(filter, NULL, state);
    if (p.leaf == NULL)
        return CAIRN_FULL;
    filter->now.list[filter->now.count++] = p;
    filter->done.particles = filter->now.count;
    return CAIRN_OK;
}

cairn_status cairn_particle_filter_begin(cairn_particle_filter *filter)
{
    if (filter == NULL || filter->phase != FILTER_IDLE)
        return CAIRN_BAD_ARGUMENT;
    if (filter->now.count == 0)
        return CAIRN_EMPTY;
    memset(&filter->trace, 0, sizeof filter->trace);
    filter->trace.steps = filter->done.steps + 1;
    filter->trace.resamplings = filter->done.resamplings;
    filter->trace.log_evidence = filter->done.log_evidence;
    filter->begun = 1;
    filter->first[0] = 0;
    filter->index = 0;
    filter->born = 0;
    filter->heaviest = FILTER_IMPOSSIBLE;
    filter->outcome = CAIRN_OK;
    filter->paid = 0;
    filter->phase = FILTER_PROPOSE;
    return CAIRN_OK;
}

cairn_status cairn_particle_filter_offer(cairn_particle_filter *filter, const void *state,
                                         cairn_real log_mass)
{
    int32_t at;

    if (filter == NULL || state == NULL || !filter->proposing)
        return CAIRN_BAD_ARGUMENT;
    if (!(log_mass <= CAIRN_REAL_MAX))
        return CAIRN_NOT_FINITE;
    at = filter->trace.candidates;
    if (at == filter->params.max_candidates) {
        filter->trace.left_out++;
        return CAIRN_FULL;
    }
    memcpy(filter->states + (size_t)at * filter->stride, state, (size_t)filter->params.state_bytes);
    filter->candidates[at].log_prior = log_mass;
    filter->candidates[at].log_likelihood = 0;
    filter->trace.candidates++;
    return CAIRN_OK;
}

int32_t cairn_particle_filter_count(const cairn_particle_filter *filter)
{
    return filter->now.count;
}

cairn_particle cairn_particle_filter_particle(const cairn_particle_filter *filter, int32_t index)
{
    cairn_particle result = {NULL, 0, 0, 0};

    if (index >= 0 && index < filter->now.count) {
        const filter_particle *p = &filter->now.list[index];

        result.state = filter_state(p->leaf);
        result.log_weight = p->log_weight;
        result.log_likelihood = p->log_likelihood;
        result.steps = p->leaf->depth;
    }
    return result;
}

const void *cairn_particle_state_before(const void *state)
{
    const filter_node *n = (const void *)((const unsigned char *)state - FILTER_HEADER);

    return n->parent == NULL ? NULL : (const unsigned char *)n->parent + FILTER_HEADER;
}

cairn_particle_trace cairn_particle_filter_read(const cairn_particle_filter *filter)
{
    return filter->done;
}
