/* Uncertainty of keyframes in the map, after the robot was lost. */
#include "tests/drive.h"

#include <math.h>
#include <stdlib.h>

#include "src/maps/mapper_work.h"

/* A drive there and back again: the loop is closed on the way back. */
enum { OUT_SCANS = 60, SCANS = 2 * OUT_SCANS };

/* A long drive. */
enum { LONG_SCANS = 400 };

/* Scans of the way there during which a person stands before the robot. */
enum { BLIND_FROM = 30, BLIND_SCANS = 4 };

/* rad: turn meanwhile that the odometry does not see */
static const double UNSEEN_TURN = 0.4;

/* m: least standard deviation of what is uncertain */
static const double UNCERTAIN_M = 0.35;

static cairn_mapper_uncertainty of_keyframes[LONG_SCANS];

/* Maps the first `count` scans of a drive there and back; `blind`: a person blocks the view for a while,
 * and turns the robot. */
static cairn_mapper *map(cairn_pool *pool, const drive *d, const cairn_mapper_params *params,
                         int32_t blind, int32_t count, int32_t keyframe_of[SCANS])
{
    cairn_mapper *mapper = new_mapper(pool, params);
    cairn_budget budget = {CAIRN_UNBOUNDED};

    for (int32_t n = 0; n < count; n++) {
        int32_t k = n < OUT_SCANS ? n : SCANS - 1 - n;
        sim_scan scan = d->scans[k];
        cairn_scan_input input = sim_scan_input(&scan);
        cairn_pose odometry = pose_of(d->scans[k].truth);
        float back[181];

        if (blind && n >= BLIND_FROM && n < BLIND_FROM + BLIND_SCANS) {
            for (int32_t i = 0; i < input.count; i++)
                back[i] = 0.4F + 0.1F * (float)cos((i - 90) / 30.0);
            input.range = back;
        }
        if (blind && n >= BLIND_FROM)
            odometry = cairn_pose_compose(
                odometry,
                (cairn_pose){0, 0, n < BLIND_FROM + BLIND_SCANS ? 0 : (cairn_real)UNSEEN_TURN});
        assert_ok(cairn_mapper_map(mapper, &input, &odometry, NULL));
        keyframe_of[n] = cairn_mapper_read(mapper).keyframe;
    }
    assert_ok(cairn_mapper_settle(mapper, &budget));
    return mapper;
}

/* Loops may be closed after 20 keyframes. */
static cairn_mapper_params params_of_short_loops(void)
{
    cairn_mapper_params params = small_params();

    params.loop.max_loops = 600;
    params.loop.min_keyframe_gap = 20;
    return params;
}

/* m, of a keyframe */
static double sigma_of(int32_t keyframe)
{
    return sqrt((double)of_keyframes[keyframe].position_variance);
}

static int32_t find(const cairn_mapper *mapper)
{
    int32_t count = cairn_mapper_measure(mapper).keyframes;

    assert_ok(cairn_mapper_find_uncertainty(mapper, of_keyframes, count));
    for (int32_t k = 0; k < count; k++)
        assert_true(of_keyframes[k].position_variance >= 0 &&
                    of_keyframes[k].position_variance < 10000 &&
                    of_keyframes[k].heading_variance >= 0);
    return count;
}

static void a_drive_with_all_matches_is_certain(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_APARTMENT, 3, OUT_SCANS, 0, 0.3);
    int32_t keyframe_of[SCANS], count;
    cairn_pool pool;
    cairn_mapper *mapper;

    (void)state;
    params.loop.max_loops = 600;
    mapper = map(&pool, &d, &params, 0, SCANS, keyframe_of);
    count = find(mapper);
    assert_true(count > 20);
    for (int32_t k = 0; k < count; k++)
        assert_true(of_keyframes[k].position_variance == 0);
    test_pool_free(&pool);
    end_drive(&d);
}

/* In a corridor one submap observes the position and another the heading, and the odometry agrees with
 * the matches. */
static void a_drive_along_corridors_is_certain(void **state)
{
    static const uint64_t SEEDS[] = {3, 11};
    cairn_mapper_params params = cairn_mapper_default_for(LONG_SCANS, 181);

    (void)state;
    for (size_t i = 0; i < sizeof SEEDS / sizeof *SEEDS; i++) {
        drive d = start_drive(SIM_OFFICE, SEEDS[i], LONG_SCANS, 0, 0.3);
        cairn_budget budget = {CAIRN_UNBOUNDED};
        cairn_pool pool;
        cairn_mapper *mapper = new_mapper(&pool, &params);
        int32_t count;

        for (int32_t n = 0; n < LONG_SCANS; n++) {
            cairn_scan_input input = sim_scan_input(&d.scans[n]);
            cairn_pose odometry = pose_of(d.scans[n].odometry);

            assert_ok(cairn_mapper_map(mapper, &input, &odometry, NULL));
        }
        assert_ok(cairn_mapper_settle(mapper, &budget));
        count = find(mapper);
        for (int32_t k = 0; k < count; k++)
            assert_true(sigma_of(k) < UNCERTAIN_M);
        test_pool_free(&pool);
        end_drive(&d);
    }
}

