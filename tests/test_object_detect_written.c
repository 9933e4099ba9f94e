/* Shapes detected by parts as written: the parts of a hypothesis, its box and score; empty input,
 * very much input, a single fragment. */
#include "tests/flag_picture.h"

#include "cairn/object_detect_run.h"
#include "cairn/contour_search_run.h"
#include "cairn/part_bundle.h"
#include "tests/detection_tools.h"

/* The bounding box of all lines of the chains of the parts. */
static void assert_box(const cairn_contour_search_tokens *tokens,
                       const cairn_object_detections *found, const cairn_object_detection *d)
{
    cairn_box box = cairn_box_empty();
    int32_t lines = 0;

    for (int32_t i = 0; i < tokens->count; i++)
        for (int32_t k = 0; k < d->part_count; k++)
            if (tokens->chain[i] == found->parts[d->first_part + k].chain) {
                box =
                    cairn_box_extend(cairn_box_extend(box, tokens->lines[i].a), tokens->lines[i].b);
                lines++;
            }
    assert_int_equal(d->segment_count, lines);
    /* Ends of lines are joined halfway. */
    assert_near(d->left, box.min.x, 3);
    assert_near(d->top, box.min.y, 3);
    assert_near(d->right, box.max.x, 3);
    assert_near(d->bottom, box.max.y, 3);
}

/* One fragment of a bundle, one to one with chains; only the distance of shapes counts. */
static void assert_hypothesis(const cairn_contour_search_tokens *tokens,
                              const cairn_object_detections *found, const cairn_object_detection *d)
{
    uint32_t bundles = 0;
    double sum = 0;

    assert_near(d->score, 1 - (double)d->shape_distance, 1e-6);
    assert_near(d->rigid_evidence, 0, 0);
    assert_near(d->deformed_evidence, 0, 0);
    assert_near(d->grouped_evidence, 0, 0);
    assert_true(d->part_count >= 1);
    assert_in_range(d->first_part + d->part_count, d->part_count, found->part_count);
    for (int32_t i = 0; i < d->part_count; i++) {
        const cairn_object_detect_part *p = &found->parts[d->first_part + i];

        assert_in_range(p->bundle, 0, found->bundle_count - 1);
        assert_false(bundles >> p->bundle & 1);
        bundles |= UINT32_C(1) << p->bundle;
        sum += (double)p->similarity;
        for (int32_t k = 0; k < i; k++)
            assert_int_not_equal(p->chain, found->parts[d->first_part + k].chain);
    }
    assert_near(d->configuration_score, sum, 1e-5);
    assert_box(tokens, found, d);
}

/* The model's outline at the place of the hypothesis; no segment is matched to it. */
static void assert_outline(const cairn_shape_model *model, const cairn_object_detections *found,
                           const cairn_object_detection *d)
{
    assert_int_equal(d->outline_count, model->outline_count);
    assert_in_range(d->first_outline + d->outline_count, d->outline_count, found->outline_count);
    for (int32_t i = 0; i < d->outline_count; i++) {
        const cairn_contour_search_place *place = &found->outline[d->first_outline + i];
        const cairn_oriented_point *sample = &model->outline[i];
        cairn_real side = d->mirrored ? -1 : 1;

        assert_near(place->point.position.x, d->origin.x + side * d->size * sample->position.x,
                    NUMBER(1e-9, 1e-3));
        assert_near(place->point.position.y, d->origin.y + d->size * sample->position.y,
                    NUMBER(1e-9, 1e-3));
        assert_near(place->point.direction.x, side * sample->direction.x, 0);
        assert_near(place->point.direction.y, sample->direction.y, 0);
        assert_int_equal(place->segment, -1);
    }
}

static cairn_object_detections detect(const cairn_contour_search_tokens *tokens,
                                      const cairn_object_detect_params *params)
{
    cairn_shape_model_file model = make_model();
    cairn_object_detections found = detect_flag(tokens, params);

    for (int32_t i = 0; i < found.count; i++) {
        assert_hypothesis(tokens, &found, &found.found[i]);
        assert_outline(&model.model, &found, &found.found[i]);
    }
    cairn_shape_model_file_free(&model);
    return found;
}

