/* Token extraction from an edge image: chains of edges, then their segments, or edgels along
 * them.
 *
 * Method:
 * 1. Edge pixels are linked to chains (edge_chain).
 * 2. Chains are cut into segments (edge_segment), or sampled as edgels.
 * 3. As written: the ends of the strong chains.
 * 4. Each token has the mean strength of the edges along it, and a rank among all by a histogram.
 *
 * Memory layout: the tokenizer; lines, chain, strength and rank of each token; ends of chains; the
 * chain set; the segment set. */
#include "src/base/build.h"

#include <string.h>

#include "src/base/step.h"
#include "src/detection/contour_search_work.h"

/* No cut leaves a piece below this length in the mode as written, px; shorter ones give too many
 * candidate extensions. */
static const cairn_real WRITTEN_MIN_PIECE_PX = 10;
/* Greatest distance of a chain's pixel from its polyline in the mode as written, px. */
static const cairn_real WRITTEN_TOLERANCE_PX = CAIRN_REAL(2.5);
/* Spacing of edgels in chain pixels; each has the direction between the pixels EDGEL_SPAN_PIXELS
 * before and after it. */
enum { EDGEL_STEP_PIXELS = 3, EDGEL_SPAN_PIXELS = 3 };
/* px: used as mean segment length and look-ahead for edgels. */
enum { EDGEL_SCALE_PX = 5 };
/* Spacing of the samples of a token's strength, px. */
enum { STRENGTH_STEP_PX = 2 };
enum { STRENGTH_LEVELS = 256 };
enum { CHAINS_PER_UNIT = 8, SEGMENTS_PER_UNIT = 8, SAMPLES_PER_UNIT = 2, UNITS_PER_RANKS = 16 };

struct cairn_contour_search_tokenizer {
    cairn_edge_chain_set *chain_set;
    cairn_edge_segment_set *segment_set;
    cairn_contour_search_tokens tokens;
    uint8_t *strength; /* [max_segments] mean strength of each token */
    cairn_raster_u8_view view;
    cairn_edge_chain_result chains;
    /* State of a phase; no two of these phases are under way at a time. */
    union {
        /* the segments that are copied */
        cairn_edge_segment_result segments;
        /* then as written: sum of the strengths of all chain pixels, and their number */
        struct {
            cairn_real strength_sum, pixel_sum;
        };
        /* then: length of the tokens of each strength, or of those that are weaker; length of all */
        struct {
            cairn_real level[STRENGTH_LEVELS];
            cairn_real total;
        };
    };
    /* below 0: the error that ends the work */
    cairn_status status;
    int32_t is_pending, is_complete, resume, cursor, units_charged;
    cairn_contour_search_tokenizer_params params;
};

/* Greatest capacities. */
enum { MAX_PIXELS = 1 << 28, MAX_LINES = 1 << 26, MAX_SEGMENTS = 1 << 23 };

#define INTEGER(field, ...) CAIRN_INTEGER(cairn_contour_search_tokenizer_params, field, __VA_ARGS__)
#define NUMBER(field, ...)  CAIRN_NUMBER(cairn_contour_search_tokenizer_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_width, 640, 1, CAIRN_CONTOUR_SEARCH_MAX_SIDE),
    INTEGER(max_height, 480, 1, CAIRN_CONTOUR_SEARCH_MAX_SIDE),
    INTEGER(max_edges, 100000, 1, MAX_PIXELS),
    INTEGER(max_chains, 10000, 1, MAX_PIXELS),
    INTEGER(max_lines, 10000, 1, MAX_LINES),
    INTEGER(max_segments, CAIRN_CONTOUR_SEARCH_MAX_TOKENS, 1, MAX_SEGMENTS),
    INTEGER(min_strength, 1, 1, 255),
    INTEGER(edgels, 0, 0, 1),
    INTEGER(mode, CAIRN_MODE_DEFAULT, CAIRN_MODE_DEFAULT, CAIRN_MODE_AS_WRITTEN),
    NUMBER(strong, 1, 0, CAIRN_REAL_MAX),
};
extern const cairn_parameters cairn_contour_search_tokenizer_parameters;
const cairn_parameters cairn_contour_search_tokenizer_parameters =
    CAIRN_PARAMETERS("contour_search_tokenizer", cairn_contour_search_tokenizer_params, rows);

