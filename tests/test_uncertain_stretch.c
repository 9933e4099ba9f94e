/* Stretches of a drive whose motion no match determines. */
#include "cairn/uncertain_stretch.h"
#include "tests/test.h"

enum { SCANS = 60 };

/* A scan of a drive: its pose, and the covariance of its match. */
typedef struct driven_scan {
    cairn_pose after;
    cairn_real covariance[9];
} driven_scan;

/* Adds scans to the drive until a stretch has ended; 0: there is none up to the end. */
static int next_stretch(cairn_uncertain_drive *drive, const driven_scan scan[SCANS], int32_t count,
                        cairn_uncertain_stretch *stretch)
{
    for (int32_t i = drive->scans; i >= 0 && i < count && i < SCANS; i++) {
        cairn_pose before = scan[i > 0 ? i - 1 : 0].after;

        if (cairn_uncertain_stretch_add(drive, scan[i].covariance,
                                        cairn_pose_between(before, scan[i].after), stretch))
            return 1;
    }
    return cairn_uncertain_stretch_end(drive, stretch);
}

/* A straight drive of 0.2 m a scan, all matches certain. */
static void straight_drive(driven_scan *scan)
{
    memset(scan, 0, SCANS * sizeof *scan);
    for (int32_t i = 0; i < SCANS; i++) {
        scan[i].after.x = (cairn_real)(0.2 * i);
        scan[i].covariance[0] = scan[i].covariance[4] = (cairn_real)1e-4;
        scan[i].covariance[8] = (cairn_real)1e-6;
    }
    scan[0].covariance[0] = (cairn_real)NAN;
}

static void no_match(driven_scan *scan, int32_t first, int32_t last)
{
    for (int32_t i = first; i <= last; i++)
        for (int k = 0; k < 9; k++)
            scan[i].covariance[k] = (cairn_real)NAN;
}

static void a_certain_drive_has_none(void **state)
{
    driven_scan scan[SCANS];
    cairn_uncertain_stretch stretch;
    cairn_uncertain_drive drive = {0};

    (void)state;
    straight_drive(scan);
    assert_int_equal(next_stretch(&drive, scan, SCANS, &stretch), 0);
    memset(&drive, 0, sizeof drive);
    assert_int_equal(next_stretch(&drive, scan, 1, &stretch), 0);
    memset(&drive, 0, sizeof drive);
    assert_int_equal(next_stretch(&drive, scan, 0, &stretch), 0);
}

static void stretches_without_a_match_are_found_in_order(void **state)
{
    driven_scan scan[SCANS];
    cairn_uncertain_stretch stretch;
    cairn_uncertain_drive drive = {0};

    (void)state;
    straight_drive(scan);
    no_match(scan, 1, 5);
    no_match(scan, 20, 22); /* 0.6 m: too short */
    no_match(scan, 50, 59);
    assert_int_equal(next_stretch(&drive, scan, SCANS, &stretch), 1);
    assert_int_equal(stretch.first, 1);
    assert_int_equal(stretch.last, 5);
    assert_int_equal(stretch.unmatched, 5);
    assert_near(stretch.length, 1, 1e-5);
    assert_near(stretch.turn, 0, 1e-12);
    assert_int_equal(next_stretch(&drive, scan, SCANS, &stretch), 1);
    assert_int_equal(stretch.first, 50);
    assert_int_equal(stretch.last, 59);
    assert_near(stretch.length, 2, 1e-5);
    assert_int_equal(next_stretch(&drive, scan, SCANS, &stretch), 0);
}

static void certain_scans_in_between_are_bridged_but_not_counted(void **state)
{
    driven_scan scan[SCANS];
    cairn_uncertain_stretch stretch;
    cairn_uncertain_drive drive = {0};

    (void)state;
    straight_drive(scan);
    no_match(scan, 10, 12);
    no_match(scan, 15, 17);
    assert_int_equal(next_stretch(&drive, scan, SCANS, &stretch), 1);
    assert_int_equal(stretch.first, 10);
    assert_int_equal(stretch.last, 17);
    assert_int_equal(stretch.unmatched, 6);
    assert_near(stretch.length, 1.2, 1e-5);
    /* Three certain scans end a stretch; both are too short then. */
    straight_drive(scan);
    no_match(scan, 10, 12);
    no_match(scan, 16, 18);
    memset(&drive, 0, sizeof drive);
    assert_int_equal(next_stretch(&drive, scan, SCANS, &stretch), 0);
}

