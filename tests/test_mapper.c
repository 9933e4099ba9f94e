/* The mapper on simulated drives: accuracy, window, memory, motion during a sweep, stored
 * results. */
#include "tests/drive.h"
#include "tests/rooms.h"

#include <math.h>

/* The outcome of a drive: the poses of the mapper. */
typedef struct trace {
    cairn_mapper_result results[400];
    cairn_pose poses[400];
    int32_t count;
} trace;

typedef enum odometry_kind { WITH, WITHOUT, NEVER_BACK } odometry_kind;

/* odometry NEVER_BACK: the defect of a real log, where a robot that backs up is reported as driving
 * ahead. */
static void run(cairn_mapper *mapper, const drive *d, odometry_kind how, int32_t budget, trace *t)
{
    cairn_pose odometry_pose = pose_of(d->scans[0].odometry);

    t->count = d->count;
    for (int32_t i = 0; i < d->count; i++) {
        cairn_scan_input input = sim_scan_input(&d->scans[i]);
        cairn_budget left = {budget};
        cairn_status status;

        if (i > 0) {
            cairn_pose step = cairn_pose_between(pose_of(d->scans[i - 1].odometry),
                                                 pose_of(d->scans[i].odometry));

            if (how == NEVER_BACK)
                step.x = cairn_abs(step.x);
            odometry_pose = cairn_pose_compose(odometry_pose, step);
        }
        assert_taken(
            cairn_mapper_add(mapper, &input, how == WITHOUT ? NULL : &odometry_pose, NULL));
        while ((status = cairn_mapper_step(mapper, &left)) == CAIRN_MORE) {
            assert_int_equal(left.left, 0);
            left.left = budget;
        }
        assert_ok(status);
        t->results[i] = cairn_mapper_read(mapper);
    }
    for (int32_t i = 0; i < d->count; i++)
        t->poses[i] = cairn_pose_compose(cairn_mapper_keyframe_pose(mapper, t->results[i].keyframe),
                                         t->results[i].keyframe_scan);
}

/* Mean position error relative to the first scan, in m. */
static double mean_error(const drive *d, const trace *t, int32_t odometry_alone)
{
    double sum = 0;

    for (int32_t i = 0; i < d->count; i++) {
        cairn_pose truth =
            cairn_pose_between(pose_of(d->scans[0].truth), pose_of(d->scans[i].truth));
        cairn_pose found = odometry_alone ? cairn_pose_between(pose_of(d->scans[0].odometry),
                                                               pose_of(d->scans[i].odometry))
                                          : cairn_pose_between(t->poses[0], t->poses[i]);

        sum += hypot((double)(truth.x - found.x), (double)(truth.y - found.y));
    }
    return sum / d->count;
}

static trace one, two;

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

/* Maps an apartment for each of five seeds; the median of the mean errors. A single match may be
 * wrong where scans are far apart, and corrupts what follows, so that not every drive is good. */
static double median_error(const cairn_mapper_params *params)
{
    double errors[5];

    for (uint64_t seed = 0; seed < 5; seed++) {
        drive d = start_drive(SIM_APARTMENT, seed + 1, 120, 0.02, 0.4);
        cairn_pool pool;
        cairn_mapper *mapper = new_mapper(&pool, params);
        cairn_mapper_state measured;

        run(mapper, &d, WITH, CAIRN_UNBOUNDED, &one);
        errors[seed] = mean_error(&d, &one, 0);
        assert_true(mean_error(&d, &one, 1) > 2 * errors[seed]);
        measured = cairn_mapper_measure(mapper);
        assert_int_equal(measured.scans, 120);
        assert_int_equal(measured.keyframes, cairn_mapper_keyframes(mapper)->scan_count);
        assert_true(measured.keyframes > 5 && measured.keyframes < 120);
        assert_true(measured.predicted <= 3);
        assert_true(measured.units > 120 * 100);
        test_pool_free(&pool);
        end_drive(&d);
    }
    qsort(errors, 5, sizeof *errors, compare);
    return errors[2];
}

static void maps_better_than_odometry(void **state)
{
    cairn_mapper_params params = small_params();

    (void)state;
    assert_true(median_error(&params) < 0.06);
    params.window = 0;
    assert_true(median_error(&params) < 0.06);
}

