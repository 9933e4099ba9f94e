/* Verification of detections by contour grouping (chapter 2), and detection of partly occluded
 * objects.
 *
 * Method: the grouping searches the model and its mirror image in successive bands of sizes. Its
 * evidence comes from the visible parts along chains of edges, whatever is occluded, and objects
 * may be rotated. Both complement the evidence of a deformed outline.
 *
 * Source: Adluru 2008, chapter 2 (contour_grouping). */
#include "src/base/build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/contour_grouping.h"
#include "cairn/detection_curve.h"
#include "cairn/shape_model_file.h"
#include "src/host/detection/object_detect_work.h"

/* Greatest ratio of sizes within one band, because a search keeps only the best size at one
 * position. */
#define BAND_FACTOR 2.2
/* Least evidence of a kept object, nats. Deliberately low: spurious groupings near a detection
 * usually exceed it, so that it only bounds the list. */
#define MIN_EVIDENCE 2
/* rad: greatest rotation either way. */
#define MAX_ROTATION (15 * (CAIRN_PI / 180))
/* Least intersection over union of boxes of one object. */
#define MIN_OVERLAP CAIRN_REAL(0.5)
enum { MIN_TOKENS = 64 };

void cairn_object_detect_group_free(object_detect_groupings *groupings)
{
    free(groupings->list);
    memset(groupings, 0, sizeof *groupings);
}

/* Number of tokens of all segments, clamped. */
static int32_t count_tokens(const cairn_contour_search_tokens *tokens, cairn_real token)
{
    double count = 0;

    for (int32_t i = 0; i < tokens->count; i++)
        count += ceil((double)cairn_segment_length(tokens->lines[i]) / (double)token);
    return (int32_t)fmax(MIN_TOKENS, fmin(count, CAIRN_CONTOUR_SEARCH_MAX_TOKENS));
}

static cairn_contour_grouping_params params_for(const cairn_contour_search_tokens *tokens,
                                                const cairn_shape_model *model)
{
    cairn_contour_grouping_params params = cairn_contour_grouping_default();

    params.max_width = tokens->width;
    params.max_height = tokens->height;
    params.max_tokens = count_tokens(tokens, params.token_length);
    params.max_samples = model->sample_count;
    params.max_outline = model->outline_count;
    params.max_objects = OBJECT_DETECT_MAX_OBJECTS_PER_SEARCH;
    params.min_evidence = MIN_EVIDENCE;
    params.min_score = 0;
    return params;
}

/* Computes the bounding box of the model at the grouped pose. */
static void set_box(const cairn_shape_model *model, object_detect_grouping *grouped)
{
    cairn_real c = cairn_cos(grouped->found.turn) * grouped->found.size,
               s = cairn_sin(grouped->found.turn) * grouped->found.size;

    grouped->box[0] = grouped->box[1] = CAIRN_REAL_MAX;
    grouped->box[2] = grouped->box[3] = -CAIRN_REAL_MAX;
    for (int32_t i = 0; i < model->outline_count; i++) {
        cairn_vec2 p = model->outline[i].position;
        cairn_real x = grouped->found.origin.x + c * p.x - s * p.y,
                   y = grouped->found.origin.y + s * p.x + c * p.y;

        grouped->box[0] = cairn_min(grouped->box[0], x);
        grouped->box[1] = cairn_min(grouped->box[1], y);
        grouped->box[2] = cairn_max(grouped->box[2], x);
        grouped->box[3] = cairn_max(grouped->box[3], y);
    }
}

static void append_objects(object_detect_groupings *groupings,
                           const cairn_contour_grouping *grouping, const cairn_shape_model *model,
                           int32_t mirrored)
{
    cairn_contour_grouping_result result = cairn_contour_grouping_read(grouping);

    for (int32_t i = 0; i < result.object_count && groupings->count < OBJECT_DETECT_MAX_GROUPINGS;
         i++) {
        object_detect_grouping *grouped = &groupings->list[groupings->count++];

        grouped->found = result.objects[i];
        grouped->mirrored = mirrored;
        set_box(model, grouped);
    }
}

