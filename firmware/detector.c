/* Main loop of a robot that detects an object of a known shape in an image of edges: every tick calls
 * one step with a budget.
 *
 * The image, a flag among random lines, is drawn by the library's random numbers; the model is built
 * from the flag's outline. Prints the tokens, the box of each detection, the hash of all results, and
 * the cost of the ticks. Ends with status 1 when the flag is not the best detection. */
#include "src/base/build.h"

#include "cairn/object_detect.h"
#include "firmware/board.h"
#include "firmware/console.h"
#include "firmware/edge_image.h"
#include "firmware/hash.h"
#include "firmware/survey.h"

enum { WIDTH = 320, HEIGHT = 240, LINES = 40, MAX_LINE_PX = 40, STRENGTH = 200 };
enum { UNITS_PER_TICK = 20000, POOL_BYTES = 8 * 1024 * 1024 - WIDTH * HEIGHT };
enum { WORK_MODEL, WORK_TOKENS, WORK_FIELD, WORK_DETECT, WORKS };

/* A pole with a cloth to the right, 120 px high, and where it is drawn. */
static const cairn_vec2 flag[] = {{0, 0},   {14, 0},  {60, 8},   {80, 4}, {78, 48},
                                  {56, 52}, {14, 44}, {14, 120}, {0, 120}};
enum { CORNERS = sizeof flag / sizeof *flag, FLAG_X = 150, FLAG_Y = 60 };
/* Least intersection over union of the best box with that of the flag. */
static const cairn_real MIN_OVERLAP = CAIRN_REAL(0.8);

static const char *const work_names[WORKS] = {"model", "tokens", "field", "detect"};
static SURVEY_EXTERNAL _Alignas(CAIRN_ALIGN) unsigned char memory[POOL_BYTES];
static SURVEY_EXTERNAL uint8_t edges[WIDTH * HEIGHT];
static console_measure measures[WORKS];

/* ---- The image ---- */

static void draw_image(void)
{
    const edge_image image = {edges, WIDTH, HEIGHT};
    const cairn_vec2 at = {FLAG_X, FLAG_Y};
    cairn_random random = cairn_random_seed(4, 2);

    edge_image_clear(&image);
    for (int32_t i = 0; i < LINES; i++)
        edge_image_random_line(&image, &random, MAX_LINE_PX, STRENGTH);
    edge_image_polygon(&image, flag, CORNERS, at, STRENGTH);
}

/* ---- Steps ---- */

typedef cairn_status (*step_function)(void *object, cairn_budget *budget);

/* Ticks until a step is done. */
static void run(int32_t work, step_function step, void *object)
{
    cairn_status status;

    do {
        cairn_budget budget = {UNITS_PER_TICK};
        uint32_t begun = board_clock();

        status = step(object, &budget);
        console_count(&measures[work], board_clock() - begun, UNITS_PER_TICK - budget.left);
    } while (status == CAIRN_MORE);
    if (status != CAIRN_OK)
        console_give_up(work_names[work], status);
}

static void need(cairn_status status, const char *what)
{
    if (status != CAIRN_OK)
        console_give_up(what, status);
}

static cairn_status step_model(void *object, cairn_budget *budget)
{
    return cairn_shape_model_builder_step(object, budget);
}

static cairn_status step_tokens(void *object, cairn_budget *budget)
{
    return cairn_contour_search_tokenizer_step(object, budget);
}

static cairn_status step_field(void *object, cairn_budget *budget)
{
    return cairn_object_detect_field_step(object, budget);
}

static cairn_status step_detector(void *object, cairn_budget *budget)
{
    return cairn_object_detect_step(object, budget);
}

static cairn_shape_model build_model(cairn_pool *pool)
{
    static const cairn_curve outline = {flag, CORNERS, 1};
    cairn_shape_model_builder_params params = cairn_shape_model_builder_default();
    cairn_shape_model_builder *builder;

    need(cairn_shape_model_builder_create(&builder, pool, &params), "model");
    need(cairn_shape_model_builder_begin(builder, &outline, 1), "model");
    run(WORK_MODEL, step_model, builder);
    return cairn_shape_model_builder_read(builder);
}