static void maps_without_odometry(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_APARTMENT, 2, 400, 0.02, 0.1);
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, &params);

    (void)state;
    run(mapper, &d, WITHOUT, CAIRN_UNBOUNDED, &one);
    assert_true(mean_error(&d, &one, 0) < 0.1);
    /* The map's frame is then that of the first scan. */
    assert_near(one.poses[0].x, 0, 0);
    assert_near(one.poses[0].theta, 0, 0);
    /* Indices outside read no array. */
    for (int k = 0; k < 4; k++) {
        const int32_t outside[] = {-1, 100000, INT32_MIN, INT32_MAX};

        assert_near(cairn_mapper_keyframe_pose(mapper, outside[k]).x, 0, 0);
        assert_int_equal(cairn_mapper_keyframe_slot(mapper, outside[k]), -1);
        assert_int_equal(cairn_mapper_link_at(mapper, outside[k]).first, -1);
        assert_int_equal(cairn_mapper_loop_at(mapper, outside[k]).first, -1);
        assert_int_equal(cairn_mapper_culling_at(mapper, outside[k]).keyframe, -1);
    }
    test_pool_free(&pool);
    end_drive(&d);
}

static void odometry_that_never_goes_back_is_rejected(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_RESCUE, 4, 200, 0.01, 0.4);
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, &params);

    (void)state;
    run(mapper, &d, NEVER_BACK, CAIRN_UNBOUNDED, &one);
    assert_true(mean_error(&d, &one, 0) < 0.1);
    test_pool_free(&pool);
    end_drive(&d);
}

static void budgets_do_not_matter(void **state)
{
    static const int32_t budgets[] = {1, 7, 1000};
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_APARTMENT, 5, 40, 0.02, 0.4);
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, &params);

    (void)state;
    run(mapper, &d, WITH, CAIRN_UNBOUNDED, &one);
    test_pool_free(&pool);
    for (size_t b = 0; b < sizeof budgets / sizeof *budgets; b++) {
        mapper = new_mapper(&pool, &params);
        run(mapper, &d, WITH, budgets[b], &two);
        for (int32_t i = 0; i < d.count; i++) {
            assert_memory_equal(&one.poses[i], &two.poses[i], sizeof one.poses[i]);
            assert_memory_equal(one.results[i].covariance, two.results[i].covariance,
                                sizeof one.results[i].covariance);
        }
        test_pool_free(&pool);
    }
    end_drive(&d);
}

static void verdicts_say_how_a_pose_was_found(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_APARTMENT, 6, 30, 0, 0.4);
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, &params);
    cairn_scan_input blind = sim_scan_input(&d.scans[0]);
    cairn_pose ahead = pose_of(d.scans[29].odometry), jump = {CAIRN_REAL(0.2), 0, 0};
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_mapper_result result;
    static float nothing[181];

    (void)state;
    run(mapper, &d, WITH, CAIRN_UNBOUNDED, &one);
    assert_int_equal(one.results[0].verdict, CAIRN_MAPPER_FIRST);
    assert_int_equal(one.results[0].is_keyframe, 1);
    assert_near(one.results[0].overlap, 0, 0);
    for (int32_t i = 1; i < 30; i++) {
        assert_int_equal(one.results[i].verdict, CAIRN_MAPPER_MATCHED);
        assert_true((double)one.results[i].overlap > 0.5 && one.results[i].overlap <= 1);
        assert_true(one.results[i].covariance[0] > 0 && one.results[i].covariance[8] > 0);
        assert_true(one.results[i].keyframe >= one.results[i - 1].keyframe);
        assert_true(one.results[i].is_keyframe ==
                    (one.results[i].keyframe > one.results[i - 1].keyframe));
    }

    for (int i = 0; i < 181; i++)
        nothing[i] = NAN;
    blind.range = nothing;
    ahead = cairn_pose_compose(ahead, jump);
    assert_taken(cairn_mapper_add(mapper, &blind, &ahead, NULL));
    assert_ok(cairn_mapper_step(mapper, &budget));
    result = cairn_mapper_read(mapper);
    assert_int_equal(result.verdict, CAIRN_MAPPER_NO_FEATURES);
    assert_int_equal(result.is_keyframe, 0);
    assert_int_equal(cairn_mapper_view(mapper).point_count, 0);
    assert_int_equal(cairn_mapper_view(mapper).beam_count, 181);
    {
        cairn_pose moved = cairn_pose_between(one.results[29].keyframe_scan, result.keyframe_scan);

        assert_int_equal(result.keyframe, one.results[29].keyframe);
        assert_near(moved.x, 0.2, 1e-4);
        assert_near(moved.y, 0, 1e-4);
    }
    assert_int_equal(cairn_mapper_measure(mapper).predicted, 1);
    test_pool_free(&pool);
    end_drive(&d);
}

