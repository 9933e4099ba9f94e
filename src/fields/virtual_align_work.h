/* Internal state shared by virtual_align.c and virtual_align_step.c. */
#ifndef CAIRN_MAPPING_VIRTUAL_ALIGN_WORK_H
#define CAIRN_MAPPING_VIRTUAL_ALIGN_WORK_H

#include "cairn/virtual_align.h"

/* Phases in their order. */
typedef int32_t virtual_align_phase;
enum {
    VIRTUAL_ALIGN_IDLE,
    VIRTUAL_ALIGN_FIRST, /* first run of the aligner */
    VIRTUAL_ALIGN_STORE, /* store its result */
    VIRTUAL_ALIGN_PLACE, /* scans into the field */
    VIRTUAL_ALIGN_BEGIN_SLIDE,
    VIRTUAL_ALIGN_SLIDE,
    VIRTUAL_ALIGN_APPLY_SLIDE,
    VIRTUAL_ALIGN_GATHER,       /* map of the hypotheses */
    VIRTUAL_ALIGN_DETECT,       /* hypotheses */
    VIRTUAL_ALIGN_ITERATE,      /* iterations of the field */
    VIRTUAL_ALIGN_RETURN_POSES, /* poses of the field to the aligner */
    VIRTUAL_ALIGN_REALIGN,      /* next run of the aligner */
    VIRTUAL_ALIGN_COMPARE       /* with the stored result */
};

/* A scan: its initial pose, the aligner's result, and whether the field moves it. */
struct virtual_align_place {
    cairn_pose start;
    cairn_aligner_pose aligned;
    int32_t moves;
};

struct cairn_virtual_align {
    cairn_virtual_align_params params;
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
    virtual_align_phase phase;
    /* current scan */
    int32_t cursor;
    /* iterations of the field since the last virtual scan */
    int32_t iterations_since_scan;
    int32_t scan_count;
    /* 1: an iteration of the field is in progress */
    int32_t is_iterating;
    /* 1: the last round has not improved the result */
    int32_t is_done;
    /* m: error of the initial poses */
    cairn_real initial_spread;
    cairn_virtual_align_result result;
    int32_t units_charged;
};

static inline void cairn_virtual_align_must(cairn_status status)
{
    CAIRN_ASSERT(status == CAIRN_OK);
    (void)status;
}

/* ---- virtual_align_step.c ---- */

/* Processes the current phase to its end and advances to the next. CAIRN_MORE: the budget is used
 * up. */
cairn_status cairn_virtual_align_run_phase(cairn_virtual_align *align, cairn_budget *budget);

#endif
