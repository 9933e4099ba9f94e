/* Atomic file output: a temporary file in the target's folder, then fsync and rename. */
#include "src/base/build.h"

#include <stdarg.h>

#include "cairn/output.h"
#include "src/host/base/c_locale.h"
#include "src/host/base/output_pending.h"
#include "src/host/base/output_target.h"
#include "src/host/base/posix.h"

/* Temporary files of one process in one folder. */
#define MAX_ATTEMPTS 1000

struct cairn_output {
    FILE *stream;
    char *path; /* the caller's path, for error texts */
    output_target target;
    char *temporary;    /* NULL: the target is written directly */
    int32_t error_code; /* errno of the first failure */
};

const char *cairn_output_path_name(const char *path)
{
    const char *slash = strrchr(path, '/');

    return slash == NULL ? path : slash + 1;
}

char *cairn_output_path_folder(const char *path)
{
    size_t length = (size_t)(cairn_output_path_name(path) - path);

    while (length > 1 && path[length - 1] == '/')
        length--;
    return strndup(path, length);
}

char *cairn_output_path_join(const char *folder, const char *name)
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
    output_pending_take(output->temporary);
    free(output->target.path);
    free(output->temporary);
    free(output);
}

/* Creates a new temporary file beside the target, with the target's permissions or the user's
 * default ones. Returns its descriptor; -1 and errno on failure. */
static int open_temporary(cairn_output *output)
{
    size_t bytes = strlen(output->target.path) + 48;
    const char *name = cairn_output_path_name(output->target.path);
    int folder_length = (int)(name - output->target.path);
    /* private until it has the target's mode */
    mode_t mode = output->target.exists ? 0600 : 0666;
    int file = -1, attempt;
    int32_t code;

    output->temporary = malloc(bytes);
    if (output->temporary == NULL) {
        errno = ENOMEM;
        return -1;
    }
    /* Its name does not contain the target's, which may be as long as a name can be. */
    for (attempt = 0; attempt < MAX_ATTEMPTS && file == -1; attempt++) {
        (void)snprintf(output->temporary, bytes, "%.*s.cairn-%ld-%d.part", folder_length,
                       output->target.path, (long)getpid(), attempt);
        file = open(output->temporary, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
        if (file == -1 && errno != EEXIST)
            break;
    }
    code = file == -1 ? 0 : output_target_keep_mode(&output->target, output->temporary);
    if (code != 0) {
        (void)close(file);
        (void)unlink(output->temporary);
        file = -1;
        errno = code;
    }
    if (file != -1)
        output_pending_add(output->temporary);
    return file;
}

cairn_status cairn_output_open(cairn_output **output, const char *path, cairn_file_error *error)
{
    cairn_output *created = calloc(1, sizeof *created);
    cairn_status status;
    int32_t code;
    int file;

    *output = NULL;
    if (created == NULL)
        return cairn_file_error_system(error, path, "write", ENOMEM);
    status = output_target_find(&created->target, path, error);
    if (status != CAIRN_OK) {
        free_output(created);
        return status;
    }
    created->path = strdup(path);
    if (created->path == NULL)
        file = -1;
    else if (created->target.direct)
        file = open(created->target.path, O_WRONLY | O_CLOEXEC);
    else
        file = open_temporary(created);
    if (file != -1)
        created->stream = fdopen(file, "wb");
    if (created->stream == NULL) {
        code = errno;
        if (file != -1)
            (void)close(file);
        if (file != -1 && created->temporary != NULL)
            (void)unlink(created->temporary);
        free_output(created);
        return cairn_file_error_system(error, path, "write", code);
    }
    *output = created;
    return CAIRN_OK;
}

/* Stores errno of the first failure. */
static void store_error(cairn_output *output, int failed)
{
    if (failed && output->error_code == 0)
        output->error_code = errno != 0 ? errno : EIO;
}

void cairn_output_bytes(cairn_output *output, const void *bytes, size_t count)
{
    store_error(output, fwrite(bytes, 1, count, output->stream) != count);
}

void cairn_output_print(cairn_output *output, const char *format, ...)
{
    cairn_c_locale scope;
    va_list values;

    scope = cairn_c_locale_enter();
    va_start(values, format);
    store_error(output, vfprintf(output->stream, format, values) < 0);
    va_end(values);
    cairn_c_locale_leave(scope);
}

cairn_status cairn_output_commit(cairn_output *output, cairn_file_error *error)
{
    cairn_status status = CAIRN_OK;

    store_error(output, fflush(output->stream) != 0);
    /* The data reach the disk before the rename: after a power failure the target is the old file
     * or the new one, never an empty one. */
    if (output->temporary != NULL)
        store_error(output, fsync(fileno(output->stream)) != 0);
    store_error(output, fclose(output->stream) != 0);
    if (output->error_code == 0 && output->temporary != NULL)
        store_error(output, rename(output->temporary, output->target.path) != 0);
    if (output->error_code != 0) {
        if (output->temporary != NULL)
            (void)unlink(output->temporary);
        status = cairn_file_error_system(error, output->path, "write", output->error_code);
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
    char *prefix = strdup(path);
    struct stat about;
    size_t i;
    int32_t code = 0;
    int at_end;

    if (prefix == NULL)
        return cairn_file_error_system(error, path, "make the folder", ENOMEM);
    for (i = 1; i <= strlen(path) && code == 0; i++) {
        at_end = path[i] == 0;
        if (!at_end && path[i] != '/')
            continue;
        prefix[i] = 0;
        if (mkdir(prefix, 0777) != 0 && (stat(prefix, &about) != 0 || !S_ISDIR(about.st_mode)))
            code = errno != 0 ? errno : ENOTDIR;
        prefix[i] = path[i];
    }
    if (path[0] == 0)
        code = ENOENT;
    free(prefix);
    return code == 0 ? CAIRN_OK : cairn_file_error_system(error, path, "make the folder", code);
}