static cairn_object_detect_params written_params(void)
{
    cairn_object_detect_params params = cairn_object_detect_as_written(WIDTH, HEIGHT);

    params.min_score = -10;
    return params;
}

/* Whole or with a side hidden: its chains are the hypothesis, and the box is about them. */
static void finds_a_shape(void **state)
{
    (void)state;
    for (int32_t k = 0; k < FLAG_CASES; k++) {
        flag_case upright = flag_cases[k];
        cairn_object_detect_params params = written_params();
        cairn_contour_search_tokens tokens;
        cairn_object_detections found;

        upright.mirrored = 0;
        tokens = case_tokens(&upright, 0);
        found = detect(&tokens, &params);
        assert_found(&found, &upright, 0.85);
        assert_true(found.found[0].shape_distance <
                    (upright.hidden < 0 ? CAIRN_REAL(0.3) : CAIRN_REAL(0.8)));
        cairn_object_detect_run_free(&found);
        cairn_contour_search_run_free_tokens(&tokens);
    }
}

/* The thesis has no mirror images: a mirrored shape is worse than an upright one. */
static void searches_no_mirror_image(void **state)
{
    cairn_object_detect_params params = written_params();
    cairn_real best[2];

    (void)state;
    for (int32_t mirrored = 0; mirrored < 2; mirrored++) {
        cairn_contour_search_tokens tokens = flag_tokens(0, 110, 40, 1, mirrored);
        cairn_object_detections found = detect(&tokens, &params);

        for (int32_t i = 0; i < found.count; i++)
            assert_int_equal(found.found[i].mirrored, 0);
        assert_true(found.count > 0);
        best[mirrored] = found.found[0].shape_distance;
        cairn_object_detect_run_free(&found);
        cairn_contour_search_run_free_tokens(&tokens);
    }
    assert_true(best[1] > 2 * best[0]);
}

/* No chain, many chains, more near votes than there are, every match. */
static void is_bounded(void **state)
{
    cairn_object_detect_params params = written_params();
    cairn_contour_search_tokens tokens;
    cairn_object_detections found;

    (void)state;
    assert_nothing_without_edges(detect, &params);
    tokens = flag_tokens(12, 110, 40, 1, 0);
    found = detect(&tokens, &params);
    assert_in_range(found.count, 1, OBJECT_DETECT_MAX_WRITTEN_HYPOTHESES);
    assert_true(found.part_count <= OBJECT_DETECT_MAX_WRITTEN_HYPOTHESES * CAIRN_PART_MAX_BUNDLES);
    cairn_object_detect_run_free(&found);
    params.nearest = 64;
    found = detect(&tokens, &params);
    assert_true(found.count >= 1);
    cairn_object_detect_run_free(&found);
    cairn_contour_search_run_free_tokens(&tokens);
}

/* Sets of chains in any order: each is new once, compared with all before it. */
static void takes_each_set_once(void **state)
{
    enum { SETS = 600, CHAINS = 7 };
    static cairn_object_detect_part parts[SETS][CAIRN_PART_MAX_BUNDLES];
    static uint32_t bits[SETS];
    cairn_random random = cairn_random_seed(9, 5);
    enum { SLOTS = 2048 };
    static int32_t set_chains[SETS][CAIRN_PART_MAX_BUNDLES], slots[SLOTS];
    object_detect_chain_sets sets = {.chains = set_chains, .slots = slots, .mask = SLOTS - 1};
    int32_t count[SETS], all = 0;

    (void)state;
    cairn_object_detect_chain_sets_clear(&sets);
    for (int32_t i = 0; i < SETS; i++) {
        int32_t is_new = 1;

        for (count[i] = 0; count[i] < 4;) {
            int32_t chain = cairn_random_below(&random, CHAINS);

            if (bits[i] >> chain & 1)
                break;
            bits[i] |= UINT32_C(1) << chain;
            parts[i][count[i]++].chain = 1000 * chain;
        }
        for (int32_t k = 0; k < i; k++)
            is_new &= bits[k] != bits[i];
        all += is_new;
        assert_int_equal(cairn_object_detect_chain_sets_add(&sets, parts[i], count[i]), is_new);
        assert_int_equal(sets.count, all);
    }
    assert_in_range(all, 20, SETS / 2);
}

