/* pose_table: poses of scans as a CSV file, with what is known about each.
 *
 *   index,line,time,x,y,theta,var_x,var_y,var_theta,cov_xy,cov_xtheta,cov_ytheta,support,verdict
 *
 * index counts scans from 0, line is the scan's line in its log, time is in s, x and y in m,
 * theta in rad; the covariance is in the frame of the poses. What is not known is an empty
 * field. Numbers read back as the same bits. */
#ifndef CAIRN_POSE_TABLE_H
#define CAIRN_POSE_TABLE_H

#include "cairn/file_error.h"
#include "cairn/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CAIRN_POSE_VERDICT_BYTES 32

/* A stamp that is not known. */
#define CAIRN_POSE_NO_STAMP INT64_MIN

typedef struct cairn_pose_row {
    int64_t index;
    /* from 1; 0: not known */
    int64_t line;
    /* or CAIRN_POSE_NO_STAMP */
    int64_t stamp_ns;
    cairn_pose pose;
    /* row-major over (x, y, theta); an element that is NaN is not known */
    cairn_real covariance[9];
    /* what the method counts or measures; NaN: not known */
    cairn_real support;
    /* a word such as "placed"; "": none */
    char verdict[CAIRN_POSE_VERDICT_BYTES];
} cairn_pose_row;

/* A row of which only index and pose are known. */
cairn_pose_row cairn_pose_row_of(int64_t index, cairn_pose pose);

/* Writes a whole table, or nothing. CAIRN_NOT_FINITE: a pose, infinite covariance or support
 * (error->line counts the rows from 1); CAIRN_BAD_ARGUMENT: a verdict with a comma, quote or
 * control character; CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_pose_table_write(const char *path, const cairn_pose_row *row,
                                                  int32_t count, cairn_file_error *error);

/* Reads a table into memory that cairn_pose_table_free gives back. Columns are found by their
 * names in the first line, in any order; index, x, y and theta are needed, others may be
 * missing, unknown ones are passed over; blank lines and lines that begin with # too.
 * CAIRN_BAD_FORMAT, CAIRN_TRUNCATED, CAIRN_NOT_FINITE with the line; CAIRN_EMPTY: no row;
 * CAIRN_IO, CAIRN_UNSUPPORTED, CAIRN_NO_MEMORY. On failure there is nothing to free. */
CAIRN_CHECKED cairn_status cairn_pose_table_read(cairn_pose_row **row, int32_t *count,
                                                 const char *path, cairn_file_error *error);

void cairn_pose_table_free(cairn_pose_row *row);

#ifdef __cplusplus
}
#endif

#endif
