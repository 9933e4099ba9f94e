/* contour_search with memory of the heap that fits the image. */
#include "src/base/build.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/contour_search_run.h"
#include "src/host/base/heap_copy.h"
#include "src/host/base/interruption.h"
#include "src/host/detection/contour_search_run_work.h"

/* As written: capacity for symmetric points per segment, and in all; least token capacity; greatest
 * number of segments. */
enum { POINTS_PER_SEGMENT = 640, MAX_POINTS = 1 << 21, MIN_TOKENS = 64, MAX_SEGMENTS = 1 << 20 };

/* ---- Tokens ---- */

void cairn_contour_search_run_free_tokens(cairn_contour_search_tokens *tokens)
{
    free(tokens->lines);
    free(tokens->chain);
    free(tokens->strength_rank);
    free(tokens->ends);
    memset(tokens, 0, sizeof *tokens);
}

static cairn_status copy_tokens(cairn_contour_search_tokens *tokens,
                                const cairn_contour_search_tokens *found)
{
    *tokens = *found;
    tokens->lines = cairn_heap_copy(found->lines, found->count, sizeof *found->lines);
    tokens->chain = cairn_heap_copy(found->chain, found->count, sizeof *found->chain);
    tokens->strength_rank =
        cairn_heap_copy(found->strength_rank, found->count, sizeof *found->strength_rank);
    tokens->ends = cairn_heap_copy(found->ends, found->end_count, sizeof *found->ends);
    return tokens->lines != NULL && tokens->chain != NULL && tokens->strength_rank != NULL &&
                   tokens->ends != NULL
               ? CAIRN_OK
               : CAIRN_NO_MEMORY;
}

/* Runs a tokenizer in a block of memory. */
static cairn_status extract_tokens(cairn_contour_search_tokens *tokens,
                                   cairn_raster_u8_view strengths,
                                   const cairn_contour_search_tokenizer_params *params,
                                   void *memory, size_t bytes)
{
    cairn_contour_search_tokenizer *tokenizer;
    cairn_contour_search_tokens found;
    cairn_budget budget;
    cairn_pool pool;
    cairn_status status = cairn_pool_init(&pool, memory, bytes);

    if (status == CAIRN_OK)
        status = cairn_contour_search_tokenizer_create(&tokenizer, &pool, params);
    if (status == CAIRN_OK)
        status = cairn_contour_search_tokenizer_begin(tokenizer, strengths);
    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = CAIRN_INTERRUPTION_UNITS;
        status = cairn_contour_search_tokenizer_step(tokenizer, &budget);
    } while (status == CAIRN_MORE && !cairn_interruption_is_requested());
    if (status != CAIRN_OK)
        return status;
    found = cairn_contour_search_tokenizer_read(tokenizer);
    return copy_tokens(tokens, &found);
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
                                cairn_contour_search_tokenizer_params params, const char *path,
                                cairn_file_error *error)
{
    cairn_status status;
    int32_t edges;
    size_t bytes;
    void *memory;

    memset(tokens, 0, sizeof *tokens);
    if (cairn_raster_u8_check(strengths) != CAIRN_OK || params.min_strength < 1 ||
        params.min_strength > 255)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "no edge image, expected strengths from 1 to 255");
    edges = count_edges(strengths, params.min_strength);
    if (strengths.width > CAIRN_CONTOUR_SEARCH_MAX_SIDE ||
        strengths.height > CAIRN_CONTOUR_SEARCH_MAX_SIDE ||
        edges > CAIRN_CONTOUR_SEARCH_RUN_MAX_EDGES)
        return cairn_file_error_set(
            error, CAIRN_FULL, path, 0,
            "%d x %d pixels, %d of them edges, expected at most %d a side and %d of edges",
            (int)strengths.width, (int)strengths.height, (int)edges, CAIRN_CONTOUR_SEARCH_MAX_SIDE,
            (int)CAIRN_CONTOUR_SEARCH_RUN_MAX_EDGES);
    params.max_width = strengths.width;
    params.max_height = strengths.height;
    params.max_edges = params.max_chains = params.max_lines = edges + 1;
    params.max_segments = 3 * (edges + 1);
    bytes = cairn_contour_search_tokenizer_memory(&params) + CAIRN_ALIGN;
    memory = malloc(bytes);
    if (memory == NULL)
        return cairn_file_error_system(error, path, "find edges of", ENOMEM);
    status = extract_tokens(tokens, strengths, &params, memory, bytes);
    free(memory);
    if (status == CAIRN_OK)
        return CAIRN_OK;
    cairn_contour_search_run_free_tokens(tokens);
    return cairn_file_error_set(error, status, path, 0, "%s, expected edges that can be followed",
                                cairn_status_text(status));
}

