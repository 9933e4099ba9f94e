/* cairn symmetry: images become axes, as images and JSON; bad images. */
#include "tests/programs.h"

#include <math.h>

#include "src/host/files/map_file_image.h"
#include "tests/json.h"
#include "tests/xml.h"

enum { SIDE = 160 };

typedef int (*inside)(int32_t x, int32_t y);

static int kite(int32_t x, int32_t y)
{
    return y >= 20 && y <= 140 && abs(x - 80) <= (y < 60 ? (y - 20) : (140 - y) / 2);
}

static int disc(int32_t x, int32_t y)
{
    return (x - 80) * (x - 80) + (y - 80) * (y - 80) <= 60 * 60;
}

static int box(int32_t x, int32_t y)
{
    return x >= 30 && x <= 130 && y >= 30 && y <= 130;
}

static int pierced(int32_t x, int32_t y)
{
    return box(x, y) && !(x >= 40 && x < 80 && y >= 65 && y <= 95);
}

/* Boxes of two sizes that touch at a corner. */
static int touching(int32_t x, int32_t y)
{
    return (x >= 20 && x < 80 && y >= 20 && y < 80) || (x >= 80 && x < 120 && y >= 80 && y < 120);
}

static int apart(int32_t x, int32_t y)
{
    return kite(x, y) || (x >= 140 && x < 150 && y >= 10 && y < 40);
}

static int bar(int32_t x, int32_t y)
{
    return x >= 10 && x < 150 && y >= 76 && y < 84;
}

/* A spiral band, wider outside. */
static int spiral(int32_t x, int32_t y)
{
    double turn = atan2(y - 80, x - 80), radius = hypot(x - 80, y - 80);

    for (; turn < 16; turn += 6.283185307)
        if (turn > 2 && radius > 4 * turn - turn * 0.5 && radius < 4 * turn + turn * 0.5)
            return 1;
    return 0;
}

static int nothing(int32_t x, int32_t y)
{
    (void)x;
    (void)y;
    return 0;
}

static void write_shape(const char *name, inside is_inside)
{
    static uint8_t grey[SIDE * SIDE];
    cairn_file_error error;

    for (int32_t y = 0; y < SIDE; y++)
        for (int32_t x = 0; x < SIDE; x++)
            grey[y * SIDE + x] = is_inside(x, y) ? 255 : 0;
    assert_int_equal(cairn_image_write_png(files_path(name), grey, SIDE, SIDE, &error), CAIRN_OK);
}

/* The number of a key's first occurrence. */
static double number_of(const char *text, const char *key)
{
    const char *at = strstr(text, key);

    assert_non_null(at);
    return strtod(at + strlen(key), NULL);
}

static void test_an_axis(void **state)
{
    char *svg, *json;
    outcome o;

    (void)state;
    write_shape("kite.png", kite);
    o = programs_run("cairn symmetry @/kite.png -o @/found");
    assert_done_silently(o);
    assert_holds(o.out, "kite.png: one axis;");
    json = files_text("found/kite.json");
    assert_json(json);
    assert_non_null(strstr(json, "\"mode\": \"re-ranked\", \"parts\": 1, \"holes\": 0,"));
    assert_non_null(strstr(json, "\"verdict\": \"one axis\", \"ties\": 1, \"rotations\": 1,"));
    /* Upright, through x = 80. */
    assert_near(number_of(json, "\"ends\": [["), 80, 2);
    assert_near(number_of(json, "\"bend_deg\": "), 0, 3);
    assert_near(number_of(json, "\"mirror\": ["), 80, 1);
    svg = files_text("found/kite.svg");
    assert_well_formed(svg);
    assert_non_null(strstr(svg, "class=\"first\""));
    assert_non_null(strstr(svg, "class=\"second\""));
    free(svg);
    free(json);
    assert_done_silently(
        programs_run("cairn symmetry @/kite.png -o @/written --as-written --quiet"));
    json = files_text("written/kite.json");
    assert_non_null(strstr(json, "\"mode\": \"as written\""));
    assert_null(strstr(json, "\"division\": 0"));
    /* Its older name. */
    assert_done_silently(
        programs_run("cairn symmetry @/kite.png -o @/older --mode as-written --quiet"));
    svg = files_text("older/kite.json");
    assert_string_equal(svg, json);
    free(svg);
    free(json);
}

