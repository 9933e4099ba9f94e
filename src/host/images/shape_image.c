/* Contours of an object from a picture of it: the extraction of cairn/silhouette.h with memory of
 * the heap that fits the picture, and its refusals as messages.
 *
 * Method:
 * 1. A picture larger than max_side is reduced by means of squares of pixels.
 * 2. Its outlines are extracted. What a picture needs is known once it was tried: where a capacity
 *    for ink or points is used up, it is set to the number that was counted.
 * 3. The outlines are copied, and converted into pixels of the picture. */
#include "src/base/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/shape_image.h"
#include "cairn/silhouette.h"
#include "src/host/base/host_parameters.h"
#include "src/host/base/interruption.h"

/* What helps with a photograph. */
#define GRAB "cairn model --grab x,y,w,h cuts the object out of that box"

/* Capacities that are tried first: a share of the pixels, with a lower bound. The points take no
 * memory of their own then. */
enum { PIXELS_PER_INK = 32, PIXELS_PER_POINT = 4, MIN_INK = 4096 };

static const cairn_host_parameter rows[] = {
    CAIRN_HOST_NUMBER(cairn_shape_image_params, holes, CAIRN_SHAPE_IMAGE_HOLES_KEEP,
                      CAIRN_SHAPE_IMAGE_HOLES_KEEP, CAIRN_SHAPE_IMAGE_HOLES_REFUSE),
    CAIRN_HOST_NUMBER(cairn_shape_image_params, max_gap, 0.1, 0, 1),
    CAIRN_HOST_NUMBER(cairn_shape_image_params, min_part, 0.01, 0, 1),
    CAIRN_HOST_NUMBER(cairn_shape_image_params, max_side, CAIRN_SHAPE_IMAGE_MAX_SIDE,
                      CAIRN_SILHOUETTE_MIN_DIAGONAL, CAIRN_SHAPE_IMAGE_MAX_SIDE),
};

const cairn_host_parameters cairn_shape_image_parameters =
    CAIRN_HOST_PARAMETERS(cairn_shape_image_params, rows);

cairn_shape_image_params cairn_shape_image_default(void)
{
    cairn_shape_image_params params;

    cairn_host_parameters_preset(&cairn_shape_image_parameters, &params);
    return params;
}

void cairn_shape_image_free(cairn_shape_image *image)
{
    free(image->points);
    memset(image, 0, sizeof *image);
}

/* ---- Messages ---- */

static cairn_status report_photograph(const cairn_silhouette_measure *measure,
                                      cairn_raster_u8_view grey, const char *path,
                                      cairn_file_error *error)
{
    double between = 100 * ((double)measure->between / ((double)grey.width * grey.height));

    if (measure->refusal == CAIRN_SILHOUETTE_SPECKS)
        return cairn_file_error_set(
            error, CAIRN_BAD_FORMAT, path, 0,
            "a photograph (%.0f %% of it is neither dark nor bright, %d specks), expected a "
            "silhouette or a drawing; " GRAB,
            between, (int)measure->dropped_regions);
    return cairn_file_error_set(error, CAIRN_BAD_FORMAT, path, 0,
                                "a photograph (%.0f %% of it is neither dark nor bright), expected "
                                "a silhouette or a drawing; " GRAB,
                                between);
}

/* Reports why a picture was refused. */
static cairn_status report_refusal(const cairn_silhouette_measure *measure,
                                   cairn_raster_u8_view grey, const char *path,
                                   cairn_file_error *error)
{
    switch (measure->refusal) {
    case CAIRN_SILHOUETTE_ONE_COLOUR:
        return cairn_file_error_set(
            error, CAIRN_EMPTY, path, 0,
            "%d x %d pixels of one colour, expected a silhouette or a drawing", (int)grey.width,
            (int)grey.height);
    case CAIRN_SILHOUETTE_TOO_SMALL:
        return cairn_file_error_set(
            error, CAIRN_EMPTY, path, 0,
            "an object of %.0f pixels along its diagonal, expected at least %d",
            hypot(measure->ink_width, measure->ink_height), CAIRN_SILHOUETTE_MIN_DIAGONAL);
    case CAIRN_SILHOUETTE_OPEN_ENDS:
        return cairn_file_error_set(
            error, CAIRN_BAD_FORMAT, path, 0,
            "more than %d open line ends, expected a drawing of one outline",
            CAIRN_SILHOUETTE_MAX_OPEN_ENDS);
    case CAIRN_SILHOUETTE_OPEN_LINES:
        return cairn_file_error_set(
            error, CAIRN_BAD_FORMAT, path, 0,
            "lines that enclose nothing, expected a silhouette, or an outline closed except for "
            "small gaps");
    case CAIRN_SILHOUETTE_HOLE:
        return cairn_file_error_set(
            error, CAIRN_UNSUPPORTED, path, 0,
            "a hole of %d pixels at (%d, %d), expected an object without holes",
            (int)measure->hole_area, (int)measure->hole_x, (int)measure->hole_y);
    case CAIRN_SILHOUETTE_OUTLINES:
        return cairn_file_error_set(error, CAIRN_FULL, path, 0,
                                    "%d parts and holes, expected one object of at most %d; of a "
                                    "photograph " GRAB,
                                    (int)measure->regions, CAIRN_SHAPE_MODEL_MAX_OUTLINES);
    default:
        return report_photograph(measure, grey, path, error);
    }
}