cairn_status cairn_contour_search_run_tokens(cairn_contour_search_tokens *tokens,
                                             cairn_raster_u8_view strengths, int32_t min_strength,
                                             int32_t edgels, const char *path,
                                             cairn_file_error *error)
{
    cairn_contour_search_tokenizer_params params = cairn_contour_search_tokenizer_default();

    params.min_strength = min_strength;
    params.edgels = edgels != 0;
    return find_tokens(tokens, strengths, params, path, error);
}

cairn_status cairn_contour_search_run_tokens_as_written(cairn_contour_search_tokens *tokens,
                                                        cairn_raster_u8_view strengths,
                                                        int32_t min_strength, int32_t edgels,
                                                        cairn_real strong, const char *path,
                                                        cairn_file_error *error)
{
    cairn_contour_search_tokenizer_params params = cairn_contour_search_tokenizer_default();

    memset(tokens, 0, sizeof *tokens);
    if (!cairn_is_finite(strong) || strong < 0)
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "strong chains of %g times the mean strength, expected a number from 0 on",
            (double)strong);
    params.min_strength = min_strength;
    params.edgels = edgels != 0;
    params.mode = CAIRN_MODE_AS_WRITTEN;
    params.strong = strong;
    return find_tokens(tokens, strengths, params, path, error);
}

/* ---- The search ---- */

void cairn_contour_search_run_free(cairn_contour_search_result *result)
{
    free(result->objects);
    free(result->segments);
    free(result->discs);
    free(result->outline);
    for (int32_t k = 0; k < 2; k++) {
        free(result->trace[k]);
        free(result->mode_counts[k]);
    }
    memset(result, 0, sizeof *result);
}

static cairn_status copy_result(cairn_contour_search_result *result,
                                const cairn_contour_search_result *found)
{
    int ok;

    *result = *found;
    result->objects = cairn_heap_copy(found->objects, found->object_count, sizeof *found->objects);
    result->segments =
        cairn_heap_copy(found->segments, found->segment_count, sizeof *found->segments);
    result->discs = cairn_heap_copy(found->discs, found->disc_count, sizeof *found->discs);
    result->outline = cairn_heap_copy(found->outline, found->outline_count, sizeof *found->outline);
    ok = result->objects != NULL && result->segments != NULL && result->discs != NULL &&
         result->outline != NULL;
    for (int32_t k = 0; k < 2; k++) {
        result->trace[k] = NULL;
        result->mode_counts[k] = NULL;
        if (found->trace[k] == NULL)
            continue;
        result->trace[k] =
            cairn_heap_copy(found->trace[k], found->steps[k], sizeof *found->trace[k]);
        result->mode_counts[k] =
            cairn_heap_copy(found->mode_counts[k], found->steps[k], sizeof *found->mode_counts[k]);
        ok &= result->trace[k] != NULL && result->mode_counts[k] != NULL;
    }
    return ok ? CAIRN_OK : CAIRN_NO_MEMORY;
}

/* Runs a search in a block of memory. */
static cairn_status search_tokens(cairn_contour_search_result *result,
                                  const cairn_contour_search_tokens *tokens,
                                  const cairn_shape_model *model,
                                  const cairn_contour_search_params *params, void *memory,
                                  size_t bytes)
{
    cairn_contour_search_result found;
    cairn_contour_search *search;
    cairn_budget budget;
    cairn_pool pool;
    cairn_status status = cairn_pool_init(&pool, memory, bytes);

    if (status == CAIRN_OK)
        status = cairn_contour_search_create(&search, &pool, params);
    if (status == CAIRN_OK)
        status = cairn_contour_search_begin(search, tokens, model, NULL);
    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = CAIRN_INTERRUPTION_UNITS;
        status = cairn_contour_search_step(search, &budget);
    } while (status == CAIRN_MORE && !cairn_interruption_is_requested());
    if (status != CAIRN_OK)
        return status;
    found = cairn_contour_search_read(search);
    return copy_result(result, &found);
}

/* Sets the capacities of a grouping as written. */
static void set_written_capacities(cairn_contour_grouping_params *grouping,
                                   const cairn_contour_search_tokens *tokens)
{
    int64_t points = (int64_t)tokens->count * POINTS_PER_SEGMENT;

    grouping->max_tokens = tokens->count < MIN_TOKENS ? MIN_TOKENS : tokens->count;
    /* Two chain ends per segment at most; a chain whose pixels give no edgel has ends, too. */
    if (grouping->max_tokens < tokens->end_count / 2)
        grouping->max_tokens = tokens->end_count / 2;
    grouping->max_points = points < 1 ? 1 : points > MAX_POINTS ? MAX_POINTS : (int32_t)points;
}

