/* The bump pool, marks, splits, counting pools and the block pool. */
#include "tests/test.h"

#ifdef __SSE2__
#include <xmmintrin.h>
#endif

#if CAIRN_POOL_REDZONE > 0
void __asan_unpoison_memory_region(void const volatile *address, size_t size);
int __asan_address_is_poisoned(void const volatile *address);
#endif

static const size_t GAP = CAIRN_POOL_REDZONE, ALLOCATION = CAIRN_ALIGN + CAIRN_POOL_REDZONE;

static size_t rounded(size_t bytes)
{
    return (bytes + 15) / 16 * 16;
}

static void init_rounds_to_the_alignment(void **state)
{
    static _Alignas(CAIRN_ALIGN) unsigned char memory[256];
    cairn_pool pool;

    (void)state;
    assert_ok(cairn_pool_init(&pool, memory, 100));
    assert_ptr_equal(pool.base, memory);
    assert_int_equal(pool.size, 96);
    assert_int_equal(pool.used + pool.peak + pool.refused + pool.marks, 0);
    assert_int_equal(cairn_pool_remaining(&pool), 96);

    assert_ok(cairn_pool_init(&pool, memory + 1, 100));
    assert_ptr_equal(pool.base, memory + 16);
    assert_int_equal(pool.size, 80);
    assert_ok(cairn_pool_init(&pool, memory + 15, 17));
    assert_ptr_equal(pool.base, memory + 16);
    assert_int_equal(pool.size, 16);
    assert_status(cairn_pool_init(&pool, memory + 15, 16), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pool_init(&pool, memory + 1, 30), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pool_init(&pool, memory, 15), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pool_init(&pool, memory, 0), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pool_init(&pool, NULL, 100), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pool_init(NULL, memory, 100), CAIRN_BAD_ARGUMENT);
    /* A refused call changed nothing. */
    assert_ptr_equal(pool.base, memory + 16);
    assert_int_equal(pool.size, 16);
#if CAIRN_POOL_REDZONE > 0
    __asan_unpoison_memory_region(memory, sizeof memory);
#endif
}

#ifdef __SSE2__
static void flushing_to_zero_is_seen(void **state)
{
    static _Alignas(CAIRN_ALIGN) unsigned char memory[64];
    cairn_pool pool = {NULL, 1, 2, 3, 4, 5};
    const unsigned control = _mm_getcsr();
    cairn_status status;

    (void)state;
    _mm_setcsr(control | 0x8000);
    status = cairn_pool_init(&pool, memory, sizeof memory);
    _mm_setcsr(control);
    assert_status(status, CAIRN_BAD_BUILD);
    assert_true(pool.base == NULL && pool.size == 1 && pool.used == 2 && pool.peak == 3 &&
                pool.refused == 4 && pool.marks == 5);
}
#endif

static void components_are_aligned_and_apart(void **state)
{
    cairn_pool pool = test_pool(1024);
    unsigned char *end = pool.base;

    (void)state;
    for (size_t bytes = 1; bytes <= 40; bytes += 3) {
        unsigned char *piece = cairn_pool_take(&pool, bytes, 1);

        assert_ptr_equal(piece, end);
        assert_int_equal((uintptr_t)piece % CAIRN_ALIGN, 0);
        memset(piece, 0x5a, bytes);
        end = piece + rounded(bytes) + GAP;
        assert_int_equal(pool.used, (size_t)(end - pool.base));
        assert_int_equal(pool.used + cairn_pool_remaining(&pool), pool.size);
        assert_int_equal(pool.peak, pool.used);
    }
    assert_int_equal(pool.refused, 0);
    test_pool_free(&pool);
}

static void a_full_pool_refuses(void **state)
{
    cairn_pool pool = test_pool(4 * ALLOCATION);
    void *last;

    (void)state;
    assert_non_null(cairn_pool_take(&pool, 3, 5));
    assert_int_equal(pool.used, ALLOCATION);
    assert_null(cairn_pool_take(&pool, 1, 3 * ALLOCATION - GAP + 1));
    assert_int_equal(pool.refused, 1);
    assert_null(cairn_pool_take(&pool, SIZE_MAX / 2, 3)); /* the product wraps */
    assert_null(cairn_pool_take(&pool, 3, SIZE_MAX / 2));
    assert_null(cairn_pool_take(&pool, SIZE_MAX, 1)); /* the rounding wraps */
    assert_null(cairn_pool_take(&pool, 1, SIZE_MAX - 15));
    assert_int_equal(pool.refused, 5);
    assert_int_equal(pool.used, ALLOCATION);
    last = cairn_pool_take(&pool, 1, 3 * ALLOCATION - GAP);
    assert_ptr_equal(last, pool.base + ALLOCATION);
    assert_int_equal(cairn_pool_remaining(&pool), 0);
    assert_null(cairn_pool_take(&pool, 1, 1));
    assert_int_equal(pool.refused, 6);
    assert_int_equal(pool.peak, 4 * ALLOCATION);
    test_pool_free(&pool);
}

