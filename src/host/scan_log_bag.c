/* Scans of a bag.
 *
 * Method
 * 1. One pass over the messages decodes the scans of the topic that is named, or of the first one,
 *    the odometry likewise, and the transforms. Topics are counted.
 * 2. Several topics of scans, or of odometry, of which none is named, are listed and refused.
 * 3. Scans are sorted by the time of their recording, odometry by its stamps.
 * 4. The mounting is found in the tree of frames, and each scan gets its odometry.
 *
 * Layout: all ranges are in one array; records get pointers into it at the end, because it moves
 * when it grows.
 *
 * Limits: 100,000 ranges a scan; one sensor frame a topic, that of its first scan. */
#include "src/core/build.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/c_locale.h"
#include "src/host/carmen_log_summary.h"
#include "src/host/scan_log_work.h"

/* Maximum range of a scan whose message has none, m. */
static const double DEFAULT_RANGE_MAX = 80;
/* Largest accepted magnitude of bearings, rad. */
static const double MAX_BEARING = 1e9;
/* A tilt of the scan's plane that is mentioned, rad. */
static const double MENTIONED_TILT = 0.1;
static const double DEGREES = 180 / 3.14159265358979323846;

/* The content of a topic. */
enum { OTHER, SCAN, MULTI_ECHO_SCAN, ODOMETRY, TRANSFORMS };

typedef struct bag_topic {
    char *name, *type;
    int32_t kind;
    int64_t count; /* messages */
} bag_topic;

/* A scan before the sorting. */
typedef struct bag_scan {
    cairn_carmen_log_record record;
    int64_t time_ns, order; /* of its recording */
    size_t first;           /* index of its first range */
} bag_scan;

/* State of the reader. */
typedef struct bag_loader {
    const char *path;
    const cairn_scan_log_params *params;
    cairn_file_error *error;
    bag_topic *topic; /* [topic_count] of [topic_capacity] */
    int32_t topic_count, topic_capacity;
    int32_t scan_topic, odometry_topic; /* taken; -1: none */
    bag_scan *scan;                     /* [scan_count] of [scan_capacity] */
    int32_t scan_count, scan_capacity;
    float *range; /* [range_count] of [range_capacity] */
    size_t range_count, range_capacity;
    cairn_scan_log_frames frames;
    cairn_scan_log_track odometry;
    char *sensor, *base; /* frames of the first scan and the first odometry; NULL: none */
    int64_t messages, faults;
} bag_loader;

static cairn_status no_memory(const bag_loader *loader)
{
    return cairn_file_error_system(loader->error, loader->path, "read", ENOMEM);
}

/* ---- Faults ---- */

static void on_fault(void *context, const cairn_file_error *fault)
{
    bag_loader *loader = context;

    loader->faults++;
    if (loader->params->on_fault != NULL)
        loader->params->on_fault(loader->params->context, fault);
}

/* Reports a message that is left out. */
static void report(bag_loader *loader, const cairn_bag_message *message, cairn_status status,
                   const char *what)
{
    cairn_file_error fault;

    (void)cairn_file_error_set(
        &fault, status, message->path, 0, "message %" PRId64 " at %s %" PRIu64 ": on %s (%s), %s",
        message->number, message->unit, message->offset, message->topic, message->type, what);
    on_fault(loader, &fault);
}

/* Reports a message that cannot be decoded. */
static void report_decoding(bag_loader *loader, const cairn_bag_message *message,
                            const cairn_ros_reader *reader, cairn_status status)
{
    char what[160];

    if (status == CAIRN_TRUNCATED)
        (void)snprintf(what, sizeof what, "%zu bytes that end within %s, expected all of it",
                       message->count, reader->missing);
    else if (status == CAIRN_UNSUPPORTED)
        (void)snprintf(what, sizeof what, "an encapsulation of another kind, expected plain CDR");
    else
        (void)snprintf(what, sizeof what,
                       "a pose without direction or beyond 1e9 m, expected finite numbers");
    report(loader, message, status, what);
}

/* ---- Topics ---- */

