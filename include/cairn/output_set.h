/* output_set: atomic output of several files of one folder: all are replaced, or none.
 *
 * The files are written to a staging folder within the target folder, by any function that writes a
 * file to a path. The commit renames all of them to their targets. Existing files of the same names
 * are replaced by the commit, keep their mode, and are unchanged until then. If a target is a
 * symbolic link, the file that it refers to is replaced. A device or a pipe is written directly,
 * before the commit. A file that refers to another one of the set (a map to its image) must do so
 * without a folder. */
#ifndef CAIRN_OUTPUT_SET_H
#define CAIRN_OUTPUT_SET_H

#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The maximum number of files in a set. */
#define CAIRN_OUTPUT_SET_MAX_FILES 16

/* A set in progress. */
typedef struct cairn_output_set cairn_output_set;

/* Checks whether cairn_output_set_open() would succeed, before a long computation; creates nothing.
 * names: [count], without '/'. CAIRN_OK: the folder, or its nearest existing parent, is writable
 * and none of the names is a folder or a symbolic link to nothing. CAIRN_IO, CAIRN_NO_MEMORY.
 *
 * folder: target folder */
CAIRN_CHECKED cairn_status cairn_output_set_check(const char *folder, const char *const *names,
                                                  int32_t count, cairn_file_error *error);

/* Opens a set and creates missing folders. CAIRN_BAD_ARGUMENT: count outside 1 ...
 * CAIRN_OUTPUT_SET_MAX_FILES; statuses of cairn_output_set_check().
 *
 * folder: target folder
 * names: [count] names of the files, without '/' */
CAIRN_CHECKED cairn_status cairn_output_set_open(cairn_output_set **set, const char *folder,
                                                 const char *const *names, int32_t count,
                                                 cairn_file_error *error);

/* Returns the path to which file `index`, 0 <= index < count, has to be written. Valid until the
 * set is committed or discarded.
 *
 * index: index in names, from 0 */
const char *cairn_output_set_path(const cairn_output_set *set, int32_t index);

/* Names a file that this set does not write but an earlier one may have: the commit removes it, if
 * it is a regular file, after all others are in place. At most CAIRN_OUTPUT_SET_MAX_FILES.
 * CAIRN_FULL, CAIRN_NO_MEMORY.
 *
 * name: the file, without '/' */
CAIRN_CHECKED cairn_status cairn_output_set_remove(cairn_output_set *set, const char *name,
                                                   cairn_file_error *error);

/* Moves all files to their targets and frees the set, also on failure. CAIRN_OK: all files are in
 * place. CAIRN_IO: a file was not written or cannot be replaced, and the folder is unchanged. Files
 * that were replaced before the failure stay replaced where no hard link to them can be made: on a
 * file system without hard links, or by way of a symbolic link to another file system. When the
 * process is killed amid the renames, the next cairn_output_set_open() in the folder completes
 * them. */
CAIRN_CHECKED cairn_status cairn_output_set_commit(cairn_output_set *set, cairn_file_error *error);

/* Frees the set and leaves all files unchanged. Folders that cairn_output_set_open() created are
 * removed. NULL is allowed. */
void cairn_output_set_discard(cairn_output_set *set);

#ifdef __cplusplus
}
#endif

#endif
