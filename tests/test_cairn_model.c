/* cairn model: images become models, models are drawn and mirrored; bad images. */
#include "tests/programs.h"

#include "cairn/shape_model_file.h"
#include "cairn/vision.h"
#include "src/host/files/map_file_image.h"
#include "tests/xml.h"

enum { WIDTH = 160, HEIGHT = 120 };

/* A bottle of two boxes, black on white; only its outline when `drawn`. */
static void write_bottle(const char *name, int drawn)
{
    static uint8_t grey[WIDTH * HEIGHT];
    cairn_file_error error;

    memset(grey, 255, sizeof grey);
    for (int32_t y = 10; y < 110; y++)
        for (int32_t x = 0; x < WIDTH; x++) {
            int32_t half = y < 40 ? 8 : 22;

            if (abs(x - 70) <= half && (!drawn || abs(x - 70) == half || y == 10 || y == 109 ||
                                        (y == 40 && abs(x - 70) >= 8)))
                grey[y * WIDTH + x] = 0;
        }
    assert_int_equal(cairn_image_write_png(files_path(name), grey, WIDTH, HEIGHT, &error),
                     CAIRN_OK);
}

static void test_silhouette_and_drawing(void **state)
{
    cairn_shape_model_file solid, drawn;
    cairn_file_error error;
    outcome o;
    char *svg;

    (void)state;
    write_bottle("solid.png", 0);
    write_bottle("drawn.png", 1);
    o = programs_run(
        "cairn model @/solid.png -o @/solid.shape --svg @/solid.svg --parts @/parts.svg");
    assert_done_silently(o);
    assert_holds(o.out, "a silhouette, outlines 1, holes 0");
    o = programs_run("cairn model @/drawn.png -o @/drawn.shape");
    assert_done_silently(o);
    assert_holds(o.out, "a drawing");
    assert_int_equal(cairn_shape_model_file_read(&solid, files_path("solid.shape"), &error),
                     CAIRN_OK);
    assert_int_equal(cairn_shape_model_file_read(&drawn, files_path("drawn.shape"), &error),
                     CAIRN_OK);
    assert_near(solid.model.size, 110, 2);
    assert_near(drawn.model.size, solid.model.size, 0.01);
    assert_int_equal(drawn.model.sample_count, solid.model.sample_count);
    cairn_shape_model_file_free(&solid);
    cairn_shape_model_file_free(&drawn);
    svg = files_read(files_path("solid.svg"), NULL);
    assert_non_null(svg);
    assert_well_formed(svg);
    free(svg);
    svg = files_read(files_path("parts.svg"), NULL);
    assert_non_null(svg);
    assert_well_formed(svg);
    assert_non_null(strstr(svg, "class=\"fragment\""));
    free(svg);
}

static void test_options(void **state)
{
    cairn_shape_model_file model, mirrored;
    cairn_file_error error;
    outcome o;
    char *svg;

    (void)state;
    o = programs_run(
        "cairn model @/solid.png -o @/few.shape --points 64 --samples 10 --paths 1 --quiet");
    assert_done_silently(o);
    assert_string_equal(o.out, "");
    assert_int_equal(cairn_shape_model_file_read(&model, files_path("few.shape"), &error),
                     CAIRN_OK);
    assert_int_equal(model.model.outline_count, 64);
    assert_int_equal(model.model.path_count, 1);
    assert_true(model.model.sample_count <= 10);
    (void)files_write_text("two.cuts", "0 20 0\n20 40 1\n");
    o = programs_run(
        "cairn model @/few.shape -o @/again.shape --quiet --cuts @/two.cuts --parts @/two.svg");
    assert_done_silently(o);
    svg = files_read(files_path("two.svg"), NULL);
    assert_non_null(svg);
    assert_holds(svg, "2 fragments in 2 bundles");
    free(svg);
    o = programs_run("cairn model @/few.shape -o @/mirrored.shape --mirror --svg @/mirrored.svg");
    assert_done_silently(o);
    assert_null(strstr(o.out, "picture"));
    assert_int_equal(cairn_shape_model_file_read(&mirrored, files_path("mirrored.shape"), &error),
                     CAIRN_OK);
    assert_near(mirrored.model.samples[0].centre.x, -model.model.samples[0].centre.x, 0);
    cairn_shape_model_file_free(&model);
    cairn_shape_model_file_free(&mirrored);
}

