/* Disjoint sets beside labels that are all renamed at each union. */
#include "tests/test.h"

#include "src/containers/disjoint_sets.h"

enum { ITEMS = 60, ROUNDS = 200 };

static void each_item_is_its_own_set_at_first(void **state)
{
    int32_t root[ITEMS];

    (void)state;
    memset(root, -1, sizeof root);
    disjoint_sets_reset(root, ITEMS - 1);
    for (int32_t i = 0; i < ITEMS - 1; i++)
        assert_int_equal(disjoint_sets_root(root, i), i);
    assert_int_equal(root[ITEMS - 1], -1);
    disjoint_sets_add(root, ITEMS - 1);
    assert_int_equal(disjoint_sets_root(root, ITEMS - 1), ITEMS - 1);
}

static void root_is_the_least_item_after_any_unions(void **state)
{
    cairn_random random = cairn_random_seed(1, 1);
    int32_t joined = 0, kept = 0;

    (void)state;
    for (int32_t round = 0; round < ROUNDS; round++) {
        int32_t root[ITEMS], label[ITEMS];

        disjoint_sets_reset(root, ITEMS);
        for (int32_t i = 0; i < ITEMS; i++)
            label[i] = i;
        for (int32_t links = 0; links < round; links++) {
            int32_t a = cairn_random_below(&random, ITEMS), b = cairn_random_below(&random, ITEMS);
            int32_t low = label[a] < label[b] ? label[a] : label[b],
                    high = label[a] < label[b] ? label[b] : label[a];

            assert_int_equal(disjoint_sets_unite(root, a, b), low != high);
            joined += low != high;
            kept += low == high;
            for (int32_t i = 0; i < ITEMS; i++)
                label[i] = label[i] == high ? low : label[i];
            for (int32_t i = links % 3; i < ITEMS; i += 3)
                assert_int_equal(disjoint_sets_root(root, i), label[i]);
        }
    }
    assert_true(joined > 1000 && kept > 1000);
}

static void a_search_halves_the_path(void **state)
{
    int32_t root[ITEMS], steps = 0;

    (void)state;
    disjoint_sets_reset(root, ITEMS);
    for (int32_t i = ITEMS - 1; i > 0; i--)
        assert_int_equal(disjoint_sets_unite(root, i, i - 1), 1);
    for (int32_t i = ITEMS - 1; root[i] != i; i = root[i])
        steps++;
    assert_int_equal(steps, ITEMS - 1);
    assert_int_equal(disjoint_sets_root(root, ITEMS - 1), 0);
    for (int32_t i = ITEMS - 1; root[i] != i; i = root[i])
        steps--;
    assert_int_equal(steps, ITEMS - 1 - ITEMS / 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_item_is_its_own_set_at_first),
        cmocka_unit_test(root_is_the_least_item_after_any_unions),
        cmocka_unit_test(a_search_halves_the_path),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
