/* CARMEN logs: valid ones, plain and gzipped, and every kind of damage. */
#include "tests/files.h"

#include <float.h>
#include <math.h>
#include <zlib.h>

#include "cairn/carmen_log.h"
#include "src/host/logs/carmen_log_reader.h"

/* A text that grows. */
typedef struct text {
    char *bytes;
    size_t count, capacity;
} text;

static void add(text *t, const char *format, ...)
{
    va_list values;
    int more;

    if (t->capacity - t->count < 4096) {
        t->capacity = 2 * t->capacity + 8192;
        t->bytes = realloc(t->bytes, t->capacity);
        assert_non_null(t->bytes);
    }
    va_start(values, format);
    more = vsnprintf(t->bytes + t->count, t->capacity - t->count, format, values);
    va_end(values);
    assert_true(more >= 0 && more < 4096);
    t->count += (size_t)more;
}

static void add_tail(text *t, double lx, double ly, double lth, double x, double y, double th,
                     double stamp)
{
    add(t, " %.6f %.6f %.6f %.6f %.6f %.6f %.6f host %.6f\n", lx, ly, lth, x, y, th, stamp, stamp);
}

/* A FLASER line of n ranges that all equal `range`, robot at (x, 0, 0), laser 0.1 m ahead. */
static void add_flaser(text *t, int n, double range, double x, double stamp)
{
    add(t, "FLASER %d", n);
    for (int i = 0; i < n; i++)
        add(t, " %.4f", range);
    add_tail(t, x + 0.1, 0, 0, x, 0, 0, stamp);
}

/* A small log of all message types that are read: 3 FLASER, 1 ROBOTLASER1, 2 ODOM. */
static text small_log(void)
{
    text t = {NULL, 0, 0};

    add(&t, "# a comment\n");
    add(&t, "PARAM robot_length 0.5 nohost 0\n");
    add(&t, "ODOM 0.5 0 0 0.1 0 0 10.5 host 10.5\n");
    add(&t, "FLASER 4 1.5 2.25 81.83 0.5");
    add_tail(&t, 0.1, 0, 0, 0, 0, 0, 11);
    add(&t, "SONAR 1 2 3\n\n");
    add(&t, "FLASER 5 nan 2 0 -1 inf");
    add_tail(&t, 1.1, 0, 0, 1, 0, 0, 12);
    add(&t, "ROBOTLASER1 0 -1.0 2.0 0.5 20.0 0.02 1 5 1 19.9 20 21 2 2 0.5 nan");
    add(&t, " 1.0 1.1 1.570796 1.0 1.0 1.570796 0.1 0.2 1 1 0 11.5 host 11.5\n");
    add(&t, "FLASER 1 3");
    add_tail(&t, 1.1, 3, 0, 1, 3, 0, 13);
    add(&t, "ODOM 1 3 -3.5 0 0 0 14 host 14");
    return t;
}

static const char *write_plain(const char *name, const text *t)
{
    return files_write(name, t->bytes, t->count);
}

static const char *write_gzip(const char *name, const text *t)
{
    const char *path = files_path(name);
    gzFile file = gzopen(path, "wb");

    assert_non_null(file);
    assert_int_equal(gzwrite(file, t->bytes, (unsigned)t->count), t->count);
    assert_int_equal(gzclose(file), Z_OK);
    return path;
}

typedef struct faults {
    int count;
    int64_t line[32];
    cairn_status status[32];
    char text[32][CAIRN_FILE_ERROR_BYTES];
} faults;

static void on_fault(void *context, const cairn_file_error *fault)
{
    faults *f = context;

    if (f->count < 32) {
        f->line[f->count] = fault->line;
        f->status[f->count] = fault->status;
        memcpy(f->text[f->count], fault->text, sizeof fault->text);
    }
    f->count++;
}

static cairn_carmen_log_params with_faults(faults *f)
{
    cairn_carmen_log_params params = cairn_carmen_log_default();

    memset(f, 0, sizeof *f);
    params.on_fault = on_fault;
    params.context = f;
    return params;
}

static void assert_error(const cairn_file_error *error, cairn_status status, int64_t line,
                         const char *piece)
{
    assert_int_equal(error->status, status);
    assert_int_equal(error->line, line);
    assert_holds(error->text, piece);
}

static void check_small_log(const char *path)
{
    cairn_carmen_log *log;
    cairn_carmen_log_record record;
    cairn_carmen_log_summary info;
    cairn_file_error error;

    assert_ok(cairn_carmen_log_open(&log, path, NULL, &error));
    info = cairn_carmen_log_info(log);
    assert_int_equal(info.lines, 10);
    assert_int_equal(info.scans, 4);
    assert_int_equal(info.odometry, 2);
    assert_int_equal(info.ignored, 2);
    assert_int_equal(info.faults, 0);
    assert_int_equal(info.beams, 15);
    assert_int_equal(info.min_beams, 1);
    assert_int_equal(info.max_beams, 5);
    assert_true(info.first_ns == INT64_C(11000000000) && info.last_ns == INT64_C(13000000000));
    assert_true(info.earliest_ns == info.first_ns && info.latest_ns == info.last_ns);
    assert_int_equal(info.backward_stamps, 1);
    assert_near(info.odometry_length, 1 + 1 + 2, NUMBER(1e-12, 1e-5));
    assert_near(info.odometry_turn, 2 * 1.570796, NUMBER(1e-12, 1e-5));
    assert_near(info.range_max, 80, 0);
    assert_int_equal(info.fixed_mounting, 1);
    assert_near(info.base_sensor.x, 0.1, 1e-6);
    assert_near(info.base_sensor.y, 0, 1e-6);
    assert_near(info.base_sensor.theta, 0, 1e-6);

    for (int round = 0; round < 2; round++) {
        assert_ok(cairn_carmen_log_next(log, &record, &error));
        assert_int_equal(record.kind, CAIRN_CARMEN_LOG_ODOMETRY);
        assert_int_equal(record.line, 3);
        assert_int_equal(record.count, 0);
        assert_int_equal(record.scan.count, 0);
        assert_near(record.robot.x, 0.5, 0);
        assert_near(record.laser.x, 0.5, 0);
        assert_true(record.stamp_ns == INT64_C(10500000000));

        assert_ok(cairn_carmen_log_next(log, &record, &error));
        assert_int_equal(record.kind, CAIRN_CARMEN_LOG_SCAN);
        assert_int_equal(record.line, 4);
        assert_int_equal(record.count, 4);
        assert_ptr_equal(record.range, record.scan.range);
        assert_int_equal(record.scan.count, 4);
        assert_near(record.range[0], 1.5, 0);
        assert_near(record.range[1], 2.25, 0);
        assert_true(isinf(record.range[2]) && record.range[2] > 0);
        assert_near(record.range[3], 0.5, 0);
        assert_null(record.scan.angle);
        assert_near(record.scan.angle_min, -1.5707963267948966, 1e-7);
        assert_near(record.scan.angle_step, 3.1415926535897932 / 4, 1e-7);
        assert_near(record.scan.range_min, 0, 0);
        assert_near(record.scan.range_max, 80, 0);
        assert_near(record.scan.range_sigma, 0.01, 1e-9);
        assert_near(record.scan.base_sensor.x, 0.1, 1e-6);
        assert_near(record.scan.motion.x, 0, 0);
        assert_true(record.scan.stamp_ns == INT64_C(11000000000) &&
                    record.stamp_ns == record.scan.stamp_ns);
        assert_near(record.laser.x, 0.1, 1e-7);
        assert_near(record.robot.x, 0, 0);

        assert_ok(cairn_carmen_log_next(log, &record, &error));
        assert_int_equal(record.line, 7);
        assert_int_equal(record.count, 5);
        assert_true(isnan(record.range[0]));
        assert_near(record.range[1], 2, 0);
        assert_near(record.range[2], 0, 0);
        assert_near(record.range[3], -1, 0);
        assert_true(isinf(record.range[4]) && record.range[4] > 0);
        assert_near(record.scan.angle_step, 3.1415926535897932 / 4, 1e-7);
        assert_true(record.stamp_ns == INT64_C(12000000000));

        assert_ok(cairn_carmen_log_next(log, &record, &error));
        assert_int_equal(record.line, 8);
        assert_int_equal(record.count, 5);
        assert_near(record.range[0], 1, 0);
        assert_near(record.range[1], 19.9, 1e-6);
        assert_true(isinf(record.range[2]));
        assert_true(isinf(record.range[3]));
        assert_near(record.range[4], 2, 0);
        assert_near(record.scan.angle_min, -1, 0);
        assert_near(record.scan.angle_step, 0.5, 0);
        assert_near(record.scan.range_max, 20, 0);
        assert_near(record.laser.y, 1.1, 1e-6);
        assert_near(record.robot.y, 1, 0);
        assert_near(record.robot.theta, 1.570796, 1e-6);
        assert_true(record.stamp_ns == INT64_C(11500000000));

        assert_ok(cairn_carmen_log_next(log, &record, &error));
        assert_int_equal(record.count, 1);
        assert_near(record.scan.angle_min, 0, 0);
        assert_near(record.robot.y, 3, 0);

        assert_ok(cairn_carmen_log_next(log, &record, &error));
        assert_int_equal(record.kind, CAIRN_CARMEN_LOG_ODOMETRY);
        assert_int_equal(record.line, 10);
        assert_near(record.robot.theta, -3.5 + 2 * 3.141592653589793, 1e-6);
        assert_status(cairn_carmen_log_next(log, &record, &error), CAIRN_EMPTY);
        assert_status(cairn_carmen_log_next(log, &record, &error), CAIRN_EMPTY);
        assert_ok(cairn_carmen_log_rewind(log, &error));
    }
    cairn_carmen_log_close(log);
    cairn_carmen_log_close(NULL);
}

