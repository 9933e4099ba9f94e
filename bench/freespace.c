/* bench/freespace: the free cells of map.pgm against the arena that was mapped.
 *
 * A robot drives through generated buildings with beams without return and with walls of glass;
 * `cairn map` makes the map of the log. A free cell is wrong when its centre is inside a solid body
 * or outside the building. A cell that a returned beam passed, at the pose that cairn map found, is
 * cut when it is beyond the picture, lost when it is not free although no beam ended in it or
 * beside it, and contradicted when beams did, of scans at wrong poses: no surface is near. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "bench/bench_score.h"
#include "cairn/map_file.h"
#include "cairn/pose_table.h"
#include "sim/files.h"
#include "src/host/base/posix.h"
#include "tools/options.h"

#define PROGRAM "bench/freespace"

enum { PATH_BYTES = 300 };

static const double PI = 3.14159265358979323846;
/* m and rad: errors of the scans by which map and arena are aligned */
static const double FIT_M = 0.1, FIT_RAD = 0.035;
/* m: cells nearer to a surface may be occupied, by the errors of ranges */
static const double NEAR_M = 0.1;
/* m around the arena that the comparison covers */
static const double MARGIN_M = 0.5;

typedef struct settings {
    const char *scenes;
    int64_t arenas, seed, scans;
    double range, lost, glass, clear;
} settings;

/* The arena in the cells of its map, and beyond the picture. */
typedef struct truth {
    int32_t width, height, left, bottom; /* cells; cell (left, bottom) is (0, 0) of the map */
    float *clearance;                    /* m, of the centre of each cell; below 0: solid */
    uint8_t *outside;                    /* 1: outside the building */
    uint8_t *passed;                     /* 1: a returned beam passed */
    uint8_t *ended;                      /* 1: a beam ended there, or in a cell beside it */
} truth;

typedef struct counts {
    int64_t free, wrong, passed, not_free, lost, contradicted, cut;
} counts;

/* ---- The map, made by cairn ---- */

/* Runs `cairn map` on a log. Returns 0 after a line on standard error. */
static int run_cairn(const settings *s, char *log, char *folder)
{
    char program[4096], clear[32], *slash;
    char map[] = "map", output[] = "-o", free_space[] = "--clear", quiet[] = "--quiet";
    char *words[] = {program, map, log, output, folder, free_space, clear, quiet, NULL};
    int status = 0;
    pid_t child;

    cairn_program_path(program, sizeof program - 16);
    slash = strrchr(program, '/');
    if (slash == NULL)
        return 0;
    strcpy(slash, "/../cairn");
    snprintf(clear, sizeof clear, "%.9g", s->clear);
    child = fork();
    if (child == 0) {
        (void)execv(program, words);
        _exit(127);
    }
    if (child > 0 && waitpid(child, &status, 0) == child && WIFEXITED(status) &&
        WEXITSTATUS(status) == 0)
        return 1;
    fprintf(stderr, "%s map %s failed\n", program, log);
    return 0;
}

/* Reads the poses of the scans in the map: [count] on the heap. Returns NULL after a line on
 * standard error. */
static sim_pose *read_poses(const char *path, int32_t count)
{
    cairn_file_error error;
    cairn_pose_table_row *row;
    int32_t rows;
    sim_pose *poses = NULL;

    if (cairn_pose_table_read(&row, &rows, path, &error) != CAIRN_OK) {
        fprintf(stderr, "%s\n", error.text);
        return NULL;
    }
    if (rows == count)
        poses = calloc((size_t)count, sizeof *poses);
    for (int32_t i = 0; i < count && poses != NULL; i++) {
        poses[i].x = (double)row[i].pose.x;
        poses[i].y = (double)row[i].pose.y;
        poses[i].theta = (double)row[i].pose.theta;
    }
    if (poses == NULL)
        fprintf(stderr, "%s: %" PRId32 " poses, expected %" PRId32 "\n", path, rows, count);
    cairn_pose_table_free(row);
    return poses;
}

/* Sets the pose of the map's frame in the world that brings most scans to their true poses. Returns
 * 0 when there is no memory. */
static int align_map(const sim_pose *map_scan, const sim_scan *scans, int32_t count,
                     sim_pose *world_map)
{
    const sim_pose identity = {0, 0, 0};
    sim_pose *actual = calloc((size_t)count, sizeof *actual),
             *moved = calloc((size_t)count, sizeof *moved);
    int32_t *use = calloc((size_t)count, sizeof *use);
    int has_memory = actual != NULL && moved != NULL && use != NULL;

    if (has_memory) {
        for (int32_t i = 0; i < count; i++) {
            actual[i] = scans[i].truth;
            use[i] = 1;
        }
        (void)bench_fit_common(actual, map_scan, use, count, FIT_M, FIT_RAD, moved);
        *world_map = bench_pose_compose(moved[0], bench_pose_between(map_scan[0], identity));
    }
    free(actual);
    free(moved);
    free(use);
    return has_memory;
}

