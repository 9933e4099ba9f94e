/* Contours as JSON and as SVG: every key, lengths in images that were reduced, with an object and
 * without. */
#include "tests/test.h"

#include <math.h>

#include "cairn/contour_search_run.h"
#include "cairn/contour_file.h"
#include "cairn/json_text.h"
#include "cairn/shape_model_file.h"
#include "tests/files.h"
#include "tests/xml.h"

enum { WIDTH = 200, HEIGHT = 150, PIXELS = WIDTH * HEIGHT };

static uint8_t edges[PIXELS];
static cairn_file_error error;

typedef struct found {
    cairn_shape_model_file model;
    cairn_contour_search_tokens tokens;
    cairn_contour_search_result result;
    cairn_contour_file_picture picture;
} found;

enum { NOTHING, BOX, BOX_WITH_GAPS };

/* A box of 40 x 80 in the image, with gaps in its left and its lower side or without, or nothing. */
static found find(int there, int32_t shrink)
{
    static const cairn_vec2 box[] = {{0, 0}, {40, 0}, {40, 80}, {0, 80}};
    cairn_contour_search_params params = cairn_contour_search_default(WIDTH, HEIGHT);
    cairn_shape_model_builder_params builder = cairn_shape_model_builder_default();
    cairn_raster_u8_view view = {edges, WIDTH, HEIGHT, WIDTH};
    cairn_curve outline = {box, 4, 1};
    found f;

    memset(edges, 0, sizeof edges);
    for (int32_t i = 0; i <= 80 && there; i++)
        edges[(30 + i) * WIDTH + 70] = edges[(30 + i) * WIDTH + 110] = 200;
    for (int32_t i = 0; i <= 40 && there; i++)
        edges[30 * WIDTH + 70 + i] = edges[110 * WIDTH + 70 + i] = 200;
    for (int32_t i = 0; i < 20 && there == BOX_WITH_GAPS; i++)
        edges[(60 + i) * WIDTH + 70] = edges[110 * WIDTH + 80 + i] = 0;
    params.min_size = 80;
    params.max_size = 100;
    params.min_score = CAIRN_REAL(0.3);
    assert_ok(cairn_shape_model_file_build(&f.model, &outline, 1, &builder, "box", &error));
    assert_ok(cairn_contour_search_run_tokens(&f.tokens, view, 1, 0, "edges", &error));
    assert_ok(
        cairn_contour_search_run(&f.result, &f.tokens, &f.model.model, &params, "edges", &error));
    f.picture.image = "a \"<image>\".png";
    f.picture.model_name = "box";
    f.picture.grey = edges;
    f.picture.shrink = shrink;
    return f;
}

static void link_up(found *f)
{
    f->picture.tokens = &f->tokens;
    f->picture.model = &f->model.model;
    f->picture.result = &f->result;
}

static void drop(found *f)
{
    cairn_shape_model_file_free(&f->model);
    cairn_contour_search_run_free_tokens(&f->tokens);
    cairn_contour_search_run_free(&f->result);
}

/* The number of the first such key; the text is valid JSON. */
static double number_of(const char *text, const char *name)
{
    cairn_json json = cairn_json_begin("json", text, strlen(text));
    cairn_json_token token;
    double number = (double)NAN;
    int wanted = 0, known = 0;

    do {
        assert_ok(cairn_json_next(&json, &token, &error));
        if (wanted && !known && token.kind == CAIRN_JSON_NUMBER) {
            number = token.number;
            known = 1;
        }
        wanted = token.kind == CAIRN_JSON_NAME && cairn_json_is(&token, name);
    } while (token.kind != CAIRN_JSON_END);
    return number;
}

static void test_json(void **state)
{
    (void)state;
    for (int32_t shrink = 1; shrink <= 4; shrink *= 4) {
        found f = find(BOX, shrink);
        char *text;

        link_up(&f);
        assert_true(f.result.object_count >= 1);
        assert_ok(cairn_contour_file_write(&f.picture, files_path("a.json"), &error));
        text = files_read(files_path("a.json"), NULL);
        assert_near(number_of(text, "width"), WIDTH * shrink, 0);
        assert_near(number_of(text, "height"), HEIGHT * shrink, 0);
        assert_near(number_of(text, "shrink"), shrink, 0);
        assert_near(number_of(text, "x"), (90 + 0.5) * shrink - 0.5, 5 * shrink);
        assert_near(number_of(text, "y"), (70 + 0.5) * shrink - 0.5, 5 * shrink);
        assert_near(number_of(text, "size"), hypot(40, 80) * shrink, 6 * shrink);
        assert_near(number_of(text, "score"), f.result.objects[0].found.score, 1e-3);
        assert_near(number_of(text, "best_score"), f.result.best_score, 1e-3);
        assert_near(number_of(text, "seen_samples"), f.result.objects[0].found.matched_samples, 0);
        assert_near(number_of(text, "n_eff"), f.result.trace[0][0].n_eff, 1e-2);
        assert_near(number_of(text, "modes"), f.result.mode_counts[0][0], 0);
        assert_near(number_of(text, "id"), f.result.segments[f.result.objects[0].found.first], 0);
        assert_int_equal(count_of(text, "\"skeleton\""),
                         f.result.object_count * f.model.model.path_count);
        assert_int_equal(count_of(text, "\"left\""),
                         f.result.object_count * f.model.model.path_count);
        assert_int_equal(count_of(text, "\"n_eff\""), f.result.steps[0] + f.result.steps[1]);
        assert_int_equal(count_of(text, "\"verdict\": \"found\""), 1);
        assert_int_equal(count_of(text, "<image"), 0);
        free(text);
        drop(&f);
    }
}

