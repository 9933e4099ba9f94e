/* Training of an appearance model from boxes around the objects of a class.
 *
 * Method:
 * 1. Dictionary: k-means (Lloyd 1982) with k-means++ seeding (Arthur and Vassilvitskii 2007) of the
 *    patches in the boxes, evenly subsampled when there are many. The means are rounded to
 *    integers.
 * 2. Negative windows have the sizes of boxes, at random positions beside the boxes.
 * 3. gamma is 1 over the mean chi-squared distance of pairs of histograms.
 * 4. Platt scaling by Newton's method with backtracking (Lin, Lin and Weng 2007), on decision
 *    values from cross-validation: support vector machines trained without the images that they are
 *    evaluated on.
 *
 * Source: Adluru 2008, section 5.3.2, which names the steps. */
#include "src/base/build.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/appearance_train.h"
#include "cairn/detection_curve.h"
#include "cairn/random.h"
#include "src/host/base/host_parameters.h"
#include "src/host/base/interruption.h"
#include "src/host/images/appearance_patches.h"

enum {
    MAX_PATCHES = 8000,
    KMEANS_ROUNDS = 25,
    MAX_WINDOW_TRIES = 50,
    FOLD_COUNT = 5,
    MAX_NEWTON_STEPS = 100,
    MAX_HALVINGS = 30
};
/* Samples whose pairs determine gamma; the number of pairs is quadratic. */
enum { MAX_PAIRED_SAMPLES = 1000 };
/* Limit of gamma; beyond it the kernel only separates identical histograms. */
#define MAX_GAMMA 1e9
/* Negative windows have a smaller intersection over union with every box. */
#define MAX_NEGATIVE_OVERLAP 0.2
/* Streams of random numbers of one seed. */
/* limit of sampled windows; not all of them are kept */
enum { MAX_WINDOWS = 10 * CAIRN_APPEARANCE_MAX_SUPPORT_VECTORS };
enum { STREAM_WORDS = 11, STREAM_WINDOWS = 12 };

typedef struct trained_image {
    appearance_patches patches;
    double (*boxes)[4];
    int32_t box_count, width, height;
} trained_image;

struct cairn_appearance_trainer {
    trained_image *images; /* [CAIRN_APPEARANCE_TRAIN_MAX_IMAGES] */
    int32_t count;
};

/* The training set: positive boxes and negative windows. */
typedef struct training_set {
    float *histograms; /* [count][words] normalized histograms */
    int32_t *is_class, *image;
    double *decision; /* decision values of a machine trained without the image */
    int32_t count, capacity, words;
} training_set;

static const cairn_host_parameter rows[] = {
    CAIRN_HOST_NUMBER(cairn_appearance_train_params, words, 100, 2, CAIRN_APPEARANCE_MAX_WORDS),
    CAIRN_HOST_NUMBER(cairn_appearance_train_params, negatives, 10, 1, 100),
    CAIRN_HOST_NUMBER_ABOVE(cairn_appearance_train_params, cost, 10, 0, 1e6),
};

const cairn_host_parameters cairn_appearance_train_parameters =
    CAIRN_HOST_PARAMETERS(cairn_appearance_train_params, rows);

cairn_appearance_train_params cairn_appearance_train_default(void)
{
    cairn_appearance_train_params params;

    cairn_host_parameters_preset(&cairn_appearance_train_parameters, &params);
    params.seed = 1;
    return params;
}

cairn_appearance_trainer *cairn_appearance_trainer_new(void)
{
    cairn_appearance_trainer *trainer = calloc(1, sizeof *trainer);

    if (trainer != NULL)
        trainer->images = calloc(CAIRN_APPEARANCE_TRAIN_MAX_IMAGES, sizeof *trainer->images);
    if (trainer != NULL && trainer->images == NULL) {
        free(trainer);
        return NULL;
    }
    return trainer;
}

