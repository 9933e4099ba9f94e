/* Counting sort by cells beside a search through all entries. */
#include "tests/test.h"

#include "src/containers/cell_sort.h"

enum { CELLS = 37, MOST = 200, ROUNDS = 100 };

/* Sorts entries of random cells, with ranges of `width` elements; checks that each cell holds its
 * entries, the last one first. */
static void sort_and_compare(cairn_random *random, int32_t count, int32_t width)
{
    int32_t start[CELLS + 1], cell[MOST], entry[MOST], place = 0;

    memset(start, -1, sizeof start);
    for (int32_t i = 0; i < count; i++)
        cell[i] = cairn_random_below(random, CELLS);
    for (int32_t first = 0; first <= CELLS; first += width)
        cell_sort_reset(start, first, first + width <= CELLS ? first + width : CELLS + 1);
    for (int32_t i = 0; i < count; i++)
        cell_sort_count(start, cell[i]);
    for (int32_t first = 0; first <= CELLS; first += width)
        cell_sort_sum(start, first, first + width <= CELLS ? first + width : CELLS + 1);
    for (int32_t i = 0; i < count; i++)
        entry[cell_sort_place(start, cell[i])] = i;
    for (int32_t c = 0; c < CELLS; c++) {
        assert_int_equal(start[c], place);
        for (int32_t i = count - 1; i >= 0; i--)
            if (cell[i] == c)
                assert_int_equal(entry[place++], i);
    }
    assert_int_equal(start[CELLS], count);
}

static void entries_lie_in_their_cells_the_last_one_first(void **state)
{
    cairn_random random = cairn_random_seed(1, 1);

    (void)state;
    for (int32_t round = 0; round < ROUNDS; round++)
        sort_and_compare(&random, 2 * round, CELLS + 1);
}

static void ranges_give_what_the_whole_gives(void **state)
{
    cairn_random random = cairn_random_seed(2, 1);

    (void)state;
    for (int32_t round = 0; round < ROUNDS; round++)
        sort_and_compare(&random, 2 * round, 1 + round % (CELLS + 1));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(entries_lie_in_their_cells_the_last_one_first),
        cmocka_unit_test(ranges_give_what_the_whole_gives),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
