/* Least-squares similarity transform of the model to points of the image. */
#include "src/base/build.h"

#include "src/outlines/contour_grouping_work.h"

void cairn_contour_grouping_add_point(contour_grouping_fit_sums *sums, cairn_vec2 model_point,
                                      cairn_vec2 image_point, cairn_real weight)
{
    sums->weight += weight;
    sums->model_squared += weight * cairn_vec2_norm_squared(model_point);
    sums->dot += weight * cairn_vec2_dot(model_point, image_point);
    sums->cross += weight * cairn_vec2_cross(model_point, image_point);
    sums->model = cairn_vec2_add(sums->model, cairn_vec2_scale(model_point, weight));
    sums->image = cairn_vec2_add(sums->image, cairn_vec2_scale(image_point, weight));
}

cairn_similarity cairn_contour_grouping_fit_pose(const contour_grouping_fit_sums *sums,
                                                 const cairn_similarity *otherwise)
{
    cairn_real spread = sums->model_squared - cairn_vec2_norm_squared(sums->model) /
                                                  cairn_max(sums->weight, CAIRN_REAL_MIN);
    cairn_similarity pose;

    if (!(spread > CAIRN_REAL(1e-6)))
        return *otherwise;
    /* Coordinate sums are the centroids times the weight: the shift is divided by it. */
    pose = cairn_similarity_from_moments(
        sums->model, sums->image, spread,
        sums->dot - cairn_vec2_dot(sums->model, sums->image) / sums->weight,
        sums->cross - cairn_vec2_cross(sums->model, sums->image) / sums->weight);
    if (!(pose.a * pose.a + pose.b * pose.b > 0))
        return *otherwise;
    pose.shift = cairn_vec2_scale(pose.shift, 1 / sums->weight);
    return pose;
}

contour_grouping_fit_sums cairn_contour_grouping_pose_prior(const cairn_similarity *pose,
                                                            cairn_real weight)
{
    static const cairn_real corner = CAIRN_REAL(0.35);
    contour_grouping_fit_sums sums = {.weight = 0};

    for (int32_t i = 0; i < 4; i++) {
        cairn_vec2 model_point = {i % 2 ? corner : -corner, i / 2 ? corner : -corner};

        cairn_contour_grouping_add_point(&sums, model_point,
                                         cairn_similarity_point(*pose, model_point), weight / 4);
    }
    return sums;
}
