/* contour_search_fit: a model's outline bent onto the edges about an object, and how well it
 * fits there. Internal to the host library. */
#ifndef CAIRN_HOST_CONTOUR_SEARCH_FIT_H
#define CAIRN_HOST_CONTOUR_SEARCH_FIT_H

#include "src/host/contour_search_work.h"

/* Directions over half a turn, and cells along a side of the window: one and a half sizes. */
enum { CONTOUR_FIELD_BINS = 12, CONTOUR_FIELD_SIDE = 192 };
/* No edge is in reach. */
#define CONTOUR_FIELD_MAX_COST CAIRN_REAL(30.0)

typedef struct contour_field {
    /* [BINS * SIDE * SIDE] -log of how well an edge fits there */
    cairn_real *cost;
    /* [BINS * SIDE * SIDE] what it says of an outline; CAIRN_REAL_MAX: not yet asked for */
    cairn_real *llr;
    /* one direction's, and what lies about them, while they are made */
    cairn_real *plane;
    /* how well one does by chance */
    cairn_real background[CONTOUR_FIELD_BINS];
    /* px */
    cairn_vec2 corner;
    /* px */
    cairn_real cell_size;
} contour_field;

/* NULL: there is no memory. */
contour_field *cairn_contour_field_new(void);
void cairn_contour_field_free(contour_field *field);
/* The field about an object. Cost: the segments near it, and some 10^7 operations. */
void cairn_contour_field_fill(contour_field *field, const cairn_contour_tokens *tokens,
                              const cairn_grouped_object *object);
int32_t cairn_contour_field_bin(cairn_vec2 direction);

/* The outline where it lies. */
typedef struct contour_fit {
    /* [outline_count] px */
    cairn_oriented_point *outline;
    /* [outline_count] log of how much likelier its edge is with the object than by chance */
    cairn_real *llr;
    /* [outline_count] of which outline each sample is */
    int32_t *part;
    /* all of it, less what the bending costs */
    cairn_real evidence;
    /* of the outline, in sizes */
    cairn_real length;
} contour_fit;

/* Bends the outline of the object's model onto the edges of the field; the object's pose becomes
 * that of the bent outline. 0: there is no memory. */
int cairn_contour_fit_run(contour_fit *fit, const contour_field *field,
                          const cairn_shape_model *model, cairn_grouped_object *object);
int cairn_contour_fit_new(contour_fit *fit, int32_t outline_count);
void cairn_contour_fit_free(contour_fit *fit);

/* The drawing that an outline was bent from. */
typedef struct contour_reference {
    /* [laid outline_count] of the model, mirrored where the object is */
    const cairn_oriented_point *outline;
    /* its x axis in the image, of length 1; (1, 0): turns of the object count */
    cairn_vec2 rotation;
} contour_reference;

/* How well a bent outline fits, whatever lies round it (contour_search_shape.c). part: the
 * fit's; list: [tokens->count] is overwritten. near: NULL, or [outline_count], takes how near an
 * edge is to each sample, 0 ... 1. Cost: samples times the segments in its box. */
cairn_contour_shape cairn_contour_shape_of(const cairn_contour_tokens *tokens,
                                           const contour_fitted_outline *fitted,
                                           const int32_t *part, const contour_reference *reference,
                                           int32_t *list, cairn_real *proximity);

#endif
