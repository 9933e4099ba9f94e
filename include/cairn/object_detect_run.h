/* object_detect_run: object_detect of a whole image at once, with memory of the heap that fits image
 * and model. */
#ifndef CAIRN_OBJECT_DETECT_RUN_H
#define CAIRN_OBJECT_DETECT_RUN_H

#include "cairn/file_error.h"
#include "cairn/object_detect.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The edge field of an image, on the heap, in which all models are searched. */
typedef struct cairn_object_detect_run_image cairn_object_detect_run_image;

/* Computes the field for all sizes within params; the capacities of params are set by the image.
 * `tokens` must stay valid. CAIRN_BAD_ARGUMENT: params; CAIRN_NOT_FINITE: a segment;
 * CAIRN_NO_MEMORY. On failure there is nothing to free, and *image is NULL. The error message names
 * `path`.
 *
 * image: set to the field
 * tokens: segments and chains of the image
 * path: used in the error */
CAIRN_CHECKED cairn_status cairn_object_detect_run_make(cairn_object_detect_run_image **image,
                                                        const cairn_contour_search_tokens *tokens,
                                                        const cairn_object_detect_params *params,
                                                        const char *path, cairn_file_error *error);

/* Frees the field. NULL is allowed.
 *
 * image: a field */
void cairn_object_detect_run_free_image(cairn_object_detect_run_image *image);

/* Detects the instances of a model. CAIRN_BAD_ARGUMENT, CAIRN_NOT_FINITE, CAIRN_EMPTY, CAIRN_FULL: a
 * model that cairn_object_detect_begin() refuses. CAIRN_NO_MEMORY. On failure there is nothing to
 * free.
 *
 * detections: set to the detections, their arrays on the heap
 * image: the field of an image
 * path: used in the error
 * model: model to detect */
CAIRN_CHECKED cairn_status cairn_object_detect_run(cairn_object_detections *detections,
                                                   const cairn_object_detect_run_image *image,
                                                   const cairn_shape_model *model, const char *path,
                                                   cairn_file_error *error);

/* Frees the arrays of `detections`. */
void cairn_object_detect_run_free(cairn_object_detections *detections);

#ifdef __cplusplus
}
#endif

#endif
