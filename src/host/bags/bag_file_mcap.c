/* Reader of MCAP files, as ROS 2 (CDR) and converters of ROS 1 write them.
 *
 * Layout: magic bytes, then records: an opcode, the length of the content and the content. A schema
 * names a type, a channel a topic, its schema and the serialization. Messages follow by themselves
 * or in chunks, which may be compressed. The end of the data ends the reading: indexes and the
 * summary behind it are not needed.
 *
 * Limits: a chunk whose checksum differs is left out. Channels of other serializations are counted
 * only.
 *
 * Source: mcap.dev/spec. */
#include "src/base/build.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "src/host/bags/bag_file_work.h"

/* The file begins and ends with 0x89 "MCAP0\r\n". */
enum { MAGIC_BYTES = 8 };

/* Opcodes. */
enum {
    OP_FOOTER = 0x02,
    OP_SCHEMA = 0x03,
    OP_CHANNEL = 0x04,
    OP_MESSAGE = 0x05,
    OP_CHUNK = 0x06,
    OP_DATA_END = 0x0f
};

/* Bytes of an opcode with its length, and of a message before its data. */
enum { RECORD_HEAD = 9, MESSAGE_HEAD = 22 };

/* The name of a type by its id. */
typedef struct mcap_schema {
    uint32_t id;
    char *name;
} mcap_schema;

typedef struct mcap_reader {
    cairn_bag_reader *bag;
    mcap_schema *schema; /* [count] of [capacity] */
    int32_t count, capacity;
    int32_t at_end; /* the data have ended */
} mcap_reader;

/* The unread content of a record. After a field that does not fit, `bad` is set and further reads
 * return 0. */
typedef struct mcap_content {
    const uint8_t *at, *end;
    int bad;
} mcap_content;

static uint64_t read_number(mcap_content *content, size_t bytes)
{
    uint64_t value = 0;

    if (content->bad || (size_t)(content->end - content->at) < bytes) {
        content->bad = 1;
        return 0;
    }
    for (size_t i = 0; i < bytes; i++)
        value |= (uint64_t)content->at[i] << 8 * i;
    content->at += bytes;
    return value;
}

static cairn_ros_text read_text(mcap_content *content)
{
    size_t length = (size_t)read_number(content, 4);
    cairn_ros_text text = {"", 0};

    if (content->bad || (size_t)(content->end - content->at) < length) {
        content->bad = 1;
        return text;
    }
    text.bytes = (const char *)content->at;
    text.length = length;
    content->at += length;
    return text;
}

static int is_text(cairn_ros_text text, const char *word)
{
    return text.length == strlen(word) && memcmp(text.bytes, word, text.length) == 0;
}

static cairn_status no_memory(const mcap_reader *reader)
{
    return cairn_file_error_system(reader->bag->error, reader->bag->path, "read", ENOMEM);
}

/* Appends a schema. */
static cairn_status add_schema(mcap_reader *reader, uint32_t id, cairn_ros_text name)
{
    mcap_schema *grown;
    char *copy;

    if (reader->count == CAIRN_BAG_MAX_TOPICS)
        return cairn_file_error_set(reader->bag->error, CAIRN_FULL, reader->bag->path, 0,
                                    "more than %d schemas, expected at most that",
                                    CAIRN_BAG_MAX_TOPICS);
    if (reader->count == reader->capacity) {
        reader->capacity = 2 * reader->capacity + 16;
        grown = realloc(reader->schema, (size_t)reader->capacity * sizeof *grown);
        if (grown == NULL)
            return no_memory(reader);
        reader->schema = grown;
    }
    copy = malloc(name.length + 1);
    if (copy == NULL)
        return no_memory(reader);
    memcpy(copy, name.bytes, name.length);
    copy[name.length] = 0;
    reader->schema[reader->count].id = id;
    reader->schema[reader->count++].name = copy;
    return CAIRN_OK;
}

static cairn_status read_schema(mcap_reader *reader, mcap_content *content)
{
    uint32_t id = (uint32_t)read_number(content, 2);
    cairn_ros_text name = read_text(content);

    for (int32_t i = 0; i < reader->count; i++)
        if (reader->schema[i].id == id)
            return CAIRN_OK;
    return content->bad ? CAIRN_OK : add_schema(reader, id, name);
}