/* ---- The truth in the cells of the map ---- */

static sim_point moved_by(sim_pose a_b, double x, double y)
{
    sim_point p = {a_b.x + cos(a_b.theta) * x - sin(a_b.theta) * y,
                   a_b.y + sin(a_b.theta) * x + cos(a_b.theta) * y};

    return p;
}

/* Fills `outside`: free cells that are connected to the border. Returns 0 when there is no
 * memory. */
static int fill_outside(truth *t)
{
    int32_t cells = t->width * t->height, count = 1, *open = malloc((size_t)cells * sizeof *open);

    if (open == NULL)
        return 0;
    open[0] = 0;
    t->outside[0] = 1;
    while (count > 0) {
        int32_t at = open[--count], x = at % t->width, y = at / t->width;
        const int32_t next[4] = {x > 0 ? at - 1 : at, x + 1 < t->width ? at + 1 : at,
                                 y > 0 ? at - t->width : at,
                                 y + 1 < t->height ? at + t->width : at};

        for (int k = 0; k < 4; k++)
            if (!t->outside[next[k]] && t->clearance[next[k]] >= 0) {
                t->outside[next[k]] = 1;
                open[count++] = next[k];
            }
    }
    free(open);
    return 1;
}

/* Covers the picture, and the arena with a margin. */
static void set_extent(truth *t, const cairn_map_file *map, const sim_arena *arena,
                       sim_pose map_world)
{
    sim_arena_options o = sim_arena_options_of(arena);
    double cell = (double)map->resolution, reach = hypot(o.width, o.height) / 2 + MARGIN_M;
    double x = map_world.x - (double)map->origin.x, y = map_world.y - (double)map->origin.y;

    t->left = (int32_t)fmin(0, floor((x - reach) / cell));
    t->bottom = (int32_t)fmin(0, floor((y - reach) / cell));
    t->width = (int32_t)fmax(map->width, ceil((x + reach) / cell)) - t->left;
    t->height = (int32_t)fmax(map->height, ceil((y + reach) / cell)) - t->bottom;
}

/* Returns 0 when there is no memory. */
static int fill_truth(truth *t, const cairn_map_file *map, const sim_arena *arena,
                      sim_pose world_map)
{
    const sim_pose identity = {0, 0, 0};
    double cell = (double)map->resolution;
    size_t cells;

    set_extent(t, map, arena, bench_pose_between(world_map, identity));
    cells = (size_t)t->width * (size_t)t->height;
    t->clearance = malloc(cells * sizeof *t->clearance);
    t->outside = calloc(cells, 1);
    t->passed = calloc(cells, 1);
    t->ended = calloc(cells, 1);
    if (t->clearance == NULL || t->outside == NULL || t->passed == NULL || t->ended == NULL)
        return 0;
    for (size_t i = 0; i < cells; i++) {
        size_t column = i % (size_t)t->width, row = i / (size_t)t->width;
        double x = (double)column + t->left + 0.5, y = (double)row + t->bottom + 0.5;

        t->clearance[i] =
            (float)sim_arena_clearance(arena, moved_by(world_map, (double)map->origin.x + x * cell,
                                                       (double)map->origin.y + y * cell));
    }
    return fill_outside(t);
}

/* Marks a cell at a point of the map, and the cells up to `around` beside it. */
static void mark(const truth *t, const cairn_map_file *map, sim_point p, int32_t around,
                 uint8_t *marks)
{
    double cell = (double)map->resolution;
    int32_t column = (int32_t)floor((p.x - (double)map->origin.x) / cell) - t->left;
    int32_t row = (int32_t)floor((p.y - (double)map->origin.y) / cell) - t->bottom;

    for (int32_t y = row - around; y <= row + around; y++)
        for (int32_t x = column - around; x <= column + around; x++)
            if (x >= 0 && y >= 0 && x < t->width && y < t->height)
                marks[y * t->width + x] = 1;
}

/* Marks the cells that a beam of `range` passes, and its end. */
static void mark_beam(truth *t, const cairn_map_file *map, sim_pose map_sensor, double angle,
                      double range)
{
    double along = (double)map->resolution / 4, c = cos(angle), s = sin(angle);
    int32_t steps = (int32_t)floor(range / along);

    for (int32_t k = 0; k < steps; k++)
        mark(t, map, moved_by(map_sensor, k * along * c, k * along * s), 0, t->passed);
    mark(t, map, moved_by(map_sensor, range * c, range * s), 1, t->ended);
}

