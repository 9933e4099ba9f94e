/* bench/match: maps of simulated arenas from places without any odometry.
 *
 * 16 places with four scans of 100 degrees each; the poses of the scans within a place are known (or wrong by --sub-error),
 * how the places lie to each other is not, and the mapper is not given it. A place is right when it lies within 0.10 m and 2
 * degrees of the truth after the best common motion, an arena when all its places are. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "bench/bench_score.h"
#include "cairn/place_map.h"
#include "cairn/random.h"
#include "cairn/report.h"
#include "tools/options.h"

#define DEGREE 0.017453292519943295

enum { HEADINGS = 4 };

static const double RIGHT_M = 0.10, RIGHT_RAD = 2 * DEGREE;

typedef struct settings {
    const char *method, *scene, *pictures;
    int64_t arenas, seed, places;
    double tilt, movers;
    double sub_error[2]; /* m, degrees */
    int32_t decoupled, by_icp, walkers;
} settings;

/* What a mapper is given of an arena, and the truth that it is not. */
typedef struct problem {
    sim_arena *arena;
    sim_survey *survey;
    const sim_scan *scans;
    int32_t scan_count, place_count;
    double bad_share;       /* of the beams: on movers or the floor */
    cairn_pose *place_scan; /* [scan_count] as the mapper is told */
    sim_pose *truth;        /* [scan_count] */
    int32_t *first_scan;    /* [place_count] */
} problem;

typedef struct outcome {
    int32_t places, right, parts, ambiguous, ok;
    double median_m, median_deg;           /* of places */
    double scan_median_m, scan_median_deg; /* of scans */
    double seconds, total, rival;
    size_t pool_bytes;
} outcome;

/* ---- Problems ---- */

static double share_of_bad_beams(const sim_survey *survey)
{
    int32_t count;
    const sim_scan *scans = sim_survey_scans(survey, &count);
    int64_t bad = 0, all = 0;

    for (int32_t k = 0; k < count; k++)
        for (int32_t i = 0; i < scans[k].count; i++) {
            bad += scans[k].edge[i] == SIM_MOVER || scans[k].edge[i] == SIM_FLOOR;
            all++;
        }
    return all > 0 ? (double)bad / (double)all : 0;
}

static void free_problem(problem *p)
{
    sim_survey_free(p->survey);
    sim_arena_free(p->arena);
    free(p->place_scan);
    free(p->truth);
    free(p->first_scan);
}

/* Where the scans lie in their places, by the truth and the error that is asked for. */
static void place_scans(const settings *s, uint64_t seed, problem *p)
{
    cairn_random random = cairn_random_seed(seed, 91);

    for (int32_t k = 0; k < p->scan_count; k++) {
        int32_t place = p->scans[k].place;
        sim_pose seen;

        p->truth[k] = p->scans[k].truth;
        if (place == p->place_count)
            p->first_scan[p->place_count++] = k;
        seen = bench_pose_between(p->truth[p->first_scan[place]], p->truth[k]);
        if (k != p->first_scan[place]) {
            seen.x += (double)cairn_random_uniform(&random, -1, 1) * s->sub_error[0];
            seen.y += (double)cairn_random_uniform(&random, -1, 1) * s->sub_error[0];
            seen.theta += (double)cairn_random_uniform(&random, -1, 1) * s->sub_error[1] * DEGREE;
        }
        p->place_scan[k].x = (cairn_real)seen.x;
        p->place_scan[k].y = (cairn_real)seen.y;
        p->place_scan[k].theta = (cairn_real)seen.theta;
    }
}

