/* vision_decode: decoders of images in memory, by libjpeg, libpng and libtiff, each of which may be
 * missing. The header of the file was checked (vision_format.h). Internal to the host library.
 *
 * Samples are as in cairn_vision_image: grey, or blue, green, red and perhaps alpha. What is written
 * in fewer bits is stretched to 8 or 16. CAIRN_BAD_FORMAT, CAIRN_TRUNCATED, CAIRN_UNSUPPORTED (built
 * without the library, or a kind of image that is not read), CAIRN_NO_MEMORY. On failure the image
 * is to be freed. */
#ifndef CAIRN_HOST_VISION_DECODE_H
#define CAIRN_HOST_VISION_DECODE_H

#include <stddef.h>

#include "cairn/vision.h"

/* A file in memory. */
typedef struct cairn_vision_file {
    const uint8_t *bytes;
    size_t count;
    const char *path;
    cairn_file_error *error;
} cairn_vision_file;

CAIRN_CHECKED cairn_status cairn_vision_decode_jpeg(cairn_vision_image *image,
                                                    const cairn_vision_file *file);
CAIRN_CHECKED cairn_status cairn_vision_decode_png(cairn_vision_image *image,
                                                   const cairn_vision_file *file);
CAIRN_CHECKED cairn_status cairn_vision_decode_tiff(cairn_vision_image *image,
                                                    const cairn_vision_file *file);
CAIRN_CHECKED cairn_status cairn_vision_decode_pnm(cairn_vision_image *image,
                                                   const cairn_vision_file *file);

/* Allocates samples that are 0. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_vision_allocate(cairn_vision_image *image, int64_t width,
                                                 int64_t height, int32_t channels,
                                                 int32_t sample_bytes,
                                                 const cairn_vision_file *file);

/* Converts a pixel of cyan, magenta, yellow and black, 255: no ink, into blue, green and red. */
static inline void cairn_vision_from_inks(uint8_t bgr[3], const uint8_t clear[4])
{
    for (int32_t k = 0; k < 3; k++)
        bgr[k] = (uint8_t)(clear[3] - ((255 - clear[2 - k]) * clear[3] >> 8));
}

#endif
