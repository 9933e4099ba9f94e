/* TIFF by libtiff.
 *
 * Method
 * 1. Grey and RGB of 8 ... 16 bits a sample, with or without alpha, are read as they are stored, by
 *    tiles or strips; fewer bits than 16 are stretched to 8 or 16.
 * 2. Everything else (1 to 4 bits, palettes, inks, YCbCr, colours times alpha) is converted by libtiff into
 *    RGBA of 8 bits.
 * The picture stays as it is stored: it is turned by the caller.
 *
 * Limits: of a file with several pictures the first is read; floating-point samples and samples of
 * 32 bits are refused. */
#include "src/base/build.h"

#include "src/host/images/vision_decode.h"

#ifdef CAIRN_HAVE_TIFF
#include <tiffio.h>
#endif

/* Errors are kept apart by file since libtiff 4.5. */
#if defined(CAIRN_HAVE_TIFF) && TIFFLIB_VERSION >= 20221213

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Largest single allocation of libtiff, in bytes: a picture at the limits as RGBA. */
#define MAX_TIFF_BYTES ((tmsize_t)CAIRN_VISION_MAX_PIXELS * 4)

/* The file as libtiff reads it. */
typedef struct tiff_work {
    const cairn_vision_file *file;
    TIFF *tiff;
    uint64_t at;
    char problem[200];
    uint8_t *block; /* a strip or tile */
    uint32_t *rgba;
} tiff_work;

/* What a picture's samples are. */
typedef struct tiff_layout {
    uint32_t width, height, block_width, block_height; /* pixels */
    uint16_t bits, samples, colours, planar, photometric, format;
    int32_t has_alpha, is_tiled;
    int32_t is_multiplied; /* colours are multiplied by alpha */
} tiff_layout;

static tmsize_t on_read(thandle_t handle, void *to, tmsize_t count)
{
    tiff_work *work = handle;
    uint64_t left = work->at < work->file->count ? work->file->count - work->at : 0,
             taken = (uint64_t)count < left ? (uint64_t)count : left;

    memcpy(to, work->file->bytes + (taken > 0 ? work->at : 0), (size_t)taken);
    work->at += taken;
    return (tmsize_t)taken;
}

static tmsize_t on_write(thandle_t handle, void *from, tmsize_t count)
{
    (void)handle;
    (void)from;
    (void)count;
    return 0;
}

static toff_t on_seek(thandle_t handle, toff_t offset, int from)
{
    tiff_work *work = handle;

    work->at = from == SEEK_SET   ? offset
               : from == SEEK_CUR ? work->at + offset
                                  : work->file->count + offset;
    return work->at;
}

static int on_close(thandle_t handle)
{
    (void)handle;
    return 0;
}

static toff_t on_size(thandle_t handle)
{
    return ((tiff_work *)handle)->file->count;
}

/* Keeps the first error. */
static int on_error(TIFF *tiff, void *user, const char *module, const char *format, va_list values)
{
    tiff_work *work = user;

    (void)tiff;
    (void)module;
    if (work->problem[0] == '\0')
        (void)vsnprintf(work->problem, sizeof work->problem, format, values);
    return 1;
}

static int on_warning(TIFF *tiff, void *user, const char *module, const char *format,
                      va_list values)
{
    (void)tiff;
    (void)user;
    (void)module;
    (void)format;
    (void)values;
    return 1;
}

static cairn_status report_damage(const tiff_work *work)
{
    return cairn_file_error_set(work->file->error, CAIRN_BAD_FORMAT, work->file->path, 0,
                                "the TIFF data are damaged or cut (%s), expected a whole TIFF "
                                "image",
                                work->problem[0] != '\0' ? work->problem : "no more is known");
}

