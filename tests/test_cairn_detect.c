/* cairn detect: shapes found in pictures of edges, their files; many images at once; bad input
 * of all kinds. */
#include "tests/coco.h"
#include "tests/programs.h"

#include "cairn/appearance_image.h"
#include "cairn/json_text.h"
#include "cairn/vision.h"
#include "src/host/files/map_file_image.h"
#include "tests/xml.h"

enum { WIDTH = 240, HEIGHT = 200, IMAGES = 4 };

/* At half the scale, by the best candidates of the model as it is: a quarter of the work, for what the
 * files hold and not what is found best. */
#define QUICK "--max-side 120 --no-mirror --candidates 3"

static uint8_t grey[WIDTH * HEIGHT], edges[WIDTH * HEIGHT];

static int is_bottle(int32_t x, int32_t y, int32_t left)
{
    return y >= 30 && y < 180 && abs(x - left) <= (y < 80 ? 12 : 33);
}

/* An image of a bottle and its edges; its silhouette is the model. */
static void write_pictures(void)
{
    cairn_file_error error;

    for (int32_t k = 0; k < IMAGES; k++) {
        int32_t left = 60 + 25 * k;
        char name[32];

        for (int32_t i = 0; i < WIDTH * HEIGHT; i++) {
            int32_t x = i % WIDTH, y = i / WIDTH;
            int in = is_bottle(x, y, left);

            grey[i] = in ? 60 : 200;
            edges[i] = in && !(is_bottle(x - 1, y, left) && is_bottle(x + 1, y, left) &&
                               is_bottle(x, y - 1, left) && is_bottle(x, y + 1, left))
                           ? 255
                           : 0;
        }
        (void)snprintf(name, sizeof name, "bottle%d.png", (int)k);
        assert_int_equal(cairn_image_write_png(files_path(name), grey, WIDTH, HEIGHT, &error),
                         CAIRN_OK);
        if (k == 0)
            assert_int_equal(
                cairn_image_write_png(files_path("edges.png"), edges, WIDTH, HEIGHT, &error),
                CAIRN_OK);
    }
}

static void assert_same(const char *one, const char *other)
{
    char *a = files_text(one), *b = files_text(other);

    assert_string_equal(a, b);
    free(a);
    free(b);
}

static void test_found(void **state)
{
    cairn_json json;
    cairn_json_token token;
    cairn_file_error error;
    char *text;
    const char *box;
    outcome o;

    (void)state;
    write_pictures();
    assert_done(programs_run("cairn model @/bottle0.png -o @/bottle.shape --quiet"));
    o = programs_run(
        "cairn detect @/bottle0.png --edges @/edges.png --model @/bottle.shape -o @/found "
        "--detections @/found.csv");
    assert_done(o);
    assert_holds(o.out, "bottle0.png: ");
    text = files_text("found/bottle0.json");
    json = cairn_json_begin("json", text, strlen(text));
    do
        assert_int_equal(cairn_json_next(&json, &token, &error), CAIRN_OK);
    while (token.kind != CAIRN_JSON_END);
    box = strstr(text, "\"box\": [");
    assert_non_null(box);
    assert_near(strtod(box + 8, NULL), 27, 6);
    assert_non_null(strstr(text, "\"outline\": [["));
    free(text);
    text = files_text("found/bottle0.svg");
    assert_well_formed(text);
    assert_non_null(strstr(text, "class=\"box\""));
    assert_non_null(strstr(text, "class=\"missing\""));
    free(text);
    text = files_text("found.csv");
    assert_int_equal(
        strncmp(text,
                "image,class,left,top,right,bottom,score,mirrored\nbottle0.png,bottle.shape,2", 75),
        0);
    free(text);
    o = programs_run(
        "cairn detect @/bottle0.png --edges @/edges.png --model @/bottle.png0 -o @/found");
    assert_refused(o, "bottle.png0");
    o = programs_run("cairn detect @/bottle0.png --edges @/edges.png --model @/bottle.shape " QUICK
                     " --min-score 99 -o @/none");
    assert_done(o);
    assert_holds(o.out, ": 0 detections");
}

