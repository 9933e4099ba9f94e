/* Appearance models: textures distinguished, training repeated, files, bad files; without the
 * library of OpenCV. */
#include "cairn/appearance.h"

#include <math.h>

#include "cairn/random.h"
#include "src/host/images/appearance_work.h"
#include "tests/files.h"

enum { WIDTH = 220, HEIGHT = 160, LEFT = 40, TOP = 30, SIDE = 80 };

static cairn_file_error error;
static uint8_t grey[WIDTH * HEIGHT];

/* ---- Without the library ---- */

/* Two words and two support vectors: one of each word. */
static cairn_appearance_model make_small(void)
{
    static uint8_t words[2 * CAIRN_APPEARANCE_DESCRIPTOR_SIZE];
    static float histograms[] = {1, 0, 0.25F, 0.75F};
    static double weights[] = {2, -1.5};
    cairn_appearance_model m = {2, 2, words, histograms, weights, 0.5, 0.25, -2, 0.125};

    for (int32_t i = 0; i < CAIRN_APPEARANCE_DESCRIPTOR_SIZE; i++) {
        words[i] = (uint8_t)i;
        words[CAIRN_APPEARANCE_DESCRIPTOR_SIZE + i] = (uint8_t)(255 - i);
    }
    return m;
}

static void scores_histograms(void **state)
{
    static const float query[] = {0.5F, 0.5F};
    cairn_appearance_model m = make_small();
    /* chi2: .25 / 1.5 + .5 and .0625 / .75 + .0625 / 1.25. */
    double f = 2 * exp(-0.5 * (0.25 / 1.5 + 0.5)) -
               1.5 * exp(-0.5 * (0.0625 / 0.75 + 0.0625 / 1.25)) - 0.25;

    (void)state;
    assert_near(cairn_appearance_histogram_probability(&m, query), 1 / (1 + exp(-2 * f + 0.125)),
                1e-12);
    m.platt_slope = -1e300;
    m.rho = 1e9;
    assert_near(cairn_appearance_histogram_probability(&m, query), 0, 1e-300);
}

static void finds_the_nearest_word(void **state)
{
    uint8_t words[3 * CAIRN_APPEARANCE_DESCRIPTOR_SIZE], query[CAIRN_APPEARANCE_DESCRIPTOR_SIZE];
    int32_t distance;

    (void)state;
    memset(words, 10, sizeof words / 3);
    memset(words + CAIRN_APPEARANCE_DESCRIPTOR_SIZE, 20, sizeof words / 3);
    memset(words + 2 * CAIRN_APPEARANCE_DESCRIPTOR_SIZE, 20, sizeof words / 3);
    memset(query, 16, sizeof query);
    assert_int_equal(cairn_appearance_nearest_word(words, 3, query, &distance), 1);
    assert_int_equal(distance, 16 * CAIRN_APPEARANCE_DESCRIPTOR_SIZE);
    memset(query, 15, sizeof query); /* of equal ones the first */
    assert_int_equal(cairn_appearance_nearest_word(words, 3, query, NULL), 0);
}

static void keeps_models(void **state)
{
    cairn_appearance_model made = make_small(), got;
    const char *path = files_path("small.look");

    (void)state;
    made.weights[0] = 1.0 / 3;
    made.histograms[2] = 0.1F;
    assert_ok(cairn_appearance_write(&made, path, &error));
    assert_ok(cairn_appearance_read(&got, path, &error));
    assert_int_equal(got.word_count, 2);
    assert_int_equal(got.support_count, 2);
    assert_memory_equal(got.words, made.words, 2 * CAIRN_APPEARANCE_DESCRIPTOR_SIZE);
    assert_memory_equal(got.histograms, made.histograms, 4 * sizeof(float));
    assert_memory_equal(got.weights, made.weights, 2 * sizeof(double));
    assert_near(got.gamma, 0.5, 0);
    assert_near(got.rho, 0.25, 0);
    assert_near(got.platt_slope, -2, 0);
    assert_near(got.platt_offset, 0.125, 0);
    cairn_appearance_free(&got);
    made.weights[0] = 2;
    made.histograms[2] = 0.25F;
}

static void assert_unreadable(const char *text, cairn_status status, const char *what)
{
    cairn_appearance_model m;

    assert_status(cairn_appearance_read(&m, files_write_text("bad.look", text), &error), status);
    assert_null(m.words);
    assert_null(m.histograms);
    if (strstr(error.text, what) == NULL || strstr(error.text, "expected") == NULL)
        fail_msg("\"%s\" does not hold \"%s\"", error.text, what);
}

/* Every truncated file is refused, and so are foreign files, other versions, and impossible
 * numbers. */