static void mark_beams(truth *t, const cairn_map_file *map, const sim_scan *scans,
                       const sim_pose *map_scan, int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        const sim_scan *scan = &scans[i];
        sim_pose map_sensor = bench_pose_compose(map_scan[i], scan->base_sensor);

        for (int32_t k = 0; k < scan->count; k++)
            if (isfinite(scan->range[k]))
                mark_beam(t, map, map_sensor, scan->angle_min + k * scan->angle_step,
                          (double)scan->range[k]);
    }
}

/* ---- Comparison ---- */

static counts compare(const truth *t, const cairn_map_file *map)
{
    counts c = {0};

    for (int32_t y = 0; y < t->height; y++)
        for (int32_t x = 0; x < t->width; x++) {
            int32_t column = x + t->left, row = y + t->bottom, at = y * t->width + x;
            int is_in_picture = column >= 0 && row >= 0 && column < map->width && row < map->height;
            int is_free = is_in_picture && map->occupancy[row * map->width + column] == 0;
            int is_empty = t->clearance[at] >= 0 && !t->outside[at];

            c.free += is_free;
            c.wrong += is_free && !is_empty;
            if (!t->passed[at])
                continue;
            c.passed++;
            c.not_free += !is_free;
            c.lost += !is_free && !t->ended[at];
            c.contradicted += !is_free && t->ended[at] && (double)t->clearance[at] >= NEAR_M;
            c.cut += !is_in_picture;
        }
    return c;
}

static void print_counts(const settings *s, const char *scene, int64_t seed, const counts *c)
{
    bench_json_begin("freespace");
    bench_json_text("scene", scene);
    bench_json_number("range_m", s->range);
    bench_json_number("clear_m", s->clear);
    if (seed >= 0)
        bench_json_integer("seed", seed);
    else
        bench_json_integer("arenas", s->arenas);
    bench_json_integer("free_cells", c->free);
    bench_json_number("wrong_free", (double)c->wrong / (double)c->free);
    bench_json_integer("passed_cells", c->passed);
    bench_json_number("lost_free", (double)c->not_free / (double)c->passed);
    bench_json_integer("lost", c->lost);
    bench_json_integer("contradicted", c->contradicted);
    bench_json_integer("cut", c->cut);
    if (seed < 0)
        bench_json_true("summary");
    bench_json_end();
}

static counts compare_with_truth(const sim_survey *survey, const cairn_map_file *map,
                                 const sim_pose *map_scan)
{
    counts c = {0};
    sim_pose world_map;
    truth t = {0};
    int32_t count;
    const sim_scan *scans = sim_survey_scans(survey, &count);

    if (align_map(map_scan, scans, count, &world_map) &&
        fill_truth(&t, map, sim_survey_arena(survey), world_map)) {
        mark_beams(&t, map, scans, map_scan, count);
        c = compare(&t, map);
    }
    free(t.clearance);
    free(t.outside);
    free(t.passed);
    free(t.ended);
    return c;
}

static int write_log(const sim_survey *survey, const char *path)
{
    FILE *file = fopen(path, "wb");
    int is_written = file != NULL && sim_write_log(survey, NULL, NULL, file) == 0;

    if (file != NULL && fclose(file) != 0)
        is_written = 0;
    if (!is_written)
        perror(path);
    return is_written;
}

/* Maps the survey in the folder and compares. Returns 0 after a line on standard error. */
static int map_and_compare(const settings *s, const sim_survey *survey, char *folder, counts *c)
{
    char log[PATH_BYTES], yaml[PATH_BYTES], poses[PATH_BYTES];
    cairn_file_error error;
    cairn_map_file map;
    sim_pose *map_scan;
    int32_t count;

    (void)sim_survey_scans(survey, &count);
    snprintf(log, sizeof log, "%s/scans.log", folder);
    snprintf(yaml, sizeof yaml, "%s/map.yaml", folder);
    snprintf(poses, sizeof poses, "%s/poses.csv", folder);
    if (!write_log(survey, log) || !run_cairn(s, log, folder))
        return 0;
    map_scan = read_poses(poses, count);
    if (map_scan == NULL)
        return 0;
    if (cairn_map_file_read(&map, yaml, &error) != CAIRN_OK) {
        fprintf(stderr, "%s\n", error.text);
        free(map_scan);
        return 0;
    }
    *c = compare_with_truth(survey, &map, map_scan);
    cairn_map_file_free(&map);
    free(map_scan);
    if (c->free == 0)
        fprintf(stderr, "%s: no free cells, or no memory for the comparison\n", yaml);
    return c->free > 0;
}

