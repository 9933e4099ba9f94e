/* Several files, all or none.
 *
 * The stage is a folder "<folder>/.cairn-<process>-<n>.part", on the file system of the targets, so
 * that every file is moved by one rename. Before a target is replaced the stage gets a hard link to
 * it, from which it comes back when a later rename is refused.
 *
 * Limits: a process that is killed leaves its stage behind. */
#include "src/core/build.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cairn/output.h"
#include "cairn/output_set.h"

#define STAGE_BYTES 48

/* One file: where it shall be, where it is written, and where the one is kept that it replaces. */
typedef struct staged_file {
    char *target, *part, *old;
    int32_t kept; /* 1: yes; 0: nothing was there; -1: on a file system without links */
    bool moved;
} staged_file;

struct cairn_output_set {
    char *folder, *stage;
    size_t made; /* length of the shortest part of `folder` that was not there; 0: all of it was */
    staged_file file[CAIRN_OUTPUT_SET_MOST];
    int32_t count;
    bool staged; /* the stage is there */
};

/* Cuts the last name and the slashes before it off; 0 when there was only one. */
static size_t parent_length(const char *path, size_t length)
{
    while (length > 0 && path[length - 1] == '/')
        length--;
    while (length > 0 && path[length - 1] != '/')
        length--;
    while (length > 1 && path[length - 1] == '/')
        length--;
    return length;
}

/* Length of the longest part of the path that is there, 0 for the current folder;
 * *first_missing: that of the part one name longer, 0 when nothing is missing. */
static size_t find_existing(char *path, size_t *first_missing)
{
    size_t length = strlen(path);
    struct stat about;

    *first_missing = 0;
    while (length > 0) {
        char behind = path[length];
        int found;

        path[length] = 0;
        found = stat(path, &about) == 0 || (errno != ENOENT && errno != ENOTDIR);
        path[length] = behind;
        if (found)
            break;
        *first_missing = length;
        length = parent_length(path, length);
    }
    return length;
}

/* Whether files can be made in a folder that is there. */
static cairn_status check_folder(const char *path, cairn_file_error *error)
{
    struct stat about;
    int32_t code = 0;

    if (stat(path, &about) != 0 || (S_ISDIR(about.st_mode) && access(path, W_OK | X_OK) != 0))
        code = errno;
    if (code == 0 && !S_ISDIR(about.st_mode))
        return cairn_file_error_set(error, CAIRN_IO, path, 0, "is a file, expected a folder");
    if (code != 0)
        return cairn_file_error_system(error, path, "write in this folder", code);
    return CAIRN_OK;
}

static cairn_status check_target(const char *path, cairn_file_error *error)
{
    struct stat about;

    if (lstat(path, &about) == 0 && S_ISDIR(about.st_mode))
        return cairn_file_error_set(error, CAIRN_IO, path, 0,
                                    "is a folder, expected a file or nothing");
    return CAIRN_OK;
}

cairn_status cairn_output_set_check(const char *folder, const char *const *names, int32_t count,
                                    cairn_file_error *error)
{
    char *path = strdup(folder);
    size_t missing, there;
    cairn_status status;
    int32_t i;

    if (path == NULL)
        return cairn_file_error_system(error, folder, "write", ENOMEM);
    if (folder[0] == 0) {
        free(path);
        return cairn_file_error_set(error, CAIRN_IO, "\"\"", 0,
                                    "is no name, expected that of a folder");
    }
    there = find_existing(path, &missing);
    path[there] = 0;
    status = check_folder(there > 0 ? path : ".", error);
    free(path);
    for (i = 0; i < count && missing == 0 && status == CAIRN_OK; i++) {
        char *target = cairn_path_join(folder, names[i]);

        status = target != NULL ? check_target(target, error)
                                : cairn_file_error_system(error, folder, "write", ENOMEM);
        free(target);
    }
    return status;
}

/* Makes the stage under a name that was not there. 0, or errno. */
static int32_t make_stage(cairn_output_set *set)
{
    int32_t i;

    for (i = 0; i < 100; i++) {
        (void)snprintf(set->stage, strlen(set->folder) + STAGE_BYTES, "%s/.cairn-%ld-%d.part",
                       set->folder, (long)getpid(), (int)i);
        if (mkdir(set->stage, 0777) == 0) {
            set->staged = true;
            return 0;
        }
        if (errno != EEXIST)
            break;
    }
    return errno;
}

static char *old_name(const char *part)
{
    size_t bytes = strlen(part) + sizeof ".old";
    char *old = malloc(bytes);

    if (old != NULL)
        (void)snprintf(old, bytes, "%s.old", part);
    return old;
}

