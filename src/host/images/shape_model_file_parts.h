/* The fragments of a model's first outline, and how they are drawn. Internal to the host
 * library. */
#ifndef CAIRN_HOST_SHAPE_MODEL_FILE_PARTS_H
#define CAIRN_HOST_SHAPE_MODEL_FILE_PARTS_H

#include "cairn/output.h"
#include "cairn/part_bundle.h"
#include "cairn/shape_model.h"

/* The fragments of a model. */
typedef struct cairn_shape_model_parts {
    cairn_part_bundle_model found; /* its arrays are in `memory` */
    int32_t outline; /* samples of the first outline; other outlines have no fragments */
    void *memory;    /* on the heap */
} cairn_shape_model_parts;

/* Where a model is drawn. */
typedef struct cairn_shape_model_view {
    double x, y, size; /* px: position of the model's origin, length of a unit */
    int32_t mirrored;  /* 1: the mirror image */
} cairn_shape_model_view;

/* Finds the fragments as object_detect does. CAIRN_EMPTY: fewer than 3 samples; CAIRN_NO_MEMORY;
 * CAIRN_MORE: interrupted; statuses of cairn_part_bundle_begin(). On failure there is nothing to
 * free.
 *
 * parts: set to the fragments
 * model: a valid model
 * cuts: [cut_count] manual fragments; NULL: by rule */
CAIRN_CHECKED cairn_status cairn_shape_model_parts_find(cairn_shape_model_parts *parts,
                                                        const cairn_shape_model *model,
                                                        const cairn_part_bundle_cut *cuts,
                                                        int32_t cut_count);

/* Frees the fragments. */
void cairn_shape_model_parts_free(cairn_shape_model_parts *parts);

/* Returns the colour of a bundle, 0 ... CAIRN_PART_MAX_BUNDLES - 1. */
const char *cairn_shape_model_parts_colour(int32_t bundle);

/* Prints the whole first outline as a path. */
void cairn_shape_model_parts_print_outline(cairn_output *output,
                                           const cairn_shape_model_parts *parts,
                                           const cairn_shape_model *model,
                                           const cairn_shape_model_view *view);

/* Prints a fragment as a path in the colour of its bundle. */
void cairn_shape_model_parts_print_fragment(cairn_output *output,
                                            const cairn_shape_model_parts *parts,
                                            const cairn_shape_model *model, int32_t fragment,
                                            const cairn_shape_model_view *view);

#endif
