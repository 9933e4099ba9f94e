/* The cairn command, run as a program: output, errors, exit codes. */
#include <math.h>

#include "cairn/map_file.h"
#include "tests/bag_writer.h"
#include "tests/programs.h"

static void test_frame(void **state)
{
    outcome o = programs_run("cairn --help");

    (void)state;
    assert_int_equal(o.code, 0);
    assert_holds(o.out, "usage: cairn COMMAND");
    assert_holds(o.out, "  info ");
    assert_string_equal(o.err, "");
    o = programs_run("cairn --version");
    assert_int_equal(o.code, 0);
    assert_memory_equal(o.out, "cairn 0.", 8);
    o = programs_run("cairn");
    assert_int_equal(o.code, 2);
    assert_string_equal(o.out, "");
    assert_holds(o.err, "cairn: no command");
    o = programs_run("cairn fly");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "cairn: unknown command 'fly'");
    if (access("/dev/full", W_OK) == 0) {
        o = programs_run_shell("", "cairn --help", "/dev/full");
        assert_int_equal(o.code, 1);
        assert_holds(o.err, "No space left");
    }
}

/* Libraries are looked for beside the program and in the lib beside its folder, not above it,
 * where another user may have put one. */
static void test_planted_library(void **state)
{
    outcome o;
    char command[1400];

    (void)state;
    assert_int_equal(mkdir(files_path("planted"), 0777), 0);
    assert_int_equal(mkdir(files_path("planted/bin"), 0777), 0);
    (void)files_write_text("planted/libcairn-vision.so", "no library");
    (void)files_write_text("four.pgm", "P5 2 2 255\n....");
    (void)snprintf(command, sizeof command, "cp '%s/cairn' '%s/planted/bin/cairn'", programs_folder,
                   files_folder);
    assert_int_equal(system(command), 0);
    (void)snprintf(
        command, sizeof command,
        "LD_DEBUG=files '%s/planted/bin/cairn' skeleton '%s/four.pgm' -o '%s/planted/out' "
        ">'%s/out' 2>'%s/err'",
        files_folder, files_folder, files_folder, files_folder, files_folder);
    (void)system(command);
    programs_read("err", o.err, sizeof o.err);
    if (strstr(o.err, "libc.so") == NULL)
        skip(); /* not glibc */
    command[0] = '\0';
    (void)snprintf(command, sizeof command, "grep -q 'file=.*/bin/../libcairn-vision.so' '%s/err'",
                   files_folder);
    assert_int_not_equal(system(command), 0);
}

/* The most occupied of the cells of a map about a point: -1 unknown, -2 outside the map. */
static int cell_at(const cairn_map_file *map, double x, double y)
{
    int column = (int)floor((x - (double)map->origin.x) / (double)map->resolution),
        row = (int)floor((y - (double)map->origin.y) / (double)map->resolution);
    int8_t most = -2;

    for (int v = row - 1; v <= row + 1; v++)
        for (int u = column - 1; u <= column + 1; u++)
            if (u >= 0 && v >= 0 && u < map->width && v < map->height &&
                map->occupancy[v * map->width + u] > most)
                most = map->occupancy[v * map->width + u];
    return most;
}

/* Beams without return clear what they pass only of a scanner that sees no farther than --clear,
 * those that return all that they pass; the picture covers all that was seen, be it once. */
