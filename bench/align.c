/* bench/align: all scans of simulated arenas at once, from disturbed poses.
 *
 * The scans of each arena are shuffled, and every arena lies in the world at an angle of its own. A scan is aligned when
 * it lies within 0.05 m and 1 degree of the truth after the best common motion; the share is that of the scans that the
 * Cramer-Rao bound calls observable (bench_bound). */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_bound.h"
#include "bench/bench_json.h"
#include "bench/bench_lum.h"
#include "bench/bench_score.h"
#include "cairn/force_field.h"
#include "cairn/random.h"
#include "tools/options.h"

#define DEGREE 0.017453292519943295

typedef struct settings {
    const char *method, *scene;
    int64_t arenas, seed, places, headings, beams, steps, rebuild;
    double metres, degrees, fov;
    double jitter[2]; /* m, degrees; NaN: the survey's own */
} settings;

/* What one arena gave. */
typedef struct outcome {
    int32_t scans, observable, aligned, pairs, pairs_ok, steps, steps_rising;
    double median_m, median_deg, median_ratio, start_m, start_deg;
    double seconds, step_ms;
    size_t pool_bytes;
} outcome;

/* ---- The method ---- */

static cairn_pose pose_of(sim_pose p)
{
    cairn_pose pose = {(cairn_real)p.x, (cairn_real)p.y, (cairn_real)p.theta};

    return pose;
}

static sim_pose sim_of(cairn_pose p)
{
    sim_pose pose = {(double)p.x, (double)p.y, (double)p.theta};

    return pose;
}

static cairn_status fit(cairn_scan *scan, const sim_scan *from, cairn_scan_view *view)
{
    cairn_scan_input input = sim_scan_input(from);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status = cairn_scan_begin(scan, &input, NULL);

    if (status == CAIRN_OK)
        status = cairn_scan_step(scan, &budget);
    *view = cairn_scan_read(scan);
    return status;
}

/* How much room the scans need in a field. */
static cairn_status count_room(const cairn_scan_params *scan_params, const sim_scan *scans, int32_t count,
                               cairn_force_field_params *params)
{
    size_t bytes = cairn_scan_memory(scan_params) + CAIRN_ALIGN;
    void *memory = malloc(bytes);
    cairn_scan *scan = NULL;
    cairn_pool pool;
    cairn_status status = memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(&pool, memory, bytes);

    params->max_scans = count;
    params->max_segments = 1;
    params->max_points = 1;
    if (status == CAIRN_OK)
        status = cairn_scan_create(&scan, &pool, scan_params);
    for (int32_t i = 0; i < count && status == CAIRN_OK; i++) {
        cairn_scan_view view;

        status = fit(scan, &scans[i], &view);
        params->max_segments += view.segment_count;
        params->max_points += view.point_count;
    }
    params->max_corners = params->max_segments;
    free(memory);
    return status;
}

/* Adds all scans and lets the field run; the poses when it stands. */
static cairn_status simulate(const sim_scan *scans, int32_t count, cairn_scan *scan, cairn_force_field *field,
                             sim_pose *poses, outcome *out)
{
    double start = bench_seconds(), stepped;
    cairn_force_field_state state;
    cairn_status status = CAIRN_OK;
    cairn_real before = 0;

    for (int32_t i = 0; i < count && status == CAIRN_OK; i++) {
        cairn_scan_view view;

        status = fit(scan, &scans[i], &view);
        if (status == CAIRN_OK)
            status = cairn_force_field_add_scan(field, &view, NULL, pose_of(poses[i]), NULL);
    }
    if (status != CAIRN_OK)
        return status;
    stepped = bench_seconds();
    do {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        status = cairn_force_field_iterate(field, &budget);
        state = cairn_force_field_read(field);
        out->steps_rising += state.iterations > 1 && state.potential > before;
        before = state.potential;
    } while (status >= 0 && state.verdict == CAIRN_FORCE_FIELD_RUNNING);
    out->steps = state.iterations;
    out->seconds = bench_seconds() - start;
    out->step_ms = 1e3 * (bench_seconds() - stepped) / (state.iterations > 0 ? state.iterations : 1);
    for (int32_t i = 0; i < count && status >= 0; i++)
        poses[i] = sim_of(cairn_force_field_pose(field, i));
    return status < 0 ? status : CAIRN_OK;
}