static void test_plain_and_gzip(void **state)
{
    text t = small_log();

    (void)state;
    check_small_log(write_plain("small.log", &t));
    check_small_log(write_gzip("small.log.gz", &t));
    check_small_log(write_gzip("zipped-without-saying.log", &t));
    free(t.bytes);
}

static void test_line_ends_of_windows(void **state)
{
    text t = small_log(), crlf = {NULL, 0, 0};

    (void)state;
    for (size_t i = 0; i < t.count; i++)
        add(&crlf, t.bytes[i] == '\n' ? "\r\n" : "%c", t.bytes[i]);
    add(&crlf, "\r");
    check_small_log(write_plain("crlf.log", &crlf));
    free(t.bytes);
    free(crlf.bytes);
}

static void test_load(void **state)
{
    text t = small_log();
    const char *path = write_gzip("load.log.gz", &t);
    cairn_carmen_log_params params = cairn_carmen_log_default();
    cairn_carmen_log_scans scans;
    cairn_file_error error;

    (void)state;
    params.range_sigma = 0.25;
    assert_ok(cairn_carmen_log_load(&scans, path, &params, &error));
    assert_int_equal(scans.count, 4);
    assert_int_equal(scans.info.scans, 4);
    assert_int_equal(scans.record[0].line, 4);
    assert_int_equal(scans.record[3].line, 9);
    assert_ptr_equal(scans.record[0].range, scans.range);
    assert_ptr_equal(scans.record[1].scan.range, scans.range + 4);
    assert_ptr_equal(scans.record[3].range, scans.range + 14);
    assert_near(scans.record[0].range[1], 2.25, 0);
    assert_near(scans.record[2].range[1], 19.9, 1e-6);
    assert_near(scans.record[3].range[0], 3, 0);
    assert_near(scans.record[3].scan.range_sigma, 0.25, 0);
    cairn_carmen_log_scans_free(&scans);
    assert_null(scans.record);
    assert_int_equal(scans.count, 0);

    assert_status(cairn_carmen_log_load(&scans, files_path("none.log"), NULL, &error), CAIRN_IO);
    assert_null(scans.record);
    free(t.bytes);
}

static void test_bearings(void **state)
{
    static const struct {
        int count;
        double step, last; /* degrees */
    } sample[] = {{180, 1, 89},
                  {181, 1, 90},
                  {360, 0.5, 89.5},
                  {361, 0.5, 90},
                  {2, 90, 0},
                  {3, 90, 90},
                  {682, 180.0 / 682, 90 - 180.0 / 682}};
    const double degree = 3.14159265358979323846 / 180;
    cairn_carmen_log_scans scans;
    text t = {NULL, 0, 0};

    (void)state;
    for (size_t i = 0; i < sizeof sample / sizeof *sample; i++)
        add_flaser(&t, sample[i].count, 2, (double)i, (double)i);
    assert_ok(cairn_carmen_log_load(&scans, write_plain("bearings.log", &t), NULL, NULL));
    for (size_t i = 0; i < sizeof sample / sizeof *sample; i++) {
        const cairn_scan_input *scan = &scans.record[i].scan;

        assert_int_equal(scan->count, sample[i].count);
        assert_near(scan->angle_min, -90 * degree, 1e-6);
        assert_near(scan->angle_step, sample[i].step * degree, 1e-7);
        assert_near((double)scan->angle_min + (sample[i].count - 1) * (double)scan->angle_step,
                    sample[i].last * degree, 1e-5);
    }
    cairn_carmen_log_scans_free(&scans);
    free(t.bytes);
}

/* ROBOTLASER1 lines whose step is 0, with and without a limit of their own. */
static void test_robotlaser_without_step(void **state)
{
    cairn_carmen_log_params params = cairn_carmen_log_default();
    cairn_carmen_log_scans scans;
    text t = {NULL, 0, 0};
    const char *path;

    (void)state;
    add(&t, "ROBOTLASER1 0 -1.0 2.0 0 -1 0.02 1 5 1 20 80 81 2 0 0 0 0 0 0 0 0.1 0.2 1 1 0 11.5 "
            "host 11.5\n");
    add(&t, "ROBOTLASER1 0 -0.5 2.0 0 20 0.02 1 1 3 0 0 0 0 0 0 0 0.1 0.2 1 1 0 11.5 host 11.5\n");
    add(&t, "ROBOTLASER2 0 -0.5 2.0\n");
    add(&t, "ROBOTLASER1 0 -0.5 2.0 0 0.5 0.02 1 2 0.25 1 0 0 0 0 0 0 0 0.1 0.2 1 1 0 11.5 host "
            "11.5\n");
    add(&t, "ROBOTLASER1 0 -0.5 2.0 -0.5 1e5 0.02 1 2 0.25 1 0 0 0 0 0 0 0 0.1 0.2 1 1 0 11.5 host "
            "11.5\n");
    path = write_plain("robotlaser.log", &t);
    assert_ok(cairn_carmen_log_load(&scans, path, NULL, NULL));
    assert_int_equal(scans.count, 4);
    assert_int_equal(scans.info.ignored, 1);
    assert_near(scans.record[2].scan.angle_step, 2, 0);
    assert_near(scans.record[2].scan.range_max, 0.5, 0);
    assert_near(scans.record[3].scan.angle_step, -0.5, 0);
    assert_near(scans.record[3].scan.range_max, 1e5, 0);
    assert_near(scans.record[0].scan.angle_step, 0.5, 0);
    assert_near(scans.record[0].scan.range_max, 80, 0);
    assert_near(scans.record[0].range[1], 20, 0);
    assert_true(isinf(scans.record[0].range[2]));
    assert_near(scans.record[1].scan.angle_step, 0, 0);
    assert_near(scans.record[1].scan.range_max, 20, 0);
    cairn_carmen_log_scans_free(&scans);

    /* The caller's limit takes precedence. */
    params.range_max = 0.75;
    assert_ok(cairn_carmen_log_load(&scans, path, &params, NULL));
    assert_true(isinf(scans.record[1].range[0]));
    assert_near(scans.record[1].scan.range_max, 0.75, 0);
    assert_near(scans.info.range_max, 0.75, 0);
    cairn_carmen_log_scans_free(&scans);
    free(t.bytes);
}

