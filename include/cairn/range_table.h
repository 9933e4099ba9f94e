/* range_table: scans from tables of ranges, plain or gzipped, one scan a line.
 *
 * CSV. The first line that is neither blank nor begins with # names the columns: `time` (s), `x`,
 * `y`, `theta` (m, m, rad: where odometry sees the robot; all three or none), and bearings in
 * degrees, counter-clockwise, 0 ahead, such as -90,-89.5, ... 90. The other lines have a number for
 * every column: a range in m; empty, 0 or nan: nothing known; inf: nothing came back. Lines that
 * begin with # are comments. Without `time` the scans are a tenth of a second apart.
 *
 * URG. Every line has 707 numbers that blanks separate: [0] time in microseconds, [2], [3] ticks of
 * the left and the right wheel, [25 ... 706] ranges in mm; range i of the 682 points to (i - 341) *
 * 360 / 1024 degrees. Ranges below 20 mm are words of fault: nothing known. The scanner sees 5.6 m,
 * turns counter-clockwise ten times a second, and sits 0.145 m before the axle. A wheel has 2,000
 * ticks a turn and a radius of 77 mm; the wheels act as if 0.31 m apart. The ticks give the
 * odometry, unless they never change. They are newer than the ranges of their line, by 0.17 s in
 * three logs, so that a scan has the pose of so long before, as far as the times of the lines run
 * on (not backwards, nor by more than 0.2 s from line to line).
 *
 * Damage. A line with another number of fields, or a field that is no number, is reported,
 * counted and left out. Only a file without any scan is an error. */
#ifndef CAIRN_RANGE_TABLE_H
#define CAIRN_RANGE_TABLE_H

#include "cairn/carmen_log.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef int32_t cairn_range_table_kind;
enum {
    CAIRN_RANGE_TABLE_NONE = 0, /* neither; a CARMEN log perhaps */
    CAIRN_RANGE_TABLE_CSV = 1,
    CAIRN_RANGE_TABLE_URG = 2
};

/* What a file seems to be, by its first hundred lines: that of the first one that is the head of
 * a CSV table or has as many numbers as the URG's. Statuses of opening a file. */
CAIRN_CHECKED cairn_status cairn_range_table_find_kind(cairn_range_table_kind *kind,
                                                       const char *path, cairn_file_error *error);

/* Reads a table as a log; records without odometry have the identity as pose of the robot.
 * *has_odometry: 1 when the table has x, y and theta, or wheels that turn. params as for a
 * CARMEN log: a range_max of 0 is 80 m for CSV, what the scanner sees for URG. CAIRN_BAD_FORMAT:
 * a head with a name that is unknown or comes twice, or without bearings; CAIRN_EMPTY: no scan;
 * others as cairn_carmen_load(). On failure there is nothing to free. */
CAIRN_CHECKED cairn_status cairn_range_table_load(cairn_carmen_scans *scans, int32_t *has_odometry,
                                                  const char *path, cairn_range_table_kind kind,
                                                  const cairn_carmen_params *params,
                                                  cairn_file_error *error);

#ifdef __cplusplus
}
#endif

#endif
