/* cairn skeleton: a bar in an image, output files; radii from a silhouette; bad input. Tests that
 * need OpenCV are skipped without it. */
#include "tests/programs.h"

#include <sys/stat.h>

#include "cairn/json_text.h"
#include "cairn/vision.h"
#include "src/host/files/map_file_image.h"
#include "tests/xml.h"

enum { WIDTH = 200, HEIGHT = 120 };

static uint8_t grey[WIDTH * HEIGHT];

/* A bright bar, 20 px wide; its silhouette is the image without grey. */
static void write_pictures(void)
{
    cairn_file_error error;

    for (int pass = 0; pass < 2; pass++) {
        for (int32_t i = 0; i < WIDTH * HEIGHT; i++) {
            int32_t x = i % WIDTH, y = i / WIDTH, inside = x >= 30 && x < 170 && y >= 50 && y < 70;

            grey[i] = (uint8_t)(pass ? (inside ? 255 : 0) : (inside ? 180 : 90));
        }
        assert_int_equal(cairn_image_write_png(files_path(pass ? "outlines/bar.png" : "bar.png"),
                                               grey, WIDTH, HEIGHT, &error),
                         CAIRN_OK);
    }
}

/* The first number of a key in a JSON text, all of which must be well formed. */
static double number_of(const char *text, const char *name)
{
    cairn_json json = cairn_json_begin("json", text, strlen(text));
    cairn_json_token token;
    cairn_file_error error;
    double number = -1;
    int next = 0;

    do {
        assert_int_equal(cairn_json_next(&json, &token, &error), CAIRN_OK);
        if (next && token.kind == CAIRN_JSON_NUMBER && number < 0)
            number = token.number;
        next = token.kind == CAIRN_JSON_NAME && cairn_json_is(&token, name);
    } while (token.kind != CAIRN_JSON_END);
    return number;
}

static char *read_file(const char *name)
{
    char *text = files_read(files_path(name), NULL);

    if (text == NULL)
        fail_msg("%s is not there", name);
    return text;
}

static void a_bar_is_found(void **state)
{
    outcome o;
    char *text;

    (void)state;
    o = programs_run("cairn skeleton @/bar.png --radius 8:12 -o @/found");
    if (cairn_vision_load(NULL) == CAIRN_UNSUPPORTED && o.code != 0)
        skip();
    assert_done(o);
    assert_non_null(strstr(o.out, "1 part of 1 object, radii 8.0 to 12.0 px;"));
    text = read_file("found/bar.json");
    assert_true(number_of(text, "min_radius") == 8 && number_of(text, "max_radius") == 12);
    assert_true(number_of(text, "free_ends") == 2);
    assert_true(number_of(text, "log_odds") > 20);
    assert_non_null(strstr(text, "\"proposed\": false"));
    assert_non_null(strstr(text, "\"verdict\": \"found\""));
    free(text);
    text = read_file("found/bar.svg");
    assert_well_formed(text);
    assert_int_equal(count_of(text, "class=\"axis\""), 1);
    assert_int_equal(count_of(text, "class=\"boundary\""), 1);
    free(text);
    text = read_file("found/bar.json");
    assert_true(number_of(text, "strength") > 2);
    free(text);
    assert_done(programs_run("cairn skeleton @/bar.png --min-strength 100 --quiet -o @/strong"));
    text = read_file("strong/bar.json");
    assert_holds(text, "\"contours\": []");
    free(text);
}

/* A reduced image gives lengths in pixels of the image. */
static void reduced_images_keep_their_pixels(void **state)
{
    char *text;

    (void)state;
    assert_done(
        programs_run("cairn skeleton @/bar.png --max-side 100 --min-log-odds 3 --quiet -o @/half"));
    text = read_file("half/bar.json");
    assert_true(number_of(text, "shrink") == 2);
    assert_true(number_of(text, "width") == WIDTH);
    /* the axis of the bar of 20 pixels is at 59.5, its radius 10 */
    assert_in_range(number_of(text, "max_radius"), 10, 60);
    assert_non_null(strstr(text, ", 59."));
    free(text);
}

/* The method as written, by both option names: parts are objects of their own, and there are no
 * region contours. */
static void as_written_finds_it(void **state)
{
    static const char *const names[] = {"--as-written", "--weight as-written"};
    char *text, *first = NULL;

    (void)state;
    if (cairn_vision_load(NULL) == CAIRN_UNSUPPORTED)
        skip();
    for (int32_t i = 0; i < 2; i++) {
        assert_done(programs_run("cairn skeleton @/bar.png %s --radius 8:12 --min-log-odds 3 "
                                 "--lines --quiet -o @/written%d",
                                 names[i], (int)i));
        text = read_file(i ? "written1/bar.json" : "written0/bar.json");
        assert_holds(text, "\"proposed\": false");
        assert_holds(text, "\"contours\": []");
        assert_holds(text, "\"verdict\": \"found\"");
        assert_true(number_of(text, "centres") > 100 && number_of(text, "free_ends") == 2);
        if (first != NULL)
            assert_string_equal(text, first);
        free(first);
        first = text;
    }
    free(first);
    text = read_file("written0/bar-lines.svg");
    assert_well_formed(text);
    assert_true(count_of(text, "class=\"line\"") >= 1);
    assert_true(count_of(text, "h0") > 100);
    free(text);
    assert_null(files_read(files_path("found/bar-lines.svg"), NULL));

    /* Without --lines the picture of an earlier run does not stay, unless it is that of an image. */
    for (int is_of_image = 1; is_of_image >= 0; is_of_image--) {
        if (is_of_image)
            (void)files_write_text("written0/bar-lines.json", "{}");
        else
            files_remove(files_path("written0/bar-lines.json"));
        assert_done(programs_run("cairn skeleton @/bar.png --radius 8:12 --quiet -o @/written0"));
        text = files_read(files_path("written0/bar-lines.svg"), NULL);
        assert_int_equal(text != NULL, is_of_image);
        free(text);
    }
}