/* Returns the content of a topic by its type: "package/Name" or "package/msg/Name". */
static int32_t kind_of(const char *type)
{
    static const struct {
        const char *package, *name;
        int32_t kind;
    } kinds[] = {{"sensor_msgs/", "LaserScan", SCAN},
                 {"sensor_msgs/", "MultiEchoLaserScan", MULTI_ECHO_SCAN},
                 {"nav_msgs/", "Odometry", ODOMETRY},
                 {"tf2_msgs/", "TFMessage", TRANSFORMS},
                 {"tf/", "tfMessage", TRANSFORMS}};

    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        size_t length = strlen(kinds[i].package);
        const char *name = type + length;

        if (strncmp(type, kinds[i].package, length) != 0)
            continue;
        if (strncmp(name, "msg/", 4) == 0)
            name += 4;
        if (strcmp(name, kinds[i].name) == 0)
            return kinds[i].kind;
    }
    return OTHER;
}

/* Returns 1 when a name on the command line is that of a topic; the slash before it may lack. */
static int is_topic(const char *asked, const char *name)
{
    return strcmp(asked + (asked[0] == '/'), name + (name[0] == '/')) == 0;
}

/* Finds or appends the topic of a message; -1: out of memory; too many: OTHER is counted as the
 * first one. */
static int32_t topic_of(bag_loader *loader, const cairn_bag_message *message)
{
    bag_topic *grown;

    for (int32_t i = 0; i < loader->topic_count; i++)
        if (strcmp(loader->topic[i].name, message->topic) == 0 &&
            strcmp(loader->topic[i].type, message->type) == 0)
            return i;
    if (loader->topic_count == loader->topic_capacity) {
        int32_t capacity = 2 * loader->topic_capacity + 16;

        grown = realloc(loader->topic, (size_t)capacity * sizeof *grown);
        if (grown == NULL)
            return -1;
        loader->topic = grown;
        loader->topic_capacity = capacity;
    }
    grown = &loader->topic[loader->topic_count];
    grown->name = strdup(message->topic);
    grown->type = strdup(message->type);
    grown->kind = kind_of(message->type);
    grown->count = 0;
    loader->topic_count++;
    return grown->name != NULL && grown->type != NULL ? loader->topic_count - 1 : -1;
}

/* Returns 1 when the messages of a topic are taken: it is the one that is named, or the first of
 * its kind. *taken: the topic that is taken. */
static int takes(const bag_loader *loader, int32_t topic, const char *asked, int32_t *taken)
{
    if (*taken < 0 && (asked == NULL || is_topic(asked, loader->topic[topic].name)))
        *taken = topic;
    return *taken == topic;
}

/* ---- Messages ---- */

/* Makes space for a scan; 0 when out of memory. */
static int reserve_scan(bag_loader *loader, size_t ranges)
{
    if (loader->scan_count == loader->scan_capacity) {
        int32_t capacity = loader->scan_capacity > 0 ? 2 * loader->scan_capacity : 256;
        bag_scan *grown = loader->scan_capacity <= INT32_MAX / 2
                              ? realloc(loader->scan, (size_t)capacity * sizeof *grown)
                              : NULL;

        if (grown == NULL)
            return 0;
        loader->scan = grown;
        loader->scan_capacity = capacity;
    }
    if (loader->range_capacity - loader->range_count < ranges) {
        size_t capacity = 2 * (loader->range_count + ranges);
        float *grown = realloc(loader->range, capacity * sizeof *grown);

        if (grown == NULL)
            return 0;
        loader->range = grown;
        loader->range_capacity = capacity;
    }
    return 1;
}

/* Returns the range from which on there is no return, m. */
static double limit_of(const bag_loader *loader, const cairn_ros_scan *scan)
{
    if (loader->params->range_max > 0)
        return loader->params->range_max;
    return scan->range_max > 0 && scan->range_max <= (float)CAIRN_SCAN_EXTENT
               ? (double)scan->range_max
               : DEFAULT_RANGE_MAX;
}

/* Returns what is wrong with a scan; NULL: nothing. */
static const char *check_scan(const bag_loader *loader, const cairn_ros_scan *scan)
{
    if (scan->count < 1 || scan->count > CAIRN_CARMEN_LOG_MAX_BEAMS)
        return "a scan without ranges or with more than 100000, expected 1 to 100000";
    if (!(fabsf(scan->angle_min) <= (float)MAX_BEARING) ||
        !(fabsf(scan->angle_step) <= (float)MAX_BEARING))
        return "bearings that are not finite, expected angle_min and angle_increment in rad";
    if ((double)scan->range_min >= limit_of(loader, scan))
        return "range_min at or above range_max, expected it below";
    return NULL;
}

