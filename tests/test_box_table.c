/* Tables of boxes: columns in any order, quoted names, bad tables. */
#include "cairn/box_table.h"
#include "tests/files.h"

static cairn_file_error error;

static void reads_boxes(void **state)
{
    const char *path = files_write_text("boxes.csv", "class,image,left,top,right,bottom,score\r\n"
                                                     "a,\"b, \"\"c\"\".png\",1,2.5,30,40,7\r\n"
                                                     "\n"
                                                     "a,d.png,-3,0,4e1,9,\n");
    cairn_box_table_row *row;
    int32_t count;

    (void)state;
    assert_ok(cairn_box_table_read(path, &row, &count, &error));
    assert_int_equal(count, 2);
    assert_string_equal(row[0].image, "b, \"c\".png");
    assert_near(row[0].box[0], 1, 0);
    assert_near(row[0].box[1], 2.5, 0);
    assert_near(row[0].box[2], 30, 0);
    assert_near(row[0].box[3], 40, 0);
    assert_int_equal(row[0].line, 2);
    assert_string_equal(row[1].image, "d.png");
    assert_near(row[1].box[2], 40, 0);
    assert_int_equal(row[1].line, 4);
    free(row);
    /* More rows than the initial capacity. */
    {
        char text[4096] = "image,left,top,right,bottom\n";

        for (int i = 0; i < 100; i++)
            strcat(text, "x.png,0,0,1,1\n");
        assert_ok(cairn_box_table_read(files_write_text("many.csv", text), &row, &count, &error));
        assert_int_equal(count, 100);
        free(row);
    }
}

/* Rows of an image are found together, in the order of the file. */
static void finds_rows_of_an_image(void **state)
{
    static const char *const names[] = {"", "a.png", "b", "b.png", "z.png"};
    static const int32_t firsts[] = {0, 0, 2, 2, 5}, counts[] = {0, 2, 0, 3, 0};
    cairn_box_table_row *row;
    int32_t count, own;

    (void)state;
    assert_ok(cairn_box_table_read(files_write_text("mixed.csv",
                                                    "image,left,top,right,bottom\nb.png,9,0,10,1\n"
                                                    "a.png,8,0,9,1\nb.png,7,0,8,1\na.png,6,0,7,1\n"
                                                    "b.png,8,0,9,1\n"),
                                   &row, &count, &error));
    cairn_box_table_sort(row, count);
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        assert_int_equal(cairn_box_table_find(row, count, names[i], &own), firsts[i]);
        assert_int_equal(own, counts[i]);
    }
    assert_near(row[0].box[0], 8, 0);
    assert_near(row[1].box[0], 6, 0);
    assert_near(row[2].box[0], 9, 0);
    assert_near(row[3].box[0], 7, 0);
    assert_near(row[4].box[0], 8, 0);
    cairn_box_table_sort(NULL, 0);
    assert_int_equal(cairn_box_table_find(NULL, 0, "a", &own), 0);
    assert_int_equal(own, 0);
    free(row);
}

static void refuses_what_is_no_table(void **state)
{
    static const struct {
        const char *text, *what;
        cairn_status status;
    } cases[] = {
        {"", ": the file is empty, expected image,left", CAIRN_EMPTY},
        {"image,left,top,right\n", ":1: no column 'bottom', expected", CAIRN_BAD_FORMAT},
        {"image,left,top,right,bottom\na,1,2,3\n", ":2: fewer fields than", CAIRN_BAD_FORMAT},
        {"image,left,top,right,bottom\n,1,2,3,4\n", ":2: no image, expected", CAIRN_BAD_FORMAT},
        {"image,left,top,right,bottom\na,1,2,x,4\n", ":2: a side of a box is not a number",
         CAIRN_BAD_FORMAT},
        {"image,left,top,right,bottom\na,1,2,nan,4\n", ":2: a side of a box is not a number",
         CAIRN_BAD_FORMAT},
        {"image,left,top,right,bottom\na,1,2,3e9,4\n", ":2: a side of a box is not a number",
         CAIRN_BAD_FORMAT},
        {"image,left,top,right,bottom\na,3,2,3,4\n", ":2: a box without area, expected",
         CAIRN_BAD_FORMAT},
        {"image,left,top,right,bottom\n\"a,3,2,3,4\n", ":2: a quote without an end",
         CAIRN_BAD_FORMAT},
        {",,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,,\n",
         ":1: more than 64 fields", CAIRN_BAD_FORMAT},
    };
    char text[400] = "image,left,top,right,bottom\n";
    cairn_box_table_row *row;
    int32_t count;

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        assert_status(
            cairn_box_table_read(files_write_text("bad.csv", cases[i].text), &row, &count, &error),
            cases[i].status);
        assert_null(row);
        assert_int_equal(count, 0);
        if (strstr(error.text, cases[i].what) == NULL)
            fail_msg("\"%s\" does not hold \"%s\"", error.text, cases[i].what);
    }
    memset(text + strlen(text), 'n', 255);
    strcat(text, ",1,2,3,4\n");
    assert_ok(cairn_box_table_read(files_write_text("long.csv", text), &row, &count, &error));
    assert_int_equal(count, 1);
    assert_int_equal(strlen(row[0].image), 255);
    free(row);
    strcpy(text, "image,left,top,right,bottom\n");
    memset(text + strlen(text), 'n', 256);
    assert_status(cairn_box_table_read(files_write_text("bad.csv", text), &row, &count, &error),
                  CAIRN_BAD_FORMAT);
    assert_non_null(strstr(error.text, ":2: a field of more than 255 bytes"));
    assert_status(cairn_box_table_read(files_path("missing.csv"), &row, &count, &error), CAIRN_IO);
    assert_null(row);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(reads_boxes),
        cmocka_unit_test(finds_rows_of_an_image),
        cmocka_unit_test(refuses_what_is_no_table),
    };

    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
