/* Contour detection by region segmentation: the module's interface and phases.
 *
 * Method:
 * 1. CIE L, a, b colours; for each feature map its box filters and its gradient tensor; edge
 *    strengths (boundary_strength.c).
 * 2. Watershed regions and their borders (boundary_region.c).
 * 3. Spectral cue of the region graph (boundary_spectral.c).
 * 4. Region merging, once for each merge criterion (boundary_merge.c).
 * 5. Contour tracing and ranking (boundary_contour.c).
 *
 * Memory layout: images of reals for the colours, a feature map and its filtered copy, and the
 * tensors; labels and queues; borders and regions; vectors.
 *
 * Limits: the watershed does not distinguish strengths above 8. Contours run along pixel sides:
 * the position of a sharp edge is accurate to half a pixel, of a soft edge to about the
 * half-width of the windows. Module edgel has sub-pixel accuracy. */
#include "src/base/build.h"

#include <string.h>

#include "src/edges/boundary_work.h"

enum { MAX_SIDE_PX = 8192, MAX_REGIONS = 1 << 22, MAX_POINTS = 1 << 28, MAX_HALF_WIDTH_PX = 32 };

#define INTEGER(field, ...) CAIRN_INTEGER(cairn_boundary_params, field, __VA_ARGS__)
#define NUMBER(field, ...)  CAIRN_NUMBER(cairn_boundary_params, field, __VA_ARGS__)

/* Default, lowest and highest value. */
static const cairn_parameter rows[] = {
    INTEGER(max_width, 640, 1, MAX_SIDE_PX),
    INTEGER(max_height, 480, 1, MAX_SIDE_PX),
    INTEGER(max_regions, 8192, 1, MAX_REGIONS),
    INTEGER(max_corners, 262144, 1, MAX_POINTS),
    INTEGER(fine_half_width, 2, 1, MAX_HALF_WIDTH_PX),
    INTEGER(coarse_half_width, 5, 1, MAX_HALF_WIDTH_PX),
    NUMBER(histogram_weight, 8, 0, CAIRN_REAL_MAX),
    NUMBER(spectral_weight, CAIRN_REAL(0.3), 0, CAIRN_REAL_MAX),
    NUMBER(size_exponent, CAIRN_REAL(0.1), 0, 1),
    NUMBER(contrast_exponent, CAIRN_REAL(0.15), 0, 1),
    NUMBER(min_strength, 0, 0, CAIRN_REAL_MAX),
};
const cairn_parameters cairn_boundary_parameters =
    CAIRN_PARAMETERS("boundary", cairn_boundary_params, rows);

cairn_boundary_params cairn_boundary_default(void)
{
    cairn_boundary_params params;

    cairn_parameters_preset(&cairn_boundary_parameters, &params);
    return params;
}

cairn_status cairn_boundary_check(const cairn_boundary_params *params, cairn_object_fault *fault)
{
    return cairn_parameters_check(&cairn_boundary_parameters, params, fault);
}

/* Returns a power of two that keeps the hash table at most half full. */
static int32_t table_size_of(const cairn_boundary_params *params)
{
    int32_t size = 1;

    while (size < 2 * BOUNDARY_BORDERS_PER_REGION * params->max_regions)
        size *= 2;
    return size;
}

/* Returns the linear intensity of an sRGB sample, 0 ... 1. */
static cairn_real srgb_to_linear(int32_t sample)
{
    cairn_real s = (cairn_real)sample / 255;

    return s <= CAIRN_REAL(0.04045)
               ? s / CAIRN_REAL(12.92)
               : cairn_exp(CAIRN_REAL(2.4) *
                           cairn_log((s + CAIRN_REAL(0.055)) / CAIRN_REAL(1.055)));
}

/* The object and its arrays; NULL from a counting pool. */
static cairn_boundary *build(cairn_pool *pool, const cairn_boundary_params *params)
{
    size_t pixels = (size_t)params->max_width * (size_t)params->max_height,
           regions = (size_t)params->max_regions;
    size_t borders = BOUNDARY_BORDERS_PER_REGION * regions;
    cairn_boundary *boundary = cairn_object_take(pool, sizeof *boundary);

    CAIRN_TAKE(boundary, pool, colour, BOUNDARY_CHANNELS * pixels);
    CAIRN_TAKE(boundary, pool, strength, pixels);
    CAIRN_TAKE(boundary, pool, filter.scratch, pixels);
    CAIRN_TAKE(boundary, pool, filter.tensor, pixels);
    CAIRN_TAKE(boundary, pool, filter.row_buffer, 2 * params->max_width);
    CAIRN_TAKE(boundary, pool, label, pixels);
    CAIRN_TAKE(boundary, pool, flood.next_in_queue, pixels);
    CAIRN_TAKE(boundary, pool, flood.next_of_level, pixels);
    CAIRN_TAKE(boundary, pool, traced_sides, pixels);
    CAIRN_TAKE(boundary, pool, flood.queue_head, BOUNDARY_LEVELS);
    CAIRN_TAKE(boundary, pool, flood.queue_tail, BOUNDARY_LEVELS);
    CAIRN_TAKE(boundary, pool, flood.level_first, BOUNDARY_LEVELS);
    CAIRN_TAKE(boundary, pool, regions, regions);
    CAIRN_TAKE(boundary, pool, merge.initial_histogram, BOUNDARY_BINS * regions);
    CAIRN_TAKE(boundary, pool, merge.histogram, BOUNDARY_BINS * regions);
    CAIRN_TAKE(boundary, pool, spectral.inverse_sqrt_degree, regions);
    CAIRN_TAKE(boundary, pool, spectral.vectors, (BOUNDARY_BLOCK_SIZE + 2) * regions);
    CAIRN_TAKE(boundary, pool, borders, borders);
    CAIRN_TAKE(boundary, pool, border_table, table_size_of(params));
    CAIRN_TAKE(boundary, pool, heap, borders);
    CAIRN_TAKE(boundary, pool, traced, borders);
    CAIRN_TAKE(boundary, pool, ranked, borders);
    CAIRN_TAKE(boundary, pool, corners, params->max_corners);
    if (boundary != NULL) {
        boundary->params = *params;
        boundary->table_size = table_size_of(params);
        for (int32_t i = 0; i < 256; i++)
            boundary->linear[i] = srgb_to_linear(i);
    }
    return boundary;
}

