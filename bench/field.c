/* bench/field: the experiments of chapter 7 of the thesis on force field simulation, on generated
 * scenes.
 *
 * - maze: 16 full scans, poses disturbed by 0.25 m and 20 degrees, 20 steps (section 7.4.4). Met:
 *   the
 *   mean errors in position and in heading fall to a fifth.
 * - apartment: a drive of 200 scans with a false loop closure, 150 steps (section 7.4.3). Met: the
 *   gap falls to a quarter and the potential rises in one of the first ten steps. A drive that does
 *   not return is not evaluated.
 * - rescue: 60 scans of 100 degrees, 50 steps (section 7.4.2). Met: no step raises the potential.
 * - corners: three scans of a corner each, 12 steps, compared with nearest neighbours (figure 7.6;
 *   bench_corners).
 *
 * Errors are those after the best common motion, by least squares over all scans. Potentials are
 * comparable only for one sigma: a step raises P when P of the poses after it exceeds that before
 * it, both at the sigma of the step, without regions of interest and with opposite faces
 * distinguished as in the step. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_corners.h"
#include "bench/bench_field.h"
#include "bench/bench_json.h"
#include "bench/bench_score.h"
#include "cairn/force_field.h"
#include "cairn/report.h"
#include "src/host/maps/capacity.h"
#include "tools/options.h"

typedef struct settings {
    const char *scene, *preset, *svg;
    int64_t arenas, seed;
    double spacing, sigma;
    double trans, rot;      /* m, degrees: of the start; NaN: the scene's own */
    double mass, dt_factor; /* of points in regions of interest, NaN: the mode's; factor of dt */
    int32_t as_written;
} settings;

typedef struct outcome {
    field_error start, end, moved;
    double start_gap, end_gap;
    double step_ms, potential_start, potential_end;
    int32_t scans, steps, rising, rising_first_10; /* steps in which the potential rose */
    int32_t evaluated, met;
    int32_t corners_dropped; /* the most of any step */
    size_t pool_bytes;
} outcome;

/* ---- The field ---- */

typedef struct views {
    cairn_scan_view *view; /* [count], with arrays of their own */
    int32_t count, segment_count, point_count;
} views;

static void *copy_of(const void *from, size_t bytes)
{
    void *to = malloc(bytes > 0 ? bytes : 1);

    if (to != NULL && bytes > 0)
        memcpy(to, from, bytes);
    return to;
}

static void views_free(views *v)
{
    for (int32_t i = 0; i < v->count && v->view != NULL; i++) {
        free((void *)v->view[i].segments);
        free((void *)v->view[i].first_point);
        free((void *)v->view[i].points);
    }
    free(v->view);
}

