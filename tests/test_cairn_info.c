/* cairn info: a log as a table of ranges (--scans); faults of the scanner's set-up (--check). */
#include <math.h>

#include "tests/programs.h"

/* Three beams to -90, 0 and 90 degrees; the laser is 0.25 m ahead of the robot. */
#define LOG                                                                                        \
    "PARAM robot_frontlaser_offset 0.25 h 0\nPARAM robot_front_laser_max 8 h 0\n"                  \
    "FLASER 3 2.5 8 0.1 1.25 2 0 1 2 0 12.5 h 12.5\n"                                              \
    "FLASER 3 0 nan 3.1 0.25 0 0 0 0 0 13.000000001 h 13\n"

static void a_log_becomes_a_table_that_is_read_alike(void **state)
{
    char *table;
    outcome o, again;

    (void)state;
    files_write_text("a.log", LOG);
    o = programs_run("cairn info @/a.log --scans @/a.csv --json");
    assert_int_equal(o.code, 0);
    table = files_read(files_path("a.csv"), NULL);
    assert_true(table != NULL && strncmp(table, "time,x,y,theta,", 15) == 0);
    assert_holds(table, "\n12.5,1.25,2,0,2.5,inf,0.100000001\n");
    assert_holds(table, "\n13.000000001,0.25,0,0,0,nan,3.0999999\n");
    free(table);
    again = programs_run("cairn info @/a.csv --json");
    assert_int_equal(again.code, 0);
    assert_holds(o.out, "\"returns\": 3, \"no_returns\": 1, \"unknown\": 2,");
    assert_holds(again.out, "\"returns\": 3, \"no_returns\": 1, \"unknown\": 2,");
    assert_holds(again.out, "\"first_bearing_deg\": -90");
}

static void scans_of_other_beams_are_refused(void **state)
{
    outcome o;

    (void)state;
    files_write_text("b.log", LOG "FLASER 2 1 1 0 0 0 0 0 0 14 h 14\n");
    o = programs_run("cairn info @/b.log --scans @/b.csv");
    assert_int_equal(o.code, 2);
    assert_string_equal(o.out, "");
    assert_holds(o.err, "b.csv: scan 2 has other bearings than the first one (beam ");
    assert_int_equal(access(files_path("b.csv"), F_OK), -1);
}

/* ---- --check ---- */

/* A drive through an office, in drive/scans.log. */
static void make_drive(void)
{
    outcome o =
        programs_run("cairn-arena office --seed 3 --drive 120 --fov 180 --beams 181 -o @/drive");

    assert_int_equal(o.code, 0);
}

/* Runs the check; the fault line, or its absence, and the option that mends it. */
static void assert_found(const char *log, const char *fault)
{
    outcome o = programs_run("cairn info @/%s --check", log);

    assert_int_equal(o.code, 0);
    assert_holds(o.out, fault);
    assert_true(strstr(o.out, "no fault found") == NULL);
}

static void assert_silent(const char *log, const char *options)
{
    outcome o = programs_run("cairn info @/%s --check %s", log, options);

    assert_int_equal(o.code, 0);
    assert_holds(o.out, "no fault found");
    assert_true(strstr(o.out, "fault        ") == NULL);
}

static void faults_of_the_scanner_are_named_with_the_option_that_mends_them(void **state)
{
    (void)state;
    make_drive();
    assert_silent("drive/scans.log", "");
    /* the options make a log wrong as they mend it */
    assert_int_equal(programs_run("cairn info @/drive/scans.log --flip --scans @/flip.csv").code,
                     0);
    assert_found("flip.csv", "; mended by --flip\n");
    assert_silent("flip.csv", "--flip");
    assert_int_equal(
        programs_run("cairn info @/drive/scans.log --range-scale 1000 --scans @/mm.csv").code, 0);
    assert_found("mm.csv", "; mended by --range-scale 0.001\n");
    assert_silent("mm.csv", "--range-scale 0.001");
    assert_int_equal(
        programs_run("cairn info @/drive/scans.log --angle-step 1.02 --scans @/step.csv").code, 0);
    assert_found("step.csv", "; mended by --angle-step ");
    assert_silent("step.csv", "--angle-step 1");
    /* a small error needs the map */
    assert_int_equal(
        programs_run("cairn info @/drive/scans.log --angle-step 1.008 --scans @/small.csv").code,
        0);
    assert_found("small.csv", "; overlapping scans of its map agree with 0.99");
    assert_int_equal(
        programs_run("cairn info @/drive/scans.log --sensor=-0.25,0,0 --scans @/at.csv").code, 0);
    assert_found("at.csv", "; mended by --sensor 0.2");
    assert_silent("at.csv", "--sensor 0.25,0,0");
}

static void a_map_of_a_wrong_log_names_the_check(void **state)
{
    static const struct {
        const char *option, *what;
    } cases[] = {{"--range-scale 1000", "most scans have no match"},
                 {"--flip", "most matches contradict the odometry"}};
    outcome o;

    (void)state;
    make_drive();
    o = programs_run("cairn map @/drive/scans.log -o @/map");
    assert_int_equal(o.code, 0);
    assert_string_equal(o.err, "");
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        o = programs_run("cairn info @/drive/scans.log %s --scans @/wrong.csv", cases[i].option);
        assert_int_equal(o.code, 0);
        o = programs_run("cairn map @/wrong.csv -o @/map");
        assert_int_equal(o.code, 0);
        assert_holds(o.err, cases[i].what);
        assert_holds(o.err, ": cairn info LOG --check looks for what is wrong with the scanner\n");
        o = programs_run("cairn map @/wrong.csv -o @/map --quiet");
        assert_string_equal(o.err, "");
    }
}