CAIRN_OBJECT(boundary, boundary, build);

/* 1 when a value lies in 1 ... upper. */
static int is_within(int32_t value, int32_t upper)
{
    return value >= 1 && value <= upper;
}

/* Row offsets are computed in 64 bits, since strides are unrestricted. */
static int image_is_valid(const cairn_boundary_image *image)
{
    ptrdiff_t stride;

    if (image == NULL || image->samples == NULL ||
        !is_within(image->width, CAIRN_RASTER_MAX_SIDE) ||
        !is_within(image->height, CAIRN_RASTER_MAX_SIDE) ||
        (image->channels != 1 && image->channels != 3 && image->channels != 4))
        return 0;
    stride = image->stride;
    return image->height == 1 || (stride >= (ptrdiff_t)image->width * image->channels &&
                                  stride <= PTRDIFF_MAX / image->height);
}

cairn_status cairn_boundary_begin(cairn_boundary *boundary, const cairn_boundary_image *image)
{
    if (boundary == NULL || !image_is_valid(image))
        return CAIRN_BAD_ARGUMENT;
    if (image->width > boundary->params.max_width || image->height > boundary->params.max_height)
        return CAIRN_FULL;
    boundary->image = *image;
    boundary->channels = image->channels > 1 ? BOUNDARY_CHANNELS : 1;
    boundary->region_count = boundary->border_count = 0;
    boundary->contour_count = boundary->corner_count = boundary->ranked_count = 0;
    boundary->units_charged = 0;
    boundary->outcome = CAIRN_OK;
    boundary->resume = boundary->phase_resume = 0;
    for (int32_t i = 0; i < boundary->table_size; i++)
        boundary->border_table[i] = -1;
    cairn_boundary_flood_begin(boundary);
    boundary->is_running = 1;
    boundary->is_complete = 0;
    return CAIRN_OK;
}

/* The detection: see Method in the head of this file. */
static int detect(cairn_boundary *boundary, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(boundary->resume);
    CAIRN_STEP_RUN(boundary, resume, budget, cairn_boundary_measure);
    CAIRN_STEP_RUN(boundary, resume, budget, cairn_boundary_flood);
    CAIRN_STEP_RUN(boundary, resume, budget, cairn_boundary_collect_borders);
    CAIRN_STEP_RUN(boundary, resume, budget, cairn_boundary_add_spectral);
    for (boundary->merge.criterion = 0; cairn_boundary_has_criterion(boundary);
         boundary->merge.criterion++) {
        CAIRN_STEP_RUN(boundary, resume, budget, cairn_boundary_reset);
        CAIRN_STEP_RUN(boundary, resume, budget, cairn_boundary_merge);
        CAIRN_STEP_RUN(boundary, resume, budget, cairn_boundary_record);
    }
    CAIRN_STEP_RUN(boundary, resume, budget, cairn_boundary_reset);
    CAIRN_STEP_RUN(boundary, resume, budget, cairn_boundary_merge);
    CAIRN_STEP_RUN(boundary, resume, budget, cairn_boundary_trace);
    if (boundary->outcome == CAIRN_OK)
        CAIRN_STEP_RUN(boundary, resume, budget, cairn_boundary_rank);
    CAIRN_STEP_END(boundary->resume);
}

cairn_status cairn_boundary_step(cairn_boundary *boundary, cairn_budget *budget)
{
    if (boundary == NULL || budget == NULL)
        return CAIRN_BAD_ARGUMENT;
    if (!boundary->is_running)
        return CAIRN_OK;
    if (!detect(boundary, budget))
        return CAIRN_MORE;
    boundary->is_running = 0;
    boundary->is_complete = boundary->outcome == CAIRN_OK;
    return boundary->outcome;
}

cairn_boundary_result cairn_boundary_read(const cairn_boundary *boundary)
{
    cairn_boundary_result r;

    memset(&r, 0, sizeof r);
    if (boundary == NULL || !boundary->is_complete)
        return r;
    r.contours = boundary->ranked;
    r.corners = boundary->corners;
    r.contour_count = boundary->ranked_count;
    r.corner_count = boundary->corner_count;
    r.region_count = boundary->region_count;
    r.strengths.data = boundary->strength;
    r.strengths.width = boundary->image.width;
    r.strengths.height = boundary->image.height;
    r.strengths.stride = boundary->image.width;
    return r;
}
