/* bag_file: reader of recordings of ROS: bags of ROS 1, SQLite and MCAP bags of ROS 2, and bag
 * folders. Internal to the host library.
 *
 * All messages are visited in the order of the file, or of the files that a folder's metadata.yaml
 * lists. Nothing is kept; the visitor decodes what it wants. A cut or damaged bag is read up to the
 * damage, which is reported as a fault. */
#ifndef CAIRN_HOST_BAG_FILE_H
#define CAIRN_HOST_BAG_FILE_H

#include "cairn/file_error.h"
#include "src/host/bags/ros_message.h"

/* The format of a recording. */
typedef int32_t cairn_bag_kind;
enum {
    CAIRN_BAG_NONE = 0, /* no bag */
    CAIRN_BAG_ROS1 = 1,
    CAIRN_BAG_SQLITE = 2,
    CAIRN_BAG_MCAP = 3,
    CAIRN_BAG_FOLDER = 4,
    CAIRN_BAG_ZSTD = 5 /* a whole file of ROS 2, compressed */
};

/* Limits, in bytes: of a decompressed chunk or message; of a decompressed file. */
#define CAIRN_BAG_MAX_CHUNK ((uint64_t)256 * 1024 * 1024)
#define CAIRN_BAG_MAX_FILE  ((uint64_t)1024 * 1024 * 1024)

/* The maximum number of topics, or connections, of a file. */
#define CAIRN_BAG_MAX_TOPICS 4096

/* A message. Valid during the visit. */
typedef struct cairn_bag_message {
    const char *path; /* of its file */
    int64_t number;   /* among the messages of the file, from 1 */
    /* position of its record, or of the chunk around it, in `unit`: "byte", or "row" of SQLite */
    uint64_t offset;
    const char *unit;
    const char *topic, *type;
    cairn_ros_encoding encoding;
    int64_t time_ns; /* when it was recorded */
    const uint8_t *bytes;
    size_t count;
} cairn_bag_message;

/* Called for each message and each fault. A status other than CAIRN_OK ends the reading. */
typedef struct cairn_bag_visitor {
    cairn_status (*on_message)(void *context, const cairn_bag_message *message);
    void (*on_fault)(void *context, const cairn_file_error *fault);
    void *context;
} cairn_bag_visitor;

/* Detects the format by the first bytes of a file. CAIRN_BAG_FOLDER: a folder. Statuses of opening
 * a file. */
CAIRN_CHECKED cairn_status cairn_bag_file_find_kind(cairn_bag_kind *kind, const char *path,
                                                    cairn_file_error *error);

/* Visits all messages. The visitor's status; CAIRN_BAD_FORMAT: not a bag of this kind, a folder
 * without metadata.yaml; CAIRN_UNSUPPORTED: another version, encrypted, or a library that this
 * build lacks; CAIRN_FULL: more than CAIRN_BAG_MAX_TOPICS; CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_bag_file_read(const char *path, cairn_bag_kind kind,
                                               const cairn_bag_visitor *visitor,
                                               cairn_file_error *error);

#endif
