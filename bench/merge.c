/* bench/merge: merging of the maps of several robots without a prior.
 *
 * An arena is divided among robots; each scans its part from a few places and builds a grid in a
 * separate frame. A map is right when it lies within 0.10 m and 2 degrees of the truth, relative to
 * the largest consistent set of maps. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_calibration.h"
#include "bench/bench_json.h"
#include "bench/bench_maps.h"
#include "bench/bench_parts.h"
#include "bench/bench_repeat.h"
#include "bench/bench_score.h"
#include "cairn/map_file.h"
#include "cairn/output.h"
#include "src/host/base/degrees.h"
#include "tools/options.h"

static const double RIGHT_M = 0.10, RIGHT_RAD = 2 * CAIRN_DEGREE;

/* Tolerance within which a wrong map is at the right place, but inaccurate. */
static const double PLACE_M = 0.30, PLACE_RAD = 5 * CAIRN_DEGREE;

typedef struct settings {
    bench_parts_options parts;
    int64_t robots, seeds, seed, particles;
    double overlap;
    const char *write;
    const char *maps, *perception;
    int32_t decoy, pair, repeat, modes, order, scaling, calibration, fit, table;
    int32_t corners; /* of a map at most; 0: the default */
    int32_t as_written, gave_particles;
} settings;

enum { MAX_MAPS = 64 };

/* What the places of a pair are compared by (fig. 9.5). */
enum { BEST_PSI, BEST_GAMMA, BEST_PRODUCT, BESTS };
static const char *const BEST_NAMES[BESTS] = {"psi_right", "gamma_right", "product_right"};

typedef struct outcome {
    int32_t maps, right, wrong, elsewhere, left_out, decoy_accepted;
    double overlap, seconds;
    double corners; /* of a map, in the mean */
    size_t pool_bytes;
    cairn_map_merge_result result;
    /* with --modes: pairs of neighbours, of them those with a right place among their modes, and of
     * these those whose best place by BEST_NAMES is right */
    int32_t pairs, pairs_found, pairs_best[BESTS];
} outcome;

static cairn_map_merge_params base_params(const settings *s)
{
    cairn_map_merge_params p =
        s->as_written ? cairn_map_merge_as_written() : cairn_map_merge_default();

    p.particles = (int32_t)s->particles;
    if (s->perception != NULL && strcmp(s->perception, "images") == 0)
        p.perception = CAIRN_MAP_MERGE_IMAGES;
    return p;
}

static cairn_map_merge_params params_for(const settings *s, const bench_parts *parts, int32_t extra)
{
    cairn_map_merge_params p = base_params(s);
    int64_t cells = 0;

    p.max_maps = parts->count + extra;
    p.max_corners = s->corners > 0 ? s->corners : p.max_corners;
    for (int32_t i = 0; i < parts->count; i++) {
        int32_t own = parts->list[i].side * parts->list[i].side;

        cells += own;
        p.max_map_cells = i == 0 || own > p.max_map_cells ? own : p.max_map_cells;
    }
    p.max_cells = (int32_t)(cells + extra * (int64_t)p.max_map_cells);
    return p;
}

static int is_near(cairn_pose pose, sim_pose truth, double metres, double radians)
{
    return hypot((double)pose.x - truth.x, (double)pose.y - truth.y) <= metres &&
           fabs(remainder((double)pose.theta - truth.theta, 360 * CAIRN_DEGREE)) <= radians;
}

/* Whether the place of a pair that is best by Psi, by gamma, and by the product of Psi and of gamma
 * above its minimum (fig. 9.5) is right. */
