/* contour_search_fit: deformation of a model's outline to the edges around an object (deformable
 * template matching). Internal to the host library. */
#ifndef CAIRN_HOST_CONTOUR_SEARCH_FIT_H
#define CAIRN_HOST_CONTOUR_SEARCH_FIT_H

#include "src/host/detection/contour_search_work.h"

/* Direction bins over half a turn, and cells along a side of the window, which is one and a half
 * object sizes. */
enum { CONTOUR_SEARCH_FIELD_BINS = 12, CONTOUR_SEARCH_FIELD_SIDE = 192 };
/* Cost of a cell without an edge in reach. */
#define CONTOUR_SEARCH_FIELD_MAX_COST CAIRN_REAL(30.0)

typedef struct contour_search_field {
    /* [BINS * SIDE * SIDE] distance field: negative log of the edge proximity, per direction */
    cairn_real *cost;
    /* [BINS * SIDE * SIDE] log-likelihood ratio (nats) of an outline sample there; CAIRN_REAL_MAX:
     * not yet computed */
    cairn_real *llr;
    /* buffer for one direction and its border, used while the field is computed */
    cairn_real *plane;
    /* mean edge proximity of each direction over the window: the background likelihood */
    cairn_real background[CONTOUR_SEARCH_FIELD_BINS];
    /* px, corner of the window */
    cairn_vec2 corner;
    /* px, cell size */
    cairn_real cell_size;
} contour_search_field;

/* Allocates a field; NULL: out of memory. */
contour_search_field *cairn_contour_search_field_new(void);
void cairn_contour_search_field_free(contour_search_field *field);
/* Computes the field around an object. Cost: the segments near it, and about 10^7 operations. */
void cairn_contour_search_field_fill(contour_search_field *field,
                                     const cairn_contour_search_tokens *tokens,
                                     const cairn_contour_grouping_object *object);
int32_t cairn_contour_search_field_bin(cairn_vec2 direction);

/* A deformed outline and its score. */
typedef struct contour_search_fit {
    /* [outline_count] px, deformed samples and their directions */
    cairn_oriented_point *outline;
    /* [outline_count] log-likelihood ratio (nats) of each sample's edges, object against
     * background */
    cairn_real *llr;
    /* [outline_count] index of the closed outline of each sample */
    int32_t *outline_index;
    /* nats, total log-likelihood ratio less the deformation cost */
    cairn_real evidence;
    /* length of the outline, in object sizes */
    cairn_real length;
} contour_search_fit;

/* Deforms the outline of the object's model to the edges of the field. The object's pose becomes
 * that of the deformed outline. Returns 0 when out of memory. */
int cairn_contour_search_fit_run(contour_search_fit *fit, const contour_search_field *field,
                                 const cairn_shape_model *model,
                                 cairn_contour_grouping_object *object);
int cairn_contour_search_fit_new(contour_search_fit *fit, int32_t outline_count);
void cairn_contour_search_fit_free(contour_search_fit *fit);

/* The model outline that a deformed outline is compared with. */
typedef struct contour_search_reference {
    /* [outline_count] of the model, mirrored if the object is */
    const cairn_oriented_point *outline;
    /* unit vector of the model's x axis in the image; (1, 0): the object's rotation counts as
     * deviation */
    cairn_vec2 rotation;
} contour_search_reference;

/* Computes the shape quality of a deformed outline, independent of its surroundings
 * (contour_search_shape.c). outline_index: outline indices of the fit; list: [tokens->count]
 * scratch; proximity: NULL, or [outline_count], receives the edge proximity of each sample,
 * 0 ... 1. Cost: samples times the segments in its box. */
cairn_contour_search_shape cairn_contour_search_shape_of(
    const cairn_contour_search_tokens *tokens, const contour_search_fitted_outline *fitted,
    const int32_t *outline_index, const contour_search_reference *reference, int32_t *list,
    cairn_real *proximity);

#endif
