/* object_detect with memory of the heap that fits image and model. */
#include "src/base/build.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/object_detect_run.h"
#include "src/host/base/heap_copy.h"
#include "src/host/base/interruption.h"
#include "src/host/detection/contour_search_run_work.h"

/* As written: detections that there is memory for at first; factor of the next attempt; limit. */
enum { FIRST_DETECTIONS = 1024, DETECTIONS_FACTOR = 8, MAX_DETECTIONS = 1 << 17 };

struct cairn_object_detect_run_image {
    cairn_object_detect_params params; /* with capacities for the image */
    cairn_object_detect_field *field;
    void *memory; /* that of the field */
};

/* ---- Params ---- */

/* Greatest length of a chain, the gaps between its segments included, px. Segments that are not
 * finite do not count: the field refuses them. */
static cairn_real longest_chain(const cairn_contour_search_tokens *tokens)
{
    cairn_real longest = 1, length = 0;

    for (int32_t i = 0; i < tokens->count; i++) {
        if (i > 0 && tokens->chain[i] == tokens->chain[i - 1])
            length += cairn_vec2_norm(cairn_vec2_sub(tokens->lines[i].a, tokens->lines[i - 1].b));
        else
            length = 0;
        length += cairn_segment_length(tokens->lines[i]);
        if (cairn_is_finite(length))
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

/* The error of params that are refused, of the image or of a model. */
static cairn_status refuse_params(cairn_status status, const cairn_object_fault *fault,
                                  const char *path, cairn_file_error *error)
{
    if (fault->field == NULL)
        return cairn_file_error_set(error, status, path, 0,
                                    "params that contradict each other, expected %s", fault->rule);
    return cairn_file_error_set(error, status, path, 0, "%s is %g, expected %g to %g", fault->field,
                                (double)fault->value, (double)fault->lowest,
                                (double)fault->highest);
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
        budget.left = CAIRN_INTERRUPTION_UNITS;
        status = cairn_object_detect_field_step(image->field, &budget);
    } while (status == CAIRN_MORE && !cairn_interruption_is_requested());
    return status;
}

cairn_status cairn_object_detect_run_make(cairn_object_detect_run_image **image,
                                          const cairn_contour_search_tokens *tokens,
                                          const cairn_object_detect_params *params,
                                          const char *path, cairn_file_error *error)
{
    cairn_object_detect_params fitted = fitted_params(params, tokens);
    cairn_object_fault refused;
    cairn_fault fault = {-1, NULL};
    cairn_object_detect_run_image *made;
    cairn_status status;

    *image = NULL;
    if (cairn_object_detect_check(&fitted, &refused) != CAIRN_OK)
        return refuse_params(CAIRN_BAD_ARGUMENT, &refused, path, error);
    made = calloc(1, sizeof *made);
    if (made == NULL)
        return cairn_file_error_system(error, path, "detect", ENOMEM);
    made->params = fitted;
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
        budget.left = CAIRN_INTERRUPTION_UNITS;
        status = cairn_object_detect_step(detector, &budget);
    } while (status == CAIRN_MORE && !cairn_interruption_is_requested());
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
    return cairn_file_error_set(error, status, path, 0, "%s, expected an outline with length",
                                cairn_status_text(status));
}

cairn_status cairn_object_detect_run(cairn_object_detections *detections,
                                     const cairn_object_detect_run_image *image,
                                     const cairn_shape_model *model, const char *path,
                                     cairn_file_error *error)
{
    cairn_object_detect_params params = image->params;
    cairn_object_fault refused;
    cairn_fault fault = {-1, NULL};
    cairn_status status = cairn_shape_model_check(model, &fault);

    memset(detections, 0, sizeof *detections);
    if (status != CAIRN_OK)
        return cairn_file_error_set(error, status, path, 0, "%s", fault.message);
    params.max_samples = model->sample_count;
    params.max_outline = model->outline_count > 3 ? model->outline_count : 3;
    if (cairn_object_detect_check(&params, &refused) != CAIRN_OK)
        return refuse_params(CAIRN_FULL, &refused, path, error);
    status = detect(detections, image, &params, model, &fault);
    while (status == CAIRN_FULL && params.mode == CAIRN_MODE_AS_WRITTEN &&
           params.max_detections < MAX_DETECTIONS) {
        params.max_detections *= DETECTIONS_FACTOR;
        status = detect(detections, image, &params, model, &fault);
    }
    return status == CAIRN_OK ? CAIRN_OK : refuse(status, &params, &fault, path, error);
}
