/* Shared by the tests of both modes of virtual_align: scans of four rooms on a hallway, and an
 * aligner with virtual scans and its own pool. */
#ifndef CAIRN_TESTS_FOUR_ROOMS_H
#define CAIRN_TESTS_FOUR_ROOMS_H

#include "tests/test.h"

#include <math.h>

#include "bench/bench_score.h"
#include "cairn/virtual_align.h"
#include "sim/arena.h"

#define DEGREE 0.017453292519943295

enum { SCANS = 5 };

/* ---- Scans ---- */

static cairn_pool scan_pool;
static cairn_scan *scan_object;

static inline int open_scan(void **state)
{
    cairn_scan_params params = cairn_scan_default();

    (void)state;
    params.max_beams = 401;
    scan_pool = test_pool(cairn_scan_memory(&params));
    assert_ok(cairn_scan_create(&scan_object, &scan_pool, &params));
    return 0;
}

static inline int close_scan(void **state)
{
    (void)state;
    test_pool_free(&scan_pool);
    return 0;
}

static inline cairn_scan_view fit(const sim_scan *scan)
{
    cairn_scan_input input = sim_scan_input(scan);
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_scan_begin(scan_object, &input, NULL));
    assert_ok(cairn_scan_step(scan_object, &budget));
    return cairn_scan_read(scan_object);
}

/* Removes all of its walls but the shortest. */
static inline cairn_scan_view fit_one_wall(const sim_scan *scan)
{
    static cairn_segment wall;
    static int32_t points[2];
    cairn_scan_view view = fit(scan);
    int32_t shortest = 0;

    for (int32_t k = 1; k < view.segment_count; k++)
        if (cairn_segment_length(view.segments[k]) < cairn_segment_length(view.segments[shortest]))
            shortest = k;
    wall = view.segments[shortest];
    view.points += view.first_point[shortest];
    view.point_count = points[1] = view.first_point[shortest + 1] - view.first_point[shortest];
    view.segments = &wall;
    view.first_point = points;
    view.segment_count = 1;
    return view;
}

/* ---- Rooms ---- */

struct rooms {
    sim_arena *arena;
    sim_survey *survey;
    const sim_scan *scans;
    cairn_pose start[SCANS];
    int32_t narrow; /* index of the scan that shows one wall only; SCANS: none */
};

/* Scan i as it is added. */
static inline cairn_scan_view view_of(const struct rooms *r, int32_t i)
{
    return i == r->narrow ? fit_one_wall(&r->scans[i]) : fit(&r->scans[i]);
}

static inline struct rooms visit_with(uint64_t seed, double fov)
{
    sim_arena_options arena = sim_arena_default();
    sim_survey_options options = sim_survey_default();
    cairn_random random = cairn_random_seed(seed, 80);
    struct rooms r;
    int32_t count;

    r.narrow = SCANS;
    arena.seed = options.seed = seed;
    arena.scene = SIM_ROOMS;
    options.places = SCANS;
    options.headings = 1;
    options.fov = fov * DEGREE;
    r.arena = sim_arena_create(&arena, NULL, 0);
    assert_non_null(r.arena);
    r.survey = sim_survey_create(r.arena, &options, NULL, 0);
    assert_non_null(r.survey);
    r.scans = sim_survey_scans(r.survey, &count);
    assert_int_equal(count, SCANS);
    for (int32_t i = 0; i < SCANS; i++) {
        sim_pose truth = r.scans[i].truth;

        r.start[i].x = (cairn_real)truth.x +
                       cairn_random_uniform(&random, CAIRN_REAL(-0.75), CAIRN_REAL(0.75));
        r.start[i].y = (cairn_real)truth.y +
                       cairn_random_uniform(&random, CAIRN_REAL(-0.75), CAIRN_REAL(0.75));
        r.start[i].theta = (cairn_real)truth.theta +
                           cairn_random_uniform(&random, CAIRN_REAL(-0.26), CAIRN_REAL(0.26));
    }
    return r;
}

static inline struct rooms visit(uint64_t seed)
{
    return visit_with(seed, 360);
}

static inline void leave(struct rooms *r)
{
    sim_survey_free(r->survey);
    sim_arena_free(r->arena);
}

/* ---- Aligning ---- */

struct bed {
    cairn_pool pool;
    cairn_virtual_align *align;
};

static inline struct bed bed_with(const cairn_virtual_align_params *params)
{
    struct bed bed = {test_pool(cairn_virtual_align_memory(params)), NULL};

    assert_ok(cairn_virtual_align_create(&bed.align, &bed.pool, params));
    return bed;
}

static inline void add_rooms(struct bed *bed, const struct rooms *r)
{
    for (int32_t i = 0; i < SCANS; i++) {
        cairn_scan_view view = view_of(r, i);

        assert_ok(cairn_virtual_align_add_scan(bed->align, &view, r->start[i], NULL));
    }
}

static inline void run(cairn_virtual_align *align, int32_t units)
{
    cairn_budget budget = {units};
    cairn_status status;

    assert_ok(cairn_virtual_align_begin(align));
    while ((status = cairn_virtual_align_step(align, &budget)) == CAIRN_MORE) {
        assert_true(budget.left >= 0 && budget.left < units);
        budget.left = units;
    }
    assert_ok(status);
    assert_false(cairn_virtual_align_running(align));
}

/* Scans within 0.12 m and 1 degree of the truth after the best common motion. */
static inline int32_t right(const struct rooms *r, const cairn_virtual_align *align)
{
    sim_pose truth[SCANS], found[SCANS], moved[SCANS];
    int32_t use[SCANS];

    for (int32_t i = 0; i < SCANS; i++) {
        cairn_pose p = cairn_virtual_align_pose_of(align, i).aligned.map_scan;

        truth[i] = r->scans[i].truth;
        found[i].x = (double)p.x;
        found[i].y = (double)p.y;
        found[i].theta = (double)p.theta;
        use[i] = 1;
    }
    return bench_fit_common(truth, found, use, SCANS, 0.12, DEGREE, moved);
}

static inline cairn_status create(void *context, cairn_pool *pool)
{
    cairn_virtual_align *align;

    return cairn_virtual_align_create(&align, pool, context);
}

#endif
