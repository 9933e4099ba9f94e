/* appearance: bag-of-visual-words classifier for the image content of a box.
 *
 * Descriptors of patches (SIFT, Lowe 2004) are quantized to the nearest word of a dictionary. A
 * support vector machine with chi-squared kernel maps the word histogram of a box to the
 * probability that the box shows the class (Adluru 2008, section 5.3.2).
 *
 * This module evaluates a learned model. The caller supplies model and descriptors: on a desktop
 * they come from appearance_file, appearance_train and appearance_image. Boxes: left, top, right,
 * bottom, px. */
#ifndef CAIRN_APPEARANCE_H
#define CAIRN_APPEARANCE_H

#include "cairn/geometry.h"
#include "cairn/object.h"
#include "cairn/pool.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Dimension of a descriptor; greatest numbers of words of a dictionary, of support vectors, and of
 * patches of an image. */
#define CAIRN_APPEARANCE_DESCRIPTOR_SIZE     128
#define CAIRN_APPEARANCE_MAX_WORDS           1000
#define CAIRN_APPEARANCE_MAX_SUPPORT_VECTORS 20000
#define CAIRN_APPEARANCE_MAX_PATCHES         (INT32_C(1) << 22)

/* Appearance model of a class. Decision function f = sum of weight exp(-gamma chi2(support
 * histogram, histogram of the box)) - rho, with chi2 = sum of (a - b)^2 / (a + b). The arrays are
 * the caller's. */
typedef struct cairn_appearance_model {
    /* 2 ... CAIRN_APPEARANCE_MAX_WORDS */
    int32_t word_count;
    /* 1 ... CAIRN_APPEARANCE_MAX_SUPPORT_VECTORS: number of support vectors */
    int32_t support_count;
    /* [word_count][CAIRN_APPEARANCE_DESCRIPTOR_SIZE] dictionary */
    uint8_t *words;
    /* [support_count][word_count] normalized word histograms of the support vectors */
    float *histograms;
    /* [support_count] coefficients of the support vectors */
    cairn_real *weights;
    /* kernel width gamma > 0, bias rho */
    cairn_real gamma, rho;
    /* Platt scaling: the probability is 1 / (1 + exp(platt_slope f + platt_offset)) (Platt 2000) */
    cairn_real platt_slope, platt_offset;
} cairn_appearance_model;

/* Checks a model. CAIRN_BAD_ARGUMENT: a missing array, a number outside its range, a share of a
 * histogram outside 0 ... 1 (*fault: index of the support vector). CAIRN_NOT_FINITE: a number of
 * the machine, or a weight (*fault: its index). Cost: linear in the model.
 *
 * model: a model */
CAIRN_CHECKED cairn_status cairn_appearance_model_check(const cairn_appearance_model *model,
                                                        cairn_fault *fault);

/* Patches of an image and their descriptors. */
typedef struct cairn_appearance_patches {
    /* [count] px: centres */
    const cairn_vec2 *centres;
    /* [count][CAIRN_APPEARANCE_DESCRIPTOR_SIZE] descriptors */
    const uint8_t *descriptors;
    /* number of patches */
    int32_t count;
} cairn_appearance_patches;

/* Parameters; defaults in brackets. */
typedef struct cairn_appearance_params {
    /* 1 ... CAIRN_APPEARANCE_MAX_PATCHES (6500): capacity of patches of an image; the default is
     * that of 320 x 240 pixels with a patch every 6 pixels, and every 12 of the half image, twice */
    int32_t max_patches;
    /* 2 ... CAIRN_APPEARANCE_MAX_WORDS (100): capacity of words of a model */
    int32_t max_words;
} cairn_appearance_params;

/* Returns the default parameters. */
cairn_appearance_params cairn_appearance_default(void);

/* Whether params are in range. CAIRN_BAD_ARGUMENT: NULL, or the parameter that *fault names is out
 * of range.
 *
 * fault: when not NULL, filled in when the params are refused */
CAIRN_CHECKED cairn_status cairn_appearance_check(const cairn_appearance_params *params,
                                                  cairn_object_fault *fault);

/* The visual words of an image, one per patch, and the scores of boxes. */
typedef struct cairn_appearance_field cairn_appearance_field;

