/* console: what the tools say while they work, and how they fail. */
#ifndef CAIRN_TOOLS_CONSOLE_H
#define CAIRN_TOOLS_CONSOLE_H

#include "cairn/file_error.h"
#include "cairn/pool.h"

/* Exit codes of all tools. */
enum {
    EXIT_DONE = 0,
    EXIT_FAILED = 1, /* the work could not be done: no memory, a disk that is full */
    EXIT_BAD_INPUT = 2
};

/* A bar on standard error while it is a terminal and `quiet` is 0; nothing otherwise. */
typedef struct console_progress {
    const char *label;
    int64_t total;
    int32_t shown; /* 1: a bar is being drawn */
    int32_t permille;
} console_progress;

console_progress console_progress_start(const char *label, int64_t total, int32_t quiet);
void console_progress_at(console_progress *progress, int64_t done);
void console_progress_end(console_progress *progress);

/* Prints the error's text on standard error; returns the exit code that belongs to its status. */
int console_fail(const cairn_file_error *error);

/* Prints "program: text" and returns EXIT_BAD_INPUT. */
int console_bad_input(const char *program, const char *format, ...) CAIRN_FORMAT(2, 3);

/* A pool of `bytes` bytes from the system for one object that needs `need`: `bytes` 0 means just what is needed. Returns
 * EXIT_DONE, or prints what is wrong and returns another code. The memory is given back by free(*memory). */
int console_pool(const char *program, int64_t bytes, size_t need, cairn_pool *pool, void **memory);

/* Monotonic time in s. */
double console_seconds(void);

#endif
