/* Outlines from images: silhouettes and drawings of known objects, their gaps, parts and holes; bad
 * images. */
#include "tests/test.h"

#include <math.h>

#include "cairn/shape_image.h"

enum { WIDTH = 120, HEIGHT = 90, PIXELS = WIDTH * HEIGHT };

static uint8_t grey[PIXELS];
static cairn_file_error error;

static cairn_raster_u8_view view(void)
{
    cairn_raster_u8_view v = {grey, WIDTH, HEIGHT, WIDTH};

    return v;
}

static void clear(uint8_t value)
{
    memset(grey, value, sizeof grey);
}

static void fill(int32_t left, int32_t top, int32_t right, int32_t bottom, uint8_t value)
{
    for (int32_t y = top; y <= bottom; y++)
        for (int32_t x = left; x <= right; x++)
            grey[y * WIDTH + x] = value;
}

/* The outline of a rectangle, one pixel wide. */
static void frame(int32_t left, int32_t top, int32_t right, int32_t bottom, uint8_t value)
{
    fill(left, top, right, top, value);
    fill(left, bottom, right, bottom, value);
    fill(left, top, left, bottom, value);
    fill(right, top, right, bottom, value);
}

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

static double area_of(const cairn_curve *c)
{
    return fabs((double)cairn_polygon_area(c->points, c->count));
}

static cairn_box box_of(const cairn_curve *c)
{
    cairn_box box = cairn_box_empty();

    for (int32_t i = 0; i < c->count; i++)
        box = cairn_box_extend(box, c->points[i]);
    return box;
}

/* Each point is a neighbour of the one before, all the way round. */
static void assert_closed(const cairn_curve *c)
{
    assert_int_equal(c->closed, 1);
    for (int32_t i = 0; i < c->count; i++) {
        cairn_vec2 step = cairn_vec2_sub(c->points[(i + 1) % c->count], c->points[i]);

        assert_true((double)cairn_vec2_norm(step) <= 1.01);
    }
}

/* ---- Silhouettes ---- */

static void test_silhouette(void **state)
{
    static const uint8_t colours[3][2] = {{255, 0}, {0, 255}, {90, 110}};

    (void)state;
    for (int k = 0; k < 3; k++) {
        cairn_shape_image image;
        cairn_box box;

        clear(colours[k][0]);
        fill(20, 10, 79, 49, colours[k][1]);
        image = trace();
        assert_int_equal(image.count, 1);
        assert_int_equal(
            image.holes + image.is_drawing + image.bridged_gaps + image.dropped_regions, 0);
        box = box_of(&image.outlines[0]);
        assert_near(box.min.x, 19.5, 1e-4);
        assert_near(box.min.y, 9.5, 1e-4);
        assert_near(box.max.x, 79.5, 1e-4);
        assert_near(box.max.y, 49.5, 1e-4);
        /* Smoothing cuts only the corners. */
        assert_near(area_of(&image.outlines[0]), 60 * 40, 8);
        assert_closed(&image.outlines[0]);
        cairn_shape_image_free(&image);
        assert_null(image.points);
    }
}

/* The middle of a disc, its area and the length of its outline. */
static void test_disc(void **state)
{
    cairn_shape_image image;
    cairn_vec2 sum = {0, 0};

    (void)state;
    clear(255);
    for (int32_t i = 0; i < PIXELS; i++)
        if (hypot(i % WIDTH - 50, (double)i / WIDTH - (double)(i % WIDTH) / WIDTH - 40) <= 30)
            grey[i] = 0;
    image = trace();
    for (int32_t i = 0; i < image.outlines[0].count; i++)
        sum = cairn_vec2_add(sum, image.outlines[0].points[i]);
    assert_near(sum.x / (cairn_real)image.outlines[0].count, 50, 0.1);
    assert_near(sum.y / (cairn_real)image.outlines[0].count, 40, 0.1);
    assert_near(area_of(&image.outlines[0]), 3.14159 * 900, 40);
    assert_near(cairn_curve_length(&image.outlines[0]), 2 * 3.14159 * 30, 14);
    cairn_shape_image_free(&image);
}

