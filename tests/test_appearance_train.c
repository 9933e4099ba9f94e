/* Training of appearance models: textures distinguished, training repeated, what cannot be learnt.
 * Without the library of OpenCV only refusals. */
#include "cairn/appearance_train.h"

#include <math.h>

#include "cairn/random.h"
#include "tests/appearance_scores.h"
#include "tests/files.h"

enum { WIDTH = 220, HEIGHT = 160, LEFT = 40, TOP = 30, SIDE = 80 };

static cairn_file_error error;
static uint8_t grey[WIDTH * HEIGHT];

/* Stripes in the box, blots outside. */
static void draw(int32_t left, int32_t top, uint64_t seed, int is_there)
{
    cairn_random random = cairn_random_seed(seed, 3);

    for (int32_t i = 0; i < WIDTH * HEIGHT; i++)
        grey[i] = 128;
    for (int32_t k = 0; k < 400; k++) {
        int32_t x = cairn_random_below(&random, WIDTH), y = cairn_random_below(&random, HEIGHT);
        int32_t r = 2 + cairn_random_below(&random, 5), level = cairn_random_below(&random, 256);

        for (int32_t v = y - r; v <= y + r; v++)
            for (int32_t u = x - r; u <= x + r; u++)
                if (u >= 0 && v >= 0 && u < WIDTH && v < HEIGHT &&
                    (u - x) * (u - x) + (v - y) * (v - y) <= r * r)
                    grey[v * WIDTH + u] = (uint8_t)level;
    }
    for (int32_t y = top; y < top + SIDE && is_there; y++)
        for (int32_t x = left; x < left + SIDE; x++)
            grey[y * WIDTH + x] = (x + y + (int32_t)seed) / 5 % 2 ? 220 : 40;
}

static cairn_appearance_train_params small_params(void)
{
    cairn_appearance_train_params params = cairn_appearance_train_default();

    params.words = 20;
    return params;
}

static cairn_appearance_model learn(const cairn_appearance_train_params *params)
{
    cairn_appearance_trainer *trainer = cairn_appearance_trainer_new();
    cairn_appearance_model m;

    assert_non_null(trainer);
    for (int32_t i = 0; i < 6; i++) {
        double box[4] = {LEFT + 10 * i, TOP + 5 * i, LEFT + 10 * i + SIDE, TOP + 5 * i + SIDE};

        draw(LEFT + 10 * i, TOP + 5 * i, (uint64_t)i, i < 5);
        assert_ok(cairn_appearance_trainer_add(trainer, grey, WIDTH, HEIGHT, box, i < 5, "image",
                                               &error));
    }
    assert_ok(cairn_appearance_train(&m, trainer, params, "images", &error));
    cairn_appearance_trainer_free(trainer);
    return m;
}

static void distinguishes_textures(void **state)
{
    static const cairn_real other[4] = {5, 5, 85, 85}, none[4] = {-50, -50, -20, -20};
    cairn_appearance_train_params params = small_params();
    cairn_appearance_model m, again;

    (void)state;
    need_library();
    m = learn(&params);
    assert_int_equal(m.word_count, 20);
    assert_in_range(m.support_count, 2, 66);
    for (uint64_t seed = 100; seed < 104; seed++) {
        cairn_real box[4] = {120, 60, 120 + SIDE, 60 + SIDE};
        cairn_appearance_image image;

        draw(120, 60, seed, 1);
        assert_ok(cairn_appearance_image_make(&image, &m, grey, WIDTH, HEIGHT, "image", &error));
        assert_true((double)appearance_of(&image, box).probability > 0.8);
        assert_true((double)appearance_of(&image, other).probability < 0.2);
        assert_near((double)appearance_of(&image, none).probability, 0.5, 0); /* without a patch */
        assert_true((double)appearance_of(&image, box).distance <
                    0.5 * (double)appearance_of(&image, other).distance);
        assert_true((double)appearance_of(&image, other).distance <= 1);
        assert_near((double)appearance_of(&image, none).distance, 1, 0);
        cairn_appearance_image_free(&image);
    }
    /* Training repeated is the same bit by bit; another seed gives another dictionary. */
    again = learn(&params);
    assert_int_equal(again.support_count, m.support_count);
    assert_memory_equal(again.words, m.words, 20 * CAIRN_APPEARANCE_DESCRIPTOR_SIZE);
    assert_memory_equal(again.weights, m.weights, (size_t)m.support_count * sizeof(cairn_real));
    assert_near(again.platt_slope, m.platt_slope, 0);
    cairn_appearance_file_free(&again);
    params.seed = 2;
    again = learn(&params);
    assert_memory_not_equal(again.words, m.words, 20 * CAIRN_APPEARANCE_DESCRIPTOR_SIZE);
    cairn_appearance_file_free(&again);
    cairn_appearance_file_free(&m);
}

