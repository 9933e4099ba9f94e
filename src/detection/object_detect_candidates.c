/* Candidate generation: for each variant of the model and each size, the peaks of a map of the mean
 * log-likelihood ratio of the outline's samples; then non-maximum suppression over all peaks.
 * object_detect.c describes the method. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/detection_curve.h"
#include "src/base/step.h"
#include "src/containers/ranked_list.h"
#include "src/detection/object_detect_object.h"

/* Factors on the model's aspect ratio (width over height). */
static const cairn_real aspects[OBJECT_DETECT_ASPECTS] = {1, CAIRN_REAL(0.8), CAIRN_REAL(1.25),
                                                          CAIRN_REAL(0.64), CAIRN_REAL(1.5625)};
/* Non-maximum suppression threshold of candidates: greatest intersection over union. */
static const cairn_real CANDIDATE_NMS_OVERLAP = CAIRN_REAL(0.5);
/* Weight of the log of the size in a candidate's score. */
static const float CANDIDATE_SIZE_WEIGHT = 0.4F;
enum { CELLS_PER_UNIT = 64, PEAKED_PER_UNIT = 16, PEAKS_PER_UNIT = 4 };

/* ---- Variants of the model ---- */

static void add_variant(cairn_object_detector *detector, int32_t mirrored, cairn_real aspect)
{
    object_detect_variant *variant = &detector->variants[detector->variant_count];
    const cairn_shape_model *model = detector->model;
    cairn_real wide = cairn_sqrt(aspect) * (mirrored ? -1 : 1), tall = 1 / cairn_sqrt(aspect);

    variant->outline =
        &detector->outlines[(size_t)detector->variant_count++ * (size_t)model->outline_count];
    variant->mirrored = mirrored;
    variant->box[0] = variant->box[1] = 1e9F;
    variant->box[2] = variant->box[3] = -1e9F;
    for (int32_t i = 0; i < model->outline_count; i++) {
        cairn_oriented_point *sample = &variant->outline[i];
        cairn_vec2 along = {wide * model->outline[i].direction.x,
                            tall * model->outline[i].direction.y};
        float x, y;

        sample->position.x = wide * model->outline[i].position.x;
        sample->position.y = tall * model->outline[i].position.y;
        sample->direction = cairn_vec2_unit(along);
        x = (float)sample->position.x;
        y = (float)sample->position.y;
        variant->box[0] = x < variant->box[0] ? x : variant->box[0];
        variant->box[1] = y < variant->box[1] ? y : variant->box[1];
        variant->box[2] = x > variant->box[2] ? x : variant->box[2];
        variant->box[3] = y > variant->box[3] ? y : variant->box[3];
    }
}

void cairn_object_detect_variants_add(cairn_object_detector *detector)
{
    detector->variant_count = 0;
    for (int32_t mirrored = 0; mirrored < (detector->params.mirror ? 2 : 1); mirrored++)
        for (int32_t k = 0; k < OBJECT_DETECT_ASPECTS; k++)
            add_variant(detector, mirrored, aspects[k]);
}

int cairn_object_detect_variants_are_inside_margin(const cairn_shape_model *model)
{
    for (int32_t k = 0; k < OBJECT_DETECT_ASPECTS; k++)
        for (int32_t i = 0; i < model->outline_count; i++) {
            cairn_real x = cairn_sqrt(aspects[k]) * model->outline[i].position.x;
            cairn_real y = model->outline[i].position.y / cairn_sqrt(aspects[k]);

            if (!(cairn_max(cairn_abs(x), cairn_abs(y)) * OBJECT_DETECT_CELLS_PER_SIZE <
                  OBJECT_DETECT_MARGIN_CELLS - 1))
                return 0;
        }
    return 1;
}

/* ---- Peaks ---- */

static int32_t compare_peaks(const void *first, const void *second)
{
    const object_detect_peak *a = first, *b = second;

    if (a->score != b->score)
        return a->score < b->score ? 1 : -1;
    if (a->size != b->size)
        return a->size < b->size ? -1 : 1;
    if (a->variant != b->variant)
        return a->variant - b->variant;
    if (a->y != b->y)
        return a->y < b->y ? -1 : 1;
    return a->x != b->x ? (a->x < b->x ? -1 : 1) : a->hypothesis - b->hypothesis;
}

