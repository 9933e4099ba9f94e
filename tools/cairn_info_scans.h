/* The table of ranges that cairn info --scans writes. */
#ifndef CAIRN_TOOLS_CAIRN_INFO_SCANS_H
#define CAIRN_TOOLS_CAIRN_INFO_SCANS_H

#include "cairn/scan_log.h"

/* Writes all scans of a log as a table of ranges (docs/formats.md): stamps, the poses of the
 * sensor where the log has odometry, and the ranges with all bits. CAIRN_BAD_FORMAT: the scans
 * differ in their bearings. CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status info_scans_write(const cairn_scan_log *log, const char *path,
                                            cairn_file_error *error);

#endif