/* What was before the person came is certain. What follows is uncertain in some drives, and nothing is
 * that closures or matches with earlier keyframes join; when the robot comes back to where it was
 * before most are certain again. */
static void a_lost_robot_is_uncertain_until_it_returns(void **state)
{
    cairn_mapper_params params = params_of_short_loops();
    int32_t keyframe_of[SCANS], uncertain = 0, certain_again = 0;
    cairn_pool pool;
    cairn_mapper *mapper;

    (void)state;
    for (uint64_t seed = 3; seed <= 10; seed++) {
        drive d = start_drive(SIM_APARTMENT, seed, OUT_SCANS, 0, 0.3);
        int32_t is_uncertain;

        mapper = map(&pool, &d, &params, 1, OUT_SCANS, keyframe_of);
        (void)find(mapper);
        for (int32_t n = 0; n < BLIND_FROM; n++)
            assert_true(of_keyframes[keyframe_of[n]].position_variance == 0);
        is_uncertain = sigma_of(keyframe_of[OUT_SCANS - 1]) >= UNCERTAIN_M;
        uncertain += is_uncertain;
        test_pool_free(&pool);
        mapper = map(&pool, &d, &params, 1, SCANS, keyframe_of);
        (void)find(mapper);
        certain_again += is_uncertain && sigma_of(keyframe_of[SCANS - 1]) < UNCERTAIN_M;
        test_pool_free(&pool);
        end_drive(&d);
    }
    assert_true(uncertain >= 3);
    assert_true(4 * certain_again >= 3 * uncertain);
}

/* What is certain is what certain links join with the first keyframe: by search in breadth. */
static void certain_is_what_certain_links_join(void **state)
{
    cairn_mapper_params params = params_of_short_loops();
    int32_t keyframe_of[SCANS], certain = 0, uncertain = 0;

    (void)state;
    for (uint64_t seed = 3; seed <= 8; seed++) {
        drive d = start_drive(SIM_APARTMENT, seed, OUT_SCANS, 0, 0.3);
        cairn_pool pool;
        cairn_mapper *mapper =
            map(&pool, &d, &params, 1, OUT_SCANS + 10 * (int32_t)(seed - 3), keyframe_of);
        int32_t count = find(mapper), joined[SCANS] = {1}, more = 1;

        while (more) {
            more = 0;
            for (int32_t i = 0; i < cairn_mapper_link_count(mapper); i++) {
                cairn_mapper_link link = cairn_mapper_link_at(mapper, i);
                int32_t heading = mapper->loop.constraints[link.second].heading;
                cairn_sym3 covariance;

                assert_true(cairn_sym3_inverse(link.information, &covariance));
                if (!link.is_loop && heading == MAPPER_HEADING_BY_ODOMETRY)
                    covariance.zz = 0;
                if (link.is_outlier || joined[link.first] == joined[link.second] ||
                    (link.is_loop && link.error_probability >= CAIRN_REAL(0.1)) ||
                    (!link.is_loop && heading == MAPPER_HEADING_UNKNOWN) ||
                    covariance.xx + covariance.yy > CAIRN_REAL(0.04) ||
                    covariance.zz > CAIRN_REAL(0.0049))
                    continue;
                joined[link.first] = joined[link.second] = more = 1;
            }
        }
        for (int32_t k = 0; k < count; k++) {
            assert_int_equal(sigma_of(k) < 1e-3, joined[k]);
            certain += joined[k];
            uncertain += !joined[k];
        }
        test_pool_free(&pool);
        end_drive(&d);
    }
    assert_true(certain > 50 && uncertain > 20);
}

static void refuses_bad_calls(void **state)
{
    cairn_mapper_params params = small_params();
    drive d = start_drive(SIM_APARTMENT, 3, OUT_SCANS, 0, 0.3);
    int32_t keyframe_of[SCANS], count;
    cairn_pool pool;
    cairn_mapper *mapper = new_mapper(&pool, &params);

    (void)state;
    assert_ok(cairn_mapper_find_uncertainty(mapper, NULL, 0));
    test_pool_free(&pool);
    mapper = map(&pool, &d, &params, 0, 5, keyframe_of);
    count = cairn_mapper_measure(mapper).keyframes;
    assert_status(cairn_mapper_find_uncertainty(mapper, of_keyframes, count + 1),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_mapper_find_uncertainty(mapper, of_keyframes, -1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_mapper_find_uncertainty(mapper, NULL, count), CAIRN_BAD_ARGUMENT);
    test_pool_free(&pool);
    params.loop.max_loops = 0;
    mapper = map(&pool, &d, &params, 0, 5, keyframe_of);
    count = cairn_mapper_measure(mapper).keyframes;
    assert_status(cairn_mapper_find_uncertainty(mapper, of_keyframes, count), CAIRN_UNSUPPORTED);
    test_pool_free(&pool);
    end_drive(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_drive_with_all_matches_is_certain),
        cmocka_unit_test(a_drive_along_corridors_is_certain),
        cmocka_unit_test(a_lost_robot_is_uncertain_until_it_returns),
        cmocka_unit_test(certain_is_what_certain_links_join),
        cmocka_unit_test(refuses_bad_calls),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