static void uncertain_matches_count_in_any_direction(void **state)
{
    driven_scan scan[SCANS];
    cairn_uncertain_stretch stretch;
    cairn_uncertain_drive drive = {0};

    (void)state;
    /* 0.25 m along the diagonal: 0.18 m along each axis. */
    straight_drive(scan);
    for (int32_t i = 30; i < 36; i++)
        scan[i].covariance[0] = scan[i].covariance[1] = scan[i].covariance[3] =
            scan[i].covariance[4] = (cairn_real)(0.25 * 0.25 / 2);
    assert_int_equal(next_stretch(&drive, scan, SCANS, &stretch), 1);
    assert_int_equal(stretch.first, 30);
    assert_int_equal(stretch.last, 35);
    assert_int_equal(stretch.unmatched, 0);
    /* 0.19 m along the diagonal is certain. */
    straight_drive(scan);
    for (int32_t i = 30; i < 36; i++)
        scan[i].covariance[0] = scan[i].covariance[1] = scan[i].covariance[3] =
            scan[i].covariance[4] = (cairn_real)(0.19 * 0.19 / 2);
    memset(&drive, 0, sizeof drive);
    assert_int_equal(next_stretch(&drive, scan, SCANS, &stretch), 0);
    /* The heading alone, in a turn on the spot to both sides. */
    straight_drive(scan);
    for (int32_t i = 30; i < 34; i++) {
        scan[i].covariance[8] = (cairn_real)(0.11 * 0.11);
        scan[i].after = scan[29].after;
        scan[i].after.theta = (cairn_real)(i % 2 == 0 ? 0.15 : 0);
    }
    memset(&drive, 0, sizeof drive);
    assert_int_equal(next_stretch(&drive, scan, SCANS, &stretch), 1);
    assert_int_equal(stretch.first, 30);
    assert_int_equal(stretch.last, 33);
    assert_near(stretch.turn, 0.6, 1e-5);
    assert_near(stretch.length, 0, 1e-5);
}

/* While it lasts, a robot may slow down, or turn back. */
static void a_stretch_is_seen_while_it_lasts(void **state)
{
    driven_scan scan[SCANS];
    cairn_uncertain_drive drive = {0};
    cairn_uncertain_stretch ended = {.first = -1};

    (void)state;
    straight_drive(scan);
    no_match(scan, 3, 59);
    for (int32_t i = 0; i < 40; i++) {
        cairn_pose motion = cairn_pose_between(scan[i > 0 ? i - 1 : 0].after, scan[i].after);

        assert_int_equal(cairn_uncertain_stretch_add(&drive, scan[i].covariance, motion, &ended),
                         0);
        assert_int_equal(drive.is_uncertain, i >= 3);
        assert_near(drive.current.length, i >= 3 ? 0.2 * (i - 2) : 0, 1e-5);
    }
    assert_int_equal(ended.first, -1);
    assert_int_equal(cairn_uncertain_stretch_end(&drive, &ended), 1);
    assert_int_equal(ended.first, 3);
    assert_int_equal(ended.last, 39);
    assert_int_equal(drive.is_uncertain, 0);
    assert_int_equal(cairn_uncertain_stretch_end(&drive, &ended), 0);
}

static void a_motion_that_is_not_finite_is_reported(void **state)
{
    driven_scan scan[SCANS];
    cairn_uncertain_drive drive = {0};
    cairn_uncertain_stretch stretch;

    (void)state;
    straight_drive(scan);
    no_match(scan, 20, 21);
    scan[21].after.y = (cairn_real)NAN;
    scan[20].covariance[0] = (cairn_real)INFINITY;
    assert_int_equal(next_stretch(&drive, scan, SCANS, &stretch), 1);
    assert_int_equal(stretch.first, 20);
    assert_int_equal(stretch.last, 21);
    assert_int_equal(stretch.unmatched, 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_certain_drive_has_none),
        cmocka_unit_test(stretches_without_a_match_are_found_in_order),
        cmocka_unit_test(certain_scans_in_between_are_bridged_but_not_counted),
        cmocka_unit_test(uncertain_matches_count_in_any_direction),
        cmocka_unit_test(a_stretch_is_seen_while_it_lasts),
        cmocka_unit_test(a_motion_that_is_not_finite_is_reported),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
