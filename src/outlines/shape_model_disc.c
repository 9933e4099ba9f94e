/* Symmetry set of an outline: the discs that touch it at two samples, and the gain of a path through
 * them. shape_model.c describes the method. */
#include "src/base/build.h"

#include "cairn/symmetric_point.h"
#include "src/outlines/shape_model_work.h"

/* Greatest angle between a normal and the chord; close to the tip of a path two samples are
 * ambiguous. */
#define MAX_ANGLE_RAD (80 * (CAIRN_PI / 180))

int cairn_shape_model_disc(const cairn_shape_model_builder *builder, int32_t low, int32_t high,
                           cairn_shape_model_sample *disc)
{
    cairn_oriented_point p = builder->outline[low], q = builder->outline[high];
    cairn_symmetric_point sp;

    if (!cairn_symmetric_point_of(p, q, MAX_ANGLE_RAD, &sp) ||
        sp.deviation > builder->params.max_deviation ||
        cairn_vec2_dot(cairn_vec2_left_perp(p.direction), cairn_vec2_sub(sp.centre, p.position)) <=
            0 ||
        cairn_vec2_dot(cairn_vec2_left_perp(q.direction), cairn_vec2_sub(sp.centre, q.position)) <=
            0)
        return 0;
    disc->centre = sp.centre;
    disc->radius = sp.radius;
    disc->deviation = sp.deviation;
    disc->contact[0] = q;
    disc->contact[1].position = p.position;
    disc->contact[1].direction = cairn_vec2_scale(p.direction, -1);
    disc->outline_share[0] = disc->outline_share[1] = 0;
    return 1;
}

cairn_real cairn_shape_model_gain(const cairn_shape_model_builder *builder, int32_t low,
                                  int32_t high)
{
    cairn_shape_model_sample disc;
    cairn_real clear, scaled;

    if (!cairn_shape_model_disc(builder, low, high, &disc))
        return SHAPE_MODEL_ASYMMETRIC_GAIN;
    clear = builder->params.min_clearance * disc.radius;
    for (int32_t i = builder->outline_first[builder->outline_index];
         i < builder->outline_first[builder->outline_index + 1]; i++)
        if (cairn_vec2_norm_squared(cairn_vec2_sub(builder->outline[i].position, disc.centre)) <
            clear * clear)
            return SHAPE_MODEL_ASYMMETRIC_GAIN;
    scaled = disc.deviation / builder->params.deviation_sigma;
    return cairn_exp(CAIRN_REAL(-0.5) * scaled * scaled) + SHAPE_MODEL_ASYMMETRIC_GAIN;
}
