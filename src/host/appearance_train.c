/* What a class looks like, learnt from boxes about its objects.
 *
 * Method: k-means (Lloyd 1982, started as Arthur and Vassilvitskii 2007 do) of the patches in the
 * boxes, evenly chosen where there are many; its means are rounded to whole numbers. Windows of
 * what is not the class have the sizes of boxes, at places by chance. gamma is 1 over the mean chi2
 * of pairs of histograms. Sigmoid after Lin, Lin and Weng 2007, from machines that did not see the
 * images they judge (folds of images).
 *
 * Source: Adluru 2008, section 5.3.2, which says what the steps are. */
#include "src/core/build.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cairn/random.h"
#include "src/host/appearance_work.h"

enum {
    MAX_PATCHES = 8000,
    KMEANS_ROUNDS = 25,
    MAX_WINDOW_TRIES = 50,
    FOLD_COUNT = 5,
    MAX_NEWTON_STEPS = 100,
    MAX_HALVINGS = 30
};
/* Samples of whose pairs gamma is the mean: their number grows with the square. */
enum { MAX_PAIRED_SAMPLES = 1000 };
/* Beyond it the kernel tells nothing but the same apart. */
#define MAX_GAMMA 1e9
/* Windows share less with every box, over their union. */
#define MAX_NEGATIVE_OVERLAP 0.2
/* Of one seed, numbers for different ends. */
/* that are drawn; not all of them are kept */
enum { MAX_WINDOWS = 10 * CAIRN_APPEARANCE_SUPPORT_MOST };
enum { STREAM_WORDS = 11, STREAM_WINDOWS = 12 };

typedef struct trained_image {
    appearance_patches patches;
    double (*boxes)[4];
    int32_t box_count, width, height;
} trained_image;

struct cairn_appearance_trainer {
    trained_image *images; /* [IMAGES_MOST] */
    int32_t count;
};

/* The windows that are learnt from. */
typedef struct training_set {
    float *histograms; /* [count][words] */
    int32_t *is_class, *image;
    double *decision; /* f of a machine that did not see the image */
    int32_t count, capacity, words;
} training_set;

cairn_appearance_params cairn_appearance_default(void)
{
    cairn_appearance_params params = {
        .words = 100,
        .negatives = 10,
        .cost = 10,
        .seed = 1,
    };

    return params;
}

cairn_appearance_trainer *cairn_appearance_trainer_new(void)
{
    cairn_appearance_trainer *trainer = calloc(1, sizeof *trainer);

    if (trainer != NULL)
        trainer->images = calloc(CAIRN_APPEARANCE_IMAGES_MOST, sizeof *trainer->images);
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
        cairn_appearance_patches_free(&trainer->images[i].patches);
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
           box[2] > 0 && box[3] > 0 && box[2] - box[0] <= 2.0 * CAIRN_APPEARANCE_SIDE_MOST &&
           box[3] - box[1] <= 2.0 * CAIRN_APPEARANCE_SIDE_MOST;
}

