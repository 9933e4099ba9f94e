/* appearance_file: reader and writer of appearance models (appearance) as text.
 *
 *   cairn-appearance 1
 *   words 100
 *   12 0 0 31 ...                    # 128 whole numbers for each word, 0 ... 255
 *   machine 1.9 -0.2 -1.7 0.4 57     # gamma, rho, slope, offset, support vectors:
 *   0.5 0 0.01 ...                   # weight, then the histogram
 *   end                              # nothing was cut off
 *
 * # begins a comment. */
#ifndef CAIRN_APPEARANCE_FILE_H
#define CAIRN_APPEARANCE_FILE_H

#include "cairn/appearance.h"
#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Reads a model file, plain or gzipped. CAIRN_UNSUPPORTED: another version, or not a regular file.
 * CAIRN_BAD_FORMAT, CAIRN_TRUNCATED, CAIRN_FULL (beyond the limits of appearance.h): the error names
 * the line. CAIRN_IO, CAIRN_NO_MEMORY. On failure there is nothing to free.
 *
 * path: file, plain or gzipped
 * model: set to the model, its arrays on the heap */
CAIRN_CHECKED cairn_status cairn_appearance_file_read(cairn_appearance_model *model,
                                                      const char *path, cairn_file_error *error);

/* Writes a model file; reading it restores the same bits. CAIRN_BAD_ARGUMENT: a model that could
 * not be read again: beyond the limits of appearance.h, a number that is not finite or beyond 1e9,
 * gamma not above 0. CAIRN_IO, CAIRN_NO_MEMORY.
 *
 * path: target */
CAIRN_CHECKED cairn_status cairn_appearance_file_write(const cairn_appearance_model *model,
                                                       const char *path, cairn_file_error *error);

/* Frees the arrays of a model that was read or trained. */
void cairn_appearance_file_free(cairn_appearance_model *model);

#ifdef __cplusplus
}
#endif

#endif
