/* Images: round trips, edges and slopes of known images; damaged, huge and foreign
 * files; without OpenCV. */
#include "tests/test.h"

#include <math.h>
#include <stdio.h>
#include <zlib.h>

#ifdef CAIRN_HAVE_JPEG
#include <jpeglib.h>
#endif
#ifdef CAIRN_HAVE_TIFF
#include <tiffio.h>
#endif

#include "cairn/vision.h"
#include "src/host/files/map_file_image.h"
#include "tests/files.h"

enum { WIDTH = 23, HEIGHT = 17, PIXELS = WIDTH * HEIGHT, CHANNELS_MOST = 4 };

static cairn_file_error error;

/* Tests that need OpenCV are skipped without it. */
static void need_opencv(void)
{
    cairn_status status = cairn_vision_load(&error);

    if (status == CAIRN_UNSUPPORTED) {
        print_message("%s: skipped\n", error.text);
        skip();
    }
    assert_ok(status);
}

static void assert_said(const char *path, const char *piece)
{
    if (strstr(error.text, path) == NULL || strstr(error.text, piece) == NULL ||
        (error.status != CAIRN_IO && strstr(error.text, "expected") == NULL))
        fail_msg("\"%s\" does not say \"%s ... %s ... expected\"", error.text, path, piece);
    assert_int_equal(error.line, 0);
}

static void assert_refused(const char *path, cairn_status status, const char *piece)
{
    cairn_vision_image image;

    memset(&error, 0, sizeof error);
    assert_status(cairn_vision_read(&image, path, &error), status);
    assert_status(error.status, status);
    assert_null(image.samples);
    assert_said(path, piece);
}

/* Samples that differ between all neighbours. */
static cairn_vision_image make(int32_t channels, int32_t bytes)
{
    static uint16_t samples[PIXELS * CHANNELS_MOST];
    cairn_vision_image image = {WIDTH, HEIGHT, channels, bytes, samples};

    for (int32_t i = 0; i < PIXELS * channels; i++)
        if (bytes == 1)
            ((uint8_t *)samples)[i] = (uint8_t)(i * 37 + i / 11);
        else
            samples[i] = (uint16_t)(i * 9973 + i / 11);
    return image;
}

/* ---- Files ---- */

static void test_what_is_written_comes_back(void **state)
{
    static const struct {
        const char *name;
        int32_t channels, bytes;
    } cases[] = {{"a.tif", 1, 1}, {"a.tif", 1, 2}, {"a.tiff", 3, 1}, {"a.tif", 3, 2},
                 {"a.tif", 4, 1}, {"a.png", 1, 1}, {"a.png", 1, 2},  {"a.png", 3, 1},
                 {"a.png", 3, 2}, {"a.png", 4, 1}, {"a.pgm", 1, 1},  {"a.pgm", 1, 2}};

    (void)state;
    need_opencv();
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        cairn_vision_image made = make(cases[i].channels, cases[i].bytes), got;
        const char *path = files_path(cases[i].name);

        assert_ok(cairn_vision_write(&made, path, &error));
        assert_ok(cairn_vision_read(&got, path, &error));
        assert_int_equal(got.width, WIDTH);
        assert_int_equal(got.height, HEIGHT);
        assert_int_equal(got.channels, cases[i].channels);
        assert_int_equal(got.sample_bytes, cases[i].bytes);
        assert_memory_equal(got.samples, made.samples,
                            (size_t)(PIXELS * cases[i].channels * cases[i].bytes));
        cairn_vision_free(&got);
        assert_null(got.samples);
        assert_int_equal(remove(path), 0);
    }
}

static void test_jpeg_comes_back_nearly(void **state)
{
    uint8_t samples[PIXELS];
    cairn_vision_image made = {WIDTH, HEIGHT, 1, 1, samples}, got;
    const char *path = files_path("a.jpg");

    (void)state;
    need_opencv();
    for (int32_t i = 0; i < PIXELS; i++)
        samples[i] = (uint8_t)(5 * (i % WIDTH) + 7 * (i / WIDTH));
    assert_ok(cairn_vision_write(&made, path, &error));
    assert_ok(cairn_vision_read_grey(&got, path, &error));
    for (int32_t i = 0; i < PIXELS; i++)
        assert_near(((uint8_t *)got.samples)[i], samples[i], 4);
    cairn_vision_free(&got);
}

/* A camera that was held upright or upside down says so in its EXIF data. */
static void test_orientation(void **state)
{
    enum { WIDE = 32, HIGH = 16 };
    /* Where the brightest and the second quadrant of 1 (left and right above) go: right, below. */
    static const int32_t places[8][4] = {{0, 0, 1, 0}, {1, 0, 0, 0}, {1, 1, 0, 1}, {0, 1, 1, 1},
                                         {0, 0, 0, 1}, {1, 0, 1, 1}, {1, 1, 1, 0}, {0, 1, 0, 0}};
    static uint8_t exif[] = "\xFF\xE1\0\x22"
                            "Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x01\0\0"
                            "\0\0\0";
    static uint8_t samples[WIDE * HIGH];
    cairn_vision_image image = {WIDE, HIGH, 1, 1, samples};
    uint8_t *bytes, *said;
    size_t size = 0;

    (void)state;
    need_opencv();
    for (int32_t i = 0; i < WIDE * HIGH; i++)
        samples[i] = i / WIDE >= HIGH / 2 ? 0 : i % WIDE < WIDE / 2 ? 250 : 120;
    assert_ok(cairn_vision_write(&image, files_path("held.jpg"), &error));
    bytes = (uint8_t *)files_read(files_path("held.jpg"), &size);
    said = malloc(size + 36);
    assert_non_null(said);
    for (int32_t k = 0; k < 8; k++) {
        cairn_vision_image read;

        exif[29] = (uint8_t)(k + 1);
        memcpy(said, bytes, 2);
        memcpy(said + 2, exif, 36);
        memcpy(said + 38, bytes + 2, size - 2);
        assert_ok(cairn_vision_read_grey(&read, files_write("said.jpg", said, size + 36), &error));
        assert_int_equal(read.width, k < 4 ? WIDE : HIGH);
        assert_int_equal(read.height, k < 4 ? HIGH : WIDE);
        for (int32_t mark = 0; mark < 2; mark++) {
            int32_t u = read.width / 4 + places[k][2 * mark] * read.width / 2,
                    v = read.height / 4 + places[k][2 * mark + 1] * read.height / 2;

            assert_near(((uint8_t *)read.samples)[v * read.width + u], mark == 0 ? 250 : 120, 12);
        }
        cairn_vision_free(&read);
    }
    free(said);
    free(bytes);
}

