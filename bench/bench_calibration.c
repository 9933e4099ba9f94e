#include "bench/bench_calibration.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "bench/bench_parts.h"
#include "bench/bench_random.h"
#include "bench/bench_reliability.h"
#include "bench/bench_score.h"
#include "src/host/base/degrees.h"

/* Scenes, the smallest tiles of their arenas without the overlap in m, and their shares in tenths.
 * The four rooms of "rooms" look alike: most of its maps fit at wrong places. */
enum { SCENES = 6, SHARES = 10 };
static const char *const scene_names[SCENES] = {"rescue", "maze",  "apartment",
                                                "office", "round", "rooms"};
static const double scene_tiles[SCENES] = {3, 3, 7, 12, 3, 5};
static const int32_t scene_of_share[SHARES] = {0, 0, 1, 1, 2, 2, 3, 4, 4, 5};

/* The scene whose arenas all have the same floor plan, so that none is unrelated. */
static const char ONE_PLAN[] = "rooms";

/* Distance from the truth beyond which a map lies at another place, with the errors of distorted
 * maps. */
static const double PLACE_M = 0.75, PLACE_RAD = 8 * CAIRN_DEGREE;

/* Greatest distortion of maps, m, and relative to the size of a cell. */
static const double MOST_BEND_M = 0.2, MOST_STRETCH = 0.02;

/* One pair of maps. */
typedef struct trial {
    bench_parts_options options;
    int32_t is_unrelated; /* the second map is of another arena */
} trial;

static trial trial_of(int64_t seed)
{
    /* percent of the smaller map's known cells */
    static const double overlaps[] = {5, 10, 15, 25, 40};
    cairn_random random = cairn_random_seed((uint64_t)seed, 77);
    int32_t scene;
    trial t;

    memset(&t, 0, sizeof t);
    scene = scene_of_share[cairn_random_below(&random, SHARES)];
    t.options.seed = (uint64_t)seed;
    t.options.scene = scene_names[scene];
    t.options.robots = 2;
    t.options.overlap =
        overlaps[cairn_random_below(&random, (int32_t)(sizeof overlaps / sizeof *overlaps))] / 100;
    t.options.tile = bench_uniform(&random, 6, 10);
    t.options.places = 4 + cairn_random_below(&random, 6);
    t.options.resolution = 0.05;
    if (cairn_random_below(&random, 2) == 0)
        t.options.bend = bench_uniform(&random, 0, MOST_BEND_M);
    if (cairn_random_below(&random, 3) == 0)
        t.options.stretch = MOST_STRETCH;
    t.is_unrelated = cairn_random_below(&random, 4) == 0 && strcmp(t.options.scene, ONE_PLAN) != 0;
    t.options.tile = fmax(t.options.tile, scene_tiles[scene] / (1 - t.options.overlap));
    return t;
}

static int merge_pair(const cairn_map_merge_params *base, const bench_parts *parts,
                      cairn_map_merge_placed *placed, cairn_map_merge_pair_score *score)
{
    cairn_map_merge_params params = *base;
    cairn_map_merge *merge = NULL;
    cairn_pool pool;
    void *memory;
    size_t bytes;
    int ok;

    params.max_maps = 2;
    params.max_cells = params.max_map_cells = 0;
    for (int i = 0; i < 2; i++) {
        int32_t cells = parts->list[i].side * parts->list[i].side;

        params.max_cells += cells;
        params.max_map_cells = cells > params.max_map_cells ? cells : params.max_map_cells;
    }
    bytes = cairn_map_merge_memory(&params) + CAIRN_ALIGN;
    memory = malloc(bytes);
    ok = memory != NULL && cairn_pool_init(&pool, memory, bytes) == CAIRN_OK &&
         cairn_map_merge_create(&merge, &pool, &params) == CAIRN_OK &&
         bench_parts_merge(merge, parts, NULL, NULL);
    if (ok) {
        *placed = cairn_map_merge_of(merge, 1);
        ok = cairn_map_merge_score(merge, 0, 1, placed->reference_map, score) == CAIRN_OK;
    }
    free(memory);
    return ok;
}

/* 1 when the merging has found a pose of the map, placed or rejected. */
static int has_pose(const cairn_map_merge_placed *placed)
{
    return placed->verdict != CAIRN_MAP_MERGE_EMPTY &&
           placed->verdict != CAIRN_MAP_MERGE_NO_OVERLAP;
}

/* 1 when the second map is at the wrong place. */
static int is_wrong(const trial *t, const bench_parts *parts, const cairn_map_merge_placed *placed)
{
    sim_pose truth = bench_pose_between(parts->list[0].world_map, parts->list[1].world_map);

    return t->is_unrelated ||
           !bench_pose_near(truth, bench_sim_pose(placed->reference_map), PLACE_M, PLACE_RAD);
}