static void test_verdicts(void **state)
{
    static const struct {
        const char *name, *words;
        inside is_inside;
    } shapes[] = {
        {"disc", "no single axis (", disc},
        {"box", "several axes (4 as good as the best), the same after a turn by 1/4;", box},
        {"bar", "several axes (2 as good as the best), the same after a turn by 1/2;", bar},
        {"pierced", "one axis;", pierced},
        {"touching", "one axis;", touching},
        {"apart", "one axis, the largest of 2 parts;", apart},
        {"spiral", "one axis;", spiral},
    };

    (void)state;
    for (int i = 0; i < (int)(sizeof shapes / sizeof *shapes); i++) {
        char name[64], *json;
        outcome o;

        (void)snprintf(name, sizeof name, "%s.png", shapes[i].name);
        write_shape(name, shapes[i].is_inside);
        o = programs_run("cairn symmetry @/%s -o @/verdicts", name);
        assert_done_silently(o);
        assert_holds(o.out, shapes[i].words);
        (void)snprintf(name, sizeof name, "verdicts/%s.json", shapes[i].name);
        json = files_text(name);
        assert_json(json);
        free(json);
    }
    /* Filled, the box with a hole is as symmetric as the box. */
    assert_holds(programs_run("cairn symmetry @/pierced.png -o @/verdicts --holes fill").out,
                 "several axes (4 as good");
}

static void test_sheet(void **state)
{
    char *svg;

    (void)state;
    assert_done_silently(programs_run("cairn symmetry @/kite.png @/box.png @/disc.png @/bar.png "
                                      "@/spiral.png -o @/sheet --sheet --points 64"));
    svg = files_text("sheet/sheet.svg");
    assert_well_formed(svg);
    assert_non_null(strstr(svg, "spiral.png"));
    free(svg);
    /* Without --sheet that of an earlier run does not stay. */
    assert_done_silently(programs_run("cairn symmetry @/box.png -o @/sheet --points 64"));
    assert_null(files_read(files_path("sheet/sheet.svg"), NULL));
}

static void test_refusals(void **state)
{
    int before;

    (void)state;
    write_shape("nothing.png", nothing);
    (void)files_write_text("dots.pgm",
                           "P2\n5 3\n255\n255 255 255 255 255 255 0 0 0 255 255 255 255 255 255\n");
    before = files_count();
    assert_refused(programs_run("cairn symmetry @/nothing.png -o @/none"),
                   "160 x 160 pixels of one colour, expected");
    assert_refused(programs_run("cairn symmetry @/dots.pgm -o @/none"),
                   "an object of 3 pixels along its diagonal, expected");
    assert_refused(programs_run("cairn symmetry @/missing.png -o @/none"), "cannot open");
    assert_refused(programs_run("cairn symmetry -o @/none"), "no picture, expected");
    assert_refused(programs_run("cairn symmetry @/kite.png"),
                   "no folder to write to (-o), expected");
    assert_refused(programs_run("cairn symmetry @/kite.png @/kite.png -o @/none"),
                   "are both named 'kite', expected");
    assert_refused(programs_run("cairn symmetry @/kite.png -o @/none --mode best"),
                   "--mode best, expected re-ranked");
    assert_refused(
        programs_run("cairn symmetry @/kite.png -o @/none --mode re-ranked --as-written"),
        "--mode re-ranked with --as-written");
    assert_refused(programs_run("cairn symmetry @/kite.png -o @/none --holes some"),
                   "--holes some, expected keep");
    assert_refused(programs_run("cairn symmetry @/kite.png -o @/none --points 8"), "expected");
    assert_refused(programs_run("cairn symmetry @/pierced.png -o @/none --holes refuse"),
                   "a hole of");
    assert_refused(programs_run("cairn symmetry @/kite.png -o @/kite.png"), "kite.png");
    assert_int_equal(files_count(), before);
    assert_done_silently(programs_run("cairn symmetry --help"));
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_an_axis),
        cmocka_unit_test(test_verdicts),
        cmocka_unit_test(test_sheet),
        cmocka_unit_test(test_refusals),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