static int make_problem(const settings *s, uint64_t seed, problem *p)
{
    sim_arena_options arena_options = sim_arena_default();
    sim_survey_options survey_options = sim_survey_default();
    char fault[256] = "no memory";

    memset(p, 0, sizeof *p);
    arena_options.seed = survey_options.seed = seed;
    arena_options.scene = sim_scene_find(s->scene);
    survey_options.places = (int32_t)s->places;
    survey_options.headings = HEADINGS;
    survey_options.tilt = s->tilt;
    survey_options.crowd = s->movers;
    survey_options.movers = s->walkers;
    p->arena = sim_arena_create(&arena_options, fault, sizeof fault);
    if (p->arena != NULL)
        p->survey = sim_survey_create(p->arena, &survey_options, fault, sizeof fault);
    if (p->survey != NULL) {
        size_t n;

        p->scans = sim_survey_scans(p->survey, &p->scan_count);
        p->bad_share = share_of_bad_beams(p->survey);
        n = (size_t)p->scan_count;
        p->place_scan = malloc(n * sizeof *p->place_scan);
        p->truth = malloc(n * sizeof *p->truth);
        p->first_scan = malloc(n * sizeof *p->first_scan);
        if (p->place_scan != NULL && p->truth != NULL && p->first_scan != NULL) {
            place_scans(s, seed, p);
            return 1;
        }
    }
    fprintf(stderr, "bench/match: %s\n", fault);
    free_problem(p);
    return 0;
}

/* ---- The method ---- */

/* Mapper and scan reader in one pool. */
typedef struct machine {
    void *memory;
    size_t bytes;
    cairn_scan *scan;
    cairn_place_map *map;
} machine;

static int make_machine(const cairn_place_map_params *params, machine *m)
{
    cairn_scan_params scan = cairn_scan_default();
    cairn_pool pool;

    m->bytes = cairn_scan_memory(&scan) + cairn_place_map_memory(params) + CAIRN_ALIGN;
    m->memory = malloc(m->bytes);
    return m->memory != NULL && cairn_pool_init(&pool, m->memory, m->bytes) == CAIRN_OK &&
           cairn_scan_create(&m->scan, &pool, &scan) == CAIRN_OK &&
           cairn_place_map_create(&m->map, &pool, params) == CAIRN_OK;
}