static void test_nothing_found(void **state)
{
    found f = find(NOTHING, 1);
    char *text;

    (void)state;
    link_up(&f);
    assert_int_equal(f.result.object_count, 0);
    f.picture.grey = NULL;
    assert_ok(cairn_contour_file_write(&f.picture, files_path("b.json"), &error));
    text = files_read(files_path("b.json"), NULL);
    assert_near(number_of(text, "best_score"), 0, 0);
    assert_int_equal(count_of(text, "\"verdict\": \"none\""), 1);
    assert_int_equal(count_of(text, "\"objects\": []"), 1);
    free(text);
    assert_ok(cairn_contour_file_draw(&f.picture, files_path("b.svg"), &error));
    text = files_read(files_path("b.svg"), NULL);
    assert_well_formed(text);
    assert_int_equal(count_of(text, "<image"), 0);
    assert_int_equal(count_of(text, "class=\"axis\""), 0);
    free(text);
    drop(&f);
}

/* How often a piece stands before the first `end`. */
static int count_before(const char *text, const char *end, const char *piece)
{
    const char *last = strstr(text, end);
    int count = 0;

    assert_non_null(last);
    for (text = strstr(text, piece); text != NULL && text < last; text = strstr(text + 1, piece))
        count++;
    return count;
}

/* The axis of each path begins at the path's first disc. */
static void assert_axes_are_drawn(const char *text, const found *f)
{
    assert_true(f->model.model.path_count > 1);
    for (int32_t p = 0; p < f->model.model.path_count; p++) {
        const cairn_contour_search_disc *disc =
            &f->result.discs[f->result.objects[0].first_disc + f->model.model.paths[p].first];
        char axis[80];

        (void)snprintf(axis, sizeof axis, "<path class=\"axis\" d=\"M%.1f %.1fL",
                       (double)disc->centre.x, (double)disc->centre.y);
        assert_non_null(strstr(text, axis));
    }
}

static void test_picture(void **state)
{
    found f = find(BOX, 1);
    char *text;

    (void)state;
    link_up(&f);
    assert_ok(cairn_contour_file_draw(&f.picture, files_path("a.svg"), &error));
    text = files_read(files_path("a.svg"), NULL);
    assert_well_formed(text);
    assert_int_equal(count_of(text, "<image"), 1);
    assert_int_equal(count_of(text, "nan"), 0);
    assert_int_equal(count_of(text, "class=\"axis\""),
                     f.result.object_count * f.model.model.path_count);
    assert_int_equal(count_of(text, "class=\"left\""), f.result.object_count);
    assert_int_equal(count_of(text, "class=\"right\""), f.result.object_count);
    assert_int_equal(count_of(text, "class=\"model\""), f.result.object_count);
    assert_non_null(strstr(text, "&lt;image&gt;"));
    assert_axes_are_drawn(text, &f);
    /* Places and styles of the rest change only on purpose. */
    assert_golden(picture_hash(text), UINT64_C(0x2d9427554067fc08), UINT64_C(0xa5e9e74dec05e1d5));
    free(text);
    drop(&f);
}

/* What is not seen of the contour is completed by one arc for each gap. */
static void test_gaps(void **state)
{
    found f = find(BOX_WITH_GAPS, 2);
    const char *completed, *text_after_pool;
    char *text;

    (void)state;
    link_up(&f);
    assert_true(f.result.object_count >= 1);
    assert_ok(cairn_contour_file_write(&f.picture, files_path("c.json"), &error));
    text = files_read(files_path("c.json"), NULL);
    completed = strstr(text, "\"completed\": [[[");
    assert_non_null(completed);
    assert_int_equal(count_before(completed, "]]]", "]], [["), 1);
    text_after_pool = strstr(text, "\"verdict\""); /* the sanitizer's pools are larger */
    assert_non_null(text_after_pool);
    assert_golden(test_hash(TEST_HASH_START, text_after_pool, strlen(text_after_pool)),
                  UINT64_C(0xd7406533796d4f23), UINT64_C(0x2da9bd146dc6b3b2));
    free(text);
    assert_ok(cairn_contour_file_draw(&f.picture, files_path("c.svg"), &error));
    text = files_read(files_path("c.svg"), NULL);
    assert_golden(picture_hash(text), UINT64_C(0xd3e4971a873d62fb), UINT64_C(0x4253b34d0b2e36fc));
    free(text);
    drop(&f);
}

static void test_places_that_cannot_be_written(void **state)
{
    found f = find(BOX, 1);
    int before;

    (void)state;
    link_up(&f);
    before = files_count();
    assert_status(cairn_contour_file_write(&f.picture, files_path("none/a.json"), &error),
                  CAIRN_IO);
    assert_status(cairn_contour_file_draw(&f.picture, files_path("none/a.svg"), &error), CAIRN_IO);
    assert_int_equal(files_count(), before);
    drop(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_json),
        cmocka_unit_test(test_nothing_found),
        cmocka_unit_test(test_picture),
        cmocka_unit_test(test_gaps),
        cmocka_unit_test(test_places_that_cannot_be_written),
    };

    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
