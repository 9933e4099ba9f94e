/* Image input and output, gradients and edges by OpenCV, which is loaded on first use.
 *
 * Method
 * 1. A file is read into memory, and its header gives format and size.
 * 2. The shim decodes it from memory. An oversized or truncated file never reaches a decoder, and
 *    errors of the system are reported as such.
 *
 * Limits: JPEG decoders return the readable part of a damaged file. A JPEG is refused only when its
 * end is missing. */
#include "src/base/build.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "cairn/vision.h"
#include "src/host/files/map_file_image.h"
#include "src/host/base/regular_file.h"
#include "src/host/images/shim.h"
#include "src/host/images/vision_format.h"
#include "src/host/images/vision_shim.h"

#define PLUGIN_NAME "libcairn-vision.so"
/* Largest accepted file in bytes: CAIRN_VISION_MAX_PIXELS pixels of four 16-bit samples, and
 * metadata. */
#define MAX_FILE_BYTES   ((int64_t)CAIRN_VISION_MAX_PIXELS * 8 + (1 << 20))
#define MAX_SIGMA_PIXELS 50
#define MAX_GRADIENT     1000

/* ---- The library ---- */

static const cairn_vision_shim *find_shim(void)
{
    return cairn_shim_find(PLUGIN_NAME, "CAIRN_VISION", "cairn_vision_shim_table",
                           CAIRN_VISION_SHIM_VERSION);
}

/* Returns the function table; NULL and an error when the library is missing. */
static const cairn_vision_shim *require_shim(const char *path, cairn_file_error *error)
{
    const cairn_vision_shim *shim = find_shim();

    if (shim == NULL)
        (void)cairn_file_error_set(error, CAIRN_UNSUPPORTED, path, 0,
                                   "image reading needs " PLUGIN_NAME
                                   " of this version, expected it beside the program "
                                   "(built by `make vision`, OpenCV 4: tools/deps.sh vision)");
    return shim;
}

cairn_status cairn_vision_load(cairn_file_error *error)
{
    return require_shim(PLUGIN_NAME, error) != NULL ? CAIRN_OK : CAIRN_UNSUPPORTED;
}

/* Reports an error of OpenCV. */
static cairn_status report_opencv_error(cairn_status status, const char *path, const char *what,
                                        const char *message, cairn_file_error *error)
{
    return cairn_file_error_set(error, status, path, 0, "OpenCV: %s, expected %s", message, what);
}

/* ---- Reading ---- */

/* Reads a file of at most MAX_FILE_BYTES into memory. */
static cairn_status read_open_file(FILE *file, const char *path, uint8_t **bytes, size_t *count,
                                   cairn_file_error *error)
{
    struct stat about;
    cairn_status status = CAIRN_OK;

    if (fstat(fileno(file), &about) != 0)
        return cairn_file_error_system(error, path, "read", errno);
    if (about.st_size > MAX_FILE_BYTES)
        return cairn_file_error_set(error, CAIRN_FULL, path, 0,
                                    "%lld bytes, expected an image of at most %lld",
                                    (long long)about.st_size, (long long)MAX_FILE_BYTES);
    *bytes = malloc((size_t)about.st_size + 1);
    if (*bytes == NULL)
        return cairn_file_error_system(error, path, "read", ENOMEM);
    *count = fread(*bytes, 1, (size_t)about.st_size, file);
    if (ferror(file)) {
        status = cairn_file_error_system(error, path, "read", errno);
        free(*bytes);
        *bytes = NULL;
    }
    return status;
}

