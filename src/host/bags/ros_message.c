/* Decoder of ROS messages.
 *
 * Method: one function reads an unsigned number of 1 to 8 bytes in the message's byte order and
 * alignment; all other fields are made of it. A declared length is compared with the rest of the
 * message before anything of that length is read.
 *
 * Source: the definitions sensor_msgs/LaserScan, MultiEchoLaserScan, nav_msgs/Odometry and
 * tf2_msgs/TFMessage; CDR by the OMG's DDSI-RTPS 2.2, section 10. */
#include "src/base/build.h"

#include <math.h>
#include <string.h>

#include "src/host/bags/ros_message.h"

/* Bytes of the encapsulation before CDR, and its representations. */
enum { ENCAPSULATION_BYTES = 4, CDR_BIG_ENDIAN = 0, CDR_LITTLE_ENDIAN = 1 };

/* Fewest bytes of a serialized range, and of the length of a list of echoes. */
enum { RANGE_BYTES = 4 };

cairn_status cairn_ros_begin(cairn_ros_reader *reader, cairn_ros_encoding encoding,
                             const uint8_t *bytes, size_t count)
{
    memset(reader, 0, sizeof *reader);
    reader->encoding = encoding;
    reader->begin = reader->at = bytes;
    reader->end = bytes + count;
    if (encoding == CAIRN_ROS_ENCODING_ROS1)
        return CAIRN_OK;
    if (count < ENCAPSULATION_BYTES) {
        reader->missing = "the encapsulation";
        return CAIRN_TRUNCATED;
    }
    if (bytes[0] != 0 || bytes[1] > CDR_LITTLE_ENDIAN)
        return CAIRN_UNSUPPORTED;
    reader->big_endian = bytes[1] == CDR_BIG_ENDIAN;
    reader->begin = reader->at = bytes + ENCAPSULATION_BYTES;
    return CAIRN_OK;
}

/* Reads an unsigned number of `bytes` bytes. */
static uint64_t read_unsigned(cairn_ros_reader *reader, size_t bytes, const char *field)
{
    size_t used = (size_t)(reader->at - reader->begin), left = (size_t)(reader->end - reader->at);
    size_t skip = reader->encoding == CAIRN_ROS_ENCODING_CDR ? (bytes - used % bytes) % bytes : 0;
    uint64_t value = 0;

    if (reader->missing != NULL)
        return 0;
    if (left < skip + bytes) {
        reader->missing = field;
        return 0;
    }
    reader->at += skip;
    for (size_t i = 0; i < bytes; i++)
        value |= (uint64_t)reader->at[i] << 8 * (reader->big_endian ? bytes - 1 - i : i);
    reader->at += bytes;
    return value;
}

static float read_float(cairn_ros_reader *reader, const char *field)
{
    uint32_t bits = (uint32_t)read_unsigned(reader, sizeof bits, field);
    float value;

    memcpy(&value, &bits, sizeof value);
    return value;
}

static double read_double(cairn_ros_reader *reader, const char *field)
{
    uint64_t bits = read_unsigned(reader, sizeof bits, field);
    double value;

    memcpy(&value, &bits, sizeof value);
    return value;
}

static cairn_ros_text read_text(cairn_ros_reader *reader, const char *field)
{
    size_t length = (size_t)read_unsigned(reader, 4, field);
    cairn_ros_text text = {"", 0};

    if (reader->missing == NULL && length > (size_t)(reader->end - reader->at))
        reader->missing = field;
    if (reader->missing != NULL)
        return text;
    text.bytes = (const char *)reader->at;
    text.length = length;
    reader->at += length;
    if (reader->encoding == CAIRN_ROS_ENCODING_CDR && length > 0 && text.bytes[length - 1] == 0)
        text.length--;
    return text;
}