/* As COCO and as masks: a bottle with its box and its area, the same from several processes. */
static void test_objects(void **state)
{
    static const char *const detect = "cairn detect @/bottle0.png --edges @/edges.png --model "
                                      "@/bottle.shape -o @/objects --quiet --jobs %s --coco "
                                      "@/objects/%s/coco.json --masks @/objects/masks";
    cairn_file_error error;
    cairn_image mask;
    int32_t both = 0, either = 0;
    char *text;

    (void)state;
    assert_done(programs_run(detect, "1", "one"));
    assert_done(programs_run(detect, "2", "two"));
    assert_same("objects/one/coco.json", "objects/two/coco.json");
    text = files_text("objects/one/coco.json");
    assert_non_null(strstr(text, "{\"id\": 1, \"file_name\": \"bottle0.png\", \"width\": 240, "
                                 "\"height\": 200}"));
    assert_non_null(strstr(text, "\"categories\": [{\"id\": 1, \"name\": \"bottle\"}]"));
    assert_coco("objects/one/coco.json", "objects/masks", "bottle0", count_of(text, "\"score\""),
                2);
    free(text);
    assert_int_equal(
        cairn_image_read(&mask, files_path("objects/masks/bottle0-labels.png"), &error), CAIRN_OK);
    for (int32_t i = 0; i < WIDTH * HEIGHT; i++) {
        int in = is_bottle(i % WIDTH, i / WIDTH, 60);

        both += in && mask.pixel[i] == 1;
        either += in || mask.pixel[i] == 1;
    }
    cairn_image_free(&mask);
    assert_true(both > 0.9 * either);
    assert_refused(programs_run("cairn detect @/bottle0.png --edges @/edges.png --model "
                                "@/bottle.shape -o @/objects --coco @/bottle0.png/coco.json"),
                   "bottle0.png");
}

static double best_score(const char *json)
{
    char *text = files_text(json);
    const char *score = strstr(text, "\"score\": ");
    double value;

    assert_non_null(score);
    value = strtod(score + 9, NULL);
    free(text);
    return value;
}

/* Grouping at the bottle adds to its score by default; nothing with weight 0. */
static void test_verified(void **state)
{
    static const char *const detect = "cairn detect @/bottle0.png --edges @/edges.png --model "
                                      "@/bottle.shape " QUICK " %s -o @/%s --quiet";

    (void)state;
    assert_done(programs_run(detect, "--verify 0", "plain"));
    assert_done(programs_run(detect, "--verify 0.08", "verified"));
    assert_done(programs_run(detect, "", "default"));
    assert_same("default/bottle0.json", "verified/bottle0.json");
    assert_true(best_score("verified/bottle0.json") > best_score("plain/bottle0.json") + 0.5);
}

/* By parts, with the configuration; none of it without. */
static void test_by_parts(void **state)
{
    const char *box;
    char *text;

    (void)state;
    assert_done(programs_run(
        "cairn detect @/bottle0.png --edges @/edges.png --model @/bottle.shape --method parts -o "
        "@/parts --quiet"));
    text = files_text("parts/bottle0.json");
    box = strstr(text, "\"box\": [");
    assert_non_null(box);
    assert_near(strtod(box + 8, NULL), 27, 6);
    assert_non_null(strstr(text, "\"parts\": [{\"bundle\": "));
    assert_non_null(strstr(text, "\"missing\": ["));
    free(text);
    assert_done(programs_run(
        "cairn detect @/bottle0.png --edges @/edges.png --model @/bottle.shape --as-written -o "
        "@/written --quiet --min-score -2"));
    text = files_text("written/bottle0.json");
    box = strstr(text, "\"box\": [");
    assert_non_null(box);
    assert_near(strtod(box + 8, NULL), 27, 6);
    assert_non_null(strstr(text, "\"parts\": [{\"bundle\": "));
    free(text);
    text = files_text("written/bottle0.svg");
    assert_well_formed(text);
    assert_non_null(strstr(text, "class=\"inset\""));
    free(text);
    text = files_text("found/bottle0.json");
    assert_null(strstr(text, "\"parts\""));
    free(text);
}