/* Fits the lines of all scans. */
static cairn_status views_make(views *v, const scene *s, double spacing)
{
    cairn_scan_params params = cairn_scan_default();
    cairn_scan *scan = NULL;
    cairn_pool pool;
    cairn_status status;
    size_t bytes;
    void *memory;

    params.max_beams = s->scans[0].count;
    params.spacing = (cairn_real)spacing;
    bytes = cairn_scan_memory(&params) + CAIRN_ALIGN;
    memory = malloc(bytes);
    memset(v, 0, sizeof *v);
    v->view = calloc((size_t)s->count, sizeof *v->view);
    status =
        memory == NULL || v->view == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(&pool, memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_scan_create(&scan, &pool, &params);
    for (; v->count < s->count && status == CAIRN_OK; v->count++) {
        cairn_scan_input input = sim_scan_input(&s->scans[v->count]);
        cairn_budget budget = {CAIRN_UNBOUNDED};
        cairn_scan_view *view = &v->view[v->count];

        status = cairn_scan_begin(scan, &input, NULL);
        if (status == CAIRN_OK)
            status = cairn_scan_step(scan, &budget);
        *view = cairn_scan_read(scan);
        view->segments =
            copy_of(view->segments, (size_t)view->segment_count * sizeof *view->segments);
        view->first_point = copy_of(view->first_point,
                                    ((size_t)view->segment_count + 1) * sizeof *view->first_point);
        view->points = copy_of(view->points, (size_t)view->point_count * sizeof *view->points);
        v->segment_count += view->segment_count;
        v->point_count += view->point_count;
        if (view->segments == NULL || view->first_point == NULL || view->points == NULL)
            status = CAIRN_NO_MEMORY;
    }
    free(memory);
    return status;
}

static void set_capacities(cairn_force_field_params *params, const views *v)
{
    params->max_scans = v->count;
    params->max_segments = v->segment_count + 1;
    params->max_corners = CAIRN_CAPACITY_CORNERS_PER_SEGMENT * params->max_segments;
    params->max_points = v->point_count + 1;
    params->max_bonds = v->count * (v->count - 1) / 2;
}

static cairn_status field_make(cairn_force_field **field, cairn_pool *pool,
                               const cairn_force_field_params *params, void **memory)
{
    size_t bytes = cairn_force_field_memory(params) + CAIRN_ALIGN;
    cairn_status status;

    *memory = malloc(bytes);
    status = *memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(pool, *memory, bytes);
    return status == CAIRN_OK ? cairn_force_field_create(field, pool, params) : status;
}

/* P of given poses at sigma, without regions of interest. */
static cairn_status potential_of(const views *v, cairn_force_field_params params, double sigma,
                                 const cairn_pose *poses, double *potential)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_force_field *field = NULL;
    cairn_pool pool;
    void *memory;
    cairn_status status;

    params.mode = CAIRN_FORCE_FIELD_GRADIENT;
    params.roi = 0;
    params.sigma_start = params.sigma_end = (cairn_real)sigma;
    status = field_make(&field, &pool, &params, &memory);
    for (int32_t i = 0; i < v->count && status == CAIRN_OK; i++)
        status = cairn_force_field_add_scan(field, &v->view[i], NULL, poses[i], NULL);
    if (status == CAIRN_OK)
        status = cairn_force_field_iterate(field, &budget);
    if (status >= 0)
        *potential = (double)cairn_force_field_potential(field);
    free(memory);
    return status < 0 ? status : CAIRN_OK;
}

static cairn_status watch_potential(const scene *s, const views *v, cairn_force_field_params params,
                                    int32_t steps, outcome *out)
{
    cairn_status status = CAIRN_OK;

    for (int32_t k = 0; k < steps && status == CAIRN_OK; k++) {
        const cairn_pose *poses = s->history + (size_t)k * (size_t)s->count;
        double before = 0, after = 0;

        status = potential_of(v, params, s->sigma[k], poses, &before);
        if (status == CAIRN_OK)
            status = potential_of(v, params, s->sigma[k], poses + s->count, &after);
        out->rising += after > before;
        out->rising_first_10 += k < 10 && after > before;
    }
    if (status == CAIRN_OK)
        status =
            potential_of(v, params, (double)params.sigma_start, s->history, &out->potential_start);
    if (status == CAIRN_OK)
        status = potential_of(v, params, (double)params.sigma_start,
                              s->history + (size_t)steps * (size_t)s->count, &out->potential_end);
    return status;
}

static void remember(const scene *s, const cairn_force_field *field, int32_t step)
{
    for (int32_t i = 0; i < s->count; i++)
        s->history[step * s->count + i] = cairn_force_field_pose(field, i);
}

static cairn_status run_field(scene *s, const views *v, cairn_force_field_params params,
                              outcome *out)
{
    cairn_force_field *field = NULL;
    cairn_force_field_state state = {0};
    cairn_pool pool;
    void *memory;
    cairn_status status;
    double start;

    set_capacities(&params, v);
    params.max_steps = s->steps;
    params.stop_relocation = 0;
    status = field_make(&field, &pool, &params, &memory);
    for (int32_t i = 0; i < s->count && status == CAIRN_OK; i++)
        status = cairn_force_field_add_scan(field, &v->view[i], NULL, bench_cairn_pose(s->start[i]),
                                            NULL);
    if (status == CAIRN_OK)
        remember(s, field, 0);
    start = bench_seconds();
    while (status >= 0 && state.verdict == CAIRN_FORCE_FIELD_RUNNING) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        status = cairn_force_field_iterate(field, &budget);
        state = cairn_force_field_read(field);
        s->sigma[state.iterations - 1] = (double)state.sigma;
        if (state.corners_dropped > out->corners_dropped)
            out->corners_dropped = state.corners_dropped;
        remember(s, field, state.iterations);
    }
    out->step_ms = 1e3 * (bench_seconds() - start) / (state.iterations > 0 ? state.iterations : 1);
    out->steps = state.iterations;
    out->pool_bytes = pool.peak;
    for (int32_t i = 0; i < s->count && status >= 0; i++)
        s->poses[i] = bench_sim_pose(cairn_force_field_pose(field, i));
    free(memory);
    return status < 0 ? status : watch_potential(s, v, params, out->steps, out);
}

