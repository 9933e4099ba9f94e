/* appearance_shim: what libcairn-appearance.so offers to the host library. Internal; plain C on
 * both sides.
 *
 * Calls return a cairn_status; on failure `words` holds OpenCV's text, 0-terminated, cut to
 * `room` bytes. */
#ifndef CAIRN_HOST_APPEARANCE_SHIM_H
#define CAIRN_HOST_APPEARANCE_SHIM_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Raised whenever this header changes. */
#define CAIRN_APPEARANCE_SHIM_VERSION       1
#define CAIRN_APPEARANCE_SHIM_MESSAGE_BYTES 512
/* Numbers of a SIFT descriptor, 0 ... 255 each. */
#define CAIRN_APPEARANCE_SHIM_DESCRIPTOR_SIZE 128

/* Where a descriptor is taken: x, y and size in px of the image; octave 0, or 1: in the image of
 * half the size. */
typedef struct cairn_appearance_shim_keypoint {
    float x, y, size;
    int32_t octave;
} cairn_appearance_shim_keypoint;

/* A support vector machine: what is asked is of the class when sum of weight[i] exp(-gamma
 * chi2(support[i], it)) > rho. */
typedef struct cairn_appearance_shim_machine {
    float *support; /* room for [count][width] */
    double *weight; /* and [count] */
    int32_t count;  /* that there are */
    double rho;
} cairn_appearance_shim_machine;

typedef struct cairn_appearance_shim {
    int32_t version; /* CAIRN_APPEARANCE_SHIM_VERSION */
    /* Upright SIFT descriptors: [count][NUMBERS]. */
    int32_t (*describe)(const uint8_t *grey, int32_t width, int32_t height,
                        const cairn_appearance_shim_keypoint *places, int32_t count,
                        uint8_t *descriptors, char *words, size_t room);
    /* Trains on samples [count][width], those with is_class[i] != 0 of the class. */
    int32_t (*train)(const float *samples, const int32_t *is_class, int32_t count, int32_t width,
                     double cost, double gamma, cairn_appearance_shim_machine *machine, char *words,
                     size_t room);
} cairn_appearance_shim;

/* The one symbol of the library. */
const cairn_appearance_shim *cairn_appearance_shim_table(void);

#ifdef __cplusplus
}
#endif

#endif