void cairn_appearance_trainer_free(cairn_appearance_trainer *trainer)
{
    if (trainer == NULL)
        return;
    for (int32_t i = 0; i < trainer->count; i++) {
        cairn_appearance_image_patches_free(&trainer->images[i].patches);
        free(trainer->images[i].boxes);
    }
    free(trainer->images);
    free(trainer);
}

static cairn_status no_memory(const char *path, cairn_file_error *error)
{
    return cairn_file_error_system(error, path, "learn from", ENOMEM);
}

static int is_box(const double box[4], int32_t width, int32_t height)
{
    return box[2] - box[0] >= 1 && box[3] - box[1] >= 1 && box[0] < width && box[1] < height &&
           box[2] > 0 && box[3] > 0 && box[2] - box[0] <= 2.0 * CAIRN_APPEARANCE_IMAGE_MAX_SIDE &&
           box[3] - box[1] <= 2.0 * CAIRN_APPEARANCE_IMAGE_MAX_SIDE;
}

cairn_status cairn_appearance_trainer_add(cairn_appearance_trainer *trainer, const uint8_t *grey,
                                          int32_t width, int32_t height, const double *boxes,
                                          int32_t count, const char *path, cairn_file_error *error)
{
    trained_image *image = &trainer->images[trainer->count];
    cairn_status status;

    if (trainer->count == CAIRN_APPEARANCE_TRAIN_MAX_IMAGES)
        return cairn_file_error_set(error, CAIRN_FULL, path, 0,
                                    "one image more, expected at most %d",
                                    CAIRN_APPEARANCE_TRAIN_MAX_IMAGES);
    if (count < 0 || (boxes == NULL && count > 0))
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "%d boxes, expected none or more", (int)count);
    for (int32_t i = 0; i < count; i++)
        if (!is_box(&boxes[4 * i], width, height))
            return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                        "a box from (%g, %g) to (%g, %g), expected left, top, "
                                        "right, bottom in the image of %d x %d",
                                        boxes[4 * i], boxes[4 * i + 1], boxes[4 * i + 2],
                                        boxes[4 * i + 3], (int)width, (int)height);
    memset(image, 0, sizeof *image);
    status = cairn_appearance_image_describe(&image->patches, grey, width, height, path, error);
    if (status == CAIRN_OK) {
        image->boxes = malloc(((size_t)count + 1) * sizeof *image->boxes);
        if (image->boxes == NULL)
            status = no_memory(path, error);
    }
    if (status != CAIRN_OK) {
        cairn_appearance_image_patches_free(&image->patches);
        return status;
    }
    if (count > 0)
        memcpy(image->boxes, boxes, (size_t)count * sizeof *image->boxes);
    image->box_count = count;
    image->width = width;
    image->height = height;
    trainer->count++;
    return CAIRN_OK;
}

/* ---- The dictionary ---- */

/* Uniform random number in [0, 1), the same in both precisions. */
static double draw(cairn_random *random)
{
    return cairn_random_bits(random) / 4294967296.0;
}

static int is_in_a_box(const trained_image *image, int32_t patch)
{
    for (int32_t i = 0; i < image->box_count; i++)
        if (cairn_appearance_image_is_in_box(&image->patches.keypoints[patch], image->boxes[i]))
            return 1;
    return 0;
}

/* Chooses an even subsample of the patches in boxes. *count: their number. */
static const uint8_t **choose_patches(const cairn_appearance_trainer *trainer, int32_t *count)
{
    const uint8_t **chosen = malloc(MAX_PATCHES * sizeof *chosen);
    int64_t total = 0, passed = 0;

    *count = 0;
    for (int pass = 0; pass < 2 && chosen != NULL; pass++)
        for (int32_t i = 0; i < trainer->count; i++)
            for (int32_t k = 0; k < trainer->images[i].patches.count; k++) {
                int64_t capacity;

                if (!is_in_a_box(&trainer->images[i], k))
                    continue;
                if (pass == 0) {
                    total++;
                    continue;
                }
                capacity = total < MAX_PATCHES ? total : MAX_PATCHES;
                if (total > 0 && (passed + 1) * capacity / total > passed * capacity / total)
                    chosen[(*count)++] =
                        &trainer->images[i]
                             .patches.descriptors[(size_t)k * APPEARANCE_DESCRIPTOR_SIZE];
                passed++;
            }
    return chosen;
}

