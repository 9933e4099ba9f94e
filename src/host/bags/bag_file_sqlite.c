/* Reader of the SQLite files of ROS 2 (.db3).
 *
 * Method: the rows of `messages` are visited in the order of their keys, after those of `topics`.
 * The file is opened read-only; without a write-ahead log beside it as immutable, so that SQLite
 * makes no file beside it. A damaged page ends the reading; the rows before it are used, of a cut
 * file too.
 *
 * Limits: blobs of 256 MiB. Views of the file are disabled. Without libsqlite3 at compile time
 * (CAIRN_HAVE_SQLITE is not defined) these files are unsupported. */
#include "src/base/build.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "src/host/bags/bag_file_work.h"

#ifdef CAIRN_HAVE_SQLITE
#include <sqlite3.h>

/* Returns path and suffix joined; NULL when out of memory. */
static char *join(const char *path, const char *suffix)
{
    size_t length = strlen(path) + strlen(suffix) + 1;
    char *joined = malloc(length);

    if (joined != NULL)
        (void)snprintf(joined, length, "%s%s", path, suffix);
    return joined;
}

/* Returns the URI of a path, with all special bytes as %XX; NULL when out of memory. */
static char *make_uri(const char *path)
{
    static const char digits[] = "0123456789ABCDEF", scheme[] = "file:";
    char *log = join(path, "-wal");
    const char *query = log != NULL && access(log, F_OK) == 0 ? "" : "?immutable=1";
    char *uri = malloc(sizeof scheme + 3 * strlen(path) + strlen(query)), *at = uri;

    free(log);
    if (uri == NULL)
        return NULL;
    memcpy(at, scheme, sizeof scheme - 1);
    for (at += sizeof scheme - 1; *path != 0; path++) {
        if (strchr("?#%", *path) != NULL) {
            *at++ = '%';
            *at++ = digits[(unsigned char)*path >> 4];
            *at++ = digits[(unsigned char)*path & 15];
        } else {
            *at++ = *path;
        }
    }
    memcpy(at, query, strlen(query) + 1);
    return uri;
}

static cairn_status no_memory(const cairn_bag_reader *reader)
{
    return cairn_file_error_system(reader->error, reader->path, "read", ENOMEM);
}

/* Opens the source's memory or the file. */
static cairn_status open_database(cairn_bag_reader *reader, sqlite3 **database)
{
    const cairn_bag_source *source = &reader->source;
    char *uri = source->memory == NULL ? make_uri(reader->path) : join(":memory:", "");
    unsigned char *memory;
    int code = SQLITE_NOMEM;

    if (uri != NULL)
        code = sqlite3_open_v2(uri, database,
                               source->memory == NULL ? SQLITE_OPEN_READONLY | SQLITE_OPEN_URI
                                                      : SQLITE_OPEN_READWRITE,
                               NULL);
    free(uri);
    /* the memory is only read, though the pointer is not const */
    memcpy(&memory, &source->memory, sizeof memory);
    if (code == SQLITE_OK && memory != NULL)
        code = sqlite3_deserialize(*database, "main", memory, (sqlite3_int64)source->size,
                                   (sqlite3_int64)source->size, SQLITE_DESERIALIZE_READONLY);
    if (code == SQLITE_NOMEM)
        return no_memory(reader);
    if (code != SQLITE_OK)
        return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path, 0,
                                    "%s, expected an SQLite file", sqlite3_errmsg(*database));
    (void)sqlite3_limit(*database, SQLITE_LIMIT_LENGTH, (int)CAIRN_BAG_MAX_CHUNK);
    (void)sqlite3_db_config(*database, SQLITE_DBCONFIG_ENABLE_VIEW, 0, NULL);
    (void)sqlite3_db_config(*database, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, NULL);
    /* lets SQLite read a file that is shorter than it says */
    (void)sqlite3_db_config(*database, SQLITE_DBCONFIG_WRITABLE_SCHEMA, 1, NULL);
    return CAIRN_OK;
}

