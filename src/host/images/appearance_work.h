/* appearance_work: shared definitions of the appearance sources. Internal to the host library. */
#ifndef CAIRN_HOST_APPEARANCE_WORK_H
#define CAIRN_HOST_APPEARANCE_WORK_H

#include "cairn/appearance.h"
#include "src/host/images/appearance_shim.h"

enum { APPEARANCE_DESCRIPTOR_SIZE = CAIRN_APPEARANCE_DESCRIPTOR_SIZE };

/* The patches of an image and their SIFT descriptors. */
typedef struct appearance_patches {
    cairn_appearance_shim_keypoint *keypoints; /* [count] */
    uint8_t *descriptors;                      /* [count][APPEARANCE_DESCRIPTOR_SIZE] */
    int32_t count;
} appearance_patches;

/* Returns the plug-in's function table; NULL, with an error message, when it is missing. */
const cairn_appearance_shim *cairn_appearance_need_shim(const char *path, cairn_file_error *error);

/* Computes the patches of an image. CAIRN_BAD_ARGUMENT, CAIRN_UNSUPPORTED, CAIRN_NO_MEMORY; the
 * result must be freed on failure, too. */
CAIRN_CHECKED cairn_status cairn_appearance_describe(appearance_patches *patches,
                                                     const uint8_t *grey, int32_t width,
                                                     int32_t height, const char *path,
                                                     cairn_file_error *error);
void cairn_appearance_patches_free(appearance_patches *patches);

/* Returns 1 when the centre of a patch lies in a box. */
int cairn_appearance_is_in_box(const cairn_appearance_shim_keypoint *place, const double box[4]);

/* Nearest neighbour among `count` words in squared Euclidean distance, ties to the first;
 * *distance, when not NULL: the squared distance. */
int32_t cairn_appearance_nearest_word(const uint8_t *words, int32_t count,
                                      const uint8_t *descriptor, int32_t *distance);

/* Normalizes a histogram to sum 1. */
void cairn_appearance_normalize(float *histogram, int32_t count);

/* Chi-squared distance of two histograms: sum of (a - b)^2 / (a + b). */
double cairn_appearance_chi2(const float *a, const float *b, int32_t count);

/* Decision value f of a histogram, before Platt scaling. */
double cairn_appearance_decision(const cairn_appearance_model *model, const float *histogram);

#endif
