/* Shapes detected by configurations of parts: their places, their parts, each way of bundling;
 * images with nothing and with edges everywhere. */
#include "tests/flag_picture.h"

#include "cairn/object_detect_run.h"
#include "cairn/contour_search_run.h"
#include "cairn/part_bundle.h"
#include "tests/detection_tools.h"

static cairn_object_detect_params parts_params(void)
{
    cairn_object_detect_params params = cairn_object_detect_default(WIDTH, HEIGHT);

    params.method = CAIRN_OBJECT_DETECT_PARTS;
    return params;
}

static cairn_real length_of_chain(const cairn_contour_search_tokens *tokens, int32_t chain)
{
    cairn_real length = 0;

    for (int32_t i = 0; i < tokens->count; i++)
        length += tokens->chain[i] == chain ? cairn_segment_length(tokens->lines[i]) : 0;
    return length;
}

/* Every part is a fragment along a chain; at most one of each bundle. */
static void assert_configuration(const cairn_contour_search_tokens *tokens,
                                 const cairn_object_detect_params *params,
                                 const cairn_object_detections *found,
                                 const cairn_object_detection *d)
{
    uint32_t bundles = 0, fragments = 0;

    assert_near(d->score, 1 - (double)d->shape_distance, 1e-6);
    assert_true(d->configuration_score > 0);
    assert_near(d->rigid_evidence, 0, 0);
    assert_true(d->part_count >= 2);
    assert_in_range(d->first_part + d->part_count, d->part_count, found->part_count);
    for (int32_t i = 0; i < d->part_count; i++) {
        const cairn_object_detect_part *p = &found->parts[d->first_part + i];

        assert_in_range(p->bundle, 0, found->bundle_count - 1);
        assert_in_range(p->fragment, 0, 31);
        assert_in_range(p->chain, 0, tokens->chain_count - 1);
        assert_true(p->similarity >= CAIRN_REAL(0.5) && p->similarity <= 1);
        assert_true(p->from >= 0 && p->to > p->from &&
                    p->to <= 3 * length_of_chain(tokens, p->chain));
        assert_false(fragments >> p->fragment & 1);
        if (params->bundles != CAIRN_OBJECT_DETECT_NO_BUNDLES)
            assert_false(bundles >> p->bundle & 1);
        fragments |= UINT32_C(1) << p->fragment;
        bundles |= UINT32_C(1) << p->bundle;
    }
}

static cairn_object_detections detect(const cairn_contour_search_tokens *tokens,
                                      const cairn_object_detect_params *params)
{
    cairn_object_detections found = detect_flag(tokens, params);

    assert_int_equal(found.bundle_count, 4);
    for (int32_t i = 0; i < found.count; i++)
        assert_configuration(tokens, params, &found, &found.found[i]);
    return found;
}

static void finds_a_shape_by_its_parts(void **state)
{
    (void)state;
    for (int32_t i = 0; i < 2 * FLAG_CASES; i++) {
        cairn_object_detect_params params = parts_params();
        cairn_contour_search_tokens tokens = case_tokens(&flag_cases[i / 2], i % 2 ? 10 : 0);
        cairn_object_detections found = detect(&tokens, &params);

        assert_found(&found, &flag_cases[i / 2], 0.7);
        cairn_object_detect_run_free(&found);
        cairn_contour_search_run_free_tokens(&tokens);
    }
}

/* However the fragments are bundled and votes searched, a shape by itself is found. */
static void finds_it_by_every_way(void **state)
{
    (void)state;
    clear_picture();
    draw_flag(110, 40, 1, 0);
    for (int32_t way = 0; way < 6; way++) {
        cairn_object_detect_params params = parts_params();
        cairn_contour_search_tokens tokens = find_tokens(0);
        cairn_object_detections found;

        params.bundles = way < 3 ? way : CAIRN_OBJECT_DETECT_BUNDLES;
        params.modes_only = way == 3;
        params.nearest = way == 4 ? 5 : 20;
        params.matches = way == 5 ? 20 : 2;
        found = detect(&tokens, &params);
        assert_true(found.count >= 1);
        assert_true(share_of(&found.found[0], 110, 40, 1, 0) > 0.7);
        cairn_object_detect_run_free(&found);
        cairn_contour_search_run_free_tokens(&tokens);
    }
}