/* A scan that matches nowhere gets the predicted pose. The third in a row is a keyframe. */
static void what_does_not_match_is_predicted(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_APARTMENT, 7, 20, 0, 0.4),
          other = start_drive(SIM_ROUND, 1, 2, 0, 0.4);
    cairn_pool pool;
    cairn_mapper *mapper;
    cairn_scan_input input = sim_scan_input(&other.scans[0]);
    cairn_pose far = {50, 0, 0}, from;
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_mapper_result result;

    (void)state;
    params.min_overlap = CAIRN_REAL(0.9);
    mapper = new_mapper(&pool, &params);
    run(mapper, &d, WITH, CAIRN_UNBOUNDED, &one);
    from = pose_of(d.scans[19].odometry);
    far = cairn_pose_compose(from, far);
    for (int32_t i = 1; i <= 3; i++) {
        assert_taken(cairn_mapper_add(mapper, &input, &far, NULL));
        assert_ok(cairn_mapper_step(mapper, &budget));
        result = cairn_mapper_read(mapper);
        assert_int_equal(result.verdict, CAIRN_MAPPER_PREDICTED);
        assert_int_equal(result.is_keyframe, i == 3);
    }
    assert_near(cairn_pose_between(one.poses[19], result.map_scan).x, 50, 1e-3);
    test_pool_free(&pool);
    end_drive(&other);
    end_drive(&d);
}

static void capacities_and_bad_input_change_nothing(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_APARTMENT, 8, 60, 0, 0.4);
    cairn_pool pool;
    cairn_mapper *mapper;
    cairn_scan_input input = sim_scan_input(&d.scans[0]);
    cairn_pose bad = {0, 0, 0};
    cairn_budget budget = {CAIRN_UNBOUNDED}, none = {0};
    cairn_status status = CAIRN_OK;
    int32_t i;

    (void)state;
    params.max_keyframes = 2;
    mapper = new_mapper(&pool, &params);
    assert_status(cairn_mapper_add(NULL, &input, NULL, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_mapper_step(NULL, &budget), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_mapper_step(mapper, NULL), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_mapper_step(mapper, &none));
    assert_status(cairn_mapper_add(mapper, NULL, NULL, NULL), CAIRN_BAD_ARGUMENT);
    bad.theta = (cairn_real)NAN;
    assert_status(cairn_mapper_add(mapper, &input, &bad, NULL), CAIRN_NOT_FINITE);
    input.count = 182;
    assert_status(cairn_mapper_add(mapper, &input, NULL, NULL), CAIRN_FULL);
    input.count = 181;
    assert_taken(cairn_mapper_add(mapper, &input, NULL, NULL));
    assert_status(cairn_mapper_step(mapper, &none), CAIRN_MORE);
    assert_status(cairn_mapper_add(mapper, &input, NULL, NULL), CAIRN_BUSY);
    assert_ok(cairn_mapper_step(mapper, &budget));
    for (i = 1; i < d.count && status == CAIRN_OK; i++) {
        input = sim_scan_input(&d.scans[i]);
        budget.left = CAIRN_UNBOUNDED;
        assert_taken(cairn_mapper_add(mapper, &input, NULL, NULL));
        status = cairn_mapper_step(mapper, &budget);
    }
    assert_status(status, CAIRN_FULL);
    assert_int_equal(cairn_mapper_measure(mapper).keyframes, 2);
    assert_int_equal(cairn_mapper_read(mapper).verdict, CAIRN_MAPPER_MATCHED);
    assert_int_equal(cairn_mapper_read(mapper).is_keyframe, 0);
    assert_int_equal(cairn_mapper_read(mapper).keyframe, 1);
    assert_status(cairn_mapper_add(mapper, &input, NULL, NULL), CAIRN_FULL);
    test_pool_free(&pool);
    end_drive(&d);
}

