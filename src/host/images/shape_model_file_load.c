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

static void mirror_point(cairn_oriented_point *point)
{
    point->position.x = -point->position.x;
    point->direction.x = -point->direction.x;
}

void cairn_shape_model_file_mirror(cairn_shape_model_file *file)
{
    int32_t count = file->model.outline_count;

    for (int32_t i = 0; i < file->model.sample_count; i++) {
        cairn_shape_model_sample *sample = &file->samples[i];
        cairn_oriented_point left = sample->contact[0];
        cairn_real share = sample->outline_share[0];

        sample->centre.x = -sample->centre.x;
        sample->contact[0] = sample->contact[1];
        sample->contact[1] = left;
        sample->outline_share[0] = sample->outline_share[1];
        sample->outline_share[1] = share;
        mirror_point(&sample->contact[0]);
        mirror_point(&sample->contact[1]);
    }
    for (int32_t i = 0; i < file->model.gap_count; i++)
        file->model.gaps[i].x = -file->model.gaps[i].x;
    /* The order of the samples is reversed, so that the interior stays on the same side. */
    for (int32_t i = 0; i < count; i++) {
        mirror_point(&file->outline[i]);
        file->outline[i].direction = cairn_vec2_scale(file->outline[i].direction, -1);
    }
    for (int32_t i = 0; i < count / 2; i++) {
        cairn_oriented_point swapped = file->outline[i];

        file->outline[i] = file->outline[count - 1 - i];
        file->outline[count - 1 - i] = swapped;
    }
}
