/* Logs of any format through one door: bags in every container, compression and serialization, what
 * is taken of them, and every way in which they can be cut or wrong.
 *
 * test_scan_log --print FILE   prints stamps and the bits of all ranges, for tests/compare_bags.py
 * */
#include "tests/bag_writer.h"

#include <fcntl.h>
#include <inttypes.h>
#include <math.h>

#include "cairn/scan_log.h"
#include "src/host/bags/ros_message.h"
#include "src/host/bags/unpack.h"

enum { ROS1_FILE, MCAP_FILE, MCAP_CHUNKS, SQLITE_FILE, CONTAINERS };

#define SECOND INT64_C(1000000000)

static const char *const scan_type = "sensor_msgs/LaserScan";
static const char *const odometry_type = "nav_msgs/Odometry";
static const char *const transform_type = "tf2_msgs/TFMessage";

/* Faults of the last load. */
static cairn_file_error reported[16];
static int32_t reported_count;

static void on_fault(void *context, const cairn_file_error *fault)
{
    (void)context;
    if (reported_count < 16)
        reported[reported_count] = *fault;
    reported_count++;
}

static cairn_scan_log_params reported_params(void)
{
    cairn_scan_log_params params = cairn_scan_log_default();

    params.on_fault = on_fault;
    reported_count = 0;
    return params;
}

static cairn_status load(cairn_scan_log *log, const char *path, cairn_file_error *error)
{
    cairn_scan_log_params params = reported_params();

    return cairn_scan_log_load(log, path, &params, error);
}

/* 1 when this build reads and writes a container with a compression. */
static int is_built(int container, bag_packing packing)
{
    if (!bag_packs(packing))
        return 0;
    switch (container) {
    case ROS1_FILE:
        return packing != BAG_ZSTD;
    case MCAP_FILE:
        return packing == BAG_NONE;
    case MCAP_CHUNKS:
        return packing != BAG_BZ2;
    default:
#ifdef CAIRN_HAVE_SQLITE
        return packing == BAG_NONE || packing == BAG_ZSTD;
#else
        return 0;
#endif
    }
}

static bag_bytes write_container(const bag_recording *recording, int container, bag_packing packing)
{
#ifdef CAIRN_HAVE_SQLITE
    if (container == SQLITE_FILE)
        return bag_write_sqlite(recording, packing);
#endif
    return container == ROS1_FILE ? bag_write_ros1(recording, packing)
                                  : bag_write_mcap(recording, packing, container == MCAP_CHUNKS);
}

static const char *write_bag(const bag_recording *recording, int container, bag_packing packing)
{
    bag_bytes bytes = write_container(recording, container, packing);
    const char *path = files_write("bag", bytes.data, bytes.count);

    bag_free(&bytes);
    return path;
}

/* ---- A recording ---- */

enum { RANGES = 6 };
static const float ranges[RANGES] = {1.25F, 0, NAN, INFINITY, 30, -INFINITY};

static bag_scan plain_scan(int64_t stamp_ns)
{
    bag_scan scan = {.stamp_ns = stamp_ns,
                     .frame = "laser",
                     .angle_min = -0.5F,
                     .angle_step = 0.25F,
                     .time_step = 0.001F,
                     .range_min = 0.1F,
                     .range_max = 30,
                     .range = ranges,
                     .count = RANGES};

    return scan;
}

static void record_scan(bag_recording *recording, int topic, int64_t time_ns, bag_scan scan)
{
    bag_record(recording, topic, time_ns, bag_laser_scan(recording->encoding, &scan));
}

static void record_transform(bag_recording *recording, int topic, int64_t time_ns,
                             const char *parent, const char *child, double x, double y,
                             const double rotation[4])
{
    bag_transform transform = {time_ns, parent, child, {x, y, 0, 0, 0, 0, 0}};

    memcpy(&transform.pose[3], rotation, 4 * sizeof *rotation);
    bag_record(recording, topic, time_ns, bag_transforms(recording->encoding, &transform, 1));
}

static void record_odometry(bag_recording *recording, int topic, int64_t time_ns, double x,
                            double y, double theta)
{
    bag_transform pose = {
        time_ns, "odom", "base_link", {x, y, 0, 0, 0, sin(theta / 2), cos(theta / 2)}};

    bag_record(recording, topic, time_ns, bag_odometry(recording->encoding, &pose));
}

static const double level[4] = {0, 0, 0, 1}, rolled[4] = {1, 0, 0, 0}, pitched[4] = {0, 1, 0, 0};

/* Four scans a second apart, recorded half a second later; odometry between them, which moves 1 m
 * and turns by 0.5 rad a second; a sensor at 0.2, 0.1, turned by a quarter; an Imu. */
static bag_recording make_recording(bag_encoding encoding)
{
    static const double quarter[4] = {0, 0, 0.70710678118654752, 0.70710678118654752};
    bag_recording recording = {.encoding = encoding};
    int scans = bag_topic(&recording, "/scan", scan_type);
    int odometry = bag_topic(&recording, "/odom", odometry_type);
    int fixed = bag_topic(&recording, "/tf_static", transform_type);
    int imu = bag_topic(&recording, "/imu", "sensor_msgs/Imu");
    bag_bytes noise = {NULL, 0, 0};

    bag_put(&noise, "not an Imu", 10);
    bag_record(&recording, imu, SECOND, noise);
    record_transform(&recording, fixed, SECOND, "/base_link", "laser", 0.2, 0.1, quarter);
    for (int k = 0; k < 4; k++) {
        record_odometry(&recording, odometry, (10 + k) * SECOND - SECOND / 2, k, 0, 0.5 * k);
        record_scan(&recording, scans, (10 + k) * SECOND + SECOND / 2,
                    plain_scan((10 + k) * SECOND));
    }
    return recording;
}

static void check_ranges(const cairn_carmen_log_record *record)
{
    assert_int_equal(record->count, RANGES);
    assert_int_equal(record->scan.count, RANGES);
    assert_true(record->scan.range == record->range);
    assert_true(record->scan.angle == NULL);
    assert_memory_equal(record->range, ranges, 2 * sizeof *ranges);
    assert_true(isnan(record->range[2]));
    assert_true(isinf(record->range[3]) && record->range[3] > 0);
    assert_true(isinf(record->range[4]) && record->range[4] > 0);
    assert_true(isnan(record->range[5]));
}

static void check_topic(const cairn_scan_log_topic *topic, const char *name, const char *type,
                        int64_t messages, int64_t used)
{
    const char *found = strrchr(topic->type, '/');

    assert_string_equal(topic->name, name);
    assert_non_null(found);
    assert_string_equal(found + 1, type);
    assert_int_equal(topic->messages, messages);
    assert_int_equal(topic->used, used);
}

/* Checks what make_recording() says of its sources. */
static void check_sources(const cairn_scan_log_sources *sources)
{
    assert_non_null(sources);
    check_topic(&sources->topics[sources->scans], "/scan", "LaserScan", 4, 4);
    check_topic(&sources->topics[sources->odometry], "/odom", "Odometry", 4, 4);
    check_topic(&sources->topics[sources->mounting], "/tf_static", "TFMessage", 1, 1);
    assert_string_equal(sources->sensor_frame, "laser");
    assert_string_equal(sources->base_frame, "base_link");
    assert_string_equal(sources->odometry_frame, "odom");
    assert_true(sources->is_mounted && !sources->upside_down && !sources->moves);
    assert_int_equal(sources->topic_count, 4);
    for (int32_t i = 0; i < sources->topic_count; i++)
        assert_int_equal(sources->topics[i].used, strcmp(sources->topics[i].name, "/imu") == 0
                                                      ? 0
                                                      : sources->topics[i].messages);
}

/* Checks what make_recording() holds. */
static void check_recording(const cairn_scan_log *log)
{
    const cairn_carmen_log_summary *info = &log->scans.info;

    assert_int_equal(reported_count, 0);
    assert_int_equal(log->kind, CAIRN_SCAN_LOG_BAG);
    assert_int_equal(log->has_odometry, 1);
    assert_string_equal(log->taken,
                        "scan /scan (4), odometry /odom, sensor at 0.20 0.10 90.0\302\260 from "
                        "/tf_static");
    check_sources(log->sources);
    assert_int_equal(log->scans.count, 4);
    assert_int_equal(info->lines, 10);
    assert_int_equal(info->scans, 4);
    assert_int_equal(info->odometry, 4);
    assert_int_equal(info->ignored, 2);
    assert_int_equal(info->faults, 0);
    assert_int_equal(info->beams, 4 * RANGES);
    assert_int_equal(info->min_beams, RANGES);
    assert_int_equal(info->max_beams, RANGES);
    assert_int_equal(info->first_ns, 10 * SECOND);
    assert_int_equal(info->latest_ns, 13 * SECOND);
    assert_int_equal(info->fixed_mounting, 1);
    for (int32_t k = 0; k < 4; k++) {
        const cairn_carmen_log_record *record = &log->scans.record[k];

        check_ranges(record);
        assert_int_equal(record->kind, CAIRN_CARMEN_LOG_SCAN);
        assert_int_equal(record->line, 4 + 2 * k);
        assert_int_equal(record->stamp_ns, (10 + k) * SECOND);
        assert_int_equal(record->scan.stamp_ns, (10 + k) * SECOND);
        assert_near(record->scan.angle_min, -0.5, 0);
        assert_near(record->scan.angle_step, 0.25, 0);
        assert_near(record->scan.time_step, 0.001F, 0);
        assert_near(record->scan.range_min, 0.1F, 0);
        assert_near(record->scan.range_max, 30, 0);
        assert_near(record->scan.range_sigma, 0.01F, 0);
        assert_near(record->scan.base_sensor.x, 0.2, 1e-6);
        assert_near(record->scan.base_sensor.y, 0.1, 1e-6);
        assert_near(record->scan.base_sensor.theta, 1.5707963267948966, 1e-6);
        /* half way to the next pose on an arc; behind the last one it stays */
        assert_near(record->robot.theta, k < 3 ? 0.5 * k + 0.25 : 1.5, 1e-6);
    }
    assert_near(log->scans.record[3].robot.x, 3, 0);
    assert_near(log->scans.record[3].robot.y, 0, 0);
    /* the sagitta of an arc whose chord is 1 and whose end is turned by 0.5 */
    assert_near(log->scans.record[0].robot.x, 0.5, 1e-6);
    assert_near(log->scans.record[0].robot.y, -0.5 * tan(0.125), 1e-6);
}

