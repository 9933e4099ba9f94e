/* Capacities for the scans and maps given, and how they grow. */
#include "src/host/maps/capacity.h"
#include "tests/test.h"

static void keyframes_grow_until_a_scan_fits_whole(void **state)
{
    int32_t most = cairn_mapper_default().scan.max_points, points = 0, tries = 0, last = 0;

    (void)state;
    while ((points = cairn_capacity_keyframe_points(points)) > 0) {
        assert_true(last == 0 || points == 2 * last);
        last = points;
        tries++;
    }
    assert_in_range(last, most, 2 * most - 1);
    assert_in_range(tries, 2, 10);
}

static void a_mapper_has_no_more_keyframes_than_scans(void **state)
{
    cairn_capacity_mapping mapping = {.max_keyframes = 4096, .cull_keyframes = 1, .window = 2};
    cairn_mapper_params params = cairn_capacity_mapper(&mapping, 30, 181, 160);

    (void)state;
    assert_int_equal(params.max_keyframes, 30);
    assert_int_equal(params.cull_keyframes, 0);
    assert_int_equal(params.window_free, 1);
    assert_int_equal(params.max_keyframe_points, 30 * 160 + params.scan.max_points);
    assert_true(cairn_mapper_memory(&params) > 0);
    params = cairn_capacity_mapper(&mapping, 5000, 181, 160);
    assert_int_equal(params.max_keyframes, 4096);
    assert_int_equal(params.cull_keyframes, 1);
}

static void a_mapper_of_a_long_log_stays_below_the_maximum_of_points(void **state)
{
    cairn_capacity_mapping mapping = {.max_keyframes = INT64_MAX, .no_loops = 1};
    cairn_mapper_params params = cairn_capacity_mapper(&mapping, 1 << 20, 100, 1 << 11);

    (void)state;
    assert_int_equal(params.max_keyframe_points, CAIRN_CAPACITY_MAX_POINTS);
    assert_int_equal(params.max_keyframe_segments, CAIRN_CAPACITY_MAX_POINTS);
    assert_int_equal(params.loop.max_loops, 0);
}

static void aligners_have_capacity_for_all_scans(void **state)
{
    cairn_capacity_scans scans = {20, 361, 2000, 500};
    cairn_aligner_params aligner = cairn_capacity_aligner(&scans, 0.6, 9);
    cairn_force_field_params field = cairn_capacity_force_field(&scans, 7);
    cairn_lum_params lum = cairn_capacity_lum(&scans, 50, 0);

    (void)state;
    assert_true(cairn_aligner_memory(&aligner) > 0);
    assert_true(aligner.max_initial_angle_error == CAIRN_PI);
    assert_true(cairn_force_field_memory(&field) > 0);
    assert_int_equal(field.max_steps, 7);
    assert_int_equal(field.max_corners, CAIRN_CAPACITY_CORNERS_PER_SEGMENT * 500);
    assert_true(cairn_lum_memory(&lum) > 0);
    assert_int_equal(lum.max_links, 20 * 19 / 2 + 1);
    assert_int_equal(lum.max_points, 2000);
    lum = cairn_capacity_lum(&scans, 500, 1);
    assert_int_equal(lum.max_points, 20 * 361);
    assert_int_equal(lum.sequential_registration, 0);
    scans.scans = 1 << 16;
    scans.beams = 1000;
    lum = cairn_capacity_lum(&scans, 500, 1);
    assert_int_equal(lum.max_points, CAIRN_CAPACITY_MAX_POINTS);
    assert_int_equal(lum.max_links, 256 * (1 << 16) + 1);
}

static void a_place_has_capacity_for_its_scans(void **state)
{
    const int32_t place[] = {0, 0, 1, 1, 2};
    cairn_capacity_places places = {0};

    (void)state;
    for (int32_t i = 0; i < 5; i++) {
        cairn_capacity_add_scan(&places, place[i], 10 + i, 100);
        assert_int_equal(places.places, place[i] + 1);
    }
    assert_int_equal(places.points, 12 + 13);
    assert_int_equal(places.beams, 200);
}

static void places_have_capacity_for_their_hypotheses(void **state)
{
    cairn_capacity_places places = {.places = 64, .points = 100, .beams = 400};
    cairn_capacity_scans scans = {100, 400, 10000, 2000};
    cairn_place_map_params params = cairn_capacity_place_map(&places, &scans, 0.2);

    (void)state;
    assert_true(cairn_place_map_memory(&params) > 0);
    assert_int_equal(params.consensus.max_hypotheses, 34 * 64 * 63 / 2);
    assert_int_equal(params.max_place_points, 100);
    places.as_written = 1;
    assert_int_equal(cairn_capacity_place_map(&places, &scans, 0.2).max_place_points, 400);
}

static void a_match_of_empty_scans_has_a_capacity(void **state)
{
    cairn_scan_match_params params = cairn_capacity_scan_match(0, 0, 0, 0);

    (void)state;
    assert_true(cairn_scan_match_memory(&params) > 0);
    assert_int_equal(params.max_hypotheses, CAIRN_CAPACITY_MATCH_HYPOTHESES);
    params = cairn_capacity_scan_match(181, 0, 100, 1);
    assert_true(cairn_scan_match_memory(&params) > 0);
    assert_int_equal(params.max_target, 181);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(keyframes_grow_until_a_scan_fits_whole),
        cmocka_unit_test(a_mapper_has_no_more_keyframes_than_scans),
        cmocka_unit_test(a_mapper_of_a_long_log_stays_below_the_maximum_of_points),
        cmocka_unit_test(aligners_have_capacity_for_all_scans),
        cmocka_unit_test(a_place_has_capacity_for_its_scans),
        cmocka_unit_test(places_have_capacity_for_their_hypotheses),
        cmocka_unit_test(a_match_of_empty_scans_has_a_capacity),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
