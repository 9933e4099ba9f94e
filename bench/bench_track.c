#include "bench/bench_track.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_lum.h"
#include "cairn/aligner.h"
#include "cairn/force_field.h"
#include "cairn/lum.h"
#include "src/host/maps/capacity.h"

/* Spacing of the points of Lu and Milios: about that of the beams. */
static const double LUM_SPACING = 0.03;

/* Interface of an alignment object for the loop below. */
typedef struct aligning {
    void *object;
    cairn_status (*iterate)(void *object, cairn_budget *budget);
    int32_t (*running)(const void *object);
    cairn_pose (*pose)(const void *object, int32_t scan);
} aligning;

const char *bench_track_name(bench_track_method method)
{
    static const char *const names[BENCH_TRACK_METHODS] = {"gradient", "default", "lum"};

    return names[method];
}

int32_t bench_track_step(int32_t k)
{
    return k <= 50 ? k : 50 + 10 * (k - 50);
}

static cairn_status watch(const aligning *a, int32_t count, cairn_pose *poses, int32_t *steps)
{
    cairn_status status = CAIRN_OK;
    int32_t k = 0;

    *steps = 0;
    while (k < BENCH_TRACK_SAMPLES && status == CAIRN_OK) {
        if (*steps >= bench_track_step(k) || !a->running(a->object)) {
            for (int32_t i = 0; i < count; i++)
                poses[k * count + i] = a->pose(a->object, i);
            k++;
            continue;
        }
        do {
            cairn_budget budget = {CAIRN_UNBOUNDED};

            status = a->iterate(a->object, &budget);
        } while (status == CAIRN_MORE);
        (*steps)++;
    }
    return status;
}

static cairn_pose start_of(const bench_problem *problem, int32_t i)
{
    sim_pose p = problem->start[i];
    cairn_pose pose = {(cairn_real)p.x, (cairn_real)p.y, (cairn_real)p.theta};

    return pose;
}

/* A pool from the heap. */
static cairn_status open_pool(cairn_pool *pool, void **memory, size_t bytes)
{
    *memory = malloc(bytes + CAIRN_ALIGN);
    return *memory == NULL ? CAIRN_NO_MEMORY : cairn_pool_init(pool, *memory, bytes + CAIRN_ALIGN);
}

typedef cairn_status (*add_scan)(void *object, const cairn_scan_view *view, cairn_pose pose);

static cairn_status add_all(const bench_problem *problem, cairn_scan *scan, add_scan add,
                            void *object)
{
    cairn_status status = CAIRN_OK;

    for (int32_t i = 0; i < problem->count && status == CAIRN_OK; i++) {
        cairn_scan_view view;

        status = bench_fit_scan(scan, &problem->scans[i], &view);
        if (status == CAIRN_OK)
            status = add(object, &view, start_of(problem, i));
    }
    return status;
}

/* Counts segments and points. */
typedef struct capacity {
    int32_t segments, points, beams;
} capacity;

static cairn_status add_capacity(void *object, const cairn_scan_view *view, cairn_pose pose)
{
    capacity *r = object;

    (void)pose;
    r->segments += view->segment_count;
    r->points += view->point_count;
    r->beams += view->beam_count;
    return CAIRN_OK;
}

/* ---- gradient ---- */

static cairn_status field_iterate(void *object, cairn_budget *budget)
{
    return cairn_force_field_iterate(object, budget);
}

static int32_t field_running(const void *object)
{
    return cairn_force_field_read(object).verdict == CAIRN_FORCE_FIELD_RUNNING;
}

static cairn_pose field_pose(const void *object, int32_t scan)
{
    return cairn_force_field_pose(object, scan);
}

static cairn_status field_add(void *object, const cairn_scan_view *view, cairn_pose pose)
{
    return cairn_force_field_add_scan(object, view, NULL, pose, NULL);
}

static cairn_status run_field_with(cairn_force_field_params params, const bench_problem *problem,
                                   cairn_scan *scan, capacity most, cairn_pose *poses,
                                   int32_t *steps)
{
    aligning a = {NULL, field_iterate, field_running, field_pose};
    cairn_force_field *field = NULL;
    cairn_pool pool;
    void *memory;
    cairn_status status;

    params.max_scans = problem->count;
    params.max_segments = most.segments + 1;
    params.max_corners = CAIRN_CAPACITY_CORNERS_PER_SEGMENT * params.max_segments;
    params.max_points = most.points + 1;
    status = open_pool(&pool, &memory, cairn_force_field_memory(&params));
    if (status == CAIRN_OK)
        status = cairn_force_field_create(&field, &pool, &params);
    if (status == CAIRN_OK)
        status = add_all(problem, scan, field_add, field);
    a.object = field;
    if (status == CAIRN_OK)
        status = watch(&a, problem->count, poses, steps);
    /* Scans take effect at the first commit point; until then they have no pose. */
    for (int32_t i = 0; i < problem->count; i++)
        poses[i] = start_of(problem, i);
    free(memory);
    return status;
}

static cairn_status run_field(const bench_problem *problem, cairn_scan *scan, capacity most,
                              cairn_pose *poses, int32_t *steps)
{
    return run_field_with(cairn_force_field_default(), problem, scan, most, poses, steps);
}

static cairn_status run_field_as_written(const bench_problem *problem, cairn_scan *scan,
                                         capacity most, cairn_pose *poses, int32_t *steps)
{
    return run_field_with(cairn_force_field_as_written(), problem, scan, most, poses, steps);
}

/* ---- default ---- */

static cairn_status aligner_iterate(void *object, cairn_budget *budget)
{
    return cairn_aligner_iterate(object, budget);
}

