/* cairn eval, run as a program: figures computed by hand, and refusals. */
#include "tests/programs.h"

#include <math.h>

static void write_text(const char *name, const char *text)
{
    (void)files_write(name, text, strlen(text));
}

/* The number of "key": in a JSON object. */
static double number_of(const char *json, const char *key)
{
    char quoted[64];
    const char *at;

    (void)snprintf(quoted, sizeof quoted, "\"%s\": ", key);
    at = strstr(json, quoted);
    if (at == NULL)
        fail_msg("no %s in %s", key, json);
    return strtod(at + strlen(quoted), NULL);
}

static void poses(void **state)
{
    outcome o;

    (void)state;
    write_text("truth.csv", "index,x,y,theta\n0,0,0,0\n1,1,0,0.5\n2,1,2,-0.5\n3,0,2,3\n9,5,5,5\n");
    /* The same, rotated by a right angle and shifted, in another order, one of them missing. */
    write_text("turned.csv",
               "index,x,y,theta\n3,8,7,4.5707963267948966\n1,10,8,2.0707963267948966\n"
               "0,10,7,1.5707963267948966\n2,8,8,1.0707963267948966\n7,0,0,0\n");
    o = programs_run("cairn eval poses @/turned.csv @/truth.csv --json");
    assert_done_silently(o);
    assert_near(number_of(o.out, "poses"), 4, 0);
    assert_near(number_of(o.out, "left_out"), 2, 0);
    assert_near(number_of(o.out, "e_x_m"), 0, 1e-9);
    assert_near(number_of(o.out, "e_y_m"), 0, 1e-9);
    assert_near(number_of(o.out, "e_theta_rad"), 0, 1e-9);
    assert_near(number_of(o.out, "distance_most_m"), 0, 1e-9);
    assert_near(number_of(o.out, "first_e_x_m"), 0, 1e-9);
    /* Two of four moved apart: a common motion shares the error, a common first pose does not. */
    write_text("pulled.csv", "index,x,y,theta\n0,0,0,0\n1,1,0,0.5\n2,1,2.4,-0.5\n3,0,2.4,3\n");
    o = programs_run("cairn eval poses @/pulled.csv @/truth.csv --json");
    assert_done_silently(o);
    assert_near(number_of(o.out, "e_y_m"), 0.2, 1e-9);
    assert_near(number_of(o.out, "e_x_m"), 0, 1e-9);
    assert_near(number_of(o.out, "distance_mean_m"), 0.2, 1e-9);
    assert_near(number_of(o.out, "distance_most_m"), 0.2, 1e-9);
    assert_near(number_of(o.out, "first_e_y_m"), 0.2, 1e-9);
    /* One heading off by 0.4: alignment of the first pose passes it on to all. */
    write_text("bent.csv", "index,x,y,theta\n0,0,0,0.4\n1,1,0,0.5\n2,1,2,-0.5\n3,0,2,3\n");
    o = programs_run("cairn eval poses @/bent.csv @/truth.csv --json");
    assert_done_silently(o);
    assert_near(number_of(o.out, "first_e_theta_rad"), 0.3, 1e-9);
    assert_near(number_of(o.out, "first_e_x_m"), sin(0.4), 1e-8); /* 1 - c, c + 2 s - 1 and 2 s */
    assert_true(number_of(o.out, "e_theta_rad") < 0.2);
    o = programs_run("cairn eval poses @/pulled.csv @/truth.csv");
    assert_done_silently(o);
    assert_holds(o.out, "poses      4 (1 in only one of the tables ignored)\n");
    assert_holds(o.out, "  distance 0.2000 m on average, 0.2000 m at most\n");
    assert_holds(o.out, "  E(theta) 0.0000 degrees\n");
}

