/* bench/match: maps of simulated arenas from places without any odometry.
 *
 * 16 places with four scans of 100 degrees each; the poses of the scans within a place are known
 * (or wrong by --sub-error), the relative poses of the places are unknown to the mapper. A place is
 * right when it lies within 0.10 m and 2 degrees of the truth after the best rigid alignment, an
 * arena when all its places are; silently wrong when its pose is wrong, but it is in the largest
 * component and not reported ambiguous. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "bench/bench_match.h"
#include "bench/bench_places.h"
#include "src/alignment/place_map_variants.h"
#include "tools/options.h"

typedef struct settings {
    bench_match_settings world;
    const char *method, *pictures;
    int32_t decoupled, by_icp, ablate, calibration, each, fit, table;
} settings;

typedef struct outcome {
    int32_t places, right, silently_wrong, parts, ambiguous, ok;
    double median_m, median_deg;           /* of places */
    double scan_median_m, scan_median_deg; /* of scans */
    double seconds, total, competing_total;
    size_t pool_bytes;
} outcome;

/* ---- Scoring ---- */

/* poses: [scan_count] of the scans, moved onto the truth by the motion that fits most places. */
static int score(const bench_match_problem *p, const bench_match_machine *m, sim_pose *poses,
                 outcome *out)
{
    size_t n = (size_t)p->scan_count;
    sim_pose *truth = malloc(n * sizeof *truth), *places = malloc(n * sizeof *places);
    int32_t *use = malloc(n * sizeof *use);
    double *metres = malloc(n * sizeof *metres), *degrees = malloc(n * sizeof *degrees);
    cairn_place_map_result result = cairn_place_map_read(m->map);
    int done = truth != NULL && places != NULL && use != NULL && metres != NULL && degrees != NULL;

    for (int32_t i = 0; i < p->place_count && done; i++) {
        cairn_place_map_place place = cairn_place_map_place_of(m->map, i);

        truth[i] = p->frame[i];
        places[i] = bench_sim_pose(place.map_place);
        use[i] = place.component == 0;
    }
    if (done) {
        sim_pose before = places[0], move;

        out->places = p->place_count;
        (void)bench_fit_common(truth, places, use, p->place_count, BENCH_RIGHT_M, BENCH_RIGHT_RAD,
                               places);
        for (int32_t i = 0; i < p->place_count; i++) {
            int right = bench_pose_near(truth[i], places[i], BENCH_RIGHT_M, BENCH_RIGHT_RAD);

            out->right += use[i] && right;
            out->silently_wrong +=
                use[i] && !right && !cairn_place_map_place_of(m->map, i).ambiguous;
        }
        bench_pose_errors(truth, places, p->place_count, metres, degrees);
        out->median_m = bench_median(metres, (size_t)p->place_count);
        out->median_deg = bench_median(degrees, (size_t)p->place_count);
        /* the same motion for the scans: moved_first * first^-1 */
        move = bench_pose_compose(places[0], bench_pose_between(before, (sim_pose){0, 0, 0}));
        for (int32_t k = 0; k < p->scan_count; k++)
            poses[k] =
                bench_pose_compose(move, bench_sim_pose(cairn_place_map_scan_pose(m->map, k)));
        bench_pose_errors(p->truth, poses, p->scan_count, metres, degrees);
        out->scan_median_m = bench_median(metres, n);
        out->scan_median_deg = bench_median(degrees, n);
        out->parts = result.components;
        out->ambiguous = result.ambiguous;
        out->total = (double)result.total;
        out->competing_total = (double)result.competing_total;
        out->ok = out->right == out->places;
    }
    free(truth);
    free(places);
    free(use);
    free(metres);
    free(degrees);
    return done;
}

static cairn_place_map_params params_of(const settings *s)
{
    cairn_place_map_params params = cairn_place_map_default();

    if (s->world.as_written)
        return bench_match_written_params(&s->world, PLACES_DECOUPLED);
    params.max_places = (int32_t)s->world.places;
    params.max_scans = BENCH_MATCH_HEADINGS * (int32_t)s->world.places;
    if (s->decoupled || s->by_icp)
        params.decoupled = s->decoupled ? CAIRN_PLACE_MAP_JOINTLY : CAIRN_PLACE_MAP_BY_ICP;
    if (strcmp(s->method, "sequential") == 0)
        params.mode = CAIRN_PLACE_MAP_SEQUENTIAL;
    if (strcmp(s->method, "shape") == 0) {
        params.mode = CAIRN_PLACE_MAP_SEQUENTIAL;
        params.match.mode = CAIRN_SCAN_MATCH_SHAPE;
    }
    return params;
}

