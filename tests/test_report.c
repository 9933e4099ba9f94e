/* Pictures of maps: positions of the elements, embedded images, refusals; every picture is
 * well-formed XML. */
#include "tests/files.h"
#include "tests/xml.h"

#include <math.h>

#include "cairn/report.h"
#include "src/host/files/map_file_image.h"

static void assert_lacks(const char *string, const char *piece)
{
    if (strstr(string, piece) != NULL)
        fail_msg("the picture holds %s", piece);
}

static char *draw(const cairn_report_map *map)
{
    cairn_file_error error;
    const char *path = files_path("map.svg");
    char *svg;

    if (cairn_report_map_write(path, map, &error) != CAIRN_OK)
        fail_msg("%s", error.text);
    svg = files_read(path, NULL);
    assert_non_null(svg);
    assert_well_formed(svg);
    assert_lacks(svg, "nan");
    assert_lacks(svg, "inf");
    return svg;
}

/* Places in float differ. */
static void assert_picture(const char *svg, uint64_t expected)
{
#ifndef CAIRN_FLOAT
    uint64_t hash = picture_hash(svg);

    if (hash != expected)
        fail_msg("the hash is 0x%016llx instead of 0x%016llx", (unsigned long long)hash,
                 (unsigned long long)expected);
#else
    (void)svg;
    (void)expected;
#endif
}

/* Two scans of one point each at (0, 0) and (10, 5), in two frames, and a panel for them. */
typedef struct sample {
    cairn_vec2 point[2];
    cairn_report_scan scan[3]; /* the last is beyond the map's count */
    cairn_pose pose[3];
    cairn_report_panel panel[4];
    cairn_report_map map;
} sample;

static void make_sample(sample *s)
{
    memset(s, 0, sizeof *s);
    s->pose[0].x = 1;
    s->pose[0].y = 1;
    s->pose[1].x = 9;
    s->pose[1].y = 4;
    s->pose[1].theta = CAIRN_PI / 2;
    s->point[0].x = -1;
    s->point[0].y = -1;
    s->point[1].x = 1; /* one ahead, one to the right of a robot facing up: (10, 5) */
    s->point[1].y = -1;
    s->scan[2].point = s->point;
    s->scan[2].point_count = 2;
    s->pose[2].x = 4;
    s->pose[2].y = 3;
    for (int i = 0; i < 2; i++) {
        s->scan[i].point = &s->point[i];
        s->scan[i].point_count = 1;
    }
    for (int i = 0; i < 4; i++)
        s->panel[i].pose = s->pose;
    s->map = cairn_report_map_default();
    s->map.width = 1000;
    s->map.panel = s->panel;
    s->map.panel_count = 1;
    s->map.scan = s->scan;
    s->map.scan_count = 2;
}

static void test_places(void **state)
{
    sample s;
    char *svg;

    (void)state;
    make_sample(&s);
    svg = draw(&s.map);
    /* Frame 952 wide at (24, 24), 18 within: (952 - 36)/10 = 91.6 pixels a metre, 5 * 91.6 + 36 =
     * 494 high. */
    assert_holds(svg, "width=\"1000\" height=\"562\"");
    assert_holds(svg, "x=\"24.0\" y=\"24.0\" width=\"952.0\" height=\"494.0\"");
    assert_holds(svg, "M42.0 500.0h0");
    assert_holds(svg, "M958.0 42.0h0");
    /* Robots: the first faces right, the second up. */
    assert_holds(svg, "translate(133.6 408.4) rotate(0.0)");
    assert_holds(svg, "translate(866.4 133.6) rotate(-90.0)");
    /* The path between them, blue at its start. */
    assert_holds(svg, "M133.6 408.4L866.4 133.6");
    assert_holds(svg, "fill=\"#2563eb\"");
    assert_holds(svg, "fill=\"#f58c14\"");
    /* 1 m is 91.6 pixels, 2 m would be more than 150. */
    assert_holds(svg, "v7h91.6v-7");
    assert_holds(svg, ">1 m</text>");
    assert_holds(svg, ">walls</text>");
    assert_holds(svg, ">path: start</text>");
    assert_lacks(svg, "low confidence");
    assert_lacks(svg, "<image");
    assert_holds(svg, "<title>Map</title>");
    assert_picture(svg, UINT64_C(0xefa45935c5d1b675));
    free(svg);

    /* Segments take the place of points. */
    {
        cairn_segment segment = {{-1, -1}, {0, -1}},
                      oblique = {{CAIRN_REAL(-0.5), -1}, {CAIRN_REAL(0.25), 1}};

        s.scan[0].segment = &segment;
        s.scan[0].segment_count = 1;
        svg = draw(&s.map);
        /* The box is that of the segment's midpoint, the point and the poses: 0.5 .. 10. */
        assert_holds(svg, "L");
        assert_int_equal(count_of(svg, "h0"), 1);
        assert_picture(svg, UINT64_C(0xa4196413b0d43141));
        free(svg);
        s.scan[1].segment = &oblique;
        s.scan[1].segment_count = 1;
        svg = draw(&s.map);
        assert_picture(svg, UINT64_C(0x3d3541dc839726f3));
        free(svg);
    }
}

