/* file_error: what went wrong with a file, in words that a user can act on.
 *
 * Every call of the host library that touches a file takes a cairn_file_error, which may be
 * NULL. It is written only when something is wrong. The text has the form "file:line: what is
 * wrong, expected what", or "file: ..." when there is no line to name. */
#ifndef CAIRN_FILE_ERROR_H
#define CAIRN_FILE_ERROR_H

#include "cairn/status.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CAIRN_FILE_ERROR_BYTES 1024

typedef struct cairn_file_error {
    cairn_status status;
    /* from 1; 0: no one line */
    int64_t line;
    /* 0-terminated; a longer text is cut, from the left of the path first */
    char text[CAIRN_FILE_ERROR_BYTES];
} cairn_file_error;

#if defined(__GNUC__) || defined(__clang__)
#define CAIRN_FORMAT(text, first) __attribute__((format(printf, text, first)))
#else
#define CAIRN_FORMAT(text, first)
#endif

/* Writes the error unless it is NULL, numbers without the locale, and returns the status, so
 * that a caller can say `return cairn_file_error_set(...)`. line 0: the file as a whole. */
cairn_status cairn_file_error_set(cairn_file_error *error, cairn_status status, const char *path,
                                  int64_t line, const char *format, ...) CAIRN_FORMAT(5, 6);

/* The same for a refusal of the operating system: "path: cannot <what>: <text of code>". code:
 * errno. CAIRN_IO, or CAIRN_NO_MEMORY when the code is ENOMEM. */
cairn_status cairn_file_error_system(cairn_file_error *error, const char *path, const char *what,
                                     int32_t code);

#ifdef __cplusplus
}
#endif

#endif