static void the_seed_is_1_unless_given(void **state)
{
    (void)state;
    assert_true(cairn_appearance_train_default().seed == 1);
}

/* All boxes of an image are used, however many: only the last of them has the required patches. */
static void takes_many_boxes(void **state)
{
    enum { BOXES = 300 };
    static double boxes[BOXES][4];
    cairn_appearance_train_params params = small_params();
    cairn_appearance_trainer *trainer = cairn_appearance_trainer_new();
    cairn_appearance_model m;

    (void)state;
    assert_non_null(trainer);
    if (cairn_appearance_image_load(&error) == CAIRN_OK) {
        draw(LEFT, TOP, 1, 1);
        for (int32_t i = 0; i < BOXES; i++) {
            boxes[i][2] = boxes[i][3] = 2; /* the first patch has its middle at (3, 3) */
        }
        boxes[BOXES - 1][0] = LEFT;
        boxes[BOXES - 1][1] = TOP;
        boxes[BOXES - 1][2] = LEFT + SIDE;
        boxes[BOXES - 1][3] = TOP + SIDE;
        params.negatives = 1;
        assert_ok(cairn_appearance_trainer_add(trainer, grey, WIDTH, HEIGHT, boxes[0], BOXES,
                                               "image", &error));
        assert_ok(cairn_appearance_train(&m, trainer, &params, "images", &error));
        cairn_appearance_file_free(&m);
    }
    cairn_appearance_trainer_free(trainer);
    need_library();
}

static void refuses_what_cannot_be_learnt(void **state)
{
    static const double bad[][4] = {{10, 10, 10, 20}, {10, 10, 20, 5},          {300, 10, 320, 20},
                                    {10, -9, 20, -1}, {(double)NAN, 1, 20, 20}, {-1e9, 1, 20, 20}};
    static const double whole[4] = {0, 0, WIDTH, HEIGHT}, tiny[4] = {10, 10, 20, 20};
    cairn_appearance_train_params params = small_params(), odd;
    cairn_appearance_trainer *trainer = cairn_appearance_trainer_new();
    cairn_appearance_model m;

    (void)state;
    assert_non_null(trainer);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_status(
            cairn_appearance_trainer_add(trainer, grey, WIDTH, HEIGHT, bad[i], 1, "image", &error),
            CAIRN_BAD_ARGUMENT);
        assert_non_null(strstr(error.text, "image: a box from"));
    }
    for (int k = 0; k < 6; k++) {
        odd = params;
        if (k < 2)
            odd.words = k == 0 ? 1 : 1001;
        else if (k < 4)
            odd.negatives = k == 2 ? 0 : 101;
        else
            odd.cost = k == 4 ? 0 : (double)NAN;
        assert_status(cairn_appearance_train(&m, trainer, &odd, "images", &error),
                      CAIRN_BAD_ARGUMENT);
    }
    assert_status(cairn_appearance_train(&m, trainer, &params, "images", &error), CAIRN_EMPTY);
    assert_non_null(strstr(error.text, "images: no box in any image"));
    if (cairn_appearance_image_load(NULL) == CAIRN_OK) {
        draw(LEFT, TOP, 1, 1);
        assert_ok(
            cairn_appearance_trainer_add(trainer, grey, WIDTH, HEIGHT, tiny, 1, "image", &error));
        assert_status(cairn_appearance_train(&m, trainer, &params, "images", &error), CAIRN_EMPTY);
        assert_non_null(strstr(error.text, "patches in boxes, expected at least 20"));
        cairn_appearance_trainer_free(trainer);
        trainer = cairn_appearance_trainer_new();
        assert_ok(
            cairn_appearance_trainer_add(trainer, grey, WIDTH, HEIGHT, whole, 1, "image", &error));
        assert_status(cairn_appearance_train(&m, trainer, &params, "images", &error), CAIRN_EMPTY);
        assert_non_null(strstr(error.text, "no space for negative windows"));
        assert_null(m.words);
    }
    cairn_appearance_trainer_free(trainer);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(distinguishes_textures),
        cmocka_unit_test(the_seed_is_1_unless_given),
        cmocka_unit_test(takes_many_boxes),
        cmocka_unit_test(refuses_what_cannot_be_learnt),
    };

    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
