/* Grey images as PGM and PNG. libpng returns from errors by longjmp, so all state that must survive
 * one is in a struct. */
#include "src/core/build.h"

#include <errno.h>
#include <png.h>
#include <setjmp.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/map_file_image.h"
#include "src/host/regular_file.h"

/* Checks the size and allocates the pixels. */
static cairn_status allocate_pixels(cairn_image *image, int64_t width, int64_t height,
                                    const char *path, int64_t line, cairn_file_error *error)
{
    if (width < 1 || height < 1)
        return cairn_file_error_set(error, CAIRN_BAD_FORMAT, path, line,
                                    "the image has %lld x %lld pixels, expected at least 1 x 1",
                                    (long long)width, (long long)height);
    if (width > CAIRN_IMAGE_MAX_PIXELS || height > CAIRN_IMAGE_MAX_PIXELS / width)
        return cairn_file_error_set(error, CAIRN_FULL, path, line,
                                    "the image has %lld x %lld pixels, expected at most %d",
                                    (long long)width, (long long)height, CAIRN_IMAGE_MAX_PIXELS);
    image->width = (int32_t)width;
    image->height = (int32_t)height;
    image->pixel = malloc((size_t)width * (size_t)height);
    return image->pixel != NULL ? CAIRN_OK : cairn_file_error_system(error, path, "read", ENOMEM);
}

void cairn_image_free(cairn_image *image)
{
    free(image->pixel);
    free(image->alpha);
    memset(image, 0, sizeof *image);
}

/* ---- PGM ---- */

typedef struct pgm_reader {
    FILE *file;
    const char *path;
    int64_t line;
    cairn_file_error *error;
} pgm_reader;

static int next_byte(pgm_reader *reader)
{
    int byte = getc(reader->file);

    reader->line += byte == '\n';
    return byte;
}

/* Reads an integer of the header and the one byte behind it. Comments and blanks are skipped. A
 * value above INT32_MAX stays above it. */
static cairn_status read_pgm_number(pgm_reader *reader, const char *what, int64_t *value)
{
    int byte = next_byte(reader);

    while (byte == '#' || byte == ' ' || (byte >= '\t' && byte <= '\r')) {
        if (byte == '#')
            while (byte != '\n' && byte != EOF)
                byte = next_byte(reader);
        else
            byte = next_byte(reader);
    }
    if (byte == EOF)
        return cairn_file_error_set(reader->error, CAIRN_TRUNCATED, reader->path, reader->line,
                                    "the file ends early, expected %s", what);
    if (byte < '0' || byte > '9')
        return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path, reader->line,
                                    "byte 0x%02x, expected %s", (unsigned)byte, what);
    for (*value = 0; byte >= '0' && byte <= '9'; byte = next_byte(reader))
        if (*value < INT32_MAX)
            *value = *value * 10 + (byte - '0');
    return CAIRN_OK;
}

static cairn_status read_plain_pixels(pgm_reader *reader, cairn_image *image)
{
    size_t count = (size_t)image->width * (size_t)image->height, i;
    cairn_status status;
    int64_t value;

    for (i = 0; i < count; i++) {
        status = read_pgm_number(reader, "a pixel", &value);
        if (status != CAIRN_OK)
            return status;
        if (value > 255)
            return cairn_file_error_set(reader->error, CAIRN_BAD_FORMAT, reader->path, reader->line,
                                        "pixel %zu is %lld, expected at most 255", i + 1,
                                        (long long)value);
        image->pixel[i] = (uint8_t)value;
    }
    return CAIRN_OK;
}

static cairn_status read_pgm(cairn_image *image, pgm_reader *reader, int plain)
{
    int64_t width = 0, height = 0, levels = 0;
    size_t count, read_count;
    cairn_status status;

    status = read_pgm_number(reader, "the width of the image", &width);
    if (status == CAIRN_OK)
        status = read_pgm_number(reader, "the height of the image", &height);
    if (status == CAIRN_OK)
        status = read_pgm_number(reader, "the highest grey level", &levels);
    if (status == CAIRN_OK && levels != 255)
        status =
            cairn_file_error_set(reader->error, CAIRN_UNSUPPORTED, reader->path, reader->line,
                                 "the highest grey level is %lld, expected 255", (long long)levels);
    if (status == CAIRN_OK)
        status = allocate_pixels(image, width, height, reader->path, reader->line, reader->error);
    if (status != CAIRN_OK)
        return status;
    if (plain)
        return read_plain_pixels(reader, image);
    count = (size_t)width * (size_t)height;
    read_count = fread(image->pixel, 1, count, reader->file);
    if (read_count < count)
        return cairn_file_error_set(reader->error, CAIRN_TRUNCATED, reader->path, 0,
                                    "the file ends after %zu of %zu pixels", read_count, count);
    return CAIRN_OK;
}

/* ---- PNG ---- */

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
    status = allocate_pixels(image, png_get_image_width(work->png, work->info),
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
    work->samples = malloc(stride * (size_t)image->height);
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

static cairn_status read_png(cairn_image *image, FILE *file, const char *path,
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

cairn_status cairn_image_read(cairn_image *image, const char *path, cairn_file_error *error)
{
    FILE *file;
    pgm_reader pgm = {.path = path, .line = 1, .error = error};
    uint8_t magic[2];
    cairn_status status = regular_file_open(&file, path, error);
    size_t read_count;

    memset(image, 0, sizeof *image);
    if (status != CAIRN_OK)
        return status;
    pgm.file = file;
    read_count = fread(magic, 1, 2, file);
    if (ferror(file)) {
        status = cairn_file_error_system(error, path, "read", errno);
    } else if (read_count == 2 && magic[0] == 'P' && (magic[1] == '2' || magic[1] == '5')) {
        status = read_pgm(image, &pgm, magic[1] == '2');
    } else if (read_count == 2 && magic[0] == 0x89 && magic[1] == 'P') {
        rewind(file);
        status = read_png(image, file, path, error);
    } else if (read_count < 2) {
        status = cairn_file_error_set(error, CAIRN_TRUNCATED, path, 0,
                                      "the file has %zu bytes, expected an image", read_count);
    } else {
        status = cairn_file_error_set(
            error, CAIRN_BAD_FORMAT, path, 0,
            "begins with the bytes 0x%02x%02x, expected a PGM (P5 or P2) or PNG image", magic[0],
            magic[1]);
    }
    (void)fclose(file);
    if (status != CAIRN_OK)
        cairn_image_free(image);
    return status;
}

cairn_status cairn_image_write_pgm(const char *path, const uint8_t *pixel, int32_t width,
                                   int32_t height, cairn_file_error *error)
{
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    cairn_output_print(output, "P5\n%d %d\n255\n", (int)width, (int)height);
    cairn_output_bytes(output, pixel, (size_t)width * (size_t)height);
    return cairn_output_commit(output, error);
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

cairn_status cairn_image_write_png(const char *path, const uint8_t *pixel, int32_t width,
                                   int32_t height, cairn_file_error *error)
{
    cairn_output *output;
    uint8_t *bytes;
    size_t count;
    cairn_status status = cairn_image_encode_png(&bytes, &count, pixel, width, height, 1);

    if (status != CAIRN_OK)
        return cairn_file_error_system(error, path, "write", ENOMEM);
    status = cairn_output_open(&output, path, error);
    if (status == CAIRN_OK) {
        cairn_output_bytes(output, bytes, count);
        status = cairn_output_commit(output, error);
    }
    free(bytes);
    return status;
}
