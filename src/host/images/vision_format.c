/* Image formats and sizes from file headers, so that an oversized or truncated image is refused
 * before a decoder reads it. */
#include "src/base/build.h"

#include <string.h>

#include "src/host/images/vision_format.h"

/* Tags and types of TIFF. */
enum { TAG_WIDTH = 256, TAG_HEIGHT = 257, TAG_ORIENTATION = 274, TYPE_SHORT = 3, TYPE_LONG = 4 };

/* A file in memory. */
typedef struct byte_reader {
    const uint8_t *bytes;
    size_t count;
    int little_endian; /* 1: little-endian */
} byte_reader;

/* Returns the unsigned integer of `width` bytes at offset `at`; -1 beyond the end. */
static int64_t read_unsigned(const byte_reader *reader, uint64_t at, int width)
{
    int64_t value = 0;

    if (at > reader->count || reader->count - at < (size_t)width)
        return -1;
    for (int i = 0; i < width; i++)
        value =
            value << 8 | reader->bytes[at + (size_t)(reader->little_endian ? width - 1 - i : i)];
    return value;
}

static cairn_status report_truncated(const char *path, const char *what, cairn_file_error *error)
{
    return cairn_file_error_set(error, CAIRN_TRUNCATED, path, 0,
                                "the file ends early, expected a whole %s", what);
}

/* Returns the orientation of EXIF data, a TIFF without a picture; 1 when it has none. */
static int32_t read_orientation(const uint8_t *bytes, size_t count)
{
    byte_reader inner = {.bytes = bytes, .count = count};
    int64_t entry, entries, value;

    inner.little_endian = count > 0 && bytes[0] == 'I';
    entry = read_unsigned(&inner, 4, 4);
    entries = entry >= 0 ? read_unsigned(&inner, (uint64_t)entry, 2) : -1;
    for (entry += 2; entries-- > 0; entry += 12) {
        if (read_unsigned(&inner, (uint64_t)entry, 2) != TAG_ORIENTATION ||
            read_unsigned(&inner, (uint64_t)entry + 2, 2) != TYPE_SHORT)
            continue;
        value = read_unsigned(&inner, (uint64_t)entry + 8, 2);
        return value >= 1 && value <= 8 ? (int32_t)value : 1;
    }
    return 1;
}

/* Reads the size from IHDR and follows the chunks (length, name, data, CRC) to IEND. */
static cairn_status read_png(cairn_vision_header *header, const byte_reader *reader,
                             const char *path, cairn_file_error *error)
{
    uint64_t at = 8;

    header->width = read_unsigned(reader, 16, 4);
    header->height = read_unsigned(reader, 20, 4);
    for (;;) {
        int64_t length = read_unsigned(reader, at, 4);

        if (length < 0 || read_unsigned(reader, at + (uint64_t)length + 8, 4) < 0)
            return report_truncated(path, "PNG image", error);
        if (memcmp(reader->bytes + at + 4, "IEND", 4) == 0)
            return CAIRN_OK;
        if (memcmp(reader->bytes + at + 4, "eXIf", 4) == 0)
            header->orientation = read_orientation(reader->bytes + at + 8, (size_t)length);
        at += (uint64_t)length + 12;
    }
}

/* Returns 1 for a start-of-frame marker, whose segment has the size: SOF0 ... SOF15 except DHT, JPG
 * and DAC. */
static int is_start_of_frame(int64_t marker)
{
    return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
}

/* Follows the segments (marker, length) to the start of scan, then finds the end-of-image
 * marker. */
