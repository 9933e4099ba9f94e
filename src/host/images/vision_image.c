/* Images in memory: their samples, and the conversion to grey. */
#include "src/base/build.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/images/vision_decode.h"
#include "src/host/images/vision_plugin.h"

cairn_status cairn_vision_allocate(cairn_vision_image *image, int64_t width, int64_t height,
                                   int32_t channels, int32_t sample_bytes,
                                   const cairn_vision_file *file)
{
    image->width = (int32_t)width;
    image->height = (int32_t)height;
    image->channels = channels;
    image->sample_bytes = sample_bytes;
    image->samples = calloc((size_t)width * (size_t)height, (size_t)(channels * sample_bytes));
    return image->samples != NULL
               ? CAIRN_OK
               : cairn_file_error_system(file->error, file->path, "read", ENOMEM);
}

void cairn_vision_free(cairn_vision_image *image)
{
    free(image->samples);
    memset(image, 0, sizeof *image);
}

int cairn_vision_is_image(const cairn_vision_image *image)
{
    return image != NULL && image->samples != NULL && image->width >= 1 && image->height >= 1 &&
           image->width <= CAIRN_VISION_MAX_SIDE && image->height <= CAIRN_VISION_MAX_SIDE &&
           (image->channels == 1 || image->channels == 3 || image->channels == 4) &&
           (image->sample_bytes == 1 || image->sample_bytes == 2);
}

/* ---- Grey ---- */

/* Returns a sample as an unsigned integer. */
static uint32_t sample_of(const cairn_vision_image *image, size_t index)
{
    return image->sample_bytes == 1 ? ((const uint8_t *)image->samples)[index]
                                    : ((const uint16_t *)image->samples)[index];
}

/* Returns how many bits the samples of 16 are shifted to 8: fewer where no sample uses more than 10
 * or 12, as scanners and cameras write them. */
static int32_t shift_of(const cairn_vision_image *image)
{
    size_t count = (size_t)image->width * (size_t)image->height * (size_t)image->channels;
    uint32_t most = 0;

    if (image->sample_bytes == 1)
        return 0;
    for (size_t i = 0; i < count; i++)
        if (image->channels < 4 || i % 4 != 3)
            most = sample_of(image, i) > most ? sample_of(image, i) : most;
    return most < 256 ? 0 : most < 1024 ? 2 : most < 4096 ? 4 : 8;
}

/* Fills what is transparent by a background: white behind a dark picture, black behind a light one,
 * so that a silhouette stays one. */
static void fill_background(uint8_t *grey, const uint8_t *alpha, size_t pixels)
{
    uint64_t sum = 0, weight = 0;
    uint32_t background;

    for (size_t i = 0; i < pixels; i++) {
        sum += (uint64_t)grey[i] * alpha[i];
        weight += alpha[i];
    }
    if (weight == 0)
        return; /* nothing would be seen: no alpha is meant */
    background = sum < 128 * weight ? 255 : 0;
    for (size_t i = 0; i < pixels; i++)
        grey[i] =
            (uint8_t)((grey[i] * (uint32_t)alpha[i] + background * (255u - alpha[i]) + 127) / 255);
}

cairn_status cairn_vision_make_grey(cairn_vision_image *image)
{
    size_t pixels;
    uint8_t *grey, *alpha = NULL;
    int32_t shift;

    if (!cairn_vision_is_image(image))
        return CAIRN_BAD_ARGUMENT;
    if (cairn_vision_is_grey(image))
        return CAIRN_OK;
    pixels = (size_t)image->width * (size_t)image->height;
    grey = malloc(pixels);
    if (image->channels == 4)
        alpha = malloc(pixels);
    if (grey == NULL || (image->channels == 4 && alpha == NULL)) {
        free(grey);
        free(alpha);
        return CAIRN_NO_MEMORY;
    }
    shift = shift_of(image);
    for (size_t i = 0; i < pixels; i++) {
        size_t at = i * (size_t)image->channels;
        uint32_t value = sample_of(image, at);

        if (image->channels > 1)
            value = (114 * value + 587 * sample_of(image, at + 1) + 299 * sample_of(image, at + 2) +
                     500) /
                    1000;
        grey[i] = (uint8_t)(value >> shift);
        if (alpha != NULL)
            alpha[i] = (uint8_t)(sample_of(image, at + 3) >> (image->sample_bytes == 1 ? 0 : 8));
    }
    if (alpha != NULL)
        fill_background(grey, alpha, pixels);
    free(alpha);
    free(image->samples);
    image->samples = grey;
    image->channels = image->sample_bytes = 1;
    return CAIRN_OK;
}
