/* bench/quality: map quality during alignment, and correlation of entropy and likelihood with pose
 * errors.
 *
 * Every method starts from the same disturbed poses of the same arenas. A map is drawn of the poses
 * after each step, moved onto the truth by the best rigid alignment, so that all maps have the same
 * cells and quadrants. Its measures are the entropy, the log-likelihood of its beams and the mean
 * absolute errors E(x), E(y), E(theta), of the whole and of each quadrant: its cells, and the beams
 * and poses of the scans taken in it. A method that has ended keeps its last map.
 *
 * As in figure 10.6 of Adluru 2008, E(x), E(y) and E(theta) are also measured to each method's own
 * final poses (section 10.4.2: both trajectories moved so that their first poses are the identity).
 * They end at 0: how fast they get there is compared, no accuracy.
 *
 * How well entropy a cell, or likelihood a beam, predicts the mean distance of the scans from the
 * truth: see bench_predict. */
#include <inttypes.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_curves.h"
#include "bench/bench_json.h"
#include "bench/bench_predict.h"
#include "bench/bench_track.h"
#include "cairn/map_quality.h"
#include "src/host/base/degrees.h"
#include "tools/options.h"

enum { SAMPLES = BENCH_TRACK_SAMPLES, METHODS = BENCH_TRACK_METHODS };
enum { FIRST_STEPS = 50 }; /* of FFS in the thesis; a sample each */

typedef struct settings {
    bench_problem_kind kind;
    int64_t arenas, seed;
    /* m of a cell; probability; m: worse maps do not enter the correlations */
    double resolution, least, good;
    const char *svg;
    int32_t as_written;
} settings;

/* Measures of a map or of one quadrant: its cells, and the scans taken in it. */
typedef struct part {
    double entropy, likelihood;
    double x, y, theta, distance; /* m, degrees; NaN: no scan there */
} part;

/* Of one map. */
typedef struct figures {
    part whole, quadrant[CAIRN_MAP_QUALITY_QUADRANTS];
    double entropy_of_cell, likelihood_of_beam;
    /* to the method's own final poses: m, mean distance after the best common motion; m and
     * degrees, the errors of section 10.4.2 */
    double from_end, own_x, own_y, own_theta;
} figures;

/* One arena: the beams of its scans and the grid that all maps of it share. */
typedef struct scene {
    bench_problem problem;
    cairn_scan_beam **beams; /* [scans] */
    int32_t *beam_count;
    cairn_pose *truth;
    cairn_occupancy_grid_params layout;
    cairn_occupancy_grid *grid;
    void *memory;
} scene;

typedef struct study {
    figures *map;   /* [arenas][METHODS][SAMPLES] */
    int32_t *steps; /* [arenas][METHODS] */
    int32_t arenas;
} study;

static const figures *map_of(const study *s, int32_t arena, int32_t method, int32_t sample)
{
    return &s->map[((size_t)arena * METHODS + (size_t)method) * SAMPLES + (size_t)sample];
}

/* ---- One arena ---- */

static void close_scene(scene *s)
{
    for (int32_t i = 0; i < s->problem.count && s->beams != NULL; i++)
        free(s->beams[i]);
    free(s->beams);
    free(s->beam_count);
    free(s->truth);
    free(s->memory);
    bench_problem_close(&s->problem);
}

