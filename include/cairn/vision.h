/* vision: image files by libjpeg, libpng and libtiff; gradients, Canny edges, objects cut out of
 * photographs, and the writing of images by OpenCV.
 *
 * OpenCV is wrapped by a plug-in library, libcairn-vision.so (`make vision`), which is loaded on
 * first use. cairn itself neither links nor loads OpenCV, and this header has no type of it. The
 * library is searched at $CAIRN_VISION, beside the program, in lib beside that, and in the system's
 * library path. Without the library images can still be read; all other functions fail with an
 * error that names it.
 *
 * Images are rows of samples from the top, without padding. */
#ifndef CAIRN_VISION_H
#define CAIRN_VISION_H

#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Maximum side and area in pixels. Larger images are refused before they are decoded. */
#define CAIRN_VISION_MAX_SIDE   32768
#define CAIRN_VISION_MAX_PIXELS (INT32_C(1) << 27)

/* An image on the heap. Samples of 1 byte are uint8_t, of 2 bytes uint16_t. */
typedef struct cairn_vision_image {
    int32_t width, height; /* pixels */
    int32_t channels;      /* 1: grey; 3: blue, green, red; 4: and alpha */
    int32_t sample_bytes;  /* 1 or 2 */
    void *samples;         /* [height * width * channels] */
} cairn_vision_image;

/* Loads the library. CAIRN_OK: OpenCV is available. CAIRN_UNSUPPORTED: libcairn-vision is missing
 * or has another version, and the error says so. */
CAIRN_CHECKED cairn_status cairn_vision_load(cairn_file_error *error);

/* Reads a TIFF, PNG, JPEG or PGM (PBM, PPM), detected by its first bytes; of a file with several
 * images the first; it is turned as its orientation says (EXIF of JPEG and PNG, tag of TIFF).
 * Palettes and inks (CMYK, YCCK) become colours, fewer bits than 8 or 16 are stretched.
 * CAIRN_BAD_FORMAT, CAIRN_TRUNCATED, CAIRN_FULL (beyond the limits above), CAIRN_UNSUPPORTED (built
 * without the library of this format, not a regular file, or samples of more than 16 bits),
 * CAIRN_IO, CAIRN_NO_MEMORY. Errors of a decoder have its text. On failure there is nothing to
 * free.
 *
 * image: set to the image
 * path: file */
CAIRN_CHECKED cairn_status cairn_vision_read(cairn_vision_image *image, const char *path,
                                             cairn_file_error *error);

/* Reads an image as cairn_vision_read(), with its statuses, and converts the image to 8-bit grey:
 * luma 0.299 red + 0.587 green + 0.114 blue (BT.601), of 16 bits the upper 8, of 10 or 12 bits in
 * 16 (no sample has more) the upper 8 of these. What is transparent is white behind a dark picture,
 * black behind a light one.
 *
 * image: set to the image
 * path: file */
CAIRN_CHECKED cairn_status cairn_vision_read_grey(cairn_vision_image *image, const char *path,
                                                  cairn_file_error *error);

/* Writes an image atomically, in the format of the path's extension (.tif, .tiff, .png, .jpg,
 * .jpeg, .pgm). CAIRN_BAD_ARGUMENT: another extension, an invalid image, more than 8 bits as JPEG,
 * several channels as PGM; CAIRN_UNSUPPORTED, CAIRN_IO, CAIRN_NO_MEMORY.
 *
 * path: target
 * image: image to be written */
CAIRN_CHECKED cairn_status cairn_vision_write(const cairn_vision_image *image, const char *path,
                                              cairn_file_error *error);

/* Converts an image to 8-bit grey in place. CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY: the image is
 * unchanged. */
CAIRN_CHECKED cairn_status cairn_vision_make_grey(cairn_vision_image *image);

/* Computes the gradient of an 8-bit grey image by Sobel operators after a Gaussian blur: x and y,
 * [height * width] each, grey levels per pixel. sigma: standard deviation of the blur in pixels, 0:
 * no blur, at most 50. name: used as the path in the error. CAIRN_BAD_ARGUMENT, CAIRN_UNSUPPORTED,
 * CAIRN_NO_MEMORY.
 *
 * grey: 8-bit grey image
 * x, y: [height * width] set to the gradient */
CAIRN_CHECKED cairn_status cairn_vision_gradients(const cairn_vision_image *grey, double sigma,
                                                  float *x, float *y, const char *name,
                                                  cairn_file_error *error);

/* Parameters of the Canny edge detector; defaults in brackets. */
typedef struct cairn_vision_canny_params {
    /* px, 0 ... 50 (1.4): standard deviation of the Gaussian blur */
    double sigma;
    /* grey levels per px, > 0 (3): lower hysteresis threshold */
    double low;
    /* grey levels per px, low ... 1000 (8): upper hysteresis threshold */
    double high;
} cairn_vision_canny_params;

/* Returns the default parameters. */
cairn_vision_canny_params cairn_vision_canny_default(void);

/* Detects the edges of an 8-bit grey image (Canny 1986), one pixel wide: strengths [height *
 * width], 0: no edge, otherwise twice the gradient magnitude, 1 ... 255. Statuses of
 * cairn_vision_gradients().
 *
 * grey: 8-bit grey image
 * strengths: [height * width] is written
 * name: used as the path in the error */
CAIRN_CHECKED cairn_status cairn_vision_canny(const cairn_vision_image *grey,
                                              const cairn_vision_canny_params *params,
                                              uint8_t *strengths, const char *name,
                                              cairn_file_error *error);

/* Cuts an object out of a photograph (GrabCut, Rother et al. 2004): everything outside of the box is
 * background, and of what is left the largest connected component is the object. The same image and
 * box give the same silhouette. CAIRN_BAD_ARGUMENT: an image that is not of 8 bits, or a box of less
 * than 8 pixels a side, or not within the image, or all of it; CAIRN_EMPTY: no object;
 * CAIRN_UNSUPPORTED, CAIRN_NO_MEMORY. On failure there is nothing to free.
 *
 * silhouette: set to a grey image of the same size, 0: the object, 255: the rest
 * photo: image of 8 bits
 * box: left, top, width, height in px
 * name: used as the path in the error */
CAIRN_CHECKED cairn_status cairn_vision_grab(cairn_vision_image *silhouette,
                                             const cairn_vision_image *photo, const int32_t box[4],
                                             const char *name, cairn_file_error *error);

/* Frees the samples.
 *
 * image: image that was read */
void cairn_vision_free(cairn_vision_image *image);

#ifdef __cplusplus
}
#endif

#endif
