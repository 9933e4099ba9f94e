/* carmen_log_reader: the lines of a text file, plain or gzipped, in one growing buffer. Internal
 * to the host library. */
#ifndef CAIRN_HOST_CARMEN_LOG_READER_H
#define CAIRN_HOST_CARMEN_LOG_READER_H

#include "cairn/file_error.h"

/* A longer line is skipped whole: no memory is spent on a file that has no line ends. */
#define CAIRN_LINE_LONGEST (16 * 1024 * 1024)

typedef struct cairn_line_reader cairn_line_reader;

/* Opens a regular file; gzip is told from plain text by its first bytes. CAIRN_IO,
 * CAIRN_NO_MEMORY; CAIRN_UNSUPPORTED when the path is a folder, pipe or device. */
CAIRN_CHECKED cairn_status cairn_line_reader_open(cairn_line_reader **reader, const char *path,
                                                  cairn_file_error *error);

/* The next line without its end ("\n" or "\r\n"); valid until the next call.
 * CAIRN_EMPTY: no line left. CAIRN_FULL: the line was longer than CAIRN_LINE_LONGEST and was
 * skipped, *length is what was there. CAIRN_TRUNCATED: the gzip data end too early;
 * CAIRN_BAD_FORMAT: they are damaged; CAIRN_IO: reading failed; after these, which come behind
 * the last line that could be had, CAIRN_EMPTY. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_line_reader_next(cairn_line_reader *reader, const char **line,
                                                  size_t *length, cairn_file_error *error);

/* Number of the line read last, from 1. */
int64_t cairn_line_reader_number(const cairn_line_reader *reader);

/* Back to the first line. CAIRN_IO. */
CAIRN_CHECKED cairn_status cairn_line_reader_rewind(cairn_line_reader *reader,
                                                    cairn_file_error *error);

const char *cairn_line_reader_path(const cairn_line_reader *reader);

/* NULL is allowed. */
void cairn_line_reader_close(cairn_line_reader *reader);

/* The next token of [*at, end), which blanks and tabs separate; its length, 0 when there is
 * none. *at moves behind it. */
size_t cairn_token_next(const char **at, const char *end, const char **token);

/* A token for an error text: at most 24 bytes in quotes, unprintable ones as '?'. Returns text. */
#define CAIRN_TOKEN_TEXT_BYTES 32
const char *cairn_token_text(char text[CAIRN_TOKEN_TEXT_BYTES], const char *token, size_t length);

#endif
