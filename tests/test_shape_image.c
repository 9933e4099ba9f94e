/* Outlines from images with memory of the heap: pictures of all sizes, and messages. Of the
 * extraction: test_silhouette.c. */
#include "tests/grey_picture.h"

#include <math.h>

#include "cairn/shape_image.h"

static cairn_file_error error;

static cairn_shape_image trace(void)
{
    cairn_shape_image_params params = cairn_shape_image_default();
    cairn_shape_image image;

    memset(&error, 0, sizeof error);
    if (cairn_shape_image_trace(&image, view(), &params, "name", &error) != CAIRN_OK)
        fail_msg("%s", error.text);
    return image;
}

static void assert_refused(const cairn_shape_image_params *params, cairn_status status,
                           const char *piece)
{
    cairn_shape_image image;

    memset(&error, 0, sizeof error);
    assert_status(cairn_shape_image_trace(&image, view(), params, "name", &error), status);
    assert_status(error.status, status);
    assert_null(image.points);
    assert_int_equal(image.count, 0);
    if (strncmp(error.text, "name: ", 6) != 0 || strstr(error.text, piece) == NULL ||
        strstr(error.text, "expected") == NULL)
        fail_msg("\"%s\" does not say \"%s\"", error.text, piece);
}

/* ---- Outlines ---- */

static void outlines_are_on_the_heap_until_they_are_freed(void **state)
{
    cairn_shape_image image;
    cairn_box box;

    (void)state;
    clear(255);
    fill(20, 10, 79, 49, 0);
    fill(30, 20, 49, 39, 255);
    fill(90, 60, 109, 79, 0);
    image = trace();
    assert_int_equal(image.count, 3);
    assert_int_equal(image.holes, 1);
    assert_int_equal(image.is_drawing + image.bridged_gaps + image.dropped_regions, 0);
    box = box_of(&image.outlines[0]);
    assert_near(box.min.x, 19.5, 1e-4);
    assert_near(box.min.y, 9.5, 1e-4);
    assert_near(box.max.x, 79.5, 1e-4);
    assert_near(box.max.y, 49.5, 1e-4);
    /* Smoothing cuts only the corners. */
    assert_near(area_of(&image.outlines[0]), 60 * 40, 8);
    assert_near(area_of(&image.outlines[1]), 20 * 20, 8);
    assert_near(area_of(&image.outlines[2]), 20 * 20, 8);
    assert_near(box_of(&image.outlines[2]).min.x, 29.5, 1e-4);
    cairn_shape_image_free(&image);
    assert_null(image.points);
    assert_int_equal(image.count, 0);
}

/* Gaps are closed up to a tenth of the diagonal, which is 85 here. */
static void gaps_of_a_drawing_are_bridged_and_reported(void **state)
{
    cairn_shape_image_params params = cairn_shape_image_default();
    cairn_shape_image image;

    (void)state;
    clear(255);
    frame(20, 10, 79, 69, 0);
    fill(40, 10, 44, 10, 255);
    fill(60, 69, 66, 69, 255);
    image = trace();
    assert_int_equal(image.is_drawing, 1);
    assert_int_equal(image.count, 1);
    assert_int_equal(image.bridged_gaps, 2);
    assert_near(image.gaps[0].x, 42, 0.6);
    assert_near(image.gaps[0].y, 10, 0);
    assert_near(image.gaps[1].x, 63, 0.6);
    assert_near(image.gaps[1].y, 69, 0);
    assert_near(area_of(&image.outlines[0]), 60 * 60, 10);
    cairn_shape_image_free(&image);
    params.max_gap = 0.08;
    assert_refused(&params, CAIRN_BAD_FORMAT, "enclose nothing");
}

static void small_parts_and_holes_are_left_out_as_the_parameters_say(void **state)
{
    cairn_shape_image_params params = cairn_shape_image_default();
    cairn_shape_image image;

    (void)state;
    clear(0);
    fill(10, 10, 79, 79, 255);
    fill(30, 41, 49, 60, 0);
    fill(90, 10, 99, 19, 255);
    params.holes = CAIRN_SHAPE_IMAGE_HOLES_FILL;
    params.min_part = 0.1;
    assert_ok(cairn_shape_image_trace(&image, view(), &params, "name", &error));
    assert_int_equal(image.count, 1);
    assert_int_equal(image.holes, 0);
    assert_int_equal(image.dropped_regions, 1);
    cairn_shape_image_free(&image);
}

/* Squares of pixels become one each, so that the picture is at most max_side wide: outlines stay in
 * pixels of the picture. */