/* The loop that people write maps every scan; in one call, the same bits. */
static void no_scan_is_lost_by_the_loop_of_add_and_step(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_APARTMENT, 3, 40, 0.02, 0.4);
    cairn_pool pools[2];
    cairn_mapper *by_steps = new_mapper(&pools[0], &params),
                 *by_call = new_mapper(&pools[1], &params);

    (void)state;
    for (int32_t i = 0; i < d.count; i++) {
        cairn_scan_input input = sim_scan_input(&d.scans[i]);
        cairn_mapper_result stepped, called;
        cairn_status status = cairn_mapper_add(by_steps, &input, NULL, NULL);

        while (status == CAIRN_MORE) {
            cairn_budget budget = {700};

            status = cairn_mapper_step(by_steps, &budget);
        }
        assert_ok(status);
        assert_ok(cairn_mapper_map(by_call, &input, NULL, NULL));
        stepped = cairn_mapper_read(by_steps);
        called = cairn_mapper_read(by_call);
        assert_memory_equal(&stepped.map_scan, &called.map_scan, sizeof called.map_scan);
        assert_memory_equal(stepped.covariance, called.covariance, sizeof called.covariance);
    }
    assert_int_equal(cairn_mapper_measure(by_steps).scans, d.count);
    assert_int_equal(cairn_mapper_measure(by_call).scans, d.count);
    test_pool_free(&pools[0]);
    test_pool_free(&pools[1]);
    end_drive(&d);
}

/* A scan that comes while the last one is being processed is refused, not lost. */
static void a_scan_that_comes_too_early_is_refused(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_APARTMENT, 3, 2, 0.02, 0.4);
    cairn_scan_input first = sim_scan_input(&d.scans[0]), second = sim_scan_input(&d.scans[1]);
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, &params);
    cairn_budget few = {10}, all = {CAIRN_UNBOUNDED};
    cairn_fault fault;

    (void)state;
    assert_taken(cairn_mapper_add(mapper, &first, NULL, NULL));
    assert_status(cairn_mapper_step(mapper, &few), CAIRN_MORE);
    assert_fault(&fault, cairn_mapper_add(mapper, &second, NULL, &fault), CAIRN_BUSY, -1);
    assert_fault(&fault, cairn_mapper_map(mapper, &second, NULL, &fault), CAIRN_BUSY, -1);
    assert_ok(cairn_mapper_step(mapper, &all));
    assert_int_equal(cairn_mapper_measure(mapper).scans, 1);
    assert_ok(cairn_mapper_map(mapper, &second, NULL, NULL));
    assert_int_equal(cairn_mapper_measure(mapper).scans, 2);
    test_pool_free(&pool);
    end_drive(&d);
}

/* The force field moves the free keyframes of its window, and nothing else; with enough units, all
 * before the next scan. Returns how many times a keyframe moved. */
static int32_t moves_of_the_window(int32_t units)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_APARTMENT, 10, 60, 0.02, 0.4);
    cairn_pool pool;
    cairn_mapper *mapper;
    cairn_pose before[200];
    int32_t keys = 0, moved = 0;

    params.window_units = units;
    mapper = new_mapper(&pool, &params);
    for (int32_t i = 0; i < d.count; i++) {
        cairn_scan_input input = sim_scan_input(&d.scans[i]);
        cairn_pose odometry_pose = pose_of(d.scans[i].odometry);
        cairn_budget budget = {CAIRN_UNBOUNDED};

        assert_taken(cairn_mapper_add(mapper, &input, &odometry_pose, NULL));
        assert_ok(cairn_mapper_step(mapper, &budget));
        for (int32_t k = 0; k < keys; k++) {
            cairn_pose now = cairn_mapper_keyframe_pose(mapper, k);
            int32_t same = memcmp(&now, &before[k], sizeof now) == 0;
            int32_t count = cairn_mapper_measure(mapper).keyframes;

            moved += !same;
            if (k == 0 || k < keys - params.window_free ||
                (units == CAIRN_UNBOUNDED && count == keys))
                assert_true(same);
        }
        keys = cairn_mapper_measure(mapper).keyframes;
        for (int32_t k = 0; k < keys; k++)
            before[k] = cairn_mapper_keyframe_pose(mapper, k);
    }
    if (units >= 8000)
        assert_true(moved > keys / 2 && cairn_mapper_measure(mapper).potential < 0);
    test_pool_free(&pool);
    end_drive(&d);
    return moved;
}

static void the_window_moves_its_free_keyframes(void **state)
{
    int32_t at_once = moves_of_the_window(CAIRN_UNBOUNDED), by_and_by = moves_of_the_window(8000);

    (void)state;
    assert_true(at_once > 0);
    assert_true(by_and_by > 0);
    assert_true(moves_of_the_window(1) < at_once);
}

static cairn_status create(void *context, cairn_pool *pool)
{
    cairn_mapper *mapper;

    return cairn_mapper_create(&mapper, pool, context);
}

