/* carmen_log_reader: buffered line reader of text files, plain or gzipped. Internal to the host
 * library. */
#ifndef CAIRN_HOST_CARMEN_LOG_READER_H
#define CAIRN_HOST_CARMEN_LOG_READER_H

#include "cairn/file_error.h"

/* The maximum length of a line in bytes. A longer line is skipped, so that a file without line ends
 * does not exhaust the memory. */
#define CAIRN_LINE_READER_MAX_BYTES (16 * 1024 * 1024)

/* An open text file. */
typedef struct cairn_line_reader cairn_line_reader;

/* Opens a regular file. Gzip is detected by its first bytes (magic number). CAIRN_IO,
 * CAIRN_NO_MEMORY; CAIRN_UNSUPPORTED when the path is a folder, pipe or device. */
CAIRN_CHECKED cairn_status cairn_line_reader_open(cairn_line_reader **reader, const char *path,
                                                  cairn_file_error *error);

/* The same for an open file, which may be a pipe; a line is returned as soon as it has come. The
 * file is closed with the reader; it cannot be rewound unless it is a regular file. name: for error
 * texts. CAIRN_NO_MEMORY: the file is closed. */
CAIRN_CHECKED cairn_status cairn_line_reader_open_file(cairn_line_reader **reader, int file,
                                                       const char *name, cairn_file_error *error);

/* Returns the next line without its end ("\n" or "\r\n") in *line and *length; valid until the next
 * call. CAIRN_EMPTY: the end of the file. CAIRN_FULL: the line was longer than
 * CAIRN_LINE_READER_MAX_BYTES and was skipped; *length is its length. After the last readable
 * line: CAIRN_TRUNCATED: the gzip data end early; CAIRN_BAD_FORMAT: they are corrupt; CAIRN_IO:
 * reading failed. Each of these is returned once, then CAIRN_EMPTY. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_line_reader_next(cairn_line_reader *reader, const char **line,
                                                  size_t *length, cairn_file_error *error);

/* Returns the number of the last line read, from 1; 0 before the first. */
int64_t cairn_line_reader_number(const cairn_line_reader *reader);

/* Rewinds to the first line. CAIRN_IO. */
CAIRN_CHECKED cairn_status cairn_line_reader_rewind(cairn_line_reader *reader,
                                                    cairn_file_error *error);

/* Returns the path that was opened. */
const char *cairn_line_reader_path(const cairn_line_reader *reader);

/* Closes the file and frees the reader. NULL is allowed. */
void cairn_line_reader_close(cairn_line_reader *reader);

/* Splits the next token off [*at, end), separated by blanks, tabs and carriage returns, and returns
 * its length; 0 when there is none. *at advances behind it. */
size_t cairn_token_next(const char **at, const char *end, const char **token);

/* Formats a token for an error text: at most 24 bytes in quotes, unprintable ones as '?'. Returns
 * text. */
#define CAIRN_TOKEN_TEXT_BYTES 32
const char *cairn_token_text(char text[CAIRN_TOKEN_TEXT_BYTES], const char *token, size_t length);

#endif
