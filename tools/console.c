#include "tools/console.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

enum { BAR = 32 };

console_progress console_progress_start(const char *label, int64_t total, int32_t quiet)
{
    console_progress progress = {label, total, !quiet && total > 0 && isatty(STDERR_FILENO), -1};

    console_progress_at(&progress, 0);
    return progress;
}

void console_progress_at(console_progress *progress, int64_t done)
{
    int32_t permille;
    int filled;

    if (!progress->shown)
        return;
    permille = (int32_t)(1000 * done / progress->total);
    if (permille == progress->permille)
        return;
    progress->permille = permille;
    filled = permille * BAR / 1000;
    fprintf(stderr, "\r%-8s [", progress->label);
    for (int i = 0; i < BAR; i++)
        fputc(i < filled ? '#' : '.', stderr);
    fprintf(stderr, "] %3d %%", permille / 10);
    fflush(stderr);
}

void console_progress_end(console_progress *progress)
{
    if (progress->shown)
        fprintf(stderr, "\r%*s\r", BAR + 18, "");
    progress->shown = 0;
}

int console_fail(const cairn_file_error *error)
{
    fprintf(stderr, "%s\n", error->text);
    return error->status == CAIRN_NO_MEMORY ? EXIT_FAILED : EXIT_BAD_INPUT;
}

int console_bad_input(const char *program, const char *format, ...)
{
    va_list arguments;

    fprintf(stderr, "%s: ", program);
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
    fputc('\n', stderr);
    return EXIT_BAD_INPUT;
}

int console_pool(const char *program, int64_t bytes, size_t need, cairn_pool *pool, void **memory)
{
    size_t size = (bytes > 0 ? (size_t)bytes : need) + CAIRN_ALIGN;
    cairn_status status;

    *memory = NULL;
    if (need == 0)
        return console_bad_input(program, "the work needs more memory than can be addressed");
    if (bytes > 0 && (size_t)bytes < need)
        return console_bad_input(program, "--pool is %" PRId64 " bytes, expected at least %zu for this log", bytes, need);
    *memory = malloc(size);
    if (*memory == NULL) {
        fprintf(stderr, "%s: the system has no %zu bytes of memory for the pool\n", program, size);
        return EXIT_FAILED;
    }
    status = cairn_pool_init(pool, *memory, size);
    if (status != CAIRN_OK) {
        fprintf(stderr, "%s: %s\n", program, cairn_status_text(status));
        free(*memory);
        *memory = NULL;
        return EXIT_FAILED;
    }
    return EXIT_DONE;
}

double console_seconds(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}