cairn_status cairn_appearance_trainer_add(cairn_appearance_trainer *trainer, const uint8_t *grey,
                                          int32_t width, int32_t height, const double *boxes,
                                          int32_t count, const char *path, cairn_file_error *error)
{
    trained_image *image = &trainer->images[trainer->count];
    cairn_status status;

    if (trainer->count == CAIRN_APPEARANCE_IMAGES_MOST)
        return cairn_file_error_set(error, CAIRN_FULL, path, 0,
                                    "one image more, expected at most %d",
                                    CAIRN_APPEARANCE_IMAGES_MOST);
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
    status = cairn_appearance_describe(&image->patches, grey, width, height, path, error);
    if (status == CAIRN_OK) {
        image->boxes = malloc(((size_t)count + 1) * sizeof *image->boxes);
        if (image->boxes == NULL)
            status = no_memory(path, error);
    }
    if (status != CAIRN_OK) {
        cairn_appearance_patches_free(&image->patches);
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

/* Uniform in [0, 1), the same in both precisions. */
static double draw(cairn_random *random)
{
    return cairn_random_bits(random) / 4294967296.0;
}

static int is_in_a_box(const trained_image *image, int32_t patch)
{
    for (int32_t i = 0; i < image->box_count; i++)
        if (cairn_appearance_is_in_box(&image->patches.keypoints[patch], image->boxes[i]))
            return 1;
    return 0;
}

/* The patches in boxes; every so many of them. *count: how many were chosen. */
static const uint8_t **choose_patches(const cairn_appearance_trainer *trainer, int32_t *count)
{
    const uint8_t **chosen = malloc(MAX_PATCHES * sizeof *chosen);
    int64_t all = 0, seen = 0;

    *count = 0;
    for (int pass = 0; pass < 2 && chosen != NULL; pass++)
        for (int32_t i = 0; i < trainer->count; i++)
            for (int32_t k = 0; k < trainer->images[i].patches.count; k++) {
                int64_t most;

                if (!is_in_a_box(&trainer->images[i], k))
                    continue;
                if (pass == 0) {
                    all++;
                    continue;
                }
                most = all < MAX_PATCHES ? all : MAX_PATCHES;
                if (all > 0 && (seen + 1) * most / all > seen * most / all)
                    chosen[(*count)++] =
                        &trainer->images[i]
                             .patches.descriptors[(size_t)k * APPEARANCE_DESCRIPTOR_SIZE];
                seen++;
            }
    return chosen;
}

/* First words: each by chance, the likelier the farther a patch is from those before. */
static void seed_words(uint8_t *words, int32_t count, const uint8_t *const *patches,
                       int32_t patch_count, int32_t *distance, cairn_random *random)
{
    for (int32_t w = 0; w < count; w++) {
        double sum = 0, at;
        int32_t next = 0;

        for (int32_t i = 0; i < patch_count; i++) {
            int32_t d = 1;

            if (w > 0)
                (void)cairn_appearance_nearest_word(
                    &words[(size_t)(w - 1) * APPEARANCE_DESCRIPTOR_SIZE], 1, patches[i], &d);
            distance[i] = w > 1 && distance[i] < d ? distance[i] : d;
            sum += distance[i];
        }
        at = draw(random) * sum;
        for (next = 0; next + 1 < patch_count && at >= distance[next]; next++)
            at -= distance[next];
        memcpy(&words[(size_t)w * APPEARANCE_DESCRIPTOR_SIZE], patches[next],
               APPEARANCE_DESCRIPTOR_SIZE);
    }
}

/* Words to the means of the patches nearest to them; one that is nearest to none stays. 0:
 * nothing moved. */
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
                                  const cairn_appearance_params *params, const char *path,
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
            for (int32_t i = 0; i < patch_count; i++) {
                int32_t w = cairn_appearance_nearest_word(model->words, model->word_count,
                                                          patches[i], NULL);

                members[w]++;
                for (int32_t k = 0; k < APPEARANCE_DESCRIPTOR_SIZE; k++)
                    sum[(size_t)w * APPEARANCE_DESCRIPTOR_SIZE + (size_t)k] += patches[i][k];
            }
            if (!update_words(model->words, model->word_count, sum, members))
                break;
        }
    }
    free(patches);
    free(sum);
    free(members);
    free(distance);
    return status;
}

/* ---- Windows ---- */

static double overlap(const double a[4], const double b[4])
{
    double w = fmin(a[2], b[2]) - fmax(a[0], b[0]), h = fmin(a[3], b[3]) - fmax(a[1], b[1]);
    double both = w > 0 && h > 0 ? w * h : 0;

    return both / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - both);
}

static void add_sample(training_set *set, const trained_image *image, const int32_t *word_of,
                       const double box[4], int32_t is_class, int32_t index)
{
    float *histogram = &set->histograms[(size_t)set->count * (size_t)set->words];

    memset(histogram, 0, (size_t)set->words * sizeof *histogram);
    for (int32_t i = 0; i < image->patches.count; i++)
        if (cairn_appearance_is_in_box(&image->patches.keypoints[i], box))
            histogram[word_of[i]]++;
    cairn_appearance_normalize(histogram, set->words);
    set->is_class[set->count] = is_class;
    set->image[set->count++] = index;
}

