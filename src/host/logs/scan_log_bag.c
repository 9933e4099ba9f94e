/* Scans of a bag.
 *
 * Method: one pass over the messages decodes the scans of the topic that is named, or of the first
 * one, the odometry likewise, and the transforms. Topics are counted.
 *
 * Layout: all ranges are in one array; records get pointers into it at the end, because it moves
 * when it grows.
 *
 * Limits: 100,000 ranges a scan; one sensor frame a topic, that of its first scan. */
#include "src/base/build.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/logs/scan_log_bag.h"

/* Largest accepted magnitude of bearings, rad. */
static const double MAX_BEARING = 1e9;

static cairn_status no_memory(const cairn_scan_log_bag *bag)
{
    return cairn_file_error_system(bag->error, bag->path, "read", ENOMEM);
}

/* ---- Faults ---- */

/* Reports a message that is left out. */
static void report(cairn_scan_log_bag *bag, const cairn_bag_message *message, cairn_status status,
                   const char *what)
{
    cairn_file_error fault;

    (void)cairn_file_error_set(
        &fault, status, message->path, 0, "message %" PRId64 " at %s %" PRIu64 ": on %s (%s), %s",
        message->number, message->unit, message->offset, message->topic, message->type, what);
    cairn_scan_log_bag_report(bag, &fault);
}

/* Reports a message that cannot be decoded. */
static void report_decoding(cairn_scan_log_bag *bag, const cairn_bag_message *message,
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
    report(bag, message, status, what);
}

/* ---- Topics ---- */

/* Returns the content of a topic by its type: "package/Name" or "package/msg/Name". */
static int32_t kind_of(const char *type)
{
    static const struct {
        const char *package, *name;
        int32_t kind;
    } kinds[] = {{"sensor_msgs/", "LaserScan", CAIRN_SCAN_LOG_TOPIC_SCAN},
                 {"sensor_msgs/", "MultiEchoLaserScan", CAIRN_SCAN_LOG_TOPIC_MULTI_ECHO},
                 {"nav_msgs/", "Odometry", CAIRN_SCAN_LOG_TOPIC_ODOMETRY},
                 {"tf2_msgs/", "TFMessage", CAIRN_SCAN_LOG_TOPIC_TRANSFORMS},
                 {"tf/", "tfMessage", CAIRN_SCAN_LOG_TOPIC_TRANSFORMS}};

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
    return CAIRN_SCAN_LOG_TOPIC_OTHER;
}

/* Finds or appends the topic of a message; -1: out of memory. */
static int32_t topic_of(cairn_scan_log_bag *bag, const cairn_bag_message *message)
{
    cairn_scan_log_bag_topic *grown;

    for (int32_t i = 0; i < bag->topic_count; i++)
        if (strcmp(bag->topic[i].topic.name, message->topic) == 0 &&
            strcmp(bag->topic[i].topic.type, message->type) == 0)
            return i;
    if (bag->topic_count == bag->topic_capacity) {
        int32_t capacity = 2 * bag->topic_capacity + 16;

        grown = realloc(bag->topic, (size_t)capacity * sizeof *grown);
        if (grown == NULL)
            return -1;
        bag->topic = grown;
        bag->topic_capacity = capacity;
    }
    grown = &bag->topic[bag->topic_count];
    grown->topic =
        (cairn_scan_log_topic){.name = strdup(message->topic), .type = strdup(message->type)};
    grown->kind = kind_of(message->type);
    bag->topic_count++;
    return grown->topic.name != NULL && grown->topic.type != NULL ? bag->topic_count - 1 : -1;
}

/* Returns 1 when the messages of a topic are taken: it is the one that is named, or the first of
 * its kind. *taken: the topic that is taken. */
static int takes(const cairn_scan_log_bag *bag, int32_t topic, const char *requested,
                 int32_t *taken)
{
    if (*taken < 0 &&
        (requested == NULL || cairn_scan_log_is_topic(requested, bag->topic[topic].topic.name)))
        *taken = topic;
    return *taken == topic;
}

/* ---- Messages ---- */

