/* The tool cairn-scene, run as a program: the one built beside the tests. */
#include "tests/test.h"

#include "cairn/vision.h"
#include "tests/programs.h"

static const char *const names[] = {"scene.pgm", "truth.json", "silhouette.pgm", "drawing.pgm"};

/* Whether file `name` of the folders a and b holds the same bytes. */
static int same(const char *a, const char *b, const char *name)
{
    char path[100];
    size_t count_a = 0, count_b = 0;
    char *bytes_a, *bytes_b;
    int equal;

    (void)snprintf(path, sizeof path, "%s/%s", a, name);
    bytes_a = files_read(files_path(path), &count_a);
    (void)snprintf(path, sizeof path, "%s/%s", b, name);
    bytes_b = files_read(files_path(path), &count_b);
    assert_non_null(bytes_a);
    assert_non_null(bytes_b);
    equal = count_a == count_b && memcmp(bytes_a, bytes_b, count_a) == 0;
    free(bytes_a);
    free(bytes_b);
    return equal;
}

static void test_same_seed_same_bytes(void **state)
{
    (void)state;
    assert_done_silently(programs_run("cairn-scene swan --seed 7 -o @/a"));
    assert_done_silently(programs_run("cairn-scene swan --seed 7 -o @/b"));
    assert_done_silently(programs_run("cairn-scene swan --seed 8 -o @/c"));
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        assert_true(same("a", "b", names[i]));
    assert_false(same("a", "c", "scene.pgm"));
    assert_false(same("a", "c", "truth.json"));
    assert_true(same("a", "c", "silhouette.pgm"));
}

/* The library finds the object at its true place by the model of its drawing. */
static void test_the_object_is_where_the_truth_says(void **state)
{
    char *truth, *found;
    double true_box[4], found_box[4];
    const char *at;

    (void)state;
    if (cairn_vision_load(NULL) == CAIRN_UNSUPPORTED)
        skip();
    assert_done_silently(programs_run("cairn-scene mug --seed 3 --clutter 2 --noise 2 -o @/mug"));
    assert_done_silently(programs_run("cairn model --quiet @/mug/drawing.pgm -o @/mug.shape"));
    assert_done_silently(
        programs_run("cairn detect --quiet @/mug/scene.pgm --model @/mug.shape -o @/found"));
    truth = files_read(files_path("mug/truth.json"), NULL);
    found = files_read(files_path("found/scene.json"), NULL);
    assert_non_null(truth);
    assert_non_null(found);
    at = strstr(truth, "\"box\": [");
    assert_non_null(at);
    assert_int_equal(sscanf(at, "\"box\": [%lf, %lf, %lf, %lf", &true_box[0], &true_box[1],
                            &true_box[2], &true_box[3]),
                     4);
    at = strstr(found, "\"box\": [");
    assert_non_null(at);
    assert_int_equal(sscanf(at, "\"box\": [%lf, %lf, %lf, %lf", &found_box[0], &found_box[1],
                            &found_box[2], &found_box[3]),
                     4);
    for (int i = 0; i < 4; i++)
        assert_true(true_box[i] - found_box[i] < 6 && found_box[i] - true_box[i] < 6);
    free(truth);
    free(found);
}

static void test_refusals(void **state)
{
    static const struct {
        const char *arguments, *piece;
    } cases[] = {
        {"", "no object"},
        {"zebra -o @/refused", "no object 'zebra'"},
        {"swan", "no output folder"},
        {"swan -o @/refused --hidden 1", "--hidden"},
        {"swan -o @/refused --noise nan", "--noise"},
        {"swan swan -o @/refused", "swan"},
    };

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char line[200];
        outcome o;

        (void)snprintf(line, sizeof line, "cairn-scene %s", cases[i].arguments);
        o = programs_run("%s", line);
        assert_int_equal(o.code, 2);
        assert_holds(o.err, cases[i].piece);
    }
    assert_int_not_equal(access(files_path("refused"), F_OK), 0);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_same_seed_same_bytes),
        cmocka_unit_test(test_the_object_is_where_the_truth_says),
        cmocka_unit_test(test_refusals),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
