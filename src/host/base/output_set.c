/* Atomic output of several files.
 *
 * Method
 * 1. The staging folder is "<folder>/.cairn-<process>-<n>.part". It is on the file system of the
 *    targets, so that every file is moved by one rename.
 *    Targets that are devices or pipes are written directly.
 * 2. Before a target is replaced, the staging folder gets a hard link to it as a backup.
 * 3. If a later rename fails, the targets are restored from their backups (rollback).
 * 4. A mark in the staging folder says that all staged files are whole: the commit has begun.
 * 5. The owner of a staging folder holds a lock on it. The next set in the same folder finds those
 *    that no process holds: with a mark it completes the commit, else it removes the files (recovery).
 *
 * Limits: a process that is killed leaves its staging folder until then, without locks (some
 * network file systems) for ever. Killed amid a rollback, what was replaced stays replaced. */
#include "src/base/build.h"

#include <dirent.h>
#include <stdbool.h>

#include "cairn/output.h"
#include "cairn/output_set.h"
#include "src/host/base/output_pending.h"
#include "src/host/base/output_target.h"
#include "src/host/base/posix.h"

/* Bytes of the staging folder's name beyond the target folder. */
#define STAGE_BYTES 48
/* The mark of a commit that has begun, in the staging folder. */
#define MARK ".commit"

/* One file: its target, its staged file, and the backup of the file that it replaces. */
typedef struct staged_file {
    char *name; /* the path in the set's folder, for error texts */
    output_target target;
    char *staged, *backup; /* NULL: the target is written directly */
    /* 1: a backup exists; 0: the target did not exist; -1: the file system has no hard links */
    int32_t has_backup;
    /* the staged file has replaced the target */
    bool moved;
} staged_file;

struct cairn_output_set {
    char *folder, *stage, *mark;
    int lock; /* descriptor of the staging folder, locked */
    /* length of the shortest prefix of `folder` that was created; 0: the folder existed */
    size_t created_prefix;
    staged_file file[CAIRN_OUTPUT_SET_MAX_FILES];
    int32_t count;
    char *old[CAIRN_OUTPUT_SET_MAX_FILES]; /* paths of files that go at the commit */
    int32_t old_count;
    bool has_stage; /* the staging folder exists */
};

/* Returns the length of a path's parent: the last name and the slashes before it are removed. 0
 * when the path has only one name. */
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

/* Returns the length of the longest existing prefix of the path, 0 for the current folder.
 * *first_missing: the length of the prefix one name longer; 0 when the whole path exists. */
static size_t find_existing(char *path, size_t *first_missing)
{
    size_t length = strlen(path);
    struct stat about;

    *first_missing = 0;
    while (length > 0) {
        char saved = path[length];
        int found;

        path[length] = 0;
        found = stat(path, &about) == 0 || (errno != ENOENT && errno != ENOTDIR);
        path[length] = saved;
        if (found)
            break;
        *first_missing = length;
        length = parent_length(path, length);
    }
    return length;
}

/* Checks that an existing folder is writable. */
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

/* Checks that a target can be replaced or written. *staged becomes true when it is written by way
 * of the staging folder. */
static cairn_status check_target(const char *path, bool *staged, cairn_file_error *error)
{
    output_target target;
    cairn_status status = output_target_find(&target, path, error);

    if (status != CAIRN_OK)
        return status;
    if (!target.direct)
        *staged = true;
    else if (access(path, W_OK) != 0)
        status = cairn_file_error_system(error, path, "write", errno);
    free(target.path);
    return status;
}

cairn_status cairn_output_set_check(const char *folder, const char *const *names, int32_t count,
                                    cairn_file_error *error)
{
    char *path = strdup(folder);
    size_t missing, existing;
    cairn_status status = CAIRN_OK;
    bool staged = count == 0;
    int32_t i;

    if (path == NULL)
        return cairn_file_error_system(error, folder, "write", ENOMEM);
    if (folder[0] == 0) {
        free(path);
        return cairn_file_error_set(error, CAIRN_IO, "\"\"", 0,
                                    "is not a path, expected that of a folder");
    }
    existing = find_existing(path, &missing);
    path[existing] = 0;
    for (i = 0; i < count && missing == 0 && status == CAIRN_OK; i++) {
        char *target = cairn_output_path_join(folder, names[i]);

        status = target != NULL ? check_target(target, &staged, error)
                                : cairn_file_error_system(error, folder, "write", ENOMEM);
        free(target);
    }
    if (status == CAIRN_OK && (staged || missing != 0))
        status = check_folder(existing > 0 ? path : ".", error);
    free(path);
    return status;
}