static cairn_status read_channel(mcap_reader *reader, mcap_content *content)
{
    uint32_t id = (uint32_t)read_number(content, 2), schema = (uint32_t)read_number(content, 2);
    cairn_ros_text topic = read_text(content), encoding = read_text(content), type = encoding;
    int is_ros1 = is_text(encoding, "ros1");

    if (content->bad)
        return CAIRN_OK;
    /* a type is known only of the serializations that can be decoded */
    for (int32_t i = 0; i < reader->count && (is_ros1 || is_text(encoding, "cdr")); i++)
        if (reader->schema[i].id == schema) {
            type.bytes = reader->schema[i].name;
            type.length = strlen(reader->schema[i].name);
        }
    return cairn_bag_add_topic(
        reader->bag, id, is_ros1 ? CAIRN_ROS_ENCODING_ROS1 : CAIRN_ROS_ENCODING_CDR, topic, type);
}

static cairn_status read_message(mcap_reader *reader, uint64_t offset, mcap_content *content)
{
    uint32_t id = (uint32_t)read_number(content, 2);
    uint64_t time;

    (void)read_number(content, 4);
    time = read_number(content, 8);
    (void)read_number(content, 8);
    if (content->bad)
        return CAIRN_OK;
    return cairn_bag_pass(reader->bag, offset, id, (int64_t)(time <= INT64_MAX ? time : INT64_MAX),
                          content->at, (uint64_t)(content->end - content->at));
}

/* Reads the content of a record other than a chunk. */
static cairn_status read_small(mcap_reader *reader, uint64_t offset, int op, const uint8_t *bytes,
                               uint64_t count)
{
    mcap_content content = {bytes, bytes + count, 0};
    cairn_status status = CAIRN_OK;

    if (op == OP_SCHEMA)
        status = read_schema(reader, &content);
    else if (op == OP_CHANNEL)
        status = read_channel(reader, &content);
    else if (op == OP_MESSAGE)
        status = read_message(reader, offset, &content);
    if (status == CAIRN_OK && content.bad)
        status = cairn_bag_report(reader->bag, offset, CAIRN_BAD_FORMAT,
                                  "a record of %" PRIu64 " bytes, of which its fields need more, "
                                  "expected fields that fit: it is left out",
                                  count);
    return status;
}

/* Reads the records of a chunk in memory. */
static cairn_status read_chunk_records(mcap_reader *reader, const uint8_t *bytes, uint64_t count)
{
    cairn_status status = CAIRN_OK;
    uint64_t at = 0, length;

    for (; at < count && status == CAIRN_OK; at += RECORD_HEAD + length) {
        if (count - at < RECORD_HEAD)
            return cairn_bag_report_cut(reader->bag, at, RECORD_HEAD, count - at);
        length = cairn_bag_u64(bytes + at + 1);
        if (length > count - at - RECORD_HEAD)
            return cairn_bag_report_cut(reader->bag, at, length, count - at - RECORD_HEAD);
        status = read_small(reader, at, bytes[at], bytes + at + RECORD_HEAD, length);
    }
    return status;
}

/* Decompresses the records of a chunk if necessary. *whole: all of the chunk is in the file. */
static cairn_status open_chunk(mcap_reader *reader, uint64_t offset, mcap_content *content,
                               int whole)
{
    cairn_bag_reader *bag = reader->bag;
    uint64_t declared, count;
    uint32_t checksum;
    cairn_ros_text name;
    cairn_status status = CAIRN_OK;

    (void)read_number(content, 8);
    (void)read_number(content, 8);
    declared = read_number(content, 8);
    checksum = (uint32_t)read_number(content, 4);
    name = read_text(content);
    count = read_number(content, 8);
    if (content->bad || (whole && count != (uint64_t)(content->end - content->at))) {
        content->at = content->end;
        return cairn_bag_report(bag, offset, CAIRN_BAD_FORMAT,
                                "a chunk whose fields do not fill it, expected records of its "
                                "size: it is left out");
    }
    if (name.length > 0 && cairn_packing_find(name.bytes, name.length) != CAIRN_PACKING_NONE) {
        status =
            cairn_bag_unpack_chunk(bag, offset, cairn_packing_find(name.bytes, name.length),
                                   content->at, (uint64_t)(content->end - content->at), declared);
        content->at = bag->chunk.bytes;
        content->end = bag->chunk.bytes + bag->chunk.count;
    }
    count = (uint64_t)(content->end - content->at);
    if (status == CAIRN_OK && whole && checksum != 0 && count == declared &&
        crc32_z(0, content->at, (size_t)count) != checksum) {
        content->at = content->end;
        status = cairn_bag_report(bag, offset, CAIRN_BAD_FORMAT,
                                  "a chunk with another checksum than %08" PRIx32
                                  ", expected the same: it is left out",
                                  checksum);
    }
    return status;
}

