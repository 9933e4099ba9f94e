/* vision_shim: function table of libcairn-vision.so. Internal; plain C on both sides.
 *
 * Functions return a cairn_status. On failure `message` holds OpenCV's error text, 0-terminated,
 * truncated to `capacity` bytes. Memory that they allocate is freed by free(). */
#ifndef CAIRN_HOST_VISION_SHIM_H
#define CAIRN_HOST_VISION_SHIM_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Version of the table, incremented with every change of this header. */
#define CAIRN_VISION_SHIM_VERSION       2
#define CAIRN_VISION_SHIM_MESSAGE_BYTES 512

/* An image; fields as in cairn_vision_image. */
typedef struct cairn_vision_shim_image {
    int32_t width, height, channels, sample_bytes;
    void *samples;
} cairn_vision_shim_image;

/* The function table. */
typedef struct cairn_vision_shim {
    int32_t version; /* CAIRN_VISION_SHIM_VERSION */
    /* ending: the extension, such as ".png" */
    int32_t (*encode)(const cairn_vision_shim_image *image, const char *ending, uint8_t **bytes,
                      size_t *count, char *message, size_t capacity);
    int32_t (*gradients)(const uint8_t *grey, int32_t width, int32_t height, double sigma, float *x,
                         float *y, char *message, size_t capacity);
    /* low, high: hysteresis thresholds, grey levels per pixel */
    int32_t (*canny)(const uint8_t *grey, int32_t width, int32_t height, double sigma, double low,
                     double high, uint8_t *strengths, char *message, size_t capacity);
    /* box: left, top, width, height; silhouette: 0: the object, 255: the rest. CAIRN_EMPTY */
    int32_t (*grab)(const uint8_t *bgr, int32_t width, int32_t height, const int32_t box[4],
                    uint8_t *silhouette, char *message, size_t capacity);
} cairn_vision_shim;

/* Returns the table; the only symbol of the library. */
const cairn_vision_shim *cairn_vision_shim_table(void);

#ifdef __cplusplus
}
#endif

#endif
