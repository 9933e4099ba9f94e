/* Tables of poses: round trips and bad tables. */
#include "tests/files.h"

#include <math.h>

#include "cairn/pose_table.h"

#define HEADER                                                                                     \
    "index,line,time,x,y,theta,var_x,var_y,var_theta,cov_xy,cov_xtheta,cov_ytheta,support,"        \
    "verdict,map_sigma\n"

static int same(cairn_real a, cairn_real b)
{
    return memcmp(&a, &b, sizeof a) == 0 || (isnan(a) && isnan(b));
}

static void test_text(void **state)
{
    cairn_pose pose = {CAIRN_REAL(1.5), CAIRN_REAL(-0.25), CAIRN_REAL(0.1)};
    cairn_pose_table_row row[2];
    const char *path = files_path("poses.csv");
    char *bytes;

    (void)state;
    row[0] = cairn_pose_table_row_of(0, pose);
    row[0].line = 1;
    row[1] = cairn_pose_table_row_of(7, pose);
    row[1].line = 12;
    row[1].stamp_ns = INT64_C(976052857337530000);
    for (int i = 0; i < 9; i++)
        row[1].covariance[i] = (cairn_real)(i + 1);
    row[1].support = 42;
    row[1].map_sigma = CAIRN_REAL(0.75);
    strcpy(row[1].verdict, "placed");
    assert_ok(cairn_pose_table_write(path, row, 2, NULL));
    bytes = files_read(path, NULL);
    assert_string_equal(bytes,
                        HEADER "0,1,,1.5,-0.25,0.1,,,,,,,,,\n"
                               "7,12,976052857.33753,1.5,-0.25,0.1,1,5,9,2,3,6,42,placed,0.75\n");
    free(bytes);
}

static void test_round_trip(void **state)
{
    enum { COUNT = 1000 };
    cairn_random random = cairn_random_seed(1, 1);
    cairn_pose_table_row *row = calloc(COUNT, sizeof *row), *back;
    const char *path = files_path("round.csv");
    cairn_file_error error;
    int32_t count;

    (void)state;
    for (int i = 0; i < COUNT; i++) {
        cairn_pose pose;

        pose.x = cairn_random_uniform(&random, -100, 100);
        pose.y = cairn_random_uniform(&random, CAIRN_REAL(-1e-6), CAIRN_REAL(1e-6));
        pose.theta = cairn_random_uniform(&random, -3, 3);
        row[i] = cairn_pose_table_row_of(i - 3, pose);
        row[i].line = i % 3 == 0 ? 0 : 1000 + i;
        row[i].stamp_ns = i % 5 == 0 ? CAIRN_POSE_TABLE_NO_STAMP
                                     : INT64_C(1234567890123456789) * (i % 2 == 0 ? -1 : 1) + i;
        if (i % 2 == 0)
            for (int k = 0; k < 9; k++)
                row[i].covariance[k] = cairn_random_unit(&random);
        row[i].covariance[3] = row[i].covariance[1];
        row[i].covariance[6] = row[i].covariance[2];
        row[i].covariance[7] = row[i].covariance[5];
        if (i % 7 == 0)
            row[i].support = cairn_random_unit(&random);
        if (i % 9 == 0)
            row[i].map_sigma = cairn_random_unit(&random);
        if (i % 4 == 0)
            (void)snprintf(row[i].verdict, sizeof row[i].verdict, "word %d", i);
    }
    memset(row[8].verdict, 'v', 31);
    assert_ok(cairn_pose_table_write(path, row, COUNT, &error));
    assert_ok(cairn_pose_table_read(&back, &count, path, &error));
    assert_int_equal(count, COUNT);
    for (int i = 0; i < COUNT; i++) {
        assert_true(back[i].index == row[i].index && back[i].line == row[i].line &&
                    back[i].stamp_ns == row[i].stamp_ns);
        assert_true(same(back[i].pose.x, row[i].pose.x) && same(back[i].pose.y, row[i].pose.y) &&
                    same(back[i].pose.theta, row[i].pose.theta));
        for (int k = 0; k < 9; k++)
            assert_true(same(back[i].covariance[k], row[i].covariance[k]));
        assert_true(same(back[i].support, row[i].support));
        assert_true(same(back[i].map_sigma, row[i].map_sigma));
        assert_string_equal(back[i].verdict, row[i].verdict);
    }
    cairn_pose_table_free(back);
    cairn_pose_table_free(NULL);
    free(row);
}

