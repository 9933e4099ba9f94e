/* scan_log: a CARMEN log for a tool: loaded whole, its faults told. */
#ifndef CAIRN_TOOLS_SCAN_LOG_H
#define CAIRN_TOOLS_SCAN_LOG_H

#include "cairn/carmen_log.h"

/* Loads the log and prints a line for each of the first damaged lines. Returns EXIT_DONE, or prints what is wrong and returns another
 * code. range_max in m; 0: by the log. */
int scan_log_load(cairn_carmen_scans *scans, const char *path, double range_max);

#endif