/* Chains run through the tokens' segments; a round one is closed. */
static void follows_chains(void **state)
{
    cairn_contour_search_tokens tokens;
    cairn_object_detect_params params = parts_params();
    const object_detect_chains *chains;
    cairn_pool pool;
    int32_t closed = 0;

    (void)state;
    clear_picture();
    draw_flag(20, 40, 1, 0);
    draw_line(150, 20, 250, 60);
    tokens = find_tokens(0);
    chains = &field_of(&pool, &tokens, &params)->chains;
    assert_int_equal(chains->count, tokens.chain_count);
    for (int32_t i = 0; i < chains->count; i++) {
        cairn_real length = cairn_curve_length(&chains->curves[i]);

        closed += chains->curves[i].closed;
        assert_near(length, length_of_chain(&tokens, i), 6 + 0.02 * (double)length);
    }
    assert_int_equal(closed, 1);
    test_pool_free(&pool);
    cairn_contour_search_run_free_tokens(&tokens);
}

static void accepts_unusual_images(void **state)
{
    cairn_object_detect_params params = parts_params();
    cairn_contour_search_tokens tokens;
    cairn_object_detections found;

    (void)state;
    assert_nothing_without_edges(detect, &params);
    /* None of them is as long as half a fragment. */
    draw_edges_everywhere();
    tokens = find_tokens(0);
    assert_true(tokens.count > 1000);
    found = detect(&tokens, &params);
    assert_int_equal(found.count, 0);
    cairn_object_detect_run_free(&found);
    cairn_contour_search_run_free_tokens(&tokens);
}

static void reports_its_stages(void **state)
{
    static const char *const expected[] = {"012", "0010122"};

    (void)state;
    for (int32_t way = 0; way < 2; way++) {
        cairn_object_detect_params params = parts_params();
        cairn_contour_search_tokens tokens = flag_tokens(0, 110, 40, 1, 0);
        char heard[16] = "";
        cairn_object_detections found;

        params.method = way;
        params.on_stage = hear_stage;
        params.on_stage_context = heard;
        found = detect_flag(&tokens, &params);
        assert_string_equal(heard, expected[way]);
        cairn_object_detect_run_free(&found);
        cairn_contour_search_run_free_tokens(&tokens);
    }
}

/* Ten thousand chains of an image without any object, by both methods: results are bounded. */
static void takes_very_many_chains(void **state)
{
    enum { CHAINS = 10000, SIDE = 1600 };
    cairn_random random = cairn_random_seed(4, 4);
    cairn_shape_model_file model = make_model();
    cairn_contour_search_tokens tokens = {
        .width = SIDE, .height = SIDE, .count = CHAINS, .chain_count = CHAINS, .mean_length = 15};

    (void)state;
    tokens.lines = malloc(CHAINS * sizeof *tokens.lines);
    tokens.chain = malloc(CHAINS * sizeof *tokens.chain);
    tokens.strength_rank = malloc(CHAINS * sizeof *tokens.strength_rank);
    assert_non_null(tokens.lines);
    assert_non_null(tokens.chain);
    assert_non_null(tokens.strength_rank);
    for (int32_t i = 0; i < CHAINS; i++) {
        cairn_real x = cairn_random_uniform(&random, 30, SIDE - 30),
                   y = cairn_random_uniform(&random, 30, SIDE - 30);

        tokens.lines[i].a.x = x;
        tokens.lines[i].a.y = y;
        tokens.lines[i].b.x = x + cairn_random_uniform(&random, -20, 20);
        tokens.lines[i].b.y = y + cairn_random_uniform(&random, -20, 20);
        tokens.chain[i] = i;
        tokens.strength_rank[i] = CAIRN_REAL(0.5);
    }
    for (int32_t way = 0; way < 2; way++) {
        cairn_object_detect_params params = cairn_object_detect_default(SIDE, SIDE);
        cairn_object_detect_run_image *field;
        cairn_object_detections found;

        params.candidates = 2;
        params.min_size = 250;
        params.max_size = 300;
        params.method = way;
        assert_ok(cairn_object_detect_run_make(&field, &tokens, &params, "edges", &error));
        assert_ok(cairn_object_detect_run(&found, field, &model.model, "edges", &error));
        assert_in_range(found.count, 0, params.candidates);
        cairn_object_detect_run_free(&found);
        cairn_object_detect_run_free_image(field);
    }
    cairn_contour_search_run_free_tokens(&tokens);
    cairn_shape_model_file_free(&model);
}

