/* Files that are either whole or not there: written under a name of their own in the target's
 * folder, then renamed. */
#define _XOPEN_SOURCE 700 /* realpath */
#include "src/core/build.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cairn/output.h"
#include "src/host/c_locale.h"

struct cairn_output {
    FILE *stream;
    char *path;      /* as the caller wrote it, for error texts */
    char *target;    /* with links followed */
    char *temporary; /* NULL: the target is a device and is written directly */
    int32_t code;    /* errno of the first failure */
};

const char *cairn_path_name(const char *path)
{
    const char *slash = strrchr(path, '/');

    return slash == NULL ? path : slash + 1;
}

char *cairn_path_folder(const char *path)
{
    size_t length = (size_t)(cairn_path_name(path) - path);

    while (length > 1 && path[length - 1] == '/')
        length--;
    return strndup(path, length);
}

char *cairn_path_join(const char *folder, const char *name)
{
    size_t first = strlen(folder), bytes = first + strlen(name) + sizeof "/";
    char *joined;

    if (first == 0 || name[0] == '/')
        return strdup(name);
    joined = malloc(bytes);
    if (joined != NULL)
        (void)snprintf(joined, bytes, "%s%s%s", folder, folder[first - 1] == '/' ? "" : "/", name);
    return joined;
}

static void free_output(cairn_output *output)
{
    free(output->path);
    free(output->target);
    free(output->temporary);
    free(output);
}

/* Opens a file that was not there beside the target; the mode is that of any new file of the
 * user. -1 and errno. */
static int open_temporary(cairn_output *o)
{
    size_t length = strlen(o->target);
    int file = -1, i;

    o->temporary = malloc(length + 40);
    if (o->temporary == NULL) {
        errno = ENOMEM;
        return -1;
    }
    for (i = 0; i < 100 && file == -1; i++) {
        (void)snprintf(o->temporary, length + 40, "%s.%ld-%d.part", o->target, (long)getpid(), i);
        file = open(o->temporary, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (file == -1 && errno != EEXIST)
            break;
    }
    return file;
}

cairn_status cairn_output_open(cairn_output **output, const char *path, cairn_file_error *error)
{
    cairn_output *o = calloc(1, sizeof *o);
    struct stat about;
    int file = -1, there = stat(path, &about) == 0;

    *output = NULL;
    if (o == NULL)
        return cairn_file_error_system(error, path, "write", ENOMEM);
    o->path = strdup(path);
    o->target = there ? realpath(path, NULL) : strdup(path);
    if (o->path == NULL || o->target == NULL)
        errno = ENOMEM;
    else if (there && S_ISDIR(about.st_mode))
        errno = EISDIR;
    else if (there && !S_ISREG(about.st_mode))
        file = open(o->target, O_WRONLY | O_CLOEXEC);
    else
        file = open_temporary(o);
    if (file != -1)
        o->stream = fdopen(file, "wb");
    if (o->stream == NULL) {
        int32_t code = errno;

        if (file != -1)
            (void)close(file);
        if (file != -1 && o->temporary != NULL)
            (void)unlink(o->temporary);
        free_output(o);
        return cairn_file_error_system(error, path, "write", code);
    }
    *output = o;
    return CAIRN_OK;
}

static void keep_failure(cairn_output *output, int failed)
{
    if (failed && output->code == 0)
        output->code = errno != 0 ? errno : EIO;
}

void cairn_output_bytes(cairn_output *output, const void *bytes, size_t count)
{
    keep_failure(output, fwrite(bytes, 1, count, output->stream) != count);
}

void cairn_output_print(cairn_output *output, const char *format, ...)
{
    cairn_c_locale scope;
    va_list values;

    scope = cairn_c_locale_enter();
    va_start(values, format);
    keep_failure(output, vfprintf(output->stream, format, values) < 0);
    va_end(values);
    cairn_c_locale_leave(scope);
}

cairn_status cairn_output_commit(cairn_output *output, cairn_file_error *error)
{
    cairn_status status = CAIRN_OK;

    keep_failure(output, fflush(output->stream) != 0);
    /* On disk before the rename: after a power cut the target is the old file or the new one,
     * not an empty one. */
    if (output->temporary != NULL)
        keep_failure(output, fsync(fileno(output->stream)) != 0);
    keep_failure(output, fclose(output->stream) != 0);
    if (output->code == 0 && output->temporary != NULL)
        keep_failure(output, rename(output->temporary, output->target) != 0);
    if (output->code != 0) {
        if (output->temporary != NULL)
            (void)unlink(output->temporary);
        status = cairn_file_error_system(error, output->path, "write", output->code);
    }
    free_output(output);
    return status;
}

void cairn_output_discard(cairn_output *output)
{
    if (output == NULL)
        return;
    (void)fclose(output->stream);
    if (output->temporary != NULL)
        (void)unlink(output->temporary);
    free_output(output);
}

cairn_status cairn_output_folder(const char *path, cairn_file_error *error)
{
    char *part = strdup(path);
    struct stat about;
    size_t i;
    int32_t code = 0;
    int last;

    if (part == NULL)
        return cairn_file_error_system(error, path, "make the folder", ENOMEM);
    for (i = 1; i <= strlen(path) && code == 0; i++) {
        last = path[i] == 0;
        if (!last && path[i] != '/')
            continue;
        part[i] = 0;
        if (mkdir(part, 0777) != 0 && (stat(part, &about) != 0 || !S_ISDIR(about.st_mode)))
            code = errno != 0 ? errno : ENOTDIR;
        part[i] = path[i];
    }
    if (path[0] == 0)
        code = ENOENT;
    free(part);
    return code == 0 ? CAIRN_OK : cairn_file_error_system(error, path, "make the folder", code);
}
