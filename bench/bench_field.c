#include "bench/bench_field.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "bench/bench_score.h"
#include "cairn/random.h"
#include "src/host/base/degrees.h"

static void shuffle_poses(scene *s, uint64_t seed, double metres, double degrees)
{
    cairn_random random = cairn_random_seed(seed, 78);

    for (int32_t i = 0; i < s->count; i++) {
        s->start[i].x += (double)cairn_random_uniform(&random, -1, 1) * metres;
        s->start[i].y += (double)cairn_random_uniform(&random, -1, 1) * metres;
        s->start[i].theta += (double)cairn_random_uniform(&random, -1, 1) * degrees * CAIRN_DEGREE;
    }
}

/* The drive bends by 0.5 m and 5 degrees from its first scan to its last: a false loop closure. */
static void bend(scene *s, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 79);
    double towards = (double)cairn_random_uniform(&random, -1, 1) * 180 * CAIRN_DEGREE;

    for (int32_t i = 0; i < s->count; i++) {
        double share = s->count > 1 ? (double)i / (s->count - 1) : 0;

        s->start[i].x += 0.5 * share * cos(towards);
        s->start[i].y += 0.5 * share * sin(towards);
        s->start[i].theta += 5 * share * CAIRN_DEGREE;
    }
    shuffle_poses(s, seed, 0.05, 2);
}

void field_scene_free(scene *s)
{
    free(s->truth);
    free(s->start);
    free(s->poses);
    free(s->history);
    sim_survey_free(s->survey);
    sim_arena_free(s->arena);
}

int field_scene_make(scene *s, const char *name, uint64_t seed, double trans, double rot)
{
    sim_arena_options arena = sim_arena_default();
    sim_survey_options survey = sim_survey_default();
    char fault[256] = "no memory";
    size_t n = 0;

    memset(s, 0, sizeof *s);
    s->name = name;
    s->steps = 50;
    arena.seed = survey.seed = seed;
    arena.scene = sim_scene_find(name);
    if (arena.scene == SIM_MAZE) {
        survey.places = 16;
        survey.headings = 1;
        survey.fov = 360 * CAIRN_DEGREE;
        s->steps = 20;
    } else if (arena.scene == SIM_APARTMENT) {
        survey.drive = 200;
        survey.drive_distance = 0.3;
        survey.fov = 180 * CAIRN_DEGREE;
        s->steps = 150;
        s->drive = 1;
    } else {
        survey.places = 15;
    }
    s->arena = sim_arena_create(&arena, fault, sizeof fault);
    if (s->arena != NULL)
        s->survey = sim_survey_create(s->arena, &survey, fault, sizeof fault);
    if (s->survey != NULL) {
        s->scans = sim_survey_scans(s->survey, &s->count);
        n = (size_t)s->count;
        s->truth = malloc(n * sizeof *s->truth);
        s->start = malloc(n * sizeof *s->start);
        s->poses = malloc(n * sizeof *s->poses);
        s->history = malloc(n * (MOST_STEPS + 1) * sizeof *s->history);
    }
    if (s->truth == NULL || s->start == NULL || s->poses == NULL || s->history == NULL) {
        fprintf(stderr, "bench/field: %s\n", fault);
        field_scene_free(s);
        return 0;
    }
    for (size_t i = 0; i < n; i++)
        s->truth[i] = s->start[i] = s->scans[i].truth;
    if (s->drive)
        bend(s, seed);
    else
        shuffle_poses(s, seed,
                      !isnan(trans)             ? trans
                      : arena.scene == SIM_MAZE ? 0.25
                                                : 0.30,
                      isnan(rot) ? 20 : rot);
    memcpy(s->poses, s->start, n * sizeof *s->poses);
    return 1;
}

static double angle_error(double a, double b)
{
    return fabs(remainder(a - b, 6.283185307179586)) / CAIRN_DEGREE;
}

/* ---- Scores ---- */

/* Errors of poses relative to others, after the best common motion. */
static field_error error_between(const scene *s, const sim_pose *poses, const sim_pose *others)
{
    double ex = 0, ey = 0, tx = 0, ty = 0, sine = 0, cosine = 0, turn;
    field_error error = {0, 0, (double)NAN, (double)NAN};
    size_t n = (size_t)s->count;
    double *metres = malloc(n * sizeof *metres), *degrees = malloc(n * sizeof *degrees);

    for (int32_t i = 0; i < s->count; i++) {
        ex += poses[i].x / s->count;
        ey += poses[i].y / s->count;
        tx += others[i].x / s->count;
        ty += others[i].y / s->count;
    }
    for (int32_t i = 0; i < s->count; i++) {
        double px = poses[i].x - ex, py = poses[i].y - ey, qx = others[i].x - tx,
               qy = others[i].y - ty;

        sine += px * qy - py * qx;
        cosine += px * qx + py * qy;
    }
    turn = atan2(sine, cosine);
    for (int32_t i = 0; i < s->count && metres != NULL && degrees != NULL; i++) {
        double px = poses[i].x - ex, py = poses[i].y - ey;
        double x = cos(turn) * px - sin(turn) * py, y = sin(turn) * px + cos(turn) * py;

        metres[i] = hypot(x - (others[i].x - tx), y - (others[i].y - ty));
        degrees[i] = angle_error(poses[i].theta + turn, others[i].theta);
        error.metres += metres[i] / s->count;
        error.degrees += degrees[i] / s->count;
    }
    if (metres != NULL && degrees != NULL) {
        error.median_metres = bench_median(metres, n);
        error.median_degrees = bench_median(degrees, n);
    }
    free(metres);
    free(degrees);
    return error;
}

field_error field_error_of(const scene *s, const sim_pose *poses)
{
    return error_between(s, poses, s->truth);
}

field_error field_moved(const scene *s, const sim_pose *poses)
{
    return error_between(s, poses, s->start);
}

double field_gap(const scene *s, const sim_pose *poses)
{
    double sum = 0;
    int32_t pairs = 0;

    for (int32_t i = 0; i < s->count; i++)
        for (int32_t j = i + s->count / 4; j < s->count; j++) {
            sim_pose truth = bench_pose_between(s->truth[i], s->truth[j]);
            sim_pose found = bench_pose_between(poses[i], poses[j]);

            if (hypot(truth.x, truth.y) > 1.5)
                continue;
            sum += hypot(found.x - truth.x, found.y - truth.y);
            pairs++;
        }
    return pairs > 0 ? sum / pairs : (double)NAN;
}
