/* cairn map -: a stream that is mapped while it comes, line by line. */
#include "tests/programs.h"

#include <math.h>
#include <signal.h>

#include "bench/bench_session.h"

/* cairn map, and streams to its standard input and from its standard output. */
typedef struct session {
    pid_t program;
    FILE *in, *out;
} session;

/* Starts "cairn map - <options>", whose errors go to the file err. */
static session start(const char *const *options)
{
    char program[1024], *argument[16];
    bench_session started;
    int count = 0;
    session s;

    (void)snprintf(program, sizeof program, "%s/cairn", programs_folder);
    argument[count++] = program;
    argument[count++] = strdup("map");
    argument[count++] = strdup("-");
    for (; *options != NULL; options++)
        argument[count++] = strdup(**options == '@' ? files_path(*options + 1) : *options);
    argument[count] = NULL;
    assert_true(bench_session_start(&started, argument, files_path("err")));
    for (int i = 1; i < count; i++)
        free(argument[i]);
    s.program = started.program;
    s.in = fdopen(started.in, "w");
    s.out = fdopen(started.out, "r");
    assert_true(s.in != NULL && s.out != NULL);
    return s;
}

/* Ends the stream unless it has ended; the exit code. What is left of the output is read. */
static int end(session *s, char *output, size_t size)
{
    size_t count;
    int status;

    if (s->in != NULL)
        (void)fclose(s->in);
    count = fread(output, 1, size - 1, s->out);
    output[count] = 0;
    (void)fclose(s->out);
    assert_int_equal(waitpid(s->program, &status, 0), s->program);
    assert_true(WIFEXITED(status));
    return WEXITSTATUS(status);
}

enum { BEAMS = 61 };

/* A scan of a room, 4 m by 3 m about the place at x = 0.05 k, as CARMEN or as JSON. */
static void send_scan(session *s, int k, int as_json)
{
    double x = 0.05 * k;

    if (as_json)
        (void)fprintf(s->in,
                      "{\"header\": {\"stamp\": {\"sec\": %d, \"nanosec\": 5}}, \"angle_min\": "
                      "-1.5, \"angle_increment\": 0.05, \"range_max\": 30, \"odometry\": [%.17g, "
                      "0, 0], \"ranges\": [",
                      100 + k, x);
    else
        (void)fprintf(s->in, "ROBOTLASER1 0 -1.5 3 0.05 30 0 0 %d", BEAMS);
    for (int i = 0; i < BEAMS; i++) {
        double angle = -1.5 + 0.05 * i;
        double ahead = (2 - x) / cos(angle), aside = 1.5 / fabs(sin(angle));

        (void)fprintf(s->in, "%s%.6f", as_json && i > 0 ? "," : " ", fmin(ahead, aside));
    }
    if (as_json)
        (void)fprintf(s->in, "]}\n");
    else
        (void)fprintf(s->in, " 0 %.17g 0 0 %.17g 0 0 0 0 0 0 0 %d.000000005 h 0\n", x, x, 100 + k);
    assert_int_equal(fflush(s->in), 0);
}

/* Reads the line of scan k. */
static void expect_line(session *s, int k)
{
    char line[1024], begin[128];
    double x = 0;

    assert_non_null(fgets(line, sizeof line, s->out));
    (void)snprintf(begin, sizeof begin, "{\"scan\":%d,\"stamp_ns\":%d000000005,\"x\":", k, 100 + k);
    assert_memory_equal(line, begin, strlen(begin));
    assert_int_equal(sscanf(line + strlen(begin), "%lf", &x), 1);
    assert_near(x, 0.05 * k, 0.01);
    assert_holds(line, ",\"theta\":");
    if (k == 0)
        assert_holds(line,
                     ",\"covariance\":[null,null,null,null,null,null],\"verdict\":\"first\"}");
    else
        assert_holds(line, ",\"verdict\":\"matched\"}\n");
}

/* The pose of each scan comes before the next scan is sent. */
static void line_by_line(void **state)
{
    static const char *const options[] = {"--live", NULL};
    char rest[4096];

    (void)state;
    for (int as_json = 0; as_json < 2; as_json++) {
        session s = start(options);

        for (int k = 0; k < 5; k++) {
            send_scan(&s, k, as_json);
            expect_line(&s, k);
        }
        assert_int_equal(end(&s, rest, sizeof rest), 0);
        assert_string_equal(rest, "");
        programs_read("err", rest, sizeof rest);
        assert_holds(rest, "scans      5 (0 damaged lines left out)\n");
    }
}

