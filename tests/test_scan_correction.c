/* Corrections of a log's scanner. */
#include "src/host/logs/scan_log_correction.h"

#include <math.h>

#include "tests/files.h"

enum { BEAMS = 5 };

#define DEGREE (3.14159265358979323846 / 180)

static const float ranges[BEAMS] = {1, 2, INFINITY, NAN, 5};

static cairn_scan_input scan_of(void)
{
    cairn_scan_input scan = {.range = ranges,
                             .count = BEAMS,
                             .angle_min = -1,
                             .angle_step = 0.5f,
                             .range_min = 0.5f,
                             .range_max = 8};

    return scan;
}

static void none_leaves_a_scan_as_it_is(void **state)
{
    cairn_scan_correction none = cairn_scan_correction_none();
    cairn_scan_input scan = scan_of();
    float range[BEAMS], angle[BEAMS];

    (void)state;
    assert_true(cairn_scan_correction_is_none(&none));
    cairn_scan_correction_apply(&none, &scan, range, angle);
    for (int32_t i = 0; i < BEAMS; i++) {
        assert_true(range[i] == ranges[i] || (isnan(range[i]) && isnan(ranges[i])));
        assert_near(angle[i], -1 + 0.5 * i, 1e-6);
    }
    assert_near(scan.range_max, 8, 0);
    assert_true(scan.time_step == 0);
}

static void each_part_of_the_scanner_is_corrected(void **state)
{
    const cairn_pose base_sensor = {1, 2, 3};
    cairn_scan_correction c = cairn_scan_correction_none();
    cairn_scan_input scan = scan_of();
    float range[BEAMS], angle[BEAMS];

    (void)state;
    c.flips = 1;
    c.angle_step = CAIRN_REAL(0.25);
    c.range_scale = 2;
    c.range_max = 9;
    c.sweep = CAIRN_REAL(-0.4);
    c.has_sensor = 1;
    c.base_sensor = base_sensor;
    assert_false(cairn_scan_correction_is_none(&c));
    cairn_scan_correction_apply(&c, &scan, range, angle);
    /* the last beam, at 1 rad, comes first; it is at half that angle, upside down */
    assert_near(angle[0], -0.5, 1e-6);
    assert_near(angle[2], 0, 1e-6);
    assert_near(angle[4], 0.5, 1e-6);
    assert_true(isinf(range[0]) && isnan(range[1]) && isinf(range[2]));
    assert_near(range[3], 4, 0);
    assert_near(range[4], 2, 0);
    assert_near(scan.range_min, 1, 0);
    assert_near(scan.range_max, 9, 0);
    assert_near(scan.time_step, 0.1, 1e-6);
    assert_near(scan.base_sensor.y, 2, 0);
    assert_ptr_equal(scan.range, range);
}

static void the_limit_of_scaled_ranges_is_in_their_unit_or_in_metres(void **state)
{
    (void)state;
    /* mm: a limit of 8 or 80 m, of 8000 mm */
    assert_near(cairn_scan_correction_limit(8, 2500, CAIRN_REAL(0.001)), 8, NUMBER(1e-9, 1e-3));
    assert_near(cairn_scan_correction_limit(80, 2500, CAIRN_REAL(0.001)), 80, NUMBER(1e-9, 1e-3));
    assert_near(cairn_scan_correction_limit(8000, 2500, CAIRN_REAL(0.001)), 8, NUMBER(1e-9, 1e-3));
    /* ranges that were divided once too often */
    assert_near(cairn_scan_correction_limit(CAIRN_REAL(0.08), CAIRN_REAL(0.0025), 1000), 80,
                NUMBER(1e-9, 1e-3));
    assert_near(cairn_scan_correction_limit(80, CAIRN_REAL(0.0025), 1000), 80, NUMBER(1e-9, 1e-3));
    assert_near(cairn_scan_correction_limit(80, 2, 1), 80, NUMBER(1e-9, 1e-3));
    /* m to mm */
    assert_near(cairn_scan_correction_limit(8, 2, 1000), 8000, NUMBER(1e-9, 1e-3));
}

static void a_log_is_corrected_whole(void **state)
{
    cairn_scan_correction c = cairn_scan_correction_none();
    cairn_scan_log log;
    cairn_file_error error;
    double quartile[3];

    (void)state;
    files_write_text("a.csv", "time,x,y,theta,-90,0,90\n0,0,0,0,1,2,3\n1,1,0,1.5,4,5,6\n");
    assert_ok(cairn_scan_log_load(&log, files_path("a.csv"), NULL, &error));
    assert_ok(cairn_scan_log_quartiles(&log, quartile));
    assert_near(quartile[0], 2, 0);
    assert_near(quartile[1], 3, 0);
    assert_near(quartile[2], 4, 0);
    c.flips = c.has_sensor = 1;
    c.range_scale = 10;
    c.base_sensor.x = 1;
    assert_ok(cairn_scan_log_correct(&log, &c));
    assert_near(log.scans.record[1].range[0], 40, 0);
    assert_near(cairn_scan_correction_bearing(&log.scans.record[1].scan, 0), 90 * DEGREE, 1e-6);
    assert_near(cairn_scan_correction_mean_step(&log.scans.record[1].scan), -90 * DEGREE, 1e-6);
    assert_near(log.scans.record[1].laser.y, sin(1.5), NUMBER(1e-9, 1e-6));
    assert_near(log.scans.info.base_sensor.x, 1, 0);
    cairn_scan_log_free(&log);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(none_leaves_a_scan_as_it_is),
        cmocka_unit_test(each_part_of_the_scanner_is_corrected),
        cmocka_unit_test(the_limit_of_scaled_ranges_is_in_their_unit_or_in_metres),
        cmocka_unit_test(a_log_is_corrected_whole),
    };

    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
