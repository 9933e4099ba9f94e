/* Log-likelihood ratio of edges, object against background, for every position, direction and size.
 *
 * Method:
 * 1. For each size a grid of cells, which are a share of the size (scale pyramid).
 * 2. Every segment is rasterized in the direction bins near its own, at a cost by angle and
 *    strength rank.
 * 3. Minimum costs are propagated a few sigmas along rows, then along columns (separable distance
 *    transform), and converted to likelihoods.
 * 4. The background likelihood is the mean over a window somewhat larger than the object
 *    (summed-area table). The result is the logarithm of the ratio of both, with a probability of
 *    occlusion.
 * Of method PARTS the field holds the chains of edges as polylines instead.
 *
 * Memory layout: the field; levels from the smallest size on; one direction of the first level, its
 * summed-area table, a strip; direction and cost of each segment; chains.
 *
 * Source: this project's, for the verification of Adluru 2008, section 5.3. */
#include "src/base/build.h"

#include <string.h>

#include "src/base/step.h"
#include "src/detection/object_detect_work.h"

/* Standard deviation of the position, cells. */
static const float SIGMA_CELLS = 1;
/* Propagation radius of a cost, and half the window's side, cells. */
enum { SPREAD_CELLS = 3, WINDOW_CELLS = 30 };
/* Log-likelihood ratio outside the image, nats; cost of a cell without an edge in reach. */
static const float OUTSIDE_LLR = -0.7F, MAX_COST = 30;
/* Ratio of consecutive sizes. */
static const cairn_real SIZE_STEP = CAIRN_REAL(1.2);

enum { DIRECTION_BINS = OBJECT_DETECT_BINS, MARGIN_CELLS = OBJECT_DETECT_MARGIN_CELLS };
/* Limits of the params. */
enum {
    MIN_SIZE_PX = 8,
    MAX_SIZE_PX = 2 * CAIRN_CONTOUR_SEARCH_MAX_SIDE,
    MAX_CANDIDATES = 64,
    MAX_MATCHES = 64,
    MAX_NEAREST = 64,
    MAX_APPEARANCE_WEIGHT = 1000,
    MAX_GROUPING_WEIGHT = 100
};

/* As written: below every score, because the text names no threshold for hypotheses. */
enum { ALL_SCORES = -100 };

/* Cells cleared, rasterized, transformed, summed in a unit; segments chained. */
enum {
    CLEARED_PER_UNIT = 64,
    RASTERIZED_PER_UNIT = 12,
    TRANSFORMED_PER_UNIT = 6,
    SUMMED_PER_UNIT = 2,
    SEGMENTS_PER_UNIT = 2
};

/* ---- Params ---- */

#define INTEGER(field, ...)  CAIRN_INTEGER(cairn_object_detect_params, field, __VA_ARGS__)
#define NUMBER(field, ...)   CAIRN_NUMBER(cairn_object_detect_params, field, __VA_ARGS__)
#define POSITIVE(field, ...) CAIRN_NUMBER_ABOVE(cairn_object_detect_params, field, __VA_ARGS__)

