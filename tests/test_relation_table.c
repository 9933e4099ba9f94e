/* Relations: both kinds of lines, scans by their stamps compared with a reference implementation,
 * bad files. */
#include "tests/files.h"

#include <inttypes.h>
#include <stdlib.h>

#include "cairn/pose_table.h"
#include "cairn/relation_table.h"

static void both_kinds_are_read(void **state)
{
    static const char text[] = "# by time\n"
                               "10.25 12.5 1 -2 9 8 7 0.5\n"
                               "\n"
                               "  \t\n"
                               "\t3 4 0.5 0.25 -0.125\r\n"
                               "  # 1 2 3\n"
                               "0.0000015 -1 0 0 0 0 0 3\n";
    const char *path = files_path("good.relations");
    cairn_relation_table_row *row;
    int32_t count;

    (void)state;
    files_write("good.relations", text, sizeof text - 1);
    assert_ok(cairn_relation_table_read(&row, &count, path, NULL));
    assert_int_equal(count, 3);
    assert_int_equal(row[0].line, 2);
    assert_int_equal(row[0].timed, 1);
    assert_int_equal(row[0].first, INT64_C(10250000000));
    assert_int_equal(row[0].second, INT64_C(12500000000));
    assert_near(row[0].reference.x, 1, 0);
    assert_near(row[0].reference.y, -2, 0);
    assert_near(row[0].reference.theta, 0.5, 0);
    assert_int_equal(row[1].line, 5);
    assert_int_equal(row[1].timed, 0);
    assert_int_equal(row[1].first, 3);
    assert_int_equal(row[1].second, 4);
    assert_near(row[1].reference.x, 0.5, 0);
    assert_near(row[1].reference.y, 0.25, 0);
    assert_near(row[1].reference.theta, -0.125, 0);
    assert_int_equal(row[2].first, 1500);
    assert_int_equal(row[2].second, INT64_C(-1000000000));
    cairn_relation_table_free(row);
}

static void many_are_read(void **state)
{
    enum { ITEM_COUNT = 1000 };
    FILE *file = fopen(files_path("many.relations"), "w");
    cairn_relation_table_row *row;
    int32_t count;

    (void)state;
    assert_non_null(file);
    for (int i = 0; i < ITEM_COUNT; i++)
        (void)fprintf(file, "%d %d 1 2 %d\n", i, i + 1, i);
    assert_int_equal(fclose(file), 0);
    assert_ok(cairn_relation_table_read(&row, &count, files_path("many.relations"), NULL));
    assert_int_equal(count, ITEM_COUNT);
    for (int i = 0; i < ITEM_COUNT; i++) {
        assert_int_equal(row[i].first, i);
        assert_int_equal(row[i].second, i + 1);
        assert_near(row[i].reference.theta, i, 0);
    }
    cairn_relation_table_free(row);
}

/* Half the median time from a scan to the next of another stamp: the duration that is not shorter
 * than half of them. */
static int64_t reference_tolerance(const int64_t *stamp, int32_t scans)
{
    int64_t median = INT64_MAX;
    int32_t changes = 0;

    for (int32_t i = 1; i < scans; i++)
        changes += stamp[i] != stamp[i - 1];
    for (int32_t i = 1; i < scans; i++) {
        int64_t duration = llabs(stamp[i] - stamp[i - 1]);
        int32_t shorter = 0, as_long = 0;

        for (int32_t k = 1; k < scans; k++) {
            int64_t other = llabs(stamp[k] - stamp[k - 1]);

            shorter += other != 0 && other < duration;
            as_long += other == duration;
        }
        if (duration != 0 && shorter <= changes / 2 && shorter + as_long > changes / 2)
            median = duration;
    }
    return median / 2;
}

/* The nearest stamp within the tolerance, the earlier among equals; -1: none. */
static int64_t reference_find(const int64_t *stamp, int32_t scans, int64_t tolerance,
                              int64_t wanted)
{
    int64_t found = -1, best = tolerance + 1;

    for (int32_t i = 0; i < scans; i++) {
        int64_t away = llabs(stamp[i] - wanted);

        if (away < best || (away == best && away <= tolerance && stamp[i] < stamp[found])) {
            best = away;
            found = i;
        }
    }
    return found;
}

static void scans_are_found(void **state)
{
    enum { SCANS = 50, ROWS = 400 };
    cairn_random random = cairn_random_seed(1, 0);
    cairn_relation_table_row row[ROWS], wanted[ROWS];
    int64_t stamp[SCANS], tolerance;
    int32_t found = 0;

    (void)state;
    for (int i = 0; i < SCANS; i++)
        stamp[i] = 400 * (int64_t)cairn_random_below(&random, 100) - 20000;
    tolerance = reference_tolerance(stamp, SCANS);
    for (int k = 0; k < ROWS; k++) {
        memset(&row[k], 0, sizeof row[k]);
        row[k].timed = k % 4 != 0;
        row[k].first = row[k].timed ? 100 * (int64_t)cairn_random_below(&random, 880) - 44000
                                    : cairn_random_below(&random, SCANS + 2);
        row[k].second = row[k].timed ? stamp[k % SCANS] + (k % 3 - 1) * tolerance
                                     : cairn_random_below(&random, SCANS + 2);
        wanted[k] = row[k];
        if (row[k].timed) {
            wanted[k].first = reference_find(stamp, SCANS, tolerance, row[k].first);
            wanted[k].second = reference_find(stamp, SCANS, tolerance, row[k].second);
        }
        if (wanted[k].first >= SCANS || wanted[k].second >= SCANS || wanted[k].first < 0)
            wanted[k].first = wanted[k].second = -1;
        found += wanted[k].first >= 0;
    }
    assert_int_equal(cairn_relation_table_find(row, ROWS, stamp, SCANS), found);
    assert_true(found > ROWS / 3 && found < ROWS);
    for (int k = 0; k < ROWS; k++) {
        assert_int_equal(row[k].first, wanted[k].first);
        assert_int_equal(row[k].second, wanted[k].second);
    }
    row[0].timed = row[1].timed = 1;
    row[0].first = row[0].second = INT64_MIN;
    row[1].first = row[1].second = INT64_MAX;
    assert_int_equal(cairn_relation_table_find(row, 2, stamp, SCANS), 0);
    row[0].timed = 1;
    row[0].first = row[0].second = 0;
    assert_int_equal(cairn_relation_table_find(row, 1, NULL, 0), 0);
    assert_int_equal(row[0].first, -1);
}