/* An object cut by the border of the image is closed along it. */
static void test_object_at_the_rim(void **state)
{
    cairn_shape_image image;

    (void)state;
    clear(255);
    fill(0, 30, 40, HEIGHT - 1, 0);
    image = trace();
    assert_int_equal(image.count, 1);
    assert_near(area_of(&image.outlines[0]), 41 * 60, 8);
    assert_near(box_of(&image.outlines[0]).min.x, -0.5, 1e-4);
    assert_near(box_of(&image.outlines[0]).max.y, HEIGHT - 0.5, 1e-4);
    cairn_shape_image_free(&image);
}

/* Parts that touch in a corner are one, holes that touch in a corner are two. */
static void test_corners(void **state)
{
    cairn_shape_image image;

    (void)state;
    clear(255);
    fill(10, 10, 39, 39, 0);
    fill(40, 40, 69, 69, 0);
    image = trace();
    assert_int_equal(image.count, 1);
    assert_near(area_of(&image.outlines[0]), 2 * 900, 20);
    cairn_shape_image_free(&image);
    clear(255);
    fill(10, 10, 79, 79, 0);
    fill(20, 20, 39, 39, 255);
    fill(40, 40, 59, 59, 255);
    image = trace();
    assert_int_equal(image.count, 3);
    assert_int_equal(image.holes, 2);
    assert_near(area_of(&image.outlines[0]), 70 * 70, 8);
    assert_near(area_of(&image.outlines[1]), 400, 8);
    assert_near(area_of(&image.outlines[2]), 400, 8);
    cairn_shape_image_free(&image);
}

static void test_parts_by_size_and_specks(void **state)
{
    cairn_shape_image image;

    (void)state;
    clear(255);
    fill(5, 5, 24, 24, 0);
    fill(40, 5, 99, 64, 0);
    fill(60, 20, 79, 39, 255);
    fill(5, 70, 8, 73, 0);     /* 16 of 3600: a speck */
    fill(50, 10, 51, 11, 255); /* and a hole of 4 */
    image = trace();
    assert_int_equal(image.count, 3);
    assert_int_equal(image.holes, 1);
    assert_int_equal(image.dropped_regions, 2);
    assert_near(area_of(&image.outlines[0]), 3600, 8);
    assert_near(area_of(&image.outlines[1]), 400, 8);
    assert_near(box_of(&image.outlines[1]).min.x, 4.5, 1e-4);
    assert_near(area_of(&image.outlines[2]), 400, 8);
    assert_near(box_of(&image.outlines[2]).min.x, 59.5, 1e-4);
    cairn_shape_image_free(&image);
}

static void test_holes(void **state)
{
    cairn_shape_image_params params = cairn_shape_image_default();
    cairn_shape_image image;

    (void)state;
    clear(0);
    fill(10, 10, 79, 79, 255);
    fill(30, 41, 49, 60, 0);
    params.holes = CAIRN_SHAPE_IMAGE_HOLES_REFUSE;
    assert_refused(&params, CAIRN_UNSUPPORTED, "a hole of 400 pixels at (30, 41)");
    params.holes = CAIRN_SHAPE_IMAGE_HOLES_FILL;
    assert_ok(cairn_shape_image_trace(&image, view(), &params, "name", &error));
    assert_int_equal(image.count, 1);
    assert_int_equal(image.holes, 0);
    cairn_shape_image_free(&image);
}

/* ---- Drawings ---- */

static void test_drawing(void **state)
{
    (void)state;
    for (int thick = 0; thick < 3; thick++) {
        cairn_shape_image image;

        clear(255);
        for (int k = 0; k <= thick; k++)
            frame(20 + k, 10 + k, 79 - k, 69 - k, 0);
        image = trace();
        assert_int_equal(image.is_drawing, 1);
        assert_int_equal(image.count, 1);
        assert_int_equal(image.holes + image.bridged_gaps + image.dropped_regions, 0);
        assert_near(area_of(&image.outlines[0]), 60 * 60, 8);
        cairn_shape_image_free(&image);
    }
}

/* Gaps are closed up to a tenth of the diagonal, which is 85 here. */
static void test_gaps(void **state)
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
    params = cairn_shape_image_default();
    fill(60, 69, 70, 69, 255);
    assert_refused(&params, CAIRN_BAD_FORMAT, "enclose nothing");
    clear(255);
    fill(20, 20, 80, 20, 0);
    assert_refused(&params, CAIRN_BAD_FORMAT, "enclose nothing");
}

/* The largest face of a drawing is the object, the others are holes: a mug and the hole of its
 * handle. */