static void memory_is_exact(void **state)
{
    cairn_mapper_params params = small_params();

    (void)state;
    params.scan.max_beams = 8;
    params.scan.max_points = 8;
    params.scan.max_segments = 4;
    params.max_keyframes = 2;
    params.max_keyframe_points = 16;
    params.max_keyframe_segments = 8;
    params.local_keyframes = 2;
    params.local_recent = 1;
    params.window = 2;
    params.window_free = 1;
    params.loop.max_loops = 2;
    params.loop.max_fill = 4;
    params.loop.target_keyframes = 1;
    test_every_pool_size(create, &params, cairn_mapper_memory(&params));
    params.loop.max_loops = 0;
    test_every_pool_size(create, &params, cairn_mapper_memory(&params));
    params.search = 0;
    test_every_pool_size(create, &params, cairn_mapper_memory(&params));
    params.window = 0;
    test_every_pool_size(create, &params, cairn_mapper_memory(&params));
}

/* Without a search the matches of loop closures alone need memory: that of their target. */
static void memory_grows_with_the_target_of_loop_closures(void **state)
{
    cairn_mapper_params params = cairn_mapper_default();
    size_t bytes[3];

    (void)state;
    params.search = 0;
    for (int32_t i = 0; i < 3; i++) {
        params.loop.target_keyframes = 1 + i;
        bytes[i] = cairn_mapper_memory(&params);
    }
    assert_true(bytes[1] > bytes[0]);
    assert_true(bytes[2] > bytes[1]);
}

/* The mapper's memory is a constant part plus a fixed amount for each of them. */
static void memory_grows_with_the_keyframes(void **state)
{
    size_t bytes[3];

    (void)state;
    for (int i = 0; i < 3; i++) {
        cairn_mapper_params params = cairn_mapper_default_for(64 << i, 181);

        assert_int_equal(params.max_keyframes, 64 << i);
        assert_int_equal(params.scan.max_beams, 181);
        assert_int_equal(params.max_keyframe_points, (64 << i) * 160 + params.scan.max_points);
        assert_int_equal(params.max_keyframe_segments, (64 << i) * 40 + params.scan.max_segments);
        assert_int_equal(params.loop.max_loops, 4 * (64 << i));
        assert_int_equal(params.loop.max_fill, 40 * (64 << i));
        bytes[i] = cairn_mapper_memory(&params);
    }
    assert_int_equal(bytes[2] - bytes[1], 2 * (bytes[1] - bytes[0]));
    assert_true(bytes[0] < 2 << 20);
    {
        cairn_mapper_params most = cairn_mapper_default_for(1 << 20, 181);

        assert_int_equal(most.max_keyframe_points, 1 << 24);
        assert_int_equal(most.max_keyframe_segments, 1 << 24);
        assert_int_equal(most.loop.max_loops, 1 << 22);
        assert_int_equal(most.loop.max_fill, 40 << 20);
        assert_true(cairn_mapper_memory(&most) > 0);
    }
}

