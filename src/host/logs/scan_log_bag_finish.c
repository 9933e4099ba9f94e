/* From the messages of a bag to its log: topics are checked, scans sorted and placed.
 *
 * Method
 * 1. Several topics of scans, or of odometry, of which none is named, are listed and refused.
 * 2. Scans are sorted by the time of their recording, odometry by its stamps.
 * 3. The mounting is found in the tree of frames, and each scan gets its odometry. */
#include "src/base/build.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/base/c_locale.h"
#include "src/host/base/degrees.h"
#include "src/host/logs/carmen_log_summary.h"
#include "src/host/logs/log_origin.h"
#include "src/host/logs/scan_log_bag.h"

/* A tilt of the scan's plane that is mentioned, rad. */
static const double MENTIONED_TILT = 0.1;

int32_t cairn_scan_log_is_topic(const char *requested, const char *name)
{
    return strcmp(requested + (requested[0] == '/'), name + (name[0] == '/')) == 0;
}

/* ---- The choice of topics ---- */

/* Returns the number of topics of a kind (that of multi-echo scans is the same as of scans), and
 * lists them; kind -1: all topics. */
static int32_t list_topics(const cairn_scan_log_bag *bag, int32_t kind, char *text, size_t size)
{
    int32_t listed = 0;
    size_t used = 0;

    text[0] = 0;
    for (int32_t i = 0; i < bag->topic_count; i++) {
        const cairn_scan_log_topic *topic = &bag->topic[i].topic;
        int32_t found = bag->topic[i].kind;

        if (kind >= 0 && found != kind &&
            !(kind == CAIRN_SCAN_LOG_TOPIC_SCAN && found == CAIRN_SCAN_LOG_TOPIC_MULTI_ECHO))
            continue;
        if (used < size)
            used +=
                (size_t)snprintf(text + used, size - used, "%s%s (%s, %" PRId64 ")",
                                 listed > 0 ? ", " : "", topic->name, topic->type, topic->messages);
        listed++;
    }
    return listed;
}

/* Checks that one topic of a kind was named or is the only one. */
static cairn_status check_choice(const cairn_scan_log_bag *bag, int32_t kind, const char *what,
                                 const char *option, const char *requested, int32_t taken)
{
    char list[400];
    int32_t count = list_topics(bag, kind, list, sizeof list);

    if (requested == NULL && count > 1)
        return cairn_file_error_set(bag->error, CAIRN_BAD_ARGUMENT, bag->path, 0,
                                    "%d topics of %s, expected one named by %s: %s", count, what,
                                    option, list);
    if (requested != NULL && taken < 0)
        return cairn_file_error_set(bag->error, CAIRN_BAD_ARGUMENT, bag->path, 0,
                                    "no topic %s of %s, expected one of: %s", requested, what,
                                    count > 0 ? list : "none, there is no such topic");
    return CAIRN_OK;
}

/* Returns 1 when the transforms are requested as odometry. */
static int are_transforms_requested(const cairn_scan_log_bag *bag)
{
    const char *requested = bag->params->odometry_topic;

    return requested != NULL && cairn_scan_log_is_topic(requested, "/tf");
}

cairn_status cairn_scan_log_bag_check(const cairn_scan_log_bag *bag)
{
    char list[400];
    cairn_status status;

    if (list_topics(bag, CAIRN_SCAN_LOG_TOPIC_SCAN, list, sizeof list) == 0) {
        (void)list_topics(bag, -1, list, sizeof list);
        return cairn_file_error_set(bag->error, CAIRN_EMPTY, bag->path, 0,
                                    "no scan in %" PRId64
                                    " messages, expected sensor_msgs/LaserScan; topics: %s",
                                    bag->messages, list[0] != 0 ? list : "none");
    }
    status = check_choice(bag, CAIRN_SCAN_LOG_TOPIC_SCAN, "scans", "--scan",
                          bag->params->scan_topic, bag->scan_topic);
    if (status == CAIRN_OK && !are_transforms_requested(bag))
        status = check_choice(bag, CAIRN_SCAN_LOG_TOPIC_ODOMETRY, "odometry", "--odom",
                              bag->params->odometry_topic, bag->odometry_topic);
    if (status == CAIRN_OK && bag->scan_count == 0)
        status = cairn_file_error_set(bag->error, CAIRN_EMPTY, bag->path, 0,
                                      "no whole scan on %s (%" PRId64
                                      " damaged messages), expected at least one",
                                      bag->topic[bag->scan_topic].topic.name, bag->faults);
    return status;
}

/* ---- The log ---- */