static void a_picture_larger_than_max_side_is_reduced(void **state)
{
    static const struct {
        int32_t max_side, square;
    } cases[] = {{WIDTH, 1}, {WIDTH - 1, 2}, {WIDTH / 2, 2}, {WIDTH / 2 - 1, 4}, {31, 4}};

    (void)state;
    clear(255);
    fill(20, 12, 79, 47, 0);
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        cairn_shape_image_params params = cairn_shape_image_default();
        cairn_shape_image image;
        cairn_box box;

        params.max_side = cases[k].max_side;
        assert_ok(cairn_shape_image_trace(&image, view(), &params, "name", &error));
        assert_int_equal(image.count, 1);
        assert_int_equal(image.outlines[0].count, 2 * (60 + 36) / cases[k].square);
        box = box_of(&image.outlines[0]);
        assert_near(box.min.x, 19.5, 1e-4);
        assert_near(box.min.y, 11.5, 1e-4);
        assert_near(box.max.x, 79.5, 1e-4);
        assert_near(box.max.y, 47.5, 1e-4);
        cairn_shape_image_free(&image);
    }
}

/* More ink and more points than are provided for at first. */
static void pictures_full_of_lines_and_long_outlines_are_traced(void **state)
{
    cairn_shape_image_params params = cairn_shape_image_default();
    cairn_shape_image image;

    (void)state;
    params.holes = CAIRN_SHAPE_IMAGE_HOLES_FILL;
    clear(255);
    frame(1, 1, WIDTH - 2, HEIGHT - 2, 0);
    for (int32_t y = 29; y + 4 < HEIGHT - 2; y += 5)
        fill(1, y, WIDTH - 2, y + 3, 0);
    assert_ok(cairn_shape_image_trace(&image, view(), &params, "name", &error));
    assert_int_equal(image.is_drawing, 1);
    assert_int_equal(image.count, 1);
    assert_near(area_of(&image.outlines[0]), (WIDTH - 2) * (HEIGHT - 2), 8);
    cairn_shape_image_free(&image);

    clear(255);
    for (int32_t x = 1; x < WIDTH - 6; x += 6)
        fill(x, 1, x + 4, HEIGHT - 2, 0);
    fill(1, HEIGHT - 6, WIDTH - 6, HEIGHT - 2, 0);
    image = trace();
    assert_int_equal(image.is_drawing, 0);
    assert_true(image.outlines[0].count > PIXELS / 4);
    cairn_shape_image_free(&image);
}

/* ---- Messages ---- */

static void bad_pictures_and_parameters_are_refused(void **state)
{
    cairn_shape_image_params params = cairn_shape_image_default(), bad;
    cairn_shape_image image;
    cairn_raster_u8_view wide = {grey, CAIRN_SHAPE_IMAGE_MAX_SIDE + 1, 1,
                                 CAIRN_SHAPE_IMAGE_MAX_SIDE + 1};
    cairn_raster_u8_view one = {grey, 1, 1, 1};

    (void)state;
    clear(7);
    assert_refused(&params, CAIRN_EMPTY, "one colour");
    assert_status(cairn_shape_image_trace(&image, one, &params, "name", &error), CAIRN_EMPTY);
    fill(10, 10, 20, 21, 70);
    fill(10, 10, 10, 10, 7);
    assert_ok(cairn_shape_image_trace(&image, view(), &params, "name", NULL));
    cairn_shape_image_free(&image);
    clear(7);
    fill(10, 10, 20, 20, 70);
    assert_refused(&params, CAIRN_EMPTY, "16 pixels along");
    clear(255);
    fill(50, 50, 51, 50, 0);
    fill(50, 51, 50, 51, 0);
    assert_refused(&params, CAIRN_EMPTY, "an object of 3 pixels");
    assert_status(cairn_shape_image_trace(&image, wide, &params, "name", &error), CAIRN_EMPTY);
    fill(10, 10, 60, 60, 0);
    for (int k = 0; k < 8; k++) {
        bad = params;
        bad.holes = k == 0 ? -1 : k == 1 ? 3 : bad.holes;
        bad.max_gap = k == 2 ? -0.1 : k == 3 ? 1.1 : k == 4 ? (double)NAN : bad.max_gap;
        bad.min_part = k == 5 ? -0.1 : k == 6 ? 1.1 : k == 7 ? (double)NAN : bad.min_part;
        assert_refused(&bad, CAIRN_BAD_ARGUMENT,
                       k < 2   ? "holes is"
                       : k < 5 ? "max_gap is"
                               : "min_part is");
    }
    bad = params;
    bad.max_side = 15;
    assert_refused(&bad, CAIRN_BAD_ARGUMENT, "max_side is 15, expected an integer from 16");
    assert_refused(NULL, CAIRN_BAD_ARGUMENT, "no parameters");
    one.data = NULL;
    assert_status(cairn_shape_image_trace(&image, one, &params, "name", NULL), CAIRN_BAD_ARGUMENT);
}

