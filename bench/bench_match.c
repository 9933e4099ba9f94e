/* bench/match: creation of the problems and of the mapper. */
#include "bench/bench_match.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/random.h"
#include "src/host/base/degrees.h"

static const double UNRELATED_DISTANCE_M = 1000; /* m, between an arena and an unrelated one */
static const uint64_t OTHER_ARENA_SEED = 1000000;

/* ---- Problems ---- */

static double share_of_bad_beams(const bench_match_problem *p)
{
    int64_t bad = 0, all = 0;

    for (int32_t k = 0; k < p->scan_count; k++)
        for (int32_t i = 0; i < p->scans[k].count; i++) {
            bad += p->scans[k].edge[i] == SIM_MOVER || p->scans[k].edge[i] == SIM_FLOOR;
            all++;
        }
    return all > 0 ? (double)bad / (double)all : 0;
}

void bench_match_free(bench_match_problem *p)
{
    for (int k = 0; k < 2; k++) {
        sim_survey_free(p->survey[k]);
        sim_arena_free(p->arena[k]);
    }
    free(p->scans);
    free(p->place_scan);
    free(p->truth);
    free(p->frame);
    free(p->first_scan);
}

/* Frames of the places by the truth: the pose of the first scan; as written with one heading, that
 * of the first scan of all, up to its error, which the first place does not have. */
static void place_frames(const bench_match_settings *s, uint64_t seed, bench_match_problem *p)
{
    cairn_random random = cairn_random_seed(seed, 93);

    for (int32_t k = 0; k < p->scan_count; k++) {
        int32_t place = p->scans[k].place;

        p->truth[k] = p->scans[k].truth;
        if (place < p->place_count)
            continue;
        p->first_scan[p->place_count] = k;
        p->frame[p->place_count] = p->truth[k];
        if (s->as_written && k > 0)
            p->frame[p->place_count].theta =
                p->truth[0].theta +
                (double)cairn_random_uniform(&random, -1, 1) * s->heading_error * CAIRN_DEGREE;
        p->place_count++;
    }
}

/* Computes the poses of scans in their places: ground truth plus the requested error. */
static void place_scans(const bench_match_settings *s, uint64_t seed, bench_match_problem *p)
{
    cairn_random random = cairn_random_seed(seed, 91);

    for (int32_t k = 0; k < p->scan_count; k++) {
        int32_t place = p->scans[k].place;
        sim_pose seen;

        seen = bench_pose_between(p->frame[place], p->truth[k]);
        if (k != p->first_scan[place]) {
            seen.x += (double)cairn_random_uniform(&random, -1, 1) * s->sub_error[0];
            seen.y += (double)cairn_random_uniform(&random, -1, 1) * s->sub_error[0];
            seen.theta +=
                (double)cairn_random_uniform(&random, -1, 1) * s->sub_error[1] * CAIRN_DEGREE;
        }
        p->place_scan[k].x = (cairn_real)seen.x;
        p->place_scan[k].y = (cairn_real)seen.y;
        p->place_scan[k].theta = (cairn_real)seen.theta;
    }
}

/* Surveys an arena; its places are appended, far from the earlier ones. */
static int add_survey(const bench_match_settings *s, uint64_t seed, int32_t index, int32_t places,
                      bench_match_problem *p)
{
    sim_arena_options arena_options = sim_arena_default();
    sim_survey_options survey_options = sim_survey_default();
    char fault[256] = "no memory";
    const sim_scan *scans;
    sim_scan *all = NULL;
    int32_t count = 0;

    arena_options.seed = survey_options.seed = seed;
    arena_options.scene = sim_scene_find(s->scene);
    survey_options.places = places;
    survey_options.headings = BENCH_MATCH_HEADINGS;
    survey_options.same_headings = s->same_headings || s->as_written;
    survey_options.tilt = s->tilt;
    survey_options.crowd = s->movers;
    survey_options.movers = s->walkers;
    p->arena[index] = sim_arena_create(&arena_options, fault, sizeof fault);
    if (p->arena[index] != NULL)
        p->survey[index] = sim_survey_create(p->arena[index], &survey_options, fault, sizeof fault);
    if (p->survey[index] != NULL) {
        scans = sim_survey_scans(p->survey[index], &count);
        all = realloc(p->scans, (size_t)(p->scan_count + count) * sizeof *all);
    }
    if (all == NULL) {
        fprintf(stderr, "bench/match: %s\n", fault);
        return 0;
    }
    p->scans = all;
    for (int32_t k = 0; k < count; k++) {
        sim_scan *scan = &p->scans[p->scan_count++];

        *scan = scans[k];
        scan->place += index > 0 ? (int32_t)s->places - places : 0;
        scan->truth.x += UNRELATED_DISTANCE_M * index;
    }
    return 1;
}

