/* Internal state shared by virtual_align.c and virtual_align_step.c. */
#ifndef CAIRN_FIELDS_VIRTUAL_ALIGN_WORK_H
#define CAIRN_FIELDS_VIRTUAL_ALIGN_WORK_H

#include "cairn/virtual_align.h"
#include "src/base/object.h"
#include "src/base/step.h"

/* Table of the parameters. */
extern const cairn_parameters cairn_virtual_align_parameters;

/* A scan: its initial pose, the aligner's result, and whether the field moves it. */
struct virtual_align_place {
    cairn_pose start;
    cairn_aligner_pose aligned;
    int32_t moves;
};

struct cairn_virtual_align {
    cairn_aligner *aligner;
    cairn_force_field *field;
    cairn_virtual_scan *hypotheses;
    cairn_weak_direction *weak_direction;
    /* [max_scans] */
    struct virtual_align_place *places;
    /* [max_scans] initial poses of the aligner's next run, or its results */
    cairn_pose *poses;
    /* [max_scans] poses in the stored result */
    cairn_pose *stored_poses;
    /* Resume points of the alignment and of its phase, 0 and is_complete before begin(). */
    int32_t resume, phase_resume;
    int32_t is_complete;
    /* status of the last step of a nested object; below 0 it ends a call of a step */
    cairn_status status;
    /* 1: this call is to return at the next result; 1: it returns there */
    int32_t stops_at_result, has_stopped;
    /* 1: `places` have the result of the first alignment; 1: the field is ahead of them */
    int32_t is_stored, is_field_ahead;
    /* current scan */
    int32_t cursor;
    /* iterations of the field since the last virtual scan */
    int32_t iterations_since_scan;
    int32_t scan_count;
    /* 1: an iteration of the field is in progress */
    int32_t is_iterating;
    /* m: error of the initial poses */
    cairn_real initial_spread;
    cairn_virtual_align_result result;
    int32_t units_charged;
    cairn_virtual_align_params params;
};

static inline void cairn_virtual_align_must(cairn_status status)
{
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
}

/* ---- virtual_align_step.c ---- */

/* The alignment; 1 when it has ended, 0 when the budget is used up, iterate() is to return, or a
 * status is below 0. */
int cairn_virtual_align_run(cairn_virtual_align *align, cairn_budget *budget);

#endif
