/* relation_table: reader of reference relations between the scans of a log, the ground truth of the
 * SLAM benchmark of Kümmerle et al. (2009), from text, plain or gzipped.
 *
 *   t1 t2 x y z roll pitch yaw     # relative pose of time t2 in the frame of time t1; s, m, rad
 *   a b x y theta                  # relative pose of scan b in the frame of scan a, from 0
 *
 * Lines of both kinds may be mixed. Blank lines and lines that begin with # are skipped. */
#ifndef CAIRN_RELATION_TABLE_H
#define CAIRN_RELATION_TABLE_H

#include "cairn/file_error.h"
#include "cairn/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* One relation. */
typedef struct cairn_relation_table_row {
    int64_t line;  /* from 1 */
    int32_t timed; /* 1: first and second are stamps in ns; 0: indices of scans, >= 0 */
    /* scans of the relation: as in the file, or indices after cairn_relation_table_find() */
    int64_t first, second;
    cairn_pose reference; /* relative pose of the second in the frame of the first; m, m, rad */
} cairn_relation_table_row;

/* Reads a file into an array on the heap, to be freed by cairn_relation_table_free().
 * CAIRN_BAD_FORMAT, CAIRN_NOT_FINITE with the line; CAIRN_EMPTY: no relation; CAIRN_IO,
 * CAIRN_UNSUPPORTED, CAIRN_NO_MEMORY. On failure there is nothing to free.
 *
 * row: set to the rows
 * count: set to their number
 * path: file, plain or gzipped */
CAIRN_CHECKED cairn_status cairn_relation_table_read(cairn_relation_table_row **row, int32_t *count,
                                                     const char *path, cairn_file_error *error);

/* Frees the array. NULL is allowed.
 *
 * row: rows that were read */
void cairn_relation_table_free(cairn_relation_table_row *row);

/* Replaces times by indices of the scans with the stamps stamp_ns[scans], in any order. A time is
 * associated with the nearest stamp within half a scan period (the median time from a scan to the
 * next) and at least 1 us, the earlier of equals: stamps of a log may be rounded. A row with a time
 * or index without a scan gets first = second = -1. Returns the number of rows found, or -1: out of
 * memory. O(n log n).
 *
 * row: [count] rows
 * stamp_ns: [scans] stamps of the scans, ns; CAIRN_POSE_TABLE_NO_STAMP: no scan of that index */
int32_t cairn_relation_table_find(cairn_relation_table_row *row, int32_t count,
                                  const int64_t *stamp_ns, int32_t scans);

#ifdef __cplusplus
}
#endif

#endif
