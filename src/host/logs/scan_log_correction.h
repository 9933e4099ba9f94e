/* Corrections of all scans of a log, and what they need to know of it. Internal to the host library
 * and its programs. */
#ifndef CAIRN_HOST_SCAN_LOG_CORRECTION_H
#define CAIRN_HOST_SCAN_LOG_CORRECTION_H

#include "cairn/scan_correction.h"
#include "cairn/scan_log.h"

/* Corrects all scans of a log. CAIRN_NO_MEMORY: the log is unchanged. */
CAIRN_CHECKED cairn_status cairn_scan_log_correct(cairn_scan_log *log,
                                                  const cairn_scan_correction *correction);

/* Quartiles of all ranges that are returns, in the log's unit; all 0: there is none.
 * CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_scan_log_quartiles(const cairn_scan_log *log, double quartile[3]);

#endif