/* The beams of all scans, and the bounding box of their hits. */
static cairn_status keep_beams(scene *s, cairn_box *box)
{
    cairn_scan_params params = cairn_scan_default();
    cairn_status status = CAIRN_OK;
    cairn_scan *scan = NULL;
    cairn_pool pool;
    size_t bytes;
    void *memory;

    params.max_beams = s->problem.scans[0].count;
    bytes = cairn_scan_memory(&params) + CAIRN_ALIGN;
    memory = malloc(bytes);
    status = memory != NULL ? cairn_pool_init(&pool, memory, bytes) : CAIRN_NO_MEMORY;
    if (status == CAIRN_OK)
        status = cairn_scan_create(&scan, &pool, &params);
    for (int32_t i = 0; i < s->problem.count && status == CAIRN_OK; i++) {
        sim_pose t = s->problem.truth[i];
        cairn_transform map_scan;
        cairn_scan_view view;

        s->truth[i].x = (cairn_real)t.x;
        s->truth[i].y = (cairn_real)t.y;
        s->truth[i].theta = (cairn_real)t.theta;
        map_scan = cairn_transform_of(s->truth[i]);
        status = bench_fit_scan(scan, &s->problem.scans[i], &view);
        s->beam_count[i] = view.beam_count;
        s->beams[i] = malloc(((size_t)view.beam_count + 1) * sizeof **s->beams);
        if (s->beams[i] == NULL)
            status = CAIRN_NO_MEMORY;
        for (int32_t k = 0; k < view.beam_count && status == CAIRN_OK; k++) {
            s->beams[i][k] = view.beams[k];
            if (view.beams[k].kind == CAIRN_SCAN_BEAM_HIT)
                *box = cairn_box_extend(*box, cairn_transform_point(map_scan, view.beams[k].to));
        }
    }
    free(memory);
    return status;
}

static int open_scene(scene *s, const settings *set, uint64_t seed)
{
    cairn_box box = cairn_box_empty();
    cairn_pool pool;
    cairn_status status = CAIRN_NO_MEMORY;
    size_t n, bytes;

    memset(s, 0, sizeof *s);
    if (!bench_problem_open(&s->problem, &set->kind, seed))
        return 0;
    n = (size_t)s->problem.count;
    s->beams = calloc(n, sizeof(void *));
    s->beam_count = calloc(n, sizeof *s->beam_count);
    s->truth = calloc(n, sizeof *s->truth);
    if (s->beams != NULL && s->beam_count != NULL && s->truth != NULL)
        status = keep_beams(s, &box);
    if (status == CAIRN_OK) {
        box = cairn_box_grow(box, CAIRN_REAL(0.5));
        s->layout.resolution = (cairn_real)set->resolution;
        s->layout.origin = box.min;
        s->layout.width = (int32_t)ceil((double)(box.max.x - box.min.x) / set->resolution);
        s->layout.height = (int32_t)ceil((double)(box.max.y - box.min.y) / set->resolution);
        bytes = cairn_occupancy_grid_memory(&s->layout) + CAIRN_ALIGN;
        s->memory = malloc(bytes);
        status = s->memory != NULL ? cairn_pool_init(&pool, s->memory, bytes) : CAIRN_NO_MEMORY;
    }
    if (status == CAIRN_OK)
        status = cairn_occupancy_grid_create(&s->grid, &pool, &s->layout);
    if (status != CAIRN_OK)
        fprintf(stderr, "bench/quality: %s\n", cairn_status_text(status));
    return status == CAIRN_OK;
}

static int quadrant_of(const scene *s, cairn_pose p)
{
    int32_t half_width = s->layout.width / 2, half_height = s->layout.height / 2;
    int east = p.x >= s->layout.origin.x + (cairn_real)half_width * s->layout.resolution;
    int north = p.y >= s->layout.origin.y + (cairn_real)half_height * s->layout.resolution;

    return north  ? (east ? CAIRN_MAP_QUALITY_QUADRANT_NE : CAIRN_MAP_QUALITY_QUADRANT_NW)
           : east ? CAIRN_MAP_QUALITY_QUADRANT_SE
                  : CAIRN_MAP_QUALITY_QUADRANT_SW;
}