/* Converts a scan and its ranges, which are decoded, to a record. */
static void append_scan(bag_loader *loader, const cairn_bag_message *message,
                        const cairn_ros_scan *scan)
{
    bag_scan *appended = &loader->scan[loader->scan_count++];
    cairn_carmen_log_record *record = &appended->record;
    float *range = loader->range + loader->range_count;
    double limit = limit_of(loader, scan);

    memset(appended, 0, sizeof *appended);
    appended->time_ns = message->time_ns;
    appended->order = loader->messages;
    appended->first = loader->range_count;
    loader->range_count += (size_t)scan->count;
    for (int32_t i = 0; i < scan->count; i++)
        range[i] = (double)range[i] >= limit ? INFINITY : range[i] < -FLT_MAX ? NAN : range[i];
    record->kind = CAIRN_CARMEN_LOG_SCAN;
    record->count = record->scan.count = scan->count;
    record->line = message->number;
    record->stamp_ns = record->scan.stamp_ns = scan->header.stamp_ns;
    record->scan.angle_min = scan->angle_min;
    record->scan.angle_step = scan->angle_step;
    record->scan.range_min = scan->range_min > 0 ? scan->range_min : 0;
    record->scan.range_max = (float)limit;
    record->scan.range_sigma = (float)loader->params->range_sigma;
    record->scan.time_step =
        scan->time_step > 0 && scan->time_step <= FLT_MAX ? scan->time_step : 0;
}

/* Reads a scan; a faulty one is reported. */
static cairn_status read_scan(bag_loader *loader, const cairn_bag_message *message, int first_echo)
{
    cairn_ros_reader reader;
    cairn_ros_scan scan;
    cairn_status status =
        cairn_ros_begin(&reader, message->encoding, message->bytes, message->count);
    const char *what = NULL;

    if (status == CAIRN_OK)
        status = cairn_ros_read_scan(&reader, &scan);
    if (status == CAIRN_OK)
        what = check_scan(loader, &scan);
    if (status == CAIRN_OK && what == NULL) {
        if (!reserve_scan(loader, (size_t)scan.count))
            return no_memory(loader);
        status = cairn_ros_read_ranges(&reader, first_echo, loader->range + loader->range_count,
                                       scan.count);
    }
    if (status != CAIRN_OK) {
        report_decoding(loader, message, &reader, status);
    } else if (what != NULL) {
        report(loader, message, CAIRN_BAD_FORMAT, what);
    } else {
        if (loader->sensor == NULL)
            loader->sensor = cairn_scan_log_copy_frame(scan.header.frame);
        if (loader->sensor == NULL)
            return no_memory(loader);
        append_scan(loader, message, &scan);
    }
    return CAIRN_OK;
}

static cairn_status read_odometry(bag_loader *loader, const cairn_bag_message *message)
{
    cairn_ros_reader reader;
    cairn_ros_stamped odometry;
    cairn_status status =
        cairn_ros_begin(&reader, message->encoding, message->bytes, message->count);

    if (status == CAIRN_OK)
        status = cairn_ros_read_stamped(&reader, &odometry);
    if (status != CAIRN_OK) {
        report_decoding(loader, message, &reader, status);
        return CAIRN_OK;
    }
    if (loader->base == NULL)
        loader->base = cairn_scan_log_copy_frame(odometry.child);
    if (loader->base == NULL)
        return no_memory(loader);
    status =
        cairn_scan_log_track_add(&loader->odometry, odometry.header.stamp_ns, &odometry.transform);
    return status == CAIRN_OK ? CAIRN_OK : no_memory(loader);
}

