/* Stretches of a drive whose motion no match determines. */
#include "src/host/maps/uncertain_stretch.h"
#include "tests/test.h"

enum { SCANS = 60 };

/* A straight drive of 0.2 m a scan, all matches certain. */
static void straight_drive(cairn_placed_scan *scan)
{
    memset(scan, 0, SCANS * sizeof *scan);
    for (int32_t i = 0; i < SCANS; i++) {
        scan[i].after.x = (cairn_real)(0.2 * i);
        scan[i].covariance[0] = scan[i].covariance[4] = (cairn_real)1e-4;
        scan[i].covariance[8] = (cairn_real)1e-6;
    }
    scan[0].covariance[0] = (cairn_real)NAN;
}

static void no_match(cairn_placed_scan *scan, int32_t first, int32_t last)
{
    for (int32_t i = first; i <= last; i++)
        for (int k = 0; k < 9; k++)
            scan[i].covariance[k] = (cairn_real)NAN;
}

static void a_certain_drive_has_none(void **state)
{
    cairn_placed_scan scan[SCANS];
    cairn_uncertain_stretch stretch;
    int32_t next = 0;

    (void)state;
    straight_drive(scan);
    assert_int_equal(cairn_uncertain_stretch_next(scan, SCANS, &next, &stretch), 0);
    assert_int_equal(cairn_uncertain_stretch_next(scan, 1, &next, &stretch), 0);
    assert_int_equal(cairn_uncertain_stretch_next(scan, 0, &next, &stretch), 0);
}

static void stretches_without_a_match_are_found_in_order(void **state)
{
    cairn_placed_scan scan[SCANS];
    cairn_uncertain_stretch stretch;
    int32_t next = 0;

    (void)state;
    straight_drive(scan);
    no_match(scan, 1, 5);
    no_match(scan, 20, 22); /* 0.6 m: too short */
    no_match(scan, 50, 59);
    assert_int_equal(cairn_uncertain_stretch_next(scan, SCANS, &next, &stretch), 1);
    assert_int_equal(stretch.first, 1);
    assert_int_equal(stretch.last, 5);
    assert_int_equal(stretch.unmatched, 5);
    assert_near(stretch.length, 1, 1e-5);
    assert_near(stretch.turn, 0, 1e-12);
    assert_int_equal(cairn_uncertain_stretch_next(scan, SCANS, &next, &stretch), 1);
    assert_int_equal(stretch.first, 50);
    assert_int_equal(stretch.last, 59);
    assert_near(stretch.length, 2, 1e-5);
    assert_int_equal(cairn_uncertain_stretch_next(scan, SCANS, &next, &stretch), 0);
}

static void certain_scans_in_between_are_bridged_but_not_counted(void **state)
{
    cairn_placed_scan scan[SCANS];
    cairn_uncertain_stretch stretch;
    int32_t next = 0;

    (void)state;
    straight_drive(scan);
    no_match(scan, 10, 12);
    no_match(scan, 15, 17);
    assert_int_equal(cairn_uncertain_stretch_next(scan, SCANS, &next, &stretch), 1);
    assert_int_equal(stretch.first, 10);
    assert_int_equal(stretch.last, 17);
    assert_int_equal(stretch.unmatched, 6);
    assert_near(stretch.length, 1.2, 1e-5);
    /* Three certain scans end a stretch; both are too short then. */
    straight_drive(scan);
    no_match(scan, 10, 12);
    no_match(scan, 16, 18);
    next = 0;
    assert_int_equal(cairn_uncertain_stretch_next(scan, SCANS, &next, &stretch), 0);
}

static void uncertain_matches_count_in_any_direction(void **state)
{
    cairn_placed_scan scan[SCANS];
    cairn_uncertain_stretch stretch;
    int32_t next = 0;

    (void)state;
    /* 0.25 m along the diagonal: 0.18 m along each axis. */
    straight_drive(scan);
    for (int32_t i = 30; i < 36; i++)
        scan[i].covariance[0] = scan[i].covariance[1] = scan[i].covariance[3] =
            scan[i].covariance[4] = (cairn_real)(0.25 * 0.25 / 2);
    assert_int_equal(cairn_uncertain_stretch_next(scan, SCANS, &next, &stretch), 1);
    assert_int_equal(stretch.first, 30);
    assert_int_equal(stretch.last, 35);
    assert_int_equal(stretch.unmatched, 0);
    /* 0.19 m along the diagonal is certain. */
    straight_drive(scan);
    for (int32_t i = 30; i < 36; i++)
        scan[i].covariance[0] = scan[i].covariance[1] = scan[i].covariance[3] =
            scan[i].covariance[4] = (cairn_real)(0.19 * 0.19 / 2);
    next = 0;
    assert_int_equal(cairn_uncertain_stretch_next(scan, SCANS, &next, &stretch), 0);
    /* The heading alone, in a turn on the spot to both sides. */
    straight_drive(scan);
    for (int32_t i = 30; i < 34; i++) {
        scan[i].covariance[8] = (cairn_real)(0.11 * 0.11);
        scan[i].after = scan[29].after;
        scan[i].after.theta = (cairn_real)(i % 2 == 0 ? 0.15 : 0);
    }
    next = 0;
    assert_int_equal(cairn_uncertain_stretch_next(scan, SCANS, &next, &stretch), 1);
    assert_int_equal(stretch.first, 30);
    assert_int_equal(stretch.last, 33);
    assert_near(stretch.turn, 0.6, 1e-5);
    assert_near(stretch.length, 0, 1e-5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_certain_drive_has_none),
        cmocka_unit_test(stretches_without_a_match_are_found_in_order),
        cmocka_unit_test(certain_scans_in_between_are_bridged_but_not_counted),
        cmocka_unit_test(uncertain_matches_count_in_any_direction),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
