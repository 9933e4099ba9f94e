/* Lines of a plain or gzipped file.
 *
 * One buffer holds what was read and not yet handed out: [begin, end). It doubles when a line
 * does not fit. Gzip is inflated here and not by zlib's file functions, which drop what they
 * have just inflated when the data turn out to be damaged. */
#include "src/core/build.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include "src/host/carmen_log_reader.h"

#define FIRST_CAPACITY (256 * 1024)
#define INPUT_BYTES    (64 * 1024)

/* What zlib calls a window of 32 KiB behind a gzip header. */
#define GZIP_WINDOW (15 + 16)

struct cairn_line_reader {
    int file;
    char *path;
    char *buffer; /* [capacity] */
    size_t capacity, begin, end;
    int64_t number;
    bool at_end;        /* nothing more can be read, because of ... */
    cairn_status cause; /* CAIRN_OK, CAIRN_TRUNCATED, CAIRN_BAD_FORMAT, CAIRN_IO; told once */
    int32_t code;       /* errno of CAIRN_IO */
    /* Gzip. */
    bool begun;   /* the first bytes have told what the file is */
    bool zipped;  /* inflating; `stream` is initialised */
    bool between; /* behind the end of a member */
    z_stream stream;
    unsigned char *input; /* [INPUT_BYTES] */
};

cairn_status cairn_line_reader_open(cairn_line_reader **reader, const char *path,
                                    cairn_file_error *error)
{
    cairn_line_reader *r;
    struct stat about;
    int file = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);

    *reader = NULL;
    if (file == -1)
        return cairn_file_error_system(error, path, "open", errno);
    if (fstat(file, &about) != 0 || !S_ISREG(about.st_mode)) {
        (void)close(file);
        return cairn_file_error_set(error, CAIRN_UNSUPPORTED, path, 0,
                                    "is a %s, expected a regular file",
                                    S_ISDIR(about.st_mode) ? "folder" : "pipe or device");
    }
    r = calloc(1, sizeof *r);
    if (r == NULL) {
        (void)close(file);
        return cairn_file_error_system(error, path, "open", ENOMEM);
    }
    r->file = file;
    r->path = strdup(path);
    r->buffer = malloc(FIRST_CAPACITY);
    r->input = malloc(INPUT_BYTES);
    r->capacity = FIRST_CAPACITY;
    if (r->path == NULL || r->buffer == NULL || r->input == NULL) {
        cairn_line_reader_close(r);
        return cairn_file_error_system(error, path, "open", ENOMEM);
    }
    *reader = r;
    return CAIRN_OK;
}

static void stop_inflating(cairn_line_reader *r)
{
    if (r->zipped)
        (void)inflateEnd(&r->stream);
    r->zipped = false;
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
    cairn_line_reader *r = reader;

    if (lseek(r->file, 0, SEEK_SET) != 0)
        return cairn_file_error_system(error, r->path, "read a second time", errno);
    stop_inflating(r);
    r->begin = 0;
    r->end = 0;
    r->number = 0;
    r->at_end = false;
    r->cause = CAIRN_OK;
    r->begun = false;
    return CAIRN_OK;
}

/* Room behind `end`: what was handed out goes, then the buffer doubles. */
static cairn_status make_room(cairn_line_reader *r, cairn_file_error *error)
{
    char *grown;

    memmove(r->buffer, r->buffer + r->begin, r->end - r->begin);
    r->end -= r->begin;
    r->begin = 0;
    if (r->end < r->capacity)
        return CAIRN_OK;
    grown = realloc(r->buffer, 2 * r->capacity);
    if (grown == NULL)
        return cairn_file_error_system(error, r->path, "read", ENOMEM);
    r->buffer = grown;
    r->capacity *= 2;
    return CAIRN_OK;
}

static void end_by(cairn_line_reader *r, cairn_status cause)
{
    r->at_end = true;
    r->cause = cause;
}

/* Up to `most` bytes of the file; 0 at its end, which is then marked. */
static size_t read_bytes(cairn_line_reader *r, void *bytes, size_t most)
{
    ssize_t count = read(r->file, bytes, most);

    if (count > 0)
        return (size_t)count;
    r->code = errno;
    end_by(r, count < 0 ? CAIRN_IO : CAIRN_OK);
    return 0;
}

/* More gzipped input when there is none. 0 at the end of the file: cut, unless a member has just
 * ended. */
static bool have_input(cairn_line_reader *r)
{
    if (r->stream.avail_in > 0)
        return true;
    r->stream.next_in = r->input;
    r->stream.avail_in = (uInt)read_bytes(r, r->input, INPUT_BYTES);
    if (r->at_end && r->cause == CAIRN_OK && !r->between)
        r->cause = CAIRN_TRUNCATED;
    return !r->at_end;
}

/* Inflates into the room behind `end`. Members may follow one another; what else follows one is
 * not looked at. */