static cairn_status name_files(cairn_output_set *set, const char *const *names)
{
    int32_t i;

    for (i = 0; i < set->count; i++) {
        staged_file *file = &set->file[i];

        file->target = cairn_path_join(set->folder, names[i]);
        file->part = cairn_path_join(set->stage, names[i]);
        if (file->part != NULL)
            file->old = old_name(file->part);
        if (file->target == NULL || file->old == NULL)
            return CAIRN_NO_MEMORY;
    }
    return CAIRN_OK;
}

cairn_status cairn_output_set_open(cairn_output_set **set, const char *folder,
                                   const char *const *names, int32_t count, cairn_file_error *error)
{
    cairn_output_set *s;
    cairn_status status;
    int32_t code;

    *set = NULL;
    if (count < 1 || count > CAIRN_OUTPUT_SET_MOST)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, folder, 0,
                                    "%d files, expected 1 to %d", (int)count,
                                    CAIRN_OUTPUT_SET_MOST);
    status = cairn_output_set_check(folder, names, count, error);
    if (status != CAIRN_OK)
        return status;
    s = calloc(1, sizeof *s);
    if (s == NULL)
        return cairn_file_error_system(error, folder, "write", ENOMEM);
    s->count = count;
    s->folder = strdup(folder);
    s->stage = malloc(strlen(folder) + STAGE_BYTES);
    if (s->folder == NULL || s->stage == NULL) {
        cairn_output_set_discard(s);
        return cairn_file_error_system(error, folder, "write", ENOMEM);
    }
    (void)find_existing(s->folder, &s->made);
    status = cairn_output_folder(folder, error);
    if (status == CAIRN_OK) {
        code = make_stage(s);
        if (code == 0 && name_files(s, names) != CAIRN_OK)
            code = ENOMEM;
        if (code != 0)
            status = cairn_file_error_system(error, folder, "write", code);
    }
    if (status != CAIRN_OK) {
        cairn_output_set_discard(s);
        return status;
    }
    *set = s;
    return CAIRN_OK;
}

const char *cairn_output_set_path(const cairn_output_set *set, int32_t index)
{
    return set->file[index].part;
}

/* The stage goes with all that is left in it. */
static void remove_stage(cairn_output_set *set)
{
    int32_t i;

    for (i = 0; i < set->count; i++) {
        if (set->file[i].part != NULL)
            (void)unlink(set->file[i].part);
        if (set->file[i].old != NULL)
            (void)unlink(set->file[i].old);
    }
    if (set->staged)
        (void)rmdir(set->stage);
}

static void free_set(cairn_output_set *set)
{
    int32_t i;

    for (i = 0; i < set->count; i++) {
        free(set->file[i].target);
        free(set->file[i].part);
        free(set->file[i].old);
    }
    free(set->folder);
    free(set->stage);
    free(set);
}

static void remove_made_folders(cairn_output_set *set)
{
    size_t length = strlen(set->folder);

    while (set->made > 0 && length >= set->made) {
        set->folder[length] = 0;
        /* stays, as those above it do, when somebody else has put something there */
        (void)rmdir(set->folder);
        length = parent_length(set->folder, length);
    }
}

void cairn_output_set_discard(cairn_output_set *set)
{
    if (set == NULL)
        return;
    remove_stage(set);
    if (set->folder != NULL)
        remove_made_folders(set);
    free_set(set);
}

/* Takes back what the commit has done so far. */
static void move_back(cairn_output_set *set)
{
    int32_t i;

    for (i = set->count - 1; i >= 0; i--) {
        staged_file *file = &set->file[i];

        if (file->moved && file->kept > 0)
            (void)rename(file->old, file->target);
        else if (file->moved && file->kept == 0)
            (void)unlink(file->target);
    }
}

cairn_status cairn_output_set_commit(cairn_output_set *set, cairn_file_error *error)
{
    int32_t i;

    for (i = 0; i < set->count; i++) {
        staged_file *file = &set->file[i];
        struct stat about;

        file->kept = link(file->target, file->old) == 0 ? 1
                     : lstat(file->target, &about) == 0 ? -1
                                                        : 0;
        if (rename(file->part, file->target) != 0) {
            cairn_status status = cairn_file_error_system(error, file->target, "write", errno);

            move_back(set);
            cairn_output_set_discard(set);
            return status;
        }
        file->moved = true;
    }
    remove_stage(set);
    free_set(set);
    return CAIRN_OK;
}