/* Maps the places one after the other for comparison, and draws match-SEED.svg and errors-SEED.svg.
 * poses: those of place_map. */
static int draw_arena(const settings *s, const bench_match_problem *p, uint64_t seed,
                      sim_pose *poses)
{
    cairn_place_map_params params = params_of(s);
    bench_match_machine m = {NULL, 0, NULL, NULL};
    size_t n = (size_t)p->scan_count;
    sim_pose *others = malloc(2 * n * sizeof *others);
    outcome unused;
    int done = 0;

    memset(&unused, 0, sizeof unused);
    params.mode = CAIRN_PLACE_MAP_SEQUENTIAL;
    if (others != NULL && bench_match_machine_make(&params, &m) && bench_match_map(p, &m) &&
        score(p, &m, others + n, &unused)) {
        const sim_pose *const all[BENCH_PANELS] = {others, others + n, poses, p->truth};

        static const char *const titles[BENCH_PANELS] = {"odometry", "sequence", "cairn", "truth"};
        char path[512];

        for (size_t k = 0; k < n; k++)
            others[k] = p->scans[k].odometry;
        (void)snprintf(path, sizeof path, "%s/match-%" PRIu64 ".svg", s->pictures, seed);
        done = bench_draw_maps(path, "Places without odometry", titles, p->scans, p->scan_count,
                               all) &&
               bench_draw_errors(s->pictures, seed, p->scans, p->scan_count, poses);
    }
    free(others);
    free(m.memory);
    return done;
}

static int run_arena(const settings *s, uint64_t seed, outcome *out)
{
    cairn_place_map_params params = params_of(s);
    bench_match_problem p;
    bench_match_machine m = {NULL, 0, NULL, NULL};
    sim_pose *poses = NULL;
    int done = 0;

    memset(out, 0, sizeof *out);
    if (!bench_match_make(&s->world, seed, &p))
        return 0;
    if (bench_match_machine_make(&params, &m)) {
        double start = bench_seconds();

        poses = malloc((size_t)p.scan_count * sizeof *poses);
        done = poses != NULL && bench_match_map(&p, &m);
        out->seconds = bench_seconds() - start;
        out->pool_bytes = m.bytes;
        done = done && score(&p, &m, poses, out);
    }
    if (done && s->each) {
        bench_match_settings world = s->world;

        world.seed = (int64_t)seed;
        done = bench_match_print_decisions(&world, &p, &m, NULL);
    }
    if (done) {
        bench_json_begin("match");
        bench_json_integer("arena", (int64_t)seed);
        bench_json_text("method", s->method);
        bench_json_number("bad_beams", p.bad_share);
        bench_json_integer("places", out->places);
        bench_json_integer("right", out->right);
        bench_json_integer("silently_wrong", out->silently_wrong);
        bench_json_integer("parts", out->parts);
        bench_json_integer("ambiguous", out->ambiguous);
        bench_json_number("trans_m", out->median_m);
        bench_json_number("rot_deg", out->median_deg);
        bench_json_number("scan_trans_m", out->scan_median_m);
        bench_json_number("scan_rot_deg", out->scan_median_deg);
        bench_json_number("total", out->total);
        bench_json_number("rival", out->competing_total);
        bench_json_number("seconds", out->seconds);
        bench_json_end();
    }
    if (done && s->pictures != NULL)
        done = s->world.as_written ? bench_match_draw_written(&s->world, &p, seed, s->pictures)
                                   : draw_arena(s, &p, seed, poses);
    free(poses);
    free(m.memory);
    bench_match_free(&p);
    return done;
}

/* ---- Output ---- */