static void inflate_more(cairn_line_reader *r)
{
    size_t room = r->capacity - r->end;
    int code;

    r->stream.next_out = (Bytef *)r->buffer + r->end;
    r->stream.avail_out = (uInt)room;
    while (r->stream.avail_out > 0 && have_input(r)) {
        if (r->between && (r->stream.next_in[0] != 0x1f || inflateReset(&r->stream) != Z_OK)) {
            end_by(r, CAIRN_OK);
            break;
        }
        code = inflate(&r->stream, Z_NO_FLUSH);
        r->between = code == Z_STREAM_END;
        if (code != Z_STREAM_END && code != Z_OK && code != Z_BUF_ERROR) {
            r->code = ENOMEM;
            end_by(r, code == Z_MEM_ERROR ? CAIRN_NO_MEMORY : CAIRN_BAD_FORMAT);
            break;
        }
    }
    r->end += room - r->stream.avail_out;
}

/* The first bytes: plain text stays in the buffer, gzip goes to the inflater. */
static void begin_reading(cairn_line_reader *r)
{
    size_t count = read_bytes(r, r->input, INPUT_BYTES);

    r->begun = true;
    if (count < 2 || r->input[0] != 0x1f || r->input[1] != 0x8b) {
        memcpy(r->buffer, r->input, count);
        r->end = count;
        return;
    }
    memset(&r->stream, 0, sizeof r->stream);
    r->stream.next_in = r->input;
    r->stream.avail_in = (uInt)count;
    if (inflateInit2(&r->stream, GZIP_WINDOW) == Z_OK) {
        r->zipped = true;
        return;
    }
    r->code = ENOMEM;
    end_by(r, CAIRN_NO_MEMORY);
}

/* Reads up to the capacity, of which some is free; sets at_end when nothing more comes. */
static void fill(cairn_line_reader *r)
{
    if (!r->begun)
        begin_reading(r);
    else if (r->zipped)
        inflate_more(r);
    else
        r->end += read_bytes(r, r->buffer + r->end, r->capacity - r->end);
}

/* Why the file ended: said once. */
static cairn_status tell_end(cairn_line_reader *r, cairn_file_error *error)
{
    cairn_status cause = r->cause;

    r->cause = CAIRN_OK;
    if (cause == CAIRN_OK)
        return CAIRN_EMPTY;
    if (cause == CAIRN_TRUNCATED)
        return cairn_file_error_set(
            error, cause, r->path, r->number,
            "the gzip data end after this line, expected the end of the stream: the file is cut");
    if (cause == CAIRN_BAD_FORMAT)
        return cairn_file_error_set(
            error, cause, r->path, r->number,
            "the gzip data are damaged after this line (%s), expected an unbroken stream",
            r->stream.msg != NULL ? r->stream.msg : "no reason given");
    return cairn_file_error_system(error, r->path, "read", r->code);
}

/* Hands out [begin, begin + length), or says that it is too long, and moves on by `step`. */
static cairn_status hand_out(cairn_line_reader *r, size_t length, size_t step, const char **line,
                             size_t *found)
{
    cairn_status status = length > CAIRN_LINE_LONGEST ? CAIRN_FULL : CAIRN_OK;

    if (status == CAIRN_OK && length > 0 && r->buffer[r->begin + length - 1] == '\r')
        length--;
    *line = r->buffer + r->begin;
    *found = length;
    r->begin += step;
    r->number++;
    return status;
}

/* Drops what is left of a line that is too long, of which `dropped` bytes are in the buffer. */
static cairn_status skip_line(cairn_line_reader *r, size_t dropped, const char **line,
                              size_t *length)
{
    const char *newline = NULL;

    while (newline == NULL && !r->at_end) {
        r->end = 0;
        fill(r);
        newline = memchr(r->buffer, '\n', r->end);
        dropped += newline == NULL ? r->end : (size_t)(newline - r->buffer);
    }
    r->begin = newline == NULL ? r->end : (size_t)(newline - r->buffer) + 1;
    r->number++;
    *line = "";
    *length = dropped;
    return CAIRN_FULL;
}

cairn_status cairn_line_reader_next(cairn_line_reader *reader, const char **line, size_t *length,
                                    cairn_file_error *error)
{
    cairn_line_reader *r = reader;
    size_t searched = 0, pending;
    const char *newline;
    cairn_status status;

    for (;;) {
        pending = r->end - r->begin;
        newline = memchr(r->buffer + r->begin + searched, '\n', pending - searched);
        if (newline != NULL) {
            pending = (size_t)(newline - r->buffer) - r->begin;
            return hand_out(r, pending, pending + 1, line, length);
        }
        if (r->at_end)
            break;
        if (pending > CAIRN_LINE_LONGEST)
            return skip_line(r, pending, line, length);
        searched = pending;
        status = make_room(r, error);
        if (status != CAIRN_OK)
            return status;
        fill(r);
    }
    if (pending == 0)
        return tell_end(r, error);
    return hand_out(r, pending, pending, line, length);
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
    enum { SHOWN = 24 };
    size_t count = length < SHOWN ? length : SHOWN, i;
    char *at = text;

    *at++ = '"';
    for (i = 0; i < count; i++)
        *at++ = (char)(token[i] >= ' ' && token[i] <= '~' ? token[i] : '?');
    (void)snprintf(at, CAIRN_TOKEN_TEXT_BYTES - 1 - count, "%s\"", count < length ? "..." : "");
    return text;
}
