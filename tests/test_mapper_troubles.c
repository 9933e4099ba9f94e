/* Bad logs: scans without information, duplicates, stamps that run backwards, starts elsewhere. */
#include "tests/drive.h"

#include <math.h>

enum { SCANS = 300 };

static cairn_mapper_result results[SCANS];
static cairn_pose poses[SCANS];

/* One scan, processed completely, with odometry or none. */
static cairn_mapper_result take(cairn_mapper *mapper, const cairn_scan_input *input,
                                const cairn_pose *odometry)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_taken(cairn_mapper_add(mapper, input, odometry, NULL));
    assert_ok(cairn_mapper_step(mapper, &budget));
    return cairn_mapper_read(mapper);
}

static void settle(cairn_mapper *mapper, int32_t count)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};

    assert_ok(cairn_mapper_settle(mapper, &budget));
    for (int32_t i = 0; i < count; i++) {
        poses[i] = cairn_pose_compose(cairn_mapper_keyframe_pose(mapper, results[i].keyframe),
                                      results[i].keyframe_scan);
        assert_true(cairn_pose_is_finite(poses[i]));
    }
}

/* Largest position error of scans from ... end - 1 relative to scan `from`. */
static double worst_error(const drive *d, int32_t from, int32_t end)
{
    double worst = 0;

    for (int32_t i = from; i < end; i++) {
        cairn_pose truth =
            cairn_pose_between(pose_of(d->scans[from].truth), pose_of(d->scans[i].truth));
        cairn_pose found = cairn_pose_between(poses[from], poses[i]);

        worst = fmax(worst, hypot((double)(truth.x - found.x), (double)(truth.y - found.y)));
    }
    return worst;
}

static void an_empty_beginning(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_APARTMENT, 3, 200, 0.02, 0.2);
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, &params);
    static float nothing[181];

    (void)state;
    for (int i = 0; i < 181; i++)
        nothing[i] = NAN;
    for (int32_t i = 0; i < d.count; i++) {
        cairn_scan_input input = sim_scan_input(&d.scans[i]);
        cairn_pose odometry = pose_of(d.scans[i].odometry);

        if (i < 100)
            input.range = nothing;
        results[i] = take(mapper, &input, &odometry);
        if (i < 100)
            assert_int_equal(results[i].verdict, CAIRN_MAPPER_NO_FEATURES);
    }
    settle(mapper, d.count);
    assert_int_equal(results[101].verdict, CAIRN_MAPPER_MATCHED);
    assert_true(cairn_mapper_measure(mapper).predicted >= 100 &&
                cairn_mapper_measure(mapper).predicted <= 101);
    assert_true(worst_error(&d, 100, d.count) < 0.15);
    test_pool_free(&pool);
    end_drive(&d);
}

static void every_scan_twice(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_APARTMENT, 4, 150, 0.02, 0.2);
    int32_t keys[2];

    (void)state;
    for (int32_t times = 1; times <= 2; times++) {
        cairn_pool pool;
        cairn_mapper *mapper = new_mapper(&pool, &params);

        for (int32_t i = 0; i < d.count * times; i++) {
            cairn_scan_input input = sim_scan_input(&d.scans[i / times]);
            cairn_pose odometry = pose_of(d.scans[i / times].odometry);
            cairn_mapper_result result = take(mapper, &input, &odometry);

            results[i / times] = result;
        }
        settle(mapper, d.count);
        keys[times - 1] = cairn_mapper_measure(mapper).keyframes;
        assert_int_equal(cairn_mapper_measure(mapper).scans, d.count * times);
        assert_int_equal(cairn_mapper_measure(mapper).predicted, 0);
        assert_true(worst_error(&d, 0, d.count) < 0.15);
        test_pool_free(&pool);
    }
    assert_true(abs(keys[1] - keys[0]) <= keys[0] / 8);
    end_drive(&d);
}

/* Equal stamps carry no information: the order does not matter. */
static void time_that_runs_back(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_APARTMENT, 5, 60, 0.02, 0.2);
    cairn_pose forth[60];

    (void)state;
    for (int back = 0; back <= 1; back++) {
        cairn_pool pool;
        cairn_mapper *mapper = new_mapper(&pool, &params);

        for (int32_t i = 0; i < d.count; i++) {
            cairn_scan_input input = sim_scan_input(&d.scans[i]);
            cairn_pose odometry = pose_of(d.scans[i].odometry);

            input.stamp_ns = back ? -i : i;
            results[i] = take(mapper, &input, &odometry);
        }
        settle(mapper, d.count);
        if (back)
            assert_memory_equal(forth, poses, sizeof forth);
        memcpy(forth, poses, sizeof forth);
        test_pool_free(&pool);
    }
    end_drive(&d);
}

