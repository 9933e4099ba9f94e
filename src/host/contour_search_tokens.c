/* Tokens of a picture: chains of its edges, then their segments, or edgels along them. */
#include "src/core/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/contour_search.h"

/* The shortest piece of the mode as written, px: of shorter ones a walk has too many that fit. */
#define WRITTEN_PIECE 10
/* Edgels stand so many pixels apart, each with the direction between the pixels so far before
 * and behind it. */
enum { EDGEL_STEP = 3, EDGEL_REACH = 3 };
/* px: length of an edgel, which stands for mean length and look-ahead of segments. */
#define EDGEL_LENGTH 5

void cairn_contour_tokens_free(cairn_contour_tokens *tokens)
{
    free(tokens->lines);
    free(tokens->chain);
    free(tokens->strength);
    free(tokens->ends);
    memset(tokens, 0, sizeof *tokens);
}

static int allocate(cairn_contour_tokens *t, int32_t count)
{
    t->lines = malloc(((size_t)count + 1) * sizeof *t->lines);
    t->chain = malloc(((size_t)count + 1) * sizeof *t->chain);
    t->strength = malloc(((size_t)count + 1) * sizeof *t->strength);
    return t->lines != NULL && t->chain != NULL && t->strength != NULL;
}

static cairn_vec2 place_of(const cairn_edge_pixel *p)
{
    cairn_vec2 place = {(cairn_real)p->x, (cairn_real)p->y};

    return place;
}

static cairn_status take_edgels(cairn_contour_tokens *t, const cairn_edge_chain_result *r)
{
    const cairn_real half = CAIRN_REAL(0.5) * EDGEL_STEP;

    if (!allocate(t, r->pixel_count / EDGEL_STEP + r->chain_count))
        return CAIRN_NO_MEMORY;
    for (int32_t c = 0; c < r->chain_count; c++) {
        const cairn_edge_pixel *pixels = &r->pixels[r->chains[c].first];
        int32_t last = r->chains[c].count - 1;

        for (int32_t i = EDGEL_STEP / 2; i <= last; i += EDGEL_STEP) {
            int32_t from = i < EDGEL_REACH ? 0 : i - EDGEL_REACH,
                    to = i + EDGEL_REACH > last ? last : i + EDGEL_REACH;
            cairn_vec2 at = place_of(&pixels[i]),
                       along =
                           cairn_vec2_scale(cairn_vec2_unit(cairn_vec2_sub(
                                                place_of(&pixels[to]), place_of(&pixels[from]))),
                                            half);

            if (!(cairn_vec2_norm_squared(along) > 0))
                continue;
            t->lines[t->count].a = cairn_vec2_sub(at, along);
            t->lines[t->count].b = cairn_vec2_add(at, along);
            t->chain[t->count++] = c;
        }
    }
    t->mean_length = t->look_ahead = EDGEL_LENGTH;
    return CAIRN_OK;
}

/* What is looked for beside the segments themselves. */
typedef struct token_kind {
    int32_t edgels, written;
    cairn_real strong;
} token_kind;

/* Segments, in the default mode but the virtual ones: those lie on no edge. */
static cairn_status take_segments(cairn_contour_tokens *t, cairn_edge_segment_set *set,
                                  const cairn_edge_chain_result *r, int32_t written)
{
    cairn_status status = cairn_edge_segment_begin(set, r);
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
    if (!allocate(t, found.count))
        return CAIRN_NO_MEMORY;
    t->count = found.count - (written ? 0 : found.virtual_count);
    for (int32_t i = 0; i < t->count; i++) {
        t->lines[i] = found.segments[i].line;
        t->chain[i] = found.segments[i].chain;
    }
    t->mean_length = found.mean_length;
    t->look_ahead = found.look_ahead;
    return CAIRN_OK;
}

/* The end points of strong chains. */
static cairn_status take_ends(cairn_contour_tokens *t, const cairn_edge_chain_result *r,
                              cairn_real strong)
{
    double sum = 0, pixels = 0;

    t->ends = malloc(2 * ((size_t)r->chain_count + 1) * sizeof *t->ends);
    if (t->ends == NULL)
        return CAIRN_NO_MEMORY;
    for (int32_t c = 0; c < r->chain_count; c++) {
        sum += (double)r->chains[c].strength * r->chains[c].count;
        pixels += r->chains[c].count;
    }
    for (int32_t c = 0; c < r->chain_count; c++) {
        const cairn_edge_chain *chain = &r->chains[c];

        if ((double)chain->strength * pixels < (double)strong * sum)
            continue;
        t->ends[t->end_count++] = place_of(&r->pixels[chain->first]);
        t->ends[t->end_count++] = place_of(&r->pixels[chain->first + chain->count - 1]);
    }
    return CAIRN_OK;
}

static cairn_status find(cairn_contour_tokens *t, cairn_raster_u8_view strengths,
                         const token_kind *kind, const cairn_edge_chain_params *chain,
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
    t->chains = r.chain_count;
    status = kind->edgels ? take_edgels(t, &r) : take_segments(t, segments, &r, kind->written);
    return status == CAIRN_OK && kind->written ? take_ends(t, &r, kind->strong) : status;
}

/* ---- Strengths ---- */