/* Force field simulation as in the thesis. Ranges in, poses out; 0 on failure. */
static int run_gradient(const settings *s, const sim_scan *scans, int32_t count, sim_pose *poses, outcome *out)
{
    cairn_scan_params scan_params = cairn_scan_default();
    cairn_force_field_params params = cairn_force_field_default();
    cairn_force_field *field = NULL;
    cairn_scan *scan = NULL;
    cairn_pool pool;
    cairn_status status;
    void *memory = NULL;
    size_t bytes;

    scan_params.max_beams = scans[0].count;
    params.max_steps = (int32_t)s->steps;
    status = count_room(&scan_params, scans, count, &params);
    if (status == CAIRN_OK) {
        bytes = cairn_force_field_memory(&params) + cairn_scan_memory(&scan_params) + CAIRN_ALIGN;
        memory = malloc(bytes);
        status = memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(&pool, memory, bytes);
    }
    if (status == CAIRN_OK)
        status = cairn_scan_create(&scan, &pool, &scan_params);
    if (status == CAIRN_OK)
        status = cairn_force_field_create(&field, &pool, &params);
    if (status == CAIRN_OK)
        status = simulate(scans, count, scan, field, poses, out);
    if (status == CAIRN_OK)
        out->pool_bytes = pool.peak;
    else
        fprintf(stderr, "bench/align: %s\n", cairn_status_text(status));
    free(memory);
    return status == CAIRN_OK;
}

/* Lu and Milios as in the thesis. */
static int run_lum(const settings *s, const sim_scan *scans, int32_t count, sim_pose *poses, outcome *out)
{
    double start = bench_seconds();
    int done =
        bench_lum_align(scans, count, (int32_t)s->steps, (int32_t)s->rebuild, poses, &out->steps, &out->pool_bytes);

    out->seconds = bench_seconds() - start;
    out->step_ms = 1e3 * out->seconds / (out->steps > 0 ? out->steps : 1);
    return done;
}

/* ---- One arena ---- */

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

/* 1 when both scans hit one flat edge. */
static int share_wall(const sim_scan *a, const sim_scan *b, uint8_t *seen, int32_t edges)
{
    memset(seen, 0, (size_t)edges);
    for (int32_t i = 0; i < a->count; i++)
        if (a->edge[i] >= 0)
            seen[a->edge[i]] = 1;
    for (int32_t i = 0; i < b->count; i++)
        if (b->edge[i] >= 0 && seen[b->edge[i]])
            return 1;
    return 0;
}

static void score_pairs(const sim_arena *arena, const sim_scan *scans, const sim_pose *truth, const sim_pose *poses,
                        int32_t count, outcome *out)
{
    int32_t edges;
    uint8_t *seen;

    (void)sim_arena_edges(arena, &edges);
    seen = malloc((size_t)edges + 1);
    for (int32_t i = 0; i < count && seen != NULL; i++)
        for (int32_t j = i + 1; j < count; j++)
            if (share_wall(&scans[i], &scans[j], seen, edges)) {
                out->pairs++;
                out->pairs_ok += bench_pose_near(bench_pose_between(truth[i], truth[j]),
                                                 bench_pose_between(poses[i], poses[j]), 0.05, DEGREE);
            }
    free(seen);
}

static double angle_error(double a, double b)
{
    return fabs(remainder(a - b, 6.283185307179586)) / DEGREE;
}

static void score(const sim_arena *arena, const sim_scan *scans, const sim_pose *truth, const sim_pose *start,
                  const sim_pose *poses, const bench_bound *bounds, int32_t count, outcome *out)
{
    size_t n = (size_t)count, observable = 0, aligned = 0;
    int32_t *use = malloc(n * sizeof *use);
    sim_pose *moved = malloc(n * sizeof *moved);
    double *metres = malloc(n * sizeof *metres), *degrees = malloc(n * sizeof *degrees);
    double *ratios = malloc(n * sizeof *ratios);

    if (use != NULL && moved != NULL && metres != NULL && degrees != NULL && ratios != NULL) {
        for (size_t i = 0; i < n; i++)
            use[i] = bounds[i].observable;
        (void)bench_fit_common(truth, poses, use, count, 0.05, DEGREE, moved);
        for (size_t i = 0; i < n; i++) {
            double bound = sqrt(bounds[i].covariance[0] + bounds[i].covariance[4]);

            out->start_m += hypot(start[i].x - truth[i].x, start[i].y - truth[i].y) / count;
            out->start_deg += angle_error(start[i].theta, truth[i].theta) / count;
            if (!use[i])
                continue;
            metres[observable] = hypot(moved[i].x - truth[i].x, moved[i].y - truth[i].y);
            degrees[observable] = angle_error(moved[i].theta, truth[i].theta);
            if (bench_pose_near(truth[i], moved[i], 0.05, DEGREE)) {
                out->aligned++;
                if (bound > 0)
                    ratios[aligned++] = metres[observable] / bound;
            }
            observable++;
        }
        out->observable = (int32_t)observable;
        out->median_m = bench_median(metres, observable);
        out->median_deg = bench_median(degrees, observable);
        out->median_ratio = bench_median(ratios, aligned);
        score_pairs(arena, scans, truth, poses, count, out);
    }
    free(use);
    free(moved);
    free(metres);
    free(degrees);
    free(ratios);
}

