/* map_file_image: grey images from PGM and PNG files, and to them. Internal to the host library. */
#ifndef CAIRN_HOST_MAP_FILE_IMAGE_H
#define CAIRN_HOST_MAP_FILE_IMAGE_H

#include "cairn/output.h"

/* More pixels than these are refused. */
#define CAIRN_IMAGE_PIXELS_MOST (INT32_C(1) << 28)

/* Row 0 is the topmost. From the heap. */
typedef struct cairn_image {
    int32_t width, height;
    uint8_t *pixel; /* [height * width] */
    uint8_t *alpha; /* the same, 0: transparent; NULL: the image has no transparency */
} cairn_image;

/* Reads a PGM (P2 or P5, of 255 grey levels) or a PNG, told apart by their first bytes. Colours
 * become the mean of their channels, 16 bits the upper 8. CAIRN_BAD_FORMAT, CAIRN_TRUNCATED,
 * CAIRN_UNSUPPORTED (levels other than 255), CAIRN_FULL (more than CAIRN_IMAGE_PIXELS_MOST),
 * CAIRN_IO, CAIRN_NO_MEMORY. On failure there is nothing to free. */
CAIRN_CHECKED cairn_status cairn_image_read(cairn_image *image, const char *path,
                                            cairn_file_error *error);

void cairn_image_free(cairn_image *image);

CAIRN_CHECKED cairn_status cairn_image_write_pgm(const char *path, const uint8_t *pixel,
                                                 int32_t width, int32_t height,
                                                 cairn_file_error *error);
CAIRN_CHECKED cairn_status cairn_image_write_png(const char *path, const uint8_t *pixel,
                                                 int32_t width, int32_t height,
                                                 cairn_file_error *error);

/* A PNG in memory that free() gives back; `channels`: 1 grey, 3 RGB, 4 RGBA. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_image_encode_png(uint8_t **bytes, size_t *count,
                                                  const uint8_t *pixel, int32_t width,
                                                  int32_t height, int32_t channels);

#endif