static int by_recording(const void *first, const void *second)
{
    const cairn_scan_log_bag_scan *a = first, *b = second;

    if (a->time_ns != b->time_ns)
        return a->time_ns < b->time_ns ? -1 : 1;
    return a->order < b->order ? -1 : a->order > b->order;
}

/* What the scans are placed by. */
typedef struct bag_placing {
    cairn_scan_log_track *odometry;  /* NULL: none */
    const cairn_scan_log_link *link; /* of the odometry; NULL: a topic */
    const char *base;                /* NULL: unknown */
    cairn_scan_log_mounting mounting;
    int32_t is_mounted; /* 0: no links lead to the sensor, it is taken to be at the base */
} bag_placing;

/* Chooses odometry and mounting. */
static bag_placing choose_placing(cairn_scan_log_bag *bag)
{
    bag_placing placing = {.odometry = NULL};
    cairn_scan_log_link *link = cairn_scan_log_frames_odometry(&bag->frames, bag->sensor);

    if (bag->odometry.count > 0) {
        cairn_scan_log_track_sort(&bag->odometry);
        placing.odometry = &bag->odometry;
        placing.base = bag->base[0] != 0 ? bag->base : link != NULL ? link->child : NULL;
    } else if (link != NULL) {
        cairn_scan_log_track_sort(&link->track);
        placing.odometry = &link->track;
        placing.link = link;
        placing.base = link->child;
    }
    /* without odometry the usual name of the robot's frame */
    if (placing.base == NULL)
        placing.base = "base_link";
    placing.is_mounted =
        cairn_scan_log_frames_mounting(&bag->frames, placing.base, bag->sensor, &placing.mounting);
    if (!placing.is_mounted)
        placing.mounting.pose = cairn_pose_identity();
    return placing;
}

/* Takes the odometry from the log's origin, which is that of its first pose. */
static void take_from_origin(cairn_scan_log_track *odometry, double origin[2])
{
    for (int32_t i = 0; odometry != NULL && i < odometry->count; i++) {
        cairn_scan_log_sample *sample = &odometry->sample[i];
        double pose[2] = {sample->x, sample->y};

        if (i == 0)
            log_origin_set(origin, pose);
        log_origin_take(origin, pose);
        sample->x = pose[0];
        sample->y = pose[1];
    }
}

/* Returns a number, or 0 when it would print as -0. */
static double without_negative_zero(double value, double smallest)
{
    return fabs(value) < smallest ? 0 : value;
}

/* Writes what was taken. */
static void describe(const cairn_scan_log_bag *bag, const bag_placing *placing, char *text,
                     size_t size)
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
                       bag->topic[bag->odometry_topic].topic.name);
    if (!placing->is_mounted)
        (void)snprintf(sensor, sizeof sensor,
                       "sensor taken to be at the robot's origin: no transform from %s to %s",
                       placing->base, bag->sensor);
    else
        (void)snprintf(
            sensor, sizeof sensor, "sensor %sat %.2f %.2f %.1f\302\260%s%s",
            mounting->upside_down ? "upside down " : "",
            without_negative_zero((double)mounting->pose.x, 0.005),
            without_negative_zero((double)mounting->pose.y, 0.005),
            without_negative_zero((double)mounting->pose.theta * CAIRN_DEGREES_PER_RADIAN, 0.05),
            mounting->topic != NULL ? " from " : ", the robot's frame",
            mounting->topic != NULL ? mounting->topic : "");
    (void)snprintf(text, size, "scan %s (%" PRId32 "), %s, %s",
                   bag->topic[bag->scan_topic].topic.name, bag->scan_count, odometry, sensor);
    cairn_c_locale_leave(scope);
}

/* Returns the index of a topic by its name; -1: there is none. */
static int32_t topic_named(const cairn_scan_log_sources *sources, const char *name)
{
    for (int32_t i = 0; i < sources->topic_count && name != NULL; i++)
        if (strcmp(sources->topics[i].name, name) == 0)
            return i;
    return -1;
}

static char *copy_or_null(const char *text)
{
    return text != NULL ? strdup(text) : NULL;
}

/* Moves the topics from the reader to the sources. */
static void move_topics(cairn_scan_log_bag *bag, cairn_scan_log_sources *sources)
{
    for (int32_t i = 0; i < bag->topic_count; i++)
        sources->topics[i] = bag->topic[i].topic;
    sources->topic_count = bag->topic_count;
    bag->topic_count = 0;
}

