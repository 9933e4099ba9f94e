/* End-to-end tests on simulated arenas: sweeps of a moving scanner, force field. */
#include "tests/test.h"

#include <math.h>

#include "cairn/force_field.h"
#include "cairn/icp.h"
#include "sim/arena.h"

static cairn_pose pose_of(sim_pose p)
{
    cairn_pose pose = {(cairn_real)p.x, (cairn_real)p.y, (cairn_real)p.theta};

    return pose;
}

/* ---- Sweeps of a rotating scanner ---- */

enum { POINTS_MOST = 1024, PLACES_MOST = 32 };

/* The points of a fitted scan. */
typedef struct fitted {
    cairn_oriented_point point[POINTS_MOST];
    int32_t count;
} fitted;

static void fit(cairn_scan *scan, const sim_scan *from, int32_t give_motion, fitted *out)
{
    cairn_scan_input input = sim_scan_input(from);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_scan_view view;

    if (!give_motion)
        input.motion = cairn_pose_identity();
    assert_ok(cairn_scan_begin(scan, &input, NULL));
    assert_ok(cairn_scan_step(scan, &budget));
    view = cairn_scan_read(scan);
    assert_true(view.point_count > 0 && view.point_count <= POINTS_MOST);
    memcpy(out->point, view.points, (size_t)view.point_count * sizeof *out->point);
    out->count = view.point_count;
}

/* Sums over pairs of scans. */
typedef struct pose_errors {
    double metres, radians;
    int32_t pairs;
} pose_errors;

static void add_errors(pose_errors *sum, const pose_errors *e)
{
    sum->metres += e->metres;
    sum->radians += e->radians;
    sum->pairs += e->pairs;
}

/* Aligns the second scan to the first from an erroneous start, and adds the error. */
static void align_pair(cairn_icp *icp, const fitted *first, const fitted *second, cairn_pose truth,
                       cairn_pose off, pose_errors *errors)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_icp_result result;
    cairn_pose error;

    cairn_icp_clear_target(icp);
    assert_ok(cairn_icp_add_target(icp, first->point, first->count, cairn_pose_identity(), NULL));
    assert_ok(cairn_icp_begin(icp, second->point, second->count, cairn_pose_compose(truth, off),
                              NULL, NULL));
    assert_ok(cairn_icp_step(icp, &budget));
    result = cairn_icp_read(icp);
    error = cairn_pose_between(truth, result.target_query);
    errors->metres += hypot((double)error.x, (double)error.y);
    errors->radians += fabs((double)error.theta);
    errors->pairs++;
}

/* Pairs of poses at most 0.3 m and 0.5 rad apart, clear of obstacles. Returns the number of
 * pairs. */
static int32_t choose_poses(const sim_arena *arena, uint64_t seed, sim_pose *from, sim_pose *to)
{
    sim_survey_options options = sim_survey_default();
    cairn_random random = cairn_random_seed(seed, 5);
    const sim_scan *at;
    sim_survey *places;
    int32_t count, used = 0;

    options.seed = seed;
    options.headings = 1;
    options.beams = 2;
    places = sim_survey_create(arena, &options, NULL, 0);
    assert_non_null(places);
    at = sim_survey_scans(places, &count);
    for (int32_t i = 0; i < count && used < PLACES_MOST; i++) {
        sim_point p;

        from[used] = at[i].truth;
        to[used] = at[i].truth;
        to[used].x += (double)cairn_random_uniform(&random, CAIRN_REAL(-0.3), CAIRN_REAL(0.3));
        to[used].y += (double)cairn_random_uniform(&random, CAIRN_REAL(-0.3), CAIRN_REAL(0.3));
        to[used].theta += (double)cairn_random_uniform(&random, CAIRN_REAL(-0.5), CAIRN_REAL(0.5));
        p.x = to[used].x;
        p.y = to[used].y;
        used += sim_arena_clearance(arena, p) > 0.3;
    }
    sim_survey_free(places);
    return used;
}

