/* Token extraction from an edge image: chains of edges, then their segments, or edgels along
 * them. */
#include "src/base/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/contour_search.h"

/* Least length of a segment in the mode as written, px; shorter ones give too many candidate
 * extensions. */
#define WRITTEN_MIN_PIECE_PX 10
/* Greatest distance of a chain's pixel from its polyline in the mode as written, px. */
#define WRITTEN_TOLERANCE_PX CAIRN_REAL(2.5)
/* Spacing of edgels in chain pixels; each has the direction between the pixels EDGEL_SPAN_PIXELS
 * before and after it. */
enum { EDGEL_STEP_PIXELS = 3, EDGEL_SPAN_PIXELS = 3 };
/* px: used as mean segment length and look-ahead for edgels. */
#define EDGEL_SCALE_PX 5

void cairn_contour_search_tokens_free(cairn_contour_search_tokens *tokens)
{
    free(tokens->lines);
    free(tokens->chain);
    free(tokens->strength_rank);
    free(tokens->ends);
    memset(tokens, 0, sizeof *tokens);
}

static int allocate(cairn_contour_search_tokens *tokens, int32_t count)
{
    tokens->lines = malloc(((size_t)count + 1) * sizeof *tokens->lines);
    tokens->chain = malloc(((size_t)count + 1) * sizeof *tokens->chain);
    tokens->strength_rank = malloc(((size_t)count + 1) * sizeof *tokens->strength_rank);
    return tokens->lines != NULL && tokens->chain != NULL && tokens->strength_rank != NULL;
}

static cairn_vec2 pixel_position(const cairn_edge_chain_pixel *pixel)
{
    cairn_vec2 position = {(cairn_real)pixel->x, (cairn_real)pixel->y};

    return position;
}

static cairn_status extract_edgels(cairn_contour_search_tokens *tokens,
                                   const cairn_edge_chain_result *chains)
{
    const cairn_real half = CAIRN_REAL(0.5) * EDGEL_STEP_PIXELS;

    if (!allocate(tokens, chains->pixel_count / EDGEL_STEP_PIXELS + chains->chain_count))
        return CAIRN_NO_MEMORY;
    for (int32_t c = 0; c < chains->chain_count; c++) {
        const cairn_edge_chain_pixel *pixels = &chains->pixels[chains->chains[c].first];
        int32_t last = chains->chains[c].count - 1;

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
            tokens->lines[tokens->count].a = cairn_vec2_sub(position, along);
            tokens->lines[tokens->count].b = cairn_vec2_add(position, along);
            tokens->chain[tokens->count++] = c;
        }
    }
    tokens->mean_length = tokens->look_ahead = EDGEL_SCALE_PX;
    return CAIRN_OK;
}

/* Kind of tokens to extract; strong: threshold factor of strong chains. */
typedef struct token_kind {
    int32_t edgels, written;
    cairn_real strong;
} token_kind;

/* Extracts segments; without the virtual ones in the default mode, because they lie on no edge. */
static cairn_status extract_segments(cairn_contour_search_tokens *tokens,
                                     cairn_edge_segment_set *set,
                                     const cairn_edge_chain_result *chains, int32_t written)
{
    cairn_status status = cairn_edge_segment_begin(set, chains);
    cairn_edge_segment_result found;
    cairn_budget budget;

    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = INT32_MAX;
        status = cairn_edge_segment_step(set, &budget);
    } while (status == CAIRN_MORE);
    if (status != CAIRN_OK)
        return status;
    found = cairn_edge_segment_read(set);
    if (!allocate(tokens, found.count))
        return CAIRN_NO_MEMORY;
    tokens->count = found.count - (written ? 0 : found.virtual_count);
    for (int32_t i = 0; i < tokens->count; i++) {
        tokens->lines[i] = found.segments[i].line;
        tokens->chain[i] = found.segments[i].chain;
    }
    tokens->mean_length = found.mean_length;
    tokens->look_ahead = found.look_ahead;
    return CAIRN_OK;
}

