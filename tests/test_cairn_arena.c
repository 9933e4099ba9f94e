/* The tool cairn-arena, run as a program: the one that was built beside the tests. */
#include "tests/test.h"

#include <dirent.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "sim/files.h"

static char tool[1000], folder[64];
static char said[8000];

static int run(const char *arguments)
{
    char line[1500];
    FILE *pipe;
    size_t length;
    int status;

    snprintf(line, sizeof line, "'%s' %s 2>&1", tool, arguments);
    pipe = popen(line, "r");
    assert_non_null(pipe);
    length = fread(said, 1, sizeof said - 1, pipe);
    said[length] = '\0';
    status = pclose(pipe);
    assert_true(WIFEXITED(status));
    return WEXITSTATUS(status);
}

static int32_t files_in(const char *name)
{
    DIR *directory = opendir(name);
    int32_t count = 0;

    if (directory == NULL)
        return -1;
    while (readdir(directory) != NULL)
        count++;
    closedir(directory);
    return count - 2;
}

static char *content(const char *sub, const char *name, size_t *size)
{
    char path[200];
    FILE *file;
    char *text = malloc(4000000);

    assert_non_null(text);
    snprintf(path, sizeof path, "%s/%s/%s", folder, sub, name);
    file = fopen(path, "rb");
    assert_non_null(file);
    *size = fread(text, 1, 4000000, file);
    assert_true(*size > 100 && *size < 4000000);
    fclose(file);
    return text;
}

static int run_in(const char *options, const char *sub)
{
    char arguments[400];

    snprintf(arguments, sizeof arguments, "%s -o %s/%s", options, folder, sub);
    return run(arguments);
}

static void test_four_files_and_same_bytes(void **state)
{
    static const char *const names[] = {"scans.log", "truth.csv", "arena.json", "arena.svg"};
    char path[200];

    (void)state;
    assert_int_equal(run_in("maze --seed 5 --places 3 --headings 2", "a"), 0);
    assert_string_equal(said, "");
    assert_int_equal(run_in("maze --seed 5 --places 3 --headings 2", "b"), 0);
    assert_int_equal(run_in("maze --seed 6 --places 3 --headings 2", "c"), 0);
    snprintf(path, sizeof path, "%s/a", folder);
    assert_int_equal(files_in(path), 4);
    for (int32_t i = 0; i < 4; i++) {
        size_t first_size, again_size, other_size;
        char *first = content("a", names[i], &first_size),
             *again = content("b", names[i], &again_size);
        char *other = content("c", names[i], &other_size);

        assert_int_equal(first_size, again_size);
        assert_memory_equal(first, again, first_size);
        assert_true(first_size != other_size || memcmp(first, other, first_size) != 0);
        free(first);
        free(again);
        free(other);
    }
}

/* The tool is a double build: this program, in float or double, must make the same bytes. */
static void test_same_bytes_as_the_library(void **state)
{
    sim_arena_options where = sim_arena_default();
    sim_survey_options options = sim_survey_default();
    sim_arena *arena;
    sim_survey *survey;
    size_t size, ours;
    char *theirs, *truth;
    FILE *file = tmpfile();

    (void)state;
    assert_non_null(file);
    assert_int_equal(
        run_in("rescue --seed 9 --drive 60 --movers 2 --scan-time 0.1 --tilt 0.1", "d"), 0);
    where.seed = options.seed = 9;
    options.drive = 60;
    options.movers = 2;
    options.scan_time = 0.1;
    options.tilt = 0.1;
    options.fov = options.fov * (180 / 3.14159265358979323846) * (3.14159265358979323846 / 180);
    arena = sim_arena_create(&where, NULL, 0);
    survey = sim_survey_create(arena, &options, NULL, 0);
    assert_int_equal(sim_write_truth(survey, file), 0);
    ours = (size_t)ftell(file);
    rewind(file);
    truth = malloc(ours);
    assert_int_equal(fread(truth, 1, ours, file), ours);
    theirs = content("d", "truth.csv", &size);
    assert_int_equal(size, ours);
    assert_memory_equal(theirs, truth, size);
    free(theirs);
    free(truth);
    fclose(file);
    sim_survey_free(survey);
    sim_arena_free(arena);
}

static void test_options_arrive(void **state)
{
    size_t size;
    char *log, *json;

    (void)state;
    assert_int_equal(run_in("corridor --size 10x3 --turn 30 --places 2 --headings 1 --fov 180 "
                            "--beams 91 --range 6.5 "
                            "--noise 0 --dropout 1 --disturb 0.30,20 --jitter 0.3,20 --movers 1",
                            "e"),
                     0);
    log = content("e", "scans.log", &size);
    log[size - 1] = '\0';
    assert_non_null(strstr(log, "corridor, 10 x 3 m, seed 1"));
    assert_non_null(strstr(log, "the truth, disturbed"));
    assert_non_null(strstr(log, "reads 6.5"));
    assert_non_null(strstr(log, "\nFLASER 91 0 0 0 0 0 "));
    assert_null(strstr(log, folder));
    json = content("e", "arena.json", &size);
    json[size - 1] = '\0';
    assert_non_null(strstr(json, "\"turn_rad\": 0.5235987755982"));
    free(log);
    free(json);

    /* The scanner of a scene is a default, which options replace. */
    assert_int_equal(
        run_in("hospital --size 30x20 --drive 8 --beams 91 --ground 6 --legs --trailer", "h"), 0);
    log = content("h", "scans.log", &size);
    log[size - 1] = '\0';
    assert_non_null(strstr(log, "PARAM robot_frontlaser_offset 0.22 "));
    assert_non_null(
        strstr(log, "\nROBOTLASER1 0 -1.57079633 3.14159265 0.034906585 80 0.01 0 91 "));
    assert_non_null(strstr(log, "\nROBOTLASER1 0 -1.56206968 "));
    free(log);
    assert_int_equal(
        run_in("hospital --size 30x20 --drive 8 --sensor 0 --start-angles 1 --range 30", "i"), 0);
    log = content("i", "scans.log", &size);
    log[size - 1] = '\0';
    assert_non_null(strstr(log, "PARAM robot_frontlaser_offset 0 "));
    assert_non_null(strstr(log, "\nFLASER 181 "));
    free(log);
}