/* Locks the staging folder that was just made. Returns 0 when a recovery has removed it before. */
static int lock_stage(cairn_output_set *set)
{
    struct stat locked, named;

    set->lock = cairn_folder_lock(set->stage, 1);
    if (set->lock == -1)
        return 0;
    if (fstat(set->lock, &locked) == 0 && stat(set->stage, &named) == 0 &&
        locked.st_ino == named.st_ino)
        return 1;
    (void)close(set->lock);
    set->lock = -1;
    return 0;
}

/* Creates the staging folder under an unused name. Returns 0, or errno. */
static int32_t make_stage(cairn_output_set *set)
{
    int32_t attempt;

    for (attempt = 0; attempt < 1000; attempt++) {
        (void)snprintf(set->stage, strlen(set->folder) + STAGE_BYTES, "%s/.cairn-%ld-%d.part",
                       set->folder, (long)getpid(), (int)attempt);
        /* Private: a staged file gets the mode of the file that it replaces at the commit only. */
        if (mkdir(set->stage, 0700) == 0) {
            if (!lock_stage(set))
                continue;
            set->has_stage = true;
            output_pending_add(set->stage);
            return 0;
        }
        if (errno != EEXIST)
            break;
    }
    return errno;
}

/* Completes or removes what a killed process has left in a staging folder. */
static void recover_stage(const char *folder, const char *stage)
{
    char *mark = cairn_output_path_join(stage, MARK);
    bool has_begun = mark != NULL && access(mark, F_OK) == 0;
    DIR *entries = mark != NULL ? opendir(stage) : NULL;
    struct dirent *entry;

    while (entries != NULL && (entry = readdir(entries)) != NULL) {
        char *staged = cairn_output_path_join(stage, entry->d_name),
             *name = cairn_output_path_join(folder, entry->d_name);
        output_target target = {.path = NULL};

        if (has_begun && entry->d_name[0] != '.' && staged != NULL && name != NULL &&
            output_target_find(&target, name, NULL) == CAIRN_OK && !target.direct)
            (void)rename(staged, target.path);
        free(target.path);
        free(staged);
        free(name);
    }
    if (entries != NULL)
        rewinddir(entries);
    while (entries != NULL && (entry = readdir(entries)) != NULL) {
        char *left = cairn_output_path_join(stage, entry->d_name);

        /* The mark goes last: a recovery may be killed, too. */
        if (left != NULL && strcmp(entry->d_name, MARK) != 0)
            (void)unlink(left);
        free(left);
    }
    if (entries != NULL)
        (void)closedir(entries);
    if (mark != NULL)
        (void)unlink(mark);
    (void)rmdir(stage);
    free(mark);
}

/* Recovers the staging folders in `folder` that no process holds. */
static void recover(const char *folder)
{
    DIR *entries = opendir(folder);
    struct dirent *entry;

    while (entries != NULL && (entry = readdir(entries)) != NULL) {
        size_t length = strlen(entry->d_name);
        char *stage;
        int lock;

        if (strncmp(entry->d_name, ".cairn-", 7) != 0 || length < 12 ||
            strcmp(entry->d_name + length - 5, ".part") != 0)
            continue;
        stage = cairn_output_path_join(folder, entry->d_name);
        lock = stage != NULL ? cairn_folder_lock(stage, 0) : -1;
        if (lock != -1) {
            recover_stage(folder, stage);
            (void)close(lock);
        }
        free(stage);
    }
    if (entries != NULL)
        (void)closedir(entries);
}

/* The backup's name does not contain the target's, which may be as long as a name can be. */
static char *backup_name(const cairn_output_set *set, int32_t index)
{
    size_t bytes = strlen(set->stage) + sizeof "/.old-" + 11;
    char *backup = malloc(bytes);

    if (backup != NULL)
        (void)snprintf(backup, bytes, "%s/.old-%d", set->stage, (int)index);
    return backup;
}

