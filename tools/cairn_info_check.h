/* Result of cairn info --check: faults of the scanner's set-up, each with its evidence and the
 * option that mends it. */
#ifndef CAIRN_TOOLS_CAIRN_INFO_CHECK_H
#define CAIRN_TOOLS_CAIRN_INFO_CHECK_H

#include "cairn/scanner_check.h"
#include "tools/cairn_tool.h"

/* Checks a loaded log; where nearly no beam returns, its ranges as they are in the file. TOOL_OK;
 * or another exit code after a line on standard error. */
int info_check_run(cairn_scanner_check_result *check, const cairn_scan_log *log, const char *path,
                   const tool_log_options *options);

/* Prints the check as lines of the summary. */
void info_check_print(const cairn_scanner_check_result *check);

/* Writes the object "check"; null for NULL. */
void info_check_write(cairn_json_writer *json, const cairn_scanner_check_result *check);

#endif
