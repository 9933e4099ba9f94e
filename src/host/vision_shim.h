/* vision_shim: what libcairn-vision.so offers to the host library. Internal; plain C on both sides.
 *
 * Calls return a cairn_status; on failure `words` holds OpenCV's text, 0-terminated, cut to
 * `room` bytes. What they allocate is given back by free(). */
#ifndef CAIRN_HOST_VISION_SHIM_H
#define CAIRN_HOST_VISION_SHIM_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Raised whenever this header changes. */
#define CAIRN_VISION_SHIM_VERSION 1
#define CAIRN_VISION_SHIM_WORDS   512

typedef struct cairn_vision_shim_image {
    int32_t width, height, channels, sample_bytes;
    void *samples;
} cairn_vision_shim_image;

typedef struct cairn_vision_shim {
    int32_t version; /* CAIRN_VISION_SHIM_VERSION */
    int32_t (*decode)(const uint8_t *bytes, size_t count, cairn_vision_shim_image *image,
                      char *words, size_t room);
    /* ending: ".png" */
    int32_t (*encode)(const cairn_vision_shim_image *image, const char *ending, uint8_t **bytes,
                      size_t *count, char *words, size_t room);
    int32_t (*gradients)(const uint8_t *grey, int32_t width, int32_t height, double sigma, float *x,
                         float *y, char *words, size_t room);
    /* low, high: grey levels per pixel */
    int32_t (*canny)(const uint8_t *grey, int32_t width, int32_t height, double sigma, double low,
                     double high, uint8_t *strengths, char *words, size_t room);
} cairn_vision_shim;

/* The one symbol of the library. */
const cairn_vision_shim *cairn_vision_shim_table(void);

#ifdef __cplusplus
}
#endif

#endif