static void relations(void **state)
{
    outcome o;

    (void)state;
    write_text("timed.csv", "index,time,x,y,theta\n2,12.5,1,1,1.5707963267948966\n0,10,0,0,0\n1,11."
                            "25,1,0,0\n5,99,7,7,0\n");
    /* Errors of (0.3, 0.4) and 10 degrees; of nothing; times and indices without a pose. */
    write_text("good.relations",
               "10 11.25 1.3 0.4 0 0 0 0.17453292519943295\n1 2 0 1 1.5707963267948966\n"
               "10 20 0 0 0 0 0 0\n0 3 0 0 0\n0 17 0 0 0\n");
    o = programs_run("cairn eval relations @/timed.csv @/good.relations --json");
    assert_done_silently(o);
    assert_near(number_of(o.out, "relations"), 2, 0);
    assert_near(number_of(o.out, "left_out"), 3, 0);
    assert_near(number_of(o.out, "trans_mean_m"), 0.25, 1e-8);
    assert_near(number_of(o.out, "trans_sd_m"), 0.25, 1e-8);
    assert_near(number_of(o.out, "trans_squared_m2"), 0.125, 1e-8);
    assert_near(number_of(o.out, "rot_mean_deg"), 5, 1e-7);
    assert_near(number_of(o.out, "rot_sd_deg"), 5, 1e-7);
    assert_near(number_of(o.out, "rot_squared_deg2"), 50, 1e-6);
    o = programs_run("cairn eval relations @/timed.csv @/good.relations");
    assert_done_silently(o);
    assert_holds(o.out, "relations  2 (3 without both scans ignored)\n");
    assert_holds(o.out, "distance   0.2500 +- 0.2500 m, 0.1250 m^2 squared\n");
    /* The poses of a log. */
    write_text("two.log", "FLASER 1 2 0 0 0 0 0 0 1 h 1\nFLASER 1 2 1 0 0 1 0 0 3 h 3\n");
    write_text("two.relations", "0 1 1.5 0 0\n");
    o = programs_run("cairn eval relations @/two.log @/two.relations --json");
    assert_done_silently(o);
    assert_near(number_of(o.out, "trans_mean_m"), 0.5, 1e-8);
    /* Sensors 0.2 m ahead of a robot that turns by a right angle on the spot: they move by (-0.2,
     * 0.2). */
    write_text("ahead.log", "FLASER 1 2 0.2 0 0 0 0 0 1 h 1\nFLASER 1 2 0 0.2 1.5707963267948966 0 "
                            "0 1.5707963267948966 3 h 3\n");
    write_text("ahead.csv", "index,x,y,theta\n0,0,0,0\n1,0,0,1.5707963267948966\n");
    write_text("ahead.relations", "0 1 -0.2 0.2 1.5707963267948966\n");
    o = programs_run("cairn eval relations @/ahead.log @/ahead.relations --json");
    assert_done_silently(o);
    assert_near(number_of(o.out, "trans_mean_m"), 0, 1e-8);
    o = programs_run("cairn eval relations @/ahead.csv @/ahead.relations --log @/ahead.log --json");
    assert_done_silently(o);
    assert_near(number_of(o.out, "trans_mean_m"), 0, 1e-8);
    o = programs_run("cairn eval relations @/ahead.csv @/ahead.relations --json");
    assert_done_silently(o);
    assert_near(number_of(o.out, "trans_mean_m"), sqrt(0.08), 1e-8);
}

