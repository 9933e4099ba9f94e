/* Pools, hashes and stepped objects for all tests. */
#include "tests/test.h"

#include <math.h>

#include "tests/golden.h"

/* A failed assertion of the library ends the current test. */
void cairn_assertion_failed(const char *condition, const char *file, int line);
void cairn_assertion_failed(const char *condition, const char *file, int line)
{
    _assert_true(0, condition, file, line);
}

void test_assert_near(double actual, double expected, double tolerance, const char *what,
                      const char *file, int line)
{
    if (fabs(actual - expected) <= tolerance)
        return;
    print_error("%s is %.17g, expected %.17g within %.3g\n", what, actual, expected, tolerance);
    _fail(file, line);
}

cairn_pool test_pool(size_t bytes)
{
    cairn_pool pool;
    void *memory = aligned_alloc(CAIRN_ALIGN, (bytes + CAIRN_ALIGN + CAIRN_ALIGN - 1) /
                                                  CAIRN_ALIGN * CAIRN_ALIGN);

    assert_non_null(memory);
    memset(memory, 0xA5, bytes); /* nothing may depend on the contents of fresh memory */
    assert_ok(cairn_pool_init(&pool, memory, bytes < CAIRN_ALIGN ? CAIRN_ALIGN : bytes));
    return pool;
}

void test_pool_free(cairn_pool *pool)
{
    free(pool->base);
    pool->base = NULL;
}

void test_every_pool_size(test_create create, void *context, size_t need)
{
    /* Under AddressSanitizer the block must belong to the pool; free() removes its poison. */
    cairn_pool whole = test_pool(need + CAIRN_ALIGN);

    assert_true(need > 0);
    assert_int_equal(need % CAIRN_ALIGN, 0);
    for (size_t bytes = 0; bytes < need; bytes += CAIRN_ALIGN) {
        cairn_pool pool = whole;

        pool.size = bytes;
        assert_status(create(context, &pool), CAIRN_NO_MEMORY);
        assert_int_equal(pool.used, 0);
        assert_int_equal(pool.marks, 0);
    }
    whole.size = need;
    assert_ok(create(context, &whole));
    assert_int_equal(whole.used, need);
    test_pool_free(&whole);
}

static uint64_t run_to_end(const test_stepped *object, int64_t *units)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(object->begin(object->context));
    assert_ok(object->step(object->context, &budget));
    *units = CAIRN_UNBOUNDED - budget.left;
    return object->result_hash(object->context);
}

void test_begins_anew(const test_stepped *object, int32_t stops)
{
    int64_t whole, again;
    uint64_t hash;

    (void)run_to_end(object, &whole); /* what is done once only has been done */
    hash = run_to_end(object, &whole);
    for (int32_t k = 1; k <= stops; k++) {
        cairn_budget budget = {(int32_t)(whole * k / (stops + 1))};

        assert_ok(object->begin(object->context));
        assert_int_equal(object->step(object->context, &budget), CAIRN_MORE);
        assert_true(run_to_end(object, &again) == hash);
        assert_int_equal(again, whole);
    }
}

uint64_t test_hash(uint64_t hash, const void *data, size_t bytes)
{
    return add_bytes(hash, data, bytes);
}

void test_assert_golden(uint64_t hash, uint64_t expected, const char *file, int line)
{
    if (hash == expected)
        return;
    print_error("the hash is 0x%016llx instead of 0x%016llx\n", (unsigned long long)hash,
                (unsigned long long)expected);
    _fail(file, line);
}
