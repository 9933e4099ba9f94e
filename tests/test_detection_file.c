/* Detections as JSON and SVG: with objects, without, by parts as written, names that need escapes, a
 * place that cannot be written to. */
#include "tests/test.h"

#include "cairn/detection_file.h"
#include "tests/files.h"
#include "tests/json.h"
#include "tests/xml.h"

static cairn_segment lines[] = {{{1, 2}, {10, 2}}, {{10, 2}, {10, 20}}, {{50, 3}, {60, 9}}};
static int32_t chains[] = {0, 0, 1}, segments[] = {1, 0};
static cairn_real strengths[] = {1, 1, 1};
static const uint8_t grey[64 * 48];
static cairn_file_error error;

/* Two outlines of two and three samples; one sample of each is not seen. */
static cairn_contour_search_place outline[] = {
    {{{1, 2}, {1, 0}}, 0, 0},   {{{9, 2}, {1, 0}}, -1, 0},   {{{20, 9}, {0, 1}}, 1, 1},
    {{{20, 12}, {0, 1}}, 1, 1}, {{{20, 15}, {0, 1}}, -1, 1},
};

static cairn_object_detection found[] = {{.left = 1,
                                          .top = 2,
                                          .right = 20,
                                          .bottom = 15,
                                          .score = CAIRN_REAL(1.5),
                                          .rigid_evidence = CAIRN_REAL(0.5),
                                          .deformed_evidence = 1,
                                          .outline_coverage = CAIRN_REAL(0.75),
                                          .edge_proximity = CAIRN_REAL(0.625),
                                          .tangent_deviation = CAIRN_REAL(0.125),
                                          .deformation = CAIRN_REAL(0.0625),
                                          .rigid_proximity = CAIRN_REAL(0.375),
                                          .grouped_evidence = CAIRN_REAL(9.75),
                                          .origin = {10, 8},
                                          .size = 23,
                                          .mirrored = 1,
                                          .segment_count = 2,
                                          .outline_count = 5}};

static const cairn_contour_search_tokens tokens = {.lines = lines,
                                                   .chain = chains,
                                                   .strength_rank = strengths,
                                                   .count = 3,
                                                   .chain_count = 2,
                                                   .width = 64,
                                                   .height = 48,
                                                   .mean_length = 5};
static const cairn_object_detections detections = {found, segments, outline, NULL, 1,
                                                   2,     5,        0,       0,    0},
                                     none = {NULL, NULL, NULL, NULL, 0, 0, 0, 0, 0, 0};

static cairn_detection_file_picture picture_of(const cairn_object_detections *d)
{
    cairn_detection_file_picture p = {.image = "a \"b\" <c>.png",
                                      .model_name = "mug & co",
                                      .grey = grey,
                                      .shrink = 2,
                                      .tokens = &tokens,
                                      .detections = d};

    return p;
}

static char *written(const cairn_detection_file_picture *p, int draws)
{
    const char *path = files_path(draws ? "found.svg" : "found.json");
    char *text;

    assert_ok(draws ? cairn_detection_file_draw(p, path, &error)
                    : cairn_detection_file_write(p, path, &error));
    text = files_read(path, NULL);
    assert_non_null(text);
    return text;
}

static void writes_json(void **state)
{
    cairn_detection_file_picture p = picture_of(&detections);
    char *text = written(&p, 0);

    (void)state;
    assert_json(text);
    assert_non_null(strstr(
        text, "\"width\": 128, \"height\": 96, \"shrink\": 2, \"chains\": 2, \"segments\": 3"));
    assert_non_null(strstr(
        text, "{\"score\": 1.5000, \"rigid\": 0.5000, \"bent\": 1.0000, \"along\": 0.7500, "
              "\"close\": 0.6250, \"turned\": 0.1250, \"strained\": 0.0625, \"agreed\": 0.3750, "
              "\"grouped\": 9.7500, "
              "\"box\": [2.50, 4.50, 40.50, 30.50], \"x\": 20.50, \"y\": 16.50, \"size\": 46.00, "
              "\"mirrored\": true"));
    assert_non_null(strstr(
        text, "\"segments\": [{\"id\": 1, \"chain\": 0, \"line\": [20.50, 4.50, 20.50, 40.50]}, "
              "{\"id\": 0, \"chain\": 0, \"line\": [2.50, 4.50, 20.50, 4.50]}]"));
    assert_non_null(strstr(text,
                           "\"outline\": [[2.50, 4.50, 0], [18.50, 4.50, -1], [40.50, 18.50, 1], "
                           "[40.50, 24.50, 1], [40.50, 30.50, -1]]"));
    free(text);
    p = picture_of(&none);
    text = written(&p, 0);
    assert_json(text);
    assert_non_null(strstr(text, "\"detections\": []"));
    free(text);
}

