/* What is in a box, by the words of its patches.
 *
 * Method: patches of about 24 px every 6 px, and of about 48 px every 12 px, upright (objects are). Each is taken for the nearest word; the
 * shares of all words in the box are its histogram. Words are whole numbers, so that nearest is the same everywhere. The machine's
 * kernel is exp(-gamma chi2); its value becomes a probability after Platt 2000.
 *
 * Source: Adluru 2008, section 5.3.2, where patches and kernel are left open. */
#include "src/core/build.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "src/host/appearance_work.h"
#include "src/host/shim.h"

#define LIBRARY "libcairn-appearance.so"

/* px between patches of the image, and their size for SIFT, whose patch is six times as wide; twice that in the image of half the size. */
enum { STEP = 6, SIZE = 4, OCTAVES = 2, EARLY = 32 };

/* Of a box without a patch. */
static const double NOTHING_KNOWN = 0.5;
/* Of two histograms of shares. */
static const double CHI2_MOST = 2;

struct cairn_appearance_field {
    const cairn_appearance_model *model;
    cairn_appearance_shim_place *places;
    int32_t *words; /* [count] */
    int32_t count;
};

/* ---- Patches ---- */

const cairn_appearance_shim *cairn_appearance_need_shim(const char *path, cairn_file_error *error)
{
    const cairn_appearance_shim *shim =
        cairn_shim_find(LIBRARY, "CAIRN_APPEARANCE", "cairn_appearance_shim_table", CAIRN_APPEARANCE_SHIM_VERSION);

    if (shim == NULL)
        (void)cairn_file_error_set(error, CAIRN_UNSUPPORTED, path, 0,
                                   "appearance needs " LIBRARY " of this version, expected it beside the program "
                                   "(built by `make appearance`, OpenCV 4: tools/deps.sh appearance)");
    return shim;
}

cairn_status cairn_appearance_load(cairn_file_error *error)
{
    return cairn_appearance_need_shim(LIBRARY, error) != NULL ? CAIRN_OK : CAIRN_UNSUPPORTED;
}

static void lay_places(appearance_patches *p, int32_t width, int32_t height)
{
    for (int32_t octave = 0; octave < OCTAVES; octave++) {
        int32_t step = STEP << octave;

        for (int32_t y = step / 2; y < height; y += step)
            for (int32_t x = step / 2; x < width; x += step) {
                cairn_appearance_shim_place *place = &p->places[p->count++];

                place->x = (float)x;
                place->y = (float)y;
                place->size = (float)(SIZE << octave);
                place->octave = octave;
            }
    }
}

static size_t most_places(int32_t width, int32_t height)
{
    return 2 * ((size_t)width / STEP + 1) * ((size_t)height / STEP + 1);
}

cairn_status cairn_appearance_describe(appearance_patches *p, const uint8_t *grey, int32_t width, int32_t height,
                                       const char *path, cairn_file_error *error)
{
    char words[CAIRN_APPEARANCE_SHIM_WORDS] = "";
    const cairn_appearance_shim *shim;
    cairn_status status;

    memset(p, 0, sizeof *p);
    if (grey == NULL || width < 1 || height < 1 || width > CAIRN_APPEARANCE_SIDE_MOST ||
        height > CAIRN_APPEARANCE_SIDE_MOST)
        return cairn_file_error_set(error, CAIRN_BAD_ARGUMENT, path, 0,
                                    "an image of %d x %d, expected 8-bit grey of at most %d a side", (int)width,
                                    (int)height, CAIRN_APPEARANCE_SIDE_MOST);
    shim = cairn_appearance_need_shim(path, error);
    if (shim == NULL)
        return CAIRN_UNSUPPORTED;
    p->places = malloc(most_places(width, height) * sizeof *p->places);
    p->descriptors = malloc(most_places(width, height) * APPEARANCE_NUMBERS);
    if (p->places == NULL || p->descriptors == NULL)
        return cairn_file_error_system(error, path, "describe", ENOMEM);
    lay_places(p, width, height);
    if (p->count == 0)
        return CAIRN_OK;
    status = shim->describe(grey, width, height, p->places, p->count, p->descriptors, words, sizeof words);
    if (status != CAIRN_OK)
        return cairn_file_error_set(error, status, path, 0, "OpenCV: %s, expected patches of an image", words);
    return CAIRN_OK;
}

void cairn_appearance_patches_free(appearance_patches *p)
{
    free(p->places);
    free(p->descriptors);
    memset(p, 0, sizeof *p);
}

int cairn_appearance_is_in(const cairn_appearance_shim_place *place, const double box[4])
{
    return (double)place->x >= box[0] && (double)place->y >= box[1] && (double)place->x <= box[2] &&
           (double)place->y <= box[3];
}

