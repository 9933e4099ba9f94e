/* bench/match: maps of simulated arenas from places without any odometry.
 *
 * 16 places with four scans of 100 degrees each; the poses of the scans within a place are known (or wrong by --sub-error),
 * how the places lie to each other is not, and the mapper is not given it. A place is right when it lies within 0.10 m and 2
 * degrees of the truth after the best common motion, an arena when all its places are; silently wrong
 * when it does not but is in the largest part and not called ambiguous. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_json.h"
#include "bench/bench_places.h"
#include "bench/bench_score.h"
#include "cairn/place_map.h"
#include "cairn/random.h"
#include "tools/options.h"

#define DEGREE 0.017453292519943295

enum { HEADINGS = 4 };

static const double APART = 1000; /* m, between an arena and a strange one */
static const uint64_t STRANGE_SEED = 1000000;
static const double RIGHT_M = 0.10, RIGHT_RAD = 2 * DEGREE;

typedef struct settings {
    const char *method, *scene, *pictures;
    int64_t arenas, seed, places;
    double tilt, movers;
    double sub_error[2]; /* m, degrees */
    int32_t decoupled, by_icp, walkers, ablate, strangers;
} settings;

/* What a mapper is given of an arena, or of two that have nothing to do with each other, and the truth that it is not. */
typedef struct problem {
    sim_arena *arena[2];
    sim_survey *survey[2];
    sim_scan *scans;
    int32_t scan_count, place_count;
    double bad_share;       /* of the beams: on movers or the floor */
    cairn_pose *place_scan; /* [scan_count] as the mapper is told */
    sim_pose *truth;        /* [scan_count] */
    int32_t *first_scan;    /* [place_count] */
} problem;

typedef struct outcome {
    int32_t places, right, silently_wrong, parts, ambiguous, ok;
    double median_m, median_deg;           /* of places */
    double scan_median_m, scan_median_deg; /* of scans */
    double seconds, total, rival;
    size_t pool_bytes;
} outcome;

/* ---- Problems ---- */

static double share_of_bad_beams(const problem *p)
{
    int64_t bad = 0, all = 0;

    for (int32_t k = 0; k < p->scan_count; k++)
        for (int32_t i = 0; i < p->scans[k].count; i++) {
            bad += p->scans[k].edge[i] == SIM_MOVER || p->scans[k].edge[i] == SIM_FLOOR;
            all++;
        }
    return all > 0 ? (double)bad / (double)all : 0;
}

static void free_problem(problem *p)
{
    for (int k = 0; k < 2; k++) {
        sim_survey_free(p->survey[k]);
        sim_arena_free(p->arena[k]);
    }
    free(p->scans);
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

/* Surveys an arena; its places follow those that are there, and lie far from them. */
static int add_survey(const settings *s, uint64_t seed, int32_t index, int32_t places, problem *p)
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
    survey_options.headings = HEADINGS;
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
        scan->truth.x += APART * index;
    }
    return 1;
}

