/* The cairn command, run as a program: output, errors, exit codes. */
#include <math.h>

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
        cmocka_unit_test(test_frame),     cmocka_unit_test(test_info),
        cmocka_unit_test(test_bad_input), cmocka_unit_test(test_bags),
        cmocka_unit_test(test_topics),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
