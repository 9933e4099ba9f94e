/* image_capacity: parameters of the objects that work on one image. */
#include "src/host/images/image_capacity.h"

/* The basins of photographs have about 100 pixels, as the windows blur. */
enum { PIXELS_PER_REGION = 32 };
/* Default: maximizes the F measure against human contours (25 photographs). */
static const cairn_real MIN_BOUNDARY_STRENGTH = 2;

/* An edgel for each row and column of a pixel at most. */
static int32_t max_edgels(int32_t width, int32_t height)
{
    return 2 * width * height;
}

cairn_edgel_params cairn_image_capacity_edgel(int32_t width, int32_t height)
{
    cairn_edgel_params params = cairn_edgel_default();

    params.max_width = width;
    params.max_height = height;
    params.max_edgels = max_edgels(width, height);
    return params;
}

cairn_boundary_params cairn_image_capacity_boundary(int32_t width, int32_t height)
{
    cairn_boundary_params params = cairn_boundary_default();

    params.max_width = width;
    params.max_height = height;
    params.max_regions = (width * height + PIXELS_PER_REGION - 1) / PIXELS_PER_REGION;
    params.max_corners = 2 * width * height + 3 * params.max_regions;
    params.min_strength = MIN_BOUNDARY_STRENGTH;
    return params;
}

cairn_skeleton_grouping_params cairn_image_capacity_skeleton(int32_t width, int32_t height,
                                                             int32_t as_written)
{
    cairn_skeleton_grouping_params params =
        as_written ? cairn_skeleton_grouping_as_written() : cairn_skeleton_grouping_default();

    params.max_width = width;
    params.max_height = height;
    params.max_edgels = max_edgels(width, height);
    return params;
}

cairn_self_similarity_params cairn_image_capacity_self_similarity(int32_t outline_samples,
                                                                  int32_t as_written)
{
    cairn_self_similarity_params params =
        as_written ? cairn_self_similarity_as_written() : cairn_self_similarity_default();

    if (outline_samples > 0)
        params.outline_samples = outline_samples;
    if (params.outline_samples < params.max_vertices)
        params.max_vertices = params.outline_samples;
    return params;
}
