/* cairn group: a shape found in an edge image, output files and pages; bad input of all kinds.
 * Tests that need OpenCV are skipped without it. */
#include "tests/coco.h"
#include "tests/programs.h"

#include "cairn/vision.h"
#include "src/host/files/map_file_image.h"
#include "tests/json.h"
#include "tests/xml.h"

enum { WIDTH = 320, HEIGHT = 240 };

static uint8_t grey[WIDTH * HEIGHT], edges[WIDTH * HEIGHT];

static int is_bottle(int32_t x, int32_t y)
{
    return y >= 40 && y < 190 && abs(x - 150) <= (y < 90 ? 12 : 33);
}

/* An image of a bottle, its edges, and its silhouette as the model. */
static void write_pictures(void)
{
    cairn_file_error error;

    for (int32_t y = 0; y < HEIGHT; y++)
        for (int32_t x = 0; x < WIDTH; x++) {
            int in = is_bottle(x, y);

            grey[y * WIDTH + x] = in ? 60 : 200;
            edges[y * WIDTH + x] = in && !(is_bottle(x - 1, y) && is_bottle(x + 1, y) &&
                                           is_bottle(x, y - 1) && is_bottle(x, y + 1))
                                       ? 255
                                       : 0;
        }
    assert_int_equal(cairn_image_write_png(files_path("bottle.png"), grey, WIDTH, HEIGHT, &error),
                     CAIRN_OK);
    assert_int_equal(cairn_image_write_png(files_path("edges.png"), edges, WIDTH, HEIGHT, &error),
                     CAIRN_OK);
}

static void test_found(void **state)
{
    char *text, *again;
    outcome o;

    (void)state;
    write_pictures();
    assert_done(programs_run("cairn model @/bottle.png -o @/bottle.shape --quiet"));
    o = programs_run("cairn group @/bottle.png --edges @/edges.png --model @/bottle.shape --scale "
                     "120:220 --report -o @/found");
    assert_done(o);
    assert_holds(o.out, "1 object, best score");
    text = files_text("found/bottle.json");
    assert_json(text);
    assert_int_equal(count_of(text, "\"verdict\": \"found\""), 1);
    free(text);
    text = files_text("found/bottle.svg");
    assert_well_formed(text);
    assert_int_equal(count_of(text, "class=\"left\""), 1);
    free(text);
    text = files_text("found/bottle.html");
    assert_non_null(strstr(text, "N_eff"));
    free(text);
    /* Same seed, same bytes; a model made by the command itself gives the same. */
    text = files_text("found/bottle.json");
    assert_done(programs_run("cairn group @/bottle.png --edges @/edges.png --model @/bottle.shape "
                             "--scale 120:220 --quiet -o @/found"));
    again = files_text("found/bottle.json");
    assert_string_equal(text, again);
    free(text);
    free(again);
    /* Without --report the page of the earlier run does not stay. */
    assert_null(files_read(files_path("found/bottle.html"), NULL));
    o = programs_run("cairn group @/bottle.png --edges @/edges.png --model @/bottle.png --scale "
                     "120:220 --tokens "
                     "edgels -o @/edgels");
    assert_done(o);
    assert_holds(o.out, "object");
}

/* The method of the thesis: its output can be read; an image without an edge has no object. */
/* As COCO and as masks; as written the polygon of the segments, with spikes that are thinner than a
 * pixel. */
static void test_objects(void **state)
{
    static const char *const group =
        "cairn group @/bottle.png --edges @/edges.png --model @/bottle.shape --scale %s --quiet -o "
        "@/objects --coco @/objects/coco.json --masks @/objects/masks";

    (void)state;
    assert_done(programs_run(group, "120:220"));
    assert_coco("objects/coco.json", "objects/masks", "bottle", 1, 2);
    assert_done(programs_run(group, "164 --as-written"));
    assert_coco("objects/coco.json", "objects/masks", "bottle", 1, 6);
    assert_refused(programs_run("cairn group @/bottle.png --edges @/edges.png --model "
                                "@/bottle.shape --scale 120:220 --quiet -o @/objects --masks "
                                "@/bottle.png/masks"),
                   "bottle.png");
}