cairn_contour_search_tokenizer_params cairn_contour_search_tokenizer_default(void)
{
    cairn_contour_search_tokenizer_params params;

    cairn_parameters_preset(&cairn_contour_search_tokenizer_parameters, &params);
    return params;
}

cairn_status
cairn_contour_search_tokenizer_check(const cairn_contour_search_tokenizer_params *params,
                                     cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_contour_search_tokenizer_parameters, params, fault);
}

static cairn_edge_chain_params chain_params(const cairn_contour_search_tokenizer_params *params)
{
    cairn_edge_chain_params chain = cairn_edge_chain_default();

    chain.max_width = params->max_width;
    chain.max_height = params->max_height;
    chain.max_edges = params->max_edges;
    chain.max_chains = params->max_chains;
    chain.min_strength = params->min_strength;
    return chain;
}

static cairn_edge_segment_params segment_params(const cairn_contour_search_tokenizer_params *params)
{
    cairn_edge_segment_params segment = cairn_edge_segment_default();

    if (params->mode == CAIRN_MODE_AS_WRITTEN && !params->edgels) {
        segment.min_piece = WRITTEN_MIN_PIECE_PX;
        segment.tolerance = WRITTEN_TOLERANCE_PX;
    }
    segment.max_lines = params->edgels ? 1 : params->max_lines;
    segment.max_segments = params->edgels ? 1 : params->max_segments;
    return segment;
}

/* The object, its arrays and the sets of chains and segments; NULL from a counting pool. */
static cairn_contour_search_tokenizer *build(cairn_pool *pool,
                                             const cairn_contour_search_tokenizer_params *params)
{
    cairn_edge_chain_params chain = chain_params(params);
    cairn_edge_segment_params segment = segment_params(params);
    size_t ends = params->mode == CAIRN_MODE_AS_WRITTEN ? 2 * (size_t)params->max_chains : 0;
    cairn_contour_search_tokenizer *tokenizer = cairn_object_take(pool, sizeof *tokenizer);

    CAIRN_TAKE(tokenizer, pool, tokens.lines, params->max_segments);
    CAIRN_TAKE(tokenizer, pool, tokens.chain, params->max_segments);
    CAIRN_TAKE(tokenizer, pool, tokens.strength_rank, params->max_segments);
    CAIRN_TAKE(tokenizer, pool, strength, params->max_segments);
    CAIRN_TAKE(tokenizer, pool, tokens.ends, ends);
    CAIRN_TAKE_OBJECT(tokenizer, pool, chain_set, edge_chain, &chain);
    CAIRN_TAKE_OBJECT(tokenizer, pool, segment_set, edge_segment, &segment);
    if (tokenizer != NULL)
        tokenizer->params = *params;
    return tokenizer;
}

CAIRN_OBJECT(contour_search_tokenizer, contour_search_tokenizer, build);

cairn_status cairn_contour_search_tokenizer_begin(cairn_contour_search_tokenizer *tokenizer,
                                                  cairn_raster_u8_view strengths)
{
    cairn_contour_search_tokens *tokens;
    cairn_status status;

    if (tokenizer == NULL)
        return CAIRN_BAD_ARGUMENT;
    status = cairn_edge_chain_begin(tokenizer->chain_set, strengths);
    if (status != CAIRN_OK)
        return status;
    tokens = &tokenizer->tokens;
    tokens->count = tokens->chain_count = tokens->end_count = 0;
    tokens->mean_length = tokens->look_ahead = 0;
    tokens->width = strengths.width;
    tokens->height = strengths.height;
    tokens->pool_bytes = cairn_contour_search_tokenizer_memory(&tokenizer->params);
    tokenizer->view = strengths;
    tokenizer->status = CAIRN_OK;
    tokenizer->is_pending = 1;
    tokenizer->is_complete = 0;
    tokenizer->resume = tokenizer->units_charged = 0;
    return CAIRN_OK;
}

/* ---- Chains and tokens ---- */

static int is_written(const cairn_contour_search_tokenizer *tokenizer)
{
    return tokenizer->params.mode == CAIRN_MODE_AS_WRITTEN;
}

