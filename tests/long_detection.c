/* Long scenes of detection: a flag among lines, detected by parts as written, which takes more
 * memory than a board has. */
#include "src/base/build.h"

#include "cairn/object_detect.h"
#include "firmware/edge_image.h"
#include "tests/long.h"
#include "tests/long_scenes.h"

enum { WIDTH = 320, HEIGHT = 240, LINES = 40, MAX_LINE_PX = 40, STEP_UNITS = 5000 };

/* A pole with a cloth to the right, 120 px high, and where it is drawn. */
static const cairn_vec2 flag[] = {{0, 0},   {14, 0},  {60, 8},   {80, 4}, {78, 48},
                                  {56, 52}, {14, 44}, {14, 120}, {0, 120}};
enum { CORNERS = sizeof flag / sizeof *flag, FLAG_X = 120, FLAG_Y = 60 };

static uint8_t edges[WIDTH * HEIGHT];

static void draw_image(void)
{
    const edge_image image = {edges, WIDTH, HEIGHT};
    const cairn_vec2 at = {FLAG_X, FLAG_Y};
    cairn_random random = cairn_random_seed(43, 1);

    edge_image_clear(&image);
    for (int32_t i = 0; i < LINES; i++)
        edge_image_random_line(&image, &random, MAX_LINE_PX, 60 + 3 * i);
    edge_image_polygon(&image, flag, CORNERS, at, 200);
}

static uint64_t add_detections(uint64_t hash, const cairn_object_detections *found)
{
    for (int32_t i = 0; i < found->count; i++) {
        const cairn_object_detection *d = &found->found[i];
        const cairn_real numbers[] = {d->left, d->top,   d->right,          d->bottom,
                                      d->size, d->score, d->shape_distance, d->configuration_score};

        hash = add_vector(hash, numbers, sizeof numbers / sizeof *numbers);
        hash = add_int(add_real(add_real(hash, d->origin.x), d->origin.y), d->mirrored);
        for (int32_t k = d->first_part; k < d->first_part + d->part_count; k++)
            hash = add_int(add_int(hash, found->parts[k].chain), found->parts[k].fragment);
        for (int32_t k = d->first_segment; k < d->first_segment + d->segment_count; k++)
            hash = add_int(hash, found->segments[k]);
    }
    return add_int(hash, found->count);
}

uint64_t long_detected_as_written(void)
{
    static const cairn_curve outline = {flag, CORNERS, 1};
    cairn_contour_search_tokenizer_params tokenizing = cairn_contour_search_tokenizer_default();
    cairn_shape_model_builder_params building = cairn_shape_model_builder_default();
    cairn_object_detect_params params = cairn_object_detect_as_written(WIDTH, HEIGHT);
    cairn_raster_u8_view view = {edges, WIDTH, HEIGHT, WIDTH};
    cairn_contour_search_tokenizer *tokenizer;
    cairn_object_detect_field *field;
    cairn_object_detector *detector;
    cairn_shape_model_builder *builder;
    cairn_contour_search_tokens tokens;
    cairn_object_detections found;
    cairn_shape_model model;
    cairn_pool pools[4];
    uint64_t hash = GOLDEN_START;

    draw_image();
    tokenizing.max_width = WIDTH;
    tokenizing.max_height = HEIGHT;
    LONG_CREATE(&pools[0], contour_search_tokenizer, &tokenizer, &tokenizing);
    assert_ok(cairn_contour_search_tokenizer_begin(tokenizer, view));
    LONG_RUN(hash, cairn_contour_search_tokenizer_step, tokenizer, STEP_UNITS);
    tokens = cairn_contour_search_tokenizer_read(tokenizer);
    LONG_CREATE(&pools[1], shape_model_builder, &builder, &building);
    assert_ok(cairn_shape_model_builder_begin(builder, &outline, 1));
    LONG_RUN(hash, cairn_shape_model_builder_step, builder, STEP_UNITS);
    model = cairn_shape_model_builder_read(builder);
    params.max_segments = tokens.count;
    LONG_CREATE(&pools[2], object_detect_field, &field, &params);
    assert_ok(cairn_object_detect_field_begin(field, &tokens, NULL));
    LONG_RUN(hash, cairn_object_detect_field_step, field, STEP_UNITS);
    LONG_CREATE(&pools[3], object_detect, &detector, &params);
    assert_ok(cairn_object_detect_begin(detector, field, &model, NULL));
    LONG_RUN(hash, cairn_object_detect_step, detector, STEP_UNITS);
    found = cairn_object_detect_read(detector);
    assert_true(found.count > 0 && found.found[0].part_count > 1);
    hash = add_detections(hash, &found);
    for (int k = 0; k < 4; k++)
        test_pool_free(&pools[k]);
    return hash;
}
