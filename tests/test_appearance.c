/* Appearance: histograms and boxes scored, compared with the formulas; budgets, memory, refusals. */
#include "cairn/appearance.h"

#include <math.h>

#include "cairn/random.h"
#include "tests/appearance_small.h"
#include "tests/test.h"

enum { PATCHES = 300, WORDS = 7, SUPPORT = 11, SIDE = 100 };

static uint8_t dictionary[WORDS * CAIRN_APPEARANCE_DESCRIPTOR_SIZE],
    descriptors[PATCHES * CAIRN_APPEARANCE_DESCRIPTOR_SIZE];
static float histograms[SUPPORT * WORDS];
static cairn_real weights[SUPPORT];
static cairn_vec2 centres[PATCHES];
static const cairn_appearance_patches patches = {centres, descriptors, PATCHES};

static void scores_histograms(void **state)
{
    static const float query[] = {0.5F, 0.5F};
    cairn_appearance_model m = make_small();
    /* chi2: .25 / 1.5 + .5 and .0625 / .75 + .0625 / 1.25. */
    double f = 2 * exp(-0.5 * (0.25 / 1.5 + 0.5)) -
               1.5 * exp(-0.5 * (0.0625 / 0.75 + 0.0625 / 1.25)) - 0.25;

    (void)state;
    assert_near(cairn_appearance_histogram_probability(&m, query), 1 / (1 + exp(-2 * f + 0.125)),
                NUMBER(1e-12, 1e-6));
    m.platt_slope = CAIRN_REAL(-1e30);
    m.rho = CAIRN_REAL(1e6);
    assert_near(cairn_appearance_histogram_probability(&m, query), 0, NUMBER(1e-300, 1e-36));
}

