/* bench_detect_look: appearance model of a class, trained on the first images of its folder. */
#ifndef CAIRN_BENCH_DETECT_LOOK_H
#define CAIRN_BENCH_DETECT_LOOK_H

#include "bench/bench_group.h"
#include "cairn/appearance_train.h"

/* Trains on the first `count` images of a folder by name, with their boxes of the class and windows
 * beside them. 0: a line was printed. */
int detect_look_train(cairn_appearance_model *model, const char *folder, const char *class_name,
                      int32_t count);

/* The words of an image. 0: a line was printed. */
int detect_look_field(cairn_appearance_image *words, const cairn_appearance_model *model,
                      const char *folder, const group_image *image);

#endif
