/* appearance_shim: interface between libcairn-appearance.so and the host library. Internal; plain C
 * on both sides.
 *
 * Calls return a cairn_status. On failure the message buffer holds OpenCV's text, 0-terminated,
 * truncated to its capacity. */
#ifndef CAIRN_HOST_APPEARANCE_SHIM_H
#define CAIRN_HOST_APPEARANCE_SHIM_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Version of the interface; incremented whenever this header changes. */
#define CAIRN_APPEARANCE_SHIM_VERSION       1
#define CAIRN_APPEARANCE_SHIM_MESSAGE_BYTES 512
/* Components of a SIFT descriptor, 0 ... 255 each. */
#define CAIRN_APPEARANCE_SHIM_DESCRIPTOR_SIZE 128

/* Keypoint of a descriptor: x, y and size in px of the image; octave 0, or 1 for the image of half
 * the size. */
typedef struct cairn_appearance_shim_keypoint {
    float x, y, size;
    int32_t octave;
} cairn_appearance_shim_keypoint;

/* A support vector machine with chi-squared kernel. A histogram is of the class when sum of
 * weight[i] exp(-gamma chi2(support[i], histogram)) > rho. */
typedef struct cairn_appearance_shim_machine {
    float *support; /* capacity [count][width] */
    double *weight; /* capacity [count] */
    int32_t count;  /* number of support vectors */
    double rho;
} cairn_appearance_shim_machine;

typedef struct cairn_appearance_shim {
    int32_t version; /* CAIRN_APPEARANCE_SHIM_VERSION */
    /* Computes upright SIFT descriptors: [count][CAIRN_APPEARANCE_SHIM_DESCRIPTOR_SIZE]. */
    int32_t (*describe)(const uint8_t *grey, int32_t width, int32_t height,
                        const cairn_appearance_shim_keypoint *keypoints, int32_t count,
                        uint8_t *descriptors, char *message, size_t capacity);
    /* Trains on samples [count][width]; is_class[i] != 0 marks positive samples. */
    int32_t (*train)(const float *samples, const int32_t *is_class, int32_t count, int32_t width,
                     double cost, double gamma, cairn_appearance_shim_machine *machine,
                     char *message, size_t capacity);
} cairn_appearance_shim;

/* The only exported symbol of the plug-in: its function table. */
const cairn_appearance_shim *cairn_appearance_shim_table(void);

#ifdef __cplusplus
}
#endif

#endif