/* Columns in another order, some missing, some foreign, blanks, comments, CRLF. */
static void test_reads_by_name(void **state)
{
    const char *path = files_write_text(
        "named.csv",
        "# poses\r\n\r\ntheta, y ,x,colour,index\r\n 0.5,2,1,red, 9 \r\n#\r\n-1,0,0,,10");
    cairn_pose_table_row *row;
    int32_t count;

    (void)state;
    assert_ok(cairn_pose_table_read(&row, &count, path, NULL));
    assert_int_equal(count, 2);
    assert_int_equal(row[0].index, 9);
    assert_near(row[0].pose.x, 1, 0);
    assert_near(row[0].pose.y, 2, 0);
    assert_near(row[0].pose.theta, 0.5, 0);
    assert_int_equal(row[0].line, 0);
    assert_true(row[0].stamp_ns == CAIRN_POSE_TABLE_NO_STAMP);
    assert_true(isnan(row[0].covariance[4]) && isnan(row[0].support));
    assert_string_equal(row[0].verdict, "");
    assert_int_equal(row[1].index, 10);
    assert_near(row[1].pose.theta, -1, 0);
    cairn_pose_table_free(row);
}

static void test_bad_tables(void **state)
{
    static const struct {
        const char *text;
        cairn_status status;
        int line;
        const char *piece;
    } sample[] = {
        {"", CAIRN_EMPTY, 0, "no row"},
        {"# only a comment\n", CAIRN_EMPTY, 0, "no row"},
        {HEADER, CAIRN_EMPTY, 0, "no row"},
        {"index,x,y\n0,0,0\n", CAIRN_BAD_FORMAT, 1, "no column \"theta\""},
        {"x,y,theta\n0,0,0\n", CAIRN_BAD_FORMAT, 1, "no column \"index\""},
        {"index,y,theta\n0,0,0\n", CAIRN_BAD_FORMAT, 1, "no column \"x\""},
        {"index,x,theta\n0,0,0\n", CAIRN_BAD_FORMAT, 1, "no column \"y\""},
        {"index,x,y,x,theta\n", CAIRN_BAD_FORMAT, 1, "column \"x\" is there twice"},
        {"#\nindex,x,y,theta\n0,1,2\n", CAIRN_TRUNCATED, 3, "3 fields, expected 4"},
        {"index,x,y,theta\n0,1,2,3\n1,1,2,3,4\n", CAIRN_BAD_FORMAT, 3, "5 fields, expected 4"},
        {"index,x,y,theta\n,1,2,3\n", CAIRN_BAD_FORMAT, 2, "index is \"\", expected a number"},
        {"index,x,y,theta\n1,,2,3\n", CAIRN_BAD_FORMAT, 2, "x is \"\""},
        {"index,x,y,theta\n1,1,,3\n", CAIRN_BAD_FORMAT, 2, "y is \"\""},
        {"index,x,y,theta\n1,1,1,\n", CAIRN_BAD_FORMAT, 2, "theta is \"\""},
        {"index,x,y,theta\n1.5,1,2,3\n", CAIRN_BAD_FORMAT, 2,
         "index is \"1.5\", expected a whole number"},
        {"index,x,y,theta\n1,one,2,3\n", CAIRN_BAD_FORMAT, 2, "x is \"one\", expected a number"},
        {"index,x,y,theta\n1,1,nan,3\n", CAIRN_NOT_FINITE, 2, "y is nan"},
        {"index,x,y,theta,support\n1,1,1,3,inf\n", CAIRN_NOT_FINITE, 2, "support is inf"},
        {"index,x,y,theta,var_y\n1,1,1,3,x\n", CAIRN_BAD_FORMAT, 2, "var_y is \"x\""},
        {"index,x,y,theta,time\n1,1,1,3,now\n", CAIRN_BAD_FORMAT, 2,
         "time is \"now\", expected seconds"},
        {"index,x,y,theta,line\n1,1,1,3,-1\n", CAIRN_BAD_FORMAT, 2,
         "line is \"-1\", expected a whole number from 0"},
        {"index,x,y,theta,verdict\n1,1,1,3,0123456789012345678901234567890x\n", CAIRN_BAD_FORMAT, 2,
         "expected at most 31 bytes"},
        {"\x89PNG\r\n", CAIRN_BAD_FORMAT, 1, "no column"},
    };
    cairn_pose_table_row *row;
    cairn_file_error error;
    int32_t count;
    char line[200];

    (void)state;
    for (size_t i = 0; i < sizeof sample / sizeof *sample; i++) {
        if (cairn_pose_table_read(&row, &count, files_write_text("bad.csv", sample[i].text),
                                  &error) != sample[i].status ||
            error.line != sample[i].line || strstr(error.text, sample[i].piece) == NULL)
            fail_msg("table %zu: \"%s\"", i, error.text);
        assert_null(row);
        assert_int_equal(count, 0);
    }
    assert_status(cairn_pose_table_read(&row, &count, files_path("none.csv"), &error), CAIRN_IO);
    /* 64 columns are read, 65 are not. */
    strcpy(line, "index,x,y,theta");
    for (int i = 0; i < 60; i++)
        strcat(line, ",");
    assert_status(cairn_pose_table_read(&row, &count, files_write_text("wide.csv", line), &error),
                  CAIRN_EMPTY);
    strcat(line, ",");
    assert_status(cairn_pose_table_read(&row, &count, files_write_text("wide.csv", line), &error),
                  CAIRN_BAD_FORMAT);
    assert_non_null(strstr(error.text, "more than 64 columns"));
    /* So are fields. */
    for (int more = 0; more < 2; more++) {
        strcpy(line, "index,x,y,theta\n1,2,3,4");
        for (int i = 0; i < 60 + more; i++)
            strcat(line, ",");
        assert_status(
            cairn_pose_table_read(&row, &count, files_write_text("wide.csv", line), &error),
            CAIRN_BAD_FORMAT);
        assert_non_null(strstr(error.text, more ? ":2: more than 64 fields, expected 4"
                                                : ":2: 64 fields, expected 4"));
    }
}