/* Reads a chunk of `length` bytes at `data`, or as much of it as the file has. */
static cairn_status read_chunk(mcap_reader *reader, uint64_t offset, uint64_t data, uint64_t length)
{
    cairn_bag_reader *bag = reader->bag;
    uint64_t left = bag->source.size - data, count = length < left ? length : left;
    mcap_content content = {NULL, NULL, 0};
    cairn_status status;

    if (length > CAIRN_BAG_MAX_CHUNK)
        return cairn_bag_report(bag, offset, CAIRN_FULL,
                                "a chunk of %" PRIu64 " bytes, expected at most %" PRIu64
                                ": it is left out",
                                length, CAIRN_BAG_MAX_CHUNK);
    content.at = cairn_bag_fetch(&bag->source, data, count);
    if (content.at == NULL)
        return cairn_bag_report_cut(bag, offset, length, left);
    content.end = content.at + count;
    status = open_chunk(reader, offset, &content, count == length);
    if (status != CAIRN_OK || content.at == content.end)
        return status;
    bag->in_chunk = 1;
    bag->chunk_offset = offset;
    status = read_chunk_records(reader, content.at, (uint64_t)(content.end - content.at));
    bag->in_chunk = 0;
    return status;
}

/* Reads the record at *at and advances behind it, or to UINT64_MAX when the file is cut in it. */
static cairn_status read_record(mcap_reader *reader, uint64_t *at)
{
    cairn_bag_source *source = &reader->bag->source;
    uint64_t offset = *at, data = offset + RECORD_HEAD, length;
    const uint8_t *bytes = cairn_bag_fetch(source, offset, RECORD_HEAD);
    int64_t faults = reader->bag->faults;
    cairn_status status = CAIRN_OK;
    int op;

    *at = UINT64_MAX;
    if (bytes == NULL)
        return cairn_bag_report_cut(reader->bag, offset, RECORD_HEAD, source->size - offset);
    op = bytes[0];
    length = cairn_bag_u64(bytes + 1);
    if (op == OP_DATA_END || op == OP_FOOTER) {
        reader->at_end = 1;
        return CAIRN_OK;
    }
    if (op == OP_CHUNK)
        status = read_chunk(reader, offset, data, length);
    /* the cut of a chunk is reported once */
    if (status != CAIRN_OK || (length > source->size - data && reader->bag->faults > faults))
        return status;
    if (length > source->size - data)
        return cairn_bag_report_cut(reader->bag, offset, length, source->size - data);
    *at = data + length;
    if (op < OP_SCHEMA || op > OP_MESSAGE)
        return CAIRN_OK;
    if (length > CAIRN_BAG_MAX_CHUNK)
        return cairn_bag_report(reader->bag, offset, CAIRN_FULL,
                                "a record of %" PRIu64 " bytes, expected at most %" PRIu64
                                ": it is left out",
                                length, CAIRN_BAG_MAX_CHUNK);
    bytes = cairn_bag_fetch(source, data, length);
    return bytes != NULL ? read_small(reader, offset, op, bytes, length)
                         : cairn_bag_report_cut(reader->bag, offset, length, source->size - data);
}

cairn_status cairn_bag_read_mcap(cairn_bag_reader *bag)
{
    mcap_reader reader = {.bag = bag};
    uint64_t at = MAGIC_BYTES;
    cairn_status status = CAIRN_OK;

    while (at < bag->source.size && status == CAIRN_OK && !reader.at_end)
        status = read_record(&reader, &at);
    if (status == CAIRN_OK && !reader.at_end && at == bag->source.size)
        status = cairn_bag_report(bag, at, CAIRN_TRUNCATED,
                                  "the file ends without an end of its data, expected one: it is "
                                  "cut, or its recording was not ended");
    for (int32_t i = 0; i < reader.count; i++)
        free(reader.schema[i].name);
    free(reader.schema);
    return status;
}
