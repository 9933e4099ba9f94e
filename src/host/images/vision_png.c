/* PNG by the decoder of map images. */
#include "src/base/build.h"

#include "src/host/files/map_file_image.h"
#include "src/host/images/vision_decode.h"

cairn_status cairn_vision_decode_png(cairn_vision_image *image, const cairn_vision_file *file)
{
    cairn_png_source source = {
        .bytes = file->bytes, .count = file->count, .path = file->path, .error = file->error};
    cairn_png_samples png;
    cairn_status status = cairn_png_decode(&png, &source, 1);

    if (status != CAIRN_OK)
        return status;
    image->width = png.width;
    image->height = png.height;
    image->channels = png.channels;
    image->sample_bytes = png.sample_bytes;
    image->samples = png.samples;
    return CAIRN_OK;
}