static void test_refusals(void **state)
{
    int before;

    (void)state;
    (void)files_write_text("one.pgm", "P2\n1 1\n255\n0\n");
    (void)files_write_text("dots.pgm",
                           "P2\n5 3\n255\n255 255 255 255 255 255 0 0 0 255 255 255 255 255 255\n");
    (void)files_write_text("text.txt", "no picture");
    before = files_count();
    assert_refused(programs_run("cairn model @/one.pgm -o @/out.shape"),
                   "one.pgm: 1 x 1 pixels of one colour, expected");
    assert_refused(programs_run("cairn model @/dots.pgm -o @/out.shape"),
                   "an object of 3 pixels along its diagonal, expected");
    assert_refused(programs_run("cairn model @/text.txt -o @/out.shape"),
                   "begins with the bytes 0x6e6f, expected");
    assert_refused(programs_run("cairn model @/missing -o @/out.shape"), "cannot open");
    assert_refused(programs_run("cairn model @/solid.png -o @/none/out.shape"), "none");
    assert_refused(programs_run("cairn model @/solid.png"), "no file to write to (-o), expected");
    assert_refused(programs_run("cairn model -o @/out.shape"), "no picture, expected");
    assert_refused(programs_run("cairn model @/solid.png -o @/out.shape --cuts @/text.txt"),
                   "--cuts without --parts");
    assert_refused(
        programs_run("cairn model @/solid.png -o @/out.shape --cuts @/text.txt --parts @/out.svg"),
        "text.txt:1");
    assert_refused(programs_run("cairn model @/solid.png -o @/out.shape --holes some"),
                   "--holes some, expected keep");
    assert_refused(programs_run("cairn model @/solid.png -o @/out.shape --points 8"), "expected");
    assert_int_equal(files_count(), before);
    assert_done_silently(programs_run("cairn model --help"));
}

/* A picture of many greys is refused with a hint; a box cuts the object out of it. */
static void test_photograph(void **state)
{
    static uint8_t grey[WIDTH * HEIGHT];
    cairn_file_error error;
    outcome o;

    (void)state;
    for (int32_t i = 0; i < WIDTH * HEIGHT; i++) {
        int32_t x = i % WIDTH, y = i / WIDTH, inside = abs(x - 80) < 25 && abs(y - 60) < 35;

        grey[i] = (uint8_t)(inside ? 20 + i * 7 % 23 : 100 + x + i * 5 % 19 - y / 2);
    }
    assert_int_equal(cairn_image_write_png(files_path("photo.png"), grey, WIDTH, HEIGHT, &error),
                     CAIRN_OK);
    assert_refused(programs_run("cairn model @/photo.png -o @/cut.shape"), "--grab x,y,w,h");
    assert_refused(programs_run("cairn model @/photo.png -o @/cut.shape --grab 1,2,3"),
                   "expected X,Y,W,H");
    if (cairn_vision_load(NULL) == CAIRN_UNSUPPORTED)
        skip();
    o = programs_run("cairn model @/photo.png -o @/cut.shape --grab 45,15,70,90 --max-side 80");
    assert_done_silently(o);
    assert_non_null(strstr(o.out, "cut-silhouette.png"));
    assert_int_equal(access(files_path("cut-silhouette.png"), R_OK), 0);
    o = programs_run("cairn model @/cut-silhouette.png -o @/again.shape --json");
    assert_done_silently(o);
    /* hypot(50, 70) = 86 */
    assert_non_null(strstr(o.out, "\"size_px\": 8"));
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_silhouette_and_drawing),
        cmocka_unit_test(test_options),
        cmocka_unit_test(test_photograph),
        cmocka_unit_test(test_refusals),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
