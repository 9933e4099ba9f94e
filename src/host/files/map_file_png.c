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
    png_bytepp row;
    /* input of the decoder */
    const cairn_png_source *source;
    size_t at;
    bool is_cut; /* the file ended */
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

/* Reads from the file or from memory (callback of libpng). */
static void on_png_read(png_structp png, png_bytep to, size_t count)
{
    png_work *work = png_get_io_ptr(png);
    const cairn_png_source *source = work->source;
    size_t left = source->count - work->at;

    if (source->file != NULL) {
        work->is_cut = fread(to, 1, count, source->file) < count;
    } else {
        work->is_cut = left < count;
        memcpy(to, source->bytes + work->at, work->is_cut ? left : count);
        work->at += work->is_cut ? left : count;
    }
    if (work->is_cut)
        png_error(png, "the file ends early");
}

/* Sets the conversion into samples of whole bytes. */
static void set_conversion(png_work *work, bool is_picture)
{
    const uint16_t one = 1;
    bool is_little_endian = *(const uint8_t *)&one == 1;

    png_set_expand(work->png);
    png_set_bgr(work->png);
    if (!is_picture)
        png_set_strip_16(work->png);
    else if (is_little_endian)
        png_set_swap(work->png);
    /* Grey with alpha becomes four channels. */
    if (is_picture && ((png_get_color_type(work->png, work->info) & PNG_COLOR_MASK_ALPHA) != 0 ||
                       png_get_valid(work->png, work->info, PNG_INFO_tRNS) != 0))
        png_set_gray_to_rgb(work->png);
    (void)png_set_interlace_handling(work->png);
    png_read_update_info(work->png, work->info);
}

/* Decodes a PNG; errors of libpng return to the setjmp here. */
static cairn_status decode_png(cairn_png_samples *image, png_work *work, bool is_picture)
{
    const cairn_png_source *source = work->source;
    size_t stride;
    cairn_status status;

    if (setjmp(png_jmpbuf(work->png)) != 0)
        return cairn_file_error_set(
            source->error, work->is_cut ? CAIRN_TRUNCATED : CAIRN_BAD_FORMAT, source->path, 0,
            "the PNG data are damaged or cut (%s), expected a whole PNG image", work->problem);
    png_set_read_fn(work->png, work, on_png_read);
    png_read_info(work->png, work->info);
    status = cairn_image_check_size(png_get_image_width(work->png, work->info),
                                    png_get_image_height(work->png, work->info), source->path, 0,
                                    source->error);
    if (status != CAIRN_OK)
        return status;
    set_conversion(work, is_picture);
    image->width = (int32_t)png_get_image_width(work->png, work->info);
    image->height = (int32_t)png_get_image_height(work->png, work->info);
    image->channels = png_get_channels(work->png, work->info);
    image->sample_bytes = png_get_bit_depth(work->png, work->info) / 8;
    if (image->height > CAIRN_IMAGE_MAX_PIXELS / image->channels / image->width && !is_picture)
        return cairn_file_error_set(
            source->error, CAIRN_FULL, source->path, 0,
            "the image has %d x %d pixels of %d samples, expected at most %d samples",
            (int)image->width, (int)image->height, (int)image->channels, CAIRN_IMAGE_MAX_PIXELS);
    stride = png_get_rowbytes(work->png, work->info);
    image->samples = calloc((size_t)image->height, stride);
    work->row = malloc((size_t)image->height * sizeof *work->row);
    if (image->samples == NULL || work->row == NULL)
        return cairn_file_error_system(source->error, source->path, "read", ENOMEM);
    for (size_t y = 0; y < (size_t)image->height; y++)
        work->row[y] = (uint8_t *)image->samples + y * stride;
    png_read_image(work->png, work->row);
    png_read_end(work->png, NULL);
    return CAIRN_OK;
}

cairn_status cairn_png_decode(cairn_png_samples *image, const cairn_png_source *source,
                              int32_t is_picture)
{
    png_work work;
    cairn_status status = CAIRN_NO_MEMORY;

    memset(image, 0, sizeof *image);
    memset(&work, 0, sizeof work);
    work.source = source;
    work.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &work, on_png_error, on_png_warning);
    if (work.png != NULL)
        work.info = png_create_info_struct(work.png);
    if (work.info != NULL)
        status = decode_png(image, &work, is_picture != 0);
    else
        (void)cairn_file_error_system(source->error, source->path, "read", ENOMEM);
    png_destroy_read_struct(&work.png, &work.info, NULL);
    free(work.row);
    if (status != CAIRN_OK) {
        free(image->samples);
        memset(image, 0, sizeof *image);
    }
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
