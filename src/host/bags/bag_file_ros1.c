/* Reader of bags of ROS 1, format 2.0.
 *
 * Layout: a line "#ROSBAG V2.0", then records: the length of a header and its fields (length,
 * name=value), the length of the data and the data. Chunks hold connections, which name topics, and
 * messages. Indexes are skipped.
 *
 * Limits: headers of 1 MiB; encrypted bags are refused.
 *
 * Source: "Bags Version 2.0", wiki.ros.org/Bags/Format/2.0. */
#include "src/base/build.h"

#include <inttypes.h>
#include <string.h>

#include "src/host/bags/bag_file_work.h"

static const char first_line[] = "#ROSBAG V2.0\n";

/* Bytes of a length. */
enum { LENGTH_BYTES = 4 };
static const uint32_t MAX_HEADER_BYTES = 1024 * 1024;

/* The field `op`. */
enum { OP_MESSAGE = 2, OP_BAG = 3, OP_CHUNK = 5, OP_CONNECTION = 7 };

/* The fields of a header that are read. */
typedef struct record_header {
    int32_t op; /* -1: none */
    uint32_t connection, chunk_bytes;
    int64_t time_ns;
    cairn_packing packing;
    cairn_ros_text topic, type;
    int32_t is_encrypted;
} record_header;

static int is_named(cairn_ros_text name, const char *text)
{
    return name.length == strlen(text) && memcmp(name.bytes, text, name.length) == 0;
}

/* Takes a field into the header. */
static void take_field(record_header *header, cairn_ros_text name, const uint8_t *value,
                       size_t length)
{
    cairn_ros_text text = {(const char *)value, length};

    if (is_named(name, "op") && length == 1)
        header->op = value[0];
    else if (is_named(name, "conn") && length == 4)
        header->connection = cairn_bag_u32(value);
    else if (is_named(name, "size") && length == 4)
        header->chunk_bytes = cairn_bag_u32(value);
    else if (is_named(name, "time") && length == 8)
        header->time_ns = (int64_t)cairn_bag_u32(value) * 1000000000 + cairn_bag_u32(value + 4);
    else if (is_named(name, "compression"))
        header->packing = cairn_packing_find(text.bytes, length);
    else if (is_named(name, "topic"))
        header->topic = text;
    else if (is_named(name, "type"))
        header->type = text;
    else if (is_named(name, "encryptor"))
        header->is_encrypted = length > 0;
}

/* Parses fields; 0 when they do not fill the header. */
static int parse_header(record_header *header, const uint8_t *bytes, size_t count)
{
    const uint8_t *equals;

    while (count > 0) {
        cairn_ros_text name;
        size_t length;

        if (count < LENGTH_BYTES || cairn_bag_u32(bytes) > count - LENGTH_BYTES)
            return 0;
        length = cairn_bag_u32(bytes);
        bytes += LENGTH_BYTES;
        equals = length > 0 ? memchr(bytes, '=', length) : NULL;
        if (equals == NULL)
            return 0;
        name.bytes = (const char *)bytes;
        name.length = (size_t)(equals - bytes);
        take_field(header, name, equals + 1, length - name.length - 1);
        bytes += length;
        count -= length + LENGTH_BYTES;
    }
    return 1;
}

/* A record in the file or a chunk. */
typedef struct bag_record {
    record_header header;
    uint64_t offset, data, data_bytes;
} bag_record;

/* Reads a connection record: the topic is in its header, the type in its data, which have the
 * layout of a header. */
static cairn_status read_connection(cairn_bag_reader *reader, const bag_record *record,
                                    const uint8_t *data)
{
    record_header inner = {.op = -1};

    if (!parse_header(&inner, data, (size_t)record->data_bytes))
        return cairn_bag_report(reader, record->offset, CAIRN_BAD_FORMAT,
                                "a connection whose fields do not fill it, expected name=value");
    if (record->header.topic.bytes == NULL || inner.type.bytes == NULL)
        return cairn_bag_report(reader, record->offset, CAIRN_BAD_FORMAT,
                                "a connection without topic or type, expected both");
    return cairn_bag_add_topic(reader, record->header.connection, CAIRN_ROS_ENCODING_ROS1,
                               record->header.topic, inner.type);
}

/* Reads a record other than a chunk. The topic of its header is in the source's window: it is
 * copied before the window moves. */
static cairn_status read_small(cairn_bag_reader *reader, cairn_bag_source *source,
                               const bag_record *record)
{
    const uint8_t *data;

    if (record->header.is_encrypted)
        return cairn_file_error_set(reader->error, CAIRN_UNSUPPORTED, reader->path, 0,
                                    "an encrypted bag, expected one that is not");
    if (record->header.op != OP_MESSAGE && record->header.op != OP_CONNECTION)
        return CAIRN_OK;
    data = cairn_bag_fetch(source, record->data, record->data_bytes);
    if (data == NULL)
        return cairn_bag_report_cut(reader, record->offset, record->data_bytes, 0);
    return record->header.op == OP_CONNECTION
               ? read_connection(reader, record, data)
               : cairn_bag_pass(reader, record->offset, record->header.connection,
                                record->header.time_ns, data, record->data_bytes);
}

/* Parses the record at an offset. *found 0: the source ends within its lengths or header, or the
 * header is damaged, and no record can be found behind it. A connection's header is fetched
 * together with its data, so that both are in one window. */