static cairn_vec2 pixel_position(const cairn_edge_chain_pixel *pixel)
{
    cairn_vec2 position = {(cairn_real)pixel->x, (cairn_real)pixel->y};

    return position;
}

/* Samples the edgels of a chain. CAIRN_FULL: more than max_segments. */
static cairn_status add_edgels(cairn_contour_search_tokenizer *tokenizer, int32_t chain)
{
    const cairn_real half = CAIRN_REAL(0.5) * EDGEL_STEP_PIXELS;
    const cairn_edge_chain_pixel *pixels =
        &tokenizer->chains.pixels[tokenizer->chains.chains[chain].first];
    cairn_contour_search_tokens *tokens = &tokenizer->tokens;
    int32_t last = tokenizer->chains.chains[chain].count - 1;

    for (int32_t i = EDGEL_STEP_PIXELS / 2; i <= last; i += EDGEL_STEP_PIXELS) {
        int32_t from = i < EDGEL_SPAN_PIXELS ? 0 : i - EDGEL_SPAN_PIXELS,
                to = i + EDGEL_SPAN_PIXELS > last ? last : i + EDGEL_SPAN_PIXELS;
        cairn_vec2 position = pixel_position(&pixels[i]),
                   along = cairn_vec2_scale(
                       cairn_vec2_unit(cairn_vec2_sub(pixel_position(&pixels[to]),
                                                      pixel_position(&pixels[from]))),
                       half);

        if (!(cairn_vec2_norm_squared(along) > 0))
            continue;
        if (tokens->count == tokenizer->params.max_segments)
            return CAIRN_FULL;
        tokens->lines[tokens->count].a = cairn_vec2_sub(position, along);
        tokens->lines[tokens->count].b = cairn_vec2_add(position, along);
        tokens->chain[tokens->count++] = chain;
    }
    return CAIRN_OK;
}

/* Starts to copy the segments; without the virtual ones in the default mode, because they lie on no
 * edge. */
static void begin_copy(cairn_contour_search_tokenizer *tokenizer)
{
    cairn_contour_search_tokens *tokens = &tokenizer->tokens;

    tokenizer->segments = cairn_edge_segment_read(tokenizer->segment_set);
    tokens->count =
        tokenizer->segments.count - (is_written(tokenizer) ? 0 : tokenizer->segments.virtual_count);
    tokens->mean_length = tokenizer->segments.mean_length;
    tokens->look_ahead = tokenizer->segments.look_ahead;
}

static void copy_segment(cairn_contour_search_tokenizer *tokenizer, int32_t index)
{
    tokenizer->tokens.lines[index] = tokenizer->segments.segments[index].line;
    tokenizer->tokens.chain[index] = tokenizer->segments.segments[index].chain;
}

/* ---- Ends of strong chains, as written ---- */

/* Adds the strengths of the pixels of a chain. */
static void add_strength(cairn_contour_search_tokenizer *tokenizer, int32_t index)
{
    const cairn_edge_chain *chain = &tokenizer->chains.chains[index];

    tokenizer->strength_sum += chain->strength * (cairn_real)chain->count;
    tokenizer->pixel_sum += (cairn_real)chain->count;
}

/* Adds the ends of a chain of at least `strong` times the mean strength. */
static void add_strong_ends(cairn_contour_search_tokenizer *tokenizer, int32_t index)
{
    const cairn_edge_chain *chain = &tokenizer->chains.chains[index];
    const cairn_edge_chain_pixel *pixels = &tokenizer->chains.pixels[chain->first];
    cairn_contour_search_tokens *tokens = &tokenizer->tokens;

    if (chain->strength * tokenizer->pixel_sum < tokenizer->params.strong * tokenizer->strength_sum)
        return;
    tokens->ends[tokens->end_count++] = pixel_position(&pixels[0]);
    tokens->ends[tokens->end_count++] = pixel_position(&pixels[chain->count - 1]);
}

/* ---- Strengths ---- */

/* Greatest strength within one pixel of a point. */
static int32_t max_strength_near(cairn_raster_u8_view view, cairn_vec2 at)
{
    int32_t x = cairn_real_to_int(at.x), y = cairn_real_to_int(at.y), strongest = 0;

    for (int32_t v = y > 0 ? y - 1 : 0; v <= y + 1 && v < view.height; v++)
        for (int32_t u = x > 0 ? x - 1 : 0; u <= x + 1 && u < view.width; u++)
            strongest = view.data[v * view.stride + u] > strongest ? view.data[v * view.stride + u]
                                                                   : strongest;
    return strongest;
}