static void print_best(const cairn_map_merge *merge, int32_t a, int32_t b, sim_pose truth,
                       outcome *out)
{
    cairn_real best[BESTS] = {0, 0, 0}, least = 0, evidence;
    int32_t right[BESTS] = {0, 0, 0};
    cairn_map_merge_pair_score score;
    cairn_pose pose;

    for (int32_t k = 0; cairn_map_merge_mode(merge, a, b, k, &pose, &evidence); k++)
        if (cairn_map_merge_score(merge, a, b, pose, &score) == CAIRN_OK)
            least = k == 0 || score.gamma < least ? score.gamma : least;
    for (int32_t k = 0; cairn_map_merge_mode(merge, a, b, k, &pose, &evidence); k++) {
        cairn_real by[BESTS];

        if (cairn_map_merge_score(merge, a, b, pose, &score) != CAIRN_OK)
            continue;
        by[BEST_PSI] = score.psi;
        by[BEST_GAMMA] = score.gamma - least;
        by[BEST_PRODUCT] = by[BEST_PSI] * by[BEST_GAMMA];
        for (int i = 0; i < BESTS; i++)
            if (k == 0 || by[i] > best[i]) {
                best[i] = by[i];
                right[i] = is_near(pose, truth, PLACE_M, PLACE_RAD);
            }
    }
    for (int i = 0; i < BESTS; i++) {
        bench_json_integer(BEST_NAMES[i], right[i]);
        out->pairs_best[i] += right[i];
    }
}

/* The best modes of true neighbours compared with the best wrong ones. */
static void print_modes(const cairn_map_merge *merge, const bench_parts *parts, outcome *out)
{
    for (int32_t b = 0; b < parts->count; b++)
        for (int32_t a = 0; a < b; a++) {
            sim_pose truth = bench_pose_between(parts->list[a].world_map, parts->list[b].world_map);
            cairn_pose t = {(cairn_real)truth.x, (cairn_real)truth.y, (cairn_real)truth.theta},
                       pose;
            cairn_map_merge_pair_score score;
            cairn_real evidence;
            int32_t right = 0;

            if (cairn_map_merge_score(merge, a, b, t, &score) != CAIRN_OK)
                continue;
            bench_json_begin("merge");
            bench_json_integer("a", a);
            bench_json_integer("b", b);
            bench_json_number("shared", bench_parts_shared(parts, a, b));
            bench_json_number("true_evidence", (double)score.log_likelihood_ratio);
            bench_json_number("agree", (double)score.agreeing_wall);
            bench_json_number("conflict", (double)score.free_space_violation);
            for (int32_t k = 0; k < 3 && cairn_map_merge_mode(merge, a, b, k, &pose, &evidence);
                 k++) {
                char key[32];

                snprintf(key, sizeof key, "mode%d", (int)k);
                bench_json_number(key, (double)evidence);
                snprintf(key, sizeof key, "off%d", (int)k);
                bench_json_number(key, hypot((double)(pose.x - t.x), (double)(pose.y - t.y)));
                if (cairn_map_merge_score(merge, a, b, pose, &score) == CAIRN_OK)
                    snprintf(key, sizeof key, "conflict%d", (int)k);
                bench_json_number(key, (double)score.free_space_violation);
            }
            for (int32_t k = 0; cairn_map_merge_mode(merge, a, b, k, &pose, &evidence); k++)
                if (is_near(pose, truth, PLACE_M, PLACE_RAD) && ++right == 1)
                    bench_json_integer("right_mode", k);
            bench_json_integer("right_modes", right);
            out->pairs++;
            out->pairs_found += right > 0;
            if (right > 0)
                print_best(merge, a, b, truth, out);
            bench_json_end();
        }
}

static int is_placed(const cairn_map_merge *merge, int32_t i)
{
    return cairn_map_merge_of(merge, i).verdict == CAIRN_MAP_MERGE_PLACED;
}

/* Counts the placed maps within tolerance of the truth, relative to map k. */
static int32_t count_near(const cairn_map_merge *merge, const bench_parts *parts, int32_t k,
                          double metres, double radians)
{
    int32_t near = 0;

    for (int32_t i = 0; i < parts->count; i++) {
        cairn_pose seen = cairn_pose_between(cairn_map_merge_of(merge, k).reference_map,
                                             cairn_map_merge_of(merge, i).reference_map);
        sim_pose truth = bench_pose_between(parts->list[k].world_map, parts->list[i].world_map);

        near += is_placed(merge, i) && is_near(seen, truth, metres, radians);
    }
    return near;
}

