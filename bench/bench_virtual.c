/* Runs and scores of virtual_align. */
#include "bench/bench_virtual.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "bench/bench_align.h"
#include "bench/bench_bound.h"
#include "bench/bench_score.h"
#include "src/host/base/degrees.h"

enum { ROOM_STEPS = 30 /* fig. 8.10 */ };

void bench_virtual_close(bench_virtual_problem *p)
{
    free(p->truth);
    free(p->start);
    free(p->result);
    free(p->use);
    sim_survey_free(p->survey);
    sim_arena_free(p->arena);
}

void bench_virtual_disturb(sim_pose *pose, cairn_random *random, double metres, double degrees)
{
    pose->x += (double)cairn_random_uniform(random, -1, 1) * metres;
    pose->y += (double)cairn_random_uniform(random, -1, 1) * metres;
    pose->theta += (double)cairn_random_uniform(random, -1, 1) * degrees * CAIRN_DEGREE;
}

static int survey(const bench_virtual_scene *from, uint64_t seed, bench_virtual_problem *p)
{
    sim_arena_options arena_options = sim_arena_default();
    sim_survey_options survey_options = sim_survey_default();
    cairn_random random = cairn_random_seed(seed, 80);
    char fault[256];

    memset(p, 0, sizeof *p);
    arena_options.seed = survey_options.seed = seed;
    arena_options.scene = from->scene;
    survey_options.places = from->places;
    survey_options.headings = from->headings;
    survey_options.fov = from->fov * CAIRN_DEGREE;
    p->arena = sim_arena_create(&arena_options, fault, sizeof fault);
    if (p->arena != NULL)
        p->survey = sim_survey_create(p->arena, &survey_options, fault, sizeof fault);
    if (p->survey == NULL) {
        fprintf(stderr, "bench/virtual: %s\n", fault);
        return 0;
    }
    p->scans = sim_survey_scans(p->survey, &p->count);
    p->truth = malloc((size_t)p->count * sizeof *p->truth);
    p->start = malloc((size_t)p->count * sizeof *p->start);
    p->result = malloc((size_t)p->count * sizeof *p->result);
    p->use = malloc((size_t)p->count * sizeof *p->use);
    if (p->truth == NULL || p->start == NULL || p->result == NULL || p->use == NULL)
        return 0;
    for (int32_t i = 0; i < p->count; i++) {
        p->truth[i] = p->start[i] = p->scans[i].truth;
        bench_virtual_disturb(&p->start[i], &random, from->metres, from->degrees);
    }
    return 1;
}

/* Scans that are observable by the bound. */
static int find_observable(const bench_virtual_scene *from, bench_virtual_problem *p)
{
    bench_bound *bounds = malloc((size_t)p->count * sizeof *bounds);
    int done = bounds != NULL && bench_bound_compute(p->arena, p->scans, p->count, from->metres,
                                                     from->degrees * CAIRN_DEGREE, bounds) >= 0;

    for (int32_t i = 0; i < p->count && done; i++) {
        p->use[i] = bounds[i].observable;
        p->observable += p->use[i];
    }
    free(bounds);
    return done;
}

static cairn_status count_room(cairn_scan *scan, const bench_virtual_problem *p,
                               cairn_virtual_align_params *params)
{
    cairn_status status = CAIRN_OK;

    params->aligner.max_scans = p->count;
    params->aligner.max_segments = params->aligner.max_points = 1;
    params->aligner.max_hypotheses = 24 * p->count;
    params->aligner.max_fill = 32 * p->count;
    for (int32_t i = 0; i < p->count && status == CAIRN_OK; i++) {
        cairn_scan_view view;

        status = bench_fit_scan(scan, &p->scans[i], &view);
        params->aligner.max_segments += view.segment_count;
        params->aligner.max_points += view.point_count;
    }
    return status;
}

int bench_virtual_open(const bench_virtual_scene *from, uint64_t seed, bench_virtual_problem *p)
{
    return survey(from, seed, p) && find_observable(from, p);
}

/* Algorithm 2 as written. For the rooms the text gives only sigma at the start and 30 iterations.
 * Sigma at the end and dt at the start and the end keep their ratios to it from section 7.4.2 (dt
 * is a length: its square times a force, which is one over a length). Over the 30 iterations sigma
 * falls linearly and dt exponentially to their ends, as both reach theirs there within 50. */
static cairn_virtual_align_params as_written(const bench_virtual_method *m)
{
    cairn_virtual_align_params params = cairn_virtual_align_as_written();
    cairn_real scale = (cairn_real)m->sigma / params.field.sigma_start;

    if (m->sigma > 0) {
        params.field.max_steps = ROOM_STEPS;
        params.field.sigma_start *= scale;
        params.field.sigma_end *= scale;
        params.field.sigma_step =
            (params.field.sigma_start - params.field.sigma_end) / (ROOM_STEPS - 1);
        params.field.dt_start *= scale;
        params.field.dt_end *= scale;
        params.field.dt_factor =
            cairn_exp(cairn_log(params.field.dt_end / params.field.dt_start) / (ROOM_STEPS - 1));
    }
    params.field.potential = 0;
    params.hypotheses.max_virtual = CAIRN_VIRTUAL_ALIGN_WRITTEN_POINTS;
    params.hypotheses.hough.distances = CAIRN_VIRTUAL_ALIGN_WRITTEN_DISTANCES;
    return params;
}