void cairn_object_detect_sort_peaks(cairn_object_detector *detector)
{
    cairn_detection_sort_begin(&detector->sort, detector->peaks, detector->count,
                               sizeof *detector->peaks, compare_peaks);
}

/* Returns 1 for a local maximum above 0 of a score map; of equal neighbours the first. */
static int is_peak(const float *sum, int32_t w, int32_t h, int32_t x, int32_t y)
{
    float value = sum[y * w + x];
    int peak = value > 0;

    for (int32_t k = 0; k < 9 && peak; k++) {
        int32_t u = x + k % 3 - 1, v = y + k / 3 - 1;

        peak = k == 4 || u < 0 || v < 0 || u >= w || v >= h || value > sum[v * w + u] ||
               (value >= sum[v * w + u] && k > 4);
    }
    return peak;
}

/* Adds the local maxima of a row of the score map to the peaks. */
static void add_peaks(cairn_object_detector *detector, const object_detect_level *level, int32_t y)
{
    const cairn_contour_search_tokens *tokens = &detector->field->tokens;
    const cairn_vec2 sides = {(cairn_real)tokens->width, (cairn_real)tokens->height};
    int32_t w = level->width;
    float share = 1 / (float)detector->model->outline_count;
    float size_prior =
        CANDIDATE_SIZE_WEIGHT *
        (float)cairn_log((cairn_real)((float)level->size / (float)cairn_vec2_norm(sides)));

    for (int32_t x = 0; x < w; x++) {
        object_detect_peak *peak;
        float value = detector->sum[y * w + x];

        if (!is_peak(detector->sum, w, level->height, x, y))
            continue;
        peak = &detector->peaks[detector->count++];
        peak->score = value * share + size_prior;
        peak->rigid = value * share;
        peak->x = ((float)x + 0.5F) * (float)level->cell_size;
        peak->y = ((float)y + 0.5F) * (float)level->cell_size;
        peak->size = (float)level->size;
        peak->turn = 0;
        peak->variant = detector->map.variant;
        peak->hypothesis = -1;
    }
}

/* The level and the sample of the score map. */
static const object_detect_level *current_level(const cairn_object_detector *detector)
{
    return &detector->field->level[detector->map.level];
}

static void set_shift(object_detect_map *map, const object_detect_level *level,
                      cairn_oriented_point sample)
{
    size_t bin = (size_t)cairn_contour_search_field_bin(sample.direction);

    map->layer = &level->llr[bin * cairn_object_detect_layer(level)];
    map->dx = cairn_real_to_int(cairn_rint(sample.position.x * OBJECT_DETECT_CELLS_PER_SIZE));
    map->dy = cairn_real_to_int(cairn_rint(sample.position.y * OBJECT_DETECT_CELLS_PER_SIZE));
}

/* Adds the ratios of the sample to the row of the score map. */
static void add_sample(const object_detect_map *map, const object_detect_level *level, float *sum)
{
    float *to = &sum[map->row * level->width];
    const float *from = &map->layer[(size_t)(map->row + map->dy + OBJECT_DETECT_MARGIN_CELLS) *
                                        cairn_object_detect_row(level) +
                                    (size_t)(OBJECT_DETECT_MARGIN_CELLS + map->dx)];

    if (map->sample == 0)
        memset(to, 0, (size_t)level->width * sizeof *to);
    for (int32_t x = 0; x < level->width; x++)
        to[x] += from[x];
}

/* Correlates a variant's outline with a level of the pyramid: sums over its samples for every
 * position of its origin. */