static int64_t lines_of(const text *t, const char *name)
{
    int64_t count = 0;

    for (const char *at = t->bytes; (at = strstr(at, name)) != NULL; at++)
        count += at < t->bytes + t->count;
    return count;
}

static double limit_of(const text *t, double given)
{
    cairn_carmen_log_params params = cairn_carmen_log_default();
    cairn_carmen_log *log;
    double limit;

    params.range_max = given;
    assert_ok(cairn_carmen_log_open(&log, write_plain("limit.log", t), &params, NULL));
    limit = cairn_carmen_log_info(log).range_max;
    assert_int_equal(cairn_carmen_log_info(log).ignored, lines_of(t, "PARAM"));
    cairn_carmen_log_close(log);
    return limit;
}

/* `count` scans of one range each. */
static void add_ranges(text *t, int count, double range)
{
    for (int i = 0; i < count; i++)
        add_flaser(t, 1, range, 0, 0);
}

static void test_limit_of_the_scanner(void **state)
{
    static const double tops[] = {50.0, 51.15, 81.83, 81.91, 40.01};
    text t = {NULL, 0, 0};

    (void)state;
    /* Ranges that pile up at the top. */
    for (size_t i = 0; i < sizeof tops / sizeof *tops; i++) {
        t.count = 0;
        add_ranges(&t, 30, 12.5);
        add_ranges(&t, 10, tops[i]);
        assert_near(limit_of(&t, 0), tops[i], 0.0101);
        assert_true(limit_of(&t, 0) <= tops[i] + 1e-9);
        assert_near(limit_of(&t, 0.5), 0.5, 0);
    }
    /* Within 0.2 m: the lowest of them. */
    t.count = 0;
    add_ranges(&t, 6, 51.05);
    add_ranges(&t, 6, 51.10);
    add_ranges(&t, 6, 51.16);
    assert_near(limit_of(&t, 0), 51.05, 0.0101);
    /* One outlier far above does not matter, 2 of 12 do. */
    t.count = 0;
    add_ranges(&t, 11, 50);
    add_ranges(&t, 1, 5000);
    assert_near(limit_of(&t, 0), 50, 0.0101);
    add_ranges(&t, 1, 500);
    assert_near(limit_of(&t, 0), 80, 0);
    /* Infinite ranges are ignored; the window starts at the higher one of equal candidates, and
     * ranges just below it count only among the 2 m below. */
    t.count = 0;
    for (int i = 0; i < 12; i++)
        add(&t, "FLASER 3 50 inf -3 0 0 0 0 0 0 1 h 1\n");
    assert_near(limit_of(&t, 0), 50, 0);
    t.count = 0;
    add_ranges(&t, 5, 50.25);
    add_ranges(&t, 5, 50.4401);
    assert_near(limit_of(&t, 0), 50.25, 1e-9);
    add_ranges(&t, 2, 50.2401);
    assert_near(limit_of(&t, 0), 50.25, 1e-9);
    add_ranges(&t, 1, 50.4501);
    assert_near(limit_of(&t, 0), 50.25, 1e-9);
    add_ranges(&t, 1, 50.4601);
    assert_near(limit_of(&t, 0), 80, 0);
    /* Too few; below 40 m; as many in the 2 m below. */
    t.count = 0;
    add_ranges(&t, 9, 50);
    assert_near(limit_of(&t, 0), 80, 0);
    t.count = 0;
    add_ranges(&t, 50, 39.9);
    assert_near(limit_of(&t, 0), 80, 0);
    t.count = 0;
    add_ranges(&t, 10, 50);
    add_ranges(&t, 9, 49);
    assert_near(limit_of(&t, 0), 50, 0.0101);
    add_ranges(&t, 1, 48.5);
    assert_near(limit_of(&t, 0), 80, 0);
    t.count = 0;
    add_ranges(&t, 10, 50);
    add_ranges(&t, 10, 47.9);
    assert_near(limit_of(&t, 0), 50, 0.0101);
    free(t.bytes);
}

static void test_limit_by_param(void **state)
{
    text t = {NULL, 0, 0};

    (void)state;
    /* Accepted: nothing above it, or all above it close together. */
    add(&t, "PARAM robot_front_laser_max 30 nohost 0\n");
    add_ranges(&t, 50, 29.99);
    assert_near(limit_of(&t, 0), 30, 0);
    add_ranges(&t, 9, 31.1);
    add_ranges(&t, 9, 31.2);
    add_ranges(&t, 2, 30);
    assert_near(limit_of(&t, 0), 30, 0);
    /* Rejected: too many above it spread out. */
    add_ranges(&t, 1, 30);
    assert_near(limit_of(&t, 0), 80, 0);
    assert_near(limit_of(&t, 7), 7, 0);
    t.count = 0;
    add(&t, "PARAM robot_frontlaser_max 10 nohost 0\nPARAM robot_frontlaser_max x\nPARAM "
            "robot_frontlaser_max -4\n");
    add(&t, "PARAM robot_frontlaser_max\nPARAM\nPARAM robot_frontlaser_max nan\nPARAM "
            "robot_frontlaser_max "
            "1.1e5\nPARAM robot_rearlaser_max 3\n");
    add_ranges(&t, 12, 8);
    assert_near(limit_of(&t, 0), 10, 0);
    add_ranges(&t, 4, 15);
    add_ranges(&t, 13, 51.15);
    assert_near(limit_of(&t, 0), 51.15, 0.0101);
    t.count = 0;
    add(&t, "PARAM robot_frontlaser_max 5000 nohost 0\n");
    add_ranges(&t, 12, 8);
    assert_near(limit_of(&t, 0), 5000, 0);
    add_ranges(&t, 9, 2000);
    assert_near(limit_of(&t, 0), 5000, 0);
    t.count = 0;
    add(&t, "PARAM robot_frontlaser_max 0.5 nohost 0\nFLASER 1 0.25 0 0 0 0 0 0 1 h 1\n");
    assert_near(limit_of(&t, 0), 0.5, 0);
    t.count = 0;
    add(&t, "PARAM robot_frontlaser_max 0.001 nohost 0\nFLASER 1 -1 0 0 0 0 0 0 1 h 1\n");
    assert_near(limit_of(&t, 0), 0.001, 0);
    t.count = 0;
    add(&t, "PARAM robot_frontlaser_max 100000 nohost 0\nFLASER 1 -1 0 0 0 0 0 0 1 h 1\n");
    assert_near(limit_of(&t, 0), 100000, 0);
    free(t.bytes);
}