/* The configuration of a detection by parts: two of four bundles are missing. */
static void writes_parts(void **state)
{
    static cairn_object_detect_part parts[] = {{0, 3, 9, 0, 1, 0, 1},
                                               {2, 7, 1, 1, CAIRN_REAL(0.75), 4, CAIRN_REAL(20.5)},
                                               {1, 5, 0, 0, CAIRN_REAL(0.5), 0, 9}};
    cairn_object_detection by_parts = found[0];
    cairn_object_detections all = {&by_parts, segments, outline, parts, 1, 2, 5, 3, 4, 0};
    cairn_detection_file_picture p = picture_of(&all);
    char *text;

    (void)state;
    by_parts.shape_distance = CAIRN_REAL(0.25);
    by_parts.configuration_score = CAIRN_REAL(0.5);
    by_parts.first_part = 1;
    by_parts.part_count = 2;
    text = written(&p, 0);
    assert_json(text);
    assert_non_null(strstr(
        text,
        "\"distance\": 0.2500, \"agreement\": 0.5000, \"parts\": [{\"bundle\": 2, \"fragment\": 7, "
        "\"chain\": 1, \"reversed\": true, \"similarity\": 0.7500, \"from\": 8.00, \"to\": 41.00}, "
        "{\"bundle\": 1, \"fragment\": 5, \"chain\": 0, \"reversed\": false, \"similarity\": "
        "0.5000, "
        "\"from\": 0.00, \"to\": 18.00}], \"missing\": [0, 3]"));
    free(text);
    by_parts.part_count = 0;
    text = written(&p, 0);
    assert_non_null(strstr(text, "\"parts\": [], \"missing\": [0, 1, 2, 3]"));
    free(text);
    p = picture_of(&detections);
    text = written(&p, 0);
    assert_null(strstr(text, "\"parts\""));
    free(text);
}

static void draws(void **state)
{
    cairn_detection_file_picture p = picture_of(&detections);
    char *text = written(&p, 1);

    (void)state;
    assert_well_formed(text);
    assert_non_null(strstr(text, "<image"));
    assert_non_null(
        strstr(text, "<path class=\"segment\" d=\"M10.0 2.0L10.0 20.0M1.0 2.0L10.0 2.0\"/>"));
    assert_non_null(strstr(text, "<path class=\"seen\" d=\"M20.0 9.0L20.0 12.0\"/>"));
    assert_non_null(
        strstr(text, "<path class=\"missing\" d=\"M1.0 2.0L9.0 2.0M20.0 12.0L20.0 15.0\"/>"));
    assert_non_null(
        strstr(text, "<rect class=\"box\" x=\"1.0\" y=\"2.0\" width=\"19.0\" height=\"13.0\"/>"));
    assert_non_null(strstr(text, ">1.50</text>"));
    /* Places and styles of the rest change only on purpose. */
    assert_golden(picture_hash(text), UINT64_C(0x503c41a5ac810492), UINT64_C(0x503c41a5ac810492));
    free(text);
    p = picture_of(&none);
    p.grey = NULL;
    text = written(&p, 1);
    assert_well_formed(text);
    assert_null(strstr(text, "<image"));
    assert_null(strstr(text, "class=\"box\""));
    free(text);
}

/* Sides of one class that follow each other are one line, whose dashes continue. */
static void draws_continuous_lines(void **state)
{
    static cairn_contour_search_place bent[] = {{{{1, 2}, {1, 0}}, -1, 0},
                                                {{{2, 2}, {1, 0}}, -1, 0},
                                                {{{3, 3}, {1, 0}}, -1, 0},
                                                {{{4, 3}, {1, 0}}, 1, 0},
                                                {{{5, 3}, {1, 0}}, -1, 0}};
    cairn_object_detections all = detections;
    cairn_detection_file_picture p = picture_of(&all);
    char *text;

    (void)state;
    all.outline = bent;
    text = written(&p, 1);
    assert_non_null(
        strstr(text, "<path class=\"missing\" d=\"M1.0 2.0L2.0 2.0L3.0 3.0M4.0 3.0L5.0 3.0\"/>"));
    assert_non_null(strstr(text, "<path class=\"seen\" d=\"M3.0 3.0L4.0 3.0\"/>"));
    free(text);
}

/* ---- As written ---- */