/* k-means++ seeding: each word is sampled with a probability proportional to the squared distance
 * to the previous words. */
static void seed_words(uint8_t *words, int32_t count, const uint8_t *const *patches,
                       int32_t patch_count, int32_t *distance, cairn_random *random)
{
    for (int32_t w = 0; w < count && !cairn_interruption_is_requested(); w++) {
        double sum = 0, target;
        int32_t next = 0;

        for (int32_t i = 0; i < patch_count; i++) {
            int32_t d = 1;

            if (w > 0)
                (void)cairn_appearance_nearest_word(
                    &words[(size_t)(w - 1) * APPEARANCE_DESCRIPTOR_SIZE], 1, patches[i], &d);
            distance[i] = w > 1 && distance[i] < d ? distance[i] : d;
            sum += distance[i];
        }
        target = draw(random) * sum;
        for (next = 0; next + 1 < patch_count && target >= distance[next]; next++)
            target -= distance[next];
        memcpy(&words[(size_t)w * APPEARANCE_DESCRIPTOR_SIZE], patches[next],
               APPEARANCE_DESCRIPTOR_SIZE);
    }
}

/* Lloyd update: moves words to the means of their patches; a word without patches stays. Returns 0
 * on convergence. */
static int update_words(uint8_t *words, int32_t count, const int32_t *sum, const int32_t *members)
{
    int moved = 0;

    for (int32_t w = 0; w < count; w++)
        for (int32_t k = 0; k < APPEARANCE_DESCRIPTOR_SIZE && members[w] > 0; k++) {
            uint8_t *value = &words[(size_t)w * APPEARANCE_DESCRIPTOR_SIZE + (size_t)k];
            uint8_t mean = (uint8_t)((2 * sum[(size_t)w * APPEARANCE_DESCRIPTOR_SIZE + (size_t)k] +
                                      members[w]) /
                                     (2 * members[w]));

            moved |= mean != *value;
            *value = mean;
        }
    return moved;
}

static cairn_status cluster_words(cairn_appearance_model *model,
                                  const cairn_appearance_trainer *trainer,
                                  const cairn_appearance_train_params *params, const char *path,
                                  cairn_file_error *error)
{
    cairn_random random = cairn_random_seed(params->seed, STREAM_WORDS);
    size_t numbers = (size_t)params->words * APPEARANCE_DESCRIPTOR_SIZE;
    int32_t patch_count = 0, *sum = malloc(numbers * sizeof *sum);
    int32_t *members = malloc((size_t)params->words * sizeof *members);
    int32_t *distance = malloc(MAX_PATCHES * sizeof *distance);
    const uint8_t **patches = choose_patches(trainer, &patch_count);
    cairn_status status = CAIRN_OK;

    model->word_count = params->words;
    model->words = malloc(numbers);
    if (patches == NULL || sum == NULL || members == NULL || distance == NULL ||
        model->words == NULL) {
        status = no_memory(path, error);
    } else if (patch_count < params->words) {
        status = cairn_file_error_set(error, CAIRN_EMPTY, path, 0,
                                      "%d patches in boxes, expected at least %d", (int)patch_count,
                                      (int)params->words);
    } else {
        seed_words(model->words, model->word_count, patches, patch_count, distance, &random);
        for (int32_t round = 0; round < KMEANS_ROUNDS; round++) {
            memset(sum, 0, numbers * sizeof *sum);
            memset(members, 0, (size_t)params->words * sizeof *members);
            for (int32_t i = 0; i < patch_count && !cairn_interruption_is_requested(); i++) {
                int32_t w = cairn_appearance_nearest_word(model->words, model->word_count,
                                                          patches[i], NULL);

                members[w]++;
                for (int32_t k = 0; k < APPEARANCE_DESCRIPTOR_SIZE; k++)
                    sum[(size_t)w * APPEARANCE_DESCRIPTOR_SIZE + (size_t)k] += patches[i][k];
            }
            if (!update_words(model->words, model->word_count, sum, members))
                break;
        }
        if (cairn_interruption_is_requested())
            status = CAIRN_MORE;
    }
    free(patches);
    free(sum);
    free(members);
    free(distance);
    return status;
}

