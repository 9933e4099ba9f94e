/* The search for known contours as a stepped object on a pool: the same bits whatever the budgets,
 * bounded steps, exact memory; what it refuses. */
#include "tests/flag_picture.h"

#include "cairn/contour_search.h"

enum { MAX_SEGMENTS = 600 };

static cairn_raster_u8_view view(void)
{
    cairn_raster_u8_view whole = {edges, WIDTH, HEIGHT, WIDTH};

    return whole;
}

static cairn_contour_search_tokenizer_params tokenizer_params(void)
{
    cairn_contour_search_tokenizer_params params = cairn_contour_search_tokenizer_default();

    params.max_width = WIDTH;
    params.max_height = HEIGHT;
    params.max_edges = 8000;
    params.max_chains = 400;
    params.max_lines = 1000;
    params.max_segments = MAX_SEGMENTS;
    return params;
}

static cairn_contour_search_params search_params(const cairn_shape_model *model)
{
    cairn_contour_search_params params = cairn_contour_search_default(WIDTH, HEIGHT);

    params.grouping.max_width = WIDTH;
    params.grouping.max_height = HEIGHT;
    params.grouping.max_tokens = 600;
    params.grouping.max_samples = model->sample_count;
    params.grouping.max_outline = model->outline_count;
    params.grouping.particles = 50;
    params.max_segments = MAX_SEGMENTS;
    params.min_size = 100;
    params.max_size = 180;
    return params;
}

static void draw_scene(void)
{
    clear_picture();
    draw_clutter(20);
    draw_flag(60, 40, 1, 0);
}

/* ---- The tokenizer ---- */

static cairn_status tokenize(cairn_contour_search_tokenizer *tokenizer, int32_t units,
                             int32_t *most)
{
    cairn_status status;

    *most = 0;
    do {
        cairn_budget budget = {units};

        status = cairn_contour_search_tokenizer_step(tokenizer, &budget);
        *most = units - budget.left > *most ? units - budget.left : *most;
    } while (status == CAIRN_MORE);
    return status;
}

static uint64_t hash_of_tokens(const cairn_contour_search_tokens *t)
{
    uint64_t hash = test_hash(TEST_HASH_START, t->lines, (size_t)t->count * sizeof *t->lines);

    hash = test_hash(hash, t->chain, (size_t)t->count * sizeof *t->chain);
    hash = test_hash(hash, t->strength_rank, (size_t)t->count * sizeof *t->strength_rank);
    return test_hash(hash, t->ends, (size_t)t->end_count * sizeof *t->ends);
}

static void tokens_do_not_depend_on_budgets(void **state)
{
    static const int32_t budgets[] = {CAIRN_UNBOUNDED, 1000, 7, 1};
    static const uint64_t known[4][2] = {
        {UINT64_C(0x46d2dd51cdc07767), UINT64_C(0xb1e49de60972c554)},
        {UINT64_C(0x9cd8800fefe58d92), UINT64_C(0xe6f5f6d92b870d75)},
        {UINT64_C(0xd5762500fefdab70), UINT64_C(0x5db530ffabf79a58)},
        {UINT64_C(0xb7711b929c67ba77), UINT64_C(0xefebdb25cdc9a375)}};

    (void)state;
    draw_scene();
    for (int32_t kind = 0; kind < 4; kind++) {
        cairn_contour_search_tokenizer_params params = tokenizer_params();
        cairn_contour_search_tokenizer *tokenizer;
        cairn_pool pool;
        uint64_t first = 0;
        int32_t most;

        params.edgels = kind % 2;
        params.max_segments = params.edgels ? 3000 : MAX_SEGMENTS;
        params.mode = kind / 2 ? CAIRN_MODE_AS_WRITTEN : CAIRN_MODE_DEFAULT;
        pool = test_pool(cairn_contour_search_tokenizer_memory(&params));
        assert_ok(cairn_contour_search_tokenizer_create(&tokenizer, &pool, &params));
        assert_int_equal(cairn_contour_search_tokenizer_read(tokenizer).count, 0);
        for (size_t b = 0; b < sizeof budgets / sizeof *budgets; b++) {
            cairn_contour_search_tokens tokens;
            uint64_t hash;

            assert_ok(cairn_contour_search_tokenizer_begin(tokenizer, view()));
            assert_ok(tokenize(tokenizer, budgets[b], &most));
            assert_true(most <= budgets[b] || most < budgets[b] + 100);
            tokens = cairn_contour_search_tokenizer_read(tokenizer);
            assert_in_range(tokens.count, 50, params.max_segments);
            assert_int_equal(tokens.end_count > 0, kind / 2);
            hash = hash_of_tokens(&tokens);
            assert_true(b == 0 || hash == first);
            first = hash;
        }
        assert_golden(first, known[kind][0], known[kind][1]);
        test_pool_free(&pool);
    }
}

