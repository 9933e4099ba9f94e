/* pose_table: reader and writer of a trajectory as a CSV file: the pose, covariance and status of
 * every scan.
 *
 *   index,line,time,x,y,theta,var_x,var_y,var_theta,cov_xy,cov_xtheta,cov_ytheta,support,verdict,
 *   map_sigma                                                                     (in one line)
 *
 * index counts scans from 0, line is the scan's line in its log, time is in s, x and y in m, theta
 * in rad. The covariance is in the frame of the poses, in m^2, rad^2 and m rad. An empty field is
 * unknown. Numbers are written so that they read back bit-exactly. */
#ifndef CAIRN_POSE_TABLE_H
#define CAIRN_POSE_TABLE_H

#include "cairn/file_error.h"
#include "cairn/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Capacity of a verdict in bytes, with the terminating 0. */
#define CAIRN_POSE_TABLE_VERDICT_BYTES 32

/* An unknown stamp. */
#define CAIRN_POSE_TABLE_NO_STAMP INT64_MIN

/* One row of the table. */
typedef struct cairn_pose_table_row {
    /* of the scan, from 0 */
    int64_t index;
    /* line of the scan in its log, from 1; 0: unknown */
    int64_t line;
    /* ns, or CAIRN_POSE_TABLE_NO_STAMP */
    int64_t stamp_ns;
    /* m, m, rad */
    cairn_pose pose;
    /* 3 x 3 row-major over (x, y, theta); NaN: unknown element */
    cairn_real covariance[9];
    /* evidence for the pose as defined by the method that estimated it; NaN: unknown */
    cairn_real support;
    /* status of the pose, a word such as "placed"; "": none */
    char verdict[CAIRN_POSE_TABLE_VERDICT_BYTES];
    /* m: standard deviation of the position in the map, given how the robot came there; NaN:
     * unknown */
    cairn_real map_sigma;
} cairn_pose_table_row;

/* Returns a row with an index and a pose and all other fields unknown.
 *
 * index: index of the scan
 * pose: m and rad */
cairn_pose_table_row cairn_pose_table_row_of(int64_t index, cairn_pose pose);

/* Writes a table atomically. CAIRN_NOT_FINITE: a pose that is not finite, or an infinite covariance,
 * support or map_sigma (error->line is the row, from 1); CAIRN_BAD_ARGUMENT: a verdict with a comma, quote or
 * control character; CAIRN_IO, CAIRN_NO_MEMORY.
 *
 * path: target
 * row: [count] rows */
CAIRN_CHECKED cairn_status cairn_pose_table_write(const char *path, const cairn_pose_table_row *row,
                                                  int32_t count, cairn_file_error *error);

/* Reads a table into an array on the heap, to be freed by cairn_pose_table_free(). Columns are
 * identified by their names in the header line, in any order. index, x, y and theta are required,
 * others are optional, unknown columns are ignored. Blank lines and lines that begin with # are
 * skipped. CAIRN_BAD_FORMAT, CAIRN_TRUNCATED, CAIRN_NOT_FINITE with the line; CAIRN_EMPTY: no row;
 * CAIRN_IO, CAIRN_UNSUPPORTED, CAIRN_NO_MEMORY. On failure there is nothing to free.
 *
 * row: set to the rows
 * count: set to their number
 * path: file, plain or gzipped */
CAIRN_CHECKED cairn_status cairn_pose_table_read(cairn_pose_table_row **row, int32_t *count,
                                                 const char *path, cairn_file_error *error);

/* Frees the array. NULL is allowed.
 *
 * row: rows that were read */
void cairn_pose_table_free(cairn_pose_table_row *row);

#ifdef __cplusplus
}
#endif

#endif
