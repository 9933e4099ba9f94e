/* bench/align: all scans of simulated arenas at once, from disturbed poses.
 *
 * The scans of each arena are shuffled, and every arena is rotated randomly in the world. A scan is
 * aligned when it lies within 0.05 m and 1 degree (--within) of the truth after the best rigid
 * alignment; the fraction is relative to the scans that are observable by the Cramer-Rao bound
 * (bench_bound). The flags of methods that report low-confidence poses are evaluated: false_flags
 * are flagged observable scans, missed_flags unflagged unobservable ones. inside95 is the fraction
 * of the unflagged scans with the true position inside the 95 % covariance ellipse. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_align.h"
#include "bench/bench_bound.h"
#include "bench/bench_chain.h"
#include "bench/bench_gradient.h"
#include "bench/bench_growth.h"
#include "bench/bench_json.h"
#include "bench/bench_lum.h"
#include "bench/bench_problem.h"
#include "bench/bench_score.h"
#include "bench/bench_sequential.h"
#include "cairn/random.h"
#include "src/host/base/degrees.h"
#include "tools/options.h"

#define METHODS "default, gradient, icp, lum, lum-alone, sequential or filter"

enum { PARTICLES = 30 };

typedef struct settings {
    const char *method;
    bench_problem_kind kind;
    int64_t arenas, seed, steps;
    double within[2]; /* m, degrees: disturbance of the true poses */
    int32_t again;    /* --return */
    int32_t chain;    /* --chain */
    int32_t as_written, online;
    double sub_error[2]; /* m, degrees: errors of the poses within a place, for the chain */
    int32_t ablate, growth, rooms_joined;
    bench_ingredient without;
} settings;

/* What one arena gave. */
typedef struct outcome {
    int32_t scans, observable, aligned, pairs, pairs_ok, steps, steps_rising;
    int32_t false_flags, unobservable, missed_flags, unflagged, inside, returned;
    int32_t unflagged_wrong;
    int32_t flags; /* 1: the method flags poses */
    double median_m, median_deg, median_ratio, area_ratio, start_m, start_deg;
    double seconds, step_ms;
    double point_pairs, segment_pairs; /* mean of an iteration; 0: no force field simulation */
    int32_t corners_dropped;           /* the most of any iteration */
    size_t pool_bytes;
    int64_t units;
    int32_t worst_step;
} outcome;

/* ---- The method ---- */

/* With --online --chain: place after place. */
static int run_online_chain(const settings *s, const sim_scan *scans, int32_t count, uint64_t seed,
                            bench_pose *poses, bench_run *run)
{
    bench_chain *chain = bench_chain_open(scans, count, s->as_written, s->sub_error, seed);
    int done =
        chain != NULL && bench_run_gradient(scans, count, (int32_t)s->steps, 1, chain, poses, run);

    bench_chain_close(chain);
    return done;
}

static int run_method(const settings *s, const sim_scan *scans, int32_t count, uint64_t seed,
                      bench_pose *poses, outcome *out)
{
    bench_run run = {0};
    int done;

    if (s->online && s->chain)
        done = run_online_chain(s, scans, count, seed, poses, &run);
    else if (strcmp(s->method, "gradient") == 0)
        done = bench_run_gradient(scans, count, (int32_t)s->steps, s->online, NULL, poses, &run);
    else if (strcmp(s->method, "icp") == 0)
        done = bench_run_icp(scans, count, 20, poses, &run);
    else if (strncmp(s->method, "lum", 3) == 0)
        done = bench_run_lum(scans, count, (int32_t)s->steps,
                             s->as_written                   ? BENCH_LUM_AS_WRITTEN
                             : strcmp(s->method, "lum") == 0 ? BENCH_LUM_REGISTERED
                                                             : BENCH_LUM_ALONE,
                             poses, &run);
    else if (strcmp(s->method, "sequential") == 0)
        done = bench_run_sequential(scans, count, 0, poses, &run);
    else if (strcmp(s->method, "filter") == 0)
        done = bench_run_sequential(scans, count, PARTICLES, poses, &run);
    else
        done = bench_run_default(scans, count, s->without, poses, &run);
    out->steps = run.steps;
    out->steps_rising = run.rising;
    out->units = run.units;
    out->worst_step = run.worst_step;
    out->seconds = run.seconds;
    out->step_ms = run.step_ms;
    out->point_pairs = run.point_pairs;
    out->segment_pairs = run.segment_pairs;
    out->corners_dropped = run.corners_dropped;
    out->pool_bytes = run.pool_bytes;
    return done;
}