static cairn_status create_tokenizer(void *context, cairn_pool *pool)
{
    cairn_contour_search_tokenizer *tokenizer;

    return cairn_contour_search_tokenizer_create(&tokenizer, pool, context);
}

static void the_tokenizer_takes_the_memory_it_says(void **state)
{
    cairn_contour_search_tokenizer_params params = tokenizer_params();

    (void)state;
    params.max_width = params.max_height = 8;
    params.max_edges = params.max_chains = params.max_lines = params.max_segments = 4;
    test_every_pool_size(create_tokenizer, &params, cairn_contour_search_tokenizer_memory(&params));
}

static void the_tokenizer_refuses_what_does_not_fit(void **state)
{
    cairn_contour_search_tokenizer_params good = tokenizer_params();
    cairn_raster_u8_view wide = view(), none = {NULL, 10, 10, 10};
    cairn_contour_search_tokenizer *tokenizer;
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_pool pool;
    int32_t most;

    (void)state;
    pool = test_pool(cairn_contour_search_tokenizer_memory(&good));
    assert_ok(cairn_contour_search_tokenizer_create(&tokenizer, &pool, &good));
    assert_status(cairn_contour_search_tokenizer_begin(NULL, wide), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_contour_search_tokenizer_begin(tokenizer, none), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_contour_search_tokenizer_step(tokenizer, &budget)); /* nothing was begun */
    assert_status(cairn_contour_search_tokenizer_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_contour_search_tokenizer_step(tokenizer, NULL), CAIRN_BAD_ARGUMENT);
    /* An image without edges has no tokens; one with edges everywhere has too many. */
    clear_picture();
    assert_ok(cairn_contour_search_tokenizer_begin(tokenizer, wide));
    assert_ok(tokenize(tokenizer, 1000, &most));
    assert_int_equal(cairn_contour_search_tokenizer_read(tokenizer).count, 0);
    draw_edges_everywhere();
    assert_ok(cairn_contour_search_tokenizer_begin(tokenizer, wide));
    assert_status(tokenize(tokenizer, 1000, &most), CAIRN_FULL);
    assert_int_equal(cairn_contour_search_tokenizer_read(tokenizer).count, 0);
    test_pool_free(&pool);
}

/* ---- The search ---- */

typedef struct searched {
    uint64_t hash;
    int64_t units;
    int32_t objects, most;
} searched;