static void print_decision(const trial *t, const cairn_map_merge_placed *placed,
                           const cairn_map_merge_pair_score *score, int wrong)
{
    bench_json_begin("merge");
    bench_json_integer("decision", (int64_t)t->options.seed);
    bench_json_text("scene", t->options.scene);
    bench_json_number("overlap", t->options.overlap);
    bench_json_number("bend", t->options.bend);
    bench_json_number("stretch", t->options.stretch);
    bench_json_integer("unrelated", t->is_unrelated);
    bench_json_integer("verdict", placed->verdict);
    bench_json_integer("wrong", wrong);
    bench_json_number("wrong_probability", (double)placed->error_probability);
    bench_json_number("support", (double)placed->support);
    bench_json_number("competing", (double)placed->competing_support);
    bench_json_number("agree", (double)score->agreeing_wall);
    bench_json_number("conflict", (double)score->free_space_violation);
    bench_json_number("shared", (double)score->overlap);
    bench_json_end();
}

/* Adds the decision on one pair; 0 on failure. */
static int run_trial(const cairn_map_merge_params *base, int64_t seed, bench_reliability *odd)
{
    trial t = trial_of(seed);
    cairn_map_merge_pair_score score;
    cairn_map_merge_placed placed;
    bench_parts parts, others;
    int ok = bench_parts_make(&t.options, &parts);

    memset(&others, 0, sizeof others);
    if (ok && t.is_unrelated) {
        bench_part part;

        t.options.seed += UINT64_C(1) << 32;
        ok = bench_parts_make(&t.options, &others);
        t.options.seed = (uint64_t)seed;
        if (ok) {
            part = parts.list[1];
            parts.list[1] = others.list[1];
            others.list[1] = part;
        }
    }
    ok = ok && merge_pair(base, &parts, &placed, &score);
    if (ok && has_pose(&placed)) {
        int wrong = is_wrong(&t, &parts, &placed);

        print_decision(&t, &placed, &score, wrong);
        if (seed % 2 != 0)
            bench_reliability_add(odd, (double)placed.error_probability, wrong);
    }
    bench_parts_free(&parts);
    bench_parts_free(&others);
    return ok;
}

int bench_calibration_run(const cairn_map_merge_params *base, int64_t seeds, int64_t seed)
{
    bench_reliability odd;

    memset(&odd, 0, sizeof odd);
    for (int64_t i = 0; i < seeds; i++)
        if (!run_trial(base, seed + i, &odd))
            return 1;
    bench_reliability_print("merge", "odd seeds", &odd);
    return 0;
}

/* ---- Fit ---- */

/* A logistic model with one feature: log odds = offset + exponent log ((chance + competing) / (chance
 * + support)). Chance and exponent are tried on a grid, with the best offset of each by Newton's
 * method. Of those in the 95 % confidence region of the fit the one is taken by which most decisions
 * are sure. */
enum { CHANCE, EXPONENT, OFFSET, CONSTANTS };

/* nats: values of `chance` that are tried; exponents from the least by steps */
static const double CHANCES[] = {0.5, 1, 1.5, 2, 2.5, 3, 4, 5, 7, 10};
static const double LEAST_EXPONENT = 2, EXPONENT_STEP = 0.1;
enum { EXPONENTS = 60, NEWTON_STEPS = 30 };

/* nats: half of the 95 % quantile of chi squared with one degree of freedom, of the profile */
static const double REGION_NATS = 1.92;

static double stated_of_map(const bench_evidence *e)
{
    return (double)cairn_map_merge_error_probability((cairn_real)e->support,
                                                     (cairn_real)e->competing);
}

static double probability_of_map(const bench_evidence *e, const double *constants)
{
    double chance = constants[CHANCE];
    double feature = log((chance + e->competing) / (chance + e->support));

    return 1 / (1 + exp(-constants[OFFSET] - constants[EXPONENT] * feature));
}

/* The offset of the least loss of even seeds. */
static void fit_offset(const bench_decisions *all, double *constants)
{
    constants[OFFSET] = 0;
    for (int step = 0; step < NEWTON_STEPS; step++) {
        double slope = 0, bend = 1e-9;

        for (size_t i = 0; i < all->count; i++)
            if (all->list[i].seed % 2 == 0) {
                double p = probability_of_map(&all->list[i].evidence, constants);

                slope += p - all->list[i].wrong;
                bend += p * (1 - p);
            }
        constants[OFFSET] -= fmin(fmax(slope / bend, -1), 1);
    }
}

static void fit_maps(const bench_calibration_model *model, const bench_decisions *all,
                     double *constants)
{
    const size_t chances = sizeof CHANCES / sizeof *CHANCES;
    double least = HUGE_VAL;
    int64_t most = -1;

    for (int pass = 0; pass < 2; pass++)
        for (size_t i = 0; i < chances; i++)
            for (int k = 0; k < EXPONENTS; k++) {
                double tried[BENCH_CONSTANTS] = {CHANCES[i], LEAST_EXPONENT + k * EXPONENT_STEP};
                int64_t sure;
                double loss;

                fit_offset(all, tried);
                loss = bench_calibration_loss(model, all, tried, &sure);
                if (pass == 0) {
                    least = fmin(least, loss);
                } else if (loss <= least + REGION_NATS && sure > most) {
                    most = sure;
                    memcpy(constants, tried, sizeof tried);
                }
            }
}

bench_calibration_model bench_calibration_of_maps(void)
{
    bench_calibration_model model = {.bench = "merge",
                                     .constants = CONSTANTS,
                                     .names = {"chance_nats", "exponent", "log_odds"},
                                     .stated = stated_of_map,
                                     .probability = probability_of_map,
                                     .fit = fit_maps};

    return model;
}