static void test_nothing_half_written(void **state)
{
    cairn_vision_image image = make(1, 1), deep = make(1, 2), colour = make(3, 1);
    int before;

    (void)state;
    before = files_count();
    assert_status(cairn_vision_write(&image, files_path("a.bmp"), &error), CAIRN_BAD_ARGUMENT);
    assert_said("a.bmp", ".tif");
    assert_status(cairn_vision_write(&image, files_path("png"), &error), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_vision_write(&deep, files_path("a.jpg"), &error), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_vision_write(&colour, files_path("a.pgm"), &error), CAIRN_BAD_ARGUMENT);
    for (int k = 0; k < 6; k++) {
        cairn_vision_image bad = make(1, 1);

        bad.width = k == 0 ? 0 : bad.width;
        bad.height = k == 1 ? 0 : bad.height;
        bad.channels = k == 2 ? 2 : bad.channels;
        bad.sample_bytes = k == 3 ? 4 : bad.sample_bytes;
        bad.samples = k == 4 ? NULL : bad.samples;
        bad.width = k == 5 ? CAIRN_VISION_MAX_SIDE + 1 : bad.width;
        assert_status(cairn_vision_write(&bad, files_path("a.png"), &error), CAIRN_BAD_ARGUMENT);
        assert_status(cairn_vision_make_grey(&bad), CAIRN_BAD_ARGUMENT);
    }
    assert_status(cairn_vision_write(NULL, files_path("a.png"), NULL), CAIRN_BAD_ARGUMENT);
    need_opencv();
    assert_status(cairn_vision_write(&image, files_path("none/a.png"), &error), CAIRN_IO);
    assert_int_equal(files_count(), before);
}

/* ---- Grey ---- */

static void test_grey(void **state)
{
    static const uint8_t colours[5][3] = {
        {255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {255, 255, 255}, {10, 20, 30}};
    static const int32_t wanted[5] = {29, 150, 76, 255, 22};

    (void)state;
    for (int32_t channels = 3; channels <= 4; channels++)
        for (int32_t bytes = 1; bytes <= 2; bytes++) {
            cairn_vision_image image = {5, 1, channels, bytes, calloc(40, 2)};

            for (int32_t i = 0; i < 5; i++)
                for (int32_t k = 0; k < 3; k++)
                    if (bytes == 1)
                        ((uint8_t *)image.samples)[i * channels + k] = colours[i][k];
                    else
                        ((uint16_t *)image.samples)[i * channels + k] =
                            (uint16_t)(257 * colours[i][k]);
            assert_ok(cairn_vision_make_grey(&image));
            assert_int_equal(image.channels, 1);
            assert_int_equal(image.sample_bytes, 1);
            for (int32_t i = 0; i < 5; i++)
                assert_int_equal(((uint8_t *)image.samples)[i], wanted[i] - (i == 4 && bytes == 2));
            assert_ok(cairn_vision_make_grey(&image));
            assert_int_equal(((uint8_t *)image.samples)[1], wanted[1]);
            cairn_vision_free(&image);
        }
    assert_status(cairn_vision_make_grey(NULL), CAIRN_BAD_ARGUMENT);
}

/* What is transparent is ground: white behind dark, black behind light. */
static void test_alpha(void **state)
{
    (void)state;
    for (int32_t bytes = 1; bytes <= 2; bytes++)
        for (int32_t light = 0; light < 2; light++) {
            cairn_vision_image image = {4, 1, 4, bytes, calloc(16, 2)};
            /* opaque, opaque, half, none; all of one colour */
            static const int32_t alpha[4] = {255, 255, 51, 0};

            for (int32_t i = 0; i < 16; i++) {
                int32_t value = i % 4 == 3 ? alpha[i / 4] : light * 255;

                if (bytes == 1)
                    ((uint8_t *)image.samples)[i] = (uint8_t)value;
                else
                    ((uint16_t *)image.samples)[i] = (uint16_t)(257 * value);
            }
            assert_ok(cairn_vision_make_grey(&image));
            for (int32_t i = 0; i < 4; i++)
                assert_int_equal(((uint8_t *)image.samples)[i], light ? alpha[i] : 255 - alpha[i]);
            cairn_vision_free(&image);
        }
    /* Without OpenCV the same, from a file: grey and alpha. */
    {
        static const uint8_t samples[] = {0, 0, 255, 255};
        cairn_vision_image image;
        uint8_t rgba[16], *png;
        size_t count;

        for (int32_t i = 0; i < 16; i++)
            rgba[i] = i % 4 == 3 ? (uint8_t)(255 - samples[i / 4]) : 0;
        assert_ok(cairn_image_encode_png(&png, &count, rgba, 4, 1, 4));
        (void)files_write("icon.png", png, count);
        free(png);
        (void)setenv("CAIRN_VISION", "/nowhere", 1);
        assert_ok(cairn_vision_read_grey(&image, files_path("icon.png"), &error));
        (void)unsetenv("CAIRN_VISION");
        assert_memory_equal(image.samples, samples, 4);
        cairn_vision_free(&image);
    }
}

/* Whether a picture is dark is the mean of all its pixels, by their alpha; 128 is light. */
static void test_ground_by_the_mean(void **state)
{
    static const struct {
        uint8_t grey[4], alpha[4], wanted[4];
    } cases[] = {{{200, 10, 20, 7}, {255, 255, 255, 0}, {200, 10, 20, 255}},
                 {{10, 200, 250, 7}, {255, 255, 255, 0}, {10, 200, 250, 0}},
                 {{200, 200, 10, 7}, {51, 51, 255, 0}, {244, 244, 10, 255}},
                 {{128, 128, 128, 7}, {255, 255, 255, 0}, {128, 128, 128, 0}},
                 {{127, 127, 128, 200}, {255, 255, 255, 0}, {127, 127, 128, 255}},
                 {{10, 200, 7, 9}, {0, 0, 0, 0}, {10, 200, 7, 9}}};

    (void)state;
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        cairn_vision_image image = {4, 1, 4, 1, calloc(16, 1)};

        for (int32_t i = 0; i < 16; i++)
            ((uint8_t *)image.samples)[i] =
                i % 4 == 3 ? cases[k].alpha[i / 4] : cases[k].grey[i / 4];
        assert_ok(cairn_vision_make_grey(&image));
        assert_memory_equal(image.samples, cases[k].wanted, 4);
        cairn_vision_free(&image);
    }
}