static cairn_status read_transforms(bag_loader *loader, const cairn_bag_message *message)
{
    cairn_ros_reader reader;
    uint32_t count = 0;
    cairn_status status =
        cairn_ros_begin(&reader, message->encoding, message->bytes, message->count);

    if (status == CAIRN_OK)
        status = cairn_ros_read_count(&reader, &count);
    for (uint32_t i = 0; i < count && reader.missing == NULL; i++) {
        cairn_ros_stamped transform;

        status = cairn_ros_read_stamped(&reader, &transform);
        if (status == CAIRN_NOT_FINITE)
            report_decoding(loader, message, &reader, status);
        if (status == CAIRN_OK)
            status = cairn_scan_log_frames_add(&loader->frames, message->topic, &transform);
        if (status == CAIRN_NO_MEMORY)
            return no_memory(loader);
        if (status == CAIRN_FULL)
            return cairn_file_error_set(loader->error, status, loader->path, 0,
                                        "more than %d links between frames, expected at most that",
                                        CAIRN_BAG_MAX_TOPICS);
    }
    if (status == CAIRN_TRUNCATED || status == CAIRN_UNSUPPORTED)
        report_decoding(loader, message, &reader, status);
    return CAIRN_OK;
}

static cairn_status on_message(void *context, const cairn_bag_message *message)
{
    bag_loader *loader = context;
    int32_t topic = topic_of(loader, message);

    if (topic < 0)
        return no_memory(loader);
    loader->messages++;
    loader->topic[topic].count++;
    switch (loader->topic[topic].kind) {
    case SCAN:
    case MULTI_ECHO_SCAN:
        return takes(loader, topic, loader->params->scan_topic, &loader->scan_topic)
                   ? read_scan(loader, message, loader->topic[topic].kind == MULTI_ECHO_SCAN)
                   : CAIRN_OK;
    case ODOMETRY:
        return takes(loader, topic, loader->params->odometry_topic, &loader->odometry_topic)
                   ? read_odometry(loader, message)
                   : CAIRN_OK;
    case TRANSFORMS:
        return read_transforms(loader, message);
    default:
        return CAIRN_OK;
    }
}

/* ---- The choice of topics ---- */

/* Returns the number of topics of a kind (that of multi-echo scans is the same as of scans), and
 * lists them; kind -1: all topics. */
static int32_t list_topics(const bag_loader *loader, int32_t kind, char *text, size_t size)
{
    int32_t listed = 0;
    size_t used = 0;

    text[0] = 0;
    for (int32_t i = 0; i < loader->topic_count; i++) {
        const bag_topic *topic = &loader->topic[i];

        if (kind >= 0 && topic->kind != kind && !(kind == SCAN && topic->kind == MULTI_ECHO_SCAN))
            continue;
        if (used < size)
            used +=
                (size_t)snprintf(text + used, size - used, "%s%s (%s, %" PRId64 ")",
                                 listed > 0 ? ", " : "", topic->name, topic->type, topic->count);
        listed++;
    }
    return listed;
}

/* Checks that one topic of a kind was named or is the only one. */
static cairn_status check_choice(const bag_loader *loader, int32_t kind, const char *what,
                                 const char *option, const char *asked, int32_t taken)
{
    char list[400];
    int32_t count = list_topics(loader, kind, list, sizeof list);

    if (asked == NULL && count > 1)
        return cairn_file_error_set(loader->error, CAIRN_BAD_ARGUMENT, loader->path, 0,
                                    "%d topics of %s, expected one named by %s: %s", count, what,
                                    option, list);
    if (asked != NULL && taken < 0)
        return cairn_file_error_set(loader->error, CAIRN_BAD_ARGUMENT, loader->path, 0,
                                    "no topic %s of %s, expected one of: %s", asked, what,
                                    count > 0 ? list : "none, there is no such topic");
    return CAIRN_OK;
}

/* Returns 1 when the transforms are asked for as odometry. */
static int asks_transforms(const bag_loader *loader)
{
    const char *asked = loader->params->odometry_topic;

    return asked != NULL && is_topic(asked, "/tf");
}

