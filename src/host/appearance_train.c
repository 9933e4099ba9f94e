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

enum { PATCHES_MOST = 8000, ROUNDS = 25, TRIES = 50, FOLDS = 5, NEWTON = 100, HALVINGS = 30 };
/* Samples of whose pairs gamma is the mean: their number grows with the square. */
enum { PAIRED_MOST = 1000 };
/* Beyond it the kernel tells nothing but the same apart. */
#define GAMMA_MOST 1e9
/* Windows share less with every box, over their union. */
#define APART 0.2
/* Of one seed, numbers for different ends. */
/* that are drawn; not all of them are kept */
enum { WINDOWS_MOST = 10 * CAIRN_APPEARANCE_SUPPORT_MOST };
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
typedef struct samples {
    float *histograms; /* [count][words] */
    int32_t *is_class, *image;
    double *decided; /* f of a machine that did not see the image */
    int32_t count, room, words;
} samples;

cairn_appearance_params cairn_appearance_default(void)
{
    cairn_appearance_params params = {100, 10, 10, 1};

    return params;
}

cairn_appearance_trainer *cairn_appearance_trainer_new(void)
{
    cairn_appearance_trainer *t = calloc(1, sizeof *t);

    if (t != NULL)
        t->images = calloc(CAIRN_APPEARANCE_IMAGES_MOST, sizeof *t->images);
    if (t != NULL && t->images == NULL) {
        free(t);
        return NULL;
    }
    return t;
}

void cairn_appearance_trainer_free(cairn_appearance_trainer *t)
{
    if (t == NULL)
        return;
    for (int32_t i = 0; i < t->count; i++) {
        cairn_appearance_patches_free(&t->images[i].patches);
        free(t->images[i].boxes);
    }
    free(t->images);
    free(t);
}

static cairn_status no_memory(const char *path, cairn_file_error *error)
{
    return cairn_file_error_system(error, path, "learn from", ENOMEM);
}

static int is_box(const double b[4], int32_t width, int32_t height)
{
    return b[2] - b[0] >= 1 && b[3] - b[1] >= 1 && b[0] < width && b[1] < height && b[2] > 0 &&
           b[3] > 0 && b[2] - b[0] <= 2.0 * CAIRN_APPEARANCE_SIDE_MOST &&
           b[3] - b[1] <= 2.0 * CAIRN_APPEARANCE_SIDE_MOST;
}

cairn_status cairn_appearance_trainer_add(cairn_appearance_trainer *t, const uint8_t *grey,
                                          int32_t width, int32_t height, const double *boxes,
                                          int32_t count, const char *path, cairn_file_error *error)
{
    trained_image *image = &t->images[t->count];
    cairn_status status;

    if (t->count == CAIRN_APPEARANCE_IMAGES_MOST)
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
    t->count++;
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
        if (cairn_appearance_is_in(&image->patches.places[patch], image->boxes[i]))
            return 1;
    return 0;
}

/* The patches in boxes; every so many of them. *count: how many were chosen. */
static const uint8_t **choose_patches(const cairn_appearance_trainer *t, int32_t *count)
{
    const uint8_t **chosen = malloc(PATCHES_MOST * sizeof *chosen);
    int64_t all = 0, seen = 0;

    *count = 0;
    for (int pass = 0; pass < 2 && chosen != NULL; pass++)
        for (int32_t i = 0; i < t->count; i++)
            for (int32_t k = 0; k < t->images[i].patches.count; k++) {
                int64_t most;

                if (!is_in_a_box(&t->images[i], k))
                    continue;
                if (pass == 0) {
                    all++;
                    continue;
                }
                most = all < PATCHES_MOST ? all : PATCHES_MOST;
                if (all > 0 && (seen + 1) * most / all > seen * most / all)
                    chosen[(*count)++] =
                        &t->images[i].patches.descriptors[(size_t)k * APPEARANCE_NUMBERS];
                seen++;
            }
    return chosen;
}

