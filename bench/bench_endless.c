/* A robot that drives endless laps in bounded memory. */
#include "bench/bench_endless.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "bench/bench_score.h"
#include "cairn/random.h"
#include "cairn/scan_redundancy.h"
#include "firmware/joint.h"
#include "src/host/base/degrees.h"

enum { BEAMS = 181, TICK = 1000 };

typedef struct robot {
    const bench_endless_options *options;
    sim_arena *arena;
    sim_survey *survey;
    const sim_scan *scans; /* without noise: every pose at each place */
    float range[BEAMS];
    cairn_random random;
    cairn_scan *scan;
    cairn_scan_set *set;
    joint joint;
    cairn_scan_redundancy *cover;
    cairn_pool pool;
    void *memory;
    cairn_pose *poses;       /* [kept + 1] by slot */
    uint8_t *held;           /* [kept + 1] by slot: the pose of the scan is final */
    int64_t *came;           /* [kept + 1]: number of the scan in a slot */
    sim_point *first_errors; /* [places]: of the first lap in full memory */
    sim_pose truth, found;   /* of the last scan */
    int32_t present, is_full;
    int64_t units; /* of the current scan */
} robot;

bench_endless_options bench_endless_default(void)
{
    bench_endless_options options = {SIM_RESCUE, 1, 100000, 30, 4, 32, 0.01, 0.03, 1};
    return options;
}

/* ---- Memory: all that is ever used ---- */