/* Full sweeps of 0.1 s of a base that moves straight ahead and turns. */
static sim_survey *sweep(const sim_arena *arena, uint64_t seed, const sim_pose *poses,
                         int32_t count, double speed, double turn_rate)
{
    sim_survey_options options = sim_survey_default();
    sim_survey *survey;

    options.seed = seed;
    options.beams = 541;
    options.fov = 6.283185307179586;
    options.range_max = 12;
    options.scan_time = 0.1;
    survey = sim_survey_at(arena, &options, poses, count, speed, turn_rate, NULL, 0);
    assert_non_null(survey);
    return survey;
}

/* Aligns the scans of one survey to those of another. */
static void align_surveys(const sim_survey *a, const sim_survey *b, int32_t give_motion,
                          cairn_scan *scan, cairn_icp *icp, pose_errors *errors)
{
    static fitted first, second;
    cairn_random random = cairn_random_seed(1, 6);
    const sim_scan *from, *to;
    int32_t count;

    from = sim_survey_scans(a, &count);
    to = sim_survey_scans(b, &count);
    for (int32_t i = 0; i < count; i++) {
        cairn_pose off = {cairn_random_uniform(&random, CAIRN_REAL(-0.1), CAIRN_REAL(0.1)), 0, 0};

        off.y = cairn_random_uniform(&random, CAIRN_REAL(-0.1), CAIRN_REAL(0.1));
        off.theta = cairn_random_uniform(&random, CAIRN_REAL(-0.1), CAIRN_REAL(0.1));
        fit(scan, &from[i], give_motion, &first);
        fit(scan, &to[i], give_motion, &second);
        align_pair(icp, &first, &second,
                   cairn_pose_between(pose_of(from[i].truth), pose_of(to[i].truth)), off, errors);
    }
}

enum { STILL, TURNING, DRIVING, IGNORED, WAYS };

/* The same pairs of scans in all modes; the two scans of a pair turn in opposite senses, so that
 * errors do not cancel. */
static void compare_ways(const sim_arena *arena, uint64_t seed, cairn_scan *scan, cairn_icp *icp,
                         pose_errors *errors)
{
    static const double speeds[] = {0, 0, 0.5}, turns[] = {0, 1, 1};
    sim_pose from[PLACES_MOST], to[PLACES_MOST];
    int32_t count = choose_poses(arena, seed, from, to);

    for (int way = STILL; way <= DRIVING; way++) {
        sim_survey *a = sweep(arena, seed, from, count, speeds[way], turns[way]);
        sim_survey *b = sweep(arena, seed + 1000, to, count, speeds[way], 0 - turns[way]);

        align_surveys(a, b, 1, scan, icp, &errors[way]);
        if (way == TURNING)
            align_surveys(a, b, 0, scan, icp, &errors[IGNORED]);
        sim_survey_free(a);
        sim_survey_free(b);
    }
}

/* A sweep of 0.1 s at 1 rad/s is distorted by 6 degrees. With the motion given, the alignment is as
 * good as that of scans taken at rest, within 10 % over all pairs. */
