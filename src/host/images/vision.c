/* Image input, and output, gradients and edges by OpenCV, which is loaded on first use.
 *
 * Method
 * 1. A file is read into memory, and its header gives format, size and orientation.
 * 2. The decoder of the format decodes it from memory. An oversized or truncated file never reaches
 *    a decoder, and errors of the system are reported as such.
 * 3. The picture is turned as its header says. */
#include "src/base/build.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "cairn/output.h"
#include "cairn/vision.h"
#include "src/host/base/regular_file.h"
#include "src/host/images/shim.h"
#include "src/host/images/vision_decode.h"
#include "src/host/images/vision_format.h"
#include "src/host/images/vision_plugin.h"

#define PLUGIN_NAME "libcairn-vision.so"
/* Largest accepted file in bytes: CAIRN_VISION_MAX_PIXELS pixels of four 16-bit samples, and
 * metadata. */
#define MAX_FILE_BYTES ((int64_t)CAIRN_VISION_MAX_PIXELS * 8 + (1 << 20))

/* ---- The library ---- */

const cairn_vision_shim *cairn_vision_require(const char *path, cairn_file_error *error)
{
    const cairn_vision_shim *shim = cairn_shim_find(
        PLUGIN_NAME, "CAIRN_VISION", "cairn_vision_shim_table", CAIRN_VISION_SHIM_VERSION);

    if (shim == NULL)
        (void)cairn_file_error_set(error, CAIRN_UNSUPPORTED, path, 0,
                                   "edges and the writing of images need " PLUGIN_NAME
                                   " of this version, expected it beside the program "
                                   "(built by `make vision`, OpenCV 4: tools/deps.sh vision)");
    return shim;
}

cairn_status cairn_vision_load(cairn_file_error *error)
{
    return cairn_vision_require(PLUGIN_NAME, error) != NULL ? CAIRN_OK : CAIRN_UNSUPPORTED;
}

cairn_status cairn_vision_report(cairn_status status, const char *path, const char *what,
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

/* Decodes an image from memory after a check of its header. On failure the image is to be freed. */
static cairn_status decode(cairn_vision_image *image, const cairn_vision_file *file)
{
    static cairn_status (*const decoders[])(cairn_vision_image *, const cairn_vision_file *) = {
        [CAIRN_VISION_TIFF] = cairn_vision_decode_tiff,
        [CAIRN_VISION_PNG] = cairn_vision_decode_png,
        [CAIRN_VISION_JPEG] = cairn_vision_decode_jpeg,
        [CAIRN_VISION_PNM] = cairn_vision_decode_pnm};
    cairn_vision_header header;
    cairn_status status =
        cairn_vision_header_read(&header, file->bytes, file->count, file->path, file->error);

    if (status != CAIRN_OK)
        return status;
    if (header.width > CAIRN_VISION_MAX_SIDE || header.height > CAIRN_VISION_MAX_SIDE ||
        header.width * header.height > CAIRN_VISION_MAX_PIXELS)
        return cairn_file_error_set(
            file->error, CAIRN_FULL, file->path, 0,
            "the image has %lld x %lld pixels, expected at most %d a side and %d in all",
            (long long)header.width, (long long)header.height, CAIRN_VISION_MAX_SIDE,
            CAIRN_VISION_MAX_PIXELS);
    status = decoders[header.format](image, file);
    if (status != CAIRN_OK)
        return status;
    if (image->width != header.width || image->height != header.height)
        return cairn_file_error_set(file->error, CAIRN_BAD_FORMAT, file->path, 0,
                                    "decoded to %d x %d pixels, expected %lld x %lld as in the "
                                    "header",
                                    (int)image->width, (int)image->height, (long long)header.width,
                                    (long long)header.height);
    return orient(image, header.orientation)
               ? CAIRN_OK
               : cairn_file_error_system(file->error, file->path, "read", ENOMEM);
}

cairn_status cairn_vision_read(cairn_vision_image *image, const char *path, cairn_file_error *error)
{
    uint8_t *bytes;
    size_t count;
    cairn_status status;

    memset(image, 0, sizeof *image);
    status = read_file(path, &bytes, &count, error);
    if (status == CAIRN_OK) {
        cairn_vision_file file = {bytes, count, path, error};

        status = decode(image, &file);
    }
    free(bytes);
    if (status != CAIRN_OK)
        cairn_vision_free(image);
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

    if (!cairn_vision_is_image(image) || extension == NULL ||
        (extension[1] == 'j' && image->sample_bytes > 1) ||
        (extension[2] == 'g' && image->channels > 1))
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "the image has no such format, expected .tif, .png, .jpg (8 bits) or .pgm (grey)");
    shim = cairn_vision_require(path, error);
    if (shim == NULL)
        return CAIRN_UNSUPPORTED;
    view.width = image->width;
    view.height = image->height;
    view.channels = image->channels;
    view.sample_bytes = image->sample_bytes;
    view.samples = image->samples;
    status = shim->encode(&view, extension, &bytes, &count, message, sizeof message);
    if (status != CAIRN_OK)
        return cairn_vision_report(status, path, "an image that it can encode", message, error);
    status = write_bytes(path, bytes, count, error);
    free(bytes);
    return status;
}
