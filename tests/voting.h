/* Shared by the tests of both modes of part_configuration: votes, an object with its own pool, and
 * its results with any budget. */
#ifndef CAIRN_TESTS_VOTING_H
#define CAIRN_TESTS_VOTING_H

#include "tests/test.h"

#include <math.h>

#include "cairn/part_configuration.h"

enum { VOTES = 400 };

typedef struct voting {
    cairn_pool pool;
    cairn_part_configuration_params params;
    cairn_part_configurator *configurator;
    cairn_part_configuration_vote votes[VOTES];
    int32_t count;
} voting;

static inline void start(voting *v, const cairn_part_configuration_params *params)
{
    v->params = *params;
    v->count = 0;
    v->pool = test_pool(cairn_part_configuration_memory(params));
    assert_ok(cairn_part_configuration_create(&v->configurator, &v->pool, params));
}

static inline cairn_part_configuration_result run(voting *v)
{
    cairn_budget budget = {INT32_MAX};
    cairn_fault fault;

    assert_ok(cairn_part_configuration_begin(v->configurator, v->votes, v->count, &fault));
    assert_ok(cairn_part_configuration_step(v->configurator, &budget));
    return cairn_part_configuration_read(v->configurator);
}

static inline cairn_status begin_votes(void *context)
{
    voting *v = context;

    return cairn_part_configuration_begin(v->configurator, v->votes, v->count, NULL);
}

static inline cairn_status step_votes(void *context, cairn_budget *budget)
{
    voting *v = context;

    return cairn_part_configuration_step(v->configurator, budget);
}

static inline uint64_t result_hash(void *context)
{
    voting *v = context;
    cairn_part_configuration_result r = cairn_part_configuration_read(v->configurator);
    uint64_t hash = test_hash(TEST_HASH_START, &r.node_count, sizeof r.node_count);

    for (int32_t k = 0; k < r.count; k++) {
        hash = test_hash(hash, &r.found[k].score, 5 * sizeof(cairn_real));
        hash =
            test_hash(hash, &r.votes[r.found[k].first], (size_t)r.found[k].count * sizeof(int32_t));
    }
    return hash;
}

/* The votes give the same configurations with any budget, for the same units, and when the search
 * is begun anew. */
static inline void assert_any_budget(voting *v)
{
    static const int32_t budgets[] = {1, 7, 1000};
    test_stepped object = {begin_votes, step_votes, result_hash, v};
    cairn_budget all = {INT32_MAX};
    uint64_t hash;

    assert_ok(begin_votes(v));
    assert_null(cairn_part_configuration_read(v->configurator).found);
    assert_ok(step_votes(v, &all));
    assert_true(cairn_part_configuration_read(v->configurator).count > 0);
    hash = result_hash(v);
    for (int i = 0; i < 3; i++) {
        int32_t used = 0;
        cairn_status status;

        assert_ok(begin_votes(v));
        do {
            cairn_budget budget = {budgets[i]};

            status = step_votes(v, &budget);
            assert_true(budget.left >= 0);
            used += budgets[i] - budget.left;
        } while (status == CAIRN_MORE);
        assert_ok(status);
        assert_int_equal(used, INT32_MAX - all.left);
        assert_true(result_hash(v) == hash);
    }
    test_begins_anew(&object, 7);
}

static inline cairn_status create(void *context, cairn_pool *pool)
{
    cairn_part_configurator *configurator;

    return cairn_part_configuration_create(&configurator, pool, context);
}

#endif