static void bad_params_are_refused(void **state)
{
    cairn_pool pool = test_pool(1024);
    cairn_mapper *mapper;
    cairn_mapper_params good = small_params();

    (void)state;
    assert_true(cairn_mapper_memory(&good) > 0);
    assert_int_equal(cairn_mapper_memory(NULL), 0);
    assert_status(cairn_mapper_create(&mapper, &pool, NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_mapper_create(NULL, &pool, &good), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_mapper_create(&mapper, NULL, &good), CAIRN_BAD_ARGUMENT);
/* Rules between parameters; tests/test_object.c has the ranges. */
#define REFUSED(field, value)                                                                      \
    do {                                                                                           \
        cairn_mapper_params bad = good;                                                            \
        cairn_object_fault fault = {.rule = NULL};                                                 \
        bad.field = value;                                                                         \
        assert_status(cairn_mapper_check(&bad, &fault), CAIRN_BAD_ARGUMENT);                       \
        assert_non_null(fault.rule);                                                               \
        assert_int_equal(cairn_mapper_memory(&bad), 0);                                            \
        assert_status(cairn_mapper_create(&mapper, &pool, &bad), CAIRN_BAD_ARGUMENT);              \
    } while (0)
    /* below the points and segments of one keyframe */
    REFUSED(max_keyframe_points, good.scan.max_points - 1);
    REFUSED(max_keyframe_segments, good.scan.max_segments - 1);
    REFUSED(local_recent, good.local_keyframes + 1);
    REFUSED(local_span, good.local_recent - 1);
    REFUSED(window, 1);
    REFUSED(window_free, good.window);
    REFUSED(scan.max_points, 0);
    REFUSED(scan.max_points, (1 << 17) + 1);
    REFUSED(scan.max_segments, 0);
    REFUSED(scan.max_segments, (1 << 17) + 1);
    REFUSED(scan.max_beams, 0);
    REFUSED(icp.max_iterations, 0);
    REFUSED(field.max_steps, 0);
#undef REFUSED
    assert_int_equal(pool.used, 0);
#define ALLOWED(field, value)                                                                      \
    do {                                                                                           \
        cairn_mapper_params edge = good;                                                           \
        edge.field = value;                                                                        \
        assert_true(cairn_mapper_memory(&edge) > 0);                                               \
    } while (0)
    ALLOWED(max_keyframes, 1);
    ALLOWED(max_keyframes, 1 << 20);
    ALLOWED(local_keyframes, good.local_recent);
    ALLOWED(local_keyframes, CAIRN_MAPPER_MAX_LOCAL_KEYFRAMES);
    ALLOWED(local_span, 0);
    ALLOWED(max_local_points, 1);
    ALLOWED(max_local_points, 1 << 20);
    ALLOWED(window_units, 1);
    ALLOWED(search_units, 1);
    ALLOWED(search, 0);
    ALLOWED(keyframe_min_overlap, 0);
    ALLOWED(keyframe_min_overlap, 1);
    ALLOWED(motion_distance, 0);
    ALLOWED(motion_turn, 0);
    ALLOWED(local_span, good.local_recent);
    ALLOWED(loop.max_loops, 0);
    ALLOWED(loop.max_loops, 1 << 22);
    ALLOWED(loop.max_fill, 0);
    ALLOWED(loop.units_per_scan, 1);
    ALLOWED(loop.target_keyframes, 1);
    ALLOWED(loop.target_keyframes, 64);
    ALLOWED(loop.min_keyframe_gap, 1);
    ALLOWED(loop.min_consistent, 1);
    ALLOWED(loop.min_consistent, 8);
    ALLOWED(loop.max_free_space_violation, 0);
    ALLOWED(loop.max_free_space_violation, 1);
    ALLOWED(local_recent, 1);
    ALLOWED(local_recent, good.local_keyframes);
    ALLOWED(window, 64);
    ALLOWED(window_free, 1);
    ALLOWED(window_free, good.window - 1);
    ALLOWED(odometry_distance, 0);
    ALLOWED(odometry_turn, 0);
    ALLOWED(min_overlap, 0);
    ALLOWED(min_overlap, 1);
    good.window = 0;
    good.window_free = 0;
    ALLOWED(local_keyframes, CAIRN_MAPPER_MAX_LOCAL_KEYFRAMES);
    good.window = 2;
    good.window_free = 1;
    ALLOWED(max_keyframes, 1);
    good.local_keyframes = good.local_recent = 1;
    ALLOWED(max_keyframes, 1);
    ALLOWED(max_keyframe_points, good.scan.max_points);
    ALLOWED(max_keyframe_segments, good.scan.max_segments);
    good.max_keyframe_points = good.max_keyframe_segments = 1 << 17;
    ALLOWED(scan.max_points, 1);
    ALLOWED(scan.max_points, 1 << 17);
    ALLOWED(scan.max_segments, 1);
    ALLOWED(scan.max_segments, 1 << 17);
#undef ALLOWED
    test_pool_free(&pool);
}

/* ---- Golden results ---- */

/* All readable results of a drive round a room and back, with odometry that degrades and one scan
 * without returns; not the units, to which many modules contribute. `odometry` 0: none. */
static uint64_t hash_of_round(const cairn_mapper_params *params, int32_t odometry)
{
    cairn_random random = cairn_random_seed(21, 1);
    cairn_pose at = {-2, -1, 0}, odometry_pose = {5, 5, 1};
    uint64_t hash = TEST_HASH_START;
    cairn_mapper_state state;
    rooms_room room;
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, params);

    memset(&room, 0, sizeof room);
    rooms_add_box(&room, -3.5, -2.5, 3.5, 2.5);
    rooms_add_box(&room, -1.2, -0.2, -0.6, 0.6);
    rooms_add_wall(&room, 2, 2.5, 3.5, 1.2);
    rooms_add_box(&room, -3.5, 0.5, -3, 1.5);
    for (int32_t i = 0; i < 60; i++) {
        cairn_pose step = {CAIRN_REAL(0.2), 0, i % 12 > 8 ? CAIRN_REAL(0.52) : 0}, measured = step;
        cairn_budget budget = {CAIRN_UNBOUNDED};
        cairn_mapper_result r;
        rooms_scan taken;
        cairn_scan_input input = rooms_take_scan(&room, at, (uint64_t)i + 1, &taken);

        for (int32_t k = 0; k < ROOMS_BEAMS && i == 30; k++)
            taken.range[k] = NAN;
        assert_taken(cairn_mapper_add(mapper, &input, odometry ? &odometry_pose : NULL, NULL));
        assert_ok(cairn_mapper_step(mapper, &budget));
        r = cairn_mapper_read(mapper);
        hash = test_hash(hash, &r.verdict, 2 * sizeof r.verdict);
        hash = test_hash(hash, &r.keyframe_scan, sizeof r.keyframe_scan);
        hash = test_hash(hash, &r.map_scan, sizeof r.map_scan);
        hash = test_hash(hash, r.covariance, sizeof r.covariance);
        hash = test_hash(hash, &r.overlap, sizeof r.overlap);
        hash = test_hash(hash, &r.is_keyframe, sizeof r.is_keyframe);
        at = cairn_pose_compose(at, step);
        measured.x += CAIRN_REAL(0.002) * (cairn_real)i * cairn_random_uniform(&random, -1, 1);
        measured.theta += CAIRN_REAL(0.004) * (cairn_real)i * cairn_random_uniform(&random, -1, 1);
        odometry_pose = cairn_pose_compose(odometry_pose, measured);
    }
    {
        cairn_budget budget = {CAIRN_UNBOUNDED};
        cairn_pose map_odom;

        assert_ok(cairn_mapper_settle(mapper, &budget));
        map_odom = cairn_mapper_map_odom(mapper);
        hash = test_hash(hash, &map_odom, sizeof map_odom);
    }
    state = cairn_mapper_measure(mapper);
    for (int32_t i = state.loop_events > 64 ? state.loop_events - 64 : 0; i < state.loop_events;
         i++) {
        cairn_mapper_loop event = cairn_mapper_loop_at(mapper, i);

        hash = test_hash(hash, &event.first, 2 * sizeof event.first);
        hash = test_hash(hash, &event.first_second, sizeof event.first_second);
        hash = test_hash(hash, &event.verdict, sizeof event.verdict);
    }
    for (int32_t k = 0; k < state.keyframes; k++) {
        cairn_pose pose = cairn_mapper_keyframe_pose(mapper, k);

        hash = test_hash(hash, &pose, sizeof pose);
    }
    hash = test_hash(hash, &state.scans, 3 * sizeof state.scans);
    hash = test_hash(hash, &state.potential, sizeof state.potential);
    hash = test_hash(hash, &state.loops, 5 * sizeof state.loops);
    test_pool_free(&pool);
    return hash;
}