static int run_arena(const settings *s, uint64_t seed, outcome *out)
{
    sim_arena_options arena_options = sim_arena_default();
    sim_survey_options survey_options = sim_survey_default();
    char fault[256];
    sim_arena *arena;
    sim_survey *survey = NULL;
    sim_scan *scans = NULL;
    sim_pose *truth = NULL, *start = NULL, *poses = NULL;
    bench_bound *bounds = NULL;
    int32_t count = 0;
    int done = 0;

    memset(out, 0, sizeof *out);
    arena_options.seed = seed;
    arena_options.scene = sim_scene_find(s->scene);
    survey_options.seed = seed;
    survey_options.places = (int32_t)s->places;
    survey_options.headings = (int32_t)s->headings;
    survey_options.beams = (int32_t)s->beams;
    survey_options.fov = s->fov * DEGREE;
    if (s->jitter[0] >= 0) {
        survey_options.jitter_position = s->jitter[0];
        survey_options.jitter_heading = s->jitter[1] * DEGREE;
    }
    arena = sim_arena_create(&arena_options, fault, sizeof fault);
    if (arena != NULL)
        survey = sim_survey_create(arena, &survey_options, fault, sizeof fault);
    if (survey != NULL) {
        const sim_scan *all = sim_survey_scans(survey, &count);

        scans = malloc((size_t)count * sizeof *scans);
        truth = malloc((size_t)count * sizeof *truth);
        start = malloc((size_t)count * sizeof *start);
        poses = malloc((size_t)count * sizeof *poses);
        bounds = malloc((size_t)count * sizeof *bounds);
        if (scans != NULL && truth != NULL && start != NULL && poses != NULL && bounds != NULL) {
            cairn_random random = cairn_random_seed(seed, 78);

            memcpy(scans, all, (size_t)count * sizeof *scans);
            shuffle(scans, count, seed);
            for (int32_t i = 0; i < count; i++) {
                truth[i] = scans[i].truth;
                start[i] = truth[i];
                start[i].x += (double)cairn_random_uniform(&random, -1, 1) * s->metres;
                start[i].y += (double)cairn_random_uniform(&random, -1, 1) * s->metres;
                start[i].theta += (double)cairn_random_uniform(&random, -1, 1) * s->degrees * DEGREE;
                poses[i] = start[i];
            }
            out->scans = count;
            done = bench_bound_compute(arena, scans, count, s->metres, s->degrees * DEGREE, bounds) >= 0 &&
                   (strcmp(s->method, "lum") == 0 ? run_lum : run_gradient)(s, scans, count, poses, out);
            if (done)
                score(arena, scans, truth, start, poses, bounds, count, out);
        } else {
            fprintf(stderr, "bench/align: no memory for %" PRId32 " scans\n", count);
        }
    } else {
        fprintf(stderr, "bench/align: %s\n", fault);
    }
    free(scans);
    free(truth);
    free(start);
    free(poses);
    free(bounds);
    sim_survey_free(survey);
    sim_arena_free(arena);
    return done;
}

/* ---- Output ---- */

static void print_common(const settings *s, const outcome *o)
{
    bench_json_text("method", s->method);
    bench_json_text("scene", s->scene);
    bench_json_number("trans", s->metres);
    bench_json_number("rot", s->degrees);
    bench_json_integer("scans", o->scans);
    bench_json_integer("observable", o->observable);
    bench_json_integer("aligned", o->aligned);
    bench_json_number("share", o->observable > 0 ? (double)o->aligned / o->observable : (double)NAN);
    bench_json_number("pairs_ok", o->pairs > 0 ? (double)o->pairs_ok / o->pairs : (double)NAN);
    bench_json_number("median_trans_m", o->median_m);
    bench_json_number("median_rot_deg", o->median_deg);
    bench_json_number("median_ratio", o->median_ratio);
    bench_json_integer("rising_steps", o->steps_rising);
}