static cairn_contour_search_tokens find_tokens(cairn_pool *pool)
{
    cairn_contour_search_tokenizer_params params = cairn_contour_search_tokenizer_default();
    cairn_raster_u8_view view = {edges, WIDTH, HEIGHT, WIDTH};
    cairn_contour_search_tokenizer *tokenizer;

    params.max_width = WIDTH;
    params.max_height = HEIGHT;
    params.max_edges = 8000;
    params.max_chains = 500;
    params.max_lines = 1000;
    params.max_segments = 2000;
    need(cairn_contour_search_tokenizer_create(&tokenizer, pool, &params), "tokens");
    need(cairn_contour_search_tokenizer_begin(tokenizer, view), "tokens");
    run(WORK_TOKENS, step_tokens, tokenizer);
    return cairn_contour_search_tokenizer_read(tokenizer);
}

static cairn_object_detections detect(cairn_pool *pool, const cairn_contour_search_tokens *tokens,
                                      const cairn_shape_model *model)
{
    cairn_object_detect_params params = cairn_object_detect_default(WIDTH, HEIGHT);
    cairn_object_detect_field *field;
    cairn_object_detector *detector;

    params.min_size = 120;
    params.max_size = 180;
    params.candidates = 5;
    params.max_segments = tokens->count;
    params.max_tokens = 1000;
    params.max_samples = model->sample_count;
    params.max_outline = model->outline_count;
    params.max_peaks = 4096;
    need(cairn_object_detect_field_create(&field, pool, &params), "field");
    need(cairn_object_detect_create(&detector, pool, &params), "detect");
    need(cairn_object_detect_field_begin(field, tokens, NULL), "field");
    run(WORK_FIELD, step_field, field);
    need(cairn_object_detect_begin(detector, field, model, NULL), "detect");
    run(WORK_DETECT, step_detector, detector);
    return cairn_object_detect_read(detector);
}

/* ---- Report ---- */

static int is_flag(const cairn_object_detection *d)
{
    cairn_real w = cairn_min(d->right, FLAG_X + 80) - cairn_max(d->left, FLAG_X),
               h = cairn_min(d->bottom, FLAG_Y + 120) - cairn_max(d->top, FLAG_Y),
               both = w > 0 && h > 0 ? w * h : 0;

    return both >= MIN_OVERLAP * ((d->right - d->left) * (d->bottom - d->top) + 80 * 120 - both);
}

static uint32_t report(const cairn_object_detections *found)
{
    uint32_t hash = HASH_START;

    for (int32_t i = 0; i < found->count; i++) {
        const cairn_object_detection *d = &found->found[i];
        const cairn_real numbers[] = {d->left,
                                      d->top,
                                      d->right,
                                      d->bottom,
                                      d->score,
                                      d->rigid_evidence,
                                      d->deformed_evidence,
                                      d->edge_proximity,
                                      d->grouped_evidence,
                                      d->rigid_proximity};
        const int32_t box[] = {cairn_real_to_int(cairn_rint(10 * d->left)),
                               cairn_real_to_int(cairn_rint(10 * d->top)),
                               cairn_real_to_int(cairn_rint(10 * d->right)),
                               cairn_real_to_int(cairn_rint(10 * d->bottom)),
                               cairn_real_to_int(cairn_rint(1000 * d->score)),
                               d->segment_count};

        console_numbers("detection", "left,top,right,bottom_0.1px,score_0.001,segments", box, 6);
        hash = hash_words(hash, numbers, sizeof numbers);
        hash = hash_words(hash, &found->segments[d->first_segment],
                          (size_t)d->segment_count * sizeof *found->segments);
    }
    return hash;
}

int main(void)
{
    cairn_contour_search_tokens tokens;
    cairn_object_detections found;
    cairn_shape_model model;
    cairn_pool pool;
    int32_t counts[3], bytes[4];

    need(cairn_pool_init(&pool, memory, sizeof memory), "pool");
    draw_image();
    model = build_model(&pool);
    tokens = find_tokens(&pool);
    counts[0] = tokens.count;
    counts[1] = tokens.chain_count;
    counts[2] = model.outline_count;
    console_numbers("image", "segments,chains,outline", counts, 3);
    found = detect(&pool, &tokens, &model);
    console_hash("detector", report(&found));
    for (int32_t work = 0; work < WORKS; work++)
        console_measured(work_names[work], &measures[work]);
    bytes[0] = (int32_t)pool.peak;
    bytes[1] = (int32_t)pool.size;
    bytes[2] = (int32_t)board_data_bytes();
    bytes[3] = (int32_t)board_stack_peak();
    console_numbers("measure pool_peak,pool,data,stack", "bytes", bytes, 4);
    board_exit(found.count < 1 || !is_flag(&found.found[0]));
}
