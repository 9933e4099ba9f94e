/* Bag-of-visual-words classification of a box.
 *
 * Method:
 * 1. Dense SIFT: patches of about 24 px every 6 px, and of about 48 px every 12 px, upright,
 *    because objects are.
 * 2. Each descriptor is quantized to the nearest word. Words are integers, so that the quantization
 *    is the same on every machine.
 * 3. The normalized histogram of the words in the box is classified by a support vector machine
 *    with kernel exp(-gamma chi2).
 * 4. Its decision value becomes a probability by Platt scaling (Platt 2000).
 *
 * Source: Adluru 2008, section 5.3.2, which leaves patches and kernel open. */
#include "src/base/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/images/appearance_work.h"
#include "src/host/images/shim.h"

#define PLUGIN_NAME "libcairn-appearance.so"

/* px: spacing of patches, and keypoint size for SIFT, whose patch is six times as wide; twice that
 * in the image of half the size. EARLY_EXIT_STEP: descriptor components between early-exit
 * tests. */
enum { PATCH_STEP_PX = 6, KEYPOINT_SIZE_PX = 4, OCTAVE_COUNT = 2, EARLY_EXIT_STEP = 32 };

/* Probability of a box without a patch. */
static const double UNKNOWN_PROBABILITY = 0.5;
/* Greatest chi-squared distance of two normalized histograms. */
static const double MAX_CHI2 = 2;

struct cairn_appearance_field {
    const cairn_appearance_model *model;
    cairn_appearance_shim_keypoint *keypoints;
    /* word of each patch */
    int32_t *words; /* [count] */
    int32_t count;
};

/* ---- Patches ---- */

const cairn_appearance_shim *cairn_appearance_need_shim(const char *path, cairn_file_error *error)
{
    const cairn_appearance_shim *shim =
        cairn_shim_find(PLUGIN_NAME, "CAIRN_APPEARANCE", "cairn_appearance_shim_table",
                        CAIRN_APPEARANCE_SHIM_VERSION);

    if (shim == NULL)
        (void)cairn_file_error_set(
            error, CAIRN_UNSUPPORTED, path, 0,
            "appearance needs " PLUGIN_NAME " of this version, expected it beside the program "
            "(built by `make appearance`, OpenCV 4: tools/deps.sh appearance)");
    return shim;
}

cairn_status cairn_appearance_load(cairn_file_error *error)
{
    return cairn_appearance_need_shim(PLUGIN_NAME, error) != NULL ? CAIRN_OK : CAIRN_UNSUPPORTED;
}

static void place_keypoints(appearance_patches *patches, int32_t width, int32_t height)
{
    for (int32_t octave = 0; octave < OCTAVE_COUNT; octave++) {
        int32_t step = PATCH_STEP_PX << octave;

        for (int32_t y = step / 2; y < height; y += step)
            for (int32_t x = step / 2; x < width; x += step) {
                cairn_appearance_shim_keypoint *keypoint = &patches->keypoints[patches->count++];

                keypoint->x = (float)x;
                keypoint->y = (float)y;
                keypoint->size = (float)(KEYPOINT_SIZE_PX << octave);
                keypoint->octave = octave;
            }
    }
}

static size_t max_keypoint_count(int32_t width, int32_t height)
{
    return 2 * ((size_t)width / PATCH_STEP_PX + 1) * ((size_t)height / PATCH_STEP_PX + 1);
}

cairn_status cairn_appearance_describe(appearance_patches *patches, const uint8_t *grey,
                                       int32_t width, int32_t height, const char *path,
                                       cairn_file_error *error)
{
    char message[CAIRN_APPEARANCE_SHIM_MESSAGE_BYTES] = "";
    const cairn_appearance_shim *shim;
    cairn_status status;

    memset(patches, 0, sizeof *patches);
    if (grey == NULL || width < 1 || height < 1 || width > CAIRN_APPEARANCE_MAX_SIDE ||
        height > CAIRN_APPEARANCE_MAX_SIDE)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "an image of %d x %d, expected 8-bit grey of at most %d a side",
                                    (int)width, (int)height, CAIRN_APPEARANCE_MAX_SIDE);
    shim = cairn_appearance_need_shim(path, error);
    if (shim == NULL)
        return CAIRN_UNSUPPORTED;
    patches->keypoints = malloc(max_keypoint_count(width, height) * sizeof *patches->keypoints);
    patches->descriptors = malloc(max_keypoint_count(width, height) * APPEARANCE_DESCRIPTOR_SIZE);
    if (patches->keypoints == NULL || patches->descriptors == NULL)
        return cairn_file_error_system(error, path, "describe", ENOMEM);
    place_keypoints(patches, width, height);
    if (patches->count == 0)
        return CAIRN_OK;
    status = shim->describe(grey, width, height, patches->keypoints, patches->count,
                            patches->descriptors, message, sizeof message);
    if (status != CAIRN_OK)
        return cairn_file_error_set(error, status, path, 0,
                                    "OpenCV: %s, expected patches of an image", message);
    return CAIRN_OK;
}

void cairn_appearance_patches_free(appearance_patches *patches)
{
    free(patches->keypoints);
    free(patches->descriptors);
    memset(patches, 0, sizeof *patches);
}

int cairn_appearance_is_in_box(const cairn_appearance_shim_keypoint *keypoint, const double box[4])
{
    return (double)keypoint->x >= box[0] && (double)keypoint->y >= box[1] &&
           (double)keypoint->x <= box[2] && (double)keypoint->y <= box[3];
}

/* ---- Words ---- */

