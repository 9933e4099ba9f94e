/* Shared by the parts of scan_log: odometry by time, and the tree of frames. */
#ifndef CAIRN_HOST_SCAN_LOG_WORK_H
#define CAIRN_HOST_SCAN_LOG_WORK_H

#include "cairn/scan_log.h"
#include "src/host/bags/bag_file.h"

/* A pose by time. */
typedef struct cairn_scan_log_sample {
    int64_t stamp_ns, order; /* order: of the recording */
    double x, y, theta;      /* m, m, rad */
} cairn_scan_log_sample;

/* Poses by time. */
typedef struct cairn_scan_log_track {
    cairn_scan_log_sample *sample; /* [count] of [capacity] */
    int32_t count, capacity;
} cairn_scan_log_track;

/* Appends a pose, projected to the plane. CAIRN_NO_MEMORY, CAIRN_FULL. */
CAIRN_CHECKED cairn_status cairn_scan_log_track_add(cairn_scan_log_track *track, int64_t stamp_ns,
                                                    const cairn_ros_transform *pose);

/* Sorts the poses by time, equal times by their recording. */
void cairn_scan_log_track_sort(cairn_scan_log_track *track);

/* Returns the pose at a time: interpolated with a constant twist, the nearest one outside. The
 * track is sorted and not empty. */
cairn_pose cairn_scan_log_track_at(const cairn_scan_log_track *track, int64_t stamp_ns);

void cairn_scan_log_track_free(cairn_scan_log_track *track);

/* A transform between two frames. */
typedef struct cairn_scan_log_link {
    char *parent, *child, *topic;
    cairn_ros_transform first;
    int32_t moves; /* 1: a later value differs from the first */
    cairn_scan_log_track track;
} cairn_scan_log_link;

/* The tree of frames. */
typedef struct cairn_scan_log_frames {
    cairn_scan_log_link *link; /* [count] of [capacity] */
    int32_t count, capacity;
} cairn_scan_log_frames;

/* Adds a transform that came on a topic. CAIRN_FULL: more than CAIRN_BAG_MAX_TOPICS links;
 * CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_scan_log_frames_add(cairn_scan_log_frames *frames,
                                                     const char *topic,
                                                     const cairn_ros_stamped *transform);

/* Finds the link odom -> base above a frame: the first whose parent's name begins with "odom".
 * NULL: none. */
cairn_scan_log_link *cairn_scan_log_frames_odometry(const cairn_scan_log_frames *frames,
                                                    const char *sensor);

/* The sensor's pose in the frame of the base, in the plane. */
typedef struct cairn_scan_log_mounting {
    cairn_pose pose;
    int32_t upside_down;
    double tilt;       /* rad, of the scan's plane to the level */
    const char *topic; /* of the link at the sensor; NULL: base and sensor are one frame */
    const cairn_scan_log_link *moving; /* a link on the way that moves; NULL: none */
} cairn_scan_log_mounting;

/* Finds the mounting; 0 when no links lead from one frame to the other. */
int32_t cairn_scan_log_frames_mounting(const cairn_scan_log_frames *frames, const char *base,
                                       const char *sensor, cairn_scan_log_mounting *mounting);

/* Frees the links. */
void cairn_scan_log_frames_free(cairn_scan_log_frames *frames);

/* Returns a frame's name without the slash before it, on the heap; NULL when out of memory. */
char *cairn_scan_log_copy_frame(cairn_ros_text name);

/* Checks range_max and range_sigma. CAIRN_BAD_ARGUMENT. */
CAIRN_CHECKED cairn_status cairn_scan_log_check(const cairn_scan_log_params *params,
                                                const char *path, cairn_file_error *error);

/* Ranges of a JSON scan, which grow. */
typedef struct cairn_scan_log_beams {
    double *range; /* [count] of [capacity] m */
    int32_t count, capacity;
} cairn_scan_log_beams;

/* A scan in JSON. */
typedef struct cairn_scan_log_json {
    int64_t stamp_ns;
    double angle_min, angle_step, time_step, range_min, range_max; /* NaN: the field is missing */
    double odometry[3], sensor[3];                                 /* m, m, rad */
    int32_t has_odometry;
} cairn_scan_log_json;

/* Parses line[0 .. length), line `number` of the file: an object of a LaserScan's fields. *beams:
 * its ranges, NaN for null. CAIRN_BAD_FORMAT, CAIRN_TRUNCATED, CAIRN_FULL, CAIRN_NOT_FINITE: the
 * fault says why; CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_scan_log_json_read(cairn_scan_log_json *scan,
                                                    cairn_scan_log_beams *beams, const char *path,
                                                    int64_t number, const char *line, size_t length,
                                                    cairn_file_error *fault);

/* Reads a bag. As cairn_scan_log_load(). */
CAIRN_CHECKED cairn_status cairn_scan_log_load_bag(cairn_scan_log *log, const char *path,
                                                   cairn_bag_kind kind,
                                                   const cairn_scan_log_params *params,
                                                   cairn_file_error *error);

#endif
