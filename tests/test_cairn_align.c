/* cairn align --no-poses and cairn match --as-written, run as programs. */
#include "tests/test.h"

#include <math.h>

#include "cairn/pose_table.h"
#include "tests/programs.h"

/* The same scans in two logs, one with poses that are nearly right, one with useless ones. */
static int make_logs(void **state)
{
    static const char *const make = "cairn-arena rescue --seed 6 --size 7x6 --places 4 --beams 121 "
                                    "--same-headings --disturb %s -o @/%s";

    if (files_setup(state) != 0)
        return 1;
    return programs_run(make, "0.02,1", "near").code != 0 ||
           programs_run(make, "3,170", "far").code != 0;
}

static int end_logs(void **state)
{
    return files_teardown(state);
}

static void assert_same(const char *first, const char *second)
{
    char *one = files_read(files_path(first), NULL), *two = files_read(files_path(second), NULL);

    assert_non_null(one);
    assert_non_null(two);
    assert_string_equal(one, two);
    free(one);
    free(two);
}

static void write_log(const char *name, const char *text)
{
    FILE *file = fopen(files_path(name), "w");

    assert_non_null(file);
    assert_true(fputs(text, file) >= 0);
    assert_int_equal(fclose(file), 0);
}

/* Mean distance from the truth that `cairn eval poses` prints, m. */
static double mean_distance(const char *folder)
{
    outcome o = programs_run("cairn eval poses @/%s/poses.csv @/near/truth.csv --json", folder);
    const char *key = strstr(o.out, "\"distance_mean_m\":");

    assert_int_equal(o.code, 0);
    assert_non_null(key);
    return atof(key + strlen("\"distance_mean_m\":"));
}

static int32_t count_verdict(const char *folder, const char *verdict)
{
    char path[128];
    cairn_pose_table_row *row;
    cairn_file_error error;
    int32_t count, found = 0;

    (void)snprintf(path, sizeof path, "%s/poses.csv", folder);
    assert_ok(cairn_pose_table_read(&row, &count, files_path(path), &error));
    assert_int_equal(count, 16);
    for (int32_t i = 0; i < count; i++)
        found += strcmp(row[i].verdict, verdict) == 0;
    cairn_pose_table_free(row);
    return found;
}

static void places_without_poses(void **state)
{
    outcome o = programs_run("cairn align @/near/scans.log --no-poses -o @/by-log");

    (void)state;
    assert_int_equal(o.code, 0);
    assert_non_null(strstr(o.out, "places     4, 4 in the largest of 1 components"));
    assert_true(count_verdict("by-log", "placed") > 8);
    assert_int_equal(count_verdict("by-log", "placed") + count_verdict("by-log", "uncertain"), 16);
    assert_true(mean_distance("by-log") < 0.1);
    o = programs_run("cairn align @/near/scans.log --no-poses --headings 4 -o @/even --quiet");
    assert_int_equal(o.code, 0);
    assert_string_equal(o.out, "");
    assert_true(mean_distance("even") < 0.15);
    assert_int_equal(
        programs_run("cairn align @/far/scans.log --no-poses --headings 4 -o @/even-far --quiet")
            .code,
        0);
    assert_same("even/poses.csv", "even-far/poses.csv");
    assert_same("even/map.pgm", "even-far/map.pgm");
}

static void as_written(void **state)
{
    outcome o = programs_run(
        "cairn align @/near/scans.log --no-poses --as-written --headings 4 -o @/written");

    (void)state;
    assert_int_equal(o.code, 0);
    assert_non_null(strstr(o.out, " scans aligned by themselves"));
    assert_non_null(strstr(o.out, "as written: wrong places are not detected"));
    assert_int_equal(count_verdict("written", "placed") + count_verdict("written", "apart"), 16);
    assert_int_equal(count_verdict("written", "uncertain"), 0);
    o = programs_run("cairn align @/far/scans.log --no-poses --as-written --headings 4 -o "
                     "@/written-far --quiet");
    assert_int_equal(o.code, 0);
    assert_same("written/poses.csv", "written-far/poses.csv");
}

static cairn_pose_table_row *read_poses(const char *folder)
{
    char path[128];
    cairn_pose_table_row *row;
    int32_t count;

    (void)snprintf(path, sizeof path, "%s/poses.csv", folder);
    assert_ok(cairn_pose_table_read(&row, &count, files_path(path), NULL));
    assert_int_equal(count, 16);
    return row;
}

/* The largest distance of a scan's poses in two folders, m. */
static double farthest(const char *first, const char *second)
{
    cairn_pose_table_row *a = read_poses(first), *b = read_poses(second);
    double most = 0;

    for (int i = 0; i < 16; i++)
        most = fmax(
            most, hypot((double)(a[i].pose.x - b[i].pose.x), (double)(a[i].pose.y - b[i].pose.y)));
    cairn_pose_table_free(a);
    cairn_pose_table_free(b);
    return most;
}

