/* Golden scenes of detection: a flag among random lines, from edges to detections and to known
 * contours. Detection by parts takes more memory than a board has: tests/long_detection.c. */
#include "src/base/build.h"

#include "cairn/contour_search.h"
#include "cairn/object_detect.h"
#include "firmware/edge_image.h"
#include "firmware/survey.h"
#include "tests/golden.h"

enum { WIDTH = 130, HEIGHT = 100, LINES = 14, MAX_LINE_PX = 20, OUTLINE_SAMPLES = 64 };
enum { MEMORY = 8 * 1024 * 1024 };

/* A pole with a cloth to the right, 60 px high, and where it is drawn. */
static const cairn_vec2 flag[] = {{0, 0},   {7, 0},  {30, 4}, {40, 2}, {39, 24},
                                  {28, 26}, {7, 22}, {7, 60}, {0, 60}};
enum { CORNERS = sizeof flag / sizeof *flag, FLAG_X = 45, FLAG_Y = 25 };
/* px: sizes that are searched; the flag's is 72. */
static const cairn_real MIN_SIZE = 65, MAX_SIZE = 80;

static SURVEY_EXTERNAL _Alignas(CAIRN_ALIGN) unsigned char memory[MEMORY];
static uint8_t edges[WIDTH * HEIGHT];

/* ---- The image and the model ---- */

static void draw_image(void)
{
    const edge_image image = {edges, WIDTH, HEIGHT};
    const cairn_vec2 at = {FLAG_X, FLAG_Y};
    cairn_random random = cairn_random_seed(41, 1);

    edge_image_clear(&image);
    for (int32_t i = 0; i < LINES; i++)
        edge_image_random_line(&image, &random, MAX_LINE_PX, 60 + 10 * i);
    edge_image_polygon(&image, flag, CORNERS, at, 200);
}

static int build_model(cairn_pool *pool, cairn_shape_model *model)
{
    static const cairn_curve outline = {flag, CORNERS, 1};
    cairn_shape_model_builder_params params = cairn_shape_model_builder_default();
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_shape_model_builder *builder;

    params.outline_samples = OUTLINE_SAMPLES;
    if (cairn_shape_model_builder_create(&builder, pool, &params) != CAIRN_OK ||
        cairn_shape_model_builder_begin(builder, &outline, 1) != CAIRN_OK ||
        cairn_shape_model_builder_step(builder, &budget) != CAIRN_OK)
        return 0;
    *model = cairn_shape_model_builder_read(builder);
    return 1;
}

static int find_tokens(cairn_pool *pool, int32_t mode, cairn_contour_search_tokens *tokens)
{
    cairn_contour_search_tokenizer_params params = cairn_contour_search_tokenizer_default();
    cairn_raster_u8_view view = {edges, WIDTH, HEIGHT, WIDTH};
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_contour_search_tokenizer *tokenizer;

    params.max_width = WIDTH;
    params.max_height = HEIGHT;
    params.max_edges = 2000;
    params.max_chains = 200;
    params.max_lines = 300;
    params.max_segments = 600;
    params.mode = mode;
    if (cairn_contour_search_tokenizer_create(&tokenizer, pool, &params) != CAIRN_OK ||
        cairn_contour_search_tokenizer_begin(tokenizer, view) != CAIRN_OK ||
        cairn_contour_search_tokenizer_step(tokenizer, &budget) != CAIRN_OK)
        return 0;
    *tokens = cairn_contour_search_tokenizer_read(tokenizer);
    return 1;
}

/* Image, model and tokens of a scene, on an empty pool. */
static int prepare(cairn_pool *pool, int32_t mode, cairn_shape_model *model,
                   cairn_contour_search_tokens *tokens)
{
    draw_image();
    return cairn_pool_init(pool, memory, sizeof memory) == CAIRN_OK && build_model(pool, model) &&
           find_tokens(pool, mode, tokens);
}

static uint64_t add_tokens(uint64_t hash, const cairn_contour_search_tokens *tokens)
{
    for (int32_t i = 0; i < tokens->count; i++) {
        hash = add_point(add_point(hash, tokens->lines[i].a), tokens->lines[i].b);
        hash = add_bytes(add_real(hash, tokens->strength_rank[i]), &tokens->chain[i],
                         sizeof tokens->chain[i]);
    }
    for (int32_t i = 0; i < tokens->end_count; i++)
        hash = add_point(hash, tokens->ends[i]);
    return hash;
}

static uint64_t add_places(uint64_t hash, const cairn_contour_search_place *places, int32_t count)
{
    for (int32_t i = 0; i < count; i++) {
        hash = add_point(add_point(hash, places[i].point.position), places[i].point.direction);
        hash = add_bytes(hash, &places[i].segment, sizeof places[i].segment);
    }
    return hash;
}

/* ---- Detection ---- */

