/* contour_search_work: shared definitions of the contour_search sources. Internal to the host
 * library. */
#ifndef CAIRN_HOST_CONTOUR_SEARCH_WORK_H
#define CAIRN_HOST_CONTOUR_SEARCH_WORK_H

#include "cairn/contour_search.h"

/* Transforms a vector of the model by the object's rotation and scale, px. */
cairn_vec2 cairn_contour_search_transform_vector(const cairn_contour_grouping_object *object,
                                                 cairn_vec2 m);

/* Distance of a point to a segment, px. */
cairn_real cairn_contour_search_point_distance(cairn_segment line, cairn_vec2 p);

/* A deformed outline, fitted to the image. */
typedef struct contour_search_fitted_outline {
    const cairn_oriented_point *outline; /* [outline_count] px */
    int32_t outline_count;
    cairn_vec2 origin; /* px */
    cairn_real size;   /* px */
} contour_search_fitted_outline;

/* cairn_contour_search_run() in the mode as written. */
cairn_status cairn_contour_search_written(cairn_contour_search_result *result,
                                          const cairn_contour_search_tokens *tokens,
                                          const cairn_shape_model *model,
                                          const cairn_contour_search_params *params,
                                          const char *path, cairn_file_error *error);

/* Positions on the deformed outline of the gaps in the model's drawing. */
typedef struct contour_search_gaps {
    cairn_vec2 at[CAIRN_SHAPE_MODEL_MAX_GAPS]; /* px */
    int32_t count;
} contour_search_gaps;

/* Collects the segments of an outline: those along it, those between two of them on one chain, and
 * those that continue beyond the last ones along the outline. list: [tokens->count] in the order of
 * the outline, *count of them. Returns 0 when out of memory. */
int cairn_contour_search_collect_segments(const cairn_contour_search_tokens *tokens,
                                          const contour_search_fitted_outline *fitted,
                                          int32_t *list, int32_t *count);

/* Collects the segments of an outline and, near the gaps, also segments that continue from them in
 * any direction. */
int cairn_contour_search_collect_with_gaps(const cairn_contour_search_tokens *tokens,
                                           const contour_search_fitted_outline *fitted,
                                           const contour_search_gaps *gaps, int32_t *list,
                                           int32_t *count);

#endif