static cairn_status check_topics(const bag_loader *loader)
{
    char list[400];
    cairn_status status;

    (void)list_topics(loader, -1, list, sizeof list);
    if (list_topics(loader, SCAN, list, sizeof list) == 0) {
        (void)list_topics(loader, -1, list, sizeof list);
        return cairn_file_error_set(loader->error, CAIRN_EMPTY, loader->path, 0,
                                    "no scan in %" PRId64
                                    " messages, expected sensor_msgs/LaserScan on one of: %s",
                                    loader->messages, list[0] != 0 ? list : "no topic");
    }
    status = check_choice(loader, SCAN, "scans", "--scan", loader->params->scan_topic,
                          loader->scan_topic);
    if (status == CAIRN_OK && !asks_transforms(loader))
        status = check_choice(loader, ODOMETRY, "odometry", "--odom",
                              loader->params->odometry_topic, loader->odometry_topic);
    if (status == CAIRN_OK && loader->scan_count == 0)
        status = cairn_file_error_set(loader->error, CAIRN_EMPTY, loader->path, 0,
                                      "no whole scan on %s (%" PRId64
                                      " damaged messages), expected at least one",
                                      loader->topic[loader->scan_topic].name, loader->faults);
    return status;
}

/* ---- The log ---- */

static int by_recording(const void *first, const void *second)
{
    const bag_scan *a = first, *b = second;

    if (a->time_ns != b->time_ns)
        return a->time_ns < b->time_ns ? -1 : 1;
    return a->order < b->order ? -1 : a->order > b->order;
}

/* What the scans are placed by. */
typedef struct bag_placing {
    const cairn_scan_log_track *odometry; /* NULL: none */
    const cairn_scan_log_link *link;      /* of the odometry; NULL: a topic */
    const char *base;                     /* NULL: unknown */
    cairn_scan_log_mounting mounting;
    int32_t is_mounted; /* 0: no links lead to the sensor, it is taken to be at the base */
} bag_placing;

/* Chooses odometry and mounting. */
static bag_placing choose_placing(bag_loader *loader)
{
    bag_placing placing = {.odometry = NULL};
    cairn_scan_log_link *link = cairn_scan_log_frames_odometry(&loader->frames, loader->sensor);

    if (loader->odometry.count > 0) {
        cairn_scan_log_track_sort(&loader->odometry);
        placing.odometry = &loader->odometry;
        placing.base = loader->base[0] != 0 ? loader->base : link != NULL ? link->child : NULL;
    } else if (link != NULL) {
        cairn_scan_log_track_sort(&link->track);
        placing.odometry = &link->track;
        placing.link = link;
        placing.base = link->child;
    }
    /* without odometry the usual name of the robot's frame */
    if (placing.base == NULL)
        placing.base = "base_link";
    placing.is_mounted = cairn_scan_log_frames_mounting(&loader->frames, placing.base,
                                                        loader->sensor, &placing.mounting);
    if (!placing.is_mounted)
        placing.mounting.pose = cairn_pose_identity();
    return placing;
}

/* Returns a number, or 0 when it would print as -0. */
static double without_negative_zero(double value, double smallest)
{
    return fabs(value) < smallest ? 0 : value;
}

/* Writes what was taken. */
static void describe(const bag_loader *loader, const bag_placing *placing, char *text, size_t size)
{
    const cairn_scan_log_mounting *mounting = &placing->mounting;
    cairn_c_locale scope = cairn_c_locale_enter();
    char odometry[160], sensor[240];

    if (placing->odometry == NULL)
        (void)snprintf(odometry, sizeof odometry, "no odometry");
    else if (placing->link != NULL)
        (void)snprintf(odometry, sizeof odometry, "odometry %s to %s from %s",
                       placing->link->parent, placing->link->child, placing->link->topic);
    else
        (void)snprintf(odometry, sizeof odometry, "odometry %s",
                       loader->topic[loader->odometry_topic].name);
    if (!placing->is_mounted)
        (void)snprintf(sensor, sizeof sensor,
                       "sensor taken to be at the robot's origin: no transform from %s to %s",
                       placing->base, loader->sensor);
    else
        (void)snprintf(sensor, sizeof sensor, "sensor %sat %.2f %.2f %.1f\302\260%s%s",
                       mounting->upside_down ? "upside down " : "",
                       without_negative_zero((double)mounting->pose.x, 0.005),
                       without_negative_zero((double)mounting->pose.y, 0.005),
                       without_negative_zero((double)mounting->pose.theta * DEGREES, 0.05),
                       mounting->topic != NULL ? " from " : ", the robot's frame",
                       mounting->topic != NULL ? mounting->topic : "");
    (void)snprintf(text, size, "scan %s (%" PRId32 "), %s, %s",
                   loader->topic[loader->scan_topic].name, loader->scan_count, odometry, sensor);
    cairn_c_locale_leave(scope);
}