static void results_stay_as_they_are(void **state)
{
    cairn_mapper_params params = small_params(), narrow, loops;

    (void)state;
    params.scan.max_beams = ROOMS_BEAMS;
    narrow = loops = params;
    narrow.window = 0;
    narrow.local_keyframes = 4;
    narrow.local_radius = 2;
    loops.local_span = loops.local_recent;
    loops.loop.min_keyframe_gap = 6;
    loops.loop.min_consistent = 2;
    assert_golden(hash_of_round(&params, 1), UINT64_C(0xff690a006628b2c0),
                  UINT64_C(0x758ce0222bcde146));
    assert_golden(hash_of_round(&params, 0), UINT64_C(0x7ee7c1b71f986a4d),
                  UINT64_C(0x48d3403fd1292d19));
    assert_golden(hash_of_round(&narrow, 1), UINT64_C(0x70b3a78c8f1eb7ad),
                  UINT64_C(0x122965de3be09319));
    assert_golden(hash_of_round(&loops, 1), UINT64_C(0xad839fc144468651),
                  UINT64_C(0xda2a7f9103cbd76f));
}

/* ---- Motion during the sweep ---- */

enum { SPIN_SCANS = 110, SPIN_BEAMS = 241 };

/* A robot that stands, and then turns left by 1.2 rad/s along a small arc, ten scans a second; its
 * scanner covers 240 of 360 degrees of its turn. */
