/* The particle filter compared with exact posteriors; resampling, histories, costs, failures. */
#include "tests/test.h"

#include <math.h>

#include "cairn/particle_filter.h"

/* ---- A model of few states, whose posterior can be written down ----
 *
 * A Markov chain on SYMBOLS symbols with a likelihood of each symbol at each time. A state
 * carries a full copy of its history, the reference implementation of the tree. */

enum { SYMBOLS = 4, PATH_MOST = 600 };

typedef struct chain_state {
    int32_t length;
    uint8_t path[PATH_MOST];
} chain_state;

typedef struct chain {
    /* prior mass from, to; rows need not add up to 1 */
    double move[SYMBOLS][SYMBOLS];
    double log_seen[PATH_MOST][SYMBOLS];
    /* 1: masses are powers of exp(-1/2), so that many are equal; `move` is not read */
    int32_t in_halves;
    int32_t time;
    /* units that a call of the model takes */
    int32_t lazy;
    int32_t waited;
    int32_t weighed, appended, discarded;
    cairn_status propose_status, likelihood_status, discard_status;
    /* NULL, or an object to be offered something out of turn */
    cairn_particle_filter *offer_late;
} chain;

static cairn_status wait(chain *c, cairn_budget *budget)
{
    if (!cairn_budget_charge(budget, &c->waited, c->lazy))
        return CAIRN_MORE;
    return CAIRN_OK;
}

static uint8_t symbol_of(const cairn_particle_filter *filter, int32_t index)
{
    const chain_state *s = cairn_particle_filter_particle(filter, index).state;

    return s->path[s->length - 1];
}

static cairn_status propose(void *context, cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    chain *c = context;
    uint8_t from = symbol_of(filter, index);

    if (wait(c, budget) != CAIRN_OK)
        return CAIRN_MORE;
    if (c->propose_status != CAIRN_OK)
        return c->propose_status;
    for (int to = 0; to < SYMBOLS; to++) {
        chain_state s;
        cairn_status status;

        memset(&s, 0, sizeof s);
        s.path[0] = (uint8_t)to;
        status = cairn_particle_filter_offer(filter, &s,
                                             c->in_halves ? CAIRN_REAL(-0.5) *
                                                                (cairn_real)((3 * from + to) % 3)
                                                          : (cairn_real)log(c->move[from][to]));
        assert_true(status == CAIRN_OK || status == CAIRN_FULL);
    }
    return CAIRN_OK;
}

static cairn_status likelihood(void *context, const cairn_particle_filter *filter, int32_t index,
                               const void *state, cairn_real *log_likelihood, cairn_budget *budget)
{
    chain *c = context;
    const chain_state *s = state;

    (void)filter;
    (void)index;
    assert_int_equal((uintptr_t)state % CAIRN_ALIGN, 0);
    if (wait(c, budget) != CAIRN_OK)
        return CAIRN_MORE;
    c->weighed++;
    if (c->offer_late)
        assert_status(cairn_particle_filter_offer(c->offer_late, state, 0), CAIRN_BAD_ARGUMENT);
    *log_likelihood = (cairn_real)c->log_seen[c->time][s->path[0]];
    return c->likelihood_status;
}

/* The symbol is appended to a copy of the whole path. */
static void append(void *context, const cairn_particle_filter *filter, int32_t index, void *state)
{
    chain *c = context;
    chain_state *s = state;
    const chain_state *before = cairn_particle_filter_particle(filter, index).state;
    uint8_t symbol = s->path[0];

    *s = *before;
    s->path[s->length++] = symbol;
    c->appended++;
}

static cairn_status discard(void *context, const cairn_particle_filter *filter, int32_t index,
                            cairn_budget *budget)
{
    chain *c = context;

    if (wait(c, budget) != CAIRN_OK)
        return CAIRN_MORE;
    assert_non_null(cairn_particle_filter_particle(filter, index).state);
    c->discarded++;
    return c->discard_status;
}

static cairn_particle_filter_model chain_model(chain *c)
{
    cairn_particle_filter_model model = {c, propose, likelihood, append, discard};

    return model;
}

static chain new_chain(uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 3);
    chain c;

    memset(&c, 0, sizeof c);
    for (int i = 0; i < SYMBOLS; i++)
        for (int j = 0; j < SYMBOLS; j++)
            c.move[i][j] = 0.1 + (double)cairn_random_unit(&random) * 3;
    for (int t = 0; t < PATH_MOST; t++)
        for (int i = 0; i < SYMBOLS; i++)
            c.log_seen[t][i] = -3 * (double)cairn_random_unit(&random);
    return c;
}

static cairn_particle_filter_params chain_params(int32_t particles)
{
    cairn_particle_filter_params p = cairn_particle_filter_default();

    p.particles = p.max_particles = particles;
    p.max_followers = SYMBOLS;
    p.max_candidates = SYMBOLS * particles;
    p.max_blocks = 40 * particles + 400;
    p.state_bytes = (int32_t)sizeof(chain_state);
    p.adaptive_followers = 0;
    return p;
}

struct fixture {
    cairn_pool pool;
    cairn_particle_filter *filter;
};

static struct fixture filter_with(const cairn_particle_filter_params *params, chain *c)
{
    cairn_particle_filter_model model = chain_model(c);
    struct fixture f;

    f.pool = test_pool(cairn_particle_filter_memory(params));
    assert_ok(cairn_particle_filter_create(&f.filter, &f.pool, params, &model));
    assert_ok(cairn_particle_filter_clear(f.filter, 1));
    return f;
}

static void start_at(cairn_particle_filter *filter, uint8_t symbol, int32_t count)
{
    chain_state s;

    memset(&s, 0, sizeof s);
    s.length = 1;
    s.path[0] = symbol;
    for (int32_t i = 0; i < count; i++)
        assert_ok(cairn_particle_filter_start(filter, &s, -(cairn_real)log((double)count)));
}

static cairn_status run(cairn_particle_filter *filter, int32_t units)
{
    cairn_status status;

    assert_ok(cairn_particle_filter_begin(filter));
    do {
        cairn_budget budget = {units};

        status = cairn_particle_filter_step(filter, &budget);
        assert_true(budget.left >= 0);
        assert_true(status != CAIRN_MORE || budget.left == 0);
    } while (status == CAIRN_MORE);
    return status;
}

/* Units of a step in budgets of `units`. */
static int64_t units_of(cairn_particle_filter *filter, int32_t units)
{
    int64_t sum = 0;
    cairn_status status;

    assert_ok(cairn_particle_filter_begin(filter));
    do {
        cairn_budget budget = {units};

        status = cairn_particle_filter_step(filter, &budget);
        sum += units - budget.left;
    } while (status == CAIRN_MORE);
    assert_ok(status);
    return sum;
}

static void run_chain(cairn_particle_filter *filter, chain *c, int32_t steps, int32_t units)
{
    for (c->time = 0; c->time < steps; c->time++)
        assert_ok(run(filter, units));
}

/* log p(all observations) from a start at `symbol`: the forward algorithm; filtered: p(last
 * symbol | observations). */
