/* cairn info --scans: a log as a table of ranges. */
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

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_log_becomes_a_table_that_is_read_alike),
        cmocka_unit_test(scans_of_other_beams_are_refused),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
