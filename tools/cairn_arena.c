/* cairn-arena: generates a simulated arena from a scene name and a seed, and writes scans of a
 * simulated range scanner with ground truth. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sim/files.h"
#include "src/host/base/json_writer.h"
#include "tools/options.h"

#define PROGRAM "cairn-arena"

static const double degree = 3.14159265358979323846 / 180;

/* The parsed command line; angles in degrees as in the options. */
typedef struct command {
    sim_arena_options arena;
    sim_survey_options survey;
    double size[2], jitter[2], disturb[2];
    double sweep[2]; /* m/s, rad/s */
    double fov, turn;
    const char *folder;
    int32_t json;
} command;

enum { TABLE = 30 };

static void make_table(command *c, option *table)
{
    sim_survey_options *s = &c->survey;
    const option options[TABLE] = {
        OPTION_TEXT("-o", &c->folder, "DIR", "folder to write to; it is created if missing"),
        OPTION_SEED("--seed", &c->arena.seed, "the same seed and options give the same bytes"),
        OPTION_PAIR("--size", c->size, 1, 60, "WxH", "m, at most 60x60 (size of the scene)"),
        OPTION_NUMBER("--turn", &c->turn, -360, 360, "DEG",
                      "rotation of the scene in the world, degrees (random)"),
        OPTION_NUMBER("--rubble", &c->arena.rubble, 0, 3, "SHARE",
                      "density of rubble (loose bodies), 0 to 3"),
        OPTION_COUNT("--places", &s->places, 0, 1000, "N", "scan positions; 0: those of the scene"),
        OPTION_COUNT("--headings", &s->headings, 1, 64, "N",
                     "scans at each place, at evenly spaced headings"),
        OPTION_FLAG("--same-headings", &s->same_headings,
                    "all places have the headings of the first one"),
        OPTION_PAIR("--jitter", c->jitter, 0, 360, "M,DEG",
                    "spread of the poses of scans at one place, m and degrees"),
        OPTION_COUNT("--drive", &s->drive, 0, 100000, "N",
                     "N scans of a robot that drives along the places instead"),
        OPTION_NUMBER("--drive-every", &s->drive_distance, 0.01, 100, "M",
                      "distance between two scans of a drive, m"),
        OPTION_NUMBER("--fov", &c->fov, 0.1, 360, "DEG",
                      "field of view, degrees; 360 is a full circle"),
        OPTION_COUNT("--start-angles", &s->start_angles, 1, 64, "N",
                     "interlaced scans: N first angles in turn, within one angle step"),
        OPTION_NUMBER("--sensor", &s->base_sensor.x, -0.25, 0.25, "M",
                      "position of the scanner ahead of the robot's centre, m"),
        OPTION_COUNT("--beams", &s->beams, 2, 100000, "N", "beams of a scan"),
        OPTION_NUMBER("--range", &s->range_max, 1, 200, "M", "maximum range, m"),
        OPTION_NUMBER("--noise", &s->noise, 0, 1, "M", "standard deviation of a range, m"),
        OPTION_NUMBER("--dropout", &s->dropout, 0, 1, "SHARE",
                      "fraction of beams without a reading, 0 to 1"),
        OPTION_NUMBER("--lost", &s->lost, 0, 1, "SHARE",
                      "fraction of beams without return, 0 to 1"),
        OPTION_NUMBER("--glass", &s->glass, 0, 1, "SHARE",
                      "fraction of walls and furniture from which no beam returns, 0 to 1"),
        OPTION_NUMBER("--tilt", &s->tilt, 0, 0.3, "SHARE",
                      "fraction of beams that hit the floor (tilted scanner), 0 to 0.3"),
        OPTION_NUMBER("--ground", &s->ground, 1, 50, "M",
                      "on stretches of 5 to 15 m of the path the scanner is tilted and meets the "
                      "floor M m ahead"),
        OPTION_FLAG("--legs", &s->legs, "the robot's legs return at +-60 degrees, 0.3 m away"),
        OPTION_FLAG("--trailer", &s->trailer,
                    "a trailer follows: its body behind, two poles beside the robot"),
        OPTION_COUNT("--movers", &s->movers, 0, 100, "N", "moving bodies, 0 to 100"),
        OPTION_NUMBER("--crowd", &s->crowd, 0, 0.5, "SHARE",
                      "fraction of the beams of each scan at a place that end on people"),
        OPTION_NUMBER("--scan-time", &s->scan_time, 0, 2, "S",
                      "duration of a scan, first to last beam, s, 0 to 2"),
        OPTION_PAIR("--sweep", c->sweep, 0, 20, "V,W",
                    "maximum velocity of the robot during a scan, m/s and rad/s"),
        OPTION_PAIR("--disturb", c->disturb, 0, 360, "M,DEG",
                    "poses in the log: ground truth with uniform noise of +-M m and +-DEG degrees"),
        OPTION_JSON(&c->json),
    };

    memcpy(table, options, sizeof options);
}