/* Force field simulation begins from the poses of the shape stage, and moves the scans by
 * decimetres at most. */
static void shape_then_forces(void **state)
{
    outcome o;

    (void)state;
    assert_int_equal(
        programs_run("cairn align @/near/scans.log --no-poses --as-written -o @/shape --quiet")
            .code,
        0);
    o = programs_run(
        "cairn align @/near/scans.log --no-poses --as-written --method gradient -o @/chain");
    assert_int_equal(o.code, 0);
    assert_non_null(strstr(o.out, "places     4, "));
    assert_non_null(strstr(o.out, "steps      50 (out of steps)\npotential "));
    assert_int_equal(count_verdict("chain", "aligned"), 16);
    assert_true(farthest("shape", "chain") > 0.01 && farthest("shape", "chain") < 0.5);
    o = programs_run("cairn align @/near/scans.log --no-poses --as-written --method gradient "
                     "--steps 1 -o @/first");
    assert_int_equal(o.code, 0);
    assert_true(farthest("shape", "first") < farthest("shape", "chain"));
}

/* Place after place, with only the order of the scans. */
static void shape_then_forces_online(void **state)
{
    outcome o = programs_run("cairn align @/near/scans.log --no-poses --as-written --online "
                             "--headings 4 --steps 10 -o @/on");

    (void)state;
    assert_int_equal(o.code, 0);
    assert_non_null(
        strstr(o.out, "places     4, 4 of them matched by shape\nsteps      40 (out of steps)"));
    assert_int_equal(count_verdict("on", "aligned"), 16);
    o = programs_run("cairn align @/far/scans.log --no-poses --as-written --online --headings 4 "
                     "--steps 10 -o @/on-far");
    assert_int_equal(o.code, 0);
    assert_same("on/poses.csv", "on-far/poses.csv");
    o = programs_run("cairn align @/far/scans.log --no-poses --as-written --method gradient "
                     "--headings 4 --steps 10 "
                     "-o @/off --quiet");
    assert_int_equal(o.code, 0);
    assert_true(farthest("on", "off") > 1e-3);
}

static int32_t count_in(const char *text, const char *piece)
{
    int32_t count = 0;

    for (text = strstr(text, piece); text != NULL; text = strstr(text + 1, piece))
        count++;
    return count;
}

/* Figures 6.6 and 6.7: nothing else differs between them. */
static void pictures_as_written(void **state)
{
    static const char *const panels[] = {"(a) by shape", "(b) + ICP", "(c) decoupled",
                                         "(d) poses of the log"};
    outcome o = programs_run("cairn align @/near/scans.log --no-poses --as-written --headings 4 "
                             "--pictures -o @/drawn --quiet");
    char *text;

    (void)state;
    assert_int_equal(o.code, 0);
    assert_int_equal(
        programs_run("cairn align @/near/scans.log --no-poses --as-written --headings 4 -o @/plain")
            .code,
        0);
    assert_same("drawn/poses.csv", "plain/poses.csv");
    assert_int_equal(access(files_path("plain/errors.svg"), F_OK), -1);
    text = files_read(files_path("drawn/stages.svg"), NULL);
    assert_non_null(text);
    for (size_t k = 0; k < sizeof panels / sizeof *panels; k++)
        assert_int_equal(count_in(text, panels[k]), 1);
    /* of all maps but the last, which has the actual poses */
    assert_int_equal(count_in(text, ">error "), sizeof panels / sizeof *panels - 1);
    free(text);
    text = files_read(files_path("drawn/errors.svg"), NULL);
    assert_non_null(text);
    assert_non_null(strstr(text, "Fig. 6.6"));
    assert_non_null(strstr(text, "pose in the log"));
    free(text);
}

static void matches_as_written(void **state)
{
    static const char *const files[] = {"match.json",    "match.svg", "tangents.svg",
                                        "histogram.svg", "pairs.svg", "filters.svg"};
    outcome o = programs_run("cairn match @/near/scans.log:0 @/near/scans.log:4 --as-written "
                             "--json --pictures -o @/match");

    (void)state;
    assert_int_equal(o.code, 0);
    assert_non_null(strstr(o.out, "\"method\": \"as_written\""));
    assert_non_null(strstr(o.out, "\"candidates\": 5"));
    for (size_t k = 0; k < sizeof files / sizeof *files; k++) {
        char path[64];

        (void)snprintf(path, sizeof path, "match/%s", files[k]);
        assert_int_equal(access(files_path(path), F_OK), 0);
    }
    o = programs_run("cairn match @/near/scans.log:0 @/near/scans.log:4 --as-written --start 0,0,0 "
                     "--window 1,4 --json");
    assert_int_equal(o.code, 0);
    assert_non_null(strstr(o.out, "\"candidates\": 9"));
}