static void maps(void **state)
{
    static const char *const quadrant[] = {"nw", "ne", "se", "sw"};
    double entropy = 0, likelihood = 0;
    outcome good, bad, again;

    (void)state;
    assert_done_silently(programs_run(
        "cairn-arena rooms --seed 3 --places 5 --headings 1 --fov 360 --beams 121 --disturb 0.2,10 "
        "-o @/arena"));
    good = programs_run("cairn eval map @/arena/scans.log @/arena/truth.csv --json");
    bad = programs_run("cairn eval map @/arena/scans.log --json");
    assert_done_silently(good);
    assert_done_silently(bad);
    assert_near(number_of(good.out, "scans"), 5, 0);
    assert_true(number_of(good.out, "beams") > 500 && number_of(good.out, "beams") <= 605);
    assert_true(number_of(good.out, "hits") <= number_of(good.out, "beams"));
    assert_near(number_of(good.out, "resolution_m"), 0.05, 1e-9);
    assert_true(number_of(good.out, "entropy") < number_of(bad.out, "entropy"));
    assert_true(number_of(good.out, "log_likelihood") > number_of(bad.out, "log_likelihood"));
    for (int q = 0; q < 4; q++) {
        char key[32];

        (void)snprintf(key, sizeof key, "entropy_%s", quadrant[q]);
        assert_true(number_of(good.out, key) > 0);
        entropy += number_of(good.out, key);
        (void)snprintf(key, sizeof key, "log_likelihood_%s", quadrant[q]);
        assert_true(number_of(good.out, key) < 0);
        likelihood += number_of(good.out, key);
    }
    assert_near(entropy, number_of(good.out, "entropy"), 1e-5 * entropy);
    assert_near(likelihood, number_of(good.out, "log_likelihood"), -1e-6 * likelihood);
    /* The cells of a map drawn by cairn align, which are those computed from its poses. */
    assert_done_silently(
        programs_run("cairn align @/arena/scans.log -o @/aligned --resolution 0.1"));
    good = programs_run(
        "cairn eval map @/arena/scans.log @/aligned/poses.csv --map @/aligned/map.yaml --json");
    again = programs_run(
        "cairn eval map @/arena/scans.log @/aligned/poses.csv --resolution 0.1 --json");
    assert_done_silently(good);
    assert_near(number_of(good.out, "resolution_m"), 0.1, 1e-9);
    assert_near(number_of(good.out, "entropy"), number_of(again.out, "entropy"),
                1e-6 * number_of(again.out, "entropy"));
    good = programs_run("cairn eval map @/arena/scans.log @/arena/truth.csv");
    assert_done_silently(good);
    assert_holds(good.out, "\nentropy    ");
    assert_holds(good.out, "\nsw         entropy ");
    /* Beams are cut at --range: no hit is left. */
    good = programs_run("cairn eval map @/arena/scans.log @/arena/truth.csv --range 0.1 --json");
    assert_done_silently(good);
    assert_near(number_of(good.out, "hits"), 0, 0);
    assert_near(number_of(good.out, "entropy"), 0, 1e-12);
}

static void help(void **state)
{
    static const char *const parts[] = {"map", "poses", "relations"};
    outcome o = programs_run("cairn eval --help");

    (void)state;
    assert_done_silently(o);
    for (int k = 0; k < 3; k++) {
        char line[64];

        (void)snprintf(line, sizeof line, "\n  %s ", parts[k]);
        assert_holds(o.out, line);
        (void)snprintf(line, sizeof line, "usage: cairn eval %s ", parts[k]);
        o = programs_run("cairn eval %s --help", parts[k]);
        assert_done_silently(o);
        assert_holds(o.out, line);
        assert_holds(o.out, "--json");
        o = programs_run("cairn eval -h");
        assert_done_silently(o);
    }
}