static cairn_status find_record(cairn_bag_reader *reader, cairn_bag_source *source, uint64_t offset,
                                bag_record *record, int *found)
{
    uint64_t left = source->size - offset, length;
    const uint8_t *bytes = cairn_bag_fetch(source, offset, LENGTH_BYTES);

    *found = 0;
    memset(record, 0, sizeof *record);
    record->header.op = -1;
    record->offset = offset;
    if (bytes == NULL)
        return cairn_bag_report_cut(reader, offset, LENGTH_BYTES, left);
    length = cairn_bag_u32(bytes);
    if (length > MAX_HEADER_BYTES)
        return cairn_bag_report(reader, offset, CAIRN_BAD_FORMAT,
                                "a header of %" PRIu64 " bytes, expected at most %" PRIu32
                                ": what follows is left out",
                                length, MAX_HEADER_BYTES);
    bytes = cairn_bag_fetch(source, offset, 2 * LENGTH_BYTES + length);
    if (bytes == NULL)
        return cairn_bag_report_cut(reader, offset, 2 * LENGTH_BYTES + length, left);
    record->data = offset + 2 * LENGTH_BYTES + length;
    record->data_bytes = cairn_bag_u32(bytes + LENGTH_BYTES + length);
    if (record->data_bytes <= source->size - record->data &&
        record->data_bytes <= CAIRN_BAG_MAX_CHUNK)
        bytes = cairn_bag_fetch(source, offset, 2 * LENGTH_BYTES + length + record->data_bytes);
    if (bytes == NULL)
        return cairn_bag_report_cut(reader, offset, record->data_bytes, 0);
    if (!parse_header(&record->header, bytes + LENGTH_BYTES, (size_t)length))
        return cairn_bag_report(reader, offset, CAIRN_BAD_FORMAT,
                                "a header whose fields do not fill it, expected name=value: what "
                                "follows is left out");
    *found = 1;
    return CAIRN_OK;
}

/* Reads the records of a chunk in memory. */
static cairn_status read_chunk_records(cairn_bag_reader *reader, const uint8_t *bytes, size_t count)
{
    cairn_bag_source memory = {.memory = bytes, .size = count};
    cairn_status status = CAIRN_OK;
    bag_record record;
    int found = 1;

    for (uint64_t at = 0; at < count && status == CAIRN_OK && found;
         at = record.data + record.data_bytes) {
        status = find_record(reader, &memory, at, &record, &found);
        if (!found || status != CAIRN_OK)
            break;
        if (record.data_bytes > count - record.data)
            return cairn_bag_report_cut(reader, at, record.data_bytes, count - record.data);
        if (record.header.op != OP_CHUNK)
            status = read_small(reader, &memory, &record);
    }
    return status;
}

/* Reads a chunk, or as much of it as the file has. */
static cairn_status read_chunk(cairn_bag_reader *reader, const bag_record *record)
{
    uint64_t left = reader->source.size - record->data;
    uint64_t count = record->data_bytes < left ? record->data_bytes : left;
    const uint8_t *bytes;
    cairn_status status = CAIRN_OK;

    if (record->data_bytes > CAIRN_BAG_MAX_CHUNK)
        return cairn_bag_report(reader, record->offset, CAIRN_FULL,
                                "a chunk of %" PRIu64 " bytes, expected at most %" PRIu64
                                ": it is left out",
                                record->data_bytes, CAIRN_BAG_MAX_CHUNK);
    bytes = cairn_bag_fetch(&reader->source, record->data, count);
    if (bytes == NULL)
        return cairn_bag_report_cut(reader, record->offset, record->data_bytes, left);
    if (record->header.packing != CAIRN_PACKING_NONE) {
        status = cairn_bag_unpack_chunk(reader, record->offset, record->header.packing, bytes,
                                        count, record->header.chunk_bytes);
        bytes = reader->chunk.bytes;
        count = reader->chunk.count;
    }
    if (status != CAIRN_OK || count == 0)
        return status;
    reader->in_chunk = 1;
    reader->chunk_offset = record->offset;
    status = read_chunk_records(reader, bytes, (size_t)count);
    reader->in_chunk = 0;
    return status;
}

/* Reads the last record of a cut file: what there is of a chunk. The cut is reported once. */
static cairn_status read_cut(cairn_bag_reader *reader, const bag_record *record)
{
    int64_t faults = reader->faults;
    cairn_status status = record->header.op == OP_CHUNK ? read_chunk(reader, record) : CAIRN_OK;

    return status != CAIRN_OK || reader->faults > faults
               ? status
               : cairn_bag_report_cut(reader, record->offset, record->data_bytes,
                                      reader->source.size - record->data);
}

cairn_status cairn_bag_read_ros1(cairn_bag_reader *reader)
{
    cairn_bag_source *source = &reader->source;
    const uint8_t *bytes = cairn_bag_fetch(source, 0, sizeof first_line - 1);
    cairn_status status = CAIRN_OK;
    bag_record record;
    int found = 1;

    if (bytes == NULL || memcmp(bytes, first_line, sizeof first_line - 1) != 0)
        return cairn_file_error_set(reader->error, CAIRN_UNSUPPORTED, reader->path, 0,
                                    "a bag of another version, expected #ROSBAG V2.0");
    for (uint64_t at = sizeof first_line - 1; at < source->size && status == CAIRN_OK && found;
         at = record.data + record.data_bytes) {
        status = find_record(reader, source, at, &record, &found);
        if (!found || status != CAIRN_OK)
            break;
        if (record.data_bytes > source->size - record.data)
            return read_cut(reader, &record);
        status = record.header.op == OP_CHUNK ? read_chunk(reader, &record)
                                              : read_small(reader, source, &record);
    }
    return status;
}
