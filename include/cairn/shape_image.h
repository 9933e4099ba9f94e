/* shape_image: contours of one object from a picture of it, a silhouette or a line drawing of its
 * outline, on the heap, with messages for the user. cairn/silhouette.h extracts them. */
#ifndef CAIRN_SHAPE_IMAGE_H
#define CAIRN_SHAPE_IMAGE_H

#include "cairn/file_error.h"
#include "cairn/raster.h"
#include "cairn/shape_model.h"
#include "cairn/silhouette.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The maximum side in pixels of a picture as it is traced: larger ones are reduced. */
#define CAIRN_SHAPE_IMAGE_MAX_SIDE 4096

/* How holes are treated. */
typedef int32_t cairn_shape_image_holes;
enum {
    CAIRN_SHAPE_IMAGE_HOLES_KEEP = CAIRN_SILHOUETTE_HOLES_KEEP,    /* traced as outlines */
    CAIRN_SHAPE_IMAGE_HOLES_FILL = CAIRN_SILHOUETTE_HOLES_FILL,    /* ignored */
    CAIRN_SHAPE_IMAGE_HOLES_REFUSE = CAIRN_SILHOUETTE_HOLES_REFUSE /* reported as an error */
};

/* Parameters; defaults in brackets. */
typedef struct cairn_shape_image_params {
    /* any (CAIRN_SHAPE_IMAGE_HOLES_KEEP): treatment of holes */
    cairn_shape_image_holes holes;
    /* share of the ink's diagonal, 0 ... 1 (0.1): largest gap between open line ends that is
     * bridged */
    double max_gap;
    /* share of the largest component's area, 0 ... 1 (0.01): smallest component or hole that is
     * kept */
    double min_part;
    /* px, 16 ... CAIRN_SHAPE_IMAGE_MAX_SIDE (CAIRN_SHAPE_IMAGE_MAX_SIDE): larger pictures are halved
     * until they fit; outlines stay in pixels of the picture */
    int32_t max_side;
} cairn_shape_image_params;

/* Outlines on the heap, in pixels; (0, 0) is the centre of the first pixel. Components come first
 * by descending area, then holes. */
typedef struct cairn_shape_image {
    /* [outline_count] closed outlines; the first is the outer one */
    cairn_curve outlines[CAIRN_SHAPE_MODEL_MAX_OUTLINES];
    int32_t count, holes;                        /* outlines; holes among them */
    int32_t is_drawing;                          /* 1: a line drawing; 0: a silhouette */
    int32_t bridged_gaps;                        /* gaps that were bridged */
    cairn_vec2 gaps[CAIRN_SHAPE_MODEL_MAX_GAPS]; /* centres of the first bridged gaps */
    int32_t dropped_regions;                     /* components and holes below min_part */
    cairn_vec2 *points;                          /* storage of the outlines */
} cairn_shape_image;

/* Returns the default parameters. */
cairn_shape_image_params cairn_shape_image_default(void);

/* Traces the outlines of the object in a grey picture. path: used in the error. CAIRN_BAD_ARGUMENT:
 * an invalid view or parameter; CAIRN_EMPTY: no ink, or an object smaller than 16 pixels along its
 * diagonal; CAIRN_BAD_FORMAT: lines that do not close, or a photograph: of many greys;
 * CAIRN_FULL: more than CAIRN_SHAPE_MODEL_MAX_OUTLINES outlines;
 * CAIRN_UNSUPPORTED: a hole where holes are refused; CAIRN_NO_MEMORY. On failure there is
 * nothing to free. Cost: linear in pixels.
 *
 * image: set to the outlines
 * grey: picture of the object */
CAIRN_CHECKED cairn_status cairn_shape_image_trace(cairn_shape_image *image,
                                                   cairn_raster_u8_view grey,
                                                   const cairn_shape_image_params *params,
                                                   const char *path, cairn_file_error *error);

/* Frees the outlines.
 *
 * image: image that was traced */
void cairn_shape_image_free(cairn_shape_image *image);

#ifdef __cplusplus
}
#endif

#endif