/* Makes the sources, from now on of the log. Topics are moved to it. */
static cairn_status make_sources(cairn_scan_log_bag *bag, const bag_placing *placing,
                                 cairn_scan_log *log)
{
    const cairn_scan_log_mounting *mounting = &placing->mounting;
    const char *parent = placing->odometry == NULL ? NULL
                         : placing->link != NULL   ? placing->link->parent
                                                   : bag->parent;
    cairn_scan_log_sources *sources = calloc(1, sizeof *sources);

    log->sources = sources;
    if (sources == NULL)
        return CAIRN_NO_MEMORY;
    sources->topics = calloc((size_t)bag->topic_count + 1, sizeof *sources->topics);
    sources->sensor_frame = strdup(bag->sensor);
    sources->base_frame = strdup(placing->base);
    sources->odometry_frame = copy_or_null(parent);
    if (sources->topics == NULL || sources->sensor_frame == NULL || sources->base_frame == NULL ||
        (parent != NULL && sources->odometry_frame == NULL))
        return CAIRN_NO_MEMORY;
    move_topics(bag, sources);
    sources->scans = bag->scan_topic;
    sources->odometry = placing->odometry == NULL ? -1
                        : placing->link != NULL   ? topic_named(sources, placing->link->topic)
                                                  : bag->odometry_topic;
    sources->is_mounted = placing->is_mounted;
    sources->mounting = placing->is_mounted ? topic_named(sources, mounting->topic) : -1;
    sources->upside_down = placing->is_mounted && mounting->upside_down;
    sources->moves = placing->is_mounted && mounting->moving != NULL;
    sources->tilt = placing->is_mounted ? mounting->tilt : 0;
    return CAIRN_OK;
}

/* Reports a mounting that is not what a scan in the plane needs. */
static void report_mounting(cairn_scan_log_bag *bag, const bag_placing *placing)
{
    const cairn_scan_log_link *moving = placing->mounting.moving;
    cairn_file_error fault;

    if (placing->is_mounted && moving != NULL) {
        (void)cairn_file_error_set(
            &fault, CAIRN_BAD_FORMAT, bag->path, 0,
            "the transform from %s to %s moves, expected a fixed sensor: its "
            "first value is taken",
            moving->parent, moving->child);
        cairn_scan_log_bag_report(bag, &fault);
    }
    if (placing->is_mounted && placing->mounting.tilt > MENTIONED_TILT) {
        (void)cairn_file_error_set(
            &fault, CAIRN_BAD_FORMAT, bag->path, 0,
            "the sensor is tilted by %.1f degrees, expected a level one: its "
            "ranges are taken as level",
            placing->mounting.tilt * CAIRN_DEGREES_PER_RADIAN);
        cairn_scan_log_bag_report(bag, &fault);
    }
}

/* Completes a record by its odometry, mounting and ranges. */
static void complete_record(const cairn_scan_log_bag *bag, const bag_placing *placing,
                            const cairn_scan_log_bag_scan *scan, cairn_carmen_log_record *record)
{
    *record = scan->record;
    record->range = record->scan.range = bag->range + scan->first;
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
cairn_status cairn_scan_log_bag_finish(cairn_scan_log_bag *bag, cairn_scan_log *log)
{
    cairn_carmen_log_summary *info = &log->scans.info;
    bag_placing placing = choose_placing(bag);

    if (are_transforms_requested(bag) && placing.link == NULL)
        return cairn_file_error_set(bag->error, CAIRN_BAD_ARGUMENT, bag->path, 0,
                                    "no transform from odom above %s on /tf, expected one",
                                    bag->sensor);
    take_from_origin(placing.odometry, info->origin);
    qsort(bag->scan, (size_t)bag->scan_count, sizeof *bag->scan, by_recording);
    log->scans.record = calloc((size_t)bag->scan_count, sizeof *log->scans.record);
    if (log->scans.record == NULL)
        return cairn_file_error_system(bag->error, bag->path, "read", ENOMEM);
    for (int32_t i = 0; i < bag->scan_count; i++)
        complete_record(bag, &placing, &bag->scan[i], &log->scans.record[i]);
    log->scans.count = bag->scan_count;
    log->scans.range = bag->range;
    bag->range = NULL;
    log->has_odometry = placing.odometry != NULL;
    report_mounting(bag, &placing);
    cairn_carmen_log_summarize(&log->scans);
    info->lines = bag->messages;
    info->odometry = placing.odometry != NULL ? placing.odometry->count : 0;
    info->ignored = bag->messages - info->scans - bag->odometry.count;
    info->faults = bag->faults;
    info->range_max = bag->params->range_max > 0 ? bag->params->range_max : LOG_DEFAULT_RANGE_MAX_M;
    info->fixed_mounting = 1;
    info->base_sensor = placing.mounting.pose;
    describe(bag, &placing, log->taken, sizeof log->taken);
    return make_sources(bag, &placing, log) == CAIRN_OK
               ? CAIRN_OK
               : cairn_file_error_system(bag->error, bag->path, "read", ENOMEM);
}
