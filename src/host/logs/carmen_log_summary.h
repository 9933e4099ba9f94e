/* carmen_log_summary: summary of scans that other readers have loaded. Internal to the host
 * library. */
#ifndef CAIRN_HOST_CARMEN_LOG_SUMMARY_H
#define CAIRN_HOST_CARMEN_LOG_SUMMARY_H

#include "cairn/carmen_log.h"

/* Fills the counts of scans and beams, the stamps and the odometry's path of the summary from the
 * records; the other fields stay as they are. */
void cairn_carmen_log_summarize(cairn_carmen_log_scans *scans);

#endif
