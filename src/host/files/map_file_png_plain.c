/* PNG without libpng: written by zlib alone, with unfiltered rows; reading is refused. It takes the
 * place of map_file_png.c where libpng is missing. */
#include "src/base/build.h"

#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "src/host/files/map_file_image.h"

/* Bytes of the signature, the header chunk and the end chunk, and of an empty chunk. */
enum { SIGNATURE_BYTES = 8, CHUNK_BYTES = 12, HEADER_BYTES = 13 };

cairn_status cairn_png_decode(cairn_png_samples *image, const cairn_png_source *source,
                              int32_t is_picture)
{
    (void)image;
    (void)is_picture;
    return cairn_file_error_set(source->error, CAIRN_UNSUPPORTED, source->path, 0,
                                "is a PNG image: this program was built without libpng, "
                                "expected a PGM image");
}

/* Writes the 4 bytes of an integer, the highest first. */
static void put_word(uint8_t *at, uint32_t word)
{
    for (int k = 0; k < 4; k++)
        at[k] = (uint8_t)(word >> (24 - 8 * k));
}

/* Completes a chunk whose `count` bytes of data are at `at` + 8: length, type and checksum. Returns
 * the end of the chunk. */
static uint8_t *end_chunk(uint8_t *at, const char *type, uint32_t count)
{
    put_word(at, count);
    memcpy(at + 4, type, 4);
    put_word(at + 8 + count, (uint32_t)crc32(0, at + 4, (uInt)(count + 4)));
    return at + CHUNK_BYTES + count;
}

/* Returns the rows, each behind a zero byte for "no filter", on the heap. */
static uint8_t *filtered_rows(const uint8_t *pixel, size_t stride, size_t height)
{
    uint8_t *rows = malloc((stride + 1) * height);

    for (size_t y = 0; y < height && rows != NULL; y++) {
        rows[y * (stride + 1)] = 0;
        memcpy(rows + y * (stride + 1) + 1, pixel + y * stride, stride);
    }
    return rows;
}

cairn_status cairn_image_encode_png(uint8_t **bytes, size_t *count, const uint8_t *pixel,
                                    int32_t width, int32_t height, int32_t channels)
{
    static const uint8_t signature[SIGNATURE_BYTES] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
    size_t stride = (size_t)width * (size_t)channels, raw = (stride + 1) * (size_t)height;
    uint8_t *rows, *at;
    uLongf packed;

    *bytes = NULL;
    *count = 0;
    /* zlib counts in unsigned long and the format in 31 bits. */
    if (width < 1 || height < 1 || raw > INT32_MAX / 2)
        return CAIRN_NO_MEMORY;
    packed = compressBound((uLong)raw);
    rows = filtered_rows(pixel, stride, (size_t)height);
    *bytes = malloc(SIGNATURE_BYTES + 3 * CHUNK_BYTES + HEADER_BYTES + packed);
    if (rows == NULL || *bytes == NULL) {
        free(rows);
        free(*bytes);
        *bytes = NULL;
        return CAIRN_NO_MEMORY;
    }
    memcpy(*bytes, signature, SIGNATURE_BYTES);
    at = *bytes + SIGNATURE_BYTES;
    put_word(at + 8, (uint32_t)width);
    put_word(at + 12, (uint32_t)height);
    at[16] = 8;                                                    /* bits of a sample */
    at[17] = (uint8_t)(channels == 1 ? 0 : channels == 3 ? 2 : 6); /* colour type */
    memset(at + 18, 0, 3); /* deflate, filters by row, no interlace */
    at = end_chunk(at, "IHDR", HEADER_BYTES);
    if (compress2(at + 8, &packed, rows, (uLong)raw, Z_DEFAULT_COMPRESSION) != Z_OK) {
        free(rows);
        free(*bytes);
        *bytes = NULL;
        return CAIRN_NO_MEMORY;
    }
    free(rows);
    at = end_chunk(at, "IDAT", (uint32_t)packed);
    at = end_chunk(at, "IEND", 0);
    *count = (size_t)(at - *bytes);
    return CAIRN_OK;
}