/* ---- Extraction ---- */

/* Steps to the end, or until the call is to end: CAIRN_MORE. */
static cairn_status run_to_end(cairn_silhouette *silhouette)
{
    cairn_status status;

    do {
        cairn_budget budget = {.left = CAIRN_INTERRUPTION_UNITS};

        status = cairn_silhouette_step(silhouette, &budget);
    } while (status == CAIRN_MORE && !cairn_interruption_is_requested());
    return status;
}

/* Copies the outlines to the heap. CAIRN_NO_MEMORY. */
static cairn_status copy_outlines(cairn_shape_image *image, const cairn_silhouette_result *result)
{
    int32_t points = 0;

    for (int32_t i = 0; i < result->count; i++)
        points += result->outlines[i].count;
    image->points = malloc(((size_t)points + 1) * sizeof *image->points);
    if (image->points == NULL)
        return CAIRN_NO_MEMORY;
    points = 0;
    for (int32_t i = 0; i < result->count; i++) {
        image->outlines[i] = result->outlines[i];
        image->outlines[i].points =
            memcpy(&image->points[points], result->outlines[i].points,
                   (size_t)result->outlines[i].count * sizeof *image->points);
        points += result->outlines[i].count;
    }
    for (int32_t i = 0; i < result->gap_count && i < CAIRN_SHAPE_MODEL_MAX_GAPS; i++)
        image->gaps[i] = result->gaps[i];
    image->count = result->count;
    image->holes = result->holes;
    image->is_drawing = result->is_drawing;
    image->bridged_gaps = result->gap_count;
    image->dropped_regions = result->dropped_regions;
    return CAIRN_OK;
}

/* Extracts the outlines of a picture with given capacities. */
static cairn_status extract(cairn_shape_image *image, cairn_raster_u8_view grey,
                            const cairn_silhouette_params *params,
                            cairn_silhouette_measure *measure)
{
    size_t bytes = cairn_silhouette_memory(params) + CAIRN_ALIGN;
    cairn_silhouette *silhouette = NULL;
    void *memory = malloc(bytes);
    cairn_status status = CAIRN_NO_MEMORY;
    cairn_pool pool;

    memset(measure, 0, sizeof *measure);
    if (memory != NULL)
        status = cairn_pool_init(&pool, memory, bytes);
    if (status == CAIRN_OK)
        status = cairn_silhouette_create(&silhouette, &pool, params);
    if (status == CAIRN_OK)
        status = cairn_silhouette_begin(silhouette, grey);
    if (status == CAIRN_OK) {
        cairn_silhouette_result result;

        status = run_to_end(silhouette);
        *measure = cairn_silhouette_measured(silhouette);
        result = cairn_silhouette_read(silhouette);
        if (status == CAIRN_OK)
            status = copy_outlines(image, &result);
    }
    free(memory);
    return status;
}

/* The parameters of the extraction, with the capacities that are tried first. */
static cairn_silhouette_params params_for(const cairn_shape_image_params *params,
                                          cairn_raster_u8_view grey)
{
    cairn_silhouette_params fitted = cairn_silhouette_default();
    int32_t pixels = grey.width * grey.height;

    fitted.max_width = grey.width;
    fitted.max_height = grey.height;
    fitted.max_ink = pixels / PIXELS_PER_INK > MIN_INK ? pixels / PIXELS_PER_INK : MIN_INK;
    fitted.max_points = pixels / PIXELS_PER_POINT + 1;
    fitted.max_outlines = CAIRN_SHAPE_MODEL_MAX_OUTLINES;
    fitted.holes = params->holes;
    fitted.max_gap = (cairn_real)params->max_gap;
    fitted.min_part = (cairn_real)params->min_part;
    return fitted;
}

