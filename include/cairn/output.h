/* output: atomic file output. A file is either complete or unchanged.
 *
 * An output is written to a temporary file in the target's folder. The commit renames it onto the
 * target (write, fsync, rename); until then the target is unchanged. The new file has the mode of
 * the one that it replaces. If the target is a symbolic link, the file that it refers to is
 * replaced. If the target is a device or a pipe, it is written directly. */
#ifndef CAIRN_OUTPUT_H
#define CAIRN_OUTPUT_H

#include <stddef.h>

#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* An output in progress. */
typedef struct cairn_output cairn_output;

/* Opens an output for `path`. CAIRN_IO: the folder is missing or not writable, or the path is a
 * folder or a symbolic link to nothing; CAIRN_NO_MEMORY.
 *
 * path: target */
CAIRN_CHECKED cairn_status cairn_output_open(cairn_output **output, const char *path,
                                             cairn_file_error *error);

/* Appends bytes. A write error is stored and returned by the commit, so that a caller need not
 * check every call.
 *
 * bytes: [count] to be written */
void cairn_output_bytes(cairn_output *output, const void *bytes, size_t count);

/* Appends formatted text as printf does, under the "C" locale.
 *
 * format: as for printf */
void cairn_output_print(cairn_output *output, const char *format, ...)
    CAIRN_FILE_ERROR_FORMAT(2, 3);

/* Closes and frees the output, also on failure. CAIRN_OK: the target is the complete new file.
 * CAIRN_IO: the target is unchanged. */
CAIRN_CHECKED cairn_status cairn_output_commit(cairn_output *output, cairn_file_error *error);

/* Frees the output and leaves the target unchanged. NULL is allowed. */
void cairn_output_discard(cairn_output *output);

/* Makes SIGINT, SIGTERM and SIGHUP, where the program has left them as they are, remove the
 * temporary files and staging folders of this process before they end it. For programs; without
 * it, they stay behind. On Windows it has no effect. */
void cairn_output_clean_up_on_signals(void);

/* Creates a folder and its missing parents. CAIRN_OK also when it exists already; CAIRN_IO.
 *
 * path: folder to create */
CAIRN_CHECKED cairn_status cairn_output_folder(const char *path, cairn_file_error *error);

/* Returns "folder/name", or the name alone when the folder is "" or the name is absolute. The
 * caller frees the string; NULL: out of memory.
 *
 * folder: folder, may be ""
 * name: name or path */
char *cairn_output_path_join(const char *folder, const char *name);

/* Returns the folder of a path, "" when the path has none. The caller frees the string; NULL: out
 * of memory.
 *
 * path: any path */
char *cairn_output_path_folder(const char *path);

/* Returns the last component of a path, a pointer into `path`.
 *
 * path: any path */
const char *cairn_output_path_name(const char *path);

#ifdef __cplusplus
}
#endif

#endif