/* Default, lowest and highest value; defaults from the image's size: of the smallest images. */
static const cairn_parameter rows[] = {
    NUMBER(min_size, 24, MIN_SIZE_PX, MAX_SIZE_PX),
    NUMBER(max_size, 24, MIN_SIZE_PX, MAX_SIZE_PX),
    INTEGER(mirror, 1, 0, 1),
    INTEGER(candidates, 30, 1, MAX_CANDIDATES),
    NUMBER(overlap, CAIRN_REAL(0.2), 0, 1),
    NUMBER(min_score, 0, -CAIRN_REAL_MAX, CAIRN_REAL_MAX),
    INTEGER(method, CAIRN_OBJECT_DETECT_EVIDENCE, CAIRN_OBJECT_DETECT_EVIDENCE,
            CAIRN_OBJECT_DETECT_PARTS),
    INTEGER(bundles, CAIRN_OBJECT_DETECT_BUNDLES, CAIRN_OBJECT_DETECT_BUNDLES,
            CAIRN_OBJECT_DETECT_NO_BUNDLES),
    INTEGER(cut_count, 0, 0, INT32_MAX),
    INTEGER(matches, 2, 1, MAX_MATCHES),
    INTEGER(nearest, 20, 1, MAX_NEAREST),
    INTEGER(modes_only, 0, 0, 1),
    NUMBER(appearance_weight, 8, 0, MAX_APPEARANCE_WEIGHT),
    INTEGER(occluded, 0, 0, 1),
    NUMBER(verify, CAIRN_REAL(0.08), 0, MAX_GROUPING_WEIGHT),
    INTEGER(mode, CAIRN_MODE_DEFAULT, CAIRN_MODE_DEFAULT, CAIRN_MODE_AS_WRITTEN),
    INTEGER(appearance_nearest, 0, 0, 1),
    INTEGER(max_width, 1, 1, CAIRN_CONTOUR_SEARCH_MAX_SIDE),
    INTEGER(max_height, 1, 1, CAIRN_CONTOUR_SEARCH_MAX_SIDE),
    INTEGER(max_segments, 8192, 1, CAIRN_CONTOUR_SEARCH_MAX_SEGMENTS),
    INTEGER(max_tokens, 8192, 1, CAIRN_CONTOUR_SEARCH_MAX_TOKENS),
    INTEGER(max_samples, 128, 1, 1024),
    INTEGER(max_outline, 512, 3, 4096),
    INTEGER(max_chains, 10000, 1, 1 << 24),
    POSITIVE(max_chain_length, 8192, 0, CAIRN_REAL(1e6)),
    INTEGER(max_peaks, 1 << 16, 4096, 1 << 24),
    INTEGER(max_detections, 256, 1, INT32_MAX),
};
const cairn_parameters cairn_object_detect_parameters =
    CAIRN_PARAMETERS("object_detect", cairn_object_detect_params, rows);

cairn_object_detect_params cairn_object_detect_default(int32_t width, int32_t height)
{
    const cairn_vec2 sides = {(cairn_real)width, (cairn_real)height};
    cairn_real diagonal = cairn_vec2_norm(sides);
    cairn_object_detect_params params;

    cairn_parameters_preset(&cairn_object_detect_parameters, &params);
    params.min_size = cairn_max(params.min_size, diagonal / 10);
    params.max_size = cairn_max(params.max_size, diagonal);
    params.max_width = width;
    params.max_height = height;
    return params;
}

cairn_object_detect_params cairn_object_detect_as_written(int32_t width, int32_t height)
{
    cairn_object_detect_params params = cairn_object_detect_default(width, height);

    params.mode = CAIRN_MODE_AS_WRITTEN;
    params.method = CAIRN_OBJECT_DETECT_PARTS;
    params.mirror = 0;
    params.verify = 0;
    params.min_score = ALL_SCORES;
    params.appearance_nearest = 1;
    return params;
}

/* The rules of the mode as written. */
static cairn_status check_written(const cairn_object_detect_params *params,
                                  cairn_object_fault *fault)
{
    int is_written = cairn_object_detect_is_as_written(params);
    cairn_status status =
        cairn_parameters_require(is_written || !params->appearance_nearest, "object_detect",
                                 "appearance_nearest: 1 as written only", fault);

    if (status == CAIRN_OK)
        status = cairn_parameters_require(
            !is_written || (params->method == CAIRN_OBJECT_DETECT_PARTS &&
                            params->bundles == CAIRN_OBJECT_DETECT_BUNDLES),
            "object_detect", "mode: as written method PARTS with BUNDLES", fault);
    if (status == CAIRN_OK)
        status = cairn_parameters_require(
            !is_written || (!params->mirror && !params->modes_only && !params->occluded &&
                            !(params->verify > 0)),
            "object_detect", "mode: as written mirror, modes_only, occluded and verify 0", fault);
    return status;
}

cairn_status cairn_object_detect_check(const cairn_object_detect_params *params,
                                       cairn_object_fault *fault)
{
    cairn_status status = cairn_parameters_check(&cairn_object_detect_parameters, params, fault);
    int32_t longer;

    if (status != CAIRN_OK)
        return status;
    longer = params->max_width > params->max_height ? params->max_width : params->max_height;
    status = cairn_parameters_require(params->max_size >= params->min_size, "object_detect",
                                      "max_size: at least min_size", fault);
    if (status == CAIRN_OK)
        status = cairn_parameters_require(
            params->min_size >=
                (cairn_real)longer * OBJECT_DETECT_CELLS_PER_SIZE / OBJECT_DETECT_MAX_SIDE_CELLS,
            "object_detect", "min_size: at least a fiftieth of max_width and max_height", fault);
    if (status == CAIRN_OK)
        status = check_written(params, fault);
    return status;
}