static void motion_correction_brings_sweeps_back(void **state)
{
    static const sim_scene scenes[] = {SIM_APARTMENT, SIM_OFFICE, SIM_RESCUE};
    cairn_scan_params scan_params = cairn_scan_default();
    cairn_icp_params icp_params = cairn_icp_default();
    pose_errors sum[WAYS];
    cairn_scan *scan;
    cairn_icp *icp;
    cairn_pool pool;

    (void)state;
    memset(sum, 0, sizeof sum);
    scan_params.max_points = POINTS_MOST;
    pool = test_pool(cairn_scan_memory(&scan_params) + cairn_icp_memory(&icp_params));
    assert_ok(cairn_scan_create(&scan, &pool, &scan_params));
    assert_ok(cairn_icp_create(&icp, &pool, &icp_params));
    for (int k = 0; k < 3; k++)
        for (uint64_t seed = 1; seed <= 5; seed++) {
            sim_arena_options options = sim_arena_default();
            pose_errors errors[WAYS];
            sim_arena *arena;

            memset(errors, 0, sizeof errors);
            options.scene = scenes[k];
            options.seed = seed;
            arena = sim_arena_create(&options, NULL, 0);
            assert_non_null(arena);
            compare_ways(arena, seed, scan, icp, errors);
            sim_arena_free(arena);
            for (int way = 0; way < WAYS; way++)
                add_errors(&sum[way], &errors[way]);
            /* Ignoring it degrades every arena. */
            assert_true(errors[IGNORED].metres > 10 * errors[TURNING].metres);
            assert_true(errors[IGNORED].radians > 50 * errors[TURNING].radians);
        }
    test_pool_free(&pool);
    assert_true(sum[STILL].pairs > 200);
    assert_int_equal(sum[TURNING].pairs, sum[STILL].pairs);
    assert_true(sum[STILL].metres / sum[STILL].pairs < 0.002);
    assert_true(sum[STILL].radians / sum[STILL].pairs < 0.0006);
    assert_true(sum[TURNING].metres < 1.1 * sum[STILL].metres);
    assert_true(sum[TURNING].radians < 1.1 * sum[STILL].radians);
    assert_true(sum[DRIVING].metres < 1.2 * sum[STILL].metres);
    assert_true(sum[DRIVING].radians < 1.2 * sum[STILL].radians);
}

/* ---- Force field: a room that is seen by full scans ---- */

typedef struct room {
    sim_arena *arena;
    sim_survey *survey;
    const sim_scan *scans;
    sim_pose start[8];
    int32_t count;
    cairn_pool pool;
    cairn_force_field *field;
} room;

/* Eight full scans of one place within 0.8 m; the first is fixed at its true pose, the others have
 * errors of at most so much. */
static void begin_room(room *r, sim_scene scene, uint64_t seed, double metres, double radians,
                       const cairn_force_field_params *params)
{
    cairn_force_field_params field_params = *params;
    cairn_scan_params scan_params = cairn_scan_default();
    sim_arena_options arena_options = sim_arena_default();
    sim_survey_options options = sim_survey_default();
    cairn_scan *scan;

    arena_options.scene = scene;
    arena_options.seed = seed;
    r->arena = sim_arena_create(&arena_options, NULL, 0);
    assert_non_null(r->arena);
    options.seed = seed;
    options.places = 1;
    options.headings = 8;
    options.jitter_position = 0.8;
    options.beams = 361;
    options.fov = 6.283185307179586;
    r->survey = sim_survey_create(r->arena, &options, NULL, 0);
    assert_non_null(r->survey);
    r->scans = sim_survey_scans(r->survey, &r->count);
    assert_int_equal(r->count, 8);
    sim_survey_disturb(r->survey, seed, metres, radians, r->start);
    r->start[0] = r->scans[0].truth;
    field_params.max_points = 8 * 1024;
    field_params.max_segments = 8 * 128;
    r->pool = test_pool(cairn_scan_memory(&scan_params) + cairn_force_field_memory(&field_params));
    assert_ok(cairn_scan_create(&scan, &r->pool, &scan_params));
    assert_ok(cairn_force_field_create(&r->field, &r->pool, &field_params));
    for (int32_t i = 0; i < r->count; i++) {
        cairn_scan_input input = sim_scan_input(&r->scans[i]);
        cairn_budget budget = {CAIRN_UNBOUNDED};
        cairn_scan_view view;

        assert_ok(cairn_scan_begin(scan, &input, NULL));
        assert_ok(cairn_scan_step(scan, &budget));
        view = cairn_scan_read(scan);
        assert_ok(cairn_force_field_add_scan(r->field, &view, NULL, pose_of(r->start[i]), NULL));
    }
    assert_ok(cairn_force_field_fix(r->field, 0, 1));
}

static void end_room(room *r)
{
    test_pool_free(&r->pool);
    sim_survey_free(r->survey);
    sim_arena_free(r->arena);
}