static void test_texts_and_panels(void **state)
{
    sample s;
    char *svg;

    (void)state;
    make_sample(&s);
    s.map.title = "A <b> & \"c\"\n]]> \xEF\xBF\xBE\xEF\xBF\xBF\xEF\xBF\xBC";
    s.map.subtitle = "below";
    s.map.panel_count = 4;
    s.panel[0].title = "Before";
    s.panel[0].note = "5 < 6";
    s.panel[3].title = "After";
    svg = draw(&s.map);
    assert_holds(svg, "<title>A &lt;b&gt; &amp; &quot;c&quot;]]&gt; "
                      "\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBC</title>");
    assert_holds(svg, ">below</text>");
    assert_holds(svg, ">Before</text>");
    assert_holds(svg, ">5 &lt; 6</text>");
    assert_holds(svg, ">After</text>");
    /* Four frames of (952 - 60)/4 pixels, 20 apart, below the title (24 + 24 + 20 + 12) and the
     * panels' titles (26). */
    assert_int_equal(count_of(svg, "width=\"223.0\""), 4);
    assert_holds(svg, "x=\"24.0\" y=\"106.0\"");
    assert_holds(svg, "x=\"267.0\" y=\"106.0\"");
    assert_holds(svg, "x=\"753.0\" y=\"106.0\"");
    assert_int_equal(count_of(svg, "<clipPath"), 4);
    assert_picture(svg, UINT64_C(0xc769682cc4be0308));
    free(svg);
    s.map.title = NULL;
    svg = draw(&s.map);
    assert_holds(svg, "x=\"24.0\" y=\"82.0\"");
    assert_picture(svg, UINT64_C(0x61e5256b7ffbc3d7));
    free(svg);
}

/* All panels have the scale of the largest. */
static void test_common_scale(void **state)
{
    cairn_pose far_apart[2] = {{0, 0, 0}, {40, 0, 0}};
    sample s;
    char *svg;

    (void)state;
    make_sample(&s);
    s.map.panel_count = 2;
    s.map.scan = NULL;
    s.panel[1].pose = far_apart;
    svg = draw(&s.map);
    /* (466 - 36)/40 = 10.75 pixels a metre; the first panel's path is 8 m by 3 m in the middle
     * of its frame. */
    assert_holds(svg, "v7h107.5v-7");
    assert_holds(svg, ">10 m</text>");
    assert_holds(svg, "M528.0 ");
    assert_holds(svg, "L958.0 ");
    assert_holds(svg, "M214.0 ");
    assert_holds(svg, "L300.0 ");
    assert_lacks(svg, ">walls</text>");
    assert_picture(svg, UINT64_C(0x15f151f118147b75));
    free(svg);
}

static void test_tall_and_tiny_maps(void **state)
{
    cairn_pose tall[2] = {{0, 0, 0}, {1, 100, 0}}, one = {5, 5, 0};
    sample s;
    char *svg;

    (void)state;
    make_sample(&s);
    s.map.scan = NULL;
    s.panel[0].pose = tall;
    svg = draw(&s.map);
    /* No higher than 1.25 times the width. */
    assert_holds(svg, "width=\"952.0\" height=\"1190.0\"");
    assert_picture(svg, UINT64_C(0x7d4a662caa1c4d7d));
    free(svg);
    /* A single pose is in the middle of 1 m. */
    s.panel[0].pose = &one;
    s.map.scan_count = 1;
    svg = draw(&s.map);
    assert_holds(svg, "translate(500.0 500.0)");
    assert_lacks(svg, "stroke-linejoin=\"round\">\n<path stroke");
    free(svg);
}