static void all_containers(void **state)
{
    (void)state;
    for (int encoding = BAG_ROS1; encoding <= BAG_CDR_BIG; encoding++) {
        bag_recording recording = make_recording((bag_encoding)encoding);

        for (int container = 0; container < CONTAINERS; container++)
            for (int packing = BAG_NONE; packing <= BAG_ZSTD; packing++) {
                cairn_scan_log log;
                cairn_file_error error;

                /* these two hold one serialization */
                if (!is_built(container, (bag_packing)packing) ||
                    (container == ROS1_FILE && encoding != BAG_ROS1) ||
                    (container == SQLITE_FILE && encoding == BAG_ROS1))
                    continue;
                if (load(&log, write_bag(&recording, container, (bag_packing)packing), &error) !=
                    CAIRN_OK)
                    fail_msg("container %d, %s: %s", container, bag_packing_name[packing],
                             error.text);
                check_recording(&log);
                cairn_scan_log_free(&log);
            }
        bag_recording_free(&recording);
    }
}

/* A file of ROS 2 that is compressed as a whole. */
static void whole_files(void **state)
{
    bag_recording recording = make_recording(BAG_CDR_LITTLE);

    (void)state;
    for (int container = MCAP_FILE; container < CONTAINERS; container++) {
        cairn_scan_log log;
        bag_bytes plain, packed;

        if (!is_built(container, BAG_NONE) || !bag_packs(BAG_ZSTD))
            continue;
        plain = write_container(&recording, container, BAG_NONE);
        packed = bag_pack(BAG_ZSTD, &plain);
        assert_ok(load(&log, files_write("bag", packed.data, packed.count), NULL));
        check_recording(&log);
        cairn_scan_log_free(&log);
        /* cut: the frame has one block, of which nothing can be used */
        assert_true(load(&log, files_write("bag", packed.data, packed.count / 2), NULL) < 0);
        bag_free(&plain);
        bag_free(&packed);
    }
    bag_recording_free(&recording);
}

/* ---- Order ---- */

static void order_of_recording(void **state)
{
    static const int64_t recorded[5] = {30, 10, 20, 10, 20}, stamps[5] = {3, 5, 1, 2, 4};
    static const int64_t expected[5] = {5, 2, 1, 4, 3};
    bag_recording recording = {.encoding = BAG_ROS1};
    int scans = bag_topic(&recording, "/scan", scan_type);
    cairn_scan_log log;

    (void)state;
    for (int k = 0; k < 5; k++)
        record_scan(&recording, scans, recorded[k] * SECOND, plain_scan(stamps[k] * SECOND));
    for (int container = 0; container < SQLITE_FILE; container++) {
        assert_ok(load(&log, write_bag(&recording, container, BAG_NONE), NULL));
        for (int k = 0; k < 5; k++)
            assert_int_equal(log.scans.record[k].stamp_ns, expected[k] * SECOND);
        assert_int_equal(log.scans.info.backward_stamps, 3);
        assert_int_equal(log.has_odometry, 0);
        assert_int_equal(log.scans.info.odometry, 0);
        assert_string_equal(log.taken, "scan /scan (5), no odometry, sensor taken to be at the "
                                       "robot's origin: no transform from base_link to laser");
        assert_int_equal(log.sources->is_mounted, 0);
        assert_int_equal(log.sources->odometry, -1);
        assert_int_equal(log.sources->mounting, -1);
        assert_null(log.sources->odometry_frame);
        cairn_scan_log_free(&log);
    }
    bag_recording_free(&recording);
}

/* Loads a recording as a bag of ROS 1 and frees it. */
static cairn_status load_recording(cairn_scan_log *log, bag_recording *recording,
                                   const cairn_scan_log_params *params, cairn_file_error *error)
{
    cairn_status status =
        cairn_scan_log_load(log, write_bag(recording, ROS1_FILE, BAG_NONE), params, error);

    bag_recording_free(recording);
    return status;
}

/* Odometry is taken by its stamps, not in the order of its recording; of equal stamps the last. */
static void order_of_odometry(void **state)
{
    static const int64_t stamps[6] = {4, 1, 3, 2, 5, 2};
    static const double x[6] = {16, 1, 9, 4, 25, 6};
    cairn_scan_log_params params = reported_params();
    bag_recording recording = {.encoding = BAG_ROS1};
    int scans = bag_topic(&recording, "/scan", scan_type);
    int odometry = bag_topic(&recording, "/odom", odometry_type);
    cairn_scan_log log;

    (void)state;
    for (int k = 0; k < 6; k++)
        record_odometry(&recording, odometry, stamps[k] * SECOND, x[k], -x[k], 0);
    for (int k = 2; k < 9; k++)
        record_scan(&recording, scans, 6 * SECOND, plain_scan(k * SECOND / 2));
    assert_ok(load_recording(&log, &recording, &params, NULL));
    assert_int_equal(log.scans.count, 7);
    assert_int_equal(log.scans.info.odometry, 6);
    for (int k = 2; k < 9; k++) {
        static const double expected[9] = {0, 0, 1, 2.5, 6, 7.5, 9, 12.5, 16};

        assert_near(log.scans.record[k - 2].robot.x, expected[k], 1e-6);
        assert_near(log.scans.record[k - 2].robot.y, -expected[k], 1e-6);
    }
    cairn_scan_log_free(&log);
}

/* ---- Frames ---- */

/* A transform that is published behind all scans, as a latched topic may be recorded. */
static void latched_transform(void **state)
{
    cairn_scan_log_params params = reported_params();
    bag_recording recording = {.encoding = BAG_ROS1};
    int scans = bag_topic(&recording, "/scan", scan_type);
    int odometry = bag_topic(&recording, "/odom", odometry_type);
    int fixed = bag_topic(&recording, "/tf_static", transform_type);
    cairn_scan_log log;

    (void)state;
    record_scan(&recording, scans, SECOND, plain_scan(SECOND));
    record_odometry(&recording, odometry, SECOND, 1, 2, 3);
    record_transform(&recording, fixed, 0, "base_link", "laser", 0.5, 0, level);
    record_transform(&recording, fixed, 0, "base_link", "laser", 0.5, 0, level);
    assert_ok(load_recording(&log, &recording, &params, NULL));
    assert_int_equal(reported_count, 0);
    assert_near(log.scans.record[0].scan.base_sensor.x, 0.5, 0);
    assert_near(log.scans.record[0].robot.x, 1, 0);
    assert_near(log.scans.record[0].robot.y, 2, 0);
    assert_near(log.scans.record[0].robot.theta, 3, 1e-6);
    assert_near(log.scans.record[0].laser.x, 1 + 0.5 * cos(3), 1e-6);
    cairn_scan_log_free(&log);
}

/* A recording of one scan and its odometry, both at SECOND and at the origin, and of links between
 * frames. */
typedef struct mounted_scan {
    bag_recording recording;
    int scans, odometry, links;
} mounted_scan;

/* links: topic of the links */
static mounted_scan begin_mounted(const char *links)
{
    mounted_scan mounted = {.recording = {.encoding = BAG_ROS1}};

    mounted.scans = bag_topic(&mounted.recording, "/scan", scan_type);
    mounted.odometry = bag_topic(&mounted.recording, "/odom", odometry_type);
    mounted.links = bag_topic(&mounted.recording, links, transform_type);
    return mounted;
}

static void record_link(mounted_scan *mounted, const char *parent, const char *child, double x,
                        double y, const double *rotation)
{
    record_transform(&mounted->recording, mounted->links, 0, parent, child, x, y, rotation);
}

/* Adds odometry and scan, loads the recording and frees it. */
static void load_mounted(cairn_scan_log *log, mounted_scan *mounted)
{
    cairn_scan_log_params params = reported_params();

    record_odometry(&mounted->recording, mounted->odometry, SECOND, 0, 0, 0);
    record_scan(&mounted->recording, mounted->scans, SECOND, plain_scan(SECOND));
    assert_ok(load_recording(log, &mounted->recording, &params, NULL));
}

/* A sensor that hangs upside down sees clockwise; it is the direction of each beam that counts. */
static void upside_down(void **state)
{
    static const struct {
        const double *rotation;
        double theta;
        const char *taken;
    } cases[] = {{rolled, 0, "sensor upside down at 0.30 0.00 0.0\302\260 from /tf_static"},
                 {pitched, 3.141592653589793,
                  "sensor upside down at 0.30 0.00 180.0\302\260 from /tf_static"}};

    (void)state;
    for (size_t i = 0; i < 2; i++) {
        mounted_scan mounted = begin_mounted("/tf_static");
        cairn_scan_log log;

        record_link(&mounted, "base_link", "laser", 0.3, 0, cases[i].rotation);
        load_mounted(&log, &mounted);
        assert_int_equal(reported_count, 0);
        assert_near(log.scans.record[0].scan.angle_min, 0.5, 0);
        assert_near(log.scans.record[0].scan.angle_step, -0.25, 0);
        assert_near(cairn_wrap_angle(log.scans.record[0].scan.base_sensor.theta -
                                     (cairn_real)cases[i].theta),
                    0, 1e-6);
        assert_non_null(strstr(log.taken, cases[i].taken));
        assert_int_equal(log.sources->upside_down, 1);
        cairn_scan_log_free(&log);
    }
}

/* Without a topic of odometry the transforms odom -> base are it; the sensor is mounted over two links,
 * the base is not the frame above all. */