/* The robot is displaced to another room after its first scans, unknown to odometry. The mapper
 * reports low confidence, and maps the new place. */
static void a_kidnapped_start(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_APARTMENT, 6, 220, 0.02, 0.2);
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, &params);
    cairn_pose left = pose_of(d.scans[9].odometry), found = pose_of(d.scans[120].odometry);
    cairn_mapper_state before, after;

    (void)state;
    for (int32_t i = 0; i < 10; i++) {
        cairn_scan_input input = sim_scan_input(&d.scans[i]);
        cairn_pose odometry = pose_of(d.scans[i].odometry);

        results[i] = take(mapper, &input, &odometry);
    }
    before = cairn_mapper_measure(mapper);
    for (int32_t i = 120; i < d.count; i++) {
        cairn_scan_input input = sim_scan_input(&d.scans[i]);
        cairn_pose odometry =
            cairn_pose_compose(left, cairn_pose_between(found, pose_of(d.scans[i].odometry)));

        results[i] = take(mapper, &input, &odometry);
        if (i == 124)
            after = cairn_mapper_measure(mapper);
    }
    for (int32_t i = 10; i < 120; i++)
        results[i] = results[9];
    settle(mapper, d.count);
    assert_true(after.low_confidence + after.predicted > before.low_confidence + before.predicted);
    assert_true(worst_error(&d, 130, 170) < 0.05);
    assert_true(worst_error(&d, 130, d.count) < 0.3);
    test_pool_free(&pool);
    end_drive(&d);
}

/* A pose relative to the one predicted by odometry. */
static cairn_pose off_odometry(const drive *d, cairn_pose before, cairn_pose after, int32_t i)
{
    cairn_pose moved =
        cairn_pose_between(pose_of(d->scans[i - 1].odometry), pose_of(d->scans[i].odometry));

    return cairn_pose_between(cairn_pose_compose(before, moved), after);
}

/* Every scan of another building resembles this one somewhere. Hardly any moves the robot away from
 * the prediction of reliable odometry (one in ten did while a single match sufficed). */
static void scans_of_another_building_move_nothing(void **state)
{
    static const sim_scene elsewhere[] = {SIM_RESCUE, SIM_OFFICE, SIM_MAZE, SIM_ROOMS};
    cairn_mapper_params params = small_params();
    int32_t foreign = 0, moved = 0;

    (void)state;
    for (uint64_t seed = 11; seed < 15; seed++) {
        drive d = start_drive(SIM_APARTMENT, seed, 160, 0.02, 0.2);
        drive other = start_drive(elsewhere[seed % 4], seed + 50, 160, 0.02, 0.2);
        cairn_pool pool;
        cairn_mapper *mapper = new_mapper(&pool, &params);

        for (int32_t i = 0; i < d.count; i++) {
            int32_t is_foreign = i > 10 && i % 4 == 0;
            cairn_scan_input input = sim_scan_input(is_foreign ? &other.scans[i] : &d.scans[i]);
            cairn_pose odometry = pose_of(d.scans[i].odometry),
                       before = cairn_mapper_read(mapper).map_scan;
            cairn_mapper_result result = take(mapper, &input, &odometry);

            if (is_foreign) {
                cairn_pose off = off_odometry(&d, before, result.map_scan, i);

                foreign++;
                moved += hypot((double)off.x, (double)off.y) > 0.5 || fabs((double)off.theta) > 0.5;
            }
        }
        test_pool_free(&pool);
        end_drive(&d);
        end_drive(&other);
    }
    assert_true(foreign > 100);
    assert_true(moved * 30 < foreign);
}

enum { DISPLACED_AT = 100, SKIPPED = 10, DRIVES = 8 };

/* Drives, is displaced over SKIPPED scans unknown to its odometry, and drives on. 1: three scans
 * later its pose is right. */