/* Draws the map of the poses; adds its entropy and the likelihood of its beams to *f. */
static cairn_status measure_map(scene *s, const cairn_pose *poses, double least, figures *f)
{
    cairn_map_quality_entropy entropy = {0};
    cairn_status status = CAIRN_OK;
    int64_t beams = 0;

    cairn_occupancy_grid_clear(s->grid);
    for (int32_t i = 0; i < s->problem.count && status == CAIRN_OK; i++) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        status =
            cairn_occupancy_grid_begin_scan(s->grid, s->beams[i], s->beam_count[i], poses[i], NULL);
        if (status == CAIRN_OK)
            status = cairn_occupancy_grid_step(s->grid, &budget);
    }
    if (status == CAIRN_OK)
        status = cairn_map_quality_entropy_add(s->grid, 0, s->layout.height, &entropy);
    f->whole.entropy = (double)entropy.total;
    f->entropy_of_cell = f->whole.entropy / (double)entropy.cells;
    for (int q = 0; q < CAIRN_MAP_QUALITY_QUADRANTS; q++)
        f->quadrant[q].entropy = (double)entropy.quadrant[q];
    for (int32_t i = 0; i < s->problem.count && status == CAIRN_OK; i++) {
        cairn_transform t = cairn_transform_of(poses[i]);
        part *own = &f->quadrant[quadrant_of(s, s->truth[i])];

        for (int32_t k = 0; k < s->beam_count[i] && status == CAIRN_OK; k++) {
            const cairn_scan_beam *beam = &s->beams[i][k];
            cairn_real value;

            if (beam->kind == CAIRN_SCAN_BEAM_UNKNOWN)
                continue;
            status = cairn_map_quality_beam_likelihood(
                s->grid, cairn_transform_point(t, beam->from), cairn_transform_point(t, beam->to),
                beam->kind == CAIRN_SCAN_BEAM_HIT, (cairn_real)least, &value);
            f->whole.likelihood += (double)value;
            own->likelihood += (double)value;
            beams++;
        }
    }
    f->likelihood_of_beam = f->whole.likelihood / (double)beams;
    return status;
}

static double distance_of(cairn_pose a, cairn_pose b)
{
    return hypot((double)(a.x - b.x), (double)(a.y - b.y));
}

static void add_errors(part *p, cairn_pose pose, cairn_pose truth)
{
    p->x += (double)cairn_abs(pose.x - truth.x);
    p->y += (double)cairn_abs(pose.y - truth.y);
    p->theta += (double)cairn_abs(cairn_wrap_angle(pose.theta - truth.theta)) / CAIRN_DEGREE;
    p->distance += distance_of(pose, truth);
}

static void take_means(part *p, int32_t scans)
{
    double of = scans > 0 ? scans : (double)NAN;

    p->x /= of;
    p->y /= of;
    p->theta /= of;
    p->distance /= of;
}

/* Adds the mean errors of the scans of each quadrant and of all to *f. */
static void measure_errors(const scene *s, const cairn_pose *poses, figures *f)
{
    int32_t scans[CAIRN_MAP_QUALITY_QUADRANTS] = {0};

    for (int32_t i = 0; i < s->problem.count; i++) {
        int q = quadrant_of(s, s->truth[i]);

        add_errors(&f->whole, poses[i], s->truth[i]);
        add_errors(&f->quadrant[q], poses[i], s->truth[i]);
        scans[q]++;
    }
    take_means(&f->whole, s->problem.count);
    for (int q = 0; q < CAIRN_MAP_QUALITY_QUADRANTS; q++)
        take_means(&f->quadrant[q], scans[q]);
}

/* Mean distance of two sets of poses after the best common motion; moved: [count], the first set
 * after it. */
static double move_onto(const cairn_pose *poses, const cairn_pose *onto, int32_t count,
                        cairn_pose *moved)
{
    cairn_pose motion = cairn_pose_fit(poses, onto, NULL, count, 1);
    double sum = 0;

    for (int32_t i = 0; i < count; i++) {
        moved[i] = cairn_pose_compose(motion, poses[i]);
        sum += distance_of(moved[i], onto[i]);
    }
    return sum / count;
}

/* Sets the errors to the method's own final poses. */
static cairn_status measure_own_errors(const cairn_pose *poses, const cairn_pose *end,
                                       int32_t count, figures *f)
{
    cairn_map_quality_pose_errors errors = {0, 0, 0};
    cairn_status status = cairn_map_quality_pose_errors_of(poses, end, count, &errors);

    f->own_x = (double)errors.x;
    f->own_y = (double)errors.y;
    f->own_theta = (double)errors.theta / CAIRN_DEGREE;
    return status;
}

