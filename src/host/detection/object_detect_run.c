/* object_detect with memory of the heap that fits image and model. */
#include "src/base/build.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/object_detect_run.h"
#include "src/host/base/heap_copy.h"
#include "src/host/detection/contour_search_run_work.h"

/* Limits of the params; cells per object size, and greatest number of cells along an image's
 * side. */
enum {
    MIN_SIZE_PX = 8,
    MAX_SIZE_PX = 2 * CAIRN_CONTOUR_SEARCH_MAX_SIDE,
    MAX_CANDIDATES = 64,
    MAX_MATCHES = 64,
    MAX_NEAREST = 64,
    MAX_APPEARANCE_WEIGHT = 1000,
    MAX_GROUPING_WEIGHT = 100,
    CELLS_PER_SIZE = 40,
    MAX_SIDE_CELLS = 2000
};
/* As written: detections that there is memory for at first; factor of the next attempt; limit. */
enum { FIRST_DETECTIONS = 1024, DETECTIONS_FACTOR = 8, MAX_DETECTIONS = 1 << 17 };

struct cairn_object_detect_run_image {
    cairn_object_detect_params params; /* with capacities for the image */
    cairn_object_detect_field *field;
    void *memory; /* that of the field */
};

/* ---- Params ---- */

static cairn_status check_parts(const cairn_object_detect_params *params, const char *path,
                                cairn_file_error *error)
{
    if (params->method < CAIRN_OBJECT_DETECT_EVIDENCE || params->method > CAIRN_OBJECT_DETECT_PARTS)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "method %" PRId32 ", expected 0 or 1", params->method);
    if (params->bundles < CAIRN_OBJECT_DETECT_BUNDLES ||
        params->bundles > CAIRN_OBJECT_DETECT_NO_BUNDLES)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "bundles %" PRId32 ", expected 0 to 2", params->bundles);
    if (params->mode != CAIRN_MODE_DEFAULT && params->mode != CAIRN_MODE_AS_WRITTEN)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "mode %" PRId32 ", expected 0 or 1", params->mode);
    if (params->appearance_nearest != 0 &&
        (params->appearance_nearest != 1 || params->mode != CAIRN_MODE_AS_WRITTEN))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "appearance_nearest %" PRId32 ", expected 0, or 1 as written",
                                    params->appearance_nearest);
    if (params->mode == CAIRN_MODE_AS_WRITTEN &&
        (params->method != CAIRN_OBJECT_DETECT_PARTS ||
         params->bundles != CAIRN_OBJECT_DETECT_BUNDLES || params->modes_only || params->occluded ||
         params->verify > 0))
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "as written by another method, with other bundles, modes, occluded or verify, "
            "which the thesis does not have, expected parts without them");
    if (params->matches < 1 || params->matches > MAX_MATCHES || params->nearest < 1 ||
        params->nearest > MAX_NEAREST)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "%" PRId32 " matches and %" PRId32
                                    " nearest votes, expected 1 to %d and 1 to %d",
                                    params->matches, params->nearest, MAX_MATCHES, MAX_NEAREST);
    return CAIRN_OK;
}

static cairn_status check_params(const cairn_object_detect_params *params,
                                 const cairn_contour_search_tokens *tokens, const char *path,
                                 cairn_file_error *error)
{
    int32_t longer = tokens->width > tokens->height ? tokens->width : tokens->height;
    double min_size = (double)longer * CELLS_PER_SIZE / MAX_SIDE_CELLS;

    if (!(params->min_size >= MIN_SIZE_PX && params->min_size <= MAX_SIZE_PX))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "min_size %g, expected %d to %d pixels",
                                    (double)params->min_size, MIN_SIZE_PX, MAX_SIZE_PX);
    if (!(params->max_size >= params->min_size && params->max_size <= MAX_SIZE_PX))
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0, "max_size %g, expected %g to %d pixels",
            (double)params->max_size, (double)params->min_size, MAX_SIZE_PX);
    if (!((double)params->min_size >= min_size))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "min_size %g in an image of %" PRId32
                                    " pixels, expected at least %g",
                                    (double)params->min_size, longer, min_size);
    if (params->candidates < 1 || params->candidates > MAX_CANDIDATES)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "%" PRId32 " candidates, expected 1 to %d", params->candidates,
                                    MAX_CANDIDATES);
    if (!(params->overlap >= 0 && params->overlap <= 1))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "overlap %g, expected 0 to 1", (double)params->overlap);
    if (!cairn_is_finite(params->min_score))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "min_score %g, expected a finite one",
                                    (double)params->min_score);
    if (!(params->appearance_weight >= 0 && params->appearance_weight <= MAX_APPEARANCE_WEIGHT))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "appearance_weight %g, expected 0 to %d",
                                    (double)params->appearance_weight, MAX_APPEARANCE_WEIGHT);
    if (!(params->verify >= 0 && params->verify <= MAX_GROUPING_WEIGHT))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "verify %g, expected 0 to %d", (double)params->verify,
                                    MAX_GROUPING_WEIGHT);
    return check_parts(params, path, error);
}

