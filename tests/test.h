/* Included by every test program: cmocka and its extensions. */
#ifndef CAIRN_TESTS_TEST_H
#define CAIRN_TESTS_TEST_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "cairn/geometry.h"
#include "cairn/pool.h"
#include "cairn/random.h"

/* |actual - expected| <= tolerance; a NaN fails. */
#define assert_near(actual, expected, tolerance)                                                   \
    test_assert_near((double)(actual), (double)(expected), (double)(tolerance), #actual, __FILE__, \
                     __LINE__)
void test_assert_near(double actual, double expected, double tolerance, const char *what,
                      const char *file, int line);

#define assert_ok(call) assert_int_equal(call, CAIRN_OK)
/* An add() that takes the input, whose steps are pending. */
#define assert_taken(call)          assert_int_equal(call, CAIRN_MORE)
#define assert_status(call, status) assert_int_equal(call, status)

/* A call that is refused with a status and reports in *fault what is wrong and, unless `where` is
 * -1, with which item. */
#define assert_fault(fault, call, status, where)                                                   \
    do {                                                                                           \
        (fault)->index = -7;                                                                       \
        (fault)->message = NULL;                                                                   \
        assert_int_equal(call, status);                                                            \
        assert_non_null((fault)->message);                                                         \
        assert_int_equal((fault)->index, where);                                                   \
    } while (0)

/* For example 1e-12 in double and 1e-5 in float: NUMBER(1e-12, 1e-5). */
#ifdef CAIRN_FLOAT
#define NUMBER(in_double, in_float) (in_float)
#else
#define NUMBER(in_double, in_float) (in_double)
#endif

/* A pool over fresh memory of the heap; test_pool_free returns it. */
cairn_pool test_pool(size_t bytes);
void test_pool_free(cairn_pool *pool);

/* Calls create(context, pool) on pools of every size from 0 to `need` in steps of 16 bytes: all
 * but the last must return CAIRN_NO_MEMORY and leave the pool as it was; the last must return
 * CAIRN_OK and use exactly `need`. */
typedef cairn_status (*test_create)(void *context, cairn_pool *pool);
void test_every_pool_size(test_create create, void *context, size_t need);

/* An object whose step() is called until it no longer returns CAIRN_MORE; `result_hash` hashes its
 * result. */
typedef struct test_stepped {
    cairn_status (*begin)(void *context);
    cairn_status (*step)(void *context, cairn_budget *budget);
    uint64_t (*result_hash)(void *context);
    void *context;
} test_stepped;

/* Begun anew after any of `stops` steps it gives the same result in the same number of units: no
 * state is left over. */
void test_begins_anew(const test_stepped *object, int32_t stops);

/* FNV-1a over bytes, for golden hashes. Start with TEST_HASH_START. */
#define TEST_HASH_START UINT64_C(14695981039346656037)
uint64_t test_hash(uint64_t hash, const void *data, size_t bytes);

/* Fails unless the hash is that of this build's numbers, and prints it. All bits of a scene's
 * results change only on purpose. */
#define assert_golden(hash, in_double, in_float)                                                   \
    test_assert_golden(hash, NUMBER(in_double, in_float), __FILE__, __LINE__)
void test_assert_golden(uint64_t hash, uint64_t expected, const char *file, int line);

#endif