static void test_free_space(void **state)
{
    static const struct {
        const char *option;
        double free_m, unknown_m; /* on the beams without return */
        int sees_wall;            /* that 6 m to the left */
    } cases[] = {{"", 0, 1, 1},
                 {"--clear 79", 0, 1, 1},
                 {"--clear 85", 29, 31, 1},
                 {"--clear 85 --range 20", 19, 21, 1},
                 {"--range-max 5", 4.5, 5.5, 0},
                 {"--range-max 5 --clear 4", 0, 1, 0}};
    char *log = calloc(1, 200000), *at = log;

    (void)state;
    assert_non_null(log);
    /* No return on the right, a wall 6 m to the left, and once a far point of it. */
    for (int scan = 0; scan < 30; scan++) {
        at += sprintf(at, "FLASER 181");
        for (int i = 0; i <= 180; i++) {
            double angle = (i - 90) * 3.14159265358979 / 180, range = 6 / sin(angle);

            at += sprintf(at, " %.3f",
                          i <= 90 || (i < 104 && (i != 103 || scan != 7)) ? 81.9 : range);
        }
        at += sprintf(at, " 0 0 0 0 0 0 %d.0 h %d.0\n", scan, scan);
    }
    (void)files_write_text("open.log", log);
    free(log);
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        outcome o = programs_run("cairn map --quiet %s @/open.log -o @/open", cases[k].option);
        cairn_map_file map;
        cairn_file_error error;

        assert_int_equal(o.code, 0);
        assert_ok(cairn_map_file_read(&map, files_path("open/map.yaml"), &error));
        if (cases[k].free_m > 0)
            assert_int_equal(cell_at(&map, 0, -cases[k].free_m), 0);
        assert_true(cell_at(&map, 0, -cases[k].unknown_m) < 0);
        assert_int_equal(cell_at(&map, 0, 6) == 100, cases[k].sees_wall);
        if (cases[k].sees_wall) {
            assert_int_equal(cell_at(&map, 0, 5), 0);
            /* 6 / tan(13 degrees), seen once; the beams of other scans clear it if they may. */
            assert_int_equal(cell_at(&map, 25.989, 6), strstr(cases[k].option, "--range 20") != NULL
                                                           ? -2
                                                       : cases[k].free_m > 0 ? 0
                                                                             : 100);
        }
        cairn_map_file_free(&map);
    }
}

/* A log in coordinates of a national grid maps as one at 0, in double and in float, and says so. */
static void test_far_coordinates(void **state)
{
    static const char *const program = sizeof(cairn_real) == 8 ? "cairn" : "cairn-float";
    char *near_poses, *far_poses;
    outcome o;

    (void)state;
    for (int far = 0; far < 2; far++) {
        char *log = calloc(1, 200000), *at = log;

        assert_non_null(log);
        for (int scan = 0; scan < 12; scan++) {
            double x = 0.25 * scan + far * 500000.0, y = far * 5400000.0;

            at += sprintf(at, "FLASER 181");
            for (int i = 0; i <= 180; i++) {
                double angle = (i - 90) * 3.14159265358979 / 180,
                       side = (angle < 0 ? 3.0 : 4.0) / fmax(fabs(sin(angle)), 1e-9),
                       ahead = (9 - 0.25 * scan) / fmax(cos(angle), 1e-9);

                at += sprintf(at, " %.3f", fmin(side, ahead));
            }
            at += sprintf(at, " %.2f %.2f 0 %.2f %.2f 0 %d.0 h %d.0\n", x, y, x, y, scan, scan);
        }
        (void)files_write_text(far ? "far.log" : "near.log", log);
        free(log);
    }
    o = programs_run("%s map --quiet @/near.log -o @/near", program);
    assert_int_equal(o.code, 0);
    o = programs_run("%s map @/far.log -o @/far", program);
    assert_int_equal(o.code, 0);
    assert_holds(o.err, "far.log: coordinates are taken from 500000 5400000");
    near_poses = files_read(files_path("near/poses.csv"), NULL);
    far_poses = files_read(files_path("far/poses.csv"), NULL);
    assert_string_equal(far_poses, near_poses);
    free(near_poses);
    free(far_poses);
    o = programs_run("%s align --quiet @/far.log -o @/far", program);
    assert_int_equal(o.code, 0);
}

