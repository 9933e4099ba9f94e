/* Files of cairn-arena: log, truth, JSON, picture; locale and full disk. */
#include "tests/test.h"

#include <locale.h>
#include <math.h>

#include "sim/files.h"

static const double pi = 3.14159265358979323846;

static sim_survey *survey_of(sim_arena **arena, double fov)
{
    sim_arena_options where = sim_arena_default();
    sim_survey_options options = sim_survey_default();

    where.seed = 3;
    options.seed = 3;
    options.places = 3;
    options.headings = 2;
    options.fov = fov;
    options.beams = 181;
    options.range_max = 4;
    options.dropout = 0.05;
    options.base_sensor.x = 0.1;
    options.base_sensor.theta = 0.2;
    options.scan_time = 0.05;
    *arena = sim_arena_create(&where, NULL, 0);
    return sim_survey_create(*arena, &options, NULL, 0);
}

/* The whole file as text, to be freed by the caller. */
static char *text_of(FILE *file)
{
    long size;
    char *text;

    assert_int_equal(fseek(file, 0, SEEK_END), 0);
    size = ftell(file);
    rewind(file);
    text = malloc((size_t)size + 1);
    assert_non_null(text);
    assert_int_equal(fread(text, 1, (size_t)size, file), (size_t)size);
    text[size] = '\0';
    fclose(file);
    return text;
}

static char *log_of(const sim_survey *survey, const sim_pose *poses, const char *command)
{
    FILE *file = tmpfile();

    assert_non_null(file);
    assert_int_equal(sim_write_log(survey, poses, command, file), 0);
    return text_of(file);
}

/* The next number of a line; advances the text. */
static double number(char **text)
{
    char *end;
    double value = strtod(*text, &end);

    assert_ptr_not_equal(end, *text);
    *text = end;
    return value;
}

static void expect(char **text, const char *words)
{
    size_t length = strlen(words);

    if (strncmp(*text, words, length) != 0)
        fail_msg("'%.30s' where '%s' was expected", *text, words);
    *text += length;
}

static void expect_pose(char **text, sim_pose pose)
{
    assert_near(number(text), pose.x, 1e-8);
    assert_near(number(text), pose.y, 1e-8);
    assert_near(number(text), pose.theta, 6e-9);
}

static sim_pose laser_on(sim_pose robot)
{
    sim_pose laser = {robot.x + 0.1 * cos(robot.theta), robot.y + 0.1 * sin(robot.theta),
                      remainder(robot.theta + 0.2, 2 * pi)};
    return laser;
}

static void check_log(double fov, int32_t disturbed)
{
    sim_arena *arena;
    sim_survey *survey = survey_of(&arena, fov);
    int32_t count, half_turn = fabs(fov - pi) < 1e-9, infinite = 0, lost = 0;
    const sim_scan *scans = sim_survey_scans(survey, &count);
    sim_pose poses[6];
    char *log, *at;

    assert_int_equal(count, 6);
    sim_survey_disturb(survey, 1, 0.3, 0.3, poses);
    log = log_of(survey, disturbed ? poses : NULL, "a command");
    at = log;
    expect(&at, "# cairn-arena: rescue, 12 x 10 m, seed 3\n# a command\n");
    assert_non_null(
        strstr(log, disturbed ? "Poses: the truth, disturbed" : "Poses: odometry that drifts"));
    assert_non_null(strstr(log, "A beam that met nothing reads 4, a beam that was lost reads 0."));
    assert_non_null(strstr(log, "\nPARAM robot_front_laser_max 4 nohost 0\n"));
    assert_non_null(strstr(log, "\nPARAM robot_frontlaser_offset 0.1 nohost 0\n"));
    at = strstr(log, "\nODOM") + 1;
    for (int32_t i = 0; i < count; i++) {
        const sim_scan *s = &scans[i];
        sim_pose robot = disturbed ? poses[i] : s->odometry;
        double stamp = (double)s->stamp_ns * 1e-9;

        expect(&at, "ODOM ");
        expect_pose(&at, robot);
        assert_near(number(&at), s->speed, 1e-8);
        assert_near(number(&at), s->turn_rate, 1e-8);
        expect(&at, " 0 ");
        assert_near(number(&at), stamp, 1e-6);
        expect(&at, " host ");
        assert_near(number(&at), stamp, 1e-6);
        expect(&at, half_turn ? "\nFLASER 181" : "\nROBOTLASER1 0");
        if (!half_turn) {
            assert_near(number(&at), -fov / 2, 1e-8);
            assert_near(number(&at), fov, 1e-8);
            assert_near(number(&at), s->angle_step, 1e-9);
            assert_near(number(&at), 4, 0);
            assert_near(number(&at), 0.01, 0);
            expect(&at, " 0 181");
        }
        for (int32_t k = 0; k < 181; k++) {
            double range = number(&at);

            if (s->edge[k] == SIM_DROPPED) {
                lost++;
                assert_near(range, 0, 0);
            } else if (s->edge[k] == SIM_NOTHING) {
                infinite++;
                assert_near(range, 4, 0);
            } else {
                assert_true((float)range == s->range[k]);
                assert_true(range < 4);
            }
        }
        if (!half_turn)
            expect(&at, " 0");
        expect_pose(&at, laser_on(robot));
        expect_pose(&at, robot);
        if (!half_turn) {
            assert_near(number(&at), s->speed, 1e-8);
            assert_near(number(&at), s->turn_rate, 1e-8);
            expect(&at, " 0 0 0");
        }
        assert_near(number(&at), stamp, 1e-6);
        expect(&at, " host ");
        assert_near(number(&at), stamp, 1e-6);
        expect(&at, "\n");
    }
    assert_int_equal(*at, '\0');
    assert_true(lost > 10 && infinite > 10);
    free(log);
    sim_survey_free(survey);
    sim_arena_free(arena);
}