static int32_t strength_steps(cairn_segment line)
{
    return 1 + cairn_real_to_int(cairn_segment_length(line) / STRENGTH_STEP_PX);
}

/* Mean strength along a line, 0 ... 255. */
static int32_t mean_strength(cairn_raster_u8_view view, cairn_segment line)
{
    int32_t steps = strength_steps(line), sum = 0;

    for (int32_t k = 0; k <= steps; k++)
        sum += max_strength_near(
            view, cairn_vec2_interpolate(line.a, line.b, (cairn_real)k / (cairn_real)steps));
    return sum / (steps + 1);
}

/* Strength of a token. */
static void set_strength(cairn_contour_search_tokenizer *tokenizer, int32_t index)
{
    cairn_segment line = tokenizer->tokens.lines[index];
    int32_t strength = mean_strength(tokenizer->view, line);

    tokenizer->strength[index] = (uint8_t)strength;
    tokenizer->level[strength] += cairn_segment_length(line);
}

/* The length that is weaker than each level, plus half of that of equal strength. */
static void sum_levels(cairn_contour_search_tokenizer *tokenizer)
{
    tokenizer->total = 0;
    for (int32_t level = 0; level < STRENGTH_LEVELS; level++) {
        cairn_real length = tokenizer->level[level];

        tokenizer->level[level] = tokenizer->total + length / 2;
        tokenizer->total += length;
    }
}

static void set_rank(cairn_contour_search_tokenizer *tokenizer, int32_t index)
{
    tokenizer->tokens.strength_rank[index] =
        tokenizer->total > 0 ? tokenizer->level[tokenizer->strength[index]] / tokenizer->total
                             : CAIRN_REAL(0.5);
}

/* ---- The step ---- */

/* The tokens: see Method in the head of this file. */
static int find_tokens(cairn_contour_search_tokenizer *tokenizer, cairn_budget *budget)
{
    cairn_contour_search_tokens *tokens = &tokenizer->tokens;
    const cairn_edge_chain_result *chains = &tokenizer->chains;

    CAIRN_STEP_BEGIN(tokenizer->resume);
    CAIRN_STEP_UNTIL(tokenizer->resume, (tokenizer->status = cairn_edge_chain_step(
                                             tokenizer->chain_set, budget)) == CAIRN_OK);
    tokenizer->chains = cairn_edge_chain_read(tokenizer->chain_set);
    tokens->chain_count = chains->chain_count;
    if (tokenizer->params.edgels) {
        for (tokenizer->cursor = 0; tokenizer->cursor < chains->chain_count; tokenizer->cursor++) {
            CAIRN_STEP_CHARGE(tokenizer, resume, budget,
                              1 + chains->chains[tokenizer->cursor].count / EDGEL_STEP_PIXELS);
            tokenizer->status = add_edgels(tokenizer, tokenizer->cursor);
            CAIRN_STEP_UNTIL(tokenizer->resume, tokenizer->status == CAIRN_OK);
        }
        tokens->mean_length = tokens->look_ahead = EDGEL_SCALE_PX;
    } else {
        tokenizer->status = cairn_edge_segment_begin(tokenizer->segment_set, chains);
        CAIRN_STEP_UNTIL(tokenizer->resume, tokenizer->status == CAIRN_OK);
        CAIRN_STEP_UNTIL(tokenizer->resume, (tokenizer->status = cairn_edge_segment_step(
                                                 tokenizer->segment_set, budget)) == CAIRN_OK);
        begin_copy(tokenizer);
        for (tokenizer->cursor = 0; tokenizer->cursor < tokens->count; tokenizer->cursor++) {
            CAIRN_STEP_CHARGE_EVERY(tokenizer, resume, budget, SEGMENTS_PER_UNIT,
                                    tokenizer->cursor);
            copy_segment(tokenizer, tokenizer->cursor);
        }
    }
    if (is_written(tokenizer)) {
        tokenizer->strength_sum = tokenizer->pixel_sum = 0;
        for (tokenizer->cursor = 0; tokenizer->cursor < chains->chain_count; tokenizer->cursor++) {
            CAIRN_STEP_CHARGE_EVERY(tokenizer, resume, budget, CHAINS_PER_UNIT, tokenizer->cursor);
            add_strength(tokenizer, tokenizer->cursor);
        }
        for (tokenizer->cursor = 0; tokenizer->cursor < chains->chain_count; tokenizer->cursor++) {
            CAIRN_STEP_CHARGE_EVERY(tokenizer, resume, budget, CHAINS_PER_UNIT, tokenizer->cursor);
            add_strong_ends(tokenizer, tokenizer->cursor);
        }
    }
    memset(tokenizer->level, 0, sizeof tokenizer->level);
    for (tokenizer->cursor = 0; tokenizer->cursor < tokens->count; tokenizer->cursor++) {
        CAIRN_STEP_CHARGE(tokenizer, resume, budget,
                          1 + strength_steps(tokens->lines[tokenizer->cursor]) / SAMPLES_PER_UNIT);
        set_strength(tokenizer, tokenizer->cursor);
    }
    CAIRN_STEP_CHARGE(tokenizer, resume, budget, UNITS_PER_RANKS);
    sum_levels(tokenizer);
    for (tokenizer->cursor = 0; tokenizer->cursor < tokens->count; tokenizer->cursor++) {
        CAIRN_STEP_CHARGE_EVERY(tokenizer, resume, budget, SEGMENTS_PER_UNIT, tokenizer->cursor);
        set_rank(tokenizer, tokenizer->cursor);
    }
    CAIRN_STEP_END(tokenizer->resume);
}