/* 8, 10 and 12 bits in samples of 16 are recognized by the greatest one. */
static void test_few_bits_in_16(void **state)
{
    static const int32_t most[] = {255, 256, 1023, 1024, 4095, 4096, 65535},
                         wanted[] = {255, 64, 255, 64, 255, 16, 255};

    (void)state;
    for (int k = 0; k < 7; k++) {
        cairn_vision_image image = {2, 1, 1, 2, calloc(2, 2)};

        ((uint16_t *)image.samples)[1] = (uint16_t)most[k];
        assert_ok(cairn_vision_make_grey(&image));
        assert_int_equal(((uint8_t *)image.samples)[0], 0);
        assert_int_equal(((uint8_t *)image.samples)[1], wanted[k]);
        cairn_vision_free(&image);
    }
    /* Alpha does not count: it has 16 bits anyway. */
    {
        static const uint16_t samples[8] = {1023, 1023, 1023, 65535, 512, 512, 512, 65535};
        cairn_vision_image image = {2, 1, 4, 2, malloc(sizeof samples)};

        memcpy(image.samples, samples, sizeof samples);
        assert_ok(cairn_vision_make_grey(&image));
        assert_int_equal(((uint8_t *)image.samples)[0], 255);
        assert_int_equal(((uint8_t *)image.samples)[1], 128);
        cairn_vision_free(&image);
    }
}

/* ---- Kinds of files ---- */

/* Writes a TIFF of one strip: tags beyond the usual ones are given as three numbers, tag, type SHORT
 * and value. */
static const char *write_tiff(const char *name, const int32_t *tags, int32_t count,
                              const uint8_t *data, size_t data_count)
{
    uint8_t bytes[4096] = "II*\0\x08\0\0";
    size_t at = 10, first = 8 + 2 + 12 * (size_t)count + 4;

    bytes[8] = (uint8_t)count;
    for (int32_t i = 0; i < count; i++, at += 12) {
        int32_t tag = tags[2 * i], value = tag == 273 ? (int32_t)first : tags[2 * i + 1];

        bytes[at] = (uint8_t)tag;
        bytes[at + 1] = (uint8_t)(tag >> 8);
        bytes[at + 2] = 3;
        bytes[at + 4] = 1;
        bytes[at + 8] = (uint8_t)value;
        bytes[at + 9] = (uint8_t)(value >> 8);
    }
    memcpy(bytes + first, data, data_count);
    return files_write(name, bytes, first + data_count);
}

static void assert_grey(const char *path, int32_t width, int32_t height, const uint8_t *wanted)
{
    cairn_vision_image image;

    assert_ok(cairn_vision_read_grey(&image, path, &error));
    assert_int_equal(image.width, width);
    assert_int_equal(image.height, height);
    assert_memory_equal(image.samples, wanted, (size_t)(width * height));
    cairn_vision_free(&image);
}

static void test_kinds_of_tiff(void **state)
{
#ifdef CAIRN_HAVE_TIFF
    /* width, height, bits, compression, photometric, strip, orientation, samples, rows, bytes */
    static const int32_t one_bit[] = {256, 8,   257, 1,   258, 1,   259, 1,   262,
                                      0,   273, 0,   277, 1,   278, 1,   279, 1};
    static const int32_t twelve[] = {256, 2,   257, 1,   258, 12,  259, 1,   262,
                                     1,   273, 0,   277, 1,   278, 1,   279, 3};
    static const int32_t turned[] = {256, 2, 257, 1, 258, 8, 259, 1, 262, 1,
                                     273, 0, 274, 6, 277, 1, 278, 1, 279, 2};
    static const int32_t inks[] = {256, 1,   257, 1,   258, 8,   259, 1,   262,
                                   5,   273, 0,   277, 4,   278, 1,   279, 4};
    static const int32_t clear[] = {256, 2, 257, 1, 258, 8, 259, 1, 262, 1,
                                    273, 0, 277, 2, 278, 1, 279, 4, 338, 2};
    static const int32_t real[] = {256, 1, 257, 1, 258, 32, 259, 1, 262, 1,
                                   273, 0, 277, 1, 278, 1,  279, 4, 339, 3};

    (void)state;
    assert_grey(write_tiff("1.tif", one_bit, 9, (const uint8_t *)"\xA0", 1), 8, 1,
                (const uint8_t *)"\0\xFF\0\xFF\xFF\xFF\xFF\xFF");
    /* 0x800 and 0xFFF of 12 bits */
    assert_grey(write_tiff("12.tif", twelve, 9, (const uint8_t *)"\x80\x0F\xFF", 3), 2, 1,
                (const uint8_t *)"\x80\xFF");
    /* a row that is to be turned a quarter clockwise is a column */
    assert_grey(write_tiff("6.tif", turned, 10, (const uint8_t *)"\x0A\x14", 2), 1, 2,
                (const uint8_t *)"\x0A\x14");
    /* black ink alone */
    assert_grey(write_tiff("cmyk.tif", inks, 9, (const uint8_t *)"\0\0\0\xFF", 4), 1, 1,
                (const uint8_t *)"\0");
    /* a dark pixel on transparent ground */
    assert_grey(write_tiff("alpha.tif", clear, 10, (const uint8_t *)"\x60\xFF\0\0", 4), 2, 1,
                (const uint8_t *)"\x60\xFF");
    assert_refused(write_tiff("real.tif", real, 10, (const uint8_t *)"\0\0\0\0", 4),
                   CAIRN_UNSUPPORTED, "samples of 32 bits, floating-point");
#else
    (void)state;
    (void)write_tiff;
    skip();
#endif
}

#ifdef CAIRN_HAVE_TIFF
/* Samples of a TIFF of 3 x 2 pixels. */
typedef struct tiff_kind {
    uint16_t bits, samples, photometric, planar;
    uint32_t tile; /* pixels a side; 0: strips of one row */
} tiff_kind;