/* Returns the memory of a field in bytes; 0 for params that create() rejects. */
size_t cairn_appearance_memory(const cairn_appearance_params *params);

/* Creates a field. CAIRN_BAD_ARGUMENT: invalid params. CAIRN_NO_MEMORY: the pool is too small. */
CAIRN_CHECKED cairn_status cairn_appearance_create(cairn_appearance_field **field, cairn_pool *pool,
                                                   const cairn_appearance_params *params);

/* Starts on an image. The patches must stay valid until step() returns CAIRN_OK, the model as long
 * as the field is used; cairn_appearance_model_check() must accept it. CAIRN_BAD_ARGUMENT: NULL, a
 * negative count, a model out of range. CAIRN_FULL: more patches or words than the capacities.
 * CAIRN_NOT_FINITE: the centre of a patch. A refused call changes nothing. Cost: linear in the
 * patches.
 *
 * model: a model
 * patches: the patches of the image */
CAIRN_CHECKED cairn_status cairn_appearance_begin(cairn_appearance_field *field,
                                                  const cairn_appearance_model *model,
                                                  const cairn_appearance_patches *patches);

/* Starts to score a box; the words must be complete. CAIRN_BAD_ARGUMENT: NULL. CAIRN_EMPTY: no
 * image, or its words are not complete. CAIRN_NOT_FINITE: the box.
 *
 * box: px: left, top, right, bottom */
CAIRN_CHECKED cairn_status cairn_appearance_begin_box(cairn_appearance_field *field,
                                                      const cairn_real box[4]);

/* Resumes: the words of an image, or the scores of a box. CAIRN_MORE: the budget is used up.
 * CAIRN_OK: done, or nothing was begun. Cost: 3 units per patch and word; for a box 1 unit per 32
 * patches, and for each support vector 1 and 1 per 8 words. */
CAIRN_CHECKED cairn_status cairn_appearance_step(cairn_appearance_field *field,
                                                 cairn_budget *budget);

/* The scores of a box. */
typedef struct cairn_appearance_result {
    /* number of patches centred in the box */
    int32_t patch_count;
    /* 0 ... 1: probability that the box shows the class; 0.5 without patches */
    cairn_real probability;
    /* 0 ... 1: distance of the box's histogram to the nearest positive support vector: half of
     * chi-squared; 1 without patches, or without a positive support vector */
    cairn_real distance;
} cairn_appearance_result;

/* Returns the scores of the last box; without one those of a box without patches. */
cairn_appearance_result cairn_appearance_read(const cairn_appearance_field *field);

/* Returns the probability of the class for a normalized histogram [word_count]. Cost: words times
 * support vectors, at once.
 *
 * model: a model
 * histogram: [word_count] shares of the words, with sum 1 */
cairn_real cairn_appearance_histogram_probability(const cairn_appearance_model *model,
                                                  const float *histogram);

/* Returns the decision value f of a normalized histogram [word_count]. Cost: words times support
 * vectors, at once.
 *
 * model: a model
 * histogram: [word_count] shares of the words, with sum 1 */
cairn_real cairn_appearance_decision(const cairn_appearance_model *model, const float *histogram);

/* Returns the chi-squared distance of two histograms [count]: sum of (a - b)^2 / (a + b). Cost:
 * linear.
 *
 * a, b: [count] histograms */
cairn_real cairn_appearance_chi2(const float *a, const float *b, int32_t count);

/* Returns the index of the nearest of [count] words in squared Euclidean distance, ties to the
 * first. Cost: linear.
 *
 * words: [count][CAIRN_APPEARANCE_DESCRIPTOR_SIZE] words
 * descriptor: [CAIRN_APPEARANCE_DESCRIPTOR_SIZE] a descriptor
 * distance: NULL, or set to the squared distance */
int32_t cairn_appearance_nearest_word(const uint8_t *words, int32_t count,
                                      const uint8_t *descriptor, int32_t *distance);

/* Divides a histogram [count] by its sum, unless that is 0. Cost: linear.
 *
 * histogram: [count] numbers >= 0 */
void cairn_appearance_normalize(float *histogram, int32_t count);

#ifdef __cplusplus
}
#endif

#endif
