/* Lines of a plain or gzipped file.
 *
 * One buffer holds what was read and not yet handed out: [begin, end). It doubles when a line does not fit. zlib reads a
 * cut gzip file to its end without a word; its error is asked for at the end of the data. */
#include "src/core/build.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include "src/host/line_reader.h"

#define FIRST_CAPACITY (256 * 1024)

struct cairn_line_reader {
    gzFile file;
    char *path;
    char *buffer; /* [capacity + 1]: one more for the closing 0 */
    size_t capacity, begin, end;
    int64_t number;
    int32_t at_end;     /* nothing more can be read */
    int32_t told;       /* ... and if that was an error, it has been returned */
    int32_t unfinished; /* the last line had no line end */
};

cairn_status cairn_line_reader_open(cairn_line_reader **reader, const char *path, cairn_file_error *error)
{
    cairn_line_reader *r;
    struct stat about;
    int file = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);

    *reader = NULL;
    if (file < 0)
        return cairn_file_error_system(error, path, "open", errno);
    if (fstat(file, &about) != 0 || !S_ISREG(about.st_mode)) {
        (void)close(file);
        return cairn_file_error_set(error, CAIRN_UNSUPPORTED, path, 0, "is a %s, expected a regular file",
                                    S_ISDIR(about.st_mode) ? "folder" : "pipe or device");
    }
    r = calloc(1, sizeof *r);
    if (r != NULL) {
        r->path = malloc(strlen(path) + 1);
        r->buffer = malloc(FIRST_CAPACITY + 1);
        r->capacity = FIRST_CAPACITY;
        r->file = gzdopen(file, "rb");
    }
    if (r == NULL || r->path == NULL || r->buffer == NULL || r->file == NULL) {
        if (r == NULL || r->file == NULL)
            (void)close(file);
        cairn_line_reader_close(r);
        return cairn_file_error_system(error, path, "open", ENOMEM);
    }
    (void)gzbuffer(r->file, FIRST_CAPACITY / 2);
    memcpy(r->path, path, strlen(path) + 1);
    *reader = r;
    return CAIRN_OK;
}

void cairn_line_reader_close(cairn_line_reader *reader)
{
    if (reader == NULL)
        return;
    if (reader->file != NULL)
        (void)gzclose_r(reader->file);
    free(reader->path);
    free(reader->buffer);
    free(reader);
}

int64_t cairn_line_reader_number(const cairn_line_reader *reader)
{
    return reader->number;
}

int32_t cairn_line_reader_unfinished(const cairn_line_reader *reader)
{
    return reader->unfinished;
}

const char *cairn_line_reader_path(const cairn_line_reader *reader)
{
    return reader->path;
}

cairn_status cairn_line_reader_rewind(cairn_line_reader *reader, cairn_file_error *error)
{
    gzclearerr(reader->file);
    if (gzrewind(reader->file) != 0)
        return cairn_file_error_set(error, CAIRN_IO, reader->path, 0, "cannot be read a second time");
    reader->begin = 0;
    reader->end = 0;
    reader->number = 0;
    reader->at_end = 0;
    reader->told = 0;
    reader->unfinished = 0;
    return CAIRN_OK;
}

/* Room behind `end`: what was handed out goes, then the buffer doubles. */
static cairn_status make_room(cairn_line_reader *r, cairn_file_error *error)
{
    char *grown;

    if (r->begin > 0) {
        memmove(r->buffer, r->buffer + r->begin, r->end - r->begin);
        r->end -= r->begin;
        r->begin = 0;
    }
    if (r->end < r->capacity)
        return CAIRN_OK;
    grown = realloc(r->buffer, 2 * r->capacity + 1);
    if (grown == NULL)
        return cairn_file_error_system(error, r->path, "read", ENOMEM);
    r->buffer = grown;
    r->capacity *= 2;
    return CAIRN_OK;
}

/* Reads up to the capacity; sets at_end when nothing more comes. */
static void fill(cairn_line_reader *r)
{
    int count = gzread(r->file, r->buffer + r->end, (unsigned)(r->capacity - r->end));

    if (count <= 0)
        r->at_end = 1;
    else
        r->end += (size_t)count;
}

/* Why the file ended: said once. */
static cairn_status tell_end(cairn_line_reader *r, cairn_file_error *error)
{
    int code = Z_OK;
    const char *words;

    if (r->told)
        return CAIRN_EMPTY;
    r->told = 1;
    errno = 0;
    words = gzerror(r->file, &code);
    if (code == Z_OK || code == Z_STREAM_END)
        return CAIRN_EMPTY;
    if (code == Z_BUF_ERROR)
        return cairn_file_error_set(
            error, CAIRN_TRUNCATED, r->path, r->number,
            "the gzip data end after this line, expected the end of the stream: the file is cut");
    if (code == Z_DATA_ERROR)
        return cairn_file_error_set(error, CAIRN_BAD_FORMAT, r->path, r->number,
                                    "the gzip data are damaged after this line (%s), expected an unbroken stream",
                                    words);
    return cairn_file_error_set(error, CAIRN_IO, r->path, r->number, "reading failed after this line (%s)", words);
}

/* Hands out [begin, begin + length) and moves on by `step`. */
static cairn_status hand_out(cairn_line_reader *r, size_t length, size_t step, const char **line, size_t *found)
{
    if (length > 0 && r->buffer[r->begin + length - 1] == '\r')
        length--;
    *line = r->buffer + r->begin;
    *found = length;
    r->buffer[r->begin + length] = 0;
    r->begin += step;
    r->number++;
    return CAIRN_OK;
}

/* Drops the rest of a line that is too long. */
static cairn_status skip_line(cairn_line_reader *r, const char **line, size_t *length)
{
    size_t dropped = r->end - r->begin;
    const char *newline = NULL;

    while (newline == NULL && !r->at_end) {
        r->begin = 0;
        r->end = 0;
        fill(r);
        newline = memchr(r->buffer, '\n', r->end);
        dropped += newline == NULL ? r->end : (size_t)(newline - r->buffer);
    }
    r->begin = newline == NULL ? r->end : (size_t)(newline - r->buffer) + 1;
    r->unfinished = newline == NULL;
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
        searched = pending;
        if (r->at_end)
            break;
        if (pending > CAIRN_LINE_LONGEST)
            return skip_line(r, line, length);
        status = make_room(r, error);
        if (status < 0)
            return status;
        fill(r);
    }
    if (pending == 0)
        return tell_end(r, error);
    r->unfinished = 1;
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
    size_t shown = length > 24 ? 24 : length, i;

    text[0] = '"';
    for (i = 0; i < shown; i++)
        text[1 + i] = (char)(token[i] >= ' ' && token[i] <= '~' ? token[i] : '?');
    memcpy(text + 1 + shown, length > shown ? "...\"" : "\"", length > shown ? 5 : 2);
    return text;
}
