/* Line reader of plain and gzipped files.
 *
 * Method: one buffer holds the bytes that were read but not yet returned, [begin, end). Its
 * capacity doubles when a line does not fit. Gzip is inflated here and not by zlib's file
 * functions, which discard the data inflated just before an error. */
#include "src/base/build.h"

#include <stdbool.h>
#include <zlib.h>

#include "src/host/logs/carmen_log_reader.h"
#include "src/host/base/interruption.h"
#include "src/host/base/posix.h"
#include "src/host/base/regular_file.h"

/* Initial capacity of the line buffer and size of the input buffer, in bytes. */
#define FIRST_CAPACITY (256 * 1024)
#define INPUT_BYTES    (64 * 1024)
/* Most bytes that are read at once: read() of Windows counts in unsigned int. */
#define MAX_READ_BYTES ((size_t)1 << 30)

/* Bytes to which any gzip data may unpack, and beyond these the maximum ratio to their packed size.
 * Logs are packed five- to twentyfold. */
#define UNPACKED_BYTES (INT64_C(32) << 20)
#define UNPACKED_TIMES 100

/* zlib's windowBits for a window of 32 KiB and a gzip header. */
#define GZIP_WINDOW (15 + 16)

struct cairn_line_reader {
    int file;
    char *path;
    char *buffer; /* [capacity] */
    size_t capacity, begin, end;
    int64_t number; /* of the last line, from 1 */
    bool at_end;    /* the input has ended or failed */
    /* why the input ended; CAIRN_OK: at the end of the file. Errors are reported once */
    cairn_status end_status;
    int32_t error_code; /* errno of CAIRN_IO */
    /* Gzip. */
    bool format_known; /* the first bytes were read */
    bool is_gzip;      /* `stream` is initialised */
    bool between;      /* between two gzip members */
    z_stream stream;
    unsigned char *input;     /* [INPUT_BYTES] */
    int64_t packed, unpacked; /* bytes inflated so far */
};

cairn_status cairn_line_reader_open(cairn_line_reader **reader, const char *path,
                                    cairn_file_error *error)
{
    int file;
    cairn_status status = regular_file_descriptor(&file, path, error);

    *reader = NULL;
    return status == CAIRN_OK ? cairn_line_reader_open_file(reader, file, path, error) : status;
}

cairn_status cairn_line_reader_open_file(cairn_line_reader **reader, int file, const char *name,
                                         cairn_file_error *error)
{
    cairn_line_reader *created = calloc(1, sizeof *created);

    *reader = NULL;
    if (created == NULL) {
        (void)close(file);
        return cairn_file_error_system(error, name, "open", ENOMEM);
    }
    created->file = file;
    created->path = strdup(name);
    created->buffer = malloc(FIRST_CAPACITY);
    created->input = malloc(INPUT_BYTES);
    created->capacity = FIRST_CAPACITY;
    if (created->path == NULL || created->buffer == NULL || created->input == NULL) {
        cairn_line_reader_close(created);
        return cairn_file_error_system(error, name, "open", ENOMEM);
    }
    *reader = created;
    return CAIRN_OK;
}

static void stop_inflating(cairn_line_reader *reader)
{
    if (reader->is_gzip)
        (void)inflateEnd(&reader->stream);
    reader->is_gzip = false;
}

void cairn_line_reader_close(cairn_line_reader *reader)
{
    if (reader == NULL)
        return;
    stop_inflating(reader);
    (void)close(reader->file);
    free(reader->path);
    free(reader->buffer);
    free(reader->input);
    free(reader);
}

int64_t cairn_line_reader_number(const cairn_line_reader *reader)
{
    return reader->number;
}

const char *cairn_line_reader_path(const cairn_line_reader *reader)
{
    return reader->path;
}

cairn_status cairn_line_reader_rewind(cairn_line_reader *reader, cairn_file_error *error)
{
    if (lseek(reader->file, 0, SEEK_SET) != 0)
        return cairn_file_error_system(error, reader->path, "read a second time", errno);
    stop_inflating(reader);
    reader->begin = 0;
    reader->end = 0;
    reader->number = 0;
    reader->at_end = false;
    reader->end_status = CAIRN_OK;
    reader->format_known = false;
    return CAIRN_OK;
}

/* Makes free space behind `end`: discards the returned bytes, then doubles the capacity if the
 * buffer is full. */