/* Writes the text of the help: files, conventions and the list of scenes. */
static void about(char *text, size_t size)
{
    size_t used = (size_t)snprintf(
        text, size,
        "Generates an arena and scans of it: DIR/scans.log (CARMEN), "
        "DIR/truth.csv, DIR/arena.json (all walls with their\n"
        "numbers), DIR/arena.svg (a picture). The poses in the log are "
        "the robot's drifting odometry. In the log a\n"
        "beam without a return reads the maximum range, a lost beam reads 0. "
        "A field of view of 180 degrees gives FLASER\n"
        "lines, any other and interlaced scans ROBOTLASER1. hospital is a drive "
        "of 1500 scans, one each 0.2 m, by a scanner\nof its own, where options do "
        "not say otherwise: --sensor 0.22 --start-angles 4 --fov 180 --beams 181 "
        "--range 80\n--lost 0.01. Exit codes: 0 done, 2 rejected; no file is left "
        "incomplete.\n\nscenes:");

    for (sim_scene scene = 0; scene < SIM_SCENES && used < size; scene++) {
        double width, height;

        sim_scene_size(scene, &width, &height);
        used += (size_t)snprintf(text + used, size - used, "\n  %-10s %s [%.9gx%.9g m, %d places]",
                                 sim_scene_name(scene), sim_scene_about(scene), width, height,
                                 (int)sim_scene_places(scene));
    }
}

/* The output files. All are written under temporary names first and then renamed (atomic
 * replacement). */
enum { LOG, TRUTH, JSON, PICTURE, FILE_COUNT };
static const char *const file_names[FILE_COUNT] = {"scans.log", "truth.csv", "arena.json",
                                                   "arena.svg"};

static int32_t write_one(int32_t which, const sim_survey *survey, const sim_pose *poses,
                         const char *line, FILE *file)
{
    switch (which) {
    case LOG:
        return sim_write_log(survey, poses, line, file);
    case TRUTH:
        return sim_write_truth(survey, file);
    case JSON:
        return sim_write_json(sim_survey_arena(survey), file);
    default:
        return sim_write_picture(survey, file);
    }
}

static void path_of(char *path, size_t size, const char *folder, int32_t which, const char *ending)
{
    snprintf(path, size, "%s/%s%s", folder, file_names[which], ending);
}

static int write_all(const char *folder, const sim_survey *survey, const sim_pose *poses,
                     const char *line)
{
    size_t size = strlen(folder) + 32;
    char *part = malloc(size), *final = malloc(size);
    int32_t done = 0, made = mkdir(folder, 0777) == 0;
    int status = 0;

    if (part == NULL || final == NULL)
        status = options_refuse(PROGRAM, "out of memory");
    for (; status == 0 && done < FILE_COUNT; done++) {
        FILE *file;
        int32_t bad;

        path_of(part, size, folder, done, ".part");
        file = fopen(part, "wb");
        if (file == NULL) {
            status = options_refuse(PROGRAM, "%s: %s, expected a folder that can be written to",
                                    part, strerror(errno));
            break;
        }
        bad = write_one(done, survey, poses, line, file) != 0;
        if (fclose(file) != 0 || bad)
            status = options_refuse(PROGRAM, "%s: %s, expected enough disk space for the file",
                                    part, strerror(errno));
    }
    for (int32_t i = 0; status == 0 && i < FILE_COUNT; i++) {
        path_of(part, size, folder, i, ".part");
        path_of(final, size, folder, i, "");
        if (rename(part, final) != 0)
            status = options_refuse(PROGRAM, "%s: %s, expected a file that can be replaced", final,
                                    strerror(errno));
    }
    for (int32_t i = 0; status != 0 && part != NULL && i < done; i++) {
        path_of(part, size, folder, i, ".part");
        (void)unlink(part);
    }
    if (status != 0 && made)
        (void)rmdir(folder); /* the folder is empty: all files of this run are removed */
    free(part);
    free(final);
    return status;
}

/* Writes the command line without the folder, for the comment in the log: same options, same
 * bytes. */
static void repeat(char *line, size_t size, const char *folder, int argc, char **argv)
{
    size_t used = (size_t)snprintf(line, size, "cairn-arena");

    for (int i = 1; i < argc && used < size; i++) {
        if (i + 1 < argc && argv[i + 1] == folder) {
            i++;
            continue;
        }
        if (strstr(argv[i], folder) != NULL && argv[i][0] == '-')
            continue;
        used += (size_t)snprintf(line + used, size - used, " %s", argv[i]);
    }
    for (char *c = line; *c != '\0'; c++)
        if ((unsigned char)*c < ' ')
            *c = ' '; /* the comment is one line */
}

/* Length of the path, m. */
static double path_length(const sim_survey *survey)
{
    int32_t count;
    const sim_pose *path = sim_survey_path(survey, &count);
    double whole = 0;

    for (int32_t i = 1; i < count; i++)
        whole += hypot(path[i].x - path[i - 1].x, path[i].y - path[i - 1].y);
    return whole;
}

static int32_t tilted_scans(const sim_survey *survey)
{
    int32_t count, tilted = 0;
    const sim_scan *scans = sim_survey_scans(survey, &count);

    for (int32_t i = 0; i < count; i++)
        tilted += scans[i].tilted;
    return tilted;
}

