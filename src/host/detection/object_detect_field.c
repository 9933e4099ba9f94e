/* Log-likelihood ratio of edges, object against background, for every position, direction and size.
 *
 * Method:
 * 1. For each size a grid of cells, which are a share of the size (scale pyramid).
 * 2. Every segment is rasterized in the direction bins near its own, at a cost by angle and
 *    strength rank.
 * 3. Minimum costs are propagated a few sigmas along rows, then along columns (separable distance
 *    transform), and converted to likelihoods.
 * 4. The background likelihood is the mean over a window somewhat larger than the object
 *    (summed-area table). The result is the logarithm of the ratio of both, with a probability of
 *    occlusion.
 *
 * Source: this project's, for the verification of Adluru 2008, section 5.3. */
#include "src/base/build.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/detection/object_detect_work.h"

/* Standard deviations: position, in cells, and direction, rad; a segment contributes to directions
 * within MAX_ANGLE_SIGMAS. */
#define SIGMA_CELLS      1.0
#define ANGLE_SIGMA      0.35
#define MAX_ANGLE_SIGMAS 2.2
/* Propagation radius of a cost, and half the window's side, cells. */
enum { SPREAD_CELLS = 3, WINDOW_CELLS = 30 };
/* Lower bound of the likelihood ratio 2 s of an edge of strength rank s in [0, 1], object against
 * background. */
#define MIN_STRENGTH_RATIO 0.2
/* Least background likelihood, and probability that a piece of an outline has no edge: 1 -
 * detection probability. */
#define MIN_BACKGROUND        0.02
#define OCCLUSION_PROBABILITY 0.25
/* Log-likelihood ratio outside the image, nats. */
#define OUTSIDE_LLR (-0.7F)
/* Ratio of consecutive sizes; cost of a cell without an edge in reach. */
#define SIZE_STEP 1.2
#define MAX_COST  30.0F

enum { DIRECTION_BINS = OBJECT_DETECT_BINS, MARGIN_CELLS = OBJECT_DETECT_MARGIN_CELLS };
/* Limits of the params. */
enum {
    MIN_SIZE_PX = 8,
    MAX_SIZE_PX = 2 * CAIRN_CONTOUR_SEARCH_MAX_SIDE,
    MAX_CANDIDATES = 64,
    MAX_MATCHES = 64,
    MAX_NEAREST = 64,
    MAX_APPEARANCE_WEIGHT = 1000,
    MAX_GROUPING_WEIGHT = 100
};

typedef struct level_buffers {
    float *cost;  /* [DIRECTION_BINS][height][width] */
    double *sums; /* [(height + 1)][width + 1] summed-area table */
    float *strip; /* scratch: a row or column with its margins */
} level_buffers;

/* Rasterizes a line into the cells of one direction. */
static void rasterize_line(const object_detect_level *level, cairn_segment line, float *cost,
                           float line_cost)
{
    double length = (double)cairn_segment_length(line);
    int32_t steps = 1 + (int32_t)(2 * length / (double)level->cell_size);

    for (int32_t k = 0; k <= steps; k++) {
        double t = (double)k / steps;
        int32_t x = (int32_t)floor(((double)line.a.x + t * (double)(line.b.x - line.a.x)) /
                                   (double)level->cell_size);
        int32_t y = (int32_t)floor(((double)line.a.y + t * (double)(line.b.y - line.a.y)) /
                                   (double)level->cell_size);

        if (x >= 0 && y >= 0 && x < level->width && y < level->height &&
            line_cost < cost[y * level->width + x])
            cost[y * level->width + x] = line_cost;
    }
}

