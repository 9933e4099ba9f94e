/* Rigid proximity: the inliers of a deformed outline under one similarity transform of the model
 * outline, and that transform. For objects of the model's own shape that are partly
 * occluded.
 *
 * Method: robust fitting by iteratively reweighted least squares from several starts.
 * 1. A transform is fitted to each half of the outline, and to all of it.
 * 2. Samples are reweighted by edge proximity and by their distance from the transformed outline,
 *    and the transform is fitted again.
 * 3. The transform of greatest mean weight wins. Samples deformed to an occluder, or matched only
 *    by deformation, get no weight.
 *
 * Source: this project's. */
#include "src/base/build.h"

#include "src/base/step.h"
#include "src/detection/object_detect_object.h"

/* Standard deviation of a sample's distance from the transformed outline, in sizes, in the last
 * rounds; and factors on it per round. */
static const cairn_real POSITION_SIGMA = CAIRN_REAL(0.012);
static const cairn_real sigma_factor[] = {4, 2, 1, 1};
/* Number of halves of the outline used as starts, besides the whole; and limit of the transform's
 * scale either way. */
enum { HALF_STARTS = 8, ROUND_COUNT = sizeof sigma_factor / sizeof *sigma_factor };
enum { MAX_SCALE_RATIO = 2, UNITS_PER_SAMPLE = 4 };

/* Position of a deformed sample relative to the outline's origin, in sizes. */
static cairn_vec2 normalized_position(const contour_search_fitted_outline *fitted, int32_t i)
{
    return cairn_vec2_scale(cairn_vec2_sub(fitted->outline[i].position, fitted->origin),
                            1 / fitted->size);
}

/* Weighted least-squares similarity transform; 0: none within MAX_SCALE_RATIO. */
static int32_t solve_similarity(const contour_search_fitted_outline *fitted,
                                const cairn_oriented_point *reference, const cairn_real *weight,
                                cairn_similarity *map)
{
    cairn_vec2 from = {0, 0}, to = {0, 0};
    cairn_real sum = 0, spread = 0, dot = 0, cross = 0, scale;

    for (int32_t i = 0; i < fitted->outline_count; i++) {
        sum += weight[i];
        from = cairn_vec2_add(from, cairn_vec2_scale(reference[i].position, weight[i]));
        to = cairn_vec2_add(to, cairn_vec2_scale(normalized_position(fitted, i), weight[i]));
    }
    if (!(sum > 0))
        return 0;
    from = cairn_vec2_scale(from, 1 / sum);
    to = cairn_vec2_scale(to, 1 / sum);
    for (int32_t i = 0; i < fitted->outline_count; i++) {
        cairn_vec2 p = cairn_vec2_sub(reference[i].position, from),
                   q = cairn_vec2_sub(normalized_position(fitted, i), to);

        dot += weight[i] * cairn_vec2_dot(p, q);
        cross += weight[i] * cairn_vec2_cross(p, q);
        spread += weight[i] * cairn_vec2_norm_squared(p);
    }
    if (!(spread > 0))
        return 0;
    *map = cairn_similarity_from_moments(from, to, spread, dot, cross);
    scale = map->a * map->a + map->b * map->b;
    return scale > (cairn_real)1 / (MAX_SCALE_RATIO * MAX_SCALE_RATIO) &&
           scale < MAX_SCALE_RATIO * MAX_SCALE_RATIO;
}

/* Reweights the samples by edge proximity times a Gaussian of their distance from the transformed
 * outline; returns the mean weight. */
static cairn_real reweight(const contour_search_fitted_outline *fitted,
                           const cairn_oriented_point *reference, const cairn_similarity *map,
                           cairn_real sigma, const cairn_real *proximity, cairn_real *weight)
{
    cairn_real sum = 0, denominator = 2 * sigma * sigma * (map->a * map->a + map->b * map->b);

    for (int32_t i = 0; i < fitted->outline_count; i++) {
        cairn_vec2 residual = cairn_vec2_sub(normalized_position(fitted, i),
                                             cairn_similarity_point(*map, reference[i].position));

        weight[i] = proximity[i] * cairn_exp(-cairn_vec2_norm_squared(residual) / denominator);
        sum += weight[i];
    }
    return sum / (cairn_real)fitted->outline_count;
}

void cairn_object_detect_agree_begin(object_detect_agreement *agreement,
                                     const contour_search_fitted_outline *fitted,
                                     const cairn_oriented_point *reference,
                                     const cairn_real *proximity)
{
    agreement->fitted = *fitted;
    agreement->reference = reference;
    agreement->proximity = proximity;
    agreement->best = 0;
    agreement->resume = agreement->units_charged = 0;
}

/* Fits from one start: a half of the outline, or all of it. */
static void fit_from(object_detect_agreement *agreement, int32_t half)
{
    const contour_search_fitted_outline *fitted = &agreement->fitted;
    int32_t count = fitted->outline_count, first = (int32_t)((int64_t)half * count / HALF_STARTS),
            is_whole = half == HALF_STARTS;
    cairn_real *weight = agreement->weight, share = 0;
    cairn_similarity fit;

    for (int32_t i = 0; i < count; i++)
        weight[i] =
            is_whole || (i - first + count) % count < count / 2 ? agreement->proximity[i] : 0;
    for (int32_t round = 0; round < ROUND_COUNT; round++) {
        if (!solve_similarity(fitted, agreement->reference, weight, &fit))
            return;
        share = reweight(fitted, agreement->reference, &fit, POSITION_SIGMA * sigma_factor[round],
                         agreement->proximity, weight);
    }
    if (share > agreement->best) {
        agreement->best = share;
        agreement->map = fit;
    }
}

int cairn_object_detect_agree_step(object_detect_agreement *agreement, cairn_budget *budget)
{
    CAIRN_STEP_BEGIN(agreement->resume);
    for (agreement->start = 0; agreement->start <= HALF_STARTS; agreement->start++) {
        CAIRN_STEP_CHARGE(agreement, resume, budget,
                          1 + UNITS_PER_SAMPLE * agreement->fitted.outline_count);
        fit_from(agreement, agreement->start);
    }
    CAIRN_STEP_END(agreement->resume);
}

void cairn_object_detect_place_outline(const cairn_similarity *map,
                                       const cairn_oriented_point *reference,
                                       contour_search_fit *fit, cairn_object_detection *detection)
{
    for (int32_t i = 0; i < detection->outline_count; i++) {
        cairn_vec2 position =
            cairn_vec2_scale(cairn_similarity_point(*map, reference[i].position), detection->size);

        fit->outline[i].position = cairn_vec2_add(detection->origin, position);
        fit->outline[i].direction =
            cairn_vec2_unit(cairn_similarity_vector(*map, reference[i].direction));
    }
    detection->origin =
        cairn_vec2_add(detection->origin, cairn_vec2_scale(map->shift, detection->size));
    detection->size *= cairn_similarity_scale(*map);
}