static cairn_ros_header read_header(cairn_ros_reader *reader)
{
    cairn_ros_header header;
    int64_t seconds, nanoseconds;

    if (reader->encoding == CAIRN_ROS_ENCODING_ROS1)
        (void)read_unsigned(reader, 4, "header.seq");
    /* unsigned in ROS 1, signed in ROS 2 */
    seconds = (int64_t)read_unsigned(reader, 4, "header.stamp");
    if (reader->encoding == CAIRN_ROS_ENCODING_CDR && seconds > INT32_MAX)
        seconds -= INT64_C(1) << 32;
    nanoseconds = (int64_t)read_unsigned(reader, 4, "header.stamp");
    header.stamp_ns = seconds * 1000000000 + nanoseconds;
    header.frame = read_text(reader, "header.frame_id");
    return header;
}

static cairn_status status_of(const cairn_ros_reader *reader)
{
    return reader->missing == NULL ? CAIRN_OK : CAIRN_TRUNCATED;
}

cairn_status cairn_ros_read_scan(cairn_ros_reader *reader, cairn_ros_scan *scan)
{
    uint32_t count;

    scan->header = read_header(reader);
    scan->angle_min = read_float(reader, "angle_min");
    scan->angle_max = read_float(reader, "angle_max");
    scan->angle_step = read_float(reader, "angle_increment");
    scan->time_step = read_float(reader, "time_increment");
    scan->scan_time = read_float(reader, "scan_time");
    scan->range_min = read_float(reader, "range_min");
    scan->range_max = read_float(reader, "range_max");
    count = (uint32_t)read_unsigned(reader, 4, "ranges");
    if (reader->missing == NULL && count > (size_t)(reader->end - reader->at) / RANGE_BYTES)
        reader->missing = "ranges";
    scan->count = reader->missing == NULL && count <= INT32_MAX ? (int32_t)count : 0;
    return status_of(reader);
}

/* Returns the first echo of a beam. */
static float read_first_echo(cairn_ros_reader *reader)
{
    uint32_t echoes = (uint32_t)read_unsigned(reader, 4, "ranges");
    float first = NAN;

    for (uint32_t i = 0; i < echoes && reader->missing == NULL; i++) {
        float echo = read_float(reader, "ranges");

        first = i == 0 ? echo : first;
    }
    return first;
}

cairn_status cairn_ros_read_ranges(cairn_ros_reader *reader, int32_t first_echo, float *range,
                                   int32_t count)
{
    for (int32_t i = 0; i < count; i++)
        range[i] = first_echo ? read_first_echo(reader) : read_float(reader, "ranges");
    return status_of(reader);
}

/* Reads a position and a quaternion, which is normalized. */
static cairn_status read_pose(cairn_ros_reader *reader, cairn_ros_transform *transform)
{
    double *q = transform->rotation, norm;

    for (int i = 0; i < 3; i++)
        transform->translation[i] = read_double(reader, "the position");
    for (int i = 0; i < 4; i++)
        q[i] = read_double(reader, "the orientation");
    if (reader->missing != NULL)
        return CAIRN_TRUNCATED;
    norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int i = 0; i < 3; i++)
        if (!(fabs(transform->translation[i]) <= 1e9))
            return CAIRN_NOT_FINITE;
    if (!(norm > 1e-6 && norm < 1e6))
        return CAIRN_NOT_FINITE;
    /* a quaternion of norm 1 keeps its bits */
    for (int i = 0; i < 4 && fabs(norm - 1) > 1e-15; i++)
        q[i] /= norm;
    return CAIRN_OK;
}

cairn_status cairn_ros_read_count(cairn_ros_reader *reader, uint32_t *count)
{
    *count = (uint32_t)read_unsigned(reader, 4, "transforms");
    return status_of(reader);
}

cairn_status cairn_ros_read_stamped(cairn_ros_reader *reader, cairn_ros_stamped *stamped)
{
    stamped->header = read_header(reader);
    stamped->child = read_text(reader, "child_frame_id");
    return read_pose(reader, &stamped->transform);
}