/* Figures of all samples of one method; poses: sample by sample. */
static int measure_track(scene *s, const settings *set, const cairn_pose *poses, figures *map)
{
    int32_t count = s->problem.count;
    const cairn_pose *end = poses + (SAMPLES - 1) * count;
    size_t bytes = (size_t)count * sizeof *poses;
    cairn_pose *moved = malloc(bytes);
    cairn_status status = moved != NULL ? CAIRN_OK : CAIRN_NO_MEMORY;

    for (int32_t k = 0; k < SAMPLES && status == CAIRN_OK; k++) {
        const cairn_pose *now = poses + k * count;

        if (k > 0 && memcmp(now, now - count, bytes) == 0) {
            map[k] = map[k - 1];
            continue;
        }
        memset(&map[k], 0, sizeof map[k]);
        status = measure_own_errors(now, end, count, &map[k]);
        map[k].from_end = move_onto(now, end, count, moved);
        (void)move_onto(now, s->truth, count, moved);
        measure_errors(s, moved, &map[k]);
        if (status == CAIRN_OK)
            status = measure_map(s, moved, set->least, &map[k]);
    }
    free(moved);
    if (status != CAIRN_OK)
        fprintf(stderr, "bench/quality: %s\n", cairn_status_text(status));
    return status == CAIRN_OK;
}

static int run_arena(const settings *set, int32_t arena, study *all)
{
    scene s;
    cairn_pose *poses = NULL;
    int done = open_scene(&s, set, (uint64_t)(set->seed + arena));

    if (done) {
        poses = malloc((size_t)SAMPLES * (size_t)s.problem.count * sizeof *poses);
        done = poses != NULL;
    }
    for (int32_t m = 0; m < METHODS && done; m++) {
        size_t place = (size_t)arena * METHODS + (size_t)m;
        const figures *end = map_of(all, arena, m, SAMPLES - 1);

        done = bench_track_run(m, &s.problem, set->as_written, poses, &all->steps[place]) &&
               measure_track(&s, set, poses, all->map + place * SAMPLES);
        if (!done)
            break;
        bench_json_begin("quality");
        bench_json_integer("arena", set->seed + arena);
        bench_json_text("method", bench_track_name(m));
        bench_json_integer("steps", all->steps[place]);
        bench_json_number("entropy", end->whole.entropy);
        bench_json_number("log_likelihood", end->whole.likelihood);
        bench_json_number("e_x_m", end->whole.x);
        bench_json_number("e_y_m", end->whole.y);
        bench_json_number("e_theta_deg", end->whole.theta);
        bench_json_number("distance_m", end->whole.distance);
        bench_json_end();
    }
    free(poses);
    close_scene(&s);
    return done;
}

/* ---- Prediction of the error by a measure ---- */

static double entropy_of_cell(const figures *map)
{
    return map->entropy_of_cell;
}

static double likelihood_of_beam(const figures *map)
{
    return map->likelihood_of_beam;
}

static int predict(const study *all, const settings *set, double (*measure)(const figures *map),
                   bench_prediction *p)
{
    size_t maps = (size_t)all->arenas * METHODS * SAMPLES;
    double *values = malloc(maps * sizeof *values), *errors = malloc(maps * sizeof *errors);
    bench_predict_maps table = {values, errors, all->arenas, METHODS, SAMPLES, set->good};
    int done = values != NULL && errors != NULL;

    for (size_t k = 0; k < maps && done; k++) {
        values[k] = measure(&all->map[k]);
        errors[k] = all->map[k].whole.distance;
    }
    done = done && bench_predict(&table, (uint64_t)set->seed, p);
    free(values);
    free(errors);
    return done;
}

/* ---- Each method ---- */

/* The number at `offset` in the figures. */
static double number_of(const figures *f, size_t offset)
{
    double value;

    memcpy(&value, (const char *)f + offset, sizeof value);
    return value;
}

/* The first step from which on the number at `offset`, which ends at 0, stays within 1 % of that of
 * the start. */
static double settled(const study *all, int32_t arena, int32_t method, size_t offset)
{
    double start = number_of(map_of(all, arena, method, 0), offset);
    int32_t k = SAMPLES - 1;

    while (k > 0 && number_of(map_of(all, arena, method, k - 1), offset) <= 0.01 * start)
        k--;
    return bench_track_step(k);
}

/* Counts the steps among the first 50 that raise the number at `offset`; adds the total rise and
 * the total change. */