static void test_endless_line(void **state)
{
    size_t size = (size_t)17 << 20;
    char *bytes = malloc(size);
    cairn_pose_table_row *row;
    cairn_file_error error;
    int32_t count;

    (void)state;
    assert_non_null(bytes);
    memset(bytes, 'x', size);
    assert_status(
        cairn_pose_table_read(&row, &count, files_write("endless.csv", bytes, size), &error),
        CAIRN_BAD_FORMAT);
    assert_int_equal(error.line, 1);
    free(bytes);
}

static void test_rows_that_cannot_be_written(void **state)
{
    const char *path = files_path("unwritten.csv");
    cairn_pose_table_row good = cairn_pose_table_row_of(1, cairn_pose_identity()),
                         row[2] = {good, good};
    cairn_file_error error;

    (void)state;
    row[1].pose.y = (cairn_real)NAN;
    assert_status(cairn_pose_table_write(path, row, 2, &error), CAIRN_NOT_FINITE);
    assert_int_equal(error.line, 2);
    row[1] = good;
    row[1].support = -(cairn_real)INFINITY;
    assert_status(cairn_pose_table_write(path, row, 2, &error), CAIRN_NOT_FINITE);
    row[1] = good;
    row[1].map_sigma = (cairn_real)INFINITY;
    assert_status(cairn_pose_table_write(path, row, 2, &error), CAIRN_NOT_FINITE);
    row[1] = good;
    for (int i = 0; i < 9; i++)
        if (i != 3 && i != 6 && i != 7) { /* those that are written */
            row[0].covariance[i] = (cairn_real)INFINITY;
            assert_status(cairn_pose_table_write(path, row, 2, &error), CAIRN_NOT_FINITE);
            assert_int_equal(error.line, 1);
            row[0] = good;
        }
    strcpy(row[1].verdict, "a,b");
    assert_status(cairn_pose_table_write(path, row, 2, &error), CAIRN_BAD_ARGUMENT);
    strcpy(row[1].verdict, "a\"b");
    assert_status(cairn_pose_table_write(path, row, 2, &error), CAIRN_BAD_ARGUMENT);
    strcpy(row[1].verdict, "a\nb");
    assert_status(cairn_pose_table_write(path, row, 2, &error), CAIRN_BAD_ARGUMENT);
    memset(row[1].verdict, 'v', sizeof row[1].verdict);
    assert_status(cairn_pose_table_write(path, row, 2, &error), CAIRN_BAD_ARGUMENT);
    assert_null(files_read(path, NULL));
    assert_status(cairn_pose_table_write(files_path("no/folder.csv"), &good, 1, &error), CAIRN_IO);
    assert_ok(cairn_pose_table_write(path, row, 0, &error));
    row[0].covariance[0] = row[0].support = CAIRN_REAL_MAX;
    assert_ok(cairn_pose_table_write(path, row, 1, &error));
}

/* All memory is freed, whatever the end. */
static void test_heap(void **state)
{
    size_t heap = 0;

    (void)state;
    for (int round = 0; round <= FILES_HEAP_ROUNDS; round++) {
        cairn_pose_table_row *row;
        int32_t count;

        if (round == 1)
            heap = files_heap();
        assert_ok(cairn_pose_table_read(
            &row, &count, files_write_text("heap.csv", "index,x,y,theta\n1,2,3,4\n"), NULL));
        cairn_pose_table_free(row);
        assert_status(
            cairn_pose_table_read(
                &row, &count, files_write_text("heap.csv", "index,x,y,theta\n1,2,3,4\n1\n"), NULL),
            CAIRN_TRUNCATED);
    }
    assert_true(files_heap() < heap + FILES_HEAP_NOISE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_text),          cmocka_unit_test(test_round_trip),
        cmocka_unit_test(test_reads_by_name), cmocka_unit_test(test_bad_tables),
        cmocka_unit_test(test_endless_line),  cmocka_unit_test(test_rows_that_cannot_be_written),
        cmocka_unit_test(test_heap),
    };
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