static void test_no_return_and_unknown(void **state)
{
    cairn_carmen_log_params params = cairn_carmen_log_default();
    cairn_carmen_log_scans scans;
    text t = {NULL, 0, 0};

    (void)state;
    add(&t, "FLASER 8 9.99 10 10.01 -inf -0.5 nan inf 1e30");
    add_tail(&t, 0, 0, 0, 0, 0, 0, 1);
    params.range_max = 10;
    assert_ok(cairn_carmen_log_load(&scans, write_plain("ranges.log", &t), &params, NULL));
    assert_near(scans.range[0], 9.99, 1e-6);
    assert_true(isinf(scans.range[1]) && scans.range[1] > 0);
    assert_true(isinf(scans.range[2]) && scans.range[2] > 0);
    assert_true(isnan(scans.range[3]));
    assert_near(scans.range[4], -0.5, 0);
    assert_true(isnan(scans.range[5]));
    assert_true(isinf(scans.range[6]) && scans.range[6] > 0);
    assert_true(isinf(scans.range[7]) && scans.range[7] > 0);
    assert_near(scans.record[0].scan.range_max, 10, 0);
    cairn_carmen_log_scans_free(&scans);
    free(t.bytes);
}

static void test_mounting(void **state)
{
    cairn_carmen_log *log;
    cairn_carmen_log_record record;
    cairn_carmen_log_summary info;
    text t = {NULL, 0, 0};

    (void)state;
    /* The laser 0.2 m ahead, 0.1 m to the left, turned by 0.3 rad, rounded differently every
     * time. */
    for (int i = 0; i < 40; i++) {
        double th = 0.4 * i, sign = i % 2 == 0 ? 1 : -1, ahead = 0.2 + 0.004 * sign,
               left = 0.1 - 0.003 * sign;

        add(&t, "FLASER 1 2");
        add_tail(&t, i + ahead * cos(th) - left * sin(th), -i + ahead * sin(th) + left * cos(th),
                 th + 0.3 + 0.002 * sign, i, -i, th, i);
    }
    assert_ok(cairn_carmen_log_open(&log, write_plain("mounting.log", &t), NULL, NULL));
    info = cairn_carmen_log_info(log);
    assert_int_equal(info.fixed_mounting, 1);
    assert_near(info.base_sensor.x, 0.2, 1e-5);
    assert_near(info.base_sensor.y, 0.1, 1e-5);
    assert_near(info.base_sensor.theta, 0.3, 1e-5);
    assert_ok(cairn_carmen_log_next(log, &record, NULL));
    assert_near(record.scan.base_sensor.x, 0.2, 1e-5);
    assert_near(record.scan.base_sensor.y, 0.1, 1e-5);
    assert_near(record.scan.base_sensor.theta, 0.3, 1e-5);
    cairn_carmen_log_close(log);

    /* A pose that no robot reaches is ignored, and so the scans can be used. */
    for (int part = 0; part < 2; part++) {
        cairn_carmen_log_scans scans;

        assert_ok(cairn_carmen_log_load(
            &scans,
            files_write_text("far.log", part == 0 ? "FLASER 1 2 100001 0 0 0 0 0 1 h 1\n"
                                                  : "FLASER 1 2 0 -100001 0 0 0 0 1 h 1\n"),
            NULL, NULL));
        assert_int_equal(scans.info.fixed_mounting, 0);
        assert_near(scans.record[0].scan.base_sensor.x, 0, 0);
        assert_near(scans.record[0].scan.base_sensor.y, 0, 0);
        cairn_carmen_log_scans_free(&scans);
    }

    /* One that differs by 0.02 m or rad makes the mounting unknown. */
    for (int part = 0; part < 3; part++) {
        size_t whole = t.count;

        add(&t, "FLASER 1 2");
        add_tail(&t, 0.2 + 0.02 * (part == 0), 0.1 - 0.02 * (part == 1), 0.3 + 0.02 * (part == 2),
                 0, 0, 0, 99);
        assert_ok(cairn_carmen_log_open(&log, write_plain("mounting.log", &t), NULL, NULL));
        info = cairn_carmen_log_info(log);
        assert_int_equal(info.fixed_mounting, 0);
        assert_near(info.base_sensor.x, 0, 0);
        assert_near(info.base_sensor.theta, 0, 0);
        cairn_carmen_log_close(log);
        t.count = whole;
    }
    free(t.bytes);
}

/* A damaged line between two good ones: reported with its number and skipped, and the good ones are
 * read. */
