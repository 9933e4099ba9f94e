/* Tables of ranges: every field, every fault of a line or a header. */
#include "tests/files.h"

#include <math.h>

#include "cairn/range_table.h"

static cairn_file_error fault_list[8];
static int32_t fault_count;

static void on_fault(void *context, const cairn_file_error *fault)
{
    (void)context;
    if (fault_count < 8)
        fault_list[fault_count] = *fault;
    fault_count++;
}

static cairn_status load(cairn_carmen_log_scans *scans, int32_t *has_odometry, const char *text,
                         cairn_range_table_kind kind, double range_max, cairn_file_error *error)
{
    cairn_carmen_log_params params = cairn_carmen_log_default();

    params.range_max = range_max;
    params.on_fault = on_fault;
    fault_count = 0;
    return cairn_range_table_load(scans, has_odometry, files_write_text("table", text), kind,
                                  &params, error);
}

/* Semicolons and tabs separate as commas do. */
static void csv_separators(void **state)
{
    static const char commas[] =
        "time,x,y,theta,-90,0,90\n1.5,1,2,0.5,1,2.25,3\n2.5,1,3,-0.5,4,,inf\n";
    static const char separators[] = {',', ';', '\t'};

    (void)state;
    for (size_t k = 0; k < sizeof separators; k++) {
        cairn_range_table_kind kind;
        cairn_carmen_log_scans s;
        char text[sizeof commas];
        int32_t has_odometry;

        memcpy(text, commas, sizeof commas);
        for (size_t i = 0; i < sizeof commas; i++)
            if (text[i] == ',')
                text[i] = separators[k];
        assert_ok(cairn_range_table_find_kind(&kind, files_write_text("table", text), NULL));
        assert_int_equal(kind, CAIRN_RANGE_TABLE_CSV);
        assert_ok(load(&s, &has_odometry, text, CAIRN_RANGE_TABLE_CSV, 0, NULL));
        assert_int_equal(fault_count, 0);
        assert_int_equal(has_odometry, 1);
        assert_int_equal(s.count, 2);
        assert_int_equal(s.record[1].count, 3);
        assert_int_equal(s.record[1].stamp_ns, 2500000000);
        assert_near(s.record[1].robot.y, 3, 0);
        assert_near(s.record[1].range[0], 4, 0);
        assert_near(s.record[1].range[1], 0, 0);
        assert_true(isinf(s.record[1].range[2]));
        cairn_carmen_log_scans_free(&s);
    }
}

static void csv_fields(void **state)
{
    cairn_carmen_log_scans s;
    int32_t has_odometry;
    const cairn_carmen_log_record *r;

    (void)state;
    assert_ok(load(&s, &has_odometry,
                   "# a scanner\n\ntime, x,y,theta,-90,0,45.5\n"
                   "1.5,1,2,0.5,1,2.25,3\n"
                   "# between\n"
                   " 2.5 ,1,3,-0.5, 4 ,,inf\r\n"
                   "2,1,3,7,nan,80,79\n",
                   CAIRN_RANGE_TABLE_CSV, 0, NULL));
    assert_int_equal(fault_count, 0);
    assert_int_equal(has_odometry, 1);
    assert_int_equal(s.count, 3);
    assert_int_equal(s.info.scans, 3);
    assert_int_equal(s.info.lines, 7);
    assert_int_equal(s.info.beams, 9);
    assert_int_equal(s.info.min_beams, 3);
    assert_int_equal(s.info.max_beams, 3);
    assert_int_equal(s.info.first_ns, 1500000000);
    assert_int_equal(s.info.last_ns, 2000000000);
    assert_int_equal(s.info.earliest_ns, 1500000000);
    assert_int_equal(s.info.latest_ns, 2500000000);
    assert_int_equal(s.info.backward_stamps, 1);
    assert_int_equal(s.info.fixed_mounting, 1);
    assert_near(s.info.range_max, 80, 0);
    assert_near(s.info.odometry_length, 1, 1e-6);
    assert_near(s.info.odometry_turn, 1 + 7.5 - 2 * 3.14159265358979, 1e-5);
    r = &s.record[0];
    assert_int_equal(r->kind, CAIRN_CARMEN_LOG_SCAN);
    assert_int_equal(r->line, 4);
    assert_int_equal(r->stamp_ns, 1500000000);
    assert_int_equal(r->count, 3);
    assert_int_equal(r->scan.count, 3);
    assert_int_equal(r->scan.stamp_ns, r->stamp_ns);
    assert_true(r->scan.range == r->range);
    assert_near(r->scan.range_max, 80, 0);
    assert_near(r->scan.range_sigma, 0.01, 1e-8);
    assert_near(r->scan.angle[0], -1.5707963, 1e-6);
    assert_near(r->scan.angle[1], 0, 0);
    assert_near(r->scan.angle[2], 45.5 * 0.017453292519943295, 1e-6);
    assert_near(r->range[0], 1, 0);
    assert_near(r->range[1], 2.25, 0);
    assert_near(r->range[2], 3, 0);
    assert_near(r->robot.x, 1, 0);
    assert_near(r->robot.y, 2, 0);
    assert_near(r->robot.theta, 0.5, 1e-7);
    assert_memory_equal(&r->robot, &r->laser, sizeof r->robot);
    r = &s.record[1];
    assert_int_equal(r->line, 6);
    assert_near(r->range[0], 4, 0);
    assert_near(r->range[1], 0, 0);
    assert_true(isinf(r->range[2]));
    r = &s.record[2];
    assert_true(isnan(r->range[0]));
    assert_true(isinf(r->range[1]));
    assert_near(r->range[2], 79, 0);
    assert_near(r->robot.theta, 7 - 2 * 3.14159265358979, 1e-5);
    cairn_carmen_log_scans_free(&s);
}