static int32_t aligner_running(const void *object)
{
    return cairn_aligner_running(object);
}

static cairn_pose aligner_pose(const void *object, int32_t scan)
{
    return cairn_aligner_current_pose(object, scan, NULL);
}

static cairn_status aligner_add(void *object, const cairn_scan_view *view, cairn_pose pose)
{
    return cairn_aligner_add_scan(object, view, pose, NULL);
}

static cairn_status run_aligner(const bench_problem *problem, cairn_scan *scan, capacity most,
                                cairn_pose *poses, int32_t *steps)
{
    aligning a = {NULL, aligner_iterate, aligner_running, aligner_pose};
    cairn_aligner_params params = cairn_aligner_default();
    cairn_aligner *aligner = NULL;
    cairn_pool pool;
    void *memory;
    cairn_status status;

    params.max_scans = problem->count;
    params.max_segments = most.segments + 1;
    params.max_points = most.points + 1;
    params.max_hypotheses = 24 * problem->count;
    params.max_fill = 32 * problem->count;
    status = open_pool(&pool, &memory, cairn_aligner_memory(&params));
    if (status == CAIRN_OK)
        status = cairn_aligner_create(&aligner, &pool, &params);
    if (status == CAIRN_OK)
        status = add_all(problem, scan, aligner_add, aligner);
    if (status == CAIRN_OK)
        status = cairn_aligner_begin(aligner);
    a.object = aligner;
    if (status == CAIRN_OK)
        status = watch(&a, problem->count, poses, steps);
    free(memory);
    return status;
}

/* ---- lum ---- */

static cairn_status lum_iterate(void *object, cairn_budget *budget)
{
    return cairn_lum_iterate(object, budget);
}

static int32_t lum_running(const void *object)
{
    return cairn_lum_read(object).verdict == CAIRN_LUM_RUNNING;
}

static cairn_pose lum_pose(const void *object, int32_t scan)
{
    return cairn_lum_pose(object, scan);
}

static cairn_status lum_add(void *object, const cairn_scan_view *view, cairn_pose pose)
{
    return cairn_lum_add_scan(object, view->points, view->point_count, pose, NULL);
}

static cairn_status lum_add_hits(void *object, const cairn_scan_view *view, cairn_pose pose)
{
    cairn_oriented_point *hits = malloc(((size_t)view->beam_count + 1) * sizeof *hits);
    cairn_status status = CAIRN_NO_MEMORY;

    if (hits != NULL)
        status = cairn_lum_add_scan(object, hits, bench_lum_hits(view, hits), pose, NULL);
    free(hits);
    return status;
}

static cairn_status run_lum_with(cairn_lum_params params, add_scan add,
                                 const bench_problem *problem, cairn_scan *scan, cairn_pose *poses,
                                 int32_t *steps)
{
    aligning a = {NULL, lum_iterate, lum_running, lum_pose};
    cairn_lum *lum = NULL;
    cairn_pool pool;
    void *memory;
    cairn_status status;

    params.max_scans = problem->count;
    params.max_links = params.max_fill = problem->count * (problem->count - 1) / 2 + 1;
    params.max_iterations = BENCH_TRACK_LAST;
    status = open_pool(&pool, &memory, cairn_lum_memory(&params));
    if (status == CAIRN_OK)
        status = cairn_lum_create(&lum, &pool, &params);
    if (status == CAIRN_OK)
        status = add_all(problem, scan, add, lum);
    if (status == CAIRN_OK)
        status = cairn_lum_begin(lum);
    a.object = lum;
    if (status == CAIRN_OK)
        status = watch(&a, problem->count, poses, steps);
    free(memory);
    return status;
}

static cairn_status run_lum(const bench_problem *problem, cairn_scan *scan, capacity most,
                            cairn_pose *poses, int32_t *steps)
{
    cairn_lum_params params = cairn_lum_default();

    params.max_points = most.points + 1;
    params.rebuild_interval = 5;
    params.sequential_registration = 1;
    return run_lum_with(params, lum_add, problem, scan, poses, steps);
}

static cairn_status run_lum_as_written(const bench_problem *problem, cairn_scan *scan,
                                       capacity most, cairn_pose *poses, int32_t *steps)
{
    cairn_lum_params params = cairn_lum_as_written();

    params.max_points = most.beams + 1;
    return run_lum_with(params, lum_add_hits, problem, scan, poses, steps);
}

int bench_track_run(bench_track_method method, const bench_problem *problem, int32_t as_written,
                    cairn_pose *poses, int32_t *steps)
{
    static cairn_status (*const runs[2][3])(const bench_problem *, cairn_scan *, capacity,
                                            cairn_pose *, int32_t *) = {
        {run_field, run_aligner, run_lum}, {run_field_as_written, run_aligner, run_lum_as_written}};
    cairn_scan_params params = cairn_scan_default();
    cairn_scan *scan = NULL;
    capacity most = {0, 0, 0};
    cairn_pool pool;
    void *memory;
    cairn_status status;

    params.max_beams = problem->scans[0].count;
    if (method == BENCH_TRACK_LUM)
        params.spacing = (cairn_real)LUM_SPACING;
    status = open_pool(&pool, &memory, cairn_scan_memory(&params));
    if (status == CAIRN_OK)
        status = cairn_scan_create(&scan, &pool, &params);
    if (status == CAIRN_OK)
        status = add_all(problem, scan, add_capacity, &most);
    if (status == CAIRN_OK)
        status = runs[as_written != 0][method](problem, scan, most, poses, steps);
    free(memory);
    if (status < 0)
        fprintf(stderr, "bench: %s: %s\n", bench_track_name(method), cairn_status_text(status));
    return status >= 0;
}