/* Greatest length of a chain, the gaps between its segments included, px. */
static cairn_real longest_chain(const cairn_contour_search_tokens *tokens)
{
    cairn_real longest = 1, length = 0;

    for (int32_t i = 0; i < tokens->count; i++) {
        if (i > 0 && tokens->chain[i] == tokens->chain[i - 1])
            length += cairn_vec2_norm(cairn_vec2_sub(tokens->lines[i].a, tokens->lines[i - 1].b));
        else
            length = 0;
        length += cairn_segment_length(tokens->lines[i]);
        longest = cairn_max(longest, length);
    }
    return longest;
}

/* The params with the capacities that the image needs; those for the model are the least. */
static cairn_object_detect_params fitted_params(const cairn_object_detect_params *given,
                                                const cairn_contour_search_tokens *tokens)
{
    cairn_object_detect_params params = *given;

    params.max_width = tokens->width;
    params.max_height = tokens->height;
    params.max_segments = tokens->count > 0 ? tokens->count : 1;
    params.max_tokens = cairn_contour_search_run_count_pieces(
        tokens, cairn_contour_grouping_default().token_length);
    params.max_chains = tokens->chain_count > 0 ? tokens->chain_count : 1;
    params.max_chain_length = longest_chain(tokens);
    params.max_samples = 1;
    params.max_outline = 3;
    params.max_detections = FIRST_DETECTIONS;
    return params;
}

/* ---- The field ---- */

void cairn_object_detect_run_free_image(cairn_object_detect_run_image *image)
{
    if (image != NULL)
        free(image->memory);
    free(image);
}

static cairn_status make_field(cairn_object_detect_run_image *image,
                               const cairn_contour_search_tokens *tokens, cairn_fault *fault)
{
    size_t bytes = cairn_object_detect_field_memory(&image->params) + CAIRN_ALIGN;
    cairn_budget budget;
    cairn_status status;
    cairn_pool pool;

    image->memory = malloc(bytes);
    if (image->memory == NULL)
        return CAIRN_NO_MEMORY;
    status = cairn_pool_init(&pool, image->memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_object_detect_field_create(&image->field, &pool, &image->params);
    if (status == CAIRN_OK)
        status = cairn_object_detect_field_begin(image->field, tokens, fault);
    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = CAIRN_UNBOUNDED;
        status = cairn_object_detect_field_step(image->field, &budget);
    } while (status == CAIRN_MORE);
    return status;
}

cairn_status cairn_object_detect_run_make(cairn_object_detect_run_image **image,
                                          const cairn_contour_search_tokens *tokens,
                                          const cairn_object_detect_params *params,
                                          const char *path, cairn_file_error *error)
{
    cairn_status status = check_params(params, tokens, path, error);
    cairn_fault fault = {-1, NULL};
    cairn_object_detect_run_image *made;

    *image = NULL;
    if (status != CAIRN_OK)
        return status;
    made = calloc(1, sizeof *made);
    if (made == NULL)
        return cairn_file_error_system(error, path, "detect", ENOMEM);
    made->params = fitted_params(params, tokens);
    status = make_field(made, tokens, &fault);
    if (status == CAIRN_OK) {
        *image = made;
        return CAIRN_OK;
    }
    cairn_object_detect_run_free_image(made);
    if (status == CAIRN_NO_MEMORY)
        return cairn_file_error_system(error, path, "detect", ENOMEM);
    return cairn_file_error_set(error, status, path, 0, "%s",
                                fault.message != NULL ? fault.message : cairn_status_text(status));
}

/* ---- The detector ---- */

void cairn_object_detect_run_free(cairn_object_detections *detections)
{
    free(detections->found);
    free(detections->segments);
    free(detections->outline);
    free(detections->parts);
    memset(detections, 0, sizeof *detections);
}

