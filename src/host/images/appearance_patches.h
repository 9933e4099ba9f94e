/* appearance_patches: patches of an image and their descriptors, by the plug-in. Internal to the host
 * library. */
#ifndef CAIRN_HOST_APPEARANCE_PATCHES_H
#define CAIRN_HOST_APPEARANCE_PATCHES_H

#include "cairn/appearance_image.h"
#include "src/host/images/appearance_shim.h"

enum { APPEARANCE_DESCRIPTOR_SIZE = CAIRN_APPEARANCE_DESCRIPTOR_SIZE };

/* The patches of an image and their SIFT descriptors. */
typedef struct appearance_patches {
    cairn_appearance_shim_keypoint *keypoints; /* [count] */
    uint8_t *descriptors;                      /* [count][APPEARANCE_DESCRIPTOR_SIZE] */
    int32_t count;
} appearance_patches;

/* Returns the plug-in's function table; NULL, with an error message, when it is missing. */
const cairn_appearance_shim *cairn_appearance_image_need_shim(const char *path,
                                                              cairn_file_error *error);

/* Computes the patches of an image. CAIRN_BAD_ARGUMENT, CAIRN_UNSUPPORTED, CAIRN_NO_MEMORY; the
 * result must be freed on failure, too. */
CAIRN_CHECKED cairn_status cairn_appearance_image_describe(appearance_patches *patches,
                                                           const uint8_t *grey, int32_t width,
                                                           int32_t height, const char *path,
                                                           cairn_file_error *error);
void cairn_appearance_image_patches_free(appearance_patches *patches);

/* Returns 1 when the centre of a patch lies in a box. */
int cairn_appearance_image_is_in_box(const cairn_appearance_shim_keypoint *place,
                                     const double box[4]);

#endif