/* SIGINT ends the stream while the program waits for a scan; the map is whole. */
static void interrupt_ends(void **state)
{
    static const char *const options[] = {"--live", "-o", "@interrupted", "--quiet", NULL};
    static const char *const files[] = {"poses.csv", "poses.tum", "map.pgm",
                                        "map.yaml",  "map.svg",   "graph.g2o"};
    session s = start(options);
    char text[8192];

    (void)state;
    for (int k = 0; k < 3; k++) {
        send_scan(&s, k, 0);
        expect_line(&s, k);
    }
    assert_true(access(files_path("interrupted"), F_OK) != 0);
    assert_int_equal(kill(s.program, SIGINT), 0);
    assert_int_equal(end(&s, text, sizeof text), 0);
    assert_string_equal(text, "");
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        char name[64];

        (void)snprintf(name, sizeof name, "interrupted/%s", files[i]);
        assert_int_equal(access(files_path(name), R_OK), 0);
    }
    programs_read("interrupted/poses.csv", text, sizeof text);
    assert_holds(text, "\n2,3,102.000000005,");
    programs_read("err", text, sizeof text);
    assert_string_equal(text, "");
}

/* The files are there while the stream is open. */
static void files_while_it_runs(void **state)
{
    static const char *const options[] = {"--live", "--watch", "0.1", "-o", "@watched", NULL};
    session s = start(options);
    char rest[4096];
    int k = 0;

    (void)state;
    while (access(files_path("watched/map.pgm"), F_OK) != 0 && k < 1000) {
        send_scan(&s, k % 20, 1);
        assert_non_null(fgets(rest, sizeof rest, s.out));
        k++;
        (void)usleep(10000);
    }
    assert_int_equal(access(files_path("watched/map.yaml"), R_OK), 0);
    assert_int_equal(end(&s, rest, sizeof rest), 0);
}

/* Without --live nothing is printed until the summary; faults are reported and left out. */
static void faults_are_reported(void **state)
{
    static const char *const options[] = {"-o", "@faulty", NULL};
    session s = start(options);
    char text[8192];

    (void)state;
    (void)fprintf(s.in, "# a comment\n\n");
    send_scan(&s, 0, 0);
    (void)fprintf(s.in, "FLASER 2 1 x\n");
    send_scan(&s, 1, 0);
    assert_int_equal(end(&s, text, sizeof text), 0);
    assert_memory_equal(text, "scans      2 (1 damaged lines left out)\n", 40);
    programs_read("err", text, sizeof text);
    assert_string_equal(text, "-:4: reading 2 is \"x\", expected a number\n");
}

static void refused(void **state)
{
    static const struct {
        const char *command, *text;
    } cases[] = {{"cairn map - --live",
                  "cairn map: -: no scan, expected a CARMEN log or a LaserScan as "
                  "JSON a line\n"},
                 {"cairn map -", "no folder to write to (-o)"},
                 {"cairn map - --live --watch 1", "--watch without -o, expected a folder"},
                 {"cairn map - --live --json", "--json with --live, expected one of them"},
                 {"cairn map @/a.log --live -o @/b", "--live with "},
                 {"cairn map @/a.log --watch 2 -o @/b", "--watch with "},
                 {"cairn map - @/a.log -o @/b", "- among 2 logs, expected it alone"},
                 {"cairn map - --filter 8 -o @/b", "--filter with -, expected a file"},
                 {"cairn map - --report @/x.html -o @/b", "--report with -, expected a file"},
                 {"cairn map - --scan /scan -o @/b", "--scan or --odom with -, expected a file"}};

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        outcome o = programs_run(cases[i].command);

        assert_int_equal(o.code, 2);
        assert_holds(o.err, cases[i].text);
        assert_string_equal(o.out, "");
    }
}

/* The origin of coordinates far from 0 is printed once. */
static void far_coordinates(void **state)
{
    static const char *const options[] = {"--live", NULL};
    session s = start(options);
    char text[8192];

    (void)state;
    for (int k = 0; k < 2; k++)
        (void)fprintf(s.in, "FLASER 1 1 500000.25 5400000 0 500000.25 5400000 0 %d h %d\n", k, k);
    assert_int_equal(end(&s, text, sizeof text), 0);
    assert_holds(text, "{\"scan\":1,");
    programs_read("err", text, sizeof text);
    assert_true(strncmp(text, "-: coordinates are taken from 500000 5400000 (m)", 48) == 0);
    assert_null(strstr(text + 1, "-: coordinates"));
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(line_by_line),
        cmocka_unit_test(interrupt_ends),
        cmocka_unit_test(files_while_it_runs),
        cmocka_unit_test(faults_are_reported),
        cmocka_unit_test(refused),
        cmocka_unit_test(far_coordinates),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
