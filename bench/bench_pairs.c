/* bench/pairs: generation of the pairs described in bench/pairs.c. */
#include "bench/bench_pairs.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_bound.h"
#include "bench/bench_noise.h"
#include "bench/bench_score.h"
#include "cairn/carmen_log.h"
#include "cairn/random.h"
#include "sim/arena.h"
#include "src/host/base/degrees.h"

enum { DRIVE_SCANS = 60, DRIVE_BEAMS = 181, PAIRS_PER_ARENA = 20, PLACE_BEAMS = 1604 };

/* ---- Pairs ---- */

static int is_pair(cairn_pose a, cairn_pose b)
{
    cairn_pose t = cairn_pose_between(a, b);
    double d = hypot((double)t.x, (double)t.y), angle = fabs((double)t.theta);

    return d < 1.5 && angle < 0.7 && (d >= 0.1 || angle >= 5 * CAIRN_DEGREE);
}

static bench_pair pair_of(int32_t target, int32_t query)
{
    bench_pair p = {target, query, target, target + 1, {0}};

    return p;
}

/* Draws pairs among views[first ... end-1]. */
static void draw_pairs(bench_collection *c, int32_t first, int32_t end, int64_t partners,
                       int32_t most, cairn_random *random)
{
    int32_t goal = c->pair_count + most;

    for (int64_t attempt = 0;
         attempt < 1000 * (int64_t)most && c->pair_count < goal && end - first > 1; attempt++) {
        int32_t a = first + cairn_random_below(random, end - first);
        int32_t b = a + 1 + cairn_random_below(random, (int32_t)partners);

        if (b >= end || !is_pair(c->views.at[a].truth, c->views.at[b].truth))
            continue;
        c->pairs[c->pair_count++] = pair_of(a, b);
    }
}

static void add_unrelated(bench_collection *c, int32_t target, int32_t query)
{
    c->unrelated[c->unrelated_count++] = pair_of(target, query);
}

/* ---- Simulated ---- */

/* The bound of the pose of the second scan in the frame of the first, from the bound in the
 * world with one of them fixed. */
static void bound_pairs(bench_collection *c, const sim_arena *arena, const sim_scan *scans,
                        int32_t first_pair)
{
    for (int32_t i = first_pair; i < c->pair_count; i++) {
        bench_pair *p = &c->pairs[i];
        sim_scan both[2] = {scans[c->views.at[p->target].scan], scans[c->views.at[p->query].scan]};
        bench_bound bounds[2];
        int32_t fixed = bench_bound_compute(arena, both, 2, 1, 1, bounds);
        double j[3][3] = {{0}}, co, si, dx, dy;
        const double *world;

        if (fixed < 0)
            continue;
        /* query in target: R^T (q - t). */
        co = cos(both[0].truth.theta);
        si = sin(both[0].truth.theta);
        dx = both[1].truth.x - both[0].truth.x;
        dy = both[1].truth.y - both[0].truth.y;
        j[0][0] = j[1][1] = fixed == 0 ? co : -co;
        j[0][1] = fixed == 0 ? si : -si;
        j[1][0] = -j[0][1];
        j[2][2] = fixed == 0 ? 1 : -1;
        if (fixed != 0) {
            j[0][2] = -si * dx + co * dy;
            j[1][2] = -co * dx - si * dy;
        }
        world = bounds[1 - fixed].covariance;
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++)
                for (int k = 0; k < 9; k++)
                    p->bound[3 * a + b] += j[a][k / 3] * world[k] * j[b][k % 3];
    }
}

/* Share of the query's points that lie within 0.15 m of a target's point of similar direction, at
 * the truth. */
static double true_overlap(const bench_view *target, const bench_view *query)
{
    cairn_transform target_query =
        cairn_transform_of(cairn_pose_between(target->truth, query->truth));
    int32_t near = 0;

    for (int32_t i = 0; i < query->part.count; i++) {
        cairn_vec2 p = cairn_transform_point(target_query, query->part.points[i].position);
        cairn_vec2 d = cairn_transform_direction(target_query, query->part.points[i].direction);
        int32_t found = 0;

        for (int32_t k = 0; k < target->part.count && !found; k++)
            found = cairn_vec2_norm(cairn_vec2_sub(target->part.points[k].position, p)) <
                        CAIRN_REAL(0.15) &&
                    cairn_vec2_dot(target->part.points[k].direction, d) > CAIRN_REAL(0.87);
        near += found;
    }
    return query->part.count > 0 ? (double)near / query->part.count : 0;
}