static void test_damaged_lines(void **state)
{
    static const struct {
        const char *line;
        cairn_status status;
        const char *piece;
    } sample[] = {
        {"FLASER", CAIRN_TRUNCATED, "ends early, expected the number of readings"},
        {"FLASER -1 1 2", CAIRN_BAD_FORMAT,
         "the number of readings is \"-1\", expected a whole number from 1 to 100000"},
        {"FLASER 0 0 0 0 0 0 0 1 h 1", CAIRN_BAD_FORMAT, "is \"0\""},
        {"FLASER 100001 1 2", CAIRN_BAD_FORMAT, "is \"100001\""},
        {"FLASER 1e2 1 2", CAIRN_BAD_FORMAT, "is \"1e2\""},
        {"FLASER 99999999999999999999 1 2", CAIRN_BAD_FORMAT, "a whole number"},
        {"FLASER 3 1 2", CAIRN_TRUNCATED, "the FLASER line ends early, expected reading 3"},
        {"FLASER 3 1 2x 3 0 0 0 0 0 0 1 h 1", CAIRN_BAD_FORMAT,
         "reading 2 is \"2x\", expected a number"},
        {"FLASER 3 1 2 1e999 0 0 0 0 0 0 1 h 1", CAIRN_BAD_FORMAT, "reading 3"},
        {"FLASER 1 1 0 0", CAIRN_TRUNCATED, "expected the laser's pose"},
        {"FLASER 1 1 0 0 0 0 0", CAIRN_TRUNCATED, "expected the robot's pose"},
        {"FLASER 1 1 0 nan 0 0 0 0 1 h 1", CAIRN_NOT_FINITE,
         "the laser's pose is nan, expected a finite number"},
        {"FLASER 1 1 0 0 0 0 inf 0 1 h 1", CAIRN_NOT_FINITE, "the robot's pose is inf"},
        {"FLASER 1 1 -1e9 1e9 0 0 0 1000000001 1 h 1", CAIRN_BAD_FORMAT,
         "the robot's pose is 1e+09, expected"},
        {"FLASER 1 1 0 0 0 0 -1.1e9 0 1 h 1", CAIRN_BAD_FORMAT,
         "the robot's pose is -1.1e+09, expected a number up to 1e+09"},
        {"FLASER 1 1 0 0 0 0 0 0", CAIRN_TRUNCATED, "expected the stamp"},
        {"FLASER 1 1 0 0 0 0 0 0 late h 1", CAIRN_BAD_FORMAT, "the stamp is \"late\""},
        {"FLASER 1 1 0 0 0 0 0 0 1e11 h 1", CAIRN_BAD_FORMAT, "the stamp is \"1e11\""},
        {"FLASER 1 1 0 0 0 0 0 0 -9e9 h 1", CAIRN_BAD_FORMAT,
         "the stamp is \"-9e9\", expected seconds within 4e9"},
        {"FLASER 1 1 0 0 0 0 0 0 1", CAIRN_TRUNCATED, "expected the host"},
        {"FLASER 1 1 0 0 0 0 0 0 1 h", CAIRN_TRUNCATED, "expected the logger's stamp"},
        {"FLASER 1 1 0 0 0 0 0 0 1 h x", CAIRN_BAD_FORMAT, "the logger's stamp is \"x\""},
        {"FLASER 1 1 0 0 0 0 0 0 0 1 h 1", CAIRN_BAD_FORMAT, "the logger's stamp is \"h\""},
        {"FLASER 1 1 0 0 0 0 0 0 1 h 1 2", CAIRN_BAD_FORMAT,
         "\"2\" follows the last field of the FLASER message"},
        {"FLASER 1 \x01\xff\x7f 0 0 0 0 0 0 1 h 1", CAIRN_BAD_FORMAT, "reading 1 is \"???\""},
        {"FLASER 1 0123456789x123456789012345678901234567890 0", CAIRN_BAD_FORMAT,
         "\"0123456789x1234567890123...\""},
        {"ODOM 1 2", CAIRN_TRUNCATED, "the ODOM line ends early, expected the robot's pose"},
        {"ODOM 1 2 3 4 5 x", CAIRN_BAD_FORMAT, "the robot's motion is \"x\""},
        {"ODOM 1 2 3 4 5 6 7", CAIRN_TRUNCATED, "expected the host"},
        {"ROBOTLASER1 0 1 2", CAIRN_TRUNCATED, "expected the scanner's description"},
        {"ROBOTLASER1 0 1 2 3 inf 5 6 1 1", CAIRN_NOT_FINITE, "the scanner's description is inf"},
        {"ROBOTLASER1 0 1 2 3 100001 5 6 1 1 0 0 0 0 0 0 0 1 2 3 4 5 1 h 1", CAIRN_BAD_FORMAT,
         "the maximum range is 100001, expected at most 100000 m"},
        {"ROBOTLASER1 0 1e300 2 3 4 5 6 1 1", CAIRN_BAD_FORMAT,
         "the scanner's description is 1e+300, expected a number"},
        {"ROBOTLASER1 0 1 2 3 4 5 6 1", CAIRN_TRUNCATED, "expected reading 1"},
        {"ROBOTLASER1 0 1 2 3 4 5 6 1 1 -1", CAIRN_BAD_FORMAT,
         "the number of remissions is \"-1\", expected a whole number from 0"},
        {"ROBOTLASER1 0 1 2 3 4 5 6 1 1 2 7", CAIRN_TRUNCATED, "expected remission 2"},
        {"ROBOTLASER1 0 1 2 3 4 5 6 1 1 0 0 0 0 0 0", CAIRN_TRUNCATED, "expected the robot's pose"},
        {"ROBOTLASER1 0 1 2 3 4 5 6 1 1 0 0 0 0 0 0 0 1 2 3 4", CAIRN_TRUNCATED,
         "expected the robot's motion"},
        {"ROBOTLASER1 0 1 2 3 4 5 6 1 1 0 0 0 0 0 0 0 1 2 3 4 5", CAIRN_TRUNCATED,
         "expected the stamp"},
    };
    faults f;
    cairn_carmen_log_params params = with_faults(&f);

    (void)state;
    for (size_t i = 0; i < sizeof sample / sizeof *sample; i++) {
        text t = {NULL, 0, 0};
        cairn_carmen_log_scans scans;
        const char *path;

        add_flaser(&t, 2, 3, 0, 1);
        add(&t, "%s\n", sample[i].line);
        add_flaser(&t, 2, 4, 1, 2);
        path = write_plain("damaged.log", &t);
        params = with_faults(&f);
        assert_ok(cairn_carmen_log_load(&scans, path, &params, NULL));
        assert_int_equal(scans.count, 2);
        assert_int_equal(scans.info.faults, 1);
        assert_int_equal(scans.record[1].line, 3);
        assert_near(scans.record[1].range[1], 4, 0);
        assert_int_equal(f.count, 1);
        assert_int_equal(f.line[0], 2);
        assert_int_equal(f.status[0], sample[i].status);
        assert_holds(f.text[0], "damaged.log:2: ");
        assert_holds(f.text[0], sample[i].piece);
        if (sample[i].status == CAIRN_TRUNCATED) /* and the piece ends it */
            assert_string_equal(strstr(f.text[0], sample[i].piece), sample[i].piece);
        cairn_carmen_log_scans_free(&scans);
        /* Without a callback they are counted all the same. */
        assert_ok(cairn_carmen_log_load(&scans, path, NULL, NULL));
        assert_int_equal(scans.info.faults, 1);
        cairn_carmen_log_scans_free(&scans);
        free(t.bytes);
    }
}

static void test_the_most_beams(void **state)
{
    text t = {NULL, 0, 0};
    cairn_carmen_log_scans scans;
    faults f;
    cairn_carmen_log_params params = with_faults(&f);

    (void)state;
    add_flaser(&t, 2, 3, 0, 1);
    add_flaser(&t, CAIRN_CARMEN_LOG_MAX_BEAMS + 1, 1, 0, 1);
    add_flaser(&t, CAIRN_CARMEN_LOG_MAX_BEAMS, 1, 0, 2);
    assert_ok(cairn_carmen_log_load(&scans, write_gzip("beams.log.gz", &t), &params, NULL));
    assert_int_equal(scans.count, 2);
    assert_int_equal(scans.record[1].count, CAIRN_CARMEN_LOG_MAX_BEAMS);
    assert_near(scans.record[1].range[CAIRN_CARMEN_LOG_MAX_BEAMS - 1], 1, 0);
    assert_int_equal(f.count, 1);
    assert_int_equal(f.line[0], 2);
    cairn_carmen_log_scans_free(&scans);
    free(t.bytes);
}

/* Lines of exactly the longest length, one more, and far more, in the middle and at the end. */
static void test_endless_line(void **state)
{
    static const size_t size[] = {CAIRN_LINE_READER_MAX_BYTES, CAIRN_LINE_READER_MAX_BYTES + 1,
                                  (size_t)35 << 20, (size_t)17 << 20};
    char *garbage = malloc((size_t)35 << 20);
    faults f;
    cairn_carmen_log_params params = with_faults(&f);
    cairn_carmen_log_scans scans;
    text t = {NULL, 0, 0};
    const char *path;
    FILE *file;

    (void)state;
    assert_non_null(garbage);
    memset(garbage, '#', (size_t)35 << 20);
    path = files_path("endless.log");
    file = fopen(path, "wb");
    assert_non_null(file);
    add_flaser(&t, 2, 3, 0, 1);
    for (int i = 0; i < 4; i++) {
        assert_int_equal(fwrite(garbage, 1, size[i], file), size[i]);
        if (i < 3)
            assert_int_equal(fputc('\n', file), '\n');
        if (i < 2)
            assert_int_equal(fwrite(t.bytes, 1, t.count, file), t.count);
    }
    assert_int_equal(fclose(file), 0);

    assert_ok(cairn_carmen_log_load(&scans, path, &params, NULL));
    assert_int_equal(scans.count, 2);
    assert_int_equal(scans.record[0].line, 2);
    assert_int_equal(scans.record[1].line, 4);
    assert_int_equal(scans.info.lines, 6);
    assert_int_equal(f.count, 3);
    for (int i = 0; i < 3; i++) {
        char words[128];

        (void)snprintf(words, sizeof words,
                       ":%d: the line has %zu bytes, expected at most 16777216", i + 3 + (i > 0),
                       size[i + 1]);
        assert_int_equal(f.line[i], i + 3 + (i > 0));
        assert_int_equal(f.status[i], CAIRN_FULL);
        assert_holds(f.text[i], words);
    }
    cairn_carmen_log_scans_free(&scans);
    free(garbage);
    free(t.bytes);
}

