/* The detector as a stepped object on a pool: the same bits whatever the budgets, bounded steps,
 * exact memory; what field and detector refuse. */
#include "tests/flag_picture.h"

enum { METHODS = 4 };

/* Methods: template matching, of occluded objects, by parts, as written. */
static cairn_object_detect_params params_of(int32_t method, const cairn_shape_model *model,
                                            const cairn_contour_search_tokens *tokens)
{
    cairn_object_detect_params params = method == 3 ? cairn_object_detect_as_written(WIDTH, HEIGHT)
                                                    : cairn_object_detect_default(WIDTH, HEIGHT);

    params.min_size = 110;
    params.max_size = 180;
    params.min_score = -100;
    params.candidates = 3;
    params.occluded = method == 1;
    params.verify = method == 1 ? params.verify : 0;
    if (method == 2)
        params.method = CAIRN_OBJECT_DETECT_PARTS;
    params.max_segments = tokens->count;
    params.max_tokens = 600;
    params.max_samples = model->sample_count;
    params.max_outline = model->outline_count;
    params.max_chains = tokens->chain_count;
    params.max_chain_length = 1000;
    params.max_peaks = 4096;
    params.max_detections = 64;
    return params;
}

static cairn_contour_search_tokens scene(void)
{
    return flag_tokens(20, 110, 40, 1, 0);
}

typedef struct detected {
    uint64_t hash;
    int64_t units;
    int32_t count, most;
} detected;

static void note_units(detected *made, int32_t units, const cairn_budget *budget)
{
    made->most = units - budget->left > made->most ? units - budget->left : made->most;
    made->units += units - budget->left;
}

/* Numbers, segments, outline and parts of a detection. */
static uint64_t add_detection(uint64_t hash, const cairn_object_detections *found,
                              const cairn_object_detection *d)
{
    const cairn_real numbers[] = {d->left,
                                  d->top,
                                  d->right,
                                  d->bottom,
                                  d->score,
                                  d->rigid_evidence,
                                  d->deformed_evidence,
                                  d->outline_coverage,
                                  d->edge_proximity,
                                  d->tangent_deviation,
                                  d->deformation,
                                  d->rigid_proximity,
                                  d->grouped_evidence,
                                  d->origin.x,
                                  d->origin.y,
                                  d->size,
                                  d->shape_distance,
                                  d->configuration_score};
    const int32_t counts[] = {d->mirrored, d->segment_count, d->outline_count, d->part_count};

    hash = test_hash(test_hash(hash, numbers, sizeof numbers), counts, sizeof counts);
    hash = test_hash(hash, &found->segments[d->first_segment],
                     (size_t)d->segment_count * sizeof *found->segments);
    for (int32_t i = 0; i < d->outline_count; i++) {
        const cairn_contour_search_place *at = &found->outline[d->first_outline + i];
        const int32_t place[] = {at->segment, at->outline_index};

        hash = test_hash(test_hash(hash, &at->point, sizeof at->point), place, sizeof place);
    }
    for (int32_t i = 0; i < d->part_count; i++)
        hash = test_hash(hash, &found->parts[d->first_part + i], sizeof *found->parts);
    return hash;
}

static detected detect_all(cairn_object_detect_field *field, cairn_object_detector *detector,
                           const cairn_contour_search_tokens *tokens,
                           const cairn_shape_model *model, int32_t units)
{
    detected made = {TEST_HASH_START, 0, 0, 0};
    cairn_object_detections found;
    cairn_status status;

    assert_ok(cairn_object_detect_field_begin(field, tokens, NULL));
    do {
        cairn_budget budget = {units};

        status = cairn_object_detect_field_step(field, &budget);
        note_units(&made, units, &budget);
    } while (status == CAIRN_MORE);
    assert_ok(status);
    assert_true(made.most <= units); /* the field charges every operation before it is done */
    assert_ok(cairn_object_detect_begin(detector, field, model, NULL));
    assert_int_equal(cairn_object_detect_read(detector).count, 0);
    do {
        cairn_budget budget = {units};

        status = cairn_object_detect_step(detector, &budget);
        note_units(&made, units, &budget);
    } while (status == CAIRN_MORE);
    assert_ok(status);
    found = cairn_object_detect_read(detector);
    made.count = found.count;
    for (int32_t i = 0; i < found.count; i++)
        made.hash = add_detection(made.hash, &found, &found.found[i]);
    return made;
}

