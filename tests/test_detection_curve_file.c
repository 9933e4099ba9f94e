/* Detection curves as files. */
#include "tests/test.h"

#include "cairn/detection_curve_file.h"
#include "tests/files.h"
#include "tests/xml.h"

static void writes_table_and_plot(void **state)
{
    cairn_detection_curve_event e[] = {{2, 1}, {1, 0}};
    cairn_detection_curve_point p[2];
    cairn_file_error error;
    char *text;

    (void)state;
    assert_ok(cairn_detection_curve(e, 2, 2, 4, p, NULL));
    assert_ok(cairn_detection_curve_file_write(files_path("curve"), "a < b", p, 2, &error));
    text = files_read(files_path("curve.csv"), NULL);
    assert_non_null(text);
    /* Wilson's intervals of 1 in 4 instances, and of 1 in 1 and 1 in 2 detections. */
    assert_string_equal(
        strchr(text, '\n'),
        "\n2.000000,0.250000,0.045586,0.699364,1.000000,0.206543,1.000000,0.000000\n"
        "1.000000,0.250000,0.045586,0.699364,0.500000,0.094529,0.905471,0.500000\n");
    free(text);
    text = files_read(files_path("curve.svg"), NULL);
    assert_non_null(text);
    assert_well_formed(text);
    /* Places and styles of the rest change only on purpose. */
    assert_golden(picture_hash(text), UINT64_C(0x3be5b59b1814e151), UINT64_C(0x3be5b59b1814e151));
    free(text);
    /* Nothing was detected. */
    assert_ok(cairn_detection_curve_file_write(files_path("empty"), "none", p, 0, &error));
    assert_status(cairn_detection_curve_file_write(files_path("nowhere/curve"), "a", p, 2, &error),
                  CAIRN_IO);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(writes_table_and_plot),
    };

    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
