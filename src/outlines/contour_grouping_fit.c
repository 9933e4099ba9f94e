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

contour_grouping_pose cairn_contour_grouping_fit_pose(const contour_grouping_fit_sums *sums,
                                                      const contour_grouping_pose *otherwise)
{
    cairn_real spread = sums->model_squared - cairn_vec2_norm_squared(sums->model) /
                                                  cairn_max(sums->weight, CAIRN_REAL_MIN);
    contour_grouping_pose pose = *otherwise;

    if (!(spread > CAIRN_REAL(1e-6)))
        return pose;
    pose.a = (sums->dot - cairn_vec2_dot(sums->model, sums->image) / sums->weight) / spread;
    pose.b = (sums->cross - cairn_vec2_cross(sums->model, sums->image) / sums->weight) / spread;
    if (!(pose.a * pose.a + pose.b * pose.b > 0))
        return *otherwise;
    pose.t = cairn_vec2_scale(
        cairn_vec2_sub(sums->image, contour_grouping_transform_vector(&pose, sums->model)),
        1 / sums->weight);
    return pose;
}

contour_grouping_fit_sums cairn_contour_grouping_pose_prior(const contour_grouping_pose *pose,
                                                            cairn_real weight)
{
    static const cairn_real corner = CAIRN_REAL(0.35);
    contour_grouping_fit_sums sums = {.weight = 0};

    for (int32_t i = 0; i < 4; i++) {
        cairn_vec2 model_point = {i % 2 ? corner : -corner, i / 2 ? corner : -corner};

        cairn_contour_grouping_add_point(
            &sums, model_point, contour_grouping_transform_point(pose, model_point), weight / 4);
    }
    return sums;
}