/* Extracts the end points of strong chains. */
static cairn_status extract_strong_ends(cairn_contour_search_tokens *tokens,
                                        const cairn_edge_chain_result *chains, cairn_real strong)
{
    double sum = 0, pixels = 0;

    tokens->ends = malloc(2 * ((size_t)chains->chain_count + 1) * sizeof *tokens->ends);
    if (tokens->ends == NULL)
        return CAIRN_NO_MEMORY;
    for (int32_t c = 0; c < chains->chain_count; c++) {
        sum += (double)chains->chains[c].strength * chains->chains[c].count;
        pixels += chains->chains[c].count;
    }
    for (int32_t c = 0; c < chains->chain_count; c++) {
        const cairn_edge_chain *chain = &chains->chains[c];

        if ((double)chain->strength * pixels < (double)strong * sum)
            continue;
        tokens->ends[tokens->end_count++] = pixel_position(&chains->pixels[chain->first]);
        tokens->ends[tokens->end_count++] =
            pixel_position(&chains->pixels[chain->first + chain->count - 1]);
    }
    return CAIRN_OK;
}

static cairn_status extract_tokens(cairn_contour_search_tokens *tokens,
                                   cairn_raster_u8_view strengths, const token_kind *kind,
                                   const cairn_edge_chain_params *chain,
                                   const cairn_edge_segment_params *segment, cairn_pool *pool)
{
    cairn_edge_segment_set *segments;
    cairn_edge_chain_set *chains;
    cairn_edge_chain_result r;
    cairn_budget budget;
    cairn_status status = cairn_edge_chain_create(&chains, pool, chain);

    if (status == CAIRN_OK)
        status = cairn_edge_segment_create(&segments, pool, segment);
    if (status == CAIRN_OK)
        status = cairn_edge_chain_begin(chains, strengths);
    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = INT32_MAX;
        status = cairn_edge_chain_step(chains, &budget);
    } while (status == CAIRN_MORE);
    if (status != CAIRN_OK)
        return status;
    r = cairn_edge_chain_read(chains);
    tokens->chain_count = r.chain_count;
    status = kind->edgels ? extract_edgels(tokens, &r)
                          : extract_segments(tokens, segments, &r, kind->written);
    return status == CAIRN_OK && kind->written ? extract_strong_ends(tokens, &r, kind->strong)
                                               : status;
}

/* ---- Strengths ---- */

/* Greatest strength within one pixel of a point. */
static int32_t max_strength_near(cairn_raster_u8_view view, cairn_vec2 at)
{
    int32_t x = (int32_t)at.x, y = (int32_t)at.y, strongest = 0;

    for (int32_t v = y > 0 ? y - 1 : 0; v <= y + 1 && v < view.height; v++)
        for (int32_t u = x > 0 ? x - 1 : 0; u <= x + 1 && u < view.width; u++)
            strongest = view.data[v * view.stride + u] > strongest ? view.data[v * view.stride + u]
                                                                   : strongest;
    return strongest;
}

/* Mean strength along a line, 0 ... 255. */
static int32_t mean_strength(cairn_raster_u8_view view, cairn_segment line)
{
    int32_t steps = 1 + (int32_t)(cairn_segment_length(line) / 2), sum = 0;

    for (int32_t k = 0; k <= steps; k++)
        sum += max_strength_near(
            view, cairn_vec2_add(line.a, cairn_vec2_scale(cairn_vec2_sub(line.b, line.a),
                                                          (cairn_real)k / (cairn_real)steps)));
    return sum / (steps + 1);
}

/* Ranks strengths: the share of the total edge length that is weaker, plus half of that of equal
 * strength. */
static void rank_strengths(cairn_contour_search_tokens *tokens, cairn_raster_u8_view view)
{
    double length[256] = {0}, weaker[256], total = 0;

    for (int32_t i = 0; i < tokens->count; i++)
        length[mean_strength(view, tokens->lines[i])] +=
            (double)cairn_segment_length(tokens->lines[i]);
    for (int32_t level = 0; level < 256; level++) {
        weaker[level] = total + length[level] / 2;
        total += length[level];
    }
    for (int32_t i = 0; i < tokens->count; i++)
        tokens->strength_rank[i] =
            total > 0 ? (cairn_real)(weaker[mean_strength(view, tokens->lines[i])] / total)
                      : CAIRN_REAL(0.5);
}