static sim_survey *start_spin(drive *d, uint64_t seed)
{
    static const double rate = 1.2, speed = 0.25, period = 0.1, pi = 3.14159265358979;
    sim_arena_options arena = sim_arena_default();
    sim_survey_options survey = sim_survey_default();
    sim_pose poses[SPIN_SCANS];
    sim_survey *places, *standing;
    int32_t count;

    arena.scene = SIM_APARTMENT;
    arena.seed = survey.seed = seed;
    survey.headings = 1;
    d->arena = sim_arena_create(&arena, NULL, 0);
    assert_non_null(d->arena);
    places = sim_survey_create(d->arena, &survey, NULL, 0);
    assert_non_null(places);
    poses[0] = sim_survey_scans(places, &count)[0].truth;
    sim_survey_free(places);
    for (int i = 1; i < SPIN_SCANS; i++) {
        double heading = poses[i - 1].theta + rate * period / 2;

        poses[i].x = poses[i - 1].x + speed * period * cos(heading);
        poses[i].y = poses[i - 1].y + speed * period * sin(heading);
        poses[i].theta = poses[i - 1].theta + rate * period;
    }
    survey.fov = 240 * pi / 180;
    survey.beams = SPIN_BEAMS;
    standing = sim_survey_at(d->arena, &survey, poses, 1, 0, 0, NULL, 0);
    assert_non_null(standing);
    survey.scan_time = period * 240 / 360;
    d->survey = sim_survey_at(d->arena, &survey, poses, SPIN_SCANS, speed, rate, NULL, 0);
    assert_non_null(d->survey);
    d->scans = sim_survey_scans(d->survey, &d->count);
    return standing;
}

/* Mean error of the headings relative to the first scan, rad; the mapper knows the duration of a
 * sweep, or not. */
static double heading_error(const drive *d, const sim_scan *standing, float time_step,
                            int32_t known, const cairn_pose *odometry)
{
    cairn_mapper_params params = small_params();
    cairn_pool pool;
    cairn_mapper *mapper;
    double sum = 0, first = 0;

    params.scan.max_beams = SPIN_BEAMS;
    mapper = new_mapper(&pool, &params);
    for (int32_t i = 0; i < d->count; i++) {
        cairn_scan_input input = sim_scan_input(i == 0 ? standing : &d->scans[i]);
        cairn_budget budget = {CAIRN_UNBOUNDED};
        double found;

        input.stamp_ns = (int64_t)i * 100000000;
        input.time_step = time_step;
        if (!known)
            input.motion = cairn_pose_identity();
        assert_taken(
            cairn_mapper_add(mapper, &input, odometry == NULL ? NULL : &odometry[i], NULL));
        assert_ok(cairn_mapper_step(mapper, &budget));
        found = (double)cairn_mapper_read(mapper).map_scan.theta - d->scans[i].truth.theta;
        if (i == 0)
            first = found;
        sum += fabs((double)cairn_wrap_angle((cairn_real)(found - first)));
    }
    test_pool_free(&pool);
    return sum / d->count;
}

static void turning_on_the_spot_does_not_rotate_the_map(void **state)
{
    static const float step = (float)(0.1 / 360);
    cairn_pose odometry[SPIN_SCANS];

    (void)state;
    for (uint64_t seed = 1; seed <= 4; seed++) {
        drive d;
        sim_survey *survey = start_spin(&d, seed);
        int32_t one_scan;
        const sim_scan *s = sim_survey_scans(survey, &one_scan);

        for (int i = 0; i < SPIN_SCANS; i++)
            odometry[i] = pose_of(d.scans[i].truth);
        assert_true(heading_error(&d, s, 0, 0, NULL) > 0.01);
        assert_true(heading_error(&d, s, step, 0, NULL) < 0.005);
        assert_true(heading_error(&d, s, 0, 0, odometry) > 0.01);
        assert_true(heading_error(&d, s, step, 0, odometry) < 0.004);
        assert_near(heading_error(&d, s, step, 1, NULL), heading_error(&d, s, 0, 1, NULL), 0);
        sim_survey_free(survey);
        end_drive(&d);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(results_stay_as_they_are),
        cmocka_unit_test(maps_better_than_odometry),
        cmocka_unit_test(maps_without_odometry),
        cmocka_unit_test(odometry_that_never_goes_back_is_rejected),
        cmocka_unit_test(turning_on_the_spot_does_not_rotate_the_map),
        cmocka_unit_test(budgets_do_not_matter),
        cmocka_unit_test(verdicts_say_how_a_pose_was_found),
        cmocka_unit_test(what_does_not_match_is_predicted),
        cmocka_unit_test(capacities_and_bad_input_change_nothing),
        cmocka_unit_test(no_scan_is_lost_by_the_loop_of_add_and_step),
        cmocka_unit_test(a_scan_that_comes_too_early_is_refused),
        cmocka_unit_test(the_window_moves_its_free_keyframes),
        cmocka_unit_test(memory_is_exact),
        cmocka_unit_test(memory_grows_with_the_target_of_loop_closures),
        cmocka_unit_test(memory_grows_with_the_keyframes),
        cmocka_unit_test(bad_params_are_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