/* All pairs of views[first ... end-1] with enough overlap, in both orders; those without any are
 * unrelated pairs. */
static void pair_places(const bench_pairs_settings *s, bench_collection *c, int32_t first,
                        int32_t end, size_t capacity)
{
    for (int32_t a = first; a < end; a++)
        for (int32_t b = first; b < end; b++) {
            double overlap;

            if (a == b)
                continue;
            overlap = true_overlap(&c->views.at[a], &c->views.at[b]);
            if (overlap >= s->overlap && (size_t)c->pair_count < capacity) {
                c->pairs[c->pair_count++] = pair_of(a, b);
            } else if (overlap < 0.02 && (size_t)c->unrelated_count < capacity) {
                add_unrelated(c, a, b);
            }
        }
}

/* Every view of views[first ... end-1] with the union of the others. */
static void pair_with_others(bench_collection *c, int32_t first, int32_t end, size_t capacity)
{
    for (int32_t query = first; query < end && (size_t)c->pair_count < capacity; query++) {
        bench_pair *p = &c->pairs[c->pair_count++];

        *p = pair_of(query > first ? first : first + 1, query);
        p->first = first;
        p->end = end;
    }
}

static int add_arena(const bench_pairs_settings *s, bench_collection *c, uint64_t seed,
                     int32_t number)
{
    static const sim_scene scenes[] = {SIM_RESCUE, SIM_APARTMENT, SIM_OFFICE, SIM_RESCUE};
    sim_arena_options arena_options = sim_arena_default();
    sim_survey_options survey_options = sim_survey_default();
    cairn_random random = cairn_random_seed(seed, 5);
    int32_t first = c->views.count, count = 0, done = 0, first_pair = c->pair_count;
    sim_survey *survey = NULL;
    sim_arena *arena;
    char fault[256] = "";

    arena_options.seed = survey_options.seed = seed;
    arena_options.scene = s->scene != NULL ? sim_scene_find(s->scene) : scenes[number % 4];
    survey_options.drive = s->places ? 0 : DRIVE_SCANS;
    survey_options.places = s->places ? BENCH_PAIRS_PLACES : 0;
    survey_options.headings = 1;
    survey_options.beams = s->places ? PLACE_BEAMS : DRIVE_BEAMS;
    survey_options.fov = (s->places ? 360 : 180) * CAIRN_DEGREE;
    arena = sim_arena_create(&arena_options, fault, sizeof fault);
    if (arena != NULL)
        survey = sim_survey_create(arena, &survey_options, fault, sizeof fault);
    if (survey != NULL) {
        const sim_scan *scans = sim_survey_scans(survey, &count);

        done = 1;
        for (int32_t i = 0; i < count && done; i++) {
            cairn_scan_input input = sim_scan_input(&scans[i]);

            done = bench_views_add(&c->views, &input, bench_cairn_pose(scans[i].truth), i);
        }
        if (s->unions)
            pair_with_others(c, first, c->views.count, (size_t)s->pairs + PAIRS_PER_ARENA);
        else if (s->places)
            pair_places(s, c, first, c->views.count, (size_t)s->pairs + PAIRS_PER_ARENA);
        else
            draw_pairs(c, first, c->views.count, s->partners, PAIRS_PER_ARENA, &random);
        if (!s->unions)
            bound_pairs(c, arena, scans, first_pair);
        for (int32_t i = 0; i < PAIRS_PER_ARENA && first > 0 && !s->places; i++)
            add_unrelated(c, first + cairn_random_below(&random, count),
                          first - 1 - cairn_random_below(&random, count));
    } else {
        fprintf(stderr, "bench/pairs: %s\n", fault);
    }
    sim_survey_free(survey);
    sim_arena_free(arena);
    return done;
}

