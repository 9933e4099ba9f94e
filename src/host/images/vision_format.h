/* vision_format: detection of an image file's format and size from its header, without decoding.
 * Internal to the host library. */
#ifndef CAIRN_HOST_VISION_FORMAT_H
#define CAIRN_HOST_VISION_FORMAT_H

#include <stddef.h>

#include "cairn/file_error.h"

/* Format of an image file. */
typedef enum cairn_vision_format {
    CAIRN_VISION_TIFF,
    CAIRN_VISION_PNG,
    CAIRN_VISION_JPEG,
    CAIRN_VISION_PNM
} cairn_vision_format;

/* Header of an image file. */
typedef struct cairn_vision_header {
    cairn_vision_format format;
    int64_t width, height; /* pixels, as they are stored */
    /* how they are to be shown: 1 ... 8 as in EXIF; 1: as stored */
    int32_t orientation;
} cairn_vision_header;

/* Reads the format and the size of an image from its first bytes. CAIRN_BAD_FORMAT, CAIRN_TRUNCATED
 * (of a PNG or JPEG also when its end is missing). */
CAIRN_CHECKED cairn_status cairn_vision_header_read(cairn_vision_header *header,
                                                    const uint8_t *bytes, size_t count,
                                                    const char *path, cairn_file_error *error);

#endif
