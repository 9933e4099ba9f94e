/* Images and edges through OpenCV, which is loaded when it is first needed.
 *
 * Method: a file is read whole, its head tells whether the image is one and of what size, then the
 * shim decodes it from memory: so a giant or cut file never comes to a decoder, and errors of the
 * system are told as such.
 *
 * Limits: decoders of JPEG keep what can be seen of a damaged one; only where its end is missing
 * it is refused. */
#include "src/core/build.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "cairn/vision.h"
#include "src/host/map_file_image.h"
#include "src/host/shim.h"
#include "src/host/vision_format.h"
#include "src/host/vision_shim.h"

#define LIBRARY "libcairn-vision.so"
/* Files beyond this are no image of CAIRN_VISION_PIXELS_MOST. */
#define FILE_BYTES_MOST ((int64_t)CAIRN_VISION_PIXELS_MOST * 8 + (1 << 20))
#define SIGMA_MOST      50
#define SLOPE_MOST      1000

/* ---- The library ---- */

static const cairn_vision_shim *find_shim(void)
{
    return cairn_shim_find(LIBRARY, "CAIRN_VISION", "cairn_vision_shim_table",
                           CAIRN_VISION_SHIM_VERSION);
}

static const cairn_vision_shim *need_shim(const char *path, cairn_file_error *error)
{
    const cairn_vision_shim *shim = find_shim();

    if (shim == NULL)
        (void)cairn_file_error_set(error, CAIRN_UNSUPPORTED, path, 0,
                                   "image reading needs " LIBRARY
                                   " of this version, expected it beside the program "
                                   "(built by `make vision`, OpenCV 4: tools/deps.sh vision)");
    return shim;
}

cairn_status cairn_vision_load(cairn_file_error *error)
{
    return need_shim(LIBRARY, error) != NULL ? CAIRN_OK : CAIRN_UNSUPPORTED;
}

/* What OpenCV says. */
static cairn_status refused(cairn_status status, const char *path, const char *what,
                            const char *words, cairn_file_error *error)
{
    return cairn_file_error_set(error, status, path, 0, "OpenCV: %s, expected %s", words, what);
}

/* ---- Reading ---- */

static cairn_status read_open_file(FILE *file, const char *path, uint8_t **bytes, size_t *count,
                                   cairn_file_error *error)
{
    struct stat about;
    cairn_status status = CAIRN_OK;

    if (fstat(fileno(file), &about) != 0)
        return cairn_file_error_system(error, path, "read", errno);
    if (!S_ISREG(about.st_mode))
        return cairn_file_error_set(error, CAIRN_UNSUPPORTED, path, 0,
                                    "a folder, pipe or device, expected an image file");
    if (about.st_size > FILE_BYTES_MOST)
        return cairn_file_error_set(error, CAIRN_FULL, path, 0,
                                    "%lld bytes, expected an image of at most %lld",
                                    (long long)about.st_size, (long long)FILE_BYTES_MOST);
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
    FILE *file = fopen(path, "rb");
    cairn_status status;

    *bytes = NULL;
    *count = 0;
    if (file == NULL)
        return cairn_file_error_system(error, path, "open", errno);
    status = read_open_file(file, path, bytes, count, error);
    (void)fclose(file);
    return status;
}

/* PGM and PNG without OpenCV. */
static cairn_status read_without(cairn_vision_image *image, const char *path,
                                 cairn_file_error *error)
{
    cairn_image plain;
    cairn_status status = cairn_image_read(&plain, path, error);

    if (status != CAIRN_OK)
        return status;
    image->width = plain.width;
    image->height = plain.height;
    image->channels = image->sample_bytes = 1;
    image->samples = plain.pixel;
    plain.pixel = NULL;
    cairn_image_free(&plain);
    return CAIRN_OK;
}

static cairn_status decode(cairn_vision_image *image, const uint8_t *bytes, size_t count,
                           const char *path, cairn_file_error *error)
{
    const cairn_vision_shim *shim;
    cairn_vision_shim_image decoded;
    char words[CAIRN_VISION_SHIM_WORDS] = "";
    cairn_vision_head head;
    cairn_status status = cairn_vision_head_read(&head, bytes, count, path, error);

    if (status != CAIRN_OK)
        return status;
    if (head.width > CAIRN_VISION_SIDE_MOST || head.height > CAIRN_VISION_SIDE_MOST ||
        head.width * head.height > CAIRN_VISION_PIXELS_MOST)
        return cairn_file_error_set(
            error, CAIRN_FULL, path, 0,
            "the image has %lld x %lld pixels, expected at most %d a side and %d in all",
            (long long)head.width, (long long)head.height, CAIRN_VISION_SIDE_MOST,
            CAIRN_VISION_PIXELS_MOST);
    shim = find_shim();
    if (shim == NULL && (head.format == CAIRN_VISION_PNG || head.format == CAIRN_VISION_PNM))
        return read_without(image, path, error);
    if (shim == NULL)
        return need_shim(path, error) == NULL ? CAIRN_UNSUPPORTED : CAIRN_OK;
    status = shim->decode(bytes, count, &decoded, words, sizeof words);
    if (status != CAIRN_OK)
        return refused(status, path, "a whole image of 8 or 16 bits", words, error);
    image->width = decoded.width;
    image->height = decoded.height;
    image->channels = decoded.channels;
    image->sample_bytes = decoded.sample_bytes;
    image->samples = decoded.samples;
    return CAIRN_OK;
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
           image->width <= CAIRN_VISION_SIDE_MOST && image->height <= CAIRN_VISION_SIDE_MOST &&
           (image->channels == 1 || image->channels == 3 || image->channels == 4) &&
           (image->sample_bytes == 1 || image->sample_bytes == 2);
}