/* ---- Windows ---- */

static void add_sample(training_set *set, const trained_image *image, const int32_t *word_of,
                       const double box[4], int32_t is_class, int32_t index)
{
    float *histogram = &set->histograms[(size_t)set->count * (size_t)set->words];

    memset(histogram, 0, (size_t)set->words * sizeof *histogram);
    for (int32_t i = 0; i < image->patches.count; i++)
        if (cairn_appearance_image_is_in_box(&image->patches.keypoints[i], box))
            histogram[word_of[i]]++;
    cairn_appearance_normalize(histogram, set->words);
    set->is_class[set->count] = is_class;
    set->image[set->count++] = index;
}

/* Intersection over union of two boxes. */
static double overlap_of(const double a[4], const double b[4])
{
    cairn_real first[4], second[4];

    for (int k = 0; k < 4; k++) {
        first[k] = (cairn_real)a[k];
        second[k] = (cairn_real)b[k];
    }
    return (double)cairn_detection_curve_overlap(first, second);
}

/* Samples a window of the size of a random box, scaled down to fit the image, that does not overlap
 * this image's boxes. Returns 0 when none was found. */
static int draw_window(const cairn_appearance_trainer *trainer, const trained_image *image,
                       int32_t boxes, cairn_random *random, double window[4])
{
    for (int32_t try = 0; try < MAX_WINDOW_TRIES; try++) {
        int32_t which = cairn_random_below(random, boxes), from = 0, is_apart = 1;
        const double *like;
        double w, h, scale;

        while (which >= trainer->images[from].box_count)
            which -= trainer->images[from++].box_count;
        like = trainer->images[from].boxes[which];
        w = like[2] - like[0];
        h = like[3] - like[1];
        scale = fmin(1, fmin(image->width / w, image->height / h));
        w *= scale;
        h *= scale;
        window[0] = draw(random) * (image->width - w);
        window[1] = draw(random) * (image->height - h);
        window[2] = window[0] + w;
        window[3] = window[1] + h;
        for (int32_t i = 0; i < image->box_count && is_apart; i++)
            is_apart = overlap_of(window, image->boxes[i]) < MAX_NEGATIVE_OVERLAP;
        if (is_apart)
            return 1;
    }
    return 0;
}

static int64_t count_boxes(const cairn_appearance_trainer *trainer)
{
    int64_t boxes = 0;

    for (int32_t i = 0; i < trainer->count; i++)
        boxes += trainer->images[i].box_count;
    return boxes;
}

/* Greatest number of boxes and negative windows. */
static int64_t windows_of(const cairn_appearance_trainer *trainer,
                          const cairn_appearance_train_params *params)
{
    return (params->negatives + 1) * (count_boxes(trainer) + trainer->count);
}

static int new_samples(training_set *set, const cairn_appearance_trainer *trainer,
                       const cairn_appearance_train_params *params)
{
    set->capacity = (int32_t)windows_of(trainer, params);
    set->words = params->words;
    set->histograms = malloc((size_t)set->capacity * (size_t)set->words * sizeof *set->histograms);
    set->is_class = malloc((size_t)set->capacity * sizeof *set->is_class);
    set->image = malloc((size_t)set->capacity * sizeof *set->image);
    set->decision = calloc((size_t)set->capacity, sizeof *set->decision);
    return set->histograms != NULL && set->is_class != NULL && set->image != NULL &&
           set->decision != NULL;
}