/* First words: each by chance, the likelier the farther a patch is from those before. */
static void start_words(uint8_t *words, int32_t count, const uint8_t *const *patches,
                        int32_t patch_count, int32_t *distance, cairn_random *random)
{
    for (int32_t w = 0; w < count; w++) {
        double sum = 0, at;
        int32_t next = 0;

        for (int32_t i = 0; i < patch_count; i++) {
            int32_t d = 1;

            if (w > 0)
                (void)cairn_appearance_word(&words[(size_t)(w - 1) * APPEARANCE_NUMBERS], 1,
                                            patches[i], &d);
            distance[i] = w > 1 && distance[i] < d ? distance[i] : d;
            sum += distance[i];
        }
        at = draw(random) * sum;
        for (next = 0; next + 1 < patch_count && at >= distance[next]; next++)
            at -= distance[next];
        memcpy(&words[(size_t)w * APPEARANCE_NUMBERS], patches[next], APPEARANCE_NUMBERS);
    }
}

/* Words to the means of the patches nearest to them; one that is nearest to none stays. 0:
 * nothing moved. */
static int move_words(uint8_t *words, int32_t count, const int32_t *sum, const int32_t *members)
{
    int moved = 0;

    for (int32_t w = 0; w < count; w++)
        for (int32_t k = 0; k < APPEARANCE_NUMBERS && members[w] > 0; k++) {
            uint8_t *value = &words[(size_t)w * APPEARANCE_NUMBERS + (size_t)k];
            uint8_t mean =
                (uint8_t)((2 * sum[(size_t)w * APPEARANCE_NUMBERS + (size_t)k] + members[w]) /
                          (2 * members[w]));

            moved |= mean != *value;
            *value = mean;
        }
    return moved;
}

