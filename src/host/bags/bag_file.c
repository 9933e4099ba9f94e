/* Reader of recordings of ROS: files and folders.
 *
 * Method
 * 1. The format is detected by the first bytes. A file of ROS 2 that is compressed as a whole is
 *    decompressed into memory first.
 * 2. The format's part visits the records.
 * 3. Files of a folder are read one after another.
 *
 * Limits: 1 GiB for a file that is compressed as a whole. The size of a file is that at its opening.
 * Indexes are not read. */
#include "src/base/build.h"

#include <inttypes.h>

#include "src/host/base/posix.h"
#include "src/host/bags/bag_file_work.h"

static cairn_bag_kind kind_of(const uint8_t *bytes, size_t count)
{
    static const struct {
        const char *magic;
        size_t length;
        cairn_bag_kind kind;
    } kinds[] = {{"#ROSBAG V", 9, CAIRN_BAG_ROS1},
                 {"SQLite format 3", 16, CAIRN_BAG_SQLITE},
                 {"\x89MCAP0\r\n", 8, CAIRN_BAG_MCAP},
                 {CAIRN_BAG_ZSTD_MAGIC, CAIRN_BAG_ZSTD_MAGIC_BYTES, CAIRN_BAG_ZSTD}};

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
