/* Counting sort beside a search through all entries. */
#include "tests/test.h"

#include "src/containers/counting_sort.h"

enum { KEYS = 37, MOST = 200, ROUNDS = 100 };

/* Sorts entries of random keys, with ranges of `width` elements; checks that each key has its
 * entries, the last one first. */
static void sort_and_compare(cairn_random *random, int32_t count, int32_t width)
{
    int32_t start[KEYS + 1], key[MOST], entry[MOST], place = 0;

    memset(start, -1, sizeof start);
    for (int32_t i = 0; i < count; i++)
        key[i] = cairn_random_below(random, KEYS);
    for (int32_t first = 0; first <= KEYS; first += width)
        counting_sort_reset(start, first, first + width <= KEYS ? first + width : KEYS + 1);
    for (int32_t i = 0; i < count; i++)
        counting_sort_count(start, key[i]);
    for (int32_t first = 0; first <= KEYS; first += width)
        counting_sort_sum(start, first, first + width <= KEYS ? first + width : KEYS + 1);
    for (int32_t i = 0; i < count; i++)
        entry[counting_sort_place(start, key[i])] = i;
    for (int32_t k = 0; k < KEYS; k++) {
        assert_int_equal(start[k], place);
        for (int32_t i = count - 1; i >= 0; i--)
            if (key[i] == k)
                assert_int_equal(entry[place++], i);
    }
    assert_int_equal(start[KEYS], count);
}

static void entries_lie_at_their_keys_the_last_one_first(void **state)
{
    cairn_random random = cairn_random_seed(1, 1);

    (void)state;
    for (int32_t round = 0; round < ROUNDS; round++)
        sort_and_compare(&random, 2 * round, KEYS + 1);
}

static void ranges_give_what_the_whole_gives(void **state)
{
    cairn_random random = cairn_random_seed(2, 1);

    (void)state;
    for (int32_t round = 0; round < ROUNDS; round++)
        sort_and_compare(&random, 2 * round, 1 + round % (KEYS + 1));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(entries_lie_at_their_keys_the_last_one_first),
        cmocka_unit_test(ranges_give_what_the_whole_gives),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