/* Reports a mounting that is not what a scan in the plane needs. */
static void report_mounting(bag_loader *loader, const bag_placing *placing)
{
    const cairn_scan_log_link *moving = placing->mounting.moving;
    cairn_file_error fault;

    if (placing->is_mounted && moving != NULL) {
        (void)cairn_file_error_set(
            &fault, CAIRN_BAD_FORMAT, loader->path, 0,
            "the transform from %s to %s moves, expected a fixed sensor: its "
            "first value is taken",
            moving->parent, moving->child);
        on_fault(loader, &fault);
    }
    if (placing->is_mounted && placing->mounting.tilt > MENTIONED_TILT) {
        (void)cairn_file_error_set(
            &fault, CAIRN_BAD_FORMAT, loader->path, 0,
            "the sensor is tilted by %.1f degrees, expected a level one: its "
            "ranges are taken as level",
            placing->mounting.tilt * DEGREES);
        on_fault(loader, &fault);
    }
}

/* Completes a record by its odometry, mounting and ranges. */
static void complete_record(const bag_loader *loader, const bag_placing *placing,
                            const bag_scan *scan, cairn_carmen_log_record *record)
{
    *record = scan->record;
    record->range = record->scan.range = loader->range + scan->first;
    record->scan.base_sensor = placing->mounting.pose;
    if (placing->mounting.upside_down) {
        record->scan.angle_min = -record->scan.angle_min;
        record->scan.angle_step = -record->scan.angle_step;
    }
    record->robot = placing->odometry != NULL
                        ? cairn_scan_log_track_at(placing->odometry, record->stamp_ns)
                        : cairn_pose_identity();
    record->laser = cairn_pose_compose(record->robot, placing->mounting.pose);
}

/* Moves what was read to the log. */
static cairn_status finish(bag_loader *loader, cairn_scan_log *log)
{
    cairn_carmen_log_summary *info = &log->scans.info;
    bag_placing placing = choose_placing(loader);

    qsort(loader->scan, (size_t)loader->scan_count, sizeof *loader->scan, by_recording);
    log->scans.record = calloc((size_t)loader->scan_count, sizeof *log->scans.record);
    if (log->scans.record == NULL)
        return no_memory(loader);
    for (int32_t i = 0; i < loader->scan_count; i++)
        complete_record(loader, &placing, &loader->scan[i], &log->scans.record[i]);
    log->scans.count = loader->scan_count;
    log->scans.range = loader->range;
    loader->range = NULL;
    log->has_odometry = placing.odometry != NULL;
    report_mounting(loader, &placing);
    cairn_carmen_log_summarize(&log->scans);
    info->lines = loader->messages;
    info->odometry = placing.odometry != NULL ? placing.odometry->count : 0;
    info->ignored = loader->messages - info->scans - loader->odometry.count;
    info->faults = loader->faults;
    info->range_max = loader->params->range_max > 0 ? loader->params->range_max : DEFAULT_RANGE_MAX;
    info->fixed_mounting = 1;
    info->base_sensor = placing.mounting.pose;
    describe(loader, &placing, log->taken, sizeof log->taken);
    return CAIRN_OK;
}

static void free_loader(bag_loader *loader)
{
    for (int32_t i = 0; i < loader->topic_count; i++) {
        free(loader->topic[i].name);
        free(loader->topic[i].type);
    }
    free(loader->topic);
    free(loader->scan);
    free(loader->range);
    free(loader->sensor);
    free(loader->base);
    cairn_scan_log_frames_free(&loader->frames);
    cairn_scan_log_track_free(&loader->odometry);
}

cairn_status cairn_scan_log_load_bag(cairn_scan_log *log, const char *path, cairn_bag_kind kind,
                                     const cairn_scan_log_params *params, cairn_file_error *error)
{
    bag_loader loader = {
        .path = path, .params = params, .error = error, .scan_topic = -1, .odometry_topic = -1};
    cairn_bag_visitor visitor = {on_message, on_fault, &loader};
    cairn_status status = cairn_bag_file_read(path, kind, &visitor, error);

    if (status == CAIRN_OK)
        status = check_topics(&loader);
    if (status == CAIRN_OK)
        status = finish(&loader, log);
    free_loader(&loader);
    return status;
}
