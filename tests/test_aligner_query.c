/* Queries of the aligner after its end, on a hallway longer than the range of a scan. */
#include "tests/test.h"

#include "cairn/aligner.h"
#include "src/alignment/aligner_work.h"
#include "tests/rooms.h"

#define DEGREE (CAIRN_PI / 180)

enum { SCANS = 5 };

/* 0 and 1 see the end of the hallway, 2 and 3 only its sides, 4 is in a room far away. */
static const cairn_pose truth[SCANS] = {{2, 1, 0},
                                        {CAIRN_REAL(5.5), CAIRN_REAL(1.2), 2},
                                        {CAIRN_REAL(8.6), 1, -1},
                                        {CAIRN_REAL(11.5), CAIRN_REAL(0.8), 1},
                                        {60, 60, 3}};

struct bed {
    cairn_pool pool;
    cairn_aligner *aligner;
};

/* By the poses of the aligner. */
static int32_t share(const struct bed *bed, int32_t first, int32_t second, cairn_vec2 along)
{
    cairn_pose a = cairn_aligner_pose_of(bed->aligner, first).map_scan,
               b = cairn_aligner_pose_of(bed->aligner, second).map_scan;

    return cairn_aligner_share_wall(bed->aligner, first, second, cairn_pose_between(b, a), along,
                                    NULL);
}

static struct bed align(void)
{
    cairn_scan_params scan_params = cairn_scan_default();
    cairn_aligner_params params = cairn_aligner_default();
    cairn_pool scan_pool = test_pool(cairn_scan_memory(&scan_params));
    cairn_budget budget = {CAIRN_UNBOUNDED};
    rooms_room hall = {.count = 0};
    cairn_scan *scan;
    struct bed bed;

    rooms_add_box(&hall, 0, 0, 30, 2);
    rooms_add_box(&hall, 58, 58, 62, 63);
    params.max_scans = SCANS;
    bed.pool = test_pool(cairn_aligner_memory(&params));
    assert_ok(cairn_aligner_create(&bed.aligner, &bed.pool, &params));
    assert_ok(cairn_scan_create(&scan, &scan_pool, &scan_params));
    for (int32_t i = 0; i < SCANS; i++) {
        rooms_scan taken;
        cairn_scan_input input = rooms_take_scan(&hall, truth[i], (uint64_t)i + 1, &taken);
        cairn_scan_view view;

        budget.left = CAIRN_UNBOUNDED;
        assert_ok(cairn_scan_begin(scan, &input, NULL));
        assert_ok(cairn_scan_step(scan, &budget));
        view = cairn_scan_read(scan);
        assert_ok(cairn_aligner_add_scan(bed.aligner, &view, truth[i], NULL));
    }
    assert_ok(cairn_aligner_begin(bed.aligner));
    assert_int_equal(share(&bed, 0, 1, (cairn_vec2){0, 1}), 0); /* it is running */
    budget.left = CAIRN_UNBOUNDED;
    assert_ok(cairn_aligner_step(bed.aligner, &budget));
    test_pool_free(&scan_pool);
    return bed;
}

/* A direction of the map in the frame of a scan. */
static cairn_vec2 seen_from(int32_t scan, double degrees)
{
    cairn_real sine, cosine;
    cairn_vec2 way;

    cairn_sincos((cairn_real)degrees * DEGREE - truth[scan].theta, &sine, &cosine);
    way.x = cosine;
    way.y = sine;
    return way;
}

static void sides_hold_across_and_the_end_along(void **state)
{
    struct bed bed = align();

    (void)state;
    for (int round = 0; round < 2; round++) {
        for (int32_t i = 0; i < 2; i++) {
            assert_int_equal(share(&bed, i, 1 - i, seen_from(i, 90)), 1);
            assert_int_equal(share(&bed, i, 1 - i, seen_from(i, 35)), 1);
            assert_int_equal(share(&bed, i, 1 - i, seen_from(i, 25)), round == 0);
            assert_int_equal(share(&bed, i, 1 - i, seen_from(i, 0)), round == 0);
            assert_int_equal(share(&bed, i, 1 - i, seen_from(i, -25)), round == 0);
            for (int32_t j = 4; j < SCANS; j++)
                assert_int_equal(share(&bed, i, j, seen_from(i, 90)), 0);
        }
        /* Without the end of the hallway. */
        for (int32_t k = bed.aligner->scans[1].first_segment; k < bed.aligner->scans[1].end_segment;
             k++)
            if (cairn_abs(cairn_vec2_dot(bed.aligner->segments[k].direction, seen_from(1, 0))) <
                CAIRN_REAL(0.5))
                bed.aligner->segments[k].wall = -1;
    }
    assert_int_equal(share(&bed, 0, SCANS, seen_from(0, 90)), 0);
    assert_int_equal(share(&bed, SCANS, 0, seen_from(0, 90)), 0);
    assert_int_equal(share(&bed, -1, 0, seen_from(0, 90)), 0);
    assert_int_equal(cairn_aligner_share_wall(NULL, 0, 1, truth[0], seen_from(0, 90), NULL), 0);
    test_pool_free(&bed.pool);
}

