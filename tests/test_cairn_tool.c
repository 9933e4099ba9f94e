/* The cairn command as a user meets it: output, errors, exit codes. The program stands one folder above the tests. */
#include "tests/files.h"

#include <sys/wait.h>

static char program[512];

typedef struct outcome {
    int code;
    char out[8192];
    char err[8192];
} outcome;

static void read_into(const char *name, char *text, size_t size)
{
    char *bytes = files_read(files_path(name), NULL);

    assert_non_null(bytes);
    (void)snprintf(text, size, "%s", bytes);
    free(bytes);
}

static outcome run_to(const char *arguments, const char *output)
{
    char command[2048];
    outcome o = {0, "", ""};
    int status;

    (void)snprintf(command, sizeof command, "'%s' %s >'%s' 2>'%s'", program, arguments, output, files_path("err"));
    status = system(command);
    assert_true(WIFEXITED(status));
    o.code = WEXITSTATUS(status);
    read_into("err", o.err, sizeof o.err);
    return o;
}

static outcome run(const char *arguments)
{
    outcome o = run_to(arguments, files_path("out"));

    read_into("out", o.out, sizeof o.out);
    return o;
}

static void assert_holds(const char *string, const char *piece)
{
    if (strstr(string, piece) == NULL)
        fail_msg("\"%s\" does not hold \"%s\"", string, piece);
}

static void test_frame(void **state)
{
    outcome o = run("--help");

    (void)state;
    assert_int_equal(o.code, 0);
    assert_holds(o.out, "usage: cairn COMMAND");
    assert_holds(o.out, "  info ");
    assert_string_equal(o.err, "");
    o = run("--version");
    assert_int_equal(o.code, 0);
    assert_memory_equal(o.out, "cairn 0.", 8);
    o = run("");
    assert_int_equal(o.code, 2);
    assert_string_equal(o.out, "");
    assert_holds(o.err, "cairn: no command");
    o = run("fly");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "cairn: unknown command 'fly'");
    if (access("/dev/full", W_OK) == 0) {
        o = run_to("--help", "/dev/full");
        assert_int_equal(o.code, 1);
        assert_holds(o.err, "No space left");
    }
}

static void test_info(void **state)
{
    char log[8192] = "", arguments[1024];
    outcome o;

    (void)state;
    for (int i = 0; i < 6; i++)
        (void)snprintf(log + strlen(log), sizeof log - strlen(log),
                       "FLASER 4 1 2.5 81.9 nan %d.2 0 0 %d 0 0 %d.5 h 0\n", i, i, i);
    for (int i = 0; i < 12; i++)
        strcat(log, "FLASER 4 1 x\n");
    (void)snprintf(arguments, sizeof arguments, "info '%s'", files_write_text("a.log", log));
    o = run(arguments);
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
    /* Ten of twelve warnings, each with its line; no bar. */
    assert_holds(o.err, "a.log:7: reading 2 is \"x\", expected a number\n");
    assert_holds(o.err, "a.log:16: ");
    assert_null(strstr(o.err, "a.log:17: "));
    assert_holds(o.err, "... and 2 more damaged lines\n");
    assert_null(strstr(o.err, "%"));

    (void)snprintf(arguments, sizeof arguments, "info --quiet --range-max=2 '%s'", files_path("a.log"));
    o = run(arguments);
    assert_int_equal(o.code, 0);
    assert_string_equal(o.err, "");
    assert_holds(o.out, "no return from 2.00 m on");
    assert_holds(o.out, "25.0 % returns, 50.0 % without return");
}

static void test_bad_input(void **state)
{
    char arguments[1024];
    outcome o;

    (void)state;
    o = run("info");
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "cairn info: no log, expected LOG");
    o = run("info --help");
    assert_int_equal(o.code, 0);
    assert_holds(o.out, "usage: cairn info LOG");
    o = run("info --fast x");
    assert_int_equal(o.code, 2);
    o = run("info --range-max -1 x");
    assert_int_equal(o.code, 2);
    o = run("info a b");
    assert_int_equal(o.code, 2);
    (void)snprintf(arguments, sizeof arguments, "info '%s'", files_path("missing.log"));
    o = run(arguments);
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "missing.log: cannot open: No such file");
    (void)snprintf(arguments, sizeof arguments, "info '%s'", files_write_text("none.log", "FLASER 3 1\n"));
    o = run(arguments);
    assert_int_equal(o.code, 2);
    assert_holds(o.err, "none.log:1: the FLASER line ends early");
    assert_holds(o.err, "none.log: no whole scan in 1 lines (1 damaged)");
    assert_string_equal(o.out, "");
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_frame),
        cmocka_unit_test(test_info),
        cmocka_unit_test(test_bad_input),
    };
    const char *slash = argc > 0 ? strrchr(argv[0], '/') : NULL;

    (void)snprintf(program, sizeof program, "%.*s/../cairn", slash != NULL ? (int)(slash - argv[0]) : 1,
                   slash != NULL ? argv[0] : ".");
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
