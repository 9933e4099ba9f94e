/* The search as written: every step of the walk is reported, also of a single particle; why the
 * walk ended; refusals that name the argument. */
#include "cairn/contour_search_run.h"
#include "tests/flag_picture.h"
#include "src/outlines/contour_grouping_variants.h"

static cairn_contour_search_tokens written_tokens(void)
{
    cairn_raster_u8_view view = {edges, WIDTH, HEIGHT, WIDTH};
    cairn_contour_search_tokens tokens;

    clear_picture();
    draw_flag(60, 40, 1, 0);
    assert_ok(cairn_contour_search_run_tokens_as_written(&tokens, view, 1, 0, 0, "edges", &error));
    return tokens;
}

static cairn_contour_search_params written_params(void)
{
    cairn_contour_search_params params = cairn_contour_search_as_written(WIDTH, HEIGHT);

    params.min_size = params.max_size = (cairn_real)hypot(80, 120);
    return params;
}

typedef struct watch {
    int32_t steps, walks, others, most_others; /* steps: observations, with the initial one */
} watch;

static void on_step(void *context, const cairn_contour_grouping_particle *particles, int32_t count,
                    int32_t mirrored)
{
    watch *w = context;
    double weight = 0;

    assert_true(count >= 1 && mirrored == 0);
    for (int32_t i = 0; i < count; i++) {
        weight += exp((double)particles[i].log_weight);
        /* those of the initial particles are equal, and not normalized */
        assert_true(w->steps > 0 || particles[i].log_weight == 0);
    }
    assert_near(weight, w->steps > 0 ? 1 : count, 1e-3);
    w->steps++;
}

/* A walk of n steps has n + 1 discs: the report has all of them, of the best particle and of
 * others. */
static void on_walk(void *context, const cairn_contour_grouping_disc *discs, int32_t count,
                    int32_t rank)
{
    watch *w = context;

    w->others = rank == 0 ? 0 : w->others + 1;
    w->most_others = w->others > w->most_others ? w->others : w->most_others;
    assert_int_equal(rank, w->others);
    w->walks += rank == 0;
    assert_int_equal(w->walks, w->steps);
    assert_int_equal(count, w->walks);
    assert_true(discs[count - 1].radius > 0);
}

static void test_every_step_is_reported(void **state)
{
    static const int32_t particles[] = {1, 2, 5, 20, 300};
    cairn_shape_model_file model = make_model();
    cairn_contour_search_tokens tokens = written_tokens();
    int32_t most = 0;

    (void)state;
    for (size_t k = 0; k < sizeof particles / sizeof *particles; k++)
        for (uint64_t seed = 1; seed < 5; seed++) {
            cairn_contour_search_params params = written_params();
            cairn_contour_search_result r;
            watch w = {0, 0, 0, 0};

            /* No walk ends because it does not fit. */
            contour_grouping_ablate(&params.grouping, 1, 0);
            params.grouping.particles = particles[k];
            params.grouping.seed = seed;
            params.on_step = on_step;
            params.on_walk = on_walk;
            params.context = &w;
            assert_ok(
                cairn_contour_search_run(&r, &tokens, &model.model, &params, "edges", &error));
            /* with the initial particles */
            assert_int_equal(w.steps, r.steps[0] + 1);
            assert_in_range(w.most_others, particles[k] > 15 ? 7 : 0, 15);
            for (int32_t i = 0; i < r.steps[0]; i++)
                assert_in_range(r.mode_counts[0][i], 1, r.trace[0][i].particles);
            most = k == 0 && r.steps[0] > most ? r.steps[0] : most;
            cairn_contour_search_run_free(&r);
        }
    /* Also for one particle. */
    assert_true(most >= 2);
    cairn_contour_search_run_free_tokens(&tokens);
    cairn_shape_model_file_free(&model);
}

static void test_the_end_is_reported(void **state)
{
    static const char *const ends[] = {"no start", "posterior", "no follower", "steps",
                                       "histories"};
    cairn_shape_model_file model = make_model();
    cairn_contour_search_tokens tokens = written_tokens();
    cairn_contour_search_params params = written_params();
    int32_t end_count = tokens.end_count;
    cairn_contour_search_result r;

    (void)state;
    for (int32_t i = 0; i <= CAIRN_CONTOUR_GROUPING_HISTORIES; i++)
        assert_string_equal(cairn_contour_search_end_text(i), ends[i]);
    assert_string_equal(cairn_contour_search_end_text(-1), "");
    assert_string_equal(cairn_contour_search_end_text(CAIRN_CONTOUR_GROUPING_HISTORIES + 1), "");
    params.grouping.max_steps = 3;
    assert_ok(cairn_contour_search_run(&r, &tokens, &model.model, &params, "edges", &error));
    assert_int_equal(r.mode, CAIRN_MODE_AS_WRITTEN);
    assert_int_equal(r.end_reason, CAIRN_CONTOUR_GROUPING_STEPS);
    assert_int_equal(r.steps[0], 2);
    assert_true(r.point_count > 0 && r.points_dropped == 0);
    cairn_contour_search_run_free(&r);
    assert_int_equal(r.mode, CAIRN_MODE_DEFAULT);
    tokens.end_count = 0;
    assert_ok(cairn_contour_search_run(&r, &tokens, &model.model, &params, "edges", &error));
    assert_int_equal(r.end_reason, CAIRN_CONTOUR_GROUPING_NO_START);
    assert_int_equal(r.steps[0], 0);
    cairn_contour_search_run_free(&r);
    tokens.end_count = end_count;
    cairn_contour_search_run_free_tokens(&tokens);
    cairn_shape_model_file_free(&model);
}

