/* Grey images as PGM and PNG: PGM, and which of both a file is. */
#include "src/base/build.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/files/map_file_image.h"
#include "src/host/base/regular_file.h"

/* Checks the size and allocates the pixels; errors name the line. */
static cairn_status allocate(cairn_image *image, int64_t width, int64_t height, const char *path,
                             int64_t line, cairn_file_error *error)
{
    cairn_status status = cairn_image_check_size(width, height, path, line, error);

    if (status != CAIRN_OK)
        return status;
    CAIRN_ASSERT(width > 0 && height > 0);
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
        status = allocate(image, width, height, reader->path, reader->line, reader->error);
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

/* Converts interleaved samples to grey, the mean of the colours, and alpha. */
static void convert_samples(cairn_image *image, const uint8_t *sample, int32_t channels)
{
    size_t count = (size_t)image->width * (size_t)image->height;
    int32_t colours = channels - (channels % 2 == 0);

    for (size_t i = 0; i < count; i++, sample += channels) {
        int32_t sum = 0;

        for (int32_t k = 0; k < colours; k++)
            sum += sample[k];
        image->pixel[i] = (uint8_t)((2 * sum + colours) / (2 * colours));
        if (image->alpha != NULL)
            image->alpha[i] = sample[channels - 1];
    }
}

static cairn_status read_png(cairn_image *image, FILE *file, const char *path,
                             cairn_file_error *error)
{
    cairn_png_source source = {.file = file, .path = path, .error = error};
    cairn_png_samples png;
    cairn_status status = cairn_png_decode(&png, &source, 0);

    if (status != CAIRN_OK)
        return status;
    status = allocate(image, png.width, png.height, path, 0, error);
    if (status == CAIRN_OK && png.channels % 2 == 0) {
        image->alpha = malloc((size_t)png.width * (size_t)png.height);
        if (image->alpha == NULL)
            status = cairn_file_error_system(error, path, "read", ENOMEM);
    }
    if (status == CAIRN_OK)
        convert_samples(image, png.samples, png.channels);
    free(png.samples);
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