/* ---- Pictures ---- */

static int draw(const settings *set, const scene *s, const views *v, uint64_t seed)
{
    cairn_report_map picture = cairn_report_map_default();
    cairn_report_panel panel[2];
    cairn_report_scan *scan = calloc((size_t)s->count, sizeof *scan);
    cairn_file_error error;
    cairn_status status = CAIRN_NO_MEMORY;
    char path[512];

    memset(panel, 0, sizeof panel);
    panel[0].title = "Start";
    panel[0].pose = s->history;
    panel[1].title = set->preset;
    panel[1].pose = s->history + (size_t)s->steps * (size_t)s->count;
    picture.title = s->name;
    picture.panel = panel;
    picture.panel_count = 2;
    picture.scan = scan;
    picture.scan_count = s->count;
    picture.connect = s->drive;
    (void)snprintf(path, sizeof path, "%s/%s-%" PRIu64 "-%s.svg", set->svg, s->name, seed,
                   set->preset);
    if (scan != NULL) {
        for (int32_t i = 0; i < s->count; i++) {
            scan[i].segment = v->view[i].segments;
            scan[i].segment_count = v->view[i].segment_count;
        }
        status = cairn_report_map_write(path, &picture, &error);
    }
    if (status != CAIRN_OK)
        fprintf(stderr, "bench/field: %s: %s\n", path, cairn_status_text(status));
    free(scan);
    return status == CAIRN_OK;
}

/* ---- Output ---- */

static void print(const settings *set, const scene *s, const outcome *o)
{
    bench_json_text("scene", s->name);
    bench_json_text("preset", set->preset);
    bench_json_number("spacing", set->spacing);
    bench_json_integer("scans", o->scans);
    bench_json_integer("steps", o->steps);
    bench_json_number("start_mean_m", o->start.metres);
    bench_json_number("start_mean_deg", o->start.degrees);
    bench_json_number("end_mean_m", o->end.metres);
    bench_json_number("end_mean_deg", o->end.degrees);
    bench_json_number("ratio_m", o->end.metres / o->start.metres);
    bench_json_number("ratio_deg", o->end.degrees / o->start.degrees);
    bench_json_number("end_median_m", o->end.median_metres);
    bench_json_number("end_median_deg", o->end.median_degrees);
    bench_json_number("moved_mean_m", o->moved.metres);
    bench_json_number("moved_mean_deg", o->moved.degrees);
    bench_json_number("start_gap_m", o->start_gap);
    bench_json_number("end_gap_m", o->end_gap);
    bench_json_number("potential_start", o->potential_start);
    bench_json_number("potential_end", o->potential_end);
    bench_json_integer("rising", o->rising);
    bench_json_integer("rising_first_10", o->rising_first_10);
    bench_json_integer("judged", o->evaluated);
    bench_json_integer("corners_dropped", o->corners_dropped);
    bench_json_integer("met", o->met);
    bench_json_number("step_ms", o->step_ms);
    bench_json_integer("pool_bytes", (int64_t)o->pool_bytes);
}

static cairn_force_field_params preset_of(const settings *set, const scene *s)
{
    cairn_force_field_params params = cairn_force_field_as_written();

    if (strcmp(set->preset, "spaced") == 0)
        return cairn_force_field_spaced((cairn_real)set->spacing);
    if (strcmp(set->preset, "springs") == 0)
        return cairn_force_field_springs((cairn_real)(set->sigma > 0 ? set->sigma
                                                      : s->drive     ? 0.15
                                                                     : 0.8),
                                         s->steps);
    if (!isnan(set->mass))
        params.roi_mass = (cairn_real)set->mass;
    params.dt_start *= (cairn_real)set->dt_factor;
    params.dt_end *= (cairn_real)set->dt_factor;
    return params;
}