static void test_nothing_to_read(void **state)
{
    cairn_carmen_log_params params = cairn_carmen_log_default();
    cairn_carmen_log *log;
    cairn_file_error error;
    const char *path;

    (void)state;
    assert_status(cairn_carmen_log_open(&log, files_write_text("empty.log", ""), NULL, &error),
                  CAIRN_EMPTY);
    assert_null(log);
    assert_error(&error, CAIRN_EMPTY, 0, "empty.log: the file is empty");
    assert_status(cairn_carmen_log_open(&log, files_write_text("byte.log", "x"), NULL, &error),
                  CAIRN_EMPTY);
    assert_error(&error, CAIRN_EMPTY, 0, "byte.log: no whole scan in 1 lines (0 damaged)");
    assert_status(cairn_carmen_log_open(
                      &log,
                      files_write_text("no-scan.log", "# x\nODOM 1 2 3 0 0 0 1 h 1\nFLASER 3\n"),
                      NULL, &error),
                  CAIRN_EMPTY);
    assert_error(&error, CAIRN_EMPTY, 0, "no-scan.log: no whole scan in 3 lines (1 damaged)");
    assert_status(cairn_carmen_log_open(&log, files_path("not-there.log"), NULL, &error), CAIRN_IO);
    assert_error(&error, CAIRN_IO, 0, "not-there.log: cannot open: No such file");
    assert_status(cairn_carmen_log_open(&log, files_folder, NULL, &error), CAIRN_UNSUPPORTED);
    assert_error(&error, CAIRN_UNSUPPORTED, 0, ": is a folder, expected a regular file");
    path = files_path("pipe");
    assert_int_equal(mkfifo(path, 0600), 0);
    assert_status(cairn_carmen_log_open(&log, path, NULL, &error), CAIRN_UNSUPPORTED);
    assert_error(&error, CAIRN_UNSUPPORTED, 0, "pipe: is a pipe or device");
    assert_status(cairn_carmen_log_open(&log, files_path("not-there.log"), NULL, NULL), CAIRN_IO);
    /* A file that cannot be read though it can be opened. */
    if (access("/proc/self/mem", R_OK) == 0) {
        assert_status(cairn_carmen_log_open(&log, "/proc/self/mem", NULL, &error), CAIRN_IO);
        assert_error(&error, CAIRN_IO, 0, "/proc/self/mem: cannot read: Input/output error");
        assert_status(cairn_carmen_log_open(&log, "/proc/self/mem", NULL, NULL), CAIRN_IO);
    }

    /* Only both bytes of the gzip signature identify it. */
    for (int k = 0; k < 2; k++) {
        assert_ok(cairn_carmen_log_open(
            &log,
            files_write_text("bytes.log", k ? "\x1fx\nFLASER 1 1 0 0 0 0 0 0 1 h 1\n"
                                            : "y\x8b\nFLASER 1 1 0 0 0 0 0 0 1 h 1\n"),
            NULL, &error));
        cairn_carmen_log_close(log);
    }

    path = files_write_text("good.log", "FLASER 1 1 0 0 0 0 0 0 1 h 1\n");
    params.range_max = -1;
    assert_status(cairn_carmen_log_open(&log, path, &params, &error), CAIRN_BAD_ARGUMENT);
    assert_error(&error, CAIRN_BAD_ARGUMENT, 0,
                 "good.log: range_max is -1, expected a number from 0 to 100000");
    params.range_max = (double)NAN;
    assert_status(cairn_carmen_log_open(&log, path, &params, &error), CAIRN_BAD_ARGUMENT);
    params.range_max = (double)INFINITY;
    assert_status(cairn_carmen_log_open(&log, path, &params, &error), CAIRN_BAD_ARGUMENT);
    params.range_max = 100001;
    assert_status(cairn_carmen_log_open(&log, path, &params, &error), CAIRN_BAD_ARGUMENT);
    assert_holds(error.text, "range_max is 100001, expected a number from 0 to 100000");
    params.range_max = 100000;
    assert_ok(cairn_carmen_log_open(&log, path, &params, &error));
    cairn_carmen_log_close(log);
    params = cairn_carmen_log_default();
    params.range_sigma = (double)NAN;
    assert_status(cairn_carmen_log_open(&log, path, &params, &error), CAIRN_BAD_ARGUMENT);
    assert_error(&error, CAIRN_BAD_ARGUMENT, 0, "good.log: range_sigma is nan, expected");
    params.range_sigma = -1;
    assert_status(cairn_carmen_log_open(&log, path, &params, &error), CAIRN_BAD_ARGUMENT);
    params.range_sigma = 100001;
    assert_status(cairn_carmen_log_open(&log, path, &params, &error), CAIRN_BAD_ARGUMENT);
    params.range_sigma = 100000;
    assert_ok(cairn_carmen_log_open(&log, path, &params, &error));
    cairn_carmen_log_close(log);
    params.range_sigma = 0;
    assert_ok(cairn_carmen_log_open(&log, path, &params, &error));
    cairn_carmen_log_close(log);
}

static void test_binary_garbage(void **state)
{
    unsigned char bytes[20000];
    cairn_random random = cairn_random_seed(3, 3);
    cairn_carmen_log *log;
    cairn_file_error error;

    (void)state;
    for (size_t i = 0; i < sizeof bytes; i++)
        bytes[i] = (unsigned char)cairn_random_below(&random, 256);
    assert_status(
        cairn_carmen_log_open(&log, files_write("garbage.log", bytes, sizeof bytes), NULL, &error),
        CAIRN_EMPTY);
    assert_holds(error.text, "no whole scan");
    /* A zero byte does not end a line. */
    assert_status(
        cairn_carmen_log_open(&log, files_write("zero.log", "FLASER 1 1 0 0 0 0 0 0\0 1 h 1\n", 30),
                              NULL, &error),
        CAIRN_EMPTY);
}

/* Truncated anywhere, the scans before the end are read. */
static void test_cut_plain_file(void **state)
{
    text t = {NULL, 0, 0};
    size_t line;

    (void)state;
    add_flaser(&t, 3, 3, 0, 1);
    line = t.count;
    add_flaser(&t, 3, 3, 1, 2);
    add_flaser(&t, 3, 3, 2, 3);
    for (size_t cut = line; cut < t.count; cut++) {
        text piece = {t.bytes, cut, t.capacity};
        cairn_carmen_log_scans scans;
        faults f;
        cairn_carmen_log_params params = with_faults(&f);
        int whole = (int)(cut / line);

        assert_ok(cairn_carmen_log_load(&scans, write_plain("cut.log", &piece), &params, NULL));
        /* The very last field, which is not used, may be truncated. */
        if (f.count == 0) {
            assert_true(scans.count == whole ||
                        (scans.count == whole + 1 && cut % line >= line - 9));
        } else {
            assert_int_equal(f.count, 1);
            assert_int_equal(scans.count, whole);
            assert_int_equal(f.line[0], whole + 1);
        }
        cairn_carmen_log_scans_free(&scans);
    }
    free(t.bytes);
}

