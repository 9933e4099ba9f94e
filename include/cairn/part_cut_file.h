/* part_cut_file: reader of manual fragments of an outline and their part bundles, as a text file.
 *
 *   0 31 0                           # first and last sample of the outline, in order; bundle
 *   31 60 1
 *
 * Numbers are separated by blanks. # begins a comment. Samples are those of the model's first
 * outline (cairn model), from 0. */
#ifndef CAIRN_PART_CUT_FILE_H
#define CAIRN_PART_CUT_FILE_H

#include "cairn/file_error.h"
#include "cairn/part_bundle.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Reads the fragments, plain or gzipped. CAIRN_BAD_FORMAT: a line is not in the format above;
 * CAIRN_FULL: more than CAIRN_PART_MAX_FRAGMENTS; CAIRN_EMPTY: none; CAIRN_TRUNCATED (gzip),
 * CAIRN_UNSUPPORTED (not a regular file), CAIRN_IO, CAIRN_NO_MEMORY. The error has the line; on
 * failure *count is 0. Limits: the samples are not checked against an outline.
 *
 * cuts: set to the fragments
 * path: file, plain or gzipped
 * count: set to their number; 0 on failure */
CAIRN_CHECKED cairn_status
cairn_part_cut_file_read(cairn_part_bundle_cut cuts[CAIRN_PART_MAX_FRAGMENTS], int32_t *count,
                         const char *path, cairn_file_error *error);

#ifdef __cplusplus
}
#endif

#endif