static void test_faces_of_a_drawing(void **state)
{
    cairn_shape_image image;

    (void)state;
    clear(255);
    frame(10, 10, 59, 79, 0);
    frame(59, 25, 89, 60, 0);
    image = trace();
    assert_int_equal(image.count, 2);
    assert_int_equal(image.holes, 1);
    assert_near(area_of(&image.outlines[0]), 50 * 70 + 30 * 36, 10);
    assert_near(area_of(&image.outlines[1]), 29 * 34, 10);
    cairn_shape_image_free(&image);
}

/* A drawing of two parts, and letters beside them that enclose nothing. */
static void test_parts_of_a_drawing(void **state)
{
    cairn_shape_image image;

    (void)state;
    clear(255);
    frame(10, 10, 29, 29, 0);
    frame(40, 10, 99, 69, 0);
    fill(10, 80, 20, 80, 0);
    image = trace();
    assert_int_equal(image.count, 2);
    assert_int_equal(image.holes, 0);
    assert_int_equal(image.dropped_regions, 1);
    assert_near(area_of(&image.outlines[0]), 3600, 8);
    cairn_shape_image_free(&image);
}

/* ---- Bad images ---- */

static void test_refusals(void **state)
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
        assert_refused(&bad, CAIRN_BAD_ARGUMENT, "0 to 1");
    }
    assert_refused(NULL, CAIRN_BAD_ARGUMENT, "picture");
    one.data = NULL;
    assert_status(cairn_shape_image_trace(&image, one, &params, "name", NULL), CAIRN_BAD_ARGUMENT);
}

static void test_too_many_parts(void **state)
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

/* Greys in a tenth of the picture, or specks, are of silhouettes, too; both are of photographs. */
static void test_greys_and_specks(void **state)
{
    cairn_shape_image_params params = cairn_shape_image_default();

    (void)state;
    for (int32_t greys = 0; greys < 2; greys++)
        for (int32_t specks = 30; specks < 32; specks++) {
            clear(255);
            fill(30, 20, 100, 80, 0);
            if (greys)
                fill(0, 0, WIDTH - 1, 9, 170);
            for (int32_t i = 0; i < specks; i++)
                grey[(85 + i % 2) * WIDTH + 3 * i + 2] = 0;
            if (greys && specks > 30) {
                assert_refused(&params, CAIRN_BAD_FORMAT, "31 specks");
                assert_refused(&params, CAIRN_BAD_FORMAT, "--grab x,y,w,h");
            } else {
                cairn_shape_image image = trace();

                assert_int_equal(image.count, 1);
                assert_int_equal(image.dropped_regions, specks);
                cairn_shape_image_free(&image);
            }
        }
}

/* Endless lines: refused, not followed for ever. */
static void test_hatching(void **state)
{
    cairn_shape_image_params params = cairn_shape_image_default();

    (void)state;
    clear(255);
    for (int32_t y = 1; y < HEIGHT - 1; y += 2)
        for (int32_t x = 2; x < WIDTH - 8; x += 8)
            fill(x, y, x + 4, y, 0);
    params.max_gap = 0;
    assert_refused(&params, CAIRN_BAD_FORMAT, "open line ends");
}

/* Every image ends with outlines that close, or with an error. */
static void test_noise(void **state)
{
    cairn_shape_image_params params = cairn_shape_image_default();
    cairn_random random = cairn_random_seed(3, 1);

    (void)state;
    for (int32_t round = 0; round < 30; round++) {
        cairn_shape_image image;

        for (int32_t i = 0; i < PIXELS; i++)
            grey[i] = (uint8_t)(cairn_random_below(&random, 30) < round ? 255 : 0);
        if (cairn_shape_image_trace(&image, view(), &params, "name", &error) == CAIRN_OK) {
            for (int32_t i = 0; i < image.count; i++)
                assert_closed(&image.outlines[i]);
            cairn_shape_image_free(&image);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_silhouette),
        cmocka_unit_test(test_disc),
        cmocka_unit_test(test_object_at_the_rim),
        cmocka_unit_test(test_corners),
        cmocka_unit_test(test_parts_by_size_and_specks),
        cmocka_unit_test(test_holes),
        cmocka_unit_test(test_drawing),
        cmocka_unit_test(test_gaps),
        cmocka_unit_test(test_faces_of_a_drawing),
        cmocka_unit_test(test_parts_of_a_drawing),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_too_many_parts),
        cmocka_unit_test(test_greys_and_specks),
        cmocka_unit_test(test_hatching),
        cmocka_unit_test(test_noise),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