static double forward(const chain *c, uint8_t symbol, int32_t steps, double filtered[SYMBOLS])
{
    double p[SYMBOLS] = {0}, sum = 1, log_sum = 0;

    p[symbol] = 1;
    for (int32_t t = 0; t < steps; t++) {
        double next[SYMBOLS] = {0};

        sum = 0;
        for (int j = 0; j < SYMBOLS; j++) {
            for (int i = 0; i < SYMBOLS; i++) {
                double row = 0;

                for (int k = 0; k < SYMBOLS; k++)
                    row += c->move[i][k];
                next[j] += p[i] * c->move[i][j] / row;
            }
            next[j] *= exp(c->log_seen[t][j]);
            sum += next[j];
        }
        log_sum += log(sum);
        for (int j = 0; j < SYMBOLS; j++)
            p[j] = next[j] / sum;
    }
    for (int j = 0; j < SYMBOLS; j++)
        filtered[j] = p[j];
    return log_sum;
}

/* ---- Refusals ---- */

static void test_params_are_refused(void **state)
{
    chain c = new_chain(1);
    cairn_particle_filter_model model = chain_model(&c), bad;
    cairn_particle_filter_params good = chain_params(4), p = good;
    cairn_pool pool = test_pool(cairn_particle_filter_memory(&good));
    cairn_particle_filter *filter;
    cairn_object_fault fault;

    (void)state;
    p.particles = 5;
    assert_status(cairn_particle_filter_check(&p, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.rule, "particles: at most max_particles");
    assert_int_equal(cairn_particle_filter_memory(&p), 0);
    assert_status(cairn_particle_filter_create(&filter, &pool, &p, &model), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_particle_filter_create(&filter, NULL, &good, &model), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_particle_filter_create(&filter, &pool, &good, NULL), CAIRN_BAD_ARGUMENT);
    bad = model;
    bad.propose = NULL;
    assert_status(cairn_particle_filter_create(&filter, &pool, &good, &bad), CAIRN_BAD_ARGUMENT);
    bad = model;
    bad.likelihood = NULL;
    assert_status(cairn_particle_filter_create(&filter, &pool, &good, &bad), CAIRN_BAD_ARGUMENT);
    assert_int_equal(pool.used, 0);
    good.max_particles = good.max_followers = good.max_candidates = good.state_bytes = 1 << 20;
    good.max_blocks = 1 << 28;
    good.resample_ratio = 1;
    assert_true(cairn_particle_filter_memory(&good) > (size_t)1 << 40 || sizeof(size_t) == 4);
    test_pool_free(&pool);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    chain c = new_chain(1);
    cairn_particle_filter_model model = chain_model(&c);
    cairn_particle_filter *filter;

    return cairn_particle_filter_create(&filter, pool, context, &model);
}

static void test_memory_is_exact(void **state)
{
    cairn_particle_filter_params p = chain_params(3);

    (void)state;
    p.max_blocks = 5;
    test_every_pool_size(create, &p, cairn_particle_filter_memory(&p));
    p.max_candidates = 1; /* fewer than particles */
    p.state_bytes = 17;
    test_every_pool_size(create, &p, cairn_particle_filter_memory(&p));
}

static void test_calls_out_of_turn(void **state)
{
    chain c = new_chain(1);
    cairn_particle_filter_params p = chain_params(2);
    struct fixture f = filter_with(&p, &c);
    cairn_particle none;
    cairn_budget budget = {5};
    chain_state s = {1, {0}};

    (void)state;
    assert_status(cairn_particle_filter_clear(NULL, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_particle_filter_begin(NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_particle_filter_begin(f.filter), CAIRN_EMPTY);
    assert_status(cairn_particle_filter_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_particle_filter_step(f.filter, NULL), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_particle_filter_step(f.filter, &budget));
    assert_int_equal(budget.left, 5);
    assert_status(cairn_particle_filter_start(NULL, &s, 0), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_particle_filter_start(f.filter, NULL, 0), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_particle_filter_start(f.filter, &s, (cairn_real)NAN), CAIRN_NOT_FINITE);
    assert_status(cairn_particle_filter_start(f.filter, &s, (cairn_real)INFINITY),
                  CAIRN_NOT_FINITE);
    assert_int_equal(cairn_particle_filter_count(f.filter), 0);
    assert_ok(cairn_particle_filter_start(f.filter, &s, 0));
    assert_ok(cairn_particle_filter_start(f.filter, &s, 0));
    assert_status(cairn_particle_filter_start(f.filter, &s, 0), CAIRN_FULL);
    assert_int_equal(cairn_particle_filter_count(f.filter), 2);
    assert_int_equal(cairn_particle_filter_read(f.filter).particles, 2);
    assert_status(cairn_particle_filter_offer(f.filter, &s, 0), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_particle_filter_offer(NULL, &s, 0), CAIRN_BAD_ARGUMENT);
    assert_null(cairn_particle_filter_particle(f.filter, -1).state);
    none = cairn_particle_filter_particle(f.filter, 2);
    assert_null(none.state);
    assert_int_equal(none.steps, 0);
    assert_true(none.log_weight == 0 && none.log_likelihood == 0);
    assert_null(
        cairn_particle_filter_state_before(cairn_particle_filter_particle(f.filter, 0).state));
    assert_ok(cairn_particle_filter_begin(f.filter));
    assert_status(cairn_particle_filter_begin(f.filter), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_particle_filter_start(f.filter, &s, 0), CAIRN_BAD_ARGUMENT);
    budget.left = 0;
    assert_status(cairn_particle_filter_step(f.filter, &budget), CAIRN_MORE);
    test_pool_free(&f.pool);
}

/* ---- Every history kept: the filter is the exact posterior ---- */

static void test_all_histories_are_exact(void **state)
{
    chain c = new_chain(5);
    cairn_particle_filter_params p = chain_params(256);
    double filtered[SYMBOLS], mass[SYMBOLS] = {0};
    struct fixture f;
    cairn_particle_filter_trace trace;

    (void)state;
    p.resample_ratio = 0;
    for (p.proposal = CAIRN_PARTICLE_FILTER_PROPOSAL_PRIOR;
         p.proposal <= CAIRN_PARTICLE_FILTER_PROPOSAL_OPTIMAL; p.proposal++) {
        double squares = 0, heaviest = 0;

        memset(mass, 0, sizeof mass);
        f = filter_with(&p, &c);
        start_at(f.filter, 2, 1);
        run_chain(f.filter, &c, 4, 1000);
        trace = cairn_particle_filter_read(f.filter);
        assert_int_equal(trace.particles, 256);
        assert_int_equal(trace.followers, 256);
        assert_int_equal(trace.candidates, 256);
        assert_int_equal(trace.pruned_followers + trace.particles_without_follower +
                             trace.depleted + trace.resampled + trace.dropped_candidates,
                         0);
        assert_int_equal(trace.blocks, 1 + 4 + 16 + 64 + 256);
        assert_int_equal(trace.blocks_peak, 1 + 4 + 16 + 64 + 256);
        assert_int_equal(trace.steps, 4);
        assert_near(trace.log_evidence, forward(&c, 2, 4, filtered), NUMBER(1e-12, 1e-5));
        for (int32_t i = 0; i < 256; i++) {
            cairn_particle q = cairn_particle_filter_particle(f.filter, i);
            const chain_state *s = q.state;
            double w = exp((double)q.log_weight), log_likelihood = 0;

            for (int t = 0; t < 4; t++)
                log_likelihood += c.log_seen[t][s->path[t + 1]];
            assert_near(q.log_likelihood, log_likelihood, NUMBER(1e-12, 1e-5));
            assert_int_equal(q.steps, 4);
            mass[symbol_of(f.filter, i)] += w;
            squares += w * w;
            heaviest = fmax(heaviest, w);
        }
        for (int k = 0; k < SYMBOLS; k++)
            assert_near(mass[k], filtered[k], NUMBER(1e-12, 1e-5));
        assert_near(trace.n_eff, 1 / squares, NUMBER(1e-9, 1e-2));
        assert_near(exp((double)cairn_particle_filter_particle(f.filter, trace.best).log_weight),
                    heaviest, 1e-7);
        test_pool_free(&f.pool);
    }
}

/* Cut to a few, the heaviest of all histories remain, with their weights. */
static void test_the_heaviest_are_kept(void **state)
{
    chain c = new_chain(6);
    cairn_particle_filter_params p = chain_params(64), few;
    struct fixture all, cut;
    double kept = 0;

    (void)state;
    p.resample_ratio = 0;
    few = p;
    few.particles = 5;
    few.max_particles = 21;
    all = filter_with(&p, &c);
    cut = filter_with(&few, &c);
    start_at(all.filter, 0, 1);
    start_at(cut.filter, 0, 1);
    run_chain(all.filter, &c, 3, CAIRN_UNBOUNDED);
    run_chain(cut.filter, &c, 3, CAIRN_UNBOUNDED);
    assert_int_equal(cairn_particle_filter_read(cut.filter).pruned_followers, 64 - 21);
    assert_int_equal(cairn_particle_filter_read(cut.filter).followers, 64);
    assert_int_equal(cairn_particle_filter_read(cut.filter).particles, 21);
    for (int32_t i = 0; i < 21; i++) {
        const chain_state *s = cairn_particle_filter_particle(cut.filter, i).state;
        int32_t heavier = 0, same = -1;

        for (int32_t k = 0; k < 64; k++) {
            const chain_state *t = cairn_particle_filter_particle(all.filter, k).state;

            if (memcmp(s->path, t->path, 4) == 0)
                same = k;
        }
        assert_true(same >= 0);
        for (int32_t k = 0; k < 64; k++)
            heavier += cairn_particle_filter_particle(all.filter, k).log_weight >
                       cairn_particle_filter_particle(all.filter, same).log_weight;
        assert_true(heavier < 21);
        kept += exp((double)cairn_particle_filter_particle(all.filter, same).log_weight);
    }
    for (int32_t i = 0; i < 21; i++) {
        const chain_state *s = cairn_particle_filter_particle(cut.filter, i).state;

        for (int32_t k = 0; k < 64; k++) {
            cairn_particle q = cairn_particle_filter_particle(all.filter, k);

            if (memcmp(s->path, ((const chain_state *)q.state)->path, 4) == 0)
                assert_near(exp((double)cairn_particle_filter_particle(cut.filter, i).log_weight),
                            exp((double)q.log_weight) / kept, NUMBER(1e-12, 1e-5));
        }
    }
    /* The nodes of removed particles are free again: each path of three steps uses at most three
     * nodes. */
    assert_true(cairn_particle_filter_read(cut.filter).blocks <= 1 + 4 + 16 + 21);
    test_pool_free(&all.pool);
    test_pool_free(&cut.pool);
}

/* ---- Drawn followers: unbiased in the mean ---- */

static void check_mean(cairn_particle_filter_proposal proposal, int32_t followers,
                       int32_t particles)
{
    enum { RUNS = 4000, STEPS = 4 };
    chain c = new_chain(8);
    cairn_particle_filter_params p = chain_params(particles);
    double filtered[SYMBOLS], exact, mean = 0, square = 0, mass[SYMBOLS] = {0};
    struct fixture f;

    p.proposal = proposal;
    p.max_followers = followers;
    p.max_particles = particles * (followers > 1 ? 81 : 1); /* none is cut */
    p.max_candidates = p.max_particles * SYMBOLS;
    f = filter_with(&p, &c);
    exact = forward(&c, 1, STEPS, filtered);
    for (uint64_t seed = 0; seed < RUNS; seed++) {
        double estimate;

        assert_ok(cairn_particle_filter_clear(f.filter, seed));
        start_at(f.filter, 1, particles);
        run_chain(f.filter, &c, STEPS, CAIRN_UNBOUNDED);
        estimate = exp((double)cairn_particle_filter_read(f.filter).log_evidence - exact);
        mean += estimate / RUNS;
        square += estimate * estimate / RUNS;
        for (int32_t i = 0; i < cairn_particle_filter_count(f.filter); i++)
            mass[symbol_of(f.filter, i)] +=
                estimate * exp((double)cairn_particle_filter_particle(f.filter, i).log_weight) /
                RUNS;
    }
    assert_true(square - mean * mean > 1e-6); /* it was drawn */
    assert_near(mean, 1, 3.5 * sqrt((square - mean * mean) / RUNS));
    for (int k = 0; k < SYMBOLS; k++)
        assert_near(mass[k], filtered[k], 0.03);
    test_pool_free(&f.pool);
}

static void test_drawn_followers_are_right_in_the_mean(void **state)
{
    (void)state;
    check_mean(CAIRN_PARTICLE_FILTER_PROPOSAL_PRIOR, 1, 8);
    check_mean(CAIRN_PARTICLE_FILTER_PROPOSAL_PRIOR, 3, 8);
    check_mean(CAIRN_PARTICLE_FILTER_PROPOSAL_OPTIMAL, 1, 8);
    check_mean(CAIRN_PARTICLE_FILTER_PROPOSAL_OPTIMAL, 3, 4);
}

/* ---- Histories ---- */

static int32_t distinct_nodes(const cairn_particle_filter *filter)
{
    enum { MAX_COUNT = 20000 };
    const void **seen = malloc(MAX_COUNT * sizeof *seen);
    int32_t count = 0;

    assert_non_null(seen);
    for (int32_t i = 0; i < cairn_particle_filter_count(filter); i++) {
        const void *s = cairn_particle_filter_particle(filter, i).state;

        for (; s != NULL; s = cairn_particle_filter_state_before(s)) {
            int32_t k = 0;

            while (k < count && seen[k] != s)
                k++;
            if (k < count)
                break; /* and so are all before it */
            assert_true(count < MAX_COUNT);
            seen[count++] = s;
        }
    }
    free(seen);
    return count;
}

static int32_t compare_tree_with_copies(cairn_particle_filter_proposal way, int32_t followers)
{
    chain c = new_chain(9);
    cairn_particle_filter_params p = chain_params(40);
    struct fixture f;
    int32_t resampled = 0;

    for (int t = 0; t < PATH_MOST; t++)
        for (int i = 0; i < SYMBOLS; i++)
            c.log_seen[t][i] *= 2;
    p.max_particles = 60;
    p.proposal = way;
    p.max_followers = followers;
    p.max_candidates = 240;
    f = filter_with(&p, &c);
    start_at(f.filter, 3, 40);
    for (c.time = 0; c.time < 250; c.time++) {
        assert_ok(run(f.filter, 5000));
        resampled += cairn_particle_filter_read(f.filter).resampled;
        for (int32_t i = 0; i < cairn_particle_filter_count(f.filter); i++) {
            cairn_particle q = cairn_particle_filter_particle(f.filter, i);
            const chain_state *copy = q.state, *node = q.state;
            int32_t length = copy->length;

            assert_int_equal(length, c.time + 2);
            assert_int_equal(q.steps, c.time + 1);
            for (; node != NULL; node = cairn_particle_filter_state_before(node))
                assert_int_equal(node->path[node->length - 1], copy->path[--length]);
            assert_int_equal(length, 0);
        }
        assert_int_equal(cairn_particle_filter_read(f.filter).blocks, distinct_nodes(f.filter));
    }
    assert_int_equal(cairn_particle_filter_read(f.filter).resamplings, resampled);
    assert_int_equal(cairn_particle_filter_read(f.filter).steps, 250);
    /* Shared pasts: far fewer blocks than 250 states for each particle. */
    assert_true(cairn_particle_filter_read(f.filter).blocks_peak < 40 * 60);
    test_pool_free(&f.pool);
    return resampled;
}

/* Compared with a filter that stores the whole past: the same particles, as many states behind
 * each, in as many blocks as promised. */
static void compare_short_past(int32_t past)
{
    chain c = new_chain(9);
    cairn_particle_filter_params p = chain_params(40);
    struct fixture whole, cut;

    p.max_particles = 60;
    p.max_followers = 3;
    p.max_candidates = 240;
    p.max_blocks = 6000;
    whole = filter_with(&p, &c);
    p.max_history = past;
    p.max_blocks = (past + 2) * p.max_particles;
    cut = filter_with(&p, &c);
    start_at(whole.filter, 3, 40);
    start_at(cut.filter, 3, 40);
    for (c.time = 0; c.time < 60; c.time++) {
        assert_ok(run(whole.filter, 5000));
        assert_ok(run(cut.filter, 7));
        assert_int_equal(cairn_particle_filter_count(cut.filter),
                         cairn_particle_filter_count(whole.filter));
        for (int32_t i = 0; i < cairn_particle_filter_count(cut.filter); i++) {
            cairn_particle a = cairn_particle_filter_particle(whole.filter, i);
            cairn_particle b = cairn_particle_filter_particle(cut.filter, i);
            const chain_state *node = b.state;

            assert_memory_equal(a.state, b.state, sizeof(chain_state));
            assert_near(a.log_weight, b.log_weight, 0);
            assert_int_equal(b.steps, c.time + 1);
            for (int32_t k = 0; k < past && k <= c.time; k++) {
                node = cairn_particle_filter_state_before(node);
                assert_non_null(node);
                assert_int_equal(node->length, c.time + 1 - k);
            }
            assert_null(cairn_particle_filter_state_before(node));
        }
        assert_int_equal(cairn_particle_filter_read(cut.filter).blocks, distinct_nodes(cut.filter));
    }
    test_pool_free(&whole.pool);
    test_pool_free(&cut.pool);
}

static void test_a_short_past_changes_nothing_else(void **state)
{
    (void)state;
    compare_short_past(1);
    compare_short_past(4);
}

static void test_tree_equals_copies(void **state)
{
    (void)state;
    assert_in_range(compare_tree_with_copies(CAIRN_PARTICLE_FILTER_PROPOSAL_PRIOR, 1), 30, 245);
    (void)compare_tree_with_copies(CAIRN_PARTICLE_FILTER_PROPOSAL_OPTIMAL, 2);
}

/* Changes the first half of one history; those of the others stay as they are. */
static void test_a_history_of_its_own_is_changed_alone(void **state)
{
    chain c = new_chain(5);
    cairn_particle_filter_params p = chain_params(6);
    struct fixture f = filter_with(&p, &c);
    const chain_state *others[6];
    chain_state *own = NULL;
    const void *s;
    int32_t before, depth = 0;

    (void)state;
    start_at(f.filter, 1, 1);
    run_chain(f.filter, &c, 12, 1000);
    assert_int_equal(cairn_particle_filter_count(f.filter), 6);
    before = cairn_particle_filter_read(f.filter).blocks;
    for (int32_t i = 0; i < 6; i++)
        others[i] = cairn_particle_filter_particle(f.filter, i).state;
    assert_null(cairn_particle_filter_own_state(NULL, 0, NULL));
    assert_null(cairn_particle_filter_own_state(f.filter, -1, NULL));
    assert_null(cairn_particle_filter_own_state(f.filter, 6, NULL));
    for (int32_t k = 0; k < 13; k++) {
        own = cairn_particle_filter_own_state(f.filter, 0, own);
        assert_non_null(own);
        assert_int_equal(own->length, 13 - k);
        own->length = 100 + k;
    }
    assert_null(cairn_particle_filter_own_state(f.filter, 0, own));
    assert_true(cairn_particle_filter_read(f.filter).blocks > before);
    before = cairn_particle_filter_read(f.filter).blocks;
    assert_true(cairn_particle_filter_read(f.filter).blocks_peak >= before);
    for (s = cairn_particle_filter_particle(f.filter, 0).state; s != NULL; depth++) {
        assert_int_equal(((const chain_state *)s)->length, 100 + depth);
        s = cairn_particle_filter_state_before(s);
    }
    assert_int_equal(depth, 13);
    for (int32_t i = 1; i < 6; i++) {
        assert_ptr_equal(cairn_particle_filter_particle(f.filter, i).state, others[i]);
        depth = 13;
        for (s = others[i]; s != NULL; s = cairn_particle_filter_state_before(s))
            assert_int_equal(((const chain_state *)s)->length, depth--);
    }
    /* What is its own already is not copied; the copies are given back with the particles. */
    assert_ptr_equal(cairn_particle_filter_own_state(f.filter, 0, NULL),
                     cairn_particle_filter_particle(f.filter, 0).state);
    assert_int_equal(cairn_particle_filter_read(f.filter).blocks, before);
    assert_ok(cairn_particle_filter_begin(f.filter));
    assert_null(cairn_particle_filter_own_state(f.filter, 0, NULL));
    assert_ok(cairn_particle_filter_clear(f.filter, 1));
    start_at(f.filter, 2, 1);
    assert_ok(run(f.filter, 1000));
    assert_true(cairn_particle_filter_read(f.filter).blocks <= 1 + SYMBOLS);
    test_pool_free(&f.pool);
}

static void test_a_shared_state_is_not_copied_without_a_free_block(void **state)
{
    chain c = new_chain(6);
    cairn_particle_filter_params p = chain_params(SYMBOLS);
    struct fixture f;
    void *last;

    (void)state;
    p.resample_ratio = 0;
    p.max_blocks = 1 + SYMBOLS;
    f = filter_with(&p, &c);
    start_at(f.filter, 0, 1);
    assert_ok(run(f.filter, 1000));
    assert_int_equal(cairn_particle_filter_read(f.filter).blocks, 1 + SYMBOLS);
    last = cairn_particle_filter_own_state(f.filter, 0, NULL);
    assert_ptr_equal(last, cairn_particle_filter_particle(f.filter, 0).state);
    assert_null(cairn_particle_filter_own_state(f.filter, 0, last));
    assert_int_equal(cairn_particle_filter_read(f.filter).blocks, 1 + SYMBOLS);
    test_pool_free(&f.pool);
}

/* ---- Resampling ---- */

/* Particles of given weights with one follower each. */
static struct fixture weighted(chain *c, const double *weight, int32_t count, int32_t particles)
{
    cairn_particle_filter_params p = chain_params(particles);
    struct fixture f;

    memset(c, 0, sizeof *c);
    for (int i = 0; i < SYMBOLS; i++)
        c->move[i][i] = 1;
    p.max_particles = count > particles ? count : particles;
    p.max_candidates = SYMBOLS * count;
    p.resample_ratio = 1;
    f = filter_with(&p, c);
    for (int32_t i = 0; i < count; i++) {
        chain_state s = {1, {(uint8_t)(i % SYMBOLS)}};

        assert_ok(cairn_particle_filter_start(f.filter, &s, (cairn_real)log(weight[i])));
    }
    return f;
}

static void test_residual_resampling(void **state)
{
    static const double weight[] = {0.42, 0.25, 0.031, 0.299};
    enum { N = 10, RUNS = 400 };
    double mean[SYMBOLS] = {0}, sum = 0;
    cairn_particle_filter_trace trace;
    struct fixture f;
    chain c;

    (void)state;
    f = weighted(&c, weight, SYMBOLS, N);
    for (uint64_t seed = 0; seed < RUNS; seed++) {
        int32_t copies[SYMBOLS] = {0};

        assert_ok(cairn_particle_filter_clear(f.filter, seed));
        for (int i = 0; i < SYMBOLS; i++) {
            chain_state s = {1, {(uint8_t)i}};

            assert_ok(cairn_particle_filter_start(f.filter, &s, (cairn_real)log(weight[i])));
        }
        assert_ok(run(f.filter, CAIRN_UNBOUNDED));
        trace = cairn_particle_filter_read(f.filter);
        assert_int_equal(trace.resampled, 1);
        assert_int_equal(trace.particles, N);
        assert_int_equal(symbol_of(f.filter, trace.best), 0);
        assert_near(trace.n_eff, 1 / (0.42 * 0.42 + 0.25 * 0.25 + 0.031 * 0.031 + 0.299 * 0.299),
                    NUMBER(1e-9, 1e-4));
        for (int32_t i = 0; i < N; i++) {
            copies[symbol_of(f.filter, i)]++;
            assert_near(cairn_particle_filter_particle(f.filter, i).log_weight, log(0.1), 1e-6);
        }
        for (int i = 0; i < SYMBOLS; i++) {
            assert_true(copies[i] >= (int32_t)(N * weight[i]));
            mean[i] += (double)copies[i] / RUNS;
        }
        assert_int_equal(trace.blocks, distinct_nodes(f.filter));
    }
    for (int i = 0; i < SYMBOLS; i++) {
        assert_near(mean[i], N * weight[i], 0.11);
        sum += mean[i];
    }
    assert_near(sum, N, 1e-9);
    test_pool_free(&f.pool);
}

/* Whole shares need no draw, also where rounding leaves them slightly below. */
static void test_whole_shares(void **state)
{
    static const double weight[] = {0.5, 0.1, 0.1, 0.3};
    cairn_particle_filter_trace trace;
    struct fixture f;
    chain c;
    int32_t copies[SYMBOLS] = {0};

    (void)state;
    f = weighted(&c, weight, SYMBOLS, 10);
    assert_ok(run(f.filter, CAIRN_UNBOUNDED));
    trace = cairn_particle_filter_read(f.filter);
    assert_int_equal(trace.particles, 10);
    for (int32_t i = 0; i < 10; i++)
        copies[symbol_of(f.filter, i)]++;
    for (int i = 0; i < SYMBOLS; i++)
        assert_int_equal(copies[i], (int)floor(weight[i] * 10 + 0.5));
    test_pool_free(&f.pool);
}

static void test_even_weights_are_left_alone(void **state)
{
    static const double weight[] = {0.25, 0.25, 0.25, 0.25};
    struct fixture f;
    chain c;

    (void)state;
    f = weighted(&c, weight, SYMBOLS, 4);
    assert_ok(run(f.filter, CAIRN_UNBOUNDED));
    assert_near(cairn_particle_filter_read(f.filter).n_eff, 4, 1e-5);
    assert_int_equal(cairn_particle_filter_read(f.filter).resampled,
                     cairn_particle_filter_read(f.filter).n_eff < 4);
    test_pool_free(&f.pool);
}

static void test_weights_do_not_underflow(void **state)
{
    chain c = new_chain(10);
    cairn_particle_filter_params p = chain_params(16);
    double filtered[SYMBOLS], exact;
    struct fixture f;

    (void)state;
    for (int t = 0; t < PATH_MOST; t++)
        for (int i = 0; i < SYMBOLS; i++)
            c.log_seen[t][i] -= 5000;
    p.max_followers = 1;
    p.max_blocks = 16 * 300;
    f = filter_with(&p, &c);
    start_at(f.filter, 0, 16);
    run_chain(f.filter, &c, 250, CAIRN_UNBOUNDED);
    for (int t = 0; t < PATH_MOST; t++)
        for (int i = 0; i < SYMBOLS; i++)
            c.log_seen[t][i] += 5000;
    exact = forward(&c, 0, 250, filtered) - 250 * 5000.0;
    assert_near(cairn_particle_filter_read(f.filter).log_evidence, exact, 10);
    for (int32_t i = 0; i < cairn_particle_filter_count(f.filter); i++)
        assert_true(cairn_particle_filter_particle(f.filter, i).log_weight <= CAIRN_REAL(1e-6));
    test_pool_free(&f.pool);
}

/* ---- Followers ---- */

static int32_t followers_of(const double masses[SYMBOLS], int32_t most, int32_t by_entropy,
                            cairn_particle_filter_proposal way)
{
    chain c = new_chain(1);
    cairn_particle_filter_params p = chain_params(8);
    struct fixture f;
    int32_t followers;

    for (int j = 0; j < SYMBOLS; j++) {
        c.move[0][j] = way == CAIRN_PARTICLE_FILTER_PROPOSAL_PRIOR ? masses[j] : 1;
        c.log_seen[0][j] = way == CAIRN_PARTICLE_FILTER_PROPOSAL_PRIOR ? 0 : log(masses[j]);
    }
    p.max_followers = most;
    p.resample_ratio = 0;
    p.adaptive_followers = by_entropy;
    p.proposal = way;
    f = filter_with(&p, &c);
    start_at(f.filter, 0, 1);
    assert_ok(run(f.filter, CAIRN_UNBOUNDED));
    followers = cairn_particle_filter_read(f.filter).followers;
    assert_int_equal(followers, cairn_particle_filter_count(f.filter));
    assert_int_equal(c.appended, followers);
    if (way == CAIRN_PARTICLE_FILTER_PROPOSAL_PRIOR && followers < SYMBOLS)
        assert_int_equal(c.weighed, followers); /* only drawn ones are weighed */
    test_pool_free(&f.pool);
    return followers;
}

/* Boosted: a follower's weight is its likelihood, whatever its prior mass; after a resampling, which
 * gives each whole eighths, no two particles are alike. */
static void test_boosted_followers_differ(void **state)
{
    static const double masses[] = {0.4, 0.3, 0.2, 0.1}, seen[] = {1, 0.5, 0.25, 0.25};

    (void)state;
    for (int resampled = 0; resampled < 2; resampled++) {
        chain c = new_chain(1);
        cairn_particle_filter_params p = chain_params(8);
        int32_t symbols[SYMBOLS] = {0};
        double sum = 0;
        struct fixture f;

        for (int j = 0; j < SYMBOLS; j++) {
            c.move[0][j] = masses[j];
            c.log_seen[0][j] = log(seen[j]);
        }
        p.adaptive_followers = 0;
        p.resample_ratio = (cairn_real)resampled;
        p.proposal = CAIRN_PARTICLE_FILTER_PROPOSAL_BOOSTED;
        f = filter_with(&p, &c);
        start_at(f.filter, 0, 1);
        assert_ok(run(f.filter, CAIRN_UNBOUNDED));
        assert_int_equal(cairn_particle_filter_read(f.filter).resampled, resampled);
        for (int32_t i = 0; i < cairn_particle_filter_count(f.filter); i++) {
            double w = exp((double)cairn_particle_filter_particle(f.filter, i).log_weight);

            sum += w;
            symbols[symbol_of(f.filter, i)]++;
            if (resampled)
                assert_near(remainder(8 * w, 1), 0, NUMBER(1e-9, 1e-5));
            else
                assert_near(w, seen[symbol_of(f.filter, i)] / 2, NUMBER(1e-12, 1e-6));
        }
        assert_near(sum, 1, NUMBER(1e-12, 1e-6));
        for (int j = 0; j < SYMBOLS; j++)
            assert_int_equal(symbols[j], 1);
        test_pool_free(&f.pool);
    }
}

static void test_as_many_followers_as_modes(void **state)
{
    static const double even[] = {1, 1, 1, 1}, two[] = {3, 3, 0, 0},
                        peaked[] = {1, 1e-9, 1e-9, 1e-9}, between[] = {0.8, 0.2, 0, 0},
                        nearly[] = {0.97, 0.01, 0.01, 0.01};

    (void)state;
    for (cairn_particle_filter_proposal way = CAIRN_PARTICLE_FILTER_PROPOSAL_PRIOR;
         way <= CAIRN_PARTICLE_FILTER_PROPOSAL_OPTIMAL; way++) {
        assert_int_equal(followers_of(even, 4, 1, way), 4);
        assert_in_range(followers_of(even, 3, 1, way), 1, 3); /* some are drawn twice */
        assert_int_equal(followers_of(two, 4, 1, way), 2);
        assert_int_equal(followers_of(peaked, 4, 1, way), 1);
        assert_int_equal(followers_of(between, 4, 1, way), 2);
        assert_int_equal(followers_of(two, 4, 0, way), 2);
        assert_int_equal(followers_of(even, 1, 0, way), 1);
    }
    assert_in_range(followers_of(nearly, 4, 1, CAIRN_PARTICLE_FILTER_PROPOSAL_OPTIMAL), 1, 2);
    /* capacity for all: none is drawn */
    assert_int_equal(followers_of(peaked, 4, 0, CAIRN_PARTICLE_FILTER_PROPOSAL_OPTIMAL), 4);
}

static void test_discarded_and_extinct(void **state)
{
    chain c = new_chain(2);
    cairn_particle_filter_params p = chain_params(4);
    struct fixture f;
    cairn_particle_filter_trace trace;
    const void *kept;
    chain_state s = {1, {0}};

    (void)state;
    p.resample_ratio = 0;
    f = filter_with(&p, &c);
    memset(c.move, 0, sizeof c.move);
    c.move[1][2] = 1;
    assert_ok(cairn_particle_filter_start(f.filter, &s, -1));
    s.path[0] = 1;
    assert_ok(cairn_particle_filter_start(f.filter, &s, -1));
    assert_ok(run(f.filter, CAIRN_UNBOUNDED));
    trace = cairn_particle_filter_read(f.filter);
    assert_int_equal(trace.particles_without_follower, 1);
    assert_int_equal(c.discarded, 1);
    assert_int_equal(trace.depleted, 0);
    assert_int_equal(cairn_particle_filter_count(f.filter), 1);
    assert_int_equal(symbol_of(f.filter, 0), 2);
    assert_int_equal(trace.blocks, 2);
    kept = cairn_particle_filter_particle(f.filter, 0).state;

    assert_ok(run(f.filter, CAIRN_UNBOUNDED)); /* nothing follows 2 */
    trace = cairn_particle_filter_read(f.filter);
    assert_int_equal(trace.depleted, 1);
    assert_int_equal(trace.particles_without_follower, 1);
    assert_int_equal(trace.particles, 1);
    assert_int_equal(trace.blocks, 2);
    assert_int_equal(trace.steps, 2);
    assert_near(trace.n_eff, 1, 1e-6);
    assert_int_equal(c.discarded, 2);
    assert_ptr_equal(cairn_particle_filter_particle(f.filter, 0).state, kept);

    c.move[2][0] = 1; /* impossible by its likelihood */
    c.log_seen[0][0] = -(double)INFINITY;
    assert_ok(run(f.filter, CAIRN_UNBOUNDED));
    assert_int_equal(cairn_particle_filter_read(f.filter).depleted, 1);
    test_pool_free(&f.pool);
}

/* The report of a discarded particle is a step: units are the same in budgets of any size, and its
 * status ends and undoes the step of the filter. */
static void test_discard_is_a_step(void **state)
{
    cairn_particle_filter_params p = chain_params(4);
    int64_t units[2];

    (void)state;
    p.resample_ratio = 0;
    for (int stepped = 0; stepped < 2; stepped++) {
        chain c = new_chain(1);
        struct fixture f = filter_with(&p, &c);

        c.lazy = 7;
        memset(c.move, 0, sizeof c.move);
        c.move[1][2] = 1;
        start_at(f.filter, 0, 1);
        start_at(f.filter, 1, 1);
        units[stepped] = units_of(f.filter, stepped ? 1 : 1000);
        assert_int_equal(c.discarded, 1);
        assert_int_equal(cairn_particle_filter_count(f.filter), 1);
        c.discard_status = CAIRN_IO;
        assert_status(run(f.filter, 3), CAIRN_IO);
        assert_int_equal(cairn_particle_filter_count(f.filter), 1);
        assert_int_equal(cairn_particle_filter_read(f.filter).steps, 1);
        test_pool_free(&f.pool);
    }
    assert_int_equal(units[0], units[1]);
}

/* ---- Steps that fail change nothing ---- */

static void test_failures_undo_the_step(void **state)
{
    chain c = new_chain(4);
    cairn_particle_filter_params p = chain_params(16);
    struct fixture f;
    cairn_particle_filter_trace before;
    const void *first;

    (void)state;
    p.max_blocks = 1 + 4 + 16 + 10; /* the third step needs 16 more */
    f = filter_with(&p, &c);
    start_at(f.filter, 0, 1);
    run_chain(f.filter, &c, 2, 100);
    before = cairn_particle_filter_read(f.filter);
    first = cairn_particle_filter_particle(f.filter, 0).state;
    for (int k = 0; k < 5; k++) {
        cairn_particle_filter_trace after;
        static const cairn_status expected[] = {CAIRN_FULL, CAIRN_NOT_FINITE, CAIRN_NOT_FINITE,
                                                CAIRN_IO, CAIRN_EMPTY};

        c.time = k == 1 ? 3 : k == 2 ? 4 : 0;
        c.log_seen[3][1] = (double)NAN;
        c.log_seen[4][1] = (double)INFINITY;
        c.propose_status = k == 3 ? CAIRN_IO : CAIRN_OK;
        c.likelihood_status = k == 4 ? CAIRN_EMPTY : CAIRN_OK;
        assert_status(run(f.filter, 3), expected[k]);
        after = cairn_particle_filter_read(f.filter);
        assert_int_equal(after.blocks, before.blocks);
        assert_int_equal(after.steps, before.steps);
        assert_int_equal(after.particles, before.particles);
        assert_true(after.log_evidence == before.log_evidence);
        assert_ptr_equal(cairn_particle_filter_particle(f.filter, 0).state, first);
        assert_int_equal(distinct_nodes(f.filter), before.blocks);
    }
    c.likelihood_status = CAIRN_OK;
    assert_ok(cairn_particle_filter_clear(f.filter, 1));
    assert_int_equal(cairn_particle_filter_count(f.filter), 0);
    start_at(f.filter, 0, 1);
    run_chain(f.filter, &c, 2, 100);
    assert_int_equal(cairn_particle_filter_read(f.filter).blocks, before.blocks);
    test_pool_free(&f.pool);
}

/* No block is left for a follower that replaces a lighter one, which has returned its own: the
 * refused step has used that one. */
static void test_blocks_run_out_in_a_full_population(void **state)
{
    int32_t enough = 0;

    (void)state;
    for (int32_t blocks = 1; blocks < 40; blocks++) {
        chain c = new_chain(4);
        cairn_particle_filter_params p = chain_params(3);
        struct fixture f;
        cairn_status status = CAIRN_OK;

        p.max_blocks = blocks;
        p.resample_ratio = 0;
        f = filter_with(&p, &c);
        start_at(f.filter, 0, 1);
        for (c.time = 0; c.time < 4 && status == CAIRN_OK; c.time++)
            status = run(f.filter, 11);
        if (status == CAIRN_OK)
            enough = enough == 0 ? cairn_particle_filter_read(f.filter).blocks_peak : enough;
        else
            assert_int_equal(status, CAIRN_FULL);
        assert_int_equal(status == CAIRN_OK, enough > 0);
        assert_true(enough == 0 || enough <= blocks);
        assert_true(distinct_nodes(f.filter) <= blocks);

        assert_ok(cairn_particle_filter_clear(f.filter, 1));
        c.time = 0;
        start_at(f.filter, 0, 1);
        assert_int_equal(run(f.filter, 11) == CAIRN_OK, blocks >= 1 + 3);
        test_pool_free(&f.pool);
    }
    assert_in_range(enough, 7, 20);
}

/* A step abandoned half way leaves no block behind. */
static void test_clear_in_the_middle(void **state)
{
    chain c = new_chain(4);
    cairn_particle_filter_params p = chain_params(16);
    struct fixture f;

    (void)state;
    p.resample_ratio = 1;
    f = filter_with(&p, &c);
    for (int32_t units = 1; units < 700; units += 3) {
        cairn_budget budget = {units};
        cairn_status status;

        start_at(f.filter, 0, 8);
        c.waited = 0;
        run_chain(f.filter, &c, 2, CAIRN_UNBOUNDED);
        assert_ok(cairn_particle_filter_begin(f.filter));
        status = cairn_particle_filter_step(f.filter, &budget);
        assert_true(status == CAIRN_OK || status == CAIRN_MORE);
        assert_ok(cairn_particle_filter_clear(f.filter, 1));
        start_at(f.filter, 0, 1);
        run_chain(f.filter, &c, 1, CAIRN_UNBOUNDED);
        assert_int_equal(cairn_particle_filter_read(f.filter).blocks, distinct_nodes(f.filter));
        assert_ok(cairn_particle_filter_clear(f.filter, 1));
    }
    test_pool_free(&f.pool);
}

static void test_offers_beyond_the_capacity(void **state)
{
    chain c = new_chain(4);
    cairn_particle_filter_params p = chain_params(4);
    struct fixture f;

    (void)state;
    p.max_candidates = 6;
    p.resample_ratio = 0;
    f = filter_with(&p, &c);
    c.offer_late = f.filter;
    start_at(f.filter, 0, 2);
    assert_ok(run(f.filter, CAIRN_UNBOUNDED));
    assert_int_equal(cairn_particle_filter_read(f.filter).candidates, 6);
    assert_int_equal(cairn_particle_filter_read(f.filter).dropped_candidates, 2);
    assert_int_equal(cairn_particle_filter_read(f.filter).followers, 6);
    assert_int_equal(cairn_particle_filter_read(f.filter).particles, 4);
    test_pool_free(&f.pool);
}

static cairn_status offer_badly(void *context, cairn_particle_filter *filter, int32_t index,
                                cairn_budget *budget)
{
    chain_state s = {1, {0}};

    (void)context;
    (void)index;
    (void)budget;
    assert_status(cairn_particle_filter_offer(filter, NULL, 0), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_particle_filter_offer(filter, &s, (cairn_real)NAN), CAIRN_NOT_FINITE);
    assert_status(cairn_particle_filter_offer(filter, &s, (cairn_real)INFINITY), CAIRN_NOT_FINITE);
    assert_ok(cairn_particle_filter_offer(filter, &s, -(cairn_real)INFINITY));
    return CAIRN_OK;
}

static void test_bad_offers(void **state)
{
    chain c = new_chain(4);
    cairn_particle_filter_params p = chain_params(4);
    cairn_particle_filter_model model = {&c, offer_badly, likelihood, NULL, NULL};
    cairn_pool pool = test_pool(cairn_particle_filter_memory(&p));
    cairn_particle_filter *filter;

    (void)state;
    assert_ok(cairn_particle_filter_create(&filter, &pool, &p, &model));
    start_at(filter, 0, 1);
    assert_ok(run(filter, CAIRN_UNBOUNDED));
    assert_int_equal(cairn_particle_filter_read(filter).candidates, 1);
    assert_int_equal(cairn_particle_filter_read(filter).depleted, 1);
    test_pool_free(&pool);
}

/* ---- Budgets ---- */

static uint64_t hash_of_run(cairn_particle_filter_proposal way, int32_t lazy, int32_t units)
{
    chain c = new_chain(12);
    cairn_particle_filter_params p = chain_params(12);
    uint64_t hash = TEST_HASH_START;
    struct fixture f;

    p.proposal = way;
    p.max_followers = 2;
    p.max_particles = 20;
    p.max_candidates = 80;
    c.lazy = lazy;
    f = filter_with(&p, &c);
    start_at(f.filter, 0, 12);
    for (c.time = 0; c.time < 12; c.time++) {
        cairn_particle_filter_trace t;

        assert_ok(run(f.filter, units));
        t = cairn_particle_filter_read(f.filter);
        hash = test_hash(hash, &t.n_eff, sizeof t.n_eff);
        hash = test_hash(hash, &t.blocks, sizeof t.blocks);
        for (int32_t i = 0; i < t.particles; i++) {
            cairn_particle q = cairn_particle_filter_particle(f.filter, i);

            hash = test_hash(hash, q.state, sizeof(chain_state));
            hash = test_hash(hash, &q.log_weight, sizeof q.log_weight);
        }
    }
    test_pool_free(&f.pool);
    return hash;
}

static void test_budgets_do_not_matter(void **state)
{
    static const int32_t units[] = {1, 7, 1000, CAIRN_UNBOUNDED};

    (void)state;
    for (cairn_particle_filter_proposal way = CAIRN_PARTICLE_FILTER_PROPOSAL_PRIOR;
         way <= CAIRN_PARTICLE_FILTER_PROPOSAL_OPTIMAL; way++) {
        uint64_t expected = hash_of_run(way, 0, CAIRN_UNBOUNDED);

        for (int i = 0; i < 4; i++) {
            assert_true(hash_of_run(way, 0, units[i]) == expected);
            assert_true(hash_of_run(way, 5, units[i]) == expected);
        }
    }
}

static uint64_t hash_of_step(const cairn_particle_filter *filter, cairn_status status,
                             uint64_t hash)
{
    cairn_particle_filter_trace t = cairn_particle_filter_read(filter);

    hash = test_hash(test_hash(hash, &status, sizeof status), &t,
                     offsetof(cairn_particle_filter_trace, resampled) + sizeof t.resampled);
    hash = test_hash(hash, &t.n_eff, sizeof t.n_eff);
    hash = test_hash(hash, &t.log_evidence, sizeof t.log_evidence);
    hash = test_hash(hash, &t.blocks, sizeof t.blocks);
    hash = test_hash(hash, &t.blocks_peak, sizeof t.blocks_peak);
    for (int32_t i = 0; i < t.particles; i++) {
        cairn_particle q = cairn_particle_filter_particle(filter, i);

        hash = test_hash(hash, q.state, sizeof(chain_state));
        hash = test_hash(hash, &q.log_weight, sizeof q.log_weight);
        hash = test_hash(hash, &q.log_likelihood, sizeof q.log_likelihood);
        hash = test_hash(hash, &q.steps, sizeof q.steps);
    }
    return hash;
}

/* Weights that are often equal, some impossible candidates, capacities too small for some steps. */
static uint64_t hash_of_halves(uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 4);
    uint64_t hash = TEST_HASH_START;

    for (int32_t k = 0; k < 24; k++) {
        chain c = new_chain(seed);
        cairn_particle_filter_params p = chain_params(2 + cairn_random_below(&random, 10));
        struct fixture f;
        chain_state first;

        memset(&first, 0, sizeof first);
        first.length = 1;
        c.in_halves = 1;
        for (int t = 0; t < 12; t++)
            for (int i = 0; i < SYMBOLS; i++)
                c.log_seen[t][i] = cairn_random_below(&random, 12) == 0
                                       ? -(double)INFINITY
                                       : -0.5 * cairn_random_below(&random, 3);
        p.proposal = k % 2 == 0 ? CAIRN_PARTICLE_FILTER_PROPOSAL_OPTIMAL
                                : CAIRN_PARTICLE_FILTER_PROPOSAL_PRIOR;
        p.adaptive_followers = cairn_random_below(&random, 2);
        p.max_followers = 1 + cairn_random_below(&random, SYMBOLS);
        p.max_particles += cairn_random_below(&random, 10);
        p.max_candidates = SYMBOLS * p.max_particles - cairn_random_below(&random, 8);
        p.max_blocks = 3 * p.max_particles + cairn_random_below(&random, 60);
        p.resample_ratio = CAIRN_REAL(0.5) * (cairn_real)cairn_random_below(&random, 3);
        f = filter_with(&p, &c);
        for (int32_t i = cairn_random_below(&random, p.particles); i >= 0; i--)
            assert_ok(cairn_particle_filter_start(f.filter, &first,
                                                  CAIRN_REAL(-0.5) * (cairn_real)(i % 2)));
        for (c.time = 0; c.time < 12; c.time++) {
            cairn_budget budget = {1 << 28};
            cairn_status status;

            assert_ok(cairn_particle_filter_begin(f.filter));
            status = cairn_particle_filter_step(f.filter, &budget);
            assert_true(status == CAIRN_OK || status == CAIRN_FULL);
            hash = test_hash(hash, &budget.left, sizeof budget.left);
            hash = hash_of_step(f.filter, status, hash);
            if (status != CAIRN_OK)
                break;
        }
        test_pool_free(&f.pool);
    }
    return hash;
}

static void test_same_bits(void **state)
{
    (void)state;
    assert_golden(hash_of_halves(1), UINT64_C(0x077d9c4a9ff1ff93), UINT64_C(0x91f8e19f15f8aa6d));
    assert_golden(hash_of_halves(2), UINT64_C(0x68b0ab5aeca8f83b), UINT64_C(0x9724d794dc245f31));
}

/* The costs of a step as the header states them. */
static void test_cost(void **state)
{
    chain c = new_chain(5);
    cairn_particle_filter_params p = chain_params(64);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    struct fixture f;
    int32_t spent;

    (void)state;
    p.resample_ratio = 0;
    f = filter_with(&p, &c);
    start_at(f.filter, 0, 1);
    run_chain(f.filter, &c, 2, CAIRN_UNBOUNDED);
    c.time = 2;
    assert_ok(cairn_particle_filter_begin(f.filter));
    assert_ok(cairn_particle_filter_step(f.filter, &budget));
    spent = CAIRN_UNBOUNDED - budget.left;
    /* 16 proposals; 64 candidates of 6 units (none is drawn); 64 followers of more than 512 bytes,
     * summed and normalized; 16 released. */
    assert_int_equal(spent, 16 + 64 * 6 + 2 * 64 + 2 * 64 + 16);
    test_pool_free(&f.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_params_are_refused),
        cmocka_unit_test(test_memory_is_exact),
        cmocka_unit_test(test_calls_out_of_turn),
        cmocka_unit_test(test_all_histories_are_exact),
        cmocka_unit_test(test_the_heaviest_are_kept),
        cmocka_unit_test(test_drawn_followers_are_right_in_the_mean),
        cmocka_unit_test(test_tree_equals_copies),
        cmocka_unit_test(test_a_history_of_its_own_is_changed_alone),
        cmocka_unit_test(test_a_shared_state_is_not_copied_without_a_free_block),
        cmocka_unit_test(test_residual_resampling),
        cmocka_unit_test(test_whole_shares),
        cmocka_unit_test(test_even_weights_are_left_alone),
        cmocka_unit_test(test_weights_do_not_underflow),
        cmocka_unit_test(test_as_many_followers_as_modes),
        cmocka_unit_test(test_boosted_followers_differ),
        cmocka_unit_test(test_discarded_and_extinct),
        cmocka_unit_test(test_discard_is_a_step),
        cmocka_unit_test(test_failures_undo_the_step),
        cmocka_unit_test(test_blocks_run_out_in_a_full_population),
        cmocka_unit_test(test_clear_in_the_middle),
        cmocka_unit_test(test_a_short_past_changes_nothing_else),
        cmocka_unit_test(test_offers_beyond_the_capacity),
        cmocka_unit_test(test_bad_offers),
        cmocka_unit_test(test_budgets_do_not_matter),
        cmocka_unit_test(test_same_bits),
        cmocka_unit_test(test_cost),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
