/* shape_model_file: shape models as text files: reading, writing, building from a picture, drawing.
 *
 *   cairn-shape 1
 *   size 301.25                      # scale: units of the source for a length of 1
 *   origin 120 80.5                  # position of the model's origin in the source
 *   outline 128                      # samples: x y, tangent direction x y
 *   -0.31 0.02 0.98 0.19
 *   ...
 *   gap -0.11 0.36                   # centre of a gap of the drawing, 0 to 8 lines
 *   path -1 -1 0.87 28               # parent path, branch sample of the parent (-1 -1: none),
 *                                    # fraction of the outline, samples:
 *   -0.2 0.1 0.05 0.01  -0.2 0.05 1 0 0.02  -0.2 0.15 1 0 0.02
 *   ...                              # centre x y, radius, deviation (rad); of the left and of
 *                                    # the right side: x y, direction x y, fraction
 *
 * Numbers are separated by blanks. # begins a comment. Paths follow until the end of the file.
 * include/cairn/shape_model.h defines the values. */
#ifndef CAIRN_SHAPE_MODEL_FILE_H
#define CAIRN_SHAPE_MODEL_FILE_H

#include "cairn/file_error.h"
#include "cairn/part_bundle.h"
#include "cairn/shape_image.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The maximum number of samples of an outline, and of all paths. */
#define CAIRN_SHAPE_MODEL_FILE_MAX_OUTLINE 4096
#define CAIRN_SHAPE_MODEL_FILE_MAX_SAMPLES 1024

/* A model on the heap. */
typedef struct cairn_shape_model_file {
    /* view of the arrays below */
    cairn_shape_model model;
    /* [model.sample_count] on the heap */
    cairn_shape_model_sample *samples;
    /* [model.path_count] on the heap */
    cairn_shape_model_path *paths;
    /* [model.outline_count] on the heap */
    cairn_oriented_point *outline;
} cairn_shape_model_file;

/* Builds a model from the outlines of one object. path: used in the error. CAIRN_EMPTY: the object
 * has no symmetric part; statuses of cairn_shape_model_builder_create() and
 * cairn_shape_model_builder_begin(). On failure there is nothing to free.
 *
 * file: set to the model
 * outlines: [count] closed outlines */
CAIRN_CHECKED cairn_status cairn_shape_model_file_build(
    cairn_shape_model_file *file, const cairn_curve *outlines, int32_t count,
    const cairn_shape_model_builder_params *params, const char *path, cairn_file_error *error);

/* Returns 1 when a file has the header of a model.
 *
 * path: file, plain or gzipped */
int32_t cairn_shape_model_file_is(const char *path);

/* Reads a model, plain or gzipped. CAIRN_BAD_FORMAT, CAIRN_TRUNCATED, CAIRN_FULL (beyond the limits
 * above), CAIRN_NOT_FINITE, CAIRN_BAD_ARGUMENT (rejected by cairn_shape_model_check()): the error
 * has the line; CAIRN_IO, CAIRN_NO_MEMORY. On failure there is nothing to free.
 *
 * file: set to the model
 * path: file, plain or gzipped */
CAIRN_CHECKED cairn_status cairn_shape_model_file_read(cairn_shape_model_file *file,
                                                       const char *path, cairn_file_error *error);

/* Writes a model atomically; numbers read back bit-exactly. CAIRN_BAD_ARGUMENT, CAIRN_NOT_FINITE:
 * rejected by cairn_shape_model_check() or beyond the limits; CAIRN_IO, CAIRN_NO_MEMORY.
 *
 * path: target */
CAIRN_CHECKED cairn_status cairn_shape_model_file_write(const cairn_shape_model *model,
                                                        const char *path, cairn_file_error *error);

/* Reads a model from its file, or builds one from a picture of the object by vision and
 * shape_image. traced, unless NULL: the result of shape_image without its outlines; all 0 when a
 * model was read. Statuses of cairn_shape_model_file_read(), cairn_shape_model_file_build(),
 * cairn_shape_image_trace() and cairn_vision_read().
 *
 * file: set to the model
 * path: model file or picture
 * image: parameters of shape_image
 * builder: parameters of the model
 * traced: set to the result of shape_image; NULL: not wanted */
CAIRN_CHECKED cairn_status cairn_shape_model_file_load(
    cairn_shape_model_file *file, const char *path, const cairn_shape_image_params *image,
    const cairn_shape_model_builder_params *builder, cairn_shape_image *traced,
    cairn_file_error *error);

/* Copies a valid model to the heap. CAIRN_NO_MEMORY: there is nothing to free.
 *
 * file: set to the copy
 * model: model to copy */
CAIRN_CHECKED cairn_status cairn_shape_model_file_copy(cairn_shape_model_file *file,
                                                       const cairn_shape_model *model);

/* Mirrors a model: x changes sign, and left and right sides are exchanged.
 *
 * file: the model, changed in place */
void cairn_shape_model_file_mirror(cairn_shape_model_file *file);

/* Draws a model as SVG: its outline, the axes of its paths, and the radii to both sides. Statuses
 * of cairn_shape_model_file_write().
 *
 * title: title of the picture
 * path: target, an SVG file
 * model: a valid model */
CAIRN_CHECKED cairn_status cairn_shape_model_file_draw(const cairn_shape_model *model,
                                                       const char *title, const char *path,
                                                       cairn_file_error *error);

/* Draws the fragments of the model's first outline by part bundles as SVG. cuts: [cut_count] manual
 * fragments; NULL: those of part_bundle. CAIRN_EMPTY: fewer than 3 samples; statuses of
 * cairn_part_bundle_begin() and cairn_shape_model_file_write().
 *
 * title: title of the picture
 * path: target, an SVG file
 * model: a valid model */
CAIRN_CHECKED cairn_status cairn_shape_model_file_draw_parts(const cairn_shape_model *model,
                                                             const cairn_part_bundle_cut *cuts,
                                                             int32_t cut_count, const char *title,
                                                             const char *path,
                                                             cairn_file_error *error);

/* Frees the model.
 *
 * file: model on the heap */
void cairn_shape_model_file_free(cairn_shape_model_file *file);

#ifdef __cplusplus
}
#endif

#endif
