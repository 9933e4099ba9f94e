/* appearance_image: the visual words (appearance) of a grey image.
 *
 * SIFT descriptors (Lowe 2004) on a regular grid of patches come from a plug-in,
 * libcairn-appearance.so (`make appearance`: OpenCV's features2d and ml), which is loaded on first
 * use from $CAIRN_APPEARANCE or from the search path of the vision plug-in. */
#ifndef CAIRN_APPEARANCE_IMAGE_H
#define CAIRN_APPEARANCE_IMAGE_H

#include "cairn/appearance.h"
#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Greatest side of an image, px. */
#define CAIRN_APPEARANCE_IMAGE_MAX_SIDE 8192

/* The visual words of an image, on the heap. */
typedef struct cairn_appearance_image {
    cairn_appearance_field *field; /* the words, to score boxes with; NULL: none */
    void *memory;                  /* that of the field */
} cairn_appearance_image;

/* Loads the plug-in. CAIRN_OK: descriptors can be computed. CAIRN_UNSUPPORTED: libcairn-appearance
 * is missing or incompatible; the error message says which. */
CAIRN_CHECKED cairn_status cairn_appearance_image_load(cairn_file_error *error);

/* Computes the words of an 8-bit grey image [height * width]. The pixels need not stay valid; the
 * model must. CAIRN_BAD_ARGUMENT: a side outside 1 ... CAIRN_APPEARANCE_IMAGE_MAX_SIDE, or refused
 * by OpenCV; a model that cairn_appearance_begin() refuses. CAIRN_UNSUPPORTED: no
 * libcairn-appearance. CAIRN_NO_MEMORY. On failure there is nothing to free, and image->field is
 * NULL. The error message names `path`.
 *
 * image: set to the words
 * path: used in the error
 * model: a model, which must outlive the words
 * grey: [height * width] 8-bit grey image
 * width, height: size, px */
CAIRN_CHECKED cairn_status cairn_appearance_image_make(cairn_appearance_image *image,
                                                       const cairn_appearance_model *model,
                                                       const uint8_t *grey, int32_t width,
                                                       int32_t height, const char *path,
                                                       cairn_file_error *error);

/* Frees the words. One without words is allowed.
 *
 * image: words of an image */
void cairn_appearance_image_free(cairn_appearance_image *image);

#ifdef __cplusplus
}
#endif

#endif