static void test_as_written(void **state)
{
    outcome o;
    char *text;

    (void)state;
    assert_done(programs_run(
        "cairn group @/bottle.png --edges @/edges.png --model @/bottle.shape --as-written --scale "
        "164 --particles 200 --report -o @/written"));
    text = files_text("written/bottle.json");
    assert_json(text);
    assert_int_equal(count_of(text, "\"verdict\": \"found\""), 1);
    assert_true(count_of(text, "\"skeleton\": [[") >= 1);
    assert_int_equal(count_of(text, "\"points_dropped\": 0, \"candidates_dropped\": "), 1);
    free(text);
    text = files_text("written/bottle.svg");
    assert_well_formed(text);
    free(text);
    text = files_text("written/bottle.html");
    assert_non_null(strstr(text, "symmetric points, sample"));
    /* The edges are a background without a marker; both look-ahead circles are regions. */
    assert_non_null(strstr(text, "\"names\":[-1,1,"));
    assert_non_null(strstr(text, "\"image\":1,"));
    assert_non_null(strstr(text, "look-ahead circles"));
    free(text);
    memset(edges, 0, sizeof edges);
    {
        cairn_file_error error;

        assert_int_equal(
            cairn_image_write_png(files_path("empty.png"), edges, WIDTH, HEIGHT, &error), CAIRN_OK);
    }
    o = programs_run(
        "cairn group @/bottle.png --edges @/empty.png --model @/bottle.shape --as-written --scale "
        "164 --report -o @/written");
    assert_done(o);
    assert_holds(o.out, "no object; the filter ended: no start; ");
    text = files_text("written/bottle.json");
    assert_int_equal(count_of(text, "\"verdict\": \"none\""), 1);
    assert_int_equal(count_of(text, "\"end\": \"no start\""), 1);
    free(text);
}

/* Results on a halved image are in the image's own pixels. */
static void test_halved(void **state)
{
    char *text;
    const char *size;

    (void)state;
    assert_done(programs_run("cairn group @/bottle.png --edges @/edges.png --model @/bottle.shape "
                             "--scale 120:220 --max-side 200 "
                             "--min-score 0.3 --no-mirror --seed 3 --particles 200 -o @/halved"));
    text = files_text("halved/bottle.json");
    assert_non_null(strstr(text, "\"shrink\": 2"));
    assert_non_null(strstr(text, "\"width\": 320"));
    size = strstr(text, "\"size\": ");
    assert_non_null(size);
    assert_near(strtod(size + 8, NULL), 165, 20);
    free(text);
}

static void test_no_object(void **state)
{
    outcome o;
    char *text;

    (void)state;
    (void)files_write_text("dot.pgm", "P2\n1 1\n255\n9\n");
    (void)files_write_text("full.pgm",
                           "P2\n6 4\n255\n9 9 9 9 9 9 9 9 9 9 9 9 9 9 9 9 9 9 9 9 9 9 9 9\n");
    o = programs_run(
        "cairn group @/dot.pgm --edges @/dot.pgm --model @/bottle.shape --report -o @/none");
    assert_done(o);
    assert_holds(o.out, "no object, best score 0.00");
    assert_done(programs_run(
        "cairn group @/full.pgm --edges @/full.pgm --model @/bottle.shape --report -o @/none"));
    /* Upside down it is another shape. */
    o = programs_run("cairn group @/bottle.png --edges @/edges.png --model @/bottle.shape "
                     "--rotation -180:-170 --scale "
                     "120:220 --min-score 0.9 -o @/down");
    assert_done(o);
    assert_holds(o.out, "no object, best score");
    /* A threshold above the evidence found. */
    o = programs_run(
        "cairn group @/bottle.png --edges @/edges.png --model @/bottle.shape --scale 120:220 "
        "--min-evidence 999 -o @/much");
    assert_done(o);
    assert_holds(o.out, "no object, best score ");
    assert_holds(o.out, " of at least 0.30, best evidence ");
    assert_holds(o.out, " of at least 999.00; ");
    assert_done(programs_run(
        "cairn group @/bottle.png --edges @/edges.png --model @/bottle.shape --scale 120:220 "
        "--min-evidence 0 -o @/little"));
    text = files_text("little/bottle.json");
    assert_non_null(strstr(text, "\"verdict\": \"found\""));
    free(text);
}

static void test_edges_by_opencv(void **state)
{
    outcome o;

    (void)state;
    o = programs_run("cairn group @/bottle.png --model @/bottle.shape --scale 120:220 -o @/canny");
    if (cairn_vision_load(NULL) == CAIRN_UNSUPPORTED) {
        assert_refused(o, "edges and the writing of images need libcairn-vision.so");
        skip();
    }
    assert_done(o);
    assert_holds(o.out, "1 object, best score");
}