static void odometry_of_transforms(void **state)
{
    static const double half[4] = {0, 0, 1, 0};
    cairn_scan_log_params params = reported_params();
    bag_recording recording = {.encoding = BAG_ROS1};
    int scans = bag_topic(&recording, "/scan", scan_type);
    int moving = bag_topic(&recording, "/tf", transform_type);
    int fixed = bag_topic(&recording, "/tf_static", transform_type);
    cairn_scan_log log;

    (void)state;
    record_transform(&recording, moving, SECOND, "map", "odom", 100, 0, level);
    record_transform(&recording, moving, SECOND, "odom", "base_footprint", 1, 0, level);
    record_transform(&recording, moving, 3 * SECOND, "odom", "base_footprint", 3, 0, level);
    record_transform(&recording, fixed, 0, "base_footprint", "base_link", 0.1, 0, half);
    record_transform(&recording, fixed, 0, "base_link", "laser", 0.4, 0.2, level);
    record_scan(&recording, scans, 2 * SECOND, plain_scan(2 * SECOND));
    assert_ok(load_recording(&log, &recording, &params, NULL));
    assert_int_equal(reported_count, 0);
    assert_int_equal(log.has_odometry, 1);
    assert_near(log.scans.record[0].robot.x, 2, 1e-6);
    assert_near(log.scans.record[0].scan.base_sensor.x, -0.3, 1e-6);
    assert_near(log.scans.record[0].scan.base_sensor.y, -0.2, 1e-6);
    assert_near(cairn_abs(log.scans.record[0].scan.base_sensor.theta), 3.14159265, 1e-6);
    assert_non_null(strstr(log.taken, "odometry odom to base_footprint from /tf, sensor at -0.30 "
                                      "-0.20 180.0\302\260 from /tf_static"));
    assert_string_equal(log.sources->topics[log.sources->odometry].name, "/tf");
    assert_string_equal(log.sources->odometry_frame, "odom");
    assert_string_equal(log.sources->base_frame, "base_footprint");
    cairn_scan_log_free(&log);
}

/* A base that is not above the sensor: the way leads over the frame above both. A loop of links
 * ends the search. */
static void tree_of_frames(void **state)
{
    mounted_scan mounted = begin_mounted("/tf_static");
    cairn_scan_log log;

    (void)state;
    record_link(&mounted, "body", "base_link", 1, 0, level);
    record_link(&mounted, "body", "laser", 1.5, 0.5, level);
    load_mounted(&log, &mounted);
    assert_near(log.scans.record[0].scan.base_sensor.x, 0.5, 0);
    assert_near(log.scans.record[0].scan.base_sensor.y, 0.5, 0);
    cairn_scan_log_free(&log);

    mounted = begin_mounted("/tf");
    record_link(&mounted, "a", "laser", 1, 0, level);
    record_link(&mounted, "laser", "a", 1, 0, level);
    load_mounted(&log, &mounted);
    assert_non_null(strstr(log.taken, "no transform from base_link to laser"));
    assert_near(log.scans.record[0].scan.base_sensor.x, 0, 0);
    cairn_scan_log_free(&log);
}

/* A mounting that moves and one that is tilted are faults. */
static void mountings_that_move_or_tilt(void **state)
{
    static const double tilted[4] = {0.25881904510252076, 0, 0, 0.96592582628906829};
    mounted_scan mounted = begin_mounted("/tf");
    cairn_scan_log log;

    (void)state;
    record_link(&mounted, "base_link", "laser", 0.5, 0, tilted);
    record_link(&mounted, "/base_link", "/laser", 0.7, 0, tilted);
    load_mounted(&log, &mounted);
    assert_int_equal(reported_count, 2);
    assert_non_null(
        strstr(reported[0].text, "from base_link to laser moves, expected a fixed sensor"));
    assert_non_null(strstr(reported[1].text, "tilted by 30.0 degrees, expected a level one"));
    assert_int_equal(log.scans.info.faults, 2);
    assert_near(log.scans.record[0].scan.base_sensor.x, 0.5, 0);
    assert_int_equal(log.sources->moves, 1);
    assert_near(log.sources->tilt, 3.14159265 / 6, 1e-6);
    cairn_scan_log_free(&log);
}

/* ---- Topics ---- */

static bag_recording two_of_each(void)
{
    bag_recording recording = {.encoding = BAG_ROS1};
    int front = bag_topic(&recording, "/front", scan_type);
    int back = bag_topic(&recording, "/back", scan_type);
    int wheels = bag_topic(&recording, "/wheels", odometry_type);
    int fused = bag_topic(&recording, "/fused", odometry_type);
    int links = bag_topic(&recording, "/tf", transform_type);

    record_scan(&recording, front, SECOND, plain_scan(SECOND));
    record_scan(&recording, back, SECOND, plain_scan(2 * SECOND));
    record_scan(&recording, back, SECOND, plain_scan(3 * SECOND));
    record_odometry(&recording, wheels, SECOND, 1, 0, 0);
    record_odometry(&recording, fused, SECOND, 2, 0, 0);
    record_transform(&recording, links, SECOND, "odom", "base_link", 3, 0, level);
    record_transform(&recording, links, SECOND, "base_link", "laser", 0, 0, level);
    return recording;
}

static void topics_are_named(void **state)
{
    static const struct {
        const char *scan, *odometry;
        int64_t stamp;
        double x;
    } cases[] = {{"/front", "/wheels", 1, 1}, {"back", "fused", 2, 2}, {"/back", "/tf", 2, 3}};
    static const struct {
        const char *scan, *odometry, *text;
    } bad[] = {
        {NULL, NULL,
         ": 2 topics of scans, expected one named by --scan: /front (sensor_msgs/LaserScan, 1), "
         "/back (sensor_msgs/LaserScan, 2)"},
        {"/front", NULL,
         ": 2 topics of odometry, expected one named by --odom: /wheels (nav_msgs/Odometry, 1), "
         "/fused (nav_msgs/Odometry, 1)"},
        {"/side", "/tf",
         ": no topic /side of scans, expected one of: /front (sensor_msgs/LaserScan, 1), /back"},
        {"/wheels", "/tf", ": no topic /wheels of scans, expected one of: /front"},
        {"/front", "/odom", ": no topic /odom of odometry, expected one of: /wheels"}};
    cairn_scan_log_params params = reported_params();
    cairn_file_error error;
    cairn_scan_log log;

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bag_recording recording = two_of_each();

        params.scan_topic = cases[i].scan;
        params.odometry_topic = cases[i].odometry;
        assert_ok(load_recording(&log, &recording, &params, NULL));
        assert_int_equal(log.scans.record[0].stamp_ns, cases[i].stamp * SECOND);
        assert_near(log.scans.record[0].robot.x, cases[i].x, 0);
        cairn_scan_log_free(&log);
    }
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        bag_recording recording = two_of_each();

        params.scan_topic = bad[i].scan;
        params.odometry_topic = bad[i].odometry;
        assert_status(load_recording(&log, &recording, &params, &error), CAIRN_BAD_ARGUMENT);
        assert_non_null(strstr(error.text, bad[i].text));
        assert_null(log.scans.record);
    }
}

/* Transforms that are requested for as odometry and are not there. */
static void no_transforms(void **state)
{
    cairn_scan_log_params params = reported_params();
    bag_recording recording = make_recording(BAG_ROS1);
    cairn_file_error error;
    cairn_scan_log log;

    (void)state;
    params.odometry_topic = "/tf";
    assert_status(load_recording(&log, &recording, &params, &error), CAIRN_BAD_ARGUMENT);
    assert_non_null(strstr(error.text, "no transform from odom above laser on /tf, expected one"));
}

static void no_scans(void **state)
{
    bag_recording recording = {.encoding = BAG_ROS1};
    int odometry = bag_topic(&recording, "/odom", odometry_type);
    cairn_file_error error;
    cairn_scan_log log;

    (void)state;
    assert_status(load(&log, write_bag(&recording, MCAP_FILE, BAG_NONE), &error), CAIRN_EMPTY);
    assert_non_null(strstr(error.text, "no scan in 0 messages, expected "
                                       "sensor_msgs/LaserScan; topics: none"));
    record_odometry(&recording, odometry, SECOND, 0, 0, 0);
    assert_status(load(&log, write_bag(&recording, MCAP_FILE, BAG_NONE), &error), CAIRN_EMPTY);
    assert_non_null(strstr(error.text, "topics: /odom (nav_msgs/Odometry, 1)"));
    bag_recording_free(&recording);
    assert_status(load(&log, files_write_text("bag", "#ROSBAG V2.0\n"), &error), CAIRN_EMPTY);
    assert_non_null(strstr(error.text, "no scan in 0 messages"));
}

static void first_echoes(void **state)
{
    static const float echoes[3] = {9, 1.5F, 2.5F};

    (void)state;
    for (int encoding = BAG_ROS1; encoding <= BAG_CDR_BIG; encoding++) {
        bag_recording recording = {.encoding = (bag_encoding)encoding};
        int scans = bag_topic(&recording, "/echoes", "sensor_msgs/MultiEchoLaserScan");
        bag_scan scan = plain_scan(SECOND);
        cairn_scan_log log;

        scan.range = echoes;
        scan.count = 3;
        scan.is_multi_echo = 1;
        record_scan(&recording, scans, SECOND, scan);
        assert_ok(load(&log, write_bag(&recording, MCAP_CHUNKS, BAG_NONE), NULL));
        assert_int_equal(reported_count, 0);
        assert_int_equal(log.scans.record[0].count, 3);
        assert_true(isnan(log.scans.record[0].range[0]));
        assert_near(log.scans.record[0].range[1], 1.5, 0);
        assert_near(log.scans.record[0].range[2], 2.5, 0);
        cairn_scan_log_free(&log);
        bag_recording_free(&recording);
    }
}

/* ---- Damaged messages ---- */

