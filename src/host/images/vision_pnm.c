/* PBM, PGM and PPM, as text (P1, P2, P3) and as bytes (P4, P5, P6); PGM and PPM of 1 to 65535 grey
 * levels. */
#include "src/base/build.h"

#include "src/host/images/vision_decode.h"

enum { MAX_LEVELS = 65535 };

/* A file and a place in it. */
typedef struct pnm_reader {
    const cairn_vision_file *file;
    size_t at;
} pnm_reader;

static int is_blank(uint8_t byte)
{
    return byte == ' ' || (byte >= '\t' && byte <= '\r');
}

/* Skips blanks and comments. CAIRN_TRUNCATED: nothing follows. */
static cairn_status skip_blanks(pnm_reader *reader, const char *what)
{
    const cairn_vision_file *file = reader->file;
    int32_t is_comment = 0;

    for (; reader->at < file->count; reader->at++) {
        uint8_t byte = file->bytes[reader->at];

        is_comment = is_comment ? byte != '\n' : byte == '#';
        if (!is_comment && !is_blank(byte))
            break;
    }
    if (reader->at >= file->count)
        return cairn_file_error_set(file->error, CAIRN_TRUNCATED, file->path, 0,
                                    "the file ends early, expected %s", what);
    return CAIRN_OK;
}

/* Reads the next integer behind blanks and comments; large ones stay large. */
static cairn_status read_number(pnm_reader *reader, const char *what, int64_t *value)
{
    const cairn_vision_file *file = reader->file;
    cairn_status status = skip_blanks(reader, what);

    if (status != CAIRN_OK)
        return status;
    if (file->bytes[reader->at] < '0' || file->bytes[reader->at] > '9')
        return cairn_file_error_set(file->error, CAIRN_BAD_FORMAT, file->path, 0,
                                    "byte 0x%02x, expected %s", file->bytes[reader->at], what);
    for (*value = 0; reader->at < file->count && file->bytes[reader->at] >= '0' &&
                     file->bytes[reader->at] <= '9';
         reader->at++)
        if (*value < INT32_MAX)
            *value = *value * 10 + (file->bytes[reader->at] - '0');
    return CAIRN_OK;
}

/* Reads one sample, as text or as bytes. */
static cairn_status read_sample(pnm_reader *reader, int32_t is_text, int64_t levels, size_t index,
                                int64_t *value)
{
    const cairn_vision_file *file = reader->file;
    cairn_status status = CAIRN_OK;

    if (is_text) {
        status = read_number(reader, "a sample", value);
    } else {
        *value = file->bytes[reader->at++];
        if (levels > 255)
            *value = *value << 8 | file->bytes[reader->at++];
    }
    if (status == CAIRN_OK && *value > levels)
        status = cairn_file_error_set(file->error, CAIRN_BAD_FORMAT, file->path, 0,
                                      "sample %zu is %lld, expected at most %lld", index + 1,
                                      (long long)*value, (long long)levels);
    return status;
}

/* Stores a sample where the image is blue, green, red and the file red, green, blue. */
static void store(cairn_vision_image *image, size_t index, uint32_t value)
{
    size_t to = image->channels == 3 ? index - index % 3 + (2 - index % 3) : index;

    if (image->sample_bytes == 1)
        ((uint8_t *)image->samples)[to] = (uint8_t)value;
    else
        ((uint16_t *)image->samples)[to] = (uint16_t)value;
}

static cairn_status read_samples(cairn_vision_image *image, pnm_reader *reader, int32_t is_text,
                                 int64_t levels)
{
    const cairn_vision_file *file = reader->file;
    size_t count = (size_t)image->width * (size_t)image->height * (size_t)image->channels,
           left = file->count - reader->at;
    int64_t most = image->sample_bytes == 1 ? 255 : MAX_LEVELS;

    CAIRN_ASSERT(levels > 0);
    if (!is_text && left / (size_t)image->sample_bytes < count)
        return cairn_file_error_set(file->error, CAIRN_TRUNCATED, file->path, 0,
                                    "the file ends after %zu samples, expected %zu",
                                    left / (size_t)image->sample_bytes, count);
    for (size_t i = 0; i < count; i++) {
        int64_t value;
        cairn_status status = read_sample(reader, is_text, levels, i, &value);

        if (status != CAIRN_OK)
            return status;
        store(image, i, (uint32_t)((value * most + levels / 2) / levels));
    }
    return CAIRN_OK;
}

/* Reads the pixels of a PBM as text: one digit each, with or without blanks between. 1: black. */
static cairn_status read_digits(cairn_vision_image *image, pnm_reader *reader)
{
    const cairn_vision_file *file = reader->file;
    size_t count = (size_t)image->width * (size_t)image->height;

    for (size_t i = 0; i < count; i++) {
        cairn_status status = skip_blanks(reader, "a pixel");
        uint8_t digit;

        if (status != CAIRN_OK)
            return status;
        digit = file->bytes[reader->at++];
        if (digit != '0' && digit != '1')
            return cairn_file_error_set(file->error, CAIRN_BAD_FORMAT, file->path, 0,
                                        "pixel %zu is the byte 0x%02x, expected 0 or 1", i + 1,
                                        digit);
        store(image, i, digit == '0' ? 255 : 0);
    }
    return CAIRN_OK;
}

/* Reads the pixels of a PBM as bits: from the highest one of each byte, rows in whole bytes. */
static cairn_status read_bits(cairn_vision_image *image, const pnm_reader *reader)
{
    const cairn_vision_file *file = reader->file;
    size_t width = (size_t)image->width, height = (size_t)image->height, stride = (width + 7) / 8,
           left = file->count - reader->at;

    if (left / stride < height)
        return cairn_file_error_set(file->error, CAIRN_TRUNCATED, file->path, 0,
                                    "the file ends after %zu rows, expected %zu", left / stride,
                                    height);
    for (size_t y = 0; y < height; y++)
        for (size_t x = 0; x < width; x++) {
            uint8_t byte = file->bytes[reader->at + y * stride + x / 8];

            store(image, y * width + x, byte >> (7 - x % 8) & 1 ? 0 : 255);
        }
    return CAIRN_OK;
}

cairn_status cairn_vision_decode_pnm(cairn_vision_image *image, const cairn_vision_file *file)
{
    pnm_reader reader = {.file = file, .at = 2};
    uint8_t kind = file->bytes[1];
    int32_t is_text = kind <= '3', is_colour = kind == '3' || kind == '6',
            is_bitmap = kind == '1' || kind == '4';
    int64_t width = 0, height = 0, levels = 1;
    cairn_status status = read_number(&reader, "the width of the image", &width);

    if (status == CAIRN_OK)
        status = read_number(&reader, "the height of the image", &height);
    if (status == CAIRN_OK && !is_bitmap)
        status = read_number(&reader, "the highest grey level", &levels);
    if (status == CAIRN_OK && (levels < 1 || levels > MAX_LEVELS))
        status = cairn_file_error_set(file->error, CAIRN_UNSUPPORTED, file->path, 0,
                                      "the highest grey level is %lld, expected 1 ... %d",
                                      (long long)levels, MAX_LEVELS);
    if (status == CAIRN_OK)
        status = cairn_vision_allocate(image, width, height, is_colour ? 3 : 1,
                                       levels > 255 ? 2 : 1, file);
    if (status != CAIRN_OK)
        return status;
    /* One blank divides the header from bytes. */
    reader.at += reader.at < file->count;
    if (!is_bitmap)
        return read_samples(image, &reader, is_text, levels);
    return is_text ? read_digits(image, &reader) : read_bits(image, &reader);
}
