/* scan_correction: corrects what a log says wrongly of its scanner: unit of the ranges, sense and
 * step of the bearings, duration of a scan, mounting. Internal to the host library and its
 * programs. */
#ifndef CAIRN_HOST_SCAN_CORRECTION_H
#define CAIRN_HOST_SCAN_CORRECTION_H

#include "cairn/scan_log.h"

/* What is corrected; cairn_scan_correction_none() leaves all as logged. */
typedef struct cairn_scan_correction {
    double range_scale; /* > 0: factor of all ranges, 0.001 for a log in mm */
    double range_max;   /* m, > 0: scaled ranges from this value on are no returns; 0: none */
    double angle_step;  /* rad, > 0: mean angle between neighbouring beams; 0: as logged */
    double sweep;       /* s: first to last beam; < 0: the last is measured first; 0: as logged */
    int32_t flips;      /* 1: the scanner is upside down: bearings change their sign */
    int32_t has_sensor; /* 1: base_sensor replaces the mounting of the log */
    cairn_pose base_sensor; /* m, m, rad */
} cairn_scan_correction;

cairn_scan_correction cairn_scan_correction_none(void);

/* 1 when the correction leaves all as logged. */
int32_t cairn_scan_correction_is_none(const cairn_scan_correction *correction);

/* Returns the bearing of a beam, rad. */
float cairn_scan_bearing(const cairn_scan_input *scan, int32_t beam);

/* Returns the mean angle from beam to beam, rad, > 0 when bearings grow; 0 for one beam. */
double cairn_scan_mean_step(const cairn_scan_input *scan);

/* Corrects a scan. The bearing in the middle of the field of view is kept when the step changes; a
 * sweep that ends with the first beam reverses the order of the beams.
 *
 * range, angle: [scan->count] set to the corrected ranges and bearings, to which the scan then
 * refers */
void cairn_scan_correct(const cairn_scan_correction *correction, cairn_scan_input *scan,
                        float *range, float *angle);

/* Corrects all scans of a log. CAIRN_NO_MEMORY: the log is unchanged. */
CAIRN_CHECKED cairn_status cairn_scan_log_correct(cairn_scan_log *log,
                                                  const cairn_scan_correction *correction);

/* Quartiles of all ranges that are returns, in the log's unit; all 0: there is none.
 * CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_scan_log_quartiles(const cairn_scan_log *log, double quartile[3]);

/* Returns from which range on, m, scaled ranges count as no returns: `limit` of the log in the unit
 * of its ranges, or, when half of the ranges would exceed that or no scanner sees so far, in m.
 *
 * limit: greatest range that the log states
 * median: of the ranges, in the unit of the log
 * scale: range_scale */
double cairn_scan_correction_limit(double limit, double median, double scale);

#endif
