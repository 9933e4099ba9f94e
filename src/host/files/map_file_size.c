/* Sizes of images, checked before pixels are allocated. */
#include "src/base/build.h"

#include "src/host/files/map_file_image.h"

cairn_status cairn_image_check_size(int64_t width, int64_t height, const char *path, int64_t line,
                                    cairn_file_error *error)
{
    if (width < 1 || height < 1)
        return cairn_file_error_set(error, CAIRN_BAD_FORMAT, path, line,
                                    "the image has %lld x %lld pixels, expected at least 1 x 1",
                                    (long long)width, (long long)height);
    if (width > CAIRN_IMAGE_MAX_PIXELS || height > CAIRN_IMAGE_MAX_PIXELS / width)
        return cairn_file_error_set(error, CAIRN_FULL, path, line,
                                    "the image has %lld x %lld pixels, expected at most %d",
                                    (long long)width, (long long)height, CAIRN_IMAGE_MAX_PIXELS);
    return CAIRN_OK;
}