static void test_info(void **state)
{
    char log[8192] = "";
    outcome o;

    (void)state;
    for (int i = 0; i < 6; i++)
        (void)snprintf(log + strlen(log), sizeof log - strlen(log),
                       "FLASER 4 1 2.5 81.9 nan %d.2 0 0 %d 0 0 %d.5 h 0\n", i, i, i);
    for (int i = 0; i < 12; i++)
        strcat(log, "FLASER 4 1 x\n");
    (void)files_write_text("a.log", log);
    o = programs_run("cairn info @/a.log");
    assert_int_equal(o.code, 0);
    assert_holds(o.out, "scans        6 in 18 lines\n");
    assert_holds(o.out, "beams        4 a scan\n");
    assert_holds(o.out, "bearings     -90.00 to 45.00 degrees");
    assert_holds(o.out, "ranges       up to 2.50 m; no return from 80.00 m on\n");
    assert_holds(o.out, "of beams     50.0 % returns, 25.0 % without return, 25.0 % unknown\n");
    assert_holds(o.out, "time         0.5 to 5.5, 5.0 s, 1.00 scans/s\n");
    assert_holds(o.out, "path         5.0 m, 0 degrees");
    assert_holds(o.out, "sensor       0.200 m, 0.000 m, 0.00 degrees on the robot\n");
    assert_holds(o.out, "messages     0 odometry lines, 0 of other kinds, 12 damaged\n");
    /* Ten of twelve warnings, each with its line; no progress bar. */
    assert_holds(o.err, "a.log:7: reading 2 is \"x\", expected a number\n");
    assert_holds(o.err, "a.log:16: ");
    assert_null(strstr(o.err, "a.log:17: "));
    assert_holds(o.err, "... and 2 more damaged lines\n");
    assert_null(strstr(o.err, "%"));

    /* The widest span of time, and one beyond it. */
    (void)files_write_text("wide.log", "FLASER 1 1 0 0 0 0 0 0 -4e9 h 1\n"
                                       "FLASER 1 1 0 0 0 0 0 0 9e9 h 1\n"
                                       "FLASER 1 1 0 0 0 0 0 0 4e9 h 1\n");
    o = programs_run("cairn info @/wide.log");
    assert_int_equal(o.code, 0);
    assert_holds(o.out, "time         -4000000000 to 4000000000, 8000000000.0 s");
    assert_holds(o.err, "wide.log:2: the stamp is \"9e9\", expected seconds within 4e9");

    o = programs_run("cairn info --quiet --range-max=2 @/a.log");
    assert_int_equal(o.code, 0);
    assert_string_equal(o.err, "");
    assert_holds(o.out, "no return from 2.00 m on");
    assert_holds(o.out, "25.0 % returns, 50.0 % without return");
}

static void test_bad_input(void **state)
{
    outcome o;

    (void)state;
    o = programs_run("cairn info");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "cairn info: no log, expected LOG");
    o = programs_run("cairn help info");
    assert_int_equal(o.code, 0);
    assert_holds(o.out, "usage: cairn info LOG");
    o = programs_run("cairn help no-command");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "cairn: unknown command 'no-command'");
    o = programs_run("cairn info --help");
    assert_int_equal(o.code, 0);
    assert_holds(o.out, "usage: cairn info LOG");
    o = programs_run("cairn info --fast x");
    assert_int_equal(o.code, 2);
    o = programs_run("cairn info --range-max -1 x");
    assert_int_equal(o.code, 2);
    o = programs_run("cairn info a b");
    assert_int_equal(o.code, 2);
    o = programs_run("cairn info @/missing.log");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "missing.log: cannot open: No such file");
    (void)files_write_text("none.log", "FLASER 3 1\n");
    o = programs_run("cairn info @/none.log");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "none.log:1: the FLASER line ends early");
    assert_holds(o.err, "none.log: no whole scan in 1 lines (1 damaged)");
    assert_string_equal(o.out, "");
}

/* A bag of ROS 1 with two scans on each of `topics` topics and odometry; odometry 0: without. */
static void write_bag(const char *name, int topics, int odometry)
{
    static const char *const topic[] = {"/scan", "/rear"};
    float range[25];
    bag_recording recording = {.encoding = BAG_ROS1};
    bag_bytes file;

    /* a wall ahead, and nothing to its left */
    for (int i = 0; i < 25; i++)
        range[i] = i < 20 ? 2 / cosf(-0.5F + 0.05F * (float)i) : 30;
    for (int i = 0; i < topics; i++)
        (void)bag_topic(&recording, topic[i], "sensor_msgs/LaserScan");
    (void)bag_topic(&recording, "/odom", "nav_msgs/Odometry");
    for (int k = 0; k < 2; k++) {
        int64_t time = (5 + k) * INT64_C(1000000000);
        bag_scan scan = {.stamp_ns = time,
                         .frame = "base_link",
                         .angle_min = -0.5F,
                         .angle_step = 0.05F,
                         .range_max = 30,
                         .range = range,
                         .count = 25};
        bag_transform pose = {time, "odom", "base_link", {k, 0, 0, 0, 0, 0, 1}};

        for (int i = 0; i < topics; i++)
            bag_record(&recording, i, time, bag_laser_scan(BAG_ROS1, &scan));
        if (odometry)
            bag_record(&recording, topics, time, bag_odometry(BAG_ROS1, &pose));
    }
    file = bag_write_ros1(&recording, BAG_NONE);
    (void)files_write(name, file.data, file.count);
    bag_free(&file);
    bag_recording_free(&recording);
}

