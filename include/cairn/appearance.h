/* appearance: whether what is in a box of an image looks like a class, by words of a dictionary of small patches.
 *
 * Patches on a grid, described by SIFT (Lowe 2004), are taken for the nearest word of a dictionary made by k-means; how often each word
 * is in a box says by a support vector machine how likely it shows the class (Adluru 2008, section 5.3.2).
 *
 * SIFT and the training stand behind a library of their own, libcairn-appearance.so (`make appearance`: OpenCV's features2d and ml), which is loaded
 * when it is first needed, from $CAIRN_APPEARANCE or from where vision's is looked for. Without it all else of this room works. Boxes:
 * left, top, right, bottom, px. */
#ifndef CAIRN_APPEARANCE_H
#define CAIRN_APPEARANCE_H

#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Numbers of a word; the most words of a dictionary, support vectors, and images and windows of a training. */
#define CAIRN_APPEARANCE_NUMBERS      128
#define CAIRN_APPEARANCE_WORDS_MOST   1000
#define CAIRN_APPEARANCE_SUPPORT_MOST 20000
#define CAIRN_APPEARANCE_IMAGES_MOST  4096
/* Of an image, px. */
#define CAIRN_APPEARANCE_SIDE_MOST 8192

/* What a class looks like; on the heap. f = sum of weight exp(-gamma chi2(histogram, that of the box)) - rho; chi2 = sum of (a - b)^2 / (a + b). */
typedef struct cairn_appearance_model {
    int32_t word_count; /* 2 ... WORDS_MOST */
    int32_t support_count;
    uint8_t *words;       /* [word_count][NUMBERS] */
    float *histograms;    /* [support_count][word_count] of the support vectors, shares of all words in their box */
    double *weights;      /* [support_count] */
    double gamma, rho;    /* gamma > 0 */
    double slope, offset; /* the probability is 1 / (1 + exp(slope f + offset)) (Platt 2000) */
} cairn_appearance_model;

/* CAIRN_OK: images can be described. CAIRN_UNSUPPORTED: libcairn-appearance is missing, or does not fit; the error says so. */
CAIRN_CHECKED cairn_status cairn_appearance_load(cairn_file_error *error);

void cairn_appearance_free(cairn_appearance_model *model);

/* ---- Files ----
 *
 *   cairn-appearance 1
 *   words 100
 *   12 0 0 31 ...                    # 128 whole numbers for each word, 0 ... 255
 *   machine 1.9 -0.2 -1.7 0.4 57     # gamma, rho, slope, offset, support vectors:
 *   0.5 0 0.01 ...                   # weight, then the histogram
 *   end                              # nothing was cut off
 *
 * # begins a comment. */

/* Reads a model, plain or gzipped. CAIRN_UNSUPPORTED: of another version, or not a regular file; CAIRN_BAD_FORMAT, CAIRN_TRUNCATED, CAIRN_FULL (beyond the limits
 * above): the error names the line; CAIRN_IO, CAIRN_NO_MEMORY. On failure there is nothing to free. */
CAIRN_CHECKED cairn_status cairn_appearance_read(cairn_appearance_model *model, const char *path,
                                                 cairn_file_error *error);

/* Writes a model, so that reading gives the same bits. CAIRN_BAD_ARGUMENT: one that could not be read again, beyond the limits above, a number
 * that is none or beyond 1e9, gamma not above 0; CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_appearance_write(const cairn_appearance_model *model, const char *path,
                                                  cairn_file_error *error);

/* ---- Asking ---- */

/* The words of an image. */
typedef struct cairn_appearance_field cairn_appearance_field;

/* Describes 8-bit grey [height * width], which need not stay; the model must. CAIRN_BAD_ARGUMENT: a side beyond 1 ... SIDE_MOST, or refused
 * by OpenCV; CAIRN_UNSUPPORTED: no libcairn-appearance; CAIRN_NO_MEMORY. On failure there is nothing to free, and *field is NULL. `path` is
 * named by the error. */
CAIRN_CHECKED cairn_status cairn_appearance_field_make(cairn_appearance_field **field,
                                                       const cairn_appearance_model *model, const uint8_t *grey,
                                                       int32_t width, int32_t height, const char *path,
                                                       cairn_file_error *error);
void cairn_appearance_field_free(cairn_appearance_field *field);

/* How likely a box shows the class, 0 ... 1, from the patches whose middles lie in it; 0.5 when there are none. Cost: linear in the patches of
 * the image. */
double cairn_appearance_probability(const cairn_appearance_field *field, const double box[4]);

/* How far the words of a box are from the nearest histogram of the class that the machine was learnt from and keeps, 0 ... 1: half of chi2; 1 when
 * the box has no patch, or the machine keeps none. Cost: linear in the patches of the image and the numbers of the model. */
double cairn_appearance_distance(const cairn_appearance_field *field, const double box[4]);

/* The probability of a histogram [word_count]. */
double cairn_appearance_judge(const cairn_appearance_model *model, const float *histogram);

/* ---- Training ---- */

typedef struct cairn_appearance_params {
    int32_t words;     /* 2 ... WORDS_MOST (100) */
    int32_t negatives; /* 1 ... 100: windows without the class, for each box (10) */
    double cost;       /* > 0 ... 1e6, of a window on the wrong side (10) */
    uint64_t seed;     /* of the dictionary and of the windows (1) */
} cairn_appearance_params;

typedef struct cairn_appearance_trainer cairn_appearance_trainer;

/* The values in brackets above. */
cairn_appearance_params cairn_appearance_default(void);

/* NULL: there is no memory. */
cairn_appearance_trainer *cairn_appearance_trainer_new(void);
void cairn_appearance_trainer_free(cairn_appearance_trainer *trainer);

/* Adds an image and the boxes [count][4] about all objects of the class in it (none: it shows what the class is not). CAIRN_FULL: beyond IMAGES_MOST;
 * CAIRN_BAD_ARGUMENT: a box that is none, or lies outside; statuses of cairn_appearance_field_make. */
CAIRN_CHECKED cairn_status cairn_appearance_trainer_add(cairn_appearance_trainer *trainer, const uint8_t *grey,
                                                        int32_t width, int32_t height, const double *boxes,
                                                        int32_t count, const char *path, cairn_file_error *error);

/* Makes the dictionary of what is in the boxes, and the machine of the boxes and of windows of the same sizes that share less than a fifth
 * with any box (over their union). CAIRN_BAD_ARGUMENT: params; CAIRN_EMPTY: no box, too few patches in them, or no
 * window beside them; CAIRN_UNSUPPORTED: no libcairn-appearance; CAIRN_FULL: more than SUPPORT_MOST windows; CAIRN_NO_MEMORY. On failure there
 * is nothing to free. The same images in the same order give the same model on one machine; OpenCV's SIFT is not held to the same bits on others.
 *
 * Cost: the dictionary words times at most 8000 patches, at most 25 times; then words times all patches of all images; then machines of the
 * windows, six of them in all, each between their square and their cube times words. Memory: windows times words, twice, and all images'
 * patches, which the trainer keeps (about 128 bytes for every 29 pixels). */
CAIRN_CHECKED cairn_status cairn_appearance_train(cairn_appearance_model *model,
                                                  const cairn_appearance_trainer *trainer,
                                                  const cairn_appearance_params *params, const char *path,
                                                  cairn_file_error *error);

#ifdef __cplusplus
}
#endif

#endif