/* A common wall constrains nothing unless both scans lie on it. */
static void walls_constrain_scans_on_them(void **state)
{
    struct bed bed = align();
    cairn_pose first = cairn_aligner_pose_of(bed.aligner, 0).map_scan,
               at = cairn_aligner_pose_of(bed.aligner, 1).map_scan;
    int32_t units = 0,
            most = (bed.aligner->scans[0].end_segment - bed.aligner->scans[0].first_segment) *
                   (1 + bed.aligner->scans[1].end_segment - bed.aligner->scans[1].first_segment);

    (void)state;
    for (cairn_real sign = -1; sign <= 1; sign += 2) {
        cairn_pose off = at;

        off.y += sign * CAIRN_REAL(0.02);
        assert_int_equal(cairn_aligner_share_wall(bed.aligner, 0, 1, cairn_pose_between(off, first),
                                                  seen_from(0, 90), &units),
                         1);
        assert_in_range(units, 1, 1 + most / 16);
        off.y += sign * CAIRN_REAL(0.02);
        assert_int_equal(cairn_aligner_share_wall(bed.aligner, 0, 1, cairn_pose_between(off, first),
                                                  seen_from(0, 90), &units),
                         0);
        assert_in_range(units, 1, 1 + most / 16);
        assert_int_equal(cairn_aligner_share_wall(bed.aligner, 1, 0, cairn_pose_between(first, off),
                                                  seen_from(1, 90), NULL),
                         0);
        assert_int_equal(cairn_aligner_share_wall(bed.aligner, 1, 0, cairn_pose_between(first, off),
                                                  seen_from(1, 0), NULL),
                         1);
    }
    assert_int_equal(
        cairn_aligner_share_wall(bed.aligner, 0, SCANS, first, seen_from(0, 90), &units), 0);
    assert_int_equal(units, 1);
    test_pool_free(&bed.pool);
}

static void free_space_violations_agree_with_the_reference(void **state)
{
    struct bed bed = align();
    int32_t units = 0, against = 0;
    cairn_real right = 0;

    (void)state;
    for (int32_t i = 0; i < 4; i++)
        for (int32_t j = 0; j < 4; j++)
            for (int k = 0; k < 5; k++) {
                static const cairn_real off[] = {0, CAIRN_REAL(-0.5), CAIRN_REAL(-0.25),
                                                 CAIRN_REAL(0.25), CAIRN_REAL(0.5)};
                cairn_pose at = truth[i], between;
                aligner_count count = {.free_space = 0};
                cairn_budget budget = {CAIRN_UNBOUNDED};
                cairn_real expected, got;
                aligner_walk walk;

                at.y += off[k];
                between = cairn_pose_between(truth[j], at);
                got = cairn_aligner_free_space_violation(bed.aligner, i, j, between, &units);
                cairn_aligner_begin_count(bed.aligner, &walk, i, j, cairn_transform_of(between),
                                          CAIRN_REAL(0.07), &count);
                assert_int_equal(cairn_aligner_walk_pair(bed.aligner, &walk, &budget), 1);
                count.same_surface = 0;
                expected = cairn_aligner_log_likelihood_ratio(bed.aligner, count);
                assert_near(got, expected, 0);
                assert_near(cairn_aligner_free_space_violation(bed.aligner, i, j, between, NULL),
                            expected, 0);
                assert_int_equal(units, 1 + walk.lookups);
                if (k == 0)
                    right = got;
                else if (i == j + 1 || j == i + 1)
                    assert_true(got < right - 10);
                against += got < -5;
            }
    assert_true(against > 20);
    assert_near(cairn_aligner_free_space_violation(bed.aligner, 0, SCANS, truth[0], &units), 0, 0);
    assert_int_equal(units, 1);
    assert_near(cairn_aligner_free_space_violation(bed.aligner, -1, 0, truth[0], &units), 0, 0);
    assert_near(cairn_aligner_free_space_violation(NULL, 0, 1, truth[0], &units), 0, 0);
    assert_near(
        cairn_aligner_free_space_violation(bed.aligner, 0, 1, (cairn_pose){500, 0, 0}, &units), 0,
        0);
    assert_int_equal(units, 1);
    test_pool_free(&bed.pool);
}

static void candidate_pairs_are_near(void **state)
{
    struct bed bed = align();

    (void)state;
    for (int32_t i = 0; i < SCANS; i++)
        for (int32_t j = 0; j < SCANS; j++)
            if (i != j)
                assert_int_equal(cairn_aligner_is_candidate_pair(bed.aligner, i, j),
                                 i < 4 && j < 4);
    assert_int_equal(cairn_aligner_is_candidate_pair(bed.aligner, 0, SCANS), 0);
    assert_int_equal(cairn_aligner_is_candidate_pair(bed.aligner, SCANS, 0), 0);
    assert_int_equal(cairn_aligner_is_candidate_pair(bed.aligner, 0, -1), 0);
    assert_int_equal(cairn_aligner_is_candidate_pair(NULL, 0, 1), 0);
    test_pool_free(&bed.pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sides_hold_across_and_the_end_along),
        cmocka_unit_test(walls_constrain_scans_on_them),
        cmocka_unit_test(free_space_violations_agree_with_the_reference),
        cmocka_unit_test(candidate_pairs_are_near),
    };

    return cmocka_run_group_tests_name("aligner_query", tests, NULL, NULL);
}