static void test_log(void **state)
{
    (void)state;
    check_log(pi, 0);
    check_log(100 * pi / 180, 0);
    check_log(100 * pi / 180, 1);
    check_log(2 * pi, 0);
}

static void test_truth(void **state)
{
    sim_arena *arena;
    sim_survey *survey = survey_of(&arena, 2);
    int32_t count;
    const sim_scan *scans = sim_survey_scans(survey, &count);
    FILE *file = tmpfile();
    char *text, *at;

    (void)state;
    assert_non_null(file);
    assert_int_equal(sim_write_truth(survey, file), 0);
    at = text = text_of(file);
    expect(&at, "index,x,y,theta,place,heading,stamp,ground\n");
    for (int32_t i = 0; i < count; i++) {
        int32_t place = i / 2;

        assert_near(number(&at), i, 0);
        expect(&at, ",");
        assert_near(number(&at), scans[i].truth.x, 0);
        expect(&at, ",");
        assert_near(number(&at), scans[i].truth.y, 0);
        expect(&at, ",");
        assert_near(number(&at), scans[i].truth.theta, 0);
        expect(&at, ",");
        assert_near(number(&at), place, 0);
        expect(&at, ",");
        assert_near(number(&at), i % 2, 0);
        expect(&at, ",");
        assert_near(number(&at), (double)scans[i].stamp_ns * 1e-9, 0);
        expect(&at, ",0\n");
    }
    assert_int_equal(*at, '\0');
    free(text);
    sim_survey_free(survey);
    sim_arena_free(arena);
}

static int32_t times(const char *text, const char *words)
{
    int32_t count = 0;

    for (const char *at = text; (at = strstr(at, words)) != NULL; at += strlen(words))
        count++;
    return count;
}

static void test_json(void **state)
{
    sim_arena *arena;
    sim_survey *survey = survey_of(&arena, 2);
    int32_t bodies, edges, depth = 0;
    const sim_body *body = sim_arena_bodies(arena, &bodies);
    const sim_edge *edge = sim_arena_edges(arena, &edges);
    FILE *file = tmpfile();
    char *text, *at;

    (void)state;
    (void)body;
    assert_non_null(file);
    assert_int_equal(sim_write_json(arena, file), 0);
    text = text_of(file);
    for (at = text; *at != '\0'; at++) {
        depth += (*at == '{' || *at == '[') - (*at == '}' || *at == ']');
        assert_true(depth > 0 || strlen(at) <= 2);
    }
    assert_int_equal(depth, 0);
    assert_int_equal(times(text, "\"kind\": "), bodies);
    assert_int_equal(times(text, "\"normal\": "), edges);
    assert_int_equal(times(text, ",\n  ]"), 0);
    assert_int_equal(times(text, "\"scene\": \"rescue\""), 1);
    assert_int_equal(times(text, "\"seed\": 3,"), 1);
    assert_int_equal(times(text, "nan") + times(text, "inf"), 0);
    at = strstr(text, "\"edges\": [\n");
    assert_non_null(at);
    for (int32_t i = 0; i < edges; i++) {
        at = strstr(at, "{\"id\": ") + 7;
        assert_near(number(&at), i, 0);
        expect(&at, ", \"body\": ");
        assert_near(number(&at), edge[i].body, 0);
        expect(&at, ", \"a\": [");
        assert_near(number(&at), edge[i].a.x, 1e-7);
        expect(&at, ", ");
        assert_near(number(&at), edge[i].a.y, 1e-7);
        expect(&at, "], \"b\": [");
        assert_near(number(&at), edge[i].b.x, 1e-7);
        expect(&at, ", ");
        assert_near(number(&at), edge[i].b.y, 1e-7);
        expect(&at, "], \"normal\": [");
        assert_near(number(&at), edge[i].normal.x, 1e-8);
        expect(&at, ", ");
        assert_near(number(&at), edge[i].normal.y, 1e-8);
    }
    free(text);
    sim_survey_free(survey);
    sim_arena_free(arena);
}