static cairn_status copy_detections(cairn_object_detections *detections,
                                    const cairn_object_detections *found)
{
    *detections = *found;
    detections->found = cairn_heap_copy(found->found, found->count, sizeof *found->found);
    detections->segments =
        cairn_heap_copy(found->segments, found->segment_count, sizeof *found->segments);
    detections->outline =
        cairn_heap_copy(found->outline, found->outline_count, sizeof *found->outline);
    detections->parts = cairn_heap_copy(found->parts, found->part_count, sizeof *found->parts);
    return detections->found != NULL && detections->segments != NULL &&
                   detections->outline != NULL && detections->parts != NULL
               ? CAIRN_OK
               : CAIRN_NO_MEMORY;
}

/* Runs a detector in a block of memory. */
static cairn_status detect_in(cairn_object_detections *detections,
                              const cairn_object_detect_run_image *image,
                              const cairn_object_detect_params *params,
                              const cairn_shape_model *model, void *memory, size_t bytes,
                              cairn_fault *fault)
{
    cairn_object_detector *detector;
    cairn_object_detections found;
    cairn_budget budget;
    cairn_pool pool;
    cairn_status status = cairn_pool_init(&pool, memory, bytes);

    if (status == CAIRN_OK)
        status = cairn_object_detect_create(&detector, &pool, params);
    if (status == CAIRN_OK)
        status = cairn_object_detect_begin(detector, image->field, model, fault);
    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = CAIRN_UNBOUNDED;
        status = cairn_object_detect_step(detector, &budget);
    } while (status == CAIRN_MORE);
    if (status != CAIRN_OK)
        return status;
    found = cairn_object_detect_read(detector);
    return copy_detections(detections, &found);
}

static cairn_status detect(cairn_object_detections *detections,
                           const cairn_object_detect_run_image *image,
                           const cairn_object_detect_params *params, const cairn_shape_model *model,
                           cairn_fault *fault)
{
    size_t bytes = cairn_object_detect_memory(params) + CAIRN_ALIGN;
    void *memory = malloc(bytes);
    cairn_status status = memory == NULL
                              ? CAIRN_NO_MEMORY
                              : detect_in(detections, image, params, model, memory, bytes, fault);

    free(memory);
    if (status != CAIRN_OK)
        cairn_object_detect_run_free(detections);
    return status;
}

/* The error of a model that was refused. */
static cairn_status refuse(cairn_status status, const cairn_object_detect_params *params,
                           const cairn_fault *fault, const char *path, cairn_file_error *error)
{
    if (status == CAIRN_NO_MEMORY)
        return cairn_file_error_system(error, path, "detect", ENOMEM);
    if (params->cuts != NULL)
        return cairn_file_error_set(error, status, path, 0,
                                    "%s, expected manually chosen fragments of its first outline",
                                    cairn_status_text(status));
    if (fault->message != NULL && status != CAIRN_EMPTY && status != CAIRN_FULL)
        return cairn_file_error_set(error, status, path, 0, "%s", fault->message);
    return cairn_file_error_set(error, status, path, 0,
                                "%s, expected an outline with length of 3 to 4096 samples",
                                cairn_status_text(status));
}

cairn_status cairn_object_detect_run(cairn_object_detections *detections,
                                     const cairn_object_detect_run_image *image,
                                     const cairn_shape_model *model, const char *path,
                                     cairn_file_error *error)
{
    enum { MAX_SAMPLES = 1024, MAX_OUTLINE = 4096 };
    cairn_object_detect_params params = image->params;
    cairn_fault fault = {-1, NULL};
    cairn_status status = cairn_shape_model_check(model, &fault);

    memset(detections, 0, sizeof *detections);
    if (status != CAIRN_OK)
        return cairn_file_error_set(error, status, path, 0, "%s", fault.message);
    if (model->outline_count > MAX_OUTLINE || model->sample_count > MAX_SAMPLES)
        return refuse(CAIRN_FULL, &params, &fault, path, error);
    params.max_samples = model->sample_count;
    params.max_outline = model->outline_count > 3 ? model->outline_count : 3;
    status = detect(detections, image, &params, model, &fault);
    while (status == CAIRN_FULL && params.mode == CAIRN_MODE_AS_WRITTEN &&
           params.max_detections < MAX_DETECTIONS) {
        params.max_detections *= DETECTIONS_FACTOR;
        status = detect(detections, image, &params, model, &fault);
    }
    return status == CAIRN_OK ? CAIRN_OK : refuse(status, &params, &fault, path, error);
}