static void normalizes_histograms(void **state)
{
    float histogram[3] = {1, 0, 3}, none[2] = {0, 0};

    (void)state;
    cairn_appearance_normalize(histogram, 3);
    assert_true(histogram[0] == 0.25F && histogram[1] == 0 && histogram[2] == 0.75F);
    cairn_appearance_normalize(none, 2);
    assert_true(none[0] == 0 && none[1] == 0);
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

/* A model and the patches of an image, at random. */
static cairn_appearance_model make_random(void)
{
    cairn_appearance_model model = {.word_count = WORDS,
                                    .support_count = SUPPORT,
                                    .words = dictionary,
                                    .histograms = histograms,
                                    .weights = weights,
                                    .gamma = CAIRN_REAL(1.5),
                                    .rho = CAIRN_REAL(0.2),
                                    .platt_slope = -3,
                                    .platt_offset = CAIRN_REAL(0.1)};
    cairn_random random = cairn_random_seed(5, 1);

    for (size_t i = 0; i < sizeof dictionary; i++)
        dictionary[i] = (uint8_t)cairn_random_below(&random, 256);
    for (size_t i = 0; i < sizeof descriptors; i++)
        descriptors[i] = (uint8_t)cairn_random_below(&random, 256);
    for (int32_t i = 0; i < PATCHES; i++) {
        centres[i].x = cairn_random_uniform(&random, 0, SIDE);
        centres[i].y = cairn_random_uniform(&random, 0, SIDE);
    }
    for (int32_t i = 0; i < SUPPORT; i++) {
        for (int32_t k = 0; k < WORDS; k++)
            histograms[i * WORDS + k] = (float)(1 + cairn_random_below(&random, 9));
        cairn_appearance_normalize(&histograms[i * WORDS], WORDS);
        weights[i] = cairn_random_uniform(&random, -2, 2);
    }
    return model;
}

typedef struct scorer {
    cairn_appearance_field *field;
    cairn_appearance_model model;
} scorer;

static scorer make_scorer(cairn_pool *pool)
{
    cairn_appearance_params params = {.max_patches = PATCHES, .max_words = WORDS};
    scorer made = {NULL, make_random()};

    *pool = test_pool(cairn_appearance_memory(&params));
    assert_ok(cairn_appearance_create(&made.field, pool, &params));
    return made;
}

static cairn_status step_all(cairn_appearance_field *field, int32_t units, int32_t *largest)
{
    cairn_status status;

    do {
        cairn_budget budget = {units};

        status = cairn_appearance_step(field, &budget);
        *largest = units - budget.left > *largest ? units - budget.left : *largest;
    } while (status == CAIRN_MORE);
    return status;
}

/* The scores of a box from the definitions. */
static cairn_appearance_result slow_scores(const cairn_appearance_model *model,
                                           const cairn_real box[4])
{
    float histogram[WORDS] = {0};
    cairn_appearance_result result = {0, CAIRN_REAL(0.5), 1};
    double smallest = 2;

    for (int32_t i = 0; i < PATCHES; i++)
        if (centres[i].x >= box[0] && centres[i].y >= box[1] && centres[i].x <= box[2] &&
            centres[i].y <= box[3]) {
            int32_t best = 0, least = INT32_MAX;

            for (int32_t w = 0; w < WORDS; w++) {
                int32_t sum = 0;

                for (int32_t k = 0; k < CAIRN_APPEARANCE_DESCRIPTOR_SIZE; k++) {
                    int32_t d = dictionary[w * CAIRN_APPEARANCE_DESCRIPTOR_SIZE + k] -
                                descriptors[i * CAIRN_APPEARANCE_DESCRIPTOR_SIZE + k];

                    sum += d * d;
                }
                if (sum < least) {
                    least = sum;
                    best = w;
                }
            }
            histogram[best]++;
            result.patch_count++;
        }
    if (result.patch_count == 0)
        return result;
    cairn_appearance_normalize(histogram, WORDS);
    result.probability = cairn_appearance_histogram_probability(model, histogram);
    for (int32_t i = 0; i < SUPPORT; i++)
        if (model->weights[i] > 0)
            smallest = fmin(
                smallest, (double)cairn_appearance_chi2(&histograms[i * WORDS], histogram, WORDS));
    result.distance = (cairn_real)(smallest / 2);
    return result;
}

static void scores_boxes_as_the_definitions_say(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000, CAIRN_UNBOUNDED};
    static const cairn_real boxes[][4] = {
        {0, 0, SIDE, SIDE}, {10, 20, 60, 50}, {30, 30, 31, 31}, {-20, -20, -10, -10}};
    cairn_pool pool;
    scorer s = make_scorer(&pool);

    (void)state;
    for (size_t b = 0; b < sizeof budgets / sizeof *budgets; b++) {
        int32_t largest = 0;

        assert_ok(cairn_appearance_begin(s.field, &s.model, &patches));
        assert_near(cairn_appearance_read(s.field).probability, 0.5, 0);
        assert_ok(step_all(s.field, budgets[b], &largest));
        for (size_t i = 0; i < sizeof boxes / sizeof *boxes; i++) {
            cairn_appearance_result expected = slow_scores(&s.model, boxes[i]), got;

            assert_ok(cairn_appearance_begin_box(s.field, boxes[i]));
            assert_ok(step_all(s.field, budgets[b], &largest));
            got = cairn_appearance_read(s.field);
            assert_int_equal(got.patch_count, expected.patch_count);
            assert_near(got.probability, expected.probability, 0);
            assert_near(got.distance, expected.distance, 0);
        }
        assert_true(largest <= budgets[b]);
    }
    assert_int_equal(slow_scores(&s.model, boxes[3]).patch_count, 0);
    assert_true(slow_scores(&s.model, boxes[1]).patch_count > 10);
    test_pool_free(&pool);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_appearance_params params = {.max_patches = 20, .max_words = 5};
    cairn_appearance_field *field;

    (void)context;
    return cairn_appearance_create(&field, pool, &params);
}

static void takes_the_memory_it_says(void **state)
{
    cairn_appearance_params params = {.max_patches = 20, .max_words = 5};

    (void)state;
    test_every_pool_size(create, NULL, cairn_appearance_memory(&params));
}

