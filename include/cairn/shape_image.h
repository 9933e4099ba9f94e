/* shape_image: the outlines of one object from a picture of it, a silhouette or a drawing of its
 * outline.
 *
 * The background is what most of the picture's rim shows; what is not background is ink. Ink
 * that is nowhere thick is a drawing: loose ends of its lines are joined where they nearly meet,
 * and the largest face within its lines is the object. Thick ink is the object itself. Either
 * may have several parts, and holes, which have outlines of their own. */
#ifndef CAIRN_SHAPE_IMAGE_H
#define CAIRN_SHAPE_IMAGE_H

#include "cairn/file_error.h"
#include "cairn/raster.h"
#include "cairn/shape_model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The longest side of a picture. */
#define CAIRN_SHAPE_IMAGE_SIDE_MOST 4096

typedef int32_t cairn_shape_holes;
enum {
    CAIRN_SHAPE_HOLES_KEEP = 0,  /* outlines of their own */
    CAIRN_SHAPE_HOLES_FILL = 1,  /* left out */
    CAIRN_SHAPE_HOLES_REFUSE = 2 /* an error */
};

typedef struct cairn_shape_image_params {
    /* (keep) */
    cairn_shape_holes holes;
    /* of the diagonal of all ink, 0 ... 1: loose ends so near are joined (0.1) */
    double max_gap;
    /* of the largest part's area, 0 ... 1: smaller parts and holes are left out (0.01) */
    double min_part;
} cairn_shape_image_params;

/* Outlines from the heap, in pixels ((0, 0) the middle of the first pixel), the largest part
 * first, holes last. */
typedef struct cairn_shape_image {
    cairn_curve outlines[CAIRN_SHAPE_OUTLINES];
    int32_t count, holes;
    int32_t is_drawing;                /* 1: of lines */
    int32_t joined;                    /* gaps that were closed */
    cairn_vec2 gaps[CAIRN_SHAPE_GAPS]; /* the middles of the first ones */
    int32_t specks;                    /* parts and holes that were left out as too small */
    cairn_vec2 *points;
} cairn_shape_image;

/* The values in brackets above. */
cairn_shape_image_params cairn_shape_image_default(void);

/* Traces the outlines. `path` is named by the error. CAIRN_BAD_ARGUMENT: a bad view or params;
 * CAIRN_EMPTY: no ink, an object smaller than 16 pixels along its diagonal; CAIRN_BAD_FORMAT:
 * lines that do not close; CAIRN_FULL: a side beyond CAIRN_SHAPE_IMAGE_SIDE_MOST, more than
 * CAIRN_SHAPE_OUTLINES outlines; CAIRN_UNSUPPORTED: a hole where holes are refused;
 * CAIRN_NO_MEMORY. On failure there is nothing to free. Cost: linear in pixels. */
CAIRN_CHECKED cairn_status cairn_shape_image_trace(cairn_shape_image *image,
                                                   cairn_raster_u8_view grey,
                                                   const cairn_shape_image_params *params,
                                                   const char *path, cairn_file_error *error);

void cairn_shape_image_free(cairn_shape_image *image);

#ifdef __cplusplus
}
#endif

#endif
