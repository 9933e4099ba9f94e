/* Skeletons as JSON and as SVG: every key, seen and extrapolated contours, joints, and an empty
 * result. */
#include "tests/test.h"

#include "cairn/skeleton_file.h"
#include "tests/files.h"
#include "tests/json.h"
#include "tests/xml.h"

static cairn_file_error error;

/* A stem of three discs, and a branch of two that joins its middle. */
static const cairn_skeleton_grouping_point points[] = {
    {{10, 20}, 4, {{10, 16}, {10, 24}}, {3, 7}},  {{20, 20}, 5, {{20, 15}, {20, 25}}, {4, -1}},
    {{30, 20}, 6, {{30, 14}, {30, 26}}, {5, 8}},  {{20, 40}, 2, {{18, 40}, {22, 40}}, {-1, -1}},
    {{20, 30}, 3, {{17, 30}, {23, 30}}, {9, 10}},
};
static const cairn_skeleton_grouping_part parts[] = {{0, 3, 0, {-1, -1}, CAIRN_REAL(12.5)},
                                                     {3, 2, 0, {-1, 1}, CAIRN_REAL(3.25)}};
static const cairn_skeleton_grouping_object objects[] = {{2, 3, CAIRN_REAL(15.75)}};
static uint8_t grey[60 * 50];
/* A square of two pixels a side, and an angle. */
static const cairn_boundary_corner corners[] = {{3, 4}, {4, 4}, {5, 4}, {5, 5}, {5, 6}, {4, 6},
                                                {3, 6}, {3, 5}, {7, 1}, {8, 1}, {9, 1}, {9, 2}};
static const cairn_boundary_contour contours[] = {{0, 8, 1, CAIRN_REAL(2.5), 4, 5},
                                                  {8, 4, 0, 1, CAIRN_REAL(2.25), CAIRN_REAL(1.5)}};

static cairn_skeleton_file_picture picture(int there)
{
    cairn_skeleton_file_picture p;

    memset(&p, 0, sizeof p);
    p.image = "a \"<image>\".png";
    p.width = 60;
    p.height = 50;
    p.shrink = 1;
    p.edgel_count = 11;
    p.result.min_radius = 2;
    p.result.max_radius = CAIRN_REAL(6.5);
    if (!there)
        return p;
    p.grey = grey;
    p.proposed = 1;
    p.result.points = points;
    p.result.parts = parts;
    p.result.objects = objects;
    p.result.point_count = 5;
    p.result.part_count = 2;
    p.result.object_count = 1;
    p.result.centre_count = 21;
    p.result.line_count = 4;
    p.result.seed_count = 6;
    p.boundary.contours = contours;
    p.boundary.corners = corners;
    p.boundary.contour_count = 2;
    p.boundary.corner_count = 12;
    return p;
}

static void test_json(void **state)
{
    static const char expected[] =
        "{\"image\": \"a \\u0022\\u003cimage\\u003e\\u0022.png\", \"width\": 60, \"height\": 50, "
        "\"shrink\": 1, "
        "\"min_radius\": 2.00, "
        "\"max_radius\": 6.50, \"proposed\": true,\n"
        " \"edgels\": 11, \"centres\": 21, \"lines\": 4, \"starts\": 6, \"left_out\": 0, "
        "\"verdict\": \"found\",\n"
        " \"objects\": [\n  {\"log_odds\": 15.75, \"parts\": 2, \"free_ends\": 3}],\n \"parts\": "
        "[\n"
        "  {\"log_odds\": 12.50, \"object\": 0, \"joints\": [-1, -1], \"first\": 0,\n"
        "   \"axis\": [[10.00, 20.00, 4.00], [20.00, 20.00, 5.00], [30.00, 20.00, 6.00]],\n"
        "   \"left\": [[10.00, 16.00, true], [20.00, 15.00, true], [30.00, 14.00, true]],\n"
        "   \"right\": [[10.00, 24.00, true], [20.00, 25.00, false], [30.00, 26.00, true]]},\n"
        "  {\"log_odds\": 3.25, \"object\": 0, \"joints\": [-1, 1], \"first\": 3,\n"
        "   \"axis\": [[20.00, 40.00, 2.00], [20.00, 30.00, 3.00]],\n"
        "   \"left\": [[18.00, 40.00, false], [17.00, 30.00, true]],\n"
        "   \"right\": [[22.00, 40.00, false], [23.00, 30.00, true]]}],\n"
        " \"contours\": [\n"
        "  {\"strength\": 5.00, \"level\": 2.50, \"closed\": true, \"points\": [[2.5, 3.5], [4.5, "
        "3.5], [4.5, 5.5], "
        "[2.5, 5.5]]},\n"
        "  {\"strength\": 1.50, \"level\": 1.00, \"closed\": false, \"points\": [[6.5, 0.5], [8.5, "
        "0.5], [8.5, "
        "1.5]]}]}\n";
    cairn_skeleton_file_picture p = picture(1);
    char *text;

    (void)state;
    assert_ok(cairn_skeleton_file_write(&p, files_path("a.json"), &error));
    text = files_read(files_path("a.json"), NULL);
    assert_string_equal(text, expected);
    assert_json(text);
    free(text);
}

