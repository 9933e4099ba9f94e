/* file_error: error reports of the host library: a status, a file, a line and a message for the
 * user.
 *
 * Every function of the host library that reads or writes a file takes a cairn_file_error, which
 * may be NULL. The error is written only on failure. Its text has the form "file:line: problem,
 * expected ...", or "file: ..." when no line applies. */
#ifndef CAIRN_FILE_ERROR_H
#define CAIRN_FILE_ERROR_H

#include "cairn/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Capacity of an error text in bytes, with the terminating 0. */
#define CAIRN_FILE_ERROR_BYTES 1024

/* An error report. */
typedef struct cairn_file_error {
    /* status of the call */
    cairn_status status;
    /* from 1; 0: the file as a whole */
    int64_t line;
    /* 0-terminated message; a longer text is truncated, a long path from its left */
    char text[CAIRN_FILE_ERROR_BYTES];
} cairn_file_error;

/* Lets the compiler check printf arguments: index of the format and of its first argument, from
 * 1. */
#if defined(__GNUC__) || defined(__clang__)
#define CAIRN_FILE_ERROR_FORMAT(text, first) __attribute__((format(printf, text, first)))
#else
#define CAIRN_FILE_ERROR_FORMAT(text, first)
#endif

/* Fills *error unless it is NULL, formats without the user's locale, and returns `status`, so that
 * a caller can write `return cairn_file_error_set(...)`. line 0: the file as a whole.
 *
 * status: returned as it is
 * path: file that the text begins with
 * format: as for printf
 * line: line of the file, from 1; 0: the file as a whole */
cairn_status cairn_file_error_set(cairn_file_error *error, cairn_status status, const char *path,
                                  int64_t line, const char *format, ...)
    CAIRN_FILE_ERROR_FORMAT(5, 6);

/* The same for an error of the operating system: "path: cannot <what>: <text of code>". code: a
 * value of errno. Returns CAIRN_NO_MEMORY for ENOMEM, CAIRN_IO otherwise.
 *
 * path: file that the text begins with
 * what: what failed, such as "write" */
cairn_status cairn_file_error_system(cairn_file_error *error, const char *path, const char *what,
                                     int32_t code);

#ifdef __cplusplus
}
#endif

#endif