/* Finds the targets of all files and creates the staging folder if one of them needs it. */
static cairn_status stage_files(cairn_output_set *set, const char *const *names,
                                cairn_file_error *error)
{
    cairn_status status = CAIRN_OK;
    int32_t i, code = 0;

    for (i = 0; i < set->count && status == CAIRN_OK && code == 0; i++) {
        staged_file *file = &set->file[i];

        file->name = cairn_output_path_join(set->folder, names[i]);
        if (file->name == NULL)
            return cairn_file_error_system(error, set->folder, "write", ENOMEM);
        status = output_target_find(&file->target, file->name, error);
        if (status != CAIRN_OK || file->target.direct)
            continue;
        if (!set->has_stage)
            code = make_stage(set);
        if (code == 0 && set->mark == NULL)
            set->mark = cairn_output_path_join(set->stage, MARK);
        file->staged = cairn_output_path_join(set->stage, names[i]);
        if (file->staged != NULL)
            file->backup = backup_name(set, i);
        if (code == 0 && (file->backup == NULL || set->mark == NULL))
            code = ENOMEM;
        output_pending_add(file->staged);
    }
    return code == 0 ? status : cairn_file_error_system(error, set->folder, "write", code);
}

cairn_status cairn_output_set_open(cairn_output_set **set, const char *folder,
                                   const char *const *names, int32_t count, cairn_file_error *error)
{
    cairn_output_set *created;
    cairn_status status;

    *set = NULL;
    if (count < 1 || count > CAIRN_OUTPUT_SET_MAX_FILES)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, folder, 0,
                                    "%d files, expected 1 to %d", (int)count,
                                    CAIRN_OUTPUT_SET_MAX_FILES);
    status = cairn_output_set_check(folder, names, count, error);
    if (status != CAIRN_OK)
        return status;
    created = calloc(1, sizeof *created);
    if (created == NULL)
        return cairn_file_error_system(error, folder, "write", ENOMEM);
    created->count = count;
    created->folder = strdup(folder);
    created->stage = malloc(strlen(folder) + STAGE_BYTES);
    created->lock = -1;
    if (created->folder == NULL || created->stage == NULL) {
        cairn_output_set_discard(created);
        return cairn_file_error_system(error, folder, "write", ENOMEM);
    }
    (void)find_existing(created->folder, &created->created_prefix);
    status = cairn_output_folder(folder, error);
    if (status == CAIRN_OK) {
        recover(folder);
        status = stage_files(created, names, error);
    }
    if (status != CAIRN_OK) {
        cairn_output_set_discard(created);
        return status;
    }
    *set = created;
    return CAIRN_OK;
}

const char *cairn_output_set_path(const cairn_output_set *set, int32_t index)
{
    const staged_file *file = &set->file[index];

    return file->staged != NULL ? file->staged : file->target.path;
}

cairn_status cairn_output_set_remove(cairn_output_set *set, const char *name,
                                     cairn_file_error *error)
{
    char *path;

    if (set->old_count == CAIRN_OUTPUT_SET_MAX_FILES)
        return cairn_file_error_set(error, CAIRN_FULL, set->folder, 0,
                                    "more than %d files to be removed, expected at most that",
                                    CAIRN_OUTPUT_SET_MAX_FILES);
    path = cairn_output_path_join(set->folder, name);
    if (path == NULL)
        return cairn_file_error_system(error, set->folder, "write", ENOMEM);
    set->old[set->old_count++] = path;
    return CAIRN_OK;
}

/* Removes the staging folder with its files. */
static void remove_stage(cairn_output_set *set)
{
    int32_t i;

    for (i = 0; i < set->count; i++) {
        if (set->file[i].staged != NULL)
            (void)unlink(set->file[i].staged);
        if (set->file[i].backup != NULL)
            (void)unlink(set->file[i].backup);
    }
    if (set->mark != NULL)
        (void)unlink(set->mark);
    if (set->has_stage)
        (void)rmdir(set->stage);
}

static void free_set(cairn_output_set *set)
{
    int32_t i;

    if (set->lock != -1)
        (void)close(set->lock);
    output_pending_take(set->stage);
    for (i = 0; i < set->count; i++) {
        output_pending_take(set->file[i].staged);
        free(set->file[i].name);
        free(set->file[i].target.path);
        free(set->file[i].staged);
        free(set->file[i].backup);
    }
    for (i = 0; i < set->old_count; i++)
        free(set->old[i]);
    free(set->folder);
    free(set->stage);
    free(set->mark);
    free(set);
}