/* Many scans, without time and odometry; the maximum range is the caller's. */
static void csv_of_ranges_alone(void **state)
{
    char *text = malloc(100000), *at = text;
    cairn_carmen_log_scans s;
    int32_t has_odometry;

    (void)state;
    assert_non_null(text);
    at += sprintf(at, "-1,1\n");
    for (int i = 0; i < 1000; i++)
        at += sprintf(at, "%d,5\n", i);
    assert_ok(load(&s, &has_odometry, text, CAIRN_RANGE_TABLE_CSV, 500, NULL));
    assert_int_equal(has_odometry, 0);
    assert_int_equal(s.count, 1000);
    for (int i = 0; i < 1000; i++) {
        assert_int_equal(s.record[i].stamp_ns, (int64_t)i * 100000000);
        assert_near(s.record[i].range[1], 5, 0);
        assert_true(i < 500 ? s.record[i].range[0] == (float)i : isinf(s.record[i].range[0]));
    }
    cairn_carmen_log_scans_free(&s);
    free(text);
}

/* A first line of ranges is no header, in m or in mm. */
static void a_table_without_a_header_is_refused(void **state)
{
    static const char *const tables[] = {
        "1.5,1.6,1.6,2.5\n1.5,1.6,1.6,2.5\n", "2.5,inf,1.5,2\n1.5,1.6,1.6,2.5\n",
        "1500,1600,1600,2500\n1500,1600,1600,2500\n", "# x\n\n3,,2.5,2\n3,1,2.5,2\n"};
    cairn_carmen_log_scans s;
    cairn_file_error error;
    int32_t has_odometry;

    (void)state;
    for (int k = 0; k < 4; k++) {
        cairn_range_table_kind kind;

        assert_ok(cairn_range_table_find_kind(&kind, files_write_text("table", tables[k]), NULL));
        assert_int_equal(kind, CAIRN_RANGE_TABLE_CSV);
        assert_status(load(&s, &has_odometry, tables[k], CAIRN_RANGE_TABLE_CSV, 0, &error),
                      CAIRN_BAD_FORMAT);
        assert_int_equal(error.line, k == 3 ? 3 : 1);
        assert_non_null(strstr(error.text,
                               "the first line has no header, expected the names of the "
                               "columns and bearings in degrees, rising or falling: "
                               "time,x,y,theta,-90,-89,...,90"));
    }
    /* Bearings alone may fall, too. */
    assert_ok(load(&s, &has_odometry, "90,0,-90.5\n1,2,3\n", CAIRN_RANGE_TABLE_CSV, 0, &error));
    cairn_carmen_log_scans_free(&s);
}