/* ---- One arena ---- */

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

static void score_pairs(const sim_arena *arena, const sim_scan *scans, const sim_pose *truth,
                        const sim_pose *poses, int32_t count, outcome *out)
{
    int32_t edges;
    uint8_t *seen;

    (void)sim_arena_edges(arena, &edges);
    seen = malloc((size_t)edges + 1);
    for (int32_t i = 0; i < count && seen != NULL; i++)
        for (int32_t j = i + 1; j < count; j++)
            if (share_wall(&scans[i], &scans[j], seen, edges)) {
                out->pairs++;
                out->pairs_ok +=
                    bench_pose_near(bench_pose_between(truth[i], truth[j]),
                                    bench_pose_between(poses[i], poses[j]), 0.05, CAIRN_DEGREE);
            }
    free(seen);
}

static double angle_error(double a, double b)
{
    return fabs(remainder(a - b, 6.283185307179586)) / CAIRN_DEGREE;
}

/* Area of the ellipse of a position's covariance, over pi and the common factor; 0 for one that
 * is fixed. */
static double area(const double c[9])
{
    double determinant = c[0] * c[4] - c[1] * c[3];

    return determinant > 0 ? sqrt(determinant) : 0;
}

/* 1 when (x, y) lies within the 95 % ellipse. */
static int is_inside(const double c[9], double x, double y)
{
    double determinant = c[0] * c[4] - c[1] * c[3];

    return (c[4] * x * x - 2 * c[1] * x * y + c[0] * y * y) / determinant < 5.991464547107979;
}

/* Accuracy of the reported covariances and flags; moved: poses after the best common motion. areas:
 * [count]. */
static void score_flags(const sim_pose *truth, const sim_pose *moved, const bench_pose *poses,
                        const bench_bound *bounds, int32_t count, double *areas, outcome *out)
{
    size_t compared = 0;

    for (int32_t i = 0; i < count; i++) {
        out->flags |= poses[i].known;
        out->unobservable += !bounds[i].observable;
        out->false_flags += bounds[i].observable && poses[i].flagged;
        out->missed_flags += !bounds[i].observable && !poses[i].flagged;
        if (!poses[i].known || poses[i].flagged || poses[i].anchor ||
            area(poses[i].covariance) <= 0)
            continue;
        out->unflagged++;
        out->inside +=
            is_inside(poses[i].covariance, moved[i].x - truth[i].x, moved[i].y - truth[i].y);
        if (area(bounds[i].covariance) > 0)
            areas[compared++] = area(poses[i].covariance) / area(bounds[i].covariance);
    }
    out->area_ratio = bench_median(areas, compared);
}

static void score(const settings *s, const sim_arena *arena, const sim_scan *scans,
                  const sim_pose *truth, const sim_pose *start, const bench_pose *results,
                  const bench_bound *bounds, int32_t count, outcome *out)
{
    size_t n = (size_t)count, observable = 0, aligned = 0;
    int32_t *use = malloc(n * sizeof *use);
    sim_pose *moved = malloc(n * sizeof *moved), *poses = malloc(n * sizeof *poses);
    double *metres = malloc(n * sizeof *metres), *degrees = malloc(n * sizeof *degrees);
    double *ratios = malloc(n * sizeof *ratios);

    if (use != NULL && moved != NULL && poses != NULL && metres != NULL && degrees != NULL &&
        ratios != NULL) {
        for (size_t i = 0; i < n; i++) {
            use[i] = bounds[i].observable;
            poses[i] = results[i].pose;
        }
        (void)bench_fit_common(truth, poses, use, count, s->within[0], s->within[1] * CAIRN_DEGREE,
                               moved);
        for (size_t i = 0; i < n; i++) {
            double bound = sqrt(bounds[i].covariance[0] + bounds[i].covariance[4]);

            out->start_m += hypot(start[i].x - truth[i].x, start[i].y - truth[i].y) / count;
            out->start_deg += angle_error(start[i].theta, truth[i].theta) / count;
            if (!use[i])
                continue;
            metres[observable] = hypot(moved[i].x - truth[i].x, moved[i].y - truth[i].y);
            degrees[observable] = angle_error(moved[i].theta, truth[i].theta);
            if (bench_pose_near(truth[i], moved[i], s->within[0], s->within[1] * CAIRN_DEGREE)) {
                out->aligned++;
                if (bound > 0)
                    ratios[aligned++] = metres[observable] / bound;
            } else if (!results[i].flagged)
                out->unflagged_wrong++;
            observable++;
        }
        out->observable = (int32_t)observable;
        out->median_m = bench_median(metres, observable);
        out->median_deg = bench_median(degrees, observable);
        out->median_ratio = bench_median(ratios, aligned);
        score_flags(truth, moved, results, bounds, count, metres, out);
        score_pairs(arena, scans, truth, poses, count, out);
    }
    free(use);
    free(moved);
    free(poses);
    free(metres);
    free(degrees);
    free(ratios);
}