/* A window of the size of some box, made smaller where it must be to fit, that lies apart from
 * this image's boxes. 0: none was found. */
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
            is_apart = overlap(window, image->boxes[i]) < MAX_NEGATIVE_OVERLAP;
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

/* Boxes, and windows that are drawn beside them. */
static int64_t windows_of(const cairn_appearance_trainer *trainer,
                          const cairn_appearance_params *params)
{
    return (params->negatives + 1) * (count_boxes(trainer) + trainer->count);
}

static int new_samples(training_set *set, const cairn_appearance_trainer *trainer,
                       const cairn_appearance_params *params)
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

/* 0: there is no memory. */
static int collect_samples(training_set *set, const cairn_appearance_model *model,
                           const cairn_appearance_trainer *trainer,
                           const cairn_appearance_params *params)
{
    cairn_random random = cairn_random_seed(params->seed, STREAM_WINDOWS);
    int32_t boxes = (int32_t)count_boxes(trainer);

    if (!new_samples(set, trainer, params))
        return 0;
    for (int32_t i = 0; i < trainer->count; i++) {
        const trained_image *image = &trainer->images[i];
        int32_t wanted = params->negatives * (image->box_count > 0 ? image->box_count : 1);
        int32_t *word_of = malloc(((size_t)image->patches.count + 1) * sizeof *word_of);
        double window[4];

        if (word_of == NULL)
            return 0;
        for (int32_t k = 0; k < image->patches.count; k++)
            word_of[k] = cairn_appearance_nearest_word(
                model->words, model->word_count,
                &image->patches.descriptors[(size_t)k * APPEARANCE_DESCRIPTOR_SIZE], NULL);
        for (int32_t k = 0; k < image->box_count; k++)
            add_sample(set, image, word_of, image->boxes[k], 1, i);
        for (int32_t k = 0; k < wanted && draw_window(trainer, image, boxes, &random, window); k++)
            add_sample(set, image, word_of, window, 0, i);
        free(word_of);
    }
    return 1;
}

/* ---- The machine ---- */

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

/* 1 over the mean of chi2 of the pairs of at most PAIRED_MOST samples, evenly chosen; of all
 * pairs that are the same no more can be learnt, whatever it is. */
static double gamma_of(const training_set *set)
{
    int32_t count = set->count < MAX_PAIRED_SAMPLES ? set->count : MAX_PAIRED_SAMPLES;
    double sum = 0;

    for (int32_t i = 0; i < count; i++)
        for (int32_t k = 0; k < i; k++)
            sum += cairn_appearance_chi2(sample_evenly(set, i, count), sample_evenly(set, k, count),
                                         set->words);
    return sum > 0 ? fmin(MAX_GAMMA, count * (count - 1.0) / 2 / sum) : 1;
}

/* Learns from the samples whose images are not of the fold (-1: from all). CAIRN_EMPTY: of one
 * kind there are none. */
static cairn_status train_machine(cairn_appearance_model *model, const training_set *set,
                                  double cost, int32_t fold, int32_t folds, const char *path,
                                  cairn_file_error *error)
{
    const cairn_appearance_shim *shim = cairn_appearance_need_shim(path, error);
    char message[CAIRN_APPEARANCE_SHIM_MESSAGE_BYTES] = "";
    cairn_appearance_shim_machine machine = {model->histograms, model->weights, 0, 0};
    size_t row = (size_t)set->words;
    float *table = malloc(((size_t)set->count * row + 1) * sizeof *table);
    int32_t *is_class = malloc(((size_t)set->count + 1) * sizeof *is_class), count = 0,
            of_class = 0;
    cairn_status status = shim == NULL ? CAIRN_UNSUPPORTED : CAIRN_OK;

    if (table == NULL || is_class == NULL) {
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
        status = shim->train(table, is_class, count, set->words, cost, model->gamma, &machine,
                             message, sizeof message);
        if (status != CAIRN_OK)
            (void)cairn_file_error_set(error, status, path, 0,
                                       "OpenCV: %s, expected histograms of both kinds", message);
    }
    model->support_count = machine.count;
    model->rho = machine.rho;
    free(table);
    free(is_class);
    return status;
}