static void detects_the_same_bits_with_any_budget(void **state)
{
    static const int32_t budgets[] = {CAIRN_UNBOUNDED, 20000, 1000, 50};
    static const uint64_t known[METHODS][2] = {
        {UINT64_C(0x7afc6d2453fc9326), UINT64_C(0xe63cb37d1a303efc)},
        {UINT64_C(0x06303e9ba182ea87), UINT64_C(0x0473993e8234c9c2)},
        {UINT64_C(0xeadf09c78021e72c), UINT64_C(0x002191305adac2fc)},
        {UINT64_C(0x00edaa255df24f3a), UINT64_C(0xa01283a173180509)}};
    cairn_shape_model_file model = make_model();
    cairn_contour_search_tokens tokens = scene();

    (void)state;
    for (int32_t method = 0; method < METHODS; method++) {
        cairn_object_detect_params params = params_of(method, &model.model, &tokens);
        cairn_pool field_pool = test_pool(cairn_object_detect_field_memory(&params)),
                   pool = test_pool(cairn_object_detect_memory(&params));
        cairn_object_detect_field *field;
        cairn_object_detector *detector;
        detected first = {0};

        assert_ok(cairn_object_detect_field_create(&field, &field_pool, &params));
        assert_ok(cairn_object_detect_create(&detector, &pool, &params));
        for (size_t b = 0; b < sizeof budgets / sizeof *budgets; b++) {
            detected found = detect_all(field, detector, &tokens, &model.model, budgets[b]);

            assert_true(found.count >= 1);
            assert_true(b == 0 || (found.hash == first.hash && found.units == first.units));
            if (found.most > budgets[b])
                fail_msg("method %d: %d units in a step of %d", method, found.most, budgets[b]);
            first = found;
        }
        first.hash = test_hash(first.hash, &first.units, sizeof first.units);
        assert_golden(first.hash, known[method][0], known[method][1]);
        test_pool_free(&pool);
        test_pool_free(&field_pool);
    }
    cairn_contour_search_run_free_tokens(&tokens);
    cairn_shape_model_file_free(&model);
}

static void takes_the_memory_it_says(void **state)
{
    cairn_shape_model_file model = make_model();
    cairn_contour_search_tokens tokens = scene();

    (void)state;
    for (int32_t method = 0; method < METHODS; method++) {
        cairn_object_detect_params params = params_of(method, &model.model, &tokens);
        size_t need = cairn_object_detect_memory(&params),
               field_need = cairn_object_detect_field_memory(&params);
        cairn_pool pool = test_pool(need - CAIRN_ALIGN);
        cairn_object_detect_field *field;
        cairn_object_detector *detector;

        assert_status(cairn_object_detect_create(&detector, &pool, &params), CAIRN_NO_MEMORY);
        assert_int_equal(pool.used, 0);
        test_pool_free(&pool);
        pool = test_pool(need);
        assert_ok(cairn_object_detect_create(&detector, &pool, &params));
        assert_int_equal(pool.used, need);
        test_pool_free(&pool);
        pool = test_pool(field_need - CAIRN_ALIGN);
        assert_status(cairn_object_detect_field_create(&field, &pool, &params), CAIRN_NO_MEMORY);
        assert_int_equal(pool.used, 0);
        test_pool_free(&pool);
        pool = test_pool(field_need);
        assert_ok(cairn_object_detect_field_create(&field, &pool, &params));
        assert_int_equal(pool.used, field_need);
        test_pool_free(&pool);
    }
    cairn_contour_search_run_free_tokens(&tokens);
    cairn_shape_model_file_free(&model);
}

/* Every rule must be refused by its text, by detector and field. */
static void assert_rule(const cairn_object_detect_params *params, const char *rule)
{
    cairn_pool pool = test_pool(1 << 12);
    cairn_object_detect_field *field;
    cairn_object_detector *detector;
    cairn_object_fault fault;

    assert_status(cairn_object_detect_check(params, &fault), CAIRN_BAD_ARGUMENT);
    assert_null(fault.field);
    assert_string_equal(fault.rule, rule);
    assert_int_equal(cairn_object_detect_memory(params), 0);
    assert_int_equal(cairn_object_detect_field_memory(params), 0);
    assert_status(cairn_object_detect_create(&detector, &pool, params), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_object_detect_field_create(&field, &pool, params), CAIRN_BAD_ARGUMENT);
    test_pool_free(&pool);
}

static void params_are_refused_by_the_rules_between_them(void **state)
{
    const cairn_object_detect_params good = cairn_object_detect_default(WIDTH, HEIGHT),
                                     written = cairn_object_detect_as_written(WIDTH, HEIGHT);
    cairn_object_detect_params bad;

    (void)state;
    assert_ok(cairn_object_detect_check(&good, NULL));
    assert_ok(cairn_object_detect_check(&written, NULL));
#define REFUSED(params, change, rule)                                                              \
    bad = params;                                                                                  \
    change;                                                                                        \
    assert_rule(&bad, rule)
    REFUSED(good, bad.max_size = bad.min_size - 1, "max_size: at least min_size");
    REFUSED(good, bad.max_width = 50 * (int32_t)bad.min_size + 51,
            "min_size: at least a fiftieth of max_width and max_height");
    REFUSED(good, bad.max_height = 50 * (int32_t)bad.min_size + 51,
            "min_size: at least a fiftieth of max_width and max_height");
    REFUSED(good, bad.appearance_nearest = 1, "appearance_nearest: 1 as written only");
    REFUSED(good, bad.mode = CAIRN_MODE_AS_WRITTEN, "mode: as written method PARTS with BUNDLES");
    REFUSED(written, bad.bundles = CAIRN_OBJECT_DETECT_NO_BUNDLES,
            "mode: as written method PARTS with BUNDLES");
    REFUSED(written, bad.mirror = 1, "mode: as written mirror, modes_only, occluded and verify 0");
    REFUSED(written, bad.modes_only = 1,
            "mode: as written mirror, modes_only, occluded and verify 0");
    REFUSED(written, bad.occluded = 1,
            "mode: as written mirror, modes_only, occluded and verify 0");
    REFUSED(written, bad.verify = 1, "mode: as written mirror, modes_only, occluded and verify 0");
#undef REFUSED
}