/* The solution is disturbed as the truth was and aligned again; counts the observable scans that
 * return to it within 0.009 m and 0.7 degrees (Adluru 2008, chapter 7). */
static int run_return(const settings *s, const sim_scan *scans, const bench_bound *bounds,
                      int32_t count, uint64_t seed, const bench_pose *solution, outcome *out)
{
    size_t n = (size_t)count;
    bench_pose *poses = malloc(n * sizeof *poses);
    sim_pose *first = malloc(n * sizeof *first), *second = malloc(n * sizeof *second);
    int32_t *use = malloc(n * sizeof *use);
    cairn_random random = cairn_random_seed(seed, 79);
    outcome unused;
    int done = poses != NULL && first != NULL && second != NULL && use != NULL;

    memset(&unused, 0, sizeof unused);
    for (size_t i = 0; i < n && done; i++) {
        poses[i] = solution[i];
        first[i] = solution[i].pose;
        use[i] = bounds[i].observable;
        poses[i].pose.x += (double)cairn_random_uniform(&random, -1, 1) * s->kind.metres;
        poses[i].pose.y += (double)cairn_random_uniform(&random, -1, 1) * s->kind.metres;
        poses[i].pose.theta +=
            (double)cairn_random_uniform(&random, -1, 1) * s->kind.degrees * CAIRN_DEGREE;
    }
    done = done && run_method(s, scans, count, seed, poses, &unused);
    if (done) {
        for (size_t i = 0; i < n; i++)
            second[i] = poses[i].pose;
        (void)bench_fit_common(first, second, use, count, 0.009, 0.7 * CAIRN_DEGREE, second);
        for (size_t i = 0; i < n; i++)
            out->returned +=
                use[i] && bench_pose_near(first[i], second[i], 0.009, 0.7 * CAIRN_DEGREE);
    }
    free(poses);
    free(first);
    free(second);
    free(use);
    return done;
}

static int run_arena(const settings *s, uint64_t seed, outcome *out)
{
    bench_problem p;
    bench_bound *bounds = NULL;
    int done = bench_problem_open(&p, &s->kind, seed);

    memset(out, 0, sizeof *out);
    out->scans = p.count;
    if (done) {
        bounds = malloc((size_t)p.count * sizeof *bounds);
        done = bounds != NULL && bench_bound_compute(p.arena, p.scans, p.count, s->kind.metres,
                                                     s->kind.degrees * CAIRN_DEGREE, bounds) >= 0;
    }
    if (done && s->chain && !s->online)
        done = bench_chain_start(p.scans, p.count, s->as_written, s->sub_error, seed, p.poses);
    for (int32_t i = 0; i < p.count && done; i++)
        p.start[i] = p.poses[i].pose;
    done = done && run_method(s, p.scans, p.count, seed, p.poses, out);
    if (done)
        score(s, p.arena, p.scans, p.truth, p.start, p.poses, bounds, p.count, out);
    if (done && s->again)
        done = run_return(s, p.scans, bounds, p.count, seed, p.poses, out);
    free(bounds);
    bench_problem_close(&p);
    return done;
}