static void refused(const char *arguments, const char *what)
{
    char *newline;

    assert_int_equal(run(arguments), 2);
    if (strncmp(said, what, strlen(what)) != 0)
        fail_msg("'%s' where '%s' was expected", said, what);
    assert_non_null(strstr(said, ", expected "));
    newline = strchr(said, '\n');
    assert_non_null(newline);
    assert_int_equal(newline[1], '\0');
}

static void test_refusals(void **state)
{
    char line[300], path[100];

    (void)state;
    refused("", "cairn-arena: no scene");
    refused("castle -o /nowhere/x", "cairn-arena: there is no scene 'castle'");
    refused("rescue", "cairn-arena: no output folder");
    refused("rescue maze -o x", "cairn-arena: one word too many, 'maze'");
    refused("rescue --beans 3 -o x", "cairn-arena: unknown option '--beans'");
    refused("rescue --beams 1 -o x",
            "cairn-arena: --beams is '1', expected a whole number from 2 to 100000");
    refused("hospital --ground 0.5 -o x",
            "cairn-arena: --ground is '0.5', expected a number from 1 to 50");
    refused("hospital --sensor 0.3 -o x",
            "cairn-arena: --sensor is '0.3', expected a number from -0.25 to 0.25");
    refused("rescue --jitter 2,5 -o x", "cairn-arena: --jitter is 2 m, expected 0 to 1");
    refused("rescue --size 3x3 -o x", "cairn-arena: rescue: width is 3 m, expected 6 to 60");
    refused("corridor --size 4x2 --places 900 -o x",
            "cairn-arena: corridor: places is 900, expected at most ");
    refused("rescue --places 2 -o /nowhere/x", "cairn-arena: /nowhere/x/scans.log.part: ");
    assert_int_equal(files_in("x"), -1);

    /* A folder has the name of the file to be written: only what was there before is left. */
    snprintf(path, sizeof path, "%s/f", folder);
    assert_int_equal(mkdir(path, 0777), 0);
    snprintf(path, sizeof path, "%s/f/arena.json.part", folder);
    assert_int_equal(mkdir(path, 0777), 0);
    snprintf(line, sizeof line, "rescue --places 2 -o %s/f", folder);
    refused(line, "cairn-arena: ");
    snprintf(path, sizeof path, "%s/f", folder);
    assert_int_equal(files_in(path), 1);
}

static void test_help(void **state)
{
    static const char *const options[] = {
        "--seed N",   "--size WxH",      "--places N", "--headings N",     "--fov DEG",
        "--beams N",  "--range M",       "--noise M",  "--dropout SHARE",  "--tilt SHARE",
        "--movers N", "--scan-time S",   "--drive N",  "--crowd SHARE",    "--jitter M,DEG",
        "--turn DEG", "--disturb M,DEG", "-o DIR",     "--lost SHARE",     "--glass SHARE",
        "--ground M", "--legs",          "--trailer",  "--start-angles N", "--sensor M"};

    (void)state;
    assert_int_equal(run("--help"), 0);
    for (size_t i = 0; i < sizeof options / sizeof options[0]; i++)
        if (strstr(said, options[i]) == NULL)
            fail_msg("%s is not in the help", options[i]);
    for (sim_scene scene = 0; scene < SIM_SCENES; scene++)
        assert_non_null(strstr(said, sim_scene_about(scene)));
    assert_int_equal(run("maze -h"), 0);
}

static int remove_folder(void **state)
{
    char line[100];

    (void)state;
    snprintf(line, sizeof line, "rm -rf '%s'", folder);
    return system(line) != 0;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_four_files_and_same_bytes),
        cmocka_unit_test(test_same_bytes_as_the_library),
        cmocka_unit_test(test_options_arrive),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_help),
    };
    char *slash = argc > 0 ? strrchr(argv[0], '/') : NULL;

    snprintf(tool, sizeof tool, "%.*s/../cairn-arena", slash ? (int)(slash - argv[0]) : 1,
             slash ? argv[0] : ".");
    snprintf(folder, sizeof folder, "/tmp/cairn-arena-XXXXXX");
    if (mkdtemp(folder) == NULL)
        return 1;
    return cmocka_run_group_tests(tests, NULL, remove_folder);
}