static cairn_status read_jpeg(cairn_vision_header *header, const byte_reader *reader,
                              const char *path, cairn_file_error *error)
{
    uint64_t at = 2;

    for (;;) {
        int64_t marker, length;

        while (read_unsigned(reader, at, 2) == 0xFFFF)
            at++;
        marker = read_unsigned(reader, at + 1, 1);
        /* Markers without a length, which belong into the data of a scan alone. */
        if (marker >= 0 && (marker <= 0x01 || (marker >= 0xD0 && marker <= 0xD9)))
            return cairn_file_error_set(error, CAIRN_BAD_FORMAT, path, 0,
                                        "marker 0xff%02x before the first scan, expected a JPEG "
                                        "image",
                                        (unsigned)marker);
        length = read_unsigned(reader, at + 2, 2);
        if (length < 2 || read_unsigned(reader, at, 1) != 0xFF)
            return report_truncated(path, "JPEG image", error);
        if (is_start_of_frame(marker) && header->width > 0)
            return cairn_file_error_set(error, CAIRN_BAD_FORMAT, path, 0,
                                        "two start-of-frame markers, expected a JPEG image with "
                                        "one");
        if (is_start_of_frame(marker)) {
            header->height = read_unsigned(reader, at + 5, 2);
            header->width = read_unsigned(reader, at + 7, 2);
        }
        if (marker == 0xE1 && length > 8 && at + 2 + (uint64_t)length <= reader->count &&
            memcmp(reader->bytes + at + 4, "Exif\0", 6) == 0)
            header->orientation = read_orientation(reader->bytes + at + 10, (size_t)length - 8);
        if (marker == 0xDA)
            break;
        at += (uint64_t)length + 2;
    }
    while (read_unsigned(reader, at, 2) >= 0)
        if (read_unsigned(reader, at++, 2) == 0xFFD9)
            return CAIRN_OK;
    return report_truncated(path, "JPEG image", error);
}

/* Reads the size from the first image file directory: entries of tag, type, count and value. A
 * decoder might take another of two widths than is taken here, or a type that is not known here:
 * both are refused. */
static cairn_status read_tiff(cairn_vision_header *header, const byte_reader *reader,
                              const char *path, cairn_file_error *error)
{
    uint64_t at = (uint64_t)(read_unsigned(reader, 4, 4) > 0 ? read_unsigned(reader, 4, 4) : 0);
    int64_t entries = read_unsigned(reader, at, 2);

    if (at < 8 || entries < 0 || read_unsigned(reader, at + 2 + 12 * (uint64_t)entries, 4) < 0)
        return report_truncated(path, "TIFF image", error);
    header->width = -1;
    header->height = -1;
    for (at += 2; entries-- > 0; at += 12) {
        int64_t tag = read_unsigned(reader, at, 2), type = read_unsigned(reader, at + 2, 2),
                value = read_unsigned(reader, at + 8, 2),
                *side = tag == TAG_WIDTH ? &header->width : &header->height;

        if (tag == TAG_ORIENTATION && type == TYPE_SHORT && value >= 1 && value <= 8)
            header->orientation = (int32_t)value;
        if (tag != TAG_WIDTH && tag != TAG_HEIGHT)
            continue;
        if (*side >= 0)
            return cairn_file_error_set(error, CAIRN_BAD_FORMAT, path, 0,
                                        "the width or height is there twice, expected it once");
        if ((type != TYPE_SHORT && type != TYPE_LONG) || read_unsigned(reader, at + 4, 4) != 1)
            return cairn_file_error_set(
                error, CAIRN_BAD_FORMAT, path, 0,
                "the width or height is of type %d, expected one SHORT or LONG", (int)type);
        *side = type == TYPE_SHORT ? value : read_unsigned(reader, at + 8, 4);
    }
    header->width = header->width < 0 ? 0 : header->width;
    header->height = header->height < 0 ? 0 : header->height;
    return CAIRN_OK;
}

static int is_space(uint8_t byte)
{
    return byte == ' ' || (byte >= '\t' && byte <= '\r');
}

/* Returns the next integer of a PNM header, skipping comments; -1: none. */
static int64_t pnm_number(const byte_reader *reader, size_t *at)
{
    int64_t value = 0;
    size_t start;

    while (*at < reader->count && (is_space(reader->bytes[*at]) || reader->bytes[*at] == '#')) {
        if (reader->bytes[*at] == '#')
            while (*at + 1 < reader->count && reader->bytes[*at + 1] != '\n')
                ++*at;
        ++*at;
    }
    for (start = *at; *at < reader->count && reader->bytes[*at] >= '0' && reader->bytes[*at] <= '9';
         ++*at)
        if (value < INT32_MAX)
            value = value * 10 + (reader->bytes[*at] - '0');
    return *at > start ? value : -1;
}