/* Right maps among the placed: those consistent with the map with which most are consistent. */
static void score(const cairn_map_merge *merge, const bench_parts *parts, outcome *out)
{
    int32_t placed = 0, most = 0, best = 0;

    for (int32_t k = 0; k < parts->count; k++) {
        int32_t agree = is_placed(merge, k) ? count_near(merge, parts, k, RIGHT_M, RIGHT_RAD) : 0;

        placed += is_placed(merge, k);
        best = agree > most ? k : best;
        most = agree > most ? agree : most;
    }
    out->maps = parts->count;
    out->right = most;
    out->wrong = placed - most;
    out->elsewhere = placed > 0 ? placed - count_near(merge, parts, best, PLACE_M, PLACE_RAD) : 0;
    out->left_out = parts->count - placed;
}

/* robot_0.yaml ... with their images, in an existing folder. */
static int write_maps(const bench_parts *parts, const char *folder)
{
    int ok = 1;

    for (int32_t i = 0; ok && i < parts->count; i++) {
        const bench_part *part = &parts->list[i];
        cairn_map_file file = cairn_map_file_default();
        cairn_file_error error;
        char name[32], *path;

        snprintf(name, sizeof name, "robot_%d.yaml", (int)i);
        path = cairn_output_path_join(folder, name);
        file.resolution = (cairn_real)parts->resolution;
        file.origin.x = file.origin.y = -(cairn_real)(part->side * parts->resolution / 2);
        ok = path != NULL && cairn_map_file_allocate(&file, part->side, part->side) == CAIRN_OK;
        for (int32_t k = 0; ok && k < part->side * part->side; k++)
            file.occupancy[k] = (int8_t)(part->cells[k] == CAIRN_OCCUPANCY_GRID_OCCUPIED ? 100
                                         : part->cells[k] == CAIRN_OCCUPANCY_GRID_FREE   ? 0
                                                                                         : -1);
        ok = ok && cairn_map_file_draw(&file) == CAIRN_OK;
        if (ok && cairn_map_file_write(&file, path, CAIRN_MAP_FILE_PGM, &error) != CAIRN_OK) {
            fprintf(stderr, "%s\n", error.text);
            ok = 0;
        }
        cairn_map_file_free(&file);
        free(path);
    }
    return ok;
}

static int run_seed(const settings *s, int64_t seed, outcome *out)
{
    bench_parts parts, other;
    bench_parts_options options = s->parts;
    int32_t order[MAX_MAPS];
    cairn_map_merge_params params;
    cairn_map_merge *merge = NULL;
    cairn_pool pool;
    bench_part *decoy = NULL;
    void *memory = NULL;
    double start;
    int ok;

    memset(out, 0, sizeof *out);
    memset(&other, 0, sizeof other);
    options.seed = (uint64_t)seed;
    ok = s->repeat ? bench_repeat_make(options.seed, options.resolution, &parts)
                   : bench_parts_make(&options, &parts);
    if (ok && s->decoy) {
        options.seed += seed % 2 == 0 ? 0 : 500009;
        ok = bench_parts_make(&options, &other);
        decoy = ok ? &other.list[other.count / 2] : NULL;
        if (ok && seed % 2 == 0)
            bench_part_mirror(decoy);
    }
    if (ok) {
        params = params_for(s, &parts, s->decoy);
        if (decoy != NULL && decoy->side * decoy->side > params.max_map_cells) {
            params.max_cells += decoy->side * decoy->side;
            params.max_map_cells = decoy->side * decoy->side;
        }
        out->pool_bytes = cairn_map_merge_memory(&params);
        memory = malloc(out->pool_bytes + CAIRN_ALIGN);
        ok = memory != NULL &&
             cairn_pool_init(&pool, memory, out->pool_bytes + CAIRN_ALIGN) == CAIRN_OK &&
             cairn_map_merge_create(&merge, &pool, &params) == CAIRN_OK;
    }
    for (int32_t i = 0; i < MAX_MAPS; i++)
        order[i] = i;
    start = bench_seconds();
    ok = ok && bench_parts_merge(merge, &parts, decoy, s->order ? order : NULL);
    out->seconds = bench_seconds() - start;
    if (ok) {
        out->overlap = parts.overlap;
        out->result = cairn_map_merge_read(merge);
        score(merge, &parts, out);
        for (int32_t i = 0; i < parts.count; i++)
            out->corners += (double)cairn_map_merge_of(merge, i).corners / parts.count;
        out->decoy_accepted = decoy != NULL && cairn_map_merge_of(merge, parts.count).verdict ==
                                                   CAIRN_MAP_MERGE_PLACED;
        if (s->modes)
            print_modes(merge, &parts, out);
    }
    if (ok && s->write != NULL)
        ok = write_maps(&parts, s->write);
    free(memory);
    bench_parts_free(&parts);
    bench_parts_free(&other);
    return ok;
}