/* The strongest pixel within one of a place. */
static int32_t strength_at(cairn_raster_u8_view view, cairn_vec2 at)
{
    int32_t x = (int32_t)at.x, y = (int32_t)at.y, most = 0;

    for (int32_t v = y > 0 ? y - 1 : 0; v <= y + 1 && v < view.height; v++)
        for (int32_t u = x > 0 ? x - 1 : 0; u <= x + 1 && u < view.width; u++)
            most = view.data[v * view.stride + u] > most ? view.data[v * view.stride + u] : most;
    return most;
}

/* The mean along a line, 0 ... 255. */
static int32_t strength_of(cairn_raster_u8_view view, cairn_segment line)
{
    int32_t steps = 1 + (int32_t)(cairn_segment_length(line) / 2), sum = 0;

    for (int32_t k = 0; k <= steps; k++)
        sum += strength_at(
            view, cairn_vec2_add(line.a, cairn_vec2_scale(cairn_vec2_sub(line.b, line.a),
                                                          (cairn_real)k / (cairn_real)steps)));
    return sum / (steps + 1);
}

/* The share of all edges that are weaker than each; of those that are as strong, half. */
static void rank_strengths(cairn_contour_tokens *t, cairn_raster_u8_view view)
{
    double length[256] = {0}, weaker[256], all = 0;

    for (int32_t i = 0; i < t->count; i++)
        length[strength_of(view, t->lines[i])] += (double)cairn_segment_length(t->lines[i]);
    for (int32_t level = 0; level < 256; level++) {
        weaker[level] = all + length[level] / 2;
        all += length[level];
    }
    for (int32_t i = 0; i < t->count; i++)
        t->strength[i] =
            all > 0 ? (cairn_real)(weaker[strength_of(view, t->lines[i])] / all) : CAIRN_REAL(0.5);
}

static int32_t count_edges(cairn_raster_u8_view strengths, int32_t min_strength)
{
    int32_t count = 0;

    for (int32_t y = 0; y < strengths.height; y++)
        for (int32_t x = 0; x < strengths.width; x++)
            count += strengths.data[y * strengths.stride + x] >= min_strength;
    return count;
}

static cairn_status find_tokens(cairn_contour_tokens *tokens, cairn_raster_u8_view strengths,
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
                                    "no picture of edges, expected strengths from 1 to 255");
    edges = count_edges(strengths, min_strength);
    if (strengths.width > CAIRN_CONTOUR_SIDE_MOST || strengths.height > CAIRN_CONTOUR_SIDE_MOST ||
        edges > CAIRN_CONTOUR_EDGES_MOST)
        return cairn_file_error_set(
            error, CAIRN_FULL, path, 0,
            "%d x %d pixels, %d of them edges, expected at most %d a side and %d of edges",
            (int)strengths.width, (int)strengths.height, (int)edges, CAIRN_CONTOUR_SIDE_MOST,
            (int)CAIRN_CONTOUR_EDGES_MOST);
    chain.max_width = strengths.width;
    chain.max_height = strengths.height;
    chain.max_edges = chain.max_chains = edges + 1;
    chain.min_strength = min_strength;
    if (kind->written && !kind->edgels)
        segment.min_piece = WRITTEN_PIECE;
    segment.max_lines = kind->edgels ? 1 : edges + 1;
    segment.max_segments = kind->edgels ? 1 : 3 * (edges + 1);
    tokens->pool_bytes =
        cairn_edge_chain_memory(&chain) + cairn_edge_segment_memory(&segment) + CAIRN_ALIGN;
    memory = malloc(tokens->pool_bytes);
    if (memory == NULL)
        return cairn_file_error_system(error, path, "find edges of", ENOMEM);
    status = cairn_pool_init(&pool, memory, tokens->pool_bytes);
    if (status == CAIRN_OK)
        status = find(tokens, strengths, kind, &chain, &segment, &pool);
    free(memory);
    if (status == CAIRN_OK)
        rank_strengths(tokens, strengths);
    tokens->width = strengths.width;
    tokens->height = strengths.height;
    if (status != CAIRN_OK) {
        cairn_contour_tokens_free(tokens);
        return cairn_file_error_set(error, status, path, 0,
                                    "%s, expected edges that can be followed",
                                    cairn_status_text(status));
    }
    return CAIRN_OK;
}

cairn_status cairn_contour_tokens_find(cairn_contour_tokens *tokens, cairn_raster_u8_view strengths,
                                       int32_t min_strength, int32_t edgels, const char *path,
                                       cairn_file_error *error)
{
    token_kind kind = {edgels, 0, 0};

    return find_tokens(tokens, strengths, min_strength, &kind, path, error);
}

cairn_status cairn_contour_tokens_find_written(cairn_contour_tokens *tokens,
                                               cairn_raster_u8_view strengths, int32_t min_strength,
                                               int32_t edgels, cairn_real strong, const char *path,
                                               cairn_file_error *error)
{
    token_kind kind = {edgels, 1, strong};

    memset(tokens, 0, sizeof *tokens);
    if (!isfinite((double)strong) || strong < 0)
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "strong chains of %g times the mean strength, expected a number from 0 on",
            (double)strong);
    return find_tokens(tokens, strengths, min_strength, &kind, path, error);
}
