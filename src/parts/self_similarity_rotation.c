/* Order of rotational symmetry.
 *
 * Method:
 * 1. The outline is rotated about its centroid by 1/k turn, k = 2 ... MAX_ROTATION_ORDER.
 * 2. The residual is the sum of distances from each rotated sample to the nearest segment of the
 *    outline; hole samples are compared with holes.
 * 3. The greatest k below the threshold is the order. If every k is below it, any rotation is. */
#include "src/base/build.h"

#include "src/parts/self_similarity_work.h"

enum { MAX_ROTATION_ORDER = 12, SEGMENTS_PER_UNIT = 8 };

/* Threshold of the residual, relative to the mean distance of the outline from its centroid. */
#define MAX_ROTATION_RESIDUAL CAIRN_REAL(0.012)

/* Returns the centroid of a polygon. */
static cairn_vec2 centre_of(const cairn_vec2 *points, int32_t count)
{
    cairn_real area = 0;
    cairn_vec2 sum = {0, 0};

    for (int32_t i = 0; i < count; i++) {
        cairn_vec2 a = cairn_vec2_sub(points[i], points[0]);
        cairn_vec2 b = cairn_vec2_sub(points[i + 1 < count ? i + 1 : 0], points[0]);
        cairn_real twice = cairn_vec2_cross(a, b);

        area += twice;
        sum = cairn_vec2_add(sum, cairn_vec2_scale(cairn_vec2_add(a, b), twice / 3));
    }
    return area != 0 ? cairn_vec2_add(points[0], cairn_vec2_scale(sum, 1 / area)) : points[0];
}

/* Returns the distance of a point to a polygon. */
static cairn_real nearest_distance(const cairn_vec2 *points, int32_t count, cairn_vec2 p)
{
    cairn_real least = 0;

    for (int32_t i = 0; i < count; i++) {
        cairn_segment side = {points[i], points[i + 1 < count ? i + 1 : 0]};
        cairn_real d = cairn_segment_distance(side, p);

        least = i == 0 || d < least ? d : least;
    }
    return least;
}

/* Returns the distance to the nearest segment of the outline, or of any hole. */
static cairn_real outline_distance(const cairn_self_similarity *similarity, int is_hole,
                                   cairn_vec2 p)
{
    const cairn_vec2 *hole = similarity->samples + similarity->params.outline_samples;
    cairn_real least =
        is_hole ? nearest_distance(hole, similarity->hole_count[0], p)
                : nearest_distance(similarity->samples, similarity->params.outline_samples, p);

    for (int32_t h = 1; h < similarity->hole_total && is_hole; h++) {
        hole += similarity->hole_count[h - 1];
        least = cairn_min(least, nearest_distance(hole, similarity->hole_count[h], p));
    }
    return least;
}

/* Rotates a sample of the outline or of a hole, and adds its distance to the residual. */
static void add_sample(cairn_self_similarity *similarity, int32_t i)
{
    cairn_vec2 arm = cairn_vec2_sub(similarity->samples[i], similarity->centre);
    cairn_vec2 rotated =
        cairn_vec2_add(similarity->centre, cairn_transform_direction(similarity->turn, arm));

    similarity->radius_sum += cairn_vec2_norm(arm);
    similarity->residual_sum +=
        outline_distance(similarity, i >= similarity->params.outline_samples, rotated);
}

int cairn_self_similarity_rotation(cairn_self_similarity *similarity, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(similarity->phase_resume);
    CAIRN_STEP_CHARGE(similarity, phase_resume, budget,
                      1 + similarity->params.outline_samples / SEGMENTS_PER_UNIT);
    similarity->centre = centre_of(similarity->samples, similarity->params.outline_samples);
    similarity->rotation_order = 1;
    similarity->matching_orders = 0;
    for (similarity->order = 2; similarity->order <= MAX_ROTATION_ORDER; similarity->order++) {
        cairn_sincos(2 * CAIRN_PI / (cairn_real)similarity->order, &similarity->turn.sine,
                     &similarity->turn.cosine);
        similarity->residual_sum = similarity->radius_sum = 0;
        for (similarity->sample = 0;
             similarity->sample <
             similarity->params.outline_samples + cairn_self_similarity_hole_samples(similarity);
             similarity->sample++) {
            CAIRN_STEP_CHARGE(similarity, phase_resume, budget,
                              1 + similarity->params.outline_samples / SEGMENTS_PER_UNIT);
            add_sample(similarity, similarity->sample);
        }
        if (similarity->residual_sum <= MAX_ROTATION_RESIDUAL * similarity->radius_sum) {
            similarity->rotation_order = similarity->order;
            similarity->matching_orders++;
        }
    }
    if (similarity->matching_orders == MAX_ROTATION_ORDER - 1)
        similarity->rotation_order = 0;
    CAIRN_STEP_END(similarity->phase_resume);
}
