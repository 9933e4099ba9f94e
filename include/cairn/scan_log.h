/* scan_log: reader of laser scans from a file of any format that cairn knows, detected by its
 * content:
 *
 *   CARMEN log, table of ranges (CSV), URG log, scans of CSM   plain or gzipped
 *   bag of ROS 1 (.bag, format 2.0)        chunks plain, lz4 or bz2
 *   bag of ROS 2 (.db3, SQLite)            plain, messages or the whole file by zstd
 *   bag of ROS 2 (.mcap)                   chunks plain, lz4 or zstd, or none; indexes are not read
 *   bag folder of ROS 2                    the files that its metadata.yaml lists, in their order
 *
 * Bags. Scans are sensor_msgs/LaserScan messages of one topic, or MultiEchoLaserScan, of which the
 * first echo of each beam is taken. They keep the order of their recording, equal times that of the
 * file; a scan's stamp is that of its header. A range at or above range_max is a no return. With
 * several topics of scans, or of odometry, one must be named.
 *
 * Odometry of a bag is that of its nav_msgs/Odometry topic; without one the transforms odom -> base
 * on /tf. A scan gets the pose at its stamp, interpolated with a constant twist; before the first
 * and after the last pose the nearest one. The sensor's mounting is the transform base -> sensor on
 * /tf_static or /tf, projected to the plane; it is fixed: of a link that moves the first value is
 * taken. A sensor upside down has its bearings mirrored. Serializations are those of ROS 1 and CDR
 * of either byte order. Other messages (Imu, images) are read past.
 *
 * Faults. What is damaged is reported and left out; of a cut bag all before the cut is used. Only a
 * file without any scan is an error. A decompressed chunk or message has at most 256 MiB, a file
 * that is compressed as a whole 1 GiB; memory is taken for what a file holds, not for what it
 * declares. */
#ifndef CAIRN_SCAN_LOG_H
#define CAIRN_SCAN_LOG_H

#include "cairn/carmen_log.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The format of a file. */
typedef int32_t cairn_scan_log_kind;
enum {
    /* CARMEN log */
    CAIRN_SCAN_LOG_CARMEN = 0,
    /* values between commas, semicolons or tabs, with a header */
    CAIRN_SCAN_LOG_CSV = 1,
    /* log of a URG scanner */
    CAIRN_SCAN_LOG_URG = 2,
    /* JSON scans of the Canonical Scan Matcher */
    CAIRN_SCAN_LOG_CSM = 3,
    /* bag of ROS 1 or ROS 2 */
    CAIRN_SCAN_LOG_BAG = 4
};

/* Parameters of the reader. */
typedef struct cairn_scan_log_params {
    /* m, 0 ... CAIRN_SCAN_EXTENT (0): ranges at or above it are no returns; 0: the maximum range
     * that the file gives, or the default of its format */
    double range_max;
    /* m, 0 ... CAIRN_SCAN_EXTENT (0.01): standard deviation of the ranges, copied into the scans */
    double range_sigma;
    /* any (NULL): called once for each fault, in the order of the file. NULL: faults are only
     * counted. */
    void (*on_fault)(void *context, const cairn_file_error *fault);
    /* any (NULL): passed to on_fault */
    void *context;
    /* any (NULL): topic of the scans in a bag; NULL: the only one */
    const char *scan_topic;
    /* any (NULL): topic of the odometry in a bag, "/tf": the transforms; NULL: the only one */
    const char *odometry_topic;
} cairn_scan_log_params;

/* Returns the default parameters. */
cairn_scan_log_params cairn_scan_log_default(void);

/* Bytes of the text that says what was taken, with the terminating 0. */
#define CAIRN_SCAN_LOG_TAKEN_BYTES 512

/* A topic of a bag. */
typedef struct cairn_scan_log_topic {
    /* its name, and the type of its messages */
    char *name, *type;
    /* number of its messages in the bag */
    int64_t messages;
    /* number of those of which a scan, a pose or transforms were read */
    int64_t used;
} cairn_scan_log_topic;

/* What was taken of a bag. Topics are given by their index, -1: none. */
typedef struct cairn_scan_log_sources {
    /* [topic_count] all topics of the bag, in the order of their first messages */
    cairn_scan_log_topic *topics;
    /* number of topics */
    int32_t topic_count;
    /* topics of the scans, of the odometry, and of the transform at the sensor */
    int32_t scans, odometry, mounting;
    /* frame of the scans */
    char *sensor_frame;
    /* frame of the robot */
    char *base_frame;
    /* frame of the odometry; NULL: no odometry */
    char *odometry_frame;
    /* 0: no transforms lead from base_frame to sensor_frame, the sensor is taken to be at the
     * robot's origin */
    int32_t is_mounted;
    /* 1: the sensor is upside down */
    int32_t upside_down;
    /* 1: a transform on the way to the sensor moves, its first value was taken */
    int32_t moves;
    /* rad, angle of the scan's plane to the level */
    double tilt;
} cairn_scan_log_sources;