static int32_t rising_steps(const study *all, int32_t arena, int32_t method, size_t offset,
                            double *rise, double *change)
{
    int32_t rising = 0;

    for (int32_t k = 1; k <= FIRST_STEPS; k++) {
        double before = number_of(map_of(all, arena, method, k - 1), offset);
        double by = number_of(map_of(all, arena, method, k), offset) - before;

        rising += by > before * 1e-9;
        *rise += fmax(by, 0);
        *change += fabs(by);
    }
    return rising;
}

/* How often the quadrant of lower entropy by one of two methods has the lower error at the end,
 * too; adds to *agree and *compared. */
static void compare_quadrants(const study *all, int32_t arena, int32_t method, int32_t *agree,
                              int32_t *compared)
{
    const figures *a = map_of(all, arena, method, SAMPLES - 1);

    for (int32_t m = 0; m < METHODS; m++) {
        const figures *b = map_of(all, arena, m, SAMPLES - 1);

        for (int q = 0; q < CAIRN_MAP_QUALITY_QUADRANTS && m != method; q++) {
            double entropy = a->quadrant[q].entropy - b->quadrant[q].entropy;
            double error = a->quadrant[q].distance - b->quadrant[q].distance;

            if (!(entropy * error != 0) || !isfinite(error))
                continue;
            *agree += entropy * error > 0;
            (*compared)++;
        }
    }
}

static void print_key(bench_track_method method, const char *key, double value)
{
    char name[64];

    snprintf(name, sizeof name, "%s_%s", bench_track_name(method), key);
    bench_json_number(name, value);
}

/* E(x), E(y) and E(theta) to the method's own final poses: medians at the start and after the first
 * 50 steps, the median step from which on they stay within 1 % of the start, and in how many of the
 * first 50 steps they rise. values: [3 * arenas] */
static void print_own_errors(const study *all, bench_track_method method, double *values)
{
    static const struct {
        const char *name, *unit;
        size_t offset;
    } errors[] = {
        {"x", "m", offsetof(figures, own_x)},
        {"y", "m", offsetof(figures, own_y)},
        {"theta", "deg", offsetof(figures, own_theta)},
    };
    size_t arenas = (size_t)all->arenas;
    double *start = values, *at_50 = start + arenas, *settling = at_50 + arenas;
    char key[48];

    for (size_t e = 0; e < sizeof errors / sizeof *errors; e++) {
        size_t of = errors[e].offset;
        double rising = 0, rise = 0, change = 0;

        for (int32_t a = 0; a < all->arenas; a++) {
            start[a] = number_of(map_of(all, a, method, 0), of);
            at_50[a] = number_of(map_of(all, a, method, FIRST_STEPS), of);
            settling[a] = settled(all, a, method, of);
            rising += (double)rising_steps(all, a, method, of, &rise, &change) / all->arenas;
        }
        snprintf(key, sizeof key, "own_e_%s_start_%s_median", errors[e].name, errors[e].unit);
        print_key(method, key, bench_median(start, arenas));
        snprintf(key, sizeof key, "own_e_%s_at_50_%s_median", errors[e].name, errors[e].unit);
        print_key(method, key, bench_median(at_50, arenas));
        snprintf(key, sizeof key, "own_e_%s_iterations_to_1pct", errors[e].name);
        print_key(method, key, bench_median(settling, arenas));
        snprintf(key, sizeof key, "own_e_%s_rising_steps", errors[e].name);
        print_key(method, key, rising);
    }
}