static void test_cut_and_damaged_gzip(void **state)
{
    cairn_random random = cairn_random_seed(11, 1);
    text t = {NULL, 0, 0};
    int scans_most = 0, damaged = 0;
    size_t size = 0;
    char *bytes;

    (void)state;
    for (int i = 0; i < 400; i++) {
        add(&t, "FLASER 20");
        for (int k = 0; k < 20; k++)
            add(&t, " %d.%d", (int)cairn_random_below(&random, 30),
                (int)cairn_random_below(&random, 100));
        add_tail(&t, i, 0, 0, i, 0, 0, i);
    }
    bytes = files_read(write_gzip("whole.log.gz", &t), &size);
    assert_non_null(bytes);
    for (size_t cut = 2; cut < size; cut += cut < 40 || cut > size - 120 ? 1 : 97) {
        const char *path = files_write("cut.log.gz", bytes, cut);
        cairn_carmen_log *log;
        cairn_file_error error;
        faults f;
        cairn_carmen_log_params params = with_faults(&f);
        cairn_status status = cairn_carmen_log_open(&log, path, &params, &error);

        if (status == CAIRN_OK) {
            cairn_carmen_log_summary info = cairn_carmen_log_info(log);
            cairn_carmen_log_record record;
            int count = 0;

            /* More bytes never give fewer scans, and truncation is always reported. */
            assert_true(info.scans >= scans_most);
            scans_most = (int)info.scans;
            assert_true(f.count >= 1 && f.count <= 2);
            assert_int_equal(f.status[f.count - 1], CAIRN_TRUNCATED);
            assert_int_equal(f.line[f.count - 1], info.lines);
            assert_holds(f.text[f.count - 1], "the gzip data end after this line");
            while (cairn_carmen_log_next(log, &record, &error) == CAIRN_OK)
                count++;
            assert_int_equal(count, info.scans);
            cairn_carmen_log_close(log);
        } else {
            assert_int_equal(status, CAIRN_EMPTY);
            assert_true(scans_most == 0);
        }
    }
    assert_int_equal(scans_most, 400);
    for (size_t at = 20; at < size; at += 31) {
        cairn_carmen_log_scans scans;
        faults f;
        cairn_carmen_log_params params = with_faults(&f);
        cairn_status status;

        bytes[at] = (char)(bytes[at] ^ 0x55);
        status =
            cairn_carmen_log_load(&scans, files_write("broken.log.gz", bytes, size), &params, NULL);
        bytes[at] = (char)(bytes[at] ^ 0x55);
        assert_true(status == CAIRN_OK || status == CAIRN_EMPTY);
        assert_true(f.count > 0);
        for (int i = 0; i < f.count && i < 32; i++)
            damaged += strstr(f.text[i], "the gzip data are damaged after this line") != NULL &&
                       f.status[i] == CAIRN_BAD_FORMAT;
        if (status == CAIRN_OK)
            cairn_carmen_log_scans_free(&scans);
    }
    assert_true(damaged > 10);
    /* The checksum, the fourth last byte of the first word at the end. */
    {
        cairn_carmen_log_scans scans;
        faults f;
        cairn_carmen_log_params params = with_faults(&f);

        bytes[size - 8] = (char)(bytes[size - 8] ^ 1);
        assert_ok(
            cairn_carmen_log_load(&scans, files_write("sum.log.gz", bytes, size), &params, NULL));
        assert_int_equal(scans.count, 400);
        assert_int_equal(f.count, 1);
        assert_holds(
            f.text[0],
            ":400: the gzip data are damaged after this line (incorrect data check), expected");
        cairn_carmen_log_scans_free(&scans);
    }
    free(bytes);
    free(t.bytes);
}

/* Files that change after the first pass: what fits into the arrays of the first pass is
 * returned. */
static void rewrite(void *context, const cairn_file_error *fault)
{
    (void)fault;
    (void)files_write_text("changing.log", context);
}

static void test_a_file_that_changes(void **state)
{
    static char one[] = "FLASER 1 7 0 0 0 0 0 0 1 h 1\n",
                wide[] = "FLASER 1 7 0 0 0 0 0 0 1 h 1\n"
                         "FLASER 4 5 5 5 5 0 0 0 0 0 0 1 h 1\n",
                many[] = "FLASER 1 7 0 0 0 0 0 0 1 h 1\nFLASER 1 8 0 0 0 0 0 0 1 h 1\nFLASER 1 9 0 "
                         "0 0 0 0 0 1 h 1\n";
    static const struct {
        const char *first;
        char *second;
        int count;
    } sample[] = {
        {"FLASER 2 1 2 0 0 0 0 0 0 1 h 1\nFLASER 2 1 2 0 0 0 0 0 0 1 h 1\nFLASER x\n", one, 1},
        {"FLASER 2 1 2 0 0 0 0 0 0 1 h 1\nFLASER 2 1 2 0 0 0 0 0 0 1 h 1\nFLASER x\n", wide, 1},
        {"FLASER 2 1 2 0 0 0 0 0 0 1 h 1\nFLASER 2 1 2 0 0 0 0 0 0 1 h 1\nFLASER x\n", many, 2}};

    (void)state;
    for (size_t i = 0; i < sizeof sample / sizeof *sample; i++) {
        cairn_carmen_log_params params = cairn_carmen_log_default();
        cairn_carmen_log_scans scans;

        params.on_fault = rewrite;
        params.context = sample[i].second;
        assert_ok(cairn_carmen_log_load(&scans, files_write_text("changing.log", sample[i].first),
                                        &params, NULL));
        assert_int_equal(scans.count, sample[i].count);
        assert_int_equal(scans.info.scans, 2);
        assert_near(scans.record[0].range[0], 7, 0);
        cairn_carmen_log_scans_free(&scans);
    }
}

/* Coordinates of a national grid keep their digits in float: they are taken from the first pose. */
static void test_far_origin(void **state)
{
    const char *path = files_write_text(
        "far.log", "FLASER 1 1 500000.75 5400000.5 0 500000.25 5400000.5 0 1 h 1\n"
                   "FLASER 1 1 500002.125 5400001.5 0 500001.625 5400001.5 0 2 h 2\n"
                   "ODOM 500003.5 5400000 0 0 0 0 4 h 4\n");
    cairn_carmen_log_scans scans;
    faults f;
    cairn_carmen_log_params params = with_faults(&f);

    (void)state;
    assert_ok(cairn_carmen_log_load(&scans, path, &params, NULL));
    assert_int_equal(scans.count, 2);
    assert_near(scans.info.origin[0], 500000, 0);
    assert_near(scans.info.origin[1], 5400000, 0);
    assert_near(scans.record[0].robot.x, 0.25, 0);
    assert_near(scans.record[0].laser.x, 0.75, 0);
    assert_near(scans.record[1].robot.x, 1.625, 0);
    assert_near(scans.record[1].robot.y, 1.5, 0);
    assert_near(scans.record[1].scan.base_sensor.x, 0.5, 0);
    assert_int_equal(scans.info.faults, 0);
    cairn_carmen_log_scans_free(&scans);
    /* Near ones stay as they are. */
    path = files_write_text("near.log", "FLASER 1 1 99999 -3.5 0 99999 -3.5 0 1 h 1\n");
    assert_ok(cairn_carmen_log_load(&scans, path, NULL, NULL));
    assert_near(scans.info.origin[0], 0, 0);
    assert_near(scans.record[0].robot.x, 99999, 0);
    cairn_carmen_log_scans_free(&scans);
}

/* One byte repeated over and over is no log: it ends where 32 MiB are unpacked from less than a
 * hundredth of that. */
static void test_gzip_of_nothing(void **state)
{
    const char *path = files_path("nothing.log.gz");
    gzFile file = gzopen(path, "wb1");
    text t = small_log();
    static char lines[1 << 20];
    cairn_carmen_log_scans scans;
    faults f;
    cairn_carmen_log_params params = with_faults(&f);

    (void)state;
    memset(lines, '\n', sizeof lines);
    assert_non_null(file);
    assert_int_equal(gzwrite(file, t.bytes, (unsigned)t.count), t.count);
    for (int i = 0; i < 40; i++)
        assert_int_equal(gzwrite(file, lines, sizeof lines), sizeof lines);
    assert_int_equal(gzclose(file), Z_OK);
    assert_ok(cairn_carmen_log_load(&scans, path, &params, NULL));
    assert_int_equal(scans.info.faults, 1);
    assert_holds(f.text[0], "the gzip data expand more than 100 times, expected those of a log");
    cairn_carmen_log_scans_free(&scans);
    free(t.bytes);
}

