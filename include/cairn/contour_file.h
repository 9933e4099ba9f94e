/* contour_file: contours that contour_search has found, as JSON and as pictures over the image. */
#ifndef CAIRN_CONTOUR_FILE_H
#define CAIRN_CONTOUR_FILE_H

#include "cairn/contour_search.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What is written. The search may have been on a picture made smaller: its pixel (x, y) is then
 * the middle of shrink x shrink pixels of the image, and all lengths come out in those of the
 * image. */
typedef struct cairn_contour_picture {
    /* as shown */
    const char *image, *model_name;
    /* [height * width] of the searched picture, to draw over; NULL: white */
    const uint8_t *grey;
    /* 1, 2, 4 ... */
    int32_t shrink;
    const cairn_contour_tokens *tokens;
    const cairn_shape_model *model;
    const cairn_contour_result *result;
} cairn_contour_picture;

/* The contours as JSON; docs/formats.md says its keys. CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_contour_file_write(const cairn_contour_picture *picture,
                                                    const char *path, cairn_file_error *error);

/* The contours over the image (SVG): segments of the left side blue, of the right one orange,
 * others green, the skeleton red, the model's outline dotted. CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_contour_file_draw(const cairn_contour_picture *picture,
                                                   const char *path, cairn_file_error *error);

#ifdef __cplusplus
}
#endif

#endif