/* Raises a capacity that was used up; 0: none was. */
static int raise_capacity(cairn_silhouette_params *params, const cairn_silhouette_measure *measure)
{
    if (measure->refusal == CAIRN_SILHOUETTE_INK)
        params->max_ink = measure->ink;
    else if (measure->refusal == CAIRN_SILHOUETTE_POINTS)
        params->max_points = measure->points;
    else
        return 0;
    return 1;
}

/* Traces a picture within the limits. */
static cairn_status trace(cairn_shape_image *image, cairn_raster_u8_view grey,
                          const cairn_shape_image_params *params, const char *path,
                          cairn_file_error *error)
{
    cairn_silhouette_params fitted = params_for(params, grey);
    cairn_silhouette_measure measure;
    cairn_status status;

    do {
        status = extract(image, grey, &fitted, &measure);
    } while (raise_capacity(&fitted, &measure));
    if (status == CAIRN_NO_MEMORY)
        return cairn_file_error_system(error, path, "trace", ENOMEM);
    if (measure.refusal != CAIRN_SILHOUETTE_ACCEPTED)
        return report_refusal(&measure, grey, path, error);
    return status;
}

/* ---- Scaling ---- */

/* Means of squares of `shrink` pixels a side, on the heap; NULL: no memory. */
static uint8_t *reduce(cairn_raster_u8_view grey, int32_t shrink, int32_t width, int32_t height)
{
    uint8_t *small = malloc((size_t)width * (size_t)height);

    for (int32_t y = 0; y < height && small != NULL; y++)
        for (int32_t x = 0; x < width; x++) {
            int64_t sum = 0, count = 0;

            for (int32_t v = y * shrink; v < (y + 1) * shrink && v < grey.height; v++)
                for (int32_t u = x * shrink; u < (x + 1) * shrink && u < grey.width; u++, count++)
                    sum += grey.data[v * grey.stride + u];
            CAIRN_ASSERT(count > 0);
            small[(size_t)y * (size_t)width + (size_t)x] = (uint8_t)((sum + count / 2) / count);
        }
    return small;
}

/* Converts points of a reduced picture into pixels of the picture. */
static void enlarge(cairn_vec2 *points, int32_t count, int32_t shrink)
{
    const cairn_real half = CAIRN_REAL(0.5);

    for (int32_t i = 0; i < count; i++)
        points[i] = (cairn_vec2){(points[i].x + half) * (cairn_real)shrink - half,
                                 (points[i].y + half) * (cairn_real)shrink - half};
}

cairn_status cairn_shape_image_trace(cairn_shape_image *image, cairn_raster_u8_view grey,
                                     const cairn_shape_image_params *params, const char *path,
                                     cairn_file_error *error)
{
    cairn_raster_u8_view small;
    cairn_status status;
    uint8_t *samples;
    int32_t shrink = 1, points = 0;

    memset(image, 0, sizeof *image);
    if (cairn_raster_u8_check(grey) != CAIRN_OK)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "cannot be traced, expected a picture");
    status = cairn_host_parameters_check(&cairn_shape_image_parameters, params, path, error);
    if (status != CAIRN_OK)
        return status;
    while ((grey.width - 1) / shrink >= params->max_side ||
           (grey.height - 1) / shrink >= params->max_side)
        shrink *= 2;
    if (shrink == 1)
        return trace(image, grey, params, path, error);
    small.width = (grey.width - 1) / shrink + 1;
    small.stride = small.width;
    small.height = (grey.height - 1) / shrink + 1;
    small.data = samples = reduce(grey, shrink, small.width, small.height);
    if (samples == NULL)
        return cairn_file_error_system(error, path, "trace", ENOMEM);
    status = trace(image, small, params, path, error);
    free(samples);
    for (int32_t i = 0; status == CAIRN_OK && i < image->count; i++)
        points += image->outlines[i].count;
    enlarge(image->points, points, shrink);
    enlarge(image->gaps, CAIRN_SHAPE_MODEL_MAX_GAPS, shrink);
    return status;
}