/* Searches the model in one band of sizes. */
static cairn_status search_band(cairn_contour_grouping *grouping,
                                const cairn_contour_search_tokens *tokens,
                                const cairn_shape_model *model, double min_size, double max_size)
{
    cairn_contour_grouping_input input = {.segments = tokens->lines,
                                          .count = tokens->count,
                                          .width = tokens->width,
                                          .height = tokens->height,
                                          .model = model,
                                          .min_size = (cairn_real)min_size,
                                          .max_size = (cairn_real)fmax(min_size, max_size),
                                          .min_turn = -MAX_ROTATION,
                                          .max_turn = MAX_ROTATION,
                                          .mean_length =
                                              tokens->mean_length > 0 ? tokens->mean_length : 5};
    cairn_status status = cairn_contour_grouping_begin(grouping, &input);
    cairn_budget budget;

    if (status != CAIRN_OK)
        return status;
    do {
        budget.left = CAIRN_UNBOUNDED;
        status = cairn_contour_grouping_step(grouping, &budget);
    } while (status == CAIRN_MORE);
    return status;
}

static cairn_status search_bands(object_detect_groupings *groupings,
                                 const cairn_object_detect_field *field,
                                 const cairn_shape_model *model, int32_t mirrored,
                                 cairn_contour_grouping *grouping)
{
    double min_size = (double)field->params.min_size,
           range = log((double)field->params.max_size / min_size);
    int32_t bands = 1 + (int32_t)(range / log(BAND_FACTOR));
    cairn_status status = CAIRN_OK;

    for (int32_t k = 0; k < bands && status == CAIRN_OK; k++) {
        status = search_band(grouping, field->tokens, model, min_size * exp(range * k / bands),
                             min_size * exp(range * (k + 1) / bands));
        if (status == CAIRN_OK)
            append_objects(groupings, grouping, model, mirrored);
    }
    return status;
}

static cairn_status search_mirrored(object_detect_groupings *groupings,
                                    const cairn_object_detect_field *field,
                                    const cairn_shape_model *model,
                                    cairn_contour_grouping *grouping)
{
    cairn_shape_model_file mirrored;
    cairn_status status = cairn_shape_model_file_copy(&mirrored, model);

    if (status != CAIRN_OK)
        return status;
    cairn_shape_model_file_mirror(&mirrored);
    status = search_bands(groupings, field, &mirrored.model, 1, grouping);
    cairn_shape_model_file_free(&mirrored);
    return status;
}

static int compare_groupings(const void *a, const void *b)
{
    const object_detect_grouping *x = a, *y = b;

    if (x->found.evidence != y->found.evidence)
        return x->found.evidence < y->found.evidence ? 1 : -1;
    if (x->mirrored != y->mirrored)
        return x->mirrored - y->mirrored;
    if (x->found.origin.y != y->found.origin.y)
        return x->found.origin.y < y->found.origin.y ? -1 : 1;
    return x->found.origin.x < y->found.origin.x ? -1 : x->found.origin.x > y->found.origin.x;
}

cairn_status cairn_object_detect_group(object_detect_groupings *groupings,
                                       const cairn_object_detect_field *field,
                                       const cairn_shape_model *model)
{
    cairn_contour_grouping_params params = params_for(field->tokens, model);
    size_t bytes = cairn_contour_grouping_memory(&params) + CAIRN_ALIGN;
    void *memory = malloc(bytes);
    cairn_contour_grouping *grouping = NULL;
    cairn_status status;
    cairn_pool pool;

    groupings->count = 0;
    groupings->list = malloc(OBJECT_DETECT_MAX_GROUPINGS * sizeof *groupings->list);
    status = memory != NULL && groupings->list != NULL ? cairn_pool_init(&pool, memory, bytes)
                                                       : CAIRN_NO_MEMORY;
    if (status == CAIRN_OK)
        status = cairn_contour_grouping_create(&grouping, &pool, &params);
    if (status == CAIRN_OK)
        status = search_bands(groupings, field, model, 0, grouping);
    if (status == CAIRN_OK && field->params.mirror)
        status = search_mirrored(groupings, field, model, grouping);
    free(memory);
    if (status == CAIRN_OK && groupings->count > 1)
        qsort(groupings->list, (size_t)groupings->count, sizeof *groupings->list,
              compare_groupings);
    return status;
}

cairn_real cairn_object_detect_grouped_evidence(const object_detect_groupings *groupings,
                                                const cairn_object_detection *detection)
{
    const cairn_real own[4] = {detection->left, detection->top, detection->right,
                               detection->bottom};

    for (int32_t i = 0; i < groupings->count; i++)
        if (cairn_detection_curve_overlap(groupings->list[i].box, own) >= MIN_OVERLAP)
            return groupings->list[i].found.evidence;
    return 0;
}