static int print_methods(const study *all)
{
    size_t of_entropy = offsetof(figures, whole.entropy);
    double *values = malloc(4 * (size_t)all->arenas * sizeof *values);
    int32_t all_agree = 0, all_compared = 0;

    if (values == NULL)
        return 0;
    for (int32_t m = 0; m < METHODS; m++) {
        double *entropy = values + all->arenas, *likelihood = entropy + all->arenas,
               *distance = likelihood + all->arenas;
        int32_t agree = 0, compared = 0;
        double rising = 0, rise = 0, change = 0;

        for (int32_t a = 0; a < all->arenas; a++) {
            const figures *end = map_of(all, a, m, SAMPLES - 1);

            values[a] = settled(all, a, m, offsetof(figures, from_end));
            entropy[a] = end->whole.entropy;
            likelihood[a] = end->likelihood_of_beam;
            distance[a] = end->whole.distance;
            rising += (double)rising_steps(all, a, m, of_entropy, &rise, &change) / all->arenas;
            compare_quadrants(all, a, m, &agree, &compared);
        }
        print_key(m, "iterations_to_1pct", bench_median(values, (size_t)all->arenas));
        print_key(m, "rising_steps", rising);
        print_key(m, "rising_share", rise / change);
        print_key(m, "regional_agreement", compared > 0 ? (double)agree / compared : (double)NAN);
        print_key(m, "entropy_median", bench_median(entropy, (size_t)all->arenas));
        print_key(m, "log_likelihood_of_beam_median",
                  bench_median(likelihood, (size_t)all->arenas));
        print_key(m, "distance_m_median", bench_median(distance, (size_t)all->arenas));
        print_own_errors(all, m, values);
        all_agree += agree;
        all_compared += compared;
    }
    bench_json_number("regional_agreement",
                      all_compared > 0 ? (double)all_agree / all_compared : (double)NAN);
    free(values);
    return 1;
}

static int print_summary(const study *all, const settings *set, double seconds)
{
    bench_prediction entropy, likelihood;
    int done = predict(all, set, entropy_of_cell, &entropy) &&
               predict(all, set, likelihood_of_beam, &likelihood);

    if (!done)
        return 0;
    bench_json_begin("quality");
    bench_json_integer("arenas", all->arenas);
    bench_json_number("trans", set->kind.metres);
    bench_json_number("rot", set->kind.degrees);
    bench_predict_print("entropy", &entropy);
    bench_predict_print("likelihood", &likelihood);
    bench_json_integer("maps", entropy.maps);
    done = print_methods(all);
    bench_json_number("seconds", seconds);
    if (set->as_written)
        bench_json_true("as_written");
    bench_json_true("summary");
    bench_json_end();
    return done;
}

/* ---- The picture ---- */

/* Medians over the arenas of the number at `offset` in the figures. */
static void medians(const study *all, size_t offset, double *value, double *work)
{
    for (int32_t m = 0; m < METHODS; m++)
        for (int32_t k = 0; k < SAMPLES; k++) {
            size_t count = 0;

            for (int32_t a = 0; a < all->arenas; a++) {
                double v = number_of(map_of(all, a, m, k), offset);

                if (isfinite(v))
                    work[count++] = v;
            }
            value[m * SAMPLES + k] = bench_median(work, count);
        }
}

/* A row of panels: a measure of the whole map and of its four quadrants. */
#define ROW(title, field)                                                                          \
    {title, offsetof(figures, whole.field)},                                                       \
        {title ", north-west", offsetof(figures, quadrant[CAIRN_MAP_QUALITY_QUADRANT_NW].field)},  \
        {title ", north-east", offsetof(figures, quadrant[CAIRN_MAP_QUALITY_QUADRANT_NE].field)},  \
        {title ", south-west", offsetof(figures, quadrant[CAIRN_MAP_QUALITY_QUADRANT_SW].field)},  \
    {                                                                                              \
        title ", south-east", offsetof(figures, quadrant[CAIRN_MAP_QUALITY_QUADRANT_SE].field)     \
    }

