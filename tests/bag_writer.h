/* Writes bags of ROS for tests: messages in ROS 1's serialization or CDR, and recordings of them in
 * every container. The containers are written with as little as their formats allow: no indexes. */
#ifndef CAIRN_TESTS_BAG_WRITER_H
#define CAIRN_TESTS_BAG_WRITER_H

#include "tests/files.h"

#ifdef CAIRN_HAVE_BZ2
#include <bzlib.h>
#endif
#ifdef CAIRN_HAVE_LZ4
#include <lz4frame.h>
#endif
#ifdef CAIRN_HAVE_SQLITE
#include <sqlite3.h>
#endif
#ifdef CAIRN_HAVE_ZSTD
#include <zstd.h>
#endif
#include <zlib.h>

/* ---- Bytes ---- */

typedef struct bag_bytes {
    uint8_t *data; /* [count] of [capacity] */
    size_t count, capacity;
} bag_bytes;

static inline void bag_put(bag_bytes *bytes, const void *data, size_t count)
{
    if (bytes->capacity - bytes->count < count) {
        bytes->capacity = 2 * (bytes->count + count);
        bytes->data = realloc(bytes->data, bytes->capacity);
        assert_non_null(bytes->data);
    }
    if (count > 0)
        memcpy(bytes->data + bytes->count, data, count);
    bytes->count += count;
}

static inline void bag_free(bag_bytes *bytes)
{
    free(bytes->data);
    memset(bytes, 0, sizeof *bytes);
}

/* A number of the containers, which are little-endian. */
static inline void bag_put_number(bag_bytes *bytes, uint64_t value, size_t count)
{
    uint8_t byte[8];

    for (size_t i = 0; i < count; i++)
        byte[i] = (uint8_t)(value >> 8 * i);
    bag_put(bytes, byte, count);
}

/* A length of 4 bytes and the text. */
static inline void bag_put_text(bag_bytes *bytes, const char *text)
{
    bag_put_number(bytes, strlen(text), 4);
    bag_put(bytes, text, strlen(text));
}

/* ---- Messages ---- */

typedef enum bag_encoding { BAG_ROS1, BAG_CDR_LITTLE, BAG_CDR_BIG } bag_encoding;

/* A message that is being written. */
typedef struct bag_message {
    bag_encoding encoding;
    bag_bytes bytes;
} bag_message;

static inline bag_message bag_begin(bag_encoding encoding)
{
    bag_message message = {encoding, {NULL, 0, 0}};
    const uint8_t encapsulation[4] = {0, encoding == BAG_CDR_LITTLE, 0, 0};

    if (encoding != BAG_ROS1)
        bag_put(&message.bytes, encapsulation, sizeof encapsulation);
    return message;
}

static inline void bag_unsigned(bag_message *message, uint64_t value, size_t count)
{
    static const uint8_t zero[8];
    uint8_t byte[8];

    if (message->encoding != BAG_ROS1)
        bag_put(&message->bytes, zero, (count - (message->bytes.count - 4) % count) % count);
    for (size_t i = 0; i < count; i++)
        byte[i] = (uint8_t)(value >> 8 * (message->encoding == BAG_CDR_BIG ? count - 1 - i : i));
    bag_put(&message->bytes, byte, count);
}

static inline void bag_float(bag_message *message, float value)
{
    uint32_t bits;

    memcpy(&bits, &value, sizeof bits);
    bag_unsigned(message, bits, sizeof bits);
}

static inline void bag_double(bag_message *message, double value)
{
    uint64_t bits;

    memcpy(&bits, &value, sizeof bits);
    bag_unsigned(message, bits, sizeof bits);
}

static inline void bag_text(bag_message *message, const char *text)
{
    size_t count = strlen(text) + (message->encoding != BAG_ROS1);

    bag_unsigned(message, count, 4);
    bag_put(&message->bytes, text, count);
}