static cairn_status make_space(cairn_line_reader *reader, cairn_file_error *error)
{
    char *grown;

    memmove(reader->buffer, reader->buffer + reader->begin, reader->end - reader->begin);
    reader->end -= reader->begin;
    reader->begin = 0;
    if (reader->end < reader->capacity)
        return CAIRN_OK;
    grown = realloc(reader->buffer, 2 * reader->capacity);
    if (grown == NULL)
        return cairn_file_error_system(error, reader->path, "read", ENOMEM);
    reader->buffer = grown;
    reader->capacity *= 2;
    return CAIRN_OK;
}

/* Ends the input with a status. */
static void end_input(cairn_line_reader *reader, cairn_status status)
{
    reader->at_end = true;
    reader->end_status = status;
}

/* Reads up to `max_count` bytes of the file; 0 at its end or on failure, which ends the input. */
static size_t read_bytes(cairn_line_reader *reader, void *bytes, size_t max_count)
{
    size_t byte_count = max_count < MAX_READ_BYTES ? max_count : MAX_READ_BYTES;
    ssize_t count = read(reader->file, bytes, (unsigned)byte_count);

    if (count > 0)
        return (size_t)count;
    reader->error_code = errno;
    end_input(reader, count < 0 ? CAIRN_IO : CAIRN_OK);
    return 0;
}

/* Refills the gzip input when it is used up. Returns false at the end of the file, which is a
 * truncation unless a member has just ended. */
static bool ensure_input(cairn_line_reader *reader)
{
    if (reader->stream.avail_in > 0)
        return true;
    reader->stream.next_in = reader->input;
    reader->stream.avail_in = (uInt)read_bytes(reader, reader->input, INPUT_BYTES);
    reader->packed += reader->stream.avail_in;
    if (reader->at_end && reader->end_status == CAIRN_OK && !reader->between)
        reader->end_status = CAIRN_TRUNCATED;
    return !reader->at_end;
}

static bool expands_too_much(const cairn_line_reader *reader)
{
    return reader->unpacked > UNPACKED_BYTES &&
           reader->unpacked / UNPACKED_TIMES > reader->packed - reader->stream.avail_in;
}

/* Inflates into the free space behind `end`. Concatenated members are read; other bytes behind a
 * member are ignored. */
static void inflate_more(cairn_line_reader *reader)
{
    size_t space = reader->capacity - reader->end;
    int code;

    reader->stream.next_out = (Bytef *)reader->buffer + reader->end;
    reader->stream.avail_out = (uInt)space;
    while (reader->stream.avail_out > 0 && ensure_input(reader)) {
        if (reader->between &&
            (reader->stream.next_in[0] != 0x1f || inflateReset(&reader->stream) != Z_OK)) {
            end_input(reader, CAIRN_OK);
            break;
        }
        code = inflate(&reader->stream, Z_NO_FLUSH);
        reader->between = code == Z_STREAM_END;
        if (code != Z_STREAM_END && code != Z_OK && code != Z_BUF_ERROR) {
            reader->error_code = ENOMEM;
            end_input(reader, code == Z_MEM_ERROR ? CAIRN_NO_MEMORY : CAIRN_BAD_FORMAT);
            break;
        }
    }
    reader->end += space - reader->stream.avail_out;
    reader->unpacked += (int64_t)(space - reader->stream.avail_out);
    if (!reader->at_end && expands_too_much(reader))
        end_input(reader, CAIRN_BAD_FORMAT);
}

/* Detects the format by the first bytes. Plain text is copied to the buffer; gzip becomes the
 * inflater's input. */
static void begin_reading(cairn_line_reader *reader)
{
    size_t count = read_bytes(reader, reader->input, INPUT_BYTES);

    reader->format_known = true;
    if (count < 2 || reader->input[0] != 0x1f || reader->input[1] != 0x8b) {
        memcpy(reader->buffer, reader->input, count);
        reader->end = count;
        return;
    }
    memset(&reader->stream, 0, sizeof reader->stream);
    reader->stream.next_in = reader->input;
    reader->stream.avail_in = (uInt)count;
    reader->packed = (int64_t)count;
    reader->unpacked = 0;
    if (inflateInit2(&reader->stream, GZIP_WINDOW) == Z_OK) {
        reader->is_gzip = true;
        return;
    }
    reader->error_code = ENOMEM;
    end_input(reader, CAIRN_NO_MEMORY);
}

/* Fills the free space of the buffer, which is not empty; sets at_end when the input has ended. */
static void fill(cairn_line_reader *reader)
{
    if (!reader->format_known)
        begin_reading(reader);
    else if (reader->is_gzip)
        inflate_more(reader);
    else
        reader->end +=
            read_bytes(reader, reader->buffer + reader->end, reader->capacity - reader->end);
}

