/* Candidate generation: for each variant of the model and each size, the peaks of a map of the mean
 * log-likelihood ratio of the outline's samples; then non-maximum suppression over all peaks.
 * object_detect.c describes the method. */
#include "src/base/build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/detection/object_detect_candidates.h"

/* Factors on the model's aspect ratio (width over height). */
static const double aspects[OBJECT_DETECT_ASPECTS] = {1, 0.8, 1.25, 0.64, 1.5625};
enum { MAX_PEAKS = 1 << 16 };
/* Non-maximum suppression threshold of candidates: greatest intersection over union. */
#define CANDIDATE_NMS_OVERLAP 0.5F
/* Weight of the log of the size in a candidate's score. */
#define CANDIDATE_SIZE_WEIGHT 0.4F

/* ---- Variants of the model ---- */

static void add_variant(object_detector *detector, int32_t mirrored, double aspect)
{
    object_detect_variant *variant = &detector->variants[detector->variant_count];
    const cairn_shape_model *model = detector->model;
    double wide = sqrt(aspect) * (mirrored ? -1 : 1), tall = 1 / sqrt(aspect);

    variant->outline =
        &detector->outlines[(size_t)detector->variant_count++ * (size_t)model->outline_count];
    variant->mirrored = mirrored;
    variant->left = variant->top = 1e9F;
    variant->right = variant->bottom = -1e9F;
    for (int32_t i = 0; i < model->outline_count; i++) {
        cairn_oriented_point *sample = &variant->outline[i];
        cairn_vec2 along = {(cairn_real)wide * model->outline[i].direction.x,
                            (cairn_real)tall * model->outline[i].direction.y};

        sample->position.x = (cairn_real)wide * model->outline[i].position.x;
        sample->position.y = (cairn_real)tall * model->outline[i].position.y;
        sample->direction = cairn_vec2_unit(along);
        variant->left = fminf(variant->left, (float)sample->position.x);
        variant->right = fmaxf(variant->right, (float)sample->position.x);
        variant->top = fminf(variant->top, (float)sample->position.y);
        variant->bottom = fmaxf(variant->bottom, (float)sample->position.y);
    }
}

int cairn_object_detect_variants_add(object_detector *detector)
{
    detector->outlines = malloc(2 * OBJECT_DETECT_ASPECTS * (size_t)detector->model->outline_count *
                                sizeof *detector->outlines);
    if (detector->outlines == NULL)
        return 0;
    for (int32_t mirrored = 0; mirrored < (detector->field->params.mirror ? 2 : 1); mirrored++)
        for (int32_t k = 0; k < OBJECT_DETECT_ASPECTS; k++)
            add_variant(detector, mirrored, aspects[k]);
    return 1;
}

int cairn_object_detect_variants_are_inside_margin(const cairn_shape_model *model)
{
    for (int32_t k = 0; k < OBJECT_DETECT_ASPECTS; k++)
        for (int32_t i = 0; i < model->outline_count; i++) {
            double x = sqrt(aspects[k]) * (double)model->outline[i].position.x;
            double y = (double)model->outline[i].position.y / sqrt(aspects[k]);

            if (!(fmax(fabs(x), fabs(y)) * OBJECT_DETECT_CELLS_PER_SIZE <
                  OBJECT_DETECT_MARGIN_CELLS - 1))
                return 0;
        }
    return 1;
}

/* ---- Peaks ---- */

static int compare_peaks(const void *a, const void *b)
{
    const object_detect_peak *x = a, *y = b;

    if (x->score != y->score)
        return x->score < y->score ? 1 : -1;
    if (x->size != y->size)
        return x->size < y->size ? -1 : 1;
    if (x->variant != y->variant)
        return x->variant - y->variant;
    if (x->y != y->y)
        return x->y < y->y ? -1 : 1;
    return x->x != y->x ? (x->x < y->x ? -1 : 1) : x->hypothesis - y->hypothesis;
}

/* Returns a free peak; when the capacity is exhausted, the worse half is discarded. */
static object_detect_peak *next_peak(object_detector *detector)
{
    if (detector->count == MAX_PEAKS) {
        qsort(detector->peaks, (size_t)detector->count, sizeof *detector->peaks, compare_peaks);
        detector->count /= 2;
    }
    return &detector->peaks[detector->count++];
}

/* Adds the local maxima of a score map to the peaks. */
static void add_peaks(object_detector *detector, const object_detect_level *level, const float *sum,
                      int32_t index)
{
    int32_t w = level->width, h = level->height;
    float share = 1 / (float)detector->model->outline_count;
    float size_prior = CANDIDATE_SIZE_WEIGHT *
                       logf((float)level->size / hypotf((float)detector->field->tokens->width,
                                                        (float)detector->field->tokens->height));

    for (int32_t y = 0; y < h; y++)
        for (int32_t x = 0; x < w; x++) {
            float value = sum[y * w + x];
            int is_peak = value > 0;

            for (int32_t k = 0; k < 9 && is_peak; k++) {
                int32_t u = x + k % 3 - 1, v = y + k / 3 - 1;

                is_peak = k == 4 || u < 0 || v < 0 || u >= w || v >= h || value > sum[v * w + u] ||
                          (value >= sum[v * w + u] && k > 4);
            }
            if (is_peak) {
                object_detect_peak *peak = next_peak(detector);

                peak->score = value * share + size_prior;
                peak->rigid = value * share;
                peak->x = ((float)x + 0.5F) * (float)level->cell_size;
                peak->y = ((float)y + 0.5F) * (float)level->cell_size;
                peak->size = (float)level->size;
                peak->turn = 0;
                peak->variant = index;
                peak->hypothesis = -1;
            }
        }
}

