/* object_detect_candidates: places of a picture that are looked at again, of one search for a
 * model. Internal to the host library. */
#ifndef CAIRN_HOST_OBJECT_DETECT_CANDIDATES_H
#define CAIRN_HOST_OBJECT_DETECT_CANDIDATES_H

#include <math.h>

#include "src/host/object_detect_work.h"

/* Proportions of the model that are laid. */
enum { DETECT_ASPECTS = 5 };

/* A model as it is laid. */
typedef struct detect_variant {
    cairn_oriented_point *outline;  /* [count] */
    float left, right, top, bottom; /* of the outline, in sizes */
    int32_t mirrored;
} detect_variant;

typedef struct detect_peak {
    float score, rigid, x, y, size; /* px */
    int32_t variant;
    float turn;         /* rad */
    int32_t hypothesis; /* by parts; -1: none */
} detect_peak;

/* A search. */
typedef struct object_detector {
    const cairn_detect_field *field;
    const cairn_shape_model *model;
    cairn_oriented_point *outlines; /* of all variants */
    detect_variant variants[2 * DETECT_ASPECTS];
    int32_t variant_count;
    detect_peak *peaks;
    int32_t count;
    contour_field *window;
    int32_t *segment_scratch;   /* [segments] of the one that is looked at */
    cairn_real *sample_scratch; /* [2 samples] */
    contour_fit fit;
    detect_hypotheses hypotheses;
    detect_groupings groupings;
} object_detector;

/* The variants of the model, as it is and mirrored. 0: there is no memory. */
int cairn_detect_variants_add(object_detector *detector);
/* 1 when no variant of the outline reaches beyond the margins of a field. */
int cairn_detect_variants_fit(const cairn_shape_model *model);

/* d->peaks: the best places of all sizes and variants that do not lie on better ones come first.
 * 0: there is no memory. */
int cairn_detect_candidates_find(object_detector *detector);
/* The same of the hypotheses by parts. CAIRN_NO_MEMORY, or as cairn_detect_parts(). */
cairn_status cairn_detect_candidates_of_parts(object_detector *detector);

/* What two boxes share, over their union. */
static inline float cairn_detect_overlap(float al, float at, float ar, float ab, float bl, float bt,
                                         float br, float bb)
{
    float w = fminf(ar, br) - fmaxf(al, bl), h = fminf(ab, bb) - fmaxf(at, bt),
          both = w > 0 && h > 0 ? w * h : 0;

    return both / ((ar - al) * (ab - at) + (br - bl) * (bb - bt) - both);
}

#endif
