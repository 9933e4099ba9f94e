/* map_server maps: round trips, the meaning of pixels, images of all kinds, bad files. */
#include "tests/files.h"

#include <math.h>
#include <png.h>
#include <zlib.h>

#include "cairn/map_file.h"
#include "src/host/files/map_file_image.h"

/* What builds without libpng have, beside what this build has. */
CAIRN_CHECKED cairn_status plain_decode_png(cairn_png_samples *image,
                                            const cairn_png_source *source, int32_t is_picture);
CAIRN_CHECKED cairn_status plain_encode_png(uint8_t **bytes, size_t *count, const uint8_t *pixel,
                                            int32_t width, int32_t height, int32_t channels);
#define cairn_png_decode       plain_decode_png
#define cairn_image_encode_png plain_encode_png
#include "src/host/files/map_file_png_plain.c"
#undef cairn_png_decode
#undef cairn_image_encode_png

#define NUMBERS                                                                                    \
    "resolution: 0.05\norigin: [-10, 5.5, 0.25]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: "  \
    "0.196\n"

/* Take the place of libyaml's: no memory after a number of calls. */
static int64_t yaml_left = INT64_MAX;
void *yaml_malloc(size_t size);
void *yaml_malloc(size_t size)
{
    return yaml_left-- > 0 ? malloc(size > 0 ? size : 1) : NULL;
}

void *yaml_realloc(void *bytes, size_t size);
void *yaml_realloc(void *bytes, size_t size)
{
    return yaml_left-- > 0 ? realloc(bytes, size > 0 ? size : 1) : NULL;
}

static void test_round_trips(void **state)
{
    cairn_random random = cairn_random_seed(6, 6);
    cairn_file_error error;

    (void)state;
    for (int round = 0; round < 8; round++) {
        cairn_map_file map = cairn_map_file_default(), back;
        size_t count = 37 * 23;
        const char *path = files_path("map.v1.yaml");
        char *image;

        assert_ok(cairn_map_file_allocate(&map, 37, 23));
        map.resolution = CAIRN_REAL(0.025);
        map.origin.x = CAIRN_REAL(-1.0) / 3;
        map.origin.y = 7;
        map.origin.theta = CAIRN_REAL(0.1);
        map.negate = round % 2;
        map.mode = round % 4 < 2 ? CAIRN_MAP_FILE_TRINARY : CAIRN_MAP_FILE_RAW;
        map.occupied_threshold = CAIRN_REAL(0.7);
        map.free_threshold = CAIRN_REAL(0.2);
        for (size_t i = 0; i < count; i++) {
            int32_t kind = cairn_random_below(&random, 3);

            if (map.mode == CAIRN_MAP_FILE_RAW)
                map.occupancy[i] = (int8_t)(cairn_random_below(&random, 102) - 1);
            else
                map.occupancy[i] = (int8_t)(kind == 0 ? -1 : kind == 1 ? 0 : 100);
        }
        assert_ok(cairn_map_file_draw(&map));
        assert_ok(cairn_map_file_write(
            &map, path, round < 4 ? CAIRN_MAP_FILE_PGM : CAIRN_MAP_FILE_PNG, &error));
        image = files_read(files_path(round < 4 ? "map.v1.pgm" : "map.v1.png"), NULL);
        assert_memory_equal(image, round < 4 ? "P5\n" : "\x89PN", 3);
        free(image);
        error.status = 77; /* unchanged when all goes well */
        assert_ok(cairn_map_file_read(&back, path, &error));
        assert_int_equal(error.status, 77);
        assert_int_equal(back.width, 37);
        assert_int_equal(back.height, 23);
        assert_memory_equal(&back.resolution, &map.resolution, sizeof map.resolution);
        assert_memory_equal(&back.origin, &map.origin, sizeof map.origin);
        assert_memory_equal(&back.occupied_threshold, &map.occupied_threshold,
                            sizeof map.occupied_threshold);
        assert_memory_equal(&back.free_threshold, &map.free_threshold, sizeof map.free_threshold);
        assert_int_equal(back.negate, map.negate);
        assert_int_equal(back.mode, map.mode);
        assert_memory_equal(back.pixel, map.pixel, count);
        assert_memory_equal(back.occupancy, map.occupancy, count);
        cairn_map_file_free(&map);
        cairn_map_file_free(&back);
        assert_null(back.pixel);
        assert_null(back.occupancy);
        assert_int_equal(back.width, 0);
        assert_int_equal(back.height, 0);
    }
}

/* The image's first row is the map's last. */
static void test_rows_are_turned(void **state)
{
    const char *path = files_write_text("turned.yaml", "image: t\n" NUMBERS);
    cairn_map_file map;

    (void)state;
    (void)files_write("t", "P5\n2 3\n255\n\x00\x01\x02\x03\x04\x05", 17);
    assert_ok(cairn_map_file_read(&map, path, NULL));
    assert_int_equal(map.width, 2);
    assert_int_equal(map.height, 3);
    assert_memory_equal(map.pixel, "\x04\x05\x02\x03\x00\x01", 6);
    assert_near(map.resolution, 0.05, 1e-7);
    assert_near(map.origin.x, -10, 0);
    assert_near(map.origin.y, 5.5, 0);
    assert_near(map.origin.theta, 0.25, 0);
    cairn_map_file_free(&map);
}