static void an_empty_map_is_a_valid_part(void **state)
{
    cairn_pool pool = test_pool(256);

    (void)state;
    assert_non_null(cairn_pool_take(&pool, 0, 8));
    assert_non_null(cairn_pool_take(&pool, 8, 0));
    assert_int_equal(pool.used, 2 * GAP);
    test_pool_free(&pool);
}

static void memory_is_requested_exactly(void **state)
{
    cairn_pool pool = test_pool(8 * ALLOCATION);

    (void)state;
    assert_non_null(cairn_pool_take(&pool, 1, 1));
    assert_int_equal(cairn_pool_has_capacity(&pool, 7 * ALLOCATION), 1);
    assert_int_equal(cairn_pool_has_capacity(&pool, 0), 1);
    assert_int_equal(pool.refused, 0);
    assert_int_equal(cairn_pool_has_capacity(&pool, 7 * ALLOCATION + 1), 0);
    assert_int_equal(pool.refused, 1);
    assert_int_equal(pool.used, ALLOCATION);
    test_pool_free(&pool);
}

static void counting_measures_like_the_real_pool(void **state)
{
    cairn_pool counting, pool = test_pool(4096);

    (void)state;
    cairn_pool_init_counting(&counting);
    assert_null(counting.base);
    assert_int_equal(counting.used, 0);
    for (size_t count = 0; count < 10; count++) {
        size_t before = pool.used;

        assert_null(cairn_pool_take(&counting, count, 7));
        assert_non_null(cairn_pool_take(&pool, count, 7));
        assert_int_equal(counting.used, pool.used);
        assert_int_equal(CAIRN_ALLOCATION_BYTES(count, 7), pool.used - before);
    }
    assert_int_equal(counting.refused, 0);
    test_pool_free(&pool);
}

static void counting_saturates(void **state)
{
    static const unsigned char constant[CAIRN_ALLOCATION_BYTES(3, 7)];
    cairn_pool counting;

    (void)state;
    assert_int_equal(sizeof constant, 32 + GAP);
    cairn_pool_init_counting(&counting);
    assert_null(cairn_pool_take(&counting, SIZE_MAX / 8, 9));
    assert_int_equal(counting.used, SIZE_MAX);
    assert_null(cairn_pool_take(&counting, 1, 1)); /* and stays */
    assert_int_equal(counting.used, SIZE_MAX);
    assert_null(cairn_pool_take(&counting, 0, 0));
    assert_int_equal(counting.used, SIZE_MAX);

    /* Objects within the object. */
    assert_int_equal(cairn_pool_counted(&counting), 0);
    cairn_pool_init_counting(&counting);
    cairn_pool_count(&counting, 48);
    cairn_pool_count(&counting, SIZE_MAX - 49);
    assert_int_equal(cairn_pool_counted(&counting), SIZE_MAX - 1);
    cairn_pool_init_counting(&counting);
    cairn_pool_count(&counting, 48);
    cairn_pool_count(&counting, SIZE_MAX - 48);
    assert_int_equal(cairn_pool_counted(&counting), 0);
    cairn_pool_init_counting(&counting);
    cairn_pool_count(&counting, 48);
    cairn_pool_count(&counting, 0);
    assert_int_equal(cairn_pool_counted(&counting), 0);
    cairn_pool_init_counting(&counting);
    assert_null(cairn_pool_take_one(&counting, 24));
    assert_int_equal(counting.used, CAIRN_ALLOCATION_BYTES(1, 24));

    cairn_pool_init_counting(&counting);
    assert_null(cairn_pool_take(&counting, SIZE_MAX / 32, 16));
    assert_int_equal(counting.used, SIZE_MAX / 32 * 16 + GAP);
    assert_null(cairn_pool_take(&counting, SIZE_MAX / 32, 16));
    assert_int_equal(counting.used, GAP > 0 ? SIZE_MAX : SIZE_MAX / 32 * 32);
    assert_null(cairn_pool_take(&counting, 16, 2));
    assert_int_equal(counting.used, SIZE_MAX);
}