/* Number of sizes in the range. */
static int32_t level_count_of(const cairn_object_detect_params *params)
{
    const cairn_real rounding = CAIRN_REAL(1e-6);
    int32_t levels =
        1 + cairn_real_to_int(
                cairn_log(params->max_size / params->min_size) / cairn_log(SIZE_STEP) + rounding);

    CAIRN_ASSERT(levels <= OBJECT_DETECT_MAX_LEVELS);
    return levels;
}

int32_t cairn_object_detect_set_levels(object_detect_level *level,
                                       const cairn_object_detect_params *params, int32_t width,
                                       int32_t height)
{
    int32_t levels = params->method == CAIRN_OBJECT_DETECT_EVIDENCE ? level_count_of(params) : 0;
    cairn_real ratio = 1;

    for (int32_t k = 0; k < levels; k++) {
        level[k].size = params->min_size * ratio;
        level[k].cell_size = level[k].size / OBJECT_DETECT_CELLS_PER_SIZE;
        level[k].width = 1 + cairn_real_to_int((cairn_real)width / level[k].cell_size);
        level[k].height = 1 + cairn_real_to_int((cairn_real)height / level[k].cell_size);
        ratio *= SIZE_STEP;
    }
    return levels;
}

/* ---- Memory ---- */

/* The arrays of method EVIDENCE. */
static void take_levels(cairn_object_detect_field *field, cairn_pool *pool,
                        const cairn_object_detect_params *params)
{
    object_detect_level level[OBJECT_DETECT_MAX_LEVELS];
    int32_t levels =
        cairn_object_detect_set_levels(level, params, params->max_width, params->max_height);
    size_t w = (size_t)level[0].width, h = (size_t)level[0].height;

    for (int32_t k = 0; k < levels; k++)
        CAIRN_TAKE(field, pool, level[k].llr,
                   DIRECTION_BINS * cairn_object_detect_layer(&level[k]));
    CAIRN_TAKE(field, pool, cost, w * h);
    CAIRN_TAKE(field, pool, sums, (w + 1) * (h + 1));
    CAIRN_TAKE(field, pool, strip, (w > h ? w : h) + (size_t)(2 * SPREAD_CELLS));
    CAIRN_TAKE(field, pool, angle, params->max_segments);
    CAIRN_TAKE(field, pool, strength_cost, params->max_segments);
    if (field != NULL)
        field->levels = cairn_object_detect_set_levels(field->level, params, params->max_width,
                                                       params->max_height);
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_object_detect_field *build(cairn_pool *pool, const cairn_object_detect_params *params)
{
    cairn_object_detect_field *field = cairn_object_take(pool, sizeof *field);

    if (params->method == CAIRN_OBJECT_DETECT_EVIDENCE) {
        take_levels(field, pool, params);
    } else {
        CAIRN_TAKE(field, pool, chains.curves, params->max_chains);
        CAIRN_TAKE(field, pool, chains.points, 2 * (size_t)params->max_segments);
    }
    if (field != NULL) {
        field->params = *params;
        field->status = CAIRN_EMPTY;
    }
    return field;
}

CAIRN_OBJECT_OF(object_detect_field, object_detect_field, build, object_detect);

cairn_status cairn_object_detect_field_begin(cairn_object_detect_field *field,
                                             const cairn_contour_search_tokens *tokens,
                                             cairn_fault *fault)
{
    cairn_status status;

    if (field == NULL)
        return cairn_refuse(fault, -1, "no field, expected one", CAIRN_BAD_ARGUMENT);
    status = cairn_contour_search_tokens_check(tokens, field->params.max_segments, fault);
    if (status != CAIRN_OK)
        return status;
    if (tokens->width > field->params.max_width || tokens->height > field->params.max_height)
        return cairn_refuse(fault, -1, "an image beyond max_width or max_height", CAIRN_FULL);
    if (field->params.method == CAIRN_OBJECT_DETECT_PARTS)
        for (int32_t i = 0; i < tokens->count; i++)
            if (tokens->chain[i] < 0 || tokens->chain[i] >= tokens->chain_count)
                return cairn_refuse(fault, i, "a segment of no chain, expected one of chain_count",
                                    CAIRN_BAD_ARGUMENT);
    if (field->params.method == CAIRN_OBJECT_DETECT_PARTS &&
        tokens->chain_count > field->params.max_chains)
        return cairn_refuse(fault, -1, "more chains than the capacity max_chains", CAIRN_FULL);
    field->tokens = *tokens;
    (void)cairn_object_detect_set_levels(field->level, &field->params, tokens->width,
                                         tokens->height);
    field->status = CAIRN_MORE;
    field->resume = field->units_charged = 0;
    return CAIRN_OK;
}

/* ---- Edges ---- */

/* Direction and cost by strength of a segment. */
static void prepare_segment(cairn_object_detect_field *field, int32_t index)
{
    cairn_segment line = field->tokens.lines[index];

    field->angle[index] = cairn_atan2(line.b.y - line.a.y, line.b.x - line.a.x);
    field->strength_cost[index] = -cairn_log(
        cairn_max(CONTOUR_SEARCH_MIN_STRENGTH_RATIO, 2 * field->tokens.strength_rank[index]));
}

/* Steps of half a cell or less in which a line is rasterized. */
static int32_t steps_of_line(const object_detect_level *level, cairn_segment line)
{
    return 1 + cairn_real_to_int(2 * cairn_segment_length(line) / level->cell_size);
}

/* Rasterizes a line into the cells of one direction. */
static void rasterize_line(const object_detect_level *level, cairn_segment line, float *cost,
                           float line_cost)
{
    int32_t steps = steps_of_line(level, line);

    for (int32_t k = 0; k <= steps; k++) {
        cairn_real t = (cairn_real)k / (cairn_real)steps;
        int32_t x = cairn_real_to_int(
            cairn_floor((line.a.x + t * (line.b.x - line.a.x)) / level->cell_size));
        int32_t y = cairn_real_to_int(
            cairn_floor((line.a.y + t * (line.b.y - line.a.y)) / level->cell_size));

        if (x >= 0 && y >= 0 && x < level->width && y < level->height &&
            line_cost < cost[y * level->width + x])
            cost[y * level->width + x] = line_cost;
    }
}

/* Deviation of the segment at the cursor from the direction, sigmas. */
static cairn_real deviation_of(const cairn_object_detect_field *field)
{
    return cairn_contour_search_field_deviation(field->angle[field->cursor], field->bin) /
           CONTOUR_SEARCH_ANGLE_SIGMA;
}

/* Units of the segment at the cursor. */
static int32_t units_of_segment(const cairn_object_detect_field *field)
{
    if (cairn_abs(deviation_of(field)) > CONTOUR_SEARCH_MAX_ANGLE_SIGMAS)
        return 1;
    return 1 + steps_of_line(&field->level[field->index], field->tokens.lines[field->cursor]) /
                   RASTERIZED_PER_UNIT;
}

/* Rasterizes the segment at the cursor when it is near the direction. */
static void rasterize_segment(cairn_object_detect_field *field)
{
    cairn_real deviation = deviation_of(field);

    if (cairn_abs(deviation) <= CONTOUR_SEARCH_MAX_ANGLE_SIGMAS)
        rasterize_line(&field->level[field->index], field->tokens.lines[field->cursor], field->cost,
                       (float)(field->strength_cost[field->cursor] + deviation * deviation / 2));
}

/* One-dimensional distance transform of a row or column of `count` cells, `step` apart. */
CAIRN_STEP_NOT_INLINED
static void strip_distance_transform(float *strip, float *cost, int32_t count, int32_t step)
{
    for (int32_t i = 0; i < SPREAD_CELLS; i++)
        strip[i] = strip[count + SPREAD_CELLS + i] = MAX_COST;
    for (int32_t i = 0; i < count; i++)
        strip[SPREAD_CELLS + i] = cost[i * step];
    for (int32_t i = 0; i < count; i++) {
        float smallest = strip[SPREAD_CELLS + i];

        for (int32_t k = 1; k <= SPREAD_CELLS; k++) {
            float neighbour = strip[SPREAD_CELLS + i - k] < strip[SPREAD_CELLS + i + k]
                                  ? strip[SPREAD_CELLS + i - k]
                                  : strip[SPREAD_CELLS + i + k];

            neighbour += (float)(k * k) / (2 * SIGMA_CELLS * SIGMA_CELLS);
            smallest = neighbour < smallest ? neighbour : smallest;
        }
        cost[i * step] = smallest;
    }
}

/* Clears a row of the direction's layer, margins included, and of its costs. */
static void clear_row(cairn_object_detect_field *field, int32_t row)
{
    object_detect_level *level = &field->level[field->index];
    size_t length = cairn_object_detect_row(level);
    float *llr =
        &level->llr[(size_t)field->bin * cairn_object_detect_layer(level) + (size_t)row * length];

    for (size_t i = 0; i < length; i++)
        llr[i] = OUTSIDE_LLR;
    for (int32_t x = 0; x < level->width && row < level->height; x++)
        field->cost[row * level->width + x] = MAX_COST;
}

/* Converts a row of costs to likelihoods, and adds it to their summed-area table. */
static void sum_row(cairn_object_detect_field *field, int32_t y)
{
    const float none = (float)cairn_exp((cairn_real)-MAX_COST);
    int32_t w = field->level[field->index].width;
    cairn_real *above = &field->sums[y * (w + 1)], *sums = above + w + 1, row = 0;
    float *cost = &field->cost[y * w];

    if (y == 0)
        memset(above, 0, (size_t)(w + 1) * sizeof *above);
    sums[0] = 0;
    for (int32_t x = 0; x < w; x++) {
        cost[x] = cost[x] < MAX_COST ? (float)cairn_exp((cairn_real)-cost[x]) : none;
        row += (cairn_real)cost[x];
        sums[x + 1] = above[x + 1] + row;
    }
}

/* Log-likelihood ratio of every cell of a row against the mean of its window. */
static void set_llr_row(cairn_object_detect_field *field, int32_t y)
{
    object_detect_level *level = &field->level[field->index];
    const cairn_real *sums = field->sums;
    const float *likelihood = &field->cost[y * level->width];
    int32_t w = level->width, h = level->height;
    int32_t above = y > WINDOW_CELLS ? y - WINDOW_CELLS : 0,
            below = y + WINDOW_CELLS < h ? y + WINDOW_CELLS : h;
    float *row =
        &level->llr[(size_t)field->bin * cairn_object_detect_layer(level) +
                    (size_t)(y + MARGIN_CELLS) * cairn_object_detect_row(level) + MARGIN_CELLS];
    /* Below half a last digit of the probability of occlusion: no edge is in reach. */
    const float none = (float)cairn_exp((cairn_real)-MAX_COST),
                no_edge_llr = (float)cairn_log(CONTOUR_SEARCH_OCCLUSION_PROBABILITY);

    for (int32_t x = 0; x < w; x++) {
        int32_t left = x > WINDOW_CELLS ? x - WINDOW_CELLS : 0,
                right = x + WINDOW_CELLS < w ? x + WINDOW_CELLS : w;
        cairn_real sum, background;

        if (likelihood[x] <= none) {
            row[x] = no_edge_llr;
            continue;
        }
        sum = sums[below * (w + 1) + right] - sums[above * (w + 1) + right] -
              sums[below * (w + 1) + left] + sums[above * (w + 1) + left];
        background = cairn_max(CONTOUR_SEARCH_MIN_BACKGROUND,
                               sum / ((cairn_real)(below - above) * (cairn_real)(right - left)));
        row[x] = (float)cairn_log((cairn_real)(float)(CONTOUR_SEARCH_OCCLUSION_PROBABILITY +
                                                      (1 - CONTOUR_SEARCH_OCCLUSION_PROBABILITY) *
                                                          (cairn_real)likelihood[x] / background));
    }
}

/* Likelihood ratios of one direction of a level. */
static int compute_direction(cairn_object_detect_field *field, cairn_budget *budget)
{
    const object_detect_level *level = &field->level[field->index];

    CAIRN_STEP_BEGIN(field->direction_resume);
    for (field->cursor = 0; field->cursor < level->height + 2 * MARGIN_CELLS; field->cursor++) {
        CAIRN_STEP_CHARGE(field, direction_resume, budget,
                          1 + (2 * level->width + 2 * MARGIN_CELLS) / CLEARED_PER_UNIT);
        clear_row(field, field->cursor);
    }
    for (field->cursor = 0; field->cursor < field->tokens.count; field->cursor++) {
        CAIRN_STEP_CHARGE(field, direction_resume, budget, units_of_segment(field));
        rasterize_segment(field);
    }
    for (field->cursor = 0; field->cursor < level->height; field->cursor++) {
        CAIRN_STEP_CHARGE(field, direction_resume, budget, 1 + level->width / TRANSFORMED_PER_UNIT);
        strip_distance_transform(field->strip, &field->cost[field->cursor * level->width],
                                 level->width, 1);
    }
    for (field->cursor = 0; field->cursor < level->width; field->cursor++) {
        CAIRN_STEP_CHARGE(field, direction_resume, budget,
                          1 + level->height / TRANSFORMED_PER_UNIT);
        strip_distance_transform(field->strip, &field->cost[field->cursor], level->height,
                                 level->width);
    }
    for (field->cursor = 0; field->cursor < level->height; field->cursor++) {
        CAIRN_STEP_CHARGE(field, direction_resume, budget, 1 + level->width / SUMMED_PER_UNIT);
        sum_row(field, field->cursor);
    }
    for (field->cursor = 0; field->cursor < level->height; field->cursor++) {
        CAIRN_STEP_CHARGE(field, direction_resume, budget, 1 + level->width / SUMMED_PER_UNIT);
        set_llr_row(field, field->cursor);
    }
    CAIRN_STEP_END(field->direction_resume);
}

/* Method EVIDENCE: all levels. */
static int compute_levels(cairn_object_detect_field *field, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(field->resume);
    for (field->cursor = 0; field->cursor < field->tokens.count; field->cursor++) {
        CAIRN_STEP_CHARGE_UNIT(field, resume, budget);
        prepare_segment(field, field->cursor);
    }
    field->direction_resume = 0;
    for (field->index = 0; field->index < field->levels; field->index++)
        for (field->bin = 0; field->bin < DIRECTION_BINS; field->bin++)
            CAIRN_STEP_RUN(field, resume, budget, compute_direction);
    CAIRN_STEP_END(field->resume);
}

/* ---- Chains ---- */

static void clear_chains(object_detect_chains *chains, int32_t count)
{
    chains->count = count;
    memset(chains->curves, 0, (size_t)count * sizeof *chains->curves);
}

/* The end of the chain whose first segment is at the cursor. */
static int32_t end_of_chain(const cairn_object_detect_field *field)
{
    return cairn_contour_search_end_of_chain(&field->tokens, field->cursor);
}

/* Makes the polyline of the chain at the cursor, which goes to the next one. */
static void add_next_chain(cairn_object_detect_field *field)
{
    int32_t from = field->cursor, to = end_of_chain(field);

    cairn_object_detect_add_chain(&field->chains, &field->tokens, from, to,
                                  &field->chains.points[field->next_point]);
    field->next_point += to - from + 1;
    field->cursor = to;
}

/* Method PARTS: the chains as polylines. */
static int make_chains(cairn_object_detect_field *field, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(field->resume);
    CAIRN_STEP_CHARGE(field, resume, budget, 1 + field->tokens.chain_count / CLEARED_PER_UNIT);
    clear_chains(&field->chains, field->tokens.chain_count);
    field->next_point = 0;
    for (field->cursor = 0; field->cursor < field->tokens.count;) {
        CAIRN_STEP_CHARGE(field, resume, budget,
                          1 + (end_of_chain(field) - field->cursor) / SEGMENTS_PER_UNIT);
        add_next_chain(field);
    }
    CAIRN_STEP_END(field->resume);
}

/* ---- The step ---- */

cairn_status cairn_object_detect_field_step(cairn_object_detect_field *field, cairn_budget *budget)
{
    if (field == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (field->status == CAIRN_MORE &&
        (field->params.method == CAIRN_OBJECT_DETECT_PARTS ? make_chains(field, budget)
                                                           : compute_levels(field, budget)))
        field->status = CAIRN_OK;
    return field->status == CAIRN_MORE ? CAIRN_MORE : CAIRN_OK;
}