/* Fragments given by hand: only those are found, in their bundles. */
static void test_cuts(void **state)
{
    static const char *const detect =
        "cairn detect @/bottle0.png --edges @/edges.png --model @/bottle.shape "
        "--method parts --cuts @/%s -o @/cut --quiet";
    const char *part;
    char *text;

    (void)state;
    (void)files_write_text("hand.cuts", "0 40 0\n40 80 1\n80 0 2\n");
    assert_done(programs_run(detect, "hand.cuts"));
    text = files_text("cut/bottle0.json");
    part = strstr(text, "\"parts\": [{\"bundle\": ");
    assert_non_null(part);
    for (part = strstr(text, "\"fragment\": "); part != NULL;
         part = strstr(part + 1, "\"fragment\": "))
        assert_in_range(strtol(part + 12, NULL, 10), 0, 2);
    free(text);
    (void)files_write_text("far.cuts", "0 40 0\n40 4000 1\n");
    assert_refused(programs_run(detect, "far.cuts"),
                   "expected manually chosen fragments of its first outline");
    assert_refused(programs_run(detect, "missing.cuts"), "missing.cuts: cannot open");
}

/* Images of twice the size are halved, their boxes with them: training gives the same model. */
static void learns_at_the_scale_of_the_search(const char *learn)
{
    static uint8_t large[4 * WIDTH * HEIGHT];
    cairn_file_error error;

    for (int32_t k = 0; k < 3; k++) {
        char name[32];

        for (int32_t i = 0; i < 4 * WIDTH * HEIGHT; i++)
            large[i] = is_bottle(i % (2 * WIDTH) / 2, i / (2 * WIDTH) / 2, 60 + 25 * k) ? 60 : 200;
        (void)snprintf(name, sizeof name, "large%d.png", (int)k);
        assert_int_equal(
            cairn_image_write_png(files_path(name), large, 2 * WIDTH, 2 * HEIGHT, &error),
            CAIRN_OK);
    }
    assert_done(programs_run("%s", learn));
    (void)files_write_text("large.csv", "image,left,top,right,bottom\nlarge0.png,54,60,188,360\n"
                                        "large2.png,154,60,288,360\nlarge1.png,104,60,238,360\n");
    assert_done(programs_run(
        "cairn train @/large0.png @/large1.png @/large2.png --boxes @/large.csv --words 10 --quiet "
        "--max-side 300 -o @/large.look"));
    assert_same("large.look", "bottle.look");
}

/* The trained appearance changes scores; without the library of OpenCV a message says so. */
static void test_appearance(void **state)
{
    static const char *const learn = "cairn train @/bottle0.png @/bottle1.png @/bottle2.png "
                                     "--boxes @/boxes.csv --words 10 --quiet -o @/bottle.look";
    static const char *const detect =
        "cairn detect @/bottle0.png --edges @/edges.png --model @/bottle.shape "
        "--appearance @/%s -o @/looked --quiet";
    const char *value;
    char *text;

    (void)state;
    (void)files_write_text("boxes.csv", "image,left,top,right,bottom\nbottle0.png,27,30,94,180\n"
                                        "bottle1.png,52,30,119,180\nbottle2.png,77,30,144,180\n");
    if (cairn_appearance_image_load(NULL) == CAIRN_UNSUPPORTED) {
        assert_refused(programs_run("%s", learn), "needs libcairn-appearance.so");
        return;
    }
    assert_done(programs_run("%s", learn));
    assert_done(programs_run(detect, "bottle.look"));
    text = files_text("looked/bottle0.json");
    value = strstr(text, "\"appearance\": ");
    assert_non_null(value);
    assert_true(strtod(value + 14, NULL) > 0.5 && strtod(value + 14, NULL) <= 1);
    free(text);
    text = files_text("found/bottle0.json");
    assert_null(strstr(text, "\"appearance\""));
    free(text);
    learns_at_the_scale_of_the_search(learn);
    assert_refused(
        programs_run("cairn train @/bottle0.png @/bottle1.png @/bottle2.png --boxes @/boxes.csv "
                     "-o @/no/where.look"),
        "where.look");
    (void)files_write_text("other.look", "cairn-appearance 7\n");
    assert_refused(programs_run(detect, "other.look"),
                   "other.look:1: a model of version 7, expected 1");
    assert_refused(programs_run(detect, "missing.look"), "missing.look: cannot open");
    (void)files_write_text("boxes.csv", "image,left,top,right,bottom\nbottle9.png,27,30,94,180\n");
    assert_refused(programs_run("%s", learn),
                   "boxes.csv:2: a box in 'bottle9.png', expected one of the images");
    assert_refused(programs_run("cairn train @/bottle0.png -o @/x.look"),
                   "no boxes (--boxes), expected");
    assert_refused(programs_run("cairn train --boxes @/boxes.csv -o @/x.look"),
                   "no image, expected");
    assert_refused(programs_run("cairn train @/bottle0.png --boxes @/boxes.csv"),
                   "no file to write to (-o), expected");
}