/* Whether the result of the thesis is reproduced. */
static void evaluate(const scene *s, outcome *o)
{
    o->evaluated = 1;
    if (strcmp(s->name, "maze") == 0) {
        o->met = o->end.metres <= o->start.metres / 5 && o->end.degrees <= o->start.degrees / 5;
    } else if (s->drive) {
        o->evaluated = !isnan(o->start_gap);
        o->met = o->evaluated && o->end_gap <= o->start_gap / 4 && o->rising_first_10 > 0;
    } else {
        o->met = o->rising == 0;
    }
}

static int run_scene(const settings *set, uint64_t seed, scene *s, outcome *o)
{
    cairn_force_field_params params = preset_of(set, s);
    views v;
    cairn_status status = views_make(&v, s, set->spacing);
    int done;

    memset(o, 0, sizeof *o);
    o->scans = s->count;
    o->start = field_error_of(s, s->start);
    o->start_gap = s->drive ? field_gap(s, s->start) : (double)NAN;
    if (status == CAIRN_OK)
        status = run_field(s, &v, params, o);
    if (status != CAIRN_OK)
        fprintf(stderr, "bench/field: %s\n", cairn_status_text(status));
    o->end = field_error_of(s, s->poses);
    o->moved = field_moved(s, s->poses);
    o->end_gap = s->drive ? field_gap(s, s->poses) : (double)NAN;
    evaluate(s, o);
    done = status == CAIRN_OK && (set->svg == NULL || draw(set, s, &v, seed));
    views_free(&v);
    return done;
}

/* Means over the arenas; counts are sums. */
static void add(outcome *sum, const outcome *o, double share)
{
    sum->start.metres += share * o->start.metres;
    sum->start.degrees += share * o->start.degrees;
    sum->end.metres += share * o->end.metres;
    sum->end.degrees += share * o->end.degrees;
    sum->end.median_metres += share * o->end.median_metres;
    sum->end.median_degrees += share * o->end.median_degrees;
    sum->moved.metres += share * o->moved.metres;
    sum->moved.degrees += share * o->moved.degrees;
    if (o->evaluated) { /* made means at the end */
        sum->start_gap += o->start_gap;
        sum->end_gap += o->end_gap;
    }
    sum->potential_start += share * o->potential_start;
    sum->potential_end += share * o->potential_end;
    sum->step_ms += share * o->step_ms;
    sum->scans += o->scans;
    sum->steps += o->steps;
    sum->rising += o->rising;
    sum->rising_first_10 += o->rising_first_10;
    sum->evaluated += o->evaluated;
    sum->corners_dropped += o->corners_dropped;
    sum->met += o->met;
    sum->pool_bytes = o->pool_bytes > sum->pool_bytes ? o->pool_bytes : sum->pool_bytes;
}

static int run_all(const settings *set)
{
    outcome sum;
    scene last = {0};

    memset(&sum, 0, sizeof sum);
    for (int64_t k = 0; k < set->arenas; k++) {
        uint64_t seed = (uint64_t)(set->seed + k);
        outcome o;
        scene s;
        int done;

        if (!field_scene_make(&s, set->scene, seed, set->trans, set->rot))
            return 0;
        done = run_scene(set, seed, &s, &o);
        if (done) {
            bench_json_begin("field");
            bench_json_integer("arena", (int64_t)seed);
            print(set, &s, &o);
            bench_json_end();
            add(&sum, &o, 1 / (double)set->arenas);
        }
        last.name = s.name;
        field_scene_free(&s);
        if (!done)
            return 0;
    }
    if (sum.evaluated > 0) {
        sum.start_gap /= sum.evaluated;
        sum.end_gap /= sum.evaluated;
    }
    bench_json_begin("field");
    bench_json_integer("arenas", set->arenas);
    print(set, &last, &sum);
    bench_json_true("summary");
    bench_json_end();
    return 1;
}