static void marks_release_in_order(void **state)
{
    cairn_pool pool = test_pool(1024);
    cairn_mark first, second, none = {0, 0};
    unsigned char *kept, *piece;

    (void)state;
    kept = cairn_pool_take(&pool, 1, 8);
    assert_ok(cairn_pool_mark(&pool, &first));
    piece = cairn_pool_take(&pool, 1, 20);
    assert_non_null(piece);
    assert_ok(cairn_pool_mark(&pool, &second));
    assert_non_null(cairn_pool_take(&pool, 1, 20));
    assert_int_equal(pool.marks, 2);

    assert_status(cairn_pool_release(&pool, first), CAIRN_BAD_ARGUMENT); /* second is due */
    assert_status(cairn_pool_release(&pool, none), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pool_release(NULL, second), CAIRN_BAD_ARGUMENT);
    assert_int_equal(pool.used, ALLOCATION + 2 * (32 + GAP));
    assert_ok(cairn_pool_release(&pool, second));
    assert_int_equal(pool.used, ALLOCATION + 32 + GAP);
    assert_status(cairn_pool_release(&pool, second), CAIRN_BAD_ARGUMENT); /* twice */
    assert_ok(cairn_pool_release(&pool, first));
    assert_int_equal(pool.used, ALLOCATION);
    assert_int_equal(pool.marks, 0);
    assert_int_equal(pool.peak, ALLOCATION + 2 * (32 + GAP));
    assert_status(cairn_pool_release(&pool, first), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pool_release(&pool, none), CAIRN_BAD_ARGUMENT);
    assert_ptr_equal(cairn_pool_take(&pool, 1, 20), piece);
    kept[0] = 1;

    assert_status(cairn_pool_mark(NULL, &first), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pool_mark(&pool, NULL), CAIRN_BAD_ARGUMENT);
    assert_int_equal(pool.marks, 0);
    test_pool_free(&pool);
}

static void a_mark_above_the_level_is_refused(void **state)
{
    cairn_pool pool = test_pool(256);
    cairn_mark mark;

    (void)state;
    assert_ok(cairn_pool_mark(&pool, &mark));
    mark.used = CAIRN_ALIGN;
    assert_status(cairn_pool_release(&pool, mark), CAIRN_BAD_ARGUMENT);
    mark.used = 0;
    assert_ok(cairn_pool_release(&pool, mark));
    test_pool_free(&pool);
}

static void counting_pools_take_marks(void **state)
{
    cairn_pool counting;
    cairn_mark mark;

    (void)state;
    cairn_pool_init_counting(&counting);
    assert_null(cairn_pool_take(&counting, 1, 1));
    assert_ok(cairn_pool_mark(&counting, &mark));
    assert_null(cairn_pool_take(&counting, 100, 1));
    assert_ok(cairn_pool_release(&counting, mark));
    assert_int_equal(counting.used, ALLOCATION);
}

static void a_split_is_a_pool_of_its_own(void **state)
{
    cairn_pool pool = test_pool(512), child, counting, untouched;
    unsigned char *piece;

    (void)state;
    assert_non_null(cairn_pool_take(&pool, 1, 1));
    assert_ok(cairn_pool_split(&pool, &child, 100));
    assert_ptr_equal(child.base, pool.base + ALLOCATION);
    assert_int_equal(child.size, 112);
    assert_int_equal(child.used, 0);
    assert_int_equal(pool.used, ALLOCATION + 112 + GAP);
    piece = cairn_pool_take(&child, 1, 112 - GAP);
    assert_ptr_equal(piece, child.base);
    memset(piece, 1, 112 - GAP);
    assert_null(cairn_pool_take(&child, 1, 1));
    assert_int_equal(pool.refused, 0);
    assert_int_equal(child.refused, 1);

    untouched = child;
    assert_status(cairn_pool_split(&pool, &child, 512), CAIRN_NO_MEMORY);
    assert_status(cairn_pool_split(&pool, &child, SIZE_MAX), CAIRN_NO_MEMORY);
    assert_status(cairn_pool_split(&pool, &child, SIZE_MAX - 15), CAIRN_NO_MEMORY);
    assert_int_equal(pool.refused, 3);
    assert_status(cairn_pool_split(&pool, &child, 0), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pool_split(&pool, NULL, 16), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_pool_split(NULL, &child, 16), CAIRN_BAD_ARGUMENT);
    cairn_pool_init_counting(&counting);
    assert_status(cairn_pool_split(&counting, &child, 16), CAIRN_BAD_ARGUMENT);
    assert_memory_equal(&child, &untouched, sizeof child);
    test_pool_free(&pool);
}

