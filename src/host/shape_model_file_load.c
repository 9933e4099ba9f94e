/* Models from whatever shows them. */
#include "src/core/build.h"

#include <string.h>

#include "cairn/shape_model_file.h"
#include "cairn/vision.h"

/* The drawing's gaps, in the model's frame. */
static void take_gaps(cairn_shape_model *m, const cairn_shape_image *shape)
{
    m->gap_count = shape->joined < CAIRN_SHAPE_GAPS ? shape->joined : CAIRN_SHAPE_GAPS;
    for (int32_t i = 0; i < m->gap_count; i++)
        m->gaps[i] = cairn_vec2_scale(cairn_vec2_sub(shape->gaps[i], m->origin), 1 / m->size);
}

static cairn_status load_picture(cairn_shape_model_file *file, const char *path,
                                 const cairn_shape_image_params *image,
                                 const cairn_shape_builder_params *builder,
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
        take_gaps(&file->model, &shape);
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
                                         const cairn_shape_builder_params *builder,
                                         cairn_shape_image *traced, cairn_file_error *error)
{
    memset(file, 0, sizeof *file);
    if (traced != NULL)
        memset(traced, 0, sizeof *traced);
    if (cairn_shape_model_file_is(path))
        return cairn_shape_model_file_read(file, path, error);
    return load_picture(file, path, image, builder, traced, error);
}

static void mirror_point(cairn_oriented_point *p)
{
    p->position.x = -p->position.x;
    p->direction.x = -p->direction.x;
}

void cairn_shape_model_file_mirror(cairn_shape_model_file *file)
{
    int32_t n = file->model.outline_count;

    for (int32_t i = 0; i < file->model.sample_count; i++) {
        cairn_shape_sample *s = &file->samples[i];
        cairn_oriented_point left = s->side[0];
        cairn_real share = s->share[0];

        s->centre.x = -s->centre.x;
        s->side[0] = s->side[1];
        s->side[1] = left;
        s->share[0] = s->share[1];
        s->share[1] = share;
        mirror_point(&s->side[0]);
        mirror_point(&s->side[1]);
    }
    for (int32_t i = 0; i < file->model.gap_count; i++)
        file->model.gaps[i].x = -file->model.gaps[i].x;
    /* Walked the other way round, the inside stays on the same hand. */
    for (int32_t i = 0; i < n; i++) {
        mirror_point(&file->outline[i]);
        file->outline[i].direction = cairn_vec2_scale(file->outline[i].direction, -1);
    }
    for (int32_t i = 0; i < n / 2; i++) {
        cairn_oriented_point p = file->outline[i];

        file->outline[i] = file->outline[n - 1 - i];
        file->outline[n - 1 - i] = p;
    }
}