static void test_ambiguous_and_colours(void **state)
{
    static const uint8_t low_confidence[2] = {0, 1}, first_alone[2] = {1, 0};
    sample s;
    char *svg;

    (void)state;
    make_sample(&s);
    s.panel[0].low_confidence = low_confidence;
    s.map.connect = 0;
    svg = draw(&s.map);
    assert_holds(svg, ">low confidence</text>");
    assert_holds(svg, "translate(866.4 133.6) rotate(-90.0)\" d=\"M7 0L-4.5 4.6L-2.4 0L-4.5 "
                      "-4.6Z\" fill=\"#dc2626\"");
    assert_holds(svg, "stroke=\"#dc2626\" stroke-opacity=\".45\">\n<path d=\"M958.0 42.0h0\"/>");
    assert_holds(svg, "stroke=\"#1e293b\" stroke-opacity=\".6\">\n<path d=\"M42.0 500.0h0\"/>");
    assert_holds(svg, ">start</text>");
    assert_lacks(svg, "path: start");
    assert_lacks(svg, "M133.6 408.4L");
    assert_picture(svg, UINT64_C(0x5134bc9c3bd6e043));
    free(svg);
    s.panel[0].low_confidence = first_alone;
    svg = draw(&s.map);
    assert_holds(svg, ">low confidence</text>");
    free(svg);
    s.panel[0].low_confidence = NULL;
    s.map.colour_scans = 1;
    svg = draw(&s.map);
    assert_holds(svg, "<path d=\"M42.0 500.0h0\" stroke=\"#2563eb\"/>");
    assert_holds(svg, "<path d=\"M958.0 42.0h0\" stroke=\"#f58c14\"/>");
    assert_picture(svg, UINT64_C(0x98e26fe1cb9d5b9f));
    free(svg);
}

/* A long path: drawn in full, few markers, no doubled pose. */
static void test_long_path(void **state)
{
    enum { COUNT = 5000 };
    cairn_pose *pose = calloc(COUNT, sizeof *pose);
    sample s;
    char *svg;

    (void)state;
    make_sample(&s);
    for (int i = 0; i < COUNT; i++)
        pose[i].x = (cairn_real)i * CAIRN_REAL(0.001);
    s.map.scan = NULL;
    s.map.scan_count = COUNT;
    s.panel[0].pose = pose;
    svg = draw(&s.map);
    assert_int_equal(count_of(svg, "<path stroke=\"#"), 48);
    assert_in_range(count_of(svg, "translate("), 60, 62);
    assert_holds(svg, "M42.0 ");
    assert_holds(svg, "L958.0 ");
    /* 916 pixels of path, a point every half pixel at most. */
    assert_in_range(count_of(svg, "L"), 900, 2200);
    assert_picture(svg, UINT64_C(0xa3aae59f44ae9387));
    free(svg);
    free(pose);
}

/* Nothing is cut off, not even a few points far away. */
static void test_strays_are_shown(void **state)
{
    enum { COUNT = 1000 };
    cairn_vec2 *point = calloc(COUNT, sizeof *point);
    cairn_report_scan scan = {NULL, NULL, COUNT, 0};
    sample s;
    char *svg;

    (void)state;
    make_sample(&s);
    for (int i = 0; i < COUNT; i++) {
        int column = i % 100, row = i / 100;

        point[i].x = (cairn_real)column * CAIRN_REAL(0.1);
        point[i].y = (cairn_real)row * CAIRN_REAL(0.5);
    }
    for (int i = 0; i < 5; i++)
        point[i * 190].x = 1000;
    scan.point = point;
    s.map.scan = &scan;
    s.map.scan_count = 1;
    svg = draw(&s.map);
    /* 1000 m wide: the bar of 100 m is 916/1000 pixels a metre long. */
    assert_holds(svg, "v7h91.6v-7");
    assert_holds(svg, "M958.0 ");
    assert_picture(svg, UINT64_C(0xbdc028d84e76aa59));
    free(svg);
    free(point);
}

/* Takes the first embedded PNG out of a picture. */
static void take_image(const char *svg, cairn_image *image)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const char *at = strstr(svg, "base64,");
    unsigned char *bytes;
    size_t count = 0;
    unsigned group = 0;
    int bits = 0;

    assert_non_null(at);
    at += 7;
    bytes = malloc(strlen(at));
    assert_non_null(bytes);
    for (; *at != '"' && *at != '='; at++) {
        const char *digit = strchr(digits, *at);

        assert_non_null(digit);
        group = (group << 6 | (unsigned)(digit - digits)) & 0xffffu;
        bits += 6;
        if (bits >= 8) {
            bits -= 8;
            bytes[count++] = (unsigned char)(group >> bits);
        }
    }
    assert_ok(cairn_image_read(image, files_write("taken.png", bytes, count), NULL));
    free(bytes);
}