static int collect_simulated(const bench_pairs_settings *s, bench_collection *c)
{
    int32_t arenas = (int32_t)((s->pairs + PAIRS_PER_ARENA - 1) / PAIRS_PER_ARENA) + 1;
    int done =
        bench_views_start(&c->views, arenas * DRIVE_SCANS, s->places ? PLACE_BEAMS : DRIVE_BEAMS);

    for (int32_t i = 0; i < arenas && done && c->pair_count < s->pairs; i++)
        done = add_arena(s, c, (uint64_t)(s->seed + i), i);
    return done;
}

/* ---- From a log ---- */

/* Lines "scan x y theta". */
static int read_truth(const char *path, const cairn_carmen_log_scans *log, bench_collection *c)
{
    FILE *file = fopen(path, "r");
    char line[1024];
    int32_t number = 0;

    if (file == NULL) {
        fprintf(stderr, "%s: cannot be read\n", path);
        return 0;
    }
    while (fgets(line, sizeof line, file) != NULL) {
        double v[4];
        cairn_pose pose;
        cairn_scan_input input;

        number++;
        if (line[0] == '#')
            continue;
        if (sscanf(line, "%lf %lf %lf %lf", &v[0], &v[1], &v[2], &v[3]) != 4 ||
            !(v[0] >= 0 && v[0] < log->count)) {
            fprintf(stderr, "%s:%d: no such pose, expected the number of a scan, x, y and theta\n",
                    path, (int)number);
            continue;
        }
        pose.x = (cairn_real)v[1];
        pose.y = (cairn_real)v[2];
        pose.theta = (cairn_real)v[3];
        input = log->record[(int32_t)v[0]].scan;
        input.base_sensor = cairn_pose_identity(); /* the reference poses are the laser's */
        if (!bench_views_add(&c->views, &input, pose, (int32_t)v[0]))
            break;
    }
    fclose(file);
    return c->views.count > 0;
}

static int collect_log(const bench_pairs_settings *s, bench_collection *c)
{
    cairn_carmen_log_scans log;
    cairn_file_error error;
    cairn_random random = cairn_random_seed((uint64_t)s->seed, 5);
    int done;

    if (cairn_carmen_log_load(&log, s->log, NULL, &error) != CAIRN_OK) {
        fprintf(stderr, "%s\n", error.text);
        return 0;
    }
    if (s->noise)
        bench_noise_poses(&log, (uint64_t)s->seed);
    done = bench_views_start(&c->views, log.count, log.info.max_beams) &&
           read_truth(s->truth, &log, c);
    if (done) {
        draw_pairs(c, 0, c->views.count, s->partners, (int32_t)s->pairs, &random);
        for (int64_t attempt = 0; attempt < 1000 * s->pairs && c->unrelated_count < s->pairs;
             attempt++) {
            int32_t a = cairn_random_below(&random, c->views.count),
                    b = cairn_random_below(&random, c->views.count);
            cairn_pose t = cairn_pose_between(c->views.at[a].truth, c->views.at[b].truth);

            if (hypot((double)t.x, (double)t.y) > 15)
                add_unrelated(c, a, b);
        }
    }
    cairn_carmen_log_scans_free(&log);
    return done;
}

int bench_pairs_collect(const bench_pairs_settings *s, bench_collection *c)
{
    size_t capacity = (size_t)s->pairs + PAIRS_PER_ARENA;
    int collected;

    memset(c, 0, sizeof *c);
    c->pairs = malloc(capacity * sizeof *c->pairs);
    c->unrelated = malloc(2 * capacity * sizeof *c->unrelated);
    collected = c->pairs != NULL && c->unrelated != NULL &&
                (s->simulated || s->places ? collect_simulated(s, c) : collect_log(s, c));
    if (c->pair_count > s->pairs)
        c->pair_count = (int32_t)s->pairs;
    if (c->unrelated_count > s->pairs)
        c->unrelated_count = (int32_t)s->pairs;
    return collected;
}

void bench_pairs_free(bench_collection *c)
{
    bench_views_free(&c->views);
    free(c->pairs);
    free(c->unrelated);
}
