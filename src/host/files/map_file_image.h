/* map_file_image: reader and writer of grey images as PGM and PNG. Internal to the host library. */
#ifndef CAIRN_HOST_MAP_FILE_IMAGE_H
#define CAIRN_HOST_MAP_FILE_IMAGE_H

#include <stdio.h>

#include "cairn/output.h"

/* The maximum number of pixels of an image, and of samples of all its channels. */
#define CAIRN_IMAGE_MAX_PIXELS (INT32_C(1) << 28)

/* A grey image on the heap. Row 0 is the topmost. */
typedef struct cairn_image {
    int32_t width, height;
    uint8_t *pixel; /* [height * width] grey levels */
    uint8_t *alpha; /* [height * width] 0: transparent; NULL: the image has no alpha channel */
} cairn_image;

/* Reads a PGM (P2 or P5, of 255 grey levels) or a PNG, detected by their first bytes. Colours are
 * converted to the mean of their channels, 16-bit samples to their upper 8 bits. CAIRN_BAD_FORMAT,
 * CAIRN_TRUNCATED, CAIRN_UNSUPPORTED (a maximum grey level other than 255; a PNG and a build
 * without libpng), CAIRN_FULL (more than CAIRN_IMAGE_MAX_PIXELS), CAIRN_IO, CAIRN_NO_MEMORY. On
 * failure there is nothing to free. */
CAIRN_CHECKED cairn_status cairn_image_read(cairn_image *image, const char *path,
                                            cairn_file_error *error);

/* Where a PNG is read from: an open file at its start, or, when that is NULL, memory. */
typedef struct cairn_png_source {
    FILE *file;
    const uint8_t *bytes; /* [count] */
    size_t count;
    const char *path; /* for errors */
    cairn_file_error *error;
} cairn_png_source;

/* Samples of a PNG, on the heap: grey, grey and alpha, or blue, green, red and perhaps alpha. */
typedef struct cairn_png_samples {
    int32_t width, height, channels, sample_bytes;
    void *samples;
} cairn_png_samples;

/* Decodes a PNG. is_picture: 1: samples of 16 bits stay, and grey with alpha has four channels; 0:
 * samples of 16 bits become their upper 8, and there are CAIRN_IMAGE_MAX_PIXELS samples at most.
 * CAIRN_UNSUPPORTED: built without libpng; else as cairn_image_read(). On failure there is nothing
 * to free. */
CAIRN_CHECKED cairn_status cairn_png_decode(cairn_png_samples *image,
                                            const cairn_png_source *source, int32_t is_picture);

/* Checks the size of an image; errors name `line` of the file, 0: none. CAIRN_BAD_FORMAT,
 * CAIRN_FULL. */
CAIRN_CHECKED cairn_status cairn_image_check_size(int64_t width, int64_t height, const char *path,
                                                  int64_t line, cairn_file_error *error);

/* Frees the arrays. */
void cairn_image_free(cairn_image *image);

/* Write pixel[height * width] as a grey image, atomically. CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_image_write_pgm(const char *path, const uint8_t *pixel,
                                                 int32_t width, int32_t height,
                                                 cairn_file_error *error);
CAIRN_CHECKED cairn_status cairn_image_write_png(const char *path, const uint8_t *pixel,
                                                 int32_t width, int32_t height,
                                                 cairn_file_error *error);

/* Encodes a PNG into *bytes[*count] on the heap, to be freed by free(). channels: 1 grey, 3 RGB, 4
 * RGBA. CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_image_encode_png(uint8_t **bytes, size_t *count,
                                                  const uint8_t *pixel, int32_t width,
                                                  int32_t height, int32_t channels);

#endif