static cairn_virtual_align_params params_of(const bench_virtual_method *m,
                                            const bench_virtual_problem *p)
{
    cairn_virtual_align_params params =
        m->field == BENCH_FIELD_AS_WRITTEN ? as_written(m) : cairn_virtual_align_default();

    if (m->field != BENCH_FIELD_AS_WRITTEN)
        params.use_aligner = m->align;
    if (p->lie != NULL)
        params.rebuild_interval = 5;
    if (!m->hypotheses)
        params.hypotheses.lines = params.hypotheses.rectangles = params.hypotheses.ellipses =
            params.weak_direction.use_thickness = 0;
    return params;
}

/* Processor time of this thread. */
static double processor_seconds(void)
{
    return (double)clock() / CLOCKS_PER_SEC;
}

/* alone: the aligner only. */
static cairn_status align(int32_t prints_steps, bench_virtual_problem *p, cairn_scan *scan,
                          cairn_virtual_align *align, int32_t alone, bench_virtual_row *out)
{
    double start = processor_seconds();
    cairn_virtual_align_result result;
    cairn_status status = CAIRN_OK;

    for (int32_t i = 0; i < p->count && status == CAIRN_OK; i++) {
        cairn_pose pose = {(cairn_real)p->start[i].x, (cairn_real)p->start[i].y,
                           (cairn_real)p->start[i].theta};
        cairn_scan_view view;

        status = bench_fit_scan(scan, &p->scans[i], &view);
        if (status == CAIRN_OK)
            status = cairn_virtual_align_add_scan(align, &view, pose, NULL);
    }
    if (status == CAIRN_OK)
        status = cairn_virtual_align_begin(align);
    while (status >= 0 && cairn_virtual_align_running(align)) {
        cairn_budget budget = {CAIRN_UNBOUNDED};

        status = cairn_virtual_align_iterate(align, &budget);
        if (alone)
            break;
        if (prints_steps)
            bench_guess_print(cairn_virtual_align_hypotheses(align),
                              cairn_virtual_align_read(align).iterations);
        if (p->lie != NULL && cairn_virtual_align_read(align).iterations >= 15)
            p->accepted |=
                bench_false_rectangle_is_accepted(p->lie, cairn_virtual_align_hypotheses(align));
    }
    result = cairn_virtual_align_read(align);
    out->seconds += processor_seconds() - start;
    out->iterations += result.iterations;
    out->active += result.active_iterations;
    out->moved += result.moved_scans;
    out->align_units += result.align_units;
    out->hypothesis_units += result.hypothesis_units;
    out->field_units += result.field_units;
    for (int32_t i = 0; i < p->count && status >= 0; i++) {
        cairn_pose pose = cairn_virtual_align_pose_of(align, i).aligned.map_scan;

        p->result[i].x = (double)pose.x;
        p->result[i].y = (double)pose.y;
        p->result[i].theta = (double)pose.theta;
    }
    return status < 0 ? status : CAIRN_OK;
}

int bench_virtual_run(bench_virtual_problem *p, const bench_virtual_method *m, int32_t prints_steps,
                      bench_virtual_row *out)
{
    cairn_scan_params scan_params = cairn_scan_default();
    cairn_virtual_align_params params = params_of(m, p);
    cairn_virtual_align *aligned = NULL;
    cairn_scan *scan = NULL;
    cairn_pool pool, scan_pool;
    cairn_status status;
    size_t bytes = 0;
    void *memory = NULL, *scan_memory;

    scan_params.max_beams = p->scans[0].count;
    scan_memory = malloc(cairn_scan_memory(&scan_params) + CAIRN_ALIGN);
    status = scan_memory == NULL ? CAIRN_NO_MEMORY
                                 : cairn_pool_init(&scan_pool, scan_memory,
                                                   cairn_scan_memory(&scan_params) + CAIRN_ALIGN);
    if (status == CAIRN_OK)
        status = cairn_scan_create(&scan, &scan_pool, &scan_params);
    if (status == CAIRN_OK)
        status = count_room(scan, p, &params);
    if (status == CAIRN_OK) {
        bytes = cairn_virtual_align_memory(&params) + CAIRN_ALIGN;
        memory = malloc(bytes);
        status = memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(&pool, memory, bytes);
    }
    if (status == CAIRN_OK)
        status = cairn_virtual_align_create(&aligned, &pool, &params);
    if (status == CAIRN_OK && p->lie != NULL) {
        cairn_virtual_scan_hypothesis_detector detector = bench_lie_detector(p->lie);

        status = cairn_virtual_align_add_detector(aligned, &detector);
    }
    if (status == CAIRN_OK)
        status = align(prints_steps, p, scan, aligned, m->field == BENCH_NO_FIELD, out);
    if (bytes > out->pool_bytes)
        out->pool_bytes = bytes;
    if (status != CAIRN_OK)
        fprintf(stderr, "bench/virtual: %s\n", cairn_status_text(status));
    free(memory);
    free(scan_memory);
    return status == CAIRN_OK;
}

int32_t bench_virtual_score(const bench_virtual_problem *p, double metres)
{
    return bench_fit_common(p->truth, p->result, p->use, p->count, metres, CAIRN_DEGREE, p->result);
}
