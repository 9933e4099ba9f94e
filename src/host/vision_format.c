/* Formats and sizes of images from their first bytes, so that a giant or a cut one is refused
 * before a decoder sees it. */
#include "src/core/build.h"

#include <string.h>

#include "src/host/vision_format.h"

typedef struct byte_reader {
    const uint8_t *bytes;
    size_t count;
    int little; /* the lowest byte first */
} byte_reader;

/* `width` bytes from `at` on; -1 beyond the end. */
static int64_t number_at(const byte_reader *r, uint64_t at, int width)
{
    int64_t value = 0;

    if (at > r->count || r->count - at < (size_t)width)
        return -1;
    for (int i = 0; i < width; i++)
        value = value << 8 | r->bytes[at + (size_t)(r->little ? width - 1 - i : i)];
    return value;
}

static cairn_status cut(const char *path, const char *what, cairn_file_error *error)
{
    return cairn_file_error_set(error, CAIRN_TRUNCATED, path, 0,
                                "the file ends early, expected a whole %s", what);
}

/* Chunks of a length, a name, data and a sum, from IHDR to IEND. */
static cairn_status read_png(cairn_vision_head *head, const byte_reader *r, const char *path,
                             cairn_file_error *error)
{
    uint64_t at = 8;

    head->width = number_at(r, 16, 4);
    head->height = number_at(r, 20, 4);
    for (;;) {
        int64_t length = number_at(r, at, 4);

        if (length < 0 || number_at(r, at + (uint64_t)length + 8, 4) < 0)
            return cut(path, "PNG image", error);
        if (memcmp(r->bytes + at + 4, "IEND", 4) == 0)
            return CAIRN_OK;
        at += (uint64_t)length + 12;
    }
}

/* Whether a marker begins a frame, which says the size: SOF0 ... SOF15 but DHT, JPG and DAC. */
static int begins_frame(int64_t marker)
{
    return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
}

/* Segments of a marker and a length up to the scan, then the marker of the end. */
static cairn_status read_jpeg(cairn_vision_head *head, const byte_reader *r, const char *path,
                              cairn_file_error *error)
{
    uint64_t at = 2;

    for (;;) {
        int64_t marker, length;

        while (number_at(r, at, 2) == 0xFFFF)
            at++;
        marker = number_at(r, at + 1, 1);
        length = number_at(r, at + 2, 2);
        if (length < 2 || number_at(r, at, 1) != 0xFF)
            return cut(path, "JPEG image", error);
        if (begins_frame(marker)) {
            head->height = number_at(r, at + 5, 2);
            head->width = number_at(r, at + 7, 2);
        }
        if (marker == 0xDA)
            break;
        at += (uint64_t)length + 2;
    }
    while (number_at(r, at, 2) >= 0)
        if (number_at(r, at++, 2) == 0xFFD9)
            return CAIRN_OK;
    return cut(path, "JPEG image", error);
}

/* The first directory: entries of tag, type, count and value. */
static cairn_status read_tiff(cairn_vision_head *head, const byte_reader *r, const char *path,
                              cairn_file_error *error)
{
    enum { WIDTH = 256, HEIGHT = 257, IS_SHORT = 3 };
    uint64_t at = (uint64_t)(number_at(r, 4, 4) > 0 ? number_at(r, 4, 4) : 0);
    int64_t entries = number_at(r, at, 2);

    if (at < 8 || entries < 0 || number_at(r, at + 2 + 12 * (uint64_t)entries, 4) < 0)
        return cut(path, "TIFF image", error);
    for (at += 2; entries-- > 0; at += 12) {
        int64_t tag = number_at(r, at, 2),
                value = number_at(r, at + 8, number_at(r, at + 2, 2) == IS_SHORT ? 2 : 4);

        if (tag == WIDTH)
            head->width = value;
        if (tag == HEIGHT)
            head->height = value;
    }
    return CAIRN_OK;
}

static int is_space(uint8_t c)
{
    return c == ' ' || (c >= '\t' && c <= '\r');
}

/* The next number of a PNM's head; -1: there is none. */
static int64_t pnm_number(const byte_reader *r, size_t *at)
{
    int64_t value = 0;
    size_t start;

    while (*at < r->count && (is_space(r->bytes[*at]) || r->bytes[*at] == '#')) {
        if (r->bytes[*at] == '#')
            while (*at + 1 < r->count && r->bytes[*at + 1] != '\n')
                ++*at;
        ++*at;
    }
    for (start = *at; *at < r->count && r->bytes[*at] >= '0' && r->bytes[*at] <= '9'; ++*at)
        if (value < INT32_MAX)
            value = value * 10 + (r->bytes[*at] - '0');
    return *at > start ? value : -1;
}

static cairn_status read_pnm(cairn_vision_head *head, const byte_reader *r, const char *path,
                             cairn_file_error *error)
{
    size_t at = 2;

    head->width = pnm_number(r, &at);
    head->height = pnm_number(r, &at);
    if (head->width < 0 || head->height < 0)
        return at >= r->count ? cut(path, "PGM image", error)
                              : cairn_file_error_set(error, CAIRN_BAD_FORMAT, path, 0,
                                                     "byte 0x%02x, expected the size of the image",
                                                     r->bytes[at]);
    return CAIRN_OK;
}

cairn_status cairn_vision_head_read(cairn_vision_head *head, const uint8_t *bytes, size_t count,
                                    const char *path, cairn_file_error *error)
{
    byte_reader r = {bytes, count, 0};
    cairn_status status;

    memset(head, 0, sizeof *head);
    if (count < 8)
        return cairn_file_error_set(error, CAIRN_TRUNCATED, path, 0,
                                    "the file has %zu bytes, expected an image", count);
    if (memcmp(bytes, "\x89PNG\r\n\x1A\n", 8) == 0) {
        head->format = CAIRN_VISION_PNG;
        status = read_png(head, &r, path, error);
    } else if (bytes[0] == 0xFF && bytes[1] == 0xD8) {
        head->format = CAIRN_VISION_JPEG;
        status = read_jpeg(head, &r, path, error);
    } else if (memcmp(bytes, "II*\0", 4) == 0 || memcmp(bytes, "MM\0*", 4) == 0) {
        r.little = bytes[0] == 'I';
        head->format = CAIRN_VISION_TIFF;
        status = read_tiff(head, &r, path, error);
    } else if (bytes[0] == 'P' && bytes[1] >= '2' && bytes[1] <= '6' && bytes[1] != '4') {
        head->format = CAIRN_VISION_PNM;
        status = read_pnm(head, &r, path, error);
    } else {
        status = cairn_file_error_set(
            error, CAIRN_BAD_FORMAT, path, 0,
            "begins with the bytes 0x%02x%02x, expected a TIFF, PNG, JPEG or PGM image", bytes[0],
            bytes[1]);
    }
    if (status == CAIRN_OK && (head->width < 1 || head->height < 1))
        status = cairn_file_error_set(error, CAIRN_BAD_FORMAT, path, 0,
                                      "the image has %lld x %lld pixels, expected some",
                                      (long long)head->width, (long long)head->height);
    return status;
}
