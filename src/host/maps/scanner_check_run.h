/* scanner_check_run: the check of the scanner of a whole log at once, and the estimate of the
 * angle step of a mapped one, with memory of the heap.
 * Internal to the host library, its programs and the Python package. */
#ifndef CAIRN_HOST_SCANNER_CHECK_RUN_H
#define CAIRN_HOST_SCANNER_CHECK_RUN_H

#include "cairn/angle_step.h"
#include "cairn/scan_log.h"
#include "cairn/scanner_check.h"

/* Checks a log; maps it where has() needs overlap_step, at the cost of cairn map. CAIRN_NO_MEMORY; CAIRN_MORE: interrupted (src/host/base/interruption.h); statuses of
 * cairn_scanner_check_begin(), where *fault, unless NULL, says which scan is refused.
 *
 * result: set to what was found */
CAIRN_CHECKED cairn_status cairn_scanner_check_run(cairn_scanner_check_result *result,
                                                   const cairn_scan_log *log, cairn_fault *fault);

/* Estimates the angle step of a mapped drive. CAIRN_NO_MEMORY; CAIRN_MORE: interrupted; statuses of
 * cairn_angle_step_begin(), likewise.
 *
 * result: set to what was found
 * scans: [count] with poses of the map */
CAIRN_CHECKED cairn_status cairn_angle_step_run(cairn_angle_step_result *result,
                                                const cairn_scanner_check_scan *scans,
                                                int32_t count, cairn_fault *fault);

#endif