/* Correlates an outline with a level of the pyramid: sums over its samples for every position of
 * its origin. */
static void correlate(const object_detector *detector, const object_detect_level *level,
                      const object_detect_variant *variant, float *sum)
{
    int32_t w = level->width, h = level->height;

    memset(sum, 0, (size_t)w * (size_t)h * sizeof *sum);
    for (int32_t i = 0; i < detector->model->outline_count; i++) {
        int32_t bin = cairn_contour_search_field_bin(variant->outline[i].direction);
        int32_t dx =
            (int32_t)lrint((double)variant->outline[i].position.x * OBJECT_DETECT_CELLS_PER_SIZE);
        int32_t dy =
            (int32_t)lrint((double)variant->outline[i].position.y * OBJECT_DETECT_CELLS_PER_SIZE);
        const float *layer = &level->llr[(size_t)bin * cairn_object_detect_layer(level)];

        for (int32_t y = 0; y < h; y++) {
            const float *from = &layer[(size_t)(y + dy + OBJECT_DETECT_MARGIN_CELLS) *
                                           cairn_object_detect_row(level) +
                                       (size_t)(OBJECT_DETECT_MARGIN_CELLS + dx)];
            float *to = &sum[y * w];

            for (int32_t x = 0; x < w; x++)
                to[x] += from[x];
        }
    }
}

static float peak_overlap(const object_detector *detector, const object_detect_peak *a,
                          const object_detect_peak *b)
{
    const object_detect_variant *v = &detector->variants[a->variant],
                                *u = &detector->variants[b->variant];

    return cairn_object_detect_overlap(a->x + a->size * v->left, a->y + a->size * v->top,
                                       a->x + a->size * v->right, a->y + a->size * v->bottom,
                                       b->x + b->size * u->left, b->y + b->size * u->top,
                                       b->x + b->size * u->right, b->y + b->size * u->bottom);
}

/* Non-maximum suppression: sorts the peaks and keeps the best non-overlapping ones. */
static void suppress_non_maxima(object_detector *detector)
{
    int32_t kept = 0;

    qsort(detector->peaks, (size_t)detector->count, sizeof *detector->peaks, compare_peaks);
    for (int32_t i = 0; i < detector->count && kept < detector->field->params.candidates; i++) {
        int32_t is_separate = 1;

        for (int32_t k = 0; k < kept && is_separate; k++)
            is_separate = peak_overlap(detector, &detector->peaks[i], &detector->peaks[k]) <=
                          CANDIDATE_NMS_OVERLAP;
        if (is_separate)
            detector->peaks[kept++] = detector->peaks[i];
    }
    detector->count = kept;
}

cairn_status cairn_object_detect_candidates_of_parts(object_detector *detector)
{
    cairn_status status =
        cairn_object_detect_parts(&detector->hypotheses, detector->field, detector->model);

    if (status != CAIRN_OK)
        return status;
    detector->peaks = malloc((size_t)(detector->hypotheses.count + 1) * sizeof *detector->peaks);
    if (detector->peaks == NULL)
        return CAIRN_NO_MEMORY;
    for (int32_t i = 0; i < detector->hypotheses.count; i++) {
        const object_detect_hypothesis *hypothesis = &detector->hypotheses.list[i];
        object_detect_peak *peak = &detector->peaks[detector->count++];

        peak->score = (float)hypothesis->score;
        peak->rigid = 0;
        peak->x = (float)hypothesis->origin.x;
        peak->y = (float)hypothesis->origin.y;
        peak->size = (float)hypothesis->size;
        peak->turn = 0;
        peak->variant = hypothesis->mirrored ? OBJECT_DETECT_ASPECTS : 0;
        peak->hypothesis = i;
    }
    suppress_non_maxima(detector);
    return CAIRN_OK;
}

int cairn_object_detect_candidates_find(object_detector *detector)
{
    float *sum = NULL;

    detector->peaks = malloc(MAX_PEAKS * sizeof *detector->peaks);
    for (int32_t k = 0; k < detector->field->levels && detector->peaks != NULL; k++) {
        const object_detect_level *level = &detector->field->level[k];

        sum = malloc((size_t)level->width * (size_t)level->height * sizeof *sum);
        if (sum == NULL)
            return 0;
        for (int32_t i = 0; i < detector->variant_count; i++) {
            correlate(detector, level, &detector->variants[i], sum);
            add_peaks(detector, level, sum, i);
        }
        free(sum);
    }
    if (detector->peaks == NULL)
        return 0;
    suppress_non_maxima(detector);
    return 1;
}