static void print_seed(int64_t seed, const outcome *out)
{
    bench_json_begin("merge");
    bench_json_integer("seed", seed);
    bench_json_integer("maps", out->maps);
    bench_json_integer("right", out->right);
    bench_json_integer("wrong", out->wrong);
    bench_json_integer("elsewhere", out->elsewhere);
    bench_json_integer("left_out", out->left_out);
    bench_json_integer("decoy_accepted", out->decoy_accepted);
    bench_json_number("overlap", out->overlap);
    bench_json_number("seconds", out->seconds);
    bench_json_number("corners", out->corners);
    bench_json_integer("hypotheses", out->result.hypotheses);
    bench_json_integer("resamplings", out->result.resamplings);
    bench_json_integer("units", out->result.units);
    bench_json_integer("most_particles", out->result.peak_particles);
    bench_json_integer("candidates_dropped", out->result.candidates_dropped);
    bench_json_end();
    fflush(stdout);
}

static int run_arenas(const settings *s)
{
    double *seconds = calloc((size_t)s->seeds, sizeof *seconds);
    int32_t all = 0, wrong = 0, elsewhere = 0, left_out = 0, decoys = 0, right = 0, maps = 0;
    int32_t pairs = 0, pairs_found = 0, pairs_best[BESTS] = {0};
    double corners = 0;
    size_t pool_bytes = 0;
    int ok = seconds != NULL;

    for (int64_t i = 0; ok && i < s->seeds; i++) {
        outcome out;

        ok = run_seed(s, s->seed + i, &out);
        if (!ok)
            break;
        print_seed(s->seed + i, &out);
        seconds[i] = out.seconds;
        all += out.right == out.maps;
        right += out.right;
        maps += out.maps;
        wrong += out.wrong;
        elsewhere += out.elsewhere;
        left_out += out.left_out;
        decoys += out.decoy_accepted;
        corners += out.corners / (double)s->seeds;
        pairs += out.pairs;
        pairs_found += out.pairs_found;
        for (int k = 0; k < BESTS; k++)
            pairs_best[k] += out.pairs_best[k];
        pool_bytes = out.pool_bytes > pool_bytes ? out.pool_bytes : pool_bytes;
    }
    if (ok) {
        bench_json_begin("merge");
        bench_json_integer("robots", s->parts.robots);
        bench_json_number("overlap", s->overlap);
        bench_json_integer("particles", s->particles);
        bench_json_number("all_right", (double)all / (double)s->seeds);
        bench_json_integer("all_right_count", all);
        bench_json_number("right_share", (double)right / (double)maps);
        bench_json_integer("wrong", wrong);
        bench_json_integer("elsewhere", elsewhere);
        bench_json_integer("left_out", left_out);
        bench_json_integer("decoys_accepted", decoys);
        bench_json_number("corners_mean", corners);
        bench_json_integer("modes_most", base_params(s).max_modes);
        if (s->modes) {
            bench_json_integer("pairs", pairs);
            bench_json_integer("pairs_found", pairs_found);
            for (int k = 0; k < BESTS; k++)
                bench_json_integer(BEST_NAMES[k], pairs_best[k]);
        }
        bench_json_number("seconds_median", bench_median(seconds, (size_t)s->seeds));
        bench_json_integer("pool_bytes", (int64_t)pool_bytes);
        bench_json_true("summary");
        bench_json_end();
    }
    free(seconds);
    return ok ? 0 : 1;
}

