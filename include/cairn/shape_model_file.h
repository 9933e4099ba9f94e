/* shape_model_file: models of shapes as text files and pictures, and from the heap.
 *
 *   cairn-shape 1
 *   size 301.25                      # what 1 is in units of what the model was made from
 *   origin 120 80.5                  # and where the model's origin was there
 *   outline 128                      # samples: x y, direction x y
 *   -0.31 0.02 0.98 0.19
 *   ...
 *   gap -0.11 0.36                   # the middle of a gap of the drawing (cairn_shape_model); up
 *   to 8, or none path -1 -1 0.87 28               # parent, sample of the parent that it branches
 *   off, share of the outline, samples: -0.2 0.1 0.05 0.01  -0.2 0.05 1 0 0.02  -0.2 0.15 1 0 0.02
 *   ...                              # centre x y, radius, deviation (rad); of the left and of the
 *   right side: x y, direction x y, share
 *
 * Numbers are separated by blanks; # begins a comment; paths up to the end of the file.
 * include/cairn/shape_model.h says what they mean. */
#ifndef CAIRN_SHAPE_MODEL_FILE_H
#define CAIRN_SHAPE_MODEL_FILE_H

#include "cairn/file_error.h"
#include "cairn/part_bundle.h"
#include "cairn/shape_image.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The most samples of an outline, and of all paths. */
#define CAIRN_SHAPE_FILE_OUTLINE_MOST 4096
#define CAIRN_SHAPE_FILE_SAMPLES_MOST 1024

/* A model on the heap. */
typedef struct cairn_shape_model_file {
    cairn_shape_model model;
    cairn_shape_sample *samples;
    cairn_shape_path *paths;
    cairn_oriented_point *outline;
} cairn_shape_model_file;

/* Makes a model from the outlines of one object; `path` is named by the error. CAIRN_EMPTY:
 * nothing of it is symmetric; statuses of cairn_shape_builder_create and _begin. On failure
 * there is nothing to free. */
CAIRN_CHECKED cairn_status cairn_shape_model_file_build(cairn_shape_model_file *file,
                                                        const cairn_curve *outlines, int32_t count,
                                                        const cairn_shape_builder_params *params,
                                                        const char *path, cairn_file_error *error);

/* 1: the file begins as a model does. */
int32_t cairn_shape_model_file_is(const char *path);

/* Reads a model, plain or gzipped. CAIRN_BAD_FORMAT, CAIRN_TRUNCATED, CAIRN_FULL (beyond the
 * limits above), CAIRN_NOT_FINITE, CAIRN_BAD_ARGUMENT (cairn_shape_model_check refuses it): the
 * error names the line; CAIRN_IO, CAIRN_NO_MEMORY. On failure there is nothing to free. */
CAIRN_CHECKED cairn_status cairn_shape_model_file_read(cairn_shape_model_file *file,
                                                       const char *path, cairn_file_error *error);

/* Writes a model, so that reading gives the same bits. CAIRN_BAD_ARGUMENT and CAIRN_NOT_FINITE:
 * of cairn_shape_model_check, or beyond the limits; CAIRN_IO, CAIRN_NO_MEMORY. */
CAIRN_CHECKED cairn_status cairn_shape_model_file_write(const cairn_shape_model *model,
                                                        const char *path, cairn_file_error *error);

/* Reads a model from its file, or makes one from a picture of the object (shape_image, vision).
 * traced, when not NULL: what shape_image says of the picture, its outlines gone; all 0 where a
 * model was read. Statuses of _read, _build, cairn_shape_image_trace and cairn_vision_read. */
CAIRN_CHECKED cairn_status cairn_shape_model_file_load(
    cairn_shape_model_file *file, const char *path, const cairn_shape_image_params *image,
    const cairn_shape_builder_params *builder, cairn_shape_image *traced, cairn_file_error *error);

/* Copies a model that cairn_shape_model_check takes. CAIRN_NO_MEMORY: there is nothing to free. */
CAIRN_CHECKED cairn_status cairn_shape_model_file_copy(cairn_shape_model_file *file,
                                                       const cairn_shape_model *model);

/* Turns a model into its mirror image, left and right exchanged. */
void cairn_shape_model_file_mirror(cairn_shape_model_file *file);

/* Draws a model (SVG): its outline, the axes of its paths, the discs' radii to either side.
 * Statuses of write. */
CAIRN_CHECKED cairn_status cairn_shape_model_file_draw(const cairn_shape_model *model,
                                                       const char *title, const char *path,
                                                       cairn_file_error *error);

/* Draws the fragments of its first outline, bundle by bundle (SVG): cuts: [cut_count] those by
 * hand; NULL: part_bundle's, by rule. CAIRN_EMPTY: fewer than 3 samples; statuses of
 * cairn_part_bundle_begin() and of write. */
CAIRN_CHECKED cairn_status cairn_shape_model_file_draw_parts(const cairn_shape_model *model,
                                                             const cairn_part_cut *cuts,
                                                             int32_t cut_count, const char *title,
                                                             const char *path,
                                                             cairn_file_error *error);

void cairn_shape_model_file_free(cairn_shape_model_file *file);

#ifdef __cplusplus
}
#endif

#endif