#if CAIRN_POOL_REDZONE > 0
static void gaps_are_poisoned(void **state)
{
    cairn_pool pool = test_pool(1024);
    cairn_block_pool *blocks;
    cairn_mark mark;
    unsigned char *piece, *block;

    (void)state;
    assert_ok(cairn_pool_mark(&pool, &mark));
    piece = cairn_pool_take(&pool, 1, 24);
    assert_false(__asan_address_is_poisoned(piece));
    assert_false(__asan_address_is_poisoned(piece + 23));
    for (size_t i = 24; i < 32 + GAP; i++)
        assert_true(__asan_address_is_poisoned(piece + i));
    assert_ok(cairn_pool_release(&pool, mark));
    assert_true(__asan_address_is_poisoned(piece));
    assert_true(__asan_address_is_poisoned(pool.base + pool.size - 1));

    assert_ok(cairn_block_pool_create(&blocks, &pool, 20, 3));
    block = cairn_block_pool_take(blocks);
    assert_false(__asan_address_is_poisoned(block));
    assert_false(__asan_address_is_poisoned(block + 19));
    assert_true(__asan_address_is_poisoned(block + 20));
    assert_true(__asan_address_is_poisoned(block + 32));
    assert_ok(cairn_block_pool_give(blocks, block));
    assert_true(__asan_address_is_poisoned(block));
    test_pool_free(&pool);
}
#endif

static void block_pool_sizes(void **state)
{
    size_t need = cairn_block_pool_memory(20, 10);

    (void)state;
    /* The object, 10 links, 10 blocks of 32 bytes. */
    assert_true(need > 10 * 32 + 48 + 3 * GAP);
    assert_int_equal(need % CAIRN_ALIGN, 0);
    assert_int_equal(cairn_block_pool_memory(20, 14) - need, 4 * 32 + 16);
    assert_int_equal(cairn_block_pool_memory(32, 10), need);
    assert_int_equal(cairn_block_pool_memory(33, 10), need + 160);
    assert_int_equal(cairn_block_pool_memory(0, 10), 0);
    assert_int_equal(cairn_block_pool_memory(20, 0), 0);
    assert_int_equal(cairn_block_pool_memory(20, INT32_MAX), 0);
    assert_true(cairn_block_pool_memory(20, INT32_MAX - 1) > 0);
    assert_int_equal(cairn_block_pool_memory(SIZE_MAX, 1), 0);
    assert_int_equal(cairn_block_pool_memory(SIZE_MAX - 15, 1), 0);
    assert_int_equal(cairn_block_pool_memory(SIZE_MAX / 2, 3), 0);
    assert_int_equal(cairn_block_pool_memory(SIZE_MAX / 3 * 2, 1) > SIZE_MAX / 3 * 2, 1);
}

static cairn_status create_blocks(void *context, cairn_pool *pool)
{
    return cairn_block_pool_create(context, pool, 24, 5);
}

static void block_pool_in_every_size(void **state)
{
    cairn_block_pool *blocks;
    cairn_pool pool = test_pool(4096);

    (void)state;
    test_every_pool_size(create_blocks, &blocks, cairn_block_pool_memory(24, 5));
    assert_status(cairn_block_pool_create(NULL, &pool, 24, 5), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_block_pool_create(&blocks, NULL, 24, 5), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_block_pool_create(&blocks, &pool, 0, 5), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_block_pool_create(&blocks, &pool, 24, 0), CAIRN_BAD_ARGUMENT);
    assert_int_equal(pool.used, 0);
    test_pool_free(&pool);
}

static void assert_usage(const cairn_block_pool *blocks, int32_t used, int32_t peak,
                         uint32_t refused)
{
    cairn_block_pool_usage usage = cairn_block_pool_read(blocks);

    assert_int_equal(usage.count, 5);
    assert_int_equal(usage.used, used);
    assert_int_equal(usage.peak, peak);
    assert_int_equal(usage.refused, refused);
}