/* Begins a query. */
static cairn_status prepare(cairn_bag_reader *reader, sqlite3 *database, const char *text,
                            sqlite3_stmt **query)
{
    int code = sqlite3_prepare_v2(database, text, -1, query, NULL);

    if (code == SQLITE_OK)
        return CAIRN_OK;
    return code == SQLITE_NOMEM
               ? no_memory(reader)
               : cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path, 0,
                                      "%s, expected the tables topics and messages of ROS 2",
                                      sqlite3_errmsg(database));
}

/* Reports the end of a query, unless it is its proper end. */
static cairn_status end_query(cairn_bag_reader *reader, sqlite3 *database, int code, int64_t row)
{
    if (code == SQLITE_DONE)
        return CAIRN_OK;
    if (code == SQLITE_NOMEM)
        return no_memory(reader);
    return cairn_bag_report(reader, (uint64_t)row, CAIRN_BAD_FORMAT,
                            "%s, expected a whole row: the file is cut or damaged, the rows before "
                            "it are used",
                            sqlite3_errmsg(database));
}

static cairn_ros_text column_text(sqlite3_stmt *query, int column)
{
    cairn_ros_text text = {(const char *)sqlite3_column_text(query, column), 0};

    text.length = (size_t)sqlite3_column_bytes(query, column);
    if (text.bytes == NULL)
        text.bytes = "";
    return text;
}

static cairn_status read_topics(cairn_bag_reader *reader, sqlite3 *database)
{
    sqlite3_stmt *query = NULL;
    cairn_status status = prepare(
        reader, database, "SELECT id, name, type, serialization_format FROM topics", &query);
    int code = SQLITE_DONE;

    while (status == CAIRN_OK && (code = sqlite3_step(query)) == SQLITE_ROW) {
        cairn_ros_text format = column_text(query, 3);
        int is_cdr = format.length == 3 && memcmp(format.bytes, "cdr", 3) == 0;

        /* a type is known only of the serialization that can be decoded */
        status = cairn_bag_add_topic(reader, (uint32_t)sqlite3_column_int64(query, 0),
                                     CAIRN_ROS_ENCODING_CDR, column_text(query, 1),
                                     is_cdr ? column_text(query, 2) : format);
    }
    if (status == CAIRN_OK)
        status = end_query(reader, database, code, 0);
    (void)sqlite3_finalize(query);
    return status;
}

static cairn_status read_messages(cairn_bag_reader *reader, sqlite3 *database)
{
    sqlite3_stmt *query = NULL;
    cairn_status status = prepare(
        reader, database, "SELECT id, topic_id, timestamp, data FROM messages ORDER BY id", &query);
    int64_t row = 0;
    int code = SQLITE_DONE;

    while (status == CAIRN_OK && (code = sqlite3_step(query)) == SQLITE_ROW) {
        const uint8_t *bytes = sqlite3_column_blob(query, 3);

        row = sqlite3_column_int64(query, 0);
        status = cairn_bag_pass(reader, (uint64_t)row, (uint32_t)sqlite3_column_int64(query, 1),
                                sqlite3_column_int64(query, 2),
                                bytes != NULL ? bytes : (const uint8_t *)"",
                                (uint64_t)sqlite3_column_bytes(query, 3));
    }
    if (status == CAIRN_OK)
        status = end_query(reader, database, code, row + 1);
    (void)sqlite3_finalize(query);
    return status;
}

cairn_status cairn_bag_read_sqlite(cairn_bag_reader *reader)
{
    sqlite3 *database = NULL;
    cairn_status status;

    reader->unit = "row";
    status = open_database(reader, &database);
    if (status == CAIRN_OK)
        status = read_topics(reader, database);
    if (status == CAIRN_OK)
        status = read_messages(reader, database);
    (void)sqlite3_close(database);
    return status;
}
#else
cairn_status cairn_bag_read_sqlite(cairn_bag_reader *reader)
{
    return cairn_file_error_set(
        reader->error, CAIRN_UNSUPPORTED, reader->path, 0,
        "an SQLite bag of ROS 2, expected another format: this build has no libsqlite3");
}
#endif