static int make_problem(const settings *s, uint64_t seed, problem *p)
{
    int32_t strange = s->strangers;
    int done;
    size_t n;

    memset(p, 0, sizeof *p);
    done = add_survey(s, seed, 0, (int32_t)s->places - strange, p) &&
           (strange == 0 || add_survey(s, seed + STRANGE_SEED, 1, strange, p));
    n = (size_t)p->scan_count;
    if (done) {
        p->bad_share = share_of_bad_beams(p);
        p->place_scan = malloc(n * sizeof *p->place_scan);
        p->truth = malloc(n * sizeof *p->truth);
        p->first_scan = malloc(n * sizeof *p->first_scan);
        done = p->place_scan != NULL && p->truth != NULL && p->first_scan != NULL;
    }
    if (done)
        place_scans(s, seed, p);
    else
        free_problem(p);
    return done;
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
        for (int32_t i = 0; i < p->place_count; i++) {
            int right = bench_pose_near(truth[i], places[i], RIGHT_M, RIGHT_RAD);

            out->right += use[i] && right;
            out->silently_wrong += use[i] && !right && !cairn_place_map_place_of(m->map, i).ambiguous;
        }
        bench_pose_errors(truth, places, p->place_count, metres, degrees);
        out->median_m = bench_median(metres, (size_t)p->place_count);
        out->median_deg = bench_median(degrees, (size_t)p->place_count);
        /* the same motion for the scans: moved_first * first^-1 */
        move = bench_pose_compose(places[0], bench_pose_between(before, (sim_pose){0, 0, 0}));
        for (int32_t k = 0; k < p->scan_count; k++)
            poses[k] = bench_pose_compose(move, sim_pose_of(cairn_place_map_scan_pose(m->map, k)));
        bench_pose_errors(p->truth, poses, p->scan_count, metres, degrees);
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
        const sim_pose *const all[BENCH_PANELS] = {others, others + n, poses, p->truth};

        for (size_t k = 0; k < n; k++)
            others[k] = p->scans[k].odometry;
        done = bench_draw_maps(s->pictures, seed, p->scans, p->scan_count, all) &&
               bench_draw_errors(s->pictures, seed, p->scans, p->scan_count, poses);
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
        bench_json_integer("silently_wrong", out->silently_wrong);
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

/* ---- Ablation: the method of chapter 6 after each of its stages ---- */

enum { STAGES = 4, BEFORE = 3, ABLATED_POINTS = 4096 };

static const double RIGHT_PAIR = 0.25; /* m between the points of a right correspondence, the query in its true place */

typedef struct ablation {
    int64_t pairs, pairs_right, matches, right, within_half;
} ablation;

/* The points of the scans of a place, in the frame of another place by the truth. */
static int32_t points_of_place(const problem *p, machine *m, int32_t place, int32_t seen_from,
                               cairn_oriented_point *out)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    int32_t count = 0;

    for (int32_t k = p->first_scan[place]; k < p->scan_count && p->scans[k].place == place; k++) {
        cairn_scan_input input = sim_scan_input(&p->scans[k]);
        sim_pose seen = bench_pose_between(p->truth[p->first_scan[seen_from]], p->truth[k]);
        cairn_pose pose = {(cairn_real)seen.x, (cairn_real)seen.y, (cairn_real)seen.theta};
        cairn_transform t = cairn_transform_of(pose);
        cairn_scan_view view;

        if (cairn_scan_begin(m->scan, &input, NULL) != CAIRN_OK)
            continue;
        while (cairn_scan_step(m->scan, &budget) == CAIRN_MORE)
            budget.left = CAIRN_UNBOUNDED;
        view = cairn_scan_read(m->scan);
        for (int32_t i = 0; i < view.point_count && count < ABLATED_POINTS; i++) {
            out[count].position = cairn_transform_point(t, view.points[i].position);
            out[count++].direction = cairn_transform_direction(t, view.points[i].direction);
        }
    }
    return count;
}

/* Matches a place with the union of the last three in their true places, the heading known, as in the thesis. Both point
 * sets are in the frame of the place, but for the target's shift. */
static int ablate_match(cairn_scan_match *match, const cairn_oriented_point *query, int32_t count,
                        const cairn_oriented_point *target, int32_t target_count, cairn_pose shift, ablation *out)
{
    const cairn_scan_match_window window = {20, 0};
    cairn_scan_match_part asked = {query, NULL, NULL, count, 0, 0}, known = {target, NULL, NULL, target_count, 0, 0};
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_scan_match_result found;
    cairn_status status;

    cairn_scan_match_clear_target(match);
    if (cairn_scan_match_add_target(match, &known, shift, NULL) != CAIRN_OK ||
        cairn_scan_match_begin(match, &asked, cairn_pose_identity(), &window, NULL) != CAIRN_OK)
        return 0;
    while ((status = cairn_scan_match_step(match, &budget)) == CAIRN_MORE)
        budget.left = CAIRN_UNBOUNDED;
    for (int32_t i = 0; i < cairn_scan_match_pair_count(match); i++) {
        cairn_scan_match_pair pair = cairn_scan_match_pair_at(match, i);
        cairn_vec2 apart = cairn_vec2_sub(query[pair.query].position, target[pair.target].position);

        out->pairs += pair.stage == CAIRN_SCAN_MATCH_KEPT;
        out->pairs_right += pair.stage == CAIRN_SCAN_MATCH_KEPT && (double)cairn_vec2_norm(apart) < RIGHT_PAIR;
    }
    found = cairn_scan_match_read(match);
    out->matches++;
    if (found.count > 0) {
        sim_pose pose = sim_pose_of(found.hypotheses[0].target_query), right = sim_pose_of(shift);

        out->right += bench_pose_near(right, pose, RIGHT_M, RIGHT_RAD);
        out->within_half += bench_pose_near(right, pose, 0.5, 10 * DEGREE);
    }
    return status == CAIRN_OK;
}

