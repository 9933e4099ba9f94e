/* contour_search_run: contour_search of a whole image at once, with memory of the heap that fits the
 * image. */
#ifndef CAIRN_CONTOUR_SEARCH_RUN_H
#define CAIRN_CONTOUR_SEARCH_RUN_H

#include "cairn/contour_search.h"
#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Greatest number of edge pixels of an image; more is refused. */
#define CAIRN_CONTOUR_SEARCH_RUN_MAX_EDGES (INT32_C(1) << 20)

/* Extracts the segments of an edge image. edgels 1: extracts edgels instead, short straight pieces
 * at even steps along the chains. CAIRN_FULL: a side above CAIRN_CONTOUR_SEARCH_MAX_SIDE, or too
 * many edges; CAIRN_BAD_ARGUMENT, CAIRN_NO_MEMORY. On failure there is nothing to free. The error
 * message names `path`.
 *
 * tokens: set to the segments, on the heap
 * strengths: edge strengths, 0: no edge
 * min_strength: 1 ... 255: weaker pixels are not edges
 * path: used in the error
 * edgels: 0: segments; 1: edgels */
CAIRN_CHECKED cairn_status cairn_contour_search_run_tokens(cairn_contour_search_tokens *tokens,
                                                           cairn_raster_u8_view strengths,
                                                           int32_t min_strength, int32_t edgels,
                                                           const char *path,
                                                           cairn_file_error *error);

/* Extracts the tokens for the mode as written. Statuses of cairn_contour_search_run_tokens();
 * CAIRN_BAD_ARGUMENT also: strong.
 *
 * tokens: set to the tokens, on the heap
 * strengths: edge strengths, 0: no edge
 * min_strength: 1 ... 255: weaker pixels are not edges
 * edgels: 0: segments; 1: edgels
 * strong: finite, >= 0; see cairn_contour_search_tokenizer_params
 * path: used in the error */
CAIRN_CHECKED cairn_status cairn_contour_search_run_tokens_as_written(
    cairn_contour_search_tokens *tokens, cairn_raster_u8_view strengths, int32_t min_strength,
    int32_t edgels, cairn_real strong, const char *path, cairn_file_error *error);

/* Frees the arrays of `tokens`. */
void cairn_contour_search_run_free_tokens(cairn_contour_search_tokens *tokens);

/* Detects the instances of a model; the capacities of params are set by the image and the model.
 * CAIRN_BAD_ARGUMENT: params, or a model that cannot be searched. CAIRN_FULL: in the mode as
 * written, more than 2^20 segments. CAIRN_NO_MEMORY. On failure there is nothing to free. The error
 * message names `path`.
 *
 * result: set to the result, its arrays on the heap
 * tokens: segments of the image
 * path: used in the error
 * model: model to search */
CAIRN_CHECKED cairn_status cairn_contour_search_run(cairn_contour_search_result *result,
                                                    const cairn_contour_search_tokens *tokens,
                                                    const cairn_shape_model *model,
                                                    const cairn_contour_search_params *params,
                                                    const char *path, cairn_file_error *error);

/* Frees the arrays of `result`. */
void cairn_contour_search_run_free(cairn_contour_search_result *result);

#ifdef __cplusplus
}
#endif

#endif
