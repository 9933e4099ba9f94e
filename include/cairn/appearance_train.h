/* appearance_train: training of an appearance model (appearance) from boxes around the objects of a
 * class. Descriptors and training are in the plug-in of appearance_image. Boxes: left, top, right,
 * bottom, px. */
#ifndef CAIRN_APPEARANCE_TRAIN_H
#define CAIRN_APPEARANCE_TRAIN_H

#include "cairn/appearance_file.h"
#include "cairn/appearance_image.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Greatest number of training images. */
#define CAIRN_APPEARANCE_TRAIN_MAX_IMAGES 4096

/* Parameters of the training; defaults in brackets. */
typedef struct cairn_appearance_train_params {
    /* 2 ... CAIRN_APPEARANCE_MAX_WORDS (100): words of the dictionary */
    int32_t words;
    /* 1 ... 100 (10): negative windows per box */
    int32_t negatives;
    /* > 0, <= 1e6 (10): C of the support vector machine, cost of a misclassified window */
    double cost;
    /* any (1): seed of k-means and of the window sampling */
    uint64_t seed;
} cairn_appearance_train_params;

/* Collects the images and boxes that a model is trained on. */
typedef struct cairn_appearance_trainer cairn_appearance_trainer;

/* Returns the default parameters. */
cairn_appearance_train_params cairn_appearance_train_default(void);

/* Returns an empty trainer, to be freed by cairn_appearance_trainer_free(); NULL: out of memory. */
cairn_appearance_trainer *cairn_appearance_trainer_new(void);

/* Frees the trainer. NULL is allowed. */
void cairn_appearance_trainer_free(cairn_appearance_trainer *trainer);

/* Adds an image and the boxes [count][4] about all objects of the class in it; without boxes it is
 * a negative image. CAIRN_FULL: more than CAIRN_APPEARANCE_TRAIN_MAX_IMAGES. CAIRN_BAD_ARGUMENT: an
 * invalid box, or one outside the image. Other statuses as cairn_appearance_image_make.
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
 * model: set to the model, to be freed by cairn_appearance_file_free() */
CAIRN_CHECKED cairn_status cairn_appearance_train(cairn_appearance_model *model,
                                                  const cairn_appearance_trainer *trainer,
                                                  const cairn_appearance_train_params *params,
                                                  const char *path, cairn_file_error *error);

#ifdef __cplusplus
}
#endif

#endif