static inline void bag_header(bag_message *message, int64_t stamp_ns, const char *frame)
{
    if (message->encoding == BAG_ROS1)
        bag_unsigned(message, 7, 4);
    bag_unsigned(message, (uint64_t)(stamp_ns / 1000000000), 4);
    bag_unsigned(message, (uint64_t)(stamp_ns % 1000000000), 4);
    bag_text(message, frame);
}

/* A LaserScan; or a MultiEchoLaserScan, of which beam i has i echoes, the first being range[i]. */
typedef struct bag_scan {
    int64_t stamp_ns;
    const char *frame;
    float angle_min, angle_step, time_step, range_min, range_max;
    const float *range;
    int count;
    int is_multi_echo;
} bag_scan;

static inline bag_bytes bag_laser_scan(bag_encoding encoding, const bag_scan *scan)
{
    bag_message message = bag_begin(encoding);

    bag_header(&message, scan->stamp_ns, scan->frame);
    bag_float(&message, scan->angle_min);
    bag_float(&message, scan->angle_min + scan->angle_step * (float)(scan->count - 1));
    bag_float(&message, scan->angle_step);
    bag_float(&message, scan->time_step);
    bag_float(&message, 0.1F);
    bag_float(&message, scan->range_min);
    bag_float(&message, scan->range_max);
    bag_unsigned(&message, (uint64_t)scan->count, 4);
    for (int i = 0; i < scan->count; i++) {
        int echoes = scan->is_multi_echo ? i : 1;

        if (scan->is_multi_echo)
            bag_unsigned(&message, (uint64_t)echoes, 4);
        for (int k = 0; k < echoes; k++)
            bag_float(&message, scan->range[i] + (float)k);
    }
    bag_unsigned(&message, 0, 4);
    return message.bytes;
}

/* A transform: x, y, z and the quaternion x, y, z, w. */
typedef struct bag_transform {
    int64_t stamp_ns;
    const char *parent, *child;
    double pose[7];
} bag_transform;

static inline void bag_stamped(bag_message *message, const bag_transform *transform)
{
    bag_header(message, transform->stamp_ns, transform->parent);
    bag_text(message, transform->child);
    for (int i = 0; i < 7; i++)
        bag_double(message, transform->pose[i]);
}

static inline bag_bytes bag_odometry(bag_encoding encoding, const bag_transform *pose)
{
    bag_message message = bag_begin(encoding);

    bag_stamped(&message, pose);
    for (int i = 0; i < 36 + 6 + 36; i++)
        bag_double(&message, 0);
    return message.bytes;
}

static inline bag_bytes bag_transforms(bag_encoding encoding, const bag_transform *transform,
                                       int count)
{
    bag_message message = bag_begin(encoding);

    bag_unsigned(&message, (uint64_t)count, 4);
    for (int i = 0; i < count; i++)
        bag_stamped(&message, &transform[i]);
    return message.bytes;
}

/* ---- Recordings ---- */

enum { BAG_TOPICS = 8, BAG_MESSAGES = 64 };

typedef struct bag_recording {
    bag_encoding encoding;
    struct {
        const char *name, *type; /* "sensor_msgs/LaserScan" */
    } topic[BAG_TOPICS];
    int topics;
    struct {
        int topic;
        int64_t time_ns;
        bag_bytes bytes;
    } message[BAG_MESSAGES];
    int messages;
} bag_recording;

static inline int bag_topic(bag_recording *recording, const char *name, const char *type)
{
    assert_true(recording->topics < BAG_TOPICS);
    recording->topic[recording->topics].name = name;
    recording->topic[recording->topics].type = type;
    return recording->topics++;
}

/* Appends a message, whose bytes then belong to the recording. */
static inline void bag_record(bag_recording *recording, int topic, int64_t time_ns, bag_bytes bytes)
{
    assert_true(recording->messages < BAG_MESSAGES);
    recording->message[recording->messages].topic = topic;
    recording->message[recording->messages].time_ns = time_ns;
    recording->message[recording->messages++].bytes = bytes;
}