/* Reads the size from the header of a PNM. */
static cairn_status read_pnm(cairn_vision_header *header, const byte_reader *reader,
                             const char *path, cairn_file_error *error)
{
    size_t at = 2;

    header->width = pnm_number(reader, &at);
    header->height = pnm_number(reader, &at);
    if (header->width < 0 || header->height < 0)
        return at >= reader->count
                   ? report_truncated(path, "PGM image", error)
                   : cairn_file_error_set(error, CAIRN_BAD_FORMAT, path, 0,
                                          "byte 0x%02x, expected the size of the image",
                                          reader->bytes[at]);
    return CAIRN_OK;
}

/* Names a file of another kind. */
static cairn_status report_other_format(const byte_reader *reader, const char *path,
                                        cairn_file_error *error)
{
    static const struct {
        const char *magic, *name;
        size_t at; /* where it stands */
    } known[] = {{"GIF8", "a GIF image", 0},     {"BM", "a BMP image", 0},
                 {"WEBP", "a WebP image", 8},    {"ftyphei", "a HEIF image", 4},
                 {"ftypmif", "a HEIF image", 4}, {"ftypavif", "an AVIF image", 4},
                 {"<", "an SVG or XML file", 0}, {"%PDF", "a PDF file", 0},
                 {"\x1F\x8B", "a gzip file", 0}, {"II+", "a BigTIFF image", 0}};

    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        size_t length = strlen(known[i].magic);

        if (known[i].at + length <= reader->count &&
            memcmp(reader->bytes + known[i].at, known[i].magic, length) == 0)
            return cairn_file_error_set(error, CAIRN_BAD_FORMAT, path, 0,
                                        "is %s, expected a TIFF, PNG, JPEG or PNM image",
                                        known[i].name);
    }
    return cairn_file_error_set(
        error, CAIRN_BAD_FORMAT, path, 0,
        "begins with the bytes 0x%02x%02x, expected a TIFF, PNG, JPEG or PNM image",
        reader->bytes[0], reader->bytes[1]);
}

cairn_status cairn_vision_header_read(cairn_vision_header *header, const uint8_t *bytes,
                                      size_t count, const char *path, cairn_file_error *error)
{
    byte_reader reader = {.bytes = bytes, .count = count};
    cairn_status status;

    memset(header, 0, sizeof *header);
    header->orientation = 1;
    if (count < 8)
        return cairn_file_error_set(error, CAIRN_TRUNCATED, path, 0,
                                    "the file has %zu bytes, expected an image", count);
    if (memcmp(bytes, "\x89PNG\r\n\x1A\n", 8) == 0) {
        header->format = CAIRN_VISION_PNG;
        status = read_png(header, &reader, path, error);
    } else if (bytes[0] == 0xFF && bytes[1] == 0xD8) {
        header->format = CAIRN_VISION_JPEG;
        status = read_jpeg(header, &reader, path, error);
    } else if (memcmp(bytes, "II*\0", 4) == 0 || memcmp(bytes, "MM\0*", 4) == 0) {
        reader.little_endian = bytes[0] == 'I';
        header->format = CAIRN_VISION_TIFF;
        status = read_tiff(header, &reader, path, error);
    } else if (bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6') {
        header->format = CAIRN_VISION_PNM;
        status = read_pnm(header, &reader, path, error);
    } else {
        status = report_other_format(&reader, path, error);
    }
    if (status == CAIRN_OK && (header->width < 1 || header->height < 1))
        status = cairn_file_error_set(error, CAIRN_BAD_FORMAT, path, 0,
                                      "the image has %lld x %lld pixels, expected at least 1 x 1",
                                      (long long)header->width, (long long)header->height);
    return status;
}
