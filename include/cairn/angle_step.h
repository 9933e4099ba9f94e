/* angle_step: true angle step of a scanner, from overlapping scans of a mapped drive, and whether it
 * is the one that a known mistake of drivers hides.
 *
 *     begin(drive) -> step(budget) until CAIRN_OK -> read() -> mistake(first scan) -> is_mistake()
 *
 * The same surfaces seen from two places have the same shape only with the true step. The poses are
 * those of a map, as pairs of different times and headings are needed: what is measured wrongly at a
 * slant then cancels. */
#ifndef CAIRN_ANGLE_STEP_H
#define CAIRN_ANGLE_STEP_H

#include "cairn/object.h"
#include "cairn/pool.h"
#include "cairn/scanner_check.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Estimate of the angle step. */
typedef struct cairn_angle_step cairn_angle_step;

/* Parameters; defaults in brackets. */
typedef struct cairn_angle_step_params {
    /* 1 ... 100,000 (1024): beams of a scan */
    int32_t max_beams;
    /* 2 ... 65536 (2000): pairs of scans that are aligned, spread over the drive */
    int32_t max_pairs;
} cairn_angle_step_params;

/* Returns the default parameters. */
cairn_angle_step_params cairn_angle_step_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_angle_step_check(const cairn_angle_step_params *params,
                                                  cairn_object_fault *fault);

/* Returns the bytes that create() takes; 0 for params that create() would refuse. */
size_t cairn_angle_step_memory(const cairn_angle_step_params *params);

/* Creates the object in memory of the pool. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_angle_step_create(cairn_angle_step **angle_step, cairn_pool *pool,
                                                   const cairn_angle_step_params *params);

/* Takes the scans of a drive, `robot` being their poses in a map, which must not change until step() returns CAIRN_OK; a
 * running estimate is cancelled. CAIRN_BAD_ARGUMENT: NULL, a scan without ranges or below one beam.
 * CAIRN_EMPTY: no scan. CAIRN_FULL: a scan of more than max_beams. CAIRN_NOT_FINITE: a pose. *fault
 * gives the index of the scan. Cost: linear in the scans.
 *
 * scans: [count] scans in the order of the drive */
CAIRN_CHECKED cairn_status cairn_angle_step_begin(cairn_angle_step *angle_step,
                                                  const cairn_scanner_check_scan *scans,
                                                  int32_t count, cairn_fault *fault);

/* Continues. CAIRN_OK: the result is there. CAIRN_MORE: the budget is used up. CAIRN_BAD_ARGUMENT:
 * NULL. All pairs are aligned twice. The most expensive item is linear in the beams of a scan. The
 * result does not depend on the budgets. */
CAIRN_CHECKED cairn_status cairn_angle_step_step(cairn_angle_step *angle_step,
                                                 cairn_budget *budget);

/* What was found. */
typedef struct cairn_angle_step_result {
    /* pairs of scans that were aligned and overlap */
    int32_t pairs;
    /* rad, > 0: mean angle from beam to beam of the first scan, as logged; 0: one beam */
    cairn_real logged;
    /* true angle step per logged one; its standard deviation is that of the jackknife over 20 parts
     * of the drive, together with 0.06 % of what the surfaces of buildings leave */
    cairn_scanner_check_value ratio;
} cairn_angle_step_result;

/* Returns the result of the last estimate; all 0 until step() returns CAIRN_OK. */
cairn_angle_step_result cairn_angle_step_read(const cairn_angle_step *angle_step);

/* Returns the work units that the last estimate was charged. */
int64_t cairn_angle_step_units(const cairn_angle_step *angle_step);

/* Returns the angle step, rad, that the scanner has when the driver made a known mistake; 0 when the
 * scan does not look like it. The mistake: the field of view of n round steps, multiples of 0.05
 * degrees, is taken for that from the first to the last of n beams, which are n - 1 steps apart.
 * Simulated scanners look like this without a mistake, so that is_mistake() must decide.
 *
 * scan: any scan */
cairn_real cairn_angle_step_mistake(const cairn_scan_input *scan);

/* Returns 1 when the estimate contradicts the logged step by more than four standard deviations and
 * 0.2 %, and agrees with `mistake` within three.
 *
 * result: of an estimate
 * mistake: rad, of cairn_angle_step_mistake(); 0: none */
int32_t cairn_angle_step_is_mistake(const cairn_angle_step_result *result, cairn_real mistake);

#ifdef __cplusplus
}
#endif

#endif