static int is_grey(const cairn_vision_image *image)
{
    return is_image(image) && image->channels == 1 && image->sample_bytes == 1;
}

static uint32_t sample_of(const cairn_vision_image *image, size_t index)
{
    return image->sample_bytes == 1 ? ((const uint8_t *)image->samples)[index]
                                    : ((const uint16_t *)image->samples)[index];
}

cairn_status cairn_vision_make_grey(cairn_vision_image *image)
{
    size_t pixels;
    uint8_t *grey;

    if (!is_image(image))
        return CAIRN_BAD_ARGUMENT;
    if (is_grey(image))
        return CAIRN_OK;
    pixels = (size_t)image->width * (size_t)image->height;
    grey = malloc(pixels);
    if (grey == NULL)
        return CAIRN_NO_MEMORY;
    for (size_t i = 0; i < pixels; i++) {
        size_t at = i * (size_t)image->channels;
        uint32_t value = sample_of(image, at);

        if (image->channels > 1)
            value = (114 * value + 587 * sample_of(image, at + 1) + 299 * sample_of(image, at + 2) +
                     500) /
                    1000;
        grey[i] = (uint8_t)(image->sample_bytes == 1 ? value : value >> 8);
    }
    free(image->samples);
    image->samples = grey;
    image->channels = image->sample_bytes = 1;
    return CAIRN_OK;
}

/* ---- Writing ---- */

/* The ending as OpenCV takes it; NULL: no image's. */
static const char *ending_of(const char *path)
{
    static const char *const known[] = {".tif", ".tiff", ".png", ".jpg", ".jpeg", ".pgm"};
    const char *dot = strrchr(cairn_path_name(path), '.');

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
    const char *ending = ending_of(path);
    const cairn_vision_shim *shim;
    cairn_vision_shim_image shown;
    char words[CAIRN_VISION_SHIM_WORDS] = "";
    uint8_t *bytes;
    size_t count;
    cairn_status status;

    if (!is_image(image) || ending == NULL || (ending[1] == 'j' && image->sample_bytes > 1) ||
        (ending[2] == 'g' && image->channels > 1))
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "not an image of this ending, expected .tif, .png, .jpg (8 bits) or .pgm (grey)");
    shim = need_shim(path, error);
    if (shim == NULL)
        return CAIRN_UNSUPPORTED;
    shown.width = image->width;
    shown.height = image->height;
    shown.channels = image->channels;
    shown.sample_bytes = image->sample_bytes;
    shown.samples = image->samples;
    status = shim->encode(&shown, ending, &bytes, &count, words, sizeof words);
    if (status != CAIRN_OK)
        return refused(status, path, "an image that it can encode", words, error);
    status = write_bytes(path, bytes, count, error);
    free(bytes);
    return status;
}

/* ---- Edges ---- */

cairn_vision_canny_params cairn_vision_canny_default(void)
{
    cairn_vision_canny_params params = {1.4, 3, 8};

    return params;
}

cairn_status cairn_vision_gradients(const cairn_vision_image *grey, double sigma, float *x,
                                    float *y, const char *name, cairn_file_error *error)
{
    char words[CAIRN_VISION_SHIM_WORDS] = "";
    const cairn_vision_shim *shim;
    cairn_status status;

    if (!is_grey(grey) || x == NULL || y == NULL || !(sigma >= 0) || sigma > SIGMA_MOST)
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, name, 0,
            "not to be differentiated, expected 8-bit grey and sigma 0 ... %d", SIGMA_MOST);
    shim = need_shim(name, error);
    if (shim == NULL)
        return CAIRN_UNSUPPORTED;
    status =
        shim->gradients(grey->samples, grey->width, grey->height, sigma, x, y, words, sizeof words);
    return status == CAIRN_OK ? CAIRN_OK : refused(status, name, "gradients", words, error);
}

cairn_status cairn_vision_canny(const cairn_vision_image *grey,
                                const cairn_vision_canny_params *params, uint8_t *strengths,
                                const char *name, cairn_file_error *error)
{
    char words[CAIRN_VISION_SHIM_WORDS] = "";
    const cairn_vision_shim *shim;
    cairn_status status;

    if (!is_grey(grey) || params == NULL || strengths == NULL || !(params->sigma >= 0) ||
        params->sigma > SIGMA_MOST || !(params->low > 0) || !(params->high >= params->low) ||
        params->high > SLOPE_MOST)
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, name, 0,
            "no edges of it, expected 8-bit grey, sigma 0 ... %d, 0 < low <= high <= %d",
            SIGMA_MOST, SLOPE_MOST);
    shim = need_shim(name, error);
    if (shim == NULL)
        return CAIRN_UNSUPPORTED;
    status = shim->canny(grey->samples, grey->width, grey->height, params->sigma, params->low,
                         params->high, strengths, words, sizeof words);
    return status == CAIRN_OK ? CAIRN_OK : refused(status, name, "edges", words, error);
}
