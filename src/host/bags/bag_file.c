/* Reader of recordings of ROS: what all formats share.
 *
 * Method
 * 1. The format is detected by the first bytes. A file of ROS 2 that is compressed as a whole is
 *    decompressed into memory first.
 * 2. The format's part visits the records. Positions and declared sizes are compared with the size
 *    of the file before anything is read or allocated.
 * 3. Files of a folder are read one after another.
 *
 * Limits: 256 MiB for a decompressed chunk or message, 1 GiB for a file that is compressed as a
 * whole, 4096 topics. The size of a file is that at its opening. Indexes are not read. */
#include "src/base/build.h"

#include <inttypes.h>
#include <stdarg.h>

#include "src/host/base/interruption.h"
#include "src/host/base/posix.h"
#include "src/host/bags/bag_file_work.h"

/* Bytes that are read at once, at least. */
#define WINDOW_BYTES ((uint64_t)256 * 1024)

static const uint8_t zstd_magic[4] = {0x28, 0xb5, 0x2f, 0xfd};

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
        if (count >= sizeof zstd_magic && topic->encoding == CAIRN_ROS_ENCODING_CDR &&
            memcmp(bytes, zstd_magic, sizeof zstd_magic) == 0)
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

/* ---- Files ---- */

static cairn_bag_kind kind_of(const uint8_t *bytes, size_t count)
{
    static const struct {
        const char *magic;
        size_t length;
        cairn_bag_kind kind;
    } kinds[] = {{"#ROSBAG V", 9, CAIRN_BAG_ROS1},
                 {"SQLite format 3", 16, CAIRN_BAG_SQLITE},
                 {"\x89MCAP0\r\n", 8, CAIRN_BAG_MCAP},
                 {(const char *)zstd_magic, sizeof zstd_magic, CAIRN_BAG_ZSTD}};

    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
        if (count >= kinds[i].length && memcmp(bytes, kinds[i].magic, kinds[i].length) == 0)
            return kinds[i].kind;
    return CAIRN_BAG_NONE;
}

/* Opens a file or folder. */
static cairn_status open_file(int *file, struct stat *about, const char *path,
                              cairn_file_error *error)
{
    memset(about, 0, sizeof *about);
    *file = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (*file == -1)
        return cairn_file_error_system(error, path, "open", errno);
    if (fstat(*file, about) != 0) {
        int code = errno;

        (void)close(*file);
        return cairn_file_error_system(error, path, "open", code);
    }
    return CAIRN_OK;
}

cairn_status cairn_bag_file_find_kind(cairn_bag_kind *kind, const char *path,
                                      cairn_file_error *error)
{
    uint8_t bytes[16];
    struct stat about;
    ssize_t count;
    int file;
    cairn_status status = open_file(&file, &about, path, error);

    *kind = CAIRN_BAG_NONE;
    if (status != CAIRN_OK)
        return status;
    if (S_ISDIR(about.st_mode)) {
        *kind = CAIRN_BAG_FOLDER;
    } else if (S_ISREG(about.st_mode)) {
        count = pread(file, bytes, sizeof bytes, 0);
        *kind = kind_of(bytes, count > 0 ? (size_t)count : 0);
    }
    (void)close(file);
    return CAIRN_OK;
}

