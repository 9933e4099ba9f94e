/* detection_file: writers of detections, as SVG over the image and as JSON. docs/formats.md
 * specifies the JSON format. */
#ifndef CAIRN_DETECTION_FILE_H
#define CAIRN_DETECTION_FILE_H

#include "cairn/file_error.h"
#include "cairn/object_detect.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The input of the writers: the detections in an image and their source. */
typedef struct cairn_detection_file_picture {
    const char *image; /* name of the image */
    /* name of the model, as displayed */
    const char *model_name;
    /* [height * width] grey levels of the searched image; NULL: drawn without a background */
    const uint8_t *grey;
    /* downscaling factor: pixels of the image per pixel of the searched image, >= 1 */
    int32_t shrink;
    /* edge segments of the searched image */
    const cairn_contour_search_tokens *tokens;
    /* detections to be written */
    const cairn_object_detections *detections;
    /* mode of the search, CAIRN_MODE_DEFAULT or CAIRN_MODE_AS_WRITTEN; of the drawing only */
    int32_t mode;
    /* as written: the model of the search, whose matched parts are drawn; else unused */
    const cairn_shape_model *model;
    /* [cut_count] manual fragments of the search; NULL: by rule */
    const cairn_part_bundle_cut *cuts;
    /* number of cuts */
    int32_t cut_count;
} cairn_detection_file_picture;

/* Computes the box of a detection in pixels of the original image: left, top, right, bottom,
 * clipped to the image.
 *
 * picture: gives the downscaling factor and the size of the image
 * detection: one of the detections
 * box: set to left, top, right, bottom */
void cairn_detection_file_box(const cairn_detection_file_picture *picture,
                              const cairn_object_detection *detection, double box[4]);

/* Writes SVG: the image, boxes with scores, segments, and the deformed outlines, dashed where no
 * edge matches. As written: the outlines are the model at the detected poses, dashed where no part
 * matches. The parts of the best detection have the colours of their bundles, along its edge
 * fragments and on the model, which is drawn in the corner where it covers least of the detections
 * (Adluru 2008, fig. 5.6). CAIRN_IO, CAIRN_NO_MEMORY; as written also CAIRN_BAD_ARGUMENT: no model,
 * CAIRN_EMPTY: fewer than 3 samples, CAIRN_MORE: interrupted, and the statuses of
 * cairn_part_bundle_begin().
 *
 * picture: what is drawn
 * path: target */
CAIRN_CHECKED cairn_status cairn_detection_file_draw(const cairn_detection_file_picture *picture,
                                                     const char *path, cairn_file_error *error);

/* Writes JSON, in pixels of the original image. CAIRN_IO, CAIRN_NO_MEMORY.
 *
 * picture: what is written
 * path: target */
CAIRN_CHECKED cairn_status cairn_detection_file_write(const cairn_detection_file_picture *picture,
                                                      const char *path, cairn_file_error *error);

#ifdef __cplusplus
}
#endif

#endif