static inline void bag_recording_free(bag_recording *recording)
{
    for (int i = 0; i < recording->messages; i++)
        bag_free(&recording->message[i].bytes);
    memset(recording, 0, sizeof *recording);
}

/* ---- Compression ---- */

typedef enum bag_packing { BAG_NONE, BAG_LZ4, BAG_BZ2, BAG_ZSTD } bag_packing;

static const char *const bag_packing_name[] = {"none", "lz4", "bz2", "zstd"};

/* 1 when this build compresses the format. */
static inline int bag_packs(bag_packing packing)
{
#ifdef CAIRN_HAVE_LZ4
    if (packing == BAG_LZ4)
        return 1;
#endif
#ifdef CAIRN_HAVE_BZ2
    if (packing == BAG_BZ2)
        return 1;
#endif
#ifdef CAIRN_HAVE_ZSTD
    if (packing == BAG_ZSTD)
        return 1;
#endif
    return packing == BAG_NONE;
}

static inline bag_bytes bag_pack(bag_packing packing, const bag_bytes *plain)
{
    bag_bytes packed = {NULL, 0, 0};
    size_t space = 2 * plain->count + 1024;

    if (packing == BAG_NONE) {
        bag_put(&packed, plain->data, plain->count);
        return packed;
    }
    packed.data = malloc(space);
    assert_non_null(packed.data);
    packed.capacity = space;
#ifdef CAIRN_HAVE_LZ4
    if (packing == BAG_LZ4)
        packed.count = LZ4F_compressFrame(packed.data, space, plain->data, plain->count, NULL);
#endif
#ifdef CAIRN_HAVE_BZ2
    if (packing == BAG_BZ2) {
        unsigned count = (unsigned)space;

        assert_int_equal(BZ2_bzBuffToBuffCompress((char *)packed.data, &count, (char *)plain->data,
                                                  (unsigned)plain->count, 9, 0, 0),
                         BZ_OK);
        packed.count = count;
    }
#endif
#ifdef CAIRN_HAVE_ZSTD
    if (packing == BAG_ZSTD)
        packed.count = ZSTD_compress(packed.data, space, plain->data, plain->count, 3);
#endif
    assert_in_range(packed.count, 1, space);
    return packed;
}

/* ---- Containers ---- */

/* A field of a header of ROS 1's bags. */
static inline void bag_field(bag_bytes *header, const char *name, const void *value, size_t count)
{
    bag_put_number(header, strlen(name) + 1 + count, 4);
    bag_put(header, name, strlen(name));
    bag_put(header, "=", 1);
    bag_put(header, value, count);
}

static inline void bag_field_number(bag_bytes *header, const char *name, uint64_t value,
                                    size_t count)
{
    bag_bytes number = {NULL, 0, 0};

    bag_put_number(&number, value, count);
    bag_field(header, name, number.data, count);
    bag_free(&number);
}

/* Appends a record and frees its parts. */
static inline void bag_ros1_record(bag_bytes *file, bag_bytes *header, bag_bytes *data)
{
    bag_put_number(file, header->count, 4);
    bag_put(file, header->data, header->count);
    bag_put_number(file, data->count, 4);
    bag_put(file, data->data, data->count);
    bag_free(header);
    bag_free(data);
}

