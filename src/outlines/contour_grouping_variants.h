/* Variants of contour_grouping for ablation studies: further values of the field `mode` of
 * cairn_contour_grouping_params. _check() accepts them, and says the range of the public ones. */
#ifndef CAIRN_OUTLINES_CONTOUR_GROUPING_VARIANTS_H
#define CAIRN_OUTLINES_CONTOUR_GROUPING_VARIANTS_H

#include "cairn/contour_grouping.h"

enum {
    /* The default mode with particles that are not weighted by the model. */
    CAIRN_CONTOUR_GROUPING_NO_MODEL = CAIRN_MODE_DEFAULT - 2,
    /* Added to CAIRN_MODE_AS_WRITTEN: the same there. */
    CAIRN_CONTOUR_GROUPING_WRITTEN_NO_MODEL = 2,
    /* Added to CAIRN_MODE_AS_WRITTEN: (2.9) to the letter. Draws represent the prior (2.11), weights
     * are by (2.13) alone, and equal after resampling. */
    CAIRN_CONTOUR_GROUPING_WRITTEN_LETTER = 4,
    /* Both, the greatest that is added. */
    CAIRN_CONTOUR_GROUPING_WRITTEN_ALL =
        CAIRN_CONTOUR_GROUPING_WRITTEN_NO_MODEL + CAIRN_CONTOUR_GROUPING_WRITTEN_LETTER
};

/* Whether the mode is a variant of a public one. */
static inline int contour_grouping_is_variant(int32_t mode)
{
    return mode == CAIRN_CONTOUR_GROUPING_NO_MODEL ||
           mode == CAIRN_MODE_AS_WRITTEN + CAIRN_CONTOUR_GROUPING_WRITTEN_NO_MODEL ||
           mode == CAIRN_MODE_AS_WRITTEN + CAIRN_CONTOUR_GROUPING_WRITTEN_LETTER ||
           mode == CAIRN_MODE_AS_WRITTEN + CAIRN_CONTOUR_GROUPING_WRITTEN_ALL;
}

/* Whether the mode is the one as written with a variant of it. */
static inline int contour_grouping_written_is(const cairn_contour_grouping_params *params,
                                              int32_t variant)
{
    return params->mode > CAIRN_MODE_AS_WRITTEN &&
           ((params->mode - CAIRN_MODE_AS_WRITTEN) & variant) != 0;
}

/* Sets a variant of params of either mode: without weights by the model, without symmetry in the
 * proposal. */
static inline void contour_grouping_ablate(cairn_contour_grouping_params *params, int no_model,
                                           int no_skeleton)
{
    if (no_model)
        params->mode = params->mode >= CAIRN_MODE_AS_WRITTEN
                           ? params->mode + CAIRN_CONTOUR_GROUPING_WRITTEN_NO_MODEL
                           : CAIRN_CONTOUR_GROUPING_NO_MODEL;
    if (no_skeleton)
        params->symmetry_sigma = CAIRN_REAL_MAX;
}

#endif
