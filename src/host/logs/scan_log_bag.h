/* scan_log_bag: state of the reader of bags, shared by its parts. Internal to the host library. */
#ifndef CAIRN_HOST_SCAN_LOG_BAG_H
#define CAIRN_HOST_SCAN_LOG_BAG_H

#include "src/host/logs/log_parameters.h"
#include "src/host/logs/scan_log_work.h"

/* The content of a topic. */
enum {
    CAIRN_SCAN_LOG_TOPIC_OTHER = 0,
    CAIRN_SCAN_LOG_TOPIC_SCAN = 1,
    CAIRN_SCAN_LOG_TOPIC_MULTI_ECHO = 2,
    CAIRN_SCAN_LOG_TOPIC_ODOMETRY = 3,
    CAIRN_SCAN_LOG_TOPIC_TRANSFORMS = 4
};

typedef struct cairn_scan_log_bag_topic {
    cairn_scan_log_topic topic;
    int32_t kind;
} cairn_scan_log_bag_topic;

/* A scan before the sorting. */
typedef struct cairn_scan_log_bag_scan {
    cairn_carmen_log_record record;
    int64_t time_ns, order; /* of its recording */
    size_t first;           /* index of its first range */
} cairn_scan_log_bag_scan;

/* State of the reader. */
typedef struct cairn_scan_log_bag {
    const char *path;
    const cairn_scan_log_params *params;
    cairn_file_error *error;
    cairn_scan_log_bag_topic *topic; /* [topic_count] of [topic_capacity] */
    int32_t topic_count, topic_capacity;
    int32_t scan_topic, odometry_topic; /* taken; -1: none */
    cairn_scan_log_bag_scan *scan;      /* [scan_count] of [scan_capacity] */
    int32_t scan_count, scan_capacity;
    float *range; /* [range_count] of [range_capacity] */
    size_t range_count, range_capacity;
    cairn_scan_log_frames frames;
    cairn_scan_log_track odometry;
    /* frames of the first scan, and parent and child of the first odometry; NULL: none */
    char *sensor, *parent, *base;
    int64_t messages, faults;
} cairn_scan_log_bag;

/* Counts a fault and passes it on. context: the reader. */
static inline void cairn_scan_log_bag_report(void *context, const cairn_file_error *fault)
{
    cairn_scan_log_bag *bag = context;

    bag->faults++;
    if (bag->params->on_fault != NULL)
        bag->params->on_fault(bag->params->context, fault);
}

/* Returns 1 when a name on the command line is that of a topic; the slash before it may lack. */
int32_t cairn_scan_log_is_topic(const char *requested, const char *name);

/* Checks that there are scans, and that their topic and that of the odometry are clear.
 * CAIRN_EMPTY, CAIRN_BAD_ARGUMENT. */
CAIRN_CHECKED cairn_status cairn_scan_log_bag_check(const cairn_scan_log_bag *bag);

/* Moves what was read to the log: sorted scans with mounting and odometry. CAIRN_BAD_ARGUMENT:
 * transforms are requested as odometry, and there are none; CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_scan_log_bag_finish(cairn_scan_log_bag *bag, cairn_scan_log *log);

#endif