static uint64_t add_detections(uint64_t hash, const cairn_object_detections *found)
{
    for (int32_t i = 0; i < found->count; i++) {
        const cairn_object_detection *d = &found->found[i];
        const cairn_real numbers[] = {d->left,
                                      d->top,
                                      d->right,
                                      d->bottom,
                                      d->score,
                                      d->rigid_evidence,
                                      d->deformed_evidence,
                                      d->outline_coverage,
                                      d->edge_proximity,
                                      d->tangent_deviation,
                                      d->deformation,
                                      d->rigid_proximity,
                                      d->grouped_evidence,
                                      d->origin.x,
                                      d->origin.y,
                                      d->size};

        for (size_t k = 0; k < sizeof numbers / sizeof *numbers; k++)
            hash = add_real(hash, numbers[k]);
        hash = add_bytes(hash, &found->segments[d->first_segment],
                         (size_t)d->segment_count * sizeof *found->segments);
        hash = add_places(hash, &found->outline[d->first_outline], d->outline_count);
    }
    return add_bytes(hash, &found->count, sizeof found->count);
}

/* 0: nothing is detected. The units are hashed, too. */
uint64_t golden_detected(void)
{
    cairn_object_detect_params params = cairn_object_detect_default(WIDTH, HEIGHT);
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_contour_search_tokens tokens;
    cairn_object_detections found;
    cairn_object_detect_field *field;
    cairn_object_detector *detector;
    cairn_shape_model model;
    cairn_pool pool;

    if (!prepare(&pool, CAIRN_MODE_DEFAULT, &model, &tokens))
        return 0;
    params.min_size = MIN_SIZE;
    params.max_size = MAX_SIZE;
    params.candidates = 2;
    params.min_score = -100;
    params.max_segments = tokens.count;
    params.max_tokens = 300;
    params.max_samples = model.sample_count;
    params.max_outline = model.outline_count;
    params.max_peaks = 4096;
    if (cairn_object_detect_field_create(&field, &pool, &params) != CAIRN_OK ||
        cairn_object_detect_create(&detector, &pool, &params) != CAIRN_OK ||
        cairn_object_detect_field_begin(field, &tokens, NULL) != CAIRN_OK ||
        cairn_object_detect_field_step(field, &budget) != CAIRN_OK ||
        cairn_object_detect_begin(detector, field, &model, NULL) != CAIRN_OK ||
        cairn_object_detect_step(detector, &budget) != CAIRN_OK)
        return 0;
    found = cairn_object_detect_read(detector);
    if (found.count == 0)
        return 0;
    return add_bytes(add_detections(add_tokens(GOLDEN_START, &tokens), &found), &budget.left,
                     sizeof budget.left);
}

/* ---- Search for a known contour ---- */

static uint64_t add_objects(uint64_t hash, const cairn_contour_search_result *r)
{
    for (int32_t i = 0; i < r->object_count; i++) {
        const cairn_contour_search_object *o = &r->objects[i];
        const cairn_real numbers[] = {o->found.evidence,       o->found.score,
                                      o->found.size,           o->found.turn,
                                      o->rigid_evidence,       o->deformed_evidence,
                                      o->shape.edge_proximity, o->shape.tangent_deviation,
                                      o->shape.deformation};

        hash = add_bytes(add_point(hash, o->found.origin), &o->mirrored, sizeof o->mirrored);
        for (size_t k = 0; k < sizeof numbers / sizeof *numbers; k++)
            hash = add_real(hash, numbers[k]);
    }
    for (int32_t i = 0; i < r->disc_count; i++)
        hash = add_real(add_point(hash, r->discs[i].centre), r->discs[i].radius);
    hash = add_bytes(hash, r->segments, (size_t)r->segment_count * sizeof *r->segments);
    hash = add_places(hash, r->outline, r->outline_count);
    return add_real(add_real(hash, r->best_score), r->best_evidence);
}

/* 0: nothing is found. The units are hashed, too. */
static uint64_t search(cairn_contour_search_params params, int32_t mode)
{
    cairn_budget budget = {CAIRN_UNBOUNDED};
    cairn_contour_search_tokens tokens;
    cairn_contour_search_result result;
    cairn_contour_search *searcher;
    cairn_shape_model model;
    cairn_pool pool;

    if (!prepare(&pool, mode, &model, &tokens))
        return 0;
    params.grouping.max_tokens = 300;
    params.grouping.max_samples = model.sample_count;
    params.grouping.max_outline = model.outline_count;
    params.grouping.particles = 40;
    params.grouping.max_objects = 2;
    params.max_segments = tokens.count;
    params.min_size = MIN_SIZE;
    params.max_size = MAX_SIZE;
    params.min_evidence = 2;
    if (cairn_contour_search_create(&searcher, &pool, &params) != CAIRN_OK ||
        cairn_contour_search_begin(searcher, &tokens, &model, NULL) != CAIRN_OK ||
        cairn_contour_search_step(searcher, &budget) != CAIRN_OK)
        return 0;
    result = cairn_contour_search_read(searcher);
    if (result.object_count == 0)
        return 0;
    return add_bytes(add_objects(add_tokens(GOLDEN_START, &tokens), &result), &budget.left,
                     sizeof budget.left);
}

uint64_t golden_searched(void)
{
    return search(cairn_contour_search_default(WIDTH, HEIGHT), CAIRN_MODE_DEFAULT);
}

uint64_t golden_searched_written(void)
{
    return search(cairn_contour_search_as_written(WIDTH, HEIGHT), CAIRN_MODE_AS_WRITTEN);
}