int32_t cairn_appearance_nearest_word(const uint8_t *words, int32_t count,
                                      const uint8_t *descriptor, int32_t *distance)
{
    int32_t best = 0, smallest = INT32_MAX;

    for (int32_t i = 0; i < count; i++) {
        const uint8_t *word = &words[(size_t)i * APPEARANCE_DESCRIPTOR_SIZE];
        int32_t sum = 0;

        /* Early exit: stops when the partial sum exceeds the least distance. */
        for (int32_t from = 0; from < APPEARANCE_DESCRIPTOR_SIZE && sum < smallest;
             from += EARLY_EXIT_STEP)
            for (int32_t k = from; k < from + EARLY_EXIT_STEP; k++)
                sum += (word[k] - descriptor[k]) * (word[k] - descriptor[k]);
        if (sum < smallest) {
            smallest = sum;
            best = i;
        }
    }
    if (distance != NULL)
        *distance = smallest;
    return best;
}

void cairn_appearance_normalize(float *histogram, int32_t count)
{
    double sum = 0;

    for (int32_t i = 0; i < count; i++)
        sum += (double)histogram[i];
    for (int32_t i = 0; i < count && sum > 0; i++)
        histogram[i] = (float)((double)histogram[i] / sum);
}

double cairn_appearance_chi2(const float *a, const float *b, int32_t count)
{
    double sum = 0;

    for (int32_t i = 0; i < count; i++) {
        double d = (double)a[i] - (double)b[i], s = (double)a[i] + (double)b[i];

        sum += s > 0 ? d * d / s : 0;
    }
    return sum;
}

/* ---- Classification ---- */

double cairn_appearance_decision(const cairn_appearance_model *model, const float *histogram)
{
    double sum = -model->rho;

    for (int32_t i = 0; i < model->support_count; i++)
        sum += model->weights[i] *
               exp(-model->gamma *
                   cairn_appearance_chi2(&model->histograms[(size_t)i * (size_t)model->word_count],
                                         histogram, model->word_count));
    return sum;
}

double cairn_appearance_histogram_probability(const cairn_appearance_model *model,
                                              const float *histogram)
{
    return 1 / (1 + exp(fmin(700, model->platt_slope * cairn_appearance_decision(model, histogram) +
                                      model->platt_offset)));
}

cairn_status cairn_appearance_field_make(cairn_appearance_field **field,
                                         const cairn_appearance_model *model, const uint8_t *grey,
                                         int32_t width, int32_t height, const char *path,
                                         cairn_file_error *error)
{
    appearance_patches patches;
    cairn_appearance_field *made = NULL;
    cairn_status status = cairn_appearance_describe(&patches, grey, width, height, path, error);

    *field = NULL;
    if (status == CAIRN_OK) {
        made = calloc(1, sizeof *made);
        if (made != NULL)
            made->words = malloc(((size_t)patches.count + 1) * sizeof *made->words);
        if (made == NULL || made->words == NULL) {
            free(made);
            made = NULL;
            status = cairn_file_error_system(error, path, "describe", ENOMEM);
        }
    }
    if (made != NULL) {
        made->model = model;
        made->count = patches.count;
        for (int32_t i = 0; i < patches.count; i++)
            made->words[i] = cairn_appearance_nearest_word(
                model->words, model->word_count,
                &patches.descriptors[(size_t)i * APPEARANCE_DESCRIPTOR_SIZE], NULL);
        made->keypoints = patches.keypoints;
        patches.keypoints = NULL;
        *field = made;
    }
    cairn_appearance_patches_free(&patches);
    return status;
}

void cairn_appearance_field_free(cairn_appearance_field *field)
{
    if (field == NULL)
        return;
    free(field->keypoints);
    free(field->words);
    free(field);
}

/* Computes the normalized histogram of a box. Returns 0 when it has no patch. */
static int compute_histogram(const cairn_appearance_field *field, const double box[4],
                             float histogram[CAIRN_APPEARANCE_MAX_WORDS])
{
    int32_t patches = 0;

    memset(histogram, 0, CAIRN_APPEARANCE_MAX_WORDS * sizeof *histogram);
    for (int32_t i = 0; i < field->count; i++)
        if (cairn_appearance_is_in_box(&field->keypoints[i], box)) {
            histogram[field->words[i]]++;
            patches++;
        }
    cairn_appearance_normalize(histogram, field->model->word_count);
    return patches > 0;
}

double cairn_appearance_probability(const cairn_appearance_field *field, const double box[4])
{
    float histogram[CAIRN_APPEARANCE_MAX_WORDS];

    return compute_histogram(field, box, histogram)
               ? cairn_appearance_histogram_probability(field->model, histogram)
               : UNKNOWN_PROBABILITY;
}

/* Positive support vectors raise the probability: the sign of their weights is opposite to that of
 * the slope. */
double cairn_appearance_distance(const cairn_appearance_field *field, const double box[4])
{
    const cairn_appearance_model *model = field->model;
    float histogram[CAIRN_APPEARANCE_MAX_WORDS];
    double smallest = MAX_CHI2;

    if (!compute_histogram(field, box, histogram))
        return 1;
    for (int32_t i = 0; i < model->support_count; i++)
        if (model->weights[i] * model->platt_slope < 0)
            smallest = fmin(smallest, cairn_appearance_chi2(
                                          &model->histograms[(size_t)i * (size_t)model->word_count],
                                          histogram, model->word_count));
    return smallest / MAX_CHI2;
}

void cairn_appearance_free(cairn_appearance_model *model)
{
    free(model->words);
    free(model->histograms);
    free(model->weights);
    memset(model, 0, sizeof *model);
}