static void free_samples(training_set *set)
{
    free(set->histograms);
    free(set->is_class);
    free(set->image);
    free(set->decision);
}

/* Collects the samples of all images, of those before an interruption. Returns 0 when out of
 * memory. */
static int collect_samples(training_set *set, const cairn_appearance_model *model,
                           const cairn_appearance_trainer *trainer,
                           const cairn_appearance_train_params *params)
{
    cairn_random random = cairn_random_seed(params->seed, STREAM_WINDOWS);
    int32_t boxes = (int32_t)count_boxes(trainer);

    if (!new_samples(set, trainer, params))
        return 0;
    for (int32_t i = 0; i < trainer->count; i++) {
        const trained_image *image = &trainer->images[i];
        int32_t window_count = params->negatives * (image->box_count > 0 ? image->box_count : 1);
        int32_t *word_of = malloc(((size_t)image->patches.count + 1) * sizeof *word_of);
        double window[4];

        if (word_of == NULL)
            return 0;
        for (int32_t k = 0; k < image->patches.count; k++) {
            if (cairn_interruption_is_requested()) {
                free(word_of);
                return 1;
            }
            word_of[k] = cairn_appearance_nearest_word(
                model->words, model->word_count,
                &image->patches.descriptors[(size_t)k * APPEARANCE_DESCRIPTOR_SIZE], NULL);
        }
        for (int32_t k = 0; k < image->box_count; k++)
            add_sample(set, image, word_of, image->boxes[k], 1, i);
        for (int32_t k = 0; k < window_count && draw_window(trainer, image, boxes, &random, window);
             k++)
            add_sample(set, image, word_of, window, 0, i);
        free(word_of);
    }
    return 1;
}

/* ---- The support vector machine ---- */

static int32_t count_class(const training_set *set)
{
    int32_t count = 0;

    for (int32_t i = 0; i < set->count; i++)
        count += set->is_class[i];
    return count;
}

static const float *sample_evenly(const training_set *set, int32_t index, int32_t count)
{
    return &set->histograms[(size_t)((int64_t)index * set->count / count) * (size_t)set->words];
}

/* gamma: 1 over the mean chi-squared distance of the pairs of at most MAX_PAIRED_SAMPLES samples,
 * evenly chosen; 1 when all are identical. */
static double gamma_of(const training_set *set)
{
    int32_t count = set->count < MAX_PAIRED_SAMPLES ? set->count : MAX_PAIRED_SAMPLES;
    double sum = 0;

    for (int32_t i = 0; i < count && !cairn_interruption_is_requested(); i++)
        for (int32_t k = 0; k < i; k++)
            sum += (double)cairn_appearance_chi2(sample_evenly(set, i, count),
                                                 sample_evenly(set, k, count), set->words);
    return sum > 0 ? fmin(MAX_GAMMA, count * (count - 1.0) / 2 / sum) : 1;
}

/* Trains on the samples whose images are not in the fold (-1: on all). CAIRN_EMPTY: only one
 * class. */
