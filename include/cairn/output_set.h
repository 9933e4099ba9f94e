/* output_set: several files of one folder that come all or none.
 *
 * The files are written into a folder of their own within the target folder, by whatever writes
 * a file to a path, and moved to their places when all are there. Files of the same names that
 * are there are replaced by the commit; until then they are as they were. A file that names
 * another (a map its image) must do so without a folder. */
#ifndef CAIRN_OUTPUT_SET_H
#define CAIRN_OUTPUT_SET_H

#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The most files of a set. */
#define CAIRN_OUTPUT_SET_MOST 16

typedef struct cairn_output_set cairn_output_set;

/* Whether _open would be refused, for a user who should not wait for that; makes nothing. names:
 * [count], without '/'. CAIRN_OK: the folder, or the nearest one above it that is there, can be
 * written to, and none of the names is a folder. CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_output_set_check(const char *folder, const char *const *names,
                                                  int32_t count, cairn_file_error *error);

/* Begins a set; the folder and those above it are made where they are missing.
 * CAIRN_BAD_ARGUMENT: count outside 1 ... CAIRN_OUTPUT_SET_MOST; statuses of _check. */
CAIRN_CHECKED cairn_status cairn_output_set_open(cairn_output_set **set, const char *folder,
                                                 const char *const *names, int32_t count,
                                                 cairn_file_error *error);

/* Where file `index` is to be written, 0 <= index < count. Valid until the set ends. */
const char *cairn_output_set_path(const cairn_output_set *set, int32_t index);

/* Ends the set, which is freed in any case. CAIRN_OK: all files are in their places. CAIRN_IO: a
 * file was not written or cannot be replaced, and the folder is as it was; where the file system
 * knows no hard links, files that were replaced before that stay new. */
CAIRN_CHECKED cairn_status cairn_output_set_commit(cairn_output_set *set, cairn_file_error *error);

/* Ends the set and leaves everything as it was; folders that _open has made go again. NULL is
 * allowed. */
void cairn_output_set_discard(cairn_output_set *set);

#ifdef __cplusplus
}
#endif

#endif