/* A square of 8 samples: its corners, from the left top one, and the middles of its sides. */
static cairn_oriented_point square[] = {
    {{CAIRN_REAL(-0.25), CAIRN_REAL(-0.25)}, {1, 0}}, {{0, CAIRN_REAL(-0.25)}, {1, 0}},
    {{CAIRN_REAL(0.25), CAIRN_REAL(-0.25)}, {0, 1}},  {{CAIRN_REAL(0.25), 0}, {0, 1}},
    {{CAIRN_REAL(0.25), CAIRN_REAL(0.25)}, {-1, 0}},  {{0, CAIRN_REAL(0.25)}, {-1, 0}},
    {{CAIRN_REAL(-0.25), CAIRN_REAL(0.25)}, {0, -1}}, {{CAIRN_REAL(-0.25), 0}, {0, -1}},
};

static const cairn_shape_model square_model = {.outline = square, .outline_count = 8, .size = 1};

/* Its top and right side with half of the bottom, the bottom, the left side. */
static const cairn_part_bundle_cut cuts[] = {{0, 5, 0}, {4, 6, 1}, {6, 0, 2}};

/* The best detection, of the mirror image, with the bottom and the first fragment along the chains
 * 0 and 1; one more with the left side along chain 1. */
static cairn_object_detect_part square_parts[] = {
    {1, 1, 0, 0, 1, 0, 9}, {0, 0, 1, 0, 1, 0, 9}, {2, 2, 1, 0, 1, 0, 9}};
static int32_t square_segments[] = {0, 1, 2, 2};
static cairn_contour_search_place square_outline[16];
static cairn_object_detection squares[2];
static const cairn_object_detections by_parts = {.found = squares,
                                                 .segments = square_segments,
                                                 .outline = square_outline,
                                                 .parts = square_parts,
                                                 .count = 2,
                                                 .segment_count = 4,
                                                 .outline_count = 16,
                                                 .part_count = 3,
                                                 .bundle_count = 3};

/* A picture of the detections in a square of the image, given its left and top side, at which no
 * inset may be. */
static cairn_detection_file_picture picture_by_parts(cairn_real left, cairn_real top)
{
    cairn_detection_file_picture p = picture_of(&by_parts);

    for (int32_t i = 0; i < 16; i++) {
        cairn_contour_search_place at = {{{0, 0}, {1, 0}}, -1, 0};

        at.point.position.x = left + 4 + 8 * square[i % 8].position.x * (i < 8 ? -1 : 1);
        at.point.position.y = top + 4 + 8 * square[i % 8].position.y;
        square_outline[i] = at;
    }
    for (int32_t i = 0; i < 2; i++) {
        cairn_object_detection d = {.left = left,
                                    .top = top,
                                    .right = left + 8,
                                    .bottom = top + 8,
                                    .mirrored = i == 0,
                                    .first_segment = 3 * i,
                                    .segment_count = i == 0 ? 3 : 1,
                                    .first_outline = 8 * i,
                                    .outline_count = 8,
                                    .first_part = 2 * i,
                                    .part_count = i == 0 ? 2 : 1};

        squares[i] = d;
    }
    p.mode = CAIRN_MODE_AS_WRITTEN;
    p.model = &square_model;
    p.cuts = cuts;
    p.cut_count = 3;
    return p;
}

/* Edge fragments and parts of the best detection in the colours of the bundles, on the mirrored
 * model the longer part first; those of the other one in one colour. */
static void draws_matched_parts(void **state)
{
    cairn_detection_file_picture p = picture_by_parts(28, 20);
    const char *first, *second;
    char *text = written(&p, 1);

    (void)state;
    assert_well_formed(text);
    assert_non_null(strstr(text, "<path class=\"fragment\" stroke=\"#ea580c\" "
                                 "d=\"M1.0 2.0L10.0 2.0M10.0 2.0L10.0 20.0\"/>"));
    assert_non_null(strstr(text, "<path class=\"fragment\" stroke=\"#2563eb\" "
                                 "d=\"M50.0 3.0L60.0 9.0\"/>"));
    assert_non_null(strstr(text, "<path class=\"segment\" d=\"M50.0 3.0L60.0 9.0\"/>"));
    assert_non_null(strstr(text, "<path class=\"seen\" d=\"M34.0 22.0L32.0 22.0L30.0 22.0L30.0 "
                                 "24.0L30.0 26.0L32.0 26.0L34.0 26.0\"/>"));
    assert_non_null(strstr(text, "<path class=\"missing\" d=\"M34.0 26.0L34.0 24.0\"/>"));
    first = strstr(text, "class=\"inset\"");
    assert_non_null(first);
    first = strstr(first, "<path class=\"fragment\" stroke=\"#2563eb\" d=\"M");
    assert_non_null(first);
    second = strstr(first, "<path class=\"fragment\" stroke=\"#ea580c\" d=\"M");
    assert_non_null(second);
    assert_true(strtod(strstr(first, "d=\"M") + 4, NULL) > strtod(strstr(first, "L") + 1, NULL));
    assert_non_null(strstr(text, "model at the detected pose; dashed where no part matches"));
    assert_null(strstr(text, "deformed outline"));
    /* Places and styles of the rest change only on purpose. */
    assert_golden(picture_hash(text), UINT64_C(0x5e77a23acae19425), UINT64_C(0x5e77a23acae19425));
    free(text);
}