static void refuses_bad_images_and_models(void **state)
{
    cairn_shape_model_file model = make_model();
    cairn_contour_search_tokens tokens = scene(), worse;
    cairn_object_detect_params params = params_of(0, &model.model, &tokens);
    cairn_pool field_pool = test_pool(cairn_object_detect_field_memory(&params)),
               pool = test_pool(cairn_object_detect_memory(&params));
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_shape_model odd = model.model;
    cairn_object_detect_field *field;
    cairn_object_detector *detector;
    cairn_fault fault;

    (void)state;
    assert_ok(cairn_object_detect_field_create(&field, &field_pool, &params));
    assert_ok(cairn_object_detect_create(&detector, &pool, &params));
    assert_status(cairn_object_detect_field_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_object_detect_field_step(field, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_object_detect_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_object_detect_step(detector, NULL), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_object_detect_step(detector, &budget)); /* nothing was begun */
    assert_fault(&fault, cairn_object_detect_field_begin(NULL, &tokens, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    assert_fault(&fault, cairn_object_detect_field_begin(field, NULL, &fault), CAIRN_BAD_ARGUMENT,
                 -1);
    worse = tokens;
    worse.height = HEIGHT + 1;
    assert_fault(&fault, cairn_object_detect_field_begin(field, &worse, &fault), CAIRN_FULL, -1);
    worse = tokens;
    worse.count++;
    assert_fault(&fault, cairn_object_detect_field_begin(field, &worse, &fault), CAIRN_FULL,
                 tokens.count);
    tokens.strength_rank[2] = (cairn_real)NAN;
    assert_fault(&fault, cairn_object_detect_field_begin(field, &tokens, &fault), CAIRN_NOT_FINITE,
                 2);
    tokens.strength_rank[2] = CAIRN_REAL(0.5);
    assert_fault(&fault, cairn_object_detect_begin(detector, field, &model.model, &fault),
                 CAIRN_EMPTY, -1);
    assert_true(detect_all(field, detector, &tokens, &model.model, CAIRN_UNBOUNDED).count >= 1);
    assert_fault(&fault, cairn_object_detect_begin(NULL, field, &model.model, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_object_detect_begin(detector, NULL, &model.model, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_object_detect_begin(detector, field, NULL, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    odd.outline_count = 2;
    assert_fault(&fault, cairn_object_detect_begin(detector, field, &odd, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_true(cairn_object_detect_read(detector).count >= 1); /* the last result stays */
    /* An image without edges. */
    worse = tokens;
    worse.count = 0;
    (void)detect_all(field, detector, &worse, &model.model, 1000);
    test_pool_free(&pool);
    test_pool_free(&field_pool);
    cairn_contour_search_run_free_tokens(&tokens);
    cairn_shape_model_file_free(&model);
}

static void refuses_chains_that_it_has_no_memory_for(void **state)
{
    cairn_shape_model_file model = make_model();
    cairn_contour_search_tokens tokens = scene(), worse = tokens;
    cairn_object_detect_params params = params_of(2, &model.model, &tokens);
    cairn_pool pool = test_pool(cairn_object_detect_field_memory(&params));
    cairn_object_detect_field *field;
    cairn_fault fault;

    (void)state;
    assert_ok(cairn_object_detect_field_create(&field, &pool, &params));
    worse.chain_count++;
    assert_fault(&fault, cairn_object_detect_field_begin(field, &worse, &fault), CAIRN_FULL, -1);
    assert_ok(cairn_object_detect_field_begin(field, &tokens, &fault));
    tokens.chain[1] = tokens.chain_count;
    assert_fault(&fault, cairn_object_detect_field_begin(field, &tokens, &fault),
                 CAIRN_BAD_ARGUMENT, 1);
    test_pool_free(&pool);
    cairn_contour_search_run_free_tokens(&tokens);
    cairn_shape_model_file_free(&model);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(detects_the_same_bits_with_any_budget),
        cmocka_unit_test(takes_the_memory_it_says),
        cmocka_unit_test(params_are_refused_by_the_rules_between_them),
        cmocka_unit_test(refuses_bad_images_and_models),
        cmocka_unit_test(refuses_chains_that_it_has_no_memory_for),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