/* ---- Words ---- */

int32_t cairn_appearance_word(const uint8_t *words, int32_t count, const uint8_t *descriptor, int32_t *distance)
{
    int32_t best = 0, least = INT32_MAX;

    for (int32_t i = 0; i < count; i++) {
        const uint8_t *word = &words[(size_t)i * APPEARANCE_NUMBERS];
        int32_t sum = 0;

        /* One that is too far early on is not looked at to its end. */
        for (int32_t from = 0; from < APPEARANCE_NUMBERS && sum < least; from += EARLY)
            for (int32_t k = from; k < from + EARLY; k++)
                sum += (word[k] - descriptor[k]) * (word[k] - descriptor[k]);
        if (sum < least) {
            least = sum;
            best = i;
        }
    }
    if (distance != NULL)
        *distance = least;
    return best;
}

void cairn_appearance_share(float *histogram, int32_t count)
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

/* ---- Asking ---- */

double cairn_appearance_decide(const cairn_appearance_model *m, const float *histogram)
{
    double sum = -m->rho;

    for (int32_t i = 0; i < m->support_count; i++)
        sum += m->weights[i] * exp(-m->gamma * cairn_appearance_chi2(&m->histograms[(size_t)i * (size_t)m->word_count],
                                                                     histogram, m->word_count));
    return sum;
}

double cairn_appearance_judge(const cairn_appearance_model *m, const float *histogram)
{
    return 1 / (1 + exp(fmin(700, m->slope * cairn_appearance_decide(m, histogram) + m->offset)));
}

cairn_status cairn_appearance_field_make(cairn_appearance_field **field, const cairn_appearance_model *model,
                                         const uint8_t *grey, int32_t width, int32_t height, const char *path,
                                         cairn_file_error *error)
{
    appearance_patches patches;
    cairn_appearance_field *f = NULL;
    cairn_status status = cairn_appearance_describe(&patches, grey, width, height, path, error);

    *field = NULL;
    if (status == CAIRN_OK) {
        f = calloc(1, sizeof *f);
        if (f != NULL)
            f->words = malloc(((size_t)patches.count + 1) * sizeof *f->words);
        if (f == NULL || f->words == NULL) {
            free(f);
            f = NULL;
            status = cairn_file_error_system(error, path, "describe", ENOMEM);
        }
    }
    if (f != NULL) {
        f->model = model;
        f->count = patches.count;
        for (int32_t i = 0; i < patches.count; i++)
            f->words[i] = cairn_appearance_word(model->words, model->word_count,
                                                &patches.descriptors[(size_t)i * APPEARANCE_NUMBERS], NULL);
        f->places = patches.places;
        patches.places = NULL;
        *field = f;
    }
    cairn_appearance_patches_free(&patches);
    return status;
}

void cairn_appearance_field_free(cairn_appearance_field *field)
{
    if (field == NULL)
        return;
    free(field->places);
    free(field->words);
    free(field);
}

/* Shares of the words in a box. 0: it has no patch. */
static int take_histogram(const cairn_appearance_field *f, const double box[4],
                          float histogram[CAIRN_APPEARANCE_WORDS_MOST])
{
    int32_t patches = 0;

    memset(histogram, 0, CAIRN_APPEARANCE_WORDS_MOST * sizeof *histogram);
    for (int32_t i = 0; i < f->count; i++)
        if (cairn_appearance_is_in(&f->places[i], box)) {
            histogram[f->words[i]]++;
            patches++;
        }
    cairn_appearance_share(histogram, f->model->word_count);
    return patches > 0;
}

double cairn_appearance_probability(const cairn_appearance_field *f, const double box[4])
{
    float histogram[CAIRN_APPEARANCE_WORDS_MOST];

    return take_histogram(f, box, histogram) ? cairn_appearance_judge(f->model, histogram) : NOTHING_KNOWN;
}

/* Vectors of the class raise the probability: their weights have the sign that the slope has not. */
double cairn_appearance_distance(const cairn_appearance_field *f, const double box[4])
{
    const cairn_appearance_model *m = f->model;
    float histogram[CAIRN_APPEARANCE_WORDS_MOST];
    double least = CHI2_MOST;

    if (!take_histogram(f, box, histogram))
        return 1;
    for (int32_t i = 0; i < m->support_count; i++)
        if (m->weights[i] * m->slope < 0)
            least = fmin(least, cairn_appearance_chi2(&m->histograms[(size_t)i * (size_t)m->word_count], histogram,
                                                      m->word_count));
    return least / CHI2_MOST;
}

void cairn_appearance_free(cairn_appearance_model *model)
{
    free(model->words);
    free(model->histograms);
    free(model->weights);
    memset(model, 0, sizeof *model);
}
