/* range_table: reader of laser scans from tables of ranges, plain or gzipped, one scan a line.
 *
 * CSV. The header is the first line that is neither blank nor begins with #. It names the columns:
 * `time` (s); `x`, `y`, `theta` (the robot's odometry pose in m, m, rad; all three or none); and
 * bearings in degrees, counter-clockwise, 0 ahead, such as -90,-89.5, ... 90. Every other line has
 * one number for each column. A range is in m; empty, 0 or nan: invalid reading; inf: no return.
 * Lines that begin with # are comments. Without `time` the scans are 0.1 s apart.
 *
 * URG. Every line has 707 numbers separated by blanks: [0] time in microseconds, [2], [3] encoder
 * ticks of the left and the right wheel, [25 ... 706] ranges in mm. Range i of the 682 has the
 * bearing (i - 341) * 360 / 1024 degrees. Ranges below 20 mm are error codes: invalid readings. The
 * scanner's maximum range is 5.6 m; it rotates counter-clockwise ten times a second and is mounted
 * 0.145 m in front of the axle. A wheel has 2,000 ticks a turn and a radius of 77 mm; the effective
 * wheel separation is 0.31 m. The ticks give differential-drive odometry, unless they never change.
 * They are newer than the ranges of their line, by 0.17 s in three logs. A scan therefore gets the
 * odometry pose of 0.17 s earlier, interpolated, as far back as the times of the lines are
 * continuous (increasing in steps of at most 0.2 s).
 *
 * Faults. A line with another number of fields, or with a field that is not a number, is reported,
 * counted and skipped. Only a file without any scan is an error. */
#ifndef CAIRN_RANGE_TABLE_H
#define CAIRN_RANGE_TABLE_H

#include "cairn/carmen_log.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The format of a table. */
typedef int32_t cairn_range_table_kind;
enum {
    CAIRN_RANGE_TABLE_NONE = 0, /* neither format; possibly a CARMEN log */
    /* values between commas, semicolons or tabs, with a header */
    CAIRN_RANGE_TABLE_CSV = 1,
    /* log of a URG scanner */
    CAIRN_RANGE_TABLE_URG = 2
};

/* Detects the format of a file by its first hundred lines: the first line that is a CSV header or
 * has as many numbers as a URG line decides. Statuses of opening a file.
 *
 * kind: set to the format
 * path: file, plain or gzipped */
CAIRN_CHECKED cairn_status cairn_range_table_find_kind(cairn_range_table_kind *kind,
                                                       const char *path, cairn_file_error *error);

/* Reads a table as the scans of a log. Records without odometry have the identity as the robot's
 * pose. *has_odometry: 1 when the table has x, y and theta, or wheel ticks that change. params as
 * for a CARMEN log; a range_max of 0 is 80 m for CSV and the scanner's maximum range for URG.
 * CAIRN_BAD_FORMAT: a header with an unknown or duplicate name, or without bearings; CAIRN_EMPTY:
 * no scan; others as cairn_carmen_log_load(). On failure there is nothing to free.
 *
 * scans: set to the scans
 * path: file, plain or gzipped
 * kind: format of the file */
CAIRN_CHECKED cairn_status cairn_range_table_load(cairn_carmen_log_scans *scans,
                                                  int32_t *has_odometry, const char *path,
                                                  cairn_range_table_kind kind,
                                                  const cairn_carmen_log_params *params,
                                                  cairn_file_error *error);

#ifdef __cplusplus
}
#endif

#endif