/* Coordinates far away are taken from the first pose, as in CARMEN logs. */
static void far_coordinates(void **state)
{
    cairn_carmen_log_scans s;
    int32_t has_odometry;

    (void)state;
    assert_ok(load(&s, &has_odometry,
                   "x,y,theta,0\n500000.25,5400000,0,1\n500001.5,5400000.5,0,1\n",
                   CAIRN_RANGE_TABLE_CSV, 0, NULL));
    assert_int_equal(s.count, 2);
    assert_near(s.info.origin[0], 500000, 0);
    assert_near(s.record[0].robot.x, 0.25, 0);
    assert_near(s.record[1].laser.y, 0.5, 0);
    cairn_carmen_log_scans_free(&s);
}

/* One scan more than there may be. */
static void too_many_scans_are_refused(void **state)
{
    enum { MANY = CAIRN_CARMEN_LOG_MAX_SCANS + 1 };
    char *text = malloc(2 * MANY + 3);
    cairn_carmen_log_scans s;
    cairn_file_error error;
    int32_t has_odometry;

    (void)state;
    assert_non_null(text);
    for (int i = 0; i <= MANY; i++)
        memcpy(text + 2 * (size_t)i, i == 0 ? "0\n" : "1\n", 3);
    assert_status(load(&s, &has_odometry, text, CAIRN_RANGE_TABLE_CSV, 0, &error), CAIRN_FULL);
    assert_non_null(strstr(error.text, "more than 1048576 scans"));
    assert_null(s.record);
    free(text);
}

static void damaged_lines_are_reported_and_left_out(void **state)
{
    cairn_carmen_log_scans s;
    int32_t has_odometry;

    (void)state;
    assert_ok(load(&s, &has_odometry,
                   "time,0,1\n1,2,3\n2,3\n3,4,5,6\n4,x,5\ninf,1,1\n,1,1\n-9e9,1,1\n5,6,7\n",
                   CAIRN_RANGE_TABLE_CSV, 0, NULL));
    assert_int_equal(s.count, 2);
    assert_int_equal(s.info.faults, 6);
    assert_int_equal(fault_count, 6);
    for (int i = 0; i < 6; i++)
        assert_int_equal(fault_list[i].line, 3 + i);
    assert_non_null(strstr(fault_list[0].text, "too few fields, expected 3 numbers"));
    assert_non_null(strstr(fault_list[1].text, "too many fields"));
    assert_non_null(strstr(fault_list[2].text, "not a number"));
    assert_non_null(strstr(fault_list[3].text, "not finite"));
    assert_non_null(strstr(fault_list[4].text, "not a number"));
    assert_non_null(strstr(fault_list[5].text, "a time beyond 4e9 s"));
    cairn_carmen_log_scans_free(&s);
}

static void bad_heads_and_files_are_refused(void **state)
{
    static const struct {
        const char *text;
        cairn_status status;
    } bad[] = {
        {"time,colour,0\n1,2,3\n", CAIRN_BAD_FORMAT},
        {"time,time,0\n1,2,3\n", CAIRN_BAD_FORMAT},
        {"time,x,y,0\n1,2,3,4\n", CAIRN_BAD_FORMAT},
        {"time,x,y,theta\n1,2,3,4\n", CAIRN_BAD_FORMAT},
        {"time,361\n1,2\n", CAIRN_BAD_FORMAT},
        {"time,0\n", CAIRN_EMPTY},
        {"time,0\n1\n", CAIRN_EMPTY},
        {"", CAIRN_EMPTY},
    };
    cairn_carmen_log_scans s;
    cairn_file_error error;
    int32_t has_odometry;

    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_status(load(&s, &has_odometry, bad[i].text, CAIRN_RANGE_TABLE_CSV, 0, &error),
                      bad[i].status);
        assert_non_null(strstr(error.text, "expected"));
        assert_null(s.record);
    }
    assert_status(load(&s, &has_odometry, "time,0\n1,2\n", CAIRN_RANGE_TABLE_CSV, -1, &error),
                  CAIRN_BAD_ARGUMENT);
    assert_status(
        load(&s, &has_odometry, "time,0\n1,2\n", CAIRN_RANGE_TABLE_CSV, (double)NAN, &error),
        CAIRN_BAD_ARGUMENT);
    assert_status(load(&s, &has_odometry, "time,0\n1,2\n", CAIRN_RANGE_TABLE_CSV, 1e9, &error),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_range_table_load(&s, &has_odometry, files_path("none"),
                                         CAIRN_RANGE_TABLE_CSV, NULL, &error),
                  CAIRN_IO);
}