/* Writes a TIFF by libtiff: planes or rows [..][2][row_bytes], one after the other. */
static const char *write_tiff_by_library(const char *name, tiff_kind kind, const uint8_t *rows,
                                         size_t row_bytes)
{
    const char *path = files_path(name);
    uint16_t colours[3][256] = {{0}};
    uint32_t planes = kind.planar == PLANARCONFIG_SEPARATE ? kind.samples : 1;
    uint8_t block[16 * 16];
    TIFF *tiff = TIFFOpen(path, "w");

    assert_non_null(tiff);
    assert_true(row_bytes <= 16);
    /* colour 1 is red, colour 2 white, the others are black */
    colours[0][1] = colours[0][2] = colours[1][2] = colours[2][2] = 65535;
    (void)TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, 3);
    (void)TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, 2);
    (void)TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, kind.bits);
    (void)TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, kind.samples);
    (void)TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, kind.photometric);
    (void)TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, kind.planar);
    if (kind.photometric == PHOTOMETRIC_PALETTE)
        (void)TIFFSetField(tiff, TIFFTAG_COLORMAP, colours[0], colours[1], colours[2]);
    if (kind.tile > 0) {
        (void)TIFFSetField(tiff, TIFFTAG_TILEWIDTH, kind.tile);
        (void)TIFFSetField(tiff, TIFFTAG_TILELENGTH, kind.tile);
    } else {
        (void)TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, 1);
    }
    for (uint32_t plane = 0; plane < planes; plane++, rows += 2 * row_bytes) {
        memset(block, 0, sizeof block);
        for (uint32_t y = 0; y < 2; y++) {
            memcpy(block + 16 * y, rows + y * row_bytes, row_bytes);
            if (kind.tile == 0)
                assert_true(TIFFWriteEncodedStrip(tiff, 2 * plane + y, block + 16 * y,
                                                  (tmsize_t)row_bytes) > 0);
        }
        if (kind.tile > 0)
            assert_true(TIFFWriteEncodedTile(tiff, plane, block, sizeof block) > 0);
    }
    TIFFClose(tiff);
    return path;
}
#endif

/* Palettes of 8 and 4 bits, and planes of colour, of one pixel's samples together or apart, in
 * strips and tiles, of 8 and 16 bits. */
static void test_palettes_and_planes_of_tiff(void **state)
{
#ifdef CAIRN_HAVE_TIFF
    enum { CHUNKY = PLANARCONFIG_CONTIG, APART = PLANARCONFIG_SEPARATE };
    static const tiff_kind palette8 = {8, 1, PHOTOMETRIC_PALETTE, CHUNKY, 0},
                           palette4 = {4, 1, PHOTOMETRIC_PALETTE, CHUNKY, 0},
                           planes8 = {8, 3, PHOTOMETRIC_RGB, APART, 0},
                           planes16 = {16, 3, PHOTOMETRIC_RGB, APART, 0},
                           tiles = {8, 3, PHOTOMETRIC_RGB, APART, 16};
    /* red, white, black; black, red, white */
    static const uint8_t wanted[] = {0x4C, 0xFF, 0, 0, 0x4C, 0xFF},
                         red_green_blue[] = {255, 255, 0,   0, 255, 255, 0, 255, 0,
                                             0,   0,   255, 0, 255, 0,   0, 0,   255};
    uint8_t deep[2 * sizeof red_green_blue];
    const char *path;

    (void)state;
    for (size_t i = 0; i < sizeof deep; i++)
        deep[i] = red_green_blue[i / 2];
    assert_grey(write_tiff_by_library("p8.tif", palette8, (const uint8_t *)"\1\2\0\0\1\2", 3), 3, 2,
                wanted);
    assert_grey(write_tiff_by_library("p4.tif", palette4, (const uint8_t *)"\x12\0\x01\x20", 2), 3,
                2, wanted);
    assert_grey(write_tiff_by_library("planes8.tif", planes8, red_green_blue, 3), 3, 2, wanted);
    assert_grey(write_tiff_by_library("planes16.tif", planes16, deep, 6), 3, 2, wanted);
    path = write_tiff_by_library("tiles.tif", tiles, red_green_blue, 3);
    assert_grey(path, 3, 2, wanted);
    /* The last of the planes is missing: its strips lie beyond the end. */
    path = write_tiff_by_library("planes8.tif", planes8, red_green_blue, 3);
    {
        uint8_t bytes[4096];
        FILE *file = fopen(path, "rb");
        size_t count, at;

        assert_non_null(file);
        count = fread(bytes, 1, sizeof bytes, file);
        (void)fclose(file);
        for (at = 8; at + 12 < count && (bytes[at] != 0x11 || bytes[at + 1] != 1); at++)
            continue; /* StripOffsets */
        assert_true(at + 12 < count);
        assert_int_equal(bytes[at + 4], 6);
        at = bytes[at + 8] + 256u * bytes[at + 9];
        bytes[at + 11] = 0x7F;
        bytes[at + 23] = 0x7F;
        assert_refused(files_write("beyond.tif", bytes, count), CAIRN_BAD_FORMAT,
                       "the TIFF data are damaged or cut");
    }
#else
    (void)state;
    skip();
#endif
}

/* The highest grey level is white, in one byte or two; colours are red, green, blue. */
static void test_kinds_of_pnm(void **state)
{
    (void)state;
    assert_grey(files_write_text("15.pgm", "P2\n3 1 15\n0 5 15\n"), 3, 1,
                (const uint8_t *)"\0\x55\xFF");
    assert_grey(files_write("comment.pgm", "P5#2 1\n2 1 255\n\x08\xFF", 17), 2, 1,
                (const uint8_t *)"\x08\xFF");
    assert_grey(files_write("4095.pgm", "P5 2 1 4095\n\x08\x00\x0F\xFF", 16), 2, 1,
                (const uint8_t *)"\x80\xFF");
    assert_grey(files_write_text("a.ppm", "P3\n1 1 255\n255 0 0\n"), 1, 1, (const uint8_t *)"\x4C");
    assert_refused(files_write_text("b.pgm", "P2\n1 1 15\n16\n"), CAIRN_BAD_FORMAT,
                   "sample 1 is 16, expected at most 15");
    assert_refused(files_write_text("c.pgm", "P2\n1 1 65536\n16\n"), CAIRN_UNSUPPORTED,
                   "the highest grey level is 65536, expected 1 ... 65535");
}

/* 1 is black. As text digits need no blanks between; as bytes each row ends with its byte. */
static void test_kinds_of_pbm(void **state)
{
    static const uint8_t wanted[] = {0,   255, 255, 255, 255, 255, 255, 255, 255, 0,
                                     255, 255, 255, 255, 255, 255, 255, 255, 0,   255};

    (void)state;
    assert_grey(files_write_text("a.pbm", "P1\n# text\n10 2\n1000000001 0 0 0 0\n0000#\n10\n"), 10,
                2, wanted);
    assert_grey(files_write("b.pbm", "P4\n10 2\n\x80\x7F\0\xBF", 12), 10, 2, wanted);
    assert_grey(files_write("c.pbm", "P4 1 1 \x80", 8), 1, 1, (const uint8_t *)"\0");
    assert_refused(files_write_text("d.pbm", "P1\n2 2\n1 0 2 0"), CAIRN_BAD_FORMAT,
                   "pixel 3 is the byte 0x32, expected 0 or 1");
    assert_refused(files_write_text("e.pbm", "P1\n2 2\n1 0 1"), CAIRN_TRUNCATED,
                   "the file ends early, expected a pixel");
    assert_refused(files_write("f.pbm", "P4\n10 2\n\x80\x7F\0", 11), CAIRN_TRUNCATED,
                   "the file ends after 1 rows, expected 2");
    assert_refused(files_write_text("g.pbm", "P4\n0 2\n...."), CAIRN_BAD_FORMAT, "0 x 2");
    assert_refused(files_write_text("h.pbm", "P4\n40000 1\n."), CAIRN_FULL, "40000 x 1");
}

