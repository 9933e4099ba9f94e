/* scan_table: writes the scans of a log as a table of ranges. Internal to the host library and its
 * programs. */
#ifndef CAIRN_HOST_SCAN_TABLE_H
#define CAIRN_HOST_SCAN_TABLE_H

#include "cairn/scan_log.h"

/* Writes all scans of a log as a table of ranges (docs/formats.md): stamps, the poses of the
 * sensor where the log has odometry, and the ranges with all bits. CAIRN_BAD_FORMAT: the scans
 * differ in their bearings. CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_scan_table_write(const cairn_scan_log *log, const char *path,
                                                  cairn_file_error *error);

#endif
