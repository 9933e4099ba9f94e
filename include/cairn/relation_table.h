/* relation_table: reference relations between the scans of a log (Kümmerle et al. 2009), from text,
 * plain or gzipped:
 *
 *   t1 t2 x y z roll pitch yaw     # the pose at time t2 seen from that at t1; s, m, rad
 *   a b x y theta                  # the same by the indices of scans, from 0
 *
 * Lines of both kinds may be mixed; blank lines and lines that begin with # are passed over. */
#ifndef CAIRN_RELATION_TABLE_H
#define CAIRN_RELATION_TABLE_H

#include "cairn/file_error.h"
#include "cairn/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cairn_relation_row {
    int64_t line;  /* from 1 */
    int32_t timed; /* 1: first and second are stamps in ns; 0: indices of scans, >= 0 */
    int64_t first, second;
    cairn_pose reference; /* the second seen from the first */
} cairn_relation_row;

/* Reads a file into memory that cairn_relation_table_free gives back. CAIRN_BAD_FORMAT,
 * CAIRN_NOT_FINITE with the line; CAIRN_EMPTY: no relation; CAIRN_IO, CAIRN_UNSUPPORTED,
 * CAIRN_NO_MEMORY. On failure there is nothing to free. */
CAIRN_CHECKED cairn_status cairn_relation_table_read(cairn_relation_row **row, int32_t *count,
                                                     const char *path, cairn_file_error *error);

void cairn_relation_table_free(cairn_relation_row *row);

/* Turns times into indices of scans with these stamps, [scans], in any order: the nearest one to
 * the microsecond, of equally near ones the earlier. A row of which a time or an index is none
 * of the scans' gets first = second = -1. Returns how many rows were found, or -1: no memory. n
 * log n. */
int32_t cairn_relation_table_find(cairn_relation_row *row, int32_t count, const int64_t *stamp_ns,
                                  int32_t scans);

#ifdef __cplusplus
}
#endif

#endif
