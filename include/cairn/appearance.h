/* appearance: bag-of-visual-words classifier for the image content of a box.
 *
 * SIFT descriptors (Lowe 2004) on a regular grid of patches are quantized to the nearest word of a
 * k-means dictionary. A support vector machine with chi-squared kernel maps the word histogram of a
 * box to the probability that the box shows the class (Adluru 2008, section 5.3.2).
 *
 * SIFT and the training are in a plug-in, libcairn-appearance.so (`make appearance`: OpenCV's
 * features2d and ml), which is loaded on first use from $CAIRN_APPEARANCE or from the search path
 * of the vision plug-in. All other functions of this module work without it. Boxes: left, top,
 * right, bottom, px. */
#ifndef CAIRN_APPEARANCE_H
#define CAIRN_APPEARANCE_H

#include "cairn/file_error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Dimension of a descriptor; greatest numbers of words of a dictionary, support vectors, and
 * training images or windows. */
#define CAIRN_APPEARANCE_DESCRIPTOR_SIZE     128
#define CAIRN_APPEARANCE_MAX_WORDS           1000
#define CAIRN_APPEARANCE_MAX_SUPPORT_VECTORS 20000
#define CAIRN_APPEARANCE_MAX_IMAGES          4096
/* Greatest side of an image, px. */
#define CAIRN_APPEARANCE_MAX_SIDE 8192

/* Appearance model of a class, on the heap. Decision function f = sum of weight exp(-gamma
 * chi2(support histogram, histogram of the box)) - rho, with chi2 = sum of (a - b)^2 / (a + b). */
typedef struct cairn_appearance_model {
    /* 2 ... CAIRN_APPEARANCE_MAX_WORDS */
    int32_t word_count;
    /* number of support vectors */
    int32_t support_count;
    /* [word_count][CAIRN_APPEARANCE_DESCRIPTOR_SIZE] dictionary */
    uint8_t *words;
    /* [support_count][word_count] normalized word histograms of the support vectors */
    float *histograms;
    /* [support_count] coefficients of the support vectors */
    double *weights;
    /* kernel width gamma > 0, bias rho */
    double gamma, rho;
    /* Platt scaling: the probability is 1 / (1 + exp(platt_slope f + platt_offset)) (Platt 2000) */
    double platt_slope, platt_offset;
} cairn_appearance_model;

/* Loads the plug-in. CAIRN_OK: descriptors can be computed. CAIRN_UNSUPPORTED: libcairn-appearance
 * is missing or incompatible; the error message says which. */
CAIRN_CHECKED cairn_status cairn_appearance_load(cairn_file_error *error);

/* Frees the arrays of `model`. */
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

/* Reads a model file, plain or gzipped. CAIRN_UNSUPPORTED: another version, or not a regular file.
 * CAIRN_BAD_FORMAT, CAIRN_TRUNCATED, CAIRN_FULL (beyond the limits above): the error names the
 * line. CAIRN_IO, CAIRN_NO_MEMORY. On failure there is nothing to free.
 *
 * path: file, plain or gzipped
 * model: set to the model */
CAIRN_CHECKED cairn_status cairn_appearance_read(cairn_appearance_model *model, const char *path,
                                                 cairn_file_error *error);

/* Writes a model file; reading it restores the same bits. CAIRN_BAD_ARGUMENT: a model that could
 * not be read again: beyond the limits above, a number that is not finite or beyond 1e9, gamma not
 * above 0. CAIRN_IO, CAIRN_NO_MEMORY.
 *
 * path: target */
CAIRN_CHECKED cairn_status cairn_appearance_write(const cairn_appearance_model *model,
                                                  const char *path, cairn_file_error *error);

/* ---- Classification ---- */

/* The visual words of an image, one per patch. */
typedef struct cairn_appearance_field cairn_appearance_field;

/* Computes the words of an 8-bit grey image [height * width]. The image need not stay valid; the
 * model must. CAIRN_BAD_ARGUMENT: a side outside 1 ... CAIRN_APPEARANCE_MAX_SIDE, or refused by
 * OpenCV. CAIRN_UNSUPPORTED: no libcairn-appearance. CAIRN_NO_MEMORY. On failure there is nothing
 * to free, and *field is NULL. The error message names `path`.
 *
 * path: used in the error
 * model: a model, which must outlive the field
 * grey: [height * width] 8-bit grey image
 * width, height: size, px */