cairn_status cairn_contour_search_tokenizer_step(cairn_contour_search_tokenizer *tokenizer,
                                                 cairn_budget *budget)
{
    int is_done;

    if (tokenizer == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!tokenizer->is_pending)
        return CAIRN_OK;
    is_done = find_tokens(tokenizer, budget);
    if (!is_done && tokenizer->status >= CAIRN_OK)
        return CAIRN_MORE;
    tokenizer->is_pending = 0;
    tokenizer->is_complete = is_done;
    return tokenizer->status;
}

cairn_contour_search_tokens
cairn_contour_search_tokenizer_read(const cairn_contour_search_tokenizer *tokenizer)
{
    cairn_contour_search_tokens none;

    memset(&none, 0, sizeof none);
    return tokenizer->is_complete ? tokenizer->tokens : none;
}

/* ---- Tokens of a search ---- */

static int is_position(cairn_vec2 p)
{
    const cairn_real max_coordinate = 4 * CAIRN_CONTOUR_SEARCH_MAX_SIDE;

    return cairn_abs(p.x) <= max_coordinate && cairn_abs(p.y) <= max_coordinate;
}

cairn_status cairn_contour_search_tokens_check(const cairn_contour_search_tokens *tokens,
                                               int32_t max_lines, cairn_fault *fault)
{
    if (tokens == NULL || tokens->count < 0 || tokens->width < 1 || tokens->height < 1 ||
        (tokens->count > 0 &&
         (tokens->lines == NULL || tokens->chain == NULL || tokens->strength_rank == NULL)))
        return cairn_refuse(fault, -1, "no tokens of an image, expected those of a tokenizer",
                            CAIRN_BAD_ARGUMENT);
    if (tokens->count > max_lines)
        return cairn_refuse(fault, max_lines, "more segments than the capacity max_segments",
                            CAIRN_FULL);
    for (int32_t i = 0; i < tokens->count; i++)
        if (!is_position(tokens->lines[i].a) || !is_position(tokens->lines[i].b) ||
            !cairn_is_finite(tokens->strength_rank[i]))
            return cairn_refuse(
                fault, i,
                "a segment that is not finite or beyond 32768 pixels, expected one of "
                "the image",
                CAIRN_NOT_FINITE);
    return CAIRN_OK;
}

int32_t cairn_contour_search_end_of_chain(const cairn_contour_search_tokens *tokens, int32_t from)
{
    int32_t to = from + 1;

    while (to < tokens->count && tokens->chain[to] == tokens->chain[from])
        to++;
    return to;
}