/* Only plain CDR of either order of bytes is read: its first byte is 0, its second one 0 or 1. */
static void encapsulations(void **state)
{
    static const struct {
        uint8_t bytes[2];
        cairn_status status;
    } cases[] = {{{0, 0}, CAIRN_OK},          {{0, 1}, CAIRN_OK},
                 {{0, 2}, CAIRN_UNSUPPORTED}, {{0, 3}, CAIRN_UNSUPPORTED},
                 {{1, 0}, CAIRN_UNSUPPORTED}, {{1, 1}, CAIRN_UNSUPPORTED}};

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const uint8_t bytes[4] = {cases[i].bytes[0], cases[i].bytes[1], 0, 0};
        cairn_ros_reader reader;

        assert_status(cairn_ros_begin(&reader, CAIRN_ROS_ENCODING_CDR, bytes, 4), cases[i].status);
        assert_status(cairn_ros_begin(&reader, CAIRN_ROS_ENCODING_CDR, bytes, 3), CAIRN_TRUNCATED);
        assert_ok(cairn_ros_begin(&reader, CAIRN_ROS_ENCODING_ROS1, bytes, 3));
    }
}

/* Scans and poses that cannot be used are reported and left out; the good ones around them are used. */
static void bad_messages(void **state)
{
    static const struct {
        float angle_min, range_min, range_max;
        int count;
        const char *text;
    } cases[] = {{NAN, 0, 30, 6, "bearings that are not finite"},
                 {0, 30, 30, 6, "range_min at or above range_max"},
                 {0, 0, 30, 0, "a scan without ranges"}};
    static const double nothing[4] = {0, 0, 0, 0};
    cairn_scan_log_params params = reported_params();
    bag_recording recording = {.encoding = BAG_ROS1};
    int scans = bag_topic(&recording, "/scan", scan_type);
    int odometry = bag_topic(&recording, "/odom", odometry_type);
    int links = bag_topic(&recording, "/tf", transform_type);
    cairn_scan_log log;

    (void)state;
    for (int i = 0; i < 3; i++) {
        bag_scan scan = plain_scan(SECOND);

        scan.angle_min = cases[i].angle_min;
        scan.range_min = cases[i].range_min;
        scan.range_max = cases[i].range_max;
        scan.count = cases[i].count;
        record_scan(&recording, scans, SECOND, scan);
    }
    record_odometry(&recording, odometry, SECOND, (double)NAN, 0, 0);
    record_odometry(&recording, odometry, SECOND, 0, 2e9, 0);
    record_transform(&recording, links, SECOND, "base_link", "laser", 1, 0, nothing);
    record_transform(&recording, links, SECOND, "base_link", "laser", 2, 0, level);
    record_odometry(&recording, odometry, SECOND, 4, 0, 0);
    record_scan(&recording, scans, SECOND, plain_scan(SECOND));
    assert_ok(load_recording(&log, &recording, &params, NULL));
    assert_int_equal(reported_count, 6);
    for (int i = 0; i < 3; i++)
        assert_non_null(strstr(reported[i].text, cases[i].text));
    assert_non_null(strstr(reported[0].text, "bag: message 1 at byte "));
    assert_non_null(strstr(reported[0].text, ": on /scan (sensor_msgs/LaserScan), "));
    for (int i = 3; i < 6; i++)
        assert_non_null(strstr(reported[i].text, "expected finite numbers"));
    assert_int_equal(log.scans.count, 1);
    assert_near(log.scans.record[0].robot.x, 4, 0);
    assert_near(log.scans.record[0].scan.base_sensor.x, 2, 0);
    cairn_scan_log_free(&log);
}

/* range_max of a message that has none is 80 m; --range-max goes before it. */
static void range_limits(void **state)
{
    static const float no_limit[3] = {NAN, 0, INFINITY};
    cairn_scan_log_params params = reported_params();
    cairn_scan_log log;

    (void)state;
    for (int i = 0; i < 3; i++) {
        bag_recording recording = {.encoding = BAG_ROS1};
        int scans = bag_topic(&recording, "/scan", scan_type);
        bag_scan scan = plain_scan(SECOND);

        scan.range_max = no_limit[i];
        record_scan(&recording, scans, SECOND, scan);
        params.range_max = i == 2 ? 20 : 0;
        assert_ok(load_recording(&log, &recording, &params, NULL));
        assert_near(log.scans.record[0].scan.range_max, i == 2 ? 20 : 80, 0);
        assert_int_equal(isinf(log.scans.record[0].range[4]) != 0, i == 2);
        cairn_scan_log_free(&log);
    }
}

/* Lengths of which a message has not the bytes. */
static void giant_lengths(void **state)
{
    /* positions in a message of ROS 1: length of frame_id, and of ranges */
    static const size_t at[2] = {12, 4 + 8 + 4 + 5 + 7 * 4};
    static const char *const text[2] = {"that end within header.frame_id",
                                        "that end within ranges"};

    (void)state;
    for (int i = 0; i < 2; i++) {
        cairn_scan_log_params params = reported_params();
        bag_recording recording = {.encoding = BAG_ROS1};
        int scans = bag_topic(&recording, "/scan", scan_type);
        cairn_scan_log log;

        record_scan(&recording, scans, SECOND, plain_scan(SECOND));
        record_scan(&recording, scans, SECOND, plain_scan(SECOND));
        memset(recording.message[0].bytes.data + at[i], 0xff, 4);
        assert_ok(load_recording(&log, &recording, &params, NULL));
        assert_int_equal(reported_count, 1);
        assert_non_null(strstr(reported[0].text, text[i]));
        assert_int_equal(log.scans.count, 1);
        cairn_scan_log_free(&log);
    }
}

/* ---- Damaged files ---- */

/* Checks a bag that is cut to `count` bytes: *most is the number of scans of a longer one. */
static void check_cut(const char *path, size_t count, int32_t *most)
{
    cairn_file_error error;
    cairn_scan_log log;
    cairn_status status;

    assert_int_equal(truncate(path, (off_t)count), 0);
    status = load(&log, path, &error);
    if (status != CAIRN_OK) {
        assert_true(status < 0);
        assert_non_null(strstr(error.text, "bag"));
        *most = 0;
        return;
    }
    assert_in_range(log.scans.count, 1, *most);
    *most = log.scans.count;
    check_ranges(&log.scans.record[0]);
    /* in the data a cut is reported; what follows them is not needed */
    if (*most < 4)
        assert_true(reported_count > 0);
    cairn_scan_log_free(&log);
}

/* Every cut is survived: a status, and never more scans than in a longer file. */
static void cuts(void **state)
{
    (void)state;
    for (int container = 0; container < CONTAINERS; container++)
        for (int packing = BAG_NONE; packing <= BAG_ZSTD; packing++) {
            bag_recording recording =
                make_recording(container == ROS1_FILE ? BAG_ROS1 : BAG_CDR_LITTLE);
            /* pages of a database come whole */
            size_t step = container == SQLITE_FILE ? 509 : 1;
            int32_t most = 4;
            bag_bytes bytes;
            const char *path;

            if (is_built(container, (bag_packing)packing)) {
                bytes = write_container(&recording, container, (bag_packing)packing);
                path = files_write("bag", bytes.data, bytes.count);
                for (size_t count = bytes.count; count > 0; count -= count < step ? count : step)
                    check_cut(path, count, &most);
                assert_int_equal(most, 0);
                bag_free(&bytes);
            }
            bag_recording_free(&recording);
        }
}

/* The place of the cut is reported; what is before the cut is used. */
static void cut_is_reported(void **state)
{
    bag_recording recording = make_recording(BAG_ROS1);
    bag_bytes bytes = bag_write_ros1(&recording, BAG_NONE);
    cairn_scan_log log;

    (void)state;
    /* the chunk is followed by an index of 4 + 9 + 4 + 8 bytes */
    assert_ok(load(&log, files_write("bag", bytes.data, bytes.count - 24 - 60), NULL));
    assert_int_equal(log.scans.count, 3);
    assert_int_equal(reported_count, 1);
    assert_non_null(strstr(reported[0].text,
                           "bag: message 10 at byte 51: a record of 81 bytes, of "
                           "which its chunk has 21, expected all: the file is cut"));
    assert_int_equal(log.scans.info.faults, 1);
    cairn_scan_log_free(&log);
    bag_free(&bytes);
    bag_recording_free(&recording);
}

/* What is wrong with a record of a chunk is reported at the byte of the chunk. */
static void cut_of_a_chunk_is_reported(void **state)
{
    bag_recording recording = make_recording(BAG_CDR_LITTLE);
    bag_bytes bytes = bag_write_mcap(&recording, BAG_NONE, 1);
    cairn_scan_log log;

    (void)state;
    /* 13 + 29 + 8 bytes follow the chunk, which ends with a message of 106 */
    assert_ok(load(&log, files_write("bag", bytes.data, bytes.count - 50 - 60), NULL));
    assert_int_equal(log.scans.count, 3);
    assert_int_equal(reported_count, 1);
    assert_non_null(strstr(reported[0].text,
                           "bag: message 10 at byte 34: a record of 106 bytes, of "
                           "which its chunk has 46, expected all: the file is cut"));
    cairn_scan_log_free(&log);
    bag_free(&bytes);
    bag_recording_free(&recording);
}

/* Every byte in turn is set to 0xff: nothing breaks. */
static void damaged_bytes(void **state)
{
    static const uint8_t damage = 0xff;

    (void)state;
    for (int container = 0; container < CONTAINERS; container++) {
        bag_recording recording =
            make_recording(container == ROS1_FILE ? BAG_ROS1 : BAG_CDR_LITTLE);
        bag_bytes bytes;
        int file;

        if (is_built(container, BAG_NONE)) {
            bytes = write_container(&recording, container, BAG_NONE);
            file = open(files_write("bag", bytes.data, bytes.count), O_WRONLY);
            assert_true(file >= 0);
            for (size_t i = 0; i < bytes.count; i += container == SQLITE_FILE ? 17 : 1) {
                cairn_scan_log log;

                assert_int_equal(pwrite(file, &damage, 1, (off_t)i), 1);
                if (load(&log, files_path("bag"), NULL) == CAIRN_OK) {
                    assert_in_range(log.scans.count, 1, 4);
                    cairn_scan_log_free(&log);
                }
                assert_int_equal(pwrite(file, &bytes.data[i], 1, (off_t)i), 1);
            }
            (void)close(file);
            bag_free(&bytes);
        }
        bag_recording_free(&recording);
    }
}