static void read_layout(tiff_layout *layout, TIFF *tiff)
{
    uint16_t extra_count = 0, *extra = NULL;

    memset(layout, 0, sizeof *layout);
    layout->photometric = PHOTOMETRIC_MINISBLACK;
    (void)TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &layout->width);
    (void)TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &layout->height);
    (void)TIFFGetFieldDefaulted(tiff, TIFFTAG_BITSPERSAMPLE, &layout->bits);
    (void)TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLESPERPIXEL, &layout->samples);
    (void)TIFFGetFieldDefaulted(tiff, TIFFTAG_PLANARCONFIG, &layout->planar);
    (void)TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLEFORMAT, &layout->format);
    (void)TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &layout->photometric);
    (void)TIFFGetFieldDefaulted(tiff, TIFFTAG_EXTRASAMPLES, &extra_count, &extra);
    layout->colours = layout->photometric == PHOTOMETRIC_RGB ? 3 : 1;
    /* A fourth sample that is not named is alpha, as most programs take it. */
    layout->has_alpha = layout->samples == layout->colours + 1 &&
                        (extra_count == 0 || extra == NULL || extra[0] != EXTRASAMPLE_UNSPECIFIED ||
                         layout->colours == 3);
    layout->is_multiplied = extra_count > 0 && extra != NULL && extra[0] == EXTRASAMPLE_ASSOCALPHA;
    layout->is_tiled = TIFFIsTiled(tiff);
    layout->block_width = layout->width;
    layout->block_height = layout->height;
    if (layout->is_tiled) {
        (void)TIFFGetField(tiff, TIFFTAG_TILEWIDTH, &layout->block_width);
        (void)TIFFGetField(tiff, TIFFTAG_TILELENGTH, &layout->block_height);
    } else {
        (void)TIFFGetFieldDefaulted(tiff, TIFFTAG_ROWSPERSTRIP, &layout->block_height);
        if (layout->block_height > layout->height)
            layout->block_height = layout->height;
    }
}

/* Returns 1 when samples are taken as they are stored. */
static int is_plain(const tiff_layout *layout)
{
    return layout->bits >= 8 && layout->bits <= 16 && layout->format == SAMPLEFORMAT_UINT &&
           layout->samples >= layout->colours && !layout->is_multiplied &&
           (layout->photometric == PHOTOMETRIC_MINISBLACK ||
            layout->photometric == PHOTOMETRIC_MINISWHITE ||
            layout->photometric == PHOTOMETRIC_RGB);
}

/* Returns a sample of a row, which is in the byte order of the machine when it has 16 bits and else
 * a stream of bits; stretched to 8 or 16 bits. */
static uint32_t sample_of(const uint8_t *row, size_t index, uint32_t bits)
{
    uint32_t value = 0;
    uint16_t deep;

    if (bits == 8)
        return row[index];
    if (bits == 16) {
        memcpy(&deep, row + 2 * index, sizeof deep);
        return deep;
    }
    for (uint32_t k = 0; k < bits; k++) {
        size_t at = index * bits + k;

        value = value << 1 | ((uint32_t)row[at / 8] >> (7 - at % 8) & 1u);
    }
    return value << (16 - bits);
}

/* Copies the samples of one block whose left upper pixel is (left, top): of a plane, or of all. */
static void copy_block(cairn_vision_image *image, const tiff_layout *layout, const uint8_t *block,
                       size_t stride, uint32_t left, uint32_t top, uint32_t plane)
{
    uint32_t is_contiguous = layout->planar == PLANARCONFIG_CONTIG,
             step = is_contiguous ? layout->samples : 1u,
             most = image->sample_bytes == 1 ? 255 : 65535;

    for (uint32_t y = 0; y < layout->block_height && top + y < layout->height; y++)
        for (uint32_t x = 0; x < layout->block_width && left + x < layout->width; x++)
            for (uint32_t k = is_contiguous ? 0 : plane;
                 k < (is_contiguous ? (uint32_t)layout->colours + (uint32_t)layout->has_alpha
                                    : plane + 1);
                 k++) {
                uint32_t value = sample_of(
                    block + y * stride, (size_t)x * step + (is_contiguous ? k : 0), layout->bits);
                size_t at =
                    ((size_t)(top + y) * layout->width + left + x) * (size_t)image->channels;
                /* Grey fills all channels; alpha, which follows it, replaces the fourth. */
                uint32_t first = k == layout->colours   ? 3
                                 : layout->colours == 3 ? 2 - k
                                                        : 0,
                         last = first == 0 && layout->colours == 1 ? (uint32_t)image->channels - 1
                                                                   : first;

                value = layout->photometric == PHOTOMETRIC_MINISWHITE && k < layout->colours
                            ? most - value
                            : value;
                for (uint32_t c = first; c <= last; c++)
                    if (image->sample_bytes == 1)
                        ((uint8_t *)image->samples)[at + c] = (uint8_t)value;
                    else
                        ((uint16_t *)image->samples)[at + c] = (uint16_t)value;
            }
}