int32_t cairn_contour_search_run_count_pieces(const cairn_contour_search_tokens *tokens,
                                              cairn_real length)
{
    double count = 0;

    for (int32_t i = 0; i < tokens->count; i++)
        count += (double)cairn_ceil(cairn_segment_length(tokens->lines[i]) / length);
    return !(count > MIN_TOKENS)                     ? MIN_TOKENS
           : count > CAIRN_CONTOUR_SEARCH_MAX_TOKENS ? CAIRN_CONTOUR_SEARCH_MAX_TOKENS
                                                     : (int32_t)count;
}

/* The params with the capacities that image and model need. */
static cairn_contour_search_params fitted_params(const cairn_contour_search_params *given,
                                                 const cairn_contour_search_tokens *tokens,
                                                 const cairn_shape_model *model)
{
    cairn_contour_search_params params = *given;

    params.grouping.max_width = tokens->width;
    params.grouping.max_height = tokens->height;
    params.grouping.max_samples = model->sample_count;
    params.grouping.max_outline = model->outline_count > 0 ? model->outline_count : 1;
    params.max_segments = tokens->count > 0 ? tokens->count : 1;
    if (params.grouping.mode >= CAIRN_MODE_AS_WRITTEN)
        set_written_capacities(&params.grouping, tokens);
    else
        params.grouping.max_tokens =
            params.grouping.token_length > 0
                ? cairn_contour_search_run_count_pieces(tokens, params.grouping.token_length)
                : 1;
    return params;
}

/* Description of the first argument out of range; NULL: none. */
static const char *bad_argument(const cairn_contour_search_params *params,
                                const cairn_contour_search_tokens *tokens,
                                const cairn_shape_model *model)
{
    cairn_fault fault = {-1, NULL};

    if (tokens->width < 1 || tokens->height < 1 || tokens->width > CAIRN_CONTOUR_SEARCH_MAX_SIDE ||
        tokens->height > CAIRN_CONTOUR_SEARCH_MAX_SIDE)
        return "the image's sides, expected 1 to 8192 pixels";
    if (cairn_shape_model_check(model, &fault) != CAIRN_OK)
        return fault.message;
    if (!(params->min_size > 0) || !(params->max_size >= params->min_size))
        return "the sizes, expected 0 < min_size <= max_size";
    if (!cairn_is_finite(params->max_size))
        return "max_size is not finite, expected a finite one";
    if (cairn_contour_grouping_memory(&params->grouping) == 0)
        return "the params of the grouping, expected the ranges of contour_grouping.h";
    return NULL;
}

static cairn_status refuse(cairn_status status, const cairn_contour_search_params *params,
                           const cairn_contour_search_tokens *tokens,
                           const cairn_shape_model *model, const char *path,
                           cairn_file_error *error)
{
    const char *what = bad_argument(params, tokens, model);

    if (status == CAIRN_NO_MEMORY)
        return cairn_file_error_system(error, path, "search", ENOMEM);
    if (what != NULL)
        return cairn_file_error_set(error, status, path, 0, "%s", what);
    if (status == CAIRN_NOT_FINITE)
        return cairn_file_error_set(
            error, status, path, 0,
            "a segment or an end of a chain is not finite, expected finite positions");
    return cairn_file_error_set(error, status, path, 0,
                                "%s, expected a model, sizes above 0 and rotations in range",
                                cairn_status_text(status));
}

cairn_status cairn_contour_search_run(cairn_contour_search_result *result,
                                      const cairn_contour_search_tokens *tokens,
                                      const cairn_shape_model *model,
                                      const cairn_contour_search_params *params, const char *path,
                                      cairn_file_error *error)
{
    cairn_contour_search_params fitted = fitted_params(params, tokens, model);
    size_t bytes = cairn_contour_search_memory(&fitted);
    cairn_status status = bytes > 0                           ? CAIRN_OK
                          : params->max_size > CAIRN_REAL_MAX ? CAIRN_NOT_FINITE
                                                              : CAIRN_BAD_ARGUMENT;
    void *memory = NULL;

    memset(result, 0, sizeof *result);
    if (fitted.grouping.mode >= CAIRN_MODE_AS_WRITTEN && tokens->count > MAX_SEGMENTS)
        return cairn_file_error_set(error, CAIRN_FULL, path, 0, "%d segments, expected at most %d",
                                    (int)tokens->count, MAX_SEGMENTS);
    if (status == CAIRN_OK) {
        memory = malloc(bytes + CAIRN_ALIGN);
        status = memory == NULL
                     ? CAIRN_NO_MEMORY
                     : search_tokens(result, tokens, model, &fitted, memory, bytes + CAIRN_ALIGN);
    }
    free(memory);
    if (status == CAIRN_OK)
        return CAIRN_OK;
    cairn_contour_search_run_free(result);
    return refuse(status, &fitted, tokens, model, path, error);
}