static void a_negative_standard_deviation_of_the_ranges_is_refused(void **state)
{
    cairn_carmen_log_params params = cairn_carmen_log_default();
    const char *path = files_write_text("table", "time,0\n1,2\n");
    cairn_carmen_log_scans s;
    cairn_file_error error;
    int32_t has_odometry;

    (void)state;
    params.range_sigma = -1;
    assert_status(
        cairn_range_table_load(&s, &has_odometry, path, CAIRN_RANGE_TABLE_CSV, &params, &error),
        CAIRN_BAD_ARGUMENT);
    assert_holds(error.text, "range_sigma is -1, expected a number from 0 to 100000");
    assert_null(s.record);
}

/* A line of the URG log format of `fields` fields, the ranges increasing by 1 mm. */
static char *add_urg(char *at, int fields, int microseconds, int range)
{
    at += sprintf(at, "%d", microseconds);
    for (int i = 1; i < fields; i++)
        at += sprintf(at, " %d", i < 25 ? 7 : range == 0 ? 0 : range + i - 25);
    *at++ = '\n';
    *at = 0;
    return at;
}

static void urg_fields(void **state)
{
    char *text = malloc(100000), *at = text;
    cairn_carmen_log_scans s;
    int32_t has_odometry;

    (void)state;
    assert_non_null(text);
    at = add_urg(at, 707, 1500000, 5000);
    at = add_urg(at, 706, 1600000, 1000);
    at = add_urg(at, 708, 1700000, 1000);
    (void)add_urg(at, 707, 1800000, 0);
    assert_ok(load(&s, &has_odometry, text, CAIRN_RANGE_TABLE_URG, 0, NULL));
    assert_int_equal(has_odometry, 0);
    assert_int_equal(s.count, 2);
    assert_int_equal(fault_count, 2);
    assert_int_equal(s.info.max_beams, 682);
    assert_near(s.info.range_max, 5.6, 1e-12);
    assert_int_equal(s.record[0].stamp_ns, 1500000000);
    assert_near(s.record[0].range[0], 5, 1e-6);
    assert_near(s.record[0].range[599], 5.599, 1e-5);
    assert_true(isinf(s.record[0].range[600]));
    assert_near(s.record[0].scan.angle[341], 0, 0);
    assert_near(s.record[0].scan.angle[0], -341 * 2 * 3.14159265358979 / 1024, 1e-6);
    assert_near(s.record[1].range[681], 0, 0);
    assert_int_equal(s.record[1].line, 4);
    assert_near(s.record[1].robot.x, 0, 0);
    cairn_carmen_log_scans_free(&s);
    free(text);
}

/* A line of the URG log format with ticks of both wheels. */
static char *add_rolling_urg(char *at, int microseconds, int left, int right)
{
    at += sprintf(at, "%d 0 %d %d", microseconds, left, right);
    for (int i = 4; i < 707; i++)
        at += sprintf(at, " %d", 12 + i % 12);
    *at++ = '\n';
    *at = 0;
    return at;
}

/* The wheels roll straight ahead for a second, then turn left on the spot; the scans are .17 s
 * older than the ticks. */