static void assert_line_refused(const char *command, const char *piece)
{
    outcome o = programs_run("%s", command);

    assert_int_equal(o.code, 2);
    if (strstr(o.err, piece) == NULL)
        fail_msg("%s: '%s' does not hold '%s'", command, o.err, piece);
    assert_int_equal(access(files_path("no"), F_OK), -1);
}

static void options_that_do_not_go_together(void **state)
{
    static const char *const sample[][2] = {
        {"--no-poses --method default", "--method with --no-poses: matching whole places"},
        {"--no-poses --spread 1,5", "--spread with --no-poses: there are no initial poses"},
        {"--no-poses --virtual",
         "--virtual with --no-poses: hypotheses need initial poses of the scans"},
        {"--no-poses --steps 3", "--steps with --no-poses: the method does not iterate"},
        {"--no-poses --report x.html",
         "--report with --no-poses: the method has no iterations to play"},
        {"--no-poses --method gradient", "--method with --no-poses: matching whole places"},
        {"--no-poses --as-written --method lum", "--method with --no-poses: matching whole places"},
        {"--no-poses --online", "--online with --no-poses: gradient descent needs initial poses"},
        {"--no-poses --as-written --steps 3",
         "--steps with --no-poses: the method does not iterate"},
        {"--no-poses --as-written --online --report x.html",
         "--report with --online: the player needs all scans"},
        {"--no-poses --as-written --online --virtual",
         "--virtual with --no-poses: hypotheses need initial poses"},
        {"--as-written --pictures", "--pictures with a map other than --no-poses --as-written"},
        {"--no-poses --pictures", "--pictures with a map other than --no-poses --as-written"},
        {"--no-poses --as-written --online --pictures",
         "--pictures with gradient: they show places"},
        {"--no-poses --as-written --online --headings 5",
         "holds 16 scans, expected a multiple of --headings 5"},
        {"--no-poses --as-written --online --pool 1K", "--pool is '1K', expected at least"},
        {"--headings 4", "--headings with the poses of the log: the number of scans of a place"},
        {"--no-poses --as-written --spacing 0.1",
         "--spacing with --as-written: it uses the raw readings"},
        {"--no-poses --headings 0", "--headings is '0', expected a whole number from 1 to 64"},
        {"--no-poses --headings 5", "holds 16 scans, expected a multiple of --headings 5"},
        {"--no-poses --headings 16", "holds one place, expected two or more"},
        {"--no-poses --pool 1K", "--pool is '1K', expected at least"},
    };
    char line[256];

    (void)state;
    for (size_t k = 0; k < sizeof sample / sizeof *sample; k++) {
        (void)snprintf(line, sizeof line, "cairn align @/near/scans.log -o @/no %s", sample[k][0]);
        assert_line_refused(line, sample[k][1]);
    }
    assert_line_refused("cairn match a b --as-written --method shape",
                        "--as-written with --method, expected one of them");
    assert_line_refused("cairn match a b --as-written --spacing 0.1",
                        "--as-written with --spacing, expected without");
}

static void logs_that_hold_little(void **state)
{
    static const char *const blind =
        "FLASER 3 0 0 0 0 0 0 0 0 0 1 h 1\nFLASER 3 0 0 0 9 0 0 9 0 0 2 h 2\n";
    static const char *const odd =
        "FLASER 3 nan 1e9 -5 0 0 0 0 0 0 1 h 1\nFLASER 3 2 2.1 2 9 0 0 9 0 0 2 h 2\n"
        "FLASER 3 2 2.1 2 nan 0 0 9 0 0 2 h 2\n";

    (void)state;
    write_log("empty.log", "");
    write_log("blind.log", blind);
    write_log("odd.log", odd);
    assert_int_not_equal(programs_run("cairn align @/empty.log --no-poses -o @/no").code, 0);
    assert_line_refused("cairn align @/blind.log --no-poses -o @/no", "no scan shows a wall");
    for (int k = 0; k < 2; k++) {
        outcome o = programs_run("cairn align @/odd.log --no-poses --headings 1 %s -o @/odd",
                                 k == 1 ? "--as-written" : "");

        assert_true(o.code == 0 || o.code == 2); /* damaged lines are skipped */
        assert_true(o.code == 0 || strncmp(o.err, "cairn align: ", 13) == 0 ||
                    strstr(o.err, "odd.log:") != NULL);
    }
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(places_without_poses),
        cmocka_unit_test(as_written),
        cmocka_unit_test(shape_then_forces),
        cmocka_unit_test(shape_then_forces_online),
        cmocka_unit_test(pictures_as_written),
        cmocka_unit_test(matches_as_written),
        cmocka_unit_test(options_that_do_not_go_together),
        cmocka_unit_test(logs_that_hold_little),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, make_logs, end_logs);
}
