/* detection_curve_file: precision-recall curves (detection_curve) as a table and as a plot. */
#ifndef CAIRN_DETECTION_CURVE_FILE_H
#define CAIRN_DETECTION_CURVE_FILE_H

#include "cairn/detection_curve.h"
#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes STEM.csv, one line per point with confidence intervals, and STEM.svg, a plot of both
 * curves with confidence bands. CAIRN_IO, CAIRN_NO_MEMORY.
 *
 * stem: path without extension
 * title: title of the plot
 * points: [count] curve */
CAIRN_CHECKED cairn_status cairn_detection_curve_file_write(
    const char *stem, const char *title, const cairn_detection_curve_point *points, int32_t count,
    cairn_file_error *error);

#ifdef __cplusplus
}
#endif

#endif