static void test_picture(void **state)
{
    cairn_skeleton_file_picture p = picture(1);
    char *text;

    (void)state;
    assert_ok(cairn_skeleton_file_draw(&p, files_path("a.svg"), &error));
    text = files_read(files_path("a.svg"), NULL);
    assert_well_formed(text);
    assert_int_equal(count_of(text, "<image x"), 1);
    /* What exceeds the image is cut off. */
    assert_int_equal(count_of(text, ".over path,.over circle,.over .box{clip-path:url(#frame)}"),
                     1);
    assert_int_equal(count_of(text, "<g class=\"over\""), 1);
    assert_int_equal(
        count_of(text,
                 "<clipPath id=\"frame\"><rect x=\"-0.5\" y=\"-0.5\" width=\"60\" height=\"50\"/>"),
        1);
    assert_int_equal(count_of(text, "class=\"axis\" d=\"M10.0 20.0L20.0 20.0L30.0 20.0\""), 1);
    assert_int_equal(
        count_of(text, "class=\"axis\" d=\"M20.0 40.0L20.0 30.0M20.0 30.0L20.0 20.0\""), 1);
    assert_int_equal(
        count_of(text, "class=\"contour\" d=\"M10.0 16.0L20.0 15.0M20.0 15.0L30.0 14.0\""), 1);
    assert_int_equal(
        count_of(text, "class=\"carried\" d=\"M10.0 24.0L20.0 25.0M20.0 25.0L30.0 26.0\""), 1);
    assert_int_equal(count_of(text, "class=\"carried\" d=\"M18.0 40.0L17.0 30.0\""), 1);
    assert_int_equal(
        count_of(
            text,
            "class=\"boundary\" d=\"M2.5 3.5L4.5 3.5L4.5 5.5L2.5 5.5ZM6.5 0.5L8.5 0.5L8.5 1.5\""),
        1);
    assert_int_equal(count_of(text, "2 parts of 1 objects, radii 2.0 to 6.5 px, 11 edgels"), 1);
    /* Places and styles of the rest change only on purpose. */
    assert_golden(picture_hash(text), UINT64_C(0x388fe0bd9824d2b3), UINT64_C(0x388fe0bd9824d2b3));
    free(text);
}

static void test_nothing_found(void **state)
{
    cairn_skeleton_file_picture p = picture(0);
    char *text;

    (void)state;
    assert_ok(cairn_skeleton_file_write(&p, files_path("b.json"), &error));
    text = files_read(files_path("b.json"), NULL);
    assert_json(text);
    assert_int_equal(count_of(text, "\"verdict\": \"none\""), 1);
    assert_int_equal(count_of(text, "\"proposed\": false"), 1);
    assert_int_equal(count_of(text, "\"objects\": []"), 1);
    assert_int_equal(count_of(text, "\"parts\": []"), 1);
    assert_int_equal(count_of(text, "\"contours\": []"), 1);
    free(text);
    assert_ok(cairn_skeleton_file_draw(&p, files_path("b.svg"), &error));
    text = files_read(files_path("b.svg"), NULL);
    assert_well_formed(text);
    assert_int_equal(count_of(text, "<image x"), 0);
    assert_int_equal(count_of(text, "class=\"axis\""), 0);
    free(text);
}

static void test_folders_are_named(void **state)
{
    cairn_skeleton_file_picture p = picture(1);

    (void)state;
    assert_status(cairn_skeleton_file_write(&p, files_path("none/a.json"), &error), CAIRN_IO);
    assert_non_null(strstr(error.text, "none/a.json"));
    assert_status(cairn_skeleton_file_draw(&p, files_path("none/a.svg"), &error), CAIRN_IO);
    assert_non_null(strstr(error.text, "none/a.svg"));
    assert_status(cairn_skeleton_file_draw_lines(&p, NULL, files_path("none/b.svg"), &error),
                  CAIRN_IO);
    assert_non_null(strstr(error.text, "none/b.svg"));
}

/* Two facing lines of edgels: their CPs, all of the same radius, and the line through them; without
 * a skeleton only the image. */
static void test_lines(void **state)
{
    cairn_skeleton_grouping_params params = cairn_skeleton_grouping_as_written();
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_edgel edgels[80];
    cairn_skeleton_grouping_input in = {edgels, 80, 60, 50, 4, 6};
    cairn_skeleton_file_picture p = picture(1);
    cairn_skeleton_grouping *skeleton;
    cairn_pool pool;
    char *text;

    (void)state;
    for (int32_t i = 0; i < 40; i++) {
        edgels[2 * i] = (cairn_edgel){{10 + (cairn_real)i, 30}, {0, -1}, 1};
        edgels[2 * i + 1] = (cairn_edgel){{10 + (cairn_real)i, 20}, {0, 1}, 1};
    }
    params.max_width = 60;
    params.max_height = 50;
    params.max_edgels = 80;
    pool = test_pool(cairn_skeleton_grouping_memory(&params));
    assert_ok(cairn_skeleton_grouping_create(&skeleton, &pool, &params));
    assert_ok(cairn_skeleton_grouping_begin(skeleton, &in));
    assert_ok(cairn_skeleton_grouping_step(skeleton, &budget));
    p.result = cairn_skeleton_grouping_read(skeleton);
    assert_ok(cairn_skeleton_file_draw_lines(&p, skeleton, files_path("lines.svg"), &error));
    text = files_read(files_path("lines.svg"), NULL);
    assert_non_null(text);
    assert_well_formed(text);
    assert_int_equal(count_of(text, "h0\"/>"), p.result.centre_count);
    assert_int_equal(count_of(text, "<path class=\"line\""), p.result.seed_count);
    assert_non_null(strstr(text, "M30.0 25.0h0"));
    free(text);
    test_pool_free(&pool);
    p = picture(1);
    assert_ok(cairn_skeleton_file_draw_lines(&p, NULL, files_path("lines.svg"), &error));
    text = files_read(files_path("lines.svg"), NULL);
    assert_well_formed(text);
    assert_int_equal(count_of(text, "h0\"/>"), 0);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_json),          cmocka_unit_test(test_picture),
        cmocka_unit_test(test_nothing_found), cmocka_unit_test(test_folders_are_named),
        cmocka_unit_test(test_lines),
    };

    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
