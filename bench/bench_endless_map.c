/* Runs the mapper forward and back along a tour of an arena. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_endless.h"
#include "bench/bench_json.h"
#include "bench/bench_score.h"
#include "cairn/mapper.h"
#include "cairn/random.h"
#include "src/host/base/degrees.h"

enum { BEAMS = 181 };

typedef struct driver {
    const bench_endless_options *options;
    sim_arena *arena;
    sim_survey *survey;
    const sim_scan *scans; /* of the forward direction, without noise */
    int32_t count;
    cairn_random random;
    cairn_mapper *mapper;
    cairn_pool pool;
    void *memory;
    sim_pose truth, odometry; /* of the last scan */
    float range[BEAMS];
    sim_point *first_errors; /* [places]: of the first lap in full memory */
    int32_t is_full;
} driver;

static int start(driver *d)
{
    sim_arena_options arena = sim_arena_default();
    sim_survey_options survey = sim_survey_default();
    char fault[256] = "no memory";

    arena.seed = survey.seed = d->options->seed;
    arena.scene = d->options->scene;
    survey.drive = d->options->places / 2;
    survey.drive_distance = survey.drive_turn = 0.3;
    survey.fov = 180 * CAIRN_DEGREE;
    survey.beams = BEAMS;
    survey.noise = 0;
    d->arena = sim_arena_create(&arena, fault, sizeof fault);
    if (d->arena != NULL)
        d->survey = sim_survey_create(d->arena, &survey, fault, sizeof fault);
    if (d->survey == NULL) {
        fprintf(stderr, "bench/endless: %s\n", fault);
        return 0;
    }
    d->scans = sim_survey_scans(d->survey, &d->count);
    return 1;
}

static cairn_status create(driver *d)
{
    cairn_mapper_params params = cairn_mapper_default_for(d->options->kept, BEAMS);
    size_t bytes;

    params.cull_keyframes = 1;
    bytes = cairn_mapper_memory(&params) + CAIRN_ALIGN;
    d->memory = malloc(bytes);
    d->first_errors = calloc((size_t)d->options->places, sizeof *d->first_errors);
    if (d->memory == NULL || d->first_errors == NULL)
        return CAIRN_NO_MEMORY;
    if (cairn_pool_init(&d->pool, d->memory, bytes) != CAIRN_OK)
        return CAIRN_NO_MEMORY;
    return cairn_mapper_create(&d->mapper, &d->pool, &params);
}

static double off(driver *d, double most)
{
    return most * (double)cairn_random_uniform(&d->random, -1, 1);
}

/* The odometry follows the robot with a small error; a scan from the previous place adds
 * nothing. */
static void move(driver *d, const sim_scan *scan)
{
    sim_pose moved = bench_pose_between(d->truth, scan->truth);
    double way = hypot(moved.x, moved.y) / 0.3, turn = fabs(moved.theta) / 0.3;

    moved.x += off(d, d->options->metres * way);
    moved.y += off(d, d->options->metres * way);
    moved.theta += off(d, d->options->degrees * CAIRN_DEGREE * (way + turn));
    d->odometry = bench_pose_compose(d->odometry, moved);
    d->truth = scan->truth;
}

static void score(driver *d, const sim_scan *scan, int32_t place, bench_endless_lap *lap)
{
    cairn_pose pose = cairn_mapper_read(d->mapper).map_scan;
    sim_point error = {(double)pose.x - scan->truth.x, (double)pose.y - scan->truth.y};
    double metres = hypot(error.x, error.y);
    double turn =
        fabs(remainder((double)pose.theta - scan->truth.theta, 360 * CAIRN_DEGREE)) / CAIRN_DEGREE;

    lap->mean += metres / d->options->places;
    lap->most = fmax(lap->most, metres);
    lap->most_degrees = fmax(lap->most_degrees, turn);
    if (lap->is_first)
        d->first_errors[place] = error;
    if (d->is_full)
        lap->away = fmax(lap->away, hypot(error.x - d->first_errors[place].x,
                                          error.y - d->first_errors[place].y));
}

static cairn_status take_in(driver *d, int64_t number, int32_t place, bench_endless_lap *lap)
{
    const sim_scan *scan = &d->scans[place < d->count ? place : d->options->places - 1 - place];
    cairn_scan_input input = sim_scan_input(scan);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_pose odometry;
    cairn_status status;

    if (number == 0)
        d->truth = d->odometry = scan->truth;
    move(d, scan);
    for (int32_t i = 0; i < scan->count; i++)
        d->range[i] =
            scan->range[i] + (float)(d->options->noise * (double)cairn_random_normal(&d->random));
    input.range = d->range;
    input.range_sigma = (float)d->options->noise;
    odometry.x = (cairn_real)d->odometry.x;
    odometry.y = (cairn_real)d->odometry.y;
    odometry.theta = (cairn_real)d->odometry.theta;
    status = cairn_mapper_add(d->mapper, &input, &odometry, NULL);
    if (status == CAIRN_MORE)
        status = cairn_mapper_step(d->mapper, &budget);
    if (status != CAIRN_OK)
        return status;
    lap->units += CAIRN_UNBOUNDED - budget.left;
    if (CAIRN_UNBOUNDED - budget.left > lap->worst)
        lap->worst = CAIRN_UNBOUNDED - budget.left;
    lap->scans++;
    score(d, scan, place, lap);
    return CAIRN_OK;
}

static cairn_status run(driver *d, void (*report)(void *context, const bench_endless_lap *lap),
                        void *context)
{
    int64_t laps = d->options->scans / d->options->places;
    cairn_status status = CAIRN_OK;

    for (int64_t number = 0; number < laps && status == CAIRN_OK; number++) {
        bench_endless_lap lap;
        double begin = bench_seconds();
        int32_t releases = cairn_mapper_measure(d->mapper).culled_keyframes;

        memset(&lap, 0, sizeof lap);
        lap.lap = number;
        lap.is_first = !d->is_full && releases > 0;
        d->is_full = releases > 0;
        for (int32_t place = 0; place < d->options->places && status == CAIRN_OK; place++)
            status = take_in(d, number * d->options->places + place, place, &lap);
        lap.kept = cairn_mapper_measure(d->mapper).keyframes;
        lap.released = cairn_mapper_measure(d->mapper).culled_keyframes - releases;
        lap.loops = cairn_mapper_measure(d->mapper).loops;
        lap.links = cairn_mapper_link_count(d->mapper);
        lap.pool_used = d->pool.used;
        lap.seconds = bench_seconds() - begin;
        if (status == CAIRN_OK)
            report(context, &lap);
    }
    return status;
}

int bench_endless_map(const bench_endless_options *options,
                      void (*report)(void *context, const bench_endless_lap *lap), void *context)
{
    driver *d = calloc(1, sizeof *d);
    cairn_status status = CAIRN_NO_MEMORY;
    int done = 0;

    if (d == NULL)
        return 0;
    d->options = options;
    d->random = cairn_random_seed(options->seed, 6);
    if (start(d)) {
        status = create(d);
        if (status == CAIRN_OK)
            status = run(d, report, context);
        done = status == CAIRN_OK;
        if (!done)
            fprintf(stderr, "bench/endless: %s\n", cairn_status_text(status));
    }
    sim_survey_free(d->survey);
    sim_arena_free(d->arena);
    free(d->memory);
    free(d->first_errors);
    free(d);
    return done;
}