/* A bag of ROS 1 of one chunk. */
static inline bag_bytes bag_write_ros1(const bag_recording *recording, bag_packing packing)
{
    bag_bytes file = {NULL, 0, 0}, chunk = {NULL, 0, 0}, header = {NULL, 0, 0}, data = {NULL, 0, 0};

    for (int i = 0; i < recording->topics; i++) {
        bag_field_number(&header, "op", 7, 1);
        bag_field_number(&header, "conn", (uint64_t)i, 4);
        bag_field(&header, "topic", recording->topic[i].name, strlen(recording->topic[i].name));
        bag_field(&data, "topic", recording->topic[i].name, strlen(recording->topic[i].name));
        bag_field(&data, "type", recording->topic[i].type, strlen(recording->topic[i].type));
        bag_ros1_record(&chunk, &header, &data);
    }
    for (int i = 0; i < recording->messages; i++) {
        int64_t time = recording->message[i].time_ns;

        bag_field_number(&header, "op", 2, 1);
        bag_field_number(&header, "conn", (uint64_t)recording->message[i].topic, 4);
        bag_field_number(&header, "time",
                         (uint64_t)(time / 1000000000) | (uint64_t)(time % 1000000000) << 32, 8);
        bag_put(&data, recording->message[i].bytes.data, recording->message[i].bytes.count);
        bag_ros1_record(&chunk, &header, &data);
    }
    bag_put(&file, "#ROSBAG V2.0\n", 13);
    bag_field_number(&header, "op", 3, 1);
    bag_field_number(&header, "index_pos", 0, 8);
    bag_ros1_record(&file, &header, &data);
    bag_field_number(&header, "op", 5, 1);
    bag_field(&header, "compression", bag_packing_name[packing], strlen(bag_packing_name[packing]));
    bag_field_number(&header, "size", chunk.count, 4);
    data = bag_pack(packing, &chunk);
    bag_ros1_record(&file, &header, &data);
    /* an index, which is to be read past */
    bag_field_number(&header, "op", 4, 1);
    bag_put_number(&data, 0, 8);
    bag_ros1_record(&file, &header, &data);
    bag_free(&chunk);
    return file;
}

/* Appends a record of MCAP and frees its content. */
static inline void bag_mcap_record(bag_bytes *file, int op, bag_bytes *content)
{
    bag_put_number(file, (uint64_t)op, 1);
    bag_put_number(file, content->count, 8);
    bag_put(file, content->data, content->count);
    bag_free(content);
}

/* "package/Name" as ROS 2 names it: "package/msg/Name". */
static inline const char *bag_ros2_type(const char *type, char name[64])
{
    const char *slash = strchr(type, '/');

    (void)snprintf(name, 64, "%.*s/msg%s", (int)(slash - type), type, slash);
    return name;
}

/* An MCAP file; chunked 0: its messages are in no chunk. */
static inline bag_bytes bag_write_mcap(const bag_recording *recording, bag_packing packing,
                                       int chunked)
{
    bag_bytes file = {NULL, 0, 0}, records = {NULL, 0, 0}, content = {NULL, 0, 0}, packed;
    const char *encoding = recording->encoding == BAG_ROS1 ? "ros1" : "cdr";
    char name[64];

    bag_put(&file, "\x89MCAP0\r\n", 8);
    bag_put_text(&content, "ros2");
    bag_put_text(&content, "tests");
    bag_mcap_record(&file, 1, &content);
    for (int i = 0; i < recording->topics; i++) {
        const char *type = recording->topic[i].type;

        bag_put_number(&content, (uint64_t)i + 1, 2);
        bag_put_text(&content, recording->encoding == BAG_ROS1 ? type : bag_ros2_type(type, name));
        bag_put_text(&content, recording->encoding == BAG_ROS1 ? "ros1msg" : "ros2msg");
        bag_put_text(&content, "");
        bag_mcap_record(&records, 3, &content);
        bag_put_number(&content, (uint64_t)i, 2);
        bag_put_number(&content, (uint64_t)i + 1, 2);
        bag_put_text(&content, recording->topic[i].name);
        bag_put_text(&content, encoding);
        bag_put_number(&content, 0, 4);
        bag_mcap_record(&records, 4, &content);
    }
    for (int i = 0; i < recording->messages; i++) {
        bag_put_number(&content, (uint64_t)recording->message[i].topic, 2);
        bag_put_number(&content, (uint64_t)i, 4);
        bag_put_number(&content, (uint64_t)recording->message[i].time_ns, 8);
        bag_put_number(&content, (uint64_t)recording->message[i].time_ns, 8);
        bag_put(&content, recording->message[i].bytes.data, recording->message[i].bytes.count);
        bag_mcap_record(&records, 5, &content);
    }
    if (chunked) {
        packed = bag_pack(packing, &records);
        bag_put_number(&content, 0, 8);
        bag_put_number(&content, 0, 8);
        bag_put_number(&content, records.count, 8);
        bag_put_number(&content, crc32(0, records.data, (uInt)records.count), 4);
        bag_put_text(&content, packing == BAG_NONE ? "" : bag_packing_name[packing]);
        bag_put_number(&content, packed.count, 8);
        bag_put(&content, packed.data, packed.count);
        bag_mcap_record(&file, 6, &content);
        bag_free(&packed);
    } else {
        bag_put(&file, records.data, records.count);
    }
    bag_put_number(&content, 0, 4);
    bag_mcap_record(&file, 15, &content);
    bag_put_number(&content, 0, 8);
    bag_put_number(&content, 0, 8);
    bag_put_number(&content, 0, 4);
    bag_mcap_record(&file, 2, &content);
    bag_put(&file, "\x89MCAP0\r\n", 8);
    bag_free(&records);
    return file;
}