static void test_bags(void **state)
{
    static const char taken[] = "scan /scan (2), odometry /odom, sensor at 0.00 0.00 "
                                "0.0\302\260, the robot's frame\n";
    outcome o;

    (void)state;
    write_bag("one.bag", 1, 1);
    o = programs_run("cairn info @/one.bag");
    assert_int_equal(o.code, 0);
    assert_string_equal(o.err, "");
    assert_holds(o.out, "taken        ");
    assert_holds(o.out, taken);
    assert_holds(o.out, "scans        2 in 4 messages\n");
    assert_holds(o.out, "bearings     -28.65 to 40.11 degrees");
    assert_holds(o.out, "of beams     80.0 % returns, 20.0 % without return");
    assert_holds(o.out, "messages     2 odometry messages, 0 of other kinds, 0 damaged\n");
    /* said by every command that reads it, unless it is to be quiet */
    o = programs_run("cairn map @/one.bag -o @/one");
    assert_int_equal(o.code, 0);
    assert_holds(o.err, taken);
    o = programs_run("cairn map @/one.bag -o @/one --quiet");
    assert_int_equal(o.code, 0);
    assert_string_equal(o.err, "");
    o = programs_run("cairn align @/one.bag -o @/aligned");
    assert_int_equal(o.code, 0);
    assert_holds(o.err, taken);
    o = programs_run("cairn eval map @/one.bag");
    assert_int_equal(o.code, 0);
    assert_holds(o.err, taken);
}

static void test_topics(void **state)
{
    static const char *const commands[] = {"info", "map -o @/two", "align -o @/two", "eval map",
                                           "match -o @/two @/one.bag"};
    char line[256];
    outcome o;

    (void)state;
    write_bag("two.bag", 2, 1);
    write_bag("none.bag", 1, 0);
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++) {
        (void)snprintf(line, sizeof line, "cairn %s @/two.bag", commands[i]);
        o = programs_run(line);
        assert_int_equal(o.code, 2);
        assert_holds(o.err, "two.bag: 2 topics of scans, expected one named by --scan: /scan "
                            "(sensor_msgs/LaserScan, 2), /rear (sensor_msgs/LaserScan, 2)\n");
        assert_string_equal(o.out, "");
    }
    assert_true(access(files_path("two"), F_OK) != 0);
    o = programs_run("cairn info @/two.bag --scan /rear --odom odom");
    assert_int_equal(o.code, 0);
    assert_holds(o.out, "scan /rear (2), odometry /odom, ");
    o = programs_run("cairn info @/two.bag --scan /front");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "two.bag: no topic /front of scans, expected one of: /scan ");
    o = programs_run("cairn info @/a.log --scan /scan");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "a.log: no bag, expected one with the topic /scan\n");
    /* poses of scans that have none */
    o = programs_run("cairn align @/none.bag -o @/two");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "none.bag has no odometry, expected poses of its scans\n");
    o = programs_run("cairn eval map @/none.bag");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "none.bag has no odometry, expected poses of its scans\n");
    o = programs_run("cairn map @/none.bag -o @/two");
    assert_int_equal(o.code, 0);
    assert_holds(o.err, "scan /scan (2), no odometry, ");
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_frame),      cmocka_unit_test(test_planted_library),
        cmocka_unit_test(test_free_space), cmocka_unit_test(test_far_coordinates),
        cmocka_unit_test(test_info),       cmocka_unit_test(test_bad_input),
        cmocka_unit_test(test_bags),       cmocka_unit_test(test_topics),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
