#include "bench/bench_closures.h"

#include <math.h>
#include <string.h>

#include "bench/bench_json.h"
#include "cairn/random.h"

enum { SCENES = 8, KINDS = 3, PEOPLE = 5 };
static const char *const scene_names[SCENES] = {"twins",     "mirror", "maze",   "office",
                                                "apartment", "rooms",  "rescue", "hospital"};

bench_closures_drive bench_closures_drive_of(int64_t seed)
{
    cairn_random random = cairn_random_seed((uint64_t)seed, 77);
    bench_closures_drive drive = {.seed = seed};
    int32_t kind;

    drive.scene = scene_names[cairn_random_below(&random, SCENES)];
    kind = cairn_random_below(&random, KINDS);
    drive.movers = kind == 1 ? PEOPLE : 0;
    drive.no_odometry = kind == 2;
    return drive;
}

void bench_closures_print(const bench_closures_drive *drive, const cairn_mapper_loop *loop,
                          int32_t wrong)
{
    bench_json_begin("scenes");
    bench_json_integer("decision", drive->seed);
    bench_json_text("scene", drive->scene);
    bench_json_integer("movers", drive->movers);
    bench_json_text("odometry", drive->no_odometry ? "none" : "log");
    bench_json_integer("first", loop->first);
    bench_json_integer("second", loop->second);
    bench_json_integer("wrong", wrong);
    bench_json_number("wrong_probability", (double)loop->error_probability);
    bench_json_number("path_sigma", (double)loop->evidence.path_sigma);
    bench_json_number("prior_distance", (double)loop->evidence.prior_distance);
    bench_json_number("competing_score", (double)loop->evidence.competing_score);
    bench_json_number("free_space_violation", (double)loop->evidence.free_space_violation);
    bench_json_end();
}

/* ---- Fit ---- */

/* Log odds at 0, and of each unit of the evidence, within the bounds that it is used in. */
enum { LOG_ODDS, OF_SIGMA, OF_DISTANCE, OF_COMPETING, OF_VIOLATION, CONSTANTS };

static const double LEAST_SIGMA_M = 0.01, MOST_SIGMA_M = 2, MOST_DISTANCE_NATS = 12;

static double stated_of_closure(const bench_evidence *e)
{
    cairn_mapper_loop_evidence evidence = {(cairn_real)e->path_sigma, (cairn_real)e->prior_distance,
                                           (cairn_real)e->competing_score,
                                           (cairn_real)e->free_space_violation};

    return (double)cairn_mapper_loop_error_probability(&evidence);
}

static double probability_of_closure(const bench_evidence *e, const double *c)
{
    double sigma = fmin(fmax(e->path_sigma, LEAST_SIGMA_M), MOST_SIGMA_M);
    double log_odds = c[LOG_ODDS] + c[OF_SIGMA] * log(sigma) +
                      c[OF_DISTANCE] * fmin(e->prior_distance, MOST_DISTANCE_NATS) +
                      c[OF_COMPETING] * e->competing_score +
                      c[OF_VIOLATION] * e->free_space_violation;

    return fmin(fmax(1 / (1 + exp(-log_odds)), BENCH_LEAST_PROBABILITY),
                1 - BENCH_LEAST_PROBABILITY);
}

static void fit_closures(const bench_calibration_model *model, const bench_decisions *all,
                         double *constants)
{
    static const double start[CONSTANTS] = {-4, 0, 0, 0, 0};

    memcpy(constants, start, sizeof start);
    bench_calibration_search(model, all, constants);
}

bench_calibration_model bench_calibration_of_closures(void)
{
    bench_calibration_model model = {
        .bench = "scenes",
        .constants = CONSTANTS,
        .names = {"log_odds", "of_sigma", "of_distance", "of_competing", "of_violation"},
        .stated = stated_of_closure,
        .probability = probability_of_closure,
        .fit = fit_closures};

    return model;
}
