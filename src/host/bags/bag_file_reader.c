/* Reader of recordings of ROS: what its formats share.
 *
 * Method
 * 1. Bytes are fetched by position, from memory or from a window into the file. The position and the
 *    declared size are compared with the size of the file before anything is read or allocated.
 * 2. A topic is added by its id. Messages of topics that are known are passed on, decompressed when
 *    they were compressed by themselves.
 * 3. A fault is reported with the number and the position of the message.
 *
 * Limits: 256 MiB for a decompressed chunk or message, 4096 topics. */
#include "src/base/build.h"

#include <inttypes.h>
#include <stdarg.h>

#include "src/host/base/interruption.h"
#include "src/host/base/posix.h"
#include "src/host/bags/bag_file_work.h"

/* Bytes that are read at once, at least. */
#define WINDOW_BYTES ((uint64_t)256 * 1024)

/* ---- Bytes ---- */

/* Makes space for `count` bytes in the window; 0 when out of memory. */
static int reserve_window(cairn_bag_source *source, size_t count)
{
    uint8_t *grown;

    if (count <= source->window.capacity)
        return 1;
    grown = realloc(source->window.bytes, count);
    if (grown == NULL)
        return 0;
    source->window.bytes = grown;
    source->window.capacity = count;
    return 1;
}

/* Moves the window to `offset` and fills it with `count` bytes or more. */
static cairn_status fill_window(cairn_bag_source *source, uint64_t offset, uint64_t count)
{
    uint64_t want = count > WINDOW_BYTES ? count : WINDOW_BYTES, left = source->size - offset;

    want = want < left ? want : left;
    if (want > SIZE_MAX || !reserve_window(source, (size_t)want)) {
        source->error_code = ENOMEM;
        return CAIRN_NO_MEMORY;
    }
    source->window_begin = offset;
    source->window.count = 0;
    while (source->window.count < want) {
        ssize_t got =
            pread(source->file, source->window.bytes + source->window.count,
                  (size_t)want - source->window.count, (off_t)(offset + source->window.count));

        if (got < 0) {
            source->error_code = errno;
            return CAIRN_IO;
        }
        if (got == 0) {
            /* the file has become shorter: it ends here */
            source->size = offset + source->window.count;
            break;
        }
        source->window.count += (size_t)got;
    }
    return CAIRN_OK;
}

const uint8_t *cairn_bag_fetch(cairn_bag_source *source, uint64_t offset, uint64_t count)
{
    if (offset > source->size || count > source->size - offset)
        return NULL;
    if (source->memory != NULL)
        return source->memory + offset;
    if (offset < source->window_begin ||
        offset + count > source->window_begin + source->window.count) {
        cairn_status status = fill_window(source, offset, count);

        if (status != CAIRN_OK)
            source->status = status;
        if (status != CAIRN_OK || source->window.count < count)
            return NULL;
    }
    return source->window.bytes + (offset - source->window_begin);
}

