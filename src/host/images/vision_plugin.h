/* vision_plugin: what the readers, writers and users of images by OpenCV share. Internal to the host
 * library. */
#ifndef CAIRN_HOST_VISION_PLUGIN_H
#define CAIRN_HOST_VISION_PLUGIN_H

#include "cairn/vision.h"
#include "src/host/images/vision_shim.h"

/* Returns the function table of OpenCV; NULL and an error when the library is missing. */
const cairn_vision_shim *cairn_vision_require(const char *path, cairn_file_error *error);

/* Reports an error of OpenCV, with its message, and what was expected. Returns the status. */
cairn_status cairn_vision_report(cairn_status status, const char *path, const char *what,
                                 const char *message, cairn_file_error *error);

/* Returns 1 for an image with samples, within the limits. */
int cairn_vision_is_image(const cairn_vision_image *image);

/* Returns 1 for such an image of grey samples of 8 bits. */
static inline int cairn_vision_is_grey(const cairn_vision_image *image)
{
    return cairn_vision_is_image(image) && image->channels == 1 && image->sample_bytes == 1;
}

#endif