/* Sums of all arenas, medians over arenas of their medians. */
static void print_summary(const settings *s, const outcome *all, size_t count)
{
    outcome sum;
    double *values = malloc((6 * count + 1) * sizeof *values);
    double shares = 0;

    if (values == NULL)
        return;
    memset(&sum, 0, sizeof sum);
    for (size_t i = 0; i < count; i++) {
        sum.scans += all[i].scans;
        sum.observable += all[i].observable;
        sum.aligned += all[i].aligned;
        sum.pairs += all[i].pairs;
        sum.pairs_ok += all[i].pairs_ok;
        sum.steps_rising += all[i].steps_rising;
        sum.pool_bytes = all[i].pool_bytes > sum.pool_bytes ? all[i].pool_bytes : sum.pool_bytes;
        shares += all[i].start_m / (double)count;
        values[i] = all[i].median_m;
        values[count + i] = all[i].median_deg;
        values[2 * count + i] = all[i].median_ratio;
        values[3 * count + i] = all[i].seconds;
        values[4 * count + i] = all[i].step_ms;
    }
    sum.median_m = bench_median(values, count);
    sum.median_deg = bench_median(values + count, count);
    sum.median_ratio = bench_median(values + 2 * count, count);
    bench_json_begin("align");
    print_common(s, &sum);
    bench_json_integer("arenas", (int64_t)count);
    bench_json_number("start_mean_m", shares);
    bench_json_number("seconds_median", bench_median(values + 3 * count, count));
    bench_json_number("step_ms_median", bench_median(values + 4 * count, count));
    bench_json_integer("pool_bytes", (int64_t)sum.pool_bytes);
    bench_json_true("summary");
    bench_json_end();
    free(values);
}

/* 1 when the settings can be run, or one line on standard error. */
static int check(const settings *s)
{
    if (sim_scene_find(s->scene) < 0) {
        fprintf(stderr, "bench/align: unknown scene '%s', expected one of cairn-arena's\n", s->scene);
        return 0;
    }
    if (strcmp(s->method, "gradient") != 0 && strcmp(s->method, "lum") != 0) {
        fprintf(stderr, "bench/align: unknown method '%s', expected gradient or lum\n", s->method);
        return 0;
    }
    return 1;
}

int main(int argc, char **argv)
{
    settings s = {"gradient", "rescue", 20, 1, 15, 4, 401, 50, 0, 0.30, 20, 100, {(double)NAN, (double)NAN}};
    const option table[] = {
        OPTION_INTEGER("--arenas", &s.arenas, 1, 10000, "N", "arenas"),
        OPTION_INTEGER("--seed", &s.seed, 0, 9e15, "N", "of the first arena; the others follow"),
        OPTION_NUMBER("--trans", &s.metres, 0.001, 10, "M", "disturbance of x and y, uniform +-, m"),
        OPTION_NUMBER("--rot", &s.degrees, 0.01, 180, "DEG", "disturbance of the heading, uniform +-, degrees"),
        OPTION_TEXT("--method", &s.method, "NAME", "gradient or lum: as in the thesis"),
        OPTION_TEXT("--scene", &s.scene, "NAME", "scene of the arenas (rescue)"),
        OPTION_INTEGER("--places", &s.places, 1, 1000, "N", "places with scans"),
        OPTION_INTEGER("--headings", &s.headings, 1, 64, "N", "scans at each place"),
        OPTION_NUMBER("--fov", &s.fov, 1, 360, "DEG", "field of view, degrees"),
        OPTION_INTEGER("--beams", &s.beams, 2, 100000, "N", "beams of a scan"),
        OPTION_PAIR("--jitter", s.jitter, 0, 360, "M,DEG", "spread of the sensors of one place, m and degrees"),
        OPTION_INTEGER("--steps", &s.steps, 1, 100000, "N", "iterations at most"),
        OPTION_INTEGER("--rebuild", &s.rebuild, 0, 100000, "N", "of lum: links are looked for anew every N iterations"),
    };
    const option_set set = {"bench/align", "[options]", "Alignment of all scans of simulated arenas at once.", table,
                            sizeof table / sizeof *table};
    outcome *all;
    size_t words = 0;

    switch (options_read(&set, argc, argv, NULL, &words)) {
    case OPTIONS_HELPED:
        return 0;
    case OPTIONS_BAD:
        return 2;
    default:
        break;
    }
    if (!check(&s))
        return 2;
    all = malloc((size_t)s.arenas * sizeof *all);
    if (all == NULL) {
        fprintf(stderr, "bench/align: no memory for %" PRId64 " arenas\n", s.arenas);
        return 1;
    }
    for (int64_t i = 0; i < s.arenas; i++) {
        if (!run_arena(&s, (uint64_t)(s.seed + i), &all[i])) {
            free(all);
            return 1;
        }
        bench_json_begin("align");
        bench_json_integer("arena", s.seed + i);
        print_common(&s, &all[i]);
        bench_json_number("seconds", all[i].seconds);
        bench_json_number("step_ms", all[i].step_ms);
        bench_json_integer("steps", all[i].steps);
        bench_json_end();
    }
    print_summary(&s, all, (size_t)s.arenas);
    free(all);
    return 0;
}