/* Gzip files concatenated by cat, and with trailing bytes. */
static void test_gzip_members(void **state)
{
    text t = small_log();
    size_t size = 0, half = t.count / 2;
    text first = {t.bytes, half, t.capacity}, second = {t.bytes + half, t.count - half, t.capacity};
    char *one = files_read(write_gzip("one.gz", &first), &size), *both;
    size_t more = 0;
    char *two = files_read(write_gzip("two.gz", &second), &more);
    cairn_carmen_log_scans scans;
    faults f;
    cairn_carmen_log_params params = with_faults(&f);

    (void)state;
    both = malloc(size + more + 5);
    assert_non_null(both);
    memcpy(both, one, size);
    memcpy(both + size, two, more);
    check_small_log(files_write("members.log.gz", both, size + more));
    memcpy(both + size + more, "\0\0\0\0x", 5);
    check_small_log(files_write("padded.log.gz", both, size + more + 5));
    /* The end of the first member at every position around the borders of the reader's blocks of 64
     * KiB: a name pads its header. */
    for (size_t end = 65534; end <= 65538; end++) {
        char *padded = calloc(end + more, 1);

        assert_non_null(padded);
        memcpy(padded, one, 10);
        padded[3] = 8;
        memset(padded + 10, 'n', end - size - 1);
        memcpy(padded + end - size + 10, one + 10, size - 10);
        memcpy(padded + end, two, more);
        check_small_log(files_write("blocks.log.gz", padded, end + more));
        free(padded);
    }
    /* Truncated in the header of the second. */
    assert_ok(cairn_carmen_log_load(&scans, files_write("members-cut.log.gz", both, size + 5),
                                    &params, NULL));
    assert_true(f.count >= 1);
    assert_int_equal(f.status[f.count - 1], CAIRN_TRUNCATED);
    cairn_carmen_log_scans_free(&scans);
    free(one);
    free(two);
    free(both);
    free(t.bytes);
}

/* Whatever the damage of a log, it is read or a fault with a line is given. */
static void test_mutations(void **state)
{
    static const char *const pieces[] = {"nan",         "-1",   "FLASER",      "\n", " ", "1e308",
                                         "99999999999", "\r\n", "ROBOTLASER1", "#",  "0", "inf"};
    cairn_random random = cairn_random_seed(2024, 7);
    text t = small_log();
    char *bytes = malloc(t.count + 64);
    int read = 0, faulty = 0;

    (void)state;
    assert_non_null(bytes);
    for (int round = 0; round < 2000; round++) {
        size_t count = t.count;
        int edits = 1 + cairn_random_below(&random, 4);
        cairn_carmen_log_scans scans;
        cairn_file_error error;
        faults f;
        cairn_carmen_log_params params = with_faults(&f);
        text changed;
        cairn_status status;

        memcpy(bytes, t.bytes, t.count);
        for (int e = 0; e < edits; e++) {
            size_t at = (size_t)cairn_random_below(&random, (int32_t)count - 16);
            int kind = cairn_random_below(&random, 4);

            if (kind == 0) {
                bytes[at] = (char)cairn_random_below(&random, 256);
            } else if (kind == 1) {
                const char *piece =
                    pieces[cairn_random_below(&random, (int32_t)(sizeof pieces / sizeof *pieces))];

                memcpy(bytes + at, piece, strlen(piece));
            } else if (kind == 2) {
                size_t gone = (size_t)cairn_random_below(&random, 12);

                memmove(bytes + at, bytes + at + gone, count - at - gone);
                count -= gone;
            } else {
                memmove(bytes + at + 5, bytes + at, count - at);
                memcpy(bytes + at, " 7.5 ", 5);
                count += 5;
            }
            if (count > t.count + 40)
                count = t.count;
        }
        changed.bytes = bytes;
        changed.count = count;
        status =
            cairn_carmen_log_load(&scans, write_plain("mutated.log", &changed), &params, &error);
        assert_true(status == CAIRN_OK || status == CAIRN_EMPTY);
        for (int i = 0; i < f.count && i < 32; i++) {
            assert_true(f.line[i] >= 1);
            assert_true(f.status[i] < 0);
            assert_holds(f.text[i], "expected");
        }
        faulty += f.count > 0;
        read += status == CAIRN_OK;
        if (status == CAIRN_OK) {
            assert_true(scans.count > 0);
            for (int i = 0; i < scans.count; i++) {
                assert_int_equal(cairn_pose_is_finite(scans.record[i].robot), 1);
                assert_true(scans.record[i].count >= 1);
            }
            cairn_carmen_log_scans_free(&scans);
        }
    }
    assert_true(read > 1500 && faulty > 500);
    free(bytes);
    free(t.bytes);
}

static void test_locale(void **state)
{
    text t = small_log();
    const char *path = write_plain("locale.log", &t);

    (void)state;
    if (!files_comma_locale())
        skip();
    check_small_log(path);
    assert_non_null(setlocale(LC_ALL, "C"));
    free(t.bytes);
}

/* A path that is longer than an error text keeps its end. */
static void test_long_path(void **state)
{
    cairn_file_error error;
    char path[1201];
    cairn_carmen_log *log;

    (void)state;
    memset(path, 'a', sizeof path);
    memcpy(path + 1190, "/final.log", 11);
    assert_status(cairn_carmen_log_open(&log, path, NULL, &error), CAIRN_IO);
    assert_holds(error.text, "aaa/final.log: cannot open: ");
    assert_memory_equal(error.text, "...aaa", 6);
    assert_true(strlen(error.text) < sizeof error.text);
}

/* All memory is freed, whatever the end. */
static void test_heap(void **state)
{
    text t = small_log();
    size_t heap = 0;

    (void)state;
    (void)write_gzip("heap.log.gz", &t);
    for (int round = 0; round <= FILES_HEAP_ROUNDS; round++) {
        cairn_carmen_log_scans scans;
        cairn_carmen_log *log;
        const char *path = files_path("heap.log.gz");

        if (round == 1)
            heap = files_heap();
        assert_ok(cairn_carmen_log_load(&scans, path, NULL, NULL));
        cairn_carmen_log_scans_free(&scans);
        assert_ok(cairn_carmen_log_open(&log, path, NULL, NULL));
        assert_ok(cairn_carmen_log_rewind(log, NULL));
        cairn_carmen_log_close(log);
        assert_status(cairn_carmen_log_load(&scans, files_folder, NULL, NULL), CAIRN_UNSUPPORTED);
        assert_status(
            cairn_carmen_log_load(&scans, files_write_text("heap.log", "ODOM\n"), NULL, NULL),
            CAIRN_EMPTY);
    }
    assert_true(files_heap() < heap + FILES_HEAP_NOISE);
    free(t.bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_plain_and_gzip),
        cmocka_unit_test(test_line_ends_of_windows),
        cmocka_unit_test(test_load),
        cmocka_unit_test(test_bearings),
        cmocka_unit_test(test_robotlaser_without_step),
        cmocka_unit_test(test_limit_of_the_scanner),
        cmocka_unit_test(test_limit_by_param),
        cmocka_unit_test(test_no_return_and_unknown),
        cmocka_unit_test(test_mounting),
        cmocka_unit_test(test_damaged_lines),
        cmocka_unit_test(test_the_most_beams),
        cmocka_unit_test(test_endless_line),
        cmocka_unit_test(test_nothing_to_read),
        cmocka_unit_test(test_binary_garbage),
        cmocka_unit_test(test_cut_plain_file),
        cmocka_unit_test(test_cut_and_damaged_gzip),
        cmocka_unit_test(test_a_file_that_changes),
        cmocka_unit_test(test_gzip_members),
        cmocka_unit_test(test_far_origin),
        cmocka_unit_test(test_gzip_of_nothing),
        cmocka_unit_test(test_mutations),
        cmocka_unit_test(test_locale),
        cmocka_unit_test(test_heap),
        cmocka_unit_test(test_long_path),
    };
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