static void blocks_are_taken_and_returned(void **state)
{
    cairn_pool pool = test_pool(4096);
    cairn_block_pool *blocks;
    unsigned char *block[5], foreign[32], *again;

    (void)state;
    assert_ok(cairn_block_pool_create(&blocks, &pool, 24, 5));
    assert_usage(blocks, 0, 0, 0);
    for (int i = 0; i < 5; i++) {
        block[i] = cairn_block_pool_take(blocks);
        assert_non_null(block[i]);
        assert_int_equal((uintptr_t)block[i] % CAIRN_ALIGN, 0);
        memset(block[i], i, 24);
        assert_usage(blocks, i + 1, i + 1, 0);
    }
    for (int i = 0; i < 5; i++) {
        for (int k = 0; k < 24; k++)
            assert_int_equal(block[i][k], i);
        for (int j = 0; j < i; j++)
            assert_true(block[i] >= block[j] + 32 || block[j] >= block[i] + 32);
    }
    assert_null(cairn_block_pool_take(blocks));
    assert_null(cairn_block_pool_take(blocks));
    assert_usage(blocks, 5, 5, 2);

    assert_ok(cairn_block_pool_give(blocks, block[3]));
    assert_ok(cairn_block_pool_give(blocks, block[0]));
    assert_usage(blocks, 3, 5, 2);
    /* twice */
    assert_status(cairn_block_pool_give(blocks, block[3]), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_block_pool_give(blocks, block[1] + 16), CAIRN_BAD_ARGUMENT);
    /* behind the last */
    assert_status(cairn_block_pool_give(blocks, block[4] + 32), CAIRN_BAD_ARGUMENT);
    /* before the first */
    assert_status(cairn_block_pool_give(blocks, block[0] - 32), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_block_pool_give(blocks, block[0] - 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_block_pool_give(blocks, foreign), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_block_pool_give(blocks, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_block_pool_give(NULL, block[1]), CAIRN_BAD_ARGUMENT);
    assert_usage(blocks, 3, 5, 2);

    again = cairn_block_pool_take(blocks);
    assert_ptr_equal(again, block[0]); /* the one returned last is reused first */
    assert_ptr_equal(cairn_block_pool_take(blocks), block[3]);
    assert_null(cairn_block_pool_take(blocks));
    assert_usage(blocks, 5, 5, 3);
    for (int i = 4; i >= 0; i--)
        assert_ok(cairn_block_pool_give(blocks, block[i]));
    assert_usage(blocks, 0, 5, 3);
    test_pool_free(&pool);
}

/* Compared with a list of taken blocks, over many random takes and returns. */
static void blocks_at_random(void **state)
{
    cairn_random random = cairn_random_seed(11, 0);
    cairn_pool pool = test_pool(8192);
    cairn_block_pool *blocks;
    int32_t *out[16];
    int held = 0, most = 0;

    (void)state;
    assert_ok(cairn_block_pool_create(&blocks, &pool, sizeof(int32_t), 16));
    for (int i = 0; i < 5000; i++) {
        if (cairn_random_below(&random, 100) < (i / 500 % 2 ? 30 : 70)) {
            int32_t *block = cairn_block_pool_take(blocks);

            assert_int_equal(block != NULL, held < 16);
            if (block != NULL) {
                for (int k = 0; k < held; k++)
                    assert_ptr_not_equal(block, out[k]);
                *block = i;
                out[held++] = block;
            }
        } else if (held > 0) {
            int32_t chosen = cairn_random_below(&random, held);

            assert_ok(cairn_block_pool_give(blocks, out[chosen]));
            out[chosen] = out[--held];
        }
        most = held > most ? held : most;
        assert_int_equal(cairn_block_pool_read(blocks).used, held);
        assert_int_equal(cairn_block_pool_read(blocks).peak, most);
    }
    assert_int_equal(most, 16);
    test_pool_free(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(init_rounds_to_the_alignment),
#ifdef __SSE2__
        cmocka_unit_test(flushing_to_zero_is_seen),
#endif
        cmocka_unit_test(components_are_aligned_and_apart),
        cmocka_unit_test(a_full_pool_refuses),
        cmocka_unit_test(an_empty_map_is_a_valid_part),
        cmocka_unit_test(memory_is_requested_exactly),
        cmocka_unit_test(counting_measures_like_the_real_pool),
        cmocka_unit_test(counting_saturates),
        cmocka_unit_test(marks_release_in_order),
        cmocka_unit_test(a_mark_above_the_level_is_refused),
        cmocka_unit_test(counting_pools_take_marks),
        cmocka_unit_test(a_split_is_a_pool_of_its_own),
#if CAIRN_POOL_REDZONE > 0
        cmocka_unit_test(gaps_are_poisoned),
#endif
        cmocka_unit_test(block_pool_sizes),
        cmocka_unit_test(block_pool_in_every_size),
        cmocka_unit_test(blocks_are_taken_and_returned),
        cmocka_unit_test(blocks_at_random),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