int bench_match_make(const bench_match_settings *s, uint64_t seed, bench_match_problem *p)
{
    int32_t unrelated = s->unrelated;
    int done;
    size_t n;

    memset(p, 0, sizeof *p);
    done = add_survey(s, seed, 0, (int32_t)s->places - unrelated, p) &&
           (unrelated == 0 || add_survey(s, seed + OTHER_ARENA_SEED, 1, unrelated, p));
    n = (size_t)p->scan_count;
    if (done) {
        p->bad_share = share_of_bad_beams(p);
        p->place_scan = malloc(n * sizeof *p->place_scan);
        p->truth = malloc(n * sizeof *p->truth);
        p->frame = malloc(n * sizeof *p->frame);
        p->first_scan = malloc(n * sizeof *p->first_scan);
        done =
            p->place_scan != NULL && p->truth != NULL && p->frame != NULL && p->first_scan != NULL;
    }
    if (done) {
        place_frames(s, seed, p);
        place_scans(s, seed, p);
    } else {
        bench_match_free(p);
    }
    return done;
}

/* ---- The method ---- */

int bench_match_machine_make(const cairn_place_map_params *params, bench_match_machine *m)
{
    cairn_scan_params scan = cairn_scan_default();
    cairn_pool pool;

    m->bytes = cairn_scan_memory(&scan) + cairn_place_map_memory(params) + CAIRN_ALIGN;
    m->memory = malloc(m->bytes);
    return m->memory != NULL && cairn_pool_init(&pool, m->memory, m->bytes) == CAIRN_OK &&
           cairn_scan_create(&m->scan, &pool, &scan) == CAIRN_OK &&
           cairn_place_map_create(&m->map, &pool, params) == CAIRN_OK;
}

cairn_scan_view bench_match_view(bench_match_machine *m, const sim_scan *scan, cairn_status *status)
{
    cairn_scan_input input = sim_scan_input(scan);
    cairn_budget budget = {CAIRN_UNBOUNDED};

    *status = cairn_scan_begin(m->scan, &input, NULL);
    while (*status == CAIRN_OK && cairn_scan_step(m->scan, &budget) == CAIRN_MORE)
        budget.left = CAIRN_UNBOUNDED;
    return cairn_scan_read(m->scan);
}

int bench_match_map(const bench_match_problem *p, bench_match_machine *m)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status = CAIRN_OK;

    for (int32_t k = 0; k < p->scan_count && status == CAIRN_OK; k++) {
        cairn_scan_view view = bench_match_view(m, &p->scans[k], &status);

        if (status == CAIRN_OK)
            status =
                cairn_place_map_add_scan(m->map, p->scans[k].place, &view, p->place_scan[k], NULL);
    }
    if (status == CAIRN_OK)
        status = cairn_place_map_begin(m->map);
    while (status == CAIRN_OK || status == CAIRN_MORE) {
        budget.left = CAIRN_UNBOUNDED;
        status = cairn_place_map_step(m->map, &budget);
        if (status == CAIRN_OK)
            return 1;
    }
    fprintf(stderr, "bench/match: %s\n", cairn_status_text(status));
    return 0;
}