static void print_summary(const settings *s, const outcome *all, size_t count)
{
    double *values = malloc(5 * count * sizeof *values);
    int64_t ok = 0, right = 0, places = 0, ambiguous = 0, silently_wrong = 0;

    if (values == NULL)
        return;
    for (size_t i = 0; i < count; i++) {
        ok += all[i].ok;
        right += all[i].right;
        places += all[i].places;
        ambiguous += all[i].ambiguous;
        silently_wrong += all[i].silently_wrong;
        values[i] = all[i].median_m;
        values[count + i] = all[i].median_deg;
        values[2 * count + i] = all[i].seconds;
        values[3 * count + i] = all[i].scan_median_m;
        values[4 * count + i] = all[i].scan_median_deg;
    }
    bench_json_begin("match");
    bench_json_text("method", s->method);
    bench_json_text("scene", s->world.scene);
    bench_json_number("tilt", s->world.tilt);
    bench_json_number("movers", s->world.movers);
    bench_json_number("sub_error_m", s->world.sub_error[0]);
    bench_json_number("places_right_share", (double)right / (double)places);
    bench_json_integer("decoupled", params_of(s).decoupled);
    bench_json_integer("arenas", (int64_t)count);
    bench_json_integer("arenas_ok", ok);
    bench_json_integer("places", places);
    bench_json_integer("places_right", right);
    bench_json_integer("silently_wrong", silently_wrong);
    bench_json_integer("ambiguous", ambiguous);
    bench_json_number("median_trans_m", bench_median(values, count));
    bench_json_number("median_rot_deg", bench_median(values + count, count));
    bench_json_number("seconds_median", bench_median(values + 2 * count, count));
    bench_json_number("scan_median_trans_m", bench_median(values + 3 * count, count));
    bench_json_number("scan_median_rot_deg", bench_median(values + 4 * count, count));
    bench_json_integer("pool_bytes", (int64_t)all[0].pool_bytes);
    bench_json_true("summary");
    bench_json_end();
    free(values);
}

/* 1 when the settings can be run, or one line on standard error. */
static const bench_match_settings standard_world = {
    .scene = "rescue", .arenas = 20, .seed = 1, .places = 16, .heading_error = 2};

/* Whether something is given that --calibration chooses itself or has not. */
static int has_more_than_seeds(const settings *s)
{
    const bench_match_settings *w = &s->world;

    return strcmp(w->scene, standard_world.scene) != 0 || w->places != standard_world.places ||
           w->tilt != 0 || w->movers != 0 || w->walkers != 0 || w->unrelated != 0 ||
           w->sub_error[0] != 0 || w->sub_error[1] != 0 || w->same_headings || w->as_written ||
           s->method != NULL || s->pictures != NULL || s->decoupled || s->by_icp || s->ablate;
}

static int check(settings *s)
{
    if (sim_scene_find(s->world.scene) < 0) {
        fprintf(stderr, "bench/match: unknown scene '%s', expected one of cairn-arena's\n",
                s->world.scene);
        return 0;
    }
    if (s->calibration && has_more_than_seeds(s)) {
        fprintf(stderr, "bench/match: --calibration chooses scenes, places and people itself, "
                        "expected only --arenas and --seed beside it\n");
        return 0;
    }
    if (s->world.as_written && (s->method != NULL || s->decoupled || s->by_icp)) {
        fprintf(stderr,
                "bench/match: --as-written with %s, which it has not or always does: expected "
                "without\n",
                s->method != NULL ? "--method"
                : s->decoupled    ? "--decoupled"
                                  : "--decoupled-icp");
        return 0;
    }
    if (s->world.as_written || s->method == NULL)
        s->method = s->world.as_written ? "as_written" : "consensus";
    else if (strcmp(s->method, "consensus") != 0 && strcmp(s->method, "sequential") != 0 &&
             strcmp(s->method, "shape") != 0) {
        fprintf(stderr,
                "bench/match: unknown method '%s', expected consensus, sequential or shape\n",
                s->method);
        return 0;
    }
    if (s->world.unrelated >= s->world.places) {
        fprintf(stderr, "bench/match: --strangers is %d, expected fewer than the places\n",
                (int)s->world.unrelated);
        return 0;
    }
    return 1;
}