static void test_many_points_become_an_image(void **state)
{
    cairn_segment segment = {{2, 2}, {2, CAIRN_REAL(3.5)}},
                  endless = {{3, 3}, {CAIRN_REAL(1e9), 3}};
    cairn_image image;
    uint64_t hash;
    sample s;
    char *svg;

    (void)state;
    make_sample(&s);
    s.map.max_elements = 1;
    svg = draw(&s.map);
    assert_lacks(svg, "h0");
    assert_holds(svg, "transform=\"matrix(0.5 0 0 0.5 24.00 24.00)\"");
    take_image(svg, &image);
    assert_int_equal(image.width, 1904);
    assert_int_equal(image.height, 988);
    /* (0, 0) is at pixel (42, 500) of the picture, the image begins at (24, 24) with two samples
     * a pixel. */
    assert_int_equal(image.pixel[952 * 1904 + 36], 30);
    assert_int_equal(image.pixel[36 * 1904 + 1868], 30);
    {
        int dark = 0;

        for (int i = 0; i < 1904 * 988; i++)
            dark += image.pixel[i] < 255;
        assert_int_equal(dark, 2);
    }
    cairn_image_free(&image);
    free(svg);

    /* Twice as many points, darker; a third one alone is lighter. */
    {
        cairn_vec2 several[12] = {{-1, -1}, {-1, -1}, {-1, -1}, {-1, -1}, {-1, -1}, {-1, -1},
                                  {4, 2},   {2, 2},   {2, 3},   {3, 2},   {3, 3},   {4, 4}};

        s.scan[0].point = several;
        s.scan[0].point_count = 12;
        svg = draw(&s.map);
        take_image(svg, &image);
        assert_int_equal(image.pixel[952 * 1904 + 36], 30);
        /* One point where nine in ten samples hold up to 6: 255 - 225 log(1 + 1)/log(1 + 6) =
         * 174.9. */
        assert_int_equal(image.pixel[36 * 1904 + 1868], 174);
        cairn_image_free(&image);
        free(svg);
        /* One point in nine of ten samples is full ink, and two are the same. */
        for (int i = 0; i < 10; i++)
            several[i + 2].x = (cairn_real)i / 4;
        svg = draw(&s.map);
        take_image(svg, &image);
        assert_int_equal(image.pixel[952 * 1904 + 36], 30);
        assert_int_equal(image.pixel[36 * 1904 + 1868], 30);
        cairn_image_free(&image);
        free(svg);
    }

    /* Segments: each sample along them, also of infinite ones. */
    make_sample(&s);
    s.map.max_elements = 0;
    s.scan[0].segment = &segment;
    s.scan[0].segment_count = 1;
    svg = draw(&s.map);
    take_image(svg, &image);
    {
        int column = 0, longest = 0;

        for (int x = 0; x < image.width; x++) {
            int run = 0;

            for (int y = 0; y < image.height; y++)
                run += image.pixel[y * image.width + x] < 255;
            if (run > longest) {
                longest = run;
                column = x;
            }
        }
        /* 1.5 m at two samples a pixel; the box is 9 m wide. */
        assert_near(longest, 1.5 * 2 * 916 / 9, 3);
        assert_true(column > 0);
    }
    hash = test_hash(TEST_HASH_START, image.pixel, (size_t)image.width * (size_t)image.height);
    assert_golden(hash, UINT64_C(0xb49aeef81f132b57), UINT64_C(0xb49aeef81f132b57));
    cairn_image_free(&image);
    assert_picture(svg, UINT64_C(0x8fbb0a3afe6be983));
    free(svg);
    s.scan[1].segment = &endless;
    s.scan[1].segment_count = 1;
    svg = draw(&s.map);
    assert_picture(svg, UINT64_C(0x3e5a129b12f4f9df));
    take_image(svg, &image);
    hash = test_hash(TEST_HASH_START, image.pixel, (size_t)image.width * (size_t)image.height);
    assert_golden(hash, UINT64_C(0xb17a46640bce8516), UINT64_C(0xa0edfa00c8b43573));
    cairn_image_free(&image);
    free(svg);
}