static int draw(const study *all, const settings *set)
{
    static const struct {
        const char *title;
        size_t offset;
    } panels[] = {
        ROW("Entropy, nat", entropy),
        ROW("Log-likelihood of the beams", likelihood),
        ROW("E(x), m", x),
        ROW("E(y), m", y),
        ROW("E(\xCE\xB8), degrees", theta),
        ROW("Distance from the truth, m", distance),
        {"Distance from its own end, m", offsetof(figures, from_end)},
        {"E(x) to its own end, m", offsetof(figures, own_x)},
        {"E(y) to its own end, m", offsetof(figures, own_y)},
        {"E(\xCE\xB8) to its own end, degrees", offsetof(figures, own_theta)},
    };
    enum { PANELS = sizeof panels / sizeof *panels };
    double *value =
        malloc(((size_t)PANELS * METHODS * SAMPLES + (size_t)all->arenas) * sizeof *value);
    const char *method[METHODS];
    bench_curve_panel panel[PANELS];
    int32_t step[SAMPLES];
    char subtitle[256];
    bench_curves curves = {
        "Alignment step by step", subtitle, method, step, panel, METHODS, SAMPLES, PANELS, 5};
    cairn_file_error error;
    int done = value != NULL;

    for (int32_t k = 0; k < SAMPLES; k++)
        step[k] = bench_track_step(k);
    for (int32_t m = 0; m < METHODS; m++)
        method[m] = bench_track_name(m);
    for (int32_t p = 0; p < PANELS && done; p++) {
        double *of = value + p * METHODS * SAMPLES;

        medians(all, panels[p].offset, of, value + PANELS * METHODS * SAMPLES);
        panel[p].title = panels[p].title;
        panel[p].value = of;
    }
    snprintf(subtitle, sizeof subtitle,
             "medians of %" PRId32
             " arenas, poses disturbed by up to %g m and %g\xC2\xB0; steps 1 to 50 by 1, then to "
             "500 by 10",
             all->arenas, set->kind.metres, set->kind.degrees);
    if (done && bench_curves_write(set->svg, &curves, &error) != CAIRN_OK) {
        fprintf(stderr, "%s\n", error.text);
        done = 0;
    }
    free(value);
    return done;
}

static int run(const settings *set, study *all)
{
    double start = bench_seconds();

    for (int32_t a = 0; a < all->arenas; a++)
        if (!run_arena(set, a, all))
            return 0;
    return print_summary(all, set, bench_seconds() - start) && (set->svg == NULL || draw(all, set));
}

int main(int argc, char **argv)
{
    settings s = {bench_problem_kind_default(), 20, 1, 0.05, 1e-3, 0.15, NULL, 0};
    const char *unused = NULL;
    const option table[] = {
        OPTION_INTEGER("--arenas", &s.arenas, 1, 10000, "N", "arenas"),
        OPTION_INTEGER("--seed", &s.seed, 0, 9e15, "N", "of the first arena; the others follow"),
        OPTION_NUMBER("--trans", &s.kind.metres, 0.001, 10, "M",
                      "disturbance of x and y, uniform +-, m"),
        OPTION_NUMBER("--rot", &s.kind.degrees, 0.01, 180, "DEG",
                      "disturbance of the heading, uniform +-, degrees"),
        OPTION_INTEGER("--places", &s.kind.places, 1, 1000, "N", "places with scans"),
        OPTION_INTEGER("--headings", &s.kind.headings, 1, 64, "N", "scans at each place"),
        OPTION_NUMBER("--resolution", &s.resolution, 0.01, 1, "M", "side of a cell, m"),
        OPTION_NUMBER("--least", &s.least, 1e-9, 0.5, "P",
                      "probability of a beam that no map explains"),
        OPTION_NUMBER("--good", &s.good, 0.001, 100, "M",
                      "only maps with a smaller mean error are ranked, m"),
        OPTION_FLAG("--as-written", &s.as_written, "gradient and lum as the thesis has them"),
        OPTION_TEXT("--svg", &s.svg, "FILE", "the curves as a picture"),
        OPTION_TEXT("--data", &unused, "DIR", "not needed: the arenas are simulated"),
    };
    const option_set set = {"bench/quality", "[options]",
                            "Entropy, likelihood and pose errors of maps while methods align them.",
                            table, sizeof table / sizeof *table};
    size_t words = 0, n;
    option_result result = options_read(&set, argc, argv, NULL, &words);
    study all;
    int done;

    if (result != OPTIONS_READ)
        return (int)result;
    all.arenas = (int32_t)s.arenas;
    n = (size_t)all.arenas * METHODS;
    all.map = calloc(n * SAMPLES, sizeof *all.map);
    all.steps = calloc(n, sizeof *all.steps);
    done = all.map != NULL && all.steps != NULL;
    if (!done)
        fprintf(stderr, "bench/quality: no memory for %" PRId32 " arenas\n", all.arenas);
    done = done && run(&s, &all);
    free(all.map);
    free(all.steps);
    return done ? 0 : 1;
}