static int32_t count_edges(cairn_raster_u8_view strengths, int32_t min_strength)
{
    int32_t count = 0;

    for (int32_t y = 0; y < strengths.height; y++)
        for (int32_t x = 0; x < strengths.width; x++)
            count += strengths.data[y * strengths.stride + x] >= min_strength;
    return count;
}

static cairn_status find_tokens(cairn_contour_search_tokens *tokens, cairn_raster_u8_view strengths,
                                int32_t min_strength, const token_kind *kind, const char *path,
                                cairn_file_error *error)
{
    cairn_edge_chain_params chain = cairn_edge_chain_default();
    cairn_edge_segment_params segment = cairn_edge_segment_default();
    cairn_status status;
    cairn_pool pool;
    int32_t edges;
    void *memory;

    memset(tokens, 0, sizeof *tokens);
    if (cairn_raster_u8_check(strengths) != CAIRN_OK || min_strength < 1 || min_strength > 255)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "no edge image, expected strengths from 1 to 255");
    edges = count_edges(strengths, min_strength);
    if (strengths.width > CAIRN_CONTOUR_SEARCH_MAX_SIDE ||
        strengths.height > CAIRN_CONTOUR_SEARCH_MAX_SIDE || edges > CAIRN_CONTOUR_SEARCH_MAX_EDGES)
        return cairn_file_error_set(
            error, CAIRN_FULL, path, 0,
            "%d x %d pixels, %d of them edges, expected at most %d a side and %d of edges",
            (int)strengths.width, (int)strengths.height, (int)edges, CAIRN_CONTOUR_SEARCH_MAX_SIDE,
            (int)CAIRN_CONTOUR_SEARCH_MAX_EDGES);
    chain.max_width = strengths.width;
    chain.max_height = strengths.height;
    chain.max_edges = chain.max_chains = edges + 1;
    chain.min_strength = min_strength;
    if (kind->written && !kind->edgels) {
        segment.min_piece = WRITTEN_MIN_PIECE_PX;
        segment.tolerance = WRITTEN_TOLERANCE_PX;
    }
    segment.max_lines = kind->edgels ? 1 : edges + 1;
    segment.max_segments = kind->edgels ? 1 : 3 * (edges + 1);
    tokens->pool_bytes =
        cairn_edge_chain_memory(&chain) + cairn_edge_segment_memory(&segment) + CAIRN_ALIGN;
    memory = malloc(tokens->pool_bytes);
    if (memory == NULL)
        return cairn_file_error_system(error, path, "find edges of", ENOMEM);
    status = cairn_pool_init(&pool, memory, tokens->pool_bytes);
    if (status == CAIRN_OK)
        status = extract_tokens(tokens, strengths, kind, &chain, &segment, &pool);
    free(memory);
    if (status == CAIRN_OK)
        rank_strengths(tokens, strengths);
    tokens->width = strengths.width;
    tokens->height = strengths.height;
    if (status != CAIRN_OK) {
        cairn_contour_search_tokens_free(tokens);
        return cairn_file_error_set(error, status, path, 0,
                                    "%s, expected edges that can be followed",
                                    cairn_status_text(status));
    }
    return CAIRN_OK;
}

cairn_status cairn_contour_search_tokens_find(cairn_contour_search_tokens *tokens,
                                              cairn_raster_u8_view strengths, int32_t min_strength,
                                              int32_t edgels, const char *path,
                                              cairn_file_error *error)
{
    token_kind kind = {.edgels = edgels};

    return find_tokens(tokens, strengths, min_strength, &kind, path, error);
}

cairn_status cairn_contour_search_tokens_find_written(cairn_contour_search_tokens *tokens,
                                                      cairn_raster_u8_view strengths,
                                                      int32_t min_strength, int32_t edgels,
                                                      cairn_real strong, const char *path,
                                                      cairn_file_error *error)
{
    token_kind kind = {.edgels = edgels, .written = 1, .strong = strong};

    memset(tokens, 0, sizeof *tokens);
    if (!isfinite((double)strong) || strong < 0)
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "strong chains of %g times the mean strength, expected a number from 0 on",
            (double)strong);
    return find_tokens(tokens, strengths, min_strength, &kind, path, error);
}