static void test_grid(void **state)
{
    static const uint8_t pixel[6] = {10, 20, 30, 40, 50, 60};
    cairn_report_grid grid = {pixel, 3, 2, 2, {-1, -2, 0}};
    cairn_image image;
    sample s;
    char *svg;

    (void)state;
    make_sample(&s);
    s.panel[0].grid = &grid;
    svg = draw(&s.map);
    /* The box is the grid's, x -1 .. 5, with the poses, x up to 9; y -2 .. 4. (952 - 36)/10
     * pixels a metre. */
    assert_holds(svg,
                 "width=\"3\" height=\"2\" transform=\"matrix(183.2 0 0 183.2 42.00 225.20)\"");
    assert_holds(svg, "image-rendering:pixelated");
    assert_lacks(svg, ">walls</text>");
    take_image(svg, &image);
    assert_int_equal(image.width, 3);
    assert_memory_equal(image.pixel, "\x28\x32\x3c\x0a\x14\x1e", 6);
    cairn_image_free(&image);
    assert_picture(svg, UINT64_C(0xaac21f71f1099641));
    free(svg);

    /* Rotated by a quarter turn: x of the grid goes up, its upper left corner is at (-1 - 4,
     * -2). */
    grid.origin.theta = CAIRN_PI / 2;
    svg = draw(&s.map);
    {
        double m[6];
        const char *at = strstr(svg, "matrix(");

        assert_non_null(at);
        assert_int_equal(
            sscanf(at, "matrix(%lf %lf %lf %lf %lf %lf)", &m[0], &m[1], &m[2], &m[3], &m[4], &m[5]),
            6);
        assert_near(m[0], 0, 1e-4);
        assert_true(m[1] < -1 && m[2] > 1);
        assert_near(m[1], -m[2], 1e-4);
        assert_near(m[3], 0, 1e-4);
        assert_near(m[4], 42, 0.01);
    }
    assert_picture(svg, UINT64_C(0x429abf144d416557));
    free(svg);
}

/* A large grid is drawn coarser; walls stay. */
static void test_large_grid(void **state)
{
    int32_t side = 4097;
    uint8_t *pixel = malloc((size_t)side * 3);
    cairn_report_grid grid = {pixel, side, 3, CAIRN_REAL(0.05), {0, 0, 0}};
    cairn_image image;
    sample s;
    char *svg;

    (void)state;
    assert_non_null(pixel);
    memset(pixel, 255, (size_t)side * 3);
    pixel[4] = 7;               /* row 0 */
    pixel[2 * side + 4096] = 9; /* the last of the last row */
    make_sample(&s);
    s.panel[0].grid = &grid;
    svg = draw(&s.map);
    assert_lacks(svg, "pixelated");
    take_image(svg, &image);
    assert_int_equal(image.width, 1366);
    assert_int_equal(image.height, 1);
    assert_int_equal(image.pixel[1], 7);
    assert_int_equal(image.pixel[0], 255);
    assert_int_equal(image.pixel[1365], 9);
    cairn_image_free(&image);
    free(svg);
    free(pixel);
}