static cairn_status train_machine(cairn_appearance_model *model, const training_set *set,
                                  double cost, int32_t fold, int32_t folds, const char *path,
                                  cairn_file_error *error)
{
    const cairn_appearance_shim *shim = cairn_appearance_image_need_shim(path, error);
    char message[CAIRN_APPEARANCE_SHIM_MESSAGE_BYTES] = "";
    cairn_appearance_shim_machine machine = {
        .support = model->histograms,
        .weight = malloc(((size_t)set->count + 1) * sizeof *machine.weight)};
    size_t row = (size_t)set->words;
    float *table = malloc(((size_t)set->count * row + 1) * sizeof *table);
    int32_t *is_class = malloc(((size_t)set->count + 1) * sizeof *is_class), count = 0,
            of_class = 0;
    cairn_status status = shim == NULL ? CAIRN_UNSUPPORTED : CAIRN_OK;

    if (machine.weight == NULL || table == NULL || is_class == NULL) {
        free(machine.weight);
        free(table);
        free(is_class);
        return no_memory(path, error);
    }
    for (int32_t i = 0; i < set->count && status == CAIRN_OK; i++)
        if (fold < 0 || set->image[i] % folds != fold) {
            memcpy(&table[(size_t)count * row], &set->histograms[(size_t)i * row],
                   row * sizeof *table);
            of_class += set->is_class[i];
            is_class[count++] = set->is_class[i];
        }
    if (status == CAIRN_OK && (of_class == 0 || of_class == count))
        status = CAIRN_EMPTY;
    if (status == CAIRN_OK) {
        status = shim->train(table, is_class, count, set->words, cost, (double)model->gamma,
                             &machine, message, sizeof message);
        if (status != CAIRN_OK)
            (void)cairn_file_error_set(error, status, path, 0,
                                       "OpenCV: %s, expected histograms of both kinds", message);
    }
    model->support_count = machine.count;
    model->rho = (cairn_real)machine.rho;
    for (int32_t i = 0; i < machine.count; i++)
        model->weights[i] = (cairn_real)machine.weight[i];
    free(machine.weight);
    free(table);
    free(is_class);
    return status;
}

/* Cross-validation: decision value of every sample by a machine trained without its image; by the
 * machine trained on all where that is impossible. */
static cairn_status cross_validate(cairn_appearance_model *model, training_set *set,
                                   const cairn_appearance_trainer *trainer, double cost,
                                   const char *path, cairn_file_error *error)
{
    int32_t folds = trainer->count < FOLD_COUNT ? trainer->count : FOLD_COUNT;
    cairn_status status = CAIRN_OK;

    for (int32_t fold = 0; fold < folds && (status == CAIRN_OK || status == CAIRN_EMPTY); fold++) {
        status = train_machine(model, set, cost, fold, folds, path, error);
        if (status == CAIRN_EMPTY)
            status = train_machine(model, set, cost, -1, folds, path, error);
        for (int32_t i = 0;
             i < set->count && status == CAIRN_OK && !cairn_interruption_is_requested(); i++)
            if (set->image[i] % folds == fold)
                set->decision[i] = (double)cairn_appearance_decision(
                    model, &set->histograms[(size_t)i * (size_t)set->words]);
    }
    return status;
}

/* Cross-entropy of the sigmoid, with targets slightly inside 0 and 1. */
static double cross_entropy(const training_set *set, const double target[2], double slope,
                            double offset)
{
    double sum = 0;

    for (int32_t i = 0; i < set->count; i++) {
        double t = target[set->is_class[i]], z = slope * set->decision[i] + offset;

        sum += z >= 0 ? t * z + log(1 + exp(-z)) : (t - 1) * z + log(1 + exp(z));
    }
    return sum;
}

/* Fits the sigmoid's slope and offset by Newton's method with backtracking line search. */
static void fit_sigmoid(cairn_appearance_model *model, const training_set *set)
{
    double of_class = count_class(set), others = set->count - of_class;
    double target[2] = {1 / (others + 2), (of_class + 1) / (of_class + 2)};
    double slope = 0, offset = log((others + 1) / (of_class + 1));

    for (int32_t step = 0; step < MAX_NEWTON_STEPS; step++) {
        double h11 = 1e-12, h22 = 1e-12, h21 = 0, g1 = 0, g2 = 0, det, a, b, current, size = 1;

        for (int32_t i = 0; i < set->count; i++) {
            double f = set->decision[i], p = 1 / (1 + exp(slope * f + offset)), d2 = p * (1 - p);
            double d1 = target[set->is_class[i]] - p;

            h11 += f * f * d2;
            h22 += d2;
            h21 += f * d2;
            g1 += f * d1;
            g2 += d1;
        }
        if (fabs(g1) < 1e-5 && fabs(g2) < 1e-5)
            break;
        det = h11 * h22 - h21 * h21;
        if (!(det > 0))
            break; /* singular by rounding: all decision values are equal */
        a = -(h22 * g1 - h21 * g2) / det;
        b = -(h11 * g2 - h21 * g1) / det;
        current = cross_entropy(set, target, slope, offset);
        for (int32_t k = 0;
             k < MAX_HALVINGS && !(cross_entropy(set, target, slope + size * a, offset + size * b) <
                                   current + 1e-4 * size * (g1 * a + g2 * b));
             k++)
            size /= 2;
        slope += size * a;
        offset += size * b;
    }
    model->platt_slope = (cairn_real)slope;
    model->platt_offset = (cairn_real)offset;
}

