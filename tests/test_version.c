/* The version at compile time and at run time. */
#include "tests/test.h"

#include "cairn/version.h"

static void number_and_text_agree(void **state)
{
    char expected[64];
    int32_t version = cairn_version();

    (void)state;
    assert_int_equal(version / 10000, CAIRN_VERSION_MAJOR);
    assert_int_equal(version / 100 % 100, CAIRN_VERSION_MINOR);
    assert_int_equal(version % 100, CAIRN_VERSION_PATCH);
    (void)snprintf(expected, sizeof expected, "%d.%d.%d%s", (int)(version / 10000),
                   (int)(version / 100 % 100), (int)(version % 100), NUMBER("", " float"));
    assert_memory_equal(expected, CAIRN_VERSION_STRING, sizeof CAIRN_VERSION_STRING - 1);
    assert_string_equal(cairn_version_text(), expected);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(number_and_text_agree),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
