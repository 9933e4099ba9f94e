#include "bench/bench_problem.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/random.h"
#include "src/host/base/degrees.h"

bench_problem_kind bench_problem_kind_default(void)
{
    bench_problem_kind kind = {"rescue", 15, 4, 401, 100, 0.30, 20, {(double)NAN, (double)NAN},
                               {0, 0}};

    return kind;
}

void bench_problem_close(bench_problem *p)
{
    free(p->scans);
    free(p->truth);
    free(p->start);
    free(p->poses);
    sim_survey_free(p->survey);
    sim_arena_free(p->arena);
}

static void shuffle(sim_scan *scans, int32_t count, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 77);

    for (int32_t i = count - 1; i > 0; i--) {
        int32_t j = cairn_random_below(&random, i + 1);
        sim_scan swap = scans[i];

        scans[i] = scans[j];
        scans[j] = swap;
    }
}

static int visit(const bench_problem_kind *kind, uint64_t seed, bench_problem *p)
{
    sim_arena_options arena_options = sim_arena_default();
    sim_survey_options survey_options = sim_survey_default();
    char fault[256];

    arena_options.seed = seed;
    arena_options.scene = sim_scene_find(kind->scene);
    arena_options.width = kind->size[0];
    arena_options.height = kind->size[1];
    survey_options.seed = seed;
    survey_options.places = (int32_t)kind->places;
    survey_options.headings = (int32_t)kind->headings;
    survey_options.beams = (int32_t)kind->beams;
    survey_options.fov = kind->fov * CAIRN_DEGREE;
    if (kind->jitter[0] >= 0) {
        survey_options.jitter_position = kind->jitter[0];
        survey_options.jitter_heading = kind->jitter[1] * CAIRN_DEGREE;
    }
    p->arena = sim_arena_create(&arena_options, fault, sizeof fault);
    if (p->arena != NULL)
        p->survey = sim_survey_create(p->arena, &survey_options, fault, sizeof fault);
    if (p->survey == NULL)
        fprintf(stderr, "bench: %s\n", fault);
    return p->survey != NULL;
}

int bench_problem_open(bench_problem *p, const bench_problem_kind *kind, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 78);
    const sim_scan *all;
    size_t n;

    memset(p, 0, sizeof *p);
    if (!visit(kind, seed, p))
        return 0;
    all = sim_survey_scans(p->survey, &p->count);
    n = (size_t)p->count;
    p->scans = malloc(n * sizeof *p->scans);
    p->truth = malloc(n * sizeof *p->truth);
    p->start = malloc(n * sizeof *p->start);
    p->poses = calloc(n, sizeof *p->poses);
    if (p->scans == NULL || p->truth == NULL || p->start == NULL || p->poses == NULL) {
        fprintf(stderr, "bench: no memory for %" PRId32 " scans\n", p->count);
        return 0;
    }
    memcpy(p->scans, all, n * sizeof *p->scans);
    shuffle(p->scans, p->count, seed);
    for (size_t i = 0; i < n; i++) {
        p->truth[i] = p->scans[i].truth;
        p->start[i] = p->truth[i];
        p->start[i].x += (double)cairn_random_uniform(&random, -1, 1) * kind->metres;
        p->start[i].y += (double)cairn_random_uniform(&random, -1, 1) * kind->metres;
        p->start[i].theta +=
            (double)cairn_random_uniform(&random, -1, 1) * kind->degrees * CAIRN_DEGREE;
        p->poses[i].pose = p->start[i];
    }
    return 1;
}