static searched search_all(cairn_contour_search *search, const cairn_contour_search_tokens *tokens,
                           const cairn_shape_model *model, int32_t units)
{
    searched made = {TEST_HASH_START, 0, 0, 0};
    cairn_contour_search_result r;
    cairn_status status;

    assert_ok(cairn_contour_search_begin(search, tokens, model, NULL));
    assert_int_equal(cairn_contour_search_read(search).object_count, 0);
    do {
        cairn_budget budget = {units};

        status = cairn_contour_search_step(search, &budget);
        made.most = units - budget.left > made.most ? units - budget.left : made.most;
        made.units += units - budget.left;
    } while (status == CAIRN_MORE);
    assert_ok(status);
    r = cairn_contour_search_read(search);
    made.objects = r.object_count;
    for (int32_t i = 0; i < r.object_count; i++) {
        const cairn_contour_search_object *o = &r.objects[i];
        const cairn_real numbers[] = {o->found.origin.x,       o->found.origin.y,
                                      o->found.size,           o->found.turn,
                                      o->found.evidence,       o->found.score,
                                      o->rigid_evidence,       o->deformed_evidence,
                                      o->shape.edge_proximity, o->shape.tangent_deviation,
                                      o->shape.deformation};

        made.hash = test_hash(made.hash, numbers, sizeof numbers);
        made.hash = test_hash(made.hash, &r.segments[o->found.first],
                              (size_t)o->found.count * sizeof *r.segments);
        for (int32_t k = 0; k < o->outline_count; k++) {
            const cairn_contour_search_place *p = &r.outline[o->first_outline + k];

            made.hash = test_hash(made.hash, &p->point.position, sizeof p->point.position);
            made.hash = test_hash(made.hash, &p->segment, sizeof p->segment);
        }
    }
    for (int32_t k = 0; k < 2; k++)
        made.hash =
            test_hash(made.hash, r.mode_counts[k], (size_t)r.steps[k] * sizeof *r.mode_counts[k]);
    return made;
}

static void finds_the_same_bits_with_any_budget(void **state)
{
    static const int32_t budgets[] = {CAIRN_UNBOUNDED, 20000, 1000, 7};
    cairn_shape_model_file model = make_model();
    cairn_contour_search_params params = search_params(&model.model);
    cairn_pool pool = test_pool(cairn_contour_search_memory(&params));
    cairn_contour_search_tokens tokens;
    cairn_contour_search *search;
    searched first = {0};

    (void)state;
    draw_scene();
    tokens = find_tokens(0);
    assert_ok(cairn_contour_search_create(&search, &pool, &params));
    for (size_t b = 0; b < sizeof budgets / sizeof *budgets; b++) {
        searched found = search_all(search, &tokens, &model.model, budgets[b]);

        assert_true(found.objects >= 1);
        assert_true(b == 0 || (found.hash == first.hash && found.units == first.units));
        assert_true(found.most <= budgets[b]);
        first = found;
    }
    assert_golden(test_hash(first.hash, &first.units, sizeof first.units),
                  UINT64_C(0x37fbabd5da1432c6), UINT64_C(0x40cac193eff704d5));
    cairn_contour_search_run_free_tokens(&tokens);
    cairn_shape_model_file_free(&model);
    test_pool_free(&pool);
}

/* Distance of a point from the border of a quadrangle. */
static double distance_from(const cairn_vec2 corner[4], cairn_vec2 p)
{
    double least = 1e9;

    for (int32_t i = 0; i < 4; i++) {
        cairn_segment side = {corner[i], corner[(i + 1) % 4]};

        least = fmin(least, (double)cairn_segment_distance(side, p));
    }
    return least;
}

