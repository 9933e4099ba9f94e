/* Error texts of files: path, line, reason; errors of the system. */
#include "tests/test.h"

#include <errno.h>

#include "cairn/file_error.h"

static void texts_name_file_and_line(void **state)
{
    cairn_file_error error;

    (void)state;
    assert_status(
        cairn_file_error_set(&error, CAIRN_BAD_FORMAT, "a.log", 7, "%d ranges, expected %d", 3, 4),
        CAIRN_BAD_FORMAT);
    assert_int_equal(error.status, CAIRN_BAD_FORMAT);
    assert_int_equal(error.line, 7);
    assert_string_equal(error.text, "a.log:7: 3 ranges, expected 4");
    assert_status(cairn_file_error_set(&error, CAIRN_EMPTY, "a.log", 0, "no scan"), CAIRN_EMPTY);
    assert_string_equal(error.text, "a.log: no scan");
    assert_int_equal(error.line, 0);
    assert_status(cairn_file_error_set(NULL, CAIRN_IO, "a.log", 0, "no scan"), CAIRN_IO);
}

static void long_paths_are_cut_from_the_left(void **state)
{
    cairn_file_error error;
    char path[3000];

    (void)state;
    memset(path, 'x', sizeof path);
    memcpy(path + sizeof path - 7, "end.log", 7);
    path[sizeof path - 1] = '\0';
    assert_status(cairn_file_error_set(&error, CAIRN_IO, path, 12, "cut off, expected more"),
                  CAIRN_IO);
    assert_true(strlen(error.text) < CAIRN_FILE_ERROR_BYTES);
    assert_non_null(strstr(error.text, "end.lo:12: cut off, expected more"));
}

static void refusals_of_the_system_are_reported(void **state)
{
    cairn_file_error error;

    (void)state;
    assert_status(cairn_file_error_system(&error, "a.log", "read", ENOENT), CAIRN_IO);
    assert_non_null(strstr(error.text, "a.log: cannot read: "));
    assert_non_null(strstr(error.text, "No such file"));
    assert_status(cairn_file_error_system(&error, "a.log", "read", ENOMEM), CAIRN_NO_MEMORY);
    assert_int_equal(error.status, CAIRN_NO_MEMORY);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(texts_name_file_and_line),
        cmocka_unit_test(long_paths_are_cut_from_the_left),
        cmocka_unit_test(refusals_of_the_system_are_reported),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