/* Reads the strips or tiles. */
static cairn_status read_plain(cairn_vision_image *image, const tiff_layout *layout,
                               tiff_work *work)
{
    uint32_t planes = layout->planar == PLANARCONFIG_CONTIG
                          ? 1
                          : (uint32_t)layout->colours + (uint32_t)layout->has_alpha;
    tmsize_t bytes = layout->is_tiled ? TIFFTileSize(work->tiff) : TIFFStripSize(work->tiff),
             stride = layout->is_tiled ? TIFFTileRowSize(work->tiff) : TIFFScanlineSize(work->tiff);
    cairn_status status = cairn_vision_allocate(image, layout->width, layout->height,
                                                layout->has_alpha      ? 4
                                                : layout->colours == 3 ? 3
                                                                       : 1,
                                                layout->bits == 8 ? 1 : 2, work->file);

    if (status != CAIRN_OK)
        return status;
    if (bytes <= 0 || stride <= 0 || bytes > MAX_TIFF_BYTES * 2 || layout->block_width == 0 ||
        layout->block_height == 0 || bytes / stride < (tmsize_t)layout->block_height)
        return report_damage(work);
    work->block = malloc((size_t)bytes);
    if (work->block == NULL)
        return cairn_file_error_system(work->file->error, work->file->path, "read", ENOMEM);
    for (uint32_t plane = 0; plane < planes; plane++)
        for (uint32_t top = 0; top < layout->height; top += layout->block_height)
            for (uint32_t left = 0; left < layout->width; left += layout->block_width) {
                tmsize_t got;

                if (layout->is_tiled) {
                    got = TIFFReadTile(work->tiff, work->block, left, top, 0, (uint16_t)plane);
                } else {
                    got = TIFFReadEncodedStrip(work->tiff,
                                               TIFFComputeStrip(work->tiff, top, (uint16_t)plane),
                                               work->block, bytes);
                    got = got > 0 && got / stride < (tmsize_t)(layout->height - top) &&
                                  got / stride < (tmsize_t)layout->block_height
                              ? -1
                              : got;
                }
                if (got <= 0)
                    return report_damage(work);
                copy_block(image, layout, work->block, (size_t)stride, left, top, plane);
            }
    return CAIRN_OK;
}