/* Removes what cairn map has written. */
static void remove_files(const char *folder)
{
    static const char *const names[] = {"scans.log", "poses.csv", "poses.tum", "graph.g2o",
                                        "map.pgm",   "map.yaml",  "map.svg"};
    char path[PATH_BYTES];

    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, names[i]);
        (void)remove(path);
    }
    (void)rmdir(folder);
}

/* One arena. Returns 0 after a line on standard error. */
static int run_arena(const settings *s, sim_scene scene, int64_t seed, counts *all)
{
    const char *temporary = getenv("TMPDIR");
    sim_arena_options arena_options = sim_arena_default();
    sim_survey_options options = sim_survey_default();
    sim_survey *survey = NULL;
    sim_arena *arena;
    counts c = {0};
    char fault[256] = "no memory", folder[PATH_BYTES - 16];
    int done = 0;

    arena_options.scene = scene;
    arena_options.seed = options.seed = (uint64_t)seed;
    options.drive = (int32_t)s->scans;
    options.drive_distance = options.drive_turn = 0.2;
    options.beams = 361;
    options.fov = PI;
    options.range_max = s->range;
    options.lost = s->lost;
    options.glass = s->glass;
    snprintf(folder, sizeof folder, "%s/cairn-freespace-XXXXXX",
             temporary != NULL ? temporary : "/tmp");
    arena = sim_arena_create(&arena_options, fault, sizeof fault);
    if (arena != NULL)
        survey = sim_survey_create(arena, &options, fault, sizeof fault);
    if (survey != NULL && mkdtemp(folder) == NULL) {
        perror(folder);
    } else if (survey != NULL) {
        done = map_and_compare(s, survey, folder, &c);
        remove_files(folder);
    } else {
        fprintf(stderr, "%s, seed %" PRId64 ": %s\n", sim_scene_name(scene), seed, fault);
    }
    sim_survey_free(survey);
    sim_arena_free(arena);
    if (!done)
        return 0;
    print_counts(s, sim_scene_name(scene), seed, &c);
    all->free += c.free;
    all->wrong += c.wrong;
    all->passed += c.passed;
    all->not_free += c.not_free;
    all->lost += c.lost;
    all->contradicted += c.contradicted;
    all->cut += c.cut;
    return 1;
}

/* Parses names with commas between. Returns their number, 0 after a line on standard error. */
static int32_t read_scenes(const char *text, sim_scene scenes[SIM_SCENES])
{
    int32_t count = 0;

    for (const char *from = text; count < SIM_SCENES; from++) {
        size_t length = strcspn(from, ",");
        char name[32];

        snprintf(name, sizeof name, "%.*s", (int)(length < 31 ? length : 31), from);
        scenes[count] = sim_scene_find(name);
        if (scenes[count++] < 0) {
            (void)options_refuse(PROGRAM, "--scenes has '%s', expected names of scenes", name);
            return 0;
        }
        from += length;
        if (*from == '\0')
            break;
    }
    return count;
}

int main(int argc, char **argv)
{
    settings s = {"apartment,office,rescue,maze", 20, 1, 400, 8, 0.03, 0.05, 5};
    const option table[] = {
        OPTION_TEXT("--scenes", &s.scenes, "NAME,...", "in turn, one an arena"),
        OPTION_INTEGER("--arenas", &s.arenas, 1, 1000000, "N", "arenas in all"),
        OPTION_INTEGER("--seed", &s.seed, 0, 1000000000, "N", "of the first one"),
        OPTION_INTEGER("--scans", &s.scans, 2, 10000, "N",
                       "of a drive, one every 0.2 m or 0.2 rad"),
        OPTION_NUMBER("--range", &s.range, 1, 200, "M", "maximum range of the scanner"),
        OPTION_NUMBER("--lost", &s.lost, 0, 1, "SHARE", "of beams without return"),
        OPTION_NUMBER("--glass", &s.glass, 0, 1, "SHARE", "of walls and furniture of glass"),
        OPTION_NUMBER("--clear", &s.clear, 0, 1000, "M", "of cairn map"),
    };
    const option_set set = {PROGRAM, "[options]",
                            "Compares the free cells of cairn map with the arenas.", table,
                            sizeof table / sizeof *table};
    sim_scene scenes[SIM_SCENES];
    counts all = {0};
    size_t words = 0;
    int32_t count;
    option_result result = options_read(&set, argc, argv, NULL, &words);

    if (result != OPTIONS_READ)
        return result;
    count = read_scenes(s.scenes, scenes);
    if (count == 0)
        return OPTIONS_BAD;
    for (int64_t i = 0; i < s.arenas; i++)
        if (!run_arena(&s, scenes[i % count], s.seed + i, &all))
            return 1;
    print_counts(&s, s.scenes, -1, &all);
    return 0;
}
