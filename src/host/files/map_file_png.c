/* PNG by libpng, which returns from errors by longjmp: all state that must survive one is in a
 * struct. map_file_png_plain.c takes its place where libpng is missing. */
#include "src/base/build.h"

#include <errno.h>
#include <png.h>
#include <setjmp.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/files/map_file_image.h"

/* State of a PNG operation. */
typedef struct png_work {
    png_structp png;
    png_infop info;
    uint8_t *samples;
    png_bytepp row;
    /* output of the encoder */
    uint8_t *bytes;
    size_t count;
    char problem[160];
} png_work;

static void on_png_error(png_structp png, png_const_charp words)
{
    png_work *work = png_get_error_ptr(png);

    (void)snprintf(work->problem, sizeof work->problem, "%s", words);
    longjmp(png_jmpbuf(png), 1);
}

static void on_png_warning(png_structp png, png_const_charp words)
{
    (void)png;
    (void)words;
}

/* Converts interleaved samples to grey and alpha. */
static void convert_samples(cairn_image *image, const uint8_t *sample, int32_t channels)
{
    size_t count = (size_t)image->width * (size_t)image->height, i;
    int32_t colours = channels - (channels % 2 == 0), k;

    for (i = 0; i < count; i++, sample += channels) {
        int32_t sum = 0;

        for (k = 0; k < colours; k++)
            sum += sample[k];
        image->pixel[i] = (uint8_t)((2 * sum + colours) / (2 * colours));
        if (image->alpha != NULL)
            image->alpha[i] = sample[channels - 1];
    }
}

/* Decodes a PNG; errors of libpng return to the setjmp here. */
static cairn_status decode_png(cairn_image *image, png_work *work, FILE *file, const char *path,
                               cairn_file_error *error)
{
    size_t stride, y;
    int32_t channels;
    cairn_status status;

    if (setjmp(png_jmpbuf(work->png)) != 0)
        return cairn_file_error_set(
            error, feof(file) ? CAIRN_TRUNCATED : CAIRN_BAD_FORMAT, path, 0,
            "the PNG data are damaged or cut (%s), expected a whole PNG image", work->problem);
    png_init_io(work->png, file);
    png_read_info(work->png, work->info);
    status = cairn_image_allocate(image, png_get_image_width(work->png, work->info),
                                  png_get_image_height(work->png, work->info), path, 0, error);
    if (status != CAIRN_OK)
        return status;
    png_set_expand(work->png);
    png_set_strip_16(work->png);
    (void)png_set_interlace_handling(work->png);
    png_read_update_info(work->png, work->info);
    channels = png_get_channels(work->png, work->info);
    if (image->height > CAIRN_IMAGE_MAX_PIXELS / channels / image->width)
        return cairn_file_error_set(
            error, CAIRN_FULL, path, 0,
            "the image has %d x %d pixels of %d samples, expected at most %d samples",
            (int)image->width, (int)image->height, (int)channels, CAIRN_IMAGE_MAX_PIXELS);
    stride = png_get_rowbytes(work->png, work->info);
    work->samples = calloc((size_t)image->height, stride);
    work->row = malloc((size_t)image->height * sizeof *work->row);
    if (channels % 2 == 0)
        image->alpha = malloc((size_t)image->width * (size_t)image->height);
    if (work->samples == NULL || work->row == NULL || (channels % 2 == 0 && image->alpha == NULL))
        return cairn_file_error_system(error, path, "read", ENOMEM);
    for (y = 0; y < (size_t)image->height; y++)
        work->row[y] = work->samples + y * stride;
    png_read_image(work->png, work->row);
    png_read_end(work->png, NULL);
    convert_samples(image, work->samples, channels);
    return CAIRN_OK;
}

cairn_status cairn_image_decode_png(cairn_image *image, FILE *file, const char *path,
                                    cairn_file_error *error)
{
    png_work work;
    cairn_status status = CAIRN_NO_MEMORY;

    memset(&work, 0, sizeof work);
    work.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &work, on_png_error, on_png_warning);
    if (work.png != NULL)
        work.info = png_create_info_struct(work.png);
    if (work.info != NULL)
        status = decode_png(image, &work, file, path, error);
    else
        (void)cairn_file_error_system(error, path, "read", ENOMEM);
    png_destroy_read_struct(&work.png, &work.info, NULL);
    free(work.samples);
    free(work.row);
    return status;
}

/* Appends encoded bytes to the output (callback of libpng). */
static void on_png_bytes(png_structp png, png_bytep bytes, size_t count)
{
    png_work *work = png_get_io_ptr(png);
    uint8_t *grown = realloc(work->bytes, work->count + count);

    if (grown == NULL)
        png_error(png, "no memory");
    work->bytes = grown;
    memcpy(work->bytes + work->count, bytes, count);
    work->count += count;
}

static void on_png_flush(png_structp png)
{
    (void)png;
}

/* Encodes a PNG; false after an error of libpng. */
static bool encode(png_work *work, const uint8_t *pixel, int32_t width, int32_t height,
                   int32_t channels)
{
    int32_t y;

    if (setjmp(png_jmpbuf(work->png)) != 0)
        return false;
    png_set_write_fn(work->png, work, on_png_bytes, on_png_flush);
    png_set_user_limits(work->png, INT32_MAX, INT32_MAX);
    png_set_IHDR(work->png, work->info, (png_uint_32)width, (png_uint_32)height, 8,
                 channels == 1   ? PNG_COLOR_TYPE_GRAY
                 : channels == 3 ? PNG_COLOR_TYPE_RGB
                                 : PNG_COLOR_TYPE_RGB_ALPHA,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(work->png, work->info);
    for (y = 0; y < height; y++)
        png_write_row(work->png, pixel + (size_t)y * (size_t)width * (size_t)channels);
    png_write_end(work->png, NULL);
    return true;
}

cairn_status cairn_image_encode_png(uint8_t **bytes, size_t *count, const uint8_t *pixel,
                                    int32_t width, int32_t height, int32_t channels)
{
    png_work work;
    bool whole;

    memset(&work, 0, sizeof work);
    work.png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &work, on_png_error, on_png_warning);
    if (work.png != NULL)
        work.info = png_create_info_struct(work.png);
    whole = work.info != NULL && encode(&work, pixel, width, height, channels);
    png_destroy_write_struct(&work.png, &work.info);
    if (!whole) {
        free(work.bytes);
        work.bytes = NULL;
        work.count = 0;
    }
    *bytes = work.bytes;
    *count = work.count;
    return whole ? CAIRN_OK : CAIRN_NO_MEMORY;
}