/* Nothing is found: the legend is that of the mode. */
static void draws_no_parts_of_nothing(void **state)
{
    cairn_detection_file_picture p = picture_of(&none);
    char *text;

    (void)state;
    p.mode = CAIRN_MODE_AS_WRITTEN;
    p.model = &square_model;
    text = written(&p, 1);
    assert_well_formed(text);
    assert_null(strstr(text, "class=\"inset\""));
    assert_non_null(strstr(text, "model at the detected pose"));
    free(text);
    p = picture_of(&detections);
    text = written(&p, 1);
    assert_null(strstr(text, "class=\"inset\""));
    assert_non_null(strstr(text, "deformed outline; dashed where no edge matches"));
    free(text);
}

static void assert_inset(cairn_real left, cairn_real top, int is_left, int is_top)
{
    cairn_detection_file_picture p = picture_by_parts(left, top);
    char *text = written(&p, 1);
    const char *inset = strstr(text, "class=\"inset\" x=\""), *y;

    assert_non_null(inset);
    y = strstr(inset, "y=\"");
    assert_non_null(y);
    assert_int_equal(strtod(inset + 17, NULL) < 32, is_left);
    assert_int_equal(strtod(y + 3, NULL) < 24, is_top);
    free(text);
}

/* The inset is in the corner where it covers least of the best detection: its segments are at the
 * left and the right top. */
static void keeps_detections_free(void **state)
{
    static cairn_segment middle[] = {
        {{30, 24}, {31, 24}}, {{31, 24}, {32, 24}}, {{32, 24}, {33, 24}}};
    cairn_segment kept[3];

    (void)state;
    assert_inset(28, 20, 1, 0);
    assert_inset(1, 38, 0, 0);
    memcpy(kept, lines, sizeof kept);
    memcpy(lines, middle, sizeof middle);
    assert_inset(28, 20, 1, 1);
    assert_inset(1, 1, 0, 1);
    memcpy(lines, kept, sizeof kept);
}

/* As written, no model and a model that has no fragments are refused. */
static void refuses_models_without_fragments(void **state)
{
    cairn_detection_file_picture p = picture_by_parts(28, 20);
    cairn_shape_model bare = square_model;

    (void)state;
    bare.outline_count = 2;
    p.model = &bare;
    assert_status(cairn_detection_file_draw(&p, files_path("bare.svg"), &error), CAIRN_EMPTY);
    assert_non_null(strstr(error.text, "parts of the model"));
    p.model = NULL;
    assert_status(cairn_detection_file_draw(&p, files_path("bare.svg"), &error),
                  CAIRN_BAD_ARGUMENT);
    assert_non_null(strstr(error.text, "expected that of the search"));
    assert_null(files_read(files_path("bare.svg"), NULL));
}

static void refuses_places_that_are_not_there(void **state)
{
    cairn_detection_file_picture p = picture_of(&detections);

    (void)state;
    assert_status(cairn_detection_file_draw(&p, files_path("no/found.svg"), &error), CAIRN_IO);
    assert_status(cairn_detection_file_write(&p, files_path("no/found.json"), &error), CAIRN_IO);
}

/* An outline may leave the image, its box does not. */
static void test_boxes_are_clipped(void **state)
{
    cairn_object_detection beyond = found[0];
    cairn_detection_file_picture p = picture_of(&detections);
    double box[4];

    (void)state;
    cairn_detection_file_box(&p, &beyond, box);
    assert_near(box[0], 2, 1);
    assert_near(box[3], 30, 1);
    beyond.left = -3;
    beyond.top = CAIRN_REAL(-0.75);
    beyond.right = 65;
    beyond.bottom = 70;
    cairn_detection_file_box(&p, &beyond, box);
    assert_near(box[0], 0, 0);
    assert_near(box[1], 0, 0);
    assert_near(box[2], 128, 0);
    assert_near(box[3], 96, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_boxes_are_clipped),
        cmocka_unit_test(writes_json),
        cmocka_unit_test(writes_parts),
        cmocka_unit_test(draws),
        cmocka_unit_test(draws_continuous_lines),
        cmocka_unit_test(draws_matched_parts),
        cmocka_unit_test(draws_no_parts_of_nothing),
        cmocka_unit_test(keeps_detections_free),
        cmocka_unit_test(refuses_models_without_fragments),
        cmocka_unit_test(refuses_places_that_are_not_there),
    };

    return cmocka_run_group_tests(tests, files_setup, files_teardown);
}