CAIRN_CHECKED cairn_status cairn_appearance_field_make(cairn_appearance_field **field,
                                                       const cairn_appearance_model *model,
                                                       const uint8_t *grey, int32_t width,
                                                       int32_t height, const char *path,
                                                       cairn_file_error *error);

/* Frees the field. NULL is allowed. */
void cairn_appearance_field_free(cairn_appearance_field *field);

/* Returns the probability that a box shows the class, 0 ... 1, from the patches centred in the box;
 * 0.5 without patches. Cost: linear in the patches of the image.
 *
 * box: px: left, top, right, bottom */
double cairn_appearance_probability(const cairn_appearance_field *field, const double box[4]);

/* Returns the distance of the box's word histogram to the nearest positive support vector, 0 ... 1:
 * half of chi-squared; 1 when the box has no patch, or the model no positive support vector. Cost:
 * linear in the patches of the image and the size of the model.
 *
 * box: px: left, top, right, bottom */
double cairn_appearance_distance(const cairn_appearance_field *field, const double box[4]);

/* Returns the probability of the class for a normalized histogram [word_count].
 *
 * model: a model
 * histogram: [word_count] shares of the words, with sum 1 */
double cairn_appearance_histogram_probability(const cairn_appearance_model *model,
                                              const float *histogram);

/* ---- Training ---- */

/* Parameters of the training; defaults in brackets. */
typedef struct cairn_appearance_params {
    /* 2 ... CAIRN_APPEARANCE_MAX_WORDS (100): words of the dictionary */
    int32_t words;
    /* 1 ... 100 (10): negative windows per box */
    int32_t negatives;
    /* > 0, <= 1e6 (10): C of the support vector machine, cost of a misclassified window */
    double cost;
    /* any (1): seed of k-means and of the window sampling */
    uint64_t seed;
} cairn_appearance_params;

/* Collects the images and boxes that a model is trained on. */
typedef struct cairn_appearance_trainer cairn_appearance_trainer;

/* Returns the default parameters. */
cairn_appearance_params cairn_appearance_default(void);

/* Returns an empty trainer, to be freed by cairn_appearance_trainer_free(); NULL: out of memory. */
cairn_appearance_trainer *cairn_appearance_trainer_new(void);

/* Frees the trainer. NULL is allowed. */
void cairn_appearance_trainer_free(cairn_appearance_trainer *trainer);

/* Adds an image and the boxes [count][4] about all objects of the class in it; without boxes it is
 * a negative image. CAIRN_FULL: more than CAIRN_APPEARANCE_MAX_IMAGES. CAIRN_BAD_ARGUMENT: an
 * invalid box, or one outside the image. Other statuses as cairn_appearance_field_make.
 *
 * grey: [height * width] 8-bit grey image
 * width, height: size, px
 * path: used in the error
 * boxes: [count][4] px: left, top, right, bottom */
CAIRN_CHECKED cairn_status cairn_appearance_trainer_add(cairn_appearance_trainer *trainer,
                                                        const uint8_t *grey, int32_t width,
                                                        int32_t height, const double *boxes,
                                                        int32_t count, const char *path,
                                                        cairn_file_error *error);

/* Trains a model. The dictionary is clustered from the patches in the boxes. The support vector
 * machine is trained on the boxes against negative windows of the same sizes whose intersection
 * over union with every box is below a fifth. CAIRN_BAD_ARGUMENT: params. CAIRN_EMPTY: no box, too
 * few patches in the boxes, or no negative window. CAIRN_UNSUPPORTED: no libcairn-appearance.
 * CAIRN_FULL: more windows than CAIRN_APPEARANCE_MAX_SUPPORT_VECTORS. CAIRN_NO_MEMORY. On failure
 * there is nothing to free. Deterministic on one machine for the same images in the same order;
 * OpenCV's SIFT may differ in bits on others.
 *
 * Cost: k-means takes words times at most 8000 patches, at most 25 times; quantization takes words
 * times all patches of all images; six support vector machines are trained, each between quadratic
 * and cubic in the windows, times words. Memory: windows times words, twice, and all images'
 * patches, which the trainer keeps (about 128 bytes per 29 pixels).
 *
 * path: used in the error
 * model: set to the model */
CAIRN_CHECKED cairn_status cairn_appearance_train(cairn_appearance_model *model,
                                                  const cairn_appearance_trainer *trainer,
                                                  const cairn_appearance_params *params,
                                                  const char *path, cairn_file_error *error);

#ifdef __cplusplus
}
#endif

#endif
