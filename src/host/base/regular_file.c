/* Opens input files that are regular ones. */
#include "src/base/build.h"

#include "src/host/base/posix.h"
#include "src/host/base/regular_file.h"

cairn_status regular_file_descriptor(int *file, const char *path, cairn_file_error *error)
{
    struct stat about;
    int opened = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);

    *file = -1;
    if (opened == -1)
        return cairn_file_error_system(error, path, "open", errno);
    if (fstat(opened, &about) != 0 || !S_ISREG(about.st_mode)) {
        (void)close(opened);
        return cairn_file_error_set(error, CAIRN_UNSUPPORTED, path, 0,
                                    "is a %s, expected a regular file",
                                    S_ISDIR(about.st_mode) ? "folder" : "pipe or device");
    }
    *file = opened;
    return CAIRN_OK;
}

cairn_status regular_file_open(FILE **stream, const char *path, cairn_file_error *error)
{
    int file;
    cairn_status status = regular_file_descriptor(&file, path, error);

    *stream = NULL;
    if (status != CAIRN_OK)
        return status;
    *stream = fdopen(file, "rb");
    if (*stream != NULL)
        return CAIRN_OK;
    status = cairn_file_error_system(error, path, "open", errno);
    (void)close(file);
    return status;
}