/* A search that is refused with a status and a text. */
static void check_refused(const cairn_contour_search_tokens *tokens, const cairn_shape_model *model,
                          const cairn_contour_search_params *params, cairn_status status,
                          const char *piece)
{
    cairn_contour_search_result r;

    memset(&error, 0, sizeof error);
    assert_status(cairn_contour_search_run(&r, tokens, model, params, "name", &error), status);
    assert_error_holds("name: ");
    assert_error_holds(piece);
    assert_null(r.mode_counts[0]);
}

static void test_refusals_say_what_is_wrong(void **state)
{
    cairn_shape_model_file model = make_model();
    cairn_shape_model bad_model = model.model;
    cairn_contour_search_tokens tokens = written_tokens(), bad_tokens;
    const cairn_contour_search_params good = written_params();
    cairn_contour_search_params bad;
    cairn_vec2 end = {(cairn_real)NAN, 0};

    (void)state;
#define REFUSED(change, status, piece)                                                             \
    bad = good;                                                                                    \
    bad_tokens = tokens;                                                                           \
    change;                                                                                        \
    check_refused(&bad_tokens, &bad_model, &bad, status, piece)
    REFUSED(bad.min_size = 0, CAIRN_BAD_ARGUMENT, "the sizes, expected 0 < min_size");
    REFUSED(bad.min_size = (cairn_real)NAN, CAIRN_BAD_ARGUMENT, "the sizes, expected 0 < min_size");
    REFUSED(bad.max_size = bad.min_size / 2, CAIRN_BAD_ARGUMENT,
            "the sizes, expected 0 < min_size");
    REFUSED(bad.max_size = (cairn_real)INFINITY, CAIRN_NOT_FINITE, "max_size is not finite");
    REFUSED(bad.grouping.particles = 0, CAIRN_BAD_ARGUMENT, "the params of the grouping, expected");
    REFUSED(bad.grouping.max_steps = 1, CAIRN_BAD_ARGUMENT, "the params of the grouping, expected");
    REFUSED(bad_tokens.width = CAIRN_CONTOUR_SEARCH_MAX_SIDE + 1, CAIRN_BAD_ARGUMENT,
            "the image's sides, expected 1 to 8192");
    REFUSED(bad_tokens.height = 0, CAIRN_BAD_ARGUMENT, "the image's sides, expected 1 to 8192");
    REFUSED(bad_tokens.count = (1 << 20) + 1, CAIRN_FULL,
            "1048577 segments, expected at most 1048576");
    REFUSED((bad_tokens.ends = &end, bad_tokens.end_count = 1), CAIRN_NOT_FINITE,
            "an end of a chain is not finite");
    REFUSED(bad_model.path_count = 0, CAIRN_BAD_ARGUMENT, "no model, expected a size, paths");
#undef REFUSED
    cairn_contour_search_run_free_tokens(&tokens);
    cairn_shape_model_file_free(&model);
}

/* Edgels of a straight chain: one every 3 pixels, 3 px long, along the chain. */
static void test_edgels_stand_every_three_pixels(void **state)
{
    cairn_raster_u8_view view = {edges, WIDTH, HEIGHT, WIDTH};
    cairn_contour_search_tokens tokens;

    (void)state;
    clear_picture();
    draw_line(20, 50, 109, 50);
    assert_ok(cairn_contour_search_run_tokens_as_written(&tokens, view, 1, 1, 0, "edges", &error));
    assert_int_equal(tokens.chain_count, 1);
    assert_int_equal(tokens.count, 30);
    for (int32_t i = 0; i < tokens.count; i++) {
        cairn_segment line = tokens.lines[i];

        assert_near(cairn_abs(line.b.x - line.a.x), 3, 1e-4);
        assert_near(line.a.y, 50, 1e-4);
        assert_near(line.b.y, 50, 1e-4);
        if (i > 0)
            assert_near(cairn_abs(line.a.x - tokens.lines[i - 1].a.x), 3, 1e-4);
    }
    assert_near(tokens.mean_length, 5, 0);
    assert_near(tokens.look_ahead, 5, 0);
    cairn_contour_search_run_free_tokens(&tokens);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_step_is_reported),
        cmocka_unit_test(test_the_end_is_reported),
        cmocka_unit_test(test_refusals_say_what_is_wrong),
        cmocka_unit_test(test_edgels_stand_every_three_pixels),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