/* Orientation in the eXIf chunk. */
static void test_orientation_of_png(void **state)
{
    static uint8_t exif[] = "\0\0\0\x1A"
                            "eXIfMM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x03"
                            "\0\0\0\0\0\0\0\0\0\0";
    enum { EXIF_BYTES = 38, HEAD_BYTES = 33 };
    uint8_t *png, *said;
    size_t count;
    uLong sum = crc32(0, exif + 4, EXIF_BYTES - 8);

    (void)state;
    for (int32_t k = 0; k < 4; k++)
        exif[EXIF_BYTES - 4 + k] = (uint8_t)(sum >> (24 - 8 * k));
    assert_ok(cairn_image_encode_png(&png, &count, (const uint8_t *)"\x0A\x14", 2, 1, 1));
    said = malloc(count + EXIF_BYTES);
    assert_non_null(said);
    memcpy(said, png, HEAD_BYTES);
    memcpy(said + HEAD_BYTES, exif, EXIF_BYTES);
    memcpy(said + HEAD_BYTES + EXIF_BYTES, png + HEAD_BYTES, count - HEAD_BYTES);
    assert_grey(files_write("turned.png", said, count + EXIF_BYTES), 2, 1,
                (const uint8_t *)"\x14\x0A");
    free(said);
    free(png);
}

/* Four inks as they are (CMYK) or as YCCK, inverted by Adobe's programs or not; and data that are
 * missing inside the file. */
static void test_kinds_of_jpeg(void **state)
{
#ifdef CAIRN_HAVE_JPEG
    /* YCCK is known by Adobe's marker alone. */
    static const struct {
        int32_t adobe;
        J_COLOR_SPACE space;
        uint8_t wanted;
    } kinds[] = {{0, JCS_CMYK, 127}, {1, JCS_CMYK, 128}, {1, JCS_YCCK, 128}};

    (void)state;
    for (size_t kind = 0; kind < sizeof kinds / sizeof *kinds; kind++) {
        int32_t adobe = kinds[kind].adobe;
        struct jpeg_compress_struct jpeg;
        struct jpeg_error_mgr errors;
        uint8_t row[4 * 16], *bytes = NULL, *cut, wanted[16 * 16];
        unsigned long count = 0;
        JSAMPROW rows = row;

        jpeg.err = jpeg_std_error(&errors);
        jpeg_create_compress(&jpeg);
        jpeg_mem_dest(&jpeg, &bytes, &count);
        jpeg.image_width = jpeg.image_height = 16;
        jpeg.input_components = 4;
        jpeg.in_color_space = JCS_CMYK;
        jpeg_set_defaults(&jpeg);
        jpeg_set_colorspace(&jpeg, kinds[kind].space);
        jpeg.write_Adobe_marker = (boolean)adobe;
        jpeg_start_compress(&jpeg, TRUE);
        /* half of the black ink */
        for (size_t i = 0; i < sizeof row; i++)
            row[i] = i % 4 == 3 ? 128 : adobe ? 255 : 0;
        for (int32_t y = 0; y < 16; y++)
            (void)jpeg_write_scanlines(&jpeg, &rows, 1);
        jpeg_finish_compress(&jpeg);
        jpeg_destroy_compress(&jpeg);
        memset(wanted, kinds[kind].wanted, sizeof wanted);
        assert_grey(files_write("ink.jpg", bytes, count), 16, 16, wanted);
        cut = malloc(count);
        assert_non_null(cut);
        memcpy(cut, bytes, count - 4);
        memcpy(cut + count - 6, "\xFF\xD9", 2);
        assert_refused(files_write("cut.jpg", cut, count - 4), CAIRN_TRUNCATED,
                       "the JPEG data are damaged or cut");
        free(cut);
        free(bytes);
    }
#else
    (void)state;
    skip();
#endif
}

/* ---- Edges ---- */

enum { SIDE = 80 };

/* A disc about the middle of the picture. */
static int is_in_disc(int32_t pixel)
{
    int32_t x = pixel % SIDE - 40, y = pixel / SIDE - 40;

    return x * x + y * y < 20 * 20;
}

/* A dark disc on a light ground, cut out by a box around it; the same at each call. */
static void test_grab(void **state)
{
    static uint8_t grey[SIDE * SIDE];
    static const int32_t box[] = {12, 12, 56, 56}, bad[][4] = {{0, 0, SIDE, SIDE},
                                                               {-1, 0, 9, 9},
                                                               {0, 0, 7, 9},
                                                               {72, 0, 9, 9},
                                                               {0, 72, 9, 9}};
    cairn_vision_image photo = {SIDE, SIDE, 1, 1, grey}, out, again;
    int32_t wrong = 0;

    (void)state;
    for (int32_t i = 0; i < SIDE * SIDE; i++)
        grey[i] = (uint8_t)((is_in_disc(i) ? 60 : 190) + i * 7 % 23);
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        assert_status(cairn_vision_grab(&out, &photo, bad[k], "name", &error), CAIRN_BAD_ARGUMENT);
        assert_said("name", "the box");
    }
    need_opencv();
    assert_ok(cairn_vision_grab(&out, &photo, box, "name", &error));
    assert_ok(cairn_vision_grab(&again, &photo, box, "name", &error));
    assert_memory_equal(out.samples, again.samples, SIDE * SIDE);
    for (int32_t i = 0; i < SIDE * SIDE; i++)
        wrong += ((uint8_t *)out.samples)[i] != (is_in_disc(i) ? 0 : 255);
    assert_in_range(wrong, 0, 60);
    cairn_vision_free(&out);
    cairn_vision_free(&again);
}

/* A step of `rise` between columns 9 and 10. */
static void make_step(uint8_t *grey, int32_t rise)
{
    for (int32_t i = 0; i < PIXELS; i++)
        grey[i] = (uint8_t)(50 + (i % WIDTH >= 10 ? rise : 0));
}