/* Results on a halved image are in the image's own pixels. */
static void test_halved(void **state)
{
    const char *box;
    char *text;

    (void)state;
    assert_done(
        programs_run("cairn detect @/bottle0.png --edges @/edges.png --model @/bottle.shape " QUICK
                     " --overlap 0.1 --quiet -o @/halved"));
    text = files_text("halved/bottle0.json");
    assert_non_null(strstr(text, "\"width\": 240"));
    assert_non_null(strstr(text, "\"shrink\": 2"));
    box = strstr(text, "\"box\": [");
    assert_non_null(box);
    assert_near(strtod(box + 8, NULL), 27, 8);
    free(text);
}

/* With the largest number of processes: the same bytes. */
static void write_truth(const char *name, const char *rows)
{
    FILE *f = fopen(files_path(name), "w");

    assert_non_null(f);
    fprintf(f, "image,left,top,right,bottom\n%s", rows);
    assert_int_equal(fclose(f), 0);
}

static void test_many_images(void **state)
{
    static const char *const images = "@/bottle0.png @/bottle1.png @/bottle2.png @/bottle3.png";
    static const char *const detect =
        "cairn detect %s --model @/bottle.shape " QUICK " --jobs %d -o @/%s --detections "
        "@/%s.csv --truth @/all.csv --curves @/%s-curves";
    outcome one, three;
    char *first;

    (void)state;
    if (cairn_vision_load(NULL) == CAIRN_UNSUPPORTED)
        skip();
    write_truth("all.csv", "bottle0.png,27,30,93,180\nbottle3.png,102,30,168,180\n");
    one = programs_run(detect, images, 1, "one", "one", "one");
    assert_done(one);
    first = strdup(one.out);
    three = programs_run(detect, images, 3, "three", "three", "three");
    assert_done(three);
    assert_non_null(first);
    assert_string_equal(first, three.out);
    free(first);
    assert_same("one.csv", "three.csv");
    assert_same("one-curves.csv", "three-curves.csv");
    assert_same("one-curves.svg", "three-curves.svg");
    for (int k = 0; k < IMAGES; k++) {
        char a[32], b[32];

        (void)snprintf(a, sizeof a, "one/bottle%d.json", k);
        (void)snprintf(b, sizeof b, "three/bottle%d.json", k);
        assert_same(a, b);
    }
    /* An unreadable image is reported; no table is left behind. */
    one = programs_run("cairn detect @/bottle0.png @/missing.png @/bottle1.png --model "
                       "@/bottle.shape " QUICK " --jobs 3 -o @/some "
                       "--detections @/some.csv");
    assert_refused(one, "missing.png: cannot open");
    assert_int_not_equal(access(files_path("some.csv"), F_OK), 0);
}

/* The last line of curves: the highest recall, and the false positives per image there. */
static void read_last(const char *name, double *recall, double *false_per_image)
{
    char *text = files_text(name), *line = strrchr(text, ','), *end;

    assert_int_equal(strncmp(text, "score,recall,recall_low,recall_high,precision,", 46), 0);
    assert_non_null(line);
    *false_per_image = strtod(line + 1, NULL);
    while (line > text && line[-1] != '\n')
        line--;
    (void)strtod(line, &end);
    *recall = strtod(end + 1, NULL);
    free(text);
}

