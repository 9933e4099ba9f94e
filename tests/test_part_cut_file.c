/* Fragments given by hand, from files; bad files. */
#include "cairn/part_cut_file.h"
#include "tests/files.h"

static cairn_file_error error;

static void reads_cuts(void **state)
{
    cairn_part_bundle_cut cuts[CAIRN_PART_MAX_FRAGMENTS];
    int32_t count;

    (void)state;
    assert_ok(cairn_part_cut_file_read(
        cuts, &count, files_write_text("a.cuts", "# head\n 0 31 0\r\n\n31\t60 7 # tail"), &error));
    assert_int_equal(count, 2);
    assert_int_equal(cuts[0].from, 0);
    assert_int_equal(cuts[0].to, 31);
    assert_int_equal(cuts[0].bundle, 0);
    assert_int_equal(cuts[1].from, 31);
    assert_int_equal(cuts[1].to, 60);
    assert_int_equal(cuts[1].bundle, 7);
}

static void refuses_what_is_none(void **state)
{
    static const char *const bad[] = {"0 31\n",     "0 31 0 0\n", "0 x 1\n",  "-1 3 0\n", "3 3 0\n",
                                      "0 4096 0\n", "0 3 8\n",    "0 3 -1\n", "0 3.5 1\n"};
    cairn_part_bundle_cut cuts[CAIRN_PART_MAX_FRAGMENTS];
    char text[1024] = "";
    int32_t count;

    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_status(
            cairn_part_cut_file_read(cuts, &count, files_write_text("b.cuts", bad[i]), &error),
            CAIRN_BAD_FORMAT);
        assert_non_null(strstr(error.text, "b.cuts:1: not a fragment, expected two samples"));
    }
    /* The fragment read before is not offered. */
    assert_status(cairn_part_cut_file_read(cuts, &count,
                                           files_write_text("b.cuts", "0 9 0\n9 x 0\n"), &error),
                  CAIRN_BAD_FORMAT);
    assert_int_equal(count, 0);
    assert_status(
        cairn_part_cut_file_read(cuts, &count, files_write_text("b.cuts", "# no\n"), &error),
        CAIRN_EMPTY);
    assert_non_null(strstr(error.text, "b.cuts: no fragment, expected two samples"));
    for (int i = 0; i <= CAIRN_PART_MAX_FRAGMENTS; i++)
        strcat(text, "0 9 0\n");
    assert_status(cairn_part_cut_file_read(cuts, &count, files_write_text("b.cuts", text), &error),
                  CAIRN_FULL);
    assert_non_null(strstr(error.text, "b.cuts:97: too many fragments, expected at most 96"));
    assert_status(cairn_part_cut_file_read(cuts, &count, files_path("missing.cuts"), &error),
                  CAIRN_IO);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(reads_cuts),
        cmocka_unit_test(refuses_what_is_none),
    };

    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
