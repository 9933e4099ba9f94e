/* What the path of an output refers to: nothing yet, a file, or a device or pipe. */
#include "src/base/build.h"

#include "src/host/base/output_target.h"
#include "src/host/base/posix.h"

cairn_status output_target_find(output_target *target, const char *path, cairn_file_error *error)
{
    struct stat link;

    target->exists = stat(path, &target->about) == 0;
    if (!target->exists && errno != ENOENT && errno != ENOTDIR)
        return cairn_file_error_system(error, path, "write", errno);
    if (!target->exists && lstat(path, &link) == 0)
        return cairn_file_error_set(error, CAIRN_IO, path, 0, "is a symbolic link to nothing");
    if (target->exists && S_ISDIR(target->about.st_mode))
        return cairn_file_error_set(error, CAIRN_IO, path, 0,
                                    "is a folder, expected a file or nothing");
    target->direct = target->exists && !S_ISREG(target->about.st_mode);
    target->path = target->exists && !target->direct ? realpath(path, NULL) : strdup(path);
    return target->path != NULL ? CAIRN_OK : cairn_file_error_system(error, path, "write", errno);
}

int32_t output_target_keep_mode(const output_target *target, const char *replacement)
{
    struct stat about;

    if (!target->exists)
        return 0;
    if (stat(replacement, &about) != 0)
        return errno;
    /* Only root may give a file away; others replace the file by one of their own. */
    if ((about.st_uid != target->about.st_uid || about.st_gid != target->about.st_gid) &&
        chown(replacement, target->about.st_uid, target->about.st_gid) != 0 && errno != EPERM)
        return errno;
    return chmod(replacement, target->about.st_mode & 07777) == 0 ? 0 : errno;
}