/* ---- Output ---- */

static double share_of(int32_t part, int32_t whole)
{
    return whole > 0 ? (double)part / whole : (double)NAN;
}

static void print_common(const settings *s, const outcome *o)
{
    bench_json_text("method", s->method);
    if (s->ablate)
        bench_json_text("without", bench_ingredient_name(s->without));
    if (s->as_written)
        bench_json_true("as_written");
    bench_json_text("scene", s->kind.scene);
    bench_json_number("trans", s->kind.metres);
    bench_json_number("rot", s->kind.degrees);
    bench_json_integer("scans", o->scans);
    bench_json_integer("observable", o->observable);
    bench_json_integer("aligned", o->aligned);
    bench_json_number("share", share_of(o->aligned, o->observable));
    bench_json_number("unflagged_wrong", share_of(o->unflagged_wrong, o->observable));
    bench_json_number("pairs_ok", share_of(o->pairs_ok, o->pairs));
    bench_json_number("median_trans_m", o->median_m);
    bench_json_number("median_rot_deg", o->median_deg);
    bench_json_number("median_ratio", o->median_ratio);
    if (strcmp(s->method, "gradient") == 0 && !s->online)
        bench_json_integer("rising_steps", o->steps_rising);
    if (s->online)
        bench_json_true("online");
    if (s->chain)
        bench_json_true("chain");
    if (o->flags) {
        bench_json_number("false_flags", share_of(o->false_flags, o->observable));
        bench_json_number("missed_flags", share_of(o->missed_flags, o->unobservable));
        bench_json_number("inside95", share_of(o->inside, o->unflagged));
        bench_json_number("area_ratio", o->area_ratio);
    }
    if (o->segment_pairs > 0) {
        bench_json_number("point_pairs", o->point_pairs);
        bench_json_number("segment_pairs", o->segment_pairs);
        bench_json_integer("corners_dropped", o->corners_dropped);
    }
    if (o->units > 0) {
        bench_json_integer("units", o->units);
        bench_json_integer("worst_step", o->worst_step);
    }
    if (s->again)
        bench_json_number("returned", share_of(o->returned, o->observable));
}

/* Sums of all arenas, medians over arenas of their medians. */
static void print_summary(const settings *s, const outcome *all, size_t count)
{
    outcome sum;
    double *values = malloc((7 * count + 1) * sizeof *values);
    double shares = 0;
    size_t compared = 0; /* arenas with unflagged scans */
    int32_t good = 0;    /* arenas of which 85 % are aligned */

    if (values == NULL)
        return;
    memset(&sum, 0, sizeof sum);
    for (size_t i = 0; i < count; i++) {
        sum.scans += all[i].scans;
        sum.observable += all[i].observable;
        sum.aligned += all[i].aligned;
        sum.pairs += all[i].pairs;
        sum.unflagged_wrong += all[i].unflagged_wrong;
        sum.pairs_ok += all[i].pairs_ok;
        sum.steps_rising += all[i].steps_rising;
        sum.false_flags += all[i].false_flags;
        sum.unobservable += all[i].unobservable;
        sum.missed_flags += all[i].missed_flags;
        sum.unflagged += all[i].unflagged;
        sum.inside += all[i].inside;
        sum.returned += all[i].returned;
        sum.point_pairs += all[i].point_pairs / (double)count;
        sum.segment_pairs += all[i].segment_pairs / (double)count;
        sum.corners_dropped += all[i].corners_dropped;
        sum.units += all[i].units;
        sum.worst_step = all[i].worst_step > sum.worst_step ? all[i].worst_step : sum.worst_step;
        sum.flags |= all[i].flags;
        sum.pool_bytes = all[i].pool_bytes > sum.pool_bytes ? all[i].pool_bytes : sum.pool_bytes;
        shares += all[i].start_m / (double)count;
        good += share_of(all[i].aligned, all[i].observable) >= 0.85;
        values[i] = all[i].median_m;
        values[count + i] = all[i].median_deg;
        values[2 * count + i] = all[i].median_ratio;
        values[3 * count + i] = all[i].seconds;
        values[4 * count + i] = all[i].step_ms;
        if (!isnan(all[i].area_ratio))
            values[5 * count + compared++] = all[i].area_ratio;
    }
    sum.median_m = bench_median(values, count);
    sum.median_deg = bench_median(values + count, count);
    sum.median_ratio = bench_median(values + 2 * count, count);
    sum.area_ratio = bench_median(values + 5 * count, compared);
    bench_json_begin("align");
    print_common(s, &sum);
    bench_json_integer("arenas", (int64_t)count);
    bench_json_integer("arenas_85", good);
    bench_json_number("start_mean_m", shares);
    bench_json_number("seconds_median", bench_median(values + 3 * count, count));
    bench_json_number("step_ms_median", bench_median(values + 4 * count, count));
    bench_json_integer("pool_bytes", (int64_t)sum.pool_bytes);
    bench_json_true("summary");
    bench_json_end();
    free(values);
}

