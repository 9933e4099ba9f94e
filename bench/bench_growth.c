#include "bench/bench_growth.h"

#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"

enum { SIZES = 2, TURNS = 3, RATIOS = 2 };

static bench_problem_kind four_times(const bench_problem_kind *kind)
{
    bench_problem_kind large = *kind;

    if (!(kind->size[0] > 0))
        sim_scene_size((sim_scene)sim_scene_find(kind->scene), &large.size[0], &large.size[1]);
    large.size[0] *= 2;
    large.size[1] *= 2;
    large.places *= 4;
    return large;
}

/* Aligns a problem from its start; keeps the least seconds. */
static int run(const bench_problem *p, bench_run *least)
{
    size_t bytes = (size_t)p->count * sizeof *p->poses;
    bench_pose *poses = malloc(bytes);
    bench_run one = {0, 0, 0, 0, 0, 0, 0};
    int done = poses != NULL;

    if (done) {
        memcpy(poses, p->poses, bytes);
        done = bench_run_default(p->scans, p->count, BENCH_ALL, poses, &one);
    }
    free(poses);
    if (least->units == 0 || one.seconds < least->seconds)
        *least = one;
    return done;
}

static void print(const bench_problem *problems, const bench_run *runs, double ratios[RATIOS])
{
    ratios[0] = runs[1].seconds / runs[0].seconds;
    ratios[1] = (double)runs[1].units / (double)runs[0].units;
    bench_json_integer("scans", problems[0].count);
    bench_json_integer("scans_large", problems[1].count);
    bench_json_number("seconds", runs[0].seconds);
    bench_json_number("seconds_large", runs[1].seconds);
    bench_json_number("ratio_seconds", ratios[0]);
    bench_json_integer("units", runs[0].units);
    bench_json_integer("units_large", runs[1].units);
    bench_json_number("ratio_units", ratios[1]);
    bench_json_integer("worst_step", runs[1].worst_step);
}

static int run_arena(const bench_problem_kind kinds[SIZES], int64_t seed, double ratios[RATIOS])
{
    bench_problem problems[SIZES];
    bench_run runs[SIZES];
    int done = 1;

    memset(problems, 0, sizeof problems);
    memset(runs, 0, sizeof runs);
    for (int k = 0; k < SIZES && done; k++)
        done = bench_problem_open(&problems[k], &kinds[k], (uint64_t)seed);
    for (int k = 0; k < SIZES * TURNS && done; k++)
        done = run(&problems[k % SIZES], &runs[k % SIZES]);
    if (done) {
        bench_json_begin("align");
        bench_json_integer("arena", seed);
        print(problems, runs, ratios);
        bench_json_end();
    }
    for (int k = 0; k < SIZES; k++)
        bench_problem_close(&problems[k]);
    return done;
}

int bench_growth(const bench_problem_kind *kind, int64_t arenas, int64_t seed)
{
    bench_problem_kind kinds[SIZES] = {*kind, four_times(kind)};
    size_t n = (size_t)arenas;
    double *values = malloc(RATIOS * n * sizeof *values);
    int done = values != NULL;

    for (size_t i = 0; i < n && done; i++) {
        double ratios[RATIOS] = {0, 0};

        done = run_arena(kinds, seed + (int64_t)i, ratios);
        for (size_t k = 0; k < RATIOS; k++)
            values[k * n + i] = ratios[k];
    }
    if (done) {
        bench_json_begin("align");
        bench_json_integer("arenas", arenas);
        bench_json_number("ratio_seconds", bench_median(values, n));
        bench_json_number("ratio_units", bench_median(values + n, n));
        bench_json_true("summary");
        bench_json_end();
    }
    free(values);
    return done;
}