/* 1 when the settings can be run, else a line on standard error. */
static int check(const settings *s, const char *given_preset)
{
    static const char *const scenes[] = {"rescue", "maze", "apartment", "corners"};
    static const char *const presets[] = {"thesis", "as-written", "spaced", "springs"};
    int32_t is_scene = 0, is_preset = 0;

    for (int i = 0; i < 4; i++) {
        is_scene |= strcmp(s->scene, scenes[i]) == 0;
        is_preset |= strcmp(s->preset, presets[i]) == 0;
    }
    if (!is_scene)
        fprintf(stderr,
                "bench/field: unknown scene '%s', expected rescue, maze, apartment or corners\n",
                s->scene);
    else if (!is_preset)
        fprintf(stderr, "bench/field: unknown preset '%s', expected thesis, spaced or springs\n",
                s->preset);
    else if (s->as_written && (given_preset != NULL || s->sigma > 0 || s->dt_factor != 1))
        fprintf(stderr, "bench/field: --as-written with --preset, --sigma or --dt, expected the "
                        "thesis's constants\n");
    else if ((!isnan(s->mass) || s->dt_factor != 1) && strcmp(s->preset, "thesis") != 0 &&
             !s->as_written)
        fprintf(stderr, "bench/field: --mass or --dt with preset %s, expected thesis\n", s->preset);
    else if ((!isnan(s->trans) || !isnan(s->rot)) &&
             (strcmp(s->scene, "apartment") == 0 || strcmp(s->scene, "corners") == 0))
        fprintf(stderr,
                "bench/field: --trans or --rot with %s, whose start is given, expected rescue or "
                "maze\n",
                s->scene);
    else
        return 1;
    return 0;
}

int main(int argc, char **argv)
{
    settings s = {.scene = "rescue",
                  .arenas = 3,
                  .seed = 1,
                  .spacing = 0.10,
                  .trans = (double)NAN,
                  .rot = (double)NAN,
                  .mass = (double)NAN,
                  .dt_factor = 1};
    const char *given_preset = NULL;
    const option table[] = {
        OPTION_TEXT("--scene", &s.scene, "NAME", "rescue, maze, apartment or corners (rescue)"),
        OPTION_FLAG("--as-written", &s.as_written, "chapter 7 of the thesis, as without --preset"),
        OPTION_TEXT("--preset", &given_preset, "NAME",
                    "thesis: as written; spaced: dt for the spacing; springs (thesis)"),
        OPTION_INTEGER("--arenas", &s.arenas, 1, 10000, "N", "arenas"),
        OPTION_INTEGER("--seed", &s.seed, 0, 9e15, "N", "of the first arena; the others follow"),
        OPTION_NUMBER("--spacing", &s.spacing, 0.01, 1, "M", "of the resampled points, m"),
        OPTION_NUMBER("--sigma", &s.sigma, 0, 10, "M",
                      "of springs at the start; 0: 0.8, apartment 0.15"),
        OPTION_NUMBER("--trans", &s.trans, 0, 10, "M",
                      "disturbance of x and y, uniform +-, m (0.30; maze 0.25)"),
        OPTION_NUMBER("--rot", &s.rot, 0, 180, "DEG",
                      "disturbance of the heading, uniform +-, degrees (20)"),
        OPTION_NUMBER("--mass", &s.mass, 0.01, 1000, "M",
                      "of points in regions of interest, which the thesis leaves open (4)"),
        OPTION_NUMBER("--dt", &s.dt_factor, 0.01, 100, "F", "times this the thesis's dt"),
        OPTION_TEXT("--svg", &s.svg, "DIR", "pictures of start and end"),
    };
    const option_set set = {"bench/field", "[options]",
                            "Force field simulation on the scenes of the thesis.", table,
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
    s.preset = s.as_written ? "as-written" : given_preset != NULL ? given_preset : "thesis";
    if (!check(&s, given_preset))
        return 2;
    if (strcmp(s.scene, "corners") == 0)
        return bench_corners(s.preset, s.spacing, s.svg) ? 0 : 1;
    return run_all(&s) ? 0 : 1;
}
