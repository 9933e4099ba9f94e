#include "bench/bench_growth.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"

enum { SMALL, PART, LARGE, SIZES, TURNS = 3, RATIOS = 4 };

static const char *const names[SIZES] = {"small", "part", "large"};

/* Scans to be aligned from initial poses, some of a problem. */
typedef struct selection {
    sim_scan *scans;
    bench_pose *poses, *work;
    int32_t count;
} selection;

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

/* The scan that is farthest from the middle. */
static int32_t outermost(const bench_problem *p)
{
    double x = 0, y = 0, most = -1;
    int32_t best = 0;

    for (int32_t i = 0; i < p->count; i++) {
        x += p->truth[i].x / p->count;
        y += p->truth[i].y / p->count;
    }
    for (int32_t i = 0; i < p->count; i++) {
        double far = hypot(p->truth[i].x - x, p->truth[i].y - y);

        if (far > most) {
            most = far;
            best = i;
        }
    }
    return best;
}

/* How many scans are nearer to scan `from` than scan i; of equally near ones those before it. */
static int32_t rank_of(const bench_problem *p, int32_t from, int32_t i)
{
    double own = hypot(p->truth[i].x - p->truth[from].x, p->truth[i].y - p->truth[from].y);
    int32_t rank = 0;

    for (int32_t k = 0; k < p->count; k++) {
        double far = hypot(p->truth[k].x - p->truth[from].x, p->truth[k].y - p->truth[from].y);

        rank += far < own || (far <= own && k < i);
    }
    return rank;
}

/* The `count` scans of a problem about the outermost; all of them when there are no more. */
static int select_scans(const bench_problem *p, int32_t count, selection *s)
{
    int32_t from = outermost(p);

    s->scans = malloc((size_t)count * sizeof *s->scans);
    s->poses = malloc((size_t)count * sizeof *s->poses);
    s->work = malloc((size_t)count * sizeof *s->work);
    if (s->scans == NULL || s->poses == NULL || s->work == NULL) {
        fprintf(stderr, "bench/align: no memory for %d scans\n", (int)count);
        return 0;
    }
    for (int32_t i = 0; i < p->count; i++)
        if (rank_of(p, from, i) < count) {
            s->scans[s->count] = p->scans[i];
            s->poses[s->count++] = p->poses[i];
        }
    return 1;
}

static void close_selection(selection *s)
{
    free(s->scans);
    free(s->poses);
    free(s->work);
}

/* Aligns from the start; keeps the least seconds. */
static int run(const selection *s, bench_run *least)
{
    bench_run one = {0};
    int done;

    memcpy(s->work, s->poses, (size_t)s->count * sizeof *s->work);
    done = bench_run_default(s->scans, s->count, BENCH_ALL, s->work, &one);
    if (least->units == 0 || one.seconds < least->seconds)
        *least = one;
    return done;
}

/* Ratios of the large arena to the small one and to the part: seconds, then units. */
static void find_ratios(const bench_run runs[SIZES], double ratios[RATIOS])
{
    for (int k = 0; k < LARGE; k++) {
        ratios[k] = runs[LARGE].seconds / runs[k].seconds;
        ratios[2 + k] = (double)runs[LARGE].units / (double)runs[k].units;
    }
}

static void print_ratios(const double ratios[RATIOS])
{
    bench_json_number("seconds_over_small", ratios[SMALL]);
    bench_json_number("seconds_over_part", ratios[PART]);
    bench_json_number("units_over_small", ratios[2 + SMALL]);
    bench_json_number("units_over_part", ratios[2 + PART]);
}

static void print_run(const char *name, int32_t scans, const bench_run *r)
{
    bench_json_begin("align");
    bench_json_text("size", name);
    bench_json_integer("scans", scans);
    bench_json_number("seconds", r->seconds);
    bench_json_integer("units", r->units);
    bench_json_integer("worst_step", r->worst_step);
    bench_json_end();
}

static int run_arena(const bench_problem_kind kinds[2], int64_t seed, double ratios[RATIOS])
{
    bench_problem small, large;
    selection sizes[SIZES];
    bench_run runs[SIZES];
    int done;

    memset(&large, 0, sizeof large);
    memset(sizes, 0, sizeof sizes);
    memset(runs, 0, sizeof runs);
    done = bench_problem_open(&small, &kinds[0], (uint64_t)seed) &&
           bench_problem_open(&large, &kinds[1], (uint64_t)seed) &&
           select_scans(&small, small.count, &sizes[SMALL]) &&
           select_scans(&large, small.count, &sizes[PART]) &&
           select_scans(&large, large.count, &sizes[LARGE]);
    for (int k = 0; k < SIZES * TURNS && done; k++)
        done = run(&sizes[k % SIZES], &runs[k % SIZES]);
    for (int k = 0; k < SIZES && done; k++)
        print_run(names[k], sizes[k].count, &runs[k]);
    if (done) {
        find_ratios(runs, ratios);
        bench_json_begin("align");
        bench_json_integer("arena", seed);
        print_ratios(ratios);
        bench_json_end();
    }
    for (int k = 0; k < SIZES; k++)
        close_selection(&sizes[k]);
    bench_problem_close(&small);
    bench_problem_close(&large);
    return done;
}

int bench_growth(const bench_problem_kind *kind, int64_t arenas, int64_t seed)
{
    bench_problem_kind kinds[2] = {*kind, four_times(kind)};
    size_t n = (size_t)arenas;
    double *values = malloc(RATIOS * n * sizeof *values), ratios[RATIOS];
    int done = values != NULL;

    for (size_t i = 0; i < n && done; i++) {
        done = run_arena(kinds, seed + (int64_t)i, ratios);
        for (size_t k = 0; k < RATIOS && done; k++)
            values[k * n + i] = ratios[k];
    }
    if (done) {
        for (size_t k = 0; k < RATIOS; k++)
            ratios[k] = bench_median(values + k * n, n);
        bench_json_begin("align");
        bench_json_integer("arenas", arenas);
        print_ratios(ratios);
        bench_json_true("summary");
        bench_json_end();
    }
    free(values);
    return done;
}