/* Converts by libtiff, whose colours are multiplied by alpha. */
static cairn_status read_converted(cairn_vision_image *image, const tiff_layout *layout,
                                   tiff_work *work)
{
    size_t pixels = (size_t)layout->width * (size_t)layout->height;
    int32_t is_grey = layout->photometric == PHOTOMETRIC_MINISBLACK ||
                      layout->photometric == PHOTOMETRIC_MINISWHITE,
            is_opaque = 1;
    char why[1024] = "";
    uint8_t *to;
    cairn_status status;

    if (TIFFRGBAImageOK(work->tiff, why) == 0)
        return cairn_file_error_set(work->file->error, CAIRN_UNSUPPORTED, work->file->path, 0,
                                    "%s, expected a TIFF image of unsigned samples of 1 to 16 bits",
                                    why);
    work->rgba = calloc(pixels, sizeof *work->rgba);
    if (work->rgba == NULL)
        return cairn_file_error_system(work->file->error, work->file->path, "read", ENOMEM);
    if (TIFFReadRGBAImageOriented(work->tiff, layout->width, layout->height, work->rgba,
                                  ORIENTATION_TOPLEFT, 1) == 0)
        return report_damage(work);
    for (size_t i = 0; i < pixels && is_opaque; i++)
        is_opaque = TIFFGetA(work->rgba[i]) == 255;
    status = cairn_vision_allocate(image, layout->width, layout->height,
                                   !is_opaque ? 4
                                   : is_grey  ? 1
                                              : 3,
                                   1, work->file);
    if (status != CAIRN_OK)
        return status;
    to = image->samples;
    for (size_t i = 0; i < pixels; i++, to += image->channels) {
        uint32_t pixel = work->rgba[i], alpha = TIFFGetA(pixel),
                 colours[3] = {TIFFGetB(pixel), TIFFGetG(pixel), TIFFGetR(pixel)};

        for (int32_t k = 0; k < image->channels && k < 3; k++)
            to[k] = (uint8_t)(alpha == 0            ? 0
                              : colours[k] >= alpha ? 255
                                                    : (255 * colours[k] + alpha / 2) / alpha);
        if (image->channels == 4)
            to[3] = (uint8_t)alpha;
    }
    return CAIRN_OK;
}

static cairn_status read_first(cairn_vision_image *image, tiff_work *work)
{
    tiff_layout layout;

    read_layout(&layout, work->tiff);
    if (layout.format != SAMPLEFORMAT_UINT || layout.bits > 16)
        return cairn_file_error_set(
            work->file->error, CAIRN_UNSUPPORTED, work->file->path, 0,
            "samples of %d bits%s, expected unsigned integers of 1 to 16 bits", (int)layout.bits,
            layout.format == SAMPLEFORMAT_IEEEFP ? ", floating-point"
            : layout.format == SAMPLEFORMAT_INT  ? ", signed"
                                                 : "");
    if ((int64_t)layout.width * (int64_t)layout.height > CAIRN_VISION_MAX_PIXELS)
        return report_damage(work);
    /* The caller turns the picture. */
    (void)TIFFSetField(work->tiff, TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
    return is_plain(&layout) ? read_plain(image, &layout, work)
                             : read_converted(image, &layout, work);
}

cairn_status cairn_vision_decode_tiff(cairn_vision_image *image, const cairn_vision_file *file)
{
    tiff_work work = {.file = file};
    TIFFOpenOptions *options = TIFFOpenOptionsAlloc();
    cairn_status status;

    if (options == NULL)
        return cairn_file_error_system(file->error, file->path, "read", ENOMEM);
    TIFFOpenOptionsSetMaxSingleMemAlloc(options, MAX_TIFF_BYTES * 2);
    TIFFOpenOptionsSetErrorHandlerExtR(options, on_error, &work);
    TIFFOpenOptionsSetWarningHandlerExtR(options, on_warning, NULL);
    work.tiff = TIFFClientOpenExt(file->path, "rm", &work, on_read, on_write, on_seek, on_close,
                                  on_size, NULL, NULL, options);
    TIFFOpenOptionsFree(options);
    status = work.tiff != NULL ? read_first(image, &work) : report_damage(&work);
    if (work.tiff != NULL)
        TIFFClose(work.tiff);
    free(work.block);
    free(work.rgba);
    return status;
}

#else

cairn_status cairn_vision_decode_tiff(cairn_vision_image *image, const cairn_vision_file *file)
{
    (void)image;
    return cairn_file_error_set(
        file->error, CAIRN_UNSUPPORTED, file->path, 0,
        "is a TIFF image: this build has no libtiff (4.5 or newer), expected "
        "another format, or a build from the sources with libtiff "
        "(tools/deps.sh build)");
}

#endif
