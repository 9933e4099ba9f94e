/* Shape models from model files or pictures, and mirror images. */
#include "src/base/build.h"

#include <string.h>

#include "cairn/shape_model_file.h"
#include "cairn/vision.h"

/* Copies the bridged gaps of the drawing, transformed to the model's frame. */
static void copy_gaps(cairn_shape_model *model, const cairn_shape_image *shape)
{
    model->gap_count = shape->bridged_gaps < CAIRN_SHAPE_MODEL_MAX_GAPS
                           ? shape->bridged_gaps
                           : CAIRN_SHAPE_MODEL_MAX_GAPS;
    for (int32_t i = 0; i < model->gap_count; i++)
        model->gaps[i] =
            cairn_vec2_scale(cairn_vec2_sub(shape->gaps[i], model->origin), 1 / model->size);
}

/* Builds a model from a picture. */
static cairn_status load_picture(cairn_shape_model_file *file, const char *path,
                                 const cairn_shape_image_params *image,
                                 const cairn_shape_model_builder_params *builder,
                                 cairn_shape_image *traced, cairn_file_error *error)
{
    cairn_vision_image grey;
    cairn_raster_u8_view view;
    cairn_shape_image shape;
    cairn_status status = cairn_vision_read_grey(&grey, path, error);

    if (status != CAIRN_OK)
        return status;
    view.data = grey.samples;
    view.width = grey.width;
    view.height = grey.height;
    view.stride = grey.width;
    status = cairn_shape_image_trace(&shape, view, image, path, error);
    cairn_vision_free(&grey);
    if (status != CAIRN_OK)
        return status;
    status = cairn_shape_model_file_build(file, shape.outlines, shape.count, builder, path, error);
    if (status == CAIRN_OK)
        copy_gaps(&file->model, &shape);
    if (status == CAIRN_OK && traced != NULL) {
        *traced = shape;
        memset(traced->outlines, 0, sizeof traced->outlines);
        traced->points = NULL;
    }
    cairn_shape_image_free(&shape);
    return status;
}

cairn_status cairn_shape_model_file_load(cairn_shape_model_file *file, const char *path,
                                         const cairn_shape_image_params *image,
                                         const cairn_shape_model_builder_params *builder,
                                         cairn_shape_image *traced, cairn_file_error *error)
{
    memset(file, 0, sizeof *file);
    if (traced != NULL)
        memset(traced, 0, sizeof *traced);
    if (cairn_shape_model_file_is(path))
        return cairn_shape_model_file_read(file, path, error);
    return load_picture(file, path, image, builder, traced, error);
}

void cairn_shape_model_file_mirror(cairn_shape_model_file *file)
{
    cairn_shape_model_mirror(&file->model, file->samples, file->outline, &file->model);
}