/* A chunk whose checksum differs is left out. */
static void checksums(void **state)
{
    bag_recording recording = make_recording(BAG_CDR_LITTLE);
    bag_bytes bytes = bag_write_mcap(&recording, BAG_NONE, 1);
    cairn_file_error error;
    cairn_scan_log log;

    (void)state;
    /* in the last message of the chunk, which 13 + 29 + 8 bytes follow */
    bytes.data[bytes.count - 50 - 10] ^= 1;
    assert_status(load(&log, files_write("bag", bytes.data, bytes.count), &error), CAIRN_EMPTY);
    assert_int_equal(reported_count, 1);
    assert_non_null(strstr(reported[0].text, "a chunk with another checksum than "));
    bag_free(&bytes);
    bag_recording_free(&recording);
}

/* Sizes that a file declares and has not. */
static void giant_records(void **state)
{
    bag_recording recording = make_recording(BAG_ROS1);
    bag_bytes bytes = bag_write_ros1(&recording, BAG_NONE);
    cairn_file_error error;
    cairn_scan_log log;

    (void)state;
    /* the length of the first header */
    memset(bytes.data + 13, 0xff, 4);
    assert_status(load(&log, files_write("bag", bytes.data, bytes.count), &error), CAIRN_EMPTY);
    assert_int_equal(reported_count, 1);
    assert_non_null(strstr(reported[0].text, "message 1 at byte 13: a header of 4294967295 bytes, "
                                             "expected at most 1048576"));
    bag_free(&bytes);
    bytes = bag_write_mcap(&recording, BAG_NONE, 1);
    /* the length of the first record */
    memset(bytes.data + 9, 0xff, 8);
    assert_status(load(&log, files_write("bag", bytes.data, bytes.count), &error), CAIRN_EMPTY);
    assert_int_equal(reported_count, 1);
    assert_non_null(strstr(reported[0].text,
                           "message 1 at byte 8: a record of 18446744073709551615 "
                           "bytes, of which the file has "));
    bag_free(&bytes);
    bag_recording_free(&recording);
}

/* The first header of a bag, filled up to `length` bytes by a field that is not read. */
static const char *write_long_header(const bag_bytes *plain, size_t length)
{
    bag_bytes file = {NULL, 0, 0}, header = {NULL, 0, 0}, data = {NULL, 0, 0};
    uint8_t *filler = calloc(1, length);
    /* the lengths of a header of 30 bytes and of no data */
    size_t first = 13 + 4 + 30 + 4;
    const char *path;

    assert_non_null(filler);
    bag_put(&file, plain->data, 13);
    bag_field_number(&header, "op", 3, 1);
    bag_field(&header, "fill", filler, length - header.count - 4 - 5);
    assert_int_equal(header.count, length);
    bag_ros1_record(&file, &header, &data);
    bag_put(&file, plain->data + first, plain->count - first);
    path = files_write("bag", file.data, file.count);
    bag_free(&file);
    free(filler);
    return path;
}

static void headers_of_up_to_a_mebibyte_are_read(void **state)
{
    bag_recording recording = make_recording(BAG_ROS1);
    bag_bytes bytes = bag_write_ros1(&recording, BAG_NONE);
    cairn_scan_log log;

    (void)state;
    assert_ok(load(&log, write_long_header(&bytes, 1048576), NULL));
    check_recording(&log);
    cairn_scan_log_free(&log);
    assert_status(load(&log, write_long_header(&bytes, 1048577), NULL), CAIRN_EMPTY);
    assert_int_equal(reported_count, 1);
    assert_non_null(
        strstr(reported[0].text, "a header of 1048577 bytes, expected at most 1048576"));
    bag_free(&bytes);
    bag_recording_free(&recording);
}

#ifdef CAIRN_HAVE_SQLITE
static void bad_messages_of_a_database_are_reported_with_their_row(void **state)
{
    bag_recording recording = {.encoding = BAG_CDR_LITTLE};
    int scans = bag_topic(&recording, "/scan", scan_type);
    bag_scan none = plain_scan(SECOND);
    bag_bytes bytes;
    cairn_scan_log log;

    (void)state;
    none.count = 0;
    record_scan(&recording, scans, SECOND, plain_scan(SECOND));
    record_scan(&recording, scans, SECOND, none);
    bytes = bag_write_sqlite(&recording, BAG_NONE);
    assert_ok(load(&log, files_write("bag", bytes.data, bytes.count), NULL));
    assert_int_equal(reported_count, 1);
    assert_non_null(strstr(reported[0].text, "message 2 at row 2: on /scan "));
    cairn_scan_log_free(&log);
    bag_free(&bytes);
    bag_recording_free(&recording);
}

/* A table of topics that cannot be read is reported before the messages, of which no topic is
 * known. */
static void damaged_topics_are_reported(void **state)
{
    bag_recording recording = make_recording(BAG_CDR_LITTLE);
    bag_bytes bytes = bag_write_sqlite(&recording, BAG_NONE);
    cairn_file_error error;
    cairn_scan_log log;

    (void)state;
    /* the kind of the second page, which is the root of the table that was created first */
    bytes.data[4096] = 0xff;
    assert_status(load(&log, files_write("bag", bytes.data, bytes.count), &error), CAIRN_EMPTY);
    assert_non_null(strstr(reported[0].text, "message 1 at row 0: "));
    assert_non_null(strstr(reported[0].text, ", expected a whole row: the file is cut or damaged"));
    bag_free(&bytes);
    bag_recording_free(&recording);
}
#endif

/* Fields of a header, name=value behind its length, that are longer than the header, empty, or
 * without a name. */
static void fields_that_do_not_fill_a_header(void **state)
{
    /* the first field of the first record, whose header has 30 bytes: op */
    static const struct {
        size_t at;
        uint8_t byte;
    } cases[] = {{13 + 4, 27}, {13 + 4, 0}, {13 + 5, 1}, {13 + 4 + 4 + 2, '-'}};

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bag_recording recording = make_recording(BAG_ROS1);
        bag_bytes bytes = bag_write_ros1(&recording, BAG_NONE);
        cairn_file_error error;
        cairn_scan_log log;

        bytes.data[cases[i].at] = cases[i].byte;
        assert_status(load(&log, files_write("bag", bytes.data, bytes.count), &error), CAIRN_EMPTY);
        assert_int_equal(reported_count, 1);
        assert_non_null(strstr(reported[0].text, "message 1 at byte 13: a header whose fields do "
                                                 "not fill it, expected name=value"));
        bag_free(&bytes);
        bag_recording_free(&recording);
    }
}

/* A connection whose type lies beyond its record is left out, the others are read. */
static void fields_that_do_not_fill_a_connection(void **state)
{
    bag_recording recording = make_recording(BAG_ROS1);
    bag_bytes bytes;
    cairn_scan_log log;
    size_t at = 0;

    (void)state;
    (void)bag_topic(&recording, "/late", scan_type);
    bytes = bag_write_ros1(&recording, BAG_NONE);
    for (size_t i = 0; i + 5 < bytes.count; i++)
        if (memcmp(bytes.data + i, "type=", 5) == 0)
            at = i;
    assert_true(at > 4);
    bytes.data[at - 4]++;
    assert_ok(load(&log, files_write("bag", bytes.data, bytes.count), NULL));
    check_ranges(&log.scans.record[0]);
    assert_int_equal(log.scans.count, 4);
    assert_int_equal(reported_count, 1);
    assert_non_null(strstr(reported[0].text, "a connection whose fields do not fill it, expected "
                                             "name=value"));
    cairn_scan_log_free(&log);
    bag_free(&bytes);
    bag_recording_free(&recording);
}

static void not_a_bag(void **state)
{
    static const struct {
        const char *bytes;
        size_t count;
        cairn_status status;
        const char *text;
    } cases[] = {
        {"#ROSBAG V1.2\n", 13, CAIRN_UNSUPPORTED, "another version, expected #ROSBAG V2.0"},
        {"SQLite format 3\0nothing", 23, CAIRN_BAD_FORMAT, "expected"},
        {"\x28\xb5\x2f\xfd nothing", 12, CAIRN_BAD_FORMAT, "zstd data of something else"}};
    cairn_file_error error;
    cairn_scan_log log;

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        if ((i == 1 && !is_built(SQLITE_FILE, BAG_NONE)) || (i == 2 && !bag_packs(BAG_ZSTD)))
            continue;
        assert_status(load(&log, files_write("bag", cases[i].bytes, cases[i].count), &error),
                      cases[i].status);
        assert_non_null(strstr(error.text, cases[i].text));
        assert_int_equal(error.line, 0); /* a bag has no lines */
    }
    assert_status(load(&log, files_path("missing"), &error), CAIRN_IO);
    assert_int_equal(error.line, 0);
}

/* ---- Decompression ---- */

