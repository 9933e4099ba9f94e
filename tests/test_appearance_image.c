/* Visual words of images: bad images, tiny ones; without the library of OpenCV. */
#include "cairn/appearance_image.h"

#include <math.h>

#include "tests/appearance_scores.h"
#include "tests/appearance_small.h"
#include "tests/files.h"

enum { WIDTH = 220, HEIGHT = 160 };

static cairn_file_error error;
static uint8_t grey[WIDTH * HEIGHT];

/* What is missing is named. */
static void works_without_the_library(void **state)
{
    cairn_appearance_model m = make_small();
    cairn_appearance_image image;

    (void)state;
    (void)setenv("CAIRN_APPEARANCE", "/nowhere/libcairn-appearance.so", 1);
    assert_status(cairn_appearance_image_load(&error), CAIRN_UNSUPPORTED);
    assert_non_null(
        strstr(error.text, "needs libcairn-appearance.so of this version, expected it beside"));
    assert_status(cairn_appearance_image_make(&image, &m, grey, WIDTH, HEIGHT, "a.png", &error),
                  CAIRN_UNSUPPORTED);
    assert_null(image.field);
    (void)unsetenv("CAIRN_APPEARANCE");
    assert_status(cairn_appearance_image_make(&image, &m, grey, 0, HEIGHT, "a.png", &error),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_appearance_image_make(&image, &m, grey, CAIRN_APPEARANCE_IMAGE_MAX_SIDE + 1,
                                              1, "a.png", &error),
                  CAIRN_BAD_ARGUMENT);
    assert_non_null(strstr(error.text, "a.png: an image of 8193 x 1, expected"));
}

static void accepts_tiny_images(void **state)
{
    static const cairn_real all[4] = {0, 0, 8, 8};
    cairn_appearance_model m = make_small();

    (void)state;
    need_library();
    for (int32_t side = 1; side <= 8; side++) {
        cairn_appearance_image image;
        double p;

        assert_ok(cairn_appearance_image_make(&image, &m, grey, side, side, "image", &error));
        p = (double)appearance_of(&image, all).probability;
        if (side < 4) /* the first patch has its middle at (3, 3) */
            assert_near(p, 0.5, 0);
        else
            assert_true(fabs(p - 0.5) > 0.1);
        cairn_appearance_image_free(&image);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(works_without_the_library),
        cmocka_unit_test(accepts_tiny_images),
    };

    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