/* Returns the status of the end: an error once, then CAIRN_EMPTY. */
static cairn_status report_end(cairn_line_reader *reader, cairn_file_error *error)
{
    cairn_status status = reader->end_status;

    reader->end_status = CAIRN_OK;
    if (status == CAIRN_OK)
        return CAIRN_EMPTY;
    if (status == CAIRN_TRUNCATED)
        return cairn_file_error_set(
            error, status, reader->path, reader->number,
            "the gzip data end after this line, expected the end of the stream: the file is cut");
    if (status == CAIRN_BAD_FORMAT && expands_too_much(reader))
        return cairn_file_error_set(error, status, reader->path, reader->number,
                                    "the gzip data expand more than %d times, expected those of a "
                                    "log: what follows this line is left out",
                                    UNPACKED_TIMES);
    if (status == CAIRN_BAD_FORMAT)
        return cairn_file_error_set(
            error, status, reader->path, reader->number,
            "the gzip data are damaged after this line (%s), expected an unbroken stream",
            reader->stream.msg != NULL ? reader->stream.msg : "no reason given");
    return cairn_file_error_system(error, reader->path, "read", reader->error_code);
}

/* Returns the line [begin, begin + length), or CAIRN_FULL when it is too long, and advances by
 * `step` bytes. */
static cairn_status return_line(cairn_line_reader *reader, size_t length, size_t step,
                                const char **line, size_t *found)
{
    cairn_status status = length > CAIRN_LINE_READER_MAX_BYTES ? CAIRN_FULL : CAIRN_OK;

    if (status == CAIRN_OK && length > 0 && reader->buffer[reader->begin + length - 1] == '\r')
        length--;
    *line = reader->buffer + reader->begin;
    *found = length;
    reader->begin += step;
    reader->number++;
    return status;
}

/* Skips the rest of an overlong line, of which `dropped` bytes are in the buffer. */
static cairn_status skip_line(cairn_line_reader *reader, size_t dropped, const char **line,
                              size_t *length)
{
    const char *newline = NULL;

    while (newline == NULL && !reader->at_end) {
        reader->end = 0;
        fill(reader);
        newline = memchr(reader->buffer, '\n', reader->end);
        dropped += newline == NULL ? reader->end : (size_t)(newline - reader->buffer);
    }
    reader->begin = newline == NULL ? reader->end : (size_t)(newline - reader->buffer) + 1;
    reader->number++;
    *line = "";
    *length = dropped;
    return CAIRN_FULL;
}

cairn_status cairn_line_reader_next(cairn_line_reader *reader, const char **line, size_t *length,
                                    cairn_file_error *error)
{
    size_t searched = 0, pending;
    const char *newline;
    cairn_status status;

    if (cairn_interruption_is_requested())
        return CAIRN_MORE;
    for (;;) {
        pending = reader->end - reader->begin;
        newline = memchr(reader->buffer + reader->begin + searched, '\n', pending - searched);
        if (newline != NULL) {
            pending = (size_t)(newline - reader->buffer) - reader->begin;
            return return_line(reader, pending, pending + 1, line, length);
        }
        if (reader->at_end)
            break;
        if (pending > CAIRN_LINE_READER_MAX_BYTES)
            return skip_line(reader, pending, line, length);
        searched = pending;
        status = make_space(reader, error);
        if (status != CAIRN_OK)
            return status;
        fill(reader);
    }
    if (pending == 0)
        return report_end(reader, error);
    return return_line(reader, pending, pending, line, length);
}

size_t cairn_token_next(const char **at, const char *end, const char **token)
{
    const char *p = *at;

    while (p < end && (*p == ' ' || *p == '\t' || *p == '\r'))
        p++;
    *token = p;
    while (p < end && *p != ' ' && *p != '\t' && *p != '\r')
        p++;
    *at = p;
    return (size_t)(p - *token);
}

const char *cairn_token_text(char text[CAIRN_TOKEN_TEXT_BYTES], const char *token, size_t length)
{
    enum { MAX_SHOWN_BYTES = 24 };
    size_t count = length < MAX_SHOWN_BYTES ? length : MAX_SHOWN_BYTES, i;
    char *at = text;

    *at++ = '"';
    for (i = 0; i < count; i++)
        *at++ = (char)(token[i] >= ' ' && token[i] <= '~' ? token[i] : '?');
    (void)snprintf(at, CAIRN_TOKEN_TEXT_BYTES - 1 - count, "%s\"", count < length ? "..." : "");
    return text;
}