/* 1 when the settings can be run, or one line on standard error. */
static int is_method(const char *name)
{
    static const char *const names[] = {"default",   "gradient",   "icp",   "lum",
                                        "lum-alone", "sequential", "filter"};

    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strcmp(name, names[i]) == 0)
            return 1;
    return 0;
}

static int check(const settings *s)
{
    if (sim_scene_find(s->kind.scene) < 0) {
        fprintf(stderr, "bench/align: unknown scene '%s', expected one of cairn-arena's\n",
                s->kind.scene);
        return 0;
    }
    if (!is_method(s->method)) {
        fprintf(stderr, "bench/align: unknown method '%s', expected " METHODS "\n", s->method);
        return 0;
    }
    if (s->as_written && strncmp(s->method, "lum", 3) != 0 && strcmp(s->method, "gradient") != 0) {
        fprintf(stderr,
                "bench/align: --as-written with method %s, expected gradient, lum or lum-alone\n",
                s->method);
        return 0;
    }
    if (s->online && strcmp(s->method, "gradient") != 0) {
        fprintf(stderr, "bench/align: --online with method %s, expected gradient\n", s->method);
        return 0;
    }
    if (s->online && s->chain && !s->as_written) {
        fprintf(stderr, "bench/align: --online with --chain, expected --as-written, too\n");
        return 0;
    }
    if (s->chain && s->again && s->online) {
        fprintf(stderr, "bench/align: --return with --online and --chain, which have no start: "
                        "expected without\n");
        return 0;
    }
    if ((s->ablate || s->growth) && strcmp(s->method, "default") != 0) {
        fprintf(stderr, "bench/align: --ablate and --growth are for method default\n");
        return 0;
    }
    return 1;
}

/* All arenas by one method; prints a line for each. */
static int run_all(const settings *s, outcome *all)
{
    for (int64_t i = 0; i < s->arenas; i++) {
        if (!run_arena(s, (uint64_t)(s->seed + i), &all[i]))
            return 0;
        bench_json_begin("align");
        bench_json_integer("arena", s->seed + i);
        print_common(s, &all[i]);
        bench_json_number("seconds", all[i].seconds);
        bench_json_number("step_ms", all[i].step_ms);
        bench_json_integer("steps", all[i].steps);
        bench_json_end();
    }
    print_summary(s, all, (size_t)s->arenas);
    return 1;
}

static settings standard_settings(void)
{
    return (settings){.kind = bench_problem_kind_default(),
                      .arenas = 20,
                      .seed = 1,
                      .steps = 50,
                      .within = {0.05, 1}};
}

/* Those of --rooms-joined: 16 full scans of two rooms joined by one door. */
static settings settings_of_joined_rooms(void)
{
    settings s = standard_settings();

    s.kind.scene = "joined";
    s.kind.places = 16;
    s.kind.headings = 1;
    s.kind.fov = 360;
    s.kind.metres = 0.50;
    s.kind.degrees = 30;
    s.within[0] = 0.10;
    s.within[1] = 1.7;
    return s;
}