static void bounds_of_decompression(void **state)
{
    bag_bytes plain = {NULL, 0, 0};

    (void)state;
    for (int i = 0; i < 200000; i++)
        bag_put(&plain, i % 3 == 0 ? "a" : "b", 1);
    for (int packing = BAG_LZ4; packing <= BAG_ZSTD; packing++) {
        cairn_packing kind =
            cairn_packing_find(bag_packing_name[packing], strlen(bag_packing_name[packing]));
        cairn_unpack_buffer buffer = {NULL, 0, 0};
        bag_bytes packed;

        assert_int_equal(kind, packing);
        assert_int_equal(cairn_packing_is_built(kind), bag_packs((bag_packing)packing));
        if (!bag_packs((bag_packing)packing))
            continue;
        packed = bag_pack((bag_packing)packing, &plain);
        assert_ok(cairn_unpack(kind, packed.data, packed.count, plain.count, &buffer));
        assert_int_equal(buffer.count, plain.count);
        assert_memory_equal(buffer.bytes, plain.data, plain.count);
        /* no more than allowed, nor memory for it */
        cairn_unpack_free(&buffer);
        assert_status(cairn_unpack(kind, packed.data, packed.count, 1000, &buffer), CAIRN_FULL);
        assert_int_equal(buffer.count, 1000);
        assert_true(buffer.capacity <= 1001);
        assert_status(cairn_unpack(kind, packed.data, packed.count, plain.count - 1, &buffer),
                      CAIRN_FULL);
        assert_status(cairn_unpack(kind, packed.data, packed.count - 1, plain.count, &buffer),
                      CAIRN_TRUNCATED);
        assert_status(cairn_unpack(kind, packed.data, 0, plain.count, &buffer), CAIRN_TRUNCATED);
        packed.data[0] ^= 0xff;
        assert_status(cairn_unpack(kind, packed.data, packed.count, plain.count, &buffer),
                      CAIRN_BAD_FORMAT);
        cairn_unpack_free(&buffer);
        bag_free(&packed);
    }
    assert_int_equal(cairn_packing_find("", 0), CAIRN_PACKING_NONE);
    assert_int_equal(cairn_packing_find("none", 4), CAIRN_PACKING_NONE);
    assert_int_equal(cairn_packing_find("rar", 3), CAIRN_PACKING_UNKNOWN);
    bag_free(&plain);
}

/* ---- Folders ---- */

static void write_folder(const char *name, const char *metadata)
{
    char file[256];

    (void)mkdir(files_path(name), 0700);
    if (metadata == NULL)
        return;
    (void)snprintf(file, sizeof file, "%s/metadata.yaml", name);
    (void)files_write_text(file, metadata);
}

static void split_bags(void **state)
{
    static const char *const metadata[2] = {
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n"
        "  relative_file_paths:\n    - b.mcap\n    - a.mcap\n",
        "rosbag2_bagfile_information:\n  version: 2\n"
        "  relative_file_paths: [split/b.mcap, split/a.mcap]\n"};
    cairn_scan_log log;
    bag_bytes bytes;

    (void)state;
    write_folder("split", metadata[0]);
    for (int k = 0; k < 2; k++) {
        bag_recording recording = {.encoding = BAG_CDR_LITTLE};
        int scans = bag_topic(&recording, "/scan", scan_type);

        /* the same time in both files: the order of the files counts */
        record_scan(&recording, scans, 9 * SECOND, plain_scan((2 - k) * SECOND));
        bytes = bag_write_mcap(&recording, BAG_NONE, 1);
        (void)files_write(k == 0 ? "split/a.mcap" : "split/b.mcap", bytes.data, bytes.count);
        bag_free(&bytes);
        bag_recording_free(&recording);
    }
    for (int i = 0; i < 2; i++) {
        write_folder("split", metadata[i]);
        assert_ok(load(&log, files_path("split"), NULL));
        assert_int_equal(log.scans.count, 2);
        assert_int_equal(log.scans.record[0].stamp_ns, SECOND);
        assert_int_equal(log.scans.record[1].stamp_ns, 2 * SECOND);
        cairn_scan_log_free(&log);
    }
}

static void bad_folders(void **state)
{
    static const struct {
        const char *metadata;
        cairn_status status;
        const char *text;
    } cases[] = {
        {NULL, CAIRN_BAD_FORMAT, "folder: a folder without metadata.yaml"},
        {"a: 1\nb: ]\n", CAIRN_BAD_FORMAT,
         "metadata.yaml:2: did not find expected node content, expected YAML"},
        {"a: 1\n", CAIRN_BAD_FORMAT, "no files, expected rosbag2_bagfile_information"},
        {"rosbag2_bagfile_information:\n  relative_file_paths: []\n", CAIRN_BAD_FORMAT, "no files"},
        {"rosbag2_bagfile_information:\n  relative_file_paths:\n    - ../bag\n", CAIRN_BAD_FORMAT,
         "metadata.yaml:3: the file '../bag', expected the name of one in the folder"},
        {"rosbag2_bagfile_information:\n  relative_file_paths: [/etc/passwd]\n", CAIRN_BAD_FORMAT,
         "expected the name of one in the folder"},
        {"rosbag2_bagfile_information:\n  relative_file_paths: [metadata.yaml]\n", CAIRN_BAD_FORMAT,
         "not a bag, expected .bag, .db3 or .mcap"},
        {"rosbag2_bagfile_information:\n  relative_file_paths: [missing.mcap]\n", CAIRN_IO,
         "folder/missing.mcap: cannot open"}};

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        cairn_file_error error;
        cairn_scan_log log;

        write_folder("folder", cases[i].metadata);
        assert_status(load(&log, files_path("folder"), &error), cases[i].status);
        assert_non_null(strstr(error.text, cases[i].text));
    }
}

/* A pipe in place of the list of files would block the reader: it is refused. */
static void piped_folder(void **state)
{
    cairn_file_error error;
    cairn_scan_log log;

    (void)state;
    assert_int_equal(mkdir(files_path("piped"), 0777), 0);
    assert_int_equal(mkfifo(files_path("piped/metadata.yaml"), 0666), 0);
    (void)alarm(60);
    assert_status(load(&log, files_path("piped"), &error), CAIRN_UNSUPPORTED);
    assert_non_null(strstr(error.text, "metadata.yaml: is a pipe or device"));
    (void)alarm(0);
}

/* ---- Other formats ---- */

static void formats_of_text(void **state)
{
    static const struct {
        const char *text;
        cairn_scan_log_kind kind;
        int32_t has_odometry;
        int64_t stamp_ns;
        double x;
    } cases[] = {
        {"# a log\nFLASER 2 1 2 0 0 0 3 0 0 4 h 4\n", CAIRN_SCAN_LOG_CARMEN, 1, 4 * SECOND, 3},
        {"time,-10,10\n5,1,2\n", CAIRN_SCAN_LOG_CSV, 0, 5 * SECOND, 0},
        {"\n {\"nrays\": 2, \"min_theta\": -1, \"max_theta\": 1, \"readings\": [1, 2], "
         "\"odometry\": [6, 0, 0], \"timestamp\": 7}\n",
         CAIRN_SCAN_LOG_CSM, 1, 7 * SECOND, 6}};

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const char *path = files_write_text("text", cases[i].text);
        cairn_scan_log_params params = reported_params();
        cairn_file_error error;
        cairn_scan_log log;

        assert_ok(load(&log, path, NULL));
        assert_int_equal(log.kind, cases[i].kind);
        assert_int_equal(log.has_odometry, cases[i].has_odometry);
        assert_string_equal(log.taken, "");
        assert_null(log.sources);
        assert_int_equal(log.scans.count, 1);
        assert_int_equal(log.scans.record[0].stamp_ns, cases[i].stamp_ns);
        assert_near(log.scans.record[0].robot.x, cases[i].x, 0);
        assert_near(log.scans.record[0].range[1], 2, 0);
        cairn_scan_log_free(&log);
        params.odometry_topic = "/odom";
        assert_status(cairn_scan_log_load(&log, path, &params, &error), CAIRN_BAD_ARGUMENT);
        assert_non_null(strstr(error.text, "no bag, expected one with the topic /odom"));
    }
}

/* Scans of CSM with bearings, without stamps, one of them without odometry. */
static void csm_scans(void **state)
{
    cairn_scan_log_params params = reported_params();
    cairn_scan_log log;

    (void)state;
    params.range_max = 5;
    assert_ok(cairn_scan_log_load(
        &log,
        files_write_text("csm", "{\"nrays\":2,\"theta\":[0.5,1],\"readings\":[1,null],"
                                "\"odometry\":[1,2,3]}\n"
                                "{\"nrays\":1,\"theta\":[2],\"readings\":[6]}"),
        &params, NULL));
    assert_int_equal(log.scans.count, 2);
    assert_int_equal(log.has_odometry, 0);
    assert_int_equal(log.scans.info.lines, 2);
    assert_int_equal(log.scans.info.beams, 3);
    assert_int_equal(log.scans.info.min_beams, 1);
    assert_int_equal(log.scans.info.max_beams, 2);
    assert_near(log.scans.info.range_max, 5, 0);
    assert_int_equal(log.scans.record[1].line, 2);
    assert_int_equal(log.scans.record[1].stamp_ns, SECOND / 10);
    assert_near(log.scans.record[0].scan.angle[1], 1, 0);
    assert_near(log.scans.record[1].scan.angle[0], 2, 0);
    assert_true(isnan(log.scans.record[0].range[1]));
    assert_true(isinf(log.scans.record[1].range[0]));
    cairn_scan_log_free(&log);
}

static void bad_arguments(void **state)
{
    cairn_scan_log_params params = cairn_scan_log_default();
    const char *path = files_write_text("text", "FLASER 1 1 0 0 0 0 0 0 1 h 1\n");
    cairn_scan_log log;

    (void)state;
    assert_near(params.range_sigma, 0.01, 0);
    params.range_max = (double)NAN;
    assert_status(cairn_scan_log_load(&log, path, &params, NULL), CAIRN_BAD_ARGUMENT);
    params = cairn_scan_log_default();
    params.range_sigma = -1;
    assert_status(cairn_scan_log_load(&log, path, &params, NULL), CAIRN_BAD_ARGUMENT);
    assert_ok(cairn_scan_log_load(&log, path, NULL, NULL));
    cairn_scan_log_free(&log);
    assert_status(cairn_scan_log_load(&log, "/dev/null", NULL, NULL), CAIRN_UNSUPPORTED);
}

/* ---- The examples of docs/formats.md ---- */

/* Writes the lines of the first example behind a heading: those that are indented by four. */
static const char *write_example(const char *docs, const char *heading)
{
    const char *at = strstr(docs, heading);
    char text[1024] = "";

    assert_non_null(at);
    at = strstr(at, "\n    ");
    assert_non_null(at);
    while (strncmp(at, "\n    ", 5) == 0) {
        const char *line_end = strchr(at + 1, '\n');

        assert_non_null(line_end);
        (void)snprintf(text + strlen(text), sizeof text - strlen(text), "%.*s\n",
                       (int)(line_end - at - 5), at + 5);
        at = line_end;
    }
    return files_write_text("example", text);
}