static void more_parts_than_a_model_has_are_refused(void **state)
{
    cairn_shape_image_params params = cairn_shape_image_default();
    cairn_shape_image image;

    (void)state;
    clear(255);
    for (int32_t i = 0; i < 9; i++) {
        fill(5 + 12 * (i % 5), 5 + 20 * (i / 5), 14 + 12 * (i % 5), 20 + 20 * (i / 5), 0);
        if (i == 7) {
            assert_ok(cairn_shape_image_trace(&image, view(), &params, "name", &error));
            assert_int_equal(image.count, 8);
            cairn_shape_image_free(&image);
        }
    }
    assert_refused(&params, CAIRN_FULL, "9 parts and holes");
}

static void a_photograph_is_refused_with_the_option_that_helps(void **state)
{
    cairn_shape_image_params params = cairn_shape_image_default();

    (void)state;
    clear(255);
    fill(30, 20, 100, 80, 0);
    fill(0, 0, WIDTH - 1, 9, 170);
    for (int32_t i = 0; i < 31; i++)
        grey[(85 + i % 2) * WIDTH + 3 * i + 2] = 0;
    assert_refused(&params, CAIRN_BAD_FORMAT, "(11 % of it is neither dark nor bright, 31 specks)");
    assert_refused(&params, CAIRN_BAD_FORMAT, "--grab x,y,w,h");
    fill(0, 0, WIDTH - 1, 29, 170);
    assert_refused(&params, CAIRN_BAD_FORMAT, "(33 % of it is neither dark nor bright), expected");
    assert_refused(&params, CAIRN_BAD_FORMAT, "--grab x,y,w,h");
}

static void a_hole_is_refused_with_its_place(void **state)
{
    cairn_shape_image_params params = cairn_shape_image_default();

    (void)state;
    clear(0);
    fill(10, 10, 79, 79, 255);
    fill(30, 41, 49, 60, 0);
    params.holes = CAIRN_SHAPE_IMAGE_HOLES_REFUSE;
    assert_refused(&params, CAIRN_UNSUPPORTED, "a hole of 400 pixels at (30, 41)");
}

static void open_lines_are_refused(void **state)
{
    cairn_shape_image_params params = cairn_shape_image_default();

    (void)state;
    clear(255);
    for (int32_t y = 1; y < HEIGHT - 1; y += 2)
        for (int32_t x = 2; x < WIDTH - 8; x += 8)
            fill(x, y, x + 4, y, 0);
    params.max_gap = 0;
    assert_refused(&params, CAIRN_BAD_FORMAT, "more than 254 open line ends");
    clear(255);
    fill(20, 20, 80, 20, 0);
    assert_refused(&params, CAIRN_BAD_FORMAT, "enclose nothing");
}

/* All its pixels are junctions of lines: it has more chains than pixels. */
static void a_checkerboard_is_refused_with_a_message(void **state)
{
    cairn_shape_image_params params = cairn_shape_image_default();

    (void)state;
    clear(255);
    for (int32_t y = 10; y < HEIGHT - 10; y++)
        for (int32_t x = 10; x < WIDTH - 10; x++)
            grey[y * WIDTH + x] = (x + y) % 2 ? 255 : 0;
    assert_refused(&params, CAIRN_BAD_FORMAT, "enclose nothing");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(outlines_are_on_the_heap_until_they_are_freed),
        cmocka_unit_test(gaps_of_a_drawing_are_bridged_and_reported),
        cmocka_unit_test(small_parts_and_holes_are_left_out_as_the_parameters_say),
        cmocka_unit_test(a_picture_larger_than_max_side_is_reduced),
        cmocka_unit_test(pictures_full_of_lines_and_long_outlines_are_traced),
        cmocka_unit_test(bad_pictures_and_parameters_are_refused),
        cmocka_unit_test(more_parts_than_a_model_has_are_refused),
        cmocka_unit_test(a_photograph_is_refused_with_the_option_that_helps),
        cmocka_unit_test(a_hole_is_refused_with_its_place),
        cmocka_unit_test(open_lines_are_refused),
        cmocka_unit_test(a_checkerboard_is_refused_with_a_message),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