int main(int argc, char **argv)
{
    settings s = standard_settings();
    const char *given_method = NULL;
    const option table[] = {
        OPTION_INTEGER("--arenas", &s.arenas, 1, 10000, "N", "arenas"),
        OPTION_INTEGER("--seed", &s.seed, 0, 9e15, "N", "of the first arena; the others follow"),
        OPTION_NUMBER("--trans", &s.kind.metres, 0.001, 10, "M",
                      "disturbance of x and y, uniform +-, m"),
        OPTION_NUMBER("--rot", &s.kind.degrees, 0.01, 180, "DEG",
                      "disturbance of the heading, uniform +-, degrees"),
        OPTION_TEXT("--method", &given_method, "NAME",
                    "default, gradient (as in the thesis), icp, lum, lum-alone: without "
                    "registration, sequential: scan by "
                    "scan by the mapper, filter: by 30 particles (default)"),
        OPTION_FLAG("--as-written", &s.as_written,
                    "as the thesis has it: gradient (chapter 7, the default then), lum and "
                    "lum-alone (10, the same then)"),
        OPTION_FLAG("--online", &s.online,
                    "scan after scan, each against all before (section 7.3.6), with --as-written "
                    "or method gradient"),
        OPTION_TEXT("--scene", &s.kind.scene, "NAME", "scene of the arenas (rescue)"),
        OPTION_PAIR("--size", s.kind.size, 0, 60, "W,H",
                    "of the arenas, m; 0: the scene's own (0,0)"),
        OPTION_INTEGER("--places", &s.kind.places, 1, 1000, "N", "places with scans"),
        OPTION_INTEGER("--headings", &s.kind.headings, 1, 64, "N", "scans at each place"),
        OPTION_NUMBER("--fov", &s.kind.fov, 1, 360, "DEG", "field of view, degrees"),
        OPTION_INTEGER("--beams", &s.kind.beams, 2, 100000, "N", "beams of a scan"),
        OPTION_PAIR("--jitter", s.kind.jitter, 0, 360, "M,DEG",
                    "spread of the sensors of one place, m and degrees"),
        OPTION_PAIR("--within", s.within, 0.001, 180, "M,DEG",
                    "of the truth, to be aligned (0.05,1)"),
        OPTION_INTEGER("--steps", &s.steps, 1, 100000, "N",
                       "iterations of gradient and lum at most"),
        OPTION_FLAG("--return", &s.again, "disturbs the solution, too, and aligns it again"),
        OPTION_FLAG("--chain", &s.chain,
                    "poses from nothing: the scans of each place matched as a whole, then the "
                    "method; as written by shape "
                    "(chapter 6), with --online place after place"),
        OPTION_PAIR("--sub-error", s.sub_error, 0, 10, "M,DEG",
                    "of the poses within a place, for --chain (0,0)"),
        OPTION_FLAG("--rooms-joined", &s.rooms_joined,
                    "other defaults: --scene joined --places 16 --headings 1 --fov 360 --trans 0.5 "
                    "--rot 30 --within 0.1,1.7"),
        OPTION_FLAG("--ablate", &s.ablate, "all arenas again without each ingredient of default"),
        OPTION_FLAG("--growth", &s.growth,
                    "time and units alone, of each arena and of one of twice its width and height "
                    "with four times its places"),
    };
    const option_set set = {"bench/align", "[options]",
                            "Alignment of all scans of simulated arenas at once.", table,
                            sizeof table / sizeof *table};
    outcome *all;
    size_t words = 0;
    option_result read = options_read(&set, argc, argv, NULL, &words);

    if (read == OPTIONS_READ && s.rooms_joined) {
        s = settings_of_joined_rooms();
        read = options_read(&set, argc, argv, NULL, &words);
    }
    if (read != OPTIONS_READ)
        return read;
    s.method = given_method != NULL ? given_method : s.as_written ? "gradient" : "default";
    if (!check(&s))
        return 2;
    if (s.growth)
        return !bench_growth(&s.kind, s.arenas, s.seed);
    all = malloc((size_t)s.arenas * sizeof *all);
    if (all == NULL) {
        fprintf(stderr, "bench/align: no memory for %" PRId64 " arenas\n", s.arenas);
        return 1;
    }
    do {
        if (!run_all(&s, all)) {
            free(all);
            return 1;
        }
        s.without++;
    } while (s.ablate && s.without < BENCH_INGREDIENTS);
    free(all);
    return 0;
}