static cairn_status create(robot *r)
{
    cairn_scan_params scan = cairn_scan_default();
    cairn_scan_set_params set;
    joint_params solution = joint_default();
    cairn_scan_redundancy_params cover = cairn_scan_redundancy_default();
    int32_t kept = r->options->kept + 1;
    cairn_status status;
    size_t bytes;

    scan.max_beams = BEAMS;
    scan.max_points = 256;
    set.max_scans = cover.max_scans = solution.max_scans = kept;
    set.max_segments = kept * scan.max_segments;
    set.max_points = cover.max_points = kept * scan.max_points;
    set.spacing = 0;
    solution.max_links = solution.max_fill = kept * (kept + 1) / 2;
    solution.gate = CAIRN_REAL(0.2);
    solution.rounds = 2;
    bytes = cairn_scan_memory(&scan) + cairn_scan_set_memory(&set) +
            cairn_scan_redundancy_memory(&cover) + joint_memory(&solution) + CAIRN_ALIGN;
    r->memory = malloc(bytes);
    r->poses = calloc((size_t)kept, sizeof *r->poses);
    r->held = calloc((size_t)kept, sizeof *r->held);
    r->came = calloc((size_t)kept, sizeof *r->came);
    r->first_errors = calloc((size_t)r->options->places, sizeof *r->first_errors);
    if (r->memory == NULL || r->poses == NULL || r->held == NULL || r->came == NULL ||
        r->first_errors == NULL)
        return CAIRN_NO_MEMORY;
    status = cairn_pool_init(&r->pool, r->memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_scan_create(&r->scan, &r->pool, &scan);
    if (status == CAIRN_OK)
        status = cairn_scan_set_create(&r->set, &r->pool, &set);
    if (status == CAIRN_OK)
        status = cairn_scan_redundancy_create(&r->cover, &r->pool, &cover);
    if (status == CAIRN_OK)
        status = joint_create(&r->joint, &r->pool, &solution);
    return status;
}

static int make_arena(robot *r)
{
    sim_arena_options arena = sim_arena_default();
    sim_survey_options survey = sim_survey_default();
    char fault[256] = "no memory";
    int32_t count;

    arena.seed = survey.seed = r->options->seed;
    arena.scene = r->options->scene;
    survey.places = r->options->places;
    survey.headings = r->options->variants;
    survey.fov = 360 * CAIRN_DEGREE;
    survey.beams = BEAMS;
    survey.noise = 0;
    r->arena = sim_arena_create(&arena, fault, sizeof fault);
    if (r->arena != NULL)
        r->survey = sim_survey_create(r->arena, &survey, fault, sizeof fault);
    if (r->survey == NULL) {
        fprintf(stderr, "bench/endless: %s\n", fault);
        return 0;
    }
    r->scans = sim_survey_scans(r->survey, &count);
    return 1;
}

/* ---- One scan ---- */

static double off(robot *r, double most)
{
    return most * (double)cairn_random_uniform(&r->random, -1, 1);
}

/* Returns the pose estimate of the robot: the last pose composed with the odometry motion. */
static sim_pose odometry_pose(robot *r, const sim_scan *scan)
{
    sim_pose moved = bench_pose_between(r->truth, scan->truth);

    moved.x += off(r, r->options->metres);
    moved.y += off(r, r->options->metres);
    moved.theta += off(r, r->options->degrees * CAIRN_DEGREE);
    return bench_pose_compose(r->found, moved);
}

/* Steps an object to its end in ticks. */
#define IN_TICKS(r, call)                                                                          \
    do {                                                                                           \
        cairn_budget budget = {TICK};                                                              \
                                                                                                   \
        status = call;                                                                             \
        (r)->units += TICK - budget.left;                                                          \
    } while (status == CAIRN_MORE)

static cairn_status fit(robot *r, const sim_scan *from, cairn_scan_view *view)
{
    cairn_scan_input input = sim_scan_input(from);
    cairn_status status;

    for (int32_t i = 0; i < from->count; i++)
        r->range[i] =
            from->range[i] + (float)(r->options->noise * (double)cairn_random_normal(&r->random));
    input.range = r->range;
    input.range_sigma = (float)r->options->noise;
    status = cairn_scan_begin(r->scan, &input, NULL);
    if (status == CAIRN_OK)
        IN_TICKS(r, cairn_scan_step(r->scan, &budget));
    *view = cairn_scan_read(r->scan);
    return status;
}

/* All poses at once, from the current ones. */
static cairn_status align(robot *r)
{
    cairn_status status = joint_begin(&r->joint, r->set, r->poses, r->held, r->present);

    if (status == CAIRN_OK)
        IN_TICKS(r, joint_step(&r->joint, &budget));
    memcpy(r->poses, r->joint.poses, (size_t)r->present * sizeof *r->poses);
    return status;
}

/* Removes the most redundant scan; the first one defines the map and stays. */
static cairn_status release_one(robot *r, int32_t newest, bench_endless_lap *lap)
{
    int32_t least, oldest = -1;
    cairn_status status = cairn_scan_redundancy_begin(r->cover, r->set, r->poses);

    if (status == CAIRN_OK)
        IN_TICKS(r, cairn_scan_redundancy_step(r->cover, &budget));
    if (status != CAIRN_OK)
        return status;
    least = cairn_scan_redundancy_most_redundant(r->cover, 0);
    for (int32_t i = 1; i <= r->options->kept; i++)
        oldest = oldest < 0 || r->came[i] < r->came[oldest] ? i : oldest;
    lap->released++;
    lap->oldest += least == oldest;
    lap->newest += least == newest;
    r->present--;
    status = cairn_scan_set_remove(r->set, least);
    if (status == CAIRN_OK)
        IN_TICKS(r, cairn_scan_set_pack(r->set, &budget));
    return status;
}

static void score(robot *r, const sim_scan *scan, cairn_pose pose, bench_endless_lap *lap)
{
    sim_point *first = &r->first_errors[scan->place];
    sim_point error = {(double)pose.x - scan->truth.x, (double)pose.y - scan->truth.y};
    double metres = hypot(error.x, error.y);
    double turn =
        fabs(remainder((double)pose.theta - scan->truth.theta, 360 * CAIRN_DEGREE)) / CAIRN_DEGREE;

    r->truth = scan->truth;
    r->found.x = (double)pose.x;
    r->found.y = (double)pose.y;
    r->found.theta = (double)pose.theta;
    lap->mean += metres / r->options->places;
    lap->most = fmax(lap->most, metres);
    lap->most_degrees = fmax(lap->most_degrees, turn);
    if (lap->is_first)
        *first = error;
    if (lap->is_first || r->is_full)
        lap->away = fmax(lap->away, hypot(error.x - first->x, error.y - first->y));
}

static cairn_status take_in(robot *r, int64_t number, const sim_scan *scan, bench_endless_lap *lap)
{
    sim_pose guess = number == 0 ? scan->truth : odometry_pose(r, scan);
    cairn_pose map_scan = {(cairn_real)guess.x, (cairn_real)guess.y, (cairn_real)guess.theta};
    int32_t slot = cairn_scan_set_next(r->set);
    cairn_scan_view view;
    cairn_status status;

    r->units = 0;
    status = fit(r, scan, &view);
    if (status == CAIRN_OK)
        status = cairn_scan_set_add(r->set, &view, NULL, NULL);
    if (status != CAIRN_OK)
        return status;
    r->came[slot] = number;
    r->poses[slot] = map_scan;
    r->held[slot] = 0;
    r->present++;
    status = align(r);
    score(r, scan, r->poses[slot], lap);
    if (r->present > r->options->kept)
        memset(r->held, 1, (size_t)r->present * sizeof *r->held);
    if (status == CAIRN_OK && r->present > r->options->kept)
        status = release_one(r, slot, lap);
    lap->units += r->units;
    lap->worst = r->units > lap->worst ? r->units : lap->worst;
    lap->scans++;
    return status;
}

/* ---- The run ---- */

static cairn_status run(robot *r, void (*report)(void *context, const bench_endless_lap *lap),
                        void *context)
{
    int64_t laps = r->options->scans / r->options->places;
    cairn_status status = CAIRN_OK;

    for (int64_t number = 0; number < laps && status == CAIRN_OK; number++) {
        bench_endless_lap lap;
        double start = bench_seconds();

        memset(&lap, 0, sizeof lap);
        lap.lap = number;
        lap.is_first = !r->is_full && r->present == r->options->kept;
        r->is_full = r->present == r->options->kept;
        for (int32_t place = 0; place < r->options->places && status == CAIRN_OK; place++) {
            int64_t variant = number % r->options->variants;
            const sim_scan *scan = &r->scans[place * r->options->variants + variant];

            status = take_in(r, number * r->options->places + place, scan, &lap);
        }
        lap.kept = r->present;
        lap.pool_used = r->pool.used;
        lap.seconds = bench_seconds() - start;
        if (status == CAIRN_OK)
            report(context, &lap);
    }
    return status;
}

int bench_endless_run(const bench_endless_options *options,
                      void (*report)(void *context, const bench_endless_lap *lap), void *context)
{
    robot *r = calloc(1, sizeof *r);
    cairn_status status = CAIRN_NO_MEMORY;
    int done = 0;

    if (r == NULL)
        return 0;
    r->options = options;
    r->random = cairn_random_seed(options->seed, 5);
    if (make_arena(r)) {
        status = create(r);
        if (status == CAIRN_OK)
            status = run(r, report, context);
        done = status == CAIRN_OK;
        if (!done)
            fprintf(stderr, "bench/endless: %s\n", cairn_status_text(status));
    }
    sim_survey_free(r->survey);
    sim_arena_free(r->arena);
    free(r->memory);
    free(r->poses);
    free(r->held);
    free(r->came);
    free(r->first_errors);
    free(r);
    return done;
}