static void refusals(void **state)
{
    static const struct {
        const char *command, *start, *piece;
    } bad[] = {
        {"", "cairn eval: ", "nothing to evaluate, expected map, poses or relations"},
        {"taste", "cairn eval: ", "unknown 'taste', expected map, poses or relations"},
        {"poses", "cairn eval poses: ", "no poses, expected POSES.csv TRUTH.csv"},
        {"poses @/one.csv", "cairn eval poses: ", "no truth, expected POSES.csv TRUTH.csv"},
        {"poses @/one.csv @/missing.csv", "/missing.csv: ", "cannot"},
        {"poses @/one.csv @/twice.csv",
         "cairn eval poses: ", "twice.csv: duplicate index 3, expected"},
        {"poses @/one.csv @/other.csv", "cairn eval poses: ", "no index in common, expected"},
        {"poses @/nan.csv @/one.csv", "/nan.csv:3: ", "expected a finite number"},
        {"relations", "cairn eval relations: ", "no poses, expected POSES.csv|LOG FILE.relations"},
        {"relations @/one.csv",
         "cairn eval relations: ", "no relations, expected POSES.csv|LOG FILE.relations"},
        {"relations @/one.csv @/bad.relations", "/bad.relations:2: ", "expected a number"},
        {"relations @/one.csv @/far.relations",
         "cairn eval relations: ", "expected relations between its scans"},
        {"relations @/below.csv @/far.relations",
         "cairn eval relations: ", "index -1, expected indices of scans from 0"},
        {"relations @/missing.csv @/far.relations", "/missing.csv: ", "cannot"},
        {"relations @/empty.log @/far.relations", "/empty.log: ", "expected"},
        {"relations @/three.csv @/far.relations --log @/two.log",
         "cairn eval relations: ", "holds 2 scans, expected"},
        {"map", "cairn eval map: ", "no log, expected LOG [POSES.csv]"},
        {"map @/missing.log", "/missing.log: ", "cannot"},
        {
            "map @/two.log @/one.csv",
            "cairn eval map: ",
            "has no pose of scan 1 (",
        },
        {"map @/two.log @/three.csv", "cairn eval map: ", "has a pose of scan 2, but "},
        {"map @/two.log --map @/turned.yaml",
         "cairn eval map: ", "the origin of the map is rotated by 0.5 rad, expected"},
        {"map @/two.log --map @/away.yaml",
         "cairn eval map: ", "no beam lies in the map, expected at least one"},
        {"map @/two.log --map @/bad.yaml", "/bad.yaml:", "expected"},
        {"map @/two.log --resolution 0", "cairn eval map: ", "--resolution is '0', expected"},
        {"map @/two.log --least 1", "cairn eval map: ", "--least is '1', expected"},
    };

    (void)state;
    write_text("one.csv", "index,x,y,theta\n0,0,0,0\n");
    write_text("twice.csv", "index,x,y,theta\n3,0,0,0\n4,0,0,0\n3,1,0,0\n");
    write_text("other.csv", "index,x,y,theta\n1,0,0,0\n");
    write_text("three.csv", "index,x,y,theta\n1,0,0,0\n0,0,0,0\n2,0,0,0\n");
    write_text("nan.csv", "index,x,y,theta\n0,0,0,0\n1,nan,0,0\n");
    write_text("below.csv", "index,x,y,theta\n-1,0,0,0\n");
    write_text("bad.relations", "0 1 2 3 4\n0 1 x 3 4\n");
    write_text("far.relations", "5 6 2 3 4\n");
    write_text("empty.log", "\n");
    write_text("two.log", "FLASER 1 2 0 0 0 0 0 0 1 h 1\nFLASER 1 2 1 0 0 1 0 0 3 h 3\n");
    write_text("cells.pgm", "P2\n2 2\n255\n0 254\n254 205\n");
    write_text("turned.yaml", "image: cells.pgm\nresolution: 0.5\norigin: [0, 0, 0.5]\nnegate: 0\n"
                              "occupied_thresh: 0.65\nfree_thresh: 0.196\n");
    write_text("away.yaml", "image: cells.pgm\nresolution: 0.5\norigin: [50, 50, 0]\nnegate: 0\n"
                            "occupied_thresh: 0.65\nfree_thresh: 0.196\n");
    write_text("bad.yaml", "image: cells.pgm\nresolution: none\norigin: [50, 50, 0]\n");
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        outcome o = programs_run("cairn eval %s", bad[k].command);
        char start[256];

        (void)snprintf(start, sizeof start, "%s%s", bad[k].start[0] == '/' ? files_folder : "",
                       bad[k].start);
        if (o.code != 2 || strncmp(o.err, start, strlen(start)) != 0 ||
            strstr(o.err, bad[k].piece) == NULL)
            fail_msg("eval %s: exit code %d, \"%s\", where 2 and \"%s...%s\" was expected",
                     bad[k].command, o.code, o.err, start, bad[k].piece);
        assert_string_equal(o.out, "");
    }
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(poses), cmocka_unit_test(relations), cmocka_unit_test(maps),
        cmocka_unit_test(help),  cmocka_unit_test(refusals),
    };

    programs_find(argc, argv);
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
