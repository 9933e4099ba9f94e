/* contour_file: writer of the contours found by contour_search, as JSON and as SVG pictures over
 * the image. */
#ifndef CAIRN_CONTOUR_FILE_H
#define CAIRN_CONTOUR_FILE_H

#include "cairn/contour_search.h"
#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The data to be written. The search may have used a downscaled picture, whose pixel (x, y) covers
 * shrink x shrink pixels of the image. All lengths are written in pixels of the image. */
typedef struct cairn_contour_file_picture {
    /* names, as displayed */
    const char *image, *model_name;
    /* [height * width] of the searched picture, background of the drawing; NULL: white */
    const uint8_t *grey;
    /* downscaling factor: 1, 2, 4 ... */
    int32_t shrink;
    /* edge segments of the picture */
    const cairn_contour_search_tokens *tokens;
    /* model that was searched */
    const cairn_shape_model *model;
    /* contours found */
    const cairn_contour_search_result *result;
} cairn_contour_file_picture;

/* Writes the contours as JSON; docs/formats.md defines the keys. CAIRN_IO, CAIRN_NO_MEMORY.
 *
 * picture: what is written
 * path: target */
CAIRN_CHECKED cairn_status cairn_contour_file_write(const cairn_contour_file_picture *picture,
                                                    const char *path, cairn_file_error *error);

/* Draws the contours over the image as SVG: segments of the left side blue, of the right side
 * orange, others green, the skeleton red, the model's outline dotted. CAIRN_IO, CAIRN_NO_MEMORY.
 *
 * picture: what is drawn
 * path: target */
CAIRN_CHECKED cairn_status cairn_contour_file_draw(const cairn_contour_file_picture *picture,
                                                   const char *path, cairn_file_error *error);

#ifdef __cplusplus
}
#endif

#endif
