/* log_parameters: the parameters that the readers of all formats of logs have. Internal to the host
 * library. */
#ifndef CAIRN_HOST_LOG_PARAMETERS_H
#define CAIRN_HOST_LOG_PARAMETERS_H

#include "cairn/scan.h"
#include "src/host/base/host_parameters.h"

/* Maximum range of a scan whose log says none, m. */
static const double LOG_DEFAULT_RANGE_MAX_M = 80;

/* Rows of a table: m; 0: the maximum range of the format or of the file, and standard deviation of
 * the ranges. */
#define LOG_PARAMETERS(params)                                                                     \
    CAIRN_HOST_NUMBER(params, range_max, 0, 0, CAIRN_SCAN_EXTENT),                                 \
        CAIRN_HOST_NUMBER(params, range_sigma, 0.01, 0, CAIRN_SCAN_EXTENT)

/* Of carmen_log, whose params other readers have, too. */
extern const cairn_host_parameters cairn_carmen_log_parameters;

#endif