/* Occupancy of a map whose one row holds the grey levels 0 .. 255. */
static void read_ramp(cairn_map_file *map, const char *yaml)
{
    unsigned char ramp[300] = "P5 256 1 255\n";
    cairn_file_error error;

    for (int i = 0; i < 256; i++)
        ramp[13 + i] = (unsigned char)i;
    (void)files_write("ramp.pgm", ramp, 13 + 256);
    assert_ok(cairn_map_file_read(map, files_write_text("ramp.yaml", yaml), &error));
    assert_int_equal(map->width, 256);
}

static void test_meaning_of_pixels(void **state)
{
    cairn_map_file map;

    (void)state;
    read_ramp(&map, "image: ramp.pgm\n" NUMBERS);
    assert_int_equal(map.mode, CAIRN_MAP_FILE_TRINARY);
    for (int v = 0; v < 256; v++) {
        double p = (255 - v) / 255.0;

        assert_int_equal(map.occupancy[v], p > 0.65 ? 100 : p < 0.196 ? 0 : -1);
    }
    assert_int_equal(map.occupancy[205], -1);
    assert_int_equal(map.occupancy[254], 0);
    cairn_map_file_free(&map);

    read_ramp(&map, "image: ramp.pgm\nresolution: 1\norigin: [0,0,0]\nnegate: 1\noccupied_thresh: "
                    "0.5\nfree_thresh: "
                    "0.25\nmode: scale\n");
    assert_int_equal(map.mode, CAIRN_MAP_FILE_SCALE);
    for (int v = 0; v < 256; v++) {
        double p = v / 255.0;

        assert_int_equal(map.occupancy[v], p > 0.5    ? 100
                                           : p < 0.25 ? 0
                                                      : (int)(1 + 98 * (p - 0.25) / 0.25));
    }
    assert_status(cairn_map_file_draw(&map), CAIRN_UNSUPPORTED);
    cairn_map_file_free(&map);

    read_ramp(&map, "image: ramp.pgm\nresolution: 1\norigin: [0,0,0]\nnegate: 0\noccupied_thresh: "
                    "0.2\nfree_thresh: "
                    "0.2\nmode: scale\n");
    assert_int_equal(map.occupancy[204], 1);
    assert_int_equal(map.occupancy[203], 100);
    assert_int_equal(map.occupancy[205], 0);
    cairn_map_file_free(&map);

    read_ramp(&map, "image: ramp.pgm\nresolution: 1\norigin: [0,0,0]\nnegate: "
                    "true\noccupied_thresh: 0.5\nfree_thresh: "
                    "0.25\nmode: raw\n");
    for (int v = 0; v < 256; v++)
        assert_int_equal(map.occupancy[v], v <= 100 ? v : -1);
    cairn_map_file_free(&map);
}