static void refuses_what_is_no_model(void **state)
{
    cairn_appearance_model m = make_small();
    char *text, *at, kept;
    size_t length;

    (void)state;
    assert_ok(cairn_appearance_write(&m, files_path("whole.look"), &error));
    text = files_read(files_path("whole.look"), NULL);
    assert_non_null(text);
    length = strlen(text);
    for (size_t cut = 0; cut + 2 < length; cut += 1 + cut / 50) {
        cairn_appearance_model got;

        kept = text[cut];
        text[cut] = '\0';
        assert_true(cairn_appearance_read(&got, files_write_text("cut.look", text), &error) < 0);
        assert_null(got.words);
        text[cut] = kept;
    }
    assert_unreadable("", CAIRN_TRUNCATED, "the file ends here, expected 'cairn-appearance 1'");
    assert_unreadable("cairn-shape 1\n", CAIRN_BAD_FORMAT,
                      ":1: \"cairn-shape\", expected 'cairn-appearance'");
    assert_unreadable("cairn-appearance 2\nwords 2\n", CAIRN_UNSUPPORTED,
                      ":1: a model of version 2, expected 1");
    assert_unreadable("cairn-appearance 1\nwords 1001\n", CAIRN_BAD_FORMAT,
                      ":2: \"1001\", expected a number of 2");
    assert_unreadable("cairn-appearance 1\nwords 2.5\n", CAIRN_BAD_FORMAT,
                      ":2: 2.5, expected a whole number");
    assert_unreadable("cairn-appearance 1\nwords 1e300\n", CAIRN_BAD_FORMAT,
                      ":2: \"1e300\", expected a number of 2");
    assert_unreadable("cairn-appearance 1\nwords nan\n", CAIRN_BAD_FORMAT,
                      ":2: \"nan\", expected a number of 2");
    assert_unreadable("cairn-appearance 1 2\n", CAIRN_BAD_FORMAT,
                      ":1: \"2\", expected the line to end");
    at = strstr(text, " 1 2 3 ");
    assert_non_null(at);
    memcpy(at, " 1 x 3 ", 7);
    assert_unreadable(text, CAIRN_BAD_FORMAT, ":3: \"x\", expected a number of 0 ... 255");
    memcpy(at, " 1 2 3 ", 7);
    at = strstr(text, "machine 0.5");
    memcpy(at, "machine 0.0", 11);
    assert_unreadable(text, CAIRN_BAD_FORMAT, "expected a number of 1e-09");
    memcpy(at, "machine 0.5", 11);
    memcpy(text + length - 4, "END\n", 4);
    assert_unreadable(text, CAIRN_BAD_FORMAT, "\"END\", expected 'end'");
    free(text);
    assert_status(cairn_appearance_read(&m, files_path("missing.look"), &error), CAIRN_IO);
}

/* Nothing is written that the reader would refuse. */
static void writes_nothing_unreadable(void **state)
{
    static float beyond[] = {1, 0, 1.5F, 0};
    static double none[] = {2, (double)NAN};

    (void)state;
    for (int k = 0; k < 8; k++) {
        cairn_appearance_model m = make_small();

        switch (k) {
        case 0:
            m.gamma = 0;
            break;
        case 1:
            m.gamma = (double)INFINITY;
            break;
        case 2:
            m.rho = (double)NAN;
            break;
        case 3:
            m.platt_slope = -2e9;
            break;
        case 4:
            m.histograms = beyond;
            break;
        case 5:
            m.weights = none;
            break;
        case 6:
            m.support_count = 0;
            break;
        default:
            m.word_count = 1;
            break;
        }
        assert_status(cairn_appearance_write(&m, files_path("never.look"), &error),
                      CAIRN_BAD_ARGUMENT);
        assert_non_null(
            strstr(error.text, "never.look: a model beyond what is read again, expected"));
        assert_null(files_read(files_path("never.look"), NULL));
    }
}

/* What is missing is named. */
static void works_without_the_library(void **state)
{
    cairn_appearance_model m = make_small();
    cairn_appearance_field *field;

    (void)state;
    (void)setenv("CAIRN_APPEARANCE", "/nowhere/libcairn-appearance.so", 1);
    assert_status(cairn_appearance_load(&error), CAIRN_UNSUPPORTED);
    assert_non_null(
        strstr(error.text, "needs libcairn-appearance.so of this version, expected it beside"));
    assert_status(cairn_appearance_field_make(&field, &m, grey, WIDTH, HEIGHT, "a.png", &error),
                  CAIRN_UNSUPPORTED);
    assert_null(field);
    (void)unsetenv("CAIRN_APPEARANCE");
    assert_status(cairn_appearance_field_make(&field, &m, grey, 0, HEIGHT, "a.png", &error),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_appearance_field_make(&field, &m, grey, CAIRN_APPEARANCE_MAX_SIDE + 1, 1,
                                              "a.png", &error),
                  CAIRN_BAD_ARGUMENT);
    assert_non_null(strstr(error.text, "a.png: an image of 8193 x 1, expected"));
}

