/* Defaults and ranges of parameters are those that the comments of the headers say, in
 * tests/comments.h, which tools/docs-defaults.sh makes below the build folder. */
#include "tests/test.h"

#include "tests/comments.h"

static void defaults_and_ranges_are_those_of_the_comments(void **state)
{
    (void)state;
    assert_int_equal(compare_with_comments(), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(defaults_and_ranges_are_those_of_the_comments),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
