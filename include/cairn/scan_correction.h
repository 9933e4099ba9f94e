/* scan_correction: corrects what is set wrongly of a scanner: unit of the ranges, sense and step of
 * the bearings, duration of a scan, mounting pose. What is wrong scanner_check finds. */
#ifndef CAIRN_SCAN_CORRECTION_H
#define CAIRN_SCAN_CORRECTION_H

#include "cairn/scan.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What is corrected; cairn_scan_correction_none() leaves all as it is. */
typedef struct cairn_scan_correction {
    /* > 0: factor of all ranges, 0.001 for ranges in mm */
    cairn_real range_scale;
    /* m, > 0: scaled ranges from this value on are no returns; 0: none */
    cairn_real range_max;
    /* rad, > 0: mean angle between neighbouring beams; 0: that of the scan */
    cairn_real angle_step;
    /* s: first to last beam; < 0: the last is measured first; 0: that of the scan */
    cairn_real sweep;
    /* 1: the scanner is upside down: bearings change their sign */
    int32_t flips;
    /* 1: base_sensor replaces the mounting of the scan */
    int32_t has_sensor;
    /* mounting pose of the sensor on the robot */
    cairn_pose base_sensor;
} cairn_scan_correction;

/* Returns the correction that leaves all as it is. */
cairn_scan_correction cairn_scan_correction_none(void);

/* 1 when the correction leaves all as it is. */
int32_t cairn_scan_correction_is_none(const cairn_scan_correction *correction);

/* Returns the bearing of a beam, rad.
 *
 * scan: any scan
 * beam: 0 ... count - 1 */
float cairn_scan_correction_bearing(const cairn_scan_input *scan, int32_t beam);

/* Returns the mean angle from beam to beam, rad, > 0 when bearings grow; 0 for one beam.
 *
 * scan: any scan */
cairn_real cairn_scan_correction_mean_step(const cairn_scan_input *scan);

/* Returns from which range on, m, scaled ranges count as no returns: `limit` in the unit of the
 * ranges, or, when half of the ranges would exceed that or no scanner sees so far, in m.
 *
 * limit: greatest range that the scans state
 * median: of the ranges, in their unit
 * scale: range_scale */
cairn_real cairn_scan_correction_limit(cairn_real limit, cairn_real median, cairn_real scale);

/* Corrects a scan. The bearing in the middle of the field of view is kept when the step changes; a
 * sweep that ends with the first beam reverses the order of the beams. Cost: linear in the beams.
 *
 * correction: what is corrected
 * scan: at least one beam; it is set to refer to the arrays
 * range, angle: [scan->count] set to the corrected ranges and bearings */
void cairn_scan_correction_apply(const cairn_scan_correction *correction, cairn_scan_input *scan,
                                 float *range, float *angle);

#ifdef __cplusplus
}
#endif

#endif