/* ---- With it ---- */

static void need_library(void)
{
    if (cairn_appearance_load(&error) == CAIRN_UNSUPPORTED) {
        print_message("%s: skipped\n", error.text);
        skip();
    }
}

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

static cairn_appearance_params small_params(void)
{
    cairn_appearance_params params = cairn_appearance_default();

    params.words = 20;
    return params;
}

static cairn_appearance_model learn(const cairn_appearance_params *params)
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
    static const double other[4] = {5, 5, 85, 85}, none[4] = {-50, -50, -20, -20};
    cairn_appearance_params params = small_params();
    cairn_appearance_model m, again;

    (void)state;
    need_library();
    m = learn(&params);
    assert_int_equal(m.word_count, 20);
    assert_in_range(m.support_count, 2, 66);
    for (uint64_t seed = 100; seed < 104; seed++) {
        double box[4] = {120, 60, 120 + SIDE, 60 + SIDE};
        cairn_appearance_field *field;

        draw(120, 60, seed, 1);
        assert_ok(cairn_appearance_field_make(&field, &m, grey, WIDTH, HEIGHT, "image", &error));
        assert_true(cairn_appearance_probability(field, box) > 0.8);
        assert_true(cairn_appearance_probability(field, other) < 0.2);
        assert_near(cairn_appearance_probability(field, none), 0.5, 0); /* without a patch */
        assert_true(cairn_appearance_distance(field, box) <
                    0.5 * cairn_appearance_distance(field, other));
        assert_true(cairn_appearance_distance(field, other) <= 1);
        assert_near(cairn_appearance_distance(field, none), 1, 0);
        cairn_appearance_field_free(field);
    }
    /* Training repeated is the same bit by bit; another seed gives another dictionary. */
    again = learn(&params);
    assert_int_equal(again.support_count, m.support_count);
    assert_memory_equal(again.words, m.words, 20 * CAIRN_APPEARANCE_DESCRIPTOR_SIZE);
    assert_memory_equal(again.weights, m.weights, (size_t)m.support_count * sizeof(double));
    assert_near(again.platt_slope, m.platt_slope, 0);
    cairn_appearance_free(&again);
    params.seed = 2;
    again = learn(&params);
    assert_memory_not_equal(again.words, m.words, 20 * CAIRN_APPEARANCE_DESCRIPTOR_SIZE);
    cairn_appearance_free(&again);
    cairn_appearance_free(&m);
}

/* All boxes of an image are used, however many: only the last of them has the required patches. */
static void takes_many_boxes(void **state)
{
    enum { BOXES = 300 };
    static double boxes[BOXES][4];
    cairn_appearance_params params = small_params();
    cairn_appearance_trainer *trainer = cairn_appearance_trainer_new();
    cairn_appearance_model m;

    (void)state;
    assert_non_null(trainer);
    if (cairn_appearance_load(&error) == CAIRN_OK) {
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
        cairn_appearance_free(&m);
    }
    cairn_appearance_trainer_free(trainer);
    need_library();
}

static void accepts_tiny_images(void **state)
{
    static const double all[4] = {0, 0, 8, 8};
    cairn_appearance_model m = make_small();

    (void)state;
    need_library();
    for (int32_t side = 1; side <= 8; side++) {
        cairn_appearance_field *field;
        double p;

        assert_ok(cairn_appearance_field_make(&field, &m, grey, side, side, "image", &error));
        p = cairn_appearance_probability(field, all);
        if (side < 4) /* the first patch has its middle at (3, 3) */
            assert_near(p, 0.5, 0);
        else
            assert_true(fabs(p - 0.5) > 0.1);
        cairn_appearance_field_free(field);
    }
}

static void refuses_what_cannot_be_learnt(void **state)
{
    static const double bad[][4] = {{10, 10, 10, 20}, {10, 10, 20, 5},          {300, 10, 320, 20},
                                    {10, -9, 20, -1}, {(double)NAN, 1, 20, 20}, {-1e9, 1, 20, 20}};
    static const double whole[4] = {0, 0, WIDTH, HEIGHT}, tiny[4] = {10, 10, 20, 20};
    cairn_appearance_params params = small_params(), odd;
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
    if (cairn_appearance_load(NULL) == CAIRN_OK) {
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
        cmocka_unit_test(scores_histograms),
        cmocka_unit_test(finds_the_nearest_word),
        cmocka_unit_test(keeps_models),
        cmocka_unit_test(refuses_what_is_no_model),
        cmocka_unit_test(writes_nothing_unreadable),
        cmocka_unit_test(works_without_the_library),
        cmocka_unit_test(distinguishes_textures),
        cmocka_unit_test(takes_many_boxes),
        cmocka_unit_test(accepts_tiny_images),
        cmocka_unit_test(refuses_what_cannot_be_learnt),
    };

    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