/* Makes space for a scan; 0 when out of memory. */
static int reserve_scan(cairn_scan_log_bag *bag, size_t ranges)
{
    if (bag->scan_count == bag->scan_capacity) {
        int32_t capacity = bag->scan_capacity > 0 ? 2 * bag->scan_capacity : 256;
        cairn_scan_log_bag_scan *grown = bag->scan_capacity <= INT32_MAX / 2
                                             ? realloc(bag->scan, (size_t)capacity * sizeof *grown)
                                             : NULL;

        if (grown == NULL)
            return 0;
        bag->scan = grown;
        bag->scan_capacity = capacity;
    }
    if (bag->range_capacity - bag->range_count < ranges) {
        size_t capacity = 2 * (bag->range_count + ranges);
        float *grown = realloc(bag->range, capacity * sizeof *grown);

        if (grown == NULL)
            return 0;
        bag->range = grown;
        bag->range_capacity = capacity;
    }
    return 1;
}

/* Returns the range from which on there is no return, m. */
static double limit_of(const cairn_scan_log_bag *bag, const cairn_ros_scan *scan)
{
    if (bag->params->range_max > 0)
        return bag->params->range_max;
    return scan->range_max > 0 && scan->range_max <= (float)CAIRN_SCAN_EXTENT
               ? (double)scan->range_max
               : LOG_DEFAULT_RANGE_MAX_M;
}

/* Returns what is wrong with a scan; NULL: nothing. */
static const char *check_scan(const cairn_scan_log_bag *bag, const cairn_ros_scan *scan)
{
    if (scan->count < 1 || scan->count > CAIRN_CARMEN_LOG_MAX_BEAMS)
        return "a scan without ranges or with more than 100000, expected 1 to 100000";
    if (!(fabsf(scan->angle_min) <= (float)MAX_BEARING) ||
        !(fabsf(scan->angle_step) <= (float)MAX_BEARING))
        return "bearings that are not finite, expected angle_min and angle_increment in rad";
    if ((double)scan->range_min >= limit_of(bag, scan))
        return "range_min at or above range_max, expected it below";
    if (scan->header.stamp_ns > CAIRN_SCAN_MAX_STAMP_NS)
        return "a stamp beyond 4e9 s, expected one within it";
    return NULL;
}

/* Converts a scan and its ranges, which are decoded, to a record. */
static void append_scan(cairn_scan_log_bag *bag, const cairn_bag_message *message,
                        const cairn_ros_scan *scan)
{
    cairn_scan_log_bag_scan *appended = &bag->scan[bag->scan_count++];
    cairn_carmen_log_record *record = &appended->record;
    float *range = bag->range + bag->range_count;
    double limit = limit_of(bag, scan);

    memset(appended, 0, sizeof *appended);
    appended->time_ns = message->time_ns;
    appended->order = bag->messages;
    appended->first = bag->range_count;
    bag->range_count += (size_t)scan->count;
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
    record->scan.range_sigma = (float)bag->params->range_sigma;
    record->scan.time_step =
        scan->time_step > 0 && scan->time_step <= FLT_MAX ? scan->time_step : 0;
}

/* Reads a scan; a faulty one is reported. */
static cairn_status read_scan(cairn_scan_log_bag *bag, const cairn_bag_message *message,
                              int first_echo)
{
    cairn_ros_reader reader;
    cairn_ros_scan scan;
    cairn_status status =
        cairn_ros_begin(&reader, message->encoding, message->bytes, message->count);
    const char *what = NULL;

    if (status == CAIRN_OK)
        status = cairn_ros_read_scan(&reader, &scan);
    if (status == CAIRN_OK)
        what = check_scan(bag, &scan);
    if (status == CAIRN_OK && what == NULL) {
        if (!reserve_scan(bag, (size_t)scan.count))
            return no_memory(bag);
        status =
            cairn_ros_read_ranges(&reader, first_echo, bag->range + bag->range_count, scan.count);
    }
    if (status != CAIRN_OK) {
        report_decoding(bag, message, &reader, status);
    } else if (what != NULL) {
        report(bag, message, CAIRN_BAD_FORMAT, what);
    } else {
        if (bag->sensor == NULL)
            bag->sensor = cairn_scan_log_copy_frame(scan.header.frame);
        if (bag->sensor == NULL)
            return no_memory(bag);
        append_scan(bag, message, &scan);
    }
    return CAIRN_OK;
}