/* A window in the cloth is an outline of its own: it bends onto edges off its place in the model. */
static void every_outline_bends(void **state)
{
    static const cairn_vec2 window[4] = {{22, 14}, {50, 16}, {48, 38}, {24, 36}},
                            off = {CAIRN_REAL(2.5), -2}, place = {110, 40};
    cairn_curve outlines[2] = {{flag, CORNERS, 1}, {window, 4, 1}};
    cairn_shape_model_builder_params builder = cairn_shape_model_builder_default();
    cairn_contour_search_params params;
    cairn_contour_search_tokens tokens;
    cairn_contour_search_result r;
    cairn_shape_model_file model;
    cairn_contour_search *search;
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_vec2 drawn[4], modelled[4];
    double own = 0, other = 0;
    int32_t samples[2] = {0, 0};
    cairn_pool pool;

    (void)state;
    clear_picture();
    draw_flag((double)place.x, (double)place.y, 1, 0);
    for (int32_t i = 0; i < 4; i++) {
        modelled[i] = cairn_vec2_add(window[i], place);
        drawn[i] = cairn_vec2_add(modelled[i], off);
    }
    for (int32_t i = 0; i < 4; i++)
        draw_line((double)drawn[i].x, (double)drawn[i].y, (double)drawn[(i + 1) % 4].x,
                  (double)drawn[(i + 1) % 4].y);
    tokens = find_tokens(0);
    assert_ok(cairn_shape_model_file_build(&model, outlines, 2, &builder, "flag", &error));
    params = search_params(&model.model);
    pool = test_pool(cairn_contour_search_memory(&params));
    assert_ok(cairn_contour_search_create(&search, &pool, &params));
    assert_ok(cairn_contour_search_begin(search, &tokens, &model.model, NULL));
    assert_ok(cairn_contour_search_step(search, &budget));
    r = cairn_contour_search_read(search);
    assert_true(r.object_count >= 1);
    for (int32_t i = 0; i < r.objects[0].outline_count; i++) {
        const cairn_contour_search_place *at = &r.outline[r.objects[0].first_outline + i];

        assert_in_range(at->outline_index, 0, 1);
        samples[at->outline_index]++;
        if (at->outline_index == 1) {
            own += distance_from(drawn, at->point.position);
            other += distance_from(modelled, at->point.position);
        }
    }
    assert_true(samples[0] > 0 && samples[1] > 0);
    assert_true(own < other / 2);
    /* Mode as written only. */
    assert_int_equal(r.mode, CAIRN_MODE_DEFAULT);
    assert_int_equal(r.point_count + r.points_dropped + r.candidates_dropped, 0);
    test_pool_free(&pool);
    cairn_contour_search_run_free_tokens(&tokens);
    cairn_shape_model_file_free(&model);
}

static cairn_status create_search(void *context, cairn_pool *pool)
{
    cairn_contour_search *search;

    return cairn_contour_search_create(&search, pool, context);
}

static void the_search_takes_the_memory_it_says(void **state)
{
    cairn_shape_model_file model = make_model();
    cairn_contour_search_params params = search_params(&model.model);
    cairn_contour_search *search;
    cairn_pool pool;
    size_t need;

    (void)state;
    params.grouping.particles = 2;
    for (int32_t k = 0; k < 2; k++) {
        params.mirror = k;
        need = cairn_contour_search_memory(&params);
        pool = test_pool(need - CAIRN_ALIGN);
        assert_status(create_search(&params, &pool), CAIRN_NO_MEMORY);
        assert_int_equal(pool.used, 0);
        test_pool_free(&pool);
        pool = test_pool(need);
        assert_ok(cairn_contour_search_create(&search, &pool, &params));
        assert_int_equal(pool.used, need);
        test_pool_free(&pool);
    }
    /* As written no field and no outline is needed. */
    params.grouping = cairn_contour_grouping_as_written();
    params.grouping.particles = 2;
    params.grouping.max_points = 16;
    params.grouping.max_steps = 4;
    params.grouping.max_width = params.grouping.max_height = 8;
    test_every_pool_size(create_search, &params, cairn_contour_search_memory(&params));
    cairn_shape_model_file_free(&model);
}

/* Every rule must be refused by its text, by all three functions. */
static void assert_rule(const cairn_contour_search_params *params, const char *rule)
{
    cairn_pool pool = test_pool(1 << 12);
    cairn_contour_search *search;
    cairn_object_fault fault;

    assert_status(cairn_contour_search_check(params, &fault), CAIRN_BAD_ARGUMENT);
    assert_null(fault.field);
    assert_string_equal(fault.rule, rule);
    assert_int_equal(cairn_contour_search_memory(params), 0);
    assert_status(cairn_contour_search_create(&search, &pool, params), CAIRN_BAD_ARGUMENT);
    test_pool_free(&pool);
}