/* Rasterizes a segment in all direction bins near its own. */
static void rasterize_segment(const object_detect_level *level, cairn_segment line,
                              cairn_real strength, float *cost)
{
    double angle = atan2((double)(line.b.y - line.a.y), (double)(line.b.x - line.a.x));
    double strength_cost = -log(fmax(MIN_STRENGTH_RATIO, 2 * (double)strength));

    for (int32_t bin = 0; bin < DIRECTION_BINS; bin++) {
        double deviation =
            remainder(angle - (bin + 0.5) * ((double)CAIRN_PI / DIRECTION_BINS), (double)CAIRN_PI) /
            ANGLE_SIGMA;

        if (fabs(deviation) <= MAX_ANGLE_SIGMAS)
            rasterize_line(level, line, &cost[(size_t)bin * (size_t)(level->width * level->height)],
                           (float)(strength_cost + deviation * deviation / 2));
    }
}

/* One-dimensional distance transform of a row or column of `count` cells, `step` apart. */
static void distance_transform_1d(float *strip, float *cost, int32_t count, int32_t step)
{
    for (int32_t i = 0; i < SPREAD_CELLS; i++)
        strip[i] = strip[count + SPREAD_CELLS + i] = MAX_COST;
    for (int32_t i = 0; i < count; i++)
        strip[SPREAD_CELLS + i] = cost[i * step];
    for (int32_t i = 0; i < count; i++) {
        float smallest = strip[SPREAD_CELLS + i];

        for (int32_t k = 1; k <= SPREAD_CELLS; k++) {
            float neighbour = strip[SPREAD_CELLS + i - k] < strip[SPREAD_CELLS + i + k]
                                  ? strip[SPREAD_CELLS + i - k]
                                  : strip[SPREAD_CELLS + i + k];

            neighbour += (float)(k * k / (2 * SIGMA_CELLS * SIGMA_CELLS));
            smallest = neighbour < smallest ? neighbour : smallest;
        }
        cost[i * step] = smallest;
    }
}

/* Converts costs to likelihoods, and computes their summed-area table. */
static void summed_area_table(const object_detect_level *level, float *cost, double *sums)
{
    int32_t w = level->width;

    memset(sums, 0, (size_t)(w + 1) * sizeof *sums);
    for (int32_t y = 0; y < level->height; y++) {
        double row = 0;

        sums[(y + 1) * (w + 1)] = 0;
        for (int32_t x = 0; x < w; x++) {
            cost[y * w + x] = expf(-cost[y * w + x]);
            row += (double)cost[y * w + x];
            sums[(y + 1) * (w + 1) + x + 1] = sums[y * (w + 1) + x + 1] + row;
        }
    }
}

/* Log-likelihood ratio of every cell against the mean of its window. */
static void compute_llr(const object_detect_level *level, const float *likelihood,
                        const double *sums, float *llr)
{
    int32_t w = level->width, h = level->height;

    for (int32_t y = 0; y < h; y++) {
        int32_t above = y > WINDOW_CELLS ? y - WINDOW_CELLS : 0,
                below = y + WINDOW_CELLS < h ? y + WINDOW_CELLS : h;
        float *row =
            &llr[(size_t)(y + MARGIN_CELLS) * cairn_object_detect_row(level) + MARGIN_CELLS];

        for (int32_t x = 0; x < w; x++) {
            int32_t left = x > WINDOW_CELLS ? x - WINDOW_CELLS : 0,
                    right = x + WINDOW_CELLS < w ? x + WINDOW_CELLS : w;
            double sum = sums[below * (w + 1) + right] - sums[above * (w + 1) + right] -
                         sums[below * (w + 1) + left] + sums[above * (w + 1) + left];
            double background =
                fmax(MIN_BACKGROUND, sum / ((double)(below - above) * (right - left)));

            row[x] = logf(
                (float)(OCCLUSION_PROBABILITY +
                        (1 - OCCLUSION_PROBABILITY) * (double)likelihood[y * w + x] / background));
        }
    }
}