/* One object of the image, one of an image that was not searched; then also a missing image. */
static void test_truth(void **state)
{
    static const char *const command =
        "cairn detect @/bottle0.png --edges @/edges.png --model @/bottle.shape " QUICK
        " --min-score -100 -o @/found --truth @/truth.csv --curves @/%s";
    double recall, more, false_per_image, more_false;
    char *text;

    (void)state;
    write_truth("truth.csv", "bottle0.png,27,30,93,180\nelsewhere.png,10,10,50,50\n");
    assert_done(programs_run(command, "right"));
    read_last("right.csv", &recall, &false_per_image);
    assert_near(recall, 1, 1e-9);
    text = files_text("right.svg");
    assert_well_formed(text);
    free(text);
    write_truth("truth.csv", "bottle0.png,27,30,93,180\nbottle0.png,230,190,239,199\n");
    assert_done(programs_run(command, "half"));
    read_last("half.csv", &more, &more_false);
    assert_near(more, 0.5, 1e-9);
    assert_near(more_false, false_per_image, 1e-9);
    write_truth("truth.csv", "");
    assert_done(programs_run(command, "none"));
    read_last("none.csv", &more, &more_false);
    assert_near(more, 0, 1e-9);
    assert_near(more_false, false_per_image + 1, 1e-9);
}

/* As written a box that shares more than a fifth with an object's is a hit, else half. */
static void test_truth_as_written(void **state)
{
    static const char *const command =
        "cairn detect @/bottle0.png --edges @/edges.png --model @/bottle.shape "
        "--min-score -100 -o @/found --truth @/truth.csv --curves @/%s%s";
    double recall, false_per_image;

    (void)state;
    write_truth("truth.csv", "bottle0.png,27,30,93,85\n");
    assert_done(programs_run(command, "fifth", " --as-written"));
    read_last("fifth.csv", &recall, &false_per_image);
    assert_near(recall, 1, 1e-9);
    assert_done(programs_run(command, "half", " " QUICK));
    read_last("half.csv", &recall, &false_per_image);
    assert_near(recall, 0, 1e-9);
}

static void write_grey_as_text(const char *name)
{
    char *text = malloc(4 * WIDTH * HEIGHT + 32);
    int used;

    assert_non_null(text);
    used = sprintf(text, "P2\n%d %d\n255\n", WIDTH, HEIGHT);
    for (int32_t i = 0; i < WIDTH * HEIGHT; i++)
        used += sprintf(text + used, "%d\n", grey[i]);
    (void)files_write_text(name, text);
    free(text);
}

/* Names with a separator or a line end are quoted. */
static void test_quoted_names(void **state)
{
    static const char row[] =
        "image,class,left,top,right,bottom,score,mirrored\n\"b,c.pgm\",\"my \"\"own\"\".shape\",";
    char *text, *shape = files_text("bottle.shape");

    (void)state;
    write_grey_as_text("b,c.pgm");
    (void)files_write_text("my \"own\".shape", shape);
    free(shape);
    assert_done(programs_run(
        "cairn detect '@/b,c.pgm' --edges @/edges.png --model '@/my \"own\".shape' " QUICK
        " -o @/quoted --detections @/quoted.csv"));
    text = files_text("quoted.csv");
    assert_int_equal(strncmp(text, row, strlen(row)), 0);
    assert_int_not_equal(text[strlen(row)], '"');
    free(text);
    free(files_text("quoted/b,c.json"));

    /* A name is no formula where a table is opened by a spreadsheet. */
    write_grey_as_text("=1+1.pgm");
    assert_done(
        programs_run("cairn detect '@/=1+1.pgm' --edges @/edges.png --model @/bottle.shape " QUICK
                     " -o @/formula --detections @/made/for/it/formula.csv"));
    text = files_text("made/for/it/formula.csv");
    assert_non_null(strstr(text, "\n./=1+1.pgm,bottle.shape,"));
    free(text);
}