static void the_params_of_a_search_are_refused_by_rule_and_by_those_of_its_grouping(void **state)
{
    cairn_contour_search_params params = cairn_contour_search_default(WIDTH, HEIGHT);
    cairn_object_fault fault;

    (void)state;
    params.max_size = params.min_size / 2;
    assert_rule(&params, "max_size: at least min_size");
    params.min_size = CAIRN_REAL_MIN;
    params.max_size = CAIRN_REAL_MAX;
    assert_rule(&params, "max_size: over min_size finite");
    params = cairn_contour_search_default(WIDTH, HEIGHT);
    params.grouping.particles = 0;
    assert_status(cairn_contour_search_check(&params, &fault), CAIRN_BAD_ARGUMENT);
    assert_string_equal(fault.module, "contour_grouping");
    assert_string_equal(fault.field, "particles");
    assert_int_equal(cairn_contour_search_memory(&params), 0);
}

static void the_search_refuses_bad_input_and_keeps_its_result(void **state)
{
    cairn_shape_model_file model = make_model();
    cairn_contour_search_params good = search_params(&model.model);
    cairn_pool pool = test_pool(cairn_contour_search_memory(&good));
    cairn_contour_search_tokens tokens, worse;
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_contour_search *search;
    cairn_shape_model odd = model.model;
    cairn_fault fault;
    cairn_segment kept;
    int32_t count;

    (void)state;
    assert_ok(cairn_contour_search_create(&search, &pool, &good));
    assert_ok(cairn_contour_search_step(search, &budget));
    draw_scene();
    tokens = find_tokens(0);
    count = search_all(search, &tokens, &model.model, CAIRN_UNBOUNDED).objects;
    assert_status(cairn_contour_search_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_contour_search_step(search, NULL), CAIRN_BAD_ARGUMENT);
    assert_fault(&fault, cairn_contour_search_begin(search, NULL, &model.model, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    assert_fault(&fault, cairn_contour_search_begin(search, &tokens, NULL, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    odd.size = 0;
    assert_fault(&fault, cairn_contour_search_begin(search, &tokens, &odd, &fault),
                 CAIRN_BAD_ARGUMENT, -1);
    odd = model.model;
    odd.sample_count = odd.sample_count / 2; /* a path beyond it */
    assert_true(cairn_contour_search_begin(search, &tokens, &odd, NULL) < 0);
    worse = tokens;
    worse.width = WIDTH + 1;
    assert_fault(&fault, cairn_contour_search_begin(search, &worse, &model.model, &fault),
                 CAIRN_FULL, -1);
    worse = tokens;
    worse.count = MAX_SEGMENTS + 1;
    assert_fault(&fault, cairn_contour_search_begin(search, &worse, &model.model, &fault),
                 CAIRN_FULL, MAX_SEGMENTS);
    kept = tokens.lines[5];
    for (int k = 0; k < 3; k++) {
        tokens.lines[5].b.y = (cairn_real)(k == 0 ? (double)NAN : k == 1 ? (double)INFINITY : 1e9);
        assert_fault(&fault, cairn_contour_search_begin(search, &tokens, &model.model, &fault),
                     CAIRN_NOT_FINITE, 5);
    }
    tokens.lines[5] = kept;
    assert_int_equal(cairn_contour_search_read(search).object_count, count);
    /* Nothing to find, in no tokens. */
    worse = tokens;
    worse.count = 0;
    assert_int_equal(search_all(search, &worse, &model.model, 1000).objects, 0);
    cairn_contour_search_run_free_tokens(&tokens);
    cairn_shape_model_file_free(&model);
    test_pool_free(&pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tokens_do_not_depend_on_budgets),
        cmocka_unit_test(the_tokenizer_takes_the_memory_it_says),
        cmocka_unit_test(the_tokenizer_refuses_what_does_not_fit),
        cmocka_unit_test(finds_the_same_bits_with_any_budget),
        cmocka_unit_test(every_outline_bends),
        cmocka_unit_test(the_search_takes_the_memory_it_says),
        cmocka_unit_test(the_params_of_a_search_are_refused_by_rule_and_by_those_of_its_grouping),
        cmocka_unit_test(the_search_refuses_bad_input_and_keeps_its_result),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