/* ---- Growth of the work ---- */

enum { SCALES = 5, LARGE_SCALE = 2 /* the first of the larger sizes */ };

typedef struct growth {
    double size[SCALES], units[SCALES];
    int32_t count;
} growth;

/* One size: the mean units of all seeds. */
static int grow(const settings *s, growth *g)
{
    double units = 0, corners = 0;

    for (int64_t i = 0; i < s->seeds; i++) {
        outcome out;

        if (!run_seed(s, s->seed + i, &out))
            return 0;
        units += (double)out.result.units / (double)s->seeds;
        corners += out.corners / (double)s->seeds;
    }
    g->size[g->count] = s->corners > 0 ? corners : (double)s->parts.robots;
    g->units[g->count++] = units;
    return 1;
}

/* The slope of the straight line through log units over log size, from size `first` on. */
static double exponent_of(const growth *g, int32_t first)
{
    double x = 0, y = 0, xx = 0, xy = 0;

    for (int32_t i = first; i < g->count; i++) {
        x += log(g->size[i]) / (g->count - first);
        y += log(g->units[i]) / (g->count - first);
    }
    for (int32_t i = first; i < g->count; i++) {
        xx += (log(g->size[i]) - x) * (log(g->size[i]) - x);
        xy += (log(g->size[i]) - x) * (log(g->units[i]) - y);
    }
    return xy / xx;
}

static void print_growth(const settings *s, const growth *g, const char *over)
{
    for (int32_t i = 0; i < g->count; i++) {
        bench_json_begin("merge");
        bench_json_text("scaling", over);
        bench_json_text("order", s->order ? "known" : "unknown");
        bench_json_number(over, g->size[i]);
        bench_json_number("units", g->units[i]);
        bench_json_end();
        fflush(stdout);
    }
}

/* Units over maps, with the order known and unknown, then over corners, with --robots maps; last a
 * line with the exponents, of maps also without the smallest sizes, at which few particles
 * differ. */
static int run_scaling(settings s)
{
    static const int32_t robots[SCALES] = {3, 4, 6, 9, 12}, corners[SCALES] = {2, 4, 8, 16, 32};
    growth maps[2] = {{.count = 0}, {.count = 0}}, kept[2] = {{.count = 0}, {.count = 0}};
    int32_t given = s.parts.robots;

    for (s.order = 1; s.order >= 0; s.order--) {
        for (int k = 0; k < SCALES; k++) {
            s.parts.robots = robots[k];
            if (!grow(&s, &maps[s.order]))
                return 1;
        }
        print_growth(&s, &maps[s.order], "maps");
    }
    s.parts.robots = given;
    for (s.order = 1; s.order >= 0; s.order--) {
        for (int k = 0; k < SCALES; k++) {
            s.corners = corners[k];
            if (!grow(&s, &kept[s.order]))
                return 1;
        }
        print_growth(&s, &kept[s.order], "corners");
    }
    bench_json_begin("merge");
    bench_json_number("known_maps", exponent_of(&maps[1], 0));
    bench_json_number("known_maps_large", exponent_of(&maps[1], LARGE_SCALE));
    bench_json_number("known_corners", exponent_of(&kept[1], 0));
    bench_json_number("unknown_maps", exponent_of(&maps[0], 0));
    bench_json_number("unknown_maps_large", exponent_of(&maps[0], LARGE_SCALE));
    bench_json_number("unknown_corners", exponent_of(&kept[0], 0));
    bench_json_true("summary");
    bench_json_end();
    return 0;
}