static int is_found_again(const drive *d)
{
    cairn_mapper_params params = small_params();
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, &params);
    cairn_pose odometry_pose = pose_of(d->scans[0].truth), off = cairn_pose_identity();

    for (int32_t i = 0; i < DISPLACED_AT + 4; i++) {
        int32_t at = i < DISPLACED_AT ? i : i + SKIPPED;
        cairn_scan_input input = sim_scan_input(&d->scans[at]);

        if (i > 0 && i != DISPLACED_AT)
            odometry_pose = cairn_pose_compose(
                odometry_pose,
                cairn_pose_between(pose_of(d->scans[at - 1].truth), pose_of(d->scans[at].truth)));
        off = cairn_pose_between(pose_of(d->scans[at].truth),
                                 take(mapper, &input, &odometry_pose).map_scan);
        if (i == DISPLACED_AT - 1)
            assert_true(hypot((double)off.x, (double)off.y) < 0.05);
    }
    test_pool_free(&pool);
    return hypot((double)off.x, (double)off.y) < 0.05 && fabs((double)off.theta) < 0.05;
}

/* Two scans that agree on a place far from the odometry are accepted: most displacements of a metre
 * and 1 rad are recovered. */
static void a_displaced_robot_is_relocalized(void **state)
{
    int32_t found = 0;

    (void)state;
    for (uint64_t seed = 0; seed < DRIVES; seed++) {
        drive d = start_drive(SIM_APARTMENT, 21 + seed, DISPLACED_AT + SKIPPED + 4, 0, 0.1);

        found += is_found_again(&d);
        end_drive(&d);
    }
    assert_true(found > DRIVES / 2);
}

enum { BLOCKED_AT = 60 };
/* rad and m: the least turn behind a person's back, and the largest motion */
static const double LEAST_TURN = 1.8, MOST_MOTION = 0.6;

/* Finds two scans of a drive at nearly the same position, the second of them after the robot has
 * turned; returns 0 when there are none. */
static int find_turn(const drive *d, int32_t *before, int32_t *after)
{
    for (*before = BLOCKED_AT; *before < d->count; (*before)++)
        for (*after = 0; *after < *before; (*after)++) {
            cairn_pose turn = cairn_pose_between(pose_of(d->scans[*before].truth),
                                                 pose_of(d->scans[*after].truth));

            if (fabs((double)turn.theta) > LEAST_TURN &&
                hypot((double)turn.x, (double)turn.y) < MOST_MOTION)
                return 1;
        }
    return 0;
}

/* A person stands before the robot for one scan and turns it by more than 1.8 rad, unknown to its
 * odometry. In most drives the next scan has its place in the map. */
static void a_robot_turned_behind_a_back_is_found_again(void **state)
{
    cairn_mapper_params params = small_params();
    int32_t drives = 0, found_again = 0, before, after;
    float back[181];

    (void)state;
    for (int i = 0; i < 181; i++)
        back[i] = 0.4F + 0.1F * (float)cos((i - 90) / 30.0);
    for (uint64_t seed = 1; seed <= 12; seed++) {
        drive d = start_drive(SIM_APARTMENT, seed, 160, 0.02, 0.2);

        if (find_turn(&d, &before, &after)) {
            cairn_pool pool;
            cairn_mapper *mapper = new_mapper(&pool, &params);
            cairn_scan_input input;
            cairn_pose odometry, truth, error, last;

            for (int32_t i = 0; i <= before; i++) {
                input = sim_scan_input(&d.scans[i]);
                odometry = pose_of(d.scans[i].odometry);
                last = take(mapper, &input, &odometry).map_scan;
            }
            input.range = back;
            (void)take(mapper, &input, &odometry);
            input = sim_scan_input(&d.scans[after]);
            truth = cairn_pose_compose(last, cairn_pose_between(pose_of(d.scans[before].truth),
                                                                pose_of(d.scans[after].truth)));
            error = cairn_pose_between(truth, take(mapper, &input, &odometry).map_scan);
            drives++;
            found_again +=
                hypot((double)error.x, (double)error.y) < 0.1 && fabs((double)error.theta) < 0.1;
            test_pool_free(&pool);
        }
        end_drive(&d);
    }
    assert_true(drives >= 6);
    assert_true(10 * found_again >= 8 * drives);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_empty_beginning),
        cmocka_unit_test(every_scan_twice),
        cmocka_unit_test(time_that_runs_back),
        cmocka_unit_test(a_kidnapped_start),
        cmocka_unit_test(scans_of_another_building_move_nothing),
        cmocka_unit_test(a_displaced_robot_is_relocalized),
        cmocka_unit_test(a_robot_turned_behind_a_back_is_found_again),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