static int ablate_arena(const settings *s, uint64_t seed, cairn_scan_match *const match[STAGES], ablation *out)
{
    static cairn_oriented_point query[ABLATED_POINTS], target[(BEFORE + 1) * ABLATED_POINTS];
    cairn_place_map_params params = params_of(s);
    machine m = {NULL, 0, NULL, NULL};
    cairn_random random = cairn_random_seed(seed, 92);
    problem p;
    int done;

    if (!make_problem(s, seed, &p))
        return 0;
    done = make_machine(&params, &m);
    for (int32_t place = BEFORE; place < p.place_count && done; place++) {
        int32_t count = points_of_place(&p, &m, place, place, query), target_count = 0;
        cairn_pose shift = {2 * cairn_random_uniform(&random, -1, 1), 2 * cairn_random_uniform(&random, -1, 1), 0};

        for (int32_t i = place - BEFORE; i < place; i++)
            target_count += points_of_place(&p, &m, i, place, target + target_count);
        for (int k = 0; k < STAGES && done; k++)
            done = ablate_match(match[k], query, count, target, target_count, shift, &out[k]);
    }
    free(m.memory);
    free_problem(&p);
    return done;
}

static void print_ablation(const settings *s, const ablation *all)
{
    static const char *const names[STAGES] = {"common subsequence", "+ colinear filter", "+ segment filter", "+ ICP"};

    for (int k = 0; k < STAGES; k++) {
        double matches = (double)(all[k].matches > 0 ? all[k].matches : 1);
        double pairs = (double)(all[k].pairs > 0 ? all[k].pairs : 1);

        bench_json_begin("match");
        bench_json_text("ablation", names[k]);
        bench_json_integer("arenas", s->arenas);
        bench_json_integer("matches", all[k].matches);
        bench_json_number("correspondences", (double)all[k].pairs / matches);
        bench_json_number("correspondences_right", (double)all[k].pairs_right / pairs);
        bench_json_number("near", (double)all[k].within_half / matches);
        bench_json_number("success", (double)all[k].right / matches);
        bench_json_end();
    }
}

static int ablate(const settings *s)
{
    static const cairn_scan_match_mode modes[STAGES] = {CAIRN_SCAN_MATCH_SHAPE_COMMON, CAIRN_SCAN_MATCH_SHAPE_COLINEAR,
                                                        CAIRN_SCAN_MATCH_SHAPE_SEGMENTS, CAIRN_SCAN_MATCH_SHAPE};
    cairn_scan_match_params params = cairn_scan_match_default();
    cairn_scan_match *match[STAGES];
    void *memory[STAGES] = {NULL};
    ablation all[STAGES];
    int done = 1;

    memset(all, 0, sizeof all);
    params.max_target = (BEFORE + 1) * ABLATED_POINTS;
    params.max_query = ABLATED_POINTS;
    for (int k = 0; k < STAGES && done; k++) {
        cairn_pool pool;
        size_t bytes;

        params.mode = modes[k];
        bytes = cairn_scan_match_memory(&params) + CAIRN_ALIGN;
        memory[k] = malloc(bytes);
        done = memory[k] != NULL && cairn_pool_init(&pool, memory[k], bytes) == CAIRN_OK &&
               cairn_scan_match_create(&match[k], &pool, &params) == CAIRN_OK;
    }
    for (int64_t i = 0; i < s->arenas && done; i++)
        done = ablate_arena(s, (uint64_t)(s->seed + i), match, all);
    if (done)
        print_ablation(s, all);
    for (int k = 0; k < STAGES; k++)
        free(memory[k]);
    return done;
}

/* ---- Output ---- */

static void print_summary(const settings *s, const outcome *all, size_t count)
{
    double *values = malloc(5 * count * sizeof *values);
    int64_t ok = 0, right = 0, places = 0, ambiguous = 0, silently_wrong = 0;

    if (values == NULL)
        return;
    for (size_t i = 0; i < count; i++) {
        ok += all[i].ok;
        right += all[i].right;
        places += all[i].places;
        ambiguous += all[i].ambiguous;
        silently_wrong += all[i].silently_wrong;
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
    bench_json_integer("silently_wrong", silently_wrong);
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
    if (s->strangers >= s->places) {
        fprintf(stderr, "bench/match: %d strangers, expected fewer than the places\n", (int)s->strangers);
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
    settings s = {"consensus", "rescue", NULL, 20, 1, 16, 0, 0, {0, 0}, 0, 0, 0, 0, 0};
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
        OPTION_TEXT("--pictures", &s.pictures, "DIR", "draws match-SEED.svg and errors-SEED.svg into a folder"),
        OPTION_FLAG("--decoupled", &s.decoupled, "at the end every scan is aligned by itself, all at once"),
        OPTION_FLAG("--ablate", &s.ablate, "the method of chapter 6 after each of its stages instead"),
        OPTION_COUNT("--strangers", &s.strangers, 0, 255, "N", "so many of the places are of another arena"),
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
    return (s.ablate ? ablate(&s) : run(&s)) ? 0 : 1;
}
