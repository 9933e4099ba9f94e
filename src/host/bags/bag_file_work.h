/* Shared by the parts of bag_file: bytes of a file or of memory, topics, faults. */
#ifndef CAIRN_HOST_BAG_FILE_WORK_H
#define CAIRN_HOST_BAG_FILE_WORK_H

#include "src/host/bags/bag_file.h"
#include "src/host/bags/unpack.h"

/* The first bytes of zstd data. */
#define CAIRN_BAG_ZSTD_MAGIC       "\x28\xb5\x2f\xfd"
#define CAIRN_BAG_ZSTD_MAGIC_BYTES ((size_t)4)

/* Bytes that are read by position: a window into a file, or memory. */
typedef struct cairn_bag_source {
    const uint8_t *memory; /* NULL: a file */
    int file;
    uint64_t size;         /* bytes of the file or the memory */
    uint64_t window_begin; /* position of the window's first byte */
    cairn_unpack_buffer window;
    cairn_status status; /* of the last fetch that failed: CAIRN_IO, CAIRN_NO_MEMORY */
    int32_t error_code;  /* its errno */
} cairn_bag_source;

/* A topic, or one of its connections. */
typedef struct cairn_bag_topic {
    uint32_t id;
    cairn_ros_encoding encoding;
    char *name, *type; /* NULL: messages of this topic are not decoded */
} cairn_bag_topic;

/* State of reading one file. */
typedef struct cairn_bag_reader {
    const char *path;
    const cairn_bag_visitor *visitor;
    cairn_file_error *error;
    cairn_bag_source source;
    const char *unit; /* of positions in error texts: "byte", or "row" of a database */
    int64_t number;   /* messages so far */
    int64_t faults;   /* reported so far */
    /* position of the chunk that is being read; its records are at positions of their own */
    uint64_t chunk_offset;
    int32_t in_chunk;
    cairn_unpack_buffer chunk, message; /* decompressed */
    cairn_bag_topic *topic;             /* [topic_count] of [topic_capacity] */
    int32_t topic_count, topic_capacity;
} cairn_bag_reader;

/* Returns bytes [offset, offset + count), which are valid until the next call; NULL: the file ends
 * before them, or reading failed (source->status). */
const uint8_t *cairn_bag_fetch(cairn_bag_source *source, uint64_t offset, uint64_t count);

/* Little-endian numbers of the containers. */
uint32_t cairn_bag_u32(const uint8_t *bytes);
uint64_t cairn_bag_u64(const uint8_t *bytes);

/* Reports a fault at a position of the file: "file: message N at byte B: ...", N being the next
 * message. Returns CAIRN_OK, or the status of a source that failed. */
CAIRN_CHECKED cairn_status cairn_bag_report(cairn_bag_reader *reader, uint64_t offset,
                                            cairn_status status, const char *format, ...)
    CAIRN_FILE_ERROR_FORMAT(4, 5);

/* Reports that a record of `size` bytes ends behind the file. */
CAIRN_CHECKED cairn_status cairn_bag_report_cut(cairn_bag_reader *reader, uint64_t offset,
                                                uint64_t size, uint64_t left);

/* Adds a topic, whose texts are copied, or replaces that with the id. CAIRN_FULL,
 * CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_bag_add_topic(cairn_bag_reader *reader, uint32_t id,
                                               cairn_ros_encoding encoding, cairn_ros_text name,
                                               cairn_ros_text type);

/* Counts a message, and passes it on when its topic is known. */
CAIRN_CHECKED cairn_status cairn_bag_pass(cairn_bag_reader *reader, uint64_t offset, uint32_t id,
                                          int64_t time_ns, const uint8_t *bytes, uint64_t count);

/* Decompresses a chunk to reader->chunk, as much of it as there is; faults are reported. declared:
 * its size by the file. */
CAIRN_CHECKED cairn_status cairn_bag_unpack_chunk(cairn_bag_reader *reader, uint64_t offset,
                                                  cairn_packing packing, const uint8_t *bytes,
                                                  uint64_t count, uint64_t declared);

/* Reads the records of one format from reader->source. */
CAIRN_CHECKED cairn_status cairn_bag_read_ros1(cairn_bag_reader *reader);
CAIRN_CHECKED cairn_status cairn_bag_read_mcap(cairn_bag_reader *reader);

/* Reads a database: the file reader->path, or the source's memory. */
CAIRN_CHECKED cairn_status cairn_bag_read_sqlite(cairn_bag_reader *reader);

/* The files of a bag folder in order. */
typedef struct cairn_bag_files {
    char **path; /* [count] */
    int32_t count;
} cairn_bag_files;

/* Reads metadata.yaml of a folder. On failure there is nothing to free. */
CAIRN_CHECKED cairn_status cairn_bag_list_files(cairn_bag_files *files, const char *folder,
                                                cairn_file_error *error);
void cairn_bag_free_files(cairn_bag_files *files);

#endif