uint32_t cairn_bag_u32(const uint8_t *bytes)
{
    return bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

uint64_t cairn_bag_u64(const uint8_t *bytes)
{
    return cairn_bag_u32(bytes) | (uint64_t)cairn_bag_u32(bytes + 4) << 32;
}

/* ---- Faults ---- */

cairn_status cairn_bag_report(cairn_bag_reader *reader, uint64_t offset, cairn_status status,
                              const char *format, ...)
{
    cairn_file_error fault;
    char what[384];
    va_list values;

    if (reader->source.status != CAIRN_OK)
        return cairn_file_error_system(reader->error, reader->path, "read",
                                       reader->source.error_code);
    va_start(values, format);
    (void)vsnprintf(what, sizeof what, format, values);
    va_end(values);
    (void)cairn_file_error_set(
        &fault, status, reader->path, 0, "message %" PRId64 " at %s %" PRIu64 ": %s",
        reader->number + 1, reader->unit, reader->in_chunk ? reader->chunk_offset : offset, what);
    reader->visitor->on_fault(reader->visitor->context, &fault);
    reader->faults++;
    return CAIRN_OK;
}

cairn_status cairn_bag_report_cut(cairn_bag_reader *reader, uint64_t offset, uint64_t size,
                                  uint64_t left)
{
    return cairn_bag_report(reader, offset, CAIRN_TRUNCATED,
                            "a record of %" PRIu64 " bytes, of which %s has %" PRIu64
                            ", expected all: the file is cut",
                            size, reader->in_chunk ? "its chunk" : "the file", left);
}

/* ---- Topics ---- */

/* Returns a copy; NULL when out of memory. */
static char *copy_text(cairn_ros_text text)
{
    char *copy = malloc(text.length + 1);

    if (copy != NULL) {
        memcpy(copy, text.bytes, text.length);
        copy[text.length] = 0;
    }
    return copy;
}

static cairn_bag_topic *find_topic(cairn_bag_reader *reader, uint32_t id)
{
    for (int32_t i = 0; i < reader->topic_count; i++)
        if (reader->topic[i].id == id)
            return &reader->topic[i];
    return NULL;
}

/* Returns a new topic without texts; NULL when out of memory. */
static cairn_bag_topic *new_topic(cairn_bag_reader *reader, uint32_t id)
{
    cairn_bag_topic *grown;

    if (reader->topic_count == reader->topic_capacity) {
        reader->topic_capacity = 2 * reader->topic_capacity + 16;
        grown = realloc(reader->topic, (size_t)reader->topic_capacity * sizeof *grown);
        if (grown == NULL)
            return NULL;
        reader->topic = grown;
    }
    grown = &reader->topic[reader->topic_count++];
    memset(grown, 0, sizeof *grown);
    grown->id = id;
    return grown;
}

cairn_status cairn_bag_add_topic(cairn_bag_reader *reader, uint32_t id, cairn_ros_encoding encoding,
                                 cairn_ros_text name, cairn_ros_text type)
{
    cairn_bag_topic *topic = find_topic(reader, id);

    if (topic == NULL && reader->topic_count == CAIRN_BAG_MAX_TOPICS)
        return cairn_file_error_set(reader->error, CAIRN_FULL, reader->path, 0,
                                    "more than %d topics, expected at most that",
                                    CAIRN_BAG_MAX_TOPICS);
    if (topic == NULL)
        topic = new_topic(reader, id);
    if (topic == NULL)
        return cairn_file_error_system(reader->error, reader->path, "read", ENOMEM);
    free(topic->name);
    free(topic->type);
    topic->encoding = encoding;
    topic->name = copy_text(name);
    topic->type = copy_text(type);
    return topic->name != NULL && topic->type != NULL
               ? CAIRN_OK
               : cairn_file_error_system(reader->error, reader->path, "read", ENOMEM);
}

/* ---- Messages ---- */

/* Decompresses a message that was compressed by itself. */
static cairn_status unpack_message(cairn_bag_reader *reader, cairn_bag_message *message)
{
    cairn_status status = cairn_unpack(CAIRN_PACKING_ZSTD, message->bytes, message->count,
                                       (size_t)CAIRN_BAG_MAX_CHUNK, &reader->message);

    message->bytes = reader->message.bytes;
    message->count = reader->message.count;
    if (status == CAIRN_UNSUPPORTED)
        return cairn_file_error_set(
            reader->error, status, reader->path, 0,
            "messages are compressed by zstd, expected none: this build has no libzstd");
    return status == CAIRN_NO_MEMORY
               ? cairn_file_error_system(reader->error, reader->path, "read", ENOMEM)
               : CAIRN_OK;
}

cairn_status cairn_bag_pass(cairn_bag_reader *reader, uint64_t offset, uint32_t id, int64_t time_ns,
                            const uint8_t *bytes, uint64_t count)
{
    const cairn_bag_topic *topic = find_topic(reader, id);
    cairn_bag_message message = {.path = reader->path,
                                 .unit = reader->unit,
                                 .number = reader->number + 1,
                                 .offset = reader->in_chunk ? reader->chunk_offset : offset,
                                 .time_ns = time_ns,
                                 .bytes = bytes,
                                 .count = (size_t)count};
    cairn_status status = CAIRN_OK;

    if (cairn_interruption_is_requested())
        return CAIRN_MORE;
    if (topic == NULL) {
        status =
            cairn_bag_report(reader, offset, CAIRN_BAD_FORMAT,
                             "of connection %" PRIu32 ", expected one that was named before", id);
    } else {
        message.topic = topic->name;
        message.type = topic->type;
        message.encoding = topic->encoding;
        if (count >= CAIRN_BAG_ZSTD_MAGIC_BYTES && topic->encoding == CAIRN_ROS_ENCODING_CDR &&
            memcmp(bytes, CAIRN_BAG_ZSTD_MAGIC, CAIRN_BAG_ZSTD_MAGIC_BYTES) == 0)
            status = unpack_message(reader, &message);
        if (status == CAIRN_OK)
            status = reader->visitor->on_message(reader->visitor->context, &message);
    }
    reader->number++;
    return status;
}

cairn_status cairn_bag_unpack_chunk(cairn_bag_reader *reader, uint64_t offset,
                                    cairn_packing packing, const uint8_t *bytes, uint64_t count,
                                    uint64_t declared)
{
    const char *library = cairn_packing_library(packing);
    cairn_status status;

    if (!cairn_packing_is_built(packing))
        return cairn_file_error_set(
            reader->error, CAIRN_UNSUPPORTED, reader->path, 0,
            "message %" PRId64 " at byte %" PRIu64
            ": in a chunk that needs %s, expected none: this build has no %s",
            reader->number + 1, offset, library, library);
    status =
        cairn_unpack(packing, bytes, (size_t)count, (size_t)CAIRN_BAG_MAX_CHUNK, &reader->chunk);
    if (status == CAIRN_NO_MEMORY)
        return cairn_file_error_system(reader->error, reader->path, "read", ENOMEM);
    if (status == CAIRN_FULL)
        return cairn_bag_report(reader, offset, status,
                                "a chunk of more than %" PRIu64
                                " bytes, expected at most that: the rest of it is left out",
                                CAIRN_BAG_MAX_CHUNK);
    if (status != CAIRN_OK || reader->chunk.count != declared)
        return cairn_bag_report(reader, offset, CAIRN_BAD_FORMAT,
                                "its chunk has %zu good bytes (%s), expected %" PRIu64,
                                reader->chunk.count,
                                status == CAIRN_TRUNCATED    ? "cut"
                                : status == CAIRN_BAD_FORMAT ? "damaged"
                                                             : "whole",
                                declared);
    return CAIRN_OK;
}