static void test_refusals(void **state)
{
    static const struct {
        const char *arguments, *piece;
    } cases[] = {
        {"--model @/bottle.shape -o @/refused", "no image, expected IMAGE..."},
        {"@/bottle.png -o @/refused", "no model (--model), expected"},
        {"@/bottle.png --model @/bottle.shape", "no folder to write to (-o), expected"},
        {"@/bottle.png @/dot.pgm --edges @/edges.png --model @/bottle.shape -o @/refused",
         "--edges with 2 images, expected one"},
        {"@/bottle.png @/edges.png @/sub/bottle.jpg --model @/bottle.shape -o @/refused",
         "are both named 'bottle', expected"},
        {"@/bottle.png --model @/bottle.shape --scale 0:9 -o @/refused", "--scale 0:9, expected"},
        {"@/bottle.png --model @/bottle.shape --scale 20:10 -o @/refused",
         "--scale 20:10, expected"},
        {"@/bottle.png --model @/bottle.shape --scale nan -o @/refused", "--scale nan, expected"},
        {"@/bottle.png --model @/bottle.shape --rotation -181:0 -o @/refused",
         "--rotation -181:0, expected"},
        {"@/bottle.png --model @/bottle.shape --rotation 1:x -o @/refused",
         "--rotation 1:x, expected"},
        {"@/bottle.png --model @/bottle.shape --tokens lines -o @/refused",
         "--tokens lines, expected"},
        {"@/bottle.png --model @/bottle.shape --as-written -o @/refused",
         "--as-written without --scale, expected"},
        {"@/bottle.png --model @/bottle.shape --as-written --scale 160 --rotation 0:9 -o @/refused",
         "--rotation with --as-written, expected it without"},
        {"@/bottle.png --model @/bottle.shape --as-written --scale 160 --min-score 0.5 -o "
         "@/refused",
         "--min-score with --as-written, expected it without"},
        {"@/bottle.png --model @/bottle.shape --as-written --scale 160 --paths 8 -o @/refused",
         "--paths with --as-written, expected it without"},
        {"@/bottle.png --model @/bottle.shape --as-written --scale 160 --no-mirror -o @/refused",
         "--no-mirror with --as-written, expected it without"},
        {"@/bottle.png --model @/bottle.shape --low 9 --high 8 -o @/refused",
         "--low 9 is above --high 8, expected"},
        {"@/bottle.png --model @/bottle.shape --particles 0 -o @/refused", "expected"},
        {"@/bottle.png --edges @/dot.pgm --model @/bottle.shape -o @/refused",
         "1 x 1 pixels, expected 320 x 240"},
        {"@/missing.png --edges @/edges.png --model @/bottle.shape -o @/refused",
         "missing.png: cannot open"},
        {"@/bottle.png --edges @/missing.png --model @/bottle.shape -o @/refused",
         "missing.png: cannot open"},
        {"@/bottle.png --edges @/edges.png --model @/missing.shape -o @/refused",
         "missing.shape: cannot open"},
        {"@/bottle.png --edges @/edges.png --model @/dot.pgm -o @/refused", "one colour, expected"},
        {"@/bottle.png --edges @/edges.png --model @/bottle.shape -o @/edges.png", "edges.png"},
    };

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        assert_refused(programs_run("cairn group %s", cases[i].arguments), cases[i].piece);
    assert_int_not_equal(access(files_path("refused"), F_OK), 0);
    assert_done(programs_run("cairn group --help"));
}

/* An image of 8000 x 6000 pixels is reduced and searched; an image of normal size full of edges is
 * refused. */
static void test_large_images(void **state)
{
    static const char head[] = "P5\n8000 6000\n255\n";
    size_t pixels = (size_t)8000 * 6000, start = sizeof head - 1;
    char *bytes = calloc(1, start + pixels);
    outcome o;

    (void)state;
    assert_non_null(bytes);
    memcpy(bytes, head, start);
    for (size_t y = 1000; y < 5000; y++)
        bytes[start + y * 8000 + 3000] = bytes[start + y * 8000 + 4600] = (char)200;
    (void)files_write("large.pgm", bytes, start + pixels);
    o = programs_run("cairn group @/large.pgm --edges @/large.pgm --model @/bottle.shape "
                     "--particles 50 -o @/large");
    assert_done(o);
    assert_holds(o.out, "large.pgm: ");
    memset(bytes + start, 255, pixels);
    (void)files_write("large.pgm", bytes, start + pixels);
    assert_refused(programs_run("cairn group @/large.pgm --edges @/large.pgm --model "
                                "@/bottle.shape -o @/large --max-side 8000"),
                   "8000 x 6000 pixels, 48000000 of them edges, expected at most");
    free(bytes);
    assert_int_equal(remove(files_path("large.pgm")), 0);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_found),     cmocka_unit_test(test_halved),
        cmocka_unit_test(test_no_object), cmocka_unit_test(test_edges_by_opencv),
        cmocka_unit_test(test_objects),   cmocka_unit_test(test_as_written),
        cmocka_unit_test(test_refusals),  cmocka_unit_test(test_large_images),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