static void print_json(const char *scene, const command *c, const sim_survey *survey, int32_t scans)
{
    cairn_json_writer json = cairn_json_write_begin(stdout);
    double width, height;

    sim_scene_size(c->arena.scene, &width, &height);
    cairn_json_write_text(&json, "scene", scene);
    cairn_json_write_number(&json, "width_m", c->arena.width > 0 ? c->arena.width : width);
    cairn_json_write_number(&json, "height_m", c->arena.height > 0 ? c->arena.height : height);
    cairn_json_write_integer(&json, "scans", scans);
    cairn_json_write_integer(&json, "tilted_scans", tilted_scans(survey));
    cairn_json_write_integer(&json, "beams", c->survey.beams);
    cairn_json_write_number(&json, "path_m", path_length(survey));
    cairn_json_write_text(&json, "folder", c->folder);
    cairn_json_write_array(&json, "files");
    for (int32_t i = 0; i < FILE_COUNT; i++)
        cairn_json_write_text(&json, NULL, file_names[i]);
    cairn_json_write_array_end(&json);
    cairn_json_write_end(&json);
}

static int run(command *c, const char *scene, int argc, char **argv)
{
    char fault[200], line[1000];
    sim_arena *arena;
    sim_survey *survey;
    sim_pose *poses = NULL;
    int32_t count;
    int status = 0;

    c->arena.scene = sim_scene_find(scene);
    if (c->arena.scene < 0)
        return options_refuse(
            PROGRAM, "there is no scene '%s', expected one of those that --help lists", scene);
    if (c->folder == NULL)
        return options_refuse(PROGRAM, "no output folder, expected -o DIR");
    if (c->jitter[0] > 1)
        return options_refuse(PROGRAM, "--jitter is %.9g m, expected 0 to 1", c->jitter[0]);
    if (c->sweep[0] > 5)
        return options_refuse(PROGRAM, "--sweep is %.9g m/s, expected 0 to 5", c->sweep[0]);
    c->arena.width = c->size[0];
    c->arena.height = c->size[1];
    c->arena.turn = c->turn * degree;
    c->survey.seed = c->arena.seed;
    c->survey.fov = c->fov * degree;
    c->survey.jitter_position = c->jitter[0];
    c->survey.jitter_heading = c->jitter[1] * degree;
    c->survey.sweep_speed = c->sweep[0];
    c->survey.sweep_turn = c->sweep[1];

    arena = sim_arena_create(&c->arena, fault, sizeof fault);
    if (arena == NULL)
        return options_refuse(PROGRAM, "%s: %s", scene, fault);
    survey = sim_survey_create(arena, &c->survey, fault, sizeof fault);
    if (survey == NULL) {
        sim_arena_free(arena);
        return options_refuse(PROGRAM, "%s: %s", scene, fault);
    }
    (void)sim_survey_scans(survey, &count);
    if (c->disturb[0] > 0 || c->disturb[1] > 0) {
        poses = malloc((size_t)count * sizeof *poses);
        if (poses == NULL)
            status = options_refuse(PROGRAM, "no memory for %d scans", (int)count);
        else
            sim_survey_disturb(survey, c->arena.seed, c->disturb[0], c->disturb[1] * degree, poses);
    }
    if (status == 0) {
        repeat(line, sizeof line, c->folder, argc, argv);
        status = write_all(c->folder, survey, poses, line);
        if (status == 0 && c->json)
            print_json(scene, c, survey, count);
    }
    free(poses);
    sim_survey_free(survey);
    sim_arena_free(arena);
    return status;
}

/* The defaults of a scene; -1: of no scene. */
static void set_defaults(command *c, sim_scene scene)
{
    memset(c, 0, sizeof *c);
    c->arena = sim_arena_default();
    c->survey = sim_survey_default_for(scene);
    c->turn = (double)NAN;
    c->fov = c->survey.fov / degree;
    c->jitter[0] = c->survey.jitter_position;
    c->jitter[1] = c->survey.jitter_heading / degree;
    c->sweep[0] = c->survey.sweep_speed;
    c->sweep[1] = c->survey.sweep_turn;
}

int main(int argc, char **argv)
{
    command c;
    option table[TABLE];
    char text[3000];
    option_set set = {PROGRAM, "SCENE -o DIR [options]", text, table, TABLE};
    const char *scene;
    size_t given = 1;
    option_result result;

    set_defaults(&c, -1);
    make_table(&c, table);
    about(text, sizeof text);
    result = options_read(&set, argc, argv, &scene, &given);
    if (result != OPTIONS_READ)
        return options_end(PROGRAM, result);
    if (given == 0)
        return options_refuse(PROGRAM, "no scene, expected one of those that --help lists");
    /* The scene is known now: what the options do not say is its own default. */
    set_defaults(&c, sim_scene_find(scene));
    make_table(&c, table);
    result = options_read(&set, argc, argv, &scene, &given);
    if (result != OPTIONS_READ)
        return options_end(PROGRAM, result);
    return options_end(PROGRAM, run(&c, scene, argc, argv));
}
