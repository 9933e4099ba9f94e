/* Shared by the tests of both modes of map_merge: a merging with any budget, and a hash of its
 * results. */
#ifndef CAIRN_TESTS_MERGING_H
#define CAIRN_TESTS_MERGING_H

#include "tests/test.h"

#include "cairn/map_merge.h"

/* Continues in steps of `units`; none exceeds its budget. */
static inline void run(cairn_map_merge *merge, int32_t units)
{
    cairn_status status;

    do {
        cairn_budget budget = {units};

        status = cairn_map_merge_step(merge, &budget);
        assert_true(budget.left >= 0);
        assert_true(status != CAIRN_MORE || budget.left == 0);
    } while (status == CAIRN_MORE);
    assert_ok(status);
}

/* Of the first `maps` maps: poses and supports. */
static inline uint64_t hash_of(const cairn_map_merge *merge, int32_t maps)
{
    uint64_t hash = TEST_HASH_START;

    for (int32_t i = 0; i < maps; i++) {
        cairn_map_merge_placed p = cairn_map_merge_of(merge, i);

        hash = test_hash(hash, &p.reference_map, sizeof p.reference_map);
        hash = test_hash(hash, &p.support, sizeof p.support);
        hash = test_hash(hash, &p.error_probability, sizeof p.error_probability);
    }
    return hash;
}

static inline cairn_status create(void *context, cairn_pool *pool)
{
    cairn_map_merge *merge;

    return cairn_map_merge_create(&merge, pool, context);
}

#endif