/* Reads the poses of a map; fails unless there are `count`. */
static void read_poses(const char *name, double (*pose)[3], int32_t count)
{
    char *text = files_read(files_path(name), NULL), *line;
    int32_t read = 0;

    assert_non_null(text);
    for (line = strchr(text, '\n'); line != NULL && line[1] != '\0' && read < count;
         line = strchr(line + 1, '\n'), read++)
        assert_int_equal(sscanf(line + 1, "%*[^,],%*[^,],%*[^,],%lf,%lf,%lf", &pose[read][0],
                                &pose[read][1], &pose[read][2]),
                         3);
    assert_int_equal(read, count);
    free(text);
}

static void a_map_of_a_field_of_view_one_beam_too_wide_is_that_of_the_right_one(void **state)
{
    enum { SCANS = 200 };
    static double right[SCANS][3], mended[SCANS][3], kept[SCANS][3];
    double mended_error = 0, kept_error = 0;
    outcome o;

    (void)state;
    assert_int_equal(programs_run("cairn-arena office --seed 2 --drive 200 --fov 179 --beams 180 "
                                  "-o @/beam")
                         .code,
                     0);
    o = programs_run("cairn info @/beam/scans.log --angle-step 1.00558659 --scans @/wide.csv");
    assert_int_equal(o.code, 0);
    o = programs_run("cairn map @/beam/scans.log -o @/right");
    assert_string_equal(o.err, "");
    o = programs_run("cairn map @/wide.csv -o @/mended");
    assert_int_equal(o.code, 0);
    assert_holds(o.err, "wide.csv: mapped with an angle step of 1 degrees in place of 1.0056: ");
    assert_holds(o.err, "; --keep-angle-step maps with that of the log\n");
    o = programs_run("cairn map @/wide.csv -o @/kept --keep-angle-step");
    assert_int_equal(o.code, 0);
    assert_string_equal(o.err, "");
    o = programs_run("cairn map @/wide.csv -o @/stated --angle-step 1.00558659");
    assert_string_equal(o.err, "");
    o = programs_run("cairn map @/wide.csv -o @/mended --quiet");
    assert_string_equal(o.err, "");
    read_poses("right/poses.csv", right, SCANS);
    read_poses("mended/poses.csv", mended, SCANS);
    read_poses("kept/poses.csv", kept, SCANS);
    for (int32_t i = 0; i < SCANS; i++) {
        mended_error +=
            hypot(mended[i][0] - right[i][0], mended[i][1] - right[i][1]) / (double)SCANS;
        kept_error += hypot(kept[i][0] - right[i][0], kept[i][1] - right[i][1]) / (double)SCANS;
    }
    assert_true(mended_error < 0.002);
    assert_true(kept_error > 5 * mended_error);
}

static void what_the_check_cannot_see_is_said(void **state)
{
    outcome o;

    (void)state;
    files_write_text("one.csv", "time,x,y,theta,-90,0,90\n0,0,0,0,2,3,2\n");
    o = programs_run("cairn info @/one.csv --check");
    assert_int_equal(o.code, 0);
    assert_holds(o.out, "no fault found");
    assert_holds(o.out, "flip: not observable: one scan\n");
    files_write_text("still.csv", "time,-90,0,90\n0,2,3,2\n1,2,3,2\n");
    o = programs_run("cairn info @/still.csv --check --json");
    assert_int_equal(o.code, 0);
    assert_holds(o.out, "\"turn_ratio\": null");
    assert_holds(o.out, "\"faults\": []");
    o = programs_run("cairn info @/still.csv --check");
    assert_holds(o.out, "sensor's heading: not observable: no odometry that moves\n");
    files_write_text("empty.csv", "time,-90,0,90\n");
    o = programs_run("cairn info @/empty.csv --check");
    assert_int_equal(o.code, 2);
    assert_string_equal(o.out, "");
    o = programs_run("cairn info -");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "-: standard input is read by cairn map alone, expected a file\n");
    o = programs_run("cairn info @/one.csv --sensor 1,2");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "--sensor is '1,2', expected three numbers X,Y,DEG");
}

static void ranges_of_a_stream_are_not_scaled(void **state)
{
    outcome o;

    (void)state;
    o = programs_run("cairn map - --live --range-scale 0.001");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "--range-scale with -, expected a file");
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_log_becomes_a_table_that_is_read_alike),
        cmocka_unit_test(scans_of_other_beams_are_refused),
        cmocka_unit_test(faults_of_the_scanner_are_named_with_the_option_that_mends_them),
        cmocka_unit_test(a_map_of_a_wrong_log_names_the_check),
        cmocka_unit_test(a_map_of_a_field_of_view_one_beam_too_wide_is_that_of_the_right_one),
        cmocka_unit_test(what_the_check_cannot_see_is_said),
        cmocka_unit_test(ranges_of_a_stream_are_not_scaled),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
