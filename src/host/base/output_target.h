/* output_target: what the path of an output refers to. Internal to the host library. */
#ifndef CAIRN_HOST_OUTPUT_TARGET_H
#define CAIRN_HOST_OUTPUT_TARGET_H

#include <stdbool.h>
#include <sys/stat.h>

#include "cairn/file_error.h"

/* The target of an output. */
typedef struct output_target {
    char *path; /* with symbolic links resolved, of a device the caller's; to be freed */
    bool exists;
    bool direct;       /* a device or pipe: written directly, never replaced */
    struct stat about; /* when it exists */
} output_target;

/* Finds the target of a path. CAIRN_IO: it is a folder, or a symbolic link to nothing;
 * CAIRN_NO_MEMORY. On failure there is nothing to be freed. */
CAIRN_CHECKED cairn_status output_target_find(output_target *target, const char *path,
                                              cairn_file_error *error);

/* Gives the file that will replace an existing target its mode and, where that is allowed, its
 * owner. Returns 0, or errno. */
int32_t output_target_keep_mode(const output_target *target, const char *replacement);

#endif