static void test_refusals(void **state)
{
    const char *path = files_path("refused.svg");
    cairn_file_error error;
    static const uint8_t one = 0;
    cairn_report_grid grid = {&one, 1, 1, 1, {0, 0, 0}};
    sample good, s;

    (void)state;
    make_sample(&good);
#define REFUSED(change, status, piece)                                                             \
    do {                                                                                           \
        make_sample(&s);                                                                           \
        grid.width = 1;                                                                            \
        grid.height = 1;                                                                           \
        grid.resolution = 1;                                                                       \
        grid.pixel = &one;                                                                         \
        grid.origin = cairn_pose_identity();                                                       \
        change;                                                                                    \
        assert_status(cairn_report_map_write(path, &s.map, &error), status);                       \
        assert_holds(error.text, piece);                                                           \
        assert_int_equal(error.line, 0);                                                           \
        assert_int_equal(access(path, F_OK), -1);                                                  \
    } while (0)
    REFUSED(s.map.panel = NULL, CAIRN_BAD_ARGUMENT, "panels");
    REFUSED(s.map.panel_count = 0, CAIRN_BAD_ARGUMENT, "0 panels");
    REFUSED(s.map.panel_count = 5, CAIRN_BAD_ARGUMENT, "5 panels");
    REFUSED(s.map.scan_count = 0, CAIRN_BAD_ARGUMENT, "0 scans");
    REFUSED(s.map.width = 199, CAIRN_BAD_ARGUMENT, "width 199");
    REFUSED(s.map.width = 10001, CAIRN_BAD_ARGUMENT, "width 10001");
    REFUSED(s.map.max_elements = -1, CAIRN_BAD_ARGUMENT, "panels");
    REFUSED(s.panel[0].pose = NULL, CAIRN_BAD_ARGUMENT, "panel 0 has no poses");
    REFUSED(s.pose[1].theta = (cairn_real)NAN, CAIRN_NOT_FINITE, "panel 0: pose 1 is not finite");
    REFUSED(s.point[1].y = (cairn_real)INFINITY, CAIRN_NOT_FINITE, "scan 1: point 0 is not finite");
    REFUSED(s.point[1].x = (cairn_real)NAN, CAIRN_NOT_FINITE, "scan 1: point 0 is not finite");
    REFUSED(s.scan[1].point_count = -1, CAIRN_BAD_ARGUMENT, "scan 1: bad arrays");
    REFUSED(s.scan[1].segment_count = -1, CAIRN_BAD_ARGUMENT, "scan 1: bad arrays");
    REFUSED(s.scan[1].point = NULL, CAIRN_BAD_ARGUMENT, "scan 1: bad arrays");
    REFUSED(s.scan[1].segment_count = 1, CAIRN_BAD_ARGUMENT, "scan 1: bad arrays");
    {
        cairn_segment segment = {{0, 0}, {0, (cairn_real)NAN}};

        REFUSED((s.scan[0].segment = &segment, s.scan[0].segment_count = 1), CAIRN_NOT_FINITE,
                "scan 0: segment 0");
        segment.a.x = (cairn_real)INFINITY;
        segment.b.y = 0;
        REFUSED((s.scan[0].segment = &segment, s.scan[0].segment_count = 1), CAIRN_NOT_FINITE,
                "scan 0: segment 0");
    }
    REFUSED((s.panel[0].grid = &grid, grid.width = 0), CAIRN_BAD_ARGUMENT,
            "panel 0 has a grid without");
    REFUSED((s.panel[0].grid = &grid, grid.height = 0), CAIRN_BAD_ARGUMENT,
            "panel 0 has a grid without");
    REFUSED((s.panel[0].grid = &grid, grid.pixel = NULL), CAIRN_BAD_ARGUMENT,
            "panel 0 has a grid without");
    REFUSED((s.panel[0].grid = &grid, grid.resolution = 0), CAIRN_BAD_ARGUMENT,
            "panel 0 has a grid without");
    REFUSED((s.panel[0].grid = &grid, grid.resolution = (cairn_real)INFINITY), CAIRN_BAD_ARGUMENT,
            "panel 0 has a grid");
    REFUSED((s.panel[0].grid = &grid, grid.origin.y = (cairn_real)NAN), CAIRN_NOT_FINITE,
            "the grid's origin");
#undef REFUSED
    for (int32_t k = 0; k < 2; k++) {
        make_sample(&s);
        s.map.width = k ? 10000 : 200;
        s.map.panel_count = k ? 4 : 1;
        s.map.max_elements = 0;
        s.map.scan = NULL;
        assert_ok(cairn_report_map_write(files_path("limits.svg"), &s.map, &error));
    }
    assert_status(cairn_report_map_write(files_path("no/map.svg"), &good.map, &error), CAIRN_IO);
    assert_status(cairn_report_map_write(files_path("no/map.svg"), &good.map, NULL), CAIRN_IO);
}

static void test_locale(void **state)
{
    sample s;
    char *svg;

    (void)state;
    make_sample(&s);
    if (!files_comma_locale())
        skip();
    svg = draw(&s.map);
    assert_non_null(setlocale(LC_ALL, "C"));
    assert_holds(svg, "M42.0 500.0h0");
    assert_holds(svg, "rotate(-90.0)");
    free(svg);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_places),
        cmocka_unit_test(test_texts_and_panels),
        cmocka_unit_test(test_common_scale),
        cmocka_unit_test(test_tall_and_tiny_maps),
        cmocka_unit_test(test_ambiguous_and_colours),
        cmocka_unit_test(test_long_path),
        cmocka_unit_test(test_strays_are_shown),
        cmocka_unit_test(test_many_points_become_an_image),
        cmocka_unit_test(test_grid),
        cmocka_unit_test(test_large_grid),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_locale),
    };
    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
