/* Variants of contour_grouping for ablation studies: further values of the field `mode` of
 * cairn_contour_grouping_params. */
#ifndef CAIRN_OUTLINES_CONTOUR_GROUPING_VARIANTS_H
#define CAIRN_OUTLINES_CONTOUR_GROUPING_VARIANTS_H

#include "cairn/contour_grouping.h"

enum {
    /* The modes with particles that are not weighted by the model. */
    CAIRN_CONTOUR_GROUPING_NO_MODEL = CAIRN_MODE_DEFAULT - 1,
    CAIRN_CONTOUR_GROUPING_AS_WRITTEN_NO_MODEL = CAIRN_MODE_AS_WRITTEN + 1
};

/* Sets a variant of params of either mode: without weights by the model, without symmetry in the
 * proposal. */
static inline void contour_grouping_ablate(cairn_contour_grouping_params *params, int no_model,
                                           int no_skeleton)
{
    if (no_model)
        params->mode = params->mode == CAIRN_MODE_AS_WRITTEN
                           ? CAIRN_CONTOUR_GROUPING_AS_WRITTEN_NO_MODEL
                           : CAIRN_CONTOUR_GROUPING_NO_MODEL;
    if (no_skeleton)
        params->symmetry_sigma = CAIRN_REAL_MAX;
}

#endif
