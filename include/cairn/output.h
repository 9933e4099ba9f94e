/* output: files that are either whole or not there.
 *
 * An output is written beside its target under another name and renamed onto it by the commit;
 * until then the target is as it was. Where the target is a link, the file it leads to is
 * replaced; where it is a device or pipe, it is written directly. */
#ifndef CAIRN_OUTPUT_H
#define CAIRN_OUTPUT_H

#include <stddef.h>

#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_output cairn_output;

/* Begins to write `path`. CAIRN_IO when the folder is missing or not writable, or the path is a
 * folder; CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_output_open(cairn_output **output, const char *path,
                                             cairn_file_error *error);

/* Appends. A failure is kept and returned by the commit, so that a writer need not look after
 * every piece. */
void cairn_output_bytes(cairn_output *output, const void *bytes, size_t count);

/* Appends like printf, but never under the user's locale. */
void cairn_output_print(cairn_output *output, const char *format, ...) CAIRN_FORMAT(2, 3);

/* Ends the output, which is freed in any case. CAIRN_OK: the target is the new file, whole.
 * CAIRN_IO: it is as it was. */
CAIRN_CHECKED cairn_status cairn_output_commit(cairn_output *output, cairn_file_error *error);

/* Ends the output and leaves the target as it was. NULL is allowed. */
void cairn_output_discard(cairn_output *output);

/* Makes the folder and those above it that are missing. CAIRN_OK when it is there already;
 * CAIRN_IO. */
CAIRN_CHECKED cairn_status cairn_output_folder(const char *path, cairn_file_error *error);

/* "folder/name", or the name alone when the folder is "" or the name is absolute; to be freed,
 * NULL when there is no memory. */
char *cairn_path_join(const char *folder, const char *name);

/* The folder of a path as a string to be freed: "" when the path names none; NULL when there is
 * no memory. */
char *cairn_path_folder(const char *path);

/* Where the last part of a path begins, within it. */
const char *cairn_path_name(const char *path);

#ifdef __cplusplus
}
#endif

#endif