static void test_edges_of_a_step(void **state)
{
    cairn_vision_canny_params params = cairn_vision_canny_default();
    uint8_t grey[PIXELS], strengths[PIXELS];
    cairn_vision_image image = {WIDTH, HEIGHT, 1, 1, grey};

    (void)state;
    need_opencv();
    make_step(grey, 100);
    assert_ok(cairn_vision_canny(&image, &params, strengths, "step", &error));
    for (int32_t y = 1; y < HEIGHT - 1; y++) {
        int32_t found = 0;

        for (int32_t x = 0; x < WIDTH; x++)
            if (strengths[y * WIDTH + x] > 0) {
                found++;
                assert_in_range(x, 9, 10);
                /* 100 / (1.4 sqrt(2 pi)), twice; between two columns it is a little less. */
                assert_near(strengths[y * WIDTH + x], 200 / (1.4 * 2.5066), 12);
            }
        assert_int_equal(found, 1);
    }
    /* The slope of this step is 20 / (1.4 sqrt(2 pi)) = 5.7. */
    make_step(grey, 20);
    params.high = 4;
    assert_ok(cairn_vision_canny(&image, &params, strengths, "step", &error));
    assert_int_not_equal(strengths[5 * WIDTH + 9] + strengths[5 * WIDTH + 10], 0);
    params.high = 8;
    assert_ok(cairn_vision_canny(&image, &params, strengths, "step", &error));
    for (int32_t i = 0; i < PIXELS; i++)
        assert_int_equal(strengths[i], 0);
    params.sigma = 0;
    assert_ok(cairn_vision_canny(&image, &params, strengths, "step", &error));
    assert_int_not_equal(strengths[5 * WIDTH + 9] + strengths[5 * WIDTH + 10], 0);
}

static void test_slopes_of_a_ramp(void **state)
{
    static const double sigmas[] = {0, 1, 2};
    uint8_t grey[PIXELS];
    float x[PIXELS], y[PIXELS];
    cairn_vision_image image = {WIDTH, HEIGHT, 1, 1, grey};

    (void)state;
    need_opencv();
    for (int32_t i = 0; i < PIXELS; i++)
        grey[i] = (uint8_t)(3 * (i % WIDTH) + 5 * (i / WIDTH));
    for (int k = 0; k < 3; k++) {
        assert_ok(cairn_vision_gradients(&image, sigmas[k], x, y, "ramp", &error));
        assert_near(x[8 * WIDTH + 11], 3, 0.01);
        assert_near(y[8 * WIDTH + 11], 5, 0.01);
    }
}