/* Decompresses the whole file into `buffer`, which becomes the source, and detects its kind. */
static cairn_status unpack_file(cairn_bag_reader *reader, cairn_unpack_buffer *buffer,
                                cairn_bag_kind *kind)
{
    cairn_bag_source *source = &reader->source;
    const uint8_t *bytes =
        source->size <= CAIRN_BAG_MAX_FILE ? cairn_bag_fetch(source, 0, source->size) : NULL;
    cairn_status status = CAIRN_FULL;

    if (bytes != NULL)
        status = cairn_unpack(CAIRN_PACKING_ZSTD, bytes, (size_t)source->size,
                              (size_t)CAIRN_BAG_MAX_FILE, buffer);
    if (source->status != CAIRN_OK || status == CAIRN_NO_MEMORY)
        return cairn_file_error_system(reader->error, reader->path, "read",
                                       status == CAIRN_NO_MEMORY ? ENOMEM : source->error_code);
    if (status == CAIRN_UNSUPPORTED)
        return cairn_file_error_set(
            reader->error, status, reader->path, 0,
            "compressed by zstd, expected a bag that is not: this build has no libzstd");
    if (status == CAIRN_FULL)
        return cairn_file_error_set(reader->error, status, reader->path, 0,
                                    "more than %" PRIu64 " bytes, expected at most that of a bag "
                                    "that is compressed as a whole",
                                    CAIRN_BAG_MAX_FILE);
    *kind = kind_of(buffer->bytes, buffer->count);
    if (*kind != CAIRN_BAG_SQLITE && *kind != CAIRN_BAG_MCAP)
        return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path, 0,
                                    "zstd data of something else, expected a bag of ROS 2");
    source->memory = buffer->bytes;
    source->size = buffer->count;
    return status == CAIRN_OK
               ? CAIRN_OK
               : cairn_bag_report(reader, 0, status,
                                  "the zstd data end after %zu bytes, expected the end of the "
                                  "stream: the file is cut or damaged",
                                  buffer->count);
}

static void close_reader(cairn_bag_reader *reader)
{
    (void)close(reader->source.file);
    cairn_unpack_free(&reader->source.window);
    cairn_unpack_free(&reader->chunk);
    cairn_unpack_free(&reader->message);
    for (int32_t i = 0; i < reader->topic_count; i++) {
        free(reader->topic[i].name);
        free(reader->topic[i].type);
    }
    free(reader->topic);
}

static cairn_status read_kind(cairn_bag_reader *reader, cairn_bag_kind kind)
{
    switch (kind) {
    case CAIRN_BAG_ROS1:
        return cairn_bag_read_ros1(reader);
    case CAIRN_BAG_SQLITE:
        return cairn_bag_read_sqlite(reader);
    case CAIRN_BAG_MCAP:
        return cairn_bag_read_mcap(reader);
    default:
        return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path, 0,
                                    "not a bag, expected .bag, .db3 or .mcap");
    }
}

/* Reads one file. */
static cairn_status read_file(const char *path, cairn_bag_kind kind,
                              const cairn_bag_visitor *visitor, cairn_file_error *error)
{
    cairn_bag_reader reader = {.path = path, .visitor = visitor, .error = error, .unit = "byte"};
    cairn_unpack_buffer whole = {.bytes = NULL};
    struct stat about;
    cairn_status status = open_file(&reader.source.file, &about, path, error);

    if (status != CAIRN_OK)
        return status;
    reader.source.size = (uint64_t)about.st_size;
    if (kind == CAIRN_BAG_ZSTD)
        status = unpack_file(&reader, &whole, &kind);
    if (status == CAIRN_OK)
        status = read_kind(&reader, kind);
    close_reader(&reader);
    cairn_unpack_free(&whole);
    return status;
}

/* Reads the files of a folder. */
static cairn_status read_folder(const char *path, const cairn_bag_visitor *visitor,
                                cairn_file_error *error)
{
    cairn_bag_files files;
    cairn_status status = cairn_bag_list_files(&files, path, error);
    cairn_bag_kind kind;

    if (status != CAIRN_OK)
        return status;
    for (int32_t i = 0; i < files.count && status == CAIRN_OK; i++) {
        status = cairn_bag_file_find_kind(&kind, files.path[i], error);
        if (status == CAIRN_OK)
            status = read_file(files.path[i], kind, visitor, error);
    }
    cairn_bag_free_files(&files);
    return status;
}

cairn_status cairn_bag_file_read(const char *path, cairn_bag_kind kind,
                                 const cairn_bag_visitor *visitor, cairn_file_error *error)
{
    return kind == CAIRN_BAG_FOLDER ? read_folder(path, visitor, error)
                                    : read_file(path, kind, visitor, error);
}
