/* appearance_work: what the parts of appearance share. Internal to the host library. */
#ifndef CAIRN_HOST_APPEARANCE_WORK_H
#define CAIRN_HOST_APPEARANCE_WORK_H

#include "cairn/appearance.h"
#include "src/host/appearance_shim.h"

enum { APPEARANCE_DESCRIPTOR_SIZE = CAIRN_APPEARANCE_NUMBERS };

/* The patches of an image. */
typedef struct appearance_patches {
    cairn_appearance_shim_keypoint *keypoints; /* [count] */
    uint8_t *descriptors;                      /* [count][NUMBERS] */
    int32_t count;
} appearance_patches;

/* NULL after a line in the error: it is not there. */
const cairn_appearance_shim *cairn_appearance_need_shim(const char *path, cairn_file_error *error);

/* CAIRN_BAD_ARGUMENT, CAIRN_UNSUPPORTED, CAIRN_NO_MEMORY; on failure, too, there is something to
 * free. */
CAIRN_CHECKED cairn_status cairn_appearance_describe(appearance_patches *patches,
                                                     const uint8_t *grey, int32_t width,
                                                     int32_t height, const char *path,
                                                     cairn_file_error *error);
void cairn_appearance_patches_free(appearance_patches *patches);

/* Whether the middle of a patch lies in a box. */
int cairn_appearance_is_in_box(const cairn_appearance_shim_keypoint *place, const double box[4]);

/* The nearest of `count` words, of equal ones the first; *distance, when not NULL: its square. */
int32_t cairn_appearance_nearest_word(const uint8_t *words, int32_t count,
                                      const uint8_t *descriptor, int32_t *distance);

/* Counts to shares of all. */
void cairn_appearance_normalize(float *histogram, int32_t count);

/* sum of (a - b)^2 / (a + b). */
double cairn_appearance_chi2(const float *a, const float *b, int32_t count);

/* f of a histogram: what the probability is made of. */
double cairn_appearance_decision(const cairn_appearance_model *model, const float *histogram);

#endif