static void examples_of_the_docs(void **state)
{
    static const struct {
        const char *heading;
        cairn_scan_log_kind kind;
        int32_t scan_count;
    } cases[] = {{"## CARMEN logs", CAIRN_SCAN_LOG_CARMEN, 1},
                 {"## Tables of ranges", CAIRN_SCAN_LOG_CSV, 2},
                 {"## Scans of CSM", CAIRN_SCAN_LOG_CSM, 1}};
    char *docs = files_read("docs/formats.md", NULL);
    cairn_carmen_log_record record;
    cairn_scan_log_stream *stream;
    int32_t has_odometry;

    (void)state;
    if (docs == NULL) {
        printf("skipped: docs/formats.md is not in this folder\n");
        skip();
    }
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        cairn_scan_log log;

        assert_ok(load(&log, write_example(docs, cases[i].heading), NULL));
        assert_int_equal(reported_count, 0);
        assert_int_equal(log.kind, cases[i].kind);
        assert_int_equal(log.has_odometry, 1);
        assert_int_equal(log.scans.count, cases[i].scan_count);
        assert_int_equal(log.scans.record[0].count, 3);
        assert_near(log.scans.record[0].range[0], 2.5, 1e-6);
        assert_near(log.scans.record[0].range[2], 3.1, 1e-6);
        cairn_scan_log_free(&log);
    }
    assert_ok(cairn_scan_log_stream_open(&stream, open(write_example(docs, "## Streams"), O_RDONLY),
                                         "example", NULL, NULL));
    assert_ok(cairn_scan_log_stream_next(stream, &record, &has_odometry, NULL));
    assert_int_equal(has_odometry, 1);
    assert_int_equal(record.count, 3);
    assert_true(isnan(record.range[1]));
    cairn_scan_log_stream_close(stream);
    free(docs);
}

/* ---- Streams ---- */

static cairn_scan_log_stream *open_stream(const char *text, const cairn_scan_log_params *params)
{
    int file = open(files_write_text("stream", text), O_RDONLY);
    cairn_scan_log_stream *stream;

    assert_true(file >= 0);
    assert_ok(cairn_scan_log_stream_open(&stream, file, "stream", params, NULL));
    return stream;
}

static void streams_of_carmen(void **state)
{
    cairn_scan_log_params params = reported_params();
    cairn_scan_log_stream *stream =
        open_stream("# a log\nPARAM robot_frontlaser_max 20\nODOM 0 0 0 0 0 0 1 h 1\n"
                    "FLASER 3 1 25 nan 1.5 0 0 1 0 0 4 h 4\n"
                    "FLASER x\n"
                    "ROBOTLASER1 0 -0.5 1 0.5 30 0 0 3 1 25 31 0 2 0 0 2 1 0 0 0 0 0 0 5 h 5\n",
                    &params);
    cairn_carmen_log_record record;
    int32_t has_odometry;

    (void)state;
    assert_ok(cairn_scan_log_stream_next(stream, &record, &has_odometry, NULL));
    assert_int_equal(has_odometry, 1);
    assert_int_equal(record.line, 4);
    assert_int_equal(record.count, 3);
    assert_int_equal(record.stamp_ns, 4 * SECOND);
    assert_near(record.robot.x, 1, 0);
    assert_near(record.scan.base_sensor.x, 0.5, 1e-6);
    assert_near(record.scan.range_max, 20, 0);
    assert_near(record.scan.range_sigma, 0.01, 1e-8);
    assert_near(record.range[0], 1, 0);
    assert_true(isinf(record.range[1]) && isnan(record.range[2]));
    assert_ok(cairn_scan_log_stream_next(stream, &record, &has_odometry, NULL));
    assert_int_equal(record.line, 6);
    assert_near(record.scan.angle_min, -0.5, 0);
    assert_near(record.scan.angle_step, 0.5, 0);
    /* its own limit; the mounting stays that of the first scan */
    assert_near(record.scan.range_max, 30, 0);
    assert_near(record.range[1], 25, 0);
    assert_true(isinf(record.range[2]));
    assert_near(record.scan.base_sensor.x, 0.5, 1e-6);
    assert_near(record.scan.base_sensor.y, 0, 0);
    assert_status(cairn_scan_log_stream_next(stream, &record, &has_odometry, NULL), CAIRN_EMPTY);
    assert_int_equal(cairn_scan_log_stream_faults(stream), 1);
    assert_int_equal(reported_count, 1);
    assert_non_null(strstr(reported[0].text, "stream:5: "));
    cairn_scan_log_stream_close(stream);
}

/* A laser of half a metre of range, and none that is said. */
static void limits_of_range_that_a_log_says(void **state)
{
    static const char *const says[] = {"PARAM robot_frontlaser_max 0.5\n", ""};
    static const double limit[] = {0.5, 80};

    (void)state;
    for (int i = 0; i < 2; i++) {
        char text[128];
        cairn_scan_log_stream *stream;
        cairn_carmen_log_record record;
        int32_t has_odometry;

        (void)snprintf(text, sizeof text, "%sFLASER 2 0.25 1.5 0 0 0 0 0 0 4 h 4\n", says[i]);
        stream = open_stream(text, NULL);
        assert_ok(cairn_scan_log_stream_next(stream, &record, &has_odometry, NULL));
        assert_near(record.scan.range_max, limit[i], 1e-6);
        cairn_scan_log_stream_close(stream);
    }
}

static void streams_of_json(void **state)
{
    cairn_scan_log_stream *stream = open_stream(
        "\n{\"header\":{\"seq\":1,\"stamp\":{\"sec\":7,\"nanosec\":8},\"frame_id\":\"a\"},"
        "\"angle_min\":-1,\"angle_increment\":0.5,\"time_increment\":0.25,\"range_min\":0.125,"
        "\"range_max\":10,\"ranges\":[1,null,10,2],\"intensities\":[[]],\"sensor\":[1,2,0.5],"
        "\"odometry\":[3,4,7]}\n"
        "{\"stamp_ns\":1147713122541201007,\"angle_min\":0,\"angle_increment\":0,\"ranges\":[90]}"
        "\n",
        NULL);
    cairn_carmen_log_record record;
    int32_t has_odometry;

    (void)state;
    assert_ok(cairn_scan_log_stream_next(stream, &record, &has_odometry, NULL));
    assert_int_equal(has_odometry, 1);
    assert_int_equal(record.line, 2);
    assert_int_equal(record.count, 4);
    assert_int_equal(record.stamp_ns, 7 * SECOND + 8);
    assert_int_equal(record.scan.stamp_ns, 7 * SECOND + 8);
    assert_near(record.scan.angle_min, -1, 0);
    assert_near(record.scan.angle_step, 0.5, 0);
    assert_near(record.scan.time_step, 0.25, 0);
    assert_near(record.scan.range_min, 0.125, 0);
    assert_near(record.scan.range_max, 10, 0);
    assert_near(record.range[0], 1, 0);
    assert_true(isnan(record.range[1]) && isinf(record.range[2]));
    assert_near(record.range[3], 2, 0);
    assert_near(record.robot.y, 4, 0);
    assert_near(record.robot.theta, 7 - 2 * 3.141592653589793, 1e-6);
    assert_near(record.scan.base_sensor.y, 2, 0);
    assert_ok(cairn_scan_log_stream_next(stream, &record, &has_odometry, NULL));
    assert_int_equal(has_odometry, 0);
    assert_true(record.stamp_ns == INT64_C(1147713122541201007));
    assert_near(record.scan.range_max, 80, 0);
    assert_true(isinf(record.range[0]));
    assert_near(record.robot.x, 0, 0);
    assert_status(cairn_scan_log_stream_next(stream, &record, &has_odometry, NULL), CAIRN_EMPTY);
    cairn_scan_log_stream_close(stream);
}

/* Coordinates far from 0 are relative to the first pose, also in float. */
static void far_coordinates(void **state)
{
    static const char *const streams[] = {
        "FLASER 1 1 500000.75 5400000.5 0 500000.25 5400000.5 0 1 h 1\n"
        "FLASER 1 1 500002.125 5400001.5 0 500001.625 5400001.5 0 2 h 2\n",
        "{\"angle_min\":0,\"angle_increment\":1,\"ranges\":[1],\"odometry\":[500000.25,5400000.5,0]"
        ","
        "\"sensor\":[0.5,0,0]}\n"
        "{\"angle_min\":0,\"angle_increment\":1,\"ranges\":[1],\"odometry\":[500001.625,5400001.5,"
        "0],"
        "\"sensor\":[0.5,0,0]}\n"};
    bag_recording recording = {.encoding = BAG_ROS1};
    int scans = bag_topic(&recording, "/scan", scan_type);
    int odometry = bag_topic(&recording, "/odom", odometry_type);
    cairn_carmen_log_record record;
    double origin[2] = {1, 1};
    int32_t has_odometry;
    cairn_scan_log log;

    (void)state;
    for (int i = 0; i < 2; i++) {
        cairn_scan_log_stream *stream = open_stream(streams[i], NULL);

        assert_ok(cairn_scan_log_stream_next(stream, &record, &has_odometry, NULL));
        assert_near(record.robot.x, 0.25, 0);
        assert_near(record.laser.x, 0.75, 0);
        assert_near(record.scan.base_sensor.x, 0.5, 0);
        assert_ok(cairn_scan_log_stream_next(stream, &record, &has_odometry, NULL));
        assert_near(record.robot.x, 1.625, 0);
        assert_near(record.robot.y, 1.5, 0);
        cairn_scan_log_stream_origin(stream, origin);
        assert_near(origin[0], 500000, 0);
        assert_near(origin[1], 5400000, 0);
        cairn_scan_log_stream_close(stream);
    }
    record_odometry(&recording, odometry, SECOND, 500000.25, 5400000.5, 0);
    record_odometry(&recording, odometry, 2 * SECOND, 500001.625, 5400001.5, 0);
    record_scan(&recording, scans, SECOND, plain_scan(SECOND));
    record_scan(&recording, scans, 2 * SECOND, plain_scan(2 * SECOND));
    assert_ok(load_recording(&log, &recording, NULL, NULL));
    assert_near(log.scans.info.origin[0], 500000, 0);
    assert_near(log.scans.info.origin[1], 5400000, 0);
    assert_near(log.scans.record[0].robot.x, 0.25, 0);
    assert_near(log.scans.record[1].robot.x, 1.625, 0);
    assert_near(log.scans.record[1].laser.y, 1.5, 0);
    cairn_scan_log_free(&log);
    assert_ok(cairn_scan_log_load(
        &log,
        files_write_text("far.csm", "{\"nrays\":1,\"theta\":[0],\"readings\":[1],\"valid\":[1],"
                                    "\"min_theta\":-1,\"max_theta\":1,"
                                    "\"odometry\":[500000.25,5400000.5,0]}\n"),
        NULL, NULL));
    assert_near(log.scans.info.origin[0], 500000, 0);
    assert_near(log.scans.record[0].robot.x, 0.25, 0);
    assert_near(log.scans.record[0].robot.y, 0.5, 0);
    cairn_scan_log_free(&log);
}