/* A model of one fragment, made by hand: a configuration is one chain. */
static void takes_one_fragment(void **state)
{
    static const cairn_part_bundle_cut cut = {0, 20, 0};
    cairn_object_detect_params params = written_params();
    cairn_shape_model_file model = make_model();
    cairn_contour_search_tokens tokens;
    cairn_object_detect_run_image *field;
    cairn_object_detections found;

    (void)state;
    tokens = flag_tokens(0, 110, 40, 1, 0);
    params.cuts = &cut;
    params.cut_count = 1;
    assert_ok(cairn_object_detect_run_make(&field, &tokens, &params, "edges", &error));
    assert_ok(cairn_object_detect_run(&found, field, &model.model, "edges", &error));
    assert_int_equal(found.bundle_count, 1);
    for (int32_t i = 0; i < found.count; i++)
        assert_int_equal(found.found[i].part_count, 1);
    cairn_object_detect_run_free(&found);
    cairn_object_detect_run_free_image(field);
    cairn_contour_search_run_free_tokens(&tokens);
    cairn_shape_model_file_free(&model);
}

static void reports_its_stages(void **state)
{
    cairn_object_detect_params params = written_params();
    char heard[16] = "";
    cairn_contour_search_tokens tokens;
    cairn_object_detections found;

    (void)state;
    tokens = flag_tokens(0, 110, 40, 1, 0);
    params.on_stage = hear_stage;
    params.on_stage_context = heard;
    found = detect(&tokens, &params);
    assert_string_equal(heard, "012");
    cairn_object_detect_run_free(&found);
    cairn_contour_search_run_free_tokens(&tokens);
}

/* Options that the thesis does not have. */
static void refuses_other_methods(void **state)
{
    static const char *const what[] = {
        "mode is 2, expected 0 to 1",
        "mode is -1, expected 0 to 1",
        "expected mode: as written method PARTS with BUNDLES",
        "expected mode: as written method PARTS with BUNDLES",
        "expected mode: as written mirror, modes_only, occluded and verify 0",
        "expected mode: as written mirror, modes_only, occluded and verify 0",
        "expected mode: as written mirror, modes_only, occluded and verify 0",
        "expected mode: as written mirror, modes_only, occluded and verify 0",
        "appearance_nearest is 2, expected 0 to 1",
        "expected appearance_nearest: 1 as written only"};
    enum { BAD_CASES = sizeof what / sizeof *what };
    cairn_object_detect_params bad[BAD_CASES];
    cairn_contour_search_tokens tokens = {.width = WIDTH, .height = HEIGHT};
    cairn_object_detect_run_image *field;

    (void)state;
    for (int i = 0; i < BAD_CASES; i++)
        bad[i] = written_params();
    bad[0].mode = 2;
    bad[1].mode = -1;
    bad[2].method = CAIRN_OBJECT_DETECT_EVIDENCE;
    bad[3].bundles = CAIRN_OBJECT_DETECT_NO_BUNDLES;
    bad[4].mirror = 1;
    bad[5].modes_only = 1;
    bad[6].occluded = 1;
    bad[7].verify = 1;
    bad[8].appearance_nearest = 2;
    bad[9] = cairn_object_detect_default(WIDTH, HEIGHT);
    bad[9].appearance_nearest = 1;
    for (int i = 0; i < BAD_CASES; i++) {
        assert_status(cairn_object_detect_run_make(&field, &tokens, &bad[i], "edges", &error),
                      CAIRN_BAD_ARGUMENT);
        assert_error_holds(what[i]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(finds_a_shape),
        cmocka_unit_test(searches_no_mirror_image),
        cmocka_unit_test(is_bounded),
        cmocka_unit_test(takes_each_set_once),
        cmocka_unit_test(takes_one_fragment),
        cmocka_unit_test(reports_its_stages),
        cmocka_unit_test(refuses_other_methods),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