/* Occupancies that are not -1, 0 or 100 are drawn by the thresholds. */
static void test_draw(void **state)
{
    cairn_map_file map = cairn_map_file_default();

    (void)state;
    assert_near(map.resolution, 0.05, 1e-8);
    assert_near(map.occupied_threshold, 0.65, 1e-7);
    assert_near(map.free_threshold, 0.196, 1e-8);
    assert_ok(cairn_map_file_allocate(&map, 6, 1));
    for (int i = 0; i < 6; i++) {
        assert_int_equal(map.occupancy[i], -1);
        assert_int_equal(map.pixel[i], 205);
    }
    memcpy(map.occupancy, "\x00\x13\x14\x41\x42\x64", 6); /* 0 19 20 65 66 100 */
    map.occupied_threshold = CAIRN_REAL(0.655);
    assert_ok(cairn_map_file_draw(&map));
    assert_memory_equal(map.pixel, "\xfe\xfe\xcd\xcd\x00\x00", 6);
    map.negate = 1;
    assert_ok(cairn_map_file_draw(&map));
    assert_memory_equal(map.pixel, "\x01\x01\x32\x32\xff\xff", 6);
    map.mode = CAIRN_MAP_FILE_RAW;
    map.occupancy[1] = -1;
    map.occupancy[2] = 101;
    assert_ok(cairn_map_file_draw(&map));
    assert_memory_equal(map.pixel, "\x00\xff\xff\x41\x42\x64", 6);

    /* On a threshold: neither free nor occupied; 205 in both modes. */
    map.mode = CAIRN_MAP_FILE_TRINARY;
    map.negate = 0;
    map.free_threshold = map.occupied_threshold = CAIRN_REAL(0.5);
    memcpy(map.occupancy, "\x00\x31\x32\x32\x33\xff", 6); /* 0 49 50 50 51 -1 */
    assert_ok(cairn_map_file_draw(&map));
    assert_memory_equal(map.pixel, "\xfe\xfe\x7f\x7f\x00\x7f", 6);
    map.free_threshold = CAIRN_REAL(50.0) / 255;
    assert_ok(cairn_map_file_draw(&map));
    assert_int_equal(map.pixel[5], 205);
    map.occupied_threshold = map.free_threshold;
    map.free_threshold = CAIRN_REAL(0.125);
    assert_ok(cairn_map_file_draw(&map));
    assert_int_equal(map.pixel[5], 205);
    /* Halfway: 153.45 of 255. */
    map.free_threshold = CAIRN_REAL(0.5);
    map.occupied_threshold = CAIRN_REAL(0.70353);
    assert_ok(cairn_map_file_draw(&map));
    assert_int_equal(map.pixel[5], 102);
    map.negate = 1;
    assert_ok(cairn_map_file_draw(&map));
    assert_int_equal(map.pixel[5], 153);
    cairn_map_file_free(&map);

    assert_status(cairn_map_file_allocate(&map, 0, 1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_file_allocate(&map, 1, -1), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_file_allocate(&map, 1 << 20, (1 << 8) + 1), CAIRN_FULL);
    assert_null(map.pixel);
}

static void test_plain_pgm_and_comments(void **state)
{
    cairn_image image;

    (void)state;
    assert_ok(cairn_image_read(
        &image,
        files_write_text("p2.pgm",
                         "P2\n# made by hand\n 3 # wide\n2\n255\n0 1 2\n# middle\n253 254\t255"),
        NULL));
    assert_int_equal(image.width, 3);
    assert_int_equal(image.height, 2);
    assert_memory_equal(image.pixel, "\x00\x01\x02\xfd\xfe\xff", 6);
    assert_null(image.alpha);
    cairn_image_free(&image);
    assert_ok(
        cairn_image_read(&image, files_write("p5.pgm", "P5 # x\n1\r\n2 255\n\n#more", 23), NULL));
    assert_memory_equal(image.pixel, "\n#", 2);
    cairn_image_free(&image);
}

/* A PNG of any kind through libpng. */
static const char *write_png(const char *name, int width, int height, int bits, int colour,
                             int interlace, unsigned char *row)
{
    static const png_color palette[3] = {{0, 0, 0}, {30, 60, 90}, {255, 255, 255}};
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
    png_infop info = png_create_info_struct(png);
    const char *path = files_path(name);
    FILE *file = fopen(path, "wb");
    png_bytep rows[64];

    assert_non_null(file);
    png_init_io(png, file);
    png_set_IHDR(png, info, (png_uint_32)width, (png_uint_32)height, bits, colour, interlace,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    if (colour == PNG_COLOR_TYPE_PALETTE)
        png_set_PLTE(png, info, palette, 3);
    png_set_gAMA(png, info, 1.0);
    png_write_info(png, info);
    for (int y = 0; y < height; y++)
        rows[y] = row + (size_t)y * png_get_rowbytes(png, info);
    png_write_image(png, rows);
    png_write_end(png, NULL);
    png_destroy_write_struct(&png, &info);
    assert_int_equal(fclose(file), 0);
    return path;
}

static void test_png_kinds(void **state)
{
    unsigned char grey16[] = {0x12, 0xff, 0xfe, 0x01}, rgb[] = {0, 1, 1, 10, 20, 31, 255, 255, 255},
                  palette[] = {0, 1, 2};
    unsigned char bits[] = {0xa0}, grey_alpha[] = {9, 255, 8, 0},
                  rgba[] = {3, 4, 6, 7, 90, 90, 90, 0}, many[64 * 64];
    cairn_image image;

    (void)state;
    assert_ok(cairn_image_read(&image, write_png("a.png", 2, 1, 16, PNG_COLOR_TYPE_GRAY, 0, grey16),
                               NULL));
    assert_memory_equal(image.pixel, "\x12\xfe", 2);
    cairn_image_free(&image);
    assert_ok(
        cairn_image_read(&image, write_png("a.png", 3, 1, 8, PNG_COLOR_TYPE_RGB, 0, rgb), NULL));
    assert_memory_equal(image.pixel, "\x01\x14\xff", 3);
    assert_null(image.alpha);
    cairn_image_free(&image);
    assert_ok(cairn_image_read(
        &image, write_png("a.png", 3, 1, 8, PNG_COLOR_TYPE_PALETTE, 0, palette), NULL));
    assert_memory_equal(image.pixel, "\x00\x3c\xff", 3);
    cairn_image_free(&image);
    assert_ok(
        cairn_image_read(&image, write_png("a.png", 4, 1, 1, PNG_COLOR_TYPE_GRAY, 0, bits), NULL));
    assert_memory_equal(image.pixel, "\xff\x00\xff\x00", 4);
    cairn_image_free(&image);
    assert_ok(cairn_image_read(
        &image, write_png("a.png", 2, 1, 8, PNG_COLOR_TYPE_GRAY_ALPHA, 0, grey_alpha), NULL));
    assert_memory_equal(image.pixel, "\x09\x08", 2);
    assert_memory_equal(image.alpha, "\xff\x00", 2);
    cairn_image_free(&image);
    assert_ok(cairn_image_read(
        &image, write_png("a.png", 2, 1, 8, PNG_COLOR_TYPE_RGB_ALPHA, 0, rgba), NULL));
    assert_memory_equal(image.pixel, "\x04\x5a", 2);
    assert_memory_equal(image.alpha, "\x07\x00", 2);
    cairn_image_free(&image);
    for (size_t i = 0; i < sizeof many; i++)
        many[i] = (unsigned char)(i * 7 + i / 64);
    assert_ok(cairn_image_read(
        &image, write_png("a.png", 64, 64, 8, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_ADAM7, many),
        NULL));
    assert_memory_equal(image.pixel, many, sizeof many);
    cairn_image_free(&image);
}

/* A transparent pixel is unknown, whatever its colour. */
static void test_transparent_is_unknown(void **state)
{
    unsigned char grey_alpha[] = {255, 255, 255, 0, 0, 0, 0, 1};
    const char *path = files_write_text("alpha.yaml", "image: alpha.png\n" NUMBERS);
    cairn_map_file map;

    (void)state;
    (void)write_png("alpha.png", 4, 1, 8, PNG_COLOR_TYPE_GRAY_ALPHA, 0, grey_alpha);
    assert_ok(cairn_map_file_read(&map, path, NULL));
    assert_int_equal(map.occupancy[0], 0);
    assert_int_equal(map.occupancy[1], -1);
    assert_int_equal(map.occupancy[2], -1);
    assert_int_equal(map.occupancy[3], 100);
    cairn_map_file_free(&map);
}

static void test_bad_images(void **state)
{
    static const struct {
        const char *text;
        size_t count;
        cairn_status status;
        int line;
        const char *piece;
    } sample[] = {
        {"", 0, CAIRN_TRUNCATED, 0, "the file has 0 bytes, expected an image"},
        {"P", 1, CAIRN_TRUNCATED, 0, "the file has 1 bytes"},
        {"P6 1 1 255\nabc", 14, CAIRN_BAD_FORMAT, 0,
         "begins with the bytes 0x5036, expected a PGM (P5 or P2) or PNG image"},
        {"GIF89a", 6, CAIRN_BAD_FORMAT, 0, "begins with"},
        {"P5\n", 3, CAIRN_TRUNCATED, 2, "the file ends early, expected the width"},
        {"P5 1", 4, CAIRN_TRUNCATED, 1, "expected the height"},
        {"P5 1 1\n", 7, CAIRN_TRUNCATED, 2, "expected the highest grey level"},
        {"P5\n# c\nx 1 255\n", 15, CAIRN_BAD_FORMAT, 3,
         "byte 0x78, expected the width of the image"},
        {"P5 1 1 65535\nab", 15, CAIRN_UNSUPPORTED, 2,
         "the highest grey level is 65535, expected 255"},
        {"P5 1 1 15\na", 11, CAIRN_UNSUPPORTED, 2, "is 15, expected 255"},
        {"P5 0 1 255\n", 11, CAIRN_BAD_FORMAT, 2, "has 0 x 1 pixels"},
        {"P5 1 0 255\n", 11, CAIRN_BAD_FORMAT, 2, "has 1 x 0 pixels"},
        {"P5 1000000 1000000 255\nabc", 26, CAIRN_FULL, 2,
         "1000000 x 1000000 pixels, expected at most 268435456"},
        {"P5 99999999999999999999 1 255\na", 31, CAIRN_FULL, 2, "pixels, expected at most"},
        {"P5 2 2 255\nabc", 14, CAIRN_TRUNCATED, 0, "the file ends after 3 of 4 pixels"},
        {"P2\n2 1 255\n7", 12, CAIRN_TRUNCATED, 3, "expected a pixel"},
        {"P2\n2 1 255\n7 256\n", 17, CAIRN_BAD_FORMAT, 4, "pixel 2 is 256, expected at most 255"},
        {"P2\n2 1 255\n7 -1\n", 16, CAIRN_BAD_FORMAT, 3, "byte 0x2d, expected a pixel"},
        {"\x89PNG\r\n\x1a\n", 8, CAIRN_TRUNCATED, 0, "the PNG data are damaged or cut"},
        {"\x89PNGarbage and more of it, much more of it", 42, CAIRN_BAD_FORMAT, 0,
         "the PNG data are damaged or cut"},
    };
    cairn_file_error error;
    cairn_image image;

    (void)state;
    for (size_t i = 0; i < sizeof sample / sizeof *sample; i++) {
        if (cairn_image_read(&image, files_write("bad.img", sample[i].text, sample[i].count),
                             &error) != sample[i].status ||
            error.line != sample[i].line || strstr(error.text, sample[i].piece) == NULL)
            fail_msg("image %zu: \"%s\"", i, error.text);
        assert_null(image.pixel);
    }
    assert_status(cairn_image_read(&image, files_path("none.pgm"), &error), CAIRN_IO);
    assert_holds(error.text, "none.pgm: cannot open: No such file");
    assert_status(cairn_image_read(&image, files_folder, &error), CAIRN_UNSUPPORTED);
    assert_holds(error.text, ": is a folder, expected a regular file");
}

/* A pipe without a writer would block a reader: it is refused. */
static void test_pipes(void **state)
{
    cairn_file_error error;
    cairn_image image;
    cairn_map_file map;

    (void)state;
    assert_int_equal(mkfifo(files_path("pipe"), 0666), 0);
    (void)alarm(60);
    assert_status(cairn_image_read(&image, files_path("pipe"), &error), CAIRN_UNSUPPORTED);
    assert_holds(error.text, "/pipe: is a pipe or device, expected a regular file");
    assert_status(cairn_map_file_read(&map, files_path("pipe"), &error), CAIRN_UNSUPPORTED);
    assert_holds(error.text, "/pipe: is a pipe or device, expected a regular file");
    assert_status(
        cairn_map_file_read(&map, files_write_text("p.yaml", "image: pipe\n" NUMBERS), &error),
        CAIRN_UNSUPPORTED);
    assert_holds(error.text, "/pipe: is a pipe or device, expected a regular file");
    (void)alarm(0);
}

/* A PNG truncated or damaged anywhere is refused or, where the rest suffices, read whole. */
static void test_cut_png(void **state)
{
    unsigned char pixel[50 * 40];
    size_t size = 0;
    cairn_image image;
    cairn_file_error error;
    char *bytes;

    (void)state;
    for (size_t i = 0; i < sizeof pixel; i++)
        pixel[i] = (unsigned char)(i * i / 5);
    assert_ok(cairn_image_write_png(files_path("cut.png"), pixel, 50, 40, &error));
    bytes = files_read(files_path("cut.png"), &size);
    for (size_t cut = 8; cut < size; cut += 13) {
        assert_status(cairn_image_read(&image, files_write("cut2.png", bytes, cut), &error),
                      CAIRN_TRUNCATED);
        assert_null(image.pixel);
    }
    for (size_t at = 8; at < size; at++) {
        cairn_status status;

        bytes[at] = (char)(bytes[at] ^ 0x10);
        status = cairn_image_read(&image, files_write("cut2.png", bytes, size), &error);
        bytes[at] = (char)(bytes[at] ^ 0x10);
        if (status == CAIRN_OK)
            assert_memory_equal(image.pixel, pixel, sizeof pixel);
        cairn_image_free(&image);
    }
    free(bytes);
}

static void test_bad_descriptions(void **state)
{
    static const struct {
        const char *text;
        cairn_status status;
        int line;
        const char *piece;
    } sample[] = {
        {"", CAIRN_EMPTY, 0, "the file is empty"},
        {"# nothing\n", CAIRN_EMPTY, 0, "the file is empty"},
        {"just words\n", CAIRN_BAD_FORMAT, 1, "no \"key: value\" lines"},
        {"- a\n- b\n", CAIRN_BAD_FORMAT, 1, "no \"key: value\" lines"},
        {"image: [a\n", CAIRN_BAD_FORMAT, 2, "did not find expected ',' or ']', expected YAML"},
        {"a: b: c\n", CAIRN_BAD_FORMAT, 1, "expected YAML"},
        {NUMBERS, CAIRN_BAD_FORMAT, 1, "no key \"image\""},
        {"image: one.pgm\n", CAIRN_BAD_FORMAT, 1, "no key \"resolution\""},
        {"image: one.pgm\nresolution: 1\nnegate: 0\n", CAIRN_BAD_FORMAT, 1, "no key \"origin\""},
        {"image: one.pgm\nresolution: 1\norigin: [0,0,0]\n", CAIRN_BAD_FORMAT, 1,
         "no key \"negate\""},
        {"image: one.pgm\nresolution: 1\norigin: [0,0,0]\nnegate: 0\n", CAIRN_BAD_FORMAT, 1,
         "no key \"occupied_thresh\""},
        {"image: one.pgm\nresolution: 1\norigin: [0,0,0]\nnegate: 0\noccupied_thresh: 1\n",
         CAIRN_BAD_FORMAT, 1, "no key \"free_thresh\""},
        {"image: one.pgm\nimage: one.pgm\n" NUMBERS, CAIRN_BAD_FORMAT, 2, "image is there twice"},
        {"image: one.pgm\nresolution: big\norigin: [0,0,0]\nnegate: 0\noccupied_thresh: "
         "1\nfree_thresh: 0\n",
         CAIRN_BAD_FORMAT, 2, "resolution is \"big\", expected metres per pixel above 0"},
        {"image: one.pgm\nresolution: 0\norigin: [0,0,0]\nnegate: 0\noccupied_thresh: "
         "1\nfree_thresh: 0\n",
         CAIRN_BAD_FORMAT, 2, "resolution is \"0\""},
        {"image: one.pgm\nresolution: nan\norigin: [0,0,0]\nnegate: 0\noccupied_thresh: "
         "1\nfree_thresh: 0\n",
         CAIRN_BAD_FORMAT, 2, "resolution is \"nan\""},
        {"image: one.pgm\nresolution: [1]\norigin: [0,0,0]\nnegate: 0\noccupied_thresh: "
         "1\nfree_thresh: 0\n",
         CAIRN_BAD_FORMAT, 2, "resolution is a list"},
        {"image: one.pgm\nresolution: {a: 1}\norigin: [0,0,0]\nnegate: 0\noccupied_thresh: "
         "1\nfree_thresh: 0\n",
         CAIRN_BAD_FORMAT, 2, "resolution is a mapping"},
        {"image: one.pgm\nresolution: 1\norigin: 0\nnegate: 0\noccupied_thresh: 1\nfree_thresh: "
         "0\n",
         CAIRN_BAD_FORMAT, 3, "origin is \"0\", expected a list of three finite numbers"},
        {"image: one.pgm\nresolution: 1\norigin: [0,0]\nnegate: 0\noccupied_thresh: "
         "1\nfree_thresh: 0\n",
         CAIRN_BAD_FORMAT, 3, "origin has 2 elements"},
        {"image: one.pgm\nresolution: 1\norigin: [0,0,0,0]\nnegate: 0\noccupied_thresh: "
         "1\nfree_thresh: 0\n",
         CAIRN_BAD_FORMAT, 3, "origin has 4 elements"},
        {"image: one.pgm\nresolution: 1\norigin: [0,\n x,0]\nnegate: 0\noccupied_thresh: "
         "1\nfree_thresh: 0\n",
         CAIRN_BAD_FORMAT, 4, "origin is \"x\""},
        {"image: one.pgm\nresolution: 1\norigin: [0,0,.inf]\nnegate: 0\noccupied_thresh: "
         "1\nfree_thresh: 0\n",
         CAIRN_BAD_FORMAT, 3, "origin is \".inf\""},
        {"image: one.pgm\nresolution: 1\norigin: [0,0,inf]\nnegate: 0\noccupied_thresh: "
         "1\nfree_thresh: 0\n",
         CAIRN_BAD_FORMAT, 3, "origin is \"inf\""},
        {"image: one.pgm\nresolution: 1\norigin: [0,0,0]\nnegate: 2\noccupied_thresh: "
         "1\nfree_thresh: 0\n",
         CAIRN_BAD_FORMAT, 4, "negate is \"2\", expected 0 or 1"},
        {"image: one.pgm\nresolution: 1\norigin: [0,0,0]\nnegate: [1]\noccupied_thresh: "
         "1\nfree_thresh: 0\n",
         CAIRN_BAD_FORMAT, 4, "negate is a list"},
        {"image: one.pgm\nresolution: 1\norigin: [0,0,0]\nnegate: 0\noccupied_thresh: "
         "1.5\nfree_thresh: 0\n",
         CAIRN_BAD_FORMAT, 5, "occupied_thresh is \"1.5\", expected a number from 0 to 1"},
        {"image: one.pgm\nresolution: 1\norigin: [0,0,0]\nnegate: 0\noccupied_thresh: "
         "0.5\nfree_thresh: -0.1\n",
         CAIRN_BAD_FORMAT, 6, "free_thresh is \"-0.1\""},
        {"image: one.pgm\nresolution: 1\norigin: [0,0,0]\nnegate: 0\noccupied_thresh: "
         "0.5\nfree_thresh: 0.6\n",
         CAIRN_BAD_FORMAT, 6, "free_thresh is \"0.6\", expected at most occupied_thresh"},
        {"image: one.pgm\nmode: fancy\n" NUMBERS, CAIRN_BAD_FORMAT, 2,
         "mode is \"fancy\", expected trinary, scale or raw"},
        {"image: ''\n" NUMBERS, CAIRN_BAD_FORMAT, 1,
         "image is \"\", expected the path of an image"},
        {"image: [a]\n" NUMBERS, CAIRN_BAD_FORMAT, 1, "image is a list"},
        {NUMBERS "image: missing.pgm\n", CAIRN_IO, 6, "missing.pgm: cannot open: No such file"},
        {NUMBERS "image: broken.pgm\n", CAIRN_TRUNCATED, 6,
         "broken.pgm: the file ends after 1 of 4 pixels"},
    };
    cairn_file_error error;
    cairn_map_file map;

    (void)state;
    (void)files_write_text("one.pgm", "P5 1 1 255\na");
    (void)files_write_text("broken.pgm", "P5 2 2 255\na");
    for (size_t i = 0; i < sizeof sample / sizeof *sample; i++) {
        if (cairn_map_file_read(&map, files_write_text("bad.yaml", sample[i].text), &error) !=
                sample[i].status ||
            error.line != sample[i].line || strstr(error.text, sample[i].piece) == NULL ||
            strstr(error.text, "bad.yaml:") == NULL)
            fail_msg("description %zu: \"%s\"", i, error.text);
        assert_null(map.pixel);
        assert_null(map.occupancy);
    }
    assert_status(cairn_map_file_read(&map, files_path("none.yaml"), &error), CAIRN_IO);
    assert_status(cairn_map_file_read(&map, files_folder, &error), CAIRN_UNSUPPORTED);
    /* Foreign keys, one that is not a word, and an absolute path are accepted. */
    {
        char text[1024];

        (void)snprintf(text, sizeof text, "[1, 2]: x\nname: y\nimage: %s\nmode: raw\n" NUMBERS,
                       files_path("one.pgm"));
        assert_ok(cairn_map_file_read(&map, files_write_text("good.yaml", text), &error));
        assert_int_equal(map.occupancy[0], 'a');
        cairn_map_file_free(&map);
    }
}

static void test_maps_that_cannot_be_written(void **state)
{
    cairn_map_file good = cairn_map_file_default(), map;
    const char *path = files_path("refused.yaml");
    cairn_file_error error;

    (void)state;
    assert_status(cairn_map_file_write(&good, path, CAIRN_MAP_FILE_PGM, &error),
                  CAIRN_BAD_ARGUMENT);
    assert_holds(error.text, "refused.yaml: not written: no cells");
    assert_int_equal(error.line, 0);
    assert_ok(cairn_map_file_allocate(&good, 2, 2));
    map = good;
    map.height = 0;
    assert_status(cairn_map_file_write(&map, path, CAIRN_MAP_FILE_PGM, &error), CAIRN_BAD_ARGUMENT);
    map = good;
    map.resolution = 0;
    assert_status(cairn_map_file_write(&map, path, CAIRN_MAP_FILE_PGM, &error), CAIRN_BAD_ARGUMENT);
    map.resolution = (cairn_real)INFINITY;
    assert_status(cairn_map_file_write(&map, path, CAIRN_MAP_FILE_PGM, &error), CAIRN_BAD_ARGUMENT);
    map = good;
    map.free_threshold = CAIRN_REAL(0.7);
    assert_status(cairn_map_file_write(&map, path, CAIRN_MAP_FILE_PGM, &error), CAIRN_BAD_ARGUMENT);
    map.free_threshold = CAIRN_REAL(-0.7);
    assert_status(cairn_map_file_write(&map, path, CAIRN_MAP_FILE_PGM, &error), CAIRN_BAD_ARGUMENT);
    map = good;
    map.occupied_threshold = CAIRN_REAL(1.1);
    assert_status(cairn_map_file_write(&map, path, CAIRN_MAP_FILE_PGM, &error), CAIRN_BAD_ARGUMENT);
    map = good;
    map.mode = 3;
    assert_status(cairn_map_file_write(&map, path, CAIRN_MAP_FILE_PGM, &error), CAIRN_BAD_ARGUMENT);
    map = good;
    map.negate = 2;
    assert_status(cairn_map_file_write(&map, path, CAIRN_MAP_FILE_PGM, &error), CAIRN_BAD_ARGUMENT);
    assert_status(cairn_map_file_write(&good, path, 2, &error), CAIRN_BAD_ARGUMENT);
    map = good;
    map.origin.theta = (cairn_real)NAN;
    assert_status(cairn_map_file_write(&map, path, CAIRN_MAP_FILE_PGM, &error), CAIRN_NOT_FINITE);
    assert_holds(error.text, "refused.yaml: not written: an origin");
    assert_int_equal(error.line, 0);
    assert_status(
        cairn_map_file_write(&good, files_path("no/folder.yaml"), CAIRN_MAP_FILE_PGM, &error),
        CAIRN_IO);
    assert_status(
        cairn_map_file_write(&good, files_path("no/folder.yaml"), CAIRN_MAP_FILE_PNG, &error),
        CAIRN_IO);
    assert_int_equal(access(path, F_OK), -1);
    cairn_map_file_free(&good);
}

/* Grey, RGB and RGBA, as in their headers and as read back; sides of 0 are refused. */
static void check_encoder(cairn_status (*encode)(uint8_t **bytes, size_t *count,
                                                 const uint8_t *pixel, int32_t width,
                                                 int32_t height, int32_t channels))
{
    static const uint8_t pixel[2 * 3 * 4] = {10, 20, 33, 40, 50, 60, 70, 80, 90, 100, 110, 120,
                                             7,  8,  9,  0,  1,  2,  3,  4,  5,  6,   255, 254};
    static const int colour_type[] = {0, 0, 0, 2, 6};
    static const uint8_t grey[5][6] = {
        {0}, {10, 20, 33, 40, 50, 60}, {0}, {21, 50, 80, 110, 8, 1}, {21, 60, 100, 8, 2, 89}};
    uint8_t *bytes = NULL;
    cairn_image image;
    size_t count = 0;

    for (int32_t channels = 1; channels <= 4; channels++) {
        if (channels == 2)
            continue;
        assert_ok(encode(&bytes, &count, pixel, 3, 2, channels));
        assert_int_equal(bytes[25], colour_type[channels]);
        assert_ok(cairn_image_read(&image, files_write("encoded.png", bytes, count), NULL));
        assert_int_equal(image.width, 3);
        assert_int_equal(image.height, 2);
        assert_memory_equal(image.pixel, grey[channels], 6);
        assert_int_equal(image.alpha != NULL, channels == 4);
        if (channels == 4)
            assert_memory_equal(image.alpha, "\x28\x50\x78\x00\x04\xfe", 6);
        cairn_image_free(&image);
        free(bytes);
    }
    assert_status(encode(&bytes, &count, pixel, 0, 2, 1), CAIRN_NO_MEMORY);
    assert_null(bytes);
    assert_int_equal(count, 0);
}

static void test_encode_png(void **state)
{
    (void)state;
    check_encoder(cairn_image_encode_png);
    check_encoder(plain_encode_png);
}

static void test_no_libpng(void **state)
{
    cairn_file_error error;
    cairn_png_source source = {.path = "a.png", .error = &error};
    cairn_png_samples samples;

    (void)state;
    assert_status(plain_decode_png(&samples, &source, 0), CAIRN_UNSUPPORTED);
    assert_holds(error.text, "a.png: is a PNG image");
}

/* A header of the largest number of pixels is accepted, one row more is refused. */
static void test_huge_png(void **state)
{
    unsigned char bytes[] =
        "\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\1\0\0\0\0\x10\0\x08\0\0\0\0....\0\0\0\0IDAT....";
    cairn_file_error error;
    cairn_image image;

    (void)state;
    for (int over = 0; over < 2; over++) {
        uint32_t sum;

        bytes[23] = (unsigned char)over; /* 2^16 columns and 2^12 rows or one more */
        sum = (uint32_t)crc32(0, bytes + 12, 17);
        for (int i = 0; i < 4; i++)
            bytes[29 + i] = (unsigned char)(sum >> (24 - 8 * i));
        assert_status(
            cairn_image_read(&image, files_write("huge.png", bytes, sizeof bytes - 1), &error),
            over ? CAIRN_FULL : CAIRN_BAD_FORMAT);
        assert_null(image.pixel);
    }
    assert_int_equal(error.line, 0);
    assert_holds(error.text,
                 "huge.png: the image has 65536 x 4097 pixels, expected at most 268435456");
}

/* Colours and alpha count: the decoder holds all samples. */
static void test_huge_rgba(void **state)
{
    unsigned char bytes[] =
        "\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\x20\0\0\0\x20\0\x08\x06\0\0\0....\0\0\0\0IDAT....";
    cairn_file_error error;
    cairn_image image;

    (void)state;
    for (int over = 0; over < 2; over++) {
        uint32_t sum;

        bytes[23] =
            (unsigned char)over; /* 2^13 columns and 2^13 rows or one more, 4 samples each */
        sum = (uint32_t)crc32(0, bytes + 12, 17);
        for (int i = 0; i < 4; i++)
            bytes[29 + i] = (unsigned char)(sum >> (24 - 8 * i));
        assert_status(
            cairn_image_read(&image, files_write("rgba.png", bytes, sizeof bytes - 1), &error),
            over ? CAIRN_FULL : CAIRN_BAD_FORMAT);
        assert_null(image.pixel);
    }
    assert_holds(error.text, "rgba.png: the image has 8192 x 8193 pixels of 4 samples, expected at "
                             "most 268435456 samples");
}

/* The library that parses YAML takes quadratic time. */
static void test_long_yaml(void **state)
{
    char *text = malloc(20000);
    cairn_file_error error;
    cairn_map_file map;

    (void)state;
    assert_non_null(text);
    memset(text, '[', 20000);
    assert_status(cairn_map_file_read(&map, files_write("long.yaml", text, 16385), &error),
                  CAIRN_FULL);
    assert_holds(error.text,
                 "long.yaml: 16385 bytes, expected the description of a map of at most 16384");
    assert_status(cairn_map_file_read(&map, files_write("long.yaml", text, 16384), &error),
                  CAIRN_BAD_FORMAT);
    free(text);
}

/* Names that YAML could misread, and a name without an extension. */
static void test_odd_names(void **state)
{
    static const char *const names[] = {"it's: [a] #map.yaml", "no-ending", ".hidden", "{x}.yaml"};
    cairn_map_file map = cairn_map_file_default(), back;
    cairn_file_error error;

    (void)state;
    assert_ok(cairn_map_file_allocate(&map, 2, 1));
    for (size_t i = 0; i < 4; i++) {
        assert_ok(cairn_map_file_write(&map, files_path(names[i]), CAIRN_MAP_FILE_PGM, &error));
        assert_ok(cairn_map_file_read(&back, files_path(names[i]), &error));
        cairn_map_file_free(&back);
    }
    assert_int_equal(access(files_path("no-ending.pgm"), F_OK), 0);
    assert_int_equal(access(files_path(".hidden.pgm"), F_OK), 0);
    cairn_map_file_free(&map);
}

static void test_locale(void **state)
{
    cairn_map_file map;
    const char *path = files_write_text("locale.yaml", "image: locale.pgm\n" NUMBERS);

    (void)state;
    (void)files_write_text("locale.pgm", "P5 1 1 255\na");
    if (!files_comma_locale())
        skip();
    assert_ok(cairn_map_file_read(&map, path, NULL));
    assert_ok(cairn_map_file_write(&map, path, CAIRN_MAP_FILE_PNG, NULL));
    cairn_map_file_free(&map);
    assert_non_null(setlocale(LC_ALL, "C"));
    assert_ok(cairn_map_file_read(&map, path, NULL));
    assert_near(map.resolution, 0.05, 1e-8);
    assert_near(map.origin.y, 5.5, 0);
    cairn_map_file_free(&map);
}

/* Out of memory within libyaml is reported as that, not as a fault of the file. */
static void test_no_memory(void **state)
{
    const char *path = files_write_text("m.yaml", "image: m.pgm\nname: [a, {b: c}]\n" NUMBERS);
    cairn_status status = CAIRN_NO_MEMORY;
    cairn_file_error error;
    cairn_map_file map;
    int64_t most;

    (void)state;
    (void)files_write_text("m.pgm", "P5 1 1 255\n\xFF");
    for (most = 0; status == CAIRN_NO_MEMORY && most < 10000; most++) {
        yaml_left = most;
        status = cairn_map_file_read(&map, path, &error);
        yaml_left = INT64_MAX;
        if (status == CAIRN_NO_MEMORY)
            assert_holds(error.text, "m.yaml: cannot read: Cannot allocate memory");
    }
    assert_ok(status);
    assert_true(most > 10);
    cairn_map_file_free(&map);
}

/* All memory is freed, whatever the end. */
static void test_heap(void **state)
{
    size_t heap = 0;

    (void)state;
    (void)files_write_text("one.pgm", "P5 1 1 255\na");
    (void)files_write_text("broken.pgm", "P5 2 2 255\na");
    for (int round = 0; round <= FILES_HEAP_ROUNDS; round++) {
        cairn_map_file map;

        if (round == 1)
            heap = files_heap();
        for (int k = 0; k < 2; k++) {
            assert_ok(cairn_map_file_read(
                &map, files_write_text("heap.yaml", "image: one.pgm\n" NUMBERS), NULL));
            assert_ok(cairn_map_file_write(&map, files_path("out.yaml"), k, NULL));
            cairn_map_file_free(&map);
            assert_ok(cairn_map_file_read(&map, files_path("out.yaml"), NULL));
            cairn_map_file_free(&map);
        }
        assert_status(cairn_map_file_read(
                          &map, files_write_text("heap.yaml", "image: broken.pgm\n" NUMBERS), NULL),
                      CAIRN_TRUNCATED);
        assert_status(
            cairn_map_file_read(&map, files_write_text("heap.yaml", "image: one.pgm\n"), NULL),
            CAIRN_BAD_FORMAT);
        assert_status(cairn_map_file_read(&map, files_write_text("heap.yaml", "image: [a\n"), NULL),
                      CAIRN_BAD_FORMAT);
    }
    assert_true(files_heap() < heap + FILES_HEAP_NOISE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_round_trips),
        cmocka_unit_test(test_rows_are_turned),
        cmocka_unit_test(test_meaning_of_pixels),
        cmocka_unit_test(test_draw),
        cmocka_unit_test(test_plain_pgm_and_comments),
        cmocka_unit_test(test_png_kinds),
        cmocka_unit_test(test_transparent_is_unknown),
        cmocka_unit_test(test_bad_images),
        cmocka_unit_test(test_no_memory),
        cmocka_unit_test(test_pipes),
        cmocka_unit_test(test_cut_png),
        cmocka_unit_test(test_bad_descriptions),
        cmocka_unit_test(test_maps_that_cannot_be_written),
        cmocka_unit_test(test_encode_png),
        cmocka_unit_test(test_huge_png),
        cmocka_unit_test(test_no_libpng),
        cmocka_unit_test(test_huge_rgba),
        cmocka_unit_test(test_long_yaml),
        cmocka_unit_test(test_odd_names),
        cmocka_unit_test(test_heap),
        cmocka_unit_test(test_locale),
    };
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
