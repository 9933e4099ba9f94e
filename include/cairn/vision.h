/* vision: images from files and to them, and their edges, through OpenCV.
 *
 * OpenCV stands behind a library of its own, libcairn-vision.so (`make vision`), which is loaded
 * when it is first needed; cairn itself neither needs nor loads OpenCV, and no type of it is seen
 * here. The library is looked for at $CAIRN_VISION, beside the program, in the folder above it, in
 * lib beside that, and where the system keeps libraries. Where it is not there, PGM and PNG can be
 * read as 8-bit grey all the same, and all else says what is missing.
 *
 * Images are rows of samples from the top, without gaps. */
#ifndef CAIRN_VISION_H
#define CAIRN_VISION_H

#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Larger images are refused before they are decoded. */
#define CAIRN_VISION_SIDE_MOST   32768
#define CAIRN_VISION_PIXELS_MOST (INT32_C(1) << 27)

/* From the heap; samples of 1 byte are uint8_t, of 2 bytes uint16_t. */
typedef struct cairn_vision_image {
    int32_t width, height;
    int32_t channels;     /* 1: grey; 3: blue, green, red; 4: and how opaque */
    int32_t sample_bytes; /* 1 or 2 */
    void *samples;        /* [height * width * channels] */
} cairn_vision_image;

/* CAIRN_OK: OpenCV can be used. CAIRN_UNSUPPORTED: libcairn-vision is missing, or does not fit;
 * the error says so. */
CAIRN_CHECKED cairn_status cairn_vision_load(cairn_file_error *error);

/* Reads a TIFF, PNG, JPEG or PGM (PPM), told apart by their first bytes; of a file with several
 * images the first. CAIRN_BAD_FORMAT, CAIRN_TRUNCATED, CAIRN_FULL (beyond the limits above),
 * CAIRN_UNSUPPORTED (no libcairn-vision; samples that are neither 8 nor 16 bits), CAIRN_IO,
 * CAIRN_NO_MEMORY; of what OpenCV refuses, its text. On failure there is nothing to free. */
CAIRN_CHECKED cairn_status cairn_vision_read(cairn_vision_image *image, const char *path,
                                             cairn_file_error *error);

/* The same, as one channel of 8 bits: 0.299 red + 0.587 green + 0.114 blue, of 16 bits the upper
 * 8. */
CAIRN_CHECKED cairn_status cairn_vision_read_grey(cairn_vision_image *image, const char *path,
                                                  cairn_file_error *error);

/* Writes by the ending of the path (.tif, .tiff, .png, .jpg, .jpeg, .pgm), whole or not at all.
 * CAIRN_BAD_ARGUMENT: another ending, no such image, more than 8 bits as JPEG;
 * CAIRN_UNSUPPORTED, CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_vision_write(const cairn_vision_image *image, const char *path,
                                              cairn_file_error *error);

/* Makes an image 8-bit grey, in place of what it was. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY: it
 * stays as it is. */
CAIRN_CHECKED cairn_status cairn_vision_make_grey(cairn_vision_image *image);

/* Gradients of an 8-bit grey image after a Gaussian blur: x and y, [height * width] each, grey
 * levels per pixel. sigma: pixels, 0: no blur, at most 50. CAIRN_BAD_ARGUMENT,
 * CAIRN_UNSUPPORTED, CAIRN_NO_MEMORY; `name` stands for the path in the error. */
CAIRN_CHECKED cairn_status cairn_vision_gradients(const cairn_vision_image *grey, double sigma,
                                                  float *x, float *y, const char *name,
                                                  cairn_file_error *error);

typedef struct cairn_vision_canny_params {
    double sigma; /* pixels, 0 ... 50 (1.4) */
    double low;   /* grey levels per pixel, > 0: an edge goes on while its slope is above (3) */
    double high;  /* >= low, at most 1000: and has it once above (8) */
} cairn_vision_canny_params;

/* The values in brackets above. */
cairn_vision_canny_params cairn_vision_canny_default(void);

/* Edges of an 8-bit grey image (Canny 1986), one pixel wide: strengths [height * width], 0: no
 * edge, otherwise twice the slope, 1 ... 255. Statuses as of gradients. */
CAIRN_CHECKED cairn_status cairn_vision_canny(const cairn_vision_image *grey,
                                              const cairn_vision_canny_params *params,
                                              uint8_t *strengths, const char *name,
                                              cairn_file_error *error);

void cairn_vision_free(cairn_vision_image *image);

#ifdef __cplusplus
}
#endif

#endif