static int run(const settings *s)
{
    outcome *all = malloc((size_t)s->world.arenas * sizeof *all);
    int done = all != NULL;

    for (int64_t i = 0; i < s->world.arenas && done; i++)
        done = run_arena(s, (uint64_t)(s->world.seed + i), &all[i]);
    if (done)
        print_summary(s, all, (size_t)s->world.arenas);
    free(all);
    return done;
}

int main(int argc, char **argv)
{
    settings s = {.world = standard_world};
    const option table[] = {
        OPTION_FLAG("--as-written", &s.world.as_written,
                    "chapter 6 as printed: the heading known, each place with the last three, "
                    "decoupled ICP"),
        OPTION_FLAG("--same-headings", &s.world.same_headings,
                    "the scans of all places have the same headings, as always with --as-written"),
        OPTION_NUMBER("--heading-error", &s.world.heading_error, 0, 180, "DEG",
                      "headings of places are off, uniform +-, degrees (--as-written)"),
        OPTION_INTEGER("--arenas", &s.world.arenas, 1, 10000, "N", "arenas"),
        OPTION_INTEGER("--seed", &s.world.seed, 0, 9e15, "N",
                       "of the first arena; the others follow"),
        OPTION_TEXT("--method", &s.method, "NAME", "consensus, sequential or shape (consensus)"),
        OPTION_TEXT("--scene", &s.world.scene, "NAME", "scene of the arenas (rescue)"),
        OPTION_INTEGER("--places", &s.world.places, 2, 256, "N", "places with four scans each"),
        OPTION_NUMBER("--tilt", &s.world.tilt, 0, 0.3, "SHARE",
                      "of the beams that hit the floor short"),
        OPTION_NUMBER("--movers", &s.world.movers, 0, 0.5, "SHARE",
                      "of the beams of every scan that end on people"),
        OPTION_COUNT("--walkers", &s.world.walkers, 0, 100, "N", "people who walk about the arena"),
        OPTION_PAIR("--sub-error", s.world.sub_error, 0, 10, "M,DEG",
                    "scans within a place are off, uniform +-, m and degrees"),
        OPTION_TEXT("--pictures", &s.pictures, "DIR",
                    "draws match-SEED.svg and errors-SEED.svg into a folder; as written fig-6.6- "
                    "and fig-6.7-SEED.svg"),
        OPTION_FLAG("--decoupled", &s.decoupled,
                    "at the end every scan is aligned by itself, all at once"),
        OPTION_FLAG("--ablate", &s.ablate,
                    "the method of chapter 6 after each of its stages instead"),
        OPTION_COUNT("--strangers", &s.world.unrelated, 0, 255, "N",
                     "number of places of another arena"),
        OPTION_FLAG("--decoupled-icp", &s.by_icp, "the same one after the other by ICP"),
        OPTION_FLAG(
            "--calibration", &s.calibration,
            "arenas of several scenes, with people and with places of other arenas, "
            "instead: how often a place is wrong, by the probability that was stated of it"),
        OPTION_FLAG("--each", &s.each,
                    "also a line for every place of the largest component, as of --calibration"),
        OPTION_FLAG("--fit", &s.fit,
                    "reads lines of --calibration from standard input instead: constants of the "
                    "error probability fitted to even seeds, and how true it is of odd ones"),
        OPTION_FLAG("--table", &s.table, "with --fit: a table of that in Markdown"),
    };
    const option_set set = {"bench/match", "[options]", "Maps of places without odometry.", table,
                            sizeof table / sizeof *table};
    size_t words = 0;

    switch (options_read(&set, argc, argv, NULL, &words)) {
    case OPTIONS_HELPED:
        return 0;
    case OPTIONS_BAD:
        return 2;
    default:
        break;
    }
    if (!check(&s))
        return 2;
    if (s.fit) {
        bench_calibration_model model = bench_calibration_of_places();

        return bench_calibration_fit(&model, s.table);
    }
    if (s.calibration)
        return bench_match_calibrate(s.world.arenas, s.world.seed);
    if (s.ablate) {
        cairn_place_map_params params = params_of(&s);

        return bench_match_ablate(&s.world, &params) ? 0 : 1;
    }
    return run(&s) ? 0 : 1;
}
