/* The JSON objects of the programs: whole or not at all, also with --quiet; the same poses as in the
 * files. What each holds: docs/schemas, tools/check-json.py. */
#include "tests/programs.h"

static void made(const char *command)
{
    outcome o = programs_run("%s", command);

    if (o.code != 0)
        fail_msg("%s: exit code %d: %s", command, o.code, o.err);
}

/* The scene that is read below. */
static int make_scene(void **state)
{
    if (files_setup(state) != 0)
        return 1;
    made("cairn-scene mug --seed 3 -o @/scene");
    return 0;
}

static void nothing_is_printed_when_a_later_image_fails(void **state)
{
    static const char *const commands[] = {
        "cairn symmetry @/scene/silhouette.pgm @/none.pgm -o @/found --json",
        "cairn skeleton @/scene/scene.pgm @/none.pgm -o @/found --json"};

    (void)state;
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++) {
        outcome o = programs_run("%s", commands[i]);

        assert_int_equal(o.code, 2);
        assert_string_equal(o.out, "");
        assert_holds(o.err, "none.pgm");
    }
}

static void quiet_leaves_the_object(void **state)
{
    outcome o = programs_run("cairn model @/scene/drawing.pgm -o @/mug.shape --json --quiet");

    (void)state;
    assert_int_equal(o.code, 0);
    assert_int_equal(strncmp(o.out, "{\"shape\": \"", 11), 0);
    assert_string_equal(strchr(o.out, '\n'), "\n");
    assert_string_equal(o.err, "");
}

static void the_text_is_not_printed_beside_the_object(void **state)
{
    outcome o = programs_run("cairn symmetry @/scene/silhouette.pgm -o @/found --json");

    (void)state;
    assert_int_equal(o.code, 0);
    assert_int_equal(o.out[0], '{');
    assert_null(strstr(o.out, "bend "));
    assert_string_equal(o.err, "");
}

static void messages_go_to_standard_error(void **state)
{
    outcome o;

    (void)state;
    files_write_text("damaged.log", "FLASER 2 1 1 0 0 0 0 0 0 1 h 1\nFLASER 2 1 x\n");
    o = programs_run("cairn info @/damaged.log --json");
    assert_int_equal(o.code, 0);
    assert_int_equal(o.out[0], '{');
    assert_holds(o.out, "\"damaged\": 1, ");
    assert_holds(o.err, "damaged.log:2: ");
}

static void a_full_disk_is_reported(void **state)
{
    static const char *const programs[] = {"cairn-scene mug", "cairn-arena maze --places 1"};

    (void)state;
    if (access("/dev/full", W_OK) != 0)
        skip();
    for (size_t i = 0; i < sizeof programs / sizeof *programs; i++) {
        char command[256];
        outcome o;

        (void)snprintf(command, sizeof command, "%s -o '%s/full' --json", programs[i],
                       files_folder);
        o = programs_run_shell("", command, "/dev/full");
        assert_int_equal(o.code, 1);
        assert_holds(o.err, "standard output: ");
    }
}

static void poses_are_those_of_the_table(void **state)
{
    char command[512], wanted[256], *table, *object, *row, *field[6];

    (void)state;
    made("cairn-arena apartment --drive 12 --beams 91 --fov 180 -o @/drive");
    (void)snprintf(command, sizeof command, "cairn map '%s/drive/scans.log' -o '%s/map' --json",
                   files_folder, files_folder);
    assert_int_equal(programs_run_shell("", command, files_path("object")).code, 0);
    object = files_read(files_path("object"), NULL);
    table = files_read(files_path("map/poses.csv"), NULL);
    assert_non_null(object);
    assert_non_null(table);
    row = strstr(table, "\n11,");
    assert_non_null(row);
    row++;
    for (int i = 0; i < 6; i++) {
        field[i] = row;
        row = strchr(row, ',');
        assert_non_null(row);
        *row++ = '\0';
    }
    (void)snprintf(wanted, sizeof wanted, "\"x\": %s, \"y\": %s, \"theta\": %s, \"covariance\": [",
                   field[3], field[4], field[5]);
    assert_holds(object, wanted);
    free(object);
    free(table);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_is_printed_when_a_later_image_fails),
        cmocka_unit_test(quiet_leaves_the_object),
        cmocka_unit_test(the_text_is_not_printed_beside_the_object),
        cmocka_unit_test(messages_go_to_standard_error),
        cmocka_unit_test(a_full_disk_is_reported),
        cmocka_unit_test(poses_are_those_of_the_table),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, make_scene, files_teardown);
}