int main(int argc, char **argv)
{
    settings s = {.robots = 3,
                  .seeds = 20,
                  .seed = 1,
                  .particles = 100,
                  .overlap = 30,
                  .parts = {.scene = "rescue", .tile = 12, .resolution = 0.05, .places = 12}};
    int64_t places = 12;
    const option table[] = {
        OPTION_INTEGER("--robots", &s.robots, 2, 63, "R", "maps, one a robot"),
        OPTION_NUMBER("--overlap", &s.overlap, 1, 95, "PERCENT",
                      "of the smaller map's known cells that neighbours share"),
        OPTION_INTEGER("--seeds", &s.seeds, 1, 100000, "N", "arenas"),
        OPTION_INTEGER("--seed", &s.seed, 0, 1e9, "N", "of the first arena"),
        {"--particles", OPTION_IS_INTEGER, &s.particles, 1, 4096, "N",
         "of the filter; as written 50", &s.gave_particles},
        OPTION_TEXT("--perception", &s.perception, "NAME",
                    "evidence, or images: Psi and gamma of the thesis"),
        OPTION_FLAG("--as-written", &s.as_written,
                    "chapter 9 of the thesis as written: corners alone, images alone"),
        OPTION_TEXT("--scene", &s.parts.scene, "NAME", "arena"),
        OPTION_NUMBER("--tile", &s.parts.tile, 3, 20, "M", "side of a robot's part, m"),
        OPTION_INTEGER("--places", &places, 1, 64, "P", "from which a robot scans"),
        OPTION_FLAG("--pair", &s.pair, "two robots in an arena of 20 by 16 m"),
        OPTION_FLAG(
            "--repeat", &s.repeat,
            "three maps of a building with two identical rooms, which the third one distinguishes"),
        OPTION_FLAG("--order", &s.order, "in a known order, row by row"),
        OPTION_FLAG("--decoy", &s.decoy,
                    "one map more, of another arena or of this one in a mirror"),
        OPTION_FLAG("--modes", &s.modes, "also the best places of every pair, beside the truth"),
        OPTION_FLAG("--scaling", &s.scaling,
                    "how units grow with the maps and, for --robots of them, with their corners"),
        OPTION_FLAG("--calibration", &s.calibration,
                    "pairs of maps of several scenes instead: how often a map is wrong, by the "
                    "probability that was stated of it"),
        OPTION_FLAG("--fit", &s.fit,
                    "reads lines of --calibration from standard input instead: constants of the "
                    "error probability fitted to even seeds, and how true it is of odd ones"),
        OPTION_FLAG("--table", &s.table, "with --fit: a table of that in Markdown"),
        OPTION_TEXT("--write", &s.write, "DIR",
                    "writes the maps of the last seed there, for cairn merge"),
        OPTION_TEXT("--maps", &s.maps, "DIR",
                    "real maps instead: pairs of them as their annotators placed them"),
    };
    const option_set set = {"bench/merge", "[options]", "Merges maps of simulated robots.", table,
                            sizeof table / sizeof *table};
    size_t words = 0;
    option_result result = options_read(&set, argc, argv, NULL, &words);

    if (result != OPTIONS_READ)
        return result;
    s.parts.robots = s.pair ? 2 : (int32_t)s.robots;
    s.parts.overlap = s.overlap / 100;
    s.parts.places = (int32_t)places;
    s.parts.pair = s.pair;
    if (s.perception != NULL && strcmp(s.perception, "images") != 0 &&
        strcmp(s.perception, "evidence") != 0)
        return options_refuse("bench/merge", "--perception %s, expected evidence or images",
                              s.perception);
    if (s.as_written && s.perception != NULL && strcmp(s.perception, "images") != 0)
        return options_refuse("bench/merge",
                              "--as-written weighs places by images, expected no --perception %s",
                              s.perception);
    if (s.as_written && !s.gave_particles)
        s.particles = cairn_map_merge_as_written().particles;
    if (sim_scene_find(s.parts.scene) < 0)
        return options_refuse("bench/merge", "unknown scene '%s'", s.parts.scene);
    if (s.maps != NULL) {
        cairn_map_merge_params params = base_params(&s);

        return bench_maps_run(s.maps, &params);
    }
    if (s.fit) {
        bench_calibration_model model = bench_calibration_of_maps();

        return bench_calibration_fit(&model, s.table);
    }
    if (s.calibration) {
        cairn_map_merge_params params = base_params(&s);

        return bench_calibration_run(&params, s.seeds, s.seed);
    }
    return s.scaling ? run_scaling(s) : run_arenas(&s);
}