/* Stamps of microseconds, rounded to five decimals in the log, some scans not in the log; and a
 * table of every fifth scan. */
static void rounded_stamps_are_found_and_missing_scans_are_not_replaced(void **state)
{
    enum { SCANS = 300, PERIOD_NS = 75000000, JITTER_NS = 20000000 };
    cairn_random random = cairn_random_seed(2, 0);
    cairn_relation_table_row row[SCANS];
    int64_t exact[SCANS], stamp[SCANS];

    (void)state;
    for (int every = 1; every <= 5; every += 4) {
        int32_t known = 0;

        for (int i = 0; i < SCANS; i++) {
            exact[i] = i * (int64_t)PERIOD_NS +
                       1000 * (int64_t)cairn_random_below(&random, JITTER_NS / 1000);
            stamp[i] = i % 17 == 3 || i % every != 0 ? CAIRN_POSE_TABLE_NO_STAMP
                                                     : (exact[i] + 5000) / 10000 * 10000;
            known += stamp[i] != CAIRN_POSE_TABLE_NO_STAMP;
            memset(&row[i], 0, sizeof row[i]);
            row[i].timed = 1;
            row[i].first = row[i].second = exact[i];
        }
        assert_int_equal(cairn_relation_table_find(row, SCANS, stamp, SCANS), known);
        for (int i = 0; i < SCANS; i++)
            assert_int_equal(row[i].first, stamp[i] == CAIRN_POSE_TABLE_NO_STAMP ? -1 : i);
    }
}

static void bad_files(void **state)
{
    static const struct {
        const char *text;
        cairn_status status;
        int64_t line;
        const char *wanted;
    } bad[] = {
        {"1 2 3 4\n", CAIRN_BAD_FORMAT, 1,
         "4 words, expected t1 t2 x y z roll pitch yaw, or a b x y theta"},
        {"# a\n1 2 3 4 5 6\n", CAIRN_BAD_FORMAT, 2, "6 words"},
        {"1 2 3 4 5 6 7 8 9\n", CAIRN_BAD_FORMAT, 1, "9 words"},
        {"1 2 3 4 5\n1.5 2 3 4 5\n", CAIRN_BAD_FORMAT, 2, "\"1.5\", expected the index of a scan"},
        {"1 -2 3 4 5\n", CAIRN_BAD_FORMAT, 1, "\"-2\", expected the index of a scan"},
        {"1 x 3 4 5 6 7 8\n", CAIRN_BAD_FORMAT, 1, "\"x\", expected a time in seconds"},
        {"1 2 3 y 5 6 7 8\n", CAIRN_BAD_FORMAT, 1, "\"y\", expected a number"},
        {"1 2 3 4 5 6 z 8\n", CAIRN_BAD_FORMAT, 1, "\"z\", expected a number"},
        {"1 2 nan 4 5\n", CAIRN_NOT_FINITE, 1, "\"nan\", expected a finite number"},
        {"1 2 3 4 5\n\n1 2 3 4 inf\n", CAIRN_NOT_FINITE, 3, "\"inf\", expected a finite number"},
        {"", CAIRN_EMPTY, 0, "no relation, expected lines"},
        {"# none\n", CAIRN_EMPTY, 0, "no relation"},
    };
    cairn_relation_table_row *row;
    cairn_file_error error;
    int32_t count;

    (void)state;
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        const char *path = files_write("bad.relations", bad[k].text, strlen(bad[k].text));

        count = 7;
        assert_status(cairn_relation_table_read(&row, &count, path, &error), bad[k].status);
        assert_int_equal(error.line, bad[k].line);
        if (strstr(error.text, bad[k].wanted) == NULL)
            fail_msg("\"%s\" does not hold \"%s\"", error.text, bad[k].wanted);
        assert_null(row);
        assert_int_equal(count, 0);
    }
    assert_status(cairn_relation_table_read(&row, &count, files_path("missing"), &error), CAIRN_IO);
    cairn_relation_table_free(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(both_kinds_are_read),
        cmocka_unit_test(many_are_read),
        cmocka_unit_test(scans_are_found),
        cmocka_unit_test(rounded_stamps_are_found_and_missing_scans_are_not_replaced),
        cmocka_unit_test(bad_files),
    };

    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