static void test_refusals(void **state)
{
    static const struct {
        const char *arguments, *piece;
    } cases[] = {
        {"--model @/bottle.shape -o @/refused", "no image, expected IMAGE..."},
        {"@/bottle0.png -o @/refused", "no model (--model), expected"},
        {"@/bottle0.png --model @/bottle.shape", "no folder to write to (-o), expected"},
        {"@/bottle0.png @/bottle1.png --edges @/edges.png --model @/bottle.shape -o @/refused",
         "--edges with 2 images, expected one"},
        {"@/bottle0.png @/sub/bottle0.jpg --model @/bottle.shape -o @/refused",
         "are both named 'bottle0', expected"},
        {"@/bottle0.png --model @/bottle.shape --low 9 --high 8 -o @/refused",
         "--low 9 is above --high 8, expected"},
        {"@/bottle0.png --model @/bottle.shape --jobs 0 -o @/refused", "expected"},
        {"@/bottle0.png --model @/bottle.shape --method best -o @/refused",
         "--method best, expected evidence or"},
        {"@/bottle0.png --model @/bottle.shape --bundles two -o @/refused",
         "--bundles two, expected rule, one or"},
        {"@/bottle0.png --model @/bottle.shape --as-written --method evidence -o @/refused",
         "--method other than parts with --as-written"},
        {"@/bottle0.png --model @/bottle.shape --as-written --verify 0.1 -o @/refused",
         "--verify with --as-written"},
        {"@/bottle0.png --model @/bottle.shape --as-written --occluded -o @/refused",
         "--occluded with --as-written"},
        {"@/bottle0.png --model @/bottle.shape --as-written --no-mirror -o @/refused",
         "--no-mirror with --as-written"},
        {"@/bottle0.png --model @/bottle.shape --as-written --bundles one -o @/refused",
         "--bundles with --as-written"},
        {"@/bottle0.png --model @/bottle.shape --nearest 65 -o @/refused", "expected"},
        {"@/bottle0.png --model @/bottle.shape --overlap 2 -o @/refused", "expected"},
        {"@/bottle0.png --model @/bottle.shape --verify 101 -o @/refused", "--verify"},
        {"@/bottle0.png --model @/bottle.shape --verify -1 -o @/refused", "--verify"},
        {"@/missing.png --edges @/edges.png --model @/bottle.shape -o @/refused",
         "missing.png: cannot open"},
        {"@/bottle0.png --edges @/edges.png --model @/missing.shape -o @/refused",
         "missing.shape: cannot open"},
        {"@/bottle0.png --edges @/edges.png --model @/bottle.shape -o @/edges.png", "edges.png"},
        {"@/bottle0.png '@/two\nlines.png' --model @/bottle.shape -o @/refused",
         "two?lines.png' holds a control character (shown as ?), expected"},
        {"'@/end\f.png' --model @/bottle.shape -o @/refused",
         "end?.png' holds a control character"},
        {"@/bottle0.png --edges @/edges.png --model '@/a\vb\177.shape' -o @/refused",
         "a?b?.shape' holds a control character"},
        {"@/bottle0.png --model @/bottle.shape -o @/refused --truth @/truth.csv",
         "--truth alone, expected --truth and"},
        {"@/bottle0.png --model @/bottle.shape -o @/refused --curves @/c",
         "--curves alone, expected --truth and"},
        {"@/bottle0.png --edges @/edges.png --model @/bottle.shape -o @/refused --truth @/no.csv "
         "--curves @/c",
         "no.csv: cannot open"},
        /* Before any search. */
        {"@/bottle0.png --edges @/edges.png --model @/bottle.shape -o @/refused --detections "
         "@/bottle0.png/table.csv",
         "bottle0.png"},
    };

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        assert_refused(programs_run("cairn detect %s", cases[i].arguments), cases[i].piece);
    assert_int_not_equal(access(files_path("refused"), F_OK), 0);
    assert_done(programs_run("cairn detect --help"));
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_found),
        cmocka_unit_test(test_objects),
        cmocka_unit_test(test_verified),
        cmocka_unit_test(test_by_parts),
        cmocka_unit_test(test_halved),
        cmocka_unit_test(test_appearance),
        cmocka_unit_test(test_cuts),
        cmocka_unit_test(test_many_images),
        cmocka_unit_test(test_quoted_names),
        cmocka_unit_test(test_truth),
        cmocka_unit_test(test_truth_as_written),
        cmocka_unit_test(test_refusals),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