/* f of every sample by a machine that did not see its image; where that cannot be, by the one
 * that saw all. */
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
        for (int32_t i = 0; i < set->count && status == CAIRN_OK; i++)
            if (set->image[i] % folds == fold)
                set->decision[i] = cairn_appearance_decision(
                    model, &set->histograms[(size_t)i * (size_t)set->words]);
    }
    return status;
}

/* What the sigmoid costs: the cross-entropy with targets a little within 0 and 1. */
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

static void fit_sigmoid(cairn_appearance_model *model, const training_set *set)
{
    double of_class = count_class(set), others = set->count - of_class;
    double target[2] = {1 / (others + 2), (of_class + 1) / (of_class + 2)};

    model->slope = 0;
    model->offset = log((others + 1) / (of_class + 1));
    for (int32_t step = 0; step < MAX_NEWTON_STEPS; step++) {
        double h11 = 1e-12, h22 = 1e-12, h21 = 0, g1 = 0, g2 = 0, det, a, b, now, size = 1;

        for (int32_t i = 0; i < set->count; i++) {
            double f = set->decision[i], p = 1 / (1 + exp(model->slope * f + model->offset)),
                   d2 = p * (1 - p);
            double d1 = target[set->is_class[i]] - p;

            h11 += f * f * d2;
            h22 += d2;
            h21 += f * d2;
            g1 += f * d1;
            g2 += d1;
        }
        if (fabs(g1) < 1e-5 && fabs(g2) < 1e-5)
            return;
        det = h11 * h22 - h21 * h21;
        if (!(det > 0))
            return; /* by rounding: all say the same */
        a = -(h22 * g1 - h21 * g2) / det;
        b = -(h11 * g2 - h21 * g1) / det;
        now = cross_entropy(set, target, model->slope, model->offset);
        for (int32_t k = 0;
             k < MAX_HALVINGS &&
             !(cross_entropy(set, target, model->slope + size * a, model->offset + size * b) <
               now + 1e-4 * size * (g1 * a + g2 * b));
             k++)
            size /= 2;
        model->slope += size * a;
        model->offset += size * b;
    }
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
    model->gamma = gamma_of(set);
    status = cross_validate(model, set, trainer, cost, path, error);
    if (status != CAIRN_OK)
        return status;
    fit_sigmoid(model, set);
    return train_machine(model, set, cost, -1, 1, path, error);
}

static cairn_status check(const cairn_appearance_trainer *trainer,
                          const cairn_appearance_params *params, const char *path,
                          cairn_file_error *error)
{
    if (params->words < 2 || params->words > CAIRN_APPEARANCE_WORDS_MOST || params->negatives < 1 ||
        params->negatives > 100 || !(params->cost > 0) || params->cost > 1e6)
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "%d words, %d windows a box, cost %g, expected 2 to %d, 1 to 100, above 0 to 1000000",
            (int)params->words, (int)params->negatives, params->cost, CAIRN_APPEARANCE_WORDS_MOST);
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
                                    const cairn_appearance_params *params, const char *path,
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
    if (status == CAIRN_OK && count_class(&set) == set.count)
        status = cairn_file_error_set(
            error, CAIRN_EMPTY, path, 0,
            "boxes leave no room for windows beside them, expected images that show more");
    if (status == CAIRN_OK && set.count > CAIRN_APPEARANCE_SUPPORT_MOST)
        status = cairn_file_error_set(error, CAIRN_FULL, path, 0, "%d windows, expected at most %d",
                                      (int)set.count, CAIRN_APPEARANCE_SUPPORT_MOST);
    if (status == CAIRN_OK)
        status = train_model(model, &set, trainer, params->cost, path, error);
    free_samples(&set);
    if (status != CAIRN_OK)
        cairn_appearance_free(model);
    return status;
}
