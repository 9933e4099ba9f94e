/* ros_message: decoder of the ROS messages that hold scans, odometry and transforms, in the
 * serialization of ROS 1 or in CDR (ROS 2). Internal to the host library.
 *
 * ROS 1: little-endian, packed; a string is its length (uint32) and its bytes; a header begins with
 * a sequence number. CDR: four bytes of encapsulation, of which the second is the byte order (0:
 * big-endian, 1: little-endian); numbers are aligned to their size, counted from behind the
 * encapsulation; a string counts its terminating 0. */
#ifndef CAIRN_HOST_ROS_MESSAGE_H
#define CAIRN_HOST_ROS_MESSAGE_H

#include "cairn/status.h"

/* The serialization of a message. */
typedef int32_t cairn_ros_encoding;
enum { CAIRN_ROS_ENCODING_ROS1 = 0, CAIRN_ROS_ENCODING_CDR = 1 };

/* A message that is being decoded. After the first field that does not fit, further reads return 0
 * and `missing` is the field's name. */
typedef struct cairn_ros_reader {
    const uint8_t *begin, *at, *end;
    cairn_ros_encoding encoding;
    int32_t big_endian;
    const char *missing; /* NULL: no fault */
} cairn_ros_reader;

/* Text in the message, not 0-terminated. */
typedef struct cairn_ros_text {
    const char *bytes;
    size_t length;
} cairn_ros_text;

/* std_msgs/Header. */
typedef struct cairn_ros_header {
    int64_t stamp_ns;
    cairn_ros_text frame;
} cairn_ros_header;

/* sensor_msgs/LaserScan without its ranges; angles in rad, ranges in m, times in s. */
typedef struct cairn_ros_scan {
    cairn_ros_header header;
    float angle_min, angle_max, angle_step, time_step, scan_time, range_min, range_max;
    int32_t count; /* ranges */
} cairn_ros_scan;

/* A position in m and a unit quaternion. */
typedef struct cairn_ros_transform {
    double translation[3];
    double rotation[4]; /* x, y, z, w */
} cairn_ros_transform;

/* nav_msgs/Odometry without twist and covariances, and geometry_msgs/TransformStamped. */
typedef struct cairn_ros_stamped {
    cairn_ros_header header;
    cairn_ros_text child;
    cairn_ros_transform transform;
} cairn_ros_stamped;

/* Begins a message. CAIRN_TRUNCATED, CAIRN_UNSUPPORTED: no encapsulation of plain CDR. */
CAIRN_CHECKED cairn_status cairn_ros_begin(cairn_ros_reader *reader, cairn_ros_encoding encoding,
                                           const uint8_t *bytes, size_t count);

/* Decodes a LaserScan up to the number of its ranges; they follow, and are read by
 * cairn_ros_read_ranges(). CAIRN_TRUNCATED. */
CAIRN_CHECKED cairn_status cairn_ros_read_scan(cairn_ros_reader *reader, cairn_ros_scan *scan);

/* Decodes the ranges into range[0 .. count). first_echo 1: of a MultiEchoLaserScan, of each beam
 * the first echo, NaN without one. CAIRN_TRUNCATED. */
CAIRN_CHECKED cairn_status cairn_ros_read_ranges(cairn_ros_reader *reader, int32_t first_echo,
                                                 float *range, int32_t count);

/* Decodes the number of transforms of a TFMessage; they follow. CAIRN_TRUNCATED. */
CAIRN_CHECKED cairn_status cairn_ros_read_count(cairn_ros_reader *reader, uint32_t *count);

/* Decodes an Odometry message, or the next transform of a TFMessage. CAIRN_TRUNCATED;
 * CAIRN_NOT_FINITE: its pose is not finite, beyond 1e9 m, or its quaternion is 0; reading may
 * continue behind it. */
CAIRN_CHECKED cairn_status cairn_ros_read_stamped(cairn_ros_reader *reader,
                                                  cairn_ros_stamped *stamped);

#endif
