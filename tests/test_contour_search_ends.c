/* contour_search_ends: the meeting segments are those found by comparing all pairs. */
#include "tests/test.h"

#include "src/detection/contour_search_ends.h"

enum { LINES = 400, END_DISTANCE_PX = 4 };

static void assert_same_as_all(const cairn_segment *lines, int32_t count)
{
    int32_t listed[LINES], listed_count = 0, met = 0;
    cairn_pool pool = test_pool(1 << 20);
    contour_search_ends ends;

    for (int32_t i = 0; i < count; i++)
        if (i % 7 != 3)
            listed[listed_count++] = i;
    cairn_contour_search_ends_take(&ends, &pool, listed_count);
    cairn_contour_search_ends_make(&ends, lines, listed, listed_count, END_DISTANCE_PX);
    for (int32_t round = 0; round < 2; round++)
        for (int32_t i = 0; i < listed_count; i++) {
            int32_t near = cairn_contour_search_ends_near(&ends, i), at = 0;

            for (int32_t k = 0; k < listed_count; k++)
                if (k != i && cairn_contour_search_meet(lines[listed[i]], lines[listed[k]],
                                                        END_DISTANCE_PX)) {
                    assert_true(at < near);
                    assert_int_equal(ends.neighbours[at++], k);
                }
            assert_int_equal(at, near);
            assert_true(cairn_contour_search_ends_compared(&ends, i) >= near);
            met += near;
        }
    assert_true(count < LINES / 2 || met > LINES / 4);
    test_pool_free(&pool);
}

static void finds_all_that_meet(void **state)
{
    static const double widths[] = {0, 10, 60, 300, 5000, 900000};
    cairn_segment lines[LINES];

    (void)state;
    for (size_t w = 0; w < sizeof widths / sizeof *widths; w++) {
        cairn_random random = cairn_random_seed(w, 2);
        cairn_real width = (cairn_real)widths[w];

        for (int32_t i = 0; i < LINES; i++) {
            cairn_real reach = 30;

            lines[i].a.x = cairn_random_uniform(&random, -width, width);
            lines[i].a.y = cairn_random_uniform(&random, 0, 1) * width;
            lines[i].b.x = lines[i].a.x + cairn_random_uniform(&random, -reach, reach);
            lines[i].b.y = lines[i].a.y + cairn_random_uniform(&random, -reach, reach);
            /* Every third begins near the end of the one before, some exactly at the greatest
             * distance. */
            if (i % 3 == 2) {
                lines[i].a = lines[i - 1].b;
                lines[i].a.x += i % 2 == 0 ? END_DISTANCE_PX : cairn_random_uniform(&random, -5, 5);
            }
        }
        assert_same_as_all(lines, LINES);
    }
}

static void few_lines(void **state)
{
    static const cairn_segment lines[] = {{{1, 1}, {5, 1}}, {{9, 1}, {20, 1}}, {{9, 5}, {9, 5}}};

    (void)state;
    for (int32_t count = 0; count <= 3; count++)
        assert_same_as_all(lines, count);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(finds_all_that_meet),
        cmocka_unit_test(few_lines),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