static cairn_status make_words(cairn_appearance_model *m, const cairn_appearance_trainer *t,
                               const cairn_appearance_params *params, const char *path,
                               cairn_file_error *error)
{
    cairn_random random = cairn_random_seed(params->seed, STREAM_WORDS);
    size_t numbers = (size_t)params->words * APPEARANCE_NUMBERS;
    int32_t patch_count = 0, *sum = malloc(numbers * sizeof *sum);
    int32_t *members = malloc((size_t)params->words * sizeof *members);
    int32_t *distance = malloc(PATCHES_MOST * sizeof *distance);
    const uint8_t **patches = choose_patches(t, &patch_count);
    cairn_status status = CAIRN_OK;

    m->word_count = params->words;
    m->words = malloc(numbers);
    if (patches == NULL || sum == NULL || members == NULL || distance == NULL || m->words == NULL) {
        status = no_memory(path, error);
    } else if (patch_count < params->words) {
        status = cairn_file_error_set(error, CAIRN_EMPTY, path, 0,
                                      "%d patches in boxes, expected at least %d", (int)patch_count,
                                      (int)params->words);
    } else {
        start_words(m->words, m->word_count, patches, patch_count, distance, &random);
        for (int32_t round = 0; round < ROUNDS; round++) {
            memset(sum, 0, numbers * sizeof *sum);
            memset(members, 0, (size_t)params->words * sizeof *members);
            for (int32_t i = 0; i < patch_count; i++) {
                int32_t w = cairn_appearance_word(m->words, m->word_count, patches[i], NULL);

                members[w]++;
                for (int32_t k = 0; k < APPEARANCE_NUMBERS; k++)
                    sum[(size_t)w * APPEARANCE_NUMBERS + (size_t)k] += patches[i][k];
            }
            if (!move_words(m->words, m->word_count, sum, members))
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

static void add_sample(samples *s, const trained_image *image, const int32_t *word_of,
                       const double box[4], int32_t is_class, int32_t index)
{
    float *histogram = &s->histograms[(size_t)s->count * (size_t)s->words];

    memset(histogram, 0, (size_t)s->words * sizeof *histogram);
    for (int32_t i = 0; i < image->patches.count; i++)
        if (cairn_appearance_is_in(&image->patches.places[i], box))
            histogram[word_of[i]]++;
    cairn_appearance_share(histogram, s->words);
    s->is_class[s->count] = is_class;
    s->image[s->count++] = index;
}

/* A window of the size of some box, made smaller where it must be to fit, that lies apart from
 * this image's boxes. 0: none was found. */
static int draw_window(const cairn_appearance_trainer *t, const trained_image *image, int32_t boxes,
                       cairn_random *random, double window[4])
{
    for (int32_t try = 0; try < TRIES; try++) {
        int32_t which = cairn_random_below(random, boxes), from = 0, is_apart = 1;
        const double *like;
        double w, h, scale;

        while (which >= t->images[from].box_count)
            which -= t->images[from++].box_count;
        like = t->images[from].boxes[which];
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
            is_apart = overlap(window, image->boxes[i]) < APART;
        if (is_apart)
            return 1;
    }
    return 0;
}

static int64_t count_boxes(const cairn_appearance_trainer *t)
{
    int64_t boxes = 0;

    for (int32_t i = 0; i < t->count; i++)
        boxes += t->images[i].box_count;
    return boxes;
}

/* Boxes, and windows that are drawn beside them. */
static int64_t windows_of(const cairn_appearance_trainer *t, const cairn_appearance_params *params)
{
    return (params->negatives + 1) * (count_boxes(t) + t->count);
}

static int new_samples(samples *s, const cairn_appearance_trainer *t,
                       const cairn_appearance_params *params)
{
    s->room = (int32_t)windows_of(t, params);
    s->words = params->words;
    s->histograms = malloc((size_t)s->room * (size_t)s->words * sizeof *s->histograms);
    s->is_class = malloc((size_t)s->room * sizeof *s->is_class);
    s->image = malloc((size_t)s->room * sizeof *s->image);
    s->decided = calloc((size_t)s->room, sizeof *s->decided);
    return s->histograms != NULL && s->is_class != NULL && s->image != NULL && s->decided != NULL;
}

static void free_samples(samples *s)
{
    free(s->histograms);
    free(s->is_class);
    free(s->image);
    free(s->decided);
}

/* 0: there is no memory. */
static int take_samples(samples *s, const cairn_appearance_model *m,
                        const cairn_appearance_trainer *t, const cairn_appearance_params *params)
{
    cairn_random random = cairn_random_seed(params->seed, STREAM_WINDOWS);
    int32_t boxes = (int32_t)count_boxes(t);

    if (!new_samples(s, t, params))
        return 0;
    for (int32_t i = 0; i < t->count; i++) {
        const trained_image *image = &t->images[i];
        int32_t wanted = params->negatives * (image->box_count > 0 ? image->box_count : 1);
        int32_t *word_of = malloc(((size_t)image->patches.count + 1) * sizeof *word_of);
        double window[4];

        if (word_of == NULL)
            return 0;
        for (int32_t k = 0; k < image->patches.count; k++)
            word_of[k] = cairn_appearance_word(
                m->words, m->word_count,
                &image->patches.descriptors[(size_t)k * APPEARANCE_NUMBERS], NULL);
        for (int32_t k = 0; k < image->box_count; k++)
            add_sample(s, image, word_of, image->boxes[k], 1, i);
        for (int32_t k = 0; k < wanted && draw_window(t, image, boxes, &random, window); k++)
            add_sample(s, image, word_of, window, 0, i);
        free(word_of);
    }
    return 1;
}

/* ---- The machine ---- */

static int32_t count_class(const samples *s)
{
    int32_t count = 0;

    for (int32_t i = 0; i < s->count; i++)
        count += s->is_class[i];
    return count;
}

static const float *evenly(const samples *s, int32_t index, int32_t count)
{
    return &s->histograms[(size_t)((int64_t)index * s->count / count) * (size_t)s->words];
}

/* 1 over the mean of chi2 of the pairs of at most PAIRED_MOST samples, evenly chosen; of all
 * pairs that are the same no more can be learnt, whatever it is. */
static double gamma_of(const samples *s)
{
    int32_t count = s->count < PAIRED_MOST ? s->count : PAIRED_MOST;
    double sum = 0;

    for (int32_t i = 0; i < count; i++)
        for (int32_t k = 0; k < i; k++)
            sum += cairn_appearance_chi2(evenly(s, i, count), evenly(s, k, count), s->words);
    return sum > 0 ? fmin(GAMMA_MOST, count * (count - 1.0) / 2 / sum) : 1;
}

/* Learns from the samples whose images are not of the fold (-1: from all). CAIRN_EMPTY: of one
 * kind there are none. */
static cairn_status learn(cairn_appearance_model *m, const samples *s, double cost, int32_t fold,
                          int32_t folds, const char *path, cairn_file_error *error)
{
    const cairn_appearance_shim *shim = cairn_appearance_need_shim(path, error);
    char words[CAIRN_APPEARANCE_SHIM_WORDS] = "";
    cairn_appearance_shim_machine machine = {m->histograms, m->weights, 0, 0};
    size_t row = (size_t)s->words;
    float *table = malloc(((size_t)s->count * row + 1) * sizeof *table);
    int32_t *is_class = malloc(((size_t)s->count + 1) * sizeof *is_class), count = 0, of_class = 0;
    cairn_status status = shim == NULL ? CAIRN_UNSUPPORTED : CAIRN_OK;

    if (table == NULL || is_class == NULL) {
        free(table);
        free(is_class);
        return no_memory(path, error);
    }
    for (int32_t i = 0; i < s->count && status == CAIRN_OK; i++)
        if (fold < 0 || s->image[i] % folds != fold) {
            memcpy(&table[(size_t)count * row], &s->histograms[(size_t)i * row],
                   row * sizeof *table);
            of_class += s->is_class[i];
            is_class[count++] = s->is_class[i];
        }
    if (status == CAIRN_OK && (of_class == 0 || of_class == count))
        status = CAIRN_EMPTY;
    if (status == CAIRN_OK) {
        status = shim->train(table, is_class, count, s->words, cost, m->gamma, &machine, words,
                             sizeof words);
        if (status != CAIRN_OK)
            (void)cairn_file_error_set(error, status, path, 0,
                                       "OpenCV: %s, expected histograms of both kinds", words);
    }
    m->support_count = machine.count;
    m->rho = machine.rho;
    free(table);
    free(is_class);
    return status;
}

/* f of every sample by a machine that did not see its image; where that cannot be, by the one
 * that saw all. */
static cairn_status decide(cairn_appearance_model *m, samples *s, const cairn_appearance_trainer *t,
                           double cost, const char *path, cairn_file_error *error)
{
    int32_t folds = t->count < FOLDS ? t->count : FOLDS;
    cairn_status status = CAIRN_OK;

    for (int32_t fold = 0; fold < folds && (status == CAIRN_OK || status == CAIRN_EMPTY); fold++) {
        status = learn(m, s, cost, fold, folds, path, error);
        if (status == CAIRN_EMPTY)
            status = learn(m, s, cost, -1, folds, path, error);
        for (int32_t i = 0; i < s->count && status == CAIRN_OK; i++)
            if (s->image[i] % folds == fold)
                s->decided[i] =
                    cairn_appearance_decide(m, &s->histograms[(size_t)i * (size_t)s->words]);
    }
    return status;
}

/* What the sigmoid costs: the cross-entropy with targets a little within 0 and 1. */
static double entropy(const samples *s, const double target[2], double slope, double offset)
{
    double sum = 0;

    for (int32_t i = 0; i < s->count; i++) {
        double t = target[s->is_class[i]], z = slope * s->decided[i] + offset;

        sum += z >= 0 ? t * z + log(1 + exp(-z)) : (t - 1) * z + log(1 + exp(z));
    }
    return sum;
}

static void fit_sigmoid(cairn_appearance_model *m, const samples *s)
{
    double of_class = count_class(s), others = s->count - of_class;
    double target[2] = {1 / (others + 2), (of_class + 1) / (of_class + 2)};

    m->slope = 0;
    m->offset = log((others + 1) / (of_class + 1));
    for (int32_t step = 0; step < NEWTON; step++) {
        double h11 = 1e-12, h22 = 1e-12, h21 = 0, g1 = 0, g2 = 0, det, a, b, now, size = 1;

        for (int32_t i = 0; i < s->count; i++) {
            double f = s->decided[i], p = 1 / (1 + exp(m->slope * f + m->offset)), d2 = p * (1 - p);
            double d1 = target[s->is_class[i]] - p;

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
        now = entropy(s, target, m->slope, m->offset);
        for (int32_t k = 0;
             k < HALVINGS && !(entropy(s, target, m->slope + size * a, m->offset + size * b) <
                               now + 1e-4 * size * (g1 * a + g2 * b));
             k++)
            size /= 2;
        m->slope += size * a;
        m->offset += size * b;
    }
}

static cairn_status make_machine(cairn_appearance_model *m, samples *s,
                                 const cairn_appearance_trainer *t, double cost, const char *path,
                                 cairn_file_error *error)
{
    cairn_status status;

    m->histograms = malloc(((size_t)s->count * (size_t)s->words + 1) * sizeof *m->histograms);
    m->weights = malloc(((size_t)s->count + 1) * sizeof *m->weights);
    if (m->histograms == NULL || m->weights == NULL)
        return no_memory(path, error);
    m->gamma = gamma_of(s);
    status = decide(m, s, t, cost, path, error);
    if (status != CAIRN_OK)
        return status;
    fit_sigmoid(m, s);
    return learn(m, s, cost, -1, 1, path, error);
}

static cairn_status check(const cairn_appearance_trainer *t, const cairn_appearance_params *p,
                          const char *path, cairn_file_error *error)
{
    if (p->words < 2 || p->words > CAIRN_APPEARANCE_WORDS_MOST || p->negatives < 1 ||
        p->negatives > 100 || !(p->cost > 0) || p->cost > 1e6)
        return cairn_file_error_set(
            error, CAIRN_BAD_ARGUMENT, path, 0,
            "%d words, %d windows a box, cost %g, expected 2 to %d, 1 to 100, above 0 to 1000000",
            (int)p->words, (int)p->negatives, p->cost, CAIRN_APPEARANCE_WORDS_MOST);
    if (count_boxes(t) == 0)
        return cairn_file_error_set(error, CAIRN_EMPTY, path, 0,
                                    "no box in any image, expected at least one");
    if (windows_of(t, p) > WINDOWS_MOST)
        return cairn_file_error_set(error, CAIRN_FULL, path, 0,
                                    "%" PRId64 " windows to try, expected at most %d",
                                    windows_of(t, p), WINDOWS_MOST);
    return CAIRN_OK;
}

cairn_status cairn_appearance_train(cairn_appearance_model *model,
                                    const cairn_appearance_trainer *t,
                                    const cairn_appearance_params *params, const char *path,
                                    cairn_file_error *error)
{
    cairn_status status = check(t, params, path, error);
    samples s;

    memset(model, 0, sizeof *model);
    memset(&s, 0, sizeof s);
    if (status == CAIRN_OK)
        status = make_words(model, t, params, path, error);
    if (status == CAIRN_OK && !take_samples(&s, model, t, params))
        status = no_memory(path, error);
    if (status == CAIRN_OK && count_class(&s) == s.count)
        status = cairn_file_error_set(
            error, CAIRN_EMPTY, path, 0,
            "boxes leave no room for windows beside them, expected images that show more");
    if (status == CAIRN_OK && s.count > CAIRN_APPEARANCE_SUPPORT_MOST)
        status = cairn_file_error_set(error, CAIRN_FULL, path, 0, "%d windows, expected at most %d",
                                      (int)s.count, CAIRN_APPEARANCE_SUPPORT_MOST);
    if (status == CAIRN_OK)
        status = make_machine(model, &s, t, params->cost, path, error);
    free_samples(&s);
    if (status != CAIRN_OK)
        cairn_appearance_free(model);
    return status;
}