/* Computes the level of one object size. Returns 0 when out of memory. */
static int make_level(object_detect_level *level, const cairn_contour_search_tokens *tokens,
                      level_buffers *buffers)
{
    int32_t w = level->width, h = level->height, longest = w > h ? w : h;
    size_t cells = (size_t)w * (size_t)h;

    level->llr = malloc(DIRECTION_BINS * cairn_object_detect_layer(level) * sizeof *level->llr);
    buffers->cost = calloc(DIRECTION_BINS * cells, sizeof *buffers->cost);
    buffers->sums = malloc(((size_t)w + 1) * ((size_t)h + 1) * sizeof *buffers->sums);
    buffers->strip = malloc(((size_t)longest + 2 * SPREAD_CELLS) * sizeof *buffers->strip);
    if (level->llr == NULL || buffers->cost == NULL || buffers->sums == NULL ||
        buffers->strip == NULL)
        return 0;
    for (size_t i = 0; i < DIRECTION_BINS * cells; i++)
        buffers->cost[i] = MAX_COST;
    for (size_t i = 0; i < DIRECTION_BINS * cairn_object_detect_layer(level); i++)
        level->llr[i] = OUTSIDE_LLR;
    for (int32_t i = 0; i < tokens->count; i++)
        rasterize_segment(level, tokens->lines[i], tokens->strength_rank[i], buffers->cost);
    for (int32_t bin = 0; bin < DIRECTION_BINS; bin++) {
        float *cost = &buffers->cost[(size_t)bin * cells];

        for (int32_t y = 0; y < h; y++)
            distance_transform_1d(buffers->strip, &cost[y * w], w, 1);
        for (int32_t x = 0; x < w; x++)
            distance_transform_1d(buffers->strip, &cost[x], h, w);
        summed_area_table(level, cost, buffers->sums);
        compute_llr(level, cost, buffers->sums,
                    &level->llr[(size_t)bin * cairn_object_detect_layer(level)]);
    }
    return 1;
}

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
    double min_size = (double)longer * OBJECT_DETECT_CELLS_PER_SIZE / OBJECT_DETECT_MAX_SIDE_CELLS;

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

/* Number of sizes in the range. */
static int32_t level_count_of(const cairn_object_detect_params *params)
{
    int32_t levels =
        1 + (int32_t)(log((double)(params->max_size / params->min_size)) / log(SIZE_STEP) + 1e-6);

    CAIRN_ASSERT(levels <= OBJECT_DETECT_MAX_LEVELS);
    return levels;
}

cairn_status cairn_object_detect_field_make(cairn_object_detect_field **field,
                                            const cairn_contour_search_tokens *tokens,
                                            const cairn_object_detect_params *params,
                                            const char *path, cairn_file_error *error)
{
    cairn_status status = check_params(params, tokens, path, error);
    cairn_object_detect_field *made;
    int ok = 1;

    *field = NULL;
    if (status != CAIRN_OK)
        return status;
    made = calloc(1, sizeof *made);
    if (made == NULL)
        return cairn_file_error_system(error, path, "detect", ENOMEM);
    made->tokens = tokens;
    made->params = *params;
    if (params->method == CAIRN_OBJECT_DETECT_PARTS)
        ok = cairn_object_detect_chains_make(&made->chains, tokens);
    for (int32_t k = 0;
         params->method == CAIRN_OBJECT_DETECT_EVIDENCE && k < level_count_of(params) && ok; k++) {
        object_detect_level *level = &made->level[made->levels++];
        level_buffers buffers = {.cost = NULL};

        level->size = params->min_size * (cairn_real)pow(SIZE_STEP, k);
        level->cell_size = level->size / OBJECT_DETECT_CELLS_PER_SIZE;
        level->width = 1 + (int32_t)((double)tokens->width / (double)level->cell_size);
        level->height = 1 + (int32_t)((double)tokens->height / (double)level->cell_size);
        ok = make_level(level, tokens, &buffers);
        free(buffers.cost);
        free(buffers.sums);
        free(buffers.strip);
    }
    if (!ok) {
        cairn_object_detect_field_free(made);
        return cairn_file_error_system(error, path, "detect", ENOMEM);
    }
    *field = made;
    return CAIRN_OK;
}

void cairn_object_detect_field_free(cairn_object_detect_field *field)
{
    for (int32_t k = 0; field != NULL && k < field->levels; k++)
        free(field->level[k].llr);
    if (field != NULL)
        cairn_object_detect_chains_free(&field->chains);
    free(field);
}