/* All scans of a file. */
typedef struct cairn_scan_log {
    /* The line of a record is the number of its message in a bag. In the summary of a bag, lines
     * are messages. */
    cairn_carmen_log_scans scans;
    /* the format of the file */
    cairn_scan_log_kind kind;
    /* 0: the robot's poses are the identity */
    int32_t has_odometry;
    /* what was taken of a bag: "scan /scan (120), odometry /odom, sensor at 0.20 0.00 0.0 degrees
     * from /tf_static"; empty for other formats */
    char taken[CAIRN_SCAN_LOG_TAKEN_BYTES];
    /* the same by topics and frames; NULL for other formats. Freed with the log. */
    cairn_scan_log_sources *sources;
} cairn_scan_log;

/* Reads all scans of a file. CAIRN_EMPTY: no scan; CAIRN_BAD_ARGUMENT: params, several topics and
 * none is named, a topic that is not there, or a topic for a file that is no bag;
 * CAIRN_UNSUPPORTED: a format or compression that this build lacks, not a regular file;
 * CAIRN_BAD_FORMAT, CAIRN_FULL, CAIRN_IO, CAIRN_NO_MEMORY. params NULL: the defaults. On failure
 * there is nothing to free.
 *
 * log: set to the scans
 * path: the file, or a bag folder */
CAIRN_CHECKED cairn_status cairn_scan_log_load(cairn_scan_log *log, const char *path,
                                               const cairn_scan_log_params *params,
                                               cairn_file_error *error);

/* Frees the scans of a log.
 *
 * log: the log, as loaded */
void cairn_scan_log_free(cairn_scan_log *log);

/* ---- Streams ----
 *
 * A stream is read line by line and returns each scan as soon as its line has come. Its first line
 * that is neither blank nor a comment determines its format:
 *
 * CARMEN: as cairn/carmen_log.h says, except for what needs the whole log. The maximum range is
 * that of the message, else params.range_max, else the last PARAM, else 80 m. The mounting is that
 * of the first scan.
 *
 * JSON: one object a line, with the fields of a sensor_msgs/LaserScan, of which angle_min,
 * angle_increment and ranges are required; null in ranges is an invalid reading.
 *
 *   {"stamp_ns": 1147713122541201000, "angle_min": -1.5, "angle_increment": 0.01, "range_min": 0.1,
 *    "range_max": 30, "time_increment": 0, "ranges": [2.5, null, 3.1], "odometry": [0, 0, 0]}
 *
 * The stamp is stamp_ns, or header.stamp with sec and nanosec. odometry is the robot's pose (m, m,
 * rad), sensor the sensor's pose on the robot; both may lack. Other fields are ignored. */

/* Reader of a stream of scans. */
typedef struct cairn_scan_log_stream cairn_scan_log_stream;

/* Begins to read an open file, which is closed with the stream. name: for error texts. Statuses of
 * cairn_scan_log_load() for the params; CAIRN_NO_MEMORY. On failure the file is closed.
 *
 * stream: set to the stream
 * file: descriptor of the open file */
CAIRN_CHECKED cairn_status cairn_scan_log_stream_open(cairn_scan_log_stream **stream, int32_t file,
                                                      const char *name,
                                                      const cairn_scan_log_params *params,
                                                      cairn_file_error *error);

/* Waits for the next scan. *has_odometry 0: record->robot is the identity. The record's arrays are
 * valid until the next call. Faulty lines are reported and skipped. CAIRN_EMPTY: the end;
 * CAIRN_IO, CAIRN_NO_MEMORY.
 *
 * record: set to the scan
 * has_odometry: set to 1 when the scan has odometry */
CAIRN_CHECKED cairn_status cairn_scan_log_stream_next(cairn_scan_log_stream *stream,
                                                      cairn_carmen_log_record *record,
                                                      int32_t *has_odometry,
                                                      cairn_file_error *error);

/* Returns the origin of the coordinates: 0 unless the first pose of the odometry is farther than
 * 1e5 m from 0; then all poses are relative to it. Valid once a scan with odometry has come.
 *
 * stream: the stream
 * origin: set to x and y, m */
void cairn_scan_log_stream_origin(const cairn_scan_log_stream *stream, double origin[2]);

/* Returns the number of faulty lines so far. */
int64_t cairn_scan_log_stream_faults(const cairn_scan_log_stream *stream);

/* Closes the stream and its file. NULL is allowed. */
void cairn_scan_log_stream_close(cairn_scan_log_stream *stream);

#ifdef __cplusplus
}
#endif

#endif