static cairn_status read_odometry(cairn_scan_log_bag *bag, const cairn_bag_message *message)
{
    cairn_ros_reader reader;
    cairn_ros_stamped odometry;
    cairn_status status =
        cairn_ros_begin(&reader, message->encoding, message->bytes, message->count);

    if (status == CAIRN_OK)
        status = cairn_ros_read_stamped(&reader, &odometry);
    if (status != CAIRN_OK) {
        report_decoding(bag, message, &reader, status);
        return CAIRN_OK;
    }
    if (bag->base == NULL)
        bag->base = cairn_scan_log_copy_frame(odometry.child);
    if (bag->parent == NULL)
        bag->parent = cairn_scan_log_copy_frame(odometry.header.frame);
    if (bag->base == NULL || bag->parent == NULL)
        return no_memory(bag);
    status =
        cairn_scan_log_track_add(&bag->odometry, odometry.header.stamp_ns, &odometry.transform);
    return status == CAIRN_OK ? CAIRN_OK : no_memory(bag);
}

static cairn_status read_transforms(cairn_scan_log_bag *bag, const cairn_bag_message *message)
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
            report_decoding(bag, message, &reader, status);
        if (status == CAIRN_OK)
            status = cairn_scan_log_frames_add(&bag->frames, message->topic, &transform);
        if (status == CAIRN_NO_MEMORY)
            return no_memory(bag);
        if (status == CAIRN_FULL)
            return cairn_file_error_set(bag->error, status, bag->path, 0,
                                        "more than %d links between frames, expected at most that",
                                        CAIRN_BAG_MAX_TOPICS);
    }
    if (status == CAIRN_TRUNCATED || status == CAIRN_UNSUPPORTED)
        report_decoding(bag, message, &reader, status);
    return CAIRN_OK;
}

/* Reads what is taken of a message. */
static cairn_status read_message(cairn_scan_log_bag *bag, const cairn_bag_message *message,
                                 int32_t kind)
{
    switch (kind) {
    case CAIRN_SCAN_LOG_TOPIC_SCAN:
    case CAIRN_SCAN_LOG_TOPIC_MULTI_ECHO:
        return read_scan(bag, message, kind == CAIRN_SCAN_LOG_TOPIC_MULTI_ECHO);
    case CAIRN_SCAN_LOG_TOPIC_ODOMETRY:
        return read_odometry(bag, message);
    default:
        return read_transforms(bag, message);
    }
}

/* Returns 1 when the messages of a topic are read. */
static int is_read(cairn_scan_log_bag *bag, int32_t topic)
{
    switch (bag->topic[topic].kind) {
    case CAIRN_SCAN_LOG_TOPIC_SCAN:
    case CAIRN_SCAN_LOG_TOPIC_MULTI_ECHO:
        return takes(bag, topic, bag->params->scan_topic, &bag->scan_topic);
    case CAIRN_SCAN_LOG_TOPIC_ODOMETRY:
        return takes(bag, topic, bag->params->odometry_topic, &bag->odometry_topic);
    case CAIRN_SCAN_LOG_TOPIC_TRANSFORMS:
        return 1;
    default:
        return 0;
    }
}

static cairn_status on_message(void *context, const cairn_bag_message *message)
{
    cairn_scan_log_bag *bag = context;
    int64_t faults = bag->faults;
    int32_t topic = topic_of(bag, message);
    cairn_status status;

    if (topic < 0)
        return no_memory(bag);
    bag->messages++;
    bag->topic[topic].topic.messages++;
    if (!is_read(bag, topic))
        return CAIRN_OK;
    status = read_message(bag, message, bag->topic[topic].kind);
    bag->topic[topic].topic.used += status == CAIRN_OK && bag->faults == faults;
    return status;
}

static void free_bag(cairn_scan_log_bag *bag)
{
    for (int32_t i = 0; i < bag->topic_count; i++) {
        free(bag->topic[i].topic.name);
        free(bag->topic[i].topic.type);
    }
    free(bag->topic);
    free(bag->scan);
    free(bag->range);
    free(bag->sensor);
    free(bag->parent);
    free(bag->base);
    cairn_scan_log_frames_free(&bag->frames);
    cairn_scan_log_track_free(&bag->odometry);
}

cairn_status cairn_scan_log_load_bag(cairn_scan_log *log, const char *path, cairn_bag_kind kind,
                                     const cairn_scan_log_params *params, cairn_file_error *error)
{
    cairn_scan_log_bag bag = {
        .path = path, .params = params, .error = error, .scan_topic = -1, .odometry_topic = -1};
    cairn_bag_visitor visitor = {on_message, cairn_scan_log_bag_report, &bag};
    cairn_status status = cairn_bag_file_read(path, kind, &visitor, error);

    if (status == CAIRN_OK)
        status = cairn_scan_log_bag_check(&bag);
    if (status == CAIRN_OK)
        status = cairn_scan_log_bag_finish(&bag, log);
    free_bag(&bag);
    return status;
}