static void iterate(cairn_force_field *field)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_true(cairn_force_field_iterate(field, &budget) >= 0);
}

/* Mean errors of the free scans, at the start and now. */
static void room_errors(const room *r, pose_errors *start, pose_errors *now)
{
    memset(start, 0, sizeof *start);
    memset(now, 0, sizeof *now);
    for (int32_t i = 1; i < r->count; i++) {
        cairn_pose truth = pose_of(r->scans[i].truth);
        cairn_pose before = cairn_pose_between(truth, pose_of(r->start[i]));
        cairn_pose after = cairn_pose_between(truth, cairn_force_field_pose(r->field, i));

        start->metres += hypot((double)before.x, (double)before.y) / (r->count - 1);
        start->radians += fabs((double)before.theta) / (r->count - 1);
        now->metres += hypot((double)after.x, (double)after.y) / (r->count - 1);
        now->radians += fabs((double)after.theta) / (r->count - 1);
    }
}

static void a_disturbed_room_comes_back(void **state)
{
    cairn_force_field_params params = cairn_force_field_default();
    static const sim_scene scenes[] = {SIM_ROOMS, SIM_APARTMENT, SIM_RESCUE};

    pose_errors starts = {0, 0, 0}, ends = {0, 0, 0};

    (void)state;
    for (int k = 0; k < 3; k++)
        for (uint64_t seed = 1; seed <= 3; seed++) {
            pose_errors start, now;
            room r;

            begin_room(&r, scenes[k], seed, 0.05, 0.05, &params);
            do
                iterate(r.field);
            while (cairn_force_field_read(r.field).verdict == CAIRN_FORCE_FIELD_RUNNING);
            room_errors(&r, &start, &now);
            add_errors(&starts, &start);
            add_errors(&ends, &now);
            assert_true(start.metres > 0.025 && start.radians > 0.015);
            assert_true(now.metres < 0.01 && now.radians < 0.009);
            /* What is fixed stays. */
            assert_near(cairn_force_field_pose(r.field, 0).x, r.scans[0].truth.x,
                        NUMBER(1e-12, 1e-6));
            end_room(&r);
        }
    assert_true(ends.metres < starts.metres / 6);
    assert_true(ends.radians < starts.radians / 6);
}

/* At constant sigma and with small steps every step decreases the potential; that of the true poses
 * is lower still. */
static void the_potential_falls(void **state)
{
    cairn_force_field_params params = cairn_force_field_default();

    (void)state;
    params.sigma_start = CAIRN_REAL(0.08);
    params.sigma_end = CAIRN_REAL(0.08);
    params.sigma_step = 0;
    params.dt_start = CAIRN_REAL(0.006);
    params.dt_end = CAIRN_REAL(0.006);
    params.roi = 0;
    params.stop_relocation = 0;
    params.max_steps = 1000;
    for (uint64_t seed = 1; seed <= 2; seed++) {
        cairn_real first = 0, last = 0, potential;
        pose_errors start, now;
        room r;

        begin_room(&r, SIM_ROOMS, seed, 0.05, 0.05, &params);
        for (int step = 0; step < 40; step++) {
            iterate(r.field);
            potential = cairn_force_field_potential(r.field);
            assert_true(potential < 0);
            if (step == 0)
                first = potential;
            else
                assert_true(potential < last);
            last = potential;
        }
        room_errors(&r, &start, &now);
        assert_true(now.metres < 0.9 * start.metres);
        assert_true(last < CAIRN_REAL(1.03) * first);
        end_room(&r);

        /* The same from the truth. */
        begin_room(&r, SIM_ROOMS, seed, 0, 0, &params);
        iterate(r.field);
        assert_true(cairn_force_field_potential(r.field) < last);
        end_room(&r);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(motion_correction_brings_sweeps_back),
        cmocka_unit_test(a_disturbed_room_comes_back),
        cmocka_unit_test(the_potential_falls),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