static int map_scans(const problem *p, machine *m)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_status status = CAIRN_OK;

    for (int32_t k = 0; k < p->scan_count && status == CAIRN_OK; k++) {
        cairn_scan_input input = sim_scan_input(&p->scans[k]);
        cairn_scan_view view;

        status = cairn_scan_begin(m->scan, &input, NULL);
        while (status == CAIRN_OK && cairn_scan_step(m->scan, &budget) == CAIRN_MORE)
            budget.left = CAIRN_UNBOUNDED;
        view = cairn_scan_read(m->scan);
        if (status == CAIRN_OK)
            status = cairn_place_map_add_scan(m->map, p->scans[k].place, &view, p->place_scan[k], NULL);
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

static sim_pose sim_pose_of(cairn_pose pose)
{
    sim_pose p = {(double)pose.x, (double)pose.y, (double)pose.theta};

    return p;
}

/* ---- Scoring ---- */

static void errors(const sim_pose *truth, const sim_pose *poses, int32_t count, double *metres, double *degrees)
{
    for (int32_t i = 0; i < count; i++) {
        metres[i] = hypot(poses[i].x - truth[i].x, poses[i].y - truth[i].y);
        degrees[i] = fabs(remainder(poses[i].theta - truth[i].theta, 2 * 3.14159265358979323846)) / DEGREE;
    }
}

/* poses: [scan_count] of the scans, moved onto the truth by the motion that suits most places. */
static int score(const problem *p, const machine *m, sim_pose *poses, outcome *out)
{
    size_t n = (size_t)p->scan_count;
    sim_pose *truth = malloc(n * sizeof *truth), *places = malloc(n * sizeof *places);
    int32_t *use = malloc(n * sizeof *use);
    double *metres = malloc(n * sizeof *metres), *degrees = malloc(n * sizeof *degrees);
    cairn_place_map_result result = cairn_place_map_read(m->map);
    int done = truth != NULL && places != NULL && use != NULL && metres != NULL && degrees != NULL;

    for (int32_t i = 0; i < p->place_count && done; i++) {
        cairn_place_map_place place = cairn_place_map_place_of(m->map, i);

        truth[i] = p->truth[p->first_scan[i]];
        places[i] = sim_pose_of(place.map_place);
        use[i] = place.part == 0;
    }
    if (done) {
        sim_pose before = places[0], move;

        out->places = p->place_count;
        (void)bench_fit_common(truth, places, use, p->place_count, RIGHT_M, RIGHT_RAD, places);
        for (int32_t i = 0; i < p->place_count; i++)
            out->right += use[i] && bench_pose_near(truth[i], places[i], RIGHT_M, RIGHT_RAD);
        errors(truth, places, p->place_count, metres, degrees);
        out->median_m = bench_median(metres, (size_t)p->place_count);
        out->median_deg = bench_median(degrees, (size_t)p->place_count);
        /* the same motion for the scans: moved_first * first^-1 */
        move = bench_pose_compose(places[0], bench_pose_between(before, (sim_pose){0, 0, 0}));
        for (int32_t k = 0; k < p->scan_count; k++)
            poses[k] = bench_pose_compose(move, sim_pose_of(cairn_place_map_scan_pose(m->map, k)));
        errors(p->truth, poses, p->scan_count, metres, degrees);
        out->scan_median_m = bench_median(metres, n);
        out->scan_median_deg = bench_median(degrees, n);
        out->parts = result.parts;
        out->ambiguous = result.ambiguous;
        out->total = (double)result.total;
        out->rival = (double)result.rival;
        out->ok = out->right == out->places;
    }
    free(truth);
    free(places);
    free(use);
    free(metres);
    free(degrees);
    return done;
}

static cairn_place_map_params params_of(const settings *s)
{
    cairn_place_map_params params = cairn_place_map_default();

    params.max_places = (int32_t)s->places;
    params.max_scans = HEADINGS * (int32_t)s->places;
    if (s->decoupled || s->by_icp)
        params.decoupled = s->decoupled ? CAIRN_PLACE_MAP_JOINTLY : CAIRN_PLACE_MAP_BY_ICP;
    if (strcmp(s->method, "sequential") == 0)
        params.mode = CAIRN_PLACE_MAP_SEQUENTIAL;
    if (strcmp(s->method, "shape") == 0) {
        params.mode = CAIRN_PLACE_MAP_SEQUENTIAL;
        params.match.mode = CAIRN_SCAN_MATCH_SHAPE;
    }
    return params;
}

/* ---- Pictures: the input by odometry, scan by scan, ours, the truth (as in Adluru 2008, figures 6.6 and 6.7) ---- */

enum { PANELS = 4 };

static const char *const PANEL_TITLES[PANELS] = {"odometry", "in sequence", "cairn", "truth"};

/* End points of the beams of all scans, in the frames of the scans: scans[k].point into one array; NULL: no memory. */
static cairn_vec2 *hits_of(const problem *p, cairn_report_scan *scans)
{
    size_t beams = 0, used = 0;
    cairn_vec2 *points;

    for (int32_t k = 0; k < p->scan_count; k++)
        beams += (size_t)p->scans[k].count;
    points = malloc(beams * sizeof *points);
    for (int32_t k = 0; k < p->scan_count && points != NULL; k++) {
        const sim_scan *scan = &p->scans[k];

        memset(&scans[k], 0, sizeof scans[k]);
        scans[k].point = points + used;
        for (int32_t i = 0; i < scan->count; i++) {
            double angle = scan->angle_min + i * scan->angle_step, range = (double)scan->range[i];
            sim_pose end = {range * cos(angle), range * sin(angle), 0};

            if (!isfinite(range))
                continue;
            end = bench_pose_compose(scan->base_sensor, end);
            points[used].x = (cairn_real)end.x;
            points[used++].y = (cairn_real)end.y;
            scans[k].point_count++;
        }
    }
    return points;
}

/* The poses of one panel, and their errors as its note. */
static void fill_panel(const problem *p, const sim_pose *poses, const char *title, char *note, size_t note_size,
                       cairn_pose *out, cairn_report_panel *panel)
{
    double metres = 0, degrees = 0, m, d;

    for (int32_t k = 0; k < p->scan_count; k++) {
        errors(&p->truth[k], &poses[k], 1, &m, &d);
        metres += m / p->scan_count;
        degrees += d / p->scan_count;
        out[k].x = (cairn_real)poses[k].x;
        out[k].y = (cairn_real)poses[k].y;
        out[k].theta = (cairn_real)poses[k].theta;
    }
    (void)snprintf(note, note_size, "mean error %.3f m, %.2f degrees", metres, degrees);
    memset(panel, 0, sizeof *panel);
    panel->title = title;
    panel->note = note;
    panel->pose = out;
}

static int draw(const settings *s, const problem *p, uint64_t seed, sim_pose *const poses[PANELS])
{
    size_t n = (size_t)p->scan_count;
    cairn_report_map picture = cairn_report_map_default();
    cairn_report_panel panels[PANELS];
    cairn_report_scan *scans = malloc(n * sizeof *scans);
    cairn_pose *copies = malloc(PANELS * n * sizeof *copies);
    cairn_vec2 *points = scans != NULL ? hits_of(p, scans) : NULL;
    char notes[PANELS][80], path[512];
    cairn_file_error error;
    int done = 0;

    if (points != NULL && copies != NULL) {
        for (int k = 0; k < PANELS; k++)
            fill_panel(p, poses[k], PANEL_TITLES[k], notes[k], sizeof notes[k], copies + (size_t)k * n, &panels[k]);
        picture.title = "Places without odometry";
        picture.panel = panels;
        picture.panel_count = PANELS;
        picture.scan = scans;
        picture.scan_count = p->scan_count;
        (void)snprintf(path, sizeof path, "%s/match-%" PRIu64 ".svg", s->pictures, seed);
        done = cairn_report_map_write(path, &picture, &error) == CAIRN_OK;
        if (!done)
            fprintf(stderr, "bench/match: cannot write %s\n", path);
    }
    free(scans);
    free(copies);
    free(points);
    return done;
}

/* Maps the places one after the other for comparison, and draws all. poses: ours. */
static int draw_arena(const settings *s, const problem *p, uint64_t seed, sim_pose *poses)
{
    cairn_place_map_params params = params_of(s);
    machine m = {NULL, 0, NULL, NULL};
    size_t n = (size_t)p->scan_count;
    sim_pose *others = malloc(2 * n * sizeof *others);
    outcome unused;
    int done = 0;

    memset(&unused, 0, sizeof unused);
    params.mode = CAIRN_PLACE_MAP_SEQUENTIAL;
    if (others != NULL && make_machine(&params, &m) && map_scans(p, &m) && score(p, &m, others + n, &unused)) {
        sim_pose *const all[PANELS] = {others, others + n, poses, p->truth};

        for (size_t k = 0; k < n; k++)
            others[k] = p->scans[k].odometry;
        done = draw(s, p, seed, all);
    }
    free(others);
    free(m.memory);
    return done;
}

static int run_arena(const settings *s, uint64_t seed, outcome *out)
{
    cairn_place_map_params params = params_of(s);
    problem p;
    machine m = {NULL, 0, NULL, NULL};
    sim_pose *poses = NULL;
    int done = 0;

    memset(out, 0, sizeof *out);
    if (!make_problem(s, seed, &p))
        return 0;
    if (make_machine(&params, &m)) {
        double start = bench_seconds();

        poses = malloc((size_t)p.scan_count * sizeof *poses);
        done = poses != NULL && map_scans(&p, &m);
        out->seconds = bench_seconds() - start;
        out->pool_bytes = m.bytes;
        done = done && score(&p, &m, poses, out);
    }
    if (done) {
        bench_json_begin("match");
        bench_json_integer("arena", (int64_t)seed);
        bench_json_text("method", s->method);
        bench_json_number("bad_beams", p.bad_share);
        bench_json_integer("places", out->places);
        bench_json_integer("right", out->right);
        bench_json_integer("parts", out->parts);
        bench_json_integer("ambiguous", out->ambiguous);
        bench_json_number("trans_m", out->median_m);
        bench_json_number("rot_deg", out->median_deg);
        bench_json_number("scan_trans_m", out->scan_median_m);
        bench_json_number("scan_rot_deg", out->scan_median_deg);
        bench_json_number("total", out->total);
        bench_json_number("rival", out->rival);
        bench_json_number("seconds", out->seconds);
        bench_json_end();
    }
    if (done && s->pictures != NULL)
        done = draw_arena(s, &p, seed, poses);
    free(poses);
    free(m.memory);
    free_problem(&p);
    return done;
}

/* ---- Output ---- */

static void print_summary(const settings *s, const outcome *all, size_t count)
{
    double *values = malloc(5 * count * sizeof *values);
    int64_t ok = 0, right = 0, places = 0, ambiguous = 0;

    if (values == NULL)
        return;
    for (size_t i = 0; i < count; i++) {
        ok += all[i].ok;
        right += all[i].right;
        places += all[i].places;
        ambiguous += all[i].ambiguous;
        values[i] = all[i].median_m;
        values[count + i] = all[i].median_deg;
        values[2 * count + i] = all[i].seconds;
        values[3 * count + i] = all[i].scan_median_m;
        values[4 * count + i] = all[i].scan_median_deg;
    }
    bench_json_begin("match");
    bench_json_text("method", s->method);
    bench_json_text("scene", s->scene);
    bench_json_number("tilt", s->tilt);
    bench_json_number("movers", s->movers);
    bench_json_number("sub_error_m", s->sub_error[0]);
    bench_json_integer("decoupled", params_of(s).decoupled);
    bench_json_integer("arenas", (int64_t)count);
    bench_json_integer("arenas_ok", ok);
    bench_json_integer("places", places);
    bench_json_integer("places_right", right);
    bench_json_integer("ambiguous", ambiguous);
    bench_json_number("median_trans_m", bench_median(values, count));
    bench_json_number("median_rot_deg", bench_median(values + count, count));
    bench_json_number("seconds_median", bench_median(values + 2 * count, count));
    bench_json_number("scan_median_trans_m", bench_median(values + 3 * count, count));
    bench_json_number("scan_median_rot_deg", bench_median(values + 4 * count, count));
    bench_json_integer("pool_bytes", (int64_t)all[0].pool_bytes);
    bench_json_true("summary");
    bench_json_end();
    free(values);
}

/* 1 when the settings can be run, or one line on standard error. */
static int check(const settings *s)
{
    if (sim_scene_find(s->scene) < 0) {
        fprintf(stderr, "bench/match: unknown scene '%s', expected one of cairn-arena's\n", s->scene);
        return 0;
    }
    if (strcmp(s->method, "consensus") != 0 && strcmp(s->method, "sequential") != 0 &&
        strcmp(s->method, "shape") != 0) {
        fprintf(stderr, "bench/match: unknown method '%s', expected consensus, sequential or shape\n", s->method);
        return 0;
    }
    return 1;
}

static int run(const settings *s)
{
    outcome *all = malloc((size_t)s->arenas * sizeof *all);
    int done = all != NULL;

    for (int64_t i = 0; i < s->arenas && done; i++)
        done = run_arena(s, (uint64_t)(s->seed + i), &all[i]);
    if (done)
        print_summary(s, all, (size_t)s->arenas);
    free(all);
    return done;
}

int main(int argc, char **argv)
{
    settings s = {"consensus", "rescue", NULL, 20, 1, 16, 0, 0, {0, 0}, 0, 0, 0};
    const option table[] = {
        OPTION_INTEGER("--arenas", &s.arenas, 1, 10000, "N", "arenas"),
        OPTION_INTEGER("--seed", &s.seed, 0, 9e15, "N", "of the first arena; the others follow"),
        OPTION_TEXT("--method", &s.method, "NAME", "consensus, sequential or shape (consensus)"),
        OPTION_TEXT("--scene", &s.scene, "NAME", "scene of the arenas (rescue)"),
        OPTION_INTEGER("--places", &s.places, 2, 256, "N", "places with four scans each"),
        OPTION_NUMBER("--tilt", &s.tilt, 0, 0.3, "SHARE", "of the beams that hit the floor short"),
        OPTION_NUMBER("--movers", &s.movers, 0, 0.5, "SHARE", "of the beams of every scan that end on people"),
        OPTION_COUNT("--walkers", &s.walkers, 0, 100, "N", "people who walk about the arena"),
        OPTION_PAIR("--sub-error", s.sub_error, 0, 10, "M,DEG",
                    "scans within a place are off, uniform +-, m and degrees"),
        OPTION_TEXT("--pictures", &s.pictures, "DIR", "draws match-SEED.svg into an existing folder"),
        OPTION_FLAG("--decoupled", &s.decoupled, "at the end every scan is aligned by itself, all at once"),
        OPTION_FLAG("--decoupled-icp", &s.by_icp, "the same one after the other by ICP"),
    };
    const option_set set = {"bench/match", "[options]", "Maps of places without odometry.", table,
                            sizeof table / sizeof *table};
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
    return run(&s) ? 0 : 1;
}