static void refuses_bad_images_and_boxes(void **state)
{
    cairn_real box[4] = {0, 0, SIDE, SIDE};
    cairn_appearance_patches bad = patches;
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_pool pool;
    scorer s = make_scorer(&pool);
    cairn_vec2 kept = centres[3];

    (void)state;
    assert_status(cairn_appearance_begin_box(s.field, box), CAIRN_EMPTY);
    assert_status(cairn_appearance_begin(NULL, &s.model, &patches), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_appearance_begin(s.field, NULL, &patches), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_appearance_begin(s.field, &s.model, NULL), CAIRN_BAD_ARGUMENT);
    bad.count = -1;
    assert_status(cairn_appearance_begin(s.field, &s.model, &bad), CAIRN_BAD_ARGUMENT);
    bad.count = PATCHES + 1;
    assert_status(cairn_appearance_begin(s.field, &s.model, &bad), CAIRN_FULL);
    bad = patches;
    bad.centres = NULL;
    assert_status(cairn_appearance_begin(s.field, &s.model, &bad), CAIRN_BAD_ARGUMENT);
    bad.count = 1;
    assert_status(cairn_appearance_begin(s.field, &s.model, &bad), CAIRN_BAD_ARGUMENT);
    s.model.word_count = WORDS + 1;
    assert_status(cairn_appearance_begin(s.field, &s.model, &patches), CAIRN_FULL);
    s.model.word_count = WORDS;
    centres[3].y = (cairn_real)NAN;
    assert_status(cairn_appearance_begin(s.field, &s.model, &patches), CAIRN_NOT_FINITE);
    centres[3] = kept;
    assert_status(cairn_appearance_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_appearance_step(s.field, NULL), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_appearance_step(s.field, &budget)); /* nothing was begun */
    assert_ok(cairn_appearance_begin(s.field, &s.model, &patches));
    assert_status(cairn_appearance_begin_box(s.field, box), CAIRN_EMPTY); /* not complete */
    assert_ok(cairn_appearance_step(s.field, &budget));
    assert_status(cairn_appearance_begin_box(s.field, NULL), CAIRN_BAD_ARGUMENT);
    for (int32_t k = 0; k < 4; k++) {
        cairn_real wrong[4] = {0, 0, SIDE, SIDE};

        wrong[k] = (cairn_real)(k % 2 == 0 ? INFINITY : NAN);
        assert_status(cairn_appearance_begin_box(s.field, wrong), CAIRN_NOT_FINITE);
    }
    /* An image without patches. */
    bad.count = 0;
    assert_ok(cairn_appearance_begin(s.field, &s.model, &bad));
    assert_ok(cairn_appearance_step(s.field, &budget));
    assert_ok(cairn_appearance_begin_box(s.field, box));
    assert_ok(cairn_appearance_step(s.field, &budget));
    assert_near(cairn_appearance_read(s.field).probability, 0.5, 0);
    assert_near(cairn_appearance_read(s.field).distance, 1, 0);
    test_pool_free(&pool);
}

static void checks_models(void **state)
{
    cairn_appearance_model good = make_random(), bad;
    cairn_fault fault;

    (void)state;
    assert_ok(cairn_appearance_model_check(&good, &fault));
    assert_fault(&fault, cairn_appearance_model_check(NULL, &fault), CAIRN_BAD_ARGUMENT, -1);
    for (int k = 0; k < 5; k++) {
        bad = good;
        bad.word_count = k == 0 ? 1 : k == 1 ? CAIRN_APPEARANCE_MAX_WORDS + 1 : WORDS;
        bad.support_count = k == 2   ? 0
                            : k == 3 ? CAIRN_APPEARANCE_MAX_SUPPORT_VECTORS + 1
                                     : SUPPORT;
        bad.words = k == 4 ? NULL : dictionary;
        assert_fault(&fault, cairn_appearance_model_check(&bad, &fault), CAIRN_BAD_ARGUMENT, -1);
    }
    bad = good;
    bad.gamma = 0;
    assert_fault(&fault, cairn_appearance_model_check(&bad, &fault), CAIRN_BAD_ARGUMENT, -1);
    bad.gamma = (cairn_real)NAN;
    assert_fault(&fault, cairn_appearance_model_check(&bad, &fault), CAIRN_NOT_FINITE, -1);
    weights[4] = (cairn_real)INFINITY;
    assert_fault(&fault, cairn_appearance_model_check(&good, &fault), CAIRN_NOT_FINITE, 4);
    weights[4] = 1;
    histograms[2 * WORDS + 1] = -0.5F;
    assert_fault(&fault, cairn_appearance_model_check(&good, &fault), CAIRN_BAD_ARGUMENT, 2);
    histograms[2 * WORDS + 1] = (float)NAN;
    assert_fault(&fault, cairn_appearance_model_check(&good, &fault), CAIRN_BAD_ARGUMENT, 2);
    histograms[0] = 1.5F;
    assert_fault(&fault, cairn_appearance_model_check(&good, &fault), CAIRN_BAD_ARGUMENT, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scores_histograms),
        cmocka_unit_test(normalizes_histograms),
        cmocka_unit_test(finds_the_nearest_word),
        cmocka_unit_test(scores_boxes_as_the_definitions_say),
        cmocka_unit_test(takes_the_memory_it_says),
        cmocka_unit_test(refuses_bad_images_and_boxes),
        cmocka_unit_test(checks_models),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