static void urg_wheels(void **state)
{
    static const double tick = 2 * 3.14159265358979 * 0.077 / 2000;
    static const double known[] = {0, 0, 400, 400, 600, 600};
    char *text = malloc(100000), *at = text;
    cairn_carmen_log_scans s;
    const cairn_carmen_log_record *r;
    int32_t has_odometry;

    (void)state;
    assert_non_null(text);
    for (int i = 0; i <= 10; i++)
        at = add_rolling_urg(at, 5000000 + i * 100000, 700 + 100 * i, -40 + 100 * i);
    for (int i = 1; i <= 10; i++)
        at = add_rolling_urg(at, 6000000 + i * 100000, 1700 - 100 * i, 960 + 100 * i);
    assert_ok(load(&s, &has_odometry, text, CAIRN_RANGE_TABLE_URG, 0, NULL));
    assert_int_equal(has_odometry, 1);
    assert_int_equal(s.count, 21);
    r = s.record;
    assert_near(r[0].robot.x, 0, 0);
    assert_near(r[1].robot.x, 0, 1e-6);
    assert_near(r[2].robot.x, 30 * tick, 1e-6);
    assert_near(r[10].robot.x, 830 * tick, 1e-6);
    assert_near(r[11].robot.theta, 0, 1e-6);
    assert_near(r[12].robot.theta, 30 * 2 * tick / 0.31, 1e-6);
    assert_near(r[20].robot.theta, 830 * 2 * tick / 0.31, 1e-5);
    assert_near(r[20].robot.x, 1000 * tick, 1e-6);
    assert_near(r[20].robot.y, 0, 1e-6);
    assert_near(r[20].laser.x, 1000 * tick + 0.145 * cos(830 * 2 * tick / 0.31), 1e-5);
    assert_near(r[20].scan.base_sensor.x, 0.145, 1e-6);
    assert_near(r[20].scan.time_step, 0.1 / 1024, 1e-9);
    /* values below are the scanner's error codes */
    assert_near(r[20].scan.range_min, 0.02, 1e-9);
    assert_near(s.info.base_sensor.x, 0.145, 1e-6);
    assert_near(s.info.odometry_length, 1000 * tick, 1e-5);
    cairn_carmen_log_scans_free(&s);

    /* Across a gap in time the odometry is unknown, too. */
    at = add_rolling_urg(text, 0, 0, 0);
    at = add_rolling_urg(at, 100000, 100, 100);
    at = add_rolling_urg(at, 400000, 400, 400);
    at = add_rolling_urg(at, 500000, 500, 500);
    at = add_rolling_urg(at, 450000, 600, 600);
    (void)add_rolling_urg(at, 550000, 700, 700);
    assert_ok(load(&s, &has_odometry, text, CAIRN_RANGE_TABLE_URG, 0, NULL));
    for (int i = 0; i < 6; i++)
        assert_near(s.record[i].robot.x, known[i] * tick, 1e-6);
    cairn_carmen_log_scans_free(&s);
    free(text);
}

static cairn_range_table_kind kind_of(const char *text)
{
    cairn_range_table_kind kind = -1;

    assert_ok(cairn_range_table_find_kind(&kind, files_write_text("kind", text), NULL));
    return kind;
}

static void kinds_are_distinguished(void **state)
{
    char *text = malloc(100000), *at = text;
    cairn_range_table_kind kind = CAIRN_RANGE_TABLE_URG;

    (void)state;
    assert_non_null(text);
    assert_int_equal(kind_of("# x\ntime,0,1\n"), CAIRN_RANGE_TABLE_CSV);
    assert_int_equal(kind_of("FLASER 2 1 1 0 0 0 0 0 0 1 h 1\n"), CAIRN_RANGE_TABLE_NONE);
    assert_int_equal(kind_of("time,x,y,theta\n"), CAIRN_RANGE_TABLE_NONE);
    assert_int_equal(kind_of("0\n"), CAIRN_RANGE_TABLE_NONE);
    assert_int_equal(kind_of(""), CAIRN_RANGE_TABLE_NONE);
    at = add_urg(at, 12, 1, 1);
    at = add_urg(at, 707, 1, 1);
    assert_int_equal(kind_of(text), CAIRN_RANGE_TABLE_URG);
    for (at = text; at < text + 300; at += 3)
        memcpy(at, "# \n", 4);
    at += sprintf(at, "0,1\n");
    assert_int_equal(kind_of(text), CAIRN_RANGE_TABLE_NONE);
    assert_int_equal(kind_of(text + 3), CAIRN_RANGE_TABLE_CSV);
    assert_status(cairn_range_table_find_kind(&kind, files_path("none"), NULL), CAIRN_IO);
    assert_int_equal(kind, CAIRN_RANGE_TABLE_NONE);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(csv_separators),
        cmocka_unit_test(csv_fields),
        cmocka_unit_test(csv_of_ranges_alone),
        cmocka_unit_test(a_table_without_a_header_is_refused),
        cmocka_unit_test(far_coordinates),
        cmocka_unit_test(too_many_scans_are_refused),
        cmocka_unit_test(damaged_lines_are_reported_and_left_out),
        cmocka_unit_test(bad_heads_and_files_are_refused),
        cmocka_unit_test(a_negative_standard_deviation_of_the_ranges_is_refused),
        cmocka_unit_test(urg_fields),
        cmocka_unit_test(urg_wheels),
        cmocka_unit_test(kinds_are_distinguished),
    };

    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
