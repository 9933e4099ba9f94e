/* vision_format: what the first bytes of an image file say. Internal to the host library. */
#ifndef CAIRN_HOST_VISION_FORMAT_H
#define CAIRN_HOST_VISION_FORMAT_H

#include <stddef.h>

#include "cairn/file_error.h"

typedef enum cairn_vision_format {
    CAIRN_VISION_TIFF,
    CAIRN_VISION_PNG,
    CAIRN_VISION_JPEG,
    CAIRN_VISION_PNM
} cairn_vision_format;

typedef struct cairn_vision_head {
    cairn_vision_format format;
    int64_t width, height;
} cairn_vision_head;

/* Tells the format and the size of an image from its bytes, without decoding it.
 * CAIRN_BAD_FORMAT, CAIRN_TRUNCATED (a PNG or JPEG also where its end is missing). */
CAIRN_CHECKED cairn_status cairn_vision_head_read(cairn_vision_head *head, const uint8_t *bytes,
                                                  size_t count, const char *path,
                                                  cairn_file_error *error);

#endif