static int correlate(cairn_object_detector *detector, cairn_budget *budget)
{
    const object_detect_level *level = current_level(detector);
    object_detect_map *map = &detector->map;
    const cairn_oriented_point *outline = detector->variants[map->variant].outline;

    CAIRN_STEP_BEGIN(detector->item_resume);
    for (map->sample = 0; map->sample < detector->model->outline_count; map->sample++) {
        set_shift(map, level, outline[map->sample]);
        for (map->row = 0; map->row < level->height; map->row++) {
            CAIRN_STEP_CHARGE(detector, item_resume, budget, 1 + level->width / CELLS_PER_UNIT);
            add_sample(map, level, detector->sum);
        }
    }
    CAIRN_STEP_END(detector->item_resume);
}

/* The peaks of a score map. Where the capacity may not suffice for a row, the worse half of the
 * peaks is discarded first. */
static int collect_peaks(cairn_object_detector *detector, cairn_budget *budget)
{
    const object_detect_level *level = current_level(detector);
    object_detect_map *map = &detector->map;

    CAIRN_STEP_BEGIN(detector->item_resume);
    for (map->row = 0; map->row < level->height; map->row++) {
        if (detector->count + level->width > detector->params.max_peaks) {
            cairn_object_detect_sort_peaks(detector);
            CAIRN_STEP_UNTIL(detector->item_resume,
                             cairn_detection_sort_step(&detector->sort, budget));
            detector->count /= 2;
        }
        CAIRN_STEP_CHARGE(detector, item_resume, budget, 1 + level->width / PEAKED_PER_UNIT);
        add_peaks(detector, level, map->row);
    }
    CAIRN_STEP_END(detector->item_resume);
}

int cairn_object_detect_peaks_step(cairn_object_detector *detector, cairn_budget *budget)
{
    object_detect_map *map = &detector->map;

    CAIRN_STEP_BEGIN(detector->phase_resume);
    for (map->level = 0; map->level < detector->field->levels; map->level++)
        for (map->variant = 0; map->variant < detector->variant_count; map->variant++) {
            CAIRN_STEP_RUN(detector, phase_resume, budget, correlate);
            CAIRN_STEP_RUN(detector, phase_resume, budget, collect_peaks);
        }
    CAIRN_STEP_END(detector->phase_resume);
}

void cairn_object_detect_peaks_of_parts(cairn_object_detector *detector)
{
    for (int32_t i = 0; i < detector->parts.count; i++) {
        const object_detect_hypothesis *hypothesis = &detector->parts.list[i];
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
}

/* ---- Non-maximum suppression ---- */

static void set_peak_box(const cairn_object_detector *detector, const object_detect_peak *peak,
                         cairn_real box[4])
{
    const float *shape = detector->variants[peak->variant].box;

    for (int32_t k = 0; k < 4; k++)
        box[k] = (cairn_real)((k % 2 == 0 ? peak->x : peak->y) + peak->size * shape[k]);
}

/* 1 when two peaks overlap too much; context: the detector. */
static int overlap_too_much(const void *context, const void *first, const void *second)
{
    cairn_real box_a[4], box_b[4];

    set_peak_box(context, first, box_a);
    set_peak_box(context, second, box_b);
    return cairn_detection_curve_overlap(box_a, box_b) > CANDIDATE_NMS_OVERLAP;
}

/* Keeps a peak unless it overlaps a better one that was kept. */
static void keep_if_separate(cairn_object_detector *detector, int32_t index)
{
    const ranked_list kept = {.entries = detector->peaks,
                              .count = &detector->kept,
                              .entry_bytes = sizeof *detector->peaks,
                              .is_near = overlap_too_much,
                              .context = detector};

    ranked_list_keep(&kept, index);
}

int cairn_object_detect_suppress_step(cairn_object_detector *detector, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(detector->phase_resume);
    detector->kept = 0;
    for (detector->cursor = 0;
         detector->cursor < detector->count && detector->kept < detector->params.candidates;
         detector->cursor++) {
        CAIRN_STEP_CHARGE(detector, phase_resume, budget, 1 + detector->kept / PEAKS_PER_UNIT);
        keep_if_separate(detector, detector->cursor);
    }
    detector->count = detector->kept;
    CAIRN_STEP_END(detector->phase_resume);
}