static cairn_status read_file(const char *path, uint8_t **bytes, size_t *count,
                              cairn_file_error *error)
{
    FILE *file;
    cairn_status status = regular_file_open(&file, path, error);

    *bytes = NULL;
    *count = 0;
    if (status != CAIRN_OK)
        return status;
    status = read_open_file(file, path, bytes, count, error);
    (void)fclose(file);
    return status;
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

/* Reads PGM and PNG without OpenCV. */
static cairn_status read_without_opencv(cairn_vision_image *image, const char *path,
                                        cairn_file_error *error)
{
    cairn_image plain;
    cairn_status status = cairn_image_read(&plain, path, error);

    if (status != CAIRN_OK)
        return status;
    image->width = plain.width;
    image->height = plain.height;
    image->channels = image->sample_bytes = 1;
    if (plain.alpha != NULL)
        fill_background(plain.pixel, plain.alpha, (size_t)plain.width * (size_t)plain.height);
    image->samples = plain.pixel;
    plain.pixel = NULL;
    cairn_image_free(&plain);
    return CAIRN_OK;
}

/* Turns and mirrors an image as its EXIF orientation says. Returns 0 when there is no memory. */
static int orient(cairn_vision_image *image, int32_t orientation)
{
    int32_t swapped = orientation > 4, width = swapped ? image->height : image->width,
            height = swapped ? image->width : image->height;
    /* Sides of the stored picture along which it is read from the end. */
    int32_t from_right =
                orientation == 2 || orientation == 3 || orientation == 7 || orientation == 8,
            from_below =
                orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
    size_t bytes = (size_t)image->channels * (size_t)image->sample_bytes;
    const uint8_t *from = image->samples;
    uint8_t *turned, *to;

    if (orientation == 1)
        return 1;
    turned = malloc((size_t)width * (size_t)height * bytes);
    if (turned == NULL)
        return 0;
    to = turned;
    for (int32_t v = 0; v < height; v++)
        for (int32_t u = 0; u < width; u++, to += bytes) {
            int32_t x = swapped ? v : u, y = swapped ? u : v;

            x = from_right ? image->width - 1 - x : x;
            y = from_below ? image->height - 1 - y : y;
            memcpy(to, from + ((size_t)y * (size_t)image->width + (size_t)x) * bytes, bytes);
        }
    free(image->samples);
    image->samples = turned;
    image->width = width;
    image->height = height;
    return 1;
}

/* Decodes an image from memory after a check of its header. */
static cairn_status decode(cairn_vision_image *image, const uint8_t *bytes, size_t count,
                           const char *path, cairn_file_error *error)
{
    const cairn_vision_shim *shim;
    cairn_vision_shim_image decoded;
    char message[CAIRN_VISION_SHIM_MESSAGE_BYTES] = "";
    cairn_vision_header header;
    cairn_status status = cairn_vision_header_read(&header, bytes, count, path, error);

    if (status != CAIRN_OK)
        return status;
    if (header.width > CAIRN_VISION_MAX_SIDE || header.height > CAIRN_VISION_MAX_SIDE ||
        header.width * header.height > CAIRN_VISION_MAX_PIXELS)
        return cairn_file_error_set(
            error, CAIRN_FULL, path, 0,
            "the image has %lld x %lld pixels, expected at most %d a side and %d in all",
            (long long)header.width, (long long)header.height, CAIRN_VISION_MAX_SIDE,
            CAIRN_VISION_MAX_PIXELS);
    shim = find_shim();
    if (shim == NULL && (header.format == CAIRN_VISION_PNG || header.format == CAIRN_VISION_PNM))
        return read_without_opencv(image, path, error);
    if (shim == NULL)
        return require_shim(path, error) == NULL ? CAIRN_UNSUPPORTED : CAIRN_OK;
    status = shim->decode(bytes, count, &decoded, message, sizeof message);
    if (status != CAIRN_OK)
        return report_opencv_error(status, path, "a whole image of 8 or 16 bits", message, error);
    if (decoded.width != header.width || decoded.height != header.height) {
        free(decoded.samples);
        return cairn_file_error_set(error, CAIRN_BAD_FORMAT, path, 0,
                                    "OpenCV: decoded to %d x %d pixels, expected %lld x %lld as in "
                                    "the header",
                                    (int)decoded.width, (int)decoded.height,
                                    (long long)header.width, (long long)header.height);
    }
    image->width = decoded.width;
    image->height = decoded.height;
    image->channels = decoded.channels;
    image->sample_bytes = decoded.sample_bytes;
    image->samples = decoded.samples;
    if (orient(image, header.orientation))
        return CAIRN_OK;
    cairn_vision_free(image);
    return cairn_file_error_system(error, path, "read", ENOMEM);
}

cairn_status cairn_vision_read(cairn_vision_image *image, const char *path, cairn_file_error *error)
{
    uint8_t *bytes;
    size_t count;
    cairn_status status;

    memset(image, 0, sizeof *image);
    status = read_file(path, &bytes, &count, error);
    if (status == CAIRN_OK)
        status = decode(image, bytes, count, path, error);
    free(bytes);
    return status;
}

cairn_status cairn_vision_read_grey(cairn_vision_image *image, const char *path,
                                    cairn_file_error *error)
{
    cairn_status status = cairn_vision_read(image, path, error);

    if (status != CAIRN_OK)
        return status;
    status = cairn_vision_make_grey(image);
    if (status != CAIRN_OK) {
        cairn_vision_free(image);
        return cairn_file_error_system(error, path, "read", ENOMEM);
    }
    return CAIRN_OK;
}

void cairn_vision_free(cairn_vision_image *image)
{
    free(image->samples);
    memset(image, 0, sizeof *image);
}

/* ---- Grey ---- */

static int is_image(const cairn_vision_image *image)
{
    return image != NULL && image->samples != NULL && image->width >= 1 && image->height >= 1 &&
           image->width <= CAIRN_VISION_MAX_SIDE && image->height <= CAIRN_VISION_MAX_SIDE &&
           (image->channels == 1 || image->channels == 3 || image->channels == 4) &&
           (image->sample_bytes == 1 || image->sample_bytes == 2);
}

static int is_grey(const cairn_vision_image *image)
{
    return is_image(image) && image->channels == 1 && image->sample_bytes == 1;
}

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

cairn_status cairn_vision_make_grey(cairn_vision_image *image)
{
    size_t pixels;
    uint8_t *grey, *alpha = NULL;
    int32_t shift;

    if (!is_image(image))
        return CAIRN_BAD_ARGUMENT;
    if (is_grey(image))
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

/* ---- Writing ---- */

/* Returns the path's extension, which OpenCV uses to select the format; NULL: not that of an
 * image. */
static const char *find_extension(const char *path)
{
    static const char *const known[] = {".tif", ".tiff", ".png", ".jpg", ".jpeg", ".pgm"};
    const char *dot = strrchr(cairn_output_path_name(path), '.');

    for (size_t i = 0; dot != NULL && i < sizeof known / sizeof *known; i++)
        if (strcmp(dot, known[i]) == 0)
            return known[i];
    return NULL;
}

static cairn_status write_bytes(const char *path, const uint8_t *bytes, size_t count,
                                cairn_file_error *error)
{
    cairn_output *output;
    cairn_status status = cairn_output_open(&output, path, error);

    if (status != CAIRN_OK)
        return status;
    cairn_output_bytes(output, bytes, count);
    return cairn_output_commit(output, error);
}

cairn_status cairn_vision_write(const cairn_vision_image *image, const char *path,
                                cairn_file_error *error)
{
    const char *extension = find_extension(path);
    const cairn_vision_shim *shim;
    cairn_vision_shim_image view;
    char message[CAIRN_VISION_SHIM_MESSAGE_BYTES] = "";
    uint8_t *bytes;
    size_t count;
    cairn_status status;

    if (!is_image(image) || extension == NULL || (extension[1] == 'j' && image->sample_bytes > 1) ||
        (extension[2] == 'g' && image->channels > 1))
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "the image has no such format, expected .tif, .png, .jpg (8 bits) or .pgm (grey)");
    shim = require_shim(path, error);
    if (shim == NULL)
        return CAIRN_UNSUPPORTED;
    view.width = image->width;
    view.height = image->height;
    view.channels = image->channels;
    view.sample_bytes = image->sample_bytes;
    view.samples = image->samples;
    status = shim->encode(&view, extension, &bytes, &count, message, sizeof message);
    if (status != CAIRN_OK)
        return report_opencv_error(status, path, "an image that it can encode", message, error);
    status = write_bytes(path, bytes, count, error);
    free(bytes);
    return status;
}

/* ---- Edges ---- */

cairn_vision_canny_params cairn_vision_canny_default(void)
{
    cairn_vision_canny_params params = {.sigma = 1.4, .low = 3, .high = 8};

    return params;
}

cairn_status cairn_vision_gradients(const cairn_vision_image *grey, double sigma, float *x,
                                    float *y, const char *name, cairn_file_error *error)
{
    char message[CAIRN_VISION_SHIM_MESSAGE_BYTES] = "";
    const cairn_vision_shim *shim;
    cairn_status status;

    if (!is_grey(grey) || x == NULL || y == NULL || !(sigma >= 0) || sigma > MAX_SIGMA_PIXELS)
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, name, 0,
            "no gradients of this image, expected 8-bit grey and sigma 0 ... %d", MAX_SIGMA_PIXELS);
    shim = require_shim(name, error);
    if (shim == NULL)
        return CAIRN_UNSUPPORTED;
    status = shim->gradients(grey->samples, grey->width, grey->height, sigma, x, y, message,
                             sizeof message);
    return status == CAIRN_OK ? CAIRN_OK
                              : report_opencv_error(status, name, "gradients", message, error);
}

cairn_status cairn_vision_canny(const cairn_vision_image *grey,
                                const cairn_vision_canny_params *params, uint8_t *strengths,
                                const char *name, cairn_file_error *error)
{
    char message[CAIRN_VISION_SHIM_MESSAGE_BYTES] = "";
    const cairn_vision_shim *shim;
    cairn_status status;

    if (!is_grey(grey) || params == NULL || strengths == NULL || !(params->sigma >= 0) ||
        params->sigma > MAX_SIGMA_PIXELS || !(params->low > 0) || !(params->high >= params->low) ||
        params->high > MAX_GRADIENT)
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, name, 0,
            "no edges of this image, expected 8-bit grey, sigma 0 ... %d, 0 < low <= high <= %d",
            MAX_SIGMA_PIXELS, MAX_GRADIENT);
    shim = require_shim(name, error);
    if (shim == NULL)
        return CAIRN_UNSUPPORTED;
    status = shim->canny(grey->samples, grey->width, grey->height, params->sigma, params->low,
                         params->high, strengths, message, sizeof message);
    return status == CAIRN_OK ? CAIRN_OK
                              : report_opencv_error(status, name, "edges", message, error);
}