/* With edges of another detector: one row of pixels along each side of the bar. */
static void edges_of_another_detector(void **state)
{
    cairn_file_error error;
    char *text;

    (void)state;
    if (cairn_vision_load(NULL) == CAIRN_UNSUPPORTED)
        skip();
    for (int32_t i = 0; i < WIDTH * HEIGHT; i++) {
        int32_t x = i % WIDTH, y = i / WIDTH;

        grey[i] = x >= 30 && x < 170 && (y == 50 || y == 69) ? 200 : 0;
    }
    assert_int_equal(cairn_image_write_png(files_path("edges.png"), grey, WIDTH, HEIGHT, &error),
                     CAIRN_OK);
    assert_done(programs_run("cairn skeleton @/bar.png --edges @/edges.png --as-written "
                             "--radius 8:12 --min-log-odds 3 --quiet -o @/given"));
    text = read_file("given/bar.json");
    assert_true(number_of(text, "edgels") > 80 && number_of(text, "edgels") < 120);
    assert_holds(text, "\"verdict\": \"found\"");
    assert_true(number_of(text, "free_ends") == 2);
    free(text);
    assert_int_equal(
        cairn_image_write_png(files_path("small.png"), grey, WIDTH, HEIGHT / 2, &error), CAIRN_OK);
    assert_refused(programs_run("cairn skeleton @/bar.png --edges @/small.png --as-written -o @/x"),
                   "as the image");
    assert_refused(programs_run("cairn skeleton @/bar.png --edges @/edges.png -o @/x"),
                   "without --as-written");
    assert_refused(programs_run("cairn skeleton @/bar.png --edges @/edges.png --as-written "
                                "--min-slope 3 -o @/x"),
                   "--min-slope with --edges");
    assert_refused(programs_run("cairn skeleton @/bar.png @/outlines/bar.png --edges @/edges.png "
                                "--as-written -o @/x"),
                   "expected one");
}

/* A bar of 20 x 140 px has radii up to 10. */
static void radii_are_learnt(void **state)
{
    char *text;

    (void)state;
    if (cairn_vision_load(NULL) == CAIRN_UNSUPPORTED)
        skip();
    assert_done(programs_run("cairn skeleton @/bar.png --learn @/outlines -o @/learnt"));
    text = read_file("learnt/bar.json");
    assert_true(number_of(text, "max_radius") > 8 && number_of(text, "max_radius") < 12);
    assert_true(number_of(text, "free_ends") == 2);
    free(text);
}

static void bad_input_is_refused(void **state)
{
    (void)state;
    assert_refused(programs_run("cairn skeleton -o @/x"), "no image");
    assert_refused(programs_run("cairn skeleton @/bar.png"), "no folder to write to");
    assert_refused(programs_run("cairn skeleton @/bar.png --radius 9 -o @/x"),
                   "expected A:B in pixels");
    assert_refused(programs_run("cairn skeleton @/bar.png --radius 0.5:9 -o @/x"),
                   "expected A:B in pixels");
    assert_refused(programs_run("cairn skeleton @/bar.png --radius 9:8 -o @/x"),
                   "expected A:B in pixels");
    assert_refused(programs_run("cairn skeleton @/bar.png --radius 9:10 --learn @/outlines -o @/x"),
                   "expected one of them");
    assert_refused(programs_run("cairn skeleton @/bar.png --weight none -o @/x"),
                   "expected evidence or as-written");
    assert_refused(programs_run("cairn skeleton @/bar.png --as-written --weight evidence -o @/x"),
                   "expected one of them");
    assert_refused(programs_run("cairn skeleton @/bar.png --as-written --contrast 6 -o @/x"),
                   "how steep edges are");
    assert_refused(programs_run("cairn skeleton @/bar.png --as-written --min-strength 2 -o @/x"),
                   "between regions");
    assert_refused(programs_run("cairn skeleton @/bar.png @/bar-lines.png --lines -o @/x"),
                   "would overwrite");
    assert_refused(programs_run("cairn skeleton @/bar.png @/outlines/bar.png -o @/x"),
                   "both named 'bar'");
    assert_refused(programs_run("cairn skeleton @/bar.png --learn @/nowhere -o @/x"),
                   "expected a folder of outlines");
    assert_refused(programs_run("cairn skeleton @/bar.png --learn @/empty -o @/x"),
                   "holds no outlines");
}

static int set_up(void **state)
{
    assert_int_equal(files_setup(state), 0);
    assert_int_equal(mkdir(files_path("outlines"), 0700), 0);
    assert_int_equal(mkdir(files_path("empty"), 0700), 0);
    write_pictures();
    return 0;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_bar_is_found),      cmocka_unit_test(reduced_images_keep_their_pixels),
        cmocka_unit_test(as_written_finds_it), cmocka_unit_test(edges_of_another_detector),
        cmocka_unit_test(radii_are_learnt),    cmocka_unit_test(bad_input_is_refused),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, set_up, files_teardown);
}