static void refuses_what_cannot_be(void **state)
{
    static const char *const what[] = {"method is 2, expected 0 to 1",
                                       "method is -1, expected 0 to 1",
                                       "bundles is 3, expected 0 to 2",
                                       "matches is 0, expected 1 to 64",
                                       "matches is 65, expected 1 to 64",
                                       "nearest is 0, expected 1 to 64",
                                       "nearest is 65, expected 1 to 64",
                                       "appearance_weight is -1, expected 0 to 1000",
                                       "appearance_weight is 1001, expected 0 to 1000"};
    enum { BAD_CASES = sizeof what / sizeof *what };
    cairn_object_detect_params good = parts_params(), bad[BAD_CASES];
    cairn_shape_model_file model = make_model();
    int32_t full = model.model.outline_count;
    cairn_contour_search_tokens tokens = {.width = WIDTH, .height = HEIGHT};
    cairn_object_detect_run_image *field;
    cairn_object_detections found;

    (void)state;
    for (int i = 0; i < BAD_CASES; i++)
        bad[i] = good;
    bad[0].method = 2;
    bad[1].method = -1;
    bad[2].bundles = 3;
    bad[3].matches = 0;
    bad[4].matches = 65;
    bad[5].nearest = 0;
    bad[6].nearest = 65;
    bad[7].appearance_weight = -1;
    bad[8].appearance_weight = 1001;
    for (int i = 0; i < BAD_CASES; i++) {
        assert_status(cairn_object_detect_run_make(&field, &tokens, &bad[i], "edges", &error),
                      CAIRN_BAD_ARGUMENT);
        assert_error_holds(what[i]);
    }
    /* One vertex is no outline. */
    assert_ok(cairn_object_detect_run_make(&field, &tokens, &good, "edges", &error));
    model.model.outline_count = 1;
    assert_status(cairn_object_detect_run(&found, field, &model.model, "edges", &error),
                  CAIRN_BAD_ARGUMENT);
    assert_non_null(strstr(error.text, "expected"));
    assert_null(found.found);
    model.model.outline_count = full;
    cairn_object_detect_run_free_image(field);
    /* An outline of zero length is none. */
    assert_ok(cairn_object_detect_run_make(&field, &tokens, &good, "edges", &error));
    for (int32_t i = 0; i < model.model.outline_count; i++)
        model.outline[i].position = model.outline[0].position;
    assert_status(cairn_object_detect_run(&found, field, &model.model, "edges", &error),
                  CAIRN_BAD_ARGUMENT);
    assert_null(found.found);
    cairn_object_detect_run_free_image(field);
    cairn_shape_model_file_free(&model);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(finds_a_shape_by_its_parts),
        cmocka_unit_test(finds_it_by_every_way),
        cmocka_unit_test(follows_chains),
        cmocka_unit_test(accepts_unusual_images),
        cmocka_unit_test(reports_its_stages),
        cmocka_unit_test(takes_very_many_chains),
        cmocka_unit_test(refuses_what_cannot_be),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