#ifdef CAIRN_HAVE_SQLITE
/* A database of ROS 2, its messages compressed one by one with packing BAG_ZSTD. */
static inline bag_bytes bag_write_sqlite(const bag_recording *recording, bag_packing packing)
{
    const char *path = files_path("writing.db3");
    sqlite3 *database;
    sqlite3_stmt *insert;
    bag_bytes file = {NULL, 0, 0};
    char name[64];

    (void)remove(path);
    assert_int_equal(sqlite3_open(path, &database), SQLITE_OK);
    assert_int_equal(
        sqlite3_exec(database,
                     "CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT "
                     "NULL,serialization_format TEXT NOT NULL,offered_qos_profiles TEXT NOT NULL);"
                     "CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT "
                     "NULL,timestamp INTEGER NOT NULL,data BLOB NOT NULL);"
                     "PRAGMA synchronous=OFF;BEGIN",
                     NULL, NULL, NULL),
        SQLITE_OK);
    for (int i = 0; i < recording->topics; i++) {
        assert_int_equal(sqlite3_prepare_v2(database, "INSERT INTO topics VALUES(?,?,?,'cdr','')",
                                            -1, &insert, NULL),
                         SQLITE_OK);
        sqlite3_bind_int(insert, 1, i + 1);
        sqlite3_bind_text(insert, 2, recording->topic[i].name, -1, SQLITE_TRANSIENT);
        sqlite3_bind_text(insert, 3, bag_ros2_type(recording->topic[i].type, name), -1,
                          SQLITE_TRANSIENT);
        assert_int_equal(sqlite3_step(insert), SQLITE_DONE);
        sqlite3_finalize(insert);
    }
    for (int i = 0; i < recording->messages; i++) {
        bag_bytes packed = bag_pack(packing, &recording->message[i].bytes);

        assert_int_equal(sqlite3_prepare_v2(database,
                                            "INSERT INTO messages(topic_id,timestamp,data) "
                                            "VALUES(?,?,?)",
                                            -1, &insert, NULL),
                         SQLITE_OK);
        sqlite3_bind_int(insert, 1, recording->message[i].topic + 1);
        sqlite3_bind_int64(insert, 2, recording->message[i].time_ns);
        sqlite3_bind_blob(insert, 3, packed.data, (int)packed.count, SQLITE_TRANSIENT);
        assert_int_equal(sqlite3_step(insert), SQLITE_DONE);
        sqlite3_finalize(insert);
        bag_free(&packed);
    }
    assert_int_equal(sqlite3_exec(database, "COMMIT", NULL, NULL, NULL), SQLITE_OK);
    sqlite3_close(database);
    file.data = (uint8_t *)files_read(path, &file.count);
    assert_non_null(file.data);
    file.capacity = file.count;
    return file;
}
#endif

#endif