static void test_refused_edges(void **state)
{
    uint8_t grey[PIXELS] = {0}, strengths[PIXELS];
    float x[PIXELS];
    cairn_vision_image image = {WIDTH, HEIGHT, 1, 1, grey}, deep = make(1, 2), colour = make(3, 1);
    static const struct {
        cairn_vision_canny_params params;
        const char *text;
    } bad[] = {{{-1, 3, 8}, "sigma is -1"},
               {{51, 3, 8}, "sigma is 51, expected a number from 0 to 50"},
               {{(double)NAN, 3, 8}, "sigma is nan"},
               {{1, 0, 8}, "low is 0, expected a number above 0 to 1000"},
               {{1, (double)NAN, 8}, "low is nan"},
               {{1, 3, 2.9}, "low is 3, expected at most high, 2.9"},
               {{1, 3, (double)NAN}, "high is nan"},
               {{1, 3, 1001}, "high is 1001"}};
    cairn_vision_canny_params good = cairn_vision_canny_default();

    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_status(cairn_vision_canny(&image, &bad[i].params, strengths, "name", &error),
                      CAIRN_BAD_ARGUMENT);
        assert_holds(error.text, bad[i].text);
    }
    assert_status(cairn_vision_canny(&deep, &good, strengths, "name", NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_vision_canny(&colour, &good, strengths, "name", NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_vision_canny(NULL, &good, strengths, "name", NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_vision_canny(&image, NULL, strengths, "name", NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_vision_canny(&image, &good, NULL, "name", NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_vision_gradients(&image, -1, x, x, "name", NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_vision_gradients(&image, 51, x, x, "name", NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_vision_gradients(&image, (double)NAN, x, x, "name", NULL),
                  CAIRN_BAD_ARGUMENT);
    assert_status(cairn_vision_gradients(&image, 1, NULL, x, "name", NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_vision_gradients(&image, 1, x, NULL, "name", NULL), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_vision_gradients(&deep, 1, x, x, "name", &error), CAIRN_BAD_ARGUMENT);
    assert_said("name", "grey");
}

/* ---- Bad files ---- */

static void test_every_cut_is_reported(void **state)
{
    static const char *const names[] = {"a.tif", "a.png", "a.jpg", "a.pgm"};

    (void)state;
    need_opencv();
    for (size_t i = 0; i < 4; i++) {
        cairn_vision_image made = make(1, 1), got;
        const char *path = files_path(names[i]);
        size_t count = 0;
        char *bytes;

        assert_ok(cairn_vision_write(&made, path, &error));
        bytes = files_read(path, &count);
        for (size_t cut = 0; cut < count; cut++) {
            const char *shorter = files_write("cut", bytes, cut);
            cairn_status status = cairn_vision_read(&got, shorter, &error);

            /* The data behind the pixels of a TIFF may be missing, and a reader of TIFF may keep
             * the rows that exist. */
            if (status == CAIRN_OK && i == 0)
                cairn_vision_free(&got);
            else if (status != CAIRN_TRUNCATED && status != CAIRN_BAD_FORMAT)
                fail_msg("%s cut to %zu of %zu bytes: %d", names[i], cut, count, status);
            else
                assert_said("cut", "");
        }
        free(bytes);
    }
}

/* Bytes changed at random: an image or an error, never anything else. */
static void test_damage_is_survived(void **state)
{
    static const char *const names[] = {"a.tif", "a.png", "a.pgm"};
    cairn_random random = cairn_random_seed(5, 1);

    (void)state;
    need_opencv();
    for (size_t i = 0; i < 3; i++) {
        cairn_vision_image made = make(3 - 2 * (i == 2), 1), got;
        const char *path = files_path(names[i]);
        size_t count = 0;
        char *bytes;

        assert_ok(cairn_vision_write(&made, path, &error));
        bytes = files_read(path, &count);
        for (int32_t round = 0; round < 40; round++) {
            size_t at = (size_t)cairn_random_below(&random, (int32_t)(count < 400 ? count : 400));
            char was = bytes[at];

            bytes[at] = (char)cairn_random_below(&random, 256);
            if (cairn_vision_read(&got, files_write("damaged", bytes, count), &error) == CAIRN_OK) {
                assert_true(got.width >= 1 && got.height >= 1 && got.samples != NULL);
                cairn_vision_free(&got);
            }
            bytes[at] = was;
        }
        free(bytes);
    }
}

/* Headers of images beyond the limits, without data. */
static void test_giants_are_refused_unread(void **state)
{
    static const uint8_t png[] = "\x89PNG\r\n\x1A\n\0\0\0\x0DIHDR\0\0\x80\x01\0\0\0\x01\x08\0\0\0\0"
                                 "\0\0\0\0\0\0\0\0IEND\0\0\0\0";
    static const uint8_t jpeg[] = "\xFF\xD8\xFF\xE0\0\x04xx\xFF\xFF\xC0\0\x0B\x08\xFF\xFF\xFF\xFE"
                                  "\x01\x01\x11\0\xFF\xDA\0\x02xx\xFF\xD9";
    static const uint8_t little[] = "II*"
                                    "\0\x08\0\0\0\x02\0\0\x01\x03\0\x01\0\0\0\x10\x80\0\0\x01\x01"
                                    "\x04\0\x01\0\0\0\x05\0\0\0\0\0\0\0";
    static const uint8_t big[] = "MM\0*"
                                 "\0\0\0\x08\0\x02\x01\0\0\x04\0\0\0\x01\0\0\x40\0\x01\x01\0\x03\0"
                                 "\0\0\x01\x40\0\0\0\0\0\0\0";

    static const uint8_t twice[] =
        "II*\0\x08\0\0\0\x03\0\0\x01\x04\0\x01\0\0\0\0\x20\0\0\0\x01\x03\0\x01\0\0\0\x10\0\0\0"
        "\x01\x01\x03\0\x01\0\0\0\x10\0\0\0\0\0\0\0";
    static const uint8_t long8[] = "II*\0\x08\0\0\0\x02\0\0\x01\x10\0\x01\0\0\0\x10\0\0\0"
                                   "\x01\x01\x03\0\x01\0\0\0\x10\0\0\0\0\0\0\0";
    static uint8_t hidden[65536] = "\xFF\xD8\xFF\x01\xFF\xC0\0\x0B\x08\xFF\xFF\xFF\xFE"
                                   "\x01\x01\x11";

    (void)state;
    /* What a decoder takes for the size must be what was looked at. */
    assert_refused(files_write("twice.tif", twice, sizeof twice - 1), CAIRN_BAD_FORMAT,
                   "the width or height is there twice, expected it once");
    assert_refused(files_write("long8.tif", long8, sizeof long8 - 1), CAIRN_BAD_FORMAT,
                   "the width or height is of type 16, expected one SHORT or LONG");
    memcpy(hidden + 2 + 0xFFC0 + 2,
           "\xFF\xC0\0\x0B\x08\0\x10\0\x10\x01\x01\x11\0\xFF\xDA\0\x02xx\xFF\xD9", 21);
    assert_refused(files_write("hidden.jpg", hidden, 2 + 0xFFC0 + 2 + 21), CAIRN_BAD_FORMAT,
                   "expected a JPEG image");
    assert_refused(files_write("a.png", png, sizeof png - 1), CAIRN_FULL, "32769 x 1");
    assert_refused(files_write("a.jpg", jpeg, sizeof jpeg - 1), CAIRN_FULL, "65534 x 65535");
    assert_refused(files_write("a.tif", little, sizeof little - 1), CAIRN_FULL, "32784 x 5");
    assert_refused(files_write("b.tif", big, sizeof big - 1), CAIRN_FULL, "16384 x 16384");
    assert_refused(files_write_text("a.pgm", "P5 # wide\n 99999999999999 1\n255\nxxxx"), CAIRN_FULL,
                   "9999999999 x 1");
    assert_refused(files_write_text("b.pgm", "P5\n1 32769\n255\nxxxxx"), CAIRN_FULL, "1 x 32769");
}

static void test_what_is_no_image(void **state)
{
    static const uint8_t none[] = "II*\0\x08\0\0\0\x01\0\0\x01\x03\0\x01\0\0\0\x10\0\0\0\0\0\0\0";
    static const uint8_t long_entries[] = "II*\0\x08\0\0\0\xFF\xFF\0\x01";

    (void)state;
    assert_refused(files_path("missing.png"), CAIRN_IO, "open");
    assert_refused(files_folder, CAIRN_UNSUPPORTED, "folder");
    assert_int_equal(mkfifo(files_path("pipe.png"), 0666), 0);
    (void)alarm(60);
    assert_refused(files_path("pipe.png"), CAIRN_UNSUPPORTED, "is a pipe or device");
    (void)alarm(0);
    assert_refused(files_write_text("empty", ""), CAIRN_TRUNCATED, "0 bytes");
    assert_refused(files_write_text("text", "hello, world"), CAIRN_BAD_FORMAT, "0x6865");
    assert_refused(files_write_text("a.webp", "RIFF....WEBPVP8 "), CAIRN_BAD_FORMAT,
                   "is a WebP image");
    assert_refused(files_write_text("a.gif", "GIF89a......"), CAIRN_BAD_FORMAT, "is a GIF image");
    assert_refused(files_write_text("a.bmp", "BM.........."), CAIRN_BAD_FORMAT, "is a BMP image");
    assert_refused(files_write_text("a.heic", "...$ftypheic...."), CAIRN_BAD_FORMAT,
                   "is a HEIF image");
    assert_refused(files_write_text("b.heic", "...$ftypmif1...."), CAIRN_BAD_FORMAT,
                   "is a HEIF image");
    assert_refused(files_write_text("a.avif", "...$ftypavif...."), CAIRN_BAD_FORMAT,
                   "is an AVIF image");
    assert_refused(files_write_text("a.gz", "\x1F\x8B.........."), CAIRN_BAD_FORMAT,
                   "is a gzip file");
    assert_refused(files_write_text("b.tif", "II+........."), CAIRN_BAD_FORMAT,
                   "is a BigTIFF image");
    assert_refused(files_write_text("a.svg", "<svg xmlns=\"\">"), CAIRN_BAD_FORMAT,
                   "is an SVG or XML file");
    assert_refused(files_write_text("a.pdf", "%PDF-1.4...."), CAIRN_BAD_FORMAT, "is a PDF file");
    assert_refused(files_write_text("p0", "P0\n8 8\n00000000"), CAIRN_BAD_FORMAT, "0x5030");
    assert_refused(files_write_text("p7", "P7\n8 8\n00000000"), CAIRN_BAD_FORMAT, "0x5037");
    assert_refused(files_write_text("a.pgm", "P5\nwide 4\n255\n"), CAIRN_BAD_FORMAT, "0x77");
    assert_refused(files_write_text("b.pgm", "P5\n# long"), CAIRN_TRUNCATED, "PGM");
    assert_refused(files_write_text("c.pgm", "P5\n0 4\n255\nxxxx"), CAIRN_BAD_FORMAT, "0 x 4");
    assert_refused(files_write("a.tif", none, sizeof none - 1), CAIRN_BAD_FORMAT, "16 x 0");
    assert_refused(files_write("b.tif", long_entries, sizeof long_entries - 1), CAIRN_TRUNCATED,
                   "TIFF");
    assert_refused(files_write("c.tif", "II*\0\0\0\0\0\0\0", 10), CAIRN_TRUNCATED, "TIFF");
    assert_refused(files_write("a.jpg", "\xFF\xD8\xFF\xE0\0\x04xx\xFF\xDA\0\x02xxxx", 16),
                   CAIRN_TRUNCATED, "JPEG");
    assert_refused(files_write("b.jpg", "\xFF\xD8xxxxxxxxxx", 12), CAIRN_TRUNCATED, "JPEG");
    assert_refused(files_write("c.jpg", "\xFF\xD8\xFF\xE0\0\x01xx\xFF\xD9", 10), CAIRN_TRUNCATED,
                   "JPEG");
}

static void test_refusals_in_the_words_of_the_decoder(void **state)
{
    static const uint8_t png[] = "\x89PNG\r\n\x1A\n\0\0\0\x0DIHDR\0\0\0\x01\0\0\0\x01\x08\0\0\0\0\0"
                                 "\0\0\0\0\0\0\0IEND\0\0\0\0";

    (void)state;
    assert_refused(files_write("a.png", png, sizeof png - 1), CAIRN_BAD_FORMAT, "CRC error");
}

/* ---- Without OpenCV ---- */

static void test_without_the_library(void **state)
{
    uint8_t grey[PIXELS] = {0}, strengths[PIXELS];
    float x[PIXELS];
    cairn_vision_image image = {WIDTH, HEIGHT, 1, 1, grey}, got;
    cairn_vision_canny_params params = cairn_vision_canny_default();

    (void)state;
    assert_int_equal(setenv("CAIRN_VISION", files_path("nowhere.so"), 1), 0);
    assert_status(cairn_vision_load(&error), CAIRN_UNSUPPORTED);
    assert_said("libcairn-vision.so", "make vision");
    assert_status(cairn_vision_canny(&image, &params, strengths, "name", &error),
                  CAIRN_UNSUPPORTED);
    assert_said("name", "OpenCV 4");
    assert_status(cairn_vision_gradients(&image, 1, x, x, "name", &error), CAIRN_UNSUPPORTED);
    assert_status(cairn_vision_write(&image, files_path("a.png"), &error), CAIRN_UNSUPPORTED);
    /* Images can be read all the same. */
    assert_ok(cairn_vision_read(&got, files_write_text("a.pgm", "P2\n2 1\n255\n7 9\n"), &error));
    assert_int_equal(got.width, 2);
    assert_int_equal(got.height, 1);
    assert_int_equal(got.channels, 1);
    assert_int_equal(got.sample_bytes, 1);
    assert_int_equal(((uint8_t *)got.samples)[1], 9);
    cairn_vision_free(&got);
    grey[3] = 77;
    assert_ok(cairn_image_write_png(files_path("b.png"), grey, WIDTH, HEIGHT, &error));
    assert_ok(cairn_vision_read_grey(&got, files_path("b.png"), &error));
    assert_memory_equal(got.samples, grey, PIXELS);
    cairn_vision_free(&got);
    assert_refused(files_write_text("b.pgm", "P2\n2 1\n255\n7 x\n"), CAIRN_BAD_FORMAT, "a sample");
    assert_int_equal(unsetenv("CAIRN_VISION"), 0);
}

/* A foreign library is not accepted as it. */
static void test_a_foreign_library(void **state)
{
    (void)state;
    assert_int_equal(setenv("CAIRN_VISION", "libm.so.6", 1), 0);
    assert_status(cairn_vision_load(NULL), CAIRN_UNSUPPORTED);
    assert_int_equal(unsetenv("CAIRN_VISION"), 0);
}

static void test_nothing_is_lost(void **state)
{
    cairn_vision_image got, made = make(1, 1);
    size_t before = 0;

    (void)state;
    need_opencv();
    assert_ok(cairn_vision_write(&made, files_path("a.tif"), &error));
    for (int round = 0; round < FILES_HEAP_ROUNDS; round++) {
        assert_ok(cairn_vision_read_grey(&got, files_path("a.tif"), &error));
        cairn_vision_free(&got);
        assert_status(
            cairn_vision_read_grey(&got, files_write_text("a.pgm", "P5\n9 9\n255\nx"), &error),
            CAIRN_TRUNCATED);
        assert_ok(cairn_vision_write(&made, files_path("b.png"), &error));
        if (round == 4)
            before = files_heap();
    }
    assert_true(files_heap() <= before + FILES_HEAP_NOISE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_what_is_written_comes_back),
        cmocka_unit_test(test_jpeg_comes_back_nearly),
        cmocka_unit_test(test_orientation),
        cmocka_unit_test(test_nothing_half_written),
        cmocka_unit_test(test_grey),
        cmocka_unit_test(test_alpha),
        cmocka_unit_test(test_ground_by_the_mean),
        cmocka_unit_test(test_few_bits_in_16),
        cmocka_unit_test(test_kinds_of_tiff),
        cmocka_unit_test(test_palettes_and_planes_of_tiff),
        cmocka_unit_test(test_kinds_of_pbm),
        cmocka_unit_test(test_kinds_of_pnm),
        cmocka_unit_test(test_orientation_of_png),
        cmocka_unit_test(test_kinds_of_jpeg),
        cmocka_unit_test(test_grab),
        cmocka_unit_test(test_edges_of_a_step),
        cmocka_unit_test(test_slopes_of_a_ramp),
        cmocka_unit_test(test_refused_edges),
        cmocka_unit_test(test_every_cut_is_reported),
        cmocka_unit_test(test_damage_is_survived),
        cmocka_unit_test(test_giants_are_refused_unread),
        cmocka_unit_test(test_what_is_no_image),
        cmocka_unit_test(test_refusals_in_the_words_of_the_decoder),
        cmocka_unit_test(test_without_the_library),
        cmocka_unit_test(test_a_foreign_library),
        cmocka_unit_test(test_nothing_is_lost),
    };

    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