/* Every body, scan and pose is drawn, inside the picture. */
static void test_picture(void **state)
{
    sim_arena *arena;
    sim_survey *survey = survey_of(&arena, 2);
    int32_t bodies, scans, discs = 0;
    const sim_body *body = sim_arena_bodies(arena, &bodies);
    FILE *file = tmpfile();
    char *text, *at;
    double width, height;

    (void)state;
    (void)sim_survey_scans(survey, &scans);
    assert_non_null(file);
    assert_int_equal(sim_write_picture(survey, file), 0);
    text = text_of(file);
    for (int32_t i = 0; i < bodies; i++)
        discs += body[i].radius > 0;
    assert_int_equal(times(text, "class=\"wall\"") + times(text, "class=\"furniture\"") +
                         times(text, "class=\"box\"") + times(text, "class=\"rubble\""),
                     bodies);
    assert_int_equal(times(text, "<circle"), scans + discs);
    assert_int_equal(times(text, "class=\"seen\""), scans);
    assert_int_equal(times(text, "class=\"look\""), scans);
    assert_int_equal(times(text, "class=\"way\""), 1);
    assert_int_equal(times(text, "class=\"floor\""), 1);
    assert_int_equal(times(text, "nan") + times(text, "inf"), 0);
    at = strstr(text, "viewBox=\"0 0 ") + 13;
    width = number(&at);
    height = number(&at);
    assert_true(width > 600 && width < 1200 && height > 600 && height < 1200);
    for (at = text; (at = strstr(at, "points=\"")) != NULL;)
        for (at += 8; *at != '"'; at++) {
            double x = number(&at);

            expect(&at, ",");
            assert_true(x >= 0 && x <= width);
            x = number(&at);
            assert_true(x >= 0 && x <= height);
        }
    assert_string_equal(text + strlen(text) - 7, "</svg>\n");
    free(text);
    sim_survey_free(survey);
    sim_arena_free(arena);
}

/* A decimal comma changes nothing; a full disk is reported. */
static void test_locale_and_full_disk(void **state)
{
    sim_arena *arena;
    sim_survey *survey = survey_of(&arena, 2);
    char *before = log_of(survey, NULL, NULL), *after;
    FILE *full = fopen("/dev/full", "wb");

    (void)state;
    assert_null(strstr(before, "# a command"));
    if (setlocale(LC_NUMERIC, "de_DE.UTF-8") != NULL ||
        setlocale(LC_NUMERIC, "fr_FR.UTF-8") != NULL) {
        after = log_of(survey, NULL, NULL);
        setlocale(LC_NUMERIC, "C");
        assert_string_equal(before, after);
        free(after);
    }
    if (full != NULL) {
        assert_int_equal(sim_write_log(survey, NULL, NULL, full), -1);
        assert_int_equal(sim_write_truth(survey, full), -1);
        assert_int_equal(sim_write_json(arena, full), -1);
        assert_int_equal(sim_write_picture(survey, full), -1);
        fclose(full);
    }
    free(before);
    sim_survey_free(survey);
    sim_arena_free(arena);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_log),
        cmocka_unit_test(test_truth),
        cmocka_unit_test(test_json),
        cmocka_unit_test(test_picture),
        cmocka_unit_test(test_locale_and_full_disk),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