static cairn_status train_model(cairn_appearance_model *model, training_set *set,
                                const cairn_appearance_trainer *trainer, double cost,
                                const char *path, cairn_file_error *error)
{
    cairn_status status;

    model->histograms =
        malloc(((size_t)set->count * (size_t)set->words + 1) * sizeof *model->histograms);
    model->weights = malloc(((size_t)set->count + 1) * sizeof *model->weights);
    if (model->histograms == NULL || model->weights == NULL)
        return no_memory(path, error);
    model->gamma = (cairn_real)gamma_of(set);
    status = cross_validate(model, set, trainer, cost, path, error);
    if (status != CAIRN_OK)
        return status;
    if (cairn_interruption_is_requested())
        return CAIRN_MORE;
    fit_sigmoid(model, set);
    return train_machine(model, set, cost, -1, 1, path, error);
}

static cairn_status check(const cairn_appearance_trainer *trainer,
                          const cairn_appearance_train_params *params, const char *path,
                          cairn_file_error *error)
{
    cairn_status status =
        cairn_host_parameters_check(&cairn_appearance_train_parameters, params, path, error);

    if (status != CAIRN_OK)
        return status;
    if (count_boxes(trainer) == 0)
        return cairn_file_error_set(error, CAIRN_EMPTY, path, 0,
                                    "no box in any image, expected at least one");
    if (windows_of(trainer, params) > MAX_WINDOWS)
        return cairn_file_error_set(error, CAIRN_FULL, path, 0,
                                    "%" PRId64 " windows to try, expected at most %d",
                                    windows_of(trainer, params), MAX_WINDOWS);
    return CAIRN_OK;
}

cairn_status cairn_appearance_train(cairn_appearance_model *model,
                                    const cairn_appearance_trainer *trainer,
                                    const cairn_appearance_train_params *params, const char *path,
                                    cairn_file_error *error)
{
    cairn_status status = check(trainer, params, path, error);
    training_set set;

    memset(model, 0, sizeof *model);
    memset(&set, 0, sizeof set);
    if (status == CAIRN_OK)
        status = cluster_words(model, trainer, params, path, error);
    if (status == CAIRN_OK && !collect_samples(&set, model, trainer, params))
        status = no_memory(path, error);
    if (status == CAIRN_OK && cairn_interruption_is_requested())
        status = CAIRN_MORE;
    if (status == CAIRN_OK && count_class(&set) == set.count)
        status = cairn_file_error_set(
            error, CAIRN_EMPTY, path, 0,
            "no space for negative windows beside the boxes, expected larger images");
    if (status == CAIRN_OK && set.count > CAIRN_APPEARANCE_MAX_SUPPORT_VECTORS)
        status = cairn_file_error_set(error, CAIRN_FULL, path, 0, "%d windows, expected at most %d",
                                      (int)set.count, CAIRN_APPEARANCE_MAX_SUPPORT_VECTORS);
    if (status == CAIRN_OK)
        status = train_model(model, &set, trainer, params->cost, path, error);
    free_samples(&set);
    if (status != CAIRN_OK)
        cairn_appearance_file_free(model);
    return status;
}
