/* regular_file: opens input files. Folders, pipes and devices are refused: a pipe without a writer
 * would block for ever. Internal to the host library. */
#ifndef CAIRN_HOST_REGULAR_FILE_H
#define CAIRN_HOST_REGULAR_FILE_H

#include <stdio.h>

#include "cairn/file_error.h"

/* Opens a regular file for reading; its descriptor, its stream. CAIRN_IO, CAIRN_NO_MEMORY;
 * CAIRN_UNSUPPORTED: a folder, pipe or device. */
CAIRN_CHECKED cairn_status regular_file_descriptor(int *file, const char *path,
                                                   cairn_file_error *error);
CAIRN_CHECKED cairn_status regular_file_open(FILE **stream, const char *path,
                                             cairn_file_error *error);

#endif