/* A stamp of ROS 1 may lie beyond what a scan may have. */
static void late_stamps(void **state)
{
    cairn_scan_log_params params = reported_params();
    bag_recording recording = {.encoding = BAG_ROS1};
    int scans = bag_topic(&recording, "/scan", scan_type);
    cairn_scan_log log;

    (void)state;
    record_scan(&recording, scans, SECOND, plain_scan(4000000000 * SECOND));
    record_scan(&recording, scans, SECOND, plain_scan(4000000001 * SECOND));
    assert_ok(load_recording(&log, &recording, &params, NULL));
    assert_int_equal(log.scans.count, 1);
    assert_int_equal(reported_count, 1);
    assert_non_null(strstr(reported[0].text, "a stamp beyond 4e9 s"));
    cairn_scan_log_free(&log);
}

static void bad_json(void **state)
{
    static const struct {
        const char *line, *text;
    } cases[] = {
        {"{\"ranges\":[1]}", "a scan without bearings"},
        {"{\"angle_min\":0,\"angle_increment\":1}", "a scan without ranges"},
        {"{\"angle_min\":0,\"angle_increment\":1,\"ranges\":[]}", "a scan without ranges"},
        {"{\"angle_min\":1e10}", "no number up to 1e9"},
        {"{\"angle_min\":\"a\"}", "no number up to 1e9"},
        {"{\"ranges\":1}", "ranges is not a list"},
        {"{\"ranges\":[true]}", "ranges holds something else"},
        {"{\"odometry\":1}", "a pose is not a list"},
        {"{\"odometry\":[1,2]}", "no number up to 1e9"},
        {"{\"odometry\":[1,2,3,4]}", "a pose of more than three numbers"},
        {"{\"stamp_ns\":1.5}", "no whole number"},
        {"{\"stamp_ns\":4000000000000000001}", "a stamp beyond 4e9 s"},
        {"{\"stamp_ns\":-4000000000000000001}", "a stamp beyond 4e9 s"},
        {"{\"header\":{\"stamp\":{\"sec\":2147483647,\"sec\":2147483647}}}",
         "a stamp beyond 4e9 s"},
        {"{\"header\":1}", "not an object"},
        {"{\"header\":{\"stamp\":{\"sec\":-1}}}", "below 0"},
        {"{\"angle_min\":0,\"angle_increment\":1,\"ranges\":[1]} 2", "more than one value"},
        {"{\"ranges\":[1", "stream:2: "},
        {"[]", "not an object, expected { and the fields of a LaserScan"}};
    cairn_carmen_log_record record;
    int32_t has_odometry;

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        static const char good[] = "{\"angle_min\":0,\"angle_increment\":1,\"ranges\":[1]}\n";
        cairn_scan_log_params params = reported_params();
        cairn_scan_log_stream *stream;
        char text[512];

        (void)snprintf(text, sizeof text, "%s%s\n%s", good, cases[i].line, good);
        stream = open_stream(text, &params);
        assert_ok(cairn_scan_log_stream_next(stream, &record, &has_odometry, NULL));
        assert_ok(cairn_scan_log_stream_next(stream, &record, &has_odometry, NULL));
        assert_int_equal(record.line, 3);
        assert_int_equal(reported_count, 1);
        assert_non_null(strstr(reported[0].text, "stream:2: "));
        if (strstr(reported[0].text, cases[i].text) == NULL)
            fail_msg("\"%s\" does not hold \"%s\"", reported[0].text, cases[i].text);
        cairn_scan_log_stream_close(stream);
    }
}

/* Nothing is lost over many rounds. */
static void frees_all(void **state)
{
    bag_recording recording = make_recording(BAG_ROS1);
    const char *path = write_bag(&recording, ROS1_FILE, BAG_NONE);
    size_t before = 0;

    (void)state;
    for (int i = 0; i < FILES_HEAP_ROUNDS + 2; i++) {
        cairn_scan_log log;

        if (i == 2)
            before = files_heap();
        assert_ok(load(&log, path, NULL));
        cairn_scan_log_free(&log);
    }
    assert_true(files_heap() <= before + FILES_HEAP_NOISE);
    bag_recording_free(&recording);
}

/* ---- The reference reader ---- */

static char program[512];

/* tests/compare_bags.py writes bags by the PyPI package rosbags and compares what both read.
 * PYTHON: an interpreter that has it. */
static void same_as_rosbags(void **state)
{
    const char *python = getenv("PYTHON") != NULL ? getenv("PYTHON") : "python3";
    char command[1600];

    (void)state;
    (void)snprintf(command, sizeof command,
                   "test -f tests/compare_bags.py && %s -c 'import rosbags' >/dev/null 2>&1",
                   python);
    if (system(command) != 0) {
        printf("skipped: %s has no package rosbags, or this is not the folder of the sources\n",
               python);
        skip();
    }
    (void)mkdir(files_path("rosbags"), 0700);
    (void)snprintf(command, sizeof command, "%s tests/compare_bags.py '%s' '%s'", python, program,
                   files_path("rosbags"));
    assert_int_equal(system(command), 0);
}

/* Prints a line for each scan: stamp and the bits of the ranges; then the mounting. */
static int print_scans(const char *path)
{
    cairn_file_error error;
    cairn_scan_log log;

    if (cairn_scan_log_load(&log, path, NULL, &error) != CAIRN_OK) {
        fprintf(stderr, "%s\n", error.text);
        return 2;
    }
    for (int32_t i = 0; i < log.scans.count; i++) {
        const cairn_carmen_log_record *record = &log.scans.record[i];

        printf("%" PRId64 " %.9g %.9g %.6f %.6f", record->stamp_ns, (double)record->scan.angle_min,
               (double)record->scan.angle_step, (double)record->robot.x,
               (double)record->scan.base_sensor.x);
        for (int32_t k = 0; k < record->count; k++) {
            uint32_t bits;

            memcpy(&bits, &record->range[k], sizeof bits);
            printf(" %08" PRIx32, isnan(record->range[k]) ? 0x7fc00000 : bits);
        }
        printf("\n");
    }
    cairn_scan_log_free(&log);
    return 0;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_containers),
        cmocka_unit_test(whole_files),
        cmocka_unit_test(order_of_recording),
        cmocka_unit_test(order_of_odometry),
        cmocka_unit_test(latched_transform),
        cmocka_unit_test(upside_down),
        cmocka_unit_test(odometry_of_transforms),
        cmocka_unit_test(tree_of_frames),
        cmocka_unit_test(mountings_that_move_or_tilt),
        cmocka_unit_test(topics_are_named),
        cmocka_unit_test(no_transforms),
        cmocka_unit_test(no_scans),
        cmocka_unit_test(first_echoes),
        cmocka_unit_test(encapsulations),
        cmocka_unit_test(bad_messages),
        cmocka_unit_test(range_limits),
        cmocka_unit_test(giant_lengths),
        cmocka_unit_test(cuts),
        cmocka_unit_test(cut_is_reported),
        cmocka_unit_test(cut_of_a_chunk_is_reported),
        cmocka_unit_test(damaged_bytes),
        cmocka_unit_test(checksums),
        cmocka_unit_test(giant_records),
        cmocka_unit_test(headers_of_up_to_a_mebibyte_are_read),
#ifdef CAIRN_HAVE_SQLITE
        cmocka_unit_test(bad_messages_of_a_database_are_reported_with_their_row),
        cmocka_unit_test(damaged_topics_are_reported),
#endif
        cmocka_unit_test(fields_that_do_not_fill_a_header),
        cmocka_unit_test(fields_that_do_not_fill_a_connection),
        cmocka_unit_test(not_a_bag),
        cmocka_unit_test(bounds_of_decompression),
        cmocka_unit_test(split_bags),
        cmocka_unit_test(bad_folders),
        cmocka_unit_test(piped_folder),
        cmocka_unit_test(formats_of_text),
        cmocka_unit_test(csm_scans),
        cmocka_unit_test(bad_arguments),
        cmocka_unit_test(examples_of_the_docs),
        cmocka_unit_test(streams_of_carmen),
        cmocka_unit_test(limits_of_range_that_a_log_says),
        cmocka_unit_test(streams_of_json),
        cmocka_unit_test(far_coordinates),
        cmocka_unit_test(late_stamps),
        cmocka_unit_test(bad_json),
        cmocka_unit_test(frees_all),
        cmocka_unit_test(same_as_rosbags),
    };

    if (argc == 3 && strcmp(argv[1], "--print") == 0)
        return print_scans(argv[2]);
    (void)snprintf(program, sizeof program, "%s", argv[0]);
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
