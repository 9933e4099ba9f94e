/* object_detect_candidates: candidate generation of one search for a model. Internal to the host
 * library. */
#ifndef CAIRN_HOST_OBJECT_DETECT_CANDIDATES_H
#define CAIRN_HOST_OBJECT_DETECT_CANDIDATES_H

#include <math.h>

#include "src/host/detection/object_detect_work.h"

/* Aspect ratios of the model that are searched. */
enum { OBJECT_DETECT_ASPECTS = 5 };

/* A variant of the model: an aspect ratio, mirrored or not. */
typedef struct object_detect_variant {
    cairn_oriented_point *outline;  /* [count] */
    float left, right, top, bottom; /* bounding box of the outline, in sizes */
    int32_t mirrored;
} object_detect_variant;

/* A candidate. */
typedef struct object_detect_peak {
    /* nats: score with the size prior, and log-likelihood ratio of the undeformed outline */
    float score, rigid;
    float x, y, size; /* px */
    int32_t variant;
    float turn;         /* rad, rotation */
    int32_t hypothesis; /* hypothesis by parts; -1: none */
} object_detect_peak;

/* State of a search. */
typedef struct object_detector {
    const cairn_object_detect_field *field;
    const cairn_shape_model *model;
    cairn_oriented_point *outlines; /* outlines of all variants */
    object_detect_variant variants[2 * OBJECT_DETECT_ASPECTS];
    int32_t variant_count;
    object_detect_peak *peaks;
    int32_t count;
    contour_search_field *window;
    int32_t *segment_scratch;   /* [segments] scratch for the current candidate */
    cairn_real *sample_scratch; /* [2 samples] scratch */
    contour_search_fit fit;
    object_detect_hypotheses hypotheses;
    object_detect_groupings groupings;
} object_detector;

/* Creates the variants of the model and its mirror image. Returns 0 when out of memory. */
int cairn_object_detect_variants_add(object_detector *detector);
/* Returns 1 when all variants of the outline are inside the margins of a field. */
int cairn_object_detect_variants_are_inside_margin(const cairn_shape_model *model);

/* Computes detector->peaks: the best candidates over all sizes and variants after non-maximum
 * suppression. Returns 0 when out of memory. */
int cairn_object_detect_candidates_find(object_detector *detector);
/* Computes detector->peaks from hypotheses by parts. CAIRN_NO_MEMORY, or as
 * cairn_object_detect_parts(). */
cairn_status cairn_object_detect_candidates_of_parts(object_detector *detector);

/* Intersection over union of two boxes. */
static inline float cairn_object_detect_overlap(float al, float at, float ar, float ab, float bl,
                                                float bt, float br, float bb)
{
    float w = fminf(ar, br) - fmaxf(al, bl), h = fminf(ab, bb) - fmaxf(at, bt),
          both = w > 0 && h > 0 ? w * h : 0;

    return both / ((ar - al) * (ab - at) + (br - bl) * (bb - bt) - both);
}

#endif