/* Removes the folders that cairn_output_set_open() has created, innermost first. */
static void remove_created_folders(cairn_output_set *set)
{
    size_t length = strlen(set->folder);

    while (set->created_prefix > 0 && length >= set->created_prefix) {
        set->folder[length] = 0;
        /* fails, and stays with its parents, if another program has put a file there */
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
        remove_created_folders(set);
    free_set(set);
}

/* Rolls back the renames of a failed commit, in reverse order. */
static void roll_back(cairn_output_set *set)
{
    int32_t i;

    (void)unlink(set->mark);
    for (i = set->count - 1; i >= 0; i--) {
        staged_file *file = &set->file[i];

        if (file->moved && file->has_backup > 0)
            (void)rename(file->backup, file->target.path);
        else if (file->moved && file->has_backup == 0)
            (void)unlink(file->target.path);
    }
}

/* Copies a staged file over its target, which is on another file system. */
static cairn_status copy_over(const staged_file *file, cairn_file_error *error)
{
    FILE *source = fopen(file->staged, "rb");
    cairn_output *output;
    char bytes[4096];
    cairn_status status;
    size_t count;
    int32_t code;

    if (source == NULL)
        return cairn_file_error_system(error, file->name, "write", errno);
    status = cairn_output_open(&output, file->target.path, error);
    if (status == CAIRN_OK) {
        while ((count = fread(bytes, 1, sizeof bytes, source)) > 0)
            cairn_output_bytes(output, bytes, count);
        code = ferror(source) ? errno : 0;
        if (code == 0) {
            status = cairn_output_commit(output, error);
        } else {
            cairn_output_discard(output);
            status = cairn_file_error_system(error, file->name, "write", code);
        }
    }
    (void)fclose(source);
    return status;
}

/* Replaces the target of one file. */
static cairn_status replace(staged_file *file, cairn_file_error *error)
{
    struct stat about;
    int32_t code = 0;

    file->has_backup = link(file->target.path, file->backup) == 0 ? 1
                       : lstat(file->target.path, &about) == 0    ? -1
                                                                  : 0;
    if (rename(file->staged, file->target.path) != 0)
        code = errno;
    if (code == EXDEV)
        return copy_over(file, error);
    if (code != 0)
        return cairn_file_error_system(error, file->name, "write", code);
    file->moved = true;
    return CAIRN_OK;
}

/* Gives the staged files, which must all be there, the modes of their targets and writes the
 * mark. */
static cairn_status begin_commit(cairn_output_set *set, cairn_file_error *error)
{
    int mark;

    for (int32_t i = 0; i < set->count; i++) {
        const staged_file *file = &set->file[i];
        int32_t code = 0;

        if (file->staged != NULL && access(file->staged, F_OK) != 0)
            code = errno;
        else if (file->staged != NULL)
            code = output_target_keep_mode(&file->target, file->staged);
        if (code != 0)
            return cairn_file_error_system(error, file->name, "write", code);
    }
    if (!set->has_stage)
        return CAIRN_OK;
    mark = open(set->mark, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    if (mark == -1 || fsync(mark) != 0 || cairn_folder_sync(set->lock) != 0) {
        cairn_status status = cairn_file_error_system(error, set->folder, "write", errno);

        if (mark != -1)
            (void)close(mark);
        return status;
    }
    return close(mark) == 0 ? CAIRN_OK
                            : cairn_file_error_system(error, set->folder, "write", errno);
}

/* Removes the files of an earlier set. */
static cairn_status remove_old(const cairn_output_set *set, cairn_file_error *error)
{
    struct stat about;

    for (int32_t i = 0; i < set->old_count; i++)
        if (lstat(set->old[i], &about) == 0 && S_ISREG(about.st_mode) && unlink(set->old[i]) != 0)
            return cairn_file_error_system(error, set->old[i], "remove", errno);
    return CAIRN_OK;
}

cairn_status cairn_output_set_commit(cairn_output_set *set, cairn_file_error *error)
{
    cairn_status status;
    sigset_t all, before;
    int32_t i;

    /* A signal waits until all files are replaced. */
    (void)sigfillset(&all);
    (void)sigprocmask(SIG_BLOCK, &all, &before);
    status = begin_commit(set, error);
    for (i = 0; i < set->count && status == CAIRN_OK; i++)
        if (set->file[i].staged != NULL)
            status = replace(&set->file[i], error);
    if (status == CAIRN_OK) {
        status = remove_old(set, error);
        remove_stage(set);
        free_set(set);
    } else {
        if (set->has_stage)
            roll_back(set);
        cairn_output_set_discard(set);
    }
    (void)sigprocmask(SIG_SETMASK, &before, NULL);
    return status;
}
